"""A box with a hole in front of the garden, in space: what hangs where, and the rays that paint its back wall."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw.items import closed
from camviz.draw.space import Dots, Face, Item, Label, Line, TexturedMesh
from camviz.poses import RigidTransform
from camviz.scenes import snapshot, textured_scene

WALL_MM = np.array([36.0, 27.0])
ENLARGED = 30  # the box beside the garden, or nobody would see it
TOWER = np.array([0.68, 0.67, 3.3])  # the middle of the crate and the globe on it, in the world
TOWER_M = 1.16
_POINTS_A_LINE = 33
_GRID = np.array([[0, 1], [3, 2]])  # of an outline's corners, as a picture hangs on them
_SCENE = np.array([(-0.95, -0.72), (0.95, -0.72), (0.95, 0.72), (-0.95, 0.72)])  # the garden's outline, metres


def box_and_garden(
    upright: np.ndarray, depth_mm: float, object_m: float, rays: Mapping[str, np.ndarray], *, lamp: bool
) -> list[Item]:
    """The garden as a picture in its place, the rays through the hole, and the picture they make.

    Args:
        upright: The picture on the wall, turned upright, (height, width, 3) uint8.
        depth_mm: From the hole to the wall.
        object_m: From the hole to the garden's picture.
        rays: Where they start, (3,) metres from the hole, by their colours.
        lamp: Whether they start at a lamp, beyond which its ray is dashed.

    Returns: What a panel of space draws; the hole is its origin.
    """
    half, behind = ENLARGED * WALL_MM / 2000, ENLARGED * depth_mm / 1000
    wall = np.array([(half[0], half[1]), (-half[0], half[1]), (-half[0], -half[1]), (half[0], -half[1])])
    front, back = (np.insert(wall, 2, z, axis=1) for z in (0.0, -behind))
    scene = np.insert(_SCENE, 2, object_m, axis=1)
    items: list[Item] = [
        TexturedMesh.over(scene[_GRID], _stage()),
        TexturedMesh.over(back[_GRID], upright),
        Line(closed(scene), "muted", 1.2),
        Face(front, "shade", 0.25),
        *(Line(closed(rim), "ink", 1.6) for rim in (front, back)),
        *(Line(np.array([a, b]), "ink", 1.4) for a, b in zip(front, back, strict=True)),
        Line(np.array([(0, 0, -behind), (0, 0, object_m)]), "muted dashed", 1.0),
        Dots(np.zeros(3), "ink", 7),
    ]
    for colour, start in rays.items():
        end = -start * _reach(start, half, behind)
        items += [Line(np.array([start, end]), colour, 1.9), Dots(np.array([start, end]), colour, 7)]
        if lamp:
            beyond = start * max(1.0, object_m / start[2])
            items += [Line(np.array([start, beyond]), f"{colour} dashed", 1.9), Dots(start, colour, 14)]
    return [
        *items,
        Label(np.array([0, -half[1] - 0.12, 0]), "hole"),
        Label(np.array([0, -0.9, object_m]), "scene"),
    ]


@lru_cache(maxsize=1)
def garden_outlines() -> np.ndarray:
    """The outlines (lines, points, 3) of what stands in the garden, in the world, all with as many points."""
    lines = [line for name, line in textured_scene().outlines() if name not in ("terrace", "lawn", "easel")]
    share = np.linspace(0, 1, _POINTS_A_LINE)
    along = [np.linspace(0, 1, len(line)) for line in lines]
    return np.array(
        [np.stack([np.interp(share, t, c) for c in line.T], axis=-1) for t, line in zip(along, lines, strict=True)]
    )


@lru_cache(maxsize=1)
def _stage() -> np.ndarray:
    """The garden around the tower as it looks from three metres away: 1.9 × 1.44 m of it."""
    pixels = Intrinsics(380, 288, 600, 600, 189.5, 143.5)
    pose = RigidTransform.from_translation(TOWER - (0, 0, 3.0))
    return snapshot(textured_scene(), Camera(pixels, world_from_cam=pose))


def _reach(start: np.ndarray, half: np.ndarray, behind: float) -> float:
    """How far a ray goes on behind the hole, as a share of the way before it: to the wall, or to the box's side."""
    sides = np.divide(half, np.abs(start[:2]), out=np.full(2, np.inf), where=start[:2] != 0)
    return float(min(behind / start[2], *sides))
