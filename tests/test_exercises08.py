"""The answers of lesson 08's exercises are OpenCV's, and each wrong answer is told what is wrong with it."""

import cv2
import numpy as np
import pytest

from camviz import twoview
from camviz.checks import judge
from camviz.exercises import exercise, lesson08


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_rectified_pixels_are_opencv_s_perspective_transform():
    uv, K, R, K_new = cases("08.rectified")[3]
    H = K_new @ R @ np.linalg.inv(K)
    np.testing.assert_allclose(lesson08.rectified(uv, K, R, K_new), cv2.perspectiveTransform(uv, H), rtol=1e-9)


def test_metric_depth_is_opencv_s_reprojection():
    for found, K, P_left, P_right in cases("08.metric_depth"):
        f, doffs = P_left[0, 0], P_right[0, 2] - P_left[0, 2]
        B = -P_right[0, 3] / f
        Q = np.array([[1, 0, 0, -P_left[0, 2]], [0, 1, 0, -P_left[1, 2]], [0, 0, 0, f], [0, 0, 1 / B, doffs / B]])
        Z = cv2.reprojectImageTo3D((found / 16).astype(np.float32), Q)[..., 2]
        there = found > 0
        np.testing.assert_allclose(lesson08.metric_depth(found, K, P_left, P_right)[there], Z[there], rtol=1e-5)
        assert np.isnan(lesson08.metric_depth(found, K, P_left, P_right)[~there]).all()


def test_depth_and_baseline_are_those_of_camviz():
    for d, f, B, doffs in cases("08.depth"):
        np.testing.assert_allclose(lesson08.depth(d, f, B, doffs), twoview.depth_from_disparity(d, f, B, doffs))
    for Z, error, f, disparity_error in cases("08.baseline_for"):
        B = lesson08.baseline_for(Z, error, f, disparity_error)
        np.testing.assert_allclose(twoview.depth_error(Z, f, B, disparity_error), error)


def test_the_left_right_check_is_that_of_camviz():
    for arguments in cases("08.left_right"):
        np.testing.assert_array_equal(lesson08.left_right(*arguments), twoview.left_right_check(*arguments))


def near_plane(uv, K, R, K_new):
    return np.nan_to_num(lesson08.rectified(uv, K, R, K_new))


WRONG = [
    ("08.depth", lambda d, f, B, doffs: f * B / d, "doffs is left out"),
    ("08.depth", lambda d, f, B, doffs: f * B / (d - doffs), ""),
    ("08.depth", lambda d, f, B, doffs: f * B / (d + doffs), "NaN is the honest answer"),
    ("08.depth", lambda d, f, B, doffs: lesson08.depth(d, f / 16, B, doffs), "times 0.0625"),
    ("08.depth", lambda d, f, B, doffs: 3.0, "same number"),
    ("08.baseline_for", lambda Z, error, f, disparity_error: Z * disparity_error / (f * error), "Z²"),
    ("08.baseline_for", lambda Z, error, f, disparity_error: Z**2 / (f * error), "left out"),
    ("08.baseline_for", lambda Z, error, f, disparity_error: 2 * Z**2 * disparity_error / (f * error), "times 2"),
    ("08.rectified", lambda uv, K, R, K_new: lesson08.rectified(uv, K, R.T, K_new), "transposed"),
    ("08.rectified", near_plane, "NaN is wanted"),
    ("08.rectified", lambda uv, K, R, K_new: uv, ""),
    ("08.rectified", lambda uv, K, R, K_new: lesson08.rectified(uv[..., ::-1], K, R, K_new), ""),
    ("08.metric_depth", lambda found, K, P_left, P_right: K[0, 0] / found, ""),
    ("08.metric_depth", lambda found, K, P_left, P_right: lesson08.metric_depth(found, K, P_left, P_left), ""),
    ("08.metric_depth", lambda found, K, P_left, P_right: lesson08.metric_depth(16 * found, K, P_left, P_right), ""),
    ("08.left_right", lambda d_left, d_right, tolerance: d_left, ""),
    ("08.left_right", lambda d_left, d_right, tolerance: np.full_like(d_left, np.nan), ""),
    ("08.left_right", lambda d_left, d_right, tolerance: np.where(abs(d_left - d_right) < 1, d_left, np.nan), "same"),
    ("08.left_right", lambda d_left, d_right, tolerance: twoview.left_right_check(d_left, d_right, 9.0), ""),
]


@pytest.mark.parametrize(("name", "function", "words"), WRONG)
def test_a_wrong_answer_fails_and_is_told_why(name, function, words):
    for seed in range(10):
        verdict = judge(exercise(name), function, np.random.default_rng(seed))
        assert verdict.status == "wrong"
        assert words in verdict.message + verdict.hint, verdict.message


@pytest.mark.parametrize("one", lesson08.EXERCISES, ids=lambda one: one.name)
def test_every_known_mistake_is_recognised_as_itself(one):
    for known in one.misconceptions:
        for seed in range(5):
            verdict = judge(one, lambda *a, f=known.reference: f(*a), np.random.default_rng(seed))
            assert verdict.message == known.explanation


@pytest.mark.parametrize("one", lesson08.EXERCISES, ids=lambda one: one.name)
def test_the_reference_is_right_whatever_the_cases(one):
    assert all(judge(one, one.reference, np.random.default_rng(seed)).correct for seed in range(20))
