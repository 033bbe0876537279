"""The theme's style sheet without the rules that no page can use: a third of it is left, and read sooner."""

from __future__ import annotations

import re
from collections.abc import Iterable, Set
from importlib.resources import files
from pathlib import Path

import tinycss2

SHEET = "styles/pydata-sphinx-theme.css"
_CLASS = re.compile(r"\.(-?[A-Za-z_][\w-]*)")
_NEGATED = re.compile(r":not\([^()]*\)")
_WORD = re.compile(r"[A-Za-z_][\w-]*")
_NESTED = ("media", "supports", "layer", "container")


def slim(site: Path) -> None:
    """Write the sheet anew from the theme's own, with what pages and scripts name; drop what only serves the theme."""
    sheet = files("pydata_sphinx_theme") / "theme/pydata_sphinx_theme/static" / SHEET
    texts = [*site.rglob("*.html"), *(site / "_static").rglob("*.js")]
    words = set().union(*(_WORD.findall(path.read_text(encoding="utf-8")) for path in texts))
    (site / "_static" / SHEET).write_text(used(sheet.read_text(encoding="utf-8"), words), encoding="utf-8")
    for path in [*(site / "_static").rglob("*.map"), site / "_static/webpack-macros.html"]:
        path.unlink(missing_ok=True)


def used(css: str, words: Set[str]) -> str:
    """The style sheet with those rules alone whose classes are all among `words`.

    >>> used(".a { color: red } .b, .a:not(.c) { color: blue } @media print { .b { color: red } }", {"a"})
    '.a{ color: red }.a:not(.c){ color: blue }'
    """
    return _rules(tinycss2.parse_stylesheet(css, skip_comments=True, skip_whitespace=True), words)


def _rules(rules: Iterable, words: Set[str]) -> str:
    return "".join(_rule(one, words) for one in rules)


def _rule(rule, words: Set[str]) -> str:
    if rule.type == "qualified-rule":
        selectors = [one for one in _selectors(tinycss2.serialize(rule.prelude)) if _can_be(one, words)]
        return f"{','.join(selectors)}{{{tinycss2.serialize(rule.content)}}}" if selectors else ""
    if rule.type == "at-rule" and rule.lower_at_keyword in _NESTED and rule.content:
        inner = _rules(tinycss2.parse_rule_list(rule.content, skip_comments=True, skip_whitespace=True), words)
        return f"@{rule.at_keyword} {tinycss2.serialize(rule.prelude).strip()}{{{inner}}}" if inner else ""
    return str(rule.serialize())


def _selectors(prelude: str) -> list[str]:
    """The selectors of a rule: split at the commas that stand in no brackets.

    >>> _selectors(".a, :is(.b, .c:not(.d)) > p")
    ['.a', ':is(.b, .c:not(.d)) > p']
    """
    found, depth = [""], 0
    for letter in prelude:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and not depth:
            found.append("")
        else:
            found[-1] += letter
    return [one.strip() for one in found]


def _can_be(selector: str, words: Set[str]) -> bool:
    return set(_CLASS.findall(_NEGATED.sub("", selector))) <= words
