"""Pictures standing in space, warped into the onlooker's view."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from camviz.cameras import Intrinsics
from camviz.draw.items import TexturedMesh
from camviz.lenses.base import Array

Window = tuple[tuple[float, float, float, float], np.ndarray]


def warp(px: Array, sheet: TexturedMesh, view: Intrinsics, scale: float) -> Window | None:
    """The sheet as seen, its vertices at picture units `px` (n, 2): a rectangle (x, y, width, height) and RGBA pixels.

    `scale` is pixels per picture unit. None where nothing of it is in view.
    """
    if not np.isfinite(px).any():
        return None
    low = np.maximum(np.floor(np.nanmin(px, axis=0)), 0)
    high = np.minimum(np.ceil(np.nanmax(px, axis=0)), (view.width, view.height))
    if (high <= low).any():
        return None
    width, height = np.ceil((high - low) * scale).astype(int)
    colours, cover = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.uint8)
    for corners, source in _cells(px, sheet):
        _stamp(colours, cover, sheet.picture, source, (corners - low) * scale)
    alpha = cv2.convertScaleAbs(cover, alpha=sheet.opacity)
    picture = cv2.insertChannel(alpha, cv2.cvtColor(colours, cv2.COLOR_RGB2RGBA), 3)
    return (float(low[0]), float(low[1]), width / scale, height / scale), picture


def _cells(px: Array, sheet: TexturedMesh) -> Iterator[tuple[Array, Array]]:
    """Corners in view and in the sheet's picture, both (4, 2), of every quad that exists."""
    height, width = sheet.picture.shape[:2]
    source = (sheet.uv * (1, -1) + (0, 1)) * (width, height)
    for quad in sheet.quads:
        if np.isfinite(px[quad]).all():
            yield px[quad], source[quad]


def _stamp(colours: np.ndarray, cover: np.ndarray, image: np.ndarray, source: Array, corners: Array) -> None:
    """One cell of the picture, by the homography of its four corners, laid into colours where it covers them more."""
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int), cover.shape[::-1])
    if (high <= low).any() or cv2.contourArea(corners.astype(np.float32)) < 0.5:
        return
    to_cell = cv2.getPerspectiveTransform((source - 0.5).astype(np.float32), (corners - low - 0.5).astype(np.float32))
    size = tuple(int(s) for s in high - low)
    cell = cv2.warpPerspective(image, to_cell, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    mask = np.zeros(size[::-1], np.uint8)
    cv2.fillConvexPoly(mask, np.rint((corners - low - 0.5) * 16).astype(np.int32), 255, cv2.LINE_AA, 4)
    window = np.s_[low[1] : high[1], low[0] : high[0]]
    cv2.copyTo(cell, cv2.compare(mask, cover[window], cv2.CMP_GT), colours[window])
    cv2.max(cover[window], mask, cover[window])
