"""`camviz lab`: the lessons in JupyterLab."""

from __future__ import annotations

import argparse
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import camviz
from camviz_clinic.commands.common import LACKING, OK, Refusal, add_command
from camviz_clinic.commands.terminal import tell
from camviz_school import server
from camviz_school.course.catalogue import BEGINNING
from camviz_school.course.material import checkout_lessons, lesson_paths, lessons_folder
from camviz_school.course.working_copy import edition, lay_out

LAB = """\
Opens the lessons in JupyterLab. In a checkout of the repository these are the lessons there. Otherwise they are
laid out in DIR, and laid out again only where you have not changed them: what you wrote is never overwritten. A new
version of a lesson you did change is put beside it.
"""

PASSES_ON = ("lab",)
"""The command to which belongs what comes after --."""


def add(commands: Any) -> None:
    command = add_command(commands, "lab", lab, "open the lessons in JupyterLab", LAB)
    command.usage = "camviz lab [-h] [--no-browser] [--lesson NN] [DIR] [-- JUPYTER-OPTIONS]"
    command.add_argument("directory", metavar="DIR", nargs="?", type=Path, help="where (default: ./camviz-lessons)")
    command.add_argument("--lesson", metavar="NN", default=BEGINNING, help="open this lesson first, such as 05")
    command.add_argument("--no-browser", action="store_true", help="only serve them and print the address")


def lab(options: argparse.Namespace, beyond: list[str]) -> int:
    """Open JupyterLab on the checkout's lessons, or on a working copy."""
    if find_spec("jupyterlab") is None:
        raise Refusal("JupyterLab is not installed; `pip install 'camviz[lab]'` brings it.", LACKING)
    source = lessons_folder()
    if not source.is_dir():
        raise Refusal("the lessons are not part of this installation; `pip install camviz` brings them.", LACKING)
    folder = options.directory or checkout_lessons() or Path("camviz-lessons")
    if folder.exists() and not folder.is_dir():
        raise Refusal(f"{folder}: expected a folder for the lessons, this is a file.")
    if not (folder.exists() and folder.samefile(source)) and edition(folder) != "teacher":
        for sentence in lay_out(source, folder, camviz.__version__):
            tell(sentence)
    extra = ["--no-browser"] * options.no_browser + beyond
    if hasattr(os, "geteuid") and os.geteuid() == 0 and "--allow-root" not in extra:
        tell("You are root, as one is in a container, so JupyterLab runs as root: what you run in it may do anything.")
        extra.append("--allow-root")
    first = sorted(folder.glob(f"{options.lesson}_*.ipynb"))
    if not first and options.lesson != BEGINNING:
        there = ", ".join(path.name[:2] for path in lesson_paths(folder))
        raise Refusal(f"there is no lesson {options.lesson} in {folder}; there are {there}.")
    return _start_jupyter(folder.resolve(), extra, first[:1])


def _start_jupyter(folder: Path, extra: list[str], first: list[Path]) -> int:
    """JupyterLab in this process, so that Ctrl-C and the terminal are its own."""
    from jupyterlab.labapp import LabApp

    if lessons := checkout_lessons():  # which need not be installed for its lessons to import it
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(lessons.parent), os.environ.get("PYTHONPATH")]))
    words = [f"--ServerApp.root_dir={folder}", f"--ServerApp.jpserver_extensions={server.__name__}=True", *extra]
    LabApp.launch_instance([*words, *(str(path.resolve()) for path in first)])
    return OK
