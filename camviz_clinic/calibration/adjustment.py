"""The joint adjustment of a calibration: cameras, board poses and the board's own bend, by least squares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.jacobian import parameter, with_parameters
from camviz_clinic.calibration.linearisation import Linearisation
from camviz_clinic.calibration.problem import POSE
from camviz_clinic.calibration.types import Mask

MOST_STEPS = 100
SETTLED = 1e-12  # of the sum of squares, what a step must still promise to take off
ALL_BUT_FREE = 1e-9  # a damping that changes no step that is well determined


@dataclass(frozen=True, eq=False)
class Adjustment(Linearisation):
    """A calibration's problem that can be solved: `refined` is the same problem at its least sum of squares.

    `Problem` says what is measured and what is free, `Linearisation` what the measurements determine and how well.
    """

    def refined(
        self, *, only_poses: bool = False, settled: float = SETTLED, most_steps: int = MOST_STEPS
    ) -> Adjustment:
        """The problem at the nearest least sum of squares (Levenberg–Marquardt), moving all parameters or only poses.

        It ends after `most_steps`, or when a step would lessen the sum by a share of less than `settled`. A corner that
        has an image at the start keeps one: a step that would carry it beyond a fold is shortened.
        """
        here, damping = replace(self, estimated=dict.fromkeys(self.cameras, ())) if only_poses else self, 1e-3
        for _ in range(most_steps):
            normal = here.normal_equations
            shared, views = normal.damped(damping).solution(only_views=only_poses)
            promised = shared @ normal.shared_gradient + np.sum(views * normal.gradients)
            if not promised > settled * here.sum_of_squares:
                break
            there = here._moved(shared, views)
            if there is not None and there._cost_over(here.used) <= here._cost_over(here.used):
                here, damping = there, damping / 10
            elif damping < 1e12:
                damping *= 2  # less up than down: it comes along a curved valley faster (Transtrum & Sethna 2012)
            else:
                break
        return replace(here, estimated=self.estimated) if only_poses else here

    @property
    def promised(self) -> float:
        """The share of the sum of squares that a full Gauss–Newton step would take off, were the residuals linear.

        At a least sum it is 0. It stays large where `refined` had to stop because a corner would lose its image.
        """
        normal = self.normal_equations
        shared, views = normal.damped(ALL_BUT_FREE).solution()
        fallen = shared @ normal.shared_gradient + np.sum(views * normal.gradients)
        return float(fallen / self.sum_of_squares) if self.sum_of_squares > 0 else 0.0

    def _cost_over(self, used: Mapping[str, Mask]) -> float:
        return self.sum_of_squares_over(used) + self.cost_of_priors

    def _moved(self, shared: Array, twists: Array) -> Adjustment | None:
        """With changed parameters; None where a lens does not take them or a corner in use loses its image."""
        try:
            cameras = {name: self._moved_camera(name, shared) for name in self.cameras}
        except ValueError:
            return None
        all_twists = np.zeros((self.views, len(POSE)))
        all_twists[self.posed] = twists
        there = replace(
            self,
            cameras=cameras,
            first_from_board=twisted(self.first_from_board, all_twists),
            warp=None if self.warp is None else self.warp + shared[self.warp_place],
        )
        kept = all(there.used[name][mask].all() for name, mask in self.used.items())
        return there if kept else None

    def _moved_camera(self, name: str, shared: Array) -> Camera:
        camera, changes = self.cameras[name], shared[self.intrinsics_of(name)]
        values = {
            key: parameter(camera, key) + change for key, change in zip(self.estimated[name], changes, strict=True)
        }
        place = self.place_of(name)
        if place is not None:
            camera = camera.at(twisted(camera.cam_from_world, shared[place]).inv())
        return with_parameters(camera, values)


def twisted(poses: RigidTransform, twists: Array) -> RigidTransform:
    """Poses moved by twists (..., 6) in the frame they lead to: p → exp(ω) p + τ.

    A product of rotations is one to rounding: it is not made orthogonal anew, which would take four times as long.
    """
    before, turns = poses.as_matrix(), Rotation.from_rotvec(twists[..., :3]).as_matrix()
    after = np.zeros((*np.broadcast_shapes(before.shape[:-2], twists.shape[:-1]), 4, 4))
    after[..., :3, :] = turns @ before[..., :3, :]
    after[..., :3, 3] += twists[..., 3:]
    after[..., 3, 3] = 1
    return RigidTransform(after, normalize=False, copy=False)
