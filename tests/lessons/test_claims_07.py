"""What lesson 07 claims about epipolar geometry, recomputed with OpenCV, NumPy and SciPy."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from camviz.views.epipolar import EpipolarView
from camviz_school.course.exercises import exercise

says = claims("07")

BOARD = np.float32([(0.025 * column, 0.025 * row, 0) for row in range(6) for column in range(9)])
LONGER = np.array([[1.1, 1, 1], [1, 1.1, 1], [1, 1, 1]])


def homogeneous(uv):
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)


def cross_matrix(t):
    return np.cross(t, np.eye(3)).T


def true_F(view):
    """From the cameras' matrices and poses alone."""
    motion = view.right.cam_from_world * view.left.world_from_cam
    E = cross_matrix(motion.translation) @ motion.rotation.as_matrix()
    return np.linalg.inv(view.right.intrinsics.K).T @ E @ np.linalg.inv(view.left.intrinsics.K)


def rows_of(left, right):
    return (homogeneous(right)[:, :, None] * homogeneous(left)[:, None, :]).reshape(-1, 9)


def to_root_two(uv):
    s = np.sqrt(2) / np.linalg.norm(uv - uv.mean(axis=0), axis=1).mean()
    return np.array([[s, 0, -s * uv[:, 0].mean()], [0, s, -s * uv[:, 1].mean()], [0, 0, 1]])


def eight_point(left, right, normalise=True):
    T, T_right = (to_root_two(left), to_root_two(right)) if normalise else (np.eye(3), np.eye(3))
    A = rows_of((homogeneous(left) @ T.T)[:, :2], (homogeneous(right) @ T_right.T)[:, :2])
    U, s, Vt = np.linalg.svd(np.linalg.svd(A)[2][-1].reshape(3, 3))
    return T_right.T @ (U * [s[0], s[1], 0]) @ Vt @ T


def sampson(F, left, right):
    pairs = zip(homogeneous(left), homogeneous(right), strict=True)
    return np.array([np.sqrt(cv2.sampsonDistance(a, b, F)) for a, b in pairs])


def off_lines(F, left, right):
    """√(d_left² + d_right²) in pixels from OpenCV's lines."""
    sides = ((left, 1, right), (right, 2, left))
    lines = [cv2.computeCorrespondEpilines(uv.reshape(-1, 1, 2), i, F)[:, 0] for uv, i, _ in sides]
    return np.hypot(*(np.sum(a * homogeneous(b), axis=1) for a, (_, _, b) in zip(lines, sides, strict=True)))


def noisy(pairs, rng, sigma=1.0):
    return [uv + rng.normal(0, sigma, uv.shape) for uv in pairs]


def test_essential_matrices_have_five_numbers_and_four_motions():
    says(
        "E has five free numbers: three of rotation, two of the direction of t. So with known K five pairs are enough."
    )
    says("Two equal singular values and a zero: that is what makes a matrix essential.")

    def E(p):
        matrix = cross_matrix(p[3:]) @ Rotation.from_rotvec(p[:3]).as_matrix()
        return matrix / np.linalg.norm(matrix)

    at = np.array([0.1, -0.2, 0.05, -0.7, 0.1, 0.2])
    slopes = np.array([(E(at + step) - E(at - step)).ravel() for step in 1e-6 * np.eye(6)]) / 2e-6
    assert np.linalg.matrix_rank(slopes, tol=1e-6) == 5
    s = np.linalg.svd(E(at))[1]
    np.testing.assert_allclose(s / s[0], [1, 1, 0], atol=1e-9)
    says("W is a quarter turn about the z axis. So the two rotations differ by a half turn about the baseline.")
    R1, R2, _ = cv2.decomposeEssentialMat(E(at))
    between = Rotation.from_matrix(R1 @ R2.T).as_rotvec()
    np.testing.assert_allclose(np.abs(between) / np.pi, np.abs(at[3:]) / np.linalg.norm(at[3:]), atol=1e-6)
    says("The *five-point algorithm* (Nistér 2004) finds the few E that fit five pairs exactly.")
    points = np.random.default_rng(9).uniform([-2, -1, 3], [2, 1, 8], (5, 3))
    moved = Rotation.from_rotvec(at[:3]).apply(points) + at[3:]
    left, right = (p[:, :2] / p[:, 2:] for p in (points, moved))
    solutions = cv2.findEssentialMat(left, right, np.eye(3), cv2.RANSAC, 0.999, 1e-6)[0].reshape(-1, 3, 3)
    assert len(solutions) <= 10
    assert min(np.abs(one / np.linalg.norm(one) - s * E(at)).max() for one in solutions for s in (1, -1)) < 1e-6


