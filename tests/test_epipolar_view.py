"""The epipolar view shows what two-view geometry says, wherever its controls stand, and moves what is dragged."""

import cv2
import numpy as np
import pytest
from every_view import written
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.scenes import textured_scene
from camviz.views.epipolar import EpipolarView

STEREO = EpipolarView()
FORWARD = EpipolarView(right_x=0.15, right_z=0.9, yaw=0.0)


def right_picture(view):
    return view.figure(draft=True).marks.panels()["right"].marks


def off_the_lines(ends, points):
    """How far each point (n, 2) lies from the straight line through its pair of ends (2 n, 2)."""
    starts, along = ends[::2], ends[1::2] - ends[::2]
    away = points - starts
    return np.abs(along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]) / np.linalg.norm(along, axis=1)


@pytest.mark.parametrize("depth", [0.5, 2.0, 12.0])
def test_the_point_lies_on_its_line_as_opencv_has_it(depth):
    """In the numbers, and in the right picture as it is drawn."""
    view = STEREO.but(depth=depth, pitch=5.0, roll=10.0)
    line = cv2.computeCorrespondEpilines(np.array([[[view.u, view.v]]]), 1, view.F).ravel()
    assert abs(line @ [*view.uv_right, 1]) < 1e-4  # OpenCV's lines are float32
    assert view.residual < 1e-12
    seen = STEREO.but(depth=2.0 + depth / 20)  # inside the right picture
    drawn = right_picture(seen)
    (dot,) = drawn.points("red")[-1:]
    np.testing.assert_allclose(dot, seen._right_panel.place(seen.uv_right), atol=1e-9)
    assert off_the_lines(drawn.points("green thick"), dot).max() < 1e-6


def test_zero_coefficients_have_the_pinholes_F():
    """Files of rectified pairs hold five zeros: that lens does not bend, whatever it is called."""
    left = Camera(Intrinsics(640, 480, 500, 500, 320, 240), BrownConrady())
    right = left.at(RigidTransform.from_translation([0.3, 0, 0]))
    plain = [Camera(camera.intrinsics, world_from_cam=camera.world_from_cam) for camera in (left, right)]
    view = EpipolarView.of(left, right)
    np.testing.assert_allclose(view.F, EpipolarView.of(*plain).F, atol=1e-12)
    assert view.numbers()["left epipole"] == "at infinity"
    assert EpipolarView.of(Camera(left.intrinsics, BrownConrady(1e-6)), right).F is None


def test_the_estimate_is_opencvs_and_noise_spoils_it():
    view = STEREO.but(noise=1.0, matches=40)
    F, _ = cv2.findFundamentalMat(*view.noisy_pairs, cv2.FM_8POINT)
    F = F / np.linalg.norm(F) * np.sign(np.sum(F * view.estimate))
    np.testing.assert_allclose(F, view.estimate, atol=1e-6)
    errors = [STEREO.but(noise=noise).estimate_error for noise in (0.1, 0.4, 1.6)]
    assert errors == sorted(errors)
    assert errors[0] < 0.2
    assert STEREO.but(noise=1.5, normalised=False).estimate_error > 5 * STEREO.but(noise=1.5).estimate_error


def test_both_pictures_show_one_surface_at_the_true_depth():
    view = STEREO.but(depth=float(np.linalg.norm(STEREO.surface - STEREO.left.centre)))
    np.testing.assert_allclose(view.point, view.surface, atol=1e-9)
    right = view.right.unproject(view.uv_right)
    _, seen = textured_scene().trace(view.right.centre, right)
    np.testing.assert_allclose(view.right.centre + seen * right, view.surface, atol=1e-3)
    grey = np.full((480, 640, 3), 128, np.uint8)
    given = EpipolarView(photographs=(grey, grey), truth=True)
    pixels = cv2.imdecode(np.frombuffer(given.figure().photographs["left"], np.uint8), cv2.IMREAD_COLOR)
    assert abs(pixels.astype(int) - 128).max() <= 1
    assert not np.isfinite(given.surface).any()  # of a photograph no surface is known


def test_without_a_baseline_or_with_a_bending_lens_no_F():
    still = STEREO.but(right_x=0.0)
    assert still.F is None
    np.testing.assert_allclose(still.but(depth=9.0).uv_right, still.but(depth=0.5).uv_right, atol=1e-9)
    view = STEREO.but(lens="fisheye", v=60.0)
    curve = twoview.epipolar_curve(view.left, view.right, [view.u, view.v], np.geomspace(0.3, 30, 20))
    curve = curve[np.isfinite(curve).all(axis=-1)]
    assert np.linalg.svd(curve - curve.mean(axis=0))[1][1] > 5  # off its chord
    assert view.F is None


