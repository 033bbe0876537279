"""Synthetic apertures: which views take part in a picture, and how much each counts."""

from __future__ import annotations

import numpy as np

from camviz.lenses.base import Array

APERTURES = ("full", "round", "half", "ring", "pinhole")


def aperture(shape: str, rows: int, columns: int, v: int | None = None, u: int | None = None) -> Array:
    """A mask (rows, columns) of ones and zeros, by name.

    "full" is every view; "round" those within the grid's inscribed ellipse, "ring" the outer part of these; "half"
    the left half, the middle column included; "pinhole" the single view (v, u), by default that of the middle.
    ValueError for another name, or a view that is not there.
    """
    if shape not in APERTURES:
        raise ValueError(f"shape must be one of {', '.join(APERTURES)}, got {shape!r}")
    v, u = rows // 2 if v is None else v, columns // 2 if u is None else u
    if not (0 <= v < rows and 0 <= u < columns):
        raise ValueError(f"v and u must be a view of the {rows} × {columns} there are, got {v}, {u}")
    y, x = np.arange(rows)[:, None], np.arange(columns)
    radius = np.hypot((2 * y - rows + 1) / rows, (2 * x - columns + 1) / columns)
    chosen = {
        "full": radius >= 0,
        "round": radius <= 1,
        "ring": (radius <= 1) & (radius > 0.6),
        "half": (x <= (columns - 1) / 2) & (y >= 0),
        "pinhole": (y == v) & (x == u),
    }
    return chosen[shape].astype(float)
