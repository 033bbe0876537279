"""The colour visualizer: what it shows is what the physics says, and every control shows."""

from __future__ import annotations

import html
import re
import warnings

import cv2
import numpy as np
import pytest

from camviz.colour import balance, spectra
from camviz.colour.spaces import to_srgb
from camviz.scenes.light import to_display, to_encoded, to_linear
from camviz.scenes.photographs import photograph
from camviz_school.course.material import module
from camviz_school.views.colour import LAMPS, PARTS, ColourView

lesson13 = module("13")

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour


def test_the_chart_is_as_far_from_the_truth_as_colour_science_says():
    view = ColourView(method="chosen patch", patch=20, light="daylight", kelvin=5000, tint=0.3)
    white = colour.xy_to_XYZ((0.3127, 0.3290))
    space = colour.RGB_COLOURSPACES["sRGB"].copy()
    space.use_derived_transformation_matrices(True)
    lab = [
        colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white))
        for xyz in (colour.RGB_to_XYZ(view.chart, space), view.shot.true_chart)
    ]
    np.testing.assert_allclose(view.errors, colour.delta_E(*lab, method="CIE 2000"), atol=1e-4)


def test_what_the_picture_says_is_on_the_patches():
    view = ColourView()
    (chart,) = (tile for tile in view.figure(draft=True).tiles if tile.name == "chart")
    assert [text.words for text in chart.marks.of("tick")] == [f"{error:.1f}" for error in view.errors]


def test_without_balance_nothing_is_multiplied_and_balance_makes_its_patch_grey():
    assert ColourView(method="none").gains.tolist() == [1, 1, 1]
    for patch in (18, 21):
        view = ColourView(method="chosen patch", patch=patch)
        np.testing.assert_allclose(np.ptp(view.chart[patch]), 0, atol=1e-9)
    assert np.ptp(ColourView(method="chosen patch", patch=14).chart[19]) > 0.2  # red taken for grey


@pytest.mark.parametrize("light", ["Planckian", "daylight", *LAMPS])
def test_a_balanced_camera_with_a_matrix_is_nearly_right_in_every_light(light):
    view = ColourView(light=light, method="chosen patch", patch=20, kelvin=4500)
    assert view.errors.mean() < 1.2
    assert view.but(matrix="off").errors.mean() > 4 * view.errors.mean()
    assert view.but(method="none").errors.mean() > 10


def test_a_matrix_made_for_daylight_is_worse_in_other_light():
    view = ColourView(kelvin=2850, method="chosen patch", patch=20)
    assert view.but(matrix="for daylight").errors.mean() > 1.5 * view.errors.mean()


def test_after_gamma_the_same_numbers_are_wrong():
    view = ColourView(kelvin=2850, method="chosen patch", patch=20)
    assert view.but(gamma="before the balance").errors.mean() > 8 * view.errors.mean()


def test_a_tinted_light_needs_a_set_tint():
    """Temperature alone leaves a green cast; with the tint that the light has, greys are grey."""
    view = ColourView(light="daylight", kelvin=5000, tint=0.5, method="by hand", camera="CIE observer")
    kelvin, duv = (float(part) for part in re.findall(r"[\d.+]+", view.numbers()["light"]))
    best = min(view.but(set_kelvin=float(k)).errors[18:].mean() for k in range(2000, 12001, 250))
    assert best > 5
    assert view.but(set_kelvin=kelvin, set_tint=duv).errors[18:].mean() < 0.5


def test_grey_world_believes_the_photograph():
    """Coffee on a brown table is taken for brown light: the chart comes out bluish."""
    view = ColourView(light="daylight", kelvin=6500, method="grey world", scene="coffee")
    rgb = view.chart[20]
    assert rgb[2] > 1.3 * rgb[0]
    own = view.but(picture=np.full((40, 60, 3), 128, np.uint8))
    np.testing.assert_allclose(np.ptp(own.chart[20]), 0, atol=0.02)


def test_metamers_are_one_colour_to_the_camera_and_two_to_the_eye():
    view = ColourView(light="daylight", kelvin=5000, metamer=True, patch=5)
    one, other = view.shot.raw(view.reflectances)
    np.testing.assert_allclose(one, other, atol=1e-12)
    seen = balance.seen(view.power, view.reflectances)
    assert np.abs(to_srgb(seen[0] - seen[1])).max() > 0.01
    assert view.numbers()["its metamer"].endswith("sensor 0")
    assert "none" in view.but(camera="CIE observer").numbers()["its metamer"]


def test_a_metamer_is_one_surface_in_all_lights_and_daylight_of_5000_kelvin_does_not_tell_it_from_its_patch():
    view = ColourView(light="daylight", kelvin=5000, metamer=True, patch=5)
    for other in (view.but(kelvin=12000), view.but(light="white LED"), view.but(tint=0.5)):
        np.testing.assert_array_equal(other.reflectances, view.reflectances)
        one, twin = other.shot.raw(other.reflectances)
        assert f"sensor {np.abs(one - twin).max():.3f}" in other.numbers()["its metamer"]
        assert np.abs(one - twin).max() > 0.01


