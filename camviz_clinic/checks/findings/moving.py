"""What differs from view to view: a shutter that reads row by row while something moves, or something else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import fdtrc

from camviz.lenses.base import Array
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.fields import smooth_field, warp_columns
from camviz_clinic.checks.observed import APART, BY_CHANCE, SAME, Mask, Observed
from camviz_clinic.checks.registry import Finding, LabFault, Rng, finding
from camviz_clinic.checks.virtual import SetUp

MOVING = 0.7  # of the noise: in photographs of a global shutter, velocities explain 0.5 to 0.6 of it
CLEARLY = 0.03  # of the squares left by rows, what other directions leave more: 0.015 in the same photographs at most
HARMFUL_PX = 0.5
DIRECTIONS = ((0.0, 1.0), (1.0, 0.0), (0.5**0.5, 0.5**0.5), (0.5**0.5, -(0.5**0.5)))  # of reading; rows come first


@dataclass(frozen=True)
class Motion:
    """What velocities of the boards explain, if the image is read row by row, and if in the best of four directions.

    `part` is over the noise that is left (RMS), `pixels` the RMS distance, `chance` that of an F-test. `clearly` is how
    much more of the squares is left by the best of the other directions than by rows; below 0 where one leaves less.
    """

    part: float
    pixels: float
    chance: float
    clearly: float

    @property
    def by_rows(self) -> bool:
        """Whether it is there, and rows tell it clearly better than columns and both diagonals."""
        return self.is_there and self.clearly > CLEARLY

    @property
    def is_there(self) -> bool:
        return self.chance < BY_CHANCE and self.part > MOVING


def motion(observed: Observed) -> Motion:
    """Six velocities for every view, as a shutter would show them that reads the image in one of four directions.

    A pixel in row v of a rolling shutter is late by v: it moves by (v/height - ½) times ∂pixel/∂pose and the velocity.
    The camera, the poses, a bend of the board and a smooth field over the image are solved for with the velocities. The
    same velocities along columns and diagonals are the control: to first order a shear is a shear in any direction.
    """
    best, name = observed.best, observed.name
    views, used = best.posed, best.used[name][best.posed]
    by_shared, by_pose = best.jacobian(name)
    shared = np.concatenate([by_shared, smooth_field(best, name)[views], warp_columns(best, name)[views]], axis=-1)
    shared /= np.maximum(np.sqrt(np.sum(np.where(used[..., None, None], shared, 0) ** 2, axis=(0, 1, 2))), 1e-300)
    both = np.concatenate([best.residuals[name][views][..., None], shared], axis=-1)
    grid = best.cameras[name].intrinsics
    where = np.nan_to_num(best.projected(name)[views] / [grid.width, grid.height] - 0.5)  # seen, noise explains itself
    still = _left(both, by_pose, used, np.zeros(used.shape))
    rows, *others = (_left(both, by_pose, used, where @ direction) for direction in DIRECTIONS)
    left, freedom = min((rows, *others))
    count = still[1] - freedom
    if freedom < 1 or count < 1 or not rows[0] > 0:
        return Motion(0.0, 0.0, 1.0, 0.0)
    fallen, variance = still[0] - left, max(left, np.finfo(float).tiny) / freedom
    chance = float(fdtrc(count, freedom, max(fallen / count / variance, 0.0)))
    pixels = float(np.sqrt(2 * max(fallen - count * variance, 0) / best.measurements))
    return Motion(pixels / float(np.sqrt(2 * variance)), pixels, chance, min(others)[0] / rows[0] - 1)


def _left(both: Array, by_pose: Array, used: Mask, late: Array) -> tuple[float, int]:
    """The sum of squares that is left of residuals beside columns, `both` (views, corners, 2, 1 + n), and its freedom.

    Each view's pose, and its velocities by how `late` (views, corners) its corners are read, take their share.
    """
    kept, freedom = [], 0
    for view, slopes, time, seen in zip(both, by_pose, late, used, strict=True):
        own = np.concatenate([slopes[seen], time[seen][:, None, None] * slopes[seen]], axis=-1).reshape(-1, 12)
        own /= np.maximum(np.linalg.norm(own, axis=0), 1e-300)
        U, singular, _ = np.linalg.svd(own, full_matrices=False)
        axes = U[:, singular > APART**2 * singular[0]]
        rows = view[seen].reshape(-1, view.shape[-1])
        kept.append(rows - axes @ (axes.T @ rows))
        freedom += len(rows) - axes.shape[1]
    left = np.concatenate(kept)
    return _squares_beside(left[:, 0], left[:, 1:], freedom)


def _squares_beside(residuals: Array, columns: Array, freedom: int) -> tuple[float, int]:
    lengths = np.linalg.norm(columns, axis=0)
    columns = columns[:, lengths > APART] / lengths[lengths > APART]
    squares, vectors = np.linalg.eigh(columns.T @ columns)
    along = (vectors.T @ (columns.T @ residuals))[squares > SAME**1.2] / np.sqrt(squares[squares > SAME**1.2])
    return float(residuals @ residuals - along @ along), freedom - len(along)


@finding(
    "rolling-shutter",
    severity="fault",
    view="residual-vectors",
    symptom="The rows of the image were read one after the other while camera or board moved.",
    causes=("a rolling shutter while camera or board moved",),
    remedy="Take the pictures again with camera and board still, or with a global shutter. Solve again. "
    "Of a film the shutter can be solved for as well (camviz calibrate FILM --rolling-shutter estimate).",
    threshold="The velocities explain at least 0.7 of the noise, by chance in one set of a million. "
    "Columns and both diagonals leave at least 3 % more of the squares than rows do.",
    explains=(
        "views-disagree",
        "model-too-simple",
        "outlier-view",
        "outlier-line",
        "corners-set-aside",
        "pose-absorbs-error",
        "split-disagreement",
    ),
)
def rolling_shutter(evidence: Evidence) -> Iterator[Finding]:
    """The check fits six velocities of the board to every view, as a rolling shutter would show them. The same along
    columns and diagonals are the control.
    """
    for name, observed in evidence.with_corners().items():
        moved = evidence.once(("motion", name), partial(motion, observed))
        if moved.by_rows:
            sentence = (
                f"{name}: the board or the camera moved under a rolling shutter. Boards that move while the rows are "
                f"read out explain {moved.pixels:.2g} px of the residuals, {moved.part:.1f} times the noise. "
                f"Any other direction of reading leaves {moved.clearly:.0%} more of the squares."
            )
            yield rolling_shutter.found(sentence, moved.pixels, "px", name)


@rolling_shutter.fault(
    "rolling shutter",
    "px",
    (1, 3, 10, 30),
    promised=30,
    stage="set-up",
    lab=LabFault(30, "boards move by {0:.1f} px while a picture is read out"),
)
def rolled(rng: Rng, set_up: SetUp, strength: float) -> SetUp:
    """The board moves while the image is read out.

    It goes sideways and turns by so many pixels, from the first row of the image to the last.
    """
    fx, motions = set_up.camera.intrinsics.fx, []
    for pose in set_up.cam_from_board:
        depth = pose.apply(set_up.board.corners)[:, 2].mean()
        drift, spin = rng.normal(size=3) * [1, 1, 0.3], rng.normal(size=3)
        drift *= strength * depth / fx / np.linalg.norm(drift)
        spin *= strength / fx / np.linalg.norm(spin) * 2
        motions.append([*spin, *drift])
    return replace(set_up, motion=np.array(motions))


@finding(
    "views-differ",
    severity="note",
    view="residual-vectors",
    symptom="Something differs from view to view.",
    causes=("a board that bends as it is held", "motion blur", "a movement too small to tell in which direction"),
    remedy="Fix the board to a stiff plate, and take the pictures from a tripod with more light.",
    threshold="Six free velocities for every view explain at least 0.7 of the noise, by chance in one set of a "
    "million, but rows do not tell it clearly better than other directions. From half a pixel on it is a warning.",
    explains=("views-disagree",),
)
def views_differ(evidence: Evidence) -> Iterator[Finding]:
    """The check takes the best of the four directions of `rolling-shutter`."""
    for name, observed in evidence.with_corners().items():
        moved = evidence.once(("motion", name), partial(motion, observed))
        if moved.is_there and not moved.by_rows:
            sentence = (
                f"{name}: something differs from view to view. It makes up {moved.pixels:.2g} px of the residuals, "
                f"{moved.part:.1f} times the noise, and is no clear sign of a rolling shutter."
            )
            severity = "warning" if moved.pixels >= HARMFUL_PX else views_differ.severity
            yield views_differ.found(sentence, moved.pixels, "px", name, severity=severity)


@views_differ.fault("bending board", "px", (0.3, 1, 3), promised=3, stage="corners")
def bending(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """The board is bent another way in every view."""
    eta, xi = np.meshgrid(*(np.linspace(-1, 1, count) for count in shape), indexing="ij")
    for view in corners:
        bow = rng.normal(size=2) @ np.stack([1 - xi.ravel() ** 2, 1 - eta.ravel() ** 2])
        view += strength * np.outer(bow, rng.normal(size=2) / np.sqrt(2))
