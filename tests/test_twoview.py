"""Facts about two views of one world, against OpenCV and against projection itself."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview as tv
from camviz.cameras import Camera, Intrinsics, look_at
from camviz.lenses.base import unit

LEFT_PIXELS = Intrinsics(640, 480, 520.0, 540.0, 300.0, 250.0, skew=1.5)
RIGHT_PIXELS = Intrinsics(800, 600, 610.0, 600.0, 410.0, 290.0)


@dataclass(frozen=True)
class Equidistant:
    """r = θ: enough of a fisheye to hold what is said of any lens."""

    def project(self, points_cam):
        x, y, z = np.moveaxis(np.asarray(points_cam, dtype=float), -1, 0)
        r = np.hypot(x, y)
        scale = np.where(r > 0, np.arctan2(r, z) / np.where(r > 0, r, 1), 1 / z)
        return np.stack([x * scale, y * scale], axis=-1)

    def unproject(self, xy):
        theta = np.linalg.norm(xy, axis=-1, keepdims=True)
        return np.concatenate([xy * np.sinc(theta / np.pi), np.cos(theta)], axis=-1)


def stereo(lens=None, baseline=(0.5, 0.05, -0.08), turn=(0.03, -0.12, 0.05)):
    """A generic rig: other intrinsics on either side, a little verged, standing askew in the world."""
    world_from_left = RigidTransform.from_components([2, -1, 3], Rotation.from_rotvec([0.2, -0.4, 0.1]))
    left_from_right = RigidTransform.from_components(baseline, Rotation.from_rotvec(turn))
    lens = {} if lens is None else {"lens": lens}
    left = Camera(LEFT_PIXELS, world_from_cam=world_from_left, **lens)
    return left, Camera(RIGHT_PIXELS, world_from_cam=world_from_left * left_from_right, **lens)


def points_before(camera, rng, n=50, near=2.0, far=8.0):
    """World points (n, 3) spread over the middle of a camera's picture and over depths."""
    size = np.array([camera.intrinsics.width, camera.intrinsics.height])
    uv = size * rng.uniform(0.25, 0.75, (n, 2))
    return camera.centre + rng.uniform(near, far, (n, 1)) * camera.unproject(uv)


def seen(left, right, seed=0, n=50):
    points = points_before(left, np.random.default_rng(seed), n)
    return points, left.project(points), right.project(points)


def same_up_to_scale(A, B, tolerance):
    A, B = A / np.linalg.norm(A), B / np.linalg.norm(B)
    return min(np.abs(A - B).max(), np.abs(A + B).max()) < tolerance


def small(limit):
    return st.tuples(*[st.floats(-limit, limit)] * 3)


rigs = st.builds(
    lambda side, turn: stereo(baseline=(0.4 + abs(side[0]), side[1], side[2]), turn=turn), small(0.2), small(0.15)
)


# ---- Epipolar geometry


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


# ---- Estimating F and E


@given(rigs, st.integers(0, 2**32))
@settings(max_examples=30, deadline=None)
def test_eight_exact_pairs_give_back_the_fundamental_matrix(rig, seed):
    left, right = rig
    _, uv_left, uv_right = seen(left, right, seed, n=30)
    F = tv.eight_point(uv_left, uv_right)
    assert tv.sampson_distance(F, uv_left, uv_right).max() < 1e-6
    assert same_up_to_scale(F, tv.fundamental(left, right), 1e-6)


def test_eight_point_is_opencvs():
    _, uv_left, uv_right = seen(*stereo())
    uv_right = uv_right + np.random.default_rng(5).normal(0, 1, uv_right.shape)
    theirs, _ = cv2.findFundamentalMat(uv_left, uv_right, cv2.FM_8POINT)
    F = tv.eight_point(uv_left, uv_right)
    assert same_up_to_scale(F, theirs, 1e-7)
    lines, their_lines = tv.epipolar_lines(F, uv_left), tv.epipolar_lines(theirs, uv_left)
    assert tv.line_distance(lines, uv_right) == pytest.approx(tv.line_distance(their_lines, uv_right), abs=1e-4)


def test_normalised_points_have_their_centroid_at_zero_and_mean_distance_root_two():
    uv = np.random.default_rng(6).uniform(0, 2000, (40, 2))
    xy = tv.from_homogeneous(tv.to_homogeneous(uv) @ tv.normalising_transform(uv).T)
    assert xy.mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert np.linalg.norm(xy, axis=1).mean() == pytest.approx(np.sqrt(2))


