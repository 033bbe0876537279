"""What every lens is: a map between directions in front of the camera and points on its image, at focal length 1."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Lens(Protocol):
    """A lens bends directions: `project` sends a direction to the image, `unproject` brings it back.

    A lens knows neither pixels nor poses. Its image is measured in focal lengths from the principal point, x to the
    right and y down; `Intrinsics` turns that into pixels. It acts on rays rather than on the plane z = 1, so that a
    fisheye may look behind itself. A direction without an image and an image point without a direction are NaN.
    """

    def project(self, points_cam: ArrayLike) -> Array:
        """Image points (..., 2) in focal lengths of camera-frame points (..., 3), any unit; NaN where none."""
        ...

    def unproject(self, xy: ArrayLike) -> Array:
        """Unit rays (..., 3) of image points (..., 2) in focal lengths; NaN where no ray arrives."""
        ...


def as_points(values: ArrayLike, size: int, name: str) -> Array:
    """`values` as float64 (..., size). Raises ValueError naming `name` when the last axis has another length."""
    points = np.asarray(values, dtype=np.float64)
    if points.ndim == 0 or points.shape[-1] != size:
        raise ValueError(f"{name} must have shape (..., {size}), got {points.shape}")
    return points


def unit(vectors: Array) -> Array:
    """Vectors (..., n) scaled to length 1; the zero vector has no direction and becomes NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
