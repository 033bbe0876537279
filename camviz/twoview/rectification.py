"""Rectification: turning two cameras, where they stand, so that matching points share a row; and depth from it."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2

import numpy as np

from camviz.cameras import Camera, Intrinsics, rotate
from camviz.lenses import Perspective
from camviz.lenses.arrays import Depths, DepthsLike, DisparitiesLike, Metres, PixelLength
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.twoview.epipolar import right_from_left

BESIDE = 1e-9  # of the way in the other directions: less is rounding


def depth_from_disparity(
    disparity: DisparitiesLike, focal_length: PixelLength, baseline: Metres, doffs: float = 0.0
) -> Array:
    """Depths Z = f B / (d + doffs) of disparities.

    Args:
        doffs: cx_right − cx_left in pixels, 0 in a pair that `rectify` made.

    Returns: (...), in metres; inf at d + doffs = 0 and NaN below it.
    Source: Szeliski (2022), section 12.1.1.

    >>> depth_from_disparity([50, 10, 0, -1], focal_length=500, baseline=0.1)
    array([ 1.,  5., inf, nan])
    """
    d = np.asarray(disparity, dtype=float) + doffs
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(d >= 0, focal_length * baseline / np.abs(d), np.nan)


def disparity_from_depth(depth: DepthsLike, focal_length: PixelLength, baseline: Metres, doffs: float = 0.0) -> Array:
    """Disparities d = f B / Z − doffs of depths.

    Args:
        doffs: cx_right − cx_left in pixels.

    Returns: (...), in pixels; NaN at and behind the cameras.
    Source: Szeliski (2022), section 12.1.1.

    >>> disparity_from_depth([1, 5, -1], focal_length=500, baseline=0.1)
    array([50., 10., nan])
    """
    Z = np.asarray(depth, dtype=float)
    return focal_length * baseline / np.where(Z > 0, Z, np.nan) - doffs


def depth_error(
    depth: DepthsLike, focal_length: PixelLength, baseline: Metres, disparity_error: PixelLength = 0.5
) -> Depths:
    """The error of depth that an error of disparity makes, to first order: ΔZ = Z² Δd / (f B).

    Source: D. Gallup et al., Variable baseline/resolution stereo, CVPR 2008.

    Five times as far, 25 times as uncertain:

    >>> depth_error([1, 5], focal_length=500, baseline=0.1)
    array([0.01, 0.25])
    """
    return np.square(np.asarray(depth, dtype=float)) * disparity_error / (focal_length * baseline)


def depth_interval(
    depth: DepthsLike, focal_length: PixelLength, baseline: Metres, disparity_error: PixelLength = 0.5
) -> tuple[Array, Array]:
    """The nearest and farthest depths that an error of disparity allows: exact, where `depth_error` is not.

    Returns:
        nearest: (...), in metres.
        farthest: (...), in metres; it may be inf.

    At 5 m d = 10, and 10.5 and 9.5 pixels are 4.76 and 5.26 m; at 100 m d = 0.5:

    >>> nearest, farthest = depth_interval([5, 100], focal_length=500, baseline=0.1)
    >>> nearest.round(2), farthest.round(2)
    (array([ 4.76, 50.  ]), array([5.26,  inf]))
    """
    d = disparity_from_depth(depth, focal_length, baseline)
    near, far = d + disparity_error, np.maximum(d - disparity_error, 0)
    return depth_from_disparity(near, focal_length, baseline), depth_from_disparity(far, focal_length, baseline)


@dataclass(frozen=True)
class RectifiedPair:
    """Two perspective cameras with one orientation and one K, their x axis along the baseline, and their originals.

    Attributes:
        left, right: Matching points have the same v in their pictures.
        left_original, right_original: Those that stand in the same places.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.poses import RigidTransform
    >>> left = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
    >>> pair = rectify(left, left.at(RigidTransform.from_translation([0.1, 0, 0])))
    >>> pair.focal_length, round(pair.baseline, 6), pair.depth(50).round(6)
    (500, 0.1, np.float64(1.0))
    """

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

    def depth(self, disparity: DisparitiesLike) -> Depths:
        """Depths Z = f B / d of disparities."""
        return depth_from_disparity(disparity, self.focal_length, self.baseline)

    def maps(self) -> tuple[Array, Array]:
        """The original pixel behind each rectified one: what cv2.initUndistortRectifyMap makes, for any lens.

        Returns:
            left: (height, width, 2), in pixels; NaN where the original has none.
            right: (height, width, 2), likewise.
        """
        return _map(self.left, self.left_original), _map(self.right, self.right_original)


def rectify(left: Camera, right: Camera, intrinsics: Intrinsics | None = None) -> RectifiedPair:
    """A perspective pair in the places of two cameras, under any lens, whose matching points share v.

    Each camera takes half of the rotation between them, then both turn by the least angle that lays their x axis along
    the baseline: Bouguet's method, as cv2.stereoRectify for a horizontal pair.

    Args:
        left, right: `right` stands to the right.
        intrinsics: Of both pictures; without them these keep the left one's size and the smallest focal length, and
            look where the originals look.

    Raises: ValueError when `right` does not stand to the right, and when the originals look along the baseline.
    Source: G. Bradski and A. Kaehler, Learning OpenCV (2008), chapter 12; Szeliski (2022), section 12.1.1.

    Two cameras that are turned towards each other; afterwards a point has the same row in both pictures:

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz import look_at
    >>> left, right = (Camera(Intrinsics(640, 480, 500, 500, 320, 240), world_from_cam=look_at((x, 0, 0), (0, 0, 3)))
    ...                for x in (-0.2, 0.2))
    >>> pair, point = rectify(left, right), [0.3, 0.4, 2.5]
    >>> [float(camera.project(point)[1].round(1)) for camera in (left, right, pair.left, pair.right)]
    [319.1, 320.4, 319.5, 319.5]
    """
    to_right = right_from_left(left, right)
    half = Rotation.from_rotvec(to_right.rotation.as_rotvec() / 2)
    x, y, z = -half.inv().apply(to_right.translation)
    if not x > BESIDE * (abs(y) + abs(z)):
        raise ValueError(f"the right camera must stand to the right of the left one, it stands {_where(x, y, z)}")
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


def _where(x: float, y: float, z: float) -> str:
    """Where a camera that is not to the right stands, in metres, and what can be done."""
    ways = {
        "to the left: exchange the two": -x,
        "below: turn both pictures by 90°": y,
        "above: turn both pictures by 90°": -y,
        "in front: no rectified pair sees what two cameras see that look along their baseline": z,
        "behind: no rectified pair sees what two cameras see that look along their baseline": -z,
    }
    way = max(ways, key=lambda name: ways[name])
    return f"{ways[way]:.3g} m {way}" if ways[way] > 0 else "in the same place: they see no depth"


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
