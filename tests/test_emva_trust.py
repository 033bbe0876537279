"""A figure of `camviz noise` is near the truth or withheld: where rounding, a clipped black level and rows hide it.

The cameras are plain NumPy, photon by photon (`plain_cameras`). Every test draws with a fixed seed; "false failure" is
how often a correct measurement would fail it if the seed were drawn anew.
"""

from dataclasses import replace

import numpy as np
import pytest
from plain_cameras import PlainCamera, Shooting, error, measured, pattern, random_camera, random_shooting, truth

from camviz_clinic.measuring.noise.estimate import Estimate, combined, of
from camviz_clinic.measuring.noise.estimates import threshold
from camviz_clinic.measuring.noise.hidden import (
    before_rounding,
    clipped_bias,
    clipped_variance,
    missed_beyond,
    rounding_bias,
)
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.statistics import pair, stack

SIZE = (120, 160)


def camera(size=SIZE, *, dsnu_e=2.0, prnu=0.01, seed=1, **changed):
    """A 12-bit camera of ordinary figures."""
    rng = np.random.default_rng(seed)
    usual = PlainCamera(0.4, 12, 6.0, 0.0, 60.0, 9_000.0, 0.6, 20.0, np.zeros(size), np.zeros(size))
    maps = {"dsnu_e": dsnu_e * rng.standard_normal(size), "prnu": prnu * rng.standard_normal(size)}
    return replace(usual, **{**maps, **changed})


def shooting(one, levels=30, reach=1.15, frames=0, known=True):
    share = np.linspace(1 / levels, 1, levels)
    return Shooting(share, share * reach * one.top_e / one.efficiency, known, frames)


def outside(one, how, found):
    """The figures told that are further from the truth than promised, and the bounds that do not hold it."""
    true = truth(one, how, found)
    told = {name: figure.value for name, figure in found.judged.items() if np.isfinite(figure.value)}
    wrong = [name for name, value in told.items() if error(name, value, true[name]) > 1]
    bounds = {name: (figure.low, figure.high) for name, figure in found.judged.items() if figure.bounded}
    return wrong, [name for name, (low, high) in bounds.items() if not low - 1e-9 <= true[name] <= high + 1e-9]


# Many cameras ---------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_every_figure_of_random_cameras_is_near_the_truth_or_withheld(thorough):
    """K 0.01–10 DN/e⁻, 8–16 bits, read noise 0.3–30 e⁻, row noise up to 30 e⁻, up to 60 % of the dark pixels clipped.

    At four standard errors chance alone is 1 in 16 000, of figures that are just told. False failure: below 1 %.
    """
    told, cameras = 0, 48 if thorough else 8
    for number in range(cameras):
        rng = np.random.default_rng([48, number])
        one = random_camera(rng, (64, 64) if number % 3 else SIZE)
        how = random_shooting(rng, one, int(rng.integers(10, 41)))
        try:
            found = measured(one, how, rng)
        except ValueError:  # no level is above the dark, or all are saturated
            continue
        assert outside(one, how, found)[0] == [], number
        told += sum(np.isfinite(figure.value) for figure in found.judged.values())
    assert told > 1.46 * cameras  # of 20 each: much is withheld of such frames, and not all


@pytest.mark.thorough
def test_a_well_exposed_camera_of_twelve_bits_tells_every_figure():
    """50 levels of 300k pixels, stacks of 16, patterns of rows, columns and pixels. False failure: below 1 %."""
    rng, size = np.random.default_rng(12), (480, 640)
    rows, columns = (rng.standard_normal(shape) for shape in ((480, 1), (1, 640)))
    dsnu, prnu = (rng.standard_normal(size) + rows + columns for _ in range(2))
    one = PlainCamera(0.15, 12, 8.0, 0.0, 64.0, 24_000.0, 0.6, 50.0, 3 * dsnu, 0.004 * prnu)
    how = shooting(one, levels=50, reach=1.12, frames=16)
    found = measured(one, how, rng)
    assert {name: figure.why for name, figure in found.judged.items() if figure.why} == {}
    assert outside(one, how, found) == ([], [])


