"""What lesson 00 and the glossary say."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from camviz.cameras import Intrinsics
from camviz.colour import spaces
from camviz.scenes import to_linear
from camviz.views.frustum import FrustumView
from camviz_school.course.glossary import term
from camviz_school.views.exposure import ExposureView

EXCEPTIONS: dict[str, str] = {}

DATA = Path(__file__).parents[1] / "data"


def test_a_value_that_makes_no_sense_is_answered(says):
    (degrees,) = says("type 500 into *field of view*, read, and press **Reset**")
    with pytest.raises(ValueError, match="field of view"):
        FrustumView().but(hfov_deg=degrees.value).figure()


def test_the_picture_moves_against_a_turning_camera(says):
    says("When a camera turns, the picture of a still world moves the other way.")
    turn = cv2.Rodrigues(np.array([0.0, np.radians(10), 0.0]))[0].T  # cam_from_world of a camera turned to its right
    ahead = np.array([[0.0, 0.0, 3.0]])
    before, after = (
        cv2.projectPoints(ahead @ R.T, np.zeros(3), np.zeros(3), np.eye(3), None)[0] for R in (np.eye(3), turn)
    )
    assert after[0, 0, 0] < before[0, 0, 0]


def test_the_shapes_of_matrices(says):
    three, other, P_rows, P_columns = says(
        "Either the 3×3 matrix K of the intrinsics, as OpenCV and these lessons use the word, or the 3×4 matrix P that "
        "takes homogeneous world points all the way to homogeneous pixels."
    )
    K = Intrinsics(640, 480, 500, 500, 319.5, 239.5).K
    assert (three.value, other.value) == K.shape
    assert (P_rows.value, P_columns.value) == (K @ np.eye(3, 4)).shape
    rows, columns = says("The 3×3 matrix of the epipolar constraint between *normalised* coordinates")
    assert (rows.value, columns.value) == cv2.findEssentialMat(*_pair(), np.eye(3))[0].shape
    rows, columns = says("The 3×3 matrix of rank two, defined up to scale")
    F = cv2.findFundamentalMat(*_pair(), cv2.FM_8POINT)[0]
    assert (rows.value, columns.value) == F.shape
    assert np.linalg.matrix_rank(F / np.linalg.norm(F), tol=1e-9) == 2
    rows, columns = says("among which the 4×4 matrices made of a rotation and a translation are *rigid*")
    assert (rows.value, columns.value) == np.block([[np.eye(3), np.ones((3, 1))], [np.zeros(3), 1]]).shape
    rows, columns = says("The invertible 3×3 map, defined up to scale, between two images of a plane")
    assert (rows.value, columns.value) == cv2.findHomography(*_pair())[0].shape
    rows, columns = says("A 3×3 matrix that turns vectors and keeps their lengths and handedness.")
    assert (rows.value, columns.value) == cv2.Rodrigues(np.ones(3))[0].shape
    rows, columns = says("and then mixing them by a 3×3 matrix into a standard colour space")
    assert (rows.value, columns.value) == spaces.SRGB_FROM_XYZ.shape


def _pair():
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.uniform(-1, 1, (20, 2)), rng.uniform(2, 4, (20, 1))], axis=1)
    moved = points - [0.3, 0, 0.1]
    return points[:, :2] / points[:, 2:], moved[:, :2] / moved[:, 2:]


def test_angles_and_decibels(says):
    (degrees,) = says("six perspective pictures of 90° each, the faces of a cube around the camera")
    assert degrees == np.degrees(2 * np.arctan(1))
    (degrees,) = says(
        "so that directions at 90° from the axis, and with most of these projections beyond it, still have an image"
    )
    theta = np.radians(degrees.value)
    equidistant, equisolid, stereographic, orthographic = (
        theta,
        2 * np.sin(theta / 2),
        2 * np.tan(theta / 2),
        np.sin(theta),
    )
    assert np.isfinite([equidistant, equisolid, stereographic, orthographic]).all()
    beyond = theta + 0.1
    rising = [beyond > theta, 2 * np.sin(beyond / 2) > equisolid, 2 * np.tan(beyond / 2) > stereographic]
    assert all(rising)
    assert np.sin(beyond) < orthographic
    (twenty,) = says("in decibels 20 times its common logarithm")
    assert twenty.value * np.log10(10.0) == 20
    says("a last number of zero stands for a point at infinity")


def test_the_models_of_fisheyes_in_the_glossary_are_those_of_opencv_and_of_the_paper(says):
    says("the angle θ from the axis lands at a distance r from the middle that is a polynomial of odd powers of θ")
    k, point = np.array([0.1, -0.03, 0.02, -0.004]), np.array([0.4, -0.7, 0.9])
    assert "r = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)" in term("Kannala–Brandt").formula
    far = np.hypot(*point[:2])
    theta = np.arctan2(far, point[2])
    r = theta * (1 + k @ theta ** np.array([2, 4, 6, 8]))
    found = cv2.fisheye.projectPoints(point[None, None], np.zeros(3), np.zeros(3), np.eye(3), k)[0][0, 0]
    np.testing.assert_allclose(found, r * point[:2] / far, atol=1e-12)
    says("projects a point onto one unit sphere and from there onto a second one, whose centre lies ξ from the first's")
    formula = "(x, y) = f (X, Y) / (α D2 + (1 − α)(ξ D1 + Z)), D1 = |(X, Y, Z)|, D2 = |(X, Y, ξ D1 + Z)|"
    assert term("double sphere").formula == formula
    xi, alpha = -0.2, 0.6
    first = point / np.linalg.norm(point)  # on one sphere, then seen from ξ away
    second = (first + [0, 0, xi]) / np.linalg.norm(first + [0, 0, xi])
    shifted = second + [0, 0, alpha / (1 - alpha)]  # the pinhole behind the second one's centre
    by_spheres = shifted[:2] / shifted[2] / (1 - alpha)
    d1 = np.linalg.norm(point)
    d2 = np.hypot(far, xi * d1 + point[2])
    np.testing.assert_allclose(by_spheres, point[:2] / (alpha * d2 + (1 - alpha) * (xi * d1 + point[2])), atol=1e-12)


def test_a_hand_and_an_eye_need_two_turns_about_axes_that_are_not_parallel(says):
    """How many directions of R_X the equation R_A R_X = R_X R_B leaves free, for turns about parallel axes or not."""
    says("It takes at least two turns, about axes that are not parallel.")
    assert term("hand–eye calibration").formula == "A X = X B"
    X = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()

    def free(*axes):
        rows = []
        for axis in axes:
            A = Rotation.from_rotvec(axis).as_matrix()
            rows.append(np.kron(np.eye(3), A) - np.kron((X.T @ A @ X).T, np.eye(3)))
        return 9 - np.linalg.matrix_rank(np.vstack(rows), tol=1e-9)

    assert free([0, 0, 0.5], [0, 0, 0.9]) > 1
    assert free([0, 0, 0.5], [0.4, 0, 0]) == 1  # X alone, up to its scale


def test_mixtures_of_the_eye_s_curves_are_unmixed_by_one_matrix_whatever_the_spectrum(says):
    says("One matrix then turns its counts into tristimulus values exactly, whatever the spectrum.")
    rng = np.random.default_rng(1)
    eye, mixing, spectra = rng.uniform(0, 1, (81, 3)), rng.normal(size=(3, 3)), rng.uniform(0, 1, (500, 81))
    counts, wanted = spectra @ (eye @ mixing), spectra @ eye
    np.testing.assert_allclose(counts @ np.linalg.inv(mixing), wanted, rtol=1e-9)
    other = eye @ mixing + 0.1 * rng.uniform(0, 1, (81, 3))  # independent curves that are no such mixtures
    best = np.linalg.lstsq(spectra @ other, wanted, rcond=None)[0]
    assert np.abs(spectra @ other @ best / wanted - 1).max() > 1e-3


def test_dither_lets_means_tell_apart_what_is_finer_than_a_step(says):
    says("so that the mean of many samples tells apart what is finer than one step")
    noise = np.random.default_rng(2).normal(0, 0.5, 100_000)
    low, high = (np.rint(light + noise).mean() for light in (3.2, 3.4))
    assert high - low == pytest.approx(0.2, abs=0.01)
    assert np.rint(3.2) == np.rint(3.4)


def test_the_focal_length_in_k_is_the_distance_to_the_sensor(says):
    more, f, metres = says("the same when focused at infinity, and 5.3 % more for 50 mm focused at 1 m")
    sensor = 1 / (1 / f.value - 1 / (1000 * metres.value))  # 1/f = 1/u + 1/v
    assert more == 100 * (sensor / f.value - 1)


def test_in_which_form_files_give_rotations(says):
    rows, columns = says("while Kalibr writes 4×4 matrices and COLMAP quaternions.")
    chain = yaml.safe_load((DATA / "kalibr_chain.yaml").read_text(encoding="utf-8"))
    assert np.shape(chain["cam1"]["T_cn_cnm1"]) == (rows.value, columns.value)
    lines = (DATA / "colmap" / "images.txt").read_text(encoding="utf-8").splitlines()
    _, *pose = next(line for line in lines if not line.startswith("#")).split()
    assert np.linalg.norm(np.array(pose[:4], dtype=float)) == pytest.approx(1, abs=1e-6)  # and three of t follow


def test_the_two_telecentric_lenses(says):
    """A thin lens of 50 mm: which thing keeps its size, with the pupil of either side far away."""
    says(
        "With the entrance pupil there (the stop in the rear focal plane), a thing keeps its size when it comes nearer"
    )
    says("with the exit pupil there, its image does when the sensor moves")
    f, sensor, height = 50.0, 70.0, 10.0

    def lands(stop, distance, at):
        """Where the ray of the thing's top through the stop's middle lands; the stop stands behind the lens, or < 0."""
        if stop > 0:
            slope = height * (stop / f - 1) / (distance + stop - distance * stop / f)
        else:
            slope = -height / (distance + stop)
        on_lens = height + slope * distance
        return on_lens + (slope - on_lens / f) * at

    near, far = (lands(f, distance, sensor) for distance in (150.0, 200.0))
    assert near == pytest.approx(far)
    here, there = (lands(-f, 150.0, at) for at in (70.0, 80.0))
    assert here == pytest.approx(there)
    assert lands(10.0, 150.0, sensor) != pytest.approx(lands(10.0, 200.0, sensor), rel=0.1)  # an ordinary stop


def test_a_symmetric_lens_darkens_as_a_hole_does_and_another_one_by_its_pupils(says):
    """Two thin lenses about a stop: the ray through the stop's middle, and cos⁴ of the angle at which it lands."""
    says("The angle alone leaves cos⁴ θ behind a small hole, and behind a symmetric lens whose pupils have no")

    def left(front, back, apart, theta):
        within = np.tan(theta) / (1 - apart / front)  # the slope at the stop of a ray that came at θ
        return np.cos(np.arctan(within * (1 - apart / back))) ** 4

    theta = np.radians(40)
    assert left(60.0, 60.0, 15.0, theta) == pytest.approx(np.cos(theta) ** 4)
    assert left(-60.0, 30.0, 15.0, theta) > 1.5 * np.cos(theta) ** 4  # a retrofocus lens: its light lands less aslant


