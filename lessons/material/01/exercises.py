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
def by_the_matrix(points, f, cx, cy):
    homogeneous = points @ _matrix(f, cx, cy).T
    return homogeneous[..., :2] / homogeneous[..., 2:]


@PROJECT.right
def coordinate_by_coordinate(points, f, cx, cy):
    X, Y, Z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([cx + f / Z * X, cy + f / Z * Y], axis=-1)


@PROJECT.right
def point_by_point(points, f, cx, cy):
    pixels = [[f * X / Z + cx, f * Y / Z + cy] for X, Y, Z in points.reshape(-1, 3)]
    return np.reshape(pixels, (*points.shape[:-1], 2))


@PROJECT.wrong("This counts from the principal point. Pixels count from the centre of the first one: add (cx, cy).")
def from_the_principal_point(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:]


@PROJECT.wrong(
    "This is the image on the back wall, turned by 180°. Pixels count in the picture that is turned upright again."
)
def as_on_the_wall(points, f, cx, cy):
    return -f * points[..., :2] / points[..., 2:] + (cx, cy)


@PROJECT.wrong("This is f Z/X: the fraction stands on its head. What is farther away must become *smaller*.")
def upside_down_fraction(points, f, cx, cy):
    return f * points[..., 2:] / points[..., :2] + (cx, cy)


@PROJECT.wrong(
    "You divide by the distance to the hole. The wall is flat, so similar triangles compare depths: Z alone."
)
def divided_by_the_distance(points, f, cx, cy):
    return f * points[..., :2] / np.linalg.norm(points, axis=-1, keepdims=True) + (cx, cy)


@PROJECT.wrong("The principal point is added before the division. It is a place in the image, in pixels: add it last.")
def shifted_too_early(points, f, cx, cy):
    return f * (points[..., :2] + (cx, cy)) / points[..., 2:]


@PROJECT.wrong("The principal point is subtracted. That is the way back, from a pixel to its ray; here it is added.")
def principal_point_subtracted(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:] - (cx, cy)


@PROJECT.wrong("cx and cy have changed places: cx goes with u, which counts columns, and cy with v, which counts rows.")
def cx_and_cy_swapped(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:] + (cy, cx)


@PROJECT.wrong("You divide by f. A deeper box makes a larger picture: f multiplies.")
def divided_by_f(points, f, cx, cy):
    return points[..., :2] / (f * points[..., 2:]) + (cx, cy)


@PROJECT.wrong(
    "These are u Z and v Z, the first two *homogeneous* numbers of K X. The pixel is what you have after dividing them "
    "by the third, Z."
)
def undivided(points, f, cx, cy):
    return (points @ _matrix(f, cx, cy).T)[..., :2]


@PROJECT.wrong(
    "This is the homogeneous vector (u Z, v Z, Z). Divide by its last number and keep the first two: a pixel is (u, v)."
)
def all_three_homogeneous_numbers(points, f, cx, cy):
    return points @ _matrix(f, cx, cy).T


@PROJECT.wrong(
    "You multiply X and Y by f and never divide by Z. Without the division, near and far things are equally large."
)
def without_perspective(points, f, cx, cy):
    return f * points[..., :2] + (cx, cy)


@PROJECT.wrong(
    "For one point this is right. For several, `points[..., 2]` has lost its last axis, and one Z no longer meets its "
    "own X and Y: keep the axis with `2:`."
)
def last_axis_lost(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2] + (cx, cy)


@PROJECT.wrong("All points are divided by one depth, the mean. Each point has its own: divide by the Z of that point.")
def one_depth_for_all(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2].mean() + (cx, cy)


@PROJECT.wrong("The pixels are rounded. A point may well lie between two pixels: keep the fraction.")
def rounded(points, f, cx, cy):
    return np.round(f * points[..., :2] / points[..., 2:] + (cx, cy))


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
def with_pixels_for_its_unit(uv, f, cx, cy):
    u, v = uv[..., 0] - cx, uv[..., 1] - cy
    return np.stack([u, v, np.full_like(u, f)], axis=-1) / np.sqrt(u**2 + v**2 + f**2)[..., None]


@RAY.right
def from_opencv_s_normalised_points(uv, f, cx, cy):
    import cv2

    xy = cv2.undistortPoints(uv.reshape(-1, 1, 2), _matrix(f, cx, cy), None).reshape(uv.shape)
    return _of_length_one(np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1))


