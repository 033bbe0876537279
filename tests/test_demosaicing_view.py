"""The demosaicing visualizer shows true pictures and true numbers, and marks where false colour must be."""

import re
import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from every_view import words

from camviz import mosaics
from camviz.mosaics import BAYER, PATTERNS, XTRANS
from camviz.scenes import to_display, to_linear
from camviz.scenes.photographs import photograph
from camviz.views.yours import YOURS_HERE
from camviz_school.course import notebooks
from camviz_school.course.material import lessons_folder, module
from camviz_school.views.demosaicing import LOUPE, DemosaicingView, _everywhere, nearest_carrier

edge_green, malvar_green, mosaic = module("12").edge_green, module("12").malvar_green, module("12").mosaic


def attached(picture, name):
    return cv2.imdecode(np.frombuffer(picture.photographs[name], np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def test_the_picture_is_rebuilt_from_linear_light():
    view = DemosaicingView(picture="astronaut", algorithm="Malvar", pattern="GBRG")
    light = cv2.resize(to_linear(photograph("astronaut")), (256, 256), interpolation=cv2.INTER_AREA)
    rebuilt = mosaics.malvar(mosaics.mosaic(light, BAYER["GBRG"]), BAYER["GBRG"])
    np.testing.assert_allclose(view.rebuilt, to_display(rebuilt), atol=1)
    shown = attached(view.figure(), "picture")
    assert cv2.PSNR(shown, view.rebuilt) > 27  # what JPEG leaves of it


def test_the_numbers_are_those_of_the_picture_shown():
    view = DemosaicingView(picture="astronaut", algorithm="Menon", spots_px=0.5)
    numbers = view.numbers()
    assert numbers["PSNR"] == f"{cv2.PSNR(view.rebuilt, view.truth):.2f} dB"
    assert numbers["false colour"].startswith(f"ΔC = {mosaics.false_colour(view.rebuilt, view.truth):.1f}")
    assert numbers["zippers"].startswith(f"{100 * mosaics.zipper(view.rebuilt, view.truth):.1f} %")
    assert all(value in view.description() for value in numbers.values())


@pytest.mark.parametrize("at", [(0, 0), (100, 60), (255, 255), (101, 61)])
@pytest.mark.parametrize("pattern", ["RGGB", "X-Trans", "RGBW"])
def test_the_loupe_shows_the_pixels_it_stands_on(pattern, at):
    view = DemosaicingView(picture="astronaut", pattern=pattern, show="mosaic", u=at[0], v=at[1])
    picture = view.figure()
    u, v = view.at
    window = np.s_[v - LOUPE // 2 : v + LOUPE // 2, u - LOUPE // 2 : u + LOUPE // 2]
    whole = to_display(mosaics.in_colour(view.measured, view.filters))
    np.testing.assert_array_equal(attached(picture, "loupe measured"), whole[window])
    np.testing.assert_array_equal(attached(picture, "loupe rebuilt"), view.rebuilt[window])
    np.testing.assert_array_equal(attached(picture, "loupe truth"), view.truth[window])


def test_an_algorithm_for_bayers_patterns_gives_way_under_another_and_says_so():
    view = DemosaicingView(pattern="X-Trans", algorithm="Menon")
    assert view.used == "bilinear"
    assert "bilinear (Menon is for Bayer's patterns)" in view.figure().body.replace("&#x27;", "'")
    assert DemosaicingView(pattern="X-Trans", algorithm="nearest").used == "nearest"
    assert DemosaicingView(pattern="GRBG", algorithm="Menon").used == "Menon"


def test_the_loupe_names_the_frequency_and_the_beat():
    """(0.40, 0) lies 0.1 from Bayer's carrier (½, 0): false colour repeats after 10 pixels."""
    view = DemosaicingView(highest=0.5, u=230.9, v=128)
    fu, fv = view.frequency
    assert (fu, fv) == pytest.approx((0.4, 0), abs=0.003)
    assert view.numbers()["carrier"] == "(½, 0): beats once in 10 px"
    assert "cycles/px" not in " ".join(DemosaicingView(picture="garden").numbers().values())


def test_the_nearest_carrier_is_found_through_the_sampling_grid():
    carrier, away = nearest_carrier(BAYER["RGGB"], -0.45, 0.02)
    assert (carrier.fu, carrier.fv) == (0.5, 0)
    np.testing.assert_allclose(away, (0.05, 0.02), atol=1e-12)


@pytest.mark.parametrize("name", ["RGGB", "X-Trans", "RGBW", "quad-Bayer"])
def test_the_rings_stand_where_even_false_colour_is(name):
    """At a ring, and not between rings, a coarse blur leaves colour."""
    view = DemosaicingView(pattern=name)
    even = np.linalg.norm(cv2.GaussianBlur(view.rebuilt.astype(float), (0, 0), 2.5) @ np.array(
        [(2, -1, -1), (-1, 2, -1), (-1, -1, 2)]), axis=-1)  # fmt: skip
    places = np.rint(127.5 + _everywhere(view.filters, 0.55) * 256 / 1.2).astype(int)
    around = [even[v - 10 : v + 11, u - 10 : u + 11].max() for u, v in places]
    assert min(around) > 3 * np.median(even[96:160, 96:160])


def test_carriers_that_look_alike_are_all_marked():
    """(½, 0) is (−½, 0); with the other two, Bayer's eight places around the middle."""
    assert len(_everywhere(BAYER["RGGB"], 0.6)) == 8
    assert len(_everywhere(BAYER["RGGB"], 0.45)) == 0
    assert {tuple(np.abs(place).round(3)) for place in _everywhere(XTRANS, 0.4)} == {
        (0.333, 0.333), (0.333, 0), (0, 0.333)}  # fmt: skip


@pytest.mark.parametrize("name", DemosaicingView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = DemosaicingView.controls()[name]
    base = DemosaicingView(spots_px=0.3)
    ends = control.choices or (control.low, control.high)
    pictures = [base.but(**{name: end}).figure(draft=True) for end in ends]
    assert len({(picture.svg(), picture.photographs["picture"]) for picture in pictures}) == len(ends)


def test_every_pattern_and_algorithm_is_drawn():
    for pattern in DemosaicingView.controls()["pattern"].choices:
        for algorithm in DemosaicingView.controls()["algorithm"].choices:
            view = DemosaicingView(picture="garden", pattern=pattern, algorithm=algorithm)
            assert view.measures.psnr_db > 15
    offered = set(DemosaicingView.controls()["pattern"].choices)
    assert set(PATTERNS) - offered == {"monochrome"}
    assert offered - set(PATTERNS) == {"quad-Bayer"}


def test_quad_bayer_has_each_of_bayers_filters_two_by_two_times():
    tile = np.array(DemosaicingView(pattern="quad-Bayer").filters.tile)
    np.testing.assert_array_equal(tile, np.kron(np.array(BAYER["RGGB"].tile), np.ones((2, 2), int)))


def test_blur_before_sampling_takes_false_colour_away_and_detail_with_it():
    sharp, blurred = (DemosaicingView(algorithm="Menon", spots_px=spots) for spots in (0, 1))
    assert blurred.measures.false_colour < sharp.measures.false_colour / 2
    assert blurred.measures.psnr_db < sharp.measures.psnr_db


def test_dragging_moves_the_loupe_and_nothing_else():
    view = DemosaicingView(u=100, v=100)
    panel = view._panel
    there = panel.place((40, 200)) + (panel.x, panel.y)
    moved = view.dragged("loupe", *there, 5, 5)
    assert (moved.u, moved.v) == pytest.approx((40, 200))
    assert moved.but(u=100, v=100) == view
    assert view.pressed("loupe", "ArrowLeft").at == (99, 100)
    assert view.pressed("loupe", "ArrowDown").at == (100, 101)
    assert view.dragged("loupe", 5000, -5000, 0, 0).at == (256 - LOUPE // 2, LOUPE // 2)


@pytest.mark.parametrize("size", [(90, 140), (300, 200), (700, 900)])
def test_a_photograph_of_ones_own_is_shown_as_it_is_or_smaller(size):
    own = np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)
    view = DemosaicingView(photograph=own)
    assert max(view.truth.shape) == min(max(size), 256)
    if max(size) <= 256:
        np.testing.assert_allclose(view.truth.astype(int), own, atol=1)
    assert "photograph" in view.figure(draft=True).description


@pytest.mark.parametrize(
    "bad",
    [
        {"pattern": "RGBG"},
        {"algorithm": "magic"},
        {"spots_px": np.nan},
        {"photograph": np.zeros((20, 20), np.uint8)},
        {"photograph": np.zeros((20, 20, 3))},
        {"photograph": np.zeros((9, 20, 3), np.uint8)},
    ],
)
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        DemosaicingView(**bad)


def nothing_yet(around):
    """Not written yet."""


def no_mosaic_yet(picture, tile):
    """Not written yet."""


@pytest.mark.parametrize(("function", "algorithm"), [(malvar_green, "Malvar"), (edge_green, "edge-aware")])
@pytest.mark.parametrize("pattern", BAYER)
def test_a_right_green_of_the_readers_makes_the_algorithms_picture(pattern, function, algorithm):
    view = DemosaicingView(
        picture="astronaut", panels="picture yours", pattern=pattern, algorithm=algorithm, yours=function
    )
    pixels, problem = view.your_picture
    assert problem == ""
    np.testing.assert_allclose(pixels.astype(int), view.rebuilt, atol=1)
    figure = view.but(panels="picture yours figures").figure()
    assert cv2.PSNR(attached(figure, "yours"), pixels) > 27
    worth = f"{view.measures.psnr_db:.2f} dB"
    assert {worth, f"{worth}, ΔC = {view.measures.false_colour:.1f}"} <= set(
        re.findall(r">([^<>]+)</text>", figure.svg())
    )
    other = view.but(yours=lambda around: function(around) + 0.05)
    assert other.measures == view.measures
    assert mosaics.psnr(other.your_picture[0], view.truth) < view.measures.psnr_db


@pytest.mark.parametrize(
    ("function", "pattern", "sentence"),
    [
        (nothing_yet, "RGGB", "`nothing_yet` returns nothing yet"),
        (lambda around: around, "RGGB", "answers in shape"),
        (lambda around: around.colour, "RGGB", "AttributeError"),
        (None, "RGGB", "No function of yours"),
        (malvar_green, "X-Trans", "choose one of the four Bayer patterns"),
    ],
)
@pytest.mark.parametrize("show", ["rebuilt", "mosaic", "false colour"])
def test_a_function_without_an_answer_leaves_its_picture_empty_and_a_sentence_in_it(function, pattern, sentence, show):
    view = DemosaicingView(panels="picture yours", pattern=pattern, yours=function, show=show)
    figure = view.figure()
    assert "yours" not in figure.photographs
    assert (YOURS_HERE if function is nothing_yet else sentence) in words(figure.svg())


def test_what_awaits_a_readers_function_is_the_right_picture_greyed():
    waiting = DemosaicingView(panels="picture yours", your_mosaic=no_mosaic_yet).figure()
    assert 'class="awaited"' in waiting.svg()
    broken = DemosaicingView(panels="picture yours", your_mosaic=lambda picture, tile: picture).figure()
    assert 'class="awaited"' not in broken.svg()


@pytest.mark.parametrize("show", ["rebuilt", "mosaic", "false colour"])
@pytest.mark.parametrize("pattern", ["RGGB", "GBRG", "X-Trans", "quad-Bayer"])
def test_a_right_mosaic_of_the_readers_makes_the_same_picture(pattern, show):
    view = DemosaicingView(picture="garden", panels="picture yours", pattern=pattern, show=show, your_mosaic=mosaic)
    pixels, problem = view.your_picture
    assert problem == ""
    right = to_display(mosaics.in_colour(view.measured, view.filters)) if show == "mosaic" else view.rebuilt
    np.testing.assert_allclose(pixels.astype(int), right, atol=1)
    wrong = view.but(your_mosaic=lambda picture, tile: mosaic(picture, tile[:, ::-1]))
    assert np.abs(wrong.your_picture[0].astype(int) - right).max() > 50


def test_a_mosaic_is_taken_of_blurred_light():
    view = DemosaicingView(panels="picture yours", spots_px=1.0, your_mosaic=mosaic)
    np.testing.assert_allclose(view.your_picture[0].astype(int), view.rebuilt, atol=1)


def test_a_view_opens_with_the_panels_that_are_asked_for():
    alone = DemosaicingView(panels="picture").figure()
    assert [tile.name for tile in alone.tiles] == ["picture"]
    assert "PSNR" not in alone.description
    assert "drag the loupe" not in alone.svg()
    numbered = DemosaicingView(panels="picture figures").figure()
    assert "PSNR" in numbered.description
    assert "carrier" not in numbered.description  # it speaks of what is under the loupe
    assert "carrier" in DemosaicingView(panels="picture loupe figures").figure().description
    with pytest.raises(ValueError, match="panels"):
        DemosaicingView(panels="loupe")


@pytest.mark.parametrize("name", DemosaicingView.openable)
def test_a_button_opens_a_panel_and_closes_it(name):
    closed = DemosaicingView(panels="picture")
    opened = closed.with_panels({name: True})
    assert [tile.name for tile in opened.figure().tiles] == ["picture", name]
    assert opened.with_panels({name: False}) == closed


@pytest.mark.parametrize("panels", ["picture yours loupe figures", "picture loupe figures spectrum"])
def test_panels_stand_beside_each_other_and_never_over_each_other(panels):
    cells = [tile.cell for tile in DemosaicingView(panels=panels, yours=malvar_green).figure().tiles]
    for i, (x, y, width, height) in enumerate(cells):
        assert x + width <= 960
        for left, top, *_ in cells[i + 1 :]:
            assert left >= x + width or top >= y + height


def test_the_rings_are_marked_where_something_explains_them():
    alone, beside = (DemosaicingView(panels=one).figure().svg() for one in ("picture", "picture loupe"))
    assert alone.count("paper-line") == 0
    assert beside.count("paper-line") > 0


def test_the_lesson_s_lines_for_a_raw_file_scale_it_from_0_to_1(monkeypatch):
    (path,) = lessons_folder().glob("12_*.ipynb")
    cells = "\n".join(cell.source for cell in notebooks.read(path).cells)
    (code,) = re.findall(r"```python\n(import rawpy.*?)```", cells, re.DOTALL)
    raw = SimpleNamespace(color_desc=b"RGBG", raw_pattern=np.array([[0, 1], [3, 2]]), white_level=16383)
    raw.black_level_per_channel, raw.raw_image_visible = [512] * 4, np.full((6, 8), 512, np.uint16)
    raw.raw_image_visible[2, 3] = 16383
    monkeypatch.setitem(sys.modules, "rawpy", SimpleNamespace(imread=lambda name: raw))
    names = {"mosaics": mosaics}
    exec(code, names)
    assert (names["mosaic"].min(), names["mosaic"].max(), names["picture"].shape) == (0, 1, (6, 8, 3))
