"""Bundle Adjustment in the Large: cameras that look along -z, with one focal length, k1 and k2."""

from __future__ import annotations

import re

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.poses import OPENGL, RigidTransform, Rotation
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import Model
from camviz_clinic.files.section import Section, agreed_size
from camviz_clinic.files.trees import MAX_KEYS, scalar

TITLE = "BAL problem"
MODEL = Model("BAL", BrownConrady, "f cx cy k1 k2")
_START = re.compile(r"[ \t]*[0-9]{1,9}[ \t]+[0-9]{1,9}[ \t]+[0-9]{1,9}[ \t]*\r?\n\s*[0-9]+[ \t]+[0-9]+[ \t]+[-+.0-9]")
COUNTS = "cameras points observations"


def read(file: File) -> Calibration:
    """P = R X + t, p = -P / P_z, and f (1 + k1 |p|² + k2 |p|⁴) p from the middle of an image whose y goes up."""
    width, height = agreed_size(None, file.size, "a BAL problem never does")
    lines = file.text.split("\n", 1)
    counts = Section({"first line": [scalar(word) for word in lines[0].split()]}).vector("first line", [3], COUNTS)
    cameras, observations = int(counts[0]), int(counts[2])
    if not 1 <= cameras <= MAX_KEYS:
        raise CalibrationError(f"expected from 1 to {MAX_KEYS:,} cameras, got {cameras:,}")
    words = lines[1].split(maxsplit=min(4 * observations + 9 * cameras, len(lines[1])))
    words = words[4 * observations : 4 * observations + 9 * cameras]
    if len(words) < 9 * cameras:
        raise CalibrationError(
            f"expected 9 numbers for each of {cameras:,} cameras after the observations, got {len(words):,}"
        )
    held = {}
    for index in range(cameras):
        numbers = Section({f"camera{index}": [scalar(word) for word in words[9 * index : 9 * index + 9]]})
        held[f"camera{index}"] = _camera(numbers.vector(f"camera{index}", [9], "r t f k1 k2"), width, height)
    notes = ("The world has no unit of its own: lengths are in the file's.",)
    return Calibration(held, file.path, TITLE, notes=notes)


def _camera(numbers: list[float], width: int, height: int) -> Camera:
    f, k1, k2 = numbers[6:]
    camera = MODEL.camera([f, (width - 1) / 2, (height - 1) / 2, k1, k2], width, height, 0.0, "camera")
    pose = RigidTransform.from_components(numbers[3:6], Rotation.from_rotvec(numbers[:3]))
    return camera.at((OPENGL * pose).inv())


FORMAT = Format(
    name="bal",
    title=TITLE,
    file="problem.txt",
    recognise=lambda file: _START.match(file.text),
    read=read,
    models="f k1 k2",
    says="principal point in the middle of the image; axes of OpenGL: y and z negated; no unit; holds no image size",
    example=b"2 1 2\n0 0 12.5 -3.25\n1 0 10.5 -3.75\n"
    b"0.1\n-0.2\n0.3\n0.5\n-1.0\n-2.0\n500.5\n-0.01\n0.002\n"
    b"0.1\n-0.1\n0.3\n0.25\n-1.0\n-2.0\n499.5\n-0.02\n0.003\n0.5\n0.25\n-9.0\n",
    rank=36,
)
