"""`camviz calibrate --rig` places the cameras that took folders of pictures, says how well, and writes them down."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from camviz_clinic.checks.snapshots import snapshot
from camviz_clinic.commands.command import main
from camviz_clinic.commands.rig import by_camera
from camviz_clinic.files import load
from camviz_clinic.rigs import virtual

WORDS = ["--board", "9x6", "--square-mm", "50", "--workers", "1"]


def shoot(truth, folder, rng):
    """cam0/0003.png …: a picture of every frame in which a camera sees the board, as the camera shows it."""
    for name, camera in truth.cameras.items():
        (folder / name).mkdir(parents=True)
        for frame in np.flatnonzero(truth.seen[name]):
            image = snapshot(camera, truth.board, camera.cam_from_world * truth.world_from_board[int(frame)], rng)
            cv2.imwrite(str(folder / name / f"{frame:04}.png"), image)


@pytest.fixture(scope="module")
def shots(tmp_path_factory):
    rng = np.random.default_rng(11)
    truth = virtual.rig(rng, 3, frames=4, shared=0.75, fisheye=(2,), size=(640, 480))
    folder = tmp_path_factory.mktemp("rig")
    shoot(truth, folder, rng)
    (folder / "cam0" / "0099.png").write_bytes((folder / "cam0" / "0000.png").read_bytes()[:100])
    return truth, folder


@pytest.fixture
def room(shots, monkeypatch):
    monkeypatch.chdir(shots[1])
    return shots[0]


def test_a_rig_of_folders_is_placed_told_of_and_written(room, capsys):
    folders = [f"cam{i}/*.png" for i in range(3)]
    assert main(["calibrate", "--rig", *folders, *WORDS, "--model-of", "cam2=fisheye", "-o", "rig.toml"]) == 0
    said = capsys.readouterr().out
    assert "0099.png: skipped" in said
    assert "cam1 stands " in said
    assert " frames tie it to " in said
    back = load("rig.toml")
    assert list(back.cameras) == ["cam0", "cam1", "cam2"]
    for name in ("cam1", "cam2"):
        assert np.linalg.norm(back.cameras[name].centre - room.cameras[name].centre) < 0.01
    distance = np.linalg.norm(room.cameras["cam1"].centre) * 1000
    line = next(line for line in said.splitlines() if line.startswith("cam1 stands "))
    value, sigma = (float(word) for word in (line.split()[2], line.split()[4]))
    assert abs(value - distance) < 4 * sigma
    assert "rig.toml: written, but without the board, " in said


@pytest.mark.thorough
def test_a_rig_is_written_for_another_program_and_its_known_lens_is_held(room, capsys):
    words = ["calibrate", "--rig", "cam0", "cam1", *WORDS, "--fix", "k3", "--to", "kalibr", "-o"]
    assert main([*words, "chain.yaml"]) == 0
    chain = load("chain.yaml")
    assert chain.format == "Kalibr camchain"
    assert np.linalg.norm(chain.cameras["cam1"].centre - room.cameras["cam1"].centre) < 0.01
    assert main([*words, "held.yaml", "--held", "cam1=chain.yaml"]) == 0
    both = [load(file).cameras["cam1"] for file in ("chain.yaml", "held.yaml")]
    assert both[0].intrinsics == both[1].intrinsics
    assert both[0].lens == both[1].lens


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["cam0", "--rig", "cam1", "cam2"], "--rig names the pictures of all cameras: leave IMAGES out"),
        (["--rig", "cam0", *WORDS], "expected the pictures of at least two cameras"),
        (["--rig", "cam0", "cam1", *WORDS, "--to", "ros"], "ROS CameraInfo holds one camera or a pair, not a rig"),
        (["--rig", "cam0", "cam1", *WORDS, "--to", "rso"], "--to: expected one of "),
        (["--rig", "cam0", "cam1", *WORDS, "--model-of", "cam9=fisheye"], "expected one of the cameras cam0, cam1"),
        (["--rig", "cam0", "cam1", *WORDS, "--model-of", "cam1"], "expected NAME=MODEL, got 'cam1'"),
        (["--rig", "cam0", "cam1", *WORDS, "--model-of", "cam1=fish"], "--model-of cam1: expected one of standard"),
        (["cam0", *WORDS, "--to", "kalibr"], "--to is for a rig of cameras"),
    ],
)
def test_what_cannot_be_a_rig_is_refused_in_one_sentence(room, capsys, words, why):
    assert main(["calibrate", *words]) == 2
    said = capsys.readouterr().err
    assert why in said
    assert said.count("\n") == 1


def test_cameras_are_told_by_folders_or_by_what_stands_before_the_number():
    def named(*paths):
        return lambda _: [Path(path) for path in paths]

    assert list(by_camera(["*"], named("a/1.png", "b/1.png", "b/2.png"))) == ["a", "b"]
    assert list(by_camera(["*"], named("x/cam/1.png", "y/cam/1.png"))) == ["x/cam", "y/cam"]
    assert by_camera(["*"], named("left_01.png", "right_01.png", "left_02.png")) == {
        "left": [Path("left_01.png"), Path("left_02.png")],
        "right": [Path("right_01.png")],
    }
