"""`camviz reproject` takes pictures through other lenses, or says in one sentence why not and writes nothing."""

import os
import re
import shlex
import shutil
from importlib.util import find_spec
from math import atan, degrees
from pathlib import Path

import cv2
import numpy as np
import py360convert
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camviz.panoramas.projections import PROJECTIONS, across_deg, projection
from camviz_clinic.commands.command import main
from camviz_school.course import notebooks
from camviz_school.course.material import lessons_folder

DATA = Path(__file__).parent / "data"
EARTH = Path(find_spec("pyvista").submodule_search_locations[0]) / "examples" / "2k_earth_daymap.jpg"


@pytest.fixture
def room(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sky = np.random.default_rng(4).integers(0, 256, (64, 128, 3), dtype=np.uint8)
    cv2.imwrite("sky.png", sky)
    cv2.imwrite("wrong.png", sky[:, :100])
    Path("text.png").write_text("not a picture")
    Path("empty.png").write_bytes(b"")
    Path("torn.png").write_bytes(Path("sky.png").read_bytes()[:2000])
    return tmp_path


def psnr(a, b):
    return 10 * np.log10(255**2 / np.mean((a.astype(float) - b.astype(float)) ** 2))


@pytest.mark.parametrize(("face", "letter"), [("front", "F"), ("right", "R"), ("up", "U"), ("down", "D")])
def test_a_face_of_the_earth_is_that_of_py360convert(room, face, letter):
    """It puts the centres of the outermost pixels on the cube's edges: a face 2 atan(n / (n - 1)) wide."""
    words = ["--from", "equirectangular", "--to", f"cube:{face}", "--hfov", f"{2 * degrees(atan(512 / 511)):.9f}"]
    assert main(["reproject", str(EARTH), "-o", "face.png", *words, "--size", "512x512"]) == 0
    theirs = py360convert.e2c(cv2.imread(str(EARTH)), 512, cube_format="dict")[letter]
    assert psnr(cv2.imread("face.png"), theirs) > 45


@pytest.mark.thorough
def test_to_a_cube_and_back_the_earth_stays_where_it_was(room):
    assert main(["reproject", str(EARTH), "-o", "cube.png", "--from", "equirectangular", "--to", "cube"]) == 0
    assert cv2.imread("cube.png", cv2.IMREAD_UNCHANGED).shape == (1536, 2048, 4)
    assert main(["reproject", "cube.png", "-o", "back.png", "--from", "cube", "--to", "equirectangular"]) == 0
    back, earth = cv2.imread("back.png"), cv2.imread(str(EARTH))
    soft = [cv2.GaussianBlur(picture, (0, 0), 4) for picture in (back, earth)]
    assert psnr(*soft) > 40


def test_a_turned_panorama_is_rolled(room):
    words = ["--from", "equirectangular", "--to", "equirectangular", "--yaw", "90"]
    assert main(["reproject", "sky.png", "-o", "turned.png", *words]) == 0
    np.testing.assert_array_equal(cv2.imread("turned.png"), np.roll(cv2.imread("sky.png"), -32, axis=1))


def test_what_is_not_seen_is_transparent_in_a_png_and_grey_in_a_jpeg(room):
    words = ["--from", "equirectangular", "--to", "fisheye:orthographic", "--size", "60x60"]
    for name in ("ball.png", "ball.jpg"):
        assert main(["reproject", "sky.png", "-o", name, *words]) == 0
    ball = cv2.imread("ball.png", cv2.IMREAD_UNCHANGED)
    assert ball.shape == (60, 60, 4)
    assert ball[0, 0, 3] == 0
    assert ball[30, 30, 3] == 255
    assert np.abs(cv2.imread("ball.jpg")[0, 0].astype(int) - 0.27 * 255).max() < 3


def test_a_fisheye_of_a_calibration_file_is_straightened_as_opencv_does(room):
    storage = cv2.FileStorage(str(DATA / "opencv_fisheye.yml"), cv2.FILE_STORAGE_READ)
    K, D = (storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))
    rng = np.random.default_rng(7)
    picture = cv2.resize(rng.integers(0, 256, (64, 64, 3), dtype=np.uint8), (1024, 1024), interpolation=cv2.INTER_CUBIC)
    cv2.imwrite("fisheye.png", picture)
    words = ["--from", str(DATA / "opencv_fisheye.yml"), "--to", "perspective", "--hfov", "80", "--size", "400x300"]
    assert main(["reproject", "fisheye.png", "-o", "straight.png", *words]) == 0
    f = 200 / np.tan(np.radians(40))
    straight = np.array([[f, 0, 199.5], [0, f, 149.5], [0, 0, 1]])
    theirs = cv2.fisheye.undistortImage(picture, K, D.reshape(-1)[:4], None, straight, (400, 300))
    assert psnr(cv2.imread("straight.png"), theirs) > 40


