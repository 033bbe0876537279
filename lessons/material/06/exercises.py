"""Lesson 06, calibration: reprojection error, a focal length from one board, Zhang's constraints, a pose, deviations.

A board's points (x, y) in its plane reach pixels by H = λ K [r₁ r₂ t]. After Zhang (2000).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.poses import Rotation
from camviz_school.course.checks import Arguments, Array, Exercise
from camviz_school.course.trials import Function

# 1: the number everybody quotes --------------------------------------------------------------------------------------


def rms(found: Array, projected: Array) -> float:
    """The root of the mean squared distance in pixels between corners (..., 2); NaN corners do not count."""
    return float(np.sqrt(np.nanmean(np.sum((found - projected) ** 2, axis=-1))))


def _rms_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((6,), (54,), (4, 12)):
        found = rng.uniform(0, 480, (*shape, 2))
        projected = found + rng.normal(0, 0.4, found.shape)
        found[(*(rng.integers(0, n) for n in shape),)] = np.nan
        yield found, projected
    found = np.column_stack([rng.uniform(-20, 0, 5), rng.uniform(0, 20, 5)])
    yield found, found + rng.normal(0, 0.4, found.shape)  # all found, and beside the picture


RMS = Exercise(
    name="06.rms",
    reference=rms,
    cases=_rms_cases,
    hints=(
        "Read the name backwards: first the squares of the distances, then their mean, then its root. What does one "
        "NaN do to a mean?",
        "`np.sum(…, axis=-1)` of the squared differences gives one squared distance for each corner. `np.nanmean` "
        "leaves out those that are NaN.",
        "`return np.sqrt(___)`",
    ),
    praise="This is the number that OpenCV prints, and that everybody quotes.",
)


@RMS.right
def corner_by_corner(found, projected):
    squares = [
        (u - a) ** 2 + (v - b) ** 2
        for (u, v), (a, b) in zip(found.reshape(-1, 2), projected.reshape(-1, 2), strict=True)
        if not np.isnan(u)
    ]
    return (sum(squares) / len(squares)) ** 0.5


@RMS.right
def as_opencv_sums_it(found, projected):
    import cv2

    there = np.isfinite(found).all(axis=-1)
    return cv2.norm(found[there], projected[there], cv2.NORM_L2) / np.sqrt(there.sum())


@RMS.wrong("This is the mean of the distances. RMS squares before it averages.")
def mean_distance(found, projected):
    return np.nanmean(np.linalg.norm(found - projected, axis=-1))


@RMS.wrong("You average over u and v as well, which is √2 too little: a corner has *one* error.")
def u_and_v_averaged(found, projected):
    return np.sqrt(np.nanmean((found - projected) ** 2))


@RMS.wrong("A corner that was not found counts as one without an error. Leave it out of the mean.")
def nan_as_no_error(found, projected):
    return np.sqrt(np.mean(np.nan_to_num(np.sum((found - projected) ** 2, axis=-1))))


@RMS.wrong("This is the mean *square*, in pixels². Take its root.")
def mean_square(found, projected):
    return np.nanmean(np.sum((found - projected) ** 2, axis=-1))


@RMS.wrong("You average the boards' RMS values. Average the *squares* of all corners, then take one root.")
def mean_of_each_board_s_rms(found, projected):
    return np.mean(np.sqrt(np.nanmean(np.sum((found - projected) ** 2, axis=-1), axis=-1)))


# 2: a focal length from one picture ----------------------------------------------------------------------------------


def focal_lengths(H: Array, centre: Array) -> Array:
    """(fx, fy) of the camera that sees one tilted board through H (3, 3), its principal point `centre` being known."""
    return 1 / np.sqrt(_inverse_squares(_to_centre(centre) @ H))


def _inverse_squares(H: Array) -> Array:
    """1/fx² and 1/fy²: h₁ᵀ B h₂ = 0 and h₁ᵀ B h₁ = h₂ᵀ B h₂ with B = diag(1/fx², 1/fy², 1), pixels from the centre."""
    (p, q, r), (s, t, w) = H[:, :2].T
    return np.linalg.solve([[p * s, q * t], [p * p - s * s, q * q - t * t]], [-r * w, w * w - r * r])


def _to_centre(centre: Array) -> Array:
    return np.array([[1, 0, -centre[0]], [0, 1, -centre[1]], [0, 0, 1]])


def _K(rng: np.random.Generator) -> Array:
    fx, fy, cx, cy = rng.uniform([400, 400, 280, 200], [900, 900, 360, 280])
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _pose(rng: np.random.Generator) -> tuple[Array, Array]:
    """A board tilted about both axes, somewhere in front of the camera."""
    tilt = rng.uniform(0.3, 0.6, 2) * rng.choice([-1, 1], 2)
    R = Rotation.from_rotvec([*tilt, rng.uniform(0.1, 0.2)]).as_matrix()
    return R, rng.uniform([0.02, 0.02, 0.4], [0.1, 0.1, 0.9])


def _H(K: Array, R: Array, t: Array) -> Array:
    return K @ np.column_stack([R[:, 0], R[:, 1], t])


def _pose_with_a_near_right(rng: np.random.Generator) -> tuple[Array, Array]:
    """The same, the board's right side nearer than its left: its first column has numbers of both signs."""
    R, t = _pose(rng)
    while R[2, 0] >= 0:
        R, t = _pose(rng)
    return R, t


