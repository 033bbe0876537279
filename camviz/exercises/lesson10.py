"""Lesson 10, omnidirectional cameras: the unified sphere and its inverse, the double sphere, a cube, and a ring's seam.

Directions are in the camera's frame, z towards the middle of the picture; image points are in focal lengths.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise


def project(points: Array, xi: float) -> Array:
    """(x, y) = (X, Y) / (Z + ξ D), D = |(X, Y, Z)|, for points (..., 3) and 0 ≤ ξ ≤ 1; NaN where Z + ξ D ≤ 0."""
    D = np.linalg.norm(points, axis=-1)
    depth = points[..., 2] + xi * D
    return points[..., :2] / np.where(depth > 0, depth, np.nan)[..., None]


def unproject(xy: Array, xi: float) -> Array:
    """The unit rays (..., 3) of image points (..., 2): η (x, y, 1) - (0, 0, ξ), which lies on the sphere."""
    r2 = np.sum(xy**2, axis=-1)
    eta = (xi + np.sqrt(1 + (1 - xi**2) * r2)) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


def double_sphere(points: Array, xi: float, alpha: float) -> Array:
    """(x, y) = (X, Y) / (α D₂ + (1 - α) (ξ D₁ + Z)), D₁ = |(X, Y, Z)|, D₂ = |(X, Y, ξ D₁ + Z)|."""
    d1 = np.linalg.norm(points, axis=-1)
    z = xi * d1 + points[..., 2]
    d2 = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2 + z**2)
    return points[..., :2] / (alpha * d2 + (1 - alpha) * z)[..., None]


def cube_point(direction: Array) -> Array:
    """Where a direction (3,) meets the cube of half side 1 around the camera: it over its largest coordinate's size."""
    return direction / np.max(np.abs(direction), axis=-1, keepdims=True)


def parallax(cameras: int, radius: float, distance: float, width: int) -> float:
    """Pixels between the two images of a point straight out at a seam, in a panorama stitched for infinity."""
    alpha = np.pi / cameras
    angle = np.arctan2(radius * np.sin(alpha), distance - radius * np.cos(alpha))
    return 2 * angle * width / (2 * np.pi)


