"""A distorted picture: what of it is valid, how far its pixels move, and the way there and back. For any lens."""

from __future__ import annotations

import cv2
import numpy as np

from camviz.cameras import Camera, Intrinsics, rotate
from camviz.distortion.limits import WIDEST, border_points, ideal_points
from camviz.lenses import Lens, Perspective
from camviz.lenses.arrays import Share
from camviz.lenses.base import Array, on_plane
from camviz.poses import Rotation


def valid_region(camera: Camera, step_px: int = 1) -> np.ndarray:
    """At which pixels a ray arrives.

    Args:
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


def undistorted_intrinsics(
    camera: Camera, alpha: Share, *, square: bool = False
) -> tuple[Intrinsics, tuple[int, int, int, int]]:
    """Intrinsics, of the camera's size, for its undistorted picture.

    alpha = 0 shows the largest upright rectangle without black borders, alpha = 1 every pixel of the photograph, and
    between them the focal lengths and principal points are mixed, as in cv2.getOptimalNewCameraMatrix. Rays beyond a
    fold or 80° from the axis are left out.

    Args:
        square: Make fx = fy, as no distortion asks for another shape of the pixels. OpenCV's two focal lengths fit the
            rectangle to the picture along each axis; the larger one shows no black, the smaller one every pixel.

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
    filling = [_filling(inner, intrinsics), _filling(outer, intrinsics)]
    if square:
        filling = [
            _centred_on(inner, max(filling[0][:2]), intrinsics),
            _centred_on(outer, min(filling[1][:2]), intrinsics),
        ]
    fx, fy, cx, cy = ((1 - alpha) * filling[0] + alpha * filling[1]).tolist()
    result = Intrinsics(intrinsics.width, intrinsics.height, fx, fy, cx, cy)
    first, last = np.ceil(result.to_pixels(inner[:2]) - 1e-6), np.floor(result.to_pixels(inner[2:]) + 1e-6)
    x0, y0 = (int(value) for value in np.maximum(first, 0))
    x1, y1 = (int(value) for value in np.minimum(last, [intrinsics.width - 1, intrinsics.height - 1]))
    return result, (x0, y0, x1 - x0 + 1, y1 - y0 + 1)


def _filling(rectangle: Array, intrinsics: Intrinsics) -> Array:
    """fx, fy, cx, cy that spread a rectangle (left, top, right, bottom) of the plane z = 1 over the whole picture."""
    focal = (np.array([intrinsics.width, intrinsics.height]) - 1) / (rectangle[2:] - rectangle[:2])
    return np.concatenate([focal, -focal * rectangle[:2]])


def _centred_on(rectangle: Array, focal_length: float, intrinsics: Intrinsics) -> Array:
    """fx, fy, cx, cy of one focal length with a rectangle's centre on the plane z = 1 in the picture's middle."""
    middle = (np.array([intrinsics.width, intrinsics.height]) - 1) / 2
    centre = (rectangle[:2] + rectangle[2:]) / 2
    return np.concatenate([[focal_length, focal_length], middle - focal_length * centre])


def _outline(camera: Camera, samples: int) -> Array:
    """The four sides (4, samples + 1, 2) of what the photograph shows, on the plane z = 1: top, right, bottom, left.

    Where the border itself has no ray, the last point on the way there from the principal point that has one; that
    point must then be in the picture, else ValueError.
    """
    border_px = border_points(camera.intrinsics, samples)
    ideal = ideal_points(camera, border_px)
    if (np.linalg.norm(ideal, axis=-1) < WIDEST).all():
        return ideal
    if not camera.intrinsics.contains(camera.intrinsics.to_pixels([0, 0])):
        raise ValueError("the lens folds or widens before the picture's border, and its axis is not in the picture")
    border = camera.intrinsics.from_pixels(border_px)
    way = np.linspace(0, 1, 129)[:, None, None, None]
    ideal = ideal_points(camera, camera.intrinsics.to_pixels(way * border))
    seen = np.logical_and.accumulate(np.linalg.norm(ideal, axis=-1) < WIDEST, axis=0)
    last = seen.sum(axis=0) - 1
    return np.take_along_axis(ideal, last[None, ..., None], axis=0)[0]


def _centred(size: int, step: float) -> Array:
    count = int((size - 1) // step) + 1
    return np.asarray((size - 1) / 2 + step * (np.arange(count) - (count - 1) / 2), dtype=np.float64)


def _maps(uv: Array) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.moveaxis(uv.astype(np.float32), -1, 0)
    return np.ascontiguousarray(u), np.ascontiguousarray(v)
