"""The fisheye of COLMAP and of ETH3D's cameras: equal angles first, then Brown-Conrady's polynomial of them."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, pi

import numpy as np
from numpy.polynomial import Polynomial

from camviz.lenses.base import Array, Fold, Lens, check_parameters
from camviz.lenses.brown_conrady import BrownConrady
from camviz.lenses.fisheye import Equidistant

_EQUIDISTANT = Equidistant()


@dataclass(frozen=True)
class ThinPrismFisheye(Lens):
    """COLMAP's and ETH3D's fisheye: equal angles first, then a polynomial of them.

    With (u, v) the image of an equidistant lens and θ² = u² + v²,

        x = u (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) + 2 p1 u v + p2 (θ² + 2 u²) + sx1 θ²
        y = v (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) + p1 (θ² + 2 v²) + 2 p2 u v + sy1 θ²

    as far as the polynomial does not fold on the way from the axis.

    Args:
        k1, k2, p1, p2, k3, k4, sx1, sy1: Coefficients of the angle θ in radians.

    Raises: ValueError for a coefficient that is not a finite number.
    Source: T. Schöps et al., *A multi-view stereo benchmark with high-resolution images and multi-camera videos*, CVPR
    (2017).

    >>> ThinPrismFisheye(k1=0.1).project([1, 0, 0]).round(4)  # θ = π/2: θ (1 + 0.1 θ²)
    array([1.9584, 0.    ])
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    sx1: float = 0.0
    sy1: float = 0.0

    def __post_init__(self) -> None:
        check_parameters(self)

    @cached_property
    def polynomial(self) -> BrownConrady:
        """What bends the image of the equidistant lens."""
        return _ThinPrismPolynomial(
            self.k1, self.k2, self.p1, self.p2, self.k3, s1=self.sx1, s3=self.sy1, eighth=self.k4
        )

    @property
    def can_fold(self) -> bool:
        return True

    @property
    def fold(self) -> Fold | None:
        """Where the polynomial of θ turns back; the angle is infinite where that is beyond straight behind."""
        fold = self.polynomial.fold
        return fold and replace(fold, angle=fold.radius if fold.radius < pi else inf, unit="rad")

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        return self.polynomial.bend(*_EQUIDISTANT.image(x, y, z))

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        u, v = self.polynomial.straighten(x, y)
        beyond = np.hypot(u, v) > pi
        u[beyond] = v[beyond] = np.nan
        return _EQUIDISTANT.ray(u, v)


@dataclass(frozen=True)
class _ThinPrismPolynomial(BrownConrady):
    """Brown-Conrady's with another radial term: `eighth` r⁸."""

    eighth: float = 0.0

    @cached_property
    def numerator(self) -> Polynomial:
        return Polynomial([1, self.k1, self.k2, self.k3, self.eighth])

    def _ratio(self, s: Array) -> Array:
        return 1 + s * (self.k1 + s * (self.k2 + s * (self.k3 + s * self.eighth)))

    def _ratio_slope(self, s: Array, ratio: Array) -> Array:
        return self.k1 + s * (2 * self.k2 + s * (3 * self.k3 + s * 4 * self.eighth))
