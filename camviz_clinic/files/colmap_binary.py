"""COLMAP models in binary: little-endian files, whose counts are checked before anything is made of them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files import colmap
from camviz_clinic.files.colmap import MODELS, UNNAMED, Cameras, Image, camera_of, unknown_model
from camviz_clinic.files.format import File
from camviz_clinic.files.section import Section
from camviz_clinic.files.text import MAX_BYTES, open_bounded

MAX_CAMERAS, MAX_IMAGES, MAX_NAME = 10_000, 100_000, 1024
POINT = 24  # bytes: x, y, number of the 3D point


def read(file: File) -> Calibration:
    """The images of a model as cameras in its world, by name; without an images file the cameras alone."""
    return colmap.read_model(colmap.cameras_file(file.path, ".bin") or file.path, file, _cameras, _images)


def _cameras(path: Path) -> Cameras:
    """By number: uint32 id, int32 model, uint64 width, uint64 height, double parameters."""
    found: Cameras = {}
    with open_bounded(path, MAX_BYTES) as file:
        for index in range(_count(file, MAX_CAMERAS, "cameras")):
            key, number, width, height = _unpack(file, "<IiQQ")
            if number not in MODELS:
                raise unknown_model(UNNAMED.get(int(number), f"number {number}"))
            params = _unpack(file, f"<{len(MODELS[int(number)].names)}d")
            if key in found:
                raise CalibrationError(f"the camera {key} appears twice")
            section = Section({"size": [width, height], "params": list(params)}, f"camera[{index}]")
            found[int(key)] = camera_of(MODELS[int(number)], section)
        _at_end(file)
    return found


def _images(path: Path) -> Iterator[Image]:
    """uint32 id, double q w x y z and t x y z, uint32 camera, the name up to a NUL, and the points, passed over."""
    with open_bounded(path, 64 * MAX_BYTES) as file:
        for _ in range(_count(file, MAX_IMAGES, "images")):
            _, *pose, key = _unpack(file, "<I7dI")
            name = _name(file)
            _skip(file, POINT * int(_unpack(file, "<Q")[0]))
            yield name, int(key), [float(x) for x in pose]
        _at_end(file)


def _count(file: BinaryIO, most: int, what: str) -> int:
    (count,) = _unpack(file, "<Q")
    if count > most:
        raise CalibrationError(f"expected at most {most:,} {what}, the file announces {count:,}")
    return int(count)


def _unpack(file: BinaryIO, form: str) -> tuple[float, ...]:
    content = file.read(struct.calcsize(form))
    if len(content) < struct.calcsize(form):
        raise CalibrationError("ends before all that it announces was said")
    return struct.unpack(form, content)


def _name(file: BinaryIO) -> str:
    start = file.tell()
    head = file.read(MAX_NAME)
    end = head.find(b"\0")
    if end < 1:
        raise CalibrationError(f"byte {start}: expected the name of an image, up to {MAX_NAME - 1} bytes and a NUL")
    file.seek(start + end + 1)
    try:
        return head[:end].decode("utf-8")
    except UnicodeDecodeError:
        raise CalibrationError(f"byte {start}: expected the name of an image in UTF-8") from None


def _skip(file: BinaryIO, size: int) -> None:
    here = file.tell()
    end = file.seek(0, 2)
    if size > end - here:
        raise CalibrationError("ends before all that it announces was said")
    file.seek(here + size)


def _at_end(file: BinaryIO) -> None:
    if file.read(1):
        raise CalibrationError("goes on after all that it announces was said")


def write(calibration: Calibration) -> dict[str, bytes]:
    """cameras.bin, images.bin and a points3D.bin without points."""
    rows, placed = colmap.rows(calibration)
    all_cameras = [struct.pack("<Q", len(rows))]
    for key, number, _, values, camera in rows:
        size = camera.intrinsics.width, camera.intrinsics.height
        all_cameras.append(struct.pack(f"<IiQQ{len(values)}d", key, number, *size, *values))
    all_images = [struct.pack("<Q", len(placed))]
    for index, (name, key, pose) in enumerate(placed, 1):
        all_images.append(struct.pack("<I7dI", index, *pose, key) + name.encode() + b"\0" + struct.pack("<Q", 0))
    nothing = struct.pack("<Q", 0)
    return {"cameras.bin": b"".join(all_cameras), "images.bin": b"".join(all_images), "points3D.bin": nothing}


FORMAT = replace(
    colmap.FORMAT,
    name="colmap-bin",
    title="binary COLMAP model",
    recognise=lambda file: file.path.suffix == ".bin" or colmap.cameras_file(file.path, ".bin"),
    read=read,
    write=write,
    models="as `colmap`",
    says="as `colmap`",
    rank=10,
)
