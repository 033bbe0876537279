"""SVO's and vikit's camera files: a list of cameras on a body, one alone, or rpg_svo's few lines of `cam_model`."""

from __future__ import annotations

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, FieldOfView, KannalaBrandt, Perspective
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, by_imu, listed
from camviz_clinic.files.models import Model
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import COUNT, Section, Size, agreed_size

TITLE = "SVO camera"
MODELS = {model.name: model for model in LAYOUTS["svo"]}
FIRST = {  # rpg_svo's: ATAN has fx, fy, cx and cy as fractions of the width and the height
    "Pinhole": (Model("Pinhole", BrownConrady, "fx fy cx cy k1 k2 p1 p2"), "cam_d0 cam_d1 cam_d2 cam_d3"),
    "EquidistantCamera": (Model("EquidistantCamera", KannalaBrandt, "fx fy cx cy k1 k2 k3 k4"), "k1 k2 k3 k4"),
    "ATAN": (Model("ATAN", FieldOfView, "fx fy cx cy omega"), "cam_d0"),
}
STRAIGHT = Model("straight", Perspective, "fx fy cx cy")
NO_DISTORTION = 1e-7  # of the first coefficient: vikit then leaves out the others too
ELSEWHERE = "Ocam"


def is_camera(file: File) -> bool:
    """True for a list of mappings with a `camera`, for one such camera, and for `cam_model`."""
    cameras = file.section.values.get("cameras")
    listed = isinstance(cameras, list) and bool(cameras) and isinstance(cameras[0], dict) and "camera" in cameras[0]
    return listed or "cam_model" in file.section or {"type", "intrinsics", "distortion"} <= set(file.section.values)


def read(file: File) -> Calibration:
    """The cameras by T_B_C, which takes a camera's points to the body; without it at the origin."""
    section = file.section
    if "cam_model" in section:
        return Calibration({"camera": _first_camera(section, file.size)}, file.path, TITLE)
    parts = section.sections("cameras") if "cameras" in section else [section]
    cameras = {
        f"cam{i}": _camera(part.section("camera") if "camera" in part else part, file.size)
        for i, part in enumerate(parts)
    }
    if not all("T_B_C" in part for part in parts):
        notes = ("The file does not say where the cameras stand: they are drawn at one place.",) * (len(parts) > 1)
        return Calibration(cameras, file.path, TITLE, notes=notes)
    placed, world_from_imu = by_imu(cameras, [part.transform("T_B_C") for part in parts])
    return Calibration(placed, file.path, TITLE, world_from_imu=world_from_imu)


def _camera(part: Section, given: Size | None) -> Camera:
    bent = part.section("distortion")
    name = f"{part.choice('type', ['pinhole'])} {bent.text('type')}"
    if name not in MODELS:
        raise bent.error("type", " or ".join(known.split()[1] for known in MODELS), repr(bent.text("type")[:40]))
    model = MODELS[name]
    size = agreed_size(part.sides("image_width", "image_height"), given, "image_width, image_height")
    values = part.vector("intrinsics", [4], "fx fy cx cy")
    if len(model.names) > 4:
        values += bent.vector("parameters", [len(model.names) - 4], " ".join(model.names[4:]), COUNT)
    return model.camera(values, *size, 0.0, part.where("intrinsics"))


def _first_camera(section: Section, given: Size | None) -> Camera:
    """The camera as vikit's camera_loader.h reads it: coefficients that are missing are 0, but for the one of ATAN."""
    name = section.choice("cam_model", [*FIRST, ELSEWHERE])
    if name == ELSEWHERE:
        raise CalibrationError(
            "cam_model: Ocam has its numbers in another file, OCamCalib's calib_results.txt, which cam_calib_file "
            "names: give that one, it is read"
        )
    model, keys = FIRST[name]
    size = agreed_size(section.sides("cam_width", "cam_height"), given, "cam_width, cam_height")
    values = [section.number(f"cam_{key}") for key in model.names[:4]]
    bent = [0.0 if key not in section and name != "ATAN" else section.number(key) for key in keys.split()]
    if name == "ATAN":
        values = [x * side for x, side in zip(values, size * 2, strict=True)]
        values[2:] = [x - 0.5 for x in values[2:]]
    if abs(bent[0]) <= NO_DISTORTION:
        return STRAIGHT.camera(values, *size, 0.0, "cam_model")
    return model.camera(values + bent, *size, 0.0, "cam_model")


FORMAT = Format(
    name="svo",
    title=TITLE,
    file="calib.yaml",
    recognise=is_camera,
    read=read,
    models=f"{listed(MODELS.values())}; Pinhole, ATAN and EquidistantCamera of cam_model",
    says="vikit's too; T_B_C: camera → body; ATAN's numbers are fractions of width and height",
    example=b"""cameras:
- camera:
    label: cam0
    image_height: 480
    image_width: 640
    type: pinhole
    intrinsics: {cols: 1, rows: 4, data: [458.5, 457.25, 320.5, 248.25]}
    distortion:
      type: radial-tangential
      parameters: {cols: 1, rows: 4, data: [-0.28, 0.074, 0.0002, 1.75e-05]}
  T_B_C:
    cols: 4
    rows: 4
    data: [0.0, -1.0, 0.0, -0.02,
           1.0, 0.0, 0.0, -0.06,
           0.0, 0.0, 1.0, 0.01,
           0.0, 0.0, 0.0, 1.0]
label: made
""",
    rank=42,
)
