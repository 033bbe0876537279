"""Lesson 07, epipolar geometry: F from two cameras, lines and epipoles, the eight-point algorithm, cheirality, errors.

x_rightᵀ F x_left = 0, right_from_left = [R | t]. After Hartley & Zisserman (2004), chapters 9 and 11.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from camviz.poses import Rotation
from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise
from camviz_school.course.laws import error_ratio, unused_row
from camviz_school.course.trials import Function

# What several of them need -------------------------------------------------------------------------------------------


def cross_matrix(t: Array) -> Array:
    """[t]× (3, 3), so that [t]× w = t × w."""
    x, y, z = t
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def _one_scale(F: Array) -> Array:
    """A matrix F of any scale and sign in one form, counted in thousands of pixels so that all its entries matter."""
    if F.shape != (3, 3):
        return F
    D = np.diag([1000.0, 1000.0, 1.0])
    F = D @ F @ D
    return F / np.linalg.norm(F) * np.sign(F.flat[np.abs(F).argmax()])


def _K(rng: np.random.Generator) -> Array:
    return np.array(
        [
            [rng.uniform(300, 900), 0, rng.uniform(250, 390)],
            [0, rng.uniform(300, 900), rng.uniform(180, 300)],
            [0, 0, 1],
        ]
    )


def _shifted_K(rng: np.random.Generator) -> Array:
    """The same of a picture whose principal point lies beyond its upper left corner."""
    return _K(rng) * [[1, 1, -1], [1, 1, -1], [1, 1, 1]]


def _motion(rng: np.random.Generator) -> tuple[Array, Array]:
    """A right camera beside the left one and a little in front of it or behind it, looking much the same way."""
    R = Rotation.from_rotvec(rng.uniform(0.05, 0.3, 3) * rng.choice([-1, 1], 3)).as_matrix()
    return R, np.array([-rng.uniform(0.3, 1), rng.uniform(-0.3, 0.3), rng.uniform(0.2, 0.6) * rng.choice([-1, 1])])


def _F(rng: np.random.Generator) -> Array:
    return fundamental(_K(rng), _K(rng), *_motion(rng))


def _homogeneous(uv: Array) -> Array:
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# 1: F from two cameras -----------------------------------------------------------------------------------------------


def fundamental(K_left: Array, K_right: Array, R: Array, t: Array) -> Array:
    """F = K_right⁻ᵀ [t]× R K_left⁻¹, of any scale."""
    return np.linalg.inv(K_right).T @ cross_matrix(t) @ R @ np.linalg.inv(K_left)


def _fundamental_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield (_K(rng), _K(rng), *_motion(rng))
    yield (_shifted_K(rng), _shifted_K(rng), *_motion(rng))


FUNDAMENTAL = Exercise(
    name="07.fundamental",
    reference=fundamental,
    cases=_fundamental_cases,
    canonical=_one_scale,
    tolerance=1e-7,
    hints=(
        "Begin with E = [t]× R, which holds for rays. What makes a ray of a pixel?",
        "Put r = K⁻¹ x for either picture into r_rightᵀ E r_left = 0, and use (A B)ᵀ = Bᵀ Aᵀ. What then stands between "
        "x_rightᵀ and x_left is F.",
        "`return np.linalg.inv(___).T @ E @ np.linalg.inv(___)`",
    ),
    praise="It is the matrix that camviz and OpenCV use, up to its scale, which says nothing.",
)


@FUNDAMENTAL.right
def with_the_epipole_in_front(K_left, K_right, R, t):
    """F = [e_right]× K_right R K_left⁻¹ with e_right = K_right t (Hartley & Zisserman 2004, eq. 9.4)."""
    return cross_matrix(K_right @ t) @ K_right @ R @ np.linalg.inv(K_left)


@FUNDAMENTAL.right
def with_the_cross_product_behind_the_rotation(K_left, K_right, R, t):
    """[t]× R = R [Rᵀ t]×."""
    return np.linalg.solve(K_right.T, R @ cross_matrix(R.T @ t)) @ np.linalg.inv(K_left)


@FUNDAMENTAL.right
def column_by_column_and_with_the_other_sign(K_left, K_right, R, t):
    turned = (R @ np.linalg.inv(K_left)).T
    return np.linalg.inv(K_right).T @ np.column_stack([np.cross(column, t) for column in turned])


@FUNDAMENTAL.wrong("The camera matrices have changed places: x_left stands on the right of F, so K_left⁻¹ does too.")
def cameras_swapped(K_left, K_right, R, t):
    return np.linalg.inv(K_left).T @ cross_matrix(t) @ R @ np.linalg.inv(K_right)


@FUNDAMENTAL.wrong("This is E, which takes rays. Pixels become rays by the inverse camera matrices.")
def essential_alone(K_left, K_right, R, t):
    return cross_matrix(t) @ R


@FUNDAMENTAL.wrong("This is the way from F to E. From E to F the camera matrices are *inverted*.")
def camera_matrices_not_inverted(K_left, K_right, R, t):
    return K_right.T @ cross_matrix(t) @ R @ K_left


@FUNDAMENTAL.wrong("R is transposed here: right_from_left turns a ray of the left camera into the right one's frame.")
def rotation_transposed(K_left, K_right, R, t):
    return fundamental(K_left, K_right, R.T, t)


@FUNDAMENTAL.wrong("This is R [t]×. The translation comes after the rotation: E = [t]× R.")
def translation_before_rotation(K_left, K_right, R, t):
    return np.linalg.inv(K_right).T @ R @ cross_matrix(t) @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("K_right⁻¹ must be transposed: it comes out of (K_right⁻¹ x_right)ᵀ.")
def right_inverse_not_transposed(K_left, K_right, R, t):
    return np.linalg.inv(K_right) @ cross_matrix(t) @ R @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("You transposed both inverses. Only the right pixel is transposed in x_rightᵀ F x_left.")
def both_inverses_transposed(K_left, K_right, R, t):
    return np.linalg.inv(K_right).T @ cross_matrix(t) @ R @ np.linalg.inv(K_left).T


@FUNDAMENTAL.wrong("You used the centre C = −Rᵀt in place of t. The two are in different frames.")
def centre_for_t(K_left, K_right, R, t):
    return fundamental(K_left, K_right, R, -R.T @ t)


@FUNDAMENTAL.wrong("K_left stands on both sides. The right pixel becomes a ray by the *right* camera's matrix.")
def one_camera_for_both(K_left, K_right, R, t):
    return fundamental(K_left, K_left, R, t)


@FUNDAMENTAL.wrong("This is Fᵀ, which asks for x_leftᵀ … x_right. Here the right pixel stands first.")
def from_right_to_left(K_left, K_right, R, t):
    return fundamental(K_left, K_right, R, t).T


@FUNDAMENTAL.wrong("R is missing: the left ray is still in the left camera's frame, and t is in the right one's.")
def rotation_forgotten(K_left, K_right, R, t):
    return fundamental(K_left, K_right, np.eye(3), t)


# 2: the line of a point ----------------------------------------------------------------------------------------------


def epipolar_line(F: Array, uv_left: Array) -> Array:
    """l = F x (..., 3) of left pixels (..., 2), with a² + b² = 1."""
    line = _homogeneous(uv_left) @ F.T
    return line / np.linalg.norm(line[..., :2], axis=-1, keepdims=True)


def _one_sign(lines: Array) -> Array:
    """Lines (..., 3), of which l and −l are the same, with the larger of a and b positive."""
    if lines.shape[-1:] != (3,):
        return lines
    larger = np.take_along_axis(lines, np.abs(lines[..., :2]).argmax(axis=-1)[..., None], axis=-1)
    return lines * np.where(larger < 0, -1, 1)


def _line_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_F(rng), rng.uniform(0, 480, (*shape, 2)))
    F = fundamental(_shifted_K(rng), _shifted_K(rng), *_motion(rng))
    yield (F, rng.uniform(-480, 0, (4, 2)))
    yield (F * [[-1], [1], [1]], rng.uniform(-480, 0, (4, 2)))  # its lines fall where those of the last one rise


LINE = Exercise(
    name="07.epipolar_line",
    reference=epipolar_line,
    cases=_line_cases,
    canonical=_one_sign,
    tolerance=1e-8,
    hints=(
        "Append a 1 to each pixel and multiply by F. Then choose the scale so that a² + b² = 1.",
        "For points in rows, the product F x becomes x times Fᵀ. `np.linalg.norm(…, axis=-1, keepdims=True)` keeps an "
        "axis of length 1, so that each line is divided by its own length.",
        "`return line / np.linalg.norm(___, axis=-1, keepdims=True)`",
    ),
    praise="With a² + b² = 1 the number a u + b v + c is a distance in pixels, which is what one wants to look at.",
)


@LINE.right
def as_opencv_has_them(F, uv_left):
    import cv2

    return cv2.computeCorrespondEpilines(uv_left.reshape(-1, 1, 2).astype(float), 1, F).reshape(*uv_left.shape[:-1], 3)


@LINE.right
def number_by_number(F, uv_left):
    u, v = np.moveaxis(uv_left, -1, 0)
    a, b, c = (row[0] * u + row[1] * v + row[2] for row in F)
    return np.stack([a, b, c], axis=-1) / np.hypot(a, b)[..., None]


@LINE.right
def with_the_other_sign(F, uv_left):
    line = -np.einsum("ij,...j->...i", F, _homogeneous(uv_left))
    return line / np.sqrt(line[..., :1] ** 2 + line[..., 1:2] ** 2)


@LINE.wrong("This is Fᵀ x, the line in the *left* picture of a right point. (For rows, l = F x is `x @ F.T`.)")
def transposed(F, uv_left):
    return epipolar_line(F.T, uv_left)


@LINE.wrong("The line is right, but its scale is arbitrary: divide by √(a² + b²), so that a u + b v + c is in pixels.")
def not_scaled(F, uv_left):
    return _homogeneous(uv_left) @ F.T


@LINE.wrong("You divide by the length of all three numbers. Only a and b make the direction: a² + b² = 1.")
def all_three_scaled(F, uv_left):
    return _unit(epipolar_line(F, uv_left))


@LINE.wrong("u and v have changed places. A pixel is (column, row).")
def rows_for_columns(F, uv_left):
    return epipolar_line(F, uv_left[..., ::-1])


@LINE.wrong("You divide by a² + b². It is its *root* that is the length.")
def root_forgotten(F, uv_left):
    line = _homogeneous(uv_left) @ F.T
    return line / np.sum(line[..., :2] ** 2, axis=-1, keepdims=True)


@LINE.wrong("You appended a 0. That is a direction, a point at infinity; a pixel is (u, v, 1).")
def zero_appended(F, uv_left):
    line = np.concatenate([uv_left, np.zeros_like(uv_left[..., :1])], axis=-1) @ F.T
    return line / np.linalg.norm(line[..., :2], axis=-1, keepdims=True)


@LINE.wrong("You divide all lines by one length. Each line has its own: take the norm along the last axis only.")
def one_length_for_all(F, uv_left):
    line = _homogeneous(uv_left) @ F.T
    return line / np.linalg.norm(line[..., :2])


@LINE.wrong("Your lines have c = 1. That is a scale, but a u + b v + c is then no distance: make a² + b² = 1.")
def last_number_one(F, uv_left):
    line = _homogeneous(uv_left) @ F.T
    return line / line[..., 2:]


@LINE.wrong(
    "For one point this is right. With points in rows, F x becomes `x @ F.T`, and so any number of them will do."
)
def only_for_one_point(F, uv_left):
    line = F @ _homogeneous(uv_left)
    return line / np.linalg.norm(line[..., :2], axis=-1, keepdims=True)


@LINE.wrong("Your a and b have changed places, so your line runs along where the right one runs across.")
def a_and_b_swapped(F, uv_left):
    return epipolar_line(F, uv_left)[..., [1, 0, 2]]


# 3: where all lines meet ---------------------------------------------------------------------------------------------


def right_epipole(F: Array) -> Array:
    """The pixel (2,) in the right picture that lies on all epipolar lines: Fᵀ e = 0."""
    e = np.linalg.svd(F)[0][:, 2]
    return e[:2] / e[2]


def _epipole_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Four pairs at least, and as many as it takes until a singular vector of either sign was among them."""
    signs: list[float] = []
    while len(signs) < 4 or len({*signs}) < 2:
        F = _F(rng)
        signs.append(np.sign(np.linalg.svd(F)[0][2, 2]))
        yield (F,)


