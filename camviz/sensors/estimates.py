"""The estimate of each EMVA 1288 figure, with how far it may be from the truth.

An `Estimate` has the value by the standard's equation, its standard error from the frames' own noise, and bounds for
what rounding, clipping and the distance between levels may hide.

The truths are: gain, efficiency and dark current as the sensor has them; temporal dark noise with the noise that a row
shares, less the twelfth of a squared step that rounding adds; threshold and dynamic range with that twelfth; saturation
where the temporal variance of pixels about their row's mean is largest, which is between two levels; DSNU and PRNU of
these very pixels. Sections are those of EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from math import hypot, inf, isfinite, nan, sqrt

import numpy as np
from numpy.typing import NDArray

from camviz.sensors.estimate import CERTAIN, PROMISE, UNKNOWN, Estimate, combined, of
from camviz.sensors.hidden import QUANTISED, ROUNDING
from camviz.sensors.readings import Readings
from camviz.sensors.scale import CLIPPED, Scale
from camviz.sensors.statistics import Pair, Part, Stack, parts_of_difference

Array = NDArray[np.float64]

ALIKE = 0.005  # of K
PATTERNS_ALIKE = 0.01  # of PRNU


class Estimates:
    """The estimate of every figure of a measurement."""

    def __init__(self, found: Readings) -> None:
        self.found = found

    @cached_property
    def scale(self) -> Scale:
        found = self.found
        seen: list[Pair | Stack] = [one for level in found.levels for one in (level.bright, level.dark)]
        return Scale.of([*seen, *(one for one in (found.bright, found.dark) if one)], found.step, found.saturated)

    @property
    def clipped(self) -> bool:
        """True where the black level cuts the noise of the dark frames off, of pairs or of the stack."""
        return self.dark_share > CLIPPED

    @cached_property
    def bright(self) -> list[Estimate]:
        """σ²_y of each level, DN², of pixels about their row's mean where rows have noise of their own."""
        return [self._pixels(one.bright) for one in self.found.levels]

    @cached_property
    def dark(self) -> list[Estimate]:
        """σ²_y.dark of each level, DN², as `bright`. Levels that share their dark frames share the estimate."""
        return self._shared(self._pixels)

    def _pixels(self, seen: Pair) -> Estimate:
        found = self.found
        if found.noisy_rows:
            return self.scale.noise(seen.within_rows, seen.within_error, seen.ends)
        return self.scale.noise(found.temporal(seen), seen.total_error, seen.ends)

    def _total(self, seen: Pair) -> Estimate:
        """The total noise; of few rows, the mean of their difference takes some of the rows' own noise away."""
        noise = self.scale.noise(self.found.temporal(seen), seen.total_error, seen.ends)
        taken = max(seen.row_variance, 0) / seen.rows if self.found.noisy_rows else 0.0
        return replace(noise, error=hypot(noise.error, taken))

    def _shared(self, make: Callable[[Pair], Estimate]) -> list[Estimate]:
        pairs = {id(one.dark): one.dark for one in self.found.levels}
        made = {key: make(dark) for key, dark in pairs.items()}
        return [made[id(one.dark)] for one in self.found.levels]

    @cached_property
    def bright_means(self) -> list[Estimate]:
        return [self.scale.mean(one.bright) for one in self.found.levels]

    @cached_property
    def dark_means(self) -> list[Estimate]:
        return self._shared(self.scale.mean)

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
    def gain(self) -> Estimate:
        """K, DN per electron: by the standard's equation, or without the dark frames where these hide their noise.

        Where rows have noise of their own, K comes from pixels about their row's mean, unless that changes it by less
        than `ALIKE`: then it is the standard's, with bounds that reach the other.
        """
        standard = self._gain_from_both(self.bright, self.dark)
        if self.found.noisy_rows:
            total = [self._total(one.bright) for one in self.found.levels]
            whole = self._gain_from_both(total, self._shared(self._total))
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
        slope = of(_ratio, combined(both, self._both(bright, dark)), means)
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
        return _positive(of(_ratio, combined(weights, noise), combined(weights, means)))

    def _both(self, bright: list[Estimate], dark: list[Estimate]) -> list[Estimate]:
        return [bright[i] for i in self.used] + [dark[i] for i in self.used]

    @cached_property
    def responsivity(self) -> Estimate:
        """R, DN per photon; DN per second of exposure where the photons are not known (section 6.3)."""
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

    @cached_property
    def efficiency(self) -> Estimate:
        """η = R / K."""
        return of(_ratio, self.responsivity, self.gain) if self.lit else UNKNOWN

    # The dark ---------------------------------------------------------------------------------------------------------

    @cached_property
    def dark_variance(self) -> Estimate:
        """σ²_y.dark, DN², at an exposure of no time, with the rows' noise (section 7.1)."""
        parts, t = self._shared(self._total), self.found.exposures_s
        weights = np.full(len(t), 1 / len(t))
        if self.found.several_exposures:
            weights -= t.mean() * (t - t.mean()) / np.sum((t - t.mean()) ** 2)
        return combined(weights.tolist(), parts)

    @cached_property
    def read_noise(self) -> Estimate:
        """σ_d, electrons (section 6.5)."""
        twelfth = ROUNDING * self.scale.step**2
        return of(lambda variance, gain: _root_over(variance - twelfth, gain), self.dark_variance, self.gain)

    @cached_property
    def threshold(self) -> Estimate:
        """μ_e.min = ½ + sqrt(σ² + ¼), electrons, σ = σ_y.dark / K: where the signal is as large as its noise."""
        return of(lambda variance, gain: threshold(_ratio(variance, gain**2)), self.dark_variance, self.gain)

    @cached_property
    def threshold_photons(self) -> Estimate:
        """μ_p.min = μ_e.min / η, photons, where K is in both: (K/2 + sqrt(σ²_y.dark + K²/4)) / R."""
        if not self.lit:
            return UNKNOWN
        return of(
            lambda variance, gain, response: _ratio(gain * threshold(_ratio(variance, gain**2)), response),
            *(self.dark_variance, self.gain, self.responsivity),
        )

    @cached_property
    def dark_rounded(self) -> bool:
        """True where rounding may hide part of the noise in the dark that matters."""
        square = self.scale.step**2
        return min(one.value for one in self.dark) < 2 * QUANTISED * square

    @cached_property
    def dark_current(self) -> Estimate:
        """μ_I, electrons per second (section 7.2)."""
        if not self.found.several_exposures:
            return UNKNOWN
        t = self.found.exposures_s
        weights = (t - t.mean()) / np.sum((t - t.mean()) ** 2)
        return of(_ratio, combined(weights.tolist(), self.dark_means), self.gain)

    @cached_property
    def dark_share(self) -> float:
        """The largest share of pixels at an end of the scale, of all dark frames: pairs and stack."""
        ends = [one.dark.ends for one in self.found.levels]
        if self.found.dark:
            ends.append(self.found.dark.ends)
        return max(sum(self.scale.clipped(one)) for one in ends)

    # Saturation -------------------------------------------------------------------------------------------------------

    @cached_property
    def saturation_dn(self) -> Estimate:
        """The signal at which the temporal variance peaks, DN as if there were no saturation.

        It lies between levels: below the first that is surely beyond it, and above the signal at which photons alone
        make the variance of the peak, since saturation only takes variance away. It is also no further below the
        largest signal than four standard deviations of a level's pixels: the variance of Gaussian noise does not fall
        before. The standard's value is that of the level; where the level may be off by more than `PROMISE` and the
        middle between these bounds is not, it is the middle.
        """
        found = self.found
        if not found.saturated:
            return UNKNOWN
        peak = found.peak
        value, error = self._level_dn(peak)
        seen = found.levels[peak].bright
        spread = sqrt(seen.variance + max(seen.pattern, 0))
        beyond = next((i for i in range(peak + 1, len(found.levels)) if self._beyond_peak(i)), len(found.levels) - 1)
        low = max(float(found.signal.max()) - 4 * spread, self._photons_alone(peak))
        lost = max(0.1 * spread, 4 * spread**2 / value) if value > 0 else inf  # of the signal at the peak, by clipping
        high = max(float(found.signal[beyond]), value) + lost
        hidden = self.dark_means[peak]
        low, high = min(low, value) - (hidden.high - hidden.value), high + hidden.value - hidden.low
        level, middle = (Estimate(one, error, low, high) for one in (value, (low + high) / 2))
        return middle if middle.within(PROMISE) and not level.within(PROMISE) else level

    def _photons_alone(self, i: int) -> float:
        """The least signal, DN, at which photons alone make the variance of a level: (σ²_y − σ²_y.dark) / K."""
        least, most = self.bright[i].value - CERTAIN * self.bright[i].error, self.dark[i].bounds[1]
        gain = self.gain.bounds[1]
        return (least - most) / gain if isfinite(most) and gain > 0 else 0.0

    def _beyond_peak(self, i: int) -> bool:
        """Whether a level is surely brighter than that of the peak.

        Its variance is less than the peak's, or below the straight line of photon transfer by half of the pixels'
        relative spread: where L(x) g((x − x_sat) / spread) is largest, a fraction 1 − g of no more is missing.
        """
        found, noise, dark = self.found, self.bright[i], self.dark[i]
        lower = self.bright[found.peak].value - noise.value > CERTAIN * self._apart(i)
        seen, (signal, _) = found.levels[found.peak].bright, self._level_dn(i)
        spread = sqrt(seen.variance + max(seen.pattern, 0)) / max(float(found.signal[found.peak]), 1e-30)
        line = dark.bounds[0] + self.gain.bounds[0] * signal
        return lower or line - noise.value - CERTAIN * noise.error > 0.5 * spread * line

    def _apart(self, i: int) -> float:
        return hypot(self.bright[i].error, self.bright[self.found.peak].error)

    def _level_dn(self, i: int) -> tuple[float, float]:
        """The signal of a level, by the light where that is known, and its standard error."""
        if self.lit:
            return self.responsivity.value * float(self.light[i]), self.responsivity.error * float(self.light[i])
        return float(self.found.signal[i]), self.signal(i).error

    @cached_property
    def full_well(self) -> Estimate:
        """μ_e.sat, electrons (section 6.6)."""
        return of(_ratio, self.saturation_dn, self.gain)

    @cached_property
    def dynamic_range(self) -> Estimate:
        """μ_e.sat / μ_e.min, where K is in both: μ_y.sat / (K/2 + sqrt(σ²_y.dark + K²/4))."""
        return of(
            lambda full, variance, gain: _ratio(full, gain * threshold(_ratio(variance, gain**2))),
            *(self.saturation_dn, self.dark_variance, self.gain),
        )

    @cached_property
    def linearity_error(self) -> float:
        """How far each of the linearity's deviations may be off, a fraction: twice what the surest level cannot tell.

        The line takes up no more than the largest of the levels' own errors.
        """
        found = self.found
        worst = 0.0
        for i in np.flatnonzero(found.judged_levels).tolist():
            low, high = self.signal(i).bounds
            worst = max(worst, (high - low) / 2 / float(found.signal[i]))
        return 2 * worst

    # Patterns ---------------------------------------------------------------------------------------------------------

    @cached_property
    def dark_pattern(self) -> Estimate:
        """s²_y.dark, DN² (section 8.2)."""
        found = self.found
        seen = self.scale.pattern(found.dark) if found.dark else self._dark_pattern_of_pairs()
        return replace(seen, value=max(seen.value, 0.0))

    def _dark_pattern_of_pairs(self) -> Estimate:
        return combined(self.found.pattern_weights.tolist(), self._shared(self.scale.pattern))

    @cached_property
    def dsnu(self) -> Estimate:
        """DSNU, electrons (section 8.3)."""
        return of(_root_over, self.dark_pattern, self.gain)

    @cached_property
    def prnu(self) -> Estimate:
        """PRNU, a fraction (section 8.3): sqrt(s²_y − s²_y.dark) / (μ_y − μ_y.dark).

        The standard takes the patterns of gain and offset to be independent. Over few rows or columns they are alike or
        opposed by chance; a stack tells by the difference of its pictures, which is taken where it is more than
        `PATTERNS_ALIKE` off.
        """
        found = self.found
        if not (found.bright and found.dark):
            return self._prnu_of_pairs()
        if self.beyond:
            return UNKNOWN
        apart = self._gain_part(parts_of_difference(found.bright, found.dark)["whole"])
        standard = _excess(found.bright.pattern, found.dark.pattern, self.stack_signal.value)
        if not abs(standard - apart.value) <= PATTERNS_ALIKE * apart.value:
            return apart
        return Estimate(standard, apart.error, min(apart.low, standard), max(apart.high, standard))

    def _gain_part(self, part: Part) -> Estimate:
        """A part of the pattern of the gain, a fraction, of the stacks' difference.

        Where a share p of the dark frames is clipped, up to sqrt(p) of the dark pattern's deviation is not taken off.
        """
        bright, dark = self.found.bright, self.found.dark
        assert bright
        assert dark
        lost = sum(self.scale.clipped(dark.ends))
        left = sqrt(lost * max(dark.pattern, 0)) / (1 - lost) if lost < 1 else inf
        off = left + self.scale.moved(bright) + self.scale.moved(dark)
        variance = max(part.variance, 0)
        deviation, cut = sqrt(variance), 1 - sum(self.scale.clipped(bright.ends))
        high = ((deviation + off) / cut) ** 2 if cut > 0 else inf
        square = Estimate(variance, part.error, max(deviation - off, 0) ** 2, high)
        return of(_root_over, square, self.stack_signal)

    def _prnu_of_pairs(self) -> Estimate:
        """PRNU of pairs alone, with bounds for what the patterns of gain and offset have in common by chance.

        That adds 2 r s_dark PRNU Σ w x to PRNU², where r is the correlation of two patterns of rows or columns.
        """
        found = self.found
        weights, fitted = found.gain_pattern_weights, np.flatnonzero(found.linear).tolist()
        bright = [self.scale.pattern(found.levels[i].bright) for i in fitted]
        shared = self._shared(self.scale.pattern)
        both = combined([*weights, *(-one for one in weights)], [*bright, *(shared[i] for i in fitted)])
        once = [weight * float(found.signal[i]) for weight, i in zip(weights, fitted, strict=True)]
        signals = combined(once, [self.signal(i) for i in fitted])  # 1, since the weights are those of a slope
        value = of(_root_over, replace(both, value=max(both.value, 0)), signals)
        first = found.levels[0].dark
        alike = CERTAIN / sqrt(max(min(first.rows, first.columns) - 1, 1))
        common = min(alike, 1.0) * sqrt(max(self.dark_pattern.bounds[1], 0)) * abs(sum(once))
        return replace(value, low=value.low - common, high=value.high + common)

    @cached_property
    def stack_signal(self) -> Estimate:
        bright, dark = self.found.bright, self.found.dark
        assert bright
        assert dark
        return combined([1, -1], [self.scale.mean(bright), self.scale.mean(dark)])

    @cached_property
    def beyond(self) -> bool:
        """True where pixels of the bright stack are saturated, so that its pattern says nothing of the gain."""
        found = self.found
        if not (found.bright and found.dark and found.saturated):
            return False
        spread = sqrt(found.bright.variance + max(found.bright.pattern, 0))
        return found.bright.mean - found.dark.mean + 3 * spread > float(found.signal.max())

    def parts(self) -> dict[str, Estimate]:
        """The row, column and pixel parts of DSNU (electrons) and PRNU (fractions), by their figures' names."""
        found, split = self.found, {}
        if not (found.bright and found.dark):
            return {}
        dark, apart = found.dark.parts, parts_of_difference(found.bright, found.dark)
        for name in dark:
            split[f"dsnu_{name}_e"] = of(_root_over, self.scale.pattern(found.dark, dark[name]), self.gain)
            split[f"prnu_{name}"] = UNKNOWN if self.beyond else self._gain_part(apart[name])
        return split


def threshold(variance_e: float) -> float:
    """½ + sqrt(σ² + ¼), electrons, of a dark noise of σ² electrons².

    There the signal μ is as large as its noise, sqrt(σ² + μ). The standard's σ + ½ is its approximation (section 6.6).
    """
    return 0.5 + sqrt(variance_e + 0.25) if variance_e > 0 else 1.0 if variance_e <= 0 else nan


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0 else nan


def _root_over(variance: float, signal: float) -> float:
    return _ratio(sqrt(max(variance, 0)), signal)


def _excess(bright: float, dark: float, signal: float) -> float:
    return _root_over(bright - dark, signal)


def _positive(one: Estimate) -> Estimate:
    """An estimate of a figure whose true value is above zero."""
    return replace(one, low=max(one.low, 0.0)) if one.value > 0 else UNKNOWN
