"""The pixels beside an edge, and the light on its two sides: their levels, and how the light falls off over them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camviz.lenses.base import Array

MOST_PIXELS = 1_000_000  # in a strip; of longer edges every n-th row is taken
SIGNIFICANT = 3.0  # standard errors: smaller slopes of light are not taken out
FEWEST_ON_A_SIDE = 40  # pixels
DEEP_FOR_SLOPES, DEEP_FOR_CURVES = 0.5, 1.0  # a side's depth over its distance from the edge
OUTLIER = 4.0  # standard deviations: dust and the like, left out


@dataclass(frozen=True, eq=False)
class Strip:
    """The pixels near the line u = slope · v + intercept: their rows and columns, distances from it, and light (n,).

    Distances are in pixels along the line's normal, rising to the right.
    """

    v: Array
    u: Array
    distance: Array
    light: Array

    @classmethod
    def of(cls, image: Array, line: tuple[float, float], reach: float) -> Strip:
        """The pixels of an image (height, width) within the reach in pixels."""
        slope, intercept = line
        cosine = np.cos(np.arctan(slope))
        rows, columns = image.shape
        half = int(np.ceil(reach / cosine)) + 1
        every = max(1, rows * min(2 * half + 1, columns) // MOST_PIXELS)
        v = np.arange(0, rows, every)[:, None]
        centre = slope * v + intercept
        if 2 * half + 1 < columns:
            u = np.rint(np.clip(centre, -columns, 2 * columns)).astype(int) + np.arange(-half, half + 1)
        else:
            u = np.broadcast_to(np.arange(columns), (len(v), columns))
        distance = (u - centre) * cosine
        kept = (u >= 0) & (u < columns) & (np.abs(distance) <= reach)
        v, u, distance = np.broadcast_to(v, u.shape)[kept], u[kept], distance[kept]
        return cls(v, u, distance, image[v, u])

    @cached_property
    def room(self) -> float:
        """How far from the line there are pixels on both sides, but for the corners', pixels."""
        if not len(self.distance):
            return 0.0
        left, right = np.percentile(self.distance, [2, 98])
        return float(max(min(-left, right), 0))


