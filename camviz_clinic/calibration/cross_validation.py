"""How well a calibration predicts what it has not seen: two halves of the views, and corners held out of every view."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import SETTLED, Adjustment
from camviz_clinic.calibration.difference import Difference, difference, pixel_grid
from camviz_clinic.calibration.problem import rms_by_view
from camviz_clinic.calibration.types import Board, Mask
from camviz_clinic.calibration.uncertainty import mean_deviation, projection_covariance

FEWEST_VIEWS = 3  # in each half
ROUGHLY = 1e-8  # of the sum of squares: what a step must promise where four digits of an error are enough


@dataclass(frozen=True, eq=False)
class Halves:
    """Two solutions from disjoint views, their difference map, and how far apart noise alone would have them."""

    first: Adjustment
    second: Adjustment
    difference: Difference
    expected: Array  # (rows, columns) pixels, √(σ₁² + σ₂²) of the two projections, both directions together
    probability: float

    @property
    def ratio(self) -> float:
        """The difference over the expected one: the median over the picture. About 1 if noise is all there is."""
        return float(np.nanmedian(self.difference.length / self.expected))


def halves(
    adjustment: Adjustment,
    first: ArrayLike | None = None,
    *,
    camera: str | None = None,
    distance: float = inf,
    grid: tuple[int, int] = (60, 40),
) -> Halves:
    """The views of the mask `first` (views,) against the others; by default the earlier against the later ones.

    The two sets of intrinsics differ by δ, of covariance Σ = Σ₁ + Σ₂ when nothing but noise is at work; `probability`
    is that of a δᵀ Σ⁻¹ δ as large as this or larger, which is χ² in as many degrees of freedom as there are intrinsics.
    A prior that both were solved under draws both the same way, and they lie closer together than that. Raises
    ValueError where a half has fewer than three views with a say, and NothingSharedError, one too, where the two
    cameras have fewer than three rays in common.
    """
    views = np.arange(adjustment.views)
    mask = views < adjustment.views // 2 if first is None else np.asarray(first, dtype=bool)
    name = next(iter(adjustment.cameras)) if camera is None else camera
    counts = [int(adjustment.posed[part].sum()) for part in (mask, ~mask)]
    if min(counts) < FEWEST_VIEWS:
        raise ValueError(f"each half must have at least {FEWEST_VIEWS} views, got {counts[0]} and {counts[1]}")
    one, other = (adjustment.only(part).refined().by_corners for part in (mask, ~mask))
    uv = pixel_grid(one.cameras[name].intrinsics, grid)
    deviations = [mean_deviation(projection_covariance(part, uv, distance, name)) for part in (one, other)]
    apart = difference(
        one.cameras[name],
        other.cameras[name],
        distance,
        grid,
        uncertainties=(deviations[0], deviations[1]),
    )
    expected = np.sqrt(2) * np.hypot(*deviations)
    return Halves(one, other, apart, expected, _probability(one, other, name))


def _probability(one: Adjustment, other: Adjustment, name: str) -> float:
    delta = one.intrinsics(name) - other.intrinsics(name)
    covariance = one.intrinsics_covariance(name) + other.intrinsics_covariance(name)
    return float(chdtrc(len(delta), delta @ np.linalg.solve(covariance, delta)))


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The residuals of corners that neither the pose of their view nor, with `folds`, the camera was fitted to.

    `residuals` (4, views, corners, 2) are observed less predicted pixels, by the half of the board (right, left,
    bottom, top) that was held out; NaN for the corners its pose was taken from. `variances` (4, views, corners, 2) are
    those that the noise of corners, and of the solution that comes from it, should give them.
    """

    residuals: Array
    variances: Array

    @property
    def rms(self) -> float:
        """The RMS distance between observed and predicted corners, in pixels."""
        return float(np.sqrt(2 * np.nanmean(self.residuals**2)))

    @property
    def expected_rms(self) -> float:
        """The RMS distance in pixels that the noise of the corners would give."""
        return float(np.sqrt(2 * np.nanmean(self.variances)))

    @property
    def ratio(self) -> float:
        """How many times larger the errors are than their own expected deviations; about 1 if all is well."""
        return float(np.sqrt(np.nanmean(self.residuals**2 / self.variances)))

    @property
    def per_view(self) -> Array:
        """The RMS of every view (views,); NaN for a view without a say."""
        return rms_by_view(np.concatenate(np.sum(self.residuals**2, axis=-1), axis=1))