EPIPOLE = Exercise(
    name="07.right_epipole",
    reference=right_epipole,
    cases=_epipole_cases,
    tolerance=1e-4,  # the smallest eigenvector of F Fᵀ, whose condition is that of F squared, is good enough
    hints=(
        "All lines F x pass through e, whatever x is: eᵀ F x = 0 for every x. What does that say of Fᵀ e?",
        "Fᵀ e = 0 is solved by the singular vector of the singular value 0. `np.linalg.svd(F)` returns U, s and Vt; U "
        "has the vectors for Fᵀ as its columns, the smallest last. The third number must become 1.",
        "`e = U[___]`",
    ),
    praise="That is where the right picture would show the left camera.",
)


@EPIPOLE.right
def where_two_lines_meet(F):
    one, other = epipolar_line(F, np.array([[100.0, 100.0], [500.0, 300.0]]))
    e = np.cross(one, other)
    return e[:2] / e[2]


@EPIPOLE.right
def at_right_angles_to_the_columns(F):
    """Fᵀ e = 0: e is perpendicular to each column of F, so it is the cross product of any two."""
    products = [np.cross(F[:, i], F[:, j]) for i, j in ((0, 1), (1, 2), (2, 0))]
    e = max(products, key=np.linalg.norm)
    return e[:2] / e[2]


