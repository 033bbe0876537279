"""`camviz class` in a process of its own, and what its pages ask it."""

import json
import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from urllib.error import HTTPError
from urllib.request import ProxyHandler, Request, build_opener

from commandline import ROOT


@contextmanager
def camviz_class(folder, *words):
    """`camviz class` in a folder: its process, its port and all that it has said until it can be reached."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "camviz", "class", *(words or ["05"]), "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
    with (folder / "said.txt").open("w+", encoding="utf-8") as said:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=said, stderr=said)
        try:
            end = time.monotonic() + 30
            while "Ctrl-C stops" not in (text := (folder / "said.txt").read_text(encoding="utf-8")):
                assert process.poll() is None, text
                assert time.monotonic() < end, text
                time.sleep(0.05)
            yield process, port, text
        finally:
            process.kill()
            process.wait()


def ask(port, path, told=None, key=""):
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {key}"} if key else {})
    body = None if told is None else json.dumps(told).encode()
    try:
        with build_opener(ProxyHandler({})).open(
            Request(f"http://127.0.0.1:{port}/{path}", body, headers), timeout=10
        ) as answer:
            return json.loads(answer.read())
    except HTTPError as error:
        return {"status": error.code, **json.loads(error.read())}
