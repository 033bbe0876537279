"""Lesson 10, omnidirectional cameras: the unified sphere and its inverse, a ring's seam, the double sphere, the valley
of f and ξ, a polynomial for any mirror, and a cube.

Directions are in the camera's frame, z towards the middle of the picture; image points are in focal lengths.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise


def _in_front(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Points whose z is positive, of any size, none of them a metre away."""
    points = rng.uniform(0.3, 1, (*shape, 3)) * rng.choice([-1, 1], (*shape, 3)) * rng.choice([0.3, 3.0])
    return np.concatenate([points[..., :2], np.abs(points[..., 2:])], axis=-1)


# 1: the unified sphere -----------------------------------------------------------------------------------------------


def project(points: Array, xi: float) -> Array:
    """(x, y) = (X, Y) / (Z + ξ D), D = |(X, Y, Z)|, for points (..., 3) and 0 ≤ ξ ≤ 1; NaN where Z + ξ D ≤ 0."""
    D = np.linalg.norm(points, axis=-1)
    depth = points[..., 2] + xi * D
    return points[..., :2] / np.where(depth > 0, depth, np.nan)[..., None]


def _project_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield _in_front(rng, shape), float(rng.uniform(0.2, 0.95))
    behind = rng.uniform([0.1, 0.1, -0.9], [0.6, 0.6, -0.7], (6, 3))
    yield np.concatenate([behind, _in_front(rng, (3,))]), float(rng.uniform(0.05, 0.3))  # these have no image
    yield rng.uniform([0.5, 0.5, -0.4], [1.0, 1.0, -0.1], (4, 3)), float(rng.uniform(0.7, 0.95))  # behind, and seen
    beside = rng.choice([-1, 1], (2, 3)) * rng.uniform(0.3, 1, (2, 3)) * [1, 1, 0]  # where Z + ξ D is exactly 0
    yield np.concatenate([_in_front(rng, (3,)), -_in_front(rng, (2,)), beside]), 0.0
    axis = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) * rng.uniform(0.5, 2)
    yield np.concatenate([_in_front(rng, (3,)), -_in_front(rng, (2,)), axis]), 1.0


PROJECT = Exercise(
    name="10.project",
    reference=project,
    cases=_project_cases,
    shown=((np.array([1.0, 2.0, 5.0]), 0.8),),
    hints=(
        "A pinhole divides X and Y by Z. What does the sphere divide by, and for which points has that no meaning?",
        "`np.linalg.norm(…, axis=-1)` gives every point its own distance D. Where Z + ξ D is not positive there is no "
        "image: `np.where(condition, depth, np.nan)`, and `[..., None]` adds an axis so that it divides both "
        "coordinates.",
        "`depth = points[..., 2] + ___`, then `return points[..., :2] / np.where(___, depth, np.nan)[..., None]`",
    ),
    praise="One formula, from the pinhole (ξ = 0) to the parabolic mirror (ξ = 1), behind the camera too.",
)


@PROJECT.right
def as_opencv_projects_it(points, xi):
    import cv2

    flat = np.reshape(points, (1, -1, 3))
    xy = cv2.omnidir.projectPoints(flat, np.zeros(3), np.zeros(3), np.eye(3), xi, np.zeros(4))[0]
    seen = points[..., 2] > -xi * np.sqrt(np.sum(points**2, axis=-1))
    return np.where(seen[..., None], np.reshape(xy, (*points.shape[:-1], 2)), np.nan)


@PROJECT.wrong("This is the pinhole, ξ = 0: nothing beside the camera or behind it has an image.")
def pinhole(points, xi):
    return points[..., :2] / np.where(points[..., 2:] > 0, points[..., 2:], np.nan)


@PROJECT.wrong("Where Z + ξ D ≤ 0 there is no image: return NaN. Your formula mirrors these points through the middle.")
def mirror_images_kept(points, xi):
    return points[..., :2] / (points[..., 2:] + xi * np.linalg.norm(points, axis=-1, keepdims=True))


@PROJECT.wrong("You drop all points behind the camera, as a pinhole does. The sphere shows those with Z + ξ D > 0.")
def dropped_behind_the_camera(points, xi):
    return np.where(points[..., 2:] > 0, project(points, xi), np.nan)


