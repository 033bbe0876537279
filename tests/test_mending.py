"""Notebooks that students broke, and what `camviz mend` makes of them: every answer is graded as it was given."""

import json
from copy import deepcopy

import nbformat
import numpy as np
import pytest
from commandline import main

from camviz_school.course import notebooks
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
from camviz_school.course.material import lessons_folder
from camviz_school.teaching import edition, mending

(LESSON,) = lessons_folder().glob("03_*.ipynb")
RIGHT = {name.replace(".", "-"): code for name, code in notebooks.solutions(notebooks.read(LESSON)).items()}
"""The code of each exercise's solution, by nbgrader's mark of its stub."""


def released():
    """As docs/teaching.md has nbgrader hand it out: the teacher's cells gone, stubs and checks with their marks."""
    made, lesson = edition.teacher_edition(notebooks.read(LESSON)), notebooks.read(LESSON)
    given = {cell.id: cell.source for cell in lesson.cells}
    theirs = {"plan", "key", "teacher", "solution"}
    made.cells = [cell for cell in made.cells if not theirs & set(cell.metadata.get("tags", []))]
    for cell in made.cells:
        cell.source = given.get(cell.id, cell.source)
    return made


OUT = released()


def solved(answers=RIGHT):
    """What a student hands in who has written all answers."""
    notebook = deepcopy(OUT)
    for cell in notebook.cells:
        cell.source = answers.get(mark(cell), cell.source)
    return notebook


def mark(cell):
    return cell.metadata.get("nbgrader", {}).get("grade_id", "")


def at(notebook, kind):
    """Where the first cell with a mark of this kind is."""
    return next(i for i, cell in enumerate(notebook.cells) if cell.metadata.get("nbgrader", {}).get(kind))


def points(notebook):
    """Of each exercise, whether its check finds it right when the notebook runs from top to bottom."""
    namespace, found = {"np": np}, {}
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if cell.cell_type != "code":
            continue
        if mark(cell).endswith("-check"):
            name = mark(cell).removesuffix("-check")
            function = namespace[RIGHT[name].split("def ")[1].split("(")[0]]
            found[name] = (
                judge(exercise(name.replace("-", ".", 1)), function, np.random.default_rng(0)).status == "correct"
            )
        elif {"stub", "build", "setup"} & set(tags) or cell.id.startswith("own-"):
            exec(cell.source, namespace)
    return found


def deleted_check(notebook):
    del notebook.cells[at(notebook, "grade")]


def split(notebook):
    stub = notebook.cells[at(notebook, "solution")]
    notebook.cells.insert(at(notebook, "solution") + 1, nbformat.v4.new_code_cell(stub.source))
    stub.source = ""


def merged(notebook):
    stub, check = notebook.cells[at(notebook, "solution")], notebook.cells[at(notebook, "grade")]
    stub.source += "\n\n" + check.source.replace("check(", "print(")
    deleted_check(notebook)


def stub_made_text(notebook):
    stub = notebook.cells[at(notebook, "solution")]
    text = nbformat.v4.new_markdown_cell(f"```python\n{stub.source}\n```", id=stub.id, metadata=stub.metadata)
    notebook.cells[at(notebook, "solution")] = text


def check_made_text(notebook):
    check = notebook.cells[at(notebook, "grade")]
    notebook.cells[at(notebook, "grade")] = nbformat.v4.new_markdown_cell(check.source, metadata=check.metadata)


def copied_stub(notebook):
    where = at(notebook, "solution")
    copy = deepcopy(notebook.cells[where])
    copy.source, copy["id"] = "# a copy", "copied"
    notebook.cells.insert(where + 1, copy)


def answered_in_the_copy(notebook):
    copied_stub(notebook)
    where = at(notebook, "solution")
    notebook.cells[where + 1].source, notebook.cells[where].source = notebook.cells[where].source, stub_source(notebook)


def answered_above(notebook):
    """The stub is as it was handed out, and the answer stands in a cell above it."""
    where = at(notebook, "solution")
    answer = notebook.cells[where].source
    notebook.cells[where].source = stub_source(notebook)
    notebook.cells.insert(where, nbformat.v4.new_code_cell(answer))


