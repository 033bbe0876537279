"""`camviz mend`: notebooks that students handed in, mended so that nbgrader grades all of them."""

from __future__ import annotations

import argparse
from pathlib import Path
from shutil import copyfile
from typing import Any

from camviz_clinic.commands.common import OK, Refusal, add_command, write_whole
from camviz_clinic.commands.terminal import say, tell

MEND = """\
Puts each notebook SUBMITTED/STUDENT/ASSIGNMENT/NAME.ipynb back into the order of RELEASED/ASSIGNMENT/NAME.ipynb:
marks of nbgrader's that are missing or there twice, cells that were deleted, moved, split or turned into text. What
the student wrote stays, and so do cells of their own. The notebook as it was handed in is kept beside it as
NAME.ipynb.handed-in. What was mended is told, a line each; a notebook that cannot be mended is told and left alone.

Run it between `nbgrader collect` and `nbgrader autograde`. Status 1 where a notebook could not be mended.
"""
KEPT = ".handed-in"


def add(commands: Any) -> None:
    command = add_command(commands, "mend", mend, "mend notebooks that students handed in, for nbgrader", MEND)
    command.add_argument("submitted", metavar="SUBMITTED", type=Path, help="nbgrader's folder of what was handed in")
    command.add_argument("released", metavar="RELEASED", type=Path, help="nbgrader's folder of what was handed out")


def mend(options: argparse.Namespace) -> int:
    """Mend what can be, and say what was done."""
    released = sorted(options.released.glob("*/*.ipynb"))
    if not released:
        raise Refusal(f"{options.released}: expected ASSIGNMENT/NAME.ipynb in it, as nbgrader releases them.")
    pairs = [
        (original, path)
        for original in released
        for path in sorted(options.submitted.glob(f"*/{original.parent.name}/{original.name}"))
    ]
    if not pairs:
        raise Refusal(f"{options.submitted}: expected STUDENT/ASSIGNMENT/NAME.ipynb in it, as nbgrader collects them.")
    lost = [path for original, path in pairs if not _mended(original, path)]
    tell(f"{len(pairs) - len(lost)} of {len(pairs)} notebooks can be graded.")
    return 1 if lost else OK


def _mended(original: Path, path: Path) -> bool:
    """Mend one file, and whether it can be graded."""
    from camviz_school.course import notebooks
    from camviz_school.teaching import mending

    try:
        done = mending.mended(notebooks.read(original), notebooks.read(path))
    except mending.AnotherNotebookError as error:
        say(f"{path}: it is not {original.name}: {error}.")
        return False
    except ValueError as error:
        say(f"{error}")
        return False
    if done.sentences:
        kept = path.with_name(path.name + KEPT)
        if not kept.exists():
            write_whole(kept, lambda part: copyfile(path, part))
        write_whole(path, lambda part: notebooks.write(done.notebook, part))
        tell("\n".join(f"{path}: {sentence}" for sentence in done.sentences))
    return True
