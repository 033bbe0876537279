"""`camviz convert`: a calibration for another program."""

from __future__ import annotations

import argparse
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import (
    OK,
    Refusal,
    add_command,
    bounded,
    did_you_mean,
    loaded,
    narrator,
    refuse_output,
    size,
    write_calibration,
    write_whole,
)

CONVERT = """\
Writes a calibration for another program. Pixels, lens and poses are carried from one set of conventions to the other
(half pixels, axes, order of coefficients, which way a transform goes), and what is written is read back and compared
before it takes its name: it says the same, or it is not written. A format that has no place for something in the
cameras is refused with the reason; what else it cannot hold (corners, board poses, names, the other camera) is named
where it says "written". The format of IN is told by its content. A COLMAP model is a folder, and so is a pair for ROS:
a file for each camera, with stereoRectify's R and P.
With --fit MODEL the lens is replaced by the one of that model that fits it best over the image, the error is said, and
above --tolerance it is refused.
With --to lut OUT is an archive of tables (.npz) for programs that know no lenses: maps for cv2.remap, that undistort,
and the rays of a grid of pixels, with the error of reading them between its nodes.
"""

if TYPE_CHECKING:
    from camviz_clinic.calibration.lens_fit import LensFit
    from camviz_clinic.calibration.types import Calibration

TOLERANCE = 0.1  # pixels
LUT = "lut"
EXAMPLES = """\
examples:
  camviz convert camera.yml camera.cameramodel --to mrcal
  camviz convert - - --to ros < camera.yml > camera.yaml
  camviz convert stereo.yml chain.yaml --to kalibr --size 640x480
  camviz convert stereo.yml camera_info --to ros
  camviz convert basalt.json camera.yaml --to ros --camera cam0 --fit fisheye --tolerance 0.05
  camviz convert camera.yml tables.npz --to lut --step 16 --alpha 1
  camviz convert sparse/0 left.yml --to opencv --camera left.jpg --first-as-world
"""


def add(commands: Any) -> None:
    command = add_command(commands, "convert", convert, "write a calibration for another program", CONVERT)
    command.epilog, command.listing = EXAMPLES, _listing
    command.add_argument("file", metavar="IN", type=Path, help="the calibration, or the folder of a COLMAP model")
    command.add_argument(
        "output", metavar="OUT", type=Path, help="the file to write; for COLMAP, and a pair for ROS, a new folder"
    )
    command.add_argument("--to", metavar="FORMAT", required=True, help="one of the formats below, or lut")
    command.add_argument("--size", metavar="WxH", type=size, help="image size in pixels, where IN does not hold it")
    command.add_argument("--camera", metavar="NAME", help="only this one of the cameras")
    command.add_argument(
        "--first-as-world", action="store_true", help="make the first camera's frame the world, as some formats must"
    )
    command.add_argument(
        "--fit", metavar="MODEL", help="write the lens as one of `camviz calibrate --model`, fitted over the image"
    )
    command.add_argument(
        "--tolerance", metavar="PX", type=float, default=TOLERANCE, help=f"largest error of --fit (default {TOLERANCE})"
    )
    command.add_argument(
        "--step",
        metavar="PX",
        type=bounded("a grid step in pixels", 1, 1000, "px"),
        help="grid of the rays of lut (default 8)",
    )
    command.add_argument(
        "--alpha",
        metavar="A",
        type=bounded("a share", 0, 1),
        help="undistorted picture of lut: 0 without black borders, to 1 with every pixel (default 0)",
    )


def _listing() -> str:
    from camviz_clinic.files.registry import listing

    return listing()


def convert(options: argparse.Namespace) -> int:
    """Write a calibration in another format, whole or not at all."""
    whole = calibration = loaded(options.file, options.size)
    if options.output.exists() and options.output.samefile(options.file):
        raise Refusal(f"{options.output}: this would overwrite the calibration; choose another name.")
    from camviz_clinic.files import CalibrationError
    from camviz_clinic.files.registry import written
    from camviz_clinic.files.writing import alone, from_first_camera

    known = (*written(), LUT)
    if options.to not in known:
        near = did_you_mean(options.to, known)
        raise Refusal(f"format: expected one of {', '.join(known)}, got {options.to!r}{near}.")

    _refuse_stray(options)
    try:
        if options.camera is not None:
            calibration = alone(calibration, options.camera)
        if options.first_as_world:
            calibration = from_first_camera(calibration)
        fitted = [] if options.fit is None else _fit(calibration, options.fit, options.tolerance)
        if fitted:
            cameras = {name: fit.camera for name, fit in fitted}
            calibration = replace(calibration, cameras=cameras, intrinsics_covariance={}, estimated={}, priors={})
        said = (_tabulated if options.to == LUT else _converted)(calibration, whole, options)
    except CalibrationError as error:
        raise Refusal(str(error)) from error
    told = narrator(options.output)
    for name, fit in fitted:
        told(f"{name}: {_error(fit)}")
    for sentence in (*calibration.notes, *said):
        told(sentence)
    return OK