@dataclass(frozen=True, eq=False)
class Sides:
    """Dark and bright beside an edge, and how the light falls off, fitted to what lies beyond its blur.

    The model is level · (1 + p y + q y²) + slope · d on either side, y along the edge from -1 to 1 and d across. Light
    that falls off slopes in proportion to the level. The wide feet of a blur slope alike on both sides: so the two
    are told apart.

    Args:
        strip:
        start: How far from the edge its sides begin, pixels.
    """

    strip: Strip
    start: float

    @cached_property
    def _y(self) -> Array:
        v = self.strip.v
        return (2 * v - v.max() - v.min()) / max(np.ptp(v), 1)

    @cached_property
    def _fit(self) -> tuple[Array, Array, float, tuple[float, float]]:
        """Dark, bright, p, q, two slopes two curvatures (8,), their covariance (8, 8), the noise of both and each.

        Curvatures are kept where the light's is beyond chance, for the levels are much less certain with them. Sides
        that are not deep enough for slopes or curvatures have levels only: so little does not tell them from ripples.
        """
        depth = (self.strip.room - self.start) / self.start
        if depth < DEEP_FOR_SLOPES:
            return self._fitted(4)
        if depth >= DEEP_FOR_CURVES:
            first = self._fitted(8)
            share = np.array([-1, 1]) / (first[0][1] - first[0][0])
            if self.known and abs(share @ first[0][6:]) > SIGNIFICANT * np.sqrt(share @ first[1][6:, 6:] @ share):
                return first
        return self._fitted(6)

    def _fitted(self, terms: int) -> tuple[Array, Array, float, tuple[float, float]]:
        d, light = self.strip.distance, self.strip.light
        beside = np.abs(d) >= self.start
        d, light, y = d[beside], light[beside], self._y[beside]
        bright = d > 0
        solved, covariance, noise = np.zeros(8), np.zeros((8, 8)), 0.0
        both = 0.0, 0.0
        if not self.known:
            return solved, covariance, noise, both
        levels = np.array([np.median(light[~bright]), np.median(light[bright])])
        kept = np.ones(len(d), bool)
        across = [one * d**power for power in (1, 2) for one in (~bright, bright)][: terms - 4]
        for _ in range(3):
            level = np.where(bright, levels[1], levels[0])
            columns = np.stack([~bright, bright, level * y, level * y**2, *across], axis=1)
            inverse = np.linalg.pinv(columns[kept].T @ columns[kept])
            solved[:terms] = inverse @ (columns[kept].T @ light[kept])
            off = np.abs(light - columns @ solved[:terms])
            both = 1.4826 * float(np.median(off[~bright])), 1.4826 * float(np.median(off[bright]))
            noise = float(np.hypot(*both) / np.sqrt(2))
            kept = off <= max(OUTLIER * np.sqrt(2) * noise, 1e-9 * np.ptp(light))
            if kept.sum() < len(kept) / 2:
                kept[:] = True
            covariance[:terms, :terms] = inverse * np.mean(off[kept] ** 2)
            levels = solved[:2].copy()
        return solved, covariance, noise, both

    @property
    def known(self) -> bool:
        """Whether enough pixels lie on either side."""
        d = self.strip.distance
        return bool(min(np.sum(d >= self.start), np.sum(d <= -self.start)) >= FEWEST_ON_A_SIDE)

    @property
    def noise(self) -> float:
        """The standard deviation of a pixel about the sides' light."""
        return self._fit[2]

    @property
    def noisier(self) -> float:
        """The standard deviation of a pixel on the noisier side."""
        return max(self._fit[3])

    @cached_property
    def levels(self) -> tuple[float, float]:
        """Dark and bright at the edge's middle."""
        return float(self._fit[0][0]), float(self._fit[0][1])

    @property
    def contrast(self) -> float:
        return self.levels[1] - self.levels[0]

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        """Slopes: of the light, a share per pixel; of the blur's feet, light per pixel (2,); their errors (2,)."""
        dark, bright = self.levels
        solved, covariance, _, _ = self._fit
        share = np.array([-1, 1]) / self.contrast
        feet = np.array([bright, -dark]) / self.contrast
        mixed = np.stack([share, feet])
        error = np.sqrt(np.diag(mixed @ covariance[4:6, 4:6] @ mixed.T))
        if (self.strip.room - self.start) / self.start < DEEP_FOR_SLOPES:  # whatever slope is there remains
            other, spread, _, _ = self._fitted(6)
            error = np.hypot(mixed @ other[4:6], np.sqrt(np.diag(mixed @ spread[4:6, 4:6] @ mixed.T)))
        return mixed @ solved[4:6], error

    @cached_property
    def falls(self) -> float:
        """The light's slope across the edge, as a share of it per pixel; 0 where it is within chance."""
        (slope, _), (error, _) = self._slopes
        return float(slope) if abs(slope) > SIGNIFICANT * error else 0.0

    @property
    def falls_error(self) -> float:
        """The standard error of that slope, a share per pixel."""
        return float(self._slopes[1][0])

    @cached_property
    def feet(self) -> float:
        """The slope that both sides share, contrasts per pixel: feet of the blur, or light added; 0 within chance."""
        (_, slope), (_, error) = self._slopes
        return float(slope / self.contrast) if abs(slope) > SIGNIFICANT * error else 0.0

    @cached_property
    def along(self) -> float:
        """By how much the light changes along the edge, as a share: largest less smallest."""
        y = np.linspace(-1, 1, 41)
        return float(np.ptp(self._fit[0][2] * y + self._fit[0][3] * y**2))

    @cached_property
    def profile(self) -> Array:
        """The strip's light (n,) with the light's slopes taken out: 0 on the dark side, 1 on the bright one."""
        solved = self._fit[0]
        d, curves = self.strip.distance, (solved[7] - solved[6]) / self.contrast
        share = 1 + solved[2] * self._y + solved[3] * self._y**2 + self.falls * d + curves * d**2
        return (self.strip.light / share - self.levels[0]) / self.contrast
