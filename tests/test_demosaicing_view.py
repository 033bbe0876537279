"""The demosaicing visualizer shows true pictures and true numbers, and marks where false colour must be."""

import re
import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from camviz import mosaics
from camviz.mosaics import BAYER, XTRANS
from camviz.scenes import to_display, to_linear
from camviz.scenes.photographs import photograph
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


def test_the_loupe_names_the_frequency_and_the_beat():
    """(0.40, 0) lies 0.1 from Bayer's carrier (½, 0): false colour repeats after 10 pixels."""
    view = DemosaicingView(highest=0.5, u=230.9, v=128)
    fu, fv = view.frequency
    assert (fu, fv) == pytest.approx((0.4, 0), abs=0.003)
    assert view.numbers()["carrier"] == "(½, 0): beats once in 10 px"
    assert "cycles/px" not in " ".join(DemosaicingView(picture="garden").numbers().values())
    carrier, away = nearest_carrier(BAYER["RGGB"], -0.45, 0.02)  # through the sampling grid
    assert (carrier.fu, carrier.fv) == (0.5, 0)
    np.testing.assert_allclose(away, (0.05, 0.02), atol=1e-12)
    assert DemosaicingView(pattern="X-Trans", algorithm="Menon").used == "bilinear"  # Menon is for Bayer's patterns


@pytest.mark.parametrize("name", ["RGGB", "X-Trans", "RGBW", "quad-Bayer"])
def test_the_rings_stand_where_even_false_colour_is(name):
    """At a ring, and not between rings, a coarse blur leaves colour."""
    view = DemosaicingView(pattern=name)
    even = np.linalg.norm(cv2.GaussianBlur(view.rebuilt.astype(float), (0, 0), 2.5) @ np.array(
        [(2, -1, -1), (-1, 2, -1), (-1, -1, 2)]), axis=-1)  # fmt: skip
    places = np.rint(127.5 + _everywhere(view.filters, 0.55) * 256 / 1.2).astype(int)
    around = [even[v - 10 : v + 11, u - 10 : u + 11].max() for u, v in places]
    assert min(around) > 3 * np.median(even[96:160, 96:160])
    drawn = view.figure(draft=True).marks.panels()[view._panel.name].marks.of("paper-line")
    rings = max((mark.lines for mark in drawn), key=len)
    middles = [view._panel.data((ring.min(axis=0) + ring.max(axis=0)) / 2) for ring in rings]
    expected = 127.5 + _everywhere(view.filters, 0.6) * 256 / 1.2
    np.testing.assert_allclose(sorted(map(tuple, middles)), sorted(map(tuple, expected)), atol=0.01)


def test_carriers_that_look_alike_are_all_marked():
    """(½, 0) is (−½, 0); with the other two, Bayer's eight places around the middle."""
    assert len(_everywhere(BAYER["RGGB"], 0.6)) == 8
    assert len(_everywhere(BAYER["RGGB"], 0.45)) == 0
    assert {tuple(np.abs(place).round(3)) for place in _everywhere(XTRANS, 0.4)} == {
        (0.333, 0.333), (0.333, 0), (0, 0.333)}  # fmt: skip


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


@pytest.mark.parametrize(("function", "algorithm"), [(malvar_green, "Malvar"), (edge_green, "edge-aware")])
@pytest.mark.parametrize("pattern", BAYER)
def test_a_right_green_makes_the_algorithms_picture(pattern, function, algorithm):
    view = DemosaicingView(
        picture="astronaut", panels="picture yours", pattern=pattern, algorithm=algorithm, yours=function
    )
    pixels, problem = view.your_picture
    assert problem == ""
    np.testing.assert_allclose(pixels.astype(int), view.rebuilt, atol=1)
    figure = view.but(panels="picture yours figures").figure()
    assert cv2.PSNR(attached(figure, "yours"), pixels) > 27
    worth = f"{view.measures.psnr_db:.2f} dB"
    texts = {text.words for text in figure.marks.texts()}
    assert {worth, f"{worth}, ΔC = {view.measures.false_colour:.1f}"} <= texts
    other = view.but(yours=lambda around: function(around) + 0.05)
    assert other.measures == view.measures
    assert mosaics.psnr(other.your_picture[0], view.truth) < view.measures.psnr_db


@pytest.mark.parametrize("show", ["rebuilt", "mosaic", "false colour"])
@pytest.mark.parametrize("pattern", ["RGGB", "GBRG", "X-Trans", "quad-Bayer"])
def test_a_right_mosaic_makes_the_same_picture(pattern, show):
    view = DemosaicingView(picture="garden", panels="picture yours", pattern=pattern, show=show, your_mosaic=mosaic)
    pixels, problem = view.your_picture
    assert problem == ""
    right = to_display(mosaics.in_colour(view.measured, view.filters)) if show == "mosaic" else view.rebuilt
    np.testing.assert_allclose(pixels.astype(int), right, atol=1)
    blurred = view.but(spots_px=1.0, show="rebuilt")  # a mosaic is taken of blurred light
    np.testing.assert_allclose(blurred.your_picture[0].astype(int), blurred.rebuilt, atol=1)
    wrong = view.but(your_mosaic=lambda picture, tile: mosaic(picture, tile[:, ::-1]))
    assert np.abs(wrong.your_picture[0].astype(int) - right).max() > 50


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
