"""A reader's lessons are laid out, kept and opened, whatever was done to them."""

import os
import sys
import types

import pytest
from commandline import ROOT, refused

from camviz_clinic.commands.command import main
from camviz_school.commands import lab
from camviz_school.course import material
from camviz_school.course.working_copy import MANIFEST, lay_out


@pytest.fixture
def lessons(tmp_path):
    """A package's lessons: two notebooks and a picture."""
    source = tmp_path / "package"
    (source / "images").mkdir(parents=True)
    for name in ("00_start.ipynb", "01_pinhole.ipynb", "images/box.svg"):
        (source / name).write_text(f"first {name}")
    return source


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in folder.rglob("*")
        if path.is_file() and path.name != MANIFEST
    }


def test_a_first_copy_has_every_lesson(lessons, tmp_path):
    (lessons / ".ipynb_checkpoints").mkdir()
    (lessons / ".ipynb_checkpoints" / "old.ipynb").write_text("old")
    sentences = lay_out(lessons, tmp_path / "copy", "1")
    assert set(contents(tmp_path / "copy")) == {"00_start.ipynb", "01_pinhole.ipynb", "images/box.svg"}
    assert len(sentences) == 1


def test_a_second_start_changes_nothing(lessons, tmp_path):
    lay_out(lessons, tmp_path / "copy", "1")
    (tmp_path / "copy" / "00_start.ipynb").write_text("mine")
    before = contents(tmp_path / "copy")
    assert lay_out(lessons, tmp_path / "copy", "1") == []
    assert contents(tmp_path / "copy") == before


def test_a_lesson_that_was_deleted_comes_back(lessons, tmp_path):
    lay_out(lessons, tmp_path / "copy", "1")
    (tmp_path / "copy" / "00_start.ipynb").unlink()
    lay_out(lessons, tmp_path / "copy", "1")
    assert contents(tmp_path / "copy")["00_start.ipynb"] == "first 00_start.ipynb"


def test_a_new_version_replaces_only_what_was_not_changed(lessons, tmp_path):
    """The changed lesson stays; its new version lies beside it, is said once, and is itself kept up to date."""
    copy = tmp_path / "copy"
    lay_out(lessons, copy, "1")
    (copy / "00_start.ipynb").write_text("mine")
    for name in ("00_start.ipynb", "01_pinhole.ipynb"):
        (lessons / name).write_text(f"second {name}")
    sentences = lay_out(lessons, copy, "2")
    assert contents(copy) == {
        "00_start.ipynb": "mine",
        "00_start.new-2.ipynb": "second 00_start.ipynb",
        "01_pinhole.ipynb": "second 01_pinhole.ipynb",
        "images/box.svg": "first images/box.svg",
    }
    assert len(sentences) == 1
    assert "00_start.new-2.ipynb" in sentences[0]
    assert lay_out(lessons, copy, "2") == []


def test_what_a_reader_wrote_into_the_new_version_stays_too(lessons, tmp_path):
    copy = tmp_path / "copy"
    lay_out(lessons, copy, "1")
    (copy / "00_start.ipynb").write_text("mine")
    (lessons / "00_start.ipynb").write_text("second")
    lay_out(lessons, copy, "2")
    (copy / "00_start.new-2.ipynb").write_text("mine as well")
    (lessons / "00_start.ipynb").write_text("second, corrected")
    lay_out(lessons, copy, "2")
    assert contents(copy)["00_start.ipynb"] == "mine"
    assert contents(copy)["00_start.new-2.ipynb"] == "mine as well"


def test_a_readers_own_files_are_not_touched(lessons, tmp_path):
    """A file of the same name that camviz never laid out counts as the reader's."""
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "00_start.ipynb").write_text("my own")
    (copy / "notes.md").write_text("my notes")
    lay_out(lessons, copy, "1")
    assert contents(copy)["00_start.ipynb"] == "my own"
    assert contents(copy)["notes.md"] == "my notes"
    assert contents(copy)["00_start.new-1.ipynb"] == "first 00_start.ipynb"


@pytest.mark.parametrize("damage", ["", "[]", '{"files": 3}', "\xff", '{"files": {"../../x": "0"}}'])
def test_without_its_list_every_change_counts_as_the_readers(lessons, tmp_path, damage):
    copy = tmp_path / "copy"
    lay_out(lessons, copy, "1")
    (copy / MANIFEST).write_text(damage, encoding="latin-1")
    (copy / "00_start.ipynb").write_text("mine")
    (lessons / "00_start.ipynb").write_text("second")
    lay_out(lessons, copy, "2")
    assert contents(copy)["00_start.ipynb"] == "mine"


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_links_are_not_written_through(lessons, tmp_path):
    copy = tmp_path / "copy"
    copy.mkdir()
    (tmp_path / "elsewhere.ipynb").write_text("elsewhere")
    (copy / "00_start.ipynb").symlink_to(tmp_path / "elsewhere.ipynb")
    (copy / "01_pinhole.ipynb").symlink_to(tmp_path / "nowhere.ipynb")
    lay_out(lessons, copy, "1")
    assert (tmp_path / "elsewhere.ipynb").read_text() == "elsewhere"
    assert not (tmp_path / "nowhere.ipynb").exists()


