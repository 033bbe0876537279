"""What a reader chose in a lesson's questions and quizzes, kept beside the notebook under a random code.

`camviz_answers.csv` holds a line for each choice: which lesson, when ("before", "during" or "after"), which form and
concept (of a question outside a quiz, its id), and the letter; a "-" is where the reader started again. It does not say
what is right, since it lies open during the lesson; `AnswerBook.export` writes a file that does, for a teacher, of the
quizzes alone. Neither holds a name, an address, a date or a time.
"""

from __future__ import annotations

import csv
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import TextIO

from camviz_school.course.questions import LETTERS, Question, questions

KEPT_IN = "camviz_answers.csv"
WHEN = ("before", "during", "after")
AGAIN = "-"
"""Stands for a choice where the reader started again: what was chosen before that is not shown any more."""

_KEPT = ["participant", "lesson", "when", "form", "concept", "attempt", "choice"]
_EXPORTED = [*_KEPT, "correct", "misconception"]


@dataclass(frozen=True)
class Answer:
    """One choice at one question; `attempt` counts from 1, and `choice` is a letter or AGAIN.

    `correct` and the `misconception` behind a wrong choice are known in an exported answer only.
    """

    participant: str
    lesson: str
    when: str
    form: str
    concept: str
    attempt: int
    choice: str
    correct: bool | None = None
    misconception: str = ""

    @property
    def index(self) -> int:
        """The choice counted from 0."""
        return LETTERS.index(self.choice)


@dataclass(frozen=True)
class AnswerBook:
    """The answers kept in one folder. Every method that reads raises ValueError naming a line that is not an answer."""

    folder: Path

    @property
    def path(self) -> Path:
        """The file of what was chosen."""
        return self.folder / KEPT_IN

    def answers(self, lesson: str) -> list[Answer]:
        """What was answered in a lesson, in order; empty before the first choice."""
        if not self.path.exists():
            return []
        return [one for one in read_answers(self.path) if one.lesson == lesson]

    def participant(self, lesson: str) -> str:
        """The random code of whoever answers this lesson here; "" before the first choice."""
        return next((one.participant for one in self.answers(lesson)), "")

    def keep(self, question: Question, when: str, choice: int) -> Answer:
        """Adds a choice, counted from 0, to the file before anything else is done with it."""
        return self._add(question, when, LETTERS[choice])

    def start_again(self, questions: Sequence[Question], when: str) -> None:
        """Lets what was chosen at these questions be seen no more. The file keeps it: first choices stay the first."""
        for question in questions:
            if self.chosen(question, when):
                self._add(question, when, AGAIN)

    def _add(self, question: Question, when: str, letter: str) -> Answer:
        lesson = question.name.partition(".")[0]
        before = self.answers(lesson)
        attempts = [one for one in before if (one.when, one.concept) == (when, question.topic) and one.choice != AGAIN]
        participant = before[0].participant if before else secrets.token_hex(4)
        place = (participant, lesson, when, question.form, question.topic)
        answer = Answer(*place, len(attempts) + (letter != AGAIN), letter)
        text = self.path.read_text(encoding="utf-8") if self.path.exists() else ""
        with self.path.open("a", encoding="utf-8", newline="") as file:
            file.write("\n" if text and not text.endswith("\n") else "")
            _write(file, _KEPT, [answer], header=not text)
        return answer

    def chosen(self, question: Question, when: str) -> tuple[int, ...]:
        """The choices made at a question since the reader last started again, in order, counted from 0.

        Those that it does not have any more are left out.
        """
        lesson = question.name.partition(".")[0]
        made = [one for one in self.answers(lesson) if (one.when, one.concept) == (when, question.topic)]
        letters = "".join(one.choice for one in made if one.form == question.form).rpartition(AGAIN)[2]
        return tuple(index for index in map(LETTERS.index, letters) if index < len(question.choices))

    def export(self, lesson: str) -> Path:
        """Writes a lesson's answers, with what is right and what each wrong one means, and returns where.

        The file bears the code, so that another reader's is never overwritten. Left out is what no quiz asked, and what
        this version of the lesson does not ask. Raises ValueError without any answer.
        """
        answers = [one for one in self.answers(lesson) if one.form and one.choice != AGAIN]
        if not answers:
            raise ValueError(f"no answer to lesson {lesson} is kept in {self.path}")
        path = self.folder / f"answers_{lesson}_{answers[0].participant}.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            write_marked(file, answers)
        return path


def write_marked(file: TextIO, answers: Iterable[Answer]) -> None:
    """Writes answers with what is right and what each wrong one means; left out is what no lesson asks any more."""
    _write(file, _EXPORTED, filter(None, map(mark, answers)), header=True)


def mark(answer: Answer) -> Answer | None:
    """The answer with what is behind it; None when the lesson has no such question or choice any more."""
    for one in questions(answer.lesson).values():
        if (one.form, one.topic) == (answer.form, answer.concept) and answer.index < len(one.choices):
            choice = one.choices[answer.index]
            return replace(answer, correct=choice.correct, misconception=choice.misconception)
    return None


def read_answers(path: Path) -> list[Answer]:
    """The answers in a kept or an exported file. Raises ValueError naming the file, and the line that is no answer."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        try:
            header = next(reader, [])
            if header not in (_KEPT, _EXPORTED):
                raise ValueError(f"{path.name}: the first line must be {','.join(_KEPT)}, with or without the marks")
            return [_answer(row, len(header), f"{path.name}, line {reader.line_num}") for row in reader]
        except (csv.Error, UnicodeDecodeError) as error:
            raise ValueError(f"{path.name} is not a table of answers: {error}") from error


def _answer(row: list[str], columns: int, where: str) -> Answer:
    if len(row) != columns:
        raise ValueError(f"{where}: needs {columns} entries, has {len(row)}")
    participant, lesson, when, form, concept, attempt, choice = row[: len(_KEPT)]
    names = participant.isalnum() and lesson.isalnum()  # parts of a file's name
    if not names or when not in WHEN or not attempt.isdecimal() or len(choice) != 1 or choice not in LETTERS + AGAIN:
        raise ValueError(f"{where}: is no answer: {','.join(row)}")
    answer = Answer(participant, lesson, when, form, concept, int(attempt), choice)
    if columns == len(_KEPT):
        return answer
    correct, misconception = row[len(_KEPT) :]
    if correct not in ("0", "1"):
        raise ValueError(f"{where}: correct must be 0 or 1, got {correct!r}")
    return replace(answer, correct=correct == "1", misconception=misconception)


def _write(file: TextIO, columns: list[str], answers: Iterable[Answer], header: bool) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerows([columns] if header else [])
    rows = (astuple(one)[: len(columns)] for one in answers)
    writer.writerows([int(value) if isinstance(value, bool) else value for value in row] for row in rows)
