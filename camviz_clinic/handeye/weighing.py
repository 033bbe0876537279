"""How exact the board's poses and the robot's are, learnt from what they leave of A X B = Z."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.motions import Mask
from camviz_clinic.handeye.adjusting import UNKNOWNS, Adjusted, Noise

FAR = 1e4  # metres: a shift of the board turns the direction to a point so far away by next to nothing
PRIOR = 1.0  # of a size's logarithm: sizes beyond 7 times those it begins with count as unlikely
SMALLEST = 1e-9  # radians, metres
ROUNDS = 3
HELD = 1e-13  # of a parameter's own information, where the motions tell nothing of it


@dataclass(frozen=True, eq=False)
class BoardPoses:
    """The board's pose in each picture, whose errors have sizes: residuals are counted in these.

    A board's distance is known worse than the direction it lies in, and its turn worse or better than either. The
    board's origin tells the place, and points on its axes so far away that only its turn moves them tell the turn.

    Args:
        cam_from_board: In metres.
        turn: One standard deviation about each axis, in radians.
        across: Of the origin along the picture's x and y, in metres.
        along: Of the origin along the optical axis, in metres.
    """

    cam_from_board: RigidTransform
    turn: float = 1.0
    across: float = 1.0
    along: float = 1.0

    @property
    def points(self) -> Array:
        """(7, 3), in metres."""
        return FAR * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])

    def residuals(self, points_cam: Array) -> tuple[Array, Array]:
        """Observed less expected in standard deviations (poses, 7, 3), and the expected one's derivative."""
        B = self.cam_from_board.as_matrix()
        sizes = np.full((7, 3), 2 * FAR * self.turn)  # a turn moves points on two of three axes, to both sides
        sizes[0] = self.across, self.across, self.along
        seen = self.points @ np.swapaxes(B[:, :3, :3], 1, 2) + B[:, None, :3, 3]
        by_point = np.broadcast_to(np.eye(3) / sizes[..., None], (*points_cam.shape, 3))
        return (seen - points_cam) / sizes, by_point

    def only(self, kept: Mask) -> BoardPoses:
        """Of some poses."""
        return replace(self, cam_from_board=self.cam_from_board[kept])

    def twists(self, rows: Array) -> Array:
        """Residuals (poses, 21, n), or their derivatives, as turn and shift of the board in the camera (poses, 6, n).

        It takes sizes of 1. A turn ω moves the axis a by ω × a, and Σ a × (ω × a) over three axes is 2 ω.
        """
        by_point = rows.reshape(len(rows), 7, 3, -1)
        moved = by_point[:, 1:4] - by_point[:, 4:7]
        axes = self.cam_from_board.as_matrix()[:, :3, :3].swapaxes(1, 2)
        turn = np.cross(axes[..., None], moved, axis=2).sum(axis=1) / 2
        return np.concatenate([turn, by_point[:, 0]], axis=1)


def weighed(plain: Adjusted, side: slice) -> Adjusted:
    """X and Z at the least sum of squares where errors of turn, place and robot count by sizes that are learnt.

    Every pose of the robot is off by a twist in the hand's frame, every pose of the board by a turn and a shift in the
    camera's. Five sizes are those of greatest restricted likelihood, with a wide prior around what all poses leave.

    Args:
        plain: The solution in which all counts alike.
        side: The columns of X's twist where the mount is the hand, of Z's where the board is on the hand.

    Returns: The solution, whose residuals are in standard deviations.

    Source: H. Patterson & R. Thompson, *Recovery of inter-block information when block sizes are unequal*, Biometrika
    58 (1971), for the likelihood; K. Strobl & G. Hirzinger, *Optimal hand-eye calibration*, IROS (2006), for weighing a
    hand-eye's turns and shifts by their own scatter.
    """
    here, logarithms = plain, np.empty(0)
    for _ in range(ROUNDS):
        unit = BoardPoses(plain.motions.cam_from_board)
        bare = replace(here, measured=unit, noise=None, weights=None)
        twists = unit.twists(bare.residuals.reshape(len(bare.motions), -1, 1))[..., 0]
        jacobian = unit.twists(bare.jacobian)

        def covariance(s: Array, robot: Array = jacobian[:, :, side]) -> Array:
            own = (robot * s[[3, 3, 3, 4, 4, 4]] ** 2) @ robot.swapaxes(1, 2)
            return np.asarray(np.diag(s[[0, 0, 0, 1, 1, 2]] ** 2) + own)

        turned, shifted = (max(float(np.sqrt(np.mean(part**2))), SMALLEST) for part in np.split(twists, 2, axis=1))
        middle = np.log([turned, shifted, shifted, turned / 2, shifted / 2])
        logarithms = _likeliest(twists, jacobian, covariance, logarithms if len(logarithms) else middle, middle)
        turn, across, along, robot_turn, robot_shift = map(float, np.exp(logarithms))
        measured = BoardPoses(plain.motions.cam_from_board, turn, across, along)
        here = replace(bare, measured=measured, noise=Noise(1.0, robot_turn, robot_shift, side)).refined()
    return here


