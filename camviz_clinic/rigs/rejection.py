"""Outliers among the corners and views of a rig, by the rule of `calibration.outliers` with a σ for each camera.

Cameras of a rig may find corners with different noise: a fisheye of few pixels beside a long lens. One σ for all would
lose good corners of the one and keep bad ones of the other.
"""

from __future__ import annotations

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.detection import seen
from camviz_clinic.calibration.outliers import FINEST, Masks, furthest
from camviz_clinic.rigs.adjustment import RigAdjustment

HOPELESS = 30.0  # times the median of all views: a view that is that far off has no say in the first solution


def hopeless(start: RigAdjustment) -> Masks:
    """Which corners (frames, corners) belong to views of a board that are far from where the chain of cameras puts it.

    Such a view, with its corners counted from another end or of another frame, could spoil the first solution.
    """
    off = {name: _distances(start, name) for name in start.cameras}
    errors = {name: [medians(distances[:, board]) for board in start.boards] for name, distances in off.items()}
    usual = float(np.nanmedian(np.concatenate([each for several in errors.values() for each in several])))
    found = {}
    for name, several in errors.items():
        found[name] = seen(start.detections[name])
        for board, error in zip(start.boards, several, strict=True):
            found[name][:, board] &= ~(error <= HOPELESS * max(usual, 1.0))[:, None]
    return found


def deviation(adjustment: RigAdjustment, name: str, *, at_first: bool = False) -> float:
    """The σ in pixels of a coordinate of a camera's corners; at first from their median distance."""
    if at_first:
        return float(np.nanmedian(_distances(adjustment, name)) / np.sqrt(2 * np.log(2)))
    used = adjustment.used[name]
    spare = (adjustment.measurements - adjustment.unknowns) / max(adjustment.measurements, 1)
    squares = float(np.sum(adjustment.residuals[name][used] ** 2))
    return float(np.sqrt(squares / max(2 * used.sum() * spare, 1e-9)))


def limit(adjustment: RigAdjustment, name: str, *, at_first: bool = False) -> float:
    """The distance in pixels from which a corner of a camera is an outlier."""
    count = sum(int(seen(corners).sum()) for corners in adjustment.detections.values())
    return furthest(count, max(deviation(adjustment, name, at_first=at_first), FINEST))


def outliers(adjustment: RigAdjustment, *, at_first: bool = False) -> Masks:
    """Which corners (frames, corners) are to be set aside, by camera.

    A view of a board that keeps less than half goes whole, and so does all of a frame that keeps too few.
    """
    found = {}
    for name in adjustment.cameras:
        there = seen(adjustment.detections[name])
        out = there & ~(_distances(adjustment, name) <= limit(adjustment, name, at_first=at_first))
        for board in adjustment.boards:
            kept = (there & ~out)[:, board].sum(axis=1)
            out[:, board] |= there[:, board] & (kept < there[:, board].sum(axis=1) / 2)[:, None]
        few = (there & ~out).sum(axis=1) < adjustment.fewest
        found[name] = out | (there & few[:, None])
    return found


def more_agree(one: RigAdjustment, other: RigAdjustment) -> bool:
    """Whether more corners lie within the narrower limit of two solutions in the one than in the other."""
    counts = [0, 0]
    for name in one.cameras:
        narrow = min(limit(one, name), limit(other, name))
        for place, each in enumerate((one, other)):
            counts[place] += int(np.sum(_distances(each, name) <= narrow))
    return counts[0] > counts[1]


def sentences(adjustment: RigAdjustment) -> tuple[str, ...]:
    """What was set aside of each camera, in words."""
    said = []
    for name in adjustment.cameras:
        there, aside = seen(adjustment.detections[name]), adjustment.set_aside[name]
        views = int(((aside == there).all(axis=1) & there.any(axis=1)).sum())
        corners = int(aside[(aside != there).any(axis=1)].sum())
        parts = [f"{views} of {int(there.any(axis=1).sum())} views"] * bool(views)
        parts += [f"{corners} of {int(there.sum())} corners"] * bool(corners)
        if parts:
            most = limit(adjustment, name)
            said.append(
                f"{name}: {' and '.join(parts)} lie more than {most:.2f} px from where the rig has them: set aside."
            )
    return tuple(said)


def medians(distances: Array) -> Array:
    """Of every view (frames,); NaN where nothing was seen."""
    there = np.isfinite(distances).any(axis=1)
    found = np.full(len(distances), np.nan)
    found[there] = np.nanmedian(distances[there], axis=1)
    return found


def _distances(adjustment: RigAdjustment, name: str) -> Array:
    return np.asarray(np.linalg.norm(adjustment.residuals[name], axis=-1))
