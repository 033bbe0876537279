"""A room in one SQLite file: who has joined, what was asked, what was chosen, and the rules by which a vote counts.

A vote is acknowledged only after it is written to the write-ahead log. So a server that is killed loses no acknowledged
vote, and the next start goes on from there. When a vote is closed, the log is forced to the disk: a laptop that loses
its power loses at most votes of a round that is still open (synchronous = NORMAL, https://www.sqlite.org/wal.html).

Of a student the file has the number they joined as and a hash of their token. The hashes go when the room ends. No
name, no address and no time of a vote is ever written.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from camviz_school.course.answers import Answer
from camviz_school.course.questions import LETTERS, Question
from camviz_school.room.words import new_secret, new_word, tidied

DAY_S = 86400
MOST_STUDENTS = 1000
ROUNDS = (1, 2)

_TABLES = """
CREATE TABLE room (
  word TEXT, teacher TEXT, projector TEXT, salt BLOB, ends REAL,
  ended INTEGER DEFAULT 0, at_home INTEGER DEFAULT 0, current TEXT DEFAULT '', pointed INTEGER
);
CREATE TABLE student (number INTEGER PRIMARY KEY, token BLOB UNIQUE);
CREATE TABLE vote_round (question TEXT, round INTEGER, open INTEGER, PRIMARY KEY (question, round));
CREATE TABLE revealed (question TEXT PRIMARY KEY);
CREATE TABLE vote (
  question TEXT, round INTEGER, student INTEGER, choice INTEGER NOT NULL, PRIMARY KEY (question, round, student)
);
"""


class RoomError(Exception):
    """What a room refuses, in one sentence, with the status of HTTP that says it."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class Room:
    """One room. What changes it raises RoomError, and changes nothing, where it may not be changed so.

    The file is this process's alone until it is closed: a second server finds it in use.
    """

    def __init__(self, path: Path, questions: Sequence[Question], days: float = 1, word: str = "") -> None:
        self.path = path
        self.questions = {one.name: one for one in questions}
        new = not path.exists()
        if new:
            os.close(os.open(path, os.O_CREAT | os.O_RDWR, 0o600))
        self._database = sqlite3.connect(path, isolation_level=None, timeout=0.5)
        try:
            self._database.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._database.execute("PRAGMA journal_mode = WAL")
            self._database.execute("PRAGMA synchronous = NORMAL")
            self._begin(days, word or new_word())
        except sqlite3.OperationalError as error:
            raise RoomError(423, f"{path}: another server has this room, or it cannot be written ({error})") from error
        except sqlite3.DatabaseError as error:
            raise RoomError(415, f"{path}: is not the file of a room ({error})") from error

    @classmethod
    def new(cls, folder: Path, questions: Sequence[Question], days: float = 1) -> Room:
        """A new room, in a file of `folder` that is named after its word."""
        word = new_word()
        return cls(folder / f"room_{word}.sqlite", questions, days, word)

    @classmethod
    def of(cls, folder: Path, questions: Sequence[Question], days: float = 1) -> Room:
        """The room of a folder that has not ended, else a new one."""
        for path in sorted(folder.glob("room_*.sqlite")):
            room = cls(path, questions)
            if not room.ended and not room.end_in_time():
                return room
            room.close()
        return cls.new(folder, questions, days)

    def close(self) -> None:
        """Let go of the file."""
        self._database.close()

    def _begin(self, days: float, word: str) -> None:
        with self._changing():
            if self._database.execute("SELECT 1 FROM sqlite_master WHERE name = 'room'").fetchone():
                return
            for statement in filter(str.strip, _TABLES.split(";")):
                self._database.execute(statement)
            keys = (word, new_secret(), new_secret(), secrets.token_bytes(16), time.time() + days * DAY_S)
            self._database.execute(
                "INSERT INTO room (word, teacher, projector, salt, ends) VALUES (?, ?, ?, ?, ?)", keys
            )

    # What the room is ------------------------------------------------------------------------------------------------

    @property
    def word(self) -> str:
        """What lets a student in."""
        return str(self._told("word"))

    @property
    def teacher_key(self) -> str:
        """What lets the teacher's page do anything."""
        return str(self._told("teacher"))

    @property
    def projector_key(self) -> str:
        """What lets the projected page see the word and, once revealed, the split."""
        return str(self._told("projector"))

    @property
    def ends(self) -> float:
        """When the room ends by itself, in seconds since 1970."""
        return float(self._told("ends"))

    @property
    def ended(self) -> bool:
        """True once nobody can join or vote any more."""
        return bool(self._told("ended"))

    @property
    def at_home(self) -> bool:
        """True while every question can be answered, at anyone's own pace."""
        return bool(self._told("at_home"))

    @property
    def current(self) -> Question | None:
        """The question that the class is at."""
        return self.questions.get(str(self._told("current")))

    @property
    def pointed(self) -> int | None:
        """The choice whose reply the projector shows, after the reveal."""
        pointed = self._told("pointed")
        return None if pointed is None else int(pointed)

    def joined(self) -> int:
        """How many have joined."""
        return int(self._one("SELECT count(*) FROM student"))

    def is_open(self, question: str, vote_round: int) -> bool:
        """Whether votes of this round are taken now."""
        return bool(self._one("SELECT open FROM vote_round WHERE question = ? AND round = ?", question, vote_round))

    def rounds(self, question: str) -> list[int]:
        """The rounds there have been, with the one that is open."""
        rows = self._rows("SELECT round FROM vote_round WHERE question = ? ORDER BY round", question)
        return [number for (number,) in rows]

    def open_round(self, question: str) -> int | None:
        """The round that is open."""
        rows = self._rows("SELECT round FROM vote_round WHERE question = ? AND open ORDER BY round", question)
        return rows[0][0] if rows else None

    def is_revealed(self, question: str) -> bool:
        """Whether the class has been told what is right."""
        return bool(self._rows("SELECT 1 FROM revealed WHERE question = ?", question))

    def voted(self, question: str, vote_round: int) -> int:
        """How many have voted."""
        return int(self._one("SELECT count(*) FROM vote WHERE question = ? AND round = ?", question, vote_round))

    def counts(self, question: str, vote_round: int) -> list[int]:
        """How many chose each choice."""
        asked = "SELECT choice, count(*) FROM vote WHERE question = ? AND round = ? GROUP BY choice"
        found = dict(self._rows(asked, question, vote_round))
        return [found.get(index, 0) for index in range(len(self.questions[question].choices))]

    def pairs(self, question: str) -> list[tuple[int, int]]:
        """(first choice, second choice) of everyone who voted in both rounds."""
        return self._rows(
            "SELECT a.choice, b.choice FROM vote a JOIN vote b USING (question, student) "
            "WHERE question = ? AND a.round = 1 AND b.round = 2 ORDER BY a.student",
            question,
        )

    def chosen(self, student: int, question: str) -> dict[int, int]:
        """The choice of a student in each round that they voted in."""
        return dict(self._rows("SELECT round, choice FROM vote WHERE student = ? AND question = ?", student, question))

    def student(self, token: str) -> int | None:
        """The number of whoever has the token."""
        rows = self._rows("SELECT number FROM student WHERE token = ?", _hashed(token))
        return rows[0][0] if rows else None

    def answers(self) -> Iterator[Answer]:
        """Every vote as an answer for `camviz_school.course.learning`; `attempt` is the round.

        A participant's code is drawn for each lesson, so that it leads from one vote to another of that lesson only.
        """
        salt = bytes(self._told("salt"))
        for name, vote_round, student, choice in self._rows("SELECT * FROM vote ORDER BY question, round, student"):
            if (question := self.questions.get(name)) is None:
                continue
            lesson = name.partition(".")[0]
            code = hashlib.sha256(salt + f"{lesson} {student}".encode()).hexdigest()[:8]
            when = {"": "during", "A": "before", "B": "after"}[question.form]
            yield Answer(code, lesson, when, question.form, question.topic, vote_round, LETTERS[choice])

    # What students do ------------------------------------------------------------------------------------------------

    def join(self, word: str) -> str:
        """A new token for whoever knows the word."""
        self._refuse_ended()
        if not secrets.compare_digest(_bytes(tidied(word)), _bytes(self.word)):
            raise RoomError(403, "This is not the word of the room. Look at the projector again.")
        if self.joined() >= MOST_STUDENTS:
            raise RoomError(403, f"The room is full: {MOST_STUDENTS} have joined.")
        token = new_secret()
        self._change("INSERT INTO student (token) VALUES (?)", _hashed(token))
        return token

    def leave(self, token: str) -> None:
        """Forget a token. What was voted with it still counts."""
        self._change("UPDATE student SET token = NULL WHERE token = ?", _hashed(token))

    def vote(self, student: int, name: Any, vote_round: Any, choice: Any) -> None:
        """Count a student's choice in a round that is open, in place of the one they made in it before.

        At home a choice stands, and the second comes after the first. Anything but the number of a choice is refused.
        """
        self._refuse_ended()
        question = self.questions.get(name) if isinstance(name, str) else None
        if question is None:
            raise RoomError(400, "A vote needs a question of this room.")
        if type(choice) is not int or choice not in range(len(question.choices)):
            raise RoomError(400, f"A vote needs a choice from 0 to {len(question.choices) - 1}.")
        if type(vote_round) is not int or vote_round not in ROUNDS:
            raise RoomError(400, "A vote needs its round, 1 or 2.")
        with self._changing():
            if not self.is_open(question.name, vote_round):
                raise RoomError(409, "This vote is closed. Your choice was not counted.")
            if self.at_home:
                self._refuse_out_of_turn(self.chosen(student, question.name), vote_round)
            values = (question.name, vote_round, student, choice)
            self._database.execute("INSERT OR REPLACE INTO vote VALUES (?, ?, ?, ?)", values)

    def _refuse_out_of_turn(self, made: dict[int, int], vote_round: int) -> None:
        if vote_round in made:
            raise RoomError(409, "You have answered this already; at home each answer stands.")
        if vote_round == 2 and 1 not in made:
            raise RoomError(409, "The second answer comes after the first.")

    # What the teacher does -------------------------------------------------------------------------------------------

    def choose(self, name: str) -> None:
        """Go to a question, once no vote on another is open; after the end, too, to see how it went."""
        self._asked_in_class(name, also_ended=True)
        self._change("UPDATE room SET current = ?, pointed = NULL", name)

    def open(self, name: str, vote_round: int) -> None:
        """Take votes: a first time, a second time, or again in a round that was closed too early."""
        question = self._asked_in_class(name)
        before = self.rounds(name)
        if self.is_revealed(name):
            raise RoomError(409, "The answer has been shown: there is nothing left to vote on.")
        if vote_round not in ROUNDS or (vote_round == 2 and not before) or (vote_round == 1 and 2 in before):
            raise RoomError(409, "The second vote comes after the first.")
        if vote_round == 2 and question.form == "A":
            raise RoomError(409, "A question of form A is asked once, before the lesson.")
        if vote_round == 2 and self.is_open(name, 1):
            raise RoomError(409, "Close the first vote before the second.")
        with self._changing():
            self._database.execute("UPDATE room SET current = ?, pointed = NULL", (name,))
            self._database.execute("INSERT OR REPLACE INTO vote_round VALUES (?, ?, 1)", (name, vote_round))

    def shut(self, name: str) -> None:
        """Close a vote: from now on the server takes none."""
        self._asked_in_class(name)
        self._change("UPDATE vote_round SET open = 0 WHERE question = ?", name)
        self._to_disk()

    def reveal(self, name: str) -> None:
        """Tell everyone the split, what is right, and why."""
        question = self._asked_in_class(name)
        if not self.rounds(name) or self.open_round(name):
            raise RoomError(409, "Close a vote on this question first.")
        if question.form == "A":
            raise RoomError(409, "Form A tells nothing: its answers come with the quiz after the lesson.")
        with self._changing():
            self._database.execute("INSERT OR IGNORE INTO revealed VALUES (?)", (name,))
            self._database.execute("UPDATE room SET current = ?, pointed = ?", (name, question.answer))

    def point(self, name: str, choice: int) -> None:
        """Have the projector show the reply to a choice."""
        question = self._asked_in_class(name)
        if not self.is_revealed(name) or choice not in range(len(question.choices)):
            raise RoomError(409, "Only a reply of a question that has been revealed can be shown.")
        self._change("UPDATE room SET current = ?, pointed = ?", name, choice)

    def let_home(self, on: bool) -> None:
        """Open every question that was not asked in class, for answers at anyone's own pace; or close them all."""
        self._refuse_ended()
        if on and self._rows("SELECT 1 FROM vote_round WHERE open"):
            raise RoomError(409, "Close the vote that is open first.")
        with self._changing():
            if on:
                fresh = [one for one in self.questions.values() if not self.rounds(one.name)]
                rows = [(one.name, number, 1) for one in fresh for number in ROUNDS[: 1 if one.form == "A" else 2]]
                self._database.executemany("INSERT INTO vote_round VALUES (?, ?, ?)", rows)
            else:
                self._database.execute("UPDATE vote_round SET open = 0")
            self._database.execute("UPDATE room SET at_home = ?, current = '', pointed = NULL", (on,))

    def end(self) -> None:
        """End the room: what joined a browser to its votes is deleted, and nobody joins or votes any more."""
        with self._changing():
            self._database.execute("UPDATE student SET token = NULL")
            self._database.execute("UPDATE vote_round SET open = 0")
            self._database.execute("UPDATE room SET ended = 1, at_home = 0")
        self._to_disk()

    def end_in_time(self) -> bool:
        """End a room whose time is over; True when it just did."""
        over = not self.ended and time.time() > self.ends
        if over:
            self.end()
        return over

    # -----------------------------------------------------------------------------------------------------------------

    def _asked_in_class(self, name: Any, also_ended: bool = False) -> Question:
        if not also_ended:
            self._refuse_ended()
        question = self.questions.get(name) if isinstance(name, str) else None
        if question is None:
            raise RoomError(400, "There is no such question in this room.")
        if self.at_home:
            raise RoomError(409, "The questions are open at home. Close them first.")
        if self._rows("SELECT 1 FROM vote_round WHERE open AND question != ?", question.name):
            raise RoomError(409, "A vote on another question is open. Close it first.")
        return question

    def _refuse_ended(self) -> None:
        if self.ended:
            raise RoomError(410, "This room has ended.")

    def _told(self, column: str) -> Any:
        return self._one(f"SELECT {column} FROM room")

    def _one(self, statement: str, *values: Any) -> Any:
        rows = self._rows(statement, *values)
        return rows[0][0] if rows else 0

    def _rows(self, statement: str, *values: Any) -> list[Any]:
        return self._database.execute(statement, values).fetchall()

    def _change(self, statement: str, *values: Any) -> None:
        with self._changing():
            self._database.execute(statement, values)

    def _to_disk(self) -> None:
        self._database.execute("PRAGMA wal_checkpoint(FULL)")

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """One transaction: all of it is in the log afterwards, or none."""
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._database.execute("ROLLBACK")
            raise
        self._database.execute("COMMIT")


def _hashed(token: str) -> bytes:
    return hashlib.sha256(_bytes(token)).digest()


def _bytes(text: str) -> bytes:
    """The text's bytes, whatever a browser made it of."""
    return text.encode(errors="surrogatepass")