def test_twice_the_iso_needs_half_the_light(says):
    says("The number that says how bright a camera renders an exposure: twice the number needs half the light.")
    says("In most digital cameras it sets how much is amplified after the exposure, and gathers no light.")
    plain = ExposureView()
    fast = plain.but(iso=1.0, shutter=plain.shutter - 1)
    assert fast.recorded(draft=True).mean() == pytest.approx(plain.recorded(draft=True).mean(), rel=0.01)
    assert fast.electrons_of_white == pytest.approx(plain.electrons_of_white / 2)


def test_a_part_of_a_charuco_board_names_its_corners(says):
    says("So every corner that is seen is known, even where a part of the board is hidden or outside the picture.")
    codes = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard((6, 5), 0.04, 0.03, codes)
    picture = board.generateImage((600, 500), marginSize=0)[:, 300:]  # its right half
    uv, ids, *_ = cv2.aruco.CharucoDetector(board).detectBoard(picture)
    assert len(ids) >= 4
    truth = 100 * (1 + np.stack([ids.ravel() % 5, ids.ravel() // 5], axis=-1)) - [300, 0]  # 5 inner corners a row
    np.testing.assert_allclose(uv.reshape(-1, 2), truth, atol=1.5)


def test_which_grey_a_meter_makes_is_no_law(says):
    """Two ways of ISO 12232 to a camera's speed: 10/78 of saturation, and number 118 of 255 in sRGB."""
    low, high = says("Which grey is the maker's choice, as a rule between 12 and 18 % of white.")
    saturation_based, output = 100 * 10 / 78, 100 * float(to_linear(np.array(118 / 255)))
    assert low.value < saturation_based < high.value
    assert high == output


def test_gamma_is_near_a_power_of_1_over_2_2(says):
    (power,) = says("The curve, near a power of 1/2.2, by which linear light is encoded for a screen")
    linear = np.linspace(0.02, 1, 200)
    encoded = 1.055 * linear ** (1 / 2.4) - 0.055  # IEC 61966-2-1
    np.testing.assert_allclose(encoded, linear ** (1 / power.value), atol=0.02)


def test_one_fisheye_sees_the_whole_horizon_from_180_degrees_on(says):
    (degrees,) = says("or by a single fisheye of more than 180° that looks straight up or down")
    half = np.radians(degrees.value / 2)
    horizon = np.stack([np.cos(np.linspace(0, 6, 12)), np.sin(np.linspace(0, 6, 12)), np.zeros(12)], axis=-1)
    from_the_axis = np.arccos(horizon @ [0, 0, 1])
    assert (from_the_axis <= half + 1e-12).all()
    assert (from_the_axis > half - np.radians(1)).all()
