"""Lesson 06, calibration: reprojection error, a focal length from one board, Zhang's constraints, a pose, deviations.

A board's points (x, y) in its plane reach pixels by H = λ K [r₁ r₂ t]. After Zhang (2000).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import Arguments, Array, Exercise
from camviz.poses import Rotation
from camviz.trials import Function


def rms(found: Array, projected: Array) -> float:
    """The root of the mean squared distance in pixels between corners (..., 2); NaN corners do not count."""
    return float(np.sqrt(np.nanmean(np.sum((found - projected) ** 2, axis=-1))))


def focal_lengths(H: Array, centre: Array) -> Array:
    """(fx, fy) of the camera that sees one tilted board through H (3, 3), its principal point `centre` being known."""
    a, b = _inverse_squares(H, centre)
    return 1 / np.sqrt(np.array([a, b]))


def constraints(H: Array) -> Array:
    """What H says of (B₁₁, B₁₂, B₂₂, B₁₃, B₂₃, B₃₃): two rows (2, 6) whose product with it is zero."""
    return _constraint_rows(H[:, 0], H[:, 1])


def board_pose(H: Array, K: Array) -> tuple[Array, Array]:
    """R (3, 3) and t (3,) of cam_from_board, the board in front of the camera."""
    M = np.linalg.inv(K) @ H
    M = M * np.sign(M[2, 2]) / np.linalg.norm(M[:, 0])
    U, _, Vt = np.linalg.svd(np.stack([M[:, 0], M[:, 1], np.cross(M[:, 0], M[:, 1])], axis=1))
    return U @ Vt, M[:, 2]


def standard_deviations(J: Array, residuals: Array) -> Array:
    """The standard deviation (k,) of every parameter: the roots of the diagonal of σ² (JᵀJ)⁻¹, σ² = |r|²/(N − k)."""
    variance = residuals @ residuals / (len(residuals) - J.shape[1])
    return np.sqrt(variance * np.diag(np.linalg.inv(J.T @ J)))


def _inverse_squares(H: Array, centre: Array) -> Array:
    """1/fx² and 1/fy²: h₁ᵀ B h₂ = 0 and h₁ᵀ B h₁ = h₂ᵀ B h₂ with B = diag(1/fx², 1/fy², 1) about the centre."""
    (p, q, r), (s, t, w) = (_to_centre(centre) @ H)[:, :2].T
    return np.linalg.solve([[p * s, q * t], [p * p - s * s, q * q - t * t]], [-r * w, w * w - r * r])


def _to_centre(centre: Array) -> Array:
    return np.array([[1, 0, -centre[0]], [0, 1, -centre[1]], [0, 0, 1]])


def _constraint_rows(a: Array, b: Array) -> Array:
    return np.stack([_products(a, b), _products(a, a) - _products(b, b)])


def _products(a: Array, b: Array) -> Array:
    first = [a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]]
    return np.array([*first, a[2] * b[0] + a[0] * b[2], a[2] * b[1] + a[1] * b[2], a[2] * b[2]])


def _one_scale(rows: Array) -> Array:
    """Rows (2, 6), each of which may be multiplied by any number, in one form."""
    if rows.shape != (2, 6):
        return rows
    largest = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)
    return rows / largest


def _K(rng: np.random.Generator) -> Array:
    fx, fy, cx, cy = rng.uniform([400, 400, 280, 200], [900, 900, 360, 280])
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _pose(rng: np.random.Generator) -> tuple[Array, Array]:
    """A board tilted about both axes, somewhere in front of the camera."""
    tilt = rng.uniform(0.3, 0.6, 2) * rng.choice([-1, 1], 2)
    R = Rotation.from_rotvec([*tilt, rng.uniform(-0.2, 0.2)]).as_matrix()
    return R, rng.uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.9])


def _H(K: Array, R: Array, t: Array) -> Array:
    return K @ np.column_stack([R[:, 0], R[:, 1], t])


def _rms_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((6,), (54,), (4, 12)):
        found = rng.uniform(0, 480, (*shape, 2))
        projected = found + rng.normal(0, 0.4, found.shape)
        found[(*(rng.integers(0, n) for n in shape),)] = np.nan
        yield found, projected


def _focal_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        K = _K(rng)
        yield float(rng.uniform(0.2, 5) * rng.choice([-1, 1])) * _H(K, *_pose(rng)), K[:2, 2]


def _constraint_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield (_H(_K(rng), *_pose(rng)),)


def _pose_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for sign in (1, -1, 1, -1):
        K = _K(rng)
        yield sign * float(rng.uniform(0.2, 5)) * _H(K, *_pose(rng)), K


def _deviation_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for rows, columns in ((20, 3), (60, 7)):
        mixed = np.eye(columns) + 0.5 * rng.normal(size=(columns, columns))
        yield rng.normal(size=(rows, columns)) @ mixed, rng.normal(0, 0.3, rows)


def _a_rotation(function: Function, rng: np.random.Generator) -> str:
    """With noise K⁻¹H is no longer made of two perpendicular columns; R must be a rotation all the same."""
    K = _K(rng)
    H = _H(K, *_pose(rng))
    R, _ = function(H * (1 + rng.normal(0, 1e-3, (3, 3))), K)
    if np.allclose(np.asarray(R).T @ R, np.eye(3), atol=1e-9):
        return ""
    return (
        "For an exact H this is right. With noise in H your R is no rotation any more: RᵀR is not 1. Take the nearest "
        "rotation, `U @ Vt` of the SVD."
    )


def _scaled_pose(H: Array, K: Array, scale: Function) -> tuple[Array, Array]:
    """The pose with K⁻¹H multiplied by something else than what makes its first column a unit vector in front."""
    M = np.linalg.inv(K) @ H
    M = M * scale(M)
    return np.stack([M[:, 0], M[:, 1], np.cross(M[:, 0], M[:, 1])], axis=1), M[:, 2]


RMS = Exercise(
    name="06.rms",
    reference=rms,
    cases=_rms_cases,
    hints=(
        "Square the distances first, then average over the corners that were found, then take the root.",
        "`np.sum((found - projected)**2, axis=-1)` are squared distances, one for each corner; `np.nanmean` leaves out "
        "those that are NaN.",
    ),
    praise="This is the number that OpenCV prints, and that everybody quotes.",
)


@RMS.wrong("This is the mean of the distances. RMS squares before it averages, so that one bad corner counts for more.")
def _(found, projected):
    return np.nanmean(np.linalg.norm(found - projected, axis=-1))


@RMS.wrong(
    "You average over u and v as well, which is √2 too little: a corner has *one* error, the distance. (Yours "
    "is the deviation of one coordinate; some programs print that.)"
)
def _(found, projected):
    return np.sqrt(np.nanmean((found - projected) ** 2))


@RMS.wrong("One corner that was not found makes your whole answer NaN. Leave such corners out.")
def _(found, projected):
    return np.sqrt(np.mean(np.sum((found - projected) ** 2, axis=-1)))


@RMS.wrong("A corner that was not found counts as one without an error here. Leave it out of the mean altogether.")
def _(found, projected):
    return np.sqrt(np.mean(np.nan_to_num(np.sum((found - projected) ** 2, axis=-1))))


@RMS.wrong("This is the root of the *sum*. Divide by the number of corners found before you take the root.")
def _(found, projected):
    return np.sqrt(np.nansum((found - projected) ** 2))


@RMS.wrong("This is the mean *square*, in pixels². Take its root.")
def _(found, projected):
    return np.nanmean(np.sum((found - projected) ** 2, axis=-1))


FOCAL_LENGTHS = Exercise(
    name="06.focal_lengths",
    reference=focal_lengths,
    cases=_focal_cases,
    tolerance=1e-7,
    hints=(
        "Move the pixels so that the principal point is 0. Then B = diag(1/fx², 1/fy², 1), and the two constraints are "
        "two linear equations in 1/fx² and 1/fy².",
        "With h₁ = (p, q, r) and h₂ = (s, t, w): `np.linalg.solve([[p*s, q*t], [p*p - s*s, q*q - t*t]], [-r*w, "
        "w*w - r*r])` is (1/fx², 1/fy²).",
    ),
    praise="Two unknowns, two equations: one tilted board is enough. Hold it flat, and both equations say 0 = 0.",
)


@FOCAL_LENGTHS.wrong(
    "You did not move the principal point to 0. The constraints hold with B = diag(1/fx², 1/fy², 1) only there."
)
def _(H, centre):
    return focal_lengths(H, np.zeros(2))


@FOCAL_LENGTHS.wrong(
    "You moved the pixels by +centre. What is at the principal point must come to lie at 0: subtract it."
)
def _(H, centre):
    return focal_lengths(H, -centre)


@FOCAL_LENGTHS.wrong("These are fx² and fy². The unknowns were 1/f²: the root is missing.")
def _(H, centre):
    return 1 / _inverse_squares(H, centre)


@FOCAL_LENGTHS.wrong("These are 1/fx and 1/fy: the unknowns of the linear equations are *inverse* squares.")
def _(H, centre):
    return np.sqrt(_inverse_squares(H, centre))


@FOCAL_LENGTHS.wrong("You took rows of H. Its *columns* are the images of the board's axes: `H[:, 0]` and `H[:, 1]`.")
def _(H, centre):
    return focal_lengths(_to_centre(-centre) @ (_to_centre(centre) @ H).T, centre)


CONSTRAINTS = Exercise(
    name="06.constraints",
    reference=constraints,
    cases=_constraint_cases,
    canonical=_one_scale,
    bug=True,
    hints=(
        "H = K [r₁ r₂ t]. Where in the array H do you find what became of r₁?",
        "h₁ and h₂ are the first two *columns*. In NumPy `H[0]` is a row; the column is `H[:, 0]`.",
    ),
    praise="Columns it is. Try a test with a symmetric H to see why the mistake survived.",
)


@CONSTRAINTS.wrong(
    "This is what you get with `H[0]` and `H[1]`, the first two *rows* of H. Zhang's h₁ and h₂ are the images "
    "of "
    "the board's x axis and y axis."
)
def _(H):
    return _constraint_rows(H[0], H[1])


@CONSTRAINTS.wrong("These are the second and third column: Zhang counts from 1, NumPy from 0.")
def _(H):
    return _constraint_rows(H[:, 1], H[:, 2])


@CONSTRAINTS.wrong("r₁ and r₂ have the *same* length: h₁ᵀBh₁ minus h₂ᵀBh₂ is zero, not their sum.")
def _(H):
    return np.stack([_products(H[:, 0], H[:, 1]), _products(H[:, 0], H[:, 0]) + _products(H[:, 1], H[:, 1])])


POSE = Exercise(
    name="06.board_pose",
    reference=board_pose,
    cases=_pose_cases,
    tolerance=1e-7,
    laws=(_a_rotation,),
    hints=(
        "K⁻¹H is [r₁ r₂ t] times an unknown number. What length must r₁ have, and on which side of the camera is t?",
        "`M = np.linalg.inv(K) @ H; M = M * np.sign(M[2, 2]) / np.linalg.norm(M[:, 0])`. Then r₃ = r₁ × r₂, and "
        "`U @ Vt` of the SVD of [r₁ r₂ r₃] is the nearest rotation.",
    ),
    praise="Known K, one picture: that is extrinsic calibration, and what every marker in augmented reality does.",
)


@POSE.wrong(
    "H and −H are the same homography. Some of your boards stand *behind* the camera: choose the sign with t_z > 0."
)
def _(H, K):
    return _scaled_pose(H, K, lambda M: 1 / np.linalg.norm(M[:, 0]))


@POSE.wrong("H has an arbitrary scale, and so have your r₁ and t. r₁ is a unit vector: divide by its length.")
def _(H, K):
    return _scaled_pose(H, K, lambda M: np.sign(M[2, 2]))


@POSE.wrong("R is transposed: r₁ and r₂ are its *columns*.")
def _(H, K):
    return (board_pose(H, K)[0].T, board_pose(H, K)[1])


@POSE.wrong("The camera matrix is still in there: H = λ K [r₁ r₂ t], so begin with K⁻¹H.")
def _(H, K):
    return board_pose(H, np.eye(3))


@POSE.wrong("Your third axis points the wrong way, and det R = −1: r₃ = r₁ × r₂, in this order.")
def _(H, K):
    return (board_pose(H, K)[0] * (1, 1, -1), board_pose(H, K)[1])


@POSE.wrong("This t is the camera's centre in the board's frame, −Rᵀt. Wanted is t itself.")
def _(H, K):
    return (board_pose(H, K)[0], -board_pose(H, K)[0].T @ board_pose(H, K)[1])


DEVIATIONS = Exercise(
    name="06.standard_deviations",
    reference=standard_deviations,
    cases=_deviation_cases,
    tolerance=1e-7,
    hints=(
        "First the noise of one measurement, σ² = |r|²/(N − k). Then invert the *whole* of JᵀJ, and look at the "
        "diagonal "
        "after that, not before.",
        "`np.sqrt(s2 * np.diag(np.linalg.inv(J.T @ J)))` with `s2 = residuals @ residuals / (N - k)`, N rows and k "
        "columns.",
    ),
    praise="The inverse lets every other parameter give way. That is why a board's unknown distance makes f uncertain.",
)


@DEVIATIONS.wrong(
    "You inverted only the diagonal of JᵀJ. That is the deviation of one parameter with all others *known*, "
    "and it "
    "is far too small: the boards' poses are not known."
)
def _(J, residuals):
    return np.sqrt(residuals @ residuals / (len(residuals) - J.shape[1]) / np.sum(J**2, axis=0))


@DEVIATIONS.wrong("Divide by N − k, not by N: k parameters have been fitted to these residuals and made them smaller.")
def _(J, residuals):
    return np.sqrt(residuals @ residuals / len(residuals) * np.diag(np.linalg.inv(J.T @ J)))


@DEVIATIONS.wrong("These are variances. A standard deviation is the root, in the parameter's own unit.")
def _(J, residuals):
    return standard_deviations(J, residuals) ** 2


@DEVIATIONS.wrong("This is right for a noise of one pixel. Estimate the noise from the residuals and multiply by it.")
def _(J, residuals):
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


EXERCISES = (RMS, FOCAL_LENGTHS, CONSTRAINTS, POSE, DEVIATIONS)
