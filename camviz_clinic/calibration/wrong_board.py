"""Whether pictures show another board than the one that was asked for, and which."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.picture_files import PictureError, read_gray
from camviz.lenses.base import Array
from camviz_clinic.calibration.boards import Shape, kind_of
from camviz_clinic.calibration.chessboards import goes_on
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.guesses import guesses

LOOKED_AT = 6  # pictures, spread over all of them
LARGEST = 1000  # pixels along the longer side of what is looked at
NAMED = 3

Gray = NDArray[np.uint8]


def another_board(paths: Sequence[str | PathLike[str]], names: Sequence[str], board: Shape) -> str:
    """What pictures show in which `board` was not found: "left01.jpg … show what looks like a …: try …", or nothing.

    A board of markers may be there in a mirror's image. Two pictures must agree, unless there is but one.
    """
    votes: dict[str, list[str]] = {}
    says = {}
    chosen = _spread(len(paths))
    pictures = {place: gray for place in chosen if (gray := _gray(paths[place])) is not None}
    mirrored = [names[place] for place, gray in pictures.items() if _mirrored(gray, board)]
    if mirrored and len(mirrored) >= min(2, len(chosen)):
        return f"{_show(mirrored)} this board mirrored: turn off the camera's mirroring, or flip them left to right"
    for place, gray in pictures.items():
        guess = next(guesses(_smaller(gray)), None)
        if guess is not None:
            votes.setdefault(guess.options, []).append(names[place])
            says[guess.options] = guess.says
    if not votes:
        return ""
    options, seen = max(votes.items(), key=lambda each: len(each[1]))
    if len(seen) < min(2, len(chosen)):
        return ""
    return f"{_show(seen)} what looks like {says[options]}: try {options}"


def part_of_a_larger(
    paths: Sequence[str | PathLike[str]], names: Sequence[str], corners: Sequence[Array], board: Shape
) -> str:
    """Where a chessboard goes on beyond what was found of it in most pictures: a sentence that says so, or nothing.

    `corners` are those found in the pictures of `paths`, each (columns * rows, 2).
    """
    if kind_of(board).name != "chessboard":
        return ""
    more = []
    chosen = _spread(len(paths))
    for place in chosen:
        gray = _gray(paths[place])
        if gray is not None and goes_on(gray, corners[place], board):
            more.append(place)
    if not more or 2 * len(more) <= len(chosen):
        return ""
    seen = another_board([paths[place] for place in more], [names[place] for place in more], board)
    rest = f": {seen}" if seen else ": count all corners where four squares meet"
    return f"{_show([names[place] for place in more])} more squares than a {kind_of(board).says(board)} has{rest}"


def _mirrored(gray: Gray, board: Shape) -> bool:
    """Whether a picture shows the board flipped left to right; squares and circles look alike then, markers do not."""
    has_markers = kind_of(board).partial  # they alone tell which part of a board is seen
    return has_markers and find_corners(np.ascontiguousarray(gray[:, ::-1]), board, "classic") is not None


def _gray(path: str | PathLike[str]) -> Gray | None:
    """The picture, or None for a file that cannot be read, which is named elsewhere."""
    try:
        return read_gray(path)
    except PictureError:
        return None


def _smaller(gray: Gray) -> Gray:
    scale = min(LARGEST / max(gray.shape), 1)
    height, width = (round(side * scale) for side in gray.shape)
    return np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _spread(count: int) -> list[int]:
    return sorted(set(np.linspace(0, count - 1, min(count, LOOKED_AT)).round().astype(int).tolist()))


def _show(names: Sequence[str]) -> str:
    """ "a.png and b.png show", "a.png shows", with at most three names."""
    return f"{enumerated(names, most=NAMED)} {'shows' if len(names) == 1 else 'show'}"
