"""`camviz calibrate FILM --rolling-shutter`, and the line delay in files."""

import json

import numpy as np
import pytest
from commandline import main, refused

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import Board, Calibration, CalibrationError
from camviz_clinic.calibration.line_delay import LineDelay
from camviz_clinic.files import load
from camviz_clinic.files.writing import alone, write
from camviz_clinic.films.bursts import chosen
from camviz_clinic.films.virtual import SmoothTake, take, write_film

CAMERA = Camera(Intrinsics(320, 240, 265, 266, 161, 119), BrownConrady(-0.1, 0.02))
READOUT_S = 0.025
WORDS = ["--board", "5x4", "--square-mm", "45", "--finder", "classic", "--workers", "1", "--fix", "k3"]


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A film of 48 frames of a board that is carried before a camera read row by row."""
    path, rng = tmp_path_factory.mktemp("rolling") / "film.avi", np.random.default_rng(3)
    stops = take(rng, CAMERA, Board(5, 4, 0.045), 5, rest_s=0, way_s=0.45, window=0.7, readout_s=READOUT_S)
    write_film(path, SmoothTake(**vars(stops)), rng)
    return path


@pytest.fixture
def film(shot, room):
    (room / "film.avi").write_bytes(shot.read_bytes())


@pytest.mark.thorough
def test_a_film_gives_camera_and_delay_in_words_in_the_file_and_as_json(film, capsys):
    assert main(["calibrate", "film.avi", *WORDS, "--rolling-shutter", "estimate"]) == 0
    said = capsys.readouterr().out
    assert "Rolling shutter: a row is read every 10" in said
    assert "Is the board as described?" not in said  # the corners kept are not those of the pictures
    assert "frames do not show the board" in said
    found = camviz_clinic.load("camera.yaml")
    delay = found.line_delays["camera"]
    assert abs(delay.seconds - READOUT_S / 240) < 4 * delay.sigma
    assert delay.seconds == pytest.approx(READOUT_S / 240, rel=0.05)
    assert found.cameras["camera"].intrinsics.fx == pytest.approx(265, rel=0.01)
    assert main(["inspect", "camera.yaml", "--json"]) in (0, 1)
    told = json.loads(capsys.readouterr().out)
    assert told["cameras"][0]["line_delay"]["us"] == pytest.approx(1e6 * delay.seconds)
    assert "rolling-shutter" not in [each["id"] for each in told["findings"]]


def test_a_delay_that_is_given_is_held(film, capsys):
    assert main(["calibrate", "film.avi", *WORDS, "--rolling-shutter", "104.2"]) == 0
    assert "a row is read every 104.20 µs, as given" in capsys.readouterr().out
    assert camviz_clinic.load("camera.yaml").line_delays["camera"] == LineDelay(104.2e-6)


@pytest.mark.thorough
def test_the_corners_of_a_film_in_bursts_are_saddles_unless_a_finder_is_named(film, capsys):
    plain = [word for word in WORDS if word not in ("--finder", "classic")] + ["--rolling-shutter", "104.2"]
    found = {}
    for finder in ([], ["--finder", "saddles"], ["--finder", "auto"]):
        assert main(["calibrate", "film.avi", *plain, *finder]) == 0
        found["".join(finder[1:])] = camviz_clinic.load("camera.yaml").cameras["camera"].intrinsics
    assert found[""] == found["saddles"] != found["auto"]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["calibrate", "a.png", *WORDS, "--rolling-shutter", "estimate"], "is for one film, whose frames have times"),
        (["calibrate", "--corners", "a.csv", "--rolling-shutter", "20"], "leave --corners out"),
        (["calibrate", "film.avi", "--right", "film.avi", *WORDS, "--rolling-shutter", "20"], "leave --right out"),
        (["calibrate", "film.avi", *WORDS, "--rolling-shutter", "fast"], "expected estimate, off, or the µs"),
        (["calibrate", "film.avi", *WORDS, "--rolling-shutter", "900"], "240 rows would take 216 ms"),
    ],
)
def test_what_is_no_film_and_no_delay_is_refused(film, room, capsys, words, why):
    (room / "a.png").write_bytes(b"none")
    assert why in refused(capsys, room, *words)


def held(sigma=2e-7, seconds=2e-5):
    return Calibration({"camera": CAMERA}, None, "here", line_delays={"camera": LineDelay(seconds, sigma)})


@pytest.mark.parametrize("delay", [LineDelay(2e-5, 2e-7), LineDelay(-3e-5), LineDelay(2e-5, 0.0)])
def test_a_line_delay_is_kept_by_opencv_files(room, delay):
    given = Calibration({"camera": CAMERA}, room, "here", line_delays={"camera": delay})
    for name in ("camera.yml", "camera.xml", "camera.json"):
        assert write(given, room / name, "opencv") == ()
        assert load(room / name).line_delays == {"camera": delay}
    assert alone(given, "camera").line_delays == {"camera": delay}


def test_a_negative_sigma_is_no_line_delay(room):
    write(held(), room / "camera.yml", "opencv")
    text = (room / "camera.yml").read_text(encoding="utf-8")
    assert "line_delay_sigma: " in text
    (room / "camera.yml").write_text(text.replace("line_delay_sigma: ", "line_delay_sigma: -"), encoding="utf-8")
    with pytest.raises(CalibrationError, match="line_delay_sigma: expected a standard deviation in seconds"):
        load(room / "camera.yml")


@pytest.mark.parametrize("seconds", [2e-5, -2e-5])
def test_a_line_delay_is_a_readout_time_of_gyroflow(room, seconds):
    write(held(seconds=seconds), room / "profile.json", "gyroflow")
    profile = json.loads((room / "profile.json").read_text(encoding="utf-8"))
    assert profile["frame_readout_time"] == pytest.approx(1000 * seconds * 240)
    assert load(room / "profile.json").line_delays["camera"].seconds == pytest.approx(seconds)
    profile |= {"frame_readout_time": 4.8, "frame_readout_direction": "BottomToTop"}
    (room / "profile.json").write_text(json.dumps(profile), encoding="utf-8")
    assert load(room / "profile.json").line_delays["camera"].seconds == pytest.approx(-2e-5)
    profile |= {"frame_readout_direction": "LeftToRight"}
    (room / "profile.json").write_text(json.dumps(profile), encoding="utf-8")
    assert load(room / "profile.json").line_delays == {}


def test_a_format_without_a_place_for_it_says_so(room):
    assert write(held(), room / "camera.yaml", "ros") == ("the line delay of the rolling shutter",)


def test_bursts_lie_evenly_over_a_film():
    assert chosen(1000, 24) == [*range(8), *range(496, 504), *range(992, 1000)]
    assert len(chosen(100, 96)) == 96
