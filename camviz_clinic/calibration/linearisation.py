"""A calibration's problem to first order: its Jacobian, its normal equations, and the covariances they give."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from camviz.cameras import transform
from camviz.lenses.base import Array
from camviz_clinic.calibration.arrowhead import Arrowhead
from camviz_clinic.calibration.clustered import FEWEST_VIEWS, ByView
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian
from camviz_clinic.calibration.model_choice import unconditional, weight_of_more
from camviz_clinic.calibration.problem import POSE, Problem
from camviz_clinic.calibration.types import Board

FEWEST_FOR_A_BEND = 6  # views: the scatter of fewer is a guess
TOLD = 0.01  # of the board's length, the largest σ with which views tell its bend


@dataclass(frozen=True, eq=False)
class Linearisation(Problem):
    """The problem near its own cameras and poses, where a pixel is a linear function of the parameters.

    `covariance` is by the scatter of the views (`ByView`) and by whether the board is flat, and so is all that follows
    from it, unless the problem has `independent_corners` or a `certain_board`. What the noise of corners alone would
    give is `corner_covariance`.

    The covariances of poses are those of their twists. A prior counts in them as what it is, a measurement that nobody
    made: they are Bayes' for a lens drawn from it, σ² (JᵀJ + PᵀP)⁻¹ with P of the prior's rows, which is the scatter of
    repeated calibrations and the mean square of the pull. mrcal takes the scatter alone, which for a strong prior goes
    to 0. `held_by_priors` says how many parameters are assumed so, and not measured.
    """

    @cached_property
    def normal_equations(self) -> Arrowhead:
        """JᵀJ and Jᵀr over the views that have a say, J being the derivative of the *projected* corners."""
        parts = [Arrowhead.of(*self._measured(name)) for name in self.cameras]
        normal = sum(parts[1:], start=parts[0])
        for rows, residuals in self._assumed.values():
            normal = normal.with_shared(rows, residuals)
        return normal

    @cached_property
    def _assumed(self) -> dict[str, tuple[Array, Array]]:
        """By camera, the prior's derivative (n, s) by the shared parameters and its residuals (n,), in pixels."""
        assumed = {}
        for name, prior in self.at_work.items():
            by_intrinsics, residuals = prior.rows(self.cameras[name].lens, self.estimated[name])
            rows = np.zeros((len(residuals), len(self.parameters)))
            rows[:, self.intrinsics_of(name)] = by_intrinsics
            assumed[name] = rows, residuals
        return assumed

    def _measured(self, name: str) -> tuple[Array, Array, Array]:
        """Camera `name`'s J by the shared parameters and by the poses, and its r; zero where a corner has no say."""
        by_shared, by_pose = self.jacobian(name)
        views, unused = self.posed, ~self.used[name][self.posed]
        residuals = self.residuals[name][views].copy()
        for values in (by_shared, by_pose, residuals):
            values[unused] = 0
        rows = (int(views.sum()), 2 * unused.shape[1])
        return by_shared.reshape(*rows, by_shared.shape[-1]), by_pose.reshape(*rows, len(POSE)), residuals.reshape(rows)

    def jacobian(self, name: str) -> tuple[Array, Array]:
        """How camera `name`'s pixels follow the parameters, over the views that have a say.

        By the shared ones, (views, corners, 2, s), and by the view's own twist, (views, corners, 2, 6).
        """
        camera, points_first = self.cameras[name], self.points_first[self.posed]
        points_cam = transform(camera.cam_from_world, points_first)
        _, by_point, by_intrinsics = pixel_jacobian(camera, points_cam, self.estimated[name])
        by_first = by_point @ camera.cam_from_world.as_matrix()[:3, :3]
        by_shared = np.zeros((*points_cam.shape[:-1], 2, len(self.parameters)))
        by_shared[..., self.intrinsics_of(name)] = by_intrinsics
        if place := self.place_of(name):
            by_shared[..., place] = by_point @ twist_jacobian(points_cam)
        if self.warp_place:
            normals = self.first_from_board.as_matrix()[self.posed, None, :3, 2:3]
            by_shared[..., self.warp_place] = (by_first @ normals) * sagittas(self.board)[:, None, :]
        return by_shared, by_first @ twist_jacobian(points_first)

    # What it says

    @property
    def sigma(self) -> float:
        """The standard deviation in pixels of one coordinate of a detected corner: σ² = ‖x‖²/(N - k).

        k is less by what the priors hold of the parameters (mrcal's formulation.org has that trace, and neglects it).
        NaN where there are no more measurements than parameters.
        """
        left = self.measurements - self.unknowns + sum(self.held_by_priors.values())
        return float(np.sqrt(self.sum_of_squares / left)) if left > 0 else np.nan

    @cached_property
    def held_by_priors(self) -> dict[str, float]:
        """How many of a camera's parameters its prior determines, and not the corners: tr P (JᵀJ + PᵀP)⁻¹ Pᵀ."""
        return {
            name: float(np.einsum("ns,st,nt->", rows, self.normal_equations.covariance, rows))
            for name, (rows, _) in self._assumed.items()
        }

    @cached_property
    def corner_covariance(self) -> Array:
        """σ² (JᵀJ)⁻¹ of the shared `parameters`, (s, s), the poses being free to follow: by the noise of corners alone.

        It is what programs print, and too small where the corners of a view are not independent: see `covariance`.
        """
        return self.sigma**2 * self.normal_equations.covariance

    @cached_property
    def clustered_covariance(self) -> Array:
        """Of the shared `parameters`, (s, s), by the scatter of the views; of fewer than three, `corner_covariance`.

        The board counts as flat, or as bent, as the problem has it.
        """
        if self.independent_corners or self.posed.sum() < FEWEST_VIEWS or not np.isfinite(self.sigma):
            return self.corner_covariance
        return self.by_view.covariance(self.sigma)

    @cached_property
    def covariance(self) -> Array:
        """`clustered_covariance`, and what six views or more leave open: whether the board is flat (`unconditional`).

        One step leads to the solution with the other board: the problem is linear over so small a bend. Views that
        do not tell a bend to a hundredth of the board's length say nothing about it.
        """
        certain = self.independent_corners or self.certain_board
        if certain or self.posed.sum() < FEWEST_FOR_A_BEND or not self.parameters:
            return self.clustered_covariance
        if self.warp is None:
            bent, s = replace(self, warp=np.zeros(2)), len(self.parameters)  # the bend is last among the parameters
            if not np.diag(bent.clustered_covariance)[s:].max() < (TOLD * self.board.length) ** 2:
                return self.clustered_covariance
            other, change = bent.clustered_covariance[:s, :s], bent.normal_equations.solution()[0][:s]
            return unconditional(self.clustered_covariance, other, change, bent._weight_of_bend)
        flat = replace(self, warp=None)
        other, change = np.pad(flat.clustered_covariance, (0, 2)), flat.normal_equations.solution()[0]
        return unconditional(self.clustered_covariance, other, np.append(change, -self.warp), 1 - self._weight_of_bend)

    @property
    def _weight_of_bend(self) -> float:
        return weight_of_more(self.bend_statistic, int(self.posed.sum()), parameters=2)

    @cached_property
    def bend_statistic(self) -> float:
        """Hotelling's T² of the board's two sagittas by the scatter of the views: wᵀ V⁻¹ w, one step from here.

        NaN where nothing tells V: there are no more measurements than unknowns.
        """
        place = self.warp_place
        if self.warp is None or place is None:
            return replace(self, warp=np.zeros(2)).bend_statistic
        warp = self.warp + self.normal_equations.solution()[0][place]
        return float(warp @ np.linalg.pinv(self.clustered_covariance[place, place], hermitian=True) @ warp)

    @cached_property
    def by_corners(self) -> Self:
        """The same problem, whose covariances are those of the corners' noise alone."""
        return replace(self, independent_corners=True)

    @cached_property
    def by_view(self) -> ByView:
        """What every view that has a say asks of the shared parameters, and what priors do."""
        normal, s = self.normal_equations, len(self.parameters)
        own, along = np.zeros((int(self.posed.sum()), s, s)), np.zeros((int(self.posed.sum()), s))
        for name in self.cameras:
            by_shared, _, residuals = self._measured(name)
            own += np.swapaxes(by_shared, 1, 2) @ by_shared
            along += np.einsum("vns,vn->vs", by_shared, residuals)
        information = own - normal.border @ normal.pose_response
        gradient = along - np.einsum("vms,vm->vs", normal.pose_response, normal.gradients)
        return ByView(information, gradient, *self.by_priors)

    @property
    def by_priors(self) -> tuple[Array, Array]:
        """What priors add to JᵀJ (s, s) and Jᵀr (s,) of the shared parameters."""
        s = len(self.parameters)
        assumed, pull = np.zeros((s, s)), np.zeros(s)
        for rows, expected in self._assumed.values():
            assumed, pull = assumed + rows.T @ rows, pull + rows.T @ expected
        return assumed, pull

    def intrinsics_covariance(self, name: str) -> Array:
        """Of the `estimated` intrinsics of camera `name`, (n, n)."""
        place = self.intrinsics_of(name)
        return self.covariance[place, place]

    @property
    def warp_covariance(self) -> Array | None:
        """Of the board's two sagittas, (2, 2) in metres squared, by the scatter of the views; None for a flat board."""
        place = self.warp_place
        return None if place is None else self.clustered_covariance[place, place]

    @cached_property
    def pose_covariance(self) -> Array:
        """Of every view's twist, (views, 6, 6), radians and metres; NaN for a view without a say.

        A pose follows the shared parameters, and has the noise of its own corners.
        """
        normal = self.normal_equations
        covariance = np.full((self.views, len(POSE), len(POSE)), np.nan)
        follows = normal.pose_response @ self.covariance @ np.swapaxes(normal.pose_response, 1, 2)
        covariance[self.posed] = self.sigma**2 * normal.block_inverses + follows
        return covariance

    @cached_property
    def cross_covariance(self) -> Array:
        """Between every view's twist and the shared parameters, (views, 6, s); NaN for a view without a say."""
        covariance = np.full((self.views, len(POSE), len(self.parameters)), np.nan)
        covariance[self.posed] = -self.normal_equations.pose_response @ self.covariance
        return covariance

    @cached_property
    def mean_twist_covariance(self) -> Array:
        """Of the shared parameters and the mean of all views' twists together, (s + 6, s + 6)."""
        return self.joined_with_mean_twist(self.covariance)

    def joined_with_mean_twist(self, shared: Array) -> Array:
        """`mean_twist_covariance` if the shared parameters had the covariance `shared` (s, s).

        With Wᵢ and Cᵢ of `Arrowhead`, a twist is -Wᵢ δ and noise of covariance σ² Cᵢ⁻¹ that is its own. The mean of n:
        -W̄ δ, and noise of covariance σ² Σ Cᵢ⁻¹/n².
        """
        normal = self.normal_equations
        follow = np.concatenate([np.eye(len(self.parameters)), -normal.pose_response.mean(axis=0)])
        covariance = follow @ shared @ follow.T
        own = normal.block_inverses.mean(axis=0) / len(normal.block_inverses)
        covariance[-len(POSE) :, -len(POSE) :] += self.sigma**2 * own
        return np.asarray(covariance)


def sagittas(board: Board) -> Array:
    """How far a corner rises by a sagitta of one along x and along y, (corners, 2)."""
    return np.stack([board.warped((1, 0))[:, 2], board.warped((0, 1))[:, 2]], axis=-1)
