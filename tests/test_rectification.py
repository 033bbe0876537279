"""Rectified pairs: points share a row, and their disparity is their depth."""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform
from two_views import Equidistant, rigs, seen, stereo

from camviz import twoview as tv
from camviz.cameras import Camera, Intrinsics


@given(rigs, st.integers(0, 2**32), st.booleans())
@settings(max_examples=50, deadline=None)
def test_rectified_points_share_a_row_and_their_disparity_is_their_depth(rig, seed, fisheye):
    left, right = (Camera(c.intrinsics, Equidistant(), c.world_from_cam) for c in rig) if fisheye else rig
    points, _, _ = seen(left, right, seed)
    pair = tv.rectify(left, right)
    uv_left, uv_right = pair.left.project(points), pair.right.project(points)
    assert uv_left[:, 1] == pytest.approx(uv_right[:, 1], abs=1e-9)
    Z = pair.left.world_from_cam.inv().apply(points)[:, 2]
    assert pair.depth(uv_left[:, 0] - uv_right[:, 0]) == pytest.approx(Z, rel=1e-9)


@given(rigs)
@settings(max_examples=30, deadline=None)
def test_opencv_turns_the_cameras_the_same_way(rig):
    left, right = rig
    motion = tv.right_from_left(left, right)
    assume(motion.rotation.magnitude() > 1e-4)  # OpenCV takes a turn below 1e-5 for none
    size = (640, 480)
    R_left, R_right, *_ = cv2.stereoRectify(
        left.intrinsics.K,
        None,
        right.intrinsics.K,
        None,
        size,
        motion.rotation.as_matrix(),
        motion.translation[:, None],
    )
    pair = tv.rectify(left, right)
    for original, rectified, R in ((left, pair.left, R_left), (right, pair.right, R_right)):
        ours = (rectified.cam_from_world * original.world_from_cam).rotation.as_matrix()
        assert ours == pytest.approx(R, abs=1e-9)
        assert rectified.centre == pytest.approx(original.centre, abs=1e-12)


def test_a_rectified_pair_has_its_epipolar_lines_along_the_rows():
    pair = tv.rectify(*stereo())
    lines = tv.epipolar_lines(tv.fundamental(pair.left, pair.right), [[10, 20], [300, 400.5]])
    assert np.abs(lines[:, 0]).max() < 1e-12
    assert -lines[:, 2] / lines[:, 1] == pytest.approx([20, 400.5])


@pytest.mark.parametrize("lens", [None, Equidistant()])
def test_the_maps_lead_from_a_rectified_pixel_to_the_original_of_the_same_point(lens):
    left, right = stereo(lens)
    pair = tv.rectify(left, right)
    for rectified, original, uv_map in zip((pair.left, pair.right), (left, right), pair.maps(), strict=True):
        assert uv_map.shape == (480, 640, 2)
        point = rectified.centre + 3 * rectified.unproject([123, 45])
        assert uv_map[45, 123] == pytest.approx(original.project(point), abs=1e-9)


def test_the_maps_are_opencvs():
    left, _ = stereo()
    pair = tv.rectify(*stereo())
    R = (pair.left.cam_from_world * left.world_from_cam).rotation.as_matrix()
    K = left.intrinsics.K * [[1, 0, 1], [1, 1, 1], [1, 1, 1]]  # initUndistortRectifyMap ignores skew
    left = Camera(Intrinsics.from_matrix(K, 640, 480), world_from_cam=left.world_from_cam)
    pair = tv.RectifiedPair(pair.left, pair.right, left, pair.right_original)
    theirs = cv2.initUndistortRectifyMap(K, None, R, pair.left.intrinsics.K, (640, 480), cv2.CV_32FC1)
    np.testing.assert_allclose(pair.maps()[0], np.stack(theirs, axis=-1), rtol=0, atol=1e-3)


def test_rectified_pictures_look_where_the_originals_look():
    left, right = stereo()
    pair = tv.rectify(left, right)
    axes = [rect.project(c.centre + rotated_axis(c)) for rect, c in ((pair.left, left), (pair.right, right))]
    assert np.mean(axes, axis=0) == pytest.approx([319.5, 239.5])
    other = Intrinsics.from_fov(320, 200, 100)
    assert tv.rectify(left, right, other).left.intrinsics == other


def rotated_axis(camera):
    return camera.world_from_cam.rotation.apply([0, 0, 1])


def test_an_ideal_pair_is_already_rectified():
    left = Camera(Intrinsics.from_fov(640, 480, 70))
    right = left.at(RigidTransform.from_translation([0.1, 0, 0]))
    pair = tv.rectify(left, right)
    assert pair.left.world_from_cam.as_matrix() == pytest.approx(np.eye(4), abs=1e-15)
    assert pair.left.intrinsics == left.intrinsics
    np.testing.assert_allclose(pair.maps()[1], left.intrinsics.grid(), rtol=0, atol=1e-9)


def test_what_cannot_be_rectified_is_refused():
    left, right = stereo()
    with pytest.raises(ValueError, match=r"to the right of the left one, it stands .* m to the left: exchange"):
        tv.rectify(right, left)
    with pytest.raises(ValueError, match="it stands in the same place: they see no depth"):
        tv.rectify(left, left)
    for step, told in (((0, 0, 0.5), "0.5 m in front"), ((0, 0, -2), "2 m behind"), ((0, 0.1, 0), "0.1 m below")):
        with pytest.raises(ValueError, match=f"it stands {told}: "):
            tv.rectify(*stereo(baseline=step, turn=(0, 0, 0)))
    with pytest.raises(ValueError, match="along their baseline"):
        tv.rectify(*stereo(baseline=(np.sin(-0.19), 0, np.cos(-0.19)), turn=(0, -0.4, 0)))


def test_half_a_pixel_costs_6_mm_at_1_m_and_63_cm_at_10_m():
    near, far = tv.depth_interval([1.0, 10.0], 800, 0.1)
    assert (far - near) / 2 == pytest.approx([0.00625, 0.627], rel=1e-3)
    assert tv.depth_error([1.0, 10.0], 800, 0.1) == pytest.approx([0.00625, 0.625])


def test_depth_of_a_published_pair_and_of_infinity():
    # Middlebury "Motorcycle" at full size: f = 994.978 px, B = 193.001 mm, doffs = 31.086 px
    Z = tv.depth_from_disparity(50.0, 994.978, 0.193001, doffs=31.086)
    assert pytest.approx(2.36824, abs=1e-5) == Z
    assert tv.disparity_from_depth(Z, 994.978, 0.193001, doffs=31.086) == pytest.approx(50)
    assert tv.depth_from_disparity(0.0, 800, 0.1) == np.inf
    assert np.isnan(tv.depth_from_disparity([-1.0, np.nan], 800, 0.1)).all()
    assert np.isnan(tv.disparity_from_depth([0.0, -1.0], 800, 0.1)).all()
    assert tv.disparity_from_depth(np.inf, 800, 0.1) == 0
    assert tv.depth_interval(200.0, 800, 0.1)[1] == np.inf
