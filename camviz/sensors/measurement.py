"""What a sensor is, measured from its frames alone: gain, noise, saturation, patterns and dark current.

EMVA Standard 1288, release 4.0 linear. Each level of exposure gives two bright and two dark frames; a stack of bright
and one of dark frames, where they were taken, give the fixed patterns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.sensors.sensor import decibel
from camviz.sensors.statistics import Pair, Stack, pair, slope_through_origin, straight_line

Array = NDArray[np.float64]

LINEAR = 0.7  # of saturation: the range in which gain and responsivity are fitted
LINEARITY = (0.05, 0.95)  # of saturation: the range in which the linearity error is judged
CLIPPED = 0.005  # of dark pixels at zero: beyond this share the black level cuts the noise off
SURELY = 5.0  # standard deviations


@dataclass(frozen=True)
class Level:
    """One exposure: a pair of bright and a pair of dark frames, and the photons per pixel (NaN where unknown)."""

    exposure_s: float
    bright: Pair
    dark: Pair
    photons: float = nan

    @classmethod
    def of(
        cls, exposure_s: float, bright: Sequence[ArrayLike], dark: Sequence[ArrayLike], photons: float = nan
    ) -> Level:
        """The level of two bright and two dark frames (height, width)."""
        return cls(exposure_s, pair(*bright), pair(*dark), photons)


@dataclass(frozen=True)
class Measurement:
    """The EMVA figures of levels of rising brightness; a figure that these frames cannot give is NaN, and `why` it is.

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
        return np.array([self._temporal(one.bright) for one in self.levels])

    @cached_property
    def dark_variance(self) -> Array:
        """σ²_y.dark, temporal, DN²."""
        return np.array([self._temporal(one.dark) for one in self.levels])

    def _temporal(self, seen: Pair) -> float:
        return seen.variance + (seen.drift**2 / 2 if self.flicker_counts else 0)

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
        return int(np.argmax(self.variance))

    @cached_property
    def saturated(self) -> bool:
        """True where the variance falls again beyond its peak, by more than chance."""
        highest, last = self.variance[self.peak], self.variance[-1]
        return bool(highest - last > SURELY * self.levels[-1].bright.relative_error * sqrt(2) * highest)

    @cached_property
    def linear(self) -> NDArray[np.bool_]:
        """The levels (n,) that gain and responsivity are fitted to: up to 70 % of saturation."""
        top = self.peak if self.saturated else len(self.levels) - 1
        chosen = (self.signal <= LINEAR * self.signal[top]) & (np.arange(len(self.levels)) <= top)
        return chosen if chosen.any() else np.arange(len(self.levels)) == top

    @cached_property
    def full_well_e(self) -> float:
        """μ_e.sat, the saturation capacity in electrons: of the level where the variance peaks."""
        if not self.saturated:
            return nan
        electrons = self.quantum_efficiency * float(self.photons[self.peak])
        return electrons if isfinite(electrons) else float(self.signal[self.peak]) / self.gain_dn_per_e

    # Gain and quantum efficiency --------------------------------------------------------------------------------------

    @cached_property
    def gain_dn_per_e(self) -> float:
        """K, DN per electron: the slope of σ²_y − σ²_y.dark over μ_y − μ_y.dark, through the origin.

        Photons arrive by Poisson's law, whose variance is its mean: σ²_e = μ_e. In digital numbers K² σ²_e = K · K μ_e.
        """
        slope = slope_through_origin(self.signal[self.linear], (self.variance - self.dark_variance)[self.linear])
        return slope if slope > 0 else nan

    @cached_property
    def responsivity(self) -> float:
        """R, DN per photon: the slope of μ_y − μ_y.dark over μ_p, through the origin. NaN without photons."""
        return slope_through_origin(self.photons[self.linear], self.signal[self.linear])

    @cached_property
    def quantum_efficiency(self) -> float:
        """η = R / K, electrons per photon."""
        return self.responsivity / self.gain_dn_per_e

    # Noise in the dark ------------------------------------------------------------------------------------------------

    @cached_property
    def dark_noise_dn(self) -> float:
        """σ_y.dark, DN, at an exposure of no time: the intercept of σ²_y.dark over exposure; else its mean."""
        intercept = straight_line(self.exposures_s, self.dark_variance)[1] if self._several_exposures else nan
        return sqrt(max(intercept if isfinite(intercept) else float(self.dark_variance.mean()), 0.0))

    @cached_property
    def read_noise_e(self) -> float:
        """σ_d, electrons: sqrt(σ²_y.dark − 1/12) / K; the twelfth is what rounding to whole numbers adds."""
        if self._clipped:
            return nan
        analogue = self.dark_noise_dn**2 - self.step**2 / 12
        # Below 0.24 DN² rounding no longer acts as noise of its own (EMVA 1288, section 6.5).
        return sqrt(analogue) / self.gain_dn_per_e if self.dark_noise_dn**2 >= 0.24 * self.step**2 else nan

    @cached_property
    def dark_current_e_per_s(self) -> float:
        """μ_I, electrons per second: the slope of the dark frames' mean over exposure, divided by K."""
        if not self._several_exposures or self._clipped:
            return nan
        slope = straight_line(self.exposures_s, [one.dark.mean for one in self.levels])[0]
        return slope / self.gain_dn_per_e if slope >= 0 else nan

    @cached_property
    def dark_current_of_variance_e_per_s(self) -> float:
        """μ_I.var, electrons per second, for cameras that subtract the mean: the slope of σ²_y.dark, divided by K²."""
        if not self._several_exposures or self._clipped:
            return nan
        return straight_line(self.exposures_s, self.dark_variance)[0] / self.gain_dn_per_e**2

    @cached_property
    def _several_exposures(self) -> bool:
        return len(np.unique(self.exposures_s)) > 2

    @cached_property
    def _clipped(self) -> bool:
        return max(one.dark.clipped for one in self.levels) > CLIPPED

    # What follows -----------------------------------------------------------------------------------------------------

    def snr(self, electrons: ArrayLike) -> Array:
        """Signal to noise at these mean electrons per pixel, patterns left out: μ_e / sqrt(σ_d² + 1/(12 K²) + μ_e)."""
        mean = np.asarray(electrons, dtype=float)
        return mean / np.sqrt((self.dark_noise_dn / self.gain_dn_per_e) ** 2 + mean)

    @cached_property
    def snr_max(self) -> float:
        """The signal-to-noise ratio at saturation, sqrt(μ_e.sat): shot noise alone."""
        return sqrt(self.full_well_e)

    @cached_property
    def threshold_e(self) -> float:
        """μ_e.min = σ_y.dark / K + ½, electrons: where signal and noise are equal."""
        return nan if self._clipped else self.dark_noise_dn / self.gain_dn_per_e + 0.5

    @cached_property
    def threshold_photons(self) -> float:
        """μ_p.min = μ_e.min / η, photons per pixel."""
        return self.threshold_e / self.quantum_efficiency

    @cached_property
    def dynamic_range(self) -> float:
        """μ_p.sat / μ_p.min, which is μ_e.sat / μ_e.min."""
        return self.full_well_e / self.threshold_e

    @cached_property
    def linearity(self) -> tuple[float, float, float]:
        """The smallest, the largest and the mean absolute deviation from a straight line, relative to it.

        The line is fitted to light (photons, else exposure) over 5–95 % of saturation, each level with weight
        1/signal²: relative deviations count. NaN where fewer than three levels lie there or the light is not known.
        """
        light = self.photons if np.isfinite(self.photons).all() else self.exposures_s
        top = self.signal[self.peak if self.saturated else -1]
        low, high = LINEARITY
        inside = (self.signal >= low * top) & (self.signal <= high * top)
        if inside.sum() < 3 or len(np.unique(light[inside])) < 3:
            return nan, nan, nan
        x, y = light[inside], self.signal[inside]
        slope, intercept = np.polyfit(x, y, 1, w=1 / y)
        deviations = y / (slope * x + intercept) - 1
        return float(deviations.min()), float(deviations.max()), float(np.abs(deviations).mean())

    # Patterns that stay -----------------------------------------------------------------------------------------------

    @cached_property
    def dsnu_e(self) -> float:
        """DSNU, electrons: the pattern's standard deviation in the dark, divided by K."""
        variance = self._dark_pattern
        return sqrt(variance) / self.gain_dn_per_e if variance > 0 else nan

    @cached_property
    def prnu(self) -> float:
        """PRNU, a fraction of the signal: sqrt(s²_y − s²_y.dark) / (μ_y − μ_y.dark)."""
        if self.bright and self.dark:
            difference = self.bright.pattern - self.dark.pattern
            return sqrt(difference) / (self.bright.mean - self.dark.mean) if difference > 0 else nan
        squared = self._gain_pattern
        return sqrt(squared) if squared > 0 else nan

    @cached_property
    def _dark_pattern(self) -> float:
        """s²_y.dark, DN²: of the stack; of pairs, fitted over exposure where that varies, at the middle of the range.

        Offsets differ from pixel to pixel, and the dark current does: s² = s²_offset + s²_current t².
        """
        if self.dark:
            return self.dark.pattern
        if self._clipped:
            return nan
        patterns = [one.dark.pattern for one in self.levels]
        if not self._several_exposures:
            return float(np.mean(patterns))
        slope, intercept = straight_line(self.exposures_s**2, patterns)
        half = np.argmin(abs(self.signal - 0.5 * self.signal[self.peak]))
        return intercept + slope * float(self.exposures_s[half]) ** 2

    @cached_property
    def _gain_pattern(self) -> float:
        """PRNU² of pairs alone: the slope of s²_y − s²_y.dark over (μ_y − μ_y.dark)², surer levels first."""
        seen = [one for one, used in zip(self.levels, self.linear, strict=True) if used]
        errors = np.array([one.bright.pattern_error**2 + one.dark.pattern_error**2 for one in seen])
        patterns = [one.bright.pattern - one.dark.pattern for one in seen]
        return slope_through_origin(self.signal[self.linear] ** 2, patterns, 1 / np.maximum(errors, 1e-12))

    def pattern_split(self) -> dict[str, dict[str, float]]:
        """DSNU (electrons) and PRNU (fractions) as row, column and pixel parts; empty without stacks.

        A part whose variance came out below zero, which chance does where there is none, is 0.
        """
        if not (self.bright and self.dark):
            return {}
        dark, bright = self.dark.split(), self.bright.split()
        signal = self.bright.mean - self.dark.mean
        return {
            "dsnu_e": {part: sqrt(max(dark[part], 0)) / self.gain_dn_per_e for part in dark},
            "prnu": {part: sqrt(max(bright[part] - dark[part], 0)) / signal for part in dark},
        }

    # All of it --------------------------------------------------------------------------------------------------------

    def figures(self) -> dict[str, float]:
        """The EMVA figures by name, fractions and decibels (20 log10); NaN where these frames cannot give one."""
        return {
            "gain_dn_per_e": self.gain_dn_per_e,
            "read_noise_e": self.read_noise_e,
            "quantum_efficiency": self.quantum_efficiency,
            "snr_max_db": float(decibel(self.snr_max)),
            "dynamic_range_db": float(decibel(self.dynamic_range)),
            "full_well_e": self.full_well_e,
            "prnu": self.prnu,
            "dsnu_e": self.dsnu_e,
            "dark_current_e_per_s": self.dark_current_e_per_s,
        }

    def why(self, name: str) -> str:
        """Why the figure of this name cannot be known from these frames, one sentence; "" for one that is known."""
        if isfinite(self.figures()[name]):
            return ""
        no_gain = "the noise does not rise with the signal, so there is no gain to be read from it"
        not_full = "no level is saturated: the noise still rises at the brightest"
        too_dark = f"more than {CLIPPED:.1%} of the dark pixels are at 0, the black level cuts the noise off"
        still = "the dark frames do not brighten with exposure: the camera takes its dark level off, or is very cold"
        dark_current = still if self._several_exposures else "the dark frames have fewer than three different exposures"
        reasons = {
            "gain_dn_per_e": no_gain,
            "read_noise_e": too_dark if self._clipped else "the noise in the dark is less than rounding hides",
            "quantum_efficiency": "the photons per pixel are not known",
            "snr_max_db": not_full,
            "full_well_e": not_full,
            "dynamic_range_db": not_full if not self.saturated else too_dark,
            "prnu": "the pattern in the bright frames is not above chance",
            "dsnu_e": too_dark if self._clipped else "the pattern in the dark frames is not above chance",
            "dark_current_e_per_s": too_dark if self._clipped else dark_current,
        }
        return reasons[name] if isfinite(self.gain_dn_per_e) else no_gain
