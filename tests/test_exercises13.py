"""The answers of lesson 13's exercises are those of OpenCV and camviz, and each wrong answer is told what is wrong."""

import cv2
import numpy as np
import pytest

from camviz.checks import judge
from camviz.colour import balance
from camviz.exercises import exercise, exercises, lesson13


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_response_is_camviz_s_beside_a_perfect_white():
    for light, reflectance, sensitivity in cases("13.response"):
        white = balance.response(light, 1, sensitivity)
        expected = balance.response(light, reflectance, sensitivity) / white
        np.testing.assert_allclose(lesson13.response(light, reflectance, sensitivity), expected)


def test_grey_world_is_camviz_s():
    for (raw,) in cases("13.grey_world"):
        np.testing.assert_allclose(lesson13.grey_world(raw), balance.grey_world(raw))


def test_developing_multiplies_as_opencv_does():
    for raw, gains, matrix in cases("13.develop"):
        linear = cv2.transform(np.reshape(raw * gains, (-1, 1, 3)), matrix).reshape(raw.shape)
        np.testing.assert_allclose(lesson13.develop(raw, gains, matrix), np.clip(linear, 0, 1) ** (1 / 2.2))


def test_the_matrix_is_that_of_the_normal_equations():
    for raw, target in cases("13.fit_matrix"):
        solved, m = cv2.solve(raw, target, flags=cv2.DECOMP_SVD)
        assert solved
        np.testing.assert_allclose(lesson13.fit_matrix(raw, target), m.T, atol=1e-9)


def test_what_is_unseen_is_orthogonal_to_the_sensor_and_the_rest_is_a_mixture_of_it():
    for change, sensor in cases("13.unseen"):
        left = lesson13.unseen(change, sensor)
        np.testing.assert_allclose(left @ sensor, 0, atol=1e-9)
        assert np.linalg.matrix_rank(np.column_stack([sensor, change - left]), tol=1e-8) == 3


@pytest.mark.parametrize("name", exercises("13"))
def test_the_reference_passes_and_each_known_mistake_is_named(name):
    one = exercise(name)
    assert judge(one, one.reference, np.random.default_rng(1), 1).status == "correct"
    for known in one.misconceptions:
        verdict = judge(one, known.reference, np.random.default_rng(2), 1)
        assert verdict.status == "wrong"
        assert verdict.message.startswith(known.explanation.replace("``", "`")[:30])


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("13.response", lambda light, reflectance, sensitivity: np.full(3, 0.5)),
        ("13.grey_world", lambda raw: np.array([1.2, 1.0, 1.4])),
        ("13.develop", lambda raw, gains, matrix: raw),
        ("13.fit_matrix", lambda raw, target: np.eye(3)),
        ("13.unseen", lambda change, sensor: np.zeros_like(change)),  # the sensor notices nothing of it, indeed
    ],
)
def test_constants_and_what_does_nothing_do_not_pass(name, wrong):
    assert judge(exercise(name), wrong, np.random.default_rng(3), 1).status == "wrong"
