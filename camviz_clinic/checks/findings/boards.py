"""Where the boards were, how they were held, and what their poses hide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import cos, radians

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.distortion import fold_angle
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.cross_validation import HeldOut, held_out
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.observed import Observed
from camviz_clinic.checks.registry import VIEW_BY_VIEW, Finding, LabFault, Rng, finding
from camviz_clinic.checks.virtual import single, single_in_the_middle

COVERED = 0.4  # of the image: the outermost corners are a square inside the board
CELLS = 64  # along the longer side of the image, to measure areas
WIDEST = radians(110)  # off the axis: the widest common fisheyes see 220°
SAME_WAY_DEG = 20.0  # between the normals of two boards
PARALLEL_DEG = 5.0  # between them: all such views together constrain a camera as one view does
UNCERTAIN = 0.01  # of the focal length
UNKNOWN = 1.0  # of it
HELD_OUT = 2.0  # times what noise leads to
FEWEST_VIEWS = 3


@finding(
    "low-coverage",
    severity="warning",
    view="coverage",
    symptom="The board was seen in too little of the image.",
    causes=("views that all show the board in the same part of the image, or far away",),
    remedy="Add views with the board close to each border and corner of the image.",
    threshold="They cover less than two fifths of the image, or of what a fisheye of 220° fills of it.",
    explains=("unidentifiable", "fold", "near-pole", "inverse-not-converged"),
)
def low_coverage(evidence: Evidence) -> Iterator[Finding]:
    """The check lays the outlines of the board in all views over the image."""
    if not evidence.calibration.detections:
        raise NotChecked("the file holds no detected corners of a known board")
    calibration = evidence.calibration
    for name, pixels in calibration.detections.items():
        share = coverage(calibration.used_pixels(name), calibration.cameras[name])
        if share < COVERED:
            sentence = f"{name}: the board was seen in {share:.0%} of the image, over {len(pixels)} views."
            yield low_coverage.found(sentence, share, "of the image", name)


def coverage(pixels: Array, camera: Camera) -> float:
    """The share of an image that lies inside the convex outline of some view's corners (views, corners, 2).

    Beyond a fisheye's circle only the cells count in which corners were seen all the same.
    """
    covered = covered_cells(pixels, camera)
    return float(covered.mean() / np.mean(within_reach(camera) | covered))


def cell_centres(camera: Camera) -> Array:
    """The pixels (rows, columns, 2) in the middle of the cells of an image, `CELLS` of them along its longer side."""
    grid = camera.intrinsics
    scale = CELLS / max(grid.width, grid.height)
    columns, rows = max(1, round(grid.width * scale)), max(1, round(grid.height * scale))
    u = (np.arange(columns) + 0.5) * grid.width / columns - 0.5
    v = (np.arange(rows) + 0.5) * grid.height / rows - 0.5
    return np.stack(np.meshgrid(u, v), axis=-1)


def covered_cells(pixels: Array, camera: Camera) -> NDArray[np.bool_]:
    """Mask (rows, columns) of the cells whose centres lie inside the convex outline of some view's corners."""
    centres = cell_centres(camera)
    covered = np.zeros(centres.shape[:2], bool)
    for view in pixels:
        seen = view[np.isfinite(view).all(axis=-1)]
        if len(seen) > 2:
            outline = cv2.convexHull(seen.astype(np.float32))[:, 0].astype(float)
            along, away = np.roll(outline, -1, axis=0) - outline, centres[..., None, :] - outline
            side = along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0]
            covered |= (side >= 0).all(axis=-1) | (side <= 0).all(axis=-1)
    return covered


def within_reach(camera: Camera) -> NDArray[np.bool_]:
    """In which cells (rows, columns) of its image a camera can see something: false beyond a fisheye's circle.

    A fold or a pole nearer than that takes no cell away: missing views lead to it, and must not hide behind it.
    """
    lens, centres = camera.lens, cell_centres(camera)
    if lens.goes_round:
        return np.ones(centres.shape[:2], bool)
    z = lens.unproject(camera.intrinsics.from_pixels(centres))[..., 2]
    turns_back = bool(lens.denominator_terms) or fold_angle(lens) < WIDEST
    return np.where(np.isfinite(z), z >= cos(WIDEST), turns_back)


