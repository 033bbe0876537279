"""What a picture consists of until it is written: marks, arrays in the units of their panel, joined by `+`.

`camviz.draw.svg` makes marks, `camviz.draw.labels` moves words that collide, `camviz.draw.writing` writes SVG.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Style = Mapping[str, Any]
"""What a mark alone has of style, such as fill_opacity, by the names of CSS with underscores."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines, each (n, 2); NaN interrupts a line. A closed one is an outline that is filled."""

    lines: tuple[Array, ...]
    class_: str
    closed: bool = False
    style: Style = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Segments:
    """Straight segments (n, 2, 2). One that `continues` (n,) begins where the one before ends."""

    ends: Array
    class_: str
    continues: NDArray[np.bool_] | None = None
    style: Style = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Discs:
    """Round dots at points (n, 2)."""

    points: Array
    class_: str
    diameter: float


@dataclass(frozen=True, eq=False)
class Text:
    """Words that begin, end or have their middle at a point."""

    x: float
    y: float
    words: str
    class_: str
    wrap_width: float | None = None
    """Of a paragraph, which is broken into lines of this width."""
    turned_deg: float = 0.0
    """Clockwise; -90 runs upwards, as the name of a y axis does."""
    grows_from: tuple[float, float] | None = None
    """The corner out of which a legend grows with its words."""
    style: Style = field(default_factory=dict)
    lines: tuple[str, ...] = ()
    """The lines of a paragraph once it is broken, and from line to line: `leading`."""
    leading: float = 0.0


@dataclass(frozen=True, eq=False)
class Rect:
    """A rectangle, its corners rounded by `radius`."""

    x: float
    y: float
    width: float
    height: float
    class_: str
    radius: float | None = None
    style: Style = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Image:
    """The attached photograph `name`, stretched over a rectangle.

    `mask` names another photograph, whose brightness is its opacity; `mask_id` is unique on every page.
    """

    name: str
    x: float
    y: float
    width: float
    height: float
    mask: str = ""
    mask_id: str = ""
    style: Style = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Group:
    """Marks that have something in common: a class, a handle for pointer and keys, a link, a corner to grow from.

    `attributes` are what a page needs of them, by their names in HTML with underscores.
    """

    marks: Marks
    class_: str = ""
    grows_from: tuple[float, float] | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Inset:
    """A panel: a rectangle with coordinates of its own, to which its marks are clipped. A legend has no name."""

    name: str
    x: float
    y: float
    width: float
    height: float
    marks: Marks
    attributes: Mapping[str, Any] = field(default_factory=dict)


Mark = Lines | Segments | Discs | Text | Rect | Image | Group | Inset


class Marks(tuple[Mark, ...]):
    """Marks in the order in which they are drawn. An empty one draws nothing.

    >>> from camviz.draw import svg
    >>> len(svg.line([(0, 0), (1, 1)], "ink") + svg.text((0, 0), "here"))
    2
    """

    __slots__ = ()

    def __add__(self, other: Iterable[Mark]) -> Marks:  # type: ignore[override]
        return Marks((*self, *other)) if other else self

    def __radd__(self, other: Iterable[Mark]) -> Marks:
        return Marks((*other, *self)) if other else self

    def __mul__(self, shown: Any) -> Marks:
        """The marks times a condition: nothing where it does not hold."""
        return self if shown else NOTHING

    __rmul__ = __mul__

    def walk(self) -> Iterator[Mark]:
        """Every mark, those of groups and panels after these."""
        for mark in self:
            yield mark
            if isinstance(mark, Group | Inset):
                yield from mark.marks.walk()

    def panels(self) -> dict[str, Inset]:
        """The panels by name."""
        return {mark.name: mark for mark in self.walk() if isinstance(mark, Inset) and mark.name}

    def texts(self) -> list[Text]:
        """All words, in the order in which they are drawn."""
        return [mark for mark in self.walk() if isinstance(mark, Text)]

    def of(self, class_: str) -> list[Mark]:
        """The marks that have all of these classes."""
        wanted = set(class_.split())
        classed = (mark for mark in self.walk() if not isinstance(mark, Image | Inset))
        return [mark for mark in classed if wanted <= {*mark.class_.split()}]

    def points(self, class_: str) -> Array:
        """All points (n, 2) of lines, segments and dots that have all of these classes, in their panels' units."""
        lines = [line for mark in self.of(class_) for line in _lines_of(mark)]
        return np.concatenate([*lines, np.empty((0, 2))])

    def groups(self, handle: str) -> list[Group]:
        """The groups that a pointer drags, whose handle begins so."""
        groups = (mark for mark in self.walk() if isinstance(mark, Group))
        return [mark for mark in groups if str(mark.attributes.get("data_drag", "")).startswith(handle)]

    @property
    def handles(self) -> list[str]:
        """What a pointer can drag, by name."""
        parts = (mark.attributes for mark in self.walk() if isinstance(mark, Group | Inset))
        return list(dict.fromkeys(each["data_drag"] for each in parts if "data_drag" in each))


NOTHING = Marks()


def _lines_of(mark: Mark) -> tuple[Array, ...]:
    match mark:
        case Lines():
            return mark.lines
        case Segments():
            return tuple(mark.ends)
        case Discs():
            return (mark.points,)
    return ()


def join(parts: Iterable[Iterable[Mark]]) -> Marks:
    """The marks of all parts, one part after the other."""
    return Marks(mark for part in parts for mark in part)
