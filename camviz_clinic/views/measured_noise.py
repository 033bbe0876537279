"""What a measurement of a sensor says, drawn: its photon transfer, its straight line, its SNR and its darkness."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import ClassVar

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture
from camviz.draw.readout import listed
from camviz.views.base import View
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import LINEAR
from camviz_clinic.measuring.noise.trust import Figure

_WIDTH, _HEIGHT = 390, 212
_LAYOUT = rows((296, {"photon transfer": 480, "response": 480}), (296, {"signal to noise": 480, "darkness": 480}))
_LEGEND = [("blue", "measured"), ("orange", "dark noise and photons")]


@dataclass(frozen=True)
class MeasuredNoiseView(View):
    """The curves of an EMVA 1288 measurement, each with its points as measured and the model that was fitted."""

    title: ClassVar[str] = "A sensor measured"

    measurement: Measurement = field(repr=False, compare=False, kw_only=True)
    name: str = "this sensor"

    def figure(self, *, draft: bool = False) -> Picture:
        parts = {
            "photon transfer": self.transfer_panel(80, 34),
            "response": self.response_panel(560, 34),
            "signal to noise": self.snr_panel(80, 330),
            "darkness": self.dark_panel(560, 330),
        }
        return self.tiled(_LAYOUT, parts)

    def description(self) -> str:
        known = listed(self.numbers())
        return f"{self.name}, {len(self.measurement.levels)} levels of exposure: {known}."

    def numbers(self) -> dict[str, str]:
        """The EMVA figures with their units, as text; "not known" and the bounds for those that are withheld."""
        judged = self.measurement.judged
        return {words: told(name, judged[name]) for name, (words, _, _) in FIGURES.items()}

    def transfer_panel(self, x: float, y: float) -> Marks:
        """Temporal noise over signal on logarithmic axes: the ½ slope is the photons', its height the gain."""
        found = self.measurement
        signal, noise = _positive(found.signal), np.sqrt(_positive(found.variance))
        panel = _logarithmic("transfer", x, y, signal, np.maximum(noise, 0.3 * min(noise[0], noise[found.peak])))
        at = np.logspace(panel.left, panel.right, 60)
        shot = np.sqrt(found.gain_dn_per_e * at)
        whole = np.sqrt(found.dark_noise_dn**2 + shot**2)
        marks = [
            plot.curve(panel, np.log10(at), np.log10(shot), "orange dashed"),
            plot.curve(panel, np.log10(at), np.log10(whole), "orange"),
            plot.upright(panel, float(np.log10(LINEAR * signal[found.peak])), "muted dotted"),
            _dots(panel, signal, noise, "blue"),
            plot.legend(panel, [*_LEGEND, ("orange dashed", "photons alone, √(K · signal)")], "bottom right"),
        ]
        return _shown(panel, svg.join(marks), "Photon transfer", "signal above the dark (DN)", "noise (DN)")

    def response_panel(self, x: float, y: float) -> Marks:
        """Signal over light, with the deviation from a straight line in words."""
        found = self.measurement
        lit = bool(np.isfinite(found.photons).all())
        light = found.photons if lit else 1000 * found.exposures_s
        panel = plot.plot_panel("response", x, y, _WIDTH, _HEIGHT, (0, _top(light)), (0, _top(found.signal)))
        used = found.linear
        slope = float(np.sum(light[used] * found.signal[used]) / max(np.sum(light[used] ** 2), 1e-30))
        marks = plot.curve(panel, np.array([0, panel.right]), slope * np.array([0, panel.right]), "orange")
        marks += svg.dots(panel.place(np.stack([light, found.signal], axis=-1)), "blue", 4)
        error = found.judged["linearity_error"].value
        note = f"off the line by {100 * error:.2g} % on average" if isfinite(error) else ""
        xlabel = "photons per pixel" if lit else "exposure (ms)"
        return plot.plotted(panel, marks, xlabel, "signal (DN)", aside=58, title="Response", note=note)

    def snr_panel(self, x: float, y: float) -> Marks:
        """Signal to noise over electrons: measured, the model, and what no sensor exceeds."""
        found = self.measurement
        below = slice(found.peak + 1)  # saturated pixels have no noise, and no signal to tell
        electrons = _positive(found.signal[below]) / found.gain_dn_per_e
        seen = electrons / np.sqrt(_positive(found.variance[below])) * found.gain_dn_per_e
        panel = _logarithmic("snr", x, y, electrons, seen)
        at = np.logspace(panel.left, panel.right, 60)
        marks = plot.curve(panel, np.log10(at), 0.5 * np.log10(at), "muted dashed")
        marks += plot.curve(panel, np.log10(at), np.log10(found.snr(at)), "orange")
        marks += _dots(panel, electrons, seen, "blue")
        marks += plot.legend(panel, [*_LEGEND, ("muted dashed", "photons alone, √electrons")], "top left")
        return _shown(panel, marks, "Signal to noise", "electrons freed by light", "signal / noise")

    def dark_panel(self, x: float, y: float) -> Marks:
        """The dark frames' mean over exposure, whose slope is the dark current."""
        found = self.measurement
        exposure = 1000 * found.exposures_s
        dark = np.array([one.dark.mean for one in found.levels])
        spread = max(float(np.ptp(dark)), 0.02)
        limits = (float(dark.min()) - 0.2 * spread, float(dark.max()) + 0.2 * spread)
        panel = plot.plot_panel("dark", x, y, _WIDTH, _HEIGHT, (0, _top(exposure)), limits)
        marks = svg.dots(panel.place(np.stack([exposure, dark], axis=-1)), "blue", 4)
        if isfinite(found.dark_current_e_per_s):
            slope = found.dark_current_e_per_s * found.gain_dn_per_e / 1000
            ends = np.array([0, panel.right])
            marks += plot.curve(panel, ends, dark.mean() + slope * (ends - exposure.mean()), "orange")
        return plot.plotted(panel, marks, "exposure (ms)", "dark mean (DN)", aside=58, title="Darkness")


