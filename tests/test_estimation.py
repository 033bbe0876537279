"""F and E from pairs of points, exact and noisy, against OpenCV and the truth."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation
from two_views import Equidistant, rigs, same_up_to_scale, seen, stereo

from camviz import twoview as tv
from camviz.cameras import Camera
from camviz.lenses.base import unit


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


def flat_and_deep(seed):
    """Noisy pairs of 40 points on a plane aslant, of a camera that only turned, and of 40 points at all depths."""
    rng, (left, right) = np.random.default_rng(seed), stereo()
    rays = left.unproject(rng.uniform([160, 120], [480, 360], (40, 2)))
    normal = left.world_from_cam.rotation.apply([0.3, -0.2, 1])
    plane = left.centre + rays * (4 / (rays @ normal))[:, None]
    deep = left.centre + rays * rng.uniform(3, 6, (40, 1))
    turned = right.at(RigidTransform.from_components(left.centre, right.world_from_cam.rotation))
    for points, other in ((plane, right), (deep, turned), (deep, right)):
        pairs = left.project(points), other.project(points)
        yield [uv + rng.normal(0, 0.5, uv.shape) for uv in pairs]


def test_noisy_pairs_of_a_plane_and_of_a_camera_that_only_turned_are_refused_and_those_with_depth_are_not():
    refused = np.zeros(3, int)
    for seed in range(60):
        for kind, pairs in enumerate(flat_and_deep(seed)):
            try:
                tv.eight_point(*pairs)
            except ValueError:
                refused[kind] += 1
    assert refused[0] >= 54
    assert refused[1] >= 54
    assert refused[2] == 0
    with pytest.raises(ValueError, match="these 40 points leave F undetermined: a homography explains them as well"):
        tv.eight_point(*next(flat_and_deep(0)))


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
