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


@SUB_APERTURE.right
def by_lists_of_rows_and_columns(sensor, n, v, u):
    return sensor[np.ix_(range(v, sensor.shape[0], n), range(u, sensor.shape[1], n))]


@SUB_APERTURE.right
def microlens_by_microlens(sensor, n, v, u):
    view = np.zeros((sensor.shape[0] // n, sensor.shape[1] // n))
    for y, x in np.ndindex(view.shape):
        view[y, x] = sensor[n * y + v, n * x + u]
    return view


@SUB_APERTURE.wrong("v and u have changed places: v counts downwards, so it goes with the rows, the first index.")
def v_and_u_swapped(sensor, n, v, u):
    return sensor[u::n, v::n]


@SUB_APERTURE.wrong(
    "This is what lies under *one* microlens: one point, from everywhere. A view takes one pixel from each."
)
def under_one_microlens(sensor, n, v, u):
    return sensor[v * n : (v + 1) * n, u * n : (u + 1) * n]


@SUB_APERTURE.wrong(
    "This cuts the sensor into n × n tiles. The views do not lie beside each other, they are interleaved."
)
def tiles(sensor, n, v, u):
    return np.split(np.split(sensor, n, 0)[v], n, 1)[u]


@SUB_APERTURE.wrong("This is the view at the top left, whatever is asked for: begin at row v and column u.")
def always_the_first_view(sensor, n, v, u):
    return sensor[::n, ::n]


@SUB_APERTURE.wrong("You begin one pixel too early: v and u count from 0, as the rows and columns of an array do.")
def counted_from_one(sensor, n, v, u):
    return sensor[(v - 1) % n :: n, (u - 1) % n :: n]


@SUB_APERTURE.wrong("You count v and u from the middle pixel under a microlens. They count from its top left.")
def counted_from_the_middle(sensor, n, v, u):
    return sensor[(v + n // 2) % n :: n, (u + n // 2) % n :: n]


@SUB_APERTURE.wrong(
    "You count from the bottom right. The sensor's picture has been turned already: (0, 0) is top left."
)
def turned_by_half_a_turn(sensor, n, v, u):
    return sensor[n - 1 - v :: n, n - 1 - u :: n]


@SUB_APERTURE.wrong("`v:n` ends at n. A *step* of n has two colons before it.")
def stop_for_step(sensor, n, v, u):
    return sensor[v:n, u:n]


@SUB_APERTURE.wrong("The rows are right. The columns need the same step, beginning at u.")
def rows_only(sensor, n, v, u):
    return sensor[v::n]


@SUB_APERTURE.wrong(
    "This is the mean of all pixels under each microlens: an ordinary photograph. A view takes one of them."
)
def all_directions_together(sensor, n, v, u):
    height, width = sensor.shape
    return sensor.reshape(height // n, n, width // n, n).mean(axis=(1, 3))


@SUB_APERTURE.wrong("The pixels are the right ones, but rows and columns of the view have changed places.")
def transposed(sensor, n, v, u):
    return sensor[v::n, u::n].T


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


@DISPARITY.right
def as_a_difference_of_two_shifts(z, b, f, z_f):
    shift = np.vectorize(lambda distance: b * f / distance)
    return shift(z) - shift(z_f)


@DISPARITY.wrong("This is the disparity of two parallel cameras. Here points at z_f stand still: take away b f / z_f.")
def parallel_cameras(z, b, f, z_f):
    return b * f / np.asarray(z)


@DISPARITY.wrong("Depths do not subtract, their inverses do: 1/z − 1/z_f, not 1/(z − z_f).")
def inverse_of_the_difference(z, b, f, z_f):
    return b * f / (np.asarray(z) - z_f)


@DISPARITY.wrong("You subtract the depths themselves. A shift goes with 1/z: subtract the inverses.")
def difference_of_depths(z, b, f, z_f):
    return b * f * (z_f - np.asarray(z))


@DISPARITY.wrong("The sign is flipped: what is nearer than z_f has a positive disparity here, as in stereo.")
def sign_flipped(z, b, f, z_f):
    return b * f * (1 / z_f - 1 / np.asarray(z))


@DISPARITY.wrong("Farther things move too, but to the other side: the sign must stay. You took it away.")
def always_positive(z, b, f, z_f):
    return np.abs(disparity(z, b, f, z_f))


@DISPARITY.wrong("What is farther than z_f moves as well, with a negative sign. You set it to zero.")
def zero_beyond_the_focus(z, b, f, z_f):
    return np.maximum(disparity(z, b, f, z_f), 0)


@DISPARITY.wrong("The focal length is left out: f turns the tangent of an angle into pixels.")
def without_f(z, b, f, z_f):
    return b * (1 / np.asarray(z) - 1 / z_f)


@DISPARITY.wrong("The distance between the views is left out: twice as far apart, a point moves twice as much.")
def without_b(z, b, f, z_f):
    return f * (1 / np.asarray(z) - 1 / z_f)


@DISPARITY.wrong("Brackets are missing: b f multiplies 1/z_f as well.")
def brackets_missing(z, b, f, z_f):
    return b * f / np.asarray(z) - 1 / z_f


@DISPARITY.wrong("You add the two inverses. At z_f the disparity must be zero: subtract.")
def inverses_added(z, b, f, z_f):
    return b * f * (1 / np.asarray(z) + 1 / z_f)


@DISPARITY.wrong(
    "This is how much larger 1/z is than 1/z_f, as a ratio. Wanted is the difference, in pixels: b f (1/z − 1/z_f)."
)
def relative_to_the_focus(z, b, f, z_f):
    return z_f / np.asarray(z) - 1


@DISPARITY.wrong("Close: you rounded to whole pixels. A slope may be any number, and depth needs its fractions.")
def rounded_to_pixels(z, b, f, z_f):
    return np.round(disparity(z, b, f, z_f))


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


@REFOCUSED.right
def by_looking_each_pixel_up(views, d):
    rows, columns, height, width = views.shape
    y, x = np.arange(height)[:, None], np.arange(width)
    steps = [(v, u) for v in range(rows) for u in range(columns)]
    return sum(
        views[v, u, (y - d * (v - rows // 2)) % height, (x - d * (u - columns // 2)) % width] for v, u in steps
    ) / len(steps)


@REFOCUSED.right
def with_np_mean(views, d):
    down, right = (np.arange(count) - (count - 1) // 2 for count in views.shape[:2])
    moved = [
        np.roll(np.roll(views[v, u], d * down[v], axis=0), d * right[u], axis=1) for v, u in np.ndindex(views.shape[:2])
    ]
    return np.mean(moved, axis=0)


@REFOCUSED.wrong(
    "The direction is reversed: this focuses nearer where it should focus farther. A point moves to the left by d, so "
    "its view has to be moved to the right."
)
def direction_reversed(views, d):
    return refocused(views, -d)


@REFOCUSED.wrong("Now the *last* view holds still, and the picture slides the other way. Count from the middle.")
def counted_from_the_last_view(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * (v - rows + 1), d * (u - columns + 1)))


@REFOCUSED.wrong("v and u have changed places: v moves rows, axis 0, and u columns, axis 1.")
def v_and_u_swapped_in_the_shift(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * (u - columns // 2), d * (v - rows // 2)))


@REFOCUSED.wrong(
    "The rows are counted from the middle now. The columns still begin at the edge: the picture slides sideways."
)
def rows_centred_only(views, d):
    return _rolled(views, lambda v, u: (d * (v - views.shape[0] // 2), d * u))


@REFOCUSED.wrong(
    "The columns are counted from the middle now. The rows still begin at the edge: the picture slides upright."
)
def columns_centred_only(views, d):
    return _rolled(views, lambda v, u: (d * v, d * (u - views.shape[1] // 2)))


@REFOCUSED.wrong("Each direction has its own middle: `rows` goes with v, `columns` with u. Yours are exchanged.")
def middles_exchanged(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * (v - columns // 2), d * (u - rows // 2)))


@REFOCUSED.wrong("Brackets are missing: d multiplies the whole step from the middle, not v alone.")
def brackets_missing_in_the_shift(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * v - rows // 2, d * u - columns // 2))


@REFOCUSED.wrong("One step too far: views count from 0, so the middle of 3 views is number 1, `3 // 2`.")
def one_step_beyond_the_middle(views, d):
    rows, columns = views.shape[:2]
    return _rolled(views, lambda v, u: (d * (v - rows // 2 - 1), d * (u - columns // 2 - 1)))


@REFOCUSED.wrong("The sum is not divided by the number of views: the picture is many times too bright.")
def sum_for_mean(views, d):
    return refocused(views, d) * np.prod(views.shape[:2])


@REFOCUSED.wrong("The sum is divided by the rows only. There are rows times columns views in it.")
def divided_by_the_rows(views, d):
    return refocused(views, d) * views.shape[1]


@REFOCUSED.wrong("No view is moved: this is the mean of the views as they are, focused where the main lens was.")
def nothing_moved(views, d):
    return views.mean(axis=(0, 1))


@REFOCUSED.wrong("This is the middle view alone. It does hold still, but nothing is blurred: all views must be summed.")
def middle_view_alone(views, d):
    return views[views.shape[0] // 2, views.shape[1] // 2]


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


@SLOPE.right
def between_neighbouring_views(epi):
    """By central differences in the mean of two neighbouring views."""
    L_u, L_x = np.diff(epi, axis=0), np.gradient((epi[1:] + epi[:-1]) / 2, axis=1)
    return np.sum(L_x * L_u) / np.sum(L_x**2) if np.any(L_x) else np.nan


def _by_derivatives(epi, formula):
    L_u, L_x = np.gradient(epi)
    with np.errstate(all="ignore"):
        return float(formula(L_u, L_x)) if L_x.any() else np.nan


@SLOPE.wrong(
    "You have the derivatives in the other order: `np.gradient` gives that along u, the rows, first. So your answer is "
    "in views per pixel."
)
def derivatives_exchanged(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.sum(L_x * L_u) / np.sum(L_u**2))


@SLOPE.wrong("The sign is flipped: for d > 0 points move to the *left* as u grows, g(x + d u).")
def opposite_sign(epi):
    return -slope(epi)


@SLOPE.wrong("Right where there is something to see. In a plain slice every slope fits equally: NaN, not 0.")
def zero_for_a_plain_slice(epi):
    return 0.0 if np.isnan(slope(epi)) else slope(epi)


@SLOPE.wrong("Right where there is something to see. In a plain slice every slope fits equally: NaN, not infinity.")
def infinity_for_a_plain_slice(epi):
    return np.inf if np.isnan(slope(epi)) else slope(epi)


@SLOPE.wrong(
    "You divide the mean of L_u by the mean of L_x. Rising and falling flanks cancel in a mean, and nothing but noise "
    "is left of a spot on a plain wall. Multiply by L_x before you sum: then every flank counts."
)
def ratio_of_means(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.mean(L_u) / np.mean(L_x))


@SLOPE.wrong(
    "You divide at every pixel. Where L_x is nearly zero the quotient is noise, and it drowns the rest: sum first."
)
def mean_of_ratios(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.mean(L_u / L_x))


@SLOPE.wrong(
    "You take the median of L_u / L_x. On a plain wall with one spot most quotients are noise, and so is their median. "
    "Weight every pixel by its L_x²: that is least squares."
)
def median_of_ratios(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.median(L_u / L_x))


@SLOPE.wrong("This is the size of the slope. Its sign is lost: Σ L_x L_u keeps it, Σ L_u² does not.")
def size_only(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.sqrt(np.sum(L_u**2) / np.sum(L_x**2)))


@SLOPE.wrong("This is a correlation, near +1 or −1 for any slope. Divide by Σ L_x² alone.")
def correlation(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.sum(L_x * L_u) / np.sqrt(np.sum(L_x**2) * np.sum(L_u**2)))


@SLOPE.wrong("This is the line's angle in radians. The slope is its tangent, in pixels a view.")
def angle(epi):
    return np.arctan(slope(epi))


@SLOPE.wrong("This is how far things move from the first view to the last. The slope is the step from one to the next.")
def over_all_views(epi):
    return slope(epi) * (len(epi) - 1)


@SLOPE.wrong("This is only Σ L_x L_u. Divide it by Σ L_x²: a stronger texture must not give a steeper slope.")
def not_divided(epi):
    return _by_derivatives(epi, lambda L_u, L_x: np.sum(L_x * L_u))


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


@ALPHA.right
def one_depth_after_the_other(z, f, z_f):
    flat = [(1 / (1 / f - 1 / one)) / (1 / (1 / f - 1 / z_f)) for one in np.ravel(z)]
    return np.reshape(flat, np.shape(z))


def _image(z, f):
    return 1 / (1 / f - 1 / np.asarray(z))


@ALPHA.wrong("This is 1/α: the film of a nearer point lies *farther* behind the lens, so α > 1 for z < z_f.")
def upside_down(z, f, z_f):
    return 1 / alpha(z, f, z_f)


@ALPHA.wrong("This is z/z_f, a ratio of depths in front of the lens. α compares image distances, behind it.")
def ratio_of_depths(z, f, z_f):
    return np.asarray(z) / z_f


@ALPHA.wrong(
    "This is z_f/z. It is above 1 for near points, as α is, but α compares image distances, *behind* the lens."
)
def inverse_ratio_of_depths(z, f, z_f):
    return z_f / np.asarray(z)


@ALPHA.wrong("You divide by the focal length. The sensor is not at f but where z_f is sharp: v(z_f).")
def over_the_focal_length(z, f, z_f):
    return _image(z, f) / f


@ALPHA.wrong("This is the image distance v(z) in metres. α is its ratio to that of the sensor: divide by v(z_f).")
def image_distance(z, f, z_f):
    return _image(z, f)


@ALPHA.wrong("This is by how many metres the film has to move. α is a ratio: divide the two distances.")
def difference_of_image_distances(z, f, z_f):
    return _image(z, f) - _image(z_f, f)


@ALPHA.wrong("A sign has slipped: 1/f = 1/z + 1/v gives 1/v = 1/f *minus* 1/z.")
def inverses_added_for_the_image(z, f, z_f):
    return (1 / f + 1 / z_f) / (1 / f + 1 / np.asarray(z))


@ALPHA.wrong("You forgot to invert: v is 1/(1/f − 1/z). f − z is no image distance.")
def without_inverses(z, f, z_f):
    return (f - np.asarray(z)) / (f - z_f)


@ALPHA.wrong("This is a ratio of magnifications, v/z. α compares the distances v alone.")
def ratio_of_magnifications(z, f, z_f):
    return _image(z, f) / np.asarray(z) / (_image(z_f, f) / z_f)


@ALPHA.wrong("You set 1/α − 1 where 1 − 1/α belongs, or took α to be straight in the slope: only 1/α is.")
def straight_in_the_slope(z, f, z_f):
    return 1 + _image(z_f, f) * (1 / np.asarray(z) - 1 / z_f)


@ALPHA.wrong("The focal length stands where 1/f belongs: the thin lens equation adds *inverses*.")
def focal_length_not_inverted(z, f, z_f):
    return (f - 1 / z_f) / (f - 1 / np.asarray(z))


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
def microlens_after_microlens(sensor, n, m):
    first = (n - m) // 2
    picture = np.zeros((sensor.shape[0] // n * m, sensor.shape[1] // n * m))
    for y, x in np.ndindex(sensor.shape[0] // n, sensor.shape[1] // n):
        own = sensor[y * n : (y + 1) * n, x * n : (x + 1) * n]
        picture[y * m : (y + 1) * m, x * m : (x + 1) * m] = own[first : first + m, first : first + m]
    return picture


@PATCHES.right
def by_the_rows_and_columns_that_stay(sensor, n, m):
    rows, columns = (np.flatnonzero(np.abs(np.arange(size) % n - n // 2) <= m // 2) for size in sensor.shape)
    return sensor[np.ix_(rows, columns)]


@PATCHES.right
def from_views(sensor, n, m):
    first = (n - m) // 2
    picture = np.zeros((sensor.shape[0] // n * m, sensor.shape[1] // n * m))
    for v, u in np.ndindex(m, m):
        picture[v::m, u::m] = sensor[first + v :: n, first + u :: n]
    return picture


def _cut(sensor, n, m, first):
    cells = sensor.reshape(sensor.shape[0] // n, n, sensor.shape[1] // n, n)
    return cells[:, first : first + m, :, first : first + m]


def _joined(cells):
    a, b, c, d = cells.shape
    return cells.reshape(a * b, c * d)


@PATCHES.wrong(
    "These are the first m × m pixels under each microlens. As many are left out before the middle as behind it."
)
def from_the_corner(sensor, n, m):
    return _joined(_cut(sensor, n, m, 0))


@PATCHES.wrong(
    "These are the last m × m pixels under each microlens. As many are left out before the middle as behind it."
)
def from_the_last_corner(sensor, n, m):
    return _joined(_cut(sensor, n, m, n - m))


@PATCHES.wrong("The pixels are the right ones, but each patch is turned by half a turn. Lay them down as they stand.")
def each_turned(sensor, n, m):
    return _joined(patches(sensor, n, m).reshape(sensor.shape[0] // n, m, sensor.shape[1] // n, m)[:, ::-1, :, ::-1])


@PATCHES.wrong("These are m × m whole *views* side by side. A patch is what lies under one microlens.")
def views_side_by_side(sensor, n, m):
    cells = _cut(sensor, n, m, (n - m) // 2).transpose(1, 0, 3, 2)
    return _joined(cells)


@PATCHES.wrong("The order of the axes is lost: patches are joined row by row only if their own rows stay in between.")
def axes_lost(sensor, n, m):
    cells = _cut(sensor, n, m, (n - m) // 2)
    height, _, width, _ = cells.shape
    return cells.transpose(0, 2, 1, 3).reshape(height * m, width * m)


@PATCHES.wrong("This repeats the middle pixel of each microlens m × m times: larger, with no more detail.")
def middle_pixel_repeated(sensor, n, m):
    return np.kron(sensor[n // 2 :: n, n // 2 :: n], np.ones((m, m)))


@PATCHES.wrong(
    "This is the mean of each microlens's middle pixels: one pixel each. Lay all m × m of them side by side."
)
def mean_of_the_patch(sensor, n, m):
    return _cut(sensor, n, m, (n - m) // 2).mean(axis=(1, 3))


@PATCHES.wrong("This is the middle of the whole sensor. Every microlens has a middle of its own.")
def middle_of_the_sensor(sensor, n, m):
    height, width = sensor.shape[0] // n * m, sensor.shape[1] // n * m
    top, left = (sensor.shape[0] - height) // 2, (sensor.shape[1] - width) // 2
    return sensor[top : top + height, left : left + width]


@PATCHES.wrong("Each patch is transposed: its rows lie where its columns belong.")
def each_transposed(sensor, n, m):
    return _joined(_cut(sensor, n, m, (n - m) // 2).transpose(0, 3, 2, 1))


EXERCISES = (SUB_APERTURE, DISPARITY, REFOCUSED, ALPHA, SLOPE, PATCHES)
