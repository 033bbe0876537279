"""The equation of hand and eye, A X B = Z, and what its motions tell before it is solved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation

FEWEST = 3  # poses: two motions

Mask = NDArray[np.bool_]


class PoseError(ValueError):
    """Robot poses that cannot be read, or from which nothing can be solved; the message is one sentence.

    >>> from camviz_clinic.handeye import read_poses
    >>> read_poses("none.csv")
    Traceback (most recent call last):
    camviz_clinic.calibration.motions.PoseError: none.csv: there is no such file
    """


@dataclass(frozen=True, eq=False)
class Motions:
    """What is known of A X B = Z, pose by pose.

    X says where the camera sits on its mount, Z where the board sits on the other part. With the eye in hand the mount
    is the robot's hand and the other part its base; with the eye to the hand it is the other way round. A is
    other_from_mount and B is cam_from_board, so that the names cancel: A X B = other_from_board.

    Args:
        other_from_mount: A, one pose for each picture, in metres.
        cam_from_board: B, as many.

    Raises: PoseError for poses that are not as many, and for fewer than three.

    >>> from camviz.poses import RigidTransform, Rotation
    >>> A = RigidTransform.from_rotation(Rotation.from_rotvec([[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5], [0, 0, 0]]))
    >>> Motions(A, A.inv()).turning.deg.round(1)  # three turns by 28.6°, and one pose between them
    array([14.3, 14.3,  7.2])
    """

    other_from_mount: RigidTransform
    cam_from_board: RigidTransform

    def __post_init__(self) -> None:
        if len(self.other_from_mount) != len(self.cam_from_board):
            raise PoseError(
                f"there must be as many poses of the robot as of the board, got {len(self.other_from_mount)} and "
                f"{len(self.cam_from_board)}"
            )
        if len(self) < FEWEST:
            raise PoseError(f"at least {FEWEST} poses with a picture of the board are needed, got {len(self)}")

    @classmethod
    def of(cls, base_from_hand: RigidTransform, cam_from_board: RigidTransform, eye_to_hand: bool) -> Self:
        """Of a robot's poses: A is base_from_hand with the eye in hand, and its inverse otherwise."""
        return cls(base_from_hand.inv() if eye_to_hand else base_from_hand, cam_from_board)

    def __len__(self) -> int:
        return len(self.cam_from_board)

    def only(self, kept: Mask | NDArray[np.intp]) -> Self:
        """Those of a mask (poses,), or of indices."""
        return replace(self, other_from_mount=self.other_from_mount[kept], cam_from_board=self.cam_from_board[kept])

    def scaled(self, factor: float) -> Self:
        """With the robot's lengths multiplied by a factor."""
        A = self.other_from_mount
        return replace(self, other_from_mount=RigidTransform.from_components(factor * A.translation, A.rotation))

    def resized(self, factor: float) -> Self:
        """With the camera's lengths multiplied by a factor."""
        B = self.cam_from_board
        return replace(self, cam_from_board=RigidTransform.from_components(factor * B.translation, B.rotation))

    @cached_property
    def A(self) -> Array:
        """other_from_mount as matrices (poses, 4, 4)."""
        return np.asarray(self.other_from_mount.as_matrix())

    @cached_property
    def B(self) -> Array:
        """cam_from_board as matrices (poses, 4, 4)."""
        return np.asarray(self.cam_from_board.as_matrix())

    @cached_property
    def lever(self) -> float:
        """The RMS distance from camera to board, in metres: a turn counts as what it moves there."""
        return float(np.sqrt(np.mean(np.sum(self.cam_from_board.translation**2, axis=-1))))

    @cached_property
    def turning(self) -> Turning:
        """How far the mount turned, and about which axes."""
        return Turning.of(self.other_from_mount.rotation)

    @cached_property
    def angle_mismatch(self) -> float:
        """The median difference in radians of the angles that mount and camera turned by, over all pairs of poses.

        A motion and the same motion in another frame turn by one angle, so that it needs no X.

        Source: Chen, *A screw motion approach to uniqueness analysis of head-eye geometry*, CVPR (1991).
        """
        first, second = np.triu_indices(len(self), 1)
        return float(np.median(np.abs(angles(self.A) - angles(self.B))[first, second]))


@dataclass(frozen=True, eq=False)
class Turning:
    """How far something turned about each of three axes, the largest first.

    Attributes:
        deg: (3,), RMS of the turns away from their mean, in degrees.
        axes: (3, 3), unit axes as rows, in the frame that turns.
    """

    deg: Array
    axes: Array

    @classmethod
    def of(cls, rotations: Rotation) -> Self:
        """Of the rotations of one thing over time."""
        turns = (rotations.mean().inv() * rotations).as_rotvec(degrees=True)
        _, lengths, axes = np.linalg.svd(turns, full_matrices=True)
        lengths = np.concatenate([lengths, np.zeros(3 - len(lengths))])
        return cls(lengths / np.sqrt(len(turns)), axes)


def angles(matrices: Array) -> Array:
    """The angles in radians by which poses (n, 4, 4) are turned against each other, (n, n)."""
    R = matrices[:, :3, :3]
    traces = np.einsum("iab,jab->ij", R, R)
    return np.arccos(np.clip((traces - 1) / 2, -1, 1))