def stub_source(notebook):
    name = mark(notebook.cells[at(notebook, "solution")])
    return next(cell.source for cell in OUT.cells if mark(cell) == name)


def copied_check(notebook):
    where = at(notebook, "grade")
    notebook.cells.insert(where + 1, deepcopy(notebook.cells[where]))
    notebook.cells[where + 1]["id"] = "copied"


def renamed(notebook):
    notebook.cells[at(notebook, "grade")].metadata["nbgrader"]["grade_id"] = "another-name"


def without_metadata(notebook):
    for cell in notebook.cells:
        cell.metadata = nbformat.NotebookNode()


def without_metadata_and_ids(notebook):
    """As an old nbformat, through a program that keeps text alone."""
    without_metadata(notebook)
    notebook.nbformat_minor = 2
    for cell in notebook.cells:
        cell.pop("id", None)


def by_colab(notebook):
    notebook.metadata["colab"] = {"provenance": []}
    notebook.nbformat_minor = 0
    for cell in notebook.cells:
        cell.metadata["id"] = cell.pop("id")


def without_outputs(notebook):
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None


def stub_at_the_end(notebook):
    notebook.cells.append(notebook.cells.pop(at(notebook, "solution")))


def answer_in_a_cell_of_its_own(notebook):
    """The stub was deleted, and the function is written somewhere else, with a helper above it."""
    answer = notebook.cells.pop(at(notebook, "solution")).source
    notebook.cells.insert(at(notebook, "grade"), nbformat.v4.new_code_cell("helper = 1"))
    notebook.cells.insert(at(notebook, "grade"), nbformat.v4.new_code_cell(answer))


BROKEN = [
    deleted_check, split, merged, stub_made_text, check_made_text, copied_stub, answered_in_the_copy, answered_above,
    copied_check, renamed, without_metadata, without_metadata_and_ids, by_colab, without_outputs, stub_at_the_end,
    answer_in_a_cell_of_its_own,
]  # fmt: skip


@pytest.mark.parametrize("broken", BROKEN, ids=lambda one: one.__name__)
def test_every_right_answer_of_a_broken_notebook_has_its_point(broken):
    notebook = solved()
    broken(notebook)
    done = mending.mended(OUT, notebook).notebook
    assert [mark(cell) for cell in done.cells if mark(cell)] == [mark(cell) for cell in OUT.cells if mark(cell)]
    assert points(done) == dict.fromkeys(RIGHT, True)
    nbformat.validate(done)


@pytest.mark.parametrize("broken", BROKEN, ids=lambda one: one.__name__)
def test_no_wrong_answer_of_a_broken_notebook_has_a_point(broken):
    wrong = {name: "def " + code.split("def ")[1].split("\n")[0] + "\n    return 0" for name, code in RIGHT.items()}
    notebook = solved(wrong)
    broken(notebook)
    assert points(mending.mended(OUT, notebook).notebook) == dict.fromkeys(RIGHT, False)


def test_a_deleted_answer_has_no_point_and_the_others_have_theirs():
    notebook = solved()
    name = mark(notebook.cells.pop(at(notebook, "solution")))
    done = mending.mended(OUT, notebook)
    assert points(done.notebook) == {one: one != name for one in RIGHT}
    assert done.sentences == (f"{name}: the cell is missing, and stands as it was handed out.",)


def test_an_empty_answer_without_its_mark_is_known_by_its_id():
    notebook = solved()
    where = at(notebook, "solution")
    name = mark(notebook.cells[where])
    notebook.cells[where].source, notebook.cells[where].metadata = "", nbformat.NotebookNode()
    assert mending.mended(OUT, notebook).sentences == (f"{name}: its cell had lost its mark.",)


def test_an_answer_beside_its_cell_is_said_to_be_there():
    notebook = solved()
    name = mark(notebook.cells[at(notebook, "solution")])
    answered_above(notebook)
    assert f"{name}: the answer stood in another cell." in mending.mended(OUT, notebook).sentences


