"""Where in the image there is no evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera
from camviz.lenses.base import Array, as_points
from camviz_clinic.calibration.difference import pixel_grid

FEWEST = 4  # corners in a part of the image, as many as a pose takes
BORDER = 1 / 8  # of a side: a board's own margin of a square keeps corners from coming much closer
GRID = (48, 36)
THIRDS = (
    ("upper left", "upper middle", "upper right"),
    ("left", "middle", "right"),
    ("lower left", "lower middle", "lower right"),
)


def gaps(camera: Camera, corners: ArrayLike) -> tuple[str, ...]:
    """The parts of the image that corners (n, 2) leave empty: its ninths, and strips along its borders.

    Only where the camera has rays: a fisheye's black corners are not missed.
    """
    uv = as_points(corners, 2, "corners").reshape(-1, 2)
    uv = uv[np.isfinite(uv).all(axis=-1)]
    pixels = pixel_grid(camera.intrinsics, GRID)
    seen = pixels[np.isfinite(camera.lens.unproject(camera.intrinsics.from_pixels(pixels))).all(axis=-1)]
    return (*_empty_parts(camera, uv, seen), *_bare_borders(uv, seen))


def _empty_parts(camera: Camera, uv: Array, seen: Array) -> list[str]:
    size = np.array([camera.intrinsics.width, camera.intrinsics.height])
    counts, rays = (_by_third(each, size) for each in (uv, seen))
    return [
        f"the {THIRDS[row][column]}"
        for row in range(3)
        for column in range(3)
        if rays[row, column] and counts[row, column] < FEWEST
    ]


def _by_third(uv: Array, size: Array) -> Array:
    """How many pixels (n, 2) lie in each ninth of the image, (3, 3) by rows."""
    column, row = np.clip(((uv + 0.5) * 3 / size).astype(int), 0, 2).T
    return np.bincount(row * 3 + column, minlength=9).reshape(3, 3).astype(float)


def _bare_borders(uv: Array, seen: Array) -> list[str]:
    if not len(uv):
        return []
    low, high = seen.min(axis=0), seen.max(axis=0)
    strip = BORDER * (high - low)
    first, last = uv.min(axis=0) > low + strip, uv.max(axis=0) < high - strip
    named = {"left": first[0], "right": last[0], "upper": first[1], "lower": last[1]}
    return [f"the strip along the {side} border" for side, bare in named.items() if bare]
