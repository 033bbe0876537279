"""A notebook that was handed in, put back into the order that it was handed out in, so that it can be graded.

Students delete cells, split them, copy them and turn them into text, and other programs drop metadata. nbgrader finds
cells by their marks: a mark that is missing or there twice costs points, or stops it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

Notebook = Any
Cell = Any

KNOWN = 0.5  # of the cells that were handed out: with fewer of them it is another notebook
_FUNCTION = re.compile(r"^def (\w+)\(", re.MULTILINE)
_FENCE = re.compile(r"\A```\w*\n(.*?)\n?```\Z", re.DOTALL)


class AnotherNotebookError(ValueError):
    """What was handed in is not what was handed out."""


@dataclass(frozen=True)
class Mended:
    """A notebook as it was handed out, with the student's answers and cells in it.

    Args:
        notebook: What can be graded.
        sentences: What had to be mended, for the teacher; empty where nothing had to.
    """

    notebook: Notebook
    sentences: tuple[str, ...]


def mended(handed_out: Notebook, handed_in: Notebook) -> Mended:
    """Put each cell of the student's into the place of the one that it was; cells of their own stay behind it.

    A cell is known by nbgrader's mark, its id, its text, or the function that it defines. Where a stub is empty or as
    it was handed out, the last other cell that defines its function is the answer; without one, so it stays.

    Raises: AnotherNotebookError where less than half of the cells that were handed out are in it.
    """
    places = _places(handed_out.cells, handed_in.cells)
    if len(places) < KNOWN * len(handed_out.cells):
        raise AnotherNotebookError(f"{len(places)} of the {len(handed_out.cells)} cells that were handed out are in it")
    notebook, sentences = deepcopy(handed_out), list(_told(handed_out.cells, handed_in.cells, places))
    own = _own(handed_out.cells, handed_in.cells, places)
    notebook.cells = own.get(-1, [])
    for number, cell in enumerate(deepcopy(handed_out.cells)):
        if number in places and _is_stub(cell):
            cell.source = _as_code(handed_in.cells[places[number]])
        notebook.cells += [cell, *own.get(number, [])]
    return Mended(notebook, tuple(sentences))


def _places(handed_out: list[Cell], handed_in: list[Cell]) -> dict[int, int]:
    """Where each cell that was handed out is in what was handed in: by its surest sign, and each one once."""
    places: dict[int, int] = {}
    for sign in (_mark, _id, _text, _function):
        known = {sign(cell): number for number, cell in enumerate(handed_out) if number not in places and sign(cell)}
        for here, cell in enumerate(handed_in):
            number = known.get(sign(cell))
            if number is not None and number not in places and here not in places.values():
                places[number] = here
    return _with_answers(handed_out, handed_in, places)


def _with_answers(handed_out: list[Cell], handed_in: list[Cell], places: dict[int, int]) -> dict[int, int]:
    """For a stub that is missing, empty or as it was handed out, the last other cell that defines its function."""
    for number, cell in enumerate(handed_out):
        if not _is_stub(cell):
            continue
        wanted, here = _function(cell), places.get(number)
        if here is not None and wanted in _functions(handed_in[here]) and _text(handed_in[here]) != _text(cell):
            continue
        others = set(range(len(handed_in))) - set(places.values())
        defining = [one for one in sorted(others) if wanted in _functions(handed_in[one])]
        if defining:
            places[number] = defining[-1]
    return places


def _mark(cell: Cell) -> str:
    return str(cell.metadata.get("nbgrader", {}).get("grade_id", ""))


def _id(cell: Cell) -> str:
    return str(cell.get("id") or cell.metadata.get("id") or "")


def _text(cell: Cell) -> str:
    return "\n".join(line.rstrip() for line in cell.source.strip().splitlines())


def _function(cell: Cell) -> str:
    """The function that a stub asks for, or a student's cell defines first."""
    return next(iter(_functions(cell)), "")


def _functions(cell: Cell) -> list[str]:
    return _FUNCTION.findall(_as_code(cell))


def _is_stub(cell: Cell) -> bool:
    return bool(cell.metadata.get("nbgrader", {}).get("solution"))


def _as_code(cell: Cell) -> str:
    """The source, without the fence that some put around code in a text."""
    fenced = _FENCE.match(cell.source.strip())
    return fenced[1] if fenced and cell.cell_type != "code" else str(cell.source)


def _own(handed_out: list[Cell], handed_in: list[Cell], places: dict[int, int]) -> dict[int, list[Cell]]:
    """The student's own cells without marks, by the number of the cell that they stand behind; −1 at the beginning.

    Mere copies of what was handed out are left out: a stub that runs behind an answer would undo it.
    """
    number_of, copies = {here: number for number, here in places.items()}, {_text(cell) for cell in handed_out}
    own: dict[int, list[Cell]] = {}
    behind = -1
    for here, cell in enumerate(handed_in):
        behind = number_of.get(here, behind)
        if here not in number_of and _text(cell) not in copies:
            kept = deepcopy(cell)
            kept.metadata.pop("nbgrader", None)
            kept["id"] = f"own-{here}"
            own.setdefault(behind, []).append(kept)
    return own


def _told(handed_out: list[Cell], handed_in: list[Cell], places: dict[int, int]) -> Iterator[str]:
    """In sentences what was mended."""
    marks = [_mark(cell) for cell in handed_in if _mark(cell)]
    for number, cell in enumerate(handed_out):
        name = _mark(cell)
        if not name:
            continue
        if number not in places:
            yield f"{name}: the cell is missing, and stands as it was handed out."
            continue
        found = handed_in[places[number]]
        if found.cell_type != cell.cell_type:
            yield f"{name}: the cell was turned into {found.cell_type}, and is code again."
        if marks.count(name) > 1:
            yield f"{name}: {marks.count(name)} cells have its mark; one of them has it now."
        if _mark(found) != name:
            yield f"{name}: " + (
                "its cell had lost its mark." if name not in marks else "the answer stood in another cell."
            )
    found_at = [places[number] for number in sorted(places)]
    if found_at != sorted(found_at):
        yield "Cells stood in another order, and stand as they were handed out."
