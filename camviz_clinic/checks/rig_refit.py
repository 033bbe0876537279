"""A pair that is held as it was calibrated, and the same pair with its right camera placed anew by new views."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from camviz.cameras import Camera, transform
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.twoview.rectification import rectify
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.jacobian import pixel_jacobian, twist_jacobian
from camviz_clinic.calibration.types import Board, Mask
from camviz_clinic.checks.refit import GRID, bounds
from camviz_clinic.checks.rig import lone_poses, middlemost
from camviz_clinic.checks.view_by_view import ViewByView

Range = tuple[float, float, float]  # a change in pixels, RMS over the image, and its bounds


@dataclass(frozen=True, eq=False)
class RigRefit:
    """The corners that both cameras see, under the rig as it was calibrated (`held`) and one placed anew (`free`).

    Both cameras keep their intrinsics. The board's poses and bend are free.
    """

    held: Adjustment
    free: Adjustment

    @classmethod
    def of(
        cls,
        left: Camera,
        right: Camera,
        board: Board,
        corners: Mapping[str, Array],
        aside: Mapping[str, Mask],
        *,
        metres: bool = True,
    ) -> RigRefit:
        """Of pixels (views, corners, 2) of the cameras "left" and "right" in views that both have.

        Where the rig is not in `metres`, its baseline is made as long as the board has it.
        """
        first = Camera(left.intrinsics, left.lens)
        cameras = {"left": first, "right": right.at(left.cam_from_world * right.world_from_cam)}
        poses, seen = (lone_poses(camera, board, corners[name]) for name, camera in cameras.items())
        by_view = poses * seen.inv()
        begun = {"left": first, "right": right.at(by_view[middlemost(by_view)])}
        free = Adjustment(board, begun, corners, poses, {"left": (), "right": ()}, aside, np.zeros(2)).refined()
        if not metres:
            cameras["right"] = _with_baseline(cameras["right"], float(np.linalg.norm(free.cameras["right"].centre)))
        return cls(replace(free, cameras=cameras).refined(only_poses=True), free)

    @cached_property
    def covariance(self) -> Array:
        """Of the right camera's twist (6, 6), by the scatter from view to view."""
        place = self.free.place_of("right")
        return ViewByView.of(self.free).scatter * self.free.corner_covariance[place, place]

    @cached_property
    def distance(self) -> float:
        """How far the boards were along the left camera's axis, the median in metres."""
        return float(np.median(self.free.points_first[self.free.posed][..., 2]))

    @property
    def overlaps(self) -> bool:
        """Whether the right camera sees some of the left image at `distance`."""
        return len(self._moved[0]) > 0

    @property
    def rows(self) -> Range:
        """How far the right pixel is off across its epipolar line."""
        return self._off(1)

    @property
    def disparity(self) -> Range:
        """How far the right pixel is off along its epipolar line, of points at `distance`."""
        return self._off(0)

    @cached_property
    def depth(self) -> float:
        """What the error along the line is as a share of the depth, RMS over the image, at `distance`."""
        by_depth, shift, _ = self._moved
        length = np.linalg.norm(by_depth, axis=-1)
        share = np.sum(shift * by_depth, axis=-1) / length**2 / self.distance
        return float(np.sqrt(np.mean(share**2)))

    @property
    def scale(self) -> tuple[float, float]:
        """How much longer the baseline is by the board than in the file, as a share of it, and its σ."""
        before, after = (solved.cameras["right"].cam_from_world.translation for solved in (self.held, self.free))
        length = float(np.linalg.norm(before))
        along = after / np.linalg.norm(after)
        sigma = np.sqrt(along @ self.covariance[3:, 3:] @ along) / length
        return float(np.linalg.norm(after)) / length - 1, float(sigma)

    @cached_property
    def rectified_rows(self) -> Array:
        """v_left - v_right (n,) of the corners that both see, rectified by the file's numbers: no pose takes part.

        Raises ValueError where the file's pair cannot be rectified.
        """
        names = ("left", "right")
        left, right = (self.held.cameras[name] for name in names)
        pair = rectify(left, right)
        both = self.held.used["left"] & self.held.used["right"]
        rows = [
            turned.project(turned.centre + camera.unproject(self.held.detections[name][both]))[:, 1]
            for name, camera, turned in zip(names, (left, right), (pair.left, pair.right), strict=True)
        ]
        difference = rows[0] - rows[1]
        return difference[np.isfinite(difference)]

    def _off(self, axis: int) -> Range:
        """Along the epipolar line (0) or across it (1)."""
        by_depth, shift, columns = self._moved
        along = by_depth / np.linalg.norm(by_depth, axis=-1, keepdims=True)
        direction = along if axis == 0 else np.stack([-along[:, 1], along[:, 0]], axis=-1)
        root = np.sqrt(len(shift))
        found = np.sum(shift * direction, axis=-1) / root
        least, most = bounds(np.einsum("ni,nij->nj", direction, columns) / root, found, self.covariance)
        return float(np.linalg.norm(found)), least, most

    @cached_property
    def _moved(self) -> tuple[Array, Array, Array]:
        """Of points at `distance` over the left image that the right one sees: ∂q/∂Z (n, 2) of the right pixel q, how
        far q moves (n, 2), and ∂q/∂twist (n, 2, 6)."""
        left, before = self.held.cameras["left"], self.held.cameras["right"]
        after = self.free.cameras["right"]
        rays = left.lens.unproject(left.intrinsics.from_pixels(pixel_grid(left.intrinsics, GRID).reshape(-1, 2)))
        with np.errstate(divide="ignore", invalid="ignore"):
            rays = np.where(rays[:, 2:] > 0, rays / rays[:, 2:], np.nan)
        points, there = self.distance * rays, transform(after.cam_from_world, self.distance * rays)
        uv, by_point, _ = pixel_jacobian(after, there, ())
        shift = uv - before.project(points)
        known = np.isfinite(shift).all(axis=-1) & after.intrinsics.contains(uv)
        by_depth = np.einsum("nij,nj->ni", by_point @ after.cam_from_world.rotation.as_matrix(), rays)
        return by_depth[known], shift[known], (by_point @ twist_jacobian(there))[known]


def _with_baseline(right: Camera, length: float) -> Camera:
    centre = right.centre * length / np.linalg.norm(right.centre)
    return right.at(RigidTransform.from_components(centre, right.world_from_cam.rotation))
