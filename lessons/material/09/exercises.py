"""Lesson 09, fisheye: the angle of a ray, the Kannala–Brandt polynomial there, back and refitted, a straight window."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise


def _all_round(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Points in front, beside and behind, none on the axis."""
    return rng.uniform(0.5, 2, (*shape, 1)) * rng.normal(size=(*shape, 3)) + np.array([1e-3, 2e-3, 0])


def _off_axis(points):
    return np.hypot(points[..., 0], points[..., 1])


def _theta(points):
    return np.arctan2(_off_axis(points), points[..., 2])


def _mirrored(points):
    """The angle as arctan has it: from −90° to 90°."""
    return np.arctan(_off_axis(points) / points[..., 2])


def _placed(points, r):
    """Image points (..., 2) at the distance r from the middle, in the direction of (x, y)."""
    return points[..., :2] * (r / _off_axis(points))[..., None]


# 1: equidistant ------------------------------------------------------------------------------------------------------


def equidistant(points: Array, f: float, cx: float, cy: float) -> Array:
    """Pixels (..., 2) of camera-frame points (..., 3) through a lens r = f θ, also of points behind the camera."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    off_axis = np.hypot(x, y)
    r = f * np.arctan2(off_axis, z)
    return np.stack([cx + r * x / off_axis, cy + r * y / off_axis], axis=-1)


def _equidistant_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_all_round(rng, shape), *rng.uniform([100, 200, 320], [400, 300, 500]).tolist())
    beside = [
        [0.3, -0.2, -1.0],
        [-0.5, 0.1, -0.4],
        [1.0, 0.0, 0.0],
        [-0.7, 0.4, 0.0],
        [0.0, -0.3, 0.2],
    ]  # 90° and behind, left of the picture and above it
    yield (np.array(beside) * rng.uniform(0.5, 2), *rng.uniform([200, 20, 30], [400, 60, 50]).tolist())


EQUIDISTANT = Exercise(
    name="09.equidistant",
    reference=equidistant,
    cases=_equidistant_cases,
    shown=((np.array([1.0, 0.0, 0.0]), 200.0, 319.5, 239.5),),
    hints=(
        "Two questions, one after the other: how far from the middle does the ray land, and in which direction? Only "
        "the angle from the z axis decides the first, only x and y decide the second.",
        "`np.arctan2(a, b)` is the angle of a ray that goes a to the side and b ahead, right all the way round to "
        "180°. To the side is √(x² + y²), `np.hypot(x, y)`. The direction is (x, y) divided by that.",
        "`r = f * np.arctan2(___, ___)`",
    ),
    praise="A ray at 90°, which no pinhole can show, has a pixel now; so have the rays from behind.",
)


@EQUIDISTANT.right
def as_opencv_does_it_in_front_and_turned_round_behind(points, f, cx, cy):
    """cv2.fisheye knows θ below 90° only: a point behind is turned to the front, where its angle is π − θ."""
    import cv2

    K, front = np.array([[f, 0, 0], [0, f, 0], [0, 0, 1]]), points * [1, 1, -1]
    ahead = np.where(points[..., 2:] > 0, points, front)
    ahead[..., 2] = np.maximum(ahead[..., 2], 1e-12)  # it divides by z
    ahead = ahead.reshape(1, -1, 3)
    uv = cv2.fisheye.projectPoints(ahead, np.zeros(3), np.zeros(3), K, np.zeros(4))[0].reshape(*points.shape[:-1], 2)
    r = np.linalg.norm(uv, axis=-1, keepdims=True)
    return np.where(points[..., 2:] > 0, uv, uv / r * (f * np.pi - r)) + (cx, cy)


@EQUIDISTANT.right
def point_by_point_as_a_list(points, f, cx, cy):
    import math

    pixels = []
    for x, y, z in points.reshape(-1, 3).tolist():
        r, around = f * math.atan2(math.sqrt(x * x + y * y), z), math.atan2(y, x)
        pixels.append([cx + r * math.cos(around), cy + r * math.sin(around)])
    return np.reshape(pixels, (*points.shape[:-1], 2)).tolist()


@EQUIDISTANT.wrong("Points behind are mirrored: arctan(r / z) ends at 90°. Use np.arctan2(r, z).")
def mirrored(points, f, cx, cy):
    return f * _placed(points, _mirrored(points)) + (cx, cy)


@EQUIDISTANT.wrong("This is r = f tan θ, the pinhole. The equidistant lens has r = f θ.")
def pinhole(points, f, cx, cy):
    return f * _placed(points, np.tan(_theta(points))) + (cx, cy)


@EQUIDISTANT.wrong("This is r = f sin θ, the orthographic lens, which folds at 90°. The equidistant lens has r = f θ.")
def orthographic(points, f, cx, cy):
    return f * _placed(points, np.sin(_theta(points))) + (cx, cy)


@EQUIDISTANT.wrong("Pixels count from the centre of the first one, so add (cx, cy).")
def without_the_principal_point(points, f, cx, cy):
    return f * _placed(points, _theta(points))


@EQUIDISTANT.wrong("You multiply x and y themselves by f θ. Only their *direction* counts: divide by √(x² + y²).")
def not_a_unit_direction(points, f, cx, cy):
    return f * points[..., :2] * _theta(points)[..., None] + (cx, cy)


@EQUIDISTANT.wrong("Each coordinate has its own angle here. The lens knows one, that of the ray from the axis.")
def an_angle_for_each_coordinate(points, f, cx, cy):
    return f * np.arctan2(points[..., :2], points[..., 2:]) + (cx, cy)


@EQUIDISTANT.wrong("This lens has an image all around. Behind the camera θ simply exceeds 90°.")
def nothing_behind(points, f, cx, cy):
    return np.where(points[..., 2:] > 0, equidistant(points, f, cx, cy), np.nan)


# 2: find the bug -----------------------------------------------------------------------------------------------------


def kannala_brandt(points: Array, k1: float, k2: float) -> Array:
    """Image points (..., 2) in focal lengths, r = θ (1 + k1 θ² + k2 θ⁴), of camera-frame points (..., 3)."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    off_axis = np.hypot(x, y)
    theta = np.arctan2(off_axis, z)
    r = theta * (1 + k1 * theta**2 + k2 * theta**4)
    return np.stack([r * x / off_axis, r * y / off_axis], axis=-1)


