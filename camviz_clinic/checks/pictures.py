"""Pictures beside a calibration: their sizes, and the corners of the board that they show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike

from camviz.colour.picture_files import PictureError, picture_size
from camviz_clinic.calibration import Detections
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.rig import board_poses


def sizes_of(
    paths: Sequence[str | PathLike[str]], left_out: Callable[[PictureError], object] | None = None
) -> dict[str, tuple[int, int]]:
    """(width, height) of every picture by its path, as its header says; `left_out` is told of those without one.

    Raises the last PictureError where there are paths and none is of a picture.
    """
    sizes: dict[str, tuple[int, int]] = {}
    wrong: list[PictureError] = []
    for path in paths:
        try:
            sizes[str(path)] = picture_size(path)
        except PictureError as error:
            wrong.append(error)
    if wrong and not sizes:
        raise wrong[-1]
    if left_out:
        for each in wrong:
            left_out(each)
    return sizes


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