def weighed_in_pixels(plain: Adjusted, px: float, side: slice) -> Adjusted:
    """X and Z at the least sum of squared pixels where the robot's own errors count by sizes that are learnt.

    A camera or a board that is not quite as told moves all corners of a picture together, as a wrong pose of the board
    would. So how much the corners count from picture to picture is learnt as well: it is that of errors as large as
    they scatter in one picture, or larger.

    Args:
        plain: The solution in which all counts alike, with corners as its measurements.
        px: How far corners scatter in one picture, in pixels.
        side: The columns of X's twist where the mount is the hand, of Z's where the board is on the hand.
    """
    size = max(float(np.sqrt(np.mean(plain.displacements**2) / 6)), 1e-7)
    middle = np.log([px, size / plain.motions.lever, size])
    here, logarithms = plain, middle
    for _ in range(ROUNDS):
        bare = replace(here, noise=None, weights=None)
        N, g = bare.normals
        inner = inverse(N[:, side, side])  # of the hand's twist that the corners of a picture tell

        def covariance(s: Array, inner: Array = inner) -> Array:
            return np.asarray(s[0] ** 2 * inner + np.diag(s[[1, 1, 1, 2, 2, 2]] ** 2))

        twists = np.einsum("pab,pb->pa", inner, g[:, side])
        logarithms = _likeliest(twists, inner @ N[:, side], covariance, logarithms, middle, least=middle[0])
        common, turn, shift = map(float, np.exp(logarithms))
        here = replace(bare, noise=Noise(common, turn, shift, side)).refined()
    return here


def _likeliest(
    twists: Array,
    jacobian: Array,
    covariance: Callable[[Array], Array],
    begun: Array,
    middle: Array,
    least: float | None = None,
) -> Array:
    """The logarithms of sizes of greatest restricted likelihood, with a prior around `middle`.

    Args:
        twists: (poses, 6), turn and shift of each board against where the robot has it.
        jacobian: (poses, 6, 12), its derivative by the twists of X and Z.
        covariance: Of the twists, (poses, 6, 6), by the sizes.
        begun: Where to begin.
        middle: Those of the prior.
        least: What the first cannot be less than.
    """

    def improbability(logarithms: Array) -> float:
        C = covariance(np.exp(logarithms))
        W = np.linalg.inv(C)
        WJ = W @ jacobian
        H = np.einsum("pia,pib->ab", jacobian, WJ)
        scale = np.sqrt(np.diag(H))
        N = H / np.outer(scale, scale) + HELD * np.eye(UNKNOWNS)
        step = np.linalg.solve(N, np.einsum("pia,pi->a", WJ, twists) / scale) / scale
        left = twists - jacobian @ step
        squares = np.einsum("pi,pij,pj->", left, W, left)
        size = np.linalg.slogdet(C)[1].sum() + np.linalg.slogdet(N)[1] + 2 * np.log(scale).sum()
        return float(squares + size + np.sum(((logarithms - middle) / PRIOR) ** 2)) / 2

    bounds = [(least, None), *[(None, None)] * (len(begun) - 1)]
    return np.asarray(minimize(improbability, begun, method="L-BFGS-B", bounds=bounds).x)
