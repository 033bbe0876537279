"""Damaged files, pictures and command lines: each is read, or refused in one sentence."""

import json
import os
import struct
import zlib
from math import inf, nan
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

import camviz_clinic
from camviz.colour.picture_files import PictureError, allowing, picture_size, read_gray, read_picture
from camviz_clinic.calibration import Board, CannotCalibrate, detect
from camviz_clinic.calibration.finding import look
from camviz_clinic.checks import inspect_file
from camviz_clinic.checks.pictures import sizes_of
from camviz_clinic.commands.command import main
from camviz_clinic.files import CalibrationError
from camviz_clinic.files.output import as_json, json_text
from camviz_school.course.working_copy import MANIFEST, lay_out

DATA = Path(__file__).parent / "data"
BOARD = Board(9, 6, 0.025)
KINDS = ("png", "jpg", "tif", "bmp", "pgm", "webp", "jp2", "hdr")


def picture(path: Path, height: int = 40, width: int = 60) -> bytes:
    """A smooth picture under a name whose ending says the kind; its bytes."""
    values = np.add.outer(np.arange(height), np.arange(width)).astype(np.uint8)
    assert cv2.imwrite(str(path), np.dstack([values] * 3).astype(np.float32) if path.suffix == ".hdr" else values)
    return path.read_bytes()


def chunk(kind: bytes, content: bytes) -> bytes:
    """A chunk of a PNG file, with its length and checksum."""
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(width: int, height: int) -> bytes:
    """A PNG file of few bytes that announces so many pixels of one bit."""
    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    rows = zlib.compress(b"\0" * 1000)
    chunks = ((b"IHDR", header), (b"IDAT", rows), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*each) for each in chunks)


def complaint(path: Path) -> str:
    with pytest.raises(PictureError) as caught:
        read_gray(path)
    assert str(caught.value) == f"{path}: {caught.value.why}"
    assert caught.value.why.isprintable()
    return caught.value.why


# Pictures -------------------------------------------------------------------------------------------------------------


def test_a_bomb_is_refused_by_its_header_before_anything_is_decoded(tmp_path, monkeypatch):
    (tmp_path / "bomb.png").write_bytes(png(30_000, 30_000))
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    bound = Image.MAX_IMAGE_PIXELS
    assert "it has 30000 × 30000 pixels, 900 megapixels, expected at most 64" in complaint(tmp_path / "bomb.png")
    assert bound == Image.MAX_IMAGE_PIXELS  # what others open with Pillow stays guarded


def test_a_limit_can_be_raised_and_lowered(tmp_path, monkeypatch, capsys):
    picture(tmp_path / "a.png", 200, 300)
    with allowing(0.05):
        assert "0.06 megapixels, expected at most 0.05" in complaint(tmp_path / "a.png")
    assert read_gray(tmp_path / "a.png").shape == (200, 300)
    assert main(["mtf", str(tmp_path / "a.png"), "--megapixels", "0.05"]) == 2
    assert "(--megapixels and CAMVIZ_MEGAPIXELS allow more)" in capsys.readouterr().err
    monkeypatch.setenv("CAMVIZ_MEGAPIXELS", "many")
    with pytest.raises(PictureError, match=r"CAMVIZ_MEGAPIXELS: expected megapixels, .* got 'many'"):
        read_gray(tmp_path / "a.png")


def test_an_edge_is_looked_for_in_a_part_of_a_large_picture(tmp_path, capsys):
    picture(tmp_path / "a.png", 4000, 7000)
    assert main(["mtf", str(tmp_path / "a.png")]) == 2
    assert "expected an edge within 24 megapixels, got 28: say with --roi where it is." in capsys.readouterr().err
    assert main(["mtf", str(tmp_path / "a.png"), "--roi", "0,0,30,30"]) == 2
    assert "the edge leans by" in capsys.readouterr().err


@pytest.mark.parametrize("kind", KINDS)
def test_a_picture_that_is_cut_off_says_so_and_opencv_says_nothing(tmp_path, capfd, kind):
    path = tmp_path / f"a.{kind}"
    whole = picture(path)
    assert picture_size(path) == (60, 40)
    assert read_gray(path).shape == (40, 60)
    for share in (0.3, 0.6, 0.95):
        path.write_bytes(whole[: int(share * len(whole))])
        assert "cut off" in complaint(path)
    assert capfd.readouterr().err == ""


def test_the_end_of_a_thumbnail_is_not_the_end_of_the_picture(tmp_path):
    whole = picture(tmp_path / "a.jpg")
    thumbnail = b"\xff\xe1" + struct.pack(">H", len(whole) + 2) + whole
    (tmp_path / "b.jpg").write_bytes(whole[:2] + thumbnail + whole[2:])
    assert read_gray(tmp_path / "b.jpg").shape == (40, 60)
    (tmp_path / "b.jpg").write_bytes(whole[:2] + thumbnail + whole[2:-30])
    assert "the JPEG picture is cut off: it ends after" in complaint(tmp_path / "b.jpg")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no named pipes in folders")
