"""What every lens is: a map between directions in front of the camera and points on its image, at focal length 1."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import fields
from math import isfinite
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

ROUNDING = 1e-12  # how far beyond the rim of its image a point may lie and still be a rounded point of the rim
ALONE = 1 << 17  # multiplications of a matrix product that OpenBLAS does without threads; they begin at twice as many
BLOCK = 16384  # points worked on at a time, so that the temporaries stay in the processor's cache


class Lens(Protocol):
    """A lens bends directions: `project` sends a direction to the image, `unproject` brings it back.

    A lens knows neither pixels nor poses. Its image is measured in focal lengths from the principal point, x to the
    right and y down; `Intrinsics` turns that into pixels. It acts on rays rather than on the plane z = 1, so that a
    fisheye may look behind itself. A direction without an image and an image point without a direction are NaN.
    """

    def project(self, points_cam: ArrayLike) -> Array:
        """Image points (..., 2) in focal lengths of camera-frame points (..., 3), any unit; NaN where there is none."""
        ...

    def unproject(self, xy: ArrayLike) -> Array:
        """Unit rays (..., 3) of image points (..., 2) in focal lengths; NaN where no ray arrives."""
        ...

    def __hash__(self) -> int: ...


class RayLens(ABC):
    """A lens written as its two equations, on coordinates (n,): `image` and `ray`. The shapes are seen to here."""

    def project(self, points_cam: ArrayLike) -> Array:
        """Image points (..., 2) in focal lengths of camera-frame points (..., 3), any unit; NaN where there is none."""
        return blockwise(self.image, as_points(points_cam, 3, "points_cam"), 2)

    def unproject(self, xy: ArrayLike) -> Array:
        """Unit rays (..., 3) of image points (..., 2) in focal lengths; NaN where no ray arrives."""
        return blockwise(self._unit_ray, as_points(xy, 2, "xy"), 3)

    @abstractmethod
    def image(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """The image coordinates of camera-frame points."""

    @abstractmethod
    def ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """A ray, of any length, of image coordinates."""

    def _unit_ray(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        x, y, z = self.ray(x, y)
        scale = 1 / np.sqrt(x * x + y * y + z * z)
        return x * scale, y * scale, z * scale


def blockwise(function: Callable[..., tuple[Array, ...]], points: Array, size: int) -> Array:
    """`function` of the coordinates of points (..., n), whose results become the coordinates of points (..., size).

    What has no answer is NaN without a warning: that is its meaning here.
    """
    flat = points.reshape(-1, points.shape[-1])
    result = np.empty((len(flat), size))
    with np.errstate(all="ignore"):
        for start in range(0, len(flat), BLOCK):
            block = slice(start, start + BLOCK)
            coordinates = function(*flat[block].T.copy())
            for i, coordinate in enumerate(coordinates):
                result[block, i] = coordinate
            whole = np.isfinite(sum(coordinates))
            if not whole.all():
                result[block][~whole] = np.nan
    return result.reshape(*points.shape[:-1], size)


def up_to(limit: float, values: Array) -> Array:
    """`values` as far as `limit`, at which they may arrive rounded; NaN beyond it."""
    return np.where(values <= limit * (1 + ROUNDING), np.minimum(values, limit), np.nan)


def check_parameters(lens: Any, limit: float = 1e15) -> None:
    """Raises ValueError naming the first parameter of a lens that is not a number of sensible size."""
    for field in fields(lens):
        value = getattr(lens, field.name)
        if not (isfinite(value) and abs(value) <= limit):
            raise ValueError(f"{field.name} must be a finite number, at most {limit:g} in size, got {value}")


def check_range(name: str, value: float, inside: bool, takes: str) -> None:
    """Raises ValueError saying what the parameter `name` takes, unless its value is `inside`."""
    if not inside:
        raise ValueError(f"{name} must be {takes}, got {value}")


def as_points(values: ArrayLike, size: int, name: str) -> Array:
    """`values` as float64 (..., size). Raises ValueError naming `name` when the last axis has another length."""
    points = np.asarray(values, dtype=np.float64)
    if points.ndim == 0 or points.shape[-1] != size:
        raise ValueError(f"{name} must have shape (..., {size}), got {points.shape}")
    return points


def on_plane(xy: Array) -> Array:
    """Directions (..., 3) through points (..., 2) of the plane z = 1."""
    return np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)


def blocked_matmul(vectors: NDArray[Any], matrix: NDArray[Any]) -> NDArray[Any]:
    """The products vectors @ matrix, (..., n) times (n, m), some thousands of vectors at a time.

    For more at once OpenBLAS wakes threads, which afterwards wait in a busy loop for tens of milliseconds, on the very
    core where a browser wants to show the picture.
    """
    part = ALONE // matrix.size
    if vectors.ndim == 1 or vectors[..., 0].size <= part:
        return np.asarray(vectors @ matrix)
    flat = vectors.reshape(-1, vectors.shape[-1])
    product = np.empty((len(flat), matrix.shape[-1]), dtype=np.result_type(vectors, matrix))
    for start in range(0, len(flat), part):
        np.matmul(flat[start : start + part], matrix, out=product[start : start + part])
    return product.reshape(*vectors.shape[:-1], -1)


def unit(vectors: Array) -> Array:
    """Vectors (..., n) scaled to length 1; the zero vector has no direction and becomes NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
