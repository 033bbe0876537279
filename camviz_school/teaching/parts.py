"""What stands where in a lesson: its headings, its questions, its exercises, its pictures."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import Any

from camviz_school.course import notebooks, questions
from camviz_school.course.notebooks import Cell, Notebook

_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_ASKED = re.compile(r"^(ask|quiz)\((.*)\)\s*$", re.MULTILINE)


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


def drawn_by_reader(notebook: Notebook, *, given: bool = False) -> dict[str, str]:
    """By the id of each code cell that uses what a reader writes, the exercise, such as "distort", it uses last.

    What such a cell assigns is followed into later cells. A stub that does something, a wrong one to be mended, draws
    its own picture and counts with `given` only.
    """
    written: dict[str, str] = {}
    found: dict[str, str] = {}
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        tree = ast.parse(cell.source)
        stub = "stub" in cell.metadata.get("tags", [])
        exercise = notebooks.exercise_of(cell).partition(".")[2] if stub and (given or is_open(cell)) else ""
        for statement in _in_order(tree.body):
            loaded = _loaded(statement)
            used = [written[name] for name in written if name in loaded]
            if used and not stub:
                found[cell.id] = used[-1]
            for name in _stored(statement):
                written.pop(name, None)
                if exercise or (used and not stub):
                    written[name] = exercise or used[-1]
    return found


def _in_order(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements one by one, those of a loop too: what its body gives a name is not what the name had before it."""
    for statement in body:
        if isinstance(statement, ast.For):
            yield ast.Assign([statement.target], statement.iter)
            yield from _in_order([*statement.body, *statement.orelse])
        else:
            yield statement


def is_open(stub: Cell) -> bool:
    """True for a stub with a lone ellipsis, which stands for lines to be written."""
    lines = [node.value for node in ast.walk(ast.parse(stub.source)) if isinstance(node, ast.Expr)]
    return any(isinstance(line, ast.Constant) and line.value is ... for line in lines)


def _stored(code: ast.AST) -> set[str]:
    """The names that code gives values, except those that live in a function or in one comprehension only."""
    if isinstance(code, ast.FunctionDef):
        return {code.name}
    inner = set().union(*map(_stored, ast.iter_child_nodes(code)))
    if isinstance(code, _COMPREHENSIONS):
        inner -= _bound(code, ast.comprehension)
    return inner | ({code.id} if isinstance(code, ast.Name) and isinstance(code.ctx, ast.Store) else set())


def _loaded(code: ast.AST) -> set[str]:
    """The names whose values code takes from before it."""
    names = {node.id for node in ast.walk(code) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    own = {node.arg for node in ast.walk(code) if isinstance(node, ast.arg)}
    if isinstance(code, ast.FunctionDef):
        own |= set().union(*map(_stored, code.body))
    return names - own - _bound(code, ast.comprehension, ast.For)


def _bound(code: ast.AST, *kinds: type[ast.comprehension] | type[ast.For]) -> set[str]:
    """The names that loops of these kinds run through."""
    targets = [node.target for node in ast.walk(code) if isinstance(node, kinds)]
    return {node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)}


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
