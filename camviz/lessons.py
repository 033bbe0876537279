"""Tools for the lessons: what a lesson must have, its teacher's edition, and its saved outputs.

python -m camviz.lessons check            what departs from the pattern of a lesson
python -m camviz.lessons refresh [05 …]   run and save with static outputs
python -m camviz.lessons fresh            which saved outputs are older than their lesson
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import sys
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from camviz import glossary
from camviz.notebooks import Cell, Notebook, exercise_cells, read, solution_code, tagged, write
from camviz.pattern import complaints
from camviz.teaching import plans

_RANDOM_ID = re.compile(r"[0-9a-f]{8}")


def lessons_folder() -> Path:
    """Where the lessons are: inside an installed package, or beside it in the repository."""
    installed = Path(__file__).with_name("_lessons")
    return installed if installed.is_dir() else Path(__file__).parents[1] / "lessons"


# The teacher's edition ----------------------------------------------------------------------------------------------


def teacher_edition(notebook: Notebook) -> Notebook:
    """The same lesson with its stubs solved, its solutions open and the teacher's notes beside the cells they speak of.

    Solutions and hidden tests stand between nbgrader's marks, so that `nbgrader generate_assignment` takes them out.
    """
    edition = deepcopy(notebook)
    for name, (stub, check, solution) in exercise_cells(edition).items():
        stub.source = mark_solution(stub.source, solution_code(solution))
        stub.metadata["nbgrader"] = _nbgrader(name, solution=True)
        check.source = f"### BEGIN HIDDEN TESTS\nassert {check.source.strip()}\n### END HIDDEN TESTS\n{check.source}"
        check.metadata["nbgrader"] = {**_nbgrader(f"{name}-check", grade=True), "points": 1}
    for details in edition.cells:
        if details.cell_type == "markdown":
            details.source = details.source.replace("<details>", "<details open>")
    edition.cells = [cell for one in edition.cells for cell in (one, *_notes(one))]
    edition.cells[0].source = re.sub(r"\A# (.*)", r"# \1 (teacher's edition)", edition.cells[0].source)
    for cell in edition.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    edition.metadata.get("camviz", {}).pop("source", None)
    return edition


def write_teacher_edition(source: Path, out: Path) -> list[Path]:
    """Writes the teacher's edition of every lesson in `source` into `out`, under the same names, with their pictures.

    Raises ValueError when `out` is the lessons' own folder.
    """
    if out.resolve() == source.resolve():
        raise ValueError(f"the teacher's edition cannot be written over the lessons themselves, {source}")
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for path in sorted(source.glob("*.ipynb")):
        write(teacher_edition(read(path)), out / path.name)
        written.append(out / path.name)
    for path in (*source.glob("images/*"), *source.glob("*.md")):
        (out / path.relative_to(source)).parent.mkdir(exist_ok=True)
        shutil.copyfile(path, out / path.relative_to(source))
    return written


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


def _notes(cell: Cell) -> list[Cell]:
    import nbformat

    note = cell.metadata.get("camviz", {}).get("teacher")
    if not note:
        return []
    made = nbformat.v4.new_markdown_cell(f"> **For the teacher:** {note.strip()}".replace("\n", "\n> "))
    made.id, made.metadata["tags"] = f"teacher-{cell.id}"[:64], ["teacher"]
    return [made]


def _nbgrader(name: str, grade: bool = False, solution: bool = False) -> dict[str, Any]:
    marks = {"grade": grade, "solution": solution, "locked": grade, "task": False}
    return {"schema_version": 3, "grade_id": name.replace(".", "-"), **marks}


# Saved outputs ------------------------------------------------------------------------------------------------------


def refresh(path: Path) -> None:
    """Runs a lesson with static, wireframe outputs and saves it so that the same lesson gives the same file.

    Raises nbclient's CellExecutionError when a cell does; the file is left alone then.
    """
    from nbclient import NotebookClient

    notebook = read(path)
    for cell in tagged(notebook, "glossary"):
        cell.source = glossary.markdown().rstrip("\n")
    client = NotebookClient(
        notebook,
        timeout=120,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute(env={**os.environ, "PYTHONPATH": _python_path(), "CAMVIZ_STATIC": "1", "CAMVIZ_RENDERER": "wire"})
    write(tidied(notebook), path)


def _python_path() -> str:
    """Where the lesson's kernel, which runs in the lessons' folder, finds this very package."""
    return os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])


def tidied(notebook: Notebook) -> Notebook:
    """The notebook without what changes from run to run: times, widget state, versions, random ids."""
    notebook = deepcopy(notebook)
    notebook.metadata = type(notebook.metadata)(
        {
            "kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
            "camviz": {"source": fingerprint(notebook)},
        }
    )
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    counter = 0
    ids: set[str] = set()
    for cell in notebook.cells:
        cell.id = _steady_id(cell, ids)
        ids.add(cell.id)
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            counter += 1
            cell.execution_count = counter
            for output in cell.outputs:
                if "execution_count" in output:
                    output.execution_count = counter
    return notebook


def fingerprint(notebook: Notebook) -> str:
    """A hash of the code whose outputs are saved."""
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return hashlib.sha256(json.dumps(code).encode()).hexdigest()


def is_fresh(notebook: Notebook) -> bool:
    """True when the saved outputs come from the code that is there, and the glossary cell from the glossary."""
    current = all(cell.source == glossary.markdown().rstrip("\n") for cell in tagged(notebook, "glossary"))
    return current and notebook.metadata.get("camviz", {}).get("source") == fingerprint(notebook)


def _steady_id(cell: Cell, taken: set[str]) -> str:
    """The cell's id, or where that was drawn at random one made from the cell's text."""
    if not _RANDOM_ID.fullmatch(cell.id) and cell.id not in taken:
        return cell.id
    text, number = hashlib.sha256(cell.source.encode()).hexdigest()[:12], 1
    while f"c-{text}-{number}" in taken:
        number += 1
    return f"c-{text}-{number}"


# Command line -------------------------------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """`python -m camviz.lessons`; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m camviz.lessons", description="Tools for those who write lessons.")
    subparsers = parser.add_subparsers(required=True)
    for name, run, text in _COMMANDS:
        command = subparsers.add_parser(name, help=text)
        command.add_argument("names", nargs="*", metavar="NAME", help="how a lesson's file name begins; default: all")
        command.set_defaults(run=run)
    given = parser.parse_args(arguments)
    try:
        return given.run(given)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2


