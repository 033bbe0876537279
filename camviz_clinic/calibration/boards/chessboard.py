"""The chessboard: inner corners where four squares meet."""

from __future__ import annotations

from camviz_clinic.calibration.boards.kind import (
    Array,
    BoardKind,
    Gray,
    Shape,
    area_of_squares,
    millimetres,
    regular,
    side,
    squares,
    squares_of,
)


def find(gray: Gray, shape: Shape, finder: str) -> Array | None:
    """All corners, or None."""
    from camviz_clinic.calibration.chessboards import find_chessboard

    return find_chessboard(gray, shape, finder)


def check(shape: Shape) -> None:
    if shape.marker_size is not None or shape.dictionary is not None:
        raise ValueError(
            f"marker_size and dictionary must be left out of a chessboard, got {shape.marker_size} and "
            f"{shape.dictionary}"
        )


def says(shape: Shape) -> str:
    return f"chessboard with {shape.columns}×{shape.rows} inner corners ({shape.columns + 1}×{shape.rows + 1} squares)"


def options(shape: Shape) -> str:
    return f"--board {shape.columns}x{shape.rows} --square-mm {millimetres(shape.square_size)}"


KIND = BoardKind(
    name="chessboard",
    title="Chessboard",
    counts="inner corners",
    points=regular,
    area=area_of_squares,
    drawn=squares,
    find=find,
    check=check,
    says=says,
    options=options,
    measures=squares_of,
    sized="squares",
    size=side,
    advice="count the corners where four squares meet, and see that the whole board with its white margin is in the "
    "picture",
)
