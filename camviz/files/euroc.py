"""EuRoC's sensor.yaml: one camera beside the body, which is the IMU."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from camviz.calibration.types import Calibration
from camviz.files.models import expressed, model_named, models_of
from camviz.files.output import as_yaml, only_camera, refuse_own_world
from camviz.files.section import Section
from camviz.files.sizes import agreed_size, pair_of_sides
from camviz.files.trees import shown
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform

GRID = "fx fy cx cy"
RADIAL_TANGENTIAL = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]
MODELS = models_of("euroc")


def is_sensor(section: Section) -> bool:
    return "T_BS" in section or section.values.get("sensor_type") == "camera"


def read(section: Section, path: Path, size: tuple[int, int] | None) -> Calibration:
    """The camera at the origin; T_BS takes its points to the body, where the IMU is."""
    section.choice("camera_model", ["pinhole"])
    name = section.choice("distortion_model", [model.name for model in MODELS])
    model = model_named(name, MODELS) or MODELS[0]
    held = pair_of_sides(section, "resolution") if "resolution" in section else None
    width, height = agreed_size(held, size, "resolution")
    values = section.vector("intrinsics", [4], "fu fv cu cv")
    others = (5, 8) if model.lens is BrownConrady else ()
    coefficients = section.coefficients("distortion_coefficients", [4], " ".join(model.names[4:]), others)
    if len(coefficients) != 4:  # mended
        model = replace(model, parameters=" ".join([GRID, *RADIAL_TANGENTIAL[: len(coefficients)]]))
    values += coefficients
    camera = model.camera(values, width, height, 0.0, section.where("intrinsics"))
    imu = section.transform("T_BS").inv() if "T_BS" in section else None
    return Calibration({"camera": camera}, path, "EuRoC sensor.yaml", world_from_imu=imu)


def write(calibration: Calibration) -> bytes:
    """One camera; T_BS is left out where the calibration does not know of an IMU."""
    title = "EuRoC's sensor.yaml"
    name, camera = only_camera(calibration, title)
    refuse_own_world(calibration, title)
    model, same = expressed(name, camera, MODELS, title)
    values = model.values(same, 0.0)
    tree: dict[str, Any] = {"sensor_type": "camera", "comment": shown(name)}
    if calibration.world_from_imu is not None:
        tree["T_BS"] = _matrix(calibration.world_from_imu.inv())
    tree |= {"resolution": [camera.intrinsics.width, camera.intrinsics.height], "camera_model": "pinhole"}
    tree |= {"intrinsics": values[:4], "distortion_model": model.name, "distortion_coefficients": values[4:]}
    return as_yaml(tree)


def _matrix(pose: RigidTransform) -> dict[str, Any]:
    return {"cols": 4, "rows": 4, "data": [float(x) for x in pose.as_matrix().ravel()]}
