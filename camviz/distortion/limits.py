"""Where a distortion ends: folds, poles, and how far a picture and its undistorted one reach. For any lens."""

from __future__ import annotations

from math import inf, pi, radians, sqrt, tan

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Lens, Perspective
from camviz.lenses.arrays import FocalLengths, ImagePointsLike
from camviz.lenses.base import Array
from camviz.lenses.folding import first_positive_root

NEARLY_A_POLE = 0.2  # a denominator below which every error of the numerator is multiplied by more than five
WIDEST = tan(radians(80))  # beyond 80° a perspective picture is hardly more than stretch


def fold_radius(lens: Lens) -> float:
    """The ideal radius where a lens's radial equation turns back, unless a pole comes before it.

    Returns:
        In the equation's own variable: r in focal lengths on the plane z = 1, or for a fisheye the angle θ in radians;
        infinity where it never turns back.

    >>> from camviz.lenses import BrownConrady
    >>> round(fold_radius(BrownConrady(-1 / 3)), 6)  # 1 - 3 r²/3 = 0
    1.0
    """
    return lens.fold.radius if lens.fold else inf


def fold_angle(lens: Lens) -> float:
    """The angle between the axis and the ray at which a lens folds.

    Returns: In radians; infinity if it never folds.

    >>> from camviz.lenses import BrownConrady
    >>> f"{np.degrees(fold_angle(BrownConrady(-1 / 3))):.0f}°"  # atan 1
    '45°'
    """
    return lens.fold.angle if lens.fold else inf


def pole_radius(lens: Lens) -> float:
    """The ideal radius where a rational polynomial is infinite, the first positive root of D(r²).

    Returns: In focal lengths; infinity if there is none.

    >>> from camviz.lenses import BrownConrady
    >>> pole_radius(BrownConrady(k4=-0.25))  # 1 - 0.25 r² = 0
    2.0
    """
    return sqrt(first_positive_root(lens.denominator.coef))


def is_rational(lens: Lens) -> bool:
    """Whether a lens's polynomial is divided by another, so that it may have a pole.

    >>> from camviz.lenses import BrownConrady
    >>> is_rational(BrownConrady(k1=0.1)), is_rational(BrownConrady(k1=0.1, k4=0.1))
    (False, True)
    """
    return bool(np.any(lens.denominator.coef[1:]))


def weakest_denominator(lens: Lens, radius: float) -> tuple[float, float]:
    """Where the denominator D(r²) of a rational polynomial is smallest.

    A D far below 1 is a near-pole: the polynomial has no root there, yet throws the picture about.

    Args:
        radius: How far to look, in focal lengths.

    Returns:
        r: Where in 0 … `radius` it is smallest, in focal lengths; 0 without a denominator.
        D: The denominator there; 1 without one.

    >>> from camviz.lenses import BrownConrady
    >>> weakest_denominator(BrownConrady(k4=-1, k5=0.5), radius=2)  # 1 - s + s²/2 is smallest at s = 1
    (1.0, 0.5)
    """
    turns = lens.denominator.deriv().roots()
    turns = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0) & (turns.real < radius**2)]
    candidates = np.concatenate([[0.0], turns, [radius**2]])
    values = lens.denominator(candidates)
    return float(np.sqrt(candidates[values.argmin()])), float(values.min())


def edge_of_field(lens: Lens, azimuth: ArrayLike) -> Array:
    """The angle from the axis to the last ray with an image.

    Args:
        azimuth: (...), directions in radians, from x towards y.

    Returns: (...), angles in radians.

    >>> from camviz.lenses import Orthographic
    >>> np.degrees(edge_of_field(Orthographic(), [0, np.pi / 2])).round(6)
    array([90., 90.])
    """
    azimuth = np.asarray(azimuth, dtype=float)
    low, high = np.zeros(azimuth.shape), np.full(azimuth.shape, pi)
    for _ in range(44):
        middle = (low + high) / 2
        ray = np.stack([np.sin(middle) * np.cos(azimuth), np.sin(middle) * np.sin(azimuth), np.cos(middle)], axis=-1)
        seen = np.isfinite(lens.project(ray)).all(axis=-1)
        low, high = np.where(seen, middle, low), np.where(seen, high, middle)
    return low


def image_corner_radius(intrinsics: Intrinsics) -> FocalLengths:
    """The distance from the principal point to the farthest corner pixel: a *distorted* radius.

    >>> from camviz.cameras import Intrinsics
    >>> image_corner_radius(Intrinsics(601, 801, 500, 500, cx=300, cy=400))  # √(300² + 400²) / 500
    1.0
    """
    corners = intrinsics.from_pixels(border_points(intrinsics, 1))
    return float(np.linalg.norm(corners, axis=-1).max())


def ideal_image_radius(camera: Camera) -> float:
    """The largest tan θ of the rays in front of the camera that arrive on the image's border.

    Returns: In focal lengths on the plane z = 1; NaN if there are none.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> ideal_image_radius(Camera(Intrinsics(601, 801, 500, 500, cx=300, cy=400)))  # of a perspective lens: the corner
    1.0
    """
    ideal = ideal_points(camera, border_points(camera.intrinsics, 16))
    radii = np.linalg.norm(ideal, axis=-1)
    return float(radii[np.isfinite(radii)].max(initial=-inf)) if np.isfinite(radii).any() else np.nan


def image_reach(camera: Camera) -> float:
    """How far an undistorted picture of this camera asks the lens.

    Returns: In focal lengths on the plane z = 1; NaN where nowhere.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> image_reach(Camera(Intrinsics(601, 801, 500, 500, cx=300, cy=400)))
    1.0
    """
    return float(np.nanmax([ideal_image_radius(camera), image_corner_radius(camera.intrinsics)]))


def jacobian_determinant(lens: Lens, xy: ImagePointsLike) -> Array:
    """The determinant of the map from the plane z = 1 to the image; below 0 it mirrors.

    By the lens's own Jacobian: of `BrownConrady` exact, beyond its fold as well; of most others good to about 1e-9.

    Returns: (...), how many times as large an area becomes.

    >>> from camviz.lenses import BrownConrady
    >>> jacobian_determinant(BrownConrady(-1 / 3), [[0, 0], [1, 0], [1.2, 0]]).round(3)  # at 1 it folds
    array([ 1.   ,  0.   , -0.229])
    """
    J = lens.jacobian(xy)
    with np.errstate(all="ignore"):
        return J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]


def border_points(intrinsics: Intrinsics, samples: int) -> Array:
    """The centres of the outermost pixels as four sides (4, samples + 1, 2): top, right, bottom, left."""
    s = np.linspace(0, 1, samples + 1)
    zero, one = np.zeros_like(s), np.ones_like(s)
    sides = np.array([[s, zero], [one, s], [s, one], [zero, s]])
    return np.moveaxis(sides, 1, -1) * [intrinsics.width - 1, intrinsics.height - 1]


def ideal_points(camera: Camera, uv: Array) -> Array:
    """The points (..., 2) of the plane z = 1 that pixels (..., 2) show; NaN where they show none."""
    return Perspective().project(camera.lens.unproject(camera.intrinsics.from_pixels(uv)))
