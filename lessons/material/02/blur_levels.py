"""The axes of the depth-of-field visualizer's plot of blur, and its levels: what is allowed, and what waves make."""

from __future__ import annotations

import numpy as np

from camviz.draw import svg
from camviz.draw.panel import Panel
from camviz.lenses.base import Array

DEPTHS, BLURS = (0.5, 40.0), (0.002, 20.0)  # the plot's range: m and mm
_ROOM = 4.0  # picture units between a name and what is drawn


def levels(panel: Panel, curve: Array, allowed_mm: float | None, airy_mm: float | None) -> svg.Marks:
    """The lines of the blur that is allowed and of the Airy disc, each with its name where the `curve` leaves room.

    `curve` (n, 2) is in panel coordinates.
    """
    drawn, taken = svg.NOTHING, curve
    for blur, name, look, first in (
        (allowed_mm, f"allowed: c = {1000 * (allowed_mm or 0):.0f} µm", ("green", "dashed"), 1),
        (airy_mm, "Airy disc", ("purple", "dashed thin"), 0),
    ):
        if blur:
            line = panel.place([(x, np.log10(blur)) for x in np.linspace(panel.left, panel.right, 99)])
            at, anchor, box = _beside(panel, line, 7.5 * len(name), taken, first)
            drawn += svg.line(line[[0, -1]], " ".join(look)) + svg.text(at, name, f"{look[0]} halo{anchor}")
            taken = np.concatenate([taken, line, box])
    return drawn


def _beside(panel: Panel, line: Array, width: float, taken: Array, first: int) -> tuple[Array, str, Array]:
    """Where a name stands along its level `line`, its anchor, and the points (n, 2) that it takes.

    Best is the `first` end, the left, 0, or the right, 1, just below. Other places are for want of room.
    """
    most = np.array((panel.width - width - 16, 0))
    ways = [(share, down) for down in (14, -6, 28, -20) for share in np.abs(first - np.array((0, 1, 0.25, 0.5, 0.75)))]
    places = []
    for share, down in ways:
        low = line[0] + share * most + (8, down - 11)
        high = low + (width, 14)
        room = np.max([low - taken, taken - high], axis=(0, 2)).min()
        box = np.stack(np.meshgrid(np.linspace(low[0], high[0], 9), (low[1], high[1])), -1).reshape(-1, 2)
        place = (np.array((high[0], low[1] + 11)), " end") if share == 1 else (low + (0, 11), "")
        places.append((min(room, _ROOM, low[1], panel.height - high[1]), *place, box))
    return max(places, key=lambda place: place[0])[1:]


def micrometres() -> list[tuple[float, str]]:
    """The ticks of the blur's axis, which holds logarithms of millimetres."""
    return [(float(np.log10(um / 1000)), f"{um:g}") for um in (10, 100, 1000, 10_000)]
