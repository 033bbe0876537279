"""Lesson 08, rectification, disparity and depth: Z = f B / (d + doffs), its price, and what goes wrong on the way.

d = u_left − u_right. After Hartley & Zisserman (2004), section 11.12, and Szeliski (2022), chapter 12.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.poses import Rotation
from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

# 1: depth ------------------------------------------------------------------------------------------------------------


def depth(d: Array, f: float, B: float, doffs: float) -> Array:
    """Z = f B / (d + doffs) in metres; inf where d + doffs is 0, NaN where it is below."""
    shift = d + doffs
    Z = np.divide(f * B, shift, out=np.full(np.shape(shift), np.inf), where=shift != 0)
    return np.where(shift < 0, np.nan, Z)


def _depth_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """In each larger case one point is infinitely far, one behind the cameras, and one has d of the sign of −doffs."""
    sign = rng.choice([-1, 1])
    for shape in SHAPES:
        sign = -sign
        doffs = float(sign * rng.uniform(5, 40))
        d = rng.uniform(0, 100, shape) + max(0, 1 - doffs)
        if d.size > 1:
            d.flat[:3] = -doffs, -doffs - rng.uniform(1, 4), -doffs + rng.uniform(1, 4)
            d.flat[3:5] = -doffs - rng.uniform(1e-3, 0.1), -doffs + rng.uniform(1e-3, 0.1)
        yield d, float(rng.uniform(300, 900)), float(rng.uniform(0.05, 0.5)), doffs


DEPTH = Exercise(
    name="08.depth",
    reference=depth,
    cases=_depth_cases,
    hints=(
        "Section 2 has the formula for principal points that differ. Which disparity has a point at infinity there, "
        "and which disparities has no point in front of the cameras?",
        "Two cases need care. Where d + doffs is 0 the answer is infinity, and where it is below 0 the answer is NaN. "
        "`np.where(condition, a, b)` chooses point by point, and `with np.errstate(divide='ignore'):` lets NumPy write "
        "inf for 1/0 without a warning.",
        "`return np.where(___ < 0, np.nan, Z)`",
    ),
    praise="With doffs = 0 it is the formula of every book; with it, it holds for the published pairs too.",
)


def _divided(d, f, B, doffs):
    return f * B / (d + doffs)


@DEPTH.right
def divided_and_then_looked_at(d, f, B, doffs):
    with np.errstate(divide="ignore"):
        Z = f * B / (np.asarray(d) + doffs)
    return np.where(d + doffs < 0, np.nan, Z)


@DEPTH.right
def point_by_point(d, f, B, doffs):
    def one(shift):
        return np.nan if shift < 0 else np.inf if shift == 0 else B * f / shift

    return np.reshape([one(shift) for shift in np.ravel(d + doffs)], np.shape(d))


@DEPTH.wrong("doffs is left out. A point at infinity has d = −doffs here, not 0.")
def doffs_left_out(d, f, B, doffs):
    return depth(d, f, B, 0.0)


@DEPTH.wrong("f B / d holds only where the principal points agree. Add doffs, then look at sums of 0 and below.")
def the_formula_of_every_book(d, f, B, doffs):
    return _divided(d, f, B, 0.0)


@DEPTH.wrong("You subtract doffs. A point at infinity has d = −doffs: the *sum* d + doffs is 0.")
def doffs_subtracted(d, f, B, doffs):
    return depth(d, f, B, -doffs)


@DEPTH.wrong("The formula is right. Where the sum is below 0 the answer is NaN, not a *negative* depth.")
def negative_depths(d, f, B, doffs):
    return _divided(d, f, B, doffs)


@DEPTH.wrong("Where d + doffs is exactly 0 the point is infinitely far: the answer is inf.")
def nan_at_infinity(d, f, B, doffs):
    return np.where(d + doffs <= 0, np.nan, _divided(d, f, B, doffs))


# 2: which baseline? --------------------------------------------------------------------------------------------------


def baseline_for(Z: Array, error: Array, f: float, disparity_error: float) -> Array:
    """B = Z² Δd / (f ΔZ)."""
    return Z**2 * disparity_error / (f * error)


def _baseline_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        Z = rng.uniform(2, 50, shape)
        yield Z, Z * rng.uniform(0.005, 0.1, shape), float(rng.uniform(300, 2000)), float(rng.uniform(0.1, 0.8))


BASELINE = Exercise(
    name="08.baseline_for",
    reference=baseline_for,
    cases=_baseline_cases,
    shown=((50.0, 0.1, 1500.0, 0.25),),
    hints=(
        "Section 3 has an equation for the error ΔZ that an error Δd of the disparity makes. Which of its letters are "
        "given here, and which one is wanted?",
        "ΔZ ≈ Z² Δd / (f B): `error` is ΔZ and `disparity_error` is Δd. Multiply by B and divide by ΔZ. It works on "
        "arrays as it stands.",
        "`return Z**2 * ___ / (f * ___)`",
    ),
    praise="Twice as far at the same error asks for four times the baseline (or the focal length, in pixels).",
)


@BASELINE.right
def by_relative_errors(Z, error, f, disparity_error):
    """ΔZ/Z = Δd/d, and B = Z d / f."""
    d = disparity_error * Z / error
    return Z * d / f


@BASELINE.right
def one_by_one(Z, error, f, disparity_error):
    pairs = zip(np.ravel(Z), np.ravel(error), strict=True)
    return np.reshape([z * z / e * disparity_error / f for z, e in pairs], np.shape(Z))


@BASELINE.wrong("The error in metres grows with the *square* of the depth: Z², not Z.")
def depth_not_squared(Z, error, f, disparity_error):
    return Z * disparity_error / (f * error)


@BASELINE.wrong("The two errors have changed places: a worse matcher needs a longer baseline.")
def errors_swapped(Z, error, f, disparity_error):
    return Z**2 * error / (f * disparity_error)


@BASELINE.wrong("You solved for the exact *far* end of the interval. The first order is asked, the slope of Z at d.")
def exact_far_end(Z, error, f, disparity_error):
    return Z * disparity_error * (Z / error + 1) / f


@BASELINE.wrong("You put the *error* of the disparity into Z = f B / d. Use ΔZ ≈ Z² Δd / (f B).")
def disparity_confused_with_its_error(Z, error, f, disparity_error):
    return Z * disparity_error / f


# 3: a pixel, rectified -----------------------------------------------------------------------------------------------


def rectified(uv: Array, K: Array, R: Array, K_new: Array) -> Array:
    """Pixels K_new R K⁻¹ x (..., 2) of pixels (..., 2); NaN for a ray that the turned camera does not see."""
    x = _homogeneous(uv) @ (K_new @ R @ np.linalg.inv(K)).T
    return np.where(x[..., 2:] > 0, x[..., :2] / x[..., 2:], np.nan)


def _homogeneous(uv: Array) -> Array:
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)


def _K(rng: np.random.Generator) -> Array:
    f = rng.uniform(300, 900)
    return np.array([[f, 0, rng.uniform(250, 390)], [0, f, rng.uniform(180, 300)], [0, 0, 1]])


def _rectified_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """The last case turns some rays out of sight."""
    for shape in SHAPES:
        R = Rotation.from_rotvec(rng.uniform(0.05, 0.25, 3) * rng.choice([-1, 1], 3)).as_matrix()
        yield rng.uniform(0, 480, (*shape, 2)), _K(rng), R, _K(rng)
    R = Rotation.from_rotvec([0, rng.choice([-1, 1]) * rng.uniform(1.42, 1.5), 0]).as_matrix()
    yield rng.uniform(0, 640, (40, 2)), _K(rng), R, _K(rng)
    shift = np.array([[1, 1, -1], [1, 1, -1], [1, 1, 1]])  # principal points beyond the upper left corner
    R = Rotation.from_rotvec(rng.uniform(0.05, 0.25, 3) * rng.choice([-1, 1], 3)).as_matrix()
    yield rng.uniform(-480, 0, (4, 2)), _K(rng) * shift, R, _K(rng) * shift
    beside = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # looks along what was x: the ray of cx is exactly beside
    K = np.array([[512.0, 0, 320], [0, 512, 240], [0, 0, 1]])
    yield np.array([320.0, 240]) + [[-64, 8], [0, 32], [0, -16], [64, 8]], K, beside, K


RECTIFIED = Exercise(
    name="08.rectified_pixels",
    reference=rectified,
    cases=_rectified_cases,
    tolerance=1e-8,
    hints=(
        "Three steps: a pixel becomes a ray, the ray is turned, and the turned ray becomes a pixel of the new camera. "
        "Which matrix does each of them? Section 1 has them in one line.",
        "Append a 1 to each pixel. Pixels stand in rows, and there a matrix M acts as `x @ M.T`. `np.linalg.inv` "
        "inverts K. Divide by the third number in the end; where it is not positive the answer is NaN.",
        "`x = x @ (___ @ R @ ___).T`",
    ),
    praise="No depth anywhere in it: that is why rectification needs to know nothing about the scene.",
)


def _turned(uv, H):
    """The pixels H x without a look at what lies behind."""
    x = _homogeneous(uv) @ H.T
    return x[..., :2] / x[..., 2:]


@RECTIFIED.right
def as_opencv_s_perspective_transform(uv, K, R, K_new):
    import cv2

    H = K_new @ R @ np.linalg.inv(K)
    ahead = (_homogeneous(uv) @ H.T)[..., 2:] > 0
    return np.where(ahead, cv2.perspectiveTransform(uv.reshape(-1, 1, 2), H).reshape(uv.shape), np.nan)


@RECTIFIED.right
def one_pixel_at_a_time(uv, K, R, K_new):
    def one(pixel):
        x, y, w = K_new @ R @ np.linalg.solve(K, np.append(pixel, 1))
        return [x / w, y / w] if w > 0 else [np.nan, np.nan]

    return np.reshape([one(pixel) for pixel in uv.reshape(-1, 2)], uv.shape)


@RECTIFIED.wrong("A ray turned behind the camera has no pixel: NaN where the third number is not positive.")
def behind_kept(uv, K, R, K_new):
    return _turned(uv, K_new @ R @ np.linalg.inv(K))


@RECTIFIED.wrong("R is transposed: it takes old rays to new ones. For rows, R r is `r @ R.T`.")
def turned_back(uv, K, R, K_new):
    return rectified(uv, K, R.T, K_new)


@RECTIFIED.wrong("You used K at both ends. The rectified picture has a camera matrix of its own, K_new.")
def old_matrix_at_both_ends(uv, K, R, K_new):
    return rectified(uv, K, R, K)


@RECTIFIED.wrong("You did not divide by the third number. After a turn it is no longer 1.")
def not_divided(uv, K, R, K_new):
    return (_homogeneous(uv) @ (K_new @ R @ np.linalg.inv(K)).T)[..., :2]


@RECTIFIED.wrong("The product is right, but pixels stand in rows: with H = K_new R K⁻¹ write `x @ H.T`.")
def product_not_transposed(uv, K, R, K_new):
    return _turned(uv, (K_new @ R @ np.linalg.inv(K)).T)


# 4: find the bugs ----------------------------------------------------------------------------------------------------


def metric_depth(found: Array, K: Array, P_left: Array, P_right: Array) -> Array:
    """Z of the sixteenths of a pixel that cv2.StereoSGBM found; NaN where it found none."""
    return _metric(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 16)


def metric_depth_as_given(found, K, P_left, P_right):
    f = K[0, 0]
    B = -P_right[0, 3] / P_right[0, 0]
    return np.where(found < 0, np.nan, f * B / found)


def _metric(found, f, doffs, P_right, parts):
    B = -P_right[0, 3] / P_right[0, 0]
    return np.where(found < 0, np.nan, f * B / (found / parts + doffs))


def _metric_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """As from cv2.stereoRectify with its principal points free, and StereoSGBM: −16 says that there is no match."""
    for _ in range(3):
        K, f, B = _K(rng), rng.uniform(300, 900), rng.uniform(0.05, 0.5)
        K[0, 0] = K[1, 1] = f * rng.uniform(1.05, 1.3)  # rectification takes the smaller f
        P_left = np.array([[f, 0, rng.uniform(250, 390), 0], [0, f, 240, 0], [0, 0, 1, 0]])
        doffs = rng.uniform(5, 40)
        P_right = P_left + [[0, 0, doffs, -f * B], [0, 0, 0, 0], [0, 0, 0, 0]]
        found = rng.integers(17, 1500, (6, 8)).astype(np.int16)
        found[rng.random((6, 8)) < 0.2] = -16
        found[0, :3] = -16, 320, 331
        found[1, :5] = -16, -1, 0, 1, 2  # 0 is a disparity like others
        yield found, K, P_left, P_right
    doffs = -rng.uniform(5, 10)  # a left picture cut out far to the right, and everything near
    P_left = P_left - [[0, 0, 500, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    yield np.where(found < 0, found, found + 300), K, P_left, P_left + [[0, 0, doffs, -f * B], [0] * 4, [0] * 4]


METRIC_DEPTH = Exercise(
    name="08.metric_depth",
    reference=metric_depth,
    cases=_metric_cases,
    tolerance=1e-5,  # of 1 + Z: float32, which OpenCV's own reprojection returns, is good enough
    as_given=metric_depth_as_given,
    hints=(
        "Ask three things of the last line and of what it uses. In what unit are OpenCV's disparities? Which camera "
        "took the *rectified* picture? And do the two principal points agree?",
        "StereoSGBM counts in sixteenths of a pixel. K belongs to the picture before it was rectified; the rectified "
        "cameras' numbers stand in the first rows of P_left and P_right: f, 0, cx and, on the right, −f B.",
        "`return np.where(found < 0, np.nan, f * B / (found / ___ + ___))`",
    ),
    praise="Three mistakes, each of them in code that people ship. The first makes everything far too near.",
)


@METRIC_DEPTH.right
def as_opencv_reprojects_it(found, K, P_left, P_right):
    import cv2

    f, doffs = P_left[0, 0], P_right[0, 2] - P_left[0, 2]
    B = -P_right[0, 3] / f
    Q = np.array([[1, 0, 0, -P_left[0, 2]], [0, 1, 0, -P_left[1, 2]], [0, 0, 0, f], [0, 0, 1 / B, doffs / B]])
    Z = cv2.reprojectImageTo3D(np.float32(found / 16), Q)[..., 2]
    return np.where(found < 0, np.nan, Z)


@METRIC_DEPTH.right
def in_sixteenths_throughout(found, K, P_left, P_right):
    fB = -P_right[0, 3]
    Z = 16 * fB / (found + 16 * (P_right[0, 2] - P_left[0, 2]))
    Z[found < 0] = np.nan
    return Z


@METRIC_DEPTH.wrong("The sixteenths are right now. The rectified cameras are not those that were calibrated.")
def only_the_sixteenths_mended(found, K, P_left, P_right):
    return _metric(found, K[0, 0], 0, P_right, 16)


@METRIC_DEPTH.wrong("The focal length is right now. Look at the unit of `found` next, and at a point at infinity.")
def only_the_focal_length_mended(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], 0, P_right, 1)


@METRIC_DEPTH.wrong("The principal points are right now. Look at the unit of `found` next, and at where f comes from.")
def only_doffs_mended(found, K, P_left, P_right):
    return _metric(found, K[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1)


@METRIC_DEPTH.wrong("One left: the principal points differ, so a point at infinity has disparity −doffs.")
def doffs_still_missing(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], 0, P_right, 16)


@METRIC_DEPTH.wrong("One left: K is the camera matrix of the picture *before* rectification, and so is its f.")
def focal_length_still_the_old_one(found, K, P_left, P_right):
    return _metric(found, K[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 16)


@METRIC_DEPTH.wrong("One left: OpenCV's matchers count in sixteenths of a pixel.")
def sixteenths_still_taken_for_pixels(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1)


@METRIC_DEPTH.wrong("You divide the sum by 16, and doffs with it. doffs is in pixels already.")
def doffs_divided_too(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], (P_right[0, 2] - P_left[0, 2]) / 16, P_right, 16)


# 5: the left–right check ---------------------------------------------------------------------------------------------


def left_right(d_left: Array, d_right: Array, tolerance: float) -> Array:
    """The left disparities of a row (n,), NaN where the partner's leads back farther than `tolerance` away."""
    u = np.arange(len(d_left)) - d_left
    partner = np.rint(np.where(np.isfinite(u), u, -1)).astype(int)
    inside = (partner >= 0) & (partner < len(d_left))
    back = d_right[np.where(inside, partner, 0)]
    return np.where(inside & (np.abs(back - d_left) <= tolerance), d_left, np.nan)


