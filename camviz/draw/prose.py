"""Short prose with ``code`` and *emphasis*, as safe HTML or as plain text: questions, verdicts and the glossary."""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape
from itertools import zip_longest

_CODE = re.compile(r"``(.+?)``|`([^`]+)`")
_EMPHASIS = re.compile(r"\*(?=\S)([^*\n]+?)(?<=\S)\*")


def to_html(text: str) -> str:
    """Paragraphs of escaped HTML; `code` becomes <code>, *emphasis* <em>, and nothing else in the text is markup."""
    return "".join(f"<p>{inline(paragraph)}</p>" for paragraph in paragraphs(text))


def inline(text: str) -> str:
    """One line of escaped HTML, without the paragraph around it; inside `code`, asterisks are multiplication signs."""
    return _told_apart(text, lambda words: _EMPHASIS.sub(r"<em>\1</em>", escape(words)), _html_code)


def to_plain(text: str) -> str:
    """The same text for a terminal: emphasis loses its asterisks, code keeps its backticks, lines are joined."""
    lines = (_told_apart(line, lambda words: _EMPHASIS.sub(r"\1", words), "`{}`".format) for line in paragraphs(text))
    return "\n".join(lines)


def paragraphs(text: str) -> list[str]:
    """The text's paragraphs, each on one line."""
    return [" ".join(part.split()) for part in re.split(r"\n\s*\n", text.strip()) if part.strip()]


def _told_apart(text: str, words: Callable[[str], str], code: Callable[[str], str]) -> str:
    """The text with `words` done to what is no code, and `code` to what stands between backticks."""
    pieces = _CODE.split(text)  # words, then what one pattern or the other holds of the code, and so on
    shown = [code(double or single) for double, single in zip(pieces[1::3], pieces[2::3], strict=True)]
    return "".join(words(piece) + after for piece, after in zip_longest(pieces[::3], shown, fillvalue=""))


def _html_code(code: str) -> str:
    return f"<code>{escape(code)}</code>"
