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


@DEPTH.right
def through_the_right_camera_s_shifted_column(d, f, B, doffs):
    """x_left − x_right = (u_left − cx_left − u_right + cx_right) / f is B / Z."""
    parallax = (d + doffs) / f
    with np.errstate(divide="ignore"):
        return np.where(parallax >= 0, B / np.abs(parallax), np.nan)


@DEPTH.wrong(
    "doffs is left out. Then a point at infinity would need d = 0, but here the principal points differ and it has "
    "d = −doffs."
)
def doffs_left_out(d, f, B, doffs):
    return depth(d, f, B, 0.0)


@DEPTH.wrong(
    "This is f B / d, which holds where the two principal points agree. Here they do not: doffs belongs in it. After "
    "that, ask what a sum of 0 and a sum below 0 mean."
)
def the_formula_of_every_book(d, f, B, doffs):
    return _divided(d, f, B, 0.0)


@DEPTH.wrong(
    "You subtract doffs. It is cx_right − cx_left, so a point at infinity has d = −doffs: only the *sum* d + doffs "
    "becomes 0 there."
)
def doffs_subtracted(d, f, B, doffs):
    return depth(d, f, B, -doffs)


@DEPTH.wrong(
    "doffs has the wrong sign: put in d = −doffs, a point at infinity, and your denominator is not 0. And a "
    "denominator below 0 makes a depth below 0, where NaN is wanted."
)
def doffs_subtracted_and_nothing_checked(d, f, B, doffs):
    return _divided(d, f, B, -doffs)


@DEPTH.wrong("The formula is right. A sum below 0 gives a *negative* depth, though: NaN is the honest answer there.")
def negative_depths(d, f, B, doffs):
    return _divided(d, f, B, doffs)


@DEPTH.wrong(
    "The absolute value hides what is behind the cameras: such a sum is below 0, and you make an ordinary depth of it. "
    "The answer there is NaN."
)
def mirrored_in_front(d, f, B, doffs):
    return np.abs(_divided(d, f, B, doffs))


@DEPTH.wrong("Where d + doffs is exactly 0 there is an answer: the rays are parallel, the point is infinitely far.")
def nan_at_infinity(d, f, B, doffs):
    return np.where(d + doffs <= 0, np.nan, _divided(d, f, B, doffs))


@DEPTH.wrong("You asked whether d is negative. What must not be negative is d + doffs.")
def sign_of_d_asked(d, f, B, doffs):
    return np.where(d < 0, np.nan, np.abs(_divided(d, f, B, doffs)))


@DEPTH.wrong("This is upside down: a *larger* disparity is a *nearer* point.")
def upside_down(d, f, B, doffs):
    return (d + doffs) * B / f


@DEPTH.wrong(
    "You add doffs to the depth. It is a number of pixels and belongs to d: put brackets around d + doffs, then divide."
)
def brackets_forgotten(d, f, B, doffs):
    return f * B / d + doffs


@DEPTH.wrong(
    "Where no point has such a disparity you answer 0, which is the camera's own place. A missing answer is NaN."
)
def zero_for_no_point(d, f, B, doffs):
    return np.nan_to_num(depth(d, f, B, doffs), nan=0.0, posinf=np.inf)


@DEPTH.wrong(
    "A small number in place of 0 makes infinity a very large depth, and a sum below 0 too. Ask for both cases instead."
)
def epsilon_for_zero(d, f, B, doffs):
    return f * B / np.maximum(d + doffs, 1e-6)


@DEPTH.wrong("B is missing: this is how many baselines away the point is. Times B it is in metres.")
def in_baselines(d, f, B, doffs):
    return depth(d, f, 1.0, doffs)


@DEPTH.wrong(
    "You divide by 16. OpenCV's matchers count in sixteenths of a pixel, but the disparities of this exercise are in "
    "pixels."
)
def sixteenths_that_are_none(d, f, B, doffs):
    return depth(d, f / 16, B, doffs)


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
def by_the_slope_of_z_over_d(Z, error, f, disparity_error):
    fB_over_d_squared = error / disparity_error
    return Z / f * (Z / fB_over_d_squared)


