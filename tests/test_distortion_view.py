"""The distortion visualizer shows true numbers and true pictures."""

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz.scenes import render, textured_scene, to_display
from camviz.scenes.wall import LAMP, wall_scene
from camviz.views import garden
from camviz.views.distortion import DistortionView, _grid_lines
from camviz.views.written_lens import straightened


def test_the_fold_of_a_plain_barrel_is_named_where_it_is():
    assert DistortionView(k1=-0.3, k2=0).numbers()["fold"] == "r = 1.0541 (46.5°)"


def test_published_stereo_calibration_folds_inside_its_images():
    """OpenCV's samples/data/intrinsics.yml: r = 0.73041 and 0.97853 by the quadratic formula."""
    left = DistortionView(k1=0.29589439552724328, k2=-1.0354662043042675)
    right = DistortionView(k1=-0.16916358306948096, k2=-0.11214173641213163)
    assert left.numbers()["fold"].startswith("r = 0.7304")
    assert right.numbers()["fold"].startswith("r = 0.9785")


def test_a_fisheye_is_shown_with_its_own_numbers():
    """Not with the coefficients that the sliders of a polynomial begin at. θ_d' = 1 - 3 (0.2) θ² is 0 at 73.97°."""
    lens = KannalaBrandt(-0.2)
    view = DistortionView.of(Camera(Intrinsics(752, 480, 190, 190, 375.5, 239.5), lens))
    column = view.figure(draft=True).body.split("This lens")[1]
    assert "k1 −0.2000" in column
    assert "−0.2800" not in column
    assert "p1" not in column
    angle = 1 / np.sqrt(0.6)
    assert view.numbers()["fold"] == f"r = {np.tan(angle):.4f} (74.0°)"
    assert view.numbers()["farthest a ray lands"] == f"r = {angle * (1 - 0.2 * angle**2):.4f}"
    assert view.numbers()["image corner"].endswith("no ray")


def test_a_fold_behind_the_camera_is_given_by_its_angle():
    """θ_d' = 1 - 5 (0.015) θ⁴ is 0 at 109.5°, which no point of the plane z = 1 shows."""
    view = DistortionView.of(Camera(Intrinsics(640, 480, 290, 290, 319.5, 239.5), KannalaBrandt(0, -0.015)))
    assert view.numbers()["fold"] == f"{np.rad2deg((1 / 0.075) ** 0.25):.1f}° off axis"
    assert view.numbers()["image corner"].endswith("°")


@pytest.mark.parametrize("size", [(640, 480), (480, 640), (1000, 300)])
def test_the_straight_lines_reach_beyond_every_corner_of_the_undistorted_picture(size):
    intrinsics = Intrinsics.from_fov(*size, 80)
    lines = intrinsics.to_pixels(_grid_lines(intrinsics, 65))
    assert (lines.reshape(-1, 2).min(axis=0) < -0.5).all()
    assert (lines.reshape(-1, 2).max(axis=0) > np.array(size) - 0.5).all()


def test_a_corner_moves_as_far_as_opencv_says():
    view = DistortionView(k1=-0.2, k2=0.05, p1=0.01, p2=-0.02, k3=0.01, k4=0.02, s1=0.01, s3=-0.02)
    K = view.intrinsics
    corners = np.array([(0.0, 0), (K.width - 1, 0), (0, K.height - 1), (K.width - 1, K.height - 1)])
    rays = np.concatenate([K.from_pixels(corners), np.ones((4, 1))], axis=-1)
    coefficients = np.array([-0.2, 0.05, 0.01, -0.02, 0.01, 0.02, 0, 0, 0.01, 0, -0.02, 0])
    there = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K.K, coefficients)[0].reshape(-1, 2)
    np.testing.assert_allclose(view.moved(corners), np.linalg.norm(there - corners, axis=-1), atol=1e-9)


def test_straightening_the_picture_gives_what_a_perfect_lens_would_have_seen():
    view = DistortionView(k1=-0.28, k2=0.07, show="undistorted")
    straight = view.image(draft=False)
    perfect = to_display(render(textured_scene(), Camera(view.intrinsics.within(garden.FINE))))
    inner = np.s_[40:272, 52:364]  # away from the border, where both have light
    assert cv2.PSNR(straight[inner], perfect[inner]) > 23
    bent = view.but(show="distorted").image(draft=False)
    assert cv2.PSNR(bent[inner], perfect[inner]) < 18


def test_pixels_beyond_the_fold_stay_dark_only_while_folds_are_hidden():
    view = DistortionView(k1=-0.6, k2=0, show="undistorted")
    corner = np.s_[:12, :12]
    assert np.ptp(view.image(draft=True)[corner], axis=(0, 1)).max() == 0
    assert np.ptp(view.but(hide_fold=False).image(draft=True)[corner], axis=(0, 1)).max() > 0


