"""Where a known camera stood for each picture of a board, with the covariance of each pose.

The pose is that of least squares over the corners in the picture. Its covariance is what the corners' noise gives by
the Jacobian J, σ² (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹. σ is the picture's own, or that of all pictures where it is larger. Finders err
alike at corners that are near each other, so that R is not 1: the noise of two corners correlates by ρ to the power of
their distance along the rows and columns, with ρ from the residuals of all pictures (0 for independent corners).
What the camera's own numbers are uncertain by is added, W Σ Wᵀ, where their covariance Σ is known: the poses of all
pictures share that part. A board that is not flat, motion, and a rolling shutter are not in it. Nor is what a finder is
off by smoothly over the whole board: the pose takes it up, and no residual is left. OpenCV's sectors are, by 0.03 px:
so chessboards are refined to their saddle points (`finding.FINDERS`).

A flat board that is small or far away has two poses that fit nearly as well, mirrored about the line of sight to it
(Schweighofer & Pinz, *Robust pose estimation from a planar target*, IEEE PAMI 28, 2006). Both are tried. Where the
corners do not tell them apart the picture is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import stdtrit

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.outliers import outliers
from camviz_clinic.calibration.problem import LEAST_CORNERS, POSE
from camviz_clinic.calibration.types import Board, Mask
from camviz_clinic.checks.rig import board_poses

TRIMMINGS = 3
ROUNDS = 8  # of setting corners aside
APART_DEG = 2.0  # between two poses that are not one
MIRROR_STEPS = 30
MOST_ALIKE = 0.95
SURE = 25.0  # χ²: of two poses the worse is then true with odds of exp(-25/2), one in 270,000


class NoPose(ValueError):  # noqa: N818 - it says what is the case
    """Pictures none of which has a pose; the message is one sentence."""


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """Pictures of a board, and where the camera stood; the world is the board's frame.

    Args:
        board: What they show.
        camera: Without a place of its own.
        names: Of the pictures.
        places: Their indices among all the pictures that were looked at.
        cam_from_board: (pictures,), in metres.
        covariance: (pictures, 6, 6), of the twist (ω, τ), p → p + ω × p + τ in the camera's frame: radians, metres.
        rms: (pictures,), of the distances of the corners from where the pose puts them, in pixels.
        corners: (pictures,), how many corners have a say.
        sigma: The corners' noise in pixels, along each axis, in all pictures.
        correlation: ρ, of the noise of neighbouring corners.
        freedom: Degrees of freedom that `sigma` is known by.
        camera_counted: Whether the uncertainty of the camera's own numbers is in the covariance.
        refused: tuple of (str, str), the pictures without a pose, each with the reason.
    """

    board: Board
    camera: Camera
    names: tuple[str, ...]
    places: tuple[int, ...]
    cam_from_board: RigidTransform
    covariance: Array
    rms: Array
    corners: Array
    sigma: float
    correlation: float
    freedom: int
    camera_counted: bool
    refused: tuple[tuple[str, str], ...] = ()

    @cached_property
    def board_from_cam(self) -> RigidTransform:
        """Where the camera stood and looked, (pictures,)."""
        return self.cam_from_board.inv()

    @cached_property
    def place_covariance(self) -> Array:
        """Of the camera's centre in the board's frame, (pictures, 3, 3), in m²: C = -Rᵀt moves by -Rᵀτ."""
        R = self.cam_from_board.rotation.as_matrix()
        return np.asarray(np.swapaxes(R, 1, 2) @ self.covariance[:, 3:, 3:] @ R)

    @property
    def place_sigma(self) -> Array:
        """Standard deviations (pictures, 3) in metres of the camera's centre along the board's axes."""
        return np.sqrt(np.einsum("vii->vi", self.place_covariance))

    @property
    def turn_sigma(self) -> Array:
        """Standard deviations (pictures, 3) in radians of the turn about the camera's own axes."""
        return np.sqrt(np.einsum("vii->vi", self.covariance[:, :3, :3]))

    @property
    def times_sigma(self) -> float:
        """How many standard deviations an interval of 95 % reaches to either side (Student's t)."""
        return float(stdtrit(self.freedom, 0.975))


