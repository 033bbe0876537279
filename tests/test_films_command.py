"""`camviz calibrate film.mp4`: films and phones' stills in place of pictures, and what is said of them."""

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from commandline import main, refused
from PIL import Image

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.colour.picture_files import PictureError, picture_exif, read_gray
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Board
from camviz_clinic.files import Calibration, write
from camviz_clinic.films.stills import as_png
from camviz_clinic.films.virtual import take, write_film

BOARD = Board(7, 5, 0.03)
LEFT = Camera(Intrinsics(240, 180, 200, 200, 121, 89), BrownConrady(-0.1, 0.02))
RIGHT = LEFT.at(RigidTransform.from_translation([0.08, 0, 0]))
WORDS = ["--board", "7x5", "--square-mm", "30", "--finder", "classic", "--workers", "1", "--fix", "k3"]


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """left.avi and right.avi, the films of a pair."""
    folder, rng = tmp_path_factory.mktemp("films"), np.random.default_rng(3)
    filmed = take(rng, LEFT, BOARD, 7, others=(RIGHT,), rest_s=0.1, way_s=0.5, rate=6.0, exposure_s=0.0)
    write_film(folder / "left.avi", filmed, rng)
    write_film(folder / "right.avi", filmed.by(RIGHT), rng)
    return SimpleNamespace(folder=folder, filmed=filmed)


@pytest.fixture
def films(shot, room, monkeypatch):
    """The films in the current folder, and a place for what is kept meanwhile, which must be empty in the end."""
    for name in ("left.avi", "right.avi"):
        (room / name).write_bytes((shot.folder / name).read_bytes())
    (room / "meanwhile").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(room / "meanwhile"))
    yield shot
    assert list((room / "meanwhile").iterdir()) == []


@pytest.mark.thorough
def test_a_film_gives_a_camera_whose_views_are_named_by_frame(films, capsys):
    assert main(["calibrate", "left.avi", *WORDS, "--frames", "8"]) == 0
    said = capsys.readouterr().out
    assert "left.avi: 8 frames were chosen, of " in said
    found = camviz_clinic.load("camera.yaml")
    assert len(found.pictures["camera"]) == 8
    assert all(name.startswith("left_0000") for name in found.pictures["camera"])
    assert found.cameras["camera"].intrinsics.fx == pytest.approx(200, rel=0.02)
    numbers = [int(name[-8:-4]) for name in found.pictures["camera"]]
    assert numbers == sorted(numbers)


@pytest.mark.thorough
def test_a_report_shows_the_frames(films, room):
    assert main(["calibrate", "left.avi", *WORDS, "--frames", "8", "--report", "page.html"]) == 0
    assert "data:image/" in (room / "page.html").read_text(encoding="utf-8")  # in the page, not beside it


