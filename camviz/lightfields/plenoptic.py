"""The plenoptic camera: one sensor behind an array of microlenses, and the same numbers in other orders.

All of these only reorder a light field, so that each can be taken back without loss.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[Any]


def to_microlens_image(views: Pixels) -> Pixels:
    """The sensor (height · v, width · u, ...) behind the microlenses, from views (v, u, height, width, ...).

    Under the microlens (x, y) lie the pixels that look through it at every place of the main lens. As with any camera
    the picture is shown turned by 180°: that puts both the scene and each small image of the main lens upright.
    """
    v, u, height, width = views.shape[:4]
    return np.moveaxis(views, (2, 0, 3, 1), (0, 1, 2, 3)).reshape(height * v, width * u, *views.shape[4:])


def from_microlens_image(sensor: Pixels, rows: int, columns: int) -> Pixels:
    """The sub-aperture views (rows, columns, height, width, ...): pixel (v, u) from under every microlens.

    Raises ValueError when the sensor does not hold a whole number of microlenses of rows × columns pixels.
    """
    height, width = _divided(sensor, rows, columns, "microlenses of {} × {} pixels")
    split = sensor.reshape(height, rows, width, columns, *sensor.shape[2:])
    return np.moveaxis(split, (0, 1, 2, 3), (2, 0, 3, 1))


def to_mosaic(views: Pixels) -> Pixels:
    """The views side by side, as one picture (v · height, u · width, ...)."""
    v, u, height, width = views.shape[:4]
    return np.swapaxes(views, 1, 2).reshape(v * height, u * width, *views.shape[4:])


def from_mosaic(picture: Pixels, rows: int, columns: int) -> Pixels:
    """The views (rows, columns, height, width, ...) of a picture that holds them side by side."""
    height, width = _divided(picture, rows, columns, "a grid of {} × {} views")
    return np.swapaxes(picture.reshape(rows, height, columns, width, *picture.shape[2:]), 1, 2)


def epipolar_plane_image(views: Pixels, row: int, v: int | None = None) -> Pixels:
    """The slice (u, width, ...) of views (v, u, height, width, ...) at one row of pixels and one row of views.

    A point is a straight line in it: for every step of u it moves by its disparity to the left. By default `v` is the
    row in the middle. Transpose the views' axes, (1, 0, 3, 2), for the upright ones.
    """
    return views[views.shape[0] // 2 if v is None else v, :, row]


def _divided(picture: Pixels, rows: int, columns: int, what: str) -> tuple[int, int]:
    height, width = picture.shape[:2]
    if rows < 1 or columns < 1 or height % rows or width % columns:
        raise ValueError(f"a picture of {width} × {height} pixels is not made of {what.format(columns, rows)}")
    return height // rows, width // columns
