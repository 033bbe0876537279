"""The ends of the scale: the smallest and the largest digital number that frames hold, and how often."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Ends:
    """The smallest and the largest digital number of some frames, and which share of the pixels each of them has."""

    lowest: float = -inf
    highest: float = inf
    at_lowest: float = 0.0
    at_highest: float = 0.0

    @classmethod
    def of(cls, *frames: NDArray[Any]) -> Ends:
        """Those of frames of one shape."""
        lowest, highest = min(one.min() for one in frames), max(one.max() for one in frames)
        counts = [sum(int(np.count_nonzero(one == end)) for one in frames) for end in (lowest, highest)]
        size = len(frames) * frames[0].size
        return cls(float(lowest), float(highest), counts[0] / size, counts[1] / size)

    def joined(self, other: Ends, share: float) -> Ends:
        """Those of these frames and others, which are this share of all."""
        lowest, highest = min(self.lowest, other.lowest), max(self.highest, other.highest)
        parts = ((self, 1 - share), (other, share))
        at_lowest = sum(weight * one.at_lowest for one, weight in parts if one.lowest == lowest)
        at_highest = sum(weight * one.at_highest for one, weight in parts if one.highest == highest)
        return Ends(lowest, highest, at_lowest, at_highest)


ANY = Ends()
