"""The rotation view writes one rotation in every way, and its rings lock where two axes fall into one line."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz.views.frustum import FrustumView
from camviz_school.views.rotation import RotationView

ANGLES = [(0.0, 0.0, 0.0), (30.0, 20.0, 10.0), (-170.0, 65.0, 120.0), (20.0, 90.0, -35.0), (180.0, -90.0, -180.0)]


@pytest.mark.parametrize("angles", ANGLES)
def test_vector_and_quaternion_are_the_matrix(angles):
    numbers = RotationView(*angles).numbers()
    world_from_cam = numbers["R"].T
    np.testing.assert_allclose(cv2.Rodrigues(numbers["rotation_vector"])[0], world_from_cam, atol=1e-12)
    x, y, z, w = numbers["quaternion"]
    by_hand = [  # Hamilton's product, Szeliski 2022, eq. 2.41
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    np.testing.assert_allclose(by_hand, world_from_cam, atol=1e-12)
    yaw, pitch, roll = angles
    other = FrustumView(yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    np.testing.assert_allclose(other.numbers()["R"], numbers["R"], atol=1e-12)


def test_a_ring_holds_its_axis_and_the_next_one():
    """The outer ring's plane is spanned by the axes of yaw and pitch, the middle one's by those of pitch and roll."""
    view = RotationView(30.0, 20.0, 10.0)
    outer, middle, _ = view.rings
    np.testing.assert_allclose(view.axes[:2] @ outer.as_matrix()[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose(view.axes[1:] @ middle.as_matrix()[:, 1], 0, atol=1e-12)
    for turn in range(3):  # a thousandth of a degree more turns the camera by just that about the axis of its ring
        angles = [30.0, 20.0, 10.0]
        angles[turn] += 1e-3
        turned = (RotationView(*angles).rotation * view.rotation.inv()).as_rotvec(degrees=True)
        np.testing.assert_allclose(turned, 1e-3 * view.axes[turn], atol=1e-12)


@pytest.mark.parametrize(("pitch", "apart"), [(0.0, 90.0), (60.0, 30.0), (-89.0, 1.0), (90.0, 0.0), (-90.0, 0.0)])
def test_yaw_and_roll_lie_90_degrees_minus_pitch_apart(pitch, apart):
    """In line they lock, which is written in red; then yaw undoes roll."""
    view = RotationView(25.0, pitch, -70.0, panels="rings")
    assert view.numbers()["lock_deg"] == pytest.approx(apart, abs=1e-9)
    assert view.locked == (apart == 0)
    assert ("gimbal lock" in written(view.figure(draft=True))) == ("gimbal lock" in view.description())
    straight = RotationView(0.0, pitch, 0.0).rotation
    undone = (RotationView(40.0, pitch, 40.0 * np.sign(pitch)).rotation.inv() * straight).magnitude()
    assert (undone < 1e-9) == view.locked
