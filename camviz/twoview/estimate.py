"""Estimating two-view geometry from corresponding points: F, E, and the motion between the cameras."""

from __future__ import annotations

from math import ceil, log, log1p

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses.arrays import MatrixLike, PixelLength, Share
from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform, Rotation
from camviz.twoview.epipolar import sampson_distance, singular_values, to_homogeneous
from camviz.twoview.plane import homography, normalising_transform
from camviz.twoview.triangulation import ray_distances

ENOUGH = 16  # pairs, before a plane can be told from its noise
PLAIN = 1.75  # times as much unexplained: below, of 2,000 random scenes 3 to 6 m deep 12 are refused, of planes 1,898


def eight_point(uv_left: ArrayLike, uv_right: ArrayLike, normalised: bool = True) -> Array:
    """The fundamental matrix of 8 or more pairs of pixels, by the eight-point algorithm.

    Args:
        uv_left, uv_right: (n, 2), corresponding pixels; pairs with a NaN are left out.
        normalised: False leaves out Hartley's normalisation, to show what it is for.

    Returns: (3, 3), of rank 2 and unit norm, its largest entry positive.

    Raises:
        ValueError: For fewer than 8 pairs, and where they leave F undetermined: all points on one plane, say. Of noisy
            pairs that is told from 16 on, and where they are normalised.

    Source: Hartley & Zisserman (2004), algorithm 11.1; degenerate pairs: section 11.9.

    Without noise it satisfies every pair:

    >>> from camviz.poses import RigidTransform, Rotation
    >>> from camviz import Camera, Intrinsics
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_components([0.5, 0.1, 0], Rotation.from_rotvec([0, -0.1, 0])))
    >>> points = np.random.default_rng(0).uniform((-1, -1, 3), (1, 1, 6), (20, 3))
    >>> x, y = left.project(points), right.project(points)
    >>> float(sampson_distance(eight_point(x, y), x, y).max().round(6))
    0.0
    """
    uv_left, uv_right = _pairs(uv_left, uv_right)
    T_left, T_right = np.eye(3), np.eye(3)
    if normalised:
        T_left, T_right = normalising_transform(uv_left), normalising_transform(uv_right)
    F = linear_fundamental(_moved(T_left, uv_left), _moved(T_right, uv_right))
    F = _scaled(T_right.T @ nearest_rank_two(F) @ T_left)
    if normalised and len(uv_left) >= ENOUGH and _lie_on_a_plane(uv_left, uv_right, F):
        raise ValueError(
            f"these {len(uv_left)} points leave F undetermined: a homography explains them as well as F does, "
            "so they lie on one plane, or the camera has only turned"
        )
    return F


def _lie_on_a_plane(uv_left: Array, uv_right: Array, F: Array) -> bool:
    """Whether a homography, with its 2n - 8 degrees of freedom, fits hardly worse than F with its n - 8."""
    n = len(uv_left)
    off_lines = np.sum(sampson_distance(F, uv_left, uv_right) ** 2) / (n - 8)
    x, y, w = homography(uv_left, uv_right) @ to_homogeneous(uv_left).T
    off_points = np.sum((np.stack([x / w, y / w], axis=-1) - uv_right) ** 2) / 2 / (2 * n - 8)  # noise of both pictures
    return bool(off_points < PLAIN * off_lines)


def linear_fundamental(uv_left: ArrayLike, uv_right: ArrayLike) -> Array:
    """The F with the least Σ (x_rightᵀ F x_left)².

    Nothing makes its rank 2 yet: its epipolar lines do not quite meet.

    Args:
        uv_left, uv_right: (n, 2), 8 or more pairs of corresponding pixels; pairs with a NaN are left out.

    Returns: (3, 3), of unit norm, its largest entry positive.
    Raises: ValueError for fewer than 8 pairs, and where they leave F undetermined.
    Source: Hartley & Zisserman (2004), section 11.1.

    Of pixels that are off by half a pixel it has rank 3:

    >>> rng = np.random.default_rng(0)
    >>> left = rng.uniform(0, 500, (20, 2))
    >>> right = left + np.c_[rng.uniform(-50, 0, 20), rng.normal(0, 0.5, 20)]
    >>> bool(np.linalg.svd(linear_fundamental(left, right))[1][2] > 1e-9)
    True
    """
    uv_left, uv_right = _pairs(uv_left, uv_right)
    x_left, x_right = to_homogeneous(uv_left), to_homogeneous(uv_right)
    A = (x_right[:, :, None] * x_left[:, None, :]).reshape(-1, 9)
    # A row of zeros changes nothing, and gives 8 pairs too a ninth singular vector.
    _, s, Vt = np.linalg.svd(np.concatenate([A, np.zeros((1, 9))]), full_matrices=False)
    if not s[7] > len(A) * np.finfo(float).eps * s[0]:
        raise ValueError("these points leave F undetermined: they coincide, or lie on one plane or critical surface")
    return _scaled(Vt[-1].reshape(3, 3))


def nearest_rank_two(F: MatrixLike) -> Array:
    """The matrix of rank 2 nearest to F in Frobenius norm: its smallest singular value set to 0.

    Returns: (3, 3), a fundamental matrix, on the scale of F.
    Raises: ValueError for another shape, and numbers that are not finite.
    Source: Hartley & Zisserman (2004), section 11.1.1.

    >>> nearest_rank_two(np.diag([3, 2, 1])).diagonal().round(9)
    array([3., 2., 0.])
    """
    U, s, Vt = singular_values(F, "F")
    return U @ np.diag([s[0], s[1], 0]) @ Vt


