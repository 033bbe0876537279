"""Lesson 04, extrinsics: its exercises, in one file because they are loaded by their lesson's number.

The camera's centre, a chain in the wrong order, what a rotation is, inverse, Rodrigues.

A transform is named to_from_from and acts on column vectors: X_cam = R X_world + t. Answers are compared to a
hundred-thousandth, for which float32 is good enough; what is wrong here is wrong by far more.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.poses import Rotation
from camviz_school.course.checks import Arguments, Array, Exercise

SINGLE_PRECISION = 1e-5
ROUNDING = 1e-6  # how far each element of MᵀM, and the determinant, may be from a rotation's


def _rotation(rng: np.random.Generator) -> Array:
    return np.asarray(Rotation.random(rng=rng).as_matrix())


def _way(rng: np.random.Generator) -> Array:
    """To either side along each axis, and always somewhere."""
    return rng.choice([-1.0, 1.0], 3) * rng.uniform(1, 3, 3)


def _rigid(rng: np.random.Generator, *shape: int) -> Array:
    transforms = np.zeros((*shape, 4, 4))
    for index in np.ndindex(shape):
        transforms[index][:3, :3], transforms[index][:3, 3] = _rotation(rng), _way(rng)
    transforms[..., 3, 3] = 1
    return transforms


def _transposed(T: Array) -> Array:
    return np.swapaxes(T, -1, -2)


def _assembled(R: Array, t: Array) -> Array:
    """[R t; 0 1] of rotations (..., 3, 3) and columns (..., 3, 1)."""
    T = np.zeros((*R.shape[:-2], 4, 4))
    T[..., :3, :3], T[..., :3, 3:], T[..., 3, 3] = R, t, 1
    return T


# 1: where the camera stands ------------------------------------------------------------------------------------------


def centre(R: Array, t: Array) -> Array:
    """C = -Rᵀ t, the point that R C + t = 0 takes to the camera's origin."""
    return -R.T @ t


def _centre_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield _rotation(rng), _way(rng)


CENTRE = Exercise(
    name="04.centre",
    reference=centre,
    cases=_centre_cases,
    tolerance=SINGLE_PRECISION,
    shown=((np.eye(3), np.array([0.0, 0.0, 1.0])),),
    hints=(
        "The camera's centre is the one point of the world that has camera coordinates (0, 0, 0).",
        "Put X_cam = 0 into X_cam = R X_world + t and solve for X_world. R is a rotation, so its inverse is its "
        "transpose, `R.T`.",
        "`return -___ @ t`",
    ),
    praise="That is where the camera stands. Put it back: R C + t is zero.",
)


@CENTRE.right
def by_solving(R, t):
    return np.linalg.solve(R, -t)


@CENTRE.right
def centre_in_single_precision(R, t):
    return -R.astype(np.float32).T @ t.astype(np.float32)


@CENTRE.wrong("This is t itself: the world's origin as the camera has it, not the camera.")
def the_vector_t(R, t):
    return t


@CENTRE.wrong("This is −t, still in the *camera's* axes. Turn it into the world's.")
def minus_t(R, t):
    return -t


@CENTRE.wrong("This is −R t. R takes the world's axes to the camera's; you need the way back, and that is Rᵀ.")
def turned_forwards(R, t):
    return -R @ t


@CENTRE.wrong("This is the third row of R: the direction in which the camera *looks*.")
def optical_axis(R, t):
    return R[2]


# 2: find the bug in a chain ------------------------------------------------------------------------------------------


def chain(world_from_cam: Array, world_from_board: Array) -> Array:
    """cam_from_board = cam_from_world world_from_board, 4×4."""
    return np.linalg.inv(world_from_cam) @ world_from_board


def chain_as_given(world_from_cam, world_from_board):
    return world_from_board @ np.linalg.inv(world_from_cam)


def _chain_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((), (), (5,)):
        yield _rigid(rng, *shape), _rigid(rng, *shape)


