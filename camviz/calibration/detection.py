"""Boards in many pictures, found by several processes at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from camviz.calibration.finding import find_corners
from camviz.files.calibration import Board
from camviz.lenses.base import Array

__all__ = ["Detections", "detect", "find_corners"]

Progress = Callable[[int, int], object]


@dataclass(frozen=True, eq=False)
class Detections:
    """The board's corners (views, corners, 2) in pictures of one size, in pixels, NaN where a corner was not seen.

    `pictures` names the views. `skipped` are the pictures without a view, each with the reason. `places` are the views'
    indices among all the pictures that were looked at, by which those of a pair find each other.
    """

    pictures: tuple[str, ...]
    corners: Array
    width: int
    height: int
    skipped: tuple[tuple[str, str], ...] = ()
    places: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.corners.ndim != 3 or self.corners.shape[-1] != 2 or len(self.corners) != len(self.pictures):
            raise ValueError(
                f"corners must have shape ({len(self.pictures)}, corners, 2), as there are pictures, "
                f"got {self.corners.shape}"
            )
        if not self.places:
            object.__setattr__(self, "places", tuple(range(len(self.pictures))))


def detect(
    paths: Sequence[str | PathLike[str]],
    board: Board,
    *,
    finder: str = "auto",
    workers: int | None = None,
    progress: Progress | None = None,
) -> Detections:
    """Find the board in pictures. Those without it, unreadable or of another size than most are skipped."""
    names = [Path(path).name for path in paths]
    found, sizes, skipped = {}, {}, {}
    for place, path in enumerate(paths):
        gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
        if gray is None:
            skipped[place] = "it is not a picture that can be read"
            continue
        corners = find_corners(gray, board, finder)
        if corners is None:
            skipped[place] = "no board was found in it"
            continue
        found[place], sizes[place] = corners, gray.shape[::-1]
        if progress:
            progress(place + 1, len(paths))
    if not found:
        raise ValueError(f"no board with {board.columns}×{board.rows} inner corners was found")
    ((width, height), _), *_ = Counter(sizes.values()).most_common()
    places = tuple(place for place in found if sizes[place] == (width, height))
    return Detections(
        tuple(names[place] for place in places),
        np.stack([found[place] for place in places]),
        width,
        height,
        tuple((names[place], why) for place, why in skipped.items()),
        places,
    )