def _seen(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Points whose z is positive, of any size."""
    points = rng.uniform(-1, 1, (*shape, 3)) * rng.uniform(0.5, 3)
    points[..., 2] = rng.uniform(0.1, 2, shape)
    return points


def _project_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield _seen(rng, shape), float(rng.uniform(0.2, 0.95))
    behind = rng.uniform([0.1, 0.1, -0.9], [0.6, 0.6, -0.7], (6, 3))
    yield np.concatenate([behind, _seen(rng, (3,))]), float(rng.uniform(0.05, 0.3))  # these have no image
    yield rng.uniform([0.5, 0.5, -0.4], [1.0, 1.0, -0.1], (4, 3)), float(rng.uniform(0.7, 0.95))  # behind, and seen


def _unproject_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(-0.9, 0.9, (*shape, 2)), float(rng.uniform(0.2, 0.95))
    yield rng.uniform(-0.6, 0.6, (5, 2)), float(rng.uniform(1.1, 1.4))
    yield rng.uniform(1.1, 2.0, (5, 2)), 1.0  # rays that look backwards


def _double_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield _seen(rng, shape), float(rng.uniform(-0.3, 0.4)), float(rng.uniform(0.4, 0.7))


def _cube_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.normal(size=(*shape, 3)) * rng.uniform(0.2, 4),)
    yield (-np.abs(rng.normal(size=(5, 3))),)


def _parallax_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for cameras in (2, 4, 6, 9):
        radius = float(rng.uniform(0.1, 0.4))
        yield cameras, radius, float(rng.uniform(0.6, 5)), int(rng.integers(1000, 8000))


def _without_nan(points: Array, xi: float) -> Array:
    return points[..., :2] / (points[..., 2:] + xi * np.linalg.norm(points, axis=-1, keepdims=True))


def _with_first_distance(points: Array, xi: float, alpha: float) -> Array:
    """The double sphere with D₁ where D₂ belongs: the bug of the lesson."""
    d1 = np.linalg.norm(points, axis=-1)
    z = xi * d1 + points[..., 2]
    return points[..., :2] / (alpha * d1 + (1 - alpha) * z)[..., None]


def _with_unshifted_depth(points: Array, xi: float, alpha: float) -> Array:
    d1 = np.linalg.norm(points, axis=-1)
    d2 = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2 + (xi * d1 + points[..., 2]) ** 2)
    return points[..., :2] / (alpha * d2 + (1 - alpha) * points[..., 2])[..., None]


def _one_ray(cameras: int, radius: float, distance: float, width: int) -> float:
    return parallax(cameras, radius, distance, width) / 2


def _by_baseline(baseline: float, distance: float, width: int) -> float:
    return baseline / distance * width / (2 * np.pi)


PROJECT = Exercise(
    name="10.project",
    reference=project,
    cases=_project_cases,
    shown=((np.array([1.0, 2.0, 5.0]), 0.8),),
    hints=(
        "Two steps: the distance D of every point from the camera, over the last axis; then divide X and Y by Z + ξ D.",
        "`D = np.linalg.norm(points, axis=-1)` and `depth = points[..., 2] + xi * D`. Where the depth is not positive "
        "there is no image: `np.where(depth > 0, depth, np.nan)[..., None]`.",
    ),
    praise="One formula, from the pinhole (ξ = 0) to the parabolic mirror (ξ = 1), behind the camera too.",
)


@PROJECT.wrong("This is the pinhole, ξ = 0: nothing beside the camera or behind it has an image.")
def _(points, xi):
    return points[..., :2] / np.where(points[..., 2:] > 0, points[..., 2:], np.nan)


PROJECT.wrong(
    "For points that have an image this is right. Where Z + ξ D ≤ 0 there is none, and the formula gives the "
    "mirror image of a point behind: say NaN there."
)(_without_nan)


@PROJECT.wrong("You drop everything behind the camera, as a pinhole must. The sphere shows what has Z + ξ D > 0.")
def _(points, xi):
    return np.where(points[..., 2:] > 0, project(points, xi), np.nan)


@PROJECT.wrong(
    "Yours is (1 + ξ) times too large: it agrees with a pinhole in the middle. Leave that factor to the focal length."
)
def _(points, xi):
    return project(points, xi) * (1 + xi)


@PROJECT.wrong("You add ξ instead of ξ D: that is right only for points on the unit sphere, one metre away.")
def _(points, xi):
    return points[..., :2] / (points[..., 2:] + xi)


UNPROJECT = Exercise(
    name="10.unproject",
    reference=unproject,
    cases=_unproject_cases,
    shown=((np.array([0.5, -0.25]), 0.8),),
    hints=(
        "The line starts ξ behind the centre and goes through (x, y, 1 − ξ): its points are η (x, y, 1) − (0, 0, ξ). "
        "Which η puts one on the unit sphere?",
        "η² (r² + 1) − 2 η ξ + ξ² = 1 with r² = x² + y². The solution in front is "
        "`(xi + np.sqrt(1 + (1 - xi**2) * r2)) / (1 + r2)`; the ray is (η x, η y, η − ξ).",
    ),
    praise="A closed form, and of unit length without any normalising. Few wide models have one.",
)


@UNPROJECT.wrong(
    "This is the pinhole's ray, (x, y, 1) made a unit vector. That is where the line from ξ behind goes, not "
    "where it meets the sphere."
)
def _(xy, xi):
    return unproject(xy, 0.0)


@UNPROJECT.wrong("You forgot to subtract ξ: your vector starts at the point ξ behind, not at the centre of the sphere.")
def _(xy, xi):
    return unproject(xy, xi) + np.array([0, 0, xi])


@UNPROJECT.wrong("This is the other place where the line meets the sphere, the one behind: take the positive root.")
def _(xy, xi):
    return _other_root(xy, xi)


@UNPROJECT.wrong("The direction is right; its length is 2. The conventions ask for unit rays.")
def _(xy, xi):
    return unproject(xy, xi) * 2


DOUBLE_SPHERE = Exercise(
    name="10.double_sphere",
    reference=double_sphere,
    cases=_double_cases,
    bug=True,
    hints=(
        "Compare line by line with the equation: which two distances does it have, and from where is each measured?",
        "D₂ is the distance after the point has been moved by ξ D₁ along z: its third coordinate is ξ D₁ + Z, not Z.",
    ),
    praise="Onto one sphere, then onto another, ξ further on. With ξ = 0 it is the unified sphere in its α form.",
)

DOUBLE_SPHERE.wrong(
    "This is what you get with D₁ in both places: the second sphere is missing. Its distance D₂ is measured to "
    "the point that was moved, (X, Y, ξ D₁ + Z)."
)(_with_first_distance)


DOUBLE_SPHERE.wrong("D₂ is right now; the other term still has Z where the moved depth ξ D₁ + Z belongs.")(
    _with_unshifted_depth
)


@DOUBLE_SPHERE.wrong("α and 1 − α have changed places: α goes with the distance D₂.")
def _(points, xi, alpha):
    return double_sphere(points, xi, 1 - alpha)


CUBE = Exercise(
    name="10.cube_point",
    reference=cube_point,
    cases=_cube_cases,
    shown=((np.array([1.0, -2.0, 0.5]),),),
    hints=(
        "The ray leaves the cube through the face of its largest coordinate. There that coordinate is +1 or −1.",
        "Divide by the largest *size*, `np.max(np.abs(direction), axis=-1, keepdims=True)`: the sign must stay.",
    ),
    praise="Six pinholes of 90°, chosen by one comparison. Which coordinate is ±1 says which face it is.",
)


@CUBE.wrong(
    "You divide by the largest coordinate, not by the largest in *size*: a direction to the back or the left "
    "comes out on the opposite face."
)
def _(direction):
    return direction / np.max(direction, axis=-1, keepdims=True)


@CUBE.wrong("This point is on the *sphere*. On the cube, the largest coordinate is ±1.")
def _(direction):
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


@CUBE.wrong("This is right on the front and the back. To the side, up and down, another coordinate is the largest.")
def _(direction):
    return direction / np.abs(direction[..., 2:])


@CUBE.wrong("You took the largest coordinate of *all* directions. Each has its own: over the last axis only.")
def _(direction):
    return direction / np.max(np.abs(direction))


PARALLAX = Exercise(
    name="10.parallax",
    reference=parallax,
    cases=_parallax_cases,
    shown=((6, 0.15, 2.0, 4000),),
    hints=(
        "Draw it from above, the seam straight up: the two cameras are ±r sin α beside it and r cos α along it, where "
        "α = π/n. At what angle to the seam does each see the point at Z?",
        "tan ψ = r sin α / (Z − r cos α). The images are 2ψ apart, and a panorama has width/(2π) pixels per radian.",
    ),
    praise="No stitching makes this zero at every distance: the cameras have no common viewpoint.",
)

PARALLAX.wrong("This is how far *one* camera's image is from the seam. The other's is as far beyond it.")(_one_ray)


@PARALLAX.wrong(
    "You measure the distance from the cameras' line; Z counts from the ring's *centre*, so that the cameras "
    "are r cos α nearer."
)
def _(n, r, z, width):
    return 2 * np.arctan2(r * np.sin(np.pi / n), z) * width / (2 * np.pi)


@PARALLAX.wrong("b/Z is what remains far away. Near the ring it is too small: use the exact angle.")
def _(n, r, z, width):
    return _by_baseline(2 * r * np.sin(np.pi / n), z, width)


@PARALLAX.wrong("You take the ring's diameter for the baseline. Neighbours are 2 r sin(π/n) apart.")
def _(n, r, z, width):
    return _by_baseline(2 * r, z, width)


@PARALLAX.wrong("This is the angle in radians. Multiply by the pixels per radian, width/(2π).")
def _(n, r, z, width):
    return parallax(n, r, z, width) * 2 * np.pi / width


@PARALLAX.wrong("A panorama has width/(2π) pixels per radian, not width: it goes all the way round.")
def _(n, r, z, width):
    return parallax(n, r, z, width) * 2 * np.pi


def _other_root(xy: Array, xi: float) -> Array:
    r2 = np.sum(xy**2, axis=-1)
    eta = (xi - np.sqrt(1 + (1 - xi**2) * r2)) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


EXERCISES = (PROJECT, UNPROJECT, DOUBLE_SPHERE, CUBE, PARALLAX)
