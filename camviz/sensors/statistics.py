"""Statistics of repeated frames of the same light: temporal noise and fixed pattern.

A frame is an array (height, width) of digital numbers (DN). Equations: EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import hypot, inf, isfinite, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Ends:
    """The smallest and the largest digital number of some frames, and which share of the pixels each of them has."""

    lowest: float = -inf
    highest: float = inf
    at_lowest: float = 0.0
    at_highest: float = 0.0

    @classmethod
    def of(cls, *frames: NDArray[Any]) -> Ends:
        """Those of frames of one shape."""
        lowest, highest = min(one.min() for one in frames), max(one.max() for one in frames)
        counts = [sum(int(np.count_nonzero(one == end)) for one in frames) for end in (lowest, highest)]
        size = len(frames) * frames[0].size
        return cls(float(lowest), float(highest), counts[0] / size, counts[1] / size)

    def joined(self, other: Ends, share: float) -> Ends:
        """Those of these frames and others, which are this share of all."""
        lowest, highest = min(self.lowest, other.lowest), max(self.highest, other.highest)
        parts = ((self, 1 - share), (other, share))
        at_lowest = sum(weight * one.at_lowest for one, weight in parts if one.lowest == lowest)
        at_highest = sum(weight * one.at_highest for one, weight in parts if one.highest == highest)
        return Ends(lowest, highest, at_lowest, at_highest)


@dataclass(frozen=True)
class Pair:
    """Two frames of the same light: their mean (DN), and what varies in time and what in space, variances (DN²).

    Noise that a whole row shares, other in each frame, is part of the temporal `variance`, as of the standard's total
    temporal noise. `row_means` tells it: the temporal variance of a row's mean, σ²_row + σ²_pixel / columns.
    """

    mean: float
    variance: float  # temporal, of one frame
    pattern: float  # spatial, of what both frames share; below zero where chance outweighs it
    pixels: int
    drift: float = 0.0  # by how much the second frame is brighter, DN: the light flickered
    ends: Ends = Ends()
    rows: int = 1
    row_means: float = 0.0
    row_pattern: float = 0.0  # spatial, of the rows' means

    @property
    def samples(self) -> int:
        """How many values were seen."""
        return 2 * self.pixels

    @property
    def columns(self) -> int:
        return self.pixels // self.rows

    @property
    def within_rows(self) -> float:
        """The temporal variance (DN²) of pixels about their row's mean: without the noise that a row shares.

        Σ (d - mean of its row)² has (rows)(columns - 1) degrees of freedom, and Σ (d - mean)² is that and the rows'.
        """
        if self.rows < 2 or self.columns < 2:
            return self.variance
        between = self.row_means * (self.rows - 1) / self.rows
        return max(self.variance - between, 0.0) * self.columns / (self.columns - 1)

    @property
    def row_variance(self) -> float:
        """σ²_row (DN²), the temporal noise that the pixels of a row share; below zero where chance outweighs it."""
        return self.row_means - self.within_rows / self.columns if self.rows > 1 else 0.0

    @property
    def total(self) -> float:
        """σ² = σ²_pixel + σ²_row (DN²), without the bias of a difference whose mean over few rows was taken off."""
        return self.within_rows + self.row_variance

    @property
    def relative_error(self) -> float:
        """One standard deviation of the temporal variance, of Gaussian noise, relative to it: sqrt(2 / pixels).

        Row noise has one sample for each row: it adds 2 σ⁴ of the rows' means over the number of rows.
        """
        return self.total_error / self.variance if self.variance > 0 else sqrt(2 / self.pixels)

    @property
    def within_error(self) -> float:
        """One standard deviation of `within_rows`, DN²."""
        return self.within_rows * sqrt(2 / (self.pixels - self.rows)) if self.columns > 1 else 0.0

    @property
    def total_error(self) -> float:
        """One standard deviation of `total`, DN²."""
        of_rows = self.row_means * sqrt(2 / (self.rows - 1)) if self.rows > 1 else 0.0
        return sqrt(self.within_error**2 + of_rows**2)

    @property
    def mean_error(self) -> float:
        """One standard deviation of `mean`, DN, by noise of pixels and of rows."""
        each = self.row_means / self.rows if self.rows > 1 else self.variance / self.pixels
        return sqrt(each / 2)

    @property
    def pattern_error(self) -> float:
        """One standard deviation of `pattern`, DN²: that of a covariance of two Gaussian frames."""
        pattern = max(self.pattern, 0)
        total = self.within_rows + pattern
        of_rows = self.row_means * (self.row_means + 2 * max(self.row_pattern, 0)) / max(self.rows - 1, 1)
        return sqrt((total**2 + pattern**2) / self.pixels + of_rows)


def pair(first: ArrayLike, second: ArrayLike) -> Pair:
    """The statistics of two frames (height, width) of the same light.

    The pattern drops out of their difference, whose variance is that of *two* frames: hence the ½ in
    σ² = ½ (mean (a − b)² − (mean a − mean b)²). What both share is their covariance over the pixels.
    ValueError where their shapes differ or they hold fewer than two pixels.
    """
    a, b = np.asarray(first), np.asarray(second)
    if a.shape != b.shape or a.size < 2:
        raise ValueError(f"a pair is two frames of one shape, got {a.shape} and {b.shape}")
    difference, total = np.subtract(b, a, dtype=float), np.add(b, a, dtype=float)
    variance = float(difference.var()) / 2
    # var (a + b) - var (a - b) = 4 cov (a, b)
    shared = float(total.var()) / 4 - variance / 2
    rows = a.shape[0] if a.ndim == 2 else 1
    mean, drift = float(total.mean()) / 2, float(difference.mean())
    return Pair(mean, variance, shared, a.size, drift, Ends.of(a, b), rows, *_of_rows(difference, total))


def _of_rows(difference: NDArray[np.float64], total: NDArray[np.float64]) -> tuple[float, float]:
    """The temporal and the spatial variance (DN²) of the means of a pair's rows."""
    if difference.ndim != 2 or difference.shape[0] < 2:
        return 0.0, 0.0
    in_time = float(difference.mean(axis=1).var(ddof=1)) / 2
    return in_time, float(total.mean(axis=1).var(ddof=1)) / 4 - in_time / 2


