"""Python literals, as mrcal writes them: parsed by Python, which runs nothing of them, within bounds."""

from __future__ import annotations

import ast
import re
import warnings
from itertools import accumulate
from typing import Any

from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.trees import MAX_DEPTH, shown

MOST_CHARACTERS = 2**18  # beside comments and long strings; the tree takes 450 bytes and 2 µs for each (Python 3.11)
LONG = 1000  # characters; mrcal's optimization inputs, which nothing here reads, are a string of millions
_TEXT = r"""[bBuUrR]{0,2}(?:'[^'\\\n]*+(?:\\.[^'\\\n]*+)*+'?|"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+"?)"""
_PART = re.compile(rf"\#[^\n]*|(?P<text>{_TEXT})")  # a quote that nothing closes ends its line: linear on any text


def parse_literal(text: str) -> Any:
    """The tree of a Python literal of dicts, lists, strings and numbers; CalibrationError naming the line.

    Tuples become lists, and strings of more than 1000 characters become empty.

    >>> parse_literal("{'imagersize': (640, 480)}  # width and height")
    {'imagersize': [640, 480]}
    """
    brackets = re.finditer(r"[\[({]|[\])}]", _PART.sub("", text))
    if any(depth > MAX_DEPTH for depth in accumulate(1 if bracket[0] in "[({" else -1 for bracket in brackets)):
        raise CalibrationError(f"nested more than {MAX_DEPTH} levels deep, which no calibration is")
    text = _PART.sub(_short, text)
    if len(text) > MOST_CHARACTERS:
        raise CalibrationError(f"expected a literal of at most {MOST_CHARACTERS:,} characters, got {len(text):,}")
    try:
        with warnings.catch_warnings(action="ignore"):  # of escapes in strings, on stderr
            return _plain(ast.parse(f"({text}\n)", mode="eval").body, text)
    except SyntaxError as error:
        raise CalibrationError(f"line {error.lineno}: expected a Python literal ({error.msg})") from None
    except (ValueError, MemoryError, RecursionError) as error:
        if isinstance(error, CalibrationError):
            raise
        raise CalibrationError(f"expected a Python literal of numbers, strings and brackets ({error})") from None


def _short(part: re.Match[str]) -> str:
    text = part["text"] or ""
    return text if len(text) <= LONG else "''"


def _plain(node: ast.expr, text: str) -> Any:
    """What a node says, without names, calls and operators."""
    match node:
        case ast.List(elts=items) | ast.Tuple(elts=items):
            return [_plain(item, text) for item in items]
        case ast.Dict(keys=keys, values=values):
            return _mapping([_plain(key, text) for key in keys if key], [_plain(value, text) for value in values], node)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as value)):
            return -value
        case ast.Constant(value=bytes(value)):
            return value.decode("latin-1")
        case ast.Constant(value=str() | float() | None as value):
            return value
        case ast.Constant(value=int(value)) if abs(value) < 10**18:
            return value
    got = shown(ast.get_source_segment(f"({text}\n)", node))
    raise CalibrationError(f"line {node.lineno}: expected a number, a string, None, True or False, got {got}")


def _mapping(keys: list[Any], values: list[Any], node: ast.expr) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for key, value in zip(keys, values, strict=True):  # ValueError for **words, which are no keys
        if not isinstance(key, str):
            raise CalibrationError(f"line {node.lineno}: expected a string as the key of a mapping, got {shown(key)}")
        if key in made:
            raise CalibrationError(f"line {node.lineno}: the key {shown(key)} appears twice")
        made[key] = value
    return made
