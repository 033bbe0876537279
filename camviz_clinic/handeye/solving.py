"""`hand_eye`: where a camera sits on a robot's hand, or beside the robot, with a σ that holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.jacobian import twist_jacobian
from camviz_clinic.calibration.motions import FEWEST, Mask, Motions, PoseError
from camviz_clinic.calibration.motions_solving import start
from camviz_clinic.calibration.problem import LEAST_CORNERS
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.rig import lone_poses
from camviz_clinic.handeye.adjusting import UNKNOWNS, Adjusted, Noise, Pixels, far_off, robust
from camviz_clinic.handeye.straying import surely
from camviz_clinic.handeye.weighing import weighed, weighed_in_pixels

MOST_STRAY = 0.2  # of the poses
UNKNOWN_DEG = 1.0  # turned less about every second axis, a direction of X's translation is not known
MOST_RESIZED = 10
SETTLED = 0.01  # σ: a smaller step of the scale ends the rounds
NOISE_TURNS = 3.0  # nor where the turn is less than so many times the robot's own errors


@dataclass(frozen=True, eq=False)
class HandEye:
    """Where the camera sits on its mount and the board on the other part, and how well that is known.

    With the eye in hand the mount is the robot's hand and the other part its base. With the eye to the hand the mount
    is the base and the other part the hand.

    Attributes:
        eye_to_hand: Whether the camera stands still and the board is on the hand.
        adjusted: The solution over the poses that were used.
        used: (poses,) of bool, true for a pose that does not contradict the others.
        displacements: (poses,), metres by which each pose's board is off, turns counted at the board's distance.
        stray: (poses,) of bool, true for a pose that contradicts the others. Where they are many, all poses are used.
        scale: By what the camera's lengths were multiplied to be those of the robot: 1 unless it was asked for.

    >>> from camviz_clinic.handeye.virtual import cell
    >>> true = cell(np.random.default_rng(2), poses=12)
    >>> found = hand_eye_from_corners(true.base_from_hand, true.pixels, true.camera, true.board)
    >>> found.x_name, found.z_name, found.known, round(found.times_sigma, 2)  # Student's, of 12 - 3 degrees of freedom
    ('hand_from_cam', 'base_from_board', array([ True,  True,  True]), 2.26)
    """

    eye_to_hand: bool
    adjusted: Adjusted
    used: Mask
    displacements: Array
    stray: Mask
    scale: float = 1.0

    @property
    def mount_from_cam(self) -> RigidTransform:
        """X, in metres."""
        return self.adjusted.X

    @property
    def other_from_board(self) -> RigidTransform:
        """Z, in metres."""
        return self.adjusted.Z

    @property
    def covariance(self) -> Array:
        """Of the twists of X and of Z, clustered by pose: the jackknife that leaves out one pose at a time.

        Returns: (12, 12), each twist (ω, τ) in the frame it leads to, in radians and metres.
        """
        return self.adjusted.covariance[:UNKNOWNS, :UNKNOWNS]

    @property
    def motions(self) -> Motions:
        """The poses that were used."""
        return self.adjusted.motions

    @property
    def noise(self) -> Noise | None:
        """The sizes of the errors of corners and robot; None where no corners were given."""
        return self.adjusted.noise if isinstance(self.adjusted.measured, Pixels) else None

    @property
    def rms_px(self) -> float:
        """The RMS length in pixels of the corners' residuals, by the robot's poses as told; NaN without corners."""
        measured = self.adjusted.measured
        if not isinstance(measured, Pixels):
            return float("nan")
        return float(np.sqrt(np.sum(self.adjusted.residuals**2) / np.isfinite(measured.pixels).all(axis=-1).sum()))

    @property
    def x_name(self) -> str:
        """What X is called: "hand_from_cam" or "base_from_cam"."""
        return "base_from_cam" if self.eye_to_hand else "hand_from_cam"

    @property
    def z_name(self) -> str:
        """What Z is called: "hand_from_board" or "base_from_board"."""
        return "hand_from_board" if self.eye_to_hand else "base_from_board"

    @property
    def turn_noise_deg(self) -> float:
        """The robot's own errors about an axis, in degrees; without corners those of robot and board together."""
        if self.noise is not None:
            return float(np.degrees(self.noise.turn))
        return float(np.degrees(np.median(self.displacements) / self.motions.lever / np.sqrt(6)))

    @property
    def unknown_directions(self) -> Array:
        """The directions of X's translation that the motions do not tell.

        Aᵢⱼ X = X Bᵢⱼ has X's translation only in (R_A - 1) t_X, so that t_X along the one axis of all turns is free. If
        nothing turned, all three directions are.

        Returns: (n, 3), unit vectors in the mount's frame.
        """
        turning, least = self.motions.turning, max(UNKNOWN_DEG, NOISE_TURNS * self.turn_noise_deg)
        if turning.deg[0] < least:
            return np.eye(3)
        return turning.axes[:1] if turning.deg[1] < least else np.zeros((0, 3))

    @property
    def known(self) -> Mask:
        """Which coordinates of X's translation the motions tell: those that no unknown direction leans to.

        Returns: (3,) of bool, true for one that is told.
        """
        return np.asarray((np.abs(self.unknown_directions) < 0.1).all(axis=0))

    @property
    def translation_sigma(self) -> Array:
        """One standard deviation of X's translation.

        Returns: (3,), metres.
        """
        return self._sigma(self.mount_from_cam, slice(0, 6))[1]

    @property
    def rotation_sigma(self) -> Array:
        """One standard deviation of X's rotation about the mount's axes.

        Returns: (3,), radians.
        """
        return self._sigma(self.mount_from_cam, slice(0, 6))[0]

    @property
    def board_translation_sigma(self) -> Array:
        """One standard deviation of Z's translation.

        Returns: (3,), metres.
        """
        return self._sigma(self.other_from_board, slice(6, 12))[1]

    @property
    def times_sigma(self) -> float:
        """How many σ an interval of 95 % reaches to either side: Student's, with as many poses less three."""
        return float(student.ppf(0.975, max(len(self.motions) - FEWEST, 1)))

    @property
    def scale_sigma(self) -> float:
        """One standard deviation of `scale`, clustered by pose: 0 where the scale was not asked for."""
        if not self.adjusted.also:
            return 0.0
        return self.scale * float(np.sqrt(self.adjusted.covariance[UNKNOWNS, UNKNOWNS]))

    @property
    def scale_known(self) -> bool:
        """Whether the motions tell the scale: it is away from 0 by as much as a 95 % interval reaches."""
        return bool(self.scale > self.times_sigma * self.scale_sigma)

    def _sigma(self, pose: RigidTransform, part: slice) -> tuple[Array, Array]:
        """Of a pose's rotation and translation: δt = ω × t + τ."""
        covariance = self.covariance[part, part]
        carried = twist_jacobian(np.asarray(pose.translation))
        shift = carried @ covariance @ carried.T
        return np.sqrt(np.diag(covariance)[:3]), np.sqrt(np.diag(shift))


