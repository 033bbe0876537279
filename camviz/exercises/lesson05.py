"""Lesson 05, lens distortion: the polynomial, its tangential part with a bug in it, its fold and its inverse.

Everything here acts on normalised coordinates, ideal → distorted, as Brown (1971) and OpenCV have it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from camviz.checks import SHAPES, Arguments, Array, Exercise, Misconception


def distort(xy: Array, k1: float, k2: float, k3: float) -> Array:
    """x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) for points (..., 2)."""
    r2 = np.sum(xy**2, axis=-1, keepdims=True)
    return xy * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3)


def tangential(xy: Array, p1: float, p2: float) -> Array:
    """What decentred lens elements add: (2 p1 x y + p2 (r² + 2x²), p1 (r² + 2y²) + 2 p2 x y)."""
    x, y = xy[..., 0], xy[..., 1]
    r2 = x**2 + y**2
    return np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + 2 * p2 * x * y], axis=-1)


def fold_radius(k1: float) -> float:
    """The r > 0 where d(r + k1 r³)/dr = 0, that is 1/sqrt(-3 k1); infinite where the curve never turns back."""
    return 1 / np.sqrt(-3 * k1) if k1 < 0 else np.inf


def undistort(r_d: Array, k1: float) -> Array:
    """The r below the fold with r + k1 r³ = r_d ≥ 0, by Newton's method; NaN where no r below the fold does."""
    limit = fold_radius(k1)
    r = np.minimum(np.asarray(r_d, dtype=float), 0.9 * limit)
    for _ in range(50):
        r = r - (r + k1 * r**3 - r_d) / (1 + 3 * k1 * r**2)
    return np.where((abs(r + k1 * r**3 - r_d) < 1e-9) & (r >= 0) & (r <= limit), r, np.nan)


def undistort_map(width: int, height: int, f: float, k1: float) -> Array:
    """For every pixel (height, width, 2) of the straightened image, the pixel of the photograph to copy."""
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    return f * distort((np.stack([u, v], axis=-1) - centre) / f, k1, 0, 0) + centre


def _points(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return rng.uniform(-0.8, 0.8, (*shape, 2))


def _distort_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape), *rng.uniform(-0.4, 0.4, 3).tolist())


def _tangential_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_points(rng, shape), *rng.uniform(-0.1, 0.1, 2).tolist())


def _fold_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for low, high in ((-0.5, -0.3), (-0.3, -0.05), (-0.05, -0.001), (0.05, 0.5)):
        yield (float(rng.uniform(low, high)),)
    yield (0.0,)


def _undistort_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        k1 = float(rng.uniform(-0.4, -0.1))
        yield (rng.uniform(0, 0.6 * fold_radius(k1), shape), k1)
    yield (rng.uniform(0.1, 1.0, 5), float(rng.uniform(0.1, 0.3)))
    k1 = float(rng.uniform(-0.4, -0.2))
    yield (fold_radius(k1) * rng.uniform([0.3, 0.7, 1.2], [0.5, 0.9, 1.4]), k1)  # the image ends at 2/3 of the fold


def _map_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for width, height in ((8, 6), (5, 9)):
        yield (width, height, float(rng.uniform(6, 12)), float(rng.uniform(-0.3, 0.3)))


def _squared_radius_missed(xy: Array, k1: float, k2: float, k3: float) -> Array:
    r = np.linalg.norm(xy, axis=-1, keepdims=True)
    return xy * (1 + k1 * r + k2 * r**2 + k3 * r**3)


def _with_one_radius(xy: Array, k1: float, k2: float, k3: float) -> Array:
    r2 = np.sum(xy**2)
    return xy * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3)


