"""A profile across an edge: the cubic spline that fits the light of pixels at their distances best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from camviz.lenses.base import Array

SMOOTHNESS = 0.02  # of a knot interval's pixels: bridges places without pixels, and dims 0.6 cycles/pixel by 0.02 %
_IN_AN_INTERVAL = np.array([1, 11, 11, 1]) / 24  # the mean of the four cubic B-splines over one interval
_THIRD = np.array([-1.0, 3.0, -3.0, 1.0])


@dataclass(frozen=True, eq=False)
class EdgeProfile:
    """The cubic spline of equal steps through pixels' light at their distances from the edge, by least squares.

    Third differences of its coefficients are kept small, and so it bridges places at which no pixel lies, as a smooth
    curve would.

    Args:
        distance, light: (n,), of pixels; those beyond the reach are left out by the caller.
        reach: The spline goes from -reach to reach, pixels.
        step: Between its knots, pixels.
        block: (n,) of int, a number from 0 for each pixel; `without` fits all blocks but one.

    Source: P. H. C. Eilers and B. D. Marx, Flexible smoothing with B-splines and penalties, Statistical Science 11
    (1996).
    """

    distance: Array
    light: Array
    reach: float
    step: float
    block: Array

    @cached_property
    def intervals(self) -> int:
        return round(2 * self.reach / self.step)

    @cached_property
    def _basis(self) -> tuple[Array, Array]:
        """The first of the four splines that are not 0 at each pixel (n,), and their values (4, n)."""
        x = (self.distance + self.reach) / self.step
        first = np.clip(np.floor(x).astype(int), 0, self.intervals - 1)
        t = x - first
        return first, np.stack(
            [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]
        ) / 6  # fmt: skip

    @cached_property
    def _sums(self) -> tuple[Array, Array]:
        """By block: the normal matrix in bands (blocks, 4, coefficients), and the right side (blocks, coefficients)."""
        first, values = self._basis
        size, blocks = self.intervals + 3, int(self.block.max()) + 1
        at = self.block * size + first
        matrix, right = np.zeros((4, blocks * size)), np.zeros(blocks * size)
        for i in range(4):
            right += np.bincount(at + i, values[i] * self.light, blocks * size)
            for j in range(i, 4):
                matrix[j - i] += np.bincount(at + i, values[i] * values[j], blocks * size)
        return matrix.reshape(4, blocks, size).swapaxes(0, 1), right.reshape(blocks, size)

    @cached_property
    def _smooth(self) -> Array:
        size = self.intervals + 3
        bands = np.zeros((4, size))
        for lag in range(4):
            for i in range(4 - lag):
                bands[lag, i : i + size - 3] += _THIRD[i] * _THIRD[i + lag]
        return SMOOTHNESS * len(self.distance) / self.intervals * bands

    def _factor(self, matrix: Array) -> tuple[Array, bool]:
        return cholesky_banded(matrix + self._smooth, lower=True), True

    @cached_property
    def _whole(self) -> tuple[Array, bool]:
        return self._factor(self._sums[0].sum(axis=0))

    @cached_property
    def coefficients(self) -> Array:
        return np.asarray(cho_solve_banded(self._whole, self._sums[1].sum(axis=0)))

    @cached_property
    def places(self) -> Array:
        """The middles (intervals,) of the intervals between knots, pixels."""
        return np.asarray((np.arange(self.intervals) + 0.5) * self.step - self.reach, dtype=float)

    @cached_property
    def means(self) -> Array:
        """The mean light (intervals,) of the intervals between knots."""
        return np.asarray(np.convolve(self.coefficients, _IN_AN_INTERVAL, "valid"))

    @cached_property
    def counts(self) -> Array:
        """How many pixels (intervals,) each interval has."""
        return np.bincount(self._basis[0], minlength=self.intervals).astype(float)

    def without(self, block: int) -> Array:
        """The mean light (intervals,) of the intervals, of all pixels but those of one block."""
        matrices, right = self._sums
        factor = self._factor(matrices.sum(axis=0) - matrices[block])
        return np.convolve(cho_solve_banded(factor, right.sum(axis=0) - right[block]), _IN_AN_INTERVAL, "valid")

    @cached_property
    def residual(self) -> Array:
        """The light of each pixel less the curve at its distance (n,)."""
        first, values = self._basis
        return self.light - sum(values[i] * self.coefficients[first + i] for i in range(4))

    @cached_property
    def slope(self) -> Array:
        """The curve's derivative at each pixel (n,), per pixel."""
        first, _ = self._basis
        t = (self.distance + self.reach) / self.step - first
        values = np.stack([-((1 - t) ** 2), 3 * t**2 - 4 * t, -3 * t**2 + 2 * t + 1, t**2]) / 2
        return np.asarray(sum(values[i] * self.coefficients[first + i] for i in range(4))) / self.step

    def influence(self, weights: Array) -> Array:
        """How much a sum Σ weights · means (weights: intervals,) changes with the light of each pixel (n,)."""
        first, values = self._basis
        solved = cho_solve_banded(self._whole, np.convolve(weights, _IN_AN_INTERVAL))
        return np.asarray(sum(values[i] * solved[first + i] for i in range(4)))
