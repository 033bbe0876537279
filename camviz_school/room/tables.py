"""What a teacher takes home from a room: its votes as CSV files."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from camviz_school.course.answers import Answer, write_marked
from camviz_school.room.store import Room


def answers_csv(answers: Iterable[Answer]) -> str:
    """Votes as a file that `camviz_school.course.learning.class_scores` reads; `attempt` is the round."""
    text = io.StringIO()
    write_marked(text, answers)
    return text.getvalue()


def counts_csv(room: Room) -> str:
    """How many chose what, a line for each choice of each closed vote."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["question", "round", "choice", "votes", "correct", "misconception"])
    for name, question in room.questions.items():
        for number in [each for each in room.rounds(name) if not room.is_open(name, each)]:
            for (letter, choice), votes in zip(question.lettered, room.counts(name, number), strict=True):
                table.writerow([name, number, letter, votes, int(choice.correct), choice.misconception])
    return text.getvalue()