@BASELINE.right
def one_by_one(Z, error, f, disparity_error):
    pairs = zip(np.ravel(Z), np.ravel(error), strict=True)
    return np.reshape([z * z / e * disparity_error / f for z, e in pairs], np.shape(Z))


@BASELINE.wrong("The error in metres grows with the *square* of the depth: Z², not Z.")
def depth_not_squared(Z, error, f, disparity_error):
    return Z * disparity_error / (f * error)


@BASELINE.wrong("The focal length is missing: f and B do the same work here.")
def without_the_focal_length(Z, error, f, disparity_error):
    return Z**2 * disparity_error / error


@BASELINE.wrong("This is 1/B: turn it over.")
def upside_down_baseline(Z, error, f, disparity_error):
    return f * error / (Z**2 * disparity_error)


@BASELINE.wrong("The error of the disparity is left out, as if it were always one pixel.")
def one_pixel_taken_for_granted(Z, error, f, disparity_error):
    return Z**2 / (f * error)


@BASELINE.wrong(
    "Both errors stand in the numerator, so that you would need a *longer* baseline when more error is allowed. ΔZ "
    "belongs below."
)
def both_errors_above(Z, error, f, disparity_error):
    return Z**2 * disparity_error * error / f


@BASELINE.wrong(
    "The two errors have changed places: a worse matcher needs a longer baseline, a larger allowance a shorter one."
)
def errors_swapped(Z, error, f, disparity_error):
    return Z**2 * error / (f * disparity_error)


@BASELINE.wrong(
    "You count the error on both sides of Z. ± ΔZ goes with ± Δd: one side of each is what the equation compares."
)
def both_sides_counted(Z, error, f, disparity_error):
    return 2 * Z**2 * disparity_error / (f * error)


@BASELINE.wrong(
    "You solved for the exact *far* end of the interval, Z + ΔZ = f B / (d − Δd). Asked is the first order, the slope "
    "of Z at d."
)
def exact_far_end(Z, error, f, disparity_error):
    return Z * disparity_error * (Z / error + 1) / f


@BASELINE.wrong(
    "You solved for the exact *near* end of the interval, Z − ΔZ = f B / (d + Δd). Asked is the first order, the slope "
    "of Z at d."
)
def exact_near_end(Z, error, f, disparity_error):
    return Z * disparity_error * (Z / error - 1) / f


@BASELINE.wrong(
    "This is Z = f B / d solved for B with the *error* of the disparity in place of the disparity. The error in depth "
    "does not occur in it."
)
def disparity_confused_with_its_error(Z, error, f, disparity_error):
    return Z * disparity_error / f


@BASELINE.wrong(
    "f stands in the numerator. A longer focal length makes depths *more* exact, as a longer baseline does."
)
def focal_length_above(Z, error, f, disparity_error):
    return Z**2 * disparity_error * f / error


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
def step_by_step(uv, K, R, K_new):
    x, y = (uv[..., 0] - K[0, 2]) / K[0, 0], (uv[..., 1] - K[1, 2]) / K[1, 1]
    X, Y, Z = np.moveaxis(np.stack([x, y, np.ones_like(x)], axis=-1) @ R.T, -1, 0)
    u, v = K_new[0, 0] * X / Z + K_new[0, 2], K_new[1, 1] * Y / Z + K_new[1, 2]
    return np.where((Z > 0)[..., None], np.stack([u, v], axis=-1), np.nan)


@RECTIFIED.right
def one_pixel_at_a_time(uv, K, R, K_new):
    def one(pixel):
        x, y, w = K_new @ R @ np.linalg.solve(K, np.append(pixel, 1))
        return [x / w, y / w] if w > 0 else [np.nan, np.nan]

    return np.reshape([one(pixel) for pixel in uv.reshape(-1, 2)], uv.shape)


@RECTIFIED.wrong(
    "Right for all pixels that stay in view. A ray that is turned behind the camera has no pixel: NaN where the third "
    "number is not positive."
)
def behind_kept(uv, K, R, K_new):
    return _turned(uv, K_new @ R @ np.linalg.inv(K))