CHAIN = Exercise(
    name="04.chain",
    reference=chain,
    cases=_chain_cases,
    tolerance=SINGLE_PRECISION,
    as_given=chain_as_given,
    hints=(
        "Write down the name of each factor in the product, from left to right. Which two names stand side by side?",
        "Neighbours must cancel, and what is left over must read *cam … board*. To turn a transform round, invert its "
        "matrix and swap its names.",
        "`cam_from_world = np.linalg.inv(___)`, then `return cam_from_world @ ___`",
    ),
    praise="cam_from_world · world_from_board: the worlds cancel. With names like these the order cannot go wrong.",
)


@CHAIN.right
def solved_for_the_board(world_from_cam, world_from_board):
    return np.linalg.solve(world_from_cam, world_from_board)


@CHAIN.right
def chained_in_single_precision(world_from_cam, world_from_board):
    return np.linalg.inv(world_from_cam.astype(np.float32)) @ world_from_board.astype(np.float32)


@CHAIN.wrong("This is world_from_cam · world_from_board. Between the factors stand *cam* and *world*: invert one.")
def nothing_inverted(world_from_cam, world_from_board):
    return world_from_cam @ world_from_board


@CHAIN.wrong("This is board_from_world · world_from_cam, the inverse of what is wanted.")
def inverse_of_the_answer(world_from_cam, world_from_board):
    return np.linalg.inv(world_from_board) @ world_from_cam


@CHAIN.wrong("This is world_from_cam · board_from_world. You inverted the other of the two.")
def the_other_inverted(world_from_cam, world_from_board):
    return world_from_cam @ np.linalg.inv(world_from_board)


@CHAIN.wrong("This is cam_from_world · board_from_world. You inverted both: the board's transform was right.")
def both_inverted(world_from_cam, world_from_board):
    return np.linalg.inv(world_from_cam) @ np.linalg.inv(world_from_board)


@CHAIN.wrong("The transpose inverts a 3×3 rotation, but not the 4×4 matrix with its translation.")
def transposed_for_inverse(world_from_cam, world_from_board):
    return _transposed(world_from_cam) @ world_from_board


@CHAIN.wrong("The rotation is right. The translation is still in the *world's* axes: turn it.")
def translations_subtracted(world_from_cam, world_from_board):
    answer = chain(world_from_cam, world_from_board)
    answer[..., :3, 3] = world_from_board[..., :3, 3] - world_from_cam[..., :3, 3]
    return answer


# 3: is it a rotation? ------------------------------------------------------------------------------------------------


def is_rotation(M: Array) -> bool:
    """Rᵀ R = I and det R = +1, but for rounding."""
    return _orthogonal(M, ROUNDING) and bool(abs(np.linalg.det(M) - 1) < ROUNDING)


def _orthogonal(M: Array, tolerance: float) -> bool:
    return bool(np.allclose(M.T @ M, np.eye(3), rtol=0, atol=tolerance))


def _leaning(rng: np.random.Generator, lean: float) -> Array:
    """A rotation but for its second column, which leans towards the first by `lean`; both have length 1."""
    return _rotation(rng) @ np.array([[1, lean, 0], [0, np.sqrt(1 - lean**2), 0], [0, 0, 1]])


def _stretched_along_its_axis(rng: np.random.Generator, stretch: float) -> Array:
    """A rotation about an axis that keeps volumes and stretches the axis: MMᵀ is as far off as MᵀM."""
    axis = np.eye(3)[rng.integers(3)]
    turn = Rotation.from_rotvec(rng.uniform(0.5, 3) * axis).as_matrix()
    return np.asarray(turn @ np.diag(1 - stretch / 2 + 1.5 * stretch * axis))


def _is_rotation_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    matrices = _rotations_and_others(rng)
    for index in rng.permutation(len(matrices)):
        yield (matrices[index],)


