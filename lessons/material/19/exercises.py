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
def as_opencv_carries(H, uv):
    import cv2

    return cv2.perspectiveTransform(np.reshape(uv, (-1, 1, 2)), H).reshape(np.shape(uv))


@CARRY.wrong("You do not divide at all. H gives three numbers: divide the first two by the third.")
def not_divided(H, uv):
    return (np.insert(uv, 2, 1.0, axis=-1) @ H.T)[..., :2]


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


@CARRY.wrong("You divide by the *size* of the third number. Keep its sign: −H is the same homography as H.")
def divided_by_the_size(H, uv):
    x = np.insert(uv, 2, 1.0, axis=-1) @ H.T
    return x[..., :2] / np.abs(x[..., 2:])


# 2: a homography from matches ----------------------------------------------------------------------------------------


def homography(uv: Array, to: Array) -> Array:
    """H (3, 3) with H[2, 2] = 1 that takes pixels (n, 2) to others (n, 2), for n of 4 and more."""
    H = _singular_vectors(uv, to)[-1].reshape(3, 3)
    return H / H[2, 2]


def _singular_vectors(uv: Array, to: Array) -> Array:
    """Vᵀ (9, 9) of the rows (x, 0, −u x) and (0, x, −v x)."""
    x = np.column_stack([uv, np.ones(len(uv))])
    u, v = to[:, :1], to[:, 1:]
    return np.linalg.svd(np.block([[x, 0 * x, -u * x], [0 * x, x, -v * x]]))[2]


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
def by_opencv(uv, to):
    import cv2

    return cv2.findHomography(uv, to)[0]


@HOMOGRAPHY.right
def with_the_last_number_fixed(uv, to):
    x, zero = np.column_stack([uv, np.ones(len(uv))]), np.zeros((len(uv), 3))
    rows = np.concatenate([np.hstack([x, zero, -to[:, :1] * uv]), np.hstack([zero, x, -to[:, 1:] * uv])])
    return np.append(np.linalg.lstsq(rows, to.T.ravel(), rcond=None)[0], 1.0).reshape(3, 3)


@HOMOGRAPHY.convention(
    "H is right, up to its scale. The task asks for H[2, 2] = 1, which makes two answers comparable."
)
def of_unit_norm(uv, to):
    H = homography(uv, to)
    return H / np.linalg.norm(H)


@HOMOGRAPHY.wrong("This is the inverse: it takes `to` back to `uv`.")
def the_inverse(uv, to):
    return homography(to, uv)


@HOMOGRAPHY.wrong("You take the last *column* of Vᵀ. `np.linalg.svd` gives Vᵀ: its rows are the singular vectors.")
def last_column(uv, to):
    H = _singular_vectors(uv, to)[:, -1].reshape(3, 3)
    return H / H[2, 2]


@HOMOGRAPHY.wrong("The signs of u x and v x are wrong. From u (h₃ · x) = h₁ · x the row is (x, 0, −u x).")
def signs_turned_round(uv, to):
    H = _singular_vectors(uv, -to)[-1].reshape(3, 3)
    return H / H[2, 2]


@HOMOGRAPHY.wrong("You exchanged u and v of the target: the first row belongs to u, the second one to v.")
def u_and_v_changed(uv, to):
    return homography(uv, to[:, ::-1])