@pytest.mark.parametrize("name", DistortionView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = DistortionView.controls()[name]
    base = DistortionView(k1=-0.3, k2=0.0, show="undistorted")  # it folds, so that hiding the fold shows
    ends = control.choices or ((control.low, control.high) if control.low is not None else (True, False))
    pictures = [base.but(**{name: end}).figure(draft=True) for end in ends]
    assert len({picture.svg() for picture in pictures} | {picture.photographs["camera"] for picture in pictures}) > 2


def test_a_loaded_camera_keeps_its_numbers():
    camera = Camera(Intrinsics(640, 480, 536, 534, 342, 236), BrownConrady(k1=-0.27, k2=-0.04, p1=0.002, k3=0.24))
    view = DistortionView.of(camera)
    assert view.camera.lens == camera.lens
    assert view.camera.intrinsics == camera.intrinsics


def test_a_lens_of_another_kind_is_shown_as_it_is():
    lens = KannalaBrandt(0.007, -0.0014, -0.0003, -0.0005)
    view = DistortionView.of(Camera(Intrinsics(640, 480, 380, 380, 320, 240), lens))
    assert view.camera.lens == lens
    assert "KannalaBrandt" in view.figure(draft=True).description


def test_dragging_walks_around_and_changes_nothing_else():
    view = DistortionView()
    turned = view.dragged("orbit", 0, 0, 50, 10)
    assert turned.eye != view.eye
    assert turned.but(eye=view.eye) == view
    assert view.pressed("orbit", "ArrowLeft").eye != view.eye


def test_the_description_states_the_state():
    words = DistortionView(k1=-0.3, k2=0.0).description()
    assert "k1 = -0.3" in words
    assert "1.0541" in words


@pytest.mark.parametrize("bad", [{"k1": np.nan}, {"k1": "much"}, {"show": "sideways"}, {"hide_fold": 1}])
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        DistortionView(**bad)


def test_a_pole_is_named_where_a_rational_lens_has_one():
    """1 + k4 r² is zero at r = 1/sqrt(-k4)."""
    assert DistortionView(k1=0.0, k2=0.0, k4=-0.25).numbers()["fold"] == "none; pole 2.0000"
    assert DistortionView(k1=0.0, k2=0.0, k4=-1.0).numbers()["corner moves"] == "beyond the pole"
    assert DistortionView(k1=-0.3, k2=0.0, k4=0.0).numbers()["corner moves"] == "folded away"


# One panel first, and what the reader opens ------------------------------------------------------------------------


def tiles(view):
    return [tile.name for tile in view.figure(draft=True).tiles]


def test_a_picture_alone_has_neither_grid_nor_numbers_until_they_are_opened():
    alone = DistortionView(panels="picture")
    assert tiles(alone) == ["the picture"]
    bright, with_grid = (
        [mark for mark in view.figure(draft=True).marks.of("thin") if mark.style.get("stroke") == "#f2c94c"]
        for view in (alone, alone.with_panels({"grid": True}))
    )
    assert (len(bright), len(with_grid)) == (0, 1)
    assert tiles(alone.with_panels({"grid": True})) == ["the picture"]
    assert tiles(alone.with_panels({"curve": True, "numbers": True})) == ["the picture", "radial curve", "numbers"]


def test_a_new_view_has_all_that_can_be_opened_but_one():
    assert DistortionView().opened == ("grid", "curve", "field", "rays", "numbers")


@pytest.mark.parametrize("panels", ["", "grid", "numbers grid", "picture attic", "picture yours curve field rays"])
def test_panels_are_one_to_four_and_known(panels):
    with pytest.raises(ValueError, match="panels must be one to 4 of picture, yours, curve, field, rays"):
        DistortionView(panels=panels)


def test_the_coping_of_the_wall_runs_along_the_upper_border_from_side_to_side():
    """Its lower edge is half a focal length above the axis; the border of the 16:9 picture at 9/16."""
    across = np.linspace(-1, 1, 41)

    def light(height):
        rays = np.stack([across, np.full(41, -height), np.ones(41)], axis=-1)
        return wall_scene().trace((0, 0, 0), rays / np.linalg.norm(rays, axis=-1, keepdims=True))[0]

    assert np.ptp(light(0.505), axis=0).max() < 0.01  # plain stone, from one side to the other
    assert np.ptp(light(0.495), axis=0).max() > 0.05  # bricks
    assert DistortionView.by_the_wall().intrinsics.from_pixels((0, -0.5))[1] == pytest.approx(-9 / 16)


def test_beyond_the_fold_one_recognises_the_lamp_a_second_time():
    """r - 0.5 r³ has one value at the lamp and, farther out on the same line, at a second root within the picture."""
    view = DistortionView.by_the_wall(k1=-0.5, show="undistorted", hide_fold=False)
    lamp = np.array(LAMP[:2]) / LAMP[2]
    r = np.hypot(*lamp)
    again = max(np.roots([-0.5, 0, 1, -(r - 0.5 * r**3)]).real)
    assert r < 1 / np.sqrt(1.5) < again
    picture, K = view.image(draft=False), view.intrinsics.within(garden.FINE)
    for where in (lamp, lamp / r * again):
        u, v = K.to_pixels(where).round().astype(int)
        assert picture[v, u].min() > 190  # its glass is nearly white, and nothing else of the wall is
    u, v = K.to_pixels(lamp / r * (again - 0.25)).round().astype(int)
    assert picture[v, u].min() < 150
    hidden = view.but(hide_fold=True).image(draft=False)
    u, v = K.to_pixels(lamp / r * again).round().astype(int)
    assert hidden[v, u].max() < 60


# The reader's own function -------------------------------------------------------------------------------------------


def polynomial(xy, k1, k2, k3):
    r2 = np.sum(xy**2, axis=-1, keepdims=True)
    return xy * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3)


