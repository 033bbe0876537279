"""`camviz mtf`: how sharp a camera is, from a photograph of one straight edge."""

from __future__ import annotations

import argparse
import re
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import (
    OK,
    Refusal,
    add_command,
    add_megapixels,
    read_picture,
    refuse_output,
    write_whole,
)
from camviz_clinic.commands.terminal import tell, tell_json

if TYPE_CHECKING:
    import numpy as np

    from camviz_clinic.measuring.sharpness import SlantedEdge

MTF = """\
Measures how sharp a camera is from a photograph of one straight edge between dark and bright, leaning by about 5
degrees against the pixels' rows or columns (ISO 12233): the modulation transfer function, and MTF50, the frequency at
which half of a grating's contrast is left. Its standard error is what the pixels' noise leaves, wider where neighbours
share it, the edge is bent or has a spot, the light is uneven, or a JPEG has changed it. Where that is too much, or
pixels are at an end of the scale, it refuses. It knows nothing of sharpening.

PHOTO, or the part of it that --roi names, shows the edge and nothing else: PNG, JPEG or TIFF. Numbers of 8 bits are
taken for sRGB and made linear; those of 16 bits and more are taken as linear. --linear and --srgb say otherwise.
"""
EPILOG = """\
examples:
  camviz mtf edge.png
  camviz mtf photo.jpg --roi 1200,800,100,200
  camviz mtf raw.tif --json
  camviz mtf edge.png --report sharpness.html

exit status:
  0  measured
  2  there is no edge that can be measured, or the command cannot be used; one sentence on stderr says why
"""
MOST_MEGAPIXELS = 24  # that are measured, at 34 bytes a pixel
LEAST_NOISE = 1e-9  # of the contrast: less noise than that is a computation's rounding
FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)  # cycles per pixel: the curve in JSON


def add(commands: Any) -> None:
    command = add_command(commands, "mtf", mtf, "measure sharpness from a slanted edge", MTF)
    command.epilog = EPILOG
    command.add_argument("photo", metavar="PHOTO", type=Path, help="the photograph of the edge")
    command.add_argument("--roi", metavar="X,Y,W,H", type=part, help="the part that shows the edge, in pixels")
    light = command.add_mutually_exclusive_group()
    light.add_argument("--linear", action="store_true", help="the numbers are proportional to light")
    light.add_argument("--srgb", action="store_true", help="the numbers are encoded as sRGB")
    command.add_argument("--json", action="store_true", help="the figures for programs; null if unknown")
    command.add_argument("--report", metavar="OUT.html", type=Path, help="write a page with the curves as well")
    add_megapixels(command)


def part(text: str) -> tuple[int, int, int, int]:
    """10,20,80,120 as (x, y, width, height)."""
    match = re.fullmatch(r"\s*(\d{1,6})\s*,\s*(\d{1,6})\s*,\s*(\d{1,6})\s*,\s*(\d{1,6})\s*", text)
    if not match or "0" in match.groups()[2:]:
        raise argparse.ArgumentTypeError(f"expected X,Y,WIDTH,HEIGHT in pixels, such as 300,200,80,120, got {text!r}")
    x, y, width, height = map(int, match.groups())
    return x, y, width, height


def mtf(options: argparse.Namespace) -> int:
    """Measure, write the page whole or not at all, and only then print."""
    from camviz_clinic.measuring.sharpness import SlantedEdge

    if options.report:
        refuse_output(options.report, "page", options.photo)
    picture = _cut(read_picture(options.photo), options)
    _refuse_large(picture, options.photo)
    light, taken_as = linear_light(picture, options)
    try:
        edge = SlantedEdge.of(light, ends_of_scale(picture))
    except ValueError as error:
        raise Refusal(f"{options.photo}: {error}.") from error
    if options.report:
        text = page(edge, options.photo.name, taken_as)
        write_whole(options.report, lambda path: path.write_text(text, encoding="utf-8"))
    if options.json:
        tell_json(as_json(edge))
        return OK
    tell(as_text(edge, options.photo, taken_as))
    if options.report:
        tell(f"{options.report}: open it in a browser.")
    return OK


def _cut(picture: np.ndarray, options: argparse.Namespace) -> np.ndarray:
    if options.roi is None:
        return picture
    x, y, width, height = options.roi
    if x + width > picture.shape[1] or y + height > picture.shape[0]:
        raise Refusal(
            f"--roi: expected a part of the {picture.shape[1]} × {picture.shape[0]} pixels of {options.photo}, "
            f"got {x},{y},{width},{height}."
        )
    return picture[y : y + height, x : x + width]