@HOMOGRAPHY.wrong("This is the best *affine* map: it keeps parallel lines. A turned camera needs H's whole last row.")
def affine(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    return np.vstack([np.linalg.lstsq(x, to, rcond=None)[0].T, [0, 0, 1]])


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
def across_each_ray(points, R, direction, rays):
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    a, b = across @ direction, (across @ (points @ R.T)[..., None])[..., 0]
    return -(a * b).sum() / (a**2).sum()


@STEP.wrong("You did not turn the points. R brings them from the second camera's frame into the third's.")
def not_turned(points, R, direction, rays):
    return second_step(points, np.eye(3), direction, rays)


@STEP.wrong("You turn the points the wrong way. They are rows, so R X becomes `points @ R.T`.")
def turned_back(points, R, direction, rays):
    return second_step(points, R.T, direction, rays)


@STEP.wrong("You turn the direction as well. It is in the third camera's frame already.")
def direction_turned(points, R, direction, rays):
    return second_step(points, R, R @ direction, rays)


@STEP.wrong("You average single answers. A point in the step's direction tells no length: sum over all first.")
def mean_of_single_answers(points, R, direction, rays):
    a, b = np.cross(rays, direction), np.cross(rays, points @ R.T)
    with np.errstate(all="ignore"):
        return -np.mean(np.sum(a * b, axis=-1) / np.sum(a * a, axis=-1))


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


@DRAWS.wrong("A number of draws is a whole one: round up.")
def not_rounded(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.log(1 - sure) / np.log(1 - share**n), 1)


@DRAWS.wrong("You round to the nearest. Then it may be one draw too few: round *up*.")
def rounded_to_the_nearest(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.round(np.log(1 - sure) / np.log(1 - share**n)), 1)


@DRAWS.wrong("Where all matches are right, yours asks for no draw at all. At least one is needed.")
def none_where_all_are_right(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.abs(np.ceil(np.log(1 - sure) / np.log(1 - share**n)))


@DRAWS.wrong("This is how many draws it takes *on average* until one is good. Here it must be nearly sure.")
def on_average(share, n, sure):
    return np.ceil(1 / share**n)


@DRAWS.wrong("You count a draw as good if one of its matches is right. All n must be: wⁿ.")
def one_right_is_enough(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.ceil(np.log(1 - sure) / np.log((1 - share) ** n)), 1)


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
def by_opencv_for_each_camera(turns, steps, points, seen, K):
    import cv2

    each = [cv2.projectPoints(points, turn, t, K, None)[0][:, 0] for turn, t in zip(turns, steps, strict=True)]
    return seen - np.array(each)


def _changed(turns, steps, points, seen, K, *, back=False, centre=False, flat=True, divide=True):
    R = Rotation.from_rotvec(turns).as_matrix()
    X = points[None] - steps[:, None] if centre else np.broadcast_to(points, (len(turns), *points.shape))
    x = X @ (R if back else np.swapaxes(R, 1, 2))
    x = x if centre else x + steps[:, None]
    x = x @ K.T if flat else x
    return seen - (x[..., :2] / x[..., 2:] if divide else x[..., :2])


@RESIDUALS.wrong("The sign is reversed. A residual is where the point was detected, *less* where it is projected.")
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


@RESIDUALS.wrong("These are the squares. `least_squares` squares the residuals by itself.")
def squares_of_the_residuals(turns, steps, points, seen, K):
    return residuals(turns, steps, points, seen, K) ** 2


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


def _moved(points, true, scale=lambda turned, b: np.sum(turned * b) / np.sum(turned**2), mirror=False):
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    U, _, Vt = np.linalg.svd(b.T @ a)
    turned = a @ (U * [1, 1, 1 if mirror else np.linalg.det(U @ Vt)] @ Vt).T
    return scale(turned, b) * turned + true.mean(axis=0)


@ALIGNED.wrong("You leave the scale at 1. Pictures do not tell it, so find it as well.")
def without_scale(points, true):
    return _moved(points, true, scale=lambda a, b: 1.0)


@ALIGNED.wrong("Yours may be a mirror image. Where det(U Vᵀ) is −1, the last singular value changes its sign.")
def mirror_image(points, true):
    return _moved(points, true, mirror=True)


@ALIGNED.wrong("They are in the middle of the wrong cloud: add the middle of the *true* points at the end.")
def own_middle(points, true):
    return _moved(points, true) - true.mean(axis=0) + points.mean(axis=0)


@ALIGNED.wrong("Your scale is the ratio of the two sizes. Noise makes a cloud larger: use only what agrees.")
def ratio_of_sizes(points, true):
    return _moved(points, true, scale=lambda a, b: np.linalg.norm(b) / np.linalg.norm(a))


@ALIGNED.wrong("You did not turn the points. The clouds may be turned against each other, too.")
def without_rotation(points, true):
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    return np.sum(a * b) / np.sum(a * a) * a + true.mean(axis=0)


EXERCISES = (CARRY, HOMOGRAPHY, STEP, DRAWS, RESIDUALS, ALIGNED)