def test_what_is_no_picture_is_called_what_it_is(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("a word")
    assert complaint(tmp_path / "pipe.png") == "expected a picture, this is no regular file"
    assert complaint(tmp_path / "empty.png") == "it is empty, expected a picture"
    assert complaint(tmp_path / "text.png") == "it is not a picture that can be read, it begins with 'a word'"
    assert "No such file" in complaint(tmp_path / "gone.png")
    assert "folder" in complaint(tmp_path)


@pytest.mark.parametrize("kind", [np.uint16, np.int32, np.float32])
def test_more_than_eight_bits_are_read_as_they_are_and_scaled_for_a_finder(tmp_path, kind):
    values = np.array([[0, 100], [200, 400]], kind)
    cv2.imwrite(str(tmp_path / "a.tif"), values)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.tif"), values)
    np.testing.assert_allclose(read_gray(tmp_path / "a.tif"), [[0, 63], [127, 255]], atol=1)


def test_light_that_is_no_number_is_dark(tmp_path):
    cv2.imwrite(str(tmp_path / "a.tif"), np.array([[nan, inf], [0.5, 1.0]], np.float32))
    np.testing.assert_array_equal(read_gray(tmp_path / "a.tif"), [[0, 0], [127, 255]])


@pytest.mark.parametrize("finder", ["sectors", "classic"])
@pytest.mark.parametrize("size", [(1, 1), (1, 5000), (12, 60), (16, 16), (40, 5000)])
def test_a_picture_too_small_for_a_board_has_none(tmp_path, size, finder):
    picture(tmp_path / "a.png", *size)
    assert look(str(tmp_path / "a.png"), BOARD, finder)[1:] == (None, "the board was not found in it")


def test_a_board_of_fewer_corners_than_finders_take_is_refused(tmp_path):
    picture(tmp_path / "a.png")
    with pytest.raises(CannotCalibrate, match="at least 3×3 inner corners, this board has 2×3"):
        detect([tmp_path / "a.png"], Board(2, 3, 0.025))


def test_damaged_pictures_of_a_set_are_named_and_left_out_unless_all_are(tmp_path):
    whole = picture(tmp_path / "a.png")
    (tmp_path / "b.png").write_bytes(b"")
    (tmp_path / "c.png").write_bytes(whole[:20])
    left_out: list[PictureError] = []
    names = [tmp_path / name for name in ("a.png", "b.png", "c.png")]
    assert sizes_of(names, left_out.append) == {str(names[0]): (60, 40)}
    assert [str(error).split(":")[0] for error in left_out] == [str(name) for name in names[1:]]
    with pytest.raises(PictureError):
        sizes_of(names[1:])


# JSON and files -------------------------------------------------------------------------------------------------------


def test_what_json_cannot_say_is_null_for_programs_and_refused_in_calibrations():
    assert json.loads(json_text({"a": nan, "b": [inf, {"c": -inf}], "d": 1.5, "e": "nan"})) == {
        "a": None,
        "b": [None, {"c": None}],
        "d": 1.5,
        "e": "nan",
    }
    with pytest.raises(ValueError):
        as_json({"fx": inf})


@pytest.mark.parametrize("number", ["1e6", "-1e6", "9e8"])
def test_an_inspection_of_absurd_numbers_is_strict_json(tmp_path, number):
    """cx of 1e6, a tangential coefficient of 1e6: the faults that an inspection is there to name."""
    good = (DATA / "opencv_mono.json").read_text()
    data = json.loads(good)["camera_matrix"]["data"]
    (tmp_path / "camera.json").write_text(good.replace(repr(data[2]), number, 1))
    json.loads(
        inspect_file(tmp_path / "camera.json").as_json(), parse_constant=lambda word: pytest.fail(f"{word} is no JSON")
    )


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("twice.json", '{"fx": 1, "fx": 2}', "appears twice"),
        ("deep.json", "[" * 5000 + "]" * 5000, "nested more than 32 levels deep"),
        ("deep.toml", "[cam_0]\nname = " + "[" * 5000 + "]" * 5000, "deep.toml"),
        ("keys.json", json.dumps({f"k{n}": n for n in range(20_000)}), "at most 10,000 keys"),
    ],
)
def test_json_that_is_a_trap_is_refused_in_one_sentence(tmp_path, name, text, what):
    (tmp_path / name).write_text(text)
    with pytest.raises(CalibrationError, match=what) as caught:
        camviz_clinic.load(tmp_path / name)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", "9" * 5000])
def test_numbers_that_are_none_are_refused(tmp_path, number):
    good = (DATA / "opencv_mono.json").read_text()
    focal_length = json.loads(good)["camera_matrix"]["data"][0]
    (tmp_path / "camera.json").write_text(good.replace(repr(focal_length), number, 1))
    with pytest.raises(CalibrationError) as caught:
        camviz_clinic.load(tmp_path / "camera.json")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 2000


def test_a_manifest_nested_without_end_is_taken_for_none(tmp_path):
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "00_start.ipynb").write_text("first")
    (tmp_path / "copy").mkdir()
    (tmp_path / "copy" / MANIFEST).write_text("[" * 100_000)
    lay_out(tmp_path / "package", tmp_path / "copy", "1")
    assert (tmp_path / "copy" / "00_start.ipynb").read_text() == "first"
