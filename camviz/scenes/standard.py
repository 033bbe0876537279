"""The standard scenes: one garden, in which every lesson takes its pictures, and the same place as lines.

Metres, x right, y down, z forward: a camera with an identity pose stands 1.25 m above the terrace and looks at it.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.scenes import paint
from camviz.scenes.light import to_linear
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
    """The 9 × 6 inner corners of the garden's checkerboard, whose squares are 0.1 m wide.

    Returns: (54, 3), in the world, in metres, row by row.

    Nine corners on, one row down, is one square away:

    >>> corners = board_corners()
    >>> corners.shape, np.linalg.norm(corners[9] - corners[0]).round(6)
    ((54, 3), np.float64(0.1))
    """
    s, r = np.meshgrid(np.arange(1, BOARD_COLUMNS + 1), np.arange(1, BOARD_ROWS + 1))
    return _BOARD_CORNER + SQUARE * (s.reshape(-1, 1) * _BOARD_ACROSS + r.reshape(-1, 1) * _BOARD_DOWN)


@lru_cache(maxsize=1)
def textured_scene() -> Scene:
    """The garden: a calibration board, a crate with a globe, a ball, a brick wall, and lamps into the distance.

    Always the same one; y points down, in metres.

    Straight ahead of the origin hangs a picture, on a wall 6.5 m away:

    >>> textured_scene().trace((0, 0, 0), (0, 0, 1))[1].round(1)
    np.float32(6.5)
    """
    terrace = Rectangle(*terrace_edges(), baked("terrace"), name="terrace")
    lawn = Ground(FLOOR + 0.005, baked("lawn", repeat=True), tile=3.2, haze=to_linear(paint.HILLS), sight=90)
    return Scene([*things(), terrace, lawn], baked("sky", repeat=True))


def baked(name: str, repeat: bool = False) -> Texture:
    """One of the pictures that `camviz.scenes.bake` has painted."""
    return Texture(opened(name), repeat)


def opened(name: str) -> NDArray[np.uint8]:
    """Such a picture as sRGB bytes (height, width, 3)."""
    data = np.frombuffer((files("camviz.scenes") / "pictures" / f"{name}.jpg").read_bytes(), dtype=np.uint8)
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)[..., ::-1]


def terrace_edges() -> tuple[Array, Array, Array]:
    """The terrace's corner, and its edges across and down its texture."""
    return np.array([-4.5, FLOOR, 9.0]), np.array([7.5, 0, 0]), np.array([0, 0, -12.0])


def things() -> list[Surface]:
    """The surfaces that stand on the terrace and throw shadows on it."""
    return [*_board(), *_still_life(), *_lamps(), *_wall()]


def _board() -> list[Surface]:
    margin = SQUARE / 2
    corner = _BOARD_CORNER - margin * (_BOARD_ACROSS + _BOARD_DOWN)
    across = (SQUARE * (BOARD_COLUMNS + 1) + 2 * margin) * _BOARD_ACROSS
    down = (SQUARE * (BOARD_ROWS + 1) + 2 * margin) * _BOARD_DOWN
    picture = Texture(paint.checkerboard(BOARD_COLUMNS + 1, BOARD_ROWS + 1))
    wood = Texture(paint.lit_round(paint.plain(1, 32, (0.55, 0.36, 0.20)), upright=True))
    back = 0.03 * np.cross(_BOARD_ACROSS, _BOARD_DOWN)
    legs = [corner + down * 0.2 + across * s + back for s in (0.12, 0.88)]
    easel = [Column(np.array([x, FLOOR, z]), FLOOR - y, 0.018, wood, "easel") for x, y, z in legs]
    return [Rectangle(corner, across, down, picture, name="board"), *easel]


def _still_life() -> list[Surface]:
    crate = box([0.68, FLOOR, 3.3], [0.62, 0.62, 0.62], baked("planks"), yaw=0.5, name="crate")
    globe = Sphere(np.array([0.68, FLOOR - 0.62 - 0.27, 3.3]), 0.27, baked("globe"), "globe")
    ball = Sphere(np.array([0.13, FLOOR - 0.16, 3.0]), 0.16, Texture(paint.lit_round(paint.beach_ball())), "ball")
    clay = Texture(paint.lit_round(paint.plain(1, 32, (0.74, 0.42, 0.28)), upright=True))
    pot = Column(np.array([1.42, FLOOR, 4.7]), 0.36, 0.2, clay, "pot")
    bush = Sphere(np.array([1.42, FLOOR - 0.58, 4.7]), 0.33, baked("leaves"), "bush")
    return [ball, globe, *crate, bush, pot]


