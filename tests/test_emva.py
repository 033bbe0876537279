"""What goes into a simulated sensor comes out of the measurement, and published frames give their published figures.

Every random test draws with a fixed seed, so that it passes or fails for good; "false failure" is how often a correct
measurement would fail it if the seed were drawn anew.
"""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from camviz.sensors import Sensor, decibel
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.recording import measure, read_recording
from camviz_clinic.measuring.noise.statistics import pair, stack

HEIGHT, WIDTH = 480, 640
LEVELS = 50
ROOM_C = 20.0


def generator(seed):
    return np.random.Generator(np.random.SFC64(seed))


def random_sensor(rng):
    """A sensor like those that are sold, with patterns and dark current large enough to be measured."""
    gain = float(rng.uniform(0.15, 0.8))
    full_well = float(rng.uniform(0.6, 0.95)) * 3900 / gain
    return Sensor(
        quantum_efficiency=float(rng.uniform(0.2, 0.9)),
        full_well_e=full_well,
        read_noise_e=float(rng.uniform(1.0, 3.0)) / gain,
        gain_dn_per_e=gain,
        offset_dn=64.0,
        dark_current_e_per_s=float(rng.uniform(0.01, 0.04)) * full_well,
        dsnu_e=float(rng.uniform(1.0, 3.0)) / gain,
        prnu=float(rng.uniform(0.006, 0.02)),
        specimen=int(rng.integers(1 << 30)),
    )


def frame(sensor, photons, exposure_s, rng):
    return sensor.expose(np.full((HEIGHT, WIDTH), photons, np.float32), exposure_s, ROOM_C, rng).dn


def measured(sensor, rng, stacks=8):
    """The measurement of a sensor: 50 exposures to a steady light that takes it to 1.15 of saturation in a second."""
    light = 1.15 * sensor.saturation_e / sensor.quantum_efficiency  # photons per second
    levels = []
    for exposure in np.linspace(0.02, 1.0, LEVELS):
        shots = [[frame(sensor, photons, exposure, rng) for _ in range(2)] for photons in (light * exposure, 0.0)]
        levels.append(Level.of(exposure, *shots, light * exposure))
    half = 0.5 / 1.15
    pictures = [stack(frame(sensor, p, half, rng) for _ in range(stacks)) for p in (light * half, 0.0)]
    return Measurement(tuple(levels), *pictures)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_what_goes_into_a_random_sensor_comes_out(seed):
    """K and η within 0.5 %, σ_d within 1 %, PRNU and DSNU within 3 %, dark current within 2 %.

    300k pixels: one variance is known to sqrt(2/N) = 0.26 %, a fit of 34 of them to 0.07 %; the intercept of 50 to
    0.08 %, half of that in σ_d; a pattern's deviation to about 0.3 %. False failure: below 1e-6 for each sensor.
    """
    rng = generator([15, seed])
    sensor = random_sensor(rng)
    found = measured(sensor, rng)
    assert found.gain_dn_per_e == pytest.approx(sensor.gain_dn_per_e, rel=0.005)
    assert found.quantum_efficiency == pytest.approx(sensor.quantum_efficiency, rel=0.005)
    assert found.read_noise_e == pytest.approx(sensor.read_noise_e, rel=0.01)
    assert found.prnu == pytest.approx(sensor.prnu, rel=0.03)
    assert found.dsnu_e == pytest.approx(sensor.dsnu_e, rel=0.03)
    assert found.dark_current_e_per_s == pytest.approx(sensor.dark_current_e_per_s, rel=0.02)
    # The variance peaks where the first pixels fill, and dark electrons fill them too: below, by noise and pattern.
    assert 0.88 * sensor.saturation_e < found.full_well_e < 1.02 * sensor.saturation_e
    pairs_only = replace(found, bright=None, dark=None)
    assert pairs_only.prnu == pytest.approx(sensor.prnu, rel=0.03)
    assert pairs_only.dsnu_e == pytest.approx(sensor.dsnu_e, rel=0.03)