def kannala_brandt_as_given(points, k1, k2):
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    off_axis = np.hypot(x, y)
    theta = np.arctan(off_axis / z)
    r = theta * (1 + k1 * theta**2 + k2 * theta**4)
    return np.stack([r * x / off_axis, r * y / off_axis], axis=-1)


def _polynomial(theta, k1, k2):
    return theta * (1 + k1 * theta**2 + k2 * theta**4)


def _coefficients(rng: np.random.Generator) -> list[float]:
    return (rng.choice([-1, 1], 2) * rng.uniform([0.005, 0.0005], [0.02, 0.002])).tolist()


def _polynomial_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, signs in zip(SHAPES, ((1, 1), (1, -1), (-1, 1), (-1, -1)), strict=True):
        k1, k2 = (signs * np.abs(_coefficients(rng))).tolist()
        yield (_all_round(rng, shape), k1, k2)
    yield (np.array([[0.3, -0.2, -1.0], [-0.5, 0.1, 0.4]]), *_coefficients(rng))


KANNALA_BRANDT = Exercise(
    name="09.kannala_brandt",
    reference=kannala_brandt,
    cases=_polynomial_cases,
    as_given=kannala_brandt_as_given,
    hints=(
        "Try it point by point and compare with what you expect: a point ahead, one to the side, one behind such as "
        "(1, 0, −1). At which of them, and in which line, does it go wrong?",
        "The point (1, 0, −1) is 135° from the axis. np.arctan never gives more than 90°, and a negative z makes it "
        "negative. Another function of NumPy takes numerator and denominator apart.",
        "`theta = ___(off_axis, ___)`",
    ),
    praise="That bug is in OpenCV's own fisheye module: points behind the camera come out mirrored.",
)


@KANNALA_BRANDT.right
def by_the_arc_cosine_of_the_ray(points, k1, k2):
    theta = np.arccos(points[..., 2] / np.linalg.norm(points, axis=-1))
    return _placed(points, _polynomial(theta, k1, k2))


