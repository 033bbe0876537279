"""The pinhole visualizer shows what the optics say, and its controls do what they are named for."""

import re

import cv2
import numpy as np
import pytest
from test_tiles import problems, unit_on_a_telephone

from camviz import optics
from camviz.scenes import to_linear
from camviz_school.views.box_in_space import TOWER, TOWER_M, WALL_MM
from camviz_school.views.pinhole import LAMP_PX, PIXELS, PinholeView

ENDS = [
    (name, value)
    for name, control in PinholeView.controls().items()
    for value in ((control.low, control.high) if control.low is not None else (True, False))
]


@pytest.mark.parametrize(("name", "value"), ENDS)
def test_both_ends_of_every_control_draw_and_change_the_picture(name, value):
    view = PinholeView()
    if getattr(view, name) == value:
        return
    other = view.but(**{name: value}).figure(draft=True)
    first = view.figure(draft=True)
    assert other.body != first.body or other.photographs != first.photographs
    assert "NaN" not in other.body
    assert "nan" not in other.body


def test_the_camera_of_the_box_projects_as_opencv_does():
    view = PinholeView(depth_mm=35, object_m=2.2)
    points = TOWER + np.array([(0.2, -0.3, 0.1), (-0.4, 0.1, 2.0), (0, 0, 0)])
    K = view.camera().intrinsics.K
    expected = cv2.projectPoints(points - TOWER + (0, 0, 2.2), np.zeros(3), np.zeros(3), K, None)[0].reshape(-1, 2)
    np.testing.assert_allclose(view.camera().project(points), expected, atol=1e-9)


def test_the_tower_is_as_tall_on_the_wall_as_similar_triangles_say():
    view = PinholeView(depth_mm=40, object_m=2.0)
    top, bottom = view.camera().project(TOWER + np.array([(0, -TOWER_M / 2, 0), (0, TOWER_M / 2, 0)]))
    tall_mm = (bottom - top)[1] * WALL_MM[0] / PIXELS
    assert tall_mm == pytest.approx(40 * 1.16 / 2.0)
    assert f"= {tall_mm:.1f} mm" in view.equation()


def test_the_numbers_are_those_of_the_optics():
    view = PinholeView(hole_mm=0.4, depth_mm=60, object_m=1.5, exposure_s=2)
    numbers = view.numbers()
    blur = optics.pinhole_blur_mm(0.4, 60, 1500)
    assert numbers["blur on the wall"] == f"{1000 * blur:.0f} µm = {blur / 0.075:.1f} px"
    assert numbers["f-number"] == "f/150"
    assert numbers["field of view"].startswith("33.4°")
    assert numbers["brightness"] == f"{optics.sunny_exposure(0.4, 60, 2):.1f} × correct"


def test_a_reader_who_is_to_predict_the_blur_is_shown_none():
    quiet = PinholeView(panels="box picture numbers")
    for word in ("blur", "Airy", "shadow"):
        assert word not in quiet.description()
        assert word not in quiet.figure(draft=True).body
        assert word in PinholeView().description()
    assert quiet.dragged("orbit", 0, 0, 30, 10).eye != quiet.eye


def by_a_reader(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:] + (cx, cy)


def test_a_reader_s_projection_draws_the_garden_where_camviz_does():
    view = PinholeView(depth_mm=40, object_m=2.5, panels="picture yours", yours=by_a_reader)
    body = view.figure(draft=True).body
    (right,), (yours,) = (re.findall(rf'<path d="([^"]*)" class="{colour}"', body) for colour in ("yellow", "orange"))
    assert yours == right
    assert len(right) > 5000
    corner = TOWER + (0.31 * np.cos(0.5) - 0.31 * np.sin(0.5), 0.58, -0.31 * np.sin(0.5) - 0.31 * np.cos(0.5))
    panel = view.camera().project(corner)  # a foot of the crate, which is turned by half a radian
    places = np.array([place.split(",") for place in re.findall(r"-?[\d.]+,-?[\d.]+", right)], dtype=float)
    assert np.linalg.norm(places - (panel + 0.5) * 440 / PIXELS, axis=1).min() < 0.2


