"""A stereo pair on its way to being rectified: its cameras, pictures, disparities and the truth, kept once made.

Everything here is a function of a `Source`, the baseline and the way gone, so that what does not change costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Lens, Perspective
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.views import garden

FINE, COARSE = 480, 192  # pixels on the longer side of what is matched
WRONG = 1.0  # a disparity is, that is off by more than so many pixels
_OUTSIDE = (38, 44, 54)  # what a rectified picture shows where the original has nothing


@dataclass(frozen=True, eq=False)
class Source:
    """Two cameras and what they see: the garden, or `photographs`, (height, width, 3) uint8 RGB each.

    `distances` (height, width) in metres along the rays of the left picture's pixels are the truth, NaN where unknown.
    """

    left: Camera
    right: Camera
    photographs: tuple[np.ndarray, np.ndarray] | None = None
    distances: np.ndarray | None = None


@dataclass(frozen=True)
class Stage:
    """The two cameras as given, as rectified, and as they are on the way between the two."""

    left_original: Camera
    right_original: Camera
    pair: twoview.RectifiedPair
    left: Camera
    right: Camera

    @property
    def doffs(self) -> float:
        """cx_right − cx_left in pixels; 0 once rectified."""
        return self.right.intrinsics.cx - self.left.intrinsics.cx

    def depth(self, disparity: ArrayLike) -> Array:
        """Z = f B / (d + doffs) in metres, as if the pair were rectified, which it may not be yet."""
        return twoview.depth_from_disparity(disparity, self.left.intrinsics.fx, self.pair.baseline, self.doffs)


@dataclass(frozen=True, eq=False)
class StereoPictures:
    """What the two cameras of a stage see, and `distances` (height, width) along the left one's rays, NaN = unknown."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    distances: NDArray[np.float32]


@lru_cache(maxsize=16)
def stage(source: Source, baseline: float, rectify: float) -> Stage:
    """The cameras `baseline` metres apart, a fraction `rectify` of the way from how they stand to a rectified pair."""
    left_from_right = twoview.right_from_left(source.right, source.left)
    apart = left_from_right.translation * (baseline / np.linalg.norm(left_from_right.translation))
    placed = RigidTransform.from_components(apart, left_from_right.rotation)
    pair = twoview.rectify(source.left, source.right.at(source.left.world_from_cam * placed))
    left, right = pair.left_original, pair.right_original
    return Stage(left, right, pair, between(left, pair.left, rectify), between(right, pair.right, rectify))


def between(start: Camera, end: Camera, way: float) -> Camera:
    """The camera a fraction `way` of the turn from `start` to `end`, in the same place; K and lens change in step.

    The coefficients of a Brown–Conrady lens shrink with the way; another lens that bends is straightened at once.
    """
    if way in (0, 1):
        return end if way else start
    first, last = start.world_from_cam.rotation, end.world_from_cam.rotation
    turned = first * Rotation.from_rotvec(way * (first.inv() * last).as_rotvec())
    sizes = {name: getattr(start.intrinsics, name) for name in ("width", "height")}
    rest = {
        name: (1 - way) * getattr(start.intrinsics, name) + way * getattr(end.intrinsics, name)
        for name in ("fx", "fy", "cx", "cy", "skew")
    }
    pose = RigidTransform.from_components(start.centre, turned)
    return Camera(Intrinsics(**sizes, **rest), _weakened(start.lens, 1 - way), pose)


def seen_from_there(camera: Camera, other: Camera, uv: ArrayLike) -> Array:
    """Where `camera` sees what `other`, standing in the same place, sees at pixels (..., 2); NaN where it does not."""
    (R, _), (R_other, _) = camera.extrinsics, other.extrinsics
    rays = other.lens.unproject(other.intrinsics.from_pixels(uv)) @ (R @ R_other.T).T
    return camera.intrinsics.to_pixels(camera.lens.project(rays))


def _weakened(lens: Lens, share: float) -> Lens:
    if not isinstance(lens, BrownConrady) or not lens.is_distorted:
        return Perspective()
    return BrownConrady(**{one.name: share * getattr(lens, one.name) for one in fields(lens)})


# Pictures ------------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def pictures(source: Source, baseline: float, rectify: float, side: int) -> StereoPictures:
    """What the stage's cameras see, `side` pixels on the longer side: the originals' pictures, resampled."""
    now, taken = stage(source, baseline, rectify), _originals(source, baseline, side)
    if rectify == 0:
        return taken
    left = _resampled(taken.left, now.left_original, now.left, cv2.INTER_LINEAR, _OUTSIDE)
    right = _resampled(taken.right, now.right_original, now.right, cv2.INTER_LINEAR, _OUTSIDE)
    distances = _resampled(taken.distances, now.left_original, now.left, cv2.INTER_NEAREST, np.nan)
    return StereoPictures(left, right, distances)


