"""How often one client may ask: enough for a class behind one address, too little for a flood or a guesser."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

MOST_BODY = 1024
"""Bytes of a request: a vote takes about a hundred."""

MOST_HEADERS = 16 * 1024


@dataclass
class Allowance:
    """A bucket for each client: `burst` requests at once, and `rate` more a second.

    Of more than `most` clients the one that has been quiet longest is forgotten.
    """

    burst: float
    rate: float
    most: int = 10_000
    clock: Callable[[], float] = time.monotonic
    _held: OrderedDict[Hashable, tuple[float, float]] = field(default_factory=OrderedDict)

    def takes(self, client: Hashable) -> bool:
        """Whether one more request of this client is allowed now."""
        left = self.left(client)
        self._held[client] = max(left - 1, 0.0) if left >= 1 else left, self.clock()
        self._held.move_to_end(client)
        if len(self._held) > self.most:
            self._held.popitem(last=False)
        return left >= 1

    def left(self, client: Hashable) -> float:
        """How many requests of this client are allowed now."""
        held, then = self._held.get(client, (self.burst, self.clock()))
        return min(self.burst, held + (self.clock() - then) * self.rate)


@dataclass(frozen=True)
class Limits:
    """What a room allows. A classroom is one address: 300 telephones that open the page at once ask 2,000 times.

    A page of the site asks for some sixty files; these have an allowance of their own, so that no vote waits for them.
    """

    address: Allowance = field(default_factory=lambda: Allowance(burst=4000, rate=200))
    site: Allowance = field(default_factory=lambda: Allowance(burst=40_000, rate=500))
    token: Allowance = field(default_factory=lambda: Allowance(burst=30, rate=3))
    wrong_word: Allowance = field(default_factory=lambda: Allowance(burst=30, rate=0.5))
    any_wrong_word: Allowance = field(default_factory=lambda: Allowance(burst=200, rate=5))
