"""Lesson 11, light field: the views in a sensor, the slope of a point, its depth, and shift and sum with a bug in it.

Views are (v, u, height, width), v downwards and u to the right; a point nearer than the focus moves to the left for
each step of u, and up for each step of v. After Ng (2005), "Fourier slice photography".
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise


def sub_aperture(sensor: Array, n: int, v: int, u: int) -> Array:
    """The view (v, u) of a sensor with n × n pixels under each microlens."""
    return sensor[v::n, u::n]


def disparity(z: Array, b: float, f: float, z_f: float) -> Array:
    """d = b f (1/z − 1/z_f), in pixels a view."""
    return b * f * (1 / np.asarray(z) - 1 / z_f)


def refocused(views: Array, d: int) -> Array:
    """The mean of views (v, u, height, width), each rolled by d steps for each step from the middle of the aperture."""
    return _rolled(views, d, centred=True)


def slope(epi: Array) -> float:
    """Σ L_x L_u / Σ L_x² of a slice (u, x): the disparity of the one plane it shows; NaN where nothing changes."""
    L_u, L_x = np.gradient(epi)
    weight = np.sum(L_x**2)
    return float(np.sum(L_x * L_u) / weight) if weight > 0 else np.nan


def alpha(z: Array, f: float, z_f: float) -> Array:
    """v(z) / v(z_f) with 1/f = 1/z + 1/v: where the film would have to be, over where the sensor is."""
    return (1 / f - 1 / z_f) / (1 / f - 1 / np.asarray(z))


def _rolled(views: Array, d: int, *, centred: bool, sign: int = 1, swapped: bool = False) -> Array:
    rows, columns = views.shape[:2]
    middle = (rows // 2, columns // 2) if centred else (0, 0)
    total = np.zeros(views.shape[2:])
    for v in range(rows):
        for u in range(columns):
            shift = (sign * d * (v - middle[0]), sign * d * (u - middle[1]))
            total += np.roll(views[v, u], shift[::-1] if swapped else shift, axis=(0, 1))
    return total / (rows * columns)


def _sensor_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n, height, width in ((2, 3, 4), (3, 2, 5), (5, 4, 2)):
        v, u = rng.integers(0, n, 2).tolist()
        yield (rng.random((n * height, n * width)), n, v, (u if u != v else (u + 1) % n))


def _disparity_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(1, 9, shape), *rng.uniform((0.005, 200, 2), (0.06, 1500, 6)).tolist())


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, d in (((3, 3, 6, 8), 1), ((3, 5, 9, 7), -2), ((5, 3, 8, 8), 2), ((1, 5, 4, 9), 1)):
        yield (rng.random(shape), d)


def _slice_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for views, width in ((5, 60), (9, 80), (3, 50)):
        yield (_slice(rng, views, width, float(rng.uniform(0.2, 0.7) * rng.choice([-1, 1]))),)
    yield (np.full((5, 12), float(rng.random())),)


def _slice(rng: np.random.Generator, views: int, width: int, d: float) -> Array:
    """A few slow waves that move by d pixels to the left from view to view."""
    x = np.arange(width) + d * (np.arange(views) - (views - 1) / 2)[:, None]
    period, turn = rng.uniform(25, 60, (4, 1, 1)), rng.uniform(0, 2 * np.pi, (4, 1, 1))
    return np.asarray(np.sum(np.sin(2 * np.pi * x / period + turn), axis=0))


def _alpha_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(1, 9, shape), float(rng.uniform(0.03, 0.2)), float(rng.uniform(2, 6)))


SUB_APERTURE = Exercise(
    name="11.sub_aperture",
    reference=sub_aperture,
    cases=_sensor_cases,
    hints=(
        "Under every microlens lies one pixel that looks through the place (v, u) of the lens. How far apart are they?",
        "The pixels of one view are n apart in both directions, and the first is at row v, column u: a slice with a "
        "step, `sensor[start::step, …]`.",
    ),
    praise="One line takes a view out of the sensor, and the view has 1/n² of its pixels.",
)


@SUB_APERTURE.wrong("v and u have changed places: v counts downwards, so it goes with the rows, the first index.")
def _(sensor, n, v, u):
    return sensor[u::n, v::n]


@SUB_APERTURE.wrong(
    "This is what lies under *one* microlens: one point, from everywhere. A view takes one pixel from each."
)
def _(sensor, n, v, u):
    return sensor[v * n : (v + 1) * n, u * n : (u + 1) * n]


@SUB_APERTURE.wrong(
    "This cuts the sensor into n × n tiles. The views do not lie beside each other, they are interleaved."
)
def _(sensor, n, v, u):
    return np.split(np.split(sensor, n, 0)[v], n, 1)[u]


DISPARITY = Exercise(
    name="11.disparity",
    reference=disparity,
    cases=_disparity_cases,
    shown=((np.array([5.2207]), 0.025, 1462.857, 4.25),),
    hints=(
        "Two cameras b apart see a point at z shifted by b f / z. What has happened to that shift at the focus?",
        "The views were sheared so that it is zero at z_f: subtract what a point there would move, b f / z_f.",
    ),
    praise="Near is positive, far is negative, and the focus stands still.",
)


@DISPARITY.wrong("This is the disparity of two parallel cameras. Here points at z_f stand still: take away b f / z_f.")
def _(z, b, f, z_f):
    return b * f / np.asarray(z)


@DISPARITY.wrong("Depths do not subtract, their inverses do: 1/z − 1/z_f, not 1/(z − z_f).")
def _(z, b, f, z_f):
    return b * f / (np.asarray(z) - z_f)


@DISPARITY.wrong("The sign is flipped: what is nearer than z_f has a positive disparity here, as in stereo.")
def _(z, b, f, z_f):
    return b * f * (1 / z_f - 1 / np.asarray(z))


@DISPARITY.wrong("The focal length is left out: f turns the tangent of an angle into pixels.")
def _(z, b, f, z_f):
    return b * (1 / np.asarray(z) - 1 / z_f)


REFOCUSED = Exercise(
    name="11.refocused",
    reference=refocused,
    cases=_view_cases,
    bug=True,
    hints=(
        "Take a light field whose views are all alike but for the middle one, and look where that one ends up.",
        "Which view stays where it is? Count v and u from the *middle* of the aperture: `v - rows // 2`.",
    ),
    praise="Now the middle view holds still, and the picture no longer slides when you turn the focus.",
)


@REFOCUSED.wrong(
    "The picture is sharp where it should be, but *in another place*: turn the focus, and everything slides. "
    "The view in the corner holds still; the one in the middle should."
)
def _(views, d):
    return _rolled(views, d, centred=False)


@REFOCUSED.wrong(
    "The direction is reversed: this focuses nearer where it should focus farther. A point moves to the left "
    "by d, so its view has to be moved to the right."
)
def _(views, d):
    return _rolled(views, d, centred=True, sign=-1)


@REFOCUSED.wrong("v and u have changed places: v moves rows, axis 0, and u columns, axis 1.")
def _(views, d):
    return _rolled(views, d, centred=True, swapped=True)


@REFOCUSED.wrong("The sum is not divided by the number of views: the picture is many times too bright.")
def _(views, d):
    return refocused(views, d) * np.prod(views.shape[:2])


SLOPE = Exercise(
    name="11.slope",
    reference=slope,
    cases=_slice_cases,
    tolerance=0.02,  # differences of neighbours are not quite derivatives
    hints=(
        "L(x, u) = g(x + d u). Differentiate by u and by x and compare: which multiple of L_x is L_u?",
        "`L_u, L_x = np.gradient(epi)`; then least squares over the whole slice, Σ L_x L_u / Σ L_x². Where Σ L_x² is "
        "zero nothing moves that could be seen: NaN.",
    ),
    praise="Depth from the direction of a line, with two derivatives and one division.",
)


@SLOPE.wrong("This is the slope seen from the other side, views per pixel. Wanted are pixels per view, L_u over L_x.")
def _(epi):
    return 1 / slope(epi)


@SLOPE.wrong("The sign is flipped: for d > 0 points move to the *left* as u grows, g(x + d u).")
def _(epi):
    return -slope(epi)


@SLOPE.wrong("Right where there is something to see. In a plain slice every slope fits equally: NaN, not 0.")
def _(epi):
    return 0.0 if np.isnan(slope(epi)) else slope(epi)


ALPHA = Exercise(
    name="11.alpha",
    reference=alpha,
    cases=_alpha_cases,
    hints=(
        "Where behind the lens is the image of a point at z? And of one at z_f?",
        "1/f = 1/z + 1/v gives v = 1 / (1/f − 1/z). α is v(z) / v(z_f).",
    ),
    praise="α is a ratio *behind* the lens. In 1/α, not in α, equal steps are equal steps of slope.",
)


@ALPHA.wrong("This is 1/α: the film of a nearer point lies *farther* behind the lens, so α > 1 for z < z_f.")
def _(z, f, z_f):
    return 1 / alpha(z, f, z_f)


@ALPHA.wrong("This is a ratio of depths before the lens. α compares image distances, behind it.")
def _(z, f, z_f):
    return np.asarray(z) / z_f


@ALPHA.wrong("This is a ratio of depths before the lens. α compares image distances, behind it.")
def _(z, f, z_f):
    return z_f / np.asarray(z)


@ALPHA.wrong("You divide by the focal length. The sensor is not at f but where z_f is sharp: v(z_f).")
def _(z, f, z_f):
    return 1 / (1 / f - 1 / np.asarray(z)) / f


EXERCISES = (SUB_APERTURE, DISPARITY, REFOCUSED, SLOPE, ALPHA)
