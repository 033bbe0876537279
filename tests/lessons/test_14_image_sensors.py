"""What lesson 14 says about image sensors, recomputed with NumPy, SciPy and colour-science."""

import re
from itertools import pairwise

import colour
import numpy as np
import pytest
from quoting import LESSONS
from scipy import constants
from scipy.stats import nbinom

from camviz.scenes.photographs import photograph
from camviz.sensors import PUBLISHED, SHUTTERS, Sensor, decibel, smeared, transferred
from camviz.sensors.published import CMV4000, IMX174, KAF_0400, KAF_3200ME
from camviz_school.course import notebooks
from camviz_school.course.material import module
from camviz_school.views.image_sensor import ImageSensorView
from camviz_school.views.readout import LARGE, ReadoutView, fan

lesson14 = module("14")

EXCEPTIONS: dict[str, str] = {}

# As the sheets have them. η in percent and its wavelength, noise and saturation in electrons, pixels in µm.
IMX174_MEASURED = {"η": 77, "nm": 525, "noise": 6.83, "saturation": 32_691, "pitch": 5.86}
ICX625_POINT_GREY = {"η": 57, "nm": 525, "noise": 8.28, "saturation": 5903, "pitch": 3.45, "bits": 9.41}
ICX625_BASLER = {"η": 47, "nm": 545, "noise": 13, "saturation": 7000, "bits": 9.1}
CMV4000_SHEET = {"η × fill factor": 60, "nm": 550, "fill factor": 42}
KAF_0400_CURVE = {400: 3, 550: 33, 700: 40}  # percent
KAF_3200ME_MEASURED = {"η": 79, "noise": 12.6, "saturation": 70_000}
KAF_50100_SHEET = {"rows": 6132, "transfer": 0.999999}
ASI294MM_CURVE = {"low gain": 6, "high gain": 2}  # ZWO's curve, as S. Bellavia reads it on cloudynights.com
REFERENCE = {"K": 0.280769, "η": 0.45136, "σ_d": 10.898, "photons": 30_957}  # of the emva1288 project's result file

NOISE, FULL = IMX174_MEASURED["noise"], 6000.0
"""Of the sensor whose converter part 4 varies."""


def printed():
    """All that the lesson's cells print."""
    (path,) = LESSONS.glob("14_*.ipynb")
    outputs = [output for cell in notebooks.read(path).cells for output in cell.get("outputs", [])]
    return "\n".join("".join(output.get("text", "")) for output in outputs)


def threshold(noise, step=0.0):
    """The μ with μ = sqrt(noise² + step²/12 + μ), found as a root of μ² − μ − σ²."""
    return np.roots([1, -1, -(noise**2 + step**2 / 12)]).real.max()


def db(ratio):
    return 20 * np.log10(ratio)


def step_of(bits, saturation=FULL):
    return saturation / (2**bits - 1)


# 1: a fan through a telephone -----------------------------------------------------------------------------------------


def blade_tip_px():
    """How far from the hub the drawn blades reach, in rows of a sensor of 480."""
    radius, angle = np.linspace(0.2, 0.89, 6901)[:, None], np.linspace(0, 2 * np.pi, 60)
    blade = fan(radius * np.cos(angle), radius * np.sin(angle), 0.0)[..., 2] < 0.3
    return 240 * radius[blade.any(axis=1)].max()


def test_the_question_about_the_fan(says):
    turns, rows, row_us, long, short = says(
        "A telephone photographs a fan that makes 12 turns a second. Its sensor has a rolling shutter: each of its "
        "480 rows is exposed 64 µs after the one above. The fan's blades are straight; in the picture they are "
        "bent. You shorten the exposure from 1/100 s to 1/1000 s."
    )
    assert rows == ReadoutView().numbers()["frame"].split()[0]
    (last_ms,) = says("But the last row is still exposed 31 ms after the first, however short each exposure is")
    apart_s = (rows.value - 1) * 1e-6 * row_us.value
    assert last_ms == 1e3 * apart_s
    says("and the fan makes more than a third of a turn meanwhile")
    assert 1 / 3 < turns.value * apart_s < 1 / 2
    again_long, radius, far, again_short, near = says(
        "It does matter: in 1/100 s the tip of a blade, 206.4 pixels from the hub, moves 156 pixels; in 1/1000 s it "
        "moves 16."
    )
    assert radius == blade_tip_px()
    speed = 2 * np.pi * turns.value * blade_tip_px()
    assert far == speed / long.value == speed / again_long.value
    assert far == 2 * np.pi * turns.value * radius.value / long.value  # from what is printed
    assert near == speed / short.value == speed / again_short.value
    says("The blur shrinks tenfold, the bend stays.")
    assert long.value * 10 == short.value


def test_no_blade_is_bent_in_the_scene(says):
    says("No blade is bent in the scene: their edges are straight. In the picture they are bent.")
    (end,) = says("Move **time** from 0 to 100 %.")
    assert end == ReadoutView.controls()["time"].high
    radius, angle = np.linspace(0.2, 0.8, 25)[:, None], np.radians(np.arange(0.13, 360, 0.5))
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    for turned in (0.0, 0.37):
        still = fan(u, v, turned)
        assert (still == still[:1]).all()  # the same on a ray from the hub, at every distance
    bent = fan(u, v, 0.37 + 12 * 240 * 64e-6 * v)
    assert not (bent == bent[:1]).all()


def test_nothing_bends_where_all_rows_are_exposed_at_once(says):
    says("All rows are exposed at once, and nothing bends, though the rows are still *read* one after the other.")
    for readout in ("CMOS, global shutter", "CCD"):
        view = ReadoutView(readout=readout, time=70, exposure_ms=0.1)
        scene, picture = (one.astype(float) for one in (view.but(time=0).scene_now(*LARGE), view.picture(*LARGE)))
        assert np.abs(picture - scene).mean() < 2  # a fan that turns by 0.4° meanwhile
        assert np.abs(view.but(readout="CMOS, rolling shutter").picture(*LARGE) - scene).mean() > 20