def _rotations_and_others(rng: np.random.Generator) -> list[Array]:
    stretch = float(rng.uniform(1.2, 3.0))
    return [
        _rotation(rng),
        np.eye(3)[rng.permutation([[2, 0, 1], [1, 2, 0]])[0]],  # axes renamed, without any rounding
        _rotation(rng) @ np.diag([1.0, -1.0, 1.0]),  # a mirror
        (1 - 1e-7) * _rotation(rng) @ np.diag([1.0, -1.0, 1.0]),  # a mirror, rounded
        stretch * _rotation(rng),
        _rotation(rng) @ np.diag([stretch, 1 / stretch, 1.0]),  # keeps volumes, not lengths
        _rotation(rng) @ np.diag([1.2, 1 / 1.2, 1.0]),
        _rotation(rng) @ np.diag([1 + 2.5e-6, 1 - 2.5e-6, 1.0]),  # five times as far off as is allowed
        (1 + 2e-7) * _rotation(rng),  # 4e-7 and 6e-7 off, which is allowed
        (1 + 3.3e-7) * _rotation(rng),  # the determinant is 0.99e-6 off
        (1 - 3.3e-7) * _rotation(rng),
        _stretched_along_its_axis(rng, float(rng.choice([-1, 1])) * 4.95e-7),  # the squares of lengths are 0.99e-6 off
        _stretched_along_its_axis(rng, 1.02e-6),  # off by more than is allowed in the lengths themselves, too
        _stretched_along_its_axis(rng, -1.02e-6),
        np.eye(3) + np.diag([4.95e-7, 0], 1) + np.diag([4.95e-7, 0], -1),
        np.eye(3) + np.diag([1.02e-6, 0], 1) + np.diag([1.02e-6, 0], -1),
        _leaning(rng, float(rng.uniform(2e-7, 4e-7))),  # as single precision leaves a rotation
        _leaning(rng, float(rng.uniform(6e-6, 9e-6))),
        _leaning(rng, -float(rng.uniform(6e-6, 9e-6))),
        _leaning(rng, float(rng.uniform(4e-4, 6e-4))),
        _leaning(rng, float(rng.uniform(4e-4, 6e-4))).T,  # rows that lean
        _leaning(rng, float(rng.uniform(0.3, 0.6))),
        _leaning(rng, float(rng.uniform(0.3, 0.6))).T,
    ]


IS_ROTATION = Exercise(
    name="04.is_rotation",
    reference=is_rotation,
    cases=_is_rotation_cases,
    shown=((np.eye(3),), (2 * np.eye(3),)),
    hints=(
        "Two things must hold. The first is that lengths and angles are kept. What tells a rotation from a mirror?",
        "The columns of M have length 1 and are perpendicular to each other when MᵀM is the identity. The "
        "determinant of a rotation is +1. `np.allclose` compares whole matrices; give it `rtol=0, atol=1e-6`, for "
        "its own tolerances are others.",
        "`keeps_lengths = np.allclose(___, np.eye(3), rtol=0, atol=1e-6)`, then `keeps_hands = abs(___ - 1) < 1e-6`",
    ),
    praise="Lengths, angles and handedness: whatever keeps these three is a rotation.",
)


@IS_ROTATION.wrong("`np.allclose` adds its `rtol`, 1e-5 by default, to your `atol`: give it `rtol=0`.")
def with_the_relative_tolerance_left_on(M):
    return np.allclose(M.T @ M, np.eye(3), atol=1e-6) and abs(np.linalg.det(M) - 1) < 1e-6


@IS_ROTATION.right
def with_the_sign_of_the_determinant(M):
    return np.abs(M @ M.T - np.eye(3)).max() < 1e-6 and np.linalg.det(M) > 0


@IS_ROTATION.right
def element_by_element_in_a_loop(M):
    for i in range(3):
        for j in range(3):
            if abs(sum(M[k, i] * M[k, j] for k in range(3)) - (i == j)) > 1e-6:
                return False
    return np.isclose(np.linalg.det(M), 1.0)


