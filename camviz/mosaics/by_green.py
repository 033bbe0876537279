"""Demosaicing with a guess of green that comes from elsewhere: what it is guessed from, and the picture it makes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array
from camviz.mosaics.demosaicing import bayer_mosaic, by_differences, demosaic
from camviz.mosaics.patterns import GREEN, Pattern

BY_DIFFERENCES = ("edge-aware", "Menon")
"""The algorithms whose red and blue are green plus an interpolated difference; to the others green makes no odds."""


def green_windows(values: ArrayLike, pattern: Pattern) -> Array:
    """The windows (n, 5, 5) of a Bayer mosaic around its n red and blue pixels, row by row, mirrored at the border.

    ValueError for other patterns.
    """
    measured = bayer_mosaic(values, pattern)
    around = cv2.copyMakeBorder(measured, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
    windows = np.lib.stride_tricks.sliding_window_view(around, (5, 5))
    return windows[~pattern.mask(GREEN, *measured.shape)]


def with_green(values: ArrayLike, pattern: Pattern, green: ArrayLike, algorithm: str = "edge-aware") -> Array:
    """The picture (height, width, 3) of a Bayer mosaic with `green` (n,) at the pixels that `green_windows` names.

    Red and blue are made as `algorithm` makes them: green plus the interpolated differences red − green and
    blue − green for "edge-aware" and "Menon", from the mosaic alone for the others. ValueError for other patterns.
    """
    plane = bayer_mosaic(values, pattern).copy()
    plane[~pattern.mask(GREEN, *plane.shape)] = green
    if algorithm in BY_DIFFERENCES:
        return by_differences(values, pattern, plane)
    picture = demosaic(values, pattern, algorithm)
    picture[..., GREEN] = plane
    return picture
