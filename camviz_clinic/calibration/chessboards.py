"""The inner corners of a chessboard in a picture.

Imports little, because every process that looks for boards needs this file.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz_clinic.calibration.boards.kind import Array, Shape

SMALLEST = 16  # pixels along the shorter side, below which OpenCV's finders fail instead of finding nothing
LEAST_SIDE = 3  # corners: OpenCV's finders take no fewer
LARGE = 2000  # pixels along the longer side, beyond which boards are looked for in a smaller copy
SMALL = 500_000  # pixels, up to which the whole picture is searched at once
ROUGH = 640  # pixels along the longer side of the copy in which the board is looked for first
MARGIN = 2.0  # of the widest squares: what of the picture is kept around the outermost corners
AGREE = 0.5  # of the narrowest square: further apart, rough and exact corners are not of the same squares
THOROUGH = cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE
CONTRAST = 0.5  # of the board's own: fields beyond its edge that differ by more are squares
NEAR = 0.25  # of a square: how far to either side of a corner the four fields that meet in it are looked at
BLUR = 0.1  # of the narrowest square: noise of a single pixel says nothing of a field
CROSSED = 0.95  # of the corners: where fewer are crossings, what was found is not the board
WINDOW = 11  # pixels to either side of a corner that OpenCV's samples refine it from
CLEAR = 0.4  # of the narrowest square: wider windows reach the edges that meet in the next corner
LEAST_WINDOW = 2
SUBPIXEL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


def find_chessboard(gray: NDArray[Any], board: Shape, finder: str = "auto") -> Array | None:
    """The inner corners (columns * rows, 2) in a grey picture, beginning at a black square; None without the board.

    None, too, for a board of fewer than three corners along a side. `finder` is that of `finding.find_corners`.
    """
    if min(board.columns, board.rows) < LEAST_SIDE:
        return None
    corners = _sectors(gray, board) if finder != "classic" else _classic(gray, board, WINDOW)
    if corners is not None and finder != "classic" and not crossed(gray, corners, board):
        corners = None
    if corners is None and finder in ("auto", "saddles"):
        corners = _classic(gray, board)
    if corners is not None and finder == "saddles":
        corners = at_saddles(gray, corners, board)
    return corners if corners is None else _black_first(gray, corners, board)


def _sectors(gray: NDArray[Any], board: Shape) -> Array | None:
    """By sectors, in a smaller copy of a very large picture; of a large one only where the board roughly is."""
    factor = -(-max(gray.shape) // LARGE)
    if factor > 1:
        height, width = (side // factor for side in gray.shape)
        cropped = gray[: height * factor, : width * factor]
        gray = cv2.resize(cropped, (width, height), interpolation=cv2.INTER_AREA)
    corners = in_part(gray, board) if gray.size > SMALL else None
    if corners is None:
        corners = everywhere(gray, board)
    return corners if corners is None else factor * corners + (factor - 1) / 2


def everywhere(gray: NDArray[Any], board: Shape) -> Array | None:
    """By sectors in the whole picture, which takes 0.4 s for a million pixels.

    Without EXHAUSTIVE first: it is quicker, and finds one of OpenCV's sample photographs that the other misses.
    """
    if min(gray.shape) < SMALLEST:
        return None
    for flags in (cv2.CALIB_CB_ACCURACY, THOROUGH):
        found, corners = cv2.findChessboardCornersSB(gray, (board.columns, board.rows), flags=flags)
        if found:
            return np.asarray(corners, dtype=float).reshape(-1, 2)
    return None


def in_part(gray: NDArray[Any], board: Shape) -> Array | None:
    """By sectors at full size, in that part of the picture where a smaller copy shows the board.

    None where the smaller copy shows none, or the two disagree: then the board may still be found everywhere.
    """
    rough = _rough(gray, board)
    if rough is None:
        return None
    spacing = _spacing(rough, board)
    around = MARGIN * spacing.max()
    left, top = np.maximum(np.floor(rough.min(axis=0) - around), 0).astype(int)
    right, bottom = np.ceil(rough.max(axis=0) + around).astype(int)
    part = np.ascontiguousarray(gray[top:bottom, left:right])
    corners = everywhere(part, board)
    if corners is None:
        return None
    corners += [left, top]
    apart = min(np.linalg.norm(corners - each, axis=-1).max() for each in (rough, rough[::-1]))
    return corners if apart < AGREE * spacing.min() else None


def _rough(gray: NDArray[Any], board: Shape) -> Array | None:
    """The corners to a pixel or two, from a smaller copy."""
    scale = min(ROUGH / max(gray.shape), 1)
    height, width = (round(side * scale) for side in gray.shape)
    small = cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)
    size = (board.columns, board.rows)
    found, corners = cv2.findChessboardCorners(small, size)
    if not found:
        found, corners = cv2.findChessboardCornersSB(small, size, flags=THOROUGH)
    if not found:
        return None
    ratio = np.array(gray.shape[::-1]) / [width, height]
    return np.asarray((np.reshape(corners, (-1, 2)) + 0.5) * ratio - 0.5, dtype=float)


def _spacing(corners: Array, board: Shape) -> Array:
    """The distances of neighbouring corners, in pixels."""
    grid = corners.reshape(board.rows, board.columns, 2)
    return np.concatenate([np.linalg.norm(np.diff(grid, axis=axis), axis=-1).ravel() for axis in (0, 1)])


def _classic(gray: NDArray[Any], board: Shape, window: int | None = None) -> Array | None:
    """`window` is half the width of the window in pixels; by default it keeps clear of the neighbouring corners."""
    found, corners = cv2.findChessboardCorners(gray, (board.columns, board.rows))
    if not found:
        return None
    corners = np.asarray(corners, dtype=float).reshape(-1, 2)
    return _refined(gray, corners, _window(corners, board) if window is None else window)


def at_saddles(gray: NDArray[Any], corners: Array, board: Shape) -> Array:
    """The corners (n, 2) moved to where the edges around each of them meet (`cv2.cornerSubPix`).

    Sectors are off by an error that neighbours share, which no residual tells. Near the picture's border the windows
    are as wide as there is room; a corner without room for one stays where it is.
    """
    widest, last = _window(corners, board), np.array(gray.shape[::-1]) - 1
    windows = np.floor(np.minimum(corners, last - corners)).min(axis=1).clip(0, widest).astype(int)
    moved = corners.copy()
    for window in np.unique(windows[windows >= LEAST_WINDOW]):
        moved[windows == window] = _refined(gray, corners[windows == window], int(window))
    return moved


def _window(corners: Array, board: Shape) -> int:
    """Half the width in pixels of a window that keeps clear of the neighbouring corners."""
    return int(np.clip(CLEAR * _spacing(corners, board).min(), LEAST_WINDOW, WINDOW))


def _refined(gray: NDArray[Any], corners: Array, window: int) -> Array:
    start = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 1, 2)
    return np.asarray(cv2.cornerSubPix(gray, start, (window, window), (-1, -1), SUBPIXEL), dtype=float).reshape(-1, 2)


def _black_first(gray: NDArray[Any], corners: Array, board: Shape) -> Array:
    """The corners, in reverse order if the black square is at the last one."""
    grid = corners.reshape(board.rows, board.columns, 2)
    middles = (grid[:-1, :-1] + grid[1:, 1:] + grid[:-1, 1:] + grid[1:, :-1]) / 4
    if not middles.size:
        return corners
    seen = _at(gray, middles)
    as_first = np.add.outer(np.arange(board.rows - 1), np.arange(board.columns - 1)) % 2 == 0
    first_is_white = seen[as_first].mean() > seen[~as_first].mean() if not as_first.all() else False
    other_end_differs = (board.columns + board.rows) % 2 == 1
    return corners[::-1].copy() if first_is_white and other_end_differs else corners


def crossed(gray: NDArray[Any], corners: Array, board: Shape) -> bool:
    """Whether two black fields and two white ones meet crosswise in nearly all of the corners (columns * rows, 2).

    Around a board with a narrow margin, OpenCV's sectors take places on its edge for corners, where one black field
    meets white, and number them with the others.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    quiet = cv2.GaussianBlur(gray, (0, 0), max(0.5, BLUR * float(_spacing(corners, board).min())))
    along, down = (NEAR * np.asarray(np.gradient(grid, axis=axis)) for axis in (1, 0))
    one = np.sort([_at(quiet, grid + along + down), _at(quiet, grid - along - down)], axis=0)
    other = np.sort([_at(quiet, grid + along - down), _at(quiet, grid - along + down)], axis=0)
    turns = np.where(np.add.outer(np.arange(board.rows), np.arange(board.columns)) % 2, -1, 1)
    brighter = turns * ((one[0] > other[1]).astype(int) - (other[0] > one[1]))
    return bool(max(np.mean(brighter == 1), np.mean(brighter == -1)) >= CROSSED)


