"""ROS CameraInfo: the file (camera_matrix …) and the message itself (K D R P, in ROS 2 k d r p)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from camviz.calibration.types import Calibration, CalibrationError
from camviz.cameras import Camera
from camviz.files.models import expressed, models_of
from camviz.files.opencv import image_size, intrinsics
from camviz.files.output import as_yaml, only_camera, refuse_own_world
from camviz.files.section import COUNT, Section, explained
from camviz.files.trees import shown
from camviz.lenses import BrownConrady, KannalaBrandt, Lens

COUNTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}  # sensor_msgs/distortion_models.hpp
MEANINGS = {
    "plumb_bob": "k1 k2 p1 p2 k3",
    "rational_polynomial": "k1 k2 p1 p2 k3 k4 k5 k6",
    "equidistant": "k1 k2 k3 k4",
}
MATRIX, DISTORTION = ("camera_matrix", "K", "k"), ("distortion_coefficients", "D", "d")
RECTIFICATION, PROJECTION = ("rectification_matrix", "R", "r"), ("projection_matrix", "P", "p")
WRITTEN = models_of("ros")


def read(section: Section, path: Path, size: tuple[int, int] | None) -> Calibration:
    """One camera at the origin; where P tells of a stereo pair, a note gives the baseline."""
    width, height = image_size(section, size)
    camera = Camera(intrinsics(section, _key(section, MATRIX), width, height), _lens(section))
    name = section.text("camera_name") if "camera_name" in section else "camera"
    return Calibration({name: camera}, path, "ROS CameraInfo", notes=_notes(section))


def _lens(section: Section) -> Lens:
    model, key = section.text("distortion_model"), _key(section, DISTORTION)
    if model not in COUNTS:
        raise section.error("distortion_model", " or ".join(COUNTS), shown(model))
    count, values = section.array(key).size, section.array(key).ravel()
    if count != COUNTS[model]:
        fitting = [f"; {count} belong to {other}" for other in COUNTS if COUNTS[other] == count]
        expected = f"{COUNTS[model]} numbers ({MEANINGS[model]}) for {model}"
        error = section.error(key, expected, f"{count}{''.join(fitting)}", COUNT, count)
        if model == "equidistant" or count not in (4, 5, 8):
            raise error
        section.mend(error)
    else:
        values = np.array(section.vector(key, [COUNTS[model]], MEANINGS[model]))
    with explained(section.where(key)):
        return KannalaBrandt(*values) if model == "equidistant" else BrownConrady.from_coefficients(values)


def _notes(section: Section) -> tuple[str, ...]:
    notes = []
    if any(name in section for name in RECTIFICATION):
        section.rotation(_key(section, RECTIFICATION))
    if any(name in section for name in PROJECTION):
        notes += _stereo_note(section, _key(section, PROJECTION))
    if any(section.number(key) > 1 for key in ("binning_x", "binning_y") if key in section):
        notes.append("The camera was binned: K is for the full resolution, as ROS defines it.")
    return tuple(notes)


def _stereo_note(section: Section, key: str) -> list[str]:
    P = section.matrix(key, 3, 4)
    if P[0, 3] == 0:
        return []
    if P[0, 0] <= 0:
        raise CalibrationError(f"{section.where(key)}[0, 0]: expected a positive focal length, got {P[0, 0]:g}")
    baseline = -P[0, 3] / P[0, 0]  # P[0, 3] = -fx B
    if baseline < 0 and section.mended is not None:  # read by all the same, and never refused
        text = f"{section.where(key)}[0, 3]: expected -fx B, which is negative in the right camera, got {P[0, 3]:g}"
        section.mended.append(CalibrationError(text, "baseline-sign", baseline))
    return [
        f"This is one camera of a rectified pair, {baseline:.4g} m to the right of the other (P[0, 3] = -fx B); "
        "the other one is in a file of its own, so this one stands at the origin."
    ]


def _key(section: Section, names: tuple[str, ...]) -> str:
    found = [name for name in names if name in section]
    if len(found) > 1:
        raise CalibrationError(f"expected one of the keys {' and '.join(found)}, got both")
    return found[0] if found else names[0]


# Writing.


def write(calibration: Calibration) -> bytes:
    """The file of camera_calibration_parsers, for one camera that is not rectified: R = 1, P = [K 0]."""
    name, camera = only_camera(calibration, "ROS CameraInfo")
    refuse_own_world(calibration, "ROS CameraInfo")
    model, same = expressed(name, camera, WRITTEN, "ROS CameraInfo")
    grid = same.intrinsics
    tree = {
        "image_width": grid.width,
        "image_height": grid.height,
        "camera_name": name,
        "camera_matrix": _matrix(grid.K),
        "distortion_model": model.name,
        "distortion_coefficients": _matrix(np.array([model.values(same, 0.0)[4:]])),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(np.column_stack([grid.K, np.zeros(3)])),
    }
    return as_yaml(tree)


def _matrix(values: np.ndarray) -> dict[str, Any]:
    return {"rows": values.shape[0], "cols": values.shape[1], "data": [float(x) for x in values.ravel()]}
