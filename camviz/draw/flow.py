"""The layout of a picture: tiles that stand in rows where there is room, and flow below each other where there is none.

One description serves every place. A saved picture has its tiles where the rows put them; a page lays out the same
tiles by `flow.css`, from a telephone to a projector.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

from camviz.draw import labels, svg
from camviz.draw.marks import Marks
from camviz.draw.writing import PageWriter

WIDTH = 960  # picture units, of every row
FLOW_WIDTH = "max(800px,138vh)"  # of a picture, so that its main panel and the controls fit a screen together
_PRESENTED = "var(--camviz-scale,1)*"  # how much larger a presentation shows everything
STILL = 1.2  # picture units that make a CSS pixel in a still, which is drawn once for columns of 650 to 1000 pixels
SCROLLED = 620  # picture units: a wider tile is scrolled sideways on a telephone
_SCROLLED_PX = 560  # how wide it is shown there
_KEYS = 'tabindex="0"'  # so that keys scroll it, too

Cell = tuple[float, float, float, float]
"""Left, top, width and height, in picture units."""


class Sentences(str):
    """A part of a picture that is words alone, a sentence a line."""

    __slots__ = ()


Part = Marks | Sentences
"""What a tile shows."""


@dataclass(frozen=True)
class Tile:
    """A part of a picture that can stand alone: its name, its cell, and its marks in the picture's units."""

    name: str
    cell: Cell
    marks: Marks
    words: str = ""
    """Sentences, a line each: a page has them as its own text, which wraps; `marks` have them for saved pictures."""

    @classmethod
    def of(cls, name: str, cell: Cell, part: Part) -> Tile:
        """The tile of a part: of marks, or of `Sentences`."""
        if not isinstance(part, Sentences):
            return cls(name, cell, part)
        x, y, width, _ = cell
        return cls(name, cell, svg.paragraph((x + 20, y + 18), part, width - 40, "label"), part)

    def uncluttered(self, unit: float = 1.0) -> Marks:
        """The marks with their words clear of each other, where `unit` picture units make a CSS pixel."""
        x, y, width, height = self.cell
        return labels.uncluttered(self.marks, (x, y, x + width, y + height), max(unit, 1.0))

    def style(self, scaled: str = "") -> str:
        """How the tile takes its place among others in a line that wraps, as CSS.

        In a wide line the tiles of a row fill it as in the saved picture. A tile goes to the next line rather than
        shrink to less than 0.72 of its size, and grows to half as much again; words alone keep their size more closely.
        One that a telephone scrolls goes there rather than be scrolled beside others.
        `scaled` is a factor of these sizes, as CSS with its "*".
        """
        width, (least, most) = self.cell[2], self._sizes
        share, narrowest = 100 * width / WIDTH, max(least * width, _SCROLLED_PX if width > SCROLLED else 0)
        return (
            f"--w:{width:g};flex:{width:g} 1 max({scaled}{narrowest:g}px,{0.97 * share:.4g}%);min-width:0;"
            f"max-width:max({scaled}{most * width:g}px,{share:.4g}%)"
        )

    @property
    def _sizes(self) -> tuple[float, float]:
        """The least and the greatest size among others, as parts of its own."""
        return (0.72, 1.5) if self.marks.panels() else (0.92, 1.15)

    def html(self, unit: float = 1.0) -> str:
        """The tile as an element of a page that has `flow.css`; `unit` is how many picture units make a CSS pixel."""
        if self.words:
            name = escape(self.name)
            return f'<div class="camviz-tile" data-tile="{name}" style="flex:1 1 100%">{self.sentences}</div>'
        kind = f'class="camviz-tile camviz-scrolled" {_KEYS}' if self.cell[2] > SCROLLED else 'class="camviz-tile"'
        name = escape(self.name)
        size = f'style="aspect-ratio:{self.cell[2]:g}/{self.cell[3]:g}"'  # known before the tile is drawn
        fold = f'<button type="button" class="camviz-fold" aria-expanded="true">{name}</button>'
        return f'<div {kind} data-tile="{name}" style="{self.style(_PRESENTED)}">{fold}{self._svg(unit, size)}</div>'

    def image(self, source: str, words: str, *, later: bool = False) -> str:
        """The tile as an image among others that flow on a page without a style sheet; `words` say what it shows.

        With `later` the image is loaded when it comes near the screen, and its place is kept free till then.
        """
        kept = f' loading="lazy" width="{self.cell[2]:g}" height="{self.cell[3]:g}"' if later else ""
        tall = ";height:auto" if later else ""
        if self.cell[2] <= SCROLLED:
            return f'<img alt="{escape(words)}"{kept} style="{self.style()}{tall}" src="{source}">'
        image = f'<img alt="{escape(words)}"{kept} style="width:100%;min-width:{_SCROLLED_PX}px{tall}" src="{source}">'
        return f'<div {_KEYS} style="{self.style()};overflow-x:auto">{image}</div>'

    @property
    def sentences(self) -> str:
        """The words as HTML, a paragraph a line."""
        return "".join(f'<p style="margin:2px 20px">{escape(line)}</p>' for line in self.words.splitlines())

    def document(self, sheet: str) -> str:
        """The tile as an SVG document with a style sheet, its words clear of each other in the columns of `STILL`."""
        _, _, width, height = self.cell
        size = f'width="{width:g}" height="{height:g}" style="--w:{width:g};--shown:100vw"'
        return self._svg(min(STILL, 1 / self._sizes[0]), size, sheet)

    def _svg(self, unit: float, size: str, sheet: str = "") -> str:
        box = " ".join(f"{value:g}" for value in self.cell)
        body = PageWriter().write(self.uncluttered(unit))
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="camviz-svg camviz-fitted" role="group" '
            f'aria-label="{escape(self.name)}" viewBox="{box}" {size}>{sheet}{body}</svg>'
        )


def rows(*rows: tuple[float, Mapping[str, float]]) -> dict[str, Cell]:
    """The cells of tiles in rows, each row its height and the widths of its tiles by name.

    >>> rows((300, {"camera": 560, "picture": 400}), (120, {"numbers": 960}))["picture"]
    (560.0, 0.0, 400, 300)
    """
    cells: dict[str, Cell] = {}
    top = 0.0
    for height, widths in rows:
        left = 0.0
        for name, width in widths.items():
            cells[name] = (left, top, width, height)
            left += width
        top += height
    return cells


def shortened(cells: Mapping[str, Cell], **heights: float) -> dict[str, Cell]:
    """The cells, those named no taller than what stands in them: below each other, they leave no gap."""
    return {name: (x, y, width, heights.get(name, height)) for name, (x, y, width, height) in cells.items()}
