"""What one slanted edge says of a camera's sharpness, drawn: the edge, its profile, and its MTF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import ClassVar

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.marks import Marks
from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed
from camviz.scenes import to_display
from camviz.views.base import View
from camviz_clinic.measuring.sharpness import SlantedEdge

_WORDS = {
    "mtf50_cycles_per_pixel": ("MTF50", "{:.3f} cycles/pixel"),
    "mtf50_standard_error": ("standard error of MTF50", "{:.2g} cycles/pixel"),
    "mtf10_cycles_per_pixel": ("MTF10", "{:.3f} cycles/pixel"),
    "mtf_at_quarter_cycle": ("MTF at 0.25 cycles/pixel", "{:.3f}"),
    "mtf_at_half_cycle": ("MTF at 0.5 cycles/pixel", "{:.3f}"),
    "rise_10_90_pixels": ("rise from 10 to 90 %", "{:.2f} px"),
    "angle_deg": ("angle", "{:.1f}°"),
    "contrast_over_noise": ("contrast over noise", "{:.0f}"),
    "clipped_percent": ("pixels at an end of the scale", "{:.1f} %"),
    "light_across_percent_per_pixel": ("light changes across", "{:.2f} % per px"),
    "light_along_percent": ("light changes along", "{:.1f} %"),
    "off_a_line_pixels": ("rows off a straight line", "{:.3f} px"),
    "widest_gap_pixels": ("widest gap between samples", "{:.3f} px"),
    "scatter_at_edge_percent": ("scatter at the edge beyond noise", "{:.1f} %"),
    "noise_shared_factor": ("shared noise widens the error", "{:.2f} times"),
}


def written(figures: Mapping[str, float]) -> dict[str, str]:
    """Figures by name as text with their units, by the words for them."""
    pairs = {_WORDS[name]: value for name, value in figures.items()}
    return {words: form.format(value) if isfinite(value) else "not known" for (words, form), value in pairs.items()}


_LAYOUT = rows((320, {"photograph": 280, "profile": 330, "contrast": 350}))


@dataclass(frozen=True)
class MeasuredEdgeView(View):
    """An edge as photographed, its profile across, and how much of a grating's contrast is left."""

    title: ClassVar[str] = "Sharpness of an edge"

    edge: SlantedEdge = field(repr=False, compare=False, kw_only=True)
    name: str = "this edge"

    def figure(self, *, draft: bool = False) -> Picture:
        parts = {"photograph": self._photograph(), "profile": self._profile(), "contrast": self._curve()}
        light = self.edge.image / max(float(np.percentile(self.edge.image, 99)), 1e-12)
        return self.tiled(_LAYOUT, parts, {"edge": jpeg(to_display(light))})

    def description(self) -> str:
        edge = self.edge
        figures = {
            "mtf50_cycles_per_pixel": edge.mtf50,
            "mtf50_standard_error": edge.mtf50_error,
            "rise_10_90_pixels": edge.rise,
            "angle_deg": abs(edge.angle_deg),
        }
        return f"{self.name}: " + listed(written(figures)) + "."

    def _photograph(self) -> Marks:
        height, width = self.edge.image.shape
        panel = image_panel("photograph", 10, 34, 260, width, height, tallest=236)
        v = np.array([-0.5, height - 0.5])
        slope, intercept = self.edge.line
        content = placed_image(panel, "edge", width, height)
        content += svg.line(panel.place(np.stack([slope * v + intercept, v], axis=-1)), "orange")
        return panel.show(content, title="The edge", note=f"{abs(self.edge.angle_deg):.1f}°")

    def _profile(self) -> Marks:
        reach = max(4.0, 2 * self.edge.rise)
        panel = plot.plot_panel("profile", 342, 34, 258, 236, (-reach, reach), (-0.15, 1.15))
        places, values = self.edge.edge_spread
        near = np.abs(places) <= reach
        curve, note = plot.curve(panel, places[near], values[near], "blue"), f"10–90 %: {self.edge.rise:.2f} px"
        return plot.plotted(panel, curve, "distance (px)", "light", title="Across the edge", note=note)

    def _curve(self) -> Marks:
        edge = self.edge
        panel = plot.plot_panel("curve", 670, 34, 280, 236, (0, 1), (0, 1.1))
        frequency, values = edge.curve
        content = plot.upright(panel, 0.5, "muted dotted") + plot.curve(panel, frequency, values, "blue")
        if isfinite(edge.mtf50):
            at = panel.place([(0, 0.5), (edge.mtf50, 0.5), (edge.mtf50, 0)])
            content += svg.line(at, "orange dashed") + svg.dots(at[1:2], "orange", 6)
        nyquist = panel.place((0.5, 1.1))
        content += svg.text((nyquist[0] + 5, 14), "Nyquist", "note halo")
        note = f"MTF50: {edge.mtf50:.3f} ± {edge.mtf50_error:.3f}" if isfinite(edge.mtf50) else ""
        return plot.plotted(panel, content, "cycles per pixel", "MTF", title="Contrast that is left", note=note)