@RAY.wrong("This is a point on the ray, at depth 1. Divide it by its length to have the *unit* direction.")
def point_at_depth_one(uv, f, cx, cy):
    return _at_depth_one(uv, f, cx, cy)


@RAY.wrong(
    "This is the right direction, (u − cx, v − cy, f), but it is hundreds of pixels long. Divide it by its length."
)
def point_at_depth_f(uv, f, cx, cy):
    return f * _at_depth_one(uv, f, cx, cy)


@RAY.wrong(
    "This is the ray of the pixel counted from the principal point. Here (u, v) counts from the centre of the first "
    "pixel: subtract (cx, cy) first."
)
def principal_point_forgotten(uv, f, cx, cy):
    return ray(uv, f, 0.0, 0.0)


@RAY.wrong("You add the principal point. Projecting added it; the way back takes it off again.")
def principal_point_added(uv, f, cx, cy):
    return ray(uv, f, -cx, -cy)


@RAY.wrong("x and y have the wrong sign: a pixel to the right of the principal point looks to the right.")
def mirrored_ray(uv, f, cx, cy):
    return ray(uv, f, cx, cy) * [-1, -1, 1]


@RAY.wrong("Your ray leads out of the back of the camera. The camera looks along +Z: the third number is positive.")
def backwards(uv, f, cx, cy):
    return ray(uv, f, cx, cy) * [1, 1, -1]


@RAY.wrong("The ray is too close to the axis: divide by f once, either x and y or the whole vector, not both.")
def divided_by_f_twice(uv, f, cx, cy):
    return _of_length_one(_at_depth_one(uv, f, cx, cy) * [1 / f, 1 / f, 1])


@RAY.wrong("You never divide by f: pixels stand beside a depth of 1. The depth at which a pixel is one unit is f.")
def pixels_beside_a_one(uv, f, cx, cy):
    return ray(uv, 1.0, cx, cy)


@RAY.wrong("These are x and y alone. A direction in space has three numbers; the third is the depth, 1.")
def two_numbers(uv, f, cx, cy):
    return _at_depth_one(uv, f, cx, cy)[..., :2]


@RAY.wrong("You divide all rays by one common length. Each has its own: `axis=-1`, with `keepdims=True`.")
def one_length_for_all(uv, f, cx, cy):
    direction = _at_depth_one(uv, f, cx, cy)
    return direction / np.linalg.norm(direction)


@RAY.wrong("You divide by the *square* of the length, x² + y² + 1. Take its root first.")
def divided_by_the_squared_length(uv, f, cx, cy):
    direction = _at_depth_one(uv, f, cx, cy)
    return direction / np.sum(direction**2, axis=-1, keepdims=True)


@RAY.wrong("You divide by the sum of x, y and 1. The length of a vector is the root of the sum of its *squares*.")
def divided_by_the_sum(uv, f, cx, cy):
    direction = _at_depth_one(uv, f, cx, cy)
    return direction / np.sum(direction, axis=-1, keepdims=True)


@RAY.wrong("cx belongs to u and cy to v. In yours they have changed places, so that even the axis looks aslant.")
def ray_with_c_swapped(uv, f, cx, cy):
    return ray(uv, f, cy, cx)


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


@BEST_HOLE.right
def by_halving_towards_the_crossing(focal_mm, wavelength_nm):
    low, high = 1e-3, 10.0
    for _ in range(60):
        d = (low + high) / 2
        low, high = (d, high) if d < 2.44 * wavelength_nm * 1e-6 * focal_mm / d else (low, d)
    return d


@BEST_HOLE.wrong("This is d². Take its square root.")
def not_yet_the_root(focal_mm, wavelength_nm):
    return 2.44 * wavelength_nm * 1e-6 * focal_mm


@BEST_HOLE.wrong(
    "This is 1000 times too large. Either the wavelength still counts in nanometres, or your answer is in µm: a "
    "nanometre is 10⁻⁶ mm, and millimetres are wanted."
)
def nanometres_taken_for_millimetres(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * focal_mm)


@BEST_HOLE.wrong(
    "The wavelength is in metres here and the focal length in millimetres. In mm, one nanometre is `1e-6`."
)
def wavelength_in_metres(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * 1e-9 * focal_mm)


@BEST_HOLE.wrong("The wavelength is in micrometres here and the focal length in millimetres: bring both to mm.")
def wavelength_in_micrometres(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * 1e-3 * focal_mm)


