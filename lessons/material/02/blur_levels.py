"""The axes of the depth-of-field visualizer's plot of blur, and its levels: what is allowed, and what waves make."""

from __future__ import annotations

import numpy as np

from camviz.draw import svg
from camviz.draw.panel import Panel

DEPTHS, BLURS = (0.5, 40.0), (0.002, 20.0)  # the plot's range: m and mm


def levels(panel: Panel, allowed_mm: float | None, airy_mm: float | None, limits_m: tuple[float, float]) -> str:
    """The lines of the blur that is allowed and of the Airy disc, and their names, at opposite ends.

    Outside the depth of field the curve runs above the blur that is allowed: there its name stands below the line.
    """
    right_is_free = limits_m[0] < 1.8 and limits_m[1] < 14  # of the depth of field; the left is not
    drawn = ""
    if allowed_mm is not None:
        name = f"allowed: c = {1000 * allowed_mm:.0f} µm"
        drawn += _level(panel, allowed_mm, name, "green", "dashed", 14, right_is_free)
    if airy_mm is not None:
        drawn += _level(panel, airy_mm, "Airy disc", "purple", "dashed thin", -5, not right_is_free)
    return drawn


def _level(panel: Panel, blur: float, name: str, colour: str, stroke: str, below: float, at_right: bool) -> str:
    left, right = panel.place([(panel.left, np.log10(blur)), (panel.right, np.log10(blur))])
    place, end = (right + (-8, below), " end") if at_right else (left + (8, below), "")
    return svg.line([left, right], f"{colour} {stroke}") + svg.text(place, name, f"{colour} halo{end}")


def micrometres() -> list[tuple[float, str]]:
    """The ticks of the blur's axis, which holds logarithms of millimetres."""
    return [(float(np.log10(um / 1000)), f"{um:g}") for um in (10, 100, 1000, 10_000)]
