"""What lesson 15 claims about noise, recomputed with NumPy's and SciPy's random numbers and OpenCV's JPEG."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy import signal
from scipy.constants import physical_constants

from camviz.scenes import to_display
from camviz.sensors import decibel
from camviz_clinic.measuring.noise.statistics import pair
from camviz_school.course import material, notebooks

says = claims("15")
lesson15 = material.module("15")

K_PUBLISHED, ETA, SIGMA_D, PHOTONS, PRNU = 0.280769280926, 0.451356082834, 10.8980275235, 30_957, 0.00432704411062
"""Of the emva1288 project's set 001, as its result file has them."""


def db(ratio):
    return 20 * np.log10(ratio)


def through_the_origin(x, y):
    return float(np.linalg.lstsq(np.asarray(x)[:, None], np.asarray(y), rcond=None)[0][0])


def cell_with(words):
    (path,) = material.lessons_folder().glob("15_*.ipynb")
    return next(one.source for one in notebooks.read(path).cells if words in one.source)


def test_light_itself_is_noisy():
    says("100 electrons are never known better than to 10 %.", "is √μ: from about 22 to 45 electrons")
    drawn = np.random.default_rng(2).poisson([[100], [500], [2000]], (3, 1_000_000)).std(axis=1)
    assert drawn == pytest.approx([10, 22.4, 44.7], rel=0.01)
    says("A card of 400 electrons, read noise 8, PRNU 2 %:")
    rng = np.random.default_rng(15)
    counts = rng.poisson(400 * (1 + 0.02 * rng.standard_normal(1_000_000))) + 8 * rng.standard_normal(1_000_000)
    assert lesson15.total_noise(np.array(400.0), 8.0, 0.02) == pytest.approx(counts.std(), rel=0.005)


def test_the_line_of_slope_a_half_stands_at_the_root_of_k():
    """Poisson counts times K: their deviation over the root of their mean, both in DN, is √K."""
    says("it is σ = √(K · signal), so at a signal of 1 DN its height is √K")
    counts = np.random.default_rng(15).poisson(4_000, 400_000)
    for K in (0.25, 2.0):
        assert np.std(K * counts) / np.sqrt(np.mean(K * counts)) == pytest.approx(np.sqrt(K), rel=0.01)


def test_one_frame_hides_the_gain_and_two_tell_it():
    says("up to 15,000 electrons. You take the variance", "The pixels differ in their response by 1 %.")
    says("with exposures spread evenly up to 15,000 electrons it comes out 2.1 times too large")
    says("At 10,000 electrons (0.01 · 10,000)² = 10,000: 1 % of pattern has already doubled the variance.")
    assert pytest.approx(10_000) == (0.01 * 10_000) ** 2
    rng, levels = np.random.default_rng(4), np.linspace(0, 15_000, 31)[1:]
    response = 1 + 0.01 * rng.standard_normal(100_000)
    frames = [(rng.poisson(n * response), rng.poisson(n * response)) for n in levels]
    one, two = ([f(*both) for both in frames] for f in (lambda a, _: np.var(a), lambda a, b: np.var(a - b) / 2))
    assert through_the_origin(levels, one) == pytest.approx(2.1, abs=0.05)
    assert through_the_origin(levels, two) == pytest.approx(1, abs=0.01)
    bright, dark = (0.28 * rng.poisson(n, (2, 300, 400)) + 60 for n in (4000, 100))
    assert lesson15.gain(bright, dark) == pytest.approx(0.28, rel=0.02)
    says("√(8.1/2 − 1/12) / 0.25 = 8.0 electrons of read noise.")
    assert np.sqrt(8.1 / 2 - np.var(np.linspace(-0.5, 0.5, 100_001))) / 0.25 == pytest.approx(8.0, abs=0.05)


def test_dark_current_doubles_every_8_kelvin():
    """T^1.5 exp(−E_g / 2kT) with Varshni's band gap (Janesick 2001, chapter 7)."""
    says("the charge doubles about every 8 K at room temperature", "Take the temperature down to −30 °C.")
    k = physical_constants["Boltzmann constant in eV/K"][0]

    def log_current(celsius):
        T = celsius + 273.15
        return 1.5 * np.log(T) - (1.1557 - 7.021e-4 * T**2 / (1108 + T)) / (2 * k * T)

    assert np.log(2) / (log_current(20.5) - log_current(19.5)) == pytest.approx(8, abs=0.5)
    assert np.exp(log_current(-30) - log_current(20)) < 0.01


