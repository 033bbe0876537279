"""What lesson 15 says about sensor noise, recomputed with NumPy, SciPy and OpenCV."""

import cv2
import numpy as np
import pytest
from quoting import LESSONS
from scipy import signal
from scipy.constants import physical_constants

from camviz.scenes import to_display
from camviz.sensors import decibel
from camviz.sensors.correction import NoiseModel, merged
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.statistics import pair
from camviz_school.course import notebooks
from camviz_school.course.material import module
from camviz_school.views.noise import PhotonTransferView

lesson15 = module("15")

EXCEPTIONS: dict[str, str] = {
    "withholds it and says that it lies between 0.28 % and 0.44 %": "tests/test_emva.py measures it on the project's "
    "frames, which are not among the samples",
    "That alone lowers K to 0.2801 DN/e⁻, by a quarter of a per cent.": "tests/test_emva.py measures it on the "
    "project's frames, which are not among the samples",
}

REFERENCE = {  # the emva1288 project's set 001: what its descriptor and its result file say
    **{"levels": 50, "width": 640, "height": 480, "bits": 12},
    **{"K": 0.280769280926, "η": 0.451356082834, "σ_d": 10.8980275235, "photons": 30_957, "PRNU": 0.00432704411062},
}
FULL_WELL, WHITE, CARD = 15_000, 10_000, 0.4  # electrons; a second of white; the card's share of it


def printed():
    """All that the lesson's cells print."""
    (path,) = LESSONS.glob("15_*.ipynb")
    outputs = [output for cell in notebooks.read(path).cells for output in cell.get("outputs", [])]
    return "\n".join("".join(output.get("text", "")) for output in outputs)


def saved_views():
    """The descriptions of the pictures, and the questions, in the order in which a reader meets them."""
    (path,) = LESSONS.glob("15_*.ipynb")
    for cell in notebooks.read(path).cells:
        for output in cell.get("outputs", []):
            yield "".join(output.get("data", {}).get("text/plain", ""))


def through_the_origin(x, y):
    return float(np.linalg.lstsq(np.asarray(x)[:, None], np.asarray(y), rcond=None)[0][0])


def db(ratio):
    return 20 * np.log10(ratio)


# 1: a garden in bad light ---------------------------------------------------------------------------------------------


def test_nothing_tells_an_answer_before_its_question():
    """The noise on the card, K from the points and the slope of dark current's noise come after their questions."""
    seen = list(saved_views())
    for told, question in (
        ("on the card", "counts 500 electrons"),
        ("K from the curve", "find the gain K of a camera"),
        ("exposure 1/64 s", "You average 64 frames"),
    ):
        asked = next(i for i, words in enumerate(seen) if question in words)
        assert not any(told in words and "Photon transfer" in words for words in seen[:asked])
    assert "Photon transfer" in seen[0]
    quiet = PhotonTransferView(dark_current=0.0, fit=False).figure(draft=True).body
    assert "dark current" not in quiet
    assert "K from the curve" not in quiet


def test_a_perfect_camera_s_picture_is_grainy(says):
    (part,) = says("A garden at night, photographed in 1/256 s")
    dim = CARD * WHITE / part.value
    perfect = PhotonTransferView(
        exposure=-8.0, bits=14, prnu=0.0, dsnu_e=0.0, dark_current=0.0, read_noise_e=0.0, panels="picture"
    )
    assert part == 1 / perfect.exposure_s
    says("there the electronics of this camera add next to nothing.")
    assert (1 / 12) ** 0.5 / perfect.sensor.gain_dn_per_e < 0.1 * np.sqrt(dim)  # what is left of them is rounding
    says("It is still grainy, and a perfect camera could do no better.")
    counts = np.random.default_rng(1).poisson(dim, 100_000)
    assert counts.mean() / counts.std() < 5
    dn = perfect.image(draft=False)
    middle = dn[int(0.65 * len(dn)) : int(0.9 * len(dn)), int(0.75 * dn.shape[1]) : int(0.9 * dn.shape[1])]
    card = middle / perfect.sensor.gain_dn_per_e
    assert card.std() == pytest.approx(counts.std(), rel=0.03)  # some thousand pixels
    says("Which of the two kinds is the larger one depends on the light:")
    assert np.sqrt(dim) < 8 < np.sqrt(CARD * WHITE)
    for stops in (-8, -4, 0):
        card = CARD * WHITE * 2.0**stops
        noise = np.sqrt(card + 8**2 + 1 / 12 / (0.97 * 4095 / FULL_WELL) ** 2)
        kind = "read noise" if card < 64 else "photons"
        electrons = f"{card:,.0f}" if card >= 1000 else f"{card:.3g}"
        assert f"{electrons} e⁻ ± {noise:.3g}, SNR {card / noise:.3g}, mostly {kind}" in printed()


