"""Whether the views of a set disagree by more than the noise of their corners lets expect."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.observed import BY_CHANCE, Observed
from camviz_clinic.checks.registry import Finding, Rng, finding
from camviz_clinic.checks.view_by_view import ViewByView

FEWEST_VIEWS = 5
TIMES = 2.0  # of 100 healthy virtual sets the largest ratio is 1.6, and no scatter has a chance below 0.6 %


@dataclass(frozen=True)
class Disagreement:
    """How many times larger the σ of the intrinsics are by the scatter of the views than by the noise of the corners.

    `ratio` is the median over the intrinsics, and `chance` how often independent corners give views that scatter so.
    """

    ratio: float
    chance: float

    @classmethod
    def of(cls, observed: Observed) -> Self:
        """Of a camera's solution without the corners that are far out."""
        best = observed.best
        place = best.intrinsics_of(observed.name)
        variances = (np.diag(each)[place] for each in (best.clustered_covariance, best.corner_covariance))
        return cls(float(np.median(np.sqrt(np.divide(*variances)))), ViewByView.of(best).chance_of_scatter)

    @property
    def certain(self) -> bool:
        """Whether it is large, and not by chance."""
        return self.ratio > TIMES and self.chance < BY_CHANCE


@finding(
    "views-disagree",
    severity="note",
    view="uncertainty",
    symptom="The views disagree by more than their corners' noise.",
    causes=(
        "a board that is bent, or bends as it is held",
        "a lens model with too few terms",
        "a board or a camera that moved, under a rolling shutter or with blur",
    ),
    remedy="Use the ± as it is told: it has this in it. To lessen it, mount the board on a stiff plate, lock zoom and "
    "focus, hold everything still, and try a richer model.",
    threshold="The median ratio over the intrinsics is more than two, from five views on. Cameras of every view's own "
    "explain more than noise would in one set of a million.",
)
def views_disagree(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the standard deviations by the scatter of the views with those by the noise of the corners."""
    enough = [each for each in evidence.with_corners().values() if each.best.posed.sum() >= FEWEST_VIEWS]
    if not enough:
        raise NotChecked(f"it needs at least {FEWEST_VIEWS} views")
    for observed in enough:
        disagreement = Disagreement.of(observed)
        if disagreement.certain:
            sentence = (
                f"{observed.name}: the views disagree. By their scatter the standard deviations of the intrinsics are "
                f"{disagreement.ratio:.1f} times as large as the noise of the corners alone would make them."
            )
            yield views_disagree.found(sentence, disagreement.ratio, "times", observed.name)


@views_disagree.fault("loose board", "px", (0.1, 0.3, 1), promised=1, stage="corners")
def loose_board(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """The board is twisted another way in every view."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, count) for count in shape), indexing="ij")
    ways = np.stack([x * x, x * y, y * y, x**3]).reshape(4, -1)
    corners += np.einsum("wc,vwi->vci", ways, rng.normal(0, strength, (len(corners), 4, 2)))
