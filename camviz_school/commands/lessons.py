"""Tools for the lessons: what a lesson must have, its saved outputs, and the pages that list the lessons.

python -m camviz_school.commands.lessons check            what departs from the pattern of a lesson
python -m camviz_school.commands.lessons refresh [05 …]   run and save with static outputs, Colab's cell among them
python -m camviz_school.commands.lessons fresh            which saved outputs are older than their lesson
python -m camviz_school.commands.lessons pages            write README's tables, lesson 00's map and both glossaries
anew
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from camviz_school.course import colab
from camviz_school.course.lesson_rules import complaints
from camviz_school.course.material import lessons_folder
from camviz_school.course.notebooks import read, write
from camviz_school.course.pages import write_pages
from camviz_school.course.saved_outputs import is_fresh, refresh
from camviz_school.teaching import plans

PROGRAM = "python -m camviz_school.commands.lessons"

# Command line -------------------------------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """`python -m camviz_school.commands.lessons`; returns the exit status."""
    parser = argparse.ArgumentParser(prog=PROGRAM, description="Tools for those who write lessons.")
    subparsers = parser.add_subparsers(required=True)
    for name, run, text in _COMMANDS:
        command = subparsers.add_parser(name, help=text)
        command.add_argument("names", nargs="*", metavar="NAME", help="how a lesson's file name begins; default: all")
        command.set_defaults(run=run)
    command = subparsers.add_parser("pages", help="write the pages that list the lessons, and the glossary")
    command.set_defaults(run=_run_pages)
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
        write(colab.prepared(read(path), path.name), path)
        refresh(path)
    return 0


def _run_fresh(given: argparse.Namespace) -> int:
    stale = [path.name for path in _paths(given.names) if not is_fresh(read(path))]
    print("\n".join(f"{name} is stale: {PROGRAM} refresh {name}" for name in stale) or "all fresh")
    return 1 if stale else 0


def _run_pages(given: argparse.Namespace) -> int:
    print("\n".join(f"wrote {path}" for path in write_pages()) or "all pages are fresh")
    return 0


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
