"""The path of a board before a camera, in pieces: each is a cubic B-spline with evenly spaced knots."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation

ORDER = 4  # of a cubic B-spline: how many control poses there are a say in at any time


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Pieces of a path; at any time of piece i, a point p of the board is at exp(ω) Rᵢ (p - m) + τ before the camera.

    ω and τ together are a uniform cubic B-spline in six dimensions (Furgale, Barfoot & Sibley 2012, "Continuous-time
    batch estimation using temporal basis functions"). Each piece has its own mean orientation Rᵢ, so that ω stays
    small, and shares nothing with its neighbours.

    Args:
        begin: (pieces,), when each begins, in seconds.
        spacing: (pieces,), from one knot to the next, in seconds.
        turned: One orientation Rᵢ for each piece.
        middle: (3,), the point m of the board that the turns are about, in metres.
        control: (pieces, n, 6), ω in radians and τ in metres.
    """

    begin: Array
    spacing: Array
    turned: Rotation
    middle: Array
    control: Array

    @property
    def end(self) -> Array:
        """(pieces,), when each ends, in seconds."""
        return self.begin + self.spacing * (self.control.shape[1] - ORDER + 1)

    @classmethod
    def through(cls, poses: RigidTransform, times: Array, begin: Array, end: Array, count: int, middle: Array) -> Self:
        """The pieces nearest to poses cam_from_board, (pieces * frames), at times (pieces, frames), by least squares.

        Times that are NaN do not count. Each piece has `count` control poses.
        """
        pieces, frames = times.shape
        first = [int(np.flatnonzero(np.isfinite(row))[np.isfinite(row).sum() // 2]) for row in times]
        middles = poses.rotation[np.arange(pieces) * frames + first]
        away = poses.rotation * middles[np.repeat(np.arange(pieces), frames)].inv()
        values = np.concatenate([away.as_rotvec(), poses.apply(middle)], axis=-1).reshape(pieces, frames, 6)
        empty = cls(begin, (end - begin) / (count - ORDER + 1), middles, middle, np.zeros((pieces, count, 6)))
        weights = np.nan_to_num(empty.weights(times))
        values = np.where(np.isfinite(times)[..., None], values, 0)
        fitted = [np.linalg.lstsq(each, row, rcond=1e-6)[0] for each, row in zip(weights, values, strict=True)]
        return replace(empty, control=np.stack(fitted))

    def weights(self, times: Array, derivative: bool = False) -> Array:
        """What each control pose counts at times (pieces, ...), (pieces, ..., n); or how fast that grows, in 1/s."""
        shape = (-1, *(1,) * (times.ndim - 1))
        at = (times - self.begin.reshape(shape)) / self.spacing.reshape(shape)
        at = at[..., None] - np.arange(self.control.shape[1]) + 1.0  # from the middle of each control pose's share
        if not derivative:
            return _bump(at)
        return _slope(at) / self.spacing.reshape(*shape, 1)

    def poses(self, weights: Array) -> tuple[Array, Array]:
        """ω and τ, (pieces, ..., 3) each, from `weights` (pieces, ..., n)."""
        flat = weights.reshape(len(weights), -1, weights.shape[-1]) @ self.control
        both = flat.reshape(*weights.shape[:-1], 6)
        return both[..., :3], both[..., 3:]

    def cam_from_board(self, times: Array) -> RigidTransform:
        """The poses at times (pieces, frames), (pieces * frames); NaN counts as each piece's begin."""
        omega, tau = self.poses(self.weights(np.where(np.isfinite(times), times, self.begin[:, None])))
        turned = self.turned[np.repeat(np.arange(len(times)), times.shape[1])]
        turn = Rotation.from_rotvec(omega.reshape(-1, 3)) * turned
        return RigidTransform.from_components(tau.reshape(-1, 3) - turn.apply(self.middle), turn)

    def moved(self, change: Array) -> Self:
        """With control poses changed by (pieces, n, 6)."""
        return replace(self, control=self.control + change)


def _bump(x: Array) -> Array:
    """The cubic B-spline of knots -2 … 2."""
    x = np.abs(x)
    return np.where(x < 1, 2 / 3 - x**2 + x**3 / 2, np.clip(2 - x, 0, None) ** 3 / 6)


def _slope(x: Array) -> Array:
    far = np.abs(x)
    return np.sign(x) * np.where(far < 1, -2 * far + 1.5 * far**2, -(np.clip(2 - far, 0, None) ** 2) / 2)


def left_jacobian(omega: Array) -> Array:
    """J with exp(ω + δ) = exp(J δ) exp(ω) to first order, (..., 3, 3) of rotation vectors (..., 3) in radians.

    J = 1 + (1 - cos θ)/θ² [ω]ₓ + (θ - sin θ)/θ³ [ω]ₓ² (Solà, Deray & Atchuthan 2018, "A micro Lie theory", eq. 145).

    >>> left_jacobian(np.zeros(3)).tolist() == np.eye(3).tolist()
    True
    """
    theta = np.linalg.norm(omega, axis=-1)[..., None, None]
    cross = np.zeros((*omega.shape, 3))
    x, y, z = omega[..., 0], omega[..., 1], omega[..., 2]
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 0] = -z, y, z
    cross[..., 1, 2], cross[..., 2, 0], cross[..., 2, 1] = -x, -y, x
    small = theta < 1e-2
    safe = np.where(small, 1, theta)
    second = np.where(small, 1 / 6 - theta**2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) + np.sinc(theta / (2 * np.pi)) ** 2 / 2 * cross + second * (cross @ cross))
