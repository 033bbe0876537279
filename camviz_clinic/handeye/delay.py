"""Whether a robot that does not stop tells where it was a little before or after each picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RotationSpline

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.motions import FEWEST, Motions
from camviz_clinic.calibration.motions_solving import start
from camviz_clinic.handeye.adjusting import Adjusted, robust
from camviz_clinic.handeye.mends import Indices

SURE = 4.0  # σ: what a delay must be away from zero
BETTER = 1.25  # times: what it must take off the poses' errors
REACH = 3.0  # rows to either side
STEPS = 2  # tries for a row
FEWEST_ROWS = 6


@dataclass(frozen=True)
class Delay:
    """How long after the time of each row its picture was taken, in seconds, with σ, and the errors without and with.

    The errors are medians over the poses, in metres.
    """

    seconds: float
    sigma: float
    without: float
    error: float

    @property
    def sure(self) -> bool:
        """Whether it is no accident.

        >>> Delay(0.04, 0.01, 0.00125, 0.001).sure, Delay(0.039, 0.01, 0.00125, 0.001).sure
        (True, False)
        >>> Delay(0.04, 0.01, 0.00124, 0.001).sure
        False
        """
        return abs(self.seconds) >= SURE * self.sigma and self.without >= BETTER * self.error


@dataclass(frozen=True, eq=False)
class Path:
    """A smooth path through a robot's poses."""

    times: Array
    base_from_hand: RigidTransform

    def at(self, times: Array) -> RigidTransform:
        """The poses at other times, which lie between the first and the last."""
        turns = RotationSpline(self.times, self.base_from_hand.rotation)(times)
        return RigidTransform.from_components(CubicSpline(self.times, self.base_from_hand.translation)(times), turns)


def delay(times: Array, rows: RigidTransform, seen: Indices, boards: RigidTransform, to_hand: bool) -> Delay | None:
    """The delay under which robot and pictures agree best; None where the times do not rise, or are too few.

    Every picture's board (`boards`, of the rows `seen`) is compared with the path through the robot's poses, a little
    later or earlier. The best of some delays is refined as one unknown more beside X and Z.
    """
    if len(seen) < FEWEST_ROWS or not (np.diff(times) > 0).all():
        return None
    path, row = Path(times, rows), float(np.median(np.diff(times)))

    def solved(late: float) -> tuple[Adjusted, Indices]:
        inside = np.flatnonzero((times[seen] + late >= times[0]) & (times[seen] + late <= times[-1]))
        motions = Motions.of(path.at(times[seen][inside] + late), boards[inside], to_hand)
        X, Z, _ = start(motions)
        return robust(motions, RigidTransform.from_matrix(X), RigidTransform.from_matrix(Z), rounds=3), inside

    def error(late: float) -> float:
        if np.sum((times[seen] + late >= times[0]) & (times[seen] + late <= times[-1])) < max(FEWEST, FEWEST_ROWS):
            return np.inf
        return float(np.median(solved(late)[0].displacements))

    tries = row * np.arange(-REACH * STEPS, REACH * STEPS + 1) / STEPS
    late = float(min(tries, key=error))
    sigma = np.inf
    for _ in range(3):
        best, inside = solved(late)
        speeds = _speeds(path, times[seen][inside] + late, 0.05 * row, to_hand)
        there = replace(best, also=(speeds,))
        step, sigma = float(there.step[12]), float(np.sqrt(there.covariance[12, 12]))
        late += float(np.clip(step, -row / STEPS, row / STEPS))
    return Delay(late, sigma, error(0.0), error(late))


def _speeds(path: Path, times: Array, step: float, to_hand: bool) -> Array:
    """The mount's twists per second (poses, 6), in its own frame."""
    inside = np.clip(times, path.times[0] + step, path.times[-1] - step)
    before, after = path.at(inside - step), path.at(inside + step)
    moved = before * after.inv() if to_hand else before.inv() * after
    return np.concatenate([moved.rotation.as_rotvec(), moved.translation], axis=-1) / (2 * step)
