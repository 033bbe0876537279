"""ROS CameraInfo: the file (camera_matrix …), of a pair two, and the message itself (K D R P, in ROS 2 k d r p)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt, Lens
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.rectification import Rectification
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import Content, File, Format, chosen, listed
from camviz_clinic.files.models import Model, expressed
from camviz_clinic.files.opencv import image_size
from camviz_clinic.files.output import as_matrix, as_yaml
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import COUNT, Section, as_rotation, explained, named, without_zeros

TITLE = "ROS CameraInfo"
MATRIX, DISTORTION = ("camera_matrix", "K", "k"), ("distortion_coefficients", "D", "d")
RECTIFICATION, PROJECTION = ("rectification_matrix", "R", "r"), ("projection_matrix", "P", "p")
MODELS = LAYOUTS["ros"]


def is_camera_info(file: File) -> bool:
    """True where there is a distortion model or a projection matrix, but for VOXL's OpenCV files with M and D.

    A folder is a pair where it has two such files and no other YAML.
    """
    if file.path.is_dir():
        return len(_files(file)) == 2 and all(is_camera_info(each) for each in _files(file))
    section = file.section
    return ("distortion_model" in section and not ("M" in section or "M1" in section)) or "projection_matrix" in section


def _files(folder: File) -> list[File]:
    return [replace(folder, path=path) for path in sorted(folder.path.iterdir()) if path.suffix in (".yaml", ".yml")]


def read(file: File) -> Calibration:
    """One camera at the origin, where P tells of a stereo pair with a note of its baseline; of a folder the pair."""
    if file.path.is_dir():
        return _read_pair(file)
    calibration, section = _read_one(file), file.section
    note = stereo_note(section, _key(section, PROJECTION)) if any(name in section for name in PROJECTION) else []
    return replace(calibration, notes=(*note, *calibration.notes))


def _read_one(file: File) -> Calibration:
    section = file.section
    key, size = _key(section, MATRIX), image_size(section, file.size)
    camera = Camera(section.intrinsics(section.matrix(key, 3, 3), section.where(key), size), _lens(section))
    name = section.text("camera_name") if "camera_name" in section else "camera"
    rectifications = rectification(section, name, camera, RECTIFICATION, PROJECTION)
    return Calibration({name: camera}, file.path, TITLE, notes=_notes(section), rectifications=rectifications)


def _read_pair(folder: File) -> Calibration:
    cameras = []
    for file in _files(folder):
        with named(file.path.name):
            cameras.append(_read_one(file))
    return pair_of(cameras[0], cameras[1], folder.path)


def rectification(
    section: Section, name: str, camera: Camera, rotation: tuple[str, ...], projection: tuple[str, ...]
) -> dict[str, Rectification]:
    """R and P of a file by the camera's name; none where they say nothing beside K: R = 1, P = [K 0]."""
    R, P = plain = _plain(camera)
    if any(key in section for key in rotation):
        section.rotation(_key(section, rotation))
        R = section.matrix(_key(section, rotation), 3, 3)
    if any(key in section for key in projection):
        P = section.matrix(_key(section, projection), 3, 4)
    return {} if np.array_equal(R, plain.R) and np.array_equal(P, plain.P) else {name: Rectification(R, P)}


def _plain(camera: Camera) -> Rectification:
    return Rectification(np.eye(3), np.column_stack([camera.intrinsics.K, np.zeros(3)]))


def pair_of(one: Calibration, other: Calibration, source: Path) -> Calibration:
    """The pair whose cameras two calibrations are, from their R and P; the left one's frame is the world.

    R_right x_right = R_left x_left + (P_right[0, 3] / fx, 0, 0), both sides being the rectified frame.

    Args:
        one, other: What `read` makes of the files of one camera each, in any order.
        source: What the pair was read from.

    Returns: The left camera, whose P[0, 3] is 0, and then the right one.
    Raises: CalibrationError where not exactly one of them has a baseline in P[0, 3].
    """
    left, right = sorted((one, other), key=lambda each: _matrices(each).P[0, 3] != 0)
    held = [_matrices(each) for each in (left, right)]
    (R1, P1), (R2, P2) = held
    if P1[0, 3] != 0 or not (P2[0, 3] != 0 and P2[0, 0] > 0):
        found = f"{P1[0, 3]:g} and {P2[0, 3]:g}"
        raise CalibrationError(f"expected P[0, 3] = 0 for the left camera and -fx B for the right one, got {found}")
    shift = RigidTransform.from_translation([P2[0, 3] / P2[0, 0], 0, 0])
    to_rectified = [RigidTransform.from_rotation(as_rotation(R, "R")) for R in (R1, R2)]
    right_from_left = to_rectified[1].inv() * shift * to_rectified[0]
    names = [*left.cameras, *right.cameras]
    if names[0] == names[1]:
        names = [left.source.stem, right.source.stem]
    first, second = (camera for each in (left, right) for camera in each.cameras.values())
    cameras = dict(zip(names, (first, second.at(right_from_left.inv())), strict=True))
    matrices, notes = dict(zip(names, held, strict=True)), (*left.notes, *right.notes)
    return Calibration(cameras, source, f"{TITLE}, stereo", notes=notes, rectifications=matrices)


