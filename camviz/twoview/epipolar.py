"""Epipolar geometry: where a point of the left picture can appear in the right one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array, as_points, unit
from camviz.poses import RigidTransform


def to_homogeneous(uv: ArrayLike) -> Array:
    """Pixels (..., 2) as homogeneous points (..., 3) with last coordinate 1."""
    uv = as_points(uv, 2, "uv")
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)


def from_homogeneous(points: ArrayLike) -> Array:
    """Points (..., n) of homogeneous ones (..., n + 1); NaN for a point at infinity."""
    points = np.asarray(points, dtype=np.float64)
    # Beyond 1e12 units the last coordinate is rounding error: no float64 geometry tells that from infinity.
    finite = np.abs(points[..., -1:]) > 1e-12 * np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :-1] / np.where(finite, points[..., -1:], np.nan)


def cross_matrix(v: ArrayLike) -> Array:
    """[v]× (..., 3, 3) of vectors (..., 3), so that [v]× w = v × w (Hartley & Zisserman 2004, eq. A4.5)."""
    return np.cross(as_points(v, 3, "v")[..., None, :], np.eye(3)).swapaxes(-1, -2)


def projection_matrix(camera: Camera) -> Array:
    """P = K [R | t] (3, 4) of a perspective camera (eq. 6.8). Raises ValueError for a lens that bends."""
    if camera.lens.is_distorted:
        lens = type(camera.lens).__name__
        raise ValueError(f"only a Perspective lens keeps straight lines straight and has a matrix, got {lens}")
    return camera.intrinsics.K @ camera.cam_from_world.as_matrix()[:3]


def right_from_left(left: Camera, right: Camera) -> RigidTransform:
    """The transform [R | t] that takes points in the left camera's frame to the right one's."""
    return right.cam_from_world * left.world_from_cam


def essential(right_from_left: RigidTransform) -> Array:
    """E = [t]× R (3, 3): corresponding rays satisfy r_rightᵀ E r_left = 0 (section 9.6).

    Raises ValueError when t = 0: two cameras in one place see the same rays and no epipolar plane.
    """
    t = right_from_left.translation
    if not np.linalg.norm(t) > 0:
        raise ValueError("the two cameras stand in the same place: without a baseline there is no epipolar geometry")
    return cross_matrix(t) @ right_from_left.rotation.as_matrix()


def fundamental(left: Camera, right: Camera) -> Array:
    """F = K_right⁻ᵀ E K_left⁻¹ (3, 3): corresponding pixels satisfy x_rightᵀ F x_left = 0 (section 9.2).

    Raises ValueError for a lens that bends (see `epipolar_curve` for the others), or without a baseline.
    """
    for camera in (left, right):
        projection_matrix(camera)
    E = essential(right_from_left(left, right))
    return np.linalg.inv(right.intrinsics.K).T @ E @ np.linalg.inv(left.intrinsics.K)


def essential_from_fundamental(F: ArrayLike, left: Intrinsics, right: Intrinsics) -> Array:
    """E = K_rightᵀ F K_left (3, 3) (eq. 9.12)."""
    return right.K.T @ np.asarray(F, dtype=float) @ left.K


def epipoles(F: ArrayLike) -> tuple[Array, Array]:
    """The left and the right epipole as homogeneous unit vectors (3,): F e_left = 0 and Fᵀ e_right = 0.

    Each is the image of the other camera's centre. The last coordinate is 0 when that lies parallel to the image, as
    in a rectified pair; `from_homogeneous` gives the pixel, or NaN. Raises ValueError for an F of rank below 2.
    """
    # Counting in thousands of pixels makes the entries of F alike in size, which spares the epipoles rounding error.
    D = np.diag([1000.0, 1000.0, 1.0])
    U, s, Vt = np.linalg.svd(D @ np.asarray(F, dtype=float) @ D)
    if not s[1] > 1e-14 * s[0]:
        raise ValueError(f"F must have rank 2, got {np.asarray(F).tolist()}")
    return unit(D @ Vt[2]), unit(D @ U[:, 2])


def epipolar_lines(F: ArrayLike, uv_left: ArrayLike) -> Array:
    """Lines l = F x (..., 3) in the right image of left pixels (..., 2); `epipolar_lines(F.T, uv_right)` goes back.

    a u + b v + c = 0 with a² + b² = 1, so that (a, b, c) · (u, v, 1) is a distance in pixels. NaN at the epipole, which
    has every line, and where the line is at infinity.
    """
    lines = to_homogeneous(uv_left) @ np.asarray(F, dtype=float).T
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        lines = lines / np.linalg.norm(lines[..., :2], axis=-1, keepdims=True)
    return np.where(np.isfinite(lines).all(axis=-1, keepdims=True), lines, np.nan)


def clip_lines(lines: ArrayLike, intrinsics: Intrinsics) -> Array:
    """The part of each line (..., 3) inside the image, as two end pixels (..., 2, 2); NaN for a line that misses it."""
    a, b, c = np.moveaxis(as_points(lines, 3, "lines"), -1, 0)
    normal, along = np.stack([a, b], axis=-1), np.stack([-b, a], axis=-1)
    low, high = np.array([-0.5, -0.5]), np.array([intrinsics.width, intrinsics.height]) - 0.5
    middle = (low + high) / 2
    foot = middle - ((normal @ middle + c) / (a**2 + b**2))[..., None] * normal
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        s, t = (low - foot) / along, (high - foot) / along
    # 0/0: the line runs along the border itself, which is part of the image.
    s, t = np.where((along == 0) & np.isnan(s), -np.inf, s), np.where((along == 0) & np.isnan(t), np.inf, t)
    enter, leave = np.minimum(s, t).max(axis=-1), np.maximum(s, t).min(axis=-1)
    ends = np.where(enter <= leave, np.stack([enter, leave]), np.nan)
    return foot[..., None, :] + np.moveaxis(ends, 0, -1)[..., None] * along[..., None, :]


def epipolar_curve(left: Camera, right: Camera, uv_left: ArrayLike, distances: ArrayLike) -> Array:
    """Pixels (..., n, 2) in the right camera of the ray of left pixels (..., 2), sampled at `distances` (n,) in metres.

    Distances run along the ray from the left camera's centre; inf gives the ray's vanishing point. Holds under any
    lens: a straight ray is a straight line to a perspective camera and a curve to every other.
    """
    distances = np.asarray(distances, dtype=float)
    near = np.where(np.isfinite(distances), distances, 1.0)[:, None]
    at_infinity = np.isinf(distances)[:, None]
    rays = left.unproject(uv_left)[..., None, :]
    points = np.where(at_infinity, right.centre, left.centre) + near * rays
    return right.project(points)


def line_distance(lines: ArrayLike, uv: ArrayLike) -> Array:
    """Distances (...) in pixels of pixels (..., 2) from normalised lines (..., 3)."""
    return np.abs(np.sum(as_points(lines, 3, "lines") * to_homogeneous(uv), axis=-1))


def symmetric_distance(F: ArrayLike, uv_left: ArrayLike, uv_right: ArrayLike) -> Array:
    """√(d(x_right, F x_left)² + d(x_left, Fᵀ x_right)²) (...) in pixels (the root of each term of eq. 11.10)."""
    F = np.asarray(F, dtype=float)
    in_right = line_distance(epipolar_lines(F, uv_left), uv_right)
    in_left = line_distance(epipolar_lines(F.T, uv_right), uv_left)
    return np.hypot(in_left, in_right)


def sampson_distance(F: ArrayLike, uv_left: ArrayLike, uv_right: ArrayLike) -> Array:
    """How far (...) in pixels a pair must move, together and to first order, to satisfy F (root of a term of eq. 11.9).

    |x_rightᵀ F x_left| / √((F x_left)₁² + (F x_left)₂² + (Fᵀ x_right)₁² + (Fᵀ x_right)₂²).
    cv2.sampsonDistance returns the square of this.
    """
    F = np.asarray(F, dtype=float)
    x_left, x_right = to_homogeneous(uv_left), to_homogeneous(uv_right)
    line_right, line_left = x_left @ F.T, x_right @ F
    gradient = np.concatenate([line_right[..., :2], line_left[..., :2]], axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs(np.sum(x_right * line_right, axis=-1)) / np.linalg.norm(gradient, axis=-1)
