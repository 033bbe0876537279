"""Cameras, on one page because they explain each other: `Intrinsics`, a lens and a pose make a `Camera`.

Several cameras that hold together make a `Rig`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite, radians, tan

import numpy as np
from numpy.typing import ArrayLike

from camviz.lenses import Lens, Perspective
from camviz.lenses.arrays import (
    Count,
    Degrees,
    ImagePoints,
    ImagePointsLike,
    Mask,
    MatrixLike,
    Metres,
    Pixels,
    PixelsLike,
    Points,
    PointsLike,
    Rays,
    VectorLike,
    Vectors,
    VectorsLike,
)
from camviz.lenses.base import Array, as_point, as_points, blocked_matmul, unit
from camviz.poses import RigidTransform, Rotation

__all__ = ["Camera", "Intrinsics", "Rig", "look_at", "rotate", "transform"]


@dataclass(frozen=True)
class Intrinsics:
    """The pixel grid behind a lens: u = fx x + skew y + cx, v = fy y + cy.

    All in pixels, centres at integers: the image spans -0.5 … width-0.5 and -0.5 … height-0.5.

    Args:
        width, height: Size of the image in pixels.
        fx, fy: Focal lengths in pixels.
        cx, cy: Principal point in pixels.
        skew: In pixels; 0 where rows and columns are at right angles.

    Raises: ValueError for a size that is no whole number, a focal length that is not positive, and what is not finite.
    Source: Hartley & Zisserman (2004), eq. 6.10.

    >>> grid = Intrinsics(640, 480, fx=500, fy=500, cx=320, cy=240)
    >>> grid.to_pixels([0.1, -0.2])  # 0.1 focal lengths to the right, 0.2 up
    array([370., 140.])
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
    def from_fov(cls, width: Count, height: Count, hfov_deg: Degrees) -> Intrinsics:
        """Square pixels and a centred principal point, seeing `hfov_deg` from the left edge to the right one.

        FOV = 2 atan(width / 2f): the field of a perspective lens.

        Raises: ValueError for a field of view outside (0, 180) degrees.

        >>> round(Intrinsics.from_fov(640, 480, 90).fx, 6)  # tan 45° = 1: half the width
        320.0
        """
        if not 0 < hfov_deg < 180:
            raise ValueError(f"hfov_deg must lie between 0 and 180 degrees, got {hfov_deg}")
        focal_length = width / (2 * tan(radians(hfov_deg) / 2))
        return cls(width, height, focal_length, focal_length, (width - 1) / 2, (height - 1) / 2)

    @classmethod
    def from_sensor(cls, width: Count, height: Count, focal_mm: float, pitch_um: float) -> Intrinsics:
        """Square pixels and a centred principal point, from what a data sheet says.

        Args:
            focal_mm: From lens to sensor in millimetres: the focal length of a lens that is focused at infinity.
            pitch_um: Distance of neighbouring pixels in micrometres.

        Raises: ValueError for a pitch or a focal length that is not positive.

        >>> Intrinsics.from_sensor(1920, 1080, focal_mm=6, pitch_um=3).fx  # 6 mm / 3 µm
        2000.0
        """
        if not (isfinite(pitch_um) and pitch_um > 0):
            raise ValueError(f"pitch_um must be a positive distance in micrometres, got {pitch_um}")
        focal_length = focal_mm * 1000 / pitch_um
        return cls(width, height, focal_length, focal_length, (width - 1) / 2, (height - 1) / 2)

    @classmethod
    def from_matrix(cls, K: MatrixLike, width: Count, height: Count) -> Intrinsics:
        """From a camera matrix [[fx, skew, cx], [0, fy, cy], [0, 0, 1]].

        Raises: ValueError for a matrix of any other form.

        >>> Intrinsics.from_matrix([[500, 0, 320], [0, 510, 240], [0, 0, 1]], 640, 480).fy
        510.0
        """
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

    def to_pixels(self, xy: ImagePointsLike) -> Pixels:
        """Pixels of lens coordinates."""
        xy = as_points(xy, 2, "xy")
        x, y = xy[..., 0], xy[..., 1]
        uv = np.empty(xy.shape)
        uv[..., 0], uv[..., 1] = self.fx * x + self.skew * y + self.cx, self.fy * y + self.cy
        return uv

    def from_pixels(self, uv: PixelsLike) -> ImagePoints:
        """Lens coordinates of pixels: the inverse of `to_pixels`."""
        uv = as_points(uv, 2, "uv")
        xy = np.empty(uv.shape)
        xy[..., 1] = (uv[..., 1] - self.cy) / self.fy
        xy[..., 0] = (uv[..., 0] - self.cx - self.skew * xy[..., 1]) / self.fx
        return xy

    def contains(self, uv: PixelsLike) -> Mask:
        """Whether pixels lie on the image.

        >>> Intrinsics.from_fov(640, 480, 90).contains([[-0.5, 0], [-0.6, 0], [np.nan, 0]])
        array([ True, False, False])
        """
        u, v = np.moveaxis(as_points(uv, 2, "uv"), -1, 0)
        return (u >= -0.5) & (u <= self.width - 0.5) & (v >= -0.5) & (v <= self.height - 0.5)

    def resized(self, width: Count, height: Count) -> Intrinsics:
        """The same view sampled on another grid: f' = s f and, with centres at integers, c' = s c + (s - 1)/2.

        >>> Intrinsics(640, 480, 500, 500, 320, 240).resized(320, 240).cx  # 160 - 1/4, not 160
        159.75
        """
        sx, sy = width / self.width, height / self.height
        cx, cy = sx * self.cx + (sx - 1) / 2, sy * self.cy + (sy - 1) / 2
        return Intrinsics(width, height, sx * self.fx, sy * self.fy, cx, cy, sx * self.skew)

    def within(self, side: Count) -> Intrinsics:
        """The same view on the grid of its aspect whose longer side has `side` pixels, and the shorter at least one."""
        scale = side / max(self.width, self.height)
        return self.resized(max(1, round(scale * self.width)), max(1, round(scale * self.height)))

    def cropped(self, x0: Count, y0: Count, width: Count, height: Count) -> Intrinsics:
        """The window whose first pixel was (x0, y0), column and row: only the principal point moves."""
        return replace(self, width=width, height=height, cx=self.cx - x0, cy=self.cy - y0)

    def binned(self, factor: Count) -> Intrinsics:
        """Blocks of factor × factor pixels read as one; left-over columns and rows are dropped.

        Raises: ValueError for a factor that is no whole number, or below 1.
        """
        if int(factor) != factor or factor < 1:
            raise ValueError(f"factor must be a whole number, at least 1, got {factor}")
        width, height = self.width // factor, self.height // factor
        return self.cropped(0, 0, width * factor, height * factor).resized(width, height)

    def grid(self) -> Pixels:
        """Every pixel's centre, (height, width)."""
        u, v = np.meshgrid(np.arange(self.width, dtype=float), np.arange(self.height, dtype=float))
        return np.stack([u, v], axis=-1)

    def border(self, samples: Count = 16) -> Pixels:
        """The image's outline, clockwise from the top left corner: `samples` points along each side."""
        s = np.arange(samples) / samples
        u = np.concatenate([s, np.ones(samples), 1 - s, np.zeros(samples)]) * self.width - 0.5
        v = np.concatenate([np.zeros(samples), s, np.ones(samples), 1 - s]) * self.height - 0.5
        return np.stack([u, v], axis=-1)


