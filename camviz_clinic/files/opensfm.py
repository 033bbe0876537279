"""OpenSfM's reconstruction.json and camera_models.json: lengths in units of the longer side of the image."""

from __future__ import annotations

import re
from math import pi
from typing import Any

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Equirectangular
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, chosen, listed, parameters_of
from camviz_clinic.files.models import expressed
from camviz_clinic.files.output import as_json
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size
from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import parse

TITLE = "OpenSfM"
MODELS = LAYOUTS["opensfm"]
PANORAMAS = ("spherical", "equirectangular")
KEYS = {"f": "focal", "fx": "focal_x", "fy": "focal_y", "cx": "c_x", "cy": "c_y"}
CENTRED = ("perspective", "fisheye")  # have no principal point but the middle of the image
LENGTHS = ("f", "fx", "fy", "cx", "cy")
_START = re.compile(r'"projection_type"[ \t\r\n]*:')


def read(file: File) -> Calibration:
    """The shots as cameras in the world, x_cam = R x_world + t; without shots the camera models at the origin."""
    tree, notes = parse(file.text), []
    if isinstance(tree, list) and tree:
        if len(tree) > 1:
            notes.append(f"The first of {len(tree)} reconstructions is read; they have no common world.")
        tree = tree[0]
    section = file.mapping(tree)
    models = section.section("cameras") if "cameras" in section else section
    cameras = {name: _camera(models.section(name), file.size) for name in models.values}
    if "shots" not in section:
        return _calibration(cameras, file, notes)
    shots, placed = section.section("shots"), {}
    for name in shots.values:
        shot = shots.section(name)
        placed[name] = cameras[shot.choice("camera", list(cameras))].at(_pose(shot).inv())
    notes.append("The world's unit is the file's: metres where the pictures had GPS.")
    return _calibration(placed, file, notes)


def _calibration(cameras: dict[str, Camera], file: File, notes: list[str]) -> Calibration:
    if not cameras:
        raise CalibrationError("expected at least one camera, found none")
    return Calibration(cameras, file.path, TITLE, notes=tuple(notes))


def _pose(shot: Section) -> RigidTransform:
    turn = Rotation.from_rotvec(shot.vector("rotation", [3], "a vector"))
    return RigidTransform.from_components(shot.vector("translation", [3], "x y z"), turn)


def _camera(part: Section, given: Size | None) -> Camera:
    """A pixel is its share of the longer side, times that side, from the middle of the image."""
    width, height = agreed_size(part.sides("width", "height"), given, "width, height")
    side, middle = max(width, height), ((width - 1) / 2, (height - 1) / 2)
    if part.text("projection_type") in PANORAMAS:
        return Camera(Intrinsics(width, height, side / (2 * pi), side / (2 * pi), *middle), Equirectangular())
    model = chosen(part, "projection_type", MODELS)
    held = part.part({"c_x": 0.0, "c_y": 0.0, **part.values}, part.path)
    values = parameters_of(held, model, KEYS)
    pixels = [x * side if name in LENGTHS else x for name, x in zip(model.names, values, strict=True)]
    for axis, name in enumerate(("cx", "cy")):
        pixels[model.names.index(name)] += middle[axis]
    return model.camera(pixels, width, height, 0.0, part.path)


def write(calibration: Calibration) -> bytes:
    """One reconstruction, with a camera model and a shot for each camera."""
    models: dict[str, Any] = {}
    shots: dict[str, Any] = {}
    for name, camera in calibration.cameras.items():
        model, same = expressed(name, camera, [each for each in MODELS if _holds(each.name, camera)], TITLE)
        grid, pose = camera.intrinsics, camera.cam_from_world
        side, middle = max(grid.width, grid.height), {"cx": (grid.width - 1) / 2, "cy": (grid.height - 1) / 2}
        values = dict(zip(model.names, model.values(same, 0.0), strict=True))
        values = {key: (x - middle.get(key, 0.0)) / side if key in LENGTHS else x for key, x in values.items()}
        held = {KEYS.get(key, key): x for key, x in values.items() if model.name not in CENTRED or key not in middle}
        models[name] = {"projection_type": model.name, "width": grid.width, "height": grid.height, **held}
        shots[name] = {
            "rotation": [float(x) for x in pose.rotation.as_rotvec()],
            "translation": [float(x) for x in pose.translation],
            "camera": name,
        }
    return as_json([{"cameras": models, "shots": shots, "points": {}}])


def _holds(model: str, camera: Camera) -> bool:
    """Whether the principal point is where the model has it."""
    grid = camera.intrinsics
    return model not in CENTRED or (grid.cx, grid.cy) == ((grid.width - 1) / 2, (grid.height - 1) / 2)


FORMAT = Format(
    name="opensfm",
    title=TITLE,
    file="reconstruction.json",
    recognise=lambda file: _START.search(file.text, 0, HEAD),
    read=read,
    write=write,
    own_world=True,
    models=f"{listed(MODELS)}; spherical is read too",
    says="camera_models.json too; lengths in units of the longer side, from the middle of the image",
    lacks="skew",
    rank=37,
)