def test_a_full_card_has_hardly_any_noise(says):
    says("At the right end the card is full: hardly any noise is left, and no picture.")
    stops = PhotonTransferView.controls()["exposure"].high
    rng, steps = np.random.default_rng(1), 4095 * 0.97 / FULL_WELL
    expected = CARD * WHITE * 2**stops
    assert expected > FULL_WELL
    charge = np.minimum(rng.poisson(np.full(100_000, expected)), FULL_WELL)
    seen = np.clip(np.rint(steps * (charge + 8 * rng.standard_normal(100_000)) + 0.03 * 4095), 0, 4095)
    assert seen.std() / steps < 0.1 * np.sqrt(expected)
    full = PhotonTransferView(exposure=stops, prnu=0.0, dsnu_e=0.0, dark_current=0.0, fit=False)
    assert full.numbers()["on the card"] == "full, 15,000 e⁻"


def test_light_itself_is_noisy(says):
    electrons, percent = says("100 electrons are never known better than to 10 %.")
    drawn = np.random.default_rng(2).poisson(electrons.value, 1_000_000)
    assert percent == 100 * drawn.std() / drawn.mean()
    says("In good light nearly all this noise is the *light's*.")
    assert np.sqrt(4000) / np.sqrt(4000 + 8**2) > 0.99


def test_the_question_about_four_times_the_light(says):
    (electrons,) = says("A pixel of the grey card counts 500 electrons. You open the shutter four times as long.")
    before, after = says("The photons' noise is √μ: from about 22 to 45 electrons.")
    assert before == np.sqrt(electrons.value)
    assert after == np.sqrt(4 * electrons.value)
    says("The signal is four times as large, so signal to noise has doubled.")
    says("Near saturation the pattern can be the larger one, and then you are nearly right.")
    noise = [np.sqrt(8**2 + mu + (0.015 * mu) ** 2) for mu in (500, 2000, 3700, 14_800)]
    assert noise[1] / noise[0] == pytest.approx(2, abs=0.2)
    assert np.sqrt(14_800) < 0.015 * 14_800
    assert noise[3] / noise[2] > 2.9


# 3: the gain falls out ------------------------------------------------------------------------------------------------


def test_the_three_slopes(says):
    """Of dots measured on frames, each kind alone; `test_noise_view.py` has them one by one."""
    (percent,) = says("Some pixels answer light more strongly than others, here by 2 %.")
    quiet = {"read_noise_e": 0.0, "prnu": 0.0, "dsnu_e": 0.0, "dark_current": 0.0}
    for state, slope in (
        ({"read_noise_e": 30.0, "photon_noise": False}, 0),
        ({}, 0.5),
        ({"prnu": percent.value, "photon_noise": False}, 1),
    ):
        seen, noise, _ = PhotonTransferView(**quiet | state).measured()
        used = (seen > 200) & (seen < 3000)
        assert np.polyfit(np.log(seen[used]), np.log(noise[used]), 1)[0] == pytest.approx(slope, abs=0.03)
    assert percent == 100 * np.median(noise[used] / seen[used])


def test_four_bits_are_dithered_by_nothing(says):
    (bits,) = says("Take **bit depth** to 4. In the dark the points are gone: every pixel reads the same number")
    top = 2**bits.value - 1
    steps = 0.97 * top / FULL_WELL
    dark = np.random.default_rng(3).standard_normal(100_000) * np.hypot(8, 5) * steps + 0.03 * top
    assert np.rint(dark).std() == 0
    _, noise, _ = PhotonTransferView(bits=int(bits.value)).measured()
    assert (noise[:5] == 0).all()


def test_the_question_about_one_frame(says):
    top, percent = says(
        "up to 15,000 electrons. You take the variance of the pixels *within each frame* and fit a line through "
        "the origin, variance over signal. The pixels differ in their response by 1 %."
    )
    spread = percent.value / 100
    (pixels,) = says("K, since averaging over 300,000 pixels takes the differences out.")
    assert spread / np.sqrt(pixels.value) < 1e-4  # out of the mean it does
    again, share, level = says(
        "a fixed spread of 1 % of the signal adds (0.01 μ)², which at 10,000 electrons is as much as the photons' "
        "own variance."
    )
    assert share == spread == again.value / 100
    assert (share.value * level.value) ** 2 == pytest.approx(level.value)
    (too_large,) = says("A K that is about 1 % too large.")
    assert too_large == percent.value
    at, fraction, electrons, square, of_pattern = says(
        "At 10,000 electrons (0.01 · 10,000)² = 10,000: 1 % of pattern has already doubled the variance."
    )
    assert at == electrons.value
    assert square == (fraction.value * electrons.value) ** 2
    assert of_pattern == 100 * fraction.value
    highest, times = says("with exposures spread evenly up to 15,000 electrons it comes out 2.1 times too large")
    assert highest == top.value
    rng, K = np.random.default_rng(4), 0.28
    response = 1 + spread * rng.standard_normal(100_000)
    levels = np.linspace(0, top.value, 31)[1:]
    variances = [np.var(K * rng.poisson(level * response)) for level in levels]
    assert times == through_the_origin(K * levels, variances) / K
    says("A K that is far too large, about twice the true one.")