@KANNALA_BRANDT.right
def half_a_turn_added_where_it_is_negative(points, k1, k2):
    theta = _mirrored(points)
    return _placed(points, _polynomial(np.where(theta < 0, theta + np.pi, theta), k1, k2))


@KANNALA_BRANDT.wrong("The sign alone is not enough: a point at 135° is not at 45°.")
def absolute_value(points, k1, k2):
    return _placed(points, _polynomial(np.abs(_mirrored(points)), k1, k2))


@KANNALA_BRANDT.wrong("arctan2's arguments have changed places: this is the angle above the image plane.")
def arguments_swapped(points, k1, k2):
    return _placed(points, _polynomial(np.arctan2(points[..., 2], _off_axis(points)), k1, k2))


@KANNALA_BRANDT.wrong("This lens does see behind the camera: θ goes on beyond 90°, and so does r.")
def nan_behind(points, k1, k2):
    return np.where(points[..., 2:] > 0, kannala_brandt(points, k1, k2), np.nan)


@KANNALA_BRANDT.wrong("Two points at 100° and at 150° would share a pixel: θ must go on.")
def stopped_at_90_degrees(points, k1, k2):
    return _placed(points, _polynomial(np.minimum(_theta(points), np.pi / 2), k1, k2))


@KANNALA_BRANDT.wrong("You add half a turn to every θ. Add it only where arctan is negative.")
def half_a_turn_added_everywhere(points, k1, k2):
    return _placed(points, _polynomial(_mirrored(points) + np.pi, k1, k2))


# 3: back to the ray --------------------------------------------------------------------------------------------------


def angle(radius: Array, k1: float, k2: float) -> Array:
    """The θ in 0 … π with θ (1 + k1 θ² + k2 θ⁴) = radius ≥ 0, by Newton's method; NaN where there is none."""
    theta = np.array(radius, dtype=float)
    for _ in range(20):
        error = theta * (1 + k1 * theta**2 + k2 * theta**4) - radius
        theta = theta - error / (1 + 3 * k1 * theta**2 + 5 * k2 * theta**4)
    found = np.abs(theta * (1 + k1 * theta**2 + k2 * theta**4) - radius) < 1e-9
    return np.where(found & (theta >= 0) & (theta <= np.pi), theta, np.nan)


