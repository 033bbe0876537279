"""Corners that were computed from markers nearby, and never looked for in the picture."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.doctor.shown import MOST, Shown
from camviz_clinic.checks.doctor.trouble import trouble

OFF = 0.15  # pixels: the smooth part of how far the corners are off (RMS), in the median of the views
SMOOTH = 0.75  # of the squares of how far they are off; a finder's own errors are smooth by 0.6 on photographs
FEWEST = 20  # corners of a view
DEGREE = 3  # of what is smooth over the board
KEPT = 0.9  # of a view's corners: the others are mistakes of the one finder or the other
SADDLES = ("chessboard", "charuco")  # kinds of boards whose points are where four squares meet
LEAST, LARGEST = 2, 7  # pixels to either side of a corner that it is refined from
CLEAR = 0.3  # of a square: what is kept clear of a chessboard's next corners
CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


@trouble(
    "interpolated corners",
    cause="corners that a homography of the markers gave, and no finder refined",
    finding="interpolated-corners",
)
def interpolated_corners(shown: Shown) -> Iterator[tuple[str, str, float, str]]:
    """The corners lie beside the points where four squares meet in the pictures, by a smooth pattern."""
    for name, (off, share) in smooth_errors(shown).items():
        if off > OFF and share > SMOOTH:
            sentence = (
                f"{name}: the corners are {off:.2g} px (RMS) from where four squares meet in the pictures. "
                f"{share:.0%} of that is smooth over the board, as if they were computed from markers and not found."
            )
            yield sentence, "camviz calibrate", off, "px"


def smooth_errors(shown: Shown) -> dict[str, tuple[float, float]]:
    """How far the corners are smoothly off the saddle points of the pictures, by camera, in the median of the views.

    First the RMS in pixels, then its share of the squares of all that they are off. Cameras without views of enough
    corners, or whose pictures are not shown, are left out.
    """
    calibration, found = shown.calibration, {}
    if calibration is None or calibration.board is None or calibration.board.kind not in SADDLES:
        return {}
    board = calibration.board
    for name, views in calibration.detections.items():
        pictures = calibration.pictures.get(name, ())
        if len(pictures) != len(views) or views.shape[1] != len(board.corners):
            continue
        chosen = np.unique(np.linspace(0, len(views) - 1, min(len(views), MOST)).round().astype(int))
        grays = [(view, shown.gray(pictures[view])) for view in chosen]
        errors = [_smooth_error(*_moved(gray, views[view], board)) for view, gray in grays if gray is not None]
        known = [each for each in errors if each is not None]
        if known:
            off, share = np.median(known, axis=0)
            found[name] = float(off), float(share)
    return found


def _moved(gray: NDArray[np.uint8], corners: Array, board: Board) -> tuple[Array, Array]:
    """Where on the board (n, 2), from -1 to 1, the corners of a view are, and how far (n, 2) they move when refined."""
    grid = corners.reshape(board.rows, board.columns, 2)
    spacing = np.concatenate([np.linalg.norm(np.diff(grid, axis=axis), axis=-1).ravel() for axis in (0, 1)])
    clear = CLEAR if board.marker_size is None else (1 - board.marker_size / board.square_size) / 2
    known = spacing[np.isfinite(spacing)]
    window = int(np.clip(clear * np.median(known), LEAST, LARGEST)) if len(known) else LEAST
    room = np.array(gray.shape[::-1]) - 1 - 2 * window
    inside = np.isfinite(corners).all(axis=-1) & (corners >= 2 * window).all(axis=-1) & (corners <= room).all(axis=-1)
    if not inside.any():
        return np.zeros((0, 2)), np.zeros((0, 2))
    start = np.ascontiguousarray(corners[inside], dtype=np.float32).reshape(-1, 1, 2)
    refined = cv2.cornerSubPix(gray, start, (window, window), (-1, -1), CRITERIA)
    return board.corners[inside, :2] / board.length * 2 - 1, np.reshape(refined, (-1, 2)) - corners[inside]


def _smooth_error(places: Array, moved: Array) -> tuple[float, float] | None:
    """RMS and share of the squares of what a polynomial explains of moves (n, 2); None for too few corners.

    The tenth that it explains least is left out.
    """
    if len(places) < FEWEST:
        return None
    columns = np.polynomial.polynomial.polyvander2d(places[:, 0], places[:, 1], [DEGREE, DEGREE])
    columns = columns[:, [i + j <= DEGREE for i in range(DEGREE + 1) for j in range(DEGREE + 1)]]
    kept = np.ones(len(places), dtype=bool)
    for _ in range(2):
        left = np.linalg.norm(moved - columns @ np.linalg.lstsq(columns[kept], moved[kept])[0], axis=1)
        kept = left <= np.quantile(left, KEPT)
    left = (moved - columns @ np.linalg.lstsq(columns[kept], moved[kept])[0])[kept]
    noise = float((left**2).sum() / max(kept.sum() - columns.shape[1], 1))
    whole = float((moved[kept] ** 2).sum() / kept.sum())
    return float(np.sqrt(max(whole - noise, 0))), max(1 - noise / max(whole, 1e-12), 0)
