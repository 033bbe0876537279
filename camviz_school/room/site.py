"""A built site as a room serves it, so that the questions on its pages can vote in the room.

A page with questions gets the room's script `pages/lesson.js` on its way out. The files themselves have nothing of it,
and so the published site offers no room. Only a site's kinds of files are served, and none from outside its folder.
"""

from __future__ import annotations

import asyncio
import gzip
import hashlib
import re
from base64 import b64encode
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".ipynb": "application/json; charset=utf-8",
    ".jpg": "image/jpeg",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
    ".webp": "image/webp",
    ".woff2": "font/woff2",
}
"""The kinds of files that are served."""

MOST_FILE = 20_000_000
MOST_KEPT = 64_000_000
"""Bytes of files that are kept in memory, packed: a lesson with all its recordings takes some five million."""

SELF = "'self'"
_PACKED = (".jpg", ".png", ".webp", ".woff2")
_QUESTIONS = '<div class="camviz-asked">'
_SCRIPT = re.compile(r"<script(?![^>]*\ssrc=)[^>]*>(.*?)</script>", re.DOTALL | re.IGNORECASE)


@dataclass(frozen=True)
class Served:
    """A file as it goes out: its bytes, packed by gzip where that makes them fewer, its type, and its policy."""

    body: bytes
    packed: bytes | None
    type: str
    policy: str
    etag: str


@dataclass
class Site:
    """The built site in a folder. Raises ValueError for a folder without a first page."""

    folder: Path
    _kept: OrderedDict[tuple[Path, int, int], Served] = field(default_factory=OrderedDict)
    _one_at_a_time: asyncio.Lock = field(default_factory=asyncio.Lock)

    def __post_init__(self) -> None:
        self.folder = self.folder.resolve()
        if not (self.folder / "index.html").is_file():
            raise ValueError(f"expected the folder of a built site, there is no index.html in {self.folder}")
        self._lessons = {path.name[:2]: path.name for path in sorted(self.folder.glob("lessons/[0-9][0-9]_*.html"))}

    def lesson(self, number: str) -> str:
        """The address of a lesson's page below the room's; the first page where there is none."""
        return f"site/lessons/{self._lessons[number]}" if number in self._lessons else "site/index.html"

    def find(self, way: str) -> Path | None:
        """The file at an address below the site's, or None; also for a link that leads elsewhere, and a hidden file."""
        parts = (f"{way}index.html" if way.endswith("/") or not way else way).split("/")
        if not all(map(_is_plain, parts)):
            return None
        try:
            path = self.folder.joinpath(*parts).resolve(strict=True)
            inside = path.relative_to(self.folder)
            served = path.is_file() and path.stat().st_size <= MOST_FILE
        except (OSError, ValueError):
            return None
        return path if served and path.suffix in TYPES and all(map(_is_plain, inside.parts)) else None

    async def read(self, path: Path) -> Served:
        """A file that was found, prepared once and then kept as long as there is room. Raises OSError."""
        async with self._one_at_a_time:
            told = path.stat()
            place = (path, told.st_mtime_ns, told.st_size)
            if place not in self._kept:
                depth = len(path.relative_to(self.folder).parts)
                self._kept[place] = await asyncio.to_thread(_prepared, path, "../" * depth)
            self._kept.move_to_end(place)
            while len(self._kept) > 1 and sum(map(_size, self._kept.values())) > MOST_KEPT:
                self._kept.popitem(last=False)
            return self._kept[place]


def policy(page: str = "") -> str:
    """What a page may load and run: its own origin's files, and of scripts within it those it was built with.

    What is recorded is shown by the notebook's own module, which `replay.js` loads from a blob.
    """
    scripts = [_hashed(script.replace("\r\n", "\n")) for script in dict.fromkeys(_SCRIPT.findall(page))]
    return (
        f"default-src 'none'; script-src {' '.join((SELF, *scripts))} blob:; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )


def with_room(page: str, up: str) -> str:
    """A page with questions and the script that lets them vote; `up` leads to the room. Other pages as they are."""
    if _QUESTIONS not in page:
        return page
    page = page.replace("</head>", f'<link rel="stylesheet" href="{up}static/lesson.css">\n</head>', 1)
    before, end, after = page.rpartition("</body>")  # after the site's own script, on which the room's builds
    return f'{before}<script type="module" src="{up}static/lesson.js"></script>\n{end}{after}' if end else page


def _prepared(path: Path, up: str) -> Served:
    body, allowed = path.read_bytes(), policy()
    if path.suffix == ".html":
        page = body.decode(errors="surrogateescape")
        allowed = policy(page)
        body = with_room(page, up).encode(errors="surrogateescape")
    packed = (
        None if TYPES[path.suffix].startswith(("image/webp", "image/png", "image/jpeg", "font/")) else _packed(body)
    )
    return Served(body, packed, TYPES[path.suffix], allowed, f'"{hashlib.sha256(body).hexdigest()[:32]}"')


def _packed(body: bytes) -> bytes | None:
    packed = gzip.compress(body, 6, mtime=0)
    return packed if len(packed) < len(body) else None


def _size(served: Served) -> int:
    return len(served.body) + len(served.packed or b"")


def _hashed(script: str) -> str:
    digest = hashlib.sha256(script.encode(errors="surrogateescape")).digest()
    return f"'sha256-{b64encode(digest).decode()}'"


def _is_plain(part: str) -> bool:
    """Whether a part of an address names a file or a folder that is not hidden, on every system."""
    return bool(part) and not part.startswith(".") and part.isprintable() and not set(part) & set('\\:*?"<>|')
