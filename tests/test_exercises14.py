"""The answers of lesson 14's exercises are camviz's own, and the physics', by another way."""

import numpy as np
import pytest
from scipy import constants

from camviz.exercises import exercise, lesson14
from camviz.sensors import SHUTTERS, Sensor, decibel, transferred


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_photons_of_a_lux_are_those_of_the_lumens_definition():
    joule = constants.h * constants.c / 555e-9
    assert pytest.approx(1e-12 / 683 / joule, rel=1e-4) == lesson14.PHOTONS_PER_LUX


def test_dynamic_range_is_the_sensors():
    """But for the noise of quantisation, which 16 bits leave: less than 0.1 dB. The exercise takes σ + ½."""
    for full_well, noise in cases("14.dynamic_range_db"):
        for one, other, found in np.nditer([full_well, noise, lesson14.dynamic_range_db(full_well, noise)]):
            sensor = Sensor(0.5, float(one), float(other), gain_dn_per_e=65535 / float(one), offset_dn=0, bits=16)
            exact = (other + 0.5) / (0.5 + np.sqrt(other**2 + 0.25))
            assert decibel(sensor.dynamic_range() / exact) == pytest.approx(float(found), abs=0.1)


def test_what_arrives_in_its_own_packet_is_the_impulse_response_s_first_value():
    for electrons, efficiency in cases("14.arriving"):
        apart = np.diag(electrons)  # each row's charge in a column of its own
        own = np.diag(transferred(apart, efficiency))
        np.testing.assert_allclose(lesson14.arriving(electrons, efficiency), own, rtol=1e-9)


def test_stripes_of_a_lamp_give_the_row_time_back():
    for one in SHUTTERS:
        assert lesson14.row_time(one.frame_s * 100, one.height, 50) == pytest.approx(one.row_s)
