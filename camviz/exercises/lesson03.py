"""Lesson 03, intrinsics: the rays of pixels, the field of view, and K under resizing (with a bug in it) and cropping.

Pixel centres lie at integers, as everywhere in camviz and in OpenCV: an image spans -0.5 … width - 0.5.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import SHAPES, Arguments, Array, Exercise


def ray(uv: Array, K: Array) -> Array:
    """Unit vectors (..., 3) along K⁻¹ (u, v, 1)ᵀ for pixels (..., 2)."""
    towards = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ np.linalg.inv(K).T
    return np.asarray(towards / np.linalg.norm(towards, axis=-1, keepdims=True))


def field_of_view(width: int, fx: float, cx: float) -> float:
    """atan((cx + ½) / fx) + atan((width - ½ - cx) / fx), in degrees."""
    return float(np.degrees(np.arctan((cx + 0.5) / fx) + np.arctan((width - 0.5 - cx) / fx)))


def resized(K: Array, s: float) -> Array:
    """f' = s f, skew' = s skew, c' = s c + (s - 1)/2: a product of matrices from the left."""
    half = (s - 1) / 2
    return np.array([[s, 0, half], [0, s, half], [0, 0, 1]]) @ K


def cropped_then_binned(K: Array, x0: int, y0: int, n: int) -> Array:
    """The window from (x0, y0) on, then blocks of n × n pixels read as one."""
    window = np.array([[1, 0, -x0], [0, 1, -y0], [0, 0, 1]]) @ K
    return resized(window, 1 / n)


def _camera_matrix(rng: np.random.Generator, skew: bool = True) -> Array:
    fx, fy, s = rng.uniform(400, 900), rng.uniform(400, 900), rng.uniform(5, 60) if skew else 0.0
    return np.array([[fx, s, rng.uniform(250, 400)], [0, fy, rng.uniform(180, 300)], [0, 0, 1]])


def _ray_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0, 480, (*shape, 2)), _camera_matrix(rng))


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for width in (640, 1920, 33):
        yield (width, float(width * rng.uniform(0.4, 1.5)), float(width * rng.uniform(0.2, 0.8)))
    yield (640, float(rng.uniform(300, 900)), float(rng.uniform(-300, -100)))  # shifted out of its own picture


def _resized_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for low, high in ((0.2, 0.4), (0.4, 0.8), (1.5, 3.0)):
        yield (_camera_matrix(rng), float(rng.uniform(low, high)))


def _binned_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (2, 3, 4, 8):
        yield (_camera_matrix(rng), int(rng.integers(5, 200)), int(rng.integers(5, 200)), n)


def _diagonal_inverse(uv: Array, K: Array) -> Array:
    straight = K.copy()
    straight[0, 1] = 0
    return ray(uv, straight)


def _unnormalised(uv: Array, K: Array) -> Array:
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ np.linalg.inv(K).T


def _scaled(K: Array, s: float) -> Array:
    return np.diag([s, s, 1.0]) @ K


def _half_pixel_up(K: Array, s: float) -> Array:
    return np.array([[s, 0, (1 - s) / 2], [0, s, (1 - s) / 2], [0, 0, 1]]) @ K


def _skew_kept(K: Array, s: float) -> Array:
    answer = resized(K, s)
    answer[0, 1] = K[0, 1]
    return answer


def _binned_first(K: Array, x0: int, y0: int, n: int) -> Array:
    return np.array([[1, 0, -x0], [0, 1, -y0], [0, 0, 1]]) @ resized(K, 1 / n)


RAY = Exercise(
    name="03.ray",
    reference=ray,
    cases=_ray_cases,
    hints=(
        "Write a pixel as (u, v, 1), multiply by K⁻¹, and divide by the length of what comes out.",
        "For pixels of any shape (..., 2): `np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)`, then "
        "`@ np.linalg.inv(K).T`, then divide by `np.linalg.norm(..., axis=-1, keepdims=True)`.",
    ),
    praise="Every pixel has its ray, also where the pixel axes lean. This is all that K⁻¹ does.",
)

RAY.wrong("The directions are right, with z = 1. Divide each by its length.")(_unnormalised)


RAY.wrong(
    "These are the rays for skew = 0: `(u − cx) / fx` alone is not enough when K[0, 1] is not zero. Solve "
    "for y first, then take skew · y away from u."
)(_diagonal_inverse)


@RAY.wrong("You multiply by K. K takes rays to pixels; the way back is its inverse.")
def _(uv, K):
    return ray(uv, np.linalg.inv(K))


