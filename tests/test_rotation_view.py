"""The rotation view writes one rotation in every way, and its rings lock where two axes fall into one line."""

import cv2
import numpy as np
import pytest

from camviz.views.frustum import FrustumView
from camviz_school.views.rotation import RotationView

ANGLES = [(0.0, 0.0, 0.0), (30.0, 20.0, 10.0), (-170.0, 65.0, 120.0), (20.0, 90.0, -35.0), (180.0, -90.0, -180.0)]


@pytest.mark.parametrize("angles", ANGLES)
def test_rotation_vector_and_quaternion_are_the_matrix_by_opencv_and_by_hand(angles):
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


def test_the_angles_are_those_of_the_frustum_view():
    yaw, pitch, roll = 30.0, 20.0, 10.0
    other = FrustumView(yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    np.testing.assert_allclose(RotationView(yaw, pitch, roll).numbers()["R"], other.numbers()["R"], atol=1e-12)


@pytest.mark.parametrize("turn", range(3))
def test_each_angle_turns_the_camera_about_the_axis_drawn_for_it(turn):
    """A thousandth of a degree more of one angle turns the camera by just that about the axis of its ring."""
    angles = [30.0, 20.0, 10.0]
    before = RotationView(*angles)
    angles[turn] += 1e-3
    turned = (RotationView(*angles).rotation * before.rotation.inv()).as_rotvec(degrees=True)
    np.testing.assert_allclose(turned, 1e-3 * before.axes[turn], atol=1e-12)


def test_a_ring_holds_the_axis_it_turns_about_and_the_axis_of_the_next():
    """The outer ring's plane is spanned by the axes of yaw and pitch, the middle one's by those of pitch and roll."""
    view = RotationView(30.0, 20.0, 10.0)
    outer, middle, _ = view.rings
    np.testing.assert_allclose(view.axes[:2] @ outer.as_matrix()[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose(view.axes[1:] @ middle.as_matrix()[:, 1], 0, atol=1e-12)


@pytest.mark.parametrize(("pitch", "apart"), [(0.0, 90.0), (60.0, 30.0), (-89.0, 1.0), (90.0, 0.0), (-90.0, 0.0)])
def test_yaw_and_roll_lie_90_degrees_minus_pitch_apart(pitch, apart):
    view = RotationView(25.0, pitch, -70.0)
    assert view.numbers()["lock_deg"] == pytest.approx(apart, abs=1e-9)
    assert ("gimbal lock" in view.description()) == ("gimbal lock" in view.figure().svg().split("<text", 1)[1])
    assert view.locked == (apart == 0)


def test_at_lock_yaw_undoes_roll():
    straight = RotationView(0.0, 90.0, 0.0).rotation
    assert (RotationView(40.0, 90.0, 40.0).rotation.inv() * straight).magnitude() == pytest.approx(0, abs=1e-12)
    assert (RotationView(40.0, 60.0, 40.0).rotation.inv() * straight).magnitude() > 0.1


@pytest.mark.parametrize("name", RotationView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = RotationView.controls()[name]
    pictures = {RotationView().but(**{name: end}).figure(draft=True).svg() for end in (control.low, 7, control.high)}
    assert len(pictures) == 3


def test_dragging_and_arrow_keys_walk_around():
    view = RotationView()
    assert view.dragged("eye", 0, 0, 50, 0).eye.yaw_deg == pytest.approx(view.eye.yaw_deg + 20)
    assert view.pressed("eye", "ArrowUp").eye.pitch_deg != view.eye.pitch_deg


def test_the_rings_come_alone_and_the_numbers_are_opened_beside_them():
    alone = RotationView(panels="rings")
    assert [tile.name for tile in alone.figure(draft=True).tiles] == ["rings"]
    assert [tile.name for tile in alone.with_panels({"numbers": True}).figure(draft=True).tiles] == ["rings", "numbers"]
    assert "gimbal lock" in alone.but(pitch_deg=90.0).figure(draft=True).body
    assert "gimbal lock" not in alone.figure(draft=True).body
    with pytest.raises(ValueError, match="panels must be one of"):
        RotationView(panels="numbers")