def _left_right_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield _near_thing_before_a_wall(rng, 40, 1.0)
    left, right, tolerance = _near_thing_before_a_wall(rng, 60, 0.5)
    right[-6:] += 20  # where the right picture reaches farther, it shows another thing
    yield left, right, tolerance
    yield _each_column_by_itself(rng, 50)
    yield from _whole_disparities_of_either_sign(rng)
    yield _partners_that_rounding_decides(rng, 120)


def _partners_that_rounding_decides(rng: np.random.Generator, n: int) -> Arguments:
    """Partners within half a column of the first and of the last one, on either side of it."""
    left, right = rng.uniform(-0.45, 0.45, (2, n))
    left[[0, 1, -2, -1]] = rng.uniform(0.1, 0.4), 1 + rng.uniform(0.6, 0.9), -1 - rng.uniform(0.6, 0.9), -0.3
    right[[0, -1]] = left[[0, -1]]
    right[4:8] = left[4:8] + [2.99, -2.99, 3.01, -3.01]  # near the tolerance, on either side
    return left, right, 3.0


def _whole_disparities_of_either_sign(rng: np.random.Generator) -> Iterator[Arguments]:
    """Partners in the first and in the last column and one beyond either, and differences of just the tolerance."""
    for tolerance in (1.0, 0.0):
        left, right = rng.integers(-4, 5, (2, 16)).astype(float)
        left[[0, 1, 2, -3, -2, -1]] = 0, 2, -1, 1, -2, 0
        right[0], right[3], right[12], right[-1] = tolerance, -1 + tolerance, 1, -tolerance
        left[[7, 8]], right[9] = (-2, 3), -2
        yield left, right, tolerance


