"""Where the ghost board stands, and how much the board that is held would say."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from camviz.cameras import Camera, Intrinsics, transform
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.guidance import (
    Candidate,
    candidate_poses,
    instruction,
    next_board_poses,
    rim_poses,
    tilt_deg,
)
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.solvers import pose_from_rays
from camviz_clinic.calibration.types import Board
from camviz_clinic.calibration.uncertainty import expected_errors
from camviz_clinic.live.tracking import apart

PRESUMED_DEG = 60.0  # the width of a usual webcam's view: good enough for the first ghosts
FIRST = ((0.3, 0.3), (0.7, 0.3), (0.7, 0.7), (0.3, 0.7))  # where their middles are, in width and height
SIDES, TURN = 8, 3  # of the poses that would do, and how far from one to the next, for another side each time
STEEP_DEG = 40.0  # their tilt at least: only tilted boards tell the focal length
TILTED_DEG = 20.0  # enough without the ghost
NEAR = 0.1  # of the picture's width: how near to the ghost a board is as good as there
WORST = 0.5  # of the largest expected error: a pixel with more than that is one of those that the ghost is for
KNOWN = 0.1  # of fx: with a larger σ there is no camera to guide by


@dataclass(frozen=True, eq=False)
class Guide:
    """What is known after so many views, and the ghost that follows from it.

    Args:
        camera: The camera as it is known, or one that is presumed.
        board: What is held.
        ghost: Where to hold it next, cam_from_board.
        adjustment: The solution; None before there is one that can guide.
        candidate: The ghost and what it would gain.
        largest: The largest expected error in pixels (Max ERE); infinite before the camera is known.
        worst: The pixels (n, 2) where it is, or more than half of it: what a view gains is judged there.
    """

    camera: Camera
    board: Board
    ghost: RigidTransform
    adjustment: Adjustment | None = None
    candidate: Candidate | None = None
    largest: float = np.inf
    worst: Array = field(default_factory=lambda: np.empty((0, 2)))

    @cached_property
    def pixels(self) -> Array:
        """Where the ghost's points are seen, (n, 2)."""
        return self.camera.project(transform(self.ghost, self.board.corners))

    @cached_property
    def lattice(self) -> Array:
        """The ghost's lines: its area divided as a chessboard's squares are, (rows + 2, columns + 2, 2) pixels."""
        left, top, right, bottom = self.board.area
        x, y = np.linspace(left, right, self.board.columns + 2), np.linspace(top, bottom, self.board.rows + 2)
        points = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1)
        return self.camera.project(transform(self.ghost, points.reshape(-1, 3))).reshape(len(y), len(x), 2)

    @property
    def instruction(self) -> str:
        """How to hold the board, as a clause."""
        if self.adjustment is None or self.candidate is None:
            return "hold the board as the orange one is held, tilted"
        return instruction(self.adjustment, self.candidate, "camera")

    def share(self, corners: Array) -> float:
        """What a view of the board at corners (n, 2) would gain, as a share of what the ghost would; near it 1.

        Before a camera is known a tilted board gains as much as the ghost, and any other nothing.
        """
        if apart(corners, self.pixels) < NEAR * self.camera.intrinsics.width:
            return 1.0
        seen = np.isfinite(corners).all(axis=1)
        try:
            pose = pose_from_rays(self.camera.unproject(corners[seen]), self.board.corners[seen])
            held = RigidTransform.concatenate([pose])
            if self.adjustment is None or self.candidate is None:
                return float(tilt_deg(held, self.board)[0] > TILTED_DEG)
            here = next_board_poses(self.adjustment, held, uv=self.worst)[0]
        except (ValueError, np.linalg.LinAlgError):  # too little of the board, or a corner of it, is in the picture
            return 0.0
        return (here.before - here.after) / (self.candidate.before - self.candidate.after)


def first_guide(board: Board, width: int, height: int, views: int) -> Guide:
    """The guide before a camera is known: tilted boards in turn in the four quarters of the picture."""
    camera = Camera(Intrinsics.from_fov(width, height, PRESUMED_DEG))
    poses = candidate_poses(camera, board)
    steep = poses[tilt_deg(poses, board) > STEEP_DEG]
    seen = camera.project(moved(steep, board.corners))
    off = np.linalg.norm(seen.mean(axis=1) - np.array(FIRST[views % len(FIRST)]) * (width, height), axis=1)
    best = np.argsort(off - np.ptp(seen[..., 0], axis=1), kind="stable")[:SIDES]  # near the quarter's middle, and large
    return Guide(camera, board, steep[int(best[(TURN * views) % len(best)])])


def guide(adjustment: Adjustment, views: int) -> Guide:
    """The guide by a solution: the ghost is the pose that would lessen the uncertainty most where it is worst.

    The goal is the largest expected error, which lies in a corner of the picture. The mean over the picture hardly
    shows it, and a ghost by the mean leaves that corner for last.
    """
    (camera,), k = adjustment.cameras.values(), next(iter(adjustment.cameras.values())).intrinsics
    sigma = np.sqrt(adjustment.intrinsics_covariance("camera")[0, 0])
    if not sigma < KNOWN * k.fx:
        return first_guide(adjustment.board, k.width, k.height, views)
    uv, expected = expected_errors(adjustment)
    largest = float(expected.max())
    worst = uv[expected >= WORST * largest]
    best = next_board_poses(adjustment, rim_poses(camera, adjustment.board), uv=worst)[0]
    return Guide(camera, adjustment.board, best.cam_from_board, adjustment, best, largest, worst)
