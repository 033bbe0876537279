"""Demosaicing: a picture (height, width, 3) from a mosaic (height, width), by interpolating what was not measured.

`nearest` and `bilinear` take any pattern; `malvar`, `edge_aware` and `menon` are written for Bayer's, of
at least 4 × 4 pixels. None of them cuts
off values below 0 or above 1. What a pixel measured stays as it is; under RGBW, what the white ones measured.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from camviz.lenses.arrays import LinearPicture, MosaicLike
from camviz.lenses.base import Array
from camviz.mosaics.patterns import BLUE, GREEN, RED, WHITE, Pattern, as_mosaic

# H. S. Malvar, L. He and R. Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color
# images", ICASSP 2004, figure 2: bilinear interpolation, corrected by the Laplacian of the colour that was measured.
_GREEN = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
_BESIDE = np.array([[0, 0, 1, 0, 0], [0, -2, 0, -2, 0], [-2, 8, 10, 8, -2], [0, -2, 0, -2, 0], [0, 0, 1, 0, 0]]) / 16
_ACROSS = np.array([[0, 0, -3, 0, 0], [0, 4, 0, 4, 0], [-3, 0, 12, 0, -3], [0, 4, 0, 4, 0], [0, 0, -3, 0, 0]]) / 16

# Green along a line: the mean of its two neighbours, plus half of what the colour in the middle stands out by.
_GREEN_ALONG = np.array([[-1, 2, 2, 2, -1]]) / 4

# D. Menon, S. Andriani and G. Calvagno, "Demosaicing with directional filtering and a posteriori decision", IEEE
# Transactions on Image Processing 16 (2007), figure 4: where differences two pixels apart are added up.
_NEIGHBOURHOOD = np.array([[1, 0, 1, 0, 0], [0, 1, 0, 0, 0], [3, 0, 3, 0, 0], [0, 1, 0, 0, 0], [1, 0, 1, 0, 0]], float)

_NEIGHBOURS = np.array([[0.5, 0.0, 0.5]])
_THREE = np.full((1, 3), 1 / 3)


def nearest(values: MosaicLike, pattern: Pattern) -> LinearPicture:
    """Every missing colour copied from the nearest pixel that measured it.

    Source: Szeliski (2022), section 10.3.1.

    >>> nearest([[0.1, 0.2], [0.3, 0.4]], BAYER["RGGB"])[..., RED]
    array([[0.1, 0.1],
           [0.1, 0.1]])
    """
    measured = as_mosaic(values)
    return _in_rgb({c: measured[_nearest_pixels(pattern, c, *measured.shape)] for c in pattern.present})


def bilinear(values: MosaicLike, pattern: Pattern) -> LinearPicture:
    """Every missing colour as the mean of the pixels around that measured it, weighted by their nearness.

    Source: Szeliski (2022), section 10.3.1.

    A black-and-white edge gets a coloured fringe:

    >>> edge = np.tile(np.array([0, 0, 0, 0, 1, 1, 1, 1.0])[:, None], (8, 1, 3))
    >>> bilinear(mosaic(edge, BAYER["RGGB"]), BAYER["RGGB"])[4, 3:6]
    array([[0.5 , 0.  , 0.  ],
           [1.  , 0.75, 0.5 ],
           [1.  , 1.  , 1.  ]])
    """
    measured = as_mosaic(values)
    return _in_rgb({channel: _spread(measured, pattern, channel) for channel in pattern.present})


def malvar(values: MosaicLike, pattern: Pattern) -> LinearPicture:
    """Bilinear interpolation corrected by the second derivative of the measured colour.

    Raises: ValueError for a mosaic of another shape, and for other patterns.
    Source: H. S. Malvar, L. He and R. Cutler, High-quality linear interpolation for demosaicing of Bayer-patterned
    color images, ICASSP 2004.

    The fringe that `bilinear` makes at an edge is weaker:

    >>> edge = np.tile(np.array([0, 0, 0, 0, 1, 1, 1, 1.0])[:, None], (8, 1, 3))
    >>> malvar(mosaic(edge, BAYER["RGGB"]), BAYER["RGGB"])[4, 4]
    array([1.    , 0.875 , 0.6875])
    """
    measured = bayer_mosaic(values, pattern)
    green, beside, below, across = (_filtered(measured, one) for one in (_GREEN, _BESIDE, _BESIDE.T, _ACROSS))
    planes = np.stack([measured] * 3)
    for colour in (RED, BLUE):
        at = _sites(pattern, colour)
        planes[GREEN][at.own] = green[at.own]
        planes[colour][at.beside] = beside[at.beside]
        planes[colour][at.below] = below[at.below]
        planes[colour][at.across] = across[at.across]
    return np.moveaxis(planes, 0, -1)


def edge_aware(values: MosaicLike, pattern: Pattern) -> LinearPicture:
    """Green along the edge, not across it; then bilinear interpolation of red − green and blue − green.

    Raises: ValueError for a mosaic of another shape, and for other patterns.
    Source: J. F. Hamilton and J. E. Adams, US patent 5,629,734 (1997), for the choice of green.

    An upright edge comes back without a fringe:

    >>> edge = np.tile(np.array([0, 0, 0, 0, 1, 1, 1, 1.0])[:, None], (8, 1, 3))
    >>> np.allclose(edge_aware(mosaic(edge, BAYER["RGGB"]), BAYER["RGGB"]), edge)
    True
    """
    measured = bayer_mosaic(values, pattern)
    by_rows, by_columns = _green_both_ways(measured, pattern)
    slope = np.array([[-1.0, 0, 1]]), np.array([[-1.0, 0, 2, 0, -1]])
    across_rows = sum(np.abs(_filtered(measured, one)) for one in slope)
    across_columns = sum(np.abs(_filtered(measured, one.T)) for one in slope)
    weight = 0.5 + 0.5 * np.sign(across_columns - across_rows)  # 1 along rows, 0 along columns, ½ where it is a draw
    return by_differences(measured, pattern, weight * by_rows + (1 - weight) * by_columns)


def by_differences(values: ArrayLike, pattern: Pattern, green: Array) -> Array:
    """The picture (height, width, 3) of green in all pixels and interpolated differences red − green, blue − green."""
    difference = bayer_mosaic(values, pattern) - green
    return np.stack([green + _spread(difference, pattern, c) if c != GREEN else green for c in range(3)], axis=-1)


def menon(values: MosaicLike, pattern: Pattern) -> LinearPicture:
    """Green both ways, and afterwards the way that left the smoother colours; then refined.

    Raises: ValueError for a mosaic of another shape, and for other patterns.
    Source: D. Menon, S. Andriani and G. Calvagno, Demosaicing with directional filtering and a posteriori decision,
    IEEE Trans. Image Process. 16 (2007).

    An upright edge comes back without a fringe:

    >>> edge = np.tile(np.array([0, 0, 0, 0, 1, 1, 1, 1.0])[:, None], (8, 1, 3))
    >>> np.allclose(menon(mosaic(edge, BAYER["RGGB"]), BAYER["RGGB"]), edge)
    True
    """
    measured = bayer_mosaic(values, pattern)
    by_rows, by_columns = _green_both_ways(measured, pattern)
    along_rows = _changes(measured - by_rows) <= _changes((measured - by_columns).T).T
    planes = np.stack([measured, np.where(along_rows, by_rows, by_columns), measured])
    _colours_at_green(planes, pattern)
    _colours_across(planes, pattern, along_rows, _NEIGHBOURS)
    _refined_green(planes, pattern, along_rows)
    _colours_at_green(planes, pattern)
    _colours_across(planes, pattern, along_rows, _THREE)
    return np.moveaxis(planes, 0, -1)


def opencv(values: NDArray[np.uint8] | NDArray[np.uint16], pattern: Pattern, method: str = "bilinear") -> NDArray:
    """OpenCV's demosaicing of a Bayer mosaic.

    OpenCV's older names are shifted by one pixel: its `COLOR_BayerBG2RGB` is for RGGB. The names used here spell the
    tile.

    Args:
        values: (height, width), a mosaic of linear light as uint8 or uint16.
        method: {"bilinear", "EA", "VNG"}. "EA" is edge-aware in green only; "VNG" takes uint8 only.

    Returns: (height, width, 3), linear light, of the same integer type.
    Raises: ValueError for another method or pattern, and for values of another kind.

    Where only the red pixels measured light, the picture is red:

    >>> values = np.zeros((6, 6), np.uint8)
    >>> values[::2, ::2] = 255
    >>> np.unique(opencv(values, BAYER["RGGB"]).reshape(-1, 3), axis=0)
    array([[255,   0,   0]], dtype=uint8)
    """
    suffixes = {"bilinear": "", "EA": "_EA", "VNG": "_VNG"}
    kinds = ("uint8",) if method == "VNG" else ("uint8", "uint16")
    _require_bayer(pattern)
    if method not in suffixes:
        raise ValueError(f"method must be one of {', '.join(suffixes)}, got {method!r}")
    measured: NDArray = np.asarray(values)
    if measured.ndim != 2 or measured.dtype.name not in kinds:
        raise ValueError(f"values must be {' or '.join(kinds)} (height, width), got {measured.dtype} {measured.shape}")
    return cv2.cvtColor(measured, getattr(cv2, f"COLOR_Bayer{pattern.letters.replace(' ', '')}2RGB{suffixes[method]}"))


ALGORITHMS: dict[str, Callable[[ArrayLike, Pattern], Array]] = {
    "nearest": nearest,
    "bilinear": bilinear,
    "Malvar": malvar,
    "edge-aware": edge_aware,
    "Menon": menon,
}
"""The algorithms of `demosaic` by name, from the simplest to the best.