def find_poses(
    camera: Camera,
    board: Board,
    detections: Detections,
    estimated: tuple[str, ...] = (),
    covariance: Array | None = None,
) -> CameraPoses:
    """The pose of a camera in each picture of a board, with its covariance.

    Args:
        camera: Known; where it stands does not count.
        board: What the pictures show.
        detections: Its corners in them.
        estimated: Which of the camera's numbers have the covariance.
        covariance: (n, n), of those numbers; without it the camera is taken to be exact.

    Returns: One pose for each picture in which the corners decide it; the others are refused.
    Raises: NoPose where there is none.

    >>> from camviz_clinic.checks import virtual
    >>> rng = np.random.default_rng(1)
    >>> truth = virtual.single(rng)  # a camera and boards before it, whose corners are seen with noise
    >>> found = find_poses(truth.camera, truth.board, virtual.detections(truth.camera, truth.observed(rng)[0]))
    >>> off = (found.board_from_cam.translation - truth.cam_from_board.inv().translation) / found.place_sigma
    >>> bool(np.sqrt(np.mean(off**2)) < 1.2)  # in standard deviations
    True
    """
    alone = Camera(camera.intrinsics, camera.lens)
    problem = Adjustment(
        board,
        {"camera": alone},
        {"camera": detections.corners},
        board_poses(alone, board, detections.corners),
        {"camera": ()},
        independent_corners=True,
    )
    solved, other = _best(problem)
    reasons = _reasons(solved, other)
    kept = np.array([not why for why in reasons])
    refused = tuple((name, why) for name, why in zip(detections.pictures, reasons, strict=True) if why)
    if not kept.any():
        raise NoPose(f"none of the pictures has a pose: {refused[0][1]} ({refused[0][0]})")
    solved = solved.only(kept)
    counted = covariance is not None and len(estimated) > 0
    of_camera = np.zeros((0, 0)) if covariance is None or not counted else covariance
    if counted:
        solved = replace(solved, estimated={"camera": estimated})
    return CameraPoses(
        board,
        alone,
        tuple(name for name, keep in zip(detections.pictures, kept, strict=True) if keep),
        tuple(place for place, keep in zip(detections.places, kept, strict=True) if keep),
        solved.first_from_board,
        _covariance(solved, of_camera),
        np.sqrt(_squares(solved) / solved.used["camera"].sum(axis=1)),
        solved.used["camera"].sum(axis=1),
        _sigma(solved),
        _correlation(solved),
        solved.measurements - len(POSE) * solved.views,
        counted,
        (*detections.skipped, *refused),
    )


def _best(problem: Adjustment) -> tuple[Adjustment, Adjustment]:
    """The poses of least squares, and those in which the other of two minima was reached, with the same corners."""
    first = _settled(problem)
    second = replace(first, first_from_board=_mirrored(first)).refined(only_poses=True, most_steps=MIRROR_STEPS)
    better = _squares(second) < _squares(first)
    if better.any():
        first = _settled(replace(problem, first_from_board=_mixed(better, second, first)))
        second = replace(first, first_from_board=_mirrored(first)).refined(only_poses=True, most_steps=MIRROR_STEPS)
    return first, second


def _settled(problem: Adjustment) -> Adjustment:
    """At the least squares, with the corners set aside that contradict the others.

    Of four corners, as of one marker, each is needed: where they disagree, the view's own scatter makes its ± larger.
    """
    problem = _trimmed(problem)
    spare = np.isfinite(problem.detections["camera"]).all(axis=-1).sum(axis=1) > LEAST_CORNERS
    for turn in range(ROUNDS):
        found = {"camera": outliers(problem, at_first=turn == 0)["camera"] & spare[:, None]}
        if turn > ROUNDS / 2:  # one that changes sides again and again goes
            found = {"camera": found["camera"] | problem.set_aside["camera"]}
        if turn and np.array_equal(found["camera"], problem.set_aside["camera"]):
            break
        problem = replace(problem, set_aside=found).refined(only_poses=True)
    return problem


