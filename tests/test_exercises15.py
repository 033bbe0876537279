"""The answers of lesson 15's exercises are those of the package that measures and mends, and of NumPy's own draws."""

import numpy as np
import pytest

from camviz.exercises import exercise, lesson15
from camviz.sensors import decibel
from camviz.sensors.correction import NoiseModel, flattened, merged
from camviz.sensors.statistics import pair


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_total_noise_is_that_of_drawn_frames():
    """A million pixels: 0.07 % on a deviation. False failure: 1e-6 (0.5 % is 7 standard deviations)."""
    rng = np.random.default_rng(1)
    drawn = rng.poisson(2_000 * (1 + 0.02 * rng.standard_normal(1_000_000))) + rng.normal(0, 9, 1_000_000)
    assert lesson15.total_noise(np.array(2_000.0), 9.0, 0.02) == pytest.approx(drawn.std(), rel=0.005)


def test_the_gain_is_that_of_the_measured_pairs():
    for bright, dark in cases("15.gain"):
        lit, unlit = pair(*bright), pair(*dark)
        expected = (lit.variance - unlit.variance) / (lit.mean - unlit.mean)
        assert lesson15.gain(bright, dark) == pytest.approx(expected, rel=1e-9)


def test_the_published_ratios_have_the_decibels_of_the_standard():
    """A dynamic range of 1220.69871336 is 61.732 dB, not the 142.14 of the file that gives it."""
    assert lesson15.dynamic_range_db(np.array(1220.69871336), np.array(0.5)) == pytest.approx(61.732, abs=5e-4)
    for full_well, dark_noise in cases("15.dynamic_range_db"):
        expected = decibel(full_well / (dark_noise + 0.5))
        np.testing.assert_allclose(lesson15.dynamic_range_db(full_well, dark_noise), expected)


def test_the_flat_field_is_that_of_camviz():
    for arguments in cases("15.flat_field"):
        np.testing.assert_allclose(lesson15.flat_field(*arguments), flattened(*arguments))


def test_the_merged_bracket_is_camviz_s_to_a_tenth_of_its_error():
    """camviz goes twice through the weights, the exercise once."""
    for electrons, exposures, dark_noise, full_well in cases("15.merge")[:3]:
        frames = electrons.reshape(len(exposures), 1, -1)
        expected, error = merged(frames, exposures, NoiseModel(1.0, dark_noise, 0.0, full_well))
        with np.errstate(invalid="ignore", divide="ignore"):
            found = lesson15.merge(electrons, exposures, dark_noise, full_well).reshape(1, -1)
        assert (np.isnan(found) == np.isnan(expected)).all()
        assert np.nanmax(np.abs(found - expected) / error) < 0.1