def _turned(R: Array, quarters: int) -> Array:
    """The pose of the board turned by quarters in its own plane."""
    return np.asarray(R @ Rotation.from_rotvec([0, 0, quarters * np.pi / 2]).as_matrix())


def _focal_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """One board turned by quarters, so that each of its columns has either sign and either is the longer in depth, and
    others; H of either sign, and a principal point beyond the picture's upper left corner."""
    first = _pose(rng)
    for place, (upright, t) in enumerate((first, first, first, first, _pose(rng), _pose(rng))):
        K, R = _K(rng), _turned(upright, place)
        yield float(rng.uniform(0.2, 5)) * (-1) ** place * _H(K, R, t), K[:2, 2]
    K = _K(rng) * [[1, 1, -1], [1, 1, -1], [1, 1, 1]]
    H = _H(K, *_pose(rng))
    while not (_inverse_squares((_to_centre(K[:2, 2]) @ H).T) > 0).all():  # its rows, too, give numbers
        H = _H(K, *_pose(rng))
    yield H, K[:2, 2]


FOCAL_LENGTHS = Exercise(
    name="06.focal_lengths",
    reference=focal_lengths,
    cases=_focal_cases,
    tolerance=1e-7,
    hints=(
        "Move the pixels so that the principal point is 0. Then B = diag(1/fx², 1/fy², 1). Write out h₁ᵀ B h₂ = 0: "
        "what are its unknowns, and is it linear in them?",
        "A matrix that subtracts `centre`, times H, moves the pixels. Call its first two columns (p, q, r) and "
        "(s, t, w). The constraints are p s/fx² + q t/fy² + r w = 0 and (p² − s²)/fx² + (q² − t²)/fy² + r² − w² = 0: "
        "two linear equations for `np.linalg.solve`.",
        "`A = np.array([[p * s, q * t], [p * p - s * s, q * q - t * t]])` and then "
        "`return 1 / np.sqrt(np.linalg.solve(A, ___))`",
    ),
    praise=(
        "Two unknowns, two equations: one board is enough if it is tilted about a slanting axis. Hold it flat and both "
        "equations are lost; tilt it about a row or a column and one is."
    ),
)


@FOCAL_LENGTHS.right
def from_the_null_vector_of_the_constraints(H, centre):
    moved = _to_centre(centre) @ H / H[2, 2]
    rows = _constraint_rows(moved[:, 0], moved[:, 1])[:, [0, 2, 5]]
    size = np.linalg.norm(rows, axis=0)
    b = np.linalg.svd(rows / size)[2][-1] / size
    return np.sqrt(b[2] / b[:2])