def nearest_essential(E: MatrixLike) -> Array:
    """The essential matrix nearest to E in Frobenius norm: two equal singular values and a zero.

    Returns: (3, 3), an essential matrix, on the scale of E.
    Raises: ValueError for another shape, and numbers that are not finite.
    Source: Hartley & Zisserman (2004), section 11.7.3.

    >>> nearest_essential(np.diag([2, 1, 0.1])).diagonal().round(9)
    array([1.5, 1.5, 0. ])
    """
    U, s, Vt = singular_values(E, "E")
    return U @ np.diag([(s[0] + s[1]) / 2, (s[0] + s[1]) / 2, 0]) @ Vt


def ransac_fundamental(
    uv_left: ArrayLike,
    uv_right: ArrayLike,
    threshold_px: PixelLength,
    rng: np.random.Generator,
    confidence: Share = 0.999,
    max_samples: int = 5000,
) -> tuple[Array, np.ndarray]:
    """The fundamental matrix of the pairs that agree on one, and which these are.

    A pair agrees when its Sampson distance is below the threshold. Samples of 8 pairs are drawn until one free of
    outliers has come with a probability of `confidence`.

    Args:
        uv_left, uv_right: (n, 2), pairs in pixels, some of them wrong; a pair with a NaN agrees with none.
        max_samples: The most samples.

    Returns:
        F: (3, 3), of unit norm, fitted to all pairs that agreed with the best sample.
        agrees: (n,), True for pairs that agree with F.

    Raises: ValueError where no 8 pairs agree, and for a confidence outside (0, 1).
    Source: Hartley & Zisserman (2004), algorithm 11.4 and eq. 4.18.

    Of 20 pairs the first 5 are off by 30 pixels:

    >>> from camviz.poses import RigidTransform, Rotation
    >>> from camviz import Camera, Intrinsics
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> right = left.at(RigidTransform.from_components([0.5, 0.1, 0], Rotation.from_rotvec([0, -0.1, 0])))
    >>> points = np.random.default_rng(0).uniform((-1, -1, 3), (1, 1, 6), (20, 3))
    >>> matched = right.project(points) + np.where(np.arange(20) < 5, 30, 0)[:, None]
    >>> F, agrees = ransac_fundamental(left.project(points), matched, 1.0, np.random.default_rng(1))
    >>> np.flatnonzero(~agrees)
    array([0, 1, 2, 3, 4])
    """
    if not 0 < confidence < 1:
        raise ValueError(f"confidence must lie between 0 and 1, got {confidence}")
    _pairs(uv_left, uv_right)
    uv_left, uv_right = np.asarray(uv_left, dtype=float), np.asarray(uv_right, dtype=float)
    known = np.flatnonzero(np.isfinite(uv_left).all(axis=-1) & np.isfinite(uv_right).all(axis=-1))
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


def decompose_essential(E: MatrixLike) -> list[RigidTransform]:
    """The four motions that have the essential matrix ±E.

    E = U diag(1, 1, 0) Vᵀ: R is U W Vᵀ or U Wᵀ Vᵀ, t is the last column of U or its opposite. `recover_pose` chooses.

    Returns: right_from_left = [R | t] with ‖t‖ = 1.
    Raises: ValueError where E has not two singular values above zero.
    Source: Hartley & Zisserman (2004), result 9.19.

    A step to the right, to the left, and both with half a turn about the baseline:

    >>> from camviz.poses import RigidTransform
    >>> motions = decompose_essential(essential(RigidTransform.from_translation([-1, 0, 0])))
    >>> sorted((float(each.translation[0].round()), float(each.rotation.magnitude().round(2))) for each in motions)
    [(-1.0, 0.0), (-1.0, 3.14), (1.0, 0.0), (1.0, 3.14)]
    """
    U, s, Vt = singular_values(E, "E")
    if not s[1] > 0:
        raise ValueError(f"E must have two equal singular values and a zero, got {s.tolist()}")
    U, Vt = U * np.sign(np.linalg.det(U)), Vt * np.sign(np.linalg.det(Vt))
    W = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    rotations = [Rotation.from_matrix(U @ turn @ Vt) for turn in (W, W.T)]
    return [RigidTransform.from_components(t, R) for R in rotations for t in (U[:, 2], -U[:, 2])]


def recover_pose(E: MatrixLike, rays_left: ArrayLike, rays_right: ArrayLike) -> RigidTransform:
    """Of E's four motions, the one with most points in front of both cameras.

    Args:
        rays_left, rays_right: (n, 3), corresponding unit rays, each in its own camera's frame, through any lens:
            `camera.lens.unproject(camera.intrinsics.from_pixels(uv))`.

    Returns: right_from_left with ‖t‖ = 1.
    Raises: ValueError where two motions have equally many.
    Source: Hartley & Zisserman (2004), section 9.6.3.

    >>> from camviz.poses import RigidTransform
    >>> points, step = np.array([[0, 0, 4], [1, 0, 5], [0, 1, 3.0]]), np.array([-1, 0, 0])
    >>> rays = [seen / np.linalg.norm(seen, axis=1)[:, None] for seen in (points, points + step)]
    >>> recover_pose(essential(RigidTransform.from_translation(step)), *rays).translation.round(9) + 0
    array([-1.,  0.,  0.])
    """
    motions = decompose_essential(E)
    in_front = [int((ray_distances(motion, rays_left, rays_right) > 0).all(axis=-1).sum()) for motion in motions]
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
