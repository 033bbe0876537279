"""OpenCV before 4.6 began a ChArUco board with an even number of rows at a white square."""

from __future__ import annotations

from collections.abc import Iterator

from camviz_clinic.checks.doctor.shown import Shown
from camviz_clinic.checks.doctor.trouble import trouble


@trouble(
    "legacy pattern", cause="a ChArUco board printed by OpenCV before 4.6, or by a program that draws it as that did"
)
def legacy_pattern(shown: Shown) -> Iterator[tuple[str, str]]:
    """The markers lie in the squares that the other layout has black."""
    board = shown.likeliest
    if board is not None and board.legacy != shown.board.legacy:
        if board.legacy:
            yield "The ChArUco board has a white square at its upper left, as OpenCV before 4.6 drew it.", "--legacy"
        else:
            yield "The ChArUco board has a black square at its upper left, as OpenCV since 4.6 draws it.", "no --legacy"
