"""A student at a hub: gets a server, opens a lesson, runs it, and moves a slider."""

from __future__ import annotations

import asyncio
import json
import time
from ast import literal_eval
from pathlib import Path
from typing import Any

from tornado.httpclient import HTTPClientError

from classroom.hub import Hub
from classroom.kernel import Kernel
from classroom.slider import Slider

TOO_MANY = 429  # the hub's answer to whoever comes while enough servers are starting


class Student:
    """One account of the hub. `failures` says in sentences what went wrong."""

    def __init__(self, hub: Hub, name: str, lesson: Path) -> None:
        self.hub, self.name, self.lesson = hub, name, lesson
        self.path = f"user/{name}/"
        self.failures: list[str] = []
        self.turned_away = 0
        self.server_s = self.picture_s = self.lesson_s = float("nan")
        self.kernel: Kernel | None = None
        self.slider: Slider | None = None

    async def arrive(self) -> float:
        """Ask for a server until it is there. Returns when that was asked for first."""
        began = time.perf_counter()
        await self.hub.ask(f"hub/api/users/{self.name}", {})
        while not await self._asked_for_server():
            self.turned_away += 1
        while not (await self.hub.ask(f"hub/api/users/{self.name}"))["servers"].get("", {}).get("ready"):
            if time.perf_counter() - began > 600:
                raise TimeoutError("no server within ten minutes")
            await asyncio.sleep(0.5)
        self.server_s = time.perf_counter() - began
        return began

    async def _asked_for_server(self) -> bool:
        try:
            await self.hub.ask(f"hub/api/users/{self.name}/server", {})
        except HTTPClientError as refusal:
            if refusal.code != TOO_MANY:
                raise
            await asyncio.sleep(float(refusal.response.headers["Retry-After"]))
            return False
        return True

    async def open_lesson(self) -> list[str]:
        """The lesson as the server hands it out, and a kernel for it. Returns its code."""
        home = self.hub.folder / "homes" / self.name
        (home / self.lesson.name).write_bytes(self.lesson.read_bytes())
        code = await self.code()
        told = {"path": self.lesson.name, "name": "", "type": "notebook", "kernel": {"name": "python3"}}
        session = await self.hub.ask(f"{self.path}api/sessions", told)
        self.kernel = Kernel(self.hub, self.path, session["kernel"]["id"])
        await self.kernel.connect()
        return code

    async def code(self) -> list[str]:
        """The sources of the lesson's code cells, as the server hands the notebook out."""
        notebook = await self.hub.ask(f"{self.path}api/contents/{self.lesson.name}")
        return [cell["source"] for cell in notebook["content"]["cells"] if cell["cell_type"] == "code"]

    async def run(self, cells: list[str], began: float) -> None:
        """All of the lesson, from top to bottom; what raised is a failure."""
        assert self.kernel
        for source in cells:
            reply = await self.kernel.run(source)
            if reply["status"] != "ok":
                self.failures.append(f"{self.lesson.stem}: {reply.get('ename')}: {reply.get('evalue')}")
        self.lesson_s = time.perf_counter() - began
        if self.kernel.first_picture is None:
            self.failures.append(f"{self.lesson.stem}: no picture came")
        else:
            self.picture_s = self.kernel.first_picture - began
        self.slider = Slider.of(self.kernel)

    async def move(self, seconds: float, patience: float = 60) -> None:
        """Drag the slider, and wait for the fine picture."""
        assert self.slider
        await self.slider.drag(seconds)
        await asyncio.wait_for(self.slider.rests.wait(), patience)

    async def kernel_pid(self) -> int:
        """The kernel's process, as it says itself."""
        return int(await self.says("__import__('os').getpid()"))

    async def says(self, expression: str) -> Any:
        """The value of an expression in the kernel, which JSON can hold. Raises RuntimeError with what it raised."""
        assert self.kernel
        reply = await self.kernel.run("", told=f"__import__('json').dumps({expression})")
        told = reply["user_expressions"]["told"]
        if told["status"] != "ok":
            raise RuntimeError(f"{told['ename']}: {told['evalue']}")
        return json.loads(literal_eval(told["data"]["text/plain"]))
