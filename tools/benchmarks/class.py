"""A class on a real JupyterHub on this machine: when all see a picture, how soon sliders answer, what it takes.

    pip install jupyterhub                     # into the environment that runs this
    npm install -g configurable-http-proxy     # needs Node
    python tools/benchmarks/class.py [--students 60] [--moving 10] [--proxy PATH]

Starts a hub with tools/deploy/jupyterhub_config.py, its proxy, and for every student a server and a kernel. Students
come `--at-once` at a time, as the rows of a room do. Each opens a lesson, all lessons in turn, and runs it from top to
bottom. Then some move a slider at once, a change every 100 ms for 2 s, and read, and move again.

Prints Markdown for docs/performance.md. Fails for any failure, above 14 GB, or where a slider's p95 is above 500 ms. It
asks nobody but 127.0.0.1 and leaves no process behind. Sixty students take some 12 GB and ten minutes of two cores.
The students are simulated in this process, which works too. As JupyterHub's own simulators do (hubtraf,
jupyterhub-simulator), they ask the hub's API for their server and come with a token instead of a password.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import shutil
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import psutil
from classroom.hub import Hub
from classroom.student import Student
from tornado.httpclient import AsyncHTTPClient

ROOT = Path(__file__).resolve().parents[2]
MOST_GB, MOST_MS = 14, 500
BURST_S = 2
COLUMNS = {
    "students": "students",
    "failures": "failures",
    "room is up, s": "up",
    "server, s": "server",
    "first picture, s": "picture",
    "whole lesson, s": "lesson",
    "all of it, GB": "gb",
    "a student, MB": "mb",
    "processor, s a student": "work",
    "moving": "moving",
    "slider → answer, ms": "slider",
}


async def measure(options: argparse.Namespace, folder: Path) -> bool:
    """The class; True where all that was promised holds."""
    hub = Hub(folder, options.proxy)
    try:
        hub.start_proxy()
        hub.start_hub()
        await hub.ready()
        lessons = sorted((ROOT / "lessons").glob("[0-9]*.ipynb"))
        names = [f"student-{number:02d}" for number in range(1, options.students + 1)]
        students = [Student(hub, name, lessons[i % len(lessons)]) for i, name in enumerate(names)]
        row = await fill(hub, students, options.at_once)
        row |= await move(students, options)
        row["failures"] = sum(len(student.failures) for student in students)
        print(table([row]), memory_line(hub), sep="\n", flush=True)
        for sentence in (sentence for student in students for sentence in student.failures):
            print(f"- {sentence}", flush=True)
    finally:
        left = hub.end()
        if options.log:
            print(hub.log(), file=sys.stderr)
    print(
        f"\nProcesses left behind: {left}. Load when it ended: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors."
    )
    return bool(not left and not row["failures"] and row["gb"] <= MOST_GB and row["worst_ms"] <= MOST_MS)


async def fill(hub: Hub, students: list[Student], at_once: int) -> dict[str, object]:
    """Everyone comes, opens a lesson and runs it; so many at a time are between the door and their first picture."""
    doors, began = asyncio.Semaphore(at_once), time.perf_counter()
    await asyncio.gather(*(attend(student, doors) for student in students))
    memory = sum(hub.memory_mb().values())
    return {
        "students": len(students),
        "up": f"{time.perf_counter() - began:.0f}",
        "server": both([student.server_s for student in students], "{:.1f}"),
        "picture": both([student.picture_s for student in students], "{:.1f}"),
        "lesson": both([student.lesson_s for student in students], "{:.1f}"),
        "gb": round(memory / 1024, 1),
        "mb": round(memory / len(students)),
        "work": f"{hub.processor_seconds() / len(students):.1f}",
    }


async def attend(student: Student, doors: asyncio.Semaphore) -> None:
    try:
        async with doors:
            began = await student.arrive()
            cells = await student.open_lesson()
            running = asyncio.ensure_future(student.run(cells, began))
            while not running.done() and student.kernel.first_picture is None:
                await asyncio.sleep(0.05)
        await running
    # Whatever stops a student is what this program is there to find: it is told, and the others go on.
    except Exception as error:
        student.failures.append(f"{student.name}: {type(error).__name__}: {error}")


async def move(students: list[Student], options: argparse.Namespace) -> dict[str, object]:
    """Some move their sliders at once, in bursts with reading between them."""
    able = [student for student in students if student.slider]
    moving = Random(5).sample(able, min(options.moving, len(able)))
    bursts: list[list[float]] = []
    for _ in range(options.bursts):
        before = [len(student.slider.answers) for student in moving]
        done = await asyncio.gather(*(student.move(BURST_S) for student in moving), return_exceptions=True)
        for student, error in zip(moving, done, strict=True):
            if error:
                student.failures.append(f"{student.name} moved a slider: {type(error).__name__}: {error}")
        await asyncio.sleep(options.reading)
        made = zip(moving, before, strict=True)
        bursts.append([answer * 1000 for student, count in made for answer in student.slider.answers[count:]])
    for student in moving:
        student.failures += [f"{student.lesson.stem}: {error}" for error in student.slider.errors]
    answers = [answer for burst in bursts for answer in burst]
    print("Slider → answer, ms, burst by burst:", "; ".join(both(burst, "{:.0f}") for burst in bursts), flush=True)
    return {"moving": len(moving), "slider": both(answers, "{:.0f}"), "worst_ms": percentile(answers, 0.95)}


def memory_line(hub: Hub) -> str:
    """What each kind of process takes."""
    sizes, counts = hub.memory_mb(), hub.counts()
    parts = [f"{kind} {sizes[kind]} MB ({counts[kind]} processes)" for kind in sorted(sizes)]
    free = psutil.virtual_memory().available >> 30
    return f"\nMemory (PSS) at the end: {', '.join(parts)}. Free on this machine: {free} GB."


def both(values: list[float], form: str) -> str:
    """p50, p95 of what was reached."""
    return ", ".join(form.format(percentile(values, share)) for share in (0.5, 0.95))


def percentile(values: list[float], share: float) -> float:
    reached = sorted(value for value in values if value == value)
    return reached[min(len(reached) - 1, int(share * len(reached)))] if reached else float("nan")


def table(rows: list[dict[str, object]]) -> str:
    """One row a class; pairs are p50 and p95."""
    lines = [list(COLUMNS), ["---"] * len(COLUMNS), *([str(row[key]) for key in COLUMNS.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--students", type=int, default=60, choices=range(2, 201), metavar="2…200")
    parser.add_argument("--moving", type=int, default=10, help="students who move a slider at once")
    parser.add_argument("--at-once", type=int, default=4, help="students between the door and their first picture")
    parser.add_argument("--bursts", type=int, default=3)
    parser.add_argument("--reading", type=float, default=5, help="seconds between bursts")
    parser.add_argument("--proxy", default=shutil.which("configurable-http-proxy"), help="path of the proxy")
    parser.add_argument("--log", action="store_true", help="print what hub and servers said")
    options = parser.parse_args()
    if find_spec("jupyterhub") is None:
        parser.error("jupyterhub is not installed here; `pip install jupyterhub` brings it")
    if options.proxy is None:
        parser.error("configurable-http-proxy was not found; `npm install -g configurable-http-proxy` brings it")
    AsyncHTTPClient.configure(None, max_clients=500, defaults={"connect_timeout": 60})
    with TemporaryDirectory() as folder:
        return 0 if asyncio.run(measure(options, Path(folder))) else 1


if __name__ == "__main__":
    sys.exit(main())
