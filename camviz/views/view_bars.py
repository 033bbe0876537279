"""A bar for the error of every view, one of them chosen: by its slider, a click, a drag along them or a key."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import Panel
from camviz.lenses.base import Array
from camviz.views.base import Control, View, step_of

NAMED = 16  # views whose bars have room for names and figures
CUT = 10.0  # times the median of all bars
LABEL = "One bar per view; click, drag or press the arrow keys to choose a view"


class ViewChooser(View):
    """Shows one of `count` views, chosen by the field `view`, counted from 1, or by a handle called "bars"."""

    view: int

    @property
    def count(self) -> int:
        """How many there are."""
        raise NotImplementedError(f"{type(self).__name__} does not say how many views it has")

    @property
    def _bars(self) -> Panel:
        raise NotImplementedError(f"{type(self).__name__} has no bars")

    @property
    def index(self) -> int:
        """The place of the chosen view in the list, from 0."""
        return min(max(round(self.view), 1), self.count) - 1

    def offered(self) -> dict[str, Control]:
        controls = self.controls()
        return {**controls, "view": replace(controls["view"], high=self.count)}

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle != "bars":
            return super().dragged(handle, x, y, dx, dy)
        if np.isnan(x):
            return self
        return self.but(view=int(np.clip(round(self._bars.data((x - self._bars.x, 0))[0]), 1, self.count)))

    def pressed(self, handle: str, key: str) -> Self:
        if handle != "bars":
            return super().pressed(handle, key)
        return self.but(view=min(max(self.index + 1 + step_of(key), 1), self.count))


def places(count: int) -> tuple[Array, Array]:
    """The left and the right ends (count,) of the bars of views 1 … count; with gaps where there is room for them."""
    x, gap = np.arange(1, count + 1, dtype=np.float64), 0.12 if count <= 60 else 0.0
    return x - 0.5 + gap, x + 0.5 - gap


def bars_of(panel: Panel, values: Array, chosen: int = -1) -> Marks:
    """A blue bar for each of the values (views,), and an orange one for that which is chosen, counted from 0."""
    marked = np.arange(len(values)) == chosen
    return svg.join(
        plot.bars(panel, *places(len(values)), np.where(mask, values, np.nan), class_)
        for mask, class_ in ((~marked, "fill-blue"), (marked, "fill-orange"))
    )


def ceiling(values: Array) -> float:
    """The upper end of the axis of bars as high as `values` (n,).

    A bar more than CUT times the median would flatten all others: it is cut, and leaves the axis to them.
    """
    known = values[np.isfinite(values)]
    limit = CUT * float(np.median(known)) if known.size else 0.0
    whole = known[known <= limit] if limit > 0 else known
    return 1.2 * max(float(whole.max(initial=0.0)), 1e-9)


def figures_on(panel: Panel, values: Array) -> Marks:
    """Every value (views,) where its bar ends, where there is room for it; a bar that is cut has a break below it.

    A line behind a figure is interrupted by it.
    """
    places_of = panel.place(np.stack([np.arange(len(values)) + 1, values], axis=-1))
    width = 0.9 * panel.width / (panel.right - panel.left)
    zigzag = np.stack([np.linspace(-width / 2, width / 2, 7), 30 + 4.0 * (-1) ** np.arange(7)], axis=-1)
    breaks = [zigzag + (x, 0) for (x, _), value in zip(places_of, values, strict=True) if value > panel.top]
    figures = [
        svg.text((x, max(y - 4, 16)), f"{value:.2f}", "tick middle halo clear")
        for (x, y), value in zip(places_of, values, strict=True)
    ]
    return svg.path(breaks, "paper-line cut") + svg.join(figures if len(values) <= NAMED else ())


def figures_in(panel: Panel, values: Array) -> Marks:
    """Every value (views,) below the end of its bar, where both bars and names have room for it; NaN has none."""
    if len(values) > NAMED:
        return NOTHING
    return svg.join(
        svg.text(panel.place((i + 1, value)) + (0, 14), f"{value:.2f}", "tick middle", fill="{paper}")
        for i, value in enumerate(values)
        if np.isfinite(value) and panel.height * min(value / panel.top, 1) > 20
    )


def names_below(names: Sequence[str], most: int = NAMED, about: int = NAMED) -> list[tuple[float, str]]:
    """Ticks with the names of all views, or of `about` so many where there are more than `most`."""
    n = len(names)
    ticks = np.arange(1, n + 1) if n <= most else plot.ticks(1, n, about)
    return [(float(tick), names[round(tick) - 1]) for tick in ticks]
