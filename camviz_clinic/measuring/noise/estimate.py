"""A figure with its standard error, and with bounds for what rounding and clipping may hide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf, isfinite, isnan, nan, sqrt

PROMISE = 0.03  # of a figure: the truth is no further from it
CERTAIN = 4.0  # standard errors: beyond them chance takes the truth once in 16 000 times


@dataclass(frozen=True)
class Estimate:
    """A value, its standard error by chance, and between which values the truth lies, chance apart.

    `low` and `high` bound the truth as far as rounding, clipping and the distance between levels hide it; both are
    `value` where nothing is hidden. All four are in one unit.
    """

    value: float
    error: float
    low: float
    high: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Between which values the truth lies, chance included: four standard errors beyond `low` and `high`."""
        return self.low - CERTAIN * self.error, self.high + CERTAIN * self.error

    def within(self, promise: float, *, relative: bool = True) -> bool:
        """True where the truth is no further from `value` than `promise`, a fraction of it or in its unit."""
        low, high = self.bounds
        allowed = promise * abs(self.value) if relative else promise
        return isfinite(self.value) and high - self.value <= allowed and self.value - low <= allowed


UNKNOWN = Estimate(nan, nan, nan, nan)


def of(function: Callable[..., float], *parts: Estimate) -> Estimate:
    """What a function makes of independent estimates; it must be monotone in each of them.

    The standard errors go through its slopes, the bounds through its values at their corners.
    """
    values = [one.value for one in parts]
    value, variance = function(*values), 0.0
    for i, one in enumerate(parts):
        steps = [function(*values[:i], one.value + sign * one.error, *values[i + 1 :]) - value for sign in (-1, 1)]
        variance += max(step**2 for step in steps)
    ends = [value, *(function(*corner) for corner in product(*((one.low, one.high) for one in parts)))]
    known = not any(isnan(one) for one in ends)
    return Estimate(value, sqrt(variance), min(ends) if known else -inf, max(ends) if known else inf)


def combined(weights: Sequence[float], parts: Sequence[Estimate]) -> Estimate:
    """The weighted sum of estimates. One that occurs several times, as the same object, has its weights added first."""
    shared: dict[int, tuple[float, Estimate]] = {}
    for weight, one in zip(weights, parts, strict=True):
        shared[id(one)] = (shared.get(id(one), (0.0, one))[0] + float(weight), one)
    each = [(weight, one) for weight, one in shared.values() if weight]
    ends = [(weight * one.low, weight * one.high) for weight, one in each]
    return Estimate(
        sum(weight * one.value for weight, one in each),
        sqrt(sum((weight * one.error) ** 2 for weight, one in each)),
        sum(min(pair) for pair in ends),
        sum(max(pair) for pair in ends),
    )