@IS_ROTATION.wrong("A mirror passes your test: it keeps lengths and angles too. Look at the determinant.")
def mirrors_pass(M):
    return _orthogonal(M, ROUNDING)


@IS_ROTATION.wrong("A determinant of 1 keeps *volumes*. A stretch along x with a squeeze along y does that too.")
def determinant_alone(M):
    return abs(np.linalg.det(M) - 1) < ROUNDING


@IS_ROTATION.wrong("`==` allows no rounding. Ask whether the difference is less than `1e-6`.")
def exactly(M):
    return np.array_equal(M.T @ M, np.eye(3)) and np.linalg.det(M) == 1


@IS_ROTATION.wrong("A matrix whose columns *lean* towards each other passes. They must be perpendicular as well.")
def unit_columns(M):
    return bool(np.abs(np.linalg.norm(M, axis=0) - 1).max() < ROUNDING and np.linalg.det(M) > 0)


@IS_ROTATION.wrong("`np.allclose` allows `1e-8` at a 0: most rotations that were saved in single precision fail.")
def tolerance_of_allclose(M):
    return np.allclose(M.T @ M, np.eye(3)) and np.isclose(np.linalg.det(M), 1)


# 4: the way back -----------------------------------------------------------------------------------------------------


def invert(T: Array) -> Array:
    """[R t; 0 1]⁻¹ = [Rᵀ -Rᵀt; 0 1] for rigid transforms (..., 4, 4)."""
    back = _transposed(T[..., :3, :3])
    return _assembled(back, -back @ T[..., :3, 3:])


def _invert_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((), (), (1,), (4,), (2, 3)):
        yield (_rigid(rng, *shape),)


INVERT = Exercise(
    name="04.invert",
    reference=invert,
    cases=_invert_cases,
    tolerance=SINGLE_PRECISION,
    hints=(
        "Solve X' = R X + t for X. What stands in the place of R then, and what in the place of t?",
        "The rotation is turned back by its transpose; for arrays, `np.swapaxes(…, -1, -2)` swaps the last two axes "
        "only. `T[..., :3, 3:]`, with `3:` and not `3`, keeps t as a column, so that a matrix can multiply it. The "
        "last row stays (0, 0, 0, 1).",
        "`inverse[..., :3, 3:] = ___ @ T[..., :3, 3:]`",
    ),
    praise="No general inverse is needed: a transpose and one product. The new translation is the old centre.",
)


@INVERT.right
def by_the_general_inverse(T):
    return np.linalg.inv(T)


@INVERT.right
def by_einsum_in_single_precision(T):
    inverse = np.array(T, dtype=np.float32)
    inverse[..., :3, :3] = np.einsum("...ij->...ji", T[..., :3, :3])
    inverse[..., :3, 3] = -np.einsum("...ji,...j->...i", T[..., :3, :3], T[..., :3, 3])
    return inverse


@INVERT.wrong("This is the transpose of the whole 4×4 matrix. Only the 3×3 rotation is inverted by transposing.")
def only_transposed(T):
    return _transposed(T)


@INVERT.wrong("The rotation is right. The translation is not just −t: it has to be turned as well, −Rᵀ t.")
def only_negated(T):
    return _assembled(_transposed(T[..., :3, :3]), -T[..., :3, 3:])


@INVERT.wrong("The translation must be turned by the *new* rotation: −Rᵀ t, where you have −R t.")
def turned_by_the_old_rotation(T):
    return _assembled(_transposed(T[..., :3, :3]), -T[..., :3, :3] @ T[..., :3, 3:])


@INVERT.wrong("The sign is missing: the new translation is −Rᵀ t.")
def without_the_minus(T):
    back = _transposed(T[..., :3, :3])
    return _assembled(back, back @ T[..., :3, 3:])


@INVERT.wrong("The last row is missing: it is (0, 0, 0, 1), and your corner holds a 0.")
def without_the_one(T):
    answer = invert(T)
    answer[..., 3, 3] = 0
    return answer


