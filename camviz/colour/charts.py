"""The 24-patch chart in a photograph: where it is, and its colours in linear light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.spaces import delta_e_2000, from_srgb, to_lab, to_srgb, tristimulus
from camviz.colour.spectra import illuminant, reflectances
from camviz.lenses.base import Array
from camviz.scenes.light import to_linear

COLUMNS, ROWS = 6, 4
_SIDE = 1000  # pixels on the longer side of what is searched: charts are found as well, and sooner
_CANDIDATES = 5  # per search
_FEWEST = 12  # pixels inside a patch
_UNLIKE = 0.15  # of the colours' variance may be left over by a matrix
_FULL = 250  # a channel whose median is at least this was cut off


@dataclass(frozen=True, eq=False)
class FoundChart:
    """A chart of 24 patches in a photograph, as `find_chart` found it.

    Attributes:
        patches: (24, 4, 2), the corners of each patch's inner part, in pixels.
        rgb: (24, 3), each patch's median colour, linear light 0 … 1, in the chart's order.
        clipped: The numbers of the patches that are overexposed.

    >>> found = FoundChart(np.zeros((24, 4, 2)), np.full((24, 3), 0.2), clipped=(18,))
    >>> found.rgb[18], found.clipped
    (array([0.2, 0.2, 0.2]), (18,))
    """

    patches: Array
    rgb: Array
    clipped: tuple[int, ...]


def find_chart(picture: NDArray[np.uint8]) -> FoundChart:
    """The 24-patch chart in a photograph, at any angle, by OpenCV's detector (`cv2.mcc`).

    The detector takes other things for charts, and misses charts beside such things. So the whole picture is searched
    and then parts of it, and what is found must have the chart's colours but for a 3×3 matrix.

    Args:
        picture: (height, width, 3), sRGB bytes, uint8.

    Raises: ValueError where no chart is found, saying what to do; and for an array of another kind.

    >>> from camviz.colour.charts import painted, published_srgb
    >>> from camviz.scenes import to_display
    >>> chart = to_display(np.pad(painted(published_srgb()), ((60, 60), (60, 60), (0, 0))))
    >>> found = find_chart(chart)
    >>> bool(np.abs(found.rgb - published_srgb().clip(0, 1)).max() < 0.01)  # as painted, but for rounding to bytes
    True
    """
    picture = np.asarray(picture)
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise ValueError(f"picture must be uint8 (height, width, 3), got {picture.dtype} {picture.shape}")
    for corner, part in _parts(picture):
        for patches in _candidates(part):
            found = _read(picture, patches + corner)
            if found and _alike(found.rgb):
                return found
    raise ValueError(
        f"no chart of 24 patches was found in this picture of {picture.shape[1]} × {picture.shape[0]} pixels: "
        "show the whole chart, evenly lit, at least a quarter as wide as the picture"
    )


def painted(rgb: Array, side: int = 40) -> Array:
    """The chart from straight ahead as a picture (height, width, 3) of these 24 colours (24, 3), black between them."""
    gap = side // 8
    picture = np.full((ROWS * (side + gap) + gap, COLUMNS * (side + gap) + gap, 3), 0.01)
    for i, colour in enumerate(np.asarray(rgb, dtype=float)):
        row, column = divmod(i, COLUMNS)
        top, left = gap + row * (side + gap), gap + column * (side + gap)
        picture[top : top + side, left : left + side] = colour
    return picture


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
    return delta_e_2000(to_lab(xyz * truth[18, 1] / xyz[18, 1], white), to_lab(truth, white))


def _parts(picture: NDArray[np.uint8]) -> Iterator[tuple[Array, NDArray[np.uint8]]]:
    """The picture, and then windows on it two thirds as wide and high: each with its upper left corner (2,)."""
    yield np.zeros(2), picture
    height, width = picture.shape[:2]
    for y in (height // 6, 0, height // 3):
        for x in (width // 6, 0, width // 3):
            yield np.array([x, y], dtype=float), picture[y : y + 2 * height // 3, x : x + 2 * width // 3]


def _candidates(picture: NDArray[np.uint8]) -> Iterator[Array]:
    """The inner corners (24, 4, 2) of the patches of whatever OpenCV takes for a chart."""
    scale = min(1.0, _SIDE / max(picture.shape[:2]))
    smaller = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else picture
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)  # what it looks for is random otherwise
    if not detector.process(
        np.ascontiguousarray(smaller[..., ::-1]), _CANDIDATES
    ):  # else its chart is a ruin, not None
        return
    for checker in detector.getListColorChecker():
        inner = np.array(checker.getColorCharts(), dtype=float).reshape(COLUMNS * ROWS, 4, 2)
        yield (inner + 0.5) / scale - 0.5


def _read(picture: NDArray[np.uint8], patches: Array) -> FoundChart | None:
    """The colours inside patches (24, 4, 2); None where one of them is not all in the picture, or has no inside."""
    height, width = picture.shape[:2]
    if patches.min() < 0 or (patches > (width - 1, height - 1)).any():
        return None
    pixels = [_inside(picture, patch) for patch in patches]
    if min(map(len, pixels)) < _FEWEST:
        return None
    clipped = tuple(i for i, patch in enumerate(pixels) if (np.median(patch, axis=0) >= _FULL).any())
    return FoundChart(patches, np.array([np.median(to_linear(patch), axis=0) for patch in pixels]), clipped)


def _alike(rgb: Array) -> bool:
    """Whether a matrix takes the colours (24, 3) to the chart's so well that they must be the chart's."""
    target = published_srgb()
    left = target - rgb @ np.linalg.lstsq(rgb, target, rcond=None)[0]
    return bool(np.sum(left**2) < _UNLIKE * np.sum((target - target.mean(axis=0)) ** 2))


def _inside(picture: NDArray[np.uint8], corners: Array) -> NDArray[np.uint8]:
    """The pixels (n, 3) inside a quadrilateral (4, 2)."""
    (left, top), (right, bottom) = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int)
    left, top = max(left, 0), max(top, 0)
    part = picture[top : bottom + 1, left : right + 1]
    mask = np.zeros(part.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, np.rint(corners - (left, top)).astype(np.int32), 1)
    return part[mask.astype(bool)]
