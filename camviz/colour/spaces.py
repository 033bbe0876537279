"""Colour spaces: from spectra to XYZ, and from XYZ to chromaticity, linear sRGB and CIELAB, with the difference ΔE2000.

XYZ is relative: Y = 1 is a perfect white in the light at hand. A matrix acts on columns, as in the literature:
xyz = M rgb for one colour, `rgb @ M.T` for an array (..., 3) of them. sRGB's curve is in `camviz.scenes.light`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from camviz.colour.spectra import as_spectra, observer
from camviz.lenses.arrays import LabLike, LinearColoursLike, SpectrumLike, WhiteLike, Xyz, XyzLike
from camviz.lenses.base import Array, as_points

D65_XY = (0.3127, 0.3290)  # the white of sRGB (IEC 61966-2-1:1999)
D50_XY = (0.3457, 0.3585)  # the white of ICC profiles (ISO 22028-1:2016)
_SRGB_PRIMARIES_XY = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))

_KNEE, _SLOPE = 216 / 24389, 24389 / 27  # where L* leaves its cube root for a straight line, (6/29)³ and (29/3)³


# From spectra ---------------------------------------------------------------------------------------------------------


def tristimulus(light: SpectrumLike, reflectance: ArrayLike = 1.0) -> Xyz:
    """XYZ of surfaces in a light: X = k Σ light · reflectance · x̄, and so on, with k = 1 / Σ light · ȳ.

    Args:
        reflectance: (..., 81), shares 0 … 1; by default a perfect white.

    Source: CIE 15:2004, Colorimetry, section 7.1.

    The white of D65 has X = 0.9504 and Z = 1.0888 (CIE):

    >>> tristimulus(illuminant("D65")).round(4)
    array([0.9504, 1.    , 1.0888])
    """
    light, bars = as_spectra(light, "light"), observer()
    return (light * as_spectra(reflectance, "reflectance")) @ bars / (light @ bars[:, 1:2])


# Chromaticity ---------------------------------------------------------------------------------------------------------


def chromaticity(xyz: XyzLike) -> Array:
    """CIE (x, y) of XYZ.

    Returns: (..., 2), x = X / (X + Y + Z), y = Y / (X + Y + Z); NaN for black, which has none.
    Source: CIE 15:2004, Colorimetry, section 7.

    >>> chromaticity(tristimulus(illuminant("D65"))).round(4)
    array([0.3127, 0.329 ])
    """
    xyz = as_points(xyz, 3, "xyz")
    total = xyz.sum(axis=-1, keepdims=True)
    return np.divide(xyz[..., :2], total, out=np.full((*xyz.shape[:-1], 2), np.nan), where=total != 0)


def from_chromaticity(xy: ArrayLike, luminance: ArrayLike = 1.0) -> Array:
    """XYZ (..., 3) of CIE (x, y) (..., 2) and Y (...): the way back from xyY."""
    x, y = np.moveaxis(np.asarray(xy, dtype=float), -1, 0)
    return np.stack([x / y, np.ones_like(y), (1 - x - y) / y], axis=-1) * np.asarray(luminance, dtype=float)[..., None]


# sRGB -----------------------------------------------------------------------------------------------------------------


def xyz_from_primaries(primaries_xy: ArrayLike, white_xy: ArrayLike) -> Array:
    """The matrix (3, 3) from linear RGB to XYZ of a screen with these primaries (3, 2), whose (1, 1, 1) is the white.

    Its columns are the primaries' XYZ, each as bright as it takes for their sum to be the white.
    """
    primaries = from_chromaticity(primaries_xy).T
    return primaries * np.linalg.solve(primaries, from_chromaticity(white_xy))


XYZ_FROM_SRGB = xyz_from_primaries(_SRGB_PRIMARIES_XY, D65_XY)
SRGB_FROM_XYZ = np.linalg.inv(XYZ_FROM_SRGB)
for _matrix in (XYZ_FROM_SRGB, SRGB_FROM_XYZ):
    _matrix.flags.writeable = False


def to_srgb(xyz: XyzLike) -> Array:
    """Linear sRGB of XYZ under D65.

    Returns:
        (..., 3), linear; outside 0 … 1 lies what no sRGB screen can show. `camviz.scenes.to_encoded` has the curve.

    Source: IEC 61966-2-1:1999.

    No screen can show this green, for its blue would be below 0:

    >>> to_srgb((0.3, 0.6, 0.05)).round(2)
    array([ 0.02,  0.84, -0.05])
    """
    return as_points(xyz, 3, "xyz") @ SRGB_FROM_XYZ.T


def from_srgb(rgb: LinearColoursLike) -> Xyz:
    """XYZ under D65 of linear sRGB: the inverse of `to_srgb`.

    Source: IEC 61966-2-1:1999.

    Red's share of white's brightness is 21 %:

    >>> from_srgb((1, 0, 0)).round(4)
    array([0.4124, 0.2126, 0.0193])
    """
    return as_points(rgb, 3, "rgb") @ XYZ_FROM_SRGB.T


# CIELAB and colour difference -----------------------------------------------------------------------------------------


def to_lab(xyz: XyzLike, white: WhiteLike) -> Array:
    """CIELAB of XYZ beside a white.

    Returns: (..., 3), L* (0 black … 100 white), a*, b*.
    Source: CIE 15:2004, Colorimetry, section 8.2.1.

    Middle grey, L* = 50, reflects 18.4 % of the light:

    >>> white = np.array([0.9505, 1, 1.089])
    >>> to_lab(0.1842 * white, white).round(2) + 0  # -0 is 0
    array([50.,  0.,  0.])
    """
    t = as_points(xyz, 3, "xyz") / as_points(white, 3, "white")
    x, y, z = np.moveaxis(np.where(t > _KNEE, np.cbrt(t), (_SLOPE * t + 16) / 116), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def from_lab(lab: LabLike, white: WhiteLike) -> Xyz:
    """XYZ of CIELAB beside a white: the inverse of `to_lab`.

    Source: CIE 15:2004, Colorimetry, section 8.2.1.

    >>> from_lab((50, 0, 0), (1, 1, 1)).round(4)  # ((50 + 16) / 116)³
    array([0.1842, 0.1842, 0.1842])
    """
    lightness, a, b = np.moveaxis(as_points(lab, 3, "lab"), -1, 0)
    y = (lightness + 16) / 116
    f = np.stack([y + a / 500, y, y - b / 200], axis=-1)
    return np.where(f**3 > _KNEE, f**3, (116 * f - 16) / _SLOPE) * np.asarray(white, dtype=float)


def delta_e_2000(lab1: LabLike, lab2: LabLike) -> Array:
    """ΔE2000 between two CIELAB colours: about 1 is the least that an eye sees side by side.

    Returns: (...), 0 for equal colours.
    Source: G. Sharma, W. Wu and E. N. Dalal, The CIEDE2000 color-difference formula: implementation notes,
    supplementary test data, and mathematical observations, Color Res. Appl. 30 (2005).

    The first pair of the paper's table:

    >>> delta_e_2000((50, 2.6772, -79.7751), (50, 0, -82.7485)).round(4)
    np.float64(2.0425)
    """
    l1, a1, b1 = np.moveaxis(as_points(lab1, 3, "lab1"), -1, 0)
    l2, a2, b2 = np.moveaxis(as_points(lab2, 3, "lab2"), -1, 0)
    stretch = 1.5 - 0.5 * _share(np.hypot(a1, b1) / 2 + np.hypot(a2, b2) / 2)  # of a*, for greys
    (c1, h1), (c2, h2) = _polar(stretch * a1, b1), _polar(stretch * a2, b2)
    turn = np.where(c1 * c2 == 0, 0, (h2 - h1 + 180) % 360 - 180)
    turn = np.where((turn == -180) & (h2 > h1), 180, turn)
    lightness, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    hue = np.where(c1 * c2 == 0, h1 + h2, h1 + turn / 2) % 360
    terms = (
        (l2 - l1) / (1 + 0.015 * (lightness - 50) ** 2 / np.sqrt(20 + (lightness - 50) ** 2)),
        (c2 - c1) / (1 + 0.045 * chroma),
        2 * np.sqrt(c1 * c2) * _sin(turn / 2) / (1 + 0.015 * chroma * _hue_weight(hue)),
    )
    blue = -_sin(60 * np.exp(-(((hue - 275) / 25) ** 2))) * 2 * _share(chroma)
    return np.sqrt(np.maximum(terms[0] ** 2 + terms[1] ** 2 + terms[2] ** 2 + blue * terms[1] * terms[2], 0))


def _share(chroma: Array) -> Array:
    """sqrt(C⁷ / (C⁷ + 25⁷)): 0 for greys, 1 for strong colours."""
    return np.sqrt(chroma**7 / (chroma**7 + 25.0**7))


def _polar(a: Array, b: Array) -> tuple[Array, Array]:
    """Chroma, and hue in degrees 0 … 360."""
    return np.hypot(a, b), np.degrees(np.arctan2(b, a)) % 360


def _hue_weight(hue: Array) -> Array:
    """T of the formula, hue in degrees."""
    return (
        1 - 0.17 * _cos(hue - 30) + 0.24 * _cos(2 * hue) + 0.32 * _cos(3 * hue + 6) - 0.20 * _cos(4 * hue - 63)
    )  # fmt: skip


def _sin(degrees: ArrayLike) -> Array:
    return np.sin(np.radians(degrees))


def _cos(degrees: ArrayLike) -> Array:
    return np.cos(np.radians(degrees))


# Chromatic adaptation -------------------------------------------------------------------------------------------------

ADAPTATIONS: Mapping[str, Array] = {
    "Bradford": np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]),
    "von Kries": np.array([[0.40024, 0.70760, -0.08081], [-0.22630, 1.16532, 0.04570], [0.0, 0.0, 0.91822]]),
    "XYZ": np.eye(3),
}
"""Where the three channels are scaled: Bradford's sharpened cones (Lam 1985), the cones of Hunt, Pointer and Estevez
under D65, and XYZ itself, which is the wrong place."""


def adaptation(white_from: WhiteLike, white_to: WhiteLike, method: str = "Bradford") -> Array:
    """The matrix that takes XYZ seen beside one white to XYZ that look alike beside another.

    M⁻¹ diag(M white_to / M white_from) M: each channel of M is scaled by itself, as von Kries proposed.

    Args:
        method: {"Bradford", "von Kries", "XYZ"}, which channels M makes: see ADAPTATIONS.

    Returns: (3, 3). It acts on columns.
    Raises: ValueError for a method that is not one of ADAPTATIONS, and for other shapes.
    Source: K. M. Lam, Metamerism and colour constancy, PhD thesis, University of Bradford (1985).

    From D65 to the D50 of ICC profiles:

    >>> adaptation((0.95047, 1, 1.08883), (0.96422, 1, 0.82521)).round(3)
    array([[ 1.048,  0.023, -0.05 ],
           [ 0.03 ,  0.99 , -0.017],
           [-0.009,  0.015,  0.752]])
    """
    if method not in ADAPTATIONS:
        raise ValueError(f"method must be one of {', '.join(ADAPTATIONS)}, got {method!r}")
    m = ADAPTATIONS[method]
    gains = (m @ as_points(white_to, 3, "white_to")) / (m @ as_points(white_from, 3, "white_from"))
    return np.asarray(np.linalg.solve(m, gains[:, None] * m), dtype=np.float64)
