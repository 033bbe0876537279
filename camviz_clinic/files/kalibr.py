"""Kalibr camera chains: cam0, cam1 … each with a projection, a distortion and its place beside the one before."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.redundancy import Redundancy, between_transforms, compared
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, coefficients_of
from camviz_clinic.files.models import Model, expressed
from camviz_clinic.files.opencv import image_size
from camviz_clinic.files.output import as_rows, as_yaml
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.redundant import rigid
from camviz_clinic.files.section import Section, Size
from camviz_clinic.files.trees import shown

STEP, TO_CAMERA, TO_IMU = "T_cn_cnm1", "T_cam_imu", "T_imu_cam"
SAME = 0.1  # ° or mm: transforms that are no farther apart are one
WORDS = ("camera_model", "distortion_model")
SYNONYMS = {"equi": "equidistant", "radial-tangential": "radtan"}
TITLE = "Kalibr camchain"
MODELS = LAYOUTS["kalibr"]  # camera_model and distortion_model; Kalibr's fu fv pu pv are fx fy cx cy, its w is omega


def read(file: File) -> Calibration:
    """The cameras of the chain in place: the world is cam0's frame, T_cn_cnm1 is cam_n from cam_(n-1)."""
    chain = _chain(file.section)
    imus = {name: _cam_from_imu(part) for name, part in chain.items()}
    cameras: dict[str, Camera] = {}
    cam_from_world, notes = RigidTransform.identity(), []
    redundant: list[Redundancy] = []
    for index, (name, part) in enumerate(chain.items()):
        redundant += _both_ways(part)
        if index:
            before = f"cam{index - 1}"
            step = _from_previous(part, imus[name], imus[before])
            if step is None:
                step = RigidTransform.identity()
                notes.append(f"The file does not say where {name} stands: it is drawn at the place of {before}.")
            elif STEP in part and imus[name] is not None and imus[before] is not None:
                redundant += _by_the_imu(name, part, before, chain[before])
            cam_from_world = step * cam_from_world
        cameras[name] = _camera(part, file.size).at(cam_from_world.inv())
    return Calibration(
        cameras,
        file.path,
        TITLE,
        world_from_imu=imus["cam0"],
        notes=tuple(notes),
        redundant=tuple(redundant),
    )


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


def _from_previous(
    part: Section, cam_from_imu: RigidTransform | None, before_from_imu: RigidTransform | None
) -> RigidTransform | None:
    """cam_n from cam_(n-1), said directly or by way of the IMU; None where the file says neither."""
    if STEP in part:
        return part.transform(STEP)
    if cam_from_imu is None or before_from_imu is None:
        return None
    return cam_from_imu * before_from_imu.inv()


def _cam_from_imu(part: Section) -> RigidTransform | None:
    """Kalibr's T_cam_imu takes the IMU's points to the camera; OpenVINS writes its inverse, T_imu_cam."""
    if TO_CAMERA in part:
        return part.transform(TO_CAMERA)
    return part.transform(TO_IMU).inv() if TO_IMU in part else None


# What a chain says twice.


def _both_ways(part: Section) -> Iterator[Redundancy]:
    """T_cam_imu beside its inverse T_imu_cam, where a camera has both."""
    if TO_CAMERA in part and TO_IMU in part and (values := rigid((part, TO_CAMERA), (part, TO_IMU))):
        yield compared(part.where(TO_CAMERA), TO_IMU, lambda a, b: between_transforms(a, _inverse(b)), *values)


def _by_the_imu(name: str, part: Section, before: str, previous: Section) -> Iterator[Redundancy]:
    """The step from the camera before, beside the way by the IMU."""
    keys = [TO_CAMERA if TO_CAMERA in each else TO_IMU for each in (part, previous)]
    values = rigid((part, STEP), (part, keys[0]), (previous, keys[1]))
    if values is None:
        return

    def way(cam: Array, other: Array) -> Array:
        cam_from_imu = cam if keys[0] == TO_CAMERA else _inverse(cam)
        imu_from_before = _inverse(other) if keys[1] == TO_CAMERA else other
        return np.asarray(cam_from_imu @ imu_from_before)

    turned = between_transforms(_inverse(values[0]), way(*values[1:]))
    inverse = np.linalg.norm(turned["°"]) < SAME and np.linalg.norm(turned["mm"]) < SAME
    yield compared(
        part.where(STEP),
        f"{' and '.join(dict.fromkeys(keys))} of {before} and {name}",
        lambda step, cam, other: between_transforms(step, way(cam, other)),
        *values,
        hint="The inverse of the one is the other." if inverse else "",
    )


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=float)


# Writing.


def write(calibration: Calibration) -> bytes:
    """cam0, cam1 …, each beside the one before and, where there is one, beside the IMU."""
    chain: dict[str, Any] = {}
    before = None
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        part = _written(name, camera)
        if calibration.world_from_imu is not None:
            part[TO_CAMERA] = as_rows(camera.cam_from_world * calibration.world_from_imu)
        if before is not None:
            part[STEP] = as_rows(camera.cam_from_world * before.world_from_cam)
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
