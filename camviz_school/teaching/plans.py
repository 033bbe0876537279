"""How to teach a lesson, minute by minute: a lesson's `plan.toml`, read into frozen dataclasses that cannot be wrong.

    bring = "What lies ready before the class comes."
    network = "What to do when the network fails."
    machine = "What to do when a student's machine fails, or the teacher's."

    notice = [                      # optional: for each picture of the lesson, in order, what its slide is to say
        "Straight lines bend.",
        { text = "The curve turns back.", panels = ["radial curve"] },  # and which panels this is said of, by name
    ]

    [[step]]                        # in the order of teaching
    at = "question grid"            # where it is in the lesson
    minutes = [8, 5]                # of the plan for 90 minutes, and of that for 45; 0 leaves the step out there
    teacher = "What the teacher does and says, in one to three plain sentences."
    students = "What the class does meanwhile."

    [[votes]]                       # one for each predict question
    question = "grid"
    split = [45, 30, 15, 10]        # expected percent of the first vote, for each choice in the question's order
    source = "a guess"              # or a publication: author, title, year, page

`at` is "header", "section 3" (by the number in the heading `## 3 · …`), "section Recap" (a heading's whole text),
"question grid", "exercise distort" or "quiz". Texts are prose with `code` and *emphasis*; a sentence has at most 35
words. `test_plans.py` holds every plan against its lesson, and the lesson's own test its numbers, as it does in prose.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

from camviz_school.course import notebooks, questions
from camviz_school.course.exercises import exercises
from camviz_school.course.material import material
from camviz_school.course.tables import shaped, table_of
from camviz_school.teaching import markup, panels

LONG, SHORT = 90, 45
GUESS = "a guess"
MOST_SENTENCES, MOST_WORDS = 3, 35
"""Of a step's text, and of one of its sentences: a teacher reads it while the class looks on."""
MOST_NOTICED = 18
"""Words over a picture."""

_KEYS = {"bring": str, "network": str, "machine": str, "step": list, "votes": list, "notice": list}
_KINDS = ("header", "section", "question", "exercise", "quiz")


@dataclass(frozen=True)
class Step:
    """A stretch of teaching: `at` which place, minutes in the plans for 90 and for 45, and what is done."""

    at: str
    minutes: tuple[int, int]
    teacher: str
    students: str

    def __post_init__(self) -> None:
        kind, _, name = self.at.partition(" ")
        alone = kind in ("header", "quiz")
        if kind not in _KINDS or alone == bool(name):
            raise ValueError(f'at must be "header", "section …", "question …", "exercise …" or "quiz", got {self.at!r}')
        if len(self.minutes) != 2 or not all(type(one) is int and one >= 0 for one in self.minutes):
            raise ValueError(f"minutes must be two whole numbers from 0, such as [8, 5], got {list(self.minutes)}")
        if not any(self.minutes):
            raise ValueError("minutes are 0 in both plans: leave the step out")
        for text in (self.teacher, self.students):
            _brief(text)

    @property
    def kind(self) -> str:
        """Which kind of place: "header", "section", "question", "exercise" or "quiz"."""
        return self.at.partition(" ")[0]

    @property
    def name(self) -> str:
        """Which of its kind: "3", "Recap", "grid" or "distort"; "" for header and quiz."""
        return self.at.partition(" ")[2]


@dataclass(frozen=True)
class Notice:
    """What a picture's slide says. Where not all panels fit one slide, those named in `panels` stand under it alone."""

    text: str
    panels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.text, str) or not 0 < len(self.text.split()) <= MOST_NOTICED:
            raise ValueError(f"what to notice has at most {MOST_NOTICED} words, got {self.text!r}")
        if not all(isinstance(one, str) for one in self.panels):
            raise ValueError(f"panels must be names of panels, got {list(self.panels)}")


@dataclass(frozen=True)
class ExpectedVotes:
    """How a class is expected to vote at first: percent for each choice of a predict question, and says who."""

    question: str
    split: tuple[int, ...]
    source: str

    def __post_init__(self) -> None:
        if not all(type(one) is int and 0 <= one <= 100 for one in self.split) or sum(self.split) != 100:
            raise ValueError(f"split must be whole percents that add up to 100, got {list(self.split)}")
        if not self.source.strip():
            raise ValueError(f'source must name a publication or be "{GUESS}"')

    @property
    def guessed(self) -> bool:
        """True where nobody has counted."""
        return self.source == GUESS


@dataclass(frozen=True)
class Plan:
    """How to teach one lesson, in 90 minutes and in 45, and what to do when something fails."""

    lesson: str
    bring: str
    network: str
    machine: str
    steps: tuple[Step, ...]
    votes: tuple[ExpectedVotes, ...] = ()
    notice: tuple[Notice, ...] = ()

    def __post_init__(self) -> None:
        for name in ("bring", "network", "machine"):
            if not getattr(self, name).strip():
                raise ValueError(f"plan of lesson {self.lesson}: {name} must say something")
        for length, which in ((LONG, 0), (SHORT, 1)):
            total = sum(step.minutes[which] for step in self.steps)
            if total != length:
                raise ValueError(f"plan of lesson {self.lesson}: the plan for {length} minutes adds up to {total}")
        names = [one.question for one in self.votes]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"plan of lesson {self.lesson}: votes for question {name} are given twice")

    def expected(self, question: str) -> ExpectedVotes | None:
        """The votes expected for the question "LESSON.ID", where the plan has any."""
        return next((one for one in self.votes if f"{self.lesson}.{one.question}" == question), None)

    def times(self, length: int) -> list[tuple[int, int, Step]]:
        """The steps of the plan for 90 or for 45 minutes, each with the minute it begins and the one it ends."""
        which = (LONG, SHORT).index(length)
        begun, found = 0, []
        for step in self.steps:
            if step.minutes[which]:
                found.append((begun, begun + step.minutes[which], step))
            begun += step.minutes[which]
        return found

    def timetable(self, dash: str = "–") -> list[tuple[str, str, Step]]:
        """Each step with its minutes in the plans for 90 and for 45, such as "5–13"; "–" where it is left out."""
        long, short = ({id(step): f"{a}{dash}{b}" for a, b, step in self.times(length)} for length in (LONG, SHORT))
        return [(long.get(id(step), "–"), short.get(id(step), "–"), step) for step in self.steps]

    @property
    def cases(self) -> tuple[tuple[str, str], ...]:
        """What is said beside the steps, each with its title."""
        return ("Bring", self.bring), ("If the network fails", self.network), ("If a machine fails", self.machine)