>>> list(ALGORITHMS)
['nearest', 'bilinear', 'Malvar', 'edge-aware', 'Menon']
"""
ANY_PATTERN = ("nearest", "bilinear")
"""The names of the algorithms that take any pattern; the others take Bayer's.

>>> ANY_PATTERN
('nearest', 'bilinear')
"""


def demosaic(values: MosaicLike, pattern: Pattern, algorithm: str = "Menon") -> Array:
    """A picture from a mosaic, by interpolating what was not measured.

    Args:
        algorithm: {"nearest", "bilinear", "Malvar", "edge-aware", "Menon"}, one of ALGORITHMS.

    Returns: (height, width, 3), linear light; values below 0 and above 1 are not cut off.
    Raises: ValueError for another algorithm, a mosaic of another shape, and a pattern that the algorithm cannot do.

    How near to the truth they come on the finest detail, in dB:

    >>> plate, pattern = zone_plate(128), BAYER["RGGB"]
    >>> {name: round(psnr(demosaic(mosaic(plate, pattern), pattern, name), plate)) for name in ("bilinear", "Menon")}
    {'bilinear': 12, 'Menon': 21}
    """
    if algorithm not in ALGORITHMS:
        raise ValueError(f"algorithm must be one of {', '.join(ALGORITHMS)}, got {algorithm!r}")
    return ALGORITHMS[algorithm](values, pattern)


# Any pattern ---------------------------------------------------------------------------------------------------------


def _in_rgb(planes: dict[int, Array]) -> Array:
    """The picture of full planes by channel. White pixels, where there are any, say how bright it is: (R + G + B)/3."""
    if RED not in planes:
        return np.repeat(planes[WHITE][..., None], 3, axis=-1)
    rgb = np.stack([planes[RED], planes[GREEN], planes[BLUE]], axis=-1)
    return rgb + (planes[WHITE] - rgb @ np.full(3, 1 / 3))[..., None] if WHITE in planes else rgb


def _spread(measured: Array, pattern: Pattern, channel: int) -> Array:
    """One channel in all pixels: Σ w m / Σ w over the pixels around that measured it, w falling off like a tent.

    A pixel at the border that has none of them around takes the nearest one's.
    """
    mask, weights = pattern.mask(channel, *measured.shape), _weights(pattern, channel, *measured.shape)
    around = _filtered(np.where(mask, measured, 0), _tent(pattern, channel), cv2.BORDER_CONSTANT)
    spread = np.where(mask, measured, around / np.where(weights > 0, weights, 1))
    lost = weights == 0
    if lost.any():
        spread[lost] = measured[tuple(index[lost] for index in _nearest_pixels(pattern, channel, *measured.shape))]
    return spread


@lru_cache(maxsize=4)
def _weights(pattern: Pattern, channel: int, height: int, width: int) -> Array:
    mask = pattern.mask(channel, height, width).astype(float)
    return _filtered(mask, _tent(pattern, channel), cv2.BORDER_CONSTANT)


@lru_cache(maxsize=16)
def _tent(pattern: Pattern, channel: int) -> Array:
    """Weights (n, n) for the smallest window that holds the channel wherever it stands: 3 × 3 for Bayer and X-Trans."""
    seen, reach = np.array(pattern.tile) == channel, 1
    while not _in_every_window(seen, reach):
        reach += 1
    ramp = reach + 1.0 - np.abs(np.arange(-reach, reach + 1))
    return np.outer(ramp, ramp)


def _in_every_window(seen: NDArray[np.bool_], reach: int) -> bool:
    """Whether each window of 2·reach + 1 pixels square on the repeated tile holds a pixel that is `seen`."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(seen, (0, 2 * reach), mode="wrap"), (2 * reach + 1,) * 2)
    return bool(windows.any(axis=(-2, -1)).all())


