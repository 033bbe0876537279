"""Triangulation: the point in the world that several pictures of it agree on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, rotate
from camviz.lenses.arrays import PixelsOfEachLike
from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform
from camviz.twoview.epipolar import from_homogeneous, projection_matrix


def triangulate(cameras: Sequence[Camera], uvs: PixelsOfEachLike) -> Array:
    """World points nearest to the rays of pixels, under any lens.

    It minimises the sum of squared distances to the rays: for two views, the point is the midpoint of their common
    perpendicular.

    Args:
        cameras: 2 or more, in different places.

    Returns:
        (..., 3), in metres; NaN where the rays are parallel (a point at infinity), diverge (they meet behind a camera),
        or do not exist.

    Raises:
        ValueError: For fewer than 2 cameras, cameras all in one place, and pixels that are not one array for each
            camera.

    Source: Szeliski (2022), section 11.2.4.

    A disparity of 10 pixels, with f = 500 and B = 0.1 m, is f B / d = 5 m away:

    >>> from camviz.cameras import Camera
    >>> from camviz.poses import RigidTransform
    >>> from camviz import Intrinsics
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_translation([0.1, 0, 0]))
    >>> triangulate([left, right], [[320, 240], [310, 240]]).round(6) + 0
    array([0., 0., 5.])
    """
    uvs = _views(cameras, uvs)
    rays = _rays(cameras, uvs)
    centres = np.stack([camera.centre for camera in cameras])
    origin = centres.mean(axis=0)
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    A = across.reshape(*across.shape[:-3], -1, 3)
    b = (across @ (centres - origin)[:, :, None]).reshape(A.shape[:-1])
    return _keep_in_front(cameras, rays, origin + _least_squares(A, b))


def triangulate_linear(cameras: Sequence[Camera], uvs: PixelsOfEachLike) -> Array:
    """World points by the direct linear transform on perspective cameras: A X = 0.

    It minimises no distance in particular; `refine_points` does.

    Args:
        cameras: 2 or more, in different places, with perspective lenses.

    Returns: (..., 3), in metres; NaN as of `triangulate`.
    Raises: ValueError as of `triangulate`, and for any lens that bends.
    Source: Hartley & Zisserman (2004), section 12.2.

    >>> from camviz.cameras import Camera
    >>> from camviz.poses import RigidTransform
    >>> from camviz import Intrinsics
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_translation([0.1, 0, 0]))
    >>> triangulate_linear([left, right], [[320, 240], [310, 240]]).round(6) + 0
    array([0., 0., 5.])
    """
    uvs = _views(cameras, uvs)
    P = np.stack([projection_matrix(camera) for camera in cameras])
    # u (p₃ᵀ X) − p₁ᵀ X = 0 and v (p₃ᵀ X) − p₂ᵀ X = 0 for every view
    rows = [uv[..., :, None] * p[2] - p[:2] for uv, p in zip(uvs, P, strict=True)]
    A = np.concatenate(rows, axis=-2)
    known = np.isfinite(A).all(axis=(-1, -2))
    X = np.linalg.svd(np.where(known[..., None, None], A, 0))[2][..., -1, :]
    return _keep_in_front(cameras, _rays(cameras, uvs), from_homogeneous(X))


def refine_points(cameras: Sequence[Camera], uvs: PixelsOfEachLike, points_world: ArrayLike, steps: int = 20) -> Array:
    """World points moved to the least sum of squared reprojection errors, under any lens, by Gauss–Newton.

    Args:
        cameras: 2 or more, in different places.
        points_world: (..., 3), where to begin, in metres, say from `triangulate`.
        steps: At most so many.

    Returns: (..., 3), in metres; NaN where a point has not settled to 1e-7 of its distance.
    Raises: ValueError as of `triangulate`.
    Source: Hartley & Zisserman (2004), section 12.5, whose optimum it finds by iteration.

    Rows that differ by 1 pixel are met half way, by 0.5 pixels in either picture:

    >>> from camviz.cameras import Camera
    >>> from camviz.poses import RigidTransform
    >>> from camviz import Intrinsics
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_translation([0.1, 0, 0]))
    >>> point = refine_points([left, right], [[320, 240], [310, 241]], points_world=[0, 0, 4.9])
    >>> left.project(point).round(3), right.project(point).round(3)
    (array([320. , 240.5]), array([310. , 240.5]))
    """
    uvs, points = _views(cameras, uvs), as_points(points_world, 3, "points_world")
    centre = np.mean([camera.centre for camera in cameras], axis=0)
    moved = np.full(points.shape[:-1], np.inf)
    for _ in range(steps):
        h = 1e-6 * np.linalg.norm(points - centre, axis=-1)[..., None, None]
        ahead, behind = (_images(cameras, points[..., None, :] + way * h * np.eye(3)) for way in (1, -1))
        residual = np.concatenate(list(uvs), axis=-1) - _images(cameras, points)
        step = _least_squares(np.swapaxes((ahead - behind) / (2 * h), -1, -2), residual)
        points, moved = points + step, 1e-6 * np.linalg.norm(step, axis=-1) / h[..., 0, 0]
    return np.where((moved < 1e-7)[..., None], points, np.nan)


def ray_distances(right_from_left: RigidTransform, rays_left: ArrayLike, rays_right: ArrayLike) -> Array:
    """Distances along two rays to where they come nearest to each other.

    Args:
        right_from_left: Between the two cameras' frames, in any unit of length.
        rays_left, rays_right: (..., 3), unit vectors, each in its own camera's frame.

    Returns:
        (..., 2), along the left and the right ray, in the transform's unit; negative behind a camera, inf or NaN for
        parallel rays.

    Raises: ValueError for another shape.
    Source: Szeliski (2022), section 11.2.4.

    A ray straight ahead, and one from 1 m to the right that leans by 45° to the left:

    >>> from camviz.poses import RigidTransform
    >>> ray_distances(RigidTransform.from_translation([-1, 0, 0]), [0, 0, 1], np.array([-1, 0, 1]) / 2**0.5)
    array([1.        , 1.41421356])
    """
    # Normal equations of  λ_right b − λ_left a = t  with a = R r_left, b = r_right
    a, b = rotate(right_from_left.rotation, rays_left), as_points(rays_right, 3, "rays_right")
    t, c = right_from_left.translation, np.sum(a * b, axis=-1)
    sine_squared = np.sum(np.cross(a, b) ** 2, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([c * (b @ t) - a @ t, b @ t - c * (a @ t)], axis=-1) / sine_squared[..., None]


def _views(cameras: Sequence[Camera], uvs: ArrayLike) -> Array:
    uvs = as_points(uvs, 2, "uvs")
    if len(cameras) < 2:
        raise ValueError(f"triangulation takes at least 2 cameras, got {len(cameras)}")
    if uvs.ndim < 2 or len(uvs) != len(cameras):
        raise ValueError(f"uvs must hold one array of pixels for each of {len(cameras)} cameras, got shape {uvs.shape}")
    if np.ptp([camera.centre for camera in cameras], axis=0).max() == 0:
        raise ValueError("the cameras stand in the same place: without a baseline there is no depth")
    return uvs


def _rays(cameras: Sequence[Camera], uvs: Array) -> Array:
    return np.stack([camera.unproject(uv) for camera, uv in zip(cameras, uvs, strict=True)], axis=-2)


def _images(cameras: Sequence[Camera], points: Array) -> Array:
    return np.concatenate([camera.project(points) for camera in cameras], axis=-1)


def _keep_in_front(cameras: Sequence[Camera], rays: Array, points: Array) -> Array:
    from_centres = points[..., None, :] - np.stack([camera.centre for camera in cameras])
    in_front = (np.sum(rays * from_centres, axis=-1) > 0).all(axis=-1)
    return np.where(in_front[..., None], points, np.nan)


def _least_squares(A: Array, b: Array) -> Array:
    """x (..., n) of least |A x - b|, A (..., m, n); NaN where A or b has one, or leaves a direction undetermined."""
    known = np.asarray(np.isfinite(A).all(axis=(-1, -2)) & np.isfinite(b).all(axis=-1))
    U, s, Vt = np.linalg.svd(np.where(known[..., None, None], A, 0), full_matrices=False)
    determined = known & (s[..., -1] > 1e-12 * s[..., 0])  # below this is rounding
    s = np.where(determined[..., None], s, np.nan)
    return np.squeeze(np.swapaxes(Vt, -1, -2) @ ((np.swapaxes(U, -1, -2) @ b[..., None]) / s[..., None]), axis=-1)
