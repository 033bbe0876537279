"""Demosaicing with a guess of green that comes from elsewhere: what it is guessed from, and the picture it makes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.arrays import LinearPicture, MosaicLike
from camviz.lenses.base import Array
from camviz.mosaics.demosaicing import bayer_mosaic, by_differences, demosaic
from camviz.mosaics.patterns import GREEN, Pattern

BY_DIFFERENCES = ("edge-aware", "Menon")
"""The algorithms whose red and blue are green plus an interpolated difference; to the others green makes no odds.

>>> BY_DIFFERENCES
('edge-aware', 'Menon')
"""


def green_windows(values: MosaicLike, pattern: Pattern) -> Array:
    """The windows of a Bayer mosaic around its red and blue pixels, mirrored at the border.

    Returns: (n, 5, 5), linear light, row by row of the n red and blue pixels.
    Raises: ValueError for a mosaic of another shape, and for other patterns.

    Half of the pixels miss green:

    >>> green_windows(np.zeros((6, 8)), BAYER["RGGB"]).shape
    (24, 5, 5)
    """
    measured = bayer_mosaic(values, pattern)
    around = cv2.copyMakeBorder(measured, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
    windows = np.lib.stride_tricks.sliding_window_view(around, (5, 5))
    return windows[~pattern.mask(GREEN, *measured.shape)]


def with_green(values: MosaicLike, pattern: Pattern, green: ArrayLike, algorithm: str = "edge-aware") -> LinearPicture:
    """The picture of a Bayer mosaic whose green was guessed elsewhere.

    Args:
        green: (n,), linear light at the pixels that `green_windows` names, in its order.
        algorithm: {"edge-aware", "Menon", "nearest", "bilinear", "Malvar"}. Red and blue are made as it makes them:
            green plus the interpolated differences red − green and blue − green for those of BY_DIFFERENCES, from the
            mosaic alone for the others.

    Raises: ValueError for a mosaic of another shape, another number of `green`, and other patterns.

    Of a grey picture, true green makes all three colours true:

    >>> plate, pattern = zone_plate(32), BAYER["RGGB"]
    >>> green = plate[~pattern.mask(GREEN, 32, 32), GREEN]
    >>> np.allclose(with_green(mosaic(plate, pattern), pattern, green), plate)
    True
    """
    plane = bayer_mosaic(values, pattern).copy()
    missing = ~pattern.mask(GREEN, *plane.shape)
    if np.shape(green) != (missing.sum(),):
        raise ValueError(f"green must be one number for each of {missing.sum()} pixels, got shape {np.shape(green)}")
    plane[missing] = green
    if algorithm in BY_DIFFERENCES:
        return by_differences(values, pattern, plane)
    picture = demosaic(values, pattern, algorithm)
    picture[..., GREEN] = plane
    return picture
