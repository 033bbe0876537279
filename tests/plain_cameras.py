"""Cameras in plain NumPy, photon by photon, with all that their figures are in truth: what a measurement is held to.

Nothing here is taken from `camviz.sensors` but the measurement that is asked.
"""

from dataclasses import dataclass, field
from math import hypot, log10, nan, sqrt

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import poisson

from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.statistics import stack

NORMAL = 1 / np.sqrt(2 * np.pi)
MARGINS = {"dsnu": 0.05, "prnu": 0.05, "linearity": 0.001}  # of the figures that begin so; of the others 3 %, 0.26 dB


@dataclass(frozen=True, eq=False)
class PlainCamera:
    """A camera of known parameters: electrons, DN per electron, shares; maps (height, width) of what stays."""

    gain: float
    bits: int
    read_e: float
    row_e: float
    offset_dn: float
    full_well_e: float
    efficiency: float
    dark_e_per_s: float
    dsnu_e: np.ndarray = field(repr=False)
    prnu: np.ndarray = field(repr=False)

    def frame(self, photons, exposure_s, rng):
        """Photons and heat free electrons, wells fill, offsets and noise add, and the converter rounds and clips."""
        freed = rng.poisson(photons * self.efficiency * (1 + self.prnu) + self.dark_e_per_s * exposure_s)
        rows, columns = self.prnu.shape
        signal = np.minimum(freed, self.full_well_e) + self.dsnu_e
        signal += self.read_e * rng.standard_normal((rows, columns)) + self.row_e * rng.standard_normal((rows, 1))
        return np.clip(np.rint(self.gain * signal + self.offset_dn), 0, 2**self.bits - 1).astype(np.uint16)

    @property
    def top_e(self):
        """Where the well or the converter ends."""
        return min(self.full_well_e, (2**self.bits - 1 - self.offset_dn) / self.gain)

    def law(self, light_e, exposure_s, floor=0.0):
        """Mean, and variance about the row's mean, DN, at a mean of so many electrons of light (...), by integration.

        Over the pixels' gains, over the offsets of pixels and rows, and over electrons and read noise before clipping.
        """
        mean, variance = 0.0, 0.0
        for gain, gain_weight in _nodes(float(self.prnu.mean()), float(self.prnu.std())):
            for offset, offset_weight in _nodes(0.0, hypot(self.row_e, float(self.dsnu_e.std()))):
                electrons = np.asarray(light_e) * (1 + gain) + self.dark_e_per_s * np.asarray(exposure_s)
                one, square = self._moments(electrons, offset, floor)
                mean = mean + gain_weight * offset_weight * one
                variance = variance + gain_weight * offset_weight * (square - one**2)
        return mean, variance

    def _moments(self, electrons, offset_e, floor):
        """The mean and mean square of one pixel's DN at Poisson means of electrons (n,)."""
        electrons = np.atleast_1d(electrons)[:, None]
        if electrons.max() < 300:
            count = np.arange(500.0)[None]
            chance = poisson.pmf(count, electrons)
        else:
            z = np.linspace(-6, 6, 161)[None]
            count, chance = electrons + np.sqrt(electrons) * z, np.exp(-z * z / 2) * NORMAL * (12 / 160)
        middle = self.gain * (np.minimum(count, self.full_well_e) + offset_e) + self.offset_dn
        one, square = _clipped(middle, self.gain * self.read_e, floor, 2**self.bits - 1)
        return np.sum(chance * one, axis=1), np.sum(chance * square, axis=1)


def _nodes(mean, deviation):
    """Values and weights of a Gauss–Hermite rule for a normal law."""
    if deviation == 0:
        return [(mean, 1.0)]
    x, w = np.polynomial.hermite_e.hermegauss(9)
    return list(zip(mean + deviation * x, w / w.sum(), strict=True))


def _clipped(mean, sigma, low, high):
    """The first two moments of normal numbers that are clipped at both ends."""
    a, b = (low - mean) / sigma, (high - mean) / sigma
    below, above, inside = ndtr(a), ndtr(-b), ndtr(b) - ndtr(a)
    pa, pb = (np.exp(-(np.clip(x, -40, 40) ** 2) / 2) * NORMAL for x in (a, b))
    low = low if np.isfinite(low) else 0.0
    one = low * below + high * above + mean * inside + sigma * (pa - pb)
    tails = np.where(np.isfinite(a), a, 0) * pa - b * pb
    square = low**2 * below + high**2 * above + (mean**2 + sigma**2) * inside + 2 * mean * sigma * (pa - pb)
    return one, square + sigma**2 * tails


