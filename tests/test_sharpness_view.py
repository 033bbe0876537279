"""The sharpness visualizer: its picture has the blur its curves tell, and a reader's function stands beside them."""

import numpy as np
import pytest

from camviz_clinic.measuring.sharpness import SlantedEdge
from camviz_school.views.sharpness import FIELD_UM, SharpnessView

BASE = SharpnessView(f_number=4.0, defocus_um=10.0)
ENDS = [
    (name, end)
    for name, control in SharpnessView.controls().items()
    for end in ((control.low, control.high) if control.low is not None else (True, False))
]


@pytest.mark.parametrize(("name", "end"), ENDS)
def test_every_end_of_every_control_draws_and_changes_what_is_seen(name, end):
    if getattr(BASE, name) == end:
        return
    first, other = BASE.figure(draft=True), BASE.but(**{name: end}).figure(draft=True)
    assert (first.body, first.photographs) != (other.body, other.photographs)
    assert "nan" not in other.body.lower()


@pytest.mark.parametrize(
    "state",
    [
        {"f_number": 8.0, "pitch_um": 2.0},
        {"f_number": 2.0, "pitch_um": 3.0},
        {"f_number": 4.0, "defocus_um": 30.0, "pitch_um": 2.0},
        {"f_number": 16.0, "pitch_um": 3.0},
    ],
)
def test_the_edge_in_the_picture_has_the_mtf_of_the_curve(state):
    """Measured like any photograph of a slanted edge, within 5 %: the wide feet of an Airy disc are cut off."""
    view = SharpnessView(**state)
    light = view.image()[..., 1]
    left = int(140 / view.pitch_um)  # the edge alone
    edge = SlantedEdge.of(light[:, :left])
    assert edge.mtf50 == pytest.approx(view.mtf50_per_mm * view.pitch_um / 1000, rel=0.05)
    frequency = np.linspace(0.02, 0.4, 20)
    np.testing.assert_allclose(edge.mtf(frequency), view.system(frequency / view.pitch_um * 1000), atol=0.045)


def test_the_numbers_are_those_of_the_optics():
    numbers = SharpnessView(f_number=8.0, defocus_um=40.0, pitch_um=5.0, wavelength_nm=500.0).numbers()
    assert numbers["Airy disc"] == "9.8 µm across"  # 2.44 · 0.5 · 8
    assert numbers["defocus disc"] == "5.0 µm across"
    assert numbers["lens passes up to"] == "250 cycles/mm"
    assert numbers["Nyquist frequency"] == "100 cycles/mm"


def test_the_picture_shows_the_same_field_at_every_pitch():
    for pitch in (1.0, 4.0, 12.0):
        height, width, _ = SharpnessView(pitch_um=pitch).image().shape
        assert width * pitch == pytest.approx(FIELD_UM[0], abs=pitch)
        assert height * pitch == pytest.approx(FIELD_UM[1], abs=pitch)


def test_stopping_down_mends_axial_colour_and_not_lateral_colour():
    def fringe(view):
        light = view.image()[:, :40]
        return np.abs(light[..., 0] - light[..., 1]).max()

    axial = [fringe(SharpnessView(f_number=N, axial_um=40.0)) for N in (2.8, 11.0)]
    assert axial[1] < 0.4 * axial[0]
    lateral = [fringe(SharpnessView(f_number=N, lateral_um=6.0)) for N in (2.8, 11.0)]
    assert lateral[1] > 0.6 * lateral[0]
    assert fringe(SharpnessView(f_number=2.8)) == 0


def test_red_focuses_farther_than_green_and_blue_nearer():
    red_sharp = SharpnessView(defocus_um=30.0, axial_um=30.0)
    assert [round(red_sharp.disc_mm(k) * 5600) for k in (0, 1, 2)] == [0, 30, 60]


def right(per_mm, f_number, wavelength_mm, pitch_mm):
    s = np.minimum(per_mm * wavelength_mm * f_number, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)) * np.abs(np.sinc(per_mm * pitch_mm))


def test_a_reader_s_function_is_drawn_in_orange_and_never_raises():
    view = SharpnessView(yours=right, f_number=8.0, pitch_um=5.0)
    f = np.linspace(0, 200, 41)
    np.testing.assert_allclose(right(f, 8.0, 550e-6, 0.005), view.system(f), atol=1e-6)
    assert 'class="orange' in view.figure(draft=True).svg()
    wrong = view.but(yours=lambda *given: 1 / 0)
    assert "ZeroDivisionError" in wrong.figure(draft=True).svg()
    empty = view.but(yours=lambda *given: None)
    assert "yours appears here" in empty.figure(draft=True).svg()
    assert "orange dots" not in empty.figure(draft=True).svg()
    assert "yours" not in SharpnessView().figure(draft=True).body


@pytest.mark.parametrize("bad", [{"f_number": 0.0}, {"pitch_um": 0.1}, {"wavelength_nm": -1.0}, {"defocus_um": np.nan}])
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        SharpnessView(**bad)
