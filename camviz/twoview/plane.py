"""The homography between a plane and its image, or between two images of the plane; and Hartley's normalisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, as_points
from camviz.twoview.epipolar import to_homogeneous

UNDETERMINED = 1e-10  # of the largest singular value: below this is rounding


def normalising_transform(uv: ArrayLike) -> Array:
    """The transform that takes the centroid of pixels to 0 and their mean distance from it to √2.

    Args:
        uv: (n, 2), in pixels.

    Returns: (3, 3). It acts on homogeneous pixels.
    Raises: ValueError for points that coincide, and another shape.
    Source: Hartley & Zisserman (2004), section 4.4.4.

    The corners of a square of 200 pixels lie 100 √2 from its middle:

    >>> normalising_transform([[0, 0], [200, 0], [200, 200], [0, 200]]).round(6)
    array([[ 0.01,  0.  , -1.  ],
           [ 0.  ,  0.01, -1.  ],
           [ 0.  ,  0.  ,  1.  ]])
    """
    uv = as_points(uv, 2, "uv")
    if uv.ndim != 2:
        raise ValueError(f"uv must have shape (n, 2), got {uv.shape}")
    centroid = uv.mean(axis=0)
    mean_distance = np.linalg.norm(uv - centroid, axis=1).mean()
    if not mean_distance > 0:
        raise ValueError(f"cannot normalise {len(uv)} points that coincide")
    s = np.sqrt(2) / mean_distance
    return np.array([[s, 0, -s * centroid[0]], [0, s, -s * centroid[1]], [0, 0, 1]])


def homography(xy: ArrayLike, uv: ArrayLike) -> Array:
    """The homography from points of a plane to pixels, by DLT on normalised coordinates: λ (u, v, 1)ᵀ = H (x, y, 1)ᵀ.

    Args:
        xy: (n, 2), points of the plane in any unit, or of another picture of it in pixels.
        uv: (n, 2), their pixels; a pair with a NaN is left out.

    Returns: (3, 3), H, with H[2, 2] = 1.
    Raises: ValueError for fewer than four points, or when they leave H undetermined.
    Source: Hartley & Zisserman (2004), algorithm 4.2.

    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> H = homography(square, 100 * square + [20, 30])
    >>> np.allclose(H, [[100, 0, 20], [0, 100, 30], [0, 0, 1]])
    True
    """
    xy, uv = _seen(xy, uv)
    T_plane, T_image = normalising_transform(xy), normalising_transform(uv)
    X = to_homogeneous(xy) @ T_plane.T
    u, v = ((to_homogeneous(uv) @ T_image.T)[:, :2]).T[..., None]
    # u (h₃·X) = h₁·X and v (h₃·X) = h₂·X: two rows of A for each point, and A h = 0.
    A = np.block([[X, 0 * X, -u * X], [0 * X, X, -v * X], [np.zeros((1, 9))]])  # 4 points too need a ninth row
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    if not s[7] > UNDETERMINED * s[0]:
        raise ValueError(f"{len(uv)} points leave the homography undetermined: all but one of them lie on a line")
    H = np.linalg.inv(T_image) @ Vt[-1].reshape(3, 3) @ T_plane
    return H / H[2, 2]


def _seen(xy: ArrayLike, uv: ArrayLike) -> tuple[Array, Array]:
    xy, uv = as_points(xy, 2, "xy"), as_points(uv, 2, "uv")
    if xy.shape != uv.shape or uv.ndim != 2:
        raise ValueError(f"a homography takes two arrays of one shape (n, 2), got {xy.shape} and {uv.shape}")
    known = np.isfinite(xy).all(axis=1) & np.isfinite(uv).all(axis=1)
    if known.sum() < 4:
        raise ValueError(f"a homography takes at least four points, got {known.sum()}")
    return xy[known], uv[known]
