"""The package's docstrings for Sphinx: they are plain text, in which |t| and ΔE*ab are mathematics and not markup."""

from __future__ import annotations

import re
import sys
from typing import Any

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

_KEPT = re.compile(r"``.*?``|`[^`]*`|:\w+:`[^`]*`|\*\*?(?=\w)[^*]*\w\*\*?(?!\w)|https?://\S+")
_MARKUP = re.compile(r"(?<!\\)(\||\*|(?<=\w)_(?!\w))")


def setup(app: Sphinx) -> dict[str, Any]:
    """Escape before numpydoc reads."""
    app.connect("autodoc-process-docstring", _process, priority=300)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _process(_app: Any, what: str, name: str, value: Any, _options: Any, lines: list[str]) -> None:
    lines[:] = escaped(of_constant(name, value) if what == "data" else lines)


def of_constant(name: str, value: Any) -> list[str]:
    """What is said of a constant where it is assigned; Sphinx, asked for the part that offers it, tells of its type.

    >>> import camviz.colour
    >>> of_constant("camviz.colour.WAVELENGTHS_NM", camviz.colour.WAVELENGTHS_NM)[0]
    'The wavelengths (81,) of all spectra here, in nanometres: 380 … 780 in steps of 5; read-only.'
    """
    part, _, own = name.rpartition(".")
    for module in [one for one in sys.modules if f"{one}.".startswith(f"{part}.")]:
        if vars(sys.modules[module]).get(own) is value:
            said = ModuleAnalyzer.for_module(module).find_attr_docs()
            if ("", own) in said:
                return said["", own]
    return []


def escaped(lines: list[str]) -> list[str]:
    """The lines with what only looks like markup escaped; examples stay as they are."""
    blocks: list[tuple[bool, list[str]]] = []
    for line in lines:
        before = blocks[-1][0] if blocks else False
        example = line.lstrip().startswith(">>>") or (before and line.strip() != "")
        if not blocks or example != before:
            blocks.append((example, []))
        blocks[-1][1].append(line)
    return [line for example, block in blocks for line in (block if example else _outside_markup(block))]


def _outside_markup(lines: list[str]) -> list[str]:
    """Markup may go over several lines."""
    text, place, parts = "\n".join(lines), 0, []
    for kept in _KEPT.finditer(text):
        joined = "\\ " if text[kept.end() : kept.end() + 1].isalnum() else ""  # `Camera`s: a letter may not follow
        parts += [_MARKUP.sub(r"\\\1", text[place : kept.start()]), kept[0] + joined]
        place = kept.end()
    return "".join([*parts, _MARKUP.sub(r"\\\1", text[place:])]).split("\n")
