"""What a text that is no known calibration looks like, for the sentence that refuses it."""

from __future__ import annotations

import re

from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import XML_ROOTS, shown

_TABLE = re.compile(r"^[ \t]*\[{1,2}[\w. \"'-]{1,200}\]{1,2}[ \t]*(?:#[^\n]*)?\r?$", re.MULTILINE)
_TOML = re.compile(r"^[ \t]*[\w.\"'-]{1,200}[ \t]+=[ \t]+(?:[\[\"'{]|true|false)", re.MULTILINE)
_INI = re.compile(r"^[ \t]*[\w. -]{1,200}[=:]", re.MULTILINE)
_TAG = re.compile(r"<([A-Za-z_][\w:.-]{0,60})")
_NUMBERS = re.compile(r"[-+.\d][-+.\deE]*(?:[ \t,;]+[-+.\d][-+.\deE]*)*[ \t,;]*")
_CODE = re.compile(r"^(?:import |from \w+ import |def |class |#include|function |using |package )", re.MULTILINE)


def looks_like(text: str) -> str:
    """A few words for the kind of text that this is.

    >>> looks_like("[camera]\\nmatrix = [[500, 0, 320]]"), looks_like("<rig><camera/></rig>")
    ('TOML', 'XML of another program (<rig>)')
    """
    head = text[:HEAD].lstrip()
    if head.startswith("<"):
        return _xml(head)
    if re.search(r"^%YAML", head, re.MULTILINE) or "!!opencv-" in head:
        return "OpenCV's YAML"
    if head.startswith(("{", "[")) and not _TABLE.match(head):
        return "JSON"
    if _TOML.search(head):
        return "TOML"
    if _TABLE.search(head) and _INI.search(head):
        return "INI"
    if _CODE.search(head):
        return "a program's source"
    lines = [line.strip() for line in head.splitlines()[:20] if line.strip()]
    if lines and sum(bool(_NUMBERS.fullmatch(line)) for line in lines) > len(lines) / 2:
        return "a table of numbers"
    return "YAML" if re.search(r"^[ \t-]*[\w.\"'/ -]{1,200}:(?:[ \t\r]|$)", head, re.MULTILINE) else "plain text"


def _xml(head: str) -> str:
    if re.search("<html|<!doctype html", head, re.IGNORECASE):
        return "a page of HTML"
    root = _TAG.search(head)
    if root and root[1] not in XML_ROOTS:
        return f"XML of another program (<{root[1]}>)"
    return "XML" if root is None else f"XML in {shown(f'<{root[1]}>')[1:-1]}"
