"""Estimating two-view geometry from corresponding points: F, E, and the motion between the cameras."""

from __future__ import annotations

from math import ceil, log, log1p

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform, Rotation
from camviz.twoview.epipolar import sampson_distance, to_homogeneous
from camviz.twoview.triangulate import ray_distances


def eight_point(uv_left: ArrayLike, uv_right: ArrayLike, normalised: bool = True) -> Array:
    """F (3, 3) of 8 or more corresponding pixels (n, 2), of unit norm (Hartley & Zisserman 2004, algorithm 11.1).

    `normalised=False` leaves out Hartley's normalisation, to show what it is for. Pairs with a NaN are left out.
    Raises ValueError for fewer than 8 pairs, and where they leave F undetermined (all points on one plane, say).
    """
    uv_left, uv_right = _pairs(uv_left, uv_right)
    T_left, T_right = np.eye(3), np.eye(3)
    if normalised:
        T_left, T_right = normalising_transform(uv_left), normalising_transform(uv_right)
    F = linear_fundamental(_moved(T_left, uv_left), _moved(T_right, uv_right))
    return _scaled(T_right.T @ nearest_rank_two(F) @ T_left)


def linear_fundamental(uv_left: ArrayLike, uv_right: ArrayLike) -> Array:
    """The F (3, 3) of unit norm with the least Σ (x_rightᵀ F x_left)² over 8 or more pairs (n, 2) (section 11.1).

    Nothing makes its rank 2 yet: its epipolar lines do not quite meet. Raises ValueError as `eight_point`.
    """
    uv_left, uv_right = _pairs(uv_left, uv_right)
    x_left, x_right = to_homogeneous(uv_left), to_homogeneous(uv_right)
    A = (x_right[:, :, None] * x_left[:, None, :]).reshape(-1, 9)
    # A row of zeros changes nothing, and gives 8 pairs too a ninth singular vector.
    _, s, Vt = np.linalg.svd(np.concatenate([A, np.zeros((1, 9))]), full_matrices=False)
    if not s[7] > len(A) * np.finfo(float).eps * s[0]:
        raise ValueError("these points leave F undetermined: they coincide, or lie on one plane or critical surface")
    return _scaled(Vt[-1].reshape(3, 3))


def normalising_transform(uv: ArrayLike) -> Array:
    """T (3, 3) that takes the centroid of pixels (n, 2) to 0 and their mean distance from it to √2 (section 4.4.4)."""
    uv = as_points(uv, 2, "uv")
    centroid = uv.mean(axis=0)
    mean_distance = np.linalg.norm(uv - centroid, axis=1).mean()
    if not mean_distance > 0:
        raise ValueError(f"cannot normalise {len(uv)} points that coincide")
    s = np.sqrt(2) / mean_distance
    return np.array([[s, 0, -s * centroid[0]], [0, s, -s * centroid[1]], [0, 0, 1]])


def nearest_rank_two(F: ArrayLike) -> Array:
    """The matrix (3, 3) of rank 2 nearest to F in Frobenius norm: its smallest singular value set to 0."""
    U, s, Vt = np.linalg.svd(np.asarray(F, dtype=float))
    return U @ np.diag([s[0], s[1], 0]) @ Vt


def nearest_essential(E: ArrayLike) -> Array:
    """The essential matrix (3, 3) nearest to E: two equal singular values and a zero (section 11.7.3)."""
    U, s, Vt = np.linalg.svd(np.asarray(E, dtype=float))
    return U @ np.diag([(s[0] + s[1]) / 2, (s[0] + s[1]) / 2, 0]) @ Vt


