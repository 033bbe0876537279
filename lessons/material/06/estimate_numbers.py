"""The estimated camera in numbers and marks: beside the true one, with how sure each number is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.panel import Panel
from camviz.draw.readout import signed
from camviz.lenses import BrownConrady
from camviz_school.views.board_pictures import FREE, INTRINSICS
from camviz_school.views.error_bars import NO_BOARD, PIXELS, ErrorBars, number

_REACH = 300.0  # pixels at the ends of the strip
_ROW, _LINE = 22, 26  # units, from one estimate to the next: in the strip, in the table


@dataclass(frozen=True)
class EstimateNumbers(ErrorBars):
    """The estimate of every intrinsic: a table, and a strip of how far each is off with its ± σ."""

    @property
    def _known(self) -> Camera:
        """The camera whose lens and principal point are taken as known: the true one, or that which was estimated."""
        return self.truth or self.camera or self._true_camera

    def _estimates(self, cell: Cell) -> svg.Marks:
        left, y, width, _ = cell
        heads = ("", "true" if self.truth else "", "estimate", "± σ")
        x = (left + 14, *(left + 14 + share * (width - 28) for share in (0.4, 0.7, 1.0)))
        parts = [svg.text((x[0], y + 26), "The estimate", "title")]
        if self.adjustment is None:
            return parts[0] + svg.paragraph((x[0], y + 56), NO_BOARD, width - 28, "label")
        parts += [svg.text((at, y + 54), words, "label end") for at, words in zip(x, heads, strict=True)]
        for row, name in enumerate(FREE[self.free]):
            below = y + 82 + _LINE * row
            value, sigma = self.estimates[name]
            parts.append(svg.text((x[0], below), name, "number"))
            words = (number(name, self.true[name]) if self.truth else "", number(name, value), spread(name, sigma))
            parts += [svg.text((at, below), one, "number end") for at, one in zip(x[1:], words, strict=True)]
        return svg.join(parts)

    def _strip(self, cell: Cell) -> svg.Marks:
        """Every estimate's distance from the truth with ± σ and ± 2σ, in pixels on a scale that is linear near 0."""
        x, y, width, _ = cell
        panel = Panel("estimates", x + 46, y + 46, width - 60, _ROW * len(INTRINSICS), -1, 1, 0, len(INTRINSICS))
        marks = np.array([-100, -10, -1, 0, 1, 10, 100])
        xs = panel.place(np.stack([_squeezed(marks), 0 * marks], axis=-1))[:, 0]
        lines = [
            svg.line([(at, 0), (at, panel.height)], "grid" if m else "axis") for at, m in zip(xs, marks, strict=True)
        ]
        dots = [self._dot(panel, name, row) for row, name in enumerate(INTRINSICS)]
        below = panel.y + panel.height
        ticks = [
            svg.text((panel.x + at, below + 16), signed(m, 0) if m else "0", "tick middle")
            for at, m in zip(xs, marks, strict=True)
        ]
        names = [
            svg.text((panel.x - 8, panel.y + _ROW * row + 15), name, "label end") for row, name in enumerate(INTRINSICS)
        ]
        note = svg.text((panel.x + panel.width, below + 38), "k and p: at the image’s corner", "note end")
        title = svg.text((x + 14, y + 26), "Estimate less truth ± σ, px" if self.truth else "σ and 2σ, px", "title")
        return title + panel.show(svg.join(lines + dots)) + svg.join(names + ticks) + note

    def _dot(self, panel: Panel, name: str, row: int) -> svg.Marks:
        value, sigma = self.estimates.get(name, (np.nan, np.nan))
        unit = self._pixels_per[name]
        error = (value - self.true[name]) * unit if self.truth else 0.0
        free = name in FREE[self.free]
        if not np.isfinite(error) or (not free and not self.truth):
            return svg.NOTHING
        reach = _squeezed(error + np.array([-2, 2, -1, 1, 0]) * sigma * unit)
        (a, y), (b, _), (c, _), (d, _), at = panel.place(np.stack([reach, np.full(5, row + 0.5)], axis=-1))
        if not free:
            return svg.dots([at], "muted", 6)
        spread = svg.line([(a, y), (b, y)], "blue thin") + svg.line([(c, y), (d, y)], "blue thick")
        if 0 < at[0] < panel.width:
            return spread + svg.dots([at], "blue", 9)
        edge, inward = (panel.width - 2, -11) if at[0] > 0 else (2, 11)
        return spread + svg.polygon([(edge, y), (edge + inward, y - 6), (edge + inward, y + 6)], "fill-blue")

    @cached_property
    def _pixels_per(self) -> dict[str, float]:
        """How far, in pixels, the image's corner moves when a coefficient changes by 1; 1 for fx, fy, cx and cy."""
        camera = self._known
        at = camera.intrinsics.from_pixels((-0.5, -0.5))
        ray = camera.lens.unproject(at)
        ideal = ray[:2] / ray[2] if np.isfinite(ray).all() else at  # the corner may lie beyond a fold
        moved = {name: BrownConrady(**{name: 1.0}).distort(ideal) - ideal for name in INTRINSICS if name not in PIXELS}
        scaled = {name: float(camera.intrinsics.fx * np.linalg.norm(shift)) for name, shift in moved.items()}
        return dict.fromkeys(PIXELS, 1.0) | scaled


def _squeezed(pixels: np.ndarray | float) -> np.ndarray:
    """-1 … 1 for pixels from -_REACH to _REACH: linear below a pixel, logarithmic above."""
    return np.clip(np.arcsinh(2 * np.asarray(pixels)) / np.arcsinh(2 * _REACH), -1.1, 1.1)


def spread(name: str, sigma: float) -> str:
    """Two significant digits, as metrology asks (GUM, 7.2.6): where little is known, rounding decides the third."""
    if sigma >= (1e4 if name in PIXELS else 1e3):
        return "unknown"
    return f"{sigma:.4f}" if name not in PIXELS and sigma < 1 else f"{float(f'{sigma:.2g}'):g}"
