"""The pictures that saved outputs carry inside, as files of their own: each once, and fetched when it is near."""

from __future__ import annotations

import hashlib
import re
from base64 import b64decode
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

_IMAGE = re.compile(r"<img(?P<before>[^>]*?)src=\"(?P<address>data:image/[\w+]+;base64,[^\"]+)\"(?P<after>[^>]*)>")
_ENDINGS = {"svg+xml": "svg", "jpeg": "jpg", "png": "png"}


def outside(html: str, folder: Path, way: str) -> str:
    """The HTML with its inlined pictures in `folder`, named by their content; `way` leads there from the page."""

    def linked(found: re.Match[str]) -> str:
        path = kept(found["address"], folder)
        first = f'<img loading="lazy" decoding="async"{_size(path)}{found["before"]}'
        return f'{first}src="{way}/{path.name}"{found["after"]}>'

    return _IMAGE.sub(linked, html)


def kept(address: str, folder: Path) -> Path:
    """The file in `folder` with the picture of a data address, named by its content."""
    kind, _, data = address.removeprefix("data:image/").partition(";base64,")
    content = b64decode(data)
    path = folder / f"{hashlib.sha256(content).hexdigest()[:16]}.{_ENDINGS[kind]}"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return path


def _size(path: Path) -> str:
    """The width and height of a drawing as attributes of its image; "" for pixels."""
    if path.suffix != ".svg":
        return ""
    _, root = next(ElementTree.iterparse(BytesIO(path.read_bytes()), events=("start",)))
    return f' width="{root.get("width")}" height="{root.get("height")}"'
