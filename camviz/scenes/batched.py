"""Surfaces that are traced together: a dozen alike cost one look instead of a dozen."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.scenes.intersection import Hit, intersect_square, texels
from camviz.scenes.rays import Floats
from camviz.scenes.surfaces import Column, Rectangle, Sphere, Surface

Indices = NDArray[np.intp]


class Traced(Protocol):
    """What the tracer meets: some surfaces, each with those tiles of rays that come near it."""

    def intersect(self, origins: Array, directions: Floats, member: Indices) -> Hit:
        """Where the rays of p tiles, directions (3, p, TILE), meet the surface that each is to meet, `member` (p,).

        Origins are (3, 1, 1) or (3, p, TILE); distances and places come flat, (p TILE,) and (3, p TILE).
        """
        ...

    def radiance(self, at: Hit, spread: float, member: Indices) -> Floats:
        """Linear light (n, LIGHT) that leaves the surfaces `member` (n,) towards rays `spread` radians apart."""
        ...


def batched(surfaces: Sequence[Surface]) -> list[tuple[Traced, list[int]]]:
    """What to trace, in the order of the surfaces, and of which of them each consists."""
    groups: dict[Hashable, list[int]] = {}
    for i, surface in enumerate(surfaces):
        groups.setdefault(_kind(surface), []).append(i)
    return [(_one([surfaces[i] for i in group]), group) for group in groups.values()]


def _kind(surface: Surface) -> Hashable:
    """Surfaces of one kind can be traced together."""
    if isinstance(surface, Rectangle):
        return Rectangle, surface.texture
    if isinstance(surface, Sphere):
        return Sphere, surface.texture, surface.radius
    if isinstance(surface, Column):
        return Column, surface.texture, surface.radius, surface.height
    return id(surface)


def _one(alike: list[Surface]) -> Traced:
    if len(alike) == 1:
        return Alone(alike[0])
    walls = [wall for wall in alike if isinstance(wall, Rectangle)]
    centres = np.array([surface.bounding_spheres()[0][0] for surface in alike]).T
    return Walls(walls) if walls else Copies(alike[0], centres - centres[:, :1])


@dataclass(frozen=True, eq=False)
class Alone:
    """A surface that has no like."""

    surface: Surface

    def intersect(self, origins: Array, directions: Floats, member: Indices) -> Hit:
        return self.surface.intersect(origins.reshape(3, -1), directions.reshape(3, -1))

    def radiance(self, at: Hit, spread: float, member: Indices) -> Floats:
        return self.surface.radiance(at, spread)


@dataclass(frozen=True, eq=False)
class Copies:
    """A surface and its copies, moved from it by `offsets` (3, k)."""

    first: Surface
    offsets: Array

    def intersect(self, origins: Array, directions: Floats, member: Indices) -> Hit:
        """A ray meets a copy where the ray, moved back by the offset, meets the first."""
        starts = np.broadcast_to(origins - self.offsets[:, member, None], directions.shape)
        return self.first.intersect(starts.reshape(3, -1), directions.reshape(3, -1))

    def radiance(self, at: Hit, spread: float, member: Indices) -> Floats:
        return self.first.radiance(at, spread)


class Walls:
    """Rectangles with one texture."""

    def __init__(self, walls: Sequence[Rectangle]) -> None:
        self._texture = walls[0].texture
        self._frames = np.array([wall.local_from_world for wall in walls]).transpose(1, 2, 0)[..., None]
        self._corners = np.array([wall.corner for wall in walls]).T[..., None]
        looks = [(*wall.repeats, wall.texels_per_metre, wall.shade) for wall in walls]
        self._looks = np.array(looks, dtype=np.float32).T

    def intersect(self, origins: Array, directions: Floats, member: Indices) -> Hit:
        frames = self._frames.take(member, axis=2)
        start = _turned(frames, origins - self._corners.take(member, axis=1)).astype(np.float32)
        depth, place = intersect_square(start, _turned(frames.astype(np.float32), directions))
        return Hit(depth.ravel(), place.reshape(3, -1))

    def radiance(self, at: Hit, spread: float, member: Indices) -> Floats:
        columns, rows, density, shade = self._looks.take(member, axis=1)
        s, r, cosine = at.place
        apart = texels(at.depth, cosine, spread * density) if spread > 0 else 0.0
        return self._texture.sample(s * columns, r * rows, apart) * shade[:, None]


def _turned(frames: NDArray[Any], vectors: NDArray[Any]) -> NDArray[Any]:
    """Vectors (3, p, n) in p frames (3, 3, p, 1); faster than p small matrix products."""
    x, y, z = vectors
    return np.stack([a * x + b * y + c * z for a, b, c in frames])