def fundamental_error(seed, sigma_px, normalised):
    """RMS Sampson distance of the true pairs from F estimated out of 20 noisy ones."""
    left, right = stereo()
    _, uv_left, uv_right = seen(left, right, seed, n=20)
    noise = np.random.default_rng([seed, 1]).normal(0, sigma_px, (2, 20, 2))
    F = tv.eight_point(uv_left + noise[0], uv_right + noise[1], normalised=normalised)
    return np.sqrt(np.mean(tv.sampson_distance(F, uv_left, uv_right) ** 2))


@pytest.mark.parametrize("sigma_px", [0.5, 1.0])
def test_hartleys_normalisation_pays_at_real_noise(sigma_px):
    """It wins 98 % of 4000 trials; asking for 90 of 100 fails by chance once in a million sets of seeds.

    The ratio of median errors is 0.11 ± 0.02 at 0.5 px and 0.08 ± 0.01 at 1 px. These seeds are fixed.
    """
    errors = np.array([[fundamental_error(seed, sigma_px, how) for how in (True, False)] for seed in range(100)])
    normalised, raw = errors.T
    assert (normalised < raw).mean() >= 0.9
    assert np.median(normalised) < 0.25 * np.median(raw)


def test_without_rank_two_the_epipolar_lines_do_not_meet():
    _, uv_left, uv_right = seen(*stereo())
    noisy = uv_right + np.random.default_rng(7).normal(0, 1, uv_right.shape)
    raw, mended = tv.linear_fundamental(uv_left, noisy), tv.eight_point(uv_left, noisy)
    assert np.linalg.svd(raw)[1][2] > 1e-9
    assert np.linalg.svd(mended)[1][2] < 1e-16
    assert abs(np.linalg.det(tv.nearest_rank_two(raw))) < 1e-20


def test_too_few_pairs_and_pairs_on_one_plane_are_refused():
    left, right = stereo()
    _, uv_left, uv_right = seen(left, right)
    with pytest.raises(ValueError, match="at least 8 pairs of points, got 7"):
        tv.eight_point(uv_left[:7], uv_right[:7])
    uv_right_gone = np.where(np.arange(50)[:, None] < 7, uv_right, np.nan)
    with pytest.raises(ValueError, match="got 7"):
        tv.eight_point(uv_left, uv_right_gone)
    with pytest.raises(ValueError, match="one shape"):
        tv.eight_point(uv_left, uv_right[:-1])
    on_plane = (
        np.random.default_rng(8).uniform(-1, 1, (30, 3)) * [1, 1, 0] + left.unproject([320, 240]) * 4 + left.centre
    )
    with pytest.raises(ValueError, match="plane"):
        tv.eight_point(left.project(on_plane), right.project(on_plane))
    with pytest.raises(ValueError, match="coincide"):
        tv.eight_point(np.ones((9, 2)), np.ones((9, 2)))


def test_pairs_without_an_image_are_left_out():
    _, uv_left, uv_right = seen(*stereo())
    with_gap = uv_left.copy()
    with_gap[3] = np.nan
    assert tv.eight_point(with_gap, uv_right) == pytest.approx(
        tv.eight_point(np.delete(uv_left, 3, axis=0), np.delete(uv_right, 3, axis=0)), abs=1e-15
    )


def test_ransac_finds_the_outliers_that_were_put_in():
    left, right = stereo()
    _, uv_left, uv_right = seen(left, right, n=120)
    rng = np.random.default_rng(9)
    uv_right = uv_right + rng.normal(0, 0.3, uv_right.shape)
    far_off = tv.epipolar_lines(tv.fundamental(left, right), uv_left)[:40, :2] * rng.uniform(15, 60, (40, 1))
    uv_right[:40] += far_off
    uv_left[119] = np.nan
    F, inliers = tv.ransac_fundamental(uv_left, uv_right, 1.5, rng)
    assert not inliers[:40].any()
    assert inliers[40:119].mean() > 0.95
    assert not inliers[119]
    truth = tv.sampson_distance(F, *seen(left, right)[1:])
    assert np.sqrt(np.mean(truth**2)) < 0.5
    again, _ = tv.ransac_fundamental(uv_left, uv_right, 1.5, np.random.default_rng(10))
    once_more, _ = tv.ransac_fundamental(uv_left, uv_right, 1.5, np.random.default_rng(10))
    assert np.array_equal(again, once_more)


def test_ransac_refuses_what_nothing_agrees_on():
    rng = np.random.default_rng(11)
    with pytest.raises(ValueError, match="agree"):
        tv.ransac_fundamental(*rng.uniform(0, 600, (2, 30, 2)), 1e-6, rng, max_samples=20)
    with pytest.raises(ValueError, match="at least 8"):
        tv.ransac_fundamental(np.zeros((7, 2)), np.zeros((7, 2)), 1, rng)


