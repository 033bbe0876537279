"""OpenMVG's sfm_data.json: views, their intrinsics and where they were taken."""

from __future__ import annotations

from typing import Any

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt, Perspective
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import Model
from camviz_clinic.files.section import COUNT, Section, Size, agreed_size
from camviz_clinic.files.trees import shown

TITLE = "OpenMVG"
MODELS = {  # by the key of the distortion, which is there only for those that have one
    "disto_k1": Model("pinhole_radial_k1", BrownConrady, "f cx cy k1"),
    "disto_k3": Model("pinhole_radial_k3", BrownConrady, "f cx cy k1 k2 k3"),
    "disto_t2": Model("pinhole_brown_t2", BrownConrady, "f cx cy k1 k2 k3 p1 p2"),
    "fisheye": Model("fisheye", KannalaBrandt, "f cx cy k1 k2 k3 k4"),
}
PINHOLE = Model("pinhole", Perspective, "f cx cy")


def read(file: File) -> Calibration:
    """The views that have a pose as cameras, x_cam = R (x_world - C); without poses the intrinsics at the origin."""
    section = file.section
    lenses = {key: _camera(data, file.size) for key, data in _values(section, "intrinsics")}
    poses = {key: _pose(data) for key, data in _values(section, "extrinsics")}
    placed: dict[str, Camera] = {}
    for _, view in _values(section, "views"):
        intrinsic, pose = view.number("id_intrinsic"), view.number("id_pose")
        if intrinsic in lenses and pose in poses:
            name = view.text("filename")
            if name in placed:
                raise view.error("filename", "images of different names", f"{shown(name)} twice")
            placed[name] = lenses[intrinsic].at(poses[pose])
    if placed:
        notes = ("The world has no unit of its own: lengths are in the file's.",)
        return Calibration(placed, file.path, TITLE, notes=notes)
    if not lenses:
        raise CalibrationError("expected at least one of the intrinsics, found none")
    notes = ("No view has both intrinsics and a pose: the cameras stand at the origin.",)
    return Calibration({f"camera{key:g}": camera for key, camera in lenses.items()}, file.path, TITLE, notes=notes)


def _values(section: Section, key: str) -> list[tuple[float, Section]]:
    """The entries of a list as its library for archives writes them: a key, and a value behind pointers."""
    found = []
    for entry in section.sections(key) if section.values.get(key) else []:
        value = entry.section("value")
        wrapped = value.section("ptr_wrapper").section("data") if "ptr_wrapper" in value else value
        found.append((entry.number("key"), wrapped))
    return found


def _camera(data: Section, given: Size | None) -> Camera:
    size = agreed_size(data.sides("width", "height"), given, "width, height")
    if "focal_length" not in data:
        raise data.error("focal_length", "a focal length: panoramas of OpenMVG are not read here", "none")
    values = [data.number("focal_length"), *data.vector("principal_point", [2], "cx cy")]
    key = next((key for key in MODELS if key in data), None)
    model = PINHOLE if key is None else MODELS[key]
    if key is not None:
        values += data.vector(key, [len(model.names) - 3], " ".join(model.names[3:]), COUNT)
    return model.camera(values, *size, 0.0, data.path)


def _pose(data: Section) -> Any:
    turn = RigidTransform.from_rotation(data.rotation("rotation"))
    return RigidTransform.from_translation(data.vector("center", [3], "x y z")) * turn.inv()


FORMAT = Format(
    name="openmvg",
    title=TITLE,
    file="sfm_data.json",
    recognise=lambda file: "sfm_data_version" in file.section,
    read=read,
    models=", ".join([PINHOLE.name, *(model.name for model in MODELS.values())]),
    says="x_cam = R (x_world − center); no unit",
    example=b"""{"sfm_data_version": "0.3", "root_path": "/images",
"views": [{"key": 0, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483649, "data": {
  "local_path": "", "filename": "a.jpg", "width": 640, "height": 480,
  "id_view": 0, "id_intrinsic": 0, "id_pose": 0}}}}],
"intrinsics": [{"key": 0, "value": {"polymorphic_id": 2147483649, "polymorphic_name": "pinhole_brown_t2",
  "ptr_wrapper": {"id": 2147483660, "data": {"width": 640, "height": 480, "focal_length": 500.5,
  "principal_point": [321.25, 238.5], "disto_t2": [-0.1, 0.02, -0.003, 0.001, -0.002]}}}}],
"extrinsics": [{"key": 0, "value": {"rotation": [[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]], "center": [0.5, -1, 2]}}],
"structure": [], "control_points": []}
""",
    rank=47,
)