@PROJECT.wrong("You add ξ instead of ξ D: that is right only for points on the unit sphere, one metre away.")
def xi_without_d(points, xi):
    depth = points[..., 2:] + xi
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("You subtract ξ D. The eye is ξ *behind* the centre, so everything is farther from it: Z + ξ D.")
def eye_in_front(points, xi):
    depth = points[..., 2:] - xi * np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("Your D is one number for *all* points together. Each has its own: take the norm over the last axis.")
def one_distance_for_all(points, xi):
    depth = points[..., 2:] + xi * np.linalg.norm(points)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


# 3: and back ---------------------------------------------------------------------------------------------------------


def unproject(xy: Array, xi: float) -> Array:
    """The unit rays (..., 3) of image points (..., 2): η (x, y, 1) - (0, 0, ξ), which lies on the sphere."""
    r2 = np.sum(xy**2, axis=-1)
    eta = (xi + np.sqrt(1 + (1 - xi**2) * r2)) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


def _unproject_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(0.2, 0.9, (*shape, 2)) * rng.choice([-1, 1], (*shape, 2)), float(rng.uniform(0.2, 0.95))
    yield rng.uniform(0.2, 0.6, (5, 2)), float(rng.uniform(1.1, 1.4))
    yield rng.uniform(1.1, 2.0, (5, 2)), 1.0  # rays that look backwards
    yield np.concatenate([np.zeros((1, 2)), rng.uniform(-0.9, 0.9, (3, 2))]), float(rng.choice([0.0, 0.6, 1.2]))
    yield np.concatenate([np.zeros((1, 2)), rng.uniform(-0.9, 0.9, (3, 2))]), 0.0


UNPROJECT = Exercise(
    name="10.unproject",
    reference=unproject,
    cases=_unproject_cases,
    shown=((np.array([0.5, -0.25]), 0.8),),
    hints=(
        "The line starts ξ behind the centre: its points are η (x, y, 1) − (0, 0, ξ). What must be true of a point of "
        "it that lies on the unit sphere?",
        "Its length is one: η² (1 + r²) − 2 η ξ + ξ² = 1 with r² = x² + y², a quadratic equation in η. Of its two "
        "solutions take the larger one, with the plus before the root. Then put η into the line.",
        "`eta = (xi + np.sqrt(___)) / (1 + r2)`",
    ),
    praise="A closed form, and of unit length without any normalising. A polynomial of distortion has none.",
)


@UNPROJECT.right
def by_the_rule_of_sines(xy, xi):
    """In the triangle of centre, eye and point the angle at the eye is φ, and that at the point has ξ sin φ as sine."""
    phi, turn = np.arctan(np.hypot(xy[..., 0], xy[..., 1])), np.arctan2(xy[..., 1], xy[..., 0])
    theta = phi + np.arcsin(xi * np.sin(phi))
    return np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), np.cos(theta)], axis=-1)


@UNPROJECT.right
def by_the_roots_of_the_quadratic(xy, xi):
    rays = []
    for x, y in xy.reshape(-1, 2):
        eta = np.roots([x * x + y * y + 1, -2 * xi, xi * xi - 1]).max()
        rays.append([eta * x, eta * y, eta - xi])
    return np.reshape(rays, (*xy.shape[:-1], 3))


@UNPROJECT.wrong("You made (x, y, 1) a unit vector. Find where the line from the point ξ behind meets the sphere.")
def ray_of_a_pinhole(xy, xi):
    return unproject(xy, 0.0)


@UNPROJECT.wrong("You forgot to subtract ξ: your vector starts at the point ξ behind, not at the sphere's centre.")
def seen_from_the_eye(xy, xi):
    return unproject(xy, xi) + np.array([0, 0, xi])


@UNPROJECT.wrong("This is the other place where the line meets the sphere, on the eye's side: take the larger root.")
def smaller_root(xy, xi):
    r2 = np.sum(xy**2, axis=-1)
    eta = (xi - np.sqrt(1 + (1 - xi**2) * r2)) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


@UNPROJECT.wrong("Your Z is never negative. Rays that look backwards have Z < 0: use Z = η − ξ.")
def never_backwards(xy, xi):
    rays = unproject(xy, xi)
    return np.concatenate([rays[..., :2], np.abs(rays[..., 2:])], axis=-1)


# 4: find the bug in the double sphere --------------------------------------------------------------------------------


