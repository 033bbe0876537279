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
def column_by_column_and_with_the_other_sign(K_left, K_right, R, t):
    turned = (R @ np.linalg.inv(K_left)).T
    return np.linalg.inv(K_right).T @ np.column_stack([np.cross(column, t) for column in turned])


@FUNDAMENTAL.wrong("The camera matrices have changed places: x_left stands on the right of F, as K_left⁻¹ does.")
def cameras_swapped(K_left, K_right, R, t):
    return np.linalg.inv(K_left).T @ cross_matrix(t) @ R @ np.linalg.inv(K_right)


@FUNDAMENTAL.wrong("This is the way from F to E. From E to F the camera matrices are *inverted*.")
def camera_matrices_not_inverted(K_left, K_right, R, t):
    return K_right.T @ cross_matrix(t) @ R @ K_left


@FUNDAMENTAL.wrong("This is R [t]×. The translation comes after the rotation: E = [t]× R.")
def translation_before_rotation(K_left, K_right, R, t):
    return np.linalg.inv(K_right).T @ R @ cross_matrix(t) @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("K_right⁻¹ must be transposed: it comes out of (K_right⁻¹ x_right)ᵀ.")
def right_inverse_not_transposed(K_left, K_right, R, t):
    return np.linalg.inv(K_right) @ cross_matrix(t) @ R @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("You used the centre C = −Rᵀt in place of t. The two are in different frames.")
def centre_for_t(K_left, K_right, R, t):
    return fundamental(K_left, K_right, R, -R.T @ t)


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
def with_the_other_sign(F, uv_left):
    line = -np.einsum("ij,...j->...i", F, _homogeneous(uv_left))
    return line / np.sqrt(line[..., :1] ** 2 + line[..., 1:2] ** 2)


@LINE.wrong("This is Fᵀ x, the line in the *left* picture of a right point. For rows, F x is `x @ F.T`.")
def transposed(F, uv_left):
    return epipolar_line(F.T, uv_left)


@LINE.wrong("The line is right, but its scale is arbitrary: divide by √(a² + b²).")
def not_scaled(F, uv_left):
    return _homogeneous(uv_left) @ F.T


@LINE.wrong("You divide by the length of all three numbers. Only a and b count: a² + b² = 1.")
def all_three_scaled(F, uv_left):
    return _unit(epipolar_line(F, uv_left))


@LINE.wrong("You appended a 0. That is a direction, a point at infinity; a pixel is (u, v, 1).")
def zero_appended(F, uv_left):
    line = np.concatenate([uv_left, np.zeros_like(uv_left[..., :1])], axis=-1) @ F.T
    return line / np.linalg.norm(line[..., :2], axis=-1, keepdims=True)


@LINE.wrong("u and v have changed places. A pixel is (column, row).")
def rows_for_columns(F, uv_left):
    return epipolar_line(F, uv_left[..., ::-1])


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


@EPIPOLE.wrong("This is the left epipole, F e = 0: the last row of Vt. The right one solves Fᵀ e = 0.")
def left_epipole(F):
    return right_epipole(F.T)


@EPIPOLE.wrong("You took the last *row* of U. Its columns are the singular vectors.")
def row_of_U(F):
    e = np.linalg.svd(F)[0][2]
    return e[:2] / e[2]


@EPIPOLE.wrong("The third number is not 1 yet: divide by it to get a pixel.")
def not_divided(F):
    return np.linalg.svd(F)[0][:2, 2]


@EPIPOLE.wrong("You took the first column of U, of the *largest* singular value. The value 0 comes last.")
def largest_singular_value(F):
    e = np.linalg.svd(F)[0][:, 0]
    return e[:2] / e[2]


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


@EIGHT_POINT.wrong("You inverted both transforms. T itself made the moved points, and stands in the product.")
def both_inverted(uv_left, uv_right):
    F, T_left, T_right = _with_transforms(uv_left, uv_right)
    return np.linalg.inv(T_right).T @ F @ np.linalg.inv(T_left)


@EIGHT_POINT.wrong("T_right must be transposed: (T x)ᵀ = xᵀ Tᵀ.")
def right_not_transposed(uv_left, uv_right):
    F, T_left, T_right = _with_transforms(uv_left, uv_right)
    return T_right @ F @ T_left


@EIGHT_POINT.wrong("T_left stands on both sides. The right points have a transform of their own.")
def left_transform_twice(uv_left, uv_right):
    F, T_left, _ = _with_transforms(uv_left, uv_right)
    return T_left.T @ F @ T_left


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


@IN_FRONT.wrong("You looked at the left camera only. A point may still lie behind the right one.")
def left_only(R, t, rays_left, rays_right):
    return _distances(R, t, rays_left, rays_right)[:, 0] > 0


@IN_FRONT.wrong("Both distances may be negative: then the point lies behind *both* cameras.")
def of_one_sign(R, t, rays_left, rays_right):
    return np.prod(_distances(R, t, rays_left, rays_right), axis=-1) > 0


@IN_FRONT.wrong("The sign of t is wrong. In λ R r_left + t = μ r_right it moves across as −t.")
def t_with_the_other_sign(R, t, rays_left, rays_right):
    return in_front(R, -t, rays_left, rays_right)


@IN_FRONT.wrong("R is missing: turn the left rays into the right camera's frame first.")
def left_rays_not_turned(R, t, rays_left, rays_right):
    return in_front(np.eye(3), t, rays_left, rays_right)


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


@SAMPSON.wrong("You divide by the right line alone. That is the distance when only the right pixel moves.")
def right_line_alone(F, uv_left, uv_right):
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.linalg.norm(gradient[:, :2], axis=1)


@SAMPSON.wrong("Only the first *two* numbers of each line belong below the root.")
def all_three_numbers(F, uv_left, uv_right):
    left, right = _homogeneous(uv_left), _homogeneous(uv_right)
    product, _ = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.linalg.norm(np.hstack([left @ F.T, right @ F]), axis=1)


@SAMPSON.wrong("The root is missing below: divide by the root of the sum of four squares.")
def without_the_root(F, uv_left, uv_right):
    product, gradient = _product_and_gradient(F, uv_left, uv_right)
    return np.abs(product) / np.sum(gradient**2, axis=1)


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


@GRIC.wrong("d² is divided by σ. It is σ²: the quotient then has no unit.")
def sigma_not_squared(distances, dimension, parameters, sigma):
    return np.minimum(distances**2 / sigma, 2 * (4 - dimension)).sum() + _penalty(distances, dimension, parameters)


@GRIC.wrong("The price of the dimension is paid for each pair: once more n.")
def dimension_paid_once(distances, dimension, parameters, sigma):
    n = len(distances)
    return gric(distances, dimension, parameters, sigma) - dimension * (n - 1) * np.log(4)


@GRIC.wrong("These are decimal logarithms. `np.log` is the natural one.")
def to_the_base_of_ten(distances, dimension, parameters, sigma):
    residuals = np.minimum(distances**2 / sigma**2, 2 * (4 - dimension)).sum()
    return residuals + _penalty(distances, dimension, parameters) / np.log(10)


EXERCISES = (FUNDAMENTAL, LINE, EPIPOLE, EIGHT_POINT, SAMPSON, GRIC, IN_FRONT)