@lru_cache(maxsize=4)
def _originals(source: Source, baseline: float, side: int) -> StereoPictures:
    now = stage(source, baseline, 0.0)
    if source.photographs is None:
        views = [garden.taken(camera, side)[0] for camera in (now.left, now.right)]
        return StereoPictures(views[0], views[1], garden.distances(now.left, side))
    small = source.left.intrinsics.within(side)
    size = (small.width, small.height)
    left, right = (cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in source.photographs)
    if source.distances is None:
        return StereoPictures(left, right, np.full(size[::-1], np.nan, np.float32))
    return StereoPictures(left, right, cv2.resize(source.distances, size, interpolation=cv2.INTER_NEAREST))


def _resampled(image: np.ndarray, original: Camera, camera: Camera, how: int, outside: object) -> np.ndarray:
    """What `camera` sees, made of the `image` that `original` took in the same place."""
    side = max(image.shape[:2])
    old, new = original.intrinsics.within(side), camera.intrinsics.within(side)
    if not (original.lens.is_distorted or camera.lens.is_distorted):
        H = old.K @ original.extrinsics[0] @ camera.extrinsics[0].T @ np.linalg.inv(new.K)
        size = (new.width, new.height)
        return cv2.warpPerspective(image, H, size, flags=how | cv2.WARP_INVERSE_MAP, borderValue=outside)
    # A lens bends smoothly: every fourth pixel of the map is computed, one more beyond each edge, the rest in between.
    width, height = (4 * -(-size // 4) for size in (new.width, new.height))
    u, v = (np.arange(-4, size + 4, 4) + 1.5 for size in (width, height))
    nodes = np.stack(np.meshgrid(u, v), axis=-1)
    uv = seen_from_there(replace(original, intrinsics=old), replace(camera, intrinsics=new), nodes)
    map_uv = cv2.resize(uv.astype(np.float32), (width + 8, height + 8), interpolation=cv2.INTER_LINEAR)
    map_uv = np.nan_to_num(map_uv[4 : 4 + new.height, 4 : 4 + new.width], nan=-9)
    return cv2.remap(image, map_uv, None, how, borderValue=outside)


# Disparities ---------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def disparities(
    source: Source, baseline: float, rectify: float, side: int, method: str, block_size: int, count: int
) -> NDArray[np.float32]:
    """What a matcher finds along the rows of the stage's pictures (height, width), in pixels of the full picture.

    `block_size` and `count` are in pixels of the full picture too, as far as a smaller picture has such blocks.
    """
    seen = pictures(source, baseline, rectify, side)
    scale = seen.left.shape[1] / source.left.intrinsics.width
    block = max(5 if method == "BM" else 3, 2 * round((scale * block_size - 1) / 2) + 1)
    sought = 16 * max(1, round(scale * count / 16 + 0.49))
    return twoview.disparity(seen.left, seen.right, method, disparities=sought, block_size=block) / np.float32(scale)


@lru_cache(maxsize=4)
def true_disparities(source: Source, baseline: float, rectify: float, side: int) -> NDArray[np.float32]:
    """u_left − u_right (height, width) in pixels of the full picture, of what every pixel truly shows.

    NaN where that is unknown and where it lies to the left of the right picture. For coarse pictures one pixel in four
    stands for all.
    """
    now, seen = stage(source, baseline, rectify), pictures(source, baseline, rectify, side)
    if np.isnan(seen.distances).all():
        return seen.distances
    step = 2 if side <= COARSE else 1
    small = now.left.intrinsics.within(max(seen.left.shape[:2]))
    uv = small.grid()[::step, ::step]
    rays = now.left.lens.unproject(small.from_pixels(uv)) @ now.left.extrinsics[0]
    points = now.left.centre + seen.distances[::step, ::step, None] * rays
    scale = now.left.intrinsics.width / small.width
    u_right = now.right.project(points)[..., 0]
    d = scale * (uv[..., 0] + 0.5) - 0.5 - np.where(u_right > -0.5, u_right, np.nan)
    return cv2.resize(d.astype(np.float32), (small.width, small.height), interpolation=cv2.INTER_NEAREST)


@lru_cache(maxsize=8)
def score(
    source: Source, baseline: float, rectify: float, side: int, method: str, block_size: int, count: int
) -> twoview.MatchingScore:
    """The matcher's disparities against the true ones."""
    found = disparities(source, baseline, rectify, side, method, block_size, count)
    return twoview.matching_score(found, true_disparities(source, baseline, rectify, side), WRONG)


@lru_cache(maxsize=8)
def depth_limits(source: Source) -> tuple[float, float]:
    """Round depths in metres between which most of the scene lies: the true ones, or else what is measured."""
    pair = twoview.rectify(source.left, source.right)
    baseline, side = pair.baseline, COARSE
    found = true_disparities(source, baseline, 1.0, side)
    if not np.isfinite(found).any():
        found = disparities(source, baseline, 1.0, side, "SGM", 9, 128)
    depths = pair.depth(found)
    low, high = np.percentile(depths[np.isfinite(depths)], [1, 95]) if np.isfinite(depths).any() else (1.0, 10.0)
    step = 10 ** np.floor(np.log10(high))
    low, high = step / 2 * np.floor(2 * low / step), step / 2 * np.ceil(2 * high / step)
    return float(low), float(high)
