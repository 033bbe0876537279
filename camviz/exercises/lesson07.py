"""Lesson 07, epipolar geometry: F from two cameras, lines and epipoles, the eight-point algorithm, cheirality.

x_rightᵀ F x_left = 0, right_from_left = [R | t]. After Hartley & Zisserman (2004), chapters 9 and 11.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise
from camviz.poses import Rotation
from camviz.trials import Function


def cross_matrix(t: Array) -> Array:
    """[t]× (3, 3), so that [t]× w = t × w."""
    x, y, z = t
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def fundamental(K_left: Array, K_right: Array, R: Array, t: Array) -> Array:
    """F = K_right⁻ᵀ [t]× R K_left⁻¹, of any scale."""
    return np.linalg.inv(K_right).T @ cross_matrix(t) @ R @ np.linalg.inv(K_left)


def epipolar_line(F: Array, uv_left: Array) -> Array:
    """l = F x (..., 3) of left pixels (..., 2), with a² + b² = 1."""
    line = np.concatenate([uv_left, np.ones_like(uv_left[..., :1])], axis=-1) @ F.T
    return line / np.linalg.norm(line[..., :2], axis=-1, keepdims=True)


def right_epipole(F: Array) -> Array:
    """The pixel (2,) in the right picture that lies on all epipolar lines: Fᵀ e = 0."""
    e = np.linalg.svd(F)[0][:, 2]
    return e[:2] / e[2]


def eight_point(uv_left: Array, uv_right: Array) -> Array:
    """F (3, 3) of pairs (n, 2) by the eight-point algorithm with Hartley's normalisation."""
    T_left, T_right = _normaliser(uv_left), _normaliser(uv_right)
    return T_right.T @ _linear(_moved(T_left, uv_left), _moved(T_right, uv_right)) @ T_left


def in_front(R: Array, t: Array, rays_left: Array, rays_right: Array) -> Array:
    """Whether rays (n, 3) that correspond meet in front of both cameras: λ R r_left + t = μ r_right, λ > 0, μ > 0."""
    turned = rays_left @ R.T
    across = np.sum(turned * rays_right, axis=-1)
    along_left, along_right = turned @ t, rays_right @ t
    distance_left = (across * along_right - along_left) / (1 - across**2)
    distance_right = (along_right - across * along_left) / (1 - across**2)
    return (distance_left > 0) & (distance_right > 0)


def _normaliser(uv: Array) -> Array:
    centre = uv.mean(axis=0)
    s = np.sqrt(2) / np.linalg.norm(uv - centre, axis=1).mean()
    return np.array([[s, 0, -s * centre[0]], [0, s, -s * centre[1]], [0, 0, 1]])


def _moved(T: Array, uv: Array) -> Array:
    return uv @ T[:2, :2].T + T[:2, 2]


def _linear(uv_left: Array, uv_right: Array) -> Array:
    ones = np.ones((len(uv_left), 1))
    x_left, x_right = np.hstack([uv_left, ones]), np.hstack([uv_right, ones])
    A = (x_right[:, :, None] * x_left[:, None, :]).reshape(-1, 9)
    U, s, Vt = np.linalg.svd(np.linalg.svd(A)[2][-1].reshape(3, 3))
    return U @ np.diag([s[0], s[1], 0]) @ Vt


def _one_scale(F: Array) -> Array:
    """A matrix F of any scale and sign in one form, counted in thousands of pixels so that all its entries matter."""
    if F.shape != (3, 3):
        return F
    D = np.diag([1000.0, 1000.0, 1.0])
    F = D @ F @ D
    return F / np.linalg.norm(F) * np.sign(F.flat[np.abs(F).argmax()])


def _one_sign(lines: Array) -> Array:
    """Lines (..., 3), of which l and −l are the same, with the larger of a and b positive."""
    if lines.shape[-1:] != (3,):
        return lines
    larger = np.take_along_axis(lines, np.abs(lines[..., :2]).argmax(axis=-1)[..., None], axis=-1)
    return lines * np.where(larger < 0, -1, 1)


def _K(rng: np.random.Generator) -> Array:
    return np.array(
        [
            [rng.uniform(300, 900), 0, rng.uniform(250, 390)],
            [0, rng.uniform(300, 900), rng.uniform(180, 300)],
            [0, 0, 1],
        ]
    )


def _motion(rng: np.random.Generator) -> tuple[Array, Array]:
    """A right camera beside the left one and a little in front of it, looking much the same way."""
    R = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3)).as_matrix()
    return R, np.array([-rng.uniform(0.3, 1), rng.uniform(-0.3, 0.3), rng.uniform(0.2, 0.6) * rng.choice([-1, 1])])


def _F(rng: np.random.Generator) -> Array:
    return fundamental(_K(rng), _K(rng), *_motion(rng))