@RECTIFIED.wrong(
    "R is transposed: it takes rays of the camera as it was to the turned one. (For rows, R r is `r @ R.T`.)"
)
def turned_back(uv, K, R, K_new):
    return rectified(uv, K, R.T, K_new)


@RECTIFIED.wrong("You used K at both ends. The rectified picture has a camera matrix of its own, K_new.")
def old_matrix_at_both_ends(uv, K, R, K_new):
    return rectified(uv, K, R, K)


@RECTIFIED.wrong("K and K_new have changed places: pixels come in with K.")
def matrices_swapped(uv, K, R, K_new):
    return rectified(uv, K_new, R, K)


@RECTIFIED.wrong("Pixels are no rays: K⁻¹ comes first.")
def pixels_taken_for_rays(uv, K, R, K_new):
    return _turned(uv, K_new @ R)


@RECTIFIED.wrong("These are rays of the turned camera, x/z and y/z. K_new makes pixels of them.")
def rays_left_as_they_are(uv, K, R, K_new):
    return rectified(uv, K, R, np.eye(3))


@RECTIFIED.wrong(
    "You did not divide by the third number. After a turn it is no longer 1, and a pixel is (first, second) / third."
)
def not_divided(uv, K, R, K_new):
    return (_homogeneous(uv) @ (K_new @ R @ np.linalg.inv(K)).T)[..., :2]


@RECTIFIED.wrong(
    "K is not inverted. K takes rays to pixels; here the pixel is given and its ray is wanted, so it is K⁻¹."
)
def not_inverted(uv, K, R, K_new):
    return _turned(uv, K_new @ R @ K)


@RECTIFIED.wrong("The chain stands in reverse order: the matrix that acts first stands on the *right*, K_new R K⁻¹ x.")
def chain_reversed(uv, K, R, K_new):
    return _turned(uv, np.linalg.inv(K) @ R @ K_new)


@RECTIFIED.wrong(
    "The product is right, but pixels stand in rows: with H = K_new R K⁻¹ it is `x @ H.T`, and you wrote `x @ H`."
)
def product_not_transposed(uv, K, R, K_new):
    return _turned(uv, (K_new @ R @ np.linalg.inv(K)).T)


@RECTIFIED.wrong("A ray that the turned camera does not see is answered by the pixel (0, 0). Nothing is there: NaN.")
def corner_for_no_pixel(uv, K, R, K_new):
    return np.nan_to_num(rectified(uv, K, R, K_new))


@RECTIFIED.wrong("The rays are not turned: R is missing between K_new and K⁻¹.")
def rotation_left_out(uv, K, R, K_new):
    return _turned(uv, K_new @ np.linalg.inv(K))


@RECTIFIED.wrong("These are the pixels that came in: nothing has happened to them yet.")
def left_where_they_were(uv, K, R, K_new):
    return uv


@RECTIFIED.wrong("You read (row, column). A pixel is (u, v): the column first, then the row.")
def rows_first(uv, K, R, K_new):
    return rectified(uv[..., ::-1], K, R, K_new)


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


@METRIC_DEPTH.right
def by_exercise_1(found, K, P_left, P_right):
    d = np.where(found < 0, np.nan, found / 16)
    return depth(d, P_left[0, 0], -P_right[0, 3] / P_right[0, 0], P_right[0, 2] - P_left[0, 2])


@METRIC_DEPTH.wrong(
    "The sixteenths are pixels now. What is left comes from one thought: that the rectified cameras are the cameras "
    "that were calibrated."
)
def only_the_sixteenths_mended(found, K, P_left, P_right):
    return _metric(found, K[0, 0], 0, P_right, 16)


@METRIC_DEPTH.wrong(
    "The focal length is that of the rectified camera now. Look at the unit of `found` next, and then at what a point "
    "at infinity has for a disparity."
)
def only_the_focal_length_mended(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], 0, P_right, 1)