@given(rigs)
@settings(max_examples=30, deadline=None)
def test_an_essential_matrix_has_four_motions_and_opencv_finds_the_same(rig):
    E = tv.essential(tv.right_from_left(*rig))
    ours = tv.decompose_essential(E)
    R1, R2, t = cv2.decomposeEssentialMat(E)
    for motion in ours:
        R = motion.rotation.as_matrix()
        assert min(np.abs(R - R1).max(), np.abs(R - R2).max()) < 1e-9
        assert np.abs(np.abs(motion.translation @ t[:, 0]) - 1) < 1e-12
        assert same_up_to_scale(tv.essential(motion), E, 1e-9)
    assert all(not np.allclose(a.as_matrix(), b.as_matrix()) for i, a in enumerate(ours) for b in ours[:i])


@pytest.mark.parametrize("lens", [None, Equidistant()])
@pytest.mark.parametrize("sign", [1, -1])
def test_only_the_true_motion_has_the_points_in_front_of_both_cameras(lens, sign):
    left, right = stereo(lens)
    _, uv_left, uv_right = seen(left, right)
    true = tv.right_from_left(left, right)
    rays = [c.lens.unproject(c.intrinsics.from_pixels(uv)) for c, uv in ((left, uv_left), (right, uv_right))]
    motion = tv.recover_pose(sign * tv.essential(true), *rays)
    assert motion.rotation.as_matrix() == pytest.approx(true.rotation.as_matrix(), abs=1e-9)
    assert motion.translation == pytest.approx(unit(true.translation), abs=1e-9)


def test_opencv_recovers_the_same_pose():
    left, right = stereo()
    right = Camera(left.intrinsics, world_from_cam=right.world_from_cam)
    _, uv_left, uv_right = seen(left, right)
    uv_right = uv_right + np.random.default_rng(12).normal(0, 0.2, uv_right.shape)
    E = tv.nearest_essential(
        tv.essential_from_fundamental(tv.eight_point(uv_left, uv_right), left.intrinsics, right.intrinsics)
    )
    rays = [c.lens.unproject(c.intrinsics.from_pixels(uv)) for c, uv in ((left, uv_left), (right, uv_right))]
    motion = tv.recover_pose(E, *rays)
    plain = [left.intrinsics.from_pixels(uv) for uv in (uv_left, uv_right)]
    _, R, t, _ = cv2.recoverPose(E, *plain, np.eye(3))
    assert motion.rotation.as_matrix() == pytest.approx(R, abs=1e-9)
    assert motion.translation == pytest.approx(t[:, 0], abs=1e-9)


def test_the_nearest_essential_matrix_is_nearer_than_its_neighbours():
    E = tv.essential(tv.right_from_left(*stereo()))
    rng = np.random.default_rng(17)
    noisy = E + rng.normal(0, 0.02, (3, 3))
    nearest = tv.nearest_essential(noisy)
    s = np.linalg.svd(nearest)[1]
    assert s == pytest.approx([s[0], s[0], 0], abs=1e-12)
    for scale in (0.99, 1.01):
        assert np.linalg.norm(noisy - nearest) < np.linalg.norm(noisy - scale * nearest)
    motion = tv.decompose_essential(nearest)[0]
    for turn in rng.normal(0, 0.01, (20, 3)):
        turned = RigidTransform.from_components(motion.translation * s[0], Rotation.from_rotvec(turn) * motion.rotation)
        sign = np.sign(np.sum(tv.essential(turned) * noisy))
        assert np.linalg.norm(noisy - nearest) < np.linalg.norm(noisy - sign * tv.essential(turned))


def test_a_pose_cannot_be_recovered_from_points_that_tell_nothing():
    E = tv.essential(tv.right_from_left(*stereo()))
    with pytest.raises(ValueError, match="four motions"):
        tv.recover_pose(E, np.full((5, 3), np.nan), np.full((5, 3), np.nan))
    with pytest.raises(ValueError, match="two equal singular values"):
        tv.decompose_essential(np.zeros((3, 3)))


# ---- Triangulation


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


# ---- Rectification and depth


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
    assert pair.maps()[0] == pytest.approx(np.stack(theirs, axis=-1), abs=1e-3)


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
    assert pair.maps()[1] == pytest.approx(left.intrinsics.grid(), abs=1e-9)


def test_what_cannot_be_rectified_is_refused():
    left, right = stereo()
    with pytest.raises(ValueError, match="to the right"):
        tv.rectify(right, left)
    with pytest.raises(ValueError, match="0 m from it"):
        tv.rectify(left, left)
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
