"""Zhang's closed form: exact on exact boards, the same as OpenCV's where that has it, and silent where boards are."""

import doctest

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.twoview import homography
from camviz_clinic.calibration.types import Board
from camviz_school.views import zhang
from camviz_school.views.zhang import board_pose, camera_matrix, constraints, focal_lengths

BOARD = Board(9, 6, 0.025)
XY = BOARD.corners[:, :2]
K = np.array([[560.0, 0, 331], [0, 540, 228], [0, 0, 1]])
SKEWED = K + [[0, 1.5, 0], [0, 0, 0], [0, 0, 0]]
SEEDS = pytest.mark.parametrize("seed", range(5))


def poses(n, rng, tilt=0.6):
    """n boards before the camera, each tilted its own way."""
    turn = np.column_stack([rng.uniform(-tilt, tilt, (n, 2)), rng.uniform(-1, 1, n)])
    return RigidTransform.from_components(
        rng.uniform([-0.2, -0.2, 0.4], [0.1, 0.1, 1.0], (n, 3)), Rotation.from_rotvec(turn)
    )


def through(K, pose):
    """The homography K [r₁ r₂ t] itself."""
    R = pose.rotation.as_matrix()
    return K @ np.column_stack([R[:, 0], R[:, 1], pose.translation])


def pixels(H, xy=XY):
    p = np.column_stack([xy, np.ones(len(xy))]) @ H.T
    return p[:, :2] / p[:, 2:]


@SEEDS
def test_exact_points_give_back_the_homography_they_went_through(seed):
    H = through(SKEWED, poses(1, np.random.default_rng(seed))[0])
    np.testing.assert_allclose(homography(XY, pixels(H)), H / H[2, 2], rtol=1e-9, atol=1e-9)


@SEEDS
def test_noisy_points_give_a_homography_as_good_as_opencv_s(seed):
    """DLT and OpenCV's refined one map the board to the same places within a tenth of the noise."""
    rng = np.random.default_rng(seed)
    uv = pixels(through(K, poses(1, rng)[0])) + rng.normal(0, 0.3, XY.shape)
    ours, theirs = homography(XY, uv), cv2.findHomography(XY, uv)[0]
    assert np.abs(pixels(ours) - pixels(theirs)).max() < 0.03


def test_without_normalisation_the_same_points_would_be_fitted_worse():
    """In a picture of 4000 pixels, far from its corner, plain DLT loses against the normalised one."""
    rng = np.random.default_rng(3)
    big = np.array([[3500.0, 0, 2000], [0, 3500, 1500], [0, 0, 1]])
    H = through(big, poses(1, rng)[0])
    uv = pixels(H) + rng.normal(0, 0.3, XY.shape)
    X = np.column_stack([XY, np.ones(54)])
    u, v = uv.T[..., None]
    plain = np.linalg.svd(np.block([[X, 0 * X, -u * X], [0 * X, X, -v * X]]))[2][-1].reshape(3, 3)
    missed = [np.linalg.norm(pixels(one) - pixels(H), axis=1).mean() for one in (homography(XY, uv), plain)]
    assert missed[0] < missed[1]


def test_points_that_were_not_seen_are_left_out_and_too_few_are_refused():
    H = through(K, poses(1, np.random.default_rng(0))[0])
    uv = pixels(H)
    uv[::3] = np.nan
    np.testing.assert_allclose(homography(XY, uv), H / H[2, 2], rtol=1e-9, atol=1e-9)
    with pytest.raises(ValueError, match="at least four points, got 3"):
        homography(XY[:3], pixels(H)[:3])
    with pytest.raises(ValueError, match="lie on a line"):
        homography(XY[:9], pixels(H)[:9])
    with pytest.raises(ValueError, match=r"\(n, 2\), got \(54, 2\) and \(53, 2\)"):
        homography(XY, uv[1:])


