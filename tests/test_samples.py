"""Sample files are the published ones or none; without them the virtual camera takes the pictures."""

import os
import shutil
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
import pooch
import pytest
from file_server import files_served

from camviz_school import samples
from camviz_school.samples import REGISTRY, SampleUnavailable, chessboard_pictures, sample

FOLDER = os.environ.get("CAMVIZ_SAMPLES")
NOWHERE = "http://127.0.0.1:9/"


@pytest.fixture
def published():
    if not FOLDER:
        pytest.skip("CAMVIZ_SAMPLES names no folder of sample data")
    return Path(FOLDER) / "opencv-samples"


@pytest.fixture(autouse=True)
def _bare_machine(tmp_path, monkeypatch):
    """No sample folder, an empty cache, and no way to the network."""
    monkeypatch.delenv("CAMVIZ_SAMPLES", raising=False)
    monkeypatch.setattr(pooch, "os_cache", lambda name: tmp_path / "cache" / name)
    monkeypatch.setattr(samples, "BASE_URL", NOWHERE)


@pytest.fixture
def serve(monkeypatch):
    """Makes a folder the network's."""
    with ExitStack() as servers:

        def start(folder):
            address = servers.enter_context(files_served(folder))
            monkeypatch.setattr(samples, "BASE_URL", f"{address}/")

        yield start


def test_the_registry_holds_both_cameras_and_the_calibrations():
    assert sum(name.startswith("left") and name.endswith(".jpg") for name in REGISTRY) == 13
    assert sum(name.startswith("right") for name in REGISTRY) == 13
    assert {"intrinsics.yml", "left_intrinsics.yml"} < set(REGISTRY)


@pytest.mark.parametrize("subfolder", [".", "opencv-samples"])
def test_a_folder_of_ones_own_comes_first(published, tmp_path, monkeypatch, subfolder):
    folder = tmp_path / "own" / subfolder
    folder.mkdir(parents=True)
    shutil.copy(published / "left01.jpg", folder)
    monkeypatch.setenv("CAMVIZ_SAMPLES", str(tmp_path / "own"))
    assert sample("left01.jpg").resolve() == (folder / "left01.jpg").resolve()


def test_a_changed_file_is_not_taken_for_the_published_one(tmp_path, monkeypatch):
    (tmp_path / "left01.jpg").write_bytes(b"not a photograph")
    monkeypatch.setenv("CAMVIZ_SAMPLES", str(tmp_path))
    with pytest.raises(SampleUnavailable, match=r"left01\.jpg is not the file that OpenCV publishes"):
        sample("left01.jpg")


def test_a_file_is_fetched_once(published, serve, monkeypatch):
    serve(published)
    first = sample("left01.jpg")
    assert first.read_bytes() == (published / "left01.jpg").read_bytes()
    monkeypatch.setattr(samples, "BASE_URL", NOWHERE)
    assert sample("left01.jpg") == first


def test_what_the_network_sends_instead_is_refused(tmp_path, serve):
    (tmp_path / "left01.jpg").write_bytes(b"Please log in to this network")
    serve(tmp_path)
    with pytest.raises(SampleUnavailable, match="not the published file"):
        sample("left01.jpg")


def test_without_a_network_a_sentence_says_so():
    with pytest.raises(SampleUnavailable, match=r"left01.jpg could not be fetched from .*CAMVIZ_SAMPLES can name"):
        sample("left01.jpg")


def test_an_unknown_name_is_a_mistake():
    with pytest.raises(ValueError, match="name must be one of left01"):
        sample("../../etc/passwd")


def test_the_photographs_are_opencvs(published, monkeypatch):
    monkeypatch.setenv("CAMVIZ_SAMPLES", str(published))
    taken = chessboard_pictures("right")
    assert taken.real
    assert len(taken.pictures) == len(taken.names) == 13
    for name, picture in zip(taken.names, taken.pictures, strict=True):
        np.testing.assert_array_equal(picture[..., ::-1], cv2.imread(str(published / name)))


@pytest.mark.thorough
def test_the_virtual_camera_steps_in_with_boards_that_opencv_finds():
    """Calibrating from the rendered pairs returns the focal length and the baseline they were rendered with."""
    left, right = chessboard_pictures("left"), chessboard_pictures("right")
    assert not left.real
    assert "virtual camera" in left.sentence
    corners = [[detected(picture) for picture in pictures.pictures[:6]] for pictures in (left, right)]
    grid = np.mgrid[:9, :6].T.reshape(-1, 2)
    board = np.pad(grid * left.square_size, ((0, 0), (0, 1))).astype(np.float32)
    boards, size = [board] * 6, (640, 480)
    solved = [cv2.calibrateCamera(boards, points, size, None, None)[:3] for points in corners]
    (_, K1, D1), (_, K2, D2) = solved
    T = cv2.stereoCalibrate(boards, *corners, K1, D1, K2, D2, size, flags=cv2.CALIB_FIX_INTRINSIC)[6]
    assert K1[0, 0] == pytest.approx(536, rel=0.005)
    np.testing.assert_allclose(T.ravel(), [-samples.BASELINE, 0, 0], atol=0.003)


def detected(picture):
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    found, corners = cv2.findChessboardCornersSB(grey, (9, 6))
    assert found
    corners = corners.reshape(-1, 2)
    return np.ascontiguousarray(corners if corners[0, 0] < corners[-1, 0] else corners[::-1])


def test_importing_touches_neither_pooch_nor_the_network():
    code = "import sys, camviz_school.samples\n"
    code += "print([m for m in ('pooch', 'requests', 'cv2', 'matplotlib') if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_a_damaged_file_among_those_fetched_before_is_not_used(tmp_path):
    (tmp_path / "cache" / "camviz").mkdir(parents=True)
    (tmp_path / "cache" / "camviz" / "left01.jpg").write_bytes(b"half a picture")
    assert samples.local_sample("left01.jpg") is None
    with pytest.raises(SampleUnavailable):
        sample("left01.jpg")


def test_the_map_of_the_earth_lies_as_maps_do_and_the_garden_takes_its_place(monkeypatch):
    """Land is less blue than sea: the Sahara (20° N, 10° E) and the middle of the Pacific (0° N, 150° W)."""
    earth = samples.earth_map(720)
    assert earth.picture.shape == (360, 720, 3)
    if not earth.real:
        pytest.skip(earth.sentence)
    red, _, blue = earth.picture[140, 380].astype(int)
    assert red > blue
    red, _, blue = earth.picture[180, 60].astype(int)
    assert blue > red
    monkeypatch.setattr(samples, "find_spec", lambda name: None)
    garden = samples.earth_map(64)
    assert not garden.real
    assert "takes its place" in garden.sentence
    assert garden.picture.shape == (32, 64, 3)
