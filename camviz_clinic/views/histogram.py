"""The residuals as a histogram, beside the bell curve that pure noise would give."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.special import erf, ndtri

from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.picture import Picture
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.views.base import choice
from camviz_clinic.views.observations import Observations, ObservedView

_BINS = 61
_LAYOUT = rows((330, {"histogram": 485, "quantiles": 265, "numbers": 210}))


@dataclass(frozen=True)
class HistogramView(ObservedView):
    """How the residuals of all used corners are spread, against a Gaussian; and quantile against quantile.

    The Gaussian's width comes from the middle half of the residuals, so that a few gross errors cannot hide in it.
    """

    title: ClassVar[str] = "Are the residuals noise?"

    observations: Observations = field(compare=False, repr=False)
    component: str = choice("both", "u", "v", label="residuals", help="across the picture, down it, or both together")

    @cached_property
    def values(self) -> Array:
        """The residuals (n,) in pixels, sorted."""
        chosen = self.observations.residuals[self.observations.used]
        return np.sort({"u": chosen[:, 0], "v": chosen[:, 1]}.get(self.component, chosen.ravel()))

    @cached_property
    def sigma(self) -> float:
        """σ of the Gaussian whose quartiles are those of the residuals, in pixels."""
        if len(self.values) < 8:
            return float("nan")
        low, high = np.quantile(self.values, [0.25, 0.75])
        return float((high - low) / (2 * ndtri(0.75)))

    def numbers(self) -> dict[str, str]:
        """The key figures, as text."""
        x, sigma = self.values, self.sigma
        if not sigma > 0:
            return {"residuals": f"{len(x)}, too few or too alike for a Gaussian"}
        beyond = np.abs(x - np.median(x)) > 3 * sigma
        share = 1 - erf(3 / np.sqrt(2))
        return {
            "residuals": f"{len(x)}",
            "RMS": f"{np.sqrt(np.mean(x**2)):.3g} px",
            "σ of the middle half": f"{sigma:.3g} px",
            "beyond 3σ": f"{beyond.sum()} ({100 * beyond.mean():.1f} %; noise: {share * len(x):.0f})",
            "largest": f"{np.abs(x).max():.3g} px, {np.abs(x).max() / sigma:.1f}σ",
        }

    def description(self) -> str:
        which = {"u": "across the picture", "v": "down the picture"}.get(self.component, "in both directions")
        return f"Residuals {which}: " + listed(self.numbers()) + "."

    def figure(self, *, draft: bool = False) -> Picture:
        parts = {"histogram": self._histogram(), "quantiles": self._quantiles(), "numbers": self._words()}
        return self.tiled(_LAYOUT, parts)

    @property
    def _reach(self) -> float:
        """Half the width of the histogram in pixels: what holds almost all, but at least four σ."""
        x = self.values
        if not len(x):
            return 1.0
        return float(
            min(max(4 * np.nan_to_num(self.sigma), 1.05 * np.quantile(np.abs(x), 0.995)), 1.05 * np.abs(x).max() + 1e-9)
        )

    def _histogram(self) -> Marks:
        reach, x = self._reach, self.values
        count, edges = np.histogram(x, bins=_BINS, range=(-reach, reach))
        middle = (edges[1:] + edges[:-1]) / 2
        width = edges[1] - edges[0]
        bell = np.zeros(_BINS)
        if self.sigma > 0:
            falling = np.exp(-0.5 * ((middle - np.median(x)) / self.sigma) ** 2)
            bell = len(x) * width * falling / (self.sigma * np.sqrt(2 * np.pi))
        panel = plot.plot_panel("histogram", 70, 34, 400, 240, (-reach, reach), (0, 1.15 * max(1.0, *count, *bell)))
        content = plot.bars(panel, edges[:-1], edges[1:], count.astype(float), "fill-blue half")
        content += plot.curve(panel, middle, bell, "orange thick") if self.sigma > 0 else NOTHING
        content += plot.legend(panel, [("blue thick", "residuals"), ("orange thick", "Gaussian")])
        return plot.plotted(panel, content, "residual [px]", "corners", title="How they are spread")

    def _quantiles(self) -> Marks:
        """Sorted residuals over what a Gaussian of the same number would have: noise lies on the line."""
        x = self.values
        reach = max(self._reach, 1e-9)
        sigma = self.sigma if self.sigma > 0 else 1.0
        panel = plot.plot_panel("quantiles", 545, 34, 190, 240, (-3.6, 3.6), (-reach, reach))
        content = plot.curve(panel, np.array([-3.6, 3.6]), 3.6 * np.array([-sigma, sigma]), "orange thick")
        if len(x):
            normal = ndtri((np.arange(len(x)) + 0.5) / len(x))
            ends = np.arange(min(40, len(x))), np.arange(max(0, len(x) - 40), len(x))
            shown = np.unique(np.concatenate([*ends, np.linspace(0, len(x) - 1, 160).astype(int)]))
            content += svg.dots(panel.place(np.stack([normal[shown], x[shown]], -1)), "blue", 4)
        return plot.plotted(panel, content, "of a Gaussian [σ]", "residual [px]", title="Quantile by quantile")

    def _words(self) -> Marks:
        figures = readout(self.numbers(), (765, 48), (0, 38), (0, 17))
        advice = (
            "Pure noise follows the orange curve. Tails that stand off it are outliers; a flat or two-peaked "
            "shape is a model that does not fit."
        )
        return figures + svg.paragraph((765, 248), advice, 190)
