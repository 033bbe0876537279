"""What is left over: residuals that a richer lens, a bent board, another half of the views would explain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from camviz.cameras import Camera
from camviz.distortion import image_corner_radius
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import NothingSharedError, pixel_grid
from camviz_clinic.calibration.solving import STOPPED_SHORT
from camviz_clinic.checks.between_views import FEWEST_VIEWS, Drift, Partings
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.fields import smooth_field, warp_columns
from camviz_clinic.checks.observed import BY_CHANCE, Observed, explained
from camviz_clinic.checks.registry import VIEW_BY_VIEW, Finding, LabFault, Rng, finding
from camviz_clinic.checks.virtual import SetUp, alone, changed, healthy, single, spread_boards

SYSTEMATIC = 0.5  # of the noise: what remains of a real lens under the standard model is a third of it
VISIBLE_PX = 0.1  # RMS, a pattern smaller than which harms nobody
STUCK = " The solution stopped where the lens folds, short of the least error of this model."
CLEAR = 3.0  # σ of the corners, which the pattern must reach somewhere
BEYOND = 3.0  # times the field's longest arrow: what is farther off has another cause
BENT = 0.005  # of the board's longer side
OVER_IMAGE = "px over the image"  # not those of a residual
FINE = (24, 18)  # points of the image at which two calibrations are compared
SHIFTS = (0.5, 1.0)  # what conventions for the first pixel's centre differ by
CLOSE_TO_SHIFT = 0.1
STANDARD_ERRORS = 5.0


@finding(
    "model-too-simple",
    severity="warning",
    view="residual-radius",
    symptom="The residuals swirl or point outward.",
    causes=("a lens model with too few terms", "a fisheye solved with a polynomial", "a board that is not flat"),
    remedy="Solve again with a richer model (rational, fisheye), and check that the board is flat.",
    threshold="The field explains more than noise would in one set of a million. It makes up at least half of the "
    "noise and 0.1 px (RMS), and somewhere reaches three standard deviations of the corners.",
    explains=(
        *VIEW_BY_VIEW,
        "rolling-shutter",
        "fold",
        "near-pole",
        "inverse-not-converged",
        "pose-absorbs-error",
        "split-disagreement",
    ),
)
def model_too_simple(evidence: Evidence) -> Iterator[Finding]:
    """The check fits a smooth field over the image to all residuals. The board's bend takes its share first."""
    for name, observed in evidence.with_corners().items():
        best = observed.best
        field = explained(best, name, smooth_field(best, name), warp_columns(best, name))
        enough = field.pixels > VISIBLE_PX and field.most > CLEAR * best.sigma
        if field.chance < BY_CHANCE and field.part > SYSTEMATIC and enough:
            sentence = (
                f"{name}: the lens model is too simple. A smooth pattern over the image makes up {field.pixels:.2g} px "
                f"of the residuals (RMS) and up to {field.most:.2g} px of a single one, where the noise is "
                f"{field.pixels / field.part:.2g} px.{STUCK * (STOPPED_SHORT in evidence.calibration.notes)}"
            )
            yield model_too_simple.found(sentence, field.pixels, "px", name, reach=BEYOND * field.most)


def richer(rng: Rng, set_up: SetUp, strength: float, *, widest: float, views: int) -> SetUp:
    """A lens whose r⁵ term moves the image's corner by so many pixels; boards have room in its `widest` picture."""
    grid = set_up.camera.intrinsics
    wide, own = (
        replace(set_up.camera, lens=BrownConrady(0.05, px / (grid.fx * image_corner_radius(grid) ** 5)))
        for px in (widest, strength)
    )
    return replace(set_up, cameras=(own,), cam_from_board=spread_boards(rng, (wide,), set_up.board, views, (15, 40)))


@model_too_simple.fault(
    "lens too rich",
    "px at the corner",
    (0.3, 3, 10, 30),
    promised=30,
    lab=LabFault(
        30,
        "an r⁵ term of {0:.1f} px, at the corner, and a model with k1 only",
        set_up=lambda seed, set_up, amount: richer(
            np.random.default_rng(seed), set_up, amount, widest=30, views=len(set_up.cam_from_board)
        ),
        estimated=("fx", "fy", "cx", "cy", "k1"),
    ),
)
def lens_too_rich(rng: Rng, strength: float) -> Evidence:
    """An r⁵ term is left to a model with k1 alone."""
    set_up = richer(rng, single(rng), strength, widest=strength, views=15)
    return Evidence(set_up.solved(set_up.observed(rng), fixed=("k2", "p1", "p2", "k3")))


