"""The fisheye with a polynomial: what OpenCV's fisheye module, ROS and Kalibr call "equidistant"."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, pi, sqrt

import numpy as np

from camviz.lenses.arrays import AnglesLike
from camviz.lenses.base import Array, Fold, check_parameters
from camviz.lenses.fisheye import Equidistant, Fisheye
from camviz.lenses.folding import first_positive_root, solve_rising


@dataclass(frozen=True)
class KannalaBrandt(Fisheye):
    """r = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), as far as it rises.

    Args:
        k1, k2, k3, k4: Coefficients of the angle θ in radians; the image is in focal lengths.

    Raises: ValueError for a coefficient that is not a finite number.
    Source: J. Kannala & S. S. Brandt, *A generic camera model and calibration method for conventional, wide-angle, and
    fish-eye lenses*, IEEE PAMI 28 (2006), eq. 6.

    >>> lens = KannalaBrandt(k1=-0.1)  # it folds where its slope 1 - 0.3 θ² is 0
    >>> f"{np.degrees(lens.fold.angle):.1f}°"
    '104.6°'
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    plain = Equidistant

    def __post_init__(self) -> None:
        check_parameters(self)

    def radial(self, theta: AnglesLike) -> Array:
        """θ_d(θ), also beyond the fold.

        Returns: (...), distances from the image's centre in focal lengths.
        """
        theta = np.asarray(theta, dtype=float)
        s = theta * theta
        return theta * (1 + s * (self.k1 + s * (self.k2 + s * (self.k3 + s * self.k4))))

    def slope(self, theta: AnglesLike) -> Array:
        """The derivative θ_d'(θ); the lens folds where it reaches 0.

        Returns: (...), focal lengths per radian.
        """
        s = np.square(np.asarray(theta, dtype=float))
        return 1 + s * (3 * self.k1 + s * (5 * self.k2 + s * (7 * self.k3 + s * 9 * self.k4)))

    @cached_property
    def fold_angle(self) -> float:
        """The smallest positive root of θ_d', in radians, where the polynomial turns back; infinity if none."""
        return sqrt(first_positive_root(np.array([1, 3 * self.k1, 5 * self.k2, 7 * self.k3, 9 * self.k4])))

    @property
    def can_fold(self) -> bool:
        return True

    @property
    def fold(self) -> Fold | None:
        """Where θ_d turns back; the angle is infinite where that is beyond straight behind."""
        theta = self.fold_angle
        return Fold(theta, theta if theta < pi else inf, float(self.radial(theta)), "rad") if theta < inf else None

    @cached_property
    def max_angle(self) -> float:
        """The last angle in radians that still has an image of its own."""
        return min(self.fold_angle, pi)

    def angle(self, radius: Array) -> Array:
        return solve_rising(self.radial, self.slope, radius, *self._table)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        nodes = self.max_angle * np.sin(np.linspace(0, pi / 2, 513))  # denser towards the fold, where r(θ) is flat
        return nodes, np.maximum.accumulate(self.radial(nodes))
