"""The standard scenes: one garden, in which every lesson takes its pictures, and the same place as lines.

Metres, x right, y down, z forward: a camera with an identity pose stands 1.25 m above the terrace and looks at it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from camviz.lenses.base import Array
from camviz.photographs import photograph
from camviz.scenes import paint
from camviz.scenes.light import SKYLIGHT, SUN, sunlight, to_linear
from camviz.scenes.scene import Scene
from camviz.scenes.surfaces import Column, Ground, Rectangle, Sphere, Surface, box
from camviz.scenes.texture import Texture
from camviz.scenes.wireframe import Wireframe

FLOOR = 1.25
SQUARE = 0.1
BOARD_COLUMNS, BOARD_ROWS = 9, 6  # inner corners
_BOARD_CORNER = np.array([-1.42, -0.28, 2.75])  # the upper left corner of the first black square
_BOARD_ACROSS = np.array([np.cos(0.42), 0, np.sin(0.42)])
_BOARD_DOWN = np.cross(np.array([-np.sin(0.42), 0.17, np.cos(0.42)]), _BOARD_ACROSS)
_BOARD_DOWN /= np.linalg.norm(_BOARD_DOWN)


def board_corners() -> Array:
    """The 9 × 6 inner corners (54, 3) of the checkerboard in the world, row by row, in metres; squares of 0.1 m."""
    s, r = np.meshgrid(np.arange(1, BOARD_COLUMNS + 1), np.arange(1, BOARD_ROWS + 1))
    return _BOARD_CORNER + SQUARE * (s.reshape(-1, 1) * _BOARD_ACROSS + r.reshape(-1, 1) * _BOARD_DOWN)


@lru_cache(maxsize=1)
def textured_scene() -> Scene:
    """The garden: a calibration board, a crate with a globe, a ball, a brick wall, and columns into the distance."""
    sky = Texture(to_linear(paint.sky()), repeat=True)
    things = [*_board(), *_still_life(), *_colonnade(), *_wall()]
    lawn = Ground(FLOOR + 0.005, Texture(to_linear(paint.lawn()) * float(sunlight((0, -1, 0))), repeat=True), tile=3.2)
    return Scene([*things, _terrace(things), lawn], sky)


def _board() -> list[Surface]:
    margin = SQUARE / 2
    corner = _BOARD_CORNER - margin * (_BOARD_ACROSS + _BOARD_DOWN)
    across = (SQUARE * (BOARD_COLUMNS + 1) + 2 * margin) * _BOARD_ACROSS
    down = (SQUARE * (BOARD_ROWS + 1) + 2 * margin) * _BOARD_DOWN
    picture = Texture(to_linear(paint.checkerboard(BOARD_COLUMNS + 1, BOARD_ROWS + 1)))
    wood = Texture(paint.lit_round(np.full((1, 32, 3), (0.55, 0.36, 0.20)), upright=True))
    back = 0.03 * np.cross(_BOARD_ACROSS, _BOARD_DOWN)
    legs = [corner + down * 0.2 + across * s + back for s in (0.12, 0.88)]
    easel = [Column([x, FLOOR, z], FLOOR - y, 0.018, wood, "easel") for x, y, z in legs]
    return [Rectangle(corner, across, down, picture, name="board"), *easel]


def _still_life() -> list[Surface]:
    wood = Texture(to_linear(paint.planks()))
    crate = box([0.68, FLOOR, 3.3], [0.62, 0.62, 0.62], wood, yaw=0.5, name="crate")
    globe = Sphere([0.68, FLOOR - 0.62 - 0.27, 3.3], 0.27, Texture(paint.lit_round(paint.globe())), "globe")
    ball = Sphere([0.08, FLOOR - 0.15, 2.65], 0.15, Texture(paint.lit_round(paint.beach_ball())), "ball")
    return [ball, globe, *crate]


def _colonnade() -> list[Surface]:
    stone = np.clip(0.86 + 0.03 * paint.noise(64, 64, 16, seed=4), 0, 1)[..., None] * [1.0, 0.97, 0.91]
    shaft, finial = Texture(paint.lit_round(stone, upright=True)), Texture(paint.lit_round(stone))
    surfaces: list[Surface] = []
    for z in 3.4 + 1.9 * np.arange(9):
        surfaces.append(Column([1.95, FLOOR, z], 1.7, 0.1, shaft))
        surfaces.append(Sphere([1.95, FLOOR - 1.7 - 0.11, z], 0.15, finial, "column"))
    return surfaces


def _wall() -> list[Surface]:
    bricks = Texture(to_linear(paint.bricks()), repeat=True)
    cat = paint.framed(photograph("chelsea") / 255)
    picture = Rectangle([-0.75, -0.65, 6.47], [1.35, 0, 0], [0, 0.95, 0], Texture(to_linear(cat)), name="picture")
    return [picture, *box([-1.5, FLOOR, 6.65], [5.2, 2.5, 0.3], bricks, tile=1.7, name="wall")]


def _terrace(things: list[Surface]) -> Rectangle:
    """Flagstones with the shadows of the things that stand on them."""
    corner, across, down = np.array([-4.5, FLOOR, 9.0]), np.array([7.5, 0, 0]), np.array([0, 0, -12.0])
    light = to_linear(paint.paving(15, 24, texels=40))
    height, width = light.shape[:2]
    s, r = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    points = corner + s[None, :, None] * across + r[:, None, None] * down
    _, depth = Scene(things).trace(points, SUN / np.linalg.norm(SUN))
    lit = np.isnan(depth).astype(float)
    share = SKYLIGHT + (float(sunlight((0, -1, 0))) - SKYLIGHT) * lit
    return Rectangle(corner, across, down, Texture(light * share[..., None]), name="terrace")


def wireframe_scene() -> Wireframe:
    """A house, a grid on the ground every metre, a board and the world's axes of one metre, as named lines.

    Names: "ground", "house", "board", and "axis x", "axis y", "axis z".
    """
    raise NotImplementedError
