"""The command `camviz` does what it says or says in one sentence why not; a reader's lessons are safe from it."""

import io
import os
import re
import sys
import types
from pathlib import Path

import pytest
from commandline import refused, run

import camviz
from camviz_clinic.commands.command import main
from camviz_school.commands import machine as doctor

DATA = Path(__file__).parent / "data"
MONO = "image_width: 640\nimage_height: 480\nK: [{fx}, 0, 320, 0, 500, 240, 0, 0, 1]\nD: [{d}]\n"
BOMB = "a: &a [x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 8)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.fixture
def page(monkeypatch):
    """A page writer that can be watched, in place of the real one."""
    writer = types.ModuleType("camviz_clinic.report.page")
    writer.write_page = lambda said, path: Path(path).write_text(f"page of {said.calibration.source.name}")
    monkeypatch.setitem(sys.modules, "camviz_clinic.report.page", writer)
    return writer


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
        "zero.yml": (MONO.format(fx=0, d="0, 0, 0, 0"), "fx = 0: the camera is not calibrated"),
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


def test_bad_input_as_a_person_meets_it(capsys, room):
    """The real command: one line on stderr, status 2, no traceback, nothing written."""
    tags = MONO.format(fx=500, d="0, 0, 0, 0") + "x: !!python/object/apply:os.mkdir [started]"
    (room.parent / "tags.yml").write_text(tags)
    result = run("show", "../tags.yml", cwd=room)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.count("\n") == 1
    assert list(room.iterdir()) == []
    assert "there is no such file" in refused(capsys, room, "show", "../missing.yml")


def test_a_file_name_cannot_forge_lines(capsys, room):
    assert "\x1b" not in refused(capsys, room, "show", "no\n\x1b[31mcamviz: all is well.yml")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["shwo"], "invalid choice"),
        (["shwo"], "did you mean show?"),
        (["calibrate", "a", "--board", "9x6", "--square-mm", "25", "--model", "fishey"], "did you mean fisheye?"),
        (["convert", str(DATA / "opencv_stereo.xml"), "out", "--to", "kalbr"], "did you mean kalibr?"),
        (["board", "--board", "9x6", "--square-mm", "25", "--border-bits", "7"], "invalid choice: 7"),
        (["show"], "FILE"),
        (["show", "a.yml", "--size", "640"], "such as 640x480, got '640'"),
        (["show", "a.yml", "--size", "640x-480"], "such as 640x480"),
        (["doctor", "--", "x"], "unrecognized arguments: -- x"),
        (["doctor", "--jsn"], "unrecognized arguments: --jsn; did you mean --json?"),
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
