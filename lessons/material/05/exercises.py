"""Lesson 05, lens distortion: the polynomial, its tangential part with a bug in it, its fold and its inverse.

Everything here acts on normalised coordinates, ideal → distorted, as OpenCV has it; the terms are Brown's (1971).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

# 1: the radial polynomial --------------------------------------------------------------------------------------------


def distort(xy: Array, k1: float, k2: float, k3: float) -> Array:
    """x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) for points (..., 2)."""
    r2 = np.sum(xy**2, axis=-1, keepdims=True)
    return xy * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3)


def _distort_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Each coefficient with either sign; the last points so far out that the factor is below 0."""
    signs = ((1, -1, 1), (-1, 1, -1), (1, 1, -1), (-1, -1, 1))
    for shape, sign in zip(SHAPES, signs, strict=True):
        yield (rng.uniform(-0.8, 0.8, (*shape, 2)), *(rng.uniform(0.1, 0.4, 3) * sign).tolist())
    yield (rng.choice([-1.0, 1.0], (4, 2)) * rng.uniform(1.5, 2.5, (4, 2)), -0.4, -float(rng.uniform(0.01, 0.1)), 0.0)


DISTORT = Exercise(
    name="05.distort",
    reference=distort,
    cases=_distort_cases,
    shown=((np.array([0.5, 0.25]), -0.3, 0.1, 0.02),),
    hints=(
        "Both coordinates of a point are multiplied by the same factor. Which radius does it depend on?",
        "`np.sum(…, axis=-1, keepdims=True)` adds the two coordinates of each point and keeps an axis of length 1, so "
        "that the factor multiplies both. The powers are r², r⁴ and r⁶, which are r², (r²)² and (r²)³.",
        "`return xy * (1 + k1 * r2 + k2 * ___ + k3 * ___)`",
    ),
    praise="Your polynomial is the one camviz and OpenCV use, for one point and for any array of them.",
)


@DISTORT.right
def as_opencv_does_it(xy, k1, k2, k3):
    import cv2

    points = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1).reshape(-1, 1, 3)
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array([k1, k2, 0, 0, k3]))[0].reshape(
        xy.shape
    )


@DISTORT.right
def with_the_radius_itself(xy, k1, k2, k3):
    r = np.hypot(xy[..., 0], xy[..., 1])
    factor = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    return np.stack([xy[..., 0] * factor, xy[..., 1] * factor], axis=-1)


@DISTORT.wrong("This is what you get with r, r², r³ where the polynomial has r², r⁴, r⁶.")
def powers_of_r(xy, k1, k2, k3):
    r = np.linalg.norm(xy, axis=-1, keepdims=True)
    return xy * (1 + k1 * r + k2 * r**2 + k3 * r**3)


@DISTORT.wrong("This is the displacement alone. The distorted point is x times (*1* + k1 r² + …).")
def displacement(xy, k1, k2, k3):
    return distort(xy, k1, k2, k3) - xy


@DISTORT.wrong("You divide by the polynomial. Ideal → distorted multiplies by it; dividing is a rough inverse.")
def divided(xy, k1, k2, k3):
    return xy * (xy / distort(xy, k1, k2, k3))


@DISTORT.wrong("The coefficients have the wrong sign: here k1 < 0 is barrel, ideal → distorted.")
def signs_flipped(xy, k1, k2, k3):
    return distort(xy, -k1, -k2, -k3)


@DISTORT.wrong("Each coordinate is bent by its own square. The radius belongs to the point: r² = x² + y².")
def each_coordinate_by_itself(xy, k1, k2, k3):
    return xy * (1 + k1 * xy**2 + k2 * xy**4 + k3 * xy**6)


# 2: find the bug in the tangential part ------------------------------------------------------------------------------


def tangential(xy: Array, p1: float, p2: float) -> Array:
    """What decentred lens elements add: (2 p1 x y + p2 (r² + 2x²), p1 (r² + 2y²) + 2 p2 x y)."""
    x, y = xy[..., 0], xy[..., 1]
    r2 = x**2 + y**2
    return np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + 2 * p2 * x * y], axis=-1)


