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

OVERSAMPLING = 8  # bins a pixel; the standard has 4, with which a sharp edge at 3° comes out 2 % too blurred
LEAST_ANGLE_DEG, MOST_ANGLE_DEG = 1.0, 30.0  # outside, phases repeat too early or rows blur the edge
FEWEST_ROWS = 16
LEAST_CONTRAST = 10.0  # times the noise: below, the edge cannot be found in each row
RISES = 2.5  # times the distance from 10 to 90 % of the edge: what counts as the edge, on either side
NARROWEST = 2.5  # pixels on either side
PADDED = 4096  # samples of the Fourier transform: frequencies 1/1024 cycle a pixel apart


@dataclass(frozen=True, eq=False)
class SlantedEdge:
    """A camera's modulation transfer function (MTF), measured from one straight edge that leans against the pixels.

    The edge leans by 1 to 30 degrees against the columns, dark on its left; `of` turns other edges so, and refuses
    images without one. Every row crosses it at another fraction of a pixel, so that all rows together sample it finely.

    Parameters
    ----------
    image : array (height, width)
        *Linear* light.

    References
    ----------
    ISO 12233:2017, annex D.

    Examples
    --------
    An edge of which square pixels take the mean has the MTF of a pixel, sin(π/4) / (π/4) = 0.90 at 1/4 cycle per pixel:

    >>> v, u = np.mgrid[:64, :64]
    >>> edge = SlantedEdge.of(np.clip(u - 32 - np.tan(np.radians(5)) * (v - 32) + 0.5, 0, 1))
    >>> round(edge.angle_deg, 1), edge.mtf(0.25).round(2)
    (5.0, np.float64(0.9))
    """

    image: Array

    @classmethod
    def of(cls, image: ArrayLike) -> SlantedEdge:
        """The edge in an image, nearly vertical or nearly horizontal, dark first or bright first.

        Parameters
        ----------
        image : array_like (height, width)
            *Linear* light in any unit.

        Returns
        -------
        SlantedEdge
            Its image is turned so that the edge leans against the columns, dark on its left.

        Raises
        ------
        ValueError
            In one sentence, where the image holds no edge that can be measured.
        """
        light = np.asarray(image, dtype=float)
        if light.ndim != 2 or not np.isfinite(light).all():
            raise ValueError(f"image must be (height, width) of finite numbers, got shape {light.shape}")
        across, down = (float(np.abs(np.diff(light.mean(axis=axis))).sum()) for axis in (0, 1))
        if down > across:
            light = light.T
        columns = light.mean(axis=0)
        quarter = -(-len(columns) // 4)
        if columns[-quarter:].mean() < columns[:quarter].mean():
            light = light[:, ::-1]
        found = cls(light)
        found.refuse_what_cannot_be_measured()
        return found

    def refuse_what_cannot_be_measured(self) -> None:
        """Say what is wrong with an edge that is too small, has no contrast, or leans too little or too much.

        Raises
        ------
        ValueError
            In one sentence.
        """
        rows, columns = self.image.shape
        if rows < FEWEST_ROWS or columns < FEWEST_ROWS:
            raise ValueError(f"image must be at least {FEWEST_ROWS} × {FEWEST_ROWS} pixels, got {columns} × {rows}")
        if not self.contrast > LEAST_CONTRAST * self.noise:
            raise ValueError("image holds no edge: one side is hardly brighter than the other")
        if not LEAST_ANGLE_DEG <= abs(self.angle_deg) <= MOST_ANGLE_DEG:
            raise ValueError(
                f"the edge leans by {abs(self.angle_deg):.1f}°: expected {LEAST_ANGLE_DEG:g}° to {MOST_ANGLE_DEG:g}° "
                "against the pixels' columns or rows (about 5° is best)"
            )
        if abs(self.line[0]) * (rows - 1) < 1:
            raise ValueError(
                f"the edge crosses less than one pixel within {rows} rows: take more of it, or lean it more"
            )

    # Where the edge is -----------------------------------------------------------------------------------------------

    @cached_property
    def contrast(self) -> float:
        """The bright side less the dark side."""
        quarter = self.image.shape[1] // 6
        return float(np.median(self.image[:, -quarter:]) - np.median(self.image[:, :quarter]))

    @cached_property
    def noise(self) -> float:
        """The standard deviation of a pixel, from differences of neighbours down the two sides."""
        sixth = self.image.shape[1] // 6
        steps = np.diff(np.concatenate([self.image[:, :sixth], self.image[:, -sixth:]], axis=1), axis=0)
        return float(np.median(np.abs(steps)) * 1.4826 / np.sqrt(2))

    @cached_property
    def line(self) -> tuple[float, float]:
        """Slope and intercept of the edge, u = slope · v + intercept, from where each row has its centre of change."""
        rows, columns = self.image.shape
        change = np.gradient(self.image, axis=1)
        v, u = np.arange(rows), np.arange(columns)
        smooth = change.mean(axis=0)
        middle, half = np.full(rows, float(np.argmax(smooth))), columns / 2
        for width in (half, half / 2, half / 4, half / 4):
            reach = max(width, 3 * NARROWEST)
            weight = np.clip(np.cos(np.pi / 2 * (u - middle[:, None]) / reach), 0, None) * (
                abs(u - middle[:, None]) < reach
            )
            centre = np.sum(change * weight * u, axis=1) / np.sum(change * weight, axis=1)
            good = np.isfinite(centre) & (abs(centre - middle) < reach)
            if good.sum() < 2:
                return np.nan, np.nan
            slope, intercept = np.polyfit(v[good], centre[good], 1)
            middle = slope * v + intercept
        return float(slope), float(intercept)

    @cached_property
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
    def binned(self) -> tuple[Array, Array, Array]:
        """Bins along the normal: places (n,) of their middles in pixels, their pixels' number and mean value (n,)."""
        reach = np.floor(np.abs(self.distance).max() * OVERSAMPLING) / OVERSAMPLING
        borders = np.arange(-reach, reach + 0.5 / OVERSAMPLING, 1 / OVERSAMPLING)
        counts, _ = np.histogram(self.distance, borders)
        sums, _ = np.histogram(self.distance, borders, weights=self.image)
        places = (borders[:-1] + borders[1:]) / 2
        where, _ = np.histogram(self.distance, borders, weights=self.distance)
        some = counts > 0  # a bin's pixels lie somewhat beside its middle
        means = np.interp(places, where[some] / counts[some], sums[some] / counts[some])
        return places, counts.astype(np.float64), means

    @cached_property
    def edge_spread(self) -> tuple[Array, Array]:
        """The edge's profile: places (n,) in pixels from it, and values (n,) from 0 to 1."""
        places, _, means = self.binned
        dark = np.median(self.image[:, : self.image.shape[1] // 6])
        return places, (means - dark) / self.contrast

    @cached_property
    def rise(self) -> float:
        """The distance in pixels over which the edge rises from 10 to 90 %."""
        places, values = self.edge_spread
        near = np.abs(places) < self.image.shape[1] / 3
        x, y = places[near], np.maximum.accumulate(values[near])
        return float(np.interp(0.9, y, x) - np.interp(0.1, y, x))

    @cached_property
    def line_spread(self) -> tuple[Array, Array]:
        """The derivative of the profile: places (n,) in pixels, and the light (n,) per pixel, faded out far away."""
        places, values = self.edge_spread
        x, change = (places[:-1] + places[1:]) / 2, np.diff(values) * OVERSAMPLING
        return x, change * self._fade(x)

    def _fade(self, x: Array) -> Array:
        """What counts as the edge: 1 near it, falling to 0 far away (a Tukey window), at places (n,) in pixels."""
        flat = max(RISES * self.rise, NARROWEST)
        fade = np.clip((2 * flat - np.abs(x)) / flat, 0, 1)
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

        Parameters
        ----------
        frequency : array_like (...)
            In cycles per pixel, 0 to 1.

        Returns
        -------
        array (...)
            Shares of contrast, 1 at frequency 0.
        """
        return np.interp(np.asarray(frequency, dtype=float), *self.curve)

    def frequency_at(self, modulation: float) -> float:
        """The lowest frequency at which the MTF falls to a value.

        Parameters
        ----------
        modulation : float
            The share of contrast that is left.

        Returns
        -------
        float
            In cycles per pixel; NaN where it never does.
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
        """The standard deviation (n,) of a pixel about the profile, bin by bin, from the pixels within a pixel of it.

        Dark and bright pixels differ in noise, and so each part of the profile has its own.
        """
        places, counts, means = self.binned
        residual = self.image - np.interp(self.distance, places, means)
        inside = np.clip(np.searchsorted(places, self.distance.ravel()), 0, len(places) - 1)
        squares = np.bincount(inside, residual.ravel() ** 2, len(places))
        near = np.ones(2 * OVERSAMPLING + 1)
        freedom = np.convolve(np.maximum(counts - 2 / 3, 0), near, "same")  # a line between two means takes 2/3
        return np.sqrt(np.convolve(squares, near, "same") / np.maximum(freedom, 1))

    @cached_property
    def mtf50_error(self) -> float:
        """The standard error of MTF50, cycles per pixel, that the pixels' noise leaves; NaN where there is no MTF50.

        To first order. The transform S(f) = Σ_j m_j s_j(f) is linear in the bins' means m_j, of variance σ_j²/n_j.
        So ln MTF changes by Re(s_j(f) / S(f)) - s_j(0) / S(0) with m_j, and MTF50 by that over the slope of ln MTF.
        Noise is taken to be independent from pixel to pixel, which demosaicing and sharpening make untrue.
        """
        f = self.mtf50
        if not np.isfinite(f):
            return float("nan")
        x, light = self.line_spread
        wave = np.exp(-2j * np.pi * f * x)
        change = self._weights(wave) / np.sum(light * wave) - self._weights(np.ones_like(x)) / np.sum(light)
        _, counts, _ = self.binned
        variance = np.sum(change.real**2 * self.residual_noise**2 / np.maximum(counts, 1)) / self.contrast**2
        step = 2 / PADDED * OVERSAMPLING
        slope = (self.mtf(f + step) - self.mtf(f - step)) / (2 * step) / 0.5
        return float(np.sqrt(variance) / abs(slope))

    def _weights(self, wave: Array) -> Array:
        """How much the transform changes with each bin's mean (n,), the wave given between bins (n - 1,)."""
        faded = OVERSAMPLING * self._fade(self.line_spread[0]) * wave
        return -np.diff(faded, prepend=0, append=0)