def _lamps() -> list[Surface]:
    iron = Texture(paint.lit_round(paint.plain(1, 32, (0.20, 0.25, 0.27)), upright=True))
    glass = Texture(paint.lit_round(paint.plain(32, 64, (0.98, 0.96, 0.90))))
    surfaces: list[Surface] = []
    for z in 3.5 + 1.9 * np.arange(9):
        surfaces.append(Sphere(np.array([2.05, FLOOR - 1.95, z]), 0.17, glass, "lamp"))
        surfaces.append(Column(np.array([2.05, FLOOR, z]), 1.80, 0.045, iron, "lamp"))
    return surfaces


def _wall() -> list[Surface]:
    corner, across, down = np.array([[-0.75, -0.65, 6.47], [1.35, 0, 0], [0, 0.95, 0]])
    picture = Rectangle(corner, across, down, baked("cat"), name="picture")
    coping = box([-1.5, FLOOR - 2.5, 6.65], [5.3, 0.09, 0.4], Texture.plain((0.86, 0.82, 0.75)), name="wall")
    return [
        picture,
        *coping,
        *box([-1.5, FLOOR, 6.65], [5.2, 2.5, 0.3], baked("bricks", repeat=True), tile=2.4, name="wall"),
    ]


@lru_cache(maxsize=1)
def wireframe_scene() -> Wireframe:
    """A house on a ground grid of one metre, the garden's board, and the world's axes, one metre each, as lines.

    Returns:
        Its names are "ground", "house", "board", "axis x", "axis y" and "axis z". Every line is straight between its
        points.

    >>> wireframe_scene().only("axis x").lines
    (array([[0., 0., 0.],
            [1., 0., 0.]]),)
    """
    return _grid() + _house() + _board_lines() + _axes()


def _grid(x_reach: float = 4.0, z_reach: float = 10.0) -> Wireframe:
    along = [[[x, FLOOR, 0], [x, FLOOR, z_reach]] for x in np.arange(-x_reach, x_reach + 1)]
    across = [[[-x_reach, FLOOR, z], [x_reach, FLOOR, z]] for z in np.arange(z_reach + 1)]
    return _named("ground", *along, *across)


def _house(width: float = 2.0, wall: float = 1.3, ridge: float = 2.1, depth: float = 2.4) -> Wireframe:
    """Two gables, the eaves and the ridge that join them, a door and a window; its door stands at (0.9, FLOOR, 4.5)."""
    middle, front = 0.9, 4.5
    outline = np.array([[-1, 0], [-1, wall], [0, ridge], [1, wall], [1, 0], [-1, 0]]) * [width / 2, 1]
    gables = [[[middle + x, FLOOR - y, z] for x, y in outline] for z in (front, front + depth)]
    beams = [[near, far] for near, far in zip(*gables, strict=True)][:-1]
    door = [[middle + x, FLOOR - y, front] for x, y in [(-0.7, 0), (-0.7, 0.95), (-0.2, 0.95), (-0.2, 0)]]
    frame = [(0.15, 0.45), (0.15, 0.95), (0.7, 0.95), (0.7, 0.45), (0.15, 0.45)]
    window = [[middle + x, FLOOR - y, front] for x, y in frame]
    return _named("house", *gables) + _named("house", *beams) + _named("house", door, window)


def _board_lines() -> Wireframe:
    columns, rows = BOARD_COLUMNS + 1, BOARD_ROWS + 1
    ends = [((0, r), (columns, r)) for r in range(rows + 1)] + [((s, 0), (s, rows)) for s in range(columns + 1)]
    return _named("board", *(SQUARE * (np.array(e) @ [_BOARD_ACROSS, _BOARD_DOWN]) + _BOARD_CORNER for e in ends))


def _axes() -> Wireframe:
    x, y, z = (_named(f"axis {name}", [[0, 0, 0], tip]) for name, tip in zip("xyz", np.eye(3), strict=True))
    return x + y + z


def _named(name: str, *lines: Any) -> Wireframe:
    return Wireframe(tuple(np.asarray(line, dtype=float) for line in lines), (name,) * len(lines))