# The statistics -------------------------------------------------------------------------------------------------------


def test_two_frames_tell_noise_from_pattern():
    """Noise of 5 DN on a pattern of 12 DN: the difference sees 25 DN², half of its 50; one frame alone sees 169.

    100k pixels: sqrt(2/N) = 0.45 % on each. False failure: 1e-5 each (2 % is 4.5 standard deviations).
    """
    rng = generator(1)
    pattern = rng.normal(300, 12, (250, 400))
    a, b = (pattern + rng.normal(0, 5, pattern.shape) for _ in range(2))
    seen = pair(a, b)
    assert seen.variance == pytest.approx(25, rel=0.02)
    assert seen.pattern == pytest.approx(144, rel=0.02)
    assert seen.variance == pytest.approx(np.var(a - b) / 2, rel=1e-9)
    assert seen.pattern == pytest.approx(np.cov(a.ravel(), b.ravel())[0, 1], rel=1e-4)


def test_a_light_that_flickers_between_the_frames_is_no_noise_of_the_sensor():
    rng = generator(2)
    a, b = (100 + rng.normal(0, 3, (200, 300)) for _ in range(2))
    assert pair(a, b + 40).variance == pytest.approx(pair(a, b).variance, rel=1e-9)


@pytest.mark.thorough
def test_one_frame_with_one_percent_prnu_gives_more_than_twice_the_gain():
    """K = 0.280 comes out as 0.623 from one frame of levels up to 16 300 electrons with 1 % PRNU.

    The spatial variance is K² (μ + (0.01 μ)²), so that the slope through the origin is K (1 + 1e-4 Σμ³ / Σμ²).
    150k pixels: 0.1 % on either slope from noise, 0.2 % from the pattern. False failure: 1e-6.
    """
    rng = generator(3)
    sensor = Sensor(0.45, 30_000, 8.0, 0.28, 64.0, 14, prnu=0.01)
    electrons = np.linspace(0, 16_300, 41)[1:]
    signal, one, two = [], [], []
    for photons in electrons / 0.45:
        a, b = (sensor.expose(np.full((300, 500), photons), 0, ROOM_C, rng).dn for _ in range(2))
        signal.append(a.mean() - 64)
        one.append(np.var(a, ddof=1) - (0.28 * 8) ** 2)
        two.append(pair(a, b).variance - (0.28 * 8) ** 2)
    gains = [np.dot(signal, variance) / np.dot(signal, signal) for variance in (one, two)]
    assert gains[0] == pytest.approx(0.28 * (1 + 1e-4 * np.sum(electrons**3) / np.sum(electrons**2)), rel=0.01)
    assert gains[0] == pytest.approx(0.623, rel=0.025)
    assert gains[1] == pytest.approx(0.280, rel=0.005)


def test_a_pattern_is_split_into_rows_columns_and_pixels():
    """Against the very fields that were put in. 480 rows and 640 columns: their own variances are taken as drawn."""
    rng = generator(4)
    row, column, pixel = rng.normal(0, 2, (480, 1)), rng.normal(0, 3, (1, 640)), rng.normal(0, 4, (480, 640))
    seen = stack(500 + row + column + pixel + rng.normal(0, 6, (480, 640)) for _ in range(20))
    split = seen.split()
    assert split["row"] == pytest.approx(np.var(row), rel=0.02)
    assert split["column"] == pytest.approx(np.var(column), rel=0.02)
    assert split["pixel"] == pytest.approx(np.var(pixel), rel=0.02)
    assert sum(split.values()) == pytest.approx(seen.pattern, rel=1e-3)
    assert seen.variance == pytest.approx(36, rel=0.01)


