"""Pages that wait for news: each asks once, and is answered when something has changed."""

from __future__ import annotations

import asyncio
import secrets
from contextlib import suppress

LONGEST_WAIT_S = 25.0
MOST_WAITING = 2000
AT_ONCE, PAUSE_S = 10, 0.03


class ChangeSignal:
    """Answers pages when something has changed. One that has seen `state` waits until there is another."""

    def __init__(self) -> None:
        self._start = secrets.token_hex(4)  # of this run: a page that saw an earlier run is told at once
        self._count = 0
        self._waiting: set[asyncio.Future[None]] = set()

    @property
    def state(self) -> str:
        """Changes with every notice."""
        return f"{self._start}-{self._count}"

    def notify(self) -> None:
        """Answer everyone who waits: some at a time, so that a vote that comes meanwhile is not kept waiting."""
        self._count += 1
        waiting, self._waiting = list(self._waiting), set()
        for start in range(0, len(waiting), AT_ONCE):
            asyncio.get_running_loop().call_later(start / AT_ONCE * PAUSE_S, _answer, waiting[start : start + AT_ONCE])

    async def wait(self, seen: str) -> None:
        """Until the state is not `seen` any more, 25 s at the most; at once where too many wait already."""
        if seen != self.state or len(self._waiting) >= MOST_WAITING:
            return
        news: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.add(news)
        with suppress(TimeoutError):
            await asyncio.wait_for(news, LONGEST_WAIT_S)
        self._waiting.discard(news)


def _answer(waiting: list[asyncio.Future[None]]) -> None:
    for one in waiting:
        if not one.done():
            one.set_result(None)
