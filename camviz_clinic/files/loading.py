"""`load`: which program wrote this file, and what does it say?"""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.guessing import looks_like
from camviz_clinic.files.registry import formats
from camviz_clinic.files.section import LARGEST_SIDE, MissingSizeError, Size, named
from camviz_clinic.files.text import refuse_no_file
from camviz_clinic.files.trees import shown

ANY_SIZE = (640, 480)  # to see whether anything but the size is wrong with a file


def load(path: str | PathLike[str], *, size: Size | None = None, mend: bool = False) -> Calibration:
    r"""Read a calibration of one of the formats that docs/formats.md lists; its content tells which.

    The file is data: nothing in it is run.

    Args:
        path: The file. A COLMAP model may be named by its folder.
        size: tuple of int, width and height in pixels, for files that do not hold them.
        mend: Cure faults that have an obvious cure, such as a transposed K, and list them in `Calibration.faults`.

    Returns: The cameras in place, and what else the file holds.

    Raises:
        CalibrationError: For everything that is not such a calibration. It is a ValueError, and its message is one
            sentence.

    >>> from pathlib import Path
    >>> rows = "P0: 700 0 600 0 0 700 180 0 0 0 1 0", "P1: 700 0 600 -350 0 700 180 0 0 0 1 0"
    >>> _ = Path("calib.txt").write_text("\n".join(rows))
    >>> pair = load("calib.txt", size=(1242, 375))
    >>> f"{pair.format}: {', '.join(pair.cameras)}, {pair.cameras['P1'].centre[0]} m apart"  # 350/700
    'KITTI calib.txt: P0, P1, 0.5 m apart'
    """
    file = File(Path(path), None if size is None else _checked_size(size), [] if mend else None)
    refuse_no_file(file.path)
    with named(file.path):
        calibration = _plausible(_read(file))
    return replace(calibration, faults=tuple(file.mended)) if file.mended else calibration


def format_of(file: File) -> Format:
    """The format of a file or folder.

    Args:
        file: What is to be read.

    Returns: The first one that recognises it.
    Raises: CalibrationError where none knows it: it says what the file looks like.

    >>> from pathlib import Path
    >>> _ = Path("calib.txt").write_text("P0: 700 0 600 0 0 700 180 0 0 0 1 0")
    >>> format_of(File(Path("calib.txt"))).name
    'kitti'
    """
    try:
        candidates = [format for format in formats().values() if format.folder_from or not file.path.is_dir()]
        for format in sorted(candidates, key=lambda format: format.rank):
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
