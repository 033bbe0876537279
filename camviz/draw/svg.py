"""SVG fragments from arrays. A fragment is a string; fragments are joined by concatenation.

NaN interrupts a line and hides a mark, as everywhere in camviz: "no such point" draws nothing.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from html import escape
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def element(tag: str, content: str = "", **attributes: Any) -> str:
    """`<tag attributes>content</tag>`. Underscores in attribute names become dashes; a trailing one is dropped."""
    written = "".join(
        [f' {_dashed(name)}="{_written(value)}"' for name, value in attributes.items() if value is not None]
    )
    return f"<{tag}{written}>{content}</{tag}>" if content else f"<{tag}{written}/>"


def group(content: str, **attributes: Any) -> str:
    return element("g", content or " ", **attributes)


def path(lines: Iterable[ArrayLike], class_: str, *, closed: bool = False, **attributes: Any) -> str:
    """One path element through all `lines`, each (n, 2); NaN interrupts a line."""
    data = "".join(_pieces(np.asarray(line, dtype=float), closed) for line in lines)
    return element("path", d=data, class_=class_, **attributes) if data else ""


def line(points: ArrayLike, class_: str, **attributes: Any) -> str:
    """A line through points (n, 2)."""
    return path([points], class_, **attributes)


def polygon(points: ArrayLike, class_: str, **attributes: Any) -> str:
    """A closed, filled outline through points (n, 2); drawn only when every point exists."""
    points = np.asarray(points, dtype=float)
    return path([points], class_, closed=True, **attributes) if np.isfinite(points).all() else ""


def segments(starts: ArrayLike, ends: ArrayLike, class_: str, **attributes: Any) -> str:
    """Straight segments between starts (n, 2) and ends (n, 2), as one element."""
    pairs = np.stack([np.asarray(starts, float).reshape(-1, 2), np.asarray(ends, float).reshape(-1, 2)], axis=1)
    drawn = pairs[np.isfinite(pairs).all(axis=(1, 2))].reshape(-1, 4)
    data = "".join(map("M%.1f,%.1fL%.1f,%.1f".__mod__, map(tuple, drawn.tolist())))
    return element("path", d=data, class_=class_, **attributes) if data else ""


def dots(points: ArrayLike, class_: str, diameter: float = 5, **attributes: Any) -> str:
    """Round marks at points (n, 2), as one element."""
    marks = np.asarray(points, dtype=float).reshape(-1, 2)
    marks = marks[np.isfinite(marks).all(axis=1)]
    data = "".join(map("M%.1f,%.1fh0".__mod__, map(tuple, marks.tolist())))
    style = f"stroke-width:{diameter:g}px"
    return element("path", d=data, class_=f"{class_} dots", style=style, **attributes) if data else ""


def text(point: Sequence[float] | np.ndarray, words: str, class_: str = "label", **attributes: Any) -> str:
    """Words at a point (2,); nothing where the point does not exist."""
    x, y = map(float, point)
    if not (isfinite(x) and isfinite(y)):
        return ""
    return element("text", escape(words, quote=False), x=x, y=y, class_=class_, **attributes)


def paragraph(point: ArrayLike, words: str, width: float, class_: str = "note") -> str:
    """Words from a point (2,) on; the picture breaks them into lines that fit `width` (draw/labels.py)."""
    return text(np.asarray(point, dtype=float), words, class_, data_width=float(width))


def rectangle(x: float, y: float, width: float, height: float, class_: str, **attributes: Any) -> str:
    return element("rect", x=x, y=y, width=width, height=height, class_=class_, **attributes)


def image(name: str, x: float, y: float, width: float, height: float, **attributes: Any) -> str:
    """The picture's attached photograph `name`, stretched over a rectangle."""
    return element(
        "image", href=f"attached:{name}", x=x, y=y, width=width, height=height, preserveAspectRatio="none", **attributes
    )


@cache
def _dashed(name: str) -> str:
    return name.rstrip("_").replace("_", "-")


def _written(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))


def _pieces(points: np.ndarray, closed: bool) -> str:
    if isfinite(points.sum()):
        return _piece(points, closed)
    exists = np.isfinite(points).all(axis=-1)
    cuts = np.flatnonzero(np.diff(exists.astype(np.int8))) + 1
    runs = zip(np.split(points, cuts), np.split(exists, cuts), strict=True)
    return "".join(_piece(run, False) for run, here in runs if here.size and here[0])


def _piece(points: np.ndarray, closed: bool) -> str:
    if len(points) < 2:
        return ""
    return "M" + " ".join([f"{x:.1f},{y:.1f}" for x, y in points.tolist()]) + ("Z" if closed else "")
