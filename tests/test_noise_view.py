"""The photon-transfer visualizer measures what it simulates, and its chance holds still while something is turned.

Random draws are seeded; "false failure" is how often a correct view would fail with another seed.
"""

import numpy as np
import pytest

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


def test_an_average_is_as_quiet_as_so_many_frames():
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
def test_the_gain_falls_out_of_the_difference_alone(state):
    """Within 6 %: the level that counts most is known to 1.8 % by 6 000 pixels. False failure: 1e-3 at most."""
    view = PhotonTransferView(**state, difference=True)
    fitted = view.fitted_gain(*view.measured())
    assert fitted == pytest.approx(view.sensor.gain_dn_per_e, rel=0.06)
    alone = view.but(difference=False)
    assert alone.fitted_gain(*alone.measured()) > 1.06 * view.sensor.gain_dn_per_e


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
    four = PhotonTransferView(frames=4).image(draft=True)  # averages come in quarters
    assert (4 * four == np.rint(4 * four)).all()
    assert (four != np.rint(four)).mean() > 0.5
    assert PhotonTransferView(exposure=2.0).numbers()["on the card"] == "full, 15,000 e⁻"
    assert PhotonTransferView(exposure=1.0).numbers()["on the card"].startswith("8,000 e⁻ ± ")


def test_a_measurement_shows_its_figures_and_what_it_lacks():
    rng = np.random.default_rng(5)
    sensor = Sensor(prnu=0.02, dsnu_e=5)

    def shot(photons, t):
        return [sensor.expose(np.full((200, 300), photons), t, 20.0, rng).dn for _ in range(2)]

    levels = tuple(Level.of(t, shot(9_000 * t, t), shot(0, t)) for t in np.linspace(0.1, 1, 8))
    view = MeasuredNoiseView(measurement=Measurement(levels))
    assert view.numbers()["quantum efficiency η"] == "not known"
    assert float(view.numbers()["system gain K"].split()[0]) == pytest.approx(sensor.gain_dn_per_e, rel=0.04)
    assert view.numbers()["saturation capacity"] == "not known"


def test_a_readers_noise_lies_on_the_right_curve():
    view = PhotonTransferView(prnu=2.0, dsnu_e=0.0, dark_current=0.0, fit=False, panels="picture curve")

    def right(electrons, read_noise, prnu):
        return np.sqrt(read_noise**2 + electrons + (prnu * electrons) ** 2)

    curves = view.but(yours=right).figure(draft=True).marks.panels()["transfer"].marks
    whole, own = (curves.of(style)[0].lines[0] for style in ("ink", "orange thick"))
    np.testing.assert_allclose(own[-10:], whole[-10:], atol=0.5)  # rounding alone is left out
    x, y = 10 ** np.array([view._plot.data(place) for place in own]).T
    K = view.sensor.gain_dn_per_e
    np.testing.assert_allclose(y, K * right(x / K, view.read_noise_e, 0.02))
