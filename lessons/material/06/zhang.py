"""Zhang's closed form: a camera matrix from the homographies of a flat board, and the board's poses.

The board lies in its own plane z = 0 (metres), so that its points (x, y) reach the pixels (u, v) through a homography,
λ (u, v, 1)ᵀ = H (x, y, 1)ᵀ with H = K [r₁ r₂ t]. K follows from r₁ and r₂ being perpendicular and of one length. After
Z. Zhang, *A flexible new technique for camera calibration*, IEEE PAMI 22 (2000), section 3; the homography after
Hartley & Zisserman (2004), algorithm 4.2. Distortion is left to a later refinement.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, as_point
from camviz.poses import RigidTransform, Rotation
from camviz.twoview import homography

__all__ = ["board_pose", "camera_matrix", "constraints", "focal_lengths", "homography"]

_UNDECIDED = 1e-10  # of the largest singular value: below this is rounding


def constraints(H: ArrayLike) -> Array:
    """What one homography says about B = K⁻ᵀ K⁻¹: rows with rows · b = 0 for b = (B₁₁, B₁₂, B₂₂, B₁₃, B₂₃, B₃₃).

    h₁ᵀ B h₂ = 0, and h₁ᵀ B h₁ = h₂ᵀ B h₂. With H[2, 2] = 1 a row weighs as much as its board is large in the image.

    Args:
        H: (3, 3), from the board's plane in metres to pixels.

    Returns: (2, 6), the two rows.
    Raises: ValueError for a matrix of another shape, or with a number that is not finite.
    Source: Z. Zhang, *A flexible new technique for camera calibration*, IEEE PAMI 22 (2000), eq. 3, 4 and 8.

    >>> from camviz.poses import Rotation
    >>> R = Rotation.from_rotvec([0.5, 0.2, 0]).as_matrix()
    >>> H = np.column_stack([R[:, :2], (0, 0, 1)])  # seen by a camera of K = 1, so that B = 1
    >>> np.abs(constraints(H) @ [1, 0, 1, 0, 0, 1]).max() < 1e-12
    np.True_
    """
    h1, h2, h3 = _matrix(H, "H").T
    h1, h2 = h1 / h3[2], h2 / h3[2]
    return np.stack([_products(h1, h2), _products(h1, h1) - _products(h2, h2)])


def camera_matrix(homographies: Sequence[ArrayLike], skew: bool = False) -> Array:
    """The one camera matrix behind all these homographies, in closed form and without distortion.

    Parallel boards count as one. Two that tilt about the same row or column, or mirror each other, do not determine K.

    Args:
        homographies: sequence of (3, 3), from the board's plane in metres to pixels: at least two, or three where skew
            is unknown too.
        skew: Solve for skew as well; otherwise it is 0.

    Returns: (3, 3), K in pixels, with K[2, 2] = 1.

    Raises:
        ValueError: For too few homographies, for those that determine no K, or where no K fits them (with noise, nearly
            parallel boards).

    Source: Z. Zhang, *A flexible new technique for camera calibration*, IEEE PAMI 22 (2000), section 3.1.

    >>> from camviz.poses import Rotation
    >>> K = np.array([[500, 0, 320], [0, 510, 240], [0, 0, 1]])
    >>> turns = Rotation.from_rotvec([[0.5, 0.1, 0], [0.1, -0.6, 0.2]])  # of two boards, 1 m away
    >>> H = [K @ np.column_stack([R[:, :2], (0, 0, 1)]) for R in turns.as_matrix()]
    >>> np.allclose(camera_matrix(H), K)
    True
    """
    needed = 3 if skew else 2
    if len(homographies) < needed:
        raise ValueError(f"homographies must be at least {needed} with skew={skew}, got {len(homographies)}")
    V = np.concatenate([constraints(H) for H in homographies])
    b = np.zeros(6)
    unknown = np.array([0, 1, 2, 3, 4, 5] if skew else [0, 2, 3, 4, 5])  # without skew B₁₂ = 0
    b[unknown] = _null_vector(V[:, unknown])
    B = b[[0, 1, 3, 1, 2, 4, 3, 4, 5]].reshape(3, 3)
    return _factor(B * np.sign(B[0, 0]))


def focal_lengths(homographies: Sequence[ArrayLike], centre: ArrayLike) -> tuple[float, float]:
    """The focal lengths, where the principal point is known and skew is 0.

    Two unknowns, two constraints: one board is enough, if it is tilted about a slanting axis. One that faces the
    camera, or is tilted about a row or a column of the picture, loses a constraint.

    Args:
        homographies: sequence of (3, 3), from the board's plane in metres to pixels: one or more.
        centre: (2,), the principal point in pixels.

    Returns:
        fx: In pixels.
        fy: In pixels.

    Raises: ValueError without a homography, where they determine no focal length, and for a centre of another shape.
    Source: Z. Zhang, *A flexible new technique for camera calibration*, IEEE PAMI 22 (2000), section 3.1.

    >>> from camviz.poses import Rotation
    >>> R = Rotation.from_rotvec([0.5, 0.3, 0]).as_matrix()  # about a slanting axis
    >>> H = [[500, 0, 320], [0, 510, 240], [0, 0, 1]] @ np.column_stack([R[:, :2], (0, 0, 1)])
    >>> np.round(focal_lengths([H], centre=(320, 240)), 6)
    array([500., 510.])
    """
    if not len(homographies):
        raise ValueError("homographies must hold at least one, got none")
    to_centre = np.eye(3)
    to_centre[:2, 2] = -as_point(centre, "centre", 2)
    V = np.concatenate([constraints(to_centre @ _matrix(H, "H")) for H in homographies])
    b = _null_vector(V[:, [0, 2, 5]])  # B = diag(1/fx², 1/fy², 1), up to scale
    squared = b[2] / b[:2]
    if not (squared > 0).all():
        raise ValueError("these boards determine no focal length: they are hardly tilted, or the centre is wrong")
    return float(np.sqrt(squared[0])), float(np.sqrt(squared[1]))


def board_pose(H: ArrayLike, K: ArrayLike) -> RigidTransform:
    """The pose of the board behind a homography, in front of the camera.

    K⁻¹ H = λ [r₁ r₂ t]; with noise r₁ and r₂ are not quite perpendicular, and the nearest rotation is taken.

    Args:
        H: (3, 3), from the board's plane in metres to pixels.
        K: (3, 3), the camera matrix in pixels.

    Returns: cam_from_board, in metres.
    Raises: ValueError for a matrix of another shape, with a number that is not finite, and for a K without an inverse.
    Source: Z. Zhang, *A flexible new technique for camera calibration*, IEEE PAMI 22 (2000), section 3.1.

    >>> K = np.array([[500, 0, 320], [0, 500, 240], [0, 0, 1]])
    >>> H = K @ [[1, 0, 0.1], [0, 1, 0], [0, 0, 2]]  # it faces the camera, 2 m away and 0.1 m to the right
    >>> board_pose(H, K).translation.round(6)
    array([0.1, 0. , 2. ])
    """
    K = _matrix(K, "K")
    if not np.linalg.matrix_rank(K) == 3:
        raise ValueError(f"K must be a camera matrix, which has an inverse, got {K.tolist()}")
    M = np.linalg.solve(K, _matrix(H, "H"))
    M *= np.sign(M[2, 2]) / np.sqrt(np.linalg.norm(M[:, 0]) * np.linalg.norm(M[:, 1]))
    U, _, Vt = np.linalg.svd(np.column_stack([M[:, 0], M[:, 1], np.cross(M[:, 0], M[:, 1])]))
    return RigidTransform.from_components(M[:, 2], Rotation.from_matrix(U @ Vt))


def _products(a: Array, b: Array) -> Array:
    """v (6,) with aᵀ B b = v · (B₁₁, B₁₂, B₂₂, B₁₃, B₂₃, B₃₃) for every symmetric B."""
    return np.array(
        [
            a[0] * b[0],
            a[0] * b[1] + a[1] * b[0],
            a[1] * b[1],
            a[2] * b[0] + a[0] * b[2],
            a[2] * b[1] + a[1] * b[2],
            a[2] * b[2],
        ]
    )


def _null_vector(V: Array) -> Array:
    """The b with the least |V b|, its entries brought to one size first. ValueError where more than one b has it."""
    size = np.linalg.norm(V, axis=0)
    if not (size > 0).all():
        raise ValueError("these boards determine no camera matrix: they face the camera squarely")
    _, s, Vt = np.linalg.svd(np.vstack([V / size, np.zeros(len(size))]), full_matrices=False)
    if not s[-2] > _UNDECIDED * s[0]:
        raise ValueError(
            "these boards determine no camera matrix: they are parallel, mirrored, or tilt about one row or column"
        )
    return Vt[-1] / size


def _factor(B: Array) -> Array:
    """K with K[2, 2] = 1 of B ~ K⁻ᵀ K⁻¹, which is B's Cholesky factor upside down."""
    try:
        K = np.linalg.inv(np.linalg.cholesky(B).T)
    except np.linalg.LinAlgError as error:
        raise ValueError("no camera matrix fits these homographies: are the boards nearly parallel?") from error
    return K / K[2, 2]


def _matrix(M: ArrayLike, name: str) -> Array:
    M = np.asarray(M, dtype=float)
    if M.shape != (3, 3) or not np.isfinite(M).all():
        raise ValueError(f"{name} must be a finite matrix of shape (3, 3), got {M.tolist()}")
    return M
