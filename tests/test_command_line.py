"""The command line's manners: help, -, near misses, completion, colour, statuses, and text that is safe to print."""

import json
import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import ROOT, on_a_full_disk, refused

import camviz_clinic
from camviz_clinic.commands import terminal
from camviz_clinic.commands.command import main, parser
from camviz_school.course.working_copy import lay_out

DATA = Path(__file__).parent / "data"
STEREO = DATA / "opencv_stereo.xml"
FAULTY = "image_width: 640\nimage_height: 480\nK: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nD: [-1, 0, 0, 0]\n"


def piped(words, data=b"", **environment):
    """The command with bytes on stdin; its status, stdout and stderr as bytes."""
    done = subprocess.run(
        [sys.executable, "-m", "camviz", *words],
        input=data,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        timeout=300,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def test_camviz_alone_helps(capsys):
    assert main([]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("usage: camviz")
    assert err == ""


def test_what_is_found_and_what_is_missing_have_statuses_of_their_own(room, monkeypatch, capsys):
    (room / "faulty.yml").write_text(FAULTY)
    assert main(["inspect", "faulty.yml"]) == 1
    assert main(["inspect", "gone.yml"]) == 2
    monkeypatch.setattr("camviz_school.commands.lab.find_spec", lambda name: None)
    assert main(["lab"]) == 3


def test_a_calibration_goes_through_a_pipe_and_stays_the_same(room):
    status, out, err = piped(["convert", "-", "-", "--to", "opencv"], STEREO.read_bytes())
    assert status == 0
    assert b"-: written from" in err
    (room / "again.yml").write_bytes(out)
    for name, camera in camviz_clinic.load(STEREO).cameras.items():
        again = camviz_clinic.load("again.yml").cameras[name]
        assert (again.intrinsics, again.lens) == (camera.intrinsics, camera.lens)
        np.testing.assert_allclose(again.world_from_cam.as_matrix(), camera.world_from_cam.as_matrix(), atol=1e-12)


def test_inspect_reads_stdin_and_names_it(room):
    status, out, err = piped(["inspect", "-"], FAULTY.encode())
    assert (status, err) == (1, b"")
    assert b"fault" in out
    status, out, err = piped(["inspect", "-"], b"This is a letter.")
    assert (status, out) == (2, b"")
    assert err.startswith(b"camviz: stdin: ")


@pytest.mark.thorough
def test_a_page_and_a_board_can_go_to_stdout(room):
    assert piped(["board", "-o", "-"])[1].startswith(b"%PDF")
    status, out, _ = piped(["show", "-", "-o", "-"], STEREO.read_bytes())
    assert (status, out[:15]) == (0, b"<!DOCTYPE html>")


def test_a_folder_of_colmap_does_not_fit_through_a_pipe(room, capsys):
    assert "which stdout cannot hold" in refused(capsys, room, "convert", str(STEREO), "-", "--to", "colmap")


def test_names_that_begin_with_a_dash_follow_two(room, capsys):
    shutil.copy(STEREO, "-o.xml")
    assert main(["inspect", "--", "-o.xml"]) in (0, 1)
    assert main(["convert", "--to", "opencv", "--", "-o.xml", "-p.yml"]) == 0
    assert (room / "-p.yml").exists()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_completion_of_a_shell_knows_every_command_and_its_choices(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    (commands,) = (action.choices for action in parser()._actions if action.choices)
    first = {"bash": r'compgen -W "(\w.*?)"', "zsh": r"compadd -- (.*?);", "fish": r"use_subcommand -f -a (\w+)"}[shell]
    assert set(" ".join(re.findall(first, script)).split()) == {*commands}
    assert all(word in script for word in ("square-mm", "thin-prism", "sectors", "no-browser"))
    if shutil.which(shell):
        assert subprocess.run([shell, "-n"], input=script, text=True, capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not shutil.which("bash"), reason="needs bash")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["camviz", "insp"], "inspect"),
        (["camviz", "calibrate", "--squ"], "--square-mm"),
        (["camviz", "calibrate", "--model", "fish"], "fisheye"),
        (["camviz", "completion", "z"], "zsh"),
    ],
)
def test_bash_completes_what_is_typed(capsys, typed, offered):
    main(["completion", "bash"])
    words = " ".join(typed)
    asked = f"COMP_WORDS=({words}); COMP_CWORD={len(typed) - 1}; _camviz; echo ${{COMPREPLY[@]}}"
    script = f"{capsys.readouterr().out}\n{asked}"
    assert subprocess.run(["bash"], input=script, text=True, capture_output=True, check=True).stdout.split() == [
        offered
    ]


class Terminal:
    def isatty(self):
        return True


