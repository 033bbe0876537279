"""Ways through the course, each a row of links with its minutes: what to read in an afternoon, or as an engineer.

`lessons/material/paths.toml` lists them. Minutes are reckoned from the lessons by the rule of
`camviz_school.course.minutes`, so that no row can promise what its lessons do not keep.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from camviz_school.course import minutes
from camviz_school.course.catalogue import Lesson
from camviz_school.course.material import lessons_folder, material
from camviz_school.course.notebooks import read
from camviz_school.course.tables import shaped, table_of

Cell = Any

WHOLE, BEGIN, LOOK = "", "begin", "look"
"""Of a lesson: its core; up to and with its first exercise; its first section up to the exercise."""

MANY = 9
"""Stops beyond which a row names the first and the last alone: these lessons follow one another."""

_SAID = {WHOLE: "", BEGIN: "to the first exercise", LOOK: "its first section, up to the exercise"}
_STOP = re.compile(r"(\d\d)(?: (begin|look))?")


@dataclass(frozen=True)
class Stop:
    """A lesson on a path, and how much of it: WHOLE, BEGIN or LOOK. Deeper minutes are those below a whole core."""

    lesson: Lesson
    part: str
    minutes: float
    deeper_minutes: float


@dataclass(frozen=True)
class LearningPath:
    """A way through the course. `minutes` are what its stops take together, as a header would say them."""

    title: str
    stops: tuple[Stop, ...]

    @property
    def lessons(self) -> list[Lesson]:
        return [one.lesson for one in self.stops]

    @property
    def minutes(self) -> int:
        return minutes.said(sum(one.minutes for one in self.stops))

    @property
    def deeper_minutes(self) -> int:
        """Of the deeper sections of those lessons whose core is read."""
        return minutes.said(sum(one.deeper_minutes for one in self.stops))


def paths(lessons: Iterable[Lesson]) -> list[LearningPath]:
    """The paths of the course. Raises ValueError naming what is wrong in paths.toml."""
    by_number = {one.number: one for one in lessons}
    where = "paths.toml"
    listed = table_of(material(where).read_text(encoding="utf-8"), where)["path"]
    tables = [shaped(one, {"title": str, "stops": list}, where) for one in listed]
    return [LearningPath(one["title"], tuple(_stop(stop, by_number, where) for stop in one["stops"])) for one in tables]


def _stop(written: str, lessons: dict[str, Lesson], where: str) -> Stop:
    found = _STOP.fullmatch(written)
    if not found or found[1] not in lessons:
        raise ValueError(f'{where}: a stop is a lesson, such as "05", "05 begin" or "05 look", got {written!r}')
    lesson, part = lessons[found[1]], found[2] or WHOLE
    notebook = read(lessons_folder() / lesson.file)
    if part == WHOLE:
        deeper = sum(minutes.reckoned(section.cells) for section in minutes.sections(notebook))
        return Stop(lesson, part, lesson.minutes, deeper)
    return Stop(lesson, part, minutes.reckoned(part_of(minutes.core(notebook), part)), 0)


def part_of(core: list[Cell], part: str) -> list[Cell]:
    """The cells of a core that one reads for LOOK or BEGIN.

    LOOK leaves out the questions of form A, which belong to a class, and ends above the first exercise or the second
    section. BEGIN ends below the first exercise's check.
    """
    sections = [at for at, cell in enumerate(core) if cell.source.startswith("## ")]
    stub = next(at for at, cell in enumerate(core) if "stub" in cell.metadata.get("tags", []))
    if part == BEGIN:
        return core[: stub + 2]
    end = min(stub - 1, sections[1])
    return [cell for cell in core[:end] if not re.match(r"quiz\(", cell.source)]


def table(lessons: Iterable[Lesson], folder: str = "", suffix: str = ".ipynb") -> str:
    """The table of paths. A link leads to `folder`, the notebook's name and `suffix`."""
    rows = [f"| {one.title} | {_links(one, folder, suffix)} | {_time(one)} |" for one in paths(list(lessons))]
    return "\n".join(["| You have, or are | Read | Time |", "|---|---|---|", *rows])


def _links(path: LearningPath, folder: str, suffix: str) -> str:
    links = [f"[{one.number}]({folder}{one.file.removesuffix('.ipynb')}{suffix})" for one in path.lessons]
    parts = {one.part for one in path.stops}
    said = _SAID[parts.pop()] if len(parts) == 1 else ""
    listed = f"{links[0]} to {links[-1]}" if len(links) > MANY else ", ".join(links)
    return f"{listed}: of each {said}" if said else listed


def _time(path: LearningPath) -> str:
    deeper = path.deeper_minutes
    return f"cores {_long(path.minutes)}, deeper sections {_long(deeper)}" if deeper else _long(path.minutes)


def _long(needed: int) -> str:
    return f"{needed} minutes" if needed < 100 else f"{needed / 60:.0f} hours"
