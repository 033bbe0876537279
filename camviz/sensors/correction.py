"""Putting noise right, and what it costs: averaging, dark frames, flat fields, bracketing and smoothing.

Averaging costs time, a dark frame and a flat field cost noise, bracketing costs motion and
smoothing costs detail; `NoiseModel` predicts the first three in electrons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.sensors.measurement import Measurement
from camviz.sensors.sensor import Sensor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseModel:
    """The noise of one pixel after EMVA 1288: `dark_noise_e` with what rounding adds, patterns, and what a DN is.

    `black_dn` is the mean of dark frames, `saturation_dn` the number from which on a pixel no longer counts.
    """

    gain_dn_per_e: float
    dark_noise_e: float
    black_dn: float = 0.0
    saturation_dn: float = np.inf
    prnu: float = 0.0
    dsnu_e: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.gain_dn_per_e < np.inf:
            raise ValueError(f"gain_dn_per_e must be positive and finite, got {self.gain_dn_per_e}")
        for name in ("dark_noise_e", "prnu", "dsnu_e"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be zero or more, and finite, got {getattr(self, name)}")

    @classmethod
    def of(cls, sensor: Sensor, exposure_s: float = 0.0, temperature_c: float | None = None) -> NoiseModel:
        """The model of a sensor whose parameters are known."""
        noise = np.hypot(sensor.dark_noise_e(exposure_s, temperature_c), np.sqrt(1 / 12) / sensor.gain_dn_per_e)
        current = sensor.dark_current(sensor.reference_temperature_c if temperature_c is None else temperature_c)
        black = sensor.offset_dn + sensor.gain_dn_per_e * current * exposure_s
        # The full well is filled before its DN are reached by noise: leave five standard deviations.
        top = sensor.saturation_e - 5 * np.sqrt(sensor.saturation_e + noise**2)
        saturation = black + sensor.gain_dn_per_e * top
        return cls(sensor.gain_dn_per_e, float(noise), black, float(saturation), sensor.prnu, sensor.dsnu_e)

    @classmethod
    def measured(cls, found: Measurement) -> NoiseModel:
        """The model that a measurement found; noise that it could not measure is taken as 0."""
        saturation = found.levels[found.peak].bright.mean if found.saturated else np.inf
        patterns = np.nan_to_num([found.prnu, found.dsnu_e]).tolist()
        noise = found.dark_noise_dn / found.gain_dn_per_e
        return cls(found.gain_dn_per_e, noise, found.levels[0].dark.mean, saturation, *patterns)

    def electrons(self, dn: ArrayLike) -> Array:
        """The electrons (...) that digital numbers (...) stand for; below zero where noise outweighs them."""
        return (np.asarray(dn, dtype=float) - self.black_dn) / self.gain_dn_per_e

    def temporal_variance(self, electrons: ArrayLike) -> Array:
        """σ² = σ_d² + μ_e, electrons², of a pixel with that mean: the noise that changes from frame to frame."""
        return self.dark_noise_e**2 + np.maximum(np.asarray(electrons, dtype=float), 0)

    def pattern_variance(self, electrons: ArrayLike) -> Array:
        """DSNU² + (PRNU μ_e)², electrons²: what is the same in every frame."""
        return self.dsnu_e**2 + (self.prnu * np.asarray(electrons, dtype=float)) ** 2

    # What each remedy leaves ------------------------------------------------------------------------------------------

    def noise_averaged(self, electrons: ArrayLike, frames: int = 1) -> Array:
        """Electrons of noise in the mean of so many frames: temporal noise falls with their root, the pattern stays."""
        return np.sqrt(self.temporal_variance(electrons) / frames + self.pattern_variance(electrons))

    def noise_less_dark(self, electrons: ArrayLike, darks: int) -> Array:
        """Electrons of noise in one frame less the mean of so many dark ones: their noise for the DSNU."""
        shade = (self.prnu * np.asarray(electrons, dtype=float)) ** 2
        return np.sqrt(self.temporal_variance(electrons) + self.dark_noise_e**2 / darks + shade)

    def noise_flattened(self, electrons: ArrayLike, darks: int, flats: int, flat_electrons: float) -> Array:
        """Electrons of noise in one frame divided by a flat field: both patterns gone, both stacks' noise added.

        y = (f - d) / (F - d) · mean: the dark stack enters above and below, with weight 1 - e/F in all.
        """
        share = np.asarray(electrons, dtype=float) / flat_electrons
        dark = (1 - share) ** 2 * self.dark_noise_e**2 / darks
        return np.sqrt(self.temporal_variance(electrons) + dark + self._of_flat(share, flats, flat_electrons))

    def _of_flat(self, share: Array, flats: int, flat_electrons: float) -> Array:
        return share**2 * self.temporal_variance(flat_electrons) / flats


def average(frames: Sequence[ArrayLike]) -> Array:
    """The mean (height, width) of frames of the same scene. Costs n times the exposure; a thing that moves blurs."""
    return np.mean([np.asarray(frame, dtype=float) for frame in frames], axis=0)


def less_dark(frame: ArrayLike, dark: ArrayLike) -> Array:
    """A frame less a dark frame of the same exposure and temperature, DN: offsets, DSNU and dark current are gone.

    `dark` is best the average of many: one alone adds its own noise, up to √2 times as much where there is no light.
    """
    return np.asarray(frame, dtype=float) - np.asarray(dark, dtype=float)


def flattened(frame: ArrayLike, dark: ArrayLike, flat: ArrayLike) -> Array:
    """A frame (height, width) in DN above black, divided by how each pixel answers an even light, `flat`.

    PRNU, vignetting and dust are gone, noise is larger where the flat is dark. NaN where the flat is not above the
    dark: a dead pixel has no answer.
    """
    answer = less_dark(flat, dark)
    answer = np.where(answer > 0, answer, np.nan)
    return less_dark(frame, dark) * (np.nanmean(answer) / answer)


def merged(frames: Sequence[ArrayLike], exposures_s: Sequence[float], model: NoiseModel) -> tuple[Array, Array]:
    """Electrons per second (height, width) from bracketed frames, and their standard deviation.

    Each frame tells x = e / t with variance (σ_d² + x t) / t²; the weights are its inverse, with x from all of them:
    weights from a frame's own noise would prefer those that chance made dark. Saturated pixels have no weight; NaN
    where every frame is saturated. (Hasinoff, Durand and Freeman 2010, equation 5, without the patterns.)
    """
    if len(frames) != len(exposures_s) or not len(frames) or min(exposures_s) <= 0:
        raise ValueError(
            f"exposures_s must be one time above 0 for each of {len(frames)} frames, got {list(exposures_s)}"
        )
    dn = np.stack([np.asarray(frame, dtype=float) for frame in frames])
    times = np.asarray(exposures_s, dtype=float)[:, None, None]
    seen = model.electrons(dn)
    counts = (dn < model.saturation_dn).astype(float)
    rate = _ratio((counts * seen).sum(axis=0), (counts * times).sum(axis=0))
    for _ in range(2):
        weights = counts * times**2 / model.temporal_variance(rate * times)
        rate = _ratio((weights * seen / times).sum(axis=0), weights.sum(axis=0))
    return rate, np.sqrt(_ratio(1.0, weights.sum(axis=0)))


def _ratio(above: Any, below: Array) -> Array:
    return np.divide(above, below, out=np.full_like(below, np.nan), where=below > 0)


# Smoothing by the noise model -----------------------------------------------------------------------------------------


def stabilised(electrons: ArrayLike, dark_noise_e: float) -> Array:
    """2 sqrt(e + 3/8 + σ_d²): noise of one everywhere, in the light and in the dark (Anscombe 1948; Starck 1998)."""
    return 2 * np.sqrt(np.maximum(np.asarray(electrons, dtype=float) + 3 / 8 + dark_noise_e**2, 0))


def unstabilised(values: ArrayLike, dark_noise_e: float) -> Array:
    """The electrons whose noisy transform has these means, without the bias of squaring (Mäkitalo and Foi 2013)."""
    d = np.maximum(np.asarray(values, dtype=float), 2 * np.sqrt(3 / 8))
    half = np.sqrt(3 / 2)
    return d**2 / 4 + half / (4 * d) - 11 / (8 * d**2) + 5 * half / (8 * d**3) - 1 / 8 - dark_noise_e**2


def smoothed(frame: ArrayLike, model: NoiseModel, method: str = "non-local", strength: float = 1.0) -> Array:
    """A frame (height, width) in electrons with its noise smoothed, as strongly as the noise model says.

    The frame is stabilised first, so that one strength suits all of it. "gaussian" blurs by `strength` pixels, noise
    and detail alike; "non-local" averages patches that differ by no more than `strength` times what noise would make of
    equal ones (Buades, Coll and Morel 2005).
    """
    if method not in ("gaussian", "non-local"):
        raise ValueError(f"method must be 'gaussian' or 'non-local', got {method!r}")
    even = stabilised(model.electrons(frame), model.dark_noise_e)
    if method == "gaussian":
        return unstabilised(cv2.GaussianBlur(even, (0, 0), strength), model.dark_noise_e)
    low, step = float(even.min()), 1 / 32  # of a standard deviation: fine enough for 16 bits to hold
    counts = np.clip(np.rint((even - low) / step), 0, 65535).astype(np.uint16)
    patches = cv2.fastNlMeansDenoising(counts, [strength / step], None, 5, 17, cv2.NORM_L1)
    return unstabilised(low + step * patches.astype(float), model.dark_noise_e)
