"""What reaches the terminal: text that it can show and that cannot command it, with colour where a person looks."""

from __future__ import annotations

import json
import os
import re
import sys
import unicodedata
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, TextIO

PLAIN = str.maketrans({"✗": "x", "✓": "ok", "→": "->", "±": "+-", "×": "x", "−": "-", "–": "-", "’": "'", "…": "..."})
COLOURS = {"red": 31, "green": 32, "yellow": 33, "blue": 34}


def tell(text: str, paint: Mapping[str, str] | None = None, colour: str = "never") -> None:
    """Print lines; `paint` are patterns and the colours for what they match, where colour is wanted."""
    shown = writable(text, sys.stdout)
    if paint and wants_colour(colour, sys.stdout):
        for pattern, name in paint.items():
            shown = re.sub(pattern, rf"\033[{COLOURS[name]}m\g<0>\033[0m", shown, flags=re.MULTILINE)
    print(shown, flush=True)


def tell_json(text: str) -> None:
    """Print JSON; what cannot be shown is escaped, so that the values stay."""
    encoding = sys.stdout.encoding or "utf-8"
    print("".join(c if c == "\n" or _shows(c, encoding) else json.dumps(c)[1:-1] for c in text))


def say(sentence: str) -> None:
    """One line on stderr, whatever a file name or a key may hold."""
    with suppress(OSError):
        print(f"camviz: {' '.join(writable(sentence, sys.stderr).split())}", file=sys.stderr)


def writable(text: str, stream: TextIO) -> str:
    """The text with blanks for control characters, and a likeness of each character that a stream cannot encode."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return "".join(c if c == "\n" or _shows(c, encoding) else _likeness(c, encoding) for c in text)


def wants_colour(choice: str, stream: Any) -> bool:
    """Whether to colour: as told, else on a terminal that can, unless NO_COLOR is set (no-color.org)."""
    if choice != "auto":
        return choice == "always"
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _shows(c: str, encoding: str) -> bool:
    """Whether a character can be printed: encoded, and no command to a terminal."""
    try:
        c.encode(encoding)
    except UnicodeEncodeError:
        return False
    return c.isprintable()


def _likeness(c: str, encoding: str) -> str:
    if not c.isprintable() and not 0xD800 <= ord(c) <= 0xDFFF:
        return " "
    likeness = c.translate(PLAIN) if c.translate(PLAIN) != c else unicodedata.normalize("NFKD", c)
    shown = likeness.encode(encoding, "ignore").decode(encoding)
    return shown or c.encode("ascii", "backslashreplace").decode()