def blades_seen(exposure_ms):
    """How much the blades stand out: the spread of the picture's brightness around the hub, at 0.7 half heights."""
    view = ReadoutView(exposure_ms=exposure_ms, time=100)
    v, u = np.mgrid[: LARGE[1], : LARGE[0]] - np.array([LARGE[1] - 1, LARGE[0] - 1])[:, None, None] / 2
    ring = np.abs(np.hypot(u, v) / (LARGE[1] / 2) - 0.7) < 0.05
    return view.picture(*LARGE)[ring].std()


def test_a_short_exposure_takes_the_blur_and_leaves_the_bend(says):
    fraction, ms, short = says(
        "Here the fan is exposed for 1/100 s, which is 10 ms. Pull **exposure** to the left, to 1 ms and on."
    )
    assert ms == 1000 / fraction.value
    says("The blur goes, and the bend stays: exposure and read-out are two different times.")
    assert blades_seen(ms.value) < 0.5 * blades_seen(short.value) < 0.6 * blades_seen(0.1)
    bent = [ReadoutView(exposure_ms=one).numbers()["between first and last row's exposure"] for one in (10.0, 0.1)]
    assert bent[0] == bent[1]
    straight = ReadoutView(exposure_ms=0.1, readout="CCD").picture(*LARGE).astype(float)
    assert np.abs(ReadoutView(exposure_ms=0.1).picture(*LARGE) - straight).mean() > 20


def test_the_fan_s_blur_and_bend_in_pixels():
    tip = 2 * np.pi * 12 * blade_tip_px()
    assert f"{tip * 0.01:.0f} px in 1/100 s, {tip * 0.001:.0f} px in 1/1000 s" in printed()
    assert f"it moves {tip * 479 * 64e-6:.0f} px from the first row's exposure" in printed()
    said = ReadoutView(exposure_ms=10.0).numbers()
    assert said["during one exposure"] == f"a blade's tip moves {tip * 0.01:.0f} px"
    assert said["between first and last row's exposure"] == f"a blade's tip moves {tip * 479 * 64e-6:.0f} px"


def test_an_exposure_of_a_whole_flash_shows_no_stripes(says):
    (ms,) = says(
        "Then pull **exposure** up to 10 ms. The stripes go, for each row gathers one whole flash of the lamp."
    )
    assert 1e-3 * ms.value == pytest.approx(1 / (2 * 50))
    light = np.sin(2 * np.pi * 50 * (0.0123 + np.linspace(0, 1e-3 * ms.value, 1001)[:-1])) ** 2
    assert light.mean() == pytest.approx(0.5)
    for exposure_ms, stripes in ((ms.value, False), (1.0, True)):
        wall = ReadoutView(subject="wall under a lamp", exposure_ms=exposure_ms).picture(*LARGE)
        assert (np.ptp(wall[..., 1]) > 50) == stripes


def test_the_questions_about_a_short_exposure(says):
    said = says("A propeller looks bent in the picture of a telephone, which was exposed for 1/500 s.")
    (shorter,) = says("An exposure of 1/5000 s.")
    (again,) = says("Nothing but a slower propeller: the bend is its way during those 1/500 s.")
    assert 10 * said[0].value == 10 * again.value == shorter.value
    says("with a tenth of the exposure time and enough light")
    says("The lean is the way of the train from the first row's moment to the last row's.")
    views = [ReadoutView(subject="view from a train", exposure_ms=one).numbers() for one in (5.0, 0.5)]
    blurred, sharp = (float(one["during one exposure"].split()[-2]) for one in views)
    assert blurred == pytest.approx(10 * sharp, abs=6)
    assert views[0]["between first and last row's exposure"] == views[1]["between first and last row's exposure"]


def test_a_train_s_lean_tells_the_distance(says):
    says("What is near leans most. A tower on the horizon would hardly lean.")
    (speed,) = says("With the numbers of a telephone's sensor and a train at 40 m/s:")
    focal_px = 320 / np.tan(np.radians(30))
    lean = focal_px * speed.value * 479 * 64e-6 / np.array([3.0, 30.0, 3000.0])
    assert (np.diff(lean) < 0).all()
    assert f"a thing at 3 m moves {lean[0]:.0f} px" in printed()
    assert lean[-1] < 1


# 2: the bucket brigade ------------------------------------------------------------------------------------------------


def test_what_a_bucket_brigade_loses(says):
    (poor,) = says("A share c = 0.99 would be hopeless.")
    c, rows, name, again, left = says(
        "Real CCDs reach 0.999999 for each shift. The last of the 6132 rows of a KAF-50100, a CCD for cameras, "
        "still arrives with 0.999999⁶¹³² = 99.4 % of its charge in place."
    )
    assert c == KAF_50100_SHEET["transfer"]
    assert again == c.value
    assert rows == KAF_50100_SHEET["rows"]
    assert f"KAF-{name.value:04.0f}" in [one.name for one in PUBLISHED]
    assert left == 100 * c.value**rows.value
    assert poor.value**rows.value < 1e-20
    rows, c = says("This is why a CCD of 6000 rows needs a transfer efficiency of 0.999999.")
    assert c.value**rows.value > 0.99 > (1 - 10 * (1 - c.value)) ** rows.value


def test_twenty_shifts_by_hand(says):
    row, arrived, sent = says("Row 19 needs twenty shifts, and 818 of its 1000 electrons arrive in their own packet.")
    column = np.zeros(60)
    column[int(row.value)] = sent.value
    assert arrived == lesson14.arriving(column, 0.99)[int(row.value)]
    assert arrived == sent.value * nbinom.pmf(0, 20, 0.99)
    (rows,) = says("now reads a photograph of 512 rows, with the register above its first row")
    assert rows == len(photograph("camera"))


