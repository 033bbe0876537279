"""Patches of colour: the chart with truth and estimate side by side, a colour for each step, a spectrum in colours."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from camviz.colour.spaces import to_srgb
from camviz.colour.spectra import WAVELENGTHS_NM, observer
from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.panel import Panel
from camviz.scenes.light import to_display

_MARGIN = 0.04  # of a patch, in black between the patches


def chart(panel: Panel, rgb: np.ndarray, true_xyz: np.ndarray, errors: np.ndarray | None, chosen: int) -> svg.Marks:
    """The chart's 24 patches: linear sRGB above left of each diagonal, the truth below right of it, ΔE if given."""
    estimates, truths = hexadecimal(rgb), hexadecimal(to_srgb(true_xyz))
    light = np.clip(rgb, 0, 1) @ (0.2126, 0.7152, 0.0722) > 0.179  # where black stands out more than white
    parts = [svg.rectangle(0, 0, panel.width, panel.height, "black", fill="#111")]
    for i, (estimate, truth) in enumerate(zip(estimates, truths, strict=True)):
        row, column = divmod(i, 6)
        left, top = panel.place((column + _MARGIN, row + _MARGIN))
        right, bottom = panel.place((column + 1 - _MARGIN, row + 1 - _MARGIN))
        parts.append(svg.rectangle(left, top, right - left, bottom - top, "patch", fill=truth))
        corner = [(left, top), (right, top), (left, bottom)]
        parts.append(svg.polygon(corner, "patch", fill=estimate))
        ink = "#000" if light[i] else "#fff"
        if errors is not None:
            parts.append(svg.text((left + 5, top + 16), f"{errors[i]:.1f}", "tick", fill=ink))
    row, column = divmod(chosen, 6)
    corners = panel.place([(column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1)])
    frame = [("#fff", 5), ("#111", 2)]  # stands out from any colour
    return svg.join(parts) + svg.join(
        svg.polygon(corners, "", stroke=ink, stroke_width=width, fill="none") for ink, width in frame
    )


def steps(cell: Cell, colours: Mapping[str, np.ndarray]) -> svg.Marks:
    """Swatches below each other, linear sRGB (1 or 2, 3) each: a step's colour or two, its name and its numbers."""
    parts = []
    for at, (name, rgb) in enumerate(colours.items()):
        left, y, width = cell[0] + 10, cell[1] + 8 + 74 * at, 100 / len(rgb)
        parts.append(svg.text((left + 114, y + 18), name, "label"))
        for k, (fill, colour) in enumerate(zip(hexadecimal(rgb), rgb, strict=True)):
            place = (left + k * width, y, width, 66)
            crisp = "crispEdges"  # no seam between halves that are alike
            parts.append(svg.rectangle(*place, "patch", fill=fill, shape_rendering=crisp))
            words = " ".join(f"{value:.3f}" for value in colour).replace("-", "−")
            class_ = ("blue", "orange")[k] if len(rgb) > 1 else ""
            parts.append(svg.text((left + 114, y + 39 + 20 * k), words, f"number {class_}"))
        parts.append(svg.rectangle(left, y, 100, 66, "frame"))
    return svg.join(parts)


def rainbow(panel: Panel, power: np.ndarray) -> svg.Marks:
    """The area under a spectrum (81,) in the colours of its wavelengths, as near as a screen comes to them."""
    width = panel.width / (len(WAVELENGTHS_NM) - 1)
    bars = [
        svg.rectangle(x - width / 2, y, width, panel.height - y, "half", fill=fill, shape_rendering="crispEdges")
        for (x, y), fill in zip(
            panel.place(np.stack([WAVELENGTHS_NM, power], axis=-1)).tolist(), _wavelength_colours(), strict=True
        )
    ]
    return svg.join(bars)


def hexadecimal(rgb: np.ndarray) -> list[str]:
    """Linear sRGB (n, 3) as "#rrggbb"."""
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in to_display(rgb).tolist()]


@cache
def _wavelength_colours() -> list[str]:
    linear = np.maximum(to_srgb(observer()), 0) / 1.6
    return hexadecimal(linear)
