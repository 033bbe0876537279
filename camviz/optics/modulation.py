"""Optical transfer functions of lens and pixel: the share of a grating's contrast that is left, by cycles per mm.

Stages that follow one another multiply: what the lens leaves, the pixel's area reduces again. Diffraction and defocus
happen in the same opening and do not; `lens_transfer` has both. Every function broadcasts. After J. W. Goodman,
"Introduction to Fourier Optics" (3rd ed. 2005), 6.3-6.4, and H. H. Hopkins, Proc. R. Soc. A 231 (1955).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j1

from camviz.lenses.base import Array
from camviz.optics.pinhole import GREEN_NM

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


def cutoff_per_mm(f_number: ArrayLike, wavelength_nm: ArrayLike = GREEN_NM) -> Array:
    """1 / (λ N) cycles per mm: finer gratings do not pass through the opening at all. N is the working f-number."""
    return 1 / (1e-6 * np.asarray(wavelength_nm, dtype=float) * np.asarray(f_number))


def diffraction_transfer(per_mm: ArrayLike, f_number: ArrayLike, wavelength_nm: ArrayLike = GREEN_NM) -> Array:
    """2/π (arccos s - s √(1 - s²)) with s = f λ N: the share of a round opening that it has in common with its copy."""
    s = np.minimum(np.abs(np.asarray(per_mm, dtype=float)) / cutoff_per_mm(f_number, wavelength_nm), 1)
    return np.asarray(2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)))


def disc_transfer(per_mm: ArrayLike, diameter_mm: ArrayLike) -> Array:
    """2 J1(x) / x with x = π f c: an even disc of light of diameter c, as rays out of focus make it.

    Negative where bright and dark lines of a grating change places.
    """
    x = np.pi * np.asarray(per_mm, dtype=float) * np.asarray(diameter_mm)
    small = np.abs(x) < 1e-6
    return np.where(small, 1.0, 2 * j1(x) / np.where(small, 1.0, x))


def pixel_transfer(per_mm: ArrayLike, pitch_mm: ArrayLike) -> Array:
    """sin(π f p) / (π f p), along rows or columns: the mean over a square pixel of width p that is all sensitive."""
    return np.sinc(np.asarray(per_mm, dtype=float) * np.asarray(pitch_mm))


def lens_transfer(
    per_mm: ArrayLike, f_number: ArrayLike, wavelength_nm: ArrayLike = GREEN_NM, diameter_mm: ArrayLike = 0.0
) -> Array:
    """A perfect lens of round opening whose rays make a disc of diameter c at the sensor: diffraction and defocus.

    (4/π) ∫ √(1 - (x + s)²) cos(π f c x) dx from 0 to 1 - s, with s = f λ N, the overlap of the opening with its moved
    copy, where the waves differ by defocus: c / (8 N) at the rim. At c = 0 it is `diffraction_transfer`, and for λ → 0
    `disc_transfer`. Good to 1e-6 up to f c = 30.
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


def unvignetted_share(angle_rad: ArrayLike, aperture_mm: ArrayLike, rim_mm: ArrayLike, distance_mm: ArrayLike) -> Array:
    """The share of the aperture, a disc of that diameter, that light from `angle_rad` beside the axis can reach.

    A round rim of diameter `rim_mm`, `distance_mm` in front of it, cuts off the rest: seen aslant, its disc moves
    aside by distance · tan θ. What is left is the overlap of two discs.
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


def exposure_value(f_number: ArrayLike, shutter_s: ArrayLike) -> Array:
    """EV = log2(N² / t): settings of the same EV let the same light fall on the sensor; one more is half of it."""
    return np.log2(np.asarray(f_number, dtype=float) ** 2 / np.asarray(shutter_s))
