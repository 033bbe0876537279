"""Corners that are wrong: in a whole view, in a row or column of the board, or one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import chdtri

from camviz.lenses.base import Array
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.judgement import px
from camviz_clinic.checks.observed import Observed
from camviz_clinic.checks.registry import Finding, LabFault, Rng, finding

MANY_TIMES = 3.0  # the median error: twice happens between sharp and less sharp pictures
ONCE_IN = 1e-4  # for all views together: how often the error of a view with few corners may be so far out by chance
FAR_CORNER = 10.0  # times the typical length of a residual
FAR_LINE = 8.0  # the same for half a line of corners, to which the pose has to be extended
VISIBLE_PX = 1.5  # less than this is no wrong detection
A_SQUARE = (0.6, 1.5)  # of a square's width: how far off a line is that was taken for its neighbour
NEIGHBOUR = "a line of the board that was taken for its neighbour"


@finding(
    "outlier-view",
    severity="warning",
    view="per-view-errors",
    symptom="One view has many times the error of the rest.",
    causes=("a wrong detection", "motion blur", "a board that moved while the shutter was open"),
    remedy="Look at that picture. Take it again or leave it out, and solve again.",
    threshold="A view has three times the median error of all views. "
    "Or a corner is ten standard deviations and more than 1.5 px off.",
    explains=("views-disagree",),
)
def outlier_view(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the errors of the views, and those of the single corners."""
    known = evidence.calibration.per_view_errors
    if not evidence.observed and not any(len(errors) > 2 for errors in known.values()):
        raise NotChecked("the file holds no errors of views")
    for name in evidence.calibration.cameras:
        observed, errors = evidence.observed.get(name), known.get(name)
        if observed is not None:
            counts = np.isfinite(observed.in_use).all(axis=-1).sum(axis=1)
            bad = list(_bad_views(evidence, name, observed.errors, counts))
            yield from bad
            yield from _bad_corners(evidence, observed, {view for finding in bad for view in finding.pictures})
        elif errors is not None and len(errors) > 2:
            yield from _bad_views(evidence, name, np.asarray(errors), np.full(len(errors), 50))


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
        yield outlier_view.found(sentence, errors[view], "px", name, pictures=(view,))


def _bad_corners(evidence: Evidence, observed: Observed, named: set[int]) -> Iterator[Finding]:
    """Views that are not bad as a whole, but for a corner or two."""
    lengths = np.linalg.norm(observed.in_use, axis=-1)
    far = lengths > max(FAR_CORNER * observed.scatter, VISIBLE_PX)
    for view in map(int, np.flatnonzero(far.any(axis=1))):
        if view in named:
            continue
        worst, count = int(np.nanargmax(lengths[view])), int(far[view].sum())
        row, column = divmod(worst, observed.shape[1])
        sentence = (
            f"{evidence.picture(observed.name, view)}: {count} corner{' is' if count == 1 else 's are'} far off, the "
            f"worst (row {row + 1}, column {column + 1}) by {lengths[view, worst]:.3g} px, "
            f"{lengths[view, worst] / observed.scatter:.0f} times the typical error."
        )
        yield outlier_view.found(sentence, lengths[view, worst], "px", observed.name, pictures=(view,))


@outlier_view.fault(
    "outlier corner",
    "px",
    (1, 3, 10, 30),
    promised=10,
    stage="corners",
    lab=LabFault(30, "one corner of one view is {0:.1f} px off"),
)
def outlier_corner(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """One corner of one view is off."""
    angle = rng.uniform(0, 2 * np.pi)
    place = rng.integers(len(corners)), rng.integers(corners.shape[1])
    corners[place] += strength * np.array([np.cos(angle), np.sin(angle)])


@outlier_view.fault(
    "blurred view",
    "px",
    (0.3, 1, 3, 10),
    promised=3,
    beyond_doubt=(3, 8),
    stage="corners",
    lab=LabFault(6, "the corners of one view scatter by {0:.1f} px more"),
)
def blurred_view(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """The corners of one view scatter."""
    view = rng.integers(len(corners))
    corners[view] += rng.normal(0, strength, corners[view].shape)


@finding(
    "outlier-line",
    severity="warning",
    view="residual-vectors",
    symptom="A whole row or column of corners is off.",
    causes=(NEIGHBOUR, "a board half hidden or cut off by the border", "blur or glare along that line"),
    remedy="Detect that picture's corners again, or leave the view out, and solve again.",
    threshold="At least half of a line's corners are off by eight standard deviations and by more than 1.5 px.",
    explains=("outlier-view", "views-disagree"),
)
def outlier_line(evidence: Evidence) -> Iterator[Finding]:
    """The check compares every row and column of every view with a pose fitted to the rest of that view."""
    for observed in evidence.with_corners().values():
        limit = max(FAR_LINE * observed.scatter, VISIBLE_PX)
        lines = _lines(observed)
        for view, of_view in enumerate(_lengths_left_out(observed, [corners for _, corners in lines])):
            off = [_share_beyond(length, limit) for length in of_view]
            worst = max(range(len(lines)), key=lambda line: (off[line] >= 0.5) * _median(of_view[line]))
            if off[worst] >= 0.5:
                label, corners = lines[worst]
                median, square = _median(of_view[worst]), _square(observed, view)
                sentence = (
                    f"{evidence.picture(observed.name, view)}: {label} of the board is off by {median:.3g} px, "
                    f"{round(off[worst] * len(corners))} of its {len(corners)} corners by more than {limit:.2g} px. "
                    f"A square is {px(square)} wide there."
                )
                like_neighbour = A_SQUARE[0] <= median / square <= A_SQUARE[1]
                causes = tuple(each for each in outlier_line.causes if like_neighbour or each != NEIGHBOUR)
                yield outlier_line.found(sentence, median, "px", observed.name, pictures=(view,), causes=causes)


def _square(observed: Observed, view: int) -> float:
    """The side of a square in a view, the median over the board, in pixels; NaN where no two neighbours were seen."""
    grid = observed.detections[view].reshape(*observed.shape, 2)
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).ravel() for axis in (0, 1)]
    known = np.concatenate(sides)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else np.nan


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
        seen = np.isfinite(observed.in_use[view]).all(axis=-1)
        residuals = np.where(seen[:, None], observed.in_use[view], 0)
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


@outlier_line.fault(
    "column off",
    "squares",
    (0.02, 0.1, 0.5, 1),
    promised=0.5,
    beyond_doubt=(0.5, 1),
    stage="corners",
    lab=LabFault(1, "in one view a column of corners is {0:.2f} squares off"),
)
def column_off(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """A column is taken for its neighbour."""
    grid = corners[rng.integers(len(corners))].reshape(*shape, 2)
    column = rng.integers(shape[1])
    towards = column - 1 if column else 1
    grid[:, column] += strength * (grid[:, towards] - grid[:, column])


@outlier_line.fault("rows swapped", "views", (1, 2, 3), promised=1, stage="corners")
def rows_swapped(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """Two neighbouring rows are exchanged."""
    for view in rng.permutation(len(corners))[: round(strength)]:
        grid, row = corners[view].reshape(*shape, 2), rng.integers(shape[0] - 1)
        grid[[row, row + 1]] = grid[[row + 1, row]]
