"""The garden with a balloon behind its wall: something that only moving reveals."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from camviz.lenses.base import Array, unit
from camviz.scenes import paint
from camviz.scenes.scene import Scene
from camviz.scenes.standard import FLOOR, textured_scene
from camviz.scenes.surfaces import Column, Sphere
from camviz.scenes.texture import Texture

BALLOON, BALLOON_RADIUS = np.array([1.75, -1.1, 11.6]), 0.22  # behind the wall's right end, metres


@cache
def balloon_scene() -> Scene:
    """The garden, and a red balloon on a string."""
    garden = textured_scene()
    skin = Texture(paint.lit_round(paint.plain(32, 64, (0.85, 0.08, 0.12))))
    grey = Texture(paint.lit_round(paint.plain(1, 32, (0.3, 0.3, 0.3)), upright=True))
    foot = np.array([BALLOON[0], FLOOR, BALLOON[2]])
    string = Column(foot, FLOOR - BALLOON[1], 0.012, grey, "balloon")
    return Scene([*garden.surfaces, Sphere(BALLOON, BALLOON_RADIUS, skin, "balloon"), string], garden.sky)


def balloon_rim(eye: Array, size: float = 1.0, samples: int = 49) -> Array:
    """The balloon's outline (samples, 3) as seen from `eye` (3,), closed; with `size` < 1 a smaller circle within it.

    The rays from the eye that touch a sphere of radius r at distance d do so on a circle of radius r sqrt(1 - r²/d²).
    """
    towards = BALLOON - eye
    cosine2 = 1 - BALLOON_RADIUS**2 / np.sum(towards**2)
    across = unit(np.cross(towards, (0.0, 1.0, 0.0)))
    turn = np.linspace(0, 2 * np.pi, samples)[:, None]
    around = np.cos(turn) * across + np.sin(turn) * unit(np.cross(across, towards))
    return np.asarray(eye + cosine2 * towards + size * BALLOON_RADIUS * np.sqrt(cosine2) * around)


def balloon_in_sight(eye: Array) -> float:
    """The share 0 … 1 of the balloon's disc that nothing hides from `eye` (3,)."""
    return _share(tuple(map(float, eye)))


def towards_balloon(eye: Array) -> Array:
    """Where the line from `eye` (3,) to the balloon's middle meets something before it, (3,); NaN where it does not."""
    distance = np.linalg.norm(BALLOON - eye)
    _, depth = textured_scene().trace(eye, unit(BALLOON - eye))
    return np.asarray(eye + (float(depth) if depth < distance else np.nan) * unit(BALLOON - eye))


@lru_cache(maxsize=256)
def _share(place: tuple[float, ...]) -> float:
    """Eight rings of 32 rays, each ring for an equal area."""
    eye = np.array(place)
    points = np.concatenate([balloon_rim(eye, np.sqrt((ring + 0.5) / 8), 33)[:-1] for ring in range(8)])
    _, depth = textured_scene().trace(eye, unit(points - eye))
    return float(np.mean(~(depth < np.linalg.norm(points - eye, axis=-1))))
