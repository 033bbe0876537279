"""What the corners of boards say about f and ξ of an omnidirectional camera: f/(1 + ξ), and little more."""

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Perspective, UnifiedSphere
from camviz.scenes import Scene, Texture, render, to_display
from camviz.scenes.paint import checkerboard
from camviz.scenes.surfaces import Rectangle
from camviz_clinic.calibration import Detections, calibrate, find_corners
from camviz_clinic.files import Board
from camviz_school.views.focal_xi_ambiguity import focal_xi_ambiguity, focal_xi_ambiguity_picture

BOARD = Board(8, 5, 0.03)
CAMERA = Camera(Intrinsics(800, 640, 560, 563, 402, 317), UnifiedSphere(1.1))


def boards(rng, count, spread, tilt=0.5, away=(0.2, 0.32)):
    """cam_from_board of boards within `spread` radians of the axis."""
    middle, poses = RigidTransform.from_translation(-BOARD.corners.mean(axis=0)), []
    for i in range(count):
        turn = 2 * np.pi * i / count
        towards = Rotation.from_rotvec(spread * rng.uniform(0.6, 1) * np.array([np.cos(turn), np.sin(turn), 0]))
        lean = Rotation.from_rotvec([*rng.uniform(-tilt, tilt, 2), rng.uniform(-0.3, 0.3)])
        out = RigidTransform.from_translation([0, 0, rng.uniform(*away)])
        poses.append(RigidTransform.from_rotation(towards) * out * RigidTransform.from_rotation(lean) * middle)
    return RigidTransform.concatenate(poses)


def corners_of(camera, poses, rng, sigma):
    uv = np.stack([camera.project(pose.apply(BOARD.corners)) for pose in poses])
    return uv + sigma * rng.standard_normal(uv.shape)


def drawn(camera, pose):
    """The board photographed by the tracer, four rays to a pixel, dark on a white margin."""
    side, columns, rows = BOARD.square_size, BOARD.columns + 1, BOARD.rows + 1
    corner, across, down = np.array([[-1.5, -1.5, 0], [columns + 1, 0, 0], [0, rows + 1, 0]]) * side
    rotation = pose.rotation
    paper = Rectangle(
        pose.apply(corner), rotation.apply(across), rotation.apply(down), Texture(checkerboard(columns, rows))
    )
    image = to_display(render(Scene([paper], Texture.plain((0.45, 0.45, 0.45))), camera, 2))
    return cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)


@pytest.mark.thorough
def test_omnidirectional_calibration_from_rendered_pictures_finds_f_over_one_plus_xi():
    """Photographed, found and solved: f/(1 + ξ) comes out ten times as surely as f or ξ alone."""
    poses = boards(np.random.default_rng(5), 7, 0.75)
    found = [find_corners(drawn(CAMERA, pose), BOARD) for pose in poses]
    kept = [i for i, corners in enumerate(found) if corners is not None]
    assert len(kept) >= 6
    for i in kept:
        assert np.nanmax(np.abs(found[i] - CAMERA.project(poses[i].apply(BOARD.corners)))) < 0.4
    seen = Detections(tuple(f"{i}.png" for i in kept), np.array([found[i] for i in kept]), 800, 640)
    solved = calibrate(seen, BOARD, "omni", fixed=("k1", "k2", "p1", "p2")).cameras["camera"]
    assert solved.intrinsics.fx / (1 + solved.lens.xi) == pytest.approx(560 / 2.1, rel=3e-3)
    assert solved.lens.xi == pytest.approx(1.1, abs=0.06)


def test_the_misfit_is_what_a_least_squares_solver_and_opencv_s_projection_leave():
    rng = np.random.default_rng(2)
    poses = boards(rng, 3, 0.6)
    uv = corners_of(CAMERA, poses, rng, 0.2)
    f, xi = 610.0, 1.3
    squares = 0.0
    for pose, seen in zip(poses, uv, strict=True):
        K = np.array([[f, 0, 402], [0, f * 563 / 560, 317], [0, 0, 1]])

        def off(twist, seen=seen, K=K):
            points = BOARD.corners[None]
            return (
                cv2.omnidir.projectPoints(points, twist[:3], twist[3:], K, xi, np.zeros(4))[0].reshape(-1, 2) - seen
            ).ravel()

        begun = np.concatenate([pose.rotation.as_rotvec(), pose.translation])
        squares += 2 * least_squares(off, begun, x_scale="jac", xtol=1e-14, ftol=1e-14).cost
    found = focal_xi_ambiguity(CAMERA, BOARD, uv, poses, [1.1, xi], [560.0, f, 660.0])
    assert found.misfit[1, 1] == pytest.approx(
        np.sqrt(squares / uv[..., 0].size), rel=2e-3
    )  # fy ≠ fx by half a percent


def test_at_the_truth_nothing_is_left_but_the_noise_also_with_distortion_and_corners_unseen():
    rng = np.random.default_rng(3)
    camera = Camera(CAMERA.intrinsics, UnifiedSphere(1.1, -0.05, 0.01, 0.001, -0.001))
    poses = boards(rng, 4, 0.6)
    uv = corners_of(camera, poses, rng, 0.0)
    uv[1, :7] = np.nan
    found = focal_xi_ambiguity(camera, BOARD, uv, poses, [1.0, 1.1], [540.0, 560.0, 580.0])
    assert found.misfit[1, 1] < 1e-6
    assert np.delete(found.misfit.ravel(), 4).min() > 0.05


def test_boards_near_the_axis_leave_a_valley_along_f_over_one_plus_xi_and_boards_far_out_close_it():
    xi = np.linspace(0.4, 2.2, 7)
    maps = {}
    for spread, away in ((0.1, (0.6, 0.9)), (0.8, (0.2, 0.3))):
        rng = np.random.default_rng(4)
        poses = boards(rng, 6, spread, away=away)
        uv = corners_of(CAMERA, poses, rng, 0.1)
        maps[spread] = focal_xi_ambiguity(CAMERA, BOARD, uv, poses, xi, np.linspace(250, 1000, 61))
    floor = maps[0.1].floor() / (1 + xi)
    np.testing.assert_allclose(floor, 560 / 2.1, rtol=0.04)  # while f itself goes from 373 to 853
    along = {spread: np.nanmin(one.misfit, axis=1) for spread, one in maps.items()}
    assert along[0.1].max() < 3 * along[0.1].min()
    assert along[0.8].max() > 5 * along[0.8].min()


def test_only_a_unified_sphere_has_such_a_valley():
    camera = Camera(CAMERA.intrinsics, Perspective())
    poses = boards(np.random.default_rng(1), 1, 0.1)
    with pytest.raises(ValueError, match="camera must have a UnifiedSphere lens, got Perspective"):
        focal_xi_ambiguity(camera, BOARD, np.zeros((1, 40, 2)), poses, [1.0], [500.0])


def test_the_drawing_of_a_valley_states_its_least_misfit():
    rng = np.random.default_rng(6)
    poses = boards(rng, 3, 0.5)
    uv = corners_of(CAMERA, poses, rng, 0.1)
    found = focal_xi_ambiguity(CAMERA, BOARD, uv, poses, np.linspace(0.5, 1.7, 7), np.linspace(400, 720, 9))
    picture = focal_xi_ambiguity_picture(("three boards", found), true_xi=1.1, true_focal=560)
    assert f"three boards: least {found.misfit.min():.2f} px" in picture.description
    assert len(picture.marks.points("ink thick"))
    assert set(picture.photographs) == {"valley0", "scale"}
