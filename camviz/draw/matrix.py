"""Matrices, written in brackets."""

import numpy as np

from camviz.draw import svg
from camviz.draw.marks import Marks
from camviz.draw.readout import decimal, true_minus

_STEP, _ROW = 66, 26


def matrix(corner: tuple[float, float], name: str, values: np.ndarray, decimals: int) -> Marks:
    """A matrix (m, n) in brackets, its name above."""
    x, y = corner
    rows = [[decimal(value, decimals) for value in row] for row in values]
    wide = max(len(word) for row in rows for word in row)
    lines = ["  ".join(word.rjust(wide) for word in row) for row in rows]
    width, height = 7.6 * len(lines[0]) + 16, 20 * len(lines)
    brackets = [[(x + 5, y + 8), (x, y + 8), (x, y + 8 + height), (x + 5, y + 8 + height)]]
    brackets.append([(2 * x + width - px, py) for px, py in brackets[0]])
    words = [svg.text((x + 8, y + 23 + 20 * i), line, "number") for i, line in enumerate(lines)]
    return svg.text((x, y - 2), name, "note") + svg.path(brackets, "muted") + svg.join(words)


def intrinsic_matrix(x: float, y: float, title: str, values: np.ndarray, changed: np.ndarray | None = None) -> Marks:
    """K (3, 3) or its inverse to two decimals, its first row's middle at `y`; entries that are `changed` stand out.

    What lies below the diagonal, and the last number, say nothing new of a camera: they are written short and faintly.
    """
    rows, columns = values.shape
    changed = np.zeros(values.shape, dtype=bool) if changed is None else changed
    entries = [
        _entry(x, y, row, column, values, bool(changed[row, column])) for row, column in np.ndindex(rows, columns)
    ]
    top, bottom = y - 10, y + _ROW * (rows - 1) + 20
    brackets = [
        svg.line([(edge + inward, top), (edge, top), (edge, bottom), (edge + inward, bottom)], "ink")
        for edge, inward in ((x, 6), (x + _STEP * columns + 10, -6))
    ]
    return svg.text((x, y - 22), title, "title") + svg.join(entries) + svg.join(brackets)


def _entry(x: float, y: float, row: int, column: int, values: np.ndarray, changed: bool) -> Marks:
    right, base = x + _STEP * (column + 1), y + _ROW * row + 10
    if row > column or (row, column) == (values.shape[0] - 1, values.shape[1] - 1):
        return svg.text((right, base), true_minus(f"{values[row, column] + 0.0:g}"), "number end fill-muted")
    back = svg.rectangle(right - 58, base - 16, 62, 23, "wash fill-orange", radius=3) * changed
    words = true_minus(f"{values[row, column] + 0.0:.2f}")
    return back + svg.text((right, base), words, "number end")
