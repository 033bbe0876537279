"""`camviz reproject`: a picture as another camera in the same place would have taken it."""

from __future__ import annotations

import argparse
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import (
    OK,
    Refusal,
    add_command,
    add_megapixels,
    loaded,
    read_picture,
    refuse_output,
    size,
    write_whole,
)
from camviz_clinic.commands.pictures import encoded
from camviz_clinic.commands.terminal import tell

if TYPE_CHECKING:
    import numpy as np

    from camviz.cameras import Camera

REPROJECT = """\
Takes a picture through another lens, or turned another way: every pixel of OUT is followed along its ray into IN.
Panoramas are joined at their seam and over their poles, cube maps along their edges, and where OUT is coarser than IN
the pixels it covers are averaged. What IN does not show is transparent in OUT (.png, .tif, .webp), else dark grey.
"""

MODELS = """\
models (for --from and --to), with the field of view they have unless --hfov says another:
  perspective            straight lines stay straight; 90 degrees wide, always below 180
  equirectangular        longitude and latitude, 360 x 180 degrees: twice as wide as high
  cylindrical            longitude, and height on a cylinder; 360 degrees around
  fisheye:equidistant    r = f a for a ray at the angle a from the axis; 180 degrees across the picture's width
  fisheye:equisolid      r = 2 f sin(a/2)
  fisheye:stereographic  r = 2 f tan(a/2)
  fisheye:orthographic   r = f sin(a), 180 degrees at most
  cube                   six faces of 90 degrees as a cross, 4 faces wide and 3 high:
                                  up
                            left front right back
                                  down
  cube:strip             the same in a row: front right back left up down
  cube:front             one face alone; or :right, :back, :left, :up, :down
  FILE                   a calibration file: its size, focal lengths and lens; --from-camera or --to-camera names one
                         of several cameras

--hfov is the field of OUT, --from-hfov that of IN. --yaw, --pitch and --roll turn the camera that takes OUT: to the
right, up, and clockwise.

examples:
  camviz reproject earth.jpg -o front.png --from equirectangular --to cube:front
  camviz reproject earth.jpg -o window.png --from equirectangular --to perspective --hfov 60 --yaw 30 --pitch -10
  camviz reproject earth.jpg -o planet.png --from equirectangular --to fisheye:stereographic --hfov 300 --pitch -90
  camviz reproject fisheye.png -o straight.png --from camera.yaml --to perspective --hfov 120 --size 1280x720
"""


def add(commands: Any) -> None:
    command = add_command(commands, "reproject", reproject, "take a picture through another lens", REPROJECT)
    command.epilog = MODELS
    command.add_argument("file", metavar="IN", type=Path, help="the picture")
    command.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help="the picture to write")
    command.add_argument("--from", metavar="MODEL", dest="source", required=True, help="what IN is: a model below")
    command.add_argument("--to", metavar="MODEL", dest="target", required=True, help="what OUT is to be")
    command.add_argument("--hfov", metavar="DEG", type=angle, help="OUT's horizontal field of view in degrees")
    command.add_argument("--from-hfov", metavar="DEG", type=angle, help="IN's horizontal field of view in degrees")
    for name, way in (("yaw", "to the right"), ("pitch", "up"), ("roll", "clockwise")):
        command.add_argument(f"--{name}", metavar="DEG", type=angle, default=0.0, help=f"turn {way}, in degrees")
    command.add_argument(
        "--size", metavar="WxH", type=size, help="OUT's size in pixels (default: as many pixels a degree as IN has)"
    )
    command.add_argument("--from-camera", metavar="NAME", help="which camera of a calibration file took IN")
    command.add_argument("--to-camera", metavar="NAME", help="which camera of a calibration file is to take OUT")
    add_megapixels(command)


