"""Lesson 09, fisheye: the angle of a ray, a projection of it, the Kannala–Brandt polynomial, and a straight window."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise


def equidistant(points: Array, f: float, cx: float, cy: float) -> Array:
    """Pixels (..., 2) of camera-frame points (..., 3) through a lens r = f θ, also of points behind the camera."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    off_axis = np.hypot(x, y)
    r = f * np.arctan2(off_axis, z)
    return np.stack([cx + r * x / off_axis, cy + r * y / off_axis], axis=-1)


def kannala_brandt(points: Array, k1: float, k2: float) -> Array:
    """Image points (..., 2) in focal lengths, r = θ (1 + k1 θ² + k2 θ⁴), of camera-frame points (..., 3)."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    off_axis = np.hypot(x, y)
    theta = np.arctan2(off_axis, z)
    r = theta * (1 + k1 * theta**2 + k2 * theta**4)
    return np.stack([r * x / off_axis, r * y / off_axis], axis=-1)


def angle(radius: Array, k1: float, k2: float) -> Array:
    """The θ in 0 … π with θ (1 + k1 θ² + k2 θ⁴) = radius ≥ 0, by Newton's method; NaN where there is none."""
    theta = np.array(radius, dtype=float)
    for _ in range(30):
        error = theta * (1 + k1 * theta**2 + k2 * theta**4) - radius
        theta = theta - error / (1 + 3 * k1 * theta**2 + 5 * k2 * theta**4)
    found = abs(theta * (1 + k1 * theta**2 + k2 * theta**4) - radius) < 1e-9
    return np.where(found & (theta >= 0) & (theta <= np.pi), theta, np.nan)


def window_map(width: int, height: int, f_window: float, yaw: float, f: float, cx: float, cy: float) -> Array:
    """For each pixel (height, width, 2) of a perspective window turned right by `yaw`, its pixel in an r = f θ lens."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    x, y = (u - (width - 1) / 2) / f_window, (v - (height - 1) / 2) / f_window
    rays = np.stack([np.cos(yaw) * x + np.sin(yaw), y, np.cos(yaw) - np.sin(yaw) * x], axis=-1)
    return equidistant(rays, f, cx, cy)


# Cases ---------------------------------------------------------------------------------------------------------------


def _all_round(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Points in front, beside and behind, none on the axis."""
    return rng.uniform(0.5, 2, (*shape, 1)) * rng.normal(size=(*shape, 3)) + np.array([1e-3, 2e-3, 0])


def _equidistant_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_all_round(rng, shape), *rng.uniform([100, 200, 200], [400, 600, 500]).tolist())
    yield (np.array([[0.3, -0.2, -1.0], [-0.5, 0.1, -0.4]]), *rng.uniform([100, 200, 200], [400, 600, 500]).tolist())


def _polynomial_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_all_round(rng, shape), *rng.uniform([-0.02, -0.002], [0.02, 0.002]).tolist())
    yield (np.array([[0.3, -0.2, -1.0], [-0.5, 0.1, 0.4]]), *rng.uniform([-0.02, -0.002], [0.02, 0.002]).tolist())


def _angle_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0.1, 1.8, shape), *rng.uniform([0.0, 0.0], [0.03, 0.003]).tolist())
    yield (rng.uniform([0.2, 1.0, 4.5], [0.9, 1.8, 6.0]), *rng.uniform([0.0, 0.0], [0.03, 0.001]).tolist())


def _window_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for width, height in ((8, 6), (4, 10)):
        yield (width, height, *rng.uniform([3, -2.5, 90, 150, 120], [9, 2.5, 200, 330, 260]).tolist())


# Known mistakes ------------------------------------------------------------------------------------------------------


def _placed(points: Array, r: Array) -> Array:
    off_axis = np.hypot(points[..., 0], points[..., 1])
    return np.stack([r * points[..., 0] / off_axis, r * points[..., 1] / off_axis], axis=-1)


def _theta(points: Array) -> Array:
    return np.arctan2(np.hypot(points[..., 0], points[..., 1]), points[..., 2])


def _mirrored(points: Array) -> Array:
    return np.arctan(np.hypot(points[..., 0], points[..., 1]) / points[..., 2])


def _polynomial(theta: Array, k1: float, k2: float) -> Array:
    return theta * (1 + k1 * theta**2 + k2 * theta**4)


def _window_with(turn: float, offset: float, *arguments: float) -> Array:
    """The map with its yaw multiplied by `turn` and its middle moved by `offset` pixels."""
    width, height, f_window, yaw, f, cx, cy = arguments
    u, v = np.meshgrid(np.arange(int(width)), np.arange(int(height)))
    x, y = (u - (width - 1) / 2 - offset) / f_window, (v - (height - 1) / 2 - offset) / f_window
    c, s = np.cos(turn * yaw), np.sin(turn * yaw)
    return equidistant(np.stack([c * x + s, y, c - s * x], axis=-1), f, cx, cy)


EQUIDISTANT = Exercise(
    name="09.equidistant",
    reference=equidistant,
    cases=_equidistant_cases,
    shown=((np.array([1.0, 0.0, 0.0]), 200.0, 319.5, 239.5),),
    hints=(
        "First the angle θ between the ray and the z axis, then r = f θ, then r is shared between u and v in the ratio "
        "of x to y.",
        "`theta = np.arctan2(np.hypot(x, y), z)` is right all the way round to 180°. The unit vector of (x, y) is "
        "(x, y) / np.hypot(x, y).",
    ),
    praise="A ray at 90°, which no pinhole can show, has a pixel now; so have the rays from behind.",
)


