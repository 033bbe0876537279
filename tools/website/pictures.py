"""The pictures that saved outputs carry inside, as files of their own: each once, and fetched when it is near."""

from __future__ import annotations

import hashlib
import re
from base64 import b64decode
from pathlib import Path

_IMAGE = re.compile(
    r"<img(?P<before>[^>]*?)src=\"data:image/(?P<kind>[\w+]+);base64,(?P<data>[^\"]+)\"(?P<after>[^>]*)>"
)
_SIZE = re.compile(rb"<svg width=\"([\d.]+)\" height=\"([\d.]+)\"")
_ENDINGS = {"svg+xml": "svg", "jpeg": "jpg", "png": "png"}


def outside(html: str, folder: Path, way: str) -> str:
    """The HTML with its inlined pictures in `folder`, named by their content; `way` leads there from the page."""

    def kept(found: re.Match[str]) -> str:
        data = b64decode(found["data"])
        name = f"{hashlib.sha256(data).hexdigest()[:16]}.{_ENDINGS[found['kind']]}"
        if not (folder / name).exists():
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        size = _SIZE.search(data[:200])
        sized = f' width="{size[1].decode()}" height="{size[2].decode()}"' if size else ""
        return f'<img loading="lazy" decoding="async"{sized}{found["before"]}src="{way}/{name}"{found["after"]}>'

    return _IMAGE.sub(kept, html)
