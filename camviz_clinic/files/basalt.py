"""Basalt's calibration json: cameras around an IMU."""

from __future__ import annotations

from typing import Any

from camviz.cameras import Camera
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, by_imu, chosen, listed
from camviz_clinic.files.models import Model, expressed
from camviz_clinic.files.output import as_json
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, as_size

MODELS = LAYOUTS["basalt"]
KEYS = {"omega": "w"}


def read(file: File) -> Calibration:
    """cam0, cam1 … by T_imu_cam, the camera's place in the IMU's frame; the world is cam0's frame."""
    whole = file.section.section("value0")
    lenses, places = whole.sections("intrinsics"), whole.sections("T_imu_cam")
    if not lenses or len(lenses) != len(places):
        raise whole.error("intrinsics", "as many cameras as in T_imu_cam, at least one", f"{len(lenses)}")
    sizes = whole.matrix("resolution", len(lenses), 2)
    imu_from_cam = [_pose(place) for place in places]
    cameras = {}
    for index, (part, size) in enumerate(zip(lenses, sizes, strict=True)):
        cameras[f"cam{index}"] = _camera(part, as_size(size[0], size[1], whole.where(f"resolution[{index}]")))
    placed, world_from_imu = by_imu(cameras, imu_from_cam)
    return Calibration(placed, file.path, "Basalt", world_from_imu=world_from_imu)


def _pose(section: Section) -> RigidTransform:
    quaternion = [section.number(key) for key in ("qx", "qy", "qz", "qw")]
    place = [section.number(key) for key in ("px", "py", "pz")]
    return RigidTransform.from_components(place, section.quaternion(quaternion, section.path))


def _camera(section: Section, size: Size) -> Camera:
    model, held = chosen(section, "camera_type", MODELS), section.section("intrinsics")
    values = [held.number(KEYS.get(key, key)) for key in model.names]
    return model.camera(values, *size, 0.0, held.path)


def write(calibration: Calibration) -> bytes:
    """All cameras beside the IMU; CalibrationError where the calibration does not know of one."""
    if calibration.world_from_imu is None:
        raise CalibrationError("Basalt places its cameras by the IMU, and this calibration holds none")
    imu_from_world = calibration.world_from_imu.inv()
    poses = [imu_from_world * camera.world_from_cam for camera in calibration.cameras.values()]
    held = [expressed(name, camera, MODELS, "Basalt") for name, camera in calibration.cameras.items()]
    tree: dict[str, Any] = {
        "T_imu_cam": [_written_pose(pose) for pose in poses],
        "intrinsics": [_written_camera(model, camera) for model, camera in held],
        "resolution": [[camera.intrinsics.width, camera.intrinsics.height] for _, camera in held],
    }
    return as_json({"value0": tree})


def _written_pose(pose: RigidTransform) -> dict[str, float]:
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw")
    return dict(zip(names, map(float, (*pose.translation, *pose.rotation.as_quat())), strict=True))


def _written_camera(model: Model, camera: Camera) -> dict[str, Any]:
    values = zip(model.names, model.values(camera, 0.0), strict=True)
    return {"camera_type": model.name, "intrinsics": {KEYS.get(name, name): value for name, value in values}}


FORMAT = Format(
    name="basalt",
    title="Basalt",
    file="calibration.json",
    recognise=lambda file: "value0" in file.section,
    read=read,
    write=write,
    models=listed(MODELS),
    says="T_imu_cam: camera → IMU, quaternion x y z w",
    lacks="skew, cameras without an IMU",
)
