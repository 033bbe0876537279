"""How a pixel moves when the point before the camera moves, and when the camera's own parameters change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera
from camviz.lenses.base import Array, as_points

PINHOLE = ("fx", "fy", "cx", "cy", "skew")


def parameter(camera: Camera, name: str) -> float:
    """The value of a camera's intrinsic parameter: one of `PINHOLE`, or of its lens."""
    return float(getattr(camera.intrinsics if name in PINHOLE else camera.lens, name))


def with_parameters(camera: Camera, values: dict[str, float]) -> Camera:
    """The camera with other values of the named parameters. Raises ValueError where it cannot take them."""
    pinhole: dict[str, Any] = {name: float(value) for name, value in values.items() if name in PINHOLE}
    bent: dict[str, Any] = {name: float(value) for name, value in values.items() if name not in PINHOLE}
    lens: Any = camera.lens
    return replace(
        camera,
        intrinsics=replace(camera.intrinsics, **pinhole),
        lens=replace(lens, **bent) if bent else lens,
    )


def pixel_jacobian(camera: Camera, points_cam: ArrayLike, names: Sequence[str]) -> tuple[Array, Array, Array]:
    """Pixels (..., 2) of points (..., 3) in the camera's own frame, and their derivatives.

    By the point, (..., 2, 3), and by the named intrinsic parameters, (..., 2, n): analytic in the camera matrix,
    and as the lens has them. The pixel is NaN where the point has no image.
    """
    points_cam = as_points(points_cam, 3, "points_cam")
    intrinsics, lens = camera.intrinsics, camera.lens
    distance = np.linalg.norm(points_cam, axis=-1, keepdims=True)
    rays = points_cam / distance
    xy = lens.project(rays)
    focal = np.array([[intrinsics.fx, intrinsics.skew], [0, intrinsics.fy]])
    by_point = focal @ lens.ray_jacobian(rays) / distance[..., None]
    by_parameter = np.empty((*xy.shape, len(names)))
    for i, name in enumerate(names):
        by_parameter[..., i] = (
            _pinhole_jacobian(name, xy) if name in PINHOLE else lens.parameter_jacobian(name, rays) @ focal.T
        )
    return intrinsics.to_pixels(xy), by_point, by_parameter


def _pinhole_jacobian(name: str, xy: Array) -> Array:
    """∂uv/∂name, (..., 2), of u = fx x + skew y + cx, v = fy y + cy."""
    x, y, one, zero = xy[..., 0], xy[..., 1], np.ones_like(xy[..., 0]), np.zeros_like(xy[..., 0])
    columns = {"fx": (x, zero), "fy": (zero, y), "cx": (one, zero), "cy": (zero, one), "skew": (y, zero)}
    return np.stack(columns[name], axis=-1)


def twist_jacobian(points: Array) -> Array:
    """∂(p + ω × p + τ)/∂(ω, τ) = [-[p]ₓ | 1], (..., 3, 6) of points (..., 3)."""
    jacobian = np.zeros((*points.shape, 6))
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    jacobian[..., 0, 1], jacobian[..., 0, 2] = z, -y
    jacobian[..., 1, 0], jacobian[..., 1, 2] = -z, x
    jacobian[..., 2, 0], jacobian[..., 2, 1] = y, -x
    jacobian[..., 3:] = np.eye(3)
    return jacobian
