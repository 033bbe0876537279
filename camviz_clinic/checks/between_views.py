"""Whether a camera changed between its views, beyond what noise and what the scatter of the views let expect."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from camviz.lenses.base import Array
from camviz_clinic.calibration.cross_validation import halves
from camviz_clinic.calibration.types import Mask
from camviz_clinic.checks.observed import BY_CHANCE, Explained, Observed, explained, parameter_columns, projected
from camviz_clinic.checks.view_by_view import PARTINGS, ViewByView

FEWEST_VIEWS = 6  # to be parted in two
DRIFTING = 0.003  # of the focal length
APART_PX = 1.0  # the median difference of two halves over the image; the whole is off by about half of it
BY_SCATTER = 1e-3  # how often a change over the views may be their scatter
RANKED = 0.002  # of the orders or partings of the views by lot, how many may differ more
GRID = (16, 12)  # points of the image at which halves are compared
CORNER_SIGMAS = 4.0  # times what noise lets expect of halves in a corner; of 500 healthy ones the largest is 3.7


@dataclass(frozen=True, eq=False)
class Drift:
    """A focal length that grows evenly from a camera's first view to its last.

    It is held against the noise of independent corners, and against focal lengths of every view's own: the latter is
    a regression of these on time (Student's t).
    """

    observed: Observed

    @property
    def share(self) -> float:
        """By what part of itself it grows."""
        return float(self._drift.values[0])

    @property
    def sigma(self) -> float:
        """The standard deviation of `share`, by the scatter of the views."""
        return float(self._drift.sigmas[0] * np.sqrt(self._more))

    @property
    def beyond_noise(self) -> bool:
        """Whether it matters, and the noise of corners does not explain it."""
        return self._drift.chance < BY_CHANCE and abs(self.share) > DRIFTING

    @property
    def scatter(self) -> float:
        """The chance of it where the focal lengths of the views scatter as these do."""
        return float(fdtrc(1, max(self._each.count, 1), self._drift.F / self._more))

    @property
    def larger(self) -> float:
        """The share of other orders of the same views, at random, in which they drift more clearly."""
        residuals, columns, *_ = projected(self.observed.best, self.observed.name, self._stretches)
        along, squares = columns.T @ residuals, columns.T @ columns
        posed, rng = self.observed.best.posed, np.random.default_rng(0)
        times = np.tile(self._time, (1 + PARTINGS, 1))
        for order in times[1:]:
            order[posed] = rng.permutation(order[posed])
        fallen = (times @ along) ** 2 / np.einsum("ov,vw,ow->o", times, squares, times)
        return float(np.mean(fallen[1:] > fallen[0] * (1 + 1e-9)))

    @property
    def certain(self) -> bool:
        """Whether the scatter of the views does not explain it either."""
        return self.beyond_noise and self.scatter < BY_SCATTER and self.larger <= RANKED

    @property
    def _time(self) -> Array:
        return np.linspace(-0.5, 0.5, self.observed.best.views)

    @cached_property
    def _stretches(self) -> Array:
        """The pixels (views, corners, 2, views) by the logarithm of every view's own focal length."""
        best, name = self.observed.best, self.observed.name
        grid = best.cameras[name].intrinsics
        stretch = np.nan_to_num(parameter_columns(best, name, ["fx", "fy"]) @ [[grid.fx], [grid.fy]])
        return np.asarray(np.eye(best.views)[:, None, None] * stretch)

    @cached_property
    def _drift(self) -> Explained:
        best, name = self.observed.best, self.observed.name
        return explained(best, name, self._stretches @ self._time[:, None])

    @cached_property
    def _each(self) -> Explained:
        best, name = self.observed.best, self.observed.name
        return explained(best, name, self._stretches, self._stretches @ self._time[:, None])

    @property
    def _more(self) -> float:
        """How much more the focal lengths of the views differ than noise lets expect, in variance, at least 1."""
        return max(self._each.F, 1.0)


@dataclass(frozen=True, eq=False)
class Parting:
    """The views parted in two: how far the two cameras differ in pixels (median over the image).

    `noise` is the chance of that if corners were independent. `corner` is the largest difference in pixels in a corner
    of the image that noise does not explain: 0 without any, infinite where one of the two has no ray there.
    """

    first: Mask
    apart: float
    noise: float
    corner: float

    @property
    def beyond_noise(self) -> bool:
        """Whether it matters, and the noise of corners does not explain it."""
        return self.noise < BY_CHANCE and self.apart > APART_PX


@dataclass(frozen=True, eq=False)
class Partings:
    """The earlier and the later views of a camera, and every other one."""

    observed: Observed
    in_time: Parting
    by_turns: Parting

    @classmethod
    def of(cls, observed: Observed) -> Partings:
        """Both solved anew."""
        place = np.cumsum(observed.best.posed)
        return cls(observed, *(_parted(observed, first) for first in (place <= place[-1] // 2, place % 2 == 0)))

    @property
    def beyond_noise(self) -> list[Parting]:
        """Those that the noise of corners does not explain."""
        return [each for each in (self.in_time, self.by_turns) if each.beyond_noise]

    @property
    def certain(self) -> list[Parting]:
        """Those that the scatter of the views does not explain either."""
        return [each for each in self.beyond_noise if self._beyond_scatter(each)]

    @property
    def at_odds(self) -> bool:
        """Whether the views disagree whichever way they are parted, so much that all together are off as well."""
        return len(self.beyond_noise) == 2 and min(self.in_time.apart, self.by_turns.apart) > 2 * APART_PX

    def _beyond_scatter(self, one: Parting) -> bool:
        first = one.first[self.observed.best.posed]
        return self._views.chance(first) < BY_SCATTER and self._views.larger(first) <= RANKED

    @cached_property
    def _views(self) -> ViewByView:
        return ViewByView.of(self.observed.best)


def _parted(observed: Observed, first: Mask) -> Parting:
    result = halves(observed.best, first, camera=observed.name, grid=GRID)
    camera, corners = observed.best.cameras[observed.name], np.ix_((0, -1), (0, -1))
    has_ray = np.isfinite(camera.lens.unproject(camera.intrinsics.from_pixels(result.difference.uv[corners]))).all(-1)
    apart = result.difference.length[corners]
    apart = np.where(has_ray & np.isnan(apart), np.inf, apart)
    unexplained = np.isinf(apart) | (apart > CORNER_SIGMAS * result.expected[corners])
    corner = float(np.max(apart, where=unexplained, initial=0.0))
    return Parting(first, float(np.nanmedian(result.difference.length)), result.probability, corner)
