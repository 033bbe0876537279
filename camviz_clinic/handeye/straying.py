"""Which poses are surely off: by more than the errors that the other poses show would bring about by chance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as fisher

from camviz.lenses.base import Array
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.jacobian import twist_jacobian
from camviz_clinic.calibration.motions import Mask, Motions
from camviz_clinic.handeye.adjusting import Adjusted, Pixels
from camviz_clinic.handeye.weighing import PRIOR, BoardPoses

CHANCE = 0.001  # that one of a healthy set's poses is called stray


@dataclass(frozen=True, eq=False)
class Offsets:
    """How far each pose's board lies from where the robot has it, and the errors that this is made of.

    Attributes:
        twists: (poses, 6), turn and shift of the board in the camera's frame, in radians and metres.
        jacobian: (poses, 6, 12), the derivative of where the robot has it by the twists of X and Z.
        parts: (sizes, poses, 6, 6), the covariance of a twist that each of the learnt sizes gives; they add up.
    """

    twists: Array
    jacobian: Array
    parts: Array

    @classmethod
    def of(cls, solution: Adjusted, motions: Motions, pixels: Pixels | None) -> Offsets:
        """Of all poses, by X, Z and the sizes of a solution over some of them.

        Derivatives are taken where the picture has the board. A stray pose may put it where the camera has no image.
        """
        noise, boards = solution.noise, motions.cam_from_board
        assert noise is not None
        expected = solution.X.inv() * motions.other_from_mount.inv() * solution.Z
        turns = (boards.rotation * expected.rotation.inv()).as_rotvec()
        twists = np.concatenate([turns, boards.translation - expected.translation], axis=-1)
        seen = replace(motions, other_from_mount=solution.Z * boards.inv() * solution.X.inv())
        unit = BoardPoses(boards)
        there = replace(solution, motions=seen, measured=unit, noise=None, weights=None, also=())
        jacobian = unit.twists(there.jacobian)
        robot = jacobian[:, :, noise.side]
        turn, shift = (part @ part.swapaxes(1, 2) for part in np.split(robot, 2, axis=2))
        own = _own_poses(solution, motions) if pixels is None else [noise.px**2 * _by_corners(pixels, motions.B)]
        return cls(twists, jacobian, np.stack([*own, noise.turn**2 * turn, noise.shift**2 * shift]))

    def chances(self, stray: Mask) -> Array:
        """How probable it is for each stray pose (n,) to be as far off, were it like the others.

        The square of its twist over the covariance is a sixth of Fisher's F with six degrees of freedom, and as many
        more as the others tell the sizes with, in the direction in which the pose is off.

        Source: F. Satterthwaite, *An approximate distribution of estimates of variance components*, Biometrics Bulletin
        2 (1946), for the degrees of freedom.
        """
        spread, sizes = self._learnt(~stray)
        J, twists, parts = self.jacobian[stray], self.twists[stray], self.parts[:, stray]
        own = parts.sum(axis=0)
        along = np.linalg.solve(own + J @ spread @ J.swapaxes(1, 2), twists[..., None])[..., 0]
        squares = np.einsum("pa,pa->p", along, twists)
        shares = (
            np.einsum("pa,kpab,pb->pk", along, parts, along) / np.einsum("pa,pab,pb->p", along, own, along)[:, None]
        )
        freedom = 2 / np.einsum("pk,kl,pl->p", 2 * shares, sizes, 2 * shares)
        return np.asarray(fisher.sf(squares / 6, 6, freedom))

    def _learnt(self, used: Mask) -> tuple[Array, Array]:
        """The covariances that the used poses give of X and Z (12, 12), and of the logarithms of the sizes.

        The second is the inverse of their restricted likelihood's expected information, with its prior:
        2 tr(P Cₖ P Cₗ), where P = W - W J (JᵀWJ)⁻¹ JᵀW.
        """
        J, parts = self.jacobian[used], self.parts[:, used]
        W = inverse(parts.sum(axis=0))
        WJ = W @ J
        spread = inverse(np.einsum("pia,pib->ab", J, WJ))
        weighed = W @ parts
        shared = np.einsum("pia,kpij,pjb->kab", WJ, parts, WJ) @ spread
        both = np.einsum("pia,kpij,lpjm,pmb,ba->kl", J, weighed, weighed, WJ, spread, optimize=True)
        information = np.einsum("kpij,lpji->kl", weighed, weighed) - 2 * both + np.einsum("kab,lba->kl", shared, shared)
        return spread, np.linalg.inv(2 * information + np.eye(len(parts)) / PRIOR**2)


def surely(solution: Adjusted, motions: Motions, pixels: Pixels | None, stray: Mask) -> Mask:
    """Which of the poses that a solution left out (poses,) are off by more than chance, of all poses together.

    Args:
        solution: Over the other poses, with the sizes of their errors.
        motions: All poses.
        pixels: The corners in all of their pictures, where the solution is one from corners.
        stray: (poses,) of bool, those that were left out.

    >>> from camviz_clinic.checks.rig import lone_poses
    >>> from camviz_clinic.handeye.adjusting import robust
    >>> from camviz_clinic.handeye.virtual import cell
    >>> from camviz_clinic.handeye.weighing import weighed
    >>> true = cell(np.random.default_rng(1), 12)  # a healthy one, whose first pose is left out nevertheless
    >>> motions = Motions.of(true.base_from_hand, lone_poses(true.camera, true.board, true.pixels), False)
    >>> first = np.arange(12) == 0
    >>> others = weighed(robust(motions.only(~first), true.X, true.Z), slice(0, 6))
    >>> surely(others, motions, None, first).any()
    np.False_
    """
    sure = np.zeros(len(stray), bool)
    sure[stray] = len(stray) * Offsets.of(solution, motions, pixels).chances(stray) <= CHANCE
    return sure


def _own_poses(solution: Adjusted, motions: Motions) -> list[Array]:
    """The covariances (poses, 6, 6) of the board's poses, one for each size of their errors."""
    measured = solution.measured
    assert isinstance(measured, BoardPoses)
    sizes = ((measured.turn, [0, 1, 2]), (measured.across, [3, 4]), (measured.along, [5]))
    return [np.tile(np.diag(size**2 * np.isin(range(6), axes)), (len(motions), 1, 1)) for size, axes in sizes]


def _by_corners(pixels: Pixels, B: Array) -> Array:
    """The covariances (poses, 6, 6) of the board's poses (poses, 4, 4) where a corner's is one square pixel."""
    around = pixels.points @ B[:, :3, :3].swapaxes(1, 2)
    _, by_point = pixels.residuals(around + B[:, None, :3, 3])
    G = (by_point @ twist_jacobian(around)).reshape(len(B), -1, 6)
    return inverse(G.swapaxes(1, 2) @ G)