def test_a_packet_arrives_with_a_trail_after_the_negative_binomial_law(says):
    says(
        "How much comes k rows late is the *negative binomial* law: the chance of k failures before the twentieth "
        "success"
    )
    point = np.zeros((60, 1))
    point[19] = 1000.0
    law = 1000 * nbinom.pmf(np.arange(7), 20, 0.99)
    np.testing.assert_allclose(transferred(point, 0.99)[19:24, 0], law[:5], atol=1e-3)
    assert " ".join(f"{one:.3f}" for one in law[:6]) in printed()


def smear_by_shifting(light, exposure_s, shift_s):
    """Packets come down the whole column, stop for the exposure, and go on: each gathers under every row it passes."""
    rows = len(light)
    gathered = np.zeros(rows)
    for packet in range(rows):
        for row in range(rows - 1, -1, -1):  # from the far end to the register
            gathered[packet] += light[row] * (shift_s + (exposure_s if row == packet else 0.0))
    return gathered


def test_how_bright_the_stripe_of_a_lamp_is(says):
    says(
        "How bright is the stripe, as a share of its lamp? It is the time of one shift divided by the exposure, times "
        "the number of rows that the lamp covers. The shorter the exposure, the worse."
    )
    light = np.zeros(50)
    light[20:24] = 1e6  # electrons per second: a lamp of four rows
    for exposure_s in (1e-3, 1e-4):
        seen = smear_by_shifting(light, exposure_s, 2e-6)
        lamp, stripe = seen[21] - seen[0], seen[0]
        assert stripe / lamp == pytest.approx(2e-6 / exposure_s * 4)
        np.testing.assert_allclose(smeared(light[:, None] * exposure_s, exposure_s, 2e-6)[:, 0], seen)


# 3: from photons to electrons -----------------------------------------------------------------------------------------


def test_the_imx174_is_measured_and_has_one_figure(says):
    percent, noise, saturation, rounded = says(
        "It opens as the IMX174: 77 %, 6.8 e⁻ of noise, saturated at 32,691 e⁻, which the slider rounds to 32,700."
    )
    says("Point Grey, who built a camera with it, measured them in that camera after the standard")
    assert "EMVA 1288" in IMX174.basis
    assert percent == IMX174_MEASURED["η"] == 100 * IMX174.sensor.efficiency()
    assert noise == IMX174_MEASURED["noise"] == IMX174.sensor.read_noise_e
    assert saturation == IMX174_MEASURED["saturation"] == IMX174.sensor.saturation_e
    opened = ImageSensorView()
    assert rounded == opened.full_well
    assert opened.full_well == 100 * round(saturation.value / 100)
    one = db(IMX174_MEASURED["saturation"] / threshold(NOISE))
    assert opened.numbers()["dynamic range"].startswith(f"{one:.1f} dB")
    assert f"32691 e⁻   6.8   {one:.1f} dB    73.0 dB" in printed()


def test_the_question_about_the_fill_factor(says):
    fill, efficiency, nm, photons, again = says(
        'The sheet of a CMV4000 says: "fill factor 42 % without microlenses; quantum efficiency × fill factor 60 % '
        'at 550 nm, with microlenses". 1000 photons of 550 nm arrive on the whole pixel.'
    )
    assert fill == CMV4000_SHEET["fill factor"]
    assert efficiency == CMV4000_SHEET["η × fill factor"] == 100 * CMV4000.sensor.efficiency()
    assert nm == again.value == CMV4000_SHEET["nm"] == CMV4000.sensor.measured_at_nm
    right = photons.value * efficiency.value / 100
    of, at, free = says("The dot is the sheet's figure: of 100 photons of 550 nm, 60 free an electron.")
    assert free.value == of.value * efficiency.value / 100
    assert at == CMV4000_SHEET["nm"]
    twice, share, whole = says("252: 42 % of 600")
    assert whole == right
    assert share == fill.value
    assert twice == right * share.value / 100
    (sensitive,) = says("which gather on the 42 % that are sensitive much of what falls on the rest")
    assert sensitive == fill.value
    (choice,) = says("600")
    assert choice == right
    (all_of_them,) = says("1000")
    assert all_of_them == photons.value
    electrons, at, elsewhere = says("600 at 550 nm, and as many at 900 nm")
    assert electrons == right
    assert at == nm.value
    electrons, at, infrared = says("600 is right for 550 nm. At 900 nm there are far fewer")
    assert electrons == right
    assert at == nm.value
    assert infrared == elsewhere.value
    absorbed_mm = {550: 1 / 700, 900: 1 / 30.6}  # silicon at 300 K: 7.0e3 and 306 per cm (Green 2008)
    assert absorbed_mm[900] > 10 * absorbed_mm[550]
    at, of_a_hundred = says("At 550 nm 60 of a hundred are good for a sensor that is lit from the front")
    assert of_a_hundred == efficiency.value
    assert at == nm.value


def spectrum(name):
    shape = colour.SpectralShape(380, 780, 5)
    power = colour.SDS_ILLUMINANTS[name].copy().align(shape)
    return power.wavelengths, power.values


def test_an_incandescent_bulb_leaves_little_blue_on_a_ccd_without_microlenses(says):
    name, at_400, blue, at_700, red = says(
        "The **KAF-0400** has no microlenses. It catches 3 photons in a hundred at 400 nm, 40 at 700 nm."
    )
    assert f"KAF-{name.value:04.0f}" == KAF_0400.name
    for percent, nm in ((at_400, blue), (at_700, red)):
        assert percent == KAF_0400_CURVE[nm.value] == 100 * KAF_0400.sensor.efficiency(nm.value)
    name, at_550, green, at_400, blue = says(
        "The KAF-0400, for one, catches 33 of a hundred photons at 550 nm, and 3 at 400 nm."
    )
    assert f"KAF-{name.value:04.0f}" == KAF_0400.name
    assert at_550 == KAF_0400_CURVE[green.value]
    assert at_400 == KAF_0400_CURVE[blue.value]
    for chosen in (
        says("then choose **efficiency: KAF-0400: a curve**."),
        says("Choose the **KAF-0400** and take **light** A, an incandescent bulb: what happens to blue?"),
    ):
        assert chosen[0] == name.value
    (times,) = says("White balance will have to multiply it by 5.5, its noise included.")
    nm, power = spectrum("A")
    filters = (
        colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"].copy().align(colour.SpectralShape(380, 780, 5)).values
    )
    passed = filters / nm[:, None] / (filters / nm[:, None]).max(axis=0)
    efficiency = np.interp(nm, list(KAF_0400_CURVE), list(KAF_0400_CURVE.values()))
    freed = (power * nm * efficiency) @ passed
    assert times.about(freed.max() / freed[2], within=0.02)