def test_a_stack_of_two_frames_is_a_pair():
    """What averaging left over is taken off: the pattern of two frames is their covariance."""
    rng = generator(6)
    pattern = rng.normal(100, 3, (90, 120))
    a, b = (pattern + rng.normal(0, 10, pattern.shape) for _ in range(2))
    two = stack([a, b])
    assert two.pattern == pytest.approx(np.cov(a.ravel(), b.ravel())[0, 1], rel=1e-3)
    assert two.variance == pytest.approx(np.var(a - b) / 2 + (a.mean() - b.mean()) ** 2 / 2, rel=1e-9)


def test_the_gain_is_fitted_below_seventy_percent_of_saturation():
    """Whatever a sensor does to its noise just before it is full must not reach K."""
    levels = few_levels(Sensor(), np.linspace(0.05, 1, 20), 20_000)
    bent = tuple(
        replace(one, bright=replace(one.bright, variance=1.2 * one.bright.variance)) if one.exposure_s > 0.62 else one
        for one in levels
    )
    plain, spoilt = Measurement(levels), Measurement(bent)
    assert plain.exposures_s[plain.linear].max() == pytest.approx(0.55, abs=0.06)
    assert spoilt.gain_dn_per_e == pytest.approx(plain.gain_dn_per_e, rel=1e-12)


def test_the_equations_of_the_standard_split_a_pattern_alike():
    """s²_col and s²_pixel as EMVA 1288 release 4.0 writes them, section 8.2, in M rows and N columns.

    The standard takes off σ²_y / LM of columns, as of white noise. Here it is what the columns' means vary in time,
    which is the same but for chance.
    """
    rng = generator(5)
    pattern = rng.normal(100, 3, (40, 1)) + rng.normal(0, 1, (40, 50))
    frames = np.array([pattern + rng.normal(0, 5, (40, 50)) for _ in range(4)])
    seen = stack(frames)
    L, M, N = frames.shape
    rows = frames.mean(axis=2)
    columns = frames.mean(axis=1)
    noise_of_rows = np.sum((rows - rows.mean(axis=0) - rows.mean(axis=1)[:, None] + rows.mean()) ** 2) / 3 / 39
    noise_of_columns = np.sum((columns - columns.mean(axis=0) - columns.mean(axis=1)[:, None] + rows.mean()) ** 2) / 3
    cav = np.var(seen.picture.mean(axis=0)) - noise_of_columns / 50 / L
    rav = np.var(seen.picture.mean(axis=1)) - noise_of_rows * 39 / 40 / L
    # Without what the frames' means vary: that is the light's, and the same for every pixel.
    whole = np.var(seen.picture, ddof=1) - (seen.variance - np.var(frames.mean(axis=(1, 2)), ddof=1)) / L
    below = M * N - M - N
    assert seen.split()["pixel"] == pytest.approx(M * N / below * (whole - cav - rav))
    column = (M * N - M) / below * cav - N / below * (whole - rav)
    assert seen.split()["column"] == pytest.approx(column)
    cav, rav = (np.var(seen.picture.mean(axis=axis)) - seen.variance / L / frames.shape[1 + axis] for axis in (0, 1))
    parts = seen.parts
    assert abs(M * N / below * (seen.pattern - cav - rav) - parts["pixel"].variance) < parts["pixel"].error
    white = (M * N - M) / below * cav - N / below * (seen.pattern - rav)
    assert abs(white - parts["column"].variance) < parts["column"].error


# What cannot be known -------------------------------------------------------------------------------------------------


def few_levels(sensor, exposures, light, seed=7, size=(240, 320)):
    rng = generator(seed)

    def shot(photons, t):
        return [sensor.expose(np.full(size, photons, np.float32), t, ROOM_C, rng).dn for _ in range(2)]

    return tuple(Level.of(t, shot(light * t, t), shot(0, t), light * t) for t in exposures)


