"""The polynomial that most calibrations hold, long because its inverse and its folds need every one of its terms.

Radial, tangential, rational, thin prism and tilt, as OpenCV has them.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import atan, cos, inf, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, Lens, as_points, blockwise, check_parameters, check_range
from camviz.lenses.declarations import CalibrationModel, Example, Fold, Spelling
from camviz.lenses.perspective import Perspective
from camviz.lenses.roots import first_positive_root

STEEPEST = np.deg2rad(89.5)  # the tables end here where the polynomial itself has no end
UNBOUNDED = 1e150  # a radius beyond all images whose square is still a number
NEARLY_FLAT = 0.01  # a determinant, 1 on the axis, below which the map may fold close by

GRID = "fx fy cx cy"
RADTAN = "k1 k2 p1 p2"
RATIONAL = f"{RADTAN} k3 k4 k5 k6"
PRISM = f"{RATIONAL} s1 s2 s3 s4"
FARTHEST = 1e4  # focal lengths: beyond, all images crowd on the horizon of a tilted sensor
CLOSE = 1e-13  # focal lengths, relative beyond 1: how well an inverse must return


@dataclass(frozen=True)
class BrownConrady(Lens):
    """OpenCV's polynomial: radial, tangential, rational, thin prism and tilt.

    From the ideal (x, y) = (X/Z, Y/Z), with r² = x² + y², to the distorted

        x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶) + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴
        y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶) + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴

    and from there onto a sensor tilted by τx and τy. A polynomial folds: only rays in front of the camera have an
    image, and only if the way to them from the axis meets neither the fold of the radial part, nor its pole, nor a
    Jacobian determinant of 0 (`valid`).

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

    spellings = (
        Spelling("basalt", "pinhole-radtan8", f"{GRID} {RATIONAL}"),
        Spelling("camodocal", "PINHOLE", f"{GRID} {RADTAN}"),
        Spelling("camodocal", "PINHOLE_FULL", f"{GRID} {RATIONAL}"),
        Spelling("colmap", "SIMPLE_RADIAL", "f cx cy k1", number=2),
        Spelling("colmap", "RADIAL", "f cx cy k1 k2", number=3),
        Spelling("colmap", "OPENCV", f"{GRID} {RADTAN}", number=4),
        Spelling("colmap", "FULL_OPENCV", f"{GRID} {RATIONAL}", number=6),
        Spelling("euroc", "radial-tangential", f"{GRID} {RADTAN}"),
        Spelling("kalibr", "pinhole radtan", f"{GRID} {RADTAN}"),
        Spelling("kitti-raw", "K and D", f"{GRID} {RADTAN} k3"),
        Spelling("matlab", "cameraParameters", f"{GRID} skew {RADTAN} k3"),
        Spelling("metashape", "frame", f"{GRID} skew {RADTAN} k3"),
        Spelling("mrcal", "LENSMODEL_OPENCV4", f"{GRID} {RADTAN}"),
        Spelling("mrcal", "LENSMODEL_OPENCV5", f"{GRID} {RADTAN} k3"),
        Spelling("mrcal", "LENSMODEL_OPENCV8", f"{GRID} {RATIONAL}"),
        Spelling("mrcal", "LENSMODEL_OPENCV12", f"{GRID} {PRISM}"),
        Spelling("nerfstudio", "OPENCV", f"{GRID} {RADTAN} k3"),
        Spelling("opencv", "distortion_coefficients", f"{GRID} {RADTAN} k3"),
        Spelling("opencv", "distortion_coefficients", f"{GRID} {RATIONAL}"),
        Spelling("opencv", "distortion_coefficients", f"{GRID} {PRISM}"),
        Spelling("opencv", "distortion_coefficients", f"{GRID} {PRISM} tau_x tau_y"),
        Spelling("orbslam", "PinHole", f"{GRID} {RADTAN} k3"),
        Spelling("okvis", "radialtangential", f"{GRID} {RADTAN}"),
        Spelling("okvis", "radialtangential8", f"{GRID} {RATIONAL}"),
        Spelling("opensfm", "perspective", "f cx cy k1 k2"),
        Spelling("opensfm", "brown", f"{GRID} k1 k2 p1 p2 k3"),
        Spelling("ros", "plumb_bob", f"{GRID} {RADTAN} k3"),
        Spelling("ros", "rational_polynomial", f"{GRID} {RATIONAL}"),
        Spelling("stella", "perspective", f"{GRID} {RADTAN} k3"),
        Spelling("svo", "pinhole radial-tangential", f"{GRID} {RADTAN}"),
    )
    calibrations = (
        CalibrationModel(
            "standard", "Brown-Conrady", f"{RADTAN} k3", "k1 k2 p1 p2 k3: most cameras", "calibrateCamera"
        ),
        CalibrationModel(
            "rational",
            "Brown-Conrady, rational",
            RATIONAL,
            "and k4 k5 k6, kept from poles by a prior: wide angles, with many views up to the image's corners",
            "calibrateCamera",
            "CALIB_RATIONAL_MODEL",
            regularised=True,
        ),
        CalibrationModel(
            "thin-prism",
            "Brown-Conrady with thin prisms",
            f"{RADTAN} k3 s1 s2 s3 s4",
            "and s1 s2 s3 s4 beside the standard ones: tilted or decentred lenses",
            "calibrateCamera",
            "CALIB_THIN_PRISM_MODEL",
        ),
    )
    examples = (
        Example("none", (), 88),
        Example("barrel", (-0.3,), 46),
        Example("5", (-0.28, 0.07, 1e-3, -5e-4, 0.01), 60),
        Example("8", (0.5, 0.1, 1e-3, -5e-4, 0.01, 0.6, 0.2, 0.02), 60),
        Example("12", (-0.2, 0.1, 1e-3, -2e-3, 0.01, 0.1, 0, 0, 1e-2, -2e-3, -4e-3, 3e-3), 45),
        Example("14", (-0.2, 0.1, 1e-3, -2e-3, 0, 0, 0, 0, 1e-2, -2e-3, -4e-3, 3e-3, 0.1, -0.07), 45),
        Example("only_tangential", (0, 0, 0.1, -0.05), 40),
        Example("folding_early", (0.296, -1.035, 0.01, -0.02), 32),
        Example("before_a_pole", (0.1, 0, 0, 0, 0, -0.8), 45),
        Example("strong", (30, -2, 0, 0, -400), 10),
    )
    invalid = (((0,) * 12 + (1.6,), "tau_x must be an angle between -π/2 and π/2 radians, got 1.6"),)
    plain = Perspective
    denominator_terms = ("k4", "k5", "k6")
    may_mirror = True

    def __post_init__(self) -> None:
        check_parameters(self)
        for name in ("tau_x", "tau_y"):
            value = getattr(self, name)
            check_range(name, value, abs(value) < pi / 2, "an angle between -π/2 and π/2 radians")

    @classmethod
    def from_coefficients(cls, coefficients: Iterable[float]) -> "BrownConrady":
        """From a list of coefficients, as OpenCV and ROS write them.

        Args:
            coefficients: 4, 5, 8, 12 or 14 numbers: k1, k2, p1, p2, k3 and so on, in OpenCV's order.

        Returns: BrownConrady with 0 for what is left out.
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

    def radial(self, r: ArrayLike) -> Array:
        """g(r) = r N(r²)/D(r²), the distorted radius of an ideal one.

        Args:
            r: (...), ideal radii in focal lengths.

        Returns: (...), distorted radii in focal lengths, beyond the fold as well.
        """
        r = np.asarray(r, dtype=float)
        with np.errstate(all="ignore"):
            return r * self._ratio(r * r)

    def distort(self, xy: ArrayLike) -> Array:
        """Distorted points of ideal ones, beyond the fold as well.

        Args:
            xy: (..., 2), ideal points in focal lengths.

        Returns: (..., 2), distorted points in focal lengths.
        Raises: ValueError where the last axis has not 2 coordinates.
        """
        return blockwise(self._distort, as_points(xy, 2, "xy"), 2)

    def jacobian(self, xy: ArrayLike) -> Array:
        """The derivative of `distort`, exact.

        Args:
            xy: (..., 2), ideal points in focal lengths.

        Returns: (..., 2, 2), ∂x'y'/∂xy, without unit.
        Raises: ValueError where the last axis has not 2 coordinates.
        """
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
        N, D = (np.asarray(each.coef, dtype=float) for each in (self.numerator, self.denominator))
        sloping_N, sloping_D = (np.arange(len(each)) * each for each in (N, D))  # s N' and s D'
        # g' = (N D + 2 (s N' D - N s D')) / D²
        rising = np.convolve(N, D) + 2 * (np.convolve(sloping_N, D) - np.convolve(N, sloping_D))
        fold = sqrt(first_positive_root(rising))
        return fold if fold < self.pole_radius else inf

    @cached_property
    def pole_radius(self) -> float:
        """The smallest positive root of D(r²), where the radial part is infinite; infinity if there is none."""
        return sqrt(first_positive_root(self.denominator.coef))

    def valid(self, xy: ArrayLike) -> np.ndarray:
        """Whether ideal points have an image that they share with no other point of the domain.

        Args:
            xy: (..., 2), ideal points in focal lengths.

        Returns: (...) of bool, True inside the domain.
        Raises: ValueError where the last axis has not 2 coordinates.
        """
        xy = as_points(xy, 2, "xy")
        return blockwise(lambda x, y: (self._valid(x, y),), xy, 1)[..., 0] > 0

    # The lens.

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        depth = np.where(z > 0, z, np.nan)
        return self.bend(x / depth, y / depth)

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x, y = self.straighten(x, y)
        return x, y, np.ones_like(x)

    def bend(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Distorted coordinates of ideal ones.

        Args:
            x, y: (n,), ideal coordinates in focal lengths.

        Returns:
            x: (n,), distorted coordinates in focal lengths; NaN outside the domain.
            y: (n,), the same downwards.
        """
        valid = self._valid(x, y)
        x, y = self._distort(x, y)
        if not valid.all():
            x[~valid] = y[~valid] = np.nan
        return x, y

    def straighten(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Ideal coordinates of distorted ones, by Newton's method.

        Args:
            x, y: (n,), distorted coordinates in focal lengths.

        Returns:
            x: (n,), ideal coordinates in focal lengths; NaN where there are none.
            y: (n,), the same downwards.
        """
        u, v = self._untilt(x, y)
        within = u * u + v * v <= self._rim[1].max() ** 2
        x, y = np.full((2, len(u)), np.nan)
        x[within], y[within] = self._straighten(u[within], v[within])
        return x, y

    def _straighten(self, u: Array, v: Array) -> tuple[Array, Array]:
        x, y, error = self._newton(u, v)
        lost = np.flatnonzero(~(self._valid(x, y) & (error <= CLOSE * (1 + np.abs(u) + np.abs(v)))))
        if len(lost):
            x[lost] = y[lost] = np.nan
            rim = np.interp(np.arctan2(v[lost], u[lost]), *self._rim, period=2 * pi)
            lost = lost[np.hypot(u[lost], v[lost]) <= rim]
            x[lost], y[lost] = self._newton_inside(u[lost], v[lost], *self._guess_inside(u[lost], v[lost]))
            lost = lost[np.isnan(x[lost])]
            if len(lost) and not self._symmetric:
                for start in self._nearest_samples(u[lost], v[lost]):
                    found = self._newton_inside(u[lost], v[lost], *start)
                    x[lost], y[lost] = np.where(np.isnan(x[lost]), found, (x[lost], y[lost]))
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

    def _distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        x, y = self._polynomial(x, y)
        if self._tilt is None:
            return x, y
        x, y, w = _homography(self._tilt, x, y)
        return x / w, y / w

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

    def _untilt(self, x: Array, y: Array) -> tuple[Array, Array]:
        if self._tilt is None:
            return x, y
        x, y, w = _homography(np.linalg.inv(self._tilt), x, y)
        w = np.where(w > 0, w, np.nan)
        return x / w, y / w

    def _tilt_jacobian(self, xy: Array) -> Array:
        if self._tilt is None:
            return np.eye(2)
        x, y, w = _homography(self._tilt, xy[..., 0], xy[..., 1])
        image = np.stack([x / w, y / w], axis=-1)
        return (self._tilt[:2, :2] - image[..., None] * self._tilt[2, :2]) / w[..., None, None]

    # Where it does not fold.

    @cached_property
    def _symmetric(self) -> bool:
        return not any((self.p1, self.p2, self.s1, self.s2, self.s3, self.s4))

    def _orientation(self, x: Array, y: Array) -> Array:
        """The Jacobian's determinant before the tilt; negative where a tilted sensor is not in front, and near."""
        u, v, u_x, u_y, v_x, v_y = self._bend_and_derivatives(x, y)
        determinant = u_x * v_y - u_y * v_x
        if self._tilt is None:
            return determinant
        seen = (_homography(self._tilt, u, v)[2] > 0) & (np.hypot(u, v) < FARTHEST)
        return np.where(seen, determinant, -1)

    @cached_property
    def _limits(self) -> tuple[float, float]:
        """Radii: ideal points up to the first are valid, beyond the second they are not."""
        outer = min(self.fold_radius, self.pole_radius)
        if self._symmetric and self._tilt is None:
            return outer, outer
        return float(self._reach[0].min()), outer

    @cached_property
    def _spokes(self) -> tuple[Array, Array, Array]:
        """Radii (n, 1) along 64 lines from the axis, their azimuths, and the least determinant (n, 64) so far."""
        end = min(atan(min(self.fold_radius, self.pole_radius)), STEEPEST)
        r, azimuth = np.tan(end * _fractions(128)[:, None]), np.linspace(0, 2 * pi, 65)[1:]
        with np.errstate(all="ignore"):
            determinant = self._orientation(r * np.cos(azimuth), r * np.sin(azimuth))
        return r, azimuth, np.minimum.accumulate(np.nan_to_num(determinant, nan=-1))

    @cached_property
    def _rim(self) -> tuple[Array, Array]:
        """Azimuths in the image before its tilt, and radii that no image exceeds there, or UNBOUNDED."""
        outer = min(self.fold_radius, self.pole_radius)
        if self._symmetric and self._tilt is None:
            return np.zeros(1), np.array([self.radial(outer) if outer == self.fold_radius < inf else UNBOUNDED])
        r, azimuth, least = self._spokes
        upright = least > 0
        if not upright[0].all():
            return azimuth, np.full_like(azimuth, UNBOUNDED)
        last = upright.sum(axis=0) - 1
        ends = np.stack([r[last, 0], r[np.minimum(last + 1, len(r) - 1), 0]])
        with np.errstate(all="ignore"):
            x, y = self._polynomial(ends * np.cos(azimuth), ends * np.sin(azimuth))
        endless = upright[-1] & (outer > 1.001 * r[-1, 0])
        radii = np.where(endless, UNBOUNDED, 1.005 * np.hypot(x, y).max(axis=0))
        order = np.argsort(np.arctan2(y[0], x[0]))
        neighbours = [np.roll(radii[order], shift) for shift in (-2, -1, 0, 1, 2)]
        return np.arctan2(y[0], x[0])[order], np.max(neighbours, axis=0)

    @cached_property
    def _reach(self) -> tuple[Array, Array]:
        """Per sector between two spokes: ideal points up to the first radius are valid, beyond the second they are not.

        Both with the next spokes on either side and a hundredth to spare; and up to the first radius no determinant
        comes near 0, for between two spokes it may come nearer.
        """
        r, _, least = self._spokes
        radii = np.concatenate([[0.0], r[:, 0], [inf]])
        beside = (np.arange(least.shape[1]) - np.array([[2], [1], [0], [-1]])) % least.shape[1]
        firm, upright = ((least > low).sum(axis=0)[beside] for low in (NEARLY_FLAT, 0))
        return 0.99 * radii[firm.min(axis=0)], 1.01 * radii[upright.max(axis=0) + 1]

    def _valid(self, x: Array, y: Array) -> np.ndarray:
        inner, outer = self._limits
        s = x * x + y * y
        valid = s <= inner * inner
        doubtful = np.flatnonzero(~valid & (s < outer * outer))
        if len(doubtful):
            valid[doubtful] = self._upright_all_the_way(x[doubtful], y[doubtful])
        return valid

    def _upright_all_the_way(self, x: Array, y: Array) -> np.ndarray:
        """True where the map keeps its orientation all along the line from the axis to (x, y)."""
        near, far = self._reach
        sector = (np.arctan2(y, x) * (len(near) / (2 * pi))).astype(int) % len(near)
        r, near, far = np.hypot(x, y), near[sector], far[sector]
        upright = r <= near
        edge = np.flatnonzero(~upright & (r <= far))
        start = near[edge] / r[edge]
        steps = start + np.linspace(0, 1, 17)[1:, None] * (1 - start)
        upright[edge] = np.all(self._orientation(steps * x[edge], steps * y[edge]) > 0, axis=0)
        return upright

    # Backwards.

    @cached_property
    def _inverse_table(self) -> tuple[Array, Array]:
        """r² and the ratio of the ideal to the distorted radius, against the square of the distorted radius."""
        end = min(atan(min(self.fold_radius, self.pole_radius * (1 - 1e-6))), STEEPEST)
        r = np.tan(end * np.sin(np.linspace(0, pi / 2, 1025)))
        s = r * r
        return np.maximum.accumulate(np.square(self.radial(r))), 1 / self._ratio(s)

    def _guess(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Nearly the ideal point of an image point: exactly so for the radial part alone."""
        scale = np.interp(u * u + v * v, *self._inverse_table)
        x, y = u * scale, v * scale
        if self._symmetric:
            return x, y
        # What the other parts would add to that point is taken from the image first.
        bent_x, bent_y = self._polynomial(x, y)
        u, v = 2 * u - bent_x, 2 * v - bent_y
        scale = np.interp(u * u + v * v, *self._inverse_table)
        return u * scale, v * scale

    def _guess_inside(self, u: Array, v: Array) -> tuple[Array, Array]:
        """The same, moved towards the axis to where every point is valid."""
        x, y = self._guess(u, v)
        inwards = np.minimum(1, 0.999 * self._limits[0] / np.maximum(np.hypot(x, y), 1e-300))
        return inwards * x, inwards * y

    def _step(self, x: Array, y: Array, u: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Newton's step from (x, y) towards the point whose image is (u, v), the error of its image now, and det J."""
        bent_x, bent_y, u_x, u_y, v_x, v_y = self._bend_and_derivatives(x, y)
        du, dv = u - bent_x, v - bent_y
        determinant = u_x * v_y - u_y * v_x
        dx, dy = (v_y * du - u_y * dv) / determinant, (u_x * dv - v_x * du) / determinant
        return dx, dy, np.maximum(np.abs(du), np.abs(dv)), determinant

    def _newton(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """A point whose image is (u, v), perhaps beyond the fold, and the error of its image."""
        x, y = self._guess(u, v)
        for _ in range(4):
            dx, dy, error, _ = self._step(x, y, u, v)
            if not (error > CLOSE).any():
                return x, y, error
            x, y = x + dx, y + dy
        return x, y, self._step(x, y, u, v)[2]

    @cached_property
    def _samples(self) -> tuple[Any, Array]:
        """A tree of the images, before the tilt, of points all over the domain, and these points (2, n)."""
        from scipy.spatial import KDTree  # half of what importing a lens would cost

        r, azimuth, least = self._spokes
        x, y = (np.broadcast_to(r * turned, least.shape)[least > 0] for turned in (np.cos(azimuth), np.sin(azimuth)))
        x, y = np.append(x, 0.0), np.append(y, 0.0)
        return KDTree(np.stack(self._polynomial(x, y), axis=-1)), np.stack([x, y])

    def _nearest_samples(self, u: Array, v: Array) -> Array:
        """The ideal points (16, 2, n) of those samples whose images are the nearest to each (u, v)."""
        tree, points = self._samples
        nearest = tree.query(np.stack([u, v], axis=-1), k=16)[1]
        return np.moveaxis(points[:, np.minimum(nearest, points.shape[1] - 1)], -1, 0)

    def _newton_inside(self, u: Array, v: Array, x: Array, y: Array) -> tuple[Array, Array]:
        """Newton's method from (x, y) that shortens a step which comes no closer or leaves the domain; NaN if lost."""
        close = CLOSE * (1 + np.abs(u) + np.abs(v))
        outer = self._limits[1]
        state = np.stack([x, y, u, v])
        state = np.stack([*state, *self._step(*state)[:3], np.ones_like(u)])
        for _ in range(24):
            moving = (state[6] > close) & (state[7] > 1e-3)
            if not moving.any():
                break
            x, y, u, v, dx, dy, error, factor = old = state[:, moving]
            new_x, new_y = x + factor * dx, y + factor * dy
            new_dx, new_dy, new_error, determinant = self._step(new_x, new_y, u, v)
            better = (new_error < error) & (determinant > 0) & (np.hypot(new_x, new_y) < outer)
            new = np.stack([new_x, new_y, u, v, new_dx, new_dy, new_error, np.minimum(1, 4 * factor)])
            old[7] /= 4
            state[:, moving] = np.where(better, new, old)
        x, y, error = state[0], state[1], state[6]
        found = (error <= close) & self._valid(x, y)
        return np.where(found, x, np.nan), np.where(found, y, np.nan)


def _fractions(count: int) -> Array:
    """1/count … 1 in equal steps, and before them ever smaller ones, for a fold close to the axis."""
    return np.concatenate([np.geomspace(1e-5, 1 / count, 24)[:-1], np.linspace(0, 1, count + 1)[1:]])


def _homography(H: np.ndarray, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """H (x, y, 1) as three coordinates."""
    u, v, w = (row[0] * x + row[1] * y + row[2] for row in H)
    return u, v, w
