"""How far a demosaiced picture is from the truth: in decibels, in false colour, in zippers along edges.

Pictures (height, width, 3) are as shown on a screen: sRGB, 0 … 1, or bytes. What lies beyond is cut off first, as a
screen does.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import ScreenPictureLike, Share
from camviz.scenes.light import to_linear

Values = NDArray[np.float32]

JUST_NOTICEABLE = 2.3  # ΔE*ab: M. Mahy, L. van Eycken and A. Oosterlinck, Color Research & Application 19 (1994)

_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))


class Measures(NamedTuple):
    """What `compare` finds.

    Attributes:
        psnr_db: As of `psnr`.
        colour_error: (height, width), as of `colour_error`.
        zipper: As of `zipper`.

    >>> Measures(psnr_db=30.0, colour_error=np.array([[0.0, 4.0]]), zipper=0.1).false_colour
    2.0
    """

    psnr_db: float
    colour_error: Values
    zipper: float

    @property
    def false_colour(self) -> float:
        """Mean error of colour: see `false_colour`."""
        return float(self.colour_error.mean())


def compare(picture: ScreenPictureLike, truth: ScreenPictureLike) -> Measures:
    """All measures of a demosaiced picture against the truth.

    Raises: ValueError for pictures of different sizes.

    Stripes where the truth is flat are right in colour, and zippers everywhere:

    >>> flat = np.full((4, 4, 3), 0.5)
    >>> found = compare(flat + np.array([0.1, -0.1, 0.1, -0.1])[:, None], flat)
    >>> round(found.psnr_db, 1), found.false_colour, found.zipper
    (20.0, 0.0, 1.0)
    """
    given, true = _pair(picture, truth)
    seen = lab(given), lab(true)
    return Measures(_decibels(given, true), _colour_error(*seen), _zipper(*seen))


def psnr(picture: ScreenPictureLike, truth: ScreenPictureLike) -> float:
    """Peak signal-to-noise ratio, 10 log10(1 / mean squared error).

    Returns: In dB; infinite for equal pictures.
    Raises: ValueError for pictures of different sizes.

    An error of 0.1 everywhere is 20 dB:

    >>> round(psnr(np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 0.4)), 2)
    20.0
    """
    return _decibels(*_pair(picture, truth))


def false_colour(picture: ScreenPictureLike, truth: ScreenPictureLike) -> float:
    """Mean distance of the colours in CIELAB's a*b* plane, brightness left aside.

    Returns: 0 where no colour is false.
    Raises: ValueError for pictures of different sizes.

    A grey that is too bright has no false colour:

    >>> false_colour(np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 0.6))
    0.0
    """
    return float(colour_error(picture, truth).mean())


def colour_error(picture: ScreenPictureLike, truth: ScreenPictureLike) -> Values:
    """The distance of each pixel's colours in CIELAB's a*b* plane: sqrt(Δa*² + Δb*²).

    Returns: (height, width), 0 where the colour is true, float32.
    Raises: ValueError for pictures of different sizes.
    Source: CIE 15:2004, Colorimetry, section 8.2.1.

    A grey with a tenth too much blue:

    >>> colour_error([[(0.5, 0.5, 0.6)]], [[(0.5, 0.5, 0.5)]]).round(1)
    array([[14.7]], dtype=float32)
    """
    return _colour_error(*(lab(one) for one in _pair(picture, truth)))


def zipper(picture: ScreenPictureLike, truth: ScreenPictureLike) -> Share:
    """The share of pixels whose contrast to their likest neighbour changed by more than can be noticed.

    For each pixel, that of its eight neighbours is sought which is nearest to it in the *true* picture.
    It counts where the ΔE*ab of the two differs by more than 2.3 between picture and truth.

    Raises: ValueError for pictures of different sizes.
    Source: W. Lu and Y.-P. Tan, Color filter array demosaicking: new method and performance measures, IEEE Trans. Image
    Process. 12 (2003).

    >>> flat = np.full((4, 4, 3), 0.5)
    >>> zipper(flat + np.array([0.1, -0.1, 0.1, -0.1])[:, None], flat)
    1.0
    """
    return _zipper(*(lab(one) for one in _pair(picture, truth)))


def lab(picture: ArrayLike) -> Values:
    """CIELAB (3, height, width), for the white D65, of a picture in sRGB."""
    light = cv2.cvtColor(to_linear(_shown(picture)).astype(np.float32), cv2.COLOR_LRGB2LAB)
    return np.ascontiguousarray(np.moveaxis(light, -1, 0))


def _pair(picture: ArrayLike, truth: ArrayLike) -> tuple[NDArray, NDArray]:
    given, true = _shown(picture), _shown(truth)
    if given.shape != true.shape:
        raise ValueError(f"picture and truth must be of one size, got {given.shape} and {true.shape}")
    return given, true


def _shown(picture: ArrayLike) -> NDArray:
    """The picture as bytes, or as numbers of which none lies beyond 0 … 1."""
    given = np.asarray(picture)
    if given.ndim != 3 or given.shape[2] != 3:
        raise ValueError(f"a picture must have the shape (height, width, 3), got {given.shape}")
    return given if given.dtype == np.uint8 else np.clip(given, 0.0, 1.0)


def _decibels(given: NDArray, true: NDArray) -> float:
    scaled = (one / np.float32(255) if one.dtype == np.uint8 else one for one in (given, true))
    squared = float(np.mean(np.subtract(*scaled) ** 2, dtype=np.float64))
    return -10 * float(np.log10(squared)) if squared > 0 else np.inf


def _colour_error(given: Values, true: Values) -> Values:
    return np.hypot(*(given[1:] - true[1:]))


def _zipper(given: Values, true: Values) -> float:
    least = np.full(true.shape[1:], np.inf, dtype=np.float32)
    change = np.zeros_like(least)
    for down, right in _NEIGHBOURS:
        here, there = _overlap(down, right)
        contrast = _distance(true[:, *here], true[:, *there])
        changed = np.abs(_distance(given[:, *here], given[:, *there]) - contrast)
        for pixels in (here, there):
            nearer = contrast < least[pixels]
            change[pixels] += nearer * (changed - change[pixels])  # five times as fast as a choice by np.where
            least[pixels] = np.minimum(least[pixels], contrast)
    return float(np.mean(change > JUST_NOTICEABLE))


def _overlap(down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The pixels that have a neighbour `down` rows and `right` columns on, and those neighbours."""
    rows = (slice(None, -down or None), slice(down, None))
    columns = (slice(max(-right, 0), -right if right > 0 else None), slice(max(right, 0), right if right < 0 else None))
    return (rows[0], columns[0]), (rows[1], columns[1])


def _distance(one: Values, other: Values) -> Values:
    dl, da, db = one - other
    return np.sqrt(dl * dl + da * da + db * db)