def _trimmed(problem: Adjustment) -> Adjustment:
    """Each pose fitted to the better half of its corners (least trimmed squares, Rousseeuw 1984)."""
    for _ in range(TRIMMINGS):
        problem = problem.refined(only_poses=True, most_steps=MIRROR_STEPS)
        far = np.linalg.norm(problem.residuals["camera"], axis=-1)
        counts = np.isfinite(far).sum(axis=1)
        half = np.clip(np.maximum(counts // 2, FEWEST - 1), 0, np.maximum(counts - 1, 0))
        limit = np.take_along_axis(np.sort(far, axis=1), half[:, None], axis=1)  # NaN are sorted to the end
        problem = replace(problem, set_aside={"camera": far > limit})
    return problem


def _mirrored(problem: Adjustment) -> RigidTransform:
    """The boards turned by 180° about the line of sight to their middles, and about their own normals."""
    poses, middle = problem.first_from_board, problem.board.corners.mean(axis=0)
    seen = np.atleast_2d(poses.apply(middle))
    sight = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    turns = Rotation.from_rotvec(np.pi * sight) * poses.rotation * Rotation.from_rotvec([0, 0, np.pi])
    return RigidTransform.from_components(seen - turns.apply(middle), turns)


def _mixed(which: Mask, these: Adjustment, others: Adjustment) -> RigidTransform:
    pairs = zip(which, these.first_from_board, others.first_from_board, strict=True)
    return RigidTransform.concatenate([this if chosen else other for chosen, this, other in pairs])


def _reasons(solved: Adjustment, other: Adjustment) -> list[str]:
    """Why each picture has no pose; empty where it has one."""
    used, corners = solved.used["camera"], np.isfinite(solved.detections["camera"]).all(axis=-1).sum(axis=1)
    with np.errstate(invalid="ignore"):  # of a view that has no pose
        gained = (_squares(other) - _squares(solved)) / max(_sigma(solved), np.finfo(float).tiny) ** 2
    turns = (solved.first_from_board.rotation * other.first_from_board.rotation.inv()).magnitude()
    apart = np.degrees(np.atleast_1d(turns)) > APART_DEG
    reasons = []
    for view in range(solved.views):
        if not used[view].any():
            reasons.append(f"its {corners[view]} corners do not fit one pose of the board before this camera")
        elif not np.isfinite(_sigma(solved)):
            reasons.append("its few corners leave nothing to tell their noise by")
        elif apart[view] and gained[view] < SURE:
            reasons.append("two poses fit the board nearly as well: take it from nearer, or more from the side")
        else:
            reasons.append("")
    return reasons


def _squares(problem: Adjustment) -> Array:
    """The sum of squares (views,) over the corners in use; infinite for a view without one."""
    used = problem.used["camera"]
    squares = np.where(used, np.sum(problem.residuals["camera"] ** 2, axis=-1), 0).sum(axis=1)
    return np.where(used.any(axis=1), squares, np.inf)


def _sigma(problem: Adjustment) -> float:
    """The corners' noise along each axis, in pixels: σ² = ‖x‖²/(N - 6 v); NaN where nothing is left over."""
    return replace(problem, estimated={"camera": ()}).sigma


def _correlation(problem: Adjustment) -> float:
    """ρ of the residuals of corners that are neighbours in a row or a column, from 0 to MOST_ALIKE."""
    residuals, board = problem.residuals["camera"], problem.board
    grid = np.where(problem.used["camera"][..., None], residuals, np.nan).reshape(-1, board.rows, board.columns, 2)
    pairs = ((grid[:, :, 1:], grid[:, :, :-1]), (grid[:, 1:], grid[:, :-1]))
    along = sum(float(np.nansum(a * b)) for a, b in pairs)
    scale = sum(float(np.nansum(np.where(np.isfinite(a * b), a**2 + b**2, 0))) / 2 for a, b in pairs)
    return float(np.clip(along / scale, 0, MOST_ALIKE)) if scale > 0 else 0.0


def _alike(board: Board, correlation: float) -> Array:
    """R, the correlations (corners, corners) of the noise of a board's corners."""
    rows, columns = np.divmod(np.arange(board.rows * board.columns), board.columns)
    apart = np.abs(rows[:, None] - rows) + np.abs(columns[:, None] - columns)
    return np.asarray(np.power(correlation, apart, where=apart > 0, out=np.ones(apart.shape)))


def _covariance(problem: Adjustment, of_camera: Array) -> Array:
    """Of every view's twist (views, 6, 6): by the corners' own noise, and by what the camera is uncertain by."""
    normal, used = problem.normal_equations, problem.used["camera"]
    J = np.where(used[..., None, None], problem.jacobian("camera")[1], 0)  # (views, corners, 2, 6)
    R = _alike(problem.board, _correlation(problem))
    noise = np.einsum("vcai,vcaj->vij", J, np.einsum("cd,vdaj->vcaj", R, J))
    left = np.maximum(2 * used.sum(axis=1) - len(POSE), 1)
    variance = np.maximum(_squares(problem) / left, _sigma(problem) ** 2)
    own = variance[:, None, None] * normal.block_inverses @ noise @ normal.block_inverses
    follows = normal.pose_response @ of_camera @ np.swapaxes(normal.pose_response, 1, 2)
    return np.asarray(own + follows)
