"""The polynomial that most calibrations hold: radial, tangential, rational, thin prism and tilt, as OpenCV has them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import atan, cos, inf, pi, sin, sqrt

import numpy as np
from numpy.polynomial import Polynomial

from camviz.lenses.arrays import Coordinates, ImagePoints, ImagePointsLike, Jacobians, Mask, Radii, RadiiLike
from camviz.lenses.base import Array, Fold, as_points, blockwise, check_parameters, check_range
from camviz.lenses.folding import FoldingLens, first_positive_root, polynomial_roots
from camviz.lenses.perspective import Perspective

MAX_CANCELLED_GAP = 0.01  # of r² at a pole: a root of the numerator as near as this almost cancels the pole


@dataclass(frozen=True)
class BrownConrady(FoldingLens):
    """OpenCV's polynomial: radial, tangential, rational, thin prism and tilt.

    From the ideal (x, y) = (X/Z, Y/Z), with r² = x² + y², to the distorted

        x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶) + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴
        y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶) + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴

    and from there onto a sensor tilted by τx and τy. A polynomial folds: only rays in front of the camera have an
    image, and only if the way to them from the axis meets neither the fold of the radial part, nor its pole, nor a
    Jacobian determinant of 0 (`valid`). Shortly before a pole that the numerator almost cancels the domain ends as well
    (`cancelled_radius`): other programs step over such a pole, so that its rays are not theirs.

    Args:
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4: Coefficients of lengths in focal lengths, in OpenCV's order.
        tau_x, tau_y: Tilt of the sensor in radians.

    Raises: ValueError for a coefficient that is not a finite number, and for a tilt outside -π/2 … π/2.
    Source: D. C. Brown, *Close-range camera calibration*, Photogrammetric Engineering 37 (1971). OpenCV's documentation
    of calib3d.

    >>> barrel = BrownConrady(k1=-0.2)
    >>> barrel.project([0.5, 0, 1])  # 0.5 (1 - 0.2 · 0.25)
    array([0.475, 0.   ])
    >>> f"{barrel.fold_radius:.3f}"  # 1 - 3 · 0.2 r² = 0
    '1.291'
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tau_x: float = 0.0
    tau_y: float = 0.0

    plain = Perspective
    denominator_terms = ("k4", "k5", "k6")
    may_mirror = True

    def __post_init__(self) -> None:
        check_parameters(self)
        for name in ("tau_x", "tau_y"):
            value = getattr(self, name)
            check_range(name, value, abs(value) < pi / 2, "an angle between -π/2 and π/2 radians")

    @classmethod
    def from_coefficients(cls, coefficients: Iterable[float]) -> BrownConrady:
        """From a list of coefficients, as OpenCV and ROS write them.

        Args:
            coefficients: 4, 5, 8, 12 or 14 numbers: k1, k2, p1, p2, k3 and so on, in OpenCV's order. The rest is 0.

        Raises: ValueError for any other number of coefficients.

        >>> BrownConrady.from_coefficients([-0.3, 0.1, 0, 0, 0.02]).k3
        0.02
        """
        values = [float(value) for value in np.ravel(np.asarray(coefficients, dtype=float))]
        if len(values) not in (4, 5, 8, 12, 14):
            raise ValueError(f"coefficients must be 4, 5, 8, 12 or 14 numbers, got {len(values)}")
        return cls(*values)

    @property
    def is_distorted(self) -> bool:
        return self != type(self)()

    # The polynomial itself, without regard to its domain: how it folds can be looked at.

    def radial(self, r: RadiiLike) -> Radii:
        """g(r) = r N(r²)/D(r²), the distorted radius of an ideal one, beyond the fold as well."""
        r = np.asarray(r, dtype=float)
        with np.errstate(all="ignore"):
            return r * self._ratio(r * r)

    def distort(self, xy: ImagePointsLike) -> ImagePoints:
        """Distorted points of ideal ones, beyond the fold as well."""
        return blockwise(self._distort, as_points(xy, 2, "xy"), 2)

    def jacobian(self, xy: ImagePointsLike) -> Jacobians:
        """The derivative of `distort`, exact."""
        xy = as_points(xy, 2, "xy")
        bent = blockwise(lambda x, y: self._bend_and_derivatives(x, y)[2:], xy, 4).reshape(*xy.shape, 2)
        with np.errstate(all="ignore"):
            return self._tilt_jacobian(blockwise(self._polynomial, xy, 2)) @ bent

    def project_unchecked(self, rays: Array) -> Array:
        return self.distort(rays[..., :2] / rays[..., 2:])

    def ray_jacobian(self, rays: Array) -> Array:
        xy, depth = rays[..., :2] / rays[..., 2:], rays[..., 2:, None]
        onto_plane = np.concatenate([np.broadcast_to(np.eye(2), (*xy.shape, 2)), -xy[..., None]], axis=-1) / depth
        return self.jacobian(xy) @ onto_plane

    def parameter_jacobian(self, name: str, rays: Array) -> Array:
        if self._tilt is not None or name in ("tau_x", "tau_y"):
            return super().parameter_jacobian(name, rays)
        xy = rays[..., :2] / rays[..., 2:]
        return blockwise(lambda x, y: self._by_coefficient(name, x, y), xy, 2)

    # Its domain.

    @property
    def can_fold(self) -> bool:
        return True

    @property
    def fold(self) -> Fold | None:
        """Where the radial part turns back."""
        r = self.fold_radius
        return Fold(r, atan(r), float(self.radial(r))) if r < inf else None

    @cached_property
    def numerator(self) -> Polynomial:
        """N(s), s = r²."""
        return Polynomial([1, self.k1, self.k2, self.k3])

    @cached_property
    def denominator(self) -> Polynomial:
        """D(s), s = r²."""
        return Polynomial([1, self.k4, self.k5, self.k6])

    @cached_property
    def fold_radius(self) -> float:
        """The smallest positive root of g'(r), where the radial part turns back; infinity if no ray gets there.

        It never turns back, or has a pole before it does, at which it is infinite and all images end.
        """
        fold = sqrt(first_positive_root(self._slope_polynomial.coef))
        return fold if fold < self.pole_radius else inf

    @cached_property
    def _slope_polynomial(self) -> Polynomial:
        """N D + 2 s (N' D - N D') = g' D², of s = r²: it has the sign of g'."""
        N, D, s = self.numerator, self.denominator, Polynomial([0, 1])
        return N * D + 2 * s * (N.deriv() * D - N * D.deriv())

    @cached_property
    def pole_radius(self) -> float:
        """The smallest positive root of D(r²), where the radial part is infinite; infinity if there is none."""
        return sqrt(first_positive_root(self.denominator.coef))

    @cached_property
    def cancelled_radius(self) -> float:
        """Where a pole that the numerator almost cancels doubles the slope of g; infinity if there is none.

        With a root of N by a `gap` beyond that of D, both relative, g is its smooth continuation times 1 + gap/t at
        t = 1 - r²/pole². From t = √(2 gap) on, a hairline of rays has all the rest of the image (a Froissart doublet).
        """
        pole, zero = self.pole_radius**2, first_positive_root(self.numerator.coef)
        gap = zero / pole - 1 if pole < inf else inf
        return sqrt(pole * (1 - sqrt(2 * gap))) if 0 <= gap <= MAX_CANCELLED_GAP else inf

    @cached_property
    def limit_radius(self) -> float:
        """Where the radial part ends on the way from the axis: the least of its fold, pole and cancelled radius."""
        return min(self.fold_radius, self.pole_radius, self.cancelled_radius)

    @cached_property
    def critical_radii(self) -> Array:
        """The real parts of all roots of g' and D, near which g may change quickly: (n,), focal lengths."""
        roots = np.concatenate([polynomial_roots(each.coef) for each in (self._slope_polynomial, self.denominator)])
        return np.sqrt(roots.real[roots.real > 0])

    def valid(self, xy: ImagePointsLike) -> Mask:
        """Whether ideal points have an image that they share with no other point of the domain."""
        xy = as_points(xy, 2, "xy")
        return blockwise(lambda x, y: (self._valid(x, y),), xy, 1)[..., 0] > 0

    # The lens.

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        depth = np.where(z > 0, z, np.nan)
        return self.bend(x / depth, y / depth)

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x, y = self.straighten(x, y)
        return x, y, np.ones_like(x)

    def bend(self, x: Coordinates, y: Coordinates) -> tuple[Coordinates, Coordinates]:
        """Distorted coordinates of ideal ones; NaN outside the domain."""
        valid = self._valid(x, y)
        x, y = self._distort(x, y)
        if not valid.all():
            x[~valid] = y[~valid] = np.nan
        return x, y

    def straighten(self, x: Coordinates, y: Coordinates) -> tuple[Coordinates, Coordinates]:
        """Ideal coordinates of distorted ones, by Newton's method; NaN where there are none."""
        u, v = self._untilt(x, y)
        within = u * u + v * v <= self._rim[1].max() ** 2
        x, y = np.full((2, len(u)), np.nan)
        x[within], y[within] = self._straighten(u[within], v[within])
        return x, y

    # Forwards. With m = N/D + 2 (p1 y + p2 x): x' = x m + (p2 + s1) r² + s2 r⁴, y' = y m + (p1 + s3) r² + s4 r⁴.

    def _ratio(self, s: Array) -> Array:
        numerator = 1 + s * (self.k1 + s * (self.k2 + s * self.k3))
        if not (self.k4 or self.k5 or self.k6):
            return numerator
        return numerator / (1 + s * (self.k4 + s * (self.k5 + s * self.k6)))

    def _ratio_slope(self, s: Array, ratio: Array) -> Array:
        slope = self.k1 + s * (2 * self.k2 + s * (3 * self.k3))
        if not (self.k4 or self.k5 or self.k6):
            return slope
        # (N/D)' = (N' - D' N/D) / D
        falling = self.k4 + s * (2 * self.k5 + s * (3 * self.k6))
        return (slope - falling * ratio) / (1 + s * (self.k4 + s * (self.k5 + s * self.k6)))

    def _polynomial(self, x: Array, y: Array) -> tuple[Array, Array]:
        s = x * x + y * y
        m = self._ratio(s)
        if self._symmetric:
            return x * m, y * m
        m += 2 * self.p2 * x + 2 * self.p1 * y
        return (
            x * m + s * (self.p2 + self.s1 + s * self.s2),
            y * m + s * (self.p1 + self.s3 + s * self.s4),
        )

    def _bend_and_derivatives(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """x', y' and ∂x'/∂x, ∂x'/∂y, ∂y'/∂x, ∂y'/∂y, before the tilt."""
        s = x * x + y * y
        ratio = self._ratio(s)
        slope = 2 * self._ratio_slope(s, ratio)
        if self._symmetric:
            x_slope, y_slope = x * slope, y * slope
            mixed = x * y_slope
            return x * ratio, y * ratio, ratio + x * x_slope, mixed, mixed, ratio + y * y_slope
        m = ratio + 2 * self.p2 * x + 2 * self.p1 * y
        m_x, m_y = x * slope + 2 * self.p2, y * slope + 2 * self.p1
        a, b = self.p2 + self.s1 + s * self.s2, self.p1 + self.s3 + s * self.s4
        a_slope, b_slope = 2 * (a + s * self.s2), 2 * (b + s * self.s4)
        return (
            x * m + s * a,
            y * m + s * b,
            m + x * (m_x + a_slope),
            x * m_y + y * a_slope,
            y * m_x + x * b_slope,
            m + y * (m_y + b_slope),
        )

    def _by_coefficient(self, name: str, x: Array, y: Array) -> tuple[Array, Array]:
        """∂x'/∂name and ∂y'/∂name of a coefficient, before the tilt."""
        s, zero = x * x + y * y, np.zeros_like(x)
        of_others = {
            "p1": (2 * x * y, s + 2 * y * y), "p2": (s + 2 * x * x, 2 * x * y),
            "s1": (s, zero), "s2": (s * s, zero), "s3": (zero, s), "s4": (zero, s * s),
        }  # fmt: skip
        if name in of_others:
            return of_others[name]
        number = int(name[1])
        term = s if number in (1, 4) else s * s if number in (2, 5) else s * s * s
        share = term / (1 + s * (self.k4 + s * (self.k5 + s * self.k6)))
        if number > 3:
            share *= -self._ratio(s)
        return x * share, y * share

    # The tilt: a homography between the sensor as it should be and as it is.

    @cached_property
    def _tilt(self) -> Array | None:
        if not (self.tau_x or self.tau_y):
            return None
        cx, sx, cy, sy = cos(self.tau_x), sin(self.tau_x), cos(self.tau_y), sin(self.tau_y)
        R = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
        tilt = np.array([[R[2, 2], 0, -R[0, 2]], [0, R[2, 2], -R[1, 2]], [0, 0, 1]]) @ R
        tilt[:2, 2] = 0  # R₂₂ R₀₂ - R₀₂ R₂₂, without its rounding
        return tilt

    @cached_property
    def _symmetric(self) -> bool:
        return not any((self.p1, self.p2, self.s1, self.s2, self.s3, self.s4))