def test_the_photograph_is_that_of_the_surfaces_pixel_by_pixel():
    """A camera that sees as the eye, its balance and its matrix give back, in daylight, the photograph that went in."""
    view = ColourView(light="daylight", kelvin=6504, camera="CIE observer", method="chosen patch", patch=20)
    small = cv2.resize(photograph("coffee"), None, fx=416 / 600, fy=416 / 600, interpolation=cv2.INTER_AREA)
    image = view.image(draft=False)
    assert np.abs(image.astype(int) - small).mean() < 1.5


def test_the_encoded_picture_is_multiplied_after_the_curve():
    view = ColourView(gamma="before the balance", method="chosen patch", matrix="off")
    raw = view._surfaces(208) @ view.shot.raw_from_srgb.T
    expected = to_encoded(np.clip(raw, 0, 1)) * view.gains
    image = view.image(draft=True)
    np.testing.assert_allclose(image / 255, np.clip(expected, 0, 1), atol=0.012)
    on_chart = to_linear(np.clip(to_encoded(view.shot.raw_chart) * view.gains, 0, 1))
    np.testing.assert_allclose(view.chart, on_chart, atol=1e-12)


@pytest.mark.parametrize(
    ("start", "changes"),
    [
        ({}, [{"kelvin": 2000}, {"kelvin": 12000}, {"tint": -1}, {"tint": 1}]),
        ({}, [{"light": one} for one in ("daylight", *LAMPS)]),
        ({}, [{"camera": one} for one in spectra.CAMERAS]),
        ({}, [{"method": one} for one in ("grey world", "white patch", "chosen patch", "by hand")]),
        ({"method": "by hand"}, [{"set_kelvin": 2000}, {"set_kelvin": 12000}, {"set_tint": -0.03}, {"set_tint": 0.03}]),
        ({}, [{"matrix": "for daylight"}, {"matrix": "off"}, {"gamma": "before the balance"}, {"metamer": True}]),
        ({}, [{"scene": "astronaut"}, {"scene": "chelsea"}, {"scene": "rocket"}]),
    ],
)
def test_every_control_changes_the_picture(start, changes):
    pictures = [ColourView(**start).figure(draft=True)] + [
        ColourView(**{**start, **change}).figure(draft=True) for change in changes
    ]
    shown = {(picture.svg(), picture.photographs["photograph"]) for picture in pictures}
    assert len(shown) >= len(changes)


def test_a_click_chooses_a_patch_and_arrows_walk_over_the_chart():
    view = ColourView(patch=0)
    panel = view._chart_panel()
    assert view.dragged("chart", panel.x + 1, panel.y + 1, 0, 0).patch == 0
    assert view.dragged("chart", panel.x + panel.width - 1, panel.y + panel.height - 1, 0, 0).patch == 23
    assert view.dragged("chart", panel.x + panel.width * 1.5 / 6, panel.y + panel.height * 2.5 / 4, 0, 0).patch == 13
    assert view.pressed("chart", "ArrowRight").patch == 1
    assert view.pressed("chart", "ArrowDown").patch == 6
    assert view.pressed("chart", "ArrowLeft").patch == view.pressed("chart", "ArrowUp").patch == 0
    assert ColourView(patch=23).pressed("chart", "ArrowRight").patch == 23
    assert view.dragged("elsewhere", 0, 0, 5, 5) == view


def test_daylight_begins_at_4000_kelvin():
    assert ColourView(light="daylight").offered()["kelvin"].low == 4000
    assert ColourView(light="Planckian").offered()["kelvin"].low == 2000
    np.testing.assert_array_equal(
        ColourView(light="daylight", kelvin=2000).power, ColourView(light="daylight", kelvin=4000).power
    )


def test_the_description_states_the_state():
    words = ColourView(light="fluorescent, three bands", tint=-0.5, metamer=True).figure(draft=True).description
    for part in ("fluorescent, three bands with tint −0.50", "white balance none", "mean ΔE2000", "metamer eye ΔE"):
        assert part in words


@pytest.mark.parametrize("bad", [{"kelvin": np.nan}, {"light": "moon"}, {"patch": 24}, {"patch": True}, {"metamer": 1}])
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        ColourView(**bad)


def test_a_photograph_given_is_shown_and_kept_in_its_shape():
    given = to_display(to_linear(np.full((300, 200, 3), 0.5)))
    assert ColourView(picture=given).image(draft=False).shape == (300, 200, 3)
    assert ColourView(picture=given).image(draft=True).shape[0] == 208


BESIDE = "chart photograph yours"


