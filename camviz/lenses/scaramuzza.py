"""OCamCalib's lens: a polynomial that says how far forward the ray of an image point goes."""

from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, Fold, check_parameters, check_range, up_to
from camviz.lenses.fisheye import Fisheye
from camviz.lenses.folding import first_positive_root, solve_rising

FARTHEST = 1e4  # focal lengths: no sensor reaches out to there


@dataclass(frozen=True)
class Scaramuzza(Fisheye):
    """The ray of (x, y) is (x, y, 1 + a2 r² + a3 r³ + … + a6 r⁶) with r = ‖(x, y)‖: OCamCalib's lens.

    The image is then stretched: (x + e y, d x + c y). OCamCalib's polynomial f(ρ) = s0 + s2 ρ² + … of pixels, whose z
    points backward, is that of focal length -s0 and a_k = -s_k (-s0)^(k-1); its x goes down and its y to the right.

    Args:
        a2, a3, a4, a5, a6: Coefficients of the radius in focal lengths.
        c, d, e: The stretch; 1, 0 and 0 for none.

    Raises: ValueError for a coefficient that is not a finite number, and for a stretch whose c - d e is not positive.
    Source: D. Scaramuzza, A. Martinelli & R. Siegwart, *A toolbox for easily calibrating omnidirectional cameras*, IROS
    (2006).

    >>> Scaramuzza(a2=-0.25).unproject([2, 0]).round(6)  # 1 - 0.25 · 2² = 0: to the side
    array([1., 0., 0.])
    """

    a2: float = 0.0
    a3: float = 0.0
    a4: float = 0.0
    a5: float = 0.0
    a6: float = 0.0
    c: float = 1.0
    d: float = 0.0
    e: float = 0.0

    def __post_init__(self) -> None:
        check_parameters(self)
        check_range("c", self.c, self.c - self.d * self.e > 0, "such that c - d e is positive")

    @cached_property
    def forward(self) -> Array:
        """The coefficients of the polynomial, from the constant one on."""
        return np.array([1.0, 0.0, self.a2, self.a3, self.a4, self.a5, self.a6])

    @cached_property
    def fold_radius(self) -> float:
        """Where the angle stops growing with r: the first root of g - r g' = 1 - a2 r² - 2 a3 r³ - …; or infinity."""
        return first_positive_root(self.forward * (1 - np.arange(7)))

    @property
    def can_fold(self) -> bool:
        return True

    @property
    def fold(self) -> Fold | None:
        radius = self.fold_radius
        return Fold(radius, self.max_angle, radius) if radius < inf else None

    @property
    def rim(self) -> float:
        """The radius of the last image, before it is stretched, in focal lengths."""
        return min(self.fold_radius, FARTHEST)

    @cached_property
    def max_angle(self) -> float:
        return float(self.angle(np.array(self.rim)))

    def radial(self, theta: ArrayLike) -> Array:
        half = np.tan(np.asarray(theta, dtype=float) / 2)
        return self._radius(half.ravel()).reshape(half.shape)

    def angle(self, radius: Array) -> Array:
        return np.arctan2(radius, np.polynomial.polynomial.polyval(radius, self.forward))

    def slope(self, radius: Array) -> Array:
        """The derivative of `angle`, (g - r g') / (r² + g²).

        Args:
            radius: (...), radii in focal lengths.

        Returns: (...), radians per focal length.
        """
        ahead = np.polynomial.polynomial.polyval(radius, self.forward)
        rising = np.polynomial.polynomial.polyval(radius, self.forward * (1 - np.arange(7)))
        return rising / (radius * radius + ahead * ahead)

    # t = tan(θ/2) grows without end where θ comes to rest at π, so that no digit is lost there.

    def _half(self, radius: Array) -> Array:
        ahead = np.polynomial.polynomial.polyval(radius, self.forward)
        length = np.hypot(radius, ahead)
        return np.where(ahead > 0, radius / (length + ahead), (length - ahead) / radius)

    def _half_slope(self, radius: Array) -> Array:
        return self.slope(radius) * (1 + self._half(radius) ** 2) / 2

    def _radius(self, half: Array) -> Array:
        return solve_rising(self._half, self._half_slope, half, *self._table)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        if self.fold_radius < FARTHEST:
            nodes = self.fold_radius * np.sin(np.linspace(0, np.pi / 2, 513))  # denser towards the fold
        else:
            nodes = np.sinh(np.linspace(0, np.arcsinh(FARTHEST), 513))
        return nodes, np.maximum.accumulate(self._half(nodes))

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        off_axis = np.hypot(x, y)
        distance = np.hypot(off_axis, z)
        scale = self._radius(np.where(z > 0, off_axis / (distance + z), (distance - z) / off_axis)) / off_axis
        scale[(off_axis == 0) & (z > 0)] = 1
        x, y = x * scale, y * scale
        return x + self.e * y, self.d * x + self.c * y

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        area = self.c - self.d * self.e
        x, y = (self.c * x - self.e * y) / area, (y - self.d * x) / area
        z = np.polynomial.polynomial.polyval(up_to(self.rim, np.hypot(x, y)), self.forward)
        return x, y, np.asarray(z, dtype=np.float64)