def test_without_saturation_there_is_no_full_well_and_the_gain_is_known_all_the_same():
    sensor = Sensor(prnu=0.01, dsnu_e=5)
    found = Measurement(few_levels(sensor, np.linspace(0.1, 0.5, 8), 10_000))
    assert np.isnan([found.full_well_e, found.figures()["snr_max_db"], found.figures()["dynamic_range_db"]]).all()
    assert "saturated" in found.why("full_well_e")
    assert found.gain_dn_per_e == pytest.approx(sensor.gain_dn_per_e, rel=0.08)
    assert found.why("gain_dn_per_e") == ""
    noise = found.dark_noise_dn / found.gain_dn_per_e
    faint = 0.5 + np.hypot(0.5, noise)  # as many electrons as the noise has, with their own: e² = σ² + e
    assert found.snr(faint) == pytest.approx(1, rel=1e-9)


def test_without_photons_all_but_the_quantum_efficiency_is_known():
    levels = few_levels(Sensor(prnu=0.02, dsnu_e=8, dark_current_e_per_s=300), np.linspace(0.05, 1, 20), 20_000)
    lit = Measurement(levels)
    unlit = Measurement(tuple(replace(one, photons=np.nan) for one in levels))
    missing = [name for name, value in unlit.figures().items() if not np.isfinite(value)]
    assert set(missing) - {name for name, value in lit.figures().items() if not np.isfinite(value)} == {
        "quantum_efficiency",
        "threshold_photons",
    }
    assert "photons per pixel are not known" in unlit.why("quantum_efficiency")
    assert decibel(unlit.dynamic_range) == pytest.approx(decibel(lit.dynamic_range), abs=0.2)


def test_a_black_level_that_cuts_the_noise_off_is_noticed():
    found = Measurement(few_levels(Sensor(offset_dn=1.0), np.linspace(0.05, 1, 12), 20_000))
    assert np.isnan(found.read_noise_e)
    assert "black level" in found.why("read_noise_e")


def test_twelve_bits_in_the_upper_bits_of_sixteen_are_the_same_sensor():
    levels = few_levels(Sensor(read_noise_e=1.5), np.linspace(0.05, 1, 12), 20_000)
    shifted = tuple(
        replace(
            one,
            bright=replace(one.bright, mean=16 * one.bright.mean, variance=256 * one.bright.variance),
            dark=replace(one.dark, mean=16 * one.dark.mean, variance=256 * one.dark.variance),
        )
        for one in levels
    )
    plain, upper = Measurement(levels), Measurement(shifted, step=16)
    assert upper.gain_dn_per_e == pytest.approx(16 * plain.gain_dn_per_e)
    assert upper.read_noise_e == pytest.approx(plain.read_noise_e)


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        (lambda lit: lit[:1], "at least two levels"),
        (lambda lit: tuple(replace(one, bright=one.dark, dark=one.bright) for one in lit), "changed places"),
        (lambda lit: tuple(replace(one, bright=replace(one.bright, variance=0.0)) for one in lit), "saturated"),
    ],
)
def test_levels_that_make_no_sense_are_refused(levels, said):
    with pytest.raises(ValueError, match=said):
        Measurement(levels(few_levels(Sensor(), (0.1, 0.2, 0.3), 10_000)))


# Published frames -----------------------------------------------------------------------------------------------------


@cache
def measured_at(folder: Path) -> Measurement:
    return measure(read_recording(folder))


def published(name: str) -> Measurement:
    folder = Path(os.environ.get("CAMVIZ_SAMPLES", "")) / "emva1288" / name
    if not (os.environ.get("CAMVIZ_SAMPLES") and folder.is_dir()):
        pytest.skip(f"needs {name} of github.com/EMVA1288/datasets in the folder emva1288 of CAMVIZ_SAMPLES")
    return measured_at(folder)


