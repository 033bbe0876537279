"""The epipolar view shows what two-view geometry says, wherever its controls stand, and moves what is dragged."""

import re

import cv2
import numpy as np
import pytest
from every_view import words
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.scenes import textured_scene
from camviz.views.epipolar import EpipolarView

STEREO = EpipolarView()
FORWARD = EpipolarView(right_x=0.15, right_z=0.9, yaw=0.0)
SLIDERS = {name: control for name, control in EpipolarView.controls().items() if control.low is not None}


def centre_of(panel, uv):
    """Where a pixel lies in the picture."""
    return panel.place(uv) + (panel.x, panel.y)


def test_the_right_point_lies_on_the_line_of_its_left_one_at_every_depth_as_opencv_computes_it():
    for depth in (0.5, 2.0, 12.0):
        view = STEREO.but(depth=depth, pitch=5.0, roll=10.0)
        line = cv2.computeCorrespondEpilines(np.array([[[view.u, view.v]]]), 1, view.F).ravel()
        assert abs(line @ [*view.uv_right, 1]) < 1e-4  # OpenCV's lines are float32
        assert view.residual < 1e-12


def test_a_calibration_whose_coefficients_are_all_zero_has_its_fundamental_matrix():
    """Files of rectified pairs hold five zeros: that lens does not bend, whatever it is called."""
    left = Camera(Intrinsics(640, 480, 500, 500, 320, 240), BrownConrady())
    right = left.at(RigidTransform.from_translation([0.3, 0, 0]))
    plain = [Camera(camera.intrinsics, world_from_cam=camera.world_from_cam) for camera in (left, right)]
    view = EpipolarView.of(left, right)
    np.testing.assert_allclose(view.F, EpipolarView.of(*plain).F, atol=1e-12)
    assert view.numbers()["left epipole"] == "at infinity"
    assert EpipolarView.of(Camera(left.intrinsics, BrownConrady(1e-6)), right).F is None


def test_the_epipole_is_the_image_of_the_other_camera():
    left, right = twoview.epipoles(FORWARD.F)
    np.testing.assert_allclose(twoview.from_homogeneous(left), FORWARD.left.project(FORWARD.right.centre), atol=1e-6)
    assert FORWARD.numbers()["left epipole"] == "(403.2, 239.5)"
    # Moving straight ahead, both pictures have it at the same pixel.
    np.testing.assert_allclose(twoview.from_homogeneous(right), twoview.from_homogeneous(left), atol=1e-6)


def test_the_fundamental_matrix_is_opencvs_from_exact_points():
    view = STEREO.but(matches=60, roll=10.0, right_z=0.3)
    F, _ = cv2.findFundamentalMat(*view.pairs, cv2.FM_8POINT)
    F = F / np.linalg.norm(F) * np.sign(np.sum(F * view.F))
    np.testing.assert_allclose(F, view.F, atol=1e-7)


def test_the_estimate_from_noisy_points_is_opencvs():
    view = STEREO.but(noise=1.0, matches=40)
    F, _ = cv2.findFundamentalMat(*view.noisy_pairs, cv2.FM_8POINT)
    F = F / np.linalg.norm(F) * np.sign(np.sum(F * view.estimate))
    np.testing.assert_allclose(F, view.estimate, atol=1e-6)


def test_leaving_out_the_normalisation_makes_the_estimate_worse_several_times():
    view = STEREO.but(noise=1.5)
    assert view.but(normalised=False).estimate_error > 5 * view.estimate_error


def test_the_estimates_errors_grow_with_the_noise():
    errors = [STEREO.but(noise=noise).estimate_error for noise in (0.1, 0.4, 1.6)]
    assert errors == sorted(errors)
    assert errors[0] < 0.2


def test_the_scene_shows_the_same_surface_in_both_pictures_where_the_depth_is_true():
    distance = np.linalg.norm(STEREO.surface - STEREO.left.centre)
    view = STEREO.but(depth=float(distance))
    np.testing.assert_allclose(view.point, view.surface, atol=1e-9)
    right = view.right.unproject(view.uv_right)
    _, seen = textured_scene().trace(view.right.centre, right)
    np.testing.assert_allclose(view.right.centre + seen * right, view.surface, atol=1e-3)


def test_without_a_baseline_there_is_no_line_and_depth_does_not_move_the_point():
    view = STEREO.but(right_x=0.0)
    assert view.F is None
    assert "no baseline" in view.figure(draft=True).description
    np.testing.assert_allclose(view.but(depth=9.0).uv_right, view.but(depth=0.5).uv_right, atol=1e-9)


