"""The answers of lesson 11's exercises are camviz's and NumPy's own, and each wrong answer is told what is wrong."""

import numpy as np
import pytest

from camviz.checks import judge
from camviz.exercises import exercise, lesson11
from camviz.lightfields import LightField, fourier_slice, from_microlens_image, periodic_shift_and_sum


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_a_sub_aperture_view_is_that_of_camviz():
    for sensor, n, v, u in cases("11.sub_aperture"):
        np.testing.assert_array_equal(lesson11.sub_aperture(sensor, n, v, u), from_microlens_image(sensor, n, n)[v, u])


def test_disparity_is_that_of_a_light_field_and_the_published_one():
    np.testing.assert_allclose(
        lesson11.disparity([5.2207, 3.6191], 0.025, 100 / 35 * 512, 4.25), [-1.6, 1.5], atol=5e-4
    )
    for z, b, f, z_f in cases("11.disparity"):
        field = LightField(np.zeros((1, 1, 1, 1, 3)), b, f, z_f)
        np.testing.assert_allclose(lesson11.disparity(z, b, f, z_f), field.disparity(z))


def test_the_mended_sum_is_the_fourier_slice():
    for views, d in cases("11.refocused"):
        np.testing.assert_allclose(lesson11.refocused(views, d), fourier_slice(views, d), atol=1e-12)
        np.testing.assert_allclose(lesson11.refocused(views, d), periodic_shift_and_sum(views, d), atol=1e-12)


@pytest.mark.parametrize("d", [-0.8, -0.3, 0.0, 0.45])
def test_the_slope_is_the_one_put_in(d):
    assert lesson11.slope(lesson11._slice(np.random.default_rng(1), 7, 80, d)) == pytest.approx(d, abs=0.01)


def test_alpha_is_the_ratio_of_thin_lens_image_distances():
    for z, f, z_f in cases("11.alpha"):
        image, sensor = (distance * f / (distance - f) for distance in (z, z_f))
        np.testing.assert_allclose(lesson11.alpha(z, f, z_f), image / sensor)


def uncentred(views, d):
    return lesson11._rolled(views, d, centred=False)


WRONG = [
    ("11.sub_aperture", lambda sensor, n, v, u: sensor[::n, ::n], ""),
    ("11.sub_aperture", lambda sensor, n, v, u: sensor[v * n : v * n + n, u * n : u * n + n], "*one* microlens"),
    ("11.disparity", lambda z, b, f, z_f: b * f / z, "two parallel cameras"),
    ("11.disparity", lambda z, b, f, z_f: 2 * lesson11.disparity(z, b, f, z_f), "times 2"),
    ("11.disparity", lambda z, b, f, z_f: 1.0, ""),
    ("11.refocused", uncentred, "in another place"),
    ("11.refocused", lambda views, d: views.mean(axis=(0, 1)), ""),
    ("11.slope", lambda epi: 0.4, "same number"),
    ("11.slope", lambda epi: 1 / lesson11.slope(epi), "views per pixel"),
    ("11.slope", lambda epi: np.nan_to_num(lesson11.slope(epi)), "every slope fits"),
    ("11.alpha", lambda z, f, z_f: z / z_f, "ratio of depths"),
    ("11.alpha", lambda z, f, z_f: 1.0 + 0 * z, "same number"),
]


@pytest.mark.parametrize(("name", "function", "words"), WRONG)
def test_a_wrong_answer_is_told_what_is_wrong(name, function, words):
    verdict = judge(exercise(name), function, np.random.default_rng(3))
    assert verdict.status == "wrong"
    assert words in verdict.message


@pytest.mark.parametrize("seed", range(5))
def test_a_slope_by_another_sound_method_is_accepted(seed):
    """By the larger eigenvector of the structure tensor, away from the borders."""

    def by_eigenvector(epi):
        L_u, L_x = (one[1:-1, 2:-2] for one in np.gradient(epi))
        if not np.ptp(epi):
            return np.nan
        _, directions = np.linalg.eigh([[np.sum(L_x**2), np.sum(L_x * L_u)], [np.sum(L_x * L_u), np.sum(L_u**2)]])
        return directions[1, 1] / directions[0, 1]

    assert judge(exercise("11.slope"), by_eigenvector, np.random.default_rng(seed))