def test_a_wrong_projection_is_drawn_and_one_that_stops_is_told_of():
    view = PinholeView(panels="picture yours", yours=lambda points, f, cx, cy: f * points[..., :2] + (cx, cy))
    assert 'class="orange"' in view.figure(draft=True).body
    for function, words in ((None, "No function"), (lambda *_: None, "yours appears here"), (lambda x: x, "no answer")):
        figure = view.but(yours=function).figure(draft=True)
        assert words in figure.body
        assert 'class="orange"' not in figure.body
        assert "nan" not in figure.body


def test_an_unwritten_projection_leaves_the_right_outlines_greyed():
    body = PinholeView(panels="picture yours", yours=lambda *_: None).figure(draft=True).body
    (awaited,) = re.findall(r'class="awaited">(.*)</g>', body)
    left, greyed = re.findall(r'<path d="([^"]*)" class="yellow"', body)
    assert greyed == left
    assert greyed in awaited


def tiles(view):
    return [tile.name for tile in view.figure(draft=True).tiles]


def test_a_picture_alone_is_all_there_is_until_the_reader_opens_more():
    alone = PinholeView(panels="picture")
    assert tiles(alone) == ["picture on the wall"]
    assert alone.figure(draft=True).body.count(" ringed") == 0
    opened = alone.with_panels({"box": True})
    assert tiles(opened) == ["picture on the wall", "box"]
    assert opened.figure(draft=True).body.count(" ringed") == 4
    assert tiles(opened.with_panels({"numbers": True}))[2:] == ["numbers", "similar triangles"]
    assert tiles(opened.with_panels({"picture": False})) == ["box"]


@pytest.mark.parametrize("turned", [True, False])
def test_a_lamp_anywhere_on_its_ray_has_one_place_in_the_picture(turned):
    """In the box its dot and its ray lead on; on the wall its mark stays where OpenCV projects the lamp."""

    def mark(lamp_m):
        view = PinholeView(object_m=4.0, lamp_m=lamp_m, panels="picture box", turn_picture=turned)
        body = view.figure(draft=True).body
        ((x, y),) = re.findall(r'<path d="M([\d.]+),([\d.]+)h0" class="yellow ringed', body)
        return (float(x), float(y)), view

    (near, first), (far, second) = mark(0.5), mark(3.9)
    assert near == far
    K, (lamp,) = first.camera().intrinsics.K, second._ray_starts().values()
    pixel = cv2.projectPoints(lamp.reshape(1, 1, 3), np.zeros(3), np.zeros(3), K, None)[0].ravel()
    np.testing.assert_allclose(pixel - K[:2, 2], LAMP_PX)
    assert np.linalg.norm(lamp) == pytest.approx(3.9)
    shown = pixel if turned else (PIXELS - 1, PIXELS * 0.75 - 1) - pixel
    np.testing.assert_allclose(near, (shown + 0.5) * 380 / PIXELS, atol=0.06)  # drawn to a tenth
    assert first.figure(draft=True).body != second.figure(draft=True).body


def test_a_lamp_behind_the_camera_is_refused_by_name():
    with pytest.raises(ValueError, match="lamp_m must not be below zero, got -1"):
        PinholeView(lamp_m=-1.0)


@pytest.mark.parametrize(
    "panels",
    ["picture", "box picture", "picture blur", "picture yours", "picture yours numbers", "box picture blur numbers"],
)
def test_words_stand_free_in_every_set_of_panels(panels):
    view = PinholeView(panels=panels, yours=by_a_reader)
    for tile in view.figure(draft=True).tiles:
        assert problems(tile, 1.0) + problems(tile, unit_on_a_telephone(tile)) == []


@pytest.mark.parametrize("panels", ["", "numbers", "picture attic"])
def test_panels_that_there_are_not_are_refused(panels):
    with pytest.raises(ValueError, match="panels must be one or more of box, picture, yours, blur"):
        PinholeView(panels=panels)


def test_the_description_states_the_state():
    words = PinholeView(hole_mm=0.25, depth_mm=70, object_m=4.0).description()
    for part in ("hole of 0.25 mm", "70 mm before the wall", "4 m from the globe", "f/280", "upside down"):
        assert part in words
    assert "Picture shown upright" in PinholeView(turn_picture=True).description()