def double_sphere(points: Array, xi: float, alpha: float) -> Array:
    """(x, y) = (X, Y) / (α D₂ + (1 - α) (ξ D₁ + Z)), D₁ = |(X, Y, Z)|, D₂ = |(X, Y, ξ D₁ + Z)|."""
    d1 = np.linalg.norm(points, axis=-1)
    z = xi * d1 + points[..., 2]
    d2 = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2 + z**2)
    return points[..., :2] / (alpha * d2 + (1 - alpha) * z)[..., None]


def double_sphere_as_given(points, xi, alpha):
    d1 = np.linalg.norm(points, axis=-1)
    z = xi * d1 + points[..., 2]
    d2 = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2 + points[..., 2] ** 2)
    return points[..., :2] / (alpha * d2 + (1 - alpha) * z)[..., None]


def _double_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, sign in zip(SHAPES, (1, -1, 1, -1), strict=True):
        alpha = float(rng.choice([rng.uniform(0.35, 0.45), rng.uniform(0.55, 0.65)]))
        yield _in_front(rng, shape), sign * float(rng.uniform(0.1, 0.3)), alpha
    beside = rng.uniform(0.5, 1.0, (4, 3)) * rng.choice([-1, 1], (4, 3)) * [1, 1, 0]
    behind = beside - np.array([0.0, 0.0, 0.4]) * np.arange(4)[:, None] / 3  # from beside the camera to behind it
    yield behind * rng.uniform(0.5, 2), float(rng.uniform(0.1, 0.2)), float(rng.uniform(0.55, 0.65))


DOUBLE_SPHERE = Exercise(
    name="10.double_sphere",
    reference=double_sphere,
    cases=_double_cases,
    as_given=double_sphere_as_given,
    hints=(
        "Write down both distances for the point (0, 3, 4) with ξ = 1, by hand. Which line computes something else?",
        "D₁ is 5 there. The point is then moved by ξ D₁ along z, to (0, 3, 9), and D₂ is the distance of *that* point, "
        "√90. Which numbers of the moved point does the line for `d2` use?",
        "`d2 = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2 + ___)`",
    ),
    praise="Onto one sphere, then onto another, ξ further on. With ξ = 0 it is the unified sphere in its α form.",
)


@DOUBLE_SPHERE.right
def sphere_after_sphere(points, xi, alpha):
    first = points / np.linalg.norm(points, axis=-1, keepdims=True) + np.array([0, 0, xi])
    second = first / np.linalg.norm(first, axis=-1, keepdims=True) + np.array([0, 0, alpha / (1 - alpha)])
    return second[..., :2] / second[..., 2:] / (1 - alpha)


def _double(points, alpha, d2, z):
    return points[..., :2] / (alpha * d2 + (1 - alpha) * z)[..., None]


def _parts(points, xi):
    """D₁, the distance from the axis, the moved depth, and D₂."""
    d1, beside = np.linalg.norm(points, axis=-1), np.hypot(points[..., 0], points[..., 1])
    z = xi * d1 + points[..., 2]
    return d1, beside, z, np.hypot(beside, z)


@DOUBLE_SPHERE.wrong("D₂ is right now. The other term still has Z: it needs the moved depth ξ D₁ + Z.")
def unmoved_depth(points, xi, alpha):
    return _double(points, alpha, _parts(points, xi)[3], points[..., 2])


@DOUBLE_SPHERE.wrong("α and 1 − α have changed places: α goes with the distance D₂.")
def alpha_swapped(points, xi, alpha):
    return double_sphere(points, xi, 1 - alpha)


@DOUBLE_SPHERE.wrong("You moved the point by ξ. It moves by ξ D₁: the spheres grow with the distance of the point.")
def moved_by_xi(points, xi, alpha):
    _, beside, _, _ = _parts(points, xi)
    z = xi + points[..., 2]
    return _double(points, alpha, np.hypot(beside, z), z)


@DOUBLE_SPHERE.wrong("Your D₂ leaves out the third coordinate: it is the distance from the axis only.")
def without_the_third_coordinate(points, xi, alpha):
    _, beside, z, _ = _parts(points, xi)
    return _double(points, alpha, beside, z)


# 7: onto the cube ----------------------------------------------------------------------------------------------------


def cube_point(direction: Array) -> Array:
    """Where directions (..., 3) meet the cube of half side 1 around the camera: each over its largest size."""
    return direction / np.max(np.abs(direction), axis=-1, keepdims=True)


