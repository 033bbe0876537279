"""The undistorted pictures of one camera: their pinhole, the maps that lead to it, and what of them is a photograph."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.distortion import remap, undistort_maps, undistorted_intrinsics
from camviz.lenses import BrownConrady, ModifiedBrownConrady, Perspective
from camviz.lenses.base import Array

STRAIGHT = (Perspective, BrownConrady, ModifiedBrownConrady)
ROWS = 256  # of the picture that are mapped together: a phone's 48 megapixels would take gigabytes at once
SEEN = 255
ROUNDING = 0.01  # pixels beyond the outermost centres: no grey level changes by it


@dataclass(frozen=True, eq=False)
class Undistortion:
    """How the photographs of a camera become pictures of a pinhole.

    Args:
        camera: That took the photographs.
        target: The pinhole of the undistorted pictures, in pixels.

    >>> camera = Camera(Intrinsics(401, 401, 200, 200, 200, 200), BrownConrady(-0.05))
    >>> flat = Undistortion.of(camera, alpha=1)  # every pixel of the photograph, with borders that show nothing
    >>> flat.mask[[200, 200], [200, 0]]  # the middle; at the sides the corners reach further
    array([255,   0], dtype=uint8)
    """

    camera: Camera
    target: Intrinsics

    @classmethod
    def of(cls, camera: Camera, alpha: float = 0.0) -> Undistortion:
        """The undistortion from no black border (`alpha` 0) to every pixel of the photograph (1).

        Pixels are square: fx = fy. A plain lens shows the rectangle of OpenCV's choice in the middle of the picture.
        With a fisheye the pictures keep the principal point of the photographs: a wide field would be shifted by far.

        Args:
            camera: With any lens.
            alpha: From 0 to 1.

        Raises: ValueError where no picture of a pinhole shows what the camera sees, and for another alpha.
        """
        target, _ = undistorted_intrinsics(camera, alpha, square=True)
        return cls(camera, target if isinstance(camera.lens, STRAIGHT) else _scaled(camera, alpha))

    @property
    def pinhole(self) -> Camera:
        """The camera of the undistorted pictures, where the camera of the photographs stands."""
        return replace(self.camera, intrinsics=self.target, lens=Perspective())

    @cached_property
    def maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Where in the photograph each pixel lies: map_x and map_y (height, width) for cv2.remap, NaN for nowhere."""
        grid = self.target
        parts = [
            undistort_maps(self.camera, grid.cropped(0, top, grid.width, min(ROWS, grid.height - top)))
            for top in range(0, grid.height, ROWS)
        ]
        map_x, map_y = (np.concatenate(each) for each in zip(*parts, strict=True))
        return map_x, map_y

    @cached_property
    def mask(self) -> NDArray[np.uint8]:
        """255 where a pixel is wholly of the photograph, 0 where black is mixed in or nothing is seen."""
        (map_x, map_y), photo = self.maps, self.camera.intrinsics
        with np.errstate(invalid="ignore"):
            seen = np.logical_and(map_x >= -ROUNDING, map_x <= photo.width - 1 + ROUNDING)
            seen &= (map_y >= -ROUNDING) & (map_y <= photo.height - 1 + ROUNDING)
        return np.where(seen, SEEN, 0).astype(np.uint8)

    @property
    def masked(self) -> float:
        """The share of the picture that shows nothing."""
        return float(np.mean(self.mask == 0))

    def picture(self, photograph: NDArray[Any]) -> NDArray[Any]:
        """The undistorted picture, bilinear.

        Args:
            photograph: (height, width) or (height, width, channels), of the camera's size.

        Returns: Of the same shape and type; black where nothing is seen.
        Raises: ValueError for a photograph of another size.
        """
        grid, (height, width) = self.camera.intrinsics, photograph.shape[:2]
        if (width, height) != (grid.width, grid.height):
            raise ValueError(f"photograph must have {grid.width}×{grid.height} pixels, got {width}×{height}")
        return np.asarray(remap(photograph, self.maps))


def _scaled(camera: Camera, alpha: float) -> Intrinsics:
    """The camera's own principal point and one focal length: the largest that is needed for 0, the smallest for 1."""
    (inner, outer), grid = (_reach(camera, each) for each in (0.0, 1.0)), camera.intrinsics
    sides = np.array([grid.cx, grid.cy, grid.width - 1 - grid.cx, grid.height - 1 - grid.cy])
    if not ((sides > 0).all() and (inner > 0).all()):
        raise ValueError("the principal point of a fisheye must lie inside the picture, to be kept there")
    f = float((1 - alpha) * np.max(sides / inner) + alpha * np.min(sides / outer))
    return replace(grid, fx=f, fy=f, skew=0.0)


def _reach(camera: Camera, alpha: float) -> Array:
    """How far the undistorted picture of an alpha reaches on z = 1: left, up, right, down, in focal lengths."""
    target = undistorted_intrinsics(camera, alpha)[0]
    first, last = target.from_pixels([[0, 0], [target.width - 1, target.height - 1]])
    return np.concatenate([-first, last])
