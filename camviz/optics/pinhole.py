"""The pinhole: its blur, its exposure and its field of view.

Every function broadcasts. `diameter_mm` is that of the hole, d; `focal_mm` is from the hole to the wall, f; `object_mm`
from the hole to the point, Z. Wavelengths λ are in nanometres, times t in seconds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import j0

from camviz.lenses.arrays import Millimetres, MillimetresLike, Nanometres, Ratios, SecondsLike
from camviz.lenses.base import Array

GREEN_NM = 550.0
"""A wavelength in nanometres at which daylight and the eye's sensitivity are both strong.

>>> GREEN_NM
550.0
"""
AIRY = 2.44
"""The diameter of the first dark ring, in λ f / d: twice the first zero of J1 over π (Airy 1835).

>>> from scipy.special import jn_zeros
>>> round(2 * float(jn_zeros(1, 1)[0]) / np.pi, 2) == AIRY == 2.44
True
"""

# The best hole is d = c sqrt(f λ); what c is depends on what "sharp" is taken to mean.
BALANCE = AIRY**0.5
"""The hole is as wide as its Airy disc: d² = 2.44 f λ.

>>> round(BALANCE, 2)
1.56
"""
RAYLEIGH = 1.9
"""Lord Rayleigh, On pin-hole photography, Philosophical Magazine 31 (1891).

>>> best_hole_mm(100, constant=RAYLEIGH).round(2)
np.float64(0.45)
"""
YOUNG = 2.0
"""M. Young, Pinhole optics, Applied Optics 10 (1971): f = radius² / λ, a Fresnel number of 1.