@METRIC_DEPTH.wrong(
    "The principal points are taken care of. But you add pixels to a number that is not in pixels, and f still comes "
    "from a camera that did not take this picture."
)
def only_doffs_mended(found, K, P_left, P_right):
    return _metric(found, K[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1)


@METRIC_DEPTH.wrong("One left: a point at infinity has disparity −doffs here, because the two principal points differ.")
def doffs_still_missing(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], 0, P_right, 16)


@METRIC_DEPTH.wrong("One left: K is the camera matrix of the picture *before* rectification, and so is its f.")
def focal_length_still_the_old_one(found, K, P_left, P_right):
    return _metric(found, K[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 16)


@METRIC_DEPTH.wrong("One left: OpenCV's matchers count in sixteenths of a pixel.")
def sixteenths_still_taken_for_pixels(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1)


@METRIC_DEPTH.wrong("doffs has the wrong sign: cx_right − cx_left is *added* to d.")
def doffs_with_the_wrong_sign(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], P_left[0, 2] - P_right[0, 2], P_right, 16)


@METRIC_DEPTH.wrong(
    "You compare the rectified right camera with the *original* left one: doffs is the difference of the two rectified "
    "principal points, from P_right and P_left."
)
def doffs_from_the_old_camera(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], P_right[0, 2] - K[0, 2], P_right, 16)


@METRIC_DEPTH.wrong(
    "You divide the sum by 16, and doffs with it. doffs is in pixels already: only `found` is in sixteenths."
)
def doffs_divided_too(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], (P_right[0, 2] - P_left[0, 2]) / 16, P_right, 16)


@METRIC_DEPTH.wrong("Whole pixels: `//` cuts off the sixteenths that the matcher worked for. Divide with `/`.")
def sixteenths_cut_off(found, K, P_left, P_right):
    return _metric(found // 16, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1)


@METRIC_DEPTH.wrong("The sixteenths go the wrong way: a number of sixteenths is *divided* by 16 to give pixels.")
def multiplied_by_sixteen(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1 / 16)


@METRIC_DEPTH.wrong(
    "What stands in `P_right[0, 3]` is −f B, in pixels times metres. You took it for the baseline and multiplied by f "
    "once more."
)
def focal_length_counted_twice(found, K, P_left, P_right):
    return P_left[0, 0] * metric_depth(found, K, P_left, P_right)


@METRIC_DEPTH.wrong(
    "Where nothing was found `found` is negative, and you make a depth of that too. It has to stay NaN."
)
def no_match_kept(found, K, P_left, P_right):
    return -P_right[0, 3] / (found / 16 + P_right[0, 2] - P_left[0, 2])


@METRIC_DEPTH.wrong(
    "All your depths are 0. Is the baseline taken from P_left? It stands in the *right* camera's P: the left one "
    "stands at the origin, and its entry is 0."
)
def baseline_of_the_left_camera(found, K, P_left, P_right):
    return np.where(found < 0, np.nan, 0.0)


@METRIC_DEPTH.wrong("The baseline has gone. f / d alone is a depth in baselines, not in metres.")
def baseline_left_out(found, K, P_left, P_right):
    return _metric(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 16) * P_right[0, 0] / -P_right[0, 3]


@METRIC_DEPTH.wrong(
    "Where `found` is 0 you answer NaN. Nothing was found where it is *negative*; 0 is a disparity like others, and "
    "with doffs not even at infinity."
)
def nothing_where_found_is_zero(found, K, P_left, P_right):
    return np.where(found > 0, metric_depth(found, K, P_left, P_right), np.nan)


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
def with_the_disparity_rounded(d_left, d_right, tolerance):
    partner = np.arange(len(d_left)) - np.rint(d_left)
    back, inside = _led_back(d_left, d_right, partner)
    return _agreeing(d_left, back, inside, tolerance)


@LEFT_RIGHT.right
def by_looking_up_the_nearest_column(d_left, d_right, tolerance):
    from scipy.interpolate import interp1d

    columns = np.arange(len(d_right), dtype=float)
    there = interp1d(columns, d_right, kind="nearest", bounds_error=False, fill_value=np.nan)
    partner = np.rint(columns - d_left)
    return np.where(np.abs(there(partner) - d_left) <= tolerance, d_left, np.nan)


@LEFT_RIGHT.wrong(
    "You compare the two disparities at the *same* column. What the left picture shows at u, the right one shows at "
    "u − d."
)
def same_column(d_left, d_right, tolerance):
    return np.where(np.abs(d_right - d_left) <= tolerance, d_left, np.nan)


@LEFT_RIGHT.wrong("The partner is at u − d, not at u + d: things lie farther left in the right picture.")
def other_way(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) + d_left))
    return _agreeing(d_left, back, inside, tolerance)


