"""Panoramas: the world rolled out, all the way round. Their image points are angles."""

from dataclasses import dataclass
from math import pi

import numpy as np

from camviz.lenses.base import Array, Lens, up_to


@dataclass(frozen=True)
class Equirectangular(Lens):
    """(x, y) = (longitude, latitude) in radians: atan2(X, Z) and, downwards, atan2(Y, √(X² + Z²)).

    It sees everything. The two poles, images of a whole line each, are given the longitude 0.

    Source: J. P. Snyder, *Map Projections: A Working Manual*, USGS Professional Paper 1395 (1987), p. 90.

    >>> Equirectangular().project([[1, 0, 0], [0, 1, 0]]).round(4)  # to the right 90°; down 90°
    array([[1.5708, 0.    ],
           [0.    , 1.5708]])
    """

    goes_round = True

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        ground = np.hypot(x, z)
        longitude = np.where(ground > 0, np.arctan2(x, z), 0.0)
        latitude = np.where((ground > 0) | (y != 0), np.arctan2(y, ground), np.nan)
        return longitude, latitude

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x, y = np.copysign(up_to(pi, np.abs(x)), x), np.copysign(up_to(pi / 2, np.abs(y)), y)
        return np.cos(y) * np.sin(x), np.sin(y), np.cos(y) * np.cos(x)


@dataclass(frozen=True)
class Cylindrical(Lens):
    """x = atan2(X, Z) in radians, y = Y / √(X² + Z²): upright lines stay straight.

    It sees all but straight up and straight down.

    Source: Szeliski (2022), eq. 8.42.

    >>> Cylindrical().project([[3, 2, 4], [3, -2, 4]]).round(4)  # one upright line: x = atan(3/4), y = ±2/5
    array([[ 0.6435,  0.4   ],
           [ 0.6435, -0.4   ]])
    """

    goes_round = True

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        ground = np.hypot(x, z)
        return np.arctan2(x, z), y / np.where(ground > 0, ground, np.nan)

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x = np.copysign(up_to(pi, np.abs(x)), x)
        return np.sin(x), y, np.cos(x)