@low_coverage.fault(
    "boards in the middle",
    "of a side",
    (0.15, 0.25, 0.4),
    promised=0.25,
    beyond_doubt=(0.25, 0.35),
    lab=LabFault(
        0.25,
        "the boards stay inside {0:.0%} of the width and height",
        none=1,
        spread=lambda strength: {"window": 1 - 0.75 * strength},
    ),
)
def boards_in_the_middle(rng: Rng, strength: float) -> Evidence:
    """The boards stay inside this part of the sides."""
    set_up = single_in_the_middle(rng, strength)
    return Evidence(set_up.solved(set_up.observed(rng)))


@finding(
    "parallel-boards",
    severity="warning",
    view="correlation",
    symptom="The focal length is uncertain, and correlated with the distance of the boards.",
    causes=("boards that were all held parallel to each other, usually to the image",),
    remedy="Add views with the board tilted by 30° to 45°, to different sides.",
    threshold="No two boards are more than 20° apart. "
    "It is a fault where none are and the corners do not decide the focal length. "
    "It is one, too, where none are more than 5° apart and the focal length is uncertain by more than 1 %.",
    explains=("unidentifiable", "aspect", "principal-point", "split-disagreement"),
)
def parallel_boards(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the normals of the boards in the camera's frame."""
    poses = {name: pose for name, pose in evidence.cam_from_board.items() if not pose.single and len(pose) > 1}
    if not poses:
        raise NotChecked("it needs the poses of at least two boards, and the file has none")
    for name, pose in poses.items():
        spread = tilt_spread_deg(evidence, name)
        uncertain = evidence.focal_uncertainty(name)
        if spread < SAME_WAY_DEG:
            severity = "fault" if leave_focal_length_open(evidence, name) else "warning"
            more = "" if uncertain is None else f" The focal length is {_told(uncertain)}."
            sentence = f"{name}: no two of the {len(pose)} boards differ by more than {spread:.1f}° in tilt.{more}"
            yield parallel_boards.found(sentence, spread, "°", name, severity=severity)


def tilt_spread_deg(evidence: Evidence, name: str) -> float:
    """The largest angle in degrees between the normals of two boards whose corners the fit uses; NaN without two."""
    poses = evidence.cam_from_board.get(name)
    if poses is None or poses.single or len(poses) < 2:
        return np.nan
    normals = poses.rotation.as_matrix()[..., 2]
    if name in evidence.calibration.detections:
        normals = normals[evidence.calibration.used(name).any(axis=1)]
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1).min(initial=1.0))))


def leave_focal_length_open(evidence: Evidence, name: str) -> bool:
    """Whether all boards of a camera are parallel, so that its focal length is not decided or not known to 1 %."""
    spread = tilt_spread_deg(evidence, name)
    if any("fx" in each.changes for each in evidence.undecided(name)):
        return spread < SAME_WAY_DEG
    return spread < PARALLEL_DEG and (_left_open(evidence, name) or 0.0) > UNCERTAIN


def _told(uncertain: float) -> str:
    return f"uncertain by {uncertain:.2%} (1σ)" if uncertain < UNKNOWN else "not known"


def _left_open(evidence: Evidence, name: str) -> float | None:
    """σ of fx over fx that the noise of ordinary corners leaves; by the file where it has no corners.

    What views that disagree add, or a few corners far out, is their own doing and not that of the boards' tilts.
    """
    observed = evidence.observed.get(name)
    if observed is None or "fx" not in observed.adjustment.estimated[name]:
        return evidence.focal_uncertainty(name)
    adjustment = observed.adjustment.by_corners
    place = adjustment.estimated[name].index("fx")
    sigma = float(np.sqrt(max(adjustment.intrinsics_covariance(name)[place, place], 0)))
    share = min(1.0, observed.scatter / adjustment.sigma)
    return share * sigma / evidence.calibration.cameras[name].intrinsics.fx if np.isfinite(adjustment.sigma) else None


@parallel_boards.fault(
    "parallel boards",
    "°",
    (0.5, 3, 8),
    promised=8,
    beyond_doubt=(3, 8),
    lab=LabFault(
        8,
        "no board is tilted by more than {0:.1f}°",
        none=40,
        spread=lambda strength: {"tilt_deg": (15 * (1 - strength), 40 * (1 - strength) + 8 * strength)},
    ),
)
def all_parallel(rng: Rng, strength: float) -> Evidence:
    """No board is tilted by more."""
    set_up = single(rng, tilt_deg=(0, strength))
    return Evidence(set_up.solved(set_up.observed(rng)))