def test_half_the_sensitive_area_is_half_the_electrons(says):
    says("Half the sensitive area, half the electrons: the picture is darker and noisier, at the same exposure.")
    whole, half = ImageSensorView(), ImageSensorView(fill_factor=0.5)
    np.testing.assert_allclose(half.white_e, whole.white_e / 2)


def test_photons_of_a_lux(says):
    efficacy, nm = says("A lux is 1/683 W/m² of green light of 555 nm")
    assert efficacy == constants.physical_constants["luminous efficacy"][0]
    assert nm == 1e9 * constants.c / 540e12
    (bar,) = says("an unfiltered pixel in green light of 555 nm")
    assert bar.value == nm.value
    (green,) = says("The light is green, with 4091 photons per lux, second and µm².")
    per_lux = 1e-12 / efficacy.value / (constants.h * constants.c / 555e-9)
    assert green == per_lux
    assert round(per_lux) == lesson14.PHOTONS_PER_LUX
    daylight, low, high = says("A lux of daylight (D65) is more photons, 13,900 between 380 and 780 nm")
    wavelengths, power = spectrum("D65")
    assert (low.value, high.value) == (wavelengths[0], wavelengths[-1])
    eye = (
        colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
        .copy()
        .align(colour.SpectralShape(380, 780, 5))
        .values[:, 1]
    )
    photons = np.trapezoid(power * wavelengths, wavelengths) * 1e-9 / (constants.h * constants.c) * 1e-12
    assert daylight.about(photons / (683 * np.trapezoid(power * eye, wavelengths)), within=0.002)


# 4: how far from dark to bright ---------------------------------------------------------------------------------------


def test_the_exact_threshold_and_its_approximation(says):
    says("This lesson's views and tables use the exact form.")
    for noise in (0.3, 2.0, 10.0):
        sensor = Sensor(1.0, 10_000, noise, gain_dn_per_e=6.5, offset_dn=0, bits=16)
        mu = sensor.threshold_photons()
        assert mu == pytest.approx(threshold(noise, 1 / 6.5), rel=1e-9)
        assert mu / np.sqrt(noise**2 + 1 / 12 / 6.5**2 + mu) == pytest.approx(1)
    percent, above = says("EMVA 1288 prints the approximation σ + ½, which is within 3 % of it for every σ above 2.")
    noises = np.geomspace(above.value, 1000, 50)
    worst = max(abs(noise + 0.5 - threshold(noise)) / threshold(noise) for noise in noises)
    assert 0.02 < worst < percent.value / 100


def test_the_question_about_bits(says):
    saturation, noise, few, many = says(
        "A sensor is saturated at 6000 e⁻ and has 8 e⁻ of noise in the dark. It is sold with a converter of 10 "
        "bits, and in a dearer version with one of 16 bits."
    )
    S, sigma = saturation.value, noise.value
    more, stops = says("By 6 bits, 36 dB: each bit is a stop.")
    assert more == many.value - few.value
    assert stops == db(2**more.value)
    sixteen, ten, difference = says("By 96 dB − 60 dB = 36 dB, for that is what the two converters have.")
    assert sixteen == db(2**many.value)
    assert ten == db(2**few.value)
    assert difference == sixteen.value - ten.value
    top, bottom, decibels, in_stops = says("Saturation over threshold is 6000 / 8.5, 57 dB or 9.5 stops")
    assert top == S
    assert bottom == threshold(sigma)
    assert decibels == db(S / threshold(sigma))
    assert in_stops == np.log2(S / threshold(sigma))
    bits, step, again, divisor, rounding, beside, before, after = says(
        "With 10 bits a step is 5.9 e⁻, whose rounding noise, 5.9/√12 = 1.7 e⁻, is small beside 8: it raises the "
        "threshold from 8.5 to 8.7 e⁻."
    )
    assert bits == few.value
    assert step == again.value == pytest.approx(step_of(few.value, S), abs=0.05)
    assert rounding == step.value / np.sqrt(divisor.value)
    assert beside == sigma
    assert before == threshold(sigma)
    assert after == threshold(sigma, step_of(few.value, S))
    bits, gained = says("With 16 bits it is gone, and that is worth 0.2 dB.")
    thresholds = [threshold(sigma, step_of(b, S)) for b in (few.value, bits.value)]
    assert gained == db(thresholds[0] / thresholds[1])
    divisor, nine, step, high, low, six, coarse = says(
        "Rounding to steps of q electrons is noise of q/√12, and it counts when the steps are coarse: with 9 bits, "
        "steps of 11.7 e⁻, the threshold is 9.2 e⁻ and not 8.5. With 6 bits, steps of 95 e⁻, dim light is rounded "
        "to 0."
    )
    evenly = np.linspace(-0.5, 0.5, 100_001)
    assert divisor == 1 / evenly.var()
    assert step == step_of(nine.value, S)
    assert high == threshold(sigma, step.value)
    assert low == threshold(sigma)
    assert coarse == step_of(six.value, S)
    dim = np.random.default_rng(3).poisson(9, 100_000) + sigma * np.random.default_rng(4).standard_normal(100_000)
    assert np.mean(np.rint(dim / coarse.value) != 0) < 1e-3
    (most,) = says("the sensor's is the larger one in both versions: it allows no more than 57 dB.")
    assert most == db(S / threshold(sigma))
    assert sigma > step_of(few.value, S) / np.sqrt(12)


