"""OKVIS's configuration: a list of cameras, each by its place on the IMU."""

from __future__ import annotations

from typing import Any

from camviz.cameras import Camera
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, by_imu, chosen, coefficients_of, listed
from camviz_clinic.files.models import expressed
from camviz_clinic.files.output import as_yaml
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size

TITLE = "OKVIS configuration"
MODELS = LAYOUTS["okvis"]


def is_configuration(file: File) -> bool:
    """True where the first of the cameras has a place on the IMU under T_SC."""
    cameras = file.section.values.get("cameras")
    return isinstance(cameras, list) and bool(cameras) and isinstance(cameras[0], dict) and "T_SC" in cameras[0]


def read(file: File) -> Calibration:
    """cam0, cam1 … by T_SC, which takes a camera's points to the IMU's frame."""
    parts = file.section.sections("cameras")
    cameras = {f"cam{index}": _camera(part, file.size) for index, part in enumerate(parts)}
    placed, world_from_imu = by_imu(cameras, [_place(part) for part in parts])
    return Calibration(placed, file.path, TITLE, world_from_imu=world_from_imu)


def _place(part: Section) -> Any:
    return part.part({"T_SC": part.matrix("T_SC", 4, 4).tolist()}, part.path).transform("T_SC")


def _camera(part: Section, given: Size | None) -> Camera:
    model = chosen(part, "distortion_type", MODELS)
    size = agreed_size(part.size("image_dimension"), given, "image_dimension")
    values = part.vector("focal_length", [2], "fx fy") + part.vector("principal_point", [2], "cx cy")
    model, coefficients = coefficients_of(part, "distortion_coefficients", model, 4)
    return model.camera([*values, *coefficients], *size, 0.0, part.path)


def write(calibration: Calibration) -> bytes:
    """All cameras beside the IMU; CalibrationError where the calibration does not know of one."""
    if calibration.world_from_imu is None:
        raise CalibrationError(f"{TITLE} places its cameras by the IMU, and this calibration holds none")
    imu_from_world = calibration.world_from_imu.inv()
    parts = []
    for name, camera in calibration.cameras.items():
        model, same = expressed(name, camera, MODELS, TITLE)
        values = model.values(same, 0.0)
        pose = imu_from_world * camera.world_from_cam
        part: dict[str, Any] = {"T_SC": [float(x) for x in pose.as_matrix().ravel()]}
        part |= {"image_dimension": [camera.intrinsics.width, camera.intrinsics.height]}
        part |= {"distortion_coefficients": values[4:], "distortion_type": model.name}
        parts.append(part | {"focal_length": values[:2], "principal_point": values[2:4]})
    return as_yaml({"cameras": parts})


FORMAT = Format(
    name="okvis",
    title=TITLE,
    file="config.yaml",
    recognise=is_configuration,
    read=read,
    write=write,
    models=listed(MODELS),
    says="T_SC: camera → IMU",
    lacks="skew, cameras without an IMU",
    rank=43,
)
