"""Maps: a number for every pixel, in colours with their key beside; hatched where there is none."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from camviz.draw import plot, svg
from camviz.draw.panel import Panel, photograph
from camviz.draw.picture import png

_COLOURS = {"depth": cv2.COLORMAP_VIRIDIS, "disparity": cv2.COLORMAP_TURBO, "error": cv2.COLORMAP_INFERNO}
_GAP, _BAR = 7, 10  # between a map and its key, and the key's width, in picture units


def heat_map(values: np.ndarray, low: float, high: float, colours: str) -> bytes:
    """Numbers (height, width) as PNG: `low` … `high` over the colours named "depth", "disparity" or "error".

    What lies beyond takes the colour of the end, NaN none at all.
    """
    shade = (np.clip(np.nan_to_num(values, nan=low), low, high) - low) * (255 / (high - low))
    pixels = _table(colours).view(np.uint32).take(shade.astype(np.uint8))
    pixels[np.isnan(values)] = 0
    return png(pixels.view(np.uint8).reshape(*values.shape, 4))


@cache
def heat_key(colours: str) -> bytes:
    """The colours from low, at the bottom, to high, as PNG."""
    return png(np.ascontiguousarray(_table(colours)[::-4, None]))


def heat_panel(
    panel: Panel, width: int, height: int, low: float, high: float, unit: str, marks: str = "", **heading: str
) -> str:
    """The map attached under the panel's name, of so many pixels, hatched where it has none, and its key at the right.

    The key is attached as "NAME key". `marks` are drawn over the map, `heading` is what `Panel.show` takes.
    """
    content = _hatching(panel) + photograph(panel, panel.name, width, height, style="image-rendering:pixelated")
    x = panel.x + panel.width + _GAP
    key = svg.image(f"{panel.name} key", x, panel.y, _BAR, panel.height)
    key += svg.rectangle(x, panel.y, _BAR, panel.height, "frame")
    values = plot.ticks(low, high, panel.height / 35)
    places = panel.y + panel.height * (high - values) / (high - low)
    words = plot.written(values)
    if words:
        words[-1] += f" {unit}"
    labels = [svg.text((x + _BAR + 4, y + 4), one, "tick") for y, one in zip(places, words, strict=True)]
    return panel.show(content + marks, **heading) + key + "".join(labels)


def _hatching(panel: Panel) -> str:
    along = np.arange(-panel.height, panel.width, 9.0)
    starts = np.stack([along, np.full_like(along, panel.height)], axis=-1)
    return svg.segments(starts, starts + (panel.height, -panel.height), "grid")


@cache
def _table(colours: str) -> np.ndarray:
    """The 256 colours (256, 4), RGBA."""
    ramp = np.arange(256, dtype=np.uint8)[None]
    return cv2.cvtColor(cv2.applyColorMap(ramp, _COLOURS[colours]), cv2.COLOR_BGR2RGBA)[0]
