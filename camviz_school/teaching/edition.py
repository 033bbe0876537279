"""The teacher's edition of a lesson: its plan at the head, a key after every question, solutions in their places."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable
from copy import deepcopy
from pathlib import Path
from typing import Any

from camviz_school.course import material, notebooks
from camviz_school.course.notebooks import Cell, Notebook, exercise_cells, read, solution_code, write
from camviz_school.course.questions import Question
from camviz_school.course.saved_outputs import tidied
from camviz_school.teaching import parts, plans
from camviz_school.teaching.deck import planned_slides
from camviz_school.teaching.numbering import Numbering
from camviz_school.teaching.plans import ExpectedVotes, Plan, Step

Say = Callable[[str], None]

NOTICE = "**Teacher's edition**, with keys and solutions: for your own screen."

UNBROKEN_DASH = "\u2060–\u2060"
"""Between two numbers that are to stay on one line."""


def teacher_edition(notebook: Notebook) -> Notebook:
    """The same lesson with its stubs solved, its solutions open, and beside its cells what a teacher needs there.

    Plan, keys and notes are cells tagged `plan`, `key` and `teacher`. Solutions and hidden tests stand between
    nbgrader's marks, so that `nbgrader generate_assignment` takes them out.
    """
    edition = deepcopy(notebook)
    for name, (stub, check, solution) in exercise_cells(edition).items():
        stub.source = mark_solution(stub.source, solution_code(solution))
        stub.metadata["nbgrader"] = _nbgrader(name, solution=True)
        check.source = hidden_test(check.source)
        check.metadata["nbgrader"] = {**_nbgrader(f"{name}-check", grade=True), "points": 1}
    for details in edition.cells:
        if details.cell_type == "markdown":
            details.source = details.source.replace("<details>", "<details open>")
    plan = plans.plan(parts.number_of(notebook))
    beside = [(*_notes(one, plan), *_keys(one, plan)) for one in edition.cells]
    cells = [cell for one, more in zip(edition.cells, beside, strict=True) for cell in (one, *more)]
    if plan:
        _anchored(cells, plan, parts.titles(notebook))
    edition.cells = [_cell(NOTICE, "edition", "teacher"), cells[0], *_planned(plan, notebook), *cells[1:]]
    for cell in edition.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    edition.metadata.get("camviz", {}).pop("source", None)
    return edition


def write_teacher_edition(
    source: Path, out: Path, *, run: bool = False, only: Iterable[str] = (), say: Say = lambda sentence: None
) -> list[Path]:
    """Writes the teacher's edition of the lessons in `source` into `out`, under the same names, with their pictures.

    `only` are numbers of lessons, by default all. With `run` each lesson is run, and its outputs are in the file; one
    that does not run is written without, and `say` gets a sentence about it. Raises ValueError when `out` is the
    lessons' own folder.
    """
    if out.resolve() == source.resolve():
        raise ValueError(f"the teacher's edition cannot be written over the lessons themselves, {source}")
    out.mkdir(parents=True, exist_ok=True)
    for path in (*source.glob("images/*"), *source.glob("*.md")):
        (out / path.relative_to(source)).parent.mkdir(exist_ok=True)
        shutil.copyfile(path, out / path.relative_to(source))
    chosen = chosen_lessons(source, only)
    for count, path in enumerate(chosen, start=1):
        edition = teacher_edition(read(path))
        if run:
            say(f"running {path.name} ({count} of {len(chosen)})")
            edition = executed(edition, out, path.name, say)
        write(edition, out / path.name)
    return [out / path.name for path in chosen]


def chosen_lessons(source: Path, only: Iterable[str] = ()) -> list[Path]:
    """The lessons in a folder, or those with the numbers `only`. Raises ValueError for a number that none has."""
    found = {path.name.partition("_")[0]: path for path in material.lesson_paths(source)}
    for number in only:
        if number not in found:
            raise ValueError(f"there is no lesson {number}; the lessons are {', '.join(found)}")
    return [path for number, path in found.items() if not list(only) or number in only]


def executed(edition: Notebook, folder: Path, name: str, say: Say) -> Notebook:
    """The notebook with its outputs; as it was when a cell fails, and `say` hears which."""
    from jupyter_client.kernelspec import NoSuchKernel
    from nbclient.exceptions import CellControlSignal, DeadKernelError

    run = deepcopy(edition)
    try:
        notebooks.execute(run, folder)
    except (CellControlSignal, DeadKernelError, NoSuchKernel, OSError) as error:
        say(f"{name} could not be run ({_what_failed(error)}), so it is written without outputs.")
        return edition
    return tidied(run)


def _what_failed(error: BaseException) -> str:
    """One line: the exception in the cell where nbclient tells it, or what the error itself says last."""
    from nbclient.exceptions import CellExecutionError

    if isinstance(error, CellExecutionError):
        return f"{error.ename}: {' '.join(str(error.evalue).split())[:200]}"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0][:200] if lines else 'no message'}"


def mark_solution(stub: str, solution: str) -> str:
    """The solution with what differs from the stub between ### BEGIN SOLUTION and ### END SOLUTION."""
    lines, given = solution.splitlines(), stub.splitlines()
    same = 0
    while same < min(len(lines), len(given)) and lines[same] == given[same]:
        same += 1
    if same == len(lines):
        raise ValueError(f"a solution must differ from its stub: {solution[:60]!r}")
    indent = re.match(r"\s*", next(line for line in lines[same:] if line.strip()))
    margin = indent[0] if indent else ""
    return "\n".join([*lines[:same], f"{margin}### BEGIN SOLUTION", *lines[same:], f"{margin}### END SOLUTION"])