@dataclass(frozen=True)
class Camera:
    """Intrinsics, a lens and a pose.

    Args:
        intrinsics: The pixel grid.
        lens: Perspective unless given.
        world_from_cam: Where the camera stands and looks, in metres; the origin, looking along z, unless given.

    >>> camera = Camera(Intrinsics.from_fov(641, 481, 90), world_from_cam=look_at((0, -2, -5), (0, 0, 0)))
    >>> camera.project([0, 0, 0])  # what it looks at, in the middle
    array([320., 240.])
    """

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

    def project(self, points_world: PointsLike) -> Pixels:
        """K ∘ lens ∘ cam_from_world: where points of the world appear in the picture.

        Source: Hartley & Zisserman (2004), section 6.1.

        >>> camera = Camera(Intrinsics.from_fov(641, 481, 90))  # f = 641/2, principal point (320, 240)
        >>> camera.project([[0, 0, 2], [1, 0, 2], [0, 0, -2]])
        array([[320.  , 240.  ],
               [480.25, 240.  ],
               [   nan,    nan]])
        """
        R, t = self.extrinsics
        points_cam = blocked_matmul(as_points(points_world, 3, "points_world"), R.T) + t
        return self.intrinsics.to_pixels(self.lens.project(points_cam))

    def unproject(self, uv: PixelsLike) -> Rays:
        """The rays through pixels.

        >>> Camera(Intrinsics.from_fov(641, 481, 90)).unproject([320, 240])
        array([0., 0., 1.])
        """
        R, _ = self.extrinsics
        return blocked_matmul(self.lens.unproject(self.intrinsics.from_pixels(uv)), R)

    def rays(self) -> Rays:
        """The ray in the world of every pixel, (height, width)."""
        return self.unproject(self.intrinsics.grid())

    def sees(self, points_world: PointsLike) -> Mask:
        """Whether points of the world have an image inside the picture."""
        return self.intrinsics.contains(self.project(points_world))

    def frustum(self, near: Metres, far: Metres, samples: Count = 16) -> tuple[Points, Points]:
        """The rims of the viewed volume at two distances, in the world: `samples` points along each side of the image.

        They are at equal distance *along the ray*, so the rims bend with the lens.
        """
        rays = self.unproject(self.intrinsics.border(samples))
        return self.centre + near * rays, self.centre + far * rays

    def at(self, world_from_cam: RigidTransform) -> Camera:
        """The same camera, standing elsewhere."""
        return replace(self, world_from_cam=world_from_cam)


