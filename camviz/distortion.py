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

__all__ = [
    "displacement",
    "distort_maps",
    "edge_of_field",
    "fold_angle",
    "fold_radius",
    "ideal_image_radius",
    "image_corner_radius",
    "image_reach",
    "is_rational",
    "jacobian_determinant",
    "pole_radius",
    "remap",
    "undistort_maps",
    "undistorted_intrinsics",
    "valid_region",
    "weakest_denominator",
]

NEARLY_A_POLE = 0.2  # a denominator below which every error of the numerator is multiplied by more than five
WIDEST = tan(radians(80))  # beyond 80° a perspective picture is hardly more than stretch


def fold_radius(lens: Lens) -> float:
    """The ideal radius where a lens's radial equation turns back, unless a pole comes before it.

    Args:
        lens: Any lens.

    Returns:
        In the equation's own variable: r in focal lengths on the plane z = 1, or for a fisheye the angle θ in radians;
        infinity where it never turns back.

    >>> from camviz.lenses import BrownConrady
    >>> round(fold_radius(BrownConrady(-1 / 3)), 6)  # 1 - 3 r²/3 = 0
    1.0
    """
    return lens.fold.radius if lens.fold else inf


def fold_angle(lens: Lens) -> float:
    """The angle between the axis and the ray at which a lens folds.

    Args:
        lens: Any lens.

    Returns: In radians; infinity if it never folds.

    >>> from camviz.lenses import BrownConrady
    >>> f"{np.degrees(fold_angle(BrownConrady(-1 / 3))):.0f}°"  # atan 1
    '45°'
    """
    return lens.fold.angle if lens.fold else inf


def pole_radius(lens: Lens) -> float:
    """The ideal radius where a rational polynomial is infinite, the first positive root of D(r²).

    Args:
        lens: Any lens.

    Returns: In focal lengths; infinity if there is none.

    >>> from camviz.lenses import BrownConrady
    >>> pole_radius(BrownConrady(k4=-0.25))  # 1 - 0.25 r² = 0
    2.0
    """
    return sqrt(first_positive_root(lens.denominator.coef))


def is_rational(lens: Lens) -> bool:
    """Whether a lens's polynomial is divided by another, so that it may have a pole.

    Args:
        lens: Any lens.

    Returns: True where it is divided.

    >>> from camviz.lenses import BrownConrady
    >>> is_rational(BrownConrady(k1=0.1)), is_rational(BrownConrady(k1=0.1, k4=0.1))
    (False, True)
    """
    return bool(np.any(lens.denominator.coef[1:]))


def weakest_denominator(lens: Lens, radius: float) -> tuple[float, float]:
    """Where the denominator D(r²) of a rational polynomial is smallest.

    A D far below 1 is a near-pole: the polynomial has no root there, yet throws the picture about.

    Args:
        lens: Any lens.
        radius: How far to look, in focal lengths.

    Returns:
        r: Where in 0 … `radius` it is smallest, in focal lengths; 0 without a denominator.
        D: The denominator there; 1 without one.

    >>> from camviz.lenses import BrownConrady
    >>> weakest_denominator(BrownConrady(k4=-1, k5=0.5), radius=2)  # 1 - s + s²/2 is smallest at s = 1
    (1.0, 0.5)
    """
    turns = lens.denominator.deriv().roots()
    turns = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0) & (turns.real < radius**2)]
    candidates = np.concatenate([[0.0], turns, [radius**2]])
    values = lens.denominator(candidates)
    return float(np.sqrt(candidates[values.argmin()])), float(values.min())


def edge_of_field(lens: Lens, azimuth: ArrayLike) -> Array:
    """The angle from the axis to the last ray with an image.

    Args:
        lens: Any lens.
        azimuth: (...), directions in radians, from x towards y.

    Returns: (...), angles in radians.

    >>> from camviz.lenses import Orthographic
    >>> np.degrees(edge_of_field(Orthographic(), [0, np.pi / 2])).round(6)
    array([90., 90.])
    """
    azimuth = np.asarray(azimuth, dtype=float)
    low, high = np.zeros(azimuth.shape), np.full(azimuth.shape, pi)
    for _ in range(44):
        middle = (low + high) / 2
        ray = np.stack([np.sin(middle) * np.cos(azimuth), np.sin(middle) * np.sin(azimuth), np.cos(middle)], axis=-1)
        seen = np.isfinite(lens.project(ray)).all(axis=-1)
        low, high = np.where(seen, middle, low), np.where(seen, high, middle)
    return low