@lru_cache(maxsize=4)
def _nearest_pixels(pattern: Pattern, channel: int, height: int, width: int) -> tuple[NDArray, NDArray]:
    """Row and column (height, width) of the nearest pixel that measures the channel."""
    rows, columns = distance_transform_edt(
        ~pattern.mask(channel, height, width), return_distances=False, return_indices=True
    )
    return rows, columns


# Bayer's -------------------------------------------------------------------------------------------------------------


class _Sites(NamedTuple):
    """The four kinds of pixels as red, or blue, sees them: its own, green in its rows, green in its columns, others."""

    own: tuple[slice, slice]
    beside: tuple[slice, slice]
    below: tuple[slice, slice]
    across: tuple[slice, slice]


def _sites(pattern: Pattern, colour: int) -> _Sites:
    (v,), (u,) = np.nonzero(np.array(pattern.tile) == colour)
    rows, other_rows = slice(v, None, 2), slice(1 - v, None, 2)
    columns, other_columns = slice(u, None, 2), slice(1 - u, None, 2)
    return _Sites((rows, columns), (rows, other_columns), (other_rows, columns), (other_rows, other_columns))


def bayer_mosaic(values: ArrayLike, pattern: Pattern) -> Array:
    """A mosaic (height, width) of at least 4 × 4 numbers under a Bayer pattern; ValueError for others."""
    measured = as_mosaic(values)
    _require_bayer(pattern)
    if min(measured.shape) < 4:
        raise ValueError(f"a Bayer mosaic must have at least 4 × 4 pixels, got {measured.shape}")
    return measured


