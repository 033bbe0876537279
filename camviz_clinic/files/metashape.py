"""Metashape XML: a camera calibration, or cameras exported with their poses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import expressed
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, Size, agreed_size
from camviz_clinic.files.trees import shown

MODELS = LAYOUTS["metashape"]
TYPES = {"frame": 0, "fisheye": 1, "equidistant_fisheye": 1, "spherical": 2, "cylindrical": 3}
COEFFICIENTS = ("k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4")


def read(file: File) -> Calibration:
    """`<calibration>`: one camera at the origin; `<document>`: every aligned camera in the chunk's frame."""
    if "<calibration>" in file.section:
        calibration = file.section.section("<calibration>")
        kind = calibration.text("projection") if "projection" in calibration else "frame"
        held = calibration.sides("width", "height")
        return Calibration({"camera": _camera(calibration, kind, held, file.size)}, file.path, "Metashape calibration")
    return _read_document(file.section.section("<document>").section("chunk"), file)


def _read_document(chunk: Section, file: File) -> Calibration:
    sensors = {str(sensor.get("id", "a number")): sensor for sensor in chunk.section("sensors").repeated("sensor")}
    shared: dict[str, Camera] = {}
    cameras: dict[str, Camera] = {}
    lost = 0
    for part in _cameras(chunk.section("cameras")):
        if "transform" not in part:
            lost += 1
            continue
        key, name = str(part.get("sensor_id", "a number")), part.text("label")
        if key not in sensors or name in cameras:
            raise part.error("label" if key in sensors else "sensor_id", "one that the file has once", shown(name))
        if key not in shared:
            shared[key] = _sensor(sensors[key], file.size)
        cameras[name] = shared[key].at(part.transform("transform"))
    if not cameras:
        raise CalibrationError("<document>.chunk.cameras: expected a camera with a transform, found none")
    notes = ["The world is the chunk's own frame; its transform to the earth is not applied."]
    notes += [f"{lost} cameras that were not aligned are left out."] * (lost > 0)
    return Calibration(cameras, file.path, "Metashape cameras", notes=tuple(notes))


def _cameras(section: Section) -> Iterator[Section]:
    """Those of a list, and those in its groups."""
    yield from section.repeated("camera")
    for group in section.repeated("group"):
        yield from _cameras(group)


def _sensor(sensor: Section, size: Size | None) -> Camera:
    found = sensor.repeated("calibration")
    adjusted = [part for part in found if part.values.get("class") == "adjusted"] or found
    if not adjusted:
        raise sensor.error("calibration", "a calibration", "none")
    calibration = adjusted[0]
    holder = calibration if "resolution" in calibration else sensor
    held = holder.section("resolution").sides("width", "height") if "resolution" in holder else None
    kind = calibration.text("type") if "type" in calibration else "frame"
    return _camera(calibration, kind, held, size)


def _camera(section: Section, kind: str, held: Size | None, size: Size | None) -> Camera:
    """u = w/2 + cx + x' (f + b1) + y' b2, v = h/2 + cy + y' f, with the first pixel's centre at 0.5."""
    width, height = agreed_size(held, size, "width, height")
    if kind not in TYPES:
        raise section.error("projection", " or ".join(TYPES), shown(kind))
    model, f = MODELS[TYPES[kind]], section.number("f")
    given = {key: section.number(key) if key in section else 0.0 for key in ("cx", "cy", "b1", "b2", *COEFFICIENTS)}
    for key in COEFFICIENTS:
        if given[key] and key not in model.names:
            raise section.error(key, f"0, the {kind} lens here has no {key}", f"{given[key]:g}")
    # its p1 is OpenCV's p2 and the other way round (Metashape manual, appendix "Camera models")
    swapped = {"p1": given["p2"], "p2": given["p1"]}
    centre = {"cx": width / 2 + given["cx"], "cy": height / 2 + given["cy"]}
    values = given | swapped | centre | {"fx": f + given["b1"], "fy": f, "skew": given["b2"]}
    return model.camera([values[name] for name in model.names], width, height, 0.5, section.path)


# Writing.


def write(calibration: Calibration) -> bytes:
    """`<calibration>` for one camera at the origin, otherwise `<document>`."""
    names = list(calibration.cameras)
    first = calibration.cameras[names[0]]
    if len(names) == 1 and np.array_equal(first.world_from_cam.as_matrix(), np.eye(4)):
        kind, elements = _elements(names[0], first)
        lines = [f"<projection>{kind}</projection>"]
        lines += [f"<{key}>{value}</{key}>" for key, value in (_size(first.intrinsics) | elements).items()]
        return _document("calibration", "", lines)
    return _document("document", ' version="2.0.0"', _chunk(calibration))


def _size(grid: Intrinsics) -> dict[str, int]:
    return {"width": grid.width, "height": grid.height}


def _document(root: str, attributes: str, lines: list[str]) -> bytes:
    body = "".join(f"  {line}\n" for line in lines)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<{root}{attributes}>\n{body}</{root}>\n'.encode()


def _elements(name: str, camera: Camera) -> tuple[str, dict[str, Any]]:
    model, same = expressed(name, camera, MODELS, "Metashape")
    grid = same.intrinsics
    held = dict(zip(model.names, model.values(same, 0.5), strict=True))
    f, fx, skew = held.pop("fy"), held.pop("fx"), held.pop("skew")
    cx, cy = held.pop("cx") - grid.width / 2, held.pop("cy") - grid.height / 2
    if "p1" in held:
        held["p1"], held["p2"] = held["p2"], held["p1"]
    elements = {"f": f, "cx": cx, "cy": cy, "b1": fx - f, "b2": skew} | held
    return model.name, {key: repr(value) for key, value in elements.items()}


def _chunk(calibration: Calibration) -> list[str]:
    sensors: dict[object, int] = {}
    sensor_lines, camera_lines = [], []
    for index, (name, camera) in enumerate(calibration.cameras.items()):
        key = (camera.intrinsics, camera.lens)
        if key not in sensors:
            sensors[key] = len(sensors)
            sensor_lines += _sensor_lines(sensors[key], name, camera)
        numbers = " ".join(repr(float(x)) for x in camera.world_from_cam.as_matrix().ravel())
        start = f'<camera id="{index}" sensor_id="{sensors[key]}" label={quoteattr(name)}>'
        camera_lines.append(f"{start}<transform>{numbers}</transform></camera>")
    return ["<chunk>", "<sensors>", *sensor_lines, "</sensors>", "<cameras>", *camera_lines, "</cameras>", "</chunk>"]


def _sensor_lines(number: int, name: str, camera: Camera) -> list[str]:
    kind, elements = _elements(name, camera)
    size = f'<resolution width="{camera.intrinsics.width}" height="{camera.intrinsics.height}"/>'
    numbers = "".join(f"<{key}>{value}</{key}>" for key, value in elements.items())
    return [
        f'<sensor id="{number}" label="sensor {number}" type="{kind}">{size}',
        f'<calibration type="{kind}" class="adjusted">{size}{numbers}</calibration></sensor>',
    ]


FORMAT = Format(
    name="metashape",
    title="Metashape",
    file="camera.xml",
    recognise=lambda file: "<calibration>" in file.section or "<document>" in file.section,
    read=read,
    write=write,
    own_world=True,
    models="frame, fisheye, spherical, cylindrical",
    says="one camera or cameras in place; cx, cy from the middle of the image, first pixel's centre at 0.5; "
    "f = fy, b1 = fx − fy, b2 = skew; p1 and p2 the other way round",
    lacks="rational, prism and tilt coefficients",
)