def _cube_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    signs = np.array([[1, 1, 1], [-1, 1, 1], [1, -1, -1], [-1, -1, 1], [1, 1, -1], [-1, -1, -1]])
    for shape in SHAPES:
        yield (rng.uniform(0.2, 1, (*shape, 3)) * rng.choice([-1, 1], (*shape, 3)) * rng.uniform(1.5, 4),)
    yield (rng.uniform(0.2, 0.9, (6, 3)) * signs,)
    yield (np.concatenate([np.eye(3), -np.eye(3)]) * rng.uniform(2, 3, (6, 1)),)
    yield (np.array([[1, -1, 0.5], [-1, -1, -1], [0.2, 1, 1], [-1, 0, 1]]) * rng.uniform(2, 3),)  # edges and corners


CUBE = Exercise(
    name="10.cube_point",
    reference=cube_point,
    cases=_cube_cases,
    shown=((np.array([1.0, -2.0, 0.5]),),),
    hints=(
        "A direction may be made longer or shorter, and points the same way. How long must it be to end on a face?",
        "The ray leaves through the face of its coordinate of largest *size*. Divide by that size, which is positive, "
        "so that every sign stays: `np.abs`, `np.max(…, axis=-1, keepdims=True)`.",
        "`return direction / np.max(___, axis=-1, keepdims=True)`",
    ),
    praise="Six pinholes of 90°, chosen by one comparison. Which coordinate is ±1 says which face it is.",
)


@CUBE.right
def by_the_maximum_norm(direction):
    return direction / np.linalg.norm(direction, np.inf, axis=-1, keepdims=True)


@CUBE.right
def through_the_nearest_of_three_slabs(direction):
    with np.errstate(divide="ignore"):
        along = np.min(1 / np.abs(direction), axis=-1, keepdims=True)
    return along * direction


@CUBE.wrong("You divide by the largest coordinate. Divide by the largest *size*: coordinates may be negative.")
def largest_with_its_sign(direction):
    return direction / np.max(direction, axis=-1, keepdims=True)


@CUBE.wrong("This point is on the *sphere*. On the cube, the largest coordinate is ±1.")
def on_the_sphere(direction):
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


@CUBE.wrong("This is right on the front and the back. On the other faces another coordinate is the largest.")
def front_and_back_only(direction):
    return direction / np.abs(direction[..., 2:])


@CUBE.wrong("You took the largest coordinate of *all* directions. Each has its own: over the last axis only.")
def one_size_for_all(direction):
    return direction / np.max(np.abs(direction))


@CUBE.wrong("You clip each coordinate by itself, which bends the ray. Divide all three by the same number.")
def clipped(direction):
    return np.clip(direction, -1, 1)


# 2: torn at the seam -------------------------------------------------------------------------------------------------


def parallax(cameras: int, radius: float, distance: float, width: int) -> float:
    """Pixels between the two images of a point straight out at a seam, in a panorama stitched for infinity."""
    alpha = np.pi / cameras
    angle = np.arctan2(radius * np.sin(alpha), distance - radius * np.cos(alpha))
    return 2 * angle * width / (2 * np.pi)


def _parallax_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for cameras in (2, 4, 6, 9):
        radius = float(rng.uniform(0.2, 0.4))
        yield cameras, radius, float(rng.uniform(0.6, 3)), int(rng.integers(1000, 8000))


PARALLAX = Exercise(
    name="10.parallax",
    reference=parallax,
    cases=_parallax_cases,
    shown=((6, 0.15, 2.0, 4000),),
    hints=(
        "Draw it from above, the seam straight up, and mark where the two cameras beside the seam stand. At what angle "
        "to the seam does each see the thing?",
        "With α = π/n each camera stands r sin α beside the seam and r cos α along it; the thing is at Z along it. "
        "`np.arctan2(beside, along)` is the angle of one camera. There are two of them, and a panorama has width/(2π) "
        "pixels per radian.",
        "`angle = np.arctan2(radius * np.sin(alpha), ___)`",
    ),
    praise="No stitching makes this zero at every distance: the cameras have no common viewpoint.",
)


@PARALLAX.right
def with_complex_numbers(cameras, radius, distance, width):
    return np.angle(distance - radius * np.exp(-1j * np.pi / cameras)) * width / np.pi


