"""What a calibration format is, and the file that it is asked about."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.models import Model
from camviz_clinic.files.section import Section
from camviz_clinic.files.text import read_bytes, text_of
from camviz_clinic.files.trees import parse, shown

Content = bytes | dict[str, bytes]  # of a file, or of the files of a folder by name

OPENCV_ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
NO_KEYS: Mapping[str, str] = MappingProxyType({})
_KINDS = {list: "a list", str: "plain text", type(None): "nothing but comments"}


@dataclass(frozen=True)
class File:
    """A file or folder that is to be read, and what the caller said of it.

    Its content is read once, when asked for.

    Args:
        path: Where it is.
        size: Width and height in pixels, for files that hold none.
        mended: Takes the faults that were cured in reading. Without it a fault is an error.

    >>> from pathlib import Path
    >>> _ = Path("camera.yaml").write_text("image_width: 640")
    >>> File(Path("camera.yaml")).section.number("image_width")
    640.0
    """

    path: Path
    size: tuple[int, int] | None = None
    mended: list[CalibrationError] | None = None

    @cached_property
    def content(self) -> bytes:
        """The bytes; CalibrationError for what cannot be a calibration: a folder, a pipe, a gigabyte."""
        return read_bytes(self.path)

    @cached_property
    def text(self) -> str:
        """The content as text; CalibrationError where it is something else."""
        return text_of(self.content)

    @cached_property
    def section(self) -> Section:
        """The keys of a YAML, JSON or XML text; CalibrationError where it has none."""
        return self.mapping(parse(self.text))

    def mapping(self, tree: Any) -> Section:
        """A tree that was read from this file, as a section.

        Args:
            tree: What a parser gave.

        Returns: Its keys.
        Raises: CalibrationError where it is no mapping.
        """
        if not isinstance(tree, dict):
            what = _KINDS.get(type(tree)) or shown(tree)
            raise CalibrationError(f"expected a calibration, this is {what} (`camviz show --help` lists what is read)")
        return Section(tree, mended=self.mended)


@dataclass(frozen=True)
class Format:
    """One program's calibration file. A module of `camviz_clinic.files` that has one as FORMAT adds it everywhere.

    `load` and `write`, the help of the commands, the table in docs/formats.md and the tests read these fields.

    Args:
        name: One word, which `camviz convert --to` takes.
        title: The program, or its file, as sentences name it: "ROS CameraInfo".
        file: What such a file is usually called: "camera.yaml".
        recognise: True for a File of this format; may raise CalibrationError.
        read: From a File to a Calibration; raises CalibrationError for what it cannot take.
        write: From a Calibration to the content; none where the format is only read.
        endings: Where these choose between forms, `write` takes the ending as its second argument.
        most_cameras: How many cameras such a file holds at most.
        own_world: Whether the first camera may stand elsewhere than in the world's origin.
        folder_from: From how many cameras on it is a folder of files; 0 where it is always one file.
        rectifies: Whether a camera of a pair is written with R and P, so that one alone would lose the other.
        models: The camera models it has.
        says: Its own conventions, in which it differs from ours.
        lacks: What beside `most_cameras` and `own_world` it has no place for.
        example: A small file, where `write` cannot make one.
        rank: Lower ranks are asked first: below 20 by name or first bytes, below 40 by text, then by keys.

    >>> from camviz_clinic.files import formats
    >>> formats()["kitti"].title, formats()["kitti"].lacks
    ('KITTI calib.txt', 'turned cameras, distortion, sizes that differ')
    """

    name: str
    title: str
    file: str
    recognise: Callable[[File], object]
    read: Callable[[File], Calibration]
    write: Callable[..., Content] | None = None
    endings: tuple[str, ...] = ()
    most_cameras: int | None = None
    own_world: bool = False
    folder_from: int = 0
    rectifies: bool = False
    models: str = ""
    says: str = ""
    lacks: str = ""
    example: bytes = b""
    rank: int = 50

    @property
    def holds(self) -> str:
        """How many cameras there is room for, in words; empty where there is no limit."""
        counts = {1: "one camera", 2: "one camera or a pair", None: ""}
        return counts.get(self.most_cameras, f"at most {self.most_cameras} cameras")

    def is_folder(self, calibration: Calibration) -> bool:
        """Whether a calibration is written as a folder."""
        return 0 < self.folder_from <= len(calibration.cameras)

    def content(self, calibration: Calibration, ending: str) -> Content:
        """What is written of a calibration.

        Args:
            calibration: What to write.
            ending: Of the file, such as ".yaml".

        Returns: bytes or dict of str to bytes, of a file, or of the files of a folder by name.
        Raises: CalibrationError for what the format has no place for, and where it is only read.
        """
        if self.write is None:
            raise CalibrationError(f"{self.title} is read here, and not written")
        return self.write(calibration, ending) if self.endings else self.write(calibration)


def chosen(section: Section, key: str, models: Iterable[Model]) -> Model:
    """The one of a format's camera models that a word of the file names."""
    by_name = {model.name: model for model in models}
    return by_name[section.choice(key, list(by_name))]


def coefficients_of(section: Section, key: str, model: Model, first: int) -> tuple[Model, list[float]]:
    """The distortion coefficients under a key, which are the model's parameters from the `first` on, and the model.

    Where a file is mended, a Brown–Conrady model has as many as there are: 4, 5 or 8 in OpenCV's order.
    """
    names = model.names[first:]
    others = (5, 8) if model.lens is BrownConrady else ()
    values = section.coefficients(key, [len(names)], " ".join(names), others)
    if len(values) != len(names):
        model = replace(model, parameters=" ".join([*model.names[:first], *OPENCV_ORDER[: len(values)]]))
    return model, values


def parameters_of(section: Section, model: Model, keys: Mapping[str, str] = NO_KEYS) -> list[float]:
    """A model's parameters, each under its name or the key that `keys` has for it; a missing k or p is 0."""
    held = [(name, keys.get(name, name)) for name in model.names]
    optional = re.compile("[kp][1-6]")
    return [0.0 if optional.fullmatch(name) and key not in section else section.number(key) for name, key in held]


def by_imu(
    cameras: Mapping[str, Camera], imu_from_cam: Sequence[RigidTransform]
) -> tuple[dict[str, Camera], RigidTransform]:
    """Cameras in place by where each stands in the IMU's frame; the world is the first camera's, and world_from_imu."""
    world_from_imu = imu_from_cam[0].inv()
    (first, camera), *others = cameras.items()
    placed = {name: each.at(world_from_imu * pose) for (name, each), pose in zip(others, imu_from_cam[1:], strict=True)}
    return {first: camera} | placed, world_from_imu


def listed(models: Iterable[Model]) -> str:
    """The names of a format's camera models, for Format.models."""
    return ", ".join(dict.fromkeys(model.name for model in models))
