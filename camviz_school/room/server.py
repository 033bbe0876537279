"""The server of one room: pages, and what they ask for as JSON.

Whoever asks shows a key in the header `Authorization`: the teacher's, the projector's or a student's token. Browsers
attach no such header by themselves, so that no other page can act in a reader's name; besides, a request that says it
comes from another origin is refused, and so is one to a host name that is not this machine's.

Nothing that a student sends is ever shown: a vote is the number of a choice that exists, and all else is refused.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import sqlite3
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from importlib.resources import files
from socket import AF_INET, AF_INET6
from typing import Any
from urllib.parse import urlsplit

from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.iostream import StreamClosedError
from tornado.web import Application, HTTPError, RequestHandler, StaticFileHandler

from camviz_school.room import shown
from camviz_school.room.address import is_named_safely, qr_svg
from camviz_school.room.change_signal import ChangeSignal
from camviz_school.room.limits import MOST_BODY, MOST_HEADERS, Allowance, Limits
from camviz_school.room.site import Site
from camviz_school.room.store import Room, RoomError
from camviz_school.room.tables import answers_csv, counts_csv

PAGES = {"": "phone.html", "teacher": "teacher.html", "projector": "projector.html"}
_OWN = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
POLICY = f"{_OWN}base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
PIECE = 65_536
"""Bytes of a site's file that are on their way to one reader at a time."""

SLOWEST_S = 300.0
"""Of one file on its way to one reader."""


@dataclass
class House:
    """A room that is being served, and a built `site` beside it.

    `address` is what students type, `behind_proxy` that another server passes us on.
    """

    room: Room
    address: str
    limits: Limits = field(default_factory=Limits)
    behind_proxy: bool = False
    site: Site | None = None
    asked: ChangeSignal = field(default_factory=ChangeSignal)
    counted: ChangeSignal = field(default_factory=ChangeSignal)

    def changed(self) -> None:
        """The teacher has done something: tell everyone."""
        self.asked.notify()
        self.counted.notify()

    def to_student(self, number: int) -> shown.Shown:
        """What one student's pages show, with the address of the page to `read` where there is a site."""
        told = shown.to_student(self.room, number)
        name = told["question"]["name"] if told.get("question") else ""
        return {**told, "read": self.site.lesson(name.partition(".")[0]) if self.site else ""}

    def end_in_time(self) -> None:
        """End a room whose time is over."""
        if self.room.end_in_time():
            self.changed()


class Guarded(RequestHandler):
    """Every answer: with the headers that keep a page to itself, and only to those who may ask."""

    house: House
    policy = POLICY

    def initialize(self, house: House, **_others: Any) -> None:
        self.house = house

    def set_default_headers(self) -> None:
        self.set_header("Content-Security-Policy", self.policy)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def prepare(self) -> None:
        """Refuse what comes too often, from another origin, or to a name that is not ours."""
        if not self.allowance.takes(self.request.remote_ip):
            raise RoomError(429, "Too many requests come from this address. Wait for some seconds.")
        if not self.house.behind_proxy and not is_named_safely(self.request.host):
            raise RoomError(421, "This server answers to its address only.")
        self._refuse_other_origins()

    @property
    def allowance(self) -> Allowance:
        """How often one address may ask for this."""
        return self.house.limits.address

    def _refuse_other_origins(self) -> None:
        origin = self.request.headers.get("Origin")
        site = self.request.headers.get("Sec-Fetch-Site", "same-origin")
        foreign = origin is not None and urlsplit(origin).netloc.lower() != self.request.host.lower()
        if self.request.method not in ("GET", "HEAD") and (foreign or site not in ("same-origin", "none")):
            raise RoomError(403, "This request comes from another site's page.")

    def write_error(self, status_code: int, **how: Any) -> None:
        error = how.get("exc_info", (None, None))[1]
        sentence = str(error) if isinstance(error, RoomError) else f"This cannot be done ({status_code})."
        if isinstance(error, sqlite3.Error):
            sentence = f"The room's file cannot be written: {error}. Nothing was counted."
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps({"problem": sentence}))

    def log_exception(self, typ: Any, value: Any, tb: Any) -> None:
        if not isinstance(value, RoomError):
            super().log_exception(typ, value, tb)

    def _handle_request_exception(self, e: BaseException) -> None:
        """A refusal is said with its own status."""
        if isinstance(e, RoomError) and not self._finished:
            self.send_error(e.status, exc_info=(type(e), e, e.__traceback__))
        else:
            super()._handle_request_exception(e)


