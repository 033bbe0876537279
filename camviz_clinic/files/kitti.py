"""KITTI's calib.txt, with the projection matrices P0 … P3 of its rectified cameras."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera
from camviz.lenses import Perspective
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import expressed
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, agreed_size
from camviz_clinic.files.trees import scalar, shown

TITLE = "KITTI calib.txt"
MODELS = LAYOUTS["kitti"]
MAX_LINES = 1000
MOST_WORDS = 64  # more than any line has
_START = re.compile(r"^(?:P[0-9]|P_rect_[0-9]{2}):[ \t]+[-+.0-9]", re.MULTILINE)


def read(file: File) -> Calibration:
    """P = K [1 | t] with t = -C: the world is the rectified frame of the reference camera."""
    section, size = lines_of(file), agreed_size(None, file.size, "calib.txt never does")
    cameras = {}
    for name in sorted(key for key in section.values if re.fullmatch(r"P[0-9]", key)):
        P = section.matrix(name, 3, 4)
        grid = section.intrinsics(P[:, :3], name, size)
        pose = RigidTransform.from_translation(np.linalg.solve(grid.K, P[:, 3])).inv()
        cameras[name] = Camera(grid, Perspective(), pose)
    if not cameras:
        raise CalibrationError("expected the projection matrices P0, P1 …, found none")
    notes = ["These are the rectified cameras: the pictures on disk have no distortion left."]
    return Calibration(cameras, file.path, TITLE, notes=tuple(notes))


def lines_of(file: File) -> Section:
    """The lines of a file, each a name and its values."""
    values: dict[str, list[object]] = {}
    if file.text.count("\n") > MAX_LINES:
        raise CalibrationError(f"expected at most {MAX_LINES} lines, got {file.text.count(chr(10)):,}")
    for number, line in enumerate(file.text.splitlines(), 1):
        name, *words = line.split(maxsplit=MOST_WORDS) or [""]
        if name.rstrip(":") in values:
            raise CalibrationError(f"line {number}: {shown(name)} appears twice")
        if name:
            values[name.rstrip(":")] = [scalar(word) for word in words]
    return Section(values, mended=file.mended)


def write(calibration: Calibration) -> bytes:
    """P0 …: pinholes side by side, all turned as the world is, with pictures of one size."""
    rows, cameras = {}, calibration.cameras
    if len({(camera.intrinsics.width, camera.intrinsics.height) for camera in cameras.values()}) > 1:
        raise CalibrationError(f"{TITLE} holds no image sizes, and these cameras have different ones")
    for index, (name, camera) in enumerate(cameras.items()):
        _, same = expressed(name, camera, MODELS, TITLE)
        if same.cam_from_world.rotation.magnitude() > 1e-12:
            raise CalibrationError(f"{TITLE} holds rectified cameras, all turned alike, and {name} is turned")
        K = same.intrinsics.K
        rows[f"P{index}"] = np.column_stack([K, K @ same.cam_from_world.translation])
    return as_lines(rows)


def as_lines(rows: Mapping[str, ArrayLike]) -> bytes:
    """A line of a name and its numbers for each array."""
    lines = [f"{key}: {' '.join(repr(float(x)) for x in np.ravel(row))}" for key, row in rows.items()]
    return ("\n".join(lines) + "\n").encode()


FORMAT = Format(
    name="kitti",
    title=TITLE,
    file="calib.txt",
    recognise=lambda file: _START.search(file.text),
    read=read,
    write=write,
    most_cameras=10,
    own_world=True,
    models="pinhole",
    says="P = K [1 ∣ t]; holds no image size",
    lacks="turned cameras, distortion, sizes that differ",
    rank=35,
)
