"""What is left over: residuals that a richer lens, a bent board, another half of the views would explain."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.calibration.cross_validation import halves
from camviz.clinic.catalogue import Finding, Lacking, Outcome, found
from camviz.clinic.evidence import Evidence, no_corners
from camviz.clinic.fields import smooth_field, warp_columns
from camviz.clinic.observed import BY_CHANCE, Observed, explained, parameter_columns
from camviz.lenses.base import Array

SYSTEMATIC = 0.5  # of the noise: what remains of a real lens under the standard model is a third of it
BENT = 0.005  # of the board's longer side
FEWEST_VIEWS = 6  # to be parted in two
DRIFTING = 0.003  # of the focal length
APART_PX = 1.0  # the median difference of the halves over the image
COARSE = (16, 12)  # points of the image at which they are compared
SHIFTS = (0.5, 1.0)  # what conventions for the first pixel's centre differ by
CLOSE_TO_SHIFT = 0.1
STANDARD_ERRORS = 5.0


def model_too_simple(evidence: Evidence) -> Outcome:
    """A smooth field over the image on top of the solution, with the bend of the board given its share."""
    if not evidence.observed:
        return no_corners(evidence)
    findings = []
    for name, observed in evidence.observed.items():
        field = explained(observed.best, name, smooth_field(observed.best, name), warp_columns(observed.best, name))
        if field.chance < BY_CHANCE and field.part > SYSTEMATIC:
            sentence = (
                f"{name}: {field.part * observed.best.sigma:.2g} px of the residuals ({field.part:.0%} of the noise) "
                f"follow a smooth pattern over the image that the lens model cannot take up."
            )
            findings.append(found("model-too-simple", sentence, field.part * observed.best.sigma, "px", name))
    return findings


def board_warp(evidence: Evidence) -> Outcome:
    """The two sagittas of the board on top of the solution, with a smooth field over the image given its share."""
    if not evidence.observed:
        return no_corners(evidence)
    findings = []
    for name, observed in evidence.observed.items():
        board = observed.adjustment.board
        bend = explained(observed.best, name, warp_columns(observed.best, name), smooth_field(observed.best, name))
        side = (max(board.columns, board.rows) - 1) * board.square_size
        worst = bend.values[np.abs(bend.values).argmax()]
        if bend.chance < BY_CHANCE and abs(worst) > BENT * side:
            along, across = bend.values * 1000
            sentence = (
                f"{name}: the corners fit a board that is bent by {along:.2g} mm along its rows and {across:.2g} mm "
                f"along its columns, {abs(worst) / side:.1%} of its length."
            )
            findings.append(found("board-warp", sentence, abs(worst) * 1000, "mm", name))
    return findings


def split_disagreement(evidence: Evidence) -> Outcome:
    """The cameras of two halves of the views, parted in time and by turns, against their own uncertainties."""
    if not evidence.observed:
        return no_corners(evidence)
    enough = {name: each for name, each in evidence.observed.items() if each.best.posed.sum() >= FEWEST_VIEWS}
    if not enough:
        return Lacking(f"it needs at least {FEWEST_VIEWS} views")
    return [
        finding for observed in enough.values() for finding in (list(_drift(observed)) or list(_disagreement(observed)))
    ]


def _drift(observed: Observed) -> Iterator[Finding]:
    """A focal length that changes evenly from the first view to the last, as one more parameter."""
    best, name = observed.best, observed.name
    grid = best.cameras[name].intrinsics
    time = np.linspace(-0.5, 0.5, best.views)[:, None, None, None]
    stretch = parameter_columns(best, name, ["fx", "fy"]) @ [[grid.fx], [grid.fy]]
    drift = explained(best, name, np.nan_to_num(time * stretch))
    if drift.chance < BY_CHANCE and abs(drift.values[0]) > DRIFTING:
        sentence = (
            f"{name}: the focal length {'grows' if drift.values[0] > 0 else 'falls'} by {abs(drift.values[0]):.2%} "
            f"(± {drift.sigmas[0]:.2%}) from the first view to the last."
        )
        yield found("split-disagreement", sentence, drift.values[0] * 100, "%", name)


def _disagreement(observed: Observed) -> Iterator[Finding]:
    best, views = observed.best, np.cumsum(observed.best.posed)
    splits = {"the earlier and the later views": views <= views[-1] // 2, "every other view": views % 2 == 0}
    results = {said: halves(best, first, camera=observed.name, grid=COARSE) for said, first in splits.items()}
    apart = {said: float(np.nanmedian(each.difference.length)) for said, each in results.items()}
    certain = [said for said, each in results.items() if each.probability < BY_CHANCE and apart[said] > APART_PX]
    if certain:
        said = max(certain, key=lambda each: apart[each])
        sentence = (
            f"{observed.name}: solved from {said}, the camera differs by {apart[said]:.2g} px over the image "
            f"(median); noise alone parts them so far less than once in {1 / BY_CHANCE:,.0f} times."
        )
        yield found("split-disagreement", sentence, apart[said], "px", observed.name)


def half_pixel(evidence: Evidence) -> Outcome:
    """A constant shift of all residuals, or between two calibrations of one camera."""
    others = list(evidence.counterparts())
    if not evidence.observed and not others:
        return Lacking("it needs detected corners with the poses of the board, or another calibration (--compare)")
    findings = [finding for observed in evidence.observed.values() for finding in _shifted_corners(observed)]
    known = {finding.camera for finding in findings}
    for name, camera, other in others:
        if name not in known and (camera.intrinsics.width, camera.intrinsics.height) == (
            other.intrinsics.width,
            other.intrinsics.height,
        ):
            pixels = camera.intrinsics.from_pixels(_grid(camera.intrinsics.width, camera.intrinsics.height))
            rays = camera.lens.unproject(pixels)
            shift = other.intrinsics.to_pixels(other.lens.project(rays)) - camera.intrinsics.to_pixels(pixels)
            shift = shift[np.isfinite(shift).all(axis=-1)]
            if len(shift) and _is_shift(np.median(shift, axis=0)) and shift.std(axis=0).max() < CLOSE_TO_SHIFT:
                findings.append(_shift_found(name, np.median(shift, axis=0), "against the other calibration"))
    return findings


def _shifted_corners(observed: Observed) -> Iterator[Finding]:
    residuals = observed.residuals[observed.adjustment.used[observed.name]]
    mean = residuals.mean(axis=0)
    error = residuals.std(axis=0) / np.sqrt(len(residuals))
    if _is_shift(mean) and (np.abs(mean) > STANDARD_ERRORS * error).all():
        yield _shift_found(observed.name, mean, "on average over all corners")


def _is_shift(shift: Array) -> bool:
    return any((np.abs(np.abs(shift) - size) < CLOSE_TO_SHIFT).all() for size in SHIFTS)


def _shift_found(name: str, shift: Array, where: str) -> Finding:
    sentence = f"{name}: pixels are shifted by ({shift[0]:+.2f}, {shift[1]:+.2f}) {where}."
    return found("half-pixel", sentence, float(np.abs(shift).mean()), "px", name)


def _grid(width: int, height: int) -> Array:
    u, v = np.meshgrid(np.linspace(0, width - 1, 24), np.linspace(0, height - 1, 18))
    return np.stack([u, v], axis=-1)
