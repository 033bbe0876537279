"""Where in the picture the corners were, how far out, and how the board was held."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from camviz.draw import plot, svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel, image_panel
from camviz.draw.picture import Picture, png
from camviz.draw.shades import Shades, bar
from camviz.lenses.base import Array
from camviz.views.base import Drawn, choice
from camviz_clinic.views.observations import Observations, ObservedView, short_names

_RINGS = 8
_MOST_DOTS = 4000
_LAYOUT = rows((412, {"coverage": 520, "how far out and how held": 440}), (34, {"in words": 960}))


@dataclass(frozen=True)
class CoverageView(ObservedView):
    """How many corners fell on every part of the picture: the calibration knows nothing where there were none."""

    title: ClassVar[str] = "Coverage"

    observations: Observations = field(compare=False, repr=False)
    cells: str = choice("16 × 12", "8 × 6", "32 × 24", label="cells", help="how finely the picture is divided")
    count: str = choice("corners", "views", label="count", help="corners, or views that have a corner there")

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """How many used corners, or views with one, fall on every cell (rows, columns)."""
        seen, k = self.observations, self.observations.camera.intrinsics
        columns, rows = map(int, self.cells.split(" × "))
        where = (seen.detections[seen.used] + 0.5) / (k.width, k.height) * (columns, rows)
        view = np.nonzero(seen.used)[0]
        inside = ((where >= 0) & (where < (columns, rows))).all(axis=-1)
        column, row = where[inside].astype(int).T
        keys = np.stack([row, column, view[inside] if self.count == "views" else np.arange(inside.sum())], axis=-1)
        keys = np.unique(keys, axis=0)
        return np.bincount(keys[:, 0] * columns + keys[:, 1], minlength=rows * columns).reshape(rows, columns)

    @cached_property
    def rings(self) -> tuple[Array, Array, Array]:
        """Edges (n + 1,) of rings around the picture's middle in half diagonals, and per ring the shares (n,) of the
        picture and of the corners."""
        seen, k = self.observations, self.observations.camera.intrinsics
        middle = np.array([k.width - 1, k.height - 1]) / 2
        half = np.hypot(k.width, k.height) / 2
        edges = np.linspace(0, 1, _RINGS + 1)
        u, v = np.meshgrid(np.linspace(-0.5, k.width - 0.5, 200), np.linspace(-0.5, k.height - 0.5, 200))
        pixels = np.hypot(u - middle[0], v - middle[1]).ravel() / half
        corners = np.linalg.norm(seen.detections[seen.used] - middle, axis=-1) / half
        shares = [np.histogram(r, edges)[0] / max(len(r), 1) for r in (pixels, corners)]
        return edges, shares[0], shares[1]

    def numbers(self) -> dict[str, float]:
        """Share of the picture's cells with a corner, how far out the corners reach in half diagonals, tilts in °."""
        seen, k = self.observations, self.observations.camera.intrinsics
        middle = np.array([k.width - 1, k.height - 1]) / 2
        away = np.linalg.norm(seen.detections[seen.used] - middle, axis=-1) / (np.hypot(k.width, k.height) / 2)
        return {
            "share": float(np.mean(self.counts > 0)),
            "reach": float(away.max(initial=0)),
            "tilt_low": float(np.nanmin(seen.tilts_deg)),
            "tilt_high": float(np.nanmax(seen.tilts_deg)),
        }

    def description(self) -> str:
        n, seen = self.numbers(), self.observations
        return (
            f"{seen.used.sum()} corners in {len(seen)} views of {seen.name} touch {100 * n['share']:.0f} % of the "
            f"picture's {self.cells} cells and reach {100 * n['reach']:.0f} % of the way to the corner. The board was "
            f"tilted by {n['tilt_low']:.0f}° to {n['tilt_high']:.0f}° and held {np.nanmin(seen.distances):.2g} m to "
            f"{np.nanmax(seen.distances):.2g} m away."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        heat, attached = self._map()
        n = self.numbers()
        words = (
            f"{100 * n['share']:.0f} % of the cells have a corner; the farthest corner lies "
            f"{100 * n['reach']:.0f} % of the way out."
        )
        held = self._radius() + self._tilt()
        parts: dict[str, Part] = {"coverage": heat, "how far out and how held": held, "in words": Sentences(words)}
        return self.tiled(_LAYOUT, parts, attached)

    def _map(self) -> Drawn:
        seen, k, counts = self.observations, self.observations.camera.intrinsics, self.counts
        panel = image_panel("coverage", 20, 34, 440, k.width, k.height, tallest=340)
        shades = Shades(0, float(max(1, counts.max())))
        rgba = shades.rgba(np.where(counts > 0, counts, np.nan))
        content = svg.image("counts", 0, 0, panel.width, panel.height, image_rendering="pixelated")
        corners = seen.detections[seen.used]
        content += svg.dots(panel.place(corners[:: max(1, len(corners) // _MOST_DOTS)]), "paper-dot", 2.5)
        content += self._figures(panel)
        legend, bar_picture = bar(panel.x + panel.width + 10, 60, panel.height - 40, "counts-bar", shades, self.count)
        shown = panel.show(content, title=f"{self.count.capitalize()} in every cell", note="bare: none")
        return shown + legend, {"counts": png(rgba), **bar_picture}

    def _figures(self, panel: Panel) -> Marks:
        """The counts as numbers, where the cells are large enough for them."""
        rows, columns = self.counts.shape
        if columns > 8:
            return NOTHING
        return svg.join(
            svg.text(
                ((j + 0.5) * panel.width / columns, (i + 0.5) * panel.height / rows + 4), f"{n}", "label halo middle"
            )
            for (i, j), n in np.ndenumerate(self.counts)
        )

    def _radius(self) -> Marks:
        edges, picture, corners = self.rings
        left, right, top = 100 * edges[:-1], 100 * edges[1:], 100 * max(picture.max(), corners.max()) * 1.3
        panel = plot.plot_panel("rings", 585, 34, 355, 120, (0, 100), (0, float(top)))
        content = plot.bars(panel, left + 0.8, right - 0.8, 100 * corners, "fill-blue")
        steps = np.stack([np.repeat(100 * edges, 2)[1:-1], np.repeat(100 * picture, 2)], -1)
        content += svg.line(panel.place(steps), "orange thick")
        content += plot.legend(panel, [("blue thick", "corners"), ("orange thick", "the picture’s area")], "top right")
        names = "from the middle to the corner [%]", "share [%]"
        return plot.plotted(panel, content, *names, title="How far out")

    def _tilt(self) -> Marks:
        seen = self.observations
        distance = seen.distances
        steepest, farthest = max(60.0, 1.1 * float(np.nanmax(seen.tilts_deg))), 1.12 * float(np.nanmax(distance))
        panel = plot.plot_panel("tilt", 585, 226, 355, 130, (0, steepest), (0, farthest))
        points = np.stack([seen.tilts_deg, distance], axis=-1)
        content = svg.dots(panel.place(points), "blue", 9)
        if len(seen) <= 40:
            content += svg.join(
                svg.text(panel.place(p) + (6, -5), name, "tick halo")
                for name, p in zip(short_names(seen.pictures, len(seen)), points, strict=True)
            )
        names = "tilt against the line of sight [°]", "distance [m]"
        return plot.plotted(panel, content, *names, title="How the board was held", note="one dot per view")
