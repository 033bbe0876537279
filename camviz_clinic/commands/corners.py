"""`--corners`: what other programs found in pictures, in place of the pictures."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from camviz_clinic.commands.boards import board_of
from camviz_clinic.commands.common import Parser, Refusal

if TYPE_CHECKING:
    from camviz_clinic.files.corners import LoadedCorners


def add_corners(command: Parser) -> None:
    """The option that names files of corners; the help lists what is read."""
    command.listing = _listing
    command.add_argument(
        "--corners",
        metavar="FILES",
        nargs="+",
        type=Path,
        help="corners that another program found, in place of those in pictures; what is read is listed below",
    )


def _listing() -> str:
    from camviz_clinic.files.corners import corner_formats

    return "\n".join(["corners:", *(f"  {each.title}" for each in corner_formats().values())])


def corners_of(
    options: argparse.Namespace,
    paths: Sequence[Path],
    otherwise: tuple[int, int] | None = None,
    files: Sequence[Path] = (),
) -> LoadedCorners:
    """The corners in `files`, or else in those of --corners; pictures tell their size where these and --size do not."""
    from camviz_clinic.files import CalibrationError
    from camviz_clinic.files.corners import load_corners

    shape, side = options.board, None if options.square_mm is None else options.square_mm / 1000
    if isinstance(shape, Path):
        board = board_of(options)
        shape, side = (board.columns, board.rows), board.square_size
    try:
        return load_corners(
            files or options.corners,
            shape=shape,
            square_size=side,
            size=options.size,
            pictures=paths,
            otherwise=otherwise,
        )
    except CalibrationError as error:
        raise Refusal(f"{error}.") from error
