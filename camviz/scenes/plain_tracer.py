"""The simplest tracer: every ray against every surface, the nearest one is seen.

`camviz.scenes.render` gives the same picture several times sooner: it cuts the picture into tiles, rules whole tiles
out, and lets alike surfaces be met together (`camviz.scenes.rays`, `camviz.scenes.batched`).
"""

from __future__ import annotations

import numpy as np

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.scenes.intersection import Hit
from camviz.scenes.scene import NEUTRAL, Scene
from camviz.scenes.surfaces import on_sphere


def render_plainly(scene: Scene, camera: Camera) -> Array:
    """The picture (height, width, 3) that the camera takes: linear light, without averaging over a pixel.

    A ray that meets nothing sees the sky. A pixel that has no ray, as beyond a lens's domain, is NEUTRAL grey.
    """
    pixels = camera.intrinsics
    rows, columns = np.mgrid[: pixels.height, : pixels.width]
    directions = camera.unproject(np.stack([columns.ravel(), rows.ravel()], axis=-1)).T
    seen = np.isfinite(directions).all(axis=0)
    light = np.full((directions.shape[1], 3), NEUTRAL)
    light[seen] = _light(scene, camera.centre[:, None], directions[:, seen])
    return light.reshape(pixels.height, pixels.width, 3)


def _light(scene: Scene, origin: Array, directions: Array) -> Array:
    """The linear light (n, 3) that arrives at `origin` (3, 1) along the rays `directions` (3, n)."""
    light, distance = _sky(scene, directions), np.full(directions.shape[1], np.inf)
    for surface in scene.surfaces:
        with np.errstate(divide="ignore", invalid="ignore"):  # a ray that passes the surface by has no distance to it
            at = surface.intersect(origin, directions.astype(np.float32))
        nearer = at.depth < distance
        if not nearer.any():
            continue
        distance[nearer] = at.depth[nearer]
        light[nearer] = surface.radiance(Hit(at.depth[nearer], at.place[:, nearer]), 0.0)[:, :3]
    return light


def _sky(scene: Scene, directions: Array) -> Array:
    """The sky's light (n, 3): a picture around everything, infinitely far away."""
    x, y, z = directions
    s, r = on_sphere(x.astype(np.float32), y.astype(np.float32), -z.astype(np.float32))
    whole = scene.sky.width / 2 / scene.sky.height  # the sky's picture may end before the nadir
    return np.array(scene.sky.sample(s, np.minimum(r * whole, 1 - 0.5 / scene.sky.height), 0.0)[:, :3], dtype=float)
