"""Lesson 04, extrinsics: the camera's centre, a chain in the wrong order, what a rotation is, inverse, Rodrigues.

A transform is named to_from_from and acts on column vectors: X_cam = R X_world + t.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import Arguments, Array, Exercise
from camviz.poses import Rotation

TOLERANCE = 1e-6  # how far from a rotation rounding may take a matrix


def centre(R: Array, t: Array) -> Array:
    """C = -Rᵀ t, the point that R C + t = 0 takes to the camera's origin."""
    return -R.T @ t


def chain(world_from_cam: Array, world_from_board: Array) -> Array:
    """cam_from_board = cam_from_world world_from_board, 4×4."""
    return np.linalg.inv(world_from_cam) @ world_from_board


def is_rotation(M: Array) -> bool:
    """Rᵀ R = I and det R = +1, but for rounding."""
    return _orthogonal(M) and _has_unit_determinant(M)


def invert(T: Array) -> Array:
    """[R t; 0 1]⁻¹ = [Rᵀ -Rᵀt; 0 1] for rigid transforms (..., 4, 4)."""
    back = np.swapaxes(T[..., :3, :3], -1, -2)
    inverse = np.zeros_like(T)
    inverse[..., :3, :3], inverse[..., :3, 3:], inverse[..., 3, 3] = back, -back @ T[..., :3, 3:], 1
    return inverse


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


def _orthogonal(M: Array) -> bool:
    return bool(np.allclose(M.T @ M, np.eye(3), rtol=0, atol=TOLERANCE))


def _has_unit_determinant(M: Array) -> bool:
    return bool(abs(np.linalg.det(M) - 1) < TOLERANCE)


def _rotation(rng: np.random.Generator) -> Array:
    return np.asarray(Rotation.random(rng=rng).as_matrix())


def _rigid(rng: np.random.Generator, *shape: int) -> Array:
    transforms = np.zeros((*shape, 4, 4))
    for index in np.ndindex(shape):
        transforms[index][:3, :3], transforms[index][:3, 3] = _rotation(rng), rng.uniform(-3, 3, 3)
    transforms[..., 3, 3] = 1
    return transforms


def _centre_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield _rotation(rng), rng.uniform(-3, 3, 3)


def _chain_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((), (), (5,)):
        yield _rigid(rng, *shape), _rigid(rng, *shape)


def _is_rotation_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    matrices = _rotations_and_others(rng)
    for index in rng.permutation(len(matrices)):
        yield (matrices[index],)


def _rotations_and_others(rng: np.random.Generator) -> list[Array]:
    stretch = float(rng.uniform(1.2, 3.0))
    return [
        _rotation(rng),
        _rotation(rng) @ np.diag([1.0, -1.0, 1.0]),  # a mirror
        -_rotation(rng),
        float(rng.uniform(1.2, 3.0)) * _rotation(rng),
        _rotation(rng) @ np.diag([stretch, 1 / stretch, 1.0]),  # keeps volumes, not lengths
        np.eye(3)[[2, 0, 1]],
        np.eye(3)[[1, 0, 2]],
        _rotation(rng) + rng.uniform(-1e-12, 1e-12, (3, 3)),
        _rotation(rng) + rng.uniform(0.02, 0.05, (3, 3)),
        np.zeros((3, 3)),
    ]


def _invert_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((), (), (1,), (4,), (2, 3)):
        yield (_rigid(rng, *shape),)


def _rodrigues_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for low, high in ((0.2, 1.5), (1.5, 3.1), (3.3, 6.0), (1e-4, 1e-3)):
        axis = rng.normal(size=3)
        yield (float(rng.uniform(low, high)) * axis / np.linalg.norm(axis),)
    yield (np.array([np.pi, 0, 0])[rng.permutation(3)],)
    yield (np.zeros(3),)


def _unnormalised(r: Array) -> Array:
    angle = np.linalg.norm(r)
    return np.eye(3) + np.sin(angle) * _cross(r) + (1 - np.cos(angle)) * _cross(r) @ _cross(r)


def _squared_elements(r: Array) -> Array:
    angle = np.linalg.norm(r)
    k = _cross(r / angle) if angle else _cross(r)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k**2


def _in_degrees(r: Array) -> Array:
    return rodrigues(np.radians(r))


def _only_transposed(T: Array) -> Array:
    return np.swapaxes(T, -1, -2)


def _only_negated(T: Array) -> Array:
    back = invert(T)
    back[..., :3, 3] = -T[..., :3, 3]
    return back


def _forward_turn(T: Array) -> Array:
    back = invert(T)
    back[..., :3, 3:] = -T[..., :3, :3] @ T[..., :3, 3:]
    return back


CENTRE = Exercise(
    name="04.centre",
    reference=centre,
    cases=_centre_cases,
    shown=((np.eye(3), np.array([0.0, 0.0, 1.0])),),
    hints=(
        "The camera's centre is the one point of the world that has camera coordinates (0, 0, 0).",
        "Solve R C + t = 0 for C. R is a rotation, so that its inverse is its transpose, `R.T`.",
    ),
    praise="That is where the camera stands. Put it back: R C + t is zero.",
)


@CENTRE.wrong("This is t itself: the world's origin as the camera has it, not the camera.")
def _(R, t):
    return t


@CENTRE.wrong(
    "This is −t, which is right only for a camera that is not turned. −t is still in the *camera's* axes: turn "
    "it into the world's."
)
def _(R, t):
    return -t


@CENTRE.wrong("This is −R t. R takes the world's axes to the camera's; you need the way back, and that is Rᵀ.")
def _(R, t):
    return -R @ t


