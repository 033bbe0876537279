"""`load`: which program wrote this file, and what does it say?"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from camviz.calibration.types import Calibration, CalibrationError
from camviz.files import (
    basalt,
    colmap,
    euroc,
    kalibr,
    kitti,
    matlab,
    matlab_binary,
    metashape,
    mrcal,
    opencv,
    ros,
    transforms,
)
from camviz.files.literal import parse_literal
from camviz.files.section import LARGEST_SIDE, Section
from camviz.files.text import read_bytes, text_of
from camviz.files.trees import parse, shown

Reader = Callable[[Section, Path, tuple[int, int] | None], Calibration]

LOOKED_FOR = (
    "a camera matrix as OpenCV names it (camera_matrix, K, cameraMatrix, M1 …), a ROS CameraInfo (distortion_model "
    "with camera_matrix or K), a Kalibr camchain (cam0 …), or what COLMAP, mrcal, nerfstudio, EuRoC, Basalt, KITTI, "
    "MATLAB or Metashape write"
)

_KINDS = {list: "a list", str: "plain text", type(None): "nothing but comments"}


def load(path: str | PathLike[str], *, size: tuple[int, int] | None = None, mend: bool = False) -> Calibration:
    """Read a calibration: OpenCV, ROS, Kalibr, COLMAP, mrcal, nerfstudio, EuRoC, Basalt, KITTI, MATLAB or Metashape.

    The content tells which it is; COLMAP's may be named by its folder. `size` is (width, height) in pixels for files
    that do not hold it. With `mend` a fault that has an obvious cure, such as a transposed K, is cured, and listed in
    the calibration's `faults`. Raises CalibrationError, a ValueError whose message is one sentence, for everything
    that is not such a calibration. The file is data: nothing in it is run.
    """
    path = Path(path)
    if size is not None:
        size = _checked_size(size)
    mended: list[CalibrationError] | None = [] if mend else None
    calibration = _loaded(path, size, mended)
    return replace(calibration, faults=tuple(mended)) if mended else calibration


def _loaded(path: Path, size: tuple[int, int] | None, mended: list[CalibrationError] | None) -> Calibration:
    if "\0" not in str(path) and (cameras := colmap.model_of(path)):
        return colmap.read(cameras, path, mended)
    content = read_bytes(path)
    text = "" if matlab_binary.is_mat(content) else text_of(content, path)
    if colmap.is_cameras(text):
        return colmap.read(path, path, mended)
    try:
        if not text:
            return _plausible(matlab.read_binary(content, path, size, mended))
        return _plausible(_read(text, path, size, mended))
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}", error.id, error.value) from error.__cause__


def _read(text: str, path: Path, size: tuple[int, int] | None, mended: list[CalibrationError] | None) -> Calibration:
    if mrcal.is_model(text, path):
        return mrcal.read(_mapping(parse_literal(text), mended), path)
    if kitti.is_calib(text):
        return kitti.read(text, path, size, mended)
    section = _mapping(parse(text), mended)
    return _reader(section)(section, path, size)


def _plausible(calibration: Calibration) -> Calibration:
    """The calibration, unless a focal length is so far out that no drawing of it could mean anything."""
    for name, camera in calibration.cameras.items():
        for axis in ("fx", "fy"):
            focal_length = getattr(camera.intrinsics, axis)
            if not 1e-3 <= focal_length <= 1e9:
                raise CalibrationError(f"{name}: expected {axis} from 0.001 to 1e9 pixels, got {focal_length:g}")
    return calibration


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    if len(size) != 2 or not all(isinstance(side, int) and 1 <= side <= LARGEST_SIDE for side in size):
        raise CalibrationError(
            f"size: expected (width, height), each from 1 to {LARGEST_SIDE} pixels, got {shown(size)}"
        )
    return size


def _mapping(tree: Any, mended: list[CalibrationError] | None) -> Section:
    if not isinstance(tree, dict):
        what = _KINDS.get(type(tree)) or shown(tree)
        raise CalibrationError(f"expected a calibration, this is {what}; looked for {LOOKED_FOR}")
    return Section(tree, mended=mended)


def _reader(section: Section) -> Reader:
    for recognised, reader in READERS:
        if recognised(section):
            return reader
    keys = [shown(key) for key in list(section.values)[:6]]
    found = ", ".join(keys + ["…"] * (len(section.values) > 6)) or "nothing"
    raise CalibrationError(f"no camera found: looked for {LOOKED_FOR}, found {found}")


READERS: list[tuple[Callable[[Section], object], Reader]] = [
    (lambda section: any(re.fullmatch(r"cam\d+", key) for key in section.values), kalibr.read),
    (lambda section: "value0" in section, lambda section, path, _: basalt.read(section, path)),
    (lambda section: "<calibration>" in section or "<document>" in section, metashape.read),
    (euroc.is_sensor, euroc.read),
    (transforms.is_transforms, transforms.read),
    (matlab.is_parameters, matlab.read),
    (lambda section: "distortion_model" in section or "projection_matrix" in section, ros.read),
    (opencv.camera_tags, opencv.read),
]