def _near_thing_before_a_wall(rng: np.random.Generator, n: int, tolerance: float) -> Arguments:
    """As each picture shows it, with mistakes and gaps strewn in, none of them in the first columns."""
    near, far = rng.integers(9, 14), rng.integers(3, 6)
    start = rng.integers(15, n - 22)
    left, right = np.full(n, float(far)), np.full(n, float(far))
    left[start : start + 9], right[start - near : start - near + 9] = near, near
    left += tolerance * rng.uniform(-0.3, 0.3, n)
    right += tolerance * rng.uniform(-0.3, 0.3, n)
    mistaken = rng.choice(np.arange(8, n - 8), 7, replace=False)
    left[mistaken[:4]] += rng.uniform(3, 8, 4)
    left[mistaken[4:]] = np.nan
    right[rng.choice(np.arange(8, n - 8), 3, replace=False)] = np.nan
    return left, right, tolerance


def _each_column_by_itself(rng: np.random.Generator, n: int) -> Arguments:
    """A disparity in each column that has nothing to do with its neighbours': about half of them lead back."""
    left, right = rng.uniform(1, 12, n), rng.uniform(14, 25, n)
    for u in range(12, n):
        right[np.rint(u - left[u]).astype(int)] = left[u] + rng.uniform(-1.2, 1.2)
    return left, right, 0.7


