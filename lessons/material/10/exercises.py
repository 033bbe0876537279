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


@PROJECT.right
def onto_the_unit_sphere_first(points, xi):
    x, y, z = np.moveaxis(points / np.linalg.norm(points, axis=-1, keepdims=True), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((z > -xi)[..., None], np.stack([x / (z + xi), y / (z + xi)], axis=-1), np.nan)


@PROJECT.right
def in_the_alpha_form(points, xi):
    alpha = xi / (1 + xi)
    depth = alpha * np.linalg.norm(points, axis=-1, keepdims=True) + (1 - alpha) * points[..., 2:]
    return (1 - alpha) * points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.right
def point_by_point(points, xi):
    xy = np.full((points.size // 3, 2), np.nan)
    for i, (X, Y, Z) in enumerate(points.reshape(-1, 3)):
        depth = Z + xi * (X**2 + Y**2 + Z**2) ** 0.5
        if depth > 0:
            xy[i] = X / depth, Y / depth
    return xy.reshape(*points.shape[:-1], 2)


@PROJECT.wrong("This is the pinhole, ξ = 0: nothing beside the camera or behind it has an image.")
def pinhole(points, xi):
    return points[..., :2] / np.where(points[..., 2:] > 0, points[..., 2:], np.nan)


@PROJECT.wrong(
    "For points that have an image this is right. Where Z + ξ D ≤ 0 there is none, and the formula gives the mirror "
    "image of a point behind: say NaN there."
)
def mirror_images_kept(points, xi):
    return points[..., :2] / (points[..., 2:] + xi * np.linalg.norm(points, axis=-1, keepdims=True))


@PROJECT.wrong(
    "Where Z + ξ D is *exactly* 0 you divide by it, and the image is infinitely far away. The task asks for NaN there "
    "too: only what is above 0 has an image."
)
def infinity_at_zero(points, xi):
    depth = points[..., 2:] + xi * np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :2] / np.where(depth < 0, np.nan, depth)


@PROJECT.wrong("You drop everything behind the camera, as a pinhole must. The sphere shows what has Z + ξ D > 0.")
def dropped_behind_the_camera(points, xi):
    return np.where(points[..., 2:] > 0, project(points, xi), np.nan)


@PROJECT.wrong(
    "You asked for |Z + ξ D| > 0, or divided by its size: points behind get an image that way. Ask its sign."
)
def divided_by_the_size(points, xi):
    depth = points[..., 2:] + xi * np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :2] / np.abs(depth)


@PROJECT.wrong("For points that have an image this is right. The others have *none*: the answer is NaN, not (0, 0).")
def zero_for_no_image(points, xi):
    return np.nan_to_num(project(points, xi))


@PROJECT.wrong(
    "Yours is (1 + ξ) times too large: it agrees with a pinhole in the middle. Leave that factor to the focal length."
)
def scaled_to_the_pinhole(points, xi):
    return project(points, xi) * (1 + xi)


@PROJECT.wrong("You add ξ instead of ξ D: that is right only for points on the unit sphere, one metre away.")
def xi_without_d(points, xi):
    depth = points[..., 2:] + xi
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("You add ξ D². The distance is the *square root* of X² + Y² + Z².")
def d_squared(points, xi):
    depth = points[..., 2:] + xi * np.sum(points**2, axis=-1, keepdims=True)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("Your D is the distance from the *axis*, without Z. It is the distance from the viewpoint: all three.")
def distance_from_the_axis(points, xi):
    depth = points[..., 2:] + xi * np.linalg.norm(points[..., :2], axis=-1, keepdims=True)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("ξ stands before Z in yours. It belongs to D, the distance: with ξ = 0 the pinhole's Z must remain.")
def xi_before_z(points, xi):
    depth = xi * points[..., 2:] + np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("You subtract ξ D. The eye is ξ *behind* the centre, so everything is farther from it: Z + ξ D.")
def eye_in_front(points, xi):
    depth = points[..., 2:] - xi * np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("Your D is one number for *all* points together. Each has its own: take the norm over the last axis.")
def one_distance_for_all(points, xi):
    depth = points[..., 2:] + xi * np.linalg.norm(points)
    return points[..., :2] / np.where(depth > 0, depth, np.nan)


@PROJECT.wrong("This is the point on the unit sphere, (X, Y)/D. The second step is missing: see it from ξ behind.")
def on_the_sphere_only(points, xi):
    return points[..., :2] / np.linalg.norm(points, axis=-1, keepdims=True)


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


@UNPROJECT.right
def with_the_line_as_a_vector(xy, xi):
    along = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)
    a = np.sum(along**2, axis=-1, keepdims=True)
    eta = xi / a + np.sqrt((xi / a) ** 2 - (xi**2 - 1) / a)
    return eta * along - np.array([0, 0, xi])


