"""A lesson as a notebook: its tagged cells, its exercises, and what the checks say of them.

A lesson's cells carry tags: `setup`, `build` (what exercises may rely on), `stub`, `check`, `solution`, `glossary`
(filled by `refresh`), `nbval-check-output`. A stub's metadata names its exercise, {"camviz": {"exercise":
"05.distort"}}; notes for the teacher are Markdown in the metadata of the cell they belong to, {"camviz": {"teacher":
"10 minutes. Ask …"}}. A stub is followed, before the next one, by its check and its solution, a fenced block in
<details>.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from camviz_school.course.verdict import Verdict

Notebook = Any
Cell = Any

_FENCE = re.compile(r"```python\n(.*?)```", re.DOTALL)


def read(path: Path) -> Notebook:
    """A notebook, nbformat 4. Raises ValueError naming the file when it is not one."""
    import nbformat

    try:
        return nbformat.read(path, as_version=4)
    except (nbformat.reader.NotJSONError, nbformat.ValidationError, AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is not a notebook: {error}") from error


def text_of(notebook: Notebook) -> str:
    """A notebook as its file has it: JSON with the keys in order and a newline at its end."""
    import nbformat

    return str(nbformat.writes(notebook)).rstrip("\n") + "\n"


def write(notebook: Notebook, path: Path) -> None:
    """Writes a notebook to its file."""
    path.write_text(text_of(notebook), encoding="utf-8")


def execute(notebook: Notebook, folder: Path) -> None:
    """Runs a notebook in `folder` with static outputs, solid where OpenGL works, which it then holds.

    Raises nbclient's CellExecutionError when a cell does, CellTimeoutError or DeadKernelError when one does not end.
    """
    from nbclient import NotebookClient

    client = NotebookClient(
        notebook,
        timeout=120,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(folder)}},
    )
    package = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
    client.execute(env={**os.environ, "PYTHONPATH": package, "CAMVIZ_STATIC": "1", "CAMVIZ_RENDERER": "solid"})


# What is in a lesson ------------------------------------------------------------------------------------------------


def tagged(notebook: Notebook, tag: str) -> list[Cell]:
    """The cells with a tag, in order."""
    return [cell for cell in notebook.cells if tag in cell.metadata.get("tags", [])]


def stubs(notebook: Notebook) -> dict[str, str]:
    """The source of each exercise's stub, by the exercise's name."""
    return {exercise_of(cell): cell.source for cell in tagged(notebook, "stub")}


def solutions(notebook: Notebook) -> dict[str, str]:
    """The code of each exercise's folded solution. Raises ValueError for a stub without one."""
    return {name: solution_code(solution) for name, (_, _, solution) in exercise_cells(notebook).items()}


def checks(notebook: Notebook) -> dict[str, str]:
    """The source of the cell that checks each exercise. Raises ValueError for a stub without one."""
    return {name: check.source for name, (_, check, _) in exercise_cells(notebook).items()}


def exercise_of(stub: Cell) -> str:
    """The exercise that a stub's metadata names. Raises ValueError when it names none."""
    name = stub.metadata.get("camviz", {}).get("exercise")
    if not name:
        raise ValueError(f'a stub needs the metadata {{"camviz": {{"exercise": …}}}}: {stub.source[:60]!r}')
    return name


def verdicts(notebook: Notebook, solved: bool) -> dict[str, Verdict]:
    """What the lesson's own checks say of its solutions, or of its stubs.

    Runs the setup, `build` and exercise cells in order in an empty namespace, as a reader would, without Jupyter.
    """
    exercises = exercise_cells(notebook)
    given: dict[str, Verdict] = {}
    namespace: dict[str, Any] = {"__name__": "lesson"}
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if "setup" in tags or "build" in tags:
            exec(compile(cell.source, "<lesson>", "exec"), namespace)
        elif "stub" in tags:
            name = exercise_of(cell)
            stub, check, solution = exercises[name]
            exec(compile(solution_code(solution) if solved else stub.source, f"<{name}>", "exec"), namespace)
            given[name] = eval(check.source.strip(), namespace)
    return given


def exercise_cells(notebook: Notebook) -> dict[str, tuple[Cell, Cell, Cell]]:
    """The stub, check and solution cells of each exercise."""
    found = {}
    for stub, following in _stretches(notebook):
        name = exercise_of(stub)
        parts = {
            tag: [cell for cell in following if tag in cell.metadata.get("tags", [])] for tag in ("check", "solution")
        }
        for tag, cells in parts.items():
            if len(cells) != 1:
                raise ValueError(f"exercise {name} needs one cell tagged {tag} after its stub, has {len(cells)}")
        found[name] = (stub, parts["check"][0], parts["solution"][0])
    return found


def _stretches(notebook: Notebook) -> Iterator[tuple[Cell, list[Cell]]]:
    """Each stub with the cells between it and the next."""
    starts = [i for i, cell in enumerate(notebook.cells) if "stub" in cell.metadata.get("tags", [])]
    for start, end in zip(starts, [*starts[1:], len(notebook.cells)], strict=True):
        yield notebook.cells[start], notebook.cells[start + 1 : end]


def solution_code(solution: Cell) -> str:
    fenced = _FENCE.search(solution.source)
    if fenced is None:
        raise ValueError(f"a solution needs its code fenced by ```python: {solution.source[:60]!r}")
    return fenced[1].rstrip("\n")
