"""What lesson 14 claims about image sensors, recomputed with SciPy's constants, colour-science and NumPy."""

import colour
import numpy as np
import pytest
from claims import claims
from scipy import constants
from scipy.stats import nbinom

from camviz.sensors import PUBLISHED, SHUTTERS, Sensor, decibel, transferred
from camviz.sensors.published import CMV4000, IMX174, KAF_3200ME
from camviz_school.course.material import module
from camviz_school.views.readout import ReadoutView, fan

says = claims("14")
lesson14 = module("14")

NOISE, FULL = 6.83, 6000.0
"""Of the sensor whose converter part 4 varies: the IMX174 as EMVA's test has it, as if it were full at 6000 e⁻."""


def threshold(noise, step=0.0):
    """The μ with μ = sqrt(noise² + step²/12 + μ), found as a root of μ² − μ − σ²."""
    return np.roots([1, -1, -(noise**2 + step**2 / 12)]).real.max()


def db(ratio):
    return 20 * np.log10(ratio)


def step_of(bits, full=FULL):
    return full / (2**bits - 1)


def reset_noise(microvolts, kelvin=300.0):
    """In electrons, by the energy that heat leaves on a capacitor: ½ C ⟨V²⟩ = ½ k T; an electron makes q/C volts."""
    capacitance = constants.e / (microvolts * 1e-6)
    return np.sqrt(constants.k * kelvin / capacitance) / (microvolts * 1e-6)


def test_a_short_exposure_takes_the_blur_and_leaves_the_bend():
    says("photographs a fan that makes 12 turns a second", "You shorten the exposure from 1/100 s to 1/1000 s.")
    says(
        "each of its 480 rows is exposed 64 µs after the one above",
        "the last row is still exposed 31 ms after the first",
    )
    says("the tip of a blade, 206.4 pixels from the hub, moves 156 pixels; in 1/1000 s it moves 16")
    radius, angle = np.linspace(0.2, 0.89, 6901)[:, None], np.linspace(0, 2 * np.pi, 60)
    blade = fan(radius * np.cos(angle), radius * np.sin(angle), 0.0)[..., 2] < 0.3
    tip = 240 * radius[blade.any(axis=1)].max()
    assert tip == pytest.approx(206.4, abs=0.05)
    moved, apart = 2 * np.pi * 12 * tip, 479 * 64e-6
    assert [1e3 * apart, moved / 100, moved / 1000] == pytest.approx([31, 156, 16], abs=0.5)
    said = ReadoutView(exposure_ms=10.0).numbers()
    assert said["during one exposure"] == f"a blade's tip moves {moved / 100:.0f} px"
    assert said["between first and last row's exposure"] == f"a blade's tip moves {moved * apart:.0f} px"
    says("and the fan makes more than a third of a turn meanwhile")
    assert 1 / 3 < 12 * apart < 1 / 2
    says("Then pull **exposure** up to 10 ms. The stripes go, for each row gathers one whole flash of the lamp.")
    assert 2 * 50 * 0.010 == 1  # flashes of a lamp on 50 Hz
    for one in SHUTTERS:
        assert lesson14.row_time(one.frame_s * 100, one.height, 50) == pytest.approx(one.row_s)


def test_a_packet_arrives_with_a_trail():
    says("still arrives with 0.999999⁶¹³² = 99.4 % of its charge in place")
    assert pytest.approx(99.4, abs=0.05) == 100 * 0.999999**6132
    says("Row 19 needs twenty shifts, and 818 of its 1000 electrons arrive in their own packet.")
    says("How much comes k rows late is the *negative binomial* law")
    law = 1000 * nbinom.pmf(np.arange(5), 20, 0.99)
    assert law[0] == pytest.approx(818, abs=0.5)
    point = np.zeros((60, 1))
    point[19] = 1000
    np.testing.assert_allclose(transferred(point, 0.99)[19:24, 0], law, atol=1e-3)
    assert lesson14.arriving(point[:, 0], 0.99)[19] == pytest.approx(law[0])


def test_photons_of_a_lux():
    says("A lux is 1/683 W/m² of green light of 555 nm", "with 4091 photons per lux, second and µm²")
    assert constants.physical_constants["luminous efficacy"][0] == 683
    per_lux = 1e-12 / 683 / (constants.h * constants.c / 555e-9)
    assert per_lux == pytest.approx(4091, abs=0.5)
    says("A lux of daylight (D65) is more photons, 13,900 between 380 and 780 nm")
    shape = colour.SpectralShape(380, 780, 5)
    power = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values[:, 1]
    photons = np.trapezoid(power.values * power.wavelengths) * 1e-21 / (constants.h * constants.c)
    assert photons / (683 * np.trapezoid(power.values * eye)) == pytest.approx(13_900, rel=0.002)
    angle = np.linspace(0, np.arctan(1 / 16), 20_001)  # of f/8
    lit = 2 * np.pi * np.trapezoid(np.cos(angle) * np.sin(angle), angle)  # ∫ L cos θ dΩ over the aperture, L = 1
    right = 0.5 * per_lux * 500 / np.pi * lit * 0.01 * 2**2  # a matt white wall of 500 lux, η = ½, 10 ms, 2 µm
    assert lesson14.expected_electrons(500.0, 8.0, 2.0, 0.01, 0.5) == pytest.approx(right, rel=0.005)