@pytest.fixture
def jupyter(monkeypatch):
    """Collects what JupyterLab would be started with."""
    started = []
    labapp = types.ModuleType("jupyterlab.labapp")
    labapp.LabApp = types.SimpleNamespace(launch_instance=started.append)
    monkeypatch.setitem(sys.modules, "jupyterlab.labapp", labapp)
    monkeypatch.setenv("PYTHONPATH", "")
    monkeypatch.setattr(lab.os, "geteuid", lambda: 1000, raising=False)
    return started


def test_a_checkout_opens_its_own_lessons(jupyter, room, capsys):
    assert main(["lab", "--no-browser", "--", "--port=9999"]) == 0
    (words,) = jupyter
    assert words[:4] == [
        f"--ServerApp.root_dir={(ROOT / 'lessons').resolve()}",
        "--ServerApp.jpserver_extensions=camviz_school.server=True",
        "--no-browser",
        "--port=9999",
    ]
    assert list(room.iterdir()) == []


@pytest.mark.parametrize("asked", [[], ["--allow-root"]])
def test_root_is_let_in_and_told(jupyter, room, monkeypatch, capsys, asked):
    """In a container one is root, where JupyterLab by itself would end with an error."""
    monkeypatch.setattr(lab.os, "geteuid", lambda: 0, raising=False)
    assert main(["lab", "--no-browser", "--", *asked]) == 0
    (words,) = jupyter
    assert words.count("--allow-root") == 1
    assert ("You are root" in capsys.readouterr().out) == (not asked)


def test_an_installed_package_lays_out_a_copy(jupyter, room, lessons, monkeypatch, capsys):
    monkeypatch.setattr(lab, "checkout_lessons", lambda: None)
    monkeypatch.setattr(lab, "lessons_folder", lambda: lessons)
    assert main(["lab"]) == 0
    copy = room / "camviz-lessons"
    (words,) = jupyter
    assert (words[0], words[-1]) == (f"--ServerApp.root_dir={copy}", str(copy / "00_start.ipynb"))
    assert "camviz-lessons" in capsys.readouterr().out


def test_the_editions_do_not_overwrite_each_other(jupyter, room, lessons, monkeypatch, capsys):
    """The teacher's edition is not laid out over students' lessons, and opening it does not make it theirs."""
    monkeypatch.setattr(lab, "checkout_lessons", lambda: None)
    monkeypatch.setattr(lab, "lessons_folder", lambda: lessons)
    assert main(["lab"]) == 0
    capsys.readouterr()
    assert "the students' lessons are in this one" in refused(capsys, room, "teacher", "camviz-lessons")
    assert main(["teacher", "mine", "--no-run", "--lesson", "00"]) == 0
    before = contents(room / "mine")
    assert main(["lab", "mine"]) == 0
    assert contents(room / "mine") == before
    assert main(["teacher", "mine", "--no-run", "--lesson", "00"]) == 0


def test_the_lessons_of_a_wheel_are_inside_the_package(tmp_path, monkeypatch):
    """Where there is no pyproject.toml beside the package, the lessons are in camviz_school/_lessons."""
    inside = tmp_path / "site-packages" / "camviz_school" / "_lessons"
    inside.mkdir(parents=True)
    monkeypatch.setattr(material.camviz_school, "__file__", str(inside.parent / "__init__.py"))
    assert material.checkout_lessons() is None
    assert material.lessons_folder() == inside


def test_lab_refuses_a_file_for_a_folder(jupyter, room, capsys):
    (room / "file").write_text("")
    assert "this is a file" in refused(capsys, room, "lab", "file")
    assert jupyter == []


def test_lab_without_jupyterlab_says_how_to_get_it(room, monkeypatch, capsys):
    monkeypatch.setattr(lab, "find_spec", lambda name: None)
    assert main(["lab"]) == 3
    assert "pip install 'camviz[lab]'" in capsys.readouterr().err
    assert list(room.iterdir()) == []


@pytest.mark.thorough
def test_the_teachers_edition_has_every_lesson(room, capsys):
    assert main(["teacher", "mine", "--no-run"]) == 0
    assert {path.name for path in (room / "mine").glob("*.ipynb")} == {
        path.name for path in (ROOT / "lessons").glob("*.ipynb")
    }


def test_the_teachers_edition_keeps_a_teachers_notes(room, capsys):
    assert main(["teacher", "mine", "--no-run", "--lesson", "00"]) == 0
    (written,) = (room / "mine").glob("*.ipynb")
    written.write_text("my notes")
    assert main(["teacher", "mine", "--no-run", "--lesson", "00"]) == 0
    assert written.read_text() == "my notes"


def test_the_teachers_edition_is_not_written_over_the_lessons(room, capsys):
    assert "a folder of its own" in refused(capsys, room, "teacher", str(ROOT / "lessons"))


def test_a_lesson_is_opened_by_its_number(jupyter, room):
    assert main(["lab", "--lesson", "05"]) == 0
    assert jupyter[0][-1] == str((ROOT / "lessons/05_distortion.ipynb").resolve())


def test_a_lesson_that_is_not_there_is_refused_with_those_that_are(jupyter, room, capsys):
    assert main(["lab", "--lesson", "99"]) == 2
    assert "there is no lesson 99" in capsys.readouterr().err
    assert jupyter == []
