"""The exposure visualizer: stops add up, the meter makes everything grey, and the corners follow the lens."""

import numpy as np
import pytest

from camviz_school.views.exposure import FULL_WELL_E, ExposureView


@pytest.mark.parametrize("change", [{"f_number": 8.0}, {"shutter": -11.0}, {"light_ev": 13.0}])
def test_two_stops_less_by_any_knob_are_a_quarter_of_the_light(change):
    one = ExposureView(f_number=4.0, shutter=-9.0, light_ev=15.0)
    other = one.but(**change)
    assert other.electrons_of_white == pytest.approx(one.electrons_of_white / 4)
    sunny_16 = ExposureView(f_number=16.0, shutter=-7.0)
    assert sunny_16.electrons_of_white == pytest.approx(FULL_WELL_E)
    more = one.but(iso=2.0)  # gain frees no electrons and scales the numbers
    assert more.electrons_of_white == pytest.approx(one.electrons_of_white)


@pytest.mark.parametrize("subject", ["garden", "snow", "coal"])
@pytest.mark.parametrize("light_ev", [7.0, 15.0])
@pytest.mark.parametrize("vignetting", ["none", "cos⁴"])
def test_the_meter_brings_every_mean_to_18_percent(subject, light_ev, vignetting):
    view = ExposureView(subject=subject, light_ev=light_ev, vignetting=vignetting, metering="average", f_number=4.0)
    assert view.recorded(draft=True).mean() == pytest.approx(0.18, abs=0.006)  # a few pixels are cut off
    assert view.but(compensation=-1.0).recorded(draft=True).mean() == pytest.approx(0.09, abs=0.003)


def test_the_corners_of_the_picture_follow_the_fall_off():
    view = ExposureView(vignetting="cos⁴ and rim", f_number=1.4, shutter=-15.0)
    plain, dark = view.but(vignetting="none").recorded(draft=False), view.recorded(draft=False)
    corner = dark[:12, :12].mean() / plain[:12, :12].mean()
    assert corner == pytest.approx(float(view.falloff(np.array(20.9))), rel=0.03)
    middle = (slice(128, 138), slice(194, 206))
    assert dark[middle].mean() == pytest.approx(plain[middle].mean(), rel=0.01)


def test_stopping_down_leaves_the_fourth_power():
    corner = np.array(21.6)
    wide, narrow = (ExposureView(vignetting="cos⁴ and rim", f_number=N).falloff(corner) for N in (1.4, 5.6))
    assert wide < 0.7 * narrow
    assert narrow == pytest.approx(np.cos(np.arctan(21.6 / 35)) ** 4)


def test_a_readers_function_is_drawn_where_it_answers():
    view = ExposureView(yours=lambda r, v: np.cos(np.arctan(r / v)) ** 4, vignetting="cos⁴")
    marks = view.figure(draft=True).marks.panels()["corners"].marks
    own, now = (marks.of(style)[0].lines[0] for style in ("orange", "ink thick"))
    np.testing.assert_allclose(own, now[::3], atol=1e-6)