def test_a_lens_that_bends_makes_the_line_a_curve_and_leaves_no_matrix():
    view = STEREO.but(lens="fisheye", v=60.0)
    curve = twoview.epipolar_curve(view.left, view.right, [view.u, view.v], np.geomspace(0.3, 30, 20))
    curve = curve[np.isfinite(curve).all(axis=-1)]
    off_chord = np.linalg.svd(curve - curve.mean(axis=0))[1][1]
    assert off_chord > 5
    assert view.F is None
    assert "No F here" in view.figure(draft=True).body


def test_dragging_in_the_left_picture_moves_the_point_there():
    x, y = centre_of(STEREO._left_panel, [400, 100])
    moved = STEREO.dragged("left", x, y, 1, 1)
    assert (moved.u, moved.v) == pytest.approx((400, 100), abs=1e-9)


def test_dragging_in_the_right_picture_changes_the_depth_alone():
    target = STEREO.but(depth=3.1)
    moved = STEREO.dragged("right", *centre_of(STEREO._right_panel, target.uv_right), 0, 0)
    assert moved.depth == pytest.approx(3.1, rel=0.005)
    assert (moved.u, moved.v) == (STEREO.u, STEREO.v)


def test_arrow_keys_move_the_point_its_depth_and_the_onlooker():
    scale = STEREO._left_panel.scale[0]
    assert STEREO.pressed("left", "ArrowRight").u == pytest.approx(STEREO.u + 10 / scale)
    assert STEREO.pressed("right", "ArrowUp").depth > STEREO.depth > STEREO.pressed("right", "ArrowDown").depth
    assert STEREO.pressed("orbit", "ArrowLeft").eye != STEREO.eye


def test_the_point_cannot_be_dragged_out_of_the_picture():
    moved = STEREO.dragged("left", -500, 5000, 0, 0)
    assert (moved.u, moved.v) == (0, 479)


def test_a_calibrated_pair_stands_as_the_calibration_says():
    turn = Rotation.from_euler("YXZ", [4, -3, 2], degrees=True)
    placed = RigidTransform.from_components([0.08, -0.01, 0.02], turn)
    left = Camera(Intrinsics(640, 480, 534, 536, 335, 240), BrownConrady(k1=-0.28))
    right = Camera(Intrinsics(640, 480, 530, 531, 330, 245), BrownConrady(k1=-0.3), placed)
    view = EpipolarView.of(left, right)
    true, shown = (twoview.right_from_left(*pair).as_matrix() for pair in ((left, right), (view.left, view.right)))
    np.testing.assert_allclose(shown, true, atol=1e-12)
    assert view.right.lens == right.lens


@pytest.mark.parametrize(("cameras", "words"), [(1, "got 1"), (2, "same place")])
def test_a_calibration_without_a_second_camera_or_its_pose_is_refused_in_words(cameras, words):
    camera = Camera(Intrinsics.from_fov(640, 480, 60))
    with pytest.raises(ValueError, match=words):
        EpipolarView.of(*[camera] * cameras)


def test_the_description_states_point_depth_and_line():
    words = STEREO.description()
    assert "(204, 258)" in words
    assert "2.00 m along its ray" in words
    assert "baseline 0.700 m" in words
    assert STEREO.equation() in words


@pytest.mark.parametrize("name", SLIDERS)
def test_both_ends_of_every_slider_draw_different_pictures_without_a_stray_nan(name):
    start = STEREO.but(noise=1.0)
    drawn = [start.but(**{name: end}).figure(draft=True) for end in (SLIDERS[name].low, SLIDERS[name].high)]
    assert drawn[0].body != drawn[1].body
    for picture in drawn:
        assert not re.search(r"\bnan\b", picture.body)
        assert set(re.findall(r'attached:([^"]+)', picture.body)) == set(picture.photographs)


@pytest.mark.parametrize("change", [{"truth": True}, {"lens": "barrel"}, {"lens": "fisheye"}, {"normalised": False}])
def test_every_switch_and_choice_changes_the_picture(change):
    start = STEREO.but(noise=1.0)
    assert start.but(**change).figure(draft=True).body != start.figure(draft=True).body


def test_photographs_take_the_place_of_the_garden():
    grey = np.full((480, 640, 3), 128, np.uint8)
    view = EpipolarView(photographs=(grey, grey), truth=True)
    pixels = cv2.imdecode(np.frombuffer(view.figure().photographs["left"], np.uint8), cv2.IMREAD_COLOR)
    assert abs(pixels.astype(int) - 128).max() <= 1
    assert not np.isfinite(view.surface).any()


# The reader's own F --------------------------------------------------------------------------------------------------


