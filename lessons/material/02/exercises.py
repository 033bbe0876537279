"""Lesson 02, lenses: its exercises, in one file because they are loaded by their lesson's number.

The image's place, the field of view with a bug in it, blur, its limits, and real elements.

Lengths in millimetres from the lens, as in `camviz.optics`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

# 1: where the image is -----------------------------------------------------------------------------------------------


def image_distance(f: float, u: ArrayLike) -> Array:
    """v with 1/f = 1/u + 1/v for objects at u (...); negative for a virtual image."""
    return 1 / (1 / f - 1 / np.asarray(u))


def _image_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f = float(rng.uniform(20, 120))
        yield (f, f * rng.uniform(1.2, 60, shape))
    yield (f, f * rng.uniform(0.2, 0.8, 4))  # a magnifying glass
    yield (f, f * np.array([0.01, 0.99, 1.01, 1.1, 1e3, 1e6]))  # on either side of f, and very far away
    yield (f, np.array([np.inf, 3 * f]))


IMAGE = Exercise(
    name="02.image_distance",
    reference=image_distance,
    cases=_image_cases,
    shown=((50.0, np.array(1000.0)),),
    hints=(
        "Begin with 1/f = 1/u + 1/v and leave 1/v alone on its side. Then turn it over.",
        "Of the two reciprocals that are known, one is taken from the other. Write v as one fraction of reciprocals: "
        "then u = ∞ and u < f need no case of their own.",
        "`return 1 / (___ - ___)`",
    ),
    praise="An object at infinity has its image at f, and one at 2f has it at 2f. One inside f has a virtual image.",
)


@IMAGE.right
def by_newton_s_form(f, u):
    return f + f**2 / (u - f)


@IMAGE.right
def one_object_after_another(f, u):
    return np.reshape([1 / (1 / f - 1 / one) for one in np.ravel(u)], np.shape(u))


@IMAGE.wrong("The sign: this is 1/f + 1/u. Object *and* image share what the lens does: 1/f = 1/u + 1/v.")
def reciprocals_added(f, u):
    return 1 / (1 / f + 1 / np.asarray(u))


@IMAGE.wrong("This is 1/v. Turn it over once more to have a distance.")
def not_turned_over(f, u):
    return 1 / f - 1 / np.asarray(u)


@IMAGE.wrong("Inside f there is no image behind the lens: v is *negative*. Keep the sign.")
def sign_dropped(f, u):
    return np.abs(image_distance(f, u))


@IMAGE.wrong("For u = ∞ your f u/(u − f) is NaN. With reciprocals it needs no extra case: 1/∞ is 0.")
def infinity_over_infinity(f, u):
    u = np.asarray(u)
    return f * u / (u - f)


@IMAGE.wrong("This is the magnification m = f/(u − f), how large the image is. Its distance is v = m u.")
def magnification(f, u):
    return f / (np.asarray(u) - f)


# 2: find the bug in the field of view --------------------------------------------------------------------------------


def field_of_view(width: float, f: float, s: Array) -> Array:
    """2 atan(width / 2v) in radians, v being where a lens focused at s (...) has its sensor."""
    return 2 * np.arctan(width / (2 * image_distance(f, s)))


def field_of_view_as_given(width, f, s):
    return 2 * np.arctan(width / (2 * f)) + 0 * np.where(np.isfinite(s), s, 0)


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f = float(rng.uniform(20, 120))
        yield (float(rng.uniform(8, 50)), f, f * rng.uniform(1.5, 20, shape))
    for s in (np.inf, np.array([np.inf]), f * np.array([np.inf, 1.01, 1.2, 3, 30, 1e3, 1e6])):
        yield (float(rng.uniform(8, 50)), f, s)


VIEW = Exercise(
    name="02.field_of_view",
    reference=field_of_view,
    cases=_view_cases,
    as_given=field_of_view_as_given,
    hints=(
        "Draw the triangle behind the lens. Its sides are half the sensor's width and the distance from the lens to "
        "the *sensor*. What is that distance when the lens is focused at s?",
        "It is exercise 1's v, with s for the object: what is in focus has its image on the sensor. Written with "
        "reciprocals it is right for s = ∞, too.",
        "`v = 1 / (1 / f - ___)` and `return 2 * np.arctan(width / (2 * ___))`",
    ),
    praise="Now the view narrows when the lens is focused near. In films this is seen as breathing.",
)


@VIEW.right
def with_the_lesson_s_formula_and_a_case_for_infinity(width, f, s):
    with np.errstate(invalid="ignore"):
        v = np.where(np.isinf(s), f, f * s / (s - f))
    return 2 * np.arctan(width / (2 * v))


@VIEW.right
def by_the_magnification(width, f, s):
    m = f / (s - f)
    return 2 * np.arctan2(width / 2, f * (1 + m))


@VIEW.wrong("For s = ∞ your f s/(s − f) is NaN. The sensor then stands at f: write v with reciprocals.")
def nan_at_infinity(width, f, s):
    return 2 * np.arctan(width / (2 * (f * s / (s - f))))


@VIEW.wrong("You take the triangle in front of the lens. The one behind it counts: its length is v, not s.")
def seen_from_the_subject(width, f, s):
    return 2 * np.arctan(width / (2 * np.asarray(s)))


@VIEW.wrong("The triangle has *half* the sensor's width for its side: width / 2.")
def whole_width_in_the_triangle(width, f, s):
    return 2 * np.arctan(width / image_distance(f, s))


@VIEW.wrong("The reciprocals are added in your v. The lens equation has 1/v = 1/f − 1/s.")
def sensor_inside_f(width, f, s):
    return 2 * np.arctan(width / 2 * (1 / f + 1 / np.asarray(s)))


@VIEW.wrong("An angle is width / v only while it is small. Take twice the arc tangent of half of it.")
def without_the_arc_tangent(width, f, s):
    return width / image_distance(f, s)


# 3: blur -------------------------------------------------------------------------------------------------------------


def blur(f: float, N: float, s: float, u: Array) -> Array:
    """Diameter f/N · |v(u) - v(s)| / v(u) of the disc that a point at u (...) makes on a sensor focused at s."""
    sensor, image = image_distance(f, s), image_distance(f, u)
    return f / N * np.abs(image - sensor) / image


def _blur_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f, N = float(rng.uniform(20, 120)), float(rng.uniform(1.4, 16))
        yield (f, N, f * float(rng.uniform(15, 60)), f * rng.uniform(70, 200, shape))
    yield (f, N, f * float(rng.uniform(15, 60)), f * rng.uniform(3, 12, 4))  # nearer than the focus
    s = f * float(rng.uniform(15, 60))
    yield (f, N, s, s * np.array([0.5, 1.0, 2.0]))  # in front of the focus, in it and behind it


BLUR = Exercise(
    name="02.blur",
    reference=blur,
    cases=_blur_cases,
    shown=((50.0, 2.0, 2000.0, np.array(4000.0)),),
    hints=(
        "Behind the lens the light of the point is a cone: as wide as the aperture at the lens, a point at v(u). How "
        "wide is it where the sensor cuts it, at v(s)?",
        "Similar triangles: blur / (f/N) = |v(u) − v(s)| / v(u). Put both v's in, and what is left is a formula in f, "
        "N, s and u. `np.abs` serves both sides of the focus.",
        "`return f**2 / (N * ___) * np.abs(u - s) / ___`",
    ),
    praise="It is f²/(N (s − f)) · |u − s|/u, and you had it from two triangles.",
)


@BLUR.right
def by_the_lesson_s_formula(f, N, s, u):
    return f**2 / (N * (s - f)) * np.abs(u - s) / u


@BLUR.right
def by_a_ray_through_the_rim(f, N, s, u):
    """It starts at height f/2N and crosses the axis at v(u); its height on the sensor is half the blur."""
    height = f / (2 * N)
    slope = -height / image_distance(f, u)
    return 2 * np.abs(height + slope * image_distance(f, s))


@BLUR.wrong("You divide by the *sensor's* distance v(s). The cone is v(u) long.")
def cone_as_long_as_the_sensor_s_distance(f, N, s, u):
    return blur(f, N, s, u) * image_distance(f, u) / image_distance(f, s)


@BLUR.wrong("The aperture's diameter is f/N: a larger f-number makes a smaller blur.")
def f_number_multiplied(f, N, s, u):
    return blur(f, N, s, u) * N**2


@BLUR.wrong("This is the blur in the plane in focus. On the sensor it is f/(s − f) times that.")
def in_the_plane_in_focus(f, N, s, u):
    return f / N * np.abs(np.asarray(u) - s) / np.asarray(u)


@BLUR.wrong("Close: you put the sensor at f. It stands at v(s), so divide by s − f, not by s.")
def sensor_at_f(f, N, s, u):
    return f**2 / (N * s) * np.abs(np.asarray(u) - s) / np.asarray(u)


@BLUR.wrong("A diameter is positive before and behind the focus: take the absolute value.")
def signed_diameter(f, N, s, u):
    return f / N * (image_distance(f, u) - image_distance(f, s)) / image_distance(f, u)


# 4: the limits of the depth of field ---------------------------------------------------------------------------------


def limits(f: float, N: float, s: Array, c: float) -> tuple[Array, Array]:
    """Nearest and farthest distances (...) with blur c, for a lens focused at s (...)."""
    H = f**2 / (N * c) + f
    near = s * (H - f) / (H + s - 2 * f)
    with np.errstate(divide="ignore", invalid="ignore"):
        return near, np.where(s < H, s * (H - f) / (H - s), np.inf)


def _limit_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f, N, c = (float(rng.uniform(*ends)) for ends in ((20, 100), (2, 16), (0.005, 0.03)))
        yield (f, N, f**2 / (N * c) * rng.uniform(0.1, 0.9, shape), c)
    yield (f, N, (f**2 / (N * c) + f) * np.array([0.4, 0.92, 0.999, 1.001, 1.1, 1.5, 4.0, 100.0]), c)
    yield (f, N, f * rng.uniform(1.1, 20, 4), c)
    f, N, c = float(rng.integers(20, 100)), 2.0 ** rng.integers(1, 4), 2.0 ** -rng.integers(5, 8)
    yield (f, N, (f**2 / (N * c) + f) * np.array([0.5, 1.0, 2.0]), c)  # exactly at the hyperfocal distance, too


LIMITS = Exercise(
    name="02.limits",
    reference=limits,
    cases=_limit_cases,
    canonical=lambda mm: np.where(mm > 1e12, np.inf, mm),  # what rounding leaves of infinity at the hyperfocal distance
    shown=((50.0, 8.0, np.array(5233.33), 0.03),),
    hints=(
        "H and both limits stand in part 3 as formulas. What does the far one become when s reaches H, and then?",
        "Begin with H, which all three share. `np.where(condition, this, that)` chooses for each s, and `np.inf` is a "
        "number to choose. Return two arrays, the near one first.",
        "`far = np.where(___, s * (H - f) / (H - s), ___)`",
    ),
    praise="Put back into the blur, both limits give c. From H on there is no far limit any more.",
)


def _short_forms(H, s):
    return H * s / (H + s), H * s / (H - s)


def _to_infinity_from(H, s, far):
    return np.where(s < H, far, np.inf)


@LIMITS.right
def by_the_share_of_the_cone(f, N, s, c):
    """blur = c where |1 − s/u| = c N (s − f)/f²."""
    share = c * N * (s - f) / f**2
    return s / (1 + share), np.where(share < 1, s / (1 - share), np.inf)


@LIMITS.right
def one_focus_after_another(f, N, s, c):
    H = f * f / N / c + f
    near = [one * (H - f) / (H + one - 2 * f) for one in np.ravel(s)]
    far = [one * (H - f) / (H - one) if one < H else float("inf") for one in np.ravel(s)]
    return np.reshape(near, np.shape(s)), np.reshape(far, np.shape(s))


@LIMITS.wrong("From s = H on everything behind is sharp enough: the far limit is `np.inf`, not negative.")
def negative_beyond_h(f, N, s, c):
    H = f**2 / (N * c) + f
    return limits(f, N, s, c)[0], s * (H - f) / (H - s)


@LIMITS.wrong("Near and far have changed places: return the near one first.")
def far_one_first(f, N, s, c):
    return limits(f, N, s, c)[::-1]


@LIMITS.wrong("These are the short forms H s/(H ± s). The exact ones are wanted: see part 3.")
def short_forms(f, N, s, c):
    H = f**2 / (N * c) + f
    near, far = _short_forms(H, s)
    return near, _to_infinity_from(H, s, far)


@LIMITS.wrong("These are the short forms with H = f²/(N c). Use the exact ones, and `np.inf` from s = H on.")
def everything_short(f, N, s, c):
    return _short_forms(f**2 / (N * c), s)


@LIMITS.wrong("Your H is f²/(N c). It lacks + f: distances count from the lens, not from its focal point.")
def h_without_f(f, N, s, c):
    H = f**2 / (N * c)
    return s * (H - f) / (H + s - 2 * f), _to_infinity_from(H, s, s * (H - f) / (H - s))


@LIMITS.wrong("The blur grows faster towards the lens, so the far limit is the farther one.")
def equally_far_on_both_sides(f, N, s, c):
    half = N * c * s**2 / f**2
    return s - half, s + half


# 5: any lens ---------------------------------------------------------------------------------------------------------


def effective_focal_length(surfaces: Array) -> float:
    """-1/C of the matrix of a lens whose rows are radius, distance to the next surface, index behind (n, 3)."""
    return float(-1 / _matrix(surfaces)[1, 0])


def _refraction(radius, before, after):
    return np.array([[1, 0], [(before - after) / (radius * after), before / after]])


def _way(distance):
    return np.array([[1, distance], [0, 1]])


def _matrix(surfaces: Array, refraction=_refraction) -> Array:
    """Of all surfaces and all ways behind them; what comes later stands on the left."""
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = _way(distance) @ refraction(radius, before, after) @ M
        before = after
    return M


def _lens_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Converging lenses, two that make light diverge, and two glasses cemented together."""
    for elements, sign in ((1, 1), (1, -1), (2, 1), (3, 1), (2, -1)):
        rows = []
        for _ in range(elements):
            glass, radius = float(rng.uniform(1.45, 1.8)), sign * float(rng.uniform(60, 200))
            way = float(rng.uniform(2, 9))
            rows += [(radius, float(rng.uniform(2, 9)), glass), (-radius * float(rng.uniform(1.2, 4)), way, 1.0)]
        yield (np.array(rows),)
    crown, flint = float(rng.uniform(1.45, 1.55)), float(rng.uniform(1.6, 1.8))
    R = float(rng.uniform(60, 90))
    yield (np.array([(R, 6.0, crown), (-R * float(rng.uniform(0.7, 1)), 2.5, flint), (-8 * R, 1.0, 1.0)]),)


