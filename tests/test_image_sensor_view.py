"""The sensors' visualizers show what the sensors do, and every control is seen at both of its ends."""

import html

import cv2
import numpy as np
import pytest
from test_tiles import problems, unit_on_a_telephone

from camviz.cameras import Camera, Intrinsics
from camviz.draw.flow import STILL
from camviz.scenes import textured_scene, to_display
from camviz.sensors import decibel, gliding, rolling_picture
from camviz_school.course.material import module
from camviz_school.views.image_sensor import ImageSensorView
from camviz_school.views.readout import LARGE, ROWS, ReadoutView, fan

expected_electrons, row_time = module("14").expected_electrons, module("14").row_time

VIEWS = (ReadoutView(), ReadoutView(subject="view from a train"), ImageSensorView())
ENDS = [
    (view, name, value)
    for view in VIEWS
    for name, control in view.controls().items()
    for value in (control.choices or (control.low, control.high))
    if value != getattr(view, name)
]


def name_of(part):
    return type(part).__name__ if hasattr(part, "figure") else str(part)


@pytest.mark.parametrize(("view", "name", "value"), ENDS, ids=name_of)
def test_both_ends_of_every_control_draw_and_change_the_picture(view, name, value):
    first, other = view.figure(draft=True), view.but(**{name: value}).figure(draft=True)
    assert other.body != first.body or other.photographs != first.photographs
    assert other.description != first.description
    assert "nan" not in other.body.lower().replace("nanmedian", "")


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


@pytest.mark.parametrize("readout", ["CCD", "CMOS, global shutter"])
def test_what_is_exposed_at_once_is_the_scene_of_the_first_moment(readout):
    view = ReadoutView(readout=readout, time=80, exposure_ms=0.1)
    picture, scene = view.picture(*LARGE).astype(float), view.but(time=0).scene_now(*LARGE)
    assert np.abs(picture - scene).mean() < 2
    assert "moves 0 px" in view.description()


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


def test_the_fan_s_own_blades_are_straight_and_bent_in_the_picture_alone():
    """An edge of the scene's blade lies on one ray from the hub; with the rolling shutter it does not."""
    radius = np.linspace(0.2, 0.8, 25)
    angle = np.radians(np.arange(0, 360, 0.5))
    u, v = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    still = fan(u, v, 0.37)
    assert (still == still[:1]).all()  # the same along each ray, at every distance from the hub
    rolling = fan(u, v, 0.37 + 0.3 * v)  # each row, v, a little later
    assert np.abs(rolling - rolling[:1]).max() > 0.1


def test_a_turn_of_the_fan_is_no_turn():
    u, v = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 31))
    np.testing.assert_allclose(fan(u, v, 0.3), fan(u, v, 1.3))
    assert np.abs(fan(u, v, 0.3) - fan(u, v, 0.4)).max() > 0.1


def test_dragging_the_clock_moves_the_time():
    view = ReadoutView(time=50)
    assert view.dragged("time", 0, 0, 26, 0).time > view.time
    assert view.pressed("time", "ArrowLeft").time < view.time
    assert view.dragged("time", 0, 0, 1e4, 0).time == 100


def test_the_sensors_numbers_are_those_of_its_sensor():
    view = ImageSensorView(full_well=5000, bits=8, fill_factor=0.5)
    numbers, sensor = view.numbers(), view.sensor
    assert sensor.efficiency() == pytest.approx(0.385)
    assert numbers["dynamic range"].startswith(f"{float(decibel(sensor.dynamic_range())):.1f} dB")
    assert numbers["converter"] == f"8 bits, {5000 / 255:.3g} e⁻ a step"
    assert numbers["greatest SNR"] == f"{10 * np.log10(5000):.1f} dB"


def test_a_white_walls_electrons_are_those_that_the_shot_counts():
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


def test_few_bits_leave_few_levels():
    raw = ImageSensorView(bits=3).shot(64).raw
    assert set(np.unique(raw)) <= set(range(8))


def test_states_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="row_us must be positive"):
        ReadoutView(row_us=0)
    with pytest.raises(ValueError, match="time"):
        ReadoutView(time=101)
    with pytest.raises(ValueError, match="exposure_ms"):
        ImageSensorView(exposure_ms=0)


def nothing_yet(*given):
    """Not written yet."""


@pytest.mark.parametrize("model", ImageSensorView.controls()["model"].choices)
def test_a_right_count_of_the_readers_stands_beside_the_right_one(model):
    """Where one efficiency was published, it is taken at 555 nm too; 4091 photons per lux is rounded."""
    view = ImageSensorView(model=model, exposure_ms=7.0, fill_factor=0.6, yours=expected_electrons)
    electrons, problem = view.your_e
    assert problem == ""
    assert electrons == pytest.approx(view.green_e, rel=2e-4)
    by_channel = 4091 * float(view.sensor.efficiency(555)) * 1000 / 64 * 0.007
    assert view.green_e == pytest.approx(by_channel * view.camera(4).pitch_um ** 2, rel=2e-4)
    figure = view.figure()
    assert [text.words for text in figure.marks.texts()].count(f"{float(f'{electrons:.3g}'):,.0f}") == 2
    (tile,) = (tile for tile in figure.tiles if tile.name == "electrons")
    assert {"clear", "555 nm", "yours"} <= {text.words for text in tile.uncluttered(STILL).texts()}


@pytest.mark.parametrize(
    ("function", "words"), [(nothing_yet, "yours appears here"), (lambda *given: 1 / 0, "`<lambda>`")]
)
def test_a_function_without_an_answer_leaves_no_bar_and_a_sentence(function, words):
    view = ImageSensorView(yours=function)
    assert np.isnan(view.your_e[0])
    assert words in html.unescape(view.figure().body)
    assert "yours" not in ImageSensorView().figure().body


