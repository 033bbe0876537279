"""Lesson 08, rectification, disparity and depth: Z = f B / (d + doffs), its price, and what goes wrong on the way.

d = u_left − u_right. After Hartley & Zisserman (2004), section 11.12, and Szeliski (2022), chapter 12.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise, Misconception
from camviz.poses import Rotation


def depth(d: Array, f: float, B: float, doffs: float) -> Array:
    """Z = f B / (d + doffs) in metres; inf where d + doffs is 0, NaN where it is below."""
    shift = d + doffs
    Z = np.divide(f * B, shift, out=np.full(np.shape(shift), np.inf), where=shift != 0)
    return np.where(shift < 0, np.nan, Z)


def baseline_for(Z: Array, error: Array, f: float, disparity_error: float) -> Array:
    """B = Z² Δd / (f ΔZ)."""
    return Z**2 * disparity_error / (f * error)


def rectified(uv: Array, K: Array, R: Array, K_new: Array) -> Array:
    """Pixels K_new R K⁻¹ x (..., 2) of pixels (..., 2); NaN for a ray that the turned camera does not see."""
    x = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ (K_new @ R @ np.linalg.inv(K)).T
    return np.where(x[..., 2:] > 0, x[..., :2] / x[..., 2:], np.nan)


def metric_depth(found: Array, K: Array, P_left: Array, P_right: Array) -> Array:
    """Z of the sixteenths of a pixel that cv2.StereoSGBM found; NaN where it found none."""
    return _metric_depth(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 16)


def left_right(d_left: Array, d_right: Array, tolerance: float) -> Array:
    """The left disparities of a row (n,), NaN where the partner's leads back farther than `tolerance` away."""
    u = np.arange(len(d_left)) - d_left
    partner = np.rint(np.where(np.isfinite(u), u, -1)).astype(int)
    inside = (partner >= 0) & (partner < len(d_left))
    back = d_right[np.where(inside, partner, 0)]
    return np.where(inside & (np.abs(back - d_left) <= tolerance), d_left, np.nan)


def _metric_depth(found: Array, f: float, doffs: float, P_right: Array, parts: float) -> Array:
    B = -P_right[0, 3] / P_right[0, 0]
    return np.where(found < 0, np.nan, f * B / (found / parts + doffs))


# Cases ---------------------------------------------------------------------------------------------------------------


def _depth_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """In every larger case one disparity is at infinity and one behind the cameras, under doffs of either sign."""
    sign = rng.choice([-1, 1])
    for shape in SHAPES:
        sign = -sign
        doffs = float(sign * rng.uniform(5, 40))
        d = rng.uniform(0, 100, shape) + max(0, 1 - doffs)
        if d.size > 1:
            d.flat[0], d.flat[1] = -doffs, -doffs - rng.uniform(1, 5)
        yield d, float(rng.uniform(300, 900)), float(rng.uniform(0.05, 0.5)), doffs


def _baseline_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        Z = rng.uniform(1, 50, shape)
        yield Z, Z * rng.uniform(0.005, 0.1, shape), float(rng.uniform(300, 2000)), float(rng.uniform(0.1, 1))


def _rectified_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """The last case turns some rays out of sight."""
    for shape in SHAPES:
        R = Rotation.from_rotvec(rng.uniform(-0.25, 0.25, 3)).as_matrix()
        yield rng.uniform(0, 480, (*shape, 2)), _K(rng), R, _K(rng)
    R = Rotation.from_rotvec([0, rng.choice([-1, 1]) * rng.uniform(1.42, 1.5), 0]).as_matrix()
    yield rng.uniform(0, 640, (40, 2)), _K(rng), R, _K(rng)


def _metric_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """As from cv2.stereoRectify with its principal points free, and StereoSGBM: −16 says that there is no match."""
    for _ in range(3):
        K, f, B = _K(rng), rng.uniform(300, 900), rng.uniform(0.05, 0.5)
        P_left = np.array([[f, 0, rng.uniform(250, 390), 0], [0, f, 240, 0], [0, 0, 1, 0]])
        doffs = rng.uniform(5, 40)
        P_right = P_left + [[0, 0, doffs, -f * B], [0, 0, 0, 0], [0, 0, 0, 0]]
        found = rng.integers(16, 1500, (6, 8)).astype(np.int16)
        found[rng.random((6, 8)) < 0.2] = -16
        found[0, 0], found[0, 1] = -16, 320
        yield found, K, P_left, P_right


def _left_right_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """A near thing before a far wall, as each picture shows it, with mistakes and gaps strewn in."""
    for n in (40, 60, 90):
        near, far = rng.integers(8, 14), rng.integers(2, 6)
        start = rng.integers(15, n - 22)
        left, right = np.full(n, float(far)), np.full(n, float(far))
        left[start : start + 9], right[start - near : start - near + 9] = near, near
        left += rng.uniform(-0.3, 0.3, n)
        right += rng.uniform(-0.3, 0.3, n)
        left[rng.choice(n, 4, replace=False)] += rng.uniform(3, 20, 4)
        left[rng.choice(n, 3, replace=False)] = np.nan
        right[rng.choice(n, 3, replace=False)] = np.nan
        yield left, right, 1.0