def _at(gray: NDArray[Any], points: Array) -> Array:
    """How bright (...) the pixels at points (..., 2) are, or those nearest to them where they lie outside."""
    u, v = np.moveaxis(np.rint(points).astype(int), -1, 0)
    return np.asarray(gray[v.clip(0, gray.shape[0] - 1), u.clip(0, gray.shape[1] - 1)], dtype=float)


def goes_on(gray: NDArray[Any], corners: Array, board: Shape) -> bool:
    """Whether squares go on alternating beyond the outermost squares of a chessboard found in a grey picture.

    The corners (columns * rows, 2) are continued by two rows to each side; the fields there are white around a board
    that ends, and black and white by turns in a larger one.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    sides = (grid, grid[::-1], grid.swapaxes(0, 1), grid.swapaxes(0, 1)[::-1])
    return any(_alternates(gray, side) for side in sides if len(side) >= 3 and side.shape[1] >= 3)


def _alternates(gray: NDArray[Any], rows: Array) -> bool:
    """Whether the second row of fields before rows[0] alternates as the board's own first one does."""
    before = 3 * rows[0] - 3 * rows[1] + rows[2]
    twice = 3 * before - 3 * rows[0] + rows[1]
    own, beyond = _along(gray, rows[0], rows[1]), _along(gray, twice, before)
    if own is None or beyond is None:
        return False
    sign = np.where(np.arange(len(own)) % 2, -1, 1)
    swing, other = float((sign * own).mean()), float((sign * beyond).mean())
    steps = np.sign(np.diff(beyond)) == -sign[:-1] * np.sign(other)
    return swing * other > 0 and abs(other) > CONTRAST * abs(swing) and bool(steps.mean() > 0.8)


def _along(gray: NDArray[Any], upper: Array, lower: Array) -> Array | None:
    """How bright the fields between two rows of corners are at their middles; None where they leave the picture."""
    middles = (upper[:-1] + upper[1:] + lower[:-1] + lower[1:]) / 4
    u, v = np.rint(middles).astype(int).T
    if (u < 0).any() or (v < 0).any() or (u >= gray.shape[1]).any() or (v >= gray.shape[0]).any():
        return None
    seen = gray[v, u].astype(float)
    return np.asarray(seen[: len(seen) // 2 * 2])  # as many that should be black as white
