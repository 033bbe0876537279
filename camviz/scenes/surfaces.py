"""Surfaces: each is a unit shape in its own frame, so that meeting it with a ray takes a few lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.base import Array, unit
from camviz.scenes.intersection import FAR, HALF, Hit, intersect_circle, intersect_plane, intersect_square, texels
from camviz.scenes.light import sunlight
from camviz.scenes.mesh import Mesh, lattice
from camviz.scenes.rays import Ball, Floats, turned
from camviz.scenes.texture import Texture


class Surface(Protocol):
    """What a scene is made of."""

    @property
    def name(self) -> str:
        """What it belongs to, in drawings."""
        ...

    def bounding_spheres(self) -> tuple[Ball, ...]:
        """Balls that it lies in: centre (3,), radius, and its unit normal (3,) if it is flat, otherwise 0."""
        ...

    def intersect(self, origins: Array, directions: Floats) -> Hit:
        """Where rays with unit directions (3, n) from origins (3, n) or (3, 1) meet the surface first."""
        ...

    def radiance(self, at: Hit, spread: float) -> Floats:
        """Linear light (n, LIGHT) that leaves the surface towards rays `spread` radians apart."""
        ...

    def outline(self) -> tuple[Array, ...]:
        """The lines a drawing of it needs: polylines (n, 3)."""
        ...

    def mesh(self) -> Mesh:
        """The surface for a solid renderer."""
        ...


@dataclass(frozen=True, eq=False)
class Rectangle(Surface):
    """The parallelogram corner + s across + r down, 0 ≤ s, r ≤ 1, seen from both sides.

    Args:
        corner, across, down: (3,), in metres; the first row of the texture lies along `across`.
        texture: What lies on it.
        shade: The light that it receives, 1 for full light.
        repeats: How many times the texture fits along either edge.
        name: What it belongs to, in drawings.

    Raises: ValueError when the two edges span no area, or are not three finite numbers each.

    A wall in front of a camera at the origin shows its picture the right way round; its normal points at the viewer:

    >>> Rectangle((-1, -1, 2), (2, 0, 0), (0, 2, 0), Texture.plain((1, 1, 1))).normal + 0
    array([ 0.,  0., -1.])
    """

    corner: Array
    across: Array
    down: Array
    texture: Texture
    shade: float = 1.0
    repeats: tuple[float, float] = (1.0, 1.0)
    name: str = "rectangle"

    def __post_init__(self) -> None:
        for edge in ("corner", "across", "down"):
            object.__setattr__(self, edge, _vector(getattr(self, edge), edge))
        if not np.linalg.norm(np.cross(self.across, self.down)) > 0:
            raise ValueError(f"across and down must span an area, got {self.across.tolist()} and {self.down.tolist()}")

    @cached_property
    def normal(self) -> Array:
        """Unit normal (3,), towards a viewer who sees the texture the right way round."""
        return unit(np.cross(self.down, self.across))

    @cached_property
    def corners(self) -> Array:
        """The four corners (4, 3), clockwise as seen by such a viewer."""
        return self.corner + np.array([0 * self.across, self.across, self.across + self.down, self.down])

    @cached_property
    def local_from_world(self) -> Array:
        """Turns world directions (3,) into s, r and metres along the normal."""
        return np.linalg.inv(np.stack([self.across, self.down, self.normal], axis=1))

    @cached_property
    def texels_per_metre(self) -> float:
        """Along the edge where they are closer together."""
        columns, rows = self.repeats
        wide = self.texture.width * columns / np.linalg.norm(self.across)
        return float(max(wide, self.texture.height * rows / np.linalg.norm(self.down)))

    def bounding_spheres(self) -> tuple[Ball, ...]:
        centre = self.corners.mean(axis=0)
        return ((centre, float(np.linalg.norm(self.corners - centre, axis=1).max()), self.normal),)

    def intersect(self, origins: Array, directions: Floats) -> Hit:
        return intersect_square(*_in_frame(self.local_from_world, self.corner, origins, directions))

    def radiance(self, at: Hit, spread: float) -> Floats:
        columns, rows = (np.float32(n) for n in self.repeats)
        s, r, cosine = at.place
        apart = texels(at.depth, cosine, spread * self.texels_per_metre) if spread > 0 else 0.0
        light = self.texture.sample(s * columns, r * rows, apart)
        return light if self.shade == 1 else light * np.float32(self.shade)

    def outline(self) -> tuple[Array, ...]:
        return (np.concatenate([self.corners, self.corners[:1]]),)

    def mesh(self) -> Mesh:
        uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]]) * self.repeats
        return _mesh(self.name, self.corners, np.array([[0, 1, 2, 3]]), uv, self.texture, self.shade)


@dataclass(frozen=True, eq=False)
class Ground(Surface):
    """The endless horizontal plane y = `height`, which fades into the air's colour with the distance.

    Args:
        height: In metres; y points down.
        texture: What lies on it.
        tile: The texture is repeated every so many metres.
        haze: (3,), the colour of the air, linear RGB. At a distance d the ground has a share 1 - exp(-d / `sight`) of
            it.
        sight: In metres.
        name: What it belongs to, in drawings.

    Raises: ValueError for a tile or a sight that is not positive.

    White ground at a distance of its sight in black air: 1/e = 0.37 of it is seen.

    >>> ground = Ground(1.0, Texture.plain((1, 1, 1)), haze=(0, 0, 0), sight=2.0)
    >>> light, distance = Scene([ground]).trace((0, 0, 0), (0, 0.5, 0.75**0.5))
    >>> light.round(2), distance.round(6)
    (array([0.37, 0.37, 0.37], dtype=float32), np.float32(2.0))
    """

    height: float
    texture: Texture
    tile: float = 1.0
    haze: ArrayLike = (0.55, 0.65, 0.75)
    sight: float = 60.0
    name: str = "ground"

    def __post_init__(self) -> None:
        if not self.tile > 0:
            raise ValueError(f"tile must be a positive length in metres, got {self.tile}")
        if not self.sight > 0:
            raise ValueError(f"sight must be a positive distance in metres, got {self.sight}")

    @cached_property
    def _point(self) -> Array:
        return np.array([0, self.height, 0])

    @cached_property
    def _local_from_world(self) -> Array:
        return np.array([[1 / self.tile, 0, 0], [0, 0, -1 / self.tile], [0, -1, 0]])

    def bounding_spheres(self) -> tuple[Ball, ...]:
        return ((self._point, np.inf, np.array([0.0, -1.0, 0.0])),)

    def intersect(self, origins: Array, directions: Floats) -> Hit:
        at = intersect_plane(*_in_frame(self._local_from_world, self._point, origins, directions))
        return at._replace(depth=np.where(at.depth > 0, at.depth, FAR))

    def radiance(self, at: Hit, spread: float) -> Floats:
        s, r, cosine = at.place
        apart = texels(at.depth, cosine, spread * self.texture.width / self.tile) if spread > 0 else 0.0
        light = self.texture.sample(s, r, apart)
        clear = np.exp(at.depth * np.float32(-1 / self.sight))
        haze = np.array([*np.asarray(self.haze, dtype=float), 0], dtype=np.float32)
        light -= haze
        light *= clear[:, None]
        light += haze
        return light

    def outline(self) -> tuple[Array, ...]:
        return ()

    def mesh(self) -> Mesh:
        reach = 2 * self.sight
        square = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * reach + self._point
        uv = square[:, [0, 2]] / self.tile
        return _mesh(self.name, square, np.array([[0, 1, 2, 3]]), uv, self.texture)


@dataclass(frozen=True, eq=False)
class Sphere(Surface):
    """A ball under an equirectangular texture.

    Args:
        centre: (3,), in metres.
        radius: In metres.
        texture: Its middle faces -z, towards a camera at the origin; its first row is the pole -y, the top.
        name: What it belongs to, in drawings.

    Raises: ValueError for a radius that is not positive, and a centre that is not three finite numbers.

    >>> ball = Sphere((0, 0, 3), 1.0, Texture.plain((1, 1, 1)))
    >>> Scene([ball]).trace((0, 0, 0), (0, 0, 1))[1]
    array(2., dtype=float32)
    """

    centre: Array
    radius: float
    texture: Texture
    name: str = "sphere"

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _vector(self.centre, "centre"))
        if not self.radius > 0:
            raise ValueError(f"radius must be a positive length in metres, got {self.radius}")

    def bounding_spheres(self) -> tuple[Ball, ...]:
        return ((self.centre, self.radius, np.zeros(3)),)

    def intersect(self, origins: Array, directions: Floats) -> Hit:
        start = ((origins - self.centre[:, None]) / self.radius).astype(np.float32)
        step = directions / np.float32(self.radius)
        first, second = intersect_circle(start, step)
        depth = np.where(first > 0, first, second)
        return Hit(np.where(depth > 0, depth, FAR), start + depth * step)

    def radiance(self, at: Hit, spread: float) -> Floats:
        density = self.texture.height / (np.pi * self.radius)
        return self.texture.sample(*on_sphere(*at.place), at.depth * np.float32(spread * density))

    def outline(self) -> tuple[Array, ...]:
        turn = np.linspace(0, 2 * np.pi, 49)
        circle = self.radius * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
        return tuple(self.centre + circle[:, axes] for axes in ([0, 1, 2], [0, 2, 1], [2, 1, 0]))

    def mesh(self) -> Mesh:
        s, r, uv, quads = lattice(32, 16)
        longitude, latitude = 2 * np.pi * (s - 0.5), np.pi * r
        ring = np.sin(latitude)
        normals = np.stack([ring * np.sin(longitude), -np.cos(latitude), -ring * np.cos(longitude)], axis=-1)
        return _mesh(self.name, self.centre + self.radius * normals, quads, uv, self.texture)


@dataclass(frozen=True, eq=False)
class Column(Surface):
    """An upright tube, open at both ends.

    Args:
        foot: (3,), the middle of its lower end, in metres.
        height, radius: In metres.
        texture: Its middle faces -z, its first row is at the top.
        name: What it belongs to, in drawings.

    Raises: ValueError for a height or radius that is not positive, and a foot that is not three finite numbers.

    >>> post = Column((0, 1, 3), height=2.0, radius=0.5, texture=Texture.plain((1, 1, 1)))
    >>> Scene([post]).trace((0, 0, 0), (0, 0, 1))[1]
    array(2.5, dtype=float32)
    """

    foot: Array
    height: float
    radius: float
    texture: Texture
    name: str = "column"

    def __post_init__(self) -> None:
        object.__setattr__(self, "foot", _vector(self.foot, "foot"))
        for size in ("height", "radius"):
            if not getattr(self, size) > 0:
                raise ValueError(f"{size} must be a positive length in metres, got {getattr(self, size)}")

    @cached_property
    def _top(self) -> Array:
        return self.foot - [0, self.height, 0]

    def bounding_spheres(self) -> tuple[Ball, ...]:
        """Balls one above the other, at most four: a single one would be far wider than a thin column.

        Returns: For each its centre (3,) in metres, its radius, and no normal.
        """
        count = int(np.clip(self.height / (2 * self.radius), 1, 4))
        radius = float(np.hypot(self.height / (2 * count), self.radius))
        at = (np.arange(count) + 0.5) / count
        return tuple((self.foot + share * (self._top - self.foot), radius, np.zeros(3)) for share in at)

    def intersect(self, origins: Array, directions: Floats) -> Hit:
        scale = np.array([[self.radius], [self.height], [self.radius]])
        start = ((origins - self._top[:, None]) / scale).astype(np.float32)
        step = np.divide(directions, scale, dtype=np.float32)
        first, second = intersect_circle(start[::2], step[::2])
        outside = (first > 0) & (np.abs(start[1] + first * step[1] - HALF) <= HALF)
        depth = np.where(outside, first, second)
        place = start + depth * step
        return Hit(np.where((depth > 0) & (np.abs(place[1] - HALF) <= HALF), depth, FAR), place)

    def radiance(self, at: Hit, spread: float) -> Floats:
        x, r, z = at.place
        density = self.texture.height / self.height
        return self.texture.sample(around(x, -z), r, at.depth * np.float32(spread * density))

    def outline(self) -> tuple[Array, ...]:
        turn = np.linspace(0, 2 * np.pi, 25)
        rim = self.radius * np.stack([np.sin(turn), 0 * turn, -np.cos(turn)], axis=-1)
        sides = tuple(np.stack([self.foot + p, self._top + p]) for p in rim[:-1:6])
        return (self.foot + rim, self._top + rim, *sides)

    def mesh(self) -> Mesh:
        s, r, uv, quads = lattice(24, 1)
        longitude = 2 * np.pi * (s - 0.5)
        offset = [self.radius * np.sin(longitude), self.height * r, -self.radius * np.cos(longitude)]
        return _mesh(self.name, self._top + np.stack(offset, axis=-1), quads, uv, self.texture)


def box(
    foot: ArrayLike,
    size: ArrayLike,
    texture: Texture,
    yaw: float = 0.0,
    tile: float | None = None,
    name: str = "box",
) -> tuple[Rectangle, ...]:
    """The four walls and the lid of a box, lit by the sun.

    Args:
        foot: (3,), the middle of its floor, in metres.
        size: (3,), width, height and depth in metres, before it is turned.
        texture: It covers each side once, or repeats.
        yaw: The turn about the vertical in radians, clockwise as seen from above.
        tile: The texture repeats every so many metres.
        name: What it belongs to, in drawings.

    Returns: Front, right, back and left side, and the lid.
    Raises: ValueError for a foot or size that is not three finite numbers.

    The sun is high and to the left, so that the lid is brighter than the front, and the right side is in the shade:

    >>> sides = box((0, 1, 4), (1, 1, 1), Texture.plain((1, 1, 1)))
    >>> [round(side.shade, 2) for side in sides]
    [0.71, 0.42, 0.42, 0.7, 0.84]
    """
    foot, (width, height, depth) = _vector(foot, "foot"), _vector(size, "size")
    cos, sin = np.cos(yaw), np.sin(yaw)
    right, down, away = width * np.array([cos, 0, -sin]), np.array([0, height, 0]), depth * np.array([sin, 0, cos])
    front = foot - down - right / 2 - away / 2  # its upper left corner
    walls = [(front, right, down), (front + right, away, down), (front + right + away, -right, down)]
    walls += [(front + away, -away, down), (front + away, right, -away)]
    return tuple(_lit(Rectangle(*wall, texture, name=name), tile) for wall in walls)


def _lit(wall: Rectangle, tile: float | None) -> Rectangle:
    wide, high = (float(np.linalg.norm(edge)) for edge in (wall.across, wall.down))
    return replace(wall, shade=float(sunlight(wall.normal)), repeats=(wide / tile, high / tile) if tile else (1.0, 1.0))


def _vector(values: ArrayLike, name: str) -> Array:
    vector = np.array(values, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name} must be three finite numbers, got {values!r}")
    vector.flags.writeable = False
    return vector


def around(x: Floats, z: Floats) -> Floats:
    """How far round (n,) a direction points, 0…1: 0.5 along +z, more to the right.

    OpenCV's arctangent is off by up to 0.01°, a thirtieth of a texel here, in a fortieth of NumPy's time.
    """
    return cv2.phase(-z, -x).ravel() * np.float32(0.5 / np.pi)


def on_sphere(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats]:
    """Equirectangular s, r (n,) of unit normals, seen from outside: the middle faces -z, the first row is up."""
    return around(x, -z), np.arccos(np.clip(-y, -1, 1)) * np.float32(1 / np.pi)


def _in_frame(local_from_world: Array, point: Array, origins: Array, directions: Floats) -> tuple[Floats, Floats]:
    """Origins and directions of rays in a frame at `point`."""
    start = turned(local_from_world, origins - point[:, None]).astype(np.float32)
    return start, turned(local_from_world.astype(np.float32), directions)


def _mesh(name: str, vertices: Array, quads: NDArray[np.intp], uv: Array, texture: Texture, shade: float = 1.0) -> Mesh:
    return Mesh(name, np.asarray(vertices, dtype=float), quads, uv, texture, shade)
