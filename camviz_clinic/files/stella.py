"""stella_vslam's and OpenVSLAM's configuration: one camera under Camera, or under keys that begin with `Camera.`."""

from __future__ import annotations

from math import pi
from typing import Any

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Equirectangular
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format, parameters_of
from camviz_clinic.files.models import expressed
from camviz_clinic.files.output import as_yaml
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section, agreed_size

TITLE = "stella_vslam configuration"
MODELS = LAYOUTS["stella"]
NAMES = [*(model.name for model in MODELS), "equirectangular"]


def is_configuration(file: File) -> bool:
    """True where Camera has a model and a setup, as a mapping or with dots."""
    held = file.section.values.get("Camera")
    return "Camera.model" in file.section or (isinstance(held, dict) and "model" in held)


def read(file: File) -> Calibration:
    """The camera at the origin; the baseline of a rectified pair is a note."""
    part = _camera_section(file.section)
    size = agreed_size(part.sides("cols", "rows"), file.size, "Camera.cols, Camera.rows")
    name = part.choice("model", NAMES)
    if name == NAMES[-1]:
        grid = Intrinsics(*size, size[0] / (2 * pi), size[1] / pi, size[0] / 2, size[1] / 2)
        camera = Camera(grid, Equirectangular())
    else:
        model = next(model for model in MODELS if model.name == name)
        camera = model.camera(parameters_of(part, model), *size, 0.0, part.path)
    label = part.values.get("name")
    notes = []
    if "focal_x_baseline" in part and part.number("focal_x_baseline"):
        baseline = part.number("focal_x_baseline") / camera.intrinsics.fx
        notes.append(f"These are rectified pictures; the other camera of the pair is {baseline:.4g} m to the right.")
    return Calibration(
        {label if isinstance(label, str) and label else "camera": camera}, file.path, TITLE, notes=tuple(notes)
    )


def _camera_section(section: Section) -> Section:
    if "Camera.model" not in section:
        return section.section("Camera")
    dotted = {key.removeprefix("Camera."): value for key, value in section.values.items() if key.startswith("Camera.")}
    return section.part(dotted, "Camera")


def write(calibration: Calibration) -> bytes:
    """The part Camera of a configuration, for one camera alone."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    part: dict[str, Any] = {"name": name, "setup": "monocular", "model": model.name}
    part |= dict(zip(model.names, model.values(same, 0.0), strict=True))
    part |= {"cols": camera.intrinsics.width, "rows": camera.intrinsics.height}
    return as_yaml({"Camera": part})


FORMAT = Format(
    name="stella",
    title=TITLE,
    file="config.yaml",
    recognise=is_configuration,
    read=read,
    write=write,
    most_cameras=1,
    models="perspective, fisheye; equirectangular is read too",
    says="OpenVSLAM's too; the part Camera; focal_x_baseline is read as a note",
    lacks="skew",
    rank=43,
)
