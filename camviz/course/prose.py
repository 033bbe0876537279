"""Short prose with ``code`` and *emphasis*, as safe HTML or as plain text: questions, verdicts and the glossary."""

from __future__ import annotations

import re
from html import escape

_CODE = re.compile(r"``(.+?)``|`([^`]+)`")
_EMPHASIS = re.compile(r"\*(?=\S)([^*\n]+?)(?<=\S)\*")


def to_html(text: str) -> str:
    """Paragraphs of escaped HTML; `code` becomes <code>, *emphasis* <em>, and nothing else in the text is markup."""
    return "".join(f"<p>{inline(paragraph)}</p>" for paragraph in paragraphs(text))


def inline(text: str) -> str:
    """One line of escaped HTML, without the paragraph around it; inside `code`, asterisks are multiplication signs."""
    pieces, end = [], 0
    for code in _CODE.finditer(text):
        pieces += [_emphasise(text[end : code.start()]), f"<code>{escape(code[1] or code[2])}</code>"]
        end = code.end()
    return "".join([*pieces, _emphasise(text[end:])])


def to_plain(text: str) -> str:
    """The same text for a terminal: emphasis loses its asterisks, code keeps its backticks, lines are joined."""
    return "\n".join(_plain_line(paragraph) for paragraph in paragraphs(text))


def paragraphs(text: str) -> list[str]:
    """The text's paragraphs, each on one line."""
    return [" ".join(part.split()) for part in re.split(r"\n\s*\n", text.strip()) if part.strip()]


def _plain_line(text: str) -> str:
    pieces, end = [], 0
    for code in _CODE.finditer(text):
        pieces += [_EMPHASIS.sub(r"\1", text[end : code.start()]), code[0].replace("``", "`")]
        end = code.end()
    return "".join([*pieces, _EMPHASIS.sub(r"\1", text[end:])])


def _emphasise(text: str) -> str:
    return _EMPHASIS.sub(r"<em>\1</em>", escape(text))
