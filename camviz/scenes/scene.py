"""A scene, and the one tracer that photographs it through every lens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Lens
from camviz.lenses.base import Array, as_points
from camviz.scenes.light import to_display
from camviz.scenes.meeting import Meeting
from camviz.scenes.rays import RUN, Bounds, Floats, Runs
from camviz.scenes.surfaces import Mesh, Surface, on_sphere
from camviz.scenes.texture import Texture
from camviz.scenes.together import Indices, Traced, together
from camviz.scenes.wireframe import Wireframe

BLOCK = 1 << 15  # rays traced together: few enough to stay in the processor's cache
KEPT = 640 * 480  # rays of a camera that are kept at most, in single precision: 4 MB
NEUTRAL = 0.06  # linear light where no ray arrives: a dark grey that cannot be mistaken for a hole in the scene


@dataclass(frozen=True, eq=False)
class Scene:
    """Surfaces under a sky. List them near to far: what is hidden then costs nothing.

    The sky is an equirectangular texture infinitely far away, its texels square, its middle towards +z and its first
    row straight up. Where it ends before the nadir, its last row goes on.
    """

    surfaces: Sequence[Surface]
    sky: Texture = field(default_factory=lambda: Texture.plain((0.62, 0.72, 0.82)))

    def trace(self, origins: ArrayLike, directions: ArrayLike, spread: float = 0.0) -> tuple[Floats, Floats]:
        """Follow rays from `origins` along unit `directions`, (..., 3) each, to the nearest surface.

        Returns linear light (..., 3) and the distance along the ray (...) in metres, both float32. A ray that meets
        nothing shows the sky at distance NaN; a NaN direction is no ray: NEUTRAL grey, NaN. `spread` is the angle in
        radians between neighbouring rays, over which textures are averaged (Amanatides 1984, "Ray tracing with
        cones"); 0 averages nothing. Raises ValueError for directions that are not of unit length and for origins that
        are not finite.
        """
        origins, directions = as_points(origins, 3, "origins"), as_points(directions, 3, "directions")
        shape = np.broadcast_shapes(origins.shape, directions.shape)
        _require_rays(origins, directions)
        if 0 in shape:
            return np.zeros(shape, np.float32), np.zeros(shape[:-1], np.float32)
        origins, directions = _flat(origins, shape), np.broadcast_to(directions, shape).reshape(-1, 3)
        light, depth = np.empty(directions.shape, np.float32), np.empty(len(directions), np.float32)
        for start in range(0, len(directions), BLOCK):
            block = slice(start, start + BLOCK)
            runs = Runs.gather(origins[block] if len(origins) > 1 else origins, directions[block])
            light[block], depth[block] = self.follow(runs, spread, len(directions[block]))
        return light.reshape(shape), depth.reshape(shape[:-1])

    @cached_property
    def _bounds(self) -> Bounds:
        return Bounds.around([surface.balls() for surface in self.surfaces])

    @cached_property
    def _traced(self) -> list[tuple[Traced, list[int]]]:
        return together(self.surfaces)

    def follow(self, runs: Runs, spread: float, count: int) -> tuple[Floats, Floats]:
        """As `trace` does, light (count, 3) and distance (count,) of the first `count` of the rays in `runs`."""
        depth = np.full(runs.count, np.inf, dtype=np.float32)
        light = np.empty((depth.size, 3), dtype=np.float32)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            may_meet = runs.may_meet(self._bounds)
            for surfaces, members in self._traced:
                member, run = np.nonzero(may_meet[members])
                if run.size:
                    self._meet(surfaces, member, run, runs, depth, light, spread)
            self._paint_sky(runs, depth, light, spread)
        return light[:count], depth[:count]

    def _meet(
        self, surfaces: Traced, member: Indices, run: Indices, runs: Runs, depth: Floats, light: Floats, spread: float
    ) -> None:
        """Let each `run` (p,) of rays meet one surface, and where that is the nearest so far, see it."""
        at = surfaces.meet(*runs.pick(run), member)
        hit = np.flatnonzero(at.depth < depth.reshape(-1, RUN).take(run, axis=0).ravel())
        ray = run[hit // RUN] * RUN + hit % RUN
        np.minimum.at(depth, ray, at.depth[hit])
        nearest = np.flatnonzero(at.depth[hit] == depth[ray])
        if nearest.size:
            hit, ray = hit[nearest], ray[nearest]
            seen = Meeting(at.depth[hit], at.place.take(hit, axis=1))
            light[ray] = surfaces.radiance(seen, spread, member[hit // RUN])

    def _paint_sky(self, runs: Runs, depth: Floats, light: Floats, spread: float) -> None:
        missed = np.flatnonzero(depth == np.inf)
        if missed.size == 0:
            return
        x, y, z = runs.directions.reshape(3, -1)[:, missed]
        depth[missed] = np.nan
        light[missed] = self.sky.mean if self.sky.is_plain else self._sky_at(x, y, z, spread)
        light[missed[(x == 0) & (y == 0) & (z == 0)]] = NEUTRAL

    def _sky_at(self, x: Floats, y: Floats, z: Floats, spread: float) -> Floats:
        """Its light (n, 3) from directions (n,)."""
        s, r = on_sphere(x, y, -z)
        rows = self.sky.width / 2  # of a whole sphere
        r = np.minimum(r * np.float32(rows / self.sky.height), np.float32(1 - 0.5 / self.sky.height))
        return self.sky.sample(s, r, spread * rows / np.pi)

    def outlines(self) -> Wireframe:
        """The same scene as lines, each named after its surface."""
        lines = [(line, surface.name) for surface in self.surfaces for line in surface.outline()]
        return Wireframe(tuple(line for line, _ in lines), tuple(name for _, name in lines))

    def faces(self) -> tuple[Mesh, ...]:
        """The same scene as meshes for a solid renderer; the sky is not among them."""
        return tuple(surface.mesh() for surface in self.surfaces)


def render(scene: Scene, camera: Camera, supersample: int = 1) -> Floats:
    """The picture (height, width, 3) that the camera takes, linear light, float32.

    With `supersample` = n each pixel is the mean of n × n rays. Raises ValueError unless n is a whole number ≥ 1.
    """
    if int(supersample) != supersample or supersample < 1:
        raise ValueError(f"supersample must be a whole number, at least 1, got {supersample}")
    pixels = camera.intrinsics
    fine = pixels.resized(pixels.width * supersample, pixels.height * supersample)
    light = np.empty((fine.height, fine.width, 3), dtype=np.float32)
    for rows, strip in _traced(scene, replace(camera, intrinsics=fine)):
        light[rows] = strip
    if supersample == 1:
        return light
    return np.asarray(cv2.resize(light, (pixels.width, pixels.height), interpolation=cv2.INTER_AREA), dtype=np.float32)


def snapshot(scene: Scene, camera: Camera) -> NDArray[np.uint8]:
    """The picture (height, width, 3) that the camera takes as sRGB bytes: to_display(render(scene, camera))."""
    picture = np.empty((camera.intrinsics.height, camera.intrinsics.width, 3), dtype=np.uint8)
    for rows, strip in _traced(scene, camera):
        picture[rows] = to_display(strip)
    return picture


def _traced(scene: Scene, camera: Camera) -> Iterator[tuple[slice, Floats]]:
    """The picture in strips: which rows, and their linear light (rows, width, 3)."""
    pixels = camera.intrinsics
    small = pixels.width * pixels.height <= KEPT
    strips, spread = _kept_strips(pixels, camera.lens) if small else _strips(pixels, camera.lens)
    for i, runs in enumerate(strips):
        top, bottom = i * _rows(pixels), min((i + 1) * _rows(pixels), pixels.height)
        light, _ = scene.follow(runs.moved(camera.world_from_cam), spread, (bottom - top) * pixels.width)
        yield slice(top, bottom), light.reshape(-1, pixels.width, 3)


def _flat(origins: Array, shape: tuple[int, ...]) -> Array:
    """(1, 3) for a single origin, otherwise one (n, 3) for each ray."""
    return origins.reshape(1, 3) if origins.size == 3 else np.broadcast_to(origins, shape).reshape(-1, 3)


def _require_rays(origins: Array, directions: Array) -> None:
    """Of the directions one in RUN is looked at: a wrong scale is seldom wrong once."""
    if not np.isfinite(origins).all():
        raise ValueError("origins must be finite points, got NaN or infinity among them")
    lengths = np.linalg.norm(directions.reshape(-1, 3)[::RUN], axis=-1)
    wrong = lengths[np.abs(lengths - 1) > 1e-3]
    if wrong.size:
        raise ValueError(f"directions must be unit vectors, got one of length {wrong[0]:g}")


def _strips(pixels: Intrinsics, lens: Lens) -> tuple[tuple[Runs, ...], float]:
    """A camera's rays, as seen by itself, in strips of `_rows` rows, and the typical angle between neighbours."""
    strips, steps = [], []
    for top in range(0, pixels.height, _rows(pixels)):
        strip = pixels.cropped(0, top, pixels.width, min(_rows(pixels), pixels.height - top))
        rays = lens.unproject(strip.from_pixels(strip.grid()))
        steps.append(np.linalg.norm(np.diff(rays[::8], axis=1), axis=-1).ravel())
        strips.append(Runs.gather(np.zeros((1, 3)), rays.reshape(-1, 3)))
    apart = np.concatenate(steps)
    apart = apart[np.isfinite(apart)]
    return tuple(strips), float(np.median(apart)) if apart.size else 0.0


_kept_strips = lru_cache(maxsize=1)(_strips)  # while the camera only moves; one, for a class shares one memory


def _rows(pixels: Intrinsics) -> int:
    """How many rows of a picture are traced together."""
    return max(BLOCK // pixels.width, 1)
