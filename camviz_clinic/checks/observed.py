"""One camera's corners against what the calibration says of them: residuals, their scatter, and tests upon them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from camviz.cameras import Camera, transform
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.jacobian import pixel_jacobian
from camviz_clinic.calibration.problem import rms_by_view

Mask = NDArray[np.bool_]

FAR_OUT = 6.0  # standard deviations: beyond, a corner says more about its detection than about the camera
BY_CHANCE = 1e-6  # how often a test may cry wolf
APART = 1e-3  # the part of a column's length that must be left when others have taken theirs
SAME = 1e-5  # the same for the parameters of the solution itself, some of which are all but one


@dataclass(frozen=True, eq=False)
class Observed:
    """A camera of a calibration with its corners, as an `Adjustment` of that camera alone, at the file's numbers."""

    name: str
    adjustment: Adjustment

    @property
    def camera(self) -> Camera:
        return self.adjustment.cameras[self.name]

    @property
    def detections(self) -> Array:
        """Pixels (views, corners, 2); NaN where a corner was not seen."""
        return self.adjustment.detections[self.name]

    @property
    def shape(self) -> tuple[int, int]:
        """The corners of the board as (rows, columns)."""
        return self.adjustment.board.rows, self.adjustment.board.columns

    @cached_property
    def residuals(self) -> Array:
        """Detected less projected at the file's numbers, (views, corners, 2), also where a corner was set aside."""
        return self.adjustment.residuals[self.name]

    @cached_property
    def in_use(self) -> Array:
        """The residuals (views, corners, 2) of the corners that have a say in the solution, and NaN for all others."""
        return np.where(self.adjustment.used[self.name][..., None], self.residuals, np.nan)

    @cached_property
    def errors(self) -> Array:
        """The RMS (views,) of each view's residuals in pixels over the corners in use; NaN for a view without any."""
        return rms_by_view(np.sum(np.square(self.in_use), axis=-1))

    @cached_property
    def scatter(self) -> float:
        """The standard deviation in pixels of one coordinate, from the median, which a few bad corners do not move."""
        return robust_sigma(self.residuals)

    @property
    def noise(self) -> float:
        """The same with what the parameters take of it given back; infinite where they may take all of it."""
        left = self.adjustment.measurements - self.adjustment.unknowns
        return self.scatter * float(np.sqrt(self.adjustment.measurements / left)) if left > 0 else np.inf

    @cached_property
    def best(self) -> Adjustment:
        """At the numbers that these corners ask for, without the corners that are far out."""
        best = self.adjustment.refined()
        for _ in range(3):
            residuals = best.residuals[self.name]
            far = np.linalg.norm(residuals, axis=-1) > FAR_OUT * robust_sigma(residuals)
            aside = best.set_aside.get(self.name, np.zeros_like(far))
            if not (far & ~aside).any():
                break
            best = replace(best, set_aside={self.name: far | aside}).refined()
        return best


@dataclass(frozen=True)
class Explained:
    """Whether more parameters explain more than noise: how many were told apart, F, its chance, and their values."""

    count: int
    F: float
    chance: float
    values: Array
    sigmas: Array
    part: float  # RMS of what they explain beyond noise's share, over the scatter
    pixels: float = 0.0  # the same as RMS distance
    most: float = 0.0  # pixels, what they explain of a single corner


