"""A real Firefox, driven over WebDriver BiDi: it needs no other program and no driver. https://w3c.github.io/webdriver-bidi

Playwright drives only a Firefox of its own; this is the one that people have.
"""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websocket import WebSocket, create_connection

NAMES = ("firefox-esr", "firefox")
LISTENING = re.compile(r"WebDriver BiDi listening on (ws://\S+)")
STARTED_S, ANSWERED_S = 300, 300
LEFT = 0  # the number of a mouse's button
PREFERENCES = {  # no calls home, nothing said on a first start
    "app.update.disabledForTesting": True,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "toolkit.telemetry.server": "",
}


class FirefoxError(Exception):
    """What Firefox, or a script in its page, answered instead of a result."""


def executable() -> str | None:
    """The Firefox of this machine, or the one that CAMVIZ_FIREFOX names; None without any."""
    if named := os.environ.get("CAMVIZ_FIREFOX"):
        return named
    return next((found for name in NAMES if (found := shutil.which(name))), None)


@contextmanager
def firefox(profile: Path, width: int = 1280, height: int = 900) -> Iterator[Firefox]:
    """A Firefox without a window, with an empty profile in that folder."""
    profile.mkdir(parents=True, exist_ok=True)
    lines = (f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in PREFERENCES.items())
    (profile / "user.js").write_text("".join(lines), encoding="utf-8")
    command = [str(executable()), "--headless", "--no-remote", "--remote-debugging-port=0", "--profile", str(profile)]
    log = profile.parent / "firefox.log"
    with log.open("w") as output:
        process = subprocess.Popen(
            command, stdout=output, stderr=output, env=os.environ | {"HOME": str(profile.parent)}
        )
    try:
        socket = create_connection(_address(process, log) + "/session", timeout=ANSWERED_S, suppress_origin=True)
        yield Firefox(socket, width, height)
        socket.close()
    finally:
        process.terminate()
        process.wait(timeout=300)


def _address(process: subprocess.Popen[bytes], log: Path) -> str:
    end = time.monotonic() + STARTED_S
    while time.monotonic() < end and process.poll() is None:
        if found := LISTENING.search(log.read_text(encoding="utf-8", errors="replace")):
            return found[1]
        time.sleep(0.1)
    raise FirefoxError(f"Firefox does not listen: {log.read_text(encoding='utf-8', errors='replace')[-1000:]}")


class Firefox:
    """One tab. `complaints` are the errors of its console and of scripts, `asked` the addresses it has requested."""

    def __init__(self, socket: WebSocket, width: int, height: int) -> None:
        self._socket, self._count = socket, 0
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self._call("session.new", capabilities={})
        self._tab = self._call("browsingContext.create", type="tab")["context"]  # the first one is Firefox's own
        events = ["log.entryAdded", "network.beforeRequestSent", "network.responseCompleted"]
        self._call("session.subscribe", events=events)
        self.resize(width, height)

    def resize(self, width: int, height: int) -> None:
        """Give the page that many CSS pixels."""
        viewport = {"width": width, "height": height}
        self._call("browsingContext.setViewport", context=self._tab, viewport=viewport)

    def open(self, url: str) -> None:
        """Go there, and wait until the page has loaded."""
        self._call("browsingContext.navigate", context=self._tab, url=url, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page, after waiting for it: anything that JSON can say."""
        answer = self._call(
            "script.evaluate",
            expression=f"(async () => JSON.stringify(await ({expression}) ?? null))()",
            target={"context": self._tab},
            awaitPromise=True,
        )
        if answer["type"] == "exception":
            raise FirefoxError(answer["exceptionDetails"]["text"])
        return json.loads(answer["result"]["value"])

    def wait_for(self, expression: str, limit_s: float = 20) -> None:
        """Wait until an expression holds in the page."""
        end = time.monotonic() + limit_s
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise FirefoxError(f"after {limit_s:g} s it still does not hold that {expression}")
            time.sleep(0.05)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """Press the pointer at one place of the window, move it to another and let go there; CSS pixels."""
        along = [step / steps for step in range(1, steps + 1)]
        way = [[from_ + (to - from_) * part for from_, to in zip(start, end, strict=True)] for part in along]
        moves = [_move(x, y, 20) for x, y in way]
        press, let_go = ({"type": kind, "button": LEFT} for kind in ("pointerDown", "pointerUp"))
        self._perform([_move(*start), press, *moves, let_go])

    def click(self, place: tuple[float, float]) -> None:
        """Click at a place of the window, in CSS pixels."""
        press, let_go = ({"type": kind, "button": LEFT} for kind in ("pointerDown", "pointerUp"))
        self._perform([_move(*place), press, let_go])

    def move(self, place: tuple[float, float]) -> None:
        """Bring the pointer to a place of the window, in CSS pixels."""
        self._perform([_move(*place)])

    def screenshot(self, path: Path, whole: bool = False) -> None:
        """Keep what the window shows, or the whole page, as PNG."""
        origin = "document" if whole else "viewport"
        data = self._call("browsingContext.captureScreenshot", context=self._tab, origin=origin)["data"]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(data))

    def _perform(self, actions: list[dict[str, Any]]) -> None:
        pointer = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}
        self._call("input.performActions", context=self._tab, actions=[pointer])

    def _call(self, method: str, **params: Any) -> dict[str, Any]:
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": params}))
        while True:
            told = json.loads(self._socket.recv())
            if told.get("type") == "event":
                self._hear(told["method"], told["params"])
            elif told.get("id") == self._count:
                if told["type"] == "error":
                    raise FirefoxError(f"{method}: {told['error']}: {told['message']}")
                return dict(told["result"])

    def _hear(self, event: str, params: dict[str, Any]) -> None:
        if event == "log.entryAdded" and params["level"] == "error":
            self.complaints.append(params["text"] or params["type"])
        elif event == "network.beforeRequestSent":
            self.asked.append(params["request"]["url"])
        elif event == "network.responseCompleted" and params["response"]["status"] >= 400:
            self.complaints.append(f"{params['response']['status']}: {params['response']['url']}")


def _move(x: float, y: float, duration_ms: int = 0) -> dict[str, Any]:
    return {"type": "pointerMove", "x": round(x), "y": round(y), "duration": duration_ms}