def test_eight_pairs_must_be_in_general_position():
    says("so eight pairs in general position are enough, but not seven on one plane and one beside.")
    says("from at least eight pairs of points in general position")
    says("nor any number on a ruled quadric that holds the centres of both cameras.")
    rng, R = np.random.default_rng(1), Rotation.from_rotvec([0.05, -0.2, 0.1]).as_matrix()

    def rank(points, centre):
        A = ((points - centre) @ R.T)[:, :, None] * points[:, None, :]
        return np.linalg.matrix_rank(A.reshape(-1, 9), tol=1e-9)

    points, centre = rng.uniform([-2, -1, 3], [2, 1, 8], (8, 3)), np.array([0.7, 0.1, -0.1])
    for on_plane, expected in ((0, 8), (6, 8), (7, 7)):
        points[:on_plane, 2] = 5 + 0.3 * points[:on_plane, 0]
        assert rank(points, centre) == expected
    z, turn = rng.uniform(-1, 1, 102), rng.uniform(0, 2 * np.pi, 102)
    left, right, *sheet = np.stack([np.hypot(1, z) * np.cos(turn), np.hypot(1, z) * np.sin(turn), z], axis=-1)
    assert rank(sheet - left, right - left) == 7  # x² + y² − z² = 1 holds both centres
    assert rank(sheet - left, right - left + [0.1, 0.2, 0.1]) == 8


def test_normalising_pays_the_more_the_more_pairs_there_are():
    says("about 2.2 times better with 20 matches, 3.3 times with 50 and 4.5 times with 100")
    says("With twenty pairs its lines are typically less than half as far off, with a hundred less than a third.")
    everything, rng = EpipolarView(matches=100).pairs, np.random.default_rng(11)
    for matches, times in ((8, 1), (20, 2.2), (50, 3.3), (100, 4.5)):
        ratios = []
        for _ in range(150):
            pairs = noisy(EpipolarView(matches=matches).pairs, rng)
            good, bad = (np.abs(off_lines(eight_point(*pairs, one), *everything)).mean() for one in (True, False))
            ratios.append(bad / good)
        assert np.median(ratios) == pytest.approx(times, rel=0.11)


def test_ransac_s_number_of_draws():
    says("For w = 0.7 that is 5.8 %, so to be 99.9 % sure of one lucky draw takes", "= 117$ of them.")
    assert pytest.approx(5.8, abs=0.05) == 100 * 0.7**8
    assert 1 - (1 - 0.7**8) ** 116 < 0.999 < 1 - (1 - 0.7**8) ** 117


def test_gric_is_torr_s_sum():
    says("with D = 3 and k = 7 for F, D = 2 and k = 8 for H.", "it counts 2 for F and 4 for H.")

    def torr(distances, dimension, parameters, sigma):  # λ₁ = ln r, λ₂ = ln(r n), λ₃ = 2
        rho = np.minimum(np.square(distances) / sigma**2, 2 * (4 - dimension))
        return rho.sum() + np.log(4) * dimension * len(rho) + np.log(4 * len(rho)) * parameters

    assert [torr([3.0], D, 0, 0.5) - torr([0.0], D, 0, 0.5) for D in (3, 2)] == [2, 4]
    for arguments in exercise("07.gric").cases(np.random.default_rng(1)):
        assert exercise("07.gric").reference(*arguments) == pytest.approx(torr(*arguments), rel=1e-12)


def test_the_sampson_distance_is_that_of_the_nearest_pair():
    says("how far the two pixels must move, together and to first order, until they satisfy F")
    says("It must not change if F is multiplied by any number.")
    F, left, right = true_F(EpipolarView(roll=10.0, right_z=0.3)), np.array([300.0, 200]), np.array([250.0, 212])
    first = sampson(F, left[None], right[None])[0]
    assert sampson(-7 * F, left[None], right[None])[0] == pytest.approx(first)

    def off(moved):  # whatever the left pixel becomes, the right one goes to its line
        a, b, c = F @ np.append(left + moved, 1)
        return np.append(moved, (a * right[0] + b * right[1] + c) / np.hypot(a, b))

    assert np.linalg.norm(least_squares(off, np.zeros(2)).fun) == pytest.approx(first, rel=0.01)