def _angle_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Angles below 90°, behind the camera, on the axis, radii that no ray has, and either side of π."""
    for shape in SHAPES:
        yield (rng.uniform(0.4, 1.8, shape), *rng.uniform([0.01, 0.001], [0.03, 0.003]).tolist())
    k1, k2 = rng.uniform([0.01, 0.001], [0.03, 0.003]).tolist()
    behind = _polynomial(rng.uniform([1.7, 2.4, 3.0], [2.2, 2.9, 3.1]), k1, k2)
    beyond = _polynomial(rng.uniform(3.3, 4.0, 2), k1, k2)
    yield (np.concatenate([[0.0], behind, beyond]), k1, k2)
    k1, k2 = rng.uniform([0.04, 0.003], [0.08, 0.008]).tolist()  # a strong bend
    yield (_polynomial(np.concatenate([np.pi + 3e-6 * np.array([-1, 1]), rng.uniform(0.5, 3.1, 4)]), k1, k2), k1, k2)
    yield (_polynomial(np.array([0.3, 2.9, 3.16]), k1, 0.0), k1, 0.0)
    yield (_polynomial(np.array([0.3, 2.9, 3.16]), 0.0, k2), 0.0, k2)
    yield (np.array([0.2, 3.0, np.pi, 3.15]), 0.0, 0.0)  # θ = r, and π itself is the angle of a ray


ANGLE = Exercise(
    name="09.angle",
    reference=angle,
    cases=_angle_cases,
    tolerance=1e-7,
    shown=((np.array([0.5, 1.0]), 0.02, 0.001),),
    hints=(
        "The three steps above do this for one coefficient. Improve a first guess of θ step by step, then put θ back "
        "into the polynomial and see whether the radius comes out. Which angles can a ray have at all?",
        "Begin at θ = radius. Newton's step subtracts (what θ gives − radius) / (the slope at θ); twenty or thirty "
        "steps are plenty. The slope is the derivative of θ + k1 θ³ + k2 θ⁵. In the end `np.where(condition, theta, "
        "np.nan)` keeps what lies in 0 … π.",
        "`theta = theta - error / (1 + ___ + ___)`",
    ),
    praise="It gives back the ray of every pixel that has one, and NaN where there is none.",
)


def _newton(radius, k1, k2, steps):
    theta = np.array(radius, dtype=float)
    for _ in range(steps):
        slope = 1 + 3 * k1 * theta**2 + 5 * k2 * theta**4
        theta = theta - (_polynomial(theta, k1, k2) - radius) / slope
    return theta


@ANGLE.right
def by_bisection(radius, k1, k2):
    low, high = np.zeros_like(radius, dtype=float), np.full_like(radius, np.pi, dtype=float)
    for _ in range(45):
        middle = (low + high) / 2
        short = _polynomial(middle, k1, k2) < radius
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.where(radius <= _polynomial(np.pi, k1, k2), low, np.nan)


@ANGLE.right
def by_the_roots_of_the_quintic(radius, k1, k2):
    def one(r):
        roots = np.roots([k2, 0, k1, 0, 1, -r])
        real = [root.real for root in roots if abs(root.imag) < 1e-9 and -1e-12 <= root.real <= np.pi]
        return real[0] if real else np.nan

    return np.reshape([one(r) for r in np.ravel(radius)], np.shape(radius))


@ANGLE.wrong("One division is only the first step. Put your θ back into the polynomial and look at what is left.")
def one_division(radius, k1, k2):
    return radius / (1 + k1 * radius**2 + k2 * radius**4)


@ANGLE.wrong("This bends once more, the model forwards. The radius is given, the angle is wanted.")
def forwards(radius, k1, k2):
    return _polynomial(radius, k1, k2)


@ANGLE.wrong("Some of your angles are above π, straight behind. No ray has them: NaN.")
def beyond_half_a_turn(radius, k1, k2):
    return _newton(radius, k1, k2, 20)


@ANGLE.wrong("Radii that no ray has are answered by π. A clamped angle looks like a real one: NaN.")
def clamped_at_half_a_turn(radius, k1, k2):
    return np.minimum(_newton(radius, k1, k2, 20), np.pi)


@ANGLE.wrong("You stop at 90°. A fisheye sees up to π, straight behind.")
def nothing_beyond_90_degrees(radius, k1, k2):
    theta = angle(radius, k1, k2)
    return np.where(theta <= np.pi / 2, theta, np.nan)


@ANGLE.wrong("You ask whether the *radius* is above π. Ask it of θ.")
def radius_asked_instead_of_angle(radius, k1, k2):
    return np.where(radius <= np.pi, _newton(radius, k1, k2, 20), np.nan)


# 4: the same lens in another model ------------------------------------------------------------------------------------


def coefficients(theta: Array, r: Array) -> Array:
    """k1 k2 k3 k4 (4,), so that θ (1 + k1 θ² + … + k4 θ⁸) is nearest to the radii r (n,), in focal lengths."""
    return _fitted(_powers(theta), r - theta)


def _powers(theta, *exponents):
    return theta[:, None] ** np.array(exponents or (3, 5, 7, 9))


def _fitted(columns, wanted):
    return np.linalg.lstsq(columns, wanted, rcond=None)[0]


def _lens_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Measured radii of four kinds of lens, to a thousandth of a focal length; none lies on any polynomial."""
    for rule in (
        lambda theta: 2 * np.tan(theta / 2),
        lambda theta: 2 * np.sin(theta / 2),
        np.sin,
        lambda theta: 1.05 * theta,
    ):
        theta = np.sort(rng.uniform(0.1, rng.uniform(1.4, 1.8), rng.integers(14, 40)))
        yield (theta, rule(theta) + rng.normal(0, 1e-3, theta.shape))