def frame_variance(frame: ArrayLike) -> float:
    """The variance (DN²) over the pixels of one frame: noise *and* pattern, which one frame cannot tell apart."""
    return float(np.var(np.asarray(frame, dtype=float), ddof=1))


@dataclass(frozen=True)
class Part:
    """A variance (DN²) of a pattern or of one of its parts, and its standard error; below zero by chance alone."""

    variance: float
    error: float


@dataclass(frozen=True)
class Stack:
    """Many frames of the same light: their mean picture (height, width), how many, and the temporal variance (DN²).

    `row_means` is the temporal variance (DN²) of a row's mean, σ²_row + σ²_pixel / columns; the light's own flicker,
    which the whole frame shares, is not in it. Where it is not given, the noise has no part that rows share.
    """

    picture: NDArray[np.float64]
    count: int
    variance: float
    row_means: float = nan
    ends: Ends = Ends()

    def __post_init__(self) -> None:
        if not isfinite(self.row_means):
            object.__setattr__(self, "row_means", self.variance / self.picture.shape[1])

    @property
    def samples(self) -> int:
        """How many values were seen."""
        return self.picture.size * self.count

    @cached_property
    def mean(self) -> float:
        return float(self.picture.mean())

    @property
    def within_rows(self) -> float:
        """The temporal variance (DN²) of pixels about their row's mean."""
        columns = self.picture.shape[1]
        return max(self.variance - self.row_means, 0.0) * columns / max(columns - 1, 1)

    @property
    def left_over(self) -> float:
        """The temporal variance (DN²) that averaging left in each pixel of the picture."""
        return self.variance / self.count

    @property
    def mean_error(self) -> float:
        """One standard deviation of `mean`, DN, by noise of pixels and of rows."""
        return sqrt(self.row_means / self.picture.shape[0] / self.count)

    @cached_property
    def pattern(self) -> float:
        """The variance (DN²) over the pixels of the true pattern: of the picture, less what averaging left."""
        return float(np.var(self.picture, ddof=1)) - self.left_over

    def split(self) -> dict[str, float]:
        """The pattern's variance (DN²) as "row" + "column" + "pixel" (EMVA 1288 release 4.0, section 8.2).

        A column's mean over M rows still holds 1/M of the pixels' own variance, s²_cav = s²_col + s²_pix/M, and a row's
        mean 1/N of it; with s² = s²_row + s²_col + s²_pix these are three equations for three variances. Before, what
        averaging over L frames left is taken off: of the rows' means their own temporal variance over L, which includes
        noise that a row shares.
        """
        return {name: part.variance for name, part in self.parts.items()}

    @cached_property
    def parts(self) -> dict[str, Part]:
        """As `split`, each with its standard error by the noise that averaging left: the pattern is taken as it is."""
        left = _Left(self.left_over, self.within_rows / self.count, self.row_means / self.count, self.count - 1)
        return _parts(self.picture, left)

    @property
    def pattern_error(self) -> float:
        """One standard deviation of `pattern`, DN²."""
        return hypot(*(part.error for part in self.parts.values()))


