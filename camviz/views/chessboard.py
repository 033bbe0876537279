"""A chessboard in space: its rim, and its squares as a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camviz.calibration.types import Board
from camviz.draw.items import Line, TexturedMesh, closed
from camviz.lenses.base import Array


def outline(board: Board) -> Array:
    """The four corners (4, 3) of the board's squares, one square beyond the inner corners, in its own frame."""
    right, below = board.columns, board.rows
    return board.square_size * np.array([[-1, -1, 0], [right, -1, 0], [right, below, 0], [-1, below, 0]], dtype=float)


def rim(corners: Array, class_: str, width: float) -> Line:
    """A board's edge, through the corners (4, 3) of its squares."""
    return Line(closed(corners), class_, width)


def squares(corners: Array, board: Board) -> TexturedMesh:
    """A board's squares as a picture between its corners (4, 3)."""
    return TexturedMesh.over(corners[[0, 1, 3, 2]].reshape(2, 2, 3), checkers(board), 0.9)


def checkers(board: Board) -> NDArray[np.uint8]:
    """The board's squares, uint8 RGB, 12 pixels each."""
    column, row = np.meshgrid(np.arange(board.columns + 1), np.arange(board.rows + 1))
    shades = np.where((column + row) % 2, 245, 40).astype(np.uint8)
    return np.repeat(np.kron(shades, np.ones((12, 12), np.uint8))[..., None], 3, axis=-1)
