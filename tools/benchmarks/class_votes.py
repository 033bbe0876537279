"""A class votes at once, over loopback: how long each waits for its acknowledgement, and what a kill -9 loses.

    python tools/benchmarks/class_votes.py [--students 300] [--seconds 5]

Starts `camviz class` in an empty folder. Every student joins, and holds a connection on which news is waited for, as a
telephone does. In the first vote all choices come within those seconds. In the second vote the server is killed when
half of them are acknowledged, and started again; whoever had no acknowledgement votes again. Prints the times as
Markdown, each with a connection of its own in them. Fails where a vote was lost or counted twice, or where the 95th
percentile is above 200 ms. It asks nobody but 127.0.0.1, at most 1000 students in at most 60 seconds.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import psutil

ROOT = Path(__file__).resolve().parents[2]
HOST = "127.0.0.1"
QUESTION = "05.grid"
MOST_MS = 200


class Server:
    """`camviz class` in a folder, on a port that stays the same when it is started again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with socket.socket() as probe:
            probe.bind((HOST, 0))
            self.port = probe.getsockname()[1]

    async def start(self) -> str:
        """What the command says, once it serves."""
        said = self.folder / "said.txt"
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
        words = [sys.executable, "-m", "camviz", "class", "05", "--host", HOST, "--port", str(self.port)]
        with said.open("w") as output:
            self.process = subprocess.Popen(words, cwd=self.folder, env=environment, stdout=output, stderr=output)
        for _ in range(600):
            if "Ctrl-C stops" in (text := said.read_text(encoding="utf-8")):
                return text
            await asyncio.sleep(0.05)
        raise RuntimeError(f"the server did not start: {text}")

    def processor_time(self) -> float:
        """Seconds that the server has worked."""
        times = psutil.Process(self.process.pid).cpu_times()
        return float(times.user + times.system)

    def kill(self) -> None:
        """As by kill -9, or by a laptop that falls."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    async def ask(self, path: str, told: dict[str, Any] | None = None, key: str = "") -> dict[str, Any]:
        """The JSON of an answer, on a connection of its own. Raises OSError without an answer, and for a refusal."""
        body = b"" if told is None else json.dumps(told).encode()
        head = (
            f"{'GET' if told is None else 'POST'} /{path} HTTP/1.1\r\nHost: {HOST}:{self.port}\r\nConnection: close\r\n"
        )
        head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\nAuthorization: Bearer {key}\r\n\r\n"
        reader, writer = await asyncio.open_connection(HOST, self.port)
        try:
            writer.write(head.encode() + body)
            answer = await reader.read()
        finally:
            writer.close()
        status, _, json_text = answer.partition(b"\r\n\r\n")
        if not status.startswith(b"HTTP/1.1 200"):
            raise ConnectionError(answer[:300])
        return dict(json.loads(json_text))


async def vote(server: Server, token: str, number: int, choice: int, after: float) -> float | None:
    """The seconds until the acknowledgement; None where there was none."""
    await asyncio.sleep(after)
    start = time.perf_counter()
    with suppress(OSError):
        told = {"question": QUESTION, "round": number, "choice": choice}
        assert (await server.ask("api/vote", told, token))["counted"]
        return time.perf_counter() - start
    return None


async def waiting(server: Server, token: str) -> None:
    """A telephone that waits for the teacher's next step, hears of it, and waits again, until the server is gone."""
    seen = ""
    with suppress(OSError, asyncio.IncompleteReadError):
        while True:
            seen = (await server.ask(f"api/state?seen={seen}", key=token))["state"]
            await asyncio.sleep(0.35)  # as phone.js does


def percentile(values: list[float], share: float) -> float:
    """In milliseconds."""
    return 1000 * sorted(values)[min(len(values) - 1, int(share * len(values)))]


