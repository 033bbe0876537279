"""Synthetic apertures: which views take part in a picture, and how much each counts."""

from __future__ import annotations

import numpy as np

from camviz.lenses.arrays import Count
from camviz.lenses.base import Array

APERTURES = ("full", "round", "half", "ring", "pinhole")
"""The names that `aperture` knows.

>>> APERTURES
('full', 'round', 'half', 'ring', 'pinhole')
"""


def aperture(shape: str, rows: Count, columns: Count, v: int | None = None, u: int | None = None) -> Array:
    """A mask of ones and zeros: which views of a grid take part in a picture.

    Args:
        shape: {"full", "round", "half", "ring", "pinhole"}. "full" is every view; "round" those within the grid's
            inscribed ellipse, and "ring" the outer part of these; "half" the left half, the middle column included;
            "pinhole" a single view.
        v, u: The row and column of the single view; by default those of the middle.

    Returns: (rows, columns), 1.0 for a view that takes part, 0.0 for the others.
    Raises: ValueError for another name, or a view that is not there.

    >>> aperture("ring", 5, 5).astype(int)
    array([[0, 1, 1, 1, 0],
           [1, 0, 0, 0, 1],
           [1, 0, 0, 0, 1],
           [1, 0, 0, 0, 1],
           [0, 1, 1, 1, 0]])
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