@LEFT_RIGHT.wrong(
    "An index below 0 counts from the end of the row in NumPy: such a partner is outside, and the answer NaN."
)
def counted_from_the_end(d_left, d_right, tolerance):
    partner = np.rint(np.nan_to_num(np.arange(len(d_left)) - d_left)).astype(int) % len(d_left)
    return _agreeing(d_left, d_right[partner], True, tolerance)


@LEFT_RIGHT.wrong(
    "Partners outside are moved to the first or last column. What that column shows is another thing: outside means "
    "NaN."
)
def clamped_to_the_border(d_left, d_right, tolerance):
    partner = np.rint(np.nan_to_num(np.arange(len(d_left)) - d_left)).astype(int)
    return _agreeing(d_left, d_right[np.clip(partner, 0, len(d_left) - 1)], True, tolerance)


@LEFT_RIGHT.wrong("You keep what fails and drop what passes.")
def failures_kept(d_left, d_right, tolerance):
    return np.where(np.isnan(left_right(d_left, d_right, tolerance)), d_left, np.nan)


@LEFT_RIGHT.wrong(
    "You cut off the fraction of u − d, which looks one column too far left half of the time. The nearest column is "
    "`np.rint`."
)
def fraction_cut_off(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.floor(np.arange(len(d_left)) - d_left))
    return _agreeing(d_left, back, inside, tolerance)


@LEFT_RIGHT.wrong(
    "The difference may be negative, and then it is always below the tolerance. Its *absolute value* is to be compared."
)
def one_sided(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) - d_left))
    return np.where(inside & (back - d_left <= tolerance), d_left, np.nan)


@LEFT_RIGHT.wrong("A difference of *exactly* the tolerance is kept, too: it is to differ by at most that, `<=`.")
def less_than_the_tolerance(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) - d_left))
    return np.where(inside & (np.abs(back - d_left) < tolerance), d_left, np.nan)


@LEFT_RIGHT.wrong("Your threshold is one pixel whatever is asked for: compare with `tolerance`.")
def one_pixel_whatever_is_asked(d_left, d_right, tolerance):
    return left_right(d_left, d_right, 1.0)


@LEFT_RIGHT.wrong("What is kept is the *right* picture's disparity. The left row is checked: keep d_left as it is.")
def the_right_row_s_answer(d_left, d_right, tolerance):
    back, _ = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) - d_left))
    return np.where(np.isnan(left_right(d_left, d_right, tolerance)), np.nan, back)


@LEFT_RIGHT.wrong(
    "Where the check fails you answer 0. A disparity of 0 is a point at infinity, not a missing one: NaN."
)
def zero_for_a_failure(d_left, d_right, tolerance):
    return np.nan_to_num(left_right(d_left, d_right, tolerance))


@LEFT_RIGHT.wrong(
    "Nothing passes your check. Did you add the two disparities, as if the right picture's were negative? Both are "
    "u_left − u_right, and agree where their *difference* is small."
)
def disparities_added(d_left, d_right, tolerance):
    back, inside = _led_back(d_left, d_right, np.rint(np.arange(len(d_left)) - d_left))
    return np.where(inside & (np.abs(back + d_left) <= tolerance), d_left, np.nan)


@LEFT_RIGHT.wrong("These are yes and no. Wanted are the disparities themselves, with NaN for every no.")
def yes_and_no(d_left, d_right, tolerance):
    return np.isfinite(left_right(d_left, d_right, tolerance))