# Rounding -------------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_noise_below_the_quantisation_limit_is_bounded_and_not_taken_for_what_is_left_of_it():
    """8 bits, K = 0.05 DN/e⁻, σ = 3 e⁻: 0.15 DN of noise, of which whole numbers show none or too much.

    The dynamic range is 56.2 dB with the twelfth of rounding, and was told as 66.6.
    """
    for offset in (10.0, 10.25, 10.5):
        one = camera(gain=0.05, bits=8, read_e=3.0, offset_dn=offset, full_well_e=4_500.0, dark_e_per_s=0.0, dsnu_e=0.5)
        how = shooting(one, levels=50)
        found = measured(one, how, np.random.default_rng(3))
        for name in ("read_noise_e", "threshold_e", "dynamic_range_db", "dsnu_e"):
            assert np.isnan(found.figures()[name])
            assert "rounding hides" in found.why(name)
        assert outside(one, how, found) == ([], [])
        assert found.figures()["gain_dn_per_e"] == pytest.approx(0.05, rel=0.03)
        assert found.judged["read_noise_e"].high < 12


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.3, 0.45, 0.6, 1.0])
@pytest.mark.parametrize("mean", [7.0, 7.2, 7.5])
def test_the_noise_before_rounding_lies_within_its_bounds(sigma, mean):
    """Of a million draws. From 0.24 DN² on, the standard's limit, it may still be 13 % off; from 0.4 DN² on, 2 %."""
    numbers = np.rint(mean + sigma * np.random.default_rng(4).standard_normal(1_000_000))
    low, high = before_rounding(float(numbers.var()), 0.001)
    assert low <= sigma**2 + 1 / 12 + 1e-9
    assert sigma**2 + 1 / 12 <= high + 1e-9
    assert abs(numbers.mean() - mean) <= rounding_bias(sigma) + 0.003
    if sigma >= 0.6:
        assert high - low < 0.03 * high


# A clipped black level ------------------------------------------------------------------------------------------------


@pytest.mark.sampled(1)
@pytest.mark.parametrize("frames", [0, 16])
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_a_clipped_black_level_is_noticed_with_and_without_a_stack(frames, share):
    """Told before: DSNU 1.67 e⁻ for 2, and K 9.6 % too large. K is known all the same, from the bright frames."""
    offset = {0.1: 1.2816, 0.5: 0.0}[share] * 0.4 * np.hypot(6, 2) + 0.5
    one = camera(offset_dn=offset, dark_e_per_s=0.0)
    how = shooting(one, frames=frames)
    found = measured(one, how, np.random.default_rng(5))
    assert found.estimates.dark_share == pytest.approx(share, abs=0.01)
    for name in ("read_noise_e", "dsnu_e", "threshold_e", "dynamic_range_db"):
        assert np.isnan(found.figures()[name])
        assert "black level" in found.why(name)
    assert found.figures()["gain_dn_per_e"] == pytest.approx(0.4, rel=0.03)
    assert found.figures()["quantum_efficiency"] == pytest.approx(0.6, rel=0.03)
    assert outside(one, how, found) == ([], [])


def test_a_camera_that_clips_above_zero_is_noticed():
    """As video cameras do at 16: no pixel is darker, though the noise would carry a third of them there."""
    one = camera(offset_dn=17.0, dark_e_per_s=0.0)
    rng, how = np.random.default_rng(6), shooting(camera())
    darks, brights = [], []
    for t, photons in zip(how.exposures_s, how.photons, strict=True):
        darks.append([np.maximum(one.frame(0, t, rng), 16) for _ in range(2)])
        brights.append([np.maximum(one.frame(photons, t, rng), 16) for _ in range(2)])
    levels = zip(how.exposures_s, brights, darks, how.photons, strict=True)
    found = Measurement(tuple(Level.of(*level) for level in levels))
    assert found.estimates.scale.floor == 16
    assert "black level" in found.why("read_noise_e")
    assert found.figures()["gain_dn_per_e"] == pytest.approx(0.4, rel=0.03)