def _map_about(offset: float, width: int, height: int, f: float, k1: float) -> Array:
    """The map with the principal point misplaced by `offset` pixels, to the right and down."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    centre = np.array([(width - 1) / 2, (height - 1) / 2]) + offset
    return f * distort((np.stack([u, v], axis=-1) - centre) / f, k1, 0, 0) + centre


def _inverse_map(width: int, height: int, f: float, k1: float) -> Array:
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    xy = (np.stack([u, v], axis=-1) - centre) / f
    r = np.linalg.norm(xy, axis=-1, keepdims=True)
    return f * xy * np.divide(undistort(r, k1), r, out=np.ones_like(r), where=r > 0) + centre


def _without_twos(xy: ArrayLike, p1: float, p2: float) -> Array:
    x, y = np.moveaxis(np.asarray(xy), -1, 0)
    r2 = x**2 + y**2
    return np.stack([p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + p2 * x * y], axis=-1)


def _without_first_two(xy: ArrayLike, p1: float, p2: float) -> Array:
    return np.stack([_without_twos(xy, p1, p2)[..., 0], tangential(np.asarray(xy), p1, p2)[..., 1]], axis=-1)


def _without_second_two(xy: ArrayLike, p1: float, p2: float) -> Array:
    return np.stack([tangential(np.asarray(xy), p1, p2)[..., 0], _without_twos(xy, p1, p2)[..., 1]], axis=-1)


DISTORT = Exercise(
    name="05.distort",
    reference=distort,
    cases=_distort_cases,
    shown=((np.array([0.5, 0.25]), -0.3, 0.1, 0.02),),
    hints=(
        "Compute r² once, from both coordinates, and multiply *both* of them by the same factor.",
        "`r2 = np.sum(xy**2, axis=-1, keepdims=True)` keeps a last axis of length 1, so that `xy * (1 + k1 * r2 + …)` "
        "broadcasts over any number of points. The powers are r², r⁴ and r⁶.",
    ),
    praise="Your polynomial is the one camviz and OpenCV use, for one point and for any array of them.",
    misconceptions=(
        Misconception(
            _squared_radius_missed, "This is what you get with r, r², r³ where the polynomial has r², r⁴, r⁶."
        ),
        Misconception(
            lambda xy, k1, k2, k3: distort(xy, k1, k3, k2),
            "This is what you get with k2 and k3 in each other's place: k2 goes with r⁴, k3 with r⁶.",
        ),
        Misconception(
            lambda xy, k1, k2, k3: distort(xy, k1, k2, k3) - xy,
            "This is the displacement alone. The distorted point is x times (*1* + k1 r² + …).",
        ),
        Misconception(
            lambda xy, k1, k2, k3: xy * (xy / distort(xy, k1, k2, k3)),
            "You divide by the polynomial. Ideal → distorted multiplies by it; dividing is a rough inverse.",
        ),
        Misconception(
            lambda xy, k1, k2, k3: distort(xy, -k1, -k2, -k3),
            "The coefficients have the wrong sign: here k1 < 0 is barrel, ideal → distorted.",
        ),
        Misconception(
            lambda xy, k1, k2, k3: xy * (1 + k1 * xy**2 + k2 * xy**4 + k3 * xy**6),
            "Each coordinate is bent by its own square. The radius belongs to the point: r² = x² + y².",
        ),
        Misconception(lambda xy, k1, k2, k3: distort(xy, k1, k2, 0.0), "The term k3 r⁶ is missing."),
        Misconception(
            lambda xy, k1, k2, k3: _with_one_radius(xy, k1, k2, k3),
            "Your r² is the sum over *all* points. Each point has its own: sum over the last axis only.",
        ),
    ),
)

TANGENTIAL = Exercise(
    name="05.tangential",
    reference=tangential,
    cases=_tangential_cases,
    bug=True,
    hints=(
        "Compare each of the four terms with the equation in the lesson, factor by factor.",
        "Put in one point with p2 = 0, then another with p1 = 0. For x = y = 1 and p1 alone, the shift is p1 (2, 4).",
    ),
    praise="All four terms are there. This very bug has been published in a widely read notebook.",
    misconceptions=(
        Misconception(
            _without_twos,
            "This is what you get with `p1*x*y` and `p2*x*y` in place of `2*p1*x*y` and `2*p2*x*y`: near the axes "
            "nothing shows, in the corners half of the mixed term is missing.",
        ),
        Misconception(
            _without_first_two,
            "This is what you get with `p1*x*y` instead of `2*p1*x*y`: along the axes nothing shows, in the corners "
            "half of the mixed term is missing.",
        ),
        Misconception(
            _without_second_two, "The first line is right now; the second still has `p2*x*y` instead of `2*p2*x*y`."
        ),
        Misconception(
            lambda xy, p1, p2: tangential(xy, p2, p1),
            "p1 and p2 have changed places: in OpenCV's order p1 goes with the vertical shift r² + 2y².",
        ),
        Misconception(
            lambda xy, p1, p2: xy + tangential(xy, p1, p2),
            "You return the shifted point; this function is to return the shift alone.",
        ),
    ),
)

FOLD = Exercise(
    name="05.fold_radius",
    reference=fold_radius,
    cases=_fold_cases,
    shown=((-0.3,),),
    hints=(
        "The curve r_d = r + k1 r³ turns back where its slope is zero. Differentiate it with respect to r.",
        "1 + 3 k1 r² = 0. For which sign of k1 does that have a solution? Where there is none, the answer is `np.inf`.",
    ),
    praise="Beyond this radius two rays share a pixel: for k1 = −0.3 it lies 46.5° from the axis.",
    misconceptions=(
        Misconception(
            lambda k1: 1 / np.sqrt(-k1) if k1 < 0 else np.inf,
            "This is where r_d returns to *zero*, 1 + k1 r² = 0. The fold comes earlier, where the *slope* is zero.",
        ),
        Misconception(lambda k1: -1 / (3 * k1) if k1 < 0 else np.inf, "This is r². The radius is its square root."),
        Misconception(
            lambda k1: 1 / np.sqrt(3 * abs(k1)) if k1 else np.inf,
            "For k1 < 0 this is right. With k1 > 0 the slope 1 + 3 k1 r² never vanishes: the fold is infinitely far.",
        ),
        Misconception(
            lambda k1: 1 / np.sqrt(-3 * k1) if k1 < 0 else np.nan,
            "For k1 < 0 this is right. Without a fold every radius is allowed: the answer is `np.inf`, not NaN.",
        ),
        Misconception(
            lambda k1: 1 / np.sqrt(-3 * k1) if k1 < 0 else 0.0,
            "For k1 < 0 this is right. Without a fold every radius is allowed: the answer is `np.inf`, not 0.",
        ),
        Misconception(
            lambda k1: 2 / 3 / np.sqrt(-3 * k1) if k1 < 0 else np.inf,
            "This is r_d at the fold, how far the image reaches. The question is at which r that happens.",
        ),
    ),
)

UNDISTORT = Exercise(
    name="05.undistort",
    reference=undistort,
    cases=_undistort_cases,
    tolerance=1e-7,
    hints=(
        "Start at r = r_d, repeat r ← r_d / (1 + k1 r²) or Newton's step some fifty times, then put the result back "
        "into r + k1 r³ and see whether r_d comes out.",
        "Newton's step is r ← r − (r + k1 r³ − r_d) / (1 + 3 k1 r²). In the end, "
        "`np.where(abs(r + k1 * r**3 - r_d) < 1e-9, r, np.nan)`; and a root beyond the fold is another ray's pixel.",
    ),
    praise="It inverts what has an inverse and says NaN for what has none.",
    misconceptions=(
        Misconception(
            lambda r_d, k1: np.asarray(r_d) / (1 + k1 * np.asarray(r_d) ** 2),
            "One step of the iteration is not enough: put your result back through r + k1 r³ and look at what is left.",
        ),
        Misconception(
            lambda r_d, k1: np.asarray(r_d) * (1 - k1 * np.asarray(r_d) ** 2),
            "Flipping the sign of k1 is not the inverse. It is only its first term.",
        ),
        Misconception(
            lambda r_d, k1: r_d + k1 * r_d**3, "This distorts once more: the model runs the wrong way round."
        ),
    ),
)

UNDISTORT_MAP = Exercise(
    name="05.undistort_map",
    reference=undistort_map,
    cases=_map_cases,
    tolerance=1e-5,  # of a pixel: float32, which `cv2.remap` wants, is good enough
    hints=(
        "For each pixel of the *new* image ask where its ray went in the photograph: that is the forward model.",
        "pixels → normalised: subtract the centre ((width − 1)/2, (height − 1)/2), divide by f; distort; multiply by f "
        "and add the centre. `np.meshgrid(np.arange(width), np.arange(height))` gives u and v.",
    ),
    praise="This is what `cv2.initUndistortRectifyMap` computes. No inverse was needed.",
    misconceptions=(
        Misconception(
            _inverse_map,
            "You evaluated the *inverse* model. That map takes a pixel of the photograph to the straight image; "
            "to fill the straight image you ask the other way round.",
        ),
        Misconception(
            lambda width, height, f, k1: undistort_map(width, height, f, k1).transpose(1, 0, 2),
            "Rows and columns have changed places: an image array is indexed [v, u], so its shape is (height, width).",
        ),
        Misconception(
            lambda width, height, f, k1: _map_about(0.5, width, height, f, k1),
            "Half a pixel off: pixels count from 0 to width − 1, so that their middle is (width − 1)/2, not width/2.",
        ),
        Misconception(
            lambda width, height, f, k1: undistort_map(width, height, f, -k1),
            "The sign of k1 is flipped. That is a rough *inverse*; here the model runs forwards, as it is.",
        ),
    ),
)

EXERCISES = (DISTORT, TANGENTIAL, FOLD, UNDISTORT, UNDISTORT_MAP)
