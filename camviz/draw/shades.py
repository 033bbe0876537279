"""Heat maps: a number at every place of an image as a colour, with its key or a colour bar beside it.

`heat` shades smoothly between few numbers, with `contours` that say which; `heat_map` has a number for every pixel.

The colours are the same in either theme, perceptually even and safe for the colour-blind: viridis (van der Walt &
Smith 2015) for amounts, blue through grey to orange for what has a sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import ceil, floor, log10

import cv2
import numpy as np
from contourpy import contour_generator
from numpy.typing import ArrayLike, NDArray

from camviz.draw import plot, svg
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel, placed_image
from camviz.draw.picture import png
from camviz.draw.readout import true_minus
from camviz.lenses.base import Array

_SPECK = 24  # picture units, below which a closed contour is a speck between two values
_COLOURS = {"depth": cv2.COLORMAP_VIRIDIS, "disparity": cv2.COLORMAP_TURBO, "error": cv2.COLORMAP_INFERNO}
_GAP, _BAR = 7, 10  # between a map and its key, and the key's width, in picture units
_BLUE, _GREY, _ORANGE = (33, 92, 168), (238, 238, 236), (179, 88, 6)


@dataclass(frozen=True)
class Shades:
    """Which colour a number has: from `low` to `high`, by its logarithm where `logarithmic`, with a sign or without."""

    low: float
    high: float
    logarithmic: bool = False
    diverging: bool = False

    def __post_init__(self) -> None:
        if not self.low < self.high or (self.logarithmic and not self.low > 0):
            raise ValueError(f"low must lie below high, and above 0 for logarithms, got {self.low} and {self.high}")

    @classmethod
    def around(cls, values: ArrayLike, least: float = 1e-12) -> Shades:
        """By logarithm, over the round numbers (1, 2 or 5 times a power of ten) that hold the finite `values`."""
        given = np.asarray(values, dtype=float)
        given = given[np.isfinite(given) & (given > least)]
        low, high = (float(given.min()), float(given.max())) if given.size else (0.1, 1.0)
        low, high = _rounded(low, down=True), _rounded(high, down=False)
        return cls(low, high if high > low else 2 * low, logarithmic=True)

    def fraction(self, values: ArrayLike) -> Array:
        """Where (...) the values stand on the bar, 0 … 1; NaN stays NaN."""
        given = np.asarray(values, dtype=float)
        if not self.logarithmic:
            return np.clip((given - self.low) / (self.high - self.low), 0, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.clip(np.log(given / self.low) / np.log(self.high / self.low), 0, 1)

    def rgba(self, values: ArrayLike) -> NDArray[np.uint8]:
        """The colours (..., 4) of values (...); NaN is transparent."""
        fraction = self.fraction(values)
        known = np.isfinite(fraction)
        table = _diverging() if self.diverging else _coloured("depth")[:, :3]
        rgb = table[np.rint(255 * np.where(known, fraction, 0)).astype(int)]
        return np.concatenate([rgb, np.where(known, 255, 0).astype(np.uint8)[..., None]], axis=-1)

    def levels(self) -> Array:
        """Round numbers along the bar: 1, 2 and 5 times powers of ten, or even steps."""
        if not self.logarithmic:
            return plot.ticks(self.low, self.high, 6)
        powers = 10.0 ** np.arange(floor(log10(self.low)) - 1, ceil(log10(self.high)) + 1)
        for factors in ((1, 2, 5), (1, 3), (1,)):
            levels = np.sort(np.outer(powers, factors).ravel())
            levels = levels[(levels >= self.low * (1 - 1e-9)) & (levels <= self.high * (1 + 1e-9))]
            if len(levels) <= 9:
                break
        return levels


def heat(panel: Panel, name: str, values: Array, shades: Shades) -> tuple[Marks, dict[str, bytes]]:
    """Values (rows, columns), the outermost on the borders of the panel's data rectangle, as an attached picture.

    Between the values the colours follow straight lines; a NaN leaves the place around it bare.
    """
    rows, columns = values.shape
    u, v = np.meshgrid(
        np.linspace(0, columns - 1, 192, dtype=np.float32), np.linspace(0, rows - 1, 144, dtype=np.float32)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        level = np.log(values) if shades.logarithmic else values
    fine = cv2.remap(level.astype(np.float32), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    colours = shades.rgba(np.exp(fine) if shades.logarithmic else fine)
    return svg.image(name, 0, 0, panel.width, panel.height), {name: png(colours)}


def contours(panel: Panel, values: Array, shades: Shades, unit: str = "", strong: float | None = None) -> Marks:
    """Lines at the bar's numbers, each with its own, through values (rows, columns) that span the panel's rectangle.

    The level `strong` has a thicker line.
    """
    rows, columns = values.shape
    u, v = np.linspace(panel.left, panel.right, columns), np.linspace(panel.top, panel.bottom, rows)
    levels = shades.levels()
    levels = levels[levels != 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        heights, cuts = (np.log(values), np.log(levels)) if shades.logarithmic else (values, levels)
    generator = contour_generator(u, v, np.ma.masked_invalid(heights))
    drawn, names = svg.NOTHING, svg.NOTHING
    for i, (level, cut) in enumerate(zip(levels, cuts, strict=True)):
        lines = [panel.place(line) for line in generator.lines(cut)]
        lines = [line for line in lines if np.ptp(line, axis=0).max() > _SPECK]
        thick = strong is not None and np.isclose(level, strong)
        drawn += svg.path(lines, "paper-line") + svg.path(lines, "ink thick" if thick else "ink thin")
        names += _named(panel, lines, f"{level:g}{unit}", i)
    return drawn + names


def bar(x: float, y: float, height: float, name: str, shades: Shades, title: str) -> tuple[Marks, dict[str, bytes]]:
    """An upright colour bar with its numbers to the right, what it counts in words above, and its attached picture."""
    with np.errstate(over="ignore"):
        t = np.linspace(1, 0, 128)
        values = shades.low + t * (shades.high - shades.low)
        if shades.logarithmic:
            values = shades.low * (shades.high / shades.low) ** t
    levels = shades.levels()
    at = y + height * (1 - shades.fraction(levels))
    ticks = svg.join(
        svg.text((x + 20, place + 4), true_minus(f"{level:g}"), "tick")
        for place, level in zip(at, np.round(levels, 9) + 0.0, strict=True)
    )
    marks = svg.segments(
        np.stack([np.full_like(at, x + 14), at], -1), np.stack([np.full_like(at, x + 17), at], -1), "muted"
    )
    picture = svg.image(name, x, y, 14, height) + svg.rectangle(x, y, 14, height, "frame")
    return picture + marks + ticks + svg.text((x - 2, y - 8), title, "note"), {name: png(shades.rgba(values[:, None]))}


def heat_map(values: np.ndarray, low: float, high: float, colours: str) -> bytes:
    """Numbers (height, width) as PNG: `low` … `high` over the colours named "depth", "disparity" or "error".

    What lies beyond takes the colour of the end, NaN none at all.
    """
    shade = (np.clip(np.nan_to_num(values, nan=low), low, high) - low) * (255 / (high - low))
    pixels = _coloured(colours).view(np.uint32).take(shade.astype(np.uint8))
    pixels[np.isnan(values)] = 0
    return png(pixels.view(np.uint8).reshape(*values.shape, 4))


@cache
def heat_key(colours: str) -> bytes:
    """The colours from low, at the bottom, to high, as PNG."""
    return png(np.ascontiguousarray(_coloured(colours)[::-4, None]))


def heat_panel(
    panel: Panel,
    width: int,
    height: int,
    low: float,
    high: float,
    unit: str,
    marks: Marks = svg.NOTHING,
    *,
    awaited: bool = False,
    **heading: str,
) -> Marks:
    """The map attached under the panel's name, of so many pixels, hatched where it has none, and its key at the right.

    The key is attached as "NAME key". `marks` are drawn over the map, `heading` is what `Panel.show` takes. A map that
    is `awaited` is greyed.
    """
    shown = placed_image(panel, panel.name, width, height, image_rendering="pixelated")
    content = _hatching(panel) + (svg.group(shown, "awaited") if awaited else shown)
    x = panel.x + panel.width + _GAP
    key = svg.image(f"{panel.name} key", x, panel.y, _BAR, panel.height)
    key += svg.rectangle(x, panel.y, _BAR, panel.height, "frame")
    values = plot.ticks(low, high, panel.height / 35)
    places = panel.y + panel.height * (high - values) / (high - low)
    words = plot.written(values)
    if words:
        words[-1] += f" {unit}"
    labels = [svg.text((x + _BAR + 4, y + 4), one, "tick") for y, one in zip(places, words, strict=True)]
    return panel.show(content + marks, **heading) + key + svg.join(labels)


def _hatching(panel: Panel) -> Marks:
    along = np.arange(-panel.height, panel.width, 9.0)
    starts = np.stack([along, np.full_like(along, panel.height)], axis=-1)
    return svg.segments(starts, starts + (panel.height, -panel.height), "grid")


def _named(panel: Panel, lines: list[Array], words: str, turn: int) -> Marks:
    """A label on the longest of a level's lines, where it stays inside the panel and off its neighbours' labels."""
    if not lines:
        return svg.NOTHING
    line = max(lines, key=len)
    if np.ptp(line, axis=0).max() < 60:  # an island that its own label would cover
        return svg.NOTHING
    inside = line[
        (line[:, 0] > 14) & (line[:, 0] < panel.width - 14) & (line[:, 1] > 16) & (line[:, 1] < panel.height - 8)
    ]
    if not len(inside):
        return svg.NOTHING
    at = inside[int((0.15 + 0.19 * turn) % 1 * len(inside))]
    return svg.text(at + (0, 4), words, "label halo middle")


def _rounded(value: float, *, down: bool) -> float:
    power = 10.0 ** floor(log10(value))
    steps = [factor * power for factor in (1, 2, 5, 10)]
    return (
        max(s for s in steps if s <= value * (1 + 1e-9)) if down else min(s for s in steps if s >= value * (1 - 1e-9))
    )


@cache
def _coloured(name: str) -> NDArray[np.uint8]:
    """The 256 colours (256, 4), RGBA, of the map called "depth", "disparity" or "error"."""
    ramp = np.arange(256, dtype=np.uint8)[None]
    return np.asarray(cv2.cvtColor(cv2.applyColorMap(ramp, _COLOURS[name]), cv2.COLOR_BGR2RGBA)[0])


@cache
def _diverging() -> NDArray[np.uint8]:
    """Blue to grey to orange along straight lines of CIE L*a*b*, whose lengths are differences as they are seen."""
    ends = np.array([[_BLUE, _GREY, _ORANGE]], np.float32) / 255
    lab = cv2.cvtColor(ends, cv2.COLOR_RGB2LAB)[0]
    t = np.linspace(0, 2, 256)
    way = np.stack([np.interp(t, [0, 1, 2], channel) for channel in lab.T], axis=-1)[None].astype(np.float32)
    return np.rint(255 * np.clip(cv2.cvtColor(way, cv2.COLOR_LAB2RGB)[0], 0, 1)).astype(np.uint8)
