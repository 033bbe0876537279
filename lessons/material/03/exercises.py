"""Lesson 03, intrinsics: its exercises, in one file because they are loaded by their lesson's number.

The rays of pixels, the field of view, and K under resizing (with a bug in it) and cropping.

Pixel centres lie at integers, as everywhere in camviz and in OpenCV: an image spans -0.5 … width - 0.5. Answers are
compared to a millionth, so that float32 is good enough; what is wrong here is wrong by a quarter of a pixel or more.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

MILLIONTH = 1e-6


def _camera_matrix(rng: np.random.Generator) -> Array:
    """With fx, fy and the skew so far apart that no two of them can be taken for each other."""
    fx, fy, skew = rng.uniform(400, 600), rng.uniform(700, 900), rng.uniform(20, 60)
    return np.array([[fx, skew, rng.uniform(250, 400)], [0, fy, rng.uniform(180, 240)], [0, 0, 1]])


def _shifted_matrix(rng: np.random.Generator) -> Array:
    """The same with a skew below 0, and with its principal point beyond the picture's upper left corner."""
    return _camera_matrix(rng) * [[1, -1, -1], [1, 1, -1], [1, 1, 1]]


def _append(uv: Array, last: float) -> Array:
    """(u, v, last) of pixels (..., 2)."""
    return np.concatenate([uv, np.full_like(uv[..., :1], last)], axis=-1)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


# 1: from pixel to ray ------------------------------------------------------------------------------------------------


def ray(uv: Array, K: Array) -> Array:
    """Unit vectors (..., 3) along K⁻¹ (u, v, 1)ᵀ for pixels (..., 2)."""
    return _unit(_append(uv, 1) @ np.linalg.inv(K).T)


def _ray_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0, 480, (*shape, 2)), _camera_matrix(rng))
    yield (rng.uniform(-480, 0, (3, 2)), _shifted_matrix(rng))


RAY = Exercise(
    name="03.ray",
    reference=ray,
    cases=_ray_cases,
    tolerance=MILLIONTH,
    hints=(
        "K takes (x, y, 1) to (u, v, 1). Which matrix takes (u, v, 1) back, and what does *unit vector* demand "
        "after that?",
        "`np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)` appends the 1 for pixels of any shape. Points "
        "are rows here, so the matrix K⁻¹ stands transposed on their right. `np.linalg.norm` with `axis=-1, "
        "keepdims=True` gives one length for each ray.",
        "`towards = uv1 @ ___`",
    ),
    praise="Every pixel has its ray, also where the pixel axes lean. This is all that K⁻¹ does.",
)


@RAY.right
def by_solving(uv, K):
    towards = np.linalg.solve(K, _append(uv, 1).reshape(-1, 3).T).T
    return (towards / np.sqrt((towards**2).sum(axis=1))[:, None]).reshape(*uv.shape[:-1], 3)


@RAY.right
def pixel_by_pixel(uv, K):
    rays = np.empty((*uv.shape[:-1], 3))
    for index in np.ndindex(uv.shape[:-1]):
        direction = np.linalg.inv(K) @ [*uv[index], 1]
        rays[index] = direction / np.linalg.norm(direction)
    return rays


@RAY.wrong("The directions are right, with z = 1. Divide each by its length.")
def not_normalised(uv, K):
    return _append(uv, 1) @ np.linalg.inv(K).T


@RAY.wrong("These are the rays for skew = 0. Solve for y first, then take skew · y away from u.")
def skew_ignored(uv, K):
    straight = K.copy()
    straight[0, 1] = 0
    return ray(uv, straight)


@RAY.wrong("K is transposed. For points in rows, the transpose of K⁻¹ stands on their right.")
def transpose_forgotten(uv, K):
    return ray(uv, K.T)


@RAY.wrong("You never take the principal point away. Rays count from the optical axis, and not from the first pixel.")
def principal_point_forgotten(uv, K):
    return ray(uv + K[:2, 2], K)


@RAY.wrong("Skew multiplies y, the *direction*. You took skew · v away, with v still in pixels.")
def skew_times_the_row_in_pixels(uv, K):
    x = (uv[..., 0] - K[0, 2] - K[0, 1] * uv[..., 1]) / K[0, 0]
    y = (uv[..., 1] - K[1, 2]) / K[1, 1]
    return _unit(np.stack([x, y, np.ones_like(x)], axis=-1))


@RAY.wrong("Half a pixel was added. Here the centre of the first pixel is (0, 0), so u and v go in as they are.")
def half_a_pixel_added(uv, K):
    return ray(uv + 0.5, K)


# 2: the field of view ------------------------------------------------------------------------------------------------


def field_of_view(width: int, fx: float, cx: float) -> float:
    """atan((cx + ½) / fx) + atan((width - ½ - cx) / fx), in degrees."""
    return float(np.degrees(np.arctan((cx + 0.5) / fx) + np.arctan((width - 0.5 - cx) / fx)))


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for width in (640, 1920, 33):
        yield (width, float(width * rng.uniform(0.4, 1.5)), float(width * rng.uniform(0.2, 0.4)))
    yield (640, float(rng.uniform(300, 900)), float(rng.uniform(-300, -100)))  # shifted out of its own picture
    yield (640, float(rng.uniform(300, 900)), float(rng.uniform(740, 940)))


