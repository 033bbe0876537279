"""A room as a service of a JupyterHub: `python -m camviz_school.room.hub 05`, started by the hub itself.

In `jupyterhub_config.py`:

    c.JupyterHub.services = [{
        "name": "camviz-class",
        "url": "http://127.0.0.1:8787",
        "command": ["python", "-m", "camviz_school.room.hub", "05"],
        "cwd": "/srv/camviz-class",  # where the room's file is kept
        "environment": {
            "CAMVIZ_CLASS_ADDRESS": "https://hub.example.org/services/camviz-class/",
            "CAMVIZ_CLASS_SITE": "/srv/camviz-site",  # what `python start.py site` built; the line may be left out
        },
        "oauth_no_confirm": True,
    }]
    c.JupyterHub.load_roles = [{
        "name": "teachers",
        "groups": ["teachers"],
        "scopes": ["access:services!service=camviz-class"],
    }]
    c.Spawner.environment = {"CAMVIZ_ROOM": "http://127.0.0.1:8787/services/camviz-class/"}

The hub says who may open the teacher's page: its administrators, and the members of the group `teachers`
(CAMVIZ_TEACHERS names another). At `…/services/camviz-class/lead` they sign in, and come to the teacher's page with its
key. Students need no account: they join with the room's word. Tried with JupyterHub 6.1 and configurable-http-proxy.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from camviz_school.course.questions import questions
from camviz_school.room.server import Guarded, House, application, listen
from camviz_school.room.site import Site
from camviz_school.room.store import Room, RoomError

NEEDED = ("JUPYTERHUB_SERVICE_PREFIX", "JUPYTERHUB_SERVICE_URL", "JUPYTERHUB_API_URL", "JUPYTERHUB_API_TOKEN")


def may_lead(user: Mapping[str, Any], group: str = "teachers") -> bool:
    """Whether the hub's user may open the teacher's page: an administrator, or a member of the group.

    >>> may_lead({"name": "ada", "admin": False, "groups": ["teachers"]})
    True
    >>> may_lead({"name": "bob", "admin": False, "groups": ["students"]})
    False
    """
    return user.get("admin") is True or group in (user.get("groups") or ())


def routes(house: House) -> list[Any]:
    """The address at which a teacher signs in, and the one to which the hub sends them back."""
    from jupyterhub.services.auth import HubOAuthCallbackHandler, HubOAuthenticated
    from tornado.web import authenticated

    class Leads(HubOAuthenticated, Guarded):
        @authenticated
        def get(self) -> None:
            if not may_lead(self.get_current_user(), os.environ.get("CAMVIZ_TEACHERS", "teachers")):
                raise RoomError(403, "Only the hub's administrators and teachers lead a room.")
            self.redirect(f"teacher#{self.house.room.teacher_key}")

    return [(r"lead", Leads, {"house": house}), (r"oauth_callback", HubOAuthCallbackHandler)]


def service(environment: Mapping[str, str]) -> tuple[str, str, int]:
    """(prefix, host, port) that the hub tells its service. Raises ValueError naming what it does not tell."""
    if missing := [name for name in NEEDED if not environment.get(name)]:
        raise ValueError(f"expected to be started by a JupyterHub, which sets {', '.join(missing)}")
    url = urlsplit(environment["JUPYTERHUB_SERVICE_URL"])
    if not url.hostname or not url.port:
        raise ValueError(
            f"expected a service with an address and a port, got {environment['JUPYTERHUB_SERVICE_URL']!r}"
        )
    return f"/{environment['JUPYTERHUB_SERVICE_PREFIX'].strip('/')}/", url.hostname, url.port


async def serve(lessons: list[str], environment: Mapping[str, str], folder: Path) -> None:
    """Serve the room of a folder, for ever; one that has ended gives way to a new one."""
    prefix, host, port = service(environment)
    site = Site(Path(environment["CAMVIZ_CLASS_SITE"])) if environment.get("CAMVIZ_CLASS_SITE") else None
    asked = [one for lesson in lessons for one in questions(lesson).values()]
    room = Room.of(folder, asked, days=float(environment.get("CAMVIZ_CLASS_DAYS", "14")))
    address = environment.get("CAMVIZ_CLASS_ADDRESS", f"http://{host}:{port}{prefix}")
    house = House(room, address, behind_proxy=True, site=site)
    app = application(house, prefix, more=routes(house))
    app.settings["cookie_secret"] = os.urandom(32)  # of the hub's own sign-in; students have no cookie
    listen(app, house, host, port)
    await asyncio.Event().wait()


def main() -> int:
    """The command; 2 where the hub's environment is not there."""
    parser = argparse.ArgumentParser(prog="python -m camviz_school.room.hub", description=__doc__.splitlines()[0])
    parser.add_argument("lesson", metavar="LESSON", nargs="+", help="such as 05")
    try:
        asyncio.run(serve(parser.parse_args().lesson, os.environ, Path.cwd()))
    except (ValueError, RoomError) as error:
        print(f"camviz_school.room.hub: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
