"""Lesson 01, the pinhole camera: its exercises, in one file because they are loaded by their lesson's number.

Projection and its inverse, the best hole, vanishing points, and what lies behind.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise


def _pixels(rng: np.random.Generator) -> tuple[float, float, float]:
    """f, cx and cy; the two coordinates of the principal point are never alike."""
    return float(rng.uniform(300, 900)), float(rng.uniform(250, 400)), float(rng.uniform(180, 240))


def _shifted_pixels(rng: np.random.Generator) -> tuple[float, float, float]:
    """The same of a picture cut out to the right of and below the axis: its principal point lies beyond its corner."""
    f, cx, cy = _pixels(rng)
    return f, -cx, -cy


def _points(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """In front of the camera, beside the axis and above or below it."""
    sides = rng.choice([-1.0, 1.0], (*shape, 2)) * rng.uniform(0.3, 2, (*shape, 2))
    return np.concatenate([sides, rng.uniform(1, 6, (*shape, 1))], axis=-1)


def _matrix(f, cx, cy):
    return np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]])


def _opencv_s(points, f, cx, cy):
    import cv2

    pixels = cv2.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), _matrix(f, cx, cy), None)[0]
    return pixels.reshape(*points.shape[:-1], 2)


# 1: the projection ---------------------------------------------------------------------------------------------------


def project(points: Array, f: float, cx: float, cy: float) -> Array:
    """u = f X/Z + cx, v = f Y/Z + cy for points (..., 3) in front of the camera."""
    return f * points[..., :2] / points[..., 2:] + (cx, cy)


def _project_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape), *_pixels(rng))
    yield (_points(rng, (4,)), *_shifted_pixels(rng))


PROJECT = Exercise(
    name="01.project",
    reference=project,
    cases=_project_cases,
    shown=((np.array([0.5, 0.25, 2.0]), 640.0, 319.5, 239.5),),
    hints=(
        "The two similar triangles have their tips in the hole. Which of a point's three numbers is the length of its "
        "triangle, and so divides the other two?",
        "`points[..., :2]` holds X and Y of every point, and `points[..., 2:]` its Z, with the last axis kept so that "
        "one Z divides both. Multiply by f, and then count from the centre of the first pixel.",
        "`return f * points[..., :2] / ___ + ___`",
    ),
    praise="These are the pixels that camviz and OpenCV give, for one point and for any array of them.",
)


@PROJECT.right
def as_opencv_projects(points, f, cx, cy):
    return _opencv_s(points, f, cx, cy)


@PROJECT.right
def point_by_point(points, f, cx, cy):
    pixels = [[f * X / Z + cx, f * Y / Z + cy] for X, Y, Z in points.reshape(-1, 3)]
    return np.reshape(pixels, (*points.shape[:-1], 2))


@PROJECT.wrong("This counts from the principal point. Pixels count from the centre of the first one: add (cx, cy).")
def from_the_principal_point(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:]


@PROJECT.wrong("This is the image on the back wall, turned by 180°. The picture is turned upright again.")
def as_on_the_wall(points, f, cx, cy):
    return -f * points[..., :2] / points[..., 2:] + (cx, cy)


@PROJECT.wrong("This is f Z/X: the fraction stands on its head. What is farther away must become *smaller*.")
def upside_down_fraction(points, f, cx, cy):
    return f * points[..., 2:] / points[..., :2] + (cx, cy)


@PROJECT.wrong("You divide by the distance to the hole. The wall is flat: divide by the depth Z alone.")
def divided_by_the_distance(points, f, cx, cy):
    return f * points[..., :2] / np.linalg.norm(points, axis=-1, keepdims=True) + (cx, cy)


@PROJECT.wrong("You add the principal point before the division. It is a place in the image: add it last.")
def shifted_too_early(points, f, cx, cy):
    return f * (points[..., :2] + (cx, cy)) / points[..., 2:]


@PROJECT.wrong("These are the first two *homogeneous* numbers of K X. Divide them by the third, Z.")
def undivided(points, f, cx, cy):
    return (points @ _matrix(f, cx, cy).T)[..., :2]


# 2: the ray of a pixel -----------------------------------------------------------------------------------------------


def ray(uv: Array, f: float, cx: float, cy: float) -> Array:
    """The unit directions (..., 3) of all points that share the pixels (..., 2)."""
    xy = (uv - np.array([cx, cy])) / f
    direction = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def _ray_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f, cx, cy = _pixels(rng)
        yield (project(_points(rng, shape), f, cx, cy), f, cx, cy)
    f, cx, cy = _shifted_pixels(rng)
    yield (np.vstack([project(_points(rng, (3,)), f, cx, cy), [cx, cy]]), f, cx, cy)  # the last along the axis


def _at_depth_one(uv, f, cx, cy):
    return np.concatenate([(uv - (cx, cy)) / f, np.ones_like(uv[..., :1])], axis=-1)


def _of_length_one(direction):
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


RAY = Exercise(
    name="01.ray",
    reference=ray,
    cases=_ray_cases,
    hints=(
        "Undo the projection from its end. What was added last, and what multiplied before that? At which depth do the "
        "x and y that you get lie?",
        "Without the principal point and divided by f, the pixel is (x, y, 1), a point on the ray. "
        "`np.concatenate([…, …], axis=-1)` puts numbers side by side, and `np.linalg.norm(…, axis=-1, keepdims=True)` "
        "is the length of each vector.",
        "`xy = (uv - ___) / ___` and, in the end, `return direction / ___`",
    ),
    praise="A pixel gives a direction and no more: every positive multiple of it lands there.",
)


@RAY.right
def by_the_inverse_matrix(uv, f, cx, cy):
    homogeneous = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)
    return _of_length_one(homogeneous @ np.linalg.inv(_matrix(f, cx, cy)).T)


@RAY.right
def from_opencv_s_normalised_points(uv, f, cx, cy):
    import cv2

    xy = cv2.undistortPoints(uv.reshape(-1, 1, 2), _matrix(f, cx, cy), None).reshape(uv.shape)
    return _of_length_one(np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1))


@RAY.wrong("This is a point on the ray, at depth 1. Divide it by its length to have the *unit* direction.")
def point_at_depth_one(uv, f, cx, cy):
    return _at_depth_one(uv, f, cx, cy)


@RAY.wrong("The direction (u − cx, v − cy, f) is right. Divide it by its length.")
def point_at_depth_f(uv, f, cx, cy):
    return f * _at_depth_one(uv, f, cx, cy)


@RAY.wrong("Pixels count from the centre of the first one. Subtract (cx, cy) first.")
def principal_point_forgotten(uv, f, cx, cy):
    return ray(uv, f, 0.0, 0.0)


@RAY.wrong("You never divide by f: pixels stand beside a depth of 1.")
def pixels_beside_a_one(uv, f, cx, cy):
    return ray(uv, 1.0, cx, cy)


# 3: the best hole ----------------------------------------------------------------------------------------------------


def best_hole(focal_mm: float, wavelength_nm: float) -> float:
    """The hole as wide as its own Airy disc, d = 2.44 λ f / d, in millimetres."""
    return np.sqrt(2.44 * wavelength_nm * 1e-6 * focal_mm)


def _hole_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield (float(rng.uniform(15, 150)), float(rng.uniform(420, 680)))


BEST_HOLE = Exercise(
    name="01.best_hole",
    reference=best_hole,
    cases=_hole_cases,
    tolerance=1e-6,  # of a millimetre: who looks for the least blur by trying finds the hole to that
    shown=((50.0, 550.0),),
    hints=(
        "Set the two widths equal, d = 2.44 λ f / d, and solve for d. In which unit is each of the three lengths?",
        "Multiply both sides by d: then d² is a product, and `np.sqrt` gives d. A nanometre is 10⁻⁶ mm, so the "
        "wavelength needs a factor of its own.",
        "`return np.sqrt(2.44 * wavelength_nm * ___ * ___)`",
    ),
    praise="For 50 mm and green light that is 0.26 mm, or 1.56 √(f λ). With Young's constant, 2, it would be 0.33 mm.",
)


@BEST_HOLE.right
def in_metres(focal_mm, wavelength_nm):
    return 1000 * (2.44 * wavelength_nm * 1e-9 * focal_mm * 1e-3) ** 0.5


@BEST_HOLE.right
def by_looking_for_the_least_blur(focal_mm, wavelength_nm):
    from scipy.optimize import minimize_scalar

    blur = lambda d: np.hypot(d, 2.44 * wavelength_nm * 1e-6 * focal_mm / d)  # noqa: E731
    return minimize_scalar(blur, bounds=(0.01, 2), method="bounded", options={"xatol": 1e-9}).x


@BEST_HOLE.wrong("This is d². Take its square root.")
def not_yet_the_root(focal_mm, wavelength_nm):
    return 2.44 * wavelength_nm * 1e-6 * focal_mm


@BEST_HOLE.wrong("This is 1000 times too large. A nanometre is 10⁻⁶ mm.")
def nanometres_taken_for_millimetres(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * focal_mm)


@BEST_HOLE.wrong("1.22 λ f / d is the *radius* of the Airy disc. Compare the diameter d with 2.44 λ f / d.")
def radius_of_the_airy_disc(focal_mm, wavelength_nm):
    return np.sqrt(1.22 * wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong("This is Young's constant, 2, for another notion of sharpness. Here the hole equals its Airy disc.")
def young_s_hole(focal_mm, wavelength_nm):
    return 2 * np.sqrt(wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong("You divide by f. In a deeper box the light spreads on for longer, so the best hole is *wider*.")
def divided_by_the_depth(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * 1e-6 / focal_mm)


# 4: vanishing points -------------------------------------------------------------------------------------------------


def vanishing_point(direction: Array, f: float, cx: float, cy: float) -> Array:
    """Where lines along directions (..., 3) meet in the image: the image of the direction itself."""
    return f * direction[..., :2] / direction[..., 2:] + (cx, cy)


def _direction_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape) * rng.choice([-1.0, 1.0], (*shape, 1)) / 4, *_pixels(rng))
    yield (-_points(rng, ()), *_pixels(rng))
    yield (_points(rng, (3,)) * [[1], [-1], [1]], *_shifted_pixels(rng))


VANISHING = Exercise(
    name="01.vanishing_point",
    reference=vanishing_point,
    cases=_direction_cases,
    hints=(
        "Walk along one of the lines, A + s D, and let s grow without end. What is left of A in the pixel you look at?",
        "f (A_x + s D_x) / (A_z + s D_z) tends to f D_x / D_z, and the same with y: a direction is projected as if it "
        "were a point. Keep the sign that D_z has.",
        "`return f * direction[..., :2] / ___ + (cx, cy)`",
    ),
    praise="The starting point dropped out: all parallel lines share this pixel, whichever way along them you walk.",
)


@VANISHING.right
def by_k_times_d(direction, f, cx, cy):
    u, v, w = np.moveaxis(direction @ _matrix(f, cx, cy).T, -1, 0)
    return np.stack([u / w, v / w], axis=-1)


@VANISHING.right
def turned_to_the_front_first(direction, f, cx, cy):
    return _opencv_s(direction * np.sign(direction[..., 2:]), f, cx, cy)


@VANISHING.wrong("You count from the principal point. Pixels count from the centre of the first one: add (cx, cy).")
def meeting_point_without_c(direction, f, cx, cy):
    return f * direction[..., :2] / direction[..., 2:]


@VANISHING.wrong("A direction and its opposite meet in the same pixel. Keep the sign of D_z.")
def depth_without_its_sign(direction, f, cx, cy):
    return f * direction[..., :2] / np.abs(direction[..., 2:]) + (cx, cy)


@VANISHING.wrong("With D_z < 0 follow the line the other way: it vanishes in the same pixel. There is no NaN.")
def nan_for_directions_towards_the_camera(direction, f, cx, cy):
    return in_front(direction, f, cx, cy)


@VANISHING.wrong("Where the line began still moves your pixel a little. Put s = ∞ in: drop A.")
def a_long_way_along_one_line(direction, f, cx, cy):
    return project(np.array([0.5, 1.0, 2.0]) + 1000 * direction, f, cx, cy)


@VANISHING.wrong("You multiply f by the *angle* from the axis. Use its tangent, D_x / D_z.")
def angle_for_its_tangent(direction, f, cx, cy):
    return f * np.arctan(direction[..., :2] / direction[..., 2:]) + (cx, cy)


# 5: find the bug in what is behind -----------------------------------------------------------------------------------


def in_front(points: Array, f: float, cx: float, cy: float) -> Array:
    """The same for any points (..., 3): NaN where Z ≤ 0."""
    z = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    return f * points[..., :2] / z + (cx, cy)


def in_front_as_given(points, f, cx, cy):
    return f * points[..., :2] / (points[..., 2:] + 1e-8) + (cx, cy)


def _front_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape), *_pixels(rng))
    behind, within = np.array([1, 1, -1]), np.array([1, 1, 0])
    yield (_points(rng, (4,)) * behind, *_pixels(rng))
    yield (_points(rng, ()) * behind, *_pixels(rng))
    yield (_points(rng, (3,)) * [[1, 1, 1], behind, within], *_pixels(rng))
    depths = np.array([0.4, 0.03, 1e-4, 1e-9, 1e-45, -1e-45, -1e-9, -0.2])  # near the hole, on both sides
    yield (np.column_stack([_points(rng, (8,))[:, :2], depths * rng.uniform(0.5, 1, 8)]), *_shifted_pixels(rng))


IN_FRONT = Exercise(
    name="01.in_front",
    reference=in_front,
    cases=_front_cases,
    as_given=in_front_as_given,
    hints=(
        "Put in (1, 0, 2), the point behind the camera on the same line, (−1, 0, −2), and (1, 0, 0), which lies beside "
        "the hole. Which of them has an image, and is the first one's pixel exactly that of exercise 1?",
        "`np.where(condition, this, that)` chooses point by point, and what is divided by NaN is NaN. With that, "
        "nothing has to be added to a depth.",
        "`z = np.where(points[..., 2:] ___, points[..., 2:], ___)`",
    ),
    praise="Nothing behind the camera has a pixel any more, and no depth is falsified by a guard.",
)


@IN_FRONT.right
def opencv_s_pixels_with_nan_behind(points, f, cx, cy):
    return np.where(points[..., 2:] > 0, _opencv_s(points, f, cx, cy), np.nan)


@IN_FRONT.right
def one_after_another(points, f, cx, cy):
    pixels = np.full((*points.shape[:-1], 2), np.nan)
    for index in np.ndindex(points.shape[:-1]):
        X, Y, Z = points[index]
        if Z > 0:
            pixels[index] = f * X / Z + cx, f * Y / Z + cy
    return pixels


@IN_FRONT.wrong("The `1e-8` is gone, but points behind the camera still get pixels. They have no image: NaN.")
def guard_removed(points, f, cx, cy):
    return project(points, f, cx, cy)


@IN_FRONT.wrong("With |Z| what stands behind you is painted over what you see. It has no image at all: NaN.")
def sign_of_the_depth_dropped(points, f, cx, cy):
    return project(np.concatenate([points[..., :2], np.abs(points[..., 2:])], axis=-1), f, cx, cy)


@IN_FRONT.wrong("A tiny depth puts points behind the camera far outside the picture. They have no image: NaN.")
def depth_clamped(points, f, cx, cy):
    return f * points[..., :2] / np.maximum(points[..., 2:], 1e-8) + (cx, cy)


@IN_FRONT.wrong("Points behind the camera are NaN now. Take out the `1e-8`: it falsifies every good depth.")
def guard_kept_beside_nan(points, f, cx, cy):
    return f * points[..., :2] / (np.where(points[..., 2:] > 0, points[..., 2:], np.nan) + 1e-8) + (cx, cy)


@IN_FRONT.wrong("You replaced the `1e-8` by another tiny limit. Compare Z with 0 itself.")
def tiny_limit(points, f, cx, cy):
    return np.where(points[..., 2:] > 1e-6, project(points, f, cx, cy), np.nan)


@IN_FRONT.wrong("At Z = 0, beside the hole, you still divide by zero. The answer is NaN there, too.")
def beside_the_hole_forgotten(points, f, cx, cy):
    return np.where(points[..., 2:] >= 0, project(points, f, cx, cy), np.nan)


EXERCISES = (PROJECT, RAY, BEST_HOLE, VANISHING, IN_FRONT)