def test_averaging_leaves_the_pattern():
    says("the noise falls from 15.1 electrons to 10.2 only, and what is left is nearly all pattern")
    electrons = 0.4 * 10_000 / 64
    pattern, in_time = 10**2 + (0.02 * electrons) ** 2, 8**2 + electrons + 1 / 12 / (0.97 * 4095 / 15_000) ** 2
    noise = np.sqrt([in_time + pattern, in_time / 64 + pattern])
    assert noise == pytest.approx([15.1, 10.2], abs=0.05)
    says("A single dark frame makes the darkness √2 times as noisy as it was.")
    dark = np.random.default_rng(8).standard_normal((17, 100_000))
    assert np.std(dark[0] - dark[1]) == pytest.approx(np.sqrt(2), rel=0.01)
    assert np.std(dark[0] - dark[1:].mean(axis=0)) < 1.05
    says("The transform 2√(e + ⅜ + σ_d²) makes it about **1** everywhere")
    for electrons in (3, 30, 3000):
        seen = np.random.default_rng(9).poisson(electrons, 400_000) + np.random.default_rng(1).normal(0, 5, 400_000)
        assert np.std(2 * np.sqrt(np.maximum(seen + 3 / 8 + 25, 0))) == pytest.approx(1, abs=0.03)


def test_a_published_file_has_the_wrong_logarithm():
    says("or 95.45 dB, and a dynamic range of 1220.7, or 142.14 dB", "Every figure was 2.3026 times too large")
    sigma = np.hypot(SIGMA_D, np.sqrt(1 / 12) / K_PUBLISHED)
    ratio = PHOTONS * ETA / (sigma + 0.5)
    assert ratio == pytest.approx(1220.69871336, rel=1e-5)
    assert [20 * np.log(118.205880802), 20 * np.log(ratio)] == pytest.approx([95.45, 142.14], abs=5e-3)
    assert np.log(10) == pytest.approx(2.3026, abs=5e-5)
    assert decibel(ratio) == pytest.approx(db(ratio))
    says("The published camera needs 25.4 photons.", "The published PRNU is 0.43 %.")
    needed = lesson15.threshold_photons(sigma, ETA)
    assert [needed, 1000 * PRNU] == pytest.approx([25.4, 4.3], abs=0.05)
    assert (ETA * needed) ** 2 == pytest.approx(sigma**2 + ETA * needed)  # a signal equal to its noise
    says("finds K = 0.2808 DN/e⁻, a quantum efficiency of 45.1 % and σ_d = 10.9 e⁻, as published.")
    assert pytest.approx([2.808, 45.1, 10.9], abs=0.05) == [10 * K_PUBLISHED, 100 * ETA, SIGMA_D]


def test_the_merged_bracket_has_the_least_noise():
    says("With σ_d = 6 a pixel counts 30 electrons in 0.01 s and 2,000 in 0.64 s.")
    x = (30 + 2000) / 0.65
    short, long = (np.hypot(6, np.sqrt(x * t)) / t for t in (0.01, 0.64))
    assert (short / long) ** 2 == pytest.approx(135, abs=0.5)  # as the cell below it prints
    rng, times = np.random.default_rng(11), np.array([0.1, 1.0])
    counts = rng.poisson(500 * times[:, None], (2, 200_000)) + 6 * rng.standard_normal((2, 200_000))
    best = lesson15.merge(counts, times, 6.0, 1e9).std()
    for share in np.linspace(0, 1, 21):
        assert best < 1.002 * np.std(share * counts[0] / times[0] + (1 - share) * counts[1] / times[1])


def test_stripes_are_split_as_the_sensor_has_them():
    """Against what is put in, and the split of `camviz noise`. False failure: below 1e-4 (4 standard deviations)."""
    rng = np.random.default_rng(31)
    frames = [rng.normal(0, 8, (900, 1200)) + rng.normal(0, 2, (900, 1)) + rng.normal(0, 3, 1200) for _ in range(2)]
    split = lesson15.stripes(frames[0])
    assert [one / right for one, right in zip(split, (4, 9, 64), strict=True)] == pytest.approx([1] * 3, rel=0.19)
    assert split[2] == pytest.approx(64, rel=0.006)
    ours, seen = lesson15.stripes(frames[0] - frames[1]), pair(*frames)
    camviz_s = np.array([seen.row_variance, seen.column_variance, seen.within])
    np.testing.assert_allclose(np.array(ours) / 2, camviz_s, rtol=0.01)


def test_the_stripes_and_their_spectrum():
    says("In the spectrum it is the peak at 1/6 cycle per row: it repeats after six rows.")
    names = {"np": np}
    exec(cell_with("def in_the_dark"), names)
    lines, spectrum = signal.periodogram(names["one"], axis=0, detrend=False)
    power = spectrum[1:-1].mean(axis=1) / 2  # one-sided, each frequency but the first and the last counted twice
    np.testing.assert_allclose(power, names["spectrum"][1:-1], rtol=1e-6)
    assert lines[1 + power.argmax()] == pytest.approx(1 / 6)
    says("Rows and pixels sink to a sixteenth, as they are drawn anew in every frame.")
    alone, many = (lesson15.stripes(one) for one in (names["darks"][0], np.mean(names["darks"], axis=0)))
    assert many[2] == pytest.approx(alone[2] / 16, rel=0.03)


