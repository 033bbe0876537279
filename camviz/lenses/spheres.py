"""Lenses by way of a sphere: one formula from the pinhole to mirrors and fisheyes that look behind themselves."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import atan2, inf, isfinite, sqrt

import numpy as np
from numpy.polynomial import Polynomial

from camviz.lenses.base import NO_DENOMINATOR, ROUNDING, Array, Fold, Lens, check_parameters, check_range
from camviz.lenses.brown_conrady import BrownConrady


@dataclass(frozen=True)
class UnifiedSphere(Lens):
    """(x, y) = (X, Y) / (Z + ξ D) with D = ‖(X, Y, Z)‖, then distorted by k1 k2 p1 p2.

    The point goes to the unit sphere and is seen from ξ behind its centre: ξ = 0 is a pinhole, ξ = 1 the stereographic
    projection at half its focal length and the parabolic mirror. The same lens written with α has ξ = α/(1 - α) and the
    focal length f = γ (1 - α): see `from_alpha`.

    Args:
        xi: ξ, at least 0.
        k1, k2, p1, p2: Coefficients of `BrownConrady`.

    Raises: ValueError for a ξ below 0, and for a parameter that is not a finite number.
    Source: C. Mei & P. Rives, *Single view point omnidirectional camera calibration from planar grids*, ICRA (2007),
    sec. II.B. With α: V. Usenko, N. Demmel & D. Cremers, *The double sphere camera model*, 3DV (2018), sec. 3.1.

    >>> UnifiedSphere(xi=1).project([3, 0, 4])  # 3 / (4 + 5)
    array([0.33333333, 0.        ])
    """

    xi: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    def __post_init__(self) -> None:
        check_parameters(self)
        check_range("xi", self.xi, self.xi >= 0, "at least 0")

    @classmethod
    def from_alpha(cls, alpha: float) -> "UnifiedSphere":
        """The lens written with α: ξ = α/(1 - α).

        Its focal lengths are γ = f/(1 - α): the intrinsics must be divided as well.

        Args:
            alpha: At least 0 and below 1.

        Returns: UnifiedSphere without distortion.
        Raises: ValueError for another α.

        >>> UnifiedSphere.from_alpha(0.5).xi
        1.0
        """
        check_range("alpha", alpha, 0 <= alpha < 1, "at least 0 and below 1")
        return cls(alpha / (1 - alpha))

    @cached_property
    def distortion(self) -> BrownConrady | None:
        """The polynomial that acts on (x, y) afterwards; None where it does nothing."""
        coefficients = (self.k1, self.k2, self.p1, self.p2)
        return BrownConrady(*coefficients) if any(coefficients) else None

    @property
    def is_distorted(self) -> bool:
        return self != UnifiedSphere(0.0)

    def same_as(self) -> Iterator[tuple[Lens, float]]:
        if not self.distortion:  # α = ξ/(1 + ξ), f = γ/(1 + ξ)
            yield ExtendedUnified(self.xi / (1 + self.xi), 1.0), 1 / (1 + self.xi)

    @property
    def can_fold(self) -> bool:
        return self.distortion is not None

    @property
    def fold(self) -> Fold | None:
        """Where the polynomial turns back; the angle is infinite where the sphere shows no ray there."""
        fold = self.distortion.fold if self.distortion else None
        if fold is None:
            return None
        x, _, z = UnifiedSphere(self.xi).unproject([min(fold.radius, 1e9), 0.0])
        return replace(fold, angle=atan2(x, z) if isfinite(z) else inf)

    @property
    def denominator(self) -> Polynomial:
        return self.distortion.denominator if self.distortion else NO_DENOMINATOR

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        depth = _seen_depth(self.xi, x * x + y * y, 1.0, z)
        x, y = x / depth, y / depth
        return self.distortion.bend(x, y) if self.distortion else (x, y)

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        if self.distortion:
            x, y = self.distortion.straighten(x, y)
        r2 = x * x + y * y
        # η (x, y, 1) - (0, 0, ξ) lies on the sphere
        eta = (self.xi + _root(1 + (1 - self.xi**2) * r2)) / (1 + r2)
        return eta * x, eta * y, eta - self.xi


@dataclass(frozen=True)
class ExtendedUnified(Lens):
    """(x, y) = (X, Y) / (α D + (1 - α) Z) with D² = β (X² + Y²) + Z²: an ellipsoid in place of the sphere.

    Args:
        alpha: α, between 0 and 1.
        beta: β, above 0.

    Raises: ValueError for an α or a β outside its range.
    Source: B. Khomutenko, G. Garcia & P. Martinet, *An enhanced unified camera model*, IEEE RA-L 1 (2016), eq. 11.

    >>> ExtendedUnified(alpha=0.5, beta=1).project([3, 0, 4])  # 3 / (0.5 · 5 + 0.5 · 4)
    array([0.66666667, 0.        ])
    """

    alpha: float
    beta: float

    def __post_init__(self) -> None:
        check_parameters(self)
        check_range("alpha", self.alpha, 0 <= self.alpha <= 1, "between 0 and 1")
        check_range("beta", self.beta, self.beta > 0, "positive")

    def same_as(self) -> Iterator[tuple[Lens, float]]:
        if self.beta == 1 and self.alpha < 1:
            yield UnifiedSphere.from_alpha(self.alpha), 1 / (1 - self.alpha)

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        depth = _seen_depth(self.alpha, self.beta * (x * x + y * y), 1 - self.alpha, z)
        return x / depth, y / depth

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        return x, y, _depth(self.alpha, self.beta * (x * x + y * y))


@dataclass(frozen=True)
class DoubleSphere(Lens):
    """(x, y) = (X, Y) / (α D₂ + (1 - α) (ξ D₁ + Z)).

    D₁ = ‖(X, Y, Z)‖ and D₂ = ‖(X, Y, ξ D₁ + Z)‖: onto one sphere, then onto another, ξ further on.

    Args:
        xi: ξ, above -1 and at most 1.
        alpha: α, between 0 and 1.

    Raises: ValueError for a ξ or an α outside its range.
    Source: V. Usenko, N. Demmel & D. Cremers, *The double sphere camera model*, 3DV (2018), eq. 40-45.

    >>> DoubleSphere(xi=0, alpha=0.5).project([3, 0, 4])  # with ξ = 0 one sphere: 3 / (0.5 · 5 + 0.5 · 4)
    array([0.66666667, 0.        ])
    """

    xi: float
    alpha: float

    def __post_init__(self) -> None:
        check_parameters(self)
        check_range("xi", self.xi, -1 < self.xi <= 1, "above -1 and at most 1")
        check_range("alpha", self.alpha, 0 <= self.alpha <= 1, "between 0 and 1")

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        r2 = x * x + y * y
        shifted = _sum(self.xi, r2, 1.0, z)
        depth = _seen_depth(self.alpha, r2, 1 - self.alpha, shifted)
        depth[~self._in_half_space(z, np.sqrt(r2 + z * z))] = np.nan
        return x / depth, y / depth

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        r2 = x * x + y * y
        shifted = _depth(self.alpha, r2)
        scale = (shifted * self.xi + np.sqrt(shifted**2 + (1 - self.xi**2) * r2)) / (shifted**2 + r2)
        z = scale * shifted - self.xi
        seen = self._in_half_space(z, 1.0) & np.isfinite(_seen_depth(self.alpha, r2, 1 - self.alpha, shifted))
        return scale * x, scale * y, np.where(seen, z, np.nan)

    def _in_half_space(self, z: Array, distance: Array | float) -> np.ndarray:
        """The published half-space (eq. 43); for ξ < 0 it holds rays that have no image, too."""
        w1 = min(_xi(self.alpha), 1 / _xi(self.alpha)) if self.alpha else 0.0
        w2 = (w1 + self.xi) / sqrt(2 * w1 * self.xi + self.xi**2 + 1)
        return z > -(w2 + ROUNDING) * distance


def _xi(alpha: float) -> float:
    return alpha / (1 - alpha) if alpha < 1 else inf


def _sum(weight: float, r2: Array, share: float, z: Array) -> Array:
    """a D + b Z of weight a and share b, with D² = r² + Z².

    Where the two have opposite signs it is (a² r² + (a² - b²) Z²) / (a D - b Z), so that no digit is lost.
    """
    distance = np.sqrt(r2 + z * z)
    apart = (weight**2 * r2 + (weight - share) * (weight + share) * z * z) / (weight * distance - share * z)
    return np.where(weight * share * z < 0, apart, weight * distance + share * z)


def _seen_depth(weight: float, r2: Array, share: float, z: Array) -> Array:
    """Their sum, by which (X, Y) is divided; NaN where the sphere, seen from ξ = a/b behind its centre, shows no point.

    That is where the sum is not positive, and for ξ > 1 on the far side, Z < -D/ξ; the rim belongs to the image.
    """
    depth = _sum(weight, r2, share, z)
    seen = depth > 0 if weight <= share else weight * z >= -(share + ROUNDING * weight) * np.sqrt(r2 + z * z)
    return np.where(seen, depth, np.nan)


def _root(squared: Array) -> Array:
    """The square root, of 0 where rounding has carried a point of the rim beyond it; NaN further out."""
    return np.sqrt(np.where(squared > -ROUNDING, np.maximum(squared, 0), np.nan))


def _depth(alpha: float, r2: Array) -> Array:
    """Z of the point (x, y, Z) whose image is (x, y); NaN beyond the outline of the sphere (Usenko 2018, eq. 18)."""
    root = _root(1 - (2 * alpha - 1) * r2)
    if alpha > 0.75:  # the same fraction reduced, which at α = 1 is 0/0 on the rim
        return (alpha * root - (1 - alpha)) / (2 * alpha - 1)
    return (1 - alpha**2 * r2) / (alpha * root + (1 - alpha))
