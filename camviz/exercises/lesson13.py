"""Lesson 13, white balance and colour: the response, grey world, developing with a bug in it, the matrix, and metamers.

Raw colours (..., 3) are linear; a matrix acts on columns, so an array of colours is `rgb @ M.T`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise
from camviz.trials import Function


def response(light: Array, reflectance: Array, sensitivity: Array) -> Array:
    """Each channel's count as a share of its count for a perfect white: Σ L R S / Σ L S, wavelength by wavelength."""
    return (light * reflectance) @ sensitivity / (light @ sensitivity)


def grey_world(raw: Array) -> Array:
    """The gains that make the mean of all colours grey, green's gain being 1."""
    mean = raw.reshape(-1, 3).mean(axis=0)
    return mean[1] / mean


def develop(raw: Array, gains: Array, matrix: Array) -> Array:
    """Gains, then the matrix, both on linear data; then what the screen cannot show is cut off; then gamma, 1/2.2."""
    return np.clip((raw * gains) @ matrix.T, 0, 1) ** (1 / 2.2)


def fit_matrix(raw: Array, target: Array) -> Array:
    """The M (3, 3) with the least Σ |M raw − target|²."""
    return np.asarray(np.linalg.lstsq(raw, target, rcond=None)[0].T, dtype=np.float64)


def unseen(change: Array, sensor: Array) -> Array:
    """What is left of a change (n,) of a spectrum when all that the sensor (n, 3) notices of it is taken away."""
    return change - sensor @ np.linalg.solve(sensor.T @ sensor, sensor.T @ change)


