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
    right_is_free = limits_m[1] < (14 if limits_m[0] < 1.8 else 6)  # of the depth of field; the left is not
    allowed = f"allowed: c = {1000 * (allowed_mm or 0):.0f} µm"
    drawn = ""
    for blur, name, colour, stroke, below, at_right in (
        (allowed_mm, allowed, "green", "dashed", 14, right_is_free),
        (airy_mm, "Airy disc", "purple", "dashed thin", -5, not right_is_free),
    ):
        if blur:
            left, right = panel.place([(panel.left, np.log10(blur)), (panel.right, np.log10(blur))])
            place, end = (right + (-8, below), " end") if at_right else (left + (8, below), "")
            drawn += svg.line([left, right], f"{colour} {stroke}") + svg.text(place, name, f"{colour} halo{end}")
    return drawn


def micrometres() -> list[tuple[float, str]]:
    """The ticks of the blur's axis, which holds logarithms of millimetres."""
    return [(float(np.log10(um / 1000)), f"{um:g}") for um in (10, 100, 1000, 10_000)]
