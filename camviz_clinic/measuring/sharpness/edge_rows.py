"""How far each row's edge is from the line of all rows: what straightens the line, and what shows that it is bent."""

from __future__ import annotations

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.measuring.sharpness.edge_profile import EdgeProfile
from camviz_clinic.measuring.sharpness.edge_sides import Sides

FINEST = 0.25  # pixels between the knots of the profile that rows are held against
OUTLIER = 4.0  # standard deviations: rows further off do not move the line
LEAST_SHARE = 0.5  # of the middle row's slope: rows with less have their edge outside the image


def row_shifts(sides: Sides, rise: float) -> tuple[Array, Array, Array]:
    """How far each row would have to move along the edge's normal to fit the profile of all rows best.

    Least squares to first order: Σ E' (E - light) / Σ E'² over a row's pixels, E the profile.

    Args:
        sides: Of the line that the shifts are counted from.
        rise: From 10 to 90 %, pixels.

    Returns:
        rows: (n,) of whole numbers, those whose edge lies within the image.
        shifts, errors: (n,), to the right, in pixels, and their standard errors.
    """
    strip = sides.strip
    near = np.abs(strip.distance) <= 1.5 * rise + 1.5
    step = max(FINEST, rise / 6)
    reach = np.ceil((1.5 * rise + 1.5) / step) * step
    v = strip.v[near]
    profile = EdgeProfile(strip.distance[near], sides.profile[near], reach, step, np.zeros(len(v), int))
    weight = np.bincount(v, profile.slope**2)
    moved = -np.bincount(v, profile.slope * profile.residual)
    left = np.bincount(v, profile.residual**2) / np.maximum(np.bincount(v), 1)
    rows = np.flatnonzero(weight > LEAST_SHARE * np.median(weight[weight > 0]))
    noise = np.sqrt(np.median(left[rows]))
    shifts, errors = moved[rows] / weight[rows], noise / np.sqrt(weight[rows])
    return rows.astype(float), np.asarray(shifts), np.asarray(errors)


def straight(rows: Array, shifts: Array, errors: Array) -> tuple[float, float] | None:
    """The line shift = a · row + b that fits most rows; None for fewer than three.

    Args:
        rows, shifts, errors: (n,), as `row_shifts` gives them.
    """
    if len(rows) < 3:
        return None
    kept = np.ones(len(rows), bool)
    for _ in range(3):
        a, b = np.polyfit(rows[kept], shifts[kept], 1)
        off = shifts - a * rows - b
        usual = max(1.4826 * float(np.median(np.abs(off))), float(np.median(errors)))
        kept = np.abs(off) <= OUTLIER * usual + 1e-9
        if kept.sum() < 3:
            return None
    return float(a), float(b)