def _refuse_large(picture: np.ndarray, photo: Path) -> None:
    megapixels = picture.shape[0] * picture.shape[1] / 1e6
    if megapixels > MOST_MEGAPIXELS:
        raise Refusal(
            f"{photo}: expected an edge within {MOST_MEGAPIXELS} megapixels, got {megapixels:.4g}: say with --roi "
            "where it is."
        )


def linear_light(picture: np.ndarray, options: argparse.Namespace) -> tuple[np.ndarray, str]:
    """Luminance (height, width) of a picture (grey, BGR or BGRA), and how its numbers were taken."""
    import numpy as np

    from camviz.scenes import to_linear

    full = np.iinfo(picture.dtype).max if picture.dtype.kind in "ui" else 1.0
    values = picture.astype(float) / full
    encoded = options.srgb or (picture.dtype == np.uint8 and not options.linear)
    light = to_linear(values) if encoded else values
    if light.ndim == 3:  # ITU-R BT.709: the luminance of linear red, green and blue
        light = light[..., 2::-1] @ np.array([0.2126, 0.7152, 0.0722])
    return np.asarray(light), "sRGB, made linear" if encoded else "linear"


def ends_of_scale(picture: np.ndarray) -> np.ndarray | None:
    """Which pixels (height, width) of a picture (grey, BGR or BGRA) have a colour at the first or last of its numbers.

    None where the numbers are not whole, and so have no ends.
    """
    import numpy as np

    if picture.dtype.kind not in "ui":
        return None
    at_an_end = (picture == 0) | (picture == np.iinfo(picture.dtype).max)
    return np.asarray(at_an_end if picture.ndim == 2 else at_an_end[..., :3].any(axis=-1))


def figures(edge: SlantedEdge) -> dict[str, float]:
    """The figures by name: cycles per pixel, pixels, degrees, and the MTF at a quarter and half a cycle per pixel."""
    return {
        "mtf50_cycles_per_pixel": edge.mtf50,
        "mtf50_standard_error": edge.mtf50_error,
        "mtf10_cycles_per_pixel": edge.frequency_at(0.1),
        "mtf_at_quarter_cycle": float(edge.mtf(0.25)),
        "mtf_at_half_cycle": float(edge.mtf(0.5)),
        "rise_10_90_pixels": edge.rise,
        "angle_deg": abs(edge.angle_deg),
        "contrast_over_noise": edge.contrast / edge.noise if edge.noise > LEAST_NOISE * edge.contrast else float("nan"),
        "clipped_percent": 100 * max(edge.clipped_shares),
        "light_across_percent_per_pixel": 100 * abs(edge.sides.falls),
        "light_along_percent": 100 * edge.sides.along,
        "off_a_line_pixels": edge.error.off_the_line,
        "widest_gap_pixels": edge.error.gap,
        "scatter_at_edge_percent": 100 * edge.error.unexplained,
        "noise_shared_factor": edge.error.shared,
    }


def as_json(edge: SlantedEdge) -> str:
    """The figures and the curve as one JSON object; null for those that the edge cannot give."""
    from camviz_clinic.files.output import json_text

    curve = [{"cycles_per_pixel": f, "mtf": float(edge.mtf(f))} for f in FREQUENCIES]
    return json_text({**figures(edge), "curve": curve})


def as_text(edge: SlantedEdge, photo: Path, taken_as: str) -> str:
    """The figures in words."""
    from camviz_clinic.views.measured_edge import written

    rows, columns = edge.image.shape
    head = f"{photo}: an edge of {columns} × {rows} pixels, {taken_as}."
    return "\n".join([head, *(f"  {words:32} {value}" for words, value in written(figures(edge)).items())])


def page(edge: SlantedEdge, name: str, taken_as: str) -> str:
    """The measurement as one page of HTML that needs no network: the figures, then the curves."""
    from camviz.draw.page import document, figure
    from camviz_clinic.views.measured_edge import MeasuredEdgeView, written

    rows = "".join(
        f"<tr><th>{escape(words)}</th><td>{escape(value)}</td></tr>" for words, value in written(figures(edge)).items()
    )
    height, width = edge.image.shape
    body = (
        f"<p>An edge of {width} × {height} pixels, {escape(taken_as)}. ISO 12233, slanted edge.</p>"
        f'<div class="scroll"><table>{rows}</table></div>' + figure("", MeasuredEdgeView(edge=edge, name=name).figure())
    )
    return document(name, body)
