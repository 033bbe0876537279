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
def by_the_product_over_the_difference(f, u):
    u = np.asarray(u)
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(u), f, f * u / (u - f))


@IMAGE.right
def one_object_after_another(f, u):
    return np.reshape([1 / (1 / f - 1 / one) for one in np.ravel(u)], np.shape(u))


@IMAGE.wrong("The sign: this is 1/f + 1/u. What the lens does, 1/f, is shared by object *and* image: 1/f = 1/u + 1/v.")
def reciprocals_added(f, u):
    return 1 / (1 / f + 1 / np.asarray(u))


@IMAGE.wrong(
    "1/f and 1/u have changed places: 1/v = 1/f − 1/u, so that a distant object has its image *behind* the lens."
)
def reciprocals_exchanged(f, u):
    return 1 / (1 / np.asarray(u) - 1 / f)


@IMAGE.wrong("This is 1/v. Turn it over once more to have a distance.")
def not_turned_over(f, u):
    return 1 / f - 1 / np.asarray(u)


@IMAGE.wrong(
    "This puts the image at f whatever the object. That is so at infinity alone; the nearer the object, the "
    "farther behind the lens its image."
)
def always_at_f(f, u):
    return f + 0 * np.where(np.isfinite(u), u, 0)


@IMAGE.wrong("The lens equation adds *reciprocals*: 1/f = 1/u + 1/v. Yours subtracts the distances themselves.")
def distances_subtracted(f, u):
    return np.asarray(u) - f


@IMAGE.wrong(
    "For objects beyond f this is right. Inside f there is no image behind the lens: v is *negative*, the "
    "light only seems to come from there. Keep the sign."
)
def sign_dropped(f, u):
    return np.abs(image_distance(f, u))


@IMAGE.wrong(
    "For objects beyond f this is right. Inside f the image is virtual, and it still has a place: NaN is not wanted, "
    "the negative v is."
)
def nan_for_a_virtual_image(f, u):
    return np.where(np.asarray(u) > f, image_distance(f, u), np.nan)


@IMAGE.wrong(
    "For finite u this is right. For u = ∞ your f u/(u − f) is ∞/∞, which is NaN. Written with reciprocals the same "
    "formula needs no extra case: 1/∞ is 0."
)
def infinity_over_infinity(f, u):
    u = np.asarray(u)
    return f * u / (u - f)


@IMAGE.wrong(
    "For finite u this is right. Parallel light does not meet infinitely far away: that of u = ∞ meets at f, which is "
    "how f is defined."
)
def infinity_to_infinity(f, u):
    return np.where(np.isinf(u), np.inf, image_distance(f, u))


@IMAGE.wrong("This is the magnification m = f/(u − f), how large the image is. Its distance is v = m u.")
def magnification(f, u):
    return f / (np.asarray(u) - f)


@IMAGE.wrong("This is how far the image lies behind the *focal point*, f²/(u − f). From the lens it is f more.")
def from_the_focal_point(f, u):
    return f**2 / (np.asarray(u) - f)


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


@VIEW.right
def as_the_sum_of_two_halves(width, f, s):
    v = image_distance(f, s)
    return np.arctan(width / 2 / v) - np.arctan(-width / 2 / v)


@VIEW.wrong(
    "For every finite s this is right. For s = ∞ your f s/(s − f) is ∞/∞, which is NaN, though the sensor then simply "
    "stands at f. Give ∞ a case of its own, or write v with reciprocals: 1/∞ is 0."
)
def nan_at_infinity(width, f, s):
    return 2 * np.arctan(width / (2 * (f * s / (s - f))))


@VIEW.wrong(
    "For every finite s this is right. Focused at infinity the lens still sees: its sensor stands at f, and the view "
    "is at its widest, not 0."
)
def nothing_seen_at_infinity(width, f, s):
    return np.where(np.isinf(s), 0.0, field_of_view(width, f, s))


@VIEW.wrong(
    "This is the angle under which the *subject's place* would see a sensor's width. The triangle behind the "
    "lens is what counts: its length is v, not s."
)
def seen_from_the_subject(width, f, s):
    return 2 * np.arctan(width / (2 * np.asarray(s)))


@VIEW.wrong("This is *half* the field of view: the triangle reaches from the axis to one edge of the sensor only.")
def one_half_of_it(width, f, s):
    return np.arctan(width / (2 * image_distance(f, s)))


@VIEW.wrong("The triangle has *half* the sensor's width for its side: width / 2.")
def whole_width_in_the_triangle(width, f, s):
    return 2 * np.arctan(width / image_distance(f, s))


