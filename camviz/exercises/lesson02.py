"""Lesson 02, lenses: the image's place, the field of view with a bug in it, blur, its limits, and real elements.

Lengths in millimetres from the lens, as in `camviz.optics`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from camviz.checks import SHAPES, Arguments, Array, Exercise


def image_distance(f: float, u: ArrayLike) -> Array:
    """v with 1/f = 1/u + 1/v for objects at u (...); negative for a virtual image."""
    return 1 / (1 / f - 1 / np.asarray(u))


def field_of_view(width: float, f: float, s: Array) -> Array:
    """2 atan(width / 2v) in radians, v being where a lens focused at s (...) has its sensor."""
    return 2 * np.arctan(width / (2 * image_distance(f, s)))


def blur(f: float, N: float, s: float, u: Array) -> Array:
    """Diameter f/N · |v(u) - v(s)| / v(u) of the disc that a point at u (...) makes on a sensor focused at s."""
    sensor, image = image_distance(f, s), image_distance(f, u)
    return f / N * np.abs(image - sensor) / image


def limits(f: float, N: float, s: Array, c: float) -> tuple[Array, Array]:
    """Nearest and farthest distances (...) with blur c, for a lens focused at s (...)."""
    H = f**2 / (N * c) + f
    near = s * (H - f) / (H + s - 2 * f)
    with np.errstate(divide="ignore", invalid="ignore"):
        return near, np.where(s < H, s * (H - f) / (H - s), np.inf)


def effective_focal_length(surfaces: Array) -> float:
    """-1/C of the matrix of a lens whose rows are radius, distance to the next surface, index behind (n, 3)."""
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = np.array([[1, 0], [(before - after) / (radius * after), before / after]]) @ M
        M = np.array([[1, distance], [0, 1]]) @ M
        before = after
    return float(-1 / M[1, 0])


def _image_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f = float(rng.uniform(20, 120))
        yield (f, f * rng.uniform(1.2, 60, shape))
    yield (f, f * rng.uniform(0.2, 0.8, 4))  # a magnifying glass
    yield (f, np.array([np.inf, 3 * f]))


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f = float(rng.uniform(20, 120))
        yield (float(rng.uniform(8, 50)), f, f * rng.uniform(1.5, 20, shape))
    yield (36.0, f, np.array([np.inf]))


def _blur_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f, N = float(rng.uniform(20, 120)), float(rng.uniform(1.4, 16))
        yield (f, N, f * float(rng.uniform(5, 60)), f * rng.uniform(3, 200, shape))


def _limit_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f, N, c = (float(rng.uniform(*ends)) for ends in ((20, 100), (2, 16), (0.005, 0.03)))
        yield (f, N, f**2 / (N * c) * rng.uniform(0.1, 0.9, shape), c)
    yield (f, N, f**2 / (N * c) * np.array([0.4, 1.5, 4.0]), c)


def _lens_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for elements in (1, 1, 2, 3):
        rows = []
        for _ in range(elements):
            glass, power = float(rng.uniform(1.45, 1.8)), float(rng.uniform(60, 200))
            rows += [(power, float(rng.uniform(2, 9)), glass), (-power * float(rng.uniform(1.2, 4)), 4.0, 1.0)]
        yield (np.array(rows),)


IMAGE = Exercise(
    name="02.image_distance",
    reference=image_distance,
    cases=_image_cases,
    shown=((50.0, np.array(1000.0)),),
    hints=(
        "Solve 1/f = 1/u + 1/v for v: first for 1/v, then turn it over.",
        "`1 / (1 / f - 1 / u)`, for every u: also for one that is infinite, or nearer than f.",
    ),
    praise="An object at infinity has its image at f, one at 2f at 2f, and one inside f a virtual one before the lens.",
)


@IMAGE.wrong("The sign: this is 1/f + 1/u. What bends the rays, 1/f, is shared by object *and* image: 1/f = 1/u + 1/v.")
def _(f, u):
    return 1 / (1 / f + 1 / np.asarray(u))


@IMAGE.wrong("This is 1/v. Turn it over once more to have a distance.")
def _(f, u):
    return 1 / f - 1 / np.asarray(u)


@IMAGE.wrong(
    "This puts the image at f whatever the object. That is so at infinity alone; the nearer the object, the "
    "farther behind the lens its image."
)
def _(f, u):
    return f + 0 * np.where(np.isfinite(u), u, 0)


@IMAGE.wrong("The lens equation adds *reciprocals*: 1/f = 1/u + 1/v.")
def _(f, u):
    return np.asarray(u) - f


@IMAGE.wrong(
    "For objects beyond f this is right. Inside f there is no image behind the lens: v is *negative*, the "
    "light only seems to come from there. Keep the sign."
)
def _(f, u):
    return np.abs(image_distance(f, u))


VIEW = Exercise(
    name="02.field_of_view",
    reference=field_of_view,
    cases=_view_cases,
    bug=True,
    hints=(
        "Draw the triangle: half the sensor, and the distance from the lens to the *sensor*. How far is that?",
        "The sensor stands at v = 1 / (1/f − 1/s). Put v where f is.",
    ),
    praise="Now the view narrows when the lens is focused near, as it does in every film whose focus is pulled.",
)


@VIEW.wrong(
    "The focus `s` changes nothing here. With the sensor at f the lens sees sharp at infinity only; focused "
    "nearer, the sensor has to stand farther back."
)
def _(width, f, s):
    return 2 * np.arctan(width / (2 * f)) + 0 * np.where(np.isfinite(s), s, 0)


@VIEW.wrong(
    "This is the angle under which the *subject's place* would see a sensor's width. The triangle behind the "
    "lens is what counts: its length is v, not s."
)
def _(width, f, s):
    return 2 * np.arctan(width / (2 * np.asarray(s)))


@VIEW.wrong("This is *half* the field of view.")
def _(width, f, s):
    return np.arctan(width / (2 * image_distance(f, s)))


@VIEW.wrong("The triangle has *half* the sensor's width for its side: width / 2.")
def _(width, f, s):
    return 2 * np.arctan(width / image_distance(f, s))


BLUR = Exercise(
    name="02.blur",
    reference=blur,
    cases=_blur_cases,
    shown=((50.0, 2.0, 2000.0, np.array(4000.0)),),
    hints=(
        "Behind the lens the light of the point is a cone: as wide as the aperture at the lens, a point at v(u). How "
        "wide is it where the sensor cuts it, at v(s)?",
        "Similar triangles: blur / (f/N) = |v(u) − v(s)| / v(u).",
    ),
    praise="It is f²/(N (s − f)) · |u − s|/u, and you had it from two triangles.",
)


@BLUR.wrong("You divide by the *sensor's* distance v(s). The cone's tip is at v(u), and its whole length is v(u).")
def _(f, N, s, u):
    return blur(f, N, s, u) * image_distance(f, u) / image_distance(f, s)


@BLUR.wrong("This is the radius. The aperture f/N is a diameter, so keep to that.")
def _(f, N, s, u):
    return blur(f, N, s, u) / 2


@BLUR.wrong("The aperture's diameter is f/N: the f-number *divides*, and a larger N makes a smaller blur.")
def _(f, N, s, u):
    return blur(f, N, s, u) * N / f * N


@BLUR.wrong(
    "This is the cone cut in front of the lens, at the plane in focus. On the sensor it is smaller by the "
    "magnification, f/(s − f)."
)
def _(f, N, s, u):
    return f / N * np.abs(np.asarray(u) - s) / np.asarray(u)


@BLUR.wrong("Close: this takes the sensor to stand at f. With v(s) it is f²/(N (s − f)), which matters near the lens.")
def _(f, N, s, u):
    return f**2 / (N * s) * np.abs(np.asarray(u) - s) / np.asarray(u)


@BLUR.wrong("Beyond the focus or before it, a disc has a positive diameter: take the absolute value.")
def _(f, N, s, u):
    return f / N * (image_distance(f, u) - image_distance(f, s)) / image_distance(f, u)


LIMITS = Exercise(
    name="02.limits",
    reference=limits,
    cases=_limit_cases,
    shown=((50.0, 8.0, np.array(5233.33), 0.03),),
    hints=(
        "Begin with H = f²/(N c) + f. Then near = s (H − f)/(H + s − 2f) and far = s (H − f)/(H − s). What does the "
        "far one become when s reaches H?",
        "`np.where(s < H, s * (H - f) / (H - s), np.inf)`, and return both: `return near, far`.",
    ),
    praise="Put back into the blur, both limits give c: 30 µm for 30 µm. And beyond H there is no far limit any more.",
)


@LIMITS.wrong(
    "For s < H this is right. From s = H on everything behind is sharp enough: the far limit is `np.inf`, not "
    "a negative distance."
)
def _(f, N, s, c):
    return (limits(f, N, s, c)[0], s * (f**2 / (N * c)) / (f**2 / (N * c) + f - s))


@LIMITS.wrong("For s < H this is right. Beyond, the limit *exists*: it is infinitely far, `np.inf`.")
def _(f, N, s, c):
    return (limits(f, N, s, c)[0], np.where(s < f**2 / (N * c) + f, limits(f, N, s, c)[1], np.nan))


@LIMITS.wrong("Near and far have changed places: return the near one first.")
def _(f, N, s, c):
    return limits(f, N, s, c)[::-1]


@LIMITS.wrong("These are the short forms H s/(H ± s), good when s is large beside f. Here the exact ones are wanted.")
def _(f, N, s, c):
    return _rule_of_thumb(f, N, s, c)


def _rule_of_thumb(f: float, N: float, s: Array, c: float) -> tuple[Array, Array]:
    H = f**2 / (N * c) + f
    with np.errstate(divide="ignore", invalid="ignore"):
        return H * s / (H + s), np.where(s < H, H * s / (H - s), np.inf)


def _glass_forgotten(surfaces: Array) -> float:
    """Every surface as if the light came out of air."""
    M = np.eye(2)
    for radius, distance, after in surfaces:
        M = np.array([[1, distance], [0, 1]]) @ np.array([[1, 0], [(1 - after) / (radius * after), 1 / after]]) @ M
    return float(-1 / M[1, 0])


def _wrong_order(surfaces: Array) -> float:
    M, before = np.eye(2), 1.0
    for radius, distance, after in surfaces:
        M = M @ np.array([[1, 0], [(before - after) / (radius * after), before / after]])
        M = M @ np.array([[1, distance], [0, 1]])
        before = after
    return float(-1 / M[1, 0])


def _without_gaps(surfaces: Array) -> float:
    return effective_focal_length(surfaces * [1, 0, 1])


ELEMENTS = Exercise(
    name="02.effective_focal_length",
    reference=effective_focal_length,
    cases=_lens_cases,
    hints=(
        "Go through the rows, and keep two things: the matrix so far, and the index of what the light is in. Each row "
        "is a refraction and then a way to go.",
        "`M = refraction @ M`, then `M = [[1, d], [0, 1]] @ M`, then `before = after`: what comes later stands on the "
        "left. In the end −1 / M[1, 0].",
    ),
    praise="Any lens with a prescription, from a reading glass to a zoom, is now one matrix for you.",
)

ELEMENTS.wrong(
    "Your light always comes out of air. Keep the index it is in: after a row, `before` becomes that row's `after`."
)(_glass_forgotten)


ELEMENTS.wrong("The order is reversed: the ray is on the right, so the first surface stands rightmost: `M = new @ M`.")(
    _wrong_order
)


ELEMENTS.wrong("The surfaces are taken to lie on top of each other. Between them light travels: [[1, d], [0, 1]].")(
    _without_gaps
)


@ELEMENTS.wrong(
    "The sign: a ray parallel to the axis comes out with slope C y, downwards when the lens converges; so f = −1/C."
)
def _(surfaces):
    return -effective_focal_length(surfaces)


@ELEMENTS.wrong("This is C itself. The focal length is −1/C.")
def _(surfaces):
    return -1 / effective_focal_length(surfaces)


EXERCISES = (IMAGE, VIEW, BLUR, LIMITS, ELEMENTS)