def test_the_published_figures_of_a_real_camera_come_out_of_its_frames():
    """EMVA1288_ReferenceSet_001, a CCD measured by Basler, and the result file that the emva1288 project publishes.

    Its threshold is the standard's σ + ½. Its SNR and dynamic range say 95.45 and 142.14 dB, by the natural logarithm;
    here is what 20 log10 of them is.
    """
    found = published("EMVA1288_ReferenceSet_001_CCD_12Bit")
    assert found.gain_dn_per_e == pytest.approx(0.280769280926, rel=1e-5)
    assert found.quantum_efficiency == pytest.approx(0.451356082834, rel=1e-5)
    assert found.responsivity == pytest.approx(0.126726922819, rel=1e-9)
    assert found.read_noise_e == pytest.approx(10.8980275235, rel=1e-5)
    sigma = found.dark_noise_dn / found.gain_dn_per_e
    assert (sigma + 0.5) / found.quantum_efficiency == pytest.approx(25.3600660517, rel=1e-5)
    assert found.threshold_photons == pytest.approx((0.5 + np.hypot(sigma, 0.5)) / found.quantum_efficiency, rel=1e-9)
    assert found.full_well_e == pytest.approx(13972.6302563, rel=1e-5)
    assert 20 * np.log10(found.snr_max) == pytest.approx(41.453, abs=0.001)
    assert 20 * np.log10(found.dynamic_range) == pytest.approx(61.723, abs=0.001)  # published: 61.732, by σ + ½
    assert found.prnu == pytest.approx(0.00432704411062, rel=1e-5)
    assert found.bright.pattern == pytest.approx(72.4247416075, rel=1e-4)
    assert found.dark.pattern == pytest.approx(0.0240017725878, rel=1e-3)
    assert found.linearity[:2] == pytest.approx((-0.00615797581149, 0.00480448332752), rel=1e-6)
    assert 20 * np.log(found.snr_max) == pytest.approx(95.4485571343, abs=1e-3)


def test_the_published_light_falls_smoothly_across_the_frames():
    """A paraboloid, fitted with NumPy, has more than half of PRNU²: lesson 15 says so, and that PRNU is withheld.

    The frames are full where that light is brightest, which may take the published saturation capacity further than 3 %
    from the truth. A value that is nearer to both of its bounds is told instead.
    """
    found = published("EMVA1288_ReferenceSet_001_CCD_12Bit")
    picture = found.bright.picture - found.dark.picture
    v, u = np.indices(picture.shape) / np.reshape(picture.shape, (2, 1, 1)) - 0.5
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1).reshape(-1, 6)
    smooth = terms @ np.linalg.lstsq(terms, picture.ravel())[0]
    assert smooth.var() / picture.mean() ** 2 > 0.5 * 0.00432704411062**2
    prnu = found.judged["prnu"]
    assert np.isnan(prnu.value)
    assert (prnu.low, prnu.high) == pytest.approx((0.0028, 0.0044), abs=0.00005)
    assert "changes smoothly across the picture" in prnu.why
    full = found.judged["full_well_e"]
    assert full.low < 13972.6302563 < full.high / 1.03
    assert full.high / 1.03 < full.value < full.low * 1.03


def test_flicker_of_the_published_light_was_counted_as_noise():
    """Release 4.0 of the standard takes it out, and the gain is a quarter of a percent less."""
    found = published("EMVA1288_ReferenceSet_001_CCD_12Bit")
    assert found.flicker_counts
    assert replace(found, flicker_counts=False).gain_dn_per_e == pytest.approx(0.28006, abs=2e-5)


def test_a_published_simulation_is_as_its_authors_say():
    """EMVA1288_ReferenceSet_003, by Jähne: η = 0.5, K = 0.1, σ_d = 30 e⁻, up to 2 % nonlinear."""
    found = published("EMVA1288_ReferenceSet_003_Simulation_12Bit")
    assert found.quantum_efficiency == pytest.approx(0.5, rel=0.01)
    assert found.gain_dn_per_e == pytest.approx(0.1, rel=0.025)
    assert found.read_noise_e == pytest.approx(30, rel=0.025)
    assert found.dsnu_e == pytest.approx(10 * np.hypot(1.5, 1.5), rel=0.05)  # white, and two sines of 1.5 DN
