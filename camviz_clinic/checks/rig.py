"""How the cameras of a calibration stand to each other, by the file and by the boards that two of them saw."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.solvers import poses_from_rays
from camviz_clinic.calibration.types import Board, Calibration

DECLARED = (("left", "right"), ("P0", "P1"), ("P2", "P3"), ("00", "01"), ("02", "03"))  # the last four are KITTI's
ENOUGH = 6  # corners
OVERLAP_DEG = 40.0  # between the axes of two cameras that are meant to see the same
MUCH_BETTER = 5.0  # how many times closer a changed transform must be to what is known
OWN_UNIT = ("COLMAP", "transforms.json", "Metashape cameras")  # formats whose lengths are not metres
FLIPPED = RigidTransform.from_matrix(np.diag([1.0, -1, -1, 1]))  # from OpenCV's axes to OpenGL's and back


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two cameras of a calibration that make a stereo pair; `declared` where the file says which is the left one."""

    calibration: Calibration
    left: str
    right: str
    declared: bool

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        cameras = self.calibration.cameras
        return cameras[self.left], cameras[self.right]

    @property
    def title(self) -> str:
        return f"{self.left}, {self.right}"

    @cached_property
    def right_from_left(self) -> RigidTransform:
        """What the file says."""
        return self.calibration.rig.a_from_b(self.right, self.left)

    @property
    def baseline(self) -> float:
        """The distance between the cameras, in the unit of the file."""
        return float(np.linalg.norm(self.right_from_left.translation))

    @cached_property
    def seen_from_both(self) -> dict[str, Array] | None:
        """The corners (views, corners, 2) of both cameras in the views in which both see the board."""
        calibration = self.calibration
        held = [calibration.detections.get(name) for name in (self.left, self.right)]
        if calibration.board is None or held[0] is None or held[1] is None or held[0].shape != held[1].shape:
            return None
        if held[0].shape[1] != calibration.board.columns * calibration.board.rows:
            return None
        return {self.left: held[0][self.views], self.right: held[1][self.views]} if self.views else None

    @cached_property
    def views(self) -> list[int]:
        """The numbers of the views in which both see enough of the board for its pose."""
        held = [self.calibration.detections[name] for name in (self.left, self.right)]
        both = np.all([np.isfinite(each).all(axis=-1).sum(axis=1) >= ENOUGH for each in held], axis=0)
        return [int(view) for view in np.flatnonzero(both)]

    @cached_property
    def alone(self) -> tuple[RigidTransform, RigidTransform] | None:
        """cam_from_board of every such view, by the left and by the right camera alone."""
        if self.seen_from_both is None:
            return None
        board, seen = self.calibration.board, self.seen_from_both
        assert board is not None
        left, right = (lone_poses(camera, board, seen[name]) for name, camera in self._named())
        return left, right

    @property
    def by_view(self) -> RigidTransform | None:
        """right_from_left of every such view, from the poses that each camera has of the board by itself."""
        return None if self.alone is None else self.alone[1] * self.alone[0].inv()

    def _named(self) -> list[tuple[str, Camera]]:
        return list(zip((self.left, self.right), self.cameras, strict=True))

    @cached_property
    def agreed(self) -> RigidTransform | None:
        """The one of `by_view` with which the others agree best."""
        return None if self.by_view is None else self.by_view[middlemost(self.by_view)]


def pairs(calibration: Calibration) -> list[StereoPair]:
    """The pairs that a file declares; otherwise its two cameras, if it has just two that look the same way.

    Of those the left one is the one further to the left.
    """
    names = list(calibration.cameras)
    declared = [StereoPair(calibration, *each, True) for each in DECLARED if set(each) <= set(names)]
    if declared or len(names) != 2:
        return declared
    rig = calibration.rig
    second_from_first = rig.a_from_b(names[1], names[0])
    axes_deg = np.degrees(np.arccos(np.clip(second_from_first.rotation.as_matrix()[2, 2], -1, 1)))
    if axes_deg > OVERLAP_DEG or not np.linalg.norm(second_from_first.translation) > 0:
        return []
    ordered = names if second_from_first.translation[0] < 0 else names[::-1]
    return [StereoPair(calibration, ordered[0], ordered[1], False)]


def board_poses(camera: Camera, board: Board, pixels: Array) -> RigidTransform:
    """cam_from_board of views (v, n, 2) from their rays; a view without enough corners has the board ahead."""
    ahead = RigidTransform.from_translation([0, 0, 10 * board.columns * board.square_size])
    poses = []
    for view in pixels:
        seen = np.isfinite(view).all(axis=-1)
        try:
            poses.append(poses_from_rays(camera, [board.corners[seen]], [view[seen]])[0])
        except (ValueError, np.linalg.LinAlgError):  # too few corners, on one line, or without rays
            poses.append(ahead)
    return RigidTransform.concatenate(poses)


def lone_poses(camera: Camera, board: Board, pixels: Array) -> RigidTransform:
    """cam_from_board of every view, fitted to the corners (views, corners, 2) of one camera alone."""
    alone = Camera(camera.intrinsics, camera.lens)
    start = board_poses(alone, board, pixels)
    problem = Adjustment(board, {"camera": alone}, {"camera": pixels}, start, {"camera": ()})
    return problem.refined(only_poses=True).first_from_board


def corner_errors(camera: Camera, poses: RigidTransform, pixels: Array, board: Board) -> Array:
    """How far corners (views, corners, 2) lie from where the board's poses put them: (views, corners) in pixels."""
    alone = Camera(camera.intrinsics, camera.lens)
    expected = np.stack([alone.project(pose.apply(board.corners)) for pose in poses])
    return np.asarray(np.linalg.norm(expected - pixels, axis=-1))


def middlemost(poses: RigidTransform) -> int:
    """The index of the pose whose distances to all others have the smallest sum."""
    if poses.single or len(poses) == 1:
        return 0
    return int(np.argmin([np.sum(distances(poses, poses[index])) for index in range(len(poses))]))


def distances(poses: RigidTransform, other: RigidTransform) -> Array:
    """How far poses are from another: the angle in radians, plus the shift relative to the other's own length."""
    length = max(float(np.linalg.norm(other.translation)), 1e-12)
    angles = np.atleast_1d((poses.rotation * other.rotation.inv()).magnitude())
    shifts = np.linalg.norm(np.atleast_2d(poses.translation) - other.translation, axis=-1)
    return np.asarray(angles + shifts / length, dtype=float)


def fits_better(
    ours: RigidTransform, other: RigidTransform, change: Callable[[RigidTransform], RigidTransform]
) -> bool:
    """Whether a changed transform is much closer to another than it is as it stands, and close."""
    as_it_is, changed = float(distances(ours, other)[0]), float(distances(change(ours), other)[0])
    return changed * MUCH_BETTER < as_it_is and changed < 0.2
