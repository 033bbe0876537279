"""The sensors' visualizers show what the sensors do, and every control is seen at both of its ends."""

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.draw.marks import Discs
from camviz.scenes import textured_scene, to_display
from camviz.sensors import decibel, gliding, rolling_picture
from camviz_school.course.material import module
from camviz_school.views.image_sensor import ImageSensorView
from camviz_school.views.readout import LARGE, ROWS, ReadoutView, fan

expected_electrons, row_time = module("14").expected_electrons, module("14").row_time


def photo(view, name):
    data = np.frombuffer(view.figure().photographs[name], np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1].astype(float)


def test_a_fans_rows_are_those_of_the_fan_at_their_own_times():
    """Row by row, the rolling picture is the still fan at that row's moment."""
    view = ReadoutView(speed=15, row_us=50, time=100, exposure_ms=0.1)
    picture = view.picture(*LARGE).astype(float)
    for row in (0, 77, 150, 239):
        then = view.but(time=100 * row / LARGE[1]).scene_now(*LARGE)
        assert np.abs(picture[row] - then[row]).mean() < 4  # it is exposed while the fan turns by half a degree
        assert np.abs(picture[row] - then[row]).max(axis=-1).astype(bool).mean() < 0.1
    assert np.abs(picture - view.but(readout="CCD").picture(*LARGE)).mean() > 10
    for readout in ("CCD", "CMOS, global shutter"):  # what is exposed at once is the scene of the first moment
        at_once = view.but(readout=readout)
        assert np.abs(at_once.picture(*LARGE).astype(float) - view.but(time=0).scene_now(*LARGE)).mean() < 2
        assert "moves 0 px" in at_once.description()


def test_a_train_leans_what_stands_by_the_closed_form():
    """f v t / Z: 554.3 px · 40 m/s · 479 · 64 µs / 3 m = 227 px, which the numbers state."""
    view = ReadoutView(subject="view from a train", speed=40)
    assert view.moved_px(479 * 64e-6) == pytest.approx(554.256 * 40 * 479 * 64e-6 / 3, rel=1e-5)
    assert "a thing at 3 m moves 227 px" in view.numbers().values()


def test_the_train_s_picture_is_that_of_the_rolling_shutter():
    """Against the camera that is traced row by row; the two average textures over slightly different angles."""
    view = ReadoutView(subject="view from a train", speed=25, row_us=80, exposure_ms=0.1)
    camera = Camera(Intrinsics.from_fov(80, 60, 60))
    traced = rolling_picture(textured_scene(), camera, gliding(camera, (25, 0, 0)), 480 / 60 * 80e-6)
    apart = np.abs(view.picture(80, 60).astype(float) - to_display(traced))
    assert apart.mean() < 1.5
    assert np.abs(view.picture(80, 60).astype(float) - view.but(readout="CCD").picture(80, 60)).mean() > 10


def test_the_picture_is_dark_where_it_is_not_read():
    view = ReadoutView(time=50)
    picture = photo(view, "picture")
    assert picture[130:].mean() < 0.25 * picture[:110].mean()
    assert f"{ROWS // 2} of {ROWS} rows" in view.numbers().values()


def test_the_sensors_numbers_are_those_of_its_sensor():
    view = ImageSensorView(full_well=5000, bits=8, fill_factor=0.5)
    numbers, sensor = view.numbers(), view.sensor
    assert sensor.efficiency() == pytest.approx(0.385)
    assert numbers["dynamic range"].startswith(f"{float(decibel(sensor.dynamic_range())):.1f} dB")
    assert numbers["converter"] == f"8 bits, {5000 / 255:.3g} e⁻ a step"
    assert numbers["greatest SNR"] == f"{10 * np.log10(5000):.1f} dB"


def test_a_white_walls_electrons_are_those_of_the_shot():
    """Mean of red pixels on the axis of a wall, to 1 %: the shot's own expectation, photons times efficiency."""
    view = ImageSensorView()
    camera = view.camera(64)
    shot = camera.take(np.ones((48, 64, 3), np.float32), view.exposure_ms / 1000, np.random.default_rng(1))
    red = camera.pattern.mask(0, 48, 64)
    red[:20] = red[28:] = red[:, :26] = red[:, 38:] = False
    assert shot.exposure.photoelectrons[red].mean() == pytest.approx(view.white_e[0], rel=0.02)


def test_more_light_than_the_well_holds_is_white():
    assert photo(ImageSensorView(full_well=1000, exposure_ms=100), "photograph")[:60].min() > 240
    assert "overfills red and green and blue" in ImageSensorView(full_well=1000, exposure_ms=100).description()