@dataclass(frozen=True)
class Rig:
    """Named cameras that keep their places relative to each other.

    Args:
        cameras: The cameras by name.

    >>> from camviz.poses import RigidTransform
    >>> left = Camera(Intrinsics.from_fov(640, 480, 60))
    >>> rig = Rig({"left": left, "right": left.at(RigidTransform.from_translation([0.1, 0, 0]))})
    >>> rig.a_from_b("right", "left").translation  # the left camera is 0.1 m to the left of the right one
    array([-0.1,  0. ,  0. ])
    """

    cameras: Mapping[str, Camera]

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras.values())

    def __getitem__(self, name: str) -> Camera:
        if name not in self.cameras:
            raise KeyError(f"camera must be one of {', '.join(self.cameras)}, got {name!r}")
        return self.cameras[name]

    def a_from_b(self, a: str, b: str) -> RigidTransform:
        """The transform, in metres, that takes points in camera b's frame to camera a's: of a pair, right_from_left.

        Args:
            a, b: Names of cameras.

        Raises: KeyError for a name that is none of the cameras'.
        """
        return self[a].cam_from_world * self[b].world_from_cam


def look_at(eye: VectorLike, target: VectorLike, down: ArrayLike = (0, 1, 0)) -> RigidTransform:
    """The pose of a camera that looks at a point.

    Args:
        down: (3,), the direction, of any unit, that its y axis leans towards; y of the world unless given.

    Returns: world_from_cam.
    Raises: ValueError where the view direction is undefined or runs along `down`, and for other than 3 coordinates.

    >>> look_at(eye=(0, 0, 0), target=(3, 0, 0)).apply([0, 0, 1]).round(6)  # it looks along x
    array([1., 0., 0.])
    """
    eye, target, down = as_point(eye, "eye"), as_point(target, "target"), as_point(down, "down")
    forward = unit(target - eye)
    sideways = np.cross(unit(down), forward)
    if not np.linalg.norm(sideways) > 1e-9:  # NaN, or parallel but for rounding
        raise ValueError(f"cannot look from {eye.tolist()} at {target.tolist()} with down = {down.tolist()}")
    right = unit(sideways)
    axes = np.stack([right, np.cross(forward, right), forward], axis=-1)
    return RigidTransform.from_components(eye, Rotation.from_matrix(axes))


def transform(to_from: RigidTransform, points: PointsLike) -> Points:
    """Points taken by one rigid transform; SciPy's `apply` takes only (n, 3).

    Args:
        to_from: In metres.

    >>> from camviz.poses import RigidTransform
    >>> transform(RigidTransform.from_translation([1, 0, 0]), [[[0, 0, 2]]])
    array([[[1., 0., 2.]]])
    """
    matrix = to_from.as_matrix()
    return blocked_matmul(as_points(points, 3, "points"), matrix[:3, :3].T) + matrix[:3, 3]


def rotate(rotation: Rotation, vectors: VectorsLike) -> Vectors:
    """Vectors turned by one rotation.

    >>> from camviz.poses import Rotation
    >>> rotate(Rotation.from_euler("y", 90, degrees=True), [0, 0, 1]).round(6)  # forwards turns to the right
    array([1., 0., 0.])
    """
    return blocked_matmul(as_points(vectors, 3, "vectors"), rotation.as_matrix().T)