def tangential_as_given(xy, p1, p2):
    x, y = xy[..., 0], xy[..., 1]
    r2 = x**2 + y**2
    return np.stack([p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + p2 * x * y], axis=-1)


def _tangential_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Each coefficient with either sign; the last point on an axis, where nothing makes up for the square's sign."""
    for shape, signs in zip(SHAPES, ((1, 1), (-1, 1), (1, -1), (-1, -1)), strict=True):
        yield (rng.uniform(-0.8, 0.8, (*shape, 2)), *(rng.uniform(0.02, 0.1, 2) * signs).tolist())
    for sign in (1, -1):
        yield (np.array([rng.uniform(0.3, 0.8), 0.0]), *(sign * rng.uniform(0.02, 0.1, 2)).tolist())


TANGENTIAL = Exercise(
    name="05.tangential",
    reference=tangential,
    cases=_tangential_cases,
    as_given=tangential_as_given,
    hints=(
        "Put in the point x = y = 1 by hand, first with p2 = 0, then with p1 = 0, and compare with the equation.",
        "For x = y = 1 and p1 alone the equation gives the shift p1 (2, 4). Which of the two numbers does yours miss?",
        "`dx = ___ * p1 * x * y + p2 * (r2 + 2 * x**2)`",
    ),
    praise="All four terms are there. This very bug has been published.",
)


@TANGENTIAL.right
def as_opencv_bends_it(xy, p1, p2):
    import cv2

    points = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1).reshape(-1, 1, 3)
    bent = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array([0, 0, p1, p2]))[0]
    return bent.reshape(xy.shape) - xy


@TANGENTIAL.right
def multiplied_out(xy, p1, p2):
    x, y = np.moveaxis(xy, -1, 0)
    return np.stack([2 * p1 * x * y + p2 * (3 * x * x + y * y), p1 * (x * x + 3 * y * y) + 2 * p2 * x * y], axis=-1)


@TANGENTIAL.wrong("The first line is right now. The second still has `p2*x*y` in place of `2*p2*x*y`.")
def only_the_first_line_mended(xy, p1, p2):
    return np.stack([tangential(xy, p1, p2)[..., 0], tangential_as_given(xy, p1, p2)[..., 1]], axis=-1)


@TANGENTIAL.wrong("The second line is right now. The first still has `p1*x*y` in place of `2*p1*x*y`.")
def only_the_second_line_mended(xy, p1, p2):
    return np.stack([tangential_as_given(xy, p1, p2)[..., 0], tangential(xy, p1, p2)[..., 1]], axis=-1)


@TANGENTIAL.wrong("p1 and p2 have changed places: in OpenCV's order p1 goes with the vertical shift r² + 2y².")
def p1_and_p2_swapped(xy, p1, p2):
    return tangential(xy, p2, p1)


@TANGENTIAL.wrong("You return the shifted point; this function is to return the shift alone.")
def shifted_point(xy, p1, p2):
    return xy + tangential(xy, p1, p2)


@TANGENTIAL.wrong("x and y have changed places in the brackets: the horizontal shift has r² + 2*x*².")
def squares_swapped(xy, p1, p2):
    x, y = xy[..., 0], xy[..., 1]
    r2 = x**2 + y**2
    return np.stack([2 * p1 * x * y + p2 * (r2 + 2 * y**2), p1 * (r2 + 2 * x**2) + 2 * p2 * x * y], axis=-1)


# 3: the fold ---------------------------------------------------------------------------------------------------------


def fold_radius(k1: float) -> float:
    """The r > 0 where d(r + k1 r³)/dr = 0, that is 1/sqrt(-3 k1); infinite where the curve never turns back."""
    return 1 / np.sqrt(-3 * k1) if k1 < 0 else np.inf


def _fold_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for low, high in ((-0.5, -0.3), (-0.3, -0.05), (-0.05, -0.001), (0.05, 0.5)):
        yield (float(rng.uniform(low, high)),)
    yield (0.0,)


