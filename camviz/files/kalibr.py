"""Kalibr camera chains: cam0, cam1 … each with a projection, a distortion and its place beside the one before."""

from __future__ import annotations

import re
from typing import Any

from camviz.calibration.types import Calibration, CalibrationError
from camviz.cameras import Camera
from camviz.files.format import File, Format, coefficients_of
from camviz.files.models import Model, expressed, models_of
from camviz.files.opencv import image_size
from camviz.files.output import as_rows, as_yaml
from camviz.files.section import Section, Size
from camviz.files.trees import shown
from camviz.poses import RigidTransform

WORDS = ("camera_model", "distortion_model")
SYNONYMS = {"equi": "equidistant", "radial-tangential": "radtan"}
TITLE = "Kalibr camchain"
MODELS = models_of("kalibr")  # camera_model and distortion_model; Kalibr's fu fv pu pv are fx fy cx cy, its w is omega


def read(file: File) -> Calibration:
    """The cameras of the chain in place: the world is cam0's frame, T_cn_cnm1 is cam_n from cam_(n-1)."""
    chain = _chain(file.section)
    cameras: dict[str, Camera] = {}
    cam_from_world, notes = RigidTransform.identity(), []
    for index, (name, part) in enumerate(chain.items()):
        if index:
            step = _from_previous(part, chain[f"cam{index - 1}"])
            if step is None:
                step = RigidTransform.identity()
                notes.append(f"The file does not say where {name} stands: it is drawn at the place of cam{index - 1}.")
            cam_from_world = step * cam_from_world
        cameras[name] = _camera(part, file.size).at(cam_from_world.inv())
    imu = _cam_from_imu(chain["cam0"])
    return Calibration(cameras, file.path, TITLE, world_from_imu=imu, notes=tuple(notes))


def _chain(section: Section) -> dict[str, Section]:
    names = [key for key in section.values if key.startswith("cam") and key[3:].isdecimal()]
    expected = [f"cam{index}" for index in range(len(names))]
    if set(names) != set(expected):
        raise CalibrationError(f"expected the cameras {', '.join(expected)}, got {', '.join(sorted(names))}")
    return {name: section.section(name) for name in expected}


def _camera(part: Section, given: Size | None) -> Camera:
    model = _model(part)
    count = model.names.index("cy") + 1
    values = part.vector("intrinsics", [count], " ".join(model.names[:count]))
    size = image_size(part, given)
    if model.names[count:] or part.values.get("distortion_coeffs"):
        model, coefficients = coefficients_of(part, "distortion_coeffs", model, count)
        values += coefficients
    return model.camera(values, *size, 0.0, part.where("intrinsics"))


def _model(part: Section) -> Model:
    projection, distortion = (SYNONYMS.get(part.text(key), part.text(key)) for key in WORDS)
    by_name = {model.name: model for model in MODELS}
    for index, word in enumerate((projection, distortion)):
        known = list(dict.fromkeys(name.split()[index] for name in by_name))
        if word not in known:
            raise part.error(WORDS[index], " or ".join(known), shown(word))
    if f"{projection} {distortion}" not in by_name:
        known = [name.split()[1] for name in by_name if name.startswith(f"{projection} ")]
        raise part.error(WORDS[1], f"{', '.join(known)} with {projection}", shown(distortion))
    return by_name[f"{projection} {distortion}"]


def _from_previous(part: Section, previous: Section) -> RigidTransform | None:
    """cam_n from cam_(n-1), said directly or by way of the IMU; None where the file says neither."""
    if "T_cn_cnm1" in part:
        return part.transform("T_cn_cnm1")
    cam, before = _cam_from_imu(part), _cam_from_imu(previous)
    return None if cam is None or before is None else cam * before.inv()


def _cam_from_imu(part: Section) -> RigidTransform | None:
    """Kalibr's T_cam_imu takes the IMU's points to the camera; OpenVINS writes its inverse, T_imu_cam."""
    if "T_cam_imu" in part:
        return part.transform("T_cam_imu")
    return part.transform("T_imu_cam").inv() if "T_imu_cam" in part else None


# Writing.


def write(calibration: Calibration) -> bytes:
    """cam0, cam1 …, each beside the one before and, where there is one, beside the IMU."""
    chain: dict[str, Any] = {}
    before = None
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        part = _written(name, camera)
        if calibration.world_from_imu is not None:
            part["T_cam_imu"] = as_rows(camera.cam_from_world * calibration.world_from_imu)
        if before is not None:
            part["T_cn_cnm1"] = as_rows(camera.cam_from_world * before.world_from_cam)
        chain[f"cam{index}"], before = part, camera
    return as_yaml(chain)


def _written(name: str, camera: Camera) -> dict[str, Any]:
    model, same = expressed(name, camera, MODELS, TITLE)
    projection, distortion = model.name.split()
    values = model.values(same, 0.0)
    count = model.names.index("cy") + 1
    return {
        "camera_model": projection,
        "intrinsics": values[:count],
        "distortion_model": distortion,
        "distortion_coeffs": values[count:],
        "resolution": [camera.intrinsics.width, camera.intrinsics.height],
    }


FORMAT = Format(
    name="kalibr",
    title=TITLE,
    file="camchain.yaml",
    recognise=lambda file: any(re.fullmatch(r"cam\d+", key) for key in file.section.values),
    read=read,
    write=write,
    models="pinhole with radtan, equidistant, fov, none; omni with radtan, none; eucm; ds",
    says="T_cn_cnm1 from the camera before; T_cam_imu from the IMU (OpenVINS's T_imu_cam is read too)",
    lacks="skew, k3",
    rank=41,
)
