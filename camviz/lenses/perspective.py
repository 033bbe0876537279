"""The pinhole's lens: straight lines stay straight."""

from dataclasses import dataclass

import numpy as np

from camviz.lenses.base import Array, RayLens


@dataclass(frozen=True)
class Perspective(RayLens):
    """x = X/Z, y = Y/Z for everything in front of the camera (Hartley & Zisserman 2004, eq. 6.1)."""

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        z = np.where(z > 0, z, np.nan)
        return x / z, y / z

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        return x, y, np.ones_like(x)