@UNPROJECT.wrong(
    "This is the pinhole's ray, (x, y, 1) made a unit vector. That is where the line from ξ behind goes, not where it "
    "meets the sphere."
)
def ray_of_a_pinhole(xy, xi):
    return unproject(xy, 0.0)


@UNPROJECT.wrong("You forgot to subtract ξ: your vector starts at the point ξ behind, not at the centre of the sphere.")
def seen_from_the_eye(xy, xi):
    return unproject(xy, xi) + np.array([0, 0, xi])


@UNPROJECT.wrong("This is the other place where the line meets the sphere, on the eye's side: take the larger root.")
def smaller_root(xy, xi):
    r2 = np.sum(xy**2, axis=-1)
    eta = (xi - np.sqrt(1 + (1 - xi**2) * r2)) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


@UNPROJECT.wrong(
    "You scaled (x, y, 1 − ξ) to unit length. That moves it along a line through the *centre*; the line of sight goes "
    "through the point ξ behind it."
)
def scaled_about_the_centre(xy, xi):
    point = np.concatenate([xy, np.full_like(xy[..., :1], 1 - xi)], axis=-1)
    return point / np.linalg.norm(point, axis=-1, keepdims=True)


@UNPROJECT.wrong(
    "You went one unit along the line from the point ξ behind. The *sphere* has radius 1 about the centre: solve for "
    "the η that ends on it."
)
def one_unit_along_the_line(xy, xi):
    return unproject(xy, 0.0) - np.array([0, 0, xi])


def _with_root_of(xy, xi, inside):
    r2 = np.sum(xy**2, axis=-1)
    eta = (xi + np.sqrt(inside(r2))) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


@UNPROJECT.wrong("A sign under the root has slipped: multiplying out gives 1 + (1 − ξ²) r², yours has 1 + (1 + ξ²) r².")
def sign_under_the_root(xy, xi):
    return _with_root_of(xy, xi, lambda r2: 1 + (1 + xi**2) * r2)


@UNPROJECT.wrong("Under the root ξ must be squared: 1 + (1 − *ξ²*) r². It comes from ξ² = 1 on the sphere's equation.")
def xi_not_squared(xy, xi):
    return _with_root_of(xy, xi, lambda r2: 1 + abs(1 - xi) * r2)


@UNPROJECT.wrong("The root is missing its r²: you have 1 + (1 − ξ²) under it, the same for every pixel.")
def root_without_r(xy, xi):
    return _with_root_of(xy, xi, lambda r2: np.abs(2 - xi**2) + 0 * r2)


@UNPROJECT.wrong("You divide nowhere by 1 + r². It is the factor of η² in the quadratic equation.")
def not_divided(xy, xi):
    r2 = np.sum(xy**2, axis=-1)
    eta = xi + np.sqrt(1 + (1 - xi**2) * r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


@UNPROJECT.wrong("Your r² is r, the distance itself: a root was taken too early.")
def r_for_its_square(xy, xi):
    r = np.linalg.norm(xy, axis=-1)
    eta = (xi + np.sqrt(np.abs(1 + (1 - xi**2) * r))) / (1 + r)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], eta - xi], axis=-1)


@UNPROJECT.wrong(
    "You found Z from the length, sqrt(1 − X² − Y²), which is never negative. Rays that look backwards have Z < 0: use "
    "Z = η − ξ."
)
def never_backwards(xy, xi):
    rays = unproject(xy, xi)
    return np.concatenate([rays[..., :2], np.abs(rays[..., 2:])], axis=-1)


@UNPROJECT.wrong("Your r² is the sum over *all* image points. Each has its own: sum over the last axis only.")
def one_radius_for_all(xy, xi):
    r2 = np.sum(xy**2)
    eta = (xi + np.sqrt(np.maximum(1 + (1 - xi**2) * r2, 0))) / (1 + r2)
    return np.stack([eta * xy[..., 0], eta * xy[..., 1], 0 * xy[..., 0] + eta - xi], axis=-1)


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


