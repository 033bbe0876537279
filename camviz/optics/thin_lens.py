"""The thin lens: the place, size, sharpness and brightness of its image.

All distances in millimetres from the lens, positive: an object at u before it, its image at v behind it. Every function
broadcasts. Equations after E. Hecht, "Optics" (5th ed. 2017), chapter 5, and S. F. Ray, "Applied Photographic Optics"
(3rd ed. 2002).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array
from camviz.optics.pinhole import GREEN_NM


def image_distance_mm(focal_mm: ArrayLike, object_mm: ArrayLike) -> Array:
    """v = 1 / (1/f - 1/u), Gauss's lens equation: where the image of an object at u lies.

    An object inside the focal length has no real image: v is negative, the place from which its light seems to come.
    At u = f it is infinite.
    """
    with np.errstate(divide="ignore"):
        return np.divide(1.0, 1 / np.asarray(focal_mm, dtype=float) - 1 / np.asarray(object_mm, dtype=float))


def object_distance_mm(focal_mm: ArrayLike, image_mm: ArrayLike) -> Array:
    """u = 1 / (1/f - 1/v): what a sensor at v sees sharp. The equation is its own inverse."""
    return image_distance_mm(focal_mm, image_mm)


def magnification(focal_mm: ArrayLike, object_mm: ArrayLike) -> Array:
    """m = v / u = f / (u - f): the image is m times as large as the object, and upside down."""
    f = np.asarray(focal_mm, dtype=float)
    with np.errstate(divide="ignore"):
        return f / (np.asarray(object_mm, dtype=float) - f)


def circle_of_confusion_mm(
    focal_mm: ArrayLike, f_number: ArrayLike, focus_mm: ArrayLike, object_mm: ArrayLike
) -> Array:
    """Diameter f² / (N (s - f)) · |u - s| / u of the disc that a point at u makes while the lens is focused at s.

    By similar triangles: the cone behind the lens is f/N wide there, and a point where the sensor cuts it at v(u).
    A lens focused at infinity, s = inf, makes a disc of f² / (N u). ValueError for a focus inside the focal length.
    """
    f, s = _focused(focal_mm, focus_mm)
    return f**2 / np.asarray(f_number) * np.abs(1 / s - 1 / np.asarray(object_mm, dtype=float)) / (1 - f / s)


def hyperfocal_mm(focal_mm: ArrayLike, f_number: ArrayLike, circle_mm: ArrayLike) -> Array:
    """H = f² / (N c) + f: focused there, everything from H/2 to infinity is blurred by no more than c."""
    f = np.asarray(focal_mm, dtype=float)
    return f**2 / (np.asarray(f_number) * np.asarray(circle_mm)) + f


def near_limit_mm(focal_mm: ArrayLike, f_number: ArrayLike, focus_mm: ArrayLike, circle_mm: ArrayLike) -> Array:
    """s (H - f) / (H + s - 2f): nearer than this, a point is blurred by more than c.

    A lens focused at infinity has its limit at H - f. ValueError for a focus inside the focal length.
    """
    f, s = _focused(focal_mm, focus_mm)
    H = hyperfocal_mm(f, f_number, circle_mm)
    return (H - f) / (1 + (H - 2 * f) / s)


def far_limit_mm(focal_mm: ArrayLike, f_number: ArrayLike, focus_mm: ArrayLike, circle_mm: ArrayLike) -> Array:
    """s (H - f) / (H - s): farther than this, a point is blurred by more than c; infinite from s = H on.

    ValueError for a focus inside the focal length.
    """
    f, s = _focused(focal_mm, focus_mm)
    H = hyperfocal_mm(f, f_number, circle_mm)
    with np.errstate(divide="ignore"):
        return np.where(s >= H, np.inf, (H - f) / (H / s - 1))


def working_f_number(f_number: ArrayLike, magnification: ArrayLike) -> Array:
    """N (1 + m): the ratio of the image's distance to the aperture's width, which is what the sensor sees."""
    return np.asarray(f_number) * (1 + np.asarray(magnification))


def airy_radius_um(working_f_number: ArrayLike, wavelength_nm: ArrayLike = GREEN_NM) -> Array:
    """1.22 λ N_w in micrometres: the first dark ring around a point's image (Airy 1835; Born & Wolf 1999, 8.5.2).

    N_w is the working f-number, N (1 + m), which the function `working_f_number` gives. For a lens focused far away it
    is the f-number N itself. At life size, m = 1, the disc is twice as large.
    """
    return 1.22e-3 * np.asarray(wavelength_nm) * np.asarray(working_f_number)


def relative_illumination(angle_rad: ArrayLike) -> Array:
    """cos⁴ θ: the light that reaches the sensor θ from the axis, where on the axis it is 1.

    The thin lens seen aslant is smaller (cos θ), farther away (cos² θ), and lights the sensor aslant (cos θ).
    """
    return np.cos(angle_rad) ** 4


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
