"""The pattern of a lesson, as statements that a notebook keeps or breaks; `complaints` lists the broken ones."""

from __future__ import annotations

import ast
import re
from typing import Any

from camviz_school.course import catalogue, colab, core_rules, glossary, notebooks, questions, reading
from camviz_school.course.exercises import exercises
from camviz_school.course.minutes import is_layered, minutes

Notebook = Any

SETUP = """\
import numpy as np

from camviz.widgets import explore
from camviz_school.course.exercises import Tutor
from camviz_school.widgets import ask, quiz

check = Tutor()"""
"""The first code of every lesson; what only one lesson needs is imported where it is used."""

LONGEST_CELL = 30
"""Lines of code a reader can take in at once."""

MOST_DRAWING = 8
"""Lines that plot, in one cell: what a reader would write, and not more than shows the result."""

_DRAWING = re.compile(r"\b(?:plt|ax|axes|figure|plotter)\b[.\[]|^for \w+, .* in zip\(axes")
_LINK = re.compile(r"00_start_here\.ipynb#([^)\s]+)\)")
_HEADER = ("minutes", "prerequisites", "what you'll do", "what you'll learn", "what you'll need", "mybinder.org")


def complaints(notebook: Notebook, file_name: str) -> list[str]:
    """Where a lesson departs from the pattern, in words; empty for a good one. Lesson 00 has no exercises to hold."""
    number = file_name[:2]
    found = [
        *_header(notebook, number),
        *_listed(notebook, file_name),
        *_setup(notebook),
        *_cells(notebook),
        *_links(notebook),
    ]
    if number != "00":
        found += [*_questions(notebook, number), *_exercises(notebook, number), *_ending(notebook)]
        found += [*_own_functions(notebook), *_reads_well(notebook, number)]
    return [*found, *core_rules.complaints(notebook, number)] if is_layered(notebook) else found


def _header(notebook: Notebook, number: str) -> list[str]:
    first = notebook.cells[0]
    if first.cell_type != "markdown" or not first.source.startswith("# "):
        return ["the first cell must be the header: Markdown that begins with # and the title"]
    told = [first, *notebooks.tagged(notebook, "about")]
    text = "\n".join(cell.source for cell in told).replace("’", "'").lower()
    wanted = ("?", *_HEADER) if number != "00" else _HEADER[:1]
    found = [f"the header does not mention {word!r}" for word in wanted if word not in text]
    needed = minutes(notebook, number)
    if f"about {needed} minutes" not in first.source.lower():
        found.append(f"the header must say how long the lesson takes, About {needed} minutes")
    return found


def _listed(notebook: Notebook, file_name: str) -> list[str]:
    """Whether README and lesson 00 can list the lesson."""
    try:
        catalogue.described(notebook, file_name)
    except ValueError as error:
        return [str(error)]
    return []


def _setup(notebook: Notebook) -> list[str]:
    """One setup cell, the first code but for Colab's, and the same in every lesson."""
    for cell in notebooks.tagged(notebook, "colab"):
        if cell.source != colab.INSTALL:
            return [f"the cell tagged colab must be the same as everywhere:\n{colab.INSTALL}"]
    code = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source != colab.INSTALL]
    setup = notebooks.tagged(notebook, "setup")
    if is_layered(notebook):  # its first view stands above the setup cell
        code = code[1:]
    if len(setup) != 1 or not code or code[0] is not setup[0]:
        return [f"the first code cell, and no other, must be tagged setup; {len(setup)} are"]
    return [] if setup[0].source == SETUP else [f"setup must be the same as everywhere:\n{SETUP}"]


def _cells(notebook: Notebook) -> list[str]:
    found = []
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type != "code":
            continue
        lines = cell.source.splitlines()
        if len(lines) > LONGEST_CELL:
            found.append(f"cell {number} has {len(lines)} lines of code, more than {LONGEST_CELL}: {lines[0]}")
        drawn = sum(bool(_DRAWING.search(line)) for line in lines)
        if drawn > MOST_DRAWING:
            found.append(f"cell {number} has {drawn} lines that draw, more than {MOST_DRAWING}: {lines[0]}")
    if not notebooks.tagged(notebook, "nbval-check-output"):
        found.append("no cell is tagged nbval-check-output, so no number of this lesson is held")
    return found


def _links(notebook: Notebook) -> list[str]:
    anchors = {one.anchor for one in glossary.glossary().terms}
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    return [f"no glossary entry has the address {one}" for one in sorted(set(_LINK.findall(text)) - anchors)]