def test_a_face_is_turned_in_the_frame_of_the_whole_cube(room):
    """Pitch turns about the axis that the right face looks along: its middle stays, and up is not in it."""
    middles = []
    for turn in ([], ["--pitch", "90"]):
        words = ["--from", "equirectangular", "--to", "cube:right", "--size", "33x33", *turn]
        assert main(["reproject", "sky.png", "-o", "face.png", *words]) == 0
        middles.append(cv2.imread("face.png")[16, 16])
    np.testing.assert_array_equal(*middles)


def test_the_edge_of_a_shrunk_ball_is_transparent_but_not_dark(room):
    cv2.imwrite("white.png", np.full((1024, 2048, 3), 255, np.uint8))
    words = ["--from", "equirectangular", "--to", "fisheye:orthographic", "--size", "60x60"]
    assert main(["reproject", "white.png", "-o", "ball.png", *words]) == 0
    ball = cv2.imread("ball.png", cv2.IMREAD_UNCHANGED)
    partly = (ball[..., 3] > 20) & (ball[..., 3] < 255)
    assert partly.any()
    assert ball[..., :3][partly].min() > 245


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_grey_and_16_bit_pictures_stay_what_they_are(room, kind):
    cv2.imwrite("grey.png", np.full((64, 128), 100 if kind is np.uint8 else 40_000, kind))
    words = ["--from", "equirectangular", "--to", "perspective", "--size", "20x20"]
    assert main(["reproject", "grey.png", "-o", "window.png", *words]) == 0
    np.testing.assert_array_equal(
        cv2.imread("window.png", cv2.IMREAD_UNCHANGED), np.full((20, 20), 100 if kind is np.uint8 else 40_000, kind)
    )


