"""`camviz poses`: where a known camera stood for each picture of a board."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.boards import add_board, given_board
from camviz_clinic.commands.calibrate import FINDERS, add_seconds
from camviz_clinic.commands.common import (
    OK,
    STREAM,
    Refusal,
    add_command,
    add_megapixels,
    bounded,
    chosen_camera,
    loaded,
    narrator,
    refuse_output,
    size,
    write_whole,
)
from camviz_clinic.commands.pictures import Bar, pictures

if TYPE_CHECKING:
    from camviz_clinic.calibration import Board, Calibration, Detections
    from camviz_clinic.datasets.poses import CameraPoses

POSES = """\
Finds the board, or its tags, in each picture, and says where the camera stood and looked, with the standard deviation
of every number. OUT is a table (.csv) with a row for each picture: the camera's place in the board's frame in metres
and its turn as a quaternion x, y, z, w; or with matrices and covariances (.json). The board's frame has its origin at
the first point, x along the rows, y down the columns and z into the board; the camera's has x right, y down, z forward.

The ± comes from the noise of the corners; where CAMERA holds the covariance of its numbers, that is added. A picture
is refused, with the reason, where the board is not found, has two poses that fit nearly as well, or does not fit.
"""
EPILOG = """\
examples:
  camviz poses camera.yaml photos/ --board 10x7 --square-mm 18 --charuco 5X5_100
  camviz poses camera.yaml photos/*.jpg --board 9x6 --square-mm 25 -o poses.json
  camviz poses camera.yaml photos/ --board 6x4 --square-mm 30 --kind aprilgrid --ruler-mm 94.1

exit status:
  0  OUT is written
  2  no picture has a pose, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""


def add(commands: Any) -> None:
    command = add_command(commands, "poses", poses, "find where a camera stood for each picture of a board", POSES)
    command.epilog = EPILOG
    command.add_argument("calibration", metavar="CAMERA", type=Path, help="the camera's calibration (- is stdin)")
    command.add_argument("images", metavar="IMAGES", nargs="+", help="pictures of the board, folders or patterns")
    command.add_argument("--camera", metavar="NAME", help="the camera that took IMAGES, where CAMERA has several")
    add_board(command, required=False, default=False)
    add_ruler(command)
    add_finder(command)
    add_seconds(command)
    command.add_argument("--size", metavar="WxH", type=size, help="image size, where CAMERA does not hold it")
    command.add_argument(
        "-o", "--output", metavar="OUT", type=Path, default=Path("poses.csv"), help=".csv or .json (default: poses.csv)"
    )
    add_megapixels(command)


def add_finder(command: argparse.ArgumentParser) -> None:
    """By default at saddles: what a finder errs over the whole board turns the pose, and is not in its ±."""
    command.add_argument(
        "--finder", choices=FINDERS, default="saddles", help="how chessboards are found (default: saddles)"
    )


def add_ruler(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--ruler-mm",
        metavar="MM",
        type=bounded("the ruler's length in millimetres", 50, 200),
        help="what the sheet's ruler of 100 mm measures: the board's sizes are scaled by it",
    )


def poses(options: argparse.Namespace) -> int:
    """Find the boards and write the poses, whole or not at all."""
    from camviz_clinic.datasets.telling import as_table, as_tree, sentences
    from camviz_clinic.files.output import json_text

    refuse_output(options.output, "table", options.calibration)
    if options.output != STREAM and options.output.suffix.lower() not in (".csv", ".json"):
        raise Refusal(f"{options.output}: expected a name that ends in .csv or .json.")
    calibration = loaded(options.calibration, options.size)
    board, measured = measured_board(options, calibration)
    posed = posed_pictures(calibration, options, board, pictures(options.images))
    as_json = options.output.suffix.lower() == ".json"
    content = json_text(as_tree(posed)).encode() + b"\n" if as_json else as_table(posed)
    write_whole(options.output, lambda path: path.write_bytes(content))
    said = narrator(options.output)
    for sentence in [*measured, *sentences(posed), f"{options.output}: written."]:
        said(sentence)
    return OK


def measured_board(options: argparse.Namespace, calibration: Calibration | None = None) -> tuple[Board, list[str]]:
    """The board as it was printed, and what its ruler tells."""
    from camviz_clinic.calibration.paper import as_printed, told_by_ruler

    board = given_board(options) or (calibration.board if calibration else None)
    if board is None:
        raise Refusal("say which board the pictures show, such as --board 9x6 --square-mm 25.")
    if options.ruler_mm is None:
        return board, []
    return as_printed(board, options.ruler_mm), [told_by_ruler(board, options.ruler_mm)]


def looked(paths: Sequence[Path], board: Board, options: argparse.Namespace) -> Detections:
    """The board in the pictures; Refusal where it is in none."""
    from camviz_clinic.calibration import CannotCalibrate, detect

    try:
        with Bar() as bar:
            return detect(paths, board, finder=options.finder, progress=bar, seconds=options.seconds)
    except CannotCalibrate as error:
        raise Refusal(f"{error}.") from error


def posed_pictures(
    calibration: Calibration, options: argparse.Namespace, board: Board, paths: Sequence[Path]
) -> CameraPoses:
    """The poses of pictures by the chosen camera."""
    camera, found = chosen_camera(calibration, options), looked(paths, board, options)
    grid = camera.intrinsics
    if (found.width, found.height) != (grid.width, grid.height):
        raise Refusal(
            f"the pictures have {found.width}×{found.height} pixels, the calibration has {grid.width}×{grid.height}: "
            "calibrate the camera at the pictures' size."
        )
    name = next(name for name, each in calibration.cameras.items() if each is camera)
    return poses_of(calibration, name, board, found)


def poses_of(calibration: Calibration, name: str, board: Board, found: Detections) -> CameraPoses:
    """The poses of what was found, with the camera's own uncertainty where the calibration holds it."""
    from camviz_clinic.datasets.poses import NoPose, find_poses

    estimated = tuple(calibration.estimated.get(name, ()))
    covariance = calibration.intrinsics_covariance.get(name)
    try:
        return find_poses(calibration.cameras[name], board, found, estimated, covariance)
    except NoPose as error:
        raise Refusal(f"{error}.") from error