def hand_eye(
    base_from_hand: RigidTransform,
    cam_from_board: RigidTransform,
    *,
    eye_to_hand: bool = False,
    any_scale: bool = False,
) -> HandEye:
    """X and Z of A X B = Z, from poses of a robot and poses of a board.

    A start in closed form (Park & Martin) from the triple of poses that most others agree with is refined over all
    poses at once. A pose is set aside where it is off by five times the median or more, and by more than chance. How
    much a turn, a shift across the picture, the board's distance and the robot's own poses count is learnt from what
    they leave.

    Args:
        base_from_hand: The robot's poses, in metres.
        cam_from_board: The board's poses in the pictures that belong to them, in metres.
        eye_to_hand: The camera stands still and the board is on the hand.
        any_scale: The lengths of `cam_from_board` are in a unit that is not known, as those of a film without a board
            are. The factor is solved for with X and Z.

    Returns: X, Z, and the covariance clustered by pose.
    Raises: PoseError for fewer than three poses, and where there are not as many of the one as of the other.
    Source: F. Park & B. Martin, *Robot sensor calibration: solving AX = XB on the Euclidean group*, IEEE Transactions
    on Robotics and Automation 10 (1994), for the start; A. Tabb & K. Ahmad Yousef, *Solving the robot-world hand-eye(s)
    calibration problem with iterative methods*, Machine Vision and Applications 28 (2017), for the refinement.

    >>> from camviz_clinic.handeye.virtual import cell
    >>> true = cell(np.random.default_rng(1), robot_mm=0, robot_deg=1e-9)
    >>> B = true.X.inv() * true.base_from_hand.inv() * true.Z  # what a perfect camera sees
    >>> np.abs(hand_eye(true.base_from_hand, B).mount_from_cam.translation - true.X.translation).max() < 1e-9
    np.True_
    """
    motions = Motions.of(base_from_hand, cam_from_board, eye_to_hand)
    return _resized(motions, eye_to_hand, None) if any_scale else _result(_started(motions), eye_to_hand, None)


