"""The command `camviz` does what it says or says in one sentence why not; a reader's lessons are safe from it."""

import io
import json
import os
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import camviz
from camviz import doctor, working_copy
from camviz.command import main
from camviz.commands import lab
from camviz.working_copy import MANIFEST, lay_out

DATA = Path(__file__).parent / "data"
ROOT = Path(camviz.__file__).parents[1]
MONO = "image_width: 640\nimage_height: 480\nK: [{fx}, 0, 320, 0, 500, 240, 0, 0, 1]\nD: [{d}]\n"
BOMB = "a: &a [x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 8)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.fixture
def room(tmp_path, monkeypatch):
    """An empty current folder, apart from the files the tests read."""
    (tmp_path / "room").mkdir()
    monkeypatch.chdir(tmp_path / "room")
    return tmp_path / "room"


@pytest.fixture
def page(monkeypatch):
    """A page writer that can be watched, in place of the real one."""
    writer = types.ModuleType("camviz.page")
    writer.write_page = lambda calibration, path: Path(path).write_text(f"page of {calibration.source.name}")
    monkeypatch.setitem(sys.modules, "camviz.page", writer)
    return writer


def run(*words, **options):
    """The command in a process of its own, as a person runs it."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-m", "camviz", *words], capture_output=True, text=True, env=environment, timeout=60, **options
    )


def refused(capsys, room, *words):
    """The one sentence of a refusal with status 2 that wrote nothing."""
    before = sorted(room.rglob("*"))
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("camviz: ")
    assert err.count("\n") == 1
    assert sorted(room.rglob("*")) == before
    return err


def bad_files(folder):
    """name → (what makes it bad, what the sentence says of it), as written into a folder."""
    calibration = MONO.format(fx=500, d="0, 0, 0, 0, 0")
    pair = "image_size: [640, 480]\n" + "".join(
        f"M{n}: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nD{n}: [0, 0, 0, 0]\n" for n in (1, 2)
    )
    texts = {
        "empty.yml": ("", "the file is empty"),
        "picture.yml": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "this is a PNG picture"),
        "truncated.yml": (calibration[:50], "not valid YAML"),
        "nan.yml": (MONO.format(fx=".nan", d="0, 0, 0, 0"), "expected a finite number"),
        "zero.yml": (MONO.format(fx=0, d="0, 0, 0, 0"), "fx must be a positive focal length"),
        "count.yml": (MONO.format(fx=500, d="0, 0, 0, 0, 0, 0"), "expected 4, 5, 8, 12 or 14 numbers"),
        "rotation.yml": (pair + "R: [1, 0, 0, 0, 1, 0, 0, 0, 2]\nT: [-1, 0, 0]", "expected a rotation"),
        "bomb.yml": (BOMB, "unfolds to more than"),
        "tags.yml": (calibration + "x: !!python/object/apply:os.mkdir [started]", "is refused"),
        "text.yml": ("This is a letter.", "plain text"),
        "escape.yml": ('"\\e[31m": 1', "no camera found"),
    }
    for name, (content, _) in texts.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with (folder / "gigabyte.yml").open("wb") as file:
        file.truncate(2**30)
    (folder / "directory.yml").mkdir()
    said = {name: sentence for name, (_, sentence) in texts.items()}
    return said | {
        "gigabyte.yml": "this one has 1024 MB",
        "directory.yml": "is a directory",
        "missing.yml": "no such file",
    }


BAD = ["empty", "picture", "truncated", "nan", "zero", "count", "rotation", "bomb", "tags", "text", "escape"]


@pytest.mark.parametrize("name", [*BAD, "gigabyte", "directory", "missing"])
def test_bad_input_gets_one_sentence_and_leaves_nothing(capsys, room, name):
    (room.parent / "files").mkdir()
    said = bad_files(room.parent / "files")
    path = room.parent / "files" / f"{name}.yml"
    sentence = refused(capsys, room, "show", str(path))
    assert said[path.name] in sentence
    assert path.name in sentence
    assert not (room / "started").exists()


def test_bad_input_as_a_person_meets_it(room):
    """The real command: one line on stderr, status 2, no traceback, nothing written."""
    tags = MONO.format(fx=500, d="0, 0, 0, 0") + "x: !!python/object/apply:os.mkdir [started]"
    (room.parent / "tags.yml").write_text(tags)
    for file in ("../missing.yml", "../tags.yml"):
        result = run("show", file, cwd=room)
        assert (result.returncode, result.stdout) == (2, "")
        assert result.stderr.count("\n") == 1
        assert list(room.iterdir()) == []


def test_a_file_name_cannot_forge_lines(capsys, room):
    assert "\x1b" not in refused(capsys, room, "show", "no\n\x1b[31mcamviz: all is well.yml")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "COMMAND"),
        (["shwo"], "invalid choice"),
        (["show"], "FILE"),
        (["show", "a.yml", "--size", "640"], "such as 640x480, got '640'"),
        (["show", "a.yml", "--size", "640x-480"], "such as 640x480"),
        (["doctor", "--", "x"], "camviz lab"),
        (["doctor", "--jsn"], "unrecognized arguments: --jsn"),
    ],
)
def test_a_mistaken_command_gets_one_sentence(capsys, room, words, said):
    assert said in refused(capsys, room, *words)


def test_help_teaches(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("lab", "doctor", "show", "examples:", "exit status:", "--size 640x480", "130"))


def test_the_version_is_the_packages():
    assert run("--version").stdout.strip() == f"camviz {camviz.__version__}"


def test_a_size_that_is_missing_is_asked_for(capsys, room, page):
    """The sentence holds the very flag that mends it."""
    file = room.parent / "bare.yml"
    file.write_text(MONO.format(fx=500, d="0, 0, 0, 0").split("\n", 2)[2])
    flag = re.search(r"--size \d+x\d+", refused(capsys, room, "show", str(file)))
    assert main(["show", str(file), *flag[0].split()]) == 0
    assert (room / "bare.html").read_text() == "page of bare.yml"


def test_show_says_what_is_wrong_with_the_renderer_asked_for(capsys, room, page, monkeypatch):
    monkeypatch.setenv("CAMVIZ_RENDERER", "nonsense")
    said = refused(capsys, room, "show", str(DATA / "opencv_stereo.xml"))
    assert "CAMVIZ_RENDERER: 'nonsense' is no renderer; set it to solid or wire" in said


@pytest.mark.parametrize(("free", "status"), [(3 * 10**8, "warn"), (3 * 10**9, "ok"), (None, "ok")])
def test_the_doctor_warns_where_a_lesson_has_no_room(monkeypatch, free, status):
    monkeypatch.setattr(doctor, "_free_memory", lambda: free)
    assert doctor.memory().status == status


def test_show_names_the_page_after_the_file_or_as_told(room, page, capsys):
    assert main(["show", str(DATA / "opencv_stereo.xml")]) == 0
    assert main(["show", str(DATA / "opencv_stereo.xml"), "-o", "pair.html"]) == 0
    assert {path.name for path in room.iterdir()} == {"opencv_stereo.html", "pair.html"}
    assert "pair.html" in capsys.readouterr().out


def test_show_replaces_its_own_page_but_not_the_calibration(capsys, room, page):
    file = room / "camera.html"
    file.write_bytes((DATA / "opencv_stereo.xml").read_bytes())
    assert "would overwrite" in refused(capsys, room, "show", str(file))
    (room / "link.html").symlink_to(file)
    assert "would overwrite" in refused(capsys, room, "show", str(file), "-o", "link.html")
    assert file.read_bytes() == (DATA / "opencv_stereo.xml").read_bytes()
    for _ in range(2):
        assert main(["show", str(file), "-o", "page.html"]) == 0


@pytest.mark.parametrize(("output", "said"), [(".", "directory"), ("nowhere/page.html", "no directory nowhere")])
def test_show_refuses_a_place_it_cannot_write_to(capsys, room, page, output, said):
    assert said in refused(capsys, room, "show", str(DATA / "opencv_stereo.xml"), "-o", output)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no named pipes in folders")
def test_show_does_not_take_the_place_of_a_pipe_or_a_device(capsys, room, page):
    """Written by way of another file, a page would replace /dev/null for everyone, root willing."""
    os.mkfifo(room / "pipe")
    assert "not a regular file" in refused(capsys, room, "show", str(DATA / "opencv_stereo.xml"), "-o", "pipe")
    assert (room / "pipe").is_fifo()


def test_show_refuses_an_output_that_is_no_name(capsys, room, page):
    said = refused(capsys, room, "show", str(DATA / "opencv_stereo.xml"), "-o", "a\0b")
    assert r"'a\x00b' is not a file name" in said


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_show_follows_a_link_to_the_page_it_names(room, page):
    (room / "place").mkdir()
    (room / "link.html").symlink_to("place/page.html")
    for _ in range(2):
        assert main(["show", str(DATA / "opencv_stereo.xml"), "-o", "link.html"]) == 0
    assert (room / "link.html").is_symlink()
    assert (room / "place" / "page.html").read_text() == "page of opencv_stereo.xml"


@pytest.mark.parametrize("error", [28, 30])  # ENOSPC, EROFS
def test_a_page_that_cannot_be_written_is_named_as_it_was_asked_for(capsys, room, page, error):
    def fail(calibration, path):
        raise OSError(error, os.strerror(error), str(path))

    page.write_page = fail
    said = refused(capsys, room, "show", str(DATA / "opencv_stereo.xml"), "-o", "page.html")
    assert said == f"camviz: page.html: cannot be written ({os.strerror(error)}).\n"


def test_a_page_that_fails_half_way_leaves_the_old_one(room, page):
    (room / "page.html").write_text("the old page")

    def fail(calibration, path):
        Path(path).write_text("half a p")
        raise RuntimeError("out of ink")

    page.write_page = fail
    with pytest.raises(RuntimeError, match="ink"):
        main(["show", str(DATA / "opencv_stereo.xml"), "-o", "page.html"])
    assert (room / "page.html").read_text() == "the old page"
    assert len(list(room.iterdir())) == 1


@pytest.mark.skipif(os.name == "nt", reason="POSIX permissions")
def test_a_page_can_be_read_by_whom_other_files_can(room, page):
    (room / "other").write_text("")
    main(["show", str(DATA / "opencv_stereo.xml"), "-o", "page.html"])
    assert (room / "page.html").stat().st_mode == (room / "other").stat().st_mode


def test_show_writes_the_real_page(room):
    result = run("show", str(DATA / "opencv_stereo.xml"), cwd=room)
    assert (result.returncode, result.stderr) == (0, "")
    assert (room / "opencv_stereo.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_an_interruption_ends_quietly(capsys, page, room):
    def interrupted(calibration, path):
        raise KeyboardInterrupt

    page.write_page = interrupted
    assert main(["show", str(DATA / "opencv_stereo.xml")]) == 130
    assert capsys.readouterr() == ("", "")
    assert list(room.iterdir()) == []


def test_a_closed_pipe_is_no_complaint(monkeypatch, capsys):
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    monkeypatch.setattr(doctor, "examine", lambda: [doctor.python()])
    monkeypatch.setattr(sys, "stdout", Closed())
    assert main(["doctor"]) == 0
    sys.stdout.close()
    assert capsys.readouterr().err == ""


# The lessons ---------------------------------------------------------------------------------------------------------


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
    assert words[:3] == [f"--ServerApp.root_dir={(ROOT / 'lessons').resolve()}", "--no-browser", "--port=9999"]
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
    monkeypatch.setattr(lab, "lessons_source", lambda: lessons)
    assert main(["lab"]) == 0
    copy = room / "camviz-lessons"
    assert jupyter == [[f"--ServerApp.root_dir={copy}", str(copy / "00_start.ipynb")]]
    assert "camviz-lessons" in capsys.readouterr().out


def test_the_editions_do_not_overwrite_each_other(jupyter, room, lessons, monkeypatch, capsys):
    """The teacher's edition is not laid out over students' lessons, and opening it does not make it theirs."""
    monkeypatch.setattr(lab, "checkout_lessons", lambda: None)
    monkeypatch.setattr(lab, "lessons_source", lambda: lessons)
    assert main(["lab"]) == 0
    capsys.readouterr()
    assert "the students' lessons are in this one" in refused(capsys, room, "teacher", "camviz-lessons")
    assert main(["teacher", "mine"]) == 0
    before = contents(room / "mine")
    assert main(["lab", "mine"]) == 0
    assert contents(room / "mine") == before
    assert main(["teacher", "mine"]) == 0


def test_the_lessons_of_a_wheel_are_inside_the_package(tmp_path, monkeypatch):
    """Where there is no pyproject.toml beside the package, the lessons are in camviz/_lessons."""
    inside = tmp_path / "site-packages" / "camviz" / "_lessons"
    inside.mkdir(parents=True)
    monkeypatch.setattr(working_copy.camviz, "__file__", str(inside.parent / "__init__.py"))
    assert working_copy.checkout_lessons() is None
    assert working_copy.lessons_source() == inside


def test_lab_refuses_a_file_for_a_folder(jupyter, room, capsys):
    (room / "file").write_text("")
    assert "this is a file" in refused(capsys, room, "lab", "file")
    assert jupyter == []


def test_lab_without_jupyterlab_says_how_to_get_it(room, monkeypatch, capsys):
    monkeypatch.setattr(lab, "find_spec", lambda name: None)
    assert main(["lab"]) == 1
    assert "pip install 'camviz[lab]'" in capsys.readouterr().err
    assert list(room.iterdir()) == []


# The doctor ----------------------------------------------------------------------------------------------------------


def test_a_package_is_held_against_its_range():
    assert doctor.package(Requirement("numpy>=1")).status == "ok"
    old = doctor.package(Requirement("numpy>=999"))
    assert old.status == "missing"
    assert old.remedy == "pip install 'numpy>=999'"
    absent = doctor.package(Requirement("no-such-package-here>=1"), "lab")
    assert (absent.status, absent.detail) == ("warn", "not installed")


def test_the_requirements_are_those_of_the_project():
    listed = {(extra, requirement.name.casefold()) for extra, requirement in doctor.requirements()}
    assert {("", "numpy"), ("", "pyyaml"), ("lab", "jupyterlab")} <= listed
    assert "pytest" not in {name for _, name in listed}


@pytest.mark.parametrize(("asked", "status"), [("wire", "ok"), ("solid", "ok"), ("", "ok"), ("wired", "warn")])
def test_an_unknown_renderer_is_noticed(monkeypatch, asked, status):
    monkeypatch.setenv("CAMVIZ_RENDERER", asked)
    assert doctor.renderer().status == status


def test_widgets_that_jupyterlab_does_not_find_are_noticed(tmp_path):
    (tmp_path / "anywidget").mkdir()
    assert doctor._widget("anywidget", "anywidget", [str(tmp_path)], False).status == "warn"
    (tmp_path / "anywidget" / "package.json").write_text("{}")
    assert doctor._widget("anywidget", "anywidget", [str(tmp_path)], False).status == "ok"
    assert "enable" in doctor._widget("anywidget", "anywidget", [str(tmp_path)], True).remedy


def test_missing_samples_are_a_warning_not_a_fault(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMVIZ_SAMPLES", str(tmp_path))
    monkeypatch.setattr("camviz.samples._pooch", lambda: types.SimpleNamespace(path=tmp_path))
    monkeypatch.setattr("camviz.samples.BASE_URL", "http://127.0.0.1:9/")
    finding = doctor.samples()
    assert (finding.status, finding.detail[:7]) == ("warn", "0 of 29")


def test_the_report_is_the_same_for_people_and_programs(monkeypatch, capsys):
    findings = [doctor.python(), doctor.Finding("rope", "missing", "none", "buy one")]
    monkeypatch.setattr(doctor, "examine", lambda: findings)
    assert main(["doctor"]) == 1
    assert "→ buy one" in capsys.readouterr().out
    assert main(["doctor", "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert (report["ok"], report["findings"][1]["remedy"]) == (False, "buy one")


def test_the_doctor_examines_this_machine():
    """All of it, as a person runs it; nothing that these tests run on is missing."""
    result = run("doctor", "--json")
    report = json.loads(result.stdout)
    assert (result.returncode, report["ok"], result.stderr) == (0, True, "")
    names = {finding["name"] for finding in report["findings"]}
    assert {"Python", "numpy", "OpenGL", "memory", "sample data", "widgets: anywidget"} <= names
    assert all(finding["remedy"] or finding["status"] == "ok" for finding in report["findings"])


# The teacher's edition ----------------------------------------------------------------------------------------------


def test_the_teachers_edition_has_every_lesson_and_keeps_a_teachers_notes(room, capsys):
    assert main(["teacher", "mine"]) == 0
    lessons = {path.name for path in (ROOT / "lessons").glob("*.ipynb")}
    assert {path.name for path in (room / "mine").glob("*.ipynb")} == lessons
    first = room / "mine" / sorted(lessons)[0]
    first.write_text("my notes")
    assert main(["teacher", "mine"]) == 0
    assert first.read_text() == "my notes"


def test_the_teachers_edition_is_not_written_over_the_lessons(room, capsys):
    assert "a folder of its own" in refused(capsys, room, "teacher", str(ROOT / "lessons"))
