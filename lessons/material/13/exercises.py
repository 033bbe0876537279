"""Lesson 13, white balance and colour: the response, developing with a bug in it, metamers, matrices, and grey world.

Raw colours (..., 3) are linear; a matrix acts on columns, so an array of colours is `rgb @ M.T`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise


def spectra(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """A light (n,) and three sensitivities (n, 3) that overlap."""
    place = np.linspace(0, 1, n)[:, None]
    centres = np.array([0.75, 0.5, 0.25]) + rng.uniform(-0.08, 0.08, 3)
    widths = rng.uniform(0.2, 0.3, 3)
    return rng.uniform(0.2, 1.5, n), np.exp(-(((place - centres) / widths) ** 2)) * rng.uniform(0.5, 1.5, 3)


# 1: the response -----------------------------------------------------------------------------------------------------


def response(light: Array, reflectance: Array, sensitivity: Array) -> Array:
    """Each channel's count as a share of its count for a perfect white: Σ L R S / Σ L S, wavelength by wavelength."""
    return (light * reflectance) @ sensitivity / (light @ sensitivity)


def _response_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        n = int(rng.integers(7, 15))
        light, sensitivity = spectra(rng, n)
        yield light, rng.uniform(0, 1, (*shape, n)), sensitivity
    light, sensitivity = spectra(rng, 9)
    yield light, np.array([[0.0], [1.0], [rng.uniform(0.1, 0.9)]]) * np.ones(9), sensitivity  # black, white and grey


RESPONSE = Exercise(
    name="13.response",
    reference=response,
    cases=_response_cases,
    hints=(
        "What reaches the sensor at one wavelength, and how much of it does one channel count? Add that up over all "
        "wavelengths. Then do the same for a surface that reflects everything.",
        "`@` multiplies and adds up: along the last axis of what stands before it, the first axis of what stands "
        "behind it. So wavelengths come last on its left. A perfect white has reflectance 1 at every wavelength.",
        "`return (light * ___) @ sensitivity / (___ @ sensitivity)`",
    ),
    praise="Everything that a sensor knows of a surface went through this sum.",
)


@RESPONSE.right
def by_einsum(light, reflectance, sensitivity):
    counted = np.einsum("n,...n,nc->...c", light, reflectance, sensitivity)
    return counted / np.einsum("n,nc->c", light, sensitivity)


@RESPONSE.right
def as_a_weighted_mean(light, reflectance, sensitivity):
    weights = light[:, None] * sensitivity
    return reflectance @ (weights / weights.sum(axis=0))


@RESPONSE.wrong("This is the sum itself. Divide each channel by a perfect white's sum in the same light.")
def sum_alone(light, reflectance, sensitivity):
    return (light * reflectance) @ sensitivity


@RESPONSE.wrong("The light is missing. What reaches the sensor is light *times* reflectance.")
def without_light(light, reflectance, sensitivity):
    return reflectance @ sensitivity / sensitivity.sum(axis=0)


@RESPONSE.wrong("You divide by the sum of the sensitivity. A perfect white gives the sum of light *times* sensitivity.")
def beside_the_sensitivity(light, reflectance, sensitivity):
    return (light * reflectance) @ sensitivity / sensitivity.sum(axis=0)


@RESPONSE.wrong("You multiply the sums of light and of reflectance. Multiply *inside* the sum, per wavelength.")
def product_of_sums(light, reflectance, sensitivity):
    return (light @ sensitivity) * (reflectance @ sensitivity) / (light @ sensitivity)


@RESPONSE.wrong("`np.trapezoid` counts the first and last wavelength by half. This lesson takes the plain sum.")
def by_trapezoids(light, reflectance, sensitivity):
    halved = light * np.where(np.isin(np.arange(len(light)), (0, len(light) - 1)), 0.5, 1.0)
    return response(halved, reflectance, sensitivity)


# 5: grey world -------------------------------------------------------------------------------------------------------


def grey_world(raw: Array) -> Array:
    """The gains that make the mean of all colours grey, green's gain being 1."""
    mean = raw.reshape(-1, 3).mean(axis=0)
    return mean[1] / mean


def _grey_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    casts = ((0.5, 0.9, 1.5), (0.9, 1.5, 0.5), (1.5, 0.5, 0.9), (1.5, 0.9, 0.5))
    for shape, cast in zip(((6, 5), (4,), (3, 2, 4), (9, 1)), casts, strict=True):
        yield (rng.gamma(2.0, 0.15, (*shape, 3)) * cast - 0.03,)  # noise may lie below black


