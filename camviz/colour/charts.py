"""The 24-patch chart in a photograph: where it is, and its colours in linear light."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.spaces import difference, from_srgb, to_lab, to_srgb, tristimulus
from camviz.colour.spectra import illuminant, reflectances
from camviz.lenses.base import Array
from camviz.scenes.light import to_linear

COLUMNS, ROWS = 6, 4
_SIDE = 1000  # pixels on the longer side of what is searched: charts are found as well, and sooner
_FULL = 250 / 255  # a channel that nearly all of a patch has above this was cut off


@dataclass(frozen=True, eq=False)
class FoundChart:
    """A chart in a photograph: `patches` (24, 4, 2) are the corners of each patch's inner part, in pixels, and `rgb`
    (24, 3) its median colour in linear light 0 … 1, in the chart's order. `clipped` are the numbers of patches that
    are overexposed."""

    patches: Array
    rgb: Array
    clipped: tuple[int, ...]


def find_chart(picture: NDArray[np.uint8]) -> FoundChart:
    """The chart in a photograph (height, width, 3), uint8 sRGB, at any angle, by OpenCV's detector (`cv2.mcc`).

    ValueError saying what to do where none is found, and for an array of another kind.
    """
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise ValueError(f"picture must be uint8 (height, width, 3), got {picture.dtype} {picture.shape}")
    scale = min(1.0, _SIDE / max(picture.shape[:2]))
    smaller = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else picture
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)  # what it looks for is random otherwise
    if not detector.process(np.ascontiguousarray(smaller[..., ::-1]), 1):  # else its best chart is a ruin, not None
        raise ValueError(
            f"no chart of 24 patches was found in this picture of {picture.shape[1]} × {picture.shape[0]} pixels: "
            "show the whole chart, evenly lit, at least a quarter as wide as the picture"
        )
    inner = np.array(detector.getBestColorChecker().getColorCharts(), dtype=float).reshape(COLUMNS * ROWS, 4, 2)
    patches = (inner + 0.5) / scale - 0.5
    pixels = [_inside(picture, patch) for patch in patches]
    clipped = tuple(i for i, patch in enumerate(pixels) if (np.median(patch, axis=0) >= 255 * _FULL).any())
    return FoundChart(patches, np.array([np.median(to_linear(patch), axis=0) for patch in pixels]), clipped)


def published_xyz() -> Array:
    """XYZ (24, 3) of the chart's patches in D65, from their published reflectances."""
    return tristimulus(illuminant("D65"), reflectances())


def published_srgb() -> Array:
    """Linear sRGB (24, 3) of the chart's patches in D65; cyan has a red below 0, beyond what a screen can show."""
    return to_srgb(published_xyz())


def differences(rgb: Array) -> Array:
    """ΔE2000 (24,) between linear sRGB colours (24, 3) and the published ones, scaled to the same white patch in Y."""
    white = tristimulus(illuminant("D65"))
    xyz, truth = from_srgb(rgb), published_xyz()
    return difference(to_lab(xyz * truth[18, 1] / xyz[18, 1], white), to_lab(truth, white))


def _inside(picture: NDArray[np.uint8], corners: Array) -> NDArray[np.uint8]:
    """The pixels (n, 3) inside a quadrilateral (4, 2)."""
    (left, top), (right, bottom) = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int)
    left, top = max(left, 0), max(top, 0)
    part = picture[top : bottom + 1, left : right + 1]
    mask = np.zeros(part.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, np.rint(corners - (left, top)).astype(np.int32), 1)
    return part[mask.astype(bool)]
