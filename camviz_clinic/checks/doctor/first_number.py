"""Markers that are numbered from another one than 0."""

from __future__ import annotations

from collections.abc import Iterator

from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import trouble


@trouble("first number", cause="one of several boards out of one dictionary, whose markers go on counting")
def first_number(shown: Shown) -> Iterator[tuple[str, str]]:
    """The numbers of the markers fit the board's layout once they are counted from another one."""
    board = shown.likeliest
    if board is not None and board.first_id != shown.board.first_id:
        sentence = f"The board's markers are numbered from {board.first_id}, not from {shown.board.first_id}."
        yield sentence, f"--first-id {board.first_id}"
