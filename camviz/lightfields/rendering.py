"""The virtual light field camera: the garden photographed from every place of an aperture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.lightfields.field import LightField
from camviz.poses import RigidTransform
from camviz.scenes import Scene, render, snapshot


def photograph_field(
    scene: Scene,
    camera: Camera,
    rows: int,
    columns: int,
    baseline: float,
    focus_distance: float,
    *,
    encoded: bool = False,
    supersample: int = 1,
) -> LightField:
    """The light field of a scene around a camera, whose centre is the middle of the aperture.

    Args:
        camera: With a perspective lens.
        rows, columns: Of the grid of views, at least 1 each.
        baseline, focus_distance: In metres, as of `LightField`.
        encoded: Whether the views are sRGB bytes, a quarter of the memory, instead of linear light as float32.
        supersample: Rays along each side of a pixel, as of `render`; for linear light only.

    Returns: Its views are read-only.
    Raises: ValueError when there is no view at all, and for a lens that bends.

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> from camviz.scenes import textured_scene
    >>> camera = Camera(Intrinsics.from_fov(64, 48, 60))
    >>> photograph_field(textured_scene(), camera, 3, 3, baseline=0.05, focus_distance=3.0).views.shape
    (3, 3, 48, 64, 3)
    """
    if rows < 1 or columns < 1:
        raise ValueError(f"rows and columns must be at least 1, got {rows} and {columns}")
    if camera.lens.is_distorted:
        raise ValueError(f"camera must have a perspective lens, got {type(camera.lens).__name__}")
    pixels = camera.intrinsics
    kind = np.uint8 if encoded else np.float32
    views: NDArray[np.generic] = np.empty((rows, columns, pixels.height, pixels.width, 3), kind)
    field = LightField(views, baseline, pixels.fx, focus_distance)
    for v, u, moved in _cameras(field, camera):
        views[v, u] = snapshot(scene, moved) if encoded else render(scene, moved, supersample)
    views.flags.writeable = False
    return field


def true_disparity(scene: Scene, camera: Camera, field: LightField) -> NDArray[np.float32]:
    """The disparity of what the middle of the aperture sees, traced.

    Args:
        camera: That of the field.
        field: Its baseline, focal length and focus distance count.

    Returns: (height, width), in pixels a view, float32; the sky's is that of infinity.

    A wall 1 m away moves by 0.05 m · 100 px (1/1 − 1/2) / m = 2.5 pixels:

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> from camviz.scenes import Rectangle, Scene, Texture
    >>> wall = Rectangle((-5, -5, 1), (10, 0, 0), (0, 10, 0), Texture.plain((1, 1, 1)))
    >>> field = LightField(np.zeros((3, 3, 2, 3, 3)), baseline=0.05, focal_length=100, focus_distance=2)
    >>> true_disparity(Scene([wall]), Camera(Intrinsics(3, 2, 100, 100, 1, 0.5)), field).round(3)
    array([[2.5, 2.5, 2.5],
           [2.5, 2.5, 2.5]], dtype=float32)
    """
    rays = camera.rays()
    _, distance = scene.trace(camera.centre, rays)
    depth = np.where(np.isnan(distance), np.inf, distance) * (rays @ camera.world_from_cam.as_matrix()[:3, 2])
    return field.disparity(depth).astype(np.float32)


def disparity_of_views(scene: Scene, camera: Camera, field: LightField) -> NDArray[np.float32]:
    """The disparity of what each view of a field sees, traced.

    Args:
        camera: That of the field.
        field: Its places, focal length and focus distance count.

    Returns: (v, u, height, width), in pixels a view, float32.

    From all places a wall that faces the camera has the same disparity, 2.5 pixels as in `true_disparity`:

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> from camviz.scenes import Rectangle, Scene, Texture
    >>> wall = Rectangle((-5, -5, 1), (10, 0, 0), (0, 10, 0), Texture.plain((1, 1, 1)))
    >>> field = LightField(np.zeros((3, 3, 2, 3, 3)), baseline=0.05, focal_length=100, focus_distance=2)
    >>> seen = disparity_of_views(Scene([wall]), Camera(Intrinsics(3, 2, 100, 100, 1, 0.5)), field)
    >>> seen.shape, np.unique(seen.round(3)).tolist()
    ((3, 3, 2, 3), [2.5])
    """
    return np.stack([true_disparity(scene, moved, field) for _, _, moved in _cameras(field, camera)]).reshape(
        field.views.shape[:4]
    )


def _cameras(field: LightField, camera: Camera) -> Iterator[tuple[int, int, Camera]]:
    """Every place of the grid, and the camera that stands there.

    Its principal point moves by f s / z_focus when it moves by s: a point at z_focus keeps its pixel.
    """
    pixels = camera.intrinsics
    for v, below in enumerate(field.baseline * field.steps()[0]):
        for u, beside in enumerate(field.baseline * field.steps()[1]):
            cx = pixels.cx + pixels.fx * beside / field.focus_distance
            cy = pixels.cy + pixels.fy * below / field.focus_distance
            pose = camera.world_from_cam * RigidTransform.from_translation([beside, below, 0])
            yield v, u, replace(camera, intrinsics=replace(pixels, cx=cx, cy=cy), world_from_cam=pose)