FIGURES: dict[str, tuple[str, float, str]] = {
    "gain_dn_per_e": ("system gain K", 1, "DN/e⁻"),
    "quantum_efficiency": ("quantum efficiency η", 100, "%"),
    "read_noise_e": ("temporal dark noise σ_d", 1, "e⁻"),
    "threshold_e": ("threshold μ_e.min", 1, "e⁻"),
    "threshold_photons": ("threshold μ_p.min", 1, "photons"),
    "full_well_e": ("saturation capacity", 1, "e⁻"),
    "snr_max_db": ("largest signal to noise", 1, "dB"),
    "dynamic_range_db": ("dynamic range", 1, "dB"),
    "prnu": ("PRNU", 100, "%"),
    "dsnu_e": ("DSNU", 1, "e⁻"),
    "dark_current_e_per_s": ("dark current", 1, "e⁻/s"),
}
"""The EMVA figures in the order of a datasheet: their words, and the factor and unit that they are written in."""


PARTS: dict[str, tuple[str, float, str]] = {
    "dsnu_row_e": ("DSNU of rows", 1, "e⁻"),
    "dsnu_column_e": ("DSNU of columns", 1, "e⁻"),
    "dsnu_pixel_e": ("DSNU of pixels", 1, "e⁻"),
    "prnu_row": ("PRNU of rows", 100, "%"),
    "prnu_column": ("PRNU of columns", 100, "%"),
    "prnu_pixel": ("PRNU of pixels", 100, "%"),
}
"""The row, column and pixel parts of the patterns, which a stack of frames tells."""


def written(name: str, value: float) -> str:
    """A figure of that name as a datasheet writes it."""
    _, factor, unit = (FIGURES | PARTS)[name]
    if not isfinite(value):
        return "not known"
    return f"{factor * value:.0f} {unit}" if abs(factor * value) >= 10_000 else f"{factor * value:.4g} {unit}"


def told(name: str, figure: Figure) -> str:
    """A figure as a datasheet writes it; where it is withheld, "not known" and between which values it lies."""
    if isfinite(figure.value) or not figure.bounded:
        return written(name, figure.value)
    if figure.low <= 0 and not name.endswith("_db"):
        return f"not known, at most {written(name, figure.high)}"
    return f"not known, from {written(name, figure.low)} to {written(name, figure.high)}"


def _positive(values: np.ndarray) -> np.ndarray:
    """What a logarithmic axis can show; NaN for the rest."""
    return np.where(values > 0, values, np.nan)


def _logarithmic(name: str, x: float, y: float, across: np.ndarray, up: np.ndarray) -> Panel:
    limits = [(np.log10(np.nanmin(v)) - 0.15, np.log10(np.nanmax(v)) + 0.15) for v in (across, up)]
    return plot.plot_panel(name, x, y, _WIDTH, _HEIGHT, *limits)


def _dots(panel: Panel, x: np.ndarray, y: np.ndarray, class_: str) -> Marks:
    return svg.dots(panel.place(np.log10(np.stack([x, y], axis=-1))), class_, 5)


def _shown(panel: Panel, marks: Marks, title: str, xlabel: str, ylabel: str) -> Marks:
    ticks = plot.logarithmic(panel.left, panel.right), plot.logarithmic(panel.bottom, panel.top)
    return plot.plotted(panel, marks, xlabel, ylabel, *ticks, aside=58, title=title)


def _top(values: np.ndarray) -> float:
    return 1.05 * max(float(np.max(values)), 1e-9)