@RAY.wrong("K has been transposed on the way: for row vectors the product is `uv1 @ np.linalg.inv(K).T`.")
def _(uv, K):
    return ray(uv, K.T)


FIELD_OF_VIEW = Exercise(
    name="03.field_of_view",
    reference=field_of_view,
    cases=_view_cases,
    shown=((640, 450.0, 319.5),),
    hints=(
        "Two right-angled triangles share the optical axis, one to each edge. Add their angles.",
        "The left edge lies at u = −0.5 and the right one at width − 0.5; from the axis they are cx + 0.5 and "
        "width − 0.5 − cx pixels away.",
    ),
    praise="Correct for every principal point, in the picture or outside it.",
)


@FIELD_OF_VIEW.wrong(
    "This is 2 atan(width / 2f), which holds when the principal point is in the middle. Here it is not."
)
def _(width, fx, cx):
    return np.degrees(2 * np.arctan(width / (2 * fx)))


@FIELD_OF_VIEW.wrong(
    "Half a pixel is missing: this counts pixels from the corner of the first one. With centres at integers "
    "the edges lie at −0.5 and width − 0.5."
)
def _(width, fx, cx):
    return np.degrees(np.arctan(cx / fx) + np.arctan((width - cx) / fx))


@FIELD_OF_VIEW.wrong(
    "This is the angle between the *centres* of the first and the last pixel. The picture is half a pixel "
    "wider on either side."
)
def _(width, fx, cx):
    return np.degrees(np.arctan(cx / fx) + np.arctan((width - 1 - cx) / fx))


@FIELD_OF_VIEW.wrong("The angle is right, in radians.")
def _(width, fx, cx):
    return np.radians(field_of_view(width, fx, cx))


RESIZED = Exercise(
    name="03.resized",
    reference=resized,
    cases=_resized_cases,
    bug=True,
    hints=(
        "Resizing keeps the image's *edges* where they are: −0.5 must go to −0.5. Where does this function send it?",
        "c + ½ is the distance from the image's edge, and that is what scales: c′ + ½ = s (c + ½). Does everything "
        "else in the first row scale as well?",
    ),
    praise="Edges stay edges. Halving a picture with cx = 319.5 gives 159.5, as it must.",
)

RESIZED.wrong(
    "This scales K as a whole, c′ = s c. The middle of a 640-pixel row, 319.5, becomes 159.75 when halved, "
    "but the middle of 320 pixels is 159.5: every ray is off by (s − 1)/2 pixels."
)(_scaled)


@RESIZED.wrong(
    "This is the function as it stood: the focal lengths are right, the principal point and the skew are not."
)
def _(K, s):
    return np.array([[s * K[0, 0], K[0, 1], s * K[0, 2]], [0, s * K[1, 1], s * K[1, 2]], [0, 0, 1]])


RESIZED.wrong("The half-pixel term has the wrong sign: (s − 1)/2 is negative for s < 1.")(_half_pixel_up)


RESIZED.wrong("Focal lengths and principal point are right. The skew is in pixels too.")(_skew_kept)


CROPPED_THEN_BINNED = Exercise(
    name="03.cropped_then_binned",
    reference=cropped_then_binned,
    cases=_binned_cases,
    hints=(
        "First the crop: pixel (x0, y0) becomes pixel (0, 0). Then the bins: resizing by 1/n.",
        "cx′ = (cx − x0 + ½)/n − ½. Focal lengths and skew are divided by n and do not notice the crop.",
    ),
    praise="In the right order, and each with its own rule: this is what a sensor's region of interest does to K.",
)


@CROPPED_THEN_BINNED.wrong(
    "The crop has the wrong sign. Columns cut off on the left bring the principal point *nearer* to column 0."
)
def _(K, x0, y0, n):
    return resized(np.array([[1, 0, x0], [0, 1, y0], [0, 0, 1]]) @ K, 1 / n)


CROPPED_THEN_BINNED.wrong("This bins first and crops then. x0 and y0 count the pixels *before* binning.")(_binned_first)


@CROPPED_THEN_BINNED.wrong(
    "The half-pixel term of the binning is missing: the middle of the first n pixels lies at (n − 1)/2."
)
def _(K, x0, y0, n):
    return _scaled(np.array([[1, 0, -x0], [0, 1, -y0], [0, 0, 1]]) @ K, 1 / n)


@CROPPED_THEN_BINNED.wrong("Only the binning is there: the crop moves the principal point.")
def _(K, x0, y0, n):
    return resized(K, 1 / n)


EXERCISES = (RAY, FIELD_OF_VIEW, RESIZED, CROPPED_THEN_BINNED)