def held_out(adjustment: Adjustment, *, folds: int | None = None, camera: str | None = None) -> HeldOut:
    """Every view's pose from one half of its corners, scored on the other half: left, right, top and bottom in turn.

    The pose of a view makes up for much of what is wrong with a camera; it does so for the corners it is fitted to,
    and not for those beyond them. With `folds` the cameras are those of a solution without the view: the views are
    dealt into as many parts, and each part is asked of the solution of the others. Otherwise they are the adjustment's
    own, right or wrong; what noise alone would do is then reckoned from the corners with the cameras free.
    """
    name = next(iter(adjustment.cameras)) if camera is None else camera
    shape = (4, adjustment.views, len(adjustment.corners), 2)
    residuals, variances = np.full(shape, np.nan), np.full(shape, np.nan)
    for views, solution in _folds(adjustment, folds):
        asked = _asked(adjustment, views, solution if folds else adjustment)
        for i, half in enumerate(board_halves(adjustment.board)):
            there = _posed_by(half, asked)
            scored = asked.used[name] & ~half & there.posed[:, None]
            residuals[i, views] = np.where(scored[..., None], there.residuals[name], np.nan)
            variances[i, views] = np.where(scored[..., None], _predicted_variances(there, solution, name), np.nan)
    return HeldOut(residuals, variances)


def held_out_rms(adjustment: Adjustment, folds: int) -> float:
    """The RMS of `held_out` with so many folds, over all cameras together, in pixels to four digits."""
    total, count = 0.0, 0
    for views, solution in _folds(adjustment, folds, ROUGHLY):
        asked = _asked(adjustment, views, solution)
        for half in board_halves(adjustment.board):
            there = _posed_by(half, asked, settled=ROUGHLY)
            for name in adjustment.cameras:
                scored = there.residuals[name][asked.used[name] & ~half & there.posed[:, None]]
                total, count = total + float(np.sum(scored**2)), count + len(scored)
    return float(np.sqrt(total / count)) if count else inf


def _folds(adjustment: Adjustment, folds: int | None, settled: float = SETTLED) -> list[tuple[np.ndarray, Adjustment]]:
    """Pairs of held-out views and the solution from the others."""
    views = np.arange(adjustment.views)
    if folds is None:
        return [(views, adjustment.refined())]
    if not 2 <= folds <= adjustment.views:
        raise ValueError(f"folds must be between 2 and the number of views, {adjustment.views}, got {folds}")
    parts = [views[start::folds] for start in range(folds)]
    return [(part, adjustment.only(np.setdiff1d(views, part)).refined(settled=settled)) for part in parts]


def _asked(adjustment: Adjustment, views: ArrayLike, solution: Adjustment) -> Adjustment:
    """Some views of a problem before the cameras and with the board of a solution."""
    return replace(adjustment.only(views), cameras=solution.cameras, warp=solution.warp)


def _posed_by(half: Mask, asked: Adjustment, settled: float = SETTLED) -> Adjustment:
    """The views with poses from the corners (corners,) of one half of the board."""
    used = {name: mask & half for name, mask in asked.used.items()}
    return asked.using(used).refined(only_poses=True, settled=settled)


def board_halves(board: Board) -> list[Mask]:
    """The corners (corners,) of the left, right, upper and lower half; a middle line belongs to both of its halves."""
    row, column = np.divmod(np.arange(board.columns * board.rows), board.columns)
    x, y = 2 * column - (board.columns - 1), 2 * row - (board.rows - 1)
    return [x <= 0, x >= 0, y <= 0, y >= 0]


def _predicted_variances(there: Adjustment, solution: Adjustment, name: str) -> Array:
    """The variance (views, corners, 2) of a corner's residual where neither pose nor camera have seen it.

    Its own noise σ²; the noise of the pose, whose Cᵢ⁻¹ comes from the other half; and an error of the cameras, which
    the pose follows by -Wᵢ (`Arrowhead`).
    """
    normal = there.normal_equations
    by_shared, by_pose = there.jacobian(name)
    by_cameras = by_shared - by_pose @ normal.pose_response[:, None]
    variances = np.full((there.views, *by_pose.shape[1:3]), np.nan)
    of_pose = np.einsum("vcim,vmn,vcin->vci", by_pose, normal.block_inverses, by_pose)
    of_cameras = np.einsum("vcis,st,vcit->vci", by_cameras, solution.normal_equations.covariance, by_cameras)
    variances[there.posed] = solution.sigma**2 * (1 + of_pose + of_cameras)
    return variances
