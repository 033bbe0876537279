"""`write`: a calibration in another format, whole and unchanged, or a sentence that says why not."""

from __future__ import annotations

import os
import shlex
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from camviz.lenses import Perspective
from camviz.poses import RigidTransform
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import Format
from camviz_clinic.files.loading import load
from camviz_clinic.files.models import same_camera, same_pose
from camviz_clinic.files.registry import written
from camviz_clinic.files.section import MissingSizeError, named

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
    "rectifications",
)
KINDS = {
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
    "board_warp_covariance": "its covariance",
    "skipped": "the pictures that were skipped",
    "stamps": "what it was made for and when",
    "line_delays": "the line delay of the rolling shutter",
    "world_from_imu": "the place of the IMU",
    "rectifications": "the rectification R and P",
}
MAX_LISTED = 4  # names in a sentence


def write(
    calibration: Calibration, path: str | PathLike[str], format: str, whole: Calibration | None = None
) -> tuple[str, ...]:
    """Write a calibration in another format, whole and unchanged, or not at all.

    Pixels, lenses and poses are written so that they are read back the same. The file appears under its name when it is
    complete; COLMAP's, and a pair's for ROS, is a folder.

    Args:
        calibration: What to write.
        path: Where to.
        format: One of `formats()` that can be written.
        whole: What the calibration was taken from by `alone` or `from_first_camera`; what this lost counts as well.

    Returns: What of the whole is not read back from the file, as noun phrases such as "the board"; see `without`.

    Raises:
        CalibrationError: For what the format has no place for, an unknown format, and a place that cannot be written
            to.

    >>> from pathlib import Path
    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> one = Calibration({"left": Camera(Intrinsics.from_fov(640, 480, 90), BrownConrady(-0.1))}, Path(), "made")
    >>> write(one, "camera.yaml", "ros"), write(one, "calib.json", "matlab")
    ((), ('the name left (now camera)',))
    >>> load("camera.yaml").cameras["left"].intrinsics == one.cameras["left"].intrinsics
    True
    """
    path = Path(path)
    known = written()
    if format not in known:
        raise CalibrationError(f"format: expected one of {', '.join(known)}, got {format!r}")
    whole = calibration if whole is None else whole
    with named(path):
        _refuse_half_a_pair(calibration, whole, known[format], path)
        _refuse_cameras(calibration, known[format])
        content = known[format].content(calibration, path.suffix.lower())

    def read_back(part: Path) -> tuple[str, ...]:
        with named(path):
            return _lost(calibration, whole, known[format], part)

    if isinstance(content, dict):
        _refuse_name_of_a_file(path, content, format)
        return _folder(path, content, read_back)
    return _file(path, content, read_back)


def without(lost: Sequence[str]) -> str:
    """What `write` returned, as the end of the sentence that says that it is written.

    >>> without(["the board", "the detected corners"])
    ', but without the board and the detected corners'
    >>> without([])
    ''
    """
    return f", but without {enumerated(lost)}" if lost else ""


def _refuse_name_of_a_file(path: Path, content: Mapping[str, bytes], format: str) -> None:
    """CalibrationError for a folder that would be called as the files in it are."""
    if path.suffix in {Path(name).suffix for name in content}:
        files, folder = enumerated(list(content), MAX_LISTED), path.with_name(format)
        raise CalibrationError(f"{path}: expected the name of a new folder for {files}, such as {folder}")


def _refuse_half_a_pair(calibration: Calibration, whole: Calibration, format: Format, path: Path) -> None:
    """CalibrationError for one camera of a pair in a format whose files of both hold the baseline."""
    if not (format.rectifies and len(whole.cameras) == 2 and len(calibration.cameras) == 1):
        return
    (lost,) = lost_poses(calibration, whole)
    command = shlex.join(
        ["camviz", "convert", str(whole.source), str(path.with_name(format.name)), "--to", format.name]
    )
    raise CalibrationError(f"{format.title} of one camera loses {lost}: write both, with `{command}`")


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


def _file(path: Path, content: bytes, read_back: Callable[[Path], tuple[str, ...]]) -> tuple[str, ...]:
    """By way of a file beside it, of the same ending, that is read back before it takes the name."""
    if path.is_dir():
        raise CalibrationError(f"{path}: expected the name of a file to write, this is a directory")
    _refuse_no_parent(path)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as room:
        part = Path(room) / path.name
        _put(part, content)
        lost = read_back(part)
        if path.exists():
            shutil.copymode(path, part)
        os.replace(part, path)
    return lost


def _folder(path: Path, content: dict[str, bytes], read_back: Callable[[Path], tuple[str, ...]]) -> tuple[str, ...]:
    """A folder that was not there, or was empty."""
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise CalibrationError(f"{path}: expected the name of a new folder, or of an empty one")
    _refuse_no_parent(path)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as room:
        part = Path(room) / "model"
        part.mkdir()
        for name, held in content.items():
            _put(part / name, held)
        lost = read_back(part)
        if path.exists():
            path.rmdir()
        os.replace(part, path)
    return lost


def _refuse_no_parent(path: Path) -> None:
    if not path.parent.is_dir():
        raise CalibrationError(f"{path}: there is no directory {path.parent} to write into")


