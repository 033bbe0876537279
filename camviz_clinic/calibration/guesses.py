"""Which board a picture may show, where nobody says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz_clinic.calibration.boards import aprilgrid, kind_of
from camviz_clinic.calibration.boards.kind import Array
from camviz_clinic.calibration.chessboards import goes_on

Gray = NDArray[np.uint8]

FAMILIES = {"4X4": 1000, "5X5": 1000, "6X6": 1000, "7X7": 1000}  # of markers, and the largest dictionary of each
SIZES = (50, 100, 250, 1000)
FEWEST_MARKERS, MOST_SIDE = 4, 30
STRAY = 0.35  # of a tag's distance: where the tags of a guessed grid may be off a plane's picture
LEAST_CIRCLES = 12
ROUND = 0.82  # circularity 4π area/outline²; a square's is 0.79
LEAST_CORNERS = (4, 3)


@dataclass(frozen=True)
class Guess:
    """A board that a picture may show: in words with their article, and the options that ask for it."""

    says: str
    options: str


def guesses(gray: Gray) -> Iterator[Guess]:
    """The boards that a grey picture may show, the surest kind first; all of unknown size."""
    for guess in (_aprilgrid, _charuco, _circles, _chessboard):
        found = guess(gray)
        if found is not None:
            yield found


def _aprilgrid(gray: Gray) -> Guess | None:
    """By the tags' numbers: with the right number of columns their places are the picture of a plane's."""
    corners, ids, _ = aprilgrid.detector(aprilgrid.WINDOWS[0]).detectMarkers(gray)
    if ids is None or len(ids) < FEWEST_MARKERS:
        return None
    numbers = np.ravel(ids)
    middles = np.reshape(corners, (-1, 4, 2)).mean(axis=1)
    side = float(np.median(np.linalg.norm(np.diff(np.reshape(corners, (-1, 4, 2)), axis=1), axis=-1)))
    for across in range(2, MOST_SIDE):
        places = np.column_stack([numbers % across, -(numbers // across)]).astype(float)
        if _stray(places, middles) < STRAY * side:
            up = int(numbers.max() // across) + 1
            return Guess(f"an AprilGrid of {across}×{up} tags", f"--kind aprilgrid --board {across}x{up}")
    return None


def _stray(places: Array, seen: Array) -> float:
    """How far points (n, 2) of a picture are off the best homography of their places, in pixels; inf without one."""
    if min(np.ptp(places, axis=0)) == 0:
        return np.inf
    H = cv2.findHomography(places, seen)[0]
    if H is None:
        return np.inf
    return float(np.abs(cv2.perspectiveTransform(places[None], H)[0] - seen).max())


def _charuco(gray: Gray) -> Guess | None:
    """By the dictionary that most markers are of, the board by which most corners are found."""
    best, name = np.zeros(0, int), ""
    for family, largest in FAMILIES.items():
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{family}_{largest}"))
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(gray)
        if ids is not None and len(ids) > len(best):
            best, name = np.ravel(ids), family
    if len(best) < FEWEST_MARKERS or len(set(best.tolist())) < len(best):
        return None
    count = int(best.max()) + 1
    held = next((size for size in SIZES if size >= count), SIZES[-1])
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}_{held}"))
    sizes = [(a, b) for b in range(3, MOST_SIDE) for a in range(b, MOST_SIDE) if a * b // 2 in (count, count + 1)]
    found = {size: _corners(gray, size, dictionary) for size in sizes + [(b, a) for a, b in sizes]}
    if not found or max(found.values()) == 0:
        return Guess(f"markers of DICT_{name}_{held}", f"--charuco {name}_{held}")
    across, down = max(found, key=lambda size: found[size])
    return Guess(
        f"a ChArUco board of DICT_{name}_{held} with {across - 1}×{down - 1} inner corners",
        f"--board {across - 1}x{down - 1} --charuco {name}_{held}",
    )


def _corners(gray: Gray, squares: tuple[int, int], dictionary: Any) -> int:
    board = cv2.aruco.CharucoBoard(squares, 1.0, 0.75, dictionary)
    ids = cv2.aruco.CharucoDetector(board).detectBoard(gray)[1]
    return 0 if ids is None else len(ids)


def _chessboard(gray: Gray) -> Guess | None:
    """The largest chessboard that goes on to no side."""
    found: list[SimpleNamespace] = []
    for flags in (cv2.CALIB_CB_LARGER, cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE):
        seen, corners, meta = cv2.findChessboardCornersSBWithMeta(gray, LEAST_CORNERS, flags=flags)
        if seen:
            rows, columns = np.asarray(meta).shape[:2]
            board = SimpleNamespace(rows=rows, columns=columns, kind="chessboard")
            if not goes_on(gray, np.reshape(corners, (-1, 2)).astype(float), board):
                found.append(board)
    if not found:
        return None
    largest = max(found, key=lambda board: board.rows * board.columns)
    across, down = sorted((largest.columns, largest.rows), reverse=True)
    largest.columns, largest.rows = across, down
    return Guess(f"a {kind_of(largest).says(largest)}", f"--board {across}x{down}")


def _circles(gray: Gray) -> Guess | None:
    """By how many dark blobs there are: the grids of so many circles."""
    parameters = cv2.SimpleBlobDetector.Params()
    parameters.filterByCircularity, parameters.minCircularity = True, ROUND
    detector = cv2.SimpleBlobDetector.create(parameters)
    count = len(detector.detect(gray))
    if count < LEAST_CIRCLES:
        return None
    sizes = [(count // b, b) for b in range(3, count // 3 + 1) if count % b == 0]
    for kind, flags in (("circles", cv2.CALIB_CB_SYMMETRIC_GRID), ("asymmetric-circles", cv2.CALIB_CB_ASYMMETRIC_GRID)):
        for size in sizes:
            if cv2.findCirclesGrid(gray, size, flags=flags, blobDetector=detector)[0]:
                word = "a grid" if kind == "circles" else "an asymmetric grid"
                return Guess(f"{word} of {size[0]}×{size[1]} circles", f"--kind {kind} --board {size[0]}x{size[1]}")
    return None