def nothing_yet(*given):
    """Not written yet."""


@pytest.mark.parametrize(
    ("part", "function", "state"),
    [
        ("gains", lesson13.grey_world, {"light": "daylight", "kelvin": 6500, "method": "grey world"}),
        ("develop", lesson13.develop, {"light": "daylight", "kelvin": 12000, "method": "chosen patch", "patch": 18}),
    ],
)
def test_a_right_function_of_the_readers_makes_the_views_own_chart_and_photograph(part, function, state):
    view = ColourView(panels=BESIDE, part=part, yours=function, **state)
    rgb, problem = view.your_chart
    assert problem == ""
    np.testing.assert_allclose(rgb, np.clip(view.chart, 0, 1) if part == "develop" else view.chart, atol=1e-9)
    right, own = (
        cv2.imdecode(np.frombuffer(view.figure().photographs[name], np.uint8), cv2.IMREAD_COLOR)
        for name in ("photograph", "your photograph")
    )
    assert np.abs(right.astype(int) - own).max() <= 8  # what rounding leaves after JPEG
    assert f"ΔE2000, {view._off(rgb).mean():.2f} on average" in view.figure().body


def test_a_matrix_of_the_readers_is_fitted_in_every_light():
    view = ColourView(panels=BESIDE, method="chosen patch", patch=18, matrix="for daylight", yours=lesson13.fit_matrix)
    for kelvin in (2500.0, 4000.0, 9000.0):
        lit = view.but(part="matrix", kelvin=kelvin)
        balanced = lit.shot.raw_chart * lit.gains
        fitted = np.linalg.lstsq(balanced, to_srgb(lit.shot.true_chart), rcond=None)[0]
        np.testing.assert_allclose(lit.your_chart[0], balanced @ fitted, atol=1e-9)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("function", [lambda *given: 1 / 0, lambda *given: np.ones(7), None])
def test_a_function_without_an_answer_leaves_an_empty_panel_and_a_sentence(part, function):
    view = ColourView(panels=BESIDE, part=part, yours=function)
    figure = view.figure()
    assert "your photograph" not in figure.photographs
    assert view.your_chart[1].split()[0] in html.unescape(figure.body)
    assert view.errors.mean() == ColourView().errors.mean()


@pytest.mark.parametrize("part", PARTS)
def test_where_a_function_is_awaited_the_right_pictures_stand_greyed(part):
    figure = ColourView(panels=BESIDE, part=part, yours=nothing_yet).figure()
    assert "yours appears here" in figure.body
    right, greyed = (
        cv2.imdecode(np.frombuffer(figure.photographs[name], np.uint8), cv2.IMREAD_COLOR)
        for name in ("photograph", "your photograph")
    )
    assert right.shape == greyed.shape
    assert np.ptp(greyed.astype(int), axis=-1).mean() < 3 < np.ptp(right.astype(int), axis=-1).mean()
    tiles = {tile.name: tile.marks for tile in figure.tiles}
    distances = {name: len(tiles[name].of("tick")) for name in ("chart", "your chart")}
    assert distances == {"chart": 24, "your chart": 0}  # not the right ones, pale


def tiles(**state):
    return {tile.name: tile.cell for tile in ColourView(**state).figure(draft=True).tiles}


def test_a_view_opens_with_the_panels_that_are_asked_for():
    assert list(tiles(panels="chart")) == ["chart"]
    assert list(tiles(panels="surface steps")) == ["surface", "steps"]
    assert list(tiles(panels="photograph yours", yours=lesson13.develop)) == ["photograph", "your photograph"]
    assert set(tiles(panels="chart spectra figures")) == {"chart", "light", "surface", "sensor", "figures"}
    figures = ColourView(panels="chart figures").figure(draft=True)
    assert "chosen patch" not in figures.body
    assert "chosen patch" in ColourView(panels="chart steps figures").figure(draft=True).body
    for bad in ({"panels": "charts"}, {"panels": ""}, {"part": "gamma"}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            ColourView(**bad)


@pytest.mark.parametrize("name", ColourView.openable)
def test_each_button_opens_its_panel_and_closes_it_again(name):
    closed = ColourView(panels="surface")
    opened = closed.with_panels({name: True})
    assert len(opened.figure(draft=True).tiles) > 1
    assert opened.with_panels({name: False}) == closed


@pytest.mark.parametrize(
    "panels", ["chart photograph yours spectra steps figures", "chart yours figures", "surface steps"]
)
def test_panels_stand_beside_each_other_and_never_over_each_other(panels):
    cells = list(tiles(panels=panels, yours=lesson13.develop, metamer=True).values())
    for i, (x, y, width, height) in enumerate(cells):
        assert x + width <= 960
        for left, top, across, down in cells[:i]:
            assert x >= left + across or left >= x + width or y >= top + down or top >= y + height