def test_more_bits_give_little(says):
    saturated, most = says(
        "This is the IMX174, a sensor by Sony, as if it were saturated at 6000 e⁻. Take **bits** down from 16, slowly"
    )
    assert saturated.value == FULL
    assert most == ImageSensorView.controls()["bits"].high
    many, few, noise, step = says(
        "From 16 bits to 10 hardly anything is lost, a quarter of a decibel: what limits the range there is the "
        "sensor. Its noise in the dark, 6.8 e⁻, is larger than a step of the converter, 5.9 e⁻."
    )
    lost = db(threshold(NOISE, step_of(few.value)) / threshold(NOISE, step_of(many.value)))
    assert lost == pytest.approx(0.25, abs=0.02)
    assert noise == NOISE
    assert step == step_of(few.value)
    assert noise.value > step.value
    four, three = says("At 4 bits, then 3, come flat patches, and false colours where the channels step at different")
    for bits in (four.value, three.value):
        assert len(np.unique(ImageSensorView(bits=bits).shot(64).raw)) <= 2**bits
    (divisor,) = says("Rounding to steps of q electrons is a noise of q/√12, and noises add as squares.")
    assert divisor == 1 / np.linspace(-0.5, 0.5, 100_001).var()


def test_what_six_bits_are_worth_by_the_formula(says):
    bits, count = says("why 6 bits are more than 36 dB")
    steps, again, said = says(
        "Six bits count 63 steps: from one step to full scale that is 36 dB. The table says 46.4 dB."
    )
    assert steps == 2**bits.value - 1
    assert count == again.value == pytest.approx(db(steps.value), abs=0.5)
    together = db(FULL / threshold(NOISE, step_of(bits.value)))
    assert said == together
    assert f" 6 bits: {together:.1f} dB" in printed()
    divisor, farther = says(
        "It is off by at most half a step, evenly either way, and that is a noise of step/√12. Full scale is 10.8 "
        "dB farther above this noise than above a step."
    )
    evenly = np.linspace(-0.5, 0.5, 100_001)
    assert divisor == 1 / evenly.var()
    assert farther == db(1 / evenly.std())
    (square,) = says("σ² = σ_d² + step²/12")
    assert square == divisor.value
    bits, sensor, converter, both = says(
        "At 8 bits the sensor with a perfect converter would have 58.2 dB, the converter with a perfect sensor "
        "58.3 dB, and the two together have 55.4 dB."
    )
    step = step_of(bits.value)
    assert sensor == db(FULL / threshold(NOISE))
    assert converter == db(FULL / threshold(0, step))
    assert both == db(FULL / threshold(NOISE, step))


def pixels_seen(electrons, bits, least=0):
    """A million pixels of that light, read by a converter of so many bits, from its number `least` on: electrons."""
    rng, step = np.random.default_rng(77), step_of(bits)
    signal = rng.poisson(electrons, 1_000_000) + NOISE * rng.standard_normal(1_000_000)
    return step * np.maximum(np.rint(signal / step), least)


def test_noise_dithers_the_converter_and_at_six_bits_it_does_not(says):
    electrons, bits = says("Let a million pixels get 30 electrons each, less than a third of a step at 6 bits:")
    assert 3 * electrons.value < step_of(bits.value)
    eight, light, low, high = says(
        "With 8 bits the 30 electrons lie between two numbers, which stand for 24 and 47 electrons."
    )
    assert light == electrons.value
    assert low == step_of(eight.value)
    assert high == 2 * step_of(eight.value)
    says("the nearer one more often, so that the mean of many pixels comes out right")
    seen = pixels_seen(30, 8)
    nearer, farther = (np.mean(np.abs(seen - n * step_of(8)) < 1e-9) for n in (1, 2))
    assert nearer > farther > 0.1
    assert seen.mean() == pytest.approx(30, rel=0.02)
    (six,) = says("With 6 bits the noise in the dark is less than a tenth of a step. Nearly every pixel reads 0")
    assert step_of(six.value) / 10 > NOISE
    lost = pixels_seen(30, six.value)
    assert np.mean(lost == 0) > 0.95
    assert lost.mean() < 3
    (formula,) = says("The 46.4 dB are then a number of the formula and of no picture.")
    assert formula == db(FULL / threshold(NOISE, step_of(6)))
    at_threshold = pixels_seen(threshold(NOISE, step_of(6)), 6)
    assert at_threshold.mean() / at_threshold.std() < 0.2  # the formula says 1
    dim = threshold(NOISE, step_of(10))
    above_black = pixels_seen(dim, 10, least=-20)
    assert above_black.mean() / above_black.std() == pytest.approx(1, rel=0.01)


def test_how_much_noise_a_converter_needs(says):
    limit, bits = says(
        "EMVA 1288 asks for a variance of at least 0.24 steps² in the dark, noise of about half a step. With this "
        "sensor that takes 9 bits."
    )
    assert np.sqrt(limit.value) == pytest.approx(0.5, abs=0.02)
    enough = [b for b in range(4, 16) if (NOISE / step_of(b)) ** 2 + 1 / 12 >= limit.value]
    assert bits == enough[0]
    bright, noise = says("at 3000 electrons the light's noise is 55 electrons")
    assert noise == np.sqrt(bright.value)
    assert noise.value > step_of(6) / 2
    assert pixels_seen(bright.value, 6).mean() == pytest.approx(bright.value, rel=0.01)


