"""Cameras: pixels (`Intrinsics`), a lens and a pose make a `Camera`; several that hold together make a `Rig`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite, radians, tan

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses import Lens, Perspective
from camviz.lenses.base import Array, as_points, blocked_matmul, unit
from camviz.poses import RigidTransform, Rotation


@dataclass(frozen=True)
class Intrinsics:
    """The pixel grid behind a lens: u = fx x + skew y + cx, v = fy y + cy (Hartley & Zisserman 2004, eq. 6.10).

    All in pixels, centres at integers: the image spans -0.5 … width-0.5 and -0.5 … height-0.5.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            size = getattr(self, name)
            if not isfinite(size) or int(size) != size or size < 1:
                raise ValueError(f"{name} must be a whole number of pixels, at least 1, got {size}")
        for name in ("fx", "fy"):
            if not (isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be a positive focal length in pixels, got {getattr(self, name)}")
        for name in ("cx", "cy", "skew"):
            if not isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be a finite number of pixels, got {getattr(self, name)}")

    @classmethod
    def from_fov(cls, width: int, height: int, hfov_deg: float) -> Intrinsics:
        """Square pixels and a centred principal point, seeing `hfov_deg` from the left edge to the right one.

        FOV = 2 atan(width / 2f): the field of a perspective lens. Raises ValueError outside (0, 180) degrees.
        """
        if not 0 < hfov_deg < 180:
            raise ValueError(f"hfov_deg must lie between 0 and 180 degrees, got {hfov_deg}")
        focal_length = width / (2 * tan(radians(hfov_deg) / 2))
        return cls(width, height, focal_length, focal_length, (width - 1) / 2, (height - 1) / 2)

    @classmethod
    def from_sensor(cls, width: int, height: int, focal_mm: float, pitch_um: float) -> Intrinsics:
        """Square pixels `pitch_um` micrometres apart, `focal_mm` millimetres behind the lens, centred."""
        if not (isfinite(pitch_um) and pitch_um > 0):
            raise ValueError(f"pitch_um must be a positive distance in micrometres, got {pitch_um}")
        focal_length = focal_mm * 1000 / pitch_um
        return cls(width, height, focal_length, focal_length, (width - 1) / 2, (height - 1) / 2)

    @classmethod
    def from_matrix(cls, K: ArrayLike, width: int, height: int) -> Intrinsics:
        """From a 3×3 camera matrix [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]; ValueError for any other form."""
        K = np.asarray(K, dtype=np.float64)
        if K.shape != (3, 3):
            raise ValueError(f"K must have shape (3, 3), got {K.shape}")
        if not np.array_equal(K[[1, 2, 2, 2], [0, 0, 1, 2]], [0, 0, 0, 1]):
            raise ValueError(f"K must be upper triangular with K[2, 2] = 1, got {K.tolist()}")
        return cls(width, height, *K[[0, 1, 0, 1, 0], [0, 1, 2, 2, 1]].tolist())

    @property
    def K(self) -> Array:
        """The 3×3 camera matrix."""
        return np.array([[self.fx, self.skew, self.cx], [0, self.fy, self.cy], [0, 0, 1]])

    def to_pixels(self, xy: ArrayLike) -> Array:
        """Pixels (..., 2) of lens coordinates (..., 2)."""
        xy = as_points(xy, 2, "xy")
        x, y = xy[..., 0], xy[..., 1]
        uv = np.empty(xy.shape)
        uv[..., 0], uv[..., 1] = self.fx * x + self.skew * y + self.cx, self.fy * y + self.cy
        return uv

    def from_pixels(self, uv: ArrayLike) -> Array:
        """Lens coordinates (..., 2) of pixels (..., 2)."""
        uv = as_points(uv, 2, "uv")
        xy = np.empty(uv.shape)
        xy[..., 1] = (uv[..., 1] - self.cy) / self.fy
        xy[..., 0] = (uv[..., 0] - self.cx - self.skew * xy[..., 1]) / self.fx
        return xy

    def contains(self, uv: ArrayLike) -> np.ndarray:
        """True where a pixel (..., 2) lies on the image; NaN does not."""
        u, v = np.moveaxis(as_points(uv, 2, "uv"), -1, 0)
        return (u >= -0.5) & (u <= self.width - 0.5) & (v >= -0.5) & (v <= self.height - 0.5)

    def resized(self, width: int, height: int) -> Intrinsics:
        """The same view sampled on another grid: f' = s f and, with centres at integers, c' = s c + (s - 1)/2."""
        sx, sy = width / self.width, height / self.height
        cx, cy = sx * self.cx + (sx - 1) / 2, sy * self.cy + (sy - 1) / 2
        return Intrinsics(width, height, sx * self.fx, sy * self.fy, cx, cy, sx * self.skew)

    def within(self, side: int) -> Intrinsics:
        """The same view on the grid of its aspect whose longer side has `side` pixels, and the shorter at least one."""
        scale = side / max(self.width, self.height)
        return self.resized(max(1, round(scale * self.width)), max(1, round(scale * self.height)))

    def cropped(self, x0: int, y0: int, width: int, height: int) -> Intrinsics:
        """The window whose first pixel was (x0, y0): only the principal point moves."""
        return replace(self, width=width, height=height, cx=self.cx - x0, cy=self.cy - y0)

    def binned(self, factor: int) -> Intrinsics:
        """Blocks of factor × factor pixels read as one; left-over columns and rows are dropped."""
        if int(factor) != factor or factor < 1:
            raise ValueError(f"factor must be a whole number, at least 1, got {factor}")
        width, height = self.width // factor, self.height // factor
        return self.cropped(0, 0, width * factor, height * factor).resized(width, height)

    def grid(self) -> Array:
        """Every pixel centre, (height, width, 2)."""
        u, v = np.meshgrid(np.arange(self.width, dtype=float), np.arange(self.height, dtype=float))
        return np.stack([u, v], axis=-1)

    def border(self, samples: int = 16) -> Array:
        """The image's outline as pixels (4 * samples, 2), clockwise from the top left corner."""
        s = np.arange(samples) / samples
        u = np.concatenate([s, np.ones(samples), 1 - s, np.zeros(samples)]) * self.width - 0.5
        v = np.concatenate([np.zeros(samples), s, np.ones(samples), 1 - s]) * self.height - 0.5
        return np.stack([u, v], axis=-1)


@dataclass(frozen=True)
class Camera:
    """Intrinsics, a lens and a pose. `world_from_cam` says where the camera stands and looks."""

    intrinsics: Intrinsics
    lens: Lens = field(default_factory=Perspective)
    world_from_cam: RigidTransform = field(default_factory=RigidTransform.identity)

    @property
    def centre(self) -> Array:
        """C, the point (3,) in the world through which all rays pass."""
        return np.asarray(self.world_from_cam.translation, dtype=float)

    @property
    def cam_from_world(self) -> RigidTransform:
        """The extrinsics [R | t] of the textbooks; t = -R C."""
        return self.world_from_cam.inv()

    @cached_property
    def extrinsics(self) -> tuple[Array, Array]:
        """R (3, 3), whose rows are the camera's axes in the world, and t (3,) of [R | t]."""
        world_from_cam = self.world_from_cam.as_matrix()
        R = world_from_cam[:3, :3].T
        t = -R @ world_from_cam[:3, 3]
        R.flags.writeable = t.flags.writeable = False
        return R, t

    def project(self, points_world: ArrayLike) -> Array:
        """Pixels (..., 2) of world points (..., 3) in metres, K ∘ lens ∘ cam_from_world; NaN where there is none."""
        R, t = self.extrinsics
        points_cam = blocked_matmul(as_points(points_world, 3, "points_world"), R.T) + t
        return self.intrinsics.to_pixels(self.lens.project(points_cam))

    def unproject(self, uv: ArrayLike) -> Array:
        """Unit rays (..., 3) in the world, from the centre through pixels (..., 2); NaN where there is no ray."""
        R, _ = self.extrinsics
        return blocked_matmul(self.lens.unproject(self.intrinsics.from_pixels(uv)), R)

    def rays(self) -> Array:
        """The unit ray (height, width, 3) in the world of every pixel."""
        return self.unproject(self.intrinsics.grid())

    def sees(self, points_world: ArrayLike) -> np.ndarray:
        """True where a world point (..., 3) has an image inside the picture."""
        return self.intrinsics.contains(self.project(points_world))

    def frustum(self, near: float, far: float, samples: int = 16) -> tuple[Array, Array]:
        """The rims of the viewed volume at distances `near` and `far` in metres: two outlines (n, 3) in the world.

        Points of the image's border at equal distance *along the ray*, so the rims bend with the lens.
        """
        rays = self.unproject(self.intrinsics.border(samples))
        return self.centre + near * rays, self.centre + far * rays

    def at(self, world_from_cam: RigidTransform) -> Camera:
        """The same camera, standing elsewhere."""
        return replace(self, world_from_cam=world_from_cam)


@dataclass(frozen=True)
class Rig:
    """Named cameras that keep their places relative to each other."""

    cameras: Mapping[str, Camera]

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras.values())

    def __getitem__(self, name: str) -> Camera:
        return self.cameras[name]

    def a_from_b(self, a: str, b: str) -> RigidTransform:
        """The transform that takes points in camera b's frame to camera a's; for a stereo pair, right_from_left."""
        return self[a].cam_from_world * self[b].world_from_cam