def test_the_difference_of_two_frames_has_the_gain(says):
    (percent,) = says("What is left has slopes 0 and ½ only, and K comes out right to 2 %, whatever the PRNU.")
    found = []
    for prnu in (0.0, 2.0, 6.0):
        view = PhotonTransferView(prnu=prnu, dark_current=0.0, difference=True)
        signal, noise, dark = view.measured(3000)
        used = signal < 0.7 * signal[np.argmax(noise)]
        found.append(through_the_origin(signal[used], (noise**2 - dark**2)[used]) / view.sensor.gain_dn_per_e)
    assert np.abs(np.array(found) - 1).max() < percent.value / 100
    assert np.ptp(found) < 0.005


def test_our_own_sensor_gives_back_what_was_put_in(says):
    K, read = says("Its K is 0.25 and its read noise 8 electrons, but forget that for a moment.")
    twice, twelfth, again, twelve, divisor, electrons = says(
        "Half of the darks' 8.1 DN² is the noise of one frame in the dark, and 1/12 DN² of it is rounding: "
        "√(8.1/2 − 1/12) / 0.25 = 8.0 electrons of read noise. So many were put in."
    )
    assert twice.value == again.value
    assert electrons == np.sqrt(twice.value / 2 - np.var(np.linspace(-0.5, 0.5, 100_001))) / K.value
    assert electrons == read.value
    assert divisor == K.value
    assert twelfth == twelve.value == round(1 / np.var(np.linspace(-0.5, 0.5, 100_001)))
    rng = np.random.default_rng(6)
    response = 1 + 0.015 * rng.standard_normal((200, 300))

    def shoot(electrons):
        charge = rng.poisson(electrons * response) + read.value * rng.standard_normal(response.shape)
        return np.rint(K.value * charge + 60)

    dark = np.var(shoot(0) - shoot(0)) / 2
    levels = np.linspace(500, 10_000, 12)
    variances = [np.var(shoot(level) - shoot(level)) / 2 - dark for level in levels]
    assert through_the_origin(K.value * levels, variances) == K
    assert 2 * dark == pytest.approx(twice.value, abs=0.2)
    assert f"darks' difference: {twice.text:>7} DN²" in printed()


# 4: darkness ----------------------------------------------------------------------------------------------------------


def dark_current(celsius):
    """T^1.5 exp(−E_g / 2kT) with Varshni's band gap, in any unit (Janesick 2001, chapter 7)."""
    T = celsius + 273.15
    gap = 1.1557 - 7.021e-4 * T**2 / (1108 + T)
    return T**1.5 * np.exp(-gap / (2 * physical_constants["Boltzmann constant in eV/K"][0] * T))


def doubling(celsius):
    step = 1e-3
    slope = (np.log(dark_current(celsius + step)) - np.log(dark_current(celsius - step))) / (2 * step)
    return np.log(2) / slope


def test_the_question_about_darkness(says):
    celsius, electrons = says("In the dark, at 20 °C, heat frees 100 electrons in each pixel during a minute.")
    (charge,) = says("The dark *charge* does: 400 electrons.")
    after, before = says("their noise is the root: 20 electrons instead of 10.")
    assert charge == 4 * electrons.value
    assert before == np.sqrt(electrons.value)
    assert after == np.sqrt(charge.value)
    times, kelvin = says(
        "The charge is four times as large, its noise √4 times. Warming the sensor by a few kelvin does the same "
        "as time: the charge doubles about every 8 K at room temperature"
    )
    assert times == charge.value / electrons.value
    assert kelvin == doubling(celsius.value)


def test_cold_takes_the_dark_current_away(says):
    (celsius,) = says("Take the temperature down to −30 °C. Less than a hundredth")
    assert dark_current(celsius.value) / dark_current(20) < 0.01
    for at in (-50, 0, 20, 40):
        assert f"at {at:3} °C the dark current doubles with every {doubling(at):.1f} K" in printed()


# 5: putting it right --------------------------------------------------------------------------------------------------


def test_the_question_about_averaging(says):
    (frames,) = says("You average 64 frames of the same scene.")
    (same,) = says("The fixed pattern is the same in all 64")
    count, root = says("What changes from frame to frame falls by √64 = 8.")
    (times,) = says("64 times: noise is divided by the number of frames.")
    errors = np.random.default_rng(7).standard_normal((20_000, int(frames.value)))
    said, sums, divided = says(
        "The *sum* of 64 independent errors is 8 times one of them, since chance cancels in part; divided by 64 "
        "that is an eighth."
    )
    assert same == count.value == times.value == said.value == divided.value == frames.value
    assert root == 1 / errors.mean(axis=1).std()
    assert sums == errors.sum(axis=1).std()
    assert errors.mean(axis=1).std() == pytest.approx(1 / 8, rel=0.02)
    many, least = says("Photons and reading sink with every frame, by √64 = 8 in the end.")
    assert least == np.sqrt(many.value)
    one, all_of_them = says(
        "The pattern does not: the noise falls from 15.1 electrons to 10.2 only, and what is left is nearly all "
        "pattern."
    )
    electrons = CARD * WHITE / 64  # at −6 stops
    rounding = 1 / 12 / (0.97 * 4095 / FULL_WELL) ** 2
    pattern = 10**2 + (0.02 * electrons) ** 2
    in_time = 8**2 + electrons + rounding
    assert one == np.sqrt(in_time + pattern)
    assert all_of_them == np.sqrt(in_time / many.value + pattern)
    assert pattern / all_of_them.value**2 > 0.9
    (high,) = says("Move **frames averaged** from 1 to 64.")
    control = PhotonTransferView.controls()["frames"]
    assert (control.low, control.high) == (1, high.value)
    says("where photons rule, four times as much makes the picture twice as clean")
    assert np.sqrt(4 * 4000) / np.sqrt(4000) == 2