FOLD = Exercise(
    name="05.fold_radius",
    reference=fold_radius,
    cases=_fold_cases,
    shown=((-0.3,),),
    hints=(
        "The curve r_d = r + k1 r³ turns back where it is neither rising nor falling.",
        "Differentiate r + k1 r³ with respect to r and set the slope to zero. For which sign of k1 is there such an r? "
        "Where there is none, the answer is `np.inf`.",
        "`return 1 / np.sqrt(___) if k1 < 0 else np.inf`",
    ),
    praise="Beyond this radius two rays share a pixel: for k1 = −0.3 it lies 46.5° from the axis.",
)


@FOLD.right
def with_the_minus_elsewhere(k1):
    return np.sqrt(-1 / (3 * k1)) if k1 < 0 else float("inf")


@FOLD.right
def from_the_roots_of_the_slope(k1):
    roots = np.roots([3 * k1, 0, 1]) if k1 else np.array([])
    real = roots[np.isreal(roots)].real
    return max(real) if len(real) else np.inf


@FOLD.wrong("This is where r_d returns to *zero*. The fold comes earlier, where the *slope* is zero.")
def factor_zero(k1):
    return 1 / np.sqrt(-k1) if k1 < 0 else np.inf


@FOLD.wrong("This is r². The radius is its square root.")
def squared(k1):
    return -1 / (3 * k1) if k1 < 0 else np.inf


@FOLD.wrong("With k1 > 0 the slope 1 + 3 k1 r² never vanishes: the fold is infinitely far.")
def sign_ignored(k1):
    return 1 / np.sqrt(3 * abs(k1)) if k1 else np.inf


@FOLD.wrong("This is r_d at the fold, how far the image reaches. The question is at which r that happens.")
def reach_of_the_image(k1):
    return 2 / 3 / np.sqrt(-3 * k1) if k1 < 0 else np.inf


@FOLD.wrong("This is the *angle* at which the ray folds. Its tangent r is wanted.")
def angle_in_radians(k1):
    return np.arctan(1 / np.sqrt(-3 * k1)) if k1 < 0 else np.inf


# 4: the inverse, for points ------------------------------------------------------------------------------------------


def undistort(r_d: Array, k1: float) -> Array:
    """The r below the fold with r + k1 r³ = r_d ≥ 0, by Newton's method; NaN where no r below the fold does."""
    limit = fold_radius(k1)
    r = np.minimum(np.asarray(r_d, dtype=float), 0.9 * limit)
    for _ in range(50):
        r = r - (r + k1 * r**3 - r_d) / (1 + 3 * k1 * r**2)
    return np.where((abs(r + k1 * r**3 - r_d) < 1e-9) & (r >= 0) & (r <= limit), r, np.nan)


def _undistort_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        k1 = float(rng.uniform(-0.4, -0.1))
        yield (rng.uniform(0.05, 0.6 * fold_radius(k1), shape), k1)
    yield (rng.uniform(0.3, 1.0, 5), float(rng.uniform(0.1, 0.3)))
    yield (rng.uniform(4, 8, 3), float(rng.uniform(0.4, 0.6)))  # a strong pincushion, where dividing does not settle
    yield (np.append(rng.uniform(0.1, 3, 2), 0.0), 0.0)
    k1 = float(rng.uniform(-0.4, -0.2))
    fold = fold_radius(k1)
    beyond = np.linspace(0.7, 3.0, 20) * rng.uniform(0.98, 1.02, 20)  # of the fold; the image ends at 2/3 of it
    yield (fold * np.concatenate([[0.0], beyond, rng.uniform(0.3, 0.5, 3)]), k1)
    for k1 in (float(rng.uniform(-0.3, -0.2)), float(rng.uniform(-4, -3))):
        fold = fold_radius(k1)
        r = fold * np.array([*rng.uniform(0.8, 0.9, 3), 0.935, 0.97, 0.985, 0.992, 0.998])  # up to the fold itself
        outside = 2 / 3 * fold * (1 + np.append(rng.uniform(1e-5, 1e-4, 24), [0.1, 1.0]))  # and just beyond it
        yield (np.append(r + k1 * r**3, outside), k1)


