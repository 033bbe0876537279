"""Grids of circles in a picture: their centres, corrected for what a lens and a tilt do to a circle.

A tilted circle is seen as an ellipse whose middle is not where the circle's centre is seen: with the radius r, at the
distance Z, tilted by t, they are about f (r/Z)² sin t cos t pixels apart. The ellipse of each circle follows from the
homography of the board and the circle's size, which the black area of the circles tells; the difference is taken off
(Heikkilä & Silvén 1997).
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz_clinic.calibration.boards.kind import Array, Shape

SMALLEST = 20.0  # pixels of a circle's area
REACH = 0.75  # of the distance to the farthest neighbour: the window around a circle
SKIN = 2  # pixels around the black of a circle that are grey with it
ROUNDS = 2


def find_circles(gray: NDArray[Any], board: Shape, points: Array, asymmetric: bool) -> Array | None:
    """Where the centres of the circles at `points` (columns * rows, 2) on the board are seen, or None."""
    if min(board.columns, board.rows) < 2:
        return None
    first = _ordered(gray, board, asymmetric)
    if first is None:
        return None
    middles, areas = _middles(gray, first.reshape(board.rows, board.columns, 2))
    return middles - bias(points / board.square_size, middles, areas)


def _ordered(gray: NDArray[Any], board: Shape, asymmetric: bool) -> Array | None:
    """Roughly the middles of the ellipses, row by row, seen from the front."""
    parameters = cv2.SimpleBlobDetector.Params()
    parameters.minArea, parameters.maxArea = SMALLEST, gray.size / (board.columns * board.rows)
    parameters.minDistBetweenBlobs = 2 * float(np.sqrt(SMALLEST / np.pi))
    blobs = cv2.SimpleBlobDetector.create(parameters)
    grid = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
    for flags in (grid, grid | cv2.CALIB_CB_CLUSTERING):
        found, centres = cv2.findCirclesGrid(gray, (board.columns, board.rows), flags=flags, blobDetector=blobs)
        if found:
            rows = np.asarray(centres, dtype=float).reshape(board.rows, board.columns, 2)
            across, down = (rows[:, -1] - rows[:, 0]).mean(axis=0), (rows[-1] - rows[0]).mean(axis=0)
            behind = across[0] * down[1] < across[1] * down[0]
            if behind and asymmetric:
                return None
            return (rows[::-1] if behind else rows).reshape(-1, 2)
    return None


def _middles(gray: NDArray[Any], rows: Array) -> tuple[Array, Array]:
    """The centroids (n, 2) of the black around each circle, and its area (n,) in pixels."""
    across = np.linalg.norm(np.diff(rows, axis=1), axis=-1)
    reach = REACH * float(np.median(across))
    found = [_centroid(gray, middle, reach) for middle in rows.reshape(-1, 2)]
    return np.array([middle for middle, _ in found]), np.array([area for _, area in found])


def _centroid(gray: NDArray[Any], middle: Array, reach: float) -> tuple[Array, float]:
    """The centroid of how black the pixels of one circle are, and the sum of it; `middle` where it is not clear."""
    left, top = np.maximum(np.floor(middle - reach), 0).astype(int)
    right, bottom = np.ceil(middle + reach).astype(int) + 1
    window = gray[top:bottom, left:right].astype(float)
    dark, light = np.percentile(window, 2), np.percentile(window, 90)
    u, v = np.rint(middle - [left, top]).astype(int)
    _, labels = cv2.connectedComponents((window < (dark + light) / 2).astype(np.uint8))
    if not (0 <= v < window.shape[0] and 0 <= u < window.shape[1] and labels[v, u]):
        return middle, np.nan
    own = cv2.dilate((labels == labels[v, u]).astype(np.uint8), np.ones((2 * SKIN + 1, 2 * SKIN + 1), np.uint8))
    near = own.astype(bool)
    light = float(np.median(window[cv2.dilate(own, np.ones((3, 3), np.uint8)).astype(bool) & ~near]))
    dark = float(np.percentile(window[near], 5))
    weight = np.where(near, np.clip((light - window) / max(light - dark, 1e-9), 0, None), 0)
    y, x = np.indices(window.shape)
    area = float(weight.sum())
    return np.array([(weight * x).sum(), (weight * y).sum()]) / area + [left, top], area


def bias(points: Array, middles: Array, areas: Array) -> Array:
    """How far the middles (n, 2) of the ellipses are from where the centres of the circles are seen, in pixels (n, 2).

    `points` (n, 2) are the centres on the board, `areas` (n,) the ellipses' in pixels.
    """
    off = np.zeros_like(middles)
    for _ in range(ROUNDS):
        H = cv2.findHomography(points, middles - off)[0]
        seen = np.column_stack([points, np.ones(len(points))]) @ H.T
        centres = seen[:, :2] / seen[:, 2:]
        # the determinant of the homography's derivative is det H / w³: a circle of area a has a det H / w³ pixels
        square = np.nanmedian(areas * np.abs(seen[:, 2]) ** 3 / abs(np.linalg.det(H))) / np.pi
        off = np.array([_ellipse_middle(H, point, square) for point in points]) - centres
    return off


def _ellipse_middle(H: Array, point: Array, square: float) -> Array:
    """The middle (2,) of the image of the circle around a point with this squared radius."""
    x, y = point
    dual = np.diag([square, square, 0.0]) - np.outer([x, y, 1], [x, y, 1])  # the circle's dual conic
    image = H @ dual @ H.T
    middle: Array = image[:2, 2] / image[2, 2]
    return middle