@pytest.mark.parametrize("model", ImageSensorView.controls()["model"].choices)
def test_a_right_count_stands_beside_the_right_one(model):
    """Where one efficiency was published, it is taken at 555 nm too; 4091 photons per lux is rounded."""
    view = ImageSensorView(model=model, exposure_ms=7.0, fill_factor=0.6, yours=expected_electrons)
    electrons, problem = view.your_e
    assert problem == ""
    assert electrons == pytest.approx(view.green_e, rel=2e-4)
    by_channel = 4091 * float(view.sensor.efficiency(555)) * 1000 / 64 * 0.007
    assert view.green_e == pytest.approx(by_channel * view.camera(4).pitch_um ** 2, rel=2e-4)
    figure = view.figure()
    assert [text.words for text in figure.marks.texts()].count(f"{float(f'{electrons:.3g}'):,.0f}") == 2
    plot = figure.marks.panels()["electrons"]
    (bar,) = (mark for mark in plot.marks.of("orange") if mark.class_ == "orange")
    height = plot.height * np.log10(min(electrons, view.full_well)) / np.log10(300_000)
    assert np.ptp(bar.lines[0][:, 1]) == pytest.approx(height)


@pytest.mark.parametrize("row_us", [12.0, 64.0, 111.0])
def test_a_right_row_time_of_the_readers_lies_on_the_line(row_us):
    view = ReadoutView(subject="wall under a lamp", panels="picture time", row_us=row_us, yours=row_time)
    seconds, problem = view.your_row_s
    assert problem == ""
    assert seconds == pytest.approx(1e-6 * row_us)
    assert f"{row_us:g} µs" in view.numbers()["row time, yours"]
    marks = view.figure().marks.panels()[view._clock.name].marks
    (dots,) = (mark.points for mark in marks.of("orange") if isinstance(mark, Discs))
    (start, end) = marks.points("orange thick")
    np.testing.assert_allclose(dots, np.linspace(start, end, len(dots)), atol=1e-6)
    assert view._clock.data(end)[0] == pytest.approx(480 * row_us / 1000)
    for function, words in ((lambda *_: None, "yours appears here"), (lambda *_: np.ones(3), "`<lambda>`")):
        silent = view.but(yours=function)
        assert np.isnan(silent.your_row_s[0])
        assert words in " ".join(text.words for text in silent.figure().marks.texts())
        assert "row time, yours" not in silent.numbers()


def test_the_wall_shows_the_stripes_of_the_lamp():
    """The lamp is bright twice in each period of 20 ms; a frame of 480 rows of 100 µs lasts 48 ms."""
    view = ReadoutView(subject="wall under a lamp", row_us=100.0, time=100)
    assert view.stripes == pytest.approx(4.8)
    line = view.picture(*LARGE)[:, 0, 1].astype(float)
    peaks = np.flatnonzero((line[1:-1] >= line[:-2]) & (line[1:-1] > line[2:])) + 1
    assert np.diff(peaks).mean() == pytest.approx(len(line) / view.stripes, rel=0.02)
    even = view.but(readout="CCD").picture(*LARGE)
    assert np.ptp(even) == np.ptp(even[0])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("turns", [0.0, 0.37, 2.9])
@pytest.mark.parametrize("during", [0.012, 0.12, 0.7])
def test_a_blurred_fan_is_the_mean_of_the_sharp_ones_meanwhile(turns, during):
    v, u = np.mgrid[-1:1:23j, -1.3:1.3:31j]
    moments = turns - during * (np.arange(4000) + 0.5) / 4000
    mean = np.mean([fan(u, v, one) for one in moments], axis=0)
    np.testing.assert_allclose(fan(u, v, turns, during), mean, atol=2e-3)


def test_a_walls_light_is_the_lamps_mean_during_exposure():
    view = ReadoutView(subject="wall under a lamp", exposure_ms=4.0, row_us=100.0)
    read_s = 480 / LARGE[1] * 100e-6 * np.arange(LARGE[1])
    lamp = np.sin(2 * np.pi * 50 * (read_s[:, None] - 4e-3 * (np.arange(1000) + 0.5) / 1000)) ** 2
    expected = to_display((0.04 + 0.7 * lamp.mean(axis=1))[:, None, None] * np.array([1.0, 0.97, 0.9]))
    assert np.abs(view.picture(*LARGE)[:, :1].astype(int) - expected).max() <= 1
