"""The garden as a light field: what the visualizer shows, rendered once, and what it measures there, measured once."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.draw.picture import jpeg
from camviz.lightfields import LightField, Openings, disparity_by_sweep, photograph_field, to_mosaic, true_disparity
from camviz.poses import RigidTransform
from camviz.scenes import Rectangle, Scene, Texture, textured_scene, to_display

VIEWS = 9
CAMERA = Camera(Intrinsics.from_fov(160, 120, 38), world_from_cam=RigidTransform.from_translation([0.15, 0.55, 0]))
BASELINE = 0.056  # metres: the whole aperture is half a metre wide, and the garden's slopes a few pixels
FOCUS_DISTANCE = 4.0
FENCE_DISTANCE = 2.0
SLOPES = (-3.24, 3.6)  # pixels a view: from the sky to before the fence
STEP = 0.15

Floats = NDArray[np.float32]


def garden_field(fence: bool = False) -> LightField:
    """9 × 9 views of the garden, 160 × 120 pixels each, as sRGB bytes; with a fence of slats two metres away."""
    return _garden_field(fence)


@lru_cache(maxsize=2)
def _garden_field(fence: bool) -> LightField:
    return photograph_field(garden(fence), CAMERA, VIEWS, VIEWS, BASELINE, FOCUS_DISTANCE, encoded=True)


@lru_cache(maxsize=2)
def _openings(fence: bool) -> Openings:
    return Openings(garden_field(fence), garden(fence), CAMERA)


@lru_cache(maxsize=1)
def opened_field(fence: bool, width: float) -> LightField:
    """The garden's field through openings of a `width`, 0 … 1 of the distance between the places of the lens."""
    return _openings(fence).opened(width)


def garden(fence: bool = False) -> Scene:
    """The garden, or the garden behind a fence."""
    plain = textured_scene()
    return Scene([*_slats(), *plain.surfaces], plain.sky) if fence else plain


def _slats(width: float = 0.02) -> list[Rectangle]:
    """Unevenly spaced: an even fence looks like a farther one that moved by a slat."""
    paint = Texture.plain((0.55, 0.50, 0.42))
    upright, across = np.array([0.0, 3.0, 0.0]), np.array([width, 0, 0])
    corner = CAMERA.centre + (0, -1.5, FENCE_DISTANCE)
    places = -1.2 + np.cumsum(np.random.default_rng(4).uniform(0.08, 0.16, 20))
    return [Rectangle(corner + (x, 0, 0), across, upright, paint, name="fence") for x in places]


@lru_cache(maxsize=2)
def true_slopes(fence: bool = False) -> Floats:
    """The disparity (height, width) of what the middle view sees, traced."""
    return true_disparity(garden(fence), CAMERA, garden_field(fence))


@lru_cache(maxsize=2)
def measured_slopes(field: LightField, low: float, high: float) -> Floats:
    """The disparity (height, width) between `low` and `high` as the views tell it."""
    tried = np.arange(low - STEP, high + 2 * STEP, max(STEP, (high - low) / 60))
    if field.rows < 5 or field.columns < 5 or field.rows % 4 != 1 or field.columns % 4 != 1:
        return disparity_by_sweep(field, tried)
    every_other = LightField(field.views[::2, ::2])  # with the same middle, and a quarter of the work
    return disparity_by_sweep(every_other, 2 * tried) * np.float32(0.5)


@lru_cache(maxsize=2)
def all_views(field: LightField, width: int = 424) -> bytes:
    """The views side by side, small, as JPEG."""
    import cv2

    small = max(4, width // field.columns), max(3, round(width / field.columns * field.height / field.width))
    views = np.array([[cv2.resize(one, small, interpolation=cv2.INTER_AREA) for one in row] for row in field.views])
    return jpeg(to_mosaic(views if views.dtype == np.uint8 else to_display(views)), quality=70)
