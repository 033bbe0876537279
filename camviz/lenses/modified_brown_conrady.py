"""RealSense's polynomial: Brown and Conrady's, with tangential terms of the point that the radial ones have moved."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camviz.lenses.base import Array, Fold, Lens, check_parameters
from camviz.lenses.brown_conrady import BrownConrady
from camviz.lenses.folding import UNBOUNDED
from camviz.lenses.perspective import Perspective


@dataclass(frozen=True)
class ModifiedBrownConrady(Lens):
    """librealsense's modified and inverse Brown-Conrady, which are one equation.

    From the ideal (x, y) = (X/Z, Y/Z), with r² = x² + y², first to (a, b) = (x, y) (1 + k1 r² + k2 r⁴ + k3 r⁶), then to

        x' = a + 2 p1 a b + p2 (r² + 2 a²)
        y' = b + p1 (r² + 2 b²) + 2 p2 a b

    as far as this does not fold on the way from the axis. Brown and Conrady have x and y in place of the last a and b:
    with radial terms alone, or tangential ones alone, the two are one lens.

    Args:
        k1, k2, p1, p2, k3: Coefficients of lengths in focal lengths, in librealsense's order.

    Raises: ValueError for a coefficient that is not a finite number.
    Source: librealsense 2.56, src/rs.cpp, rs2_project_point_to_pixel: so for the inverse model too since August 2019.

    >>> ModifiedBrownConrady(k1=0.2, p2=0.1).project([0.5, 0, 1])  # a = 0.525: a + 0.1 (0.25 + 2 a²)
    array([0.605125, 0.      ])
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    plain = Perspective
    may_mirror = True

    def __post_init__(self) -> None:
        check_parameters(self)

    @cached_property
    def polynomial(self) -> BrownConrady:
        """What bends ideal points."""
        return _ModifiedPolynomial(self.k1, self.k2, self.p1, self.p2, self.k3)

    @property
    def is_distorted(self) -> bool:
        return self != type(self)()

    @property
    def can_fold(self) -> bool:
        return True

    @property
    def fold(self) -> Fold | None:
        """Where the radial part turns back."""
        return self.polynomial.fold

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        x, y = self.polynomial.image(x, y, z)
        near = np.maximum(np.abs(x), np.abs(y)) < UNBOUNDED
        return np.where(near, x, np.nan), np.where(near, y, np.nan)

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        return self.polynomial.ray(x, y)

    def project_unchecked(self, rays: Array) -> Array:
        return self.polynomial.project_unchecked(rays)


@dataclass(frozen=True)
class _ModifiedPolynomial(BrownConrady):
    """Brown-Conrady's with other tangential terms."""

    def _polynomial(self, x: Array, y: Array) -> tuple[Array, Array]:
        s = x * x + y * y
        ratio = self._ratio(s)
        a, b = x * ratio, y * ratio
        return (
            a + 2 * self.p1 * a * b + self.p2 * (s + 2 * a * a),
            b + 2 * self.p2 * a * b + self.p1 * (s + 2 * b * b),
        )

    def _bend_and_derivatives(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        s = x * x + y * y
        ratio = self._ratio(s)
        slope = 2 * self._ratio_slope(s, ratio)
        a, b, p1, p2 = x * ratio, y * ratio, self.p1, self.p2
        a_x, mixed, b_y = ratio + x * x * slope, x * y * slope, ratio + y * y * slope
        by_a, by_b = 1 + 2 * p1 * b + 4 * p2 * a, 1 + 2 * p2 * a + 4 * p1 * b
        return (
            *self._polynomial(x, y),
            a_x * by_a + 2 * p1 * a * mixed + 2 * p2 * x,
            mixed * by_a + 2 * p1 * a * b_y + 2 * p2 * y,
            mixed * by_b + 2 * p2 * b * a_x + 2 * p1 * x,
            b_y * by_b + 2 * p2 * b * mixed + 2 * p1 * y,
        )
