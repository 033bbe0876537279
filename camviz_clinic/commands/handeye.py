"""`camviz handeye`: where a camera sits on a robot's hand or beside the robot, and what is wrong with the poses."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from camviz_clinic.commands.boards import add_board, given_board
from camviz_clinic.commands.calibrate import FINDERS, Bar, add_seconds, pictures
from camviz_clinic.commands.common import (
    FOUND,
    OK,
    STREAM,
    Refusal,
    add_colour,
    add_command,
    add_megapixels,
    chosen_camera,
    loaded,
    narrator,
    refuse_output,
    size,
    write_whole,
)
from camviz_clinic.commands.terminal import tell, tell_json

if TYPE_CHECKING:
    from camviz.cameras import Camera
    from camviz.lenses.base import Array
    from camviz_clinic.calibration import Detections
    from camviz_clinic.files import Board, Calibration
    from camviz_clinic.handeye import RobotPoses
    from camviz_clinic.handeye.diagnosis import PosedPictures

PAINT = {"^.*No problem found": "green", "^Most likely.*": "red", "^✗ fault": "red", "^! warning": "yellow"}
HANDEYE = """\
Finds where a camera sits on a robot's hand (eye in hand), or beside the robot that holds the board (--eye-to-hand),
from the robot's poses and a picture of the board at each of them. Every number has its standard deviation, clustered by
pose, and the robot's own errors are told. Poses in another unit, order or convention, inverted, late, about one axis
only, or that do not belong are found, and what would mend them is named.

POSES is a table (CSV) with one pose of the hand in the base's frame a row. A header names its columns:
  picture                        the picture of the row; without it rows and pictures belong together by their order
  time                           in seconds, for a robot that does not stop
  x, y, z                        the place; x_mm or x_m say the unit
  qx, qy, qz, qw                 a quaternion, in any order of columns; q1 to q4 begin with w
  rx, ry, rz                     a rotation vector; with --rotation euler-XYZ Euler angles
  roll, pitch, yaw; a, b, c; w, p, r    Euler angles as ROS, KUKA and FANUC have them; roll_deg says the unit