@DOUBLE_SPHERE.right
def by_moving_the_points(points, xi, alpha):
    moved = points + [0, 0, xi] * np.linalg.norm(points, axis=-1, keepdims=True)
    depth = alpha * np.sqrt(np.einsum("...i,...i", moved, moved)) + (1 - alpha) * moved[..., 2]
    return np.stack([points[..., 0] / depth, points[..., 1] / depth], axis=-1)


@DOUBLE_SPHERE.right
def one_point_after_the_other(points, xi, alpha):
    xy = []
    for X, Y, Z in points.reshape(-1, 3):
        moved = xi * (X * X + Y * Y + Z * Z) ** 0.5 + Z
        denominator = alpha * (X * X + Y * Y + moved * moved) ** 0.5 + (1 - alpha) * moved
        xy.append((X / denominator, Y / denominator))
    return np.reshape(xy, (*points.shape[:-1], 2))


def _double(points, alpha, d2, z):
    return points[..., :2] / (alpha * d2 + (1 - alpha) * z)[..., None]


def _parts(points, xi):
    """D₁, the distance from the axis, the moved depth, and D₂."""
    d1, beside = np.linalg.norm(points, axis=-1), np.hypot(points[..., 0], points[..., 1])
    z = xi * d1 + points[..., 2]
    return d1, beside, z, np.hypot(beside, z)


@DOUBLE_SPHERE.wrong("D₂ is right now; the other term still has Z where the moved depth ξ D₁ + Z belongs.")
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


@DOUBLE_SPHERE.wrong("You moved the point the other way: the depth is ξ D₁ *plus* Z.")
def moved_the_other_way(points, xi, alpha):
    return double_sphere(points, -xi, alpha)


@DOUBLE_SPHERE.wrong("Your D₂ is a sum of squares: its root is missing.")
def root_missing(points, xi, alpha):
    _, _, z, d2 = _parts(points, xi)
    return _double(points, alpha, d2**2, z)


@DOUBLE_SPHERE.wrong(
    "You added ξ D₁ to the distance. A point moved by ξ D₁ along z is that much farther only if it is on the axis."
)
def distances_added(points, xi, alpha):
    d1, _, z, _ = _parts(points, xi)
    return _double(points, alpha, d1 + xi * d1, z)


@DOUBLE_SPHERE.wrong("D₂ is right now, but the factor 1 − α has gone from the other term.")
def without_one_minus_alpha(points, xi, alpha):
    _, _, z, d2 = _parts(points, xi)
    return points[..., :2] / (alpha * d2 + z)[..., None]


@DOUBLE_SPHERE.wrong("This is Mei's form, with α/(1 − α) before D₂. Here the focal length is that of the α form.")
def in_mei_s_form(points, xi, alpha):
    return double_sphere(points, xi, alpha) * (1 - alpha)


@DOUBLE_SPHERE.wrong("Z is counted twice in your D₂: `z` holds it already.")
def z_counted_twice(points, xi, alpha):
    _, beside, z, _ = _parts(points, xi)
    return _double(points, alpha, np.hypot(beside, z + points[..., 2]), z)


@DOUBLE_SPHERE.wrong("Now D₁ and Z stand everywhere, and ξ does nothing: that is the unified sphere, with one sphere.")
def one_sphere_only(points, xi, alpha):
    return double_sphere(points, 0.0, alpha)


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


@CUBE.right
def with_the_place_of_the_largest(direction):
    place = np.argmax(np.abs(direction), axis=-1)[..., None]
    return direction / np.abs(np.take_along_axis(direction, place, axis=-1))


@CUBE.right
def one_direction_after_the_other(direction):
    points = [one / max(abs(one)) for one in direction.reshape(-1, 3)]
    return np.reshape(points, direction.shape)


@CUBE.wrong(
    "You divide by the largest coordinate, not by the largest in *size*: a direction to the back or the left comes out "
    "in the wrong place."
)
def largest_with_its_sign(direction):
    return direction / np.max(direction, axis=-1, keepdims=True)