def hidden_test(check: str) -> str:
    """The cell of a check with tests between ### BEGIN HIDDEN TESTS and ### END HIDDEN TESTS.

    Where the check fails, the error says why. Where it holds, its last line is no value: nbgrader takes a value for
    points, and one that is no number for an oversight.
    """
    before = f"### BEGIN HIDDEN TESTS\n_verdict = {check.strip()}\nassert _verdict, _verdict\n### END HIDDEN TESTS"
    return f"{before}\n{check}\n### BEGIN HIDDEN TESTS\nprint(_verdict)\n### END HIDDEN TESTS"


# What is put beside a lesson's cells ---------------------------------------------------------------------------------


def _planned(plan: Plan | None, notebook: Notebook) -> list[Cell]:
    if not plan:
        return []
    numbering = Numbering.of(plan, planned_slides(notebook))
    return [_cell(plan_markdown(numbering, parts.titles(notebook)), f"plan-{plan.lesson}", "plan")]


def renumber(edition: Notebook, numbering: Numbering) -> None:
    """Puts the numbers of these slides into the edition's plan: a solved lesson may have others than an open one."""
    for cell in edition.cells:
        if "plan" in cell.metadata.get("tags", []):
            cell.source = plan_markdown(numbering, parts.titles(edition))


def plan_markdown(numbering: Numbering, titles: dict[str, str]) -> str:
    """The plan as a table of minutes, slides, places, and what teacher and class do; what to skip; what to bring."""
    rows, plan = [], numbering.plan
    for long, short, step in plan.timetable(UNBROKEN_DASH):
        shown = numbering.slides(step).replace("–", UNBROKEN_DASH)
        cells = (long, short, shown, _linked(step, titles), _one_line(step.teacher), _one_line(step.students))
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(
        [
            "## For the teacher: the plan",
            "",
            "Keep this file on your own screen, for it shows the keys. Project the slides and the students' lesson.",
            "",
            f"| {plans.LONG} min | {plans.SHORT} min | Slides | Where | You | The class |",
            "|---|---|---|---|---|---|",
            *rows,
            "",
            f"A step marked – is left out in that plan. {numbering.sentence}",
            "",
            *(f"* **{title}.** {_one_line(text)}" for title, text in plan.cases),
        ]
    )


def place(step: Step, titles: dict[str, str]) -> str:
    """Where a step is in the lesson, in words."""
    if step.kind == "question":
        return f"Question: {step.name.replace('_', ' ')}"
    return titles.get(step.at, {"header": "The lesson's question", "quiz": "Exit quiz"}.get(step.kind, step.at))


