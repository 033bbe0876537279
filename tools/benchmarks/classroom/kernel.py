"""A kernel as a browser knows it: over a websocket, through the hub's proxy, with the widgets that it opens."""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

from jupyter_server.services.kernels.connection.base import deserialize_msg_from_ws_v1, serialize_msg_to_ws_v1
from tornado.escape import json_decode, json_encode
from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, WebSocketClosedError, websocket_connect

from classroom.hub import Hub

PROTOCOL = "v1.kernel.websocket.jupyter.org"  # the one that JupyterLab speaks
MOST_BYTES = 200 << 20  # of one message


class Kernel:
    """What a page holds of a kernel: a connection, the answers that it waits for, and its widgets by their comms."""

    def __init__(self, hub: Hub, path: str, number: str) -> None:
        self._hub, self._path, self.number = hub, path, number
        self._session = uuid.uuid4().hex
        self._connection: WebSocketClientConnection | None = None
        self._reading: asyncio.Task[None] | None = None
        self._replies: dict[str, asyncio.Future[dict[str, Any]]] = {}
        self.widgets: dict[str, dict[str, Any]] = {}
        self.first_picture: float | None = None
        self.listeners: dict[str, Callable[[dict[str, Any]], None]] = {}
        self.states: list[tuple[float, str]] = []

    async def connect(self) -> None:
        """Open the connection, again with the same session after it was lost: the server then tells what was missed."""
        request = HTTPRequest(
            f"ws://{self._hub.address}/{self._path}api/kernels/{self.number}/channels?session_id={self._session}",
            headers={"Authorization": f"token {self._hub.token}"},
            connect_timeout=30,
            request_timeout=60,
        )
        self._connection = await websocket_connect(
            request, subprotocols=[PROTOCOL], max_message_size=MOST_BYTES, ping_interval=None
        )
        self._reading = asyncio.ensure_future(self._read(self._connection))

    @property
    def connected(self) -> bool:
        return self._reading is not None and not self._reading.done()

    def leave(self) -> None:
        if self._connection:
            self._connection.close()

    async def run(self, code: str, seconds: float = 300, **expressions: str) -> dict[str, Any]:
        """What the kernel replies to a cell, when it has run it. Raises TimeoutError and ConnectionError."""
        content = {"code": code, "silent": False, "store_history": True, "user_expressions": expressions}
        content |= {"allow_stdin": False, "stop_on_error": True}
        return await asyncio.wait_for(self._ask("execute_request", content), seconds)

    def tell(self, comm: str, content: dict[str, Any]) -> None:
        """A widget's message to its kernel, as anywidget's `model.send` makes it."""
        self._send("comm_msg", {"comm_id": comm, "data": {"method": "custom", "content": content}})

    def _send(self, kind: str, content: dict[str, Any]) -> str:
        if self._connection is None or not self.connected:
            raise ConnectionError("the connection to the kernel is lost")
        number = uuid.uuid4().hex
        header = {"msg_id": number, "msg_type": kind, "session": self._session, "username": "", "version": "5.3"}
        header["date"] = datetime.now(UTC).isoformat()
        message = {"header": header, "parent_header": {}, "metadata": {}, "content": content}
        packed = serialize_msg_to_ws_v1(message, "shell", lambda part: json_encode(part).encode())
        with suppress(WebSocketClosedError):
            self._connection.write_message(packed, binary=True)
        return number

    async def _ask(self, kind: str, content: dict[str, Any]) -> dict[str, Any]:
        reply: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        number = self._send(kind, content)
        self._replies[number] = reply
        try:
            return await reply
        finally:
            del self._replies[number]

    async def _read(self, connection: WebSocketClientConnection) -> None:
        while (packed := await connection.read_message()) is not None:
            _, parts = deserialize_msg_from_ws_v1(packed)
            header, parent, _, content = map(json_decode, parts[:4])
            self._heard(header["msg_type"], parent.get("msg_id", ""), content)
        self._give_up("the connection to the kernel is lost")

    def _give_up(self, why: str) -> None:
        for reply in self._replies.values():
            if not reply.done():
                reply.set_exception(ConnectionError(why))

    def _heard(self, kind: str, asked: str, content: dict[str, Any]) -> None:
        if kind == "comm_open" and content["target_name"] == "jupyter.widget":
            self._opened(content["comm_id"], content["data"]["state"])
        elif kind == "comm_msg" and content["data"].get("method") == "update":
            self._updated(content["comm_id"], content["data"]["state"])
        elif kind == "execute_reply" and asked in self._replies and not self._replies[asked].done():
            self._replies[asked].set_result(content)
        elif kind == "status" and content["execution_state"] not in ("busy", "idle", "starting"):
            self.states.append((time.perf_counter(), content["execution_state"]))
            self._give_up(f"the kernel is {content['execution_state']}")

    def _opened(self, comm: str, state: dict[str, Any]) -> None:
        self.widgets[comm] = state
        if self.first_picture is None and state.get("frame"):
            self.first_picture = time.perf_counter()

    def _updated(self, comm: str, state: dict[str, Any]) -> None:
        self.widgets.setdefault(comm, {}).update(state)
        if "frame" in state and comm in self.listeners:
            self.listeners[comm](state["frame"])