@CUBE.wrong("The sign is lost: you divide by the largest coordinate with its sign, and that makes −1 into +1.")
def divided_by_a_signed_number(direction):
    place = np.argmax(np.abs(direction), axis=-1)[..., None]
    return direction / np.take_along_axis(direction, place, axis=-1)


@CUBE.wrong("Everything has become positive: the size is for the divisor only, not for the direction.")
def sizes_only(direction):
    return np.abs(cube_point(direction))


@CUBE.wrong("This point is on the *sphere*. On the cube, the largest coordinate is ±1.")
def on_the_sphere(direction):
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


@CUBE.wrong("Here |x| + |y| + |z| is 1: that is an octahedron. On the cube the *largest* of the three is 1.")
def on_an_octahedron(direction):
    return direction / np.sum(np.abs(direction), axis=-1, keepdims=True)


@CUBE.wrong("This is right on the front and the back. To the side, up and down, another coordinate is the largest.")
def front_and_back_only(direction):
    return direction / np.abs(direction[..., 2:])


@CUBE.wrong("You took the largest coordinate of *all* directions. Each has its own: over the last axis only.")
def one_size_for_all(direction):
    return direction / np.max(np.abs(direction))


@CUBE.wrong("Clipping bends the ray: each coordinate is cut by itself. All three must shrink by the same factor.")
def clipped(direction):
    return np.clip(direction, -1, 1)


@CUBE.wrong(
    "These are corners of the cube: only the signs are left. The two smaller coordinates tell the place on a face."
)
def corners(direction):
    return np.sign(direction)


@CUBE.wrong("This is the middle of the right face. The other two coordinates tell the place on it: do not drop them.")
def middle_of_the_face(direction):
    return np.where(np.abs(cube_point(direction)) == 1, np.sign(direction), 0.0)


@CUBE.wrong("You divide by the *smallest* size: that point lies beyond the cube, where the ray meets its last plane.")
def smallest(direction):
    return direction / np.min(np.abs(direction), axis=-1, keepdims=True)


@CUBE.wrong("Your cube has side 1. Its faces are at ±1, so that its side is 2.")
def half_as_large(direction):
    return cube_point(direction) / 2


@CUBE.wrong("You multiply by the largest size, which carries the point away. Dividing brings it onto the cube.")
def multiplied(direction):
    return direction * np.max(np.abs(direction), axis=-1, keepdims=True)


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
def as_the_angle_between_two_rays(cameras, radius, distance, width):
    alpha = np.pi / cameras
    thing = np.array([0.0, distance])
    left, right = (thing - radius * np.array([side * np.sin(alpha), np.cos(alpha)]) for side in (-1, 1))
    angle = np.arctan2(left[0] * right[1] - left[1] * right[0], left @ right)
    return angle * width / (2 * np.pi)


@PARALLAX.right
def with_complex_numbers(cameras, radius, distance, width):
    return np.angle(distance - radius * np.exp(-1j * np.pi / cameras)) * width / np.pi


@PARALLAX.right
def in_degrees_and_back(cameras, radius, distance, width):
    import math

    alpha = math.radians(180 / cameras)
    psi = math.degrees(math.atan(radius * math.sin(alpha) / (distance - radius * math.cos(alpha))))
    return 2 * psi * width / 360


def _pixels(angle, width):
    return 2 * angle * width / (2 * np.pi)


@PARALLAX.wrong("This is how far *one* camera's image is from the seam. The other's is as far beyond it.")
def one_camera(cameras, radius, distance, width):
    return parallax(cameras, radius, distance, width) / 2


@PARALLAX.wrong(
    "You measure the distance from the cameras' line; Z counts from the ring's *centre*, so that the cameras are "
    "r cos α nearer."
)
def from_the_cameras_line(cameras, radius, distance, width):
    return _pixels(np.arctan2(radius * np.sin(np.pi / cameras), distance), width)


@PARALLAX.wrong("You moved the cameras to the other side of the centre: they are r cos α *nearer* to the thing.")
def behind_the_centre(cameras, radius, distance, width):
    alpha = np.pi / cameras
    return _pixels(np.arctan2(radius * np.sin(alpha), distance + radius * np.cos(alpha)), width)