def _put(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _lost(calibration: Calibration, whole: Calibration, format: Format, part: Path) -> tuple[str, ...]:
    """What of the whole is not read back from a file, as noun phrases; CalibrationError should that be a camera."""
    back, size = _loaded(part, calibration)
    back = _in_order(calibration, back, format)
    pairs = zip(calibration.cameras.items(), back.cameras.values(), strict=False)
    changed = [name for (name, camera), other in pairs if not same_camera(camera, other)]
    if changed or len(back.cameras) != len(calibration.cameras):
        raise CalibrationError(f"what would be written is not read back as the same cameras ({changed[:3]})")
    poses = lost_poses(calibration, whole, format.own_world)
    lost = *poses, *size, *_lost_pinhole(calibration, back), *_renamed(calibration, back)
    return (*lost, *_missing(calibration, back, whole))


def _loaded(part: Path, calibration: Calibration) -> tuple[Calibration, list[str]]:
    """What is read back, and the image size as a noun phrase where the file has none."""
    sizes = {(camera.intrinsics.width, camera.intrinsics.height) for camera in calibration.cameras.values()}
    try:
        try:
            return load(part), []
        except MissingSizeError:
            size, *_ = sizes
            return load(part, size=size), [f"the image size ({size[0]}×{size[1]} px)"]
    except CalibrationError as error:
        raise CalibrationError(str(error).removeprefix(f"{part}: ")) from error


def _in_order(calibration: Calibration, back: Calibration, format: Format) -> Calibration:
    """What was read back, its cameras by name in the order of the calibration, as a format may have its own order."""
    if set(back.cameras) != set(calibration.cameras):
        return back
    back = replace(back, cameras={name: back.cameras[name] for name in calibration.cameras})
    return back if format.own_world else from_first_camera(back)


def lost_poses(calibration: Calibration, whole: Calibration, own_world: bool = False) -> list[str]:
    """The poses that `alone` and `from_first_camera` took from the cameras of a calibration, as noun phrases.

    Args:
        calibration: What is left.
        whole: What it was taken from.
        own_world: Whether a file keeps where its cameras stand, so that files of one camera each make a rig.

    Returns: The pose relative to the cameras that are not there any more, and the pose in a world that is not the first
        camera's; each with its length in millimetres and its angle.
    """
    first, camera = next(iter(calibration.cameras.items()))
    others = [name for name in whole.cameras if name not in calibration.cameras]
    moved = not same_pose(whole.cameras[first], camera)
    lost = []
    if others and (moved or not own_world):
        poses = [f"{name} ({_described(whole.rig.a_from_b(name, first), 'baseline')})" for name in others]
        lost.append(f"the pose of {first} relative to {enumerated(poses, MAX_LISTED)}")
    if moved and not any(same_pose(whole.cameras[name], camera) for name in others):
        lost.append(f"the pose of {first} in its world ({_described(whole.cameras[first].world_from_cam, 'distance')})")
    return lost


def _described(pose: RigidTransform, length: str) -> str:
    angle = np.degrees(pose.rotation.magnitude())
    return f"{length} {1000 * np.linalg.norm(pose.translation):.4g} mm, rotation {angle:.2f}°"


def _lost_pinhole(calibration: Calibration, back: Calibration) -> list[str]:
    """What `inspect` would otherwise take for coefficients that somebody forgot."""
    pairs = zip(calibration.cameras.values(), back.cameras.values(), strict=True)
    zeros = [a for a, b in pairs if isinstance(a.lens, Perspective) and not isinstance(b.lens, Perspective)]
    return ["the mark of a pinhole (its distortion coefficients are zeros)"] if zeros else []


def _renamed(calibration: Calibration, back: Calibration) -> list[str]:
    names = [f"{old} (now {new})" for old, new in zip(calibration.cameras, back.cameras, strict=True) if old != new]
    return [f"the name{'s' * (len(names) > 1)} {enumerated(names, MAX_LISTED)}"] if names else []


def _missing(calibration: Calibration, back: Calibration, whole: Calibration) -> list[str]:
    lost = []
    for field, what in KINDS.items():
        if _is_known(getattr(whole, field)) and not _is_known(getattr(back, field)):
            lost.append(what)
        elif _is_known(value := getattr(calibration, field)) and not _alike(value, getattr(back, field)):
            lost.append(f"part of {what}")
    return lost


def _is_known(value: Any) -> bool:
    return value is not None and not (isinstance(value, (Mapping, tuple)) and not value)


def _alike(value: Any, back: Any) -> bool:
    """Whether what was recorded of the cameras, in their order, is read back to rounding."""
    if isinstance(value, Mapping):
        value, back = tuple(value.values()), tuple(back.values())
    elif isinstance(value, RigidTransform):
        value, back = value.as_matrix(), back.as_matrix()
    elif is_dataclass(value):
        value, back = (tuple(getattr(each, field.name) for field in fields(value)) for each in (value, back))
    if isinstance(value, tuple):
        return len(value) == len(back) and all(map(_alike, value, back))
    if isinstance(value, (float, np.ndarray)) and np.shape(value) == np.shape(back) and back is not None:
        return np.allclose(value, back, rtol=1e-9, atol=1e-12, equal_nan=True)
    return bool(value is back or np.array_equal(value, back))
