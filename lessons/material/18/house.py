"""The house that lesson 18 photographs, its edges and its door, known to the millimetre, and a camera before it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw.picture import jpeg
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import Column, Ground, Rectangle, Scene, Sphere, Texture, box, paint, snapshot
from camviz.scenes.standard import baked

WIDTH, HEIGHT = 640, 480  # of its photographs
EYE = 1.6  # metres from the ground to the camera, which is at y = 0
DOOR = 2.0  # its height, and that of the windows' upper edges
HEADING_DEG = -42.0  # the camera's turn in which both walls are seen alike
_LEFT, _RIGHT, _NEAR, _FAR, _TALL = -10.0, -3.0, 3.3, 10.3, 2.9
LAMPS = -1.2, (5.0, 7.5, 10.0, 12.5)  # their x, and z of each
DOOR_EDGE = np.array([[_RIGHT, EYE, 4.6], [_RIGHT, EYE - DOOR, 4.6]])
"""Foot and top of the nearer side of the door."""


def edges() -> dict[str, Array]:
    """Two edges of the house each (2, 2, 3) along x, along z and upright."""
    base, top = EYE, EYE - _TALL
    return {
        "x": np.array([[[_RIGHT, y, _NEAR], [_LEFT, y, _NEAR]] for y in (top, base)]),
        "z": np.array([[[_RIGHT, y, _NEAR], [_RIGHT, y, _FAR]] for y in (top, base)]),
        "up": np.array([[[x, base, z], [x, top, z]] for x, z in ((_LEFT, _NEAR), (_RIGHT, _FAR))]),
    }


def camera(turn_deg: float = 0.0, tilt_deg: float = 0.0, hfov_deg: float = 75.0, aside: float = 0.0) -> Camera:
    """A camera turned to the right and tilted upwards from where it sees the corner, and `aside` to the right."""
    turned = Rotation.from_euler("YX", [HEADING_DEG + turn_deg, tilt_deg], degrees=True)
    right = Rotation.from_euler("Y", HEADING_DEG, degrees=True).apply([aside, 0.0, 0.0])
    return Camera(
        Intrinsics.from_fov(WIDTH, HEIGHT, hfov_deg), world_from_cam=RigidTransform.from_components(right, turned)
    )


def photographed(camera: Camera, side: int) -> tuple[np.ndarray, bytes]:
    """The picture that the camera takes of the house, `side` pixels wide, uint8 RGB, and it as JPEG."""
    return _taken(camera.intrinsics.within(side), tuple(camera.world_from_cam.as_matrix().ravel().tolist()))


@lru_cache(maxsize=4)
def _taken(pixels: Intrinsics, pose: tuple[float, ...]) -> tuple[np.ndarray, bytes]:
    placed = RigidTransform.from_matrix(np.reshape(pose, (4, 4)))
    image = snapshot(house_scene(), Camera(pixels, world_from_cam=placed))
    image.flags.writeable = False
    return image, jpeg(image)


@lru_cache(maxsize=1)
def house_scene() -> Scene:
    """A house of bricks with a door and windows, a path along it and lamps of one height."""
    middle = (_LEFT + _RIGHT) / 2, EYE, (_NEAR + _FAR) / 2
    across, deep = _RIGHT - _LEFT, _FAR - _NEAR
    wall = box(middle, (across, _TALL - 0.22, deep), baked("bricks", repeat=True), tile=1.6, name="wall")
    roof = (middle[0], EYE - _TALL + 0.22, middle[2]), (across, 0.22, deep)
    stone = box(*roof, Texture.plain((0.90, 0.87, 0.80)), name="roof")
    path = Rectangle((_RIGHT, EYE, _FAR), (1.2, 0, 0), (0, 0, -9.0), Texture(paint.paving(3, 22, 16)), name="path")
    lawn = Ground(EYE + 0.004, baked("lawn", repeat=True), tile=3.2)
    return Scene([*_lamps(), *_openings(), *stone, *wall, path, lawn], baked("sky", repeat=True))


def _openings() -> list[Rectangle]:
    """The door and two windows in the wall on the right, three windows in the one on the left."""
    glass, top = Texture(_window()), EYE - DOOR
    x, z = _RIGHT + 0.01, _NEAR - 0.01
    door = Rectangle((x, top, 4.6), (0, 0, 1.0), (0, DOOR, 0), baked("planks"), name="door")
    on_right = [Rectangle((x, top, at), (0, 0, 1.3), (0, 1.1, 0), glass, name="window") for at in (6.5, 8.5)]
    on_left = [Rectangle((at, top, z), (1.3, 0, 0), (0, 1.1, 0), glass, name="window") for at in (-4.7, -6.7, -8.7)]
    return [door, *on_right, *on_left]


def _window() -> np.ndarray:
    frame = np.full((44, 52, 3), 235, np.uint8)
    frame[4:40, 4:24] = frame[4:40, 28:48] = (58, 78, 98)
    return frame


def _lamps() -> list[Column | Sphere]:
    iron = Texture(paint.lit_round(paint.plain(1, 32, (0.20, 0.25, 0.27)), upright=True))
    glass = Texture(paint.lit_round(paint.plain(32, 64, (0.98, 0.96, 0.90))))
    x, depths = LAMPS
    posts = [Column((x, EYE, z), 2.2, 0.04, iron, "lamp") for z in depths]
    return [*(Sphere((x, EYE - 2.33, z), 0.15, glass, "lamp") for z in depths), *posts]
