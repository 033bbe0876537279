"""What a distortion does to a picture: where it folds, how far it moves a pixel, how to take it back. For any lens."""

from math import inf, pi, radians, sqrt, tan

import cv2
import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics, rotate
from camviz.lenses import Lens, Perspective
from camviz.lenses.base import Array, on_plane
from camviz.lenses.roots import first_positive_root
from camviz.poses import Rotation

NEARLY_A_POLE = 0.2  # a denominator below which every error of the numerator is multiplied by more than five
WIDEST = tan(radians(80))  # beyond 80° a perspective picture is hardly more than stretch


def fold_radius(lens: Lens) -> float:
    """The ideal radius where a lens's radial equation turns back, unless a pole comes before it; else infinity.

    In the equation's own variable: r on the plane z = 1, or for Kannala-Brandt the angle θ in radians.
    """
    return lens.fold.radius if lens.fold else inf


def fold_angle(lens: Lens) -> float:
    """The angle in radians between the axis and the ray at which a lens folds; infinity if it never does."""
    return lens.fold.angle if lens.fold else inf


def pole_radius(lens: Lens) -> float:
    """The ideal radius where a rational polynomial is infinite, the first positive root of D(r²); infinity if none."""
    return sqrt(first_positive_root(lens.denominator.coef))


def is_rational(lens: Lens) -> bool:
    """True for a lens whose polynomial is divided by another, so that it may have a pole."""
    return bool(np.any(lens.denominator.coef[1:]))


def weakest_denominator(lens: Lens, radius: float) -> tuple[float, float]:
    """Where in 0 … `radius` the denominator D(r²) of a rational polynomial is smallest, and D there: (r, D).

    A D far below 1 is a near-pole: the polynomial has no root there, yet throws the picture about. (0, 1) without D.
    """
    turns = lens.denominator.deriv().roots()
    turns = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0) & (turns.real < radius**2)]
    candidates = np.concatenate([[0.0], turns, [radius**2]])
    values = lens.denominator(candidates)
    return float(np.sqrt(candidates[values.argmin()])), float(values.min())


def edge_of_field(lens: Lens, azimuth: ArrayLike) -> Array:
    """The angle (...) in radians from the axis to the last ray with an image, in the directions `azimuth` (...)."""
    azimuth = np.asarray(azimuth, dtype=float)
    low, high = np.zeros(azimuth.shape), np.full(azimuth.shape, pi)
    for _ in range(44):
        middle = (low + high) / 2
        ray = np.stack([np.sin(middle) * np.cos(azimuth), np.sin(middle) * np.sin(azimuth), np.cos(middle)], axis=-1)
        seen = np.isfinite(lens.project(ray)).all(axis=-1)
        low, high = np.where(seen, middle, low), np.where(seen, high, middle)
    return low


def image_corner_radius(intrinsics: Intrinsics) -> float:
    """The distance in focal lengths from the principal point to the farthest corner pixel: a *distorted* radius."""
    corners = intrinsics.from_pixels(_rectangle(intrinsics, 1))
    return float(np.linalg.norm(corners, axis=-1).max())


def ideal_image_radius(camera: Camera) -> float:
    """The largest tan θ of the rays in front of the camera that arrive on the image's border; NaN if there are none."""
    ideal = _ideal(camera, _rectangle(camera.intrinsics, 16))
    radii = np.linalg.norm(ideal, axis=-1)
    return float(radii[np.isfinite(radii)].max(initial=-inf)) if np.isfinite(radii).any() else np.nan


def image_reach(camera: Camera) -> float:
    """How far, in focal lengths on the plane z = 1, an undistorted picture of this camera asks; NaN where nowhere."""
    return float(np.nanmax([ideal_image_radius(camera), image_corner_radius(camera.intrinsics)]))


def jacobian_determinant(lens: Lens, xy: ArrayLike) -> Array:
    """The determinant (...) of the map from ideal points (..., 2) on the plane z = 1 to the image; below 0 it mirrors.

    By the lens's own Jacobian: of `BrownConrady` exact, beyond its fold as well; of most others good to about 1e-9.
    """
    J = lens.jacobian(xy)
    with np.errstate(all="ignore"):
        return J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]


def valid_region(camera: Camera, step_px: int = 1) -> np.ndarray:
    """True for every `step_px`-th pixel, (rows, columns), at which a ray arrives."""
    intrinsics = camera.intrinsics
    u, v = (np.arange(0, size, step_px, dtype=float) for size in (intrinsics.width, intrinsics.height))
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    return np.isfinite(camera.lens.unproject(intrinsics.from_pixels(pixels))[..., 0])


def displacement(camera: Camera, step_px: float) -> tuple[Array, Array]:
    """Pixels of an undistorted grid (rows, columns, 2) and the vectors to where the lens puts them; NaN where nowhere.

    The grid is `step_px` apart and centred on the image; the undistorted picture has the camera's own K.
    """
    intrinsics = camera.intrinsics
    u, v = (_centred(size, step_px) for size in (intrinsics.width, intrinsics.height))
    ideal = np.stack(np.meshgrid(u, v), axis=-1)
    distorted = intrinsics.to_pixels(camera.lens.project(on_plane(intrinsics.from_pixels(ideal))))
    return ideal, distorted - ideal


