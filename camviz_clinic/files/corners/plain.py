"""Corners as a table: image,row,column,u,v or image,index,u,v or image,X,Y,Z,u,v."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from camviz_clinic.calibration.types import Board, CalibrationError
from camviz_clinic.files.corners.format import CornerCollector, CornerFile, CornerFormat, Corners, Given
from camviz_clinic.files.trees import shown

BY_PLACE, BY_INDEX, BY_POINT = ("row", "column"), ("index",), ("x", "y", "z")
HEADERS = ("image,row,column,u,v", "image,index,u,v", "image,X,Y,Z,u,v")
EVEN = 0.01  # of a square: how far off the grid a point may lie
LONGEST = 10_000  # characters of a line

Row = tuple[int, dict[str, str]]


def is_table(file: CornerFile) -> bool:
    """True where the first line names an image, u and v."""
    return {"image", "u", "v"} <= set(_names(file))


def read(files: Sequence[CornerFile], given: Given) -> Corners:
    """All pictures of one camera; a corner without a line, or without u and v, was not seen."""
    (file,) = files
    sheet, names = CornerCollector(file), _names(file)
    keys = tuple(name for name in names if name not in ("image", "u", "v"))
    if sorted(keys) not in (sorted(BY_PLACE), sorted(BY_INDEX), sorted(BY_POINT)) or len(set(names)) < len(names):
        raise sheet.complaint(1, f"expected one of the headers {' or '.join(HEADERS)}, got {shown(','.join(names))}")
    rows = _rows(sheet, names)
    if not rows:
        raise CalibrationError(f"{file.path}: expected a line for each corner, there are none below the header")
    if "index" in keys:
        board = given.board()
        most = board.columns * board.rows - 1
        places = [divmod(sheet.count(line, row["index"], "index", most), board.columns) for line, row in rows]
    elif "row" in keys:
        places = [tuple(sheet.count(line, row[key], key, 999) for key in BY_PLACE) for line, row in rows]  # type: ignore[misc]
        board = given.board(given.shape or _shape(places))
    else:
        board, places = _of_points(sheet, rows, given)
    for (line, row), place in zip(rows, places, strict=True):
        if not row["image"]:
            raise sheet.complaint(line, "expected the name of an image, got nothing")
        sheet.picture(row["image"])
        u, v = (sheet.number(line, row[axis], axis) for axis in "uv")
        if np.isfinite(u) and np.isfinite(v):
            sheet.add(line, row["image"], place, (u, v))
    return sheet.corners(board)


def _names(file: CornerFile) -> tuple[str, ...]:
    """The header's words in small letters."""
    return tuple(word.strip().lower() for word in file.head[0].split(",")) if file.head else ()


def _rows(sheet: CornerCollector, names: tuple[str, ...]) -> list[Row]:
    """The lines below the header with their numbers, each by the header's names."""
    rows: list[Row] = []
    reader = csv.reader(io.StringIO(sheet.file.text.replace("\0", "")), skipinitialspace=True)
    try:
        for words in reader:
            line = reader.line_num
            if not any(word.strip() for word in words):
                continue
            if len(words) != len(names):
                raise sheet.complaint(line, f"expected {len(names)} values as in the header, got {len(words)}")
            rows.append((line, {name: word.strip() for name, word in zip(names, words, strict=True)}))
    except csv.Error as error:
        raise sheet.complaint(reader.line_num, f"expected values between commas ({error})") from error
    return rows[1:]


def _shape(places: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """(columns, rows) of the smallest board that has all these (row, column)."""
    rows, columns = np.max(places, axis=0) + 1
    return int(columns), int(rows)


def _of_points(sheet: CornerCollector, rows: list[Row], given: Given) -> tuple[Board, list[tuple[int, int]]]:
    """The board whose corners lie at X along a row and Y across, and the (row, column) of every line.

    X, Y and Z are in metres, or in any unit where the side of a square is given.
    """
    points = np.array([[sheet.number(line, row[axis], axis.upper()) for axis in BY_POINT] for line, row in rows])
    for (line, _), (_, _, z) in zip(rows, points, strict=True):
        if z != 0:
            raise sheet.complaint(line, f"expected a flat board with Z = 0, got Z = {z:g}")
    if np.isnan(points).any():
        (first, *_), *_ = np.argwhere(np.isnan(points))
        raise sheet.complaint(rows[first][0], "expected X and Y of a corner as numbers, got nothing")
    steps = [
        later - earlier for axis in (0, 1) for earlier, later in pairwise(np.unique(points[:, axis])) if later > earlier
    ]
    if not steps:
        raise CalibrationError(f"{sheet.file.path}: expected the corners of a board, all lines have the same X and Y")
    step = _step(steps)
    grid = (points[:, :2] - points[:, :2].min(axis=0)) / step
    places = np.rint(grid).astype(int)
    for (line, _), place, exact in zip(rows, places, grid, strict=True):
        if np.abs(exact - place).max() > EVEN or place.max() > 999:
            raise sheet.complaint(
                line,
                f"expected X and Y on a grid of equal squares, {step:g} wide, got {exact[0]:g} by {exact[1]:g} of them",
            )
    shape = int(places[:, 0].max()) + 1, int(places[:, 1].max()) + 1
    board = given.board(shape, None if given.square_size else float(step))
    return board, [(int(y), int(x)) for x, y in places]


def _step(steps: Sequence[float]) -> float:
    """The side of a square: the least distance between two columns or rows that is no rounding error."""
    largest = max(steps)
    return float(min(step for step in steps if step > largest * 1e-6))


FORMAT = CornerFormat(
    name="csv",
    title="a table (" + " or ".join(HEADERS) + ")",
    recognise=is_table,
    read=read,
    several=False,
    holds="the board with row and column (but for the square) or X, Y, Z",
    says="row, column and index count from 0, row by row; X along a row, Y across, in metres unless --square-mm is "
    "given; a corner that was not seen has no line, or - for u and v; first pixel's centre at (0, 0)",
    source="this page",
    example={
        "corners.csv": b"image,row,column,u,v\n"
        + b"".join(
            b"view%d.png,%d,%d,%.3f,%.3f\n"
            % (view, row, column, 100 + 40 * column + 7 * view, 90 + 41 * row - 3 * view * column)
            for view in range(3)
            for row in range(3)
            for column in range(4)
        )
    },
)