def test_what_a_dark_frame_costs(says):
    averaged, once = says(
        "Every frame that you subtract or divide by brings noise of its own, which is why 16 are averaged. A "
        "single dark frame makes the darkness √2 times as noisy as it was."
    )
    (again,) = says("noise in the dark, √2 times as much if it is a single one")
    dark = 8 * np.random.default_rng(8).standard_normal((1 + int(averaged.value), 100_000))
    alone = np.std(dark[0] - dark[1]) / 8
    assert once == again.value == round(alone**2)
    assert np.std(dark[0] - dark[1:].mean(axis=0)) / 8 < 1.05
    says("photon and read noise, all but 1/√n of it")


def test_a_transform_that_makes_noise_one(says):
    says("The transform 2√(e + ⅜ + σ_d²) makes it about **1** everywhere")
    rng = np.random.default_rng(9)
    for electrons in (3, 30, 300, 3000):
        seen = rng.poisson(electrons, 400_000) + rng.normal(0, 5, 400_000)
        assert np.std(2 * np.sqrt(np.maximum(seen + 3 / 8 + 25, 0))) == pytest.approx(1, abs=0.03)


# 6: the exercises -----------------------------------------------------------------------------------------------------


def cases(exercise):
    return list(exercise.cases(np.random.default_rng(5)))


def test_total_noise_is_that_of_drawn_frames(says):
    """A million pixels: 0.07 % on a deviation. False failure: 1e-6 (0.5 % is 7 standard deviations)."""
    rng = np.random.default_rng(1)
    drawn = rng.poisson(2_000 * (1 + 0.02 * rng.standard_normal(1_000_000))) + rng.normal(0, 9, 1_000_000)
    assert lesson15.total_noise(np.array(2_000.0), 9.0, 0.02) == pytest.approx(drawn.std(), rel=0.005)
    (fraction,) = says("`prnu` is a fraction already, 0.01 for one per cent.")
    assert fraction == 1 / 100


def test_the_gain_is_that_of_the_measured_pairs(says):
    (two,) = says("`bright` and `dark` have the shape (2, height, width): two frames each.")
    for bright, dark in cases(lesson15.GAIN):
        assert len(bright) == len(dark) == two.value
        lit, unlit = pair(*bright), pair(*dark)
        expected = (lit.variance - unlit.variance) / (lit.mean - unlit.mean)
        assert lesson15.gain(bright, dark) == pytest.approx(expected, rel=1e-9)
    (factor,) = says("A factor of 2 too small. Halve the variance of the difference once")
    one, other = np.random.default_rng(10).standard_normal((2, 100_000))
    assert factor == np.var(one - other)
    assert factor == np.var(one - other) / 2 / np.var([one, other], axis=0).mean()  # over n = 2: half, once more


def test_the_merged_bracket_is_camviz_s_to_a_tenth_of_its_error():
    """camviz goes twice through the weights, the exercise once."""
    for electrons, exposures, dark_noise, full_well in cases(lesson15.MERGE)[:3]:
        frames = electrons.reshape(len(exposures), 1, -1)
        expected, error = merged(frames, exposures, NoiseModel(1.0, dark_noise, 0.0, full_well))
        with np.errstate(invalid="ignore", divide="ignore"):
            found = lesson15.merge(electrons, exposures, dark_noise, full_well).reshape(1, -1)
        assert (np.isnan(found) == np.isnan(expected)).all()
        assert np.nanmax(np.abs(found - expected) / error) < 0.1


def test_the_merged_bracket_has_less_noise_than_any_other_weights():
    rng, times, rate = np.random.default_rng(11), np.array([0.1, 1.0]), 500.0
    counts = rng.poisson(rate * times[:, None], (2, 200_000)) + 6 * rng.standard_normal((2, 200_000))
    best = lesson15.merge(counts, times, 6.0, 1e9).std()
    for share in np.linspace(0, 1, 21):
        assert best < 1.002 * np.std(share * counts[0] / times[0] + (1 - share) * counts[1] / times[1])


