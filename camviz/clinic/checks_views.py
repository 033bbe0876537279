"""What the views tell: which are wrong, where the board was, how it was held, and what their poses hide."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
from scipy.special import chdtri, fdtrc

from camviz.calibration.cross_validation import held_out
from camviz.clinic.catalogue import Finding, Lacking, Outcome, found
from camviz.clinic.evidence import Evidence, no_corners
from camviz.clinic.fields import smooth_field, warp_columns
from camviz.clinic.observed import APART, BY_CHANCE, Observed, unexplained
from camviz.lenses.base import Array

MANY_TIMES = 3.0  # the median error: twice happens between sharp and less sharp pictures
ONCE_IN = 1e-4  # for all views together: how often the error of a view with few corners may be so far out by chance
FAR_CORNER = 10.0  # times the typical length of a residual
FAR_LINE = 8.0  # the same for half a line of corners, to which the pose has to be extended
VISIBLE_PX = 1.5  # less than this is no wrong detection
COVERED = 0.4  # of the image: the outermost corners are a square inside the board
CELLS = 64  # along the longer side of the image, to measure areas
SAME_WAY_DEG = 20.0  # between the normals of two boards
UNCERTAIN = 0.01  # of the focal length
HELD_OUT = 2.0  # times what noise leads to
FEWEST_VIEWS = 3
MOVING = 0.7  # of the noise: what a rolling shutter must explain to be named


def outlier_view(evidence: Evidence) -> Outcome:
    """The RMS of each view against the median of all, and each corner against the typical one."""
    findings: list[Finding] = []
    looked = False
    for name in evidence.calibration.cameras:
        observed, errors = evidence.observed.get(name), evidence.calibration.per_view_errors.get(name)
        if observed is not None:
            looked = True
            findings += _bad_views(evidence, name, observed.errors, _counts(observed))
            bad = {view for finding in findings if finding.camera == name for view in finding.pictures}
            findings += _bad_corners(evidence, observed, bad)
        elif errors is not None and len(errors) > 2:
            looked = True
            findings += _bad_views(evidence, name, np.asarray(errors), np.full(len(errors), 50))
    return findings if looked else no_corners(evidence, "errors of views")


def _counts(observed: Observed) -> Array:
    return np.isfinite(observed.residuals).all(axis=-1).sum(axis=1)


def _bad_views(evidence: Evidence, name: str, errors: Array, counts: Array) -> Iterator[Finding]:
    """A view's squared error times (2n - 6)/σ² is χ² with 2n - 6 degrees of freedom, its pose being fitted."""
    with np.errstate(invalid="ignore"):
        freedom = np.maximum(2 * counts - 6, 1)
        typical = np.sqrt(chdtri(freedom, 0.5))
        limit = np.maximum(MANY_TIMES, np.sqrt(chdtri(freedom, ONCE_IN / len(errors))) / typical)
        median = float(np.nanmedian(errors))
        bad = np.flatnonzero(errors > limit * median)
    for view in map(int, bad):
        sentence = (
            f"{evidence.picture(name, view)}: its error is {errors[view]:.3g} px, {errors[view] / median:.1f} times "
            f"the median of all {len(errors)} views ({median:.3g} px)."
        )
        yield found("outlier-view", sentence, errors[view], "px", name, pictures=(view,))


def _bad_corners(evidence: Evidence, observed: Observed, named: set[int]) -> Iterator[Finding]:
    """Views that are not bad as a whole, but for a corner or two."""
    lengths = np.linalg.norm(observed.residuals, axis=-1)
    far = lengths > max(FAR_CORNER * observed.scatter, VISIBLE_PX)
    for view in map(int, np.flatnonzero(far.any(axis=1))):
        if view in named:
            continue
        worst = int(np.nanargmax(lengths[view]))
        count = int(far[view].sum())
        sentence = (
            f"{evidence.picture(observed.name, view)}: {count} of its corners "
            f"{'is' if count == 1 else 'are'} far off, the worst ({_corner(observed, worst)}) by "
            f"{lengths[view, worst]:.3g} px, {lengths[view, worst] / observed.scatter:.0f} times the typical error."
        )
        yield found("outlier-view", sentence, lengths[view, worst], "px", observed.name, pictures=(view,))


def _corner(observed: Observed, index: int) -> str:
    row, column = divmod(index, observed.shape[1])
    return f"row {row + 1}, column {column + 1}"


def outlier_line(evidence: Evidence) -> Outcome:
    """Every row and column of every view, against a pose fitted to the rest of that view."""
    if not evidence.observed:
        return no_corners(evidence)
    return [finding for observed in evidence.observed.values() for finding in _bad_lines(evidence, observed)]