@FOCAL_LENGTHS.right
def by_cramer_s_rule(H, centre):
    (p, s), (q, t), (r, w) = (_to_centre(centre) @ H)[:, :2]
    determinant = p * s * (q * q - t * t) - q * t * (p * p - s * s)
    a = (-r * w * (q * q - t * t) - q * t * (w * w - r * r)) / determinant
    b = (p * s * (w * w - r * r) + r * w * (p * p - s * s)) / determinant
    return [a**-0.5, b**-0.5]


@FOCAL_LENGTHS.wrong("You did not move the principal point to 0. The constraints hold only there.")
def centre_ignored(H, centre):
    return focal_lengths(H, np.zeros(2))


@FOCAL_LENGTHS.wrong("The columns are homogeneous: subtract `centre` times their *third* number.")
def centre_subtracted_from_homogeneous_columns(H, centre):
    return 1 / np.sqrt(_inverse_squares(np.vstack([H[:2] - centre[:, None], H[2:]])))


@FOCAL_LENGTHS.wrong("These are fx² and fy². The unknowns were 1/f²: the root is missing.")
def squares(H, centre):
    return focal_lengths(H, centre) ** 2


@FOCAL_LENGTHS.wrong("You took rows of H. Its *columns* are the images of the board's axes.")
def rows_of_H(H, centre):
    return 1 / np.sqrt(_inverse_squares((_to_centre(centre) @ H).T))


@FOCAL_LENGTHS.wrong("You took fx = fy and used the first equation alone. These pixels are not square.")
def square_pixels_assumed(H, centre):
    (p, q, r), (s, t, w) = (_to_centre(centre) @ H)[:, :2].T
    return np.sqrt(np.full(2, -(p * s + q * t) / (r * w)))


# 3: find the bug in Zhang's constraints ------------------------------------------------------------------------------


def constraints(H: Array) -> Array:
    """What H says of (B₁₁, B₁₂, B₂₂, B₁₃, B₂₃, B₃₃): two rows (2, 6) whose product with it is zero."""
    return _constraint_rows(H[:, 0], H[:, 1])


def constraints_as_given(H):
    return _constraint_rows(H[0], H[1])


def _constraint_rows(a: Array, b: Array) -> Array:
    return np.stack([_products(a, b), _products(a, a) - _products(b, b)])


def _products(a: Array, b: Array) -> Array:
    first = [a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]]
    return np.array([*first, a[2] * b[0] + a[0] * b[2], a[2] * b[1] + a[1] * b[2], a[2] * b[2]])


def _what_they_say(rows: Array) -> Array:
    """Two rows (2, 6) that are the same for any two equations with the same solutions, whatever their order and scale.

    They are the first two axes, projected onto the plane that the rows span.
    """
    if rows.shape != (2, 6) or not np.isfinite(rows).all():
        return rows
    f = 600.0  # pixels², pixels and plain numbers, brought to about one size
    rows = rows / (f * f, f * f, f * f, f, f, 1)
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    _, s, Vt = np.linalg.svd(rows / np.where(lengths > 0, lengths, 1), full_matrices=False)
    return (Vt[s > 1e-9].T @ Vt[s > 1e-9])[:2]


def _constraint_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """One board turned by quarters, so that each of its columns has either sign, and one with both signs in its first,
    and then in its second column."""
    upright, t = _pose(rng)
    for quarters in range(4):
        yield (_H(_K(rng), _turned(upright, quarters), t),)
    R, t = _pose_with_a_near_right(rng)
    for quarters in range(2):
        yield (_H(_K(rng), _turned(R, quarters), t),)