def test_hands_move_the_point_its_depth_and_the_viewpoint():
    at = STEREO._left_panel.place([400, 100]) + (STEREO._left_panel.x, STEREO._left_panel.y)
    moved = STEREO.dragged("left", *at, 1, 1)
    assert (moved.u, moved.v) == pytest.approx((400, 100), abs=1e-9)
    beyond = STEREO.dragged("left", -500, 5000, 0, 0)
    assert (beyond.u, beyond.v) == (0, 479)
    panel = STEREO._right_panel
    moved = STEREO.dragged("right", *(panel.place(STEREO.but(depth=3.1).uv_right) + (panel.x, panel.y)), 0, 0)
    assert moved.depth == pytest.approx(3.1, rel=0.005)
    assert (moved.u, moved.v) == (STEREO.u, STEREO.v)
    assert STEREO.pressed("left", "ArrowRight").u == pytest.approx(STEREO.u + 10 / STEREO._left_panel.scale[0])
    assert STEREO.pressed("right", "ArrowUp").depth > STEREO.depth > STEREO.pressed("right", "ArrowDown").depth
    assert STEREO.pressed("orbit", "ArrowLeft").eye != STEREO.eye


def test_a_calibrated_pair_stands_as_the_calibration_says():
    turn = Rotation.from_euler("YXZ", [4, -3, 2], degrees=True)
    placed = RigidTransform.from_components([0.08, -0.01, 0.02], turn)
    left = Camera(Intrinsics(640, 480, 534, 536, 335, 240), BrownConrady(k1=-0.28))
    right = Camera(Intrinsics(640, 480, 530, 531, 330, 245), BrownConrady(k1=-0.3), placed)
    view = EpipolarView.of(left, right)
    true, shown = (twoview.right_from_left(*pair).as_matrix() for pair in ((left, right), (view.left, view.right)))
    np.testing.assert_allclose(shown, true, atol=1e-12)
    assert view.right.lens == right.lens
    for cameras, words in ((1, "got 1"), (2, "same place")):
        with pytest.raises(ValueError, match=words):
            EpipolarView.of(*[left] * cameras)


def test_the_left_picture_alone_shows_nothing_of_the_right():
    """Its first view: where the point flies is to be seen, and not what the right picture will show."""
    alone = EpipolarView(panels="space")
    parts = {tile.name: tile.marks for tile in alone.figure(draft=True).tiles}
    assert list(parts) == ["left picture", "space"]
    assert not parts["left picture"].of("green")
    assert not parts["space"].of("orange")
    assert EpipolarView(panels="right").figure(draft=True).tiles[0].marks.of("green")
    assert "0.700 m" not in alone.description()


# The reader's own F and lines ----------------------------------------------------------------------------------------


def test_the_readers_own_F_draws_the_right_line_or_another():
    def right(K_left, K_right, R, t):
        return np.linalg.inv(K_right).T @ np.cross(t, np.eye(3)).T @ R @ np.linalg.inv(K_left)

    def turned_backwards(K_left, K_right, R, t):
        return right(K_left, K_right, R.T, t)

    view = FORWARD.but(yaw=-8.0, roll=5.0)
    for function, tolerance in ((right, (0, 1e-6)), (turned_backwards, (5, np.inf))):
        drawn = right_picture(view.but(yours=function))
        away = off_the_lines(drawn.points("orange dashed"), drawn.points("red")[-1:])
        assert tolerance[0] <= away.max() <= tolerance[1]


def test_the_readers_own_lines_pass_through_the_epipole_or_not():
    for function, through in (
        (twoview.epipolar_lines, True),
        (lambda F, uv: twoview.epipolar_lines(F.T, uv) * (1, 1, 1.5), False),
    ):
        drawn = right_picture(FORWARD.but(panels="right epipoles", your_lines=function)).points("orange dashed")
        epipole = FORWARD._right_panel.place(twoview.from_homogeneous(twoview.epipoles(FORWARD.F)[1]))
        assert (off_the_lines(drawn, epipole).max() < 1e-6) == through


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda *given: np.eye(4), "answers in shape"),
        (lambda *given: np.full((3, 3), np.nan), "answers NaN everywhere"),
        (lambda *given: np.diag([np.nan, 1, 1]), "not all finite"),
        (lambda *given: np.zeros((3, 3)), "no line"),
    ],
)
def test_a_function_without_an_F_draws_no_line_and_says_why(function, sentence):
    picture = FORWARD.but(yours=function).figure(draft=True)
    assert sentence in written(picture)
    assert "nan" not in written(picture)
    assert not picture.marks.of("orange dashed")
    none = FORWARD.but(panels="right", your_lines=lambda F, uv: np.zeros((len(uv), 3)))
    assert not none.figure(draft=True).marks.of("orange dashed")


def test_a_function_is_called_once_and_never_where_none_is():
    calls = []
    view = STEREO.but(yours=lambda *given: calls.append(1))
    view.figure(draft=True)
    view.but(depth=3.0).figure(draft=True)
    assert len(calls) == 1
    STEREO.but(lens="fisheye", yours=lambda *given: calls.append(1)).figure(draft=True)
    assert len(calls) == 1
