"""A file that is no calibration gets one sentence, soon; a stranger's file starts nothing and unfolds nothing."""

import os
import re
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

import camviz_clinic
from camviz_clinic.files import Calibration, CalibrationError
from camviz_clinic.files.text import MAX_BYTES

DATA = Path(__file__).parent / "data"
FILES = sorted(path for path in DATA.rglob("*") if path.is_file())
TREES = [path for path in FILES if path.suffix in (".yml", ".yaml", ".json")]
WORDS = [path for path in FILES if path.suffix in (".txt", ".xml", ".cameramodel")]
SIZES = {"kitti_calib.txt": (1242, 375)}
MONO = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.3, 0.1, 0., 0., 0. ]
"""
PAIR = "%YAML:1.0\nimage_size: [640, 480]\n" + "".join(
    f"M{n}: [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\nD{n}: [0, 0, 0, 0, 0]\n" for n in (1, 2)
)
KALIBR = (DATA / "kalibr_chain.yaml").read_text()
ROS = (DATA / "ros_file.yaml").read_text()


def complaint(path, **options):
    """The sentence that `load` refuses a file with, on one line and naming the file."""
    with pytest.raises(CalibrationError) as caught:
        camviz_clinic.load(path, **options)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert Path(path).name in sentence or repr(path) in sentence
    assert len(sentence) < 600
    return sentence


def refusal(tmp_path, text):
    path = tmp_path / "camera.yml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return complaint(path)


def test_the_healthy_originals_load(tmp_path):
    """What the tests below damage is good before they do."""
    for name, text in {"mono": MONO, "pair": PAIR, "kalibr": KALIBR, "ros": ROS}.items():
        (tmp_path / name).write_text(text)
        assert isinstance(camviz_clinic.load(tmp_path / name), Calibration)


def test_a_missing_file(tmp_path):
    assert "there is no such file" in complaint(tmp_path / "nowhere.yml")


def test_a_directory(tmp_path):
    assert "this is a directory" in complaint(tmp_path)


def test_a_name_that_is_none(tmp_path):
    assert "is not a file name" in complaint(f"{tmp_path}/a\0b")


@pytest.mark.skipif(os.name == "nt", reason="Windows says that there is no such file")
@pytest.mark.parametrize("name", ["a" * 256, "a" * 5000, "a/" * 3000, "file/camera.yml"])
def test_a_name_that_the_system_refuses(tmp_path, name):
    """Longer than the 255 bytes or 4096 of a path that Linux takes, or below a file."""
    (tmp_path / "file").write_text(MONO)
    with pytest.raises(CalibrationError, match=r"cannot be read \((File name too long|Not a directory)\)$"):
        camviz_clinic.load(tmp_path / name)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no named pipes in folders")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert "not a regular file" in complaint(tmp_path / "pipe")


def test_a_gigabyte_is_refused_unread(tmp_path, monkeypatch):
    path = tmp_path / "large.yml"
    with path.open("wb") as file:
        file.truncate(2**30)
    monkeypatch.setattr(Path, "open", lambda *_: pytest.fail("the file was opened"))
    assert "1024 MB" in complaint(path)


@pytest.mark.parametrize("content", [b"", b" \n\n\t", b"\xef\xbb\xbf"])
def test_an_empty_file(tmp_path, content):
    assert "the file is empty" in refusal(tmp_path, content)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "PNG picture"),
        (b"\xff\xd8\xff\xe0\0\x10JFIF", "JPEG picture"),
        (b"PK\x03\x04", "zip archive"),
        (b"\x93NUMPY\x01\0", "NumPy array"),
        (b"\x80\x04\x95\x0b\0\0\0", "UTF-8"),
        (b"K: 1\0", "binary"),
        ("K: é".encode("latin-1"), "UTF-8, byte 3"),
        (MONO.encode("utf-16"), "UTF-8"),
    ],
)
def test_pictures_and_binary_data_are_called_what_they_are(tmp_path, content, what):
    assert what in refusal(tmp_path, content)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("just a sentence", "plain text"),
        ("- 1\n- 2", "a list"),
        ("42", "this is 42"),
        ("a: 1\nb: 2", "found 'a', 'b'"),
        ("{}", "found nothing"),
        ("R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nT: [-0.1, 0, 0]", "no camera found"),
        ("<html></html>", "<opencv_storage>"),
        ("<opencv_storage><a>1</a><a>2</a></opencv_storage>", "twice"),
        ("<opencv_storage>", "not valid XML"),
        ("K: [1, 2\nD: ", "not valid YAML"),
        ("K: 1\nK: 2", "twice"),
        ("? [1, 2]\n: 3", "key of a mapping"),
        ("a: *b", "alias 'b'"),
        ("a: &b [*b]", "alias 'b'"),
        ("--- {a: 1}\n--- {b: 2}\n", "one YAML document"),
    ],
)
def test_text_that_is_no_calibration(tmp_path, text, what):
    assert what in refusal(tmp_path, text)


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("[ 500.,", "[ .nan,", r"camera_matrix\[0, 0\]: expected a finite number .* got nan"),
        ("[ 500.,", "[ .Inf,", "finite"),
        ("[ 500.,", "[ 1e400,", "finite"),
        ("[ 500.,", "[ 0.,", "fx = 0: the camera is not calibrated"),
        ("[ 500.,", "[ -500.,", "got fx = -500 and fy = 500 px: the x axis points left"),
        ("[ 500.,", "[ five,", "data.0.: expected a number, got 'five'"),
        ("[ 500.,", "[ true,", "data.0.: expected a number, got True"),
        ("[ 500.,", "[ [1, 2],", "rows of equal length"),
        ("[ 500.,", "[ ", "3×3 = 9 numbers, got 8"),
        ("0., 0., 1. ]", "0., 0., 2. ]", r"K\[2, 2\] = 1"),
        ("320., 0.", "0., 320.", "upper triangular"),
        ("rows: 3\n   cols: 3", "rows: 1\n   cols: 9", "3×3 numbers, got 1×9"),
        ("rows: 3", "rows: 3.5", "whole numbers"),
        ("rows: 3", "rows: -3", "whole numbers"),
        ("rows: 3", "rows: 1000000", "numbers, got 9"),
        ("dt: d", "dt: []", "expected a word"),
        ("cols: 5", "cols: 4", "1×4 = 4 numbers, got 5"),
        ("cols: 5\n   dt: d\n   data: [ -0.3, ", "cols: 4\n   dt: d\n   data: [ ", None),
        ("cols: 5\n   dt: d\n   data: [ -0.3, ", "cols: 6\n   dt: d\n   data: [ 1, -0.3,", "4, 5, 8, 12 or 14 numbers"),
        ("distortion_coefficients", "something_else", "expected distortion coefficients"),
        ("image_width: 640", "image_width: 0", "image_width: expected a whole number from 1 to"),
        ("image_width: 640", "image_width: 640.5", "whole number"),
        ("image_width: 640", "image_width: 999999999", "whole number from 1 to"),
        ("image_width: 640", "image_width: wide", "expected a number, got 'wide'"),
        ("image_width: 640\n", "", "image_width: expected a number, the key is missing"),
        ("image_width: 640\nimage_height: 480\n", "", "--size WIDTHxHEIGHT"),
        ("image_width: 640", "image_width: 640\nwidth: 640", "image_width and width, got both"),
        ("image_width: 640", "image_width: 640\nK: [1]", "image_width|both"),
    ],
)
def test_a_damaged_opencv_file_names_the_key_and_the_number(tmp_path, old, new, what):
    assert old in MONO
    damaged = MONO.replace(old, new, 1)
    if what is None:
        (tmp_path / "camera.yml").write_text(damaged)
        assert camviz_clinic.load(tmp_path / "camera.yml").cameras["camera"].lens.k1 == 0.1
    else:
        assert re.search(what, refusal(tmp_path, damaged))


@pytest.mark.parametrize(
    ("R", "what"),
    [
        ("[[1, 0, 0], [0, 1, 0], [0, 0, 2]]", "R: expected a rotation, but R Rᵀ differs from the identity by 3"),
        ("[[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "R: expected a rotation, but this is a reflection"),
        ("[[0, 0, 0], [0, 0, 0], [0, 0, 0]]", "R: expected a rotation"),
        ("[[.nan, 0, 0], [0, 1, 0], [0, 0, 1]]", r"R\[0, 0\]: expected a finite number"),
        ("[0.1, 0.2, 0.3]", "R: expected 3×3 numbers, got 3"),
    ],
)
def test_what_is_not_a_rotation_says_by_how_much(tmp_path, R, what):
    assert re.search(what, refusal(tmp_path, PAIR + f"R: {R}\nT: [-0.1, 0, 0]\n"))


@pytest.mark.parametrize(("off", "taken"), [(4e-4, True), (1e-2, False)])
def test_a_rotation_written_with_three_digits_is_one_and_with_one_digit_is_none(tmp_path, off, taken):
    path = tmp_path / "camera.yml"
    path.write_text(PAIR + f"R: [[{1 + off}, 0, 0], [0, 1, 0], [0, 0, 1]]\nT: [-0.1, 0, 0]\n")
    if taken:
        rotation = camviz_clinic.load(path).cameras["right"].world_from_cam.rotation.as_matrix()
        np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    else:
        assert "R: expected a rotation" in complaint(path)


def test_half_a_pose_is_not_completed(tmp_path):
    assert "T: expected" in refusal(tmp_path, PAIR + "R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n")
    assert "R: expected" in refusal(tmp_path, PAIR + "T: [-0.1, 0, 0]\n")


def test_three_cameras_are_no_pair(tmp_path):
    assert "M1, M2, M3" in refusal(tmp_path, PAIR + "M3: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n")


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("model: plumb_bob", "model: fisheye", "plumb_bob or rational_polynomial or equidistant, got 'fisheye'"),
        ("model: plumb_bob", "model: equidistant", "4 numbers .* for equidistant, got 5"),
        ("430.15433", ".nan", "finite"),
        ("430.15433", "0", "fx = 0: the camera is not calibrated"),
        ("0.999989", "0.5", "rectification_matrix: expected a rotation"),
        ("295.53402, 0, 285.55760", "0, 0, 285.55760", "positive focal length"),
        ("image_width: 640", "image_width: [640]\nwidth: 640", "both"),
    ],
)
def test_a_damaged_ros_file_names_the_key_and_the_number(tmp_path, old, new, what):
    assert old in ROS
    assert re.search(what, refusal(tmp_path, ROS.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("cam1:", "cam7:", "expected the cameras cam0, cam1, cam2"),
        ("camera_model: pinhole", "camera_model: pinole", r"cam0.camera_model: .*'pinole'"),
        ("camera_model: pinhole", "camera_model: eucm", "cam0.distortion_model: expected none with eucm, got .radtan."),
        ("distortion_model: radtan", "distortion_model: [1]", "cam0.distortion_model: expected a word"),
        (
            "distortion_model: radtan",
            "distortion_model: fov",
            r"cam0.distortion_coeffs: expected 1 numbers \(omega\), got 4",
        ),
        ("[458.654,", "[", "cam0.intrinsics: expected 4 numbers"),
        ("[458.654,", "[-1,", "got fx = -1 and fy = 457.296 px: the x axis points left"),
        ("resolution: &size [752, 480]", "resolution: &size [752]", "cam0.resolution: expected 2 numbers"),
        ("  - [1.0, 0.0, 0.0, -0.11]", "  - [2.0, 0.0, 0.0, -0.11]", "cam1.T_cn_cnm1: expected a rotation"),
        ("  - [0.0, 0.0, 0.0, 1.0]", "  - [0.0, 0.0, 0.0, 2.0]", "cam0.T_cam_imu: expected 0 0 0 1"),
    ],
)
def test_a_damaged_kalibr_file_names_the_camera_the_key_and_the_number(tmp_path, old, new, what):
    assert old in KALIBR
    assert re.search(what, refusal(tmp_path, KALIBR.replace(old, new, 1)))


@pytest.mark.parametrize(
    "tag",
    [
        "!!python/object/apply:os.system ['touch {mark}']",
        "!!python/object/new:os.system ['touch {mark}']",
        "!!python/name:os.system",
        "!!python/module:os",
        "!<tag:yaml.org,2002:python/object/apply:os.system> ['touch {mark}']",
        "!!opencv-matrix 3",
        "!!set {{a, b}}",
        "!!binary aGVsbG8=",
    ],
)
def test_a_tag_starts_nothing(tmp_path, tag):
    mark = tmp_path / "mark"
    assert "is refused" in refusal(tmp_path, MONO + "extra: " + tag.format(mark=mark))
    assert not mark.exists()


def test_a_billion_laughs_in_yaml_do_not_unfold(tmp_path):
    lines = ["a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    assert "unfolds to more than 1,000,000 values" in refusal(tmp_path, "\n".join(lines))


@pytest.mark.parametrize(
    "text",
    [
        '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY lol "lol"><!ENTITY l2 "&lol;&lol;">]>'
        "<opencv_storage><a>&l2;</a></opencv_storage>",
        '<!DOCTYPE a SYSTEM "file:///etc/passwd"><opencv_storage></opencv_storage>',
        '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><opencv_storage><a>&x;</a></opencv_storage>',
    ],
)
def test_entities_in_xml_are_not_unfolded(tmp_path, text):
    assert "document types and entities are refused" in refusal(tmp_path, text)


@pytest.mark.parametrize(
    "text",
    [
        "[" * 200_000,
        "{a: " * 200_000,
        "K: " + "[" * 100_000 + "]" * 100_000,
        "".join(" " * n + "a:\n" for n in range(500)),
        "- " * 100_000,
        "<opencv_storage>" + "<a>" * 200_000,
        "<document>" + "<a>" * 200_000,
        "{'lensmodel': " + "[" * 200_000,
        "{'lensmodel': " + "(" * 100_000 + ")" * 100_000 + "}",
        "{'lensmodel': " * 100_000,
    ],
)
def test_deep_nesting_stays_shallow(tmp_path, text):
    assert "32 levels" in refusal(tmp_path, text)


LARGEST = {
    "list": "[" + "1," * (MAX_BYTES // 2 - 2) + "]",
    "xml words": "<opencv_storage><a>" + "1 " * (MAX_BYTES // 2 - 40) + "</a></opencv_storage>",
    "xml elements": "<opencv_storage>" + "<a/>" * (MAX_BYTES // 4 - 20) + "</opencv_storage>",
    "word": "a: " + "x" * (MAX_BYTES - 10),
    "plain text": "a" * (MAX_BYTES - 10),
    "number": "9" * (MAX_BYTES - 10),
    "comment": "# " + "x" * (MAX_BYTES - 10),
    "open string": '"' + "\\n" * (MAX_BYTES // 2 - 10),
    "literal": "{'lensmodel': [" + "1," * (MAX_BYTES // 2 - 20) + "]}",
    "open literal": "{'lensmodel': '" + "\\x" * (MAX_BYTES // 2 - 20),
    "comments": "#\r\n" * (MAX_BYTES // 3 - 10) + "x",
    "colmap line": "1 PINHOLE 640 480 " + "1 " * (MAX_BYTES // 2 - 40),
    "colmap lines": "1 PINHOLE 640 480 1 1 1 1" + "\n" * (MAX_BYTES - 40),
    "kitti line": "P0: " + "1 " * (MAX_BYTES // 2 - 40),
    "kitti lines": "P0: 1" + "\n" * (MAX_BYTES - 40),
    "attributes": "<document>" + "<a b='1'/>" * (MAX_BYTES // 10 - 20) + "</document>",
}


OFTEN = ("open literal", "kitti lines", "attributes")  # of each parser one; the others with --all


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    "name", [name if name in OFTEN else pytest.param(name, marks=pytest.mark.thorough) for name in LARGEST]
)
def test_the_largest_allowed_file_is_refused(tmp_path, name):
    refusal(tmp_path, LARGEST[name])


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="sets limits that only Linux keeps")
def test_the_largest_allowed_files_need_neither_hours_nor_gigabytes(tmp_path):
    """All of them in a process that the system ends after two minutes of work, and gives 2 GB beside what it loads."""
    for name, text in LARGEST.items():
        (tmp_path / f"{name}.yml").write_text(text)
    code = (
        "import resource, sys, pathlib, camviz_clinic.files.loading\n"
        "from camviz_clinic.files import CalibrationError\n"
        "loaded = int(pathlib.Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (loaded + 2 * 2**30,) * 2)\n"
        "resource.setrlimit(resource.RLIMIT_CPU, (120, 120))\n"
        "for path in sorted(pathlib.Path(sys.argv[1]).iterdir()):\n"
        "    try: camviz_clinic.load(path)\n"
        "    except CalibrationError: print(path.stem)\n"
    )
    run = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.splitlines() == sorted(LARGEST)


def element(kind, data):
    """A data element of a .mat file: type, size, data, and bytes up to a multiple of eight."""
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def matrix(kind, sides, rest, name=b""):
    """A variable of a class (1 cell, 4 text, 6 double) with these dimensions, whatever follows them."""
    dimensions = element(5, np.array(sides, "<i4").tobytes())
    return element(14, element(6, struct.pack("<II", kind, 0)) + dimensions + element(1, name) + rest)


def compressed(variable):
    """An element of type 15, which nothing follows up to a multiple of eight."""
    data = zlib.compress(variable)
    return struct.pack("<II", 15, len(data)) + data


def nested(depth):
    inner = matrix(6, (1, 1), element(9, struct.pack("<d", 1)))
    for _ in range(depth):
        inner = matrix(1, (1, 1), inner)
    return inner


WORDS_OF_A_MEGABYTE = matrix(4, (1, 2**20), element(16, bytes(2**20)), b"a")
HOSTILE_MAT = {
    "a million dimensions": (compressed(matrix(6, [2**31 - 1] * 10**6, b"")), "2 to 32 dimensions"),
    "cells without end": (matrix(1, (2**28, 1), b""), "at most 1,000,000 values"),
    "dimensions below zero": (matrix(1, (-1, -5), b""), "dimensions"),
    "deep cells": (nested(20_000), "32 levels"),
    "900 variables that unfold": (compressed(WORDS_OF_A_MEGABYTE) * 900, "at most 16 MB, they unfold to more"),
    "a variable longer than it says": (struct.pack("<II", 14, 8) + nested(0)[8:], "announces 8 bytes, 0 are left"),
}


@pytest.mark.parametrize(("body", "what"), HOSTILE_MAT.values(), ids=HOSTILE_MAT)
def test_a_mat_file_that_announces_much_is_refused_at_once(tmp_path, body, what):
    (tmp_path / "p.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + body)
    start = time.process_time()
    assert re.search(what, complaint(tmp_path / "p.mat"))
    assert time.process_time() - start < 5


MANY_KEYS = {
    "json": "{" + ",".join(f'"{n:x}":1' for n in range(990_000)) + "}",
    "xml": "<opencv_storage>" + "".join(f"<k{n:x}>1</k{n:x}>" for n in range(400_000)) + "</opencv_storage>",
}


@pytest.mark.parametrize("text", MANY_KEYS.values(), ids=MANY_KEYS)
def test_a_mapping_of_a_million_keys_is_refused_at_once(tmp_path, text):
    """Readers look through all keys for the several spellings of a name."""
    start = time.process_time()
    assert "at most 10,000 keys" in refusal(tmp_path, text)
    assert time.process_time() - start < 10


LITERALS = {
    "signs": "-" * 250_000 + "1",
    "sums": "1" + "+1" * 120_000,
    "attributes": "a" + ".b" * 120_000,
    "calls": "a" + "()" * 120_000,
    "format strings": "f'" + "{1}" * 80_000 + "'",
    "keys": "{" + ",".join(f"'{n}': 1" for n in range(20_000)) + "}",
    "digits": "9" * 250_000,
    "large": "1" + "0" * 400,
    "quotes": "'\\" * 4_000_000,
    "escapes": "'\\d', 1j",
    "set": "{1, 2}",
    "no key": "{**{}}",
}


@pytest.mark.parametrize("value", LITERALS.values(), ids=LITERALS)
def test_a_literal_is_refused_at_once(tmp_path, value, recwarn):
    """What makes Python's own parser recurse, and format strings, which take it a time that grows with the square."""
    start = time.process_time()
    refusal(tmp_path, f"{{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': {value}}}")
    assert time.process_time() - start < 5
    assert list(recwarn) == []


