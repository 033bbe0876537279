"""A board as a picture, for views and for the virtual camera."""

from __future__ import annotations

import numpy as np

from camviz_clinic.calibration.boards import kind_of
from camviz_clinic.calibration.boards.kind import Array, Shape

DISC_SAMPLES = 8  # to a texel, along each side


def whiteness(board: Shape, texels: int, margin: float = 0.0) -> Array:
    """How white each texel of a board is, 0 to 1 (height, width), from the upper left of what is printed.

    A texel that an edge runs through is as white as the part of it that is. There are `texels` along `square_size`;
    `margin` is the white around the board, in `square_size`.
    """
    kind, texel = kind_of(board), board.square_size / texels
    drawing = kind.drawn(board)
    left, top, right, bottom = np.array(kind.area(board)) + margin * board.square_size * np.array([-1, -1, 1, 1])
    width, height = (max(round((high - low) / texel), 1) for low, high in ((left, right), (top, bottom)))
    black = np.zeros((height, width))
    for x, y, wide, high in drawing.rectangles:
        columns, u = _covered((x - left) / texel, wide / texel, width)
        rows, v = _covered((y - top) / texel, high / texel, height)
        black[rows, columns] += v[:, None] * u
    for x, y, size in drawing.discs:
        _add_disc(black, (x - left) / texel, (y - top) / texel, size / texel / 2)
    return 1 - np.clip(black, 0, 1)


def _covered(start: float, length: float, count: int) -> tuple[slice, Array]:
    """The texels that an interval touches, and which share of each lies in it."""
    first, last = int(np.floor(start + 1e-9)), int(np.ceil(start + length - 1e-9))
    first, last = max(first, 0), min(last, count)
    at = np.arange(first, last)
    return slice(first, last), np.clip(np.minimum(at + 1, start + length) - np.maximum(at, start), 0, 1)


def _add_disc(black: Array, x: float, y: float, radius: float) -> None:
    left, top = (max(int(np.floor(at - radius)), 0) for at in (x, y))
    right, bottom = int(np.ceil(x + radius)), int(np.ceil(y + radius))
    part = black[top:bottom, left:right]
    offsets = (np.arange(DISC_SAMPLES) + 0.5) / DISC_SAMPLES
    u = left + (np.arange(part.shape[1])[:, None] + offsets).ravel() - x
    v = top + (np.arange(part.shape[0])[:, None] + offsets).ravel() - y
    inside = (u**2 + v[:, None] ** 2 < radius**2).astype(float)
    part += inside.reshape(part.shape[0], DISC_SAMPLES, part.shape[1], DISC_SAMPLES).mean(axis=(1, 3))
