"""All style sheets of the site as one, without the rules that no page can use: a third of it is left, and read sooner.

A page asks for one file where it would ask for six, one after another. The theme's icon font is left out, 115 kB for a
dozen icons: static/icons.css draws them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Set
from importlib.resources import files
from pathlib import Path

import tinycss2

SHEET = "site.css"
"""The one sheet, beside the sheets it is made of; the template of a page asks for it by this name."""

_THEME = "styles/pydata-sphinx-theme.css"
_ASKED = re.compile(r"_static/site\.css(\?v=\w*)?")
_CLASS = re.compile(r"\.(-?[A-Za-z_][\w-]*)")
_NEGATED = re.compile(r":not\([^()]*\)")
_WORD = re.compile(r"[A-Za-z_][\w-]*")
_NESTED = ("media", "supports", "layer", "container")
_ICON_FONT = "Font Awesome"
UNCOLOURED = ("n", "nn", "p", "w")
"""Pygments' classes of code that both of the site's styles leave in the colour of text."""
OPERATORS = "o"
"""Pygments' class of dots and signs between words; a fifth of lesson 16's elements would only colour them."""
_UNCOLOURED = re.compile(rf'<span class="(?:{"|".join([*UNCOLOURED, OPERATORS])})">([^<]*)</span>')
_MENDED = {  # in the pages: folds with no name or one that nobody sees, and a role of docutils that ARIA has withdrawn
    '<summary><span class="toctree-toggle"': '<summary aria-label="Pages below"><span class="toctree-toggle"',
    '<summary aria-label="Toggle hidden content">': "<summary>",
    ' role="doc-biblioentry"': "",
    '<div role="list" class="citation-list">': '<div class="citation-list">',
}


def slim(site: Path) -> None:
    """Write the sheet from all others, with what pages and scripts name; drop what only serves the theme."""
    static = site / "_static"
    theme = files("pydata_sphinx_theme") / "theme/pydata_sphinx_theme/static" / _THEME
    (notebooks,) = static.glob("mystnb.*.css")
    sheets = [static / "basic.css", theme, static / "pygments.css", notebooks]
    own = (static / "camviz.css").read_text(encoding="utf-8")  # whole: recordings, which are not read here, use it too
    pages = {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    scripts = [path.read_text(encoding="utf-8") for path in static.rglob("*.js")]
    words = set().union(*(_WORD.findall(text) for text in [*pages.values(), *scripts]))
    sheet = "\n".join([*(used(one.read_text(encoding="utf-8"), words) for one in sheets), own])
    (static / SHEET).write_text(sheet, encoding="utf-8")
    _mend(pages, hashlib.sha256(sheet.encode()).hexdigest()[:8])
    unasked = [*static.rglob("*.map"), *static.glob("vendor/fontawesome/**/*.*"), *static.glob("scripts/fontawesome*")]
    for path in [*unasked, static / _THEME, static / "webpack-macros.html"]:
        path.unlink(missing_ok=True)


def _mend(pages: dict[Path, str], digest: str) -> None:
    """Have the pages ask for this sheet, not for an older one that a browser has kept, and mend them."""
    for path, text in pages.items():
        anew = without_uncoloured(_ASKED.sub(f"_static/{SHEET}?v={digest}", text))
        for wrong, right in _MENDED.items():
            anew = anew.replace(wrong, right)
        if anew != text:
            path.write_text(anew, encoding="utf-8")


def without_uncoloured(html: str) -> str:
    """The page without the elements around operators and code that has no colour: half of a lesson's elements.

    >>> without_uncoloured('<span class="n">x</span> <span class="o">=</span> <span class="mi">1</span>')
    'x = <span class="mi">1</span>'
    """
    return _UNCOLOURED.sub(r"\1", html)


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
    if rule.type == "at-rule" and rule.lower_at_keyword == "font-face" and _ICON_FONT in _plain(rule.serialize()):
        return ""
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


def _plain(css: str) -> str:
    """A rule's words without the escapes of its spaces."""
    return css.replace("\\ ", " ")
