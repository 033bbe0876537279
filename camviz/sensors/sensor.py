"""An image sensor after EMVA 1288: from photons to digital numbers, each step a function with units.

The linear model of EMVA Standard 1288, release 4.0:

    photons → (quantum efficiency) → electrons → (+ dark) → full well → (+ offsets, read noise) → (gain) → ADC → dn
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.arrays import Celsius, Count, Seconds
from camviz.sensors.counting import Floats
from camviz.sensors.dark import dark_current_ratio
from camviz.sensors.efficiency import EfficiencyCurve
from camviz.sensors.fixed_pattern import FixedPattern, Spread, fixed_pattern
from camviz.sensors.steps import Words, amplify, convert, fill, leak, quantise, read


@dataclass(frozen=True, eq=False)
class Exposure:
    """One frame, step by step; all arrays of one shape.

    Attributes:
        photons: (height, width), expected on each pixel.
        photoelectrons, dark_electrons: (height, width), freed by light and by heat.
        charge_e: (height, width), what the well holds, in electrons.
        signal_e: (height, width), as read, in electrons, with offsets and read noise.
        voltage_dn: (height, width), in steps of the converter.
        dn: (height, width), the digital numbers.

    >>> frame = Sensor().expose(np.full((4, 4), 1e6), 0.01, 20, np.random.default_rng(0))
    >>> frame.charge_e.max() == Sensor().full_well_e  # overexposed
    np.True_
    """

    photons: Floats
    photoelectrons: Floats
    dark_electrons: Floats
    charge_e: Floats
    signal_e: Floats
    voltage_dn: Floats
    dn: Words


@dataclass(frozen=True)
class Sensor:
    """An image sensor after EMVA 1288: from photons to digital numbers.

    EMVA 1288 counts photons on the whole pixel, so its efficiency includes the fill factor: leave `fill_factor` at 1. A
    datasheet that gives the efficiency of the light-sensitive area alone has it multiplied by `fill_factor`.

    PRNU acts on the light, DSNU on what is read; the read noise is what is left in an exposure too short for dark
    current.

    Args:
        quantum_efficiency: Electrons per photon at `measured_at_nm`, or by wavelength.
        full_well_e: Electrons that a pixel holds.
        read_noise_e: A standard deviation in electrons.
        gain_dn_per_e: DN per electron.
        offset_dn: The black level.
        bits: Of the converter, 1 to 16.
        dark_current_e_per_s: Electrons per second and pixel at the reference temperature.
        reference_temperature_c: In °C.
        dsnu_e: The pattern in the dark, a standard deviation in electrons.
        dsnu_column_share, dsnu_row_share: Of its variance, what is the same down each column, and along each row.
        prnu: The pattern that light brings, a standard deviation as a fraction of the signal.
        prnu_column_share, prnu_row_share: Of its variance, what is the same down each column, and along each row.
        measured_at_nm: A wavelength.
        fill_factor: A share of the pixel.
        specimen: The serial number of this piece of silicon: another number, another pattern.

    Raises: ValueError for a value that its parameter does not take, naming it.
    Source: EMVA Standard 1288, release 4.0 linear (2021).

    1000 photons are 600 electrons, and 64 + 0.38 · 600 = 292 DN:

    >>> sensor = Sensor(quantum_efficiency=0.6, gain_dn_per_e=0.38, offset_dn=64)
    >>> frame = sensor.expose(np.full((200, 200), 1000), 0.01, 20, np.random.default_rng(0))
    >>> frame.dn.mean().round()
    np.float64(292.0)
    """

    quantum_efficiency: float | EfficiencyCurve = 0.6
    full_well_e: float = 10_000.0
    read_noise_e: float = 5.0
    gain_dn_per_e: float = 0.38
    offset_dn: float = 64.0
    bits: int = 12
    dark_current_e_per_s: float = 0.0
    reference_temperature_c: float = 20.0
    dsnu_e: float = 0.0
    dsnu_column_share: float = 0.0
    dsnu_row_share: float = 0.0
    prnu: float = 0.0
    prnu_column_share: float = 0.0
    prnu_row_share: float = 0.0
    measured_at_nm: float = 525.0
    fill_factor: float = 1.0
    specimen: int = 0

    def __post_init__(self) -> None:
        efficiency = self.quantum_efficiency
        if not isinstance(efficiency, EfficiencyCurve) and not 0 <= efficiency <= 1:
            raise ValueError(f"quantum_efficiency must lie between 0 and 1, or be a curve, got {efficiency}")
        if not 0 < self.fill_factor <= 1:
            raise ValueError(f"fill_factor must lie above 0 and be at most 1, got {self.fill_factor}")
        if not (isinstance(self.bits, int) and 1 <= self.bits <= 16):
            raise ValueError(f"bits must be a whole number from 1 to 16, got {self.bits}")
        for name in ("full_well_e", "gain_dn_per_e", "measured_at_nm"):
            _require(isfinite(getattr(self, name)) and getattr(self, name) > 0, self, name, "positive and finite")
        for name in ("read_noise_e", "dark_current_e_per_s", "dsnu_e", "prnu"):
            _require(isfinite(getattr(self, name)) and getattr(self, name) >= 0, self, name, "zero or more, and finite")
        for name in ("offset_dn", "reference_temperature_c"):
            _require(isfinite(getattr(self, name)), self, name, "a finite number")
        for kind in ("dsnu", "prnu"):
            shares = [getattr(self, f"{kind}_{which}_share") for which in ("column", "row")]
            if min(shares) < 0 or sum(shares) > 1:
                raise ValueError(f"{kind}_column_share and {kind}_row_share must be shares of one whole, got {shares}")

    def efficiency(self, wavelength_nm: ArrayLike | None = None) -> Any:
        """Electrons per photon that arrives on the pixel.

        A sensor with a single figure has that figure at every wavelength.

        Args:
            wavelength_nm: (...), in nanometres; by default `measured_at_nm`.

        Returns: array (...), 0 … 1, the fill factor included.
        """
        if isinstance(self.quantum_efficiency, EfficiencyCurve):
            wavelength = self.measured_at_nm if wavelength_nm is None else wavelength_nm
            return self.quantum_efficiency.at(wavelength) * self.fill_factor
        one = self.quantum_efficiency * self.fill_factor
        return one if wavelength_nm is None else np.full(np.shape(wavelength_nm), one)[()]

    def dark_current(self, temperature_c: Celsius) -> float:
        """Dark current at a temperature, from that at the reference temperature.

        Returns: In electrons per second and pixel.
        """
        return self.dark_current_e_per_s * float(dark_current_ratio(temperature_c, self.reference_temperature_c))

    def pattern(self, height: Count, width: Count) -> FixedPattern:
        """This specimen's fixed pattern: the same at every call, so that it can be measured and taken out.

        Returns: Its arrays are read-only.
        """
        gain = Spread(self.prnu, self.prnu_column_share, self.prnu_row_share)
        offset = Spread(self.dsnu_e, self.dsnu_column_share, self.dsnu_row_share)
        return fixed_pattern(gain, offset, self.specimen, height, width)

    def expose(
        self, photons: ArrayLike, exposure_s: Seconds, temperature_c: Celsius, rng: np.random.Generator
    ) -> Exposure:
        """One frame of monochromatic light at `measured_at_nm`. For light of many colours, see `collect`.

        Args:
            photons: (height, width), the number expected on each pixel during the whole exposure.

        Raises:
            ValueError: For photons that are not (height, width), not finite or below zero, and an exposure below zero.
        """
        photons = _picture(photons, "photons")
        return self.collect(photons * np.float32(self.efficiency()), exposure_s, temperature_c, rng, photons)

    def collect(
        self,
        electrons: ArrayLike,
        exposure_s: Seconds,
        temperature_c: Celsius,
        rng: np.random.Generator,
        photons: ArrayLike | None = None,
    ) -> Exposure:
        """One frame, from the photoelectrons expected on each pixel.

        Args:
            electrons: (height, width), the number expected during the whole exposure.
            photons: (height, width), photons expected, which are only reported.

        Raises:
            ValueError: For electrons that are not (height, width), not finite or below zero, and an exposure below
                zero.
        """
        expected = _picture(electrons, "electrons")
        if not (isfinite(exposure_s) and exposure_s >= 0):
            raise ValueError(f"exposure_s must be zero seconds or more, got {exposure_s}")
        height, width = expected.shape
        pattern = self.pattern(height, width)
        freed = convert(expected, pattern.gain, rng)
        dark = leak(expected.shape, self.dark_current(temperature_c), exposure_s, rng)
        charge = fill(freed + dark, self.full_well_e)
        arrived = expected / np.float32(self.efficiency()) if photons is None else _picture(photons, "photons")
        return Exposure(arrived, freed, dark, *self._digitise(charge, pattern, rng))

    def _digitise(
        self, charge: Floats, pattern: FixedPattern, rng: np.random.Generator
    ) -> tuple[Floats, Floats, Floats, Words]:
        signal = read(charge, pattern.offset_e, self.read_noise_e, rng)
        voltage = amplify(signal, self.gain_dn_per_e, self.offset_dn)
        return charge, signal, voltage, quantise(voltage, self.bits)

    # What the model predicts ------------------------------------------------------------------------------------------

    @property
    def saturation_e(self) -> float:
        """The most electrons that a digital number can tell apart: the full well, or what the converter reaches."""
        return min(self.full_well_e, (2**self.bits - 1 - self.offset_dn) / self.gain_dn_per_e)

    def dark_noise_e(self, exposure_s: Seconds = 0.0, temperature_c: float | None = None) -> float:
        """Read noise and the dark current's own, without quantisation: sqrt(σ_read² + D t).

        Args:
            temperature_c: In °C; by default the reference temperature.

        Returns: A standard deviation in electrons.
        """
        current = self.dark_current(self.reference_temperature_c if temperature_c is None else temperature_c)
        return float(np.sqrt(self.read_noise_e**2 + current * exposure_s))

    def snr(self, photons: ArrayLike, exposure_s: Seconds = 0.0, temperature_c: float | None = None) -> Any:
        """The signal-to-noise ratio of one pixel over time, below saturation.

        η μ_p / sqrt(σ_d² + σ_q²/K² + η μ_p) with σ_q² = 1/12.

        Args:
            photons: (...), on the pixel, μ_p.
            temperature_c: In °C; by default the reference temperature.

        Returns: array (...), a ratio.
        """
        signal = np.multiply(photons, self.efficiency())
        return signal / np.sqrt(self._floor_e(exposure_s, temperature_c) ** 2 + signal)

    def threshold_photons(self, exposure_s: Seconds = 0.0, temperature_c: float | None = None) -> float:
        """The absolute sensitivity threshold: how many photons give SNR = 1.

        From η μ = sqrt(σ² + η μ): η μ = ½ + sqrt(σ² + ¼). EMVA 1288 prints its approximation σ + ½ (section 6.6).

        Args:
            temperature_c: In °C; by default the reference temperature.

        Returns: Photons on the pixel.
        """
        floor = self._floor_e(exposure_s, temperature_c)
        return (0.5 + (floor**2 + 0.25) ** 0.5) / float(self.efficiency())

    def dynamic_range(self, exposure_s: Seconds = 0.0, temperature_c: float | None = None) -> float:
        """Saturation over absolute sensitivity threshold.

        Args:
            temperature_c: In °C; by default the reference temperature.

        Returns: A plain ratio; 20 log10 of it is in dB, log2 in stops.
        """
        saturation = self.saturation_e / float(self.efficiency())
        return saturation / self.threshold_photons(exposure_s, temperature_c)

    def _floor_e(self, exposure_s: float, temperature_c: float | None) -> float:
        """Dark noise with that of quantisation, 1/12 DN², in electrons."""
        return float(np.hypot(self.dark_noise_e(exposure_s, temperature_c), (1 / 12) ** 0.5 / self.gain_dn_per_e))


def decibel(ratio: ArrayLike) -> Any:
    """20 log10: how EMVA 1288 writes ratios of signals.

    Args:
        ratio: (...), a ratio above 0.

    Returns: array (...), in dB.
    Source: EMVA Standard 1288, release 4.0 linear (2021).

    >>> decibel([10, 1000])
    array([20., 60.])
    """
    return 20 * np.log10(ratio)


def _require(holds: bool, sensor: Sensor, name: str, what: str) -> None:
    if not holds:
        raise ValueError(f"{name} must be {what}, got {getattr(sensor, name)}")


def _picture(values: ArrayLike, name: str) -> Floats:
    picture = np.asarray(values, dtype=np.float32)
    if picture.ndim != 2:
        raise ValueError(f"{name} must be one number for each pixel, (height, width), got shape {picture.shape}")
    if not picture.min(initial=0) >= 0 or not picture.max(initial=0) < np.inf:
        raise ValueError(f"{name} must be finite and not negative, got {picture.min()} … {picture.max()}")
    return picture