def _resized(motions: Motions, eye_to_hand: bool, pixels: Pixels | None) -> HandEye:
    """The solution with the camera's lengths, and the board, multiplied by the factor of least squares."""

    def solved(first: Adjusted) -> HandEye:
        return _result(first, eye_to_hand, pixels.resized(factor) if pixels else None)

    factor = 1 / start(motions, None)[2]
    found = solved(_started(motions.resized(factor)))
    for _ in range(MOST_RESIZED):
        shorter, sigma = found.adjusted.scale
        if not abs(shorter - 1) > SETTLED * sigma:
            break
        factor /= max(shorter, 0.1)
        found = solved(robust(motions.resized(factor), found.mount_from_cam, found.other_from_board))
    adjusted = replace(found.adjusted, also=(found.adjusted.robot_lengths,))
    return replace(found, adjusted=adjusted, scale=factor)


def hand_eye_from_corners(
    base_from_hand: RigidTransform,
    pixels: ArrayLike,
    camera: Camera,
    board: Board,
    *,
    eye_to_hand: bool = False,
    any_scale: bool = False,
) -> HandEye:
    """`hand_eye` with the board's corners in place of its poses, refined through their reprojection errors.

    Each pose of the robot is off by an error of its own, whose size is learnt from the corners and told in `noise`: the
    board's true pose in every picture is solved for with X and Z. Where a picture's corners are off together, as by a
    camera or a board that is not quite as told, they count less, by as much as is learnt.

    Args:
        base_from_hand: The robot's poses, in metres.
        pixels: (poses, corners, 2), pixels of the board's corners in the pictures that belong to them; NaN where one is
            not seen.
        camera: The calibrated camera.
        board: What the pictures show.
        eye_to_hand: The camera stands still and the board is on the hand.
        any_scale: The board's lengths are not known. By what they must be multiplied is solved for with X and Z.

    Returns: X, Z, and the covariance clustered by pose.

    Raises:
        PoseError: For poses of other number than pictures, for fewer than three with four corners or more, and where
            corners have no image by the robot's poses.

    >>> from camviz_clinic.handeye.virtual import cell
    >>> true = cell(np.random.default_rng(1))  # a robot that is good to 0.2 mm and 0.03° along each axis
    >>> found = hand_eye_from_corners(true.base_from_hand, true.pixels, true.camera, true.board)
    >>> 1000 * np.linalg.norm(found.mount_from_cam.translation - true.X.translation) < 1
    np.True_
    >>> (1000 * found.translation_sigma).max().round(1), round(1000 * found.noise.shift, 1)
    (np.float64(0.2), 0.2)
    """
    corners = np.asarray(pixels, dtype=float)
    if len(corners) != len(base_from_hand):
        raise PoseError(f"there must be as many poses as pictures, got {len(base_from_hand)} and {len(corners)}")
    seen = np.isfinite(corners).all(axis=-1).sum(axis=1) >= LEAST_CORNERS
    if seen.sum() < FEWEST:
        raise PoseError(f"at least {FEWEST} poses with a picture of the board are needed, got {seen.sum()}")
    alone = Camera(camera.intrinsics, camera.lens)
    cam_from_board = lone_poses(alone, board, corners[seen])
    motions = Motions.of(base_from_hand[seen], cam_from_board, eye_to_hand)
    measured = Pixels(alone, board.corners, corners[seen])
    if any_scale:
        return spread_out(_resized(motions, eye_to_hand, measured), seen)
    return spread_out(_result(_started(motions), eye_to_hand, measured), seen)