@pytest.mark.parametrize("share", [0.005, 0.05, 0.3, 0.6])
def test_clipped_gaussian_noise_keeps_the_variance_and_gains_the_mean_that_are_said(share):
    numbers = np.random.default_rng(7).standard_normal(400_000)
    clipped = np.maximum(numbers, np.quantile(numbers, share))
    assert clipped_variance(share) == pytest.approx(clipped.var(), rel=0.01)
    assert clipped_bias(share) == pytest.approx(clipped.mean() - numbers.mean(), rel=0.06)


def test_more_lies_beyond_an_end_than_is_said_whatever_the_pattern():
    """Noise of σ = 3 on no pattern, a narrow one and two islands: the fewest are beyond where there is no pattern."""
    rng = np.random.default_rng(8)
    for spread in (np.zeros(400_000), rng.normal(0, 2, 400_000), rng.choice([-20.0, 20.0], 400_000)):
        numbers = np.rint(100 + spread + rng.normal(0, 3, 400_000))
        end = np.quantile(numbers, 0.02)
        share = float(np.mean(numbers <= end))
        assert np.count_nonzero(numbers < end) >= 0.95 * missed_beyond(share, np.sqrt(9 + 1 / 12), 400_000)


# Rows -----------------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_noise_that_rows_share_is_no_fixed_pattern_of_rows():
    """25 e⁻ of it in stacks of 32 leave 4 e⁻ in the rows' means, which were told as fixed rows of a total of 3 e⁻."""
    one = camera(row_e=25.0, dsnu_e=3.0, offset_dn=90.0)
    how = shooting(one, frames=32)
    found = measured(one, how, np.random.default_rng(9))
    assert found.noisy_rows
    assert np.isnan(found.figures()["dsnu_e"])
    assert found.why("dsnu_row_e") == "the rows have no pattern above chance"
    assert found.judged["dsnu_pixel_e"].value == pytest.approx(3, rel=0.05)
    assert outside(one, how, found) == ([], [])
    whole = found.dark.whole
    assert sum(found.dark.split().values()) == pytest.approx(whole.variance, rel=1e-3)
    assert abs(whole.variance - 0.4**2 * np.var(one.dsnu_e)) < 4 * whole.error
    assert found.read_noise_e == pytest.approx(np.hypot(6, 25), rel=0.05)  # rows are part of the temporal noise
    assert found.figures()["gain_dn_per_e"] == pytest.approx(0.4, rel=0.03)


def test_fixed_rows_are_found_under_rows_that_change():
    """Fixed rows of 4 e⁻ under row noise of 6 e⁻: stacks of 60 leave 0.8 e⁻ of it, with a chance of 12 %."""
    rng = np.random.default_rng(10)
    frames = [4 * rows + 6 * rng.standard_normal((400, 1)) + 5 * rng.standard_normal((400, 100)) for rows in ROWS]
    seen = stack(frames)
    assert seen.split()["row"] == pytest.approx(np.var(ROWS[0]) * 16, rel=0.1)
    assert seen.split()["pixel"] == pytest.approx(0, abs=0.05)


ROWS = [np.random.default_rng(11).standard_normal((400, 1))] * 60


@pytest.mark.thorough
def test_rows_with_noise_of_their_own_do_not_make_a_camera_saturated():
    """20 cameras of 64 rows, 25 e⁻ of row noise beside 17 of light, none exposed beyond 70 % of its well.

    The rows' noise is known to 18 % from each pair, the pixels' to 2 %. False failure: 1e-4.
    """
    for seed in range(20):
        one = camera((64, 64), row_e=25.0, offset_dn=400.0, gain=2.0, full_well_e=400.0, seed=seed)
        found = measured(one, shooting(one, levels=20, reach=0.7), np.random.default_rng([13, seed]))
        assert not found.saturated
        assert "not" in found.why("full_well_e")