def _paths(names: Sequence[str]) -> list[Path]:
    paths = sorted(lessons_folder().glob("*.ipynb"))
    chosen = [path for path in paths if not names or any(path.name.startswith(name) for name in names)]
    if not chosen:
        raise ValueError(f"no lesson in {lessons_folder()} begins with {' or '.join(names) or 'anything'}")
    return chosen


def _run_refresh(given: argparse.Namespace) -> int:
    for path in _paths(given.names):
        print(f"running {path.name}", flush=True)
        refresh(path)
    return 0


def _run_fresh(given: argparse.Namespace) -> int:
    stale = [path.name for path in _paths(given.names) if not is_fresh(read(path))]
    print("\n".join(f"{name} is stale: python -m camviz.lessons refresh {name}" for name in stale) or "all fresh")
    return 1 if stale else 0


def _run_check(given: argparse.Namespace) -> int:
    found = [f"{path.name}: {one}" for path in _paths(given.names) for one in _complaints(path)]
    print("\n".join(found) or "every lesson follows the pattern")
    return 1 if found else 0


def _complaints(path: Path) -> list[str]:
    """What is to be mended in a lesson and in its teacher's plan."""
    notebook, plan = read(path), plans.plan(path.name[:2])
    return complaints(notebook, path.name) + (plans.complaints(plan, notebook) if plan else [])


_COMMANDS = (
    ("check", _run_check, "say where lessons depart from the pattern"),
    ("refresh", _run_refresh, "run lessons and save them with static outputs"),
    ("fresh", _run_fresh, "say which lessons' saved outputs are stale"),
)

if __name__ == "__main__":
    sys.exit(main())
