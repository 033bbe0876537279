"""Where a polynomial of the plane z = 1 folds, and its inverse before that: what `BrownConrady` asks of its numbers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from math import atan, inf, pi
from typing import Any

import numpy as np

from camviz.lenses.arrays import Radii, RadiiLike
from camviz.lenses.base import Array, Lens

STEEPEST = np.deg2rad(89.5)  # the tables end here where the polynomial itself has no end
UNBOUNDED = 1e150  # a radius beyond all images whose square is still a number
NEARLY_FLAT = 0.01  # a determinant, 1 on the axis, below which the map may fold close by
FARTHEST = 1e4  # focal lengths: beyond, all images crowd on the horizon of a tilted sensor
CLOSE = 1e-13  # focal lengths, relative beyond 1: how well an inverse must return


class FoldingLens(Lens):
    """A lens that bends the points of the plane z = 1, as far as it does not fold on the way from the axis.

    The way to a point is looked at along 64 lines from the axis. Newton's method inverts the map before its fold.
    """

    @property
    @abstractmethod
    def fold_radius(self) -> float:
        """Where the radial part turns back, in focal lengths on the plane z = 1; infinity where it does not."""

    @property
    @abstractmethod
    def pole_radius(self) -> float:
        """Where the radial part is infinite, likewise."""

    @property
    @abstractmethod
    def limit_radius(self) -> float:
        """Where the radial part ends on the way from the axis: the fold, the pole, or shortly before the pole."""

    @property
    @abstractmethod
    def critical_radii(self) -> Array:
        """Radii (n,) where the radial part may change so quickly that equal steps would miss it."""

    @abstractmethod
    def radial(self, r: RadiiLike) -> Radii:
        """The distorted radius of an ideal one."""

    @abstractmethod
    def _ratio(self, s: Array) -> Array:
        """The distorted over the ideal radius, of r² (n,)."""

    @abstractmethod
    def _polynomial(self, x: Array, y: Array) -> tuple[Array, Array]:
        """x' and y' of ideal coordinates (n,), before the tilt."""

    @abstractmethod
    def _bend_and_derivatives(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """x', y' and ∂x'/∂x, ∂x'/∂y, ∂y'/∂x, ∂y'/∂y, before the tilt."""

    @property
    @abstractmethod
    def _symmetric(self) -> bool:
        """True where the polynomial acts on radii alone."""

    @property
    @abstractmethod
    def _tilt(self) -> Array | None:
        """The homography (3, 3) onto the sensor as it is; None where that is not tilted."""

    def _distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        x, y = self._polynomial(x, y)
        if self._tilt is None:
            return x, y
        x, y, w = homography(self._tilt, x, y)
        return x / w, y / w

    def _untilt(self, x: Array, y: Array) -> tuple[Array, Array]:
        if self._tilt is None:
            return x, y
        x, y, w = homography(np.linalg.inv(self._tilt), x, y)
        w = np.where(w > 0, w, np.nan)
        return x / w, y / w

    def _tilt_jacobian(self, xy: Array) -> Array:
        if self._tilt is None:
            return np.eye(2)
        x, y, w = homography(self._tilt, xy[..., 0], xy[..., 1])
        image = np.stack([x / w, y / w], axis=-1)
        return (self._tilt[:2, :2] - image[..., None] * self._tilt[2, :2]) / w[..., None, None]

    # Where it does not fold.

    def _orientation(self, x: Array, y: Array) -> Array:
        """The Jacobian's determinant before the tilt; negative where a tilted sensor is not in front, and near."""
        u, v, u_x, u_y, v_x, v_y = self._bend_and_derivatives(x, y)
        determinant = u_x * v_y - u_y * v_x
        if self._tilt is None:
            return determinant
        seen = (homography(self._tilt, u, v)[2] > 0) & (np.hypot(u, v) < FARTHEST)
        return np.where(seen, determinant, -1)

    @cached_property
    def _limits(self) -> tuple[float, float]:
        """Radii: ideal points up to the first are valid, beyond the second they are not."""
        outer = self.limit_radius
        if self._symmetric and self._tilt is None:
            return outer, outer
        return float(self._reach[0].min()), outer

    @cached_property
    def _spokes(self) -> tuple[Array, Array, Array]:
        """Radii (n, 1) along 64 lines from the axis, their azimuths, and the least determinant (n, 64) so far."""
        r = np.tan(min(atan(self.limit_radius), STEEPEST) * _fractions(128))
        r = np.union1d(r, self.critical_radii[self.critical_radii < r[-1]])[:, None]
        azimuth = np.linspace(0, 2 * pi, 65)[1:]
        with np.errstate(all="ignore"):
            determinant = self._orientation(r * np.cos(azimuth), r * np.sin(azimuth))
        return r, azimuth, np.minimum.accumulate(np.nan_to_num(determinant, nan=-1))

    @cached_property
    def _rim(self) -> tuple[Array, Array]:
        """Azimuths in the image before its tilt, and radii that no image exceeds there, or UNBOUNDED."""
        outer = self.limit_radius
        if self._symmetric and self._tilt is None:
            return np.zeros(1), np.array([self.radial(outer) if outer < self.pole_radius else UNBOUNDED])
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
        steps = np.concatenate([steps, np.minimum(self.critical_radii[:, None] / r[edge], 1)])
        upright[edge] = np.all(self._orientation(steps * x[edge], steps * y[edge]) > 0, axis=0)
        return upright

    # Backwards.

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

    @cached_property
    def _inverse_table(self) -> tuple[Array, Array]:
        """r² and the ratio of the ideal to the distorted radius, against the square of the distorted radius."""
        end = min(atan(min(self.limit_radius, self.pole_radius * (1 - 1e-6))), STEEPEST)
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