@EPIPOLE.right
def in_thousands_of_pixels(F):
    D = np.diag([1e-3, 1e-3, 1])
    e = np.linalg.inv(D) @ np.linalg.svd((np.linalg.inv(D) @ F).T)[2][-1]
    return e[:2] / e[2]


@EPIPOLE.wrong("This is the left epipole, F e = 0: the last row of Vt. The right one solves Fᵀ e = 0.")
def left_epipole(F):
    return right_epipole(F.T)


@EPIPOLE.wrong("You took the last *row* of U. Its columns are the singular vectors.")
def row_of_U(F):
    e = np.linalg.svd(F)[0][2]
    return e[:2] / e[2]


@EPIPOLE.wrong(
    "You took the last *column* of Vt. Its singular vectors are its rows, and they belong to the left picture."
)
def column_of_Vt(F):
    e = np.linalg.svd(F)[2][:, 2]
    return e[:2] / e[2]


@EPIPOLE.wrong("The third number is not 1 yet: divide by it to get a pixel.")
def not_divided(F):
    return np.linalg.svd(F)[0][:2, 2]


@EPIPOLE.wrong("You return (u, v, 1). A pixel has two numbers here.")
def still_homogeneous(F):
    return np.append(right_epipole(F), 1.0)


@EPIPOLE.wrong("You took the first column of U, which belongs to the *largest* singular value. The value 0 comes last.")
def largest_singular_value(F):
    e = np.linalg.svd(F)[0][:, 0]
    return e[:2] / e[2]


@EPIPOLE.wrong("You took the second column of U. NumPy counts from 0: the third column is `2`.")
def second_column(F):
    e = np.linalg.svd(F)[0][:, 1]
    return e[:2] / e[2]


@EPIPOLE.wrong("u and v have changed places in what you return: a pixel is (column, row).")
def row_before_column(F):
    return right_epipole(F)[::-1]


@EPIPOLE.wrong("This is a point of *one* line, that of the pixel (0, 0). The epipole lies on the lines of all pixels.")
def end_of_one_line(F):
    return np.array([-F[2, 2] / F[0, 2], 0.0])


# 4: find the bug in the eight-point algorithm ------------------------------------------------------------------------