ELEMENTS = Exercise(
    name="02.effective_focal_length",
    reference=effective_focal_length,
    cases=_lens_cases,
    hints=(
        "Go through the rows, and keep two things: the matrix so far, and the index of what the light is in. Each row "
        "is a surface and then a way to go.",
        "A new matrix stands on the *left* of the product, because the ray, on the right, meets the first surface "
        "first. After a row, the index behind it is the index before the next one. C stands in the second row, first "
        "column.",
        "`M = np.array([[1, 0], [(before - after) / ___, before / after]]) @ ___`",
    ),
    praise="Any lens with a prescription, from a reading glass to a zoom, is now one matrix for you.",
)


@ELEMENTS.right
def by_following_a_parallel_ray(surfaces):
    """One that comes in 1 mm above the axis leaves with the slope −1/f."""
    height, slope, before = 1.0, 0.0, 1.0
    for radius, distance, after in surfaces:
        slope = (before * slope - height * (after - before) / radius) / after
        height += slope * distance
        before = after
    return -1 / slope


@ELEMENTS.right
def with_slopes_times_the_index(surfaces):
    """The other convention of the textbooks: (height, index · slope), with a determinant of 1 everywhere."""
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = _way(distance / after) @ np.array([[1, 0], [-(after - before) / radius, 1]]) @ M
        before = after
    return -1 / M[1, 0]


