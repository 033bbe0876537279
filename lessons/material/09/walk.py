"""A walk around the garden's chessboard, so that a wide camera sees it all over its picture."""

from __future__ import annotations

import numpy as np

from camviz.cameras import look_at
from camviz.lenses.base import unit
from camviz.poses import RigidTransform, Rotation
from camviz.scenes.standard import BOARD_COLUMNS, BOARD_ROWS, board_corners


def around_board(count: int) -> list[RigidTransform]:
    """Poses world_from_cam of `count` cameras 1.1 to 1.5 m from the board, which they see up to 58° off their axes."""
    corners = board_corners().reshape(BOARD_ROWS, BOARD_COLUMNS, 3)
    right, down = unit(corners[0, -1] - corners[0, 0]), unit(corners[-1, 0] - corners[0, 0])
    middle, out = corners.mean(axis=(0, 1)), -np.cross(right, down)
    poses = []
    for i in range(count):
        aside = 0.55 * np.sin(2.4 * i) * right + 0.4 * np.cos(1.7 * i) * down
        eye = middle + (1.3 + 0.2 * np.cos(0.9 * i)) * unit(out + aside)
        around, away = 2 * np.pi * i / count, (0.35, 0.7)[i % 2] if i else 0.0
        turn = Rotation.from_rotvec([away * np.sin(around), away * np.cos(around), 0.3 * np.sin(1.3 * i)])
        poses.append(look_at(eye, middle, down) * RigidTransform.from_rotation(turn))
    return poses