@PARALLAX.wrong("You took the cameras to be r nearer, as if they stood on the seam. Along it they are at r cos α.")
def a_whole_radius_nearer(cameras, radius, distance, width):
    return _pixels(np.arctan2(radius * np.sin(np.pi / cameras), distance - radius), width)


@PARALLAX.wrong("b/Z is what remains far away. Near the ring it is too small: use the exact angle.")
def baseline_over_distance(cameras, radius, distance, width):
    return 2 * radius * np.sin(np.pi / cameras) / distance * width / (2 * np.pi)


@PARALLAX.wrong("You take the ring's diameter for the baseline. Neighbours are 2 r sin(π/n) apart.")
def diameter_for_baseline(cameras, radius, distance, width):
    return 2 * radius / distance * width / (2 * np.pi)


@PARALLAX.wrong("You take the *tangent* for the angle. Near the ring they differ: np.arctan2 turns one into the other.")
def tangent_for_angle(cameras, radius, distance, width):
    alpha = np.pi / cameras
    return _pixels(radius * np.sin(alpha) / (distance - radius * np.cos(alpha)), width)


@PARALLAX.wrong("Your α is the angle between two cameras. A seam lies halfway: α = π/n, half of it.")
def whole_angle_between_cameras(cameras, radius, distance, width):
    alpha = 2 * np.pi / cameras
    return _pixels(np.arctan2(radius * np.sin(alpha), distance - radius * np.cos(alpha)), width)


@PARALLAX.wrong("α is in degrees in yours, 180/n. np.sin and np.cos take radians: π/n.")
def alpha_in_degrees(cameras, radius, distance, width):
    alpha = 180 / cameras
    return _pixels(np.arctan2(radius * np.sin(alpha), distance - radius * np.cos(alpha)), width)


@PARALLAX.wrong("sin and cos have changed places: beside the seam a camera stands r *sin* α, along it r *cos* α.")
def sine_and_cosine_swapped(cameras, radius, distance, width):
    alpha = np.pi / cameras
    return _pixels(np.arctan2(radius * np.cos(alpha), distance - radius * np.sin(alpha)), width)


@PARALLAX.wrong("This is the angle in radians. Multiply by the pixels per radian, width/(2π).")
def still_in_radians(cameras, radius, distance, width):
    return parallax(cameras, radius, distance, width) * 2 * np.pi / width


@PARALLAX.wrong("A panorama has width/(2π) pixels per radian, not width: it goes all the way round.")
def width_per_radian(cameras, radius, distance, width):
    return parallax(cameras, radius, distance, width) * 2 * np.pi


@PARALLAX.wrong("Your angle is in radians, but you took width/360 pixels: that is per *degree*.")
def radians_as_degrees(cameras, radius, distance, width):
    return parallax(cameras, radius, distance, width) * 2 * np.pi / 360


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
def from_points_in_space(theta, f, xi, other):
    X, Z = np.sin(theta), np.cos(theta)
    D = np.hypot(X, Z)
    middle = f / (1 + xi)
    return middle * (1 + other) * X / (Z + other * D) - middle * (1 + xi) * X / (Z + xi * D)


@APART.right
def with_two_loops(theta, f, xi, other):
    import math

    found = [
        f * (1 + other) / (1 + xi) * math.sin(one) / (math.cos(one) + other) - f * math.sin(one) / (math.cos(one) + xi)
        for one in np.ravel(theta)
    ]
    return np.reshape(found, np.shape(theta))


@APART.right
def over_one_denominator(theta, f, xi, other):
    c = np.cos(theta)
    return f * np.sin(theta) / (1 + xi) * (other - xi) * (c - 1) / ((c + other) * (c + xi))


@APART.wrong("You left f as it was. Then the middle changes: the second f must keep f/(1 + ξ).")
def with_the_same_f(theta, f, xi, other):
    return _radius(theta, f, other) - _radius(theta, f, xi)


@APART.wrong("The quotient is upside down: the greater ξ needs the greater f, by (1 + other)/(1 + ξ).")
def quotient_upside_down(theta, f, xi, other):
    return _radius(theta, f * (1 + xi) / (1 + other), other) - _radius(theta, f, xi)


@APART.wrong("You kept f/ξ. What the middle shows is f/(1 + ξ).")
def kept_f_over_xi(theta, f, xi, other):
    return _radius(theta, f * other / max(xi, 1e-3), other) - _radius(theta, f, xi)