LEFT_RIGHT = Exercise(
    name="08.left_right",
    reference=left_right,
    cases=_left_right_cases,
    hints=(
        "In which column of the right row is the partner of column u of the left row? That column has a disparity of "
        "its own. What must it be, if both are right?",
        "`np.arange(n)` are the columns, and `np.rint` rounds to the nearest one. A partner is inside where it is at "
        "least 0 and less than n. Indices must be whole numbers: take column 0 for partners outside, since their "
        "answer is NaN anyway.",
        "`return np.where(inside & (np.abs(___) <= tolerance), ___, np.nan)`",
    ),
    praise="The strip beside every near thing, which only one camera sees, is gone, and most mistakes with it.",
)


def _agreeing(d_left, back, inside, tolerance):
    return np.where(inside & (np.abs(back - d_left) <= tolerance), d_left, np.nan)


def _led_back(d_left, d_right, partner):
    """What the right row says at the partner, and whether there is one."""
    inside = (partner >= 0) & (partner < len(d_right))
    return d_right[np.where(inside, partner, 0).astype(int)], inside


@LEFT_RIGHT.right
def column_by_column(d_left, d_right, tolerance):
    kept = np.full(len(d_left), np.nan)
    for u, d in enumerate(d_left):
        if np.isfinite(d) and 0 <= round(u - d) < len(d_right) and abs(d_right[round(u - d)] - d) <= tolerance:
            kept[u] = d
    return kept


