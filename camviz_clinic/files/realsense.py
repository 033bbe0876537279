"""RealSense: librealsense's rs2_intrinsics as JSON, for one stream or several."""

from __future__ import annotations

from collections.abc import Iterator

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, FieldOfView, KannalaBrandt, ModifiedBrownConrady, Perspective
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.models import GRID, Model
from camviz_clinic.files.section import Section, Size, agreed_size
from camviz_clinic.files.trees import shown

TITLE = "RealSense intrinsics"
TERMS = "k1 k2 p1 p2 k3"
MODELS = {  # by librealsense's name and its number
    "none": Model("none", Perspective, GRID),
    "modifiedbrownconrady": Model("modified_brown_conrady", ModifiedBrownConrady, f"{GRID} {TERMS}"),
    "inversebrownconrady": Model("inverse_brown_conrady", ModifiedBrownConrady, f"{GRID} {TERMS}"),
    "ftheta": Model("ftheta", FieldOfView, f"{GRID} omega"),
    "brownconrady": Model("brown_conrady", BrownConrady, f"{GRID} {TERMS}"),
    "kannalabrandt4": Model("kannala_brandt4", KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
}
ASSUMED = (
    "The file names no distortion model: the coefficients of {} are read as those of brown_conrady, k1 k2 p1 p2 k3."
)

INVERSE = (
    "The coefficients of {} bend ideal points, as rs2_project_point_to_pixel has used those of inverse_brown_conrady "
    "since August 2019. Older versions of librealsense straightened pixels with them."
)
NO_COEFFICIENTS = "The file holds no coeffs of {}: it is read without distortion."


def read(file: File) -> Calibration:
    """Each stream as a camera at the origin, under its key."""
    cameras, notes = {}, []
    for name, part in _streams(file.section):
        cameras[name] = _camera(part, file.size)
        if "coeffs" not in part:
            notes.append(NO_COEFFICIENTS.format(name))
        elif any(part.vector("coeffs", [4, 5], "five numbers")) and "model" not in part:
            notes.append(ASSUMED.format(name))
        elif _model(part) is MODELS["inversebrownconrady"] and any(part.vector("coeffs", [4, 5], "five numbers")):
            notes.append(INVERSE.format(name))
    if len(cameras) > 1:
        notes.append("How the streams stand to each other is not read: they are drawn at one place.")
    return Calibration(cameras, file.path, TITLE, notes=tuple(notes))


def is_intrinsics(file: File) -> bool:
    """True where ppx stands beside coeffs or fx, or in a mapping of a mapping."""
    return next(_streams(file.section), None) is not None


def _streams(section: Section, depth: int = 3, name: str = "camera") -> Iterator[tuple[str, Section]]:
    if "ppx" in section and ("coeffs" in section or "fx" in section):
        yield name, section
    elif depth:
        for key, value in section.values.items():
            if isinstance(value, dict):
                yield from _streams(section.section(key), depth - 1, section.part({}, section.path).where(key))


def _camera(part: Section, given: Size | None) -> Camera:
    model = _model(part)
    values = [part.number(key) for key in ("fx", "fy", "ppx", "ppy")]
    coefficients = part.vector("coeffs", [4, 5], "five numbers") if "coeffs" in part else [0.0] * 5
    if model.lens is ModifiedBrownConrady:
        model = _plainest(model, coefficients)
    count = len(model.names) - 4
    if any(coefficients[count:]):
        raise part.error("coeffs", f"{count} numbers for {model.name}, with zeros after them", shown(coefficients))
    size = agreed_size(part.sides("width", "height"), given, "width, height")
    return model.camera([*values, *coefficients[:count], *[0.0] * (count - len(coefficients))], *size, 0.0, part.path)


def _plainest(model: Model, coefficients: list[float]) -> Model:
    """None for the zeros of a stream that the camera has rectified, Brown–Conrady where it comes to the same."""
    k1, k2, p1, p2, *k3 = coefficients
    radial, tangential = any((k1, k2, *k3)), any((p1, p2))
    if radial and tangential:
        return model
    return MODELS["brownconrady" if radial or tangential else "none"]


def _model(part: Section) -> Model:
    """By its name however it is spelled, or its number."""
    word = part.values.get("model", "brown_conrady")
    if isinstance(word, int) and not isinstance(word, bool) and 0 <= word < len(MODELS):
        return list(MODELS.values())[word]
    plain = str(word).lower().replace("_", "").replace(" ", "").split(".")[-1].removeprefix("rs2distortion")
    if plain not in MODELS:
        raise part.error("model", " or ".join(model.name for model in MODELS.values()), shown(word))
    return MODELS[plain]


FORMAT = Format(
    name="realsense",
    title=TITLE,
    file="intrinsics.json",
    recognise=is_intrinsics,
    read=read,
    models="none, brown_conrady, modified_brown_conrady, inverse_brown_conrady, kannala_brandt4, ftheta",
    says="fx fy ppx ppy coeffs model of rs2_intrinsics, alone or by stream; without coeffs no distortion is read",
    example=b'{"color": {"width": 640, "height": 480, "ppx": 318.5, "ppy": 241.25, "fx": 608.75, "fy": 609.5,\n'
    b'  "model": "distortion.brown_conrady", "coeffs": [0.125, -0.25, 0.001, -0.002, 0.0625]}}\n',
    rank=48,
)