@EQUIDISTANT.wrong(
    "Points behind the camera are mirrored: arctan(r / z) ends at 90° and comes back negative. "
    "Use np.arctan2(r, z), which knows the sign of z."
)
def _(points, f, cx, cy):
    return f * _placed(points, _mirrored(points)) + [cx, cy]


@EQUIDISTANT.wrong("This is r = f tan θ, the pinhole. The equidistant lens has r = f θ.")
def _(points, f, cx, cy):
    return f * _placed(points, np.tan(_theta(points))) + [cx, cy]


@EQUIDISTANT.wrong("This is r = f sin θ, the orthographic lens, which folds at 90°. The equidistant lens has r = f θ.")
def _(points, f, cx, cy):
    return f * _placed(points, np.sin(_theta(points))) + [cx, cy]


@EQUIDISTANT.wrong("Your θ is in degrees. r = f θ wants radians.")
def _(points, f, cx, cy):
    return f * _placed(points, np.degrees(_theta(points))) + [cx, cy]


@EQUIDISTANT.wrong("The principal point is missing: pixels begin in the corner of the image, so add (cx, cy).")
def _(points, f, cx, cy):
    return f * _placed(points, _theta(points))


@EQUIDISTANT.wrong("You multiply x and y themselves by f θ. Only their *direction* counts: divide by √(x² + y²).")
def _(points, f, cx, cy):
    return f * points[..., :2] * _theta(points)[..., None] + [cx, cy]


KANNALA_BRANDT = Exercise(
    name="09.kannala_brandt",
    reference=kannala_brandt,
    cases=_polynomial_cases,
    bug=True,
    hints=(
        "In front of the camera it is right. Put in a point *behind* it, such as (1, 0, −1): its angle is 135°.",
        "np.arctan never gives more than 90°, and a negative z makes it negative. Which function takes y and x apart?",
    ),
    praise="That bug is in OpenCV's own fisheye module: points behind the camera come out mirrored.",
)


@KANNALA_BRANDT.wrong("This is still arctan(r / z): a point at 135° gets the angle −45° and lands on the other side.")
def _(points, k1, k2):
    return _placed(points, _polynomial(_mirrored(points), k1, k2))


@KANNALA_BRANDT.wrong("The sign alone is not enough: a point at 135° is not at 45°.")
def _(points, k1, k2):
    return _placed(points, _polynomial(abs(_mirrored(points)), k1, k2))


@KANNALA_BRANDT.wrong(
    "arctan2's arguments have changed places: this is the angle above the image plane, not from the axis."
)
def _(points, k1, k2):
    return _placed(points, _polynomial(np.arctan2(points[..., 2], np.hypot(points[..., 0], points[..., 1])), k1, k2))


ANGLE = Exercise(
    name="09.angle",
    reference=angle,
    cases=_angle_cases,
    tolerance=1e-7,
    shown=((np.array([0.5, 1.0]), 0.02, 0.001),),
    hints=(
        "Begin at θ = radius. Newton's step: θ ← θ − (g(θ) − radius) / g′(θ), some twenty times. Then put θ back into "
        "g and see whether the radius comes out.",
        "g(θ) = θ (1 + k1 θ² + k2 θ⁴) and g′(θ) = 1 + 3 k1 θ² + 5 k2 θ⁴. In the end, "
        "`np.where(condition, theta, np.nan)` with the condition that g(θ) returns the radius and that 0 ≤ θ ≤ π: no "
        "ray is farther than straight behind.",
    ),
    praise="It gives back the ray of every pixel that has one, and NaN where there is none.",
)


@ANGLE.wrong("One division is only the first step. Put your θ back into the polynomial and look at what is left.")
def _(radius, k1, k2):
    return np.asarray(radius) / (1 + k1 * np.asarray(radius) ** 2 + k2 * np.asarray(radius) ** 4)


@ANGLE.wrong("This bends once more, the model forwards. The radius is given, the angle is wanted.")
def _(radius, k1, k2):
    return _polynomial(np.asarray(radius), k1, k2)


@ANGLE.wrong("Flipping the signs is not the inverse, only its first term.")
def _(radius, k1, k2):
    return _polynomial(np.asarray(radius), -k1, -k2)


WINDOW_MAP = Exercise(
    name="09.window_map",
    reference=window_map,
    cases=_window_cases,
    tolerance=1e-5,  # of a pixel: float32, which `cv2.remap` wants, is good enough
    hints=(
        "Three steps: a pixel of the window to its ray (x, y, 1); the ray turned about y; the turned ray through the "
        "fisheye, as in exercise 1.",
        "Turned to the right by ψ: (x cos ψ + sin ψ, y, cos ψ − x sin ψ). The middle of a window is at "
        "((width − 1)/2, (height − 1)/2).",
    ),
    praise="This is a virtual camera that pans without moving: one fisheye picture holds all its pictures.",
)


@WINDOW_MAP.wrong(
    "Your window turns to the left for a positive yaw: the ray straight ahead must go to (sin ψ, 0, cos ψ)."
)
def _(*arguments):
    return _window_with(-1, 0, *arguments)


@WINDOW_MAP.wrong("Your window always looks straight ahead: the rays are not turned.")
def _(*arguments):
    return _window_with(0, 0, *arguments)


@WINDOW_MAP.wrong("Half a pixel off: the middle of pixels 0 … width − 1 is (width − 1)/2, not width/2.")
def _(*arguments):
    return _window_with(1, 0.5, *arguments)


@WINDOW_MAP.wrong(
    "Rows and columns have changed places: an image array is indexed [v, u], its shape is (height, width)."
)
def _(*arguments):
    return window_map(*arguments).transpose(1, 0, 2)


EXERCISES = (EQUIDISTANT, KANNALA_BRANDT, ANGLE, WINDOW_MAP)
