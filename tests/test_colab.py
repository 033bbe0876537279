"""A lesson prepared for Colab is still a lesson, and its extra cell does nothing anywhere else."""

import sys
from copy import deepcopy
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from camviz_school.course.colab import INSTALL, badge, prepared
from camviz_school.course.lesson_rules import complaints
from camviz_school.course.notebooks import read, tagged

LESSONS = sorted((Path(__file__).parent.parent / "lessons").glob("*.ipynb"))


@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_every_lesson_is_prepared_and_its_cell_is_folded_above_all_other_code(path):
    lesson = read(path)
    assert badge(path.name) in "".join(cell.source for cell in (lesson.cells[0], *tagged(lesson, "about")))
    (cell,) = (cell for cell in lesson.cells if "colab" in cell.metadata.get("tags", []))
    assert cell.metadata["jupyter"]["source_hidden"]
    assert next(one for one in lesson.cells if one.cell_type == "code") is cell
    assert prepared(lesson, path.name) == lesson


def test_a_lesson_is_prepared_once():
    lesson = read(LESSONS[5])
    bare = deepcopy(lesson)
    bare.cells = [cell for cell in bare.cells if cell.source != INSTALL]
    (about,) = tagged(bare, "about")
    about.source = about.source.replace(f"\n{badge(LESSONS[5].name)}", "")
    made = prepared(bare, LESSONS[5].name)
    assert made == lesson | {"cells": made.cells}
    assert [cell.source for cell in made.cells] == [cell.source for cell in lesson.cells]
    assert complaints(made, LESSONS[5].name) == []


def test_another_cell_under_colabs_tag_is_complained_of():
    made = prepared(read(LESSONS[5]), LESSONS[5].name)
    next(cell for cell in made.cells if cell.source == INSTALL).source = "import camviz"
    assert any("tagged colab must be the same" in each for each in complaints(made, LESSONS[5].name))


def test_the_cell_installs_on_colab_and_does_nothing_elsewhere(monkeypatch, capsys):
    asked, calls = [], []
    monkeypatch.setattr("subprocess.run", lambda words, check: asked.append((words[1:], check)))
    exec(INSTALL, {})
    assert (asked, capsys.readouterr().out) == ([], "")
    google, colab = ModuleType("google"), ModuleType("google.colab")
    colab.output = SimpleNamespace(enable_custom_widget_manager=lambda: calls.append("widgets"))
    monkeypatch.setitem(sys.modules, "google", google)
    monkeypatch.setitem(sys.modules, "google.colab", colab)
    exec(INSTALL, {})
    wheel = "camviz[lab] @ git+https://github.com/camviz/camviz"
    assert asked == [(["-m", "pip", "install", "--quiet", wheel], True)]
    assert calls == ["widgets"]
