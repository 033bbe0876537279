"""A teacher's folder: for each lesson its edition, its pages to print and its slides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from camviz.course.notebooks import Notebook, read
from camviz.teaching import plans
from camviz.teaching.deck import deck
from camviz.teaching.edition import Say, chosen_lessons, write_teacher_edition
from camviz.teaching.one_page import one_page
from camviz.teaching.sheets import sheets


def write_pack(source: Path, out: Path, only: Sequence[str], *, run: bool, slides: bool, say: Say) -> None:
    """Writes into `out` what belongs to the lessons in `source` with the numbers `only`, by default all.

    Raises ValueError for a number that no lesson has, and when `out` is the lessons' own folder.
    """
    write_teacher_edition(source, out, run=run, only=only, say=say)
    for path in chosen_lessons(source, only):
        lesson, number = read(path), path.name.partition("_")[0]
        pages = sheets(lesson, number)
        if plan := plans.plan(number):
            pages["one_page"] = one_page(lesson, plan, path.name)
        if slides:
            pages["slides"] = deck(_with_solved_pictures(lesson, read(out / path.name)))
        for name, page in pages.items():
            (out / f"{number}_{name}.html").write_text(page, encoding="utf-8")


def _with_solved_pictures(lesson: Notebook, edition: Notebook) -> Notebook:
    """The lesson with what its edition shows, where that has been run: the pictures that a solved function makes."""
    solved = {cell.id: cell.outputs for cell in edition.cells if cell.cell_type == "code" and cell.outputs}
    for cell in lesson.cells:
        if cell.id in solved:
            cell.outputs = solved[cell.id]
    return lesson
