"""Columns and rows of a ChArUco board, taken for each other.

A chessboard has no such trouble: its corners are in a right order whichever side comes first.
"""

from __future__ import annotations

from collections.abc import Iterator

from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import trouble


@trouble("sides swapped", cause="a number of columns and one of rows that were taken for each other")
def sides_swapped(shown: Shown) -> Iterator[tuple[str, str]]:
    """The numbers of the markers run along the other side."""
    board = shown.likeliest
    if board is not None and board.columns != shown.board.columns:
        sentence = (
            f"The ChArUco board has {board.columns}×{board.rows} inner corners by columns and rows, not "
            f"{shown.board.columns}×{shown.board.rows}: its markers are numbered along rows of "
            f"{board.columns + 1} squares."
        )
        yield sentence, f"--board {board.columns}x{board.rows}"
