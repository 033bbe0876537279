"""Gyroflow's lens profiles: one camera with cv2.fisheye's model, or one of a few others."""

from __future__ import annotations

from dataclasses import replace
from math import atan, degrees, hypot
from typing import Any

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt, Perspective, UnifiedSphere
from camviz_clinic.calibration.line_delay import LineDelay
from camviz_clinic.calibration.stamp import Stamp, word
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format, listed
from camviz_clinic.files.models import GRID, Model, expressed
from camviz_clinic.files.output import as_json
from camviz_clinic.files.section import Section, Size, agreed_size

TITLE = "Gyroflow lens profile"
FISHEYE = Model("opencv_fisheye", KannalaBrandt, f"{GRID} k1 k2 k3 k4")
STANDARD = Model("opencv_standard", BrownConrady, f"{GRID} k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4")
PINHOLE = Model("opencv_fisheye", Perspective, GRID)  # of which four zeros are one
SPHERE = Model("insta360", UnifiedSphere, f"{GRID} k1 k2 p1 p2 xi")
READ = [
    FISHEYE,
    STANDARD,
    Model("poly3", BrownConrady, f"{GRID} k1"),
    Model("poly5", BrownConrady, f"{GRID} k1 k2"),
    SPHERE,
]
MODELS = [PINHOLE, FISHEYE, STANDARD, SPHERE]
MOST_COEFFICIENTS = 12
DIRECTIONS = {
    "TopToBottom": "from the top",
    "BottomToTop": "from the bottom",
    "LeftToRight": "from the left",
    "RightToLeft": "from the right",
}


def is_profile(file: File) -> bool:
    """True where fisheye_params stands beside calib_dimension."""
    return "fisheye_params" in file.section and "calib_dimension" in file.section


def read(file: File) -> Calibration:
    """The camera that takes pictures of calib_dimension, as Gyroflow projects with it, at the origin."""
    profile = file.section
    _refuse_digital_lens(profile)
    held, size = profile.section("fisheye_params"), _size(profile.section("calib_dimension"), file.size)
    solved = held.intrinsics(held.matrix("camera_matrix", 3, 3), held.where("camera_matrix"), size)
    if solved.skew:
        raise held.error("camera_matrix", "no skew, which Gyroflow does not use", f"{solved.skew:g}")
    grid = _used(profile, solved)
    camera = _camera(profile, held, grid)
    notes = (*_centre(solved, grid), *_recording(profile), *_rows(profile), *_limits(profile, held))
    stamps, delay = {"camera": _stamp(profile)}, _line_delay(profile, grid.height)
    delays = {} if delay is None else {"camera": delay}
    return Calibration({"camera": camera}, file.path, TITLE, notes=notes, stamps=stamps, line_delays=delays)


def _refuse_digital_lens(profile: Section) -> None:
    if profile.values.get("digital_lens") in (None, ""):
        return
    name = profile.text("digital_lens")
    expected = "none, as no lens here warps the picture once more in the camera"
    raise profile.error("digital_lens", expected, name)


def _size(section: Section, given: Size | None) -> Size:
    return agreed_size(section.sides("w", "h"), given, "calib_dimension")


def _used(profile: Section, solved: Intrinsics) -> Intrinsics:
    """Of the solution what Gyroflow projects with: cx and cy only where it is asymmetrical, fx and fy over the crop."""
    crop = profile.number("crop") if "crop" in profile else 1.0
    if not crop > 0:
        raise profile.error("crop", "a positive number", f"{crop:g}")
    cropped = replace(solved, fx=solved.fx / crop, fy=solved.fy / crop)
    if profile.values.get("asymmetrical") is True:
        return cropped
    return replace(cropped, cx=solved.width / 2, cy=solved.height / 2)


def _camera(profile: Section, held: Section, grid: Intrinsics) -> Camera:
    model = _model(profile)
    values = _coefficients(held)
    if model is SPHERE:
        values = _without_k3(held, values)
    count = len(model.names) - 4
    if any(values[count:]):
        raise held.error("distortion_coeffs", f"{count} numbers for {model.name}, with zeros after them", values)
    if model is FISHEYE and not any(values):
        model, count = PINHOLE, 0
    numbers = [grid.fx, grid.fy, grid.cx, grid.cy, *values[:count]]
    return model.camera(numbers, grid.width, grid.height, 0.0, held.where("distortion_coeffs"))


