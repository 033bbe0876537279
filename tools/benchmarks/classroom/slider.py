"""A slider under a hand: one request in flight, always the newest wish, then the fine picture, as in explorer.js."""

from __future__ import annotations

import asyncio
import time
from typing import Any

from classroom.kernel import Kernel

SETTLE_S = 0.01  # explorer.js: SETTLE_MS


class Slider:
    """One control of a widget. `answers` are the seconds from each change to the first picture that shows it."""

    def __init__(self, kernel: Kernel, comm: str, control: dict[str, Any]) -> None:
        self._kernel, self._comm, self._control = kernel, comm, control
        self._number = 0
        self._wish: dict[str, Any] | None = None
        self._flying: int | None = None
        self._settle: asyncio.TimerHandle | None = None
        self._waiting: list[float] = []  # when each change was made that no request has taken along
        self._flown: list[float] = []
        self.answers: list[float] = []
        self.errors: list[str] = []
        self.rests = asyncio.Event()
        self.rests.set()
        kernel.listeners[comm] = self._answered

    @classmethod
    def of(cls, kernel: Kernel) -> Slider | None:
        """The first slider of the kernel's first visualizer that has one."""
        for comm, state in kernel.widgets.items():
            for control in state.get("controls", ()) if state.get("frame") else ():
                if control["low"] is not None and not control["choices"]:
                    return cls(kernel, comm, control)
        return None

    async def drag(self, seconds: float, every: float = 0.1) -> None:
        """Through half of the range, in steps; back when it is done again."""
        low, high = self._control["low"], self._control["high"]
        steps = max(2, round(seconds / every))
        begin, began = self._control["first"], time.perf_counter()
        end = low if begin - low > high - begin else high
        for step in range(1, steps + 1):
            self.change(begin + (end - begin) * step / (2 * steps))
            await asyncio.sleep(max(0, began + step * every - time.perf_counter()))

    def change(self, value: float) -> None:
        self._waiting.append(time.perf_counter())
        self._ask({self._control["name"]: value}, draft=True)

    def _ask(self, values: dict[str, float], draft: bool) -> None:
        self.rests.clear()
        self._stop_settling()
        self._wish = {**(self._wish or {}), **values}
        self._draft = draft
        if self._flying is None:
            self._send()

    def _send(self) -> None:
        self._number += 1
        self._flying, self._flown, self._waiting = self._number, self._waiting, []
        content = {"id": self._number, "values": self._wish, "drags": [], "keys": [], "units": {}}
        self._wish = None
        self._kernel.tell(self._comm, {**content, "draft": self._draft})

    def _answered(self, frame: dict[str, Any]) -> None:
        if frame["answers"] != self._flying:
            return
        now = time.perf_counter()
        self.answers += [now - changed for changed in self._flown]
        self._flying, self._flown = None, []
        if frame["error"]:
            self.errors.append(frame["error"])
        self._stop_settling()
        if self._wish is not None:
            self._send()
        elif frame["draft"]:
            self._settle = asyncio.get_running_loop().call_later(SETTLE_S, lambda: self._ask({}, draft=False))
        else:
            self.rests.set()

    def _stop_settling(self) -> None:
        if self._settle:
            self._settle.cancel()
            self._settle = None
