"""Stereo matching: the disparity of every pixel of a rectified pair, by OpenCV's matchers, held against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import PixelLength
from camviz.lenses.base import Array

METHODS = ("SGM", "BM", "SGM + WLS")
"""The matchers that `disparity` knows.

>>> METHODS
('SGM', 'BM', 'SGM + WLS')
"""
_UNIQUE = 5  # per cent by which the best match must beat the second best
_SPECKLE = (100, 2)  # patches of fewer pixels, of disparities that differ by no more than this, are taken out
_CHECKED = 21  # pixels of a block; of larger ones OpenCV 5.0.0 checks left against right by memory that nobody has set
_SMOOTHNESS, _EDGES = 800.0, 1.0  # of the filter: λ, and the grey levels over 255 that count as an edge, times 100


def disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    method: str = "SGM",
    *,
    disparities: int = 64,
    block_size: int = 5,
) -> NDArray[np.float32]:
    """The disparity d = u_left − u_right of every pixel of a rectified pair, by OpenCV's matchers.

    d is sought from 0 to `disparities` − 1, so that the first `disparities` columns have none. "BM" is block matching
    by the sum of absolute differences (Konolige); "SGM" semi-global matching (Hirschmüller); "SGM + WLS" the same in
    both directions, filtered along the left picture's edges by weighted least squares (Min), which fills holes. "SGM"
    and "BM" leave out what only one camera sees; "BM" does not with blocks of more than 21 pixels.

    Args:
        left, right: (height, width) or (height, width, 3), a rectified pair, grey or sRGB, uint8.
        method: {"SGM", "BM", "SGM + WLS"}, one of METHODS.
        disparities: A multiple of 16, less than the width.
        block_size: Odd, in pixels; at least 5 for "BM".

    Returns: (height, width), in pixels of the left picture, float32; NaN where no match was found.
    Raises: ValueError for pictures of different sizes, and for what OpenCV does not take.
    Source: K. Konolige, Small vision systems: hardware and implementation, Robotics Research (1998); H. Hirschmüller,
    Stereo processing by semiglobal matching and mutual information, IEEE Trans. Pattern Anal. Mach. Intell. 30 (2008);
    D. Min et al., Fast global image smoothing based on weighted least squares, IEEE Trans. Image Process. 23 (2014).

    Noise that was moved by 7 pixels:

    >>> left = np.random.default_rng(0).integers(0, 256, (48, 96), dtype=np.uint8)
    >>> np.nanmedian(disparity(left, np.roll(left, -7, axis=1), disparities=16))
    np.float32(7.0)
    """
    left, right = np.asarray(left), np.asarray(right)
    are_pictures = all(one.dtype == np.uint8 and (one.ndim == 2 or one.shape[2:] == (3,)) for one in (left, right))
    if not are_pictures or left.shape[:2] != right.shape[:2]:
        raise ValueError(
            f"left and right must be uint8 pictures of one size, RGB or grey, got {left.dtype} {left.shape} "
            f"and {right.dtype} {right.shape}"
        )
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if disparities < 16 or disparities % 16 or disparities >= left.shape[1]:
        raise ValueError(
            f"disparities must be a multiple of 16, from 16 to less than the picture's width, got {disparities}"
        )
    least = 5 if method == "BM" else 1
    if block_size < least or block_size % 2 == 0 or block_size > min(left.shape[:2]):
        raise ValueError(f"block_size must be an odd number from {least} to the picture's height, got {block_size}")
    match = {"BM": _block_matching, "SGM": _semi_global, "SGM + WLS": _filtered}[method]
    sixteenths = match(_grey(left), _grey(right), int(disparities), int(block_size), left)
    found = sixteenths.astype(np.float32) / np.float32(16)
    found[sixteenths < 0] = np.nan
    return found


@dataclass(frozen=True)
class MatchingScore:
    """How disparities compare with the true ones.

    Attributes:
        compared: Pixels whose truth is known; the rest are shares of them.
        missing: The share without a disparity.
        bad: The share that has none, or one that is off by more than the threshold.
        mean_error: The mean distance from the truth in pixels, of those that have one.

    >>> score = MatchingScore(compared=200, missing=0.25, bad=0.5, mean_error=0.8)
    >>> round(score.compared * (score.bad - score.missing))  # how many are wrong
    50
    """

    compared: int
    missing: float
    bad: float
    mean_error: float


def matching_score(disparity: ArrayLike, truth: ArrayLike, threshold: float = 1.0) -> MatchingScore:
    """The score of disparities against true ones; a missing pixel counts as bad.

    Args:
        disparity, truth: (...), in pixels; NaN = none, and not known.
        threshold: In pixels: what is off by more is bad.

    Returns: Its shares are NaN where nothing can be compared.
    Raises: ValueError for two different shapes.
    Source: D. Scharstein and R. Szeliski, A taxonomy and evaluation of dense two-frame stereo correspondence
    algorithms, Int. J. Comput. Vis. 47 (2002), eq. 2.

    One right, one off by half a pixel, one missing, and one wrong:

    >>> matching_score([1, 2, np.nan, 9], [1, 2.5, 3, 5])
    MatchingScore(compared=4, missing=0.25, bad=0.5, mean_error=1.5)
    """
    found, true = np.asarray(disparity, dtype=float), np.asarray(truth, dtype=float)
    if found.shape != true.shape:
        raise ValueError(f"truth must have the disparities' shape {found.shape}, got {true.shape}")
    error = np.abs(found - true)[np.isfinite(true)]
    exists = error[np.isfinite(error)]
    if not error.size:
        return MatchingScore(0, np.nan, np.nan, np.nan)
    return MatchingScore(
        compared=error.size,
        missing=1 - exists.size / error.size,
        bad=1 - float(np.mean(error <= threshold)),
        mean_error=float(exists.mean()) if exists.size else np.nan,
    )


def left_right_check(disparity_left: ArrayLike, disparity_right: ArrayLike, tolerance: PixelLength = 1.0) -> Array:
    """The left disparities on which both pictures agree.

    Pixel u of the left row says that its partner is u − d; the partner's own disparity must lead back. It does not for
    points that only one camera sees, nor for most wrong matches.

    Args:
        disparity_left, disparity_right: (height, width), in pixels, both positive for points in front of the cameras.

    Returns: (height, width), in pixels; NaN where they disagree by more.
    Raises: ValueError for two different shapes.
    Source: Szeliski (2022), section 12.4.1.

    The last pixel's partner, three to the left, says 1:

    >>> left_right_check([[np.nan, 1, 1, 3]], [[1, 1, 3, 3]])
    array([[nan,  1.,  1., nan]])
    """
    found, back = np.asarray(disparity_left, dtype=float), np.asarray(disparity_right, dtype=float)
    if found.shape != back.shape or found.ndim < 1:
        raise ValueError(f"the two disparities must have one shape (height, width), got {found.shape} and {back.shape}")
    u = np.arange(found.shape[-1]) - found
    inside = (u > -0.5) & (u < found.shape[-1] - 0.5)
    partner = np.take_along_axis(back, np.where(inside, np.rint(u), 0).astype(int), axis=-1)
    return np.where(inside & (np.abs(partner - found) <= tolerance), found, np.nan)


# OpenCV's matchers, which count in sixteenths of a pixel and say −16 for none ----------------------------------------


def _block_matching(left: Any, right: Any, disparities: int, block_size: int, picture: Any) -> NDArray[np.int16]:
    matcher = _strict(cv2.StereoBM.create(numDisparities=disparities, blockSize=block_size))
    if block_size > _CHECKED:
        matcher.setDisp12MaxDiff(-1)
    return matcher.compute(left, right)


def _semi_global(left: Any, right: Any, disparities: int, block_size: int, picture: Any) -> NDArray[np.int16]:
    return _strict(_semi_global_matcher(disparities, block_size)).compute(left, right)


def _strict(matcher: Any) -> Any:
    """The matcher, which leaves out ambiguous matches, those that fail the left-right check, and small islands."""
    matcher.setUniquenessRatio(_UNIQUE)
    matcher.setDisp12MaxDiff(1)
    matcher.setSpeckleWindowSize(_SPECKLE[0])
    matcher.setSpeckleRange(_SPECKLE[1])
    return matcher


def _filtered(left: Any, right: Any, disparities: int, block_size: int, picture: Any) -> NDArray[np.int16]:
    matcher = _semi_global_matcher(disparities, block_size)
    backwards = cv2.ximgproc.createRightMatcher(matcher)
    wls = cv2.ximgproc.createDisparityWLSFilter(matcher)
    wls.setLambda(_SMOOTHNESS)
    wls.setSigmaColor(_EDGES)
    return wls.filter(matcher.compute(left, right), picture, disparity_map_right=backwards.compute(right, left))


def _semi_global_matcher(disparities: int, block_size: int) -> Any:
    """Penalties as OpenCV's documentation advises: P1 = 8 and P2 = 32 for each pixel of the block."""
    return cv2.StereoSGBM.create(
        numDisparities=disparities, blockSize=block_size, P1=8 * block_size**2, P2=32 * block_size**2,
        preFilterCap=63, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )  # fmt: skip


def _grey(picture: NDArray[np.uint8]) -> Any:
    return cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) if picture.ndim == 3 else picture