CONSTRAINTS = Exercise(
    name="06.constraints",
    reference=constraints,
    cases=_constraint_cases,
    canonical=_what_they_say,
    tolerance=1e-7,
    as_given=constraints_as_given,
    hints=(
        "H = K [r₁ r₂ t]. Where in the array H do you find what became of r₁?",
        "Zhang's h₁ and h₂ are the images of the board's x axis and y axis, so they are K r₁ and K r₂ up to a factor. "
        "In NumPy a single index picks a *row*.",
        "`h1, h2 = ___, ___`",
    ),
    praise="Columns it is. Try a test with a symmetric H to see why the mistake survived.",
)


@CONSTRAINTS.right
def as_camviz_has_them(H):
    from camviz_school.views.zhang import constraints as of_the_closed_form

    return of_the_closed_form(H)


@CONSTRAINTS.right
def by_outer_products(H):
    i, j = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])
    perpendicular, longer = np.outer(H[:, 0], H[:, 1]), np.outer(H[:, 0], H[:, 0]) - np.outer(H[:, 1], H[:, 1])
    return np.stack([(M + M.T)[i, j] / np.where(i == j, 2, 1) for M in (perpendicular, longer)])


@CONSTRAINTS.wrong("These are the second and third column: Zhang counts from 1, NumPy from 0.")
def columns_counted_from_one_by_zhang(H):
    return _constraint_rows(H[:, 1], H[:, 2])


@CONSTRAINTS.wrong("r₁ and r₂ have the *same* length: h₁ᵀBh₁ minus h₂ᵀBh₂ is zero, not their sum.")
def sum_of_lengths(H):
    return np.stack([_products(H[:, 0], H[:, 1]), _products(H[:, 0], H[:, 0]) + _products(H[:, 1], H[:, 1])])


@CONSTRAINTS.wrong("h₁ is a column now, and that is right. h₂ is still a row.")
def only_h1_mended(H):
    return _constraint_rows(H[:, 0], H[1])


@CONSTRAINTS.wrong("h₂ is a column now, and that is right. h₁ is still a row.")
def only_h2_mended(H):
    return _constraint_rows(H[0], H[:, 1])


@CONSTRAINTS.wrong("These are the last two *rows*. In an array H the vector h₁ is a column.")
def last_two_rows(H):
    return _constraint_rows(H[1], H[2])


# 4: where is the board? ----------------------------------------------------------------------------------------------

_NO_ROTATION = (
    "For an exact H this is right. With noise in H your R is no rotation any more: RᵀR is not 1. Take the nearest "
    "rotation, which the SVD of [r₁ r₂ r₃] gives."
)
_V_FOR_VT = (
    "NumPy's `svd` returns Vᵀ, not V: the nearest rotation is `U @ Vt`. You transposed `Vt` once more. "
    "For an exact H the difference may not show."
)


def board_pose(H: Array, K: Array) -> tuple[Array, Array]:
    """R (3, 3) and t (3,) of cam_from_board, the board in front of the camera."""
    M = np.linalg.inv(K) @ H
    M = M * np.sign(M[2, 2]) / np.linalg.norm(M[:, 0])
    return _nearest_rotation(_with_third_axis(M)), M[:, 2]


def _with_third_axis(M: Array) -> Array:
    return np.stack([M[:, 0], M[:, 1], np.cross(M[:, 0], M[:, 1])], axis=1)


def _nearest_rotation(M: Array) -> Array:
    U, _, Vt = np.linalg.svd(M)
    return U @ Vt


def _pose_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """H times positive and negative numbers, of two boards that are upright, and then held on their heads."""
    sides, boards = ((1, 1), (-1, -1), (1, -1), (-1, 1)), (_pose(rng), _pose(rng))
    for place, ((sign, quarters), side) in enumerate(zip(((1, 0), (-1, 0), (1, 2), (-1, 2)), sides, strict=True)):
        K, (R, t) = _K(rng), boards[place % 2]
        R, t = _turned(R, quarters), t * [*side, 1]
        yield sign * float(rng.choice([rng.uniform(0.2, 0.8), rng.uniform(1.3, 5)])) * _H(K, R, t), K
    K = _K(rng) * [[1, 1, -1], [1, 1, -1], [1, 1, 1]]  # the principal point beyond the upper left corner
    yield _H(K, *_pose_with_a_near_right(rng)), K


