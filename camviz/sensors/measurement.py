"""What a sensor is, measured from its frames alone: gain, noise, saturation, patterns and dark current.

EMVA Standard 1288, release 4.0 linear. Each level of exposure gives two bright and two dark frames; a stack of bright
and one of dark frames, where they were taken, give the fixed patterns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot, nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.sensors.estimates import Estimates, threshold
from camviz.sensors.hidden import QUANTISED, ROUNDING
from camviz.sensors.scale import CLIPPED
from camviz.sensors.statistics import Pair, Stack, pair, straight_line
from camviz.sensors.trust import Figure, judged

Array = NDArray[np.float64]

LINEAR = 0.7  # of saturation: the range in which gain and responsivity are fitted
LINEARITY = (0.05, 0.95)  # of saturation: the range in which the linearity error is judged
SURELY = 5.0  # standard deviations
FIGURES = (
    "gain_dn_per_e",
    "read_noise_e",
    "quantum_efficiency",
    "snr_max_db",
    "dynamic_range_db",
    "full_well_e",
    "prnu",
    "dsnu_e",
    "dark_current_e_per_s",
    "threshold_e",
    "threshold_photons",
)


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
    """The EMVA figures of levels of rising brightness.

    The attributes are the standard's estimates, whatever the frames are worth; NaN where there is none. `judged` holds
    those that can be trusted, bounds for the others, and `why` they are withheld; `figures` the trusted values alone.

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
        """The total temporal variance (DN²) of a pair's frames, with the noise that a row shares."""
        return seen.variance + (seen.drift**2 / 2 if self.flicker_counts else 0)

    @cached_property
    def noisy_rows(self) -> bool:
        """True where the pixels of a row share noise that is another one in each frame.

        Without it the mean of a row's N pixels varies by 1/N of their own variance. Dark and bright pairs are asked
        apart: lamps flicker in rows under a rolling shutter.
        """
        dark = {id(one.dark): one.dark for one in self.levels}.values()
        return _noisy_rows(list(dark)) or _noisy_rows([one.bright for one in self.levels])

    @cached_property
    def pixel_variance(self) -> Array:
        """σ²_y, DN², as far as photons make it: of pixels about their row's mean where rows have noise of their own."""
        return np.array([one.bright.within_rows for one in self.levels]) if self.noisy_rows else self.variance

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
        """True where the variance falls again beyond its peak, by more than chance: its own, of pixels and of rows."""
        highest, last = self.levels[self.peak].bright, self.levels[-1].bright
        errors = [one.within_error if self.noisy_rows else one.total_error for one in (highest, last)]
        return bool(self.pixel_variance[self.peak] - self.pixel_variance[-1] > SURELY * hypot(*errors))

    @cached_property
    def linear(self) -> NDArray[np.bool_]:
        """The levels (n,) that gain and responsivity are fitted to: up to 70 % of saturation."""
        top = self.peak if self.saturated else len(self.levels) - 1
        chosen = (self.signal <= LINEAR * self.signal[top]) & (np.arange(len(self.levels)) <= top)
        return chosen if chosen.any() else np.arange(len(self.levels)) == top

    @cached_property
    def full_well_e(self) -> float:
        """μ_e.sat, the saturation capacity in electrons: of the level where the variance peaks."""
        return self.estimates.full_well.value

    # Gain and quantum efficiency --------------------------------------------------------------------------------------

    @cached_property
    def estimates(self) -> Estimates:
        """Every figure with its standard error, and with what rounding and clipping may hide of it."""
        return Estimates(self)

    @cached_property
    def gain_dn_per_e(self) -> float:
        """K, DN per electron: the slope of σ²_y − σ²_y.dark over μ_y − μ_y.dark, through the origin.

        Photons arrive by Poisson's law, whose variance is its mean: σ²_e = μ_e. In digital numbers K² σ²_e = K · K μ_e.
        Where the dark frames are clipped, or rounding hides their noise, it is the slope of σ²_y over μ_y alone.
        """
        return self.estimates.gain.value

    @cached_property
    def responsivity(self) -> float:
        """R, DN per photon: the slope of μ_y − μ_y.dark over μ_p, through the origin. NaN without photons."""
        return self.estimates.responsivity.value if self.estimates.lit else nan

    @cached_property
    def quantum_efficiency(self) -> float:
        """η = R / K, electrons per photon."""
        return self.estimates.efficiency.value

    # Noise in the dark ------------------------------------------------------------------------------------------------

    @cached_property
    def dark_noise_dn(self) -> float:
        """σ_y.dark, DN, at an exposure of no time: the intercept of σ²_y.dark over exposure; else its mean."""
        return sqrt(max(self.estimates.dark_variance.value, 0.0))

    @cached_property
    def read_noise_e(self) -> float:
        """σ_d, electrons: sqrt(σ²_y.dark − 1/12) / K; the twelfth is what rounding to whole numbers adds.

        It is the standard's total temporal dark noise, so that noise which a row shares is part of it. NaN where the
        black level cuts more than `CLIPPED` of the dark pixels off, or rounding hides the noise.
        """
        hidden = self.clipped or self.dark_noise_dn**2 < QUANTISED * self.step**2
        return nan if hidden else sqrt(self.dark_noise_dn**2 - ROUNDING * self.step**2) / self.gain_dn_per_e

    @cached_property
    def dark_current_e_per_s(self) -> float:
        """μ_I, electrons per second: the slope of the dark frames' mean over exposure, divided by K."""
        found = self.estimates.dark_current.value
        return found if found >= 0 and not self.clipped else nan

    @cached_property
    def dark_current_of_variance_e_per_s(self) -> float:
        """μ_I.var, electrons per second, for cameras that subtract the mean: the slope of σ²_y.dark, divided by K²."""
        if not self.several_exposures or self.clipped:
            return nan
        return straight_line(self.exposures_s, self.dark_variance)[0] / self.gain_dn_per_e**2

    @cached_property
    def several_exposures(self) -> bool:
        return len(np.unique(self.exposures_s)) > 2

    @cached_property
    def clipped(self) -> bool:
        """True where the black level cuts the noise of the dark frames off, of pairs or of the stack."""
        return self.estimates.dark_share > CLIPPED

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
        """μ_e.min = ½ + sqrt(σ² + ¼), electrons, with σ = σ_y.dark / K: where signal and noise are equal.

        The standard prints its approximation σ + ½ (section 6.6), which is 1/(8σ) less.
        """
        return nan if self.clipped else threshold((self.dark_noise_dn / self.gain_dn_per_e) ** 2)

    @cached_property
    def threshold_photons(self) -> float:
        """μ_p.min = μ_e.min / η, photons per pixel."""
        return self.threshold_e / self.quantum_efficiency

    @cached_property
    def dynamic_range(self) -> float:
        """μ_p.sat / μ_p.min, which is μ_e.sat / μ_e.min."""
        return self.full_well_e / self.threshold_e

    @cached_property
    def judged_levels(self) -> NDArray[np.bool_]:
        """The levels (n,) whose deviations from a straight line are judged: 5–95 % of saturation."""
        top = self.signal[self.peak if self.saturated else -1]
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

    # Patterns that stay -----------------------------------------------------------------------------------------------

    @cached_property
    def dsnu_e(self) -> float:
        """DSNU, electrons: the pattern's standard deviation in the dark, divided by K.

        Offsets differ from pixel to pixel, and the dark current does: s² = s²_offset + s²_current t². A stack has one
        exposure; of pairs it is fitted over exposure where that varies, at the middle of the range.
        """
        variance = self.estimates.dark_pattern.value
        return sqrt(variance) / self.gain_dn_per_e if variance > 0 and not self.clipped else nan

    @cached_property
    def prnu(self) -> float:
        """PRNU, a fraction of the signal: sqrt(s²_y − s²_y.dark) / (μ_y − μ_y.dark).

        Of pairs alone it is the slope of s²_y − s²_y.dark over (μ_y − μ_y.dark)², surer levels first.
        """
        found = self.estimates.prnu.value
        return found if found > 0 else nan

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

    @cached_property
    def judged(self) -> dict[str, Figure]:
        """Every figure by its name: its value where that can be trusted, its bounds, and why it is withheld."""
        return judged(self)

    def figures(self) -> dict[str, float]:
        """The EMVA figures by name, fractions and decibels (20 log10); NaN where these frames cannot tell one.

        A figure is told where the truth lies within 3 % of it (DSNU, PRNU 5 %; 0.26 dB), even if chance is at four
        standard errors.
        """
        return {name: self.judged[name].value for name in FIGURES}

    def why(self, name: str) -> str:
        """Why the figure of this name is withheld, one clause; "" for one that is told."""
        return self.judged[name].why


def _noisy_rows(seen: Sequence[Pair]) -> bool:
    """Whether the means of rows vary by more than their pixels' own noise explains, beyond chance."""
    asked = [one for one in seen if one.rows > 2 and one.columns > 1 and one.within_rows > 0]
    if not asked:
        return False
    ratios = [one.row_means * one.columns / one.within_rows for one in asked]
    return bool(np.mean(ratios) > 1 + SURELY * sqrt(2 / ((asked[0].rows - 1) * len(asked))))