def _converted(calibration: Calibration, whole: Calibration, options: argparse.Namespace) -> tuple[str, ...]:
    """The calibration written; what there is to say of it."""
    from camviz_clinic.files.writing import without

    lost = write_calibration(calibration, options.output, options.to, whole)
    return (f"{options.output}: written from {whole.format}, read back and found the same{without(lost)}.",)


def _refuse_stray(options: argparse.Namespace) -> None:
    """Refuses what only the tables have where none are asked for."""
    for name in ("step", "alpha"):
        if options.to != LUT and getattr(options, name) is not None:
            raise Refusal(f"--{name} belongs to --to lut, got --to {options.to}.")


def _tabulated(calibration: Calibration, whole: Calibration, options: argparse.Namespace) -> tuple[str, ...]:
    """The tables of the one camera written; what there is to say of them."""
    from camviz_clinic.files import CalibrationError
    from camviz_clinic.files.lookup_tables import STEP, LookupTables
    from camviz_clinic.files.writing import lost_poses, without

    if len(calibration.cameras) > 1:
        names = ", ".join(calibration.cameras)
        raise CalibrationError(f"lookup tables are of one camera: choose one of {names} (--camera NAME)")
    ((name, camera),) = calibration.cameras.items()
    refuse_output(options.output, "archive", options.file)
    try:
        tables = LookupTables.of(camera, STEP if options.step is None else options.step, options.alpha or 0.0)
    except ValueError as error:
        raise CalibrationError(f"{name}: {error}") from error
    content = tables.content()
    write_whole(options.output, lambda path: path.write_bytes(content), "tables.npz")
    K, off, step = tables.target, tables.error, tables.table.u[1] - tables.table.u[0]
    part = f", over {off.share:.0%} of the pixels" if off.share < 1 else ""
    u, v = off.worst_at
    sizes = f"{off.median:.2g} px off (median) and {off.worst:.2g} px at most, at ({u}, {v}){part}"
    return (
        f"map_x, map_y: to {K.width}×{K.height} pixels with fx = {K.fx:.2f}, fy = {K.fy:.2f}, "
        f"cx = {K.cx:.2f}, cy = {K.cy:.2f}.",
        f"rays: every {step:.3g} px; read bilinearly they are {sizes}.",
        *_without_ray(name, off.share),
        f"{options.output}: written from {calibration.format}{without(lost_poses(calibration, whole))}.",
    )


def _without_ray(name: str, fraction_with_ray: float) -> tuple[str, ...]:
    """A warning where the table lacks rays."""
    if fraction_with_ray == 1:
        return ()
    lost = f"{1 - fraction_with_ray:.2%}".replace("%", " %")
    return (
        f"warning: {name}: {lost} of the pixels have no ray; `rays` is NaN there. `camviz inspect` names the cause.",
    )


def _fit(calibration: Calibration, model: str, tolerance: float) -> list[tuple[str, LensFit]]:
    """Each camera in another model; CalibrationError where one is further off than the tolerance."""
    from camviz_clinic.calibration.lens_fit import fit_lens
    from camviz_clinic.files import CalibrationError

    fitted = []
    for name, camera in calibration.cameras.items():
        try:
            fit = fit_lens(camera, model)
        except ValueError as error:
            raise CalibrationError(f"{name}: {error}") from error
        if not fit.worst <= tolerance:
            raise CalibrationError(f"{name}: {_error(fit)}, above the tolerance of {tolerance:g} px (--tolerance)")
        fitted.append((name, fit))
    return fitted


def _error(fit: LensFit) -> str:
    lens, (u, v) = type(fit.camera.lens).__name__, fit.worst_at
    if not isfinite(fit.worst):
        return f"{lens} has no image of the ray at ({u:.0f}, {v:.0f})"
    part = f", over {fit.share:.0%} of the image" if fit.share < 1 else ""
    sizes = f"{fit.median:.2g} px (median) and {fit.worst:.2g} px at most, at ({u:.0f}, {v:.0f})"
    return f"fitted as {lens}, off by {sizes}{part}"