def image_corner_radius(intrinsics: Intrinsics) -> float:
    """The distance from the principal point to the farthest corner pixel: a *distorted* radius.

    Args:
        intrinsics: The image.

    Returns: In focal lengths.

    >>> from camviz.cameras import Intrinsics
    >>> image_corner_radius(Intrinsics(601, 801, 500, 500, cx=300, cy=400))  # √(300² + 400²) / 500
    1.0
    """
    corners = intrinsics.from_pixels(_rectangle(intrinsics, 1))
    return float(np.linalg.norm(corners, axis=-1).max())


def ideal_image_radius(camera: Camera) -> float:
    """The largest tan θ of the rays in front of the camera that arrive on the image's border.

    Args:
        camera: With any lens.

    Returns: In focal lengths on the plane z = 1; NaN if there are none.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> ideal_image_radius(Camera(Intrinsics(601, 801, 500, 500, cx=300, cy=400)))  # of a perspective lens: the corner
    1.0
    """
    ideal = _ideal(camera, _rectangle(camera.intrinsics, 16))
    radii = np.linalg.norm(ideal, axis=-1)
    return float(radii[np.isfinite(radii)].max(initial=-inf)) if np.isfinite(radii).any() else np.nan


def image_reach(camera: Camera) -> float:
    """How far an undistorted picture of this camera asks the lens.

    Args:
        camera: With any lens.

    Returns: In focal lengths on the plane z = 1; NaN where nowhere.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> image_reach(Camera(Intrinsics(601, 801, 500, 500, cx=300, cy=400)))
    1.0
    """
    return float(np.nanmax([ideal_image_radius(camera), image_corner_radius(camera.intrinsics)]))


def jacobian_determinant(lens: Lens, xy: ArrayLike) -> Array:
    """The determinant of the map from the plane z = 1 to the image; below 0 it mirrors.

    By the lens's own Jacobian: of `BrownConrady` exact, beyond its fold as well; of most others good to about 1e-9.

    Args:
        lens: Any lens.
        xy: (..., 2), ideal points in focal lengths.

    Returns: (...), how many times as large an area becomes.
    Raises: ValueError where the last axis has not 2 coordinates.

    >>> from camviz.lenses import BrownConrady
    >>> jacobian_determinant(BrownConrady(-1 / 3), [[0, 0], [1, 0], [1.2, 0]]).round(3)  # at 1 it folds
    array([ 1.   ,  0.   , -0.229])
    """
    J = lens.jacobian(xy)
    with np.errstate(all="ignore"):
        return J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]


def valid_region(camera: Camera, step_px: int = 1) -> np.ndarray:
    """At which pixels a ray arrives.

    Args:
        camera: With any lens.
        step_px: Only every so many pixels are asked.

    Returns: (rows, columns) of bool, True where a ray arrives.
    Raises: ValueError for a step below 1.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import Orthographic
    >>> camera = Camera(Intrinsics(401, 401, 100, 100, 200, 200), Orthographic())  # a disc of 100 pixels' radius
    >>> float(valid_region(camera).mean().round(3))  # π 100² / 401²
    0.195
    """
    if not step_px >= 1:
        raise ValueError(f"step_px must be at least 1 pixel, got {step_px}")
    intrinsics = camera.intrinsics
    u, v = (np.arange(0, size, step_px, dtype=float) for size in (intrinsics.width, intrinsics.height))
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    return np.isfinite(camera.lens.unproject(intrinsics.from_pixels(pixels))[..., 0])


def displacement(camera: Camera, step_px: float) -> tuple[Array, Array]:
    """Where a lens puts the points of an undistorted grid.

    The grid is centred on the image; the undistorted picture has the camera's own K.

    Args:
        camera: With any lens.
        step_px: Distance of neighbouring points in pixels.

    Returns:
        ideal: (rows, columns, 2), the grid in pixels.
        moved: (rows, columns, 2), vectors in pixels to where the lens puts the points; NaN where nowhere.

    Raises: ValueError for a step that is not positive.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> camera = Camera(Intrinsics(401, 401, 200, 200, 200, 200), BrownConrady(-0.2))
    >>> ideal, moved = displacement(camera, 100)
    >>> ideal[2, 3], moved[2, 3]  # r = 0.5: -0.2 · 0.5³ · 200 px
    (array([300., 200.]), array([-5.,  0.]))
    """
    if not step_px > 0:
        raise ValueError(f"step_px must be a positive number of pixels, got {step_px}")
    intrinsics = camera.intrinsics
    u, v = (_centred(size, step_px) for size in (intrinsics.width, intrinsics.height))
    ideal = np.stack(np.meshgrid(u, v), axis=-1)
    distorted = intrinsics.to_pixels(camera.lens.project(on_plane(intrinsics.from_pixels(ideal))))
    return ideal, distorted - ideal


