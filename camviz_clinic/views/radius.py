"""Residuals against the distance from the principal point, and by their direction over the picture."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import image_panel
from camviz.draw.picture import Picture
from camviz.draw.readout import true_minus
from camviz.lenses.base import Array
from camviz.views.base import slider
from camviz.views.marks import arrows
from camviz_clinic.views.observations import Observations, ObservedView
from camviz_clinic.views.residuals import nice

_RINGS, _CELLS = 12, (10, 8)
_FEW = 8  # corners of a ring below which its standard error says little
_MOST_DOTS = 1500
_LAYOUT = rows((386, {"picture": 450, "rings": 510}), (50, {"in words": 960}))


@dataclass(frozen=True)
class RadiusView(ObservedView):
    """Whether the residuals point outward or around the principal point somewhere, as they do under too simple a lens.

    Outward and around: each used corner's residual along the line from the principal point and across it, with the mean
    of every ring and twice its standard error. Over the picture: the mean residual of every cell as an arrow.
    """

    title: ClassVar[str] = "Residuals against radius and direction"

    observations: Observations = field(compare=False, repr=False)
    scale: float = slider(
        100.0, 1, 1000, 1, label="arrows", unit="×", help="how much longer the arrows are than the mean"
    )

    @classmethod
    def about(cls, observations: Observations) -> Self:
        """The view with arrows of a length that can be seen."""
        means = np.linalg.norm(cls(observations).cells[1], axis=-1)
        largest = float(np.nanmax(means)) if np.isfinite(means).any() else 0.0
        per_pixel = 400 / observations.camera.intrinsics.width
        return cls(observations, float(np.clip(nice(34 / (largest * per_pixel)), 1, 1000)) if largest > 0 else 1.0)

    @cached_property
    def polar(self) -> tuple[Array, Array, Array]:
        """Radius, outward part and part around (clockwise as seen), each (n,) in pixels, of the used corners."""
        seen, k = self.observations, self.observations.camera.intrinsics
        away = seen.projected[seen.used] - (k.cx, k.cy)
        radius = np.linalg.norm(away, axis=-1)
        out = away / np.maximum(radius, 1e-9)[:, None]
        residual = seen.residuals[seen.used]
        return radius, np.sum(out * residual, axis=-1), out[:, 0] * residual[:, 1] - out[:, 1] * residual[:, 0]

    @cached_property
    def rings(self) -> Array:
        """Per ring (rings, 5): middle radius, and of the parts outward and around the mean and its standard error."""
        radius, *parts = self.polar
        edges = np.linspace(0, float(radius.max(initial=1.0)) * (1 + 1e-9), _RINGS + 1)
        ring = np.clip(np.searchsorted(edges, radius, side="right") - 1, 0, _RINGS - 1)
        rows = []
        for i in range(_RINGS):
            chosen = [part[ring == i] for part in parts]
            few = len(chosen[0]) < _FEW
            figures = [np.nan] * 4
            if not few:
                figures = [
                    f for p, whole in zip(chosen, parts, strict=True) for f in (p.mean(), _standard_error(p, whole))
                ]
            rows.append([(edges[i] + edges[i + 1]) / 2, *figures])
        return np.array(rows, dtype=float)

    @cached_property
    def cells(self) -> tuple[Array, Array]:
        """Middles (m, 2) of the picture's cells and the mean residual (m, 2) there, in pixels; NaN below 3 corners."""
        seen, k = self.observations, self.observations.camera.intrinsics
        size, counts = np.array([k.width, k.height]), np.array(_CELLS)
        where = np.clip((seen.detections[seen.used] + 0.5) / size * counts, 0, counts - 1).astype(int)
        cell = where[:, 1] * counts[0] + where[:, 0]
        number = np.bincount(cell, minlength=counts.prod())
        sums = np.stack([np.bincount(cell, part, counts.prod()) for part in seen.residuals[seen.used].T], axis=-1)
        middles = (np.stack(np.meshgrid(*map(np.arange, counts)), -1).reshape(-1, 2) + 0.5) * size / counts - 0.5
        return middles, sums / np.where(number >= 3, number, np.nan)[:, None]

    def numbers(self) -> dict[str, float]:
        """The largest mean of a ring, outward and around, in pixels and in standard errors."""
        figures = {}
        for name, mean, error in (("outward", 1, 2), ("around", 3, 4)):
            ratio = np.abs(self.rings[:, mean]) / np.maximum(self.rings[:, error], 1e-12)
            i = int(np.nanargmax(ratio)) if np.isfinite(ratio).any() else 0
            figures[f"{name}_px"], figures[f"{name}_errors"] = float(self.rings[i, mean]), float(ratio[i])
        return figures

    def description(self) -> str:
        n = self.numbers()
        return (
            f"{self.observations.used.sum()} corners of {self.observations.name}. The ring that stands out most is off "
            f"by {n['outward_px']:+.3f} px outward ({n['outward_errors']:.1f} standard errors) and by "
            f"{n['around_px']:+.3f} px around ({n['around_errors']:.1f}). Arrows {self.scale:g} times as long as the "
            "mean residual of their cell."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        plots = NOTHING
        for i, (name, title) in enumerate((("outward", "Outward"), ("around", "Around the principal point"))):
            plots += self._plot(name, title, 1 + i, 34 + 172 * i, 128)
        advice = (
            "Noise scatters around zero. A ring's mean off zero by more than its pale bars says that the model "
            "is too simple there, or the board not flat."
        )
        parts: dict[str, Part] = {"picture": self._picture(), "rings": plots, "in words": Sentences(advice)}
        return self.tiled(_LAYOUT, parts)

    def _plot(self, name: str, title: str, part: int, y: float, height: float) -> Marks:
        radius, values = self.polar[0], self.polar[part]
        middle, mean, error = self.rings[:, 0], self.rings[:, 2 * part - 1], self.rings[:, 2 * part]
        reach = max(
            float(np.quantile(np.abs(values), 0.98)) if len(values) else 0,
            float(np.nanmax(np.abs(mean) + 2 * error, initial=0)),
            1e-6,
        )
        panel = plot.plot_panel(
            name, 530, y, 410, height, (0, max(1.0, 1.03 * radius.max(initial=0))), (-1.1 * reach, 1.1 * reach)
        )
        dots = np.stack([radius, np.where(np.abs(values) <= 1.1 * reach, values, np.nan)], axis=-1)
        dots = dots[:: max(1, len(dots) // _MOST_DOTS)]
        ticks = plot.ticks(panel.bottom, panel.top, 4) + 0.0
        yticks = [(y, true_minus(f"{y:.3g}")) for y in ticks.tolist()]
        content = svg.dots(panel.place(dots), "muted faint", 3)
        low, high = (panel.place(np.stack([middle, mean + sign * 2 * error], -1)) for sign in (-1, 1))
        content += svg.segments(low, high, "orange half", stroke_width=7, stroke_linecap="butt")
        known = np.isfinite(mean)
        content += plot.curve(panel, middle[known], mean[known], "orange thick") + svg.dots(
            panel.place(np.stack([middle, mean], -1)), "orange", 7
        )
        label = "from the principal point [px]" if part == 2 else ""
        note = "mean of a ring ± 2 standard errors" if part == 1 else "clockwise is positive"
        return plot.plotted(panel, content, label, "[px]", None, yticks, title=title, note=note)

    def _picture(self) -> Marks:
        k = self.observations.camera.intrinsics
        panel = image_panel("cells", 20, 34, 430, k.width, k.height, tallest=300)
        middles, means = self.cells
        starts, ends = panel.place(middles), panel.place(middles + self.scale * means)
        lines = [panel.place([(x, -0.5), (x, k.height - 0.5)]) for x in np.linspace(0, k.width, _CELLS[0] + 1) - 0.5]
        lines += [panel.place([(-0.5, y), (k.width - 0.5, y)]) for y in np.linspace(0, k.height, _CELLS[1] + 1) - 0.5]
        known = np.isfinite(means[:, 0])
        centre = panel.place([(k.cx, k.cy)])
        content = (
            svg.path(lines, "grid")
            + svg.dots(centre, "ink", 8)
            + svg.text(centre[0] + (8, -6), "principal point", "note halo")
        )
        content += svg.dots(starts[known], "green", 4) + arrows(starts[known], ends[known], "orange", 8)
        return panel.show(content, title=f"Mean residual of every cell, × {self.scale:g}")


def _standard_error(values: Array, whole: Array) -> float:
    """Of the mean of a ring's values; not below what the scatter over the whole picture would give it."""
    low, high = np.quantile(whole, [0.16, 0.84])
    return float(max(np.std(values, ddof=1), (high - low) / 2) / np.sqrt(len(values)))
