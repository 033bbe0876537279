"""What lesson 00 and the glossary claim, recomputed with OpenCV, NumPy and SciPy."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from claims import claims
from scipy.linalg import rq
from scipy.spatial.transform import Rotation

says = claims("00")

DATA = Path(__file__).parents[1] / "data"


def test_k_holds_the_distance_from_lens_to_sensor():
    says("The one in K is the distance v from lens to sensor, in pixels: the same when focused at infinity, and 5.3 %")
    says("f [px] = v [mm] / pixel pitch [mm], v = f s / (s − f) when focused at s", "v [mm] = fx · pitch [mm]")
    v = 1 / (1 / 50 - 1 / 1000)  # 1/f = 1/s + 1/v
    assert v == pytest.approx(50 * 1000 / (1000 - 50))
    assert 100 * (v / 50 - 1) == pytest.approx(5.3, abs=0.05)


def test_fisheye_models_are_opencv_s_and_the_paper_s():
    says("r = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)")
    k, point = np.array([0.1, -0.03, 0.02, -0.004]), np.array([0.4, -0.7, 0.9])
    far = np.hypot(*point[:2])
    theta = np.arctan2(far, point[2])
    seen = cv2.fisheye.projectPoints(point[None, None], np.zeros(3), np.zeros(3), np.eye(3), k)[0][0, 0]
    np.testing.assert_allclose(seen, theta * (1 + k @ theta ** np.array([2, 4, 6, 8])) * point[:2] / far)
    says("(x, y) = f (X, Y) / (α D2 + (1 − α)(ξ D1 + Z)), D1 = |(X, Y, Z)|, D2 = |(X, Y, ξ D1 + Z)|")
    xi, alpha = -0.2, 0.6
    second = point / np.linalg.norm(point) + [0, 0, xi]  # one sphere, seen from ξ away
    shifted = second / np.linalg.norm(second) + [0, 0, alpha / (1 - alpha)]  # the pinhole behind the second one
    d1, d2 = np.linalg.norm(point), np.hypot(far, xi * np.linalg.norm(point) + point[2])
    formula = point[:2] / (alpha * d2 + (1 - alpha) * (xi * d1 + point[2]))
    np.testing.assert_allclose(shifted[:2] / shifted[2] / (1 - alpha), formula)


def test_hand_eye_needs_two_axes_that_are_not_parallel():
    says("It takes at least two turns, about axes that are not parallel.", "A X = X B")
    X = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()

    def solutions(*axes):
        turns = [Rotation.from_rotvec(axis).as_matrix() for axis in axes]
        rows = [np.kron(np.eye(3), A) - np.kron((X.T @ A @ X).T, np.eye(3)) for A in turns]
        return 9 - np.linalg.matrix_rank(np.vstack(rows), tol=1e-9)

    assert solutions([0, 0, 0.5], [0, 0, 0.9]) > 1
    assert solutions([0, 0, 0.5], [0.4, 0, 0]) == 1  # X alone, up to its scale


def test_files_give_rotations_in_three_forms():
    says("OpenCV's files give poses in this form, while Kalibr writes 4×4 matrices and COLMAP quaternions.")
    chain = yaml.safe_load((DATA / "kalibr_chain.yaml").read_text(encoding="utf-8"))
    assert np.shape(chain["cam1"]["T_cn_cnm1"]) == (4, 4)
    lines = (DATA / "colmap" / "images.txt").read_text(encoding="utf-8").splitlines()
    _, *pose = next(line for line in lines if not line.startswith("#")).split()
    assert np.linalg.norm(np.array(pose[:4], dtype=float)) == pytest.approx(1, abs=1e-6)


def test_a_known_k_leaves_a_similarity_open():
    says("With K known, what is found is right up to a similarity transform.")
    K, R, t = np.diag([500.0, 500, 1]), Rotation.from_rotvec([0.1, 0.2, -0.1]).as_matrix(), np.array([0.5, 0, 1])
    moved = {"similarity": 3 * Rotation.from_rotvec([1, 0.3, -0.2]).as_matrix(), "shear": np.eye(3) + np.eye(3, k=1)}
    for name, matrix in moved.items():  # points X become matrix X, and K [R | t] the camera that sees them as before
        camera = K @ R @ np.linalg.inv(matrix)
        K_again = np.abs(rq(camera)[0])
        assert np.allclose(K_again / K_again[2, 2], K, atol=1e-6) == (name == "similarity")
        X = np.array([0.2, -0.4, 6])
        np.testing.assert_allclose(camera @ (matrix @ X) + K @ t, K @ (R @ X + t))


def test_the_stop_makes_a_lens_telecentric():
    """A thin lens of 50 mm: where the ray from a thing's top through the stop's middle lands on the sensor."""
    says(
        "With the entrance pupil there (the stop in the rear focal plane), a thing keeps its size when it comes nearer"
    )
    says("with the exit pupil there, its image does when the sensor moves")
    f, height = 50.0, 10.0

    def lands(stop, distance, sensor):  # the stop stands behind the lens, or before it where negative
        behind = height * (stop / f - 1) / (distance + stop - distance * stop / f)
        slope = behind if stop > 0 else -height / (distance + stop)
        on_lens = height + slope * distance
        return on_lens + (slope - on_lens / f) * sensor

    assert lands(f, 150, 70) == pytest.approx(lands(f, 200, 70))
    assert lands(-f, 150, 70) == pytest.approx(lands(-f, 150, 80))
    assert lands(10, 150, 70) != pytest.approx(lands(10, 200, 70), rel=0.1)


def test_meters_gamma_and_decibels():
    says("Which grey is the maker's choice, as a rule between 12 and 18 % of white.")
    assert 12 < 100 * 10 / 78 < 18  # ISO 12232: 10/78 of saturation, or number 118 of 255 in sRGB
    assert pytest.approx(18, abs=0.5) == 100 * ((118 / 255 + 0.055) / 1.055) ** 2.4
    says("The curve, near a power of 1/2.2, by which linear light is encoded for a screen")
    linear = np.linspace(0.02, 1, 200)
    np.testing.assert_allclose(1.055 * linear ** (1 / 2.4) - 0.055, linear ** (1 / 2.2), atol=0.02)  # IEC 61966-2-1
    says("in decibels 20 times its common logarithm", "six perspective pictures of 90° each, the faces of a cube")
    assert 20 * np.log10(2) == pytest.approx(6.02, abs=5e-3)
    assert np.degrees(2 * np.arctan(1)) == pytest.approx(90)


def test_a_part_of_a_charuco_board_names_its_corners():
    says("So every corner that is seen is known, even where a part of the board is hidden or outside the picture.")
    board = cv2.aruco.CharucoBoard((6, 5), 0.04, 0.03, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    right_half = board.generateImage((600, 500), marginSize=0)[:, 300:]
    uv, ids, *_ = cv2.aruco.CharucoDetector(board).detectBoard(right_half)
    assert len(ids) >= 4
    true = 100 * (1 + np.stack([ids.ravel() % 5, ids.ravel() // 5], axis=-1)) - [300, 0]  # 5 inner corners a row
    np.testing.assert_allclose(uv.reshape(-1, 2), true, atol=1.5)


def test_question_a_turning_camera_moves_the_picture_back():
    says("When a camera turns, the picture of a still world moves the other way.")
    cam_from_world = cv2.Rodrigues(np.array([0.0, np.radians(10), 0.0]))[0].T  # turned to its right
    assert (cam_from_world @ [0, 0, 3])[0] < 0
