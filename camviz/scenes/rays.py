"""Rays in small tiles of neighbours, so that whole tiles can be ruled out at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.arrays import ALONE, Array, unit
from camviz.poses import RigidTransform

Floats = NDArray[np.float32]
SIDE = 8  # of a tile in a picture, in rays
TILE = SIDE * SIDE
Ball = tuple[Array, float, Array]  # centre, radius, normal
_ROUNDING = np.float32(1e-5)


@dataclass(frozen=True)
class Bounds:
    """Balls around surfaces, `centre` (n, 3) and `radius` (n,), and a unit `normal` (n, 3): 0 where it is not flat.

    Each surface has those from its `first` (surfaces,) on, `count` (surfaces,) of them. Those surfaces that are
    parallelograms, `flat` (m,), also have their `corners` (m, 4, 3), in order around the edge.
    """

    centre: Floats
    radius: Floats
    normal: Floats
    first: NDArray[np.intp]
    count: NDArray[np.intp]
    flat: NDArray[np.intp]
    corners: Array

    @classmethod
    def around(cls, surfaces: Sequence[Sequence[Ball]], corners: Mapping[int, Array] | None = None) -> Bounds:
        """From the balls of each surface, and the `corners` (4, 3) of some of them, by their place in the sequence."""
        rows = [[*centre, radius, *normal] for balls in surfaces for centre, radius, normal in balls]
        table = np.array(rows, dtype=np.float32).reshape(-1, 7)
        count = np.array([len(balls) for balls in surfaces], dtype=np.intp)
        flat = corners or {}
        edges = np.array(list(flat.values()), dtype=float).reshape(-1, 4, 3)
        places = np.array(list(flat), dtype=np.intp)
        return cls(table[:, :3], table[:, 3], table[:, 4:], np.cumsum(count) - count, count, places, edges)

    def of_any(self, balls: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """What holds (n, ...) of balls, as it holds (surfaces, ...) of any ball of a surface."""
        holds = balls[self.first]
        for i in range(1, self.count.max(initial=1)):
            several = np.flatnonzero(self.count > i)
            holds[several] |= balls[self.first[several] + i]
        return holds


@dataclass(frozen=True)
class Rays:
    """The rays of a picture, `shape` (height, width), in tiles of neighbours, each tile inside a cone.

    `directions` (3, tiles, TILE) are unit vectors, zero where there is no ray; `origins` are (3, 1, 1) or
    (3, tiles, TILE). The cones: unit `axis` (3, tiles), `cosine` and `sine` of the half angle (tiles,), all origins of
    a tile within `slack` metres of `centre` (3, tiles) or (3, 1). A tile without any ray has the cosine 2.
    """

    shape: tuple[int, int]
    origins: Array
    directions: Floats
    axis: Floats
    cosine: Floats
    sine: Floats
    centre: Array
    slack: Array

    @classmethod
    def gather(cls, origins: Array, directions: Array) -> Rays:
        """Tiles of rays (height, width, 3) from an origin (3,) or one for each; a NaN direction is no ray."""
        tiles = _in_tiles(directions)
        none = np.isnan(tiles.sum(axis=0))
        tiles[:, none] = 0
        starts = np.asarray(_in_tiles(origins) if origins.ndim > 1 else origins[:, None, None], dtype=float)
        axis = tiles.sum(axis=2)
        axis /= np.maximum(np.sqrt((axis * axis).sum(axis=0)), np.float32(1e-6))
        along = (axis[..., None] * tiles).sum(axis=0)
        along[none] = 1
        cosine = np.minimum(along.min(axis=1), np.float32(1))
        sine = np.sqrt(1 - cosine * cosine)
        cosine[none.all(axis=1)] = 2
        centre = starts.mean(axis=2)
        slack = np.sqrt(((starts - centre[..., None]) ** 2).sum(axis=0).max(axis=1))
        shape = (directions.shape[0], directions.shape[1])
        return cls(shape, starts, tiles, axis, cosine, sine, centre.astype(np.float32), slack.astype(np.float32))

    def picture(self, values: Floats) -> Floats:
        """Values (tiles * TILE, ...) of the rays, as the picture (height, width, ...) they were cut from."""
        height, width = self.shape
        rows, columns = _tile(height)
        down, across = -(-height // rows), -(-width // columns)
        tiles = values.reshape(down, across, rows, columns, *values.shape[1:]).swapaxes(1, 2)
        return tiles.reshape(down * rows, across * columns, *values.shape[1:])[:height, :width]

    def moved(self, world_from_cam: RigidTransform) -> Rays:
        """The same rays of a camera whose centre was the origin, where the camera stands now."""
        turn = world_from_cam.as_matrix()[:3, :3].astype(np.float32)
        centre = np.asarray(world_from_cam.translation, dtype=float)[:, None]
        return replace(
            self,
            origins=centre[..., None],
            directions=turned(turn, self.directions),
            axis=turned(turn, self.axis),
            centre=centre.astype(np.float32),
        )

    def pick(self, tiles: NDArray[np.intp]) -> tuple[Array, Floats]:
        """Origins (3, 1, 1) or (3, p, TILE) and directions (3, p, TILE) of p tiles."""
        origins = self.origins.take(tiles, axis=1) if self.origins.shape[1] > 1 else self.origins
        return origins, self.directions.take(tiles, axis=1)

    def may_intersect(self, bounds: Bounds) -> NDArray[np.bool_]:
        """False (surfaces, tiles) where no ray of the tile can meet the surface.

        A ray whose origin moves by the slack passes a ball by at most that much less; so the ball grows by it, and a
        cone of half angle α meets a ball of angular radius β only if their axes are no more than α + β apart. It meets
        a plane only if some ray of the cone comes nearer to it.
        """
        x, y, z = (bounds.centre[:, i, None] - self.centre[i] for i in range(3))
        distance = np.sqrt(x * x + y * y + z * z)
        grown = bounds.radius[:, None] + self.slack
        sine = np.minimum(grown / distance, 1)
        along = x * self.axis[0] + y * self.axis[1] + z * self.axis[2]
        limit = self.cosine * np.sqrt(1 - sine * sine) - self.sine * sine - _ROUNDING
        ball = (distance <= grown) | (along >= limit * distance)
        height = bounds.normal[:, :1] * -x + bounds.normal[:, 1:2] * -y + bounds.normal[:, 2:] * -z
        towards = -np.sign(height) * turned(bounds.normal, self.axis)
        plane = (np.abs(height) <= self.slack) | (towards >= -self.sine - _ROUNDING)
        may = bounds.of_any(ball & plane)
        if bounds.flat.size and self.centre.shape[1] == 1:  # all rays begin at one point
            may[bounds.flat] &= self._reach(bounds.corners)
        return ((self.cosine <= 0) | may) & (self.cosine <= 1)

    def _reach(self, corners: Array) -> NDArray[np.bool_]:
        """False (m, tiles) where cones from the one origin pass by parallelograms with these corners (m, 4, 3).

        Seen from the origin a parallelogram is a pyramid; a cone outside of one of its four sides misses it.
        """
        seen = corners - self.centre[:, 0]
        sides = np.cross(seen, np.roll(seen, -1, axis=1))
        inwards = np.sign((sides * np.roll(seen, -2, axis=1)).sum(axis=-1, keepdims=True))
        sides = unit(inwards * sides).astype(np.float32)
        within = turned(sides.reshape(-1, 3), self.axis) >= -self.sine - _ROUNDING
        return np.logical_and.reduce(within.reshape(len(corners), 4, -1), axis=1)


def turned(rows: NDArray[Any], vectors: NDArray[Any]) -> NDArray[Any]:
    """The products rows @ vectors (m, ...) of a matrix's `rows` (m, 3) and vectors (3, ...), in this thread alone."""
    flat, part = vectors.reshape(3, -1), ALONE // max(rows.size, 1)
    product = np.empty((len(rows), flat.shape[1]), dtype=np.result_type(rows, vectors))
    for start in range(0, flat.shape[1], part):
        np.matmul(rows, flat[:, start : start + part], out=product[:, start : start + part])
    return product.reshape(len(rows), *vectors.shape[1:])


def _tile(height: int) -> tuple[int, int]:
    """Rows and columns of a tile in a picture of this height."""
    return (SIDE, SIDE) if height > 1 else (1, TILE)


def _in_tiles(vectors: Array) -> Floats:
    """(height, width, 3) as float32 (3, tiles, TILE), its last row and column repeated until the tiles are full."""
    height, width = vectors.shape[:2]
    rows, columns = _tile(height)
    full = np.pad(vectors, ((0, -height % rows), (0, -width % columns), (0, 0)), mode="edge")
    tiles = full.reshape(full.shape[0] // rows, rows, full.shape[1] // columns, columns, 3)
    return np.ascontiguousarray(tiles.transpose(4, 0, 2, 1, 3), dtype=np.float32).reshape(3, -1, TILE)
