"""The course as a list of lessons, and the tables of lessons that README and lesson 00 show, made from it.

A lesson is a notebook `NN_name.ipynb` and its folder `material/NN`. The notebook's header says the lesson's question
and its minutes. `lesson.toml` in the folder says the rest:

    title = "Sharpness and exposure"
    takeaway = "ISO adds no light"         # what a reader will not leave without
    real_data = "the edge of a chessboard"
    picture = "docs/images/sharpness.svg"  # from the top of the repository; without one the gallery shows the title
    question = "How sharp is a camera?"    # only where the header asks none

`python -m camviz_school.commands.lessons pages` writes the tables anew.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from camviz_school.course.material import lesson_paths, material
from camviz_school.course.notebooks import Notebook, read
from camviz_school.course.tables import shaped, table_of

BEGINNING = "00"
"""The lesson that shows the others and is not one of them."""

COLUMNS = 3
"""Pictures in a row of the gallery."""

_KEYS = dict.fromkeys(("title", "question", "takeaway", "real_data", "picture"), str)
_QUESTION = re.compile(r"\*\*([^*]+\?)\*\*")
_MINUTES = re.compile(r"About (\d+) minutes")


@dataclass(frozen=True)
class Lesson:
    """What every page says of a lesson. `number` is "05", `file` the notebook's name, `minutes` are for one student."""

    number: str
    file: str
    title: str
    question: str
    takeaway: str
    real_data: str
    minutes: int
    picture: str = ""


def described(notebook: Notebook, file: str) -> Lesson:
    """What the header of the notebook `file` and its folder's `lesson.toml` say.

    Raises ValueError naming what is missing.
    """
    number, header = file[:2], notebook.cells[0].source
    told = material(number, "lesson.toml")
    if not told.is_file():
        raise ValueError(f"lesson {number} needs a file {told.name} in {told.parent}, which says its title")
    where = f"{told.name} of lesson {number}"
    table = shaped(table_of(told.read_text(encoding="utf-8"), where), _KEYS, where, {"question", "picture"})
    asked, minutes = _QUESTION.search(header), _MINUTES.search(header)
    if minutes is None:
        raise ValueError(f"the header of {file} must say how long the lesson takes, About … minutes")
    if asked is None and "question" not in table:
        raise ValueError(f"the header of {file} must ask the lesson's question, **…?**")
    question = asked[1] if asked else table["question"]
    return Lesson(**{"number": number, "file": file, "minutes": int(minutes[1]), **table, "question": question})


def catalogue() -> list[Lesson]:
    """All lessons, in the order of their numbers: 00 to 16 are the course, and electives follow."""
    return sorted((described(read(path), path.name) for path in lesson_paths()), key=lambda one: one.number)


# Tables ---------------------------------------------------------------------------------------------------------------


def gallery(lessons: Iterable[Lesson]) -> str:
    """README's table of pictures, COLUMNS in a row; the beginning stands at its end."""
    cells = [_picture(one) for one in sorted(lessons, key=lambda one: one.number == BEGINNING)]
    rows = [f"| {' | '.join(cells[start : start + COLUMNS])} |" for start in range(0, len(cells), COLUMNS)]
    return "\n".join(["| " * COLUMNS + "|", "|---" * COLUMNS + "|", *rows])


def _picture(one: Lesson) -> str:
    way = f"lessons/{one.file}"
    title = f"**[{one.number} {one.title}]({way})**"
    if one.number == BEGINNING:
        return f"Begin with {title}"
    return f"[![]({one.picture})]({way}) {title}" if one.picture else title


def overview(lessons: Iterable[Lesson]) -> str:
    """README's table of questions."""
    rows = [
        f"| {one.number} {one.title} | {one.question} | {one.takeaway} | {one.real_data} | {one.minutes} |"
        for one in lessons
    ]
    head = "| Lesson | The question | You will not leave without | Real data | Minutes |"
    return "\n".join([head, "|---|---|---|---|---|", *rows])


def lesson_map(lessons: Iterable[Lesson]) -> str:
    """The map in lesson 00."""
    rows = [
        f"| {one.number} | [{one.title}]({one.file}) | {one.question} | {one.minutes} |"
        for one in lessons
        if one.number != BEGINNING
    ]
    return "\n".join(["| No. | Lesson | The question | Minutes |", "|---|---|---|---|", *rows])


def with_table(page: str, table: str) -> str:
    """The page with `table` in the place of the one that begins with the same line.

    Raises ValueError for a page that has no such table, or more than one.

    >>> with_table("Before.\\n\\n| a |\\n|---|\\n| 1 |\\n\\nAfter.", "| a |\\n|---|\\n| 2 |")
    'Before.\\n\\n| a |\\n|---|\\n| 2 |\\n\\nAfter.'
    """
    head = table.splitlines()[0]
    found = re.compile(rf"^{re.escape(head)}$(?:\n\|.*)*", re.MULTILINE)
    if len(found.findall(page)) != 1:
        raise ValueError(f"expected one table that begins with {head}, found {len(found.findall(page))}")
    return found.sub(lambda _: table, page)
