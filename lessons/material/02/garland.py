"""What the depth-of-field visualizer photographs: the garden and its globe, by day with a garland of lamps before the
wall, and at dusk with garlands of many colours from the wall to the globe and nearer.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import cycle

import numpy as np

from camviz.lenses.base import Array
from camviz.scenes import Rectangle, Scene, Texture, textured_scene

GLOBE_Z = 3.3  # of the globe in the world, towards which the camera looks along +z
STAND = (0.58, 0.45)  # x and y of the camera
GLOBE_M = 0.54  # the globe's diameter
DUSK = np.array((0.22, 0.27, 0.40), dtype=np.float32)  # the share of the day's light that is left, red, green and blue
_DAY_SIDE, _DAY_GLOW = 0.036, 20.0  # of a lamp: metres, and times full light
_SIDE_RAD, _GLOW = 0.0087, 55.0  # of a lamp at dusk, its side as it is seen from STAND, 4.5 m before the globe
_WARM = (1.0, 0.9, 0.72)
_COLOURS = ((1, 0.62, 0.25), (1, 0.30, 0.16), (1, 0.78, 0.5), (0.35, 0.6, 1), (0.35, 0.9, 0.4), (1, 0.42, 0.55))
_GARLANDS = (  # depth z, ends in x, how high the ends hang in y, how far the middle hangs lower, and lamps
    (6.3, (-1.0, 2.1), -0.62, 0.16, 9),
    (6.2, (-0.9, 2.0), -0.10, 0.20, 8),
    (5.6, (-0.8, 1.9), 0.36, 0.16, 8),
    (4.6, (-0.55, 1.7), 0.78, 0.12, 7),
    (1.0, (0.26, 0.9), 0.57, 0.07, 4),
)


@lru_cache(maxsize=1)
def garden_with_lamps() -> Scene:
    """The garden with a garland of lamps before its wall: points of light, which show the aperture's shape."""
    heights = [-0.62, -0.72, -0.86, -0.74, -0.7, -0.84]
    places = [np.array([x, y, 6.3]) for x, y in zip(np.linspace(-1.5, 0.94, 6), heights, strict=True)]
    across, down = _DAY_SIDE * np.eye(3)[:2]
    return _hung([_lamp(place, across, down, _WARM, _DAY_GLOW) for place in places])


@lru_cache(maxsize=1)
def garden_at_dusk() -> Scene:
    """The garden with its garlands of many colours, each lamp as large in the picture; its light is still the day's."""
    places, eye = [], np.array([*STAND, GLOBE_Z - 4.5])
    for z, (left, right), high, sag, lamps in _GARLANDS:
        along = np.linspace(-1, 1, lamps)
        x, y = (left + right) / 2 + (right - left) / 2 * along, high + sag * (1 - along**2)
        places += [(across, down, z) for across, down in zip(x, y, strict=True)]
    sides = [_SIDE_RAD * (z - eye[2]) for _, _, z in places]
    coloured = zip(places, sides, cycle(_COLOURS))  # which go on for ever
    return _hung([one for place, side, colour in coloured for one in _round(place, side, colour)])


def _round(place: Sequence[float], side: float, colour: tuple[float, float, float]) -> list[Rectangle]:
    """A lamp whose outline is nearly round: a square, and another that stands on its corner."""
    half, middle = side / 2, np.array(place)
    return [
        _lamp(middle - half * (a + b), 2 * half * a, 2 * half * b, colour, _GLOW)
        for a, b in (np.array(((1.0, 0, 0), (0, 1.0, 0))), np.array(((1, -1, 0), (1, 1, 0))) / 2**0.5)
    ]


def _lamp(corner: Array, across: Array, down: Array, colour: tuple[float, float, float], glow: float) -> Rectangle:
    return Rectangle(corner, across, down, Texture.plain(colour), shade=glow, name="garland")


def _hung(lamps: Sequence[Rectangle]) -> Scene:
    garden = textured_scene()
    return Scene([*lamps, *garden.surfaces], garden.sky)
