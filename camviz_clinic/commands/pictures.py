"""The pictures that a command line names: files, folders and patterns, and how far looking through them is."""

from __future__ import annotations

import glob
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import Refusal

if TYPE_CHECKING:
    import numpy as np

PICTURES = re.compile(r"\.(bmp|dib|exr|hdr|jp2|jpe|jpeg|jpg|pbm|pgm|png|pnm|ppm|tif|tiff|webp)", re.IGNORECASE)


def pictures(words: Sequence[str], endings: re.Pattern[str] = PICTURES) -> list[Path]:
    """The files that words name: themselves, those of a folder, or those of a pattern; each once, in natural order.

    Of a folder those whose names end in one of `endings`.
    """
    found: dict[Path, None] = {}
    for word in words:
        if "\0" in word:
            raise Refusal(f"{word!r} is not a file name.")
        path = Path(word)
        if path.is_dir():
            paths = sorted((each for each in path.iterdir() if endings.fullmatch(each.suffix)), key=_natural)
            if not paths:
                raise Refusal(f"{path}: there are no pictures in this folder.")
        elif path.exists():
            paths = [path]
        else:
            paths = sorted(map(Path, glob.glob(word)), key=_natural)
            if not paths:
                what = "no picture fits this pattern" if glob.has_magic(word) else "there is no such picture or folder"
                raise Refusal(f"{word}: {what}.")
        found |= dict.fromkeys(paths)
    return list(found)


def _natural(path: Path) -> tuple[Any, ...]:
    """left2 before left10."""
    return tuple(int(part) if part.isdigit() else part for part in re.split(r"([0-9]+)", path.name.lower()))


def encoded(picture: np.ndarray, output: Path) -> bytes:
    """What a picture's file holds by the ending of its name; Refusal for pixels that such a file cannot hold."""
    import cv2
    import numpy as np

    if picture.dtype == np.uint16 and output.suffix.lower() not in (".png", ".tif", ".tiff"):
        picture = (picture >> 8).astype(np.uint8)
    try:
        done, data = cv2.imencode(output.suffix, picture)
    except cv2.error:
        done = False
    if not done:
        raise Refusal(f"{output}: {output.suffix} cannot hold {picture.dtype} pixels; choose .png or .tif.")
    return data.tobytes()


class Bar:
    """A bar on stderr, where that is a terminal, that grows with the pictures and goes when all is done."""

    WIDTH = 30

    def __init__(self, what: str = "pictures") -> None:
        self.what = what

    def __enter__(self) -> Bar:
        self.shown = sys.stderr.isatty()
        return self

    def __call__(self, done: int, count: int) -> None:
        if self.shown:
            full = self.WIDTH * done // count
            bar = "█" * full + "░" * (self.WIDTH - full)
            line = f"\r{bar} {done} of {count} {self.what}".encode(sys.stderr.encoding, "replace")
            print(line.decode(sys.stderr.encoding), end="", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self.shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
