"""The pages made from the lessons: README's tables, the map and the glossary in lesson 00, docs/glossary.md."""

from __future__ import annotations

from pathlib import Path

from camviz_school.course import catalogue, glossary, paths
from camviz_school.course.catalogue import BEGINNING, Lesson
from camviz_school.course.material import checkout_lessons, lesson_paths
from camviz_school.course.notebooks import read, tagged, text_of


def pages() -> dict[Path, str]:
    """Each page with the text that it should have now. Raises ValueError outside a source checkout."""
    lessons = checkout_lessons()
    if lessons is None:
        raise ValueError("the pages are made in a source checkout, and camviz runs from an installed package")
    listed = catalogue.catalogue()
    beginning = next(path for path in lesson_paths() if path.name.startswith(BEGINNING))
    return {
        lessons.parent / "README.md": _readme(lessons.parent / "README.md", listed),
        lessons.parent / "docs" / "glossary.md": glossary.page(),
        beginning: _beginning(beginning, listed),
    }


def write_pages() -> list[Path]:
    """Writes the pages that are not as they should be, and returns them."""
    stale = {path: text for path, text in pages().items() if path.read_text(encoding="utf-8") != text}
    for path, text in stale.items():
        path.write_text(text, encoding="utf-8")
    return list(stale)


def _readme(path: Path, listed: list[Lesson]) -> str:
    text = path.read_text(encoding="utf-8")
    for table in (paths.table(listed, "lessons/"), catalogue.gallery(listed), catalogue.overview(listed)):
        text = catalogue.with_table(text, table)
    return text


def _beginning(path: Path, listed: list[Lesson]) -> str:
    notebook = read(path)
    for table in (paths.table(listed), catalogue.lesson_map(listed)):
        for cell in notebook.cells:
            if cell.cell_type == "markdown" and table.splitlines()[0] in cell.source:
                cell.source = catalogue.with_table(cell.source, table)
    for cell in tagged(notebook, "glossary"):
        cell.source = glossary.markdown().rstrip("\n")
    return text_of(notebook)