def _bad_lines(evidence: Evidence, observed: Observed) -> Iterator[Finding]:
    limit = max(FAR_LINE * observed.scatter, VISIBLE_PX)
    lines = _lines(observed)
    lengths = _lengths_left_out(observed, [corners for _, corners in lines])
    for view, of_view in enumerate(lengths):
        off = [_share_beyond(length, limit) for length in of_view]
        worst = max(range(len(lines)), key=lambda line: (off[line] >= 0.5) * _median(of_view[line]))
        if off[worst] >= 0.5:
            label, corners = lines[worst]
            sentence = (
                f"{evidence.picture(observed.name, view)}: {label} of the board is off by "
                f"{_median(of_view[worst]):.3g} px, {round(off[worst] * len(corners))} of its {len(corners)} corners "
                f"by more than {limit:.2g} px."
            )
            yield found("outlier-line", sentence, _median(of_view[worst]), "px", observed.name, pictures=(view,))


def _lines(observed: Observed) -> list[tuple[str, Array]]:
    rows, columns = observed.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    lines = [(f"row {row + 1}", index[row]) for row in range(rows)]
    return lines + [(f"column {column + 1}", index[:, column]) for column in range(columns)]


def _lengths_left_out(observed: Observed, lines: Sequence[Array]) -> list[list[Array]]:
    """By view and line: how far off its corners are, from a pose that follows the other corners.

    One step of the pose, without corners that are far off by themselves. A length is divided by √(1 + lever), with
    which the noise of the others comes through to a corner beyond them.
    """
    adjustment = observed.adjustment
    _, by_pose = adjustment.jacobian(observed.name)
    lengths: list[list[Array]] = [[np.empty(0) for _ in lines] for _ in range(adjustment.views)]
    for row, view in enumerate(np.flatnonzero(adjustment.posed)):
        seen = np.isfinite(observed.residuals[view]).all(axis=-1)
        residuals = np.where(seen[:, None], observed.residuals[view], 0)
        sizes = np.linalg.norm(residuals, axis=-1)
        good = seen & (sizes <= max(3 * np.median(sizes[seen]), FAR_LINE * observed.scatter))
        slopes = np.where(seen[:, None, None], by_pose[row], 0)
        normal = np.einsum("cik,cil->ckl", slopes, slopes) * good[:, None, None]
        gradient = np.einsum("cik,ci->ck", slopes, residuals) * good[:, None]
        for number, line in enumerate(lines):
            inverse = np.linalg.pinv(normal.sum(axis=0) - normal[line].sum(axis=0), rcond=1e-12, hermitian=True)
            step = inverse @ (gradient.sum(axis=0) - gradient[line].sum(axis=0))
            lever = np.einsum("cik,kl,cil->c", slopes[line], inverse, slopes[line]) / 2
            left = np.linalg.norm(residuals[line] - slopes[line] @ step, axis=-1) / np.sqrt(1 + lever)
            lengths[view][number] = left[seen[line]]
    return lengths


def _share_beyond(lengths: Array, limit: float) -> float:
    return float(np.mean(lengths > limit)) if len(lengths) >= 3 else 0.0


def _median(lengths: Array) -> float:
    return float(np.median(lengths)) if len(lengths) else 0.0


def low_coverage(evidence: Evidence) -> Outcome:
    """The share of the image inside the outline of the seen corners of any view."""
    if not evidence.calibration.detections:
        return no_corners(evidence)
    findings = []
    for name, pixels in evidence.calibration.detections.items():
        grid = evidence.calibration.cameras[name].intrinsics
        share = coverage(pixels, grid.width, grid.height)
        if share < COVERED:
            sentence = f"{name}: the board was seen in {share:.0%} of the image, over {len(pixels)} views."
            findings.append(found("low-coverage", sentence, share, "of the image", name))
    return findings


def coverage(pixels: Array, width: int, height: int) -> float:
    """The share of an image that lies inside the convex outline of some view's corners (views, corners, 2)."""
    scale = CELLS / max(width, height)
    cells = np.zeros((max(1, round(height * scale)), max(1, round(width * scale))), np.uint8)
    for view in pixels:
        seen = view[np.isfinite(view).all(axis=-1)]
        if len(seen) > 2:
            outline = cv2.convexHull(np.round((seen + 0.5) * scale * 16 - 8).astype(np.int32))
            cv2.fillConvexPoly(cells, outline, 1, shift=4)
    return float(cells.mean())


