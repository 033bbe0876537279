"""`camviz teacher`: the teacher's edition of the lessons, what a teacher prints, and slides."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import camviz
from camviz_clinic.commands.common import LACKING, OK, Refusal, add_command
from camviz_clinic.commands.terminal import say, tell
from camviz_school.course.working_copy import edition, lay_out

TEACHER = """\
Writes for each lesson, made from the very notebook that students get:

  NN_name.ipynb      the lesson with its solutions in their places, the plan by the minute at its head and after each
                     question its key, run and with pictures (about 4 s a lesson; --no-run leaves that out)
  NN_plan.html       the plan and the keys, to print, where the lesson has a plan
  NN_one_page.html   the same in short: minutes, slider values, two votes and what to say, on one A4 page
  NN_exercises.html  the exercise sheet with the exit quiz, to print
  NN_marking.html    the marking scheme: solutions, points, typical wrong answers
  NN_slides.html     with --slides: one idea a slide, in one file that works without a network

The solutions carry nbgrader's marks, so that exercises can be handed out and graded. What you have changed in the
folder is never overwritten. docs/teaching.md says how to run a lesson from it.
"""
NEEDED = ("nbformat", "nbclient", "mistune", "latex2mathml")


def add(commands: Any) -> None:
    command = add_command(commands, "teacher", teacher, "write the teacher's edition of the lessons", TEACHER)
    command.add_argument("out", metavar="OUT_DIR", type=Path, help="where to; made when it is not there")
    command.add_argument("--slides", action="store_true", help="write slides, too")
    command.add_argument("--no-run", action="store_true", help="do not run the lessons: without outputs, in seconds")
    command.add_argument(
        "--lesson", metavar="NN", action="append", default=[], help="only this lesson, such as 05; may be repeated"
    )


def teacher(options: argparse.Namespace) -> int:
    """Write the teacher's edition, and never over what a teacher has changed in it."""
    from camviz_school.course.material import lessons_folder

    if options.out.exists() and (not options.out.is_dir() or options.out.samefile(lessons_folder())):
        raise Refusal(f"{options.out}: expected a folder of its own for the teacher's edition.")
    if edition(options.out) == "student":
        raise Refusal(f"{options.out}: expected a folder of its own, the students' lessons are in this one.")
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise Refusal(f"{', '.join(missing)} must be installed for this; `pip install 'camviz[lab]'` does it.", LACKING)
    from camviz_school.teaching.pack import write_pack

    with TemporaryDirectory() as made:
        try:
            write_pack(
                lessons_folder(), Path(made), options.lesson, run=not options.no_run, slides=options.slides, say=say
            )
        except ValueError as error:
            raise Refusal(f"{error}.") from error
        for sentence in lay_out(Path(made), options.out, camviz.__version__, "teacher"):
            tell(sentence)
    return OK
