"""`camviz calibrate --boards` as one types it: markers on a wall, before two cameras and before one."""

from pathlib import Path

import cv2
import examples
import numpy as np
import pytest
from examples import BEFORE_WALL, MARKERS, PLACES

from camviz_clinic.commands.board_notes import size_sentence
from camviz_clinic.commands.command import main
from camviz_clinic.commands.several import read_boards
from camviz_clinic.files import load

FILE = "".join(
    f'{name} = "--markers 4X4_50 --board 1x1 --first-id {number} --square-mm 120"\n'
    for number, name in enumerate(MARKERS)
)
BIAS = 0.001  # of all lengths: a marker of 45 pixels is found 0.04 px too large


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    examples.shoot_wall(folder / "wall")
    return folder


@pytest.fixture
def room(wall, monkeypatch):
    monkeypatch.chdir(wall)
    return BEFORE_WALL


@pytest.fixture
def empty_room(tmp_path, monkeypatch):
    """Pictures that show nothing."""
    monkeypatch.chdir(tmp_path)
    Path("wall/cam0").mkdir(parents=True)
    for number in range(3):
        cv2.imwrite(f"wall/cam0/{number}.png", np.full((480, 640), 200, np.uint8))


def stands(said, name):
    """How far something stands, and σ of it, in mm."""
    line = next(line for line in said.splitlines() if line.startswith(f"{name} stands "))
    return float(line.split()[2]), float(line.split()[4])


@pytest.mark.thorough
def test_two_cameras_and_the_markers_of_a_wall_are_placed_told_of_and_written(room, capsys):
    words = ["calibrate", "--rig", "wall/cam0", "wall/cam1", "--boards", "wall.toml", "--fix", "k3", "--workers", "1"]
    assert main([*words, "-o", "rig.toml", "--places", "solved.toml", "--report", "rig.html"]) == 0
    said = capsys.readouterr().out
    back = load("rig.toml")
    assert np.linalg.norm(back.cameras["cam1"].centre - room["cam1"].centre) < 0.01
    distance, sigma = stands(said, "cam1")
    assert abs(distance - 1000 * np.linalg.norm(room["cam1"].centre)) < 4 * sigma + BIAS * distance
    for number, name in enumerate(MARKERS[1:], start=1):
        distance, sigma = stands(said, name)
        assert abs(distance - 1000 * np.linalg.norm(PLACES[number].translation)) < 4 * sigma + BIAS * distance
    assert "solved.toml: written; --boards reads it." in said
    assert "door.board" not in said
    assert "<html" in Path("rig.html").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_places_that_were_written_are_read_and_held(room, capsys):
    words = ["calibrate", "wall/cam0", "--fix", "k3", "--workers", "1", "-o"]
    assert main([*words, "camera.yaml", "--boards", "wall.toml", "--places", "solved.toml"]) == 0
    free = capsys.readouterr().out
    assert list(read_boards(Path("solved.toml")).known) == list(MARKERS[1:])
    assert main([*words, "held.yaml", "--boards", "solved.toml"]) == 0
    held = capsys.readouterr().out
    assert "shelf stands " in free
    assert "shelf stands " not in held
    fx = [load(file).cameras["camera"].intrinsics.fx for file in ("camera.yaml", "held.yaml")]
    assert fx[0] == pytest.approx(room["cam0"].intrinsics.fx, rel=0.02)
    assert fx[1] == pytest.approx(fx[0], rel=0.005)


def film(path, pictures):
    """Each picture rests for three frames."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 6.0, cv2.imread(str(pictures[0])).shape[1::-1])
    for picture in pictures:
        for _ in range(3):
            writer.write(cv2.imread(str(picture)))
    writer.release()


@pytest.mark.thorough
def test_films_of_several_boards_give_frames_by_which_cameras_and_markers_are_placed(room, capsys):
    for name in room:
        film(f"{name}.avi", sorted(Path("wall", name).iterdir()))
    words = ["calibrate", "--rig", "cam0.avi", "cam1.avi", "--boards", "wall.toml", "--fix", "k3", "--workers", "1"]
    assert main([*words, "--frames", "7", "-o", "filmed.toml"]) == 0
    said = capsys.readouterr().out
    assert "cam0.avi: 7 frames were chosen, of " in said
    assert np.linalg.norm(load("filmed.toml").cameras["cam1"].centre - room["cam1"].centre) < 0.02
    for number, name in enumerate(MARKERS[1:], start=1):
        distance, sigma = stands(said, name)
        assert abs(distance - 1000 * np.linalg.norm(PLACES[number].translation)) < 4 * sigma + BIAS * distance


@pytest.mark.parametrize(
    ("text", "words", "why"),
    [
        (None, [], "none.toml: there is no such file"),
        ("a = 3", [], "bad.toml: a: expected options in quotes"),
        ('a = "--board 9x6 --square-mm 30"', [], "bad.toml: expected at least two boards, got 1"),
        ('a = "--board 9x6"\nb = "--board 9x6 --square-mm 30"', [], "bad.toml: a: a board has both"),
        ('a = "--bord 9x6"\nb = "--board 9x6 --square-mm 30"', [], "bad.toml: a: a board has both"),
        (f'{FILE}apart = ["door"]', [], "bad.toml: expected apart to be lists of the boards door, shelf, lamp, desk"),
        (f'{FILE}apart = [["door"], ["door"]]', [], "each named once"),
        (
            f'{FILE}hat = {{board = "--board 9x6 --square-mm 3", place = [[1, 0, 0, 0]]}}',
            [],
            "bad.toml: hat: expected place to be three rows of four numbers",
        ),
        (FILE, ["--board", "9x6"], "--boards says which boards there are, all flat: leave --board out"),
        (FILE, ["--board-warp", "on"], "leave --board-warp on out"),
        (FILE.replace("4X4", "6X6"), [], "camera: none of the boards door, shelf, lamp, desk is in its 3 pictures"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(empty_room, capsys, text, words, why):
    if text is not None:
        Path("bad.toml").write_text(text, encoding="utf-8")
    file = "none.toml" if text is None else "bad.toml"
    assert main(["calibrate", "wall/cam0", "--boards", file, "--workers", "1", "-o", "out.yaml", *words]) == 2
    said = capsys.readouterr().err
    assert why in said
    assert len(said.strip().splitlines()) == 1


@pytest.mark.thorough
def test_markers_of_another_dictionary_are_none_of_the_boards(room, capsys):
    Path("bad.toml").write_text(FILE.replace("4X4", "6X6"), encoding="utf-8")
    assert main(["calibrate", "wall/cam0", "--boards", "bad.toml", "--workers", "1", "-o", "out.yaml"]) == 2
    assert "camera: none of the boards door, shelf, lamp, desk is in its 10 pictures" in capsys.readouterr().err


def test_places_are_for_several_boards(empty_room, capsys):
    assert main(["calibrate", "cam0", "--board", "9x6", "--square-mm", "20", "--places", "out.toml"]) == 2
    assert "--places is for several boards: name them with --boards." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("size", "sigma", "said"),
    [
        (1.0041, 0.001, "back is 0.41 ± 0.10 % larger than it is said to be"),
        (0.9959, 0.001, "back is 0.41 ± 0.10 % smaller than it is said to be"),
        (1.0039, 0.001, ""),  # less than four of its σ
        (1.0021, 0.00001, "larger"),
        (1.0019, 0.00001, ""),  # as good as a printer is
    ],
)
def test_a_size_is_doubted_where_that_is_certain_and_matters(size, sigma, said):
    sentence = size_sentence("back", size, sigma)
    assert said in sentence
    assert bool(sentence) == bool(said)