def parts_of_difference(bright: Stack, dark: Stack) -> dict[str, Part]:
    """The row, column and pixel parts of the pattern by which the bright stack differs from the dark one, and "whole".

    The dark pattern drops out, and so does its chance covariance with the pattern of the gain, which s²_y − s²_y.dark
    still holds.
    """
    each = [(one.left_over, one.within_rows / one.count, one.row_means / one.count) for one in (bright, dark)]
    whole, pixel, rows = (sum(both) for both in zip(*each, strict=True))
    parts = _parts(bright.picture - dark.picture, _Left(whole, pixel, rows, min(bright.count, dark.count) - 1))
    total = float(np.var(bright.picture - dark.picture, ddof=1)) - whole
    return {**parts, "whole": Part(total, hypot(*(part.error for part in parts.values())))}


@dataclass(frozen=True)
class _Left:
    """The temporal variances (DN²) that averaging left in a picture, in all, of pixels about their row's mean and of
    the rows' means; and how often they were seen less one."""

    whole: float
    pixel: float
    rows: float
    freedom: int


def _parts(picture: NDArray[np.float64], left: _Left) -> dict[str, Part]:
    """The row, column and pixel parts of the pattern in a picture, as `Stack.split` explains."""
    rows, columns = picture.shape
    of_columns = float(np.var(picture.mean(axis=0))) - left.pixel / rows
    of_rows = float(np.var(picture.mean(axis=1))) - left.rows
    pattern = float(np.var(picture, ddof=1)) - left.whole
    pixel = (pattern - of_columns - of_rows) / (1 - 1 / rows - 1 / columns)
    freedom = left.freedom * max(rows - 1, 1)
    pixel_error = _error(left.pixel, pixel, rows * columns, left.freedom * rows * columns)
    # What the mean of all rows' noise adds to each pixel's temporal variance, known from so many frames.
    pixel_error = hypot(pixel_error, _error(left.rows / rows, 0.0, left.freedom, left.freedom))
    row_error = _error(left.rows, of_rows, rows - 1, freedom)
    column_error = _error(left.pixel / rows, of_columns, columns - 1, freedom * columns)
    return {
        "row": Part(of_rows - pixel / columns, hypot(row_error, pixel_error / columns)),
        "column": Part(of_columns - pixel / rows, hypot(column_error, pixel_error / rows)),
        "pixel": Part(pixel, hypot(pixel_error, row_error / columns, column_error / rows)),
    }


def _error(left: float, pattern: float, samples: int, freedom: int) -> float:
    """The standard error of a variance over `samples`, of a pattern under noise of variance `left`, less that noise.

    The noise's own chance 2 left² / n, its product with the pattern 4 left s² / n, and the chance of the `left` that is
    taken off, known from `freedom` degrees of freedom. Of few samples a variance is more often far above its mean than
    a Gaussian number: 1 + 1.8/√n makes four of these errors as rare as four of a Gaussian's (Cornish–Fisher).
    """
    samples = max(samples, 1)
    own = (2 * left**2 + 4 * left * max(pattern, 0)) / samples * (1 + 1.8 / sqrt(samples)) ** 2
    return sqrt(own + 2 * left**2 / max(freedom, 1))


def stack(frames: Iterable[ArrayLike]) -> Stack:
    """The statistics of two or more frames (height, width) of the same light, read one after the other.

    ValueError where there are fewer than two or their shapes differ.
    """
    count, total, squares, ends, rows = 0, np.zeros(()), np.zeros(()), Ends(), []
    for frame in frames:
        values = np.asarray(frame, dtype=float)
        if count and values.shape != total.shape:
            raise ValueError(f"the frames of a stack have one shape, got {total.shape} and {values.shape}")
        count, total, squares = count + 1, total + values, squares + values**2
        if values.ndim == 2:
            rows.append(values.mean(axis=1))
            ends = ends.joined(Ends.of(values), 1 / count) if count > 1 else Ends.of(values)
    if count < 2 or total.ndim != 2:
        raise ValueError(f"a stack is two or more frames (height, width), got {count} of shape {total.shape}")
    picture = total / count
    variance = float(np.mean(squares / count - picture**2)) * count / (count - 1)
    return Stack(picture, count, variance, _row_means(np.array(rows)), ends)


def _row_means(rows: NDArray[np.float64]) -> float:
    """The temporal variance (DN²) of the rows' means (frames, rows), without what all rows of a frame share."""
    frames, height = rows.shape
    if height < 2:
        return nan
    left = rows - rows.mean(axis=0) - rows.mean(axis=1, keepdims=True) + rows.mean()
    return float(np.sum(left**2)) / ((frames - 1) * (height - 1))


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
