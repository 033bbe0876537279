"""A chessboard that looks the same when it is turned by 180°."""

from __future__ import annotations

from collections.abc import Iterator

from camviz.clinic.checks.frames import corner_order
from camviz.clinic.doctor.shown import Shown
from camviz.clinic.doctor.trouble import trouble
from camviz.clinic.evidence import Evidence, NotChecked

KINDS = ("chessboard",)


def symmetric(columns: int, rows: int) -> bool:
    """Whether a chessboard of so many inner corners looks the same when it is turned by 180°.

    >>> symmetric(9, 6), symmetric(9, 7), symmetric(8, 6)
    (False, True, True)
    """
    return (columns + rows) % 2 == 0


@trouble("symmetric board", cause="a board whose sides are both odd or both even", finding="corner-order")
def symmetric_board(shown: Shown) -> Iterator[tuple[str, str]]:
    """The two cameras of a pair begin at opposite corners of the board in some views."""
    board, calibration = shown.board, shown.calibration
    if board.kind not in KINDS or not symmetric(board.columns, board.rows) or calibration is None:
        return
    try:
        found = list(corner_order.check(Evidence(calibration)))
    except NotChecked:
        return
    if found:
        views = len({view for finding in found for view in finding.pictures})
        sentence = (
            f"A chessboard of {board.columns}×{board.rows} corners looks the same when it is turned by 180°. The "
            f"two cameras began at opposite corners in {views} view{'s' * (views > 1)}. "
            "A board with one odd and one even side has one order."
        )
        yield sentence, f"--board {board.columns}x{board.rows - 1}"
