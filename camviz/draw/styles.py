"""How marks look: one table, from which pages have a style sheet and files have attributes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

THEMES = ("light", "dark")
_COLOURS = {
    "paper": ("#ffffff", "#14181f"), "card": ("#f4f5f7", "#1d232d"), "ink": ("#1c2330", "#e8ebf0"),
    "muted": ("#5b6577", "#a3adbd"), "grid": ("#d9dde4", "#39424f"), "shade": ("#1c2330", "#000000"),
    "blue": ("#0067a5", "#5bb4f0"), "orange": ("#c05300", "#ff9d5c"), "green": ("#00785a", "#3ed0a5"),
    "red": ("#c2185b", "#ff7bab"), "sky": ("#3b9bd6", "#7cc8f5"), "yellow": ("#b38600", "#f2c94c"),
    "purple": ("#7a4fb5", "#b99af0"),
}  # fmt: skip
_HUES = ("blue", "orange", "green", "red", "sky", "yellow", "purple")
_SYSTEM = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", Arial, sans-serif'
_SYSTEM_MONO = 'ui-monospace, "SFMono-Regular", Menlo, Consolas, "DejaVu Sans Mono", monospace'
SANS = "DejaVu Sans, Verdana, Segoe UI, Helvetica Neue, Arial, sans-serif"
MONO = "DejaVu Sans Mono, Menlo, Consolas, Courier New, monospace"
SIZE = 13.0  # picture units, of words
SIZES = {"title": 14.0, "note": 12.0, "tick": 11.5, "number": 12.5}

VARIABLES = {name: f"var(--{name})" for name in _COLOURS}
"""The colours of a page, which follow its theme."""

Declared = dict[str, Any]
Rule = tuple[str, str, Declared]
"""A tag ("" for any), classes, and what they declare; a value in {braces} is a colour of the theme."""

RULES: tuple[Rule, ...] = (
    ("path", "", {"fill": "none", "stroke-linejoin": "round", "stroke-linecap": "round"}),
    ("", "paper", {"fill": "{paper}"}),
    ("", "card", {"fill": "{card}"}),
    ("", "frame", {"fill": "none", "stroke": "{grid}"}),
    ("", "title", {"font-weight": 600, "font-size": SIZES["title"], "fill": "{ink}"}),
    ("", "awaited", {"opacity": 0.35, "filter": "grayscale(1)"}),
    ("", "label", {"fill": "{ink}"}),
    ("", "note", {"fill": "{muted}", "font-size": SIZES["note"]}),
    ("", "hint", {"display": "none"}),
    ("", "tick", {"fill": "{muted}", "font-size": SIZES["tick"], "font-variant-numeric": "tabular-nums"}),
    ("", "number", {"font-family": _SYSTEM_MONO, "font-size": SIZES["number"], "fill": "{ink}", "white-space": "pre"}),
    ("", "halo", {"paint-order": "stroke", "stroke": "{paper}", "stroke-width": 3, "stroke-linejoin": "round"}),
    ("", "clear", {"stroke": "{card}", "stroke-width": 7}),
    ("", "end", {"text-anchor": "end"}),
    ("", "middle", {"text-anchor": "middle"}),
    ("path", "grid", {"stroke": "{grid}", "stroke-width": 1}),
    ("path", "axis", {"stroke": "{muted}", "stroke-width": 1.2}),
    ("path", "ink", {"stroke": "{ink}", "stroke-width": 1.5}),
    ("path", "muted", {"stroke": "{muted}", "stroke-width": 1.2}),
    *((tag, hue, declared) for hue in _HUES for tag, declared in (
        ("path", {"stroke": f"{{{hue}}}", "stroke-width": 1.8}), ("text", {"fill": f"{{{hue}}} !important"}))),
    *(("", f"fill-{colour}", {"fill": f"{{{colour}}} !important"}) for colour in (*_HUES, "muted", "ink", "shade")),
    ("path", "thin", {"stroke-width": 1}),
    ("path", "thick", {"stroke-width": 2.8}),
    ("path", "dashed", {"stroke-dasharray": "6 4"}),
    ("path", "dotted", {"stroke-dasharray": "1.5 4"}),
    ("path", "paper-line", {"stroke": "{paper}", "stroke-opacity": 0.75, "stroke-width": 4.4}),
    ("path", "paper-dot", {"stroke": "{paper}"}),
    ("", "faint", {"opacity": 0.35}),
    ("", "half", {"opacity": 0.6}),
    ("", "wash", {"fill-opacity": 0.16, "stroke": "none"}),
)  # fmt: skip
_WITHOUT_UNIT = {"opacity", "stroke-opacity", "fill-opacity", "font-weight"}
_HANDLES = """\
.camviz-svg [data-drag] { cursor: grab; touch-action: none; } .camviz-svg [data-drag]:active { cursor: grabbing; }
.camviz-svg [data-drag]:focus-visible { outline: 2px solid var(--blue); outline-offset: 1px; }
"""


@cache
def sheet() -> str:
    """The style sheet of pages: it follows their light or dark theme."""
    light, dark = ("; ".join(f"--{name}: {pair[i]}" for name, pair in _COLOURS.items()) for i in (0, 1))
    themes = (
        f".camviz-svg {{ {light}; font-family: {_SYSTEM}; font-size: {SIZE:g}px;"
        " color: var(--ink); background: var(--paper); }\n"
        f"@media (prefers-color-scheme: dark) {{ .camviz-svg {{ {dark}; }} }}\n"
        f'[data-jp-theme-light="true"] .camviz-svg, [data-theme="light"] .camviz-svg {{ {light}; }}\n'
        f'[data-jp-theme-light="false"] .camviz-svg, [data-theme="dark"] .camviz-svg {{ {dark}; }}\n'
    )
    rules = (
        f".camviz-svg {tag}{''.join(f'.{one}' for one in classes.split())} {{ {css(declared, VARIABLES)} }}\n"
        for tag, classes, declared in RULES
    )
    return themes + "".join(rules) + _HANDLES


def css(declared: Mapping[str, Any], variables: Mapping[str, str]) -> str:
    """Declarations as CSS; a number is in pixels where CSS asks for a unit."""
    return "; ".join(f"{_dashed(name)}: {_valued(_dashed(name), value, variables)}" for name, value in declared.items())


def _dashed(name: str) -> str:
    return name.replace("_", "-")


def _valued(name: str, value: Any, variables: Mapping[str, str]) -> str:
    if isinstance(value, str):
        return value.format_map(variables) if value.startswith("{") else value
    return f"{value:g}" if name in _WITHOUT_UNIT else f"{value:g}px"


def attributes(tag: str, class_: str, own: Mapping[str, Any], theme: str) -> dict[str, str]:
    """What an element looks like in a file, with no style sheet: its own style beats the table's stronger rules.

    Raises: ValueError for another theme than "light" and "dark".
    """
    declared = dict(_declared(tag, class_, theme))
    important = {name: value for name, value in declared.items() if value.endswith("!important")}
    declared |= {_dashed(name): _in_a_file(_dashed(name), value, _colours(theme)) for name, value in own.items()}
    declared |= {name: value.removesuffix(" !important") for name, value in important.items()}
    return declared


@cache
def _declared(tag: str, class_: str, theme: str) -> tuple[tuple[str, str], ...]:
    if theme not in THEMES:
        raise ValueError(f"theme must be one of {', '.join(map(repr, THEMES))}, got {theme!r}")
    classes = set(class_.split())
    matching = [rule for rule in RULES if rule[0] in ("", tag) and set(rule[1].split()) <= classes]
    declared: dict[str, str] = {}
    for _, _, rule in sorted(matching, key=lambda rule: (len(rule[1].split()), bool(rule[0]))):
        declared |= {name: _in_a_file(name, value, _colours(theme)) for name, value in rule.items()}
    return tuple(declared.items())


def _in_a_file(name: str, value: Any, colours: Mapping[str, str]) -> str:
    if name == "font-family":
        return MONO
    if name == "font-weight":
        return "bold"
    if isinstance(value, str):
        return value.format_map(colours) if value.startswith("{") else value
    return f"{value:g}"


@cache
def _colours(theme: str) -> dict[str, str]:
    return {name: pair[THEMES.index(theme)] for name, pair in _COLOURS.items()}
