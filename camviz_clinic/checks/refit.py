"""A camera that is held as it was calibrated, and the same camera solved anew from new views of a board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri, fdtrc

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.detection import seen
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.identifiability import undecided
from camviz_clinic.calibration.jacobian import PINHOLE, parameter, pixel_jacobian, twist_jacobian
from camviz_clinic.calibration.types import Board, Mask
from camviz_clinic.checks.fields import smooth_field
from camviz_clinic.checks.observed import Observed, explained
from camviz_clinic.checks.rig import board_poses
from camviz_clinic.checks.view_by_view import ViewByView

SURE = 0.99  # of "surely": how often the true change lies within the bounds
GRID = (60, 40)  # of pixels over the image, as `--compare` has it


@dataclass(frozen=True, eq=False)
class Refit:
    """The corners of new views under a camera as it was calibrated (`held`), and under one that follows them (`free`).

    Both have the same corners, the board's poses and the board's bend free. `free` also has the focal lengths, the
    principal point and the first coefficient of the lens: what a knock or another focus changes.
    """

    name: str
    held: Adjustment
    free: Adjustment

    @classmethod
    def of(cls, name: str, camera: Camera, board: Board, corners: Array) -> Refit:
        """Of pixels (views, corners, 2). Corners that are far out under both are set aside."""
        alone = Camera(camera.intrinsics, camera.lens)
        names = (*(key for key in PINHOLE if key != "skew"), *camera.lens.parameters()[:1])
        start = board_poses(alone, board, corners)
        begun = Adjustment(board, {name: alone}, {name: corners}, start, {name: names}, warp=np.zeros(2))
        free = Observed(name, begun).best
        return cls(name, replace(free, cameras={name: alone}, estimated={name: ()}).refined(), free)

    @property
    def camera(self) -> Camera:
        """The camera as it was calibrated."""
        return self.held.cameras[self.name]

    @property
    def used(self) -> Mask:
        """Which corners (views, corners) have a say."""
        return self.held.used[self.name]

    @property
    def views(self) -> int:
        """How many views have a say."""
        return int(self.held.posed.sum())

    @cached_property
    def corners(self) -> Array:
        """The pixels (n, 2) of those corners."""
        return self.held.detections[self.name][self.used]

    @property
    def set_aside(self) -> float:
        """The share of corners that fit neither."""
        return float(1 - self._kept.sum() / max(seen(self.free.detections[self.name]).sum(), 1))

    @property
    def without_image(self) -> float:
        """The share of corners that are seen where the calibrated camera has no image, such as beyond a fold."""
        return float((self._kept & ~seen(self.held.residuals[self.name])).sum() / max(self._kept.sum(), 1))

    @property
    def _kept(self) -> Mask:
        """Which corners (views, corners) were seen and not set aside."""
        there = seen(self.free.detections[self.name])
        return there & ~self.free.set_aside[self.name] if self.name in self.free.set_aside else there

    @property
    def sigma(self) -> float:
        """The standard deviation in pixels of a coordinate under the calibrated camera: √(‖x‖²/(N - k)).

        k counts six for each pose, which takes that much of the misfit away, and two for the board's bend.
        """
        return self.held.sigma

    @cached_property
    def F(self) -> float:
        """((S₀ - S₁)/p) / (S₁/(N - k)): what p parameters take off the sum of squares, over the noise."""
        count = self.free.unknowns - self.held.unknowns
        fallen = self.held.sum_of_squares - self.free.sum_of_squares
        return max(fallen, 0.0) / count / self.free.sigma**2

    @property
    def chance(self) -> float:
        """How often independent Gaussian noise gives an F as large as this one."""
        count = self.free.unknowns - self.held.unknowns
        return float(fdtrc(count, self.free.measurements - self.free.unknowns, self.F))

    @cached_property
    def scatter(self) -> float:
        """How much more the views differ than their noise lets expect (`ViewByView.scatter`)."""
        return ViewByView.of(self.free).scatter

    @property
    def covariance(self) -> Array:
        """Of the parameters that were solved anew (n, n), by the scatter from view to view."""
        return self.scatter * self.free.by_corners.intrinsics_covariance(self.name)

    @cached_property
    def shifts(self) -> Array:
        """How far (m,) far points move in pixels, in u and v, once the turn that hides most of it is taken out.

        Divided by √(points), so that their squares add up to the mean square.
        """
        return self._columns @ self._delta

    @property
    def lengths(self) -> Array:
        """The same as distances (points,) in pixels."""
        pairs = self.shifts.reshape(-1, 2)
        return np.linalg.norm(pairs, axis=-1) * np.sqrt(len(pairs))

    @cached_property
    def pattern(self) -> float:
        """What a smooth field over the image still explains, RMS px over the corners: changes of another kind."""
        return explained(self.free, self.name, smooth_field(self.free, self.name)).pixels

    @property
    def change(self) -> float:
        """How far the calibrated camera is off, RMS px over the image: what solving anew changes, and `pattern`."""
        return float(np.hypot(np.linalg.norm(self.shifts), self.pattern))

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """Between what the true change lies, `SURE` of the time."""
        least, most = bounds(self._columns, self.shifts, self.covariance)
        return float(np.hypot(least, self.pattern)), float(np.hypot(most, self.pattern))

    @property
    def noise(self) -> float:
        """The change in pixels that chance alone may show, `SURE` of the time."""
        return reach(self._columns, self.covariance)

    @property
    def _delta(self) -> Array:
        """What solving anew adds to the parameters, (n,)."""
        return np.array([now - was for was, now, _ in self.values().values()])

    @cached_property
    def _columns(self) -> Array:
        return far_columns(self.free.cameras[self.name], self.free.estimated[self.name])

    def explained_by(self, names: Sequence[str], covariance: Array | None) -> bool:
        """Whether chance and an error of the calibration, of a covariance (n, n), may make up all of the change.

        Not where the covariance is unknown. The error of parameters that are not solved for anew shows in those that
        are, as far as these can follow it.
        """
        if covariance is None:
            return False
        follow = np.linalg.lstsq(self._columns, far_columns(self.free.cameras[self.name], names), rcond=None)[0]
        total = self.covariance + follow @ covariance @ follow.T
        return bool(self._delta @ np.linalg.solve(total, self._delta) < chdtri(len(total), 1 - SURE))

    @cached_property
    def undecided(self) -> tuple[str, ...]:
        """Parameters that the new views do not decide, so that solving anew tells no ± of them."""
        found = undecided(self.free, self.name, self.free.by_corners.sigma)
        return tuple(dict.fromkeys(key for each in found for key in each.changes))

    def values(self) -> dict[str, tuple[float, float, float]]:
        """By parameter: as calibrated, as solved anew, and the standard deviation of the latter."""
        sigmas = np.sqrt(np.maximum(np.diag(self.covariance), 0))
        anew = self.free.cameras[self.name]
        return {
            key: (parameter(self.camera, key), parameter(anew, key), float(sigma))
            for key, sigma in zip(self.free.estimated[self.name], sigmas, strict=True)
        }


def far_columns(camera: Camera, names: Sequence[str]) -> Array:
    """∂pixel/∂parameter (m, n) of far points over the image, less what a turn of the camera makes up for.

    Divided by √(points), so that |A δ| is the RMS distance that a change δ of the parameters makes.
    """
    uv = pixel_grid(camera.intrinsics, GRID).reshape(-1, 2)
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(uv))
    rays = rays[np.isfinite(rays).all(axis=-1)]
    _, by_ray, by_parameter = pixel_jacobian(camera, rays, names)
    known = np.isfinite(by_ray).all(axis=(1, 2)) & np.isfinite(by_parameter).all(axis=(1, 2))
    columns = by_parameter[known].reshape(-1, len(names)) / np.sqrt(known.sum())
    turns = np.linalg.qr((by_ray[known] @ twist_jacobian(rays[known])[..., :3]).reshape(-1, 3))[0]
    return np.asarray(columns - turns @ (turns.T @ columns))


def bounds(columns: Array, found: Array, covariance: Array) -> tuple[float, float]:
    """Between what |found + A δ| lies, `SURE` of the time either way: columns A (m, n), δ of a covariance (n, n).

    They are its extremes over an ellipsoid of δ. To be above the greatest, the truth must lie beyond a plane that far
    off: the ellipsoid has the quantile of a normal distribution. To be below the least it may lie to any side, and the
    quantile is that of `_likely`.
    """
    into, squares, radius = _likely(columns, covariance)
    if not squares[-1] > 0:
        return float(np.linalg.norm(found)), float(np.linalg.norm(found))
    along = into.T @ found
    along = np.where(np.abs(along) > 1e-9 * squares[-1], along, 1e-9 * squares[-1])  # at a saddle, to one side of it

    def extreme(sign: float, radius: float) -> float:
        """At the z on the sphere with (Λ - sign μ) z = -along, by bisection of μ (Moré & Sorensen 1983)."""
        low = float(squares[-1]) if sign > 0 else 0.0
        high = low + float(np.linalg.norm(along)) / radius
        for _ in range(100):
            middle = (low + high) / 2
            outside = np.linalg.norm(along / (squares - sign * middle)) > radius
            low, high = (middle, high) if outside else (low, middle)
        return float(np.linalg.norm(found - into @ (along / (squares - sign * high))))

    inside = np.linalg.norm(along / squares) <= radius
    return 0.0 if inside else extreme(-1, radius), extreme(1, float(np.sqrt(chdtri(1, 2 * (1 - SURE)))))


def reach(columns: Array, covariance: Array) -> float:
    """What |A δ| does not exceed `SURE` of the time, or more often."""
    _, squares, radius = _likely(columns, covariance)
    return float(radius * np.sqrt(squares[-1]))


def _likely(columns: Array, covariance: Array) -> tuple[Array, Array, float]:
    """Columns B (m, n) at right angles with B Bᵀ = A Σ Aᵀ, their squared lengths λ, and the radius of likely z.

    |A δ|² = |B z|² = Σ λ χ²₁ has the mean and the variance of a multiple of χ²_h, h = (Σ λ)²/Σ λ² (Satterthwaite 1946):
    the radius is the quantile of as many dimensions.
    """
    variances, axes = np.linalg.eigh(covariance)
    into = columns @ (axes * np.sqrt(np.maximum(variances, 0)))
    squares, axes = np.linalg.eigh(into.T @ into)
    squares = np.maximum(squares, squares[-1] * np.finfo(float).eps)
    dimensions = squares.sum() ** 2 / np.sum(squares**2) if squares[-1] > 0 else 1.0
    return into @ axes, squares, float(np.sqrt(chdtri(dimensions, 1 - SURE)))