def test_the_response_curve():
    """Held against sRGB after IEC 61966-2-1, on other pictures than the lesson's, by the lesson's own cell."""
    says("Between the values 30 and 230 both curves are within a twentieth of a stop of the truth.")
    values = np.arange(256) / 255
    true = np.log2(np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4) + 1e-9)
    light = 0.9 * np.random.default_rng(3).uniform(0.1, 1, (120, 160))
    names = {"np": np, "cv2": cv2, "to_display": to_display, "light": light}
    exec(cell_with("stops = np.arange"), names)
    for curve in (names["g"], names["opencv_g"]):
        assert np.abs((curve - curve[128]) - (true - true[128]))[30:231].max() < 1 / 20


def test_photons_stir_every_block():
    """A linear file, and sRGB's curve by IEC 61966-2-1, above its linear part."""
    says("At a grey value of 100 it holds 3,900 of them, and the photons' noise is 1.6 steps.")
    says("stands for 1,270 electrons, and the noise is 1.3 steps. Either is enough to stir every block.")
    share = np.array([100 / 255, ((100 / 255 + 0.055) / 1.055) ** 2.4])
    assert 10_000 * share == pytest.approx([3900, 1270], rel=0.006)
    linear, srgb = np.random.default_rng(12).poisson(10_000 * share[:, None], (2, 1_000_000)) / 10_000
    noise = [255 * np.std(linear), 255 * np.std(1.055 * srgb ** (1 / 2.4) - 0.055)]
    assert noise == pytest.approx([1.6, 1.3], abs=0.05)


def test_jpeg_raises_the_noise():
    says("Two frames of a grey wall in bright light are saved as JPEG of quality 95.")
    says("So quality 95 *raises* the noise of bright light, and K comes out near 0.5 where 0.38 is true.")
    says("The variance of the noise grows by more than a third.", "adds step²/12 to its variance, as any rounding does")
    rng, pattern = np.random.default_rng(1), np.random.default_rng(14).standard_normal((2, 120, 160))
    charge = rng.poisson(5400 * (1 + 0.012 * pattern[0]), (8, 2, 120, 160)) + 40 + 4 * pattern[1]
    frames = np.rint(0.38 * (charge + rng.normal(0, np.sqrt(6**2 + 40), charge.shape)) + 64)

    def saved(frame):
        data = cv2.imencode(".jpg", (frame / 16).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
        return 16.0 * cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)

    before = np.mean([np.var(one - other) / 2 for one, other in frames])
    after = np.mean([np.var(saved(one) - saved(other)) / 2 for one, other in frames])
    assert after > 4 / 3 * before
    gains = (np.array([before, after]) - 0.38**2 * 76) / (0.38 * 5400)
    assert gains[0] == pytest.approx(0.38, abs=5e-3)
    assert gains[1] == pytest.approx(0.5, abs=0.05)


def test_questions_light():
    says(
        "A pixel counts 2,500 electrons of light",
        "A pixel counts 400 electrons in the first.",
        "20 or 30 more or fewer.",
    )
    says("heat frees 100 electrons in each pixel during a minute", "You average 64 frames of the same scene.")
    says("A pixel of the grey card counts 500 electrons.", "√2,500 = 50 electrons is what they differ by.")
    says("By about 50 electrons, 2 %.", "With four times the light it would be 100 electrons, and only 1 %.")
    says(
        "Yes: each count scatters by √400 = 20, and two of them differ by 28.",
        "√64 = 8",
        "A count of 100 differs by 10 %",
    )
    assert np.sqrt([500, 2000, 2500, 10_000, 100, 64]) == pytest.approx([22.4, 44.7, 50, 100, 10, 8], abs=0.05)
    pairs = np.random.default_rng(19).poisson(400, (2, 1_000_000))
    assert [pairs[0].std(), np.subtract(*pairs).std()] == pytest.approx([20, 28], abs=0.5)
    says("The dark *charge* does: 400 electrons.", "their noise is the root: 20 electrons instead of 10.")


def test_questions_two_frames():
    says("The difference has a variance of 200 DN².", "100 DN².", "random noise has a variance of 30", "60.")
    rng = np.random.default_rng(18)
    wall = 500 + 20 * rng.standard_normal(1_000_000)
    for variance in (100, 30):
        difference = np.subtract(*(wall + np.sqrt(variance) * rng.standard_normal((2, 1_000_000))))
        assert np.var(difference) == pytest.approx(2 * variance, rel=0.01)