_NOT_NORMALISED = (
    "With exact points this is right. With noise your lines are farther off than they need be: the normalisation is "
    "left out."
)


def eight_point(uv_left: Array, uv_right: Array) -> Array:
    """F (3, 3) of pairs (n, 2) by the eight-point algorithm with Hartley's normalisation."""
    T_left, T_right = _normaliser(uv_left), _normaliser(uv_right)
    return T_right.T @ _linear(_moved(T_left, uv_left), _moved(T_right, uv_right)) @ T_left


def eight_point_as_given(uv_left, uv_right):
    T_left, T_right = _normaliser(uv_left), _normaliser(uv_right)
    return T_left.T @ _linear(_moved(T_left, uv_left), _moved(T_right, uv_right)) @ T_right


def _normaliser(uv: Array) -> Array:
    centre = uv.mean(axis=0)
    s = np.sqrt(2) / np.linalg.norm(uv - centre, axis=1).mean()
    return np.array([[s, 0, -s * centre[0]], [0, s, -s * centre[1]], [0, 0, 1]])


def _moved(T: Array, uv: Array) -> Array:
    return uv @ T[:2, :2].T + T[:2, 2]


def _linear(uv_left: Array, uv_right: Array) -> Array:
    A = (_homogeneous(uv_right)[:, :, None] * _homogeneous(uv_left)[:, None, :]).reshape(-1, 9)
    return _of_rank_two(np.linalg.svd(A)[2][-1].reshape(3, 3))


def _of_rank_two(F: Array) -> Array:
    U, s, Vt = np.linalg.svd(F)
    return U @ np.diag([s[0], s[1], 0]) @ Vt


