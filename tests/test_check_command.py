"""`camviz check` on photographs, and what it answers to those who ask amiss."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from commandline import refused
from test_files import sample

from camviz_clinic.calibration import CannotCalibrate, calibrate, calibrate_pair, detect
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.virtual import detections, healthy_pair, single
from camviz_clinic.commands.command import main
from camviz_clinic.files.writing import write

BOARD = Board(9, 6, 0.025)


def photographs(side):
    return sorted(sample("left01.jpg").parent.glob(f"{side}??.jpg"))


@pytest.fixture(scope="module")
def found():
    """The corners in all photographs of each camera, found once."""
    return {side: detect(photographs(side), BOARD) for side in ("left", "right")}


@pytest.fixture(scope="module")
def solved_by_half(found):
    """The left camera, calibrated from every other photograph."""
    left = found["left"]
    return calibrate(replace(left, corners=left.corners[::2], pictures=left.pictures[::2], places=()), BOARD)


@pytest.fixture
def half(solved_by_half, room):
    """Its file."""
    write(solved_by_half, room / "half.yaml", "opencv")
    return "half.yaml"


@pytest.fixture(scope="module")
def solved():
    """A virtual camera, calibrated from 20 views."""
    before = replace(single(np.random.default_rng(9), views=20), noise=0.08)
    return before.solved(before.observed(np.random.default_rng(1)))


@pytest.fixture
def virtual(solved, room, monkeypatch):
    """camera.yaml of a virtual camera; its next pictures show what `see` is given."""
    after = replace(single(np.random.default_rng(9), views=25), noise=0.08)
    write(solved, room / "camera.yaml", "opencv")
    cv2.imwrite("new.png", np.zeros((8, 8), np.uint8))

    def see(camera):
        seen = replace(after, cameras=(camera,)).observed(np.random.default_rng(2))[0]
        monkeypatch.setattr(
            "camviz_clinic.calibration.detect", lambda *_, **__: detections(camera, seen), raising=False
        )

    return after, see


def test_every_verdict_has_its_status(virtual, capsys):
    after, see = virtual
    grid = after.camera.intrinsics
    longer = replace(after.camera, intrinsics=replace(grid, fx=1.01 * grid.fx, fy=1.01 * grid.fy))
    half = replace(after.camera, intrinsics=grid.resized(grid.width // 2, grid.height // 2))
    for camera, words, status, verdict in (
        (after.camera, (), 0, "pass"),
        (longer, (), 1, "fail"),
        (half, (), 1, "warn"),
        (after.camera, ("--limit-px", "0.05"), 4, "inconclusive"),
    ):
        see(camera)
        assert main(["check", "camera.yaml", "new.png", *words]) == status
        assert capsys.readouterr().out.startswith(f"{verdict}: camera: ")
        assert main(["check", "camera.yaml", "new.png", *words, "--json"]) == status
        assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail)["verdict"] == verdict


def test_the_other_half_of_the_photographs_does_not_condemn_the_camera_that_took_them(half, capsys):
    """They leave a corner of the image empty, and the board bends from view to view: it cannot be said."""
    others = [str(path) for path in photographs("left")[1::2]]
    assert main(["check", half, *others]) == 4
    out = capsys.readouterr().out
    assert "too few corners in the upper left" in out
    assert "the views differ" in out


def test_another_camera_of_the_same_make_fails(half, capsys):
    """The right camera's principal point is 17 px beside the left one's, its focal length 1 % longer."""
    assert main(["check", half, *map(str, photographs("right"))]) == 1
    assert capsys.readouterr().out.startswith("fail: camera: the calibration does not describe this camera")


def test_a_pair_whose_pictures_are_exchanged_fails(found, room, capsys):
    write(calibrate_pair(found["left"], found["right"], BOARD), room / "pair.yaml", "opencv")
    left, right = ([str(path) for path in photographs(side)[:5]] for side in ("left", "right"))
    assert main(["check", "pair.yaml", *right, "--right", *left, "--json"]) == 1
    judged = json.loads(capsys.readouterr().out)["judgements"][-1]
    assert (judged["of"], judged["verdict"]) == ("left, right", "fail")
    assert judged["numbers"]["rectified_rows_px"]["rms"] > 20
    for words, said in (
        ((), "say with --camera which one"),
        (("--camera", "middle"), "expected --camera to be one of left, right, got middle"),
    ):
        assert said in refused(capsys, room, "check", "pair.yaml", *left, *words)


def test_what_cannot_be_used_is_said_in_one_sentence(half, room, capsys):
    left = str(photographs("left")[0])
    (room / "bare.yaml").write_text(
        "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n"
        "   dt: d\n   data: [530., 0., 320., 0., 530., 240., 0., 0., 1.]\n"
        "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [-.3, .1, 0., 0., 0.]\n"
    )
    for words, said in (
        (("gone.yaml", left), "gone.yaml"),
        (("bare.yaml", left), "say which one the pictures show"),
        ((half, "gone.jpg"), "gone.jpg: there is no such picture or folder"),
        ((half, left, "--board", "9x6"), "a board has both"),
        ((half, left, "--right", left), "--right is for a calibration of one pair, this has the cameras camera"),
        ((half, left, "--limit-px", "0"), "expected a number of pixels"),
        ((half, left, "--board", "8x8", "--square-mm", "25"), "8×8 inner corners"),
    ):
        assert said in refused(capsys, room, "check", *words)


def test_a_projects_gate_decides_about_a_check_as_about_an_inspection(virtual, capsys, room):
    """A camera 1 % longer fails, pictures of half the size are warned of: a gate for faults lets the latter pass."""
    after, see = virtual
    grid = after.camera.intrinsics
    half = replace(after.camera, intrinsics=grid.resized(grid.width // 2, grid.height // 2))
    longer = replace(after.camera, intrinsics=replace(grid, fx=1.01 * grid.fx, fy=1.01 * grid.fy))
    see(half)
    assert main(["check", "camera.yaml", "new.png", "--fail-on", "fault"]) == 0
    assert "\nGate (options): passed.\n" in capsys.readouterr().out
    (room / "camviz.toml").write_text('fail-on = ["fault"]\n[limits]\nrms-px = 0.5\n')
    assert main(["check", "camera.yaml", "new.png"]) == 0
    assert "rms-px is not checked: `camviz inspect` does.\nGate (camviz.toml): passed.\n" in capsys.readouterr().out
    assert main(["check", "camera.yaml", "new.png", "--fail-on", "warning"]) == 1  # the command line wins
    assert "failed by camera (warn)." in capsys.readouterr().out
    see(longer)
    assert main(["check", "camera.yaml", "new.png", "--json"]) == 1
    gate = json.loads(capsys.readouterr().out)["gate"]
    assert gate == {"passed": False, "fail_on": ["fault"], "failed_by": ["fail"]}
    assert "did you mean" in refused(capsys, room, "check", "camera.yaml", "new.png", "--fail-on", "faultt")


def test_the_limit_of_the_file_is_that_of_the_option(virtual, capsys, room):
    """0.05 px is less than can be told: inconclusive (4), which no gate lets pass. The option wins over the file."""
    after, see = virtual
    see(after.camera)
    (room / "camviz.toml").write_text("fail-on = []\n[limits]\nchange-px = 0.05\n")
    assert main(["check", "camera.yaml", "new.png", "--json"]) == 4
    assert json.loads(capsys.readouterr().out)["limit_px"] == 0.05
    assert main(["check", "camera.yaml", "new.png", "--limit", "change-px=1"]) == 0
    assert main(["check", "camera.yaml", "new.png", "--limit-px", "1"]) == 0
    capsys.readouterr()


def test_junit_has_a_case_for_every_camera_that_is_judged(virtual, capsys):
    after, see = virtual
    grid = after.camera.intrinsics
    longer = replace(after.camera, intrinsics=replace(grid, fx=1.01 * grid.fx, fy=1.01 * grid.fy))
    for camera, words, kind in (
        (after.camera, (), "system-out"),
        (longer, (), "failure"),
        (after.camera, ("--limit-px", "0.05"), "error"),
    ):
        see(camera)
        main(["check", "camera.yaml", "new.png", "--junit", "out.xml", *words])
        (suite,) = ElementTree.parse("out.xml").getroot()
        (case,) = suite
        assert (suite.get("name"), case.get("name"), case[0].tag) == ("camera.yaml", "check camera", kind)
    capsys.readouterr()


def test_the_time_that_a_picture_may_take_is_handed_to_the_search(virtual, monkeypatch, capsys, room):
    """As it is in `camviz calibrate`, of one camera and of a pair."""
    asked = []

    def looking(*_, seconds=None, **__):
        asked.append(seconds)
        raise CannotCalibrate("enough")

    monkeypatch.setattr("camviz_clinic.calibration.detect", looking)
    monkeypatch.setattr("camviz_clinic.calibration.detect_pair", looking)
    assert "enough" in refused(capsys, room, "check", "camera.yaml", "new.png", "--seconds", "7")
    write(healthy_pair(np.random.default_rng(0)), room / "pair.yaml", "opencv")
    assert "enough" in refused(capsys, room, "check", "pair.yaml", "new.png", "--right", "new.png", "--seconds", "8")
    assert asked == [7, 8]
    assert "expected a time in seconds" in refused(capsys, room, "check", "camera.yaml", "new.png", "--seconds", "0")
