"""Intrinsics that corners leave undecided together: what `identifiability` finds, and a calibration keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from camviz.lenses.base import Array


@dataclass(frozen=True, eq=False)
class Undecided:
    """Intrinsics that may change together, the boards' poses following, while hardly a corner moves.

    `changes` says by how much each one changes, by its name and in its own unit, where together they would shift the
    picture by 1 % of its longer side were the poses held (root of the sum of squares of what each does alone, RMS over
    the picture). No corner then moves by more than `most` pixels; NaN where no corners are known. One standard
    deviation of the combination is `deviation` times as much; `direction` (n,) is the change of all `names`.
    """

    names: tuple[str, ...]
    direction: Array
    changes: Mapping[str, float]
    most: float
    deviation: float