def look_at(eye: ArrayLike, target: ArrayLike, down: ArrayLike = (0, 1, 0)) -> RigidTransform:
    """The pose world_from_cam of a camera at `eye` (3,) that looks at `target` (3,) with its y axis towards `down`.

    Raises ValueError when the view direction is undefined or runs along `down`.
    """
    eye, target, down = (np.asarray(v, dtype=float) for v in (eye, target, down))
    forward = unit(target - eye)
    sideways = np.cross(unit(down), forward)
    if not np.linalg.norm(sideways) > 1e-9:  # NaN, or parallel but for rounding
        raise ValueError(f"cannot look from {eye.tolist()} at {target.tolist()} with down = {down.tolist()}")
    right = unit(sideways)
    axes = np.stack([right, np.cross(forward, right), forward], axis=-1)
    return RigidTransform.from_components(eye, Rotation.from_matrix(axes))


def transform(to_from: RigidTransform, points: ArrayLike) -> Array:
    """Points (..., 3) taken by a rigid transform; scipy's `apply` takes only (n, 3)."""
    matrix = to_from.as_matrix()
    return blocked_matmul(as_points(points, 3, "points"), matrix[:3, :3].T) + matrix[:3, 3]


def rotate(rotation: Rotation, vectors: ArrayLike) -> Array:
    """Vectors (..., 3) turned by a rotation."""
    return blocked_matmul(as_points(vectors, 3, "vectors"), rotation.as_matrix().T)
