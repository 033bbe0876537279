"""The photon-transfer visualizer measures what it simulates, and its chance holds still while something is turned.

Random draws are seeded; "false failure" is how often a correct view would fail with another seed.
"""

import re

import numpy as np
import pytest

from camviz.draw.flow import SCROLLED, WIDTH
from camviz.sensors import Sensor
from camviz.sensors.common_random_numbers import Draw, exposed
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.views.measured_noise import MeasuredNoiseView
from camviz_school.views.noise import LEVELS, PhotonTransferView

QUIET = {"read_noise_e": 0.0, "prnu": 0.0, "dsnu_e": 0.0, "dark_current": 0.0}


@pytest.mark.parametrize("electrons", [0.0, 5.0, 40.0, 3_000.0, 14_990.0])
def test_still_frames_have_the_law_of_the_sensor(electrons):
    """Mean and deviation of 100k pixels against `Sensor.expose`. False failure: 1e-5 each (limits of 5σ and more)."""
    sensor = Sensor(0.5, 15_000, 7.0, 0.25, 60.0, 12, dark_current_e_per_s=30, dsnu_e=6, prnu=0.01)
    true = sensor.expose(np.full((250, 400), electrons / 0.5), 0.2, 20.0, np.random.default_rng(1)).dn
    still = exposed(sensor, np.full(100_000, electrons), 0.2, 20.0, Draw.of((100_000,), (100_000,), 2))
    assert still.std() == pytest.approx(true.std(), rel=0.02, abs=0.01)
    assert still.mean() == pytest.approx(true.mean(), abs=0.04 * true.std() + 0.03)
    assert (still == np.rint(still)).all()


def test_an_average_is_as_quiet_as_so_many_frames_and_keeps_the_pattern():
    """40k pixels. False failure: 1e-5 (2 % is 5.6 standard deviations)."""
    sensor = Sensor(0.5, 15_000, 7.0, 0.25, 60.0, 12, prnu=0.01, dsnu_e=6)
    shape = (2, 40_000)
    frames = exposed(sensor, np.full(shape, 2_000.0), 0.1, 20.0, Draw.of(shape, shape[1:], 3), averaged=16)
    time = (frames[0] - frames[1]).std() / 2**0.5
    assert time == pytest.approx(np.sqrt(0.25**2 * (2_000 + 49) / 16 + 1 / 12 / 256 / 16), rel=0.02)
    pattern = np.cov(frames)[0, 1]
    assert pattern == pytest.approx(0.25**2 * (20**2 + 6**2), rel=0.05)


@pytest.mark.parametrize(
    ("kind", "state", "slope"),
    [
        ("read noise", {"read_noise_e": 30.0, "photon_noise": False}, 0.0),
        ("photons", {}, 0.5),
        ("PRNU", {"prnu": 5.0, "photon_noise": False}, 1.0),
    ],
)
def test_every_kind_of_noise_has_its_slope(kind, state, slope):
    """0, ½ and 1 between 100 and 8 000 electrons, of points measured on frames. False failure: below 1e-6."""
    view = PhotonTransferView(**{**QUIET, **state})
    signal, noise, _ = view.measured()
    used = (LEVELS * 4_000 > 100) & (LEVELS * 4_000 < 8_000)
    fitted = np.polyfit(np.log(signal[used]), np.log(noise[used]), 1)[0]
    assert fitted == pytest.approx(slope, abs=0.02)
    part = view.parts(LEVELS[used] * 4_000)[kind]
    np.testing.assert_allclose(noise[used], part, rtol=0.06)  # 6 000 pixels: 0.9 %, and rounding


@pytest.mark.parametrize("state", [{}, {"gain": 8.0}, {"frames": 16}, {"read_noise_e": 30.0, "prnu": 5.0}])
def test_the_gain_falls_out_of_the_difference_and_not_out_of_one_frame(state):
    """Within 6 %: the level that counts most is known to 1.8 % by 6 000 pixels. False failure: 1e-3 at most."""
    view = PhotonTransferView(**state, difference=True)
    fitted = view.fitted_gain(*view.measured())
    assert fitted == pytest.approx(view.sensor.gain_dn_per_e, rel=0.06)
    alone = view.but(difference=False)
    assert alone.fitted_gain(*alone.measured()) > 1.06 * view.sensor.gain_dn_per_e


def test_the_points_lie_on_the_curve_of_all_parts_together():
    """False failure: below 1e-5 for each of the points (limits of 5 standard deviations)."""
    view = PhotonTransferView()
    _, noise, _ = view.measured()
    below = LEVELS * 4_000 < 0.9 * 15_000
    whole = np.sqrt(sum(part**2 for part in view.parts(LEVELS * 4_000).values()))
    np.testing.assert_allclose(noise[below], whole[below], rtol=0.05)


def test_chance_holds_still_while_the_exposure_is_turned():
    """The grain of two exposures a twentieth of a stop apart is the same to a tenth of its size."""
    one, other = (PhotonTransferView(exposure=stops).image(draft=True) for stops in (-4.0, -3.95))
    grain = one - one.mean()
    assert np.corrcoef(grain.ravel(), other.ravel())[0, 1] > 0.99
    card = one[-40:-20, -50:-20]
    assert np.corrcoef(card.ravel(), other[-40:-20, -50:-20].ravel())[0, 1] > 0.95


def test_bits_of_the_converter_bound_the_numbers():
    for bits in (4, 8, 12):
        dn = PhotonTransferView(bits=bits, exposure=3.0, gain=4.0).image(draft=True)
        assert dn.max() == 2**bits - 1
        assert (dn == np.rint(dn)).all()


