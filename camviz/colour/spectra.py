"""Spectra on one grid, 380 … 780 nm in steps of 5: lights, surfaces, the eye and cameras.

Tables were published; their files name their sources. Laws (Planck's, and the CIE's daylight) are computed. A light's
spectrum is relative power per wavelength: its scale has no meaning, 100 at 560 nm for most. Arrays are read-only.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.arrays import KelvinLike
from camviz.lenses.base import Array, as_points

WAVELENGTHS_NM = np.arange(380.0, 781.0, 5.0)
"""The wavelengths (81,) of all spectra here, in nanometres: 380 … 780 in steps of 5; read-only.

>>> len(WAVELENGTHS_NM), WAVELENGTHS_NM[[0, 1, -1]].tolist()
(81, [380.0, 385.0, 780.0])
"""
WAVELENGTHS_NM.flags.writeable = False

ILLUMINANTS = ("A", "D50", "D65", "FL2", "FL7", "FL11", "LED-B3")
"""CIE illuminants in tables: a light bulb, daylights, fluorescent lamps (white, broad, three-band), a white LED."""

CAMERAS = {"Nikon D5100": "nikon_5100", "Sigma SD1 Merrill": "sigma_sd_merrill", "CIE observer": ""}
"""Cameras by name, and the files of their sensitivities. The last is no camera: one that sees exactly as the eye."""

COLDEST_DAYLIGHT = 4000.0
"""The correlated colour temperature, in kelvin, where the CIE's law of daylight begins."""

_SECOND_RADIATION_CONSTANT = 1.4388e-2  # c2 = h c / k in m K as the CIE takes it (ITS-90; CIE 015:2018)
_HOTTEST_DAYLIGHT = 25000.0


def observer() -> Array:
    """The colour-matching functions x̄, ȳ, z̄ of the CIE's standard observer of 2°.

    Returns: (81, 3), at WAVELENGTHS_NM; read-only.
    Source: CIE 1931 standard colorimetric observer, as tabulated in CIE 015:2018.

    The eye is most sensitive at 555 nm:

    >>> WAVELENGTHS_NM[observer()[:, 1].argmax()]
    np.float64(555.0)
    """
    nm, bars = whole_observer()
    return bars[(nm >= WAVELENGTHS_NM[0]) & (nm <= WAVELENGTHS_NM[-1])]


@cache
def whole_observer() -> tuple[Array, Array]:
    """All wavelengths that the observer sees at all, 360 … 830 nm (95,), and x̄, ȳ, z̄ there (95, 3)."""
    _, rows = _rows("observer")
    return rows[:, 0], rows[:, 1:]


def illuminant(name: str) -> Array:
    """The spectrum of a CIE illuminant.

    Args:
        name: {"A", "D50", "D65", "FL2", "FL7", "FL11", "LED-B3"}, a light bulb, daylights, fluorescent lamps, a white
            LED.

    Returns: (81,), relative power at WAVELENGTHS_NM; read-only.
    Raises: ValueError for any other name.
    Source: CIE 015:2018, Colorimetry.

    A light bulb has far more red than blue, daylight does not:

    >>> red, blue = WAVELENGTHS_NM == 650, WAVELENGTHS_NM == 450
    >>> [float((illuminant(name)[red] / illuminant(name)[blue])[0].round(1)) for name in ("A", "D65")]
    [5.0, 0.7]
    """
    _require(name, ILLUMINANTS, "illuminant")
    names, values = _table("illuminants")
    return values[:, names.index(name)]


def sensitivities(camera: str) -> Array:
    """What each channel of a camera, red, green and blue, makes of each wavelength.

    They are responses to power, not to photons: quantum efficiency times wavelength. A camera's channels are published
    with a peak of 1 each, so their levels against each other are not known.

    Args:
        camera: {"Nikon D5100", "Sigma SD1 Merrill", "CIE observer"}. The last is no camera: one that sees exactly as
            the eye.

    Returns: (81, 3), at WAVELENGTHS_NM; read-only.
    Raises: ValueError for any other name.
    Source: M. M. Darrodi et al., Reference data set for camera spectral sensitivity estimation, J. Opt. Soc. Am. A 32
    (2015).

    Where red, green and blue peak, in nm:

    >>> WAVELENGTHS_NM[sensitivities("Nikon D5100").argmax(axis=0)]
    array([595., 530., 460.])
    """
    _require(camera, CAMERAS, "camera")
    return _table(CAMERAS[camera])[1] if CAMERAS[camera] else observer()


def patch_names() -> tuple[str, ...]:
    """The names of the chart's 24 patches, row by row, six in a row; the last row is grey, from white to black."""
    return _table("chart")[0]


def reflectances() -> Array:
    """The share of light that each patch of the 24-patch chart reflects at each wavelength.

    Returns: (24, 81), row by row of the chart, at WAVELENGTHS_NM; the last six patches are grey, from white to black.
    Source: N. Ohta, The basis of color reproduction engineering (1997), the same numbers as in ISO 17321-1:2012.

    How bright the six grey patches are beside a perfect white:

    >>> tristimulus(illuminant("D65"), reflectances())[18:, 1].round(2)
    array([0.89, 0.58, 0.36, 0.2 , 0.09, 0.03])
    """
    return _table("chart")[1].T


def srgb_primaries() -> Array:
    """Reflectances (3, 81) that look like sRGB's primaries in D65 and add up to white (Mallett & Yuksel 2019).

    `rgb @ srgb_primaries()` is a smooth reflectance, between 0 and 1, for any linear sRGB colour (..., 3) in 0 … 1: one
    of the many that look like it.
    """
    return _table("primaries")[1].T


