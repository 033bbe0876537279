"""Lesson 14, image sensors: electrons from lux, row times from a lamp's stripes, decibels, a leaky bucket brigade."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise

PHOTONS_PER_LUX = 4091.0  # of 555 nm, per second and µm²: 1/683 W/m² over h c / λ


def expected_electrons(lux: Array, f_number: float, pitch_um: float, exposure_s: float, efficiency: float) -> Array:
    """Electrons (...) in a pixel that sees a white wall under `lux` (...): η · 4091 E t p², E = lux / 4N²."""
    return efficiency * PHOTONS_PER_LUX * lux / (4 * f_number**2) * exposure_s * pitch_um**2


def row_time(stripes: Array, rows: int, mains_hz: float) -> Array:
    """Seconds from row to row when a frame of `rows` rows shows that many bright stripes (...) of a lamp on the mains.

    The lamp is bright twice in each period, so `stripes` stripes last stripes / 2 mains_hz seconds.
    """
    return np.asarray(stripes) / (2 * mains_hz * rows)


def dynamic_range_db(full_well_e: Array, dark_noise_e: Array) -> Array:
    """20 log10 of full well over absolute sensitivity threshold, both in electrons: EMVA 1288."""
    return 20 * np.log10(np.asarray(full_well_e) / (np.asarray(dark_noise_e) + 0.5))


def arriving(electrons: Array, efficiency: float) -> Array:
    """What reaches the amplifier in its own packet, of a column (height,) whose row i takes i + 1 shifts."""
    return electrons * efficiency ** (1 + np.arange(len(electrons)))


def _electron_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        others = (rng.uniform(1.4, 16), rng.uniform(1, 9), rng.uniform(1e-4, 0.1), rng.uniform(0.1, 0.95))
        yield (rng.uniform(10, 1000, shape), *(float(one) for one in others))


def _row_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(0.5, 9, shape), int(rng.integers(480, 2160)), float(rng.choice([50.0, 60.0]))


def _range_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(3000, 90_000, shape), rng.uniform(1, 15, shape)


def _brigade_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for height in (1, 2, 7, 40):
        yield rng.uniform(100, 9000, height), float(rng.uniform(0.9, 0.999))


EXPECTED_ELECTRONS = Exercise(
    name="14.expected_electrons",
    reference=expected_electrons,
    cases=_electron_cases,
    shown=((np.array(500.0), 4.0, 3.45, 0.01, 0.77),),
    hints=(
        "Go step by step: lux on the wall → lux on the sensor → photons per µm² → photons on the pixel → electrons.",
        "The lens leaves E = lux / (4 N²). Multiply by 4091, by the exposure, by the pixel's *area*, and by η.",
    ),
    praise="From lux to electrons, without a constant that a datasheet would not give you.",
    tolerance=1e-6,
)


@EXPECTED_ELECTRONS.wrong("You multiplied by the pixel's pitch. Light falls on its *area*, pitch².")
def _(lux, f_number, pitch_um, exposure_s, efficiency):
    return expected_electrons(lux, f_number, 1.0, exposure_s, efficiency) * pitch_um


@EXPECTED_ELECTRONS.wrong(
    "The f-number enters squared: N is about the aperture's *diameter*, and light goes through its area."
)
def _(lux, f_number, pitch_um, exposure_s, efficiency):
    return 4 * f_number * expected_electrons(lux, f_number, pitch_um, exposure_s, efficiency) / 4


@EXPECTED_ELECTRONS.wrong("A factor of 4 too many: E = π L / (4 N²), and a matt white wall has L = lux / π.")
def _(lux, f_number, pitch_um, exposure_s, efficiency):
    return 4 * expected_electrons(lux, f_number, pitch_um, exposure_s, efficiency)


@EXPECTED_ELECTRONS.wrong("These are the *photons*. Only a share η of them frees an electron.")
def _(lux, f_number, pitch_um, exposure_s, efficiency):
    return expected_electrons(lux, f_number, pitch_um, exposure_s, 1.0)


@EXPECTED_ELECTRONS.wrong("These are electrons per *second*: the exposure is missing.")
def _(lux, f_number, pitch_um, exposure_s, efficiency):
    return expected_electrons(lux, f_number, pitch_um, exposure_s, efficiency) / exposure_s


ROW_TIME = Exercise(
    name="14.row_time",
    reference=row_time,
    cases=_row_cases,
    shown=((np.array(3.0), 1080, 50.0),),
    hints=(
        "How long does one stripe last? Then: how long do all stripes of the frame last, and how many rows is that?",
        "A lamp on 50 Hz mains flickers 100 times a second. A frame with s stripes lasts s / 100 s, over all its rows.",
    ),
    praise="A lamp and a telephone are all it takes. Measure yours.",
    tolerance=1e-9,
)


@ROW_TIME.wrong("A factor of 2 too long: the current flows both ways, so the lamp is bright *twice* in each period.")
def _(stripes, rows, mains_hz):
    return 2 * row_time(stripes, rows, mains_hz)


@ROW_TIME.wrong("This is the time of the whole frame. From one row to the next is one `rows`-th of it.")
def _(stripes, rows, mains_hz):
    return rows * row_time(stripes, rows, mains_hz)


@ROW_TIME.wrong(
    "More stripes mean a *slower* sensor: the more often the lamp flickers meanwhile, the longer the frame."
)
def _(stripes, rows, mains_hz):
    return 1 / (2 * mains_hz * rows * np.asarray(stripes))


DYNAMIC_RANGE_DB = Exercise(
    name="14.dynamic_range_db",
    reference=dynamic_range_db,
    cases=_range_cases,
    shown=((np.array(13_973.0), np.array(10.898)),),
    bug=True,
    hints=(
        "Try a ratio of 10 : 1, which is 20 dB. What does the function make of it?",
        "`np.log` is the natural logarithm. A decibel is made with the one to base 10.",
    ),
    praise="A published result file has this very error: 142 dB, from a camera that has 62.",
    tolerance=1e-6,
)


@DYNAMIC_RANGE_DB.wrong(
    "The ratio is right, and its logarithm is the natural one: for 10 : 1 you get 46, where 20 dB are wanted."
)
def _(full_well_e, dark_noise_e):
    return dynamic_range_db(full_well_e, dark_noise_e) * np.log(10)


@DYNAMIC_RANGE_DB.wrong("Half of it: signals, unlike powers, take 20 log10 in EMVA 1288.")
def _(full_well_e, dark_noise_e):
    return dynamic_range_db(full_well_e, dark_noise_e) / 2


@DYNAMIC_RANGE_DB.wrong(
    "This divides by the dark noise alone, as older sheets do. EMVA 1288 divides by the threshold, σ_d + ½."
)
def _(full_well_e, dark_noise_e):
    return 20 * np.log10(np.asarray(full_well_e) / np.asarray(dark_noise_e))


@DYNAMIC_RANGE_DB.wrong("These are stops. In decibels it is 20 log10 of the same ratio.")
def _(full_well_e, dark_noise_e):
    return np.log2(np.asarray(full_well_e) / (np.asarray(dark_noise_e) + 0.5))


ARRIVING = Exercise(
    name="14.arriving",
    reference=arriving,
    cases=_brigade_cases,
    shown=((np.array([1000.0, 1000.0, 1000.0]), 0.99),),
    hints=(
        "After one shift a share c is left, after two c·c. How many shifts does row 0 take, and row i?",
        "`efficiency ** (1 + np.arange(len(electrons)))` is the share of each row.",
    ),
    praise="This is why a CCD of 6000 rows needs a transfer efficiency of 0.999999.",
    tolerance=1e-9,
)


@ARRIVING.wrong("One shift too few: even row 0 must be shifted once, into the register.")
def _(electrons, efficiency):
    return electrons * efficiency ** np.arange(len(electrons))


@ARRIVING.wrong("Every row loses as much here. A farther one has a longer way: multiply once for each shift.")
def _(electrons, efficiency):
    return electrons * efficiency


@ARRIVING.wrong("Losses do not add, they multiply: each shift leaves behind a share of what is *still there*.")
def _(electrons, efficiency):
    return electrons * (1 - (1 - efficiency) * (1 + np.arange(len(electrons))))


@ARRIVING.wrong("The order is turned round: row 0 is the nearest to the register and has the shortest way.")
def _(electrons, efficiency):
    return electrons * (efficiency ** (1 + np.arange(len(electrons))))[::-1]


EXERCISES = (EXPECTED_ELECTRONS, ROW_TIME, DYNAMIC_RANGE_DB, ARRIVING)
