"""Panoramas: the world rolled out, all the way round. Their image points are angles."""

from dataclasses import dataclass
from math import pi

import numpy as np

from camviz.lenses.base import Array, RayLens

ROUNDING = 1e-12  # the edge of a panorama, ±π, may arrive rounded from its pixels


@dataclass(frozen=True)
class Equirectangular(RayLens):
    """(x, y) = (longitude, latitude) in radians: atan2(X, Z) and, downwards, atan2(Y, √(X² + Z²)) (Snyder 1987, p. 90).

    It sees everything. The two poles, images of a whole line each, are given the longitude 0.
    """

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        ground = np.hypot(x, z)
        longitude = np.where(ground > 0, np.arctan2(x, z), 0.0)
        latitude = np.where((ground > 0) | (y != 0), np.arctan2(y, ground), np.nan)
        return np.where(np.isnan(latitude), np.nan, longitude), latitude

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        inside = (np.abs(x) <= pi + ROUNDING) & (np.abs(y) <= pi / 2 + ROUNDING)
        ground = np.where(inside, np.cos(y), np.nan)
        return ground * np.sin(x), np.sin(y), ground * np.cos(x)


@dataclass(frozen=True)
class Cylindrical(RayLens):
    """x = atan2(X, Z) in radians, y = Y / √(X² + Z²): upright lines stay straight (Szeliski 2022, eq. 8.42).

    It sees all but straight up and straight down.
    """

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        ground = np.hypot(x, z)
        ground = np.where(ground > 0, ground, np.nan)
        return np.where(ground > 0, np.arctan2(x, z), np.nan), y / ground

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x = np.where(np.abs(x) <= pi + ROUNDING, x, np.nan)
        return np.sin(x), y, np.cos(x)
