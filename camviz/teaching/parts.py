"""What stands where in a lesson: its headings, its questions, its exercises, its pictures."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from typing import Any

from camviz.course import notebooks, questions
from camviz.course.notebooks import Cell, Notebook

_ASKED = re.compile(r"^(ask|quiz)\((.*)\)\s*$", re.MULTILINE)
_PICTURE = re.compile(r'<img[^>]*?\salt="(?P<alt>[^"]*)"[^>]*?\ssrc="(?P<source>data:[^"]+)"')


@dataclass(frozen=True)
class Shown:
    """A picture that a cell has shown: a data address, and what it says to someone who cannot see it."""

    source: str
    description: str


def asked(cell: Cell) -> tuple[questions.Question, ...]:
    """The questions that a code cell asks by ask(…) or quiz(…), in whatever form it names."""
    if cell.cell_type != "code":
        return ()
    found: list[questions.Question] = []
    for name, given in _ASKED.findall(cell.source):
        arguments, named = _literals(f"{name}({given})")
        if name == "ask":
            found.append(questions.question(*arguments, **named))
        else:
            form = arguments[1:2] or [named[key] for key in ("form",) if key in named]
            found += questions.quiz_questions(arguments[0], *form)
    return tuple(found)


def is_pretest(cell: Cell) -> bool:
    """True where a cell asks the form of the quiz that comes before the lesson, whose answers are not told yet."""
    return cell.source.startswith("quiz(") and any(getattr(one, "form", "") == "A" for one in asked(cell))


def pictures(cell: Cell) -> list[Shown]:
    """The pictures among a code cell's saved outputs."""
    found = []
    for output in cell.get("outputs", []) if cell.cell_type == "code" else []:
        data: dict[str, Any] = output.get("data", {})
        made = _PICTURE.search("".join(data.get("text/html", "")))
        if made:
            found.append(Shown(made["source"], made["alt"]))
    return found


def number_of(notebook: Notebook) -> str:
    """The lesson's number, from its first heading `# 05 · …`; "" for a notebook that is no lesson."""
    found = re.match(r"#\s+(\d\d)\b", notebook.cells[0].source) if notebook.cells else None
    return found[1] if found else ""


def titles(notebook: Notebook) -> dict[str, str]:
    """The heading of each place that a plan may name: "section 3", "section Recap", "exercise distort"."""
    found: dict[str, str] = {}
    heading = ""
    for cell in notebook.cells:
        for title in re.findall(r"^##+ (.+?)\s*$", cell.source if cell.cell_type == "markdown" else "", re.MULTILINE):
            heading = title
            found.setdefault(f"section {title}", title)
            numbered = re.match(r"(\d+) · ", title)
            if numbered:
                found.setdefault(f"section {numbered[1]}", title)
        if "stub" in cell.metadata.get("tags", []):
            found[f"exercise {notebooks.exercise_of(cell).partition('.')[2]}"] = heading
    return found


def tasks(notebook: Notebook) -> dict[str, tuple[str, str]]:
    """For each exercise its heading and its task, the Markdown from that heading to the stub."""
    found: dict[str, tuple[str, str]] = {}
    text = ""
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if "stub" in tags:
            *_, heading, task = re.split(r"^##+ (.+?)\s*$", f"\n{text}", flags=re.MULTILINE)
            found[notebooks.exercise_of(cell)] = (heading, task.strip())
            text = ""
        elif cell.cell_type == "markdown" and "solution" not in tags:
            text += f"\n\n{cell.source}"
    return found


def _literals(call: str) -> tuple[list[Any], dict[str, Any]]:
    """The arguments of a call such as quiz("05", form="A"). Raises ValueError for what is no literal."""
    node = ast.parse(call, mode="eval").body
    if not isinstance(node, ast.Call):
        raise ValueError(f"expected a call, got {call!r}")
    named = {one.arg: ast.literal_eval(one.value) for one in node.keywords if one.arg}
    return [ast.literal_eval(one) for one in node.args], named
