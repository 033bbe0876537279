"""The plenoptic camera: one sensor behind an array of microlenses, and the same numbers in other orders.

All of these only reorder a light field, so that each can be taken back without loss.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.arrays import Count

Pixels = NDArray[Any]


def to_microlens_image(views: Pixels) -> Pixels:
    """The sensor behind the microlenses of a plenoptic camera, from its views.

    Under the microlens (x, y) lie the pixels that look through it at every place of the main lens. As with any camera
    the picture is shown turned by 180°: that puts both the scene and each small image of the main lens upright.

    Args:
        views: (v, u, height, width, ...), of any kind of number.

    Returns: (height · v, width · u, ...), the same numbers in another order.
    Raises: ValueError for views of another shape.
    Source: R. Ng et al., Light field photography with a hand-held plenoptic camera, Stanford CTSR 2005-02.

    Two views, 1 and 2, of two pixels each lie next to each other under two microlenses:

    >>> to_microlens_image(np.array([[[[1, 1]], [[2, 2]]]]))
    array([[1, 2, 1, 2]])
    """
    v, u, height, width = grid_of(views)
    return np.moveaxis(views, (2, 0, 3, 1), (0, 1, 2, 3)).reshape(height * v, width * u, *views.shape[4:])


def from_microlens_image(sensor: Pixels, rows: int, columns: int) -> Pixels:
    """The views from the sensor behind microlenses: pixel (v, u) from under every one of them.

    Args:
        sensor: (height · rows, width · columns, ...), of any kind of number.
        rows, columns: Pixels under a microlens.

    Returns: (rows, columns, height, width, ...), the same numbers in another order.
    Raises: ValueError when the sensor does not hold a whole number of microlenses.
    Source: R. Ng et al., Light field photography with a hand-held plenoptic camera, Stanford CTSR 2005-02.

    >>> from_microlens_image(np.array([[1, 2, 1, 2]]), rows=1, columns=2)
    array([[[[1, 1]],
            [[2, 2]]]])
    """
    height, width = _divided(sensor, rows, columns, "microlenses of {} × {} pixels")
    split = sensor.reshape(height, rows, width, columns, *sensor.shape[2:])
    return np.moveaxis(split, (0, 1, 2, 3), (2, 0, 3, 1))


def to_mosaic(views: Pixels) -> Pixels:
    """The views side by side, as one picture.

    Args:
        views: (v, u, height, width, ...), of any kind of number.

    Returns: (v · height, u · width, ...), the same numbers in another order.
    Raises: ValueError for views of another shape.

    >>> to_mosaic(np.array([[[[1, 1]], [[2, 2]]]]))
    array([[1, 1, 2, 2]])
    """
    v, u, height, width = grid_of(views)
    return np.swapaxes(views, 1, 2).reshape(v * height, u * width, *views.shape[4:])


def from_mosaic(picture: Pixels, rows: int, columns: int) -> Pixels:
    """The views of a picture that holds them side by side.

    Args:
        picture: (rows · height, columns · width, ...), of any kind of number.
        rows, columns: Of the grid of views.

    Returns: (rows, columns, height, width, ...), the same numbers in another order.
    Raises: ValueError when the picture cannot be divided so.

    >>> from_mosaic(np.array([[1, 1, 2, 2]]), rows=1, columns=2)
    array([[[[1, 1]],
            [[2, 2]]]])
    """
    height, width = _divided(picture, rows, columns, "a grid of {} × {} views")
    return np.swapaxes(picture.reshape(rows, height, columns, width, *picture.shape[2:]), 1, 2)


def epipolar_plane_image(views: Pixels, row: Count, v: int | None = None) -> Pixels:
    """The slice of a light field at one row of pixels and one row of views, in which every point is a straight line.

    For every step of u the point moves by its disparity to the left. Transpose the views' axes, (1, 0, 3, 2), for the
    upright slices.

    Args:
        views: (v, u, height, width, ...), of any kind of number.
        v: The row of views; by default that in the middle.

    Returns: (u, width, ...), one row for each view.
    Source: R. C. Bolles, H. H. Baker and D. H. Marimont, Epipolar-plane image analysis, Int. J. Comput. Vis. 1 (1987).

    A point that moves by two pixels a view:

    >>> views = np.zeros((1, 3, 1, 7), int)
    >>> views[0, [0, 1, 2], 0, [5, 3, 1]] = 1
    >>> epipolar_plane_image(views, row=0)
    array([[0, 0, 0, 0, 0, 1, 0],
           [0, 0, 0, 1, 0, 0, 0],
           [0, 1, 0, 0, 0, 0, 0]])
    """
    return views[views.shape[0] // 2 if v is None else v, :, row]


def grid_of(views: Pixels) -> tuple[int, int, int, int]:
    """v, u, height and width of views. ValueError where they have fewer axes."""
    if views.ndim < 4:
        raise ValueError(f"views must have shape (v, u, height, width, ...), got {views.shape}")
    v, u, height, width = views.shape[:4]
    return v, u, height, width


def _divided(picture: Pixels, rows: int, columns: int, what: str) -> tuple[int, int]:
    if picture.ndim < 2:
        raise ValueError(f"a picture must have shape (height, width, ...), got {picture.shape}")
    height, width = picture.shape[:2]
    if rows < 1 or columns < 1 or height % rows or width % columns:
        raise ValueError(f"a picture of {width} × {height} pixels is not made of {what.format(columns, rows)}")
    return height // rows, width // columns
