"""KITTI's calib_cam_to_cam.txt, with the cameras as they are before rectification."""

from __future__ import annotations

import re
from typing import Any

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.kitti import as_lines, lines_of
from camviz_clinic.files.models import expressed
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import agreed_size, explained

TITLE = "KITTI calib_cam_to_cam.txt"
MODELS = LAYOUTS["kitti-raw"]
_START = re.compile(r"^K_[0-9]{2}:[ \t]+[-+.0-9]", re.MULTILINE)


def read(file: File) -> Calibration:
    """x_i = R_i x_0 + T_i, K and D in OpenCV's order."""
    section, cameras = lines_of(file), {}
    for tag in sorted(key[2:] for key in section.values if re.fullmatch(r"K_[0-9]{2}", key)):
        size = agreed_size(section.size(f"S_{tag}"), file.size, f"S_{tag}")
        grid = section.intrinsics(section.matrix(f"K_{tag}", 3, 3), section.where(f"K_{tag}"), size)
        with explained(section.where(f"D_{tag}")):
            lens = BrownConrady(*section.coefficients(f"D_{tag}", [5], "k1 k2 p1 p2 k3", (4, 8)))
        t = section.vector(f"T_{tag}", [3], "x y z")
        pose = RigidTransform.from_components(t, section.rotation(f"R_{tag}"))
        cameras[tag] = Camera(grid, lens, pose.inv())
    notes = ["These are the cameras before rectification; R_rect and P_rect describe the rectified ones."]
    return Calibration(cameras, file.path, TITLE, notes=tuple(notes))


def write(calibration: Calibration) -> bytes:
    """S, K, D, R and T of every camera; nothing of a rectification."""
    rows: dict[str, Any] = {}
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        model, same = expressed(name, camera, MODELS, TITLE)
        grid, pose = same.intrinsics, same.cam_from_world
        values = {"S": [grid.width, grid.height], "K": grid.K, "D": model.values(same, 0.0)[4:]}
        values |= {"R": pose.rotation.as_matrix(), "T": pose.translation}
        rows |= {f"{key}_{index:02}": value for key, value in values.items()}
    return as_lines(rows)


FORMAT = Format(
    name="kitti-raw",
    title=TITLE,
    file="calib_cam_to_cam.txt",
    recognise=lambda file: _START.search(file.text),
    read=read,
    write=write,
    own_world=True,
    models="5 coefficients",
    says="the cameras before rectification; x_i = R_i x_0 + T_i; nothing of the rectification is written",
    lacks="skew, more coefficients",
    rank=34,
)
