"""The inner corners of a chessboard in a picture.

Imports little, because every process that looks for boards needs this file.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.calibration.boards.kind import Array, Shape

LEAST_SIDE = 3  # corners: OpenCV's finders take no fewer
LARGE = 2000  # pixels along the longer side, beyond which boards are looked for in a smaller copy
WINDOW = 11  # pixels to either side of a corner that OpenCV's samples refine it from
SUBPIXEL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


def find_chessboard(gray: NDArray[Any], board: Shape, finder: str = "auto") -> Array | None:
    """The inner corners (columns * rows, 2) in a grey picture, beginning at a black square; None without the board.

    None, too, for a board of fewer than three corners along a side. `finder` is that of `finding.find_corners`.
    """
    if min(board.columns, board.rows) < LEAST_SIDE:
        return None
    corners = _sectors(gray, board) if finder != "classic" else _classic(gray, board, WINDOW)
    if corners is None and finder == "auto":
        corners = _classic(gray, board)
    return corners if corners is None else _black_first(gray, corners, board)


def _sectors(gray: NDArray[Any], board: Shape) -> Array | None:
    """Without EXHAUSTIVE first: it is quicker, and finds one of OpenCV's sample photographs that the other misses."""
    factor = -(-max(gray.shape) // LARGE)
    if factor > 1:
        height, width = (side // factor for side in gray.shape)
        cropped = gray[: height * factor, : width * factor]
        gray = cv2.resize(cropped, (width, height), interpolation=cv2.INTER_AREA)
    for flags in (cv2.CALIB_CB_ACCURACY, cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE):
        found, corners = cv2.findChessboardCornersSB(gray, (board.columns, board.rows), flags=flags)
        if found:
            return factor * np.asarray(corners, dtype=float).reshape(-1, 2) + (factor - 1) / 2
    return None


def _classic(gray: NDArray[Any], board: Shape, window: int | None = None) -> Array | None:
    """`window` is half the width of the window in pixels; by default it keeps clear of the neighbouring corners."""
    found, corners = cv2.findChessboardCorners(gray, (board.columns, board.rows))
    if not found:
        return None
    corners = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 1, 2)
    if window is None:
        grid = corners.reshape(board.rows, board.columns, 2)
        spacing = min(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1))
        window = int(np.clip(0.4 * spacing, 2, WINDOW))
    refined = cv2.cornerSubPix(gray, corners, (window, window), (-1, -1), SUBPIXEL)
    return np.asarray(refined, dtype=float).reshape(-1, 2)


def _black_first(gray: NDArray[Any], corners: Array, board: Shape) -> Array:
    """The corners, in reverse order if the black square is at the last one."""
    grid = corners.reshape(board.rows, board.columns, 2)
    middles = (grid[:-1, :-1] + grid[1:, 1:] + grid[:-1, 1:] + grid[1:, :-1]) / 4
    if not middles.size:
        return corners
    u, v = np.moveaxis(np.rint(middles).astype(int), -1, 0)
    seen = gray[v.clip(0, gray.shape[0] - 1), u.clip(0, gray.shape[1] - 1)].astype(float)
    as_first = np.add.outer(np.arange(board.rows - 1), np.arange(board.columns - 1)) % 2 == 0
    first_is_white = seen[as_first].mean() > seen[~as_first].mean() if not as_first.all() else False
    other_end_differs = (board.columns + board.rows) % 2 == 1
    return corners[::-1].copy() if first_is_white and other_end_differs else corners
