"""The glossary: one or two correct sentences for each term, with its formula and the lessons that use it.

    from camviz_school.course.glossary import glossary, term

Its terms stand in lessons/material/glossary.toml. A lesson may bring terms of its own in material/NN/glossary.toml.
`python -m camviz_school.commands.lessons pages` writes docs/glossary.md anew.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any

from camviz.draw import prose
from camviz_school.course.material import lesson_paths, material
from camviz_school.course.tables import table_of


@dataclass(frozen=True)
class Term:
    """One entry. `also` are its other names, `lessons` the numbers of the lessons that use it ("05")."""

    name: str
    sentence: str
    formula: str = ""
    lessons: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    key: bool = False

    @property
    def anchor(self) -> str:
        """The entry's address on a page: "principal-point"."""
        return anchor(self.name)

    def __repr__(self) -> str:
        formula = f"\n    {self.formula}" if self.formula else ""
        return f"{self.name}: {prose.to_plain(self.sentence)}{formula}{_in_words(self.lessons)}"

    def _repr_html_(self) -> str:
        formula = f"<br><code>{escape(self.formula)}</code>" if self.formula else ""
        return (
            f'<dl><dt id="{self.anchor}"><strong>{escape(self.name)}</strong></dt>'
            f"<dd>{prose.inline(self.sentence)}{formula}{_in_words(self.lessons)}</dd></dl>"
        )


@dataclass(frozen=True)
class Glossary:
    """All entries in alphabetical order."""

    terms: tuple[Term, ...]

    def __repr__(self) -> str:
        return "\n".join(repr(one) for one in self.terms)

    def _repr_html_(self) -> str:
        return "".join(one._repr_html_() for one in self.terms)


@lru_cache
def glossary() -> Glossary:
    """The whole glossary."""
    own = [_term(one, path.parent.name) for path in sorted(material().glob("*/glossary.toml")) for one in _table(path)]
    entries = [*(_term(one) for one in _table(material("glossary.toml"))), *own]
    return Glossary(tuple(sorted(entries, key=lambda one: one.name.casefold())))


def term(name: str) -> Term:
    """The entry of that name, or of which it is another name. Raises ValueError suggesting the nearest ones."""
    known = _names()
    if name.casefold() not in known:
        near = get_close_matches(name.casefold(), known, n=3)
        suggestion = f"; perhaps {', '.join(known[one].name for one in near)}" if near else ""
        raise ValueError(f"the glossary has no entry {name!r}{suggestion}")
    return known[name.casefold()]


def anchor(name: str) -> str:
    """A heading's address as GitHub makes it: lower case, hyphens for spaces, no other punctuation."""
    return re.sub(r"[^\w\- ]", "", name.casefold()).replace(" ", "-")


def markdown(lessons: str = "") -> str:
    """The glossary as Markdown with an anchor at every entry; `lessons` is the way to the notebooks' folder."""
    return "\n\n".join(_entry(one, lessons) for one in glossary().terms) + "\n"


def page() -> str:
    """docs/glossary.md."""
    made = "<!-- Made from lessons/material/glossary.toml by: python -m camviz_school.commands.lessons pages -->"
    return f"# Glossary\n\n{made}\n\n{markdown('../lessons/')}"


def _entry(one: Term, lessons: str) -> str:
    formula = f" `{one.formula}`" if one.formula else ""
    links = ", ".join(_link(number, lessons) for number in one.lessons)
    used = f" *Lesson{'s' if len(one.lessons) > 1 else ''} {links}.*" if links else ""
    return f'<a id="{one.anchor}"></a>**{one.name}.** {one.sentence}{formula}{used}'


def _link(number: str, lessons: str) -> str:
    notebook = _notebooks().get(number)
    return f"[{number}]({lessons}{notebook})" if notebook else number


def _in_words(lessons: tuple[str, ...]) -> str:
    return f" (lesson{'s' if len(lessons) > 1 else ''} {', '.join(lessons)})" if lessons else ""


def _term(entry: dict[str, Any], lesson: str = "") -> Term:
    """An entry of the glossary; one that a lesson brings is used by that lesson, unless it says more."""
    lists = {"lessons": tuple(entry.get("lessons", [lesson])), "also": tuple(entry.get("also", ()))}
    return Term(**{**entry, **lists})


@lru_cache
def _names() -> Mapping[str, Term]:
    entries = glossary().terms
    other = {name.casefold(): one for one in entries for name in one.also}
    own = {one.name.casefold(): one for one in entries}
    return MappingProxyType(other | own)


@lru_cache
def _notebooks() -> Mapping[str, str]:
    return MappingProxyType({path.name[:2]: path.name for path in lesson_paths()})


def _table(path: Path) -> list[dict[str, Any]]:
    return list(table_of(path.read_text(encoding="utf-8"), str(path))["term"])