@given(
    name=st.sampled_from([name for name in sorted(PROJECTIONS) if not name.startswith("cube")]),
    sides=st.tuples(st.integers(2, 5000), st.integers(1, 5000)),
    hfov_deg=st.floats(1, 350),
)
def test_a_projection_shows_the_field_it_was_asked_for_or_says_why_not(name, sides, hfov_deg):
    """A camera whose outermost rays are `hfov_deg` apart along the middle row, as far as its equation goes."""
    widest = {"perspective": 180, "fisheye:orthographic": 180}.get(name, 360)
    too_high = name == "equirectangular" and hfov_deg * sides[1] / sides[0] > 180 * (1 + 1e-9)
    if hfov_deg >= widest or too_high:
        with pytest.raises(ValueError, match=r"field of view|180° high"):
            projection(name).camera(*sides, hfov_deg)
        return
    camera = projection(name).camera(*sides, hfov_deg)
    assert (camera.intrinsics.width, camera.intrinsics.height) == sides
    assert across_deg(camera) == pytest.approx(hfov_deg, rel=1e-6)
    middle = camera.intrinsics.to_pixels(camera.lens.project((0.0, 0.0, 1.0)))
    np.testing.assert_allclose(middle, ((sides[0] - 1) / 2, (sides[1] - 1) / 2), atol=1e-9)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("wrong.png -o out.png --from equirectangular --to cube", "twice as wide as high, got 100 × 64 pixels"),
        ("sky.png -o out.png --from cube --to equirectangular", "4 faces wide and 3 high, got 128 × 64 pixels"),
        ("sky.png -o out.png --from cube:up --to equirectangular", "square, got 128 × 64 pixels"),
        ("sky.png -o out.png --from equirectangluar --to cube", "did you mean equirectangular?"),
        ("sky.png -o out.png --from equirectangular --to equisolid", "did you mean fisheye:equisolid?"),
        ("sky.png -o out.png --from equirectangular --to mercator --size 9x9", "is none of perspective, equirect"),
        ("sky.png -o out.png --from equirectangular --to perspective --size 0x9", "1 to 32000 pixels a side, got 0x9"),
        ("sky.png -o out.png --from equirectangular --to perspective --size 9", "expected WIDTHxHEIGHT"),
        ("sky.png -o out.png --from equirectangular --to cube --size 100x100", "4 faces wide and 3 high"),
        ("sky.png -o out.png --from equirectangular --to perspective --hfov 180", "below 180 degrees, got 180"),
        ("sky.png -o out.png --from equirectangular --to fisheye:orthographic --hfov 181", "at most 180 degrees"),
        ("sky.png -o out.png --from equirectangular --to cube --hfov 90", "no field of view to choose"),
        ("sky.png -o out.png --from equirectangular --to perspective --hfov wide", "expected an angle in degrees"),
        ("sky.png -o out.png --from equirectangular --to perspective --yaw nan", "expected an angle in degrees"),
        ("sky.png -o out.png --from equirectangular --to perspective --hfov 0", "above 0"),
        ("text.png -o out.png --from equirectangular --to cube", "it is not a picture"),
        ("empty.png -o out.png --from equirectangular --to cube", "it is empty"),
        ("torn.png -o out.png --from equirectangular --to cube", "the PNG picture is cut off"),
        ("absent.png -o out.png --from equirectangular --to cube", "No such file"),
        (". -o out.png --from equirectangular --to cube", "this is a folder"),
        ("sky.png -o sky.png --from equirectangular --to cube", "overwrite"),
        ("sky.png -o no/out.png --from equirectangular --to cube", "no directory"),
        ("sky.png -o out.text --from equirectangular --to cube", "ending in .png"),
        ("sky.png -o out --from equirectangular --to cube", "ending in .png"),
        ("sky.png -o out.png --from absent.yml --to cube", "absent.yml"),
        ("sky.png -o out.png --from text.png --to cube", "text.png"),
        ("sky.png -o out.png --from {data}/opencv_fisheye.yml --to cube", "expected the 1024 × 1024 pixels"),
        ("sky.png -o out.png --from equirectangular --to {data}/opencv_fisheye.yml --hfov 90", "says what field"),
        ("sky.png -o out.png --from equirectangular --to {data}/kalibr_chain.yaml", "say with --to-camera which"),
        ("sky.png -o out.png --from equirectangular --to cube --to-camera cam0", "no calibration file"),
        ("sky.png --from equirectangular --to cube", "required"),
    ],
)
def test_what_cannot_be_done_is_one_sentence_and_leaves_no_file(capfd, room, words, sentence):
    before = sorted(room.rglob("*"))
    assert main(["reproject", *words.format(data=DATA).split()]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("camviz: ")
    assert err.count("\n") == 1
    assert sentence in err
    assert sorted(room.rglob("*")) == before


def test_a_camera_of_several_can_be_named(room):
    words = ["--from", "equirectangular", "--to", str(DATA / "kalibr_chain.yaml"), "--to-camera", "cam1"]
    assert main(["reproject", "sky.png", "-o", "out.png", *words, "--size", "64x40"]) == 0
    assert cv2.imread("out.png").shape == (40, 64, 3)


def test_the_help_teaches_the_models(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["reproject", "--help"])
    assert stopped.value.code == 0
    words = capsys.readouterr().out
    assert all(name in words for name in PROJECTIONS if not name.startswith("cube:") or name == "cube:front")


@pytest.mark.parametrize("side", ["from", "to"])
def test_a_file_without_a_size_takes_that_of_the_picture_it_belongs_to(room, side):
    """OpenCV's intrinsics.yml holds none: IN has one, and --size says OUT's."""
    Path("K.yml").write_text(
        "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [ 100., 0., 63.5, 0., 100., 31.5, 0., 0., 1. ]\n"
        "D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n"
    )
    other = "perspective" if side == "from" else "equirectangular"
    words = {"from": ["--from", "K.yml", "--to", other], "to": ["--from", other, "--to", "K.yml", "--size", "128x64"]}
    assert main(["reproject", "sky.png", "-o", "out.png", *words[side]]) == 0
    if side == "to":
        assert cv2.imread("out.png").shape == (64, 128, 3)


@pytest.mark.thorough
def test_the_commands_of_lesson_10_run_as_they_are_written(tmp_path, monkeypatch):
    samples = Path(os.environ.get("CAMVIZ_SAMPLES", "nowhere")) / "opencv-samples"
    if not samples.is_dir():
        pytest.skip("CAMVIZ_SAMPLES does not name a folder with OpenCV's samples")
    monkeypatch.chdir(tmp_path)
    (lesson,) = lessons_folder().glob("10_*.ipynb")
    text = "\n".join(cell.source for cell in notebooks.read(lesson).cells)
    calibrate, reproject = sorted(re.findall(r"`camviz ([^`]+)`", text))
    Path("pictures").mkdir()
    for number in range(1, 7):
        shutil.copy(samples / f"left0{number}.jpg", "pictures")
    assert main(shlex.split(calibrate)) == 0
    assert not cv2.FileStorage("camera.yaml", cv2.FILE_STORAGE_READ).getNode("xi").empty()
    cv2.imwrite("earth.jpg", np.random.default_rng(0).integers(0, 255, (180, 360, 3), dtype=np.uint8))
    assert main(shlex.split(reproject)) == 0
    assert cv2.imread("window.png").std() > 5  # of a panorama of noise
