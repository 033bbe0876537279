"""A first X and Z of A X B = Z in closed form, that a few wrong poses do not spoil."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.poses import Rotation
from camviz_clinic.calibration.motions import Motions

Indices = NDArray[np.intp]

TRIPLES = 60  # of poses: with a fifth of them wrong, all 60 contain a wrong one once in 10¹⁸
MOST_PAIRS = 3000
MOST_JUDGES = 150  # poses: of more, some evenly
NEAR_HALF_TURN = 3.0  # radians: the axis of a half turn has either sign
DEGENERATE_DEG = 3.0  # turned less about every second axis: X's own turn about the first is tried all round
ROUND = 16  # tries


def start(motions: Motions, scale: float | None = 1.0) -> tuple[Array, Array, float]:
    """X and Z from the triple of poses that most other poses agree with, or from all of them.

    With `scale` None the robot's lengths are multiplied by a factor that is solved for with X.

    Returns:
        X: (4, 4), mount_from_cam.
        Z: (4, 4), other_from_board.
        factor: Of the robot's lengths.
    """
    if len(motions) > MOST_JUDGES:
        motions = motions.only(np.linspace(0, len(motions) - 1, MOST_JUDGES).astype(int))
    candidates = [park(motions, pairs, scale) for pairs in _samples(len(motions))]
    if motions.turning.deg[1] < DEGENERATE_DEG:
        candidates += all_round(motions, candidates[-1][0], scale)
    judged = [(*_placed(motions, X, factor), X, factor) for X, factor in candidates]
    _, Z, X, factor = min(judged, key=lambda each: each[0])
    return X, Z, factor


def park(motions: Motions, pairs: Indices, scale: float | None = 1.0, turn: Array | None = None) -> tuple[Array, float]:
    """X (4, 4) of motions between pairs (n, 2) of poses, from Aᵢⱼ X = X Bᵢⱼ: first its rotation, then its translation.

    Rotation vectors α of the mount are those β of the camera turned by R_X. The R_X of least Σ‖α - R_X β‖² is that of
    an SVD. Then (R_A - 1) t_X = R_X t_B - t_A is linear. A `turn` (3, 3) is taken as R_X where it is given. The second
    result is the factor of the robot's lengths.

    Source: Park & Martin, *Robot sensor calibration: solving AX = XB on the Euclidean group*, IEEE TRA 10 (1994), with
    the rotation as in Arun, Huang & Blostein, *Least-squares fitting of two 3-D point sets*, IEEE PAMI 9 (1987).
    """
    first, second = pairs.T
    A = np.linalg.inv(motions.A[second]) @ motions.A[first]
    B = motions.B[second] @ np.linalg.inv(motions.B[first])
    R = _turn(A, B) if turn is None else turn
    rows = (A[:, :3, :3] - np.eye(3)).reshape(-1, 3)
    turned = (B[:, :3, 3] @ R.T).ravel()
    if scale is None:
        t, factor = _with_factor(rows, A[:, :3, 3].ravel(), turned)
    else:
        t, factor = np.linalg.lstsq(rows, turned - scale * A[:, :3, 3].ravel(), rcond=1e-6)[0], scale
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, t
    return X, factor


def all_round(motions: Motions, X: Array, scale: float | None) -> list[tuple[Array, float]]:
    """Solutions whose R_X is turned about the mount's main axis by steps over the full circle.

    Turns about one axis alone do not tell this angle; the translations do, where there are some.
    """
    axis, pairs = motions.turning.axes[0], _pairs(len(motions))
    steps = Rotation.from_rotvec(np.outer(np.arange(ROUND) * 2 * np.pi / ROUND, axis))
    return [park(motions, pairs, scale, step.as_matrix() @ X[:3, :3]) for step in steps]


def _turn(A: Array, B: Array) -> Array:
    """R_X (3, 3) of motions (n, 4, 4); half turns have no say unless there is nothing else."""
    alpha, beta = np.split(Rotation.from_matrix(np.concatenate([A, B])[:, :3, :3]).as_rotvec(), 2)
    clear = np.maximum(np.linalg.norm(alpha, axis=1), np.linalg.norm(beta, axis=1)) < NEAR_HALF_TURN
    if clear.sum() >= 2:
        alpha, beta = alpha[clear], beta[clear]
    U, _, Vt = np.linalg.svd(alpha.T @ beta)
    return np.asarray(U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt)


def _with_factor(rows: Array, robot: Array, turned: Array) -> tuple[Array, float]:
    """t_X and the factor s of rows t_X + s robot = turned; s is 1 where the robot did not move."""
    columns = np.column_stack([rows, robot])
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    solution = np.linalg.lstsq(columns / size, turned, rcond=1e-9)[0] / size
    factor = float(solution[3])
    if not factor > 0:
        return np.asarray(np.linalg.lstsq(rows, turned - robot, rcond=1e-6)[0]), 1.0
    return np.asarray(solution[:3]), factor


def _placed(motions: Motions, X: Array, factor: float) -> tuple[float, Array]:
    """The median error of the poses, in metres, and the Z of the pose that agrees best with all."""
    A = motions.A.copy()
    A[:, :3, 3] *= factor
    boards = A @ X @ motions.B
    shifts = np.linalg.norm(boards[:, None, :3, 3] - boards[None, :, :3, 3], axis=-1)
    errors = np.median(np.hypot(shifts, motions.lever * angles_between(boards)), axis=1)
    best = int(np.argmin(errors))
    return float(errors[best]), boards[best]


def angles_between(matrices: Array) -> Array:
    """The chords 2 sin(θ/2) of the turns between poses (n, 4, 4), (n, n): they grow with θ, to 2 at a half turn."""
    R = matrices[:, :3, :3].reshape(len(matrices), 9)
    return np.linalg.norm(R[:, None] - R[None], axis=-1) / np.sqrt(2)


def _samples(count: int) -> list[Indices]:
    """Pairs among triples of poses, and last those among all."""
    rng = np.random.default_rng(0)
    triples = list(combinations(range(count), 3)) if count <= 8 else []
    if len(triples) > TRIPLES or not triples:
        triples = [tuple(sorted(rng.choice(count, 3, replace=False))) for _ in range(TRIPLES)]
    return [np.array(list(combinations(each, 2))) for each in triples] + [_pairs(count)]


def _pairs(count: int) -> Indices:
    """All pairs of poses, or evenly some of them."""
    pairs = np.stack(np.triu_indices(count, 1), axis=-1)
    return pairs[:: len(pairs) // MOST_PAIRS + 1]
