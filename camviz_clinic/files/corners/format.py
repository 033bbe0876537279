"""What a format of corner files is, the file that it is asked about, and the corners that it gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.types import Board, CalibrationError
from camviz_clinic.files.text import read_bytes, text_of
from camviz_clinic.files.trees import shown

Said = TypeVar("Said")

MOST_BYTES = 128 * 2**20  # a million corners or two
MOST_CORNERS = 40_000  # of one board: 200 × 200
FARTHEST = 1e6  # pixels
MISSING = ("-", "", "nan")  # what stands for a coordinate where no corner was seen


@dataclass(frozen=True)
class CornerFile:
    r"""A text file that may hold corners. Its content is read once, when asked for.

    Args:
        path: Where it is.

    >>> from pathlib import Path
    >>> _ = Path("corners.vnl").write_text("# filename x y\n\nleft.png 10 20\n")
    >>> list(CornerFile(Path("corners.vnl")).lines)
    [(1, '# filename x y'), (3, 'left.png 10 20')]
    """

    path: Path

    @cached_property
    def text(self) -> str:
        """The whole of it; CalibrationError for what is no text, or too long to be corners."""
        return text_of(read_bytes(self.path, MOST_BYTES, "corner file"), "corners", "")

    @property
    def lines(self) -> Iterator[tuple[int, str]]:
        """Every line that is not empty with its number, from 1, without white space around it."""
        return ((number, line.strip()) for number, line in enumerate(self.text.split("\n"), 1) if line.strip())

    @cached_property
    def head(self) -> list[str]:
        """The first lines that are not empty, five at most."""
        return [line for _, (_, line) in zip(range(5), self.lines, strict=False)]


@dataclass(frozen=True)
class Given:
    """What the caller says of corner files; what a file says itself must agree.

    Args:
        shape: The board's inner corners as (columns, rows).
        square_size: Side of a square in metres.

    >>> Given(shape=(9, 6)).board(square_size=0.025).square_size  # the one from the caller, the other from the file
    0.025
    """

    shape: tuple[int, int] | None = None
    square_size: float | None = None

    def board(self, shape: tuple[int, int] | None = None, square_size: float | None = None) -> Board:
        """The board of a file that says so much of it.

        Args:
            shape: What the file says: inner corners as (columns, rows).
            square_size: What the file says: side of a square in metres.

        Returns: A chessboard.
        Raises: CalibrationError where something is missing or contradicts.
        """
        columns, rows = self._one("inner corners", self.shape, shape, "--board COLUMNSxROWS (inner corners)")
        side = self._one("side of a square", self.square_size, square_size, "--square-mm MM")
        if columns * rows > MOST_CORNERS:
            raise CalibrationError(f"expected a board of at most {MOST_CORNERS} corners, got {columns}×{rows}")
        return Board(columns, rows, side)

    @staticmethod
    def _one(what: str, given: Said | None, read: Said | None, option: str) -> Said:
        if given is None and read is None:
            raise CalibrationError(f"it does not hold the board's {what}: give {option}")
        if given is not None and read is not None and not np.allclose(given, read, rtol=1e-3, atol=0):  # type: ignore[arg-type]
            raise CalibrationError(
                f"it has the board's {what} as {_words(read)}, and {option.split()[0]} says {_words(given)}"
            )
        return given if given is not None else read  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Corners:
    r"""What corner files hold: the corners of a board by picture.

    Attributes:
        board: What was seen.
        pictures: mapping of str to (columns * rows, 2), pixels by picture, the first pixel's centre at (0, 0), in the
            order of `Board.corners`; NaN where a corner was not seen.
        lines: mapping of str to (columns * rows,) of int, by picture the number of the line in which each corner
            stands.
        files: By picture the file.
        size: Width and height of the pictures in pixels, where the files hold it.
        notes: What a reader should know.

    >>> from pathlib import Path
    >>> from camviz_clinic.files.corners import corner_formats
    >>> _ = Path("corners.vnl").write_text("# filename x y\nleft.png 10 20\nleft.png - -\n")
    >>> read = corner_formats()["mrcal"].read([CornerFile(Path("corners.vnl"))], Given((2, 1), 0.025))
    >>> read.pictures["left.png"]
    array([[10., 20.],
           [nan, nan]])
    """

    board: Board
    pictures: Mapping[str, Array]
    lines: Mapping[str, Array] = field(repr=False)
    files: Mapping[str, Path] = field(repr=False)
    size: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class CornerFormat:
    """One program's corner files. A module of `camviz_clinic.files.corners` that has one as FORMAT adds it everywhere.

    `load_corners`, the help of the commands, the table in docs/formats.md and the tests read these fields.

    Args:
        name: One word.
        title: The program's file, as sentences name it: "mrcal's corners.vnl".
        recognise: True for a CornerFile of this format.
        read: From a sequence of CornerFile and what is Given to Corners; raises CalibrationError for what it cannot
            take.
        several: Whether a set of pictures may be several files.
        holds: What of board and image size it holds, for the docs.
        says: Its conventions.
        source: Where its layout is written down.
        example: Small files by their names.

    >>> from camviz_clinic.files.corners import corner_formats
    >>> list(corner_formats()["mrcal"].example)
    ['corners.vnl']
    """

    name: str
    title: str
    recognise: Callable[[CornerFile], bool]
    read: Callable[[Sequence[CornerFile], Given], Corners]
    several: bool
    holds: str
    says: str
    source: str
    example: Mapping[str, bytes]


@dataclass(eq=False)
class CornerCollector:
    """Collects corners while files are read; every complaint names the file and the line."""

    file: CornerFile
    seen: dict[str, dict[tuple[int, int], tuple[float, float, int]]] = field(default_factory=dict)

    def complaint(self, line: int, expected: str) -> CalibrationError:
        """What is wrong in a line, as an error to be raised."""
        return CalibrationError(f"{self.file.path}: line {line}: {expected}")

    def picture(self, name: str) -> None:
        """Note a picture, which may show no corner."""
        self.seen.setdefault(name, {})

    def add(self, line: int, picture: str, place: tuple[int, int], pixel: tuple[float, float]) -> None:
        """Note a corner by its (row, column) on the board; refuses a second one at the same place."""
        of_picture = self.seen.setdefault(picture, {})
        if place in of_picture:
            first = of_picture[place][2]
            row, column = place
            raise self.complaint(
                line,
                f"expected each corner once, {shown(picture)} has row {row}, column {column} in line {first} already",
            )
        of_picture[place] = (*pixel, line)

    def number(self, line: int, word: str, what: str) -> float:
        """A finite number, such as a coordinate in pixels; NaN where the word says that there is none."""
        if word.lower() in MISSING:
            return math.nan
        try:
            value = float(word)
        except ValueError:
            value = math.inf
        if not abs(value) <= FARTHEST:
            raise self.complaint(line, f"expected {what} as a number, or - where there is none, got {shown(word)}")
        return value

    def count(self, line: int, word: str, what: str, most: int = MOST_CORNERS) -> int:
        """A whole number from 0 to `most`."""
        if not (word.isascii() and word.isdigit() and len(word) < 10 and int(word) <= most):
            raise self.complaint(line, f"expected {what} as a whole number from 0 to {most}, got {shown(word)}")
        return int(word)

    def corners(self, board: Board, size: tuple[int, int] | None = None, notes: tuple[str, ...] = ()) -> Corners:
        """All of it on a board; refuses a corner that lies beyond the board."""
        pictures, lines = {}, {}
        for name, places in self.seen.items():
            pixels, numbers = (
                np.full((board.rows * board.columns, 2), np.nan),
                np.zeros(board.rows * board.columns, int),
            )
            for (row, column), (u, v, line) in places.items():
                if row >= board.rows or column >= board.columns:
                    raise self.complaint(
                        line,
                        f"expected a corner of a board of {board.columns}×{board.rows} inner corners, got row {row}, "
                        f"column {column} (both count from 0)",
                    )
                pixels[row * board.columns + column], numbers[row * board.columns + column] = (u, v), line
            pictures[name], lines[name] = pixels, numbers
        return Corners(board, pictures, lines, dict.fromkeys(pictures, self.file.path), size, notes)


def _words(value: object) -> str:
    """(9, 6) as "9×6", 0.025 as "25 mm"."""
    return "×".join(map(str, value)) if isinstance(value, tuple) else f"{1000 * float(value):.6g} mm"  # type: ignore[arg-type]
