"""Optical transfer functions of lens and pixel: the share of a grating's contrast that is left, by cycles per mm.

Stages that follow one another multiply: what the lens leaves, the pixel's area reduces again. Diffraction and defocus
happen in the same opening and do not; `lens_transfer` has both. Every function broadcasts: `per_mm` is a grating's
frequency f in cycles per mm, and `f_number` the working one, N. After J. W. Goodman,
"Introduction to Fourier Optics" (3rd ed. 2005), 6.3-6.4, and H. H. Hopkins, Proc. R. Soc. A 231 (1955).
"""

from __future__ import annotations

import numpy as np
from scipy.special import j1

from camviz.lenses.arrays import (
    AnglesLike,
    FrequenciesLike,
    MillimetresLike,
    NanometresLike,
    RatiosLike,
    SecondsLike,
    Shares,
)
from camviz.lenses.base import Array
from camviz.optics.pinhole import GREEN_NM

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


def cutoff_per_mm(f_number: RatiosLike, wavelength_nm: NanometresLike = GREEN_NM) -> Array:
    """The finest grating whose light passes through a round opening at all: 1 / (λ N).

    Returns: (...), in cycles per mm.
    Source: J. W. Goodman, Introduction to Fourier Optics (3rd ed. 2005), section 6.3.

    >>> cutoff_per_mm(8, wavelength_nm=500).round(6)  # 1 / (0.0005 mm · 8)
    np.float64(250.0)
    """
    return 1 / (1e-6 * np.asarray(wavelength_nm, dtype=float) * np.asarray(f_number))


def diffraction_transfer(
    per_mm: FrequenciesLike, f_number: RatiosLike, wavelength_nm: NanometresLike = GREEN_NM
) -> Shares:
    """The share of a grating's contrast that a perfect lens leaves: 2/π (arccos s - s √(1 - s²)) with s = f λ N.

    It is the share of a round opening that it has in common with its moved copy.

    Source: J. W. Goodman, Introduction to Fourier Optics (3rd ed. 2005), section 6.4.

    At half of the cutoff frequency 2/3 - √3/(2π) = 39 % of the contrast is left:

    >>> diffraction_transfer(cutoff_per_mm(8) / 2, 8).round(3)
    np.float64(0.391)
    """
    s = np.minimum(np.abs(np.asarray(per_mm, dtype=float)) / cutoff_per_mm(f_number, wavelength_nm), 1)
    return np.asarray(2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)))


def disc_transfer(per_mm: FrequenciesLike, diameter_mm: MillimetresLike) -> Array:
    """The share of a grating's contrast that an even disc of light leaves, as rays out of focus make it.

    2 J1(x) / x with x = π f c. Negative where bright and dark lines of a grating change places.

    Returns: (...), 1 … -0.13.
    Source: J. W. Goodman, Introduction to Fourier Optics (3rd ed. 2005), section 6.4.

    A disc of 0.02 mm blots out the grating of f = 1.22 / c first, and turns finer ones around:

    >>> disc_transfer([0, 1.22 / 0.02, 80], 0.02).round(2) + 0
    array([ 1.  ,  0.  , -0.13])
    """
    x = np.pi * np.asarray(per_mm, dtype=float) * np.asarray(diameter_mm)
    small = np.abs(x) < 1e-6
    return np.where(small, 1.0, 2 * j1(x) / np.where(small, 1.0, x))


def pixel_transfer(per_mm: FrequenciesLike, pitch_mm: MillimetresLike) -> Array:
    """The share of a grating's contrast that square pixels leave: sin(π f p) / (π f p), along rows or columns.

    It is the mean over a pixel that is all sensitive.

    Returns: (...), 1 … -0.22.
    Source: J. W. Goodman, Introduction to Fourier Optics (3rd ed. 2005), section 6.4.

    At half a cycle per pixel 2/π = 64 % is left, at one cycle nothing:

    >>> pixel_transfer([100, 200], 0.005).round(3)
    array([0.637, 0.   ])
    """
    return np.sinc(np.asarray(per_mm, dtype=float) * np.asarray(pitch_mm))


