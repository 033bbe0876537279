"""Pictures beside a calibration: their sizes, and the corners of the board that they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from camviz.calibration import Detections
from camviz.calibration.adjustment import Adjustment
from camviz.calibration.finding import read_gray
from camviz.calibration.types import Board, Calibration
from camviz.clinic.rig import board_poses


def sizes_of(paths: Sequence[str | PathLike[str]]) -> dict[str, tuple[int, int]]:
    """(width, height) of every picture that can be read, by its path."""
    pictures = {str(path): read_gray(Path(path)) for path in paths}
    return {name: (each.shape[1], each.shape[0]) for name, each in pictures.items() if each is not None}


def with_detections(calibration: Calibration, detections: Detections, board: Board) -> Calibration:
    """A calibration of one camera with corners and, fitted to them with the camera as it is, the poses of the board.

    Corners for an image of another size are left out: the sizes themselves tell what is wrong.
    """
    ((name, camera),) = calibration.cameras.items()
    if (detections.width, detections.height) != (camera.intrinsics.width, camera.intrinsics.height):
        return calibration
    seen = replace(
        calibration,
        board=board,
        detections={name: detections.corners},
        cam_from_board={name: board_poses(camera, board, detections.corners)},
        pictures={name: detections.pictures},
        per_view_errors={},
        skipped=detections.skipped,
        set_aside={},
        board_warp=None,
    )
    poses = Adjustment.of(seen, name).refined(only_poses=True).first_from_board
    return replace(seen, cam_from_board={name: poses})
