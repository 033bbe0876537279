"""What a camera sees of a board that somebody holds in the garden: a photograph, with the board drawn over it."""

from __future__ import annotations

import numpy as np

from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.panel import Panel, placed_image
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views import garden
from camviz_clinic.calibration.types import Board

BEHIND = "garden"
_MARGIN = 0.4  # of a square, white around the squares
_WHITE, _BLACK = np.array([248, 246, 240]), np.array([44, 47, 54])
_LIGHT = np.array([0.35, -0.5, -0.79])  # from the board towards the light
_STEPS = 9  # points along a side of the board, which the lens bends


def behind(camera: Camera) -> dict[str, bytes]:
    """The garden as the camera sees it without any board, as JPEG by the name that `held_board` uses."""
    return {BEHIND: garden.taken(camera, garden.FINE)[1]}


def held_board(panel: Panel, board: Board, cam_from_board: RigidTransform, camera: Camera) -> svg.Marks:
    """The garden, and the board before it: its white sheet and its dark squares, brighter where they face the light."""
    turned = cam_from_board.rotation.as_matrix()[:, 2]
    bright = 0.62 + 0.38 * float(abs(turned @ _LIGHT)) / float(np.linalg.norm(_LIGHT))

    def placed(points: Array) -> Array:
        return panel.place(camera.project(transform(cam_from_board, points)))

    size = board.square_size
    low, high = np.array([-size, -size]), size * np.array([board.columns, board.rows], dtype=float)
    sheet = placed(_around(low - _MARGIN * size, high + _MARGIN * size))
    column, row = np.meshgrid(np.arange(board.columns + 1), np.arange(board.rows + 1))
    dark = np.stack([column, row], axis=-1)[(column + row) % 2 == 0]
    corners = low + size * (dark[:, None] + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]))
    squares = placed(np.concatenate([corners, np.zeros((*corners.shape[:2], 1))], axis=-1))
    garden_seen = placed_image(panel, BEHIND, camera.intrinsics.width, camera.intrinsics.height)
    return (
        garden_seen
        + svg.polygon(sheet, "plain", fill=_colour(bright * _WHITE), stroke="#0006", stroke_width=1)
        + svg.path(squares, "plain", closed=True, fill=_colour(bright * _BLACK), stroke="none")
    )


def _around(low: Array, high: Array) -> Array:
    """Points (4 * _STEPS, 3) along the rim of a rectangle in the board's plane."""
    s = np.linspace(0, 1, _STEPS, endpoint=False)[:, None]
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    sides = [a + s * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return np.pad(np.concatenate(sides), ((0, 0), (0, 1)))


def _colour(shade: Array) -> str:
    return "#" + "".join(f"{round(value):02x}" for value in shade)
