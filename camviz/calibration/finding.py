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

from camviz.calibration.boards import Shape, kind_of
from camviz.calibration.chessboards import SMALLEST
from camviz.calibration.picture_files import PictureError, read_gray

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


Array = NDArray[np.float64]

FINDERS = ("auto", "sectors", "classic")


def find_corners(image: NDArray[Any], board: Shape, finder: str = "auto") -> Array | None:
    """The points (columns * rows, 2) of a board in a picture (height, width[, 3]) of 8 bits; None without it.

    In the order of `board.corners`, a chessboard's beginning at a black square in the board's corner; if both such
    squares are black, either of them may come first. Chessboards and circle grids count only as a whole; points of a
    ChArUco board or of an AprilGrid that are not seen are NaN. `finder` says how a chessboard is found: "sectors" is
    OpenCV's findChessboardCornersSB (Duda & Frese 2018), "classic" is findChessboardCorners with cornerSubPix, "auto"
    the first of the two that finds it.
    """
    if finder not in FINDERS:
        raise ValueError(f"finder must be one of {', '.join(FINDERS)}, got {finder!r}")
    gray = image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    if min(gray.shape) < SMALLEST:
        return None
    return kind_of(board).find(gray, board, finder)


def look(path: str, board: Shape, finder: str) -> tuple[tuple[int, int] | None, Array | None, str]:
    """The size (width, height) of a picture, the corners in it, and in words why there are none."""
    try:
        gray = read_gray(path)
    except PictureError as error:
        return None, None, error.why
    try:
        corners = find_corners(gray, board, finder)
    except cv2.error as error:
        return None, None, f"OpenCV's finder failed on it ({error.func})"
    why = "too little of the board was found in it" if kind_of(board).partial else "the board was not found in it"
    return (gray.shape[1], gray.shape[0]), corners, why if corners is None else ""


def look_on_request(requests: Connection, board: Shape, finder: str) -> None:
    """In a process of its own: say None when ready, then `look` at each picture asked for, until nobody asks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, ConnectionError):  # whoever asked has gone
        requests.send(None)
        while True:
            requests.send(_look_or_error(requests.recv(), board, finder))


def _look_or_error(path: str, board: Shape, finder: str) -> object:
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
