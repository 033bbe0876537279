"""Lesson 18, one picture: where lines meet, the focal length, heights; deeper, any tilt, the middle, six points.

Pixels are (u, v), v downwards. Points and lines of the projective plane are (3,), up to scale.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise
from camviz_school.course.laws import error_ratio, unused_row
from camviz_school.course.trials import Function

NOWHERE = np.full(2, np.nan)


def _camera(rng: np.random.Generator, tilt: float = 12.0) -> tuple[Array, Array, Array]:
    """K, R and t of a camera that looks across level ground, y down, 1 to 2.5 m above it; it is not rolled."""
    f, yaw, pitch = rng.uniform(400, 900), rng.uniform(25, 65), rng.uniform(-tilt, tilt)
    K = np.array([[f, 0, rng.uniform(280, 360)], [0, f, rng.uniform(200, 280)], [0, 0, 1]])
    (s, c), (p, q) = ((np.sin(a), np.cos(a)) for a in np.radians((yaw, pitch)))
    R = np.array([[1, 0, 0], [0, q, -p], [0, p, q]]) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    return K, R, np.zeros(3)


# 1: where two lines meet ----------------------------------------------------------------------------------------------


def meet(a: Array, b: Array, c: Array, d: Array) -> Array:
    """The point (2,) of the lines through a, b and through c, d, as the cross product of their cross products."""
    x, y, w = np.cross(np.cross([*a, 1], [*b, 1]), np.cross([*c, 1], [*d, 1]))
    return np.array([x, y]) / w if w != 0 else np.full(2, np.nan)


def _lines(rng: np.random.Generator) -> Iterator[Arguments]:
    for low in (-900, 0, 0):  # prolonged beyond the picture's corner, and in it
        yield tuple(rng.uniform(low, low + 800, (4, 2)))
    a, c = rng.integers(0, 400, (2, 2)).astype(float)
    step = 2.0 ** rng.integers(4, 7, 2)
    p, q = rng.uniform(-100, 100, (2, 2))
    yield a - p, a + 2 * p, a - q, a + q  # they meet between their ends
    yield a + p, a + 3 * p, a + q, a + 2 * q  # beyond the ends of both, and neither is upright
    yield a, a + step, c, c + 2 * step  # parallel
    yield a, a + (0, 64), c, c + (37, 0)  # upright and level
    yield a, a + (0, 64), a + (32, 8), a + (32, 40)  # both upright


MEET = Exercise(
    name="18.meet",
    reference=meet,
    cases=_lines,
    shown=((np.array([100.0, 100.0]), np.array([300.0, 140.0]), np.array([100.0, 300.0]), np.array([300.0, 240.0])),),
    hints=(
        "Give every point a third number, 1. Which product makes a line of two points, and a point of two lines?",
        "`np.cross` twice makes both lines, and once more the point (x, y, w). Pixels are (x/w, y/w); parallel lines "
        "have w = 0.",
        "`x, y, w = np.cross(np.cross([*a, 1], [*b, 1]), ___)`",
    ),
    praise="It holds for upright lines too, which have no slope.",
)


@MEET.right
def by_two_equations(a, b, c, d):
    along, other = b - a, d - c
    w = along[0] * other[1] - along[1] * other[0]
    if w == 0:
        return np.array([np.nan, np.nan])
    s = ((c - a)[0] * other[1] - (c - a)[1] * other[0]) / w
    return a + s * along


@MEET.right
def by_a_linear_system(a, b, c, d):
    try:
        s, _ = np.linalg.solve(np.column_stack([b - a, c - d]), c - a)
    except np.linalg.LinAlgError:
        return [np.nan, np.nan]
    return (a + s * (b - a)).tolist()


@MEET.right
def by_opencv_s_convert(a, b, c, d):
    first, second = np.cross([*a, 1.0], [*b, 1.0]), np.cross([*c, 1.0], [*d, 1.0])
    point = np.cross(first / np.linalg.norm(first[:2]), second / np.linalg.norm(second[:2]))
    if abs(point[2]) < 1e-12:
        return NOWHERE
    return cv2.convertPointsFromHomogeneous(point[None])[0, 0]


@MEET.wrong("Where the lines are parallel, w is 0 and there is no such point: answer NaN, not infinity.")
def infinite_for_parallel_lines(a, b, c, d):
    x, y, w = np.cross(np.cross([*a, 1], [*b, 1]), np.cross([*c, 1], [*d, 1]))
    return np.array([x, y]) / np.float64(w)


@MEET.wrong("The third number w is not divided out. Pixels are (x/w, y/w).")
def not_divided(a, b, c, d):
    x, y, w = np.cross(np.cross([*a, 1], [*b, 1]), np.cross([*c, 1], [*d, 1]))
    return np.array([x, y]) if w else NOWHERE


@MEET.wrong("You divide by −w. The three numbers of a cross product belong together: divide by the third as it is.")
def divided_by_minus_w(a, b, c, d):
    return -meet(a, b, c, d)


@MEET.wrong("Your lines run through a, c and through b, d. The first is to run through a and b.")
def lines_across(a, b, c, d):
    return meet(a, c, b, d)


@MEET.wrong("Your lines run through a, d and through b, c. The first is to run through a and b.")
def lines_crosswise(a, b, c, d):
    return meet(a, d, b, c)


@MEET.wrong("An upright line has no slope, and yours answers NaN for it. The cross product needs no slopes.")
def by_slopes(a, b, c, d):
    m, n = (b[1] - a[1]) / (b[0] - a[0]), (d[1] - c[1]) / (d[0] - c[0])
    x = (c[1] - a[1] + m * a[0] - n * c[0]) / (m - n)
    point = np.array([x, a[1] + m * (x - a[0])])
    return point if np.isfinite(point).all() else NOWHERE


@MEET.wrong("This is the middle of the four points. The lines go on beyond their ends.")
def middle_of_all(a, b, c, d):
    return (a + b + c + d) / 4 if np.isfinite(meet(a, b, c, d)).all() else NOWHERE


@MEET.wrong("You look for the meeting point between the ends only. The lines go on beyond them.")
def between_the_ends(a, b, c, d):
    point = meet(a, b, c, d)
    inside = [((point - p) @ (q - p)) / ((q - p) @ (q - p)) for p, q in ((a, b), (c, d))]
    return point if np.isfinite(point).all() and min(inside) >= 0 and max(inside) <= 1 else NOWHERE


@MEET.wrong("Row and column have changed places in your answer: u, the column, comes first.")
def row_first(a, b, c, d):
    return meet(a, b, c, d)[::-1]


# 2: the focal length --------------------------------------------------------------------------------------------------


def focal_length(first: Array, second: Array, centre: Array) -> Array:
    """√(−(first − centre) · (second − centre)) (...), NaN where what stands below the root is not above 0."""
    product = -np.sum((first - centre) * (second - centre), axis=-1)
    return np.sqrt(np.where(product > 0, product, np.nan))


def _right_angles(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        centre, f = rng.uniform(200, 500, 2) * (-2 if shape == (6,) else 1), rng.uniform(300, 900, shape)  # or cropped
        turn, height = rng.uniform(0.4, 1.1, shape), rng.uniform(-150, 150, shape)
        deep = np.hypot(f, height)
        first = centre + np.stack([deep * np.tan(turn), height], axis=-1)
        second = centre + np.stack([-deep / np.tan(turn), height], axis=-1)
        yield first, second, centre
    centre = rng.integers(200, 500, 2).astype(float)
    one = centre + rng.integers(50, 300, 2)
    others = np.array([one + 40, [np.nan, np.nan], 2 * centre - one, centre, centre - (one - centre)[::-1] * (1, -1)])
    yield np.broadcast_to(one, (5, 2)), others, centre  # an acute angle, none, a right one, and twice a product of 0
    yield centre + (0.5, 0.25), centre - (0.5, 0.25), centre  # through a lens of half a pixel


FOCAL_LENGTH = Exercise(
    name="18.focal_length",
    reference=focal_length,
    cases=_right_angles,
    hints=(
        "Both points are seen from the principal point. What does the equation say of the product of these two arrows?",
        "Subtract `centre` from both, multiply, sum over the last axis. The sum is −f². `np.where` keeps the root from "
        "what is not above 0.",
        "`product = -np.sum((first - centre) * ___, axis=-1)`",
    ),
    praise="Two points and a right angle: no board was needed.",
)


@FOCAL_LENGTH.right
def by_einsum(first, second, centre):
    product = np.einsum("...i,...i", first - centre, second - centre)
    return np.sqrt(-product, where=product < 0, out=np.full(product.shape, np.nan))


@FOCAL_LENGTH.right
def by_pythagoras(first, second, centre):
    a, b, c = (np.sum(x**2, axis=-1) for x in (first - centre, second - centre, first - second))
    half = (c - a - b) / 2  # three sides of the triangle between both points and the eye
    return np.where(half > 0, np.sqrt(np.abs(half)), np.nan)


@FOCAL_LENGTH.right
def column_and_row(first, second, centre):
    (u, v), (s, t) = (np.moveaxis(x - centre, -1, 0) for x in (first, second))
    product = np.asarray(-u * s - v * t)
    return np.sqrt(np.where(product <= 0, np.nan, product)).tolist()


@FOCAL_LENGTH.wrong("This is f². Take the root.")
def squared(first, second, centre):
    product = -np.sum((first - centre) * (second - centre), axis=-1)
    return np.where(product > 0, product, np.nan)


@FOCAL_LENGTH.wrong("You count from the first pixel. Both arrows begin at the principal point.")
def from_the_corner(first, second, centre):
    return focal_length(first, second, 0 * centre)


@FOCAL_LENGTH.wrong(
    "You take the size of the product. Where it is positive the two directions are at no right angle, and no focal "
    "length fits: answer NaN."
)
def size_of_the_product(first, second, centre):
    return np.sqrt(np.abs(np.sum((first - centre) * (second - centre), axis=-1)))


@FOCAL_LENGTH.wrong("Where the product is positive, you answer 0. No focal length fits there: answer NaN.")
def held_at_zero(first, second, centre):
    return np.sqrt(np.maximum(-np.sum((first - centre) * (second - centre), axis=-1), 0))


@FOCAL_LENGTH.wrong(
    "You multiply the distances of both points. Their arrows matter, too: take the product of the vectors."
)
def product_of_distances(first, second, centre):
    product = np.linalg.norm(first - centre, axis=-1) * np.linalg.norm(second - centre, axis=-1)
    return np.sqrt(np.where(np.sum((first - centre) * (second - centre), axis=-1) < 0, product, np.nan))


@FOCAL_LENGTH.wrong(
    "You use the columns alone. A tilted camera has both points off the middle row, and rows count, too."
)
def columns_alone(first, second, centre):
    product = -(first - centre)[..., 0] * (second - centre)[..., 0]
    return np.sqrt(np.where(product > 0, product, np.nan))


@FOCAL_LENGTH.wrong("This is half the distance of the points: right only in a level picture of walls both seen at 45°.")
def half_the_distance(first, second, centre):
    half = np.linalg.norm(first - second, axis=-1) / 2
    return np.where(np.sum((first - centre) * (second - centre), axis=-1) < 0, half, np.nan)


@FOCAL_LENGTH.wrong("You sum over all points. Each pair has a focal length of its own: sum over the last axis.")
def summed_over_all(first, second, centre):
    product = -np.sum((first - centre) * (second - centre))
    return np.sqrt(product) if product > 0 else np.nan


@FOCAL_LENGTH.wrong("The sign is missing below the root: the product of the arrows is −f².")
def without_the_sign(first, second, centre):
    product = np.sum((first - centre) * (second - centre), axis=-1)
    return np.sqrt(np.where(product > 0, product, np.nan))


@FOCAL_LENGTH.wrong(
    "You take the mean of the two distances. The right angle at the eye asks for the root of a product."
)
def mean_of_distances(first, second, centre):
    mean = (np.linalg.norm(first - centre, axis=-1) + np.linalg.norm(second - centre, axis=-1)) / 2
    return np.where(np.sum((first - centre) * (second - centre), axis=-1) < 0, mean, np.nan)


# 3: a height from another ---------------------------------------------------------------------------------------------


def height(foot: Array, top: Array, horizon: float, door_foot: float, door_top: float, door_height: float) -> Array:
    """By rows of a level picture: both heights are measured in camera heights, (foot − top) / (foot − horizon)."""
    thing = (foot - top) / (foot - horizon)
    door = (door_foot - door_top) / (door_foot - horizon)
    return door_height * thing / door


def _rows(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        f, horizon, eye = rng.uniform(400, 900), rng.uniform(200, 300), rng.uniform(1, 3)
        horizon -= 1500 if shape == (6,) else 0  # above the picture, where someone has cropped it
        far, door_far = rng.uniform(3, 30, shape), rng.uniform(4, 8)
        foot, door_foot = horizon + f * eye / far, horizon + f * eye / door_far
        door_height = rng.uniform(1.5, 3.5)
        yield (
            foot,
            foot - f * rng.uniform(0.3, 6, shape) / far,
            horizon,
            door_foot,
            door_foot - f * door_height / door_far,
            door_height,
        )


def same_ruler_everywhere(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (foot - top) / (door_foot - door_top)


HEIGHT = Exercise(
    name="18.height",
    reference=height,
    cases=_rows,
    as_given=same_ruler_everywhere,
    hints=(
        "Pull the staff away from the camera. Its number of pixels falls, and the given function believes it.",
        "The camera is as high above every foot as the horizon is: `foot - horizon` rows are one camera height there. "
        "Do the same at the door, then divide.",
        "`thing = (foot - top) / ___`, the same for the door, and `door_height * thing / door`",
    ),
    praise="The distance of the staff is nowhere in it, and neither is the focal length.",
)


@HEIGHT.right
def camera_height_first(foot, top, horizon, door_foot, door_top, door_height):
    eye = door_height * (door_foot - horizon) / (door_foot - door_top)
    return eye * (foot - top) / (foot - horizon)


@HEIGHT.right
def by_the_scale_at_the_foot(foot, top, horizon, door_foot, door_top, door_height):
    metres_a_row = door_height / (door_foot - door_top)
    return (foot - top) * metres_a_row * ((door_foot - horizon) / (foot - horizon))


@HEIGHT.right
def less_what_is_above_the_horizon(foot, top, horizon, door_foot, door_top, door_height):
    eye = door_height / (1 + (horizon - door_top) / (door_foot - horizon))
    return (eye + eye * (horizon - top) / (foot - horizon)).tolist()


@HEIGHT.wrong("The share is upside down. What stands farther away is *taller* than its rows say.")
def upside_down(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (foot - top) / (door_foot - door_top) * (foot - horizon) / (door_foot - horizon)


@HEIGHT.wrong("You measure the top from the horizon. The whole thing stands between foot and top.")
def top_from_the_horizon(foot, top, horizon, door_foot, door_top, door_height):
    eye = door_height * (door_foot - horizon) / (door_foot - door_top)
    return eye * (horizon - top) / (foot - horizon)


@HEIGHT.wrong(
    "The horizon stands at the door's height in yours. It is as high as the *camera*: measure the door by it first."
)
def horizon_at_the_doors_height(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (foot - top) / (foot - horizon)


@HEIGHT.wrong("You compare the feet's rows from the top of the picture. Measure them from the horizon.")
def feet_from_the_border(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (foot - top) / (door_foot - door_top) * door_foot / foot


@HEIGHT.wrong(
    "You divide by the rows from the *top* to the horizon. The *foot* stands on the ground, which gives the scale."
)
def scale_at_the_tops(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (foot - top) / (door_foot - door_top) * (door_top - horizon) / (top - horizon)


@HEIGHT.wrong("This is the height in camera heights. Bring in the door, whose height in metres is known.")
def in_camera_heights(foot, top, horizon, door_foot, door_top, door_height):
    return (foot - top) / (foot - horizon) + 0 * door_height


@HEIGHT.wrong("This is the camera's height, which the horizon shows. The staff is another share of it.")
def the_camera_s_height(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (door_foot - horizon) / (door_foot - door_top) + 0 * foot


@HEIGHT.wrong(
    "You compare the square of the distances. One row is so many metres in proportion to the distance itself."
)
def by_squares(foot, top, horizon, door_foot, door_top, door_height):
    return door_height * (foot - top) / (door_foot - door_top) * ((door_foot - horizon) / (foot - horizon)) ** 2


# 4: a height in a tilted picture --------------------------------------------------------------------------------------


def any_height(
    foot: Array, top: Array, door_foot: Array, door_top: Array, door_height: float, horizon: Array, vertical: Array
) -> Array:
    """Criminisi's |b × t| / (l · b |v × t|) of the thing over that of the door, times the door's height."""

    def measure(b: Array, t: Array) -> float:
        b, t = np.array([*b, 1]), np.array([*t, 1])
        return np.linalg.norm(np.cross(b, t)) / ((horizon @ b) * np.linalg.norm(np.cross(vertical, t)))

    return door_height * measure(foot, top) / measure(door_foot, door_top)


def _tilted(rng: np.random.Generator) -> Iterator[Arguments]:
    for number in range(5):
        K, R, _ = _camera(rng, tilt=25.0 if number else 0.0)
        while number > 2 and (-1) ** number * R[2, 1] > -0.2:  # tilted by 12° and more, once up and once down
            K, R, _ = _camera(rng, tilt=25.0)
        K[:2, 2] -= 900 if number == 3 else 0  # cropped
        eye, tall, door = rng.uniform(1, 2.5), rng.uniform(0.4, 4), rng.uniform(1.5, 3)
        ahead = R[2] * (1, 0, 1) / np.hypot(R[2, 0], R[2, 2])
        aside = np.cross([0, 1, 0], ahead)

        def pixel(place: Array, above: float, K: Array = K, R: Array = R, eye: float = eye) -> Array:
            x = K @ R @ (place + [0, eye - above, 0])
            return x[:2] / x[2]

        one = ahead * rng.uniform(6, 25) + aside * rng.uniform(-2, 2)
        two = ahead * rng.uniform(5, 9) + aside * rng.uniform(-2, 2)
        horizon = np.cross(K @ R[:, 0], K @ R[:, 2]) * (-1) ** number * rng.uniform(0.1, 3)
        vertical = K @ R[:, 1] * (-1) ** (number // 2) * rng.uniform(0.1, 3)
        yield pixel(one, 0), pixel(one, tall), pixel(two, 0), pixel(two, door), door, horizon, vertical


ANY_HEIGHT = Exercise(
    name="18.any_height",
    reference=any_height,
    cases=_tilted,
    any_numbers=False,
    hints=(
        "The equation gives camera heights up to a factor that is the same for staff and door. What do you divide?",
        "Write the right side as a function of one foot and top, each with a third number 1. Call it twice.",
        "`return np.linalg.norm(np.cross(b, t)) / ((horizon @ b) * np.linalg.norm(___))`",
    ),
    praise="Neither K nor the tilt was needed: the horizon and one point hold both.",
)


@ANY_HEIGHT.right
def by_distances_along_the_line(foot, top, door_foot, door_top, door_height, horizon, vertical):
    def share(b, t):
        b, t = np.array([*b, 1.0]), np.array([*t, 1.0])
        # t = b + s v up to scale; s over l · b is the height
        s = -np.cross(b, t) @ np.cross(vertical, t) / (np.cross(vertical, t) @ np.cross(vertical, t))
        return s / (horizon @ b)

    return door_height * share(foot, top) / share(door_foot, door_top)


@ANY_HEIGHT.right
def by_the_cross_ratio(foot, top, door_foot, door_top, door_height, horizon, vertical):
    def share(b, t):
        b, t = np.array([*b, 1.0]), np.array([*t, 1.0])
        level = np.cross(np.cross(b, t), horizon)  # where the upright line crosses the horizon
        v = None if abs(vertical[2]) < 1e-12 * np.abs(vertical).max() else vertical[:2] / vertical[2]
        h = level[:2] / level[2]
        along = lambda p: (p - b[:2]) @ (h - b[:2])  # noqa: E731
        ratio = along(t[:2]) / along(h)
        return ratio if v is None else ratio * (along(v) - along(h)) / (along(v) - along(t[:2]))

    return door_height * share(foot, top) / share(door_foot, door_top)


@ANY_HEIGHT.wrong("The point of the upright lines is left out. Then it is right only where they do not meet.")
def without_the_vertical(foot, top, door_foot, door_top, door_height, horizon, vertical):
    return _measured(door_height, (foot, top), (door_foot, door_top), lambda b, t: _cross(b, t) / (horizon @ b))


@ANY_HEIGHT.wrong("The horizon is left out: then a thing far away comes out shorter.")
def without_the_horizon(foot, top, door_foot, door_top, door_height, horizon, vertical):
    return _measured(door_height, (foot, top), (door_foot, door_top), lambda b, t: _cross(b, t) / _cross(vertical, t))


@ANY_HEIGHT.wrong("You multiply the horizon by the top. The *foot* stands on the ground, whose horizon it is.")
def horizon_times_top(foot, top, door_foot, door_top, door_height, horizon, vertical):
    rule = lambda b, t: _cross(b, t) / ((horizon @ t) * _cross(vertical, t))  # noqa: E731
    return _measured(door_height, (foot, top), (door_foot, door_top), rule)


@ANY_HEIGHT.wrong("You cross the upright point with the foot. It is the *top* that stands there in the equation.")
def vertical_by_the_foot(foot, top, door_foot, door_top, door_height, horizon, vertical):
    rule = lambda b, t: _cross(b, t) / ((horizon @ b) * _cross(vertical, b))  # noqa: E731
    return _measured(door_height, (foot, top), (door_foot, door_top), rule)


@ANY_HEIGHT.wrong("Thing and door are upside down: the thing's share stands above the line.")
def door_over_thing(foot, top, door_foot, door_top, door_height, horizon, vertical):
    return door_height**2 / any_height(foot, top, door_foot, door_top, door_height, horizon, vertical)


@ANY_HEIGHT.wrong("This is one measure alone, and its factor is unknown. Divide it by that of the door.")
def not_by_the_door(foot, top, door_foot, door_top, door_height, horizon, vertical):
    b, t = np.array([*foot, 1]), np.array([*top, 1])
    return _cross(b, t) / ((horizon @ b) * _cross(vertical, t))


@ANY_HEIGHT.wrong("This is the share of the door's height. Multiply by the door's height in metres.")
def in_doors(foot, top, door_foot, door_top, door_height, horizon, vertical):
    return any_height(foot, top, door_foot, door_top, 1.0, horizon, vertical)


@ANY_HEIGHT.wrong("This is exercise 3's rule, by rows. It holds for a level camera only.")
def by_rows(foot, top, door_foot, door_top, door_height, horizon, vertical):
    a, b, c = horizon
    row = -(a * foot[0] + c) / b
    return height(foot[1], top[1], row, door_foot[1], door_top[1], door_height)


@ANY_HEIGHT.wrong("You multiply by (l · b) |v × t|. It stands below the line.")
def multiplied(foot, top, door_foot, door_top, door_height, horizon, vertical):
    rule = lambda b, t: _cross(b, t) * (horizon @ b) * _cross(vertical, t)  # noqa: E731
    return _measured(door_height, (foot, top), (door_foot, door_top), rule)


def _cross(one, other):
    return np.linalg.norm(np.cross(one, other))


def _measured(door_height, thing, door, rule):
    one, two = (rule(*(np.array([*point, 1]) for point in ends)) for ends in (thing, door))
    return door_height * one / two


# 5: the principal point -----------------------------------------------------------------------------------------------


def principal_point(q1: Array, q2: Array, q3: Array) -> Array:
    """The orthocentre (2,) of the triangle of vanishing points: q1 − c stands on q2 − q3, and q2 − c on q3 − q1."""
    sides = np.array([q2 - q3, q3 - q1])
    return np.linalg.solve(sides, [(q2 - q3) @ q1, (q3 - q1) @ q2])


def _triangles(rng: np.random.Generator) -> Iterator[Arguments]:
    for number in range(5):
        K, R, _ = _camera(rng)
        K[:2, 2] -= 9000 if number == 3 else 0  # cropped
        pitch = np.radians(rng.uniform(15, 35) * rng.choice([-1, 1]))
        tilt = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
        roll = np.radians(rng.uniform(5, 25))
        turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
        x = K @ turn @ tilt @ R
        q1, q2, q3 = (x[:2] / x[2]).T
        yield q1, q2, q3
    yield q1, q3, q2  # so that b - c has both signs


PRINCIPAL_POINT = Exercise(
    name="18.principal_point",
    reference=principal_point,
    cases=_triangles,
    tolerance=1e-7,
    hints=(
        "The line from one corner through c stands at a right angle on the side opposite. Two such lines fix c.",
        "(q1 − c) · (q2 − q3) = 0 says (q2 − q3) · c = (q2 − q3) · q1. A second corner gives a second row. Solve both.",
        "`return np.linalg.solve(sides, [(q2 - q3) @ q1, ___])`, where `sides` has the rows q2 − q3 and q3 − q1",
    ),
    praise="It is the orthocentre: there the three altitudes of the triangle meet.",
)


@PRINCIPAL_POINT.right
def by_crossing_two_altitudes(q1, q2, q3):
    def upright(corner, one, other):
        along = one - other
        return np.array([along[0], along[1], -(along @ corner)])

    x, y, w = np.cross(upright(q1, q2, q3), upright(q2, q3, q1))
    return np.array([x / w, y / w])


@PRINCIPAL_POINT.right
def by_least_squares_of_three(q1, q2, q3):
    sides = np.array([q2 - q3, q3 - q1, q1 - q2])
    return np.linalg.lstsq(sides, np.sum(sides * [q1, q2, q3], axis=1), rcond=None)[0].tolist()


@PRINCIPAL_POINT.right
def by_the_circumcentre(q1, q2, q3):
    A = 2 * np.array([q2 - q1, q3 - q1])
    middle = np.linalg.solve(A, [q2 @ q2 - q1 @ q1, q3 @ q3 - q1 @ q1])
    return q1 + q2 + q3 - 2 * middle


@PRINCIPAL_POINT.wrong("This is the mean of the three corners. The principal point is where the *altitudes* meet.")
def centroid(q1, q2, q3):
    return (q1 + q2 + q3) / 3


@PRINCIPAL_POINT.wrong(
    "This is the middle of the circle through the corners. The principal point is where the altitudes meet."
)
def circumcentre(q1, q2, q3):
    A = 2 * np.array([q2 - q1, q3 - q1])
    return np.linalg.solve(A, [q2 @ q2 - q1 @ q1, q3 @ q3 - q1 @ q1])


@PRINCIPAL_POINT.wrong(
    "This is the middle of the circle inside the triangle, where the angles' halves meet. Take the altitudes."
)
def incentre(q1, q2, q3):
    sides = np.array([np.linalg.norm(q2 - q3), np.linalg.norm(q3 - q1), np.linalg.norm(q1 - q2)])
    return sides @ np.array([q1, q2, q3]) / sides.sum()


@PRINCIPAL_POINT.wrong("Your second row belongs to the wrong corner: q3 − q1 is opposite q2.")
def wrong_corner(q1, q2, q3):
    return np.linalg.solve(np.array([q2 - q3, q3 - q1]), [(q2 - q3) @ q1, (q3 - q1) @ q3])


@PRINCIPAL_POINT.wrong("You use the side that begins at the corner. The altitude stands on the side *opposite*.")
def adjacent_side(q1, q2, q3):
    return np.linalg.solve(np.array([q1 - q2, q2 - q3]), [(q1 - q2) @ q1, (q2 - q3) @ q2])


@PRINCIPAL_POINT.wrong("Below the right sides stands one corner twice. Each altitude has a corner of its own.")
def one_corner_twice(q1, q2, q3):
    return np.linalg.solve(np.array([q2 - q3, q3 - q1]), [(q2 - q3) @ q1, (q3 - q1) @ q1])


@PRINCIPAL_POINT.wrong("This is the foot of one altitude, on the side opposite q1. The altitudes meet farther on.")
def foot_of_an_altitude(q1, q2, q3):
    along = q3 - q2
    return q2 + along * ((q1 - q2) @ along) / (along @ along)


@PRINCIPAL_POINT.wrong("This is the middle of one side. The principal point lies on the altitudes of the triangle.")
def middle_of_a_side(q1, q2, q3):
    return (q1 + q2) / 2


# 6: the camera from points --------------------------------------------------------------------------------------------


def camera_matrix(points: Array, pixels: Array) -> Array:
    """P (3, 4) up to scale, the last right singular vector of two rows for each point: the DLT."""
    rows = []
    for place, (u, v) in zip(points, pixels, strict=True):
        X = np.array([*place, 1])
        rows += [[*X, *np.zeros(4), *(-u * X)], [*np.zeros(4), *X, *(-v * X)]]
    return np.linalg.svd(rows)[2][-1].reshape(3, 4)


def _six_points(rng: np.random.Generator) -> Iterator[Arguments]:
    return _cameras(rng, 6, 6, 9, 20)


def _cameras(rng: np.random.Generator, *numbers: int) -> Iterator[Arguments]:
    for n in numbers:
        K, R, _ = _camera(rng)
        K[:2, 2] -= 1500 if n == 9 else 0  # cropped
        K[0, 1], K[1, 1] = rng.uniform(-20, 20), K[1, 1] * rng.uniform(0.8, 1.2)
        points = rng.uniform(-2, 2, (n, 3))
        x = (points - R.T @ [0.3, -0.4, -6.0] * rng.uniform(0.8, 1.2)) @ (K @ R).T
        yield points, x[:, :2] / x[:, 2:]


def _all_points_count(function: Function, rng: np.random.Generator) -> str:
    """With noise every point counts, and the error is that of all points."""
    true = [next(_cameras(rng, 20)) for _ in range(8)]
    noisy = [(points, pixels + rng.normal(0, 0.5, pixels.shape)) for points, pixels in true]
    unused = unused_row(function, noisy[0], _up_to_scale)
    if unused is not None:
        return f"Your P does not change when pixel {unused} of 20 moves. With noise every point is needed."
    ratio = error_ratio(function, camera_matrix, noisy, lambda P, number: _pixel_error(P, *true[number]))
    return (
        "" if ratio < 2 else f"Your P is right for exact pixels. With noise its error is {ratio:.1f} times that of all."
    )


def _pixel_error(P: Array, points: Array, pixels: Array) -> float:
    x = np.column_stack([points, np.ones(len(points))]) @ P.T
    return float(np.sqrt(np.mean((x[:, :2] / x[:, 2:] - pixels) ** 2)))


def _up_to_scale(P: Array) -> Array:
    """Of unit norm, the entry of greatest size positive: P and −2 P are one camera."""
    if P.shape != (3, 4):
        return P
    return P / np.linalg.norm(P) * np.sign(P.ravel()[np.argmax(np.abs(P))])


CAMERA_MATRIX = Exercise(
    name="18.camera_matrix",
    reference=camera_matrix,
    cases=_six_points,
    any_numbers=False,
    tolerance=1e-6,
    canonical=_up_to_scale,
    laws=(_all_points_count,),
    hints=(
        "Each point gives two rows of twelve numbers. The twelve numbers of P make all rows 0.",
        "Stack the rows (X, 0, −uX) and (0, X, −vX), X with its 1. `np.linalg.svd(A)[2][-1]` is the unit vector that "
        "they send nearest to 0.",
        "`rows += [[*X, *np.zeros(4), *(-u * X)], ___]`",
    ),
    praise="Eleven numbers of a camera from six points; its scale is free.",
)


@CAMERA_MATRIX.right
def by_the_smallest_eigenvalue(points, pixels):
    X = np.column_stack([points, np.ones(len(points))])
    X = X / np.linalg.norm(X)
    centre, size = pixels.mean(axis=0), pixels.std()
    (u, v) = ((pixels - centre) / size).T
    nothing = np.zeros_like(X)
    A = np.block([[X, nothing, -u[:, None] * X], [nothing, X, -v[:, None] * X]])
    P = np.linalg.svd(A)[2][-1].reshape(3, 4)
    return np.array([[size, 0, centre[0]], [0, size, centre[1]], [0, 0, 1]]) @ P


@CAMERA_MATRIX.right
def rows_of_ones_less(points, pixels):
    A = []
    for (x, y, z), (u, v) in zip(points.tolist(), pixels.tolist(), strict=True):
        A.append([x, y, z, 1, 0, 0, 0, 0, -u * x, -u * y, -u * z, -u])
        A.append([0, 0, 0, 0, x, y, z, 1, -v * x, -v * y, -v * z, -v])
    found = np.linalg.lstsq(np.array(A)[:, :11], -np.array(A)[:, 11], rcond=None)[0]
    return np.append(found, 1).reshape(3, 4)


def _solved(rows, which=-1):
    return np.linalg.svd(np.array(rows, dtype=float))[2][which].reshape(3, 4)


def _stacked(points, pixels, first, second):
    return [row(np.array([*X, 1]), u, v) for X, (u, v) in zip(points, pixels, strict=True) for row in (first, second)]


_O = np.zeros(4)


@CAMERA_MATRIX.wrong("The last number of each point is missing a sign: the rows are (X, 0, −uX) and (0, X, −vX).")
def plus_u(points, pixels):
    return _solved(_stacked(points, pixels, lambda X, u, v: [*X, *_O, *(u * X)], lambda X, u, v: [*_O, *X, *(v * X)]))


@CAMERA_MATRIX.wrong(
    "You swapped u and v: u belongs to the row that begins with X, v to the one that begins with zeros."
)
def swapped(points, pixels):
    return camera_matrix(points, pixels[:, ::-1])


@CAMERA_MATRIX.wrong("This is the singular vector of the *greatest* value. The rows send the last one to 0.")
def greatest(points, pixels):
    rows = _stacked(points, pixels, lambda X, u, v: [*X, *_O, *(-u * X)], lambda X, u, v: [*_O, *X, *(-v * X)])
    return _solved(rows, 0)


@CAMERA_MATRIX.wrong("You filled P column by column. Its first four numbers are its first *row*.")
def by_columns(points, pixels):
    return camera_matrix(points, pixels).reshape(4, 3).T


@CAMERA_MATRIX.wrong("`np.linalg.svd` gives V already transposed: its last *row* is wanted, not its last column.")
def last_column(points, pixels):
    rows = _stacked(points, pixels, lambda X, u, v: [*X, *_O, *(-u * X)], lambda X, u, v: [*_O, *X, *(-v * X)])
    return np.linalg.svd(np.array(rows))[2][:, -1].reshape(3, 4)


@CAMERA_MATRIX.wrong("Your second rows repeat the first ones. They begin with zeros, and have v.")
def first_rows_twice(points, pixels):
    return _solved(_stacked(points, pixels, lambda X, u, v: [*X, *_O, *(-u * X)], lambda X, u, v: [*X, *_O, *(-v * X)]))


@CAMERA_MATRIX.wrong("Your points have 0 for their fourth number, so that the camera's place drops out. It is 1.")
def fourth_number_zero(points, pixels):
    rows = []
    for place, (u, v) in zip(points, pixels, strict=True):
        X, Y = np.array([*place, 0]), np.array([*place, 1])
        rows += [[*X, *_O, *(-u * Y)], [*_O, *X, *(-v * Y)]]
    return _solved(rows)


@CAMERA_MATRIX.wrong("You use the first five points only. Ten equations do not fix eleven numbers.")
def five_points(points, pixels):
    return camera_matrix(points[:5], pixels[:5])


EXERCISES = (MEET, FOCAL_LENGTH, HEIGHT, ANY_HEIGHT, PRINCIPAL_POINT, CAMERA_MATRIX)