COEFFICIENTS = Exercise(
    name="09.coefficients",
    reference=coefficients,
    cases=_lens_cases,
    any_numbers=False,
    tolerance=5e-5,  # an iteration, such as scipy's curve_fit, is good enough
    shown=((np.array([0.2, 0.5, 0.8, 1.1, 1.4]), 2 * np.tan(np.array([0.2, 0.5, 0.8, 1.1, 1.4]) / 2)),),
    hints=(
        "Multiply the bracket out. What does each k stand beside? And which part of r needs no k at all?",
        "Each sample is one equation, k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹ = r − θ. Put the four powers of θ side by side, as "
        "the columns of a matrix (n, 4), and let `np.linalg.lstsq` find the four numbers.",
        "`return np.linalg.lstsq(powers, ___, rcond=None)[0]`",
    ),
    praise="So a lens of any rule can be handed to a program that knows Kannala–Brandt only.",
)


@COEFFICIENTS.right
def by_the_normal_equations(theta, r):
    A = np.stack([theta**3, theta**5, theta**7, theta**9], axis=-1)
    return np.linalg.inv(A.T @ A) @ A.T @ (r - theta)


@COEFFICIENTS.right
def by_a_general_solver(theta, r):
    from scipy.optimize import least_squares

    def off(k):
        return theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8) - r

    return least_squares(off, np.zeros(4), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


@COEFFICIENTS.wrong("θ itself is still in r. The k make up for r − θ, what the equidistant rule leaves over.")
def with_theta_left_in(theta, r):
    return _fitted(_powers(theta), r)


@COEFFICIENTS.wrong("The bracket is multiplied by θ: k1 stands beside θ³, not θ², and so on.")
def even_powers(theta, r):
    return _fitted(_powers(theta, 2, 4, 6, 8), r - theta)


@COEFFICIENTS.wrong("Dividing by θ weighs the middle of the picture more than its rim. Make the error of r small.")
def divided_by_theta(theta, r):
    return _fitted(_powers(theta, 2, 4, 6, 8), r / theta - 1)


@COEFFICIENTS.wrong("You use the first four samples alone. Take the least squares of all n equations.")
def through_the_first_four(theta, r):
    return np.linalg.solve(_powers(theta[:4]), (r - theta)[:4])


@COEFFICIENTS.wrong("You fit the factor of θ as well. In the model it is 1.")
def with_a_focal_length_of_its_own(theta, r):
    return _fitted(_powers(theta, 1, 3, 5, 7, 9), r)[1:]


# 5: the window -------------------------------------------------------------------------------------------------------


def window_map(width: int, height: int, f_window: float, yaw: float, f: float, cx: float, cy: float) -> Array:
    """For each pixel (height, width, 2) of a perspective window turned right by `yaw`, its pixel in an r = f θ lens."""
    return _seen(_turned(_rays(width, height, f_window), yaw), f, cx, cy)


def _seen(rays, f, cx, cy):
    """Pixels (..., 2) of rays (..., 3) through the equidistant fisheye; the axis itself is seen at (cx, cy)."""
    on_axis = _off_axis(rays)[..., None] == 0
    return np.where(on_axis, (cx, cy), equidistant(np.where(on_axis, (1, 0, 0), rays), f, cx, cy))


def _rays(width, height, f_window, middle=0.5):
    """The rays (height, width, 3) of a window whose middle is at (width/2 − middle, height/2 − middle)."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    x, y = (u - width / 2 + middle) / f_window, (v - height / 2 + middle) / f_window
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def _turned(rays, yaw):
    x, y, z = np.moveaxis(rays, -1, 0)
    return np.stack([np.cos(yaw) * x + np.sin(yaw) * z, y, np.cos(yaw) * z - np.sin(yaw) * x], axis=-1)


def _window_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """A window to one side, one that looks backwards over the other shoulder, and two that look straight ahead."""
    side = rng.choice([-1, 1])
    for width, height, yaw in ((8, 6, side * rng.uniform(0.4, 1.2)), (4, 10, -side * rng.uniform(1.9, 2.5))):
        f_window, f, cx, cy = rng.uniform([3, 90, 150, 210], [9, 200, 200, 260]).tolist()
        yield (width, height, f_window, float(yaw), f, cx, cy)
    for width, height in ((5, 5), (7, 3)):  # its middle pixel looks along the axis
        yield (width, height, float(rng.uniform(3, 5)), 0.0, *rng.uniform([150, 3, 5], [200, 8, 9]).tolist())


WINDOW_MAP = Exercise(
    name="09.window_map",
    reference=window_map,
    cases=_window_cases,
    tolerance=1e-5,  # of a pixel: float32, which `cv2.remap` wants, is good enough
    hints=(
        "For each pixel of the *window* ask which ray it shows, and then where the fisheye has that ray. Between the "
        "two the ray is turned, because the window looks to the side.",
        "There are three steps. First pixel → ray, with the middle of the window at ((width − 1)/2, (height − 1)/2). "
        "Then turn the ray about the y axis: straight ahead becomes (sin ψ, 0, cos ψ) for the yaw ψ. Last comes the "
        "fisheye of exercise 1.",
        "`X, Z = np.cos(yaw) * x + ___, np.cos(yaw) - ___`",
    ),
    praise="This is a virtual camera that pans without moving: one fisheye picture holds all its pictures.",
)


@WINDOW_MAP.right
def with_k_inverse_and_rodrigues(width, height, f_window, yaw, f, cx, cy):
    import cv2

    K = np.array([[f_window, 0, (width - 1) / 2], [0, f_window, (height - 1) / 2], [0, 0, 1]])
    v, u = np.mgrid[:height, :width]
    R, _ = cv2.Rodrigues(np.array([0.0, yaw, 0.0]))
    return _seen(np.stack([u, v, 1 + 0 * u], axis=-1) @ np.linalg.inv(K).T @ R.T, f, cx, cy)


@WINDOW_MAP.right
def pixel_by_pixel(width, height, f_window, yaw, f, cx, cy):
    uv = np.zeros((height, width, 2), np.float32)
    for v in range(height):
        for u in range(width):
            x, y = (u - (width - 1) / 2) / f_window, (v - (height - 1) / 2) / f_window
            ray = np.array([np.cos(yaw) * x + np.sin(yaw), y, np.cos(yaw) - np.sin(yaw) * x])
            uv[v, u] = _seen(ray, f, cx, cy)
    return uv


@WINDOW_MAP.wrong("A ray along the axis itself is 0/0 in yours. The fisheye has it at (cx, cy).")
def nothing_on_the_axis(width, height, f_window, yaw, f, cx, cy):
    return equidistant(_turned(_rays(width, height, f_window), yaw), f, cx, cy)


@WINDOW_MAP.wrong("Your window turns left for a positive yaw: straight ahead must go to (sin ψ, 0, cos ψ).")
def turned_to_the_left(width, height, f_window, yaw, f, cx, cy):
    return window_map(width, height, f_window, -yaw, f, cx, cy)


@WINDOW_MAP.wrong("Half a pixel off: the middle of pixels 0 … width − 1 is (width − 1)/2, not width/2.")
def half_a_pixel_off(width, height, f_window, yaw, f, cx, cy):
    return _seen(_turned(_rays(width, height, f_window, middle=0), yaw), f, cx, cy)


@WINDOW_MAP.wrong("One window looks backwards, and its rays are mirrored: arctan2, not arctan.")
def mirrored_behind(width, height, f_window, yaw, f, cx, cy):
    rays = _turned(_rays(width, height, f_window), yaw)
    behind = rays[..., 2:] < 0
    return np.where(behind, f * _placed(rays, _mirrored(rays)) + (cx, cy), _seen(rays, f, cx, cy))


@WINDOW_MAP.wrong("You drew the fisheye in perspective too, r = f tan θ. It is equidistant, r = f θ.")
def perspective_on_both_sides(width, height, f_window, yaw, f, cx, cy):
    rays = _turned(_rays(width, height, f_window), yaw)
    return f * rays[..., :2] / rays[..., 2:] + (cx, cy)


@WINDOW_MAP.wrong("The focal lengths have changed places: f_window belongs to the window's pixels.")
def focal_lengths_swapped(width, height, f_window, yaw, f, cx, cy):
    return window_map(width, height, f, yaw, f_window, cx, cy)


EXERCISES = (EQUIDISTANT, KANNALA_BRANDT, ANGLE, COEFFICIENTS, WINDOW_MAP)
