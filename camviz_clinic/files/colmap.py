"""COLMAP models as text: a folder with cameras.txt and images.txt, in a world and a unit of their own."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, listed
from camviz_clinic.files.models import Model, expressed, model_named
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import COUNT, LARGEST, ROTATION_TOLERANCE, Section, agreed_size, named
from camviz_clinic.files.text import HEAD, MAX_BYTES, open_bounded, read_bytes, text_of
from camviz_clinic.files.trees import scalar, shown

FIRST_PIXEL = 0.5  # "the upper left corner is (0, 0), the centre of the first pixel (0.5, 0.5)"
MAX_IMAGES = 100_000
MOST_WORDS = 32  # more than any line of cameras.txt has
MODELS = {  # by COLMAP's number for it (colmap/sensor/models.h)
    model.number: model for model in sorted(LAYOUTS["colmap"], key=lambda model: model.number)
}
# What every COLMAP reads, and EUCM of its newest releases; their plain fisheyes are written as OPENCV_FISHEYE.
WRITTEN = [model for number, model in MODELS.items() if number not in (14, 15)]
UNNAMED = {11: "RAD_TAN_THIN_PRISM_FISHEYE", 12: "SIMPLE_DIVISION", 13: "DIVISION"}
UNNAMED |= {17: "EQUIRECTANGULAR"}
_CAMERA_LINE = re.compile(r"(?:[ \t]*(?:#[^\r\n]*)?\r?\n)*[ \t]*\d+[ \t]+[A-Z][A-Z0-9_]{2,40}[ \t]+\d+[ \t]+\d+[ \t]")

Cameras = dict[int, Camera]  # by number
Image = tuple[str, int, list[float]]  # name, number of its camera, quaternion w x y z and translation


def cameras_file(path: Path, ending: str) -> Path | None:
    """The cameras file of the model that a path belongs to: its folder, that file, or the images beside it."""
    if path.is_dir():
        path = path / f"cameras{ending}"
        return path if path.is_file() else None
    belongs = path.suffix == ending and path.stem in ("cameras", "images")
    return path.with_name(f"cameras{ending}") if belongs else None


def is_model(file: File) -> object:
    """True for a model's folder and files, and for lines of a number, a camera model, a width and a height."""
    return cameras_file(file.path, ".txt") or (not file.path.is_dir() and _CAMERA_LINE.match(file.text[:HEAD]))


def read(file: File) -> Calibration:
    """The images of a model as cameras in its world, by name; without an images file the cameras alone."""
    return read_model(cameras_file(file.path, ".txt") or file.path, file, _cameras, _images)


def read_model(
    cameras_path: Path, file: File, cameras_of: Callable[[Path], Cameras], images_of: Callable[[Path], Iterator[Image]]
) -> Calibration:
    """The same by the functions that read its two files."""
    with _within(file, cameras_path):
        cameras = cameras_of(cameras_path)
        if not cameras:
            raise CalibrationError("expected at least one camera, got none")
    images_path = cameras_path.with_name("images" + cameras_path.suffix)
    if cameras_path.stem != "cameras" or not images_path.exists():
        note = "There is no images file beside the cameras: they stand at the origin."
        return Calibration({f"camera{n}": camera for n, camera in cameras.items()}, file.path, "COLMAP", notes=(note,))
    with _within(file, images_path):
        placed = _placed(cameras, images_of(images_path), file.mended)
    notes = ["COLMAP's world has no unit of its own: lengths are in the file's."]
    if idle := len(cameras) - len({id(camera.lens) for camera in placed.values()}):
        notes.append(f"{idle} of the {len(cameras)} cameras took none of the images and are left out.")
    return Calibration(placed, file.path, "COLMAP", notes=tuple(notes))


def _within(file: File, path: Path) -> AbstractContextManager[None]:
    """Names the file of the model in which something is wrong, unless it is the one that was asked for."""
    return nullcontext() if path == file.path else named(path.name)


def unknown_model(name: str) -> CalibrationError:
    """The error for a camera model of COLMAP's that has no lens here."""
    known = ", ".join(model.name for model in MODELS.values())
    return CalibrationError(f"there is no lens here for the camera model {shown(name)}; there is for {known}")


def _cameras(path: Path) -> Cameras:
    """Lines of CAMERA_ID MODEL WIDTH HEIGHT PARAMS…"""
    text, cameras = text_of(read_bytes(path)), {}
    if text.count("\n") > MAX_IMAGES:
        raise CalibrationError(f"expected at most {MAX_IMAGES:,} lines, got {text.count(chr(10)):,}")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split(maxsplit=MOST_WORDS)
        if not words or words[0].startswith("#"):
            continue
        where = f"line {number}"
        if len(words) < 4:
            raise CalibrationError(f"{where}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS…, got {shown(line)}")
        model = model_named(words[1], MODELS.values())
        if model is None:
            raise unknown_model(words[1][:40])
        key = _whole(words[0], where)
        if key in cameras:
            raise CalibrationError(f"{where}: the camera {key} appears twice")
        section = Section({"size": _numbers(words[2:4]), "params": _numbers(words[4:])}, where)
        cameras[key] = camera_of(model, section)
    return cameras


def camera_of(model: Model, section: Section) -> Camera:
    """A camera of `size` and `params`, at the origin."""
    size = agreed_size(section.size("size"), None, "size")
    values = section.vector("params", [len(model.names)], model.parameters, COUNT)
    return model.camera(values, *size, FIRST_PIXEL, section.path)


