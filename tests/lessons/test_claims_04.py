"""What lesson 04 claims about R, t and C, recomputed with OpenCV, NumPy and SciPy."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from camviz.views.frustum import FrustumView

says = claims("04")


def about(axis, degrees):
    """The matrix of a rotation by the series of exp(θ [k]ₓ), without Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis) * np.radians(degrees)
    return expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))


def world_from_cam(yaw, pitch, roll):
    """In degrees; yaw turns about y, pitch about the new x, roll about the newest z."""
    return about([0, 1, 0], yaw) @ about([1, 0, 0], pitch) @ about([0, 0, 1], roll)


def angle_of(matrix):
    return np.degrees(np.linalg.norm(cv2.Rodrigues(matrix)[0]))


def test_with_t_held_the_camera_circles_the_origin():
    says(
        "and so it circles: from C = (0, 0, −1) to C = (−1, 0, 0)",
        "|C| = |Rᵀt| = 1 m",
        "With yaw 90° and t = (0, 0, 1)",
    )
    np.testing.assert_allclose(-world_from_cam(90, 0, 0) @ [0, 0, 1], [-1, 0, 0], atol=1e-12)
    for yaw in range(0, 91, 15):
        view = FrustumView(mode="edit t", x=0.0, y=0.0, z=1.0, yaw_deg=float(yaw), pitch_deg=0.0)
        np.testing.assert_allclose(view.camera.centre, -world_from_cam(yaw, 0, 0) @ [0, 0, 1], atol=1e-9)
        np.testing.assert_allclose(view.camera.project(np.zeros(3)), [319.5, 239.5], atol=1e-9)


def test_when_t_is_minus_c_and_when_it_is_c():
    says("t = −C holds only where R leaves C in place: without a turn, or with C on the axis of the turn.")
    says(
        "t = C holds only where R takes C to −C, as a half turn about an axis at right angles to C does, and for C = 0."
    )
    axis, C = np.array([0.3, -0.5, 0.8]), np.array([1.0, 2, -0.5])
    R = about(axis, 70)
    assert np.linalg.norm(-R @ C + C) > 1e-3
    np.testing.assert_allclose(-R @ axis, -axis)
    np.testing.assert_allclose(-about(np.cross(axis, C), 180) @ C, C)
    assert np.abs(np.linalg.eigvals(R) + 1).min() > 1e-3  # R C = −C has no solution but for a half turn


