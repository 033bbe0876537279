"""The house that lesson 18 photographs, its edges and its door, known to the millimetre, and a camera before it."""

from functools import lru_cache

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw.picture import jpeg
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import Column, Ground, Rectangle, Scene, Sphere, Texture, box, paint, snapshot
from camviz.scenes.standard import baked
from camviz.views.garden import DRAFT, FINE

WIDTH, HEIGHT = 640, 480  # of its photographs
EYE = 1.6  # metres from the ground to the camera, which is at y = 0
DOOR = 2.0  # its height
HEADING_DEG = -42.0  # the camera's turn in which both walls are seen alike
_LEFT, _RIGHT, _NEAR, _FAR, _TOP = -10.0, -3.0, 3.3, 10.3, EYE - 2.9
DOOR_EDGE = np.array([[_RIGHT, EYE, 4.6], [_RIGHT, EYE - DOOR, 4.6]])
"""Foot and top of the nearer side of the door."""


def edges() -> dict[str, Array]:
    """Two edges of the house each (2, 2, 3) along x, along z and upright."""
    corner, left, far = (_RIGHT, _NEAR), (_LEFT, _NEAR), (_RIGHT, _FAR)
    level = {"x": (corner, left), "z": (corner, far)}
    found = {name: [[(x, y, z) for x, z in ends] for y in (_TOP, EYE)] for name, ends in level.items()}
    found["up"] = [[(x, EYE, z), (x, _TOP, z)] for x, z in (left, far)]
    return {name: np.array(both) for name, both in found.items()}


def camera(turn_deg: float = 0.0, tilt_deg: float = 0.0, hfov_deg: float = 75.0, aside: float = 0.0) -> Camera:
    """A camera turned to the right and tilted upwards from where it sees the corner, and `aside` to the right."""
    turned = Rotation.from_euler("YX", [HEADING_DEG + turn_deg, tilt_deg], degrees=True)
    place = Rotation.from_euler("Y", HEADING_DEG, degrees=True).apply([aside, 0.0, 0.0])
    return Camera(
        Intrinsics.from_fov(WIDTH, HEIGHT, hfov_deg), world_from_cam=RigidTransform.from_components(place, turned)
    )


def photographed(camera: Camera, draft: bool) -> bytes:
    """The picture that the camera takes of the house, as JPEG."""
    pose = tuple(camera.world_from_cam.as_matrix().ravel().tolist())
    return _taken(camera.intrinsics.within(DRAFT if draft else FINE), pose)


@lru_cache(maxsize=4)
def _taken(pixels: Intrinsics, pose: tuple[float, ...]) -> bytes:
    placed = RigidTransform.from_matrix(np.reshape(pose, (4, 4)))
    return jpeg(snapshot(house_scene(), Camera(pixels, world_from_cam=placed)))


@lru_cache(maxsize=1)
def house_scene() -> Scene:
    """A house of bricks with a door and windows, a path along it and lamps of one height."""
    middle, across, deep = ((_LEFT + _RIGHT) / 2, EYE, (_NEAR + _FAR) / 2), _RIGHT - _LEFT, _FAR - _NEAR
    wall = box(middle, (across, EYE - _TOP - 0.22, deep), baked("bricks", repeat=True), tile=1.6)
    roof = box((middle[0], _TOP + 0.22, middle[2]), (across, 0.22, deep), Texture.plain((0.90, 0.87, 0.80)))
    path = Rectangle(_at(_RIGHT, EYE, _FAR), _at(1.2, 0, 0), _at(0, 0, -9), Texture(paint.paving(3, 22, 16)))
    lawn = Ground(EYE + 0.004, baked("lawn", repeat=True), tile=3.2)
    return Scene([*_lamps(), *_openings(), *roof, *wall, path, lawn], baked("sky", repeat=True))


def _openings() -> list[Rectangle]:
    """The door and two windows in the wall on the right, three windows in the one on the left."""
    pane = np.full((44, 52, 3), 235, np.uint8)
    pane[4:40, 4:24] = pane[4:40, 28:48] = (58, 78, 98)
    glass, top, down = Texture(pane), EYE - DOOR, _at(0, 1.1, 0)
    door = Rectangle(_at(_RIGHT + 0.01, top, 4.6), _at(0, 0, 1), _at(0, DOOR, 0), baked("planks"))
    right = [Rectangle(_at(_RIGHT + 0.01, top, z), _at(0, 0, 1.3), down, glass) for z in (6.5, 8.5)]
    left = [Rectangle(_at(x, top, _NEAR - 0.01), _at(1.3, 0, 0), down, glass) for x in (-4.7, -6.7, -8.7)]
    return [door, *right, *left]


def _lamps() -> list[Column | Sphere]:
    iron = Texture(paint.lit_round(paint.plain(1, 32, (0.20, 0.25, 0.27)), upright=True))
    glass = Texture(paint.lit_round(paint.plain(32, 64, (0.98, 0.96, 0.90))))
    places = [(-1.2, EYE, z) for z in (5.0, 7.5, 10.0, 12.5)]
    posts = [Column(_at(*foot), 2.2, 0.04, iron) for foot in places]
    return [*posts, *(Sphere(_at(x, y - 2.33, z), 0.15, glass) for x, y, z in places)]


def _at(*xyz: float) -> Array:
    return np.array(xyz, dtype=float)
