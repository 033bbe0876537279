"""From what a sensor counted to the colours of a picture: responses, white balance, the 3×3 matrix, and metamers.

Everything acts on linear data. Gains (3,) multiply the channels, green's gain being 1. A matrix acts on columns,
xyz = M rgb; for arrays (..., 3) that is `rgb @ M.T`. (`cv2.ccm` writes rgb @ C: its C is this M transposed.)
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from camviz.colour.spaces import D65_XY, adaptation, from_chromaticity, tristimulus
from camviz.colour.spectra import WAVELENGTHS_NM, as_spectra
from camviz.lenses.arrays import Gains, LinearColoursLike, SpectrumLike, Xyz
from camviz.lenses.base import Array, as_points

WHITE = from_chromaticity(D65_XY)
WHITE.flags.writeable = False
_STEP_NM = WAVELENGTHS_NM[1] - WAVELENGTHS_NM[0]


def response(light: SpectrumLike, reflectance: ArrayLike, sensitivity: ArrayLike) -> Array:
    """What the channels of a sensor make of surfaces in a light: Σ light · reflectance · sensitivity · Δλ.

    The sum stands for the integral over wavelength. Divide by the response to a perfect white to have shares of it.

    Args:
        reflectance: (..., 81), shares 0 … 1; a single number is a grey.
        sensitivity: (81, c), what each of c channels makes of a unit of power.

    Returns: (..., c), linear, in the light's units times nanometres.
    Source: Szeliski (2022), section 2.3.2.

    A grey card of 18 % gives 18 % of white's response in every channel:

    >>> light, camera = illuminant("D65"), sensitivities("Nikon D5100")
    >>> response(light, 0.18, camera) / response(light, 1.0, camera)
    array([0.18, 0.18, 0.18])
    """
    power = np.atleast_1d(np.asarray(light, dtype=float))
    count = power.shape[-1]
    reaching = power * as_spectra(reflectance, "reflectance", count)
    return reaching @ as_channels(sensitivity, "sensitivity", count) * _STEP_NM


def as_channels(values: ArrayLike, name: str, count: int) -> Array:
    """What channels (count, c) make of each wavelength, as float64. ValueError for another shape."""
    channels = np.asarray(values, dtype=float)
    if channels.ndim != 2 or len(channels) != count:
        raise ValueError(f"{name} must have shape ({count}, channels), got {channels.shape}")
    return channels


def seen(light: SpectrumLike, reflectance: ArrayLike) -> Xyz:
    """XYZ under D65 of surfaces as they look to an eye that has grown used to the light.

    This is the truth that a camera's colours are held against. Adaptation is Bradford's, as `adaptation` has it.

    Args:
        reflectance: (..., 81), shares 0 … 1.

    White paper looks white in a light bulb's light too:

    >>> seen(illuminant("A"), np.ones(81)).round(3)
    array([0.95 , 1.   , 1.089])
    """
    return tristimulus(light, reflectance) @ adaptation(tristimulus(light), WHITE).T


# White balance --------------------------------------------------------------------------------------------------------


def neutral(rgb: ArrayLike) -> Gains:
    """The gains that make one colour grey and leave its green.

    Args:
        rgb: (3,), linear.

    Raises: ValueError where a channel is not above 0.

    >>> neutral((0.5, 1.0, 0.8))
    array([2.  , 1.  , 1.25])
    """
    rgb = np.asarray(rgb, dtype=float)
    if rgb.shape != (3,) or not (rgb > 0).all() or not np.isfinite(rgb).all():
        raise ValueError(f"rgb must be one colour with three channels above 0 to be made grey, got {rgb!r}")
    return rgb[1] / rgb


def grey_world(rgb: LinearColoursLike) -> Gains:
    """The gains that make the mean of all colours grey.

    Raises: ValueError where the mean of a channel is not above 0.
    Source: G. Buchsbaum, A spatial processor model for object colour perception, J. Franklin Inst. 310 (1980).

    The mean of these two colours is (0.4, 0.6, 0.25):

    >>> grey_world([(0.2, 0.4, 0.1), (0.6, 0.8, 0.4)])
    array([1.5, 1. , 2.4])
    """
    return neutral(as_points(rgb, 3, "rgb").reshape(-1, 3).mean(axis=0))


def white_patch(rgb: LinearColoursLike, percentile: float = 100) -> Gains:
    """The gains that make the brightest values of the three channels equal.

    Args:
        percentile: Below 100 it leaves out the few brightest, which may be highlights that are cut off.

    Raises: ValueError where the brightest of a channel is not above 0.
    Source: E. H. Land and J. J. McCann, Lightness and retinex theory, J. Opt. Soc. Am. 61 (1971).

    >>> white_patch([(0.2, 0.4, 0.1), (0.5, 0.8, 0.4)])
    array([1.6, 1. , 2. ])
    """
    return neutral(np.percentile(as_points(rgb, 3, "rgb").reshape(-1, 3), percentile, axis=0))


def from_white_xy(xy: ArrayLike, xyz_from_raw: ArrayLike) -> Array:
    """The gains (3,) for a light of CIE (x, y) (2,), by the matrix that takes the camera's raw colours to XYZ.

    The matrix run backwards says what the camera makes of a white in that light: this is how a temperature and a tint
    set by hand become gains.
    """
    return neutral(np.linalg.solve(np.asarray(xyz_from_raw, dtype=float), from_chromaticity(xy)))


# The matrix -----------------------------------------------------------------------------------------------------------


def fit_matrix(rgb: ArrayLike, target: ArrayLike, keep: tuple[ArrayLike, ArrayLike] | None = None) -> Array:
    """The matrix M that takes colours to their targets with the least Σ ‖M rgb − target‖².

    Args:
        rgb, target: (n, 3), linear colours and what they should become.
        keep: pair of (3,), a colour and its target that M must take to each other exactly, such as white. The rest is
            then fitted in the directions that leave it alone.

    Returns: (3, 3). M acts on columns: for arrays (..., 3) use `rgb @ M.T`.
    Raises: ValueError unless `rgb` holds three independent colours, and `target` has its shape; for a black to keep.

    Colours that a matrix made give it back:

    >>> M = np.array([[1.5, -0.3, -0.2], [-0.2, 1.4, -0.2], [0.0, -0.4, 1.4]])
    >>> rgb = np.random.default_rng(0).random((24, 3))
    >>> np.allclose(fit_matrix(rgb, rgb @ M.T), M)
    True
    """
    colours, targets = (np.asarray(values, dtype=float) for values in (rgb, target))
    if colours.ndim != 2 or colours.shape[1:] != (3,) or targets.shape != colours.shape:
        raise ValueError(f"rgb and target must both be (n, 3), got {colours.shape} and {targets.shape}")
    if np.linalg.matrix_rank(colours) < 3:
        raise ValueError(f"rgb must hold three independent colours, got {len(colours)} of rank below 3")
    if keep is None:
        return np.linalg.lstsq(colours, targets, rcond=None)[0].T
    white, white_target = (as_points(values, 3, "keep") for values in keep)
    if not white.any():
        raise ValueError("keep must begin with a colour that is not black: a matrix takes black to black")
    through = np.outer(white_target, white) / (white @ white)  # takes white to its target, all across it to nothing
    across = np.linalg.svd(white[None])[2][1:]  # (2, 3): the directions in which M is still free
    free = np.linalg.lstsq(colours @ across.T, targets - colours @ through.T, rcond=None)[0]
    return through + free.T @ across


# Metamers -------------------------------------------------------------------------------------------------------------


def metamer(reflectance: ArrayLike, alike: ArrayLike, apart: ArrayLike, smoothness: int = 14) -> Array:
    """Another reflectance that looks alike to one set of channels and different to another.

    Among smooth changes, those that `alike` cannot notice form a null space, the metameric blacks. Taken is the
    direction in it, and then the longest step within 0 … 1, that `apart` notices most.

    Args:
        reflectance: (81,), shares 0 … 1.
        alike, apart: (81, c), (81, d), sensitivities times the light, in any unit: `alike` answers as before, `apart`
            does not.
        smoothness: How many cosines the changes are sums of.

    Returns: (81,), shares 0 … 1; the reflectance unchanged where `apart` notices nothing.
    Raises: ValueError for other shapes.
    Source: G. Wyszecki and W. S. Stiles, Color Science (2nd ed. 1982), chapter 3.

    It looks like grey in daylight, and under a light bulb it is redder and bluer:

    >>> daylight, bulb = (illuminant(name)[:, None] * observer() for name in ("D65", "A"))
    >>> grey = np.full(81, 0.4)
    >>> other = metamer(grey, alike=daylight, apart=bulb)
    >>> (other @ daylight / (grey @ daylight)).round(2), (other @ bulb / (grey @ bulb)).round(2)
    (array([1., 1., 1.]), array([1.16, 0.98, 1.12]))
    """
    start = np.atleast_1d(np.asarray(reflectance, dtype=float))
    equal, unequal = as_channels(alike, "alike", len(start)), as_channels(apart, "apart", len(start))
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
