"""The uncertainty of depths that a calibrated pair measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import transform
from camviz.lenses.base import Array, as_points
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian


@dataclass(frozen=True, eq=False)
class DepthUncertainty:
    """Standard deviations (n,) of depths Z (n,), in metres: of the calibration, of the matching, and of both."""

    depth: Array
    from_calibration: Array
    from_matching: Array

    @property
    def total(self) -> Array:
        """The standard deviation (n,) in metres of both causes together, which are independent."""
        return np.hypot(self.from_calibration, self.from_matching)


def depth_uncertainty(
    adjustment: Adjustment,
    depths: ArrayLike,
    matching_px: float,
    *,
    left: str = "left",
    right: str = "right",
    uv: ArrayLike | None = None,
) -> DepthUncertainty:
    """The uncertainty of the depth Z, along the left camera's axis, of what pixel uv (2,) of the left camera shows.

    The pixel, by default the middle of the picture, is matched in the right one with a standard deviation of
    `matching_px` along its epipolar line. The right pixel q moves by a = ∂q/∂Z along that line, f B/Z² for a rectified
    pair: matching noise becomes σ_d/|a| = Z² σ_d/(f B). An error δ of the parameters b moves q too, and the depth by
    -aᵀ(∂q/∂b)δ/|a|² (yaw: Z²δ/B); δ has the joint covariance of both cameras and their places. NaN where q is not.
    """
    if not matching_px >= 0:
        raise ValueError(f"matching_px must be a standard deviation in pixels, at least 0, got {matching_px}")
    depth = np.asarray(depths, dtype=float)
    intrinsics = adjustment.cameras[left].intrinsics
    pixel = as_points([(intrinsics.width - 1) / 2, (intrinsics.height - 1) / 2] if uv is None else uv, 2, "uv")
    by_depth, by_parameters = _right_pixel_jacobian(adjustment, left, right, pixel, depth)
    along = np.sum(by_depth**2, axis=-1)
    gain = np.einsum("ni,nis->ns", by_depth, by_parameters) / along[:, None]
    variance = np.einsum("ns,st,nt->n", gain, adjustment.covariance, gain)
    return DepthUncertainty(depth, np.sqrt(variance), matching_px / np.sqrt(along))


def _right_pixel_jacobian(
    adjustment: Adjustment, left: str, right: str, pixel: Array, depth: Array
) -> tuple[Array, Array]:
    """How the right pixel of what the left one shows at each depth follows that depth, (n, 2), and b, (n, 2, s)."""
    first, second = adjustment.cameras[left], adjustment.cameras[right]
    ray = first.lens.unproject(first.intrinsics.from_pixels(pixel))
    ray = ray / ray[2]  # so that Z ray has the depth Z
    ray_by_left = _ray_jacobian(adjustment, left, ray)

    points_left = depth[:, None] * ray
    points_world = transform(first.world_from_cam, points_left)
    points_right = transform(second.cam_from_world, points_world)
    _, by_right, by_intrinsics = pixel_jacobian(second, points_right, adjustment.estimated[right])
    by_left = by_right @ (second.cam_from_world.rotation * first.world_from_cam.rotation).as_matrix()

    by_parameters = np.zeros((len(depth), 2, len(adjustment.parameters)))
    by_parameters[..., adjustment.intrinsics_of(left)] = by_left @ (depth[:, None, None] * ray_by_left)
    by_parameters[..., adjustment.intrinsics_of(right)] = by_intrinsics
    if place := adjustment.place_of(
        left
    ):  # its twist turns the world against the left camera, so the point the other way
        by_parameters[..., place] = -by_left @ twist_jacobian(points_left)
    if place := adjustment.place_of(right):
        by_parameters[..., place] = by_right @ twist_jacobian(points_right)
    return by_left @ ray, by_parameters


def _ray_jacobian(adjustment: Adjustment, name: str, ray: Array) -> Array:
    """How the ray (x, y, 1) of a pixel that stays follows the intrinsics b, (3, n): J_ray dray + J_b db = 0."""
    _, by_ray, by_intrinsics = pixel_jacobian(adjustment.cameras[name], ray, adjustment.estimated[name])
    follow = -np.linalg.solve(by_ray[:, :2], by_intrinsics)
    return np.vstack([follow, np.zeros(follow.shape[1])])
