"""A camera that reads its image row by row while the board moves: its adjustment with the board's path in time."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import Rotation
from camviz_clinic.calibration.arrowhead import Arrowhead
from camviz_clinic.calibration.clustered import FEWEST_VIEWS, ByView
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.jacobian import parameter, pixel_jacobian, twist_jacobian, with_parameters
from camviz_clinic.calibration.linearisation import sagittas
from camviz_clinic.calibration.trajectory import Trajectory, left_jacobian
from camviz_clinic.calibration.types import Board, Mask

BY_ROWS = (0.0, 1.0)  # the direction in which the image is read
MOST_STEPS = 40
SETTLED = 1e-7  # of the sum of squares, what a step must still promise to take off: of 10,000 corners 0.002 σ²


@dataclass(frozen=True, eq=False)
class RollingAdjustment:
    """A least-squares problem: a camera, its line delay, and the pieces of the board's path.

    A corner that was seen in row v is projected with the board's pose at its frame's time + delay (v - middle row).
    The row is the observed one: a corner's noise shifts its time by noise × delay, which moves it by a hundredth of
    that noise or less. Two pieces of the path share no parameter, so that the normal equations are an `Arrowhead`.

    Args:
        board, camera: What is seen, and by what.
        estimated: The intrinsics that are free.
        trajectory: The board's path.
        times: (pieces, frames), of each frame's middle row, in seconds; NaN where a piece has fewer frames.
        detections: (pieces, frames, corners, 2), in pixels, NaN where a corner was not seen.
        line_delay: From one row to the next, in seconds.
        delay_free: Whether it is solved for.
        set_aside: (pieces, frames, corners) of bool, corners that have no say.
        warp: (2,), the board's sagittas in metres, which are then free; None for a flat board.
        prior: What is assumed of the lens.
        direction: (2,), in which the image is read, along u and v; rows unless given.
    """

    board: Board
    camera: Camera
    estimated: tuple[str, ...]
    trajectory: Trajectory
    times: Array = field(repr=False)
    detections: Array = field(repr=False)
    line_delay: float = 0.0
    delay_free: bool = True
    set_aside: Mask | None = field(default=None, repr=False)
    warp: Array | None = None
    prior: DenominatorPrior | None = None
    direction: tuple[float, float] = BY_ROWS

    # The measurements

    @cached_property
    def lines(self) -> Array:
        """How many lines after the middle one each corner was read, (pieces, frames, corners)."""
        grid = self.camera.intrinsics
        middle = np.array([grid.width - 1, grid.height - 1]) / 2
        return np.asarray(np.nan_to_num(self.detections - middle) @ np.array(self.direction))

    @cached_property
    def corners(self) -> Array:
        """The board's corners (corners, 3) in its own frame, bent by the warp."""
        return self.board.corners if self.warp is None else self.board.warped(self.warp)

    @cached_property
    def read_at(self) -> Array:
        """When each corner was read, (pieces, frames, corners), in seconds."""
        times = np.where(np.isfinite(self.times), self.times, self.trajectory.begin[:, None])
        return np.asarray(times[..., None] + self.line_delay * self.lines)

    @cached_property
    def _weights(self) -> Array:
        return self.trajectory.weights(self.read_at)

    @cached_property
    def _turned(self) -> Array:
        """Rᵢ (p - m), (pieces, 1, corners, 3)."""
        about = self.corners - self.trajectory.middle
        return np.asarray((about @ np.swapaxes(self.trajectory.turned.as_matrix(), 1, 2))[:, None])

    @cached_property
    def _placed(self) -> tuple[Array, Array, Array]:
        """ω, exp(ω) Rᵢ (p - m) and the corners before the camera, (pieces, frames, corners, 3)."""
        omega, tau = self.trajectory.poses(self._weights)
        turn = Rotation.from_rotvec(omega.reshape(-1, 3))
        turned = turn.apply(np.broadcast_to(self._turned, omega.shape).reshape(-1, 3)).reshape(omega.shape)
        return omega, turned, turned + tau

    @cached_property
    def residuals(self) -> Array:
        """Detected less projected, in pixels (pieces, frames, corners, 2); NaN where a corner was not seen."""
        return self.detections - self.camera.project(self._placed[2])

    @cached_property
    def used(self) -> Mask:
        """Which corners (pieces, frames, corners) have a say: those with an image that were read within their piece."""
        at, path = self.read_at, self.trajectory
        there = np.isfinite(self.residuals).all(axis=-1)
        there &= (at >= path.begin[:, None, None]) & (at <= path.end[:, None, None])
        return there if self.set_aside is None else there & ~self.set_aside

    @property
    def measurements(self) -> int:
        """N, two for every corner that has a say."""
        return 2 * int(self.used.sum())

    @property
    def unknowns(self) -> int:
        """k, how many numbers are solved for."""
        return len(self.parameters) + self.trajectory.control.size

    @cached_property
    def sum_of_squares(self) -> float:
        """‖x‖², over the corners that have a say."""
        return float(np.sum(self.residuals[self.used] ** 2))

    @property
    def cost(self) -> float:
        """‖x‖² and what the prior adds to it."""
        return self.sum_of_squares + (self.prior.cost(self.camera.lens) if self.prior else 0.0)

    @property
    def sigma(self) -> float:
        """The standard deviation in pixels of one coordinate of a corner: σ² = ‖x‖²/(N - k)."""
        left = self.measurements - self.unknowns
        return float(np.sqrt(self.sum_of_squares / left)) if left > 0 else np.nan

    # The parameters

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of what all pieces share: the intrinsics, "line_delay", "warp_x", "warp_y"."""
        return (
            *self.estimated,
            *(("line_delay",) if self.delay_free else ()),
            *(() if self.warp is None else ("warp_x", "warp_y")),
        )

    def jacobian(self) -> tuple[Array, Array]:
        """How pixels follow the shared parameters, (pieces, frames, corners, 2, s), and ω and τ, (..., 2, 6)."""
        omega, turned, placed = self._placed
        _, by_point, by_intrinsics = pixel_jacobian(self.camera, placed, self.estimated)
        by_pose = by_point @ twist_jacobian(turned)
        by_pose[..., :3] = by_pose[..., :3] @ left_jacobian(omega)
        by_shared = np.zeros((*placed.shape[:-1], 2, len(self.parameters)))
        by_shared[..., : len(self.estimated)] = by_intrinsics
        if self.delay_free:
            weights = self.trajectory.weights(self.read_at, derivative=True)
            speed = np.concatenate(self.trajectory.poses(weights), axis=-1)
            along = (by_pose @ speed[..., None])[..., 0]
            by_shared[..., len(self.estimated)] = along * self.lines[..., None]
        if self.warp is not None:
            normals = Rotation.from_rotvec(omega.reshape(-1, 3)).as_matrix().reshape(*omega.shape, 3)
            normals = normals @ self.trajectory.turned.as_matrix()[:, None, None, :, 2:]
            by_shared[..., -2:] = (by_point @ normals) * sagittas(self.board)[:, None, :]
        return by_shared, by_pose

    @cached_property
    def _measured(self) -> tuple[Array, Array, Array]:
        """J by the shared parameters and by each piece's own, and r; zero where a corner has no say."""
        by_shared, by_pose = self.jacobian()
        residuals = self.residuals.copy()
        for values in (by_shared, by_pose, residuals):
            values[~self.used] = 0
        pieces, n = len(by_pose), self.trajectory.control.shape[1]
        by_piece = by_pose[..., None, :] * self._weights[..., None, :, None]
        rows = (pieces, residuals[0].size)
        return (
            by_shared.reshape(*rows, by_shared.shape[-1]),
            by_piece.reshape(*rows, 6 * n),
            residuals.reshape(rows),
        )

    @cached_property
    def normal_equations(self) -> Arrowhead:
        """JᵀJ and Jᵀr, J being the derivative of the projected corners."""
        normal = Arrowhead.of(*self._measured)
        return normal if self.prior is None else normal.with_shared(*self._assumed)

    @property
    def _assumed(self) -> tuple[Array, Array]:
        assert self.prior is not None
        by_intrinsics, residuals = self.prior.rows(self.camera.lens, self.estimated)
        rows = np.zeros((len(residuals), len(self.parameters)))
        rows[:, : len(self.estimated)] = by_intrinsics
        return rows, residuals

    # The solution

    def refined(self, settled: float = SETTLED) -> RollingAdjustment:
        """At the nearest least sum of squares (Levenberg–Marquardt)."""
        here, damping = self, 1e-3
        for _ in range(MOST_STEPS):
            normal = here.normal_equations
            shared, own = normal.damped(damping).solution()
            promised = shared @ normal.shared_gradient + np.sum(own * normal.gradients)
            if not promised > settled * here.sum_of_squares:
                break
            there = here._moved(shared, own)
            if there is not None and there.cost <= here.cost:
                here, damping = there, damping / 10
            elif damping < 1e12:
                damping *= 2
            else:
                break
        return here

    def _moved(self, shared: Array, own: Array) -> RollingAdjustment | None:
        """With changed parameters; None where a lens does not take them or a corner in use loses its say."""
        names = self.estimated
        values = {name: parameter(self.camera, name) + change for name, change in zip(names, shared, strict=False)}
        try:
            camera = with_parameters(self.camera, values)
        except ValueError:
            return None
        there = replace(
            self,
            camera=camera,
            trajectory=self.trajectory.moved(own.reshape(self.trajectory.control.shape)),
            line_delay=self.line_delay + float(shared[len(names)]) if self.delay_free else self.line_delay,
            warp=None if self.warp is None else self.warp + shared[-2:],
        )
        return there if there.used[self.used].all() else None

    # What it says

    @cached_property
    def covariance(self) -> Array:
        """Of the shared `parameters`, (s, s), by the scatter of the pieces; of fewer than three, by noise alone."""
        if len(self.times) < FEWEST_VIEWS:
            return self.corner_covariance
        return self.by_piece.covariance(self.sigma)

    @property
    def corner_covariance(self) -> Array:
        """σ² (JᵀJ)⁻¹ of the shared `parameters`, (s, s), by the noise of corners alone."""
        return self.sigma**2 * self.normal_equations.covariance

    @property
    def by_piece(self) -> ByView:
        """What each piece asks of the shared parameters, its path free to follow, and what the prior does."""
        normal, s = self.normal_equations, len(self.parameters)
        by_shared, _, residuals = self._measured
        own = np.swapaxes(by_shared, 1, 2) @ by_shared - normal.border @ normal.pose_response
        along = np.einsum("pns,pn->ps", by_shared, residuals)
        along -= np.einsum("pms,pm->ps", normal.pose_response, normal.gradients)
        if self.prior is None:
            return ByView(own, along, np.zeros((s, s)), np.zeros(s))
        rows, expected = self._assumed
        return ByView(own, along, rows.T @ rows, rows.T @ expected)

    def deviation(self, name: str) -> float:
        """The standard deviation of one of the `parameters`."""
        place = self.parameters.index(name)
        return float(np.sqrt(self.covariance[place, place]))

    @property
    def all_at_once(self) -> Array:
        """Where the corners had been seen if all rows were read with the middle one, (pieces, frames, corners, 2)."""
        still = replace(self, line_delay=0.0)
        return self.residuals + still.camera.project(still._placed[2])
