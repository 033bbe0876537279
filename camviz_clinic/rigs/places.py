"""How two cameras of a rig stand to each other, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.rigs.adjustment import RigAdjustment
from camviz_clinic.rigs.graph import adjoint, cross


@dataclass(frozen=True, eq=False)
class RelativePose:
    """Where one camera stands in another one's frame.

    Args:
        of, seen_from: The two cameras' names.
        pose: seen_from_of: its translation is the one camera's centre in the other's frame, in metres.
        covariance: (6, 6) of a small turn in the other's frame, in radians, and of the centre, in metres.

    >>> from camviz.poses import RigidTransform
    >>> pose = RigidTransform.from_translation([0.3, 0, 0.4])
    >>> beside = RelativePose("right", "left", pose, np.diag([1e-4] * 3 + [1e-3] * 3) ** 2)
    >>> beside.distance, round(beside.distance_deviation, 6)
    (0.5, 0.001)
    """

    of: str
    seen_from: str
    pose: RigidTransform
    covariance: Array

    @property
    def deviations(self) -> Array:
        """σ (6,) of the turns about x, y and z in radians, and of the centre's x, y and z in metres."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def distance(self) -> float:
        """Of the two cameras, in metres."""
        return float(np.linalg.norm(self.pose.translation))

    @property
    def distance_deviation(self) -> float:
        """σ of the distance, in metres."""
        return self._along(np.concatenate([np.zeros(3), self.pose.translation]))

    @property
    def angle(self) -> float:
        """By which the one camera is turned against the other, in radians."""
        return float(self.pose.rotation.magnitude())

    @property
    def angle_deviation(self) -> float:
        """σ of this angle, in radians."""
        return self._along(np.concatenate([self.pose.rotation.as_rotvec(), np.zeros(3)]))

    def _along(self, direction: Array) -> float:
        unit = direction / max(float(np.linalg.norm(direction)), 1e-300)
        return float(np.sqrt(unit @ self.covariance @ unit))


def rig_of(calibration: Calibration) -> RigAdjustment:
    """The problem that a rig's calibration is a solution of.

    Args:
        calibration: With the corners and the board's poses of all its cameras.

    Returns: RigAdjustment, which knows the covariances.
    Raises: ValueError where the calibration does not hold what it takes.

    >>> from camviz_clinic.rigs import calibrate_rig, virtual
    >>> rng = np.random.default_rng(1)
    >>> truth = virtual.rig(rng, 3, frames=10)
    >>> rig_of(calibrate_rig(truth.observed(rng), truth.board)).views
    30
    """
    rig = RigAdjustment.of(calibration)
    return replace(rig, estimated={**rig.estimated, **calibration.estimated})  # nothing, where a lens was held


def relative_pose(rig: RigAdjustment, of: str, seen_from: str) -> RelativePose:
    """Where a camera stands in another one's frame, with the covariance by the scatter of the frames.

    Args:
        rig: The solution.
        of: The camera that is told of.
        seen_from: The one in whose frame.

    Returns: RelativePose.
    Raises: ValueError for a name that is none of theirs, or the same twice.

    >>> from camviz_clinic.rigs import calibrate_rig, virtual
    >>> rng = np.random.default_rng(1)
    >>> truth = virtual.rig(rng, 3, frames=10)
    >>> beside = relative_pose(rig_of(calibrate_rig(truth.observed(rng), truth.board)), "cam2", "cam1")
    >>> off = beside.distance - np.linalg.norm(truth.cameras["cam2"].centre - truth.cameras["cam1"].centre)
    >>> bool(abs(off) < 3 * beside.distance_deviation)
    True
    """
    for name in (of, seen_from):
        if name not in rig.cameras:
            raise ValueError(f"camera must be one of {', '.join(rig.cameras)}, got {name}")
    if of == seen_from:
        raise ValueError(f"of and seen_from must be two cameras, got {of} twice")
    pose = rig.cameras[seen_from].cam_from_world * rig.cameras[of].world_from_cam
    jacobian = np.zeros((6, len(rig.parameters)))
    if place := rig.place_of(seen_from):
        jacobian[:, place] = np.eye(6)
    if place := rig.place_of(of):
        jacobian[:, place] = -adjoint(pose)
    # A twist (ω, τ) moves the centre c by ω × c + τ.
    centre = np.eye(6)
    centre[3:, :3] = -cross(pose.translation)
    jacobian = centre @ jacobian
    return RelativePose(of, seen_from, pose, jacobian @ rig.covariance @ jacobian.T)
