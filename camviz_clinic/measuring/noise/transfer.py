"""The photon transfer of a measurement: signal and noise of every level as estimates, and the straight lines' slopes.

Every estimate has its standard error by chance, and bounds for what rounding and clipping may hide. Whether the model
holds to which the lines belong, `checks` asks. Sections are those of EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from math import hypot, nan

import numpy as np
from numpy.typing import NDArray

from camviz_clinic.measuring.noise.estimate import PROMISE, UNKNOWN, Estimate, combined, of
from camviz_clinic.measuring.noise.hidden import QUANTISED
from camviz_clinic.measuring.noise.readings import Readings
from camviz_clinic.measuring.noise.scale import CLIPPED, Scale
from camviz_clinic.measuring.noise.statistics import Pair, Stack

Array = NDArray[np.float64]

ALIKE = 0.005  # of K


class Transfer:
    """The photon transfer of a measurement: noise and signal of every level, and what is fitted to them."""

    def __init__(self, found: Readings) -> None:
        self.found = found

    @cached_property
    def scale(self) -> Scale:
        found = self.found
        seen: list[Pair | Stack] = [one for level in found.levels for one in (level.bright, level.dark)]
        return Scale.of([*seen, *(one for one in (found.bright, found.dark) if one)], found.step, found.saturated)

    @cached_property
    def bright(self) -> list[Estimate]:
        """σ²_y of each level, DN², of of pixels alone where rows or columns have noise of their own."""
        return [self._pixels(one.bright) for one in self.found.levels]

    @cached_property
    def dark(self) -> list[Estimate]:
        """σ²_y.dark of each level, DN², as `bright`. Levels that share their dark frames share the estimate."""
        return self.shared(self._pixels)

    def _pixels(self, seen: Pair) -> Estimate:
        found = self.found
        if found.noisy_lines:
            return self.scale.noise(seen.within, seen.within_error, seen.ends)
        return self.scale.noise(found.temporal(seen), seen.total_error, seen.ends)

    def _total(self, seen: Pair) -> Estimate:
        """The total noise; of few rows, the mean of their difference takes some of the rows' own noise away."""
        noise = self.scale.noise(self.found.temporal(seen), seen.total_error, seen.ends)
        taken = max(seen.row_variance, 0) / seen.rows + max(seen.column_variance, 0) / seen.columns
        taken = taken if self.found.noisy_lines else 0.0
        return replace(noise, error=hypot(noise.error, taken))

    def shared(self, make: Callable[[Pair], Estimate]) -> list[Estimate]:
        pairs = {id(one.dark): one.dark for one in self.found.levels}
        made = {key: make(dark) for key, dark in pairs.items()}
        return [made[id(one.dark)] for one in self.found.levels]

    @cached_property
    def bright_means(self) -> list[Estimate]:
        return [self.scale.mean(one.bright) for one in self.found.levels]

    @cached_property
    def dark_means(self) -> list[Estimate]:
        return self.shared(self.scale.mean)

    def signal(self, i: int) -> Estimate:
        """μ_y − μ_y.dark of one level, DN."""
        return combined([1, -1], [self.bright_means[i], self.dark_means[i]])

    @cached_property
    def used(self) -> list[int]:
        """The levels that are fitted: the linear ones whose bright frames do not reach the ceiling."""
        levels, linear = self.found.levels, np.flatnonzero(self.found.linear).tolist()
        free = [i for i in linear if self.scale.clipped(levels[i].bright.ends)[1] <= CLIPPED]
        return free or linear

    # Gain and efficiency ----------------------------------------------------------------------------------------------

    @cached_property
    def fitted_gain(self) -> Estimate:
        """K, DN per electron, if the model holds, by the standard's equation.

        Without the dark frames where these hide their noise.

        Where rows or columns have noise of their own, K comes from pixels without it, unless that changes it by less
        than `ALIKE`: then it is the standard's, with bounds that reach the other.
        """
        standard = self._gain_from_both(self.bright, self.dark)
        if self.found.noisy_lines:
            total = [self._total(one.bright) for one in self.found.levels]
            whole = self._gain_from_both(total, self.shared(self._total))
            if abs(whole.value / standard.value - 1) < ALIKE and whole.within(PROMISE):
                ends = (*standard.bounds, whole.low, whole.high)
                standard = Estimate(whole.value, whole.error, min(ends), max(ends))
        if standard.within(PROMISE):
            return standard
        other = self._gain_from_bright()
        return other if other.within(PROMISE) or not standard.value > 0 else standard

    def _gain_from_both(self, bright: list[Estimate], dark: list[Estimate]) -> Estimate:
        """The slope of σ²_y − σ²_y.dark over μ_y − μ_y.dark through the origin (section 6.4).

        Chance in the signal makes the slope smaller, by its own square's share of the signal's: `high` allows for it.
        """
        x = self.found.signal[self.used]
        weights = (x / np.sum(x * x)).tolist()
        both = [*weights, *(-one for one in weights)]
        means = combined(both, self._both(self.bright_means, self.dark_means))  # 1: the weights are those of a slope
        slope = of(ratio, combined(both, self._both(bright, dark)), means)
        smaller = sum(self.signal(i).error ** 2 for i in self.used) / float(np.sum(x * x))
        return _positive(Estimate(slope.value, slope.error, slope.low, slope.high + abs(slope.value) * smaller))

    def _gain_from_bright(self) -> Estimate:
        """The slope of σ²_y over μ_y, of levels that neither rounding nor clipping touches, surer levels first.

        The dark frames enter neither; the intercept takes whatever noise is not the photons'.
        """
        levels, square = self.found.levels, self.scale.step**2
        clear = [
            i
            for i in self.used
            if self.bright[i].value > 1.5 * QUANTISED * square
            and sum(self.scale.clipped(levels[i].bright.ends)) < CLIPPED
        ]
        if len(clear) < 3:
            return UNKNOWN
        x = np.array([self.bright_means[i].value for i in clear])
        sure = np.array([max(self.bright[i].error, 1e-12) for i in clear]) ** -2
        apart = x - np.sum(sure * x) / np.sum(sure)
        below = float(np.sum(sure * apart * x))
        if not below > 0:
            return UNKNOWN
        weights = (sure * apart / below).tolist()
        noise, means = ([every[i] for i in clear] for every in (self.bright, self.bright_means))
        return _positive(of(ratio, combined(weights, noise), combined(weights, means)))

    def _both(self, bright: list[Estimate], dark: list[Estimate]) -> list[Estimate]:
        return [bright[i] for i in self.used] + [dark[i] for i in self.used]

    @cached_property
    def fitted_responsivity(self) -> Estimate:
        """R, DN per photon, if the model holds (section 6.3); DN per second where the photons are not known."""
        light = self.light[self.used]
        if not np.isfinite(light).all():
            return UNKNOWN
        weights = (light / np.sum(light * light)).tolist()
        both = [*weights, *(-one for one in weights)]
        return _positive(combined(both, self._both(self.bright_means, self.dark_means)))

    @cached_property
    def lit(self) -> bool:
        """True where the photons of every level are known."""
        return bool(np.isfinite(self.found.photons).all())

    @cached_property
    def light(self) -> Array:
        """Photons per pixel, or the exposure in seconds where they are not known."""
        return self.found.photons if self.lit else self.found.exposures_s


def ratio(above: float, below: float) -> float:
    """Their quotient, NaN unless the lower one is above zero."""
    return above / below if below > 0 else nan


def _positive(one: Estimate) -> Estimate:
    """An estimate of a figure whose true value is above zero."""
    return replace(one, low=max(one.low, 0.0)) if one.value > 0 else UNKNOWN
