"""What there is to judge a calibration by: its numbers, the corners it was solved from, pictures, another one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from camviz.calibration.adjustment import Adjustment
from camviz.calibration.models import poses_from_rays
from camviz.calibration.types import Board, Calibration
from camviz.cameras import Camera
from camviz.clinic.catalogue import Lacking
from camviz.clinic.observed import Observed
from camviz.lenses import Cylindrical, Equirectangular
from camviz.lenses.base import Array
from camviz.poses import RigidTransform

if TYPE_CHECKING:
    from camviz.clinic.rig import Pair

PANORAMAS = (Cylindrical, Equirectangular)


@dataclass(frozen=True, eq=False)
class Evidence:
    """A calibration, another one, (width, height) of pictures by their names, and the board as it was measured."""

    calibration: Calibration
    compare: Calibration | None = None
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    board: Board | None = None

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        """The cameras that differ in their pixels or their lens, by the first name that has them."""
        distinct: dict[object, str] = {}
        for name, camera in self.calibration.cameras.items():
            distinct.setdefault((camera.intrinsics, camera.lens), name)
        return {name: self.calibration.cameras[name] for name in distinct.values()}

    def counterparts(self) -> Iterator[tuple[str, Camera, Camera]]:
        """As `matched`, without cameras that share their pixels and lens with one before."""
        return (each for each in self.matched() if each[0] in self.cameras)

    def matched(self) -> Iterator[tuple[str, Camera, Camera]]:
        """Name, camera, and the same camera in the other calibration: by name, else by order if both have as many."""
        if self.compare is None:
            return
        ours, others = self.calibration.cameras, self.compare.cameras
        if set(ours) & set(others):
            for name in ours:
                if name in others:
                    yield name, ours[name], others[name]
        elif len(ours) == len(others):
            for (name, camera), other in zip(ours.items(), others.values(), strict=True):
                yield name, camera, other

    @cached_property
    def cam_from_board(self) -> dict[str, RigidTransform]:
        """The board's poses by camera: the file's, or found from its corners where it has none."""
        calibration, poses = self.calibration, dict(self.calibration.cam_from_board)
        if calibration.board is not None:
            for name, pixels in calibration.detections.items():
                if name not in poses and pixels.shape[1] == calibration.board.columns * calibration.board.rows:
                    poses[name] = board_poses(calibration.cameras[name], calibration.board, pixels)
        return poses

    @cached_property
    def pairs(self) -> list[Pair]:
        """The stereo pairs."""
        from camviz.clinic.rig import pairs

        return pairs(self)

    @cached_property
    def observed(self) -> dict[str, Observed]:
        """The cameras whose corners, board and poses are known."""
        calibration = replace(self.calibration, cam_from_board=self.cam_from_board)
        found = {}
        for name, pixels in calibration.detections.items():
            board = calibration.board
            if board is not None and name in self.cam_from_board and pixels.shape[1] == board.columns * board.rows:
                observed = Observed(name, Adjustment.of(calibration, name))
                if observed.adjustment.posed.any():
                    found[name] = observed
        return found

    def picture(self, name: str, view: int) -> str:
        """What to call a view: the name of its picture, or its number."""
        pictures = self.calibration.pictures.get(name)
        called = pictures[view] if pictures else f"view {view + 1}"
        return called if len(self.calibration.cameras) == 1 else f"{name}, {called}"

    def sigma_of(self, name: str, parameter: str) -> float | None:
        """The standard deviation of an estimated intrinsic, from the file or from its corners; None where unknown."""
        estimated, covariance = self.calibration.estimated.get(name, ()), self.calibration.intrinsics_covariance
        if name in covariance and parameter in estimated:
            place = estimated.index(parameter)
            return float(np.sqrt(max(covariance[name][place, place], 0)))
        if name not in self.observed:
            return None
        adjustment = self.observed[name].adjustment
        names = adjustment.estimated[name]
        if parameter not in names or not np.isfinite(adjustment.sigma):
            return None
        place = names.index(parameter)
        return float(np.sqrt(max(adjustment.covariance[place, place], 0)))

    def focal_uncertainty(self, name: str) -> float | None:
        """σ of fx over fx; None where it cannot be told."""
        sigma = self.sigma_of(name, "fx")
        return None if sigma is None else sigma / self.calibration.cameras[name].intrinsics.fx


def no_corners(evidence: Evidence, what: str = "detected corners of a known board") -> Lacking:
    """That a check needs what only the solution's own views hold."""
    return Lacking(f"the file holds no {what}")


def board_poses(camera: Camera, board: Board, pixels: Array) -> RigidTransform:
    """cam_from_board of views (v, n, 2) from their rays; a view without enough corners has the board ahead."""
    ahead = RigidTransform.from_translation([0, 0, 10 * board.columns * board.square_size])
    poses = []
    for view in pixels:
        seen = np.isfinite(view).all(axis=-1)
        try:
            poses.append(poses_from_rays(camera, [board.corners[seen]], [view[seen]])[0])
        except (ValueError, np.linalg.LinAlgError):  # too few corners, on one line, or without rays
            poses.append(ahead)
    return RigidTransform.concatenate(poses)


def border_pixels(camera: Camera, samples: int = 16) -> Array:
    """The centres of pixels all along the border (n, 2)."""
    grid = camera.intrinsics
    return np.asarray(np.clip(grid.border(samples), [0, 0], [grid.width - 1, grid.height - 1]))