def test_a_film_that_breaks_off_is_used_as_far_as_it_goes_and_the_frame_is_named(films, room, capsys):
    whole = (room / "left.avi").read_bytes()
    (room / "left.avi").write_bytes(whole[: len(whole) * 4 // 5])
    assert main(["calibrate", "left.avi", *WORDS, "--frames", "8"]) == 0
    said = capsys.readouterr().out
    count = films.filmed.frames
    assert f" of {count} (" in said
    assert "where it is damaged or was interrupted; what comes before was used." in said
    assert any("the film ends at frame" in note for note in camviz_clinic.load("camera.yaml").notes)


@pytest.mark.thorough
def test_films_of_a_pair_give_their_baseline(films, capsys):
    assert main(["calibrate", "left.avi", "--right", "right.avi", *WORDS, "--frames", "8", "-o", "pair.yml"]) == 0
    found = camviz_clinic.load("pair.yml")
    assert found.cameras["right"].centre == pytest.approx([0.08, 0, 0], abs=2e-3)
    left, right = (found.pictures[name] for name in ("left", "right"))
    assert [name[-10:] for name in left] == [name[-10:] for name in right]


@pytest.mark.thorough
def test_films_of_a_rig_place_its_cameras_by_their_names(films, capsys):
    words = ["calibrate", "--rig", "left.avi", "right.avi", *WORDS, "--frames", "99", "-o", "rig.toml"]
    assert main(words) == 0
    assert "right stands " in capsys.readouterr().out
    found = camviz_clinic.load("rig.toml")
    assert list(found.cameras) == ["left", "right"]
    assert found.cameras["right"].centre == pytest.approx([0.08, 0, 0], abs=2e-3)


@pytest.mark.parametrize(("longer", "verdicts"), [(1.0, "pass warn inconclusive"), (1.08, "fail")])
def test_a_calibration_is_checked_by_a_film(films, capsys, longer, verdicts):
    """The film's own camera is not refused; one with a focal length 8 % longer is."""
    used = replace(LEFT, intrinsics=replace(LEFT.intrinsics, fx=longer * 200, fy=longer * 200))
    write(Calibration({"camera": used}, Path("used.yaml"), "opencv", board=BOARD), "used.yaml", "opencv")
    main(["check", "used.yaml", "left.avi", "--finder", "classic", "--frames", "20", "--json"])
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"] in verdicts.split()
    assert any("left.avi: " in note and " frames were chosen, of " in note for note in said["notes"])


@pytest.mark.thorough
@pytest.mark.parametrize(("apart", "verdicts"), [(0.08, "pass warn inconclusive"), (0.095, "fail")])
def test_a_pair_is_checked_by_its_two_films(films, capsys, apart, verdicts):
    """A rig with its true baseline is not refused; one whose cameras have moved apart by 15 mm is."""
    beside = LEFT.at(RigidTransform.from_translation([apart, 0, 0]))
    pair = Calibration({"left": LEFT, "right": beside}, Path("pair.yaml"), "kalibr", board=BOARD)
    write(pair, "pair.yaml", "kalibr")
    words = ["--board", "7x5", "--square-mm", "30", "--finder", "classic", "--frames", "20", "--json"]
    main(["check", "pair.yaml", "left.avi", "--right", "right.avi", *words])
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"] in verdicts.split()
    assert sum(" frames were chosen, of " in note for note in said["notes"]) == 2


def test_what_films_cannot_be_is_refused_in_one_sentence(films, room, capsys):
    def why(*words):
        return refused(capsys, room, "calibrate", *words, *WORDS)

    picture = np.zeros((180, 240), np.uint8)
    (room / "shots").mkdir()
    cv2.imwrite("shots/a.png", picture)
    (room / "text.mp4").write_text("no film")
    (room / "none").mkdir()
    assert "text.mp4: it is not a film that can be read, it begins with" in why("text.mp4")
    assert "gone.mp4: there is no such picture or folder" in why("gone.mp4")
    assert "none: there are no pictures in this folder" in why("none")
    assert "--frames is for films" in why("shots", "--frames", "9")
    assert "expected a number of frames from 3 to 999, got '2'" in why("left.avi", "--frames", "2")
    assert "left.avi: this would overwrite left.avi" in why("left.avi", "-o", "left.avi")
    assert "--right: expected one film of each camera" in why("left.avi", "--right", "shots")
    assert "--rig: expected films of all cameras or pictures of all" in why("--rig", "left.avi", "shots")
    assert "--rig: expected a film of each of at least two cameras" in why("--rig", "left.avi")
    assert "--model-of: expected one of the cameras left, right" in why(
        "--rig", "left.avi", "right.avi", "--model-of", "cam9=fisheye"
    )
    assert "fixed must be some of" in refused(capsys, room, "calibrate", "left.avi", *WORDS, "--fix", "k9")


@pytest.mark.thorough
def test_a_film_of_another_board_says_so_as_pictures_do(films, room, capsys):
    words = ["--board", "5x4", "--square-mm", "30", "--charuco", "4X4_50", "--workers", "1"]
    assert "was found in any of " in refused(capsys, room, "calibrate", "left.avi", *words)


def test_without_pillow_heif_one_sentence_says_how_to_get_it(room, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    (room / "a.heic").write_bytes(b"\0\0\0\x1cftypheic")
    assert main(["calibrate", "a.heic", *WORDS]) == 3
    assert capsys.readouterr().err == (
        'camviz: a.heic: reading HEIC needs pillow-heif, which is not installed: pip install "camviz[heic]".\n'
    )


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_phones_still_has_the_sensors_rows_and_columns_and_its_exif(orientation, tmp_path):
    """As a JPEG with the same flag has, which is read as it was recorded."""
    heif = pytest.importorskip("pillow_heif")
    heif.register_heif_opener()
    gray = np.zeros((48, 64), np.uint8)
    gray[:16, :8], gray[32:, :8] = 255, 128
    recorded = Image.fromarray(gray).convert("RGB")
    exif = recorded.getexif()
    exif[0x0112], exif[0x010F] = orientation, "Maker"
    recorded.save(tmp_path / "still.heic", exif=exif.tobytes(), quality=-1)
    recorded.save(tmp_path / "still.jpg", exif=exif, quality=98)
    found = as_png(tmp_path / "still.heic", tmp_path)
    assert np.abs(read_gray(found).astype(int) - read_gray(tmp_path / "still.jpg")).max() < 12
    assert picture_exif(found)[0x010F] == "Maker"


@pytest.mark.thorough
def test_heic_stills_calibrate_a_camera_and_a_damaged_one_is_named(shot, room, capsys):
    heif = pytest.importorskip("pillow_heif")
    heif.register_heif_opener()
    rng, still = np.random.default_rng(4), replace(shot.filmed, rate=2.0)
    for number, picture in enumerate(still.pictures(rng), 1):
        Image.fromarray(picture).convert("RGB").save(room / f"IMG_{number:02}.HEIC", quality=95)
    whole = (room / "IMG_01.HEIC").read_bytes()
    (room / "IMG_01.HEIC").write_bytes(whole[: len(whole) // 2])
    assert main(["calibrate", ".", *WORDS]) == 0
    assert "IMG_01.HEIC: skipped, it is not a HEIC picture, or it is cut off or damaged." in capsys.readouterr().out
    assert camviz_clinic.load("camera.yaml").cameras["camera"].intrinsics.fx == pytest.approx(200, rel=0.02)
    with pytest.raises(PictureError, match=r"IMG_01\.HEIC: "):
        as_png(room / "IMG_01.HEIC", room)