GREY_WORLD = Exercise(
    name="13.grey_world",
    reference=grey_world,
    cases=_grey_cases,
    hints=(
        "Take the mean of each channel over the whole picture. By which number must red be multiplied so that its mean "
        "becomes as large as green's? And green itself?",
        "`raw.reshape(-1, 3)` makes one long list of colours, of a list and of a picture alike. The mean over its "
        "`axis=0` has three numbers, and green is the one in the middle.",
        "`return mean[___] / ___`",
    ),
    praise="Two lines, and they believe that the world is grey. Now you know when not to believe them.",
)


@GREY_WORLD.right
def from_opencv_s_mean(raw):
    import cv2

    red, green, blue, _ = cv2.mean(raw.reshape(-1, 1, 3))
    return green / np.array([red, green, blue])


@GREY_WORLD.wrong("These are the gains upside down: a weak channel needs *more*.")
def gains_upside_down(raw):
    return 1 / grey_world(raw)


@GREY_WORLD.wrong("These are the means. *Multiplying* by the gains must make the means equal.")
def means_alone(raw):
    return raw.reshape(-1, 3).mean(axis=0)


@GREY_WORLD.wrong("The means come out equal, at the mean of all three. Here green stays as it is: its gain is 1.")
def at_the_mean_of_all(raw):
    return raw.mean() / raw.reshape(-1, 3).mean(axis=0)


@GREY_WORLD.wrong("These gains make the *brightest* of each channel equal: that is white patch, not grey world.")
def white_patch(raw):
    return raw.reshape(-1, 3).max(axis=0)[1] / raw.reshape(-1, 3).max(axis=0)


@GREY_WORLD.wrong("This is the mean of each colour's own gains. Average the colours first, then divide.")
def mean_of_ratios(raw):
    return (raw[..., 1:2] / raw).reshape(-1, 3).mean(axis=0)


# 2: find the bug in developing ---------------------------------------------------------------------------------------


def develop(raw: Array, gains: Array, matrix: Array) -> Array:
    """Gains, then the matrix, both on linear data; then what the screen cannot show is cut off; then gamma, 1/2.2."""
    return np.clip((raw * gains) @ matrix.T, 0, 1) ** (1 / 2.2)


def develop_as_given(raw, gains, matrix):
    encoded = np.clip(raw, 0, 1) ** (1 / 2.2)
    return np.clip((encoded * gains) @ matrix.T, 0, 1)


def _develop_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        matrix = np.eye(3) + rng.uniform(-0.4, 0.4, (3, 3))
        yield rng.uniform(0.05, 0.7, (*shape, 3)), rng.uniform(1.2, 2.0, 3), matrix
    strong = np.array([[0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.1, 0.1, 0.9], [0.95, 0.95, 0.9], [0.3, 0.4, 0.2]])
    matrix = np.array([[1.8, -0.7, -0.1], [-0.3, 1.6, -0.3], [0.1, -0.8, 1.7]])  # leaves 0 … 1 at either end
    yield strong + rng.uniform(-0.02, 0.02, strong.shape), np.array([2.1, 1, 1.6]), matrix


DEVELOP = Exercise(
    name="13.develop",
    reference=develop,
    cases=_develop_cases,
    as_given=develop_as_given,
    tolerance=1e-7,
    hints=(
        "Each step is right by itself; look at their *order*. On what kind of values do the gains and the matrix act "
        "here: on light, or on what is meant for a screen?",
        "Light adds up, encoded values do not. So everything that multiplies or mixes colours comes first, and the "
        "curve of the screen last. A power of a negative number is not a number: cut off before it.",
        "`return np.clip((___ * gains) @ matrix.T, 0, 1) ** ___`",
    ),
    praise="Light adds up linearly, so gains and matrices belong before gamma. This is a very common bug.",
)


@DEVELOP.right
def by_opencv_s_transform(raw, gains, matrix):
    import cv2

    linear = cv2.transform(np.reshape(raw * gains, (-1, 1, 3)).astype(float), matrix).reshape(raw.shape)
    return np.power(np.minimum(np.maximum(linear, 0), 1), 1 / 2.2)


@DEVELOP.right
def gains_inside_the_matrix(raw, gains, matrix):
    return np.clip(raw @ (matrix * gains).T, 0, 1) ** (1 / 2.2)


@DEVELOP.wrong("The gains act on linear data now, but the matrix still on encoded values. It needs linear data too.")
def matrix_on_encoded_values(raw, gains, matrix):
    return np.clip(np.clip(raw * gains, 0, 1) ** (1 / 2.2) @ matrix.T, 0, 1)


@DEVELOP.wrong("The order is right now, but the matrix is transposed. Colours are rows here: use `@ matrix.T`.")
def matrix_transposed(raw, gains, matrix):
    return np.clip((raw * gains) @ matrix, 0, 1) ** (1 / 2.2)