@lru_cache
def plan(lesson: str) -> Plan | None:
    """The plan of a lesson ("05"), None where nobody has written one. Raises ValueError for one that is wrong."""
    path = material(lesson, "plan.toml")
    if not lesson.isalnum() or not path.is_file():
        return None
    return parse(lesson, path.read_text(encoding="utf-8"))


def parse(lesson: str, toml: str) -> Plan:
    """The plan in a TOML text. Raises ValueError saying in one sentence what is wrong with it."""
    where = f"plan of lesson {lesson}"
    table = shaped(table_of(toml, where), _KEYS, where, {"votes", "notice"})
    steps = tuple(_made(Step, one, f"{where}, step {i}") for i, one in enumerate(table["step"], start=1))
    votes = tuple(
        _made(ExpectedVotes, one, f"{where}, votes {i}") for i, one in enumerate(table.get("votes", []), start=1)
    )
    told = [one if isinstance(one, dict) else {"text": one} for one in table.get("notice", [])]
    notice = tuple(_noticed(one, f"{where}, notice {i}") for i, one in enumerate(told, start=1))
    return Plan(lesson, table["bring"], table["network"], table["machine"], steps, votes, notice)


def complaints(made: Plan, notebook: notebooks.Notebook) -> list[str]:
    """Where a plan and its lesson disagree, in words; empty where they agree."""
    predict = {one.name.partition(".")[2]: one for one in questions.predict_questions(made.lesson)}
    places = {
        "section": section_names(notebook),
        "question": set(predict),
        "exercise": {name.partition(".")[2] for name in exercises(made.lesson)},
    }
    found = [
        f"the plan is at {step.at!r}, and the lesson has no such {step.kind}"
        for step in made.steps
        if step.kind in places and step.name not in places[step.kind]
    ]
    for votes in made.votes:
        if votes.question not in predict:
            found.append(f"the plan expects votes for {votes.question}, and the lesson has no such predict question")
        elif len(votes.split) != len(predict[votes.question].choices):
            choices = len(predict[votes.question].choices)
            found.append(f"the plan splits votes for {votes.question} in {len(votes.split)}, it has {choices} choices")
    shown = [one for one in map(panels.panels, notebook.cells) if one]
    if made.notice and len(made.notice) != len(shown):
        found.append(f"the plan says what to notice in {len(made.notice)} pictures, and the lesson shows {len(shown)}")
    for number, (noticed, view) in enumerate(zip(made.notice, shown, strict=False), start=1):
        names = [one.name for one in view]
        found += [
            f"the plan names the panel {one!r} of picture {number}, whose panels are {', '.join(names)}"
            for one in noticed.panels
            if one not in names
        ]
    asked = {step.name for step in made.steps if step.kind == "question"}
    found += [f"the plan never asks the predict question {name}" for name in predict if name not in asked]
    known = {votes.question for votes in made.votes}
    return found + [f"the plan expects no votes for {name}" for name in predict if name not in known]


def section_names(notebook: notebooks.Notebook) -> set[str]:
    """What `at = "section …"` may name: the number of each heading `## 3 · …`, and each heading's whole text."""
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    titles = re.findall(r"^##+ (.+?)\s*$", text, re.MULTILINE)
    numbers = (re.match(r"(\d+) · ", title) for title in titles)
    return {*titles, *(number[1] for number in numbers if number)}


def _made(kind: type, table: Mapping[str, Any], where: str) -> Any:
    """A Step or ExpectedVotes from its table, its lists as tuples; whatever is wrong says where."""
    types = {"tuple[int, int]": list, "tuple[int, ...]": list, "str": str}
    shaped(table, {one.name: types[str(one.type)] for one in fields(kind)}, where)
    try:
        return kind(**{key: tuple(value) if isinstance(value, list) else value for key, value in table.items()})
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error


def _noticed(table: dict[str, Any], where: str) -> Notice:
    shaped(table, {"text": str, "panels": list}, where, {"panels"})
    try:
        return Notice(table["text"], tuple(table.get("panels", ())))
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error


def _brief(text: str) -> None:
    """Raises ValueError for a text that cannot be read at a glance."""
    sentences = markup.sentences(text)
    if not 1 <= len(sentences) <= MOST_SENTENCES:
        raise ValueError(f"a step's text has one to {MOST_SENTENCES} sentences, {text.strip()[:40]!r} {len(sentences)}")
    longest = max(sentences, key=lambda one: len(one.split()))
    if len(longest.split()) > MOST_WORDS:
        raise ValueError(f"a sentence has at most {MOST_WORDS} words, {longest[:40]!r} has {len(longest.split())}")
