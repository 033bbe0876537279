"""Python literals, as mrcal writes them: read like any other text, so that nothing is compiled and nothing recurses."""

from __future__ import annotations

import re

from camviz.calibration.types import CalibrationError
from camviz.files.trees import Tree, scalar, shown

_QUOTED = r"""[bBuUrR]{0,2}(?:'[^'\\\n]*+(?:\\.[^'\\\n]*+)*+'|"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+")"""
_TOKEN = re.compile(
    rf"(?P<space>[ \t\r\n\f]+|\#[^\n]*)|(?P<text>{_QUOTED})|(?P<open>[\[({{])|(?P<close>[\])}}])"
    r"|(?P<mark>[,:])|(?P<word>[-+.\w]+)"
)
_PARTNERS = {"[": "]", "(": ")", "{": "}"}
_WORDS = {"None": None, "True": True, "False": False}


def parse_literal(text: str) -> object:
    """The tree of a Python literal of dicts, lists, tuples, strings and numbers; CalibrationError naming the line."""
    reader, at = _Reader(), 0
    try:
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                raise CalibrationError(f"expected a Python literal, got {shown(text[at : at + 20])}")
            at = match.end()
            if match.lastgroup != "space":
                reader.take(str(match.lastgroup), match[0])
        return reader.result()
    except CalibrationError as error:
        line = text.count("\n", 0, at) + 1
        raise CalibrationError(f"line {line}: {error}") from None


class _Reader:
    """Tokens into a tree: after a value comes a comma or the end, after a key a colon."""

    def __init__(self) -> None:
        self.tree = Tree()
        self._closers: list[str] = []
        self._expects = "value"  # or "colon" or "comma"

    def take(self, kind: str, token: str) -> None:
        match kind:
            case "close":
                self._close(token)
            case "mark":
                self._mark(token)
            case _ if self._expects != "value" or (not self._closers and self.tree.documents):
                raise CalibrationError(f"expected a {self._expects}, got {shown(token)}")
            case "open":
                if self.tree.wants_key:
                    raise CalibrationError("expected a word as the key of a mapping, got a list or a mapping")
                self._closers.append(_PARTNERS[token])
                self.tree.begin({} if token == "{" else [])
            case _:
                self._value(_text(token) if kind == "text" else _word(token))

    def result(self) -> object:
        if self._closers:
            raise CalibrationError(f"expected {self._closers[-1]!r}, the file ends")
        return self.tree.documents[0] if self.tree.documents else None

    def _value(self, value: object) -> None:
        if self.tree.wants_key:
            self.tree.key(str(value))
            self._expects = "colon"
        else:
            self.tree.leaf(value)
            self._expects = "comma"

    def _mark(self, token: str) -> None:
        if self._expects != {",": "comma", ":": "colon"}[token] or not self._closers:
            raise CalibrationError(f"expected a {self._expects}, got {token!r}")
        self._expects = "value"

    def _close(self, token: str) -> None:
        if not self._closers or token != self._closers[-1] or self._expects == "colon" or self.tree.awaits_value:
            raise CalibrationError(f"expected a {self._expects}, got {token!r}")
        self._closers.pop()
        self.tree.end()
        self._expects = "comma"


def _text(token: str) -> str:
    start = min(token.index(quote) for quote in "'\"" if quote in token)
    return token[start + 1 : -1]


def _word(token: str) -> object:
    if token in _WORDS:
        return _WORDS[token]
    value = scalar(token)
    if isinstance(value, (int, float)):
        return value
    raise CalibrationError(f"expected a number, a string, None, True or False, got {shown(token)}")
