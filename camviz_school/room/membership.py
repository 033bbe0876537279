"""The way from a notebook or a terminal into a room: `camviz_school.join("prism-4817", "http://192.168.4.1:8787")`.

Joining asks the room for a random token and keeps it for this user until the room ends, so that every notebook on the
machine finds it. What is sent afterwards is a question's name, the round and the number of a choice, and nothing else.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from http.client import HTTPException
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import quote, urlsplit
from urllib.request import ProxyHandler, Request, build_opener

from camviz_school.room.address import LOOPBACK, PORT

ENVIRONMENT = "CAMVIZ_ROOM"
"""Names the address of a class's room where nobody need type it, as on a JupyterHub."""

PATIENCE_S = 3.0
MOST_BYTES = 200_000
OVER = (401, 410)
"""What a server answers to a token that it does not know, or not any more."""


class NotReachedError(OSError):
    """The room does not answer."""


class RefusedError(ValueError):
    """The room says no, in one sentence."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


@dataclass(frozen=True)
class Membership:
    """What lets this user vote in a room: its `address`, `word`, a random `token`, and when it `ends` (Unix time)."""

    address: str
    word: str
    token: str
    ends: float

    def __repr__(self) -> str:
        return f"in the room {self.word} at {self.address}; camviz join --leave leaves it"

    def state(self, seen: str = "", patience: float = PATIENCE_S) -> dict[str, Any]:
        """What the room shows to this student; with `seen`, once there is something new."""
        return _answer(f"{self.address}api/state?seen={quote(seen)}", self.token, patience=patience)

    def vote(self, question: str, vote_round: int, choice: int) -> dict[str, Any]:
        """Send a choice, counted from 0. Raises RefusedError where it is not counted."""
        told = {"question": question, "round": vote_round, "choice": choice}
        return _answer(f"{self.address}api/vote", self.token, told)


def join(word: str, address: str = "") -> Membership:
    """Join the room that has this word, and keep the way in for this user's notebooks, in place of another.

    Args:
        word: What the projector shows; a whole link such as `http://192.168.4.1:8787/#prism-4817` can stand in its
            place.
        address: What the projector shows; without it CAMVIZ_ROOM says it, else it is this machine.

    Returns: Where, with which word, and until when.

    Raises:
        RefusedError: For a wrong word.
        NotReachedError: Where no room answers.

    >>> try:
    ...     join("prism-4817", "http://127.0.0.1:9")
    ... except OSError as error:
    ...     print(type(error).__name__)
    NotReachedError
    """
    if "#" in word:
        address, _, word = word.partition("#")
    where = _tidied(address or os.environ.get(ENVIRONMENT) or f"http://{LOOPBACK}:{PORT}/")
    told = _answer(f"{where}api/join", "", {"word": word})
    joined = Membership(where, str(told["word"]), str(told["token"]), float(told["ends"]))
    path = _path()
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
        json.dump(asdict(joined), file)
    return joined


def membership() -> Membership | None:
    """The room that this user is in; None without one, and when its time is over."""
    try:
        kept = Membership(**json.loads(_path().read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
    if kept.ends > time.time():
        return kept
    forget()
    return None


def leave() -> Membership | None:
    """Leave the room: forget the token here and, where the room is reached, there. The room that it was, or None."""
    left = membership()
    if left:
        with suppress(NotReachedError, RefusedError):
            _answer(f"{left.address}api/join", left.token, method="DELETE")
        forget()
    return left


def forget() -> None:
    """Delete what lets this user vote."""
    _path().unlink(missing_ok=True)


def _path() -> Path:
    import pooch

    return Path(pooch.os_cache("camviz")) / "room.json"


def _tidied(address: str) -> str:
    """An address as it is typed, "192.168.4.1:8787", as a link to the room's folder."""
    link = address.strip() if "://" in address else f"http://{address.strip()}"
    parts = urlsplit(link)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise RefusedError(400, f"expected the room's address, such as http://192.168.4.1:8787, got {address!r}")
    return f"{parts.scheme}://{parts.netloc}{parts.path.rstrip('/')}/"


def _answer(
    url: str, token: str, told: dict[str, Any] | None = None, patience: float = PATIENCE_S, method: str | None = None
) -> dict[str, Any]:
    """The server's JSON. No proxy is asked: a room is in the same network."""
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {token}"} if token else {})
    data = None if told is None else json.dumps(told).encode()
    opener = build_opener(ProxyHandler({}))
    try:
        with opener.open(Request(url, data=data, headers=headers, method=method), timeout=patience) as response:
            status, body = response.status, response.read(MOST_BYTES)
    except HTTPError as refused:
        status, body = refused.code, refused.read(MOST_BYTES)
    except (OSError, HTTPException, ValueError) as error:
        raise NotReachedError(f"no room answers at {urlsplit(url).netloc} ({error})") from error
    try:
        answer = dict(json.loads(body))
    except (ValueError, TypeError) as error:
        raise NotReachedError(f"what answers at {urlsplit(url).netloc} is no room of camviz") from error
    if status != 200:
        raise RefusedError(status, str(answer.get("problem", f"the room says {status}")))
    return answer
