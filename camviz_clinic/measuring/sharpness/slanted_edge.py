"""A camera's modulation transfer function, measured from one straight edge (ISO 12233, annex D).

An edge that leans a few degrees against the rows of pixels is crossed by every row at another fraction of a pixel, so
that all rows together sample it many times as finely as one. Its derivative across is the line spread function, and
the size of that function's Fourier transform is the modulation transfer function (MTF): how much of a grating's
contrast reaches the picture, by the grating's frequency in cycles per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array
from camviz_clinic.measuring.sharpness.edge_error import EdgeError
from camviz_clinic.measuring.sharpness.edge_line import normal_angle, rough_edge
from camviz_clinic.measuring.sharpness.edge_profile import EdgeProfile
from camviz_clinic.measuring.sharpness.edge_refusal import LEAST_RISES, refuse_what_spoils
from camviz_clinic.measuring.sharpness.edge_rows import row_shifts, straight
from camviz_clinic.measuring.sharpness.edge_sides import Sides, Strip

OVERSAMPLING = 8  # strips a pixel
RISES = 2.5  # times the distance from 10 to 90 % of the edge: what counts as the edge, on either side
NARROWEST = 2.5  # pixels on either side
FLAT_SHARE = 0.7  # of what there is on either side
LEAST_SIDE = 3.0  # pixels: what is kept for the light of a side in a small image
SIDE = 24.0  # pixels beyond the edge, on which the light of either side is measured
LEAST_NOISE = 1e-4  # of the contrast: below, it is a number's rounding
PADDED = 4096  # samples of the Fourier transform: frequencies 1/1024 cycle a pixel apart


@dataclass(frozen=True, eq=False)
class SlantedEdge:
    """A camera's modulation transfer function (MTF), measured from one straight edge that leans against the pixels.

    The edge leans by 1 to 30 degrees against the columns, dark on its left; `of` turns other edges so, and refuses
    images without one. Every row crosses it at another fraction of a pixel, so that all rows together sample it finely.

    Args:
        image: (height, width), *Linear* light.
        clipped: (height, width) of bool, which pixels are at an end of the camera's scale, where the number no longer
            tells the light.

    Source: ISO 12233:2017, annex D.

    An edge of which square pixels take the mean has the MTF of a pixel, sin(π/4) / (π/4) = 0.90 at 1/4 cycle per pixel:

    >>> v, u = np.mgrid[:64, :64]
    >>> edge = SlantedEdge.of(np.clip(u - 32 - np.tan(np.radians(5)) * (v - 32) + 0.5, 0, 1))
    >>> round(edge.angle_deg, 1), edge.mtf(0.25).round(2)
    (5.0, np.float64(0.9))
    """

    image: Array
    clipped: Array | None = None

    @classmethod
    def of(cls, image: ArrayLike, clipped: ArrayLike | None = None) -> SlantedEdge:
        """The edge in an image, nearly vertical or nearly horizontal, dark first or bright first.

        Args:
            image: (height, width), *Linear* light in any unit.
            clipped: (height, width) of bool, which pixels are at an end of the camera's scale.

        Returns: Its image is turned so that the edge leans against the columns, dark on its left.
        Raises: ValueError in one sentence, where the image holds no edge that can be measured.
        """
        light = np.asarray(image, dtype=float)
        ends = None if clipped is None else np.asarray(clipped, dtype=bool)
        if light.ndim != 2 or not np.isfinite(light).all():
            raise ValueError(f"image must be (height, width) of finite numbers, got shape {light.shape}")
        if ends is not None and ends.shape != light.shape:
            raise ValueError(f"clipped must have the image's shape {light.shape}, got {ends.shape}")
        if abs(normal_angle(light)) > np.pi / 4:
            light, ends = light.T, None if ends is None else ends.T
        if light[:, -1:].mean() + light[:, -3:].mean() < light[:, :1].mean() + light[:, :3].mean():
            light, ends = light[:, ::-1], None if ends is None else ends[:, ::-1]
        found = cls(light, ends)
        refuse_what_spoils(found)
        return found

    # Where the edge is -----------------------------------------------------------------------------------------------

    @cached_property
    def _located(self) -> tuple[tuple[float, float], float]:
        """The line, and the rise of the blurred step that fits roughly.

        From the rough line, each row is moved to where it fits the profile of all rows best.
        """
        slope, intercept, spread = rough_edge(self.image)
        rise = 2.5631 * spread
        for _ in range(4):
            if not np.isfinite(slope):
                break
            sides = self._sides_of((slope, intercept), rise)
            if not sides.known or not sides.contrast > 0:
                break
            rows, moved, errors = row_shifts(sides, rise)
            line = straight(rows, moved, errors)
            if line is None:
                break
            slope, intercept = (
                slope + line[0] / np.cos(np.arctan(slope)),
                intercept + line[1] / np.cos(np.arctan(slope)),
            )
            if max(abs(line[0]) * len(self.image), abs(line[1])) < 1e-4:
                break
        return (float(slope), float(intercept)), float(rise)

    def _sides_of(self, line: tuple[float, float], rise: float) -> Sides:
        """The sides of a line: beyond the edge's blur, or where the image is too small for that, at its border."""
        flat = max(RISES * rise, NARROWEST)
        strip = Strip.of(self.image, line, 2 * flat + SIDE)
        return Sides(strip, max(min(flat, strip.room - LEAST_SIDE), LEAST_RISES * rise, 1.0))

    @property
    def line(self) -> tuple[float, float]:
        """Slope and intercept of the edge, u = slope · v + intercept."""
        return self._located[0]

    @cached_property
    def sides(self) -> Sides:
        """What lies beside the edge."""
        return self._sides_of(*self._located)

    @property
    def contrast(self) -> float:
        """The bright side less the dark side."""
        return self.sides.contrast

    @property
    def noise(self) -> float:
        """The standard deviation of a pixel on the two sides."""
        return self.sides.noise

    @cached_property
    def clipped_shares(self) -> tuple[float, float]:
        """The shares of the pixels on the dark and the bright side that are at an end of the camera's scale.

        Of those that count as the edge's. Where it is not known which pixels are clipped, those are taken for it that
        share the least or the greatest light though the next light is nearer than the noise.
        """
        strip = self.sides.strip
        near, bright = np.abs(strip.distance) <= 2 * self.flat, strip.distance > 0
        if self.clipped is not None:
            ends = self.clipped[strip.v, strip.u]
            return float(ends[near & ~bright].mean()), float(ends[near & bright].mean())
        shares, noise = [], self.sides.noisier
        for light in (-strip.light[near & ~bright], strip.light[near & bright]):
            most = light.max()
            next_below = light[light < most].max(initial=-np.inf)
            finer = most - next_below < noise / 2 and noise > LEAST_NOISE * self.contrast
            shares.append(float(np.mean(light == most)) if finer else 0.0)
        return shares[0], shares[1]

    @property
    def angle_deg(self) -> float:
        """How far the edge leans against the columns, degrees."""
        return float(np.degrees(np.arctan(self.line[0])))

    # Across the edge -------------------------------------------------------------------------------------------------

    @cached_property
    def distance(self) -> Array:
        """How far each pixel's centre (height, width) is from the edge, in pixels along its normal."""
        slope, intercept = self.line
        v, u = np.indices(self.image.shape)
        return np.asarray((u - slope * v - intercept) * np.cos(np.arctan(slope)))

    @cached_property
    def profile(self) -> EdgeProfile:
        """The edge's profile, from 0 to 1: a smooth curve with knots at every eighth of a pixel."""
        strip, light, kept = self.sides.strip, self.sides.profile, self.kept
        return EdgeProfile(
            strip.distance[kept], light[kept], self._reach, 1 / OVERSAMPLING, self._blocks(strip.v[kept])
        )

    @property
    def _reach(self) -> float:
        return float(np.floor(np.abs(self.sides.strip.distance).max() * OVERSAMPLING) / OVERSAMPLING)

    @cached_property
    def kept(self) -> Array:
        """Which pixels (n,) of the strip the profile is made of."""
        return np.asarray(np.abs(self.sides.strip.distance) <= self._reach)

    @cached_property
    def rows(self) -> tuple[Array, Array, Array]:
        """The rows (n,) whose edge lies within the image, how far (n,) off the line, and the error (n,) of that."""
        return row_shifts(self.sides, self._located[1])

    def _blocks(self, v: Array) -> Array:
        """The number of the piece of the edge that a row belongs to: pieces of 8 rows or more, at most 16."""
        first, last = int(v.min()), int(v.max())
        pieces = int(np.clip((last - first + 1) // 8, 4, 16))
        return (v - first) * pieces // (last - first + 1)

    @cached_property
    def binned(self) -> tuple[Array, Array, Array]:
        """Strips along the edge: places (n,) of their middles in pixels, their pixels' number and mean light (n,)."""
        dark, _ = self.sides.levels
        return self.profile.places, self.profile.counts, dark + self.contrast * self.profile.means

    @property
    def edge_spread(self) -> tuple[Array, Array]:
        """The edge's profile: places (n,) in pixels from it, and values (n,) from 0 to 1."""
        return self.profile.places, self.profile.means

    @cached_property
    def rise(self) -> float:
        """The distance in pixels over which the edge rises from 10 to 90 %."""
        places, values = self.edge_spread
        near = np.abs(places) < max(RISES * self._located[1], NARROWEST)
        x, y = places[near], np.maximum.accumulate(values[near])
        return float(np.interp(0.9, y, x) - np.interp(0.1, y, x))

    @cached_property
    def line_spread(self) -> tuple[Array, Array]:
        """The derivative of the profile: places (n,) in pixels, and the light (n,) per pixel, faded out far away."""
        places, values = self.edge_spread
        x, change = (places[:-1] + places[1:]) / 2, np.diff(values) * OVERSAMPLING
        return x, change * self.fade(x)

    @cached_property
    def flat(self) -> float:
        """How far from the line all light counts as the edge's, pixels; less than usual in a small image."""
        return min(max(RISES * self.rise, NARROWEST), FLAT_SHARE * self.sides.strip.room)

    def fade(self, x: Array) -> Array:
        """What counts as the edge: 1 near it, falling to 0 far away (a Tukey window).

        Args:
            x: (n,), places, in pixels from the edge.

        Returns: (n,), weights, 0 to 1.
        """
        end = min(2 * self.flat, self.sides.strip.room)
        fade = np.clip((end - np.abs(x)) / (end - self.flat), 0, 1)
        return np.asarray(0.5 * (1 - np.cos(np.pi * fade)))

    # What is left of a grating ---------------------------------------------------------------------------------------

    @cached_property
    def curve(self) -> tuple[Array, Array]:
        """Frequencies (n,) in cycles per pixel, 0 to 1, and the MTF (n,) there; 1 at frequency 0.

        Averaging over a bin and taking differences of bins both dim a grating by sinc(f / OVERSAMPLING).
        That is taken out.
        """
        _, light = self.line_spread
        spectrum = np.abs(np.fft.rfft(light, PADDED))
        frequency = np.fft.rfftfreq(PADDED, 1 / OVERSAMPLING)
        kept = frequency <= 1
        dimmed = np.sinc(frequency[kept] / OVERSAMPLING) ** 2
        return frequency[kept].astype(np.float64), (spectrum[kept] / spectrum[0] / dimmed).astype(np.float64)

    def mtf(self, frequency: ArrayLike) -> Array:
        """What is left of gratings: the MTF.

        Args:
            frequency: (...), in cycles per pixel, 0 to 1.

        Returns: (...), shares of contrast, 1 at frequency 0.
        """
        return np.interp(np.asarray(frequency, dtype=float), *self.curve)

    def frequency_at(self, modulation: float) -> float:
        """The lowest frequency at which the MTF falls to a value.

        Args:
            modulation: The share of contrast that is left.

        Returns: In cycles per pixel; NaN where it never does.
        """
        frequency, values = self.curve
        below = np.flatnonzero(values < modulation)
        if not len(below) or below[0] == 0:
            return float("nan")
        after = below[0]
        return float(np.interp(-modulation, -values[after - 1 : after + 1], frequency[after - 1 : after + 1]))

    @property
    def mtf50(self) -> float:
        """MTF50, cycles per pixel: where half of a grating's contrast is left."""
        return self.frequency_at(0.5)

    # How far chance may have moved it --------------------------------------------------------------------------------

    @cached_property
    def residual_noise(self) -> Array:
        """The standard deviation (n,) of a pixel about the profile, strip by strip, from pixels within a pixel of it.

        Dark and bright pixels differ in noise, and so each part of the profile has its own.
        """
        profile = self.profile
        at = np.clip(((profile.distance + profile.reach) / profile.step).astype(int), 0, profile.intervals - 1)
        squares = np.bincount(at, profile.residual**2, profile.intervals)
        near = np.ones(2 * OVERSAMPLING + 1)
        freedom = np.convolve(np.maximum(profile.counts - 0.9, 0), near, "same")  # the curve takes one a strip
        return self.contrast * np.sqrt(np.convolve(squares, near, "same") / np.maximum(freedom, 1))

    def log_mtf(self, frequency: float, means: Array) -> float:
        """ln MTF of another profile across this edge.

        Args:
            frequency: In cycles per pixel.
            means: (n,), shares of the contrast, 0 to 1, at the places of `edge_spread`.

        Returns: Natural logarithm; 0 where all contrast is left.
        """
        x, _ = self.line_spread
        light = np.diff(means) * OVERSAMPLING * self.fade(x)
        return float(np.log(np.abs(np.sum(light * np.exp(-2j * np.pi * frequency * x))) / np.abs(np.sum(light))))

    def spread_weights(self, wave: Array) -> Array:
        """How much Σ wave · line spread changes with each strip's mean.

        Args:
            wave: (n - 1,), weights without a unit at the places of `line_spread`.

        Returns: (n,), per unit of each mean of `edge_spread`.
        """
        faded = OVERSAMPLING * self.fade(self.line_spread[0]) * wave
        return -np.diff(faded, prepend=0, append=0)

    @cached_property
    def error(self) -> EdgeError:
        """What may move ln MTF at MTF50."""
        return EdgeError(self, self.mtf50)

    @cached_property
    def mtf50_error(self) -> float:
        """The standard error of MTF50, cycles per pixel; NaN where there is no MTF50.

        That of ln MTF over the slope of ln MTF.
        """
        f = self.mtf50
        if not np.isfinite(f):
            return float("nan")
        step = 2 / PADDED * OVERSAMPLING
        slope = (self.mtf(f + step) - self.mtf(f - step)) / (2 * step) / 0.5
        return float(self.error.total / abs(slope))