def _pixels(angle, width):
    return 2 * angle * width / (2 * np.pi)


@PARALLAX.wrong("You measure Z from the cameras' line. It counts from the ring's *centre*: subtract r cos α.")
def from_the_cameras_line(cameras, radius, distance, width):
    return _pixels(np.arctan2(radius * np.sin(np.pi / cameras), distance), width)


@PARALLAX.wrong("b/Z holds far away. Near the ring it is too small: use the exact angle.")
def baseline_over_distance(cameras, radius, distance, width):
    return 2 * radius * np.sin(np.pi / cameras) / distance * width / (2 * np.pi)


@PARALLAX.wrong("You take the *tangent* for the angle. Near the ring they differ: use np.arctan2.")
def tangent_for_angle(cameras, radius, distance, width):
    alpha = np.pi / cameras
    return _pixels(radius * np.sin(alpha) / (distance - radius * np.cos(alpha)), width)


@PARALLAX.wrong("Your α is the angle between two cameras. A seam lies halfway: α = π/n, half of it.")
def whole_angle_between_cameras(cameras, radius, distance, width):
    alpha = 2 * np.pi / cameras
    return _pixels(np.arctan2(radius * np.sin(alpha), distance - radius * np.cos(alpha)), width)


@PARALLAX.wrong("This is the angle in radians. Multiply by the pixels per radian, width/(2π).")
def still_in_radians(cameras, radius, distance, width):
    return parallax(cameras, radius, distance, width) * 2 * np.pi / width


# 5: two cameras of one valley -----------------------------------------------------------------------------------------


def apart(theta: Array, f: float, xi: float, other: float) -> Array:
    """By how many pixels (...) rays `theta` from the axis land farther out with ξ = `other` and the same f/(1 + ξ)."""
    other_f = f * (1 + other) / (1 + xi)
    return _radius(theta, other_f, other) - _radius(theta, f, xi)


def _radius(theta, f, xi):
    return f * np.sin(theta) / (np.cos(theta) + xi)


def _apart_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        xi, other = rng.permutation([rng.uniform(0.3, 0.8), rng.uniform(1.0, 1.8)]).tolist()
        yield rng.uniform(0.3, 1.3, shape), float(rng.uniform(200, 700)), xi, other
    yield np.append(0.0, rng.uniform(0.2, 1.2, 3)), float(rng.uniform(200, 700)), 0.0, float(rng.uniform(0.6, 1.4))
    # From behind; here the second radius is the larger one, in the case before the smaller.
    yield rng.uniform(1.6, 1.9, 4), float(rng.uniform(200, 700)), 1.0, float(rng.uniform(0.6, 0.9))


APART = Exercise(
    name="10.apart",
    reference=apart,
    cases=_apart_cases,
    shown=((np.array([0.2, 0.7, 1.2]), 500.0, 1.0, 0.5),),
    hints=(
        "What is f/(1 + ξ) of the first camera? Which f gives the second camera the same quotient?",
        "With D = 1 a ray at the angle θ has X = sin θ and Z = cos θ. Put both cameras' numbers into "
        "f sin θ / (cos θ + ξ), and subtract the first radius from the second.",
        "`other_f = f * ___ / (1 + xi)`",
    ),
    praise="Nothing in the middle, much at the rim: only rays from there tell the two cameras apart.",
)


@APART.right
def over_one_denominator(theta, f, xi, other):
    c = np.cos(theta)
    return f * np.sin(theta) / (1 + xi) * (other - xi) * (c - 1) / ((c + other) * (c + xi))


@APART.wrong("You left f as it was. Then the middle changes: the second f must keep f/(1 + ξ).")
def with_the_same_f(theta, f, xi, other):
    return _radius(theta, f, other) - _radius(theta, f, xi)


@APART.wrong("You kept f/ξ. The middle of the picture depends on f/(1 + ξ).")
def kept_f_over_xi(theta, f, xi, other):
    return _radius(theta, f * other / max(xi, 1e-3), other) - _radius(theta, f, xi)


@APART.wrong("This is the size alone. Where the second radius is smaller, the answer is negative.")
def size_alone(theta, f, xi, other):
    return np.abs(apart(theta, f, xi, other))