@ELEMENTS.wrong("Your light always comes out of air. After a row, set `before` to that row's `after`.")
def always_out_of_air(surfaces):
    return -1 / _matrix(surfaces, lambda radius, before, after: _refraction(radius, 1.0, after))[1, 0]


@ELEMENTS.wrong("The order is reversed. The first surface stands rightmost: `M = new @ M`.")
def multiplied_in_reading_order(surfaces):
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = M @ _refraction(radius, before, after) @ _way(distance)
        before = after
    return -1 / M[1, 0]


@ELEMENTS.wrong("You go first and refract then. A row's distance is the way *behind* its surface.")
def way_before_the_surface(surfaces):
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = _refraction(radius, before, after) @ _way(distance) @ M
        before = after
    return -1 / M[1, 0]


@ELEMENTS.wrong("The surfaces are taken to lie on top of each other. Between them light travels: `[[1, d], [0, 1]]`.")
def without_the_ways(surfaces):
    return effective_focal_length(surfaces * [1, 0, 1])


@ELEMENTS.wrong("You took −A/C. The focal length is −1/C, counted from a principal plane.")
def back_focal_distance(surfaces):
    M = _matrix(surfaces)
    return -M[0, 0] / M[1, 0]


@ELEMENTS.wrong("A lens that makes light diverge has a *negative* focal length: keep the sign of −1/C.")
def always_positive(surfaces):
    return abs(effective_focal_length(surfaces))


EXERCISES = (IMAGE, BLUR, VIEW, LIMITS, ELEMENTS)
