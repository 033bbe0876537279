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

from camviz.colour.picture_files import PictureError, read_gray
from camviz_clinic.calibration.boards import Shape, kind_of
from camviz_clinic.calibration.chessboards import SMALLEST

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


Array = NDArray[np.float64]

FINDERS = ("auto", "sectors", "classic", "saddles")


def find_corners(image: NDArray[Any], board: Shape, finder: str = "auto") -> Array | None:
    """The points of a board in one picture.

    In the order of `board.corners`, a chessboard's beginning at a black square in the board's corner; if both such
    squares are black, either of them may come first. Chessboards and circle grids count only as a whole.

    Args:
        image: (height, width) or (height, width, 3), grey or RGB, 8 bits.
        board: Board, what to look for.
        finder: {"auto", "sectors", "classic", "saddles"}, how a chessboard is found. "sectors" is OpenCV's
            findChessboardCornersSB, "classic" is findChessboardCorners with cornerSubPix in OpenCV's window of 23
            pixels, in which corners of narrow squares run together; "auto" is the first of the two that finds it, in a
            window clear of the next ones. "saddles" refines the corners of "auto" in such a window.

    Returns:
        (columns * rows, 2) or None, pixels, NaN for points of a ChArUco board or of an AprilGrid that are not seen;
        None without the board.

    Raises: ValueError for another finder, and for a picture of another form.
    Source: A. Duda & U. Frese, *Accurate detection and localization of checkerboard corners for calibration*, BMVC
    (2018).

    >>> from camviz_clinic.calibration.types import Board
    >>> squares = np.add.outer(np.arange(7), np.arange(10)) % 2 * 255  # of ten by seven, the first one black
    >>> picture = np.pad(squares, 1, constant_values=255).repeat(30, axis=0).repeat(30, axis=1).astype(np.uint8)
    >>> find_corners(picture, Board(9, 6, 0.025))[:2].round(1)  # edges lie between pixels 59 and 60, 89 and 90
    array([[59.5, 59.5],
           [89.5, 59.5]])
    """
    check_finder(finder)
    if image.dtype != np.uint8 or not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ValueError(f"image must be uint8 (height, width) or (height, width, 3), got {image.dtype} {image.shape}")
    gray = image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    if min(gray.shape) < SMALLEST:
        return None
    return kind_of(board).find(gray, board, finder)


def check_finder(finder: str) -> None:
    """Raises ValueError for a finder that is not one of FINDERS."""
    if finder not in FINDERS:
        raise ValueError(f"finder must be one of {', '.join(FINDERS)}, got {finder!r}")


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