def _spectra(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """A light (n,) and three sensitivities (n, 3) that overlap."""
    place = np.linspace(0, 1, n)[:, None]
    centres, widths = np.sort(rng.uniform(0.1, 0.9, 3)), rng.uniform(0.15, 0.3, 3)
    return rng.uniform(0.2, 1.5, n), np.exp(-(((place - centres) / widths) ** 2)) * rng.uniform(0.5, 1.5, 3)


def _response_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        n = int(rng.integers(7, 15))
        light, sensitivity = _spectra(rng, n)
        yield light, rng.uniform(0, 1, (*shape, n)), sensitivity


def _grey_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((6, 5), (4,), (3, 2, 4), (9, 1)):
        yield (rng.gamma(2.0, 0.15, (*shape, 3)) * rng.uniform(0.4, 1.6, 3),)


def _develop_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        matrix = np.eye(3) + rng.uniform(-0.4, 0.4, (3, 3))
        yield rng.uniform(0.05, 0.7, (*shape, 3)), rng.uniform(0.9, 2.0, 3), matrix
    yield rng.uniform(0.5, 1, (5, 3)), np.array([2.1, 1, 1.6]), np.eye(3) * 1.8 - 0.4


def _matrix_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (3, 6, 24):
        raw = rng.uniform(0.05, 1, (n, 3)) + (np.eye(3)[np.arange(n) % 3])
        matrix = np.eye(3) + rng.uniform(-0.4, 0.4, (3, 3))
        yield raw, raw @ matrix.T + rng.normal(0, 0.02, (n, 3))


def _unseen_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (7, 12, 20):
        yield rng.normal(size=n), _spectra(rng, n)[1]


def _sensor_notices_nothing(function: Function, rng: np.random.Generator) -> str:
    sensor = _spectra(rng, 10)[1]
    left = np.asarray(function(rng.normal(size=10), sensor), dtype=np.float64)
    return "" if np.abs(left @ sensor).max() < 1e-8 else "Your result still makes the sensor respond: it must give 0."


RESPONSE = Exercise(
    name="13.response",
    reference=response,
    cases=_response_cases,
    hints=(
        "Multiply light by reflectance wavelength by wavelength, then sum the product with each channel's sensitivity.",
        "`@` does the sum: `(light * reflectance) @ sensitivity` has shape (..., 3). Divide it by the same thing with "
        "reflectance 1, which is `light @ sensitivity`.",
    ),
    praise="Everything that a sensor knows of a surface went through this sum.",
)


@RESPONSE.wrong(
    "This is the sum itself. Divide it, channel by channel, by what a perfect white gives in the same light."
)
def _(light, reflectance, sensitivity):
    return (light * reflectance) @ sensitivity


@RESPONSE.wrong("The light is missing. What reaches the sensor is light *times* reflectance.")
def _(light, reflectance, sensitivity):
    return reflectance @ sensitivity / sensitivity.sum(axis=0)


@RESPONSE.wrong("You divide by the sum of the sensitivity. A perfect white gives the sum of light *times* sensitivity.")
def _(light, reflectance, sensitivity):
    return (light * reflectance) @ sensitivity / sensitivity.sum(axis=0)


@RESPONSE.wrong("All channels are divided by the white's *green*. Here each channel is to be a share of its own.")
def _(light, reflectance, sensitivity):
    return (light * reflectance) @ sensitivity / (light @ sensitivity)[1] if sensitivity.shape[1] > 1 else light


@RESPONSE.wrong("You divide by the sum of the light. A perfect white gives the sum of light times *sensitivity*.")
def _(light, reflectance, sensitivity):
    return (light * reflectance) @ sensitivity / light.sum()


GREY_WORLD = Exercise(
    name="13.grey_world",
    reference=grey_world,
    cases=_grey_cases,
    hints=(
        "Average each channel over the whole picture; the gain of a channel is what takes its mean to green's mean.",
        "`mean = raw.reshape(-1, 3).mean(axis=0)` works for one row of colours and for a picture. Then divide "
        "`mean[1]` by `mean`.",
    ),
    praise="Two lines, and they believe that the world is grey. Now you know when not to believe them.",
)


@GREY_WORLD.wrong("These are the gains upside down: a weak channel needs *more*.")
def _(raw):
    return 1 / grey_world(raw)


@GREY_WORLD.wrong(
    "These are the means. The gains are what the channels must be *multiplied* by to make the means equal."
)
def _(raw):
    return raw.reshape(-1, 3).mean(axis=0)


@GREY_WORLD.wrong("The means come out equal, at the mean of all three. Here green is to stay as it is: its gain is 1.")
def _(raw):
    return raw.mean() / raw.reshape(-1, 3).mean(axis=0)


@GREY_WORLD.wrong("The means come out equal, at 1: that changes the exposure too. Let green keep its level.")
def _(raw):
    return 1 / raw.reshape(-1, 3).mean(axis=0)


@GREY_WORLD.wrong(
    "These gains make the *brightest* of each channel equal: that is the white patch, not the grey world."
)
def _(raw):
    return raw.reshape(-1, 3).max(axis=0)[1] / raw.reshape(-1, 3).max(axis=0)


@GREY_WORLD.wrong("You scale down to the smallest channel, as `cv2.xphoto` does. Here green's gain is to be 1.")
def _(raw):
    return raw.reshape(-1, 3).mean(axis=0).min() / raw.reshape(-1, 3).mean(axis=0)


DEVELOP = Exercise(
    name="13.develop",
    reference=develop,
    cases=_develop_cases,
    bug=True,
    hints=(
        "Gains and matrix are right; look at the *order* of what happens. On what kind of values do they act?",
        "The power 1/2.2 belongs at the very end: `raw * gains`, then the matrix, then `np.clip`, then the power.",
    ),
    praise="Light adds up linearly, so gains and matrices belong before gamma. It is the commonest bug of all.",
)


@DEVELOP.wrong("This is what you get with gamma *first*: gains and matrix then act on values that are no longer light.")
def _(raw, gains, matrix):
    return np.clip((np.clip(raw, 0, 1) ** (1 / 2.2) * gains) @ matrix.T, 0, 1)


@DEVELOP.wrong("Now the gains act on linear data, and the matrix still on encoded ones. It needs light as well.")
def _(raw, gains, matrix):
    return np.clip(np.clip(raw * gains, 0, 1) ** (1 / 2.2) @ matrix.T, 0, 1)


@DEVELOP.wrong("The order is right now, and the matrix is transposed: colours are rows here, so it is `@ matrix.T`.")
def _(raw, gains, matrix):
    return np.clip((raw * gains) @ matrix, 0, 1) ** (1 / 2.2)


@DEVELOP.wrong("The matrix was fitted to *balanced* colours: gains first, then the matrix.")
def _(raw, gains, matrix):
    return np.clip((raw @ matrix.T) * gains, 0, 1) ** (1 / 2.2)


@DEVELOP.wrong("This is right, and still linear: the screen wants the power 1/2.2 at the end.")
def _(raw, gains, matrix):
    return np.clip((raw * gains) @ matrix.T, 0, 1)


@DEVELOP.wrong("The power at the end is upside down: encoding is 1/2.2, it makes the darks lighter.")
def _(raw, gains, matrix):
    return np.clip((raw * gains) @ matrix.T, 0, 1) ** 2.2


FIT_MATRIX = Exercise(
    name="13.fit_matrix",
    reference=fit_matrix,
    cases=_matrix_cases,
    tolerance=1e-7,
    hints=(
        "With colours as rows the model is `raw @ M.T ≈ target`: linear least squares, for all three columns at once.",
        "`np.linalg.lstsq(raw, target, rcond=None)[0]` is the X with raw @ X ≈ target. How is X related to M?",
    ),
    praise="Twenty-four patches, nine unknowns. `cv2.ccm` would hand you this matrix transposed.",
)


@FIT_MATRIX.wrong("This is M transposed: `raw @ X ≈ target` gives X = Mᵀ. It is the convention of `cv2.ccm`.")
def _(raw, target):
    return fit_matrix(raw, target).T


@FIT_MATRIX.wrong("This matrix goes the other way, from target to raw: change places in `lstsq`.")
def _(raw, target):
    return fit_matrix(target, raw)


@FIT_MATRIX.wrong(
    "You fitted target → raw and inverted. That makes the error of the *raw* colours least, not of the result."
)
def _(raw, target):
    return np.linalg.pinv(fit_matrix(target, raw))


@FIT_MATRIX.wrong("This is diagonal: three gains. A matrix also takes from each channel what belongs to another.")
def _(raw, target):
    return np.diag((raw * target).sum(axis=0) / (raw**2).sum(axis=0))


UNSEEN = Exercise(
    name="13.unseen",
    reference=unseen,
    cases=_unseen_cases,
    tolerance=1e-7,
    laws=(_sensor_notices_nothing,),
    hints=(
        "The sensor notices the part of the change that is a mixture of its own three curves. Find the mixture that "
        "fits the change best, and subtract it.",
        "The weights w of the best mixture solve (SᵀS) w = Sᵀ change; what is left is change − S w. "
        "`np.linalg.lstsq(sensor, change, rcond=None)[0]` finds w too.",
    ),
    praise="Add your result to any spectrum, and the sensor will never know: a metameric black.",
)


@UNSEEN.wrong("This is the part that the sensor *does* notice. Subtract it from the change.")
def _(change, sensor):
    return change - unseen(change, sensor)


@UNSEEN.wrong(
    "You took away each channel's share by itself. The curves overlap, so their shares count twice: solve for "
    "the three weights together."
)
def _(change, sensor):
    return change - sensor @ (sensor.T @ change / (sensor**2).sum(axis=0))


@UNSEEN.wrong("The weights are not Sᵀ change, but the solution of (SᵀS) w = Sᵀ change: the curves are no unit vectors.")
def _(change, sensor):
    return change - sensor @ (sensor.T @ change)


EXERCISES = (RESPONSE, GREY_WORLD, DEVELOP, FIT_MATRIX, UNSEEN)