@LEFT_RIGHT.right
def by_looking_up_the_nearest_column(d_left, d_right, tolerance):
    from scipy.interpolate import interp1d

    columns = np.arange(len(d_right), dtype=float)
    there = interp1d(columns, d_right, kind="nearest", bounds_error=False, fill_value=np.nan)
    partner = np.rint(columns - d_left)
    return np.where(np.abs(there(partner) - d_left) <= tolerance, d_left, np.nan)


@LEFT_RIGHT.wrong("You compare at the *same* column. The right picture shows the thing at u − d.")
def same_column(d_left, d_right, tolerance):
    return np.where(np.abs(d_right - d_left) <= tolerance, d_left, np.nan)


@LEFT_RIGHT.wrong("The partner is at u − d, not at u + d: things lie farther left in the right picture.")
def other_way(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) + d_left))
    return _agreeing(d_left, back, inside, tolerance)


@LEFT_RIGHT.wrong("An index below 0 counts from the end in NumPy. Such a partner is outside: NaN.")
def counted_from_the_end(d_left, d_right, tolerance):
    partner = np.rint(np.nan_to_num(np.arange(len(d_left)) - d_left)).astype(int) % len(d_left)
    return _agreeing(d_left, d_right[partner], True, tolerance)


@LEFT_RIGHT.wrong("You cut off the fraction of u − d. `np.rint` gives the nearest column.")
def fraction_cut_off(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.floor(np.arange(len(d_left)) - d_left))
    return _agreeing(d_left, back, inside, tolerance)


