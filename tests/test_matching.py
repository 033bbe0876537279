"""Matchers find shifts that were put there and depths that the virtual camera knows; scores count as they say."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.scenes import snapshot, textured_scene
from camviz_school import samples
from camviz_school.samples import motorcycle

EACH = pytest.mark.parametrize("method", twoview.METHODS)


def texture(width, seed=3):
    """Smooth noise, uint8 (120, width)."""
    noise = cv2.GaussianBlur(np.random.default_rng(seed).uniform(0, 255, (120, width)), (0, 0), 1.5)
    return cv2.normalize(noise, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


@pytest.fixture(scope="module")
def garden():
    """Left and right picture of a rectified pair in the garden, and the true disparities from traced rays."""
    left = Camera(Intrinsics.from_fov(320, 240, 60))
    right = left.at(RigidTransform.from_translation([0.2, 0, 0]))
    rays = left.rays()
    _, distance = textured_scene().trace(left.centre, rays)
    truth = left.intrinsics.fx * 0.2 / (distance * rays[..., 2])
    return snapshot(textured_scene(), left), snapshot(textured_scene(), right), truth


@EACH
def test_a_shifted_picture_has_that_shift_everywhere(method):
    picture = texture(300)
    found = twoview.disparity(picture[:, :280], picture[:, 9:289], method, disparities=32, block_size=9)
    inner = found[10:-10, 42:-20]
    assert np.isfinite(inner).mean() > 0.98
    assert np.abs(inner[np.isfinite(inner)] - 9).max() <= 0.25


@EACH
def test_half_a_pixel_of_shift_is_found_to_a_quarter(method):
    picture = texture(600)
    left, right = (cv2.resize(picture[:, s : s + 560], (280, 120), interpolation=cv2.INTER_AREA) for s in (0, 17))
    found = twoview.disparity(left, right, method, disparities=32, block_size=9)
    assert np.nanmedian(found) == pytest.approx(8.5, abs=0.25)


@EACH
def test_the_garden_is_measured_as_the_virtual_camera_knows_it(method, garden):
    left, right, truth = garden
    found = twoview.disparity(left, right, method, disparities=48, block_size=7)
    error = np.abs(found - truth)[:, 48:]
    assert np.nanmedian(error) < 0.25  # matchers are drawn towards whole pixels
    assert np.mean(error[np.isfinite(error)] < 1) > 0.8


@EACH
def test_the_columns_in_which_no_full_search_is_possible_have_no_disparity(method, garden):
    found = twoview.disparity(*garden[:2], method, disparities=32, block_size=7)
    assert found.dtype == np.float32
    assert np.isnan(found[:, :32]).all()
    assert np.isfinite(found[:, 32:]).any()


def test_the_filter_fills_what_semi_global_matching_leaves_open(garden):
    missing = [
        np.isnan(twoview.disparity(*garden[:2], method, disparities=48)[:, 48:]).mean()
        for method in ("SGM", "SGM + WLS")
    ]
    assert missing[1] < missing[0]


def test_a_score_counts_missing_wrong_and_unknown_pixels_each_in_its_place():
    truth = np.array([10, 10, 10, 10, np.nan])
    score = twoview.matching_score([10.5, 12, np.nan, 10, 3], truth)
    assert score.compared == 4
    assert score.missing == 0.25
    assert score.bad == 0.5
    assert score.mean_error == pytest.approx(2.5 / 3)
    assert twoview.matching_score([10.5, 12, np.nan, 10, 3], truth, 2.0).bad == 0.25


def test_without_a_truth_there_is_no_score():
    score = twoview.matching_score([1.0, 2.0], [np.nan, np.nan])
    assert score.compared == 0
    assert np.isnan([score.bad, score.missing, score.mean_error]).all()


def test_the_left_right_check_leaves_out_what_one_camera_sees_alone():
    """A thing three columns wide at disparity 4 before a wall at 1: it hides the 4 − 1 columns to its left."""
    left, right = np.ones(14), np.ones(14)
    left[8:11], right[4:7] = 4, 4
    kept = twoview.left_right_check(left, right)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(kept)), [0, 5, 6, 7])
    np.testing.assert_array_equal(kept[8:11], 4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"method": "MAGIC"}, "method must be one of SGM, BM"),
        ({"disparities": 40}, "multiple of 16"),
        ({"disparities": 320}, "less than the picture's width"),
        ({"block_size": 8}, "odd number"),
        ({"method": "BM", "block_size": 3}, "from 5"),
        ({"right": np.zeros((240, 300, 3), np.uint8)}, "of one size"),
        ({"left": np.zeros((240, 320))}, "uint8"),
    ],
)
def test_what_opencv_does_not_take_is_refused_in_words(change, words, garden):
    given = {"left": garden[0], "right": garden[1], "method": "SGM", **change}
    with pytest.raises(ValueError, match=words):
        twoview.disparity(given.pop("left"), given.pop("right"), given.pop("method"), **given)


def agreement(pair):
    """How well the right picture, fetched by the true disparities, repeats the left one: PSNR in dB; and unmoved."""
    height, width = pair.disparity.shape
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    known = np.isfinite(pair.disparity) & (u - pair.disparity >= 0)
    fetched = cv2.remap(pair.right, np.nan_to_num(u - pair.disparity), v, cv2.INTER_LINEAR)
    return cv2.PSNR(fetched[known], pair.left[known]), cv2.PSNR(pair.right[known], pair.left[known])


@pytest.mark.parametrize("width", [741, 370])
def test_the_motorcycle_s_true_disparities_lead_from_one_picture_to_the_other(width):
    pair = motorcycle(width)
    moved, unmoved = agreement(pair)
    assert moved > unmoved + 5
    assert pair.left.shape[1] == pair.disparity.shape[1] == width
    assert pair.focal_length == pytest.approx(994.978 * width / 741)


def test_the_motorcycle_s_cameras_see_its_true_depths_in_both_pictures():
    """Projected into the right camera, a pixel's point lands where the published disparity has its partner."""
    pair = motorcycle(240)
    left, right = pair.cameras
    uv = left.intrinsics.grid()[20:140:10, 60:220:10]
    Z, d = (one[20:140:10, 60:220:10] for one in (pair.depth, pair.disparity))
    x = (uv - (119.5, (pair.disparity.shape[0] - 1) / 2)) / pair.focal_length
    seen = right.project(np.concatenate([x, np.ones_like(x[..., :1])], axis=-1) * Z[..., None])
    known = np.isfinite(d)
    assert known.sum() > 100
    np.testing.assert_allclose((uv - seen)[known], np.stack([d, 0 * d], axis=-1)[known], atol=1e-3)


def test_where_scikit_image_lacks_the_motorcycle_the_garden_takes_its_place(tmp_path, monkeypatch):
    monkeypatch.setattr(samples, "files", lambda _: tmp_path)
    pair = motorcycle(240)
    assert not pair.real
    assert "no motorcycle" in pair.sentence
    moved, unmoved = agreement(pair)
    assert moved > unmoved + 5


@pytest.mark.parametrize("block_size", [21, 23])  # OpenCV's left-right check is at work up to 21
@pytest.mark.parametrize("method", twoview.METHODS)
def test_large_blocks_match_alike_every_time(method, block_size):
    rng = np.random.default_rng(0)
    tiles = np.kron(rng.integers(0, 256, (60, 80)), np.ones((6, 6)))
    right = np.roll(tiles, -10, axis=1)
    right[100:220, 100:300] = np.roll(tiles, -30, axis=1)[100:220, 100:300]
    pair = [np.clip(one + rng.normal(0, 12, one.shape), 0, 255).astype(np.uint8) for one in (tiles, right)]
    first, *others = (twoview.disparity(*pair, method, block_size=block_size) for _ in range(6))
    for other in others:
        np.testing.assert_array_equal(other, first)