class Asked(Guarded):
    """What pages ask for, as JSON."""

    @property
    def key(self) -> str:
        """What the request shows to be let in."""
        return self.request.headers.get("Authorization", "").removeprefix("Bearer ")

    def holds(self, key: str) -> bool:
        """Whether the request shows this key."""
        return secrets.compare_digest(self.key.encode(errors="replace"), key.encode())

    def student(self) -> int:
        """The number of the student who asks. Each token has an allowance of its own."""
        number = self.house.room.student(self.key)
        if number is None:
            ended = self.house.room.ended
            raise RoomError(410 if ended else 401, "This room has ended." if ended else "Join the room first.")
        if not self.house.limits.token.takes(number):
            raise RoomError(429, "Too fast. Wait for a second.")
        return number

    def only_teacher(self) -> None:
        """Refuse everyone else."""
        if not self.holds(self.house.room.teacher_key):
            raise RoomError(403, "Only the teacher's page may do this.")

    def told(self) -> dict[str, Any]:
        """The request's JSON object."""
        if not self.request.headers.get("Content-Type", "").startswith("application/json"):
            raise RoomError(415, "Expected application/json.")
        try:
            told = json.loads(self.request.body)
        except (ValueError, RecursionError):
            told = None
        if not isinstance(told, dict):
            raise RoomError(400, "Expected a JSON object.")
        return told


class Joins(Asked):
    """A student comes with the room's word, and goes with a token. Guessing is throttled, right guesses included."""

    def post(self) -> None:
        word, room, limits = self.told().get("word"), self.house.room, self.house.limits
        guesses = ((limits.wrong_word, self.request.remote_ip), (limits.any_wrong_word, "anyone"))
        if any(allowance.left(who) < 1 for allowance, who in guesses):
            raise RoomError(429, "Too many wrong words came from here. Wait for a minute.")
        if not isinstance(word, str):
            raise RoomError(400, "Expected the room's word.")
        try:
            token = room.join(word)
        except RoomError as refused:
            if refused.status == 403:
                for allowance, who in guesses:
                    allowance.takes(who)
            raise
        self.house.counted.notify()
        self.finish({"token": token, "word": room.word, "ends": room.ends})

    def delete(self) -> None:
        """A student leaves."""
        self.student()
        self.house.room.leave(self.key)
        self.finish({})


class States(Asked):
    """What the page that asks may know. With `seen`, the answer comes when there is something new."""

    async def get(self) -> None:
        room, bell = self.house.room, self.house.counted
        tell: Callable[[], shown.Shown]
        if self.holds(room.teacher_key):
            tell = lambda: shown.to_teacher(room)  # noqa: E731
        elif self.holds(room.projector_key):
            tell = lambda: shown.to_projector(room)  # noqa: E731
        else:
            number, bell = self.student(), self.house.asked
            tell = lambda: self.house.to_student(number)  # noqa: E731
        await bell.wait(self.get_query_argument("seen", ""))
        self.finish({"state": bell.state, **tell()})


class Rooms(Asked):
    """What the teacher's and the projector's page show all the time: how to join, and for the teacher what to ask."""

    def get(self) -> None:
        room = self.house.room
        teacher = self.holds(room.teacher_key)
        if not teacher and not self.holds(room.projector_key):
            raise RoomError(403, "This page's address is not complete: its key is missing or wrong.")
        link = f"{self.house.address}#{room.word}"
        told: dict[str, Any] = {"word": room.word, "address": self.house.address, "qr": qr_svg(link)}
        if teacher:
            told |= {"projector": room.projector_key, "lessons": shown.contents(room), "file": room.path.name}
            told["site"] = "site/index.html" if self.house.site else ""
        self.finish(told)


class VoteHandler(Asked):
    """A student's choice. The answer comes when it is in the file's log."""

    def post(self) -> None:
        number, told = self.student(), self.told()
        self.house.room.vote(number, told.get("question"), told.get("round"), told.get("choice"))
        self.house.counted.notify()
        self.finish({"counted": True, **self.house.to_student(number)})


class TeacherHandler(Asked):
    """What the teacher does."""

    def post(self) -> None:
        self.only_teacher()
        told, room = self.told(), self.house.room
        name, number = str(told.get("question", "")), told.get("number", 0)
        deeds: dict[str, Callable[[], None]] = {
            "choose": lambda: room.choose(name),
            "open": lambda: room.open(name, number),
            "close": lambda: room.shut(name),
            "reveal": lambda: room.reveal(name),
            "point": lambda: room.point(name, number),
            "open at home": lambda: room.let_home(True),
            "close at home": lambda: room.let_home(False),
            "end": room.end,
        }
        if told.get("do") not in deeds or type(number) is not int:
            raise RoomError(400, f"Expected one of: {', '.join(deeds)}.")
        deeds[told["do"]]()
        self.house.changed()
        self.finish(shown.to_teacher(room))


