"""Markers with a black border of another width than one cell, such as Kalibr's of two."""

from __future__ import annotations

from collections.abc import Iterator

from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import trouble


@trouble("tag border", cause="markers with a border of another width, such as Kalibr's of two cells")
def tag_border(shown: Shown) -> Iterator[tuple[str, str]]:
    """The markers can be read with a border of another width."""
    board = shown.likeliest
    if board is not None and board.border_bits != shown.board.border_bits:
        width, option = board.border_bits, f"--border-bits {board.border_bits}"
        yield (
            f"The markers have a black border {width} cell{'s' * (width > 1)} wide, not {shown.board.border_bits}.",
            option,
        )
