"""The thin lens: the place, size, sharpness and brightness of its image.

All distances are from the lens and positive: `object_mm` is u, `image_mm` v, `focus_mm` the distance s that the lens is
focused at, which may be infinite; `focal_mm` is f, `f_number` N, and `circle_mm` the widest disc c that passes for
sharp. Every function broadcasts. Equations after E. Hecht, "Optics" (5th ed. 2017), chapter 5, and S. F. Ray, "Applied
Photographic Optics" (3rd ed. 2002).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.arrays import AnglesLike, Millimetres, MillimetresLike, NanometresLike, Ratios, RatiosLike
from camviz.lenses.base import Array
from camviz.optics.pinhole import GREEN_NM


def image_distance_mm(focal_mm: MillimetresLike, object_mm: MillimetresLike) -> Array:
    """Where the image of an object lies: v = 1 / (1/f - 1/u), Gauss's lens equation.

    Returns:
        (...), in mm behind the lens. Inside the focal length it is negative, the place from which the light seems to
        come; at u = f it is infinite.

    Source: E. Hecht, Optics (5th ed. 2017), chapter 5; Szeliski (2022), section 2.2.3.

    >>> image_distance_mm(50, [100, 50, 25])
    array([100.,  inf, -50.])
    """
    with np.errstate(divide="ignore"):
        return np.divide(1.0, 1 / np.asarray(focal_mm, dtype=float) - 1 / np.asarray(object_mm, dtype=float))


def object_distance_mm(focal_mm: MillimetresLike, image_mm: MillimetresLike) -> Millimetres:
    """What a sensor at a distance sees sharp: u = 1 / (1/f - 1/v). The lens equation is its own inverse.

    Source: E. Hecht, Optics (5th ed. 2017), chapter 5.

    A lens of 50 mm moved forward by 5 mm:

    >>> object_distance_mm(50, 55).round(6)
    np.float64(550.0)
    """
    return image_distance_mm(focal_mm, image_mm)


def magnification(focal_mm: MillimetresLike, object_mm: MillimetresLike) -> Array:
    """How many times as large as the object its image is: m = v / u = f / (u - f); it is upside down.

    Returns: (...), a ratio; 1 is life size.
    Source: E. Hecht, Optics (5th ed. 2017), chapter 5.

    >>> magnification(50, [100, 5050])
    array([1.  , 0.01])
    """
    f = np.asarray(focal_mm, dtype=float)
    with np.errstate(divide="ignore"):
        return f / (np.asarray(object_mm, dtype=float) - f)


def circle_of_confusion_mm(
    focal_mm: MillimetresLike, f_number: RatiosLike, focus_mm: MillimetresLike, object_mm: MillimetresLike
) -> Millimetres:
    """The diameter of the disc that a point out of focus makes: f² / (N (s - f)) · abs(u - s) / u.

    By similar triangles: the cone behind the lens is f/N wide there, and a point where the sensor cuts it at v(u).

    Raises: ValueError for a focus inside the focal length.
    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002); Szeliski (2022), section 2.2.3.

    A lens of 50 mm at f/2, focused at 2 m; the middle one is 2500 / (2 · 1950) · 1/2 mm:

    >>> circle_of_confusion_mm(50, 2, focus_mm=2000, object_mm=[2000, 4000, np.inf]).round(3)
    array([0.   , 0.321, 0.641])
    """
    f, s = _focused(focal_mm, focus_mm)
    return f**2 / np.asarray(f_number) * np.abs(1 / s - 1 / np.asarray(object_mm, dtype=float)) / (1 - f / s)


def hyperfocal_mm(focal_mm: MillimetresLike, f_number: RatiosLike, circle_mm: MillimetresLike) -> Millimetres:
    """The nearest focus that keeps infinity sharp: H = f² / (N c) + f.

    Focused there, everything from H/2 to infinity is blurred by no more than c.

    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002).

    >>> hyperfocal_mm(50, 10, circle_mm=0.025).round(6)  # 2500 / 0.25 + 50
    np.float64(10050.0)
    """
    f = np.asarray(focal_mm, dtype=float)
    with np.errstate(divide="ignore"):  # infinite where no blur is allowed
        return f**2 / (np.asarray(f_number) * np.asarray(circle_mm)) + f


def near_limit_mm(
    focal_mm: MillimetresLike, f_number: RatiosLike, focus_mm: MillimetresLike, circle_mm: MillimetresLike
) -> Millimetres:
    """Where sharpness begins: s (H - f) / (H + s - 2f); nearer than this, a point is blurred by more than c.

    Raises: ValueError for a focus inside the focal length.
    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002).

    Focused at H = 10.05 m, from H/2 on; focused at infinity, from H - f on:

    >>> near_limit_mm(50, 10, focus_mm=[10050, np.inf], circle_mm=0.025).round(6)
    array([ 5025., 10000.])
    """
    f, s = _focused(focal_mm, focus_mm)
    H = hyperfocal_mm(f, f_number, circle_mm)
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(H), s, (H - f) / (1 + (H - 2 * f) / s))[()]


def far_limit_mm(
    focal_mm: MillimetresLike, f_number: RatiosLike, focus_mm: MillimetresLike, circle_mm: MillimetresLike
) -> Array:
    """Where sharpness ends: s (H - f) / (H - s); farther than this, a point is blurred by more than c.

    Returns: (...), in mm; infinite from s = H on.
    Raises: ValueError for a focus inside the focal length.
    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002).

    With H = 10.05 m, 5025 · 10000 / 5025 mm, and no end:

    >>> far_limit_mm(50, 10, focus_mm=[5025, 10051], circle_mm=0.025).round(6)
    array([10000.,    inf])
    """
    f, s = _focused(focal_mm, focus_mm)
    H = hyperfocal_mm(f, f_number, circle_mm)
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = np.where(s >= H, np.inf, (H - f) / (H / s - 1))
    return np.where(np.isinf(H), s, limit)[()]


def working_f_number(f_number: RatiosLike, magnification: RatiosLike) -> Ratios:
    """The image's distance over the aperture's width, which is what the sensor sees: N (1 + m).

    Source: S. F. Ray, Applied Photographic Optics (3rd ed. 2002).

    At life size it is twice as large:

    >>> working_f_number(2.8, 1)
    np.float64(5.6)
    """
    return np.asarray(f_number) * (1 + np.asarray(magnification))


def airy_radius_um(working_f_number: ArrayLike, wavelength_nm: NanometresLike = GREEN_NM) -> Array:
    """The first dark ring around a point's image: 1.22 λ N_w.

    Args:
        working_f_number: (...), N_w = N (1 + m), a ratio, which the function `working_f_number` gives; far away it is
            the f-number N itself.

    Returns: (...), its radius in micrometres.
    Source: M. Born and E. Wolf, Principles of Optics (7th ed. 1999), section 8.5.2.

    >>> airy_radius_um(8, wavelength_nm=500).round(2)  # 1.22 · 0.5 · 8
    np.float64(4.88)
    """
    return 1.22e-3 * np.asarray(wavelength_nm) * np.asarray(working_f_number)


def relative_illumination(angle_rad: AnglesLike) -> Array:
    """The light that reaches the sensor beside the axis, where on the axis it is 1: cos⁴ θ.

    The thin lens seen aslant is smaller (cos θ), farther away (cos² θ), and lights the sensor aslant (cos θ).

    Returns: (...), a share, 0 … 1; none from 90° on, where light would come from beside or behind the lens.
    Source: Szeliski (2022), section 2.2.3.

    >>> relative_illumination(np.radians([0, 30, 45])).round(4)
    array([1.    , 0.5625, 0.25  ])
    """
    return np.maximum(np.cos(angle_rad), 0) ** 4


def _focused(focal_mm: ArrayLike, focus_mm: ArrayLike) -> tuple[Array, Array]:
    """Focal length and focus (...) as arrays; ValueError where the lens would be focused inside its focal length."""
    f, s = np.broadcast_arrays(np.asarray(focal_mm, dtype=float), np.asarray(focus_mm, dtype=float))
    inside = s <= f
    if np.any(inside):
        raise ValueError(
            f"focus_mm must be greater than the focal length, {f[inside][0]:g} mm, for a real image; "
            f"got {s[inside][0]:g}"
        )
    return f, s