def test_stripes_are_split_as_the_sensor_has_them():
    """Against what is put in, and the split of camviz. False failure: below 1e-4 (4 standard deviations and more)."""
    rng = np.random.default_rng(31)
    frames = [rng.normal(0, 8, (900, 1200)) + rng.normal(0, 2, (900, 1)) + rng.normal(0, 3, 1200) for _ in range(2)]
    rows, columns, pixels = lesson15.stripes(frames[0])
    assert rows == pytest.approx(4, rel=4 * (2 / 900) ** 0.5)
    assert columns == pytest.approx(9, rel=4 * (2 / 1200) ** 0.5)
    assert pixels == pytest.approx(64, rel=4 * (2 / 1_080_000) ** 0.5)
    ours, seen = lesson15.stripes(frames[0] - frames[1]) / 2, pair(*frames)
    assert ours[0] == pytest.approx(seen.row_variance, rel=0.01)
    assert ours[1] == pytest.approx(seen.column_variance, rel=0.01)
    assert ours[2] == pytest.approx(seen.within, rel=1e-4)


def test_the_stripes_and_their_spectrum(says):
    (six,) = says("In the spectrum it is the peak at 1/6 cycle per row: it repeats after six rows.")
    (path,) = LESSONS.glob("15_*.ipynb")
    cell = next(one for one in notebooks.read(path).cells if "def in_the_dark" in one.source)
    names = {"np": np}
    exec(cell.source, names)
    lines, spectrum = signal.periodogram(names["one"], axis=0, detrend=False)
    power = spectrum[1:-1].mean(axis=1) / 2  # one-sided, each frequency but the first and the last counted twice
    np.testing.assert_allclose(power, names["spectrum"][1:-1], rtol=1e-6)
    assert lines[1 + power.argmax()] == pytest.approx(1 / six.value)
    assert np.sort(power)[-2] < 0.8 * power.max() < 0.8 * 150  # it stands alone, inside the plot
    says("Noise without any order, of pixels and of rows, has the same power at every frequency.")
    assert np.median(power) == pytest.approx(8**2 + 1.5**2, rel=0.05)
    assert f"variance of the frame: {np.var(names['one']):.2f}" in printed()
    says("The columns drop out of the difference: they are a pattern.")
    darks = names["darks"]
    alone, apart, many = (
        lesson15.stripes(frame) for frame in (darks[0], (darks[0] - darks[1]) / 2**0.5, np.mean(darks, axis=0))
    )
    assert abs(apart[1]) < 0.05 < 0.02 * alone[1] * 2
    says("Rows and pixels sink to a sixteenth, as they are drawn anew in every frame.")
    assert many[2] == pytest.approx(alone[2] / 16, rel=0.03)
    assert many[0] == pytest.approx((1.5**2 + 0.5) / 16, rel=0.5)
    assert many[1] == pytest.approx(alone[1], rel=0.1)


def published_ratio():
    """Saturation over σ + ½ of the reference set, from the figures of its result file."""
    sigma = np.hypot(REFERENCE["σ_d"], np.sqrt(1 / 12) / REFERENCE["K"])
    return REFERENCE["photons"] * REFERENCE["η"] / (sigma + 0.5), sigma


def test_the_published_ratios_have_the_decibels_of_the_standard(says):
    """A dynamic range of 1220.69871336 is 61.732 dB, not the 142.14 of the file that gives it."""
    ratio, _ = published_ratio()
    assert ratio == pytest.approx(1220.69871336, rel=1e-5)
    signals, claimed, range_of, wrong = says(
        "That file claims a largest signal to noise ratio of 118.2, or 95.45 dB, and a dynamic range of 1220.7, or "
        "142.14 dB."
    )
    assert wrong == 20 * np.log(ratio)
    assert range_of == ratio
    assert claimed == 20 * np.log(118.205880802)
    assert signals == 118.205880802
    (times,) = says("Every figure was 2.3026 times too large")
    assert times == np.log(10)
    assert f"it is {db(ratio):.2f} dB" in printed()
    (twenty,) = says("It is counted in decibels: 20 times the common logarithm.")
    assert decibel(10) == pytest.approx(twenty)


def test_the_least_light_has_a_signal_equal_to_its_noise(says):
    """The answer is put back into SNR = 1, and compared with the published camera's."""
    for dark_noise, efficiency in cases(lesson15.THRESHOLD):
        electrons = efficiency * lesson15.threshold_photons(dark_noise, efficiency)
        np.testing.assert_allclose(electrons, np.sqrt(dark_noise**2 + electrons), rtol=1e-12)
    _, sigma = published_ratio()
    (needed,) = says("The published camera needs 25.4 photons.")
    assert needed == lesson15.threshold_photons(sigma, REFERENCE["η"])
    assert needed == (sigma + 0.5) / REFERENCE["η"]  # by the approximation as well
    says("With a perfect amplifier a pixel needs 1 electron and not none")
    assert lesson15.threshold_photons(0.0, 1.0) == 1
    half, wrong = says("For σ_d = 0 and η = 0.5 it says 1.5.")
    assert wrong == lesson15.threshold_as_given(0.0, half.value)
    efficiency, photons, electrons, under_the_root = says(
        "with η = 0.5 it says 1.5 photons. They give 0.75 electrons. Is their noise, √0.75, as large as they are?"
    )
    assert photons == wrong.value
    assert electrons == under_the_root.value == efficiency.value * wrong.value