@pytest.mark.parametrize("show", ["distorted", "undistorted"])
@pytest.mark.parametrize("place", ["garden", "wall", "photograph"])
def test_a_right_function_makes_the_camera_s_picture_in_each_mode(show, place):
    state = {"k1": -0.28, "k2": 0.07, "k3": 0.02, "show": show, "panels": "picture yours", "yours": polynomial}
    if place == "photograph":
        noise = np.random.default_rng(3).integers(0, 255, (24, 32, 3)).astype(np.uint8)
        state["photograph"] = cv2.resize(noise, (640, 480), interpolation=cv2.INTER_CUBIC)
    view = DistortionView.by_the_wall(**state) if place == "wall" else DistortionView(**state)
    shown = view.figure().photographs
    camera, yours = (cv2.imdecode(np.frombuffer(shown[name], np.uint8), 1) for name in ("camera", "yours"))
    assert cv2.PSNR(camera, yours) > 40


def test_the_inverse_of_a_function_ends_at_its_fold():
    """r - 0.3 r³ turns back at 1.054, where it is 0.703: farther out nothing lands, and no farther root counts."""
    fold = 1 / np.sqrt(0.9)
    r = np.array([0.1, 0.6, 1.0])
    landed = r - 0.3 * r**3
    xy = np.stack([np.append(landed, 0.71), np.zeros(4)], axis=-1)

    def bend(points):
        return polynomial(points, -0.3, 0.0, 0.0)

    np.testing.assert_allclose(straightened(bend, xy)[:3, 0], r, atol=1e-3)
    assert np.isnan(straightened(bend, xy)[3]).all()
    beyond = np.full((4, 2), [1.4, 0.0])
    assert not (straightened(bend, xy, beyond)[:, 0] > fold).any()


def test_an_unwritten_function_leaves_the_right_picture_greyed_and_a_faulty_one_its_error():
    def unwritten(xy, k1, k2, k3): ...

    def faulty(xy, k1, k2, k3):
        return xy[7, 7, 7, 7]

    view = DistortionView(panels="picture yours", yours=unwritten)
    figure = view.figure(draft=True)
    assert "yours appears here" in figure.body
    assert 'class="awaited"' in figure.body
    assert figure.photographs["yours"] == figure.photographs["camera"]
    figure = view.but(yours=faulty).figure(draft=True)
    assert "yours appears here" not in figure.body
    assert "IndexError" in figure.body
    assert list(figure.photographs) == ["camera"]


def test_a_wrong_function_bends_a_given_photograph_otherwise_in_each_mode():
    stripes = np.repeat(np.repeat(np.arange(32) % 2 * 255, 20)[None, :, None], 480, axis=0).repeat(3, axis=2)

    def turned(xy, k1, k2, k3):
        return polynomial(xy, -k1, -k2, -k3)

    for show in ("distorted", "undistorted"):
        state = {"show": show, "panels": "picture yours", "photograph": stripes.astype(np.uint8)}
        shown = DistortionView(k1=-0.2, k2=0.0, yours=turned, **state).figure(draft=True).photographs
        camera, yours = (cv2.imdecode(np.frombuffer(shown[name], np.uint8), 1) for name in ("camera", "yours"))
        assert cv2.PSNR(camera, yours) < 15


def test_a_panel_that_opens_takes_no_photograph_again():
    view = DistortionView.by_the_wall(k1=-0.2, yours=lambda xy, k1, k2, k3: 1.1 * xy, panels="picture yours")
    view.figure()
    opened = view.with_panels({"curve": True})
    assert opened.photographs is view.photographs
    assert set(view.photographs) == {("camera", False), ("yours", False)}