@DEVELOP.wrong("The matrix was fitted to *balanced* colours: gains first, then the matrix.")
def matrix_before_gains(raw, gains, matrix):
    return np.clip((raw @ matrix.T) * gains, 0, 1) ** (1 / 2.2)


@DEVELOP.wrong("Gains and matrix act on linear data now. The result is still linear: take the power at the end.")
def without_gamma(raw, gains, matrix):
    return np.clip((raw * gains) @ matrix.T, 0, 1)


@DEVELOP.wrong("You cut off between gains and matrix too. The matrix may bring values above 1 back: cut off once.")
def cut_off_in_between(raw, gains, matrix):
    return np.clip(np.clip(raw * gains, 0, 1) @ matrix.T, 0, 1) ** (1 / 2.2)


@DEVELOP.wrong("The order is right. This is the curve of sRGB; here take the plain power 1/2.2.")
def with_the_curve_of_srgb(raw, gains, matrix):
    light = np.clip((raw * gains) @ matrix.T, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


# 4: the matrix -------------------------------------------------------------------------------------------------------


def fit_matrix(raw: Array, target: Array) -> Array:
    """The M (3, 3) with the least Σ |M raw − target|²."""
    return np.asarray(np.linalg.lstsq(raw, target, rcond=None)[0].T, dtype=np.float64)


def _matrix_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (3, 6, 24):
        raw = rng.uniform(-0.1, 0.6, (n, 3)) + np.eye(3)[np.arange(n) % 3]
        matrix = np.eye(3) + rng.uniform(-0.4, 0.4, (3, 3))
        yield raw, raw @ matrix.T + rng.normal(0, 0.02, (n, 3))


FIT_MATRIX = Exercise(
    name="13.fit_matrix",
    reference=fit_matrix,
    cases=_matrix_cases,
    tolerance=1e-7,
    hints=(
        "Here colours are rows. Write the equation for one of them, with the unknown to the right of the raw colour: "
        "is the unknown M, or M turned over?",
        "`np.linalg.lstsq(a, b, rcond=None)` finds the X for which a @ X comes nearest to b, for all columns of b at "
        "once. It returns four things, and X is the first. How is X related to M?",
        "`return np.linalg.lstsq(___, ___, rcond=None)[0]___`",
    ),
    praise="Many equations, nine unknowns. `cv2.ccm` would hand you this matrix transposed.",
)


@FIT_MATRIX.right
def by_the_normal_equations(raw, target):
    return np.linalg.solve(raw.T @ raw, raw.T @ target).T


@FIT_MATRIX.right
def by_opencv_s_solver(raw, target):
    import cv2

    return cv2.solve(raw, target, flags=cv2.DECOMP_SVD)[1].T


@FIT_MATRIX.wrong("This is M transposed: `raw @ X ≈ target` gives X = Mᵀ. It is the convention of `cv2.ccm`.")
def transposed(raw, target):
    return fit_matrix(raw, target).T


@FIT_MATRIX.wrong("You fitted target → raw and inverted. That makes the *raw* colours' error least, not the result's.")
def backwards_and_inverted(raw, target):
    return np.linalg.inv(fit_matrix(target, raw))


@FIT_MATRIX.wrong("This is diagonal: three gains. A matrix also mixes the channels.")
def three_gains(raw, target):
    return np.diag((raw * target).sum(axis=0) / (raw**2).sum(axis=0))


@FIT_MATRIX.wrong("You scale the rows until each adds up to 1. That keeps white, but the task does not ask for it.")
def white_kept(raw, target):
    matrix = fit_matrix(raw, target)
    return matrix / matrix.sum(axis=1, keepdims=True)


# 3: what the sensor is blind to --------------------------------------------------------------------------------------


def unseen(change: Array, sensor: Array) -> Array:
    """What is left of a change (n,) of a spectrum when all that the sensor (n, 3) notices of it is taken away."""
    return change - sensor @ np.linalg.solve(sensor.T @ sensor, sensor.T @ change)


def _unseen_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (7, 12, 20):
        yield rng.normal(size=n), spectra(rng, n)[1]
    sensor = spectra(rng, 15)[1]
    yield rng.normal(size=15) / 4 - sensor @ [1.0, 1.2, 0.8], sensor  # its weights are negative


UNSEEN = Exercise(
    name="13.unseen",
    reference=unseen,
    cases=_unseen_cases,
    tolerance=1e-7,
    hints=(
        "A sensor notices mixtures of its own three curves, and nothing else. Which mixture comes nearest to the "
        "change? What is left when you take it away?",
        "The nearest mixture is a fit by least squares with three unknowns, the weights of the curves. Either "
        "`np.linalg.lstsq` finds them, or three equations: what is left, summed with each curve, must give 0.",
        "`weights = np.linalg.solve(sensor.T @ sensor, ___)`, and then `return change - ___`",
    ),
    praise="Add your result to any spectrum, and the sensor will never know: a metameric black.",
)


@UNSEEN.right
def by_least_squares(change, sensor):
    return change - sensor @ np.linalg.lstsq(sensor, change, rcond=None)[0]


@UNSEEN.right
def onto_the_null_space(change, sensor):
    from scipy.linalg import null_space

    blind = null_space(sensor.T)
    return blind @ (blind.T @ change)


@UNSEEN.wrong("This is the part that the sensor *does* notice. Subtract it from the change.")
def seen_part(change, sensor):
    return change - unseen(change, sensor)


@UNSEEN.wrong("You subtract each curve's part by itself. The curves overlap: solve for the three weights together.")
def each_curve_by_itself(change, sensor):
    return change - sensor @ (sensor.T @ change / (sensor**2).sum(axis=0))


@UNSEEN.wrong("The weights are not Sᵀ change. They solve (SᵀS) w = Sᵀ change: the curves are no unit vectors.")
def without_solving(change, sensor):
    return change - sensor @ (sensor.T @ change)


@UNSEEN.wrong("You subtract one curve after another. Each brings back part of those before: solve for all three.")
def one_after_another(change, sensor):
    left = change
    for curve in sensor.T:
        left = left - curve * (curve @ left) / (curve @ curve)
    return left


# 6: between two matrices ---------------------------------------------------------------------------------------------

BULB_K, DAYLIGHT_K = 2856, 6504
"""The temperatures of the CIE's illuminant A and of D65."""


def between(kelvin: float, warm: Array, cold: Array) -> Array:
    """The mixture of two matrices, linear in 1/kelvin, and no farther than either of them."""
    share = np.clip((1 / kelvin - 1 / 6504) / (1 / 2856 - 1 / 6504), 0, 1)
    return np.asarray(share * warm + (1 - share) * cold, dtype=np.float64)


def _between_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    inside = rng.uniform(2900, 6400, 4)
    for kelvin in (*inside, BULB_K, DAYLIGHT_K, rng.uniform(1800, 2700), rng.uniform(6700, 12000)):
        yield float(kelvin), *(np.eye(3) + rng.uniform(-0.6, 0.6, (3, 3)) for _ in range(2))


BETWEEN = Exercise(
    name="13.between",
    reference=between,
    cases=_between_cases,
    hints=(
        "What share of the warm matrix is needed at 2856 K, and what share at 6504 K? In between, the share goes "
        "evenly with 1/kelvin. Below 2856 K and above 6504 K it stays where it is.",
        "A number goes evenly from 0 at b to 1 at a as `(x - b) / (a - b)`. Here x is `1 / kelvin`. `np.clip` holds "
        "the share between 0 and 1.",
        "`share = np.clip((1 / kelvin - 1 / ___) / (1 / ___ - 1 / ___), 0, 1)`, and then "
        "`return share * ___ + (1 - share) * ___`",
    ),
    praise="Programs that read DNG files do just this, with the temperature that they take for that of the light.",
)


@BETWEEN.right
def by_interpolating_each_entry(kelvin, warm, cold):
    known = np.stack([cold, warm]).reshape(2, 9).T
    return np.array([np.interp(1 / kelvin, [1 / 6504, 1 / 2856], pair) for pair in known]).reshape(3, 3)


@BETWEEN.wrong("Your share goes evenly with the temperature. It must go evenly with *one divided by* it.")
def evenly_with_temperature(kelvin, warm, cold):
    share = np.clip((6504 - kelvin) / (6504 - 2856), 0, 1)
    return share * warm + (1 - share) * cold


@BETWEEN.wrong("This is right between the two lights. Beyond them the share stays: clip it to 0 … 1.")
def goes_on_beyond(kelvin, warm, cold):
    share = (1 / kelvin - 1 / 6504) / (1 / 2856 - 1 / 6504)
    return share * warm + (1 - share) * cold


@BETWEEN.wrong("The two matrices have changed places: at 2856 K the *warm* one is right.")
def places_changed(kelvin, warm, cold):
    return between(kelvin, cold, warm)


@BETWEEN.wrong("Your share goes evenly with the *logarithm* of the temperature. It must go evenly with 1/kelvin.")
def evenly_with_the_logarithm(kelvin, warm, cold):
    share = np.clip(np.log(6504 / kelvin) / np.log(6504 / 2856), 0, 1)
    return share * warm + (1 - share) * cold


EXERCISES = (RESPONSE, DEVELOP, UNSEEN, FIT_MATRIX, GREY_WORLD, BETWEEN)
