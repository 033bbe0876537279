"""EasyMocap's intri.yml and extri.yml: OpenCV's YAML with the cameras' names in its keys."""

from __future__ import annotations

from collections.abc import Iterator

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.redundancy import Redundancy, between_rotations, compared
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.redundant import is_rotation
from camviz_clinic.files.section import Section, Size, agreed_size, explained, named
from camviz_clinic.files.trees import MAX_KEYS, shown

TITLE = "EasyMocap"
INTRINSICS, EXTRINSICS = "intri.yml", "extri.yml"


def is_easymocap(file: File) -> bool:
    """True where there are names, and a K or a T for the first."""
    names = file.section.values.get("names")
    first = names[0] if isinstance(names, list) and names else None
    return first is not None and any(f"{key}_{first}" in file.section.values for key in ("K", "T"))


def read(file: File) -> Calibration:
    """The cameras in the world of extri.yml, x_cam = Rot x_world + T; at the origin where there is none beside."""
    held = _beside(file, INTRINSICS, "K")
    if not is_easymocap(held):
        raise CalibrationError(f"{INTRINSICS}: expected the cameras' names and a matrix K_ of each")
    intrinsics = held.section
    names = [str(name) for name in intrinsics.values["names"][:MAX_KEYS]]
    cameras = {}
    with named(INTRINSICS):
        for name in names:
            if name in cameras:
                raise intrinsics.error("names", "different names", f"{shown(name)} twice")
            cameras[name] = _camera(intrinsics, name, file.size)
    other = _beside(file, EXTRINSICS, "T")
    known = [name for name in names if is_easymocap(other) and f"T_{name}" in other.section]
    if not known:
        note = f"There is no {EXTRINSICS} of these cameras beside {INTRINSICS}: they are drawn at the origin."
        return Calibration(cameras, file.path, TITLE, notes=(note,))
    with named(EXTRINSICS):
        placed = {name: cameras[name].at(_pose(other.section, name).inv()) for name in known}
        redundant = tuple(each for name in known for each in _redundant(other.section, name))
    notes: tuple[str, ...] = ()
    if lost := [name for name in names if name not in placed]:
        more = f" and {len(lost) - 4} more" * (len(lost) > 4)
        notes = (f"{EXTRINSICS} does not say where {', '.join(lost[:4])}{more} stood: left out.",)
    return Calibration(placed, file.path, TITLE, notes=notes, redundant=redundant)


def _beside(file: File, name: str, key: str) -> File:
    """The one of the two files that has keys such as `K_01`: this one, or the one beside it."""
    names = file.section.values["names"]
    path = file.path.with_name(name)
    return file if f"{key}_{names[0]}" in file.section or not path.is_file() else File(path, file.size, file.mended)


def _camera(section: Section, name: str, given: Size | None) -> Camera:
    size = agreed_size(section.sides(f"W_{name}", f"H_{name}"), given, f"W_{name}, H_{name}")
    key = next((key for key in (f"dist_{name}", f"D_{name}") if key in section), f"dist_{name}")
    K = f"K_{name}"
    with explained(section.where(key)):
        lens = BrownConrady.from_coefficients(section.coefficients(key, [4, 5, 8], "k1 k2 p1 p2 k3"))
    return Camera(section.intrinsics(section.matrix(K, 3, 3), section.where(K), size), lens)


def _pose(section: Section, name: str) -> RigidTransform:
    translation = section.vector(f"T_{name}", [3], "x y z")
    return RigidTransform.from_components(translation, section.rotation(f"Rot_{name}"))


def _redundant(section: Section, name: str) -> Iterator[Redundancy]:
    """The rotation vector beside the matrix."""
    if f"R_{name}" in section and is_rotation(matrix := section.matrix(f"Rot_{name}", 3, 3)):
        vector = section.vector(f"R_{name}", [3], "a rotation vector")
        yield compared(f"R_{name}", f"Rot_{name}", _turned_apart, vector, matrix)


def _turned_apart(vector: Array, matrix: Array) -> dict[str, Array]:
    return between_rotations(Rotation.from_rotvec(vector).as_matrix(), matrix)


FORMAT = Format(
    name="easymocap",
    title=TITLE,
    file="intri.yml and extri.yml",
    recognise=is_easymocap,
    read=read,
    models="4, 5, 8 coefficients of OpenCV",
    says="either file is named; Rot and T: world → camera",
    example=b"""%YAML:1.0
---
names:
  - "01"
K_01: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [880.500, 0.000, 512.250, 0.000, 881.250, 510.750, 0.000, 0.000, 1.000]
dist_01: !!opencv-matrix
  rows: 1
  cols: 5
  dt: d
  data: [-0.260, 0.080, 0.001, -0.002, 0.010]
H_01: 1024
W_01: 1024
""",
    rank=46,
)
