"""The model of EMVA 1288 is tested before a figure is told: what breaks it withholds what it spoils, and says why.

The cameras are those of `odd_cameras`. Every test draws with a fixed seed.
"""

import re
from math import isfinite

import numpy as np
import pytest
from odd_cameras import BY_GAIN, ODD, ORDINARY, PRNU, Kind, against, asked, faults, frames, ordinary, shooting

from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.neighbours import LAGS, Shading, shared_by_neighbours
from camviz_clinic.measuring.noise.statistics import pair, stack
from camviz_clinic.measuring.noise.trust import judged

SIZE = (64, 96)
REASONS = {
    "box filter": ("gain_dn_per_e", "neighbouring pixels share their noise"),
    "light denoise": ("snr_max_db", "neighbouring pixels share their noise"),
    "enlarged": ("prnu", "neighbouring pixels share their noise"),
    "compressive": ("prnu", "the signal does not rise with the light along a straight line"),
    "dual gain": ("read_noise_e", "the noise does not rise with the signal along a straight line"),
    "gamma 2.2, 8 bits": ("gain_dn_per_e", "along a straight line"),
    "vignetted": ("prnu", "changes smoothly across the picture"),
    "drifting offset": ("dark_current_e_per_s", "the offset drifts"),
    "clamped black": ("read_noise_e", "black level"),
    "flicker": ("linearity_error", "the light flickers"),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", ODD)
def test_a_camera_that_breaks_the_model_has_what_that_spoils_withheld_with_the_reason(name, thorough):
    """No figure is told that is further from the truth than promised, and no bounds exclude it."""
    for seed in range(5 if thorough else 1):
        camera, how, found = asked(ODD[name], ODD[name].size, seed)
        assert faults(ODD[name], camera, how, found) == []
        if name in REASONS:
            figure, why = REASONS[name]
            assert why in found.why(figure)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ORDINARY)
def test_nothing_is_found_against_a_camera_that_obeys_the_model(name):
    """One of them, which has pixels enough, is told all its figures."""
    camera, how, found = asked(ORDINARY[name], ORDINARY[name].size, 0)
    assert against(found) == []
    assert faults(ORDINARY[name], camera, how, found) == []


SOME = ("drifting offset", "vignetted", *list(ORDINARY)[:2])


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    "name", [name if name in SOME else pytest.param(name, marks=pytest.mark.thorough) for name in ORDINARY | ODD]
)
def test_frames_turned_by_a_quarter_give_the_same_figures_with_rows_and_columns_exchanged(name):
    kind = (ORDINARY | ODD)[name]
    found = []
    for turn in (np.asarray, np.rot90):
        rng = np.random.default_rng([90, 1])
        camera = kind.make((48, 64), rng)
        found.append(Measurement(*frames(camera, shooting(camera, 12), rng, turn)).judged)
    for figure, upright in found[0].items():
        turned = found[1][_exchanged(figure)]
        values = [(one.value, one.low, one.high) for one in (upright, turned)]
        np.testing.assert_allclose(*values, rtol=1e-7, atol=1e-9, err_msg=figure)
        assert turned.why == _exchanged(upright.why)


def _exchanged(words):
    """What is said of rows, of columns and the other way round."""
    other = {"row": "column", "column": "row"}
    return re.sub(r"(?<![a-z])(row|column)", lambda found: other[found[1]], words)


def test_every_bound_has_its_lower_end_below_its_upper_one():
    """An offset that falls by 2 DN from frame to frame was told as a dark current of 0 to less than 0 e⁻/s.

    As if the model held, the dark current is below zero whatever chance did: then there are no bounds.
    """
    kind = Kind(lambda size, rng: ordinary(size, rng, wander_e=lambda n, _: -5.0 * n, offset_dn=500.0))
    _, _, found = asked(kind, SIZE, 0)
    unchecked = judged(found.estimates.unchecked)
    assert found.estimates.unchecked.dark_current.bounds[1] < 0
    assert not unchecked["dark_current_e_per_s"].bounded
    for figure in [*found.judged.values(), *unchecked.values()]:
        assert not figure.bounded or figure.low <= figure.high
    assert not isfinite(found.judged["dark_current_e_per_s"].value)
    assert "the offset drifts" in found.why("dark_current_e_per_s")