async def measure(students: int, seconds: float) -> bool:
    """Both votes; True where all that was promised holds."""
    rng = Random(5)
    with TemporaryDirectory() as folder:
        server = Server(Path(folder))
        text = await server.start()
        try:
            word, teacher = re.search(r"join with +(\S+)", text)[1], re.search(r"teacher#(\S+)", text)[1]
            tokens = [(await server.ask("api/join", {"word": word}))["token"] for _ in range(students)]
            before = server.processor_time()
            times = await first_vote(server, tokens, teacher, seconds, rng)
            busy = server.processor_time() - before
            lost = await second_vote(server, tokens, teacher, seconds, rng)
        finally:
            server.kill()
    print(f"Load of this machine when it ended: {os.getloadavg()[0]:.1f}, on {os.cpu_count()} processors.\n")
    p50, p95, worst = (percentile(times, share) for share in (0.5, 0.95, 1))
    columns = ["students", "within", "counted once", "p50", "p95", "worst", "server worked", "acknowledged, then lost"]
    row = [
        students,
        f"{seconds:g} s",
        len(times),
        *(f"{each:.0f} ms" for each in (p50, p95, worst)),
        f"{busy:.2f} s",
        lost,
    ]
    print(*(f"| {' | '.join(map(str, each))} |" for each in (columns, ["---"] * len(columns), row)), sep="\n")
    return p95 <= MOST_MS


async def first_vote(server: Server, tokens: list[str], teacher: str, seconds: float, rng: Random) -> list[float]:
    """All within some seconds, each with a telephone that waits beside it. The seconds to each acknowledgement."""
    telephones = [asyncio.ensure_future(waiting(server, token)) for token in tokens]
    await asyncio.sleep(2)
    await server.ask("api/do", {"do": "open", "question": QUESTION, "number": 1}, teacher)
    choices = [rng.randrange(4) for _ in tokens]
    votes = [
        vote(server, *each, rng.uniform(0, seconds)) for each in zip(tokens, [1] * len(tokens), choices, strict=True)
    ]
    times = await asyncio.gather(*votes)
    told = await server.ask("api/do", {"do": "close", "question": QUESTION}, teacher)
    for telephone in telephones:
        telephone.cancel()
    await asyncio.gather(*telephones, return_exceptions=True)
    assert told["question"]["counts"]["1"] == [choices.count(choice) for choice in range(4)], (
        "a vote was lost or doubled"
    )
    assert None not in times
    return [each for each in times if each is not None]


async def second_vote(server: Server, tokens: list[str], teacher: str, seconds: float, rng: Random) -> str:
    """The server is killed in the midst. How many were acknowledged until then, and how many of those were lost."""
    await server.ask("api/do", {"do": "open", "question": QUESTION, "number": 2}, teacher)
    choices = [rng.randrange(4) for _ in tokens]
    votes = [
        asyncio.ensure_future(vote(server, token, 2, choice, rng.uniform(0, seconds)))
        for token, choice in zip(tokens, choices, strict=True)
    ]
    while sum(each.done() for each in votes) < len(votes) / 2:
        await asyncio.sleep(0.005)
    server.kill()
    acknowledged = [each is not None for each in await asyncio.gather(*votes)]
    await server.start()
    states = [(await server.ask("api/state", key=token))["question"]["chosen"].get("2") for token in tokens]
    lost = sum(ok and kept != choice for ok, kept, choice in zip(acknowledged, states, choices, strict=True))
    late = [i for i, ok in enumerate(acknowledged) if not ok]
    await asyncio.gather(*(vote(server, tokens[i], 2, choices[i], 0) for i in late))
    told = await server.ask("api/do", {"do": "close", "question": QUESTION}, teacher)
    assert told["question"]["counts"]["2"] == [choices.count(choice) for choice in range(4)], (
        "a vote was lost or doubled"
    )
    assert lost == 0, f"{lost} acknowledged votes were lost"
    return f"{sum(acknowledged)}, {lost}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--students", type=int, default=300, choices=range(10, 1001), metavar="10…1000")
    parser.add_argument("--seconds", type=float, default=5)
    options = parser.parse_args()
    return 0 if asyncio.run(asyncio.wait_for(measure(options.students, min(options.seconds, 20)), 60)) else 1


if __name__ == "__main__":
    sys.exit(main())