def _K(rng: np.random.Generator) -> Array:
    f = rng.uniform(300, 900)
    return np.array([[f, 0, rng.uniform(250, 390)], [0, f, rng.uniform(180, 300)], [0, 0, 1]])


# Wrong in a known way -------------------------------------------------------------------------------------------------


def _unchecked(d: Array, f: float, B: float, doffs: float) -> Array:
    return f * B / (d + doffs)


def _turned(uv: Array, K: Array, R: Array, K_new: Array) -> Array:
    """K_new R K⁻¹ x without a look at what lies behind."""
    x = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ (K_new @ R @ np.linalg.inv(K)).T
    return x[..., :2] / x[..., 2:]


def _same_pixel(d_left: Array, d_right: Array, tolerance: float) -> Array:
    return np.where(np.abs(d_right - d_left) <= tolerance, d_left, np.nan)


def _other_way(d_left: Array, d_right: Array, tolerance: float) -> Array:
    """The partner sought at u + d."""
    u = np.arange(len(d_left)) + d_left
    partner = np.rint(np.where(np.isfinite(u), u, -1)).astype(int)
    inside = (partner >= 0) & (partner < len(d_left))
    back = d_right[np.where(inside, partner, 0)]
    return np.where(inside & (np.abs(back - d_left) <= tolerance), d_left, np.nan)


def _wrapped(d_left: Array, d_right: Array, tolerance: float) -> Array:
    """Negative indices count from the end of the row."""
    partner = np.rint(np.nan_to_num(np.arange(len(d_left)) - d_left)).astype(int) % len(d_left)
    return np.where(np.abs(d_right[partner] - d_left) <= tolerance, d_left, np.nan)


DEPTH = Exercise(
    name="08.depth",
    reference=depth,
    cases=_depth_cases,
    hints=(
        "First d + doffs, then f B over it. Where that sum is 0 the point is infinitely far away; where it is below 0, "
        "no point in front of the cameras has such a disparity.",
        "`np.where(shift < 0, np.nan, …)`; and `with np.errstate(divide='ignore'):` lets NumPy write inf for 1/0.",
    ),
    praise="With doffs = 0 it is the formula of every book; with it, it holds for the published pairs too.",
)

DEPTH.misconceptions.extend(
    Misconception(form, "doffs is left out: it is the disparity of a point at infinity, with its sign turned.")
    for form in (lambda d, f, B, doffs: depth(d, f, B, 0.0), lambda d, f, B, doffs: _unchecked(d, f, B, 0.0))
)


@DEPTH.wrong("doffs has the wrong sign: it is cx_right − cx_left, and is added.")
def _(d, f, B, doffs):
    return depth(d, f, B, -doffs)


DEPTH.wrong("The formula is right. A sum below 0 gives a *negative* depth, though: NaN is the honest answer there.")(
    _unchecked
)


@DEPTH.wrong("Where d + doffs is exactly 0 there is an answer: the rays are parallel, the point is infinitely far.")
def _(d, f, B, doffs):
    return np.where(d + doffs <= 0, np.nan, _unchecked(d, f, B, doffs))


@DEPTH.wrong("You asked whether d is negative. What must not be negative is d + doffs.")
def _(d, f, B, doffs):
    return np.where(d < 0, np.nan, np.abs(_unchecked(d, f, B, doffs)))


@DEPTH.wrong("This is upside down: a *larger* disparity is a *nearer* point.")
def _(d, f, B, doffs):
    return (d + doffs) * B / f


BASELINE = Exercise(
    name="08.baseline_for",
    reference=baseline_for,
    cases=_baseline_cases,
    hints=(
        "Take ΔZ = Z² Δd / (f B) and solve it for B.",
        "B = Z² Δd / (f ΔZ). All of it works on arrays as it stands.",
    ),
    praise="Twice as far at the same error asks for four times the baseline (or the focal length, in pixels).",
)


@BASELINE.wrong("The error in metres grows with the *square* of the depth: Z², not Z.")
def _(Z, error, f, disparity_error):
    return Z * disparity_error / (f * error)


@BASELINE.wrong("The focal length is missing: f and B do the same work here.")
def _(Z, error, f, disparity_error):
    return Z**2 * disparity_error / error


@BASELINE.wrong("This is 1/B: turn it over.")
def _(Z, error, f, disparity_error):
    return f * error / (Z**2 * disparity_error)


@BASELINE.wrong("The error of the disparity is left out, as if it were always one pixel.")
def _(Z, error, f, disparity_error):
    return Z**2 / (f * error)


