"""Facts about the joint adjustment: slopes, optimum and covariances, against OpenCV, SciPy and dense algebra."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from boards import BOARD, CAMERA, ESTIMATED, RIGHT, board_poses, noisy, truth
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, DoubleSphere, ExtendedUnified, FieldOfView, KannalaBrandt, UnifiedSphere
from camviz_clinic.calibration.adjustment import Adjustment, twisted
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.jacobian import pixel_jacobian, with_parameters
from camviz_clinic.calibration.linearisation import sagittas
from camviz_clinic.calibration.types import Calibration

SIGMA = 0.2
LENSES = [
    BrownConrady(-0.28, 0.1, 1e-3, -5e-4, 0.02, 0.01, 0.02, -0.01, 1e-3, 2e-3, -1e-3, 5e-4, 0.01, -0.02),
    KannalaBrandt(0.01, -0.002, 3e-4, -4e-4),
    UnifiedSphere(0.8, -0.1, 0.02, 1e-3, -1e-3),
    ExtendedUnified(0.6, 1.1),
    DoubleSphere(-0.2, 0.6),
    FieldOfView(0.9),
]


@pytest.fixture(scope="module")
def solved():
    """Ten noisy views of one camera, solved."""
    rng = np.random.default_rng(1)
    return noisy(truth(board_poses(rng, 10)), rng, SIGMA).refined()


@pytest.fixture(scope="module")
def pair():
    """Eight noisy views of a pair with a bent board, solved."""
    rng = np.random.default_rng(2)
    exact = truth(board_poses(rng, 8), {"left": CAMERA, "right": RIGHT}, warp=np.array([2e-4, -1e-4]))
    return noisy(exact, rng, SIGMA).refined()


def dense(adjustment):
    """J (measurements, parameters) by moving one parameter at a time, through `project` alone, and the residuals."""
    shared, views = len(adjustment.parameters), adjustment.views

    def residuals(x):
        there = adjustment._moved(x[:shared], x[shared:].reshape(views, 6))
        return np.concatenate([there.residuals[name][mask].ravel() for name, mask in adjustment.used.items()])

    steps = 1e-6 * np.eye(shared + 6 * views)
    J = np.stack([(residuals(-step) - residuals(step)) / 2e-6 for step in steps], axis=-1)
    return J, residuals(np.zeros(len(steps)))


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: type(lens).__name__)
def test_slopes_are_those_of_the_projection(lens) -> None:
    """The pixel of a point moved a little, and of a camera changed a little, is foretold to second order."""
    camera = Camera(Intrinsics(640, 480, 400.0, 410.0, 320.0, 240.0, skew=0.7), lens)
    names = ("fx", "fy", "cx", "cy", "skew", *lens.parameters())
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.4, -0.3, 0.9], [0.4, 0.3, 1.5], (40, 3))
    uv, by_point, by_parameter = pixel_jacobian(camera, points, names)
    assert np.allclose(uv, camera.project(points), rtol=0, atol=1e-9)
    h = 1e-4
    for i, shift in enumerate(h * np.eye(3)):
        assert np.allclose(
            by_point[..., i], (camera.project(points + shift) - camera.project(points - shift)) / (2 * h), atol=2e-4
        )
    for i, name in enumerate(names):
        value = getattr(camera.intrinsics if i < 5 else lens, name)
        there, back = (with_parameters(camera, {name: value + step}).project(points) for step in (h, -h))
        assert np.allclose(by_parameter[..., i], (there - back) / (2 * h), atol=1e-3)


def test_a_parameter_at_the_end_of_its_range_has_a_slope_too() -> None:
    """ξ = 0 is a pinhole, and ∂x/∂ξ there is -x |p|/Z."""
    camera = Camera(Intrinsics(640, 480, 400.0, 400.0, 320.0, 240.0), UnifiedSphere(0.0))
    point = np.array([0.3, -0.2, 1.1])
    expected = -400 * point[:2] / point[2] * np.linalg.norm(point) / point[2]
    assert np.allclose(pixel_jacobian(camera, point, ("xi",))[2][:, 0], expected, rtol=1e-4)


@pytest.mark.parametrize("problem", ["solved", "pair"])
def test_covariances_are_those_of_the_dense_inverse(problem, request) -> None:
    """σ² (JᵀJ)⁻¹, of all parameters at once and J taken by differences, holds the blocks that the arrowhead gives.

    So it is for independent corners. A pose follows what the scatter of the views adds to the shared parameters.
    """
    adjustment = request.getfixturevalue(problem).by_corners
    J, residuals = dense(adjustment)
    shared = len(adjustment.parameters)
    sigma2 = residuals @ residuals / (J.shape[0] - J.shape[1])
    assert adjustment.sigma**2 == pytest.approx(sigma2, rel=1e-12)
    covariance = sigma2 * np.linalg.inv(J.T @ J)
    scale = np.sqrt(np.diag(covariance))

    def agree(block, rows, columns) -> bool:
        unit = np.outer(scale[rows], scale[columns])
        return np.abs((block - covariance[rows, columns]) / unit).max() < 1e-5

    assert agree(adjustment.covariance, slice(shared), slice(shared))
    for view in range(adjustment.views):
        pose = slice(shared + 6 * view, shared + 6 * view + 6)
        assert agree(adjustment.pose_covariance[view], pose, pose)
        assert agree(adjustment.cross_covariance[view], pose, slice(shared))
    mean = np.zeros((shared + 6, len(scale)))
    mean[:shared, :shared] = np.eye(shared)
    mean[shared:, shared:] = np.tile(np.eye(6), adjustment.views) / adjustment.views
    expected = mean @ covariance @ mean.T
    unit = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((adjustment.mean_twist_covariance - expected) / unit).max() < 1e-5


def test_what_is_not_determined_has_a_variance_beyond_all_digits_and_no_warning() -> None:
    """A view without corners says nothing of its pose: zeros all over, inverted beside a view that is well known."""
    known = np.array([[4.0, 1.0], [1.0, 9.0]])
    variances = inverse(np.stack([np.zeros((2, 2)), known]))
    assert np.isfinite(variances).all()
    assert (np.diag(variances[0]) > 1e14).all()
    np.testing.assert_allclose(variances[1], np.linalg.inv(known), rtol=1e-12)


def test_no_residual_is_left_and_no_gradient(pair) -> None:
    """At the optimum Jᵀx = 0: no parameter, moved by its standard deviation, changes ‖x‖² to first order."""
    normal = pair.normal_equations
    assert np.abs(normal.shared_gradient * np.sqrt(np.diag(pair.covariance))).max() < 1e-5 * pair.sum_of_squares
    deviations = np.sqrt(np.einsum("vii->vi", pair.pose_covariance))
    assert np.abs(normal.gradients * deviations).max() < 1e-5 * pair.sum_of_squares


def test_optimum_and_deviations_are_opencvs() -> None:
    """cv2.calibrateCameraExtended: the same RMS, parameters to 0.1 % of σ, and standard deviations to 1e-5."""
    rng = np.random.default_rng(3)
    start = noisy(truth(board_poses(rng, 12), estimated=(*ESTIMATED, "k3")), rng, SIGMA)
    start = replace(start, detections={"camera": start.detections["camera"].astype(np.float32).astype(float)})
    seen = np.isfinite(start.detections["camera"]).all(-1)
    points = [BOARD.corners[view].astype(np.float32) for view in seen]
    pixels = [uv[view].astype(np.float32) for uv, view in zip(start.detections["camera"], seen, strict=True)]
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-15)
    rms, K, D, _, tvecs, deviations, *_ = cv2.calibrateCameraExtended(
        points, pixels, (640, 480), None, None, criteria=criteria
    )
    ours = start.refined()
    theirs = np.concatenate([K[[0, 1, 0, 1], [0, 1, 2, 2]], D.ravel()[:5]])
    assert ours.rms == pytest.approx(rms, rel=1e-6)  # OpenCV takes the board in float32
    assert np.abs((ours.intrinsics("camera") - theirs) / deviations[:9, 0]).max() < 1e-3
    # OpenCV's σ is over N - k as well, and by the noise of corners.
    assert np.allclose(np.sqrt(np.diag(ours.corner_covariance)), deviations[:9, 0], rtol=1e-5)
    assert np.allclose(ours.first_from_board.translation, np.reshape(tvecs, (-1, 3)), atol=1e-6)


def test_optimum_is_scipys_for_a_pair_with_a_bent_board(pair) -> None:
    """scipy.optimize.least_squares, from the same corners and the truth, comes to the same sum of squares and place."""
    shared, views = len(pair.parameters), pair.views
    scale = np.concatenate([np.sqrt(np.diag(pair.covariance)), np.full(6 * views, 1e-4)])

    def residuals(x):
        x = x * scale
        there = pair._moved(x[:shared], x[shared:].reshape(views, 6))
        return np.concatenate([there.residuals[name][mask].ravel() for name, mask in pair.used.items()])

    start = np.random.default_rng(0).normal(0, 0.3, len(scale))
    found = least_squares(residuals, start, x_scale="jac")
    assert 2 * found.cost == pytest.approx(pair.sum_of_squares, rel=1e-7)
    assert np.abs(found.x[:shared]).max() < 0.02  # standard deviations


def test_it_comes_back_from_a_poor_start(solved) -> None:
    """Focal lengths 20 % off, no distortion, and poses turned by 3° and moved by 2 cm lead to the same optimum."""
    rng = np.random.default_rng(5)
    camera = with_parameters(CAMERA, {"fx": 640, "fy": 430, "cx": 300, "k1": 0, "k2": 0})
    twists = np.concatenate([rng.normal(0, 0.05, (10, 3)), rng.normal(0, 0.02, (10, 3))], axis=1)
    start = replace(solved, cameras={"camera": camera}, first_from_board=twisted(solved.first_from_board, twists))
    assert start.refined().sum_of_squares == pytest.approx(solved.sum_of_squares, rel=1e-9)


@pytest.mark.thorough
def test_deviations_are_the_scatter_of_many_solutions() -> None:
    """60 solutions from fresh noise: each parameter, by its foretold σ, scatters as χ² of 60 degrees says it may."""
    rng = np.random.default_rng(6)
    exact = truth(board_poses(rng, 8))
    expected = np.sqrt(np.diag(exact.normal_equations.covariance)) * SIGMA
    solutions = [noisy(exact, rng, SIGMA).refined() for _ in range(60)]
    z = np.array([(one.intrinsics("camera") - exact.intrinsics("camera")) / expected for one in solutions])
    # 99.9 % of χ²₆₀/60 lie between 0.53 and 1.66
    assert ((z**2).mean(axis=0) > 0.53).all()
    assert ((z**2).mean(axis=0) < 1.66).all()
    # and σ itself: 60 times some 800 degrees of freedom
    assert np.mean([one.sigma**2 for one in solutions]) == pytest.approx(SIGMA**2, rel=0.03)


def test_what_is_fixed_stays(solved) -> None:
    """Without fy and cx among the estimated they keep their values, and the others get less uncertain."""
    names = tuple(name for name in ESTIMATED if name not in ("fy", "cx"))
    held = replace(solved, estimated={"camera": names}).refined()
    assert held.cameras["camera"].intrinsics.fy == solved.cameras["camera"].intrinsics.fy
    assert held.cameras["camera"].intrinsics.cx == solved.cameras["camera"].intrinsics.cx
    assert held.parameters[:2] == ("camera.fx", "camera.cy")
    assert held.normal_equations.covariance[0, 0] < solved.normal_equations.covariance[0, 0] / 2


def test_poses_alone(solved) -> None:
    """Moved boards come back where they were, and the camera does not change."""
    twists = np.random.default_rng(0).normal(0, 0.01, (solved.views, 6))
    start = replace(solved, first_from_board=twisted(solved.first_from_board, twists))
    there = start.refined(only_poses=True)
    assert there.cameras == solved.cameras
    assert there.sum_of_squares == pytest.approx(solved.sum_of_squares, rel=1e-9)


def test_corners_set_aside_have_residuals_and_no_say(solved) -> None:
    """Ten corners thrown 30 px off and set aside: the solution is that without them, and they still show."""
    wrong = {"camera": solved.detections["camera"].copy()}
    wrong["camera"][3, :10] += 30
    aside = np.zeros(wrong["camera"].shape[:2], bool)
    aside[3, :10] = True
    missing = {"camera": np.where(aside[..., None], np.nan, wrong["camera"])}
    found = replace(solved, detections=wrong, set_aside={"camera": aside}).refined()
    without = replace(solved, detections=missing).refined()
    assert np.allclose(found.intrinsics("camera"), without.intrinsics("camera"), rtol=1e-9, atol=1e-12)
    assert np.allclose(np.linalg.norm(found.residuals["camera"][3, :10], axis=-1), 30 * np.sqrt(2), atol=1)
    assert found.measurements == solved.measurements - 20


def test_a_view_without_enough_corners_has_no_say(solved) -> None:
    """Three corners, or a whole row on one line, leave a pose open: that view is left out."""
    few = {"camera": solved.detections["camera"].copy()}
    few["camera"][0, 3:] = np.nan
    few["camera"][1, 9:] = np.nan
    found = replace(solved, detections=few).refined()
    assert found.posed.tolist() == [False, False, *[True] * 8]
    assert np.isnan(found.pose_covariance[:2]).all()
    rest = solved.only(np.arange(10) > 1).refined()
    assert np.allclose(found.covariance, rest.covariance, rtol=1e-6)


def test_a_calibration_becomes_the_same_problem(pair) -> None:
    """From cameras in a world of their own and a pose per camera: the same residuals and the same covariance."""
    world = RigidTransform.from_components([1, 2, 3], Rotation.from_rotvec([0.3, 0.2, 0.1]))
    calibration = Calibration(
        {name: camera.at(world * camera.world_from_cam) for name, camera in pair.cameras.items()},
        None,
        "virtual",
        BOARD,
        pair.detections,
        {name: camera.cam_from_world * pair.first_from_board for name, camera in pair.cameras.items()},
        estimated=pair.estimated,
        board_warp=pair.warp,
    )
    there = Adjustment.of(calibration)
    assert there.parameters == pair.parameters
    assert there.rms == pytest.approx(pair.rms, rel=1e-9)
    assert np.allclose(there.covariance, pair.covariance, rtol=1e-5)
    single = Adjustment.of(calibration, "right")
    assert single.parameters == (*(f"right.{name}" for name in ESTIMATED), "board.warp_x", "board.warp_y")
    assert single.rms == pytest.approx(np.sqrt(np.nanmean(pair.residuals["right"] ** 2) * 2), rel=1e-9)


def test_estimated_intrinsics_are_those_that_are_not_zero_where_nothing_is_said(pair) -> None:
    calibration = Calibration(
        {"left": pair.cameras["left"]},
        None,
        "virtual",
        BOARD,
        {"left": pair.detections["left"]},
        {"left": pair.first_from_board},
    )
    assert Adjustment.of(calibration).estimated == {"left": ESTIMATED}


@pytest.mark.parametrize(
    ("missing", "word"), [("board", "board"), ("detections", "corners"), ("cam_from_board", "corners and board poses")]
)
def test_what_a_calibration_lacks_is_named(pair, missing, word) -> None:
    parts = {
        "board": BOARD,
        "detections": {"left": pair.detections["left"]},
        "cam_from_board": {"left": pair.first_from_board},
    }
    parts[missing] = None if missing == "board" else {}
    with pytest.raises(ValueError, match=word):
        Adjustment.of(Calibration({"left": CAMERA}, None, "virtual", **parts))


def test_sagittas_stand_in_the_middle_and_vanish_at_the_edges() -> None:
    rise = sagittas(BOARD).reshape(6, 9, 2)
    assert np.allclose(rise[:, 4, 0], 1)
    assert np.allclose(rise[:, [0, 8], 0], 0)
    assert np.allclose(rise[[0, 5], :, 1], 0)


def test_cost_grows_with_the_views_and_not_with_their_square() -> None:
    """No array of the normal equations is larger than views × parameters × 6."""
    rng = np.random.default_rng(0)
    many = truth(board_poses(rng, 200))
    largest = max(np.size(value) for value in vars(many.normal_equations).values() if isinstance(value, np.ndarray))
    assert largest <= 200 * 6 * max(6, len(ESTIMATED))