def _require_bayer(pattern: Pattern) -> None:
    if not pattern.is_bayer:
        others = " and ".join(ANY_PATTERN)
        raise ValueError(f"this algorithm takes Bayer patterns only, got {pattern.name}; {others} take any")


def _filtered(values: Array, kernel: Array, border: int = cv2.BORDER_REFLECT_101) -> Array:
    """Σ kernel · neighbours; mirrored at the outermost pixels, which leaves a Bayer pattern's phase as it is."""
    return cv2.filter2D(values, -1, kernel, borderType=border)


def _green_both_ways(measured: Array, pattern: Pattern) -> tuple[Array, Array]:
    """Green in all pixels, as seen along the rows and along the columns."""
    is_green = pattern.mask(GREEN, *measured.shape)
    rows, columns = (_filtered(measured, kernel) for kernel in (_GREEN_ALONG, _GREEN_ALONG.T))
    return np.where(is_green, measured, rows), np.where(is_green, measured, columns)


def _changes(difference: Array) -> Array:
    """How much colour − green changes along the rows, around each pixel."""
    two_on = np.pad(difference, ((0, 0), (0, 2)), mode="reflect")[:, 2:]
    return _filtered(np.abs(difference - two_on), _NEIGHBOURHOOD, cv2.BORDER_CONSTANT)


def _colours_at_green(planes: Array, pattern: Pattern) -> None:
    """Fills in red and blue where green was measured: green plus the mean difference of the two neighbours."""
    for colour in (RED, BLUE):
        at = _sites(pattern, colour)
        difference = planes[colour] - planes[GREEN]
        planes[colour][at.beside] = (planes[GREEN] + _filtered(difference, _NEIGHBOURS))[at.beside]
        planes[colour][at.below] = (planes[GREEN] + _filtered(difference, _NEIGHBOURS.T))[at.below]


def _colours_across(planes: Array, pattern: Pattern, along_rows: NDArray[np.bool_], kernel: Array) -> None:
    """Fills in red where blue was measured and blue where red was: the difference is averaged the chosen way."""
    difference = planes[RED] - planes[BLUE]
    mean = np.where(along_rows, _filtered(difference, kernel), _filtered(difference, kernel.T))
    at = _sites(pattern, BLUE)
    planes[RED][at.own] = (planes[BLUE] + mean)[at.own]
    planes[BLUE][at.across] = (planes[RED] - mean)[at.across]


def _refined_green(planes: Array, pattern: Pattern, along_rows: NDArray[np.bool_]) -> None:
    """Green where red or blue was measured: that colour less its mean difference from green, the chosen way."""
    green = planes[GREEN].copy()
    for colour in (RED, BLUE):
        difference = planes[colour] - green
        mean = np.where(along_rows, _filtered(difference, _THREE), _filtered(difference, _THREE.T))
        own = _sites(pattern, colour).own
        planes[GREEN][own] = (planes[colour] - mean)[own]
