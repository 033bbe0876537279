"""Tools for the lessons: what a lesson must have, and its saved outputs.

python -m camviz.lessons check            what departs from the pattern of a lesson
python -m camviz.lessons refresh [05 …]   run and save with static outputs
python -m camviz.lessons fresh            which saved outputs are older than their lesson
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import sys
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path

from camviz import glossary
from camviz.notebooks import Cell, Notebook, execute, read, tagged, write
from camviz.pattern import complaints
from camviz.teaching import plans

_RANDOM_ID = re.compile(r"[0-9a-f]{8}")


def lessons_folder() -> Path:
    """Where the lessons are: inside an installed package, or beside it in the repository."""
    installed = Path(__file__).with_name("_lessons")
    return installed if installed.is_dir() else Path(__file__).parents[1] / "lessons"


# Saved outputs ------------------------------------------------------------------------------------------------------


def refresh(path: Path) -> None:
    """Runs a lesson with static, wireframe outputs and saves it so that the same lesson gives the same file.

    Raises nbclient's CellExecutionError when a cell does; the file is left alone then.
    """
    notebook = read(path)
    for cell in tagged(notebook, "glossary"):
        cell.source = glossary.markdown().rstrip("\n")
    execute(notebook, path.parent)
    write(tidied(notebook), path)


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
