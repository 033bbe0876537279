"""Residuals summarised by view, by corner, by place in the image and by place on the board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import transform
from camviz.lenses.base import Array, as_points
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.jacobian import twist_jacobian
from camviz_clinic.calibration.problem import POSE
from camviz_clinic.calibration.types import Mask

NORMAL = 1.4826  # the standard deviation of a normal distribution over its median absolute deviation


def view_rms(residuals: ArrayLike, used: Mask | None = None) -> Array:
    """The RMS distance (views,) in pixels of residuals (views, corners, 2); NaN for a view that shows no corner.

    With `used` (views, corners) only of those corners.
    """
    squares = np.sum(as_points(residuals, 2, "residuals") ** 2, axis=-1)
    counted = np.isfinite(squares) if used is None else used & np.isfinite(squares)
    count = counted.sum(axis=1)
    return np.sqrt(np.where(counted, squares, 0).sum(axis=1) / np.where(count, count, np.nan))


def robust_sigma(residuals: ArrayLike) -> float:
    """The standard deviation of one coordinate in pixels, from the median, which tolerates a third of outliers."""
    return float(NORMAL * np.nanmedian(np.abs(as_points(residuals, 2, "residuals"))))


def robust_z(residuals: ArrayLike) -> Array:
    """How many standard deviations (views, corners) each corner is off: |residual| over `robust_sigma`.

    With nothing but noise its square is χ² of two degrees of freedom: one corner in a thousand exceeds 3.7.
    """
    residuals = as_points(residuals, 2, "residuals")
    return np.linalg.norm(residuals, axis=-1) / robust_sigma(residuals)


@dataclass(frozen=True, eq=False)
class RadialProfile:
    """Mean residuals in rings around a centre: `radius` (n,), `radial` outwards and `tangential` (clockwise on screen).

    With `deviation`, the standard deviation (n,) that noise gives both means, and the number of corners in each ring.
    """

    radius: Array
    radial: Array
    tangential: Array
    deviation: Array
    count: np.ndarray


def radial_profile(residuals: ArrayLike, uv: ArrayLike, centre: ArrayLike, rings: int = 8) -> RadialProfile:
    """The profile of residuals (..., 2) of corners at pixels uv (..., 2), in rings of equally many corners each."""
    residuals, uv = as_points(residuals, 2, "residuals").reshape(-1, 2), as_points(uv, 2, "uv").reshape(-1, 2)
    known = np.isfinite(residuals).all(-1) & np.isfinite(uv).all(-1)
    arm, residuals = uv[known] - np.asarray(centre, dtype=float), residuals[known]
    radius = np.linalg.norm(arm, axis=-1)
    outwards = arm / np.where(radius > 0, radius, 1)[:, None]
    radial = np.sum(residuals * outwards, axis=-1)
    tangential = residuals[:, 1] * outwards[:, 0] - residuals[:, 0] * outwards[:, 1]
    parts = [part for part in np.array_split(np.argsort(radius), rings) if len(part)]
    count = np.array([len(part) for part in parts])
    sigma = robust_sigma(residuals) if len(residuals) else np.nan
    means = [np.array([values[part].mean() for part in parts]) for values in (radius, radial, tangential)]
    return RadialProfile(means[0], means[1], means[2], sigma / np.sqrt(count), count)


def direction_profile(residuals: ArrayLike, sectors: int = 12) -> np.ndarray:
    """How many residuals (..., 2) point into each of equal angles, (sectors,), from +u on, clockwise on screen."""
    residuals = as_points(residuals, 2, "residuals").reshape(-1, 2)
    residuals = residuals[np.isfinite(residuals).all(-1)]
    angle = np.arctan2(residuals[:, 1], residuals[:, 0]) % (2 * np.pi)
    return np.bincount((angle * sectors / (2 * np.pi)).astype(int) % sectors, minlength=sectors)


def board_displacements(adjustment: Adjustment, name: str) -> Array:
    """Where on the board every corner seems to lie, less where it should, (views, corners, 2) metres along x and y.

    The residual in pixels, taken back to the board's plane by the projection's derivative there; NaN where a corner
    has no say. Its mean over the views is the board's own deviation.
    """
    by_pose = np.full((adjustment.views, len(adjustment.corners), 2, len(POSE)), np.nan)
    by_pose[adjustment.posed] = adjustment.jacobian(name)[1]
    axes = adjustment.first_from_board.rotation.as_matrix()[:, None, :, :2]
    by_board = by_pose[..., 3:] @ axes  # a shift of the board is a shift of the point
    residuals = np.where(adjustment.used[name][..., None], adjustment.residuals[name], np.nan)
    displaced = np.full(residuals.shape, np.nan)
    known = np.isfinite(residuals).all(-1) & np.isfinite(by_board).all(axis=(2, 3))
    displaced[known] = np.linalg.solve(by_board[known], residuals[known][..., None])[..., 0]
    return displaced


def coverage(uv: ArrayLike, width: int, height: int, grid: tuple[int, int] = (10, 8)) -> Array:
    """How many corners uv (..., 2) fall into each cell of a grid over the picture, (rows, columns)."""
    uv = as_points(uv, 2, "uv").reshape(-1, 2)
    uv = uv[np.isfinite(uv).all(-1)]
    edges = [np.linspace(-0.5, height - 0.5, grid[1] + 1), np.linspace(-0.5, width - 0.5, grid[0] + 1)]
    return np.histogram2d(uv[:, 1], uv[:, 0], bins=edges)[0]


def covered(counts: ArrayLike) -> float:
    """The share of the picture's cells that hold a corner."""
    return float(np.mean(np.asarray(counts) > 0))


def correlation(covariance: ArrayLike) -> Array:
    """The correlation matrix (n, n) of a covariance (n, n)."""
    covariance = np.asarray(covariance, dtype=float)
    deviation = np.sqrt(np.diag(covariance))
    return covariance / np.outer(deviation, deviation)


def correlation_with_depth(adjustment: Adjustment, name: str, view: int) -> tuple[tuple[str, ...], Array]:
    """The correlation matrix of camera `name`'s intrinsics and of one board's depth Z, and the names of its rows.

    Z is that of the board's middle along the first camera's axis. Where all boards are parallel,
    the focal lengths and Z are correlated by almost 1. That follows from where the corners are, and is by their noise.
    """
    adjustment = adjustment.by_corners
    middle = transform(adjustment.first_from_board[view], adjustment.corners.mean(axis=0))
    by_twist = twist_jacobian(middle)[2]
    place = adjustment.intrinsics_of(name)
    across = by_twist @ adjustment.cross_covariance[view][:, place]
    own = by_twist @ adjustment.pose_covariance[view] @ by_twist
    covariance = np.block([[adjustment.covariance[place, place], across[:, None]], [across[None], np.array([[own]])]])
    return (*adjustment.estimated[name], "Z"), correlation(covariance)