UNDISTORT = Exercise(
    name="05.undistort",
    reference=undistort,
    cases=_undistort_cases,
    tolerance=1e-7,
    hints=(
        "Guess r = r_d, and improve the guess again and again. Then put the result back into r + k1 r³: does r_d come "
        "out? Where it does not, or where the result lies outside 0 … fold, there is no such point.",
        "Newton's step subtracts (what r gives − r_d) / (the slope at r) from r; fifty steps are plenty. Beyond the "
        "image it wanders off, to negative r too, and a root beyond the fold is another ray's pixel. Both are NaN: "
        "`np.where(condition, r, np.nan)`.",
        "`r = r - (r + k1 * r**3 - r_d) / ___`",
    ),
    praise="It inverts what has an inverse and says NaN for what has none.",
)


@UNDISTORT.right
def by_the_cubic_formula(r_d, k1):
    """r³ + p r + q = 0 with p = 1/k1, q = -r_d/k1: Viète's cosine for k1 < 0, Cardano's roots for k1 > 0."""
    if k1 == 0:
        return r_d
    p, q = 1 / k1, -np.asarray(r_d, dtype=float) / k1
    if k1 < 0:
        cosine = 3 * q / (2 * p) * np.sqrt(-3 / p)
        return 2 * np.sqrt(-p / 3) * np.cos(np.arccos(cosine) / 3 - 2 * np.pi / 3)
    root = np.sqrt(q**2 / 4 + p**3 / 27)
    return np.cbrt(-q / 2 + root) + np.cbrt(-q / 2 - root)


@UNDISTORT.right
def by_bisection(r_d, k1):
    r_d = np.asarray(r_d, dtype=float)
    low, high = np.zeros_like(r_d), np.full_like(r_d, min(fold_radius(k1), 10.0))
    for _ in range(80):
        middle = (low + high) / 2
        below = middle + k1 * middle**3 < r_d
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.where(abs(low + k1 * low**3 - r_d) < 1e-9, low, np.nan)


@UNDISTORT.wrong("One step of the iteration is not enough: put your result back through r + k1 r³.")
def one_division(r_d, k1):
    return np.asarray(r_d) / (1 + k1 * np.asarray(r_d) ** 2)


@UNDISTORT.wrong("Flipping the sign of k1 is not the inverse. It is only its first term.")
def sign_flipped(r_d, k1):
    return np.asarray(r_d) * (1 - k1 * np.asarray(r_d) ** 2)


@UNDISTORT.wrong("Dividing settles only while k1 r² is below 1. Take Newton's steps, and put the result back.")
def divided_without_a_look_back(r_d, k1):
    r = np.asarray(r_d, dtype=float)
    for _ in range(100):
        r = r_d / (1 + k1 * r**2)
    return r


@UNDISTORT.wrong("Beyond the image you find a *negative* r, where no ray lies: keep only 0 … fold.")
def negative_roots_kept(r_d, k1):
    r = np.asarray(r_d, dtype=float)
    for _ in range(50):
        r = r - (r + k1 * r**3 - r_d) / (1 + 3 * k1 * r**2)
    return np.where(abs(r + k1 * r**3 - r_d) < 1e-9, r, np.nan)


@UNDISTORT.wrong("Five rounds of dividing, as in `cv2.undistortPoints`, are too few. Iterate until nothing changes.")
def five_divisions(r_d, k1):
    r = np.asarray(r_d, dtype=float)
    for _ in range(5):
        r = r_d / (1 + k1 * r**2)
    return r


@UNDISTORT.wrong("For a strong pincushion, such as r_d = 6 with k1 = 0.5, dividing never settles. Newton's steps do.")
def divided_and_looked_back(r_d, k1):
    r = np.asarray(r_d, dtype=float)
    for _ in range(100):
        r = r_d / (1 + k1 * r**2)
    return np.where(abs(r + k1 * r**3 - r_d) < 1e-9, r, np.nan)


@UNDISTORT.wrong("Where no ray lands you answer with the fold. A clamped point looks like a real one: NaN.")
def clamped_to_the_fold(r_d, k1):
    return np.where(np.isnan(undistort(r_d, k1)), fold_radius(k1), undistort(r_d, k1))