@VIEW.wrong("These are degrees. The angle is wanted in radians, as `np.arctan` gives it.")
def in_degrees(width, f, s):
    return np.degrees(field_of_view(width, f, s))


@VIEW.wrong("The reciprocals are added in your v. The lens equation takes 1/s away: 1/v = 1/f − 1/s.")
def sensor_inside_f(width, f, s):
    return 2 * np.arctan(width / 2 * (1 / f + 1 / np.asarray(s)))


@VIEW.wrong("This is width / v, which an angle is only while it is small. Take the arc tangent of half of it, twice.")
def without_the_arc_tangent(width, f, s):
    return width / image_distance(f, s)


@VIEW.wrong("The fraction stands on its head. A wider sensor sees more, so the width stands above v.")
def upside_down_triangle(width, f, s):
    return 2 * np.arctan(2 * image_distance(f, s) / width)


@VIEW.wrong(
    "The sensor stands at s − f in yours, which would be far behind the lens. Distances do not subtract; their "
    "reciprocals do."
)
def sensor_at_s_minus_f(width, f, s):
    return 2 * np.arctan(width / (2 * (np.asarray(s) - f)))


@VIEW.wrong("Your sensor stands at f + m. The magnification m has no unit: the sensor stands at f (1 + m).")
def magnification_added_to_f(width, f, s):
    return 2 * np.arctan(width / (2 * (f + f / (np.asarray(s) - f))))


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


@BLUR.right
def by_the_magnification_of_the_plane_in_focus(f, N, s, u):
    return f / N * np.abs(1 - s / u) * (f / (s - f))


@BLUR.wrong("You divide by the *sensor's* distance v(s). The cone's tip is at v(u), and its whole length is v(u).")
def cone_as_long_as_the_sensor_s_distance(f, N, s, u):
    return blur(f, N, s, u) * image_distance(f, u) / image_distance(f, s)


@BLUR.wrong("This is the radius. The aperture f/N is a diameter, so the blur is one, too.")
def radius_of_the_disc(f, N, s, u):
    return blur(f, N, s, u) / 2


@BLUR.wrong("The aperture's diameter is f/N: the f-number *divides*, and a larger N makes a smaller blur.")
def f_number_multiplied(f, N, s, u):
    return blur(f, N, s, u) * N**2


@BLUR.wrong("N is missing: your aperture is as wide as f, which would be f/1. Its diameter is f/N.")
def f_number_forgotten(f, N, s, u):
    return blur(f, N, s, u) * N


@BLUR.wrong(
    "This is the cone cut in front of the lens, at the plane in focus. On the sensor it is smaller by the "
    "magnification, f/(s − f)."
)
def in_the_plane_in_focus(f, N, s, u):
    return f / N * np.abs(np.asarray(u) - s) / np.asarray(u)


@BLUR.wrong("Close: this takes the sensor to stand at f. With v(s) it is f²/(N (s − f)), which matters near the lens.")
def sensor_at_f(f, N, s, u):
    return f**2 / (N * s) * np.abs(np.asarray(u) - s) / np.asarray(u)


@BLUR.wrong("Beyond the focus or before it, a disc has a positive diameter: take the absolute value.")
def signed_diameter(f, N, s, u):
    return f / N * (image_distance(f, u) - image_distance(f, s)) / image_distance(f, u)


@BLUR.wrong("What lies nearer than s is blurred as well: you answer 0 there. Take the absolute value of u − s.")
def sharp_in_front_of_the_focus(f, N, s, u):
    return np.where(np.asarray(u) > s, blur(f, N, s, u), 0.0)


@BLUR.wrong(
    "You divide by s at the end. The share of the cone that is cut off is |u − s|/*u*: the point's own distance."
)
def divided_by_the_focus_distance(f, N, s, u):
    return f**2 / (N * (s - f)) * np.abs(np.asarray(u) - s) / s


@BLUR.wrong("This is how far the sensor misses the image, |v(u) − v(s)|. How wide is the cone at that distance?")
def distance_from_the_image(f, N, s, u):
    return np.abs(image_distance(f, u) - image_distance(f, s))


@BLUR.wrong("This takes the cone to be f long, |v(u) − v(s)|/N. It is v(u) long, from the lens to its tip.")
def cone_as_long_as_f(f, N, s, u):
    return np.abs(image_distance(f, u) - image_distance(f, s)) / N


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
def by_places_behind_the_lens(f, N, s, c):
    """A cone cut c wide at the sensor has its tip at v(s) D/(D − c), behind it, or at v(s) D/(D + c), before it."""
    D, sensor = f / N, image_distance(f, s)
    near, far = image_distance(f, sensor * D / (D - c)), image_distance(f, sensor * D / (D + c))
    return near, np.where(far > 0, far, np.inf)


