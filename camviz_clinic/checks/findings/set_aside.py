"""Corners that the solution set aside: how many, in which pattern, and how far off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.observed import Mask, Observed
from camviz_clinic.checks.registry import Finding, Rng, finding
from camviz_clinic.checks.virtual import single

MANY = 0.05  # of all corners of a camera: fewer are what any set of photographs has
FEWEST = 3  # corners in a row or column that make a pattern
ONE_WAY = 0.9  # the length of the mean of unit vectors, which is 1 where all point one way


@finding(
    "corners-set-aside",
    severity="note",
    view="residual-vectors",
    symptom="The solution set corners aside, because they contradict the rest.",
    causes=("corners that were found badly, in blur, in glare or at the border", "a board that bends as it is held"),
    remedy="Look at that picture: a whole row or column was probably found badly, and single corners need nothing.",
    threshold="Always, for each view. Above 5 % of all corners of a camera it is a warning.",
)
def corners_set_aside(evidence: Evidence) -> Iterator[Finding]:
    """The check counts the corners that the file marks as set aside, and looks for rows and columns among them."""
    for name, observed in evidence.with_corners().items():
        seen = np.asarray(np.isfinite(observed.detections).all(axis=-1))
        aside = seen & observed.adjustment.set_aside.get(name, np.zeros_like(seen))
        for view in map(int, np.flatnonzero(aside.any(axis=1))):
            sentence = f"{evidence.picture(name, view)}: {_told(observed, view, seen[view], aside[view])}"
            yield corners_set_aside.found(sentence, aside[view].sum(), "corners", name, pictures=(view,))
        share = aside.sum() / max(int(seen.sum()), 1)
        if share > MANY:
            sentence = (
                f"{name}: {share:.1%} of all corners ({aside.sum()} of {seen.sum()}) are set aside, in "
                f"{aside.any(axis=1).sum()} of {len(aside)} views."
            )
            yield corners_set_aside.found(sentence, 100 * share, "% of the corners", name, severity="warning")


def _told(observed: Observed, view: int, seen: Mask, aside: Mask) -> str:
    """How many of a view's corners are set aside, which, and how far off they are."""
    residuals = observed.residuals[view][aside]
    lengths = np.linalg.norm(residuals, axis=-1)
    farthest = np.nanmax(lengths) if np.isfinite(lengths).any() else np.nan
    count = int(aside.sum())
    where = pattern(aside.reshape(observed.shape), seen.reshape(observed.shape))
    way = ", all to one side" if points_one_way(residuals) else ""
    verb, far = ("is", "it is") if count == 1 else ("are", "the farthest is")
    return f"{count} of {seen.sum()} corners {verb} set aside, {where}{way}; {far} {farthest:.2g} px off."


def pattern(aside: Mask, seen: Mask) -> str:
    """Where on the board the corners lie that were set `aside`, of those that were `seen`, both (rows, columns).

    A row or column is named that holds at least half of them, three or more, and has lost at least half of its own.

    >>> import numpy as np
    >>> aside = np.zeros((6, 9), bool)
    >>> aside[1:, 0] = True
    >>> pattern(aside, np.ones((6, 9), bool))
    'all in column 1'
    >>> aside[2, 5] = True
    >>> pattern(aside, np.ones((6, 9), bool))
    '5 of them in column 1'
    """
    count = int(aside.sum())
    if count == seen.sum():
        return "the whole view"
    if count == 1:
        ((row, column),) = np.argwhere(aside)
        return f"in row {row + 1} and column {column + 1}"
    lines = [(f"row {row + 1}", aside[row], seen[row]) for row in range(len(aside))]
    lines += [(f"column {column + 1}", aside[:, column], seen[:, column]) for column in range(aside.shape[1])]
    label, line, whole = max(lines, key=lambda each: int(each[1].sum()))
    held = int(line.sum())
    if held < max(FEWEST, count / 2, whole.sum() / 2):
        return "scattered over the board"
    return f"{'all' if held == count else f'{held} of them'} in {label}"


def points_one_way(residuals: Array) -> bool:
    """Whether three or more residuals (n, 2) all point to much the same side."""
    lengths = np.linalg.norm(residuals, axis=-1)
    known = lengths > 0
    units = residuals[known] / lengths[known, None]
    return bool(len(units) >= FEWEST and np.linalg.norm(units.mean(axis=0)) > ONE_WAY)


@corners_set_aside.fault("column set aside", "squares", (0.1, 0.3, 0.5), promised=0.5)
def column_set_aside(rng: Rng, strength: float) -> Evidence:
    """A column of one view is off, and the solution set it aside."""
    set_up = single(rng)
    (corners,) = set_up.observed(rng)
    grid = corners[rng.integers(len(corners))].reshape(set_up.board.rows, set_up.board.columns, 2)
    grid[:, 0] += strength * (grid[:, 1] - grid[:, 0])
    return Evidence(set_up.solved((corners,)))