def _model(profile: Section) -> Model:
    if "distortion_model" not in profile:
        return FISHEYE
    name = profile.choice("distortion_model", [model.name for model in READ])
    return next(model for model in READ if model.name == name)


def _coefficients(held: Section) -> list[float]:
    """As many as Gyroflow has room for; the file has zeros at the end or leaves them out."""
    lengths = range(1, MOST_COEFFICIENTS + 1)
    values = held.vector("distortion_coeffs", lengths, "coefficients")
    return values + [0.0] * (MOST_COEFFICIENTS - len(values))


def _without_k3(held: Section, values: list[float]) -> list[float]:
    """Insta360's k1 k2 k3 p1 p2 xi as k1 k2 p1 p2 xi."""
    k1, k2, k3, *rest = values
    if k3:
        raise held.error("distortion_coeffs", "0 as k3 of insta360, for which the lens here has no place", f"{k3:g}")
    return [k1, k2, *rest]


def _centre(solved: Intrinsics, used: Intrinsics) -> list[str]:
    away = hypot(solved.cx - used.cx, solved.cy - used.cy)
    if not away:
        return []
    return [
        f"Gyroflow takes the middle ({used.cx:g}, {used.cy:g}) for the principal point, as the profile is not "
        f"asymmetrical; it was solved for at ({solved.cx:.2f}, {solved.cy:.2f}), {away:.3g} px away."
    ]


def _recording(profile: Section) -> list[str]:
    """What stands between the picture that the camera is for and the one that was recorded."""
    notes = []
    stretch = [
        profile.number(key) if key in profile else 1.0 for key in ("input_horizontal_stretch", "input_vertical_stretch")
    ]
    wide, high = (each if each > 0.01 else 1.0 for each in stretch)  # as Gyroflow reads what was never set
    if (wide, high) != (1, 1):
        notes.append(
            f"Gyroflow stretches recorded pictures by {wide:.4g} in width and {high:.4g} in height: this camera is "
            "for pictures resized to calib_dimension."
        )
    original = profile.section("orig_dimension") if "orig_dimension" in profile else None
    calibrated = profile.section("calib_dimension").sides("w", "h")
    if original and (size := original.sides("w", "h")) and size != calibrated:
        notes.append(f"The recorded pictures have {size[0]}×{size[1]} px; this camera is for calib_dimension.")
    if profile.values.get("interpolations"):
        notes.append("The profile changes with the zoom (interpolations): the camera without it is read.")
    return notes


def _rows(profile: Section) -> list[str]:
    """How long the read-out of a frame takes; a negative time begins at the bottom."""
    if "frame_readout_time" not in profile:
        return []
    time = profile.number("frame_readout_time")
    word = profile.values.get("frame_readout_direction")
    first = DIRECTIONS[profile.choice("frame_readout_direction", list(DIRECTIONS))] if isinstance(word, str) else ""
    begins = first or DIRECTIONS["BottomToTop" if time < 0 else "TopToBottom"]
    said = f"A frame is read out in {abs(time):.4g} ms, {begins}: the camera here has no rolling shutter."
    return [said] if time else []


def _line_delay(profile: Section, height: int) -> LineDelay | None:
    """From one row of calib_dimension to the next; None where that is not said, and where columns are read."""
    time = profile.number("frame_readout_time") if "frame_readout_time" in profile else 0.0
    word = profile.values.get("frame_readout_direction")
    if not time or word in ("LeftToRight", "RightToLeft"):
        return None
    upwards = word == "BottomToTop" if isinstance(word, str) else time < 0
    return LineDelay((-1 if upwards else 1) * abs(time) / 1000 / height)


