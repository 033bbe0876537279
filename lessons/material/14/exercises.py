"""Lesson 14, image sensors: row times, decibels, a leaky bucket brigade, electrons from lux, reset noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

PHOTONS_PER_LUX = 4091.0  # of 555 nm, per second and µm²: 1/683 W/m² over h c / λ


# 4: electrons from lux -----------------------------------------------------------------------------------------------


def expected_electrons(lux: Array, f_number: float, pitch_um: float, exposure_s: float, efficiency: float) -> Array:
    """Electrons (...) in a pixel that sees a white wall under `lux` (...): η · 4091 E t p², E = lux / 4N²."""
    return efficiency * PHOTONS_PER_LUX * lux / (4 * f_number**2) * exposure_s * pitch_um**2


def _electron_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        others = (rng.uniform(1.4, 8), rng.uniform(2, 9), rng.uniform(1e-3, 0.1), rng.uniform(0.1, 0.9))
        yield (rng.uniform(100, 1000, shape), *(float(one) for one in others))
    yield (np.array([0.0, 1e-3, 1e5]), 2.0, 5.0, 0.02, 0.5)  # no light, hardly any, and the sun's


EXPECTED_ELECTRONS = Exercise(
    name="14.expected_electrons",
    reference=expected_electrons,
    cases=_electron_cases,
    shown=((np.array(500.0), 4.0, 3.45, 0.01, 0.77),),
    hints=(
        "Go step by step: lux on the wall → lux on the sensor → photons per µm² → photons on the pixel → electrons. "
        "Which of these steps is missing, or there twice?",
        "The equation above with π L = lux, T = 1 and θ = 0 tells the lux on the sensor. Photons grow with those lux, "
        "with the time, and with the pixel's area. A share η of the photons frees electrons.",
        "`photons = 4091 * ___ * exposure_s * ___`",
    ),
    praise="From lux to electrons, without a constant that a datasheet would not give you.",
    tolerance=2e-4,  # 4091 is rounded: the lesson's own photons_per_lux is as good
)


@EXPECTED_ELECTRONS.right
def with_the_constants_of_nature(lux, f_number, pitch_um, exposure_s, efficiency):
    from scipy.constants import c, h

    watts_per_m2 = lux / (4 * f_number**2) / 683
    photons_per_s = watts_per_m2 * (1e-6 * pitch_um) ** 2 / (h * c / 555e-9)
    return efficiency * photons_per_s * exposure_s


@EXPECTED_ELECTRONS.right
def in_single_precision(lux, f_number, pitch_um, exposure_s, efficiency):
    dose = np.asarray(lux, dtype=np.float32) * np.float32(exposure_s) / np.float32(2 * f_number) ** 2
    return np.float32(4091 * efficiency) * dose * np.float32(pitch_um) ** 2


@EXPECTED_ELECTRONS.wrong("You multiply by the pixel's pitch. Light falls on its *area*, pitch².")
def pitch_for_area(lux, f_number, pitch_um, exposure_s, efficiency):
    return expected_electrons(lux, f_number, 1.0, exposure_s, efficiency) * pitch_um


@EXPECTED_ELECTRONS.wrong("The f-number enters squared: it sets the aperture's *diameter*, and light uses the area.")
def f_number_not_squared(lux, f_number, pitch_um, exposure_s, efficiency):
    return 4091 * efficiency * lux / (4 * f_number) * exposure_s * pitch_um**2


@EXPECTED_ELECTRONS.wrong("`lux / 4 * f_number**2` *multiplies* by N². Put brackets around the divisor.")
def brackets_forgotten(lux, f_number, pitch_um, exposure_s, efficiency):
    return 4091 * efficiency * (lux / 4 * f_number**2) * exposure_s * pitch_um**2


@EXPECTED_ELECTRONS.wrong("Those are the lux on the wall. The lens lets a small part of them through to the sensor.")
def without_a_lens(lux, f_number, pitch_um, exposure_s, efficiency):
    return 4091 * efficiency * lux * exposure_s * pitch_um**2


@EXPECTED_ELECTRONS.wrong("These are the *photons*. Only a share η of them frees an electron.")
def photons(lux, f_number, pitch_um, exposure_s, efficiency):
    return expected_electrons(lux, f_number, pitch_um, exposure_s, 1.0)


# 1: a lamp's stripes -------------------------------------------------------------------------------------------------


def row_time(stripes: Array, rows: int, mains_hz: float) -> Array:
    """Seconds from row to row when a frame of `rows` rows shows that many bright stripes (...) of a lamp on the mains.

    The lamp is bright twice in each period, so `stripes` stripes last stripes / 2 mains_hz seconds.
    """
    return np.asarray(stripes) / (2 * mains_hz * rows)


def _row_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, mains_hz in zip(SHAPES, (50.0, 60.0, 60.0, 50.0), strict=True):
        yield rng.uniform(1.5, 9, shape), int(rng.integers(480, 2160)), mains_hz


ROW_TIME = Exercise(
    name="14.row_time",
    reference=row_time,
    cases=_row_cases,
    shown=((np.array(3.0), 1080, 50.0),),
    hints=(
        "How long does one stripe last? How long do all the stripes of a frame last? And how many rows is that?",
        "The current has two strong moments in each of its periods, one each way, and the lamp is bright in both. So a "
        "stripe lasts half a period, and the frame as many half periods as it has stripes.",
        "`frame_s = stripes / ___`",
    ),
    praise="A lamp and a telephone are all it takes. Measure yours.",
    tolerance=1e-11,  # of microseconds
)


@ROW_TIME.right
def by_rows_in_a_stripe(stripes, rows, mains_hz):
    rows_in_a_stripe = rows / np.asarray(stripes)
    return 1 / (2 * mains_hz) / rows_in_a_stripe


@ROW_TIME.right
def stripe_by_stripe_as_a_list(stripes, rows, mains_hz):
    return np.reshape([one / 2 / mains_hz / rows for one in np.ravel(stripes).tolist()], np.shape(stripes)).tolist()


@ROW_TIME.wrong("This is twice too long: the current flows both ways, so the lamp is bright *twice* in each period.")
def bright_once_in_a_period(stripes, rows, mains_hz):
    return np.asarray(stripes) / mains_hz / rows


@ROW_TIME.wrong("This is the time of the whole frame. Divide it by `rows`.")
def the_whole_frame(stripes, rows, mains_hz):
    return np.asarray(stripes) / (2 * mains_hz)


@ROW_TIME.wrong("More stripes mean a *slower* sensor: the lamp is bright more often during the frame.")
def fewer_with_more_stripes(stripes, rows, mains_hz):
    return 1 / (2 * mains_hz * rows * np.asarray(stripes))


@ROW_TIME.wrong("Your function fits mains of 50 Hz only. Some mains have 60 Hz: use `mains_hz`.")
def fifty_hertz_written_in(stripes, rows, mains_hz):
    return np.asarray(stripes) / 100 / rows


@ROW_TIME.wrong("The stripes fill all rows of the frame, its last one too: divide by `rows`, not by one less.")
def gaps_between_rows(stripes, rows, mains_hz):
    return np.asarray(stripes) / (2 * mains_hz) / (rows - 1)


# 2: find the bug in the decibels --------------------------------------------------------------------------------------


def dynamic_range_db(saturation_e: Array, dark_noise_e: Array) -> Array:
    """20 log10 of saturation over the threshold that EMVA 1288 prints, σ_d + ½, both in electrons."""
    return 20 * np.log10(np.asarray(saturation_e) / (np.asarray(dark_noise_e) + 0.5))


def dynamic_range_as_given(saturation_e, dark_noise_e):
    ratio = saturation_e / (dark_noise_e + 0.5)
    return 20 * np.log(ratio)


def _range_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(3000, 90_000, shape), rng.uniform(2, 15, shape)
    noise = rng.uniform(2, 15, 3)
    yield np.array([0.1, 1, 10]) * (noise + 0.5), noise  # below the threshold, at it, and ten times above
    yield np.array([3000.0, 9000.0]), np.array([0.0, 0.7])  # without any noise the threshold is ½


DYNAMIC_RANGE_DB = Exercise(
    name="14.dynamic_range_db",
    reference=dynamic_range_db,
    cases=_range_cases,
    as_given=dynamic_range_as_given,
    hints=(
        "Put in a ratio that you know. 10 to 1 is 20 dB: a saturation of 10 and a dark noise of ½ give that ratio.",
        "The ratio itself is right. Look up what NumPy's logarithms have as their bases, and which base decibels need.",
        "`return 20 * np.___(ratio)`",
    ),
    praise="A published result file has this very error: 142 dB, from a camera that has 62.",
    tolerance=1e-6,
)


@DYNAMIC_RANGE_DB.right
def as_a_difference_of_levels(saturation_e, dark_noise_e):
    return 20 * np.log10(saturation_e) - 20 * np.log10(np.asarray(dark_noise_e) + 0.5)


@DYNAMIC_RANGE_DB.wrong("The 20 was right, and the logarithm is still wrong. Change its base, not the 20.")
def ten_with_the_natural_logarithm(saturation_e, dark_noise_e):
    return 10 * np.log(np.asarray(saturation_e) / (np.asarray(dark_noise_e) + 0.5))


@DYNAMIC_RANGE_DB.wrong("The logarithm is right now, but you divide by the dark noise alone. The threshold is σ_d + ½.")
def over_the_noise(saturation_e, dark_noise_e):
    return 20 * np.log10(np.asarray(saturation_e) / np.asarray(dark_noise_e))


@DYNAMIC_RANGE_DB.wrong("`a / b + 0.5` adds the ½ to the *ratio*. It belongs to the noise: keep both in brackets.")
def half_added_to_the_ratio(saturation_e, dark_noise_e):
    return 20 * np.log10(np.asarray(saturation_e) / np.asarray(dark_noise_e) + 0.5)


@DYNAMIC_RANGE_DB.wrong(
    "The exact threshold is good physics. The published file used σ_d + ½: leave the ratio as it was."
)
def over_the_exact_threshold(saturation_e, dark_noise_e):
    return 20 * np.log10(np.asarray(saturation_e) / (0.5 + np.sqrt(np.asarray(dark_noise_e) ** 2 + 0.25)))


# 3: what arrives in its own packet -----------------------------------------------------------------------------------


def arriving(electrons: Array, efficiency: float) -> Array:
    """What reaches the amplifier in its own packet, of a column (height,) whose row i takes i + 1 shifts."""
    return electrons * efficiency ** (1 + np.arange(len(electrons)))


def _brigade_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for height in (1, 2, 7, 40):
        yield rng.uniform(100, 9000, height), float(rng.uniform(0.9, 0.999))
    yield np.array([0.0, 5000.0, 0.0, 1.0]), float(rng.uniform(0.5, 0.9))  # empty buckets, and much that is left behind
    yield rng.uniform(100, 9000, 3), 1.0  # nothing is left behind


ARRIVING = Exercise(
    name="14.arriving",
    reference=arriving,
    cases=_brigade_cases,
    shown=((np.array([1000.0, 1000.0, 1000.0]), 0.99),),
    hints=(
        "Follow one bucket. What share of it is left after one shift, and after two? How many shifts does row 0 take?",
        "After n shifts a power of the efficiency is left. Make an array of each row's n: `np.arange` counts from "
        "0, but even row 0 has to be shifted into the register.",
        "`return electrons * efficiency**___`",
    ),
    praise="This is why a CCD of 6000 rows needs a transfer efficiency of 0.999999.",
    tolerance=1e-9,
)


@ARRIVING.right
def by_the_binomial_law(electrons, efficiency):
    from scipy.stats import nbinom

    return electrons * nbinom.pmf(0, 1 + np.arange(len(electrons)), efficiency)


@ARRIVING.wrong("This is one shift too few: even row 0 must be shifted once, into the register.")
def row_0_not_shifted(electrons, efficiency):
    return electrons * efficiency ** np.arange(len(electrons))


@ARRIVING.wrong("Losses do not add, they multiply: each shift leaves behind a share of what is *still there*.")
def losses_added(electrons, efficiency):
    return electrons * (1 - (1 - efficiency) * (1 + np.arange(len(electrons))))


@ARRIVING.wrong("1 − efficiency is the share left behind. The efficiency itself moves on at each shift.")
def the_share_left_behind(electrons, efficiency):
    return electrons * (1 - efficiency) ** (1 + np.arange(len(electrons)))


@ARRIVING.wrong("The order is reversed: row 0 is the nearest to the register and has the shortest way.")
def far_rows_first(electrons, efficiency):
    return electrons * (efficiency ** (1 + np.arange(len(electrons))))[::-1]


@ARRIVING.wrong("You count the trails of other rows. Only what arrives in its *own* packet counts here.")
def with_the_trails(electrons, efficiency):
    buckets, arrived = np.array(electrons, dtype=float), []
    for _ in range(len(buckets)):
        moved = efficiency * buckets
        buckets -= moved
        buckets[:-1] += moved[1:]
        arrived.append(moved[0])
    return np.array(arrived)


# 5: reset noise ------------------------------------------------------------------------------------------------------

BOLTZMANN, CHARGE = 1.380649e-23, 1.602176634e-19  # J/K and C, both exact since 2019


def reset_noise_e(uv_per_electron: Array, kelvin: Array) -> Array:
    """√(k T C) / q electrons (...), of a capacitance C = q / gain."""
    capacitance = CHARGE / (1e-6 * np.asarray(uv_per_electron))
    return np.sqrt(BOLTZMANN * np.asarray(kelvin) * capacitance) / CHARGE


def _reset_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(20, 200, shape), float(rng.uniform(230, 340))
    yield np.array([1.0, 60.0]), float(rng.uniform(60, 100))  # a large capacitance, and a cold sensor


RESET_NOISE_E = Exercise(
    name="14.reset_noise_e",
    reference=reset_noise_e,
    cases=_reset_cases,
    shown=((np.array(30.0), 300.0),),
    hints=(
        "Two steps: first the capacitance in farads, then the noise. What is a microvolt in volts?",
        "The conversion gain is q/C, in volts for each electron when C is in farads. Turn that round for C, and put it "
        "into the equation above.",
        "`capacitance = q / (1e-6 * ___)`",
    ),
    praise="Less capacitance, less reset noise. And two readings take away what is left of it.",
    tolerance=1e-6,
)


@RESET_NOISE_E.right
def by_the_constants_of_scipy(uv_per_electron, kelvin):
    from scipy import constants

    return np.sqrt(constants.k * kelvin / constants.e / (1e-6 * np.asarray(uv_per_electron)))


@RESET_NOISE_E.wrong("This is far too small. Take √(k T C), with only k T C under the root, over the charge q.")
def without_the_root(uv_per_electron, kelvin):
    return BOLTZMANN * kelvin * (CHARGE / (1e-6 * np.asarray(uv_per_electron))) / CHARGE


@RESET_NOISE_E.wrong("This is the noise in volts, √(k T / C). One electron makes q/C volts: divide by that.")
def in_volts(uv_per_electron, kelvin):
    return 1e-6 * np.asarray(uv_per_electron) * reset_noise_e(uv_per_electron, kelvin)


@RESET_NOISE_E.wrong("You use the gain as the capacitance. The gain is q/C, so C is q divided by it.")
def gain_for_capacitance(uv_per_electron, kelvin):
    return np.sqrt(BOLTZMANN * kelvin * 1e-6 * np.asarray(uv_per_electron)) / CHARGE


@RESET_NOISE_E.wrong("The temperature is in kelvin already, as its name says. You add 273.15 once more.")
def celsius_taken(uv_per_electron, kelvin):
    return reset_noise_e(uv_per_electron, np.asarray(kelvin) + 273.15)


EXERCISES = (ROW_TIME, DYNAMIC_RANGE_DB, ARRIVING, EXPECTED_ELECTRONS, RESET_NOISE_E)