def parallel_boards(evidence: Evidence) -> Outcome:
    """The largest angle between two boards' normals; and what the corners say of the focal length."""
    poses = {name: pose for name, pose in evidence.cam_from_board.items() if not pose.single and len(pose) > 1}
    if not poses:
        return Lacking("it needs the poses of at least two boards, and the file has none")
    findings = []
    for name, pose in poses.items():
        normals = pose.rotation.as_matrix()[..., 2]
        spread = float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1).min())))
        uncertain = evidence.focal_uncertainty(name)
        said = "" if uncertain is None else f"; the focal length is uncertain by {uncertain:.2%} (1σ)"
        if spread < SAME_WAY_DEG:
            sentence = f"{name}: no two of the {len(pose)} boards differ by more than {spread:.1f}° in tilt{said}."
            findings.append(found("parallel-boards", sentence, spread, "°", name))
        elif uncertain is not None and uncertain * _share_of_noise(evidence, name) > UNCERTAIN:
            sentence = (
                f"{name}: the tilts of the {len(pose)} boards (up to {spread:.0f}° apart) leave the focal length "
                f"uncertain by {uncertain:.2%} (1σ)."
            )
            findings.append(found("parallel-boards", sentence, uncertain * 100, "%", name))
    return findings


def _share_of_noise(evidence: Evidence, name: str) -> float:
    """σ of the corners by their median over σ by their squares: 1, or less where a few are far out.

    What those few do to the focal length is their own doing, not that of the boards' tilts.
    """
    observed = evidence.observed.get(name)
    return 1.0 if observed is None else min(1.0, observed.scatter / observed.adjustment.sigma)


def pose_absorbs_error(evidence: Evidence) -> Outcome:
    """Each pose fitted to half of the board and tried on the other half, with the camera as it is in the file.

    And: whether boards that move while the rows of the image are read out one after another explain the residuals.
    """
    if not evidence.observed:
        return no_corners(evidence)
    findings: list[Finding] = []
    for name, observed in evidence.observed.items():
        ratio = held_out_ratio(observed)
        if ratio > HELD_OUT:
            sentence = (
                f"{name}: with each pose fitted to one half of the board, the other half is {ratio:.1f} times as far "
                f"off as the noise of the corners leads to; the error of the fit is {observed.adjustment.rms:.3g} px."
            )
            findings.append(found("pose-absorbs-error", sentence, ratio, "times", name))
            continue
        chance, part = moving_boards(observed)
        if chance < BY_CHANCE and part > MOVING:
            sentence = (
                f"{name}: boards that move while the rows are read out one after another explain "
                f"{part * observed.best.sigma:.2g} px of the residuals ({part:.1f} times the noise): a rolling shutter."
            )
            findings.append(found("pose-absorbs-error", sentence, part, "times", name))
    return findings


def moving_boards(observed: Observed) -> tuple[float, float]:
    """The chance of an F-test of six velocities for every view, and what they explain over the noise (RMS).

    A pixel in row v of a rolling shutter is late by v: it moves by (v/height - ½) times ∂pixel/∂pose and the velocity.
    A bend of the board and a smooth field over the image are given their share before.
    """
    best, name = observed.best, observed.name
    left, by_pose, used = unexplained(best, name, smooth_field(best, name), warp_columns(best, name))
    late = best.projected(name)[best.posed][..., 1] / best.cameras[name].intrinsics.height - 0.5
    moving = np.nan_to_num(late[..., None, None] * by_pose)
    fallen, count = 0.0, 0
    for residuals, slopes, motion, seen in zip(left, by_pose, moving, used, strict=True):
        columns = np.concatenate([slopes[seen], motion[seen]], axis=-1).reshape(-1, 12)
        columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        columns[:, 6:] -= columns[:, :6] @ np.linalg.lstsq(columns[:, :6], columns[:, 6:], rcond=None)[0]
        U, singular, _ = np.linalg.svd(columns[:, 6:], full_matrices=False)
        kept = U[:, singular > APART]
        fallen += float(np.sum(np.square(kept.T @ residuals[seen].ravel())))
        count += kept.shape[1]
    freedom = best.measurements - best.unknowns - count
    if freedom < 1 or count == 0:
        return 1.0, 0.0
    variance = max(float(np.sum(left[used] ** 2)) - fallen, np.finfo(float).tiny) / freedom
    part = np.sqrt(max(fallen - count * variance, 0) / best.measurements / variance)
    return float(fdtrc(count, freedom, max(fallen / count / variance, 0.0))), float(part)


def held_out_ratio(observed: Observed) -> float:
    """How many times larger the errors of held-out corners are than noise makes them, in the median of the views.

    Each corner's squared error is taken over its variance, of which `camviz.calibration.cross_validation` tells.
    """
    aside = replace(observed.adjustment, set_aside=observed.best.set_aside)
    result = held_out(aside, camera=observed.name)
    squares = np.moveaxis(result.residuals**2 / result.variances, 1, 0).reshape(observed.adjustment.views, -1)
    known = np.isfinite(squares).any(axis=1)
    if known.sum() < FEWEST_VIEWS:
        return 0.0
    return float(np.sqrt(np.median(np.nanmean(squares[known], axis=1))))