def test_a_count_beyond_every_well_is_drawn_to_the_brim():
    for answer in (1e30, -5.0, float("inf")):
        figure = ImageSensorView(yours=lambda *given, answer=answer: answer).figure()
        assert "nan" not in figure.body


@pytest.mark.parametrize("row_us", [12.0, 64.0, 111.0])
def test_a_right_row_time_of_the_readers_lies_on_the_line(row_us):
    view = ReadoutView(subject="wall under a lamp", panels="picture time", row_us=row_us, yours=row_time)
    seconds, problem = view.your_row_s
    assert problem == ""
    assert seconds == pytest.approx(1e-6 * row_us)
    assert f"{row_us:g} µs" in view.numbers()["row time, yours"]
    assert "by your row time" in view.figure().body
    twice = view.but(yours=lambda *given: 2 * row_time(*given))
    assert twice.your_row_s[0] == pytest.approx(2e-6 * row_us)
    assert twice.figure().body != view.figure().body


def test_a_row_time_without_an_answer_leaves_a_sentence():
    for function, words in ((nothing_yet, "yours appears here"), (lambda *given: np.ones(3), "`<lambda>`")):
        view = ReadoutView(subject="wall under a lamp", panels="picture time", yours=function)
        assert np.isnan(view.your_row_s[0])
        assert words in html.unescape(view.figure().body)
        assert "row time, yours" not in view.numbers()


def test_the_wall_shows_as_many_stripes_as_the_lamp_is_bright_while_a_frame_is_read():
    """The lamp is bright twice in each period of 20 ms; a frame of 480 rows of 100 µs lasts 48 ms."""
    view = ReadoutView(subject="wall under a lamp", row_us=100.0, time=100)
    assert view.stripes == pytest.approx(4.8)
    line = view.picture(*LARGE)[:, 0, 1].astype(float)
    peaks = np.flatnonzero((line[1:-1] >= line[:-2]) & (line[1:-1] > line[2:])) + 1
    assert np.diff(peaks).mean() == pytest.approx(len(line) / view.stripes, rel=0.02)
    even = view.but(readout="CCD").picture(*LARGE)
    assert np.ptp(even) == np.ptp(even[0])


PANELS = ("picture", "scene picture", "picture time", "picture charge", "scene picture numbers charge time")


@pytest.mark.parametrize("panels", PANELS)
@pytest.mark.parametrize("row_time", [lambda stripes, rows, hertz: stripes / (2 * hertz) / rows, lambda *_: None])
def test_words_of_the_read_out_stand_free_in_every_set_of_panels(panels, row_time):
    view = ReadoutView(subject="wall under a lamp", panels=panels, yours=row_time)
    for tile in view.figure(draft=True).tiles:
        assert problems(tile, 1.0) + problems(tile, unit_on_a_telephone(tile)) == []


def test_a_view_opens_with_the_panels_that_are_asked_for_and_others_by_buttons():
    few = ReadoutView(panels="picture")
    some = few.with_panels({"time": True})
    assert [tile.name for tile in few.figure().tiles] == ["picture"]
    assert [tile.name for tile in some.figure().tiles] == ["picture", "time", "what happens"]
    assert few.opened == ()
    assert set(few.figure().photographs) == {"picture"}
    with pytest.raises(ValueError, match="panels must be picture and any of"):
        ReadoutView(panels="time")
    sheet = ImageSensorView(panels="efficiency")
    assert [tile.name for tile in sheet.figure().tiles] == ["efficiency"]
    assert sheet.figure().photographs == {}
    with pytest.raises(ValueError, match="panels must be any of"):
        ImageSensorView(panels="spectrum")


@pytest.mark.sampled(2)
@pytest.mark.parametrize("turns", [0.0, 0.37, 2.9])
@pytest.mark.parametrize("during", [0.012, 0.12, 0.7])
def test_a_blurred_fan_is_the_mean_of_the_sharp_ones_meanwhile(turns, during):
    v, u = np.mgrid[-1:1:23j, -1.3:1.3:31j]
    moments = turns - during * (np.arange(4000) + 0.5) / 4000
    mean = np.mean([fan(u, v, one) for one in moments], axis=0)
    np.testing.assert_allclose(fan(u, v, turns, during), mean, atol=2e-3)


def test_a_wall_s_light_is_the_mean_of_the_lamp_s_while_its_row_is_exposed():
    view = ReadoutView(subject="wall under a lamp", exposure_ms=4.0, row_us=100.0)
    read_s = 480 / LARGE[1] * 100e-6 * np.arange(LARGE[1])
    lamp = np.sin(2 * np.pi * 50 * (read_s[:, None] - 4e-3 * (np.arange(1000) + 0.5) / 1000)) ** 2
    expected = to_display((0.04 + 0.7 * lamp.mean(axis=1))[:, None, None] * np.array([1.0, 0.97, 0.9]))
    assert np.abs(view.picture(*LARGE)[:, :1].astype(int) - expected).max() <= 1


def test_a_long_exposure_blurs_what_is_near_the_train_and_what_stands_still_stays_sharp():
    fast = ReadoutView(subject="view from a train", readout="CCD", exposure_ms=10.0, speed=25.0)
    still = fast.but(speed=0.0)
    sharp = still.but(exposure_ms=0.1).picture(80, 60)
    np.testing.assert_allclose(still.picture(80, 60), sharp, atol=1)
    assert (
        np.abs(np.diff(fast.picture(80, 60).astype(float), axis=1)).mean()
        < 0.8 * np.abs(np.diff(sharp.astype(float), axis=1)).mean()
    )
