"""What a kind of board declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Gray = NDArray[np.uint8]
Area = tuple[float, float, float, float]


class Shape(Protocol):
    """The fields of a `Board`, which is also what a process that looks for boards is sent.

    >>> from camviz_clinic.calibration.boards.kind import regular
    >>> from camviz_clinic.calibration import Board
    >>> regular(Board(2, 2, 0.025))  # a function of a Shape takes a Board
    array([[0.   , 0.   ],
           [0.025, 0.   ],
           [0.   , 0.025],
           [0.025, 0.025]])
    """

    @property
    def columns(self) -> int: ...
    @property
    def rows(self) -> int: ...
    @property
    def square_size(self) -> float: ...
    @property
    def marker_size(self) -> float | None: ...
    @property
    def dictionary(self) -> str | None: ...
    @property
    def kind(self) -> str: ...
    @property
    def legacy(self) -> bool: ...
    @property
    def first_id(self) -> int: ...
    @property
    def border_bits(self) -> int: ...


@dataclass(frozen=True, eq=False)
class Drawing:
    """What of a board is black, in its own frame: x to the right, y down, its first point at (0, 0).

    Args:
        rectangles: (n, 4), x and y of the upper left, width and height, in metres.
        discs: (n, 3), x and y of the middle and the diameter, in metres.

    >>> from camviz_clinic.calibration import Board
    >>> board = Board(9, 6, 0.025)
    >>> from camviz_clinic.calibration.boards import kind_of
    >>> len(kind_of(board).drawn(board).rectangles)  # half of ten by seven squares
    35
    """

    rectangles: Array = field(default_factory=lambda: np.zeros((0, 4)))
    discs: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class BoardKind:
    """A kind of board: where its points are, what of it is black, and how it is found and described.

    The functions take a `Shape`. People count a board by what `counts` says and measure what `sized` says.

    Args:
        name, title: One word, and the words for people.
        counts: What people count: `per` points stand along each side of one.
        points: Gives the points (columns * rows, 2) in metres, row by row from the upper left, y down; the first is (0,
            0).
        area: Gives left, top, right and bottom in metres of the board with the white that its finder needs.
        drawn: Gives what is black, a Drawing.
        find: Takes a grey picture (height, width) of 8 bits, a shape and one of `finding.FINDERS`. Gives the points in
            pixels, (columns * rows, 2), NaN where one was not seen, or None.
        check: Raises ValueError for a board that cannot be.
        says, measures: Describe a board, and its sizes, in words.
        options: Says how the commands are told of it.
        sized: What people measure, such as "squares".
        size: Gives that in metres.
        advice: What to look at where it is not found.
        partial: Whether the board need not be seen as a whole.
        per: Points along each side of a thing that is counted.

    >>> from camviz_clinic.calibration.boards import kinds
    >>> kinds()["aprilgrid"].counts, kinds()["aprilgrid"].per
    ('tags', 2)
    """

    name: str
    title: str
    counts: str
    points: Callable[[Shape], Array]
    area: Callable[[Shape], Area]
    drawn: Callable[[Shape], Drawing]
    find: Callable[[Gray, Shape, str], Array | None]
    check: Callable[[Shape], None]
    says: Callable[[Shape], str]
    measures: Callable[[Shape], str]
    options: Callable[[Shape], str]
    sized: str
    size: Callable[[Shape], float]
    advice: str
    partial: bool = False
    per: int = 1


def regular(shape: Shape) -> Array:
    """The points of a board whose rows and columns are `square_size` apart."""
    x, y = np.meshgrid(np.arange(shape.columns, dtype=float), np.arange(shape.rows, dtype=float))
    return np.stack([x.ravel(), y.ravel()], axis=-1) * shape.square_size


def squares(shape: Shape) -> Drawing:
    """The black squares of a chessboard, one square beyond its corners to all sides; the upper left one is black."""
    side = shape.square_size
    black = [(i - 1, j - 1) for j in range(shape.rows + 1) for i in range(shape.columns + 1) if (i + j) % 2 == 0]
    corners = side * np.array(black, dtype=float)
    return Drawing(np.column_stack([corners, np.full((len(black), 2), side)]))


def area_of_squares(shape: Shape) -> Area:
    """The area of a chessboard's squares, one square beyond its corners to all sides."""
    side = shape.square_size
    return -side, -side, side * shape.columns, side * shape.rows


def cells(image: NDArray[Any], x: float, y: float, cell: float) -> list[tuple[float, float, float, float]]:
    """The black runs of a marker's rows of cells (n, n), as rectangles; its upper left is at (x, y)."""
    runs = []
    for row, line in enumerate(np.asarray(image)):
        edges = np.flatnonzero(np.diff(np.concatenate([[255], line, [255]]).astype(int)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            runs.append((x + start * cell, y + row * cell, (end - start) * cell, cell))
    return runs


def side(shape: Shape) -> float:
    """`square_size`, which is what is measured of most boards."""
    return shape.square_size


def squares_of(shape: Shape) -> str:
    """The size of a chessboard's squares in words."""
    return f"squares of {millimetres(shape.square_size)} mm"


def millimetres(length: float) -> str:
    """A length in metres as a number of millimetres."""
    return f"{1000 * length:g}"
