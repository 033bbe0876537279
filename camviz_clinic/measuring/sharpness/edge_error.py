"""How far MTF50 of an edge may be off, and what spoils it: noise, bends, light, missing phases, clipping."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import chdtri

from camviz.lenses.base import Array

PROCESSED = 1.3  # times the sides' noise: more scatter than that near the edge is no noise of the sensor's
SHARE_OF_PROCESSED = 0.2  # of a row's scatter, that all rows have alike: found on JPEGs
UNLIKELY = 0.1  # the chance at which pieces of a clean edge count as differing
FLOOR = 3e-5  # of ln MTF: 31 blurred edges of 16 bits without noise were 1.4e-5 of MTF50 off, and at most 3.6e-5
NEAREST_NUMBERS = 5  # of a side's level: the widest gap between these is the step of the picture's numbers there


@dataclass(frozen=True, eq=False)
class EdgeError:
    """The parts of the standard error of ln MTF at one frequency, and what they are from.

    Args:
        edge: SlantedEdge.
        frequency: Cycles per pixel.
    """

    edge: Any  # a SlantedEdge, whose module imports this one
    frequency: float

    # Noise -----------------------------------------------------------------------------------------------------------

    @cached_property
    def _weights(self) -> Array:
        """How much ln MTF changes with the mean of each strip (n,).

        The transform S(f) = Σ_j m_j s_j(f) is linear in the strips' means, so ln MTF changes with m_j by
        Re(s_j(f) / S(f)) - s_j(0) / S(0).
        """
        x, light = self.edge.line_spread
        wave = np.exp(-2j * np.pi * self.frequency * x)
        change = self.edge.spread_weights(wave) / np.sum(light * wave)
        return np.asarray((change - self.edge.spread_weights(np.ones_like(x)) / np.sum(light)).real)

    @cached_property
    def influence(self) -> Array:
        """How much ln MTF changes with the normalised light of each pixel (n,) of the profile."""
        return self.edge.profile.influence(self._weights)

    @cached_property
    def independent(self) -> float:
        """The standard deviation that noise leaves, were it independent from pixel to pixel."""
        return float(np.sqrt(np.sum((self.influence * self._pixel_noise) ** 2)))

    @cached_property
    def _pixel_noise(self) -> Array:
        profile = self.edge.profile
        at = np.clip(((profile.distance + profile.reach) / profile.step).astype(int), 0, profile.intervals - 1)
        return self.edge.residual_noise[at] / self.edge.contrast

    @cached_property
    def shared(self) -> float:
        """By how much noise that neighbours share widens the standard deviation: a factor.

        From the residuals' correlation at up to 8 pixels apart, with the weights that the pixels have.
        """
        edge, profile = self.edge, self.edge.profile
        if not np.isfinite(self.frequency):
            return float("nan")
        weight = self.influence * self._pixel_noise
        if not np.any(weight):
            return 1.0
        strip = edge.sides.strip
        v, u = strip.v[edge.kept], strip.u[edge.kept]
        near = np.abs(profile.distance) <= edge.flat
        row = np.searchsorted(np.unique(v[near]), v[near])
        column = u[near] - u[near].min()
        grid = np.zeros((2, row.max() + 1, column.max() + 1))
        grid[0, row, column] = weight[near]
        noise = self._pixel_noise[near]
        grid[1, row, column] = np.divide(profile.residual[near], noise, where=noise > 0, out=np.zeros_like(noise))
        size = [n + 2 * 8 for n in grid.shape[1:]]
        both = np.fft.irfft2(np.abs(np.fft.rfft2(grid, size)) ** 2, size)
        lags = np.r_[0:9, -8:0]
        of_weight, of_noise = both[:, lags][:, :, lags]
        variance = float(np.sum(of_weight * of_noise) / of_noise[0, 0] / of_weight[0, 0]) if of_noise[0, 0] > 0 else 1.0
        return float(np.sqrt(max(variance, 1.0)))

    @cached_property
    def pieces(self) -> tuple[Array, float]:
        """ln MTF without each piece of the edge in turn (n,), and the standard deviation that follows: the jackknife.

        Source: B. Efron, The jackknife, the bootstrap and other resampling plans, SIAM (1982), chapter 3.
        """
        profile = self.edge.profile
        without = np.array([self.edge.log_mtf(self.frequency, profile.without(b)) for b in np.unique(profile.block)])
        n = len(without)
        return without, float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))

    @cached_property
    def scatter(self) -> tuple[float, float]:
        """The scatter of pixels about the profile, in contrasts: on the sides, and near the edge in most rows."""
        profile, sides = self.edge.profile, self.edge.sides
        near = np.abs(profile.distance) <= max(self.edge.rise, 1.5)
        v = sides.strip.v[self.edge.kept][near]
        number = np.bincount(v)
        squares = np.bincount(v, profile.residual[near] ** 2)[number > 0] / number[number > 0]
        pixels = float(np.median(number[number > 0]))
        of_median = (1 - 2 / (9 * pixels)) ** 3  # of a mean of so many squares
        return sides.noisier / self.edge.contrast, float(np.sqrt(np.median(squares) / of_median))

    @cached_property
    def processed(self) -> float:
        """By how much a row's ln MTF scatters beyond the sides' noise, as where JPEG has changed edges alone."""
        near = self.scatter[1]
        return float(self.independent * np.sqrt(len(self.edge.rows[0])) * self.unexplained / near) if near else 0.0

    @cached_property
    def unexplained(self) -> float:
        """The scatter near the edge that the sides' noise does not explain, in contrasts; 0 where it may be chance."""
        beside, near = self.scatter
        return float(np.sqrt(near**2 - beside**2)) if near > PROCESSED * beside else 0.0

    # What is no noise ------------------------------------------------------------------------------------------------

    @cached_property
    def off_the_line(self) -> float:
        """How far the rows' edges lie off the line beyond what noise explains, root mean square, pixels."""
        _, shifts, errors = self.edge.rows
        return float(np.sqrt(max(float(np.mean(shifts**2) - np.mean(errors**2)), 0)))

    @cached_property
    def scatter_off_the_line(self) -> float:
        """The scatter near the edge that rows off the line make: their deviation times the profile's slope there."""
        profile = self.edge.profile
        near = np.abs(profile.distance) <= max(self.edge.rise, 1.5)
        return float(self.off_the_line * np.sqrt(np.mean(profile.slope[near] ** 2)))

    @cached_property
    def bend(self) -> float:
        """By how much rows off the line lower ln MTF: they blur the edge like a Gaussian of that deviation."""
        return 2 * (np.pi * self.frequency * self.off_the_line) ** 2

    @cached_property
    def gap(self) -> float:
        """The widest distance across the middle of the edge at which no pixel lies, pixels."""
        d = self.edge.profile.distance
        near = np.sort(d[np.abs(d) <= max(self.edge.rise / 2, 1.0)])
        return float(np.max(np.diff(near)))

    @cached_property
    def alias(self) -> float:
        """By how much frequencies that such gaps confuse with this one may change ln MTF.

        Samples `gap` apart take 1 / gap - f for f. There the pixel leaves 1 / (π f cos θ) at most, and the lens no
        more than at f.
        """
        f, other = self.frequency, 1 / self.gap - self.frequency
        if other <= f:
            return float("inf")
        angle = np.radians(self.edge.angle_deg)
        lens = min(0.5 / abs(float(np.sinc(f * np.cos(angle)) * np.sinc(f * np.sin(angle)))), 1)
        there = min(1 / (np.pi * other * np.cos(angle)), 1.0)
        return lens * there * f / other / 0.5

    @cached_property
    def rounding(self) -> float:
        """By how much ln MTF may change because pixels hold whole numbers only: both sides' parts together.

        All pixels of an even side without noise are rounded by the same share of a step, which no mean takes out; on
        the edge's slope roundings differ and cancel. An 8-bit step is 1 % of bright light, and moves MTF50 by 1 %.
        """
        edge, means = self.edge, self.edge.profile.means
        parts = []
        for level, bright in zip(edge.sides.levels, (False, True), strict=True):
            step, shared = self._rounded(level, bright)
            beside = edge.profile.places > 0 if bright else edge.profile.places < 0
            even = beside & (np.abs(means - bright) < step / 2)
            parts.append(shared * np.sum(self._weights[even]))
        return float(np.hypot(*parts))

    def _rounded(self, level: float, bright: bool) -> tuple[float, float]:
        """The step of numbers on a side, and the deviation of the rounding its pixels share, in contrasts.

        Uniform over a step; noise of deviation σ leaves exp(-2 π² σ²) of it, σ in steps: the first term of Fourier's
        series for the mean of rounded numbers. The pixels' own deviation has the rounding's 1/12 in it.

        Source: B. Widrow and I. Kollár, Quantization Noise, Cambridge University Press (2008), chapters 4 and 9.
        """
        strip, edge = self.edge.sides.strip, self.edge
        near = (np.abs(strip.distance) > edge.rise) & (np.abs(strip.distance) < 2 * edge.flat)
        light = strip.light[near & ((strip.distance > 0) == bright)]
        numbers = np.unique(strip.light)
        numbers = np.sort(numbers[np.argsort(np.abs(numbers - level))[:NEAREST_NUMBERS]])
        step = float(np.max(np.diff(numbers), initial=0.0))
        if not step or not len(light):
            return 0.0, 0.0
        noise = max(float(np.var(light)) / step**2 - 1 / 12, 0.0)
        return step / edge.contrast, float(step / edge.contrast / np.sqrt(12) * np.exp(-2 * np.pi**2 * noise))

    @cached_property
    def light(self) -> float:
        """By how much slopes of light may change ln MTF: what chance leaves of falling light, and half of the feet."""
        edge, (x, _) = self.edge, self.edge.line_spread
        profile = np.interp(x, *edge.edge_spread)
        level = profile + edge.sides.levels[0] / edge.contrast
        return float(
            np.hypot(
                self._pedestal(level) * edge.sides.falls_error, self._pedestal(np.ones_like(x)) * edge.sides.feet / 2
            )
        )

    def _pedestal(self, added: Array) -> float:
        """How much ln MTF changes with light added to the line spread (n - 1,)."""
        x, light = self.edge.line_spread
        wave, added = np.exp(-2j * np.pi * self.frequency * x), added * self.edge.fade(x)
        return float((np.sum(added * wave) / np.sum(light * wave)).real - np.sum(added) / np.sum(light))

    @cached_property
    def total(self) -> float:
        """The standard error of ln MTF, all parts together."""
        noise = self.independent * self.shared
        n = len(self.pieces[0])
        if self.pieces[1] > noise * np.sqrt(float(chdtri(n - 1, UNLIKELY)) / (n - 1)):
            noise = self.pieces[1]
        others = self.bend / 2, self.alias / 2, self.light, SHARE_OF_PROCESSED * self.processed, self.rounding, FLOOR
        return float(np.sqrt(noise**2 + np.sum(np.square(others))))