@BEST_HOLE.wrong("1.22 λ f / d is the *radius* of the Airy disc. d is a diameter: compare it with 2.44 λ f / d.")
def radius_of_the_airy_disc(focal_mm, wavelength_nm):
    return np.sqrt(1.22 * wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong(
    "This is Rayleigh's constant, 1.9, for another notion of sharpness. Here the hole equals its Airy disc."
)
def rayleigh_s_hole(focal_mm, wavelength_nm):
    return 1.9 * np.sqrt(wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong(
    "This is Young's constant, 2, for another notion of sharpness. Here the hole is to equal its Airy disc."
)
def young_s_hole(focal_mm, wavelength_nm):
    return 2 * np.sqrt(wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong("The 2.44 stands under the root: it is d² that equals 2.44 λ f.")
def constant_outside_the_root(focal_mm, wavelength_nm):
    return 2.44 * np.sqrt(wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong("The 2.44 is missing. √(λ f) is the *radius* of one Fresnel zone; here the Airy disc's width counts.")
def without_the_constant(focal_mm, wavelength_nm):
    return np.sqrt(wavelength_nm * 1e-6 * focal_mm)


@BEST_HOLE.wrong("You divide by f. In a deeper box the light spreads on for longer, so the best hole is *wider*.")
def divided_by_the_depth(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * 1e-6 / focal_mm)


@BEST_HOLE.wrong(
    "The root covers the wavelength and not the depth. Both stand in 2.44 λ f: multiply first, then take the root."
)
def depth_outside_the_root(focal_mm, wavelength_nm):
    return np.sqrt(2.44 * wavelength_nm * 1e-6) * focal_mm


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
def as_the_image_of_a_point(direction, f, cx, cy):
    return project(direction, f, cx, cy)


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


@VANISHING.wrong(
    "A direction and its opposite belong to the same lines and meet in the same pixel: keep the sign of D_z."
)
def depth_without_its_sign(direction, f, cx, cy):
    return f * direction[..., :2] / np.abs(direction[..., 2:]) + (cx, cy)


@VANISHING.wrong("You divide by the length of the direction. Only its share along the axis, D_z, counts.")
def divided_by_the_length(direction, f, cx, cy):
    return f * direction[..., :2] / np.linalg.norm(direction, axis=-1, keepdims=True) + (cx, cy)


@VANISHING.wrong(
    "For directions that lead away from the camera this is right. A line has two ends: with D_z < 0 follow it the "
    "other way, and it vanishes in the same pixel. There is no NaN here."
)
def nan_for_directions_towards_the_camera(direction, f, cx, cy):
    return in_front(direction, f, cx, cy)


@VANISHING.wrong(
    "This is the principal point for every direction. Only lines along the optical axis vanish there; put D in."
)
def always_the_principal_point(direction, f, cx, cy):
    return np.zeros_like(direction[..., :2]) + (cx, cy)


@VANISHING.wrong(
    "You went far along a line, but not to its end: where it began still moves your pixel a little. Put s = ∞ in by "
    "dropping A."
)
def a_long_way_along_one_line(direction, f, cx, cy):
    return project(np.array([0.5, 1.0, 2.0]) + 1000 * direction, f, cx, cy)


@VANISHING.wrong("Vanishing points are wanted in pixels, with cx added to u and cy to v: yours are exchanged.")
def meeting_point_with_c_swapped(direction, f, cx, cy):
    return f * direction[..., :2] / direction[..., 2:] + (cy, cx)


@VANISHING.wrong(
    "You multiply f by the *angle* between line and axis. On a flat image a direction lands at f times the angle's "
    "tangent, and D_x / D_z is that tangent."
)
def angle_for_its_tangent(direction, f, cx, cy):
    return f * np.arctan(direction[..., :2] / direction[..., 2:]) + (cx, cy)


@VANISHING.wrong("This is K D before the division. Its third number is D_z: divide the first two by it.")
def k_times_d_undivided(direction, f, cx, cy):
    return (direction @ _matrix(f, cx, cy).T)[..., :2]


@VANISHING.wrong(
    "This point lies on the other side of the principal point. It is where the lines meet on the *wall* of the box; in "
    "the picture turned upright the sign is plus."
)
def where_they_meet_on_the_wall(direction, f, cx, cy):
    return -f * direction[..., :2] / direction[..., 2:] + (cx, cy)


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
def nan_written_afterwards(points, f, cx, cy):
    pixels = project(points, f, cx, cy)
    pixels[points[..., 2] <= 0] = np.nan
    return pixels


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


@IN_FRONT.wrong(
    "The `1e-8` is gone, but points behind the camera still get pixels, as if light went through the back wall."
)
def guard_removed(points, f, cx, cy):
    return project(points, f, cx, cy)


@IN_FRONT.wrong("With |Z| what stands behind you is painted over what you see. It has no image at all: NaN.")
def sign_of_the_depth_dropped(points, f, cx, cy):
    return project(np.concatenate([points[..., :2], np.abs(points[..., 2:])], axis=-1), f, cx, cy)


@IN_FRONT.wrong(
    "A depth cut off at a tiny number sends what is behind the camera far out of the picture, but still somewhere: a "
    "line to it is drawn right across. It has no image at all: NaN."
)
def depth_clamped(points, f, cx, cy):
    return f * points[..., :2] / np.maximum(points[..., 2:], 1e-8) + (cx, cy)


@IN_FRONT.wrong(
    "What is behind the camera is NaN now. The `1e-8` is still added to every good depth: it has nothing to guard any "
    "more, take it out."
)
def guard_kept_beside_nan(points, f, cx, cy):
    return f * points[..., :2] / (np.where(points[..., 2:] > 0, points[..., 2:], np.nan) + 1e-8) + (cx, cy)


@IN_FRONT.wrong(
    "You answer only from half a metre on. The box has no such limit: whatever is in front of the hole, however near, "
    "has an image. The condition is Z > 0."
)
def half_a_metre_wanted(points, f, cx, cy):
    return np.where(points[..., 2:] > 0.5, project(points, f, cx, cy), np.nan)


@IN_FRONT.wrong(
    "A tiny limit has replaced the `1e-8`: depths between 0 and yours have pixels, far out though they are. Compare "
    "with 0 itself; no number is too small to divide by."
)
def tiny_limit(points, f, cx, cy):
    return np.where(points[..., 2:] > 1e-6, project(points, f, cx, cy), np.nan)


@IN_FRONT.wrong(
    "Behind the camera this is right. At Z = 0, beside the hole, you still divide by zero: an infinite pixel is no "
    "pixel, the answer is NaN there, too."
)
def beside_the_hole_forgotten(points, f, cx, cy):
    return np.where(points[..., 2:] >= 0, project(points, f, cx, cy), np.nan)


@IN_FRONT.wrong(
    "For what has no image you answer (0, 0). That *is* a pixel, in the corner, and something would be drawn there. "
    "The answer is NaN."
)
def corner_for_no_image(points, f, cx, cy):
    return np.where(points[..., 2:] > 0, project(points, f, cx, cy), 0.0)


@IN_FRONT.wrong(
    "For what has no image you answer the principal point: your NaN, or zero, is put in before (cx, cy) is added. "
    "Nothing is to be drawn there, not even in the middle: NaN."
)
def principal_point_for_no_image(points, f, cx, cy):
    return np.where(points[..., 2:] > 0, f * points[..., :2] / points[..., 2:], 0.0) + (cx, cy)


@IN_FRONT.wrong("Only u is NaN behind the camera, v is still a number. Neither exists: keep the last axis with `2:`.")
def only_u_is_nan(points, f, cx, cy):
    both = project(points, f, cx, cy)
    return np.stack([in_front(points, f, cx, cy)[..., 0], both[..., 1]], axis=-1)


@IN_FRONT.wrong(
    "You leave out the points behind the camera, so that the pixels no longer belong to their points. Keep a row for "
    "each point, with NaN in it where there is no image."
)
def points_left_out(points, f, cx, cy):
    return project(points[points[..., 2] > 0], f, cx, cy)


@IN_FRONT.wrong("For what has no image you answer infinity. That says far out in some direction; NaN says nowhere.")
def infinity_for_no_image(points, f, cx, cy):
    return np.where(points[..., 2:] > 0, project(points, f, cx, cy), np.inf)


@IN_FRONT.wrong(
    "For most points this is right. Very near the hole you answer NaN: a point in front of the camera has an image "
    "however near it is. Compare Z with 0."
)
def only_from_some_depth_on(points, f, cx, cy):
    z = np.where(points[..., 2:] > 1e-12, points[..., 2:], np.nan)
    return f * points[..., :2] / z + (cx, cy)


EXERCISES = (PROJECT, RAY, BEST_HOLE, VANISHING, IN_FRONT)
