"""The files of a posed dataset beside its undistorted pictures: for nerfstudio, for COLMAP's readers and for NumPy."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from camviz.cameras import Camera
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.datasets.poses import CameraPoses
from camviz_clinic.files.output import as_json
from camviz_clinic.files.writing import write

TRANSFORMS, MODEL, ARCHIVE = "transforms.json", Path("sparse/0"), "poses.npz"


def write_poses(
    folder: Path, pinhole: Camera, posed: CameraPoses, files: list[str], images: str, mask: str | None
) -> None:
    """Write transforms.json, sparse/0 and poses.npz into a folder; the world is the board's frame, in metres.

    Args:
        folder: That holds the undistorted pictures.
        pinhole: Of these pictures.
        posed: Where they were taken.
        files: Their names in the folder `images`, one for each pose.
        images: The folder of the pictures, as transforms.json names it.
        mask: The file of the mask, where some of a picture shows nothing.

    Raises: CalibrationError for what a format cannot hold.
    """
    cameras = dict(zip(files, (pinhole.at(pose) for pose in posed.board_from_cam), strict=True))
    placed = Calibration(cameras, folder, "camviz")
    write(replace(placed, cameras={f"{images}/{name}": each for name, each in cameras.items()}), folder / TRANSFORMS,
          "nerfstudio")  # fmt: skip
    if mask is not None:
        _name_mask(folder / TRANSFORMS, mask)
    (folder / MODEL.parent).mkdir()
    write(placed, folder / MODEL, "colmap")
    (folder / ARCHIVE).write_bytes(archive(pinhole, posed, files))


def _name_mask(path: Path, mask: str) -> None:
    """Names the mask in every frame, where nerfstudio looks for it."""
    tree = json.loads(path.read_text(encoding="utf-8"))
    tree["frames"] = [frame | {"mask_path": mask} for frame in tree["frames"]]
    path.write_bytes(as_json(tree))


def archive(pinhole: Camera, posed: CameraPoses, files: list[str]) -> bytes:
    """The poses as arrays, with x right, y down, z forward in the camera and the first pixel's centre at (0, 0).

    Of n pictures: `names` (n,), `world_from_cam` (n, 4, 4), `cam_from_world` (n, 4, 4), `covariance` (n, 6, 6) of
    cam_from_world's turn about x, y, z in radians and shift in metres, `K` (3, 3), `size` (width, height), and the
    points of the board, `board` (corners, 3), in metres.
    """
    held = io.BytesIO()
    grid = pinhole.intrinsics
    np.savez_compressed(
        held,
        names=np.array(files),
        world_from_cam=posed.board_from_cam.as_matrix(),
        cam_from_world=posed.cam_from_board.as_matrix(),
        covariance=posed.covariance,
        K=grid.K,
        size=np.array([grid.width, grid.height]),
        board=posed.board.corners,
    )
    return held.getvalue()
