"""What lesson 00 and the glossary say."""

import cv2
import numpy as np
import pytest

from camviz.cameras import Intrinsics
from camviz.colour import spaces
from camviz.scenes import to_linear
from camviz.views.frustum import FrustumView

EXCEPTIONS: dict[str, str] = {}


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