def _limits(profile: Section, held: Section) -> list[str]:
    notes = []
    limit = held.number("radial_distortion_limit") if "radial_distortion_limit" in held else 0.0
    if limit > 0:
        notes.append(
            f"The profile ends {degrees(atan(limit)):.1f}° from the axis (radial_distortion_limit {limit:.4g}): the "
            "camera here does not."
        )
    rms = held.number("RMS_error") if "RMS_error" in held else 0.0
    if rms > 0:
        notes.append(f"The profile says that its RMS error was {rms:.3g} px.")
    return notes


def _stamp(profile: Section) -> Stamp:
    """When it was made and of what, as the profile tells it."""
    version, focal = _word(profile, "calibrator_version"), _positive(profile, "focal_length", 1e5)
    camera = f"{_word(profile, 'camera_brand')} {_word(profile, 'camera_model')}"
    return Stamp(
        made=_word(profile, "date"),
        program=f"Gyroflow {version}" if version[:1].isdigit() else version,
        views=int(_positive(profile, "num_images", 1e6)),
        conditions=" ".join(filter(None, (_word(profile, "camera_setting"), _word(profile, "note")))),
        cameras=tuple(filter(None, [camera.strip()])),
        lenses=tuple(filter(None, [_word(profile, "lens_model")])),
        focal_lengths=(focal,) if focal else (),
    )


def _positive(profile: Section, key: str, most: float) -> float:
    """A number that may be a description; 0 for anything else, which says nothing of the camera."""
    value = profile.values.get(key)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= most else 0.0


def _word(profile: Section, key: str) -> str:
    return word(profile.values.get(key)) or ""


def write(calibration: Calibration) -> bytes:
    """A profile of one camera, asymmetrical, so that Gyroflow uses its principal point."""
    ((name, camera),) = calibration.cameras.items()
    model, same = expressed(name, camera, MODELS, TITLE)
    fx, fy, cx, cy, *values = model.values(same, 0.0)
    if model is FISHEYE and not any(values):
        raise CalibrationError(f"{TITLE} has no place for {name}'s fisheye of four zeros, which it takes for a pinhole")
    if model is SPHERE:
        values.insert(2, 0.0)
    size = {"w": camera.intrinsics.width, "h": camera.intrinsics.height}
    tree = _described(calibration.stamps.get(name, Stamp())) | {
        "calib_dimension": size,
        "orig_dimension": size,
        "input_horizontal_stretch": 1.0,
        "input_vertical_stretch": 1.0,
        "asymmetrical": True,
        "distortion_model": model.name,
        "fisheye_params": {
            "RMS_error": calibration.rms(name) or 0.0,
            "camera_matrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            "distortion_coeffs": values or [0.0] * 4,
        },
    }
    if delay := calibration.line_delays.get(name):
        tree["frame_readout_time"] = delay.of_rows(camera.intrinsics.height)[0]
    return as_json(tree)


def _described(stamp: Stamp) -> dict[str, Any]:
    """What a stamp knows under Gyroflow's keys; without a calibrator_version Gyroflow refuses a profile."""
    camera, lens = "".join(stamp.cameras[:1]), "".join(stamp.lenses[:1])
    return {
        "name": " ".join(filter(None, (camera, lens))) or "camera",
        "note": stamp.conditions,
        "calibrated_by": "",
        "camera_brand": "",
        "camera_model": camera,
        "lens_model": lens,
        "camera_setting": "",
        "calibrator_version": stamp.program.removeprefix("Gyroflow ") or "camviz",
        "date": stamp.made,
        "num_images": stamp.views,
        "focal_length": stamp.focal_lengths[0] if len(stamp.focal_lengths) == 1 else None,
    }


FORMAT = Format(
    name="gyroflow",
    title=TITLE,
    file="profile.json",
    recognise=is_profile,
    read=read,
    write=write,
    most_cameras=1,
    models=f"{listed(MODELS)}; poly3 and poly5 are read too",
    says="for pictures of calib_dimension; the principal point is the middle unless asymmetrical; four zeros are a "
    "pinhole; RMS and radial_distortion_limit are read as notes; the read-out time is a line delay",
    lacks="skew, tilt, an equidistant fisheye",
    rank=45,
)