def _questions(notebook: Notebook, number: str) -> list[str]:
    code = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "code")
    asked, quizzes = re.findall(r"\bask\(\"([^\"]+)\"\)", code), re.findall(r"\bquiz\((.*)\)", code)
    known = {one.name: one for one in questions.questions(number).values()}
    predict = [name for name, one in known.items() if one.kind == "predict"]
    found = [f"ask({name!r}): lesson {number} has no such predict question" for name in asked if name not in predict]
    found += [f"the predict question {name} is never asked" for name in predict if name not in asked]
    if len(asked) < 2:
        found.append(f"at least two predict questions are wanted, {len(asked)} are asked")
    if quizzes.count(f'"{number}"') != 1:
        found.append(f'the lesson must end with one quiz("{number}"), has {quizzes}')
    sources = [cell.source for cell in notebook.cells]
    if questions.quiz_questions(number, "A") and not is_layered(notebook):
        found += _first_thoughts(sources, number)
    recap = next((i for i, source in enumerate(sources) if _heading("Recap", source)), len(sources))
    if any(source.startswith("quiz(") for source in sources[recap:]):
        found.append("the quiz must stand above the recap, which repeats its answers")
    return found


def _first_thoughts(sources: list[str], number: str) -> list[str]:
    """Form A comes before anything that teaches: below the setup cell, which it needs, and one sentence of its own."""
    first, setup = f'quiz("{number}", "A")', next((i for i, source in enumerate(sources) if source == SETUP), 0)
    if sources.count(first) != 1:
        return [f"a cell {first} must ask what the reader thinks before the lesson, {sources.count(first)} do"]
    return [] if sources.index(first) == setup + 2 else [f"{first} must stand below the setup cell and one sentence"]


def _exercises(notebook: Notebook, number: str) -> list[str]:
    try:
        stubs, checks, solutions = notebooks.stubs(notebook), notebooks.checks(notebook), notebooks.solutions(notebook)
    except ValueError as error:
        return [str(error)]
    known = exercises(number)
    found = [f"{name} is no exercise of lesson {number}" for name in stubs if name not in known]
    found += [f"the exercise {name} has no stub" for name in known if name not in stubs]
    if not is_layered(notebook) and not 3 <= len(stubs) <= 5:
        found.append(f"three to five exercises are wanted, there are {len(stubs)}")
    if not any(known[name].bug for name in stubs if name in known):
        found.append("one exercise should be to find a bug")
    for name in stubs:
        if f'check("{name}"' not in checks[name]:
            found.append(f'the check of {name} must call check("{name}", …)')
        if solutions[name].strip() == stubs[name].strip():
            found.append(f"the solution of {name} is its stub")
    closed = [cell for cell in notebooks.tagged(notebook, "solution") if "<details>" not in cell.source]
    return [*found, *(f"a solution is not folded by <details>: {cell.source[:40]!r}" for cell in closed)]


def _own_functions(notebook: Notebook) -> list[str]:
    """What the reader wrote is what the lesson goes on with: under sliders, and in a plot of its own."""
    names = [name.split(".")[1] for name in notebooks.stubs(notebook)]
    rest = [
        cell.source
        for cell in notebook.cells
        if cell.cell_type == "code" and not {"stub", "check"} & set(cell.metadata.get("tags", []))
    ]
    used = {node.id for source in rest for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Name)}
    run = [name for name in names if name in used]
    found = [] if len(run) >= 2 else [f"at least two of the reader's functions must run in the lesson, {run} do"]
    if not any("yours=" in source and "explore(" in source for source in rest):
        found.append("no visualizer runs a function of the reader's: explore(…View(…, yours=…))")
    if not any("attempt(" in source and "plt." in source for source in rest):
        found.append("nothing of the reader's own is plotted: attempt(…) and plt")
    return found


def _reads_well(notebook: Notebook, number: str) -> list[str]:
    found = [
        f"cell {one.cell} has {long}" for one in reading.main_line(notebook) for long in reading.too_long(one.text)
    ]
    links = [f"the first use of {name!r} should link to the glossary" for name in reading.unlinked(notebook, number)]
    return [*found, *links]


def _ending(notebook: Notebook) -> list[str]:
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    found = [f"there is no heading {title!r}" for title in ("Recap", "Further reading") if not _heading(title, text)]
    if len(set(_LINK.findall(text))) < 3:
        found.append("at least three terms should be linked to the glossary, as 00_start_here.ipynb#principal-point")
    if not any(cell.metadata.get("camviz", {}).get("teacher") for cell in notebook.cells):
        found.append("no cell has a note for the teacher in its metadata")
    return found


def _heading(title: str, text: str) -> bool:
    return re.search(rf"^#+ .*{title}", text, re.MULTILINE | re.IGNORECASE) is not None
