"""Whether the board was flat: F-tests of two more parameters, its sagittas, over corners and over views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.special import fdtrc

from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.cross_validation import held_out_rms
from camviz_clinic.calibration.linearisation import FEWEST_FOR_A_BEND
from camviz_clinic.calibration.regularisation import regularised

BOARD_WARP = ("off", "auto", "on")  # solved for never, where it earns its place, always
FALSE_ALARMS = 0.01  # the share of flat boards of which the views alone would say that they are bent
CERTAIN = 1e-3  # where so few flat boards have views that agree like that, no held-out views are asked
FOLDS = 5
Solution = TypeVar("Solution", bound=Adjustment)


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
        return 1000 * np.sqrt(np.diag(self.bent.clustered_covariance)[-2:])

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


def probability_by_views(adjustment: Adjustment) -> float:
    """How often the views of a flat board agree on a bend as clearly as these do.

    The corners of a view are off together, so that views are the independent samples and not corners. With the two
    sagittas w and their covariance V by the scatter of n views, F = wᵀ V⁻¹ w (n - 2)/(2 (n - 1)) is distributed as
    F(2, n - 2) when the board is flat. It takes one step to the least sum of squares, from a flat board or a bent one.
    1 with fewer than six views that have a say. Source: Hotelling (1931), "The generalization of Student's ratio".
    """
    views = int(adjustment.posed.sum())
    if views < FEWEST_FOR_A_BEND:
        return 1.0
    statistic = adjustment.bend_statistic * (views - 2) / (2 * (views - 1))
    return float(fdtrc(2, views - 2, statistic)) if np.isfinite(statistic) else 1.0


def earns_its_place(flat: Adjustment) -> bool:
    """Whether a bend of the board is to be solved for, beside a solution with a flat one.

    The views must agree on a bend as those of one flat board in a thousand would; or of one in a hundred, and then the
    bend must foretell the corners of views that were held out better than a flat board does. That error depends on how
    the views are dealt into folds, by more than a small bend changes it: where the views are certain, it is not asked.
    """
    if not probability_by_views(flat) < FALSE_ALARMS:
        return False
    try:
        bent = regularised(replace(flat, warp=np.zeros(2)))
        chance = max(probability_by_views(flat), probability_by_views(bent))
        return chance < CERTAIN or (chance < FALSE_ALARMS and held_out_rms(bent, FOLDS) < held_out_rms(flat, FOLDS))
    except (ValueError, np.linalg.LinAlgError):  # fewer views give no camera, or one that folds at a corner
        return False


def check_board_warp(word: str) -> None:
    """Raises ValueError for what is none of BOARD_WARP."""
    if word not in BOARD_WARP:
        raise ValueError(f"board_warp must be one of {', '.join(BOARD_WARP)}, got {word!r}")


def with_board_warp(flat: Solution, board_warp: str, settled: Callable[[Solution], Solution]) -> Solution:
    """The solution with a bent board, always or where it earns its place, found by `settled`; else `flat` as it is."""
    wanted = board_warp == "on" or (board_warp == "auto" and earns_its_place(flat))
    return settled(replace(flat, warp=np.zeros(2))) if wanted else flat
