"""A lesson as a page: its notebook with live questions, recorded panes, hints to unfold and pictures as files.

Text, code, pictures and answers are those of the notebook; nothing is written anew here.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Set
from copy import deepcopy
from dataclasses import dataclass
from html import escape
from pathlib import Path

import pictures
from beside import Kind, beside
from links import REPOSITORY, on_site

from camviz.draw import prose
from camviz.views.yours import is_unwritten
from camviz_school.course import colab
from camviz_school.course.exercises import exercise
from camviz_school.course.notebooks import Cell, Notebook, exercise_of, read
from camviz_school.course.questions import Question, question, quiz_questions
from camviz_school.widgets.question import LEAD

PICTURES = "_pictures"
_ASK = re.compile(r'^ask\("([\w.]+)"\)$')
_QUIZ = re.compile(r'^quiz\("(\w+)"(?:, "(\w)")?\)$')
_CODE = '<p class="camviz-code pst-js-only"><button type="button">Show all code</button></p>'
_IMPORTS = re.compile(r"(?:(?:(?:import|from) [^(\n]*)?(?:\n|\Z))+")  # at a cell's begin
_NO_NUMBER = re.compile(r"\bnan\b")  # what a function that nobody has written leads to
_NOT_FETCHED = re.compile(r"^The sample (\S+) could not be fetched", re.MULTILINE)
_HINTS = ("Where to look", "What to use", "The line, with a gap")


@dataclass(frozen=True)
class LessonPage:
    """The page of the notebook `path`. `panes` are the recorded panes of its cells, as HTML by the cell's number.

    `site` is the folder of the built site, into which pictures go; `pages` are the sources of all pages.
    """

    path: Path
    root: Path
    site: Path
    pages: Set[str]
    panes: Mapping[int, str]

    @property
    def way(self) -> str:
        """From the top of the repository."""
        return self.path.relative_to(self.root).as_posix()

    def notebook(self) -> Notebook:
        """The notebook that MyST-NB makes the page from."""
        notebook = read(self.path)
        moves = {cell.id for number, cell in enumerate(notebook.cells) if number in self.panes and _has_figure(cell)}
        for number, cell in enumerate(notebook.cells):
            if cell.cell_type == "markdown":
                cell.source = self._text(cell)
            elif cell.cell_type == "code":
                if _is_folded(cell, number in self.panes):
                    _fold(cell)
                self._output(cell, number)
        self._exercises(notebook)
        notebook.cells = beside(notebook.cells, lambda cell: "pane" if cell.id in moves else _kind(cell))
        notebook.cells = [part for cell in notebook.cells for part in _imports_apart(cell)]
        for number, cell in enumerate(notebook.cells):
            cell.id = f"cell-{number}"
        notebook.metadata["lesson"] = self.path.name[:2]
        return notebook

    def _text(self, cell: Cell) -> str:
        text = on_site(cell.source, self.way, self.pages, self.root)
        if "solution" in cell.metadata.get("tags", []):
            text = text.replace("<details>", '<details class="camviz-solution">', 1)
        return text

    def _output(self, cell: Cell, number: int) -> None:
        asked = asked_by(cell.source)
        pictured = _has_picture(cell)
        cell.outputs = [kept for output in cell.outputs for kept in _said(output, pictured)]
        for output in cell.outputs:
            data = output.get("data", {})
            if "text/html" not in data:
                continue
            html = pictures.outside(data["text/html"], self.site / PICTURES, f"../{PICTURES}")
            if asked:
                html = questions_html(*asked)
            elif number in self.panes and "<figure" in html:  # the findings of an inspection stay above its pane
                html = self.panes[number] + (_CODE if number == min(self.panes) else "")
            data["text/html"] = html
            data.pop("text/plain", None)

    def _exercises(self, notebook: Notebook) -> None:
        """Where they are done. What a check says of a function that nobody has tried is left out."""
        for cell in notebook.cells:
            if "check" in cell.metadata.get("tags", []):
                cell.outputs = []
            if "stub" in cell.metadata.get("tags", []):
                html = exercise_html(exercise_of(cell), self.path.name)
                cell.outputs = [*cell.outputs, _html_output(html)]


def _is_folded(cell: Cell, moves: bool) -> bool:
    """Whether the code of a cell is seen only when a reader asks for all code.

    It sets up, asks, checks or shows, or it waits for functions that a reader writes in a notebook.
    """
    tags = set(cell.metadata.get("tags", []))
    return moves or bool({"setup", "colab", "check"} & tags) or asked_by(cell.source) is not None or _waits(cell)


def _waits(cell: Cell) -> bool:
    lines = "".join(output.get("text", "") for output in cell.outputs).splitlines()
    return any(is_unwritten(line) or _NO_NUMBER.search(line) for line in lines)


def _fold(cell: Cell) -> None:
    cell.metadata["tags"] = [*cell.metadata.get("tags", []), "hide-input"]


def _imports_apart(cell: Cell) -> list[Cell]:
    """A cell, or two of one whose code is seen: what it imports, which is folded, and the rest."""
    found = _IMPORTS.match(cell.source) if cell.cell_type == "code" else None
    if not found or "hide-input" in cell.metadata.get("tags", []):
        return [cell]
    if found.end() == len(cell.source):
        _fold(cell)
        return [cell]
    imports = deepcopy(cell)
    imports.source, imports.outputs, imports.metadata["tags"] = found[0].strip(), [], ["imports"]
    _fold(imports)
    cell.source = cell.source[found.end() :]
    return [imports, cell]


def _has_figure(cell: Cell) -> bool:
    """Recordings of an earlier notebook have other numbers, and must not be taken for panes of this one."""
    return any("<figure" in output.get("data", {}).get("text/html", "") for output in cell.get("outputs", []))


def _has_picture(cell: Cell) -> bool:
    return any("<img" in output.get("data", {}).get("text/html", "") for output in cell.outputs)


def _said(output: Cell, pictured: bool) -> list[Cell]:
    """An output, in which what a notebook says of unwritten functions is one sentence for who reads a page.

    A number that such a function would give is a dash, and of a photograph that could not be fetched its name is told.
    """
    if output.output_type != "stream":
        return [output]
    lines = output.text.splitlines(keepends=True)
    sentences = []
    if names := dict.fromkeys(re.findall(r"`\w+`", "".join(filter(is_unwritten, lines)))):
        what = "A part of this picture" if pictured else "This"
        sentences.append(f"{what} waits for {' and '.join(names)}, which you write in a notebook.")
    sentences += [
        f"The photograph {name} is not on this page; a notebook fetches it."
        for name in _NOT_FETCHED.findall(output.text)
    ]
    kept = (line for line in lines if not is_unwritten(line) and not _NOT_FETCHED.match(line))
    output.text = _NO_NUMBER.sub("–", "".join(kept))
    told = [_html_output(f'<p class="camviz-awaited">{prose.inline(one)}</p>') for one in sentences]
    return [output, *told] if output.text.strip() else told


def _kind(cell: Cell) -> Kind:
    """What a cell without a pane is to the panes beside it. A fold and a listing take a column of their own."""
    tags = set(cell.metadata.get("tags", []))
    if cell.cell_type == "markdown":
        return "other" if tags or "<details" in cell.source or "```" in cell.source else "said"
    asked = asked_by(cell.source)
    return "said" if "colab" in tags else "asked" if asked and asked[2] == "during" else "other"


def asked_by(source: str) -> tuple[tuple[Question, ...], str, str] | None:
    """The questions that a cell asks, their title, and when: "before", "during" or "after"; None for other cells."""
    if found := _ASK.match(source.strip()):
        return (question(found[1]),), "Predict", "during"
    if found := _QUIZ.match(source.strip()):
        form = found[2] or "B"
        before = form == "A"
        return (
            quiz_questions(found[1], form),
            "What do you think now?" if before else "Exit quiz",
            ("before" if before else "after"),
        )
    return None


def questions_html(asked: tuple[Question, ...], title: str, when: str) -> str:
    """Questions as a page has them: a list with folded replies, which questions.js makes live from the data beside it.

    What is asked before a lesson has no replies in the list, as in the notebook.
    """
    told = {
        "title": title,
        "lead": LEAD if when == "before" else "",
        "when": when,
        "lesson": asked[0].name.partition(".")[0],
        "questions": [
            {
                "name": one.name,
                "form": one.form,
                "topic": one.topic,
                "text": prose.to_html(one.text),
                "choices": [
                    {
                        "text": prose.inline(each.text),
                        "reply": prose.to_html(each.reply),
                        "correct": each.correct,
                        "misconception": each.misconception,
                    }
                    for each in one.choices
                ],
            }
            for one in asked
        ],
    }
    data = json.dumps(told, ensure_ascii=False).replace("<", "\\u003c")
    lead = f"<p>{escape(told['lead'])}</p>" if told["lead"] else ""
    return (
        f'<div class="camviz-asked"><section class="camviz-folded"><p><strong>{escape(title)}</strong></p>{lead}'
        f"{''.join(_folded(one, when == 'before') for one in asked)}</section>"
        f'<script type="application/json">{data}</script></div>'
    )


def _folded(one: Question, silent: bool) -> str:
    if silent:
        choices = f"<ul>{''.join(f'<li>{prose.inline(each.text)}</li>' for each in one.choices)}</ul>"
    else:
        choices = "".join(
            f"<details><summary>{prose.inline(each.text)}</summary><blockquote>"
            f"<p><em>{'✓ Correct.' if each.correct else '✗ Not this one.'}</em></p>{prose.to_html(each.reply)}"
            "</blockquote></details>"
            for each in one.choices
        )
    return f"<div>{prose.to_html(one.text)}{choices}</div>"


def exercise_html(name: str, file: str) -> str:
    """Where an exercise can be done, and its hints, one after the other."""
    hints = exercise(name).hints
    folded = ""
    for title, hint in reversed(list(zip(_HINTS, hints, strict=True))):  # each opens only inside the one before
        folded = f"<details><summary>Hint: {title.lower()}</summary>{prose.to_html(hint)}{folded}</details>"
    return (
        f'<div class="camviz-exercise"><p>You write this function in a notebook, which checks it:</p>{doors(file)}'
        f"{folded}</div>"
    )


def doors(file: str) -> str:
    """The ways to a lesson's notebook."""
    binder = f"https://mybinder.org/v2/gh/camviz/camviz/HEAD?urlpath=lab/tree/lessons/{file}"
    mine = f"<code>camviz lab --lesson {file[:2]}</code>"
    return (
        f'<ul class="camviz-doors"><li><a href="{binder}">Binder</a></li>'
        f'<li><a href="{colab.opens(file)}">Colab</a></li>'
        f'<li><a href="{file}" download>download</a></li>'
        f"<li><details><summary>in your JupyterLab</summary><p>{mine} opens JupyterLab at this lesson. In a clone of "
        f'<a href="{REPOSITORY}">the repository</a> it is <code>python start.py lab --lesson {file[:2]}</code>.</p>'
        "</details></li></ul>"
    )


def _html_output(html: str) -> Cell:
    import nbformat

    return nbformat.v4.new_output("display_data", data={"text/html": html})
