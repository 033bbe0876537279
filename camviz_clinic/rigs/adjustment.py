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
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.calibration.clustered import ByView
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian
from camviz_clinic.calibration.linearisation import sagittas
from camviz_clinic.calibration.problem import POSE

Indices = NDArray[np.intp]


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

    What are views elsewhere are frames here: moments of the whole rig, whose scatter gives the `covariance`. Its board
    counts as solved (`certain_board`): so its ± was measured, and several boards have no bend.
    """

    certain_board: bool = True

    @property
    def fewest(self) -> int:
        """Corners that a view must keep to be believed."""
        return min(FEWEST, len(self.board.corners))

    @property
    def boards(self) -> tuple[slice, ...]:
        """Which corners are those of one board, which is found or mistaken as a whole."""
        return (slice(None),)

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
    def by_view(self) -> ByView:
        """What every frame that has a say asks of the shared parameters, and what priors do.

        A frame that alone ties a camera to the others cannot be left out: there the covariance is by corners' noise.
        """
        normal, shape = self.normal_equations, (int(self.posed.sum()), len(self.parameters))
        information, gradient = np.zeros((*shape, shape[1])), np.zeros(shape)
        for part in self.parts.values():
            by_own, rows = part.by_own, part.frames[:, None]
            information[rows[..., None], part.own[:, None], part.own] += np.swapaxes(by_own, 1, 2) @ by_own
            gradient[rows, part.own] += np.einsum("vnk,vn->vk", by_own, part.residuals)
        information -= normal.border @ normal.pose_response
        gradient -= np.einsum("vms,vm->vs", normal.pose_response, normal.gradients)
        return ByView(information, gradient, *self.by_priors, alone=1)