def angle(text: str) -> float:
    """A finite number of degrees."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"expected an angle in degrees, got {text!r}")
    return value


def reproject(options: argparse.Namespace) -> int:
    """Write the picture another camera takes, whole or not at all."""
    from camviz.panoramas.reprojection import reproject as reprojected
    from camviz.panoramas.reprojection import turned

    refuse_output(options.output, "picture", options.file)
    _require_writer(options.output)
    picture = read_picture(options.file)
    source = _source(options, picture.shape[1], picture.shape[0])
    target = _target(options, source)
    target = target.at(turned(options.yaw, options.pitch, options.roll) * target.world_from_cam)
    seen = reprojected(picture, source, target, nothing=0.0 if picture.ndim == 3 and picture.shape[2] == 4 else None)
    data = encoded(_finished(seen, picture, options.output), options.output)
    write_whole(options.output, lambda path: path.write_bytes(data))
    tell(f"{options.output}: written, {target.intrinsics.width} × {target.intrinsics.height} pixels, {options.target}.")
    return OK


# Cameras -------------------------------------------------------------------------------------------------------------


def _source(options: argparse.Namespace, width: int, height: int) -> Camera:
    """The camera that took IN."""
    if (camera := _calibrated(options.source, options.from_camera, "--from-camera", (width, height))) is not None:
        own = camera.intrinsics
        if options.from_hfov is not None:
            raise Refusal(f"--from-hfov: the calibration {options.source} says what field of view its camera has.")
        if (own.width, own.height) != (width, height):
            raise Refusal(
                f"{options.file}: expected the {own.width} × {own.height} pixels of the camera in {options.source}, "
                f"got {width} × {height}."
            )
        return camera
    return _named(f"{options.file} as {options.source}", options.source, width, height, options.from_hfov)


def _target(options: argparse.Namespace, source: Camera) -> Camera:
    """The camera that is to take OUT, not yet turned."""
    from camviz.panoramas.projections import across_deg, projection
    from camviz.panoramas.reprojection import LONGEST

    if options.size is not None and not all(1 <= side <= LONGEST for side in options.size):
        width, height = options.size
        raise Refusal(f"--size: expected 1 to {LONGEST} pixels a side, got {width}x{height}.")
    if (camera := _calibrated(options.target, options.to_camera, "--to-camera", options.size)) is not None:
        if options.hfov is not None:
            raise Refusal(f"--hfov: the calibration {options.target} says what field of view its camera has.")
        sized = camera.intrinsics.resized(*options.size) if options.size else camera.intrinsics
        return type(camera)(sized, camera.lens)
    if options.size is None:
        try:
            kind = projection(options.target)
        except ValueError as error:
            raise Refusal(f"--to: {error}; or the name of a calibration file.") from error
        seen = across_deg(source)
        a_degree = source.intrinsics.width / seen if isfinite(seen) and seen > 0 else source.intrinsics.width / 180
        if "cube" in options.source and ":" not in options.source.removesuffix(":strip"):
            a_degree = 2 * source.intrinsics.fx / 90  # a layout has gaps and edges
        width = max(1, round(a_degree * (options.hfov or kind.hfov_deg)))
        width, height = _whole(options.target, width, kind.aspect)
        if not max(width, height) <= LONGEST:
            raise Refusal(f"--size: OUT would have {width} × {height} pixels; say a smaller size.")
    else:
        width, height = options.size
    return _named(f"--to {options.target}", options.target, width, height, options.hfov)


def _whole(model: str, width: int, aspect: float) -> tuple[int, int]:
    """The size next to `width` that the model can have."""
    unit = {"cube": 4, "cube:strip": 6, "equirectangular": 2}.get(model, 1)
    width = max(unit, unit * round(width / unit))
    return width, max(1, round(width / aspect))


def _named(what: str, model: str, width: int, height: int, hfov_deg: float | None) -> Camera:
    from camviz.panoramas.projections import projection

    try:
        kind = projection(model)
    except ValueError as error:
        raise Refusal(f"{what}: {error}; or the name of a calibration file.") from error
    try:
        return kind.camera(width, height, hfov_deg)
    except ValueError as error:
        raise Refusal(f"{what}: {error}.") from error


def _calibrated(model: str, name: str | None, option: str, size: tuple[int, int] | None) -> Camera | None:
    """The camera of a calibration file, which may hold no size; None where the model is no file but a name."""
    from camviz.panoramas.projections import PROJECTIONS

    path = Path(model)
    if model in PROJECTIONS or not (path.exists() or path.suffix or len(path.parts) > 1):
        if name is not None:
            raise Refusal(f"{option}: {model} is no calibration file, of whose cameras one could be named.")
        return None
    try:
        cameras = loaded(path, None).cameras
    except Refusal:
        if size is None:
            raise
        cameras = loaded(path, size).cameras
    if name is None and len(cameras) > 1:
        raise Refusal(f"{path}: holds the cameras {', '.join(cameras)}; say with {option} which one.")
    if name is not None and name not in cameras:
        raise Refusal(f"{path}: expected one of the cameras {', '.join(cameras)}, got {name!r}.")
    camera = cameras[name or next(iter(cameras))]
    return type(camera)(camera.intrinsics, camera.lens)


# Pictures ------------------------------------------------------------------------------------------------------------


def _finished(seen: np.ndarray, picture: np.ndarray, output: Path) -> np.ndarray:
    """What was seen, whose last channel is alpha, as OUT can hold it."""
    import numpy as np

    from camviz.panoramas.reprojection import NOTHING

    if picture.ndim == 3 and picture.shape[2] == 4:
        return seen
    full = 1.0 if seen.dtype.kind == "f" else float(np.iinfo(seen.dtype).max)
    colours, alpha = seen[..., :-1].astype(float), seen[..., -1:] / full
    if not (alpha == 1).all() and output.suffix.lower() in (".png", ".tif", ".tiff", ".webp"):
        with np.errstate(invalid="ignore", divide="ignore"):
            straight = np.where(alpha > 0, colours / alpha, 0)  # samples without a ray were averaged in as black
        shown = np.concatenate([np.broadcast_to(straight, (*alpha.shape[:2], 3)), full * alpha], axis=-1)
    else:
        shown = colours + (1 - alpha) * NOTHING * full
    return np.asarray(shown if seen.dtype.kind == "f" else np.rint(shown)).astype(seen.dtype)


def _require_writer(output: Path) -> None:
    import cv2

    if not output.suffix or not cv2.haveImageWriter(output.name):
        raise Refusal(f"{output}: expected a picture's name, ending in .png, .jpg, .tif or .webp.")
