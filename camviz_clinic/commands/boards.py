"""The options that say which board it is, which several commands share."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.calibration.boards import kinds
from camviz_clinic.commands.common import Refusal, bounded, millimetres

if TYPE_CHECKING:
    from camviz_clinic.calibration.types import Board

SIDE_MM = 25.0
SPACING = 0.3  # of a tag's side: what Kalibr's own targets have
AS_OPENCV = {"legacy": False, "first_id": 0, "border_bits": 1}  # how OpenCV prints a ChArUco board
TARGET = (".yaml", ".yml")


def numbers_or_file(text: str) -> tuple[int, int] | Path:
    """9x6 as (9, 6), the name of a YAML file as a path."""
    if text.lower().endswith(TARGET):
        return Path(text)
    match = re.fullmatch(r"([0-9]{1,3})\s*[xX×*,]\s*([0-9]{1,3})", text.strip())
    if not match or not (1 <= int(match[1]) <= 200 and 1 <= int(match[2]) <= 200):
        raise argparse.ArgumentTypeError(
            "expected inner corners as COLUMNSxROWS, such as 9x6, at most 200 (or tags, markers or circles), or "
            f"Kalibr's target.yaml, got {text!r}"
        )
    return int(match[1]), int(match[2])


def add_board(command: argparse.ArgumentParser, required: bool = True, default: bool = True) -> None:
    """The options that say which board it is; one of 9x6 and 25 mm, or none, where they are not required."""
    corners, side = (" (default: 9x6)", " (default: 25)") if default and not required else ("", "")
    command.add_argument(
        "--board",
        metavar="9x6",
        type=numbers_or_file,
        required=required,
        default=(9, 6) if default else None,
        help="inner corners, where four squares meet, by columns and rows; or tags, markers or circles; or Kalibr's "
        "target.yaml" + corners,
    )
    command.add_argument(
        "--square-mm",
        metavar="MM",
        type=millimetres,
        default=SIDE_MM if default and not required else None,
        help="the side of a square, of a tag or of a marker; of circles the distance of two centres" + side,
    )
    command.add_argument("--kind", choices=list(kinds()), help="of the board (default: chessboard, or by its options)")
    command.add_argument(
        "--charuco", metavar="DICT", help="a ChArUco board with markers of this dictionary, such as 5X5_100"
    )
    command.add_argument(
        "--markers", metavar="DICT", help="a grid of markers of this dictionary, or one alone (--board 1x1)"
    )
    command.add_argument(
        "--marker-mm", metavar="MM", type=millimetres, help="the side of a marker (default: 3/4), a circle's diameter"
    )
    command.add_argument(
        "--spacing",
        metavar="RATIO",
        type=bounded("a ratio", 0.01, 0.99),
        help=f"between tags or markers, in their side (default: {SPACING})",
    )
    _add_markers(command)


def _add_markers(command: argparse.ArgumentParser) -> None:
    """How the markers of a board are printed."""
    command.add_argument(
        "--legacy", action="store_true", help="a ChArUco board laid out as OpenCV before 4.6 did it (even rows)"
    )
    command.add_argument(
        "--first-id", metavar="N", type=_number, default=0, help="the number of the first marker (default: 0)"
    )
    command.add_argument(
        "--border-bits",
        metavar="N",
        type=int,
        choices=(1, 2),
        default=1,
        help="cells of a marker's black border: 1 (default), or 2 as Kalibr has it",
    )


def _printed(options: argparse.Namespace) -> dict[str, Any]:
    return {name: getattr(options, name) for name in AS_OPENCV}


def _number(text: str) -> int:
    if not re.fullmatch("[0-9]{1,5}", text):
        raise argparse.ArgumentTypeError(f"expected the number of a marker, such as 0, got {text!r}")
    return int(text)


def board_of(options: argparse.Namespace) -> Board:
    """The board of the options; raises Refusal for one that cannot be."""
    try:
        if isinstance(options.board, Path):
            return _of_file(options)
        if options.square_mm is None:
            raise Refusal("a board has both: --board COLUMNSxROWS (inner corners) and --square-mm MM.")
        return _board(options)
    except ValueError as error:
        raise Refusal(f"{error}.") from error


def given_board(options: argparse.Namespace) -> Board | None:
    """The board of the options; None where they name none."""
    if isinstance(options.board, Path):
        return board_of(options)
    given = [options.board is not None, options.square_mm is not None]
    if any(given) != all(given) or (options.kind and not all(given)):
        raise Refusal("a board has both: --board COLUMNSxROWS (inner corners) and --square-mm MM.")
    return board_of(options) if all(given) else None


def _of_file(options: argparse.Namespace) -> Board:
    from camviz_clinic.files.target import read_target

    if any(
        (
            options.kind,
            options.charuco,
            options.markers,
            options.marker_mm,
            options.spacing,
            _printed(options) != AS_OPENCV,
        )
    ):
        raise Refusal(f"{options.board}: the file says which board it is: leave --kind and the board's sizes out.")
    return read_target(options.board)


def _board(options: argparse.Namespace) -> Board:
    from camviz_clinic.calibration.boards.charuco import charuco_dictionary
    from camviz_clinic.calibration.types import Board

    (columns, rows), side = options.board, options.square_mm / 1000
    marker = None if options.marker_mm is None else options.marker_mm / 1000
    kind = options.kind or ("charuco" if options.charuco else "markers" if options.markers else "chessboard")
    if (kind == "charuco") != bool(options.charuco):
        raise Refusal("--charuco DICT and --kind charuco go together: name the dictionary of the markers.")
    if (kind == "markers") != bool(options.markers):
        raise Refusal("--markers DICT and --kind markers go together: name the dictionary of the markers.")
    if min(columns, rows) < 2 and kind != "markers":
        raise Refusal(
            "--board must have two columns and two rows at least; one alone can be a marker (--markers DICT)."
        )
    if marker is not None and kind in ("chessboard", "aprilgrid", "markers"):
        raise Refusal("--marker-mm is for a ChArUco board: name its dictionary with --charuco.")
    if options.spacing is not None and kind not in ("aprilgrid", "markers"):
        raise Refusal("--spacing is for --kind aprilgrid and for --markers.")
    printed = _printed(options)
    if kind not in ("charuco", "markers") and printed != AS_OPENCV:
        raise Refusal(
            "--legacy, --first-id and --border-bits are for a ChArUco board or for markers: name their dictionary."
        )
    if kind == "aprilgrid":
        return Board.aprilgrid(columns, rows, side, options.spacing or SPACING)
    if kind == "markers":
        return _markers(options, columns, rows, side)
    if kind != "charuco":
        return Board(columns, rows, side, marker, kind=kind)
    name = "DICT_" + options.charuco.removeprefix("DICT_")
    board = Board(columns, rows, side, 0.75 * side if marker is None else marker, name, **printed)
    charuco_dictionary(board)
    return board


def _markers(options: argparse.Namespace, columns: int, rows: int, side: float) -> Board:
    from camviz_clinic.calibration.boards.markers import grid_dictionary
    from camviz_clinic.calibration.types import Board

    if options.legacy:
        raise Refusal("--legacy is for a ChArUco board: name its dictionary with --charuco.")
    name = "DICT_" + options.markers.removeprefix("DICT_")
    spacing, bits = options.spacing or SPACING, options.border_bits
    board = Board.marker_grid(columns, rows, side, name, spacing, first_id=options.first_id, border_bits=bits)
    grid_dictionary(board)
    return board
