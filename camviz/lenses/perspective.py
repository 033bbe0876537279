"""The pinhole's lens: straight lines stay straight."""

from dataclasses import dataclass

import numpy as np

from camviz.lenses.base import Array, Lens


@dataclass(frozen=True)
class Perspective(Lens):
    """x = X/Z, y = Y/Z for everything in front of the camera.

    Source: Hartley & Zisserman (2004), eq. 6.1.

    >>> Perspective().project([[1, 2, 4], [1, 2, -4]])  # what is behind has no image
    array([[0.25, 0.5 ],
           [ nan,  nan]])
    """

    @property
    def is_distorted(self) -> bool:
        return False

    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        z = np.where(z > 0, z, np.nan)
        return x / z, y / z

    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        return x, y, np.ones_like(x)
