"""A ring of cameras that look outwards, the panorama stitched from their pictures, and its parallax."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Intrinsics
from camviz.lenses import Equirectangular
from camviz.lenses.arrays import AnglesLike, LinearPicture32, UnitRaysLike
from camviz.lenses.base import Array, unit
from camviz.scenes import Scene


@dataclass(frozen=True)
class Ring:
    """A ring of cameras that look outwards, evenly spaced on a level circle around the origin.

    Each shows what lies nearest its own direction, and, with an overlap, a part of what its neighbours show.

    Args:
        cameras: How many, at least 2.
        radius: Of the circle, in metres.
        overlap: How far a camera's picture reaches into its neighbours' parts, 0 … 1 of the way.
        turn: The first camera looks so many radians to the right of z.

    Raises:
        ValueError: For fewer than 2 cameras, a radius below 0, an overlap outside 0 … 1 and a turn that is not finite.

    Source: Szeliski (2022), section 8.3.2, for parallax in stitched pictures.

    Six cameras on a circle of 10 cm are 10 cm from each other. Stitched for infinity, they show a point at 10 m twice,
    0.01 rad apart:

    >>> from math import inf
    >>> ring = Ring(6, radius=0.1)
    >>> round(ring.baseline, 3), ring.parallax(10, stitched=inf).round(3)
    (0.1, np.float64(0.01))
    """

    cameras: int
    radius: float
    overlap: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        if self.cameras != int(self.cameras) or self.cameras < 2:
            raise ValueError(f"cameras must be a whole number, at least 2, got {self.cameras}")
        if not (isfinite(self.radius) and self.radius >= 0):
            raise ValueError(f"radius must be a number of metres, at least 0, got {self.radius}")
        if not 0 <= self.overlap <= 1:
            raise ValueError(f"overlap must lie between 0 and 1, got {self.overlap}")
        if not isfinite(self.turn):
            raise ValueError(f"turn must be a finite angle in radians, got {self.turn}")

    @property
    def half_angle(self) -> float:
        """Between a camera's direction and the seam with its neighbour, radians: π/n."""
        return pi / self.cameras

    @property
    def baseline(self) -> float:
        """Between neighbouring cameras, metres."""
        return 2 * self.radius * sin(self.half_angle)

    @property
    def centres(self) -> Array:
        """Where the cameras are, (n, 3) in metres."""
        return self.radius * _towards(self.turn + 2 * self.half_angle * np.arange(self.cameras))

    @property
    def seams(self) -> Array:
        """The longitudes (n,) in radians, -π … π, at which the panorama changes from one camera to the next."""
        return np.sort((self.turn + self.half_angle * (2 * np.arange(self.cameras) + 1) + pi) % (2 * pi) - pi)

    def nearest(self, longitudes: AnglesLike) -> NDArray[np.intp]:
        """Which camera looks most nearly at a longitude.

        Returns: (...), numbers of cameras, from 0.
        """
        turns = self._turns(longitudes)
        return np.rint(turns).astype(np.intp) % self.cameras

    def second(self, longitudes: AnglesLike) -> tuple[NDArray[np.intp], Array]:
        """The next nearest camera, and its share of the picture.

        Returns:
            camera: (...), numbers of cameras, from 0.
            share: (...), half at a seam, 0 beyond the overlap.
        """
        turns = self._turns(longitudes)
        off = turns - np.rint(turns)  # ±½ at the seams
        other = (np.rint(turns) + np.where(off < 0, -1, 1)).astype(np.intp) % self.cameras
        if self.overlap == 0:
            return other, np.zeros_like(off)
        return other, np.maximum(0.5 - (0.5 - np.abs(off)) / self.overlap, 0)

    def _turns(self, longitudes: ArrayLike) -> Array:
        """Longitudes (...) counted in cameras from the first."""
        return (np.asarray(longitudes, dtype=float) - self.turn) / (2 * self.half_angle)

    def parallax(self, distance: ArrayLike, stitched: float) -> Array:
        """How far apart a panorama shows the two images of a point straight out at a seam, level with the ring.

        A camera α = π/n to the side sees the point ψ off the seam, tan ψ = r sin α / (Z - r cos α); its ray crosses the
        circle of radius S at φ = ψ - asin(Z sin ψ / S). Of two cameras: 2φ, about b (1/Z - 1/S) far away.

        Args:
            distance: (...), Z, from the ring's centre in metres.
            stitched: S, the distance in metres that the panorama is stitched for, which may be infinite.

        Returns: (...), in radians; positive where the images are crossed, nearer than S; NaN inside the ring.
        Raises: ValueError where S is not beyond the ring.
        """
        if not stitched > self.radius:
            raise ValueError(f"stitched must be beyond the ring, {self.radius:g} m, got {stitched}")
        Z, side = np.asarray(distance, dtype=float), self.radius * np.sin(self.half_angle)
        Z = np.where(self.radius < Z, Z, np.nan)
        ahead = Z - self.radius * np.cos(self.half_angle)
        off_seam = side / np.hypot(side / Z, 1 - self.radius * np.cos(self.half_angle) / Z)  # Z sin ψ, for Z = ∞ too
        return 2 * (np.arctan2(side, ahead) - np.arcsin(off_seam / stitched))

    def rays(self, directions: UnitRaysLike, stitched: float, camera: ArrayLike | None = None) -> tuple[Array, Array]:
        """The rays of cameras that stand in for rays from the middle.

        Args:
            stitched: The rays go to the points that lie so many metres out.
            camera: (...), numbers of cameras; by default the nearest.

        Returns:
            origins: (..., 3), in metres.
            directions: (..., 3), unit vectors.
        """
        directions = np.asarray(directions, dtype=float)
        nearest = self.nearest(np.arctan2(directions[..., 0], directions[..., 2]))
        starts = self.centres[nearest if camera is None else np.asarray(camera)]
        return np.broadcast_to(starts, directions.shape), unit(directions - starts / stitched)

    def panorama(self, scene: Scene, pixels: Intrinsics, stitched: float = inf) -> LinearPicture32:
        """The panorama of a scene; where cameras overlap, their pictures are faded into each other.

        Args:
            pixels: Equirectangular pixels; fx is their number per radian.
            stitched: The distance in metres that it is stitched for.
        """
        angles = pixels.from_pixels(pixels.grid()).reshape(-1, 2)
        directions = Equirectangular().unproject(angles)
        camera, share = self.second(angles[:, 0])
        mixed = share > 0
        both = self.rays(directions, stitched), self.rays(directions[mixed], stitched, camera[mixed])
        starts, rays = (np.concatenate(parts) for parts in zip(*both, strict=True))
        light = scene.trace(starts, rays, 1 / pixels.fx)[0]
        light, other = light[: len(angles)], light[len(angles) :]
        light[mixed] += share[mixed, None].astype(np.float32) * (other - light[mixed])
        return light.reshape(pixels.height, pixels.width, 3)


def all_round(width: int, up_deg: float = 45.0) -> Intrinsics:
    """Equirectangular pixels all the way round, `width` of them, and as far above and below the horizon."""
    if not 0 < up_deg <= 90:
        raise ValueError(f"up_deg must be above 0 and at most 90 degrees, got {up_deg}")
    f = width / (2 * pi)
    height = max(1, round(2 * np.radians(up_deg) * f))
    return Intrinsics(width, height, f, f, (width - 1) / 2, (height - 1) / 2)


def _towards(longitudes: ArrayLike) -> Array:
    longitudes = np.asarray(longitudes, dtype=float)
    return np.stack([np.sin(longitudes), 0 * longitudes, np.cos(longitudes)], axis=-1)
