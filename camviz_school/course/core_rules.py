"""The pattern of a lesson that has a core and goes deeper: what a first reading meets, and how much of it there is.

The header asks the question and names the ideas; one live view comes with it, then what the lesson is about (folded,
tagged `about`), the setup cell, and what the reader thinks at first. The core ends with quiz and recap. Below
`## Going deeper` each section stands alone and says what it asks for and how long it takes.
"""

from __future__ import annotations

import re
from typing import Any

from camviz_school.course import minutes, questions, saved_outputs
from camviz_school.course.minutes import Cell, DeeperSection

Notebook = Any

MOST_WORDS, MOST_LINES, MOST_IDEAS = 1300, 60, 3
EXERCISES = 2, 3
CORE_MINUTES, SECTION_MINUTES = (45, 60), (15, 25)
MOST_CONTROLS, MOST_PANELS = 2, 2
"""Of the first view of a section of the core."""
SOON = 2
"""Cells after a prediction, one of which shows what comes of it."""
BEFORE_THE_VIEW = 2
"""Cells above the first view: the header, and what Colab needs. What the lesson needs stands below it."""

_IDEAS = re.compile(r"^\*\*Ideas:\*\* (.+)$", re.MULTILINE)
_ASKS = re.compile(r"\*About (\d+) minutes\. Asks for: [^*]+\*")


def complaints(notebook: Notebook, number: str) -> list[str]:
    """Where a lesson departs from the pattern, in words; empty for a good one."""
    core = minutes.core(notebook)
    return [
        *_measured(core),
        *_begins(core, number),
        *_shows(core),
        *_ends(core, number),
        *(found for section in minutes.sections(notebook) for found in _deeper(section)),
    ]


def _measured(core: list[Cell]) -> list[str]:
    """Words, lines, exercises and minutes."""
    read, lines, exercises = minutes.words(core), minutes.given_lines(core), len(minutes.stubs(core))
    needed, (least, most) = minutes.said(minutes.reckoned(core)), CORE_MINUTES
    return [
        *([f"the core has {read} words, more than {MOST_WORDS}"] if read > MOST_WORDS else []),
        *([f"the core gives {lines} lines of code, more than {MOST_LINES}"] if lines > MOST_LINES else []),
        *([] if EXERCISES[0] <= exercises <= EXERCISES[1] else [f"the core has {exercises} exercises, not 2 or 3"]),
        *([] if least <= needed <= most else [f"the core takes {needed} minutes, not {least} to {most}"]),
    ]


def _begins(core: list[Cell], number: str) -> list[str]:
    """The question, at most three ideas, a view, what the lesson is about, and first thoughts, in this order."""
    found = []
    named = _IDEAS.search(core[0].source)
    if not named:
        found.append("the header must name the ideas of the lesson: **Ideas:** one · two · three")
    elif len(named[1].partition(". ")[0].split(" · ")) > MOST_IDEAS:
        found.append(f"the header names more than {MOST_IDEAS} ideas: {named[1]}")
    viewed = _first(core, lambda cell: cell.cell_type == "code" and "explore(" in cell.source)
    if viewed > BEFORE_THE_VIEW:
        found.append(f"at most {BEFORE_THE_VIEW} cells may stand above the first view, {viewed} do")
    about = _first(core, lambda cell: "about" in cell.metadata.get("tags", []))
    if about != viewed + 1 or about == len(core) or "<details>" not in core[about].source:
        found.append("below the first view a cell tagged about must say, folded, what the lesson is about")
    setup = _first(core, lambda cell: "setup" in cell.metadata.get("tags", []))
    if setup != about + 1 or setup == len(core) or not core[setup].metadata.get("jupyter", {}).get("source_hidden"):
        found.append("the setup cell must stand, folded, below what the lesson is about")
    asked, taught = _first(core, _asks_first(number)), _first(core, lambda cell: cell.source.startswith("## "))
    if questions.quiz_questions(number, "A") and not viewed < asked < taught:
        found.append(f'quiz("{number}", "A") must stand below the first view and above the first section')
    return found


def _shows(core: list[Cell]) -> list[str]:
    """A prediction is followed by its view, and the first view of a section is one panel or two, and two controls."""
    found = []
    for at, cell in enumerate(core):
        soon = core[at + 1 : at + 1 + SOON]
        if cell.cell_type == "code" and cell.source.startswith("ask(") and not any(map(_pictures, soon)):
            found.append(f"{cell.source} must be followed by its view within {SOON} cells")
    for view in _first_views(core):
        names, panels = minutes.controls([view])[0], _panels(view)
        if not 0 < len(names) <= MOST_CONTROLS:
            found.append(f"the first view of a section has 1 to {MOST_CONTROLS} controls, not {names or 'all'}")
        if panels > MOST_PANELS:
            found.append(f"the first view of a section has at most {MOST_PANELS} panels, not {panels}: {view.source}")
    return found


def _ends(core: list[Cell], number: str) -> list[str]:
    quiz = _first(core, lambda cell: cell.source == f'quiz("{number}")')
    recap = _first(core, lambda cell: re.search(r"^## Recap", cell.source, re.MULTILINE) is not None)
    return [] if quiz < recap < len(core) else ["the core must end with the quiz and the recap"]


def _deeper(section: DeeperSection) -> list[str]:
    """A deeper section says what it asks for and its minutes, and is short."""
    needed, (least, most) = minutes.said(minutes.reckoned(section.cells)), SECTION_MINUTES
    asks = _ASKS.search(section.cells[0].source)
    found = []
    if not asks or int(asks[1]) != needed:
        found.append(f"{section.title!r} must say *About {needed} minutes. Asks for: …*")
    if not least <= needed <= most:
        found.append(f"{section.title!r} takes {needed} minutes, not {least} to {most}")
    return found


def _first_views(core: list[Cell]) -> list[Cell]:
    """The first view above the sections, and that of each section."""
    found, waiting = [], True
    for cell in core:
        if cell.cell_type == "markdown" and cell.source.startswith("## "):
            waiting = True
        elif waiting and cell.cell_type == "code" and "explore(" in cell.source:
            found.append(cell)
            waiting = False
    return found


def _panels(view: Cell) -> int:
    """How many panels the saved picture of a cell has; a tile called key names the lines of the panel before it."""
    return sum(words != "key" for words, _ in saved_outputs.images(view))


def _pictures(cell: Cell) -> bool:
    return cell.cell_type == "code" and ("explore(" in cell.source or "plt." in cell.source)


def _asks_first(number: str) -> Any:
    return lambda cell: cell.source == f'quiz("{number}", "A")'


def _first(cells: list[Cell], wanted: Any) -> int:
    """The place of the first cell that is wanted; beyond the last where none is."""
    return next((at for at, cell in enumerate(cells) if wanted(cell)), len(cells))
