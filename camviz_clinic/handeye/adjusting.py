"""X and Z of A X B = Z at the least sum of squares, of pixels or of places, and their covariance clustered by pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import twisted
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.clustered import ByView
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian
from camviz_clinic.calibration.motions import Mask, Motions

MOST_STEPS = 60
SETTLED = 1e-12  # of the sum of squares, what a step must still promise to take off
UNKNOWNS = 12
STRAY = 5.0  # times the median displacement: nearer, a pose does little harm; whether it is chance, straying.py says


class BoardMeasurements(Protocol):
    """What each pose's points of the board are compared in."""

    @property
    def points(self) -> Array:
        """The points (points, 3) in the board's frame, in metres."""

    def residuals(self, points_cam: Array) -> tuple[Array, Array]:
        """Observed less expected (poses, points, m), and the expected one's derivative (poses, points, m, 3)."""

    def only(self, kept: Mask) -> Self:
        """Of some poses."""


@dataclass(frozen=True, eq=False)
class Places:
    """Six points around the board's origin, in metres, as the board's pose in each picture has them.

    Their mean square distance is |t|² + (lever · θ)² where the board is shifted by t and turned by a small θ.
    """

    cam_from_board: RigidTransform
    lever: float

    @property
    def points(self) -> Array:
        """(6, 3), in metres, on the board's axes."""
        return np.sqrt(1.5) * self.lever * np.vstack([np.eye(3), -np.eye(3)])

    @cached_property
    def _seen(self) -> Array:
        B = self.cam_from_board.as_matrix()
        return self.points @ np.swapaxes(B[:, :3, :3], 1, 2) + B[:, None, :3, 3]

    def residuals(self, points_cam: Array) -> tuple[Array, Array]:
        """In metres, over √6, so that a pose's squares add up to their mean."""
        share = 1 / np.sqrt(6)
        by_point = np.broadcast_to(share * np.eye(3), (*points_cam.shape, 3))
        return share * (self._seen - points_cam), by_point

    def only(self, kept: Mask) -> Places:
        """Of some poses."""
        return replace(self, cam_from_board=self.cam_from_board[kept])


@dataclass(frozen=True, eq=False)
class Pixels:
    """The board's corners in the pictures of a camera: pixels (poses, corners, 2), NaN where one was not seen."""

    camera: Camera
    points: Array
    pixels: Array

    def residuals(self, points_cam: Array) -> tuple[Array, Array]:
        """In pixels; 0 for a corner that was not seen, NaN for one that has no image."""
        expected, by_point, _ = pixel_jacobian(self.camera, points_cam, ())
        unseen = np.asarray(~np.isfinite(self.pixels).all(axis=-1))
        residuals = np.where(unseen[..., None], 0.0, np.nan_to_num(self.pixels) - expected)
        return residuals, np.where(unseen[..., None, None], 0.0, by_point)

    def only(self, kept: Mask) -> Pixels:
        """Of some poses."""
        return replace(self, pixels=self.pixels[kept])

    def resized(self, factor: float) -> Pixels:
        """Of a board that is so many times as large."""
        return replace(self, points=factor * self.points)