def test_the_readers_own_F_draws_the_right_line_or_another_one():
    def right(K_left, K_right, R, t):
        return np.linalg.inv(K_right).T @ np.cross(t, np.eye(3)).T @ R @ np.linalg.inv(K_left)

    def turned_backwards(K_left, K_right, R, t):
        return right(K_left, K_right, R.T, t)

    view = FORWARD.but(yaw=-8.0, roll=5.0, yours=right)
    assert "0.0 px from the point" in view.figure(draft=True).body
    np.testing.assert_allclose(np.abs(view.your_line), np.abs(view.line), atol=1e-9)
    wrong = view.but(yours=turned_backwards)
    assert wrong._your_figure() != view._your_figure()
    assert wrong.figure(draft=True).body != view.figure(draft=True).body


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda *given: None, "yours appears here"),
        (lambda *given: np.eye(4), "answers in shape"),
        (lambda *given: 1 / 0, "ZeroDivisionError"),
        (lambda *given: np.full((3, 3), np.nan), "answers NaN everywhere"),
        (lambda *given: np.diag([np.nan, 1, 1]), "not all finite"),
        (lambda *given: np.zeros((3, 3)), "no line"),
    ],
)
def test_a_function_without_an_F_leaves_the_line_out_and_says_why(function, sentence):
    figure = FORWARD.but(yours=function).figure(draft=True)
    assert sentence in words(figure.body)
    assert not re.search(r"\bnan\b", figure.body)


def test_where_a_lens_bends_no_F_is_asked_for():
    view = STEREO.but(lens="fisheye", yours=lambda *given: 1 / 0)
    assert "ZeroDivisionError" not in view.figure(draft=True).body


def test_a_moved_point_asks_the_function_once():
    calls = []
    view = STEREO.but(yours=lambda *given: calls.append(1))
    view.figure(draft=True)
    view.but(depth=3.0).figure(draft=True)
    assert len(calls) == 1


def test_panels_are_left_out_and_others_refused():
    first = STEREO.but(panels="right space match")
    assert "epipole" not in first.figure(draft=True).body
    assert "F, of unit norm" not in first.figure(draft=True).body
    assert "Do they match?" in first.figure(draft=True).body
    with pytest.raises(ValueError, match="got 'right nonsense'"):
        EpipolarView(panels="right nonsense")


def test_the_left_picture_alone_has_no_line_and_nothing_of_the_other_camera():
    """Its first view: where the point flies is to be seen, and not what the right picture will show."""
    alone = EpipolarView(panels="space")
    parts = {tile.name: tile.marks for tile in alone.figure(draft=True).tiles}
    assert list(parts) == ["left picture", "space"]
    assert not parts["left picture"].of("green")
    assert not parts["space"].of("orange")
    assert EpipolarView(panels="right").figure(draft=True).tiles[0].marks.of("green")
    assert "= 0" not in alone.description()
    assert "0.700 m" not in alone.description()


@pytest.mark.parametrize("name", EpipolarView.openable)
def test_each_panel_opens_and_closes_again(name):
    first = EpipolarView(panels="" if name in ("right", "space") else "right")
    opened = first.with_panels({name: True})
    assert opened.figure(draft=True).body != first.figure(draft=True).body
    assert opened.with_panels({name: False}) == first


@pytest.mark.parametrize("count", range(1 << len(EpipolarView.openable)))
def test_tiles_stand_in_rows_without_overlap_whatever_is_open(count):
    names = [name for i, name in enumerate(EpipolarView.openable) if count >> i & 1]
    cells = list(EpipolarView(panels=" ".join(names))._layout.values())
    assert all(x + width <= 960 for x, _, width, _ in cells)
    for i, (x, y, width, height) in enumerate(cells):
        for left, top, wide, high in cells[:i]:
            assert x >= left + wide or left >= x + width or y >= top + high or top >= y + height


def test_the_readers_own_lines_make_the_star_or_another_one():
    view = FORWARD.but(panels="right", your_lines=twoview.epipolar_lines)
    right = view.figure(draft=True).body
    assert right.count("orange") > view.but(your_lines=None).figure(draft=True).body.count("orange")
    assert view.but(your_lines=lambda F, uv: twoview.epipolar_lines(F.T, uv)).figure(draft=True).body != right


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda F, uv: None, "yours appears here"),
        (lambda F, uv: 1 / 0, "ZeroDivisionError"),
        (lambda F, uv: np.zeros(3), "answers in shape"),
        (lambda F, uv: np.full((15, 3), np.nan), "answers NaN everywhere"),
        (lambda F, uv: np.zeros((15, 3)), "The right picture"),
    ],
)
def test_lines_that_are_none_say_why(function, sentence):
    figure = FORWARD.but(panels="right", your_lines=function).figure(draft=True)
    assert sentence in words(figure.body)
    assert not re.search(r"\bnan\b", figure.body)
