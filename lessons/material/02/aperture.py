"""The thin-lens camera: every point of its aperture is a pinhole camera of its own, and the picture is their mean.

Blur, the shapes of highlights and the dimming by a mask follow from the rays alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from camviz import optics
from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes.rays import Floats
from camviz.scenes.scene import Scene, render

Shape = Literal["disc", "polygon", "ring", "heart"]
Half = Literal["nothing", "left half", "right half", "upper half", "lower half"]
_GOLDEN = np.pi * (3 - 5**0.5)
_RING = 0.6  # inner radius of the ring, the outer being 1: a mirror lens's
_SIDES = {"left half": (-1, 0), "right half": (1, 0), "upper half": (0, -1), "lower half": (0, 1)}


@dataclass(frozen=True, eq=False)
class Aperture:
    """Which points of the lens let light through: a shape, of which a half may be covered, behind a mask.

    Points are in radii of the lens, x to the right and y down as the camera looks. A polygon has `blades` corners, one
    at the top. `mask` is a picture (height, width) of transmissions 0 … 1 over the square around the lens. Raises
    ValueError for what is none of these.
    """

    shape: Shape = "disc"
    blades: int = 6
    covered: Half = "nothing"
    mask: Array | None = None

    def __post_init__(self) -> None:
        for name, kind in (("shape", Shape), ("covered", Half)):
            if getattr(self, name) not in get_args(kind):
                raise ValueError(f"{name} must be one of {', '.join(get_args(kind))}, got {getattr(self, name)!r}")
        if int(self.blades) != self.blades or self.blades < 3:
            raise ValueError(f"blades must be a whole number, at least 3, got {self.blades}")
        if self.mask is not None and (np.ndim(self.mask) != 2 or not ((self.mask >= 0) & (self.mask <= 1)).all()):
            raise ValueError(f"mask must be (height, width) numbers from 0 to 1, got shape {np.shape(self.mask)}")

    def passes(self, points: Array) -> Array:
        """The share of light 0 … 1, (...), that passes at points (..., 2)."""
        light = (np.linalg.norm(points, axis=-1) <= 1) & self._inside(points)
        if self.covered != "nothing":
            light &= points @ _SIDES[self.covered] <= 0
        return light.astype(float) if self.mask is None else light * self._looked_up(points)

    def _inside(self, points: Array) -> Array:
        x, y = np.moveaxis(points, -1, 0)
        if self.shape == "ring":
            return np.hypot(x, y) >= _RING
        if self.shape == "polygon":
            half = np.pi / self.blades  # from a corner to the middle of a side
            turn = (np.arctan2(x, -y) % (2 * half)) - half
            return np.hypot(x, y) * np.cos(turn) <= np.cos(half)
        if self.shape == "heart":
            x, y = 1.32 * x, 0.12 - 1.32 * y
            return (x**2 + y**2 - 1) ** 3 <= x**2 * y**3
        return np.ones(x.shape, dtype=bool)

    def _looked_up(self, points: Array) -> Array:
        mask = np.asarray(self.mask, dtype=float)
        column, row = (np.clip((p + 1) / 2 * n, 0, n - 1).astype(int) for p, n in zip(
            np.moveaxis(points, -1, 0), mask.shape[::-1], strict=True
        ))  # fmt: skip
        return mask[row, column]


def spiral(samples: int) -> Array:
    """`samples` points (n, 2) spread evenly over the unit disc: Vogel's sunflower (Mathematical Biosciences 44, 1979).

    Ring by ring each has the same area to itself, so that their mean squared radius is that of the disc, ½.
    """
    if int(samples) != samples or samples < 1:
        raise ValueError(f"samples must be a whole number, at least 1, got {samples}")
    i = np.arange(samples)
    radius = np.sqrt((i + 0.5) / samples)
    return radius[:, None] * np.stack([np.cos(_GOLDEN * i), np.sin(_GOLDEN * i)], axis=-1)


@dataclass(frozen=True, eq=False)
class ThinLensCamera:
    """A camera with a thin lens of `focal_mm` at `f_number`, its sensor moved to where `focus_m` is sharp.

    `width` × `height` square pixels on a sensor `sensor_mm` wide; `focus_m` metres before the lens, along its axis.
    Raises ValueError naming what is not positive, and for a focus inside the focal length, which no sensor can have.
    """

    width: int = 320
    height: int = 240
    sensor_mm: float = 36.0
    focal_mm: float = 50.0
    f_number: float = 2.0
    focus_m: float = 2.0
    aperture: Aperture = field(default_factory=Aperture)
    world_from_cam: RigidTransform = field(default_factory=RigidTransform.identity)

    def __post_init__(self) -> None:
        for name in ("sensor_mm", "focal_mm", "f_number", "focus_m"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be positive and finite, got {getattr(self, name)}")
        if not 1000 * self.focus_m > self.focal_mm:
            raise ValueError(f"focus_m must lie beyond the focal length, {self.focal_mm} mm, got {self.focus_m} m")

    @property
    def aperture_mm(self) -> float:
        """Diameter f / N of the open lens."""
        return self.focal_mm / self.f_number

    @property
    def image_mm(self) -> float:
        """From the lens to the sensor."""
        return float(optics.image_distance_mm(self.focal_mm, 1000 * self.focus_m))

    @property
    def camera(self) -> Camera:
        """The camera of the rays through the middle of the lens, its focal length in pixels being v / pitch."""
        pixels = Intrinsics.from_sensor(self.width, self.height, self.image_mm, 1000 * self.sensor_mm / self.width)
        return Camera(pixels, world_from_cam=self.world_from_cam)

    @property
    def parallax_px(self) -> float:
        """Pixels by which what is 1/m nearer, in 1/depth, moves when it is seen from the rim of the lens."""
        return self.aperture_mm / 2000 * self.camera.intrinsics.fx

    def blur_px(self, depth_m: Array | float) -> Array:
        """Diameter (...) in pixels of the disc that a point at depth (...) makes: the closed form."""
        blur = optics.circle_of_confusion_mm(
            self.focal_mm, self.f_number, 1000 * self.focus_m, 1000 * np.asarray(depth_m)
        )
        return blur * self.width / self.sensor_mm

    def points(self, samples: int) -> tuple[Array, Array]:
        """Points (samples, 2) of the lens in radii, and the share of light (samples,) that passes at each."""
        points = spiral(samples)
        return points, self.aperture.passes(points)

    def seen_from(self, point: Array) -> Camera:
        """The pinhole camera at a point (2,) of the lens, in radii, through which the plane in focus looks the same.

        Its centre is moved by a, and its picture is shifted so that points at depth s stay where they are:
        u = fx (X - a)/Z + cx + fx a/s.
        """
        middle, offset = self.camera, np.asarray(point) * self.aperture_mm / 2000
        shift = middle.intrinsics.fx * offset / self.focus_m
        pixels = replace(middle.intrinsics, cx=middle.intrinsics.cx + shift[0], cy=middle.intrinsics.cy + shift[1])
        there = self.world_from_cam * RigidTransform.from_translation([*offset, 0.0])
        return Camera(pixels, world_from_cam=there)


def photograph(scene: Scene, camera: ThinLensCamera, samples: int = 64) -> Floats:
    """The picture (height, width, 3), linear light: the mean over `samples` points of the lens of what each sees.

    Every ray is traced, which takes as long as `samples` pictures; `camviz_school.views.parallax` is the fast way. Rays
    that the aperture stops bring no light: half a lens makes a picture half as bright.
    """
    light = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
    for point, passes in zip(*camera.points(samples), strict=True):
        if passes > 0:
            light += np.float32(passes / samples) * render(scene, camera.seen_from(point))
    return light