@dataclass(frozen=True)
class Noise:
    """Standard deviations: of a corner's coordinate in pixels, and of the robot's poses about and along each axis.

    `px` is how far corners scatter from picture to picture: as in one picture, or more where camera or board are not
    quite as told.

    `side` are the columns of X's twist where the mount is the hand, of Z's where the board is on the hand.
    """

    px: float
    turn: float
    shift: float
    side: slice

    @property
    def information(self) -> Array:
        """px² S⁻¹, (6, 6), S being the covariance of a pose's twist in the hand's frame."""
        return np.diag(self.px**2 / np.repeat([self.turn, self.shift], 3) ** 2)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """X and Z for motions, and what they leave of the measurements.

    X and Z move by twists in the frames they lead to, p → p + ω × p + τ. `also` are directions (poses, 6) in which the
    mount's poses may move too: twists in the mount's frame by a unit of one more unknown each, such as a delay.

    With `noise` every pose of the robot is off by a twist of its own, unknown and of this size: the corners of one pose
    are then weighed by C⁻¹ with C = px² + G S Gᵀ, G being their derivative by that twist. Without, all count alike.
    """

    motions: Motions
    measured: BoardMeasurements
    X: RigidTransform
    Z: RigidTransform
    weights: Array | None = None
    noise: Noise | None = None
    also: tuple[Array, ...] = field(default=(), repr=False)

    @cached_property
    def points_mount(self) -> Array:
        """The board's points (poses, points, 3) in the mount's frame, by the robot's poses and Z."""
        A, points = self.motions.A, self.Z.apply(self.measured.points)
        return (points - A[:, None, :3, 3]) @ A[:, :3, :3]

    @cached_property
    def _measurement(self) -> tuple[Array, Array]:
        X = self.X.as_matrix()
        return self.measured.residuals((self.points_mount - X[:3, 3]) @ X[:3, :3])

    @cached_property
    def residuals(self) -> Array:
        """Observed less expected (poses, points, m), in the unit of what is measured."""
        return self._measurement[0]

    @cached_property
    def squares(self) -> Array:
        """The sum of squares of each pose (poses,), over px² and less what the robot's errors explain."""
        plain = np.sum(self.residuals**2, axis=(1, 2))
        if self.noise is None:
            return plain
        explained = np.einsum("pa,pa->p", self.normals[1][:, self.noise.side], self.robot_errors)
        return (plain - explained) / self.noise.px**2

    @property
    def cost(self) -> float:
        """The weighted sum of squares; infinite where a corner that was seen has no image."""
        cost = float(np.sum(self.squares if self.weights is None else self.weights * self.squares))
        return cost if np.isfinite(cost) else np.inf

    @cached_property
    def jacobian(self) -> Array:
        """The derivative (poses, points * m, unknowns) of what is expected, by the twists of X and Z and by `also`."""
        by_point = self._measurement[1]
        by_mount = by_point @ self.X.as_matrix()[:3, :3].T
        by_X = -by_mount @ twist_jacobian(self.points_mount)
        moved = self.motions.A[:, None, :3, :3].swapaxes(-1, -2) @ twist_jacobian(self.Z.apply(self.measured.points))
        columns = [by_X, by_mount @ moved]
        for twists in self.also:
            shift = twist_jacobian(self.points_mount) @ twists[:, None, :, None]
            columns.append(-by_mount @ shift)
        jacobian = np.concatenate(columns, axis=-1)
        return jacobian.reshape(len(self.motions), -1, jacobian.shape[-1])

    @cached_property
    def normals(self) -> tuple[Array, Array]:
        """JᵀJ (poses, unknowns, unknowns) and Jᵀr (poses, unknowns) of each pose, with its weight."""
        weights = np.ones(len(self.motions)) if self.weights is None else self.weights
        transposed = weights[:, None, None] * self.jacobian.swapaxes(1, 2)
        flat = self.residuals.reshape(len(self.motions), -1, 1)
        return transposed @ self.jacobian, (transposed @ flat)[..., 0]

    @cached_property
    def _spread(self) -> Array:
        """(GᵀG + px² S⁻¹)⁻¹ of each pose, (poses, 6, 6)."""
        assert self.noise is not None
        side = self.noise.side
        return inverse(self.normals[0][:, side, side] + self.noise.information)

    @cached_property
    def robot_errors(self) -> Array:
        """The most likely twists (poses, 6) of the robot's errors in the hand's frame, in radians and metres."""
        assert self.noise is not None
        return np.einsum("pab,pb->pa", self._spread, self.normals[1][:, self.noise.side])

    @cached_property
    def blocks(self) -> Array:
        """JᵀC⁻¹J of each pose (poses, unknowns, unknowns)."""
        N = self.normals[0]
        if self.noise is None:
            return N
        side = self.noise.side
        return (N - N[:, :, side] @ self._spread @ N[:, side, :]) / self.noise.px**2

    @cached_property
    def gradients(self) -> Array:
        """JᵀC⁻¹r of each pose (poses, unknowns)."""
        N, g = self.normals
        if self.noise is None:
            return g
        side = self.noise.side
        return (g - np.einsum("pab,pb->pa", N[:, :, side], self.robot_errors)) / self.noise.px**2

    def refined(self) -> Adjusted:
        """At the nearest least sum of squares (Levenberg–Marquardt); `also` stays where it is."""
        here, damping = replace(self, also=()), 1e-4
        for _ in range(MOST_STEPS):
            H, g = here.blocks.sum(axis=0), here.gradients.sum(axis=0)
            step = inverse(H + damping * np.diag(np.diag(H))) @ g
            if not step @ g > SETTLED * abs(here.cost):
                break
            there = replace(here, X=twisted(here.X, step[:6]), Z=twisted(here.Z, step[6:12]))
            if there.cost <= here.cost:
                here, damping = there, damping / 10
            elif damping < 1e8:
                damping *= 5
            else:
                break
        return replace(here, also=self.also)

    @cached_property
    def errors(self) -> tuple[Array, Array]:
        """How far each pose's board lies from where the robot has it: (poses,) in metres and in radians."""
        expected = self.X.inv() * self.motions.other_from_mount.inv() * self.Z
        off = expected.inv() * self.motions.cam_from_board
        return np.linalg.norm(off.translation, axis=-1), off.rotation.magnitude()

    @cached_property
    def displacements(self) -> Array:
        """The same in one number (poses,), in metres: a turn counts as what it moves at the lever's length."""
        shift, turn = self.errors
        return np.hypot(shift, self.motions.lever * turn)

    @cached_property
    def step(self) -> Array:
        """The Gauss–Newton step (unknowns,) from here, with those of `also` behind the twists."""
        return inverse(self.blocks.sum(axis=0)) @ self.gradients.sum(axis=0)

    @cached_property
    def covariance(self) -> Array:
        """Of the twists of X and Z, and of `also`, (unknowns, unknowns), in radians and metres.

        It is the jackknife that leaves out one pose at a time, to first order (`ByView`): what the robot and the
        board's corners do wrong is common to a pose's corners, so that poses are independent and corners are not.
        """
        unknowns = self.blocks.shape[-1]
        nothing = np.zeros((unknowns, unknowns))
        return ByView(self.blocks, self.gradients, nothing, np.zeros(unknowns)).covariance(sigma=1.0)

    @property
    def robot_lengths(self) -> Array:
        """The twists (poses, 6) of the mount, for `also`, where the robot's lengths grow: by 1 to twice as long."""
        A = self.motions.other_from_mount
        return np.concatenate([np.zeros((len(A), 3)), A.rotation.inv().apply(A.translation)], axis=-1)

    @property
    def scale(self) -> tuple[float, float]:
        """The factor by which the robot's lengths would have to be multiplied, and its σ, solved for beside X and Z."""
        there = replace(self, also=(self.robot_lengths,))
        return 1 + float(there.step[UNKNOWNS]), float(np.sqrt(there.covariance[UNKNOWNS, UNKNOWNS]))

    @property
    def model_covariance(self) -> Array:
        """What the noise alone gives, were it independent and as large as `noise` says: (JᵀC⁻¹J)⁻¹."""
        return inverse(self.blocks.sum(axis=0))


def robust(motions: Motions, X: RigidTransform, Z: RigidTransform, rounds: int = 6) -> Adjusted:
    """The places' solution in which a pose counts the less, the further it is off (Geman & McClure's weights)."""
    here = Adjusted(motions, Places(motions.cam_from_board, motions.lever), X, Z)
    for _ in range(rounds):
        scale = 2 * max(float(np.median(here.displacements)), 1e-9)
        weights = (1 + (here.displacements / scale) ** 2) ** -2.0
        here = replace(here, weights=weights).refined()
    return here


def far_off(displacements: Array, at_least: float = STRAY) -> Sequence[int]:
    """The poses that are off by `at_least` times the median or more, the worst first.

    >>> far_off(np.array([1.0, 1.2, 5.0, 0.8, 1.0]))
    [2]
    >>> far_off(np.array([1.0, 1.2, 4.9, 0.8, 1.0]))
    []
    """
    limit = at_least * float(np.median(displacements))
    return [int(i) for i in np.argsort(-displacements) if displacements[i] >= limit > 0]
