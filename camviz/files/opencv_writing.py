"""Writing OpenCV FileStorage: one camera with its views, or a pair; as .yml, .xml or .json, by OpenCV itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.files.calibration import Calibration, CalibrationError
from camviz.files.models import Model, expressed
from camviz.files.output import refuse_own_world
from camviz.lenses import BrownConrady, KannalaBrandt, UnifiedSphere

GRID = "fx fy cx cy"
RADIAL = "k1 k2 p1 p2 k3"
RATIONAL = f"{RADIAL} k4 k5 k6"
PRISM = f"{RATIONAL} s1 s2 s3 s4"
MODELS = [
    Model("distortion_coefficients", BrownConrady, f"{GRID} {RADIAL}"),
    Model("distortion_coefficients", BrownConrady, f"{GRID} {RATIONAL}"),
    Model("distortion_coefficients", BrownConrady, f"{GRID} {PRISM}"),
    Model("distortion_coefficients", BrownConrady, f"{GRID} {PRISM} tau_x tau_y"),
    Model("cv2.fisheye", KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    Model("cv2.omnidir", UnifiedSphere, f"{GRID} skew k1 k2 p1 p2 xi"),
]
TITLE = "OpenCV FileStorage"


def write(calibration: Calibration, path: Path) -> bytes:
    """In the form that the path's ending asks for, YAML where it asks for none."""
    refuse_own_world(calibration, TITLE)
    count = len(calibration.cameras)
    if count > 2:
        raise CalibrationError(
            f"{TITLE} holds one camera or a pair, this calibration has {count}: choose one (--camera NAME)"
        )
    values = _pair(calibration) if count == 2 else _one(calibration)
    return _stored(values, path.suffix.lower())


def _one(calibration: Calibration) -> dict[str, Any]:
    ((name, camera),) = calibration.cameras.items()
    values = _size(camera) | ({"camera_name": name} if name != "camera" else {})
    return values | _camera(name, camera, "camera_matrix", "distortion_coefficients", "") | _views(calibration, name)


def _pair(calibration: Calibration) -> dict[str, Any]:
    (left_name, left), (right_name, right) = calibration.cameras.items()
    if _size(left) != _size(right):
        raise CalibrationError(f"{TITLE} holds one image size for a pair, and {left_name} and {right_name} differ")
    first, second = _camera(left_name, left, "M1", "D1", "1"), _camera(right_name, right, "M2", "D2", "2")
    if ("fisheye_model" in first) != ("fisheye_model" in second):
        raise CalibrationError(
            f"{TITLE} holds a pair of one kind, and only one of {left_name}, {right_name} is a fisheye"
        )
    pose = right.cam_from_world
    return _size(left) | first | second | {"R": pose.rotation.as_matrix(), "T": np.reshape(pose.translation, (3, 1))}


def _size(camera: Camera) -> dict[str, Any]:
    return {"image_width": camera.intrinsics.width, "image_height": camera.intrinsics.height}


def _camera(name: str, camera: Camera, matrix: str, distortion: str, tag: str) -> dict[str, Any]:
    model, same = expressed(name, camera, MODELS, TITLE)
    coefficients = dict(zip(model.names, model.values(same, 0.0), strict=True))
    for key in ("fx", "fy", "cx", "cy", "skew"):
        coefficients.pop(key, None)
    extra: dict[str, Any] = {"fisheye_model": 1} if isinstance(same.lens, KannalaBrandt) else {}
    if "xi" in coefficients:
        extra[f"xi{tag}"] = coefficients.pop("xi")
    return {matrix: same.intrinsics.K, distortion: np.array([list(coefficients.values())]), **extra}


def _views(calibration: Calibration, name: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    if board := calibration.board:
        values |= {"board_width": board.columns, "board_height": board.rows, "square_size": float(board.square_size)}
    if name in calibration.detections:
        values["image_points"] = np.ascontiguousarray(calibration.detections[name])
    if name in calibration.cam_from_board:
        poses = calibration.cam_from_board[name]
        vectors = np.column_stack([np.atleast_2d(poses.rotation.as_rotvec()), np.atleast_2d(poses.translation)])
        values["extrinsic_parameters"] = np.ascontiguousarray(vectors)
    if name in calibration.per_view_errors:
        values["per_view_reprojection_errors"] = np.reshape(calibration.per_view_errors[name], (-1, 1))
    return values


def _stored(values: dict[str, Any], suffix: str) -> bytes:
    import cv2

    ending = suffix if suffix in (".xml", ".json") else ".yml"
    storage = cv2.FileStorage(f"calibration{ending}", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for key, value in values.items():
        storage.write(key, value)
    return str(storage.releaseAndGetString()).encode()
