"""Predict questions and quizzes: one TOML file per lesson, read into frozen dataclasses that cannot be wrong.

A `[[question]]` has an `id`, a `kind` ("predict" or "quiz"), a `text` and two or more `[[question.choice]]`, each with
a `text` and a `reply`. Exactly one choice is `correct = true`; every other one names the `misconception` behind it.
Texts are prose with `code` and *emphasis* (camviz.draw.prose).

A lesson's quiz has two parallel forms: A is asked before the lesson, B after it. Each quiz question names its `form`
and its `concept`; each concept has one question in either form, and these twins offer the same misconceptions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from camviz_school.course.material import material
from camviz_school.course.tables import shaped, table_of

LETTERS = "abcdefgh"
"""What choices are called, in their order."""

_QUESTION_KEYS = {"id": str, "kind": str, "form": str, "concept": str, "text": str, "choice": list}
_CHOICE_KEYS = {"text": str, "reply": str, "correct": bool, "misconception": str}


@dataclass(frozen=True)
class Choice:
    """One answer, and the reply to whoever chooses it."""

    text: str
    reply: str
    correct: bool = False
    misconception: str = ""


@dataclass(frozen=True)
class Question:
    """A multiple-choice question; `name` is "LESSON.ID". `form` and `concept` are "" outside a quiz with two forms."""

    name: str
    kind: str
    text: str
    choices: tuple[Choice, ...]
    form: str = ""
    concept: str = ""

    def __post_init__(self) -> None:
        for complaint in self._complaints():
            raise ValueError(f"question {self.name}: {complaint}")

    @property
    def answer(self) -> int:
        """The index of the correct choice."""
        return next(i for i, choice in enumerate(self.choices) if choice.correct)

    @property
    def topic(self) -> str:
        """By what an answer to it is kept: its concept, and without one its id."""
        return self.concept or self.name.partition(".")[2]

    @property
    def lettered(self) -> list[tuple[str, Choice]]:
        """Each choice with its letter, from "a"."""
        return list(zip(LETTERS, self.choices, strict=False))

    @property
    def misconceptions(self) -> frozenset[str]:
        """The misconceptions behind the wrong choices."""
        return frozenset(choice.misconception for choice in self.choices if not choice.correct)

    def _complaints(self) -> list[str]:
        correct = sum(choice.correct for choice in self.choices)
        replies = {choice.reply for choice in self.choices}
        texts = {choice.text for choice in self.choices}
        checks = [
            (self.kind in ("predict", "quiz"), f'kind must be "predict" or "quiz", got {self.kind!r}'),
            (self.form in ("", "A", "B"), f'form must be "A" or "B", got {self.form!r}'),
            (bool(self.form) == bool(self.concept.strip()), "form and concept must be given together"),
            (self.kind == "quiz" or not self.form, "a predict question has no form"),
            (self.text.strip() != "", "text is empty"),
            (len(self.choices) >= 2, f"needs at least two choices, has {len(self.choices)}"),
            (correct == 1, f"needs exactly one choice with correct = true, has {correct}"),
            (all(choice.text.strip() and choice.reply.strip() for choice in self.choices), "a text or reply is empty"),
            (len(texts) == len(self.choices), "two choices have the same text"),
            (len(replies) == len(self.choices), "two choices have the same reply"),
            *(
                (
                    choice.correct != bool(choice.misconception),
                    f"choice {choice.text!r} must be correct or name its misconception",
                )
                for choice in self.choices
            ),
        ]
        return [complaint for holds, complaint in checks if not holds]


@lru_cache
def questions(lesson: str) -> Mapping[str, Question]:
    """All questions of a lesson ("05"), by name and in their order. Raises ValueError when it has none."""
    path = material(lesson, "questions.toml")
    if not lesson.isalnum() or not path.is_file():
        raise ValueError(f"there are no questions for lesson {lesson!r}")
    return parse(lesson, path.read_text(encoding="utf-8"))


def question(name: str) -> Question:
    """The question called "LESSON.ID". Raises ValueError listing the lesson's questions when there is none."""
    known = questions(name.partition(".")[0])
    if name not in known:
        raise ValueError(f"no question is called {name!r}; this lesson has {', '.join(known)}")
    return known[name]


def quiz_questions(lesson: str, form: str = "B") -> tuple[Question, ...]:
    """One form of a lesson's quiz, in its order; () where it has none. A quiz without forms counts as form B."""
    return tuple(one for one in _of_kind(lesson, "quiz") if (one.form or "B") == form)


def predict_questions(lesson: str) -> tuple[Question, ...]:
    """The questions that a lesson asks before it shows, in their order; () where it has none."""
    return _of_kind(lesson, "predict")


def _of_kind(lesson: str, kind: str) -> tuple[Question, ...]:
    if not material(lesson, "questions.toml").is_file():
        return ()
    return tuple(one for one in questions(lesson).values() if one.kind == kind)


def parse(lesson: str, toml: str) -> dict[str, Question]:
    """The questions in a TOML text, by name. Raises ValueError saying which question is wrong, and how."""
    where = f"questions.toml of lesson {lesson}"
    tables = shaped(table_of(toml, where), {"question": list}, where, {"question"}).get("question", [])
    parsed = [_question(lesson, number, table) for number, table in enumerate(tables, start=1)]
    names = [one.name for one in parsed]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"question {name}: its id occurs {names.count(name)} times")
    _paired([one for one in parsed if one.kind == "quiz"])
    return dict(zip(names, parsed, strict=True))


def _question(lesson: str, number: int, table: dict[str, Any]) -> Question:
    name = f"{lesson}.{table.get('id', f'(number {number}, without an id)')}"
    told = dict(shaped(table, _QUESTION_KEYS, f"question {name}", {"form", "concept"}))
    choices = [
        Choice(**shaped(one, _CHOICE_KEYS, f"question {name}, choice {i}", {"correct", "misconception"}))
        for i, one in enumerate(told.pop("choice"), start=1)
    ]
    del told["id"]
    return Question(name, choices=tuple(choices), **told)


def _paired(quiz: list[Question]) -> None:
    """Raises ValueError naming the first question of a quiz with forms that lacks its one twin in the other form."""
    for one in quiz if any(one.form for one in quiz) else ():
        if not one.form:
            raise ValueError(f"question {one.name}: needs a form and a concept, as the others of this quiz have them")
        alike = [other for other in quiz if other.concept == one.concept]
        in_form = [other.name for other in alike if other.form == one.form]
        if len(in_form) > 1:
            raise ValueError(f"question {one.name}: {' and '.join(in_form)} have one concept, {one.concept!r}")
        twin = next((other for other in alike if other.form != one.form), None)
        if twin is None:
            missing = "B" if one.form == "A" else "A"
            raise ValueError(f"question {one.name}: no question of form {missing} has its concept, {one.concept!r}")
        if differ := sorted(one.misconceptions ^ twin.misconceptions):
            raise ValueError(f"question {one.name}: its twin {twin.name} must share its misconceptions, not {differ}")
