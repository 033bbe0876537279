"""How long a lesson takes a student alone: reckoned from what is in it, by one rule.

A lesson with a heading `## Going deeper` has a core above it and deeper sections, each under a heading `### …`, below
it. Its header says the minutes of the core, each deeper section its own. Lessons that are not yet divided in this way
are reckoned as a whole, by words, questions and exercises alone (`whole`).

The rule adds reading, working through formulas and code, moving sliders, and answering. The constants say what each is
taken to cost. They are estimates, and nobody has measured them on a class: a teacher who does may change them here, and
a test then asks for the headers to follow.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from camviz_school.course import questions, reading
from camviz_school.course.exercises import exercises
from camviz_school.course.notebooks import exercise_of, solution_code

Notebook = Any
Cell = Any

WORDS_A_MINUTE = 200
"""Silent reading of English non-fiction has a mean of 238 (Brysbaert 2019); this text is technical, and many of its
readers read it in their second language."""

LINES_A_MINUTE = 8
"""Of given code: a line is read, and about every other one asks what a name or an axis is."""

MINUTES_A_FORMULA, MINUTES_A_SYMBOL = 0.5, 0.1
"""A displayed formula is read twice and its symbols are found in the text; one in a line is recognised."""

MINUTES_A_CONTROL = 0.5
"""A slider is moved from end to end and back, slowly."""

CONTROLS_OF_ALL = 4
"""Controls that are moved in a view that shows all of its own."""

MINUTES_A_PREDICTION = 2
"""Read, thought over, chosen, and the reply read."""

MINUTES_A_FIRST_THOUGHT = 1
"""For a question of form A: it is read and answered, and there is no reply to read or to argue with."""

MINUTES_AN_EXIT_QUESTION = 1.5
"""For a question of form B: its idea is known by then; the reply is read."""

MINUTES_A_PATIENT = 4
"""In lesson 16 a calibration is shown by every view of the clinic, and a reader writes down what is wrong with it."""

MINUTES_A_QUESTION = 3
"""In a lesson that is reckoned as a whole: predictions and exit questions alike."""

MINUTES_AN_EXERCISE, MINUTES_A_LINE = 5, 1
"""To understand the task, to try twice and to look at the picture that comes of it; and for each line of the solution
below its docstring, which a reader writes, or reads to find the bug."""

MINUTES_ANY_EXERCISE = 8
"""In a lesson that is reckoned as a whole."""

STEP = 5
"""Minutes are said to so many."""

DEEPER = "## Going deeper"

_WORD = re.compile(r"[^\W\d_]+(?:[’'][^\W\d_]+)?")
_NOT_READ = re.compile(r"\]\([^)]*\)|\$\$.*?\$\$|\$[^$\n]*\$", re.DOTALL)  # addresses; formulas
_DISPLAYED = re.compile(r"\$\$.*?\$\$", re.DOTALL)
_INLINE = re.compile(r"\$[^$\n]+\$")
_PATIENT = re.compile(r"^ward\[\d+\]$", re.MULTILINE)
_ASKED = re.compile(r'^(ask|quiz)\("(\w\w)(?:\.\w+)?"(?:, "(\w)")?\)$', re.MULTILINE)
_NOT_GIVEN = {"setup", "colab", "stub", "check"}


@dataclass(frozen=True)
class DeeperSection:
    """A deeper section: its heading and its cells, the first of which begins with that heading."""

    title: str
    cells: tuple[Cell, ...]


def is_layered(notebook: Notebook) -> bool:
    """Whether a lesson has a core, and deeper sections below it."""
    return any(_begins_deeper(cell) for cell in notebook.cells)


def core(notebook: Notebook) -> list[Cell]:
    """The cells of the core: those above the heading `## Going deeper`, or all of them where there is none."""
    found = []
    for cell in notebook.cells:
        if _begins_deeper(cell):
            break
        found.append(cell)
    return found


def sections(notebook: Notebook) -> list[DeeperSection]:
    """The deeper sections, in their order; cells between the heading `## Going deeper` and the first are in none."""
    found: list[tuple[str, list[Cell]]] = []
    for cell in notebook.cells[len(core(notebook)) :]:
        heading = re.match(r"### (.+)", cell.source) if cell.cell_type == "markdown" else None
        if heading:
            found.append((heading[1].strip(), []))
        if found:
            found[-1][1].append(cell)
    return [DeeperSection(title, tuple(cells)) for title, cells in found]


def minutes(notebook: Notebook, number: str) -> int:
    """What the header says: about how long the core takes, or a lesson that is not divided, to five minutes."""
    return said(reckoned(core(notebook))) if is_layered(notebook) else whole(notebook, number)


def said(reckoning: float) -> int:
    """Minutes as a header says them.

    >>> said(52.4), said(52.6)
    (50, 55)
    """
    return STEP * round(reckoning / STEP)


def reckoned(cells: Iterable[Cell]) -> float:
    """The minutes that some cells take."""
    cells = list(cells)
    text = "\n\n".join(one.text for one in reading.main_line_of(cells))
    asked = [found for cell in cells if cell.cell_type == "code" for found in _ASKED.findall(cell.source)]
    return (
        words(cells) / WORDS_A_MINUTE
        + given_lines(cells) / LINES_A_MINUTE
        + MINUTES_A_FORMULA * len(_DISPLAYED.findall(text))
        + MINUTES_A_SYMBOL * len(_INLINE.findall(_DISPLAYED.sub(" ", text)))
        + MINUTES_A_CONTROL * sum(len(names) or CONTROLS_OF_ALL for names in controls(cells))
        + MINUTES_AN_EXERCISE * len(stubs(cells))
        + MINUTES_A_PATIENT * sum(len(_PATIENT.findall(cell.source)) for cell in cells if cell.cell_type == "code")
        + MINUTES_A_LINE * written_lines(cells)
        + sum(_of_questions(*one) for one in asked)
    )


def words(cells: Iterable[Cell]) -> int:
    """Words of the running text: without folded boxes, solutions, formulas and further reading."""
    text = "\n\n".join(one.text for one in reading.main_line_of(cells))
    return len(_WORD.findall(_NOT_READ.sub(" ", text)))


def given_lines(cells: Iterable[Cell]) -> int:
    """Lines of code that a lesson gives: not what a reader writes, what sets up, and what asks or checks."""
    code = [one for one in cells if one.cell_type == "code" and not _NOT_GIVEN & set(one.metadata.get("tags", []))]
    lines = [line.strip() for cell in code if not _ASKED.match(cell.source) for line in cell.source.splitlines()]
    return sum(bool(line) and not line.startswith("#") for line in lines)


def stubs(cells: Iterable[Cell]) -> list[str]:
    """The exercises that some cells set, by name."""
    return [exercise_of(cell) for cell in cells if "stub" in cell.metadata.get("tags", [])]


def written_lines(cells: Iterable[Cell]) -> int:
    """Lines of the exercises' solutions: without what each stub has already, its first line and its docstring."""
    bodies = []
    for cell in cells:
        if "solution" in cell.metadata.get("tags", []):
            (function,) = (one for one in ast.parse(solution_code(cell)).body if isinstance(one, ast.FunctionDef))
            bodies.append(function.body[ast.get_docstring(function) is not None :])
    return sum((body[-1].end_lineno or 0) - body[0].lineno + 1 for body in bodies)


