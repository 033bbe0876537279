"""Lesson 19, many pictures: a homography carried and found, the second step; deeper, draws, residuals and the scale.

Pixels are (u, v); motions are to_from_from, and all lengths are in first steps unless a name says otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.poses import Rotation
from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise
from camviz_school.course.laws import error_ratio, unused_row
from camviz_school.course.trials import Function

# 1: where a homography takes pixels ----------------------------------------------------------------------------------


def carry(H: Array, uv: Array) -> Array:
    """Where a homography H (3, 3) takes pixels (..., 2)."""
    x = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ H.T
    return x[..., :2] / x[..., 2:]


def _homography(rng: np.random.Generator) -> Array:
    """H (3, 3) with H[2, 2] = 1 that takes no pixel of a picture near infinity, and has no number that is 0."""
    bent = np.eye(3) + rng.uniform(0.05, 0.2, (3, 3)) * rng.choice([-1, 1], (3, 3))
    H = bent * [[1, 1, 300], [1, 1, 300], [1e-3, 1e-3, 1]]
    return H / H[2, 2]


def _carried(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield _homography(rng), rng.uniform(20, 620, (*shape, 2))
    yield rng.uniform(2, 3) * _homography(rng), rng.uniform(20, 620, (5, 2))  # no scale of H matters
    yield -_homography(rng), rng.uniform(20, 620, (2, 2))
    yield _homography(rng), rng.uniform(-700, -400, (4, 2)) * (1, -1) ** np.arange(4)[:, None]  # beside the picture


def carry_as_given(H, uv):
    x = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ H.T
    return x[..., :2] / H[2, 2]


CARRY = Exercise(
    name="19.carry",
    reference=carry,
    cases=_carried,
    hints=(
        "Look at the outline: opposite sides stay parallel. What makes far things smaller in a picture?",
        "H gives three numbers for each pixel. The third one differs from pixel to pixel.",
        "`return x[..., :2] / ___`",
    ),
    praise="The third number differs from pixel to pixel, and so parallel lines may meet.",
    as_given=carry_as_given,
)


@CARRY.right
def column_by_column(H, uv):
    u, v = uv[..., 0], uv[..., 1]
    w = H[2, 0] * u + H[2, 1] * v + H[2, 2]
    x, y = H[0, 0] * u + H[0, 1] * v + H[0, 2], H[1, 0] * u + H[1, 1] * v + H[1, 2]
    return np.stack([x / w, y / w], axis=-1)


@CARRY.right
def as_opencv_carries(H, uv):
    import cv2

    return cv2.perspectiveTransform(np.reshape(uv, (-1, 1, 2)), H).reshape(np.shape(uv))


@CARRY.right
def by_einsum(H, uv):
    x = np.einsum("ij,...j->...i", H, np.insert(uv, 2, 1, axis=-1))
    return x[..., :2] / x[..., 2:3]


@CARRY.wrong("You do not divide at all. H gives three numbers, and the pixel is the first two divided by the third.")
def not_divided(H, uv):
    return (np.insert(uv, 2, 1.0, axis=-1) @ H.T)[..., :2]


@CARRY.wrong("You multiply by the third number. The pixel is the first two numbers *divided* by it.")
def multiplied(H, uv):
    x = np.insert(uv, 2, 1.0, axis=-1) @ H.T
    return x[..., :2] * x[..., 2:]


@CARRY.wrong("Points are rows here, so H x becomes `x @ H.T`. Yours is `x @ H`.")
def not_transposed(H, uv):
    x = np.insert(uv, 2, 1.0, axis=-1) @ H
    return x[..., :2] / x[..., 2:]


@CARRY.wrong("You go the other way: this is where the inverse of H takes the pixels.")
def the_other_way(H, uv):
    return carry(np.linalg.inv(H), uv)


@CARRY.wrong("You divide by the length of the three numbers. That is for directions; a pixel divides by the third.")
def divided_by_the_length(H, uv):
    x = np.insert(uv, 2, 1.0, axis=-1) @ H.T
    return x[..., :2] / np.linalg.norm(x, axis=-1, keepdims=True)


@CARRY.wrong("You divide by the *size* of the third number. Its sign belongs to it: −H is the same homography as H.")
def divided_by_the_size(H, uv):
    x = np.insert(uv, 2, 1.0, axis=-1) @ H.T
    return x[..., :2] / np.abs(x[..., 2:])


@CARRY.wrong("You put 0 behind u and v. Then the last column of H has no effect; a pixel takes a 1 there.")
def with_a_zero(H, uv):
    x = np.insert(uv, 2, 0.0, axis=-1) @ H.T
    return x[..., :2] / x[..., 2:]


@CARRY.wrong("You put the 1 before u and v. It belongs behind them: (u, v, 1).")
def one_before(H, uv):
    x = np.insert(uv, 0, 1.0, axis=-1) @ H.T
    return x[..., :2] / x[..., 2:]


@CARRY.wrong("You divide by the mean of the third numbers. Each pixel has its own.")
def one_divisor_for_all(H, uv):
    x = np.insert(uv, 2, 1.0, axis=-1) @ H.T
    return x[..., :2] / np.mean(x[..., 2])


# 2: a homography from matches ----------------------------------------------------------------------------------------


def homography(uv: Array, to: Array) -> Array:
    """H (3, 3) with H[2, 2] = 1 that takes pixels (n, 2) to others (n, 2), for n of 4 and more."""
    x = np.column_stack([uv, np.ones(len(uv))])
    u, v = to[:, :1], to[:, 1:]
    A = np.block([[x, 0 * x, -u * x], [0 * x, x, -v * x]])
    H = np.linalg.svd(A)[2][-1].reshape(3, 3)
    return H / H[2, 2]


def _matched(rng: np.random.Generator) -> Iterator[Arguments]:
    for n, middle in ((12, 0), (4, 0), (30, 0), (5, 0), (10, 320)):  # at last around (0, 0), as on a mosaic's canvas
        H = _homography(rng)
        corners = np.array([[40.0, 60], [600, 30], [560, 430], [70, 400]]) + rng.uniform(-25, 25, (4, 2))
        uv = np.concatenate([corners, rng.uniform(20, 450, (n - 4, 2))]) - middle
        to = carry(H, uv)
        to = to - to.mean(axis=0) * bool(middle)
        yield uv, to


def _all_matches_count(function: Function, rng: np.random.Generator) -> str:
    """With noise every match counts, and the error is that of all matches."""
    true = []
    for _ in range(8):
        H, uv = _homography(rng), rng.uniform(20, (620, 460), (20, 2))
        true.append((uv, carry(H, uv)))
    noisy = [(uv, to + rng.normal(0, 0.5, to.shape)) for uv, to in true]
    unused = unused_row(function, noisy[0], np.asarray)
    if unused is not None:
        return f"Your H does not change when match {unused} of 20 moves. With noise every match is needed."
    ratio = error_ratio(function, homography, noisy, lambda H, number: _pixel_error(H, *true[number]))
    return (
        "" if ratio < 2 else f"Your H is right for exact pixels. With noise its error is {ratio:.1f} times that of all."
    )


def _pixel_error(H: Array, uv: Array, to: Array) -> float:
    return float(np.sqrt(np.mean((carry(H, uv) - to) ** 2)))


HOMOGRAPHY = Exercise(
    name="19.homography",
    reference=homography,
    cases=_matched,
    any_numbers=False,
    laws=(_all_matches_count,),
    tolerance=1e-4,  # the smallest eigenvector of AᵀA, whose condition is that of A squared, is good enough
    hints=(
        "Each match brings two rows that are linear in the nine numbers of H. What must A h be for the right h?",
        "`np.block` builds A of the rows (x, 0, −u x) and (0, x, −v x). The last row of Vᵀ in `np.linalg.svd(A)` makes "
        "A h least.",
        "`H = np.linalg.svd(A)[2][___].reshape(3, 3)`",
    ),
    praise="Four matches are enough, and more of them average out their errors.",
)


@HOMOGRAPHY.right
def by_camviz(uv, to):
    from camviz import twoview

    return twoview.homography(uv, to)


@HOMOGRAPHY.right
def by_opencv(uv, to):
    import cv2

    return cv2.findHomography(uv, to)[0]


@HOMOGRAPHY.right
def with_the_last_number_fixed(uv, to):
    x, zero = np.column_stack([uv, np.ones(len(uv))]), np.zeros((len(uv), 3))
    rows = np.concatenate([np.hstack([x, zero, -to[:, :1] * uv]), np.hstack([zero, x, -to[:, 1:] * uv])])
    return np.append(np.linalg.lstsq(rows, to.T.ravel(), rcond=None)[0], 1.0).reshape(3, 3)


@HOMOGRAPHY.right
def row_by_row(uv, to):
    A = []
    for (a, b), (u, v) in zip(uv, to, strict=True):
        A += [[a, b, 1, 0, 0, 0, -u * a, -u * b, -u], [0, 0, 0, a, b, 1, -v * a, -v * b, -v]]
    H = np.linalg.svd(np.array(A))[2][8].reshape(3, 3)
    return H / H[2, 2]


@HOMOGRAPHY.convention(
    "H is right, up to its scale. The task asks for H[2, 2] = 1, which makes two answers comparable."
)
def of_unit_norm(uv, to):
    H = homography(uv, to)
    return H / np.linalg.norm(H)


@HOMOGRAPHY.wrong("This is the inverse: it takes `to` back to `uv`.")
def the_inverse(uv, to):
    return homography(to, uv)


@HOMOGRAPHY.wrong("You take the first row of Vᵀ, which makes A h *largest*. The last row makes it least.")
def first_singular_vector(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    A = np.block([[x, 0 * x, -to[:, :1] * x], [0 * x, x, -to[:, 1:] * x]])
    H = np.linalg.svd(A)[2][0].reshape(3, 3)
    return H / H[2, 2]


@HOMOGRAPHY.wrong("You take the last *column* of Vᵀ. `np.linalg.svd` gives Vᵀ, whose rows are the singular vectors.")
def last_column(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    A = np.block([[x, 0 * x, -to[:, :1] * x], [0 * x, x, -to[:, 1:] * x]])
    H = np.linalg.svd(A)[2][:, -1].reshape(3, 3)
    return H / H[2, 2]


@HOMOGRAPHY.wrong(
    "The nine numbers are stored by columns in yours. `reshape(3, 3)` without a transpose has them by rows."
)
def by_columns(uv, to):
    return homography(uv, to).T


@HOMOGRAPHY.wrong("The sign before u x and v x is turned round. From u (h₃ · x) = h₁ · x the row is (x, 0, −u x).")
def signs_turned_round(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    A = np.block([[x, 0 * x, to[:, :1] * x], [0 * x, x, to[:, 1:] * x]])
    H = np.linalg.svd(A)[2][-1].reshape(3, 3)
    return H / H[2, 2]


@HOMOGRAPHY.wrong("You have changed u and v of the target: the first row belongs to u, the second one to v.")
def u_and_v_changed(uv, to):
    return homography(uv, to[:, ::-1])


@HOMOGRAPHY.wrong(
    "This is the best *affine* map: its last row is (0, 0, 1), and parallel lines stay parallel. A turned camera needs "
    "all three numbers of the last row."
)
def affine(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    return np.vstack([np.linalg.lstsq(x, to, rcond=None)[0].T, [0, 0, 1]])


@HOMOGRAPHY.wrong("This is a mere shift, the mean of all differences. The pictures of a turned camera also stretch.")
def a_shift(uv, to):
    H = np.eye(3)
    H[:2, 2] = (to - uv).mean(axis=0)
    return H


@HOMOGRAPHY.wrong("You take the second-to-last singular vector. The least singular value is the last one.")
def second_to_last(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    A = np.block([[x, 0 * x, -to[:, :1] * x], [0 * x, x, -to[:, 1:] * x]])
    H = np.linalg.svd(A)[2][-2].reshape(3, 3)
    return H / H[2, 2]


# 3: how long the second step is --------------------------------------------------------------------------------------


def second_step(points: Array, R: Array, direction: Array, rays: Array) -> float:
    """The length ℓ for which R X + ℓ d lies on the ray of each point X: (n, 3) points and rays, (3,) d."""
    a = np.cross(rays, direction)
    b = np.cross(rays, points @ R.T)
    return -np.sum(a * b) / np.sum(a * a)


def _steps(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (6, 1, 20, 3):
        R = Rotation.from_rotvec(rng.uniform(0.1, 0.4, 3) * rng.choice([-1, 1], 3)).as_matrix()
        d = rng.normal(size=3)
        d, s = d / np.linalg.norm(d), rng.uniform(0.6, 2.5)
        points = rng.uniform((-2, -2, 4), (2, 2, 9), (n, 3))
        if n == 20:  # one of the points lies where the camera goes to: its ray tells no length
            points[7] = R.T @ (rng.uniform(4, 6) * d)
        seen = points @ R.T + s * d
        yield points, R, d, seen / np.linalg.norm(seen, axis=-1, keepdims=True)
    points, rays = rng.uniform((-2, -2, 4), (2, 2, 9), (8, 3)), rng.normal(size=(8, 3))
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)  # nothing fits: the sum of squares decides
    yield points, R, -d if second_step(points, R, d, rays) > 0 else d, rays  # s < 0: the direction is turned round


STEP = Exercise(
    name="19.second_step",
    reference=second_step,
    cases=_steps,
    any_numbers=False,
    hints=(
        "R X + ℓ d lies on the ray r. Then two vectors are parallel. What is their cross product?",
        "r × (R X) + ℓ (r × d) = 0: call them b + ℓ a = 0, three equations for each point. For all points together, "
        "ℓ is least squares in one unknown.",
        "`return -np.sum(a * b) / ___`",
    ),
    praise="One number, from all points at once. Which points tell most about it?",
)


@STEP.right
def by_lstsq(points, R, direction, rays):
    a, b = np.cross(rays, direction), np.cross(rays, points @ R.T)
    return np.linalg.lstsq(a.reshape(-1, 1), -b.ravel(), rcond=None)[0][0]


@STEP.right
def point_by_point(points, R, direction, rays):
    above = below = 0.0
    for X, r in zip(points, rays, strict=True):
        a, b = np.cross(r, direction), np.cross(r, R @ X)
        above, below = above - a @ b, below + a @ a
    return above / below


@STEP.right
def across_each_ray(points, R, direction, rays):
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    a, b = across @ direction, (across @ (points @ R.T)[..., None])[..., 0]
    return -(a * b).sum() / (a**2).sum()


@STEP.wrong("The sign is flipped: from b + ℓ a = 0 follows ℓ = −b/a.")
def sign_flipped(points, R, direction, rays):
    return -second_step(points, R, direction, rays)


@STEP.wrong("You did not turn the points. They are in the second camera's frame, and R brings them into the third's.")
def not_turned(points, R, direction, rays):
    return second_step(points, np.eye(3), direction, rays)


@STEP.wrong("You turn the points the wrong way. They are rows, so R X becomes `points @ R.T`.")
def turned_back(points, R, direction, rays):
    return second_step(points, R.T, direction, rays)


@STEP.wrong("You turn the direction as well. It is already in the third camera's frame, as t of a motion always is.")
def direction_turned(points, R, direction, rays):
    return second_step(points, R, R @ direction, rays)


@STEP.wrong(
    "You average the answers of single points. A point in the direction of the step tells no length, and its answer is "
    "0/0 or nonsense: let all points decide together."
)
def mean_of_single_answers(points, R, direction, rays):
    a, b = np.cross(rays, direction), np.cross(rays, points @ R.T)
    with np.errstate(all="ignore"):
        return -np.mean(np.sum(a * b, axis=-1) / np.sum(a * a, axis=-1))


@STEP.wrong("You take the first point alone. Where the pixels have errors, all points together are better.")
def first_point_alone(points, R, direction, rays):
    return second_step(points[:1], R, direction, rays[:1])


@STEP.wrong("You divide by the sum of b², where the sum of a² belongs: a stands before the unknown ℓ.")
def divided_by_b(points, R, direction, rays):
    a, b = np.cross(rays, direction), np.cross(rays, points @ R.T)
    return -np.sum(a * b) / np.sum(b * b)


@STEP.wrong("This is the ratio of lengths, which has no sign and counts every error as if it lay along a.")
def ratio_of_lengths(points, R, direction, rays):
    a, b = np.cross(rays, direction), np.cross(rays, points @ R.T)
    return np.linalg.norm(b) / np.linalg.norm(a)


@STEP.wrong("You divide the sum of a · b by the number of points. Least squares divides by the sum of a².")
def divided_by_the_count(points, R, direction, rays):
    a, b = np.cross(rays, direction), np.cross(rays, points @ R.T)
    return -np.sum(a * b) / len(points)


# 4: how many draws ----------------------------------------------------------------------------------------------------


def draws(share: Array, n: int, sure: float) -> Array:
    """How many draws (...) of n matches it takes, where a share (...) of the matches is right."""
    with np.errstate(divide="ignore"):
        needed = np.log(1 - sure) / np.log(1 - share**n)
    return np.maximum(np.ceil(needed * (1 - 1e-12)), 1)  # what rounding adds to a whole number is no draw


def _shares(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, n in zip(SHAPES, (2, 4, 5, 8), strict=True):
        yield rng.uniform(0.3, 0.7, shape), n, rng.uniform(0.9, 0.999)
    yield np.array([1.0, 0.9999, 0.3]), int(rng.integers(3, 7)), 0.95
    yield rng.uniform(0.25, 0.4, 20), int(rng.integers(4, 7)), rng.uniform(0.99, 0.999)
    yield np.array([0.5, 0.75]), 1, 1 - 0.5 ** int(rng.choice([2, 4, 6]))  # whole numbers of draws, just enough


DRAWS = Exercise(
    name="19.draws",
    reference=draws,
    cases=_shares,
    hints=(
        "Which is the probability that a single draw is spoilt? And that all k of them are?",
        "(1 − wⁿ)ᵏ ≤ 1 − sure. Take logarithms, divide, and round up with `np.ceil`. At least 1 is `np.maximum(…, 1)`.",
        "`needed = np.log(1 - sure) / np.log(___)`",
    ),
    praise="Few matches in a draw stand many wrong ones among all.",
)


@DRAWS.right
def by_log1p(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.clip(np.ceil(np.log1p(-sure) / np.log1p(-np.power(share, n))), 1, None)


@DRAWS.right
def one_by_one(share, n, sure):
    def single(w):
        return 1.0 if w == 1 else max(1.0, np.ceil(np.log2(1 - sure) / np.log2(1 - w**n)))

    return np.vectorize(single, otypes=[float])(share)


@DRAWS.wrong("A number of draws is a whole one: round up.")
def not_rounded(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.log(1 - sure) / np.log(1 - share**n), 1)


@DRAWS.wrong("You round to the nearest. Then it may be one draw too few: round *up*.")
def rounded_to_the_nearest(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.round(np.log(1 - sure) / np.log(1 - share**n)), 1)


@DRAWS.wrong("You round down, and so it is a draw too few.")
def rounded_down(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.floor(np.log(1 - sure) / np.log(1 - share**n)), 1)


@DRAWS.wrong("Where all matches are right, yours asks for no draw at all. One is needed to have an answer.")
def none_where_all_are_right(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.abs(np.ceil(np.log(1 - sure) / np.log(1 - share**n)))


@DRAWS.wrong("This is how many draws it takes *on average* until one is good. Here it is to be nearly sure.")
def on_average(share, n, sure):
    return np.ceil(1 / share**n)


@DRAWS.wrong("You count a draw as good if one of its matches is right. All n must be: wⁿ.")
def one_right_is_enough(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.ceil(np.log(1 - sure) / np.log((1 - share) ** n)), 1)


@DRAWS.wrong("You take `sure` for the probability that all draws are spoilt. That is 1 − `sure`.")
def sure_of_the_wrong_thing(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.ceil(np.log(sure) / np.log(1 - share**n)), 1)


@DRAWS.wrong("You take wⁿ for the probability that a draw is *spoilt*. It is that of a good one: 1 − wⁿ.")
def spoilt_for_good(share, n, sure):
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.maximum(np.ceil(np.log(1 - sure) / np.log(share**n)), 1)


@DRAWS.wrong("The n is missing: a draw has n matches, and all of them must be right.")
def without_n(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.ceil(np.log(1 - sure) / np.log(1 - share)), 1)


# 5: what bundle adjustment makes least -------------------------------------------------------------------------------


def residuals(turns: Array, steps: Array, points: Array, seen: Array, K: Array) -> Array:
    """Where n points were `seen` (m, n, 2), less where m cameras project them; rotation vectors and t are (m, 3)."""
    R = Rotation.from_rotvec(turns).as_matrix()
    x = (points @ np.swapaxes(R, 1, 2) + steps[:, None]) @ K.T
    return seen - x[..., :2] / x[..., 2:]


def _bundles(rng: np.random.Generator) -> Iterator[Arguments]:
    for m, n in ((3, 6), (1, 4), (2, 1), (4, 4), (3, 2)):
        turns, steps = rng.uniform(0.1, 0.4, (2, m, 3)) * rng.choice([-1, 1], (2, m, 3))
        points = rng.uniform((-2, -2, 4), (2, 2, 9), (n, 3))
        f, g = rng.uniform(400, 700, 2)
        K = np.array([[f, 0, rng.uniform(300, 340)], [0, g, rng.uniform(220, 260)], [0, 0, 1]])
        yield turns, steps, points, rng.uniform(0, 640, (m, n, 2)), K


RESIDUALS = Exercise(
    name="19.residuals",
    reference=residuals,
    cases=_bundles,
    hints=(
        "For one camera you have done this in lesson 04: R X + t, then K, then divide. Now there are m cameras and n "
        "points.",
        "`Rotation.from_rotvec(turns).as_matrix()` has shape (m, 3, 3). `points @ np.swapaxes(R, 1, 2)` turns all "
        "points by all of them, and `steps[:, None]` meets every point.",
        "`x = (points @ np.swapaxes(R, 1, 2) + ___) @ K.T`",
    ),
    praise="All cameras and all points in one array: that is all that an optimiser needs.",
)


@RESIDUALS.right
def camera_by_camera(turns, steps, points, seen, K):
    found = []
    for turn, t, uv in zip(turns, steps, seen, strict=True):
        x = (Rotation.from_rotvec(turn).apply(points) + t) @ K.T
        found.append(uv - x[:, :2] / x[:, 2:])
    return np.array(found)


@RESIDUALS.right
def by_opencv_for_each_camera(turns, steps, points, seen, K):
    import cv2

    each = [cv2.projectPoints(points, turn, t, K, None)[0][:, 0] for turn, t in zip(turns, steps, strict=True)]
    return seen - np.array(each)


@RESIDUALS.right
def by_einsum_over_all(turns, steps, points, seen, K):
    x = np.einsum("mij,nj->mni", K @ Rotation.from_rotvec(turns).as_matrix(), points) + (steps @ K.T)[:, None]
    return seen - x[..., :2] / x[..., 2:]


def _changed(turns, steps, points, seen, K, *, back=False, centre=False, flat=True, divide=True):
    R = Rotation.from_rotvec(turns).as_matrix()
    X = points[None] - steps[:, None] if centre else np.broadcast_to(points, (len(turns), *points.shape))
    x = X @ (R if back else np.swapaxes(R, 1, 2))
    x = x if centre else x + steps[:, None]
    x = x @ K.T if flat else x
    return seen - (x[..., :2] / x[..., 2:] if divide else x[..., :2])


@RESIDUALS.wrong("The sign is reversed. A residual is where the point was seen, *less* where the camera projects it.")
def projected_less_seen(turns, steps, points, seen, K):
    return -residuals(turns, steps, points, seen, K)


@RESIDUALS.wrong("You turn by the inverse rotation. Points are rows, so R X becomes `X @ R.T`, for every camera.")
def turned_by_the_inverse(turns, steps, points, seen, K):
    return _changed(turns, steps, points, seen, K, back=True)


@RESIDUALS.wrong("You take `steps` for the cameras' places and subtract them first. They are t: R X + t.")
def places_for_t(turns, steps, points, seen, K):
    return _changed(turns, steps, points, seen, K, centre=True)


@RESIDUALS.wrong("K is missing: these are normalised coordinates, and `seen` is in pixels.")
def without_K(turns, steps, points, seen, K):
    return _changed(turns, steps, points, seen, K, flat=False)


@RESIDUALS.wrong("You do not divide by the third number. Without it there is no perspective.")
def without_the_division(turns, steps, points, seen, K):
    return _changed(turns, steps, points, seen, K, divide=False)


@RESIDUALS.wrong("This is where the cameras project the points. A residual is `seen` less that.")
def projections_alone(turns, steps, points, seen, K):
    return -residuals(turns, steps, points, 0 * seen, K)


@RESIDUALS.wrong("These are the *sizes* of the residuals. The optimiser squares them by itself, and needs their signs.")
def sizes_of_the_residuals(turns, steps, points, seen, K):
    return np.abs(residuals(turns, steps, points, seen, K))


@RESIDUALS.wrong("These are the squares. `least_squares` squares the residuals by itself.")
def squares_of_the_residuals(turns, steps, points, seen, K):
    return residuals(turns, steps, points, seen, K) ** 2


@RESIDUALS.wrong("You leave out t. Then all cameras stand in one place, and nothing tells the depths.")
def without_the_steps(turns, steps, points, seen, K):
    return residuals(turns, 0 * steps, points, seen, K)


@RESIDUALS.wrong("You use the first camera's pose for all. Each camera has its own.")
def first_camera_for_all(turns, steps, points, seen, K):
    return residuals(turns * 0 + turns[:1], steps * 0 + steps[:1], points, seen, K)


# 6: the similarity that is free --------------------------------------------------------------------------------------


def aligned(points: Array, true: Array) -> Array:
    """Points (n, 3) moved, turned and scaled so that they lie as near to the true ones (n, 3) as they can."""
    middle, target = points.mean(axis=0), true.mean(axis=0)
    a, b = points - middle, true - target
    U, singular, Vt = np.linalg.svd(b.T @ a)
    sign = np.array([1, 1, np.linalg.det(U @ Vt)])
    scale = np.sum(singular * sign) / np.sum(a**2)
    return scale * a @ (U * sign @ Vt).T + target


def _clouds(rng: np.random.Generator) -> Iterator[Arguments]:
    for n, noise, depth in (
        (8, 0.0, 3.0),
        (20, 0.3, 3.0),
        (6, 0.0, 0.0),
        (7, 0.0, 0.0),
        (12, 0.2, -3.0),
        (9, 0.3, 0.0),
    ):
        true = rng.uniform((-3, -2, 4), (3, 2, 5), (n, 3)) * (1, 1, 1 if depth else 0)
        R = Rotation.from_rotvec(rng.uniform(0.5, 1.2, 3) * rng.choice([-1, 1], 3))
        points = rng.uniform(0.2, 3) * R.apply(true) + rng.uniform(1, 4, 3)
        mirrored = points * (1, 1, -1) if depth < 0 else points  # a mirror image must not be turned inside out
        yield mirrored + noise * rng.normal(size=(n, 3)), true


ALIGNED = Exercise(
    name="19.aligned",
    reference=aligned,
    cases=_clouds,
    tolerance=1e-7,
    hints=(
        "Take the middles away first. Then a rotation is left, and one scale.",
        "`np.linalg.svd` of Bᵀ A gives U, the singular values and Vᵀ. The rotation is U D Vᵀ with D = diag(1, 1, ±1), "
        "so that it is no mirror image. The scale is the sum of D's signs times the singular values, over the sum of "
        "the squares of a.",
        "`scale = np.sum(singular * sign) / ___`",
    ),
    praise="Three numbers of place, three of rotation and one of scale: pictures leave these seven free.",
)


@ALIGNED.right
def as_umeyama_writes_it(points, true):
    a, b = points - points.mean(0), true - true.mean(0)
    U, D, Vt = np.linalg.svd(b.T @ a / len(a))
    S = np.eye(3)
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        S[2, 2] = -1
    c = np.trace(np.diag(D) @ S) / a.var(axis=0).sum()
    R = U @ S @ Vt
    return np.array([c * R @ x + true.mean(0) - c * R @ points.mean(0) for x in points])


@ALIGNED.right
def by_scipy_s_rotation(points, true):
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    turned = a @ _kabsch(a, b).T
    return np.sum(turned * b) / np.sum(a * a) * turned + true.mean(axis=0)


def _kabsch(a, b):
    U, _, Vt = np.linalg.svd(a.T @ b)
    return Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T


def _moved(points, true, scale=None, rotation=None):
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    R = _kabsch(a, b) if rotation is None else rotation(a, b)
    turned = a @ R.T
    s = np.sum(turned * b) / np.sum(a * a) if scale is None else scale(turned, b)
    return s * turned + true.mean(axis=0)


@ALIGNED.wrong("The scale is left at 1. Pictures do not tell it, so it must be found as well.")
def without_scale(points, true):
    return _moved(points, true, scale=lambda a, b: 1.0)


@ALIGNED.wrong("You did not turn the points. Where the first camera looked is free, too.")
def without_rotation(points, true):
    return _moved(points, true, rotation=lambda a, b: np.eye(3))


@ALIGNED.wrong("You turn them the wrong way: this is the inverse of the rotation.")
def rotation_turned_round(points, true):
    return _moved(points, true, rotation=lambda a, b: _kabsch(a, b).T, scale=lambda a, b: _scale(points, true))


def _scale(points, true):
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    return np.sum((a @ _kabsch(a, b).T) * b) / np.sum(a * a)


@ALIGNED.wrong("Yours may come out as a mirror image. Where det(U Vᵀ) is −1, the last singular value changes its sign.")
def mirror_image(points, true):
    def rotation(a, b):
        U, _, Vt = np.linalg.svd(b.T @ a)
        return U @ Vt

    return _moved(points, true, rotation=rotation)


@ALIGNED.wrong("They are in the middle of the wrong cloud: add the middle of the *true* points at the end.")
def own_middle(points, true):
    return _moved(points, true) - true.mean(axis=0) + points.mean(axis=0)


@ALIGNED.wrong("The middle is missing at the end: add that of the true points.")
def without_middle(points, true):
    return _moved(points, true) - true.mean(axis=0)


@ALIGNED.wrong(
    "Your scale is the ratio of the two sizes. With noise that is too large: the noise makes a cloud larger, and only "
    "what agrees with the other one counts."
)
def ratio_of_sizes(points, true):
    return _moved(points, true, scale=lambda a, b: np.linalg.norm(b) / np.linalg.norm(a))


@ALIGNED.wrong("Your scale is the inverse: it brings the true points to yours.")
def inverse_scale(points, true):
    return _moved(points, true, scale=lambda a, b: np.sum(a * a) / np.sum(a * b))


@ALIGNED.wrong("You divide by the squares of the true points, where those of `points` belong: they are what is scaled.")
def scale_of_the_others(points, true):
    return _moved(points, true, scale=lambda a, b: np.sum(a * b) / np.sum(b * b))


@ALIGNED.wrong("You answer the true points themselves. Only a move, a turn and a scale are allowed.")
def the_true_points(points, true):
    return true.copy()


EXERCISES = (CARRY, HOMOGRAPHY, STEP, DRAWS, RESIDUALS, ALIGNED)
