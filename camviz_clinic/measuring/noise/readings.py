"""The data of a photon transfer: levels of rising brightness, and what follows from them before any fit.

EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot, nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz_clinic.measuring.noise.statistics import Pair, Stack, pair

Array = NDArray[np.float64]

LINEAR = 0.7  # of saturation: the range in which gain and responsivity are fitted
LINEARITY = (0.05, 0.95)  # of saturation: the range in which the linearity error is judged
EARLY = 0.75  # of the largest signal: where the variance peaks below, its noise is not the photons'
SURELY = 5.0  # standard deviations


@dataclass(frozen=True)
class Level:
    """One exposure of a photon transfer: a pair of bright and a pair of dark frames.

    Args:
        exposure_s: In seconds.
        bright, dark: Statistics of two frames each; `of` makes them.
        photons: Per pixel; NaN where unknown.

    Source: EMVA Standard 1288, release 4.0 linear (2021).

    Half the mean square of the frames' difference is the noise of one frame:

    >>> level = Level.of(0.01, bright=[[[10, 12]], [[12, 10]]], dark=[[[2, 2]], [[2, 2]]])
    >>> level.bright.mean, level.bright.variance, level.dark.variance
    (11.0, 2.0, 0.0)
    """

    exposure_s: float
    bright: Pair
    dark: Pair
    photons: float = nan

    @classmethod
    def of(
        cls, exposure_s: float, bright: Sequence[ArrayLike], dark: Sequence[ArrayLike], photons: float = nan
    ) -> Level:
        """The level of two bright and two dark frames.

        Args:
            exposure_s: In seconds.
            bright, dark: sequence of (height, width), two frames each, in DN.
            photons: Per pixel; NaN where unknown.

        Returns: Level with the statistics of the frames.
        Raises: ValueError unless there are two frames of each kind, of one shape.
        """
        for name, frames in (("bright", bright), ("dark", dark)):
            if len(frames) != 2:
                raise ValueError(f"{name} must be two frames, got {len(frames)}")
        return cls(exposure_s, pair(*bright), pair(*dark), photons)


@dataclass(frozen=True)
class Readings:
    """Levels sorted by brightness, and stacks of bright and of dark frames where they were taken.

    `step` is the difference of neighbouring digital numbers: 1, but 16 where 12 bits were stored in the upper bits of
    16. Release 3 of the standard counted it as noise when the light changed between the two frames of a pair, release
    4.0 does not: `flicker_counts` is for data of the older kind. ValueError with fewer than two levels, where none is
    brighter than the dark, or where all are saturated.
    """

    levels: tuple[Level, ...]
    bright: Stack | None = None
    dark: Stack | None = None
    step: float = 1.0
    flicker_counts: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "levels", tuple(sorted(self.levels, key=lambda one: one.bright.mean - one.dark.mean)))
        if len(self.levels) < 2:
            raise ValueError(f"a photon transfer needs at least two levels of exposure, got {len(self.levels)}")
        if not self.signal[-1] > 0:
            raise ValueError("the bright frames are not brighter than the dark ones: have they changed places?")
        if not (self.variance > 0).any():
            raise ValueError("the bright frames are saturated throughout: no pixel of them changes, expose less")
        if not np.any(self.variance > self.dark_variance):
            raise ValueError("the bright frames are saturated throughout: they have less noise than the dark ones")

    # What was seen, level by level (n,) -------------------------------------------------------------------------------

    @cached_property
    def signal(self) -> Array:
        """μ_y − μ_y.dark, DN."""
        return np.array([one.bright.mean - one.dark.mean for one in self.levels])

    @cached_property
    def variance(self) -> Array:
        """σ²_y, temporal, DN²."""
        return np.array([self.temporal(one.bright) for one in self.levels])

    @cached_property
    def dark_variance(self) -> Array:
        """σ²_y.dark, temporal, DN²."""
        return np.array([self.temporal(one.dark) for one in self.levels])

    def temporal(self, seen: Pair) -> float:
        """The total temporal variance (DN²) of a pair's frames, with the noise that a row or a column shares."""
        return seen.variance + (seen.drift**2 / 2 if self.flicker_counts else 0)

    @cached_property
    def noisy_rows(self) -> bool:
        """True where the pixels of a row share noise that is another one in each frame.

        Without it the mean of a row's N pixels varies by 1/N of their own variance. Dark and bright pairs are asked
        apart: lamps flicker in rows under a rolling shutter.
        """
        return any(_noisy([(one.row_means, one.rows, one.columns, one.within) for one in kind]) for kind in self._kinds)

    @cached_property
    def noisy_columns(self) -> bool:
        """True where the pixels of a column share noise, as `noisy_rows`."""
        return any(
            _noisy([(one.column_means, one.columns, one.rows, one.within) for one in kind]) for kind in self._kinds
        )

    @property
    def noisy_lines(self) -> bool:
        """True where rows or columns have noise of their own."""
        return self.noisy_rows or self.noisy_columns

    @property
    def _kinds(self) -> tuple[list[Pair], list[Pair]]:
        """The dark pairs, each once, and the bright ones."""
        return list({id(one.dark): one.dark for one in self.levels}.values()), [one.bright for one in self.levels]

    @cached_property
    def pixel_variance(self) -> Array:
        """σ²_y, DN², as far as photons make it: of pixels alone where rows or columns have noise of their own."""
        return np.array([one.bright.within for one in self.levels]) if self.noisy_lines else self.variance

    @cached_property
    def photons(self) -> Array:
        """μ_p, photons per pixel; NaN where unknown."""
        return np.array([one.photons for one in self.levels])

    @cached_property
    def exposures_s(self) -> Array:
        return np.array([one.exposure_s for one in self.levels])

    # Saturation -------------------------------------------------------------------------------------------------------

    @cached_property
    def peak(self) -> int:
        """The level with the largest temporal variance: saturation, where there is a level beyond it."""
        return int(np.argmax(self.pixel_variance))

    @cached_property
    def saturated(self) -> bool:
        """True where the variance falls again beyond its peak, by more than chance, of pixels, rows and columns."""
        highest, last = self.levels[self.peak].bright, self.levels[-1].bright
        errors = [one.within_error if self.noisy_lines else one.total_error for one in (highest, last)]
        return bool(self.pixel_variance[self.peak] - self.pixel_variance[-1] > SURELY * hypot(*errors))

    @cached_property
    def peaks_early(self) -> bool:
        """True where the variance peaks long before the signal ends, as of no camera whose noise is the photons'."""
        return self.saturated and bool(self.signal[self.peak] < EARLY * self.signal.max())

    @cached_property
    def top(self) -> int:
        """The level at which the camera is taken to be full: of the peak; the brightest where that is none or early."""
        if self.peaks_early:
            return int(np.argmax(self.signal))
        return self.peak if self.saturated else len(self.levels) - 1

    @cached_property
    def linear(self) -> NDArray[np.bool_]:
        """The levels (n,) that gain and responsivity are fitted to: up to 70 % of saturation."""
        chosen = (self.signal <= LINEAR * self.signal[self.top]) & (np.arange(len(self.levels)) <= self.top)
        return chosen if chosen.any() else np.arange(len(self.levels)) == self.top

    @cached_property
    def several_exposures(self) -> bool:
        return len(np.unique(self.exposures_s)) > 2

    @cached_property
    def judged_levels(self) -> NDArray[np.bool_]:
        """The levels (n,) whose deviations from a straight line are judged: 5–95 % of saturation."""
        top = self.signal[self.top]
        return (self.signal >= LINEARITY[0] * top) & (self.signal <= LINEARITY[1] * top)

    @cached_property
    def linearity(self) -> tuple[float, float, float]:
        """The smallest, the largest and the mean absolute deviation from a straight line, relative to it.

        The line is fitted to light (photons, else exposure) over 5–95 % of saturation, each level with weight
        1/signal²: relative deviations count. NaN where fewer than three levels lie there or the light is not known.
        """
        light = self.photons if np.isfinite(self.photons).all() else self.exposures_s
        inside = self.judged_levels
        if inside.sum() < 3 or len(np.unique(light[inside])) < 3:
            return nan, nan, nan
        x, y = light[inside], self.signal[inside]
        slope, intercept = np.polyfit(x, y, 1, w=1 / y)
        deviations = y / (slope * x + intercept) - 1
        return float(deviations.min()), float(deviations.max()), float(np.abs(deviations).mean())

    # What each level weighs in the patterns ---------------------------------------------------------------------------

    @cached_property
    def pattern_weights(self) -> Array:
        """What each level's s²_y.dark (n,) weighs in DSNU² of pairs: a line over exposure², taken half way."""
        equal = np.full(len(self.levels), 1 / len(self.levels))
        if not self.several_exposures:
            return equal
        square = self.exposures_s**2
        half = np.argmin(abs(self.signal - 0.5 * self.signal[self.peak]))
        apart = square - square.mean()
        return np.asarray(equal + (square[half] - square.mean()) * apart / np.sum(apart**2))

    @cached_property
    def gain_pattern_weights(self) -> list[float]:
        """What the s²_y − s²_y.dark of each linear level weighs in PRNU² of pairs alone."""
        seen = [one for one, used in zip(self.levels, self.linear, strict=True) if used]
        errors = np.array([one.bright.pattern_error**2 + one.dark.pattern_error**2 for one in seen])
        sure, square = 1 / np.maximum(errors, 1e-12), self.signal[self.linear] ** 2
        return list(sure * square / np.sum(sure * square**2))


def _noisy(seen: Sequence[tuple[float, int, int, float]]) -> bool:
    """Whether the means of lines vary by more than their pixels' own noise explains, beyond chance.

    Of each pair: the variance of the lines' means, how many lines and pixels in a line, and the pixels' variance.
    """
    asked = [one for one in seen if one[1] > 2 and one[2] > 1 and one[3] > 0]
    if not asked:
        return False
    ratios = [means * count / pixels for means, _, count, pixels in asked]
    return bool(np.mean(ratios) > 1 + SURELY * sqrt(2 / ((asked[0][1] - 1) * len(asked))))
