"""The TOML of anipose, Pose2Sim and caliscope: a table for each camera, beside the world's frame."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt, UnifiedSphere
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import expressed
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size, explained
from camviz_clinic.files.tables import parse_toml
from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import shown

TITLE = "anipose TOML"
MODELS = [model for model in LAYOUTS["opencv"] if model.lens is not UnifiedSphere]
_MATRIX = re.compile(r"^[ \t]*matrix[ \t]*=[ \t]*\[", re.MULTILINE)


def read(file: File) -> Calibration:
    """The cameras by `rotation`, a vector or a matrix, and `translation`, which take the world's points to each."""
    cameras: dict[str, Camera] = {}
    lost = []
    for part in _tables(file.mapping(parse_toml(file.text))):
        name = part.values["name"] if isinstance(part.values.get("name"), str) else part.path
        if name in cameras:
            raise part.error("name", "cameras of different names", f"{shown(name)} twice")
        cameras[name] = _camera(part, file.size)
        if not _is_placed(part):
            lost.append(name)
    if not cameras:
        raise CalibrationError("expected a table with a matrix for each camera, found none")
    notes = ["The world's unit is that of the board's squares: lengths are in the file's."]
    if lost:
        notes.append(f"The file does not say where {', '.join(lost[:4])} stands: it is drawn at the origin.")
    return Calibration(cameras, file.path, TITLE, notes=tuple(notes))


def _tables(section: Section) -> Iterator[Section]:
    """The tables of cameras: [cam_0], or [cameras.0] as caliscope has them."""
    for key, value in section.values.items():
        if isinstance(value, dict) and key == "cameras":
            yield from _tables(section.section(key))
        elif isinstance(value, dict) and "matrix" in value:
            yield section.section(key)


def _camera(part: Section, given: Size | None) -> Camera:
    size = agreed_size(part.size("size"), given, "size")
    grid = part.intrinsics(part.matrix("matrix", 3, 3), part.where("matrix"), size)
    with explained(part.where("distortions")):
        if part.values.get("fisheye") is True:
            lens: Any = KannalaBrandt(*part.coefficients("distortions", [4], "k1 k2 k3 k4 of cv2.fisheye"))
        else:
            lens = BrownConrady.from_coefficients(
                part.coefficients("distortions", [4, 5, 8, 12, 14], "k1 k2 p1 p2 k3 …")
            )
    return Camera(grid, lens, _pose(part).inv())


def _is_placed(part: Section) -> bool:
    """Whether both are there; caliscope writes the word null for a pose that it does not know."""
    return all(part.values.get(key, "null") != "null" for key in ("rotation", "translation"))


def _pose(part: Section) -> RigidTransform:
    if not _is_placed(part):
        return RigidTransform.identity()
    turned = part.array("rotation").size == 9
    rotation = part.rotation("rotation") if turned else Rotation.from_rotvec(part.vector("rotation", [3], "a vector"))
    return RigidTransform.from_components(part.vector("translation", [3], "x y z"), rotation)


def write(calibration: Calibration) -> bytes:
    """cam_0, cam_1 … as anipose writes them."""
    lines = []
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        model, same = expressed(name, camera, MODELS, TITLE)
        grid, pose, values = camera.intrinsics, camera.cam_from_world, model.values(same, 0.0)
        lines += [f"[cam_{index}]", f"name = {json.dumps(name, ensure_ascii=False)}"]
        lines += [f"size = [{grid.width}, {grid.height}]", f"matrix = {same.intrinsics.K.tolist()}"]
        lines += [f"distortions = {values[4:]}", f"rotation = {_listed(pose.rotation.as_rotvec())}"]
        lines += [f"translation = {_listed(pose.translation)}"]
        lines += ["fisheye = true", ""] if isinstance(same.lens, KannalaBrandt) else [""]
    return ("\n".join([*lines, "[metadata]"]) + "\n").encode()


def _listed(vector: np.ndarray) -> list[float]:
    return [float(x) for x in vector]


FORMAT = Format(
    name="anipose",
    title=TITLE,
    file="calibration.toml",
    recognise=lambda file: _MATRIX.search(file.text, 0, HEAD),
    read=read,
    write=write,
    own_world=True,
    models="5, 8, 12, 14 coefficients of OpenCV; `fisheye = true`",
    says="Pose2Sim's and caliscope's too; rotation and translation: world → camera, in the board's unit",
    lacks="skew",
    rank=31,
)
