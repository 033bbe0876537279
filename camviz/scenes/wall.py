"""A wall of the garden from near: its coping runs along the upper border of a picture, where a lens bends most."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from camviz.scenes import paint
from camviz.scenes.scene import Scene
from camviz.scenes.standard import FLOOR, baked
from camviz.scenes.surfaces import Column, Ground, Rectangle, Sphere, Surface, box
from camviz.scenes.texture import Texture

WALL = 2.4
"""Metres from the camera at the origin to the wall."""

COPING = 1.2
"""Metres by which the coping's lower edge is above the camera."""

LAMP = (1.02, -0.40, 1.85)
"""The middle of the lamp's glass."""


@lru_cache(maxsize=1)
def wall_scene() -> Scene:
    """The garden's wall, 2.4 m away and square to a camera at the origin, with a lamp, a picture and a ball before it.

    Always the same one; y points down, in metres.

    A camera that sees 90° across sees the wall from border to border, and the coping above it:

    >>> wall_scene().trace((0, 0, 0), np.array([0, -0.52, 1]) / np.hypot(0.52, 1))[1].round(1)
    np.float32(2.6)
    """
    lawn = Ground(FLOOR + 0.005, baked("lawn", repeat=True), tile=3.2)
    terrace = Rectangle(np.array([-6.0, FLOOR, WALL]), np.array([12.0, 0, 0]), np.array([0, 0, -5.0]), baked("terrace"))
    return Scene([*_before_it(), *_wall(), terrace, lawn], baked("sky", repeat=True))


def _wall() -> list[Surface]:
    across = 4 * WALL  # as far as a bent picture of 90° reaches
    bricks = box([0.0, FLOOR, WALL + 0.15], [across, FLOOR + COPING, 0.3], baked("bricks", repeat=True), tile=1.6)
    coping = box([0.0, -COPING, WALL + 0.15], [across, 0.09, 0.4], Texture.plain((0.86, 0.82, 0.75)))
    return [*coping, *bricks]


def _before_it() -> list[Surface]:
    iron = Texture(paint.lit_round(paint.plain(1, 32, (0.20, 0.25, 0.27)), upright=True))
    glass = Texture(paint.lit_round(paint.plain(32, 64, (0.98, 0.96, 0.90))))
    x, y, z = LAMP
    lamp = [Sphere(np.array(LAMP), 0.12, glass, "lamp"), Column(np.array([x, FLOOR, z]), FLOOR - y, 0.03, iron, "lamp")]
    corner, right, down = np.array([[-0.66, -0.62, WALL - 0.02], [1.1, 0, 0], [0, 0.78, 0]])
    picture = Rectangle(corner, right, down, baked("cat"), name="picture")
    ball = Sphere(np.array([-1.0, FLOOR - 0.2, 2.0]), 0.2, Texture(paint.lit_round(paint.beach_ball())), "ball")
    return [*lamp, picture, ball]
