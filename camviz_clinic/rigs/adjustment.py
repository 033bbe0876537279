"""The joint adjustment of a rig: as that of a pair, at a cost that grows with what each camera saw."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import transform
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.arrowhead import Arrowhead
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian
from camviz_clinic.calibration.linearisation import sagittas
from camviz_clinic.calibration.problem import POSE

Indices = NDArray[np.intp]
FRAMES_AT_ONCE = 50
ALONE = 1 - 1e-6  # of what is known of a direction: from here on a frame determines it alone


@dataclass(frozen=True, eq=False)
class Seen:
    """One camera's part of the Jacobian: over the f frames that it has a say in, by its own k parameters alone.

    `frames` (f,) are places among those with a say, `own` (k,) places among the shared parameters. `by_own` is
    (f, m, k), `by_pose` (f, m, 6) and `residuals` (f, m), with rows of 0 for corners without a say.
    """

    frames: Indices
    own: Indices
    by_own: Array
    by_pose: Array
    residuals: Array


@dataclass(frozen=True, eq=False)
class RigAdjustment(Adjustment):
    """`Adjustment` of many cameras of which each sees some of the frames.

    A camera's pixels depend on its own intrinsics, its own place and the board's pose, so that its rows of the Jacobian
    are kept by these alone (Triggs et al. 2000, section 6.1: the board poses are eliminated frame by frame).
    """

    @cached_property
    def parts(self) -> dict[str, Seen]:
        """The Jacobian and the residuals by camera."""
        return {name: self._part(name) for name in self.cameras}

    def _part(self, name: str) -> Seen:
        camera, used = self.cameras[name], self.used[name]
        views = np.flatnonzero(used.any(axis=1))
        own = [*range(len(self.parameters))[self.intrinsics_of(name)]]
        points_first = self.points_first[views]
        points_cam = transform(camera.cam_from_world, points_first)
        _, by_point, by_intrinsics = pixel_jacobian(camera, points_cam, self.estimated[name])
        by_first = by_point @ camera.cam_from_world.rotation.as_matrix()
        columns = [by_intrinsics]
        if place := self.place_of(name):
            own += [*range(len(self.parameters))[place]]
            columns.append(by_point @ twist_jacobian(points_cam))
        if self.warp_place:
            own += [*range(len(self.parameters))[self.warp_place]]
            normals = self.first_from_board[views].rotation.as_matrix()[:, None, :, 2:]
            columns.append((by_first @ normals) * sagittas(self.board)[:, None, :])
        by_own, by_pose = np.concatenate(columns, axis=-1), by_first @ twist_jacobian(points_first)
        residuals = self.residuals[name][views].copy()
        for values in (by_own, by_pose, residuals):
            values[~used[views]] = 0
        rows = (len(views), 2 * used.shape[1])
        among = np.cumsum(self.posed) - 1
        return Seen(
            among[views],
            np.array(own, dtype=int),
            by_own.reshape(*rows, len(own)),
            by_pose.reshape(*rows, len(POSE)),
            residuals.reshape(rows),
        )

    @cached_property
    def normal_equations(self) -> Arrowhead:
        """JᵀJ and Jᵀr over the views that have a say, as `Linearisation` has them."""
        shared, views = len(self.parameters), int(self.posed.sum())
        A, gradient = np.zeros((shared, shared)), np.zeros(shared)
        B, C = np.zeros((views, shared, len(POSE))), np.zeros((views, len(POSE), len(POSE)))
        pose_gradients = np.zeros((views, len(POSE)))
        for part in self.parts.values():
            flat = part.by_own.reshape(part.residuals.size, len(part.own))
            A[np.ix_(part.own, part.own)] += flat.T @ flat
            gradient[part.own] += flat.T @ part.residuals.ravel()
            B[part.frames[:, None], part.own] += np.swapaxes(part.by_own, 1, 2) @ part.by_pose
            C[part.frames] += np.swapaxes(part.by_pose, 1, 2) @ part.by_pose
            pose_gradients[part.frames] += np.einsum("vnm,vn->vm", part.by_pose, part.residuals)
        normal = Arrowhead(A, B, C, gradient, pose_gradients)
        for rows, residuals in self._assumed.values():
            normal = normal.with_shared(rows, residuals)
        return normal

    @cached_property
    def clustered_covariance(self) -> Array:
        """Of the shared `parameters`, (s, s), from how much the frames disagree; never less than by corner noise alone.

        The errors of one frame's corners may go together as they like (a bent board, motion, light): whole frames are
        left out in turn, Cov = (n - 1)/n Σ δᵢ δᵢᵀ, with δᵢ = (H - Hᵢ)⁻¹ gᵢ how far the solution moves without frame i.
        That is the delete-one jackknife, to first order (Bell & McCaffrey 2002, "Bias reduction in standard errors", as
        CR3). What a frame determines alone cannot move so, and has corner noise for its σ. So has every direction in
        which few frames happen to agree better than their corners are found.
        """
        normal = self.normal_equations
        scale, root = _inverse_root(normal.information)
        moves = np.concatenate([root @ self._left_out(rows, root / scale[:, None]) for rows in self._chunks()], axis=-1)
        n = moves.shape[-1]
        scatter = (n - 1) / n * moves @ moves.T / np.outer(scale, scale)
        return _at_least(scatter, self.covariance)

    def _chunks(self) -> list[Indices]:
        views = int(self.posed.sum())
        return [np.arange(start, min(start + FRAMES_AT_ONCE, views)) for start in range(0, views, FRAMES_AT_ONCE)]

    def _left_out(self, frames: Indices, whitening: Array) -> Array:
        """(1 - Kᵢ)⁻¹ W gᵢ, (s, frames), with K = W Hᵢ Wᵀ, where W takes the information H to 1."""
        normal = self.normal_equations
        H = np.zeros((len(frames), len(self.parameters), len(self.parameters)))
        g = np.zeros((len(frames), len(self.parameters)))
        for part in self.parts.values():
            here = (part.frames >= frames[0]) & (part.frames <= frames[-1])
            by_own, place = part.by_own[here], part.frames[here] - frames[0]
            H[place[:, None, None], part.own[:, None], part.own] += np.swapaxes(by_own, 1, 2) @ by_own
            g[place[:, None], part.own] += np.einsum("vnk,vn->vk", by_own, part.residuals[here])
        W, B = normal.pose_response[frames], normal.border[frames]
        H -= B @ W
        g -= np.einsum("vms,vm->vs", W, normal.gradients[frames])
        values, vectors = np.linalg.eigh(whitening.T @ H @ whitening)
        amplified = np.where(values < ALONE, 1 / (1 - np.minimum(values, ALONE)), 0)
        along = np.einsum("vsk,vs->vk", vectors, g @ whitening)
        return np.einsum("vsk,vk->sv", vectors, amplified * along)


def _inverse_root(information: Array) -> tuple[Array, Array]:
    """The scale d (s,) and R (s, s) with H⁻¹ = D⁻¹ R Rᵀ D⁻¹, H being D X D with a diagonal of 1 in X."""
    scale = np.sqrt(np.diag(information))
    scale = np.where(scale > 0, scale, 1)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    floor = len(values) * np.finfo(float).eps * max(values[-1], 1)
    return scale, vectors / np.sqrt(np.maximum(values, floor))


def _at_least(scatter: Array, least: Array) -> Array:
    """The smallest covariance above both in the directions in which the two are diagonal together."""
    scale = np.sqrt(np.diag(least))
    root = np.linalg.cholesky(least / np.outer(scale, scale) + 1e-14 * np.eye(len(least)))
    half = np.linalg.solve(root, scatter / np.outer(scale, scale))
    values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    wide = root @ vectors * np.sqrt(np.maximum(values, 1))
    return np.asarray(wide @ wide.T * np.outer(scale, scale))
