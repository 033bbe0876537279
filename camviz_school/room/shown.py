"""What each page is told of a room, as what becomes JSON. What a page must not show, it is not told.

The projector and the students learn how many have voted. They learn what was chosen, and what is right, once the
teacher reveals it. The teacher's page learns what was chosen once a vote is closed.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from camviz.draw import prose
from camviz_school.course.catalogue import catalogue
from camviz_school.course.questions import LETTERS, Question
from camviz_school.room.gain import gains
from camviz_school.room.store import ROUNDS, Room

Shown = dict[str, Any]

FEW, MANY = 0.35, 0.70
"""Crouch and Mazur (2001): discussion moves a class most where 35 to 70 % were right at first."""

DISCUSS = (
    "Turn to a neighbour who chose another answer, and tell each other your names if you do not know them. Explain why "
    "yours is right, and listen to why theirs is. You have two minutes; then everyone votes again."
)
ALONE = (
    "Before you answer again: say aloud, or write on paper, why you chose what you chose. Then say what somebody who "
    "chose another answer would tell you."
)


def to_student(room: Room, number: int) -> Shown:
    """What one student's page shows: the question, their own choices, and the replies once they may be known."""
    shown: Shown = {"ended": room.ended, "at_home": room.at_home, "until": until(room)}
    if room.at_home:
        return {**shown, "questions": [_at_home(room, one, number) for one in room.questions.values()]}
    return {**shown, "question": _in_class(room, room.current, number) if room.current else None}


def to_projector(room: Room) -> Shown:
    """What the whole room may see: how many, and not which, until it is revealed."""
    shown: Shown = {"ended": room.ended, "at_home": room.at_home, "joined": room.joined(), "question": None}
    if room.at_home or (question := room.current) is None:
        return shown
    told = _progress(room, question)
    if room.is_revealed(question.name):
        told |= {"counts": _all_counts(room, question), "answer": question.answer, "pointed": room.pointed}
        told["reply"] = prose.to_html(question.choices[room.pointed or 0].reply) if room.pointed is not None else ""
    return {**shown, "question": told}


def to_teacher(room: Room) -> Shown:
    """What the teacher's own screen shows. The split of a vote is told when it is closed."""
    states = {name: _state(room, name) for name in room.questions}
    shown: Shown = {"ended": room.ended, "at_home": room.at_home, "joined": room.joined(), "until": until(room)}
    shown |= {"states": states, "question": _for_teacher(room, room.current) if room.current else None}
    if room.at_home:
        shown["answered"] = {name: [room.voted(name, number) for number in ROUNDS] for name in room.questions}
    return shown


def contents(room: Room) -> list[Shown]:
    """The lessons with their questions, for the teacher to choose from; they never change while the server runs."""
    titles = {one.number: one.title for one in catalogue()}
    lessons: dict[str, list[Question]] = {}
    for question in room.questions.values():
        lessons.setdefault(question.name.partition(".")[0], []).append(question)
    return [
        {"lesson": number, "title": titles.get(number, ""), "questions": [_entry(one) for one in held]}
        for number, held in lessons.items()
    ]


def until(room: Room) -> str:
    """When the room ends by itself, at the latest."""
    return time.strftime("%d %B %Y, %H:%M", time.localtime(room.ends))


def advice(question: Question, counts: list[int]) -> str:
    """What to do after a first vote, by the share that was right."""
    votes = sum(counts)
    if not votes:
        return "Nobody has voted."
    share = counts[question.answer] / votes
    right = f"{100 * share:.0f} %"
    if share < FEW:
        return f"{right} are right, below 35 %. Explain what the question asks, and vote on it again."
    if share > MANY:
        return f"{right} are right, above 70 %. Reveal the answer, say a sentence on the others, and go on."
    return f"{right} are right, between 35 and 70 %: a discussion helps most now. Then vote a second time."


def _entry(one: Question) -> Shown:
    kind = f"quiz {one.form}" if one.form else "predict" if one.kind == "predict" else "quiz"
    return {"name": one.name, "kind": kind, "text": prose.to_plain(one.text)}


def _state(room: Room, name: str) -> str:
    if room.is_revealed(name):
        return "revealed"
    if number := room.open_round(name):
        return f"vote {number} is open"
    return f"voted {'twice' if 2 in rounds else 'once'}" if (rounds := room.rounds(name)) else ""


def _asked(question: Question) -> Shown:
    """The question itself, as HTML, without anything about its answer."""
    choices = [prose.inline(one.text) for one in question.choices]
    return {"name": question.name, "text": prose.to_html(question.text), "choices": choices, "letters": LETTERS}


def _progress(room: Room, question: Question) -> Shown:
    """The question, and how far the class is with it."""
    name, rounds = question.name, room.rounds(question.name)
    told = _asked(question) | {"open": room.open_round(name), "revealed": room.is_revealed(name)}
    told["rounds"] = [{"round": number, "voted": room.voted(name, number)} for number in rounds]
    told["discuss"] = DISCUSS if rounds == [1] and not told["open"] and not told["revealed"] else ""
    if question.form == "A":
        told["discuss"] = ""
    return told


def _in_class(room: Room, question: Question, number: int) -> Shown:
    made = room.chosen(number, question.name)
    told = _progress(room, question) | {"chosen": made, "joined": room.joined()}
    if told["revealed"]:
        told |= _replies(question, made.values())
        told["counts"] = _all_counts(room, question)
    return told


def _at_home(room: Room, question: Question, number: int) -> Shown:
    made, rounds = room.chosen(number, question.name), room.rounds(question.name)
    following = next((one for one in rounds if one not in made and room.is_open(question.name, one)), None)
    told = _asked(question) | {"open": following, "chosen": made, "revealed": False, "rounds": [], "counts": {}}
    told["discuss"] = ALONE if made and following else ""
    told["kept"] = bool(made) and following is None and question.form == "A"
    if made and following is None and question.form != "A":
        told |= {"revealed": True, **_replies(question, made.values())}
    return told


def _replies(question: Question, made: Iterable[int]) -> Shown:
    """The answer, and what is said to each choice that this student made."""
    replies = {index: prose.to_html(question.choices[index].reply) for index in {*made, question.answer}}
    return {"answer": question.answer, "replies": replies}


def _for_teacher(room: Room, question: Question) -> Shown:
    name, told = question.name, _progress(room, question)
    closed = [number for number in room.rounds(name) if not room.is_open(name, number)]
    told["counts"] = {number: room.counts(name, number) for number in closed}
    told["pointed"] = room.pointed
    told["form"] = question.form
    told["behind"] = [
        {"correct": one.correct, "misconception": one.misconception, "reply": prose.to_html(one.reply)}
        for one in question.choices
    ]
    told["advice"] = advice(question, told["counts"][1]) if closed == [1] and question.form != "A" else ""
    told["gains"] = gains(question, room.pairs(name)) if closed == [1, 2] else None
    told["twice"] = len(room.pairs(name)) if closed == [1, 2] else 0
    return told


def _all_counts(room: Room, question: Question) -> dict[int, list[int]]:
    return {number: room.counts(question.name, number) for number in room.rounds(question.name)}