@APART.wrong("The quotient is upside down: the greater ξ needs the greater f, by (1 + other)/(1 + ξ).")
def quotient_upside_down(theta, f, xi, other):
    return _radius(theta, f * (1 + xi) / (1 + other), other) - _radius(theta, f, xi)


# 6: one polynomial for any mirror -------------------------------------------------------------------------------------


def polynomial(rho: Array, theta: Array) -> Array:
    """a0, a2, a3, a4 (4,): ρ / tan θ is nearest to a0 + a2 ρ² + a3 ρ³ + a4 ρ⁴ at the measured rays (n,)."""
    return _fitted(rho, rho / np.tan(theta))


def _fitted(rho, wanted, *powers):
    return np.linalg.lstsq(rho[:, None] ** np.array(powers or (0, 2, 3, 4)), wanted, rcond=None)[0]


def _mirror_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Measured rays of four mirrors, to a thousandth of a radian; none lies on any polynomial."""
    for xi in (1.0, 0.9, 0.7, 1.1):
        theta = np.sort(rng.uniform(0.2, rng.uniform(1.7, 1.9), rng.integers(14, 40)))
        rho = np.sin(theta) / (np.cos(theta) + xi) * rng.uniform(0.9, 1.1)
        yield rho, theta + rng.normal(0, 1e-3, theta.shape)


POLYNOMIAL = Exercise(
    name="10.polynomial",
    reference=polynomial,
    cases=_mirror_cases,
    any_numbers=False,
    tolerance=5e-5,  # an iteration, such as scipy's curve_fit, is good enough
    shown=((np.tan(np.array([0.2, 0.4, 0.6, 0.8, 1.0]) / 2), np.array([0.2, 0.4, 0.6, 0.8, 1.0])),),
    hints=(
        "The ray (ρ, z) has tan θ = ρ/z. What is z, if ρ and θ are known?",
        "Each measured ray is one equation, a0 + a2 ρ² + a3 ρ³ + a4 ρ⁴ = ρ / tan θ. Put 1, ρ², ρ³ and ρ⁴ side by side, "
        "as the columns of a matrix (n, 4), and let `np.linalg.lstsq` find the four numbers.",
        "`return np.linalg.lstsq(powers, ___, rcond=None)[0]`",
    ),
    praise="No shape of a mirror was needed, only rays. That is why this model fits nearly everything.",
)


@POLYNOMIAL.right
def by_the_normal_equations(rho, theta):
    A = np.stack([np.ones_like(rho), rho**2, rho**3, rho**4], axis=-1)
    return np.linalg.inv(A.T @ A) @ A.T @ (rho * np.cos(theta) / np.sin(theta))


@POLYNOMIAL.right
def by_a_general_solver(rho, theta):
    from scipy.optimize import least_squares

    def off(a):
        return a[0] + a[1] * rho**2 + a[2] * rho**3 + a[3] * rho**4 - rho / np.tan(theta)

    return least_squares(off, np.zeros(4), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


@POLYNOMIAL.wrong("You fit ρ tan θ. From tan θ = ρ/z follows z = ρ / tan θ.")
def times_the_tangent(rho, theta):
    return _fitted(rho, rho * np.tan(theta))


@POLYNOMIAL.wrong("Your polynomial has ρ as well, with a1. In this model a1 is 0: the mirror's top has no kink.")
def with_a1(rho, theta):
    return _fitted(rho, rho / np.tan(theta), 0, 1, 2, 3, 4)[[0, 2, 3, 4]]


@POLYNOMIAL.wrong("Your powers are 0, 1, 2, 3. The model leaves out ρ itself and goes up to ρ⁴.")
def powers_from_0_to_3(rho, theta):
    return _fitted(rho, rho / np.tan(theta), 0, 1, 2, 3)


@POLYNOMIAL.wrong("Your powers are even only. The model has ρ³ too.")
def even_powers_only(rho, theta):
    a0, a2, a4 = _fitted(rho, rho / np.tan(theta), 0, 2, 4)
    return np.array([a0, a2, 0.0, a4])


@POLYNOMIAL.wrong("You fit a polynomial of θ. The model is a polynomial of ρ: it goes from the pixel to the ray.")
def of_the_angle(rho, theta):
    return _fitted(theta, rho / np.tan(theta))


EXERCISES = (PROJECT, PARALLAX, UNPROJECT, DOUBLE_SPHERE, APART, POLYNOMIAL, CUBE)