def controls(cells: Iterable[Cell]) -> list[list[str]]:
    """For each view that some cells show, the controls that it names; none where it shows all of its own."""
    trees = [ast.parse(cell.source) for cell in cells if cell.cell_type == "code" and "explore(" in cell.source]
    calls = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)]
    shown = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "explore"]
    return [
        [
            *(str(ast.literal_eval(one)) for one in call.args[1:] if isinstance(one, ast.Constant)),
            *(one.arg for one in call.keywords if one.arg and one.arg != "together"),
        ]
        for call in shown
    ]


def whole(notebook: Notebook, number: str) -> int:
    """About how long a lesson takes that is not divided, to five minutes: words, questions and exercises."""
    text = "\n".join(
        cell.source
        for cell in notebook.cells
        if cell.cell_type == "markdown" and not {"glossary", "solution"} & set(cell.metadata.get("tags", []))
    )
    read = len(_WORD.findall(_NOT_READ.sub(" ", text)))
    first = len(questions.quiz_questions(number, "A"))
    asked = MINUTES_A_FIRST_THOUGHT * first
    asked += MINUTES_A_QUESTION * (len(questions.questions(number)) - first)
    return said(read / WORDS_A_MINUTE + asked + MINUTES_ANY_EXERCISE * len(exercises(number)))


def _of_questions(kind: str, number: str, form: str) -> float:
    if kind == "ask":
        return MINUTES_A_PREDICTION
    each = MINUTES_A_FIRST_THOUGHT if form == "A" else MINUTES_AN_EXIT_QUESTION
    return each * len(questions.quiz_questions(number, form or "B"))


def _begins_deeper(cell: Cell) -> bool:
    return cell.cell_type == "markdown" and cell.source.startswith(DEEPER)
