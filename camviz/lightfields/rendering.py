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
    """The light field of a scene around a camera with a perspective lens: its centre is the middle of the aperture.

    `baseline` and `focus_distance` are in metres. Linear light as float32, or with `encoded` sRGB bytes, a quarter of
    the memory. `supersample` is that of `render`, for linear light. Raises ValueError when there is no view at all.
    """
    if rows < 1 or columns < 1:
        raise ValueError(f"rows and columns must be at least 1, got {rows} and {columns}")
    pixels = camera.intrinsics
    kind = np.uint8 if encoded else np.float32
    views: NDArray[np.generic] = np.empty((rows, columns, pixels.height, pixels.width, 3), kind)
    field = LightField(views, baseline, pixels.fx, focus_distance)
    for v, u, moved in _cameras(field, camera):
        views[v, u] = snapshot(scene, moved) if encoded else render(scene, moved, supersample)
    views.flags.writeable = False
    return field


def true_disparity(scene: Scene, camera: Camera, field: LightField) -> NDArray[np.float32]:
    """The disparity (height, width) of what the middle of the aperture sees, traced; the sky's is that of infinity."""
    rays = camera.rays()
    _, distance = scene.trace(camera.centre, rays)
    depth = np.where(np.isnan(distance), np.inf, distance) * (rays @ camera.world_from_cam.as_matrix()[:3, 2])
    return field.disparity(depth).astype(np.float32)


def disparity_of_views(scene: Scene, camera: Camera, field: LightField) -> NDArray[np.float32]:
    """The disparity (v, u, height, width) of what each view of the field sees, traced."""
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