def _pairs(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Exact pixels of n points in two cameras."""
    (R, t), points = _motion(rng), rng.uniform([-2, -1.5, 3], [2, 1.5, 8], (n, 3))
    left, right = points @ _K(rng).T, (points @ R.T + t) @ _K(rng).T
    return left[:, :2] / left[:, 2:], right[:, :2] / right[:, 2:]


def _eight_point_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (12, 20, 50):
        yield _pairs(rng, n)
    left, right = _pairs(rng, 30)
    yield left - 500, right - 400  # beyond the upper left corner, most of them


def _good_with_noise(function: Function, rng: np.random.Generator) -> str:
    """Any normalisation is about as good as Hartley's; none at all is more than twice as bad."""
    true = [_side_by_side(rng, 60) for _ in range(12)]
    noisy = [tuple(uv + rng.normal(0, 0.5, uv.shape) for uv in pair) for pair in true]
    unused = unused_row(function, tuple(uv[:20] for uv in noisy[0]), _one_scale)
    if unused is not None:
        return f"Your F does not change when pair {unused} of 20 moves. With noise every pair is needed."
    ratio = error_ratio(function, eight_point, noisy, lambda F, number: _typical_distance(F, *true[number]))
    return "" if ratio < 1.3 else _NOT_NORMALISED


def _side_by_side(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Exact pixels of n points all over the picture, seen by two equal cameras that stand side by side."""
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    R = Rotation.from_rotvec(rng.uniform(-0.1, 0.1, 3)).as_matrix()
    left = rng.uniform([40, 40], [600, 440], (n, 2))
    points = rng.uniform(2, 6, (n, 1)) * (_homogeneous(left) @ np.linalg.inv(K).T)
    right = (points @ R.T + (-0.7, *rng.uniform(-0.1, 0.1, 2))) @ K.T
    return left, right[:, :2] / right[:, 2:]


def _typical_distance(F: Array, uv_left: Array, uv_right: Array) -> float:
    """The median distance in pixels of true right pixels from their lines."""
    return float(np.median(np.abs(np.sum(epipolar_line(F, uv_left) * _homogeneous(uv_right), axis=-1))))


EIGHT_POINT = Exercise(
    name="07.eight_point",
    reference=eight_point,
    cases=_eight_point_cases,
    any_numbers=False,
    canonical=_one_scale,
    tolerance=1e-4,
    laws=(_good_with_noise,),
    as_given=eight_point_as_given,
    hints=(
        "The algorithm finds an F̂ for the moved points: (T_right x_right)ᵀ F̂ (T_left x_left) = 0. Take that product "
        "apart.",
        "(T_right x_right)ᵀ is x_rightᵀ times something. What then stands between x_rightᵀ and x_left is F. Compare it "
        "with the last line.",
        "`return ___ @ F @ ___`",
    ),
    praise="Now each transform stands beside its own points, and true pairs satisfy F.",
)


@EIGHT_POINT.right
def as_opencv_does_it(uv_left, uv_right):
    import cv2

    return cv2.findFundamentalMat(uv_left, uv_right, cv2.FM_8POINT)[0]


@EIGHT_POINT.right
def as_camviz_does_it(uv_left, uv_right):
    from camviz import twoview

    return twoview.eight_point(uv_left, uv_right)


@EIGHT_POINT.right
def by_mean_and_standard_deviation(uv_left, uv_right):
    transforms = []
    for uv in (uv_left, uv_right):
        (mu, mv), (su, sv) = uv.mean(axis=0), uv.std(axis=0)
        transforms.append(np.array([[1 / su, 0, -mu / su], [0, 1 / sv, -mv / sv], [0, 0, 1]]))
    T_left, T_right = transforms
    return T_right.T @ _linear(_moved(T_left, uv_left), _moved(T_right, uv_right)) @ T_left


@EIGHT_POINT.right
def with_one_transform_for_both_pictures(uv_left, uv_right):
    T = np.array([[1 / 300, 0, -320 / 300], [0, 1 / 300, -240 / 300], [0, 0, 1]])
    return T.T @ _linear(_moved(T, uv_left), _moved(T, uv_right)) @ T


def _with_transforms(uv_left: Array, uv_right: Array) -> tuple[Array, Array, Array]:
    """F̂ of the moved points, and the two transforms."""
    T_left, T_right = _normaliser(uv_left), _normaliser(uv_right)
    return _linear(_moved(T_left, uv_left), _moved(T_right, uv_right)), T_left, T_right


@EIGHT_POINT.wrong("This F is for the moved points. Take it back to pixels.")
def for_moved_points(uv_left, uv_right):
    return _with_transforms(uv_left, uv_right)[0]


@EIGHT_POINT.wrong("You inverted T_right; (T x)ᵀ asks for its transpose.")
def right_inverted(uv_left, uv_right):
    F, T_left, T_right = _with_transforms(uv_left, uv_right)
    return np.linalg.inv(T_right) @ F @ T_left


@EIGHT_POINT.wrong(
    "You inverted both transforms. The moved points were *made* by T, and T itself appears in the product."
)
def both_inverted(uv_left, uv_right):
    F, T_left, T_right = _with_transforms(uv_left, uv_right)
    return np.linalg.inv(T_right).T @ F @ np.linalg.inv(T_left)


@EIGHT_POINT.wrong("T_right must be transposed: (T x)ᵀ = xᵀ Tᵀ.")
def right_not_transposed(uv_left, uv_right):
    F, T_left, T_right = _with_transforms(uv_left, uv_right)
    return T_right @ F @ T_left


@EIGHT_POINT.wrong(
    "You transposed both. Only the right pixel is transposed in x_rightᵀ F x_left, and so only T_right is."
)
def both_transposed(uv_left, uv_right):
    F, T_left, T_right = _with_transforms(uv_left, uv_right)
    return T_right.T @ F @ T_left.T


@EIGHT_POINT.wrong("The left points are taken back to pixels. T_right is missing on the other side.")
def right_forgotten(uv_left, uv_right):
    F, T_left, _ = _with_transforms(uv_left, uv_right)
    return F @ T_left


@EIGHT_POINT.wrong("The right points are taken back to pixels. T_left is missing on the other side.")
def left_forgotten(uv_left, uv_right):
    F, _, T_right = _with_transforms(uv_left, uv_right)
    return T_right.T @ F


@EIGHT_POINT.wrong("T_left stands on both sides. The right points were moved by a transform of their own.")
def left_transform_twice(uv_left, uv_right):
    F, T_left, _ = _with_transforms(uv_left, uv_right)
    return T_left.T @ F @ T_left


@EIGHT_POINT.wrong("This is Fᵀ: it leads from the right picture to the left one. F is to stand in x_rightᵀ F x_left.")
def from_right_to_left_again(uv_left, uv_right):
    return eight_point(uv_left, uv_right).T


@EIGHT_POINT.wrong("The last line is right now; but you gave `linear_fundamental` the right points first.")
def points_swapped(uv_left, uv_right):
    T_left, T_right = _normaliser(uv_left), _normaliser(uv_right)
    return T_right.T @ _linear(_moved(T_right, uv_right), _moved(T_left, uv_left)) @ T_left


@EIGHT_POINT.wrong(_NOT_NORMALISED)
def not_normalised(uv_left, uv_right):
    return _linear(uv_left, uv_right)


# 5: in front of both -------------------------------------------------------------------------------------------------


def in_front(R: Array, t: Array, rays_left: Array, rays_right: Array) -> NDArray[np.bool_]:
    """Whether rays (n, 3) that correspond meet in front of both cameras: λ R r_left + t = μ r_right, λ > 0, μ > 0."""
    return np.asarray((_distances(R, t, rays_left, rays_right) > 0).all(axis=-1))


def _distances(R: Array, t: Array, rays_left: Array, rays_right: Array) -> Array:
    """λ and μ (n, 2)."""
    A = np.stack([rays_left @ R.T, -rays_right], axis=-1)
    At = A.swapaxes(1, 2)
    return np.asarray(np.linalg.solve(At @ A, -At @ t[:, None])[..., 0])


def _in_front_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Of three scenes, one of them small, in random order the true motion, the opposite one and the two turned by 180°.

    They turn about the baseline. Some of the pairs are mistakes: their rays meet behind both cameras if the motion is
    the true one.
    """
    for n, size in zip(rng.integers(16, 24, 3), (1.0, 0.01, 1.0), strict=True):  # of a garden, and of a watch
        (R, t), points = _motion(rng), rng.uniform([-2, -1.5, 3], [2, 1.5, 8], (n, 3))
        t = t * [1, 1, 0.2]  # much to the side: about as far as to the front it could be taken for its reverse
        t, points = size * t, size * points
        points[: n // 2] *= -1
        left, right = _looking_forward(points), _looking_forward(points @ R.T + t)
        half_turn = Rotation.from_rotvec(np.pi * t / np.linalg.norm(t)).as_matrix()
        for i in rng.permutation(4):
            yield (half_turn @ R if i % 2 else R, -t if i > 1 else t, left, right)


def _looking_forward(points: Array) -> Array:
    """The unit rays with z > 0 on whose lines the points lie."""
    return _unit(points * np.sign(points[:, 2:]))


IN_FRONT = Exercise(
    name="07.in_front",
    reference=in_front,
    cases=_in_front_cases,
    hints=(
        "Where two rays meet is told by two distances, λ along the left one and μ along the right one. What must be "
        "true of *both*?",
        "Bring μ r_right to the left and t to the right. These are three equations A (λ, μ)ᵀ = −t for a pair, with "
        "the columns "
        "R r_left and −r_right. `np.linalg.pinv` solves all of them at once, for A of shape (n, 3, 2).",
        "`A = np.stack([rays_left @ R.T, ___], axis=-1)` and, at the end, `return (distances > 0).___(axis=-1)`",
    ),
    praise="Of E's four motions just one keeps the world in front of both cameras. That is all there is to cheirality.",
)


@IN_FRONT.right
def by_dot_products(R, t, rays_left, rays_right):
    """The two normal equations, solved by hand."""
    turned = rays_left @ R.T
    across = np.sum(turned * rays_right, axis=-1)
    along_left, along_right = turned @ t, rays_right @ t
    # Both distances have the factor 1/(1 − across²), which is positive.
    return (across * along_right - along_left > 0) & (along_right - across * along_left > 0)


@IN_FRONT.right
def pair_by_pair(R, t, rays_left, rays_right):
    answers = []
    for left, right in zip(rays_left, rays_right, strict=True):
        distances, *_ = np.linalg.lstsq(np.column_stack([R @ left, -right]), -t, rcond=None)
        answers.append(bool(min(distances) > 0))
    return answers


@IN_FRONT.right
def by_the_depths_of_opencv_s_triangulation(R, t, rays_left, rays_right):
    """Z > 0 in both frames: for rays that look forward it says the same as the distances."""
    import cv2

    left, right = (rays[:, :2] / rays[:, 2:] for rays in (rays_left, rays_right))
    points = cv2.triangulatePoints(np.eye(3, 4), np.column_stack([R, t]), left.T, right.T)
    points = (points[:3] / points[3]).T
    return (points[:, 2] > 0) & ((points @ R.T + t)[:, 2] > 0)


@IN_FRONT.wrong(
    "You looked at the left camera only. There are motions with points in front of the left camera that lie "
    "behind the right one."
)
def left_only(R, t, rays_left, rays_right):
    return _distances(R, t, rays_left, rays_right)[:, 0] > 0


@IN_FRONT.wrong(
    "You looked at the right camera only. There are motions with points in front of the right camera that lie "
    "behind the left one."
)
def right_only(R, t, rays_left, rays_right):
    return _distances(R, t, rays_left, rays_right)[:, 1] > 0


@IN_FRONT.wrong(
    "You ask for more than some distance. In front of both is where both distances are above 0, in whatever unit: the "
    "world may be a watch."
)
def farther_than_one(R, t, rays_left, rays_right):
    return (_distances(R, t, rays_left, rays_right) > 1).all(axis=-1)


@IN_FRONT.wrong("One camera is enough for yours. The point must be in front of *both*: `all`, where you have `any`.")
def in_front_of_either(R, t, rays_left, rays_right):
    return (_distances(R, t, rays_left, rays_right) > 0).any(axis=-1)


@IN_FRONT.wrong("The two distances have one sign here; but both may be negative: then the point lies behind *both*.")
def of_one_sign(R, t, rays_left, rays_right):
    return np.prod(_distances(R, t, rays_left, rays_right), axis=-1) > 0


@IN_FRONT.wrong("The sign of t is flipped: λ R r_left + t = μ r_right, so t goes to the other side as −t.")
def t_with_the_other_sign(R, t, rays_left, rays_right):
    return in_front(R, -t, rays_left, rays_right)


@IN_FRONT.wrong("Your second column is +r_right. μ r_right comes to the left-hand side as −μ r_right.")
def second_column_with_the_other_sign(R, t, rays_left, rays_right):
    return in_front(R, t, rays_left, -rays_right)


@IN_FRONT.wrong("R is missing: the left rays are still in the left camera's frame. Turn them by R first.")
def left_rays_not_turned(R, t, rays_left, rays_right):
    return in_front(np.eye(3), t, rays_left, rays_right)


@IN_FRONT.wrong("Your left rays are turned by Rᵀ. For vectors in rows, R r is `rays @ R.T`.")
def turned_backwards(R, t, rays_left, rays_right):
    return in_front(R.T, t, rays_left, rays_right)


@IN_FRONT.wrong("You answer for all pairs together. Each pair has an answer of its own: look along the last axis only.")
def one_answer_for_all(R, t, rays_left, rays_right):
    return (_distances(R, t, rays_left, rays_right) > 0).all()


@IN_FRONT.wrong(
    "You took a vote, and gave every pair the same answer. The vote comes later: here each pair is asked by itself."
)
def voted(R, t, rays_left, rays_right):
    return np.full(len(rays_left), in_front(R, t, rays_left, rays_right).mean() > 0.5)


@IN_FRONT.wrong("You looked at where the rays *point*, z > 0. The question is where they *meet*.")
def rays_that_look_forward(R, t, rays_left, rays_right):
    return (rays_left[:, 2] > 0) & (rays_right[:, 2] > 0)


# 6: the Sampson distance ---------------------------------------------------------------------------------------------


def sampson(F: Array, uv_left: Array, uv_right: Array) -> Array:
    """Distances (n,) in pixels, to first order, of pairs (n, 2) from what F demands (H&Z, section 11.4.3)."""
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return np.asarray(np.abs(product) / np.linalg.norm(gradient, axis=1))


def _product_and_gradient(F: Array, uv_left: Array, uv_right: Array) -> tuple[Array, Array]:
    """xᵀFx (n,) and its derivatives by the right pixel and by the left one (n, 4)."""
    left, right = _homogeneous(uv_left), _homogeneous(uv_right)
    line_right, line_left = left @ F.T, right @ F
    return np.sum(right * line_right, axis=1), np.hstack([line_right[:, :2], line_left[:, :2]])


def _sampson_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Pairs up to some pixels off, with F of several scales and signs, one pair alone, and pixels on all sides of 0."""
    for n, scale in ((12, 1.0), (30, -250.0), (1, 1e-3)):
        left, right = _pairs(rng, n)
        F = eight_point(*_pairs(rng, 20))
        yield scale * F, left + rng.normal(0, 3, left.shape), right + rng.normal(0, 3, right.shape)
    yield _F(rng), rng.uniform(-400, 400, (8, 2)), rng.uniform(-400, 400, (8, 2))


SAMPSON = Exercise(
    name="07.sampson",
    reference=sampson,
    cases=_sampson_cases,
    tolerance=1e-6,
    hints=(
        "F x_left is the line in the right picture. Which line in the left picture belongs to x_right?",
        "Below the root stand the squares of four numbers: the first two of F x_left, and the first two of Fᵀ x_right. "
        "For pixels in rows the lines are `x_left @ F.T` and `x_right @ F`.",
        "`return np.abs(___) / np.linalg.norm(np.hstack([line_right[:, :2], ___]), axis=1)`",
    ),
    praise="It is OpenCV's and camviz's distance, in pixels, whatever the scale of F.",
)


@SAMPSON.right
def as_camviz_measures_it(F, uv_left, uv_right):
    from camviz import twoview

    return twoview.sampson_distance(F, uv_left, uv_right)


@SAMPSON.right
def pair_by_pair_by_opencv(F, uv_left, uv_right):
    import cv2

    pairs = zip(_homogeneous(uv_left), _homogeneous(uv_right), strict=True)
    return [np.sqrt(cv2.sampsonDistance(left, right, F)) for left, right in pairs]


@SAMPSON.wrong("This is xᵀFx itself, which has the scale of F. Divide it by the gradient.")
def product_alone(F, uv_left, uv_right):
    return np.abs(_product_and_gradient(F, uv_left, uv_right)[0])


@SAMPSON.wrong("This is the square of the distance, in pixels². OpenCV returns that; here the root is wanted.")
def squared(F, uv_left, uv_right):
    return sampson(F, uv_left, uv_right) ** 2


@SAMPSON.wrong("A distance is not negative: take the absolute value of xᵀFx.")
def with_a_sign(F, uv_left, uv_right):
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return product / np.linalg.norm(gradient, axis=1)


@SAMPSON.wrong(
    "You divide by the right line alone: that is the distance in the right picture, where only one pixel moves."
)
def right_line_alone(F, uv_left, uv_right):
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.linalg.norm(gradient[:, :2], axis=1)


@SAMPSON.wrong(
    "You divide by the left line alone: that is the distance in the left picture, where only one pixel moves."
)
def left_line_alone(F, uv_left, uv_right):
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.linalg.norm(gradient[:, 2:], axis=1)


@SAMPSON.wrong(
    "Only the first *two* numbers of each line belong below the root: the third is not a direction in the picture."
)
def all_three_numbers(F, uv_left, uv_right):
    left, right = _homogeneous(uv_left), _homogeneous(uv_right)
    product, _ = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.linalg.norm(np.hstack([left @ F.T, right @ F]), axis=1)


@SAMPSON.wrong("The root is missing below: divide by the root of the sum of four squares.")
def without_the_root(F, uv_left, uv_right):
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.sum(gradient**2, axis=1)


@SAMPSON.wrong("This is for Fᵀ, that is, for pictures that have changed places: x_right stands on the left of F.")
def pictures_swapped(F, uv_left, uv_right):
    return sampson(F.T, uv_left, uv_right)


# 7: the model that is enough -----------------------------------------------------------------------------------------


def gric(distances: Array, dimension: int, parameters: int, sigma: float) -> float:
    """Σ min(d²/σ², 2 (4 − D)) + D n ln 4 + k ln 4n of n pairs (Torr 2002, eq. 19, with r = 4 and λ₃ = 2)."""
    n = len(distances)
    residuals = np.minimum(distances**2 / sigma**2, 2 * (4 - dimension)).sum()
    return float(residuals + dimension * n * np.log(4) + parameters * np.log(4 * n))


def _gric_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Both models, noise of several sizes, and mistakes among the pairs."""
    for n, (dimension, parameters) in ((40, (3, 7)), (40, (2, 8)), (9, (3, 7)), (13, (2, 8)), (25, (1, 3))):
        sigma = float(rng.uniform(0.3, 3))
        distances = np.abs(rng.normal(0, sigma, n))
        distances[: n // 4] += rng.uniform(5, 50, n // 4)
        yield distances, dimension, parameters, sigma


GRIC = Exercise(
    name="07.gric",
    reference=gric,
    cases=_gric_cases,
    hints=(
        "Three terms: what the pairs miss the model by, what its dimension costs for each pair, and what its "
        "parameters cost. Which of them is a sum over the pairs?",
        "`np.minimum(a, b)` takes the smaller one, pair by pair, and `.sum()` adds up. `len(distances)` is n, and "
        "`np.log` is the natural logarithm.",
        "`residuals = np.minimum(distances**2 / ___, 2 * (4 - dimension)).sum()`",
    ),
    praise="Now a model has to earn its freedom.",
)


def _penalty(distances, dimension, parameters):
    return dimension * len(distances) * np.log(4) + parameters * np.log(4 * len(distances))


@GRIC.right
def one_share_after_the_other(distances, dimension, parameters, sigma):
    total = parameters * np.log(4 * len(distances))
    for d in distances:
        total += min((d / sigma) ** 2, 8 - 2 * dimension) + np.log(4**dimension)
    return total


@GRIC.right
def with_r_named(distances, dimension, parameters, sigma):
    r, n = 4, np.size(distances)
    rho = np.where((distances / sigma) ** 2 < 2 * (r - dimension), (distances / sigma) ** 2, 2 * (r - dimension))
    return np.sum(rho) + np.log(r) * dimension * n + np.log(r * n) * parameters


@GRIC.wrong("Nothing is cut off: one wrong pair decides then. Each pair has a limit.")
def nothing_cut_off(distances, dimension, parameters, sigma):
    return np.sum(distances**2 / sigma**2) + _penalty(distances, dimension, parameters)


@GRIC.wrong("The *sum* is cut off. Each pair is to be, before the sum.")
def the_sum_cut_off(distances, dimension, parameters, sigma):
    return min(np.sum(distances**2 / sigma**2), 2 * (4 - dimension)) + _penalty(distances, dimension, parameters)


@GRIC.wrong("The distances are not squared: d²/σ².")
def not_squared(distances, dimension, parameters, sigma):
    return np.minimum(distances / sigma, 2 * (4 - dimension)).sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("d² is divided by σ. It is σ²: the quotient then has no unit.")
def sigma_not_squared(distances, dimension, parameters, sigma):
    return np.minimum(distances**2 / sigma, 2 * (4 - dimension)).sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("The noise is left out. A distance of a pixel is much where σ is a tenth of it, and little where σ is two.")
def without_the_noise(distances, dimension, parameters, sigma):
    return np.minimum(distances**2, 2 * (4 - dimension)).sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("The larger one is taken where the smaller one is wanted: `np.minimum`.")
def maximum_taken(distances, dimension, parameters, sigma):
    limited = np.maximum(distances**2 / sigma**2, 2 * (4 - dimension))
    return limited.sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("The limit of a pair is twice as high: `2 * (4 - dimension)`.")
def limit_halved(distances, dimension, parameters, sigma):
    limited = np.minimum(distances**2 / sigma**2, 4 - dimension)
    return limited.sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("The limit goes by what the model fixes, `4 - dimension`. You took what it leaves free.")
def limit_by_what_is_free(distances, dimension, parameters, sigma):
    limited = np.minimum(distances**2 / sigma**2, 2 * dimension)
    return limited.sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("The price of the dimension is paid for each pair: once more n.")
def dimension_paid_once(distances, dimension, parameters, sigma):
    n = len(distances)
    return gric(distances, dimension, parameters, sigma) - dimension * (n - 1) * np.log(4)


@GRIC.wrong("The price of the parameters is missing: `parameters * np.log(4 * n)`.")
def parameters_for_nothing(distances, dimension, parameters, sigma):
    return gric(distances, dimension, parameters, sigma) - parameters * np.log(4 * len(distances))


@GRIC.wrong("The price of the dimension is missing: `dimension * n * np.log(4)`.")
def dimension_for_nothing(distances, dimension, parameters, sigma):
    return gric(distances, dimension, parameters, sigma) - dimension * len(distances) * np.log(4)


@GRIC.wrong("This is the price of the freedom alone. What the pairs miss the model by comes first.")
def price_alone(distances, dimension, parameters, sigma):
    return _penalty(distances, dimension, parameters)


@GRIC.wrong("These are decimal logarithms. `np.log` is the natural one.")
def to_the_base_of_ten(distances, dimension, parameters, sigma):
    residuals = np.minimum(distances**2 / sigma**2, 2 * (4 - dimension)).sum()
    return residuals + _penalty(distances, dimension, parameters) / np.log(10)


@GRIC.wrong("This is a mean over the pairs. A sum is wanted: its balance with the prices depends on n.")
def the_mean_of_the_pairs(distances, dimension, parameters, sigma):
    residuals = np.minimum(distances**2 / sigma**2, 2 * (4 - dimension)).mean()
    return residuals + _penalty(distances, dimension, parameters)


@GRIC.wrong("D and k have changed places: D is paid n times, k once.")
def dimension_and_parameters_swapped(distances, dimension, parameters, sigma):
    residuals = np.minimum(distances**2 / sigma**2, 2 * (4 - dimension)).sum()
    return residuals + _penalty(distances, parameters, dimension)


EXERCISES = (FUNDAMENTAL, LINE, EPIPOLE, EIGHT_POINT, SAMPSON, GRIC, IN_FRONT)
