"""Sub-apertures of finite width: the blur that each view of a real light field camera has, and how far it refocuses.

A view through a single place of the lens is a pinhole's, sharp at all distances. The pixels under a microlens together
catch what comes through the whole lens, so that a real view comes through an opening as wide as the places are apart:
a point that moves by d pixels from place to place is blurred over |d| pixels in every view (Ng 2005).
"""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.lightfields.field import LightField
from camviz.lightfields.refocusing import linear_bytes
from camviz.lightfields.rendering import disparity_of_views
from camviz.scenes import Scene, to_display

NODE, SHARE = float(np.sqrt(0.15)), 5 / 18
"""Gauss's rule for the mean over an opening from −½ to ½: weight 5/18 at ±√0.15 each, the rest in the middle."""

Floats = NDArray[np.float32]


def exact_range(field: LightField, width: float) -> tuple[float, float]:
    """The depths, nearest and farthest, at which no view is blurred by more than a pixel: width · abs(d) ≤ 1.

    Within this range a refocused picture is as sharp as the pixels allow, whatever the number of views.

    Args:
        field: Its baseline, focal length and focus distance count.
        width: Of an opening over the distance between places, 0 … 1.

    Returns:
        nearest: In metres.
        farthest: In metres; inf where nothing far is blurred by more.

    Raises: ValueError for a width outside 0 … 1.
    Source: R. Ng, Fourier slice photography, ACM Trans. Graph. 24 (2005).

    With baseline · focal_length = 6 m px and the focus at 2 m, 1/z is 1/2 ± 1/6:

    >>> field = LightField(np.zeros((9, 9, 2, 2, 3)), baseline=0.005, focal_length=1200, focus_distance=2)
    >>> nearest, farthest = exact_range(field, width=1)
    >>> round(nearest, 2), round(farthest, 2)
    (1.5, 3.0)
    """
    if not 0 <= width <= 1:
        raise ValueError(f"width must lie between 0 and 1, got {width}")
    if width == 0:
        return 0.0, np.inf
    near, far = field.depth(1 / width), field.depth(-1 / width)
    return float(near), float(far) if np.isfinite(far) else np.inf


@dataclass(frozen=True, eq=False)
class Openings:
    """A field of pinholes, whose places can be opened to any width.

    Light through an opening is the mean over its places. A neighbouring place of the lens, ε baselines away, sees
    L(x, u + ε) = L(x + ε d, u) with the slope d that the tracer met there; only along the rims of things, where it sees
    a little of what is behind, this is not exact.

    Args:
        pinholes: With views as sRGB bytes, such as `photograph_field` makes with `encoded`.
        scene: What they show.
        camera: That of the field.

    Raises: ValueError for views that are not sRGB bytes.

    Beyond the focus, an opening blurs the garden:

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> from camviz.scenes import textured_scene
    >>> garden, camera = textured_scene(), Camera(Intrinsics.from_fov(64, 48, 60))
    >>> field = photograph_field(garden, camera, 3, 3, baseline=0.1, focus_distance=1.0, encoded=True)
    >>> openings = Openings(field, garden, camera)
    >>> openings.opened(1.0).light(1, 1).std() < openings.opened(0.0).light(1, 1).std()
    np.True_
    """

    pinholes: LightField
    scene: InitVar[Scene]
    camera: InitVar[Camera]
    _around: tuple[NDArray[np.uint8], NDArray[np.uint8]] = field(init=False, repr=False)

    def __post_init__(self, scene: Scene, camera: Camera) -> None:
        if self.pinholes.views.dtype != np.uint8:
            raise ValueError(f"pinholes must hold views as sRGB bytes (uint8), got {self.pinholes.views.dtype}")
        object.__setattr__(self, "_around", _around(self.pinholes, disparity_of_views(scene, camera, self.pinholes)))

    def opened(self, width: float) -> LightField:
        """The field whose views come through openings of a width.

        Args:
            width: Over the distance between places, 0 … 1.

        Returns: Linear light; at width 0 the pinholes themselves.
        Raises: ValueError for a width outside 0 … 1.
        """
        if not 0 <= width <= 1:
            raise ValueError(f"width must lie between 0 and 1, got {width}")
        if width == 0:
            return self.pinholes
        outer = SHARE * width**2  # the variance of an opening grows with the square of its width
        middle = 1 - 2 * outer
        weights = middle**2, 4 * middle * outer, 4 * outer**2
        tables = [np.float32(weight) * linear_bytes() for weight in weights]
        views = np.empty(self.pinholes.views.shape, np.float32)
        for row, light in enumerate(
            views.reshape(len(views), -1, 3)
        ):  # rows by themselves stay in the processor's cache
            pinholes, beside, across = (
                cv2.LUT(one[row].reshape(-1, 1, 3), table)[:, 0]
                for one, table in zip((self.pinholes.views, *self._around), tables, strict=True)
            )
            np.add(pinholes, beside, out=light)
            light += across
        return replace(self.pinholes, views=views)


def _around(pinholes: LightField, slopes: Floats) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The means, as bytes, of the views from four places beside each place, and from four diagonally."""
    beside, across = (np.empty_like(pinholes.views) for _ in range(2))
    for v, u in np.ndindex(slopes.shape[:2]):
        view = pinholes.light(v, u).astype(np.float32)
        for kept, places in ((beside, _BESIDE), (across, _ACROSS)):
            light = sum((_seen_from(view, slopes[v, u], *place) for place in places), np.zeros_like(view))
            kept[v, u] = to_display(light / len(places))
    return beside, across


_BESIDE = ((0, -NODE), (0, NODE), (-NODE, 0), (NODE, 0))
_ACROSS = ((-NODE, -NODE), (-NODE, NODE), (NODE, -NODE), (NODE, NODE))
_REACH = 5  # pixels across, within which a thing may come before another from one place of an opening to the next
_APART = 0.3  # pixels a view between the slopes of two things, one before the other


def _seen_from(view: Floats, slopes: Floats, down: float, right: float) -> Floats:
    """The view so many baselines away: the nearest thing around that comes to lie in a pixel, or what is behind."""
    square = np.ones((_REACH, _REACH), np.uint8)
    near, far = cv2.dilate(slopes, square), cv2.erode(slopes, square)
    y, x = np.indices(slopes.shape, dtype=np.float32)
    before, behind = ((np.float32(x + right * d), np.float32(y + down * d)) for d in (near, far))
    met_before, met_behind = (
        cv2.remap(slopes, *at, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE) for at in (before, behind)
    )
    # where neither the near thing nor what belongs behind it is seen, what is seen beside the near thing stands in
    uncovered = (met_before <= near - _APART) & (met_behind < far + _APART)
    right_at, down_at = (np.where(uncovered, there, here) for there, here in zip(behind, before, strict=True))
    seen = cv2.remap(view, right_at, down_at, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)  # linear would blur
    return np.asarray(seen, np.float32)
