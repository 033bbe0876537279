"""The package's docstrings for Sphinx: they are plain text, in which |t| and ΔE*ab are mathematics and not markup."""

from __future__ import annotations

import inspect
import re
import sys
from itertools import takewhile
from typing import Annotated, Any, get_origin

from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, NumpyDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.inspect import stringify_signature
from sphinx.util.typing import stringify_annotation

_KEPT = re.compile(r"``.*?``|`[^`]*`|:\w+:`[^`]*`|\*\*?(?=\w)[^*]*\w\*\*?(?!\w)|https?://\S+")
_MARKUP = re.compile(r"(?<!\\)(\||\*|(?<=\w)_(?!\w))")
_UNDERLINE = re.compile(r" *-{3,}")
_HEAD = re.compile(r"(Args|Attributes|Returns|Yields|Raises|Source):(?: (.*))?")
_NAMED = re.compile(r"([\w\\*]+(?:, [\w\\*]+)*): ")


def setup(app: Sphinx) -> dict[str, Any]:
    """Make each docstring a page's text, and show types as they are written."""
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _process(_app: Any, what: str, name: str, value: Any, _options: Any, lines: list[str]) -> None:
    if what == "data":
        lines[:] = of_constant(name, value)
    is_of_scipy = any(_UNDERLINE.fullmatch(line) for line in lines)
    lines[:] = of_numpydoc(name, lines) if is_of_scipy else as_page(lines) + of_arrays(value)


def _signature(_app: Any, _what: str, _name: str, value: Any, *_rest: Any) -> tuple[str, str | None] | None:
    """Types as the source writes them: Sphinx would follow each to its end, and ArrayLike alone take three lines."""
    try:
        said = inspect.signature(value)
    except (TypeError, ValueError):  # such as a constant
        return None
    given = [one for name, one in said.parameters.items() if name not in ("self", "cls")]
    returned = None if said.return_annotation is said.empty or inspect.isclass(value) else said.return_annotation
    bare = said.replace(parameters=given, return_annotation=said.empty)
    return stringify_signature(bare), None if returned is None else stringify_annotation(returned)


def of_arrays(value: Any) -> list[str]:
    """What the names for arrays in a function's signature say of shape and unit, as a field below its docstring.

    >>> import camviz
    >>> of_arrays(camviz.Intrinsics.to_pixels)[-2:]
    ['    * ``Pixels`` – (..., 2), pixels (u, v), whose centres are integers.', '']
    """
    try:
        said = inspect.signature(value)
    except (TypeError, ValueError):  # such as a constant
        return []
    module = vars(sys.modules.get(getattr(value, "__module__", ""), sys))
    names = dict.fromkeys(str(each.annotation) for each in said.parameters.values())
    names |= {str(said.return_annotation): None}
    aliases = {name: module[name] for name in names if get_origin(module.get(name)) is Annotated}
    items = [f"    * ``{name}`` – {alias.__metadata__[0]}" for name, alias in aliases.items()]
    return ["", ":Arrays:", *items, ""] if items else []


def of_numpydoc(name: str, lines: list[str]) -> list[str]:
    """What SciPy says of its rotations, without the list of methods, which follow it.

    Its references have numbers within each docstring, of which a page has many.
    """
    text = re.sub(r"^Methods\n-+\n.*?\n(?=\S[^\n]*\n-+$)", "", "\n".join(lines), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"(?<=^\.\. \[)(?=\d+\])|(?<=\[)(?=\d+\]_)", f"#{name}-", text, flags=re.MULTILINE)
    return NumpyDocstring(re.sub(r":ref:(?=`)", "", text), Config(napoleon_use_ivar=True)).lines()


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


def as_page(lines: list[str]) -> list[str]:
    """A docstring as reStructuredText, each of its sections as a field.

    sphinx.ext.napoleon takes the words before a colon for a type, in what a property is and in what a function returns.

    >>> as_page(["The sum.", "", "Args:", "    a, b: In mm.", "Returns: In mm: exact."])
    ['The sum.', '', ':Parameters:', '    * **a, b** – In mm.', '', ':Returns: In mm: exact.', '']
    """
    made: list[str] = []
    rest = escaped(lines)
    while rest:
        line = rest.pop(0)
        if not (head := _HEAD.fullmatch(line)):
            made.append(line)
            continue
        title, first = head.groups()
        belongs = bool if title == "Source" else _is_indented
        body = list(takewhile(belongs, rest))
        del rest[: len(body)]
        made += [""] * (made[-1] != "")
        made += _field(title, [first] * bool(first) + [one.removeprefix("    ") for one in body])
    return made


def _is_indented(line: str) -> bool:
    return line.startswith(" ")


def _field(title: str, body: list[str]) -> list[str]:
    """What is said of one thing, or a list where each has its name."""
    if title == "Raises" and not _NAMED.match(body[0]):  # Raises: ValueError for another shape.
        name, clause = body[0].split(" ", 1)
        body = [f"{name}: {clause[:1].upper()}{clause[1:]}"]
    label = "Parameters" if title == "Args" else title
    named = all(line.startswith(" ") or _NAMED.match(line) for line in body)
    if title == "Source" or (title in ("Returns", "Yields") and not (named and len(body) > 1)):
        first = re.sub(r"^(\w)\. ", r"\1\\. ", body[0])  # S. F. Ray is no list that begins with S
        return [f":{label}: {first}", *(f"    {line}" for line in body[1:]), ""]
    items = [
        f"      {line.strip()}" if _is_indented(line) else _NAMED.sub(r"    * **\1** – ", line, count=1)
        for line in body
    ]
    return [f":{label}:", *items, ""]


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