def test_rodrigues_formula_and_a_quarter_turn():
    says("It takes the x axis to the y axis.", "Its square is the matrix product with itself.")
    k, angle = np.array([0.48, 0.6, 0.64]), np.radians(126)
    cross = np.cross(k, np.eye(3)).T
    rodrigues = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    np.testing.assert_allclose(rodrigues, about(k, 126), atol=1e-12)
    np.testing.assert_allclose(about([0, 0, 1], 90) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_gimbal_lock():
    says("At 90° the orange ring comes to lie in the green one, and the axis of roll in the axis of yaw.")
    says("At 60° the two turns differ. The nearer you come to 90°, the less they differ.")
    apart = [angle_of(world_from_cam(20, pitch, 0).T @ world_from_cam(0, pitch, -20)) for pitch in (60, 80, 88, 90)]
    assert (np.diff(apart) < 0).all()
    assert apart[-1] == pytest.approx(0, abs=1e-5)
    says("at pitch 88°, turning 1° to the side changes yaw and roll by 27° each")
    turned = world_from_cam(0, 88, 0) @ about([0, 1, 0], 1)
    yaw, _, roll = Rotation.from_matrix(turned).as_euler("YXZ", degrees=True)
    assert [yaw, abs(roll)] == pytest.approx([27, 27], abs=0.5)


def test_four_ways_to_write_a_rotation():
    says("rotation vectors by θ and by θ + 360° are the same rotation, and so are the quaternions q and −q")
    says(
        "| 4, of length 1 | storing, blending | scalar last or first |", "| 9, with RᵀR = I and det R = 1 | computing |"
    )
    says("| 3 | OpenCV's files, optimisation | not a list of three angles |", "twelve orders of axes")
    axis, R = np.array([0.6, 0, 0.8]), about([0.6, 0, 0.8], 63)
    np.testing.assert_allclose(about(axis, 63 + 360), R, atol=1e-9)
    q = Rotation.from_matrix(R).as_quat()
    np.testing.assert_allclose(Rotation.from_quat(-q).as_matrix(), R)
    assert (R.size, q.size, cv2.Rodrigues(R)[0].size) == (9, 4, 3)
    assert sum(a != b != c for a in "xyz" for b in "xyz" for c in "xyz") == 12


def test_the_order_of_three_angles_matters():
    says("Yaw 30°, pitch 20° and roll 10°, with yaw first or with pitch first, end 10° apart.")
    other = about([1, 0, 0], 20) @ about([0, 1, 0], 30) @ about([0, 0, 1], 10)
    assert angle_of(world_from_cam(30, 20, 10).T @ other) == pytest.approx(10, abs=0.5)


def test_the_published_poses(samples):
    says("a calibration made of 13 photographs of a board", "The board's squares are 25 mm wide.")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    poses = file.getNode("extrinsic_parameters").mat()
    assert len(poses) == 13
    assert file.getNode("square_size").real() == pytest.approx(0.025)
    says("Its z axis points away from the camera, so z is negative there.")
    assert all((-cv2.Rodrigues(pose[:3])[0].T @ pose[3:])[2] < 0 for pose in poses)
    says("(`per_view_reprojection_errors`: 1.18 px for the second, about 0.2 px for most)")
    errors = file.getNode("per_view_reprojection_errors").mat().ravel()
    assert errors.argmax() == 1
    assert errors[1] == pytest.approx(1.18, abs=5e-3)
    assert np.median(errors) == pytest.approx(0.2, rel=0.1)


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_lock():
    says("The camera looks straight up: pitch = 90°.", "turn the camera to the right until yaw is 90°")
    says("Yes: yaw 30° and roll −30° are the same rotation there.", "neither yaw nor roll makes the camera look to")
    np.testing.assert_allclose(world_from_cam(30, 90, 0), world_from_cam(0, 90, -30), atol=1e-12)
    np.testing.assert_allclose(world_from_cam(20, 90, 40) @ [0, 0, 1], [0, -1, 0], atol=1e-12)  # y is down


def test_question_gl():
    says("y and z both flip, which is a rotation by 180° about x", "diag(1, −1, −1) on the right of the pose mends it")
    flip = np.diag([1.0, -1, -1])
    np.testing.assert_allclose(about([1, 0, 0], 180), flip, atol=1e-12)
    true = world_from_cam(25, -10, 0)  # x right, y down, z forward as columns; OpenGL saves right, up, backward
    np.testing.assert_allclose((true @ flip)[:, 1:], -true[:, 1:])  # taken over unchanged: backwards and upside down
    says("flipping one axis turns a right hand into a left one, and both frames are right-handed")
    assert np.linalg.det(np.diag([1, -1, 1])) < 0 < np.linalg.det(true @ flip)


def test_question_moved():
    says("Moving the board to the camera's left does the same to it as moving the camera to its own right.")
    T, step = np.eye(4), np.eye(4)
    T[:3, :3], T[:3, 3], step[0, 3] = world_from_cam(30, 10, 5), [0.2, 0.1, 0.7], 0.05
    np.testing.assert_allclose(np.linalg.inv(step) @ T, np.linalg.inv(np.linalg.inv(T) @ step))


def test_questions_t():
    says("with t = (0, 0, 5) m", "The world's origin lies 5 m straight ahead of the camera.")
    says("For R = I, for one, that is (0, 0, −5) m, and for another R it is another place 5 m from the origin.")
    for R in (np.eye(3), world_from_cam(40, -20, 10)):
        C = np.linalg.solve(R, -np.array([0, 0, 5]))
        np.testing.assert_allclose(R @ (0 - C), [0, 0, 5], atol=1e-12)
        assert np.linalg.norm(C) == pytest.approx(5)


def test_question_first_coordinates():
    says("A camera stands elsewhere in it, turned by 30°.")
    R, lamp, C = world_from_cam(30, 0, 0).T, np.array([1.0, -2.0, 6.0]), np.array([3.0, -1.0, 0.5])
    X, Y, Z = R @ (lamp - C)
    seen = cv2.projectPoints(lamp[None], cv2.Rodrigues(R)[0], -R @ C, np.diag([500.0, 500, 1]), None)[0][0, 0]
    np.testing.assert_allclose(seen, [500 * X / Z, 500 * Y / Z])
    assert abs(Z - (lamp - C)[2]) > 0.1


def test_questions_scale():
    says("T and T/1000 mean the same transform", "R/1000 is none: its determinant is 10⁻⁹")
    says("Divide t by 1000 and leave R; give the board's corners in metres.")
    says("Divide the whole matrix by 1000.", "Divide R and t by 1000.", "R and t: both are multiplied by 100.")
    says("Only t, which is multiplied by 100.", "All 16 numbers are multiplied by 100.", "a determinant of a million")
    R, t, point = world_from_cam(30, 10, 5), np.array([0.1, 0.05, 0.9]), np.array([0.2, 0.125, 0])
    assert [np.linalg.det(R / 1000), np.linalg.det(100 * R)] == pytest.approx([1e-9, 1e6], rel=1e-9)
    for units in (100, 1000):
        np.testing.assert_allclose(R @ (units * point) + units * t, units * (R @ point + t))
    T = np.vstack([np.column_stack([R, t]), [0, 0, 0, 1]])
    same = 100 * T @ [*point, 1]
    assert T.size == 16
    np.testing.assert_allclose(same[:3] / same[3], R @ point + t)


def test_questions_angles():
    says("for these very angles pitch before yaw ends up 10° away")  # as in the test of the lesson's own sentence
    says('"roll 10, pitch 20, yaw 30"', '"mounted at the angles 40, 20, 10"')
    says("Turning by 40 about y and 20 about x, in one order or the other, ends up 14° apart.")
    y, x = about([0, 1, 0], 40), about([1, 0, 0], 20)
    assert angle_of((y @ x).T @ (x @ y)) == pytest.approx(14, abs=0.5)
