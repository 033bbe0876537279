"""A room to talk to: `camviz class` in a process of its own, or the server in this one."""

import asyncio
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
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.testing import bind_unused_port

from camviz_school.room.limits import Limits
from camviz_school.room.server import House, application, listen


@contextmanager
def camviz_class(folder, *words):
    """`camviz class` in a folder: its process, its port and all that it has said until it can be reached."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "camviz", "class", *(words or ["05"]), "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
    last = "Ctrl-C stops" if "--host" in words else "Only this machine can join"
    with (folder / "said.txt").open("w+", encoding="utf-8") as said:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=said, stderr=said)
        try:
            end = time.monotonic() + 120
            while last not in (text := (folder / "said.txt").read_text(encoding="utf-8")):
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
            Request(f"http://127.0.0.1:{port}/{path}", body, headers), timeout=120
        ) as answer:
            return json.loads(answer.read())
    except HTTPError as error:
        return {"status": error.code, **json.loads(error.read())}


class Client:
    """A browser or a program that talks to a house over loopback."""

    def __init__(self, port, room):
        self.port, self.room = port, room

    async def __call__(self, path, told=None, key="", method=None, raw=None, **headers):
        names = {name.replace("_", "-"): value for name, value in headers.items()}
        names = ({"Content-Type": "application/json"} if told is not None or raw is not None else {}) | names
        names |= {"Authorization": f"Bearer {key}"} if key else {}
        body = raw if raw is not None else None if told is None else json.dumps(told)
        method = method or ("GET" if body is None else "POST")
        request = HTTPRequest(
            f"http://127.0.0.1:{self.port}/{path}",
            method,
            names,
            body,
            allow_nonstandard_methods=True,
            request_timeout=120,
        )
        return await AsyncHTTPClient().fetch(request, raise_error=False)

    async def join(self, **headers):
        return json.loads((await self("api/join", {"word": self.room.word}, **headers)).body)["token"]

    async def do(self, deed, name="05.grid", number=0):
        told = {"do": deed, "question": name, "number": number}
        return await self("api/do", told, self.room.teacher_key)


def served(room, run, limits=None, proxied=False, site=None, **options):
    """Run a coroutine function with a client of the room's server."""

    async def both():
        held, port = bind_unused_port(address="127.0.0.1")
        held.close()
        house = House(room, f"http://127.0.0.1:{port}/", limits or Limits(), proxied, site)
        server = listen(application(house, **options), house, "127.0.0.1", port)
        AsyncHTTPClient.configure(None, max_clients=500)
        try:
            return await run(Client(port, room))
        finally:
            server.stop()
            await server.close_all_connections()

    return asyncio.run(both())
