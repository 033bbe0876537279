"""Statistics of repeated frames of the same light: temporal noise and fixed pattern.

A frame is an array (height, width) of digital numbers (DN). Equations: EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, isfinite, nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz_clinic.measuring.noise.ends import ANY, Ends
from camviz_clinic.measuring.noise.neighbours import UNSHADED, Shading, Shared, shared_by_neighbours


@dataclass(frozen=True)
class Pair:
    """Two frames of the same light: their mean (DN), and what varies in time and what in space, variances (DN²).

    Noise that a whole row or a whole column shares, other in each frame, is part of the temporal `variance`, as of the
    standard's total temporal noise. `row_means` and `column_means` tell it: the temporal variance of a row's mean is
    σ²_row + σ²_pixel / columns.
    """

    mean: float
    variance: float  # temporal, of one frame
    pattern: float  # spatial, of what both frames share; below zero where chance outweighs it
    pixels: int
    drift: float = 0.0  # by how much the second frame is brighter, DN: the light flickered
    ends: Ends = ANY
    rows: int = 1
    row_means: float = 0.0
    row_pattern: float = 0.0  # spatial, of the rows' means
    column_means: float = 0.0
    column_pattern: float = 0.0
    kurtosis: float = 3.0  # of the difference of the frames: 3 of Gaussian noise
    shared: tuple[Shared, ...] = ()  # what neighbours share of the noise of pixels, at `LAGS`
    shading: Shading = UNSHADED  # of the mean of both frames

    @property
    def samples(self) -> int:
        """How many values were seen."""
        return 2 * self.pixels

    @property
    def columns(self) -> int:
        return self.pixels // self.rows

    @property
    def within(self) -> float:
        """The temporal variance (DN²) of pixels, without the noise that a row or a column shares.

        Σ (d - means of its row and its column)² has (rows - 1)(columns - 1) degrees of freedom, and Σ (d - mean)² is
        that and what the means of rows and of columns have.
        """
        return within(self.variance, self.row_means, self.column_means, (self.rows, self.columns))

    @property
    def row_variance(self) -> float:
        """σ²_row (DN²), the temporal noise that the pixels of a row share; below zero where chance outweighs it."""
        return self.row_means - self.within / self.columns if self._lines else 0.0

    @property
    def column_variance(self) -> float:
        """σ²_column (DN²), as `row_variance`."""
        return self.column_means - self.within / self.rows if self._lines else 0.0

    @property
    def _lines(self) -> bool:
        return self.rows > 1 and self.columns > 1

    @property
    def total(self) -> float:
        """σ² = σ²_pixel + σ²_row + σ²_column (DN²), without the bias of a difference whose mean was taken off."""
        return self.within + self.row_variance + self.column_variance

    @property
    def _tails(self) -> float:
        """How much wider than of Gaussian noise a variance scatters: more where few pixels have much of it."""
        return sqrt(max((self.kurtosis - 1) / 2, 1.0))

    @property
    def within_error(self) -> float:
        """One standard deviation of `within`, DN²."""
        return self.within * sqrt(2 / max((self.rows - 1) * (self.columns - 1), self.columns - 1, 1)) * self._tails

    @property
    def total_error(self) -> float:
        """One standard deviation of `total`, DN²: rows and columns have one sample for each, of their means."""
        lines = ((self.row_means, self.rows), (self.column_means, self.columns)) if self._lines else ()
        return hypot(self.within_error, *(means * sqrt(2 / (count - 1)) for means, count in lines))

    @property
    def mean_error(self) -> float:
        """One standard deviation of `mean`, DN, by noise of pixels, rows and columns."""
        if not self._lines:
            return sqrt(self.variance / self.pixels / 2)
        each = self.row_means / self.rows + self.column_means / self.columns - self.within / self.pixels
        return sqrt(max(each, self.within / self.pixels) / 2)

    @property
    def pattern_error(self) -> float:
        """One standard deviation of `pattern`, DN²: that of a covariance of two Gaussian frames."""
        pattern = max(self.pattern, 0)
        total = self.within + pattern
        of_lines = sum(
            means * (means + 2 * max(fixed, 0)) / max(count - 1, 1)
            for means, fixed, count in (
                (self.row_means, self.row_pattern, self.rows),
                (self.column_means, self.column_pattern, self.columns),
            )
        )
        return sqrt((total**2 + pattern**2) / self.pixels + of_lines)


def within(variance: float, row_means: float, column_means: float, size: tuple[int, int]) -> float:
    """The variance (DN²) of pixels about the means of their row and their column, of frames of `size` rows and columns.

    `variance` is that of all pixels about their mean, the others those of the means of rows and of columns. It is what
    σ²_pixel is in σ²_pixel + σ²_row + σ²_column. A frame of one row or one column has no such parts.
    """
    rows, columns = size
    if rows < 2 or columns < 2:
        return variance
    between = row_means * (rows - 1) / rows + column_means * (columns - 1) / columns
    return max(variance - between, 0.0) * rows * columns / ((rows - 1) * (columns - 1))


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
    drift = float(difference.mean())
    seen = Pair(float(total.mean()) / 2, variance, shared, a.size, drift, Ends.of(a, b), rows)
    if a.ndim != 2 or min(a.shape) < 2:
        return seen
    row_means, row_pattern = _of_means(difference.mean(axis=1), total.mean(axis=1))
    column_means, column_pattern = _of_means(difference.mean(axis=0), total.mean(axis=0))
    pixels, kurtosis = shared_by_neighbours(difference)
    seen = replace(seen, row_means=row_means, row_pattern=row_pattern)
    seen = replace(seen, column_means=column_means, column_pattern=column_pattern)
    return replace(seen, kurtosis=kurtosis, shared=pixels, shading=Shading.of(total / 2))


def _of_means(difference: NDArray[np.float64], total: NDArray[np.float64]) -> tuple[float, float]:
    """The temporal and the spatial variance (DN²) of the means of a pair's rows or columns."""
    in_time = float(difference.var(ddof=1)) / 2
    return in_time, float(total.var(ddof=1)) / 4 - in_time / 2


