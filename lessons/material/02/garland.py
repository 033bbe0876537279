"""What the depth-of-field visualizer photographs: the garden and its globe, with a garland of lamps before the wall."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from camviz.scenes import Rectangle, Scene, Texture, textured_scene

GLOBE_Z = 3.3  # of the globe in the world, towards which the camera looks along +z
STAND = (0.58, 0.45)  # x and y of the camera
GLOBE_M = 0.54  # the globe's diameter


@lru_cache(maxsize=1)
def garden_with_lamps() -> Scene:
    """The garden with a garland of lamps before its wall: points of light, which show the aperture's shape."""
    garden, glow, side = textured_scene(), Texture.plain((1.0, 0.9, 0.72)), 0.036
    lights = [
        Rectangle(np.array([x, y, 6.3]), np.array([side, 0, 0]), np.array([0, side, 0]), glow, shade=20, name="garland")
        for x, y in zip(np.linspace(-1.5, 0.94, 6), [-0.62, -0.72, -0.86, -0.74, -0.7, -0.84], strict=True)
    ]
    return Scene([*lights, *garden.surfaces], garden.sky)