def _matrices(calibration: Calibration) -> Rectification:
    """R and P of the one camera."""
    ((name, camera),) = calibration.cameras.items()
    return calibration.rectifications.get(name, _plain(camera))


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


def write(calibration: Calibration) -> Content:
    """The file of camera_calibration_parsers for one camera; of a pair the files of a folder, by the cameras' names.

    R and P are the calibration's own, or of a pair OpenCV's, or of a camera alone R = 1 and P = [K 0].
    """
    if len(calibration.cameras) == 1:
        return write_one(calibration)
    cameras, matrices = calibration.cameras, calibration.rectifications
    if set(matrices) != set(cameras):
        matrices = rectified(calibration)
    names = {name: re.sub(r"[^\w.-]", "_", name) + ".yaml" for name in cameras}
    if len(set(names.values())) < len(cameras):
        raise CalibrationError(f"{TITLE}: {' and '.join(cameras)} would have one file name: rename one of them")
    return {names[name]: _written(name, camera, matrices[name]) for name, camera in cameras.items()}


def write_one(calibration: Calibration) -> bytes:
    """The file of one camera."""
    ((name, camera),) = calibration.cameras.items()
    return _written(name, camera, _matrices(calibration))


def rectified(calibration: Calibration) -> Mapping[str, Rectification]:
    """R and P of a pair's cameras by cv2.stereoRectify, or that of cv2.fisheye, as ROS's cameracalibrator makes them.

    Both pictures are without black borders and have their principal points in one place (CALIB_ZERO_DISPARITY).

    Args:
        calibration: Of two cameras side by side, in any order.

    Returns: By the cameras' names; P[0, 3] is 0 for the left camera, and -fx B in pixels times metres for the right.
    Raises: CalibrationError for a pair that ROS cannot rectify, with the reason.
    """
    names = list(calibration.cameras)
    to_other = calibration.rig.a_from_b(names[1], names[0])
    half = Rotation.from_rotvec(to_other.rotation.as_rotvec() / 2)
    x, y, z = half.inv().apply(to_other.translation)  # from the second camera to the first
    if not abs(x) > max(abs(y), 1e-12):
        place = "one above the other" if abs(y) > 1e-12 else "in the same place" if abs(z) < 1e-12 else "in line"
        raise CalibrationError(f"{TITLE} rectifies cameras side by side, {names[0]} and {names[1]} stand {place}")
    if x > 0:  # the second one is the left one
        names.reverse()
    cameras = [calibration.cameras[name] for name in names]
    sizes = [(camera.intrinsics.width, camera.intrinsics.height) for camera in cameras]
    held = [expressed(name, camera, MODELS, TITLE) for name, camera in zip(names, cameras, strict=True)]
    fisheyes = [model.lens is KannalaBrandt for model, _ in held]
    if sizes[0] != sizes[1] or fisheyes[0] != fisheyes[1]:
        what = "image sizes" if sizes[0] != sizes[1] else "kinds of lens, one a fisheye"
        raise CalibrationError(f"{TITLE} rectifies a pair of one kind, {names[0]} and {names[1]} have different {what}")
    pinholes = [(same.intrinsics.K, np.array(model.values(same, 0.0)[4:])) for model, same in held]
    right_from_left = calibration.rig.a_from_b(names[1], names[0])
    pose = right_from_left.rotation.as_matrix(), np.reshape(right_from_left.translation, (3, 1))
    zero = cv2.CALIB_ZERO_DISPARITY
    found: tuple[Any, ...]
    if fisheyes[0]:
        found = cv2.fisheye.stereoRectify(*pinholes[0], *pinholes[1], sizes[0], *pose, zero)
    else:
        found = cv2.stereoRectify(*pinholes[0], *pinholes[1], sizes[0], *pose, flags=zero, alpha=0)
    R1, R2, P1, P2 = found[:4]
    if not (np.isfinite(P2).all() and P2[0, 0] > 0):
        raise CalibrationError(f"{TITLE}: OpenCV finds no rectified picture of {names[0]} and {names[1]}")
    return dict(zip(names, (Rectification(R1, P1), Rectification(R2, P2)), strict=True))


def _written(name: str, camera: Camera, matrices: Rectification) -> bytes:
    model, same = expressed(name, camera, MODELS, TITLE)
    grid = same.intrinsics
    tree = {
        "image_width": grid.width,
        "image_height": grid.height,
        "camera_name": name,
        "camera_matrix": as_matrix(grid.K),
        "distortion_model": model.name,
        "distortion_coefficients": as_matrix(np.array([model.values(same, 0.0)[4:]])),
        "rectification_matrix": as_matrix(matrices.R),
        "projection_matrix": as_matrix(matrices.P),
    }
    return as_yaml(tree)


FORMAT = Format(
    name="ros",
    title=TITLE,
    file="camera.yaml",
    recognise=is_camera_info,
    read=read,
    write=write,
    most_cameras=2,
    folder_from=2,
    rectifies=True,
    models=listed(MODELS),
    says="file or message; a pair is a folder of two files with stereoRectify's R and P, P[0,3] = −fx B; in one file "
    "alone this is read as a note",
    lacks="skew",
    rank=70,
)
