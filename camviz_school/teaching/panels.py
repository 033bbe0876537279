"""The panels of a picture on a slide: as large as they fit, every word legible, on as few pages as that needs."""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape, unescape
from itertools import combinations, pairwise
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from camviz_school.course import saved_outputs
from camviz_school.course.notebooks import Cell

SLIDE = 1280.0
"""Pixels across the slide for which panels are laid out; on any other they keep their proportions."""
WIDTH, HEIGHT, GAP = 1228.0, 604.0, 10.0
"""Of the room below a heading of one line, and between two panels, in pixels of that slide."""
HEADING_LINE, LETTERS_A_LINE = 37.0, 62
"""What a further line of the heading takes from the height, and how many letters fill a line."""
LEAST_TEXT = 14.0
"""Pixels of the smallest letters on a slide of 1280 pixels."""
LARGEST = 1.9
"""How far a panel is enlarged at most: what it has of photographs was made for its own size."""

_SAVED, _STILL_TEXT, _READOUT_TEXT = 12.0, 14.4, 13.0  # units of a panel's smallest letters: at first, and at most
_PLOTTED = 13.9  # pixels of matplotlib's 10 points at 100 dots an inch


@dataclass(frozen=True)
class SavedImage:
    """One image among a cell's saved outputs: a data address, and what it says to someone who cannot see it."""

    source: str
    description: str

    @cached_property
    def size(self) -> tuple[float, float]:
        """Width and height in its own units, pixels of a PNG. Raises ValueError for what is neither PNG nor SVG."""
        if self.source.startswith("data:image/png;base64,"):
            head = b64decode(self.source.partition(",")[2][:64])
            return float(int.from_bytes(head[16:20], "big")), float(int.from_bytes(head[20:24], "big"))
        if self.root is None or not {"width", "height"} <= self.root.attrib.keys():
            raise ValueError(f"a picture must be a PNG or an SVG with a width and a height, got {self.source[:40]!r}")
        return float(self.root.attrib["width"]), float(self.root.attrib["height"])

    @cached_property
    def _svg(self) -> str:
        kind, _, data = self.source.partition(",")
        return b64decode(data).decode() if kind == "data:image/svg+xml;base64" else ""

    @cached_property
    def root(self) -> Element | None:
        """The drawing; None for a plot."""
        return ElementTree.fromstring(self._svg) if self._svg else None

    @cached_property
    def name(self) -> str:
        """What the panel is called in its view, such as "radial curve"; "" for a plot."""
        return self.root.get("aria-label", "") if self.root is not None else ""

    @cached_property
    def _grows(self) -> bool:
        """Whether its letters grow as it shrinks (draw/flow.py)."""
        return self.root is not None and "--shown:100vw" in self.root.get("style", "")

    @property
    def least(self) -> float:
        """The scale from which its smallest letters have LEAST_TEXT pixels.

        Letters of a still grow as the still shrinks (draw/flow.py), until they would touch each other.
        """
        if self.root is None:
            return LEAST_TEXT / _PLOTTED
        if not self._grows:
            return LEAST_TEXT / _SAVED
        has_panel = any("data-panel" in part.attrib for part in self.root.iter())
        return LEAST_TEXT / (_STILL_TEXT if has_panel else _READOUT_TEXT)

    def image(self, scale: float) -> str:
        """The panel as HTML at a scale, its letters as large as that scale asks for on every screen and on paper."""
        width, height = self.size
        source = self.source
        if self._grows:
            larger = f"--shown:{scale * width:.1f}px;--camviz-scale:{LEAST_TEXT / _SAVED:.4f}"
            drawn = self._svg.replace("--shown:100vw", larger, 1)
            source = f"data:image/svg+xml;base64,{b64encode(drawn.encode()).decode()}"
        sizes = f"width:{_units(scale * width)};height:{_units(scale * height)}"
        return f'<img alt="{escape(self.description)}" style="{sizes}" src="{source}">'


def panels(cell: Cell) -> list[SavedImage]:
    """All images among a code cell's saved outputs, in their order."""
    return [SavedImage(source, words) for words, source in saved_outputs.images(cell)]


@dataclass(frozen=True)
class Page:
    """Rows of panels at one scale."""

    rows: tuple[tuple[SavedImage, ...], ...]
    scale: float

    @property
    def html(self) -> str:
        """The rows below each other."""
        rows = ("".join(panel.image(self.scale) for panel in row) for row in self.rows)
        return f"<div class='panels'>{''.join(f'<div>{row}</div>' for row in rows)}</div>"


def pages(shown: Sequence[SavedImage], heading: str, together: Sequence[str] = ()) -> list[Page]:
    """Panels on as few pages as keep every word legible, each page as large as it fits below `heading`, which is HTML.

    They keep their order, except that the panels named in `together`, if any, have the first page for themselves,
    whatever their size. A panel that is too large by itself has a page of its own, where it is as large as it fits.
    """
    letters = len(unescape(re.sub(r"<[^>]*>", "", heading)))
    height = HEIGHT - HEADING_LINE * max(0, -(-letters // LETTERS_A_LINE) - 1)
    if together and len(_filled(shown, height)) > 1:
        first = [one for one in shown if one.name in together]
        rest = [one for one in shown if one.name not in together]
        return [_page(first, height), *_filled(rest, height)]
    return _filled(shown, height)


def _filled(shown: Sequence[SavedImage], height: float) -> list[Page]:
    for count in range(1, len(shown) + 1):
        made = [[_page(part, height) for part in parts] for parts in _divisions(shown, count)]
        fitting = [one for one in made if all(map(_legible, one))]
        if fitting or count == len(shown):
            return max(fitting or made, key=lambda one: min(page.scale for page in one))
    return []


def _page(shown: Sequence[SavedImage], height: float) -> Page:
    """The rows in which panels are largest; of several, the fewest and the shortest."""
    divided = [rows for count in range(1, len(shown) + 1) for rows in _divisions(shown, count)]
    pages = [Page(tuple(map(tuple, rows)), _scale(rows, height)) for rows in divided]
    return max(pages, key=lambda one: (round(one.scale, 3), -len(one.rows), -max(map(_width, one.rows))))


def _scale(rows: Sequence[Sequence[SavedImage]], height: float) -> float:
    across = min((WIDTH - GAP * (len(row) - 1)) / _width(row) for row in rows)
    down = (height - GAP * (len(rows) - 1)) / sum(max(one.size[1] for one in row) for row in rows)
    return min(across, down, LARGEST)


def _width(row: Sequence[SavedImage]) -> float:
    return sum(panel.size[0] for panel in row)


def _legible(page: Page) -> bool:
    return all(page.scale >= panel.least for row in page.rows for panel in row)


def _divisions(shown: Sequence[SavedImage], count: int) -> Iterator[list[Sequence[SavedImage]]]:
    """All ways to divide a sequence into so many parts without changing its order."""
    for cuts in combinations(range(1, len(shown)), count - 1):
        yield [shown[a:b] for a, b in pairwise((0, *cuts, len(shown)))]


def _units(pixels: float) -> str:
    return f"calc({100 * pixels / SLIDE:.3f}*var(--u))"
