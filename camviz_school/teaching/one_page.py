"""One A4 page to hold in front of a class: the plan's minutes, what the projector shows, the votes and what to say.

Nothing on it is written for it. It shortens what the lesson's header, its cells, its questions and its plan say.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from html import escape, unescape
from importlib import import_module
from importlib.resources import files
from typing import Any

from camviz.draw import prose
from camviz.draw.page import document
from camviz_school.course import questions
from camviz_school.course.catalogue import described
from camviz_school.course.notebooks import Notebook, tagged
from camviz_school.course.questions import Question
from camviz_school.teaching import markup, panels, parts, plans
from camviz_school.teaching.edition import place
from camviz_school.teaching.numbering import Numbering
from camviz_school.teaching.plans import Plan

VOTES, PICTURES = 2, 6
"""How many questions and how many pictures fit."""
FULL, LARGEST, SMALLEST = 4700, 8.6, 6.5
"""Letters that fill the page when it is set in LARGEST pt; more letters are set smaller, down to SMALLEST."""


def one_page(notebook: Notebook, numbering: Numbering, file: str) -> str:
    """The page of a lesson with a plan and numbered slides; `file` is the notebook's name."""
    plan = numbering.plan
    told = described(notebook, file)
    learned = _learned("\n".join(one.source for one in (notebook.cells[0], *tagged(notebook, "about"))))
    goal = f"<p><b>They learn</b> {markup.inline(learned)}.</p>" if learned else ""
    left = f"<h2>On the projector</h2>{_shown(notebook, plan)}<h2>Ready before the class</h2>{_ready(plan)}"
    right = f"<h2>Two votes, and what students get wrong</h2>{_votes(plan)}"
    body = (
        f"<p>{markup.inline(told.question)} <b>Nobody leaves without:</b> {escape(told.takeaway)}.</p>{goal}"
        f"{_minutes(notebook, numbering)}<div class='halves'>{left}{right}</div>"
    )
    letters = len(re.sub(r"<[^>]*>", "", unescape(body)))
    size = min(LARGEST, max(SMALLEST, LARGEST * (FULL / letters) ** 0.5))
    layout = (files(__package__) / "one_page.css").read_text(encoding="utf-8")
    title = f"{told.number} {told.title}: {plans.LONG} minutes on one page"
    return document(title, f"<main style='--size: {size:.2f}pt'>{body}</main>", layout=layout)


def _learned(header: str) -> str:
    """What the header's table says under "What you'll learn"; "" where it has no such column."""
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in header.splitlines() if line[:1] == "|"]
    titled = dict(zip(rows[0], rows[2], strict=False)) if len(rows) > 2 else {}
    return titled.get("What you'll learn", "").rstrip(".")


def _minutes(notebook: Notebook, numbering: Numbering) -> str:
    titles, rows = parts.titles(notebook), ""
    for long, short, step in numbering.plan.timetable():
        if long != "–":
            where, told = markup.inline(place(step, titles)), prose.inline(_brief(step.teacher, 24))
            cells = (long, short, numbering.slides(step), where, told)
            rows += f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
    heads = (f"{plans.LONG} min", plans.SHORT, "slides", "where", "you")
    head = "".join(f"<th>{one}</th>" for one in heads)
    return f"<table class='minutes'><tr>{head}</tr>{rows}</table><p>{numbering.sentence}</p>"


def _shown(notebook: Notebook, plan: Plan) -> str:
    """The first visualizers: where, how they are set, which sliders to move, and what to notice."""
    titled = [one for one in settings(notebook) if one[1] or one[2]][:PICTURES]
    rows = ""
    for number, setting, moved in titled:
        noticed = prose.inline(plan.notice[number].text) if number < len(plan.notice) else ""
        start = f"Set {setting}. " if setting else ""
        rows += f"<li>{noticed} <span>{escape(start)}Move {escape(moved)}.</span></li>"
    return f"<ol>{rows}</ol>"


def settings(notebook: Notebook) -> Iterator[tuple[int, str, str]]:
    """Of each visualizer its number among the lesson's pictures, the values it opens with, and its controls.

    A control is called what stands on it.
    """
    number, code = 0, ""
    for cell in notebook.cells:
        code += f"{cell.source}\n" if cell.cell_type == "code" else ""
        if panels.panels(cell):
            for call in _explored(cell.source):
                view = _view(call.args[0], code)
                labels = _labels(view, code)
                named = {one.arg: one.value for one in call.keywords if one.arg in labels}
                controls = [str(ast.literal_eval(one)) for one in call.args[1:]]
                moved = [
                    *(labels.get(one, one.replace("_", " ")) for one in controls),
                    *(_ranged(labels[a], b) for a, b in named.items()),
                ]
                yield number, _values(view, labels), ", ".join(moved)
            number += 1