# 5: the map that straightens a photograph ----------------------------------------------------------------------------


def undistort_map(width: int, height: int, f: float, k1: float) -> Array:
    """For every pixel (height, width, 2) of the straightened image, the pixel of the photograph to copy."""
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    return f * distort((np.stack([u, v], axis=-1) - centre) / f, k1, 0, 0) + centre


def _map(width, height, f, bend, offset=0.0):
    centre = np.array([(width - 1) / 2, (height - 1) / 2]) + offset
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    return f * bend((np.stack([u, v], axis=-1) - centre) / f) + centre


def _map_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """A pincushion that reaches beyond the photograph, a barrel, and one so strong that its corners fold over."""
    yield (8, 6, float(rng.uniform(4, 6)), float(rng.uniform(0.2, 0.3)))
    yield (5, 9, float(rng.uniform(6, 12)), -float(rng.uniform(0.1, 0.3)))
    yield (9, 8, float(rng.uniform(1.5, 2)), -float(rng.uniform(0.25, 0.3)))


UNDISTORT_MAP = Exercise(
    name="05.undistort_map",
    reference=undistort_map,
    cases=_map_cases,
    tolerance=1e-5,  # of a pixel: float32, which `cv2.remap` wants, is good enough
    hints=(
        "For each pixel of the *new* image ask where its ray went in the photograph: that is the forward model.",
        "Three steps: pixels → normalised (subtract the centre, divide by f), distort, and back (multiply by f, add "
        "the centre). The centre is ((width − 1)/2, (height − 1)/2); `np.meshgrid` makes all u and v.",
        "`xy = (np.stack([u, v], axis=-1) - ___) / f`",
    ),
    praise="This is what `cv2.initUndistortRectifyMap` computes. No inverse was needed.",
)


@UNDISTORT_MAP.right
def opencv_s_own_map(width, height, f, k1):
    import cv2

    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    maps = cv2.initUndistortRectifyMap(K, np.array([k1, 0, 0, 0]), np.eye(3), K, (width, height), cv2.CV_32FC1)
    return np.stack(maps[:2], axis=-1)


@UNDISTORT_MAP.right
def pixel_by_pixel(width, height, f, k1):
    cx, cy = (width - 1) / 2, (height - 1) / 2
    uv = np.zeros((height, width, 2), np.float32)
    for v in range(height):
        for u in range(width):
            x, y = (u - cx) / f, (v - cy) / f
            factor = 1 + k1 * (x * x + y * y)
            uv[v, u] = f * x * factor + cx, f * y * factor + cy
    return uv


@UNDISTORT_MAP.wrong("You evaluated the *inverse* model. A pixel of the straight image asks the *forward* model.")
def inverse_map(width, height, f, k1):
    def straighten(xy):
        r = np.linalg.norm(xy, axis=-1, keepdims=True)
        return xy * np.divide(undistort(r, k1), r, out=np.ones_like(r), where=r > 0)

    return _map(width, height, f, straighten)


@UNDISTORT_MAP.wrong("Half a pixel off: pixels 0 … width − 1 have their middle at (width − 1)/2, not width/2.")
def half_a_pixel_off(width, height, f, k1):
    return _map(width, height, f, lambda xy: distort(xy, k1, 0, 0), offset=0.5)


@UNDISTORT_MAP.wrong("Your r is measured in pixels. Divide by f before you bend, and multiply by f after.")
def radius_in_pixels(width, height, f, k1):
    return _map(width, height, 1.0, lambda xy: distort(xy, k1, 0, 0))


@UNDISTORT_MAP.wrong("The last axis holds (u, v), column first: `cv2.remap` reads it so. Yours has the row first.")
def row_first(width, height, f, k1):
    return undistort_map(width, height, f, k1)[..., ::-1]


@UNDISTORT_MAP.wrong("You never subtract the centre. The lens bends about the principal point.")
def bent_about_the_corner(width, height, f, k1):
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    return f * distort(np.stack([u, v], axis=-1) / f, k1, 0, 0)


EXERCISES = (DISTORT, FOLD, UNDISTORT_MAP, UNDISTORT, TANGENTIAL)
