"""The pinhole's lens: straight lines stay straight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, as_points, unit


@dataclass(frozen=True)
class Perspective:
    """x = X/Z, y = Y/Z for everything in front of the camera (Hartley & Zisserman 2004, eq. 6.1)."""

    def project(self, points_cam: ArrayLike) -> Array:
        points = as_points(points_cam, 3, "points_cam")
        depth = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
        return points[..., :2] / depth

    def unproject(self, xy: ArrayLike) -> Array:
        xy = as_points(xy, 2, "xy")
        return unit(np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1))
