"""A pane that draws a reader's function, on a page that runs none: with the solution, and with usual mistakes.

What shows a mistake is the lesson itself, run again from the exercise to the pane with the mistake in the solution's
place; only cells that depend on it are run.
"""

from __future__ import annotations

import ast
import io
import symtable
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from html import escape
from typing import Any, NamedTuple

from camviz.draw import prose

MOST = 2
"""Mistakes of a pane: the first that its picture shows."""


class Mistake(NamedTuple):
    """A usual mistake: in a few words, what the check says of it, and the visualizer that shows it."""

    title: str
    explanation: str
    explorer: Any


def symbols_in(source: str) -> Iterator[tuple[symtable.SymbolTable, symtable.Symbol]]:
    """Every name of code, with the scope that it is in."""
    tables = [symtable.symtable(source, "<cell>", "exec")]
    while tables:
        table = tables.pop()
        tables += table.get_children()
        for symbol in table.get_symbols():
            yield table, symbol


def names_in(source: str) -> set[str]:
    """The notebook's names that code reads or sets, in its functions, too."""
    return {
        symbol.get_name() for table, symbol in symbols_in(source) if table.get_type() == "module" or symbol.is_global()
    }


def assigned_in(source: str) -> set[str]:
    """The notebook's names that code sets."""
    return {
        symbol.get_name()
        for table, symbol in symbols_in(source)
        if table.get_type() == "module" and (symbol.is_assigned() or symbol.is_imported())
    }


def value_of(source: str, namespace: dict[str, Any]) -> Any:
    """Runs a cell as Jupyter does; the value of its last line."""
    tree, value = ast.parse(source), None
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(io.StringIO()):
        exec(compile(tree, "<cell>", "exec"), namespace)
        if last:
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), namespace)
    return value


def dependents(sources: Mapping[int, str], begin: int, end: int, name: str) -> list[int]:
    """The cells after `begin`, up to `end`, that read what `name` stands for, or what one of these has set."""
    changed, found = {name}, []
    for number in range(begin + 1, end + 1):
        source = sources.get(number, "")
        if changed & names_in(source):
            found.append(number)
            changed |= assigned_in(source)
    return found


def mistakes(
    exercise: str,
    stub: int,
    pane: int,
    sources: Mapping[int, str],
    before: Mapping[int, dict[str, Any]],
    shown: list[Any],
) -> Iterator[Mistake]:
    """Usual mistakes in an exercise that the visualizer of the cell `pane` shows, each by a picture of its own.

    `stub` is the exercise's cell, `before` the names before each cell of a run with the solutions, and `shown` the
    visualizer that came out, and those of mistakes that are known already.
    """
    from camviz.widgets import Explorer
    from camviz_school.course.exercises import exercises

    name = exercise.split(".")[1]
    again = dependents(sources, stub, pane, name)
    if pane not in again:
        return
    pictures = list(map(_picture, shown))
    for known in exercises(exercise.split(".")[0])[exercise].misconceptions:
        names = {**before[pane], **{key: before[stub][key] for key in _set_by(again, sources) & before[stub].keys()}}
        names[name] = known.function
        value = [value_of(sources[number], names) for number in again][-1]
        if isinstance(value, Explorer) and (picture := _picture(value)) not in pictures:
            pictures.append(picture)
            yield Mistake(known.function.__name__.replace("_", " "), known.explanation, value)


def _set_by(again: list[int], sources: Mapping[int, str]) -> set[str]:
    return {name for number in again for name in assigned_in(sources[number])}


def _picture(explorer: Any) -> tuple[str, dict[str, bytes]]:
    figure = explorer.view.figure()
    return figure.svg(), dict(figure.photographs)


def drawn_with(pane: str, others: list[tuple[Mistake, str]]) -> str:
    """A pane with the solution in it; buttons put one with a mistake in its place, and what the check says of it."""
    ours = "<p>The solution of the exercise. In a notebook your own function takes its place.</p>"
    buttons = "".join(_button(one.title) for one, _ in others)
    choice = f'<p class="pst-js-only">Drawn with {_button("the solution", True)} or a usual mistake: {buttons}</p>'
    wrong = "".join(
        f'<div class="camviz-with" hidden>{prose.to_html(one.explanation)}{html}</div>' for one, html in others
    )
    shown = f'<div class="camviz-with">{ours}{pane}</div>{wrong}'
    return f'<div class="camviz-drawn-with">{choice if others else ""}{shown}</div>'


def _button(title: str, pressed: bool = False) -> str:
    return f'<button type="button" aria-pressed="{str(pressed).lower()}">{escape(title)}</button>'
