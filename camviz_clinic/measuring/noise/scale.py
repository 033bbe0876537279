"""The scale of a camera's digital numbers, and the statistics of a pair or a stack of frames on it.

The numbers have a step, and ends where the camera clips. Everything that rounding and clipping may hide is in the
bounds of the estimates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

from camviz_clinic.measuring.noise.ends import Ends
from camviz_clinic.measuring.noise.estimate import Estimate
from camviz_clinic.measuring.noise.hidden import (
    ROUNDING,
    before_rounding,
    clipped_bias,
    clipped_variance,
    missed_beyond,
    rounding_bias,
)
from camviz_clinic.measuring.noise.statistics import Pair, Part, Stack

CLIPPED = 0.005  # of the pixels at an end of the scale: beyond this share a level is left out of the fits
MISSED = 20.0  # values: with a mean of so many, none is seen beyond an end once in 5e8 times


@dataclass(frozen=True)
class Scale:
    """The camera's scale: the step between its numbers, and the numbers at which it clips."""

    step: float = 1.0
    floor: float = 0.0
    ceiling: float = inf

    @classmethod
    def of(cls, seen: Sequence[Pair | Stack], step: float, full: bool) -> Scale:
        """The scale of these frames. The ends are numbers beyond which noise must have carried some pixels.

        `full` says that the brightest frames are saturated: a number that half of their pixels have is the ceiling.
        """
        floor = max((one.ends.lowest for one in seen if _cut(one, one.ends.at_lowest, step)), default=0.0)
        tops = [one.ends.highest for one in seen if _cut(one, one.ends.at_highest, step)]
        tops += [one.ends.highest for one in seen if full and one.ends.at_highest > 0.5]
        highest = max(one.ends.highest for one in seen)
        return cls(step, max(floor, 0.0), highest if highest in tops else inf)

    def clipped(self, ends: Ends) -> tuple[float, float]:
        """The shares of pixels at the floor and at the ceiling."""
        below = ends.at_lowest if ends.lowest <= self.floor else 0.0
        return below, ends.at_highest if ends.highest >= self.ceiling else 0.0

    def kept(self, ends: Ends) -> float:
        """The least fraction of their variance that clipping leaves Gaussian noise, of frames with these ends."""
        below, above = self.clipped(ends)
        return clipped_variance(below) * clipped_variance(above)

    def noise(self, variance: float, error: float, ends: Ends) -> Estimate:
        """The temporal variance (DN²) before clipping, with the ROUNDING that a wide scale would add."""
        square, kept = self.step**2, self.kept(ends)
        low, high = before_rounding(variance / square, error / square)
        return Estimate(variance, error, square * low, square * high / kept if kept > 0 else inf)

    def moved(self, seen: Pair | Stack) -> float:
        """By how much rounding may move a pixel's mean, DN: half a step where there is no noise."""
        least, _ = before_rounding(seen.within / self.step**2)
        return self.step * rounding_bias(sqrt(max(least - ROUNDING, 0)))

    def mean(self, seen: Pair | Stack) -> Estimate:
        """The mean before rounding and clipping, DN."""
        below, above = self.clipped(seen.ends)
        kept = self.kept(seen.ends)
        spread = sqrt((seen.variance + max(seen.pattern, 0)) / kept) if kept > 0 else inf
        low, high = (spread * clipped_bias(share) if share > 0 else 0.0 for share in (below, above))
        moved = self.moved(seen)
        return Estimate(seen.mean, seen.mean_error, seen.mean - moved - low, seen.mean + moved + high)

    def pattern(self, seen: Pair | Stack, part: Part | None = None) -> Estimate:
        """The pattern's variance (DN²), or that of a part of it, before rounding and clipping.

        Clipping a share p leaves a pattern under Gaussian noise at least 1 - p of its deviation (the first term of the
        Hermite series of the clipped covariance). The other terms mix the parts, so that a part may be none at all.
        """
        if part:
            variance, error = max(part.variance, 0), part.error
        elif isinstance(seen, Stack):
            variance, error = seen.whole.variance, seen.whole.error
        else:
            variance, error = seen.pattern, seen.pattern_error
        lost, deviation, moved = sum(self.clipped(seen.ends)), sqrt(max(variance, 0)), self.moved(seen)
        high = ((deviation + moved) / (1 - lost)) ** 2 if lost < 1 else inf
        low = 0.0 if part and lost > CLIPPED else max(deviation - moved, 0) ** 2
        return Estimate(variance, error, min(low, variance), max(high, variance))


def _cut(seen: Pair | Stack, share: float, step: float) -> bool:
    """Whether this share of pixels at an end of the scale means that noise beyond it was cut off."""
    least, _ = before_rounding(seen.variance / step**2)
    return missed_beyond(share, sqrt(max(least - ROUNDING, 0)), seen.samples) > MISSED
