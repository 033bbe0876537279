"""Which parameters a calibration cannot tell apart: the correlation matrix of its solution."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import ceil
from typing import Any, ClassVar

import numpy as np

from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture, png
from camviz.draw.readout import signed
from camviz.draw.shades import Shades, bar
from camviz.lenses.base import Array
from camviz.views.base import View, choice
from camviz_clinic.calibration.identifiability import undecided_by_covariance, undecided_names
from camviz_clinic.views.observations import Missing
from camviz_clinic.views.uncertainty import adjusted, determined

_FIGURES = 10  # parameters up to which the cells have room for their numbers, also on a telephone
_NAME = 15.0  # picture units from one name to the next: of more than 30 parameters every second one is named
_STRONG = 0.95
_LAYOUT = rows((590, {"correlations": 660, "numbers": 300}))


@dataclass(frozen=True)
class CorrelationView(View):
    """The correlations (n, n) of a solution's parameters, from their covariance, with each one's standard deviation.

    Two that hang together by almost ±1 can be traded for one another: the corners cannot tell which of them it is.
    Parameters that the corners do not decide (`undecided`) have no standard deviation.
    """

    title: ClassVar[str] = "What the solution cannot tell apart"

    names: tuple[str, ...]
    covariance: Array = field(compare=False, repr=False)
    values: Array | None = field(default=None, compare=False, repr=False)
    undecided: frozenset[str] = frozenset()
    show: str = choice("correlation", "size only", label="show", help="with its sign, or how strong it is")

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.names)
        if self.covariance.shape != (n, n):
            raise ValueError(f"covariance must have shape {(n, n)} as there are {n} names, got {self.covariance.shape}")

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> CorrelationView:
        """The view of a calibration: from its corners, or from the covariance that its file holds. Raises Missing."""
        name = camera or next(iter(calibration.cameras))
        try:
            return cls.about(adjusted(calibration, *([name] if len(calibration.cameras) > 1 else [])))
        except Missing as missing:
            if name not in calibration.intrinsics_covariance or name not in calibration.estimated:
                raise missing
        names, covariance = calibration.estimated[name], calibration.intrinsics_covariance[name]
        combinations = undecided_by_covariance(calibration.cameras[name], names, covariance)
        return cls(names, covariance, undecided=frozenset(key for each in combinations for key in each.changes))

    @classmethod
    def about(cls, adjustment: Any) -> CorrelationView:
        """The view of an adjustment's shared parameters; a lone camera's without its name. Raises Missing.

        The standard deviations are by the scatter of the views. What hangs together follows from where the corners are,
        and so the correlations are by their noise: a handful of views tells too little of so many.
        """
        names = determined(adjustment).parameters
        by_corners = adjustment.corner_covariance
        times = np.sqrt(np.diag(adjustment.covariance) / np.diag(by_corners))
        alone = len(adjustment.cameras) == 1
        lacking = {f"{name}.{key}" for name in adjustment.cameras for key in undecided_names(adjustment, name)}
        shown, undecided = ([name.split(".", 1)[1] if alone else name for name in each] for each in (names, lacking))
        return cls(tuple(shown), by_corners * np.outer(times, times), undecided=frozenset(undecided))

    @cached_property
    def correlations(self) -> Array:
        """The matrix (n, n), -1 … 1; NaN for a parameter without a variance."""
        deviation = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.clip(self.covariance / np.outer(deviation, deviation), -1, 1)

    def strongest(self) -> list[tuple[str, str, float]]:
        """The pairs of different parameters by the size of their correlation, the strongest first."""
        i, j = np.triu_indices(len(self.names), 1)
        order = np.argsort(-np.abs(np.nan_to_num(self.correlations[i, j])))
        return [(self.names[i[k]], self.names[j[k]], float(self.correlations[i[k], j[k]])) for k in order]

    def deviations(self) -> dict[str, str]:
        """Each parameter's standard deviation in words."""
        sigmas = zip(self.names, np.sqrt(np.diag(self.covariance)), strict=True)
        return {name: "not known" if name in self.undecided else f"±{sigma:.3g}" for name, sigma in sigmas}

    def description(self) -> str:
        told = "; ".join(f"{a} with {b} {signed(r, 2)}" for a, b, r in self.strongest()[:6])
        deviations = "; ".join(f"{name} {said}" for name, said in self.deviations().items())
        return (
            f"Correlations of {len(self.names)} parameters. The strongest: {told}. Standard deviations: {deviations}."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        n = len(self.names)
        side = 460.0
        cell = side / max(n, 1)
        panel = Panel("correlation", 130, 34, side, side, 0, n, 0, n)
        shown = np.abs(self.correlations) if self.show == "size only" else self.correlations
        shades = Shades(0, 1) if self.show == "size only" else Shades(-1, 1, diverging=True)
        content = svg.image("matrix", 0, 0, side, side, image_rendering="pixelated")
        if n <= _FIGURES:
            places = panel.place(np.stack(np.meshgrid(np.arange(n) + 0.5, np.arange(n) + 0.5), -1)).reshape(-1, 2)
            # The cells' colours are the same in both themes, and so are the words on them.
            lightness = shades.rgba(shown)[..., :3].astype(float).reshape(-1, 3) @ (0.299, 0.587, 0.114)
            content += svg.join(
                svg.text(
                    place + (0, 4),
                    f"{r:.2f}" if self.show == "size only" else signed(r, 2),
                    "tick middle",
                    fill="#14181f" if light > 140 else "#ffffff",
                )
                for place, r, light in zip(places, shown.ravel(), lightness, strict=True)
                if np.isfinite(r)
            )
        legend, bar_picture = bar(panel.x + side + 14, 64, side - 60, "matrix-bar", shades, "r")
        body = panel.show(content, title="Correlations") + legend + self._names(panel, cell)
        parts = {"correlations": body, "numbers": self._words(680)}
        return self.tiled(_LAYOUT, parts, {"matrix": png(shades.rgba(shown)), **bar_picture})

    def _names(self, panel: Panel, cell: float) -> Marks:
        parts = []
        for i in range(0, len(self.names), ceil(_NAME / cell)):
            name = self.names[i]
            parts.append(svg.text((panel.x - 8, panel.y + (i + 0.5) * cell + 4), name, "tick end"))
            x, y = panel.x + (i + 0.5) * cell, panel.y + panel.height + 12
            parts.append(svg.text((x, y), name, "tick end", turned_deg=-55))
        return svg.join(parts)

    def _words(self, x: float) -> Marks:
        words = svg.text((x, 48), "The strongest pairs", "title")
        for i, (a, b, r) in enumerate(self.strongest()[:9]):
            words += svg.text((x, 72 + 20 * i), signed(r, 2), "number" + (" red" if abs(r) > _STRONG else ""))
            words += svg.text((x + 50, 72 + 20 * i), f"{a} – {b}", "label")
        words += svg.text((x, 280), "One standard deviation", "title")
        rows = list(self.deviations().items())
        for i, (name, said) in enumerate(rows[:12]):
            words += svg.text((x, 302 + 17 * i), name, "note") + svg.text((x + 140, 302 + 17 * i), said, "number")
        if len(rows) > 12:
            words += svg.text((x, 302 + 17 * 12), f"and {len(rows) - 12} more", "note")
        advice = (
            "Close to ±1: the boards cannot tell the two apart. Neighbouring terms of a polynomial (k1, k2, k3) "
            "and fx with fy always hang together."
        )
        return words + svg.paragraph((x, 520), advice, 270)
