"""MATLAB's cameraParameters, cameraIntrinsics or stereoParameters: toStruct(params), saved or written by jsonencode."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.redundancy import Redundancy, compared
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import expressed
from camviz_clinic.files.output import as_json
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size, explained, refuse_focal_lengths

TITLE = "MATLAB cameraParameters"
FIRST_PIXEL = 1.0
MODELS = LAYOUTS["matlab"]
RADIAL, TANGENTIAL = "RadialDistortion", "TangentialDistortion"
PAIR = {"camera1": "CameraParameters1", "camera2": "CameraParameters2"}
METRES = {"mm": 1e-3, "millimeters": 1e-3, "cm": 1e-2, "centimeters": 1e-2, "m": 1.0, "meters": 1.0}
METRES |= {"in": 0.0254, "inches": 0.0254}


def is_parameters(section: Section) -> bool:
    """True for the fields of cameraParameters, cameraIntrinsics or stereoParameters."""
    return any(key in section for key in (RADIAL, "IntrinsicMatrix", "FocalLength")) or _is_pair(section)


def _is_pair(section: Section) -> bool:
    return all(key in section for key in PAIR.values())


def read(file: File) -> Calibration:
    """From JSON."""
    return read_parameters(file.section, file)


def read_parameters(section: Section, file: File) -> Calibration:
    """One camera at the origin, or a pair whose first camera is there."""
    if not _is_pair(section):
        return _alone(section, file)
    each = {name: _alone(section.section(key), file) for name, key in PAIR.items()}
    first, second = (one.cameras["camera"] for one in each.values())
    pose = _cam2_from_cam1(section)
    return Calibration(
        {"camera1": first, "camera2": second.at(pose.inv())},
        file.path,
        "MATLAB stereoParameters",
        notes=tuple(dict.fromkeys(note for one in each.values() for note in one.notes)),
        redundant=tuple(check for one in each.values() for check in one.redundant),
    )


def _cam2_from_cam1(section: Section) -> RigidTransform:
    """MATLAB multiplies rows: x2 = x1 RotationOfCamera2 + TranslationOfCamera2, in the unit of the boards' points."""
    unit = METRES[section.section(PAIR["camera1"]).choice("WorldUnits", tuple(METRES))]
    translation = section.vector("TranslationOfCamera2", [3], "x y z")
    return RigidTransform.from_components(np.multiply(unit, translation), section.rotation("RotationOfCamera2").inv())


def _alone(section: Section, file: File) -> Calibration:
    """One camera at the origin. Pixels count from 1, and IntrinsicMatrix is the transpose of K."""
    held = section.size("ImageSize", "height width") if section.values.get("ImageSize") else None
    grid = _intrinsics(section, agreed_size(held, file.size, "ImageSize"))
    radial = section.coefficients(RADIAL, [2, 3], "k1 k2 k3") if RADIAL in section else [0.0, 0.0]
    p1, p2 = section.coefficients(TANGENTIAL, [2], "p1 p2") if TANGENTIAL in section else (0.0, 0.0)
    with explained(section.where(RADIAL)):
        lens = BrownConrady(radial[0], radial[1], p1, p2, *radial[2:])
    notes = []
    if section.values.get("RotationVectors"):
        notes.append("The board poses (RotationVectors, TranslationVectors) are not read.")
    redundant = tuple(_redundant(section))
    return Calibration({"camera": Camera(grid, lens)}, file.path, TITLE, notes=tuple(notes), redundant=redundant)


def _intrinsics(section: Section, size: Size) -> Intrinsics:
    if "FocalLength" in section and "IntrinsicMatrix" not in section and "K" not in section:
        fx, fy = section.vector("FocalLength", [2], "fx fy")
        cx, cy = section.vector("PrincipalPoint", [2], "cx cy")
        skew = section.number("Skew") if "Skew" in section else 0.0
        refuse_focal_lengths(fx, fy, section.where("FocalLength"))
    else:
        key = "IntrinsicMatrix" if "IntrinsicMatrix" in section else "K"
        matrix, where = section.matrix(key, 3, 3), section.where(key)
        if key == "IntrinsicMatrix":
            matrix, where = matrix.T, f"{where} transposed"
        K = section.intrinsics(matrix, where, size)
        fx, fy, cx, cy, skew = K.fx, K.fy, K.cx, K.cy, K.skew
    with explained(section.path or "the intrinsics"):
        return Intrinsics(*size, fx, fy, cx - FIRST_PIXEL, cy - FIRST_PIXEL, skew)


def _redundant(section: Section) -> Iterator[Redundancy]:
    """The camera matrix beside its transpose, and beside the focal lengths and the principal point."""
    matrices = {key: section.matrix(key, 3, 3) for key in ("IntrinsicMatrix", "K") if key in section}
    if "IntrinsicMatrix" in matrices:
        matrices["IntrinsicMatrix"] = matrices["IntrinsicMatrix"].T
    if len(matrices) == 2:
        yield compared(section.where("IntrinsicMatrix"), "K", lambda a, b: {"px": (a - b)[:2]}, *matrices.values())
    if matrices and "FocalLength" in section and "PrincipalPoint" in section:
        key, matrix = next(iter(matrices.items()))
        values = [section.vector("FocalLength", [2], "fx fy"), section.vector("PrincipalPoint", [2], "cx cy")]
        yield compared(section.where(key), "FocalLength and PrincipalPoint", _grid_apart, matrix, *values)


def _grid_apart(matrix: Array, focal_lengths: Array, centre: Array) -> dict[str, Array]:
    return {"px": matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - np.concatenate([focal_lengths, centre])}


def write(calibration: Calibration) -> bytes:
    """What cameraParameters(jsondecode(fileread(path))) takes."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    fx, fy, cx, cy, skew, k1, k2, p1, p2, k3 = model.values(same, FIRST_PIXEL)
    tree: dict[str, Any] = {
        RADIAL: [k1, k2] + [k3] * (k3 != 0),
        TANGENTIAL: [p1, p2],
        "ImageSize": [camera.intrinsics.height, camera.intrinsics.width],
        "NumRadialDistortionCoefficients": 3 if k3 else 2,
        "EstimateTangentialDistortion": bool(p1 or p2),
        "EstimateSkew": skew != 0,
        "IntrinsicMatrix": [[fx, 0.0, 0.0], [skew, fy, 0.0], [cx, cy, 1.0]],
    }
    return as_json(tree)


FORMAT = Format(
    name="matlab",
    title=TITLE,
    file="camera.json",
    recognise=lambda file: is_parameters(file.section),
    read=read,
    write=write,
    most_cameras=1,
    models="k1 k2 k3, p1 p2, skew",
    says="cameraIntrinsics too, and stereoParameters: x_2 = x_1 R + t, rows, in WorldUnits; first pixel's centre "
    "at (1, 1); IntrinsicMatrix is Kᵀ; ImageSize is height, width",
    lacks="more coefficients",
    rank=60,
)
