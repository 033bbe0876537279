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

from camviz.lenses.arrays import Charges, Count, Electrons, ElectronsLike, FrameLike, Variances
from camviz.sensors.sensor import Sensor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseModel:
    """The noise of one pixel after EMVA 1288, and what each remedy leaves of it.

    Args:
        gain_dn_per_e: What a DN is.
        dark_noise_e: Temporal noise in the dark, in electrons, with what rounding adds.
        black_dn: The mean of dark frames.
        saturation_dn: From this number on a pixel no longer counts.
        prnu: The pattern that light brings, a fraction of the signal.
        dsnu_e: The pattern in the dark, in electrons.

    Raises: ValueError for a gain that is not positive, and noise below zero or infinite.
    Source: EMVA Standard 1288, release 4.0 linear (2021).

    In one frame 875 electrons have noise √(5² + 875) = 30, in the mean of 100 frames a tenth of it:

    >>> model = NoiseModel(gain_dn_per_e=0.5, dark_noise_e=5)
    >>> model.noise_averaged(875), model.noise_averaged(875, frames=100)
    (np.float64(30.0), np.float64(3.0))
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
        """The model of a sensor whose parameters are known.

        Args:
            exposure_s: In seconds: dark current adds noise and brightens the black.
            temperature_c: In °C; by default the sensor's reference temperature.
        """
        noise = np.hypot(sensor.dark_noise_e(exposure_s, temperature_c), np.sqrt(1 / 12) / sensor.gain_dn_per_e)
        current = sensor.dark_current(sensor.reference_temperature_c if temperature_c is None else temperature_c)
        black = sensor.offset_dn + sensor.gain_dn_per_e * current * exposure_s
        # The full well is filled before its DN are reached by noise: leave five standard deviations.
        top = sensor.saturation_e - 5 * np.sqrt(sensor.saturation_e + noise**2)
        saturation = black + sensor.gain_dn_per_e * top
        return cls(sensor.gain_dn_per_e, float(noise), black, float(saturation), sensor.prnu, sensor.dsnu_e)

    def electrons(self, dn: ArrayLike) -> Array:
        """The electrons that digital numbers stand for.

        Args:
            dn: (...), in DN.

        Returns: (...), in electrons; below zero where noise outweighs them.
        """
        return (np.asarray(dn, dtype=float) - self.black_dn) / self.gain_dn_per_e

    def temporal_variance(self, electrons: ElectronsLike) -> Variances:
        """The noise that changes from frame to frame: σ² = σ_d² + μ_e."""
        return self.dark_noise_e**2 + np.maximum(np.asarray(electrons, dtype=float), 0)

    def pattern_variance(self, electrons: ElectronsLike) -> Variances:
        """What is the same in every frame: DSNU² + (PRNU μ_e)²."""
        return self.dsnu_e**2 + (self.prnu * np.asarray(electrons, dtype=float)) ** 2

    # What each remedy leaves ------------------------------------------------------------------------------------------

    def noise_averaged(self, electrons: ElectronsLike, frames: Count = 1) -> Electrons:
        """Noise in the mean of several frames: temporal noise falls with their root, the pattern stays."""
        return np.sqrt(self.temporal_variance(electrons) / frames + self.pattern_variance(electrons))

    def noise_less_dark(self, electrons: ElectronsLike, darks: Count) -> Electrons:
        """Noise in one frame less the mean of several dark ones: their noise for the DSNU."""
        shade = (self.prnu * np.asarray(electrons, dtype=float)) ** 2
        return np.sqrt(self.temporal_variance(electrons) + self.dark_noise_e**2 / darks + shade)

    def noise_flattened(self, electrons: ElectronsLike, darks: int, flats: int, flat_electrons: float) -> Electrons:
        """Noise in one frame divided by a flat field: both patterns gone, both stacks' noise added.

        y = (f - d) / (F - d) · mean: the dark stack enters above and below, with weight 1 - e/F in all.

        Args:
            darks, flats: How many dark and how many flat frames were averaged.
            flat_electrons: The mean signal of the flat field, F.
        """
        share = np.asarray(electrons, dtype=float) / flat_electrons
        dark = (1 - share) ** 2 * self.dark_noise_e**2 / darks
        return np.sqrt(self.temporal_variance(electrons) + dark + self._of_flat(share, flats, flat_electrons))

    def _of_flat(self, share: Array, flats: int, flat_electrons: float) -> Array:
        return share**2 * self.temporal_variance(flat_electrons) / flats


def average(frames: Sequence[ArrayLike]) -> Array:
    """The mean of frames of the same scene. It costs n times the exposure; a thing that moves blurs.

    Args:
        frames: sequence of (height, width), in any unit, such as DN.

    Returns: (height, width), in the same unit.
    Raises: ValueError for no frames, or frames of different sizes.

    >>> average([[[10, 20]], [[12, 26]]])
    array([[11., 23.]])
    """
    return _stacked(frames).mean(axis=0)


def less_dark(frame: FrameLike, dark: ArrayLike) -> Array:
    """A frame less a dark frame: offsets, DSNU and dark current are gone.

    Args:
        dark: (height, width), in DN, of the same exposure and temperature. Best is the average of many: one alone adds
            its own noise, up to √2 times as much where there is no light.

    Returns: (height, width), in DN above black.
    Raises: ValueError for frames of different sizes.

    >>> less_dark([[110, 240]], [[10, 40]])
    array([[100., 200.]])
    """
    light, black = _stacked([frame, dark])
    return light - black


def flattened(frame: ArrayLike, dark: ArrayLike, flat: ArrayLike) -> Array:
    """A frame divided by how each pixel answers an even light.

    PRNU, vignetting and dust are gone, noise is larger where the flat field is dark.

    Args:
        frame, dark, flat: (height, width), in DN: the scene, nothing, and an even light.

    Returns:
        (height, width), in DN above black; NaN where the flat field is not above the dark: a dead pixel has no answer.

    Raises: ValueError for frames of different sizes.

    The second pixel answers half as much to the same light:

    >>> flattened(frame=[[110, 60]], dark=[[10, 10]], flat=[[210, 110]])
    array([[75., 75.]])
    """
    answer = less_dark(flat, dark)
    answer = np.where(answer > 0, answer, np.nan)
    mean = np.nanmean(answer) if np.isfinite(answer).any() else np.nan
    return less_dark(frame, dark) * (mean / answer)


def merged(frames: Sequence[ArrayLike], exposures_s: Sequence[float], model: NoiseModel) -> tuple[Array, Array]:
    """Electrons per second from bracketed frames, and their standard deviation.

    Each frame tells x = e / t with variance (σ_d² + x t) / t²; the weights are its inverse, with x from all of them:
    weights from a frame's own noise would prefer those that chance made dark. Saturated pixels have no weight.

    Args:
        frames: sequence of (height, width), in DN.
        exposures_s: In seconds, one for each frame.
        model: Of the sensor.

    Returns:
        rate: (height, width), in electrons per second; NaN where every frame is saturated.
        deviation: (height, width), in electrons per second.

    Raises: ValueError unless there is one time above 0 for each frame, and the frames have one size.
    Source: S. W. Hasinoff, F. Durand and W. T. Freeman, Noise-optimal capture for high dynamic range photography, CVPR
    2010, equation 5, without the patterns.

    The second pixel is saturated in the longer frame, and 1000 electrons in 0.01 s in the shorter one:

    >>> model = NoiseModel(gain_dn_per_e=0.5, dark_noise_e=5, black_dn=100, saturation_dn=4000)
    >>> rate, deviation = merged([[[150, 4095]], [[105, 600]]], exposures_s=[0.1, 0.01], model=model)
    >>> rate.round(), deviation.round()  # the latter is √(5² + 1000) / 0.01 s
    (array([[  1000., 100000.]]), array([[ 110., 3202.]]))
    """
    if len(frames) != len(exposures_s) or not len(frames) or min(exposures_s) <= 0:
        raise ValueError(
            f"exposures_s must be one time above 0 for each of {len(frames)} frames, got {list(exposures_s)}"
        )
    dn = _stacked(frames)
    times = np.asarray(exposures_s, dtype=float)[:, None, None]
    seen = model.electrons(dn)
    counts = (dn < model.saturation_dn).astype(float)
    rate = _ratio((counts * seen).sum(axis=0), (counts * times).sum(axis=0))
    for _ in range(2):
        weights = counts * times**2 / model.temporal_variance(rate * times)
        rate = _ratio((weights * seen / times).sum(axis=0), weights.sum(axis=0))
    return rate, np.sqrt(_ratio(1.0, weights.sum(axis=0)))


def _stacked(frames: Sequence[ArrayLike]) -> Array:
    """The frames (n, height, width) as float64. ValueError where there is none, or their sizes differ."""
    stack = [np.asarray(frame, dtype=float) for frame in frames]
    shapes = {frame.shape for frame in stack}
    if len(shapes) != 1:
        raise ValueError(f"frames must be one or more of one size, got {sorted(shapes) or 'none'}")
    return np.stack(stack)


def _ratio(above: Any, below: Array) -> Array:
    return np.divide(above, below, out=np.full_like(below, np.nan), where=below > 0)


# Smoothing by the noise model -----------------------------------------------------------------------------------------


def stabilised(electrons: ArrayLike, dark_noise_e: float) -> Array:
    """2 sqrt(e + 3/8 + σ_d²): noise of 1 in the light and in the dark (Murtagh, Starck and Bijaoui 1995)."""
    return 2 * np.sqrt(np.maximum(np.asarray(electrons, dtype=float) + 3 / 8 + dark_noise_e**2, 0))


def unstabilised(values: ArrayLike, dark_noise_e: float) -> Array:
    """The electrons whose noisy transform has these means, without the bias of squaring (Mäkitalo and Foi 2013)."""
    d = np.maximum(np.asarray(values, dtype=float), 2 * np.sqrt(3 / 8))
    half = np.sqrt(3 / 2)
    return d**2 / 4 + half / (4 * d) - 11 / (8 * d**2) + 5 * half / (8 * d**3) - 1 / 8 - dark_noise_e**2


def smoothed(frame: FrameLike, model: NoiseModel, method: str = "non-local", strength: float = 1.0) -> Charges:
    """A frame in electrons with its noise smoothed, as strongly as the noise model says.

    The frame is stabilised first, so that one strength suits all of it.

    Args:
        model: Of the sensor.
        method: {"non-local", "gaussian"}. "gaussian" blurs by `strength` pixels, noise and detail alike; "non-local"
            averages patches that differ by no more than `strength` times what noise would make of equal ones.
        strength: In pixels, or times the noise.

    Raises: ValueError for another method, and a strength that is not above 0.
    Source: A. Buades, B. Coll and J.-M. Morel, A non-local algorithm for image denoising, CVPR 2005.

    Grey of 600 ± 25 electrons:

    >>> sensor = Sensor()
    >>> frame = sensor.expose(np.full((64, 64), 1000), 0.01, 20, np.random.default_rng(0)).dn
    >>> smooth = smoothed(frame, NoiseModel.of(sensor))
    >>> float(smooth.mean().round(-1)), bool(smooth.std() < 5)
    (600.0, True)
    """
    if method not in ("gaussian", "non-local"):
        raise ValueError(f"method must be 'gaussian' or 'non-local', got {method!r}")
    if not strength > 0:
        raise ValueError(f"strength must be above 0, got {strength}")
    even = stabilised(model.electrons(frame), model.dark_noise_e)
    if method == "gaussian":
        return unstabilised(cv2.GaussianBlur(even, (0, 0), strength), model.dark_noise_e)
    low, step = float(even.min()), 1 / 32  # of a standard deviation: fine enough for 16 bits to hold
    counts = np.clip(np.rint((even - low) / step), 0, 65535).astype(np.uint16)
    patches = cv2.fastNlMeansDenoising(counts, [strength / step], None, 5, 17, cv2.NORM_L1)
    return unstabilised(low + step * patches.astype(float), model.dark_noise_e)
