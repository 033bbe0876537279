"""The ChArUco board: a chessboard with markers in its white squares, which tell its corners apart."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from camviz_clinic.calibration.boards.kind import (
    Array,
    BoardKind,
    Drawing,
    Gray,
    Shape,
    area_of_squares,
    cells,
    millimetres,
    regular,
    side,
    squares_of,
)

WIDEST_BORDER = 2  # cells
FEWEST = 6  # corners that give the board's pose with something left to check it by


def find(gray: Gray, shape: Shape, finder: str) -> Array | None:
    """The corners that are seen, NaN for the others; None where there are few.

    A board may be printed white on black, as caliscope prints it to save ink: then it is in the negative.
    """
    one = detector(shape)
    for picture in (gray, 255 - gray):
        corners, ids = one.detectBoard(picture)[:2]
        if ids is not None and len(ids) >= FEWEST:
            seen = np.full((shape.columns * shape.rows, 2), np.nan)
            seen[np.ravel(ids)] = np.reshape(corners, (-1, 2))
            return seen
    return None


def detector(shape: Shape) -> Any:
    """OpenCV's detector of a ChArUco board; ValueError for a board that cannot be."""
    import cv2

    assert shape.marker_size is not None
    size = (shape.columns + 1, shape.rows + 1)
    dictionary = charuco_dictionary(shape)
    ids = np.arange(shape.first_id, shape.first_id + markers(shape))
    board = cv2.aruco.CharucoBoard(size, shape.square_size, shape.marker_size, dictionary, ids)
    board.setLegacyPattern(shape.legacy)
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = shape.border_bits
    return cv2.aruco.CharucoDetector(board, cv2.aruco.CharucoParameters(), parameters)


def markers(shape: Shape) -> int:
    """How many markers a board has, one in each white square."""
    return len(white_squares(shape))


def white_squares(shape: Shape) -> list[tuple[int, int]]:
    """Column and row of the white squares in the order of their markers, row by row.

    The square at the upper left is black, but of OpenCV's legacy boards with an even number of rows.
    """
    odd = 0 if shape.legacy and (shape.rows + 1) % 2 == 0 else 1
    return [(i, j) for j in range(shape.rows + 1) for i in range(shape.columns + 1) if (i + j) % 2 == odd]


def charuco_dictionary(shape: Shape) -> Any:
    """OpenCV's dictionary of a board's markers; ValueError for one that it does not have or that is too small."""
    return marker_dictionary(shape.dictionary, shape.first_id + markers(shape))


@lru_cache(maxsize=8)
def marker_dictionary(name: str | None, needed: int = 0) -> Any:
    """OpenCV's dictionary of this name; ValueError for one that it does not have, or that holds fewer than needed."""
    import cv2

    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if name not in names:
        raise ValueError(f"dictionary must be one of {', '.join(names)}, got {name!r}")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    held = len(dictionary.bytesList)
    if held < needed:
        raise ValueError(f"dictionary must have the {needed} markers of this board, {name} has {held}")
    return dictionary


def drawn(shape: Shape) -> Drawing:
    """The squares; and the markers in the middles of the white ones, numbered row by row as OpenCV has them."""
    import cv2

    assert shape.marker_size is not None
    dictionary, side, white = charuco_dictionary(shape), shape.square_size, white_squares(shape)
    count = dictionary.markerSize + 2 * shape.border_bits
    off, cell = (side - shape.marker_size) / 2, shape.marker_size / count
    every = {(i, j) for j in range(shape.rows + 1) for i in range(shape.columns + 1)}
    runs = [((i - 1) * side, (j - 1) * side, side, side) for i, j in sorted(every - set(white))]
    for number, (i, j) in enumerate(white, shape.first_id):
        image = cv2.aruco.generateImageMarker(dictionary, number, count, borderBits=shape.border_bits)
        runs += cells(image, (i - 1) * side + off, (j - 1) * side + off, cell)
    return Drawing(np.array(runs))


def check(shape: Shape) -> None:
    if shape.marker_size is None or shape.dictionary is None:
        raise ValueError(
            f"marker_size and dictionary must be given together, got {shape.marker_size} and {shape.dictionary}"
        )
    if not 0 < shape.marker_size < shape.square_size:
        raise ValueError(
            f"marker_size must be a length below square_size = {shape.square_size}, got {shape.marker_size}"
        )
    check_printed(shape)


def check_printed(shape: Shape) -> None:
    """ValueError for markers that cannot be printed so: their border and their first number."""
    if not 1 <= shape.border_bits <= WIDEST_BORDER:
        raise ValueError(f"border_bits must be 1 or {WIDEST_BORDER} cells, got {shape.border_bits}")
    if shape.first_id < 0:
        raise ValueError(f"first_id must be the number of a marker, from 0, got {shape.first_id}")


def says(shape: Shape) -> str:
    return (
        f"ChArUco board of {shape.dictionary} with {shape.columns}×{shape.rows} inner corners "
        f"({shape.columns + 1}×{shape.rows + 1} squares)"
    )


def options(shape: Shape) -> str:
    assert shape.marker_size is not None
    return (
        f"--board {shape.columns}x{shape.rows} --square-mm {millimetres(shape.square_size)} "
        f"--charuco {shape.dictionary} --marker-mm {millimetres(shape.marker_size)}" + printed(shape)
    )


def printed(shape: Shape) -> str:
    """The options that say how the markers are printed, each with a space before it; none for OpenCV's own way."""
    first = f" --first-id {shape.first_id}" * bool(shape.first_id)
    border = f" --border-bits {shape.border_bits}" * (shape.border_bits != 1)
    return " --legacy" * shape.legacy + first + border


KIND = BoardKind(
    name="charuco",
    title="ChArUco board",
    counts="inner corners",
    points=regular,
    area=area_of_squares,
    drawn=drawn,
    find=find,
    check=check,
    says=says,
    options=options,
    measures=squares_of,
    sized="squares",
    size=side,
    advice="see that the markers are of this dictionary and not blurred",
    partial=True,
)
