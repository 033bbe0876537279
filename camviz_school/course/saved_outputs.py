"""A lesson's saved outputs: made so that the same lesson gives the same file, and known to be fresh or stale."""

from __future__ import annotations

import hashlib
import json
import re
from copy import deepcopy
from html.parser import HTMLParser
from pathlib import Path

from camviz_school.course import glossary
from camviz_school.course.notebooks import Cell, Notebook, execute, read, tagged, write

LANGUAGE = {
    "codemirror_mode": {"name": "ipython", "version": 3},
    "file_extension": ".py",
    "mimetype": "text/x-python",
    "name": "python",
    "nbconvert_exporter": "python",
    "pygments_lexer": "ipython3",
    "version": "3.11.7",
}
"""What JupyterLab writes into a notebook that it opens, and then calls unsaved where anything was different.

The version is the kernel's: camviz_school.server sets it to the reader's."""

_RANDOM_ID = re.compile(r"[0-9a-f]{8}")


def refresh(path: Path) -> None:
    """Runs a lesson with static outputs and saves it so that the same lesson gives the same file.

    Pictures in space are solid where OpenGL works, wireframes elsewhere. Raises nbclient's CellExecutionError when a
    cell does; the file is left alone then.
    """
    notebook = read(path)
    for cell in tagged(notebook, "glossary"):
        cell.source = glossary.markdown().rstrip("\n")
    execute(notebook, path.parent)
    write(tidied(notebook), path)


def tidied(notebook: Notebook) -> Notebook:
    """The notebook without what changes from run to run: times, widget state, versions, random ids."""
    notebook = deepcopy(notebook)
    notebook.metadata = type(notebook.metadata)(
        {
            "kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"},
            "language_info": LANGUAGE,
            "camviz": {"source": fingerprint(notebook)},
        }
    )
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    counter = 0
    ids: set[str] = set()
    for cell in notebook.cells:
        cell.id = _steady_id(cell, ids)
        ids.add(cell.id)
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            counter += 1
            cell.execution_count = counter
            for output in cell.outputs:
                if "execution_count" in output:
                    output.execution_count = counter
    return notebook


def fingerprint(notebook: Notebook) -> str:
    """A hash of the code whose outputs are saved."""
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return hashlib.sha256(json.dumps(code).encode()).hexdigest()


def is_fresh(notebook: Notebook) -> bool:
    """True when the saved outputs come from the code that is there, and the glossary cell from the glossary."""
    current = all(cell.source == glossary.markdown().rstrip("\n") for cell in tagged(notebook, "glossary"))
    return current and notebook.metadata.get("camviz", {}).get("source") == fingerprint(notebook)


def _steady_id(cell: Cell, taken: set[str]) -> str:
    """The cell's id, or where that was drawn at random one made from the cell's text."""
    if not _RANDOM_ID.fullmatch(cell.id) and cell.id not in taken:
        return cell.id
    text, number = hashlib.sha256(cell.source.encode()).hexdigest()[:12], 1
    while f"c-{text}-{number}" in taken:
        number += 1
    return f"c-{text}-{number}"


def images(cell: Cell) -> list[tuple[str, str]]:
    """What each image among a cell's saved outputs says to someone who cannot see it, and its data address."""
    outputs = cell.get("outputs", []) if cell.cell_type == "code" else []
    return images_of("".join("".join(output.get("data", {}).get("text/html", "")) for output in outputs))


def images_of(html: str) -> list[tuple[str, str]]:
    """As `images`, of a piece of HTML."""
    reader = _ImageReader()
    reader.feed(html)
    return reader.found


class _ImageReader(HTMLParser):
    """Collects the words and data addresses of images."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        source = named.get("src") or ""
        if tag == "img" and source.startswith("data:"):
            self.found.append((named.get("alt") or "", source))
