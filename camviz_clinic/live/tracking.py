"""The board in one frame of a live camera: found in a few hundredths of a second, and whether it rests and is sharp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz_clinic.calibration.chessboards import LEAST_SIDE
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.types import Board

Gray = NDArray[np.uint8]

STILL = 0.06  # of the picture's width in a second: what is slower than that, no webcam's exposure blurs
LONG_S = 0.2  # between two frames: a hand that was quick in a longer while may have come back
BLURRED = 0.4  # of the sharpest board so far; edges are then 1.6 times as wide
CHECKED, SEARCHED = 640, 427  # pixels along the longer side of the copies in which a chessboard is looked for
AROUND = 12  # pixels around the corners that belong to the board


@dataclass(frozen=True, eq=False)
class Tracked:
    """The board in one frame: `corners` (n, 2) in pixels, NaN where unseen, in either order of a symmetric board."""

    corners: Array
    time_s: float
    sharpness: float

    def still_since(self, before: Tracked | None, width: int) -> bool:
        """Whether the board moved slower than STILL since the frame before."""
        if before is None or not self.time_s > before.time_s:
            return False
        allowed = STILL * width * min(self.time_s - before.time_s, LONG_S)
        return apart(self.corners, before.corners) < allowed


def track(gray: Gray, board: Board, time_s: float) -> Tracked | None:
    """The board in a frame, to about a pixel; None where it is not seen.

    Markers and circles are found as in any picture. A chessboard is looked for only where OpenCV's quick check sees
    squares, and by its quicker finder; `find_corners` takes up to a second for what this does in a tenth.
    """
    corners = _chessboard(gray, board) if board.kind == "chessboard" else find_corners(gray, board)
    return None if corners is None else Tracked(corners, time_s, sharpness(gray, corners))


def _chessboard(gray: Gray, board: Board) -> Array | None:
    size = (board.columns, board.rows)
    if min(size) < LEAST_SIDE or not cv2.checkChessboard(_shrunk(gray, CHECKED), size):
        return None
    small = _shrunk(gray, SEARCHED)
    found, corners = cv2.findChessboardCorners(small, size, flags=0)
    scale = gray.shape[1] / small.shape[1]
    return scale * (np.asarray(corners, dtype=float).reshape(-1, 2) + 0.5) - 0.5 if found else None


def _shrunk(gray: Gray, side: int) -> Gray:
    """A copy of so many pixels along the longer side; the picture itself where it has no more."""
    scale = side / max(gray.shape)
    size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), np.uint8) if scale < 1 else gray


def sharpness(gray: Gray, corners: Array) -> float:
    """∑ (∂²I)² / ∑ (∂I)² around the corners (n, 2), in 1/px², along rows or columns, whichever is less.

    Of edges that are blurred by σ along that axis it is 1/(2σ²), whatever their contrast and number.
    """
    low, high = np.nanmin(corners, axis=0) - AROUND, np.nanmax(corners, axis=0) + AROUND
    left, top = np.maximum(low, 0).astype(int)
    right, bottom = np.ceil(high).astype(int)
    part = gray[top:bottom, left:right].astype(np.float32)
    part = cv2.GaussianBlur(part, (0, 0), 1.0)  # noise has more second derivatives than edges have
    slopes = [float(np.sum(np.diff(part, axis=axis) ** 2)) for axis in (0, 1)]
    bends = [float(np.sum(np.diff(part, 2, axis=axis) ** 2)) for axis in (0, 1)]
    return min(bend / slope if slope > 0 else 0.0 for bend, slope in zip(bends, slopes, strict=True))


def apart(corners: Array, others: Array) -> float:
    """The mean distance in pixels of corners (n, 2) from others, a board turned by 180° counting as the same.

    Infinite where they have no corner in common.
    """
    ways = (np.linalg.norm(corners - each, axis=-1) for each in (others, others[::-1]))
    return min(float(np.nanmean(way)) if np.isfinite(way).any() else np.inf for way in ways)


def decoded(jpeg: Any) -> Gray:
    """The grey levels (height, width) of a JPEG from the page. Raises ValueError for what is none."""
    content = np.frombuffer(jpeg, np.uint8)
    gray = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE) if len(content) else None
    if gray is None:
        raise ValueError("the frame must be a JPEG, got something that OpenCV does not read")
    return np.asarray(gray, np.uint8)