@LIMITS.right
def one_focus_after_another(f, N, s, c):
    H = f * f / N / c + f
    near = [one * (H - f) / (H + one - 2 * f) for one in np.ravel(s)]
    far = [one * (H - f) / (H - one) if one < H else float("inf") for one in np.ravel(s)]
    return np.reshape(near, np.shape(s)), np.reshape(far, np.shape(s))


@LIMITS.wrong(
    "For s < H this is right. From s = H on everything behind is sharp enough: the far limit is `np.inf`, not "
    "a negative distance."
)
def negative_beyond_h(f, N, s, c):
    H = f**2 / (N * c) + f
    return limits(f, N, s, c)[0], s * (H - f) / (H - s)


@LIMITS.wrong("For s < H this is right. Beyond, the limit *exists*: it is infinitely far, `np.inf`, and not NaN.")
def nan_beyond_h(f, N, s, c):
    near, far = limits(f, N, s, c)
    return near, np.where(np.isinf(far), np.nan, far)


@LIMITS.wrong("Near and far have changed places: return the near one first.")
def far_one_first(f, N, s, c):
    return limits(f, N, s, c)[::-1]


@LIMITS.wrong(
    "These are the short forms H s/(H ± s), good while f is small beside s. The exact ones are wanted: with H − f "
    "above, and 2f taken off below in the near one."
)
def short_forms(f, N, s, c):
    H = f**2 / (N * c) + f
    near, far = _short_forms(H, s)
    return near, _to_infinity_from(H, s, far)


@LIMITS.wrong(
    "These are the short forms H s/(H ± s), and beyond H the far one turns negative. Take the exact forms of part 3, "
    "and `np.inf` from s = H on."
)
def short_forms_negative_beyond_h(f, N, s, c):
    return _short_forms(f**2 / (N * c) + f, s)


@LIMITS.wrong(
    "These are the short forms H s/(H ± s) with the short H = f²/(N c). Many tables use both, and near the lens they "
    "are wrong by several per cent. The exact H has + f, and the exact limits have H − f in them."
)
def short_forms_with_the_short_h(f, N, s, c):
    H = f**2 / (N * c)
    near, far = _short_forms(H, s)
    return near, _to_infinity_from(H + f, s, far)


@LIMITS.wrong(
    "Three things are short here: H = f²/(N c) lacks its + f, H s/(H ± s) are not the exact limits, and beyond H the "
    "far one is `np.inf` instead of negative."
)
def everything_short(f, N, s, c):
    return _short_forms(f**2 / (N * c), s)


@LIMITS.wrong("Your H is f²/(N c). It lacks + f: distances count from the lens, not from its focal point.")
def h_without_f(f, N, s, c):
    H = f**2 / (N * c)
    return s * (H - f) / (H + s - 2 * f), _to_infinity_from(H, s, s * (H - f) / (H - s))


@LIMITS.wrong("The second array is the *depth*, far − near. Wanted is the far limit itself, counted from the lens.")
def depth_for_the_far_limit(f, N, s, c):
    near, far = limits(f, N, s, c)
    return near, far - near


@LIMITS.wrong(
    "Your limits lie equally far before and behind s. The blur grows faster towards the lens, so the far limit is the "
    "farther one."
)
def equally_far_on_both_sides(f, N, s, c):
    half = N * c * s**2 / f**2
    return s - half, s + half


@LIMITS.wrong("N is missing in H: stopping down has to bring H nearer, H = f²/(*N* c) + f.")
def h_without_the_f_number(f, N, s, c):
    return limits(f, 1.0, s, c)


@LIMITS.wrong(
    "Your c counts as a radius. It is the *diameter* of the disc that is allowed: H = f²/(N c) + f, without a 2."
)
def c_as_a_radius(f, N, s, c):
    return limits(f, N, s, 2 * c)


@LIMITS.wrong("This is the near limit alone. Two arrays are wanted: `return near, far`.")
def near_limit_alone(f, N, s, c):
    return limits(f, N, s, c)[0]


@LIMITS.wrong("The condition is the wrong way round: there is a far limit while s < H, and none from H on.")
def condition_turned_round(f, N, s, c):
    H = f**2 / (N * c) + f
    return limits(f, N, s, c)[0], np.where(s > H, s * (H - f) / (H - s), np.inf)


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


