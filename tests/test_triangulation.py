"""Points from their images: as projection, OpenCV and Hartley and Sturm have them, or nowhere."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation
from two_views import LEFT_PIXELS, Equidistant, rigs, seen, stereo

from camviz import twoview as tv
from camviz.cameras import Camera, look_at
from camviz.lenses.base import unit


@given(rigs, st.integers(0, 2**32))
@settings(max_examples=30, deadline=None)
def test_triangulation_undoes_projection(rig, seed):
    points, *uvs = seen(*rig, seed)
    assert tv.triangulate(rig, uvs) == pytest.approx(points, abs=1e-9)
    assert tv.triangulate_linear(rig, uvs) == pytest.approx(points, abs=1e-8)
    assert tv.refine_points(rig, uvs, points + 0.05) == pytest.approx(points, abs=1e-8)


def test_triangulation_works_through_a_fisheye_behind_the_image_plane_and_from_three_views():
    rig = stereo(Equidistant())
    third = rig[0].at(RigidTransform.from_components([2, -2, 3], Rotation.identity()))
    cameras = [*rig, third]
    points = rig[0].centre + 3 * unit(np.random.default_rng(13).normal(size=(4, 5, 3)))
    uvs = np.stack([camera.project(points) for camera in cameras])
    assert tv.triangulate(cameras, uvs).shape == (4, 5, 3)
    assert tv.triangulate(cameras, uvs) == pytest.approx(points, abs=1e-9)
    assert tv.refine_points(cameras, uvs, points + 0.02) == pytest.approx(points, abs=1e-7)


def test_linear_triangulation_is_opencvs_with_noise():
    rig = stereo()
    _, *uvs = seen(*rig)
    uvs = np.stack(uvs) + np.random.default_rng(14).normal(0, 1, (2, 50, 2))
    theirs = cv2.triangulatePoints(*(tv.projection_matrix(camera) for camera in rig), *(uv.T for uv in uvs))
    assert tv.triangulate_linear(rig, uvs) == pytest.approx((theirs[:3] / theirs[3]).T, rel=1e-6)


def test_refined_points_are_the_optimum_of_hartley_and_sturm():
    rig = stereo()
    _, *uvs = seen(*rig)
    uvs = np.stack(uvs) + np.random.default_rng(15).normal(0, 1, (2, 50, 2))
    corrected = cv2.correctMatches(tv.fundamental(*rig), uvs[0][None], uvs[1][None])
    optimum = cv2.triangulatePoints(*(tv.projection_matrix(camera) for camera in rig), *(uv[0].T for uv in corrected))
    refined = tv.refine_points(rig, uvs, tv.triangulate(rig, uvs))
    assert refined == pytest.approx((optimum[:3] / optimum[3]).T, rel=1e-5)


def test_the_midpoint_is_halfway_between_two_skew_rays():
    left = Camera(LEFT_PIXELS)
    right = Camera(LEFT_PIXELS, world_from_cam=look_at([1, 0, 0], [0, 0, 5]))
    uv_left = left.project([0, 0, 5])
    uv_right = right.project([0, 0.1, 5])
    middle = tv.triangulate([left, right], [uv_left, uv_right])
    ray = right.unproject(uv_right)
    to_left = middle - middle @ [0, 0, 1] * np.array([0, 0, 1])
    to_right = (middle - right.centre) - (middle - right.centre) @ ray * ray
    assert to_left == pytest.approx(-to_right, abs=1e-12)
    assert np.linalg.norm(to_left) == pytest.approx(0.05, rel=0.01)


@pytest.mark.parametrize("method", [tv.triangulate, tv.triangulate_linear])
def test_parallel_diverging_and_missing_rays_meet_nowhere(method):
    left = Camera(LEFT_PIXELS)
    right = left.at(RigidTransform.from_translation([0.2, 0, 0]))
    good = [300, 200]
    uvs = [[good, good, good, [np.nan] * 2], [[250, 200], good, [350, 200], good]]
    points = method([left, right], uvs)
    assert np.isfinite(points).all(axis=-1).tolist() == [True, False, False, False]


def test_rays_that_are_parallel_but_for_rounding_meet_nowhere():
    left, right = stereo()
    stars = unit(left.unproject([320, 240]) + np.random.default_rng(16).uniform(-0.1, 0.1, (200, 3)))
    uvs = [camera.project(camera.centre + stars) for camera in (left, right)]
    nearest_credible = 0.1 / 1e-12  # metres: baseline over the parallax that rounding leaves
    for points in (tv.triangulate([left, right], uvs), tv.triangulate_linear([left, right], uvs)):
        distance = np.linalg.norm(points, axis=-1)
        assert np.isnan(distance).mean() > 0.9
        assert (distance[np.isfinite(distance)] > nearest_credible).all()


def test_a_point_in_front_of_one_camera_and_behind_the_other_is_no_point():
    left, point = Camera(LEFT_PIXELS), np.array([0.1, 0.2, 4])
    centre = np.array([1.0, 0, 1])
    right = left.at(look_at(centre, 2 * centre - point))  # its back to the point, on the line through it
    uvs = [left.project(point), right.project(2 * centre - point)]
    assert np.isnan(tv.triangulate([left, right], uvs)).all()
    assert np.isnan(tv.triangulate_linear([left, right], uvs)).all()


@pytest.mark.parametrize("lens", [None, Equidistant()])
def test_ray_distances_are_the_distances_to_the_point(lens):
    left, right = stereo(lens)
    points, uv_left, uv_right = seen(left, right)
    rays = [c.lens.unproject(c.intrinsics.from_pixels(uv)) for c, uv in ((left, uv_left), (right, uv_right))]
    distances = np.stack([np.linalg.norm(points - camera.centre, axis=-1) for camera in (left, right)], axis=-1)
    motion = tv.right_from_left(left, right)
    assert tv.ray_distances(motion, *rays) == pytest.approx(distances, rel=1e-9)
    assert tv.ray_distances(motion, -rays[0], rays[1]) == pytest.approx(distances * [-1, 1], rel=1e-9)


def test_triangulation_says_what_it_takes():
    left, right = stereo()
    with pytest.raises(ValueError, match="at least 2 cameras, got 1"):
        tv.triangulate([left], [[1, 2]])
    with pytest.raises(ValueError, match="for each of 2 cameras"):
        tv.triangulate([left, right], np.zeros((3, 2)))
    with pytest.raises(ValueError, match="Perspective"):
        tv.triangulate_linear(stereo(Equidistant()), np.zeros((2, 2)))


def test_refinement_that_does_not_settle_is_nan():
    rig = stereo()
    points, *uvs = seen(*rig)
    behind = 2 * rig[0].centre - points
    assert np.isnan(tv.refine_points(rig, uvs, behind)).all()
