"""The corners of a board in one picture.

Imports little, because every process that looks for boards begins with this file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from camviz.files.calibration import Board

Array = NDArray[np.float64]

FINDERS = ("auto", "sectors", "classic")
FEWEST = 6  # corners of a ChArUco board that give its pose with something left to check it by
SUBPIXEL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


def find_corners(image: NDArray[Any], board: Board, finder: str = "auto") -> Array | None:
    """The inner corners (columns * rows, 2) of a board in a picture (height, width[, 3]) of 8 bits; None without it.

    In the order of `board.corners`; corners of a ChArUco board that are not seen are NaN. A chessboard counts only as
    a whole. `finder` says how chessboards are found: "sectors" is OpenCV's findChessboardCornersSB (Duda & Frese 2018),
    "classic" is findChessboardCorners with cornerSubPix, "auto" is the first of the two that finds it.
    """
    if finder not in FINDERS:
        raise ValueError(f"finder must be one of {', '.join(FINDERS)}, got {finder!r}")
    gray = image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    if board.dictionary is not None:
        return _charuco(gray, board)
    corners = _sectors(gray, board) if finder != "classic" else None
    return _classic(gray, board) if corners is None and finder != "sectors" else corners


def _sectors(gray: NDArray[Any], board: Board) -> Array | None:
    """Without EXHAUSTIVE first: it is quicker, and finds one of OpenCV's sample photographs that the other misses."""
    for flags in (cv2.CALIB_CB_ACCURACY, cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE):
        found, corners = cv2.findChessboardCornersSB(gray, (board.columns, board.rows), flags=flags)
        if found:
            return np.asarray(corners, dtype=float).reshape(-1, 2)
    return None


def _classic(gray: NDArray[Any], board: Board) -> Array | None:
    found, corners = cv2.findChessboardCorners(gray, (board.columns, board.rows))
    if not found:
        return None
    corners = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 1, 2)
    return np.asarray(cv2.cornerSubPix(gray, corners, (11, 11), (-1, -1), SUBPIXEL), dtype=float).reshape(-1, 2)


def _charuco(gray: NDArray[Any], board: Board) -> Array | None:
    corners, ids = charuco_detector(board).detectBoard(gray)[:2]
    if ids is None or len(ids) < FEWEST:
        return None
    seen = np.full((board.columns * board.rows, 2), np.nan)
    seen[np.ravel(ids)] = np.reshape(corners, (-1, 2))
    return seen


def charuco_detector(board: Board) -> Any:
    """OpenCV's detector of a ChArUco board; ValueError for a dictionary that it does not have or that is too small."""
    squares = (board.columns + 1, board.rows + 1)
    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if board.dictionary not in names:
        raise ValueError(f"dictionary must be one of {', '.join(names)}, got {board.dictionary!r}")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    held, needed = len(dictionary.bytesList), squares[0] * squares[1] // 2
    if held < needed:
        raise ValueError(f"dictionary must have the {needed} markers of this board, {board.dictionary} has {held}")
    return cv2.aruco.CharucoDetector(cv2.aruco.CharucoBoard(squares, board.square_size, board.marker_size, dictionary))
