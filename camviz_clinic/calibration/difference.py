"""Where two calibrations of one camera disagree, apart from a turn or a shift of the whole camera."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isinf

import numpy as np

from camviz.cameras import Camera, Intrinsics, transform
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.adjustment import twisted
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.jacobian import twist_jacobian

HUBER = np.deg2rad(5) ** 2  # mrcal's: the weighted square of an angle beyond which its cost grows more slowly
MOST_STEPS = 100


class NothingSharedError(ValueError):
    """Two cameras that have no rays in common, so that there is nothing to compare."""


@dataclass(frozen=True, eq=False)
class Difference:
    """The pixels uv (rows, columns, 2) of one camera, and how far off (rows, columns, 2) the other has the same points.

    `second_from_first` is the motion between their frames that the two sets of intrinsics imply. It is not part of the
    difference. Where it is large, errors of the intrinsics of one of the two are made up for by its poses.
    """

    uv: Array
    shift: Array
    second_from_first: RigidTransform
    distance: float

    @property
    def length(self) -> Array:
        """The length of the difference, (rows, columns) in pixels; NaN where a camera sees nothing."""
        return np.linalg.norm(self.shift, axis=-1)

    @property
    def turn_deg(self) -> float:
        """The angle of the implied rotation."""
        return float(np.degrees(self.second_from_first.rotation.magnitude()))


def difference(
    first: Camera,
    second: Camera,
    distance: float = inf,
    grid: tuple[int, int] = (60, 40),
    *,
    within: float | None = None,
    uncertainties: tuple[Array, Array] | None = None,
) -> Difference:
    """The difference map of two cameras, wherever they stand, on a grid of columns × rows pixels.

    Points `distance` metres along the rays of the first are seen by the second: from where it must stand for both
    to agree best, with the rotation (and at a finite distance the translation) for which the rays of the same pixels
    fall together. They are compared up to `within` pixels from the middle of the image, by default a sixth of its
    shorter side; or, where the two projection uncertainties (rows, columns) of `pixel_grid` are given, everywhere, with
    weights 1/(σ₁σ₂)². That is mrcal's projection_diff, with its cost: Huber's, of squared angles. Raises ValueError
    for pictures of two sizes, and NothingSharedError, one too, where fewer than three rays can be compared.
    """
    sizes = [(camera.intrinsics.width, camera.intrinsics.height) for camera in (first, second)]
    if sizes[0] != sizes[1]:
        raise ValueError(f"first and second must have pictures of one size, got {sizes[0]} and {sizes[1]}")
    if not distance > 0:
        raise ValueError(f"distance must be positive, in metres, or infinity, got {distance}")
    uv = pixel_grid(first.intrinsics, grid)
    rays_first, rays_second = (_rays(camera, uv) for camera in (first, second))
    points = rays_first if isinf(distance) else distance * rays_first
    weights = _weights(first.intrinsics, uv, within, uncertainties)
    compared = np.isfinite(points).all(-1) & np.isfinite(rays_second).all(-1) & (weights > 0)
    if compared.sum() < 3:
        raise NothingSharedError(
            f"at least three rays must be known to both cameras where they are compared, got {compared.sum()}"
        )
    second_from_first = aligned(points[compared], rays_second[compared], weights[compared], turn_only=isinf(distance))
    seen = second.intrinsics.to_pixels(second.lens.project(transform(second_from_first, points)))
    return Difference(uv, seen - uv, second_from_first, distance)


def pixel_grid(intrinsics: Intrinsics, grid: tuple[int, int] = (60, 40)) -> Array:
    """Pixels (rows, columns, 2) from the first pixel's centre to the last one's, in a grid of columns × rows."""
    u, v = np.linspace(0, intrinsics.width - 1, grid[0]), np.linspace(0, intrinsics.height - 1, grid[1])
    return np.stack(np.meshgrid(u, v), axis=-1)


def _rays(camera: Camera, uv: Array) -> Array:
    return camera.lens.unproject(camera.intrinsics.from_pixels(uv))


def _weights(
    intrinsics: Intrinsics, uv: Array, within: float | None, uncertainties: tuple[Array, Array] | None
) -> Array:
    """The weight of each pixel's rays in the comparison, (rows, columns)."""
    weights = np.ones(uv.shape[:-1])
    if uncertainties is not None:
        product = np.asarray(uncertainties[0]) * np.asarray(uncertainties[1])
        weights = np.where(product > 0, product, np.nan) ** -2
        within = inf if within is None else within
    elif within is None:
        within = min(intrinsics.width, intrinsics.height) / 6
    middle = np.array([intrinsics.width - 1, intrinsics.height - 1]) / 2
    return np.where(np.linalg.norm(uv - middle, axis=-1) < within, np.nan_to_num(weights), 0)


def aligned(points: Array, rays: Array, weights: Array, *, turn_only: bool) -> RigidTransform:
    """The motion of points (n, 3) after which they lie along unit rays (n, 3): the least Σ ρ(w θ²), by Newton's method.

    With the difference e of the directions, θ² = e·e and e(ξ) = e + E ξ for a small twist ξ, the cost w²θ⁴ has the
    slope 4 w²θ² Eᵀe and the curvature 4 w² (θ² EᵀE + 2 Eᵀe eᵀE). Huber's ρ lessens the weight beyond its limit.
    """
    motion = RigidTransform.from_rotation(Rotation.align_vectors(rays, unit(points), weights)[0])
    free = 3 if turn_only else 6
    cost = _cost(motion, points, rays, weights)
    for _ in range(MOST_STEPS):
        slope, curvature = _slope_and_curvature(motion, points, rays, weights, free)
        step = np.zeros(6)
        if not np.any(slope):
            break
        step[:free] = -inverse(curvature) @ slope
        better = motion
        for factor in 0.5 ** np.arange(12):
            better = twisted(motion, factor * step)
            if (new := _cost(better, points, rays, weights)) < cost:
                break
        else:
            break
        motion, gain, cost = better, 1 - new / cost, new
        if gain < 1e-12:
            break
    return motion


def _cost(motion: RigidTransform, points: Array, rays: Array, weights: Array) -> float:
    square = weights * np.sum((unit(transform(motion, points)) - rays) ** 2, axis=-1)
    return float(np.sum(np.where(square <= HUBER, square**2, HUBER * (2 * square - HUBER))))


def _slope_and_curvature(
    motion: RigidTransform, points: Array, rays: Array, weights: Array, free: int
) -> tuple[Array, Array]:
    there = transform(motion, points)
    length = np.linalg.norm(there, axis=-1)[:, None]
    direction = there / length
    e = direction - rays
    # ∂(p/|p|)/∂ξ = (1 - n nᵀ) [-[p]ₓ | 1] / |p|
    E = twist_jacobian(there)[..., :free] / length[..., None]
    E -= direction[..., None] * np.einsum("ni,nij->nj", direction, E)[:, None]
    square = np.sum(e * e, axis=-1)
    Ee = np.einsum("nij,ni->nj", E, e)
    near = weights * square <= HUBER
    factor = 4 * weights * np.where(near, weights * square, HUBER)
    curvature = np.einsum("n,nij,nik->jk", factor, E, E) + np.einsum("n,nj,nk->jk", 8 * weights**2 * near, Ee, Ee)
    return factor @ Ee, curvature
