"""A question's way into the class's room: the choice goes there in the background, and the reply waits for the teacher.

Who has not joined a room (`camviz_school.join`) notices nothing of it. Where the room is not reached, or does not ask
this question now, the reply comes at once, with one line that says so.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from threading import Thread
from typing import Any

from camviz_school.room.membership import OVER, Membership, NotReachedError, RefusedError, forget, membership

PATIENCE_S = 40.0  # longer than the room lets a page wait
PAUSE_S = 2.0
MOST_FAILURES = 3


@dataclass(frozen=True)
class VoteStatus:
    """How it went, in one line: whether the reply has to wait, and whether to choose again."""

    said: str
    waiting: bool
    again: bool = False


class Ballot:
    """One question's votes. `changed` is called, in the kernel's own thread, whenever there is news."""

    def __init__(self, question: str, changed: Callable[[], None]) -> None:
        self.question = question
        self.news = VoteStatus("", waiting=False)
        self._changed = changed
        self._casts = 0

    def cast(self, choice: int) -> None:
        """Send a choice, counted from 0, to the room that this user is in, if any; it returns at once."""
        room = membership()
        self._casts += 1
        if room is None:
            self.news = VoteStatus("", waiting=False)
            return
        self.news = VoteStatus(f"Sending your vote to the room {room.word} …", waiting=True)
        Thread(target=self._send, args=(asyncio.get_running_loop(), self._casts, room, choice), daemon=True).start()

    def _send(self, loop: asyncio.AbstractEventLoop, cast: int, room: Membership, choice: int) -> None:
        """In a thread of its own: vote, and wait for what becomes of it, until another vote is cast here."""
        for news in told(room, self.question, choice):
            if cast != self._casts or loop.is_closed():
                return
            loop.call_soon_threadsafe(self._hear, cast, news)

    def _hear(self, cast: int, news: VoteStatus) -> None:
        if cast == self._casts and news != self.news:
            self.news = news
            self._changed()


def told(room: Membership, question: str, choice: int) -> Iterator[VoteStatus]:
    """Vote in a room, and hear what becomes of it: the last news is that the reply may be shown, or to choose again."""
    name = f"the room {room.word}"
    try:
        asked = _asked(room.state(), question)
        if not asked or not asked["open"]:
            yield VoteStatus(
                f"There is no vote on this question in {name} now; your answer is kept here.", waiting=False
            )
            return
        voted = asked["open"]
        room.vote(question, voted, choice)
        which = "first" if voted == 1 else "second"
        yield VoteStatus(
            f"Your {which} vote is counted in {name}. The reply comes when the teacher shows it.", waiting=True
        )
        yield from _what_follows(room, question, voted)
    except RefusedError as refused:
        if refused.status in OVER:
            forget()
        yield VoteStatus(f"Not counted in {name}: {refused} Your answer is kept here.", waiting=False)
    except NotReachedError:
        yield VoteStatus(
            f"Not counted: {name} is not reached. Your answer is kept here; the lesson goes on.", waiting=False
        )


def _what_follows(room: Membership, question: str, voted: int) -> Iterator[VoteStatus]:
    seen, failures = "", 0
    while True:
        try:
            state = room.state(seen, PATIENCE_S)
        except RefusedError as refused:
            if refused.status in OVER:
                forget()
                yield VoteStatus(f"The room {room.word} has ended.", waiting=False)
                return
            time.sleep(PAUSE_S)  # too fast: its own sentence says so, and nobody needs to read it
            continue
        except NotReachedError:
            failures += 1
            if failures == MOST_FAILURES:
                yield VoteStatus(f"The room {room.word} is not reached any more. Your vote was counted.", waiting=False)
                return
            time.sleep(PAUSE_S)
            continue
        seen, failures = state["state"], 0
        asked = _asked(state, question)
        if asked and asked["open"] == 2 and voted == 1:
            yield VoteStatus(
                f"The second vote is open in the room {room.word}: choose again.", waiting=False, again=True
            )
            return
        if not asked or asked["revealed"] or asked.get("kept"):
            yield VoteStatus(f"Voted in the room {room.word}.", waiting=False)
            return


def _asked(state: dict[str, Any], question: str) -> dict[str, Any] | None:
    """What the room's state says of one question; None while the class is at another one."""
    there = state.get("questions") or [state.get("question")]
    return next((one for one in there if one and one["name"] == question), None)
