"""Text beside the figure: the sentences that speak of a pane stand beside it where a window is wide (camviz.css)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

import nbformat

from camviz_school.course.notebooks import Cell

BESIDE = "camviz-beside"
Kind = Literal["pane", "said", "asked", "other"]
"""A pane; sentences; a prediction, which belongs to the pane after it; and what ends a group, as a heading does."""

_OPEN, _CLOSE = f'<div class="{BESIDE}">', "</div>"
_HEADINGS = re.compile(r"^#.*(?:\n(?:.*\n)*#.*)?(?:\n\n\*About \d+ minutes.*\*)?$", re.MULTILINE)
"""From the first heading to the last, with the line of minutes below a deeper section's."""


class Part(NamedTuple):
    """A cell, or what is before, of or after a text's headings."""

    kind: Kind
    cell: Cell


def beside(cells: list[Cell], kind: Callable[[Cell], Kind]) -> list[Cell]:
    """The cells, and around each pane with the sentences that lead to it or follow it two that open and close a group.

    What stands between two panes follows the first, but for the last text and the prediction: they lead to the second.
    """
    done: list[Cell] = []
    group: list[Part] = []  # since the last heading, exercise or group
    for part in parts(cells, kind):
        if part.kind == "other":
            done += [*_closed(group), part.cell]
            group = []
        elif part.kind == "pane" and any(one.kind == "pane" for one in group):
            lead = _lead(group)
            done += _closed(group[: len(group) - lead])
            group = [*group[len(group) - lead :], part]
        else:
            group.append(part)
    return done + _closed(group)


def parts(cells: list[Cell], kind: Callable[[Cell], Kind]) -> Iterator[Part]:
    """The cells in their order, a text that has headings in up to three parts."""
    for cell in cells:
        found = _HEADINGS.search(cell.source) if kind(cell) == "said" and cell.cell_type == "markdown" else None
        if not found:
            yield Part(kind(cell), cell)
            continue
        before, after = cell.source[: found.start()].strip(), cell.source[found.end() :].strip()
        if before:
            yield Part("said", _text(before))
        yield Part("other", _text(found[0]))
        if after:
            yield Part("said", _text(after))


def _lead(group: list[Part]) -> int:
    """How many parts at the end of a group lead to the pane that follows: a text, and the prediction before it."""
    kinds = [part.kind for part in group]
    count = int(kinds[-1] == "said")
    return count + int(kinds[-1 - count] == "asked")


def _closed(group: list[Part]) -> list[Cell]:
    cells = [part.cell for part in group]
    if len(cells) < 2 or all(part.kind != "pane" for part in group):
        return cells
    return [_text(_OPEN), *cells, _text(_CLOSE)]


def _text(source: str) -> Cell:
    cell: Cell = nbformat.v4.new_markdown_cell(source)
    return cell
