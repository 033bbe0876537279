"""The colour visualizer: what it shows is what the physics says, and every control shows."""

from __future__ import annotations

import re
import warnings

import cv2
import numpy as np
import pytest

from camviz.colour import balance
from camviz.colour.spaces import to_srgb
from camviz.scenes.light import to_encoded, to_linear
from camviz.scenes.photographs import photograph
from camviz_school.course.material import module
from camviz_school.views.colour import LAMPS, ColourView

lesson13 = module("13")

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour


def test_the_chart_is_as_far_off_as_colour_science_says():
    view = ColourView(method="chosen patch", patch=20, light="daylight", kelvin=5000, tint=0.3)
    white = colour.xy_to_XYZ((0.3127, 0.3290))
    space = colour.RGB_COLOURSPACES["sRGB"].copy()
    space.use_derived_transformation_matrices(True)
    lab = [
        colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white))
        for xyz in (colour.RGB_to_XYZ(view.chart, space), view.shot.true_chart)
    ]
    np.testing.assert_allclose(view.errors, colour.delta_E(*lab, method="CIE 2000"), atol=1e-4)


def test_every_patch_has_its_distance_written_on_it():
    assert ColourView(method="none").gains.tolist() == [1, 1, 1]
    view = ColourView(method="chosen patch", patch=18)
    np.testing.assert_allclose(np.ptp(view.chart[18]), 0, atol=1e-9)  # balance makes its patch grey
    (chart,) = (tile for tile in view.figure(draft=True).tiles if tile.name == "chart")
    assert [text.words for text in chart.marks.of("tick")] == [f"{error:.1f}" for error in view.errors]


@pytest.mark.parametrize("light", ["Planckian", "daylight", *LAMPS])
def test_a_balanced_camera_with_a_matrix_is_nearly_right(light):
    view = ColourView(light=light, method="chosen patch", patch=20, kelvin=4500)
    assert view.errors.mean() < 1.2
    assert view.but(matrix="off").errors.mean() > 4 * view.errors.mean()
    assert view.but(method="none").errors.mean() > 10
    reddish = ColourView(kelvin=2850, method="chosen patch", patch=20)
    assert reddish.but(matrix="for daylight").errors.mean() > 1.5 * reddish.errors.mean()
    assert reddish.but(gamma="before the balance").errors.mean() > 8 * reddish.errors.mean()


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


def test_a_metamer_is_one_colour_to_the_camera_in_one_light():
    """It is one surface in all lights, and another colour to the eye."""
    view = ColourView(light="daylight", kelvin=5000, metamer=True, patch=5)
    np.testing.assert_allclose(*view.shot.raw(view.reflectances), atol=1e-12)
    seen = balance.seen(view.power, view.reflectances)
    assert np.abs(to_srgb(seen[0] - seen[1])).max() > 0.01
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


def test_a_click_chooses_a_patch():
    view = ColourView(patch=0)
    panel = view._chart_panel()
    assert view.dragged("chart", panel.x + panel.width * 1.5 / 6, panel.y + panel.height * 2.5 / 4, 0, 0).patch == 13
    assert view.pressed("chart", "ArrowDown").patch == 6
    assert view.pressed("chart", "ArrowLeft").patch == 0


BESIDE = "chart photograph yours"


@pytest.mark.parametrize(
    ("part", "function", "state"),
    [
        ("gains", lesson13.grey_world, {"light": "daylight", "kelvin": 6500, "method": "grey world"}),
        ("develop", lesson13.develop, {"light": "daylight", "kelvin": 12000, "method": "chosen patch", "patch": 18}),
    ],
)
def test_a_right_function_makes_the_views_own_pictures(part, function, state):
    view = ColourView(panels=BESIDE, part=part, yours=function, **state)
    rgb, problem = view.your_chart
    assert problem == ""
    np.testing.assert_allclose(rgb, np.clip(view.chart, 0, 1) if part == "develop" else view.chart, atol=1e-9)
    right, own = (
        cv2.imdecode(np.frombuffer(view.figure().photographs[name], np.uint8), cv2.IMREAD_COLOR)
        for name in ("photograph", "your photograph")
    )
    assert np.abs(right.astype(int) - own).max() <= 8  # what rounding leaves after JPEG
    tiles = {tile.name: tile.marks for tile in view.figure(draft=True).tiles}
    assert [text.words for text in tiles["your chart"].of("tick")] == [f"{error:.1f}" for error in view._off(rgb)]


def test_a_matrix_of_the_readers_is_fitted_in_every_light():
    view = ColourView(panels=BESIDE, method="chosen patch", patch=18, matrix="for daylight", yours=lesson13.fit_matrix)
    for kelvin in (2500.0, 4000.0, 9000.0):
        lit = view.but(part="matrix", kelvin=kelvin)
        balanced = lit.shot.raw_chart * lit.gains
        fitted = np.linalg.lstsq(balanced, to_srgb(lit.shot.true_chart), rcond=None)[0]
        np.testing.assert_allclose(lit.your_chart[0], balanced @ fitted, atol=1e-9)
