"""Outliers among corners and views, by one rule.

A corner is an outlier when it lies further from where the solution puts it than √(2 ln(N/0.1)) σ, N being the number of
corners that were seen: of N corners with nothing but Gaussian noise of σ in each coordinate, one set in ten loses a
single corner (4.2 σ for 700 corners, 5 σ for 27,000; mrcal's rule is 4 σ for any number). σ is at first the median
distance of all corners, divided by √(2 ln 2), which outliers hardly move; then that of the corners in use,
√(Σ r²/(measurements - unknowns)); and never below 0.01 px, for no corner is found more exactly. A view that keeps
fewer than half of its corners, or fewer than six, is set aside as a whole, with the pose that suits the better half of
its corners. Every corner is judged anew after every solution, until nothing changes; one that agrees again is taken
back.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.calibration.detection import seen
from camviz_clinic.calibration.types import Mask

Masks = dict[str, Mask]

FALSE_ALARMS = 0.1  # corners that a set without outliers may be expected to lose
FINEST = 0.01  # pixels


def limit(adjustment: Adjustment, at_first: bool = False) -> float:
    """The distance in pixels from which a corner is an outlier."""
    count = sum(int(mask.sum()) for mask in _seen(adjustment).values())
    return furthest(count, max(_sigma(adjustment, at_first), FINEST))


def furthest(count: int, sigma: float) -> float:
    """The distance that one of `count` corners with noise of `sigma` exceeds by chance in one set of ten.

    >>> round(furthest(700, 1.0), 1)
    4.2
    """
    return sigma * float(np.sqrt(2 * np.log(count / FALSE_ALARMS)))


def outliers(adjustment: Adjustment, at_first: bool = False) -> Masks:
    """Which corners (views, corners) are to be set aside, by camera; `at_first` before any have been."""
    most, found = limit(adjustment, at_first), {}
    for name, there in _seen(adjustment).items():
        distance = np.linalg.norm(adjustment.residuals[name], axis=-1)
        out = there & ~(distance <= most)
        kept = (there & ~out).sum(axis=1)
        whole = (kept < FEWEST) | (kept < there.sum(axis=1) / 2)
        found[name] = out | (there & whole[:, None])
    return found


def sentences(adjustment: Adjustment, pictures: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """What was set aside, in words."""
    said, parts, corners = [], [], 0
    for name, there in _seen(adjustment).items():
        aside = adjustment.set_aside[name]
        for picture, count, all_of_it in zip(pictures[name], aside.sum(axis=1), there.sum(axis=1), strict=True):
            if count == all_of_it and count:
                said.append(f"{picture} was set aside: too few of its corners agree with the other views.")
            elif count:
                parts.append((-int(count), picture))
                corners += int(count)
    if parts:
        total = sum(int(there.sum()) for there in _seen(adjustment).values())
        most = ", ".join(f"{-count} in {picture}" for count, picture in sorted(parts)[:6])
        more = f" and {len(parts) - 6} more pictures" * (len(parts) > 6)
        said.append(
            f"{corners} of {total} corners lie more than {limit(adjustment):.2f} px from where the others put them and "
            f"were set aside: {most}{more}."
        )
    return tuple(said)


def _seen(adjustment: Adjustment) -> Masks:
    return {name: seen(corners) for name, corners in adjustment.detections.items()}


def _sigma(adjustment: Adjustment, at_first: bool) -> float:
    if not at_first:
        return adjustment.sigma
    distances = [np.linalg.norm(residuals, axis=-1) for residuals in adjustment.residuals.values()]
    return float(np.nanmedian(np.concatenate(distances)) / np.sqrt(2 * np.log(2)))
