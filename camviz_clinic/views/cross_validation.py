"""Asking a calibration what it has not seen: two halves of the views against each other, and corners held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from camviz.draw import plot
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.marks import Marks
from camviz.draw.panel import image_panel
from camviz.draw.picture import Picture
from camviz.draw.shades import Shades, bar, contours, heat
from camviz.views.base import Drawn, View, choice
from camviz.views.view_bars import names_below
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.cross_validation import Halves, HeldOut, halves, held_out
from camviz_clinic.calibration.problem import rms_by_view
from camviz_clinic.views.observations import Missing, short_names
from camviz_clinic.views.uncertainty import adjusted, determined

_GRID = (30, 20)
_PARTS = ("earlier and later", "every other")
_BY_CHANCE = 1e-6  # below this probability noise is not the reason
_LAYOUT = rows((368, {"two halves": 490, "every view": 470}), (72, {"in words": 960}))


@dataclass(frozen=True)
class CrossValidationView(View):
    """The difference of solutions from halves of the views, beside what noise lets expect; held-out corners, by view.

    A view's corners are held out by halves of the board: its pose is fitted to one half and tried on the other.
    """

    title: ClassVar[str] = "Cross-validation"

    adjustment: Adjustment = field(compare=False, repr=False)
    held: HeldOut = field(compare=False, repr=False)
    fitted: tuple[float, ...] = field(compare=False, repr=False)
    camera: str = "camera"
    pictures: tuple[str, ...] = field(default=(), repr=False)
    parts: str = choice(
        "earlier and later",
        "every other",
        label="halves",
        help="the first half of the views against the second, or by turns",
    )
    show: str = choice("difference", "expected from noise", "ratio", label="map", help="what is shown over the picture")

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> CrossValidationView:
        """The view of a calibration. Raises Missing where it has too few views for two halves, or no corners."""
        name = camera or next(iter(calibration.cameras))
        return cls.about(adjusted(calibration, name), name, calibration.pictures.get(name, ()))

    @classmethod
    def about(
        cls,
        adjustment: Adjustment,
        camera: str = "",
        pictures: tuple[str, ...] = (),
        held_of: Callable[[str], HeldOut] | None = None,
    ) -> CrossValidationView:
        """The view of an adjustment, of those halves that agree less. Raises Missing where there can be none.

        `held_of` gives the corners of a camera that were held out, where they are known already.
        """
        name = camera or next(iter(adjustment.cameras))
        determined(adjustment)
        try:
            parts = min(_PARTS, key=lambda parts: _halves(adjustment, name, parts).probability)
            held = held_of(name) if held_of else held_out(adjustment, camera=name)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise Missing(f"There can be no cross-validation: {error}.") from error
        if not np.isfinite(held.variances).any():
            raise Missing("There can be no cross-validation: half a board of so few corners gives no pose.")
        squares = np.where(adjustment.used[name], np.sum(adjustment.residuals[name] ** 2, axis=-1), np.nan)
        fitted = np.nan_to_num(rms_by_view(squares))
        return cls(adjustment, held, tuple(fitted.tolist()), name, pictures, parts)

    @property
    def halves(self) -> Halves:
        """The two solutions and their difference."""
        return _halves(self.adjustment, self.camera, self.parts)

    def numbers(self) -> dict[str, float]:
        """The halves' median difference over what is expected, its probability, and the held-out RMS and its ratio."""
        return {
            "ratio": self.halves.ratio,
            "probability": self.halves.probability,
            "held_out": self.held.rms,
            "held_out_expected": self.held.expected_rms,
            "held_out_ratio": self.held.ratio,
        }

    def sentences(self) -> list[str]:
        """What the numbers mean, in words."""
        n = self.numbers()
        agree = n["probability"] > _BY_CHANCE
        which = (
            "The earlier and the later views" if self.parts == "earlier and later" else "Every other view and the rest"
        )
        return [
            f"{which} give cameras that differ by {n['ratio']:.1f} times what noise lets expect (probability "
            f"{n['probability']:.2g}): " + ("noise may do that." if agree else "something besides noise is at work."),
            f"Corners held out of their view's pose are off by {n['held_out']:.3g} px RMS, "
            f"{n['held_out_ratio']:.1f} times what noise alone would give.",
        ]

    def description(self) -> str:
        worst = int(np.nanargmax(self.held.per_view)) if np.isfinite(self.held.per_view).any() else 0
        return (
            f"{self.camera}: {' '.join(self.sentences())} Worst view held out: {self._name(worst)}, "
            f"{self.held.per_view[worst]:.3g} px."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        shown, attached = self._map()
        parts: dict[str, Part] = {
            "two halves": shown,
            "every view": self._views(),
            "in words": Sentences("\n".join(self.sentences())),
        }
        return self.tiled(_LAYOUT, parts, attached)

    @cached_property
    def _values(self) -> Any:
        apart, expected = self.halves.difference.length, self.halves.expected
        return {"difference": apart, "expected from noise": expected, "ratio": apart / expected}[self.show]

    def _map(self) -> Drawn:
        k = self.halves.first.cameras[self.camera].intrinsics
        panel = image_panel("halves", 20, 34, 400, k.width, k.height, tallest=330)
        values = np.maximum(self._values, 1e-9)
        if self.show == "ratio":
            shades, unit = Shades.around(np.clip(values, 0.1, 100)), ""
        else:
            both = np.concatenate([self.halves.difference.length.ravel(), self.halves.expected.ravel()])
            both = both[np.isfinite(both)]
            low = float(np.quantile(both, 0.05)) if both.size else 0.1
            shades, unit = Shades.around(np.maximum(both, low)), " px"
        colours, attached = heat(panel, "colours", values, shades)
        content = colours + contours(panel, values, shades, unit, strong=1.0)
        legend, bar_picture = bar(
            panel.x + panel.width + 12, 62, panel.height - 40, "bar", shades, unit.strip() or "times"
        )
        title = {
            "difference": "Two halves of the views: difference",
            "ratio": "Difference over expected",
        }.get(self.show, "What noise lets expect")
        return panel.show(content, title=title) + legend, attached | bar_picture

    def _views(self) -> Marks:
        held, fitted = self.held.per_view, np.array(self.fitted)
        n, x = len(held), np.arange(1, len(held) + 1)
        top = 1.3 * float(np.nanmax(np.concatenate([held, fitted, [1e-9]])))
        panel = plot.plot_panel("held out", 555, 34, 385, 270, (0.5, n + 0.5), (0, top))
        gap = 0.1 if n <= 60 else 0.0
        content = plot.grid(panel, xticks=[]) + plot.bars(panel, x - 0.5 + gap, x + 0.0, fitted, "fill-blue")
        content += plot.bars(panel, x + 0.0, x + 0.5 - gap, held, "fill-orange")
        content += plot.level(panel, self.held.expected_rms, "ink dashed")
        content += plot.legend(
            panel,
            [("blue thick", "fitted"), ("orange thick", "held out"), ("ink dashed", "expected from noise")],
        )
        ticks = names_below(short_names(self.pictures, n), most=20, about=10)
        return panel.show(content, title="Corners of every view") + plot.axes(panel, "view", "RMS [px]", xticks=ticks)

    def _name(self, view: int) -> str:
        return Path(self.pictures[view]).name if view < len(self.pictures) else f"view {view + 1}"


@lru_cache(maxsize=8)
def _halves(adjustment: Adjustment, camera: str, parts: str) -> Halves:
    """The views that have a say, parted in time or by turns, and the two solved anew."""
    place = np.cumsum(adjustment.posed)
    first = place <= place[-1] // 2 if parts == "earlier and later" else place % 2 == 0
    return halves(adjustment, first, camera=camera, grid=_GRID)