# 7: real data ---------------------------------------------------------------------------------------------------------


def test_the_reference_data_set(says):
    levels, width, height, bits = says("50 levels, 640 × 480, 12 bits,")
    assert [one.value for one in (levels, width, height, bits)] == list(REFERENCE.values())[:4]
    K, efficiency, noise = says(
        "finds K = 0.2808 DN/e⁻, a quantum efficiency of 45.1 % and σ_d = 10.9 e⁻, as published."
    )
    (prnu,) = says("The published PRNU is 0.43 %.")
    assert REFERENCE["K"] == K
    assert efficiency == 100 * REFERENCE["η"]
    assert noise == REFERENCE["σ_d"]
    assert prnu == 100 * REFERENCE["PRNU"]


def test_photons_stir_every_block(says):
    """A linear file, and sRGB's curve by IEC 61966-2-1, above its linear part."""
    full, bits = says("Take a pixel that is full at 10,000 electrons, in a linear file of 8 bits.")
    grey, held, steps = says("At a grey value of 100 it holds 3,900 of them, and the photons' noise is 1.6 steps.")
    by_srgb, fewer = says(
        "stands for 1,270 electrons, and the noise is 1.3 steps. Either is enough to stir every block."
    )
    white = 2**bits.value - 1
    linear = (grey.value / white, lambda share: share)
    srgb = ((grey.value / white + 0.055) / 1.055) ** 2.4, lambda share: 1.055 * share ** (1 / 2.4) - 0.055
    for (share, encoded), said, noise in ((linear, held, steps), (srgb, by_srgb, fewer)):
        assert said.about(full.value * share, within=0.006)
        drawn = np.random.default_rng(12).poisson(full.value * share, (20_000, 64)) / full.value
        values = white * encoded(drawn)
        assert noise == np.std(values)
        assert (np.ptp(np.rint(values), axis=1) > 0).all()


def test_the_line_of_slope_a_half_stands_at_the_root_of_K(says):
    """Poisson counts times K: their deviation over the root of their mean, both in DN, is √K."""
    (at,) = says("it is σ = √(K · signal), so at a signal of 1 DN its height is √K")
    counts = np.random.default_rng(15).poisson(4_000, 400_000)
    for K in (0.25, 0.5, 2.0):
        root = np.sqrt(np.mean(K * counts) / at.value)
        assert np.std(K * counts) / root == pytest.approx(np.sqrt(K), rel=0.01)


def rounded_variance(ratio):
    """The variance of Gaussian noise of 1 after rounding to steps of that many times its deviation."""
    noise = np.random.default_rng(13).standard_normal(1_000_000)
    return np.var(ratio * np.rint(noise / ratio))


def test_what_becomes_of_noise_depends_on_the_step(says):
    across, down, frequencies = says("JPEG writes each block of 8 × 8 pixels as 64 frequencies")
    assert frequencies == across.value * down.value
    (divisor,) = says(
        "a step much smaller than the noise adds step²/12 to its variance, as any rounding does: hardly anything;"
    )
    assert divisor == 1 / np.linspace(-0.5, 0.5, 100_001).var()
    assert rounded_variance(0.5) == pytest.approx(1 + 0.5**2 / 12, abs=0.01)
    says(
        "a step two or three times as large as the noise turns it into jumps of a whole step: *more* noise than "
        "there was;"
    )
    assert min(rounded_variance(ratio) for ratio in (2, 2.5, 3)) > 1.15
    says("a step many times as large rounds it away: blocks without noise.")
    assert rounded_variance(8) < 0.01


def frames_of(electrons, rng):
    """Two frames of a sensor of K = 0.38 DN/e⁻, σ_d = 6 e⁻, PRNU 1.2 %, DSNU 4 e⁻: whole DN of 12 bits."""
    pattern = np.random.default_rng(14).standard_normal((2, 120, 160))
    charge = rng.poisson(electrons * (1 + 0.012 * pattern[0]), (2, 120, 160)) + 40  # of dark charge in half a second
    noise = np.sqrt(6**2 + 40) * rng.standard_normal((2, 120, 160))
    return np.rint(0.38 * (charge + 4 * pattern[1] + noise) + 64)


def after_jpeg(frames, quality):
    decoded = []
    for frame in frames:
        coded = cv2.imencode(".jpg", (frame / 16).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        decoded.append(16.0 * cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))
    return decoded


def variance(pair_of_frames):
    return np.var(np.subtract(*pair_of_frames)) / 2


