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

from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.twoview import homography

__all__ = ["board_pose", "camera_matrix", "constraints", "focal_lengths", "homography"]

_UNDECIDED = 1e-10  # of the largest singular value: below this is rounding


def constraints(H: ArrayLike) -> Array:
    """What one homography says about b = (B₁₁, B₁₂, B₂₂, B₁₃, B₂₃, B₃₃), B = K⁻ᵀ K⁻¹: two rows (2, 6), rows · b = 0.

    h₁ᵀ B h₂ = 0, and h₁ᵀ B h₁ = h₂ᵀ B h₂ (Zhang's eq. 3, 4 and 8). With H[2, 2] = 1 a row weighs as much as its board
    is large in the image.
    """
    h1, h2, h3 = _matrix(H, "H").T
    h1, h2 = h1 / h3[2], h2 / h3[2]
    return np.stack([_products(h1, h2), _products(h1, h1) - _products(h2, h2)])


def camera_matrix(homographies: Sequence[ArrayLike], skew: bool = False) -> Array:
    """K (3, 3) of the one camera behind all these homographies: two of them, or three where `skew` is unknown too.

    Boards that are parallel count as one, and boards tilted about one and the same row or column leave K undetermined.
    Raises ValueError where there are too few, where they determine no K, or where no K fits them (with noise, nearly
    parallel boards).
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
    """(fx, fy) in pixels from one homography or more, where the principal point `centre` (2,) is known and skew is 0.

    Two unknowns, two constraints: one board is enough, if it is tilted about a slanting axis. Raises ValueError for one
    that faces the camera, or is tilted about a row or a column of the picture: that loses a constraint.
    """
    if not len(homographies):
        raise ValueError("homographies must hold at least one, got none")
    to_centre = np.eye(3)
    to_centre[:2, 2] = -np.asarray(centre, dtype=float)
    V = np.concatenate([constraints(to_centre @ _matrix(H, "H")) for H in homographies])
    b = _null_vector(V[:, [0, 2, 5]])  # B = diag(1/fx², 1/fy², 1), up to scale
    squared = b[2] / b[:2]
    if not (squared > 0).all():
        raise ValueError("these boards determine no focal length: they are hardly tilted, or the centre is wrong")
    return float(np.sqrt(squared[0])), float(np.sqrt(squared[1]))


def board_pose(H: ArrayLike, K: ArrayLike) -> RigidTransform:
    """cam_from_board of the board behind homography H (3, 3), in front of the camera (Zhang's section 3.1).

    K⁻¹ H = λ [r₁ r₂ t]; with noise r₁ and r₂ are not quite perpendicular, and the nearest rotation is taken.
    """
    M = np.linalg.solve(_matrix(K, "K"), _matrix(H, "H"))
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
            "these boards determine no camera matrix: they are parallel, and count as one, or tilted about one axis"
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