def spread_out(result: HandEye, seen: Mask) -> HandEye:
    """A result of the poses `seen`, with what is told of every pose told of all: False and NaN for the others."""
    used, stray, displacements = np.zeros(len(seen), bool), np.zeros(len(seen), bool), np.full(len(seen), np.nan)
    used[seen], stray[seen], displacements[seen] = result.used, result.stray, result.displacements
    return replace(result, used=used, stray=stray, displacements=displacements)


def _started(motions: Motions) -> Adjusted:
    X, Z, _ = start(motions)
    return robust(motions, RigidTransform.from_matrix(X), RigidTransform.from_matrix(Z))


def _result(first: Adjusted, eye_to_hand: bool, pixels: Pixels | None) -> HandEye:
    """The solution over the poses that do not contradict the others."""
    stray: Mask = np.asarray(np.isin(np.arange(len(first.motions)), far_off(first.displacements)))
    stray &= (~stray).sum() >= FEWEST
    best = _over(first, ~stray, eye_to_hand, pixels)
    while stray.any():
        sure = surely(best, first.motions, pixels, stray)
        if (sure == stray).all():
            break
        stray = sure
        best = _over(first, ~stray, eye_to_hand, pixels)
    used: Mask = np.asarray(~stray | (stray.mean() > MOST_STRAY))
    if stray.any() and used.all():
        best = _over(first, used, eye_to_hand, pixels)
    everywhere = replace(best, motions=first.motions, measured=first.measured, noise=None)
    return HandEye(eye_to_hand, best, used, everywhere.displacements, stray)


def _over(first: Adjusted, used: Mask, eye_to_hand: bool, pixels: Pixels | None) -> Adjusted:
    """The solution over some poses, with the sizes of errors that they show."""
    best = replace(first, motions=first.motions.only(used), measured=first.measured.only(used), weights=None)
    best = best.refined()
    side = slice(6, 12) if eye_to_hand else slice(0, 6)
    if pixels is None:
        return weighed(best, side)
    best = replace(best, measured=pixels.only(used))
    if not np.isfinite(best.cost):
        raise PoseError("by the robot's poses some corners would lie where the camera has no image")
    return weighed_in_pixels(best, corner_noise(pixels.only(used), best.motions.cam_from_board), side)


def corner_noise(pixels: Pixels, cam_from_board: RigidTransform) -> float:
    """σ in pixels of a corner's coordinate, where every picture's board has the pose that fits it best."""
    B = cam_from_board.as_matrix()
    residuals, _ = pixels.residuals(pixels.points @ np.swapaxes(B[:, :3, :3], 1, 2) + B[:, None, :3, 3])
    seen = int(np.isfinite(pixels.pixels).all(axis=-1).sum())
    return max(float(np.sqrt(np.sum(residuals**2) / max(2 * seen - 6 * len(B), 1))), 1e-6)
