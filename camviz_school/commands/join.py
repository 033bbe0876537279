"""`camviz join` and `camviz leave`: this user's notebooks vote in a room."""

from __future__ import annotations

import argparse
from typing import Any

from camviz_clinic.commands.common import OK, Refusal, add_command
from camviz_clinic.commands.terminal import tell

JOIN = """\
Joins the room of a class. From then on the lessons' questions, asked in a notebook on this machine, send the number of
your choice while the teacher's vote on them is open, and nothing else. If the room is not reached, the lesson goes on.
"""
EPILOG = """\
examples:
  camviz join prism-4817 http://192.168.4.1:8787
  camviz join http://192.168.4.1:8787/#prism-4817
  camviz join --leave                                 forget the room
"""


def add(commands: Any) -> None:
    command = add_command(commands, "join", join, "vote with your class from a notebook", JOIN)
    command.epilog = EPILOG
    command.add_argument("word", metavar="WORD", nargs="?", default="", help="the word of the room, or the whole link")
    command.add_argument(
        "address", metavar="ADDRESS", nargs="?", default="", help="default: what CAMVIZ_ROOM says, else this machine"
    )
    command.add_argument("--leave", action="store_true", help="leave the room that you are in")


def join(options: argparse.Namespace) -> int:
    """Join a room, or leave it."""
    from camviz_school.room.membership import NotReachedError, RefusedError, leave
    from camviz_school.room.membership import join as join_room

    if options.leave:
        left = leave()
        tell(f"You have left the room {left.word}. What you voted still counts." if left else "You were in no room.")
        return OK
    if not options.word:
        raise Refusal("expected the word of the room, or --leave; see `camviz join --help`.")
    try:
        joined = join_room(options.word, options.address)
    except (NotReachedError, RefusedError) as error:
        raise Refusal(str(error) if str(error).endswith(".") else f"{error}.") from error
    tell(f"You are in the room {joined.word} at {joined.address}. Your notebooks vote there until it ends.")
    return OK
