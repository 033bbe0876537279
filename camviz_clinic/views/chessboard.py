"""A board in space: its rim, and what is printed on it as a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camviz.draw.items import Line, TexturedMesh, closed
from camviz.lenses.base import Array
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.types import Board

TEXELS, DETAILED = {"chessboard": 12}, 48  # pixels along `square_size`
DARK, LIGHT = 40, 245


def outline(board: Board) -> Array:
    """The four corners (4, 3) of what is printed, of a chessboard one square beyond the inner corners, in its frame."""
    left, top, right, below = board.area
    return np.array([[left, top, 0], [right, top, 0], [right, below, 0], [left, below, 0]], dtype=float)


def rim(corners: Array, class_: str, width: float) -> Line:
    """A board's edge, through the corners (4, 3) of its squares."""
    return Line(closed(corners), class_, width)


def squares(corners: Array, board: Board) -> TexturedMesh:
    """What is printed on a board as a picture between its corners (4, 3)."""
    return TexturedMesh.over(corners[[0, 1, 3, 2]].reshape(2, 2, 3), printed(board), 0.9)


def printed(board: Board) -> NDArray[np.uint8]:
    """The board's squares, tags or circles, uint8 RGB, as many pixels to each as its details take."""
    shades = DARK + (LIGHT - DARK) * whiteness(board, TEXELS.get(board.kind, DETAILED))
    return np.repeat(np.rint(shades).astype(np.uint8)[..., None], 3, axis=-1)