@dataclass(frozen=True)
class Shooting:
    """How a camera is photographed: exposures and photons of the levels (n,), and how many frames its stacks have."""

    exposures_s: np.ndarray
    photons: np.ndarray
    known: bool = True
    frames: int = 0


def measured(camera, shooting, rng):
    """The measurement of a camera: a bright and a dark pair for every level, dark ones once for each exposure."""
    darks = {t: [camera.frame(0.0, t, rng) for _ in range(2)] for t in shooting.exposures_s}
    levels, dark_pairs = [], {}
    for t, photons in zip(shooting.exposures_s, shooting.photons, strict=True):
        bright = [camera.frame(photons, t, rng) for _ in range(2)]
        level = Level.of(t, bright, darks[t], photons if shooting.known else nan)
        object.__setattr__(level, "dark", dark_pairs.setdefault(t, level.dark))
        levels.append(level)
    if not shooting.frames:
        return Measurement(tuple(levels))
    half = int(np.argmin(abs(shooting.photons * camera.efficiency - 0.5 * camera.top_e)))
    t, photons = shooting.exposures_s[half], shooting.photons[half]
    stacks = [stack(camera.frame(light, t, rng) for _ in range(shooting.frames)) for light in (photons, 0.0)]
    return Measurement(tuple(levels), *stacks)


def truth(camera, shooting, found):
    """Every figure of the camera, by its name, as it is by construction."""
    still = len(np.unique(shooting.exposures_s)) < 3
    waiting_e = camera.dark_e_per_s * float(np.mean(shooting.exposures_s)) if still else 0.0
    dark_e2 = camera.read_e**2 + camera.row_e**2 + waiting_e
    threshold = 0.5 + sqrt(dark_e2 + 1 / (12 * camera.gain**2) + 0.25)
    full, efficiency = peak_e(camera, shooting), camera.efficiency * float(1 + camera.prnu.mean())
    prnu = camera.prnu / (1 + camera.prnu.mean())
    return {
        "gain_dn_per_e": camera.gain,
        "read_noise_e": sqrt(dark_e2),
        "quantum_efficiency": efficiency,
        "full_well_e": full,
        "snr_max_db": 10 * log10(full),
        "dynamic_range_db": 20 * log10(full / threshold),
        "threshold_e": threshold,
        "threshold_photons": threshold / efficiency,
        "dark_current_e_per_s": camera.dark_e_per_s,
        "dsnu_e": float(camera.dsnu_e.std()),
        "prnu": float(prnu.std()),
        **{f"dsnu_{part}_e": value for part, value in split(camera.dsnu_e).items()},
        **{f"prnu_{part}": value for part, value in split(prnu).items()},
        **linearity(camera, shooting, found),
    }


def split(pattern):
    """The standard deviations of a pattern's row, column and pixel parts: means of a row hold 1/N of the pixels'."""
    rows, columns = pattern.shape
    whole, of_rows, of_columns = pattern.var(ddof=1), pattern.mean(axis=1).var(), pattern.mean(axis=0).var()
    pixel = (whole - of_rows - of_columns) / (1 - 1 / rows - 1 / columns)
    parts = {"row": of_rows - pixel / columns, "column": of_columns - pixel / rows, "pixel": pixel}
    return {name: sqrt(max(part, 0)) for name, part in parts.items()}


def peak_e(camera, shooting):
    """The mean electrons of light at which the temporal variance about the row's mean is largest."""
    per_electron = shooting.exposures_s[-1] / (shooting.photons[-1] * camera.efficiency)
    steady = shooting.exposures_s[0] == shooting.exposures_s[-1]
    low, high = 0.3 * camera.top_e, 1.3 * camera.top_e
    for _ in range(2):
        light = np.linspace(low, high, 80)
        exposure = shooting.exposures_s[0] if steady else light * per_electron
        variance = camera.law(light, exposure)[1]
        best, apart = light[np.argmax(variance)], light[1] - light[0]
        low, high = best - 1.5 * apart, best + 1.5 * apart
    return float(best)


