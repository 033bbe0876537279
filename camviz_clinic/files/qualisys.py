"""Qualisys Track Manager's calibration as text or XML: a camera each, in lengths of 1/64 pixel and millimetres."""

from __future__ import annotations

import re

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz.poses import OPENGL, RigidTransform
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import Model
from camviz_clinic.files.section import Section, Size, agreed_size, as_size
from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import shown

TITLE = "Qualisys QTM calibration"
SUBPIXELS = 64  # of a pixel: its unit for all that is measured on the sensor
NARROWEST = 200  # pixels: no sensor of Qualisys has fewer columns
MODEL = Model("QTM", BrownConrady, "fx fy cx cy skew k1 k2 p1 p2 k3")
TURNED = (
    "{} is mounted on its side or upside down (viewrotation {}): its numbers are of the picture as the sensor sees it."
)
UNIT = "Where a pixel's centre is, the file does not say: the first one's is taken to be at (0, 0)."
_START = re.compile(r"<intrinsic\b[^>]*\bcenterPointU\s*=")


def read(file: File) -> Calibration:
    """The cameras that are calibrated, by serial number, in QTM's world."""
    cameras: dict[str, Camera] = {}
    notes, lost = [UNIT], []
    for part in file.section.section("<calibration>").section("cameras").repeated("camera"):
        name = str(part.get("serial", "the camera's serial number"))
        if name in cameras:
            raise part.error("serial", "a number that the file has once", shown(name))
        if part.values.get("calibrated") is False or "intrinsic" not in part or "transform" not in part:
            lost.append(name)
            continue
        cameras[name] = _camera(part, file.size).at(_world_from_cam(part.section("transform")))
        turn = part.number("viewrotation") if "viewrotation" in part else 0
        if turn:
            notes.append(TURNED.format(name, f"{turn:g}"))
    if not cameras:
        raise CalibrationError("expected at least one calibrated camera with <transform> and <intrinsic>, found none")
    if lost:
        notes.append(f"{', '.join(lost[:4])} was not calibrated and is left out.")
    return Calibration(cameras, file.path, TITLE, notes=tuple(notes))


def _camera(part: Section, given: Size | None) -> Camera:
    """u = (focalLengthU x + centerPointU) / 64 - left, in the window of the sensor that <fov_video> names."""
    intrinsic = part.section("intrinsic")
    if (rightmost := intrinsic.number("sensorMaxU")) < SUBPIXELS * NARROWEST:
        expected = f"1/64 px, {SUBPIXELS * NARROWEST} or more (Theia's file, which is in pixels, is not read)"
        raise intrinsic.error("sensorMaxU", expected, f"{rightmost:g}")
    window = part.section("fov_video") if "fov_video" in part else _sensor(intrinsic)
    left, top, right, bottom = (window.number(key) for key in ("left", "top", "right", "bottom"))
    size = agreed_size(as_size(right - left + 1, bottom - top + 1, window.path), given, "fov_video")
    lengths = ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV", "skew")
    fx, fy, cx, cy, skew = (intrinsic.number(key) / SUBPIXELS for key in lengths)
    k1, k2, k3 = (intrinsic.number(f"radialDistortion{number}") for number in (1, 2, 3))
    p1, p2 = (intrinsic.number(f"tangentalDistortion{number}") for number in (1, 2))  # it is spelled so
    return MODEL.camera([fx, fy, cx - left, cy - top, skew, k1, k2, p1, p2, k3], *size, 0.0, intrinsic.path)


def _sensor(intrinsic: Section) -> Section:
    """The whole sensor in pixels, from its least and greatest 1/64."""
    keys = {"left": "sensorMinU", "top": "sensorMinV", "right": "sensorMaxU", "bottom": "sensorMaxV"}
    sides = {side: intrinsic.number(key) // SUBPIXELS for side, key in keys.items()}
    return intrinsic.part(sides, intrinsic.path)


def _world_from_cam(transform: Section) -> RigidTransform:
    """x y z is where the camera stands; the rows of r are its axes, x right, y up, z backward."""
    rows = [[transform.number(f"r{row}{column}") for column in (1, 2, 3)] for row in (1, 2, 3)]
    turn = transform.part({"r": rows}, transform.path).rotation("r")
    place = [transform.number(axis) / 1000 for axis in "xyz"]
    return RigidTransform.from_components(place, (OPENGL * RigidTransform.from_rotation(turn)).inv().rotation)


FORMAT = Format(
    name="qualisys",
    title=TITLE,
    file="calibration.qca.txt",
    recognise=lambda file: _START.search(file.text, 0, HEAD),
    read=read,
    models="k1 k2 k3, p1 p2, skew",
    says="lengths on the sensor in 1/64 px, less left and top of `fov_video`; coefficients are not divided; "
    "x y z: where the camera stands, in mm; rows of r: its axes, x right, y up, z backward",
    example=b"""<?xml version="1.0" encoding="UTF-8"?>
<calibration created="2024-01-31 12:00:00" qtm-version="2023.3 (build 1)" type="regular">
 <results std-dev="0.6" min-max-diff="1.2"/>
 <cameras>
  <camera active="1" calibrated="true" serial="21001" model="Miqus Video" viewrotation="0">
   <fov_video left="64" top="32" right="1855" bottom="1055"/>
   <fov_video_max left="0" top="0" right="1919" bottom="1087"/>
   <transform x="1500.0" y="-2000.0" z="1750.0" r11="0.8" r12="0.6" r13="0.0"
     r21="-0.36" r22="0.48" r23="0.8" r31="0.48" r32="-0.64" r33="0.6"/>
   <intrinsic focallength="9.25" sensorMinU="0.0" sensorMaxU="122879.0" sensorMinV="0.0" sensorMaxV="69631.0"
     focalLengthU="107584.0" focalLengthV="107592.0" centerPointU="60848.0" centerPointV="34176.0" skew="16.0"
     radialDistortion1="-0.046" radialDistortion2="0.14" radialDistortion3="0.003"
     tangentalDistortion1="0.0006" tangentalDistortion2="-0.0004"/>
  </camera>
  <camera active="0" calibrated="false" serial="21002" model="Miqus M3" viewrotation="0"/>
 </cameras>
</calibration>
""",
    rank=35,
)