@finding(
    "board-warp",
    severity="warning",
    view="board-residuals",
    symptom="The residuals are bowed across the board.",
    causes=("a board that is not flat: paper on cardboard, or a sheet that hangs",),
    remedy="Mount the board on glass or aluminium, or solve for its bend as well (--board-warp on).",
    threshold="Noise would show the bend in one set of a million, "
    "and it is at least half a percent of the board's longer side.",
    explains=(
        *VIEW_BY_VIEW,
        "pose-absorbs-error",
        "model-too-simple",
        "split-disagreement",
    ),
)
def board_warp(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the joint solution with and without two parameters for the bend of the board."""
    for name, observed in evidence.with_corners().items():
        board = observed.adjustment.board
        bend = explained(observed.best, name, warp_columns(observed.best, name), smooth_field(observed.best, name))
        side = board.length
        worst = bend.values[np.abs(bend.values).argmax()]
        if bend.chance < BY_CHANCE and abs(worst) > BENT * side:
            along, across = bend.values * 1000
            sentence = (
                f"{name}: the board is bent, by {along:.2g} mm along its rows and {across:.2g} mm along its columns. "
                f"This is {abs(worst) / side:.1%} of its length."
            )
            yield board_warp.found(sentence, abs(worst) * 1000, "mm", name)


@board_warp.fault(
    "warped board",
    "% of its length",
    (0.1, 0.5, 1, 2),
    promised=1,
    beyond_doubt=(1.5, 2),
    stage="set-up",
    lab=LabFault(2, "the board is bent by {0:.2f} % of its length"),
)
def warped_board(rng: Rng, set_up: SetUp, strength: float) -> SetUp:
    """The board is bent along its rows."""
    side = set_up.board.length
    return replace(set_up, warp=(strength / 100 * side, 0.0))


@finding(
    "split-disagreement",
    severity="warning",
    view="cross-validation",
    symptom="The two halves of the set disagree.",
    causes=(
        "a focus or zoom that changed between the views",
        "too few views for the model",
        "a board that bends as it is held",
    ),
    remedy="Lock focus and zoom, switch stabilisation off, take more views, and solve again.",
    threshold="The focal length changes by 0.3 %, or the cameras differ by at least a pixel (median over the image). "
    "Noise would show it in one set of a million, and so would views that scatter as these do in one of a "
    "thousand. Of 500 halves by lot at most one differs more clearly. Or both partings differ by two pixels.",
    explains=(
        *VIEW_BY_VIEW,
        "pose-absorbs-error",
    ),
)
def split_disagreement(evidence: Evidence) -> Iterator[Finding]:
    """The check solves for a focal length that changes evenly over the views. It also compares the cameras from the
    earlier and the later views, and from every other view. It holds that against how much all views differ.
    """
    enough = [each for each in evidence.with_corners().values() if each.best.posed.sum() >= FEWEST_VIEWS]
    if not enough:
        raise NotChecked(f"it needs at least {FEWEST_VIEWS} views")
    found, apart = list[Finding](), list[str]()
    for observed in enough:
        try:
            found += list(_drift(observed)) or list(_disagreement(observed, evidence.partings(observed.name)))
        except NothingSharedError:
            apart.append(observed.name)
    if apart and not found:
        raise NotChecked(f"the cameras that halves of the views lead to have no rays in common ({', '.join(apart)})")
    yield from found


def _drift(observed: Observed) -> Iterator[Finding]:
    drift = Drift(observed)
    if drift.certain:
        sentence = (
            f"{observed.name}: the focal length {'grows' if drift.share > 0 else 'falls'} by {abs(drift.share):.2%} "
            f"(± {drift.sigma:.2%}) from the first view to the last."
        )
        yield split_disagreement.found(sentence, drift.share * 100, "%", observed.name)


def _disagreement(observed: Observed, partings: Partings) -> Iterator[Finding]:
    in_time, by_turns = partings.in_time.apart, partings.by_turns.apart
    if certain := partings.certain:
        most = max(certain, key=lambda each: each.apart)
        said = "the earlier and from the later views" if most is partings.in_time else "every other view"
        sentence = (
            f"{observed.name}: solved from {said}, the camera differs by {most.apart:.2g} px over the image (median). "
            "Halves of the same views that are drawn by lot hardly ever differ so clearly."
        )
        yield split_disagreement.found(sentence, most.apart, OVER_IMAGE, observed.name)
    elif partings.at_odds:
        sentence = (
            f"{observed.name}: the views do not agree on one camera. Solved from the earlier and from the later ones, "
            f"it differs by {in_time:.2g} px over the image (median), from every other one by {by_turns:.2g} px. "
            "From all of them it may be off by half as much."
        )
        yield split_disagreement.found(sentence, min(in_time, by_turns), OVER_IMAGE, observed.name)


@split_disagreement.fault(
    "autofocus drift",
    "%",
    (0.2, 1, 3, 10),
    promised=10,
    beyond_doubt=(3, 4),
    stage="set-up",
    lab=LabFault(3, "the focal length grows by {0:.2f} % from first view to last"),
)
def autofocus_drift(rng: Rng, set_up: SetUp, strength: float) -> SetUp:
    """The focal length grows from the first view to the last."""
    return replace(set_up, zoom=1 + strength / 100 * np.linspace(-0.5, 0.5, len(set_up.cam_from_board)))


@finding(
    "half-pixel",
    severity="warning",
    view="difference",
    symptom="Everything is shifted by a constant half pixel.",
    causes=("a program that wrote the centre of the first pixel as (0.5, 0.5) or (1, 1)",),
    remedy="Take the shift of 0.5 (COLMAP, nerfstudio) or 1 (MATLAB) off cx and cy, or off the corners.",
    threshold="The shift is the same in x and y, within 0.1 px of a half or a whole pixel. "
    "It is at least five standard errors from none.",
)
def half_pixel(evidence: Evidence) -> Iterator[Finding]:
    """The check takes the mean of all residuals, or the shift between two calibrations."""
    others = list(evidence.counterparts())
    if not evidence.observed and not others:
        raise NotChecked("it needs detected corners with the poses of the board, or another calibration (--compare)")
    findings = [finding for observed in evidence.observed.values() for finding in _shifted_corners(observed)]
    yield from findings
    for name, camera, other in others:
        if name not in {finding.camera for finding in findings}:
            yield from _shifted_camera(name, camera, other)


def _shifted_corners(observed: Observed) -> Iterator[Finding]:
    residuals = observed.residuals[observed.adjustment.used[observed.name]]
    mean = residuals.mean(axis=0)
    error = residuals.std(axis=0) / np.sqrt(len(residuals))
    if _is_shift(mean) and (np.abs(mean) > STANDARD_ERRORS * error).all():
        yield _shift_found(observed.name, mean, "on average over all corners")


def _shifted_camera(name: str, camera: Camera, other: Camera) -> Iterator[Finding]:
    """Where the other camera puts the rays of this one's pixels, in images of the same size."""
    ours, theirs = camera.intrinsics, other.intrinsics
    if (ours.width, ours.height) != (theirs.width, theirs.height):
        return
    pixels = ours.from_pixels(pixel_grid(ours, FINE))
    shift = theirs.to_pixels(other.lens.project(camera.lens.unproject(pixels))) - ours.to_pixels(pixels)
    shift = shift[np.isfinite(shift).all(axis=-1)]
    if len(shift) and _is_shift(np.median(shift, axis=0)) and shift.std(axis=0).max() < CLOSE_TO_SHIFT:
        yield _shift_found(name, np.median(shift, axis=0), "against the other calibration")


def _is_shift(shift: Array) -> bool:
    return any((np.abs(np.abs(shift) - size) < CLOSE_TO_SHIFT).all() for size in SHIFTS)


def _shift_found(name: str, shift: Array, where: str) -> Finding:
    sentence = f"{name}: pixels are shifted by ({shift[0]:+.2f}, {shift[1]:+.2f}) {where}."
    dx, dy = np.copysign(min(SHIFTS, key=lambda size: abs(abs(shift[0]) - size)), shift)
    remedy = f"Change cx by {dx:+g} px and cy by {dy:+g} px, or the corners by as much the other way."
    return half_pixel.found(sentence, float(np.abs(shift).mean()), "px", name, remedy=remedy)


@half_pixel.fault(
    "half pixel",
    "px",
    (0.5, 1),
    promised=0.5,
    stage="solution",
    lab=LabFault(1, "cx and cy are counted from {0:.2f} px elsewhere"),
)
def counted_from_elsewhere(solution: Adjustment, strength: float) -> Adjustment:
    """cx and cy are counted from elsewhere."""
    ((name, camera),) = solution.cameras.items()
    grid = camera.intrinsics
    shifted = replace(camera, intrinsics=replace(grid, cx=grid.cx + strength, cy=grid.cy + strength))
    return replace(solution, cameras={name: shifted})


@half_pixel.fault("half pixel between two", "px", (0.5, 1), promised=0.5)
def half_pixel_against(rng: Rng, strength: float) -> Evidence:
    """The same without corners, beside the calibration as it was."""
    calibration = healthy(rng)
    grid = calibration.cameras["camera"].intrinsics
    shifted = changed(calibration, cx=grid.cx + strength, cy=grid.cy + strength)
    return Evidence(alone(shifted), alone(calibration))