def test_jpeg_raises_the_noise_or_lowers_it(says):
    (K,) = says("Here is a camera whose K is 0.38 DN per electron.")
    quality, about, true = says(
        "So quality 95 *raises* the noise of bright light, and K comes out near 0.5 where 0.38 is true."
    )
    says(
        "In dim light, whose noise is smaller beside the same steps, it lowers the noise. Lower qualities take "
        "most of it away."
    )
    rng = np.random.default_rng(15)
    dim, bright = frames_of(600, rng), frames_of(5400, rng)
    dark_variance, signal = 0.38**2 * (36 + 40), 0.38 * 5400
    assert true == K.value == pytest.approx((variance(bright) - dark_variance) / signal, rel=0.05)
    compressed = after_jpeg(bright, int(quality.value))
    assert about == (variance(compressed) - dark_variance) / signal
    (asked,) = says("Two frames of a grey wall in bright light are saved as JPEG of quality 95.")
    (thought,) = says("It is as before: quality 95 takes next to nothing away.")
    assert asked == thought.value == quality.value
    says("The variance of the noise grows by more than a third.")
    assert variance(compressed) > 4 / 3 * variance(bright)
    says("about a third of the steps to which the compressor rounds are two or three times as large as the noise.")
    coded = cv2.imencode(".jpg", (bright[0] / 16).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, int(quality.value)])[1]
    table = coded.tobytes().partition(b"\xff\xdb")[2][3:67]  # of the steps: a marker, two bytes of length, one of kind
    steps = 16 * np.frombuffer(table, np.uint8) / np.sqrt(variance(bright))
    assert np.mean((steps > 1.5) & (steps < 3.5)) == pytest.approx(1 / 3, abs=0.04)
    assert variance(after_jpeg(dim, int(quality.value))) < 0.9 * variance(dim)
    for light in (dim, bright):
        assert variance(after_jpeg(light, 50)) < 0.3 * variance(light)


def test_a_tone_curve_leaves_no_single_gain(says):
    says(
        "Noise is multiplied by the curve's slope, which is steep in the dark and flat in the light, so that no "
        "single K is left."
    )
    light = np.array([0.02, 0.2, 0.8])
    slope = 1.055 / 2.4 * light ** (1 / 2.4 - 1)  # of sRGB's curve
    assert (np.diff(slope) < 0).all()
    assert slope[0] > 1 > slope[2]


# The quiz -------------------------------------------------------------------------------------------------------------


def test_the_quiz_about_the_noise_of_light(says):
    (electrons,) = says("A pixel counts 2,500 electrons of light, and the camera adds next to no noise.")
    radicand, root = says("√2,500 = 50 electrons is what they differ by.")
    noise, percent = says("By about 50 electrons, 2 %.")
    again, right, more, less = says(
        "Yes: √2,500 = 50. With four times the light it would be 100 electrons, and only 1 %."
    )
    assert electrons.value == radicand.value == again.value
    drawn = np.random.default_rng(17).poisson([[electrons.value], [4 * electrons.value]], (2, 1_000_000))
    few, many = drawn.std(axis=1)
    assert root == right.value == noise.value == round(few)
    assert percent == 100 * few / electrons.value
    assert more == round(many)
    assert less == 100 * many / drawn[1].mean()
    wrong, share, count = says("By about 250 electrons: 10 %, as a count of 100 does.")
    smaller, its_share = says("A count of 100 differs by 10 %.")
    assert count == smaller.value
    assert share == its_share.value == 100 * np.sqrt(count.value) / count.value
    assert wrong == share.value / 100 * electrons.value


def variance_of_a_difference(variance):
    """Of two frames of a wall whose pixels differ among themselves, too."""
    rng = np.random.default_rng(18)
    wall = 500 + 20 * rng.standard_normal(1_000_000)
    return float(np.var(np.subtract(*(wall + variance**0.5 * rng.standard_normal((2, 1_000_000))))))


def test_the_quiz_about_a_difference(says):
    (difference,) = says("The difference has a variance of 200 DN².")
    (one,), (whole,), (less,) = (
        says("100 DN²."),
        says("200 DN²."),
        says("Less than 100 DN²: the pattern has a share in it."),
    )
    assert difference == whole.value
    assert one == less.value
    assert variance_of_a_difference(one.value) == pytest.approx(difference.value, rel=0.01)


def test_what_is_told_of_your_camera_is_within_what_is_promised(says):
    figures, patterns, decibels = says(
        "A figure that its frames cannot tell to 3 % (patterns 5 %, decibels 0.26 dB) is withheld, with the reason:"
    )
    assert decibels == 20 * np.log10(1 + figures.value / 100)
    rng = np.random.default_rng(4)
    levels = []
    for t in [*np.linspace(0.02, 0.5, 12), *np.linspace(0.51, 0.63, 13)]:
        light = np.full((240, 320), 0.6 * 30_000 * t)
        pattern = np.random.default_rng(1).normal(1, 0.012, light.shape)  # of these very pixels
        frames = [
            np.clip(
                np.rint(0.38 * np.minimum(rng.poisson(mean), 10_000) + rng.normal(60, 0.38 * 6, mean.shape)), 0, 4095
            )
            for mean in (light * pattern, light * pattern, 0 * light, 0 * light)
        ]
        levels.append(Level.of(t, frames[:2], frames[2:]))
    found = Measurement(tuple(levels)).figures()
    assert abs(found["gain_dn_per_e"] / 0.38 - 1) < figures.value / 100
    assert abs(found["read_noise_e"] / 6 - 1) < figures.value / 100
    assert abs(found["prnu"] / 0.012 - 1) < patterns.value / 100


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_the_part_of_the_curve_that_tells_the_gain(says):
    says("From the part where the noise grows as the square root of the signal.")
    says(
        "Counted in electrons, the variance of light equals the signal. Counted in steps, it is the signal times "
        "the gain."
    )
    rng, K = np.random.default_rng(15), 0.28
    electrons = rng.poisson(4000, 400_000)
    assert electrons.var() / electrons.mean() == pytest.approx(1, rel=0.01)
    assert (K * electrons).var() / (K * electrons).mean() == pytest.approx(K, rel=0.01)
    says("A percentage is the same in electrons and in steps.")
    uneven = 4000 * (1 + 0.01 * rng.standard_normal(400_000))
    assert uneven.std() / uneven.mean() == pytest.approx((K * uneven).std() / (K * uneven).mean())