@CENTRE.wrong("Only the sign is missing: R C + t = 0 has C = *minus* Rᵀ t.")
def _(R, t):
    return R.T @ t


@CENTRE.wrong("This is R t. Solve R C + t = 0 for C: the sign changes, and R goes to the other side.")
def _(R, t):
    return R @ t


CHAIN = Exercise(
    name="04.chain",
    reference=chain,
    cases=_chain_cases,
    bug=True,
    hints=(
        "Write down the name of each factor in the product, and see whether neighbouring names cancel.",
        "cam_from_board = cam_from_world · world_from_board: the two *world* stand side by side. Which of the two is "
        "the inverse of what you were given?",
    ),
    praise="cam_from_world · world_from_board: the worlds cancel. With names like these the order cannot go wrong.",
)


@CHAIN.wrong(
    "This is world_from_board · cam_from_world. Between the factors stand *board* and *cam*, which do not "
    "cancel: the order is wrong."
)
def _(world_from_cam, world_from_board):
    return world_from_board @ np.linalg.inv(world_from_cam)


@CHAIN.wrong(
    "This is world_from_cam · world_from_board. Between the factors stand *cam* and *world*: one of the two "
    "has to be inverted first."
)
def _(world_from_cam, world_from_board):
    return world_from_cam @ world_from_board


@CHAIN.wrong(
    "This is board_from_world · world_from_cam = board_from_cam: it cancels, but it is the inverse of what is wanted."
)
def _(world_from_cam, world_from_board):
    return np.linalg.inv(world_from_board) @ world_from_cam


@CHAIN.wrong("This is world_from_cam · board_from_world: you inverted the other of the two.")
def _(world_from_cam, world_from_board):
    return world_from_cam @ np.linalg.inv(world_from_board)


IS_ROTATION = Exercise(
    name="04.is_rotation",
    reference=is_rotation,
    cases=_is_rotation_cases,
    shown=((np.eye(3),), (2 * np.eye(3),)),
    hints=(
        "Two things must hold. Lengths and angles are kept when MᵀM = I. What tells a rotation from a mirror?",
        "`np.allclose(M.T @ M, np.eye(3))`, and `np.linalg.det(M)` is +1 but for rounding.",
    ),
    praise="Lengths, angles and handedness: whatever keeps these three is a rotation.",
)

IS_ROTATION.wrong(
    "A mirror passes your test: it keeps lengths and angles too, but turns a right hand into a left one. Look "
    "at the determinant."
)(_orthogonal)


IS_ROTATION.wrong(
    "A determinant of 1 says that *volumes* are kept. A stretch along x with a squeeze along y does that too."
)(_has_unit_determinant)


@IS_ROTATION.wrong(
    "A determinant of ±1 says that *volumes* are kept. A mirror passes, and so does a stretch along x with a "
    "squeeze along y."
)
def _(M):
    return bool(abs(abs(np.linalg.det(M)) - 1) < TOLERANCE)


@IS_ROTATION.wrong(
    "`==` allows no rounding: nearly every rotation fails. Ask whether the difference is less than 1e-6."
)
def _(M):
    return bool(np.array_equal(M.T @ M, np.eye(3)) and np.linalg.det(M) == 1)


@IS_ROTATION.wrong("Every answer is the opposite of the right one.")
def _(M):
    return not is_rotation(M)


INVERT = Exercise(
    name="04.invert",
    reference=invert,
    cases=_invert_cases,
    hints=(
        "Solve X' = R X + t for X. What stands in the place of R then, and what in the place of t?",
        "X = Rᵀ X' − Rᵀ t. For arrays (..., 4, 4), `np.swapaxes(T[..., :3, :3], -1, -2)` is Rᵀ, and "
        "`T[..., :3, 3:]` keeps t as a column so that `@` works.",
    ),
    praise="No general inverse is needed: a transpose and one product. The new translation is the old centre.",
)

INVERT.wrong("This is the transpose of the whole 4×4 matrix. Only the 3×3 rotation is inverted by transposing.")(
    _only_transposed
)


INVERT.wrong("The rotation is right. The translation is not just −t: it has to be turned as well, −Rᵀ t.")(
    _only_negated
)


INVERT.wrong("The translation must be turned by the *new* rotation: −Rᵀ t, where you have −R t.")(_forward_turn)


@INVERT.wrong("This applies the transform twice; the inverse undoes it.")
def _(T):
    return T @ T


RODRIGUES = Exercise(
    name="04.rodrigues",
    reference=rodrigues,
    cases=_rodrigues_cases,
    shown=((np.array([0.0, 0.0, np.pi / 2]),),),
    hints=(
        "The angle θ is the length of r, and the axis k is r divided by it. What if the length is zero?",
        "[k]ₓ = [[0, −k₃, k₂], [k₃, 0, −k₁], [−k₂, k₁, 0]], and [k]ₓ² is the matrix product `K @ K`. Return "
        "`np.eye(3)` before you divide by zero.",
    ),
    praise="This is `cv2.Rodrigues`, and all that a calibration file means by its three numbers.",
)

RODRIGUES.wrong(
    "You put r itself into [·]ₓ. The formula wants the unit vector k = r/θ there; the angle is in the sine and "
    "cosine already."
)(_unnormalised)


RODRIGUES.wrong("`K**2` squares every element. [k]ₓ² is the matrix product, `K @ K`.")(_squared_elements)


RODRIGUES.wrong("You convert from degrees, but the length of r is in radians already.")(_in_degrees)


EXERCISES = (CENTRE, CHAIN, IS_ROTATION, INVERT, RODRIGUES)
