"""mrcal's .cameramodel: a Python literal with one lens, one pose and what they were made from."""

from __future__ import annotations

import re

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format, listed
from camviz_clinic.files.literal import parse_literal
from camviz_clinic.files.models import expressed, model_named
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.section import COUNT, Section, agreed_size
from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import shown

TITLE = "mrcal cameramodel"
MODELS = LAYOUTS["mrcal"]
POSES = ("rt_cam_ref", "extrinsics")  # the second until mrcal 2.4
_KEY = re.compile(r"""(?:\s|#[^\n]*\n)*\{(?:\s|#[^\n]*\n)*['"](?:lensmodel|[a-z_]+)['"]\s*:""")


def is_model(file: File) -> bool:
    """True for a .cameramodel, and for a literal that names a lens model."""
    head = file.text[:HEAD]
    named = file.path.suffix == ".cameramodel" or re.search(r"""['"]lensmodel['"]\s*:""", head)
    return bool(named and _KEY.match(head))


def read(file: File) -> Calibration:
    """One camera in mrcal's reference frame: [r t] takes points from it to the camera."""
    section = file.mapping(parse_literal(file.text))
    name = section.text("lensmodel")
    model = model_named(name, MODELS)
    if model is None:
        raise section.error("lensmodel", f"one of {listed(MODELS)}, the ones there is a lens for here", shown(name))
    size = agreed_size(section.size("imagersize"), file.size, "imagersize")
    values = section.vector("intrinsics", [len(model.names)], model.parameters, COUNT)
    camera = model.camera(values, *size, 0.0, section.where("intrinsics"))
    key = next((key for key in POSES if key in section), POSES[0])
    rt = section.vector(key, [6], "rotation vector and translation") if key in section else [0.0] * 6
    cam_from_world = RigidTransform.from_components(rt[3:], Rotation.from_rotvec(rt[:3]))
    placed = {"camera": camera.at(cam_from_world.inv())}
    return Calibration(placed, file.path, TITLE, notes=_notes(section))


def _notes(section: Section) -> tuple[str, ...]:
    kept = [key for key in ("valid_intrinsics_region", "optimization_inputs") if key in section]
    return (f"{' and '.join(kept)}: passed over, mrcal alone makes use of it.",) if kept else ()


def write(calibration: Calibration) -> bytes:
    """The literal, with `extrinsics`, which every mrcal reads."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    grid, pose = camera.intrinsics, camera.cam_from_world
    rt = [float(x) for x in (*pose.rotation.as_rotvec(), *pose.translation)]
    lines = [
        f"'lensmodel':  '{model.name}',",
        f"# {model.parameters}",
        f"'intrinsics': {model.values(same, 0.0)},",
        "# rt_cam_ref: from the reference frame to the camera",
        f"'extrinsics': {rt},",
        f"'imagersize': [{grid.width}, {grid.height}],",
    ]
    return ("{\n" + "".join(f"    {line}\n" for line in lines) + "}\n").encode()


FORMAT = Format(
    name="mrcal",
    title=TITLE,
    file="camera.cameramodel",
    recognise=is_model,
    read=read,
    write=write,
    most_cameras=1,
    own_world=True,
    models=listed(MODELS).replace("LENSMODEL_", ""),
    says="[r t] from the reference to the camera (`extrinsics`, `rt_cam_ref`)",
    lacks="skew, tilt",
    rank=30,
)
