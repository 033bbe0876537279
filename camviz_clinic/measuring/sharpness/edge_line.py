"""Where the straight edge in an image is: a line, a spread and two levels, fitted to all pixels at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter
from scipy.optimize import least_squares
from scipy.special import ndtr

from camviz.lenses.base import Array

SMOOTHED = 1.5  # pixels: before gradients are taken
MOST_FITTED = 30_000  # pixels; of larger images every n-th row and column is fitted


def normal_angle(image: ArrayLike) -> float:
    """Across which direction the light of an image changes most, in radians from its rows, -π/2 to π/2.

    The main axis of the gradients' second moments.

    Args:
        image: (height, width), light.

    Returns: 0 where it changes along the rows: an upright edge.
    Source: J. Bigün and G. H. Granlund, Optimal orientation detection of linear symmetry, ICCV 1987.

    >>> v, u = np.mgrid[:40, :40]
    >>> round(np.degrees(normal_angle(u > 20 + 0.5 * (v - 20))))
    -26
    """
    light = gaussian_filter(np.asarray(image, dtype=float), SMOOTHED)
    across = light[1:-1, 2:] - light[1:-1, :-2]
    down = light[2:, 1:-1] - light[:-2, 1:-1]
    return float(0.5 * np.arctan2(2 * np.sum(across * down), np.sum(across**2) - np.sum(down**2)))


def rough_edge(image: ArrayLike) -> tuple[float, float, float]:
    """The nearly upright edge in an image, as the blurred step that fits all its pixels best.

    Args:
        image: (height, width), light, dark on the left.

    Returns:
        slope, intercept: Of the edge, u = slope · v + intercept.
        spread: The standard deviation of its blur across, in pixels.

    >>> v, u = np.mgrid[:40, :40]
    >>> slope, intercept, _ = rough_edge(np.clip(u - 20.2 - 0.1 * v, 0, 1))
    >>> round(slope, 2), round(intercept, 1)
    (0.1, 20.7)
    """
    light = np.asarray(image, dtype=float)
    rows, columns = light.shape
    every = int(np.ceil(np.sqrt(light.size / MOST_FITTED)))
    v, u = (one.ravel().astype(float) for one in np.mgrid[:rows:every, :columns:every])
    values = light[::every, ::every].ravel()
    low, high = np.percentile(values, [5, 95])
    if not high > low:
        return float("nan"), float("nan"), float("nan")
    values = (values - low) / (high - low)
    middle = (rows - 1) / 2
    slope = -np.tan(np.clip(normal_angle(light), -1.2, 1.2))
    change = np.abs(np.diff(gaussian_filter(light, SMOOTHED), axis=1))
    change[change < np.percentile(change, 90)] = 0
    place = np.sum(change * (np.arange(columns - 1) + 0.5 - slope * (np.arange(rows)[:, None] - middle)))

    def parts(p: Array) -> tuple[Array, Array, Array]:
        cosine = 1 / np.hypot(1, p[0])
        d = (u - p[0] * (v - middle) - p[1]) * cosine
        return d, np.full_like(d, cosine), np.exp(p[2])

    def off(p: Array) -> Array:
        d, _, spread = parts(p)
        return p[3] + p[4] * ndtr(d / spread) - values

    def slopes(p: Array) -> Array:
        d, cosine, spread = parts(p)
        bell = p[4] * np.exp(-((d / spread) ** 2) / 2) / np.sqrt(2 * np.pi) / spread
        along = -(v - middle) * cosine - d * p[0] * cosine**2
        return np.stack([bell * along, -bell * cosine, -bell * d, np.ones_like(d), ndtr(d / spread)], axis=1)

    start = np.array([slope, place / max(change.sum(), 1e-300), np.log(max(2.0, 0.02 * columns)), 0.0, 1.0])
    p = least_squares(off, start, slopes, loss="soft_l1", f_scale=0.2, max_nfev=40, ftol=1e-6, xtol=1e-6).x
    return float(p[0]), float(p[1] - p[0] * middle), float(np.exp(np.clip(p[2], -2, 10)))