def test_averages_of_four_frames_come_in_quarters():
    dn = PhotonTransferView(frames=4).image(draft=True)
    assert (4 * dn == np.rint(4 * dn)).all()
    assert (dn != np.rint(dn)).mean() > 0.5


@pytest.mark.parametrize("name", PhotonTransferView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = PhotonTransferView.controls()[name]
    base = PhotonTransferView()
    ends = (control.low, control.high) if control.low is not None else (True, False)
    pictures = [base.but(**{name: end}).figure(draft=True) for end in ends]
    assert len({(picture.svg(), picture.photographs["camera"]) for picture in pictures}) == 2


def test_the_exposure_is_dragged_along_the_curve():
    view = PhotonTransferView(exposure=-4.0)
    one_stop = view._plot.scale[0] * np.log10(2)
    assert view.dragged("exposure", 0, 0, one_stop, 0).exposure == pytest.approx(-3.0)
    assert view.pressed("exposure", "ArrowRight").exposure == pytest.approx(-3.5)
    assert view.dragged("exposure", 0, 0, 1e4, 0).exposure == 3.0
    assert view.dragged("picture", 0, 0, 50, 0) == view


def test_the_description_states_the_state():
    words = PhotonTransferView(exposure=-3.0, difference=True).description()
    assert "500 e⁻" in words
    assert "difference of two frames" in words
    assert "1/8 s" in words


@pytest.mark.parametrize("bad", [{"exposure": np.nan}, {"gain": 0.5}, {"frames": 0}, {"difference": 1}])
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        PhotonTransferView(**bad)


def test_a_measurement_is_shown_with_its_figures_and_without_those_it_lacks():
    rng = np.random.default_rng(5)
    sensor = Sensor(prnu=0.02, dsnu_e=5)

    def shot(photons, t):
        return [sensor.expose(np.full((200, 300), photons), t, 20.0, rng).dn for _ in range(2)]

    levels = tuple(Level.of(t, shot(9_000 * t, t), shot(0, t)) for t in np.linspace(0.1, 1, 8))
    view = MeasuredNoiseView(measurement=Measurement(levels))
    assert view.numbers()["quantum efficiency η"] == "not known"
    assert re.fullmatch(r"0\.3[78]\d+ DN/e⁻", view.numbers()["system gain K"])
    assert view.numbers()["saturation capacity"] == "not known"
    body = view.figure().body
    assert "NaN" not in body
    assert "exposure (ms)" in body


def test_a_reader_s_noise_is_drawn_beside_the_right_one_whatever_it_does():
    view = PhotonTransferView(prnu=2.0, dsnu_e=0.0, dark_current=0.0, fit=False, panels="picture curve")

    def right(electrons, read_noise, prnu):
        return np.sqrt(read_noise**2 + electrons + (prnu * electrons) ** 2)

    drawn = view.but(yours=right).figure(draft=True).svg()
    assert "orange thick" in drawn
    wrong = view.but(yours=lambda electrons, read_noise, prnu: read_noise + electrons).figure(draft=True).svg()
    assert wrong != drawn
    assert "yours appears here" in view.but(yours=lambda *_: None).figure(draft=True).svg()
    assert "ZeroDivisionError" in view.but(yours=lambda *_: 1 / 0).figure(draft=True).svg()


def test_each_panel_opens_and_closes_and_is_drawn_alone():
    for name in PhotonTransferView.openable:
        drawn = PhotonTransferView(panels=name).figure(draft=True)
        assert [tile.name for tile in drawn.tiles] == ([name, "key"] if name == "curve" else [name])
        assert ("camera" in drawn.photographs) == (name == "picture")
    few = PhotonTransferView(panels="picture", fit=False)
    for later in ("Histogram", "mostly from", "gain K", "on the card"):
        assert later not in few.figure(draft=True).svg()
        assert later not in few.description()
    opened = few.with_panels({"figures": True, "curve": True})
    assert opened.opened == ("picture", "curve", "figures")
    assert "on the card" in opened.description()
    assert "gain K" not in opened.description()
    for wrong in ("", "picture lines"):
        with pytest.raises(ValueError, match="panels must be one or more of picture, curve, histogram, figures"):
            PhotonTransferView(panels=wrong)


@pytest.mark.parametrize("panels", ["picture figures", "curve figures", "picture curve histogram figures"])
def test_the_tiles_hold_what_stands_in_them(panels):
    """No tile reaches into another, and the last of the figures stands inside its own."""
    view = PhotonTransferView(panels=panels)
    for tile in (tiles := view.figure(draft=True).tiles):
        left, top, width, height = tile.cell
        assert left + width <= WIDTH
        for other in tiles:
            x, y, wide, high = other.cell
            apart = x >= left + width or left >= x + wide or y >= top + height or top >= y + high
            assert other is tile or apart
    (x, y, _, height), told = view._layout["figures"], view._told()
    assert y + 26 + 37 * (len(told) - 1) + 17 < y + height


def test_a_telephone_shows_the_whole_curve_and_all_names_of_its_lines():
    """A wider tile would be scrolled there; each name stands in its own tile, also where a reader's curve is one."""
    view = PhotonTransferView(panels="curve", yours=lambda electrons, *_: electrons)
    curve, key = view.figure(draft=True).tiles
    assert max(curve.cell[2], key.cell[2]) <= SCROLLED
    assert len(key.marks.texts()) == 8
    assert max(text.y for text in key.marks.texts()) + 34 < key.cell[3]


def test_a_full_card_is_called_full():
    assert PhotonTransferView(exposure=2.0).numbers()["on the card"] == "full, 15,000 e⁻"
    assert PhotonTransferView(exposure=1.0).numbers()["on the card"].startswith("8,000 e⁻ ± ")