Without a header 12 or 16 numbers are a matrix row by row, and 8 are a time, a place and a quaternion x, y, z, w.
In euler-ORDER small letters are fixed axes, capital ones moving axes, in the order of the columns.
"""
EPILOG = """\
examples:
  camviz handeye camera.yaml poses.csv shots/*.png
  camviz handeye camera.yaml poses.csv shots/ --board 9x6 --square-mm 25 --eye-to-hand -o handeye.yaml
  camviz handeye camera.yaml poses.csv shots/ --board 9x6 --square-mm 25 --unknown-scale
  camviz handeye camera.yaml poses.txt shots/ --rotation euler-ZYX --angles deg --unit mm --json

exit status:
  0  solved, and OUT is written
  1  a fault was found; OUT is written where it only leaves a direction unknown
  2  a file cannot be read, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""


def add(commands: Any) -> None:
    command = add_command(commands, "handeye", handeye, "find where a camera sits on a robot", HANDEYE)
    command.epilog = EPILOG
    command.add_argument("calibration", metavar="CAMERA", type=Path, help="the camera's calibration (- is stdin)")
    command.add_argument("poses", metavar="POSES", type=Path, help="the robot's poses, one a row")
    command.add_argument("images", metavar="IMAGES", nargs="+", help="pictures of the board, folders or patterns")
    command.add_argument(
        "--eye-to-hand", action="store_true", help="the camera stands still and the board is on the hand"
    )
    command.add_argument("--rotation", metavar="FORM", type=_form, help="matrix, xyzw, wxyz, rotvec or euler-ORDER")
    command.add_argument("--angles", choices=("deg", "rad"), help="of Euler angles and rotation vectors")
    command.add_argument("--unit", choices=("mm", "m"), help="of the places (default: by the header, or the numbers)")
    command.add_argument(
        "--unknown-scale",
        action="store_true",
        help="the board's lengths are not known for sure: the scale is solved for by the robot's motions",
    )
    command.add_argument("--invert", action="store_true", help="the poses are hand_from_base")
    command.add_argument("--camera", metavar="NAME", help="the camera that took IMAGES, where CAMERA has several")
    add_board(command, required=False, default=False)
    command.add_argument("--finder", choices=FINDERS, default="auto", help="how chessboards are found")
    add_seconds(command)
    command.add_argument("--size", metavar="WxH", type=size, help="image size, where CAMERA does not hold it")
    command.add_argument(
        "-o", "--output", metavar="OUT", type=Path, default=Path("handeye.yaml"), help="(default: handeye.yaml)"
    )
    command.add_argument("--json", action="store_true", help="the same for programs")
    add_megapixels(command)
    add_colour(command)


def handeye(options: argparse.Namespace) -> int:
    """Read the poses, find the boards, solve, write the result whole or not at all, and say what was found."""
    from camviz_clinic.files.output import as_yaml, json_text
    from camviz_clinic.handeye import PoseError
    from camviz_clinic.handeye.telling import as_text, as_tree, result_tree

    refuse_output(options.output, "result", options.calibration, options.poses)
    if options.json and options.output == STREAM:
        raise Refusal("-: --json is printed on stdout already; name a file with -o.")
    calibration = loaded(options.calibration, options.size)
    try:
        case, skipped = _case(calibration, options)
        kept = as_yaml(result_tree(case)) if case.usable else b""
        told = json_text(as_tree(case)) if options.json else as_text(case, skipped)
    except PoseError as error:
        raise Refusal(f"{error}.") from error
    if kept:
        write_whole(options.output, lambda path: path.write_bytes(kept))
    say = narrator(options.output)
    if options.json:
        tell_json(told)
    elif options.output == STREAM:
        say(told)
    else:
        tell(told, PAINT, options.color)
        tell(f"{options.output}: {'written' if kept else 'not written, because the poses must be mended first'}.")
    return FOUND if any(each.severity == "fault" for each in case.findings) else OK


def _case(calibration: Calibration, options: argparse.Namespace) -> tuple[PosedPictures, tuple[tuple[str, str], ...]]:
    """The poses with the corners of their pictures; and the pictures that were skipped, with the reason."""
    from camviz_clinic.calibration import CannotCalibrate, detect
    from camviz_clinic.handeye import read_poses
    from camviz_clinic.handeye.diagnosis import PosedPictures

    poses = read_poses(options.poses, rotation=options.rotation, angles=options.angles, unit=options.unit)
    if options.invert:
        others = {asked: other.inv() for asked, other in poses.others.items()}
        poses = replace(poses, base_from_hand=poses.base_from_hand.inv(), others=others)
    board = given_board(options) or calibration.board
    if board is None:
        raise Refusal(
            f"{options.calibration}: the file does not say which board was used: say which one the pictures show, such "
            "as --board 9x6 --square-mm 25."
        )
    camera, paths = chosen_camera(calibration, options), pictures(options.images)
    rows = _rows(poses, paths, options)
    try:
        with Bar() as bar:
            found = detect(paths, board, finder=options.finder, progress=bar, seconds=options.seconds)
    except CannotCalibrate as error:
        raise Refusal(f"{error}.") from error
    _refuse_size(found, camera)
    if not poses.names and len(paths) != len(poses.base_from_hand):
        _refuse_count(poses, found, camera, board, paths, options)
    used = sorted({row for row in rows if row is not None})
    skipped = [(path.name, "the table has no row for it") for path, row in zip(paths, rows, strict=True) if row is None]
    if len(used) < len(poses.base_from_hand):
        missing = len(poses.base_from_hand) - len(used)
        skipped.append((str(options.poses), f"{missing} of its rows have no picture"))
    names = {row: path.name for path, row in zip(paths, rows, strict=True) if row is not None}
    pixels = _pixels(found, board, rows, len(poses.base_from_hand))
    labels = tuple(names.get(row, "no picture") for row in range(len(poses.base_from_hand)))
    case = PosedPictures(poses, pixels, camera, board, options.eye_to_hand, labels, options.unknown_scale)
    return case, (*found.skipped, *skipped)


def _rows(poses: RobotPoses, paths: list[Path], options: argparse.Namespace) -> list[int | None]:
    """The row of each picture: by the names in the table, else by their order."""
    if poses.names:
        known = {key: row for row, name in enumerate(poses.names) for key in (Path(name).name, Path(name).stem)}
        rows = [known.get(path.name, known.get(path.stem)) for path in paths]
        if all(row is None for row in rows):
            raise Refusal(f"{options.poses}: no row names one of the pictures, such as {paths[0].name}.")
        return rows
    return list(range(len(paths)))


def _refuse_count(
    poses: RobotPoses, found: Detections, camera: Camera, board: Board, paths: list[Path], options: argparse.Namespace
) -> None:
    """Refuses tables without names and with another number of rows; says which row or picture seems to be missing."""
    from camviz.cameras import Camera
    from camviz_clinic.checks.rig import lone_poses
    from camviz_clinic.handeye.mends import FEWEST_TRIED, row_shifts, shift_words

    said, places, shifts = "", np.array(found.places, dtype=int), None
    if len(places) >= FEWEST_TRIED:
        boards = lone_poses(Camera(camera.intrinsics, camera.lens), board, found.corners)
        shifts = row_shifts(poses.base_from_hand, places, boards)
    if shifts is not None:
        says, remedy = shift_words(shifts, places, lambda place: paths[place].name)
        said = f" The hand turned as the boards did if {says}. {remedy}"
    raise Refusal(
        f"{options.poses}: there are {len(poses.base_from_hand)} poses and {len(paths)} pictures: name the "
        f"pictures in a column `picture`, or give as many of the one as of the other.{said}"
    )


def _pixels(found: Detections, board: Board, rows: list[int | None], count: int) -> Array:
    """The corners by row (rows, corners, 2), NaN where the row's picture does not show the board."""
    pixels = np.full((count, board.columns * board.rows, 2), np.nan)
    for place, corners in zip(found.places, found.corners, strict=True):
        row = rows[place]
        if row is not None:
            pixels[row] = corners
    return pixels


def _refuse_size(found: Detections, camera: Camera) -> None:
    grid = camera.intrinsics
    if (found.width, found.height) != (grid.width, grid.height):
        raise Refusal(
            f"the pictures have {found.width}×{found.height} pixels, the calibration has {grid.width}×{grid.height}: "
            "calibrate the camera at the pictures' size."
        )


def _form(text: str) -> str:
    from camviz_clinic.handeye.turn_forms import FORMS, is_form

    if not is_form(text):
        raise argparse.ArgumentTypeError(f"expected {', '.join(FORMS)} such as euler-ZYX, got {text!r}")
    return text