@finding(
    "focal-uncertain",
    severity="warning",
    view="correlation",
    symptom="The focal length is uncertain, though the boards are tilted.",
    causes=(
        "too few views, or boards too small in the image, for the noise of their corners",
        "boards tilted to one side only",
    ),
    remedy="Add views with the board large in the image and tilted by 30° to 45°, to different sides.",
    threshold="The focal length is uncertain by more than 1 % (1σ), with boards more than 20° apart.",
    explains=("unidentifiable", "aspect", "principal-point", "split-disagreement"),
)
def focal_uncertain(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the standard deviation of fx in the file, or computes it from the corners."""
    known = {name: each for name in evidence.cameras if (each := _left_open(evidence, name)) is not None}
    if not known:
        raise NotChecked("the file holds neither corners of a known board nor how well the focal length is known")
    for name, uncertain in known.items():
        spread = tilt_spread_deg(evidence, name)
        if uncertain > UNCERTAIN and not spread < SAME_WAY_DEG:
            tilts = "" if np.isnan(spread) else f", though the boards' tilts differ by up to {spread:.0f}°"
            sentence = f"{name}: the focal length is {_told(uncertain)}{tilts}."
            yield focal_uncertain.found(sentence, uncertain * 100, "%", name)


@focal_uncertain.fault("few noisy views", "px of noise", (0.1, 1, 5), promised=5)
def few_noisy_views(rng: Rng, strength: float) -> Evidence:
    """Five views of tilted boards have corners with so much noise."""
    set_up = replace(single(rng, views=5), noise=strength)
    return Evidence(set_up.solved(set_up.observed(rng)))


@finding(
    "pose-absorbs-error",
    severity="fault",
    view="cross-validation",
    symptom="The error is low, and the camera matrix absurd.",
    causes=(
        "an error of the camera that the pose of each board takes up",
        "numbers of the camera that were changed after the solution",
    ),
    remedy="Solve again with tilted boards at varied distances and a still camera. "
    "Trust held-out corners rather than the error of the fit.",
    threshold="The errors are twice as large as noise makes them, in the median of the views.",
    explains=VIEW_BY_VIEW,
)
def pose_absorbs_error(evidence: Evidence) -> Iterator[Finding]:
    """The check fits each view's pose to one half of its corners and tries it on the other half."""
    for name, observed in evidence.with_corners().items():
        ratio = held_out_ratio(evidence, observed)
        if ratio > HELD_OUT:
            sentence = (
                f"{name}: where each pose is fitted to one half of the board, the other half is {ratio:.1f} times as "
                f"far off as noise explains. The error of the fit is {observed.adjustment.rms:.3g} px."
            )
            yield pose_absorbs_error.found(sentence, ratio, "times", name)


def held_out_ratio(evidence: Evidence, observed: Observed) -> float:
    """How many times larger the errors of held-out corners are than noise makes them, in the median of the views.

    Each corner's squared error is divided by its variance; `camviz_clinic.calibration.cross_validation` explains both.
    """
    result = _held_out(evidence, observed)
    squares = np.moveaxis(result.residuals**2 / result.variances, 1, 0).reshape(observed.adjustment.views, -1)
    known = np.isfinite(squares).any(axis=1)
    if known.sum() < FEWEST_VIEWS:
        return 0.0
    return float(np.sqrt(np.median(np.nanmean(squares[known], axis=1))))


def _held_out(evidence: Evidence, observed: Observed) -> HeldOut:
    """Without the corners that are far out; as the report shows it where there is none."""
    aside = observed.best.set_aside
    if aside is observed.adjustment.set_aside and observed.name in evidence.calibration.cam_from_board:
        return evidence.held_out(observed.name)
    return held_out(replace(observed.adjustment, set_aside=aside), camera=observed.name)


@pose_absorbs_error.fault(
    "moved centre",
    "% of the width",
    (0.3, 1, 3, 8),
    promised=8,
    beyond_doubt=(8, 10),
    stage="solution",
    lab=LabFault(8, "cx is moved by {0:.1f} % of the width, and the poses follow"),
)
def moved_centre(solution: Adjustment, strength: float) -> Adjustment:
    """The principal point was moved, and the poses follow."""
    ((name, camera),) = solution.cameras.items()
    grid = camera.intrinsics
    shifted = replace(camera, intrinsics=replace(grid, cx=grid.cx + strength / 100 * grid.width))
    return replace(solution, cameras={name: shifted}).refined(only_poses=True)
