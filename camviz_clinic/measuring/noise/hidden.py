"""How much noise rounding to whole numbers and a clipped black or white level can hide.

A digital number tells the voltage to within half a step, and the smallest and largest ones not even that. From the
frames alone follows between which values the noise was before (EMVA 1288 release 4.0, sections 4.3
and 6.5, which stops at σ²_y.dark = 0.24 DN²: below it the noise of rounding depends on where between two numbers the
mean lies).
"""

from __future__ import annotations

from functools import lru_cache
from math import exp, pi, sqrt
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORMAL = NormalDist()
ROUNDING = 1 / 12  # of a step²: the variance that rounding adds to noise that is spread over several steps
QUANTISED = 0.24  # of a step²: below this variance the standard takes the noise to be hidden by rounding
_SIGMAS = np.arange(0.0, 1.3, 0.005)


def before_rounding(variance: float, error: float = 0.0) -> tuple[float, float]:
    """Between which values σ² + 1/12 was, steps², where rounded noise has the variance given ± four times `error`.

    σ² + 1/12 is what rounding makes of the analogue variance σ² where the mean falls anywhere between two numbers.
    Rounded noise has the least variance where the mean is a whole number, and the most where it is half way.
    """
    least, most = _rounded()
    error = max(error, 1e-4)  # of frames in which no number differs, which some thousand pixels do not exclude
    low, high = variance - 4 * error, variance + 4 * error
    if low > least[-1]:
        return variance, variance
    smallest = float(np.interp(low, most, _SIGMAS, left=0.0))
    largest = float(np.interp(high, least, _SIGMAS, right=sqrt(max(high - ROUNDING, 0))))
    return min(smallest**2 + ROUNDING, variance), max(largest**2 + ROUNDING, variance)


@lru_cache(maxsize=1)
def _rounded() -> tuple[Array, Array]:
    """The variance of rounded Gaussian noise of `_SIGMAS`, at a mean of 0 and of ½."""
    return tuple(np.maximum.accumulate([_rounded_variance(s, mean) for s in _SIGMAS]) for mean in (0.0, 0.5))  # type: ignore[return-value]


def _rounded_variance(sigma: float, mean: float) -> float:
    """The variance of whole numbers nearest to Gaussian noise, in the limit where sigma is 0."""
    edges = np.arange(-8, 10) - 0.5 - mean
    below = [NORMAL.cdf(edge / max(sigma, 1e-9)) for edge in edges]
    chances, numbers = np.diff(below), np.arange(-8, 9)
    return float(np.sum(chances * numbers**2) - np.sum(chances * numbers) ** 2)


def rounding_bias(sigma: float) -> float:
    """By how much rounding moves the mean of Gaussian noise at most, in steps: (1/π) Σ exp(-2π²k²σ²) / k, up to ½."""
    return min(0.5, sum(exp(-2 * (pi * k * sigma) ** 2) / (pi * k) for k in range(1, 9)))


def clipped_variance(share: float) -> float:
    """Which fraction of its variance Gaussian noise keeps where this share of it is clipped at one end."""
    if share <= 0:
        return 1.0
    if share >= 1:
        return 0.0
    z = NORMAL.inv_cdf(share)
    mean = clipped_bias(share)
    square = z * z * share + (1 - share) + z * NORMAL.pdf(z)
    return max(square - mean * mean, 0.0)


def clipped_bias(share: float) -> float:
    """By how many standard deviations clipping this share at one end moves the mean of Gaussian noise."""
    if share <= 0:
        return 0.0
    if share >= 1:
        return float("inf")
    z = NORMAL.inv_cdf(share)
    return max(z * share + NORMAL.pdf(z), 0.0)


def missed_beyond(share: float, deviation: float, count: int) -> float:
    """How many of `count` values must lie beyond an end at which this share of them lies, if nothing clips them there.

    `deviation` is that of Gaussian noise in steps, which any fixed pattern only widens: at least
    count · Φ(Φ⁻¹(share) - 1/σ) of the values that would be rounded to the end, or pass it, pass it by a step.
    """
    if not 0 < share < 1 or deviation <= 0:
        return 0.0
    return count * NORMAL.cdf(NORMAL.inv_cdf(share) - 1 / deviation)
