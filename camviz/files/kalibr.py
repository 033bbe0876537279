"""Kalibr camera chains: cam0, cam1 … each with a projection, a distortion and its place beside the one before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from camviz.calibration.types import Calibration, CalibrationError
from camviz.cameras import Camera
from camviz.files.models import Model, expressed, models_of
from camviz.files.opencv import image_size
from camviz.files.output import as_yaml, refuse_own_world, rows_of
from camviz.files.section import Section
from camviz.files.trees import shown
from camviz.poses import RigidTransform

SYNONYMS = {"equi": "equidistant", "radial-tangential": "radtan"}
# by projection and distortion, such as ("pinhole", "radtan")
MODELS = {(model.name.split()[0], model.name.split()[1]): model for model in models_of("kalibr")}
KEYS = {"fx": "fu", "fy": "fv", "cx": "pu", "cy": "pv", "omega": "w"}


def read(section: Section, path: Path, size: tuple[int, int] | None) -> Calibration:
    """The cameras of the chain in place: the world is cam0's frame, T_cn_cnm1 is cam_n from cam_(n-1)."""
    chain = _chain(section)
    cameras: dict[str, Camera] = {}
    cam_from_world, notes = RigidTransform.identity(), []
    for index, (name, part) in enumerate(chain.items()):
        if index:
            step = _from_previous(part, chain[f"cam{index - 1}"])
            if step is None:
                step = RigidTransform.identity()
                notes.append(f"The file does not say where {name} stands: it is drawn at the place of cam{index - 1}.")
            cam_from_world = step * cam_from_world
        cameras[name] = _camera(part, size).at(cam_from_world.inv())
    imu = _cam_from_imu(chain["cam0"])
    return Calibration(cameras, path, "Kalibr camchain", world_from_imu=imu, notes=tuple(notes))


def _chain(section: Section) -> dict[str, Section]:
    names = [key for key in section.values if key.startswith("cam") and key[3:].isdecimal()]
    expected = [f"cam{index}" for index in range(len(names))]
    if set(names) != set(expected):
        raise CalibrationError(f"expected the cameras {', '.join(expected)}, got {', '.join(sorted(names))}")
    return {name: section.section(name) for name in expected}


def _camera(part: Section, size: tuple[int, int] | None) -> Camera:
    projection = _choice(part, "camera_model", [projection for projection, _ in MODELS])
    names, _ = _parameters(next(model for (each, _), model in MODELS.items() if each == projection))
    values = part.vector("intrinsics", [len(names)], _in_its_words(names))
    width, height = image_size(part, size)
    model = _model(part, projection)
    _, names = _parameters(model)
    held = part.values.get("distortion_coeffs") or names
    others = (5, 8) if names == ["k1", "k2", "p1", "p2"] and projection == "pinhole" else ()
    coefficients = part.coefficients("distortion_coeffs", [len(names)], _in_its_words(names), others) if held else []
    if len(coefficients) != len(names):  # mended: more of OpenCV's coefficients, in OpenCV's order
        more = model.lens.parameters()[len(names) : len(coefficients)]
        model = replace(model, parameters=" ".join([*model.names, *more]))
    return model.camera([*values, *coefficients], width, height, 0.0, part.where("intrinsics"))


def _model(part: Section, projection: str) -> Model:
    distortion = _choice(part, "distortion_model", [distortion for _, distortion in MODELS])
    model = MODELS.get((projection, distortion))
    if model is None:
        known = ", ".join(other for each, other in MODELS if each == projection)
        raise part.error("distortion_model", f"{known} with {projection}", shown(distortion))
    return model


def _parameters(model: Model) -> tuple[list[str], list[str]]:
    """Those of the projection, which end with cx cy, and those of the distortion."""
    end = model.names.index("cy") + 1
    return model.names[:end], model.names[end:]


def _in_its_words(names: list[str]) -> str:
    return " ".join(KEYS.get(name, name) for name in names)


def _choice(part: Section, key: str, known: list[str]) -> str:
    value = SYNONYMS.get(part.text(key), part.text(key))
    if value not in known:
        raise part.error(key, " or ".join(dict.fromkeys(known)), shown(value))
    return value


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
    refuse_own_world(calibration, "Kalibr")
    chain: dict[str, Any] = {}
    before = None
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        part = _written(name, camera)
        if calibration.world_from_imu is not None:
            part["T_cam_imu"] = rows_of(camera.cam_from_world * calibration.world_from_imu)
        if before is not None:
            part["T_cn_cnm1"] = rows_of(camera.cam_from_world * before.world_from_cam)
        chain[f"cam{index}"], before = part, camera
    return as_yaml(chain)


def _written(name: str, camera: Camera) -> dict[str, Any]:
    model, same = expressed(name, camera, MODELS.values(), "Kalibr")
    projection, distortion = model.name.split()
    values = model.values(same, 0.0)
    count = len(_parameters(model)[0])
    return {
        "camera_model": projection,
        "intrinsics": values[:count],
        "distortion_model": distortion,
        "distortion_coeffs": values[count:],
        "resolution": [camera.intrinsics.width, camera.intrinsics.height],
    }
