"""Stereolabs' SN….conf of a ZED camera: a pair, with its intrinsics once for each resolution."""

from __future__ import annotations

import re

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, parameters_of
from camviz_clinic.files.models import Model
from camviz_clinic.files.section import Section, Size, explained
from camviz_clinic.files.tables import parse_ini
from camviz_clinic.files.text import HEAD

TITLE = "ZED .conf"
MODEL = Model("ZED", BrownConrady, "fx fy cx cy k1 k2 p1 p2 k3")
SIZES = {
    "2k": (2208, 1242),
    "fhd": (1920, 1080),
    "fhd1200": (1920, 1200),
    "qhdplus": (3200, 1800),
    "hd": (1280, 720),
    "svga": (960, 600),
    "vga": (672, 376),
}
_START = re.compile(r"^[ \t]*\[LEFT_CAM_\w+\]", re.MULTILINE)


def read(file: File) -> Calibration:
    """The pair at the size given, or at the largest of which the file has intrinsics.

    zed-open-capture hands R = (RX, CV, RZ) and T = (Baseline, TY, TZ) to cv2.stereoRectify, which rectifies alike for
    -T; the right camera stands to the right, so X_right = R X_left - T, in metres.
    """
    section = file.mapping(parse_ini(file.text))
    known = [name for name in SIZES if f"left_cam_{name}" in section and f"right_cam_{name}" in section]
    if not known:
        raise CalibrationError(f"expected [LEFT_CAM_…] and [RIGHT_CAM_…] of {', '.join(SIZES)}, found none")
    name = _chosen(known, file.size)
    left, right = (_camera(section.section(f"{side}_cam_{name}"), SIZES[name]) for side in ("left", "right"))
    pose = _right_from_left(section.section("stereo"), name) if "stereo" in section else RigidTransform.identity()
    others = ", ".join(_shown(other) for other in known if other != name)
    notes = [f"Read at {_shown(name)}; the file has intrinsics for {others} too (--size)."] if others else []
    if "stereo" not in section:
        notes.append("The file holds no [STEREO]: both cameras are drawn at the same place.")
    return Calibration({"left": left, "right": right.at(pose.inv())}, file.path, TITLE, notes=tuple(notes))


def _chosen(known: list[str], size: Size | None) -> str:
    if size is None:
        return max(known, key=lambda name: SIZES[name])
    fitting = [name for name in known if SIZES[name] == size]
    if not fitting:
        raise CalibrationError(f"size: expected one of {', '.join(map(_shown, known))}, got {size[0]}×{size[1]}")
    return fitting[0]


def _shown(name: str) -> str:
    return "{}×{}".format(*SIZES[name])


def _camera(section: Section, size: Size) -> Camera:
    return MODEL.camera(parameters_of(section, MODEL), *size, 0.0, section.path)


def _right_from_left(stereo: Section, name: str) -> RigidTransform:
    """In metres, from millimetres; TY and TZ stand there once, or for each resolution."""
    translation = [stereo.number(_key(stereo, key, name)) for key in ("baseline", "ty", "tz")]
    turn = [stereo.number(f"{key}_{name}") for key in ("rx", "cv", "rz")]
    with explained(stereo.path):
        return RigidTransform.from_components([-x / 1000 for x in translation], Rotation.from_rotvec(turn))


def _key(stereo: Section, key: str, name: str) -> str:
    return f"{key}_{name}" if f"{key}_{name}" in stereo else key


FORMAT = Format(
    name="zed",
    title=TITLE,
    file="SN12345.conf",
    recognise=lambda file: _START.search(file.text, 0, HEAD),
    read=read,
    models="k1 k2 p1 p2 k3",
    says="a pair, in the largest size or the one given; X_right = R(RX, CV, RZ) X_left − (Baseline, TY, TZ) / 1000",
    example=b"[LEFT_CAM_HD]\nfx=534.25\nfy=534.125\ncx=639.5\ncy=368.25\nk1=-0.059\nk2=0.0358\np1=-0.0003\np2=-0.0001\n"
    b"k3=-0.0145\n[RIGHT_CAM_HD]\nfx=533.5\nfy=533.25\ncx=631.0\ncy=371.75\nk1=-0.064\nk2=0.0436\np1=-0.0004\n"
    b"p2=-0.0006\nk3=-0.018\n[STEREO]\nBaseline=120.0\nTY=0.1\nTZ=-0.2\nCV_HD=-0.003\nRX_HD=0.0036\nRZ_HD=-0.001\n",
    rank=32,
)
