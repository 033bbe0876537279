"""How the markers of a ChArUco board lie beside each other in pictures, and which board has them so.

Two markers that are seen near each other tell how many squares they are apart. That needs no camera: each marker's own
outline says how long a square is there, and in which direction. So it holds under any distortion.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz_clinic.calibration.boards.charuco import marker_dictionary, markers, white_squares
from camviz_clinic.calibration.types import Board

Steps = Counter[tuple[int, int, int, int]]
"""How often the marker of the second number was seen so many squares to the right of that of the first, and below."""

REACH = 2.4  # squares between two markers that are held against each other
WHOLE = 0.35  # of a square: how far from a whole number of squares they may be
BORDERS = (1, 2)  # cells: OpenCV's and Kalibr's
MISREAD = (0.05, 0.95)  # of the numbers: what lies outside may be clutter taken for markers
ENOUGH = 8  # steps
EXPLAINED = 0.9  # of the steps, by the board that it is
BETTER, MORE = 0.02, 3  # of the steps, and steps: what it must explain beyond the board as described
SURE = 0.99  # of the steps: what the board explains where it is as described
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])  # of a marker, as OpenCV orders them


def steps_of(pictures: Iterable[NDArray[np.uint8]], board: Board, border_bits: int) -> Steps:
    """The steps between the markers of a ChArUco board's dictionary in grey pictures (height, width)."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border_bits
    detector = cv2.aruco.ArucoDetector(marker_dictionary(board.dictionary), parameters)
    found: Steps = Counter()
    for gray in pictures:
        outlines, ids, _ = detector.detectMarkers(gray)
        if ids is not None and len(ids) > 1:
            found.update(_steps(np.ravel(ids), np.reshape(outlines, (-1, 4, 2)).astype(float), board))
    return found


def _steps(ids: NDArray[np.int_], outlines: Array, board: Board) -> Iterator[tuple[int, int, int, int]]:
    """The steps in one picture, from the outlines (n, 4, 2) of its markers."""
    assert board.marker_size is not None
    middles = outlines.mean(axis=1)
    sides = CORNERS * board.marker_size / board.square_size
    pixels_per_square = np.einsum("nck,cl->nkl", outlines - middles[:, None], sides @ np.linalg.inv(sides.T @ sides))
    if (abs(np.linalg.det(pixels_per_square)) < 1).any():
        return
    squares_per_pixel = np.linalg.inv(pixels_per_square)
    apart = middles[None] - middles[:, None]  # [a, b] from a to b
    here = np.einsum("akl,abl->abk", squares_per_pixel, apart)
    there = np.einsum("bkl,abl->abk", squares_per_pixel, apart)
    squares = (here + there) / 2
    whole = np.rint(squares)
    near = (np.linalg.norm(squares, axis=-1) < REACH) & (abs(squares - whole).max(axis=-1) < WHOLE)
    for a, b in np.argwhere(near & (ids[:, None] < ids)):
        yield int(ids[a]), int(ids[b]), int(whole[a, b, 0]), int(whole[a, b, 1])


def likeliest(board: Board, seen: Mapping[int, Steps]) -> Board | None:
    """The ChArUco board that the steps by `border_bits` show, where it is surely not the one described; else None.

    It differs from the one described in as little as explains the most.
    """
    total = max((steps.total() for steps in seen.values()), default=0)
    if total < ENOUGH:
        return None
    shares = {each: _agreeing(each, seen.get(each.border_bits, Counter())) / total for each in _boards(board, seen)}
    best = max(shares, key=lambda each: (round(shares[each], 6), *_alike(board, each)))
    as_described = shares.get(board, 0.0)
    beyond = shares[best] - as_described
    return best if shares[best] >= EXPLAINED and beyond >= max(BETTER, MORE / total) else None


def explained(board: Board, steps: Steps) -> bool:
    """Whether nearly all steps, and enough of them, are those of a board."""
    return steps.total() >= ENOUGH and _agreeing(board, steps) >= SURE * steps.total()


def _boards(board: Board, seen: Mapping[int, Steps]) -> Iterator[Board]:
    """The board as described, and those that it may be instead."""
    held = len(marker_dictionary(board.dictionary).bytesList)
    sides = {(board.columns, board.rows), (board.rows, board.columns)}
    for border, (columns, rows), legacy in product(seen, sides, (False, True)):
        like = replace(board, columns=columns, rows=rows, legacy=legacy, border_bits=border)
        numbers = [number for a, b, *_ in seen[border].elements() for number in (a, b)] or [0]
        low, high = np.quantile(numbers, MISREAD).astype(int)
        firsts = {board.first_id, *range(max(high - markers(like) + 1, 0), low + 1)}
        yield from (replace(like, first_id=first) for first in firsts if first + markers(like) <= held)


def _agreeing(board: Board, steps: Steps) -> int:
    """How many steps are those of a board."""
    places = dict(enumerate(white_squares(board), board.first_id))
    agreeing = 0
    for (a, b, right, down), count in steps.items():
        if a in places and b in places:
            (x, y), (u, v) = places[a], places[b]
            agreeing += count * ((u - x, v - y) == (right, down))
    return agreeing


def _alike(board: Board, other: Board) -> tuple[int, int]:
    """How little two boards differ: in how many things, and in the first number; 0 where they are the same."""
    things = ("columns", "legacy", "border_bits", "first_id")
    differ = sum(getattr(board, name) != getattr(other, name) for name in things)
    return -differ, -abs(board.first_id - other.first_id)
