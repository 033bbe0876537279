"""Pictures of a board, and the board as it was described."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike, fspath
from pathlib import PurePath
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.picture_files import PictureError, read_gray
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.doctor.layout import BORDERS, Steps, explained, likeliest, steps_of

MOST = 12  # pictures in which markers are looked for
LARGE = 1600  # pixels along the longer side, beyond which markers are looked for in a smaller copy
FEWEST = 3  # inner corners along a side: no finder takes a smaller board


@dataclass(frozen=True, eq=False)
class Shown:
    """Pictures that should show a board, and the board as it was described.

    Args:
        board: As it was described.
        pictures: mapping of str to (height, width) or path, grey, 8 bits, or files, by the names that they have.
        calibration: What was solved from them.
        baseline: The distance of its pair's cameras in metres as somebody measured it.
        both: The corners that a pair's left and right camera saw, where they gave no calibration.

    >>> from camviz_clinic.calibration import Board
    >>> Shown(Board(9, 6, 0.025), {"a.png": np.zeros((480, 640), np.uint8)}).gray("a.png").shape
    (480, 640)
    """

    board: Board
    pictures: Mapping[str, NDArray[np.uint8] | str | PathLike[str]] = field(repr=False)
    calibration: Calibration | None = None
    baseline: float | None = None
    both: tuple[Detections, Detections] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, paths: Sequence[str | PathLike[str]], board: Board) -> Shown:
        """The pictures in files.

        Args:
            paths: The files.
            board: As it was described.

        Returns: The files by their paths; they are read when asked for.
        """
        return cls(board, {fspath(path): path for path in paths})

    def gray(self, name: str) -> NDArray[np.uint8] | None:
        """A picture by its name, or by the last part of it where that is the name of one alone.

        Args:
            name: A name, or the last part of a path.

        Returns: (height, width) of uint8, or None, grey; None where there is no such picture, or it cannot be read.
        """
        alike = [each for each in self.pictures if name == each] or [
            each for each in self.pictures if PurePath(each).name == PurePath(name).name
        ]
        if len(alike) != 1:
            return None
        picture: Any = self.pictures[alike[0]]
        if isinstance(picture, np.ndarray):
            return picture
        try:
            return read_gray(picture)
        except PictureError:  # it is named where the board is looked for
            return None

    @property
    def has_markers(self) -> bool:
        """Whether the board as described is a ChArUco board that can be found at all."""
        return self.board.kind == "charuco" and min(self.board.columns, self.board.rows) >= FEWEST

    @cached_property
    def likeliest(self) -> Board | None:
        """The ChArUco board that the markers show, where it is surely another than the one described; else None."""
        if not self.has_markers:
            return None
        pictures = list(self._some())
        seen: dict[int, Steps] = {}
        for border in sorted({self.board.border_bits, *BORDERS}, key=lambda each: each != self.board.border_bits):
            seen[border] = steps_of(pictures, self.board, border)
            if border == self.board.border_bits and explained(self.board, seen[border]):
                return None
        return likeliest(self.board, seen)

    def _some(self) -> Iterator[NDArray[np.uint8]]:
        """At most a dozen of the pictures that can be read, from the first to the last, made smaller."""
        names = list(self.pictures)
        chosen = np.unique(np.linspace(0, len(names) - 1, min(len(names), MOST)).round().astype(int))
        for place in chosen if names else ():
            gray = self.gray(names[place])
            if gray is None:
                continue
            scale = min(LARGE / max(gray.shape), 1)
            size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
            yield np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), np.uint8) if scale < 1 else gray