def test_a_plane_leaves_two_motions_and_a_useless_f():
    says("for points of one plane, however many, at most two motions remain, not a whole family.")
    says("On the wall F fits best, and everywhere else it is useless.")
    rng, view = np.random.default_rng(5), EpipolarView(roll=10.0, right_z=0.3)
    (left, right), room = (
        [one.project(view.left.world_from_cam.apply(points)) for one in (view.left, view.right)]
        for points in (rng.uniform((-1.5, -1, 4), (1.5, 1, 4), (60, 3)), rng.uniform((-1, -1, 2), (1, 1, 8), (60, 3)))
    )
    K = view.left.intrinsics.K
    _, turns, _, normals = cv2.decomposeHomographyMat(cv2.findHomography(left, right)[0], K)
    in_front = [i for i, n in enumerate(normals) if (homogeneous(left) @ np.linalg.inv(K).T @ n > 0).all()]
    true = (view.right.cam_from_world * view.left.world_from_cam).rotation.as_matrix()
    assert len(in_front) <= 2
    assert min(np.abs(turns[i] - true).max() for i in in_front) < 1e-3
    fits = [eight_point(*noisy((left, right), rng, 0.5)) for _ in range(20)]
    on_wall, in_room = (np.abs([off_lines(F, *pairs) for F in fits]).mean(axis=1) for pairs in ((left, right), room))
    assert on_wall.max() < 1 < 5 < np.median(in_room)


@pytest.fixture(scope="module")
def rig(chessboards):
    """Corners, K, lens and undistorted corners of the two real cameras."""
    sides = {}
    for side in ("left", "right"):
        seen = list(chessboards(side))
        _, K, lens, *_ = cv2.calibrateCamera([BOARD] * 13, seen, (640, 480), None, None)
        points = np.float64(seen).reshape(-1, 1, 2)
        sides[side] = (seen, K, lens, cv2.undistortPoints(points, K, lens, P=K).reshape(-1, 2))
    return sides


def test_the_singular_values_hardly_see_k(rig):
    (_, K, _, left), (_, K_right, _, right) = rig["left"], rig["right"]
    F = eight_point(left, right)

    def ratio(K, K_right):
        s = np.linalg.svd(K_right.T @ F @ K)[1]
        return s[1] / s[0]

    says("half of the 702 pairs lie within 0.07 px of what F demands")
    assert len(left) == 702
    assert np.median(sampson(F, left, right)) == pytest.approx(0.07, abs=5e-3)
    says("nearly equal, 1 : 0.9984", "Multiply both focal lengths by 1.1, and the ratio is 0.9990.")
    says("Move both principal points 60 px to the right, and it is 0.9983.", "alone by 1.1, and it falls to 0.91")
    moved = np.array([[0, 0, 60.0], [0, 0, 0], [0, 0, 0]])
    ratios = ratio(K, K_right), ratio(K * LONGER, K_right * LONGER), ratio(K + moved, K_right + moved)
    assert ratios == pytest.approx((0.9984, 0.9990, 0.9983), abs=5e-5)
    assert ratio(K * LONGER, K_right) == pytest.approx(0.91, abs=5e-3)


def test_the_second_camera_s_place(rig):
    (seen, K, d, left), (seen_right, K_right, d_right, right) = rig["left"], rig["right"]
    says("the right camera stands **8.3 cm** to the right of the left one and is turned by half a degree")
    rays, rays_right = (homogeneous(uv) @ np.linalg.inv(k).T for uv, k in ((left, K), (right, K_right)))
    E = K_right.T @ eight_point(left, right) @ K
    _, R, t, _ = cv2.recoverPose(E, rays[:, :2].copy(), rays_right[:, :2].copy(), np.eye(3))
    points = cv2.triangulatePoints(np.eye(3, 4), np.hstack([R, t]), rays[:, :2].T, rays_right[:, :2].T)
    points = (points[:3] / points[3]).T
    side = np.median(np.linalg.norm(np.diff(points.reshape(-1, 6, 9, 3), axis=2), axis=-1))
    assert 100 * 0.025 / side == pytest.approx(8.3, abs=0.05)
    assert np.degrees(Rotation.from_matrix(R).magnitude()) == pytest.approx(0.5, abs=0.05)
    says("A stereo calibration, which fits all corners at once, says 8.32 cm.")
    cameras = (K, d, K_right, d_right, (640, 480))
    stereo = cv2.stereoCalibrate([BOARD] * 13, seen, seen_right, *cameras, flags=cv2.CALIB_FIX_INTRINSIC)[6]
    assert 100 * np.linalg.norm(stereo) == pytest.approx(8.32, abs=5e-3)


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_forward():
    says("Now the right camera stands 90 cm *in front* of the left one and 15 cm to its right")
    view = EpipolarView(right_x=0.15, right_z=0.9, yaw=0.0, depth=3.0)
    x, _, z = view.left.cam_from_world.apply(view.right.centre)
    assert [100 * x, 100 * z] == pytest.approx([15, 90])
    epipole = view.left.intrinsics.K @ [x, 0, z]
    F = true_F(view)
    np.testing.assert_allclose(F @ epipole / np.linalg.norm(F) / np.linalg.norm(epipole), 0, atol=1e-12)


