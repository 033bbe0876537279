"""The pinhole: its blur, its exposure and its field of view.

Distances in millimetres from the hole, wavelengths in nanometres, times in seconds. Every function broadcasts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j0

from camviz.lenses.base import Array

GREEN_NM = 550.0  # where daylight and the eye's sensitivity are both strong
AIRY = 2.44  # diameter of the first dark ring, in λ f / d: twice the first zero of J1 over π (Airy 1835)

# The best hole is d = c sqrt(f λ); what c is depends on what "sharp" is taken to mean.
BALANCE = AIRY**0.5  # 1.56: the hole is as wide as its Airy disc
RAYLEIGH = 1.9  # Lord Rayleigh, "On pin-hole photography", Philosophical Magazine 31 (1891)
YOUNG = 2.0  # M. Young, "Pinhole optics", Applied Optics 10 (1971): f = radius² / λ


def geometric_blur_mm(diameter_mm: ArrayLike, focal_mm: ArrayLike, object_mm: ArrayLike = np.inf) -> Array:
    """Diameter of the hole's shadow of a point: d (Z + f) / Z, by similar triangles."""
    return np.asarray(diameter_mm) * (1 + np.asarray(focal_mm) / np.asarray(object_mm))


def diffraction_blur_mm(diameter_mm: ArrayLike, focal_mm: ArrayLike, wavelength_nm: float = GREEN_NM) -> Array:
    """Diameter of the Airy disc: 2.44 λ f / d (Airy 1835; Born & Wolf 1999, section 8.5.2)."""
    return AIRY * wavelength_nm * 1e-6 * np.asarray(focal_mm) / np.asarray(diameter_mm)


def pinhole_blur_mm(
    diameter_mm: ArrayLike, focal_mm: ArrayLike, object_mm: ArrayLike = np.inf, wavelength_nm: float = GREEN_NM
) -> Array:
    """Diameter of the image of a point: shadow and Airy disc added in squares.

    A rule of thumb for the circle that holds the share of light an Airy disc does, 84 %; `pinhole_spread` is exact.
    """
    shadow = geometric_blur_mm(diameter_mm, focal_mm, object_mm)
    return np.hypot(shadow, diffraction_blur_mm(diameter_mm, focal_mm, wavelength_nm))


def best_hole_mm(focal_mm: ArrayLike, wavelength_nm: float = GREEN_NM, constant: float = BALANCE) -> Array:
    """Diameter c sqrt(f λ) of the sharpest hole for distant objects; with c = BALANCE, `pinhole_blur_mm` is least."""
    return constant * np.sqrt(np.asarray(focal_mm) * wavelength_nm * 1e-6)


def fresnel_number(
    diameter_mm: float, focal_mm: float, object_mm: float = np.inf, wavelength_nm: float = GREEN_NM
) -> float:
    """a² (1/f + 1/Z) / λ: how many half wavelengths the way past the hole's rim, of radius a, is the longer one."""
    return (diameter_mm / 2) ** 2 * (1 / focal_mm + 1 / object_mm) / (wavelength_nm * 1e-6)


def pinhole_spread(
    radius_mm: ArrayLike,
    diameter_mm: float,
    focal_mm: float,
    object_mm: float = np.inf,
    wavelength_nm: float = GREEN_NM,
) -> Array:
    """Light per mm² (...) at `radius_mm` (...) from the middle of a point's image; over the whole wall it sums to 1.

    Fresnel diffraction at a round hole (Born & Wolf 1999, section 8.8.1): a shadow for a wide hole, an Airy disc for a
    narrow one, and between them fringes. One wavelength, small angles.
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
    wavelength_nm: float = GREEN_NM,
    many: float = 12.0,
) -> Array:
    """The image of a point on pixels `pitch_mm` apart, (n, n) with n odd, summing to 1.

    Beyond a Fresnel number of `many`, where the fringes are too fine to see, it is the plain shadow.
    """
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


def f_number(diameter_mm: ArrayLike, focal_mm: ArrayLike) -> Array:
    """N = f / d."""
    return np.asarray(focal_mm) / np.asarray(diameter_mm)


def sunny_exposure(diameter_mm: ArrayLike, focal_mm: ArrayLike, exposure_s: ArrayLike) -> Array:
    """Light gathered from a sunlit scene, relative to a correct exposure at ISO 100: ∝ t d² / f².

    By photographers' "sunny 16" rule, f/16 and 1/100 s are correct.
    """
    return 100 * np.asarray(exposure_s) * (16 / f_number(diameter_mm, focal_mm)) ** 2


def field_of_view_deg(width_mm: ArrayLike, distance_mm: ArrayLike) -> Any:
    """2 atan(width / 2v): the angle a wall or sensor of that width sees through a hole or thin lens at distance v."""
    return np.degrees(2 * np.arctan2(np.asarray(width_mm), 2 * np.asarray(distance_mm)))
