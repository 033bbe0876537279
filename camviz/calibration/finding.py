"""The corners of a board in one picture.

Imports little, because every process that looks for boards begins with this file.
"""

from __future__ import annotations

import multiprocessing.connection
import os
import signal
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.calibration.picture_files import PictureError, read_gray

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from camviz.calibration.types import Board

Array = NDArray[np.float64]

FINDERS = ("auto", "sectors", "classic")
FEWEST = 6  # corners of a ChArUco board that give its pose with something left to check it by
SMALLEST = 16  # pixels along the shorter side, below which OpenCV's finders fail instead of finding nothing
LARGE = 2000  # pixels along the longer side, beyond which boards are looked for in a smaller copy
WINDOW = 11  # pixels to either side of a corner that OpenCV's samples refine it from
SUBPIXEL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


def find_corners(image: NDArray[Any], board: Board, finder: str = "auto") -> Array | None:
    """The inner corners (columns * rows, 2) of a board in a picture (height, width[, 3]) of 8 bits; None without it.

    In the order of `board.corners`, beginning at a black square in the board's corner; if both such squares are black,
    either of them may come first. A chessboard counts only as a whole; corners of a ChArUco board that are not seen are
    NaN. `finder` says how a chessboard is found: "sectors" is OpenCV's findChessboardCornersSB (Duda & Frese 2018),
    "classic" is findChessboardCorners with cornerSubPix, "auto" the first of the two that finds it.
    """
    if finder not in FINDERS:
        raise ValueError(f"finder must be one of {', '.join(FINDERS)}, got {finder!r}")
    gray = image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    if min(gray.shape) < SMALLEST:
        return None
    if board.dictionary is not None:
        return _charuco(gray, board)
    corners = _sectors(gray, board) if finder != "classic" else _classic(gray, board, WINDOW)
    if corners is None and finder == "auto":
        corners = _classic(gray, board)
    return corners if corners is None else _black_first(gray, corners, board)


def _sectors(gray: NDArray[Any], board: Board) -> Array | None:
    """Without EXHAUSTIVE first: it is quicker, and finds one of OpenCV's sample photographs that the other misses."""
    factor = -(-max(gray.shape) // LARGE)
    if factor > 1:
        height, width = (side // factor for side in gray.shape)
        if min(height, width) < SMALLEST:
            return None
        cropped = gray[: height * factor, : width * factor]
        gray = cv2.resize(cropped, (width, height), interpolation=cv2.INTER_AREA)
    for flags in (cv2.CALIB_CB_ACCURACY, cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE):
        found, corners = cv2.findChessboardCornersSB(gray, (board.columns, board.rows), flags=flags)
        if found:
            return factor * np.asarray(corners, dtype=float).reshape(-1, 2) + (factor - 1) / 2
    return None


def _classic(gray: NDArray[Any], board: Board, window: int | None = None) -> Array | None:
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


def _black_first(gray: NDArray[Any], corners: Array, board: Board) -> Array:
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


def _charuco(gray: NDArray[Any], board: Board) -> Array | None:
    corners, ids = charuco_detector(board).detectBoard(gray)[:2]
    if ids is None or len(ids) < FEWEST:
        return None
    seen = np.full((board.columns * board.rows, 2), np.nan)
    seen[np.ravel(ids)] = np.reshape(corners, (-1, 2))
    return seen


def charuco_detector(board: Board) -> Any:
    """OpenCV's detector of a ChArUco board; ValueError for a board that cannot be."""
    squares = (board.columns + 1, board.rows + 1)
    dictionary = charuco_dictionary(board)
    return cv2.aruco.CharucoDetector(cv2.aruco.CharucoBoard(squares, board.square_size, board.marker_size, dictionary))  # type: ignore[arg-type]


def charuco_dictionary(board: Board) -> Any:
    """OpenCV's dictionary of a board's markers; ValueError for one that it does not have or that is too small."""
    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if board.dictionary not in names or board.marker_size is None:
        raise ValueError(f"dictionary must be one of {', '.join(names)}, got {board.dictionary!r}")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    held, needed = len(dictionary.bytesList), (board.columns + 1) * (board.rows + 1) // 2
    if held < needed:
        raise ValueError(f"dictionary must have the {needed} markers of this board, {board.dictionary} has {held}")
    return dictionary


def look(path: str, board: Board, finder: str) -> tuple[tuple[int, int] | None, Array | None, str]:
    """The size (width, height) of a picture, the corners in it, and in words why there are none."""
    try:
        gray = read_gray(path)
    except PictureError as error:
        return None, None, error.why
    try:
        corners = find_corners(gray, board, finder)
    except cv2.error as error:
        return None, None, f"OpenCV's finder failed on it ({error.func})"
    why = "the board was not found in it" if board.dictionary is None else "too little of the board was found in it"
    return (gray.shape[1], gray.shape[0]), corners, why if corners is None else ""


def look_on_request(requests: Connection, board: Board, finder: str) -> None:
    """In a process of its own: `look` at each picture asked for, until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, ConnectionError):  # whoever asked has gone
        while True:
            requests.send(_look_or_error(requests.recv(), board, finder))


def _look_or_error(path: str, board: Board, finder: str) -> object:
    try:
        return look(path, board, finder)
    except Exception as error:
        return error


def _end_with_parent() -> None:
    """End this process when the one that started it is gone, however it ended (the system closes the sentinel)."""
    parent = multiprocessing.parent_process()
    if parent:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