def test_iso_and_dual_conversion_gain(says):
    """The lesson's model: 1 V of swing, 120 µV of noise before the amplifier, 300 µV after it; 30 or 120 µV/e⁻."""
    says("at ISO 200 at half as many as at ISO 100")
    most, widest = says("only the large capacitance holds all 33,333 electrons, and the range is 69.4 dB")
    full, small, large, small_db, large_db = says(
        "both modes saturate at 8333 electrons, but the small capacitance has 2.7 e⁻ of noise in place of 4.7: 68.3 dB "
        "in place of 64.1"
    )

    def of(iso, microvolts):
        """Saturation and noise in electrons when the amplifier brings ISO 100's 33,333 electrons down by ISO / 100."""
        saturation = 1e6 / 30 * 100 / iso
        amplifier = 1e6 / (saturation * microvolts)
        return saturation, np.sqrt(120**2 + (300 / amplifier) ** 2) / microvolts

    at_100, at_400, in_high = of(100, 30), of(400, 30), of(400, 120)
    assert of(200, 30)[0] == at_100[0] / 2
    assert most == at_100[0]
    assert most.value > 1e6 / 120  # what the small capacitance holds
    assert widest == db(at_100[0] / (at_100[1] + 0.5))
    assert full == at_400[0] == pytest.approx(in_high[0])
    assert small == in_high[1]
    assert large == at_400[1]
    assert small_db == db(in_high[0] / (in_high[1] + 0.5))
    assert large_db == db(at_400[0] / (at_400[1] + 0.5))
    says("At the same exposure the noise in electrons falls as ISO rises.")
    for microvolts in (30, 120):
        assert (np.diff([of(iso, microvolts)[1] for iso in (400, 800, 1600, 3200)]) < 0).all()
    before, after = says("falls from over 6 e⁻ to below 2 at one setting of its gain")
    assert before == ASI294MM_CURVE["low gain"]
    assert after == ASI294MM_CURVE["high gain"]


# 5: reset noise ------------------------------------------------------------------------------------------------------


def reset_noise(microvolts, kelvin=300.0):
    """In electrons, by the energy that heat leaves on a capacitor: ½ C ⟨V²⟩ = ½ k T; an electron makes q/C volts."""
    capacitance = constants.e / (microvolts * 1e-6)
    return np.sqrt(constants.k * kelvin / capacitance) / (microvolts * 1e-6)


def test_reset_noise(says):
    kelvin, about = says("At 300 K it is about 400 electrons for a picofarad, and it goes with the root of C.")
    picofarad = 1e6 * constants.e / 1e-12  # µV for each electron
    assert about.about(reset_noise(picofarad, kelvin.value), within=0.01)  # Janesick: 400 √C, in pF
    kelvin, large, in_large, small, in_small = says(
        "At 300 K a pixel of 30 µV per electron has 29.4 e⁻ of it, and one of 120 µV has 14.7 e⁻."
    )
    assert in_large == reset_noise(large.value, kelvin.value) == lesson14.reset_noise_e(large.value, kelvin.value)
    assert in_small == reset_noise(small.value, kelvin.value)
    says("Four times the gain is a quarter of the capacitance, and half the noise.")
    assert small.value == 4 * large.value
    assert in_small.value == in_large.value / 2
    for microvolts, temperature in cases(lesson14.RESET_NOISE_E):
        np.testing.assert_allclose(
            lesson14.reset_noise_e(microvolts, temperature), reset_noise(np.asarray(microvolts), temperature)
        )
    (fixed,) = says("Your function is for 300 K only.")
    assert fixed.value == kelvin.value
    (volt, milli) = says("A microvolt is 1e-6 V. You took 1e-3, which is a millivolt.")
    assert (volt.value, milli.value) == (constants.micro, constants.milli)
    (zero,) = says("You add 273.15 once more.")
    assert zero == constants.zero_Celsius


def test_two_readings_take_the_reset_s_noise_away(says):
    all_of_it, reset = says("The IMX174 has 6.8 e⁻ of noise in all. A pixel with 29 e⁻ of reset noise could never have")
    assert all_of_it == IMX174_MEASURED["noise"]
    assert reset == reset_noise(30)
    assert reset.value > all_of_it.value
    most, gain = says(
        "Below is a photograph in dim light, at most 100 electrons a pixel, from a sensor of 30 µV per electron."
    )
    each, two, both = says("3 e⁻ in each of them make 3 √2 = 4.2 e⁻ in the difference.")
    assert both == each.value * np.sqrt(two.value)
    stored = photograph("camera")[60:260, 160:360, 0] / 255
    light = most.value * np.where(stored > 0.04045, ((stored + 0.055) / 1.055) ** 2.4, stored / 12.92)
    assert light.max() <= most.value
    one_reading = np.sqrt(reset_noise(gain.value) ** 2 + each.value**2 + light.mean())
    two_readings = np.sqrt(2 * each.value**2 + light.mean())
    found = [float(one) for one in re.findall(r"(?:second reading|second minus first): ([\d.]+) e⁻", printed())]
    assert found == pytest.approx([one_reading, two_readings], rel=0.03)


# 6: the exercises -----------------------------------------------------------------------------------------------------


def cases(exercise):
    return list(exercise.cases(np.random.default_rng(5)))


def test_a_lens_lets_pi_l_over_four_n_squared_through(says):
    (four,) = says("The 4 below is missing: E = π L / (4 N²), and a matt white wall has π L = lux.")
    (again,) = says("`lux / 4 * f_number**2` divides by 4 and then *multiplies* by N².")
    N, angle = 8.0, np.linspace(0, np.arctan(1 / 16), 20_001)
    lit = 2 * np.pi * np.trapezoid(np.cos(angle) * np.sin(angle), angle)  # ∫ L cos θ dΩ over the aperture, L = 1
    assert four == np.pi / (lit * N**2)
    assert again == four.value


def test_a_lamp_on_the_mains_is_bright_twice_in_each_period(says):
    (factor,) = says(
        "A factor of 2 too long: the current flows both ways, so the lamp is bright *twice* in each period."
    )
    time = np.arange(1000) / 1000
    power = np.sin(2 * np.pi * 10 * time) ** 2  # ten periods
    assert factor == np.argmax(np.abs(np.fft.rfft(power - power.mean()))) / 10
    hz, ms, rows, us = says("Three stripes on 50 Hz last 30 ms: with 1080 rows, 28 µs a row.")
    assert ms == 1e3 * 3 / (2 * hz.value)
    assert us == 1e3 * ms.value / rows.value
    mains = says("Your function fits mains of 50 Hz only. Elsewhere they have 60: use `mains_hz`.")
    assert {one.value for one in mains} == {hz_ for _, _, hz_ in cases(lesson14.ROW_TIME)}