FIELD_OF_VIEW = Exercise(
    name="03.field_of_view",
    reference=field_of_view,
    cases=_view_cases,
    tolerance=MILLIONTH,
    shown=((640, 450.0, 319.5),),
    hints=(
        "Two right-angled triangles share the optical axis, one to each edge of the picture. Which two angles do "
        "you add?",
        "The tangent of such an angle is the distance from cx to the edge, in pixels, divided by fx. Pixel "
        "*centres* are at 0 and width − 1, but the picture ends half a pixel beyond them. `np.arctan` gives radians.",
        "`left, right = cx + 0.5, ___`",
    ),
    praise="Correct for every principal point, in the picture or outside it.",
)


@FIELD_OF_VIEW.right
def as_opencv_does_it(width, fx, cx):
    import cv2

    from_corner = np.array([[fx, 0, cx + 0.5], [0, fx, 0], [0, 0, 1]])
    return cv2.calibrationMatrixValues(from_corner, (int(width), 100), 1.0, 1.0)[0]


@FIELD_OF_VIEW.right
def between_the_rays_of_the_edges(width, fx, cx):
    a, b = np.array([-0.5 - cx, fx]), np.array([width - 0.5 - cx, fx])
    return np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)))


@FIELD_OF_VIEW.wrong("This is 2 atan(width / 2f), which holds when the principal point is in the middle.")
def as_if_centred(width, fx, cx):
    return np.degrees(2 * np.arctan(width / (2 * fx)))


@FIELD_OF_VIEW.convention(
    "The two triangles are right. You count pixels from the corner of the first one, as `cv2.calibrationMatrixValues` "
    "does. With *centres* at integers, as everywhere in this lesson, the edges lie at −0.5 and width − 0.5: add half a "
    "pixel on the left and take it away on the right."
)
def counted_from_the_corner(width, fx, cx):
    return np.degrees(np.arctan(cx / fx) + np.arctan((width - cx) / fx))


@FIELD_OF_VIEW.wrong("You measure between pixel *centres*. The picture is half a pixel wider on either side.")
def between_pixel_centres(width, fx, cx):
    return np.degrees(np.arctan(cx / fx) + np.arctan((width - 1 - cx) / fx))


@FIELD_OF_VIEW.wrong("The half pixel has the wrong sign: the picture begins at −0.5, half a pixel *before* column 0.")
def half_a_pixel_inwards(width, fx, cx):
    return np.degrees(np.arctan((cx - 0.5) / fx) + np.arctan((width + 0.5 - cx) / fx))


@FIELD_OF_VIEW.wrong("With the principal point outside, one of the two angles is negative: leave out `abs`.")
def absolute_values(width, fx, cx):
    return np.degrees(np.arctan(abs(cx + 0.5) / fx) + np.arctan(abs(width - 0.5 - cx) / fx))


@FIELD_OF_VIEW.wrong("You subtract the angles. The field of view is their sum.")
def subtracted(width, fx, cx):
    return np.degrees(abs(np.arctan((cx + 0.5) / fx) - np.arctan((width - 0.5 - cx) / fx)))


# 3: find the bug in resizing -----------------------------------------------------------------------------------------


def resized(K: Array, s: float) -> Array:
    """f' = s f, skew' = s skew, c' = s c + (s - 1)/2: a product of matrices from the left."""
    half = (s - 1) / 2
    return np.array([[s, 0, half], [0, s, half], [0, 0, 1]]) @ K


def resized_as_given(K, s):
    (fx, skew, cx), (_, fy, cy), _ = K
    return np.array([[s * fx, skew, s * cx], [0, s * fy, s * cy], [0, 0, 1]])


def _resized_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for low, high in ((0.2, 0.4), (0.4, 0.8), (1.5, 3.0)):
        yield (_camera_matrix(rng), float(rng.uniform(low, high)))
    yield (_shifted_matrix(rng), float(rng.uniform(0.4, 0.8)))


RESIZED = Exercise(
    name="03.resized",
    reference=resized,
    cases=_resized_cases,
    tolerance=MILLIONTH,
    as_given=resized_as_given,
    hints=(
        "Resizing keeps the image's *edges* where they are: −0.5 must go to −0.5. Where does this function send it?",
        "c + ½ is the distance from the image's edge, and that is what scales. Then look at the rest of the first row: "
        "which of its entries are counted in pixels?",
        "`return np.array([[s * fx, ___, s * cx + half], [0, s * fy, s * cy + half], [0, 0, 1]])`, with `half = ___`",
    ),
    praise="Edges stay edges. Halving a picture with cx = 319.5 gives 159.5, as it must.",
)


@RESIZED.right
def distances_from_the_edge(K, s):
    (fx, skew, cx), (_, fy, cy), _ = K.tolist()
    return [[s * fx, s * skew, s * (cx + 0.5) - 0.5], [0, s * fy, s * (cy + 0.5) - 0.5], [0, 0, 1]]