def ransac_fundamental(
    uv_left: ArrayLike,
    uv_right: ArrayLike,
    threshold_px: float,
    rng: np.random.Generator,
    confidence: float = 0.999,
    max_samples: int = 5000,
) -> tuple[Array, np.ndarray]:
    """F (3, 3) of the pairs (n, 2) that agree on one, and the mask (n,) of those pairs (algorithm 11.4).

    A pair agrees when its Sampson distance is below `threshold_px` pixels. Samples of 8 pairs are drawn until one free
    of outliers has come with probability `confidence` (eq. 4.18). Raises ValueError where no 8 pairs agree.
    """
    uv_left, uv_right = as_points(uv_left, 2, "uv_left"), as_points(uv_right, 2, "uv_right")
    known = np.flatnonzero(np.isfinite(uv_left).all(axis=-1) & np.isfinite(uv_right).all(axis=-1))
    _pairs(uv_left, uv_right)
    best, needed, drawn = np.zeros(len(uv_left), dtype=bool), max_samples, 0
    while drawn < needed:
        drawn += 1
        inliers = _agreeing(uv_left, uv_right, rng.choice(known, 8, replace=False), threshold_px)
        if inliers.sum() > best.sum():
            best, needed = inliers, min(max_samples, _samples_needed(inliers.sum() / len(known), confidence))
    if best.sum() < 8:
        raise ValueError(f"no 8 of {len(known)} pairs agree on an epipolar geometry within {threshold_px} px")
    F = eight_point(uv_left[best], uv_right[best])
    return F, sampson_distance(F, uv_left, uv_right) < threshold_px


def _agreeing(uv_left: Array, uv_right: Array, sample: np.ndarray, threshold_px: float) -> np.ndarray:
    try:
        F = eight_point(uv_left[sample], uv_right[sample])
    except ValueError:  # a degenerate sample
        return np.zeros(len(uv_left), dtype=bool)
    return sampson_distance(F, uv_left, uv_right) < threshold_px


def _samples_needed(inlier_share: float, confidence: float) -> int:
    # N = log(1 − p) / log(1 − wˢ)   (eq. 4.18), s = 8
    return 1 if inlier_share == 1 else ceil(log(1 - confidence) / log1p(-(inlier_share**8)))


def decompose_essential(E: ArrayLike) -> list[RigidTransform]:
    """The four motions right_from_left = [R | t], |t| = 1, that have the essential matrix ±E (3, 3) (Result 9.19).

    E = U diag(1, 1, 0) Vᵀ: R is U W Vᵀ or U Wᵀ Vᵀ, t is the last column of U or its opposite. `recover_pose` chooses.
    """
    U, s, Vt = np.linalg.svd(np.asarray(E, dtype=float))
    if not s[1] > 0:
        raise ValueError(f"E must have two equal singular values and a zero, got {s.tolist()}")
    U, Vt = U * np.sign(np.linalg.det(U)), Vt * np.sign(np.linalg.det(Vt))
    W = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    rotations = [Rotation.from_matrix(U @ turn @ Vt) for turn in (W, W.T)]
    return [RigidTransform.from_components(t, R) for R in rotations for t in (U[:, 2], -U[:, 2])]


def recover_pose(E: ArrayLike, rays_left: ArrayLike, rays_right: ArrayLike) -> RigidTransform:
    """right_from_left with |t| = 1: of E's four motions, the one with most points in front of both cameras.

    `rays_left` and `rays_right` are corresponding unit rays (n, 3), each in its own camera's frame, through any lens:
    `camera.lens.unproject(camera.intrinsics.from_pixels(uv))`. Raises ValueError where two motions have equally many.
    """
    motions = decompose_essential(E)
    in_front = [(ray_distances(motion, rays_left, rays_right) > 0).all(axis=-1).sum() for motion in motions]
    runner_up, winner = np.argsort(in_front, kind="stable")[-2:]
    if in_front[winner] == in_front[runner_up]:
        raise ValueError(f"the points do not tell E's four motions apart: in front of both cameras lie {in_front}")
    return motions[winner]


def _pairs(uv_left: ArrayLike, uv_right: ArrayLike) -> tuple[Array, Array]:
    uv_left, uv_right = as_points(uv_left, 2, "uv_left"), as_points(uv_right, 2, "uv_right")
    if uv_left.ndim != 2 or uv_left.shape != uv_right.shape:
        raise ValueError(f"pairs take two arrays of one shape (n, 2), got {uv_left.shape} and {uv_right.shape}")
    known = np.isfinite(uv_left).all(axis=1) & np.isfinite(uv_right).all(axis=1)
    if known.sum() < 8:
        raise ValueError(f"the eight-point algorithm takes at least 8 pairs of points, got {known.sum()}")
    return uv_left[known], uv_right[known]


def _moved(T: Array, uv: Array) -> Array:
    return (to_homogeneous(uv) @ T.T)[:, :2]


def _scaled(F: Array) -> Array:
    # F is known up to scale; unit norm with its largest entry positive makes two estimates comparable.
    return F / np.linalg.norm(F) * np.sign(F.flat[np.abs(F).argmax()])
