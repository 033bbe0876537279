"""Lesson 15, sensor noise: how kinds of noise add, gain from two frames, decibels with a bug in them, flat fields, HDR.

Noise figures are standard deviations in electrons, frames are in digital numbers (DN), after EMVA Standard 1288.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise


def total_noise(electrons: Array, read_noise: float, prnu: float) -> Array:
    """Electrons of noise on one frame of pixels with so many electrons (...): sqrt(σ² + μ + (PRNU μ)²)."""
    return np.sqrt(read_noise**2 + electrons + (prnu * electrons) ** 2)


def gain(bright: Array, dark: Array) -> float:
    """K in DN per electron from two bright and two dark frames, (2, height, width) each."""
    variance = (np.var(bright[0] - bright[1]) - np.var(dark[0] - dark[1])) / 2
    return float(variance / (np.mean(bright) - np.mean(dark)))


def dynamic_range_db(full_well: Array, dark_noise: Array) -> Array:
    """20 log10 of saturation over the threshold σ_d + ½, all in electrons (...)."""
    return 20 * np.log10(full_well / (dark_noise + 0.5))


def flat_field(frame: Array, dark: Array, flat: Array) -> Array:
    """A frame (height, width) less the dark one, divided by the answer to an even light; NaN where there is none."""
    answer = np.where(flat > dark, flat - dark, np.nan)
    return (frame - dark) * (np.nanmean(answer) / answer)


def merge(electrons: Array, exposures: Array, dark_noise: float, full_well: float) -> Array:
    """Electrons per second (...) from frames (n, ...), weights t² / (σ² + x t); NaN where every frame is full."""
    t = exposures.reshape(-1, *[1] * (electrons.ndim - 1))
    usable = electrons < full_well
    some = np.where(usable.any(axis=0), 1.0, np.nan)
    x = np.sum(usable * electrons, axis=0) / (np.sum(usable * t, axis=0) * some)
    weight = usable * t**2 / (dark_noise**2 + x * t)
    return np.sum(weight * electrons / t, axis=0) / np.sum(weight, axis=0)


# Cases ----------------------------------------------------------------------------------------------------------------


def _noise_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(10, 9_000, shape), float(rng.uniform(2, 30)), float(rng.uniform(0.005, 0.03)))
    yield (np.zeros(3), float(rng.uniform(2, 30)), 0.01)


def _gain_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((20, 30), (40, 25), (16, 16)):
        K, light = rng.uniform(0.1, 2), rng.uniform(300, 5_000)
        response = 1 + 0.02 * rng.standard_normal(shape)
        offset = 60 + 3 * rng.standard_normal(shape)
        noise = 8 * rng.standard_normal((2, 2, *shape))
        bright = K * (rng.poisson(light * response, (2, *shape)) + noise[0]) + offset
        yield (np.rint(bright), np.rint(K * noise[1] + offset))


def _decibel_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(3_000, 90_000, shape), rng.uniform(1, 30, shape))


def _flat_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((4, 6), (7, 5), (6, 6)):
        dark, response = rng.uniform(55, 65, shape), rng.uniform(0.6, 1.1, shape)
        if shape == (6, 6):
            response[tuple(rng.integers(0, 6, 2))] = 0  # a dead pixel
        yield (dark + rng.uniform(100, 400, shape) * response, dark, dark + 500 * response)


def _merge_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((5,), (3, 4), (2, 6)):
        exposures = np.sort(rng.uniform(0.01, 1, rng.integers(2, 5)))
        rate = np.exp(rng.uniform(4, 11, shape))
        t = exposures.reshape(-1, *[1] * len(shape))
        yield (np.minimum(rate * t * rng.uniform(0.9, 1.1, (len(t), *shape)), 12_000), exposures, 6.0, 12_000.0)
    yield (np.array([[12_000.0, 400], [12_000, 3_900]]), np.array([0.1, 1.0]), float(rng.uniform(3, 9)), 12_000.0)


# Known mistakes -------------------------------------------------------------------------------------------------------


def _merged_by(weights: str, electrons: Array, exposures: Array, dark_noise: float, full_well: float) -> Array:
    """Merged with weights of another rule."""
    t = exposures.reshape(-1, *[1] * (electrons.ndim - 1))
    usable = np.ones_like(electrons, dtype=bool) if weights == "saturated too" else electrons < full_well
    rate = electrons / t
    if weights == "longest":
        last = len(exposures) - 1 - np.argmax(usable[::-1], axis=0)
        best = np.take_along_axis(rate, last[None], axis=0)[0]
        return np.where(usable.any(axis=0), best, np.nan)
    x = np.sum(usable * electrons, axis=0) / np.sum(usable * t, axis=0)
    rules = {
        "equal": np.ones_like(electrons) * usable,
        "time": usable * t,
        "saturated too": t**2 / (dark_noise**2 + x * t),
        "own": usable * t**2 / (dark_noise**2 + electrons),
        "variance": usable * (dark_noise**2 + x * t) / t**2,
    }
    return np.sum(rules[weights] * rate, axis=0) / np.sum(rules[weights], axis=0)


NOISE = Exercise(
    name="15.total_noise",
    reference=total_noise,
    cases=_noise_cases,
    shown=((1_000.0, 8.0, 0.01),),
    hints=(
        "Kinds of noise that know nothing of each other add as *squares*. What is the variance of a Poisson count?",
        "Three variances under one root: `read_noise**2`, the electrons themselves, and `(prnu * electrons)**2`.",
    ),
    praise="Slopes 0, ½ and 1 on the photon-transfer curve are the three terms under this root.",
)


@NOISE.wrong("You add the deviations. Independent noise adds as variances: the squares, then one root over all.")
def _(electrons, read_noise, prnu):
    return read_noise + np.sqrt(electrons) + prnu * electrons


@NOISE.wrong("The pattern is missing: on one frame pixels differ by PRNU times the signal as well.")
def _(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons)


@NOISE.wrong("The *variance* of a Poisson count is its mean, μ; you put in μ², as though the deviation were μ.")
def _(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons**2 + (prnu * electrons) ** 2)


@NOISE.wrong("This is the variance. The noise is its square root.")
def _(electrons, read_noise, prnu):
    return read_noise**2 + electrons + (prnu * electrons) ** 2


@NOISE.wrong("The read noise is a deviation: its square belongs under the root.")
def _(electrons, read_noise, prnu):
    return np.sqrt(read_noise + electrons + (prnu * electrons) ** 2)


@NOISE.wrong("PRNU times the signal is a deviation: its square belongs under the root.")
def _(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons + prnu * electrons)


GAIN = Exercise(
    name="15.gain",
    reference=gain,
    cases=_gain_cases,
    hints=(
        "Subtract the two bright frames: what both share drops out. Do the same with the dark ones.",
        "`np.var(bright[0] - bright[1]) / 2` is one frame's variance, for a difference has that of two. Less the same "
        "of the dark, divided by mean bright less mean dark.",
    ),
    praise="Four frames and no light meter: Poisson's law is the ruler.",
)


@GAIN.wrong("The variance of a difference is that of *two* frames: halve it.")
def _(bright, dark):
    return 2 * gain(bright, dark)


@GAIN.wrong("You took the variance over one frame, in which the pattern counts as noise. Subtract two frames first.")
def _(bright, dark):
    return (np.var(bright[0]) - np.var(dark[0])) / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("The noise of the dark frames has to be taken off too: it has nothing to do with light.")
def _(bright, dark):
    return np.var(bright[0] - bright[1]) / 2 / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("The signal begins above the dark: divide by mean bright *less mean dark*.")
def _(bright, dark):
    return (np.var(bright[0] - bright[1]) - np.var(dark[0] - dark[1])) / 2 / np.mean(bright)


@GAIN.wrong("This is electrons per DN. K is DN per electron, its inverse.")
def _(bright, dark):
    return 1 / gain(bright, dark)


@GAIN.wrong("These are deviations. Variances are what grows in proportion to the light.")
def _(bright, dark):
    return (np.std(bright[0] - bright[1]) - np.std(dark[0] - dark[1])) / np.sqrt(2) / (np.mean(bright) - np.mean(dark))


DECIBELS = Exercise(
    name="15.dynamic_range_db",
    reference=dynamic_range_db,
    cases=_decibel_cases,
    bug=True,
    shown=((13_973.0, 10.95),),
    hints=(
        "Put in a ratio you know: saturation 1000 times the threshold is 60 dB.",
        "The right answer is smaller by the same factor everywhere, 2.3026. What has that value?",
    ),
    praise="Common logarithms. The published result file of a reference data set has this very bug in it.",
)


@DECIBELS.wrong("This is what you get with `np.log`, the *natural* logarithm: ln 10 = 2.3026 times too much.")
def _(full_well, dark_noise):
    return 20 * np.log(full_well / (dark_noise + 0.5))


@DECIBELS.wrong("Ten is for ratios of power. EMVA 1288 counts a ratio of signals, with 20.")
def _(full_well, dark_noise):
    return 10 * np.log10(full_well / (dark_noise + 0.5))


@DECIBELS.wrong("With log2 you count stops (bits). Decibels take the common logarithm.")
def _(full_well, dark_noise):
    return 20 * np.log2(full_well / (dark_noise + 0.5))


@DECIBELS.wrong("The logarithm is right. But the threshold, where signal equals noise, is σ_d + ½: keep the ½.")
def _(full_well, dark_noise):
    return 20 * np.log10(full_well / dark_noise)


FLAT_FIELD = Exercise(
    name="15.flat_field",
    reference=flat_field,
    cases=_flat_cases,
    hints=(
        "Both the frame and the flat contain the dark: take it off both before you divide.",
        "`answer = flat - dark`, NaN where it is not above 0; `(frame - dark) / answer * np.nanmean(answer)` keeps the "
        "mean brightness.",
    ),
    praise="Offsets, PRNU, vignetting and dust go in one line; dead pixels are said to be dead.",
)


@FLAT_FIELD.wrong("The dark was not taken off. Offsets add, so they must be subtracted before anything is divided.")
def _(frame, dark, flat):
    return frame / flat * np.mean(flat)


@FLAT_FIELD.wrong("The flat still contains the dark: subtract it there too.")
def _(frame, dark, flat):
    return (frame - dark) / flat * np.mean(flat)


@FLAT_FIELD.wrong("Divided well. Scale by the mean of flat − dark, so that the frame keeps its brightness.")
def _(frame, dark, flat):
    return (frame - dark) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong("You multiplied by the flat: the shading is there twice now. Divide by it.")
def _(frame, dark, flat):
    return (frame - dark) * (flat - dark) / np.mean(flat - dark)


@FLAT_FIELD.wrong(
    "A dead pixel, whose flat is not above its dark, has no answer: NaN, and it must not count in the mean."
)
def _(frame, dark, flat):
    return (frame - dark) / (flat - dark) * np.mean(flat - dark)


MERGE = Exercise(
    name="15.merge",
    reference=merge,
    cases=_merge_cases,
    tolerance=1e-7,
    hints=(
        "Each frame tells x = e / t with variance (σ² + x t) / t². Weigh by the inverse; a full pixel weighs nothing.",
        "First `x = Σ e / Σ t` over the usable frames, then `weight = usable * t**2 / (dark_noise**2 + x * t)` and "
        "Σ weight · e/t / Σ weight. Give `exposures` axes of length 1 to broadcast; 0/0 is NaN, as it should be.",
    ),
    praise="No other weights would leave less noise. That is what a noise model is for.",
)

MERGE.wrong("All usable frames count alike in yours. The short ones are noisier by far: weigh by 1 / variance.")(
    partial(_merged_by, "equal")
)


MERGE.wrong("Weights of t are right for photons alone. In the dark the read noise counts: t² / (σ² + x t).")(
    partial(_merged_by, "time")
)


MERGE.wrong("Full pixels say only 'at least so much'. They must have no weight, and NaN where all are full.")(
    partial(_merged_by, "saturated too")
)


MERGE.wrong(
    "Your weights come from each frame's own, noisy count, which favours those that chance made dark: take x "
    "from all usable frames together."
)(partial(_merged_by, "own"))


MERGE.wrong("You weigh by the variance: the noisiest count most. Take its inverse.")(partial(_merged_by, "variance"))


MERGE.wrong("The longest frame that is not full, alone, is a good start. The others have something to add.")(
    partial(_merged_by, "longest")
)


EXERCISES = (NOISE, GAIN, DECIBELS, FLAT_FIELD, MERGE)
