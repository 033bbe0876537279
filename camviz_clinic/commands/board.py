"""`camviz board`: a calibration board as a PDF."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from camviz_clinic.commands.boards import add_board, board_of
from camviz_clinic.commands.common import OK, Refusal, add_command, narrator, refuse_output, write_whole

BOARD = """\
Writes a calibration board as a PDF of one page that prints at true scale, with its numbers and a ruler of 100 mm to
check the print by. Print it at 100 %, on paper glued to glass or a sheet of aluminium: a board that is not flat is the
commonest fault of calibrations. Without --charuco or --kind it is a chessboard, which must be seen as a whole, as must
the grids of circles. The markers of a ChArUco board and the tags of an AprilGrid tell their corners apart, so that a
part of the board is enough.
"""
EPILOG = """\
examples:
  camviz board -o board.pdf                                        9x6 inner corners, squares of 25 mm, on A4
  camviz board --board 10x7 --square-mm 18 --charuco 5X5_100       with markers of 13.5 mm
  camviz board --kind aprilgrid --board 6x4 --square-mm 30         Kalibr's: 6x4 tags, 9 mm apart (--spacing 0.3)
  camviz board --board target.yaml --paper a3                      the board of Kalibr's file
  camviz board --board 13x8 --square-mm 40 --paper 600x420-mm
"""


def add(commands: Any) -> None:
    command = add_command(commands, "board", board, "make a calibration board to print", BOARD)
    command.epilog = EPILOG
    add_board(command, required=False)
    command.add_argument("--paper", metavar="PAPER", default="a4", help="a4, a3, letter or WxH-mm (default: a4)")
    command.add_argument("-o", "--output", metavar="OUT.pdf", type=Path, default=Path("board.pdf"), help="the PDF")


def board(options: argparse.Namespace) -> int:
    """Write the PDF, whole or not at all."""
    from camviz_clinic.calibration.paper import fitted, pdf

    try:
        sheet = fitted(board_of(options), options.paper)
    except ValueError as error:
        raise Refusal(f"{error}.") from error
    refuse_output(options.output, "PDF")
    write_whole(options.output, lambda path: path.write_bytes(pdf(sheet)))
    narrator(options.output)(f"{options.output}: print it at 100 %, and see that its ruler measures 100 mm.")
    return OK
