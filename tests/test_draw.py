"""Pictures are text and bytes: well formed, complete in themselves, and honest about points that do not exist."""

from itertools import combinations
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from test_tiles import unit_on_a_telephone

from camviz.draw import plot, svg
from camviz.draw.gallery import side_by_side
from camviz.draw.labels import overlap, words_of
from camviz.draw.panel import Panel, image_panel
from camviz.draw.picture import Picture, jpeg, png
from camviz.draw.writing import PageWriter

NAN = np.nan


def test_a_line_is_interrupted_where_a_point_does_not_exist():
    written = PageWriter().write(svg.line([(0, 0), (1, 0), (NAN, NAN), (3, 0), (4, 0)], "ink"))
    assert written.count("M") == 2
    assert "nan" not in written


def test_a_lone_point_between_gaps_draws_no_line():
    assert svg.line([(NAN, 0), (1, 1), (NAN, 0)], "ink") == svg.NOTHING


def test_an_outline_with_a_missing_corner_is_not_filled():
    assert svg.polygon([(0, 0), (1, 0), (NAN, 1)], "blue") == svg.NOTHING


def test_words_from_a_file_cannot_become_markup():
    root = ElementTree.fromstring(PageWriter().write(svg.text((0, 0), "<script>&")))
    assert root.text == "<script>&"
    assert len(root) == 0


def test_a_mark_without_a_place_is_left_out():
    (dots,) = svg.dots([(1, 2), (NAN, 3)], "blue")
    assert dots.points.tolist() == [[1, 2]]
    assert svg.text((NAN, 0), "nowhere") == svg.NOTHING


def test_panel_coordinates_return_to_data():
    panel = Panel("p", 10, 20, 300, 150, -2, 4, 7, -1)
    points = np.array([(-2, 7), (4, -1), (0.3, 2.2)])
    np.testing.assert_allclose(panel.data(panel.place(points)), points, atol=1e-12)


def test_an_image_panel_shows_the_whole_of_the_outermost_pixels():
    panel = image_panel("p", 0, 0, 320, 640, 480)
    np.testing.assert_allclose(panel.place([(-0.5, -0.5), (639.5, 479.5)]), [(0, 0), (320, 240)], atol=1e-12)


@pytest.mark.parametrize(("low", "high"), [(0, 1), (-1, 1), (3, 997), (0, 0.004), (-2.5, -1.5)])
def test_ticks_are_round_and_inside(low, high):
    ticks = plot.ticks(low, high, 8)
    step = np.diff(ticks)
    assert ticks.min() >= low - 1e-9
    assert ticks.max() <= high + 1e-9
    assert 3 <= len(ticks) <= 9
    np.testing.assert_allclose(step, step[0])
    leading = step[0] / 10 ** np.floor(np.log10(step[0]) + 1e-9)
    assert np.isclose(leading, [1, 2, 5]).any()


@pytest.mark.parametrize("limits", [(-0.34, 0.34), (1.01, 1.49), (0.0, 0.41), (-3.0, 7.0), (100.0, 340.0)])
@pytest.mark.parametrize("height", [40, 85, 300])
def test_an_axis_names_two_values_at_least(limits, height):
    panel = plot.plot_panel("low", 70, 0, 300, height, (0, 1), limits)
    assert len(plot.axes(panel, "", "", xticks=[]).of("tick end")) >= 2


def picture() -> Picture:
    grey = np.full((4, 6), 100, np.uint8)
    body = svg.image("a", 0, 0, 6, 4) + svg.image("b", 6, 0, 6, 4)
    return Picture.whole(body, 12, 4, "Title", "f < 3 & rising", {"a": jpeg(grey), "b": png(grey)})


def test_a_saved_picture_needs_nothing_else(tmp_path):
    picture().save(tmp_path / "picture.svg")
    root = ElementTree.parse(tmp_path / "picture.svg").getroot()
    links = [
        image.get("{http://www.w3.org/1999/xlink}href") for image in root.iter("{http://www.w3.org/2000/svg}image")
    ]
    assert [link.partition(";")[0] for link in links] == ["data:image/jpeg", "data:image/png"]
    assert root.find("{http://www.w3.org/2000/svg}desc").text == "f < 3 & rising"


def test_the_figure_carries_its_description_as_alternative_text():
    assert 'alt="Title. f &lt; 3 &amp; rising"' in picture().figure()


def test_photographs_keep_their_colours_on_the_way_through():
    colours = np.zeros((32, 32, 3), np.uint8)
    colours[..., 0], colours[..., 2] = 200, 30
    for encoded in (jpeg(colours, 95), png(colours)):
        decoded = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
        np.testing.assert_allclose(decoded.reshape(-1, 3).mean(axis=0), (200, 0, 30), atol=4)


def test_an_image_that_cannot_be_encoded_is_refused_in_words():
    with pytest.raises(ValueError, match=r"uint8 .* got float64 \(2, 2, 3\)"):
        jpeg(np.zeros((2, 2, 3)))


def test_a_long_caption_has_room_where_its_letters_are_large():
    grey = np.zeros((30, 40), np.uint8)
    caption = "the slice at row 48, every u made 16 pixels tall, and as many again below it"
    for others in (0, 1, 3, 5):
        tiles = side_by_side({caption: grey} | {f"{i}": grey for i in range(others)}).tiles
        for tile in tiles:
            x, y, width, height = tile.cell
            for unit in (1.0, unit_on_a_telephone(tile)):
                (words,) = words_of(tile.marks, (x, y, x + width, y + height), unit)
                assert y + 10 + 0.75 * (width - 20) < words.box[1] < words.box[3] < y + height


def test_pictures_side_by_side_stand_in_rows_that_do_not_cover_each_other():
    tall = {f"{i}": np.zeros((90 if i == 1 else 30, 40), np.uint8) for i in range(7)}
    boxes = [(x, y, x + width, y + height) for x, y, width, height in (t.cell for t in side_by_side(tall).tiles)]
    assert [pair for pair in combinations(boxes, 2) if overlap(*pair)] == []
    assert max(right for _, _, right, _ in boxes) == 960


def test_pictures_side_by_side_name_all_captions():
    row = side_by_side({"before": np.zeros((30, 40, 3), np.uint8), "after": np.zeros((30, 40), np.uint8)})
    assert "before; after" in row.description
    assert set(row.photographs) == {"picture0", "picture1"}
    ElementTree.fromstring(row.standalone())
