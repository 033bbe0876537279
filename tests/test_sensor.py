"""The sensor: each step has the statistics that theory asks for, and the whole foretells its own figures.

Every random test draws with a fixed seed, so that it passes or fails for good; "false failure" is how often a correct
sensor would fail it if the seed were drawn anew.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm
from scipy.stats import poisson as law

from camviz.sensors import (
    EfficiencyCurve,
    Sensor,
    amplify,
    dark_current_ratio,
    decibel,
    doubling_temperature_k,
    fill,
    poisson,
    quantise,
    read,
)
from camviz.sensors.counting import MANY, poisson_alike

SHAPE = (480, 640)
PIXELS = SHAPE[0] * SHAPE[1]
BUSY = Sensor(
    quantum_efficiency=0.45,
    full_well_e=15_000,
    read_noise_e=10.9,
    gain_dn_per_e=0.2,
    offset_dn=60,
    dark_current_e_per_s=30,
    dsnu_e=3,
    prnu=0.01,
)


def generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(seed))


def chi_square(counts: np.ndarray, mean: float) -> float:
    """The chance of a worse fit to Poisson's law, counts pooled so that 25 or more are expected in each class."""
    edges = law.ppf(np.linspace(0, 1, 40)[1:-1], mean)
    edges = np.unique(edges)
    expected = counts.size * np.diff(np.r_[0, law.cdf(edges, mean), 1])
    seen = np.bincount(np.searchsorted(edges, counts.ravel()), minlength=expected.size)
    full = expected > 25
    return float(chi2.sf(np.sum((seen - expected)[full] ** 2 / expected[full]), full.sum() - 1))


@pytest.mark.parametrize("mean", [0.03, 1.0, 7.5, 24.0, 400.0, 20_000.0])
def test_counts_follow_poissons_law(mean: float) -> None:
    """Chi-square against scipy's distribution, 300k draws. False failure: 1e-4 each."""
    assert chi_square(poisson(np.full(SHAPE, mean), generator(1)), mean) > 1e-4
    assert chi_square(poisson_alike(mean, SHAPE, generator(2)), mean) > 1e-4