def undistort_maps(
    camera: Camera, target: Intrinsics, lens: Lens | None = None, target_from_cam: Rotation | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Where in a photograph the pixels of an undistorted picture lie.

    The forward model is evaluated at every output pixel.

    Args:
        camera: Of the photograph.
        target: Of the picture by the same camera.
        lens: Of that picture; perspective unless given.
        target_from_cam: How the picture is turned.

    Returns:
        map_x: (height, width) of float32, pixels u in the photograph, for `remap`; NaN where it shows nothing.
        map_y: (height, width) of float32, pixels v.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> camera = Camera(Intrinsics(401, 401, 200, 200, 200, 200), BrownConrady(-0.2))
    >>> map_x, map_y = undistort_maps(camera, camera.intrinsics)
    >>> map_x[200, 300], map_y[200, 300]  # see `displacement`
    (np.float32(295.0), np.float32(200.0))
    """
    rays = (lens or Perspective()).unproject(target.from_pixels(target.grid()))
    if target_from_cam is not None:
        rays = rotate(target_from_cam.inv(), rays)
    return _maps(camera.intrinsics.to_pixels(camera.lens.project(rays)))


def distort_maps(camera: Camera, source: Intrinsics, lens: Lens | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Where in an ideal picture the pixels of a camera lie: for showing it as the lens would have bent it.

    Needs the inverse of the lens at every output pixel.

    Args:
        camera: Whose lens bends.
        source: Of the ideal picture.
        lens: Of the ideal picture; perspective unless given.

    Returns:
        map_x: (height, width) of float32, pixels u in the ideal picture, for `remap`; NaN where no ray arrives.
        map_y: (height, width) of float32, pixels v.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> camera = Camera(Intrinsics(401, 401, 200, 200, 200, 200), BrownConrady(-0.2))
    >>> distort_maps(camera, camera.intrinsics)[0][200, 295]  # the other way round
    np.float32(300.0)
    """
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(camera.intrinsics.grid()))
    return _maps(source.to_pixels((lens or Perspective()).project(rays)))


def remap(image: np.ndarray, maps: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The picture whose pixels lie at `maps` in another, bilinear.

    Args:
        image: (height, width) or (height, width, 3), of any type that OpenCV takes, in any unit.
        maps: tuple of (rows, columns) of float32, map_x and map_y in pixels.

    Returns: (rows, columns) or (rows, columns, 3), of the image's type; black where the maps are NaN or lead outside.

    >>> row = np.array([[0, 100, 200]], np.uint8)
    >>> remap(row, (np.float32([[0.5, np.nan]]), np.float32([[0, 0]])))  # halfway between 0 and 100
    array([[50,  0]], dtype=uint8)
    """
    return cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)


def undistorted_intrinsics(camera: Camera, alpha: float) -> tuple[Intrinsics, tuple[int, int, int, int]]:
    """Intrinsics, of the camera's size, for its undistorted picture.

    alpha = 0 shows the largest upright rectangle without black borders, alpha = 1 every pixel of the photograph, and
    between them the focal lengths and principal points are mixed, as in cv2.getOptimalNewCameraMatrix. Rays beyond a
    fold or 80° from the axis are left out.

    Args:
        camera: With any lens.
        alpha: From 0 to 1.

    Returns:
        intrinsics: Of the undistorted picture.
        rectangle: x0, y0, width and height in pixels of what is not black.

    Raises: ValueError for alpha outside 0 … 1 and where no such rectangle exists.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> camera = Camera(Intrinsics(401, 401, 200, 200, 200, 200), BrownConrady(-0.05))
    >>> [round(undistorted_intrinsics(camera, alpha)[0].fx) for alpha in (0, 1)]  # 200 / 1.059, 200 / 1.153
    [189, 173]
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
