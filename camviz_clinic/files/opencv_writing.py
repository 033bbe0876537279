"""Writing OpenCV FileStorage: one camera with its views, or a pair; as .yml, .xml or .json, by OpenCV itself."""

from __future__ import annotations

import re
from dataclasses import astuple
from typing import Any
from urllib.parse import quote

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import KannalaBrandt, Perspective
from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.models import expressed
from camviz_clinic.files.parameter_layouts import LAYOUTS

GUESSED = ("chessboard", "charuco")  # kinds of boards that the reader knows by their markers
MODELS = LAYOUTS["opencv"]
NO_STAMP = Stamp()
TITLE = "OpenCV FileStorage"
UNDISTORTED = "undistorted"  # 1 in the file of pinholes, whose zeros are no forgotten coefficients


def write(calibration: Calibration, ending: str) -> bytes:
    """In the form that the ending asks for, YAML where it asks for none."""
    values = _pair(calibration) if len(calibration.cameras) == 2 else _one(calibration)
    if all(isinstance(camera.lens, Perspective) for camera in calibration.cameras.values()):
        values[UNDISTORTED] = 1
    return _stored(values, ending)


def _one(calibration: Calibration) -> dict[str, Any]:
    ((name, camera),) = calibration.cameras.items()
    values = _size(camera) | ({"camera_name": name} if name != "camera" else {})
    values |= _camera(name, camera, "camera_matrix", "distortion_coefficients", "")
    return values | _recorded(calibration) | _views(calibration, name, "")


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
    values = _size(left) | first | second | {"R": pose.rotation.as_matrix(), "T": np.reshape(pose.translation, (3, 1))}
    return values | _recorded(calibration) | _views(calibration, left_name, "1") | _views(calibration, right_name, "2")


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


def _recorded(calibration: Calibration) -> dict[str, Any]:
    """What belongs to no single camera."""
    values: dict[str, Any] = {}
    if board := calibration.board:
        values |= {"board_width": board.columns, "board_height": board.rows, "square_size": float(board.square_size)}
        if board.marker_size is not None:
            values["marker_size"] = float(board.marker_size)
        if board.dictionary is not None:
            values["marker_dictionary"] = board.dictionary
        if board.legacy:
            values["marker_legacy"] = 1
        if board.first_id:
            values["marker_first_id"] = board.first_id
        if board.border_bits != 1:
            values["marker_border_bits"] = board.border_bits
        if board.kind not in GUESSED:
            values["board_kind"] = board.kind
    if calibration.board_warp is not None:
        values["board_warp"] = np.reshape(calibration.board_warp, (1, 2))
    if calibration.board_warp_covariance is not None:
        values["board_warp_covariance"] = np.ascontiguousarray(calibration.board_warp_covariance)
    if calibration.skipped:
        values["skipped_pictures"] = [word for picture_and_why in calibration.skipped for word in picture_and_why]
    return values | ({"notes": list(calibration.notes)} if calibration.notes else {})


def _views(calibration: Calibration, name: str, tag: str) -> dict[str, Any]:
    """What was recorded of one camera, under keys that end in its tag."""
    values: dict[str, Any] = {}
    if name in calibration.pictures:
        values["picture_names"] = list(calibration.pictures[name])
    if name in calibration.per_view_errors:
        values["per_view_reprojection_errors"] = np.reshape(calibration.per_view_errors[name], (-1, 1))
    if name in calibration.cam_from_board:
        poses = calibration.cam_from_board[name]
        vectors = np.column_stack([np.atleast_2d(poses.rotation.as_rotvec()), np.atleast_2d(poses.translation)])
        values["extrinsic_parameters"] = np.ascontiguousarray(vectors)
    if name in calibration.estimated:
        values["estimated_parameters"] = list(calibration.estimated[name])
    if name in calibration.intrinsics_covariance:
        values["intrinsics_covariance"] = np.ascontiguousarray(calibration.intrinsics_covariance[name])
    if name in calibration.priors:
        values["denominator_prior"] = np.array([astuple(calibration.priors[name])])
    if name in calibration.detections:
        values["image_points"] = np.ascontiguousarray(calibration.detections[name])
    if name in calibration.set_aside:
        values["set_aside"] = np.ascontiguousarray(calibration.set_aside[name], dtype=np.uint8)
    if delay := calibration.line_delays.get(name):
        values["line_delay"] = delay.seconds
        if delay.sigma is not None:
            values["line_delay_sigma"] = delay.sigma
    if stamp := calibration.stamps.get(name, NO_STAMP).known():
        values["stamp"] = stamp
    return {f"{key}{tag}": value for key, value in values.items()}


def _stored(values: dict[str, Any], ending: str) -> bytes:
    import cv2

    ending = ending if ending in (".xml", ".json") else ".yml"
    storage = cv2.FileStorage(f"calibration{ending}", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for key, value in values.items():
        if isinstance(value, dict):
            storage.startWriteStruct(key, cv2.FileNode_MAP)
            for name, held in value.items():
                _store(storage, name, _escaped(held) if isinstance(held, str) else held)
            storage.endWriteStruct()
        else:
            _store(storage, key, value)
    return str(storage.releaseAndGetString()).encode()


def _store(storage: Any, key: str, value: Any) -> None:
    """A word, a number or a matrix, or a list of numbers or words, of which only those of a list are escaped here."""
    import cv2

    if isinstance(value, list):
        storage.startWriteStruct(key, cv2.FileNode_SEQ)
        for each in value:
            storage.write("", _escaped(each) if isinstance(each, str) else each)
        storage.endWriteStruct()
    else:
        storage.write(key, value)


def _escaped(word: str) -> str:
    """With %XX for characters of which FileStorage makes invalid YAML, and for words that it would not keep as such."""
    if word.lower() in ("", "true", "false", "null", "~", "nan", "inf"):
        return "".join(f"%{byte:02X}" for byte in word.encode())
    return re.sub(r"[^\w ./,:;()×-]", lambda found: quote(found[0], safe=""), word)
