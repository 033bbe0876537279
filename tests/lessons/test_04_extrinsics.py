"""What lesson 04 says about R, t and C, recomputed with NumPy, SciPy and OpenCV."""

import ast
import builtins
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from camviz.scenes.standard import board_corners
from camviz.views.frustum import FrustumView
from camviz_school.course import minutes, notebooks
from camviz_school.course.exercises import exercise

EXCEPTIONS: dict[str, str] = {}

LESSON = Path(__file__).parents[2] / "lessons" / "04_extrinsics.ipynb"


def about(axis, angle):
    """The matrix of a turn, by the series of exp(θ [k]ₓ) and so without Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis) * angle
    return expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))


def world_from_cam(yaw, pitch, roll):
    """In degrees; yaw turns about y, pitch about the new x, roll about the newest z."""
    yaw, pitch, roll = np.radians([yaw, pitch, roll])
    return about([0, 1, 0], yaw) @ about([1, 0, 0], pitch) @ about([0, 0, 1], roll)


def angles_of(matrix):
    """Yaw, pitch and roll in degrees, read off the product of the three turns."""
    pitch = np.arcsin(-matrix[1, 2])
    yaw, roll = np.arctan2(matrix[0, 2], matrix[2, 2]), np.arctan2(matrix[1, 0], matrix[1, 1])
    return np.degrees([yaw, pitch, roll])


def angle_of(matrix):
    return np.degrees(np.linalg.norm(cv2.Rodrigues(matrix)[0]))


@pytest.fixture
def rng():
    return np.random.default_rng(4)


# R, t and C ----------------------------------------------------------------------------------------------------------


def test_with_t_held_the_camera_circles_the_origin_and_looks_at_it(says):
    (yaw,) = says("turn the camera to the right until yaw is 90°. Where does the camera go?")
    (ahead,) = says(
        "where the camera has the world's origin, 1 m straight ahead, and to keep it there the camera has to walk"
    )
    (again,) = says("says that the world's origin lies 1 m straight ahead of the camera")
    before, after = says("and so it circles: from C = (0, 0, −1) to C = (−1, 0, 0)")
    (behind,) = says("With R = I the camera stands at (0, 0, −1): as far behind the origin as t says")
    (length,) = says("|C| = |Rᵀt| = 1 m. Points at one distance lie on a sphere, and no straight line does.")
    t = np.array([0, 0, ahead.value])
    start, end = -world_from_cam(0, 0, 0) @ t, -world_from_cam(yaw.value, 0, 0) @ t
    np.testing.assert_allclose(start, [0, 0, before.value], atol=1e-12)
    np.testing.assert_allclose(end, [after.value, 0, 0], atol=1e-12)
    assert again.value == ahead.value
    assert behind == start[2]
    says("keeps its length, and the origin stays in the middle of the picture")
    for angle in range(0, 91, 15):
        view = FrustumView(mode="edit t", x=0.0, y=0.0, z=ahead.value, yaw_deg=float(angle), pitch_deg=0.0)
        assert length == np.linalg.norm(view.camera.centre)
        np.testing.assert_allclose(view.camera.centre, -world_from_cam(angle, 0, 0) @ t, atol=1e-9)
        np.testing.assert_allclose(view.camera.project(np.zeros(3)), [319.5, 239.5], atol=1e-9)


def test_t_is_minus_c_on_the_axis_of_the_turn_and_c_after_a_half_turn_at_right_angles(says, rng):
    says("The two have the same length and little else in common.")
    says("t = −C holds only where R leaves C in place: without a turn, or with C on the axis of the turn.")
    says(
        "t = C holds only where R takes C to −C, as a half turn about an axis at right angles to C does, and for C = 0."
    )
    says(
        "The vector t equals −C only where R leaves C in place: no turn, or C on the axis of the turn. It equals C "
        "only where R takes C to −C, as a half turn about an axis at right angles to C does, or where C is the origin."
    )  # fmt: skip
    for _ in range(100):
        axis, C, angle = rng.normal(size=3), rng.normal(size=3), rng.uniform(0.1, 3)
        R = about(axis, angle)
        t = -R @ C
        assert np.linalg.norm(t) == pytest.approx(np.linalg.norm(C))
        assert np.linalg.norm(t + C) > 1e-3  # C off the axis
        assert np.linalg.norm(t - C) > 1e-3
        np.testing.assert_allclose(-R @ axis, -axis, atol=1e-12)  # C on the axis
        across = np.cross(axis, C)
        np.testing.assert_allclose(-about(across, np.pi) @ C, C, atol=1e-12)
        values = np.linalg.eigvals(R)
        assert np.abs(values - 1).min() < 1e-9  # R C = C has one line of solutions …
        assert np.abs(values + 1).min() > 1e-3  # … and R C = −C none, unless R is a half turn


def test_minus_t_is_right_only_for_t_on_the_axis(says, rng):
    says("Only where t lies on the axis of the turn is −t right by itself.")
    axis = rng.normal(size=3)
    R = about(axis, 1.2)
    np.testing.assert_allclose(np.linalg.solve(R, -axis), -axis)
    assert np.linalg.norm(np.linalg.solve(R, -np.roll(axis, 1)) + np.roll(axis, 1)) > 0.1
    says("the direction in which the camera looks")
    looking = world_from_cam(20, 10, 0)
    np.testing.assert_allclose(looking.T[2], looking @ [0, 0, 1])
    says("This is how far the camera is from the world's origin, |C| = |t|.")
    assert np.linalg.norm(-R.T @ axis) == pytest.approx(np.linalg.norm(axis))


def test_one_camera_by_hand(says):
    (yaw,) = says("With yaw 90° and t = (0, 0, 1)")
    R = world_from_cam(yaw.value, 0, 0).T
    np.testing.assert_allclose(R, [[0, 0, -1], [0, 1, 0], [1, 0, 0]], atol=1e-12)  # as the next cell has it
    np.testing.assert_allclose(np.linalg.solve(R, [0, 0, -1]), [-1, 0, 0], atol=1e-12)


def test_a_quarter_turn_about_z_by_hand(says):
    says("It takes the x axis to the y axis.")
    k = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    R = np.eye(3) + k + k @ k
    np.testing.assert_allclose(R, about([0, 0, 1], np.pi / 2), atol=1e-12)
    np.testing.assert_allclose(R @ [1, 0, 0], [0, 1, 0])


def test_what_one_moves_the_world_undoes(says):
    says("to the right: in front of the camera, the world goes to the left")
    says("Turn it to the right with **yaw**, and the world turns to the left about the camera.")
    point = np.array([0.0, 0, 3])
    assert (point - [0.1, 0, 0])[0] < 0  # C to the right
    assert (world_from_cam(10, 0, 0).T @ point)[0] < 0  # turned to the right
    says("Moving the board to the camera's left does the same to it as moving the camera to its own right.")
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = world_from_cam(30, 10, 5), [0.2, 0.1, 0.7]
    step = np.eye(4)
    step[0, 3] = 0.05
    board_moved, camera_moved = np.linalg.inv(step) @ T, np.linalg.inv(np.linalg.inv(T) @ step)
    np.testing.assert_allclose(board_moved, camera_moved, atol=1e-12)


# Rotations -----------------------------------------------------------------------------------------------------------


def test_looking_straight_up_yaw_and_roll_are_one(says):
    (pitch,) = says("The camera looks straight up: pitch = 90°.")
    (again,) = says("Set pitch to 90° and move one, then the other")
    yaw, roll = says("Yes: yaw 30° and roll −30° are the same rotation there.")
    (off,) = says("Nothing: at 90° they are switched off.")
    (beyond,) = says("Beyond 90° the camera cannot turn at all")
    assert {again.value, off.value, beyond.value} == {pitch.value}
    up = world_from_cam(0, pitch.value, 0) @ [0, 0, 1]
    np.testing.assert_allclose(up, [0, -1, 0], atol=1e-12)  # y is down
    same = world_from_cam(0, pitch.value, roll.value)
    np.testing.assert_allclose(world_from_cam(yaw.value, pitch.value, 0), same, atol=1e-12)
    says("neither yaw nor roll makes the camera look to the side")
    for change in ((20, 0), (0, 20)):
        np.testing.assert_allclose(world_from_cam(change[0], pitch.value, change[1]) @ [0, 0, 1], up, atol=1e-12)


def test_near_the_lock_the_two_differ_less_and_less(says):
    at, back = says("Take pitch to 90°, and move the other two. Then go back to 60°.")
    locked, off, near = says(
        "At 90° the orange ring comes to lie in the green one, and the axis of roll in the axis of yaw. That is "
        "[gimbal lock](00_start_here.ipynb#gimbal-lock). At 60° the two turns differ. The nearer you come to 90°, the "
        "less they differ."
    )
    assert at.value == near.value == locked.value

    def apart(pitch):
        return angle_of(world_from_cam(20, pitch, 0).T @ world_from_cam(0, pitch, -20))

    assert apart(at.value) == pytest.approx(0, abs=1e-5)
    assert back.value == off.value
    assert apart(off.value) > apart(80) > apart(88) > 0.5
    roll_axis = world_from_cam(30, locked.value, 0) @ [0, 0, 1]
    assert np.linalg.norm(np.cross(roll_axis, [0, 1, 0])) == pytest.approx(0, abs=1e-12)
    (both,) = says("at pitch ±90° two of them become one")
    np.testing.assert_allclose(world_from_cam(30, -both.value, 0), world_from_cam(0, -both.value, 30), atol=1e-12)


def test_near_the_lock_a_small_turn_makes_angles_jump(says):
    pitch, turn, jump = says("at pitch 88°, turning 1° to the side changes yaw and roll by 27° each")
    turned = world_from_cam(0, pitch.value, 0) @ about([0, 1, 0], np.radians(turn.value))
    yaw, _, roll = angles_of(turned)
    assert jump == yaw
    assert jump == roll
    np.testing.assert_allclose(world_from_cam(*angles_of(turned)), turned, atol=1e-12)


def test_four_ways_to_write_a_rotation(says, rng):
    (three,) = says("| 3 | telling a person |")
    (vector,) = says("| 3 | OpenCV's files, optimisation | not a list of three angles |")
    (turn,) = says("rotation vectors by θ and by θ + 360° are the same rotation, and so are the quaternions q and −q")
    (four,) = says("| 4, of length 1 | storing, blending | scalar last or first |")
    (nine,) = says("| 9, with RᵀR = I and det R = 1 | computing |")
    axis, angle = np.array([0.6, 0, 0.8]), 1.1
    R, q = about(axis, angle), np.array([*(np.sin(angle / 2) * axis), np.cos(angle / 2)])
    assert vector.value == three.value == axis.size
    assert four.value == q.size
    assert nine.value == R.size
    np.testing.assert_allclose(about(axis, angle + np.radians(turn.value)), R, atol=1e-9)
    assert np.linalg.norm(q) == pytest.approx(1)
    for one in (q, -q):
        np.testing.assert_allclose(Rotation.from_quat(one).as_matrix(), R, atol=1e-12)  # SciPy: scalar last
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1)
    says("twelve orders of axes")
    orders = [a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if a != b != c]
    assert len(orders) == 12


def test_k_cross_is_the_matrix_of_the_cross_product_and_makes_rodrigues_formula(says, rng):
    says("writes the cross product as a matrix")
    says("Its square is the matrix product with itself.")
    source = next(cell.source for cell in notebooks.read(LESSON).cells if "begin{bmatrix}0 & -k_3" in cell.source)
    rows = re.search(r"\\begin\{bmatrix\}(0 & -k_3.*?)\\end\{bmatrix\}", source, re.DOTALL)[1].split(r"\\")
    k, v, angle = np.array([0.48, 0.6, 0.64]), rng.normal(size=3), 2.2
    names = {"0": 0.0} | {f"{sign}k_{i + 1}": (-1 if sign else 1) * k[i] for i in range(3) for sign in ("", "-")}
    cross = np.array([[names[entry.strip()] for entry in row.split("&")] for row in rows])
    np.testing.assert_allclose(cross @ v, np.cross(k, v), atol=1e-12)
    R = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    np.testing.assert_allclose(R, about(k, angle), atol=1e-12)
    says("the two differ by the identity, [k]ₓ² = k kᵀ − I")
    np.testing.assert_allclose(cross @ cross, np.outer(k, k) - np.eye(3), atol=1e-12)


def test_the_same_three_angles_in_another_order(says):
    roll, pitch, yaw = says('A colleague sends you a pose: "roll 10, pitch 20, yaw 30".')
    (away,) = says("for these very angles pitch before yaw ends up 10° away")
    *same, apart = says("Yaw 30°, pitch 20° and roll 10°, with yaw first or with pitch first, end 10° apart.")
    assert [one.value for one in same] == [yaw.value, pitch.value, roll.value]
    one = world_from_cam(yaw.value, pitch.value, roll.value)
    turns = (([1, 0, 0], pitch), ([0, 1, 0], yaw), ([0, 0, 1], roll))
    other = np.linalg.multi_dot([about(axis, np.radians(angle.value)) for axis, angle in turns])
    assert away == angle_of(one.T @ other)
    assert apart == angle_of(one.T @ other)


# Chains and scale ----------------------------------------------------------------------------------------------------


def test_four_by_four(says):
    square = [*says("and their matrices are 4×4:"), *says("shape (..., 4, 4)")]
    square += says("What mends the 4×4 matrix cam_from_board")
    assert {one.value for one in square} == {len("xyz") + 1}
    whole, again, three, by_three = says(
        "This is the transpose of the whole 4×4 matrix. Only the 3×3 rotation is inverted by transposing."
    )
    rotation, its, matrix, with_t = says(
        "The transpose inverts its 3×3 rotation, but not the 4×4 matrix with its translation."
    )
    assert whole.value == again.value == matrix.value == with_t.value == 4
    assert three.value == by_three.value == rotation.value == its.value == 3
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = world_from_cam(30, 10, 5), [1, 2, 3]
    np.testing.assert_allclose(np.linalg.inv(T[:3, :3]), T[:3, :3].T, atol=1e-12)
    assert np.abs(np.linalg.inv(T) - T.T).max() > 1
    np.testing.assert_allclose(np.linalg.inv(T)[:3, 3], -T[:3, :3].T @ T[:3, 3], atol=1e-12)


def test_the_board_s_last_corner(says):
    right, size, down = says("The board's last corner is 8 squares of 0.1 m to the right and 5 down.")
    corners = board_corners()
    across = corners[8] - corners[0]
    below = corners[9 * 5] - corners[0]
    assert np.linalg.norm(across) == pytest.approx(right.value * size.value)
    assert np.linalg.norm(below) == pytest.approx(down.value * size.value)
    np.testing.assert_allclose(corners[-1], corners[0] + across + below)


def test_a_change_of_units_changes_t_and_the_points_only(says):
    (whole,) = says("Divide the whole matrix by 1000.")
    (apart,) = says("Divide R and t by 1000.")
    (only_t,) = says("Divide t by 1000 and leave R; give the board's corners in metres.")
    (over,) = says("T and T/1000 mean the same transform: all the numbers change, and no point lands anywhere else")
    divisor, ten = says("A rotation has no units, and R/1000 is none: its determinant is 10⁻⁹.")
    R, t_mm, corner_mm = world_from_cam(30, 10, 5), np.array([100.0, 50, 900]), np.array([200.0, 125, 0])
    metres = (R @ corner_mm + t_mm) / only_t.value
    np.testing.assert_allclose(R @ (corner_mm / 1000) + t_mm / only_t.value, metres)
    assert whole.value == apart.value == over.value == divisor.value == 1000
    assert np.linalg.det(R / divisor.value) == pytest.approx(ten.value**-9)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t_mm
    a, b = (M @ [*corner_mm, 1] for M in (T, T / over.value))
    np.testing.assert_allclose(a[:3] / a[3], b[:3] / b[3])
    says("Make the world and t a thousand times larger, and all pixels stay where they are")
    K, rvec = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), cv2.Rodrigues(R)[0]
    pixels = [cv2.projectPoints(corner_mm[None] * k, rvec, t_mm * k, K, None)[0] for k in (0.001, 1.0)]
    np.testing.assert_allclose(*pixels, atol=1e-9)


def test_opengl_s_camera_taken_for_opencv_s_looks_back_upside_down_from_the_same_place(says):
    (turn,) = says("y and z both flip, which is a rotation by 180° about x")
    y, z = says("diag(1, −1, −1) on the right of the pose mends it.")
    flip = np.diag([1.0, y.value, z.value])
    np.testing.assert_allclose(about([1, 0, 0], np.radians(turn.value)), flip, atol=1e-12)
    true = world_from_cam(25, -10, 0)  # x right, y down, z forward, as columns
    stored = true @ flip  # x right, y up, z backward: as OpenGL saves it
    right, down, forward = stored.T  # taken over unchanged
    np.testing.assert_allclose(forward, -true[:, 2], atol=1e-12)
    np.testing.assert_allclose(down, -true[:, 1], atol=1e-12)
    np.testing.assert_allclose(right, true[:, 0], atol=1e-12)
    np.testing.assert_allclose(stored @ flip, true, atol=1e-12)
    says("flipping one axis turns a right hand into a left one, and both frames are right-handed")
    assert np.linalg.det(np.diag([1, -1, 1])) < 0 < np.linalg.det(stored)


# The exercises -------------------------------------------------------------------------------------------------------


def test_what_the_determinant_does_not_notice(says):
    (lean,) = says("A lean of 0.0005 changes the determinant by a ten-millionth")
    columns = np.array([[1, lean.value, 0], [0, np.sqrt(1 - lean.value**2), 0], [0, 0, 1]])
    np.testing.assert_allclose(np.linalg.norm(columns, axis=0), 1, atol=1e-15)
    assert 1 - np.linalg.det(columns) == pytest.approx(1e-7, rel=0.3)
    says("MᵀM = I alone lets mirrors pass, det M = 1 alone lets shears pass.")
    shear, mirror = np.array([[1, 2, 0], [0, 1, 0], [0, 0, 1]]), np.diag([1, -1, 1])
    assert np.linalg.det(shear) == pytest.approx(1)
    assert np.abs(shear.T @ shear - np.eye(3)).max() > 1
    np.testing.assert_array_equal(mirror.T @ mirror, np.eye(3))


def test_a_rotation_saved_in_single_precision_still_counts(says, rng):
    says("which is enough for a rotation that was saved in single precision")
    says("most rotations that were saved in single precision fail")
    saved = [Rotation.random(rng=rng).as_matrix().astype(np.float32).astype(float) for _ in range(50)]
    off = np.array([np.abs(M.T @ M - np.eye(3)).max() for M in saved])
    assert (off < 1e-6).all()
    assert sum(np.allclose(M.T @ M, np.eye(3)) for M in saved) < 25
    assert all(exercise("04.is_rotation").reference(M) for M in saved)


def test_the_chain_works_with_the_camera_on_the_world_whatever_the_order(says):
    says("It was tested with the camera's frame laid on the world's, where it worked.")
    given, right = exercise("04.chain").as_given, exercise("04.chain").reference
    board = np.eye(4)
    board[:3, :3], board[:3, 3] = world_from_cam(30, 10, 5), [0.2, 0.1, 0.7]
    np.testing.assert_allclose(given(np.eye(4), board), right(np.eye(4), board))
    assert np.abs(given(board, board @ board) - right(board, board @ board)).max() == pytest.approx(0, abs=1e-12)
    assert np.abs(given(board, board.T) - right(board, board.T)).max() > 0.1


# The published poses -------------------------------------------------------------------------------------------------


@pytest.fixture
def calibration(samples):
    return cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)


def corners_found(path):
    found, corners = cv2.findChessboardCornersSB(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), (9, 6))
    assert found
    return corners.reshape(-1, 2)


def test_the_published_rows(says, calibration):
    (pictures,) = says("a calibration made of 13 photographs of a board")
    (again,) = says("find with your own function where a camera stood in 13 pictures of a board")
    poses = calibration.getNode("extrinsic_parameters").mat()
    assert pictures.value == again.value == len(poses) == calibration.getNode("nframes").real()
    source = next(cell.source for cell in notebooks.read(LESSON).cells if cell.source.startswith("published ="))
    rows = np.array(re.search(r'"""(.*?)"""', source, re.DOTALL)[1].split(), dtype=float).reshape(poses.shape)
    np.testing.assert_allclose(rows, poses, atol=0.5e-4 + 1e-9)
    (size,) = says("The board's squares are 25 mm wide.")
    says("Its z axis points away from the camera, so z is negative there.")
    assert size == 1000 * calibration.getNode("square_size").real()
    for rvec, t in zip(poses[:, :3], poses[:, 3:], strict=True):
        R = cv2.Rodrigues(rvec)[0]
        assert R[2, 2] > 0  # the board's z axis, in the camera's frame
        assert (-R.T @ t)[2] < 0


def test_the_second_picture_fits_badly(says, calibration, samples):
    second, worst, most = says(
        "Look at picture 2 as well: the dots miss its corners by about a pixel, in most others by a fifth of one. "
        "The file itself says so (`per_view_reprojection_errors`: 1.18 px for the second, about 0.2 px for most)."
    )
    errors = calibration.getNode("per_view_reprojection_errors").mat().ravel()
    assert worst == errors[int(second.value) - 1]
    assert errors.argmax() == second.value - 1
    assert most.about(np.median(errors), within=0.1)
    assert (np.abs(errors - most.value) < 0.1).sum() > 10
    K, lens = (calibration.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))
    board = np.zeros((54, 3))
    board[:, :2] = 0.025 * np.mgrid[0:9, 0:6].T.reshape(-1, 2)
    missed = {}
    for number in (2, 1, 9):
        pose = calibration.getNode("extrinsic_parameters").mat()[number - 1]
        dots = cv2.projectPoints(board, pose[:3].copy(), pose[3:].copy(), K, lens)[0].reshape(-1, 2)
        corners = corners_found(samples / f"left{number:02d}.jpg")
        missed[number] = min(np.linalg.norm(dots - c, axis=1).mean() for c in (corners, corners[::-1]))
    assert 0.5 < missed[2] < 1.5
    assert max(missed[1], missed[9]) < 0.4


def test_the_photographs_know_that_the_camera_stood_still(says, samples):
    says("the same screen and keyboard stand at the left of every one")
    numbers = [number for number in range(1, 15) if number != 10]
    photographs = np.stack([cv2.imread(str(samples / f"left{n:02d}.jpg"), cv2.IMREAD_GRAYSCALE) for n in numbers])
    change = np.abs(photographs - np.median(photographs, axis=0)).mean(axis=0)
    keyboard, middle = change[400:470, 60:150], change[150:350, 250:450]
    assert np.median(keyboard) < 10 < 30 < np.median(middle)


def test_allclose_adds_its_relative_tolerance(says):
    added, off = says(
        "`np.allclose` adds its `rtol`, 1e-5 unless told otherwise, to your `atol`, so that MᵀM may be off by 1.1e-5 "
        "on its diagonal: give it `rtol=0`."
    )
    assert off.value == pytest.approx(added.value + 1e-6)
    for error, accepted in ((0.99 * off.value, True), (1.01 * off.value, False)):
        assert np.allclose(1 + error, 1.0, atol=1e-6) == accepted
        assert not np.allclose(1 + error, 1.0, rtol=0, atol=1e-6)


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_what_t_tells(says, rng):
    (t,) = says("by X_cam = R X_world + t, with t = (0, 0, 5) m")
    shift = np.array([0, 0, t.value])
    (ahead,) = says("The world's origin lies 5 m straight ahead of the camera.")
    (along,) = says("X_world = 0 becomes X_cam = t, which is 5 m along the camera's own z axis")
    centre, away = says(
        "For R = I, for one, that is (0, 0, −5) m, and for another R it is another place 5 m from the origin."
    )
    assert centre == -shift[2]
    for R in Rotation.random(20, rng=rng).as_matrix():
        assert all(one == (R @ np.zeros(3) + shift)[2] for one in (ahead, along))
        assert away == np.linalg.norm(-R.T @ shift)
    for (wrong,) in (says("The camera stands at (0, 0, 5) m in the world."), says("The camera has moved by 5 m since")):
        assert wrong == t.value


def test_before_the_lesson_what_goes_into_the_projection(says):
    (angle,) = says("A camera stands elsewhere in it, turned by 30°.")
    R = world_from_cam(angle.value, 0, 0).T
    lamp, centre = np.array([1.0, -2.0, 6.0]), np.array([3.0, -1.0, 0.5])
    depth = (R @ (lamp - centre))[2]
    assert abs(depth - (lamp - centre)[2]) > 0.1
    K = np.diag([500.0, 500.0, 1.0])
    seen = cv2.projectPoints(lamp[None], cv2.Rodrigues(R)[0], -R @ centre, K, None)[0][0, 0]
    np.testing.assert_allclose(seen, 500 * (R @ (lamp - centre))[:2] / depth)


def test_before_the_lesson_a_change_of_units(says, rng):
    rows, columns = says("cam_from_world is a 4×4 matrix with R and t, in metres.")
    assert rows.value == columns.value == 4
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.random(rng=rng).as_matrix(), [1, -2, 0.5]
    points = np.append(rng.normal(size=(5, 3)), np.ones((5, 1)), axis=1)
    (times,) = says("Only t, which is multiplied by 100.")
    changed = T.copy()
    changed[:3, 3] *= times.value
    centimetres = points * [100, 100, 100, 1]
    np.testing.assert_allclose((centimetres @ changed.T)[:, :3], 100 * (points @ T.T)[:, :3])
    (R_too,) = says("R and t: both are multiplied by 100.")
    (enlarged,) = says("Multiplied by 100 it would enlarge them too, with a determinant of a million.")
    assert np.linalg.det(enlarged.value * T[:3, :3]) == pytest.approx(1e6)
    numbers, all_ = says("All 16 numbers are multiplied by 100.")
    assert numbers == T.size
    scaled = points @ (all_.value * T).T
    np.testing.assert_allclose(scaled[:, :3] / scaled[:, 3:], (points @ T.T)[:, :3])
    (more,) = says("t is a length, 100 times as many centimetres as metres")
    assert more.value == R_too.value == 100


def test_before_the_lesson_three_angles_are_not_enough(says):
    first, second, _ = angles = says("mounted at the angles 40, 20, 10")
    assert all(0 < one.value < 90 for one in angles)
    about_y, about_x, apart = says(
        "Turning by 40 about y and 20 about x, in one order or the other, ends up 14° apart."
    )
    y, x = about([0, 1, 0], np.radians(about_y.value)), about([1, 0, 0], np.radians(about_x.value))
    assert apart == angle_of((y @ x).T @ (x @ y))
    assert (about_y.value, about_x.value) == (first.value, second.value)


# What stands where ---------------------------------------------------------------------------------------------------


def _names(source):
    """Names that a cell reads, and those that it defines or imports."""
    nodes = list(ast.walk(ast.parse(source)))
    imported = [one for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for one in node.names]
    defined = {(one.asname or one.name).partition(".")[0] for one in imported}
    defined |= {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    defined |= {node.arg for node in nodes if isinstance(node, ast.arg)}
    used = [node for node in nodes if isinstance(node, ast.Name)]
    defined |= {node.id for node in used if isinstance(node.ctx, ast.Store)}
    return {node.id for node in used if isinstance(node.ctx, ast.Load)}, defined


def test_each_deeper_section_needs_the_cells_of_the_core_alone():
    notebook = notebooks.read(LESSON)
    known = set(dir(builtins)).union(*(_names(one.source)[1] for one in minutes.core(notebook) if _is_code(one)))
    sections = minutes.sections(notebook)
    assert len(sections) == 3
    for section in sections:
        here = set(known)
        for cell in filter(_is_code, section.cells):
            used, defined = _names(cell.source)
            here |= defined
            assert used <= here, (section.title, used - here)


def _is_code(cell):
    return cell.cell_type == "code"


def test_extrinsics_and_camera_matrix_have_the_shapes_that_are_said(says):
    a, b, c, d = says("of 3 × 3 numbers, [R | t] is 3 × 4, and the whole")
    view = FrustumView()
    R, t = view.numbers()["R"], view.numbers()["t"]
    assert R.shape == (a.value, b.value)
    assert np.column_stack([R, t]).shape == (c.value, d.value)
    says("leads from the world to the pixels")
    u, v, w = view.numbers()["K"] @ np.column_stack([R, t]) @ [*board_corners()[0], 1]
    np.testing.assert_allclose((u / w, v / w), view.camera.project(board_corners()[0]))


def test_the_first_picture_keeps_the_world_s_corner_in_its_middle(says):
    says("yaw changes R, the way this camera is turned, and not t. Pull it: why does the corner of the axes stay in")
    says("t is (0, 0, 1) m all the time")
    for yaw in range(-60, 61, 20):
        view = FrustumView.held(yaw_deg=float(yaw))
        np.testing.assert_allclose(view.numbers()["t"], (0, 0, 1), atol=1e-12)
        np.testing.assert_allclose(view.camera.project(np.zeros(3)), (319.5, 239.5), atol=1e-9)
    assert not FrustumView.held(yaw_deg=60.0).camera.sees(board_corners()).any()  # the garden has gone by


def test_a_camera_under_a_lamp_sees_it_whatever_yaw_and_roll_are(says):
    says("Lay the camera under a lamp, looking straight up.")
    lamp = np.array([2.05, 1.25 - 1.95, 3.5])
    under = FrustumView(x=1.75, y=0.3, z=3.4, yaw_deg=0.0, pitch_deg=90.0)
    assert under.camera.sees(lamp)
    turned, rolled = under.but(yaw_deg=40.0).camera, under.but(roll_deg=-40.0).camera
    np.testing.assert_allclose(turned.project(lamp), rolled.project(lamp), atol=1e-9)