def test_stripes_of_a_lamp_give_the_row_time_of_published_shutters_back():
    for one in SHUTTERS:
        assert lesson14.row_time(one.frame_s * 100, one.height, 50) == pytest.approx(one.row_s)


def test_the_published_result_file(says):
    (wrong,) = says("a result file for it: a dynamic range of 142 dB. No camera has that.")
    saturation, noise = says(
        "The saturation capacity was 13,973 e⁻, the noise in the dark, with that of rounding, 10.95 e⁻. The "
        "threshold was taken as σ + ½."
    )
    assert saturation == REFERENCE["photons"] * REFERENCE["η"]
    assert noise == np.hypot(REFERENCE["σ_d"], np.sqrt(1 / 12) / REFERENCE["K"])
    ratio = saturation.value / (noise.value + 0.5)
    assert wrong == 20 * np.log(ratio)
    right, times = says("61.7 dB. The natural logarithm is 2.303 times as large")
    assert right == db(ratio)
    assert times == np.log(10)
    again, about = says("A published result file has this very error: 142 dB, from a camera that has 62.")
    assert again == wrong.value
    assert about == db(ratio)


def test_decibels(says):
    ratio, decibels, saturation = says("10 to 1 is 20 dB: a saturation of 10 and a dark noise of ½ give that ratio.")
    assert saturation.value / (0.5 + 0.5) == ratio.value
    assert decibels == lesson14.dynamic_range_db(saturation.value, 0.5)
    signals, powers = says("ratios of signals take 20, of powers 10.")
    assert signals.value * np.log10(7.0) == pytest.approx(powers.value * np.log10(7.0**2))
    twenty, ten = says("It was the logarithm that was at fault, and not the 20: with 10 the fault is only halved.")
    assert twenty == signals.value
    assert ten.value * np.log(7) == pytest.approx(twenty.value * np.log(7) / 2)
    (lost,) = says("The 20 is lost.")
    assert lost == signals.value
    base, factor = says("These are stops, factors of 2. Decibels are 20 times the logarithm to another base.")
    assert factor == signals.value
    assert np.log2(base.value) == 1
    (base,) = says("The logarithm to base 2 counts stops.")
    assert np.log2(base.value) == 1


def test_dynamic_range_is_the_sensor_s_but_for_the_approximation_and_the_rounding():
    for full_well, noise in cases(lesson14.DYNAMIC_RANGE_DB):
        for one, other, found in np.nditer([full_well, noise, lesson14.dynamic_range_db(full_well, noise)]):
            sensor = Sensor(0.5, float(one), float(other), gain_dn_per_e=65535 / float(one), offset_dn=0, bits=16)
            approximated = db((other + 0.5) / threshold(other, one / 65535))
            assert decibel(sensor.dynamic_range()) == pytest.approx(float(found + approximated), abs=1e-6)


def test_what_arrives_in_its_own_packet_is_the_impulse_response_s_first_value():
    for electrons, efficiency in cases(lesson14.ARRIVING):
        apart = np.diag(electrons)  # each row's charge in a column of its own
        own = np.diag(transferred(apart, efficiency))
        np.testing.assert_allclose(lesson14.arriving(electrons, efficiency), own, rtol=1e-9)


# 7: what is published -------------------------------------------------------------------------------------------------


def test_the_question_about_two_sheets(says):
    a = says("**A**: quantum efficiency 77 %, 6.8 e⁻ of noise in the dark, saturated at 32,700 e⁻.")
    assert a[0] == IMX174_MEASURED["η"]
    assert a[1] == IMX174_MEASURED["noise"]
    assert a[2].about(IMX174_MEASURED["saturation"], within=0.001)
    b = says("**B**: 57 %, 8.3 e⁻, 5900 e⁻.")
    assert b[0] == ICX625_POINT_GREY["η"]
    assert b[1] == ICX625_POINT_GREY["noise"]
    assert b[2].about(ICX625_POINT_GREY["saturation"], within=0.001)
    says("The CMOS sensor wins in every figure here.")
    assert a[0].value > b[0].value
    assert a[1].value < b[1].value
    assert a[2].value > b[2].value
    efficiency, noise, saturation = says(
        "The KAF-3200ME, a CCD too, has 79 %, 12.6 e⁻ and 70,000 e⁻, and a greater dynamic range than A."
    )
    assert KAF_3200ME.technology == "CCD"
    assert efficiency == KAF_3200ME_MEASURED["η"] == 100 * KAF_3200ME.sensor.efficiency()
    assert noise == KAF_3200ME_MEASURED["noise"] == KAF_3200ME.sensor.read_noise_e
    assert saturation == KAF_3200ME_MEASURED["saturation"] == KAF_3200ME.sensor.saturation_e
    assert saturation.value / threshold(noise.value) > a[2].value / threshold(a[1].value)
    wide, narrow, times = says("A's pixels are 5.86 µm wide, B's 3.45 µm: 2.9 times the area.")
    assert wide == IMX174_MEASURED["pitch"] == IMX174.pitch_um
    assert narrow == ICX625_POINT_GREY["pitch"]
    assert times == (wide.value / narrow.value) ** 2


def test_types_mix_however_the_table_is_sorted(says):
    says(
        "Sort the table by any column: the types mix. There are CCDs at both ends of the dynamic range, and CMOS "
        "sensors between them."
    )
    rows = [one for one in PUBLISHED if one.technology in ("CCD", "CMOS")]
    columns = {
        "efficiency": lambda one: float(one.sensor.efficiency()),
        "saturation": lambda one: one.sensor.saturation_e,
        "noise": lambda one: one.sensor.read_noise_e,
        "range": lambda one: db(one.sensor.saturation_e / threshold(one.sensor.read_noise_e)),
    }
    for column in columns.values():
        types = [one.technology for one in sorted(rows, key=column)]
        assert sum(first != second for first, second in pairwise(types)) >= 2
    says("By dynamic range the best of them is a CCD, and so is the worst. CMOS sensors lie between.")
    stated = [one for one in rows if np.isfinite(one.stated_dynamic_range_db)]
    in_order = [one.technology for one in sorted(stated, key=lambda one: one.stated_dynamic_range_db)]
    assert in_order[0] == in_order[-1] == "CCD"
    assert "CMOS" in in_order
    by_range = [one.technology for one in sorted(rows, key=columns["range"])]
    assert by_range[0] == by_range[-1] == "CCD"
    assert "CMOS" in by_range