def test_the_threshold_is_near_sigma_and_a_half():
    says("EMVA 1288 prints the approximation σ + ½, which is within 3 % of it for every σ above 2.")
    worst = max(abs(noise + 0.5 - threshold(noise)) / threshold(noise) for noise in np.geomspace(2, 1000, 50))
    assert 0.02 < worst < 0.03
    for noise in (0.3, 2.0, 10.0):
        sensor = Sensor(1.0, 10_000, noise, gain_dn_per_e=6.5, offset_dn=0, bits=16)
        assert sensor.threshold_photons() == pytest.approx(threshold(noise, 1 / 6.5), rel=1e-9)
    says("The threshold was taken as σ + ½.", "61.7 dB. The natural logarithm is 2.303 times as large")
    ratio = 30_957 * 0.45136 / (np.hypot(10.898, np.sqrt(1 / 12) / 0.280769) + 0.5)  # the emva1288 project's file
    assert db(ratio) == pytest.approx(61.7, abs=0.05)
    assert 20 * np.log(ratio) == pytest.approx(142, abs=0.5)
    assert decibel(ratio) == pytest.approx(db(ratio))


def test_more_bits_give_little():
    says("From 16 bits to 10 hardly anything is lost, a quarter of a decibel")
    together = {bits: db(FULL / threshold(NOISE, step_of(bits))) for bits in (6, 8, 10, 16)}
    assert together[16] - together[10] == pytest.approx(0.25, abs=0.02)
    says("Six bits count 63 steps: from one step to full scale that is 36 dB. The table says 46.4 dB.")
    says("Full scale is 10.8 dB farther above this noise than above a step.")
    assert [db(63), db(np.sqrt(12)), together[6]] == pytest.approx([36, 10.8, 46.4], abs=0.05)
    says("58.3 dB, and the two together have 55.4 dB", "would have 58.2 dB")
    alone = db(FULL / threshold(NOISE)), db(FULL / threshold(0, step_of(8)))
    assert [*alone, together[8]] == pytest.approx([58.2, 58.3, 55.4], abs=0.05)
    says("EMVA 1288 asks for a variance of at least 0.24 steps² in the dark", "With this sensor that takes 9 bits.")
    assert min(bits for bits in range(4, 16) if (NOISE / step_of(bits)) ** 2 + 1 / 12 >= 0.24) == 9


def test_iso_and_dual_conversion_gain():
    """The lesson's model: 1 V of swing, 120 µV of noise before the amplifier, 300 µV after it; 30 or 120 µV/e⁻."""
    says("only the large capacitance holds all 33,333 electrons, and the range is 69.4 dB")
    says("both modes saturate at 8333 electrons", "2.7 e⁻ of noise in place of 4.7: 68.3 dB in place of 64.1")

    def of(iso, microvolts):
        full = 1e6 / 30 * 100 / iso
        noise = np.hypot(120, 300 * full * microvolts / 1e6) / microvolts
        return full, noise, db(full / (noise + 0.5))

    assert [of(100, 30)[0], of(400, 120)[0], of(400, 30)[0]] == pytest.approx([33_333, 8333, 8333], abs=0.5)
    assert [of(100, 30)[2], *of(400, 120)[1:], *of(400, 30)[1:]] == pytest.approx(
        [69.4, 2.7, 68.3, 4.7, 64.1], abs=0.05
    )


def test_reset_noise():
    says("At 300 K it is about 400 electrons for a picofarad", "a pixel of 30 µV per electron has 29.4 e⁻ of it")
    says("and one of 120 µV has 14.7 e⁻")
    assert reset_noise(1e6 * constants.e / 1e-12) == pytest.approx(400, rel=0.01)  # Janesick: 400 √C, in pF
    assert [reset_noise(30), reset_noise(120)] == pytest.approx([29.4, 14.7], abs=0.05)
    given = np.array([20.0, 90]), np.array([280.0, 310])
    np.testing.assert_allclose(lesson14.reset_noise_e(*given), reset_noise(*given))
    says("3 e⁻ in each of them make 3 √2 = 4.2 e⁻ in the difference.")
    rng = np.random.default_rng(5)
    kept, (first, second) = rng.normal(0, reset_noise(30), 400_000), rng.normal(0, 3, (2, 400_000))
    assert np.std((kept + second) - (kept + first)) == pytest.approx(4.2, abs=0.05)


