"""A scene, and the one tracer that photographs it through every lens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Lens
from camviz.lenses.arrays import LinearPicture32, PointsLike, UnitRaysLike
from camviz.lenses.base import Array, as_points
from camviz.scenes.batched import Indices, Traced, batched
from camviz.scenes.intersection import Hit
from camviz.scenes.light import to_display
from camviz.scenes.mesh import Mesh
from camviz.scenes.rays import SIDE, TILE, Bounds, Floats, Rays
from camviz.scenes.surfaces import Rectangle, Surface, on_sphere
from camviz.scenes.texture import LIGHT, Texture
from camviz.scenes.wireframe import Wireframe

BLOCK = 1 << 17  # rays traced together, which take about 12 MB
KEPT = 640 * 480  # rays of a camera that are kept at most, in single precision: 4 MB
Block = tuple[slice, slice]
NEUTRAL = 0.06  # linear light where no ray arrives: a dark grey that cannot be mistaken for a hole in the scene


@dataclass(frozen=True, eq=False)
class Scene:
    """Surfaces under a sky, for a tracer that photographs them through any lens.

    Args:
        surfaces: Best listed near to far: then hidden ones cost no time.
        sky: Infinitely far away and equirectangular, its texels square, its middle towards +z and its first row
            straight up. Where it ends before the nadir, its last row goes on.

    A wall 2 m ahead, and nothing above it but the sky:

    >>> scene = Scene([Rectangle((-1, -1, 2), (2, 0, 0), (0, 2, 0), Texture.plain((1, 1, 1)))])
    >>> light, distance = scene.trace((0, 0, 0), [(0, 0, 1), (0, -1, 0)])
    >>> distance
    array([ 2., nan], dtype=float32)
    """

    surfaces: Sequence[Surface]
    sky: Texture = field(default_factory=lambda: Texture.plain((0.62, 0.72, 0.82)))

    def trace(self, origins: PointsLike, directions: UnitRaysLike, spread: float = 0.0) -> tuple[Floats, Floats]:
        """Follow rays to the nearest surface.

        A ray that meets nothing shows the sky. A direction that is NaN is no ray, and shows a neutral grey.

        Args:
            spread: The angle in radians between neighbouring rays, over which textures are averaged; 0 averages
                nothing.

        Returns:
            light: (..., 3), linear, float32.
            distance: (...), along the ray in metres, float32; NaN where it meets nothing.

        Raises: ValueError for directions that are not of unit length, and for origins that are not finite.
        Source: J. Amanatides, Ray tracing with cones, SIGGRAPH 1984.
        """
        origins, directions = as_points(origins, 3, "origins"), as_points(directions, 3, "directions")
        shape = np.broadcast_shapes(origins.shape, directions.shape)
        _require_rays(origins, directions)
        if 0 in shape:
            return np.zeros(shape, np.float32), np.zeros(shape[:-1], np.float32)
        height, width = _laid_out(shape[:-1])
        directions = np.broadcast_to(directions, shape).reshape(height, width, 3)
        one = origins.size == 3
        origins = origins.reshape(3) if one else np.broadcast_to(origins, shape).reshape(height, width, 3)
        light, depth = np.empty((height, width, 3), np.float32), np.empty((height, width), np.float32)
        for block in _blocks(height, width):
            rays = Rays.gather(origins if one else origins[block], directions[block])
            light[block], depth[block] = self.follow(rays, spread)
        return light.reshape(shape), depth.reshape(shape[:-1])

    @cached_property
    def _bounds(self) -> Bounds:
        corners = {i: wall.corners for i, wall in enumerate(self.surfaces) if isinstance(wall, Rectangle)}
        return Bounds.around([surface.bounding_spheres() for surface in self.surfaces], corners)

    @cached_property
    def _traced(self) -> list[tuple[Traced, list[int]]]:
        return batched(self.surfaces)

    def follow(self, rays: Rays, spread: float) -> tuple[Floats, Floats]:
        """As `trace` does, for rays in tiles.

        Args:
            rays: Gathered in tiles of neighbours.
            spread: The angle in radians between neighbouring rays.

        Returns:
            light: (height, width, 3), linear, float32.
            distance: (height, width), in metres, float32.
        """
        depth = np.full(rays.directions[0].size, np.inf, dtype=np.float32)
        light = np.empty((depth.size, LIGHT), dtype=np.float32)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            may_intersect = rays.may_intersect(self._bounds)
            for surfaces, members in self._traced:
                member, tile = np.nonzero(may_intersect[members])
                if tile.size:
                    self._intersect(surfaces, member, tile, rays, depth, light, spread)
            self._paint_sky(rays, depth, light, spread)
        return cv2.cvtColor(rays.picture(light), cv2.COLOR_RGBA2RGB), rays.picture(depth)

    def _intersect(
        self, surfaces: Traced, member: Indices, tile: Indices, rays: Rays, depth: Floats, light: Floats, spread: float
    ) -> None:
        """Let each `tile` (p,) of rays meet one surface, and where that is the nearest so far, see it."""
        at = surfaces.intersect(*rays.pick(tile), member)
        hit = np.flatnonzero(at.depth < depth.reshape(-1, TILE).take(tile, axis=0).ravel())
        pair = hit // TILE
        ray = hit + (TILE * (tile - np.arange(tile.size))).take(pair)
        distance = at.depth.take(hit)
        np.minimum.at(depth, ray, distance)
        nearest = np.flatnonzero(distance == depth.take(ray))
        if nearest.size:
            seen = Hit(distance.take(nearest), at.place.take(hit.take(nearest), axis=1))
            radiance = surfaces.radiance(seen, spread, member.take(pair.take(nearest)))
            _whole(light)[ray.take(nearest)] = _whole(radiance)

    def _paint_sky(self, rays: Rays, depth: Floats, light: Floats, spread: float) -> None:
        missed = np.flatnonzero(depth == np.inf)
        if missed.size == 0:
            return
        x, y, z = rays.directions.reshape(3, -1).take(missed, axis=1)
        depth[missed] = np.nan
        if self.sky.is_plain:
            light[missed, :3] = self.sky.mean
        else:
            _whole(light)[missed] = _whole(self._sky_at(x, y, z, spread))
        light[missed[(x == 0) & (y == 0) & (z == 0)]] = NEUTRAL

    def _sky_at(self, x: Floats, y: Floats, z: Floats, spread: float) -> Floats:
        """Its light (n, LIGHT) from directions (n,)."""
        s, r = on_sphere(x, y, -z)
        rows = self.sky.width / 2  # of a whole sphere
        r = np.minimum(r * np.float32(rows / self.sky.height), np.float32(1 - 0.5 / self.sky.height))
        return self.sky.sample(s, r, spread * rows / np.pi)

    def outlines(self) -> Wireframe:
        """The same scene as lines.

        Returns: Each line named after its surface.
        """
        lines = [(line, surface.name) for surface in self.surfaces for line in surface.outline()]
        return Wireframe(tuple(line for line, _ in lines), tuple(name for _, name in lines))

    def faces(self) -> tuple[Mesh, ...]:
        """The same scene for a solid renderer.

        Returns: One for each surface; the sky is not among them.
        """
        return tuple(surface.mesh() for surface in self.surfaces)


def render(scene: Scene, camera: Camera, supersample: int = 1) -> LinearPicture32:
    """The picture that a camera takes of a scene, as light.

    Args:
        supersample: n: each pixel is the mean of n × n rays.

    Raises: ValueError unless n is a whole number of at least 1.

    A white wall that fills the middle two of four columns:

    >>> from camviz.cameras import Camera, Intrinsics
    >>> wall = Rectangle((-1, -2, 2), (2, 0, 0), (0, 4, 0), Texture.plain((1, 1, 1)))
    >>> render(Scene([wall], sky=Texture.plain((0, 0, 0))), Camera(Intrinsics.from_fov(4, 2, 90)))[..., 0]
    array([[0., 1., 1., 0.],
           [0., 1., 1., 0.]], dtype=float32)
    """
    if int(supersample) != supersample or supersample < 1:
        raise ValueError(f"supersample must be a whole number, at least 1, got {supersample}")
    pixels = camera.intrinsics
    fine = pixels.resized(pixels.width * supersample, pixels.height * supersample)
    light = np.empty((fine.height, fine.width, 3), dtype=np.float32)
    for block, seen in _traced(scene, replace(camera, intrinsics=fine)):
        light[block] = seen
    if supersample == 1:
        return light
    return np.asarray(cv2.resize(light, (pixels.width, pixels.height), interpolation=cv2.INTER_AREA), dtype=np.float32)


def snapshot(scene: Scene, camera: Camera) -> NDArray[np.uint8]:
    """The picture that a camera takes of a scene, for the screen: to_display(render(scene, camera)).

    Returns: (height, width, 3), sRGB bytes, uint8.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> sky = Scene([], sky=Texture.plain((0, 0.2, 1)))
    >>> snapshot(sky, Camera(Intrinsics.from_fov(4, 2, 90)))[0, 0]
    array([  0,  51, 255], dtype=uint8)
    """
    picture = np.empty((camera.intrinsics.height, camera.intrinsics.width, 3), dtype=np.uint8)
    for block, seen in _traced(scene, camera):
        picture[block] = to_display(seen)
    return picture


def _traced(scene: Scene, camera: Camera) -> Iterator[tuple[Block, Floats]]:
    """The picture in blocks: where, and their linear light (rows, columns, 3)."""
    pixels = camera.intrinsics
    small = pixels.width * pixels.height <= KEPT
    blocks, spread = _kept_rays(pixels, camera.lens) if small else _rays(pixels, camera.lens)
    for block, rays in zip(_blocks(pixels.height, pixels.width), blocks, strict=True):
        yield block, scene.follow(rays.moved(camera.world_from_cam), spread)[0]


def _whole(light: Floats) -> NDArray[np.complex128]:
    """The same light (n, LIGHT) as (n,) single things, which NumPy moves about several times as fast."""
    return light.view(np.complex128)[:, 0]


def _laid_out(shape: tuple[int, ...]) -> tuple[int, int]:
    """Height and width of a picture of rays with this shape; neighbours in it should be neighbours in the world."""
    count = int(np.prod(shape))
    width = shape[-1] if len(shape) > 1 and shape[-1] < BLOCK else count
    return count // width, width


def _blocks(height: int, width: int) -> list[Block]:
    """A picture in pieces of about BLOCK rays."""
    tall, wide = (1, BLOCK) if height == 1 else (max(BLOCK // width // SIDE, 1) * SIDE, width)
    corners = product(range(0, height, tall), range(0, width, wide))
    return [np.s_[top : min(top + tall, height), left : min(left + wide, width)] for top, left in corners]


def _require_rays(origins: Array, directions: Array) -> None:
    """Checks one direction in TILE, for a wrong scale concerns all of them."""
    if not np.isfinite(origins).all():
        raise ValueError("origins must be finite points, got NaN or infinity among them")
    lengths = np.linalg.norm(directions.reshape(-1, 3)[::TILE], axis=-1)
    wrong = lengths[np.abs(lengths - 1) > 1e-3]
    if wrong.size:
        raise ValueError(f"directions must be unit vectors, got one of length {wrong[0]:g}")


def _rays(pixels: Intrinsics, lens: Lens) -> tuple[tuple[Rays, ...], float]:
    """A camera's rays, as seen by itself, in blocks, and the typical angle between neighbours."""
    blocks, steps = [], []
    for rows, columns in _blocks(pixels.height, pixels.width):
        part = pixels.cropped(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
        rays = lens.unproject(part.from_pixels(part.grid()))
        steps.append(np.linalg.norm(np.diff(rays[::8], axis=1), axis=-1).ravel())
        blocks.append(Rays.gather(np.zeros(3), rays))
    apart = np.concatenate(steps)
    apart = apart[np.isfinite(apart)]
    return tuple(blocks), float(np.median(apart)) if apart.size else 0.0


_kept_rays = lru_cache(maxsize=1)(_rays)  # while the camera only moves; one, for a class shares one memory