@LEFT_RIGHT.wrong("A negative difference is always below the tolerance. Compare its *absolute value*.")
def one_sided(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) - d_left))
    return np.where(inside & (back - d_left <= tolerance), d_left, np.nan)


@LEFT_RIGHT.wrong("A difference of *exactly* the tolerance is kept, too: it is to differ by at most that, `<=`.")
def less_than_the_tolerance(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) - d_left))
    return np.where(inside & (np.abs(back - d_left) < tolerance), d_left, np.nan)


# 6: between two pixels -----------------------------------------------------------------------------------------------


def between_pixels(c_before: Array, c_best: Array, c_after: Array) -> Array:
    """δ (...), −½ … ½, where the parabola through three costs is least; NaN where c_best is not least, or all agree."""
    curved = c_before - 2 * c_best + c_after
    least = (c_best <= c_before) & (c_best <= c_after) & (curved > 0)
    return np.where(least, (c_before - c_after) / (2 * np.where(least, curved, 1)), np.nan)


def _between_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """In each larger case one minimum is halfway on either side, one cost is no minimum, and three agree."""
    for shape in SHAPES:
        best = rng.uniform(-80, 80, shape)  # a cost may be a correlation with its sign turned
        best.flat[2:4] = -rng.uniform(10, 80, len(best.flat[2:4]))
        before, after = best + rng.uniform(1, 60, shape), best + rng.uniform(1, 60, shape)
        if best.size > 5:
            before.flat[0] = best.flat[0]
            after.flat[1] = best.flat[1]
            before.flat[2] = best.flat[2] - rng.uniform(0.1, 5)
            after.flat[3] = best.flat[3] - rng.uniform(0.1, 5)
            before.flat[4] = after.flat[4] = best.flat[4]
            before.flat[5] = after.flat[5] = best.flat[5] - rng.uniform(1, 5)
        if best.size > 7:
            best.flat[6:8] = rng.uniform(30, 80, 2)
            before.flat[6], after.flat[7] = 0.995 * best.flat[6:8]  # a little lower than the best
        yield before, best, after


