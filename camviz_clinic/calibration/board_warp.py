"""Whether the board was flat: an F-test of two more parameters, its sagittas."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment


@dataclass(frozen=True, eq=False)
class WarpTest:
    """The solutions with a flat board and with a bent one, and the F-test between them.

    `probability` is how often a flat board and Gaussian noise give a statistic as large as this one.
    """

    flat: Adjustment
    bent: Adjustment
    statistic: float
    probability: float

    @property
    def warp_mm(self) -> Array:
        """The two sagittas (2,) in millimetres, along the rows and along the columns of corners (`Board.warped`)."""
        return 1000 * np.asarray(self.bent.warp)

    @property
    def deviation_mm(self) -> Array:
        """The standard deviations (2,) of the two sagittas in millimetres."""
        return 1000 * np.sqrt(np.diag(self.bent.covariance)[-2:])

    @property
    def bend_mm(self) -> float:
        """From the lowest to the highest corner above the plane that fits them best, in millimetres."""
        corners = self.bent.corners
        plane = np.column_stack([corners[:, :2], np.ones(len(corners))])
        off = corners[:, 2] - plane @ np.linalg.lstsq(plane, corners[:, 2], rcond=None)[0]
        return float(1000 * np.ptp(off))

    def bowed(self, false_alarms: float = 1e-3) -> bool:
        """Whether the board is bent; true of a share `false_alarms` of flat boards."""
        return self.probability < false_alarms


def warp_test(adjustment: Adjustment) -> WarpTest:
    """Solves anew with a flat and with a bent board.

    With the sums of squares S₀ and S₁ and N - k measurements to spare in the bent solution,
    F = ((S₀ - S₁)/2) / (S₁/(N - k)) is distributed as F(2, N - k) when the board is flat. Raises ValueError where there
    are no measurements to spare.
    """
    flat = replace(adjustment, warp=None).refined()
    bent = replace(flat, warp=np.zeros(2) if adjustment.warp is None else adjustment.warp).refined()
    spare = bent.measurements - bent.unknowns
    if spare < 1:
        raise ValueError(f"more than {bent.unknowns} measurements are needed, got {bent.measurements}")
    statistic = (flat.sum_of_squares - bent.sum_of_squares) / 2 / (bent.sum_of_squares / spare)
    return WarpTest(flat, bent, statistic, float(fdtrc(2, spare, max(statistic, 0.0))))
