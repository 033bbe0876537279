"""A teacher's folder: for each lesson its edition, its pages to print and its slides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from camviz_school.course.notebooks import Notebook, read, write
from camviz_school.teaching import parts, plans
from camviz_school.teaching.deck import page, planned_slides
from camviz_school.teaching.edition import Say, chosen_lessons, renumber, write_teacher_edition
from camviz_school.teaching.numbering import Numbering
from camviz_school.teaching.one_page import one_page
from camviz_school.teaching.sheets import sheets


def write_pack(source: Path, out: Path, only: Sequence[str], *, run: bool, slides: bool, say: Say) -> None:
    """Writes into `out` what belongs to the lessons in `source` with the numbers `only`, by default all.

    Raises ValueError for a number that no lesson has, and when `out` is the lessons' own folder.
    """
    write_teacher_edition(source, out, run=run, only=only, say=say)
    for path in chosen_lessons(source, only):
        lesson, edition, number = read(path), read(out / path.name), path.name.partition("_")[0]
        solved = any(cell.outputs for cell in edition.cells if cell.cell_type == "code")
        made = planned_slides(_with_solved_pictures(lesson, edition), solved=solved)
        pages = sheets(lesson, number, made)
        if plan := plans.plan(number):
            numbering = Numbering.of(plan, made)
            renumber(edition, numbering)
            write(edition, out / path.name)
            pages["one_page"] = one_page(lesson, numbering, path.name)
        if slides:
            pages["slides"] = page(made)
        for name, text in pages.items():
            (out / f"{number}_{name}.html").write_text(text, encoding="utf-8")


def _with_solved_pictures(lesson: Notebook, edition: Notebook) -> Notebook:
    """The lesson with the pictures that its edition, where that has been run, draws with functions that are written.

    A function that is given and wrong draws what students see before they mend it.
    """
    solved = {cell.id: cell.outputs for cell in edition.cells if cell.cell_type == "code" and cell.outputs}
    drawn = parts.drawn_by_reader(lesson)
    for cell in lesson.cells:
        if cell.id in solved and cell.id in drawn:
            cell.outputs = solved[cell.id]
    return lesson
