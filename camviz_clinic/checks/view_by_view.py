"""What each view of a set by itself asks of the camera, and how far the views differ: tests with views as the units.

The corners of one view are not independent: the board bends as it is held, and blur and light are those of the view.
Views are far more so. What parts of a set differ by is held here against what views differ by, and not against the
noise of corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.types import Mask

SAME = 1e-9  # of a view's largest information: less is a direction that the view does not measure
PARTINGS = 500  # at random, among which a parting of the views is ranked


@dataclass(frozen=True, eq=False)
class ViewByView:
    """A solution, and every view's share in its normal equations with the view's own pose taken out.

    `information` (views, s, s) and `gradient` (views, s) are those of the s shared parameters, in the views that have
    a say. What is assumed of the lens beforehand is left out.
    """

    solved: Adjustment
    information: Array
    gradient: Array

    @classmethod
    def of(cls, solved: Adjustment) -> ViewByView:
        """The views of an adjustment at its least sum of squares."""
        return cls(solved, solved.by_view.information, solved.by_view.gradient)

    @cached_property
    def _apart(self) -> tuple[float, int]:
        """What parameters of its own for every view take off the sum of squares, and how many more they are."""
        fallen, counts = _fallen(self.information, self.gradient)
        return float(fallen.sum()), int(counts.sum()) - len(self.solved.parameters)

    @property
    def scatter(self) -> float:
        """How much more the views differ among each other than the noise within them lets expect, at least 1.

        Each view alone would ask for other parameters. Q is what that would take off the sum of squares S, for q more
        parameters: (Q/q) / ((S - Q)/(N - k - q)), Birge's ratio squared (Birge 1932, Phys. Rev. 40, 207). Real corners
        are not independent; a covariance times this ratio is that of the scatter from view to view.
        """
        gain, more = self._apart
        left = self.solved.measurements - self.solved.unknowns - more
        if more < 1 or left < 1:
            return 1.0
        return max(1.0, (gain / more) / (max(self.solved.sum_of_squares - gain, np.finfo(float).tiny) / left))

    @property
    def chance_of_scatter(self) -> float:
        """How often the noise of independent corners gives views that differ so: the F-test of `scatter`."""
        gain, more = self._apart
        left = self.solved.measurements - self.solved.unknowns - more
        if more < 1 or left < 1:
            return 1.0
        noise = max(self.solved.sum_of_squares - gain, np.finfo(float).tiny) / left
        return float(fdtrc(more, left, gain / more / noise))

    def chance(self, first: Mask) -> float:
        """How often views that differ by chance, as much as these do within the two parts, differ so between them.

        That is the F-test of a nested analysis of variance, of n views and s parameters: what s more parameters for
        one part take off the sum of squares, over what (n - 2) s more take off for every view its own.
        """
        between, count = self._between(first[None])
        gain, more = self._apart
        left = more - int(count[0])
        if count[0] < 1 or left < 1:
            return 1.0
        within = max(gain - between[0], np.finfo(float).tiny) / left
        return float(fdtrc(count[0], left, max(between[0], 0.0) / count[0] / within))

    def larger(self, first: Mask) -> float:
        """The share of other partings of the views, into as many and at random, between which they differ more.

        A permutation test (Fisher 1935, The Design of Experiments): it holds however the views scatter.
        """
        rng = np.random.default_rng(0)
        others = np.array([rng.permutation(first) for _ in range(PARTINGS)])
        between, _ = self._between(np.concatenate([first[None], others]))
        return float(np.mean(between[1:] > between[0] * (1 + 1e-9)))

    def _between(self, masks: Mask) -> tuple[Array, Array]:
        """What two cameras, one for the views of each mask (m, views) and one for the rest, take off the squares."""
        parts = [
            _fallen(np.einsum("mv,vst->mst", part, self.information), part @ self.gradient)
            for part in (masks.astype(float), (~masks).astype(float))
        ]
        together, count = _fallen(self.information.sum(axis=0), self.gradient.sum(axis=0))
        return sum(fallen for fallen, _ in parts) - together, sum(counts for _, counts in parts) - count


def _fallen(information: Array, gradient: Array) -> tuple[Array, Array]:
    """What solving for parameters takes off the sum of squares, gᵀ H⁻¹ g (...,), and how many are determined."""
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / (scale[..., :, None] * scale[..., None, :]))
    known = values > SAME * values[..., -1:]
    along = np.einsum("...ij,...i->...j", vectors, gradient / scale)
    return np.sum(np.where(known, along**2 / np.where(known, values, 1), 0), axis=-1), known.sum(axis=-1)