>>> round(fresnel_number(best_hole_mm(100, constant=YOUNG), 100), 6)
np.float64(1.0)
"""


def geometric_blur_mm(
    diameter_mm: MillimetresLike, focal_mm: MillimetresLike, object_mm: MillimetresLike = np.inf
) -> Millimetres:
    """The diameter of the hole's shadow of a point: d (Z + f) / Z, by similar triangles.

    >>> geometric_blur_mm(0.5, focal_mm=100, object_mm=[1000, np.inf])
    array([0.55, 0.5 ])
    """
    return np.asarray(diameter_mm) * (1 + np.asarray(focal_mm) / np.asarray(object_mm))


def diffraction_blur_mm(
    diameter_mm: MillimetresLike, focal_mm: MillimetresLike, wavelength_nm: Nanometres = GREEN_NM
) -> Millimetres:
    """The diameter of the Airy disc: 2.44 λ f / d.

    Source: M. Born and E. Wolf, Principles of Optics (7th ed. 1999), section 8.5.2.

    A hole half as wide blurs twice as much:

    >>> diffraction_blur_mm([0.4, 0.2], focal_mm=100, wavelength_nm=500).round(3)  # 2.44 · 0.0005 · 100 / 0.4
    array([0.305, 0.61 ])
    """
    return AIRY * wavelength_nm * 1e-6 * np.asarray(focal_mm) / np.asarray(diameter_mm)


def pinhole_blur_mm(
    diameter_mm: MillimetresLike,
    focal_mm: MillimetresLike,
    object_mm: MillimetresLike = np.inf,
    wavelength_nm: Nanometres = GREEN_NM,
) -> Millimetres:
    """The diameter of the image of a point: shadow and Airy disc added in squares.

    A rule of thumb for the circle that holds the share of light an Airy disc does, 84 %; `pinhole_spread` is exact.

    Neither the narrow nor the wide hole is the sharpest:

    >>> pinhole_blur_mm([0.1, best_hole_mm(100), 1.0], focal_mm=100).round(2)
    array([1.35, 0.52, 1.01])
    """
    shadow = geometric_blur_mm(diameter_mm, focal_mm, object_mm)
    return np.hypot(shadow, diffraction_blur_mm(diameter_mm, focal_mm, wavelength_nm))


def best_hole_mm(
    focal_mm: MillimetresLike, wavelength_nm: Nanometres = GREEN_NM, constant: float = BALANCE
) -> Millimetres:
    """The diameter of the sharpest hole for distant objects: c sqrt(f λ).

    Args:
        constant: c: with BALANCE, `pinhole_blur_mm` is least; RAYLEIGH and YOUNG are other ideas of what is sharp.

    Source: M. Young, Pinhole optics, Applied Optics 10 (1971).

    >>> best_hole_mm(100).round(2), best_hole_mm(400).round(2)  # four times as far, twice as wide
    (np.float64(0.37), np.float64(0.73))
    """
    return constant * np.sqrt(np.asarray(focal_mm) * wavelength_nm * 1e-6)


def fresnel_number(
    diameter_mm: float, focal_mm: float, object_mm: float = np.inf, wavelength_nm: Nanometres = GREEN_NM
) -> float:
    """How many half wavelengths longer the way past the hole's rim is: a² (1/f + 1/Z) / λ.

    Args:
        diameter_mm: Of the hole, 2a.
        focal_mm: From the hole to the wall, f.
        object_mm: From the hole to the point, Z.

    Returns: Far above 1 the image is the hole's shadow, far below an Airy disc.
    Source: M. Young, Pinhole optics, Applied Optics 10 (1971).

    >>> round(fresnel_number(1.0, focal_mm=100, wavelength_nm=500), 6)  # 0.25 / (100 · 0.0005)
    5.0
    """
    return (diameter_mm / 2) ** 2 * (1 / focal_mm + 1 / object_mm) / (wavelength_nm * 1e-6)


def pinhole_spread(
    radius_mm: MillimetresLike,
    diameter_mm: float,
    focal_mm: float,
    object_mm: float = np.inf,
    wavelength_nm: Nanometres = GREEN_NM,
) -> Array:
    """Light per mm² beside the middle of a point's image, by Fresnel diffraction at a round hole.

    A shadow for a wide hole, an Airy disc for a narrow one, and between them fringes. One wavelength, small angles.

    Args:
        diameter_mm: Of the hole.
        focal_mm: From the hole to the wall.
        object_mm: From the hole to the point.

    Returns: (...), shares of the light per mm²: over the whole wall they sum to 1.
    Source: M. Born and E. Wolf, Principles of Optics (7th ed. 1999), section 8.8.1.

    At a Fresnel number of 1 the middle is four times as bright as the plain shadow, at 2 it is dark:

    >>> holes = best_hole_mm(100) * np.array([2, 8**0.5]) / BALANCE
    >>> [float((pinhole_spread(0, d, 100) * np.pi * (d / 2) ** 2).round(3)) for d in holes]
    [4.0, 0.0]
    """
    radius, scale = np.asarray(radius_mm, dtype=float), wavelength_nm * 1e-6 * focal_mm
    zones = fresnel_number(diameter_mm, focal_mm, object_mm, wavelength_nm)
    turns = np.pi * zones + np.pi * diameter_mm * radius.max(initial=0) / scale
    t, weight = np.polynomial.legendre.leggauss(int(24 + 0.7 * turns))
    t, weight = (t + 1) / 2, weight / 2
    # U(r) = ∫₀¹ exp(iπ N t) J0(π d r √t / λf) dt, with t = (ρ/a)²
    waves = j0(np.multiply.outer(np.pi * diameter_mm * radius / scale, np.sqrt(t))) @ (
        weight * np.exp(1j * np.pi * zones * t)
    )
    return np.pi * (diameter_mm / 2) ** 2 / scale**2 * np.abs(waves) ** 2


def pinhole_kernel(
    pitch_mm: float,
    diameter_mm: float,
    focal_mm: float,
    object_mm: float = np.inf,
    wavelength_nm: Nanometres = GREEN_NM,
    many: float = 12.0,
) -> Array:
    """The image of a point on pixels, to blur a picture with.

    Beyond a Fresnel number of `many`, where the fringes are too fine to see, it is the plain shadow.

    Args:
        pitch_mm: From pixel to pixel.
        diameter_mm: Of the hole.
        focal_mm: From the hole to the wall.
        object_mm: From the hole to the point.
        many: A Fresnel number.

    Returns: (n, n), shares of the light that sum to 1; n is odd.
    Raises: ValueError for a pitch, diameter or focal length that is not above 0.
    Source: M. Born and E. Wolf, Principles of Optics (7th ed. 1999), section 8.8.1.

    A shadow of 8 mm on pixels of 0.5 mm; each holds 0.25 / (16 π) of the light:

    >>> kernel = pinhole_kernel(0.5, diameter_mm=8, focal_mm=100)
    >>> kernel.shape, kernel[8, 8].round(4)
    ((17, 17), np.float64(0.005))
    """
    for name, length in (("pitch_mm", pitch_mm), ("diameter_mm", diameter_mm), ("focal_mm", focal_mm)):
        if not length > 0:
            raise ValueError(f"{name} must be a length above 0 mm, got {length}")
    shadow = float(geometric_blur_mm(diameter_mm, focal_mm, object_mm))
    airy = float(diffraction_blur_mm(diameter_mm, focal_mm, wavelength_nm))
    plain = fresnel_number(diameter_mm, focal_mm, object_mm, wavelength_nm) > many
    reach = 0.5 * shadow if plain else 0.5 * shadow + 1.6 * airy
    half = int(np.ceil(reach / pitch_mm))
    fine = 5 if half < 24 else 2
    steps = (np.arange((2 * half + 1) * fine) + 0.5) / fine - half - 0.5
    radius = pitch_mm * np.hypot(steps[:, None], steps)
    if plain:
        light = (radius <= shadow / 2).astype(float)
    else:
        table = np.linspace(0, reach, 40 + int(24 * reach / airy))
        args = (diameter_mm, focal_mm, object_mm, wavelength_nm)
        light = np.interp(radius, table, pinhole_spread(table, *args), right=0)
    pixels = light.reshape(2 * half + 1, fine, 2 * half + 1, fine).sum(axis=(1, 3))
    total = pixels.sum()
    return pixels / total if total > 0 else np.ones((1, 1))


def f_number(diameter_mm: MillimetresLike, focal_mm: MillimetresLike) -> Ratios:
    """The f-number N = f / d.

    >>> f_number(0.5, 100)
    np.float64(200.0)
    """
    return np.asarray(focal_mm) / np.asarray(diameter_mm)


def sunny_exposure(diameter_mm: MillimetresLike, focal_mm: MillimetresLike, exposure_s: SecondsLike) -> Array:
    """Light gathered from a sunlit scene, relative to a correct exposure at ISO 100: in proportion to t d² / f².

    By photographers' "sunny 16" rule, f/16 and 1/100 s are correct.

    Returns: (...), a ratio, 1 where the exposure is correct.

    A pinhole of f/200 takes (200/16)² as long:

    >>> sunny_exposure(0.5, 100, exposure_s=(200 / 16) ** 2 / 100)
    np.float64(1.0)
    """
    return 100 * np.asarray(exposure_s) * (16 / f_number(diameter_mm, focal_mm)) ** 2


def field_of_view_deg(width_mm: MillimetresLike, distance_mm: MillimetresLike) -> Any:
    """The angle that a wall or a sensor sees through a hole or thin lens: 2 atan(width / 2v).

    Returns: array (...), in degrees.
    Source: Szeliski (2022), section 2.1.4.

    A lens of 50 mm on a sensor 36 mm wide:

    >>> field_of_view_deg(36, 50).round(1)
    np.float64(39.6)
    """
    return np.degrees(2 * np.arctan2(np.asarray(width_mm), 2 * np.asarray(distance_mm)))
