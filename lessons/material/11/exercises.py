"""Lesson 11, light field: the views in a sensor, the slope of a point, its depth, and shift and sum with a bug in it.

Views are (v, u, height, width), v downwards and u to the right; a point nearer than the focus moves to the left for
each step of u, and up for each step of v. After Ng (2005), "Fourier slice photography".
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

# 1: a view out of the sensor -----------------------------------------------------------------------------------------


def sub_aperture(sensor: Array, n: int, v: int, u: int) -> Array:
    """The view (v, u) of a sensor with n × n pixels under each microlens."""
    return sensor[v::n, u::n]


def _sensor_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n, height, width in ((2, 3, 4), (3, 2, 5), (5, 4, 2)):
        places = [
            (v, u) for v, u in np.ndindex(n, n) if v != u and (n == 2 or v + u != n - 1)
        ]  # no mirror image is right
        v, u = rng.choice(places).tolist()
        yield (rng.normal(0, 2, (n * height, n * width)), n, v, u)
    yield (rng.normal(0, 2, (12, 8)), 4, 3, 1)  # the last row under each microlens, and then the first
    yield (rng.normal(0, 2, (8, 20)), 4, 0, 2)


SUB_APERTURE = Exercise(
    name="11.sub_aperture",
    reference=sub_aperture,
    cases=_sensor_cases,
    hints=(
        "Under every microlens lies one pixel that looks through the place (v, u) of the lens. How far apart are they?",
        "The pixels of one view are n apart in both directions, and the first is at row v, column u. A slice of an "
        "array may have a step: `a[start::step]`.",
        "`return sensor[v::___, ___]`",
    ),
    praise="One line takes a view out of the sensor, and the view has 1/n² of its pixels.",
)


@SUB_APERTURE.right
def by_four_axes(sensor, n, v, u):
    height, width = sensor.shape
    return sensor.reshape(height // n, n, width // n, n)[:, v, :, u]


@SUB_APERTURE.wrong("v and u have changed places: v counts downwards, so it goes with the rows, the first index.")
def v_and_u_swapped(sensor, n, v, u):
    return sensor[u::n, v::n]


@SUB_APERTURE.wrong("You cut the sensor into n × n tiles. The views are interleaved, not side by side.")
def tiles(sensor, n, v, u):
    return np.split(np.split(sensor, n, 0)[v], n, 1)[u]


@SUB_APERTURE.wrong("You count v and u from the middle pixel under a microlens. They count from its top left.")
def counted_from_the_middle(sensor, n, v, u):
    return sensor[(v + n // 2) % n :: n, (u + n // 2) % n :: n]


@SUB_APERTURE.wrong("You average all pixels under each microlens, as a photograph does. A view takes one of them.")
def all_directions_together(sensor, n, v, u):
    height, width = sensor.shape
    return sensor.reshape(height // n, n, width // n, n).mean(axis=(1, 3))


# 2: slope from depth -------------------------------------------------------------------------------------------------


def disparity(z: Array, b: float, f: float, z_f: float) -> Array:
    """d = b f (1/z − 1/z_f), in pixels a view."""
    return b * f * (1 / np.asarray(z) - 1 / z_f)


def _disparity_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        z_f = float(rng.uniform(2.5, 4))
        z = z_f * rng.choice([rng.uniform(0.4, 0.8), rng.uniform(1.3, 2.5)], shape)
        yield z * rng.uniform(0.95, 1.05, shape), *rng.uniform((0.005, 200), (0.06, 1500)).tolist(), z_f
    z_f = float(rng.uniform(2.5, 4))
    yield (
        z_f * np.array([0.5, 1.0, 2.0]),
        *rng.uniform((0.005, 200), (0.06, 1500)).tolist(),
        z_f,
    )  # z_f itself stands still


DISPARITY = Exercise(
    name="11.disparity",
    reference=disparity,
    cases=_disparity_cases,
    shown=((np.array([5.2207]), 0.025, 1462.857, 4.25),),
    hints=(
        "Two parallel cameras see a point at z shifted against each other. What is left of that shift at the focus?",
        "Parallel cameras b apart see a point at z shifted by b f / z. The views were sheared so that the shift is "
        "zero at z_f: from every shift subtract that of a point at z_f.",
        "`return b * f * (1 / z - ___)`",
    ),
    praise="Near is positive, far is negative, and the focus stands still.",
)


@DISPARITY.right
def over_a_common_denominator(z, b, f, z_f):
    return b * f * (z_f - z) / (z * z_f)


@DISPARITY.right
def by_projecting_into_two_views(z, b, f, z_f):
    columns = [f * (0.0 - place) / np.asarray(z) + f * place / z_f for place in (0.0, b)]
    return columns[0] - columns[1]


@DISPARITY.wrong("This is the disparity of two parallel cameras. Here points at z_f stand still: subtract b f / z_f.")
def parallel_cameras(z, b, f, z_f):
    return b * f / np.asarray(z)


@DISPARITY.wrong("You take 1/(z − z_f). The difference of the inverses is wanted: 1/z − 1/z_f.")
def inverse_of_the_difference(z, b, f, z_f):
    return b * f / (np.asarray(z) - z_f)


@DISPARITY.wrong("You removed the sign. Points beyond z_f move to the other side: their disparity is negative.")
def always_positive(z, b, f, z_f):
    return np.abs(disparity(z, b, f, z_f))


@DISPARITY.wrong("Brackets are missing: b f multiplies 1/z_f as well.")
def brackets_missing(z, b, f, z_f):
    return b * f / np.asarray(z) - 1 / z_f


# 3: find the bug in shift and sum ------------------------------------------------------------------------------------


def refocused(views: Array, d: int) -> Array:
    """The mean of views (v, u, height, width), each rolled by d steps for each step from the middle of the aperture."""
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * (v - rows // 2), d * (u - columns // 2)))


def refocused_as_given(views, d):
    return _rolled(views, lambda v, u: (d * v, d * u))


def _rolled(views, shift):
    """The mean of the views, each rolled by shift(v, u) rows and columns."""
    rows, columns = views.shape[:2]
    total = np.zeros(views.shape[2:])
    for v in range(rows):
        for u in range(columns):
            total += np.roll(views[v, u], shift(v, u), axis=(0, 1))
    return total / (rows * columns)


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, d in (((3, 5, 9, 7), -2), ((5, 3, 8, 8), 2), ((1, 3, 4, 9), 1), ((3, 3, 5, 6), 0), ((3, 1, 7, 4), 3)):
        yield (rng.normal(0, 2, shape), d)


REFOCUSED = Exercise(
    name="11.refocused",
    reference=refocused,
    cases=_view_cases,
    as_given=refocused_as_given,
    hints=(
        "Take a light field whose views are all black but for the middle one, and look where its picture ends up.",
        "When the focus is turned, one view should hold still, the one in the middle of the aperture. For which v and "
        "u is its shift zero as the function stands? Count from the middle instead; there are `rows` and `columns`.",
        "`total += np.roll(views[v, u], (d * (v - ___), d * (u - ___)), axis=(0, 1))`",
    ),
    praise="Now the middle view holds still, and the picture no longer slides when you turn the focus.",
)


@REFOCUSED.right
def as_a_slice_of_the_spectrum(views, d):
    from camviz.lightfields import fourier_slice

    return fourier_slice(views, d)


@REFOCUSED.wrong("The direction is reversed. A point moves to the left by d: move its view to the right.")
def direction_reversed(views, d):
    return refocused(views, -d)


@REFOCUSED.wrong("Now the *last* view stays still, and the picture moves the other way. Count from the middle.")
def counted_from_the_last_view(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * (v - rows + 1), d * (u - columns + 1)))


@REFOCUSED.wrong("Rows count from the middle now. The columns still begin at the edge: the picture moves sideways.")
def rows_centred_only(views, d):
    return _rolled(views, lambda v, u: (d * (v - views.shape[0] // 2), d * u))


@REFOCUSED.wrong("Brackets are missing: d multiplies the whole step from the middle, not v alone.")
def brackets_missing_in_the_shift(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * v - rows // 2, d * u - columns // 2))


# 4: the slope of a slice ---------------------------------------------------------------------------------------------


def slope(epi: Array) -> float:
    """Σ L_x L_u / Σ L_x² of a slice (u, x): the disparity of the one plane it shows; NaN where nothing changes."""
    L_u, L_x = np.gradient(epi)
    weight = np.sum(L_x**2)
    return float(np.sum(L_x * L_u) / weight) if weight > 0 else np.nan


def _slice_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for views, width, sign in ((5, 60, 1), (9, 80, -1)):
        yield (_noisy(rng, _waves(rng, views, width, sign * float(rng.uniform(0.2, 0.7)))),)
    for views, sign in ((5, 1), (3, -1)):
        yield (_noisy(rng, _spot(rng, views, sign * float(rng.uniform(0.55, 0.7)))),)
    steep = _waves(rng, 7, 160, float(rng.choice([-1, 1]) * rng.uniform(1.2, 1.6)), 50)  # more than a pixel a view
    yield (_noisy(rng, steep),)
    yield (np.full((5, 12), float(rng.random())),)


def _steps(views: int, width: int, d: float) -> Array:
    """x + d u, u counted from the middle."""
    return np.arange(width) + d * (np.arange(views) - (views - 1) / 2)[:, None]


def _waves(rng: np.random.Generator, views: int, width: int, d: float, shortest: float = 25) -> Array:
    """A few slow waves that move by d pixels to the left from view to view."""
    period, turn = rng.uniform(shortest, 60, (4, 1, 1)), rng.uniform(0, 2 * np.pi, (4, 1, 1))
    return np.asarray(np.sum(np.sin(2 * np.pi * _steps(views, width, d) / period + turn), axis=0))


def _spot(rng: np.random.Generator, views: int, d: float) -> Array:
    """A bright spot on a plain wall, most of it plain, which moves by d pixels to the left from view to view."""
    x = (_steps(views, 240, d) - rng.uniform(40, 200)) / 15
    return np.where(np.abs(x) < 1, np.cos(np.pi / 2 * np.clip(x, -1, 1)) ** 4, 0.0)


def _noisy(rng: np.random.Generator, epi: Array) -> Array:
    return 5 + epi + rng.normal(0, 1e-3, epi.shape)  # light is never negative


SLOPE = Exercise(
    name="11.slope",
    reference=slope,
    cases=_slice_cases,
    any_numbers=False,
    tolerance=0.02,  # differences of neighbours are not quite derivatives, and there is noise in them
    hints=(
        "L(x, u) = g(x + d u). Differentiate by u and by x and compare: which multiple of L_x is L_u?",
        "`np.gradient` gives both derivatives, that along the rows, u, first. One d is to fit all pixels at once: by "
        "least squares d is Σ L_x L_u over Σ L_x². Where Σ L_x² is zero, nothing can be seen to move.",
        "`return np.sum(___) / weight if weight > 0 else np.nan`",
    ),
    praise="Depth from the direction of a line, with two derivatives and one division.",
)


@SLOPE.right
def by_numpy_s_least_squares(epi):
    L_u, L_x = np.gradient(epi)
    if not L_x.any():
        return np.nan
    return np.linalg.lstsq(L_x.reshape(-1, 1), L_u.ravel(), rcond=None)[0][0]


@SLOPE.right
def by_the_structure_tensor_s_eigenvector(epi):
    L_u, L_x = (one[1:-1, 2:-2] for one in np.gradient(epi))
    if not np.ptp(epi):
        return np.nan
    _, directions = np.linalg.eigh([[np.sum(L_x**2), np.sum(L_x * L_u)], [np.sum(L_x * L_u), np.sum(L_u**2)]])
    return directions[1, 1] / directions[0, 1]


def _by_derivatives(epi, formula):
    L_u, L_x = np.gradient(epi)
    with np.errstate(all="ignore"):
        return float(formula(L_u, L_x)) if L_x.any() else np.nan


@SLOPE.wrong("You exchanged the derivatives: `np.gradient` gives that along u first. Yours is in views per pixel.")
def derivatives_exchanged(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.sum(L_x * L_u) / np.sum(L_u**2))


@SLOPE.wrong("You divide mean L_u by mean L_x. Rising and falling edges cancel: multiply by L_x before you sum.")
def ratio_of_means(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.mean(L_u) / np.mean(L_x))


@SLOPE.wrong("You divide at every pixel. Where L_x is nearly zero the quotient is noise: sum first.")
def mean_of_ratios(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.mean(L_u / L_x))


@SLOPE.wrong("On a plain wall most quotients L_u / L_x are noise, so is their median. Weight pixels by L_x².")
def median_of_ratios(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.median(L_u / L_x))


# 5: α ----------------------------------------------------------------------------------------------------------------


def alpha(z: Array, f: float, z_f: float) -> Array:
    """v(z) / v(z_f) with 1/f = 1/z + 1/v: where the film would have to be, over where the sensor is."""
    return (1 / f - 1 / z_f) / (1 / f - 1 / np.asarray(z))


def _alpha_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        z_f = float(rng.uniform(2, 4))
        yield z_f * rng.uniform(0.4, 0.7, shape), float(rng.uniform(0.06, 0.2)), z_f
    yield rng.uniform(5, 9, 4), float(rng.uniform(0.06, 0.2)), float(rng.uniform(2, 4))
    z_f = float(rng.uniform(2, 4))
    yield z_f * np.array([0.6, 1.0, 3.0]), float(rng.uniform(0.06, 0.2)), z_f


ALPHA = Exercise(
    name="11.alpha",
    reference=alpha,
    cases=_alpha_cases,
    hints=(
        "Where behind the lens is the image of a point at z? And of one at z_f?",
        "The thin lens equation is 1/f = 1/z + 1/v. Solve it for the image distance v of each of the two, and divide.",
        "`return (1 / f - ___) / (1 / f - ___)`",
    ),
    praise="α is a ratio *behind* the lens. In 1/α, not in α, equal steps are equal steps of slope.",
)


@ALPHA.right
def by_two_image_distances(z, f, z_f):
    v, v_f = (distance * f / (distance - f) for distance in (np.asarray(z), z_f))
    return v / v_f


@ALPHA.right
def by_ng_s_equation(z, f, z_f):
    sensor = 1 / (1 / f - 1 / z_f)
    return 1 / (1 - sensor * (1 / np.asarray(z) - 1 / z_f))


def _image(z, f):
    return 1 / (1 / f - 1 / np.asarray(z))


@ALPHA.wrong("This is 1/α: the film of a nearer point lies *farther* behind the lens, so α > 1 for z < z_f.")
def upside_down(z, f, z_f):
    return 1 / alpha(z, f, z_f)


@ALPHA.wrong("This is z/z_f, a ratio of depths in front of the lens. α compares image distances, behind it.")
def ratio_of_depths(z, f, z_f):
    return np.asarray(z) / z_f


@ALPHA.wrong("You divide by the focal length. The sensor is not at f but where z_f is sharp: v(z_f).")
def over_the_focal_length(z, f, z_f):
    return _image(z, f) / f


@ALPHA.wrong("This is the image distance v(z) in metres. α is its ratio to that of the sensor: divide by v(z_f).")
def image_distance(z, f, z_f):
    return _image(z, f)


@ALPHA.wrong("A sign is wrong: 1/f = 1/z + 1/v gives 1/v = 1/f *minus* 1/z.")
def inverses_added_for_the_image(z, f, z_f):
    return (1 / f + 1 / z_f) / (1 / f + 1 / np.asarray(z))


# 6: patches of a focused plenoptic camera -----------------------------------------------------------------------------


def patches(sensor: Array, n: int, m: int) -> Array:
    """The middle m × m of the n × n pixels under each microlens, side by side. After Lumsdaine and Georgiev (2009)."""
    height, width = sensor.shape[0] // n, sensor.shape[1] // n
    first = (n - m) // 2
    middle = sensor.reshape(height, n, width, n)[:, first : first + m, :, first : first + m]
    return middle.reshape(height * m, width * m)


def _patch_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n, m, height, width in ((5, 3, 2, 3), (7, 3, 3, 2), (3, 1, 4, 2), (9, 5, 2, 4), (5, 5, 3, 2)):
        yield rng.normal(0, 2, (n * height, n * width)), n, m


PATCHES = Exercise(
    name="11.patches",
    reference=patches,
    cases=_patch_cases,
    hints=(
        "Take one microlens first. Which of its n rows and columns of pixels are the middle m?",
        "As many pixels are left out before the middle m as behind them. With four axes, (microlens, pixel, microlens, "
        "pixel), one "
        "slice cuts all microlenses at once: `sensor.reshape(height, n, width, n)`.",
        "`middle = sensor.reshape(height, n, width, n)[:, ___, :, ___]`",
    ),
    praise="Each microlens gives m × m pixels now, where a view takes one.",
)


@PATCHES.right
def by_the_rows_and_columns_that_stay(sensor, n, m):
    rows, columns = (np.flatnonzero(np.abs(np.arange(size) % n - n // 2) <= m // 2) for size in sensor.shape)
    return sensor[np.ix_(rows, columns)]


def _cut(sensor, n, m, first):
    cells = sensor.reshape(sensor.shape[0] // n, n, sensor.shape[1] // n, n)
    return cells[:, first : first + m, :, first : first + m]


def _joined(cells):
    a, b, c, d = cells.shape
    return cells.reshape(a * b, c * d)


@PATCHES.wrong("These are the first m × m pixels of each microlens. Leave out as many before the middle as behind.")
def from_the_corner(sensor, n, m):
    return _joined(_cut(sensor, n, m, 0))


@PATCHES.wrong("These are m × m whole *views* side by side. A patch is what lies under one microlens.")
def views_side_by_side(sensor, n, m):
    cells = _cut(sensor, n, m, (n - m) // 2).transpose(1, 0, 3, 2)
    return _joined(cells)


@PATCHES.wrong("The axes are in the wrong order for `reshape`: it needs (microlens, pixel, microlens, pixel).")
def axes_lost(sensor, n, m):
    cells = _cut(sensor, n, m, (n - m) // 2)
    height, _, width, _ = cells.shape
    return cells.transpose(0, 2, 1, 3).reshape(height * m, width * m)


@PATCHES.wrong("This is the middle of the whole sensor. Every microlens has a middle of its own.")
def middle_of_the_sensor(sensor, n, m):
    height, width = sensor.shape[0] // n * m, sensor.shape[1] // n * m
    top, left = (sensor.shape[0] - height) // 2, (sensor.shape[1] - width) // 2
    return sensor[top : top + height, left : left + width]


EXERCISES = (SUB_APERTURE, DISPARITY, REFOCUSED, ALPHA, SLOPE, PATCHES)