# 5: Rodrigues --------------------------------------------------------------------------------------------------------


def rodrigues(r: Array) -> Array:
    """R = I + sin θ [k]ₓ + (1 - cos θ) [k]ₓ² of the rotation vector r = θ k."""
    angle = np.linalg.norm(r)
    if angle == 0:
        return np.eye(3)
    k = _cross(r / angle)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def _cross(k: Array) -> Array:
    """[k]ₓ, the matrix with [k]ₓ v = k × v."""
    return np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])


def _parts(r: Array) -> tuple[float, Array, Array]:
    """Angle, axis and [k]ₓ of a rotation vector; the axis of (0, 0, 0) is (0, 0, 0)."""
    angle = float(np.linalg.norm(r))
    k = r / angle if angle else r
    return angle, k, _cross(k)


def _rodrigues_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    sides = rng.choice([-1, 1], 3)
    for low, high in ((0.4, 1.4), (1.7, 3.0), (3.3, 6.0), (1e-4, 1e-3)):
        sides = -sides  # to either side of each axis
        axis = rng.uniform(0.2, 1, 3) * sides
        yield (float(rng.uniform(low, high)) * axis / np.linalg.norm(axis),)
    yield (np.array([np.pi, 0, 0])[rng.permutation(3)],)
    yield (np.zeros(3),)


RODRIGUES = Exercise(
    name="04.rodrigues",
    reference=rodrigues,
    cases=_rodrigues_cases,
    tolerance=SINGLE_PRECISION,
    shown=((np.array([0.0, 0.0, np.pi / 2]),),),
    hints=(
        "The angle θ is the length of r, and the axis k is r divided by it. What if the length is zero?",
        "[k]ₓ is the matrix of the cross product that stands above the formula. Its square is a matrix product, by "
        "`@`. Return `np.eye(3)` before you divide by zero.",
        "`return np.eye(3) + ___ * K + ___ * K @ K`",
    ),
    praise="This is `cv2.Rodrigues`, and all that a calibration file means by its three numbers.",
)


@RODRIGUES.right
def as_opencv_does_it(r):
    import cv2

    return cv2.Rodrigues(r)[0]


@RODRIGUES.right
def by_turning_the_axes_in_single_precision(r):
    angle, k, _ = _parts(r.astype(np.float32))
    turned = [
        v * np.cos(angle) + np.cross(k, v) * np.sin(angle) + k * (k @ v) * (1 - np.cos(angle))
        for v in np.eye(3, dtype=np.float32)
    ]
    return np.stack(turned, axis=-1)


@RODRIGUES.wrong("You put r itself into [·]ₓ. It takes the unit vector k = r/θ.")
def not_a_unit_vector(r):
    angle, K = np.linalg.norm(r), _cross(r)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@RODRIGUES.wrong("`K**2` squares every element. [k]ₓ² is the matrix product, `K @ K`.")
def squared_elements(r):
    angle, _, K = _parts(r)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K**2


@RODRIGUES.wrong("Right, but for (0, 0, 0): there you divide zero by zero. A turn by nothing is the identity.")
def no_case_for_zero(r):
    with np.errstate(invalid="ignore"):
        K = _cross(r / np.linalg.norm(r))
    angle = np.linalg.norm(r)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@RODRIGUES.wrong("k kᵀ is not [k]ₓ²: the two differ by the identity, [k]ₓ² = k kᵀ − I.")
def outer_product_for_the_square(r):
    angle, k, K = _parts(r)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * np.outer(k, k)


@RODRIGUES.wrong("You took the three numbers for angles about x, y and z. They are *one* turn, about r/θ by θ.")
def three_angles(r):
    return Rotation.from_euler("XYZ", r).as_matrix()


EXERCISES = (CENTRE, CHAIN, RODRIGUES, INVERT, IS_ROTATION)