def test_a_literals_long_strings_are_passed_over(tmp_path):
    """As mrcal's optimization inputs, megabytes of text that nothing here reads."""
    text = (DATA / "mrcal_stereographic.cameramodel").read_text().rstrip().removesuffix("}")
    (tmp_path / "c.cameramodel").write_text(text + f",'optimization_inputs': b'{'A#[{' * 2**20}',  # it's long\n}}")
    assert camviz_clinic.load(tmp_path / "c.cameramodel").cameras["camera"].intrinsics.width == 640


def test_a_sentence_does_not_carry_the_files_control_characters(tmp_path):
    assert "\x1b" not in refusal(tmp_path, 'distortion_model: "\\e[31m\\n\\n red"\nK: [1]\nwidth: 1\nheight: 1')
    (tmp_path / "cameras.txt").write_text("1 PIN\x04HOLE 640 480 500 510 320 240\n")
    assert r"camera model 'PIN\x04HOLE'" in complaint(tmp_path / "cameras.txt")


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("cameras.bin", b"\xff" * 8, "announces 18,446,744,073,709,551,615"),
        ("cameras.bin", b"\1" + b"\0" * 7, "ends before all"),
        ("cameras.bin", b"\0" * 8, "at least one camera"),
        ("cameras.bin", b"\1" + b"\0" * 11 + b"\x0b\0\0\0" + b"\0" * 16, "RAD_TAN_THIN_PRISM_FISHEYE"),
        ("images.bin", b"\xff" * 8, "announces 18,446,744,073,709,551,615"),
        ("images.bin", b"\1" + b"\0" * 7 + b"\0" * 64 + b"x" * 2000, "name of an image"),
        ("images.bin", b"\1" + b"\0" * 7 + b"\0" * 64 + b"a\0" + b"\xff" * 8, "ends before all"),
    ],
)
def test_a_binary_file_is_not_believed_when_it_announces_much(tmp_path, name, content, what):
    for path in (DATA / "colmap_bin").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / name).write_bytes(content)
    assert what in complaint(tmp_path / name)


@pytest.mark.parametrize(
    "value",
    ["__import__('os').system('touch {mark}')", "open('{mark}', 'w')", "[x for x in ()]", "1 if 1 else 2", "f''"],
)
def test_a_literal_starts_nothing(tmp_path, value):
    mark = tmp_path / "mark"
    text = (DATA / "mrcal_stereographic.cameramodel").read_text().replace("[640, 480]", value.format(mark=mark))
    assert "expected a" in refusal(tmp_path, text)
    assert not mark.exists()
