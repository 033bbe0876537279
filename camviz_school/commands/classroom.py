"""`camviz class`: a room in which a class predicts together."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import LACKING, OK, Refusal, add_command, bounded
from camviz_clinic.commands.terminal import tell
from camviz_school.course.material import built_site
from camviz_school.room.address import ANYWHERE, LOOPBACK, PORT, own_addresses, qr_terminal, shown_host

if TYPE_CHECKING:
    from camviz_school.course.questions import Question
    from camviz_school.room.site import Site
    from camviz_school.room.store import Room

CLASS = """\
Starts a small server for one class: students vote on the lessons' questions with their telephones, or from a notebook
after `camviz join`. They vote, discuss, vote again, and then see who was right and why. Only the number of a choice is
sent; no name, no address and no cookie is kept.

Without --host only this machine can join. For a class choose one of this machine's addresses; everybody in its network
can then reach the server, and join with the word. The votes are in a file room_WORD.sqlite of the current folder: start
again there, and the room goes on. docs/teaching.md says how to use it over a laptop's own hotspot.
"""
EPILOG = """\
examples:
  camviz class 05 --host 192.168.4.1      the questions of lesson 05, for everyone in that network
  camviz class                            all lessons, to try it on this machine
  camviz class --room room_prism-4817.sqlite   the results of a room, also after it has ended
"""


def add(commands: Any) -> None:
    command = add_command(commands, "class", run_class, "let a class vote on the lessons' questions", CLASS)
    command.epilog = EPILOG
    command.add_argument("lesson", metavar="LESSON", nargs="*", help="such as 05; several, or all (default: all)")
    command.add_argument("--host", metavar="ADDRESS", default=LOOPBACK, help="of the interface to serve on")
    command.add_argument("--port", metavar="N", type=bounded("a port", 1, 65535), default=PORT, help=f"default: {PORT}")
    command.add_argument(
        "--days",
        metavar="N",
        type=bounded("a number of days", 0.01, 60),
        default=1,
        help="until a new room ends by itself (default: 1)",
    )
    command.add_argument("--new", action="store_true", help="a new room, though there is one that could go on")
    command.add_argument("--room", metavar="FILE", type=Path, help="the room in this file")
    command.add_argument(
        "--site", metavar="DIR", type=Path, help="a built site, served at /site/ (default: build/site of a clone)"
    )


def run_class(options: argparse.Namespace) -> int:
    """Serve a room until Ctrl-C."""
    if find_spec("tornado") is None:
        raise Refusal("tornado is not installed; `pip install 'camviz[lab]'` brings it.", LACKING)
    from camviz_school.room.store import RoomError

    questions, site = chosen_questions(options.lesson), served_site(options.site)
    try:
        room = opened(options, questions)
    except RoomError as error:
        raise Refusal(f"{error}.") from error
    try:
        asyncio.run(_served(room, site, options))
    finally:
        room.close()
    return OK


def chosen_questions(lessons: Sequence[str]) -> list[Question]:
    """The questions of some lessons, or of all of them."""
    from camviz_school.course.material import material
    from camviz_school.course.questions import questions

    there = sorted(path.parent.name for path in material().glob("*/questions.toml"))
    wanted = there if not lessons or "all" in lessons else list(dict.fromkeys(lessons))
    if unknown := [one for one in wanted if one not in there]:
        raise Refusal(f"there is no lesson {unknown[0]} with questions; there are {', '.join(there)}.")
    return [one for lesson in wanted for one in questions(lesson).values()]


def opened(options: argparse.Namespace, questions: Sequence[Question]) -> Room:
    """The room of the file that is named, else the one of this folder that has not ended, else a new one."""
    from camviz_school.room.store import Room

    if options.room:
        if not options.room.is_file():
            raise Refusal(f"{options.room}: expected the file of a room, there is none.")
        return Room(options.room, questions)
    before = set(Path.cwd().glob("room_*.sqlite"))
    room = (Room.new if options.new else Room.of)(Path.cwd(), questions, options.days)
    if room.path in before:
        tell(f"The room in {room.path.name} goes on.")
    return room


async def _served(room: Room, site: Site | None, options: argparse.Namespace) -> None:
    from camviz_school.room.server import House, application, listen

    _many_files()
    address = f"http://{shown_host(options.host)}:{options.port:.0f}/"
    house = House(room, address, site=site)
    try:
        server = listen(application(house), house, options.host, int(options.port))
    except OSError as error:
        others = ", ".join([LOOPBACK, *own_addresses()])
        raise Refusal(
            f"{options.host} port {options.port:.0f} cannot be served on ({error.strerror}). "
            f"This machine's addresses are {others}; --port chooses another port."
        ) from error
    _announce(house, options.host)
    try:
        await asyncio.Event().wait()
    finally:
        server.stop()


def served_site(folder: Path | None) -> Site | None:
    """The built site of the folder that is named, else of this checkout; None where there is none."""
    from camviz_school.room.site import Site

    try:
        return Site(folder) if folder else Site(built) if (built := built_site()) else None
    except ValueError as error:
        raise Refusal(f"--site: {error}. `python start.py site` builds it.") from error


def _announce(house: Any, host: str) -> None:
    room, address = house.room, house.address
    link = f"{address}#{room.word}"
    drawn = qr_terminal(link)
    tell(drawn if drawn and _shows(drawn) else "(No QR code here: it needs the library segno and a terminal in UTF-8.)")
    tell(f"Students open    {address}\nand join with    {room.word}")
    tell(f"Your own page    {address}teacher#{room.teacher_key}")
    tell(f"For the screen   {address}projector#{room.projector_key}")
    if house.site:
        tell(f"The lessons      {address}site/")
    tell(f"Kept in          {room.path}; delete the file to delete the votes. Ctrl-C stops the server.")
    if host == LOOPBACK:
        tell(f"Only this machine can join. For a class: --host with {' or '.join(own_addresses()) or 'its address'}.")
    elif host in ANYWHERE:
        tell("Every network that this machine is in can reach the room.")


def _shows(text: str) -> bool:
    """Whether stdout can say these characters."""
    import sys

    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _many_files() -> None:
    """Each telephone holds one or two connections open: take as many as the system allows."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, 8192) if most > 0 else 8192, most))
