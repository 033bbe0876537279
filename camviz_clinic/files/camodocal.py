"""camodocal's camera files, which VINS-Mono, VINS-Fusion and their kin read: one camera under `model_type`."""

from __future__ import annotations

from typing import Any

from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format, chosen, listed, parameters_of
from camviz_clinic.files.models import expressed
from camviz_clinic.files.opencv import image_size
from camviz_clinic.files.output import as_opencv
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import Section

TITLE = "camodocal camera"
MODELS = LAYOUTS["camodocal"]
PARTS = ("mirror_parameters", "distortion_parameters", "projection_parameters")
MEI = {"fx": "gamma1", "fy": "gamma2", "cx": "u0", "cy": "v0"}
KANNALA_BRANDT = {"fx": "mu", "fy": "mv", "cx": "u0", "cy": "v0", "k1": "k2", "k2": "k3", "k3": "k4", "k4": "k5"}
KEYS = {"MEI": MEI, "KANNALA_BRANDT": KANNALA_BRANDT}


def read(file: File) -> Calibration:
    """The camera at the origin. Which of its mappings holds a parameter makes no difference."""
    section = file.section
    model = chosen(section, "model_type", MODELS)
    held: dict[str, Any] = {}
    for part in PARTS:
        held |= section.section(part).values if part in section else {}
    values = parameters_of(Section(held, section.where(PARTS[-1])), model, KEYS.get(model.name, {}))
    camera = model.camera(values, *image_size(section, file.size), 0.0, PARTS[-1])
    name = section.text("camera_name") if isinstance(section.values.get("camera_name"), str) else "camera"
    return Calibration({name or "camera": camera}, file.path, TITLE)


def write(calibration: Calibration) -> bytes:
    """One camera under the keys of its model."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    keys = KEYS.get(model.name, {})
    held = {key: (keys.get(key, key), value) for key, value in zip(model.names, model.values(same, 0.0), strict=True)}
    mirror = dict([held.pop("xi")]) if "xi" in held else {}
    projection = dict(held.pop(key) for key in ("fx", "fy", "cx", "cy"))
    distortion = dict(held.values())
    if model.name == "KANNALA_BRANDT":
        projection, distortion = distortion | projection, {}
    tree: dict[str, Any] = {"model_type": model.name, "camera_name": name}
    tree |= {"image_width": camera.intrinsics.width, "image_height": camera.intrinsics.height}
    held_parts = zip(PARTS, (mirror, distortion, projection), strict=True)
    return as_opencv(tree | {part: values for part, values in held_parts if values})


FORMAT = Format(
    name="camodocal",
    title=TITLE,
    file="camera.yaml",
    recognise=lambda file: "model_type" in file.section and "projection_parameters" in file.section,
    read=read,
    write=write,
    most_cameras=1,
    models=listed(MODELS),
    says="VINS reads it too; KANNALA_BRANDT counts k2 … k5 where OpenCV counts k1 … k4",
    lacks="skew, k3 (but for PINHOLE_FULL)",
    rank=44,
)