@dataclass(frozen=True)
class Part:
    """A variance (DN²) of a pattern or of one of its parts, and its standard error; below zero by chance alone."""

    variance: float
    error: float


@dataclass(frozen=True)
class Stack:
    """Many frames of the same light: their mean picture (height, width), how many, and the temporal variance (DN²).

    `row_means` and `column_means` are the temporal variances (DN²) of the mean of a row, σ²_row + σ²_pixel / columns,
    and of a column. The light's own flicker, which the whole frame shares, is not in them: `frame_means` is the
    temporal variance of a frame's mean. Where they are not given, the noise has no part that rows or columns share.
    """

    picture: NDArray[np.float64]
    count: int
    variance: float
    row_means: float = nan
    ends: Ends = ANY
    column_means: float = nan
    frame_means: float = 0.0

    def __post_init__(self) -> None:
        for name, count in zip(("column_means", "row_means"), self.picture.shape, strict=True):
            if not isfinite(getattr(self, name)):
                object.__setattr__(self, name, self.variance / count)

    @property
    def samples(self) -> int:
        """How many values were seen."""
        return self.picture.size * self.count

    @cached_property
    def mean(self) -> float:
        return float(self.picture.mean())

    @property
    def within(self) -> float:
        """The temporal variance (DN²) of pixels, without the noise that a row or a column shares."""
        return within(self.steady, self.row_means, self.column_means, (self.picture.shape[0], self.picture.shape[1]))

    @property
    def steady(self) -> float:
        """The temporal variance (DN²) without that of the frames' means, which is the same for every pixel."""
        return max(self.variance - self.frame_means, 0.0)

    @property
    def left_over(self) -> float:
        """The temporal variance (DN²) that averaging left in each pixel of the picture."""
        return self.variance / self.count

    @property
    def mean_error(self) -> float:
        """One standard deviation of `mean`, DN, by noise of pixels, rows and columns."""
        rows, columns = self.picture.shape
        each = self.row_means / rows + self.column_means / columns - self.within / self.picture.size
        return sqrt(max(each, self.within / self.picture.size) / self.count)

    @property
    def restless(self) -> bool:
        """True where the frames' means differ by more than their noise: the light flickers, or the offset drifts."""
        return self.frame_means > self.mean_error**2 * self.count * (1 + 5 * sqrt(2 / (self.count - 1)))

    @cached_property
    def pattern(self) -> float:
        """The variance (DN²) over the pixels of the true pattern: of the picture, less what averaging left.

        By the standard's equation, which takes flicker of the light for noise of each pixel; `whole` does not.
        """
        return float(np.var(self.picture, ddof=1)) - self.left_over

    @cached_property
    def whole(self) -> Part:
        """The variance (DN²) of the true pattern without the flicker's share, and its standard error."""
        variance = float(np.var(self.picture, ddof=1)) - self.steady / self.count
        return Part(variance, hypot(*(part.error for part in self.parts.values())))

    def split(self) -> dict[str, float]:
        """The pattern's variance (DN²) as "row" + "column" + "pixel" (EMVA 1288 release 4.0, section 8.2).

        A column's mean over M rows still holds 1/M of the pixels' own variance, s²_cav = s²_col + s²_pix/M, and a row's
        mean 1/N of it; with s² = s²_row + s²_col + s²_pix these are three equations for three variances. Before, what
        averaging over L frames left is taken off: of the means of rows and of columns their own temporal variance over
        L, which includes noise that a row or a column shares.
        """
        return {name: part.variance for name, part in self.parts.items()}

    @cached_property
    def parts(self) -> dict[str, Part]:
        """As `split`, each with its standard error by the noise that averaging left: the pattern is taken as it is."""
        return _parts(self.picture, _Left.of(self))

    @property
    def pattern_error(self) -> float:
        """One standard deviation of `pattern`, DN²."""
        return self.whole.error


