"""Dark current: electrons that heat, not light, sets free, and how they multiply as silicon warms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.arrays import CelsiusLike

BOLTZMANN_EV_PER_K = 8.617333262e-5
ZERO_CELSIUS_K = 273.15


def band_gap_ev(temperature_c: CelsiusLike) -> Any:
    """Silicon's band gap: E_g = 1.1557 - 7.021e-4 T² / (1108 + T), T in kelvin.

    Returns: array (...), in electron volts.

    Raises:
        ValueError: Below absolute zero.

    Source: Y. P. Varshni, Temperature dependence of the energy gap in semiconductors, Physica 34 (1967).

    >>> band_gap_ev(300 - 273.15).round(4)
    np.float64(1.1108)
    """
    T = _kelvin(temperature_c)
    return 1.1557 - 7.021e-4 * T**2 / (1108 + T)


def dark_current_ratio(temperature_c: CelsiusLike, reference_c: CelsiusLike) -> Any:
    """How many times the dark current at one temperature flows at another.

    Electrons climb by way of traps in the middle of the gap: D ∝ T^1.5 exp(-E_g / 2kT).

    Returns: array (...), a ratio, 1 at the reference.

    Raises:
        ValueError: Below absolute zero.

    Source: J. R. Janesick, Scientific Charge-Coupled Devices (2001), chapter 7.

    Cooled from 20 °C to -20 °C, a sensor has a fiftieth of its dark current:

    >>> dark_current_ratio(-20, reference_c=20).round(3)
    np.float64(0.02)
    """
    T, reference = _kelvin(temperature_c), _kelvin(reference_c)
    halves = band_gap_ev(reference_c) / reference - band_gap_ev(temperature_c) / T
    return (T / reference) ** 1.5 * np.exp(halves / (2 * BOLTZMANN_EV_PER_K))


def doubling_temperature_k(temperature_c: CelsiusLike) -> Any:
    """By how much silicon must warm for its dark current to double, at the slope that it has at a temperature.

    ln 2 / (d ln D / dT) = ln 2 · T / (3/2 + (E_g - T E_g') / 2kT): it grows with the temperature.

    Returns: array (...), in kelvin.

    Raises:
        ValueError: Below absolute zero.

    Source: J. R. Janesick, Scientific Charge-Coupled Devices (2001), chapter 7, for the law of which this is the slope.

    >>> doubling_temperature_k([-20, 20, 60]).round(1)
    array([ 6.1,  8.1, 10.3])
    """
    T = _kelvin(temperature_c)
    gap_slope = -7.021e-4 * T * (T + 2 * 1108) / (1108 + T) ** 2  # E_g'
    activation = (band_gap_ev(temperature_c) - T * gap_slope) / 2
    return np.log(2) * T / (1.5 + activation / (BOLTZMANN_EV_PER_K * T))


def _kelvin(temperature_c: ArrayLike) -> Any:
    T = np.asarray(temperature_c, dtype=float) + ZERO_CELSIUS_K
    if not np.all(T > 0):
        raise ValueError(f"temperature_c must lie above absolute zero, -273.15 °C, got {T.min() - ZERO_CELSIUS_K:g}")
    return T