def test_published_figures():
    says(
        "*A*: quantum efficiency 77 %, 6.8 e⁻ of noise in the dark, saturated at 32,700 e⁻. *B*: 57 %, 8.3 e⁻, 5900 e⁻."
    )
    says("It opens as the IMX174: 77 %, 6.8 e⁻ of noise, saturated at 32,691 e⁻")
    sensor = IMX174.sensor
    figures = [100 * sensor.efficiency(), sensor.read_noise_e, sensor.saturation_e, IMX174.pitch_um]
    assert figures == pytest.approx([77, 6.83, 32_691, 5.86])  # Point Grey's measurement
    says("It is *one* sensor, in cameras of two makers: 57 % at 525 nm against 47 % at 545 nm, 8.3 e⁻ against 13 e⁻.")
    assert round(np.log2(7000 / 13), 1) == 9.1  # Basler's bits are saturation over noise
    assert np.log2(5903 / 8.78) < 9.41 < np.log2(5903 / 8.28)  # Point Grey's lie between
    says("By dynamic range the best of them is a CCD, and so is the worst. CMOS sensors lie between.")
    rows = [one for one in PUBLISHED if one.technology in ("CCD", "CMOS")]
    order = sorted(rows, key=lambda one: one.sensor.saturation_e / threshold(one.sensor.read_noise_e))
    kinds = [one.technology for one in order]
    assert kinds[0] == kinds[-1] == "CCD" != min(kinds[1:-1], key="CCD".__eq__)


def test_questions_fill_factor_and_sheets():
    says(
        "1000 photons of 550 nm arrive on the whole pixel.",
        "600 is right for 550 nm.",
        "At 550 nm 60 of a hundred are good",
    )
    says("quantum efficiency × fill factor 60 % at 550 nm, with microlenses", "252: 42 % of 600")
    assert (1000 * CMV4000.sensor.efficiency(), 0.42 * 600) == (pytest.approx(600), pytest.approx(252))
    says("The KAF-3200ME, a CCD too, has 79 %, 12.6 e⁻ and 70,000 e⁻, and a greater dynamic range than A.")
    figures = KAF_3200ME.sensor.efficiency(), KAF_3200ME.sensor.read_noise_e, KAF_3200ME.sensor.saturation_e
    assert figures == pytest.approx((0.79, 12.6, 70_000))
    assert 70_000 / threshold(12.6) > 32_691 / threshold(6.83)
    says("A's pixels are 5.86 µm wide, B's 3.45 µm: 2.9 times the area.", "33 of a hundred photons at 550 nm, and 3 at")
    assert pytest.approx(2.9, abs=0.05) == (5.86 / 3.45) ** 2


def test_question_bits():
    says(
        "A sensor is saturated at 6000 e⁻ and has 8 e⁻ of noise in the dark.",
        "with a converter of 10 bits",
        "one of 16 bits",
    )
    says("Saturation over threshold is 6000 / 8.5, 57 dB or 9.5 stops", "By 96 dB − 60 dB = 36 dB")
    says("With 10 bits a step is 5.9 e⁻, whose rounding noise, 5.9/√12 = 1.7 e⁻", "from 8.5 to 8.7 e⁻", "worth 0.2 dB")
    says("with 9 bits, steps of 11.7 e⁻, the threshold is 9.2 e⁻ and not 8.5. With 6 bits, steps of 95 e⁻")
    assert [db(6000 / threshold(8)), db(2**16), db(2**10)] == pytest.approx([57, 96, 60], abs=0.5)
    steps = np.array([step_of(10), step_of(10) / np.sqrt(12), step_of(9), step_of(6) / 10])
    assert steps == pytest.approx([5.9, 1.7, 11.7, 9.5], abs=0.05)
    at = [threshold(8, step) for step in (0, steps[0], steps[2])]
    assert [*at, np.log2(6000 / at[0])] == pytest.approx([8.5, 8.7, 9.2, 9.5], abs=0.05)
    assert db(at[1] / threshold(8, step_of(16))) == pytest.approx(0.2, abs=0.05)


def test_questions_decibel():
    says("Sensor A is saturated at 30,000 e⁻ and has 7 e⁻ of noise in the dark. Sensor B: 10,000 e⁻ and 2 e⁻.")
    says(
        "saturated at 45,000 e⁻ and has 8.5 e⁻ of noise in the dark, sensor B 7500 e⁻ and 1 e⁻", "the same, 5000 to 1."
    )
    says(
        "30,000 / 7.5 is 4000, 72.0 dB. For B, 10,000 / 2.5 is 4000 too.", "They are equal: 4000 to 1, 72 dB, 12 stops."
    )
    says("(SNR 173 against 100)", "B gets 7500/1.5, and A 45,000/9: both 5000.", "Yes, 74 dB or 12.3 stops.")
    assert 30_000 / 7.5 == 10_000 / 2.5 == 4000
    assert 7500 / 1.5 == 45_000 / 9 == 5000
    assert [db(4000), np.log2(4000), np.log2(5000)] == pytest.approx([72.0, 12, 12.3], abs=0.05)
    assert [db(5000), np.sqrt(30_000)] == pytest.approx([74, 173], abs=0.5)