def _pairs(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Pixels of n points in two cameras, with errors of half a pixel."""
    (R, t), points = _motion(rng), rng.uniform([-2, -1.5, 3], [2, 1.5, 8], (n, 3))
    left, right = points @ _K(rng).T, (points @ R.T + t) @ _K(rng).T
    pixels = np.stack([left[:, :2] / left[:, 2:], right[:, :2] / right[:, 2:]])
    left, right = pixels + rng.normal(0, 0.5, pixels.shape)
    return left, right


def _fundamental_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield (_K(rng), _K(rng), *_motion(rng))


def _line_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (_F(rng), rng.uniform(0, 480, (*shape, 2)))


def _epipole_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for _ in range(4):
        yield (_F(rng),)


def _eight_point_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (12, 20, 50):
        yield _pairs(rng, n)


def _in_front_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """In random order the true motion, the opposite one and the two that are turned by 180° about the baseline."""
    for n in rng.integers(2, 12, 3):
        (R, t), points = _motion(rng), rng.uniform([-2, -1.5, 3], [2, 1.5, 8], (n, 3))
        left, right = _rays(points), _rays(points @ R.T + t)
        half_turn = Rotation.from_rotvec(np.pi * t / np.linalg.norm(t)).as_matrix()
        for i in rng.permutation(4):
            yield (half_turn @ R if i % 2 else R, -t if i > 1 else t, left, right)


def _rays(points: Array) -> Array:
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def _distances(R: Array, t: Array, rays_left: Array, rays_right: Array) -> Array:
    A = np.stack([rays_left @ R.T, -rays_right], axis=-1)
    return (np.linalg.pinv(A) @ -t[:, None])[..., 0]


def _with_transforms(form: str) -> Function:
    """The eight-point algorithm with the normalisation undone in the wrong way that `form` names."""

    def wrong(uv_left: Array, uv_right: Array) -> Array:
        T_left, T_right = _normaliser(uv_left), _normaliser(uv_right)
        F = _linear(_moved(T_left, uv_left), _moved(T_right, uv_right))
        forms = {"swapped": T_left.T @ F @ T_right, "kept": F, "inverse": np.linalg.inv(T_right) @ F @ T_left}
        return forms[form] if form in forms else T_right @ F @ T_left

    return wrong


FUNDAMENTAL = Exercise(
    name="07.fundamental",
    reference=fundamental,
    cases=_fundamental_cases,
    canonical=_one_scale,
    tolerance=1e-7,
    hints=(
        "Begin with E = [t]× R, which holds for rays. A pixel becomes a ray by K⁻¹: put r = K⁻¹ x into "
        "r_rightᵀ E r_left = 0.",
        "(K_right⁻¹ x_right)ᵀ E (K_left⁻¹ x_left) = x_rightᵀ (K_right⁻ᵀ E K_left⁻¹) x_left: "
        "`np.linalg.inv(K_right).T @ E @ …`.",
    ),
    praise="It is the matrix that camviz and OpenCV use, up to its scale, which says nothing.",
)


@FUNDAMENTAL.wrong("The camera matrices have changed places: x_left stands on the right of F, so K_left⁻¹ does too.")
def _(K_left, K_right, R, t):
    return np.linalg.inv(K_left).T @ cross_matrix(t) @ R @ np.linalg.inv(K_right)


@FUNDAMENTAL.wrong("This is E, which takes rays. Pixels become rays by the inverse camera matrices.")
def _(K_left, K_right, R, t):
    return cross_matrix(t) @ R


@FUNDAMENTAL.wrong("This is the way from F to E. From E to F the camera matrices are *inverted*.")
def _(K_left, K_right, R, t):
    return K_right.T @ cross_matrix(t) @ R @ K_left


@FUNDAMENTAL.wrong("R is transposed here: right_from_left turns a ray of the left camera into the right one's frame.")
def _(K_left, K_right, R, t):
    return fundamental(K_left, K_right, np.eye(3), t) @ K_left @ R.T @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("This is R [t]×. The translation comes after the rotation: E = [t]× R.")
def _(K_left, K_right, R, t):
    return np.linalg.inv(K_right).T @ R @ cross_matrix(t) @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("K_right⁻¹ must be transposed: it comes out of (K_right⁻¹ x_right)ᵀ.")
def _(K_left, K_right, R, t):
    return np.linalg.inv(K_right) @ cross_matrix(t) @ R @ np.linalg.inv(K_left)


@FUNDAMENTAL.wrong("You used the centre C = −Rᵀt in place of t. The two are in different frames.")
def _(K_left, K_right, R, t):
    return fundamental(K_left, K_right, R, -R.T @ t)


LINE = Exercise(
    name="07.epipolar_line",
    reference=epipolar_line,
    cases=_line_cases,
    canonical=_one_sign,
    hints=(
        "Append a 1 to each pixel, multiply by F, and divide by the length of the line's first two numbers.",
        "For points in rows, l = F x is `x @ F.T`. What to divide by is "
        "`np.linalg.norm(line[..., :2], axis=-1, keepdims=True)`.",
    ),
    praise="With a² + b² = 1 the number a u + b v + c is a distance in pixels, which is what one wants to look at.",
)


@LINE.wrong("This is Fᵀ x, the line in the *left* picture of a right point. (For rows, l = F x is `x @ F.T`.)")
def _(F, uv_left):
    return epipolar_line(F.T, uv_left)


@LINE.wrong("The line is right, but its scale is arbitrary: divide by √(a² + b²), so that a u + b v + c is in pixels.")
def _(F, uv_left):
    return np.concatenate([uv_left, np.ones_like(uv_left[..., :1])], axis=-1) @ F.T


@LINE.wrong("You divide by the length of all three numbers. Only a and b make the direction: a² + b² = 1.")
def _(F, uv_left):
    return _rays(epipolar_line(F, uv_left))


@LINE.wrong("u and v have changed places. A pixel is (column, row).")
def _(F, uv_left):
    return epipolar_line(F, uv_left[..., ::-1])


EPIPOLE = Exercise(
    name="07.right_epipole",
    reference=right_epipole,
    cases=_epipole_cases,
    tolerance=1e-6,
    hints=(
        "All lines F x pass through e, whatever x: eᵀ F x = 0 for every x, so Fᵀ e = 0. Which singular vector is that?",
        "`U, s, Vt = np.linalg.svd(F)`: Fᵀ e = 0 is solved by the *last column of U*. Divide by its third number.",
    ),
    praise="That is where the right picture would show the left camera.",
)


@EPIPOLE.wrong("This is the left epipole, F e = 0: the last row of Vt. The right one solves Fᵀ e = 0.")
def _(F):
    return right_epipole(F.T)


@EPIPOLE.wrong("You took the last *row* of U. Its columns are the singular vectors: `U[:, 2]`.")
def _(F):
    return np.linalg.svd(F)[0][2, :2] / np.linalg.svd(F)[0][2, 2]


@EPIPOLE.wrong("The third number is not 1 yet: divide by it to get a pixel.")
def _(F):
    return np.linalg.svd(F)[0][:2, 2]


EIGHT_POINT = Exercise(
    name="07.eight_point",
    reference=eight_point,
    cases=_eight_point_cases,
    canonical=_one_scale,
    tolerance=1e-6,
    bug=True,
    hints=(
        "The algorithm found F̂ for moved points: (T_right x_right)ᵀ F̂ (T_left x_left) = 0. Take that product apart.",
        "x_rightᵀ (T_rightᵀ F̂ T_left) x_left = 0. What is in the brackets is F.",
    ),
    praise="One line, and the estimate is several times better than without it.",
)

EIGHT_POINT.wrong(
    "This is T_leftᵀ F T_right. The left point stands on the right of F, and so does its transform. With two "
    "pictures that are much alike nobody notices."
)(_with_transforms("swapped"))


EIGHT_POINT.wrong("This F is for the moved points. Take it back to pixels.")(_with_transforms("kept"))


EIGHT_POINT.wrong("You inverted T_right; (T x)ᵀ asks for its transpose.")(_with_transforms("inverse"))


EIGHT_POINT.wrong("T_right must be transposed: (T x)ᵀ = xᵀ Tᵀ.")(_with_transforms("untransposed"))


EIGHT_POINT.wrong("This leaves the normalisation out altogether.")(_linear)


IN_FRONT = Exercise(
    name="07.in_front",
    reference=in_front,
    cases=_in_front_cases,
    hints=(
        "Solve λ R r_left + t = μ r_right for the two distances λ and μ, by least squares; then look at *both* signs.",
        "`A = np.stack([rays_left @ R.T, -rays_right], axis=-1)` is (n, 3, 2), and `np.linalg.pinv(A) @ -t[:, None]` "
        "has shape (n, 2, 1): λ and μ of every pair.",
    ),
    praise="Of E's four motions just one keeps the world in front of both cameras. That is all there is to cheirality.",
)


@IN_FRONT.wrong(
    "You looked at the left camera only. There are motions with points in front of the left camera that lie "
    "behind the right one."
)
def _(R, t, rays_left, rays_right):
    return _distances(R, t, rays_left, rays_right)[:, 0] > 0


@IN_FRONT.wrong(
    "You looked at the right camera only. There are motions with points in front of the right camera that lie "
    "behind the left one."
)
def _(R, t, rays_left, rays_right):
    return _distances(R, t, rays_left, rays_right)[:, 1] > 0


@IN_FRONT.wrong("The two distances have one sign here; but both may be negative: then the point lies behind *both*.")
def _(R, t, rays_left, rays_right):
    return np.ptp(np.sign(_distances(R, t, rays_left, rays_right)), axis=-1) == 0


@IN_FRONT.wrong("The sign of t is flipped: λ R r_left + t = μ r_right, so t goes to the other side as −t.")
def _(R, t, rays_left, rays_right):
    return in_front(R, -t, rays_left, rays_right)


EXERCISES = (FUNDAMENTAL, LINE, EPIPOLE, EIGHT_POINT, IN_FRONT)