class Even:
    """Stands in for a generator: its normal numbers are a million equal shares of the normal law, not drawn."""

    def standard_normal(self, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
        return norm.ppf((np.arange(shape[0]) + 0.5) / shape[0]).astype(dtype)


@pytest.mark.parametrize("mean", [MANY, 50.0, 1000.0])
def test_bent_normal_is_poissons_law_but_for_a_thousandth(mean: float) -> None:
    """Total variation, mean, variance and skewness of the whole distribution: nothing is random here."""
    counts = poisson(np.full(1_000_000, mean), Even())  # type: ignore[arg-type]
    shares = np.bincount(counts.astype(int), minlength=2000) / counts.size
    assert 0.5 * np.abs(shares - law.pmf(np.arange(shares.size), mean)).sum() < 7e-4
    away = counts.astype(float) - mean
    assert away.mean() == pytest.approx(0, abs=2e-4)
    assert np.mean(away**2) == pytest.approx(mean, rel=3e-4)
    assert np.mean(away**3) == pytest.approx(mean, rel=0.02)


def test_counts_of_a_picture_that_is_dark_here_and_bright_there_have_their_means() -> None:
    """Each of 64 columns' mean within 4.5 standard errors. False failure: 64 · 7e-6 = 5e-4."""
    mean = np.linspace(0.1, 200, 64)
    counts = poisson(np.broadcast_to(mean, (5000, 64)), generator(3))
    assert (np.abs(counts.mean(axis=0) - mean) < 4.5 * np.sqrt(mean / 5000)).all()


def test_dark_current_doubles_as_published() -> None:
    """4.8 K at -50 °C, 7.1 at 0, 8.1 at 20, 9.2 at 40, published to a tenth; and a short step agrees with the slope."""
    celsius = np.array([-50, 0, 20, 40])
    assert np.round(doubling_temperature_k(celsius), 1) == pytest.approx([4.8, 7.1, 8.1, 9.2])
    ratio = dark_current_ratio(celsius + 0.01, celsius - 0.01)
    assert doubling_temperature_k(celsius) == pytest.approx(0.02 * np.log(2) / np.log(ratio), rel=1e-6)


def test_dark_charge_grows_with_time_and_heat() -> None:
    """Mean dark charge D t within 5 standard errors, at two temperatures. False failure: 6e-7 each."""
    for temperature_c in (20.0, 45.0):
        exposure = BUSY.expose(np.zeros(SHAPE), 2.0, temperature_c, generator(4))
        expected = 60 * float(dark_current_ratio(temperature_c, 20))
        assert exposure.dark_electrons.mean() == pytest.approx(expected, abs=5 * (expected / PIXELS) ** 0.5)
        assert exposure.photoelectrons.max() == 0


@pytest.mark.parametrize("photons", [0.0, 40.0, 900.0, 20_000.0])
def test_photons_become_electrons_become_digital_numbers(photons: float) -> None:
    """Means of photoelectrons and DN, and the temporal variance of DN from two frames' difference.

    σ_y² = K² (σ_d² + D t + η μ_p) + 1/12. Means within 5 standard errors (the pattern's 1 % and 3 e⁻ included), the
    variance within 5 of its own, σ² sqrt(2/n). False failure: 2e-6.
    """
    rng, gain = generator(5), BUSY.gain_dn_per_e
    one, other = (BUSY.expose(np.full(SHAPE, photons), 0.1, 20, rng) for _ in range(2))
    electrons = 0.45 * photons
    noise_e = np.sqrt(10.9**2 + 3 + electrons)
    apart = one.dn.astype(float) - other.dn
    variance = gain**2 * noise_e**2 + 1 / 12
    assert apart.var() / 2 == pytest.approx(variance, rel=5 * (2 / PIXELS) ** 0.5)
    spread_e = np.sqrt(noise_e**2 + 3**2 + (0.01 * electrons) ** 2)
    assert one.photoelectrons.mean() == pytest.approx(electrons, abs=5 * spread_e / PIXELS**0.5)
    assert one.dn.mean() == pytest.approx(60 + gain * (electrons + 3), abs=5 * gain * spread_e / PIXELS**0.5 + 1e-3)


def test_full_well_stops_the_electrons_and_with_them_the_noise() -> None:
    exposure = BUSY.expose(np.full(SHAPE, 60_000.0), 0.1, 20, generator(6))
    assert (exposure.charge_e == 15_000).all()
    assert exposure.photoelectrons.min() > 15_000


def test_fixed_pattern_belongs_to_the_specimen_and_not_to_the_frame() -> None:
    """The same specimen has the same pattern, another one an unrelated one (|correlation| < 5/sqrt n: 6e-7)."""
    first, again, other = (sensor.pattern(*SHAPE) for sensor in (BUSY, replace(BUSY), replace(BUSY, specimen=1)))
    assert np.array_equal(first.gain, again.gain)
    assert np.array_equal(first.offset_e, again.offset_e)
    for a, b in ((first.gain, other.gain), (first.offset_e, other.offset_e), (first.gain, first.offset_e)):
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 5 / PIXELS**0.5


def test_averaged_frames_show_the_pattern_and_nothing_else() -> None:
    """The mean of 64 dark frames against the pattern: what is left has 1/8 of one frame's noise, within 2 %.

    The standard error of that deviation is 0.13 %. False failure: far below 1e-9.
    """
    rng = generator(7)
    frames = [BUSY.expose(np.zeros(SHAPE), 0, 20, rng).dn for _ in range(64)]
    left = (np.mean(frames, axis=0) - 60) / 0.2 - BUSY.pattern(*SHAPE).offset_e
    assert left.std() == pytest.approx(np.hypot(10.9, (1 / 12) ** 0.5 / 0.2) / 8, rel=0.02)


def test_light_is_weighed_by_each_pixels_own_response() -> None:
    """64 frames' mean over the mean, on the pattern's gain: a slope of 1, with a standard error of 2.3e-4.

    Within 5 of them: false failure 6e-7.
    """
    rng = generator(8)
    frames = [BUSY.expose(np.full(SHAPE, 22_000.0), 0, 20, rng).photoelectrons for _ in range(64)]
    gain = BUSY.pattern(*SHAPE).gain.astype(float)
    seen = np.mean(frames, axis=0, dtype=float) / 9900
    assert np.polyfit(gain.ravel() - 1, seen.ravel() - 1, 1)[0] == pytest.approx(1, abs=5 * 2.3e-4)


def test_rows_and_columns_carry_their_shares_of_a_pattern() -> None:
    """Variance of row and of column means over all: shares .5 and .2 within 5 σ, sqrt(2/480) and sqrt(2/640).

    False failure: 1e-6.
    """
    sensor = Sensor(dsnu_e=4, dsnu_row_share=0.5, dsnu_column_share=0.2, prnu=0.02, prnu_column_share=1)
    offset, gain = sensor.pattern(*SHAPE).offset_e, sensor.pattern(*SHAPE).gain
    assert offset.mean(axis=1).var() == pytest.approx(16 * 0.5, rel=5 * (2 / 480) ** 0.5)
    assert offset.mean(axis=0).var() == pytest.approx(16 * 0.2, rel=5 * (2 / 640) ** 0.5)
    assert np.ptp(gain, axis=0).max() < 1e-6
    assert gain.std() == pytest.approx(0.02, rel=5 * (1 / 1280) ** 0.5)


def test_steps_do_what_they_say() -> None:
    assert fill([5, 25], 20).tolist() == [5, 20]
    assert amplify([0, 100], 0.25, 10).tolist() == [10, 35]
    assert quantise([-3.0, 0.4, 0.6, 254.7, 300.0], 8).tolist() == [0, 0, 1, 255, 255]
    assert read([3.0], [0.5], 0, generator(0)).tolist() == [3.5]


def test_threshold_and_dynamic_range_of_the_reference_data_set() -> None:
    """The emva1288 project's reference camera: K = .280769, η = 45.136 %, σ_d = 10.898 e⁻, SNR_max = 41.453 dB.

    μ_p.sat = 30957 photons is the figure it publishes. Its 61.732 dB are over σ + ½; over the exact threshold 61.723.
    """
    sensor = Sensor(0.45136, 0.45136 * 30957, 10.898, 0.280769, offset_dn=0, bits=12)
    assert decibel(sensor.dynamic_range()) == pytest.approx(61.723, abs=0.001)
    approximate = (np.hypot(10.898, (1 / 12) ** 0.5 / 0.280769) + 0.5) / 0.45136
    assert decibel(30957 / approximate) == pytest.approx(61.732, abs=0.001)
    assert decibel(sensor.snr(30957)) == pytest.approx(41.453, abs=0.05)
    assert decibel(sensor.saturation_e**0.5) == pytest.approx(41.453, abs=0.005)


def test_signal_equals_noise_at_the_threshold() -> None:
    """Exactly so: ½ + sqrt(σ² + ¼) solves it. The σ + ½ that EMVA 1288 prints is within 3 % where σ is above 2."""
    assert BUSY.snr(BUSY.threshold_photons(0.1, 20), 0.1, 20) == pytest.approx(1, abs=1e-12)
    quiet = Sensor(1.0, 10_000, 0.0, gain_dn_per_e=100.0, bits=16)
    assert quiet.threshold_photons() == pytest.approx(1, abs=1e-4)  # SNR = √μ, so that a single electron has 1


def test_efficiency_has_a_wavelength_and_includes_the_fill_factor_or_not() -> None:
    curve = EfficiencyCurve((400, 500, 600), (0.2, 0.6, 0.4))
    sensor = Sensor(curve, measured_at_nm=450, fill_factor=0.5)
    assert sensor.efficiency() == pytest.approx(0.2)
    assert sensor.efficiency([300, 550, 700]) == pytest.approx([0, 0.25, 0])
    assert Sensor(0.3).efficiency([400, 500]).tolist() == [0.3, 0.3]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("quantum_efficiency", 1.2),
        ("fill_factor", 0.0),
        ("bits", 17),
        ("bits", 12.0),
        ("full_well_e", np.inf),
        ("read_noise_e", -1.0),
        ("gain_dn_per_e", 0.0),
        ("offset_dn", np.nan),
        ("prnu_row_share", 1.5),
    ],
)
def test_a_sensor_that_cannot_be_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        replace(BUSY, **{name: value})


def test_pictures_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="photons must be one number for each pixel"):
        BUSY.expose(np.zeros((4, 4, 3)), 1, 20, generator(0))
    with pytest.raises(ValueError, match="photons must be finite"):
        BUSY.expose(np.full((4, 4), np.nan), 1, 20, generator(0))
    with pytest.raises(ValueError, match="exposure_s"):
        BUSY.expose(np.zeros((4, 4)), -1, 20, generator(0))
    with pytest.raises(ValueError, match="absolute zero"):
        BUSY.dark_current(-300)
