"""A round with real nbgrader: the teacher's edition is handed out, comes back in five states, and is graded.

    python tools/benchmarks/nbgrader_round.py [--keep FOLDER] [LESSON ...]      (default: 05 01)

Run it with a Python that has camviz and nbgrader 0.9. For each lesson it writes the teacher's edition, runs `nbgrader
generate_assignment` with the lines of docs/teaching.md, hands in five notebooks, runs `nbgrader autograde`, and prints
each one's points as Markdown:

right      every solution in its place
wrong      of each exercise a typical wrong answer
untouched  as handed out
endless    every function loops for ever
stuck      a cell of the student's own loops for ever, above right solutions: all points, when its time is up

Fails where a student gets other points than that state deserves, or where keys or solutions were handed out.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
import shutil
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from camviz_school.course.exercises import exercises  # noqa: E402
from camviz_school.course.material import lessons_folder  # noqa: E402
from camviz_school.course.notebooks import exercise_of, read, solutions, tagged  # noqa: E402

Hand = Callable[[str], str]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": str(ROOT),
    "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),  # nbgrader calls alembic
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lessons", nargs="*", metavar="LESSON")
    parser.add_argument("--keep", type=Path, help="an empty folder for the course, to look at afterwards")
    options = parser.parse_args()
    print("| lesson | student | points | of | seconds | what nbgrader said |\n|---|---|---|---|---|---|")
    with TemporaryDirectory(prefix="camviz-nbgrader-") as made:
        course = options.keep or Path(made)
        (course / "nbgrader_config.py").write_text(config())
        wrong = [said for lesson in options.lessons or ["05", "01"] for said in graded(course, lesson)]
    print("\n".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


def config() -> str:
    """The lines of docs/teaching.md, as they stand there."""
    page = (ROOT / "docs" / "teaching.md").read_text(encoding="utf-8")
    (lines,) = re.findall(r"```python\n(c = get_config\(\)\n.*?)```", page, re.DOTALL)
    return lines


def graded(course: Path, lesson: str) -> list[str]:
    """Hand one lesson out, in and back; what did not come out as it should."""
    (path,) = lessons_folder().glob(f"{lesson}_*.ipynb")
    name, source = f"lesson{lesson}", course / "source" / f"lesson{lesson}"
    words = ["-m", "camviz", "teacher", str(course / "teacher"), "--no-run", "--lesson", lesson]
    subprocess.run([sys.executable, *words], check=True, env=ENVIRONMENT, stdout=subprocess.DEVNULL)
    source.mkdir(parents=True)
    shutil.copy(course / "teacher" / path.name, source)
    nbgrader(course, "generate_assignment", name)
    released = course / "release" / name / path.name
    found = leaks(released)
    for student, hand in hands(lesson, path).items():
        handed_in(released, course / "submitted" / student / name / path.name, hand, student)
    for student in hands(lesson, path):
        began = time.monotonic()
        said = nbgrader(course, "autograde", name, "--student", student)
        seconds = time.monotonic() - began
        points, most = score(course, name, student)
        last = re.findall(r"(?:ERROR|WARNING)\] (.+)", said)
        row = (lesson, student, f"{points:g}", f"{most:g}", f"{seconds:.0f}", last[-1][:90] if last else "")
        print(f"| {' | '.join(row)} |", flush=True)
        if points != (most if student in ("right", "stuck") else 0):
            found.append(f"lesson {lesson}: {student} has {points:g} of {most:g} points")
    return found


def hands(lesson: str, path: Path) -> dict[str, Hand]:
    """What each student writes in place of a stub, by the exercise's name; "" leaves it as it was handed out."""
    right = solutions(read(path))
    return {
        "right": right.__getitem__,
        "wrong": lambda name: mistaken(lesson, name),
        "untouched": lambda name: "",
        "endless": lambda name: endless(right[name]),
        "stuck": right.__getitem__,
    }


def mistaken(lesson: str, name: str) -> str:
    """A typical wrong answer to an exercise, under the name that the check asks for."""
    exercise = exercises(lesson)[name]
    function = exercise.misconceptions[0].function
    source = textwrap.dedent(inspect.getsource(function))
    source = source[source.index("def ") :]
    wanted = re.search(r"def (\w+)", solutions(read(next(lessons_folder().glob(f"{lesson}_*.ipynb"))))[name])
    assert wanted is not None
    return f"import numpy as np\n{source}\n{wanted[1]} = {function.__name__}\n"


def endless(solution: str) -> str:
    """The solution's first line over a loop that does not end."""
    head = next(line for line in solution.splitlines() if line.startswith("def "))
    return f"{head}\n    while True:\n        pass\n"


def handed_in(released: Path, target: Path, hand: Hand, student: str) -> None:
    """Write a student's notebook."""
    notebook = read(released)
    for cell in tagged(notebook, "stub"):
        cell.source = hand(exercise_of(cell)) or cell.source
    if student == "stuck":
        own = nbformat.v4.new_code_cell("while True:\n    pass")
        notebook.cells.insert(notebook.cells.index(tagged(notebook, "stub")[0]), own)
    target.parent.mkdir(parents=True)
    nbformat.write(notebook, target)


def leaks(released: Path) -> list[str]:
    """What a student's notebook must not have."""
    text = released.read_text(encoding="utf-8")
    told = ("**Key.**", "BEGIN SOLUTION", "BEGIN HIDDEN", "For the teacher", "teacher's edition", "<summary>Solution")
    return [f"{released.name} was handed out with {one!r}" for one in told if one in text]


def nbgrader(course: Path, *words: str) -> str:
    """What a command of nbgrader says."""
    command = [sys.executable, "-m", "nbgrader", *words]
    done = subprocess.run(command, cwd=course, env=ENVIRONMENT, capture_output=True, text=True, timeout=900)
    if done.returncode and words[0] != "autograde":
        raise RuntimeError(f"nbgrader {' '.join(words)}:\n{done.stderr[-3000:]}")
    return done.stderr


def score(course: Path, assignment: str, student: str) -> tuple[float, float]:
    """A student's points, and how many there are; none where it could not be graded."""
    from nbgrader.api import Gradebook, MissingEntry

    with Gradebook(f"sqlite:///{course / 'gradebook.db'}") as book:
        try:
            graded = book.find_submission(assignment, student)
        except MissingEntry:
            return float("nan"), book.find_assignment(assignment).max_score
        return graded.score, graded.max_score


if __name__ == "__main__":
    sys.exit(main())
