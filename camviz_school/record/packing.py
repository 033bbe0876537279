"""How frames are stored: texts in shared pieces, photographs once each as files of their own.

From one position of a slider to the next most of a picture stays as it is. A text is split at its tags; each piece is
kept once, and the text is a list of runs of pieces. What is left, the server's gzip compresses.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from camviz_clinic.report import pictures

SHORT = 100  # characters: a shorter text is stored as it is
QUALITY = 75  # of WebP, for photographs; drawings (PNG) keep every pixel
_EFFORT = 2  # of 6, in making WebP smaller: twice as quick as the usual 4, and some 4 % larger


@dataclass(frozen=True)
class Fitted:
    """A text that is written differently where its tile is shown small: the texts by picture units a CSS pixel."""

    name: str
    texts: Mapping[float, str]


@dataclass(frozen=True)
class Joined:
    """A text in parts, some of them `Fitted`."""

    parts: tuple[str | Fitted, ...]


@dataclass(frozen=True)
class Photograph:
    """A picture in a file of its own, by the file's name."""

    name: str


class Images:
    """Pictures as WebP files, each once and named by its content; `write` writes them."""

    def __init__(self) -> None:
        self.data: dict[str, bytes] = {}
        self._names: dict[bytes, str] = {}

    def stored(self, value: Any) -> Any:
        """The value with each JPEG or PNG in it as a `Photograph`."""
        match value:
            case bytes() | memoryview():
                return Photograph(self._name(bytes(value)))
            case dict():
                return {name: self.stored(one) for name, one in value.items()}
            case list() | tuple():
                return [self.stored(one) for one in value]
        return value

    def write(self, names: Iterable[str], folder: Path) -> None:
        """Write the files of these names."""
        for name in names:
            (folder / name).write_bytes(self.data[name])

    def _name(self, data: bytes) -> str:
        digest = sha256(data).digest()
        if digest not in self._names:
            made = webp(data)
            name = self._names[digest] = f"{hashed(made)}.webp"
            self.data[name] = made
        return self._names[digest]


class Pack:
    """Frames on their way into a file: JSON that `replay.js` unpacks, and the images that it names."""

    def __init__(self) -> None:
        self.images: dict[str, None] = {}
        self._pieces: dict[str, int] = {}

    def packed(self, value: Any) -> Any:
        """A value as JSON: long texts as runs of pieces."""
        match value:
            case str():
                return value if len(value) < SHORT else {"$text": self._runs(value)}
            case Photograph(name):
                self.images[name] = None
                return {"$image": name}
            case Fitted(name, texts):
                return {"$tile": name, "units": list(texts), "texts": [self.packed(one) for one in texts.values()]}
            case Joined(parts):
                return {"$joined": [self.packed(one) for one in parts]}
            case Mapping():
                return {name: self.packed(one) for name, one in value.items()}
            case list() | tuple():
                return [self.packed(one) for one in value]
        return value

    @property
    def pieces(self) -> list[str]:
        """Every piece, by its number."""
        return list(self._pieces)

    def _runs(self, text: str) -> list[int]:
        """First piece and count, first piece and count …: pieces that stay together have numbers in a row."""
        runs: list[int] = []
        before, *tags = text.split("<")
        for piece in [before] * bool(before) + [f"<{tag}" for tag in tags]:
            number = self._pieces.setdefault(piece, len(self._pieces))
            if runs and runs[-2] + runs[-1] == number:
                runs[-1] += 1
            else:
                runs += [number, 1]
        return runs


def webp(data: bytes) -> bytes:
    """A JPEG or PNG as WebP; what was a PNG keeps every pixel."""
    return pictures.webp(data, QUALITY, _EFFORT)


def hashed(data: bytes) -> str:
    """The name of what has this content."""
    return sha256(data).hexdigest()[:16]


def script(content: Any) -> tuple[str, bytes]:
    """Content as a script that hands it to `replay.js`, and the name of its file.

    A page that was opened as a file may load scripts, and may not fetch JSON.
    """
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    name = f"{hashed(text.encode())}.js"
    return name, f'camvizRecorded("{name}",{text});\n'.encode()


def transferred(data: bytes) -> int:
    """Bytes of a script or drawing on its way to a reader, compressed as servers do (gzip)."""
    return len(gzip.compress(data, 6))