@LEFT_RIGHT.wrong(
    "Nothing is dropped: the left row comes out as it went in. Where the right row disagrees, NaN is wanted."
)
def nothing_dropped(d_left, d_right, tolerance):
    return d_left


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
def by_a_and_b(c_before, c_best, c_after):
    a, b = (c_before + c_after) / 2 - c_best, (c_after - c_before) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        delta = -b / (2 * a)
    return np.where((c_best <= np.minimum(c_before, c_after)) & (a != 0), delta, np.nan)


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


@BETWEEN.wrong("You go away from the smaller neighbour. Where c_after is the smaller one, δ is above 0.")
def away_from_the_smaller(c_before, c_best, c_after):
    return -between_pixels(c_before, c_best, c_after)


@BETWEEN.wrong(
    "This is twice too far: the slope of `a * x**2 + b * x` is `2 * a * x + b`. A minimum halfway gives ±½, not ±1."
)
def twice_too_far(c_before, c_best, c_after):
    return 2 * between_pixels(c_before, c_best, c_after)


@BETWEEN.wrong("This is half of it: `c_before - 2 * c_best + c_after` is `2 * a` already.")
def half_of_it(c_before, c_best, c_after):
    return between_pixels(c_before, c_best, c_after) / 2


@BETWEEN.wrong("The middle cost counts twice in `c_before - 2 * c_best + c_after`, and you took it once.")
def middle_counted_once(c_before, c_best, c_after):
    delta = _over(c_before - c_after, 2 * (c_before - c_best + c_after))
    return _dressed(delta, c_before, c_best, c_after)


@BETWEEN.wrong("You added the middle cost where it is subtracted: `c_before - 2 * c_best + c_after`.")
def middle_added(c_before, c_best, c_after):
    delta = _over(c_before - c_after, 2 * (c_before + 2 * c_best + c_after))
    return _dressed(delta, c_before, c_best, c_after)


@BETWEEN.wrong("The middle cost is left out. Raise all three by as much, and δ must stay as it is.")
def middle_left_out(c_before, c_best, c_after):
    return _dressed(_over(c_before - c_after, 2 * (c_before + c_after)), c_before, c_best, c_after)


@BETWEEN.wrong("Where c_best is not the least of the three, the parabola's minimum is not near it: NaN is wanted.")
def followed_too_far(c_before, c_best, c_after):
    return _over(c_before - c_after, 2 * (c_before - 2 * c_best + c_after))


@BETWEEN.wrong("Only one neighbour is compared with c_best. Neither may be below it.")
def one_neighbour_asked(c_before, c_best, c_after):
    delta = followed_too_far(c_before, c_best, c_after)
    return np.where((c_best <= c_before) & np.isfinite(delta), delta, np.nan)


@BETWEEN.wrong("Where a neighbour's cost is as low as the best one, the minimum is halfway, ±½, and not unknown.")
def ties_dropped(c_before, c_best, c_after):
    return np.where((c_best < c_before) & (c_best < c_after), between_pixels(c_before, c_best, c_after), np.nan)


@BETWEEN.wrong("A 0 says that the minimum is right at this pixel. Where nobody knows, NaN is the answer.")
def zero_for_unknown(c_before, c_best, c_after):
    return np.nan_to_num(between_pixels(c_before, c_best, c_after))


@BETWEEN.wrong("These are two straight lines of one slope, a V. Asked for is the parabola through the three costs.")
def two_straight_lines(c_before, c_best, c_after):
    steep = 2 * (np.maximum(c_before, c_after) - c_best)
    return _dressed(_over(c_before - c_after, steep), c_before, c_best, c_after)


@BETWEEN.wrong("This is the least cost of the parabola, and wanted is the place δ where it is least.")
def the_cost_there(c_before, c_best, c_after):
    return c_best - (c_before - c_after) * between_pixels(c_before, c_best, c_after) / 4


@BETWEEN.wrong("You clip δ to −½ … ½. An answer beyond it says that c_best is not the least: NaN.")
def clipped(c_before, c_best, c_after):
    return np.clip(followed_too_far(c_before, c_best, c_after), -0.5, 0.5)


EXERCISES = (RECTIFIED, DEPTH, BASELINE, LEFT_RIGHT, BETWEEN, METRIC_DEPTH)