def explained(adjustment: Adjustment, name: str, extra: Array, *also: Array) -> Explained:
    """Columns `extra` (views, corners, 2, e), more derivatives of the pixels, against the residuals of an optimum.

    All that the adjustment itself, and more columns `also`, could explain is taken out first. Then E, the part of the
    sum of squares S in the direction of e columns that are left, makes F = (E/e) / ((S - E)/(N - k - e)) (Seber & Lee
    2003, theorem 4.1). Columns that cannot be told apart from the rest are not counted.
    """
    residuals, left, scale, known = projected(adjustment, name, extra, also)
    axes, into = _axes(left / scale, APART)
    along = axes.T @ residuals
    count, fallen = axes.shape[1], float(along @ along)
    freedom = adjustment.measurements - adjustment.unknowns - known - count
    if count == 0 or freedom < 1:
        return Explained(0, 0.0, 1.0, np.zeros(len(scale)), np.full(len(scale), np.inf), 0.0)
    variance = max(float(residuals @ residuals) - fallen, np.finfo(float).tiny) / freedom
    F = fallen / count / variance
    part = float(np.sqrt(max(fallen - count * variance, 0) / adjustment.measurements / variance))
    sigmas = np.sqrt(variance) * np.linalg.norm(into, axis=1) / scale
    chance, most = (
        float(fdtrc(count, freedom, max(F, 0.0))),
        np.linalg.norm((axes @ along).reshape(-1, 2), axis=1).max(),
    )
    pixels = part * float(np.sqrt(2 * variance))
    return Explained(count, F, chance, into @ along / scale, sigmas, part, pixels, float(most))


def projected(
    adjustment: Adjustment, name: str, extra: Array, also: Sequence[Array] = ()
) -> tuple[Array, Array, Array, int]:
    """Residuals (n,) and columns (n, e) with poses, parameters and `also` taken out; the columns' lengths before; how
    many directions `also` had."""
    by_shared, by_pose = adjustment.jacobian(name)
    views, used = adjustment.posed, adjustment.used[name][adjustment.posed]
    groups = [by_shared, *(columns[views] for columns in also), extra[views]]
    lengths = [np.sqrt(np.sum(np.where(used[..., None, None], group, 0) ** 2, axis=(0, 1, 2))) for group in groups]
    lengths = [np.where(length > 0, length, 1) for length in lengths]
    left = _without_poses([*groups, adjustment.residuals[name][views][..., None]], by_pose, used)
    known = 0
    for index in range(len(groups) - 1):
        axes = _axes(left[index] / lengths[index], APART if index else SAME)[0]
        known += axes.shape[1] * (index > 0)
        left = [each - axes @ (axes.T @ each) for each in left]
    return left[-1][:, 0], left[-2], lengths[-1], known


def _without_poses(groups: Sequence[Array], by_pose: Array, used: Mask) -> list[Array]:
    """Columns (views, corners, 2, n) of each group as rows (measurements, n), what the poses explain taken out."""
    zeroed = [np.where(used[..., None, None], group, 0).reshape(len(used), -1, group.shape[-1]) for group in groups]
    poses = np.linalg.qr(np.where(used[..., None, None], by_pose, 0).reshape(len(used), -1, by_pose.shape[-1]))[0]
    left = [group - poses @ (np.swapaxes(poses, 1, 2) @ group) for group in zeroed]
    return [group.reshape(-1, group.shape[-1])[np.repeat(used.ravel(), 2)] for group in left]


def _axes(columns: Array, least: float) -> tuple[Array, Array]:
    """Orthonormal axes (n, k) of the span of columns (n, m), and the matrix (m, k) from coordinates to columns."""
    squares, vectors = np.linalg.eigh(columns.T @ columns)  # far quicker than the columns' own singular values
    kept = squares > least**2
    into = vectors[:, kept] / np.sqrt(squares[kept])
    return columns @ into, into


def parameter_columns(adjustment: Adjustment, name: str, names: Sequence[str]) -> Array:
    """∂pixel/∂parameter (views, corners, 2, n) of intrinsics that the adjustment need not estimate."""
    camera = adjustment.cameras[name]
    points = np.stack([transform(pose, adjustment.corners) for pose in adjustment.first_from_board])
    return pixel_jacobian(camera, points, names)[2]


def robust_sigma(residuals: Array) -> float:
    """σ of one coordinate of normal residuals (..., 2) from the median of their lengths, √(2 ln 2) σ (Rayleigh)."""
    lengths = np.linalg.norm(residuals, axis=-1)
    lengths = lengths[np.isfinite(lengths)]
    return float(np.median(lengths) / np.sqrt(2 * np.log(2))) if len(lengths) else np.nan