def gel(strength: float) -> Array:
    """What share of each wavelength (81,) a green filter lets pass beside what it takes away elsewhere; 0 is clear.

    Made up for the lessons after the "plus green" gels of film lamps: at strength 1 twice as much passes at 545 nm as
    at the ends of the spectrum; below 0 it is a magenta filter, "minus green".
    """
    return 2 ** (strength * np.exp(-(((WAVELENGTHS_NM - 545) / 60) ** 2)))


def planckian(kelvin: KelvinLike, wavelengths_nm: ArrayLike = WAVELENGTHS_NM) -> Array:
    """The spectra of glowing black bodies, by Planck's law.

    Args:
        wavelengths_nm: (n,), in nanometres; by default WAVELENGTHS_NM.

    Returns: (..., n), relative power, 100 at 560 nm.
    Raises: ValueError unless every temperature is above 0.
    Source: CIE 015:2018, Colorimetry, with c2 = 0.014388 m K.

    Wien's law puts the peak of 5000 K at 2.898e6 nm K / 5000 K = 580 nm:

    >>> WAVELENGTHS_NM[planckian(5000).argmax()]
    np.float64(580.0)
    """
    hot, nm = np.asarray(kelvin, dtype=float)[..., None], np.asarray(wavelengths_nm, dtype=float)
    if not (hot > 0).all():
        raise ValueError(f"kelvin must be above 0, got {kelvin!r}")
    c2 = 1e9 * _SECOND_RADIATION_CONSTANT / hot
    return 100 * (560 / nm) ** 5 * np.expm1(c2 / 560) / np.expm1(c2 / nm)


def daylight(kelvin: float) -> Array:
    """The spectrum of daylight of a correlated colour temperature.

    The CIE rounds the weights of its two components to three decimals; these are not rounded.

    Args:
        kelvin: 4000 … 25000 K.

    Returns: (81,), relative power at WAVELENGTHS_NM, 100 at 560 nm.
    Raises: ValueError for a temperature outside 4000 … 25000 K.
    Source: CIE 015:2018, Colorimetry, after D. B. Judd, D. L. MacAdam and G. Wyszecki, J. Opt. Soc. Am. 54 (1964).

    D65 is daylight of 6504 K:

    >>> chromaticity(tristimulus(daylight(6504))).round(4)
    array([0.3127, 0.329 ])
    """
    x, y = daylight_xy(kelvin)
    share = 0.0241 + 0.2562 * x - 0.7341 * y
    m1, m2 = (-1.3515 - 1.7703 * x + 5.9114 * y) / share, (0.0300 - 31.4424 * x + 30.0717 * y) / share
    return _table("daylight")[1] @ (1, m1, m2)


def daylight_xy(kelvin: float) -> tuple[float, float]:
    """The CIE chromaticity of daylight of a correlated colour temperature. ValueError outside 4000 … 25000 K."""
    low, high = COLDEST_DAYLIGHT, _HOTTEST_DAYLIGHT
    if not low <= kelvin <= high:
        raise ValueError(f"kelvin must be {low:.0f} … {high:.0f} for daylight, got {kelvin!r}")
    t = 1e3 / kelvin
    if kelvin <= 7000:
        x = 0.244063 + 0.09911 * t + 2.9678 * t**2 - 4.6070 * t**3
    else:
        x = 0.237040 + 0.24748 * t + 1.9018 * t**2 - 2.0064 * t**3
    return x, -3.000 * x**2 + 2.870 * x - 0.275


def resampled(spectrum: ArrayLike, wavelengths_nm: ArrayLike) -> Array:
    """A spectrum (81,) or (81, n) at other wavelengths: straight lines in between, 0 beyond 380 … 780 nm."""
    values = np.asarray(spectrum, dtype=float)
    columns = values.reshape(len(WAVELENGTHS_NM), -1).T
    nm = np.asarray(wavelengths_nm, dtype=float)
    sampled = np.stack([np.interp(nm, WAVELENGTHS_NM, column, left=0, right=0) for column in columns], axis=-1)
    return sampled.reshape(nm.shape + values.shape[1:])


@cache
def _table(name: str) -> tuple[tuple[str, ...], Array]:
    """The names of a table's columns, and its values (81, columns)."""
    names, rows = _rows(name)
    if not np.array_equal(rows[:, 0], WAVELENGTHS_NM):
        raise ValueError(f"{name}.csv must have a row for each of 380 … 780 nm in steps of 5")
    return names, rows[:, 1:]


def _rows(name: str) -> tuple[tuple[str, ...], Array]:
    """The names of a table's columns but the first, and all its numbers, wavelengths first; read-only."""
    lines = (files("camviz.colour") / "tables" / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    names, *rows = (line.split(",") for line in lines if not line.startswith("#"))
    values = np.array(rows, dtype=float)
    values.flags.writeable = False
    return tuple(names[1:]), values


def as_spectra(values: ArrayLike, name: str, count: int = len(WAVELENGTHS_NM)) -> Array:
    """Values (..., count), one for each wavelength, or one for all, as float64. ValueError for another shape."""
    spectra = np.asarray(values, dtype=float)
    return spectra if spectra.ndim == 0 else as_points(spectra, count, name)


def _require(name: str, known: Collection[str], what: str) -> None:
    if name not in known:
        raise ValueError(f"{what} must be one of {', '.join(known)}, got {name!r}")