@ELEMENTS.right
def without_the_way_behind_the_last_surface(surfaces):
    return effective_focal_length(np.vstack([surfaces[:-1], surfaces[-1] * [1, 0, 1]]))


@ELEMENTS.wrong(
    "Your light always comes out of air. Keep the index it is in: after a row, `before` becomes that row's `after`."
)
def always_out_of_air(surfaces):
    return -1 / _matrix(surfaces, lambda radius, before, after: _refraction(radius, 1.0, after))[1, 0]


@ELEMENTS.wrong("The order is reversed: the ray is on the right, so the first surface stands rightmost: `M = new @ M`.")
def multiplied_in_reading_order(surfaces):
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = M @ _refraction(radius, before, after) @ _way(distance)
        before = after
    return -1 / M[1, 0]


@ELEMENTS.wrong(
    "In each row you go first and refract then. A row is a surface, and its distance is the way *behind* that surface."
)
def way_before_the_surface(surfaces):
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = _refraction(radius, before, after) @ _way(distance) @ M
        before = after
    return -1 / M[1, 0]


@ELEMENTS.wrong("The surfaces are taken to lie on top of each other. Between them light travels: `[[1, d], [0, 1]]`.")
def without_the_ways(surfaces):
    return effective_focal_length(surfaces * [1, 0, 1])


@ELEMENTS.wrong(
    "The sign: a ray parallel to the axis comes out with slope C y, downwards when the lens converges; so f = −1/C."
)
def sign_of_c_forgotten(surfaces):
    return -effective_focal_length(surfaces)


@ELEMENTS.wrong("This is C itself, and with its sign. The focal length is −1/C.")
def c_itself(surfaces):
    return -1 / effective_focal_length(surfaces)


@ELEMENTS.wrong("You took the entry B, in the first row and second column. C is below it: `M[1, 0]`.")
def b_for_c(surfaces):
    return -1 / _matrix(surfaces)[0, 1]


@ELEMENTS.wrong(
    "The indices have changed places in the bending: it goes with before − after, and converges where R > 0."
)
def bent_the_wrong_way(surfaces):
    def refraction(radius, before, after):
        return np.array([[1, 0], [(after - before) / (radius * after), before / after]])

    return -1 / _matrix(surfaces, refraction)[1, 0]


@ELEMENTS.wrong(
    "You divide by R and not by the index behind: a slope inside glass is (n₁ − n₂)/(R *n₂*) times the height."
)
def not_divided_by_the_index(surfaces):
    def refraction(radius, before, after):
        return np.array([[1, 0], [(before - after) / radius, before / after]])

    return -1 / _matrix(surfaces, refraction)[1, 0]


@ELEMENTS.wrong(
    "A slope that meets a surface on the axis changes, too: the lower right entry is n₁/n₂, where yours has 1."
)
def slopes_unchanged_on_the_axis(surfaces):
    def refraction(radius, before, after):
        return np.array([[1, 0], [(before - after) / (radius * after), 1]])

    return -1 / _matrix(surfaces, refraction)[1, 0]


@ELEMENTS.wrong(
    "Your C stays 0, and f infinite. `*` does that, which multiplies entry by entry: matrices take `@`. So does "
    "`before = after` ahead of the row's matrix, for then no index changes at the surface."
)
def entry_by_entry(surfaces):
    M, before = np.eye(2), 1.0
    for radius, _, after in surfaces:
        M = _refraction(radius, before, after) * M
        before = after
    return -1 / M[1, 0]


@ELEMENTS.wrong(
    "This is where parallel light meets, counted from the end of the last row: −A/C. The focal length is −1/C, counted "
    "from a principal plane."
)
def back_focal_distance(surfaces):
    M = _matrix(surfaces)
    return -M[0, 0] / M[1, 0]


@ELEMENTS.wrong(
    "For lenses that make light converge this is right. A lens that makes it diverge has a *negative* focal length: "
    "keep the sign of −1/C."
)
def always_positive(surfaces):
    return abs(effective_focal_length(surfaces))


@ELEMENTS.wrong("For a single lens this is right. You stop after two surfaces: go on to the last row.")
def first_two_surfaces(surfaces):
    return effective_focal_length(surfaces[:2])


@ELEMENTS.wrong("50 mm is what the triplet in this lesson has. Other prescriptions have others: use `surfaces`.")
def always_fifty(surfaces):
    return 50.0


EXERCISES = (IMAGE, BLUR, VIEW, LIMITS, ELEMENTS)