def parts_of_difference(bright: Stack, dark: Stack) -> dict[str, Part]:
    """The row, column and pixel parts of the pattern by which the bright stack differs from the dark one, and "whole".

    The dark pattern drops out, and so does its chance covariance with the pattern of the gain, which s²_y − s²_y.dark
    still holds.
    """
    picture, left = bright.picture - dark.picture, _Left.of(bright).and_of(_Left.of(dark))
    parts = _parts(picture, left)
    total = float(np.var(picture, ddof=1)) - left.whole
    return {**parts, "whole": Part(total, hypot(*(part.error for part in parts.values())))}


@dataclass(frozen=True)
class _Left:
    """The temporal variances (DN²) that averaging left in a picture: in all, of pixels, and of the means of rows and of
    columns; and how often they were seen less one."""

    whole: float
    pixel: float
    rows: float
    columns: float
    freedom: int

    @classmethod
    def of(cls, one: Stack) -> _Left:
        whole, pixel, rows, columns = (
            variance / one.count for variance in (one.steady, one.within, one.row_means, one.column_means)
        )
        return cls(whole, pixel, rows, columns, one.count - 1)

    def and_of(self, other: _Left) -> _Left:
        """What is left in the difference of two pictures."""
        return _Left(
            self.whole + other.whole,
            self.pixel + other.pixel,
            self.rows + other.rows,
            self.columns + other.columns,
            min(self.freedom, other.freedom),
        )


def _parts(picture: NDArray[np.float64], left: _Left) -> dict[str, Part]:
    """The row, column and pixel parts of the pattern in a picture, as `Stack.split` explains."""
    rows, columns = picture.shape
    of_columns = float(np.var(picture.mean(axis=0))) - left.columns * (columns - 1) / columns
    of_rows = float(np.var(picture.mean(axis=1))) - left.rows * (rows - 1) / rows
    pattern = float(np.var(picture, ddof=1)) - left.whole
    pixel = (pattern - of_columns - of_rows) / (1 - 1 / rows - 1 / columns)
    pixel_error = _error(left.pixel, pixel, rows * columns, left.freedom * rows * columns)
    row_error = _error(left.rows, of_rows, rows - 1, left.freedom * (rows - 1))
    column_error = _error(left.columns, of_columns, columns - 1, left.freedom * (columns - 1))
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
    count, total, squares, ends, rows, columns = 0, np.zeros(()), np.zeros(()), ANY, [], []
    for frame in frames:
        values = np.asarray(frame, dtype=float)
        if count and values.shape != total.shape:
            raise ValueError(f"the frames of a stack have one shape, got {total.shape} and {values.shape}")
        count, total, squares = count + 1, total + values, squares + values**2
        if values.ndim == 2:
            rows.append(values.mean(axis=1))
            columns.append(values.mean(axis=0))
            ends = ends.joined(Ends.of(values), 1 / count) if count > 1 else Ends.of(values)
    if count < 2 or total.ndim != 2:
        raise ValueError(f"a stack is two or more frames (height, width), got {count} of shape {total.shape}")
    picture = total / count
    variance = float(np.mean(squares / count - picture**2)) * count / (count - 1)
    means = [_line_means(np.array(lines)) for lines in (rows, columns)]
    return Stack(picture, count, variance, means[0], ends, means[1], float(np.var(np.mean(rows, axis=1), ddof=1)))


def _line_means(lines: NDArray[np.float64]) -> float:
    """The temporal variance (DN²) of the means (frames, rows) of rows, without what all rows of a frame share."""
    frames, height = lines.shape
    if height < 2:
        return nan
    left = lines - lines.mean(axis=0) - lines.mean(axis=1, keepdims=True) + lines.mean()
    return float(np.sum(left**2)) / ((frames - 1) * (height - 1))


def straight_line(x: ArrayLike, y: ArrayLike) -> tuple[float, float]:
    """Slope and intercept of the least-squares line through points x, y (n,); NaN where all x are one."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    spread = float(np.sum((x - x.mean()) ** 2))
    if spread == 0:
        return nan, nan
    slope = float(np.sum((x - x.mean()) * (y - y.mean()))) / spread
    return slope, float(y.mean()) - slope * float(x.mean())