def _a_rotation(function: Function, rng: np.random.Generator) -> str:
    """With noise K⁻¹H is no longer made of two perpendicular columns; R must be a rotation all the same."""
    K = _K(rng)
    H = _H(K, *_pose(rng))
    H = H * (1 + rng.normal(0, 1e-3, (3, 3)))
    R, right = np.asarray(function(H, K)[0]), board_pose(H, K)[0]
    if not np.allclose(R.T @ R, np.eye(3), atol=1e-9):
        return _NO_ROTATION
    return "" if np.abs(R - right).max() < 0.1 else _V_FOR_VT


POSE = Exercise(
    name="06.board_pose",
    reference=board_pose,
    cases=_pose_cases,
    tolerance=1e-6,
    laws=(_a_rotation,),
    hints=(
        "K⁻¹H is [r₁ r₂ t] times an unknown number, which may be negative. What length must r₁ have, and on which side "
        "of the camera is t?",
        "Divide K⁻¹H by the length of its first column, and by the sign of the number that becomes t_z. The third "
        "column r₃ is the cross product of r₁ and r₂. `np.linalg.svd` of [r₁ r₂ r₃] gives U and Vᵀ, and their product"
        " is the nearest "
        "rotation.",
        "`M = M * np.sign(___) / np.linalg.norm(___)`",
    ),
    praise="Known K, one picture: that is extrinsic calibration, and what every marker in augmented reality does.",
)


@POSE.right
def by_gram_and_schmidt(H, K):
    M = np.linalg.solve(K, H)
    M = M / np.linalg.norm(M[:, 0])
    M = M if M[2, 2] > 0 else -M
    r1, r2, t = M.T
    r2 = r2 - (r1 @ r2) * r1
    r2 = r2 / np.linalg.norm(r2)
    return np.column_stack([r1, r2, np.cross(r1, r2)]), t


@POSE.right
def by_opencv_s_solvepnp(H, K):
    import cv2

    board = np.array([(-0.1, 0.1, 0), (0.1, 0.1, 0), (0.1, -0.1, 0), (-0.1, -0.1, 0)])
    seen = (board[:, :2] @ H[:, :2].T) + H[:, 2]
    _, turn, t = cv2.solvePnP(board, seen[:, :2] / seen[:, 2:], K, None, flags=cv2.SOLVEPNP_IPPE)
    return cv2.Rodrigues(turn)[0], t.ravel()


@POSE.wrong("Some of your boards stand *behind* the camera: choose the sign of H with t_z > 0.")
def sign_ignored(H, K):
    M = np.linalg.inv(K) @ H
    M = M / np.linalg.norm(M[:, 0])
    return _nearest_rotation(_with_third_axis(M)), M[:, 2]


@POSE.wrong("You changed the sign of t alone. H and −H differ in all three columns.")
def sign_of_t_alone(H, K):
    M = np.linalg.inv(K) @ H
    M = M / np.linalg.norm(M[:, 0])
    return _nearest_rotation(_with_third_axis(M)), M[:, 2] * np.sign(M[2, 2])


@POSE.wrong("R is right, but t has H's arbitrary scale. Divide by the length of r₁.")
def scale_ignored(H, K):
    M = np.linalg.inv(K) @ H
    return board_pose(H, K)[0], M[:, 2] * np.sign(M[2, 2])


@POSE.wrong("The camera matrix is still in there: H = λ K [r₁ r₂ t], so begin with K⁻¹H.")
def camera_matrix_left_in(H, K):
    return board_pose(H, np.eye(3))


