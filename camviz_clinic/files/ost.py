"""ost.txt and .ini of ROS's camera_calibration: a name on one line and its numbers on the next."""

from __future__ import annotations

import re
from typing import Any

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.ros import rectification, stereo_note
from camviz_clinic.files.section import Section, agreed_size, explained
from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import scalar

TITLE = "ROS ost.txt"
MAX_LINES = 1000
MOST_WORDS = 64
NAMES = ("width", "height", "camera matrix", "distortion", "rectification", "projection", "translation", "rotation")
FOUR = "Four numbers of distortion are k1 k2 k3 k4 of a fisheye: for others camera_calibration writes five or eight."
_START = re.compile(r"^(?:camera matrix|\[image\])[ \t]*\r?$", re.MULTILINE)


def read(file: File) -> Calibration:
    """One camera at the origin; where P tells of a stereo pair, a note gives the baseline."""
    section, name = _lines(file)
    size = agreed_size(section.sides("width", "height"), file.size, "width, height")
    grid = section.intrinsics(section.matrix("camera matrix", 3, 3), "camera matrix", size)
    values = section.vector("distortion", [4, 5, 8], "k1 k2 p1 p2 k3", "coefficient-count")
    notes = [FOUR] if len(values) == 4 else []
    with explained("distortion"):
        lens = KannalaBrandt(*values) if len(values) == 4 else BrownConrady.from_coefficients(values)
    if "projection" in section:
        notes += stereo_note(section, "projection")
    camera = Camera(grid, lens)
    matrices = rectification(section, name, camera, ("rectification",), ("projection",))
    return Calibration({name: camera}, file.path, TITLE, notes=tuple(notes), rectifications=matrices)


def _lines(file: File) -> tuple[Section, str]:
    """The numbers under each name, row by row, and the camera's name, which stands in brackets."""
    if file.text.count("\n") > MAX_LINES:
        raise CalibrationError(f"expected at most {MAX_LINES} lines, got {file.text.count(chr(10)):,}")
    rows: dict[str, list[Any]] = {}
    camera, key = "camera", ""
    for line in file.text.splitlines():
        line = line.strip()
        if line in NAMES:
            key = line
            rows[key] = []
        elif line.startswith("[") and line.endswith("]"):
            key, inside = "", line[1:-1]
            camera = inside if inside and inside not in ("image", "externals") else camera
        elif key and line and not line.startswith(("#", ";")):
            rows[key] += [scalar(word) for word in line.split(maxsplit=MOST_WORDS)]
    return Section(rows, mended=file.mended), camera


FORMAT = Format(
    name="ost",
    title=TITLE,
    file="ost.txt or .ini",
    recognise=lambda file: _START.search(file.text, 0, HEAD),
    read=read,
    models="5, 8 coefficients; 4 of a fisheye",
    says="P[0,3] = −fx B, read as a note",
    example=b"""# oST version 5.0 parameters


[image]

width
640

height
480

[narrow_stereo]

camera matrix
500.5 0.0 321.25
0.0 499.75 238.5
0.0 0.0 1.0

distortion
-0.21 0.13 0.0015 -0.0005 0.01

rectification
1.0 0.0 0.0
0.0 1.0 0.0
0.0 0.0 1.0

projection
480.0 0.0 320.0 0.0
0.0 480.0 240.0 0.0
0.0 0.0 1.0 0.0
""",
    rank=33,
)
