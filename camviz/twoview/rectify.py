"""Rectification: turning two cameras, where they stand, so that matching points share a row; and depth from it."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics, rotate
from camviz.lenses import Perspective
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.twoview.epipolar import right_from_left


def depth_from_disparity(disparity: ArrayLike, focal_length: float, baseline: float, doffs: float = 0.0) -> Array:
    """Z = f B / (d + doffs) in metres of disparities d = u_left − u_right in pixels; inf at 0 and NaN below it.

    `doffs` is cx_right − cx_left, 0 in a pair that `rectify` made.
    """
    d = np.asarray(disparity, dtype=float) + doffs
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(d >= 0, focal_length * baseline / np.abs(d), np.nan)


def disparity_from_depth(depth: ArrayLike, focal_length: float, baseline: float, doffs: float = 0.0) -> Array:
    """d = f B / Z − doffs in pixels of depths Z in metres; NaN at and behind the cameras."""
    Z = np.asarray(depth, dtype=float)
    return focal_length * baseline / np.where(Z > 0, Z, np.nan) - doffs


def depth_error(depth: ArrayLike, focal_length: float, baseline: float, disparity_error: float = 0.5) -> Array:
    """ΔZ = Z² Δd / (f B) in metres, to first order, at depths Z in metres for `disparity_error` pixels."""
    return np.square(np.asarray(depth, dtype=float)) * disparity_error / (focal_length * baseline)


def depth_interval(
    depth: ArrayLike, focal_length: float, baseline: float, disparity_error: float = 0.5
) -> tuple[Array, Array]:
    """The nearest and farthest depths in metres within ±`disparity_error` pixels; exact, so the farthest may be inf."""
    d = disparity_from_depth(depth, focal_length, baseline)
    near, far = d + disparity_error, np.maximum(d - disparity_error, 0)
    return depth_from_disparity(near, focal_length, baseline), depth_from_disparity(far, focal_length, baseline)


@dataclass(frozen=True)
class RectifiedPair:
    """Two perspective cameras with one orientation and one K, their x axis along the baseline, and their originals."""

    left: Camera
    right: Camera
    left_original: Camera
    right_original: Camera

    @property
    def focal_length(self) -> float:
        """f in pixels, the same for both."""
        return self.left.intrinsics.fx

    @property
    def baseline(self) -> float:
        """B in metres."""
        return float(np.linalg.norm(self.right.centre - self.left.centre))

    def depth(self, disparity: ArrayLike) -> Array:
        """Z = f B / d in metres of disparities d = u_left − u_right in pixels."""
        return depth_from_disparity(disparity, self.focal_length, self.baseline)

    def maps(self) -> tuple[Array, Array]:
        """For the left and the right picture, the original pixel (height, width, 2) behind each rectified one.

        NaN where the original has none. What cv2.initUndistortRectifyMap makes, for any lens.
        """
        return _map(self.left, self.left_original), _map(self.right, self.right_original)


def rectify(left: Camera, right: Camera, intrinsics: Intrinsics | None = None) -> RectifiedPair:
    """A perspective pair in the places of `left` and `right`, under any lens, whose matching points share v.

    Each camera takes half of the rotation between them, then both turn by the least angle that lays their x axis along
    the baseline: Bouguet's method, as cv2.stereoRectify for a horizontal pair. `intrinsics` serves both pictures;
    without it they keep the left one's size and the smallest focal length, and look where the originals look.
    Raises ValueError when `right` does not stand to the right, and when the originals look along the baseline.
    """
    to_right = right_from_left(left, right)
    half = Rotation.from_rotvec(to_right.rotation.as_rotvec() / 2)
    x, y, z = -half.inv().apply(to_right.translation)
    if not x > 0:
        raise ValueError(
            f"the right camera must stand to the right of the left one, it is {x + 0.0:.3g} m from it along x"
        )
    # The least turn from the baseline b to x̂ is about b × x̂ = (0, z, −y).
    sine = np.hypot(y, z)
    turn = Rotation.from_rotvec(np.array([0, z, -y]) * (atan2(sine, x) / sine if sine > 0 else 0))
    world_from_rectified = left.world_from_cam.rotation * (turn * half).inv()
    intrinsics = intrinsics or _shared_intrinsics(left, right, world_from_rectified)
    rectified_left, rectified_right = (
        Camera(intrinsics, Perspective(), RigidTransform.from_components(camera.centre, world_from_rectified))
        for camera in (left, right)
    )
    return RectifiedPair(rectified_left, rectified_right, left, right)


def _shared_intrinsics(left: Camera, right: Camera, world_from_rectified: Rotation) -> Intrinsics:
    width, height = left.intrinsics.width, left.intrinsics.height
    f = min(getattr(camera.intrinsics, name) for camera in (left, right) for name in ("fx", "fy"))
    axes_world = [camera.world_from_cam.rotation.apply([0, 0, 1]) for camera in (left, right)]
    axes = Perspective().project(world_from_rectified.inv().apply(axes_world))
    if np.isnan(axes).any():
        raise ValueError("the cameras look along their baseline: no rectified pair sees what they see")
    # The two old optical axes land, on average, on the middle of the picture.
    cx, cy = (np.array([width, height]) - 1) / 2 - f * axes.mean(axis=0)
    return Intrinsics(width, height, f, f, cx, cy)


def _map(rectified: Camera, original: Camera) -> Array:
    world_from_original = original.world_from_cam.rotation
    return original.intrinsics.to_pixels(original.lens.project(rotate(world_from_original.inv(), rectified.rays())))
