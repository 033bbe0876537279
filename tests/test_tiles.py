"""Pictures flow: on a telephone as on a desk, no two words of a view stand over each other and none is cut off."""

import re
from base64 import b64decode
from itertools import combinations
from xml.etree import ElementTree

import pytest
from every_view import STATES

from camviz.draw import labels, svg
from camviz.draw.flow import SCROLLED, WIDTH, Tile, rows
from camviz.draw.labels import overlap, uncluttered, words_of
from camviz.draw.marks import Inset, Marks
from camviz.draw.plot import legend, plot_panel

TELEPHONE = 259  # CSS pixels that a picture has in JupyterLab on a screen of 375
DESK = (0.0, 0.0, 400.0, 300.0)


def ends(view):
    """The view as it is, and with each control at each of its ends or choices."""
    yield view
    for name, control in view.offered().items():
        for value in control.choices or ((False, True) if control.low is None else (control.low, control.high)):
            yield view.but(**{name: value})


def problems(tile: Tile, unit: float) -> list[str]:
    """The words of a tile that stand over others or reach out of what is seen, at so many picture units a CSS pixel."""
    x, y, width, height = tile.cell
    box = (x, y, x + width, y + height)
    drawn = tile.uncluttered(unit)
    found = words_of(drawn, box, unit)
    clashes = [f"{one.text} over {other.text}" for one, other in combinations(found, 2) if overlap(one.box, other.box)]
    return clashes + [f"{words.text} is cut" for words in found if reaches_out(words.box, words.seen)]


def reaches_out(box: labels.Box, seen: labels.Box) -> bool:
    return any(low < edge - 0.5 for low, edge in zip(box[:2], seen[:2], strict=True)) or any(
        high > edge + 0.5 for high, edge in zip(box[2:], seen[2:], strict=True)
    )


def unit_on_a_telephone(tile: Tile) -> float:
    width = tile.cell[2]
    return max(1.0, width / (560 if width > SCROLLED else TELEPHONE))


@pytest.mark.sampled(32)
@pytest.mark.parametrize("name", STATES)
def test_words_stand_free_at_both_ends_of_every_control(name):
    for view in ends(STATES[name]()):
        tiles = view.figure(draft=True).tiles
        for tile in tiles:
            assert problems(tile, 1.0) == []
            assert tile.words or len(tiles) == 1 or problems(tile, unit_on_a_telephone(tile)) == []


@pytest.mark.sampled(12)
@pytest.mark.parametrize("name", STATES)
def test_the_tiles_of_a_row_fill_it_and_none_covers_another(name):
    cells = [tile.cell for tile in STATES[name]().figure().tiles]
    assert max(x + width for x, _, width, _ in cells) <= WIDTH
    boxes = [(x, y, x + width, y + height) for x, y, width, height in cells]
    assert [pair for pair in combinations(boxes, 2) if overlap(*pair)] == []


@pytest.mark.sampled(12)
@pytest.mark.parametrize("name", STATES)
def test_every_image_of_a_still_is_a_whole_document(name):
    """Browsers show nothing of an SVG image that is not well-formed XML, and say nothing."""
    picture = STATES[name]().figure()
    images = re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', picture.figure())
    assert len(images) == sum(not tile.words for tile in picture.tiles)
    for image in images:
        assert ElementTree.fromstring(b64decode(image)).tag == "{http://www.w3.org/2000/svg}svg"


def test_a_tile_that_a_telephone_scrolls_takes_the_next_line_elsewhere_before_it_is_scrolled():
    panel = plot_panel("plot", 0, 0, 300, 200, (0, 1), (0, 1)).show(svg.NOTHING)
    wide, narrow = (Tile("plot", (0, 0, width, 300), panel).style() for width in (640, 600))
    assert "1 max(560px," in wide
    assert "1 max(432px," in narrow


def test_keys_scroll_what_is_scrolled_on_a_telephone_and_stop_at_nothing_else():
    """WCAG 2.1.1; a tab stop at a tile that never scrolls is one too many."""
    for width, stops in ((SCROLLED, 0), (SCROLLED + 1, 1)):
        tile = Tile("wide", (0, 0, width, 300), svg.NOTHING)
        assert [html.count('tabindex="0"') for html in (tile.html(), tile.image("a.png", "A line"))] == [stops, stops]


def test_a_tick_gives_way_to_a_title_and_a_label_moves_beside_another():
    title, tick = svg.text((10, 20), "Title", "title"), svg.text((12, 22), "0.5", "tick")
    assert [text.words for text in uncluttered(title + tick, DESK)] == ["Title"]
    panel = Marks([Inset("", 0, 0, 400, 300, svg.text((50, 50), "one") + svg.text((52, 52), "two"))])
    one, two = uncluttered(panel, DESK).texts()
    assert (one.x, one.y, two.x, two.y) == (50, 50, 52, pytest.approx(67.21))


def test_a_label_at_the_edge_of_a_panel_moves_inside():
    panel = Marks([Inset("", 0, 0, 400, 300, svg.text((380, 50), "a long label"))])
    moved = words_of(uncluttered(panel, DESK), DESK)[0]
    assert moved.box[2] == pytest.approx(400)


def test_a_legend_grows_as_a_whole_and_another_label_gives_way_to_it():
    panel = plot_panel("plot", 0, 0, 300, 200, (0, 1), (0, 1))
    drawn = legend(panel, [("blue", "one"), ("orange", "two")])
    one, two = words_of(panel.show(drawn), DESK, 2.0)
    assert (two.box[1] - one.box[1], two.box[3] - two.box[1]) == (36, pytest.approx(2 * 12 * 1.17))
    texts = uncluttered(panel.show(drawn + svg.text((37, 20), "another")), DESK).texts()
    places = {text.words: (text.x, text.y) for text in texts}
    assert [places[text.words] for text in drawn.texts()] == [(text.x, text.y) for text in drawn.texts()]
    assert places.get("another") != (37, 20)


def test_a_paragraph_has_more_lines_where_its_letters_are_larger():
    text = svg.paragraph(
        (10, 20), "No word of a picture is smaller than twelve pixels of the page on which it stands.", 300
    )
    assert [len(uncluttered(text, DESK, unit).texts()[0].lines) for unit in (1.0, 2.0)] == [2, 4]


def test_rows_stand_below_each_other():
    cells = rows((300, {"camera": 560, "picture": 400}), (120, {"numbers": 960}))
    assert cells == {"camera": (0, 0, 560, 300), "picture": (560, 0, 400, 300), "numbers": (0, 300, 960, 120)}