def lens_transfer(
    per_mm: FrequenciesLike,
    f_number: RatiosLike,
    wavelength_nm: NanometresLike = GREEN_NM,
    diameter_mm: MillimetresLike = 0.0,
) -> Array:
    """The share of a grating's contrast that a perfect lens leaves out of focus: diffraction and defocus together.

    (4/π) ∫ √(1 - (x + s)²) cos(π f c x) dx from 0 to 1 - s, with s = f λ N, the overlap of the opening with its moved
    copy, where the waves differ by defocus: c / (8 N) at the rim. At c = 0 it is `diffraction_transfer`, and for λ → 0
    `disc_transfer`. Good to 1e-6 up to f c = 30.

    Returns: (...), 1 or less, negative where bright and dark lines change places.
    Source: H. H. Hopkins, The frequency response of a defocused optical system, Proc. R. Soc. A 231 (1955).

    In focus it is diffraction's; a disc of 0.02 mm halves that at 50 cycles per mm:

    >>> lens_transfer(50, 8, diameter_mm=[0, 0.02]).round(2), diffraction_transfer(50, 8).round(2)
    (array([0.72, 0.31]), np.float64(0.72))
    """
    f, s, c = np.broadcast_arrays(
        np.asarray(per_mm, dtype=float),
        np.minimum(np.abs(np.asarray(per_mm, dtype=float)) / cutoff_per_mm(f_number, wavelength_nm), 1),
        np.asarray(diameter_mm, dtype=float),
    )
    start = np.arcsin(s)[..., None]  # x + s = sin φ makes the integrand smooth
    half = (np.pi / 2 - start) / 2
    angle = start + half * (1 + _NODES)
    waves = np.pi * (f * c)[..., None] * (np.sin(angle) - s[..., None])
    return np.asarray(4 / np.pi * np.sum(half * _WEIGHTS * np.cos(angle) ** 2 * np.cos(waves), axis=-1))


def unvignetted_share(
    angle_rad: AnglesLike, aperture_mm: MillimetresLike, rim_mm: MillimetresLike, distance_mm: MillimetresLike
) -> Shares:
    """The share of the aperture that light from beside the axis can reach past a round rim in front of it.

    Seen aslant, the rim's disc moves aside by distance · tan θ. What is left is the overlap of two discs.

    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002).

    A rim as wide as the aperture, moved by half its width, leaves 2/3 - √3/(2π) = 39 %:

    >>> unvignetted_share(np.arctan(0.25), aperture_mm=10, rim_mm=10, distance_mm=20).round(3)
    np.float64(0.391)
    """
    r, R = np.asarray(aperture_mm, dtype=float) / 2, np.asarray(rim_mm, dtype=float) / 2
    d = np.asarray(distance_mm) * np.abs(np.tan(angle_rad))
    d, r, R = np.broadcast_arrays(d, r, R)
    between = np.clip(d, np.abs(R - r) + 1e-12, R + r)
    a = np.clip((between**2 + r**2 - R**2) / (2 * between * r), -1, 1)
    b = np.clip((between**2 + R**2 - r**2) / (2 * between * R), -1, 1)
    lens = r**2 * (np.arccos(a) - a * np.sqrt(1 - a**2)) + R**2 * (np.arccos(b) - b * np.sqrt(1 - b**2))
    whole = np.where(d <= np.abs(R - r), np.pi * np.minimum(r, R) ** 2, lens)
    return np.asarray(whole / (np.pi * r**2))


def exposure_value(f_number: RatiosLike, shutter_s: SecondsLike) -> Array:
    """EV = log2(N² / t): settings of the same EV let the same light fall on the sensor; one more is half of it.

    Returns: (...), in stops.
    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002).

    f/8 and 1/100 s, and one stop less light:

    >>> exposure_value([8, 8], [1 / 100, 1 / 200]).round(1)
    array([12.6, 13.6])
    """
    return np.log2(np.asarray(f_number, dtype=float) ** 2 / np.asarray(shutter_s))
