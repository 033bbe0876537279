"""Facts about two views of one world, against OpenCV and against projection itself."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform
from two_views import LEFT_PIXELS, Equidistant, rigs, seen, stereo

from camviz import twoview as tv
from camviz.cameras import Camera
from camviz.lenses.base import unit


@given(rigs, st.integers(0, 2**32))
@settings(max_examples=50, deadline=None)
def test_images_of_one_point_satisfy_the_epipolar_constraint(rig, seed):
    _, uv_left, uv_right = seen(*rig, seed)
    F = tv.fundamental(*rig)
    assert tv.line_distance(tv.epipolar_lines(F, uv_left), uv_right).max() < 1e-9
    assert tv.symmetric_distance(F, uv_left, uv_right).max() < 1e-9
    assert tv.sampson_distance(F, uv_left, uv_right).max() < 1e-9


@given(rigs)
@settings(max_examples=50, deadline=None)
def test_the_epipole_is_the_image_of_the_other_camera(rig):
    # A perspective camera has no image of what stands behind it, but the epipole is there: K R (C' - C), either sign.
    left, right = rig
    e_left, e_right = tv.epipoles(tv.fundamental(left, right))
    for camera, other, e in ((left, right, e_left), (right, left, e_right)):
        image = tv.projection_matrix(camera) @ [*other.centre, 1]
        assert np.linalg.norm(np.cross(unit(image), e)) < 1e-12


def test_the_epipole_in_the_picture_is_where_the_other_camera_is_seen():
    left, right = stereo(baseline=(0.1, 0.05, 1.0))
    e_left, _ = tv.epipoles(tv.fundamental(left, right))
    assert tv.from_homogeneous(e_left) == pytest.approx(left.project(right.centre), abs=1e-9)


def test_sideways_motion_puts_both_epipoles_at_infinity_along_the_rows():
    left = Camera(LEFT_PIXELS)
    right = Camera(LEFT_PIXELS, world_from_cam=RigidTransform.from_translation([0.1, 0, 0]))
    for e in tv.epipoles(tv.fundamental(left, right)):
        assert np.abs(e) == pytest.approx([1, 0, 0], abs=1e-15)
        assert np.isnan(tv.from_homogeneous(e)).all()


@given(rigs)
@settings(max_examples=30, deadline=None)
def test_every_epipolar_line_passes_through_the_epipole(rig):
    F = tv.fundamental(*rig)
    lines = tv.epipolar_lines(F, [[[0, 0], [639, 0]], [[100, 300], [639, 479]]])
    assert lines.shape == (2, 2, 3)
    assert np.linalg.norm(lines[..., :2], axis=-1) == pytest.approx(1)
    assert np.abs(unit(lines) @ tv.epipoles(F)[1]).max() < 1e-9


def test_opencv_draws_the_same_epipolar_lines_in_both_images():
    left, right = stereo()
    F = tv.fundamental(left, right)
    _, uv_left, uv_right = seen(left, right)
    for which, lines, uv in (
        (1, tv.epipolar_lines(F, uv_left), uv_left),
        (2, tv.epipolar_lines(F.T, uv_right), uv_right),
    ):
        theirs = cv2.computeCorrespondEpilines(uv, which, F).reshape(-1, 3)
        assert lines == pytest.approx(theirs, abs=1e-9)


def test_a_matrix_of_rank_one_has_no_epipole():
    with pytest.raises(ValueError, match="rank 2"):
        tv.epipoles(np.outer([1, 2, 3], [3, 2, 1]))


def test_the_epipole_itself_has_no_line():
    F = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 0]])  # both epipoles at pixel (0, 0)
    assert np.isnan(tv.epipolar_lines(F, [0, 0])).all()


def test_essential_and_fundamental_matrix_tell_the_same_story():
    left, right = stereo()
    E = tv.essential(tv.right_from_left(left, right))
    E_from_F = tv.essential_from_fundamental(tv.fundamental(left, right), left.intrinsics, right.intrinsics)
    assert E_from_F == pytest.approx(E, abs=1e-12)
    baseline = np.linalg.norm(right.centre - left.centre)
    assert np.linalg.svd(E)[1] == pytest.approx([baseline, baseline, 0], abs=1e-12)


def test_cross_matrix_is_the_cross_product():
    v, w = np.random.default_rng(1).normal(size=(2, 4, 5, 3))
    assert (tv.cross_matrix(v) @ w[..., None])[..., 0] == pytest.approx(np.cross(v, w), abs=1e-15)


def test_two_cameras_in_one_place_have_no_epipolar_geometry():
    left, _ = stereo()
    with pytest.raises(ValueError, match="same place"):
        tv.fundamental(left, left)
    with pytest.raises(ValueError, match="same place"):
        tv.triangulate([left, left], np.zeros((2, 2)))


def test_a_fisheye_has_no_fundamental_matrix():
    with pytest.raises(ValueError, match="Equidistant"):
        tv.fundamental(*stereo(Equidistant()))


def test_a_perspective_ray_is_seen_as_its_epipolar_line_and_a_fisheyes_is_not():
    distances = np.geomspace(0.5, 100, 40)
    uv = [[200, 150], [400, 300]]
    left, right = stereo()
    curve = tv.epipolar_curve(left, right, uv, distances)
    assert curve.shape == (2, 40, 2)
    lines = tv.epipolar_lines(tv.fundamental(left, right), uv)
    assert tv.line_distance(lines[:, None], curve).max() < 1e-9
    curve = tv.epipolar_curve(*stereo(Equidistant()), uv[0], distances)
    _, singular, _ = np.linalg.svd(curve - curve.mean(axis=0))
    assert singular[1] > 1  # pixels: it bends


@pytest.mark.parametrize("lens", [None, Equidistant()])
def test_an_epipolar_curve_passes_through_the_image_of_its_point_and_ends_at_the_vanishing_point(lens):
    left, right = stereo(lens)
    points, uv_left, uv_right = seen(left, right)
    distance = np.linalg.norm(points[0] - left.centre)
    curve = tv.epipolar_curve(left, right, uv_left[0], [distance, 1e9, np.inf])
    assert curve[0] == pytest.approx(uv_right[0], abs=1e-9)
    assert curve[1] == pytest.approx(curve[2], abs=1e-5)


@given(st.floats(-np.pi, np.pi), st.floats(-500, 900))
@settings(max_examples=200, deadline=None)
def test_a_clipped_line_ends_on_the_border_and_one_that_misses_is_nan(angle, offset):
    line = np.array([np.cos(angle), np.sin(angle), -offset])
    ends = tv.clip_lines(line, LEFT_PIXELS)
    corners = tv.to_homogeneous([[-0.5, -0.5], [639.5, -0.5], [639.5, 479.5], [-0.5, 479.5]]) @ line
    assert np.isnan(ends).all() == (corners.min() > 0 or corners.max() < 0)
    if np.isfinite(ends).all():
        assert tv.line_distance(line, ends).max() < 1e-9
        from_border = np.abs(ends[:, :, None] - [[-0.5, 639.5], [-0.5, 479.5]]).min(axis=(1, 2))
        assert from_border.max() < 1e-9
        assert ((ends > -0.5 - 1e-9) & (ends < np.array([639.5, 479.5]) + 1e-9)).all()


def test_clipping_keeps_rows_columns_and_the_border_itself():
    lines = [[0, 1, -10], [1, 0, -20], [0, 1, 0.5], [0, 1, 0.6], [0, 2, -20]]
    ends = tv.clip_lines(lines, LEFT_PIXELS)
    assert np.sort(ends[0], axis=0).tolist() == [[-0.5, 10], [639.5, 10]]
    assert np.sort(ends[1], axis=0).tolist() == [[20, -0.5], [20, 479.5]]
    assert np.sort(ends[2], axis=0).tolist() == [[-0.5, -0.5], [639.5, -0.5]]
    assert np.isnan(ends[3]).all()
    assert np.sort(ends[4], axis=0).tolist() == [[-0.5, 10], [639.5, 10]]
    assert np.isnan(tv.clip_lines(np.full(3, np.nan), LEFT_PIXELS)).all()


def test_an_epipole_has_no_line_and_the_two_epipoles_are_a_pair():
    """The epipoles are where each camera sees the other's centre: F sends them to 0, up to its rounding."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        left, right = stereo(baseline=(*rng.uniform(-0.3, 0.3, 2), 0.9), turn=rng.uniform(-0.1, 0.1, 3))
        F = tv.fundamental(left, right)
        in_left, in_right = left.project(right.centre), np.linalg.svd(F)[0][:, -1]
        in_right = in_right[:2] / in_right[2]
        by_svd = np.linalg.svd(F)[2][-1]
        assert np.isnan(tv.epipolar_lines(F, [in_left, by_svd[:2] / by_svd[2]])).all()
        assert np.isfinite(tv.epipolar_lines(F, in_left + [1e-6, 0])).all()
        assert tv.sampson_distance(F, in_left, in_right) == 0
        assert tv.sampson_distance(F, in_left + [30, 0], in_right) < 1e-9  # its line goes through the other epipole
        assert tv.sampson_distance(F, in_left + [30, 0], in_right + [7, 90]) > 1e-3


