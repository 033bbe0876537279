"""transforms.json of nerfstudio and instant-ngp: images placed in the world, in OpenGL's axes."""

from __future__ import annotations

from collections.abc import Iterator
from math import tan
from typing import Any

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt, Lens, Perspective
from camviz.lenses.base import Array
from camviz.poses import OPENGL
from camviz_clinic.calibration.redundancy import Redundancy, compared
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import expressed
from camviz_clinic.files.output import as_json, as_rows
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size, explained, refuse_focal_lengths
from camviz_clinic.files.trees import shown

TITLE = "transforms.json"
FIRST_PIXEL = 0.5
MODELS = LAYOUTS["nerfstudio"]
STRAIGHT = ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
KEYS = {"fx": "fl_x", "fy": "fl_y"}
GRID_KEYS = ("w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_x", "camera_angle_y")
LENS_KEYS = ("camera_model", "is_fisheye", "k1", "k2", "k3", "k4", "p1", "p2")


def is_transforms(file: File) -> bool:
    """True for a file of frames, or of one camera under nerfstudio's keys."""
    return any(key in file.section for key in ("fl_x", "camera_angle_x", "frames"))


def read(file: File) -> Calibration:
    """Every frame as a camera in the file's world; without frames one camera at the origin."""
    section, shared = file.section, None
    cameras: dict[str, Camera] = {}
    redundant: list[Redundancy] = []
    for name, frame in _frames(section):
        if any(key in frame for key in GRID_KEYS + LENS_KEYS):
            camera = _camera(section.part({**section.values, **frame.values}, frame.path), file.size)
            redundant += _angles(frame, camera)
        else:
            camera = shared = shared or _camera(section, file.size)
        if name in cameras:
            raise frame.error("file_path", "images of different names", f"{shown(name)} twice")
        cameras[name] = camera.at(frame.transform("transform_matrix") * OPENGL)
    notes = ("The world has no unit of its own: lengths are in the file's.",) if cameras else ()
    if shared or not cameras:
        alone = shared or _camera(section, file.size)
        cameras = cameras or {"camera": alone}
        redundant = [*_angles(section, alone), *redundant]
    return Calibration(cameras, file.path, TITLE, notes=notes, redundant=tuple(redundant))


def _frames(section: Section) -> list[tuple[str, Section]]:
    frames = section.sections("frames") if section.values.get("frames") else []
    return [
        (frame.text("file_path") if "file_path" in frame else f"frame{index}", frame)
        for index, frame in enumerate(frames)
    ]


def _camera(section: Section, given: Size | None) -> Camera:
    width, height = agreed_size(section.sides("w", "h"), given, "w, h")
    fx = _focal_length(section, "fl_x", "camera_angle_x", width)
    fy = _focal_length(section, "fl_y", "camera_angle_y", height, fx)
    cx, cy = (section.number(key) if key in section else side / 2 for key, side in (("cx", width), ("cy", height)))
    refuse_focal_lengths(fx, fy, section.path or "the intrinsics")
    with explained(section.path or "the intrinsics"):
        return Camera(Intrinsics(width, height, fx, fy, cx - FIRST_PIXEL, cy - FIRST_PIXEL), _lens(section))


def _focal_length(section: Section, key: str, angle: str, side: int, default: float | None = None) -> float:
    """f, or f = side / (2 tan(angle / 2)) from the angle of view."""
    if key in section or angle not in section:
        return default if default is not None and key not in section else section.number(key)
    view = section.number(angle)
    if not 0 < view < np.pi:
        raise section.error(angle, "an angle of view between 0 and π radians", f"{view:g}")
    return side / (2 * tan(view / 2))


def _angles(section: Section, camera: Camera) -> Iterator[Redundancy]:
    """The focal lengths beside the angles of view, from which f = side / (2 tan(angle / 2)) follows too."""
    grid = camera.intrinsics
    for key, angle, side in (("fl_x", "camera_angle_x", grid.width), ("fl_y", "camera_angle_y", grid.height)):
        focal, view = section.values.get(key), section.values.get(angle)
        if isinstance(focal, (int, float)) and isinstance(view, (int, float)) and 0 < view < np.pi:

            def apart(f: Array, view: Array, side: int = side) -> dict[str, Array]:
                return {"px": f - side / (2 * np.tan(view / 2))}

            yield compared(section.where(key), f"{angle} and the image size", apart, focal, view)


def _lens(section: Section) -> Lens:
    held = {key: section.number(key) for key in LENS_KEYS[2:] if section.values.get(key) is not None}
    name = section.text("camera_model") if "camera_model" in section else STRAIGHT[-1]
    if name == "OPENCV_FISHEYE" or section.values.get("is_fisheye") is True:
        return KannalaBrandt(**_without(section, held, "p1", "p2"))
    if name not in STRAIGHT:
        raise section.error("camera_model", f"{' or '.join(STRAIGHT)} or OPENCV_FISHEYE", shown(name))
    lens = BrownConrady(**_without(section, held, "k4"))
    return lens if held else Perspective()


def _without(section: Section, held: dict[str, float], *keys: str) -> dict[str, float]:
    """The coefficients, but for those that must be zero: k4 is of the eighth power here, which is not OpenCV's k4."""
    for key in keys:
        if held.get(key):
            raise section.error(key, "0, there is no lens here that has it beside the others", f"{held[key]:g}")
    return {key: value for key, value in held.items() if key not in keys}


def write(calibration: Calibration) -> bytes:
    """One set of intrinsics for all frames where they share it, otherwise one in each frame."""
    frames: list[dict[str, Any]] = []
    intrinsics = [_intrinsics(name, camera) for name, camera in calibration.cameras.items()]
    if all(isinstance(camera.lens, Perspective) for camera in calibration.cameras.values()):
        intrinsics = [_without_lens(each) for each in intrinsics]
    shared = intrinsics[0] if all(each == intrinsics[0] for each in intrinsics) else {}
    models = {each["camera_model"] for each in intrinsics}
    if len(models) > 1:
        raise CalibrationError(f"transforms.json holds one camera model for all, these cameras need {sorted(models)}")
    for (name, camera), own in zip(calibration.cameras.items(), intrinsics, strict=True):
        pose = as_rows(camera.world_from_cam * OPENGL)
        frames.append({"file_path": name, **({} if shared else own), "transform_matrix": pose})
    return as_json({"camera_model": models.pop(), **shared, "frames": frames})


def _intrinsics(name: str, camera: Camera) -> dict[str, Any]:
    model, same = expressed(name, camera, MODELS, TITLE)
    grid = camera.intrinsics
    values = zip(model.names, model.values(same, FIRST_PIXEL), strict=True)
    held = {KEYS.get(key, key): value for key, value in values}
    return {"camera_model": model.name, "w": grid.width, "h": grid.height, **held}


def _without_lens(intrinsics: dict[str, Any]) -> dict[str, Any]:
    """Those of a pinhole, so that no reader takes its pictures for distorted ones."""
    return {key: value for key, value in intrinsics.items() if key not in LENS_KEYS} | {"camera_model": STRAIGHT[0]}


FORMAT = Format(
    name="nerfstudio",
    title="nerfstudio's transforms.json",
    file="transforms.json",
    recognise=is_transforms,
    read=read,
    write=write,
    own_world=True,
    models="OPENCV with k1 k2 k3 p1 p2, OPENCV_FISHEYE, PINHOLE",
    says="instant-ngp's too; first pixel's centre at 0.5; camera → world with OpenGL's axes: y and z negated; no unit",
    lacks="skew, two kinds of lens in one file",
)