BETWEEN = Exercise(
    name="08.between_pixels",
    reference=between_pixels,
    cases=_between_cases,
    hints=(
        "Draw the three costs side by side, and the parabola `a * x**2 + b * x + c` through them, with x = 0 in the "
        "middle. There c is the cost. What are a and b?",
        "The sum and the difference of the two outer costs give `2 * a` and `2 * b`. The parabola is least at "
        "`-b / (2 * a)`. If all three are the same, a is 0.",
        "`return np.where(least, (c_before - c_after) / (2 * ___), np.nan)`",
    ),
    praise="Three costs, and the disparity is known to a fraction of a pixel.",
)


def _dressed(delta, c_before, c_best, c_after):
    """An answer, with NaN where it is wanted."""
    return np.where(np.isfinite(between_pixels(c_before, c_best, c_after)), delta, np.nan)


def _over(above, below):
    with np.errstate(divide="ignore", invalid="ignore"):
        return above / below


@BETWEEN.right
def by_polyfit(c_before, c_best, c_after):
    def one(before, best, after):
        if best > min(before, after) or before == best == after:
            return np.nan
        a, b, _ = np.polyfit([-1, 0, 1], [before, best, after], 2)
        return -b / (2 * a)

    three = (np.ravel(c) for c in (c_before, c_best, c_after))
    return np.reshape([one(*costs) for costs in zip(*three, strict=True)], np.shape(c_best))


@BETWEEN.right
def where_two_slopes_meet_zero(c_before, c_best, c_after):
    """The slope is c_best − c_before at −½ and c_after − c_best at ½, and a straight line in between."""
    left, right = c_best - c_before, c_after - c_best
    return np.where((left <= 0) & (right >= 0), -0.5 - _over(left, right - left), np.nan)


@BETWEEN.wrong("The middle cost counts twice in `c_before - 2 * c_best + c_after`.")
def middle_counted_once(c_before, c_best, c_after):
    delta = _over(c_before - c_after, 2 * (c_before - c_best + c_after))
    return _dressed(delta, c_before, c_best, c_after)


@BETWEEN.wrong("Where c_best is not the least, the parabola's minimum is not near it: NaN is wanted.")
def followed_too_far(c_before, c_best, c_after):
    return _over(c_before - c_after, 2 * (c_before - 2 * c_best + c_after))


@BETWEEN.wrong("Where a neighbour's cost is as low as the best, the minimum is halfway: ±½, not NaN.")
def ties_dropped(c_before, c_best, c_after):
    return np.where((c_best < c_before) & (c_best < c_after), between_pixels(c_before, c_best, c_after), np.nan)


@BETWEEN.wrong("These are two straight lines, a V. The parabola through the three costs is asked for.")
def two_straight_lines(c_before, c_best, c_after):
    steep = 2 * (np.maximum(c_before, c_after) - c_best)
    return _dressed(_over(c_before - c_after, steep), c_before, c_best, c_after)


@BETWEEN.wrong("You clip δ to −½ … ½. An answer beyond it says that c_best is not the least: NaN.")
def clipped(c_before, c_best, c_after):
    return np.clip(followed_too_far(c_before, c_best, c_after), -0.5, 0.5)


EXERCISES = (RECTIFIED, DEPTH, BASELINE, LEFT_RIGHT, BETWEEN, METRIC_DEPTH)