def test_before_the_lesson_a_perfect_camera(says):
    (count,) = says("A pixel counts 400 electrons in the first.")
    (never,) = says("400 again: nothing has changed.")
    about, four, one = says("About 400, and as a rule 4 more or fewer, 1 %.")
    right, low, high = says("About 400, and as a rule 20 or 30 more or fewer.")
    chance, some = says("By chance alone, 400 electrons differ by some 20.")
    radicand, root, apart = says("Yes: each count scatters by √400 = 20, and two of them differ by 28.")
    assert count.value == never.value == about.value == right.value == chance.value == radicand.value
    assert four == one.value / 100 * count.value
    pairs = np.random.default_rng(19).poisson(count.value, (2, 1_000_000))
    assert root == low.value == some.value == round(pairs[0].std())
    assert apart == round(np.subtract(*pairs).std())
    assert low.value < apart.value < high.value


def test_before_the_lesson_a_difference(says):
    (variance,) = says("In a frame of a white wall, random noise has a variance of 30")
    (same,), (both,) = says("30."), says("60.")
    (more,) = says("More than 60, as the pixels' own differences come on top.")
    assert variance == same.value
    assert both == more.value
    assert variance_of_a_difference(variance.value) == pytest.approx(both.value, rel=0.01)


# One case by hand -----------------------------------------------------------------------------------------------------


def test_one_count_one_pixel_and_one_bracket_by_hand(says):
    electrons, reading, percent = says("A card of 400 electrons, read noise 8, PRNU 2 %:")
    drawn = np.random.default_rng(15)
    answer = 1 + percent.value / 100 * drawn.standard_normal(1_000_000)
    counts = drawn.poisson(electrons.value * answer) + reading.value * drawn.standard_normal(1_000_000)
    assert counts.std() == pytest.approx(22.98, rel=0.005)  # what the cell below it prints; a σ is 0.07 %
    (rounding,) = says("rounding adds 0.29 DN there, which your function does not know")
    even = np.linspace(0, 50, 100_001)
    assert rounding == np.std(even - np.rint(even))
    raw, dark, lit, mean = says(
        "A pixel reads 330 DN. In the dark it reads 120, and 1300 under the even light, where the mean pixel rises by "
        "1200 above its dark:"
    )
    share = (lit.value - dark.value) / mean.value  # this pixel's answer, beside that of the mean one
    assert dark.value + 213.6 * share == pytest.approx(raw.value, abs=0.05)
    noise, few, short, many, long = says("With σ_d = 6 a pixel counts 30 electrons in 0.01 s and 2,000 in 0.64 s.")
    x = (few.value + many.value) / (short.value + long.value)
    deviations = [np.hypot(noise.value, np.sqrt(x * t)) / t for t in (short.value, long.value)]
    assert (deviations[0] / deviations[1]) ** 2 == pytest.approx(135, abs=0.5)


def test_the_response_curve(says):
    """Held against sRGB after IEC 61966-2-1, on other pictures than the lesson's, by the lesson's own cell."""
    (bits,) = says("A finished 8-bit picture has also been bent by a **response curve** f")
    many, last, half = says(
        "This is linear in the 256 numbers g(0) … g(255) and in the ln E of the chosen pixels"
    ) + says("and g(128) = 0, as the scale is free")
    assert many == 2**bits.value
    assert last == many.value - 1
    assert half == many.value / 2
    low, high = says("Between the values 30 and 230 both curves are within a twentieth of a stop of the truth.")
    values = np.arange(256) / 255
    true = np.log2(np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4) + 1e-9)
    (path,) = LESSONS.glob("15_*.ipynb")
    cell = next(one for one in notebooks.read(path).cells if one.source.startswith("stops = np.arange"))
    rng = np.random.default_rng(3)
    names = {"np": np, "cv2": cv2, "to_display": to_display, "light": 0.9 * rng.uniform(0.1, 1, (120, 160))}
    exec(cell.source, names)
    for curve in (names["g"], names["opencv_g"]):
        off = (curve - curve[128]) - (true - true[128])
        assert np.abs(off[int(low.value) : int(high.value) + 1]).max() < 1 / 20