def test_colour_is_for_terminals_and_for_those_who_want_it(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert terminal.wants_colour("auto", Terminal())
    assert not terminal.wants_colour("never", Terminal())
    monkeypatch.setenv("NO_COLOR", "1")
    assert not terminal.wants_colour("auto", Terminal())
    assert terminal.wants_colour("always", Terminal())


def test_what_is_no_terminal_gets_no_colour_unless_it_asks(room, capsys):
    (room / "faulty.yml").write_text(FAULTY)
    main(["inspect", "faulty.yml"])
    assert "\033[" not in capsys.readouterr().out
    main(["inspect", "faulty.yml", "--color", "always"])
    assert "\033[31m" in capsys.readouterr().out


@pytest.mark.sampled(1)
@pytest.mark.parametrize("encoding", [pytest.param("cp1252", marks=pytest.mark.thorough), "ascii", "utf-8"])
def test_what_an_encoding_lacks_is_replaced(room, encoding):
    (room / "faulty.yml").write_text(FAULTY)
    status, out, err = piped(["inspect", "faulty.yml"], PYTHONIOENCODING=encoding)
    assert (status, err) == (1, b"")
    assert b"\033[" not in out  # a pipe
    assert ("✗" if encoding == "utf-8" else "x") + " fault" in out.decode(encoding)
    status, out, err = piped(["inspect", "faulty.yml", "--json"], PYTHONIOENCODING=encoding)
    assert json.loads(out.decode(encoding))["findings"]


@pytest.mark.skipif(os.name == "nt", reason="names of bytes")
def test_a_name_that_is_not_utf_8_is_shown_as_it_can_be(room):
    name = os.fsdecode(b"caf\xe9.xml")
    shutil.copy(STEREO, name)
    status, out, err = piped(["convert", name, os.fsdecode(b"c\xe9.yml"), "--to", "opencv"])
    assert (status, err) == (0, b"")
    assert b"c\\udce9.yml: written" in out


@pytest.mark.parametrize("evil", ["\x1b[31m", "\x9b31m", "\x07", "\x1b]0;title\x07", "\r", "\u202e"])
def test_nothing_printed_commands_the_terminal(capsys, evil):
    terminal.tell(f"a note{evil} of a file\nnext line")
    terminal.say(f"a name{evil}.png")
    out, err = capsys.readouterr()
    assert all(c.isprintable() or c == "\n" for c in out + err)
    assert out.count("\n") == 2
    terminal.tell_json(json.dumps({"name": evil}, ensure_ascii=False))
    printed = capsys.readouterr().out
    assert all(c.isprintable() or c == "\n" for c in printed)
    assert json.loads(printed) == {"name": evil}


def test_every_sentence_of_a_command_goes_by_way_of_what_makes_it_safe():
    own = [path for path in (ROOT / "camviz_clinic/commands").glob("*.py") if path.stem not in ("terminal", "lessons")]
    calls = re.compile(r"^ +print\(", re.MULTILINE)
    printing = [path.name for path in own if calls.search(path.read_text(encoding="utf-8"))]
    assert printing == ["pictures.py"]  # its bar, which holds numbers only


@pytest.mark.skipif(os.name == "nt", reason="POSIX permissions")
@pytest.mark.parametrize("words", [["show", str(STEREO), "-o"], ["convert", str(STEREO), "--to", "opencv"]])
def test_what_only_its_owner_may_read_stays_so(room, capsys, words):
    (room / "out.yml").write_text("before")
    (room / "out.yml").chmod(0o600)
    assert main([*words, "out.yml"]) == 0
    assert stat.S_IMODE((room / "out.yml").stat().st_mode) == 0o600


@pytest.mark.skipif(os.name == "nt", reason="limits the size of files")
def test_lessons_on_a_full_disk_leave_no_part_and_are_named(room):
    program = "from pathlib import Path; from camviz_school.course.working_copy import lay_out\n"
    program += f"lay_out(Path({str(ROOT / 'lessons')!r}), Path('copy'), '1')"
    done = on_a_full_disk("-c", program)
    assert "File too large: 'copy/" in done.stderr.splitlines()[-1]
    assert [path.name for path in (room / "copy").rglob("*") if path.name.startswith(".")] == []


@pytest.mark.skipif(os.name == "nt", reason="limits open files")
def test_a_limit_of_the_machine_is_blamed_and_not_the_file(room, monkeypatch, capsys):
    def fail(*_, **__):
        raise OSError(24, os.strerror(24), "out.yml")

    monkeypatch.setattr("camviz_clinic.commands.common.TemporaryDirectory", fail)
    assert main(["show", str(STEREO), "-o", "out.html"]) == 3
    said = capsys.readouterr().err
    assert "Too many open files" in said
    assert "ulimit -n" in said
    assert "out." not in said


def test_a_changed_new_version_does_not_hide_the_next(tmp_path):
    source, copy = tmp_path / "package", tmp_path / "copy"
    source.mkdir()
    lesson, mine = source / "00_start.ipynb", copy / "00_start.ipynb"
    lesson.write_text("first")
    lay_out(source, copy, "1")
    mine.write_text("mine")
    lesson.write_text("second")
    lay_out(source, copy, "2")
    (copy / "00_start.new-2.ipynb").write_text("mine, too")
    lesson.write_text("third")
    (said,) = lay_out(source, copy, "2")
    assert "00_start.new-2-2.ipynb" in said
    assert (copy / "00_start.new-2-2.ipynb").read_text() == "third"
    assert (copy / "00_start.new-2.ipynb").read_text() == "mine, too"
    assert lay_out(source, copy, "2") == []
