"""What goes wrong in a class, done on purpose: what that student sees, what is lost, and how the others are."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress

from tornado.httpclient import HTTPClientError

from classroom.hub import Hub
from classroom.kernel import Kernel
from classroom.slider import Slider
from classroom.student import Student

Told = tuple[str, str, str]
DOWN_S = 30
WRITTEN = "what I wrote"
GREEDY = "_taken = []\nwhile True:\n    _taken.append(bytearray(b'x') * (50 << 20))"


async def kernel_killed(hub: Hub, students: Sequence[Student]) -> Told:
    """As by the system where memory ends: no warning, and nothing is said to the kernel."""
    victim, *others = students
    await write(victim)
    before = await pids(others)
    began = time.perf_counter()
    os.kill(await victim.kernel_pid(), signal.SIGKILL)
    kernel = victim.kernel
    await until(lambda: bool(kernel.states), 60)
    when, state = kernel.states[0]
    kernel.widgets.clear()
    cells = await victim.code()
    await victim.run(cells, time.perf_counter())
    await victim.move(0.5)
    sees = f"the picture stands still, and says after {when - began:.1f} s that the kernel was restarted ({state!r})"
    return f"{sees}; *Run All* brings it back", f"variables; {await kept(victim)}", await untouched(others, before)


async def memory_taken(hub: Hub, students: Sequence[Student]) -> Told:
    """A cell takes memory until it gets no more."""
    victim, *others = students
    await write(victim)
    before, own = await pids(others), await victim.kernel_pid()
    reply = await victim.kernel.run(GREEDY)
    if reply.get("ename") != "MemoryError":
        raise RuntimeError(f"expected MemoryError, got {reply}")
    taken = await victim.says("len(_taken) * 50")
    await victim.kernel.run("del _taken")
    await victim.move(0.5)
    if await victim.kernel_pid() != own:
        raise RuntimeError("the kernel was restarted")
    sees = f"`MemoryError` under the cell, once it has {taken} MB; the kernel lives, and the slider answers"
    return sees, f"nothing; {await kept(victim)}", await untouched(others, before)


async def hub_restarted(hub: Hub, students: Sequence[Student]) -> Told:
    """The hub ends and is started again after some seconds; the proxy stays."""
    for student in students[:3]:
        await write(student)
    before = await pids(students)
    hub.stop("hub")
    began = time.perf_counter()
    await asyncio.gather(*(student.move(2) for student in students[:3]))
    while_down = [answer for student in students[:3] for answer in student.slider.answers[-20:]]
    await asyncio.sleep(5)
    hub.start_hub()
    await hub.ready()
    took = time.perf_counter() - began
    known = await asyncio.gather(*(hub.ask(f"hub/api/users/{student.name}") for student in students))
    if not all(user["servers"].get("", {}).get("ready") for user in known):
        raise RuntimeError("the hub has forgotten servers")
    sees = f"nothing: sliders answer while it is gone ({1000 * max(while_down):.0f} ms at worst)"
    sees += f"; who would log in waits ({took:.0f} s)"
    return sees, f"nothing; {await kept(students[0])}", await untouched(students, before)


async def proxy_gone(hub: Hub, students: Sequence[Student]) -> Told:
    """The room's network ends for half a minute: no page reaches its server, and every connection is lost."""
    victim, *others = students
    await write(victim)
    before, own = await pids(others), await victim.kernel_pid()
    await victim.kernel.run("remembered = 4817")
    hub.stop("proxy")
    await until(lambda: not any(student.kernel.connected for student in students), 30)
    await asyncio.sleep(DOWN_S)
    hub.start_proxy()
    began = time.perf_counter()
    await asyncio.gather(*(reconnect(student) for student in students))
    took = time.perf_counter() - began
    if (await victim.says("remembered"), await victim.kernel_pid()) != (4817, own):
        raise RuntimeError("the kernel is another one")
    await victim.move(0.5)
    sees = f"no picture moves; {took:.0f} s after the proxy is back it does, on the same kernel with its variables"
    return sees, f"nothing; {await kept(victim)}", await untouched(others, before)


FAULTS: dict[str, Callable[[Hub, Sequence[Student]], Awaitable[Told]]] = {
    "a kernel is killed (-9)": kernel_killed,
    "a cell takes all memory": memory_taken,
    "the hub is restarted": hub_restarted,
    f"the proxy is gone for {DOWN_S} s": proxy_gone,
}


async def reconnect(student: Student) -> None:
    """Until it works, as a page does; the slider under the hand begins anew with it."""
    old = student.kernel
    assert isinstance(old, Kernel)
    for _ in range(120):
        with suppress(OSError, HTTPClientError):
            await old.connect()
            student.slider = Slider.of(old)
            return
        await asyncio.sleep(0.5)
    raise RuntimeError(f"{student.name} was not connected again within a minute")


async def until(true: Callable[[], bool], seconds: float) -> None:
    """Wait until it is so. Raises TimeoutError."""
    for _ in range(int(seconds / 0.05)):
        if true():
            return
        await asyncio.sleep(0.05)
    raise TimeoutError(f"it did not happen within {seconds:g} s")


async def pids(students: Sequence[Student]) -> list[int]:
    """The processes of their kernels."""
    return list(await asyncio.gather(*(student.kernel_pid() for student in students)))


async def untouched(students: Sequence[Student], before: list[int]) -> str:
    """Raises RuntimeError where a kernel is not the same process as before."""
    changed = sum(now != then for now, then in zip(await pids(students), before, strict=True))
    if changed:
        raise RuntimeError(f"{changed} of the other kernels died")
    return f"{len(students)} kernels live on"


async def write(student: Student) -> None:
    """Save a file, as a notebook is saved."""
    told = {"type": "file", "format": "text", "content": WRITTEN}
    await student.hub.ask(f"{student.path}api/contents/mine.txt", told, "PUT")


async def kept(student: Student) -> str:
    """Raises RuntimeError where the file is not as it was saved."""
    found = await student.hub.ask(f"{student.path}api/contents/mine.txt")
    if found["content"] != WRITTEN:
        raise RuntimeError("a saved file was lost")
    return "what was saved is there"
