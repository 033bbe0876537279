"""A sensor's gain, noise, saturation, patterns and dark current, measured from its frames alone.

EMVA Standard 1288, release 4.0 linear. Each level of exposure gives two bright and two dark frames; a stack of bright
and one of dark frames, where they were taken, give the fixed patterns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.sensors.correction import NoiseModel
from camviz_clinic.measuring.noise.checks import Checks
from camviz_clinic.measuring.noise.estimates import Estimates, threshold
from camviz_clinic.measuring.noise.hidden import QUANTISED, ROUNDING
from camviz_clinic.measuring.noise.readings import Readings
from camviz_clinic.measuring.noise.statistics import straight_line
from camviz_clinic.measuring.noise.transfer import Transfer
from camviz_clinic.measuring.noise.trust import Figure, judged

Array = NDArray[np.float64]

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
class Measurement(Readings):
    """A sensor's gain, noise, saturation, patterns and dark current, measured from its frames alone.

    The attributes are the standard's estimates, trusted or not; NaN where there is none. `judged` holds those that can
    be trusted, bounds for the others, and `why` they are withheld; `figures` the trusted values alone.

    Args:
        levels: tuple of Level, two or more, of rising brightness.
        bright, dark: Stack, optional, statistics of many frames of one exposure, for the fixed patterns.
        step: float, the difference of neighbouring digital numbers: 1, but 16 where 12 bits were stored in the upper
            bits of 16.
        flicker_counts: bool, whether a change of the light between the two frames of a pair counts as noise, as it did
            in release 3 of the standard, and no longer does in release 4.0.

    Raises: ValueError with fewer than two levels, where none is brighter than the dark, or where all are saturated.
    Source: EMVA Standard 1288, release 4.0 linear (2021).

    Frames of a simulated sensor give its gain and efficiency back:

    >>> from camviz.sensors import Sensor
    >>> sensor, rng = Sensor(quantum_efficiency=0.5, gain_dn_per_e=0.4), np.random.default_rng(0)
    >>> frames = lambda photons: [sensor.expose(np.full((99, 99), photons), 0.01, 20, rng).dn for _ in range(2)]
    >>> found = Measurement(tuple(Level.of(0.01, frames(n), frames(0), n) for n in range(2000, 20000, 2000)))
    >>> round(found.gain_dn_per_e, 2), round(found.quantum_efficiency, 2)
    (0.4, 0.5)
    """

    # Gain and quantum efficiency --------------------------------------------------------------------------------------

    @cached_property
    def estimates(self) -> Estimates:
        """Every figure with its standard error, and with what rounding and clipping may hide of it."""
        return Estimates(self, Checks(Transfer(self)))

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
    def full_well_e(self) -> float:
        """μ_e.sat, the saturation capacity in electrons: of the level where the variance peaks, under even light."""
        return self.estimates.unchecked.full_well.value

    @cached_property
    def clipped(self) -> bool:
        """True where the black level cuts the noise of the dark frames off, of pairs or of the stack."""
        return self.estimates.clipped

    # What follows -----------------------------------------------------------------------------------------------------

    def snr(self, electrons: ArrayLike) -> Array:
        """Signal to noise of one pixel, patterns left out: μ_e / sqrt(σ_d² + 1/(12 K²) + μ_e).

        Args:
            electrons: (...), the mean signal μ_e in electrons.

        Returns: (...), a ratio.
        """
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

    def noise_model(self) -> NoiseModel:
        """The noise of one pixel as these frames tell it; noise that they cannot tell is taken as 0.

        Returns: NoiseModel, which says what averaging, dark frames and flat fields leave.
        """
        saturation = self.levels[self.peak].bright.mean if self.saturated else np.inf
        patterns = np.nan_to_num([self.prnu, self.dsnu_e]).tolist()
        noise = self.dark_noise_dn / self.gain_dn_per_e
        return NoiseModel(self.gain_dn_per_e, noise, self.levels[0].dark.mean, saturation, *patterns)

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

    def pattern_split(self) -> dict[str, dict[str, float]]:
        """DSNU and PRNU as row, column and pixel parts.

        Returns:
            "dsnu_e" in electrons and "prnu" in fractions, each a dictionary of the parts; empty without stacks. A part
            whose variance came out below zero, which chance does where there is none, is 0.
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
        return judged(self.estimates)

    def figures(self) -> dict[str, float]:
        """The EMVA figures that can be trusted.

        A figure is told where the truth lies within 3 % of it (DSNU, PRNU 5 %; 0.26 dB), even if chance is at four
        standard errors.

        Returns: By name, fractions and decibels (20 log10); NaN where these frames cannot tell one.
        """
        return {name: self.judged[name].value for name in FIGURES}

    def why(self, name: str) -> str:
        """Why a figure is withheld.

        Args:
            name: Of the figure.

        Returns: One clause; "" for a figure that is told.
        """
        return self.judged[name].why