# What is spoiled, and no more -----------------------------------------------------------------------------------------


def test_shared_noise_spoils_all_but_the_linearity():
    _, _, found = asked(ODD["box filter"], SIZE, 1)
    spoiled = {name for name in found.judged if "share their noise" in found.why(name)}
    assert spoiled >= BY_GAIN | PRNU
    assert not spoiled & {"linearity_error", "linearity_error_min", "linearity_error_max"}


def test_a_drift_of_the_offset_spoils_the_dark_current_alone():
    """Its noise bounds it all the same."""
    _, _, found = asked(ODD["drifting offset"], ODD["drifting offset"].size, 1)
    assert {name for name in found.judged if "the offset drifts" in found.why(name)} == {"dark_current_e_per_s"}
    assert found.figures()["gain_dn_per_e"] == pytest.approx(0.4, rel=0.03)
    bounds = found.judged["dark_current_e_per_s"]
    assert 10 < bounds.low < 20 < bounds.high < 30


def test_column_noise_is_taken_out_as_row_noise_is():
    """15 e⁻ of it. DSNU of pixels was told as "at most 0.90" for 3.0 e⁻, and the read noise without the columns'."""
    camera, _, found = asked(ODD["column noise"], (96, 128), 1)
    assert found.noisy_columns
    assert not found.noisy_rows
    assert found.read_noise_e == pytest.approx(np.hypot(6, 15), rel=0.1)
    pixels = found.judged["dsnu_pixel_e"]
    assert pixels.value == pytest.approx(camera.dsnu_e.std(), rel=0.05)


@pytest.mark.thorough
def test_the_linearity_of_a_gamma_is_that_of_the_standard_s_fit():
    """By the normal equations of the emva1288 project, over 5-95 % of 255, where 1.77 % was told."""
    _, how, found = asked(ODD["gamma 2.2, 8 bits"], (96, 128), 2)
    x, y = how.photons, found.signal
    inside = (y >= 0.05 * y.max()) & (y <= 0.95 * y.max())
    x, y = x[inside], y[inside]
    xy, xy2, x2y2, one, two = (np.sum(v) for v in (x / y, x / y**2, (x / y) ** 2, 1 / y, 1 / y**2))
    offset = (xy * xy2 - x2y2 * one) / (xy2**2 - x2y2 * two)
    slope = (xy - offset * xy2) / x2y2
    off = (y - (slope * x + offset)) / (slope * x + offset)
    assert found.linearity == pytest.approx((off.min(), off.max(), np.abs(off).mean()), rel=1e-6)
    assert 0.08 < found.linearity[2] < 0.13


# The statistics -------------------------------------------------------------------------------------------------------


def test_neighbours_share_what_a_filter_makes_them_share():
    """0.6 of a pixel and 0.4 of its right neighbour: a covariance of 0.24 σ² along the row, and none else."""
    rng = np.random.default_rng(1)
    white = rng.normal(0, 3, (400, 501)) - rng.normal(0, 3, (400, 501))
    seen, kurtosis = shared_by_neighbours(0.6 * white[:, :-1] + 0.4 * white[:, 1:])
    for lag, one in zip(LAGS, seen, strict=True):
        assert one.covariance == pytest.approx(0.24 * 9 if lag == (0, 1) else 0, abs=5 * one.error + 0.02)
        assert one.error == pytest.approx(9 * 0.52 / np.sqrt(200_000), rel=0.2)
    assert kurtosis == pytest.approx(3, abs=0.05)


