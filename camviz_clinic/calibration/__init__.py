"""Calibration: boards found in pictures (`detect`), and the camera or the pair that saw them (`calibrate`).

The names below are imported when they are first used, because the processes that look for boards need few of them.
"""

from importlib import import_module
from typing import Any

_HOME = {
    "Board": "types",
    "Calibration": "types",
    "CalibrationError": "types",
    "CannotCalibrate": "detection",
    "Detections": "detection",
    "detect": "detection",
    "detect_pair": "detection",
    "find_corners": "finding",
    "MODELS": "camera_models",
    "calibrate": "solving",
    "calibrate_pair": "solving",
}

__all__ = [
    "MODELS",
    "Board",
    "Calibration",
    "CalibrationError",
    "CannotCalibrate",
    "Detections",
    "calibrate",
    "calibrate_pair",
    "detect",
    "detect_pair",
    "find_corners",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'camviz_clinic.calibration' has no attribute {name!r}")
    return getattr(import_module(f"camviz_clinic.calibration.{_HOME[name]}"), name)