def test_the_errors_that_are_said_are_those_that_are_made():
    """400 pairs and stacks of noisy rows and columns: each error within 15 % of the spread. False failure: 1e-3."""
    rng = np.random.default_rng(14)
    fixed = rng.normal(0, 2, (64, 80))

    def frame():
        return fixed + rng.normal(0, 3, (64, 80)) + rng.normal(0, 2, (64, 1)) + rng.normal(0, 2.5, (1, 80))

    pairs, stacks = [pair(frame(), frame()) for _ in range(400)], [stack(frame() for _ in range(6)) for _ in range(200)]
    for seen, value, said in (
        (pairs, "total", "total_error"),
        (pairs, "within", "within_error"),
        (pairs, "mean", "mean_error"),
        (stacks, "mean", "mean_error"),
    ):
        spread = np.std([getattr(one, value) for one in seen])
        assert np.mean([getattr(one, said) for one in seen]) == pytest.approx(spread, rel=0.15)
    spread = np.std([one.pattern for one in stacks])  # said larger by the skewness of few rows
    assert spread < np.mean([one.pattern_error for one in stacks]) < 1.6 * spread
    assert np.mean([one.total for one in pairs]) == pytest.approx(19.25, rel=0.02)
    assert np.mean([one.row_variance for one in pairs]) == pytest.approx(4, rel=0.04)
    assert np.mean([one.column_variance for one in pairs]) == pytest.approx(6.25, rel=0.04)


# The threshold, and arithmetic ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("sigma", [0.0, 0.3, 2.0, 30.0])
def test_at_the_threshold_signal_and_noise_are_equal(sigma):
    least = threshold(sigma**2)
    assert least == pytest.approx(np.sqrt(sigma**2 + least), rel=1e-12)


def test_estimates_carry_chance_and_what_is_hidden_through_a_quotient():
    """10 ± 0.3 hidden in 9 … 12, over 2 ± 0.02: 5 ± sqrt(0.15² + 0.05²), hidden in 4.5 … 6."""
    found = of(lambda a, b: a / b, Estimate(10.0, 0.3, 9.0, 12.0), Estimate(2.0, 0.02, 2.0, 2.0))
    assert (found.value, found.low, found.high) == (5.0, 4.5, 6.0)
    assert found.error == pytest.approx(np.hypot(0.15, 0.05), rel=0.02)
    assert found.bounds == pytest.approx((4.5 - 4 * found.error, 6 + 4 * found.error))
    one = Estimate(1.0, 0.1, 1.0, 1.0)
    assert combined([1, -1], [one, one]) == Estimate(0.0, 0.0, 0.0, 0.0)  # the same frames, counted once
    assert combined([1, -1], [one, replace(one)]).error == pytest.approx(0.1 * np.sqrt(2))


@pytest.mark.thorough
def test_patterns_of_gain_and_offset_that_are_alike_by_chance_are_told_apart_by_their_pictures():
    """DSNU and PRNU in the same columns: s²_y − s²_y.dark would tell 2.5 % where the gain differs by 2 %."""
    rng = np.random.default_rng(15)
    columns = np.repeat(rng.standard_normal((1, 160)), 120, axis=0)
    one = replace(camera(), dsnu_e=5 * columns, prnu=0.02 * columns, full_well_e=2_000.0)
    how = shooting(one, frames=16)
    found = measured(one, how, rng)
    assert found.figures()["prnu"] == pytest.approx(one.prnu.std(), rel=0.05)
    assert outside(one, how, found) == ([], [])


def test_random_patterns_of_the_plain_cameras_have_the_deviation_they_are_given():
    assert pattern(np.random.default_rng(16), (300, 400)).std() == pytest.approx(1, rel=0.15)
