"""Depth from slope: how far every point moves from view to view, measured in the views themselves."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import Count
from camviz.lightfields.field import LightField

Floats = NDArray[np.float32]


def disparity_by_sweep(field: LightField, disparities: ArrayLike, window: Count = 5) -> Floats:
    """Disparity of what the middle of the aperture sees: the shear at which the views agree best.

    The cost of a shear is the variance over the sheared views, averaged over a window; a parabola through the least
    cost and its neighbours goes between the steps. Light is compared in the fourth root, nearer to how it is seen and
    to its noise.

    Args:
        field: The views.
        disparities: (n,), what is tried, in pixels a view: evenly spaced, n ≥ 3.

    Returns: (height, width), in pixels a view, float32.
    Raises: ValueError for fewer than three disparities, unevenly spaced ones, and an even window.
    Source: Szeliski (2022), section 12.1.2, plane sweep.

    A pattern that moves by one pixel a view:

    >>> import cv2
    >>> pattern = cv2.GaussianBlur(np.random.default_rng(0).random((32, 32, 3)), (0, 0), 2)
    >>> views = [[np.roll(pattern, (1 - v, 1 - u), (0, 1)) for u in range(3)] for v in range(3)]
    >>> float(np.median(disparity_by_sweep(LightField(np.array(views)), [-2, -1, 0, 1, 2])).round(2))
    1.0
    """
    tried = np.asarray(disparities, dtype=float)
    if tried.ndim != 1 or len(tried) < 3 or not np.allclose(np.diff(tried, 2), 0, atol=1e-9):
        raise ValueError(f"disparities must be at least three evenly spaced numbers, got {tried.tolist()}")
    _require_window(window)
    grey = _grey(field)
    costs = np.stack([cv2.blur(_variance(grey, field, d), (window, window)) for d in tried])
    best = np.clip(costs.argmin(axis=0), 1, len(tried) - 2)
    left, middle, right = (np.take_along_axis(costs, best[None] + i, 0)[0] for i in (-1, 0, 1))
    curved = left - 2 * middle + right
    with np.errstate(divide="ignore", invalid="ignore"):
        between = np.where(curved > 0, np.clip(0.5 * (left - right) / curved, -1, 1), 0)
    return (tried[best] + between * (tried[1] - tried[0])).astype(np.float32)


def disparity_by_structure(field: LightField, start: ArrayLike = 0.0, window: Count = 5) -> tuple[Floats, Floats]:
    """Disparity by the direction of the lines in epipolar-plane images, and how far to trust it.

    With L(x, u) = g(x + d u), L_u = d L_x. The structure tensor's eigenvector gives d = tan(½ atan2(2 J_xu, J_xx −
    J_uu)), where J_xx = Σ L_x², J_xu = Σ L_x L_u, J_uu = Σ L_u² over a window and both directions; its coherence is the
    trust. It takes the three views around the middle in each direction.

    Args:
        field: The views, at least 3 × 3.
        start: scalar, in pixels a view: shear the field there first, for the answer is good within half a pixel of it.

    Returns:
        disparity: (height, width), in pixels a view, float32.
        trust: (height, width), 0 … 1.

    Raises: ValueError for a field of fewer than 3 × 3 views, and an even window.
    Source: S. Wanner and B. Goldlücke, Variational light field analysis for disparity estimation and super-resolution,
    IEEE Trans. Pattern Anal. Mach. Intell. 36 (2014).

    A pattern that moves by one pixel a view:

    >>> import cv2
    >>> pattern = cv2.GaussianBlur(np.random.default_rng(0).random((32, 32, 3)), (0, 0), 2)
    >>> views = [[np.roll(pattern, (1 - v, 1 - u), (0, 1)) for u in range(3)] for v in range(3)]
    >>> disparity, trust = disparity_by_structure(LightField(np.array(views)), start=1)
    >>> float(np.median(disparity).round(2)), float(np.median(trust).round(1))
    (1.0, 1.0)
    """
    grey, steps = _grey(field), [round(len(step) // 2) for step in field.steps()]
    v, u = steps
    if min(field.rows, field.columns) < 3:
        raise ValueError(f"the structure tensor needs 3 × 3 views, got {field.rows} × {field.columns}")
    _require_window(window)
    if np.ndim(start):
        raise ValueError(f"start must be a single disparity, got shape {np.shape(start)}")
    shear = float(np.asarray(start))
    look = lambda dv, du: _shifted(grey[v + dv, u + du], shear * du, shear * dv)  # noqa: E731
    row, column = [look(0, i) for i in (-1, 0, 1)], [look(i, 0) for i in (-1, 0, 1)]
    jxx = jxu = juu = np.zeros_like(row[1])
    for views, axis in ((row, 1), (column, 0)):
        along = cv2.Sobel(views[1], cv2.CV_32F, axis, 1 - axis, ksize=3, scale=1 / 8)
        across = cv2.GaussianBlur(views[2] - views[0], (0, 0), 0.7) / 2
        jxx, jxu, juu = jxx + along**2, jxu + along * across, juu + across**2
    jxx, jxu, juu = (cv2.GaussianBlur(one, (window, window), 0) for one in (jxx, jxu, juu))
    spread = np.hypot(jxx - juu, 2 * jxu)
    coherence = np.divide(spread, jxx + juu, out=np.zeros_like(spread), where=jxx + juu > 1e-9)
    return (shear + np.tan(0.5 * np.arctan2(2 * jxu, jxx - juu))).astype(np.float32), coherence**2


def _require_window(window: int) -> None:
    if window < 1 or window % 2 == 0:
        raise ValueError(f"window must be an odd number of pixels, at least 1, got {window}")


def _grey(field: LightField) -> Floats:
    """The views (v, u, height, width) in grey, in the fourth root of light."""
    grey = np.empty(field.views.shape[:4], np.float32)
    for v in range(field.rows):
        for u in range(field.columns):
            grey[v, u] = np.sqrt(np.sqrt(np.maximum(field.light(v, u).mean(axis=-1), 0)))
    return grey


def _variance(grey: Floats, field: LightField, disparity: float) -> Floats:
    """The variance (height, width) over all views, sheared by `disparity`."""
    total, squares = (np.zeros(grey.shape[2:], np.float32) for _ in range(2))
    down, right = field.steps()
    for v, dv in enumerate(down):
        for u, du in enumerate(right):
            moved = _shifted(grey[v, u], disparity * du, disparity * dv)
            cv2.accumulate(moved, total)
            cv2.accumulateSquare(moved, squares)
    count = field.rows * field.columns
    return np.maximum(squares / count - (total / count) ** 2, 0)


def _shifted(picture: Floats, right: float, down: float) -> Floats:
    """The picture moved `right` and `down` by so many pixels; its border goes on as it ends."""
    map_to = np.array([[1, 0, -right], [0, 1, -down]])
    size = picture.shape[1], picture.shape[0]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(picture, map_to, size, flags=flags, borderMode=cv2.BORDER_REPLICATE))
