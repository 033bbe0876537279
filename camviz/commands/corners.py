"""`--corners`: what other programs found in pictures, in place of the pictures."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from camviz.commands.common import Refusal

if TYPE_CHECKING:
    from camviz.files.corners import LoadedCorners


def add_corners(command: argparse.ArgumentParser) -> None:
    """The option that names files of corners."""
    command.add_argument(
        "--corners",
        metavar="FILES",
        nargs="+",
        type=Path,
        help="corners that another program found, in place of those in pictures: mrcal's .vnl, BabelCalib's .orpc and "
        ".dsc, or CSV",
    )


def corners_of(options: argparse.Namespace, paths: Sequence[Path]) -> LoadedCorners:
    """The corners in the files of --corners; pictures tell their size where neither the files nor --size do."""
    from camviz.files import CalibrationError
    from camviz.files.corners import load_corners

    side = None if options.square_mm is None else options.square_mm / 1000
    try:
        return load_corners(options.corners, shape=options.board, square_size=side, size=options.size, pictures=paths)
    except CalibrationError as error:
        raise Refusal(f"{error}.") from error