RECTIFIED = Exercise(
    name="08.rectified",
    reference=rectified,
    cases=_rectified_cases,
    tolerance=1e-8,
    hints=(
        "A pixel becomes a ray by K⁻¹, the ray is turned by R, and K_new makes a pixel of it again.",
        "For pixels in rows: `x @ (K_new @ R @ np.linalg.inv(K)).T`, then divide by the third number, where it is "
        "positive.",
    ),
    praise="No depth anywhere in it: that is why rectification needs to know nothing about the scene.",
)

RECTIFIED.wrong(
    "Right for all pixels that stay in view. A ray that is turned behind the camera has no pixel: NaN where "
    "the third number is not positive."
)(_turned)


@RECTIFIED.wrong(
    "R is transposed: it takes rays of the camera as it was to the turned one. (For rows, R r is `r @ R.T`.)"
)
def _(uv, K, R, K_new):
    return rectified(uv, K, R.T, K_new)


@RECTIFIED.wrong("You used K at both ends. The rectified picture has a camera matrix of its own, K_new.")
def _(uv, K, R, K_new):
    return rectified(uv, K, R, K)


@RECTIFIED.wrong("K and K_new have changed places: pixels come in with K.")
def _(uv, K, R, K_new):
    return rectified(uv, K_new, R, K)


@RECTIFIED.wrong("Pixels are no rays: K⁻¹ comes first.")
def _(uv, K, R, K_new):
    return _turned(uv, np.eye(3), R, K_new)


METRIC_DEPTH = Exercise(
    name="08.metric_depth",
    reference=metric_depth,
    cases=_metric_cases,
    bug=True,
    hints=(
        "There are three. In what unit are OpenCV's disparities? Which camera took the *rectified* picture? And do the "
        "two principal points agree?",
        "`found / 16`; f is `P_left[0, 0]`, for K belongs to the picture before rectification; and "
        "doffs = `P_right[0, 2] - P_left[0, 2]` is added to the disparity.",
    ),
    praise="Three mistakes, each of them in code that people ship. The first makes everything 16 times too near.",
)


@METRIC_DEPTH.wrong("Everything comes out far too near, and not only that. There are three mistakes.")
def _(found, K, P_left, P_right):
    return _metric_depth(found, K[0, 0], 0, P_right, 1)


@METRIC_DEPTH.wrong("The sixteenths are pixels now. There are two mistakes left.")
def _(found, K, P_left, P_right):
    return _metric_depth(found, K[0, 0], 0, P_right, 16)


@METRIC_DEPTH.wrong(
    "The focal length is right now: that of the rectified camera. There are two mistakes left; look at "
    "the unit of `found`."
)
def _(found, K, P_left, P_right):
    return _metric_depth(found, P_left[0, 0], 0, P_right, 1)


@METRIC_DEPTH.wrong("One left: a point at infinity has disparity −doffs here, because the two principal points differ.")
def _(found, K, P_left, P_right):
    return _metric_depth(found, P_left[0, 0], 0, P_right, 16)


@METRIC_DEPTH.wrong("One left: K is the camera matrix of the picture *before* rectification, and so is its f.")
def _(found, K, P_left, P_right):
    return _metric_depth(found, K[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 16)


@METRIC_DEPTH.wrong("One left: OpenCV's matchers count in sixteenths of a pixel.")
def _(found, K, P_left, P_right):
    return _metric_depth(found, P_left[0, 0], P_right[0, 2] - P_left[0, 2], P_right, 1)


@METRIC_DEPTH.wrong("doffs has the wrong sign: cx_right − cx_left is *added* to d.")
def _(found, K, P_left, P_right):
    return _metric_depth(found, P_left[0, 0], P_left[0, 2] - P_right[0, 2], P_right, 16)


LEFT_RIGHT = Exercise(
    name="08.left_right",
    reference=left_right,
    cases=_left_right_cases,
    hints=(
        "The partner of column u in the left row is column u − d_left[u], rounded, of the right row. Its own disparity "
        "should be the same.",
        "`partner = np.rint(u - d_left)`; make it an index only where it is finite, at least 0 and less than n, and "
        "compare `d_right[partner]` with `d_left`.",
    ),
    praise="The strip beside every near thing, which only one camera sees, is gone, and most mistakes with it.",
)

LEFT_RIGHT.wrong(
    "You compare the two disparities at the *same* column. What the left picture shows at u, the right one "
    "shows at u − d."
)(_same_pixel)


LEFT_RIGHT.wrong("The partner is at u − d, not at u + d: things lie farther left in the right picture.")(_other_way)


LEFT_RIGHT.wrong(
    "An index below 0 counts from the end of the row in NumPy: such a partner is outside, and the answer NaN."
)(_wrapped)


@LEFT_RIGHT.wrong("You keep what fails and drop what passes.")
def _(d_left, d_right, tolerance):
    return np.where(np.isnan(left_right(d_left, d_right, tolerance)), d_left, np.nan)


EXERCISES = (DEPTH, BASELINE, RECTIFIED, METRIC_DEPTH, LEFT_RIGHT)
