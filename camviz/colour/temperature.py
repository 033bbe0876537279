"""Colour temperature: the Planckian locus, the nearest temperature on it, and how far beside it a light lies.

Temperature alone names only the lights of a line. Duv, the distance from it in the CIE 1960 (u, v) diagram, above zero
towards green and below towards magenta, is what photographers call tint.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from camviz.colour.spaces import chromaticity
from camviz.colour.spectra import planckian, whole_observer
from camviz.lenses.arrays import KelvinLike
from camviz.lenses.base import Array

LOWEST, HIGHEST = 1000.0, 100_000.0  # kelvin
FARTHEST = 0.05  # from the locus, in Duv: beyond, a colour temperature says nothing (CIE 15:2004, 9.5)


def locus_xy(kelvin: KelvinLike) -> Array:
    """The chromaticity of black bodies: the Planckian locus.

    Returns: (..., 2), CIE (x, y).
    Raises: ValueError unless every temperature is above 0.
    Source: CIE 015:2018, Colorimetry.

    Colder light bulbs are redder, and the limit of heat is a bluish white:

    >>> locus_xy([2856, 1e9]).round(3)
    array([[0.448, 0.407],
           [0.24 , 0.234]])
    """
    nm, bars = whole_observer()
    return chromaticity(planckian(kelvin, nm) @ bars)


def temperature(xy: ArrayLike) -> tuple[float, float]:
    """The correlated colour temperature in kelvin, and Duv, of CIE (x, y) (2,); NaN where there is none.

    The nearest point of the Planckian locus in (u, v), from a table and then by Newton's method in 1/kelvin, where the
    locus is nearly even (the CIE's definition; Duv's sign as in ANSI C78.377).
    """
    uv = uv_of_xy(xy)
    kelvins, locus = _locus()
    nearest = int(np.argmin(np.sum((locus - uv) ** 2, axis=-1)))
    if not 0 < nearest < len(kelvins) - 1:
        return np.nan, np.nan
    kelvin = kelvins[nearest]
    for _ in range(12):
        foot, speed = _locus_at(kelvin)
        kelvin = 1 / (1 / kelvin + (uv - foot) @ speed / (speed @ speed))
    foot, speed = _locus_at(kelvin)
    duv = float((uv - foot) @ _across(speed))
    return (float(kelvin), duv) if abs(duv) <= FARTHEST else (np.nan, np.nan)


def xy_of_temperature(kelvin: float, duv: float = 0.0) -> Array:
    """The chromaticity of a light of a colour temperature, beside the Planckian locus.

    Args:
        kelvin: The correlated colour temperature.
        duv: How far beside the locus in the (u, v) diagram: above 0 towards green, below towards magenta.

    Returns: (2,), CIE (x, y).
    Raises: ValueError for a temperature that is not above 0.
    Source: CIE 1960 UCS diagram, and ANSI C78.377 for the sign of Duv.

    D65 lies 0.0032 to the green side of a black body of 6504 K:

    >>> xy_of_temperature(6504, 0.0032).round(3)
    array([0.313, 0.329])
    """
    if not kelvin > 0:
        raise ValueError(f"kelvin must be above 0, got {kelvin}")
    point, speed = _locus_at(kelvin)
    return xy_of_uv(point + duv * _across(speed))


def uv_of_xy(xy: ArrayLike) -> Array:
    """CIE 1960 (u, v) (..., 2) of CIE (x, y) (..., 2)."""
    x, y = np.moveaxis(np.asarray(xy, dtype=float), -1, 0)
    return np.stack([4 * x, 6 * y], axis=-1) / (-2 * x + 12 * y + 3)[..., None]


def xy_of_uv(uv: ArrayLike) -> Array:
    """CIE (x, y) (..., 2) of CIE 1960 (u, v) (..., 2)."""
    u, v = np.moveaxis(np.asarray(uv, dtype=float), -1, 0)
    return np.stack([3 * u, 2 * v], axis=-1) / (2 * u - 8 * v + 4)[..., None]


def _locus_at(kelvin: float) -> tuple[Array, Array]:
    """The locus's point (2,) in (u, v), and how fast it moves there with 1/kelvin (2,)."""
    step = 1e-4 / kelvin
    before, here, after = uv_of_xy(locus_xy(1 / (1 / kelvin + np.array([-step, 0, step]))))
    return here, (after - before) / (2 * step)


def _across(speed: Array) -> Array:
    """The direction (2,) across the locus, towards green, where it moves with that speed towards red."""
    return np.array([-speed[1], speed[0]]) / np.hypot(*speed)


@cache
def _locus() -> tuple[Array, Array]:
    """Temperatures (n,), rising by 3 % each, and their (u, v) (n, 2)."""
    kelvins = np.geomspace(LOWEST, HIGHEST, 157)
    return kelvins, uv_of_xy(locus_xy(kelvins))