@POSE.wrong("Your third axis points the wrong way, and det R = −1: r₃ = r₁ × r₂, in this order.")
def third_axis_reversed(H, K):
    R, t = board_pose(H, K)
    return R * (1, 1, -1), t


@POSE.wrong(_V_FOR_VT)
def vt_transposed_again(H, K):
    M = np.linalg.inv(K) @ H
    M = M * np.sign(M[2, 2]) / np.linalg.norm(M[:, 0])
    U, _, Vt = np.linalg.svd(_with_third_axis(M))
    return U @ Vt.T, M[:, 2]


# 5: how sure? --------------------------------------------------------------------------------------------------------


def standard_deviations(J: Array, residuals: Array) -> Array:
    """The standard deviation (k,) of every parameter: the roots of the diagonal of σ² (JᵀJ)⁻¹, σ² = |r|²/(N − k)."""
    return np.sqrt(_variance(J, residuals) * np.diag(np.linalg.inv(J.T @ J)))


def _variance(J: Array, residuals: Array) -> float:
    return float(residuals @ residuals / (len(residuals) - J.shape[1]))


def _deviation_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for rows, columns in ((20, 3), (60, 7)):
        mixed = np.eye(columns) + 0.5 * rng.normal(size=(columns, columns))
        yield rng.normal(size=(rows, columns)) @ mixed, rng.normal(0.1, 0.3, rows)


DEVIATIONS = Exercise(
    name="06.standard_deviations",
    reference=standard_deviations,
    cases=_deviation_cases,
    tolerance=1e-7,
    hints=(
        "First the noise of one measurement, σ² = Σ r²/(N − k). Then invert the *whole* of JᵀJ, and look at the "
        "diagonal after that, not before.",
        "`J.shape` has N and k. `np.linalg.inv` inverts, `np.diag` takes the diagonal; a variance becomes a standard "
        "deviation by its root.",
        "`return np.sqrt(variance * np.diag(___))`",
    ),
    praise="The inverse lets every other parameter give way. That is why a board's unknown distance makes f uncertain.",
)


@DEVIATIONS.right
def by_the_qr_factors(J, residuals):
    """JᵀJ = RᵀR, and (JᵀJ)⁻¹ = R⁻¹R⁻ᵀ."""
    inverse = np.linalg.inv(np.linalg.qr(J)[1])
    return np.sqrt(np.sum(residuals**2) / (J.shape[0] - J.shape[1]) * np.sum(inverse**2, axis=1))


@DEVIATIONS.right
def parameter_by_parameter(J, residuals):
    unit = np.eye(J.shape[1])
    return [np.sqrt(_variance(J, residuals) * (one @ np.linalg.solve(J.T @ J, one))) for one in unit]


@DEVIATIONS.wrong("You inverted only the diagonal of JᵀJ. That takes all other parameters as *known*.")
def others_taken_as_known(J, residuals):
    return np.sqrt(_variance(J, residuals) / np.sum(J**2, axis=0))


@DEVIATIONS.wrong("Divide by N − k, not by N: k parameters were fitted to these residuals.")
def divided_by_N(J, residuals):
    return np.sqrt(residuals @ residuals / len(residuals) * np.diag(np.linalg.inv(J.T @ J)))


@DEVIATIONS.wrong("You count corners, N/2. Every corner has two residuals, in u and in v, and N counts both.")
def corners_counted(J, residuals):
    return np.sqrt(residuals @ residuals / (len(residuals) / 2 - J.shape[1]) * np.diag(np.linalg.inv(J.T @ J)))


@DEVIATIONS.wrong("These are variances. A standard deviation is the root, in the parameter's own unit.")
def variances(J, residuals):
    return standard_deviations(J, residuals) ** 2


@DEVIATIONS.wrong("You took a noise of one pixel. Estimate it from the residuals.")
def noise_of_one_pixel(J, residuals):
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


EXERCISES = (RMS, FOCAL_LENGTHS, CONSTRAINTS, POSE, DEVIATIONS)
