"""What a thin lens does: where it makes an image, how large, how sharp and how bright.

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
    """
    f, s = np.asarray(focal_mm, dtype=float), np.asarray(focus_mm, dtype=float)
    return f**2 / (np.asarray(f_number) * (s - f)) * np.abs(1 - s / np.asarray(object_mm, dtype=float))


def hyperfocal_mm(focal_mm: ArrayLike, f_number: ArrayLike, circle_mm: ArrayLike) -> Array:
    """H = f² / (N c) + f: focused there, everything from H/2 to infinity is blurred by no more than c."""
    f = np.asarray(focal_mm, dtype=float)
    return f**2 / (np.asarray(f_number) * np.asarray(circle_mm)) + f


def near_limit_mm(focal_mm: ArrayLike, f_number: ArrayLike, focus_mm: ArrayLike, circle_mm: ArrayLike) -> Array:
    """s (H - f) / (H + s - 2f): nearer than this, a point is blurred by more than c."""
    f, s = np.asarray(focal_mm, dtype=float), np.asarray(focus_mm, dtype=float)
    H = hyperfocal_mm(f, f_number, circle_mm)
    return s * (H - f) / (H + s - 2 * f)


def far_limit_mm(focal_mm: ArrayLike, f_number: ArrayLike, focus_mm: ArrayLike, circle_mm: ArrayLike) -> Array:
    """s (H - f) / (H - s): farther than this, a point is blurred by more than c; infinite from s = H on."""
    f, s = np.asarray(focal_mm, dtype=float), np.asarray(focus_mm, dtype=float)
    H = hyperfocal_mm(f, f_number, circle_mm)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(s < H, s * (H - f) / (H - s), np.inf)


def working_f_number(f_number: ArrayLike, magnification: ArrayLike) -> Array:
    """N (1 + m): the ratio of the image's distance to the aperture's width, which is what the sensor sees."""
    return np.asarray(f_number) * (1 + np.asarray(magnification))


def airy_radius_um(f_number: ArrayLike, wavelength_nm: ArrayLike = GREEN_NM) -> Array:
    """1.22 λ N in micrometres: the first dark ring around a point's image (Airy 1835; Born & Wolf 1999, 8.5.2)."""
    return 1.22e-3 * np.asarray(wavelength_nm) * np.asarray(f_number)


def relative_illumination(angle_rad: ArrayLike) -> Array:
    """cos⁴ θ: the light that reaches the sensor θ from the axis, where on the axis it is 1.

    The thin lens seen aslant is smaller (cos θ), farther away (cos² θ), and lights the sensor aslant (cos θ).
    """
    return np.cos(angle_rad) ** 4