def test_question_decides():
    says("You compute x_rightᵀ F x_left with the true F and get 0.000.", "the product is zero again")
    F = true_F(EpipolarView(roll=5.0, right_z=0.2))
    a, b, c = F @ [300.0, 200, 1]
    assert all(abs(u * a - (a * u + c) / b * b + c) < 1e-9 * np.linalg.norm(F) for u in (0.0, 100, 600))


def test_question_normalise():
    says("u·u′ is about 100,000 in pixels, and 1 stays 1", "with any number of digits it would be the same")
    left, right = EpipolarView(matches=20).pairs
    assert (left[:, 0] * right[:, 0]).mean() == pytest.approx(100_000, rel=0.1)
    A = rows_of(*noisy((left, right), np.random.default_rng(7)))
    seven, sixteen = (np.linalg.svd(one)[2][-1].astype(float).reshape(3, 3) for one in (np.float32(A), A))
    mean = [np.abs(off_lines(F, left, right)).mean() for F in (seven, sixteen)]
    assert mean[0] == pytest.approx(mean[1], rel=0.05)


def test_questions_scale():
    says("A model house, a hundred times smaller, seen from 1 cm apart gives the same pictures as the house from 1 m")
    says("The program made that vector as long as 1, or whatever it likes.", "everything a hundred times smaller")
    points, K = np.random.default_rng(4).uniform([-1, -1, 4], [1, 1, 8], (9, 3)), np.diag([500.0, 500, 1])
    turn, t = np.array([0, 0.1, 0]), np.array([-1.0, 0, 0])
    house, model = (cv2.projectPoints(points * s, turn, t * s, K, None)[0] for s in (1.0, 0.01))
    np.testing.assert_allclose(house, model, atol=1e-9)


def test_questions_rotation():
    says("A calibrated camera on a pole pans by 20°", "A turn of 20°, and a direction that means nothing.")
    says("The right turn with any direction fits these pairs exactly, and noise picks the direction.")
    says("An F that holds the right R, and an epipole that means nothing.")
    says("Without a baseline an F of every epipole satisfies all pairs, and noise picks one.")
    R, K = Rotation.from_euler("y", 20, degrees=True).as_matrix(), np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]])
    rng, off, directions = np.random.default_rng(9), [], []
    x = rng.uniform([-1, -1, 2], [1, 1, 5], (20, 3))
    A = ((x @ R.T)[:, :, None] * x[:, None, :]).reshape(-1, 9)
    assert all(np.abs(A @ (cross_matrix(axis) @ R).ravel()).max() < 1e-12 for axis in np.eye(3))
    for _ in range(50):
        left = rng.uniform([0, 0], [640, 480], (400, 2))
        right = cv2.perspectiveTransform(left[None], K @ R @ np.linalg.inv(K))[0]
        seen = right[:, 0] < 640
        F = cv2.findFundamentalMat(*noisy((left[seen], right[seen]), rng, 0.5), cv2.FM_8POINT)[0]
        *turns, t = cv2.decomposeEssentialMat(K.T @ F @ K)
        off.append(min(np.degrees(Rotation.from_matrix(turn @ R.T).magnitude()) for turn in turns))
        directions.append(t.ravel())
    assert np.median(off) < 0.2
    assert np.sqrt(np.mean(np.square(directions), axis=0)).min() > 0.3  # they point anywhere


def test_questions_cheirality():
    says("All four R are turns, with determinant +1.", "Two of them differ from the others by a half turn about the")
    E = cross_matrix([1.0, 0.2, -0.1]) @ Rotation.from_euler("yx", [10, -4], degrees=True).as_matrix()
    assert [np.linalg.det(R) for R in cv2.decomposeEssentialMat(E)[:2]] == pytest.approx([1, 1])
