"""ROS CameraInfo: the file (camera_matrix …) and the message itself (K D R P, in ROS 2 k d r p)."""

from __future__ import annotations

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt, Lens
from camviz.lenses.base import Array
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, chosen, listed
from camviz_clinic.files.models import Model, expressed, models_of
from camviz_clinic.files.opencv import image_size
from camviz_clinic.files.output import as_matrix, as_yaml
from camviz_clinic.files.section import COUNT, Section, explained, without_zeros

TITLE = "ROS CameraInfo"
MATRIX, DISTORTION = ("camera_matrix", "K", "k"), ("distortion_coefficients", "D", "d")
RECTIFICATION, PROJECTION = ("rectification_matrix", "R", "r"), ("projection_matrix", "P", "p")
MODELS = models_of("ros")


def is_camera_info(file: File) -> bool:
    """True where there is a distortion model or a projection matrix, but for VOXL's OpenCV files with M and D."""
    section = file.section
    return ("distortion_model" in section and not ("M" in section or "M1" in section)) or "projection_matrix" in section


def read(file: File) -> Calibration:
    """One camera at the origin; where P tells of a stereo pair, a note gives the baseline."""
    section = file.section
    key, size = _key(section, MATRIX), image_size(section, file.size)
    grid = section.intrinsics(section.matrix(key, 3, 3), section.where(key), size)
    name = section.text("camera_name") if "camera_name" in section else "camera"
    return Calibration({name: Camera(grid, _lens(section))}, file.path, TITLE, notes=_notes(section))


def _lens(section: Section) -> Lens:
    model, key = chosen(section, "distortion_model", MODELS), _key(section, DISTORTION)
    names, values = model.names[4:], section.array(key).ravel()
    if values.size == len(names):
        values = np.array(section.vector(key, [len(names)], " ".join(names)))
    else:
        error = _wrong_count(section, key, model, values)
        if model.lens is KannalaBrandt or values.size not in (4, 5, 8, 12, 14):
            raise error
        section.mend(error)
    with explained(section.where(key)):
        return KannalaBrandt(*values) if model.lens is KannalaBrandt else BrownConrady.from_coefficients(values)


def _wrong_count(section: Section, key: str, model: Model, values: Array) -> CalibrationError:
    names, count = model.names[4:], values.size
    expected = f"{len(names)} numbers ({' '.join(names)}) for {model.name}"
    return section.error(key, expected, f"{count}", COUNT, count, _as_many(model, values))


def _as_many(model: Model, values: Array) -> str:
    """What gives a model as many coefficients as it has, in sentences."""
    others = [other.name for other in MODELS if len(other.names) == values.size + 4]
    if shorter := without_zeros(values, [len(model.names) - 4]):
        return f"{shorter} If all {values.size} count, write {others[0]}." if others else shorter
    if values.size == 4:
        brown = "" if model.name == "plumb_bob" else "write plumb_bob and "
        said = f"If they are k1 k2 p1 p2, {brown}add k3 = 0 as the fifth number. "
        return f"{said}If cv2.fisheye made them, write equidistant."
    if others:
        return f"Write {others[0]} as the name of the model."
    return (
        "Keep the camera in OpenCV's YAML, which has all of these terms, or solve again with 8 (rational_polynomial)."
    )


def _notes(section: Section) -> tuple[str, ...]:
    notes = []
    if any(name in section for name in RECTIFICATION):
        section.rotation(_key(section, RECTIFICATION))
    if any(name in section for name in PROJECTION):
        notes += stereo_note(section, _key(section, PROJECTION))
    if any(section.number(key) > 1 for key in ("binning_x", "binning_y") if key in section):
        notes.append("The camera was binned: K is for the full resolution, as ROS defines it.")
    return tuple(notes)


def stereo_note(section: Section, key: str) -> list[str]:
    """What the 3×4 matrix P under a key tells of the other camera of a pair; nothing where there is none."""
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
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    grid = same.intrinsics
    tree = {
        "image_width": grid.width,
        "image_height": grid.height,
        "camera_name": name,
        "camera_matrix": as_matrix(grid.K),
        "distortion_model": model.name,
        "distortion_coefficients": as_matrix(np.array([model.values(same, 0.0)[4:]])),
        "rectification_matrix": as_matrix(np.eye(3)),
        "projection_matrix": as_matrix(np.column_stack([grid.K, np.zeros(3)])),
    }
    return as_yaml(tree)


FORMAT = Format(
    name="ros",
    title=TITLE,
    file="camera.yaml",
    recognise=is_camera_info,
    read=read,
    write=write,
    most_cameras=1,
    models=listed(MODELS),
    says="file or message; P[0,3] = −fx B, read as a note",
    lacks="skew",
    rank=70,
)
