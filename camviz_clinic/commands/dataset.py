"""`camviz dataset`: from photographs of a board alone to camera, poses, undistorted pictures and their files."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.calibration.camera_models import MODELS
from camviz_clinic.commands.boards import add_board
from camviz_clinic.commands.calibrate import add_seconds, report
from camviz_clinic.commands.common import (
    OK,
    Refusal,
    add_command,
    add_megapixels,
    refuse_folder,
    whole_folder,
)
from camviz_clinic.commands.pictures import pictures
from camviz_clinic.commands.poses import add_finder, add_ruler, looked, measured_board, poses_of
from camviz_clinic.commands.terminal import tell
from camviz_clinic.commands.undistort import (
    IMAGES,
    MASK,
    add_alpha,
    output_names,
    told,
    undistortion_of,
    write_undistorted,
)

if TYPE_CHECKING:
    from camviz_clinic.calibration import Board, Calibration, Detections
    from camviz_clinic.datasets.poses import CameraPoses
    from camviz_clinic.datasets.undistortion import Undistortion

DATASET = """\
Makes a posed dataset of photographs that show a board, and of nothing else: solves for the camera, finds where it stood
for each photograph, undistorts them, and writes

  OUT/images/            the undistorted photographs that have a pose
  OUT/mask.png           black where these show nothing (with --alpha above 0)
  OUT/camera.yaml        the pinhole that they are of, without distortion
  OUT/photographs.yaml   the camera as it took them, with its lens, its ± and the corners: for camviz inspect
  OUT/transforms.json    for nerfstudio and instant-ngp: OpenGL's axes, first pixel's centre at 0.5
  OUT/sparse/0/          a COLMAP model as text: PINHOLE, world to camera, first pixel's centre at 0.5
  OUT/poses.npz          poses, covariances and K for NumPy: OpenCV's axes, first pixel's centre at 0

The world is the board's frame, in metres: x along its rows, y down its columns, z into it. Photographs without a pose
are named with the reason and left out. Zoom, focus and lens (0.5x, 1x) of a phone must be the same in all of them.
"""
EPILOG = """\
examples:
  camviz dataset photos/ --board 10x7 --square-mm 18 --charuco 5X5_100 -o scene/
  camviz dataset photos/ --board 10x7 --square-mm 18 --charuco 5X5_100 --ruler-mm 94.1 -o scene/
  camviz dataset photos/ --board 6x4 --square-mm 30 --kind aprilgrid --model fisheye --alpha 0.5 -o scene/

exit status:
  0  OUT is written
  2  nothing is: no camera can be solved for, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""
TAKEN_WITH = "photographs.yaml"


def add(commands: Any) -> None:
    command = add_command(commands, "dataset", dataset, "make a posed dataset of photographs of a board", DATASET)
    command.epilog = EPILOG
    command.add_argument("images", metavar="IMAGES", nargs="+", help="photographs, folders of them, or patterns")
    command.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help="a new folder")
    add_board(command, default=False)
    add_ruler(command)
    command.add_argument("--model", choices=list(MODELS), default="standard", help="which lens (default: standard)")
    add_alpha(command)
    add_finder(command)
    add_seconds(command)
    add_megapixels(command)


def dataset(options: argparse.Namespace) -> int:
    """Solve, pose, undistort and write, whole or not at all."""
    refuse_folder(options.output)
    paths = pictures(options.images)
    names = output_names(paths)
    board, measured = measured_board(options)
    found = looked(paths, board, options)
    calibration = _solved(found, board, options)
    posed = poses_of(calibration, "camera", board, found)
    flat = undistortion_of(calibration.cameras["camera"], options.alpha)
    with whole_folder(options.output) as folder:
        _write(folder, flat, posed, {paths[place]: names[place] for place in posed.places}, calibration)
    from camviz_clinic.datasets.telling import sentences

    skipped = set(calibration.skipped)
    posed = replace(posed, refused=tuple(each for each in posed.refused if each not in skipped))
    for sentence in [*measured, *report(calibration), *sentences(posed), told(flat)]:
        tell(sentence)
    tell(f"{options.output}: {len(posed.names)} of {len(paths)} photographs, posed and undistorted.")
    return OK


def _solved(found: Detections, board: Board, options: argparse.Namespace) -> Calibration:
    """The camera; Refusal where the photographs do not give one."""
    from camviz_clinic.calibration import CannotCalibrate, calibrate

    try:
        return calibrate(found, board, options.model, board_warp="auto")
    except CannotCalibrate as error:
        named = "; ".join(f"{picture}: {why}" for picture, why in found.skipped[:3])
        raise Refusal(f"{error}{f' (skipped: {named})' if named else ''}.") from error


def _write(
    folder: Path, flat: Undistortion, posed: CameraPoses, names: dict[Path, str], calibration: Calibration
) -> None:
    """Everything into a folder that has no name yet."""
    from camviz_clinic.calibration import CalibrationError
    from camviz_clinic.datasets.folder import write_poses
    from camviz_clinic.files.writing import write

    lost = write_undistorted(flat, names, folder)
    if lost:
        path, why = lost[0]
        raise Refusal(f"{path}: {why}.")
    try:
        write(calibration, folder / TAKEN_WITH, "opencv")
        write_poses(folder, flat.pinhole, posed, list(names.values()), IMAGES, MASK if flat.masked else None)
    except CalibrationError as error:
        raise Refusal(str(error).replace(f"{folder}/", "")) from error