def test_sampson_distance_squared_is_opencvs():
    left, right = stereo()
    _, uv_left, uv_right = seen(left, right)
    uv_right = uv_right + np.random.default_rng(3).normal(size=uv_right.shape)
    F = tv.fundamental(left, right)
    theirs = [
        cv2.sampsonDistance(a, b, F)
        for a, b in zip(tv.to_homogeneous(uv_left), tv.to_homogeneous(uv_right), strict=True)
    ]
    assert tv.sampson_distance(F, uv_left, uv_right) ** 2 == pytest.approx(np.array(theirs), rel=1e-9)


def test_symmetric_distance_is_that_from_opencvs_lines_in_both_images():
    left, right = stereo()
    _, uv_left, uv_right = seen(left, right)
    uv_right = uv_right + np.random.default_rng(18).normal(size=uv_right.shape)
    F = tv.fundamental(left, right)
    squares = 0
    for which, uv, other in ((1, uv_left, uv_right), (2, uv_right, uv_left)):
        lines = cv2.computeCorrespondEpilines(uv, which, F).reshape(-1, 3)
        squares = squares + np.sum(lines * tv.to_homogeneous(other), axis=1) ** 2
    assert tv.symmetric_distance(F, uv_left, uv_right) == pytest.approx(np.sqrt(squares), abs=1e-9)


def test_sampson_distance_is_the_correction_that_opencv_finds_to_first_order():
    left, right = stereo()
    _, uv_left, uv_right = seen(left, right)
    rng = np.random.default_rng(4)
    uv_left, uv_right = uv_left + rng.normal(0, 0.1, uv_left.shape), uv_right + rng.normal(0, 0.1, uv_right.shape)
    F = tv.fundamental(left, right)
    moved_left, moved_right = cv2.correctMatches(F, uv_left[None], uv_right[None])
    moved = np.linalg.norm(np.concatenate([moved_left[0] - uv_left, moved_right[0] - uv_right], axis=1), axis=1)
    assert tv.sampson_distance(F, uv_left, uv_right) == pytest.approx(moved, rel=2e-3)
