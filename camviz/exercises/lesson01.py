"""Lesson 01, the pinhole camera: projection and its inverse, vanishing points, what lies behind, and the best hole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise


def project(points: Array, f: float, cx: float, cy: float) -> Array:
    """u = f X/Z + cx, v = f Y/Z + cy for points (..., 3) in front of the camera."""
    return f * points[..., :2] / points[..., 2:] + (cx, cy)


def in_front(points: Array, f: float, cx: float, cy: float) -> Array:
    """The same for any points (..., 3): NaN where Z ≤ 0."""
    z = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    return f * points[..., :2] / z + (cx, cy)


def vanishing_point(direction: Array, f: float, cx: float, cy: float) -> Array:
    """Where lines along directions (..., 3) meet in the image: the image of the direction itself."""
    return f * direction[..., :2] / direction[..., 2:] + (cx, cy)


def ray(uv: Array, f: float, cx: float, cy: float) -> Array:
    """The unit directions (..., 3) of all points that share the pixels (..., 2)."""
    x, y = (uv[..., 0] - cx) / f, (uv[..., 1] - cy) / f
    direction = np.stack([x, y, np.ones_like(x)], axis=-1)
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def best_hole(focal_mm: float, wavelength_nm: float) -> float:
    """The hole as wide as its own Airy disc, d = 2.44 λ f / d, in millimetres."""
    return np.sqrt(2.44 * wavelength_nm * 1e-6 * focal_mm)


def _pixels(rng: np.random.Generator) -> tuple[float, float, float]:
    return float(rng.uniform(300, 900)), float(rng.uniform(250, 400)), float(rng.uniform(180, 240))


def _points(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return rng.uniform([-2, -2, 1], [2, 2, 6], (*shape, 3))


def _project_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape), *_pixels(rng))


def _front_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape), *_pixels(rng))
    yield (_points(rng, (4,)) * [1, 1, -1], *_pixels(rng))
    yield (_points(rng, (3,)) * [[1, 1, 1], [1, 1, -1], [1, 1, 0]], *_pixels(rng))


def _direction_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        towards = rng.uniform([-1, -1, 0.2], [1, 1, 1], (*shape, 3))
        yield (towards * rng.choice([-1.0, 1.0], (*shape, 1)), *_pixels(rng))
    yield (rng.uniform([-1, -1, -1], [1, 1, -0.2]), *_pixels(rng))


def _ray_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0, 600, (*shape, 2)), *_pixels(rng))


def _hole_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield (float(rng.uniform(15, 150)), float(rng.uniform(420, 680)))


def _mirrored(points: Array, f: float, cx: float, cy: float) -> Array:
    with np.errstate(all="ignore"):
        return f * points[..., :2] / points[..., 2:] + (cx, cy)


PROJECT = Exercise(
    name="01.project",
    reference=project,
    cases=_project_cases,
    shown=((np.array([0.5, 0.25, 2.0]), 640.0, 319.5, 239.5),),
    hints=(
        "Divide X and Y by the depth Z of the same point, stretch by f, then shift to the principal point.",
        "`points[..., :2] / points[..., 2:]` divides both coordinates at once: `2:` keeps the last axis, "
        "so that any number "
        "of points broadcasts. Add `(cx, cy)` at the end.",
    ),
    praise="These are the pixels that camviz and OpenCV give, for one point and for any array of them.",
)


@PROJECT.wrong("This is measured from the principal point. A pixel counts from the corner of the image: add (cx, cy).")
def _(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:]


@PROJECT.wrong(
    "This is the image on the back wall, turned by 180°. Pixels count in the picture that is turned upright again."
)
def _(points, f, cx, cy):
    return -f * points[..., :2] / points[..., 2:] + (cx, cy)


@PROJECT.wrong("This is f Z/X: the fraction stands on its head. What is farther away must become *smaller*.")
def _(points, f, cx, cy):
    return f * points[..., 2:] / points[..., :2] + (cx, cy)


@PROJECT.wrong(
    "You divide by the distance to the hole. The wall is flat, and similar triangles speak of the depth Z alone."
)
def _(points, f, cx, cy):
    return f * points[..., :2] / np.linalg.norm(points, axis=-1, keepdims=True) + (cx, cy)


@PROJECT.wrong("The principal point is added before the division. It is a place in the image, in pixels: add it last.")
def _(points, f, cx, cy):
    return f * (points[..., :2] + (cx, cy)) / points[..., 2:]


@PROJECT.wrong("The principal point is subtracted. That is the way back, from a pixel to its ray; here it is added.")
def _(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:] - (cx, cy)


@PROJECT.wrong("cx and cy have changed places: cx goes with u, which counts columns, and cy with v.")
def _(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:] + (cy, cx)


@PROJECT.wrong("You divide by f. A deeper box makes a larger picture: f multiplies.")
def _(points, f, cx, cy):
    return points[..., :2] / (f * points[..., 2:]) + (cx, cy)


VANISHING = Exercise(
    name="01.vanishing_point",
    reference=vanishing_point,
    cases=_direction_cases,
    hints=(
        "Walk along the line: A + s D. Project that, and let s grow without end. What is left of A?",
        "f (A_x + s D_x) / (A_z + s D_z) + cx tends to f D_x / D_z + cx: project the direction as if it were a point.",
    ),
    praise="The starting point dropped out: all parallel lines share this pixel, whichever way along them you walk.",
)


@VANISHING.wrong(
    "This is measured from the principal point. A pixel counts from the corner of the image: add (cx, cy)."
)
def _(direction, f, cx, cy):
    return f * direction[..., :2] / direction[..., 2:]


@VANISHING.wrong(
    "A direction and its opposite belong to the same lines and meet in the same pixel: keep the sign of D_z."
)
def _(direction, f, cx, cy):
    return f * direction[..., :2] / np.abs(direction[..., 2:]) + (cx, cy)


@VANISHING.wrong("You divide by the length of the direction. Only its share along the axis, D_z, counts.")
def _(direction, f, cx, cy):
    return f * direction[..., :2] / np.linalg.norm(direction, axis=-1, keepdims=True) + (cx, cy)


VANISHING.wrong(
    "For directions that lead away from the camera this is right. A line has two ends: with D_z < 0 "
    "follow it the "
    "other way, and it vanishes in the same pixel. There is no NaN here."
)(in_front)


IN_FRONT = Exercise(
    name="01.in_front",
    reference=in_front,
    cases=_front_cases,
    bug=True,
    hints=(
        "Put in (1, 0, 2), then the point behind the camera on the same line, (−1, 0, −2). Should both have a pixel?",
        "`z = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)` in place of the guarded division. "
        "What has no image "
        "is NaN, and NaN is honest: it draws nothing.",
    ),
    praise="Nothing behind the camera has a pixel any more, and no depth is falsified by a guard.",
)


@IN_FRONT.wrong(
    "The `1e-8` keeps the division from failing and hides the question. Points *behind* the camera "
    "still get ordinary "
    "pixels, those at Z = 0 enormous ones, and every other point is a little off."
)
def _(points, f, cx, cy):
    return f * points[..., :2] / (points[..., 2:] + 1e-8) + (cx, cy)


IN_FRONT.wrong(
    "The `1e-8` is gone, but points behind the camera still get pixels, as if light went through the back wall."
)(_mirrored)


@IN_FRONT.wrong("With |Z| what stands behind you is painted over what you see. It has no image at all: NaN.")
def _(points, f, cx, cy):
    return _mirrored(points * [1, 1, 0] + np.abs(points) * [0, 0, 1], f, cx, cy)


@IN_FRONT.wrong(
    "A depth cut off at a tiny number sends what is behind the camera far out of the picture, but "
    "still somewhere: "
    "a line to it is drawn right across. It has no image at all: NaN."
)
def _(points, f, cx, cy):
    return in_front(np.maximum(points, [-np.inf, -np.inf, 1e-8]), f, cx, cy)


@IN_FRONT.wrong(
    "What is behind the camera is NaN now. The `1e-8` is still added to every good depth: it has "
    "nothing to guard any "
    "more, take it out."
)
def _(points, f, cx, cy):
    return f * points[..., :2] / (np.where(points[..., 2:] > 0, points[..., 2:], np.nan) + 1e-8) + (cx, cy)


RAY = Exercise(
    name="01.ray",
    reference=ray,
    cases=_ray_cases,
    hints=(
        "Undo the projection from its end: subtract (cx, cy), divide by f. At which depth do the x and y "
        "that you get lie?",
        "`np.stack([x, y, np.ones_like(x)], axis=-1)` is a point on the ray, at depth 1. Divide it by its length.",
    ),
    praise="A pixel gives a direction and no more: every positive multiple of it lands there.",
)


@RAY.wrong("This is a point on the ray, at depth 1. Divide it by its length to have the *unit* direction.")
def _(uv, f, cx, cy):
    return np.concatenate([(uv - (cx, cy)) / f, np.ones_like(uv[..., :1])], axis=-1)


@RAY.wrong(
    "This is the ray of the pixel counted from the principal point. Here (u, v) counts from the "
    "corner of the image: "
    "subtract (cx, cy) first."
)
def _(uv, f, cx, cy):
    return ray(uv + (cx, cy), f, cx, cy)


@RAY.wrong("x and y have the wrong sign: a pixel to the right of the principal point looks to the right.")
def _(uv, f, cx, cy):
    return ray(np.array([cx, cy]) - (uv - (cx, cy)), f, cx, cy)


@RAY.wrong("The ray is too steep: divide by f once, either x and y or the whole vector, not both.")
def _(uv, f, cx, cy):
    return ray(uv, f * f, cx, cy)


BEST_HOLE = Exercise(
    name="01.best_hole",
    reference=best_hole,
    cases=_hole_cases,
    shown=((50.0, 550.0),),
    hints=(
        "Set the two equal: d = 2.44 λ f / d, and solve for d. Mind the units: a nanometre is 10⁻⁶ mm.",
        "d² = 2.44 λ f, with λ = wavelength_nm · 1e-6 and f in millimetres. Then the square root.",
    ),
    praise="For 50 mm and green light that is 0.26 mm: about 1.56 √(f λ).",
)


@BEST_HOLE.wrong("This is d². Take its square root.")
def _(focal_mm, wavelength_nm):
    return 2.44 * wavelength_nm * 1e-6 * focal_mm


@BEST_HOLE.wrong(
    "This is 1000 times too large. A nanometre is 10⁻⁶ mm, so 550 nm are 0.00055 mm; and the answer is in mm."
)
def _(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * focal_mm)


@BEST_HOLE.wrong("The wavelength is in metres here and the focal length in millimetres: 1 nm = 10⁻⁶ mm.")
def _(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * 1e-9 * focal_mm)


@BEST_HOLE.wrong("1.22 λ f / d is the *radius* of the Airy disc. d is a diameter: compare it with 2.44 λ f / d.")
def _(focal_mm, wavelength_nm):
    return np.sqrt(1.22 * wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong(
    "This is Rayleigh's constant, 1.9, for another notion of sharpness. Here the hole equals its Airy disc."
)
def _(focal_mm, wavelength_nm):
    return 1.9 * np.sqrt(wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong(
    "This is Young's constant, 2, for another notion of sharpness. Here the hole is to equal its Airy disc."
)
def _(focal_mm, wavelength_nm):
    return 2 * np.sqrt(wavelength_nm * 1e-6 * focal_mm)


EXERCISES = (PROJECT, VANISHING, IN_FRONT, RAY, BEST_HOLE)
