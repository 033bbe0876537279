"""The estimate of each EMVA 1288 figure, with how far it may be from the truth.

An `Estimate` has the value by the standard's equation, its standard error from the frames' own noise, and bounds for
what rounding, clipping and the distance between levels may hide.

The truths are: gain, efficiency and dark current as the sensor has them; temporal dark noise with the noise that a row
shares, less the twelfth of a squared step that rounding adds; threshold and dynamic range with that twelfth; saturation
where the temporal variance of pixels about their row's mean is largest, which is between two levels; DSNU and PRNU of
these very pixels. Sections are those of EMVA Standard 1288, release 4.0 linear.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from math import hypot, inf, isfinite, nan, sqrt

import numpy as np

from camviz_clinic.measuring.noise.checks import Checks
from camviz_clinic.measuring.noise.estimate import CERTAIN, PROMISE, UNKNOWN, Estimate, combined, of
from camviz_clinic.measuring.noise.hidden import QUANTISED, ROUNDING
from camviz_clinic.measuring.noise.readings import Readings
from camviz_clinic.measuring.noise.scale import CLIPPED
from camviz_clinic.measuring.noise.statistics import Part, parts_of_difference
from camviz_clinic.measuring.noise.transfer import Transfer, ratio

PATTERNS_ALIKE = 0.01  # of PRNU


class Estimates(Transfer):
    """The estimate of every figure of a measurement.

    With `checks` the bounds reach as far as the model is off; without, they are those of a camera that obeys it.
    """

    def __init__(self, found: Readings, checks: Checks | None = None) -> None:
        super().__init__(found)
        self.checks = checks

    @property
    def smoothed(self) -> bool:
        """True where neighbours share their noise, which makes that of rows and of columns larger, too."""
        return self.checks is not None and self.checks.shared_share > PROMISE

    @cached_property
    def unchecked(self) -> Estimates:
        """The estimates as if the model held."""
        return Estimates(self.found)

    # Gain and efficiency ----------------------------------------------------------------------------------------------

    @property
    def clipped(self) -> bool:
        """True where the black level cuts the noise of the dark frames off, of pairs or of the stack."""
        return self.dark_share > CLIPPED

    @property
    def gain(self) -> Estimate:
        """K, DN per electron (section 6.4)."""
        return self.fitted_gain

    @cached_property
    def responsivity(self) -> Estimate:
        """R, DN per photon (section 6.3), with what light that flickers may change of it."""
        one, checks = self.fitted_responsivity, self.checks
        if not checks:
            return one
        light = self.light[self.used]
        weights = light / np.sum(light * light)
        moved = weights * np.hypot(checks.flicker * self.found.signal[self.used] / sqrt(2), checks.wander)
        return replace(one, error=hypot(one.error, float(np.sqrt(moved @ moved))))

    @cached_property
    def efficiency(self) -> Estimate:
        """η = R / K."""
        return of(ratio, self.responsivity, self.gain) if self.lit else UNKNOWN

    # The dark ---------------------------------------------------------------------------------------------------------

    @cached_property
    def dark_variance(self) -> Estimate:
        """σ²_y.dark, DN², at an exposure of no time, with the rows' noise (section 7.1)."""
        parts, t = self.shared(self._total), self.found.exposures_s
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
        return of(lambda variance, gain: threshold(ratio(variance, gain**2)), self.dark_variance, self.gain)

    @cached_property
    def threshold_photons(self) -> Estimate:
        """μ_p.min = μ_e.min / η, photons, where K is in both: (K/2 + sqrt(σ²_y.dark + K²/4)) / R."""
        if not self.lit:
            return UNKNOWN
        return of(
            lambda variance, gain, response: ratio(gain * threshold(ratio(variance, gain**2)), response),
            *(self.dark_variance, self.gain, self.responsivity),
        )

    @cached_property
    def dark_rounded(self) -> bool:
        """True where rounding may hide part of the noise in the dark that matters."""
        square = self.scale.step**2
        return min(one.value for one in self.dark) < 2 * QUANTISED * square

    @cached_property
    def dark_current(self) -> Estimate:
        """μ_I, electrons per second (section 7.2); where it may be a drift of the offset, as their noise bounds it."""
        if not self.found.several_exposures:
            return UNKNOWN
        if not self.checks:
            return Checks(self).dark_current_of_means
        means, noise = self.checks.dark_current_of_means, self.checks.dark_current_of_noise
        if noise and self.checks.spoiling("dark_current_e_per_s") and not self.checks.spoiling("gain_dn_per_e"):
            low, high = noise.bounds
            return Estimate(means.value, 0.0, min(low, high), max(low, high))
        return means

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
        if self.checks:  # where the light is brightest, the frames are full first
            darker, brighter = self.checks.shaded_ends
            low, high = low * (1 + darker), high * (1 + brighter)
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
        return of(ratio, self.saturation_dn, self.gain)

    @cached_property
    def dynamic_range(self) -> Estimate:
        """μ_e.sat / μ_e.min, where K is in both: μ_y.sat / (K/2 + sqrt(σ²_y.dark + K²/4))."""
        return of(
            lambda full, variance, gain: ratio(full, gain * threshold(ratio(variance, gain**2))),
            *(self.saturation_dn, self.dark_variance, self.gain),
        )

    @cached_property
    def linearity_error(self) -> tuple[float, float]:
        """How far each of the linearity's deviations may be off, fractions: its standard error, and what is hidden.

        Twice what the surest level cannot tell: the line takes up no more than the largest of the levels' own errors.
        """
        found, chance, hidden = self.found, 0.0, 0.0
        for i in np.flatnonzero(found.judged_levels).tolist():
            seen, signal = self.signal(i), float(found.signal[i])
            moved = hypot(self.checks.flicker * signal / sqrt(2), self.checks.wander) if self.checks else 0.0
            chance = max(chance, hypot(seen.error, moved) / signal)
            hidden = max(hidden, (seen.high - seen.low) / 2 / signal)
        return 2 * chance, 2 * hidden

    # Patterns ---------------------------------------------------------------------------------------------------------

    @cached_property
    def dark_pattern(self) -> Estimate:
        """s²_y.dark, DN² (section 8.2)."""
        found = self.found
        seen = self.scale.pattern(found.dark) if found.dark else self._dark_pattern_of_pairs()
        return replace(seen, value=max(seen.value, 0.0))

    def _dark_pattern_of_pairs(self) -> Estimate:
        return combined(self.found.pattern_weights.tolist(), self.shared(self.scale.pattern))

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
            return self._less_shading(self._prnu_of_pairs())
        if self.beyond:
            return UNKNOWN
        apart = self._gain_part(parts_of_difference(found.bright, found.dark)["whole"])
        standard = _excess(found.bright.pattern, found.dark.pattern, self.stack_signal.value)
        if not abs(standard - apart.value) <= PATTERNS_ALIKE * apart.value:
            return self._less_shading(apart)
        one = Estimate(standard, apart.error, min(apart.low, standard), max(apart.high, standard))
        return self._less_shading(one)

    def _less_shading(self, one: Estimate, kinds: tuple[int, ...] = (0, 1, 2)) -> Estimate:
        """With a lower bound that leaves smooth light out."""
        if not self.checks:
            return one
        smooth = sum(self.checks.shaded[kind] for kind in kinds)
        low = sqrt(max(max(one.low, 0) ** 2 - smooth, 0))
        return replace(one, low=low) if smooth else one

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
        shared = self.shared(self.scale.pattern)
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
        signal = combined([1, -1], [self.scale.mean(bright), self.scale.mean(dark)])
        drift = sqrt(2 * dark.frame_means) if dark.restless else 0.0  # of the offset, between the stacks
        return replace(signal, error=hypot(signal.error, drift))

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
        for kind, name in enumerate(dark):
            split[f"dsnu_{name}_e"] = of(_root_over, self.scale.pattern(found.dark, dark[name]), self.gain)
            gain = UNKNOWN if self.beyond else self._gain_part(apart[name])
            split[f"prnu_{name}"] = self._less_shading(gain, (kind,))
        return split


def threshold(variance_e: float) -> float:
    """½ + sqrt(σ² + ¼), electrons, of a dark noise of σ² electrons².

    There the signal μ is as large as its noise, sqrt(σ² + μ). The standard's σ + ½ is its approximation (section 6.6).
    """
    return 0.5 + sqrt(variance_e + 0.25) if variance_e > 0 else 1.0 if variance_e <= 0 else nan


def _root_over(variance: float, signal: float) -> float:
    return ratio(sqrt(max(variance, 0)), signal)


def _excess(bright: float, dark: float, signal: float) -> float:
    return _root_over(bright - dark, signal)