def homography(H: np.ndarray, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """H (x, y, 1) as three coordinates."""
    u, v, w = (row[0] * x + row[1] * y + row[2] for row in H)
    return u, v, w


def first_positive_root(coefficients: np.ndarray) -> float:
    """The smallest s > 0 with c0 + c1 s + c2 s² + … = 0; infinity where there is none. c0 must not be 0."""
    roots = polynomial_roots(coefficients)
    real = roots.real[np.abs(roots.imag) <= 1e-7 * np.abs(roots)]
    return float(real[real > 0].min(initial=inf))


def polynomial_roots(coefficients: np.ndarray) -> np.ndarray:
    """All complex s (n,) with c0 + c1 s + c2 s² + … = 0. c0 must not be 0.

    Solved for 1/s, whose leading coefficient is c0: a vanishing last coefficient then costs no accuracy.
    """
    inverses = np.roots(coefficients)
    with np.errstate(all="ignore"):
        return np.asarray(1 / inverses[inverses != 0])


def solve_rising(
    function: Callable[[Array], Array], slope: Callable[[Array], Array], value: Array, nodes: Array, levels: Array
) -> Array:
    """The t (n,) with function(t) = value (n,), by Newton's method kept inside the bracket that a table gives.

    `levels` are the function's values at the rising `nodes`, between whose ends it must rise. NaN for a value beyond
    the table and where the equation does not hold to 13 digits in the end.
    """
    cell = np.clip(np.searchsorted(levels, value, side="right"), 1, len(nodes) - 1)
    low, high = nodes[cell - 1], nodes[cell]
    t = low + (high - low) * (value - levels[cell - 1]) / (levels[cell] - levels[cell - 1])
    t[(value < levels[0]) | (value > levels[-1])] = np.nan
    todo = np.arange(len(t))
    for _ in range(60):
        error = function(t[todo]) - value[todo]
        off = np.abs(error) > 1e-13 * value[todo]
        todo, error = todo[off], error[off]
        if not len(todo):
            return t
        # f(t) = value  →  t ← t - (f(t) - value) / f'(t)
        t[todo] = np.clip(t[todo] - error / slope(t[todo]), low[todo], high[todo])
    t[todo] = np.nan
    return t