@SEEDS
def test_the_constraints_hold_for_the_true_camera(seed):
    B = np.linalg.inv(SKEWED @ SKEWED.T)
    b = B[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    rows = constraints(through(SKEWED, poses(1, np.random.default_rng(seed))[0]))
    assert np.abs(rows @ b).max() < 1e-9 * np.abs(rows * b).max()


@SEEDS
@pytest.mark.parametrize(("n", "skew"), [(2, False), (3, True), (3, False), (8, True)])
def test_exact_homographies_give_back_k(seed, n, skew):
    true = SKEWED if skew else K
    found = camera_matrix([through(true, pose) for pose in poses(n, np.random.default_rng(seed))], skew=skew)
    np.testing.assert_allclose(found, true, rtol=1e-8, atol=1e-6)
    assert found[1, 0] == found[2, 0] == found[2, 1] == 0


@SEEDS
def test_one_board_gives_two_focal_lengths_as_opencv_s_initial_guess_has_them(seed):
    """cv2.initCameraMatrix2D knows the principal point too: the middle of the image."""
    middle = (319.5, 239.5)
    true = np.array([[560.0, 0, middle[0]], [0, 540, middle[1]], [0, 0, 1]])
    pose = poses(1, np.random.default_rng(seed))[0]
    H = through(true, pose)
    assert focal_lengths([3.7 * H], middle) == pytest.approx((560, 540), rel=1e-8)
    theirs = cv2.initCameraMatrix2D([BOARD.corners.astype(np.float32)], [pixels(H).astype(np.float32)], (640, 480), 0)
    assert focal_lengths([H], middle) == pytest.approx((theirs[0, 0], theirs[1, 1]), rel=1e-3)


@given(angle=st.floats(-3, 3), shift=st.floats(-0.2, 0.2), count=st.integers(1, 6))
def test_parallel_boards_add_nothing_to_the_rank_however_they_are_turned_in_their_plane(angle, shift, count):
    tilted = Rotation.from_rotvec([0.4, -0.3, 0.1])
    turns = tilted * Rotation.from_rotvec([[0, 0, angle * i] for i in range(count)])
    t = [[shift * i, -0.1, 0.5 + 0.1 * i] for i in range(count)]
    V = np.concatenate([constraints(through(K, pose)) for pose in RigidTransform.from_components(t, turns)])
    assert np.linalg.matrix_rank(V / np.linalg.norm(V, axis=0), tol=1e-8) == 2


@pytest.mark.parametrize("tilt", [[0.4, -0.3, 0.0], [0.0, 0.0, 0.0]])
def test_parallel_boards_are_refused_in_words(tilt):
    boards = RigidTransform.from_components(
        [[0.1 * i, 0, 0.5 + 0.1 * i] for i in range(4)], Rotation.from_rotvec([tilt] * 4)
    )
    with pytest.raises(ValueError, match="determine no camera matrix"):
        camera_matrix([through(K, pose) for pose in boards])


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0)])
def test_boards_that_lean_about_one_row_or_column_lose_a_constraint(axis):
    leaning = [
        RigidTransform.from_components([0.1, 0, 0.6], Rotation.from_rotvec(angle * np.array(axis)))
        for angle in (0.5, -0.3)
    ]
    with pytest.raises(ValueError, match="tilt about one row or column"):
        camera_matrix([through(K, pose) for pose in leaning])
    with pytest.raises(ValueError, match="determine no"):
        focal_lengths([through(K, leaning[0])], K[:2, 2])


def test_a_board_held_flat_gives_no_focal_length():
    with pytest.raises(ValueError, match="determine no"):
        focal_lengths([through(K, RigidTransform.from_translation([0.1, 0, 0.6]))], K[:2, 2])


def test_too_few_boards_and_nonsense_are_refused_by_name():
    H = through(K, poses(1, np.random.default_rng(0))[0])
    with pytest.raises(ValueError, match="at least 2 with skew=False, got 1"):
        camera_matrix([H])
    with pytest.raises(ValueError, match="at least 3 with skew=True, got 2"):
        camera_matrix([H, H], skew=True)
    with pytest.raises(ValueError, match="at least one, got none"):
        focal_lengths([], (0, 0))
    with pytest.raises(ValueError, match=r"H must be a finite matrix of shape \(3, 3\)"):
        constraints(np.full((3, 3), np.nan))


@SEEDS
def test_noisy_corners_bring_k_near_the_truth_and_nearer_with_more_boards(seed):
    rng = np.random.default_rng(seed)
    many = [homography(XY, pixels(through(K, pose)) + rng.normal(0, 0.2, XY.shape)) for pose in poses(60, rng)]
    error = [abs(camera_matrix(many[:n])[0, 0] / K[0, 0] - 1) for n in (6, 60)]
    assert error[1] < 0.01
    assert error[0] < 0.08


@SEEDS
@pytest.mark.parametrize("scale", [1, -2.5, 0.01])
def test_the_pose_comes_back_in_front_of_the_camera_whatever_the_factor_of_h(seed, scale):
    true = poses(1, np.random.default_rng(seed))[0]
    found = board_pose(scale * through(K, true), K)
    np.testing.assert_allclose(found.translation, true.translation, atol=1e-9)
    np.testing.assert_allclose(found.rotation.as_matrix(), true.rotation.as_matrix(), atol=1e-9)


@SEEDS
def test_the_pose_from_noisy_corners_is_near_solvepnp_s(seed):
    rng = np.random.default_rng(seed)
    true = poses(1, rng)[0]
    uv = pixels(through(K, true)) + rng.normal(0, 0.2, XY.shape)
    found = board_pose(homography(XY, uv), K)
    _, rvec, t = cv2.solvePnP(BOARD.corners, uv, K, None)
    assert np.linalg.norm(found.translation - t.ravel()) < 0.01 * np.linalg.norm(t)
    assert (found.rotation * Rotation.from_rotvec(rvec.ravel()).inv()).magnitude() < np.radians(1.5)


def test_its_examples_come_out_as_they_say():
    with np.printoptions(legacy=False):  # a library that another test imports may have set another
        done = doctest.testmod(zhang, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert done.attempted > 10
    assert done.failed == 0