@APART.wrong("The sign is turned round: the task asks for the second radius minus the first.")
def first_minus_second(theta, f, xi, other):
    return -apart(theta, f, xi, other)


@APART.wrong("This is the size alone. Where the second radius is the smaller one, the answer is negative.")
def size_alone(theta, f, xi, other):
    return np.abs(apart(theta, f, xi, other))


@APART.wrong("You used tan θ, the pinhole's radius, in place of sin θ / (cos θ + ξ).")
def as_of_pinholes(theta, f, xi, other):
    return (f * (1 + other) / (1 + xi) - f) * np.tan(theta)


@APART.wrong("sin and cos have changed places: X = sin θ is beside the axis, Z = cos θ along it.")
def sine_and_cosine_in_each_other_s_place(theta, f, xi, other):
    return apart(np.pi / 2 - theta, f, xi, other)


@APART.wrong("θ is given in radians; you turned it into degrees or back.")
def angles_converted(theta, f, xi, other):
    return apart(np.radians(theta), f, xi, other)


@APART.wrong("This is where the second camera draws the ray. From it the first camera's radius must be subtracted.")
def second_radius_alone(theta, f, xi, other):
    return _radius(theta, f * (1 + other) / (1 + xi), other)


@APART.wrong("The second radius has the first camera's ξ below the line: both numbers change together.")
def first_xi_below_the_line(theta, f, xi, other):
    return _radius(theta, f * (1 + other) / (1 + xi), xi) - _radius(theta, f, xi)


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
def by_the_pseudoinverse(rho, theta):
    A = np.vander(rho, 5, increasing=True)[:, [0, 2, 3, 4]]
    return (np.linalg.pinv(A) @ (rho / np.tan(theta))).tolist()


@POLYNOMIAL.right
def by_a_general_solver(rho, theta):
    from scipy.optimize import least_squares

    def off(a):
        return a[0] + a[1] * rho**2 + a[2] * rho**3 + a[3] * rho**4 - rho / np.tan(theta)

    return least_squares(off, np.zeros(4), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


@POLYNOMIAL.wrong("You fit ρ tan θ. From tan θ = ρ/z follows z = ρ / tan θ.")
def times_the_tangent(rho, theta):
    return _fitted(rho, rho * np.tan(theta))


@POLYNOMIAL.wrong("You fit tan θ itself. The polynomial gives z, which is ρ / tan θ.")
def the_tangent_itself(rho, theta):
    return _fitted(rho, np.tan(theta))


@POLYNOMIAL.wrong("You fit θ. The polynomial gives how far forward the ray goes, z = ρ / tan θ.")
def the_angle_itself(rho, theta):
    return _fitted(rho, theta)


@POLYNOMIAL.wrong("You fit the cosine: that is z of a ray of length 1. This ray is (ρ, z), so that z = ρ / tan θ.")
def the_cosine(rho, theta):
    return _fitted(rho, np.cos(theta))


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


@POLYNOMIAL.wrong("The order is a0 a2 a3 a4, from the lowest power to the highest.")
def highest_power_first(rho, theta):
    return polynomial(rho, theta)[::-1]


@POLYNOMIAL.wrong("You use the first four rays alone. All of them count: take the least squares of all n equations.")
def through_the_first_four_rays(rho, theta):
    return np.linalg.solve(rho[:4, None] ** np.array([0, 2, 3, 4]), (rho / np.tan(theta))[:4])


@POLYNOMIAL.wrong("You find each number as though the others were zero. They share the work: solve for all at once.")
def one_number_after_the_other(rho, theta):
    A = rho[:, None] ** np.array([0, 2, 3, 4])
    return A.T @ (rho / np.tan(theta)) / np.sum(A**2, axis=0)


@POLYNOMIAL.wrong("The sign is turned round: z is positive for rays in front, where θ is below 90°.")
def backward_z(rho, theta):
    return -polynomial(rho, theta)


@POLYNOMIAL.wrong("You fit a polynomial of θ. It is one of ρ: the way goes from the pixel to the ray.")
def of_the_angle(rho, theta):
    return _fitted(theta, rho / np.tan(theta))


EXERCISES = (PROJECT, PARALLAX, UNPROJECT, DOUBLE_SPHERE, APART, POLYNOMIAL, CUBE)
