"""Textures: pictures that lie on surfaces, averaged beforehand so that far away they do not flicker."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.base import Array, as_points
from camviz.scenes.light import to_display, to_linear

Floats = NDArray[np.float32]
LIGHT = 4  # numbers for each piece of light: RGB and one that means nothing, for fours are moved at thrice the speed
_SOFTNESS = 2**0.5  # half a level too coarse: an edge narrower than a pixel would be drawn up to 0.2 px beside itself
Steps = NDArray[np.uint16]
_FULL = 65535  # linear light 0…1 is kept in 16 bits: half the memory of floats, and no banding in the dark


class Texture:
    """A picture on a surface, averaged beforehand so that far away it does not flicker.

    It is looked up by s (to the right) and r (down), 0 … 1. It keeps halved copies of itself down to a single texel,
    and mixes the two whose texels come nearest to the distance between rays.

    Args:
        light: (height, width, 3), linear light 0 … 1, or sRGB bytes.
        repeat: Whether it tiles the plane; otherwise its border goes on for ever.

    Raises: ValueError for any other shape.
    Source: L. Williams, Pyramidal parametrics, SIGGRAPH 1983.

    Black and white texels, from near and from far:

    >>> texture, where = Texture([[(0, 0, 0), (1, 1, 1)]]), np.array([0.25, 0.75], np.float32)
    >>> [texture.sample(where, where, texels)[:, 0].round(2).tolist() for texels in (0, 100)]
    [[0.0, 1.0], [0.5, 0.5]]
    """

    def __init__(self, light: ArrayLike, repeat: bool = False) -> None:
        picture = np.asarray(light)
        if picture.ndim != 3 or picture.shape[2] != 3 or 0 in picture.shape:
            raise ValueError(f"light must have shape (height, width, 3), got {picture.shape}")
        self.height, self.width = picture.shape[:2]
        self.repeat = repeat
        self._mosaic, self._places = _pyramid(picture, repeat)

    @classmethod
    def plain(cls, rgb: ArrayLike) -> Texture:
        """One colour everywhere.

        Args:
            rgb: (3,), sRGB 0 … 1.

        Raises: ValueError for another shape.
        """
        return cls(to_linear(as_points(rgb, 3, "rgb")).reshape(1, 1, 3))

    @cached_property
    def mean(self) -> Array:
        """Linear light (3,), the mean of the finest copy."""
        return self._mosaic[: self.height, : self.width, :3].mean(axis=(0, 1), dtype=np.float64) / _FULL

    @property
    def is_plain(self) -> bool:
        """Whether it is one colour everywhere."""
        return self.width == self.height == 1

    @property
    def photograph(self) -> NDArray[np.uint8]:
        """The finest copy as sRGB bytes (height, width, 3)."""
        return to_display(self._mosaic[: self.height, : self.width, :3].astype(np.float32) / _FULL)

    def sample(self, s: Floats, r: Floats, texels: Floats | float = 0.0) -> Floats:
        """Light at places on the texture.

        Args:
            s, r: (n,), to the right and down, shares of the picture.
            texels: (n,) or float, how many texels of the finest copy the rays lie apart.

        Returns: (n, 4), linear light, and a fourth number that means nothing.
        """
        top = self._places.shape[1] - 1
        texels = np.maximum(np.multiply(texels, _SOFTNESS, dtype=np.float32), 1)
        level = np.atleast_1d(np.minimum(np.log2(texels), np.float32(top)))
        fine = level.astype(np.intp)
        if not np.any(level):
            return self._look_up(s, r, fine)
        near, far = self._look_up(s, r, np.minimum(np.stack([fine, fine + 1]), top)).reshape(2, -1, 1, LIGHT)
        share = np.broadcast_to((level - fine).astype(np.float32), s.shape)[:, None]
        return cv2.blendLinear(near, far, 1 - share, share).reshape(-1, LIGHT)

    def _look_up(self, s: Floats, r: Floats, level: NDArray[np.intp]) -> Floats:
        left, top, width, height = self._places.take(level, axis=1)
        x = _texel(s, width, self.repeat)
        y = _texel(r, height, self.repeat)
        return _remap(self._mosaic, (x + left).ravel(), (y + top).ravel())


def _in_steps(light: NDArray[Any]) -> Steps:
    """Linear light 0…1, or sRGB bytes, in 16 bits."""
    if light.dtype == np.uint8:
        return _in_steps(to_linear(np.arange(256, dtype=np.uint8)))[light]
    steps = np.multiply(light, _FULL, dtype=np.float32)
    return np.clip(np.rint(steps, out=steps), 0, _FULL).astype(np.uint16)


def _texel(s: Floats, size: Floats, repeat: bool) -> Floats:
    x = s * size - np.float32(0.5)
    if repeat:
        return x - size * np.floor(x / size)
    return np.minimum(np.maximum(x, np.float32(0)), size - np.float32(1))


def _pyramid(light: NDArray[Any], repeat: bool) -> tuple[Steps, Floats]:
    """All halved copies in one mosaic, and where they lie: (4, levels) as left, top, width, height.

    The finest is on the left and the others in a column beside it, each with a border of one texel on its right and
    below, which continues it.
    """
    (height, width), levels = light.shape[:2], max(light.shape[:2]).bit_length()
    mosaic = np.zeros((height + 2 * levels, width + width // 2 + 3, LIGHT), dtype=np.uint16)
    places = np.zeros((4, levels), dtype=np.float32)
    left = top = 0
    copy = np.dstack([_in_steps(light), np.zeros(light.shape[:2], np.uint16)])
    for level in range(levels):
        place = mosaic[top : top + height + 1, left : left + width + 1]
        place[:-1, :-1] = copy
        place[-1, :-1] = place[0 if repeat else -2, :-1]
        place[:, -1] = place[:, 0 if repeat else -2]
        places[:, level] = left, top, width, height
        left, top = light.shape[1] + 1 if level == 0 else left, top + (height + 1 if level else 0)
        height, width = max(height // 2, 1), max(width // 2, 1)
        copy = np.asarray(cv2.resize(place[:-1, :-1], (width, height), interpolation=cv2.INTER_AREA))
    return mosaic, places


def _remap(picture: Steps, x: Floats, y: Floats, row: int = 1024) -> Floats:
    """Bilinear look-up (n, LIGHT); cv2.remap takes no side longer than 32767, so the points are laid out in rows."""
    seen = np.empty((x.size, LIGHT), dtype=np.uint16)
    rows = x.size // row * row
    for part in (slice(rows), slice(rows, None)):
        across, down, out = (points[part] for points in (x, y, seen))
        if across.size:
            width = min(across.size, row)
            across, down, out = across.reshape(-1, width), down.reshape(-1, width), out.reshape(-1, width, LIGHT)
            cv2.remap(picture, across, down, cv2.INTER_LINEAR, dst=out, borderMode=cv2.BORDER_REPLICATE)
    return np.multiply(seen, 1 / _FULL, dtype=np.float32)
