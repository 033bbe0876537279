"""The uncertainty of a projected pixel: the scatter of the views propagated through the calibration.

What is wrong in the same way in every view, such as a bent board, does not scatter, and is not in it.
"""

from __future__ import annotations

from math import inf, nan

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ellipe

from camviz.cameras import rotate
from camviz.lenses.base import Array, as_points
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian


def projection_covariance(
    adjustment: Adjustment, uv: ArrayLike, distance: float = inf, camera: str | None = None
) -> Array:
    """The covariance (..., 2, 2) in px² of where the point that pixel uv (..., 2) shows would be seen, solved anew.

    The point is `distance` metres along the pixel's ray. It keeps its place relative to the boards, which is all that
    two solutions have in common. Every board gives it another place, of which the camera sees the mean
    (mrcal's recipe, mrcal.secretsauce.net/uncertainty.html). With the camera's own frame held fixed instead, a shift of
    its principal point would count as an error, though the camera need only be turned to make up for it. mrcal's
    own numbers are by the noise of corners alone: those of `adjustment.by_corners`.
    """
    jacobian = projection_jacobian(adjustment, uv, distance, camera)
    return jacobian @ adjustment.mean_twist_covariance @ np.swapaxes(jacobian, -1, -2)


def projection_uncertainty(
    adjustment: Adjustment, uv: ArrayLike, distance: float = inf, camera: str | None = None
) -> Array:
    """The standard deviation (...,) in pixels of `projection_covariance`, in its worst direction: √λ_max."""
    return worst_deviation(projection_covariance(adjustment, uv, distance, camera))


def expected_length(covariance: Array) -> Array:
    """E‖e‖ (...,) of normal errors e of covariances (..., 2, 2): √(2 λ₁/π) E(1 - λ₂/λ₁), E being Legendre's integral.

    >>> expected_length(np.eye(2)).round(4), expected_length(np.diag([1.0, 0.0])).round(4)
    (np.float64(1.2533), np.float64(0.7979))
    """
    largest = worst_deviation(covariance) ** 2
    smallest = np.trace(covariance, axis1=-2, axis2=-1) - largest
    ratio = np.divide(smallest, largest, out=np.ones_like(largest), where=largest > 0)
    return np.sqrt(2 * largest / np.pi) * ellipe(1 - np.clip(ratio, 0, 1))


def largest_expected_error(adjustment: Adjustment, camera: str | None = None) -> float:
    """The largest expected error, in pixels, of where a far point is seen, over a grid on the picture.

    The Max ERE of AprilCal (Richardson, Strom & Olson 2013, sec. IV): there as a rule for when enough pictures have
    been taken, at 1 px, and from samples; here from `projection_covariance`. NaN where no pixel of the grid has a ray.
    """
    expected = expected_errors(adjustment, camera)[1]
    return float(np.max(expected)) if expected.size else nan


def expected_errors(adjustment: Adjustment, camera: str | None = None) -> tuple[Array, Array]:
    """The pixels uv (n, 2) of a grid on the picture that have a ray, and the expected errors (n,) of a far point there.

    Both in pixels; the largest is `largest_expected_error`.
    """
    name = next(iter(adjustment.cameras)) if camera is None else camera
    uv = pixel_grid(adjustment.cameras[name].intrinsics, (12, 9)).reshape(-1, 2)
    expected = expected_length(projection_covariance(adjustment, uv, camera=name))
    has_ray = np.isfinite(expected)
    return uv[has_ray], expected[has_ray]


def mean_deviation(covariance: Array) -> Array:
    """√((λ₁ + λ₂)/2) (...,) of covariances (..., 2, 2): what mrcal calls rms-stdev."""
    return np.sqrt(np.trace(covariance, axis1=-2, axis2=-1) / 2)


def worst_deviation(covariance: Array) -> Array:
    """√λ_max (...,) of covariances (..., 2, 2): what mrcal calls worstdirection-stdev."""
    mean = (covariance[..., 0, 0] + covariance[..., 1, 1]) / 2
    half = (covariance[..., 0, 0] - covariance[..., 1, 1]) / 2
    return np.sqrt(mean + np.hypot(half, covariance[..., 0, 1]))


def projection_jacobian(
    adjustment: Adjustment, uv: ArrayLike, distance: float = inf, camera: str | None = None
) -> Array:
    """∂q⁺/∂(shared parameters, mean twist of the boards), (..., 2, s + 6), at pixels uv (..., 2).

    A board's twist (ω, τ) takes the point p it holds, in the first camera's frame, to p + ω × p + τ, whichever board
    it is: so only the mean of all twists counts. The projection does not see the length of p, and everything is
    divided by the distance d: [-[p]ₓ | 1] becomes [-[p/d]ₓ | 1/d], and at infinity rotations alone remain.
    """
    if not distance > 0:
        raise ValueError(f"distance must be positive, in metres, or infinity, got {distance}")
    name = next(iter(adjustment.cameras)) if camera is None else camera
    intrinsics, place = adjustment.intrinsics_of(name), adjustment.place_of(name)
    seen_by = adjustment.cameras[name]
    rays_cam = seen_by.lens.unproject(seen_by.intrinsics.from_pixels(as_points(uv, 2, "uv")))
    _, by_ray, by_intrinsics = pixel_jacobian(seen_by, rays_cam, adjustment.estimated[name])

    jacobian = np.zeros((*rays_cam.shape[:-1], 2, len(adjustment.parameters) + 6))
    jacobian[..., intrinsics] = by_intrinsics
    if place:
        jacobian[..., place] = by_ray @ _scaled_twist_jacobian(rays_cam, distance)
    rays_first = rotate(seen_by.world_from_cam.rotation, rays_cam) + seen_by.centre / distance
    by_first = by_ray @ seen_by.cam_from_world.rotation.as_matrix()
    jacobian[..., -6:] = by_first @ _scaled_twist_jacobian(rays_first, distance)
    return jacobian


def _scaled_twist_jacobian(points: Array, distance: float) -> Array:
    jacobian = twist_jacobian(points)
    jacobian[..., 3:] /= distance
    return jacobian
