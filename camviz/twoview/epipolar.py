"""Epipolar geometry: where a point of the left picture can appear in the right one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.arrays import Homogeneous, LinesLike, MatrixLike, PixelsLike, RaysLike
from camviz.lenses.base import Array, as_points, unit
from camviz.poses import RigidTransform

ROUNDED = 1e-10  # of the terms of a sum: what is left of them is the rounding of F and of the epipole, by SVD too


def to_homogeneous(uv: PixelsLike) -> Homogeneous:
    """Pixels as homogeneous points, their last coordinate 1.

    >>> to_homogeneous([3, 4])
    array([3., 4., 1.])
    """
    uv = as_points(uv, 2, "uv")
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)


def from_homogeneous(points: ArrayLike) -> Array:
    """Points of homogeneous ones.

    Args:
        points: (..., n + 1), homogeneous, on any scale.

    Returns: (..., n), NaN for a point at infinity.

    >>> from_homogeneous([[6, 8, 2], [1, 0, 0]])
    array([[ 3.,  4.],
           [nan, nan]])
    """
    points = np.asarray(points, dtype=np.float64)
    # Beyond 1e12 units the last coordinate is rounding error: no float64 geometry tells that from infinity.
    finite = np.abs(points[..., -1:]) > 1e-12 * np.linalg.norm(points, axis=-1, keepdims=True)
    return points[..., :-1] / np.where(finite, points[..., -1:], np.nan)


def as_matrix(values: ArrayLike, name: str) -> Array:
    """A matrix (3, 3) as float64. ValueError for another shape."""
    matrix = np.asarray(values, dtype=float)
    if matrix.shape != (3, 3):
        raise ValueError(f"{name} must have shape (3, 3), got {matrix.shape}")
    return matrix


def singular_values(values: ArrayLike, name: str) -> tuple[Array, Array, Array]:
    """U, s and Vᵀ of a matrix (3, 3). ValueError for another shape, and for numbers that are not finite."""
    matrix = as_matrix(values, name)
    if not np.isfinite(matrix).all():
        raise ValueError(f"{name} must hold finite numbers, got {matrix.tolist()}")
    U, s, Vt = np.linalg.svd(matrix)
    return U, s, Vt


def cross_matrix(v: RaysLike) -> Array:
    """The matrix [v]× of a vector, so that [v]× w = v × w.

    Returns: (..., 3, 3), antisymmetric.
    Source: Hartley & Zisserman (2004), eq. A4.5.

    >>> cross_matrix((1, 2, 3))
    array([[ 0., -3.,  2.],
           [ 3.,  0., -1.],
           [-2.,  1.,  0.]])
    """
    return np.cross(as_points(v, 3, "v")[..., None, :], np.eye(3)).swapaxes(-1, -2)


def projection_matrix(camera: Camera) -> Array:
    """The matrix P = K [R | t] of a perspective camera.

    Returns: (3, 4), from homogeneous world points in metres to homogeneous pixels.
    Raises: ValueError for a lens that bends.
    Source: Hartley & Zisserman (2004), eq. 6.8.

    >>> from camviz.cameras import Camera, Intrinsics, look_at
    >>> camera = Camera(Intrinsics(640, 480, 500, 500, 320, 240), world_from_cam=look_at((0, 0, -2), (0, 0, 0)))
    >>> projection_matrix(camera)
    array([[500.,   0., 320., 640.],
           [  0., 500., 240., 480.],
           [  0.,   0.,   1.,   2.]])
    """
    if camera.lens.is_distorted:
        lens = type(camera.lens).__name__
        raise ValueError(f"only a Perspective lens keeps straight lines straight and has a matrix, got {lens}")
    return camera.intrinsics.K @ camera.cam_from_world.as_matrix()[:3]


def right_from_left(left: Camera, right: Camera) -> RigidTransform:
    """The transform [R | t] that takes points in the left camera's frame to the right one's.

    Args:
        left, right: With any lenses.

    Returns: t in metres: where the left camera stands as the right one sees it.

    >>> from camviz.cameras import Camera, Intrinsics, look_at
    >>> left = Camera(Intrinsics.from_fov(640, 480, 60))
    >>> right_from_left(left, left.at(look_at((0.1, 0, 0), (0.1, 0, 1)))).translation  # from 0.1 m to the right of it
    array([-0.1,  0. ,  0. ])
    """
    return right.cam_from_world * left.world_from_cam


def essential(right_from_left: RigidTransform) -> Array:
    """The essential matrix E = [t]× R: corresponding rays satisfy r_rightᵀ E r_left = 0.

    Args:
        right_from_left: [R | t], in any unit of length.

    Returns: (3, 3), on the scale of t.
    Raises: ValueError when t = 0: two cameras in one place see the same rays and no epipolar plane.
    Source: Hartley & Zisserman (2004), section 9.6.

    Cameras side by side see a point in the same row, y_right = y_left:

    >>> from camviz.poses import RigidTransform
    >>> essential(RigidTransform.from_translation([-1, 0, 0]))
    array([[ 0.,  0.,  0.],
           [ 0.,  0.,  1.],
           [ 0., -1.,  0.]])
    """
    t = right_from_left.translation
    if not np.linalg.norm(t) > 0:
        raise ValueError("the two cameras stand in the same place: without a baseline there is no epipolar geometry")
    return cross_matrix(t) @ right_from_left.rotation.as_matrix()


def fundamental(left: Camera, right: Camera) -> Array:
    """The fundamental matrix F = K_right⁻ᵀ E K_left⁻¹: corresponding pixels satisfy x_rightᵀ F x_left = 0.

    Args:
        left, right: With perspective lenses; `epipolar_curve` is for the others.

    Returns: (3, 3), of rank 2, on the scale of t over pixels².
    Raises: ValueError for a lens that bends, or without a baseline.
    Source: Hartley & Zisserman (2004), section 9.2.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.poses import RigidTransform
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_translation([0.1, 0, 0]))
    >>> points = [[0, 0, 2], [1, -0.5, 4]]
    >>> x_left, x_right = to_homogeneous(left.project(points)), to_homogeneous(right.project(points))
    >>> np.sum(x_right * (x_left @ fundamental(left, right).T), axis=-1).round(12) + 0
    array([0., 0.])
    """
    for camera in (left, right):
        projection_matrix(camera)
    E = essential(right_from_left(left, right))
    return np.linalg.inv(right.intrinsics.K).T @ E @ np.linalg.inv(left.intrinsics.K)


def essential_from_fundamental(F: MatrixLike, left: Intrinsics, right: Intrinsics) -> Array:
    """The essential matrix of a fundamental one: E = K_rightᵀ F K_left.

    Args:
        left, right: Of the two cameras.

    Returns: (3, 3), on the scale of F.
    Source: Hartley & Zisserman (2004), eq. 9.12.

    >>> from camviz.cameras import Intrinsics
    >>> grid = Intrinsics(640, 480, 500, 500, 320, 240)
    >>> essential_from_fundamental([[0, 0, 0], [0, 0, 1], [0, -1, 0]], grid, grid)  # of a rectified pair
    array([[   0.,    0.,    0.],
           [   0.,    0.,  500.],
           [   0., -500.,    0.]])
    """
    return right.K.T @ as_matrix(F, "F") @ left.K


def epipoles(F: MatrixLike) -> tuple[Array, Array]:
    """The left and the right epipole, each the image of the other camera's centre: F e_left = 0 and Fᵀ e_right = 0.

    Returns:
        left: (3,), a homogeneous unit vector; `from_homogeneous` gives the pixel. Its last coordinate is 0 where the
            other camera lies parallel to the image, as in a rectified pair.
        right: (3,), likewise.

    Raises: ValueError for an F of rank below 2, or of another shape.
    Source: Hartley & Zisserman (2004), section 9.2.

    A camera that moves straight ahead, F = [e]×, sees where it goes in the middle of its picture:

    >>> from_homogeneous(epipoles(cross_matrix((320, 240, 1)))[0]).round(6)
    array([320., 240.])
    """
    # Counting in thousands of pixels makes the entries of F alike in size, which spares the epipoles rounding error.
    D = np.diag([1000.0, 1000.0, 1.0])
    U, s, Vt = singular_values(D @ as_matrix(F, "F") @ D, "F")
    if not s[1] > 1e-14 * s[0]:
        raise ValueError(f"F must have rank 2, got {np.asarray(F).tolist()}")
    return unit(D @ Vt[2]), unit(D @ U[:, 2])


def epipolar_lines(F: MatrixLike, uv_left: PixelsLike) -> Array:
    """Lines l = F x in the right image, on which the partners of left pixels lie.

    `epipolar_lines(F.T, uv_right)` goes back.

    Returns:
        (..., 3), a u + b v + c = 0 with a² + b² = 1, so that (a, b, c) · (u, v, 1) is a distance in pixels. NaN at the
        epipole, which has every line, and where the line is at infinity.

    Source: Hartley & Zisserman (2004), section 9.2.

    In a rectified pair it is the row v = 50:

    >>> epipolar_lines([[0, 0, 0], [0, 0, 1], [0, -1, 0]], [100, 50])
    array([  0.,   1., -50.])
    """
    F, x = as_matrix(F, "F"), to_homogeneous(uv_left)
    lines = x @ F.T
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        lines = lines / np.where(_vanish(lines, F, x), np.nan, np.linalg.norm(lines[..., :2], axis=-1))[..., None]
    return np.where(np.isfinite(lines).all(axis=-1, keepdims=True), lines, np.nan)


def _vanish(lines: Array, F: Array, x: Array) -> np.ndarray:
    """Where the direction of the lines F x (..., 3) is rounding alone: x is the epipole."""
    terms = np.abs(x) @ np.abs(F).T
    return np.asarray(np.abs(lines[..., :2]).max(axis=-1) <= ROUNDED * terms[..., :2].max(axis=-1))


def clip_lines(lines: LinesLike, intrinsics: Intrinsics) -> Array:
    """The part of each line inside the image.

    Returns: (..., 2, 2), two end pixels, on the image's border; NaN for a line that misses the image.

    >>> from camviz.cameras import Intrinsics
    >>> clip_lines([0, 1, -50], Intrinsics(640, 480, 500, 500, 320, 240)).tolist()  # the row v = 50
    [[639.5, 50.0], [-0.5, 50.0]]
    """
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


def epipolar_curve(left: Camera, right: Camera, uv_left: PixelsLike, distances: ArrayLike) -> Array:
    """Where the ray of a left pixel runs in the right picture, under any lens.

    A straight ray is a straight line to a perspective camera and a curve to every other.

    Args:
        left, right: With any lenses.
        distances: (n,), in metres, along the ray from the left camera's centre; inf gives the ray's vanishing point.

    Returns: (..., n, 2), in pixels; NaN where the right camera has no image of it.
    Raises: ValueError for another shape.

    The disparity of points straight ahead is f B / Z, 50 and 25 pixels, and 0 at infinity:

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.poses import RigidTransform
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_translation([0.1, 0, 0]))
    >>> epipolar_curve(left, right, [320, 240], [1, 2, np.inf])
    array([[270., 240.],
           [295., 240.],
           [320., 240.]])
    """
    distances = np.asarray(distances, dtype=float)
    if distances.ndim != 1:
        raise ValueError(f"distances must have shape (n,), got {distances.shape}")
    near = np.where(np.isfinite(distances), distances, 1.0)[:, None]
    at_infinity = np.isinf(distances)[:, None]
    rays = left.unproject(uv_left)[..., None, :]
    points = np.where(at_infinity, right.centre, left.centre) + near * rays
    return right.project(points)


def line_distance(lines: LinesLike, uv: PixelsLike) -> Array:
    """Distances of pixels from lines.

    Returns: (...), in pixels, not negative.

    >>> line_distance([0.6, 0.8, -5], [10, 5])  # 6 + 4 - 5
    np.float64(5.0)
    """
    return np.abs(np.sum(as_points(lines, 3, "lines") * to_homogeneous(uv), axis=-1))


def symmetric_distance(F: MatrixLike, uv_left: PixelsLike, uv_right: PixelsLike) -> Array:
    """How far pixels lie from each other's epipolar lines: √(d(x_right, F x_left)² + d(x_left, Fᵀ x_right)²).

    Returns: (...), in pixels.
    Source: Hartley & Zisserman (2004), eq. 11.10, of which it is the root of each term.

    In a rectified pair, rows that differ by 3 pixels do so in both pictures:

    >>> symmetric_distance([[0, 0, 0], [0, 0, 1], [0, -1, 0]], [100, 50], [90, 53]).round(3)  # 3 √2
    np.float64(4.243)
    """
    F = as_matrix(F, "F")
    in_right = line_distance(epipolar_lines(F, uv_left), uv_right)
    in_left = line_distance(epipolar_lines(F.T, uv_right), uv_left)
    return np.hypot(in_left, in_right)


def sampson_distance(F: MatrixLike, uv_left: PixelsLike, uv_right: PixelsLike) -> Array:
    """How far a pair of pixels must move, together and to first order, to satisfy F.

    abs(x_rightᵀ F x_left) / √((F x_left)₁² + (F x_left)₂² + (Fᵀ x_right)₁² + (Fᵀ x_right)₂²).
    cv2.sampsonDistance returns the square of this.

    Returns: (...), in pixels; 0 for the two epipoles, which satisfy F with every partner.
    Source: Hartley & Zisserman (2004), eq. 11.9, of which it is the root of a term.

    In a rectified pair, rows that differ by 3 pixels meet when each moves by 1.5:

    >>> sampson_distance([[0, 0, 0], [0, 0, 1], [0, -1, 0]], [100, 50], [90, 53]).round(3)  # 1.5 √2
    np.float64(2.121)
    """
    F = as_matrix(F, "F")
    x_left, x_right = to_homogeneous(uv_left), to_homogeneous(uv_right)
    line_right, line_left = x_left @ F.T, x_right @ F
    gradient = np.concatenate([line_right[..., :2], line_left[..., :2]], axis=-1)
    epipoles = _vanish(line_right, F, x_left) & _vanish(line_left, F.T, x_right)
    with np.errstate(invalid="ignore", divide="ignore"):
        distance = np.abs(np.sum(x_right * line_right, axis=-1)) / np.linalg.norm(gradient, axis=-1)
    return np.where(epipoles, 0.0, distance)[()]
