"""The camera models that several formats of references.py have, as equations, with nothing of camviz."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
HERE = np.eye(3)


@dataclass(frozen=True)
class Reference:
    """A camera as its file defines it: pixels of points in its frame, and where it stands, x_cam = R x_world + t."""

    project: Callable[[Array], Array]
    R: Array
    t: Array


def opencv(points: Array, K: ArrayLike, D: ArrayLike) -> Array:
    """OpenCV's own projection."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.array(K, float), np.array(D, float).ravel())
    return pixels[:, 0].astype(float)


def camera(K: ArrayLike, D: ArrayLike, R: ArrayLike = HERE, t: ArrayLike = (0, 0, 0)) -> Reference:
    """A camera of OpenCV's model."""
    return Reference(lambda points: opencv(points, K, D), np.array(R, float), np.array(t, float).ravel())


def matrix(fx: float, fy: float, cx: float, cy: float) -> list[list[float]]:
    """The camera matrix."""
    return [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]


def fisheye(K: ArrayLike, D: ArrayLike, R: ArrayLike = HERE, t: ArrayLike = (0, 0, 0)) -> Reference:
    """Kannala and Brandt's: r = θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹."""
    (fx, _, cx), (_, fy, cy), _ = np.array(K, float)
    k = [1, *np.ravel(D)]

    def project(points: Array) -> Array:
        across = np.hypot(points[:, 0], points[:, 1])
        theta = np.arctan2(across, points[:, 2])
        scale = sum(each * theta ** (2 * power + 1) for power, each in enumerate(k)) / across
        return np.stack([fx * scale * points[:, 0] + cx, fy * scale * points[:, 1] + cy], axis=-1)

    return Reference(project, np.array(R, float), np.array(t, float).ravel())


def double_sphere(fx: float, fy: float, cx: float, cy: float, xi: float, alpha: float) -> Callable[[Array], Array]:
    """Usenko, Demmel and Cremers 2018, equations 40 to 42."""

    def project(points: Array) -> Array:
        x, y, z = points.T
        d1 = np.sqrt(x * x + y * y + z * z)
        d2 = np.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
        below = alpha * d2 + (1 - alpha) * (xi * d1 + z)
        return np.stack([fx * x / below + cx, fy * y / below + cy], axis=-1)

    return project


def extended_unified(fx: float, fy: float, cx: float, cy: float, alpha: float, beta: float) -> Callable[[Array], Array]:
    """Khomutenko, Garcia and Martinet 2016."""

    def project(points: Array) -> Array:
        x, y, z = points.T
        below = alpha * np.sqrt(beta * (x * x + y * y) + z * z) + (1 - alpha) * z
        return np.stack([fx * x / below + cx, fy * y / below + cy], axis=-1)

    return project