class Tables(Asked):
    """The votes as CSV: every one, as `camviz_school.course.learning` reads them, or how many chose what."""

    def get(self, which: str) -> None:
        self.only_teacher()
        self.set_header("Content-Type", "text/csv; charset=utf-8")
        self.finish(answers_csv(self.house.room.answers()) if which == "answers" else counts_csv(self.house.room))


class Pages(Guarded):
    """The three pages. Each finds its key in its own address, behind the #, which no browser sends to a server."""

    def get(self, name: str) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.finish((files("camviz_school.room") / "pages" / PAGES[name]).read_bytes())


class Files(Guarded, StaticFileHandler):
    """Scripts and styles."""

    def initialize(self, house: House, **others: Any) -> None:  # type: ignore[override]
        Guarded.initialize(self, house)
        StaticFileHandler.initialize(self, **others)

    def set_extra_headers(self, path: str) -> None:
        self.set_header("Cache-Control", "no-cache")


class Sites(Guarded):
    """The pages of the lessons, from the room's own origin."""

    @property
    def allowance(self) -> Allowance:
        return self.house.limits.site

    async def get(self, way: str) -> None:
        site = self.house.site
        if site is None or (path := site.find(way)) is None:
            raise HTTPError(404)
        file = await site.read(path)
        packed = file.packed if "gzip" in self.request.headers.get("Accept-Encoding", "") else None
        self.set_header("Content-Type", file.type)
        self.set_header("Content-Security-Policy", file.policy)
        self.set_header("Cache-Control", "no-cache" if path.suffix == ".html" else "private, max-age=600")
        self.set_header("Etag", file.etag)
        self.set_header("Vary", "Accept-Encoding")
        if self.check_etag_header():
            self.set_status(304)
            return
        if packed:
            self.set_header("Content-Encoding", "gzip")
        await self._send(packed or file.body)

    async def _send(self, body: bytes) -> None:
        """Piece by piece, as fast as they are taken: a slow reader holds one piece in memory, and not the whole."""
        self.set_header("Content-Length", len(body))
        try:
            async with asyncio.timeout(SLOWEST_S):
                for start in range(0, len(body), PIECE):
                    self.write(body[start : start + PIECE])
                    await self.flush()
        except (StreamClosedError, TimeoutError):  # the reader has gone, or has stopped reading
            self.request.connection.stream.close()  # type: ignore[union-attr]


class Nothing(Guarded):
    """There is no such page."""

    def prepare(self) -> None:
        super().prepare()
        raise HTTPError(404)


def application(house: House, prefix: str = "/", more: Iterable[Any] = ()) -> Application:
    """All addresses of a room below `prefix`."""
    served, pages = {"house": house}, files("camviz_school.room") / "pages"
    routes: list[Any] = [
        (r"api/join", Joins, served),
        (r"api/state", States, served),
        (r"api/room", Rooms, served),
        (r"api/vote", VoteHandler, served),
        (r"api/do", TeacherHandler, served),
        (r"api/(answers|counts)\.csv", Tables, served),
        (r"static/(.*)", Files, {**served, "path": str(pages)}),
        (r"site/(.*)", Sites, served),
        (r"(|teacher|projector)", Pages, served),
        *more,
    ]
    placed = [(f"{prefix}{route}", *rest) for route, *rest in routes]
    return Application(
        placed, default_handler_class=Nothing, default_handler_args=served, log_function=lambda handler: None
    )


def listen(app: Application, house: House, host: str, port: int) -> HTTPServer:
    """Serve on one address. Raises OSError where it is not this machine's, or the port is taken."""
    server = HTTPServer(
        app,
        max_body_size=MOST_BODY,
        max_header_size=MOST_HEADERS,
        max_buffer_size=4 * MOST_HEADERS,
        idle_connection_timeout=60,
        body_timeout=10,
        xheaders=house.behind_proxy,
    )
    listening = socket.create_server((host, port), family=AF_INET6 if ":" in host else AF_INET, backlog=1024)
    listening.setblocking(False)
    server.add_socket(listening)
    PeriodicCallback(house.end_in_time, 60_000).start()
    house.end_in_time()
    return server