def test_a_whole_notebook_is_left_as_it_is():
    notebook = solved()
    notebook.cells.insert(3, nbformat.v4.new_code_cell("mine = 1"))
    done = mending.mended(OUT, notebook)
    assert done.sentences == ()
    assert [cell.source for cell in done.notebook.cells] == [cell.source for cell in notebook.cells]


def test_another_lesson_is_refused():
    (other,) = lessons_folder().glob("05_*.ipynb")
    with pytest.raises(mending.AnotherNotebookError, match=r"of the \d+ cells that were handed out are in it"):
        mending.mended(OUT, notebooks.read(other))


def test_half_of_the_cells_make_it_the_same_notebook():
    half = (len(OUT.cells) + 1) // 2
    notebook = solved()
    notebook.cells = notebook.cells[:half]
    assert mending.mended(OUT, notebook).notebook.cells
    notebook.cells = notebook.cells[: half - 1]
    with pytest.raises(mending.AnotherNotebookError):
        mending.mended(OUT, notebook)


# The command ---------------------------------------------------------------------------------------------------------


def course(folder):
    """nbgrader's folders: one student whose notebook is whole, one with a mark there twice, three that are lost."""
    notebooks_of = {"ann": solved(), "bob": solved()}
    copied_check(notebooks_of["bob"])
    texts = {name: notebooks.text_of(notebook) for name, notebook in notebooks_of.items()}
    (other,) = lessons_folder().glob("05_*.ipynb")
    texts |= {"cut": texts["ann"][:2000], "empty": "", "other": other.read_text(encoding="utf-8")}
    for name, text in texts.items():
        path = folder / "submitted" / name / "lesson03" / LESSON.name
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")
    (folder / "release" / "lesson03").mkdir(parents=True)
    notebooks.write(OUT, folder / "release" / "lesson03" / LESSON.name)
    return texts


def test_the_command_mends_what_it_can_and_loses_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    texts = course(tmp_path)
    assert main(["mend", "submitted", "release"]) == 1
    told = capsys.readouterr()
    path = {name: tmp_path / "submitted" / name / "lesson03" / LESSON.name for name in texts}
    assert all(path[name].read_text(encoding="utf-8") == texts[name] for name in texts if name != "bob")
    kept = path["bob"].with_name(LESSON.name + ".handed-in")
    assert kept.read_text(encoding="utf-8") == texts["bob"]
    marks = [mark(cell) for cell in notebooks.read(path["bob"]).cells if mark(cell)]
    assert len(marks) == len(set(marks))
    assert "2 cells have its mark" in told.out
    assert told.out.splitlines()[-1] == "2 of 5 notebooks can be graded."
    for name, words in (("cut", "is not a notebook"), ("empty", "is not a notebook"), ("other", "it is not 03_")):
        assert any(name in line and words in line for line in told.err.splitlines())
    assert len(told.err.splitlines()) == 3
    mended = path["bob"].read_text(encoding="utf-8")
    assert main(["mend", "submitted", "release"]) == 1
    assert path["bob"].read_text(encoding="utf-8") == mended
    assert kept.read_text(encoding="utf-8") == texts["bob"]


@pytest.mark.parametrize(("folders", "words"), [
    (("submitted", "nowhere"), "nowhere: expected ASSIGNMENT/NAME.ipynb"),
    (("nowhere", "release"), "nowhere: expected STUDENT/ASSIGNMENT/NAME.ipynb"),
])  # fmt: skip
def test_a_folder_without_notebooks_is_told(tmp_path, monkeypatch, capsys, folders, words):
    monkeypatch.chdir(tmp_path)
    course(tmp_path)
    assert main(["mend", *folders]) == 2
    assert words in capsys.readouterr().err


def test_what_is_no_notebook_inside_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    course(tmp_path)
    for name, content in (("cut", {"a": 1}), ("empty", []), ("other", {"nbformat": 4, "cells": 3})):
        path = tmp_path / "submitted" / name / "lesson03" / LESSON.name
        path.write_text(json.dumps(content), encoding="utf-8")
    assert main(["mend", "submitted", "release"]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 3