def linearity(camera, shooting, found):
    """Deviations of the expected signal from its line, over the levels that the measurement judged."""
    names = ("linearity_error", "linearity_error_min", "linearity_error_max")
    inside = found.judged_levels
    if inside.sum() < 3:
        return dict.fromkeys(names, nan)
    exposures = np.array([one.exposure_s for one in found.levels])
    order = [int(np.argmin(abs(shooting.exposures_s - t))) for t in exposures]
    photons = np.sort(shooting.photons) if len(np.unique(exposures)) == 1 else shooting.photons[order]
    bright = camera.law(photons * camera.efficiency, exposures, -np.inf)[0]
    dark = camera.law(np.zeros(len(photons)), exposures, -np.inf)[0]
    x, y = photons[inside], (bright - dark)[inside]
    slope, intercept = np.polyfit(x, y, 1, w=1 / y)
    off = y / (slope * x + intercept) - 1
    return dict(zip(names, (abs(off).mean(), off.min(), off.max()), strict=True))


def random_camera(rng, size, clean=False):
    """A camera of any kind; `clean` has a black level well above its noise."""
    gain, bits = 10 ** rng.uniform(-2, 1), int(rng.choice([8, 10, 12, 14, 16]))
    read_e, row_e = 10 ** rng.uniform(log10(0.3), log10(30)), rng.choice([0.0, 10 ** rng.uniform(-0.5, log10(30))])
    dsnu_e, prnu = rng.uniform(0, 5), rng.uniform(0, 0.03)
    spread = gain * sqrt(read_e**2 + row_e**2 + dsnu_e**2)
    share = 0.0 if clean else float(rng.choice([0.0, rng.uniform(0, 0.6), 10 ** rng.uniform(-4, -1)]))
    offset = 0.5 - spread * float(ndtri(share)) if share else rng.uniform(6, 12) * spread + rng.uniform(1, 5)
    offset = min(offset, 0.3 * (2**bits - 1))  # noise as wide as the scale leaves no room for it
    converter = (2**bits - 1 - offset) / gain
    full_well = min(max(converter, 60.0) * rng.uniform(0.6, 1.3), 200_000.0)
    patterns = [deviation * pattern(rng, size) for deviation in (dsnu_e, prnu)]
    dark = float(rng.choice([0.0, rng.uniform(0, 100)]))
    return PlainCamera(
        gain, bits, read_e, row_e, offset, full_well, rng.uniform(0.2, 0.9), dark, patterns[0], patterns[1]
    )


def pattern(rng, size):
    """A pattern of deviation 1 with random shares for rows and columns."""
    rows, columns = size
    share = rng.dirichlet([1, 1, 2]) * rng.integers(0, 2, 3)
    share = share / share.sum() if share.sum() else np.array([0, 0, 1])
    parts = [rng.standard_normal(shape) for shape in ((rows, 1), (1, columns), (rows, columns))]
    return sum(sqrt(weight) * part for weight, part in zip(share, parts, strict=True)) + np.zeros(size)


def random_shooting(rng, camera, levels):
    """Exposures or light that rise to somewhere below or beyond saturation."""
    reach = rng.uniform(1.02, 1.5) if rng.random() < 0.8 else rng.uniform(0.4, 0.9)
    photons = np.linspace(1 / levels, 1, levels) * reach * max(camera.top_e, 20) / camera.efficiency
    longest = 10 ** rng.uniform(-2, 0.5)
    exposures = photons / photons[-1] * longest if rng.random() < 0.75 else np.full(levels, longest)
    frames = int(rng.choice([0, rng.integers(4, 33)]))
    return Shooting(exposures, photons, bool(rng.random() < 0.6), frames)


def error(name, value, true):
    """How far a figure is off, as a fraction of what is allowed: 1 at the promise."""
    allowed = next((margin for start, margin in MARGINS.items() if name.startswith(start)), 0.03)
    if name.endswith("_db"):
        return abs(value - true) / 0.26
    return abs(value - true) / (allowed if name.startswith("linearity") else allowed * max(abs(true), 1e-30))
