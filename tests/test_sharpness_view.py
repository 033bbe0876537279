"""The sharpness visualizer: its picture has the blur its curves tell, and a reader's function stands beside them."""

import numpy as np
import pytest

from camviz_clinic.measuring.sharpness import SlantedEdge
from camviz_school.views.sharpness import FIELD_UM, SharpnessView


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
    for pitch in (1.0, 4.0, 12.0):  # the picture shows the same field at every pitch
        height, width, _ = SharpnessView(pitch_um=pitch).image().shape
        assert (width * pitch, height * pitch) == pytest.approx(FIELD_UM, abs=pitch)
    red_sharp = SharpnessView(defocus_um=30.0, axial_um=30.0)  # red focuses farther than green, and blue nearer
    assert [round(red_sharp.disc_mm(k) * 5600) for k in (0, 1, 2)] == [0, 30, 60]


def test_stopping_down_mends_axial_colour_and_not_lateral_colour():
    def fringe(view):
        light = view.image()[:, :40]
        return np.abs(light[..., 0] - light[..., 1]).max()

    axial = [fringe(SharpnessView(f_number=N, axial_um=40.0)) for N in (2.8, 11.0)]
    assert axial[1] < 0.4 * axial[0]
    lateral = [fringe(SharpnessView(f_number=N, lateral_um=6.0)) for N in (2.8, 11.0)]
    assert lateral[1] > 0.6 * lateral[0]
    assert fringe(SharpnessView(f_number=2.8)) == 0


def right(per_mm, f_number, wavelength_mm, pitch_mm):
    s = np.minimum(per_mm * wavelength_mm * f_number, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)) * np.abs(np.sinc(per_mm * pitch_mm))


def test_a_readers_function_lies_on_the_curve_of_the_system():
    view = SharpnessView(yours=right, f_number=8.0, pitch_um=5.0)
    f = np.linspace(0, 200, 41)
    np.testing.assert_allclose(right(f, 8.0, 550e-6, 0.005), view.system(f), atol=1e-6)
    marks = view.figure(draft=True).marks
    own, system = (marks.of(style)[0].lines[0] for style in ("orange", "ink thick"))
    np.testing.assert_allclose(own[:, 1], np.interp(own[:, 0], *system.T), atol=0.5)