def undistort_maps(
    camera: Camera, target: Intrinsics, lens: Lens | None = None, target_from_cam: Rotation | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The pixel (map_x, map_y), each (height, width) float32, of a photograph that belongs at each pixel of `target`.

    `target` is a picture by the same camera through another `lens` (perspective unless given), turned by
    `target_from_cam`. The forward model is evaluated at every output pixel; NaN where the photograph shows nothing.
    """
    rays = (lens or Perspective()).unproject(target.from_pixels(target.grid()))
    if target_from_cam is not None:
        rays = rotate(target_from_cam.inv(), rays)
    return _maps(camera.intrinsics.to_pixels(camera.lens.project(rays)))


def distort_maps(camera: Camera, source: Intrinsics, lens: Lens | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The pixel (map_x, map_y), each float32, of an ideal picture `source` that belongs at each pixel of the camera.

    For showing a photograph as the lens would have bent it; needs the inverse of the lens at every output pixel.
    """
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(camera.intrinsics.grid()))
    return _maps(source.to_pixels((lens or Perspective()).project(rays)))


def remap(image: np.ndarray, maps: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The picture whose pixels lie at `maps` in `image`, bilinear; black where the maps are NaN or lead outside."""
    return cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)


def undistorted_intrinsics(camera: Camera, alpha: float) -> tuple[Intrinsics, tuple[int, int, int, int]]:
    """Intrinsics, of the camera's size, for its undistorted picture, and the (x0, y0, width, height) without black.

    alpha = 0 shows the largest upright rectangle without black borders, alpha = 1 every pixel of the photograph, and
    between them the focal lengths and principal points are mixed (cv2.getOptimalNewCameraMatrix). Rays beyond a fold
    or 80° from the axis are left out. Raises ValueError for alpha outside 0 … 1 and where no such rectangle exists.
    """
    if not 0 <= alpha <= 1:
        raise ValueError(f"alpha must lie between 0 (no black borders) and 1 (every pixel kept), got {alpha}")
    intrinsics = camera.intrinsics
    top, right, bottom, left = _outline(camera, 64)
    inner = np.array([left[:, 0].max(), top[:, 1].max(), right[:, 0].min(), bottom[:, 1].min()])
    outer = np.array([left[:, 0].min(), top[:, 1].min(), right[:, 0].max(), bottom[:, 1].max()])
    if not (inner[:2] < inner[2:]).all():
        raise ValueError("alpha = 0 needs an upright rectangle around the axis that the camera sees; it sees none")
    fx, fy, cx, cy = ((1 - alpha) * _filling(inner, intrinsics) + alpha * _filling(outer, intrinsics)).tolist()
    result = Intrinsics(intrinsics.width, intrinsics.height, fx, fy, cx, cy)
    first, last = np.ceil(result.to_pixels(inner[:2]) - 1e-6), np.floor(result.to_pixels(inner[2:]) + 1e-6)
    x0, y0 = (int(value) for value in np.maximum(first, 0))
    x1, y1 = (int(value) for value in np.minimum(last, [intrinsics.width - 1, intrinsics.height - 1]))
    return result, (x0, y0, x1 - x0 + 1, y1 - y0 + 1)


def _filling(rectangle: Array, intrinsics: Intrinsics) -> Array:
    """fx, fy, cx, cy that spread a rectangle (left, top, right, bottom) of the plane z = 1 over the whole picture."""
    focal = (np.array([intrinsics.width, intrinsics.height]) - 1) / (rectangle[2:] - rectangle[:2])
    return np.concatenate([focal, -focal * rectangle[:2]])


def _outline(camera: Camera, samples: int) -> Array:
    """The four sides (4, samples + 1, 2) of what the photograph shows, on the plane z = 1: top, right, bottom, left.

    Where the border itself has no ray, the last point on the way there from the principal point that has one; that
    point must then be in the picture, else ValueError.
    """
    border_px = _rectangle(camera.intrinsics, samples)
    ideal = _ideal(camera, border_px)
    if (np.linalg.norm(ideal, axis=-1) < WIDEST).all():
        return ideal
    if not camera.intrinsics.contains(camera.intrinsics.to_pixels([0, 0])):
        raise ValueError("the lens folds or widens before the picture's border, and its axis is not in the picture")
    border = camera.intrinsics.from_pixels(border_px)
    way = np.linspace(0, 1, 129)[:, None, None, None]
    ideal = _ideal(camera, camera.intrinsics.to_pixels(way * border))
    seen = np.logical_and.accumulate(np.linalg.norm(ideal, axis=-1) < WIDEST, axis=0)
    last = seen.sum(axis=0) - 1
    return np.take_along_axis(ideal, last[None, ..., None], axis=0)[0]


def _rectangle(intrinsics: Intrinsics, samples: int) -> Array:
    """The centres of the outermost pixels as four sides (4, samples + 1, 2): top, right, bottom, left."""
    s = np.linspace(0, 1, samples + 1)
    zero, one = np.zeros_like(s), np.ones_like(s)
    sides = np.array([[s, zero], [one, s], [s, one], [zero, s]])
    return np.moveaxis(sides, 1, -1) * [intrinsics.width - 1, intrinsics.height - 1]


def _ideal(camera: Camera, uv: Array) -> Array:
    """The points (..., 2) of the plane z = 1 that pixels (..., 2) show; NaN where they show none."""
    return Perspective().project(camera.lens.unproject(camera.intrinsics.from_pixels(uv)))


def _centred(size: int, step: float) -> Array:
    count = int((size - 1) // step) + 1
    return np.asarray((size - 1) / 2 + step * (np.arange(count) - (count - 1) / 2), dtype=np.float64)


def _maps(uv: Array) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.moveaxis(uv.astype(np.float32), -1, 0)
    return np.ascontiguousarray(u), np.ascontiguousarray(v)