def _explored(source: str) -> list[ast.Call]:
    """The calls of explore in a cell whose controls are named in it."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    found = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "explore" and call.args]
    return [call for call in found if all(isinstance(one, ast.Constant) for one in call.args[1:])]


def _view(node: ast.expr, code: str) -> ast.expr:
    """What is explored: the call that makes it, in this cell or before it, where it has a name."""
    if isinstance(node, ast.Name):
        for statement in reversed(ast.parse(code).body):
            if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == node.id:
                return statement.value
    return node


def _labels(view: ast.expr, code: str) -> dict[str, str]:
    """What stands on each control of a view, by the name that the view's code has for it; {} for no known view.

    `code` is all that has been run before; where the view has a name, its class is what the name was made with.
    """
    nodes = list(ast.walk(ast.parse(code)))
    modules = {name.name: node.module for node in nodes if isinstance(node, ast.ImportFrom) for name in node.names}
    made = [node for node in nodes if isinstance(node, ast.Assign)]
    looked, to_look = set(), _names(view)
    while to_look:
        name = to_look.pop(0)
        looked.add(name)
        found = getattr(import_module(modules[name] or ""), name) if name in modules else None
        if found is not None and hasattr(found, "controls"):
            return {field: control.label for field, control in found.controls().items()}
        before = [one.value for one in reversed(made) if name in _names(*one.targets)]
        to_look += [one for value in before for one in _names(value) if one not in looked]
    return {}


def _names(*nodes: ast.expr) -> list[str]:
    return [one.id for node in nodes for one in ast.walk(node) if isinstance(one, ast.Name)]


def _values(view: ast.expr, labels: dict[str, str]) -> str:
    """The numbers and words that a view's controls are set to, such as "k1 −0.28, k2 0.07"."""
    named = [one for one in view.keywords if one.arg in labels] if isinstance(view, ast.Call) else []
    told = [(labels[one.arg or ""], _literal(one.value)) for one in named]
    return ", ".join(f"{name} {_written(value)}" for name, value in told if isinstance(value, bool | int | float | str))


def _ranged(name: str, limits: ast.expr) -> str:
    value = _literal(limits)
    ends = value if isinstance(value, tuple) and len(value) > 1 else ()
    return f"{name} ({_written(ends[0])} … {_written(ends[1])})" if ends and not isinstance(ends[0], str) else name


def _literal(node: ast.expr) -> Any:
    """The value of a literal; None for anything else."""
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None


def _written(value: bool | float | str) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return value if isinstance(value, str) else f"{value:g}".replace("-", "−")


def _votes(plan: Plan) -> str:
    """The two questions with most minutes in the short plan, in the lesson's order."""
    asked = [step for step in plan.steps if step.kind == "question"]
    chosen = sorted(asked, key=lambda step: (-step.minutes[1], -step.minutes[0]))[:VOTES]
    found = [questions.question(f"{plan.lesson}.{step.name}") for step in asked if step in chosen]
    return "".join(_vote(one, plan) for one in found)


def _vote(question: Question, plan: Plan) -> str:
    expected = plan.expected(question.name)
    rows = ""
    for number, (letter, choice) in enumerate(question.lettered):
        share = f" {expected.split[number]} %" if expected else ""
        reply = prose.inline(_brief(choice.reply, 30))
        thought = f" <em>{prose.inline(choice.misconception)}</em>:" if choice.misconception else ""
        mark = "<b>✓</b> " if choice.correct else ""
        rows += f"<li>{mark}<b>({letter}){share}</b> {prose.inline(choice.text.rstrip(' .'))}.{thought} {reply}</li>"
    guess = " <small>(expected votes: a guess)</small>" if expected and expected.guessed else ""
    return f"<p class='vote'>{prose.inline(' '.join(question.text.split()))}{guess}</p><ul>{rows}</ul>"


def _brief(text: str, most: int) -> str:
    """As many sentences as have so many words, and at least the first."""
    return markup.opening(text, most) or markup.sentences(text)[0]


def _ready(plan: Plan) -> str:
    notes = "".join(f"<p><b>{title}.</b> {prose.inline(' '.join(text.split()))}</p>" for title, text in plan.cases)
    number = plan.lesson
    papers = f"<p><b>Print</b> {number}_exercises.html, one for two students, and this page. "
    return f"{papers}Open {number}_slides.html. Keys: {number}_plan.html.</p>{notes}"