def _images(path: Path) -> Iterator[Image]:
    """Pairs of lines: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and the points seen, which are passed over."""
    with open_bounded(path, 64 * MAX_BYTES) as file:
        number, skip = 0, False
        while line := file.readline(MAX_BYTES):
            number += 1
            if skip or not line.strip() or line.lstrip().startswith(b"#"):
                skip = skip and len(line) == MAX_BYTES and not line.endswith(b"\n")
                continue
            yield _image(line, f"line {number}")
            skip = True


def _image(line: bytes, where: str) -> Image:
    try:
        words = line.decode("utf-8").strip().split(maxsplit=9)
    except UnicodeDecodeError:
        raise CalibrationError(f"{where}: expected text in UTF-8") from None
    if len(words) != 10:
        expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
        raise CalibrationError(f"{where}: expected {expected}, got {len(words)} words")
    pose = Section({"pose": _numbers(words[1:8])}, where).vector("pose", [7], "QW QX QY QZ TX TY TZ")
    return words[9], _whole(words[8], where), pose


def _whole(word: str, where: str) -> int:
    if not re.fullmatch(r"[0-9]{1,10}", word):
        raise CalibrationError(f"{where}: expected a number that names a camera, got {shown(word)}")
    return int(word)


def _numbers(words: list[str]) -> list[object]:
    return [scalar(word) for word in words]


def _placed(cameras: Cameras, images: Iterable[Image], mended: list[CalibrationError] | None) -> dict[str, Camera]:
    """cam_from_world = [R(q) | t] for every image."""
    names, used, poses = [], [], []
    for name, key, pose in images:
        if key not in cameras:
            raise CalibrationError(f"{shown(name)}: expected one of the cameras of the model, got camera {key}")
        names.append(name)
        used.append(cameras[key])
        poses.append(pose)
        if len(names) > MAX_IMAGES:
            raise CalibrationError(f"holds more than {MAX_IMAGES:,} images")
    if not names:
        raise CalibrationError("expected at least one image, got none")
    if len(set(names)) < len(names):
        raise CalibrationError("expected images of different names, got one twice")
    world_from_cam = _inverted(np.array(poses), names, mended)
    return {name: camera.at(pose) for name, camera, pose in zip(names, used, world_from_cam, strict=True)}


def _inverted(poses: np.ndarray, names: list[str], mended: list[CalibrationError] | None) -> Iterable[RigidTransform]:
    wild = np.flatnonzero(~(np.abs(poses) <= LARGEST).all(axis=1))
    if len(wild):
        raise CalibrationError(f"{shown(names[wild[0]])}: expected a pose of finite numbers below {LARGEST:g}")
    lengths = np.linalg.norm(poses[:, :4], axis=1)
    bad = np.flatnonzero(np.abs(lengths - 1) > ROTATION_TOLERANCE)
    if len(bad):  # the first speaks for all
        Section({}, mended=mended).quaternion(poses[bad[0], :4], shown(names[bad[0]]))
    rotations = Rotation.from_quat(poses[:, :4], scalar_first=True)
    return RigidTransform.from_components(poses[:, 4:], rotations).inv()


# Writing.

Row = tuple[int, int, Model, list[float], Camera]  # camera's number, model's number, model, parameters, camera


def rows(calibration: Calibration) -> tuple[list[Row], list[Image]]:
    """The distinct cameras of a calibration, and an image of one of them for each of its cameras."""
    numbers: dict[object, int] = {}
    cameras, images = [], []
    for name, camera in calibration.cameras.items():
        if not re.fullmatch(r"[^\s\x00-\x1f\x7f#][^\s\x00-\x1f\x7f]{0,999}", name):
            raise CalibrationError(f"COLMAP takes image names without spaces, the camera is named {shown(name)}")
        key = (camera.intrinsics, camera.lens)
        if key not in numbers:
            model, same = expressed(name, camera, WRITTEN, "COLMAP")
            numbers[key] = len(numbers) + 1
            number = next(n for n, known in MODELS.items() if known is model)
            cameras.append((numbers[key], number, model, model.values(same, FIRST_PIXEL), camera))
        pose = camera.cam_from_world
        quaternion = pose.rotation.as_quat(scalar_first=True)
        images.append((name, numbers[key], [float(x) for x in (*quaternion, *pose.translation)]))
    return cameras, images


def write(calibration: Calibration) -> dict[str, bytes]:
    """cameras.txt, images.txt and an empty points3D.txt."""
    cameras, images = rows(calibration)
    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for key, _, model, values, camera in cameras:
        size = f"{camera.intrinsics.width} {camera.intrinsics.height}"
        lines.append(f"{key} {model.name} {size} {' '.join(map(repr, values))}")
    image_lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[] as (X, Y, POINT3D_ID)"]
    for number, (name, key, pose) in enumerate(images, 1):
        image_lines += [f"{number} {' '.join(map(repr, pose))} {key} {name}", ""]
    points = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
    texts = {"cameras.txt": "\n".join(lines) + "\n", "images.txt": "\n".join(image_lines) + "\n"}
    return {name: text.encode() for name, text in (texts | {"points3D.txt": points}).items()}


FORMAT = Format(
    name="colmap",
    title="COLMAP model as text",
    file="a folder",
    recognise=is_model,
    read=read,
    write=write,
    own_world=True,
    folder_from=1,
    models=f"{listed(WRITTEN)}; SIMPLE_FISHEYE and FISHEYE are read too",
    says="first pixel's centre at (0.5, 0.5); quaternion w x y z, world → camera; no unit",
    lacks="skew, thin prisms of a lens that is no fisheye, names with spaces",
    rank=25,
)
