"""From what a sensor counted to the colours of a picture: responses, white balance, the 3×3 matrix, and metamers.

Everything acts on linear data. Gains (3,) multiply the channels, green's gain being 1. A matrix acts on columns,
xyz = M rgb; for arrays (..., 3) that is `rgb @ M.T`. (`cv2.ccm` writes rgb @ C: its C is this M transposed.)
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from camviz.colour.spaces import D65_XY, adaptation, from_chromaticity, tristimulus
from camviz.colour.spectra import WAVELENGTHS_NM
from camviz.lenses.base import Array

WHITE = from_chromaticity(D65_XY)
WHITE.flags.writeable = False
_STEP_NM = WAVELENGTHS_NM[1] - WAVELENGTHS_NM[0]


def response(light: ArrayLike, reflectance: ArrayLike, sensitivity: ArrayLike) -> Array:
    """What the channels of a sensor (81, c) make of surfaces (..., 81) in a light (81,): (..., c).

    Σ light · reflectance · sensitivity · Δλ, the sum that stands for the integral over wavelength. Linear, and in units
    of the light's: divide by the response to a perfect white, reflectance 1, to have shares of it.
    """
    reaching = np.asarray(light, dtype=float) * np.asarray(reflectance, dtype=float)
    return reaching @ np.asarray(sensitivity, dtype=float) * _STEP_NM


def seen(light: ArrayLike, reflectance: ArrayLike) -> Array:
    """XYZ (..., 3) of surfaces (..., 81) as an eye sees them that has grown used to the light (81,), brought to D65.

    Adaptation is Bradford's. This is the truth that a camera's colours are held against.
    """
    return tristimulus(light, reflectance) @ adaptation(tristimulus(light), WHITE).T


# White balance --------------------------------------------------------------------------------------------------------


def neutral(rgb: ArrayLike) -> Array:
    """The gains (3,) that make one colour (3,) grey and leave its green. ValueError where a channel is not above 0."""
    rgb = np.asarray(rgb, dtype=float)
    if rgb.shape != (3,) or not (rgb > 0).all() or not np.isfinite(rgb).all():
        raise ValueError(f"rgb must be one colour with three channels above 0 to be made grey, got {rgb!r}")
    return rgb[1] / rgb


def grey_world(rgb: ArrayLike) -> Array:
    """The gains (3,) that make the mean of all colours (..., 3) grey (Buchsbaum 1980)."""
    return neutral(np.reshape(rgb, (-1, 3)).mean(axis=0))


def white_patch(rgb: ArrayLike, percentile: float = 100) -> Array:
    """The gains (3,) that make the brightest of each channel of (..., 3) equal (Land & McCann 1971).

    A `percentile` below 100 leaves out the few brightest, which may be highlights that are cut off.
    """
    return neutral(np.percentile(np.reshape(rgb, (-1, 3)), percentile, axis=0))


def from_white_xy(xy: ArrayLike, xyz_from_raw: ArrayLike) -> Array:
    """The gains (3,) for a light of CIE (x, y) (2,), by the matrix that takes the camera's raw colours to XYZ.

    The matrix run backwards says what the camera makes of a white in that light: this is how a temperature and a tint
    set by hand become gains.
    """
    return neutral(np.linalg.solve(np.asarray(xyz_from_raw, dtype=float), from_chromaticity(xy)))


# The matrix -----------------------------------------------------------------------------------------------------------


def fit_matrix(rgb: ArrayLike, target: ArrayLike, keep: tuple[ArrayLike, ArrayLike] | None = None) -> Array:
    """The M (3, 3) with the least Σ |M rgb − target|² over colours (n, 3) and their targets (n, 3).

    `keep` is a colour and its target, each (3,), that M must take to each other exactly, such as white: the rest is
    then fitted in the directions that leave it alone. ValueError unless there are three colours that are independent.
    """
    colours, targets = (np.asarray(values, dtype=float) for values in (rgb, target))
    if colours.ndim != 2 or colours.shape[1:] != (3,) or targets.shape != colours.shape:
        raise ValueError(f"rgb and target must both be (n, 3), got {colours.shape} and {targets.shape}")
    if np.linalg.matrix_rank(colours) < 3:
        raise ValueError(f"rgb must hold three independent colours, got {len(colours)} of rank below 3")
    if keep is None:
        return np.linalg.lstsq(colours, targets, rcond=None)[0].T
    white, white_target = (np.asarray(values, dtype=float) for values in keep)
    through = np.outer(white_target, white) / (white @ white)  # takes white to its target, all across it to nothing
    across = np.linalg.svd(white[None])[2][1:]  # (2, 3): the directions in which M is still free
    free = np.linalg.lstsq(colours @ across.T, targets - colours @ through.T, rcond=None)[0]
    return through + free.T @ across


# Metamers -------------------------------------------------------------------------------------------------------------


def metamer(reflectance: ArrayLike, alike: ArrayLike, apart: ArrayLike, smoothness: int = 14) -> Array:
    """Another reflectance (81,) in 0 … 1 to which `alike` (81, c) answers as before and `apart` (81, d) does not.

    Both are sensitivities times the light. Among smooth changes, sums of `smoothness` cosines, those that `alike`
    cannot notice form a null space (Wyszecki's metameric blacks); taken is the direction in it, and then the longest
    step in 0 … 1, that `apart` notices most. Where it notices none, the reflectance comes back unchanged.
    """
    start, equal, unequal = (np.asarray(values, dtype=float) for values in (reflectance, alike, apart))
    grid = (np.arange(len(start)) + 0.5) * np.pi / len(start)
    cosines = np.cos(np.arange(smoothness)[:, None] * grid)
    blacks = scipy.linalg.null_space((cosines @ equal).T).T @ cosines
    directions, strength, _ = np.linalg.svd(blacks @ unequal, full_matrices=False)
    noticed = strength > 1e-9 * np.linalg.norm(unequal)
    candidates = [start]
    for change in directions.T[noticed] @ blacks:
        candidates += [start + _room(start, step) * step for step in (change, -change)]
    farthest = max(candidates, key=lambda one: float(np.linalg.norm((one - start) @ unequal)))
    return np.clip(farthest, 0, 1)  # rounding leaves −1e-16


def _room(start: Array, change: Array) -> float:
    """How many times a change (81,) can be added before a value leaves 0 … 1."""
    ends = np.where(change > 0, 1 - start, start)
    moving = np.abs(change) > 1e-12
    return float(np.min(np.maximum(ends[moving], 0) / np.abs(change[moving]), initial=np.inf)) if moving.any() else 0.0
