"""What repeated frames of the same light say: noise that changes from frame to frame, and the pattern that stays.

A frame is an array (height, width) of digital numbers (DN). Equations: EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Pair:
    """Two frames of the same light: their mean (DN), and what varies in time and what in space, variances (DN²)."""

    mean: float
    variance: float  # temporal, of one frame
    pattern: float  # spatial, of what both frames share; below zero where chance outweighs it
    pixels: int
    drift: float = 0.0  # by how much the second frame is brighter, DN: the light flickered
    clipped: float = 0.0  # the share of pixels at zero

    @property
    def relative_error(self) -> float:
        """One standard deviation of `variance`, of Gaussian noise, relative to it: sqrt(2 / pixels)."""
        return sqrt(2 / self.pixels)

    @property
    def pattern_error(self) -> float:
        """One standard deviation of `pattern`, DN²: that of a covariance of two Gaussian frames."""
        total = self.variance + max(self.pattern, 0)
        return sqrt((total**2 + self.pattern**2) / self.pixels)


def pair(first: ArrayLike, second: ArrayLike) -> Pair:
    """The statistics of two frames (height, width) of the same light.

    The pattern drops out of their difference, whose variance is that of *two* frames: hence the ½ in
    σ² = ½ (mean (a − b)² − (mean a − mean b)²). What both share is their covariance over the pixels.
    ValueError where their shapes differ or they hold fewer than two pixels.
    """
    a, b = np.asarray(first), np.asarray(second)
    if a.shape != b.shape or a.size < 2:
        raise ValueError(f"a pair is two frames of one shape, got {a.shape} and {b.shape}")
    clipped = float(np.count_nonzero(a == 0) + np.count_nonzero(b == 0)) / (2 * a.size)
    difference, total = np.subtract(b, a, dtype=float), np.add(b, a, dtype=float)
    variance = float(difference.var()) / 2
    # var (a + b) - var (a - b) = 4 cov (a, b)
    shared = float(total.var()) / 4 - variance / 2
    return Pair(float(total.mean()) / 2, variance, shared, a.size, float(difference.mean()), clipped)


def frame_variance(frame: ArrayLike) -> float:
    """The variance (DN²) over the pixels of one frame: noise *and* pattern, which one frame cannot tell apart."""
    return float(np.var(np.asarray(frame, dtype=float), ddof=1))


@dataclass(frozen=True)
class Stack:
    """Many frames of the same light: their mean picture (height, width), how many, and the temporal variance (DN²)."""

    picture: NDArray[np.float64]
    count: int
    variance: float

    @property
    def mean(self) -> float:
        return float(self.picture.mean())

    @property
    def left_over(self) -> float:
        """The temporal variance (DN²) that averaging left in each pixel of the picture."""
        return self.variance / self.count

    @property
    def pattern(self) -> float:
        """The variance (DN²) over the pixels of the true pattern: of the picture, less what averaging left."""
        return float(np.var(self.picture, ddof=1)) - self.left_over

    def split(self) -> dict[str, float]:
        """The pattern's variance (DN²) as "row" + "column" + "pixel" (EMVA 1288 release 4.0, section 8.2).

        A column's mean over M rows still holds 1/M of the pixels' own variance, s²_cav = s²_col + s²_pix/M, and a row's
        mean 1/N of it; with s² = s²_row + s²_col + s²_pix these are three equations for three variances.
        """
        rows, columns = self.picture.shape
        of_columns = float(np.var(self.picture.mean(axis=0))) - self.left_over / rows
        of_rows = float(np.var(self.picture.mean(axis=1))) - self.left_over / columns
        pixel = (self.pattern - of_columns - of_rows) / (1 - 1 / rows - 1 / columns)
        return {"row": of_rows - pixel / columns, "column": of_columns - pixel / rows, "pixel": pixel}


def stack(frames: Iterable[ArrayLike]) -> Stack:
    """The statistics of two or more frames (height, width) of the same light, read one after the other.

    ValueError where there are fewer than two or their shapes differ.
    """
    count, total, squares = 0, np.zeros(()), np.zeros(())
    for frame in frames:
        values = np.asarray(frame, dtype=float)
        if count and values.shape != total.shape:
            raise ValueError(f"the frames of a stack have one shape, got {total.shape} and {values.shape}")
        count, total, squares = count + 1, total + values, squares + values**2
    if count < 2 or total.ndim != 2:
        raise ValueError(f"a stack is two or more frames (height, width), got {count} of shape {total.shape}")
    picture = total / count
    return Stack(picture, count, float(np.mean(squares / count - picture**2)) * count / (count - 1))


def straight_line(x: ArrayLike, y: ArrayLike) -> tuple[float, float]:
    """Slope and intercept of the least-squares line through points x, y (n,); NaN where all x are one."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    spread = float(np.sum((x - x.mean()) ** 2))
    if spread == 0:
        return nan, nan
    slope = float(np.sum((x - x.mean()) * (y - y.mean()))) / spread
    return slope, float(y.mean()) - slope * float(x.mean())


def slope_through_origin(x: ArrayLike, y: ArrayLike, weights: ArrayLike = 1.0) -> float:
    """The slope m of the least-squares line y = m x through points x, y (n,); NaN where every x is 0."""
    x, y, weights = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float), np.asarray(weights, float))
    below = float(np.sum(weights * x * x))
    return float(np.sum(weights * x * y)) / below if below > 0 else nan
