"""`camviz calibrate` says what it did, and when it cannot, one sentence why, with nothing half written."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from commandline import on_a_full_disk
from scipy.spatial.transform import RigidTransform, Rotation
from test_calibration import BOARD, picture

import camviz_clinic
from camviz_clinic.commands.command import main

ROOT = Path(__file__).parents[1]
WORDS = ["--board", "9x6", "--square-mm", "25"]


def shots(folder, side="view", count=4, offset=0.0):
    """Pictures of the board by a pinhole with f = 600, from places that a calibration can work with."""
    folder.mkdir(exist_ok=True)
    K = np.array([[600, 0, 320], [0, 600, 240], [0, 0, 1.0]])
    for i in range(count):
        turn = Rotation.from_rotvec([0.5 * np.sin(2 * i + 1), 0.5 * np.cos(1.7 * i), 0.1 * i])
        pose = RigidTransform.from_components([0, 0, 0.4 + 0.02 * i], turn)
        pose = pose * RigidTransform.from_translation(-BOARD.corners.mean(axis=0))
        R, t = pose.rotation.as_matrix(), pose.translation + [offset, 0, 0]
        to_metres = np.array([[1e-3, 0, -0.025], [0, 1e-3, -0.025], [0, 0, 1]])
        cv2.imwrite(
            str(folder / f"{side}{i:02d}.png"), picture(BOARD, K @ np.column_stack([R[:, :2], t]) @ to_metres)[0]
        )
    return folder


@pytest.fixture
def room(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_camera_of_a_folder_is_written_and_read_by_camviz_and_by_opencv(room, capsys):
    shots(room / "shots")
    (room / "shots" / "view99.jpg").write_text("no picture")
    (room / "shots" / "notes.txt").write_text("passed over")
    assert main(["calibrate", "shots", *WORDS, "--workers", "1", "--fix", "k3"]) == 0
    out, err = capsys.readouterr()
    assert "view99.jpg: skipped, it is not a picture that can be read, it begins with 'no picture'." in out
    assert out.endswith("camera.yaml: written.\n")
    assert err == ""
    found = camviz_clinic.load("camera.yaml")
    assert found.cameras["camera"].intrinsics.fx == pytest.approx(600, abs=2)
    assert found.pictures["camera"] == tuple(f"view{i:02d}.png" for i in range(4))
    assert found.skipped == (("view99.jpg", "it is not a picture that can be read, it begins with 'no picture'"),)
    assert found.estimated["camera"] == ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    storage = cv2.FileStorage("camera.yaml", cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), found.cameras["camera"].intrinsics.K)
    assert storage.getNode("image_width").real() == 640
    assert main(["convert", "camera.yaml", "again.xml", "--to", "opencv"]) == 0


def test_a_pair_is_written_with_its_baseline_and_pictures_without_a_partner_are_named(room, capsys):
    shots(room / "l", "left", 5)
    shots(room / "r", "right", 4, offset=-0.05)
    assert main(["calibrate", "l", "--right", "r", *WORDS, "--fix", "k3", "-o", "pair.yml", "--workers", "1"]) == 0
    assert "left04.png: skipped, it has no partner among the pictures of the right camera." in capsys.readouterr().out
    found = camviz_clinic.load("pair.yml")
    assert found.rig.a_from_b("right", "left").translation == pytest.approx([-0.05, 0, 0], abs=1e-3)
    assert found.detections["right"].shape == (4, 54, 2)
    assert ("left04.png", "it has no partner among the pictures of the right camera") in found.skipped


def test_bad_input_is_refused_in_one_sentence_and_nothing_is_written(room):
    shots(room / "shots")
    (room / "none").mkdir()
    (room / "text").mkdir()
    (room / "text" / "a.jpg").write_text("no picture")
    shots(room / "two", count=2)
    cases = [
        (["gone.png"], "gone.png: there is no such picture or folder"),
        (["gone*.png"], "gone*.png: no picture fits this pattern"),
        (["none"], "none: there are no pictures in this folder"),
        (
            ["text"],
            "of the pictures can be used: it is not a picture that can be read, it begins with 'no picture' (a.jpg)",
        ),
        (["two"], "at least 3 views of the board are needed for a calibration, got 2"),
        (["shots", "--right", "two/view00.png"], "at least 3 views in which both cameras see the board"),
        (["shots", "-o", "gone/camera.yaml"], "there is no directory gone to write into"),
        (["shots", "-o", "none"], "expected the name of a calibration to write, this is a directory"),
        (["shots", "-o", "shots/view00.png"], "this would overwrite shots/view00.png"),
        (["shots", "--model", "pinhole"], "invalid choice: 'pinhole'"),
        (["shots", "--fix", "k9"], "fixed must be some of cx, cy, k1"),
    ]
    before = sorted(room.rglob("*"))
    for words, said in cases:
        result = main_captured(["calibrate", *words, *WORDS, "--workers", "1"])
        assert said in result.err, words
        assert (result.status, result.out, result.err.count("\n")) == (2, "", 1)
    wrong = main_captured(["calibrate", "shots", "--board", "7x6", "--square-mm", "25", "--workers", "1"])
    assert "no chessboard with 7×6 inner corners (8×7 squares) was found in any of 4 pictures (view00.png" in wrong.err
    assert sorted(room.rglob("*")) == before


class Captured:
    def __init__(self, status, out, err):
        self.status, self.out, self.err = status, out, err


def main_captured(words):
    import contextlib
    import io

    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        status = main(words)
    return Captured(status, out.getvalue(), err.getvalue())


@pytest.mark.skipif(os.name == "nt", reason="limits the size of files")
def test_a_full_disk_leaves_what_was_there(room):
    shots(room / "shots")
    (room / "camera.yaml").write_text("what was there")
    done = on_a_full_disk("-m", "camviz", "calibrate", "shots", *WORDS, "--workers", "1", cwd=room)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "camviz: camera.yaml: cannot be written (File too large).\n"
    assert (room / "camera.yaml").read_text() == "what was there"
    assert sorted(path.name for path in room.iterdir()) == ["camera.yaml", "shots"]


# A shell's background jobs, in which tests may run, ignore Ctrl-C, and so does what they start.
LISTEN = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"


@pytest.mark.sampled(1)
@pytest.mark.skipif(os.name == "nt", reason="sends Ctrl-C to a group of processes")
@pytest.mark.parametrize("stage", ["detection", "solving"])
def test_ctrl_c_ends_with_130_and_writes_nothing(room, stage):
    shots(room / "shots")
    stop = "import os, signal; os.killpg(0, signal.SIGINT)"
    code = {
        "detection": "import camviz_clinic.commands.calibrate as c\ndef new(*_):\n    STOP\nc.Bar.__call__ = new",
        "solving": "import camviz_clinic.calibration.solving as s\ndef new(a):\n    STOP\ns._settled = new",
    }[stage].replace("STOP", stop)
    words = ["calibrate", "shots", *WORDS, "--workers", "2"]
    start = f"import sys\nfrom camviz_clinic.commands.command import main\nsys.exit(main({words!r}))"
    process = subprocess.run(
        [sys.executable, "-c", f"{LISTEN}{code}\n{start}"],
        capture_output=True,
        text=True,
        cwd=room,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        start_new_session=True,
        timeout=300,
    )
    assert (process.returncode, process.stdout, process.stderr) == (130, "", "")
    assert [path.name for path in room.iterdir()] == ["shots"]
