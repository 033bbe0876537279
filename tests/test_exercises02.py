"""The answers of lesson 02's exercises are those of camviz's optics, and each wrong answer is told what is wrong."""

import numpy as np
import pytest

from camviz import optics
from camviz.checks import judge
from camviz.exercises import exercise, lesson02


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_distances_blurs_and_limits_are_those_of_camviz():
    for f, u in cases("02.image_distance"):
        np.testing.assert_allclose(lesson02.image_distance(f, u), optics.image_distance_mm(f, u))
    for width, f, s in cases("02.field_of_view"):
        wanted = optics.field_of_view_deg(width, optics.image_distance_mm(f, s))
        np.testing.assert_allclose(np.degrees(lesson02.field_of_view(width, f, s)), wanted)
    for f, N, s, u in cases("02.blur"):
        np.testing.assert_allclose(lesson02.blur(f, N, s, u), optics.circle_of_confusion_mm(f, N, s, u), atol=1e-12)
    for f, N, s, c in cases("02.limits"):
        near, far = lesson02.limits(f, N, s, c)
        np.testing.assert_allclose(near, optics.near_limit_mm(f, N, s, c))
        np.testing.assert_allclose(far, optics.far_limit_mm(f, N, s, c))


def test_the_focal_length_of_a_prescription_is_that_of_camviz():
    for (rows,) in cases("02.effective_focal_length"):
        wanted = optics.Prescription("", tuple(map(tuple, rows))).focal_mm
        assert lesson02.effective_focal_length(rows) == pytest.approx(wanted)
    assert lesson02.effective_focal_length(np.array(optics.COOKE_TRIPLET.surfaces)) == pytest.approx(50, abs=1e-3)


WRONG = [
    ("02.image_distance", lambda f, u: 1 / (1 / f + 1 / u), "The sign"),
    ("02.image_distance", lambda f, u: 1 / f - 1 / u, "1/v"),
    ("02.image_distance", lambda f, u: np.abs(1 / (1 / f - 1 / u)), "negative"),
    ("02.field_of_view", lambda width, f, s: 2 * np.arctan(width / (2 * f)) + 0 * np.minimum(s, 1), "changes nothing"),
    ("02.field_of_view", lambda width, f, s: np.degrees(lesson02.field_of_view(width, f, s)), "degrees"),
    ("02.field_of_view", lambda width, f, s: np.arctan(width / 2 * (1 / f - 1 / s)), "half"),
    ("02.blur", lambda f, N, s, u: f / N * np.abs(u - s) / u, "in front of the lens"),
    ("02.blur", lambda f, N, s, u: lesson02.blur(f, N, s, u) / 2, "radius"),
    ("02.blur", lambda f, N, s, u: f**2 / (N * s) * np.abs(u - s) / u, "Close"),
    ("02.limits", lambda f, N, s, c: lesson02.limits(f, N, s, c)[::-1], "changed places"),
    ("02.limits", lambda f, N, s, c: lesson02.limits(f, N, s, c)[0], "where (2,) is wanted"),
    ("02.effective_focal_length", lambda surfaces: lesson02._wrong_order(surfaces), "order"),
    ("02.effective_focal_length", lambda surfaces: -lesson02.effective_focal_length(surfaces), "sign"),
    ("02.effective_focal_length", lambda surfaces: 50.0, "same number"),
]


@pytest.mark.parametrize(("name", "answer", "words"), WRONG)
def test_a_wrong_answer_is_told_what_is_wrong_with_it(name, answer, words):
    verdict = judge(exercise(name), answer, np.random.default_rng(1))
    assert verdict.status == "wrong"
    assert words in verdict.message


@pytest.mark.parametrize("name", [one.name for one in lesson02.EXERCISES])
def test_the_reference_is_correct(name):
    assert judge(exercise(name), exercise(name).reference, np.random.default_rng(2)).correct