def test_the_picture_on_the_wall_is_the_upright_one_turned_by_180_degrees():
    def shown(view):
        data = np.frombuffer(view.figure(draft=True).photographs["wall"], np.uint8)
        return cv2.imdecode(data, cv2.IMREAD_COLOR).astype(float)

    wall, upright = shown(PinholeView()), shown(PinholeView(turn_picture=True))
    assert np.abs(wall[::-1, ::-1] - upright).mean() < 4  # JPEG
    assert np.abs(wall - upright).mean() > 30


def test_a_mark_in_the_picture_sits_where_the_camera_projects_it():
    view = PinholeView()
    upright, hanging = view.but(turn_picture=True)._pixel((0, -0.58, 0)), view._pixel((0, -0.58, 0))
    assert upright[1] < (PIXELS * 0.75 - 1) / 2 < hanging[1]
    np.testing.assert_allclose(upright + hanging, (PIXELS - 1, PIXELS * 0.75 - 1))


def test_twice_the_hole_lets_four_times_the_light_in():
    quiet = PinholeView(noise=False, exposure_s=0.1)
    assert quiet.but(hole_mm=0.6).brightness == pytest.approx(4 * quiet.brightness)
    assert quiet.but(hole_mm=0.6).image(160).mean() > 1.4 * quiet.image(160).mean()


def test_a_matched_exposure_is_correct_and_takes_longer_through_a_smaller_hole():
    wide, narrow = (PinholeView(hole_mm=d, match_exposure=True) for d in (1.0, 0.1))
    assert wide.brightness == pytest.approx(1)
    assert narrow.brightness == pytest.approx(1)
    assert narrow.exposed_s == pytest.approx(100 * wide.exposed_s)


def test_both_too_wide_and_too_narrow_a_hole_blur_the_picture():
    def detail(hole):
        grey = cv2.cvtColor(PinholeView(hole_mm=hole, match_exposure=True, noise=False).image(), cv2.COLOR_RGB2GRAY)
        return cv2.Laplacian(grey.astype(float), cv2.CV_64F).std()

    best = detail(0.28)
    assert best > 2 * detail(0.08)
    assert best > 2 * detail(1.0)


def test_the_grain_of_a_picture_is_that_of_counted_photons():
    """Poisson: relative noise 1/sqrt(n). An eighth of the light is sqrt(8) times as grainy."""

    def grain(exposure_s):
        view = PinholeView(exposure_s=exposure_s)
        noisy, clean = (v.image().astype(float) for v in (view, view.but(noise=False)))
        flat = (slice(300, 330), slice(60, 420))
        linear = [to_linear(picture[flat] / 255) for picture in (noisy, clean)]
        return np.std(linear[0] - linear[1]) / np.mean(linear[1])

    assert grain(0.1) / grain(0.8) == pytest.approx(np.sqrt(8), rel=0.15)


def test_an_over_exposed_picture_is_white():
    assert PinholeView(hole_mm=2.0, exposure_s=10).image(160).min() > 250


def test_dragging_the_curve_changes_the_hole_and_dragging_the_box_walks_around_it():
    view = PinholeView()
    wider = view.dragged("hole", 300, 450, 40, 0)
    assert wider.hole_mm > view.hole_mm
    assert wider.eye == view.eye
    assert view.pressed("hole", "ArrowLeft").hole_mm < view.hole_mm
    assert view.dragged("hole", 0, 0, -9999, 0).hole_mm == pytest.approx(0.05)
    turned = view.dragged("orbit", 0, 0, 30, 10)
    assert turned.eye != view.eye
    assert turned.hole_mm == view.hole_mm
    assert view.pressed("orbit", "+").eye.distance < view.eye.distance


@pytest.mark.parametrize("name", ["hole_mm", "depth_mm", "object_m", "exposure_s"])
@pytest.mark.parametrize("value", [0, -1.0])
def test_a_length_or_time_that_is_not_positive_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        PinholeView(**{name: value})
