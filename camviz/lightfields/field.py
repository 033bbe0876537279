"""The light field: views from a grid of places in one plane, sheared so that one distance holds still in them all."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import Metres
from camviz.lenses.base import Array
from camviz.scenes.light import to_linear


@dataclass(frozen=True, eq=False)
class LightField:
    """Views from a grid of places in the plane of a lens, or of an array of cameras.

    A point at depth z moves by its *disparity* d = baseline · focal_length · (1/z − 1/focus_distance) pixels to the
    left for each step of u to the right, and up for each step of v down. It is positive for what is nearer than the
    focus: u_left − u_right, as in stereo. The middle of the grid is the middle of the aperture.

    Args:
        views: (v, u, height, width, 3). v counts the places downwards and u to the right, as one looks at the scene;
            then the rows and columns of each view. Floating point views are linear light 0 … 1, uint8 views are sRGB
            bytes.
        baseline: From place to place in both directions, in metres; NaN where unknown.
        focal_length: From lens to image in pixels; NaN where unknown.
        focus_distance: All views show a point at this depth, in metres, in the same pixel; inf where they are not
            sheared.

    Raises:
        ValueError: For views of another shape or kind, and a baseline, focal length or focus distance that is not
            positive.

    Source: M. Levoy and P. Hanrahan, Light field rendering, SIGGRAPH 1996; Szeliski (2022), section 14.3.

    Here baseline · focal_length is 6 m px, so a point at 1 m moves by 6 (1/1 − 1/2) pixels a view:

    >>> views = np.zeros((9, 9, 48, 64, 3), np.uint8)
    >>> field = LightField(views, baseline=0.005, focal_length=1200, focus_distance=2.0)
    >>> field.disparity([1, 2, 4])
    array([ 3. ,  0. , -1.5])
    """

    views: NDArray[Any] = field(repr=False)
    baseline: float = nan
    focal_length: float = nan
    focus_distance: float = inf

    def __post_init__(self) -> None:
        shape = np.shape(self.views)
        if len(shape) != 5 or shape[4] != 3 or 0 in shape:
            raise ValueError(f"views must have shape (v, u, height, width, 3), got {shape}")
        if self.views.dtype != np.uint8 and self.views.dtype.kind != "f":
            raise ValueError(f"views must be sRGB bytes (uint8) or linear light (float), got {self.views.dtype}")
        for name in ("baseline", "focal_length", "focus_distance"):
            value = getattr(self, name)
            if value <= 0 or (value == inf and name != "focus_distance"):
                unit = "pixels" if name == "focal_length" else "metres"
                raise ValueError(f"{name} must be a positive number of {unit}, or NaN for unknown, got {value}")

    @property
    def rows(self) -> int:
        """How many places there are from top to bottom."""
        return self.views.shape[0]

    @property
    def columns(self) -> int:
        """How many places there are from left to right."""
        return self.views.shape[1]

    @property
    def height(self) -> int:
        """Of a view, in pixels."""
        return self.views.shape[2]

    @property
    def width(self) -> int:
        """Of a view, in pixels."""
        return self.views.shape[3]

    def steps(self) -> tuple[Array, Array]:
        """How many baselines each place is below and to the right of the grid's middle.

        Returns:
            down: (rows,), negative above the middle.
            right: (columns,), negative to the left of the middle.
        """
        return _centred(self.rows), _centred(self.columns)

    def light(self, v: int, u: int) -> NDArray[np.floating]:
        """One view as linear light.

        Args:
            v, u: Its row and column in the grid, from 0.

        Returns: (height, width, 3), linear, 0 … 1.
        """
        view = self.views[v, u]
        return to_linear(view) if view.dtype == np.uint8 else np.asarray(view)

    def disparity(self, depth: ArrayLike) -> Array:
        """By how much points at a depth move from one view to the next: their slope.

        Args:
            depth: (...), in metres, along the optical axis.

        Returns: (...), in pixels a view; positive for what is nearer than the focus.
        """
        with np.errstate(divide="ignore"):
            return self.baseline * self.focal_length * (1 / np.asarray(depth, dtype=float) - 1 / self.focus_distance)

    def depth(self, disparity: ArrayLike) -> Array:
        """Where points are that move by a disparity: the inverse of `disparity`.

        Args:
            disparity: (...), in pixels a view.

        Returns: (...), in metres; NaN where it would be beyond infinity.
        """
        d = np.asarray(disparity, dtype=float)
        inverse = d / (self.baseline * self.focal_length) + 1 / self.focus_distance
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(inverse >= 0, 1 / np.abs(inverse), np.nan)

    def alpha(self, disparity: ArrayLike, pixel_pitch: Metres) -> Array:
        """Ng's α: how far behind the lens the film of a refocused picture lies, over how far the sensor does.

        With image distances F and αF, 1 − 1/α = F (1/z − 1/z_focus), and F = focal_length · pixel_pitch; so
        1 − 1/α = disparity · pixel_pitch / baseline: the slope is straight in 1/α, not in α.

        Args:
            disparity: (...), in pixels a view.

        Returns: (...), a ratio, 1 at the focus; NaN where no film would do.
        Source: R. Ng, Fourier slice photography, ACM Trans. Graph. 24 (2005).
        """
        over = 1 - np.asarray(disparity, dtype=float) * pixel_pitch / self.baseline
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(over > 0, 1 / over, np.nan)


def _centred(count: int) -> Array:
    return np.arange(count, dtype=float) - (count - 1) / 2
