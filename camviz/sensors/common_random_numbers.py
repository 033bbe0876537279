"""A sensor's frames from one random draw for every setting, so that only what the slider turns changes.

`Sensor.expose` draws afresh and counts few electrons exactly; here a normal draw is
bent to Poisson's law for all counts, whose mean and variance it keeps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from camviz.sensors.counting import Floats
from camviz.sensors.sensor import Sensor

DITHER_DN = 0.3  # of noise before rounding: with less, an average of rounded frames is no finer than one of them


@dataclass(frozen=True, eq=False)
class Draw:
    """Standard normal numbers: of light, heat and reading for every frame (..., n), of the patterns for every pixel."""

    light: Floats
    heat: Floats
    reading: Floats
    gain: Floats
    offset: Floats

    @classmethod
    def of(cls, frames: tuple[int, ...], pattern: tuple[int, ...], seed: int) -> Self:
        """A draw for an array of frames whose patterns, of shape `pattern`, broadcast over them."""
        rng = np.random.default_rng(seed)
        drawn = [rng.standard_normal(shape, dtype=np.float32) for shape in (*[frames] * 3, pattern, pattern)]
        for one in drawn:
            one.flags.writeable = False
        return cls(*drawn)


def exposed(
    sensor: Sensor,
    electrons: ArrayLike,
    exposure_s: ArrayLike,
    temperature_c: float,
    draw: Draw,
    *,
    averaged: int = 1,
    photon_noise: bool = True,
) -> Floats:
    """Frames in DN of `electrons` that light frees on average, by a sensor and this draw; each the mean of `averaged`.

    Arrays broadcast against the draw's. Patterns have no rows or columns here. Averages of n whole numbers are
    multiples of 1/n, if noise of `DITHER_DN` or more carries them over the steps.
    """
    root = np.float32(averaged**-0.5)
    heat = np.multiply(sensor.dark_current(temperature_c), exposure_s, dtype=np.float32)
    freed = np.asarray(electrons, dtype=np.float32) * (1 + np.float32(sensor.prnu) * draw.gain)
    light = _bent(freed, draw.light, root) if photon_noise else freed
    signal = np.minimum(light + _bent(heat, draw.heat, root), np.float32(sensor.full_well_e))
    signal += np.float32(sensor.dsnu_e) * draw.offset
    signal += np.float32(sensor.read_noise_e) * root * draw.reading
    voltage = signal * np.float32(sensor.gain_dn_per_e) + np.float32(sensor.offset_dn)
    spread = sensor.gain_dn_per_e * np.sqrt(sensor.read_noise_e**2 + heat + (freed if photon_noise else 0))
    steps: Any = np.where(spread >= DITHER_DN, np.float32(averaged), np.float32(1))
    return np.clip(np.rint(voltage * steps) / steps, 0, np.float32(2**sensor.bits - 1))


def _bent(mean: Floats, z: Floats, root: np.float32) -> Floats:
    """Counts of that mean: normal numbers with Poisson's variance and skewness (Cornish and Fisher 1938), none below 0.

    The mean of n frames has 1/√n of the deviation and 1/n of the bend.
    """
    spread = np.sqrt(np.maximum(mean - np.float32(1 / 18), 0))  # the bend has the rest of the variance
    return np.maximum(mean + root * spread * z + root**2 * (z * z - 1) / 6, 0)
