"""KITTI: calib.txt with its rectified P0 … P3, and calib_cam_to_cam.txt with the cameras as they are."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from camviz.calibration.types import Calibration, CalibrationError
from camviz.cameras import Camera, Intrinsics
from camviz.files.models import expressed, models_of
from camviz.files.section import BAD_K, LARGEST_SIDE, Section, explained
from camviz.files.sizes import agreed_size
from camviz.files.trees import scalar, shown
from camviz.lenses import BrownConrady, Perspective
from camviz.poses import RigidTransform

RECTIFIED = models_of("kitti")
RAW = models_of("kitti-raw")
MAX_LINES = 1000
MOST_WORDS = 64  # more than any line has
_START = re.compile(r"^(?:P[0-9]|P_rect_[0-9]{2}|K_[0-9]{2}):[ \t]+[-+.0-9]", re.MULTILINE)


def is_calib(text: str) -> bool:
    """True where a line is a name such as P0 or K_00, a colon, and numbers without brackets."""
    return bool(_START.search(text))


def read(
    text: str, path: Path, size: tuple[int, int] | None, mended: list[CalibrationError] | None = None
) -> Calibration:
    """The rectified cameras of calib.txt, or the raw ones of calib_cam_to_cam.txt."""
    section = Section(_values(text), mended=mended)
    raw = sorted(key[2:] for key in section.values if re.fullmatch(r"K_[0-9]{2}", key))
    return _read_raw(section, raw, path, size) if raw else _read_rectified(section, path, size)


def _values(text: str) -> dict[str, list[object]]:
    """Lines of a name and its values."""
    values: dict[str, list[object]] = {}
    if text.count("\n") > MAX_LINES:
        raise CalibrationError(f"expected at most {MAX_LINES} lines, got {text.count(chr(10)):,}")
    for number, line in enumerate(text.splitlines(), 1):
        name, *words = line.split(maxsplit=MOST_WORDS) or [""]
        if name.rstrip(":") in values:
            raise CalibrationError(f"line {number}: {shown(name)} appears twice")
        if name:
            values[name.rstrip(":")] = [scalar(word) for word in words]
    return values


def _read_rectified(section: Section, path: Path, size: tuple[int, int] | None) -> Calibration:
    """P = K [1 | t] with t = -C: the world is the rectified frame of the reference camera."""
    width, height = agreed_size(None, size, "calib.txt never does")
    cameras = {}
    for name in sorted(key for key in section.values if re.fullmatch(r"P[0-9]", key)):
        P = section.matrix(name, 3, 4)
        with explained(name, BAD_K):
            grid = Intrinsics.from_matrix(section.camera_matrix(P[:, :3], name), width, height)
        pose = RigidTransform.from_translation(np.linalg.solve(grid.K, P[:, 3])).inv()
        cameras[name] = Camera(grid, Perspective(), pose)
    if not cameras:
        raise CalibrationError("expected the projection matrices P0, P1 …, found none")
    notes = ["These are the rectified cameras: the pictures on disk have no distortion left."]
    return Calibration(cameras, path, "KITTI calib.txt", notes=tuple(notes))


def _read_raw(section: Section, tags: list[str], path: Path, size: tuple[int, int] | None) -> Calibration:
    """x_i = R_i x_0 + T_i, K and D in OpenCV's order."""
    cameras = {}
    for tag in tags:
        with explained(section.where(f"K_{tag}"), BAD_K):
            K = section.camera_matrix(section.matrix(f"K_{tag}", 3, 3), section.where(f"K_{tag}"))
            grid = Intrinsics.from_matrix(K, *_size(section, f"S_{tag}", size))
        with explained(section.where(f"D_{tag}")):
            lens = BrownConrady(*section.coefficients(f"D_{tag}", [5], "k1 k2 p1 p2 k3", (4, 8)))
        t = section.vector(f"T_{tag}", [3], "x y z")
        pose = RigidTransform.from_components(t, section.rotation(f"R_{tag}"))
        cameras[tag] = Camera(grid, lens, pose.inv())
    notes = ["These are the cameras before rectification; R_rect and P_rect describe the rectified ones."]
    return Calibration(cameras, path, "KITTI calib_cam_to_cam.txt", notes=tuple(notes))


def _size(section: Section, key: str, given: tuple[int, int] | None) -> tuple[int, int]:
    held = section.vector(key, [2], "width height") if key in section else None
    if held:
        sides = Section({"width": held[0], "height": held[1]}, section.where(key))
        return agreed_size((sides.whole("width", LARGEST_SIDE), sides.whole("height", LARGEST_SIDE)), given, key)
    return agreed_size(None, given, key)


def write_rectified(calibration: Calibration) -> bytes:
    """P0 …: pinholes side by side, all turned as the world is, with pictures of one size."""
    title, lines = "KITTI's calib.txt", []
    cameras = calibration.cameras
    if len({(camera.intrinsics.width, camera.intrinsics.height) for camera in cameras.values()}) > 1:
        raise CalibrationError(f"{title} holds no image sizes, and these cameras have different ones")
    if len(cameras) > 10:
        raise CalibrationError(f"{title} holds P0 to P9, this calibration has {len(cameras)} cameras")
    for index, (name, camera) in enumerate(cameras.items()):
        _, same = expressed(name, camera, RECTIFIED, title)
        if same.cam_from_world.rotation.magnitude() > 1e-12:
            raise CalibrationError(f"{title} holds rectified cameras, all turned alike, and {name} is turned")
        K = same.intrinsics.K
        P = np.column_stack([K, K @ same.cam_from_world.translation])
        lines.append(f"P{index}: {_words(P)}")
    return ("\n".join(lines) + "\n").encode()


def write_raw(calibration: Calibration) -> bytes:
    """S, K, D, R and T of every camera; nothing of a rectification."""
    lines = []
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        model, same = expressed(name, camera, RAW, "KITTI's calib_cam_to_cam.txt")
        grid, pose = same.intrinsics, same.cam_from_world
        values = {"S": [grid.width, grid.height], "K": grid.K, "D": model.values(same, 0.0)[4:]}
        values |= {"R": pose.rotation.as_matrix(), "T": pose.translation}
        lines += [f"{key}_{index:02}: {_words(value)}" for key, value in values.items()]
    return ("\n".join(lines) + "\n").encode()


def _words(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(np.asarray(values, dtype=float)))
