"""`write`: a calibration in another format, whole and unchanged, or a sentence that says why not."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import Format
from camviz_clinic.files.loading import load
from camviz_clinic.files.models import same_camera
from camviz_clinic.files.registry import written
from camviz_clinic.files.section import named

BY_CAMERA = (
    "detections",
    "cam_from_board",
    "per_view_errors",
    "pictures",
    "set_aside",
    "estimated",
    "intrinsics_covariance",
    "priors",
    "stamps",
    "line_delays",
)


def write(calibration: Calibration, path: str | PathLike[str], format: str) -> tuple[str, ...]:
    """Write a calibration in another format, whole and unchanged, or not at all.

    Pixels, lenses and poses are written so that they are read back the same. The file appears under its name when it is
    complete; COLMAP's is a folder.

    Args:
        calibration: What to write.
        path: Where to.
        format: One of `formats()` that can be written.

    Returns: In sentences what the format could not hold beside the cameras.

    Raises:
        CalibrationError: For what the format has no place for, an unknown format, and a place that cannot be written
            to.

    >>> from pathlib import Path
    >>> from camviz.cameras import Camera, Intrinsics
    >>> one = Calibration({"camera": Camera(Intrinsics.from_fov(640, 480, 90))}, Path(), "a data sheet")
    >>> write(one, "camera.yaml", "ros")
    ()
    >>> load("camera.yaml").cameras["camera"].intrinsics == one.cameras["camera"].intrinsics
    True
    """
    path = Path(path)
    known = written()
    if format not in known:
        raise CalibrationError(f"format: expected one of {', '.join(known)}, got {format!r}")
    with named(path):
        _refuse_cameras(calibration, known[format])
        content = known[format].content(calibration, path.suffix.lower())
    if isinstance(content, dict):
        return _folder(calibration, path, content)
    return _file(calibration, path, content)


def _refuse_cameras(calibration: Calibration, format: Format) -> None:
    """CalibrationError for more cameras, or another world, than the format has a place for."""
    names, most = list(calibration.cameras), format.most_cameras
    if most is not None and len(names) > most:
        shown = ", ".join(names[:4]) + ", …" * (len(names) > 4)
        raise CalibrationError(
            f"{format.title} holds {format.holds}, this calibration has {len(names)}: choose one of {shown} "
            "(--camera NAME)"
        )
    first = calibration.cameras[names[0]]
    if not format.own_world and not np.allclose(first.world_from_cam.as_matrix(), np.eye(4), rtol=0, atol=1e-12):
        place = ", ".join(f"{x:.3g}" for x in first.centre)
        raise CalibrationError(
            f"{format.title} has no world but its first camera's frame, and {names[0]} stands at ({place}) or is "
            "turned: make its frame the world (--first-as-world)"
        )


def alone(calibration: Calibration, name: str) -> Calibration:
    """One of the cameras and what was recorded of it, where it stands.

    Args:
        calibration: Of several cameras.
        name: The camera.

    Returns: Calibration of this camera alone.
    Raises: CalibrationError for a name that is none of theirs.

    >>> from pathlib import Path
    >>> from camviz.cameras import Camera, Intrinsics
    >>> camera = Camera(Intrinsics.from_fov(640, 480, 90))
    >>> pair = Calibration({"left": camera, "right": camera}, Path(), "a data sheet")
    >>> list(alone(pair, "right").cameras)
    ['right']
    """
    if name not in calibration.cameras:
        names = ", ".join(calibration.cameras)
        raise CalibrationError(f"{calibration.source}: expected one of the cameras {names}, got {name!r}")
    views: dict[str, Any] = {
        field: {key: value for key, value in getattr(calibration, field).items() if key == name} for field in BY_CAMERA
    }
    return replace(calibration, cameras={name: calibration.cameras[name]}, **views)


def from_first_camera(calibration: Calibration) -> Calibration:
    """The same cameras with the first one's frame as the world.

    Args:
        calibration: Whose cameras stand anywhere.

    Returns: Calibration with the first camera in the origin, looking along z.

    >>> from pathlib import Path
    >>> from camviz.cameras import Camera, Intrinsics, look_at
    >>> away = Camera(Intrinsics.from_fov(640, 480, 90), world_from_cam=look_at((3, 0, 0), (0, 0, 0)))
    >>> from_first_camera(Calibration({"camera": away}, Path(), "here")).cameras["camera"].centre
    array([0., 0., 0.])
    """
    first_from_world = next(iter(calibration.cameras.values())).cam_from_world
    names = list(calibration.cameras)
    moved = {name: camera.at(first_from_world * camera.world_from_cam) for name, camera in calibration.cameras.items()}
    moved[names[0]] = replace(moved[names[0]], world_from_cam=first_from_world.identity())
    imu = calibration.world_from_imu
    return replace(calibration, cameras=moved, world_from_imu=None if imu is None else first_from_world * imu)


def _file(calibration: Calibration, path: Path, content: bytes) -> tuple[str, ...]:
    """By way of a file beside it, of the same ending, that is read back before it takes the name."""
    if path.is_dir():
        raise CalibrationError(f"{path}: expected the name of a file to write, this is a directory")
    _refuse_no_parent(path)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as room:
        part = Path(room) / path.name
        _put(part, content)
        left_out = _left_out(calibration, part, path)
        if path.exists():
            shutil.copymode(path, part)
        os.replace(part, path)
    return left_out


def _folder(calibration: Calibration, path: Path, content: dict[str, bytes]) -> tuple[str, ...]:
    """A folder that was not there, or was empty."""
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise CalibrationError(f"{path}: expected the name of a new folder, or of an empty one")
    _refuse_no_parent(path)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as room:
        part = Path(room) / "model"
        part.mkdir()
        for name, held in content.items():
            _put(part / name, held)
        left_out = _left_out(calibration, part, path)
        if path.exists():
            path.rmdir()
        os.replace(part, path)
    return left_out


def _refuse_no_parent(path: Path) -> None:
    if not path.parent.is_dir():
        raise CalibrationError(f"{path}: there is no directory {path.parent} to write into")


def _put(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _left_out(calibration: Calibration, part: Path, path: Path) -> tuple[str, ...]:
    """What is not read back, in sentences; CalibrationError should that be a camera."""
    grid = next(iter(calibration.cameras.values())).intrinsics
    sizes = {(camera.intrinsics.width, camera.intrinsics.height) for camera in calibration.cameras.values()}
    try:
        back = load(part, size=(grid.width, grid.height) if len(sizes) == 1 else None)
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {str(error).removeprefix(f'{part}: ')}") from error
    pairs = zip(calibration.cameras.items(), back.cameras.values(), strict=False)
    changed = [name for (name, camera), other in pairs if not same_camera(camera, other)]
    if changed or len(back.cameras) != len(calibration.cameras):
        raise CalibrationError(f"{path}: what would be written is not read back as the same cameras ({changed[:3]})")
    return (*_renamed(calibration, back), *_missing(calibration, back))


def _renamed(calibration: Calibration, back: Calibration) -> list[str]:
    pairs = [(old, new) for old, new in zip(calibration.cameras, back.cameras, strict=True) if old != new]
    more = f", and {len(pairs) - 4} more" * (len(pairs) > 4)
    said = ", ".join(f"{old} is {new}" for old, new in pairs[:4])
    return [f"The format does not keep these names: {said}{more}."] if pairs else []


def _missing(calibration: Calibration, back: Calibration) -> list[str]:
    kinds = {
        "board": "the board",
        "detections": "the detected corners",
        "cam_from_board": "the poses of the board",
        "per_view_errors": "the errors of the views",
        "pictures": "the names of the pictures",
        "set_aside": "which corners were set aside",
        "estimated": "which parameters were estimated",
        "intrinsics_covariance": "their covariance",
        "priors": "the prior on the denominator",
        "board_warp": "the bend of the board",
        "skipped": "the pictures that were skipped",
        "stamps": "what it was made for and when",
        "line_delays": "the line delay of the rolling shutter",
        "world_from_imu": "the place of the IMU",
    }
    lost = [said for field, said in kinds.items() if _held(calibration, field) and not _held(back, field)]
    return [f"The format does not hold {', '.join(lost)}: left out."] if lost else []


def _held(calibration: Calibration, field: str) -> bool:
    value = getattr(calibration, field)
    return value is not None and not (isinstance(value, (Mapping, tuple)) and not value)
