"""MATLAB's cameraParameters or cameraIntrinsics: toStruct(params), saved or written by jsonencode."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from camviz.calibration.types import Calibration, CalibrationError
from camviz.cameras import Camera, Intrinsics
from camviz.files import matlab_binary
from camviz.files.models import expressed, models_of
from camviz.files.output import as_json, only_camera, refuse_own_world
from camviz.files.section import BAD_K, Section, explained
from camviz.files.sizes import agreed_size, pair_of_sides
from camviz.files.trees import shown
from camviz.lenses import BrownConrady

FIRST_PIXEL = 1.0
MODELS = models_of("matlab")
RADIAL, TANGENTIAL = "RadialDistortion", "TangentialDistortion"


def is_parameters(section: Section) -> bool:
    return RADIAL in section or "IntrinsicMatrix" in section or "FocalLength" in section


def read_binary(
    content: bytes, path: Path, size: tuple[int, int] | None, mended: list[CalibrationError] | None
) -> Calibration:
    """From a .mat file: the one variable that holds parameters, or the variables that are them."""
    variables = matlab_binary.parse(content)
    held = [Section(each, name, mended) for name, each in variables.items() if isinstance(each, dict)]
    found = [section for section in [Section(variables, mended=mended), *held] if is_parameters(section)]
    if len(found) != 1:
        names = ", ".join(shown(name) for name in list(variables)[:6]) or "nothing"
        raise CalibrationError(
            f"expected one struct with {RADIAL}, IntrinsicMatrix or FocalLength, got {len(found)} among {names}; "
            f"{matlab_binary.HOW}"
        )
    return read(found[0], path, size)


def read(section: Section, path: Path, size: tuple[int, int] | None) -> Calibration:
    """One camera at the origin. Pixels count from 1, and IntrinsicMatrix is the transpose of K."""
    held = pair_of_sides(section, "ImageSize", "height width") if section.values.get("ImageSize") else None
    grid = _intrinsics(section, *agreed_size(held, size, "ImageSize"))
    radial = section.coefficients(RADIAL, [2, 3], "k1 k2 k3") if RADIAL in section else [0.0, 0.0]
    p1, p2 = section.coefficients(TANGENTIAL, [2], "p1 p2") if TANGENTIAL in section else (0.0, 0.0)
    with explained(section.where(RADIAL)):
        lens = BrownConrady(radial[0], radial[1], p1, p2, *radial[2:])
    notes = []
    if section.values.get("RotationVectors"):
        notes.append("The board poses (RotationVectors, TranslationVectors) are not read.")
    return Calibration({"camera": Camera(grid, lens)}, path, "MATLAB cameraParameters", notes=tuple(notes))


def _intrinsics(section: Section, width: int, height: int) -> Intrinsics:
    if "FocalLength" in section and "IntrinsicMatrix" not in section and "K" not in section:
        fx, fy = section.vector("FocalLength", [2], "fx fy")
        cx, cy = section.vector("PrincipalPoint", [2], "cx cy")
        skew = section.number("Skew") if "Skew" in section else 0.0
    else:
        key = "IntrinsicMatrix" if "IntrinsicMatrix" in section else "K"
        matrix = section.matrix(key, 3, 3)
        where = section.where(key) + (" transposed" if key == "IntrinsicMatrix" else "")
        with explained(where, BAD_K):
            matrix = section.camera_matrix(matrix.T if key == "IntrinsicMatrix" else matrix, where)
            K = Intrinsics.from_matrix(matrix, width, height)
        fx, fy, cx, cy, skew = K.fx, K.fy, K.cx, K.cy, K.skew
    with explained(section.path or "the intrinsics"):
        return Intrinsics(width, height, fx, fy, cx - FIRST_PIXEL, cy - FIRST_PIXEL, skew)


def write(calibration: Calibration) -> bytes:
    """What cameraParameters(jsondecode(fileread(path))) takes."""
    title = "MATLAB's cameraParameters"
    name, camera = only_camera(calibration, title)
    refuse_own_world(calibration, title)
    model, same = expressed(name, camera, MODELS, title)
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
