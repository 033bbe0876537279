"""Marks from arrays: lines, outlines, dots, words and photographs, joined by `+`.

NaN interrupts a line and hides a dot, as everywhere in camviz: "no such point" draws nothing.
"""

from collections.abc import Iterable, Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.draw.marks import NOTHING, Discs, Group, Image, Lines, Marks, Rect, Segments, Text, join

__all__ = [
    "NOTHING", "Marks", "dots", "group", "image", "join", "line", "paragraph", "path", "polygon", "rectangle",
    "segments", "text",
]  # fmt: skip


def path(lines: Iterable[ArrayLike], class_: str, *, closed: bool = False, **style: Any) -> Marks:
    """One mark of all `lines`, each (n, 2); NaN interrupts a line."""
    arrays = tuple(np.asarray(line, dtype=float) for line in lines)
    return Marks([Lines(arrays, class_, closed, style)]) if any(_is_drawn(one) for one in arrays) else NOTHING


def line(points: ArrayLike, class_: str, **style: Any) -> Marks:
    """A line through points (n, 2)."""
    return path([points], class_, **style)


def polygon(points: ArrayLike, class_: str, **style: Any) -> Marks:
    """A closed, filled outline through points (n, 2); drawn only when every point exists."""
    points = np.asarray(points, dtype=float)
    return path([points], class_, closed=True, **style) if np.isfinite(points).all() else NOTHING


def segments(starts: ArrayLike, ends: ArrayLike, class_: str, **style: Any) -> Marks:
    """Straight segments between starts (n, 2) and ends (n, 2), as one mark."""
    pairs = np.stack([np.asarray(starts, float).reshape(-1, 2), np.asarray(ends, float).reshape(-1, 2)], axis=1)
    drawn = pairs[np.isfinite(pairs).all(axis=(1, 2))]
    return Marks([Segments(drawn, class_, style=style)]) if len(drawn) else NOTHING


def dots(points: ArrayLike, class_: str, diameter: float = 5) -> Marks:
    """Round dots at points (n, 2), as one mark."""
    places = np.asarray(points, dtype=float).reshape(-1, 2)
    places = places[np.isfinite(places).all(axis=1)]
    return Marks([Discs(places, class_, diameter)]) if len(places) else NOTHING


def text(
    point: Sequence[float] | np.ndarray,
    words: str,
    class_: str = "label",
    *,
    turned_deg: float = 0.0,
    grows_from: tuple[float, float] | None = None,
    **style: Any,
) -> Marks:
    """Words at a point (2,); nothing where the point does not exist."""
    x, y = map(float, point)
    if not (isfinite(x) and isfinite(y)):
        return NOTHING
    return Marks([Text(x, y, words, class_, turned_deg=turned_deg, grows_from=grows_from, style=style)])


def paragraph(point: ArrayLike, words: str, width: float, class_: str = "note") -> Marks:
    """Words from a point (2,) on; the picture breaks them into lines that fit `width` (draw/labels.py)."""
    x, y = np.asarray(point, dtype=float).tolist()
    return Marks([Text(x, y, words, class_, wrap_width=float(width))])


def rectangle(
    x: float, y: float, width: float, height: float, class_: str, *, radius: float | None = None, **style: Any
) -> Marks:
    return Marks([Rect(float(x), float(y), float(width), float(height), class_, radius, style)])


def image(
    name: str, x: float, y: float, width: float, height: float, *, mask: str = "", mask_id: str = "", **style: Any
) -> Marks:
    """The picture's attached photograph `name`, stretched over a rectangle."""
    return Marks([Image(name, float(x), float(y), float(width), float(height), mask, mask_id, style)])


def group(
    content: Marks, class_: str = "", *, grows_from: tuple[float, float] | None = None, **attributes: Any
) -> Marks:
    """Marks with something in common, such as a handle for pointer and keys: `data_drag`, `role`, `aria_label`."""
    return Marks([Group(content, class_, grows_from, attributes)])


def handle(content: Marks, name: str, label: str) -> Marks:
    """Marks that pointer and keys drag under this name; `label` tells a screen reader what it does."""
    return group(content, data_drag=name, tabindex=0, role="group", aria_label=label)


def circle(centre: ArrayLike, radius: float, class_: str, **style: Any) -> Marks:
    """A filled circle around a place (2,)."""
    turn = np.linspace(0, 2 * np.pi, 33)[:-1, None]
    return polygon(np.asarray(centre) + radius * np.hstack([np.cos(turn), np.sin(turn)]), class_, **style)


def _is_drawn(points: np.ndarray) -> bool:
    exists = np.isfinite(points).all(axis=-1)
    return bool((exists[1:] & exists[:-1]).any())
