"""What pixels of a frame share with those beside them: noise after smoothing, and light that falls across the picture.

The model of EMVA Standard 1288 knows pixels of independent noise under even light, with rows and columns of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

Array = NDArray[np.float64]

LAGS = ((0, 1), (1, 0), (1, 1), (1, -1), (0, 2), (2, 0))  # rows down, columns to the right
DEGREE = 4  # of polynomials across the picture: what they follow is smooth
LEAST = 4 * DEGREE  # pixels on a side: of smaller frames nothing smooth is told
BY_CHANCE = 1e-7  # how often white patterns are taken for a smooth one


@dataclass(frozen=True)
class Shared:
    """The covariance (DN²) of the noise of a pixel and that of another one, and its standard error if there is none."""

    covariance: float
    error: float


def shared_by_neighbours(difference: Array) -> tuple[tuple[Shared, ...], float]:
    """What pixels at each of `LAGS` share of one frame's noise, and the kurtosis of the noise.

    `difference` (height, width) is that of two frames; what its rows and columns share is taken out. That alone makes
    neighbours differ, by -1/height or -1/width of their variance, which is put back. The error grows where noise is
    large in some rows or columns only.
    """
    rows, columns = difference.shape
    means = difference.mean(axis=1, keepdims=True) + difference.mean(axis=0) - difference.mean()
    padded = np.zeros((rows, columns + 2))  # so that a step to the right of the last column meets 0
    padded[:, :columns] = difference - means
    noise = padded.ravel()
    square = noise * noise
    variance, fourth = float(square.sum()) / difference.size, float(square @ square) / difference.size
    if variance == 0:
        return tuple(Shared(0.0, 0.0) for _ in LAGS), 3.0
    uneven = max(1.0, *(_product(square, step, columns) / difference.size / variance**2 for step in LAGS[:2]))
    freed = variance / ((1 - 1 / rows) * (1 - 1 / columns)) if min(rows, columns) > 1 else variance
    found = []
    for down, right in LAGS:
        count = max((rows - down) * (columns - abs(right)), 1)
        taken = freed * ((down == 0) - 1 / rows) * ((right == 0) - 1 / columns)
        covariance = _product(noise, (down, right), columns) / count - taken
        found.append(Shared(covariance / 2, variance * sqrt(uneven / count) / 2))
    return tuple(found), fourth / variance**2


def _product(values: Array, step: tuple[int, int], columns: int) -> float:
    """Σ of the products of values that are a step apart, of rows that are padded by two zeros."""
    shift = step[0] * (columns + 2) + step[1]
    return float(values[:-shift] @ values[shift:])


@dataclass(frozen=True)
class Shading:
    """The smooth part of a picture: amplitudes (DN) of polynomials down the rows, along the columns and of both.

    Each polynomial has mean square 1, so that its amplitude's square is the variance it brings. `chances` are the mean
    squares that amplitudes of the three kinds would have if the pattern were white. Nothing is known of small frames.
    """

    down: tuple[float, ...] = ()
    across: tuple[float, ...] = ()
    both: tuple[float, ...] = ()
    chances: tuple[float, float, float] = (0.0, 0.0, 0.0)
    freedoms: tuple[int, int, int] = (0, 0, 0)

    @classmethod
    def of(cls, picture: Array) -> Shading:
        """That of a picture (height, width)."""
        rows, columns = picture.shape
        if min(rows, columns) < LEAST:
            return cls()
        upright, level = _polynomials(rows), _polynomials(columns)
        of_rows, of_columns = picture.mean(axis=1), picture.mean(axis=0)
        down, across = upright @ of_rows / rows, level @ of_columns / columns
        both = upright @ picture @ level.T / picture.size
        freedoms = (rows - 1 - DEGREE, columns - 1 - DEGREE, (rows - 1) * (columns - 1) - DEGREE**2)
        wholes = [float(of_rows.var()), float(of_columns.var())]
        wholes.append(max(float(picture.var()) - sum(wholes), 0.0))
        parts = zip(wholes, (down, across, both), freedoms, strict=True)
        r, s, t = (max(whole - float(np.sum(one**2)), 0.0) / freedom for whole, one, freedom in parts)
        a, b, c = (tuple(one.ravel().tolist()) for one in (down, across, both))
        return cls(a, b, c, (r, s, t), freedoms)

    def less(self, other: Shading) -> Shading:
        """That of the difference of two pictures."""
        if not (self.down and other.down):
            return Shading()
        down, across, both = (
            tuple(one - two for one, two in zip(ours, theirs, strict=True))
            for ours, theirs in zip(self._kinds, other._kinds, strict=True)
        )
        a, b, c = (one + two for one, two in zip(self.chances, other.chances, strict=True))
        return Shading(down, across, both, (a, b, c), self.freedoms)

    @property
    def _kinds(self) -> tuple[tuple[float, ...], ...]:
        return self.down, self.across, self.both

    def variances(self) -> tuple[float, float, float]:
        """The variances (DN²) that the smooth parts down, across and of both bring; 0 where chance may have made it."""
        a, b, c = (self._variance(kind) for kind in range(3))
        return a, b, c

    def _variance(self, kind: int) -> float:
        amplitudes, chance, freedom = self._kinds[kind], self.chances[kind], self.freedoms[kind]
        brought = sum(one**2 for one in amplitudes)
        if brought == 0 or freedom < 1:
            return 0.0
        ratio = brought / len(amplitudes) / max(chance, 1e-30)
        return brought if fdtrc(len(amplitudes), freedom, ratio) < BY_CHANCE else 0.0

    def extremes(self) -> tuple[float, float]:
        """The lowest and the highest value (DN) of the smooth part about its mean; 0 where there is none."""
        sure = [np.array(one) * (variance > 0) for one, variance in zip(self._kinds, self.variances(), strict=True)]
        if not self.down:
            return 0.0, 0.0
        upright, level = (_polynomials(freedom + 1 + DEGREE) for freedom in self.freedoms[:2])
        surface = (sure[0] @ upright)[:, None] + sure[1] @ level + upright.T @ sure[2].reshape(DEGREE, DEGREE) @ level
        return float(surface.min()), float(surface.max())


UNSHADED = Shading()


@lru_cache(maxsize=8)
def _polynomials(count: int) -> Array:
    """Orthogonal polynomials of degrees 1 … `DEGREE` at `count` places (DEGREE, count), of mean square 1."""
    powers = np.vander(np.linspace(-1, 1, count), DEGREE + 1, increasing=True)
    orthogonal, upper = np.linalg.qr(powers)
    return np.asarray((orthogonal * np.sign(np.diag(upper)) * np.sqrt(count)).T[1:])
