"""`load`: which program wrote this file, and what does it say?"""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

from camviz.calibration.types import Calibration, CalibrationError
from camviz.files.format import File, Format
from camviz.files.guessing import looks_like
from camviz.files.registry import formats
from camviz.files.section import LARGEST_SIDE, MissingSizeError, Size, named
from camviz.files.text import refuse_no_file
from camviz.files.trees import shown

ANY_SIZE = (640, 480)  # to see whether anything but the size is wrong with a file


def load(path: str | PathLike[str], *, size: Size | None = None, mend: bool = False) -> Calibration:
    """Read a calibration of one of the formats that docs/formats.md lists; its content tells which.

    A COLMAP model may be named by its folder. `size` is (width, height) in pixels, for files that do not hold it. With
    `mend` a fault that has an obvious cure, such as a transposed K, is cured, and listed in the calibration's
    `faults`. Raises CalibrationError, a ValueError whose message is one sentence, for everything that is not such a
    calibration. The file is data: nothing in it is run.
    """
    file = File(Path(path), None if size is None else _checked_size(size), [] if mend else None)
    refuse_no_file(file.path)
    with named(file.path):
        calibration = _plausible(_read(file))
    return replace(calibration, faults=tuple(file.mended)) if file.mended else calibration


def format_of(file: File) -> Format:
    """The format of a file or folder; CalibrationError saying what it looks like where none knows it."""
    try:
        for format in sorted(formats().values(), key=lambda format: format.rank):
            if format.recognise(file):
                return format
        keys = [shown(key) for key in list(file.section.values)[:6]]
        found = ", ".join(keys + ["…"] * (len(file.section.values) > 6)) or "nothing"
        problem = f"no camera found: looked for the keys of the formats below; found {found}"
    except CalibrationError as error:
        problem = str(error)
    known = ", ".join(formats())
    raise CalibrationError(f"{problem} (this looks like {looks_like(file.text)}; what is read: {known})")


def _read(file: File) -> Calibration:
    """The calibration of a file; where its size is missing and something else is wrong too, that comes first."""
    format = format_of(file)
    try:
        return format.read(file)
    except MissingSizeError:
        format.read(replace(file, size=ANY_SIZE))
        raise


def _plausible(calibration: Calibration) -> Calibration:
    """The calibration, unless a focal length is so far out that no drawing of it could mean anything."""
    for name, camera in calibration.cameras.items():
        for axis in ("fx", "fy"):
            focal_length = getattr(camera.intrinsics, axis)
            if not 1e-3 <= focal_length <= 1e9:
                raise CalibrationError(f"{name}: expected {axis} from 0.001 to 1e9 pixels, got {focal_length:g}")
    return calibration


def _checked_size(size: Size) -> Size:
    if len(size) != 2 or not all(isinstance(side, int) and 1 <= side <= LARGEST_SIDE for side in size):
        raise CalibrationError(
            f"size: expected (width, height), each from 1 to {LARGEST_SIDE} pixels, got {shown(size)}"
        )
    return size