@RESIZED.right
def resized_in_single_precision(K, s):
    small = K.astype(np.float32)
    small[:2] *= np.float32(s)
    small[:2, 2] += np.float32((s - 1) / 2)
    return small


@RESIZED.wrong("The middle of 640 pixels, 319.5, becomes 159.5 when halved. Your c′ lacks (s − 1)/2.")
def without_the_half_pixel(K, s):
    return np.diag([s, s, 1.0]) @ K


@RESIZED.wrong("Focal lengths and principal point are right. The skew is in pixels too.")
def skew_kept(K, s):
    answer = resized(K, s)
    answer[0, 1] = K[0, 1]
    return answer


@RESIZED.wrong("The half-pixel term has the wrong sign: (s − 1)/2 is negative for s < 1.")
def half_a_pixel_up(K, s):
    return np.array([[s, 0, (1 - s) / 2], [0, s, (1 - s) / 2], [0, 0, 1]]) @ K


@RESIZED.wrong("The half pixel is scaled too: c′ = s · (c + ½) − ½.")
def half_a_pixel_unscaled(K, s):
    return np.array([[s, 0, -0.5], [0, s, -0.5], [0, 0, 1]]) @ K


@RESIZED.wrong("This is the distance from the *edge*, s · (c + ½). Column 0 lies half a pixel further in.")
def counted_from_the_edge(K, s):
    return np.array([[s, 0, s / 2], [0, s, s / 2], [0, 0, 1]]) @ K


# 4: crop, then bin ---------------------------------------------------------------------------------------------------


def cropped_then_binned(K: Array, x0: int, y0: int, n: int) -> Array:
    """The window from (x0, y0) on, then blocks of n × n pixels read as one."""
    return resized(_cropped(K, x0, y0), 1 / n)


def _cropped(K: Array, x0: float, y0: float) -> Array:
    return np.array([[1, 0, -x0], [0, 1, -y0], [0, 0, 1]]) @ K


def _binned_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (2, 3, 4, 8):
        yield (_camera_matrix(rng), int(rng.integers(100, 200)), int(rng.integers(5, 90)), n)
    yield (_shifted_matrix(rng), int(rng.integers(100, 200)), int(rng.integers(5, 90)), 2)


CROPPED_THEN_BINNED = Exercise(
    name="03.cropped_then_binned",
    reference=cropped_then_binned,
    cases=_binned_cases,
    tolerance=MILLIONTH,
    hints=(
        "Follow one pixel. Which number does pixel (x0, y0) have after the crop? In which block does it lie after "
        "binning?",
        "The crop subtracts x0 and y0 and leaves focal lengths and skew alone. Binning is resizing by 1/n, half-pixel "
        "term and all. Write each as a 3×3 matrix: what is done first stands nearest to K.",
        "`bins = np.array([[s, 0, ___], [0, s, ___], [0, 0, 1]])`, then `return bins @ ___ @ K`",
    ),
    praise="In the right order, and each with its own rule: this is what a sensor's region of interest does to K.",
)


@CROPPED_THEN_BINNED.right
def entry_by_entry(K, x0, y0, n):
    (fx, skew, cx), (_, fy, cy), _ = K
    return np.array([[fx / n, skew / n, (cx - x0 + 0.5) / n - 0.5], [0, fy / n, (cy - y0 + 0.5) / n - 0.5], [0, 0, 1]])


@CROPPED_THEN_BINNED.right
def in_place_and_in_single_precision(K, x0, y0, n):
    answer = K.astype(np.float32)
    answer[:2, 2] -= (x0, y0)
    answer[:2] /= n
    answer[:2, 2] -= np.float32(0.5 - 0.5 / n)
    return answer


@CROPPED_THEN_BINNED.wrong("The crop has the wrong sign: subtract x0 and y0.")
def crop_added(K, x0, y0, n):
    return resized(_cropped(K, -x0, -y0), 1 / n)


@CROPPED_THEN_BINNED.wrong("This bins first and crops then. x0 and y0 count the pixels *before* binning.")
def binned_first(K, x0, y0, n):
    return _cropped(resized(K, 1 / n), x0, y0)


@CROPPED_THEN_BINNED.wrong("The half-pixel term is missing: the first n pixels have their middle at (n − 1)/2.")
def binned_without_the_half_pixel(K, x0, y0, n):
    return np.diag([1 / n, 1 / n, 1]) @ _cropped(K, x0, y0)


@CROPPED_THEN_BINNED.wrong("(n − 1)/2 is in *small* pixels: subtract it before you divide by n.")
def half_block_in_small_pixels(K, x0, y0, n):
    middle = (n - 1) / 2
    return np.array([[1 / n, 0, -middle], [0, 1 / n, -middle], [0, 0, 1]]) @ _cropped(K, x0, y0)


@CROPPED_THEN_BINNED.wrong("All is right but the skew: it is counted in pixels too, and binning divides it by n.")
def skew_not_binned(K, x0, y0, n):
    answer = cropped_then_binned(K, x0, y0, n)
    answer[0, 1] = K[0, 1]
    return answer


EXERCISES = (RAY, RESIZED, FIELD_OF_VIEW, CROPPED_THEN_BINNED)
