"""EuRoC's sensor.yaml: one camera beside the body, which is the IMU."""

from __future__ import annotations

from typing import Any

from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format, chosen, coefficients_of, listed
from camviz_clinic.files.models import expressed
from camviz_clinic.files.output import as_matrix, as_yaml
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import agreed_size
from camviz_clinic.files.trees import shown

TITLE = "EuRoC sensor.yaml"
MODELS = LAYOUTS["euroc"]


def is_sensor(file: File) -> bool:
    """True for a file that says so, or that has the transform to the body."""
    return "T_BS" in file.section or file.section.values.get("sensor_type") == "camera"


def read(file: File) -> Calibration:
    """The camera at the origin; T_BS takes its points to the body, where the IMU is."""
    section = file.section
    section.choice("camera_model", ["pinhole"])
    model = chosen(section, "distortion_model", MODELS)
    size = agreed_size(section.size("resolution"), file.size, "resolution")
    values = section.vector("intrinsics", [4], "fu fv cu cv")
    model, coefficients = coefficients_of(section, "distortion_coefficients", model, len(values))
    camera = model.camera([*values, *coefficients], *size, 0.0, section.where("intrinsics"))
    imu = section.transform("T_BS").inv() if "T_BS" in section else None
    return Calibration({"camera": camera}, file.path, TITLE, world_from_imu=imu)


def write(calibration: Calibration) -> bytes:
    """One camera; T_BS is left out where the calibration does not know of an IMU."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    values = model.values(same, 0.0)
    tree: dict[str, Any] = {"sensor_type": "camera", "comment": shown(name)}
    if calibration.world_from_imu is not None:
        tree["T_BS"] = as_matrix(calibration.world_from_imu.inv().as_matrix())
    tree |= {"resolution": [camera.intrinsics.width, camera.intrinsics.height], "camera_model": "pinhole"}
    tree |= {"intrinsics": values[:4], "distortion_model": model.name, "distortion_coefficients": values[4:]}
    return as_yaml(tree)


FORMAT = Format(
    name="euroc",
    title=TITLE,
    file="sensor.yaml",
    recognise=is_sensor,
    read=read,
    write=write,
    most_cameras=1,
    models=listed(MODELS),
    says="T_BS: camera → body, the IMU",
    lacks="skew, k3",
)