@pytest.mark.parametrize("size", [(8, 9), (40, 30)])
def test_noise_of_pixels_rows_and_columns_is_not_taken_for_that_of_neighbours(size):
    """The mean of 300 covariances lies within four of its errors of 0, and they scatter as is said."""
    rng = np.random.default_rng(2)
    shapes = (size, (size[0], 1), (1, size[1]))
    found = [
        shared_by_neighbours(sum(rng.normal(0, s, shape) for s, shape in zip((1, 3, 2), shapes, strict=True)))[0]
        for _ in range(300)
    ]
    values = np.array([[lag.covariance for lag in one] for one in found])
    errors = np.array([[lag.error for lag in one] for one in found]).mean(axis=0)
    assert (abs(values.mean(axis=0)) < 4 * errors / np.sqrt(300)).all()
    np.testing.assert_allclose(values.std(axis=0), errors, rtol=0.35)


def test_a_smooth_light_is_found_and_a_white_pattern_is_none():
    rng = np.random.default_rng(3)
    v, u = np.linspace(-1, 1, 60)[:, None], np.linspace(-1, 1, 80)[None]
    for _ in range(100):
        white = rng.normal(0, 5, (60, 80)) + rng.normal(0, 2, (60, 1)) + rng.normal(0, 2, (1, 80))
        assert Shading.of(white).variances() == (0.0, 0.0, 0.0)
    light = 1000 - 60 * u**2 - 60 * v**2 + 20 * u * v
    seen = Shading.of(light + rng.normal(0, 5, (60, 80)))
    expected = [(60 * u**2).var(), (60 * v**2).var(), (20 * u * v).var()]
    np.testing.assert_allclose(seen.variances(), [expected[1], expected[0], expected[2]], rtol=0.1)
    low, high = seen.extremes()
    smooth = light - light.mean()
    assert (low, high) == pytest.approx((smooth.min(), smooth.max()), rel=0.1)
    assert Shading.of(light).less(Shading.of(light)).variances() == (0.0, 0.0, 0.0)
    assert Shading.of(light[:15]).variances() == (0.0, 0.0, 0.0)  # too few rows to tell
    assert Shading.of(light[:16]).variances()[1] > 0


def test_a_pair_and_a_stack_tell_pixels_rows_and_columns_apart():
    """σ of 3, 2 and 1.5 DN. False failure: 1e-4."""
    rng = np.random.default_rng(4)

    def frame():
        return 100 + rng.normal(0, 3, (150, 200)) + rng.normal(0, 2, (150, 1)) + rng.normal(0, 1.5, (1, 200))

    pairs, many = [pair(frame(), frame()) for _ in range(40)], stack(frame() for _ in range(40))
    for name, variance in (("within", 9), ("row_variance", 4), ("column_variance", 2.25), ("total", 15.25)):
        assert np.mean([getattr(one, name) for one in pairs]) == pytest.approx(variance, rel=0.08)
    assert (many.within, many.row_means, many.column_means) == pytest.approx((9, 4.045, 2.31), rel=0.08)
    assert abs(many.whole.variance) < 4 * many.whole.error


def test_the_error_of_a_variance_knows_that_few_pixels_may_have_most_of_it():
    """One pixel in 200 has 20 times the noise: 300 variances scatter four times as much as of Gaussian noise."""
    rng = np.random.default_rng(5)
    deviation = np.where(rng.random((80, 100)) < 0.005, 20.0, 1.0)
    seen = [pair(*(deviation * rng.standard_normal((80, 100)) for _ in range(2))) for _ in range(300)]
    spread = np.std([one.within for one in seen])
    assert np.mean([one.within_error for one in seen]) == pytest.approx(spread, rel=0.2)


def test_flicker_of_the_light_makes_a_pattern_no_smaller():
    """1 % of it in a stack of 16, beside a pattern of 1 %: the standard's equation takes 3 % of its variance off."""
    rng = np.random.default_rng(6)
    pattern = 1 + 0.01 * rng.standard_normal((90, 120))
    seen = stack(rng.normal(5000 * (1 + 0.01 * rng.standard_normal()) * pattern, 20) for _ in range(16))
    assert seen.restless
    assert seen.whole.variance == pytest.approx(np.var(seen.mean * pattern), rel=0.02)
    assert seen.pattern < 0.98 * seen.whole.variance