def _linked(step: Step, titles: dict[str, str]) -> str:
    words = _one_line(place(step, titles))
    anchor = f"key-{step.name}" if step.kind == "question" else _anchor(step.at)
    return f"[{words}](#{anchor})" if step.at in titles or step.kind == "question" else words


def _anchor(at: str) -> str:
    """An address that every Markdown takes as it is: "plan-section-3"."""
    return "plan-" + "-".join(re.findall(r"\w+", at)).lower()


def _anchored(cells: list[Cell], plan: Plan, titles: dict[str, str]) -> None:
    """Puts an address before each heading that the plan leads to: headings' own are not the same everywhere."""
    wanted = {titles[step.at]: _anchor(step.at) for step in plan.steps if step.at in titles}
    for cell in cells:
        if cell.cell_type == "markdown":
            lines = cell.source.split("\n")
            anchors = [wanted.pop(line.lstrip("# "), "") if line.startswith("##") else "" for line in lines]
            pairs = zip(anchors, lines, strict=True)
            cell.source = "\n".join(f'<a id="{anchor}"></a>\n\n{line}' if anchor else line for anchor, line in pairs)


def _keys(cell: Cell, plan: Plan | None) -> list[Cell]:
    asked = parts.asked(cell)
    if not asked:
        return []
    text = "\n\n---\n\n".join(key_markdown(one, plan.expected(one.name) if plan else None) for one in asked)
    return [_cell(text, f"key-{cell.id}", "key")]


def key_markdown(question: Question, votes: ExpectedVotes | None) -> str:
    """The right choice, then for each choice its expected share, the thought behind it and the reply to it."""
    name = question.name.partition(".")[2]
    letter, right = question.lettered[question.answer]
    lines = [
        f'<a id="key-{name}"></a>',
        f"> **Key.** Right is **({letter})** {_markdown(right.text)}",
    ]
    for number, (letter, choice) in enumerate(question.lettered):
        share = f", {votes.split[number]} % expected" if votes else ""
        thought = f" The thought behind it: *{_markdown(choice.misconception)}*." if choice.misconception else ""
        mark = "✓" if choice.correct else "✗"
        lines.append(f"> * **({letter})** {mark}{share}.{thought} Reply: {_markdown(choice.reply)}")
    if votes:
        counted = "nobody has counted votes yet" if votes.guessed else votes.source
        lines += [">", f"> The expected votes are {'a guess: ' if votes.guessed else 'from '}{_markdown(counted)}."]
    return "\n".join([lines[0], "", lines[1], ">", *lines[2:]])


def _notes(cell: Cell, plan: Plan | None) -> list[Cell]:
    """The note of a cell. The minutes that one gives are a reader's, who votes with nobody: a class has the plan's."""
    note = cell.metadata.get("camviz", {}).get("teacher", "")
    if plan:
        of_class = f"and a class {plans.LONG} or {plans.SHORT}, as the plan says"
        note = re.sub(
            r"\*\*(\d+) minutes(\.?)\*\*", rf"This lesson takes a reader about \1 minutes, {of_class}\2", note
        )
    text = f"> **For the teacher:** {note.strip()}".replace("\n", "\n> ") if note else ""
    return [_cell(text, f"teacher-{cell.id}", "teacher")] if note else []


def _cell(text: str, name: str, tag: str) -> Cell:
    import nbformat

    made = nbformat.v4.new_markdown_cell(text)
    made.id, made.metadata["tags"] = name[:64], [tag]
    return made


def _one_line(text: str) -> str:
    """For a cell of a table, where a bar would end it."""
    return _markdown(text).replace("|", r"\|")


def _markdown(text: str) -> str:
    """Prose with `code` and *emphasis* as Markdown on one line: what else would be markup there is escaped."""
    pieces = re.split(r"(``.+?``|`[^`]+`)", " ".join(text.split()))
    return "".join(one if one.startswith("`") else re.sub(r"([<$~])", r"\\\1", one) for one in pieces)


def _nbgrader(name: str, grade: bool = False, solution: bool = False) -> dict[str, Any]:
    marks = {"grade": grade, "solution": solution, "locked": grade, "task": False}
    return {"schema_version": 3, "grade_id": name.replace(".", "-"), **marks}
