"""`camviz teacher`: the teacher's edition of the lessons."""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import camviz
from camviz.commands.common import OK, Refusal, add_command
from camviz.working_copy import edition, lay_out

TEACHER = """\
Writes the lessons with the solutions in their places, timings and prompts for discussion, made from the very
notebooks that students get. The solutions carry nbgrader's marks, so that exercises can be handed out and graded.
"""


def add(commands: Any) -> None:
    command = add_command(commands, "teacher", teacher, "write the teacher's edition of the lessons", TEACHER)
    command.add_argument("out", metavar="OUT_DIR", type=Path, help="where to; made when it is not there")


def teacher(options: argparse.Namespace) -> int:
    """Write the teacher's edition, and never over what a teacher has changed in it."""
    from camviz.lessons import lessons_folder, write_teacher_edition

    if options.out.exists() and (not options.out.is_dir() or options.out.samefile(lessons_folder())):
        raise Refusal(f"{options.out}: expected a folder of its own for the teacher's edition.")
    if edition(options.out) == "student":
        raise Refusal(f"{options.out}: expected a folder of its own, the students' lessons are in this one.")
    with TemporaryDirectory() as made:
        write_teacher_edition(lessons_folder(), Path(made))
        for sentence in lay_out(Path(made), options.out, camviz.__version__, "teacher"):
            print(sentence)
    return OK