def test_the_table_says_that_its_figures_are_quoted(says):
    says("No sheet was at hand itself: the pages in the list above quote them, most of them pages of amateurs.")
    says("Only the KAF-3200ME was measured by the author of its page.")
    says("None of the sensors with a name came after the IMX174: the table is no survey of what is sold today.")
    quoted = [one for one in PUBLISHED if one.technology in ("CCD", "CMOS") and "measured for" not in one.source]
    assert all("quoted" in one.source or "summarised" in one.source for one in quoted)
    assert [one.name for one in PUBLISHED if "measured for" in one.source] == ["KAF-3200ME"]


def test_one_sensor_in_cameras_of_two_makers(says):
    said = says(
        "It is *one* sensor, in cameras of two makers: 57 % at 525 nm against 47 % at 545 nm, 8.3 e⁻ against 13 e⁻."
    )
    point_grey, basler = ICX625_POINT_GREY, ICX625_BASLER
    assert said[0] == point_grey["η"]
    assert said[1] == point_grey["nm"]
    assert said[2] == basler["η"]
    assert said[3] == basler["nm"]
    assert said[4] == point_grey["noise"]
    assert said[5] == basler["noise"]
    says("Basler's figure is saturation over *noise*: its sheet says so. Point Grey's lies between the two.")
    assert round(np.log2(basler["saturation"] / basler["noise"]), 1) == basler["bits"]
    over_noise = np.log2(point_grey["saturation"] / point_grey["noise"])
    over_threshold = np.log2(point_grey["saturation"] / (point_grey["noise"] + 0.5))
    assert over_threshold < point_grey["bits"] < over_noise


def test_the_quiz_about_decibels(says):
    (percent,) = says("A sheet says: quantum efficiency 80 %.")
    assert 0 < percent.value < 100  # made up
    full_a, noise_a, full_b, noise_b = says(
        "Sensor A is saturated at 30,000 e⁻ and has 7 e⁻ of noise in the dark. Sensor B: 10,000 e⁻ and 2 e⁻."
    )
    top, bottom, ratio, decibels, top_b, bottom_b, ratio_b = says(
        "It is a *ratio*: 30,000 / 7.5 is 4000, 72.0 dB. For B, 10,000 / 2.5 is 4000 too."
    )
    assert (top.value, bottom.value) == (full_a.value, noise_a.value + 0.5)
    assert (top_b.value, bottom_b.value) == (full_b.value, noise_b.value + 0.5)
    assert ratio == top.value / bottom.value
    assert ratio_b == top_b.value / bottom_b.value
    assert decibels == db(ratio.value)
    turned = says("It is a *ratio*: 10,000 / 2.5 is 4000, 72.0 dB. For A, 30,000 / 7.5 is 4000 too.")
    assert [one.value for one in turned] == [
        one.value for one in (top_b, bottom_b, ratio_b, decibels, top, bottom, ratio)
    ]
    to_one, decibels, stops = says("They are equal: 4000 to 1, 72 dB, 12 stops.")
    assert to_one == ratio.value
    assert decibels == db(ratio.value)
    assert stops == np.log2(ratio.value)
    cleaner, other = says(
        "Yet A's brightest parts are cleaner (SNR 173 against 100), and B needs a third of A's electrons in the dark."
    )
    assert cleaner == np.sqrt(full_a.value)
    assert other == np.sqrt(full_b.value)
    assert bottom_b.value == pytest.approx(bottom.value / 3)


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_two_efficiencies(says):
    high, low = says("one sensor makes an electron of 70 % of all photons, and another one of 60 %")
    (asked,) = says("What can make the sensor with 60 % collect more electrons in the same light?")
    here, there = says("That its 60 % hold for your wavelength, and the other's 70 % for another one.")
    assert (here.value, asked.value, there.value) == (low.value, low.value, high.value)
    peak = max(KAF_0400_CURVE.values())
    assert min(KAF_0400_CURVE.values()) / peak < low.value / high.value  # wavelengths differ by more than these two


def test_before_the_lesson_cmos_sensors_with_a_global_shutter(says):
    says("the IMX174 and the CMV4000 are CMOS sensors")
    assert all(one.technology.startswith("CMOS") and "global shutter" in str(one) for one in (IMX174, CMV4000))


def test_before_the_lesson_two_sensors_of_one_range(says):
    half = 0.5
    full_a, noise_a, full_b = says(
        "Sensor A is saturated at 45,000 e⁻ and has 8.5 e⁻ of noise in the dark, sensor B 7500 e⁻ and 1 e⁻."
    )
    says("Dynamic range is saturation divided by the threshold, which is the noise plus ½.")
    ratios = full_a.value / (noise_a.value + half), full_b.value / (1 + half)
    (same,) = says("Both have the same, 5000 to 1.")
    assert all(same == one for one in ratios)
    decibels, stops = says("Yes, 74 dB or 12.3 stops.")
    assert decibels == db(ratios[0])
    assert stops == np.log2(ratios[1])
    b, by_b, a, by_a, both = says("B gets 7500/1.5, and A 45,000/9: both 5000.")
    a_2, by_a_2, b_2, by_b_2, both_2 = says("A gets 45,000/9, and B 7500/1.5: both 5000.")
    assert (a.value, b.value) == (a_2.value, b_2.value) == (full_a.value, full_b.value)
    assert (by_a.value, by_b.value) == (by_a_2.value, by_b_2.value) == (noise_a.value + half, 1 + half)
    assert both == a.value / by_a.value
    assert both_2 == b.value / by_b.value
    says("it holds six times as many electrons")
    says("Its threshold is six times as high, too.")
    assert full_a.value / full_b.value == by_a.value / by_b.value == 6
