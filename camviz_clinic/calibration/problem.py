"""The least-squares problem of a calibration: measurements, parameters and residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.jacobian import parameter
from camviz_clinic.calibration.types import Board, Calibration, Mask

LEAST_CORNERS = 4  # that a view must show for its pose to be known
POSE = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")


@dataclass(frozen=True, eq=False)
class Problem:
    """The measurements and the parameters of a calibration, and the residuals that these cameras and poses leave.

    Free are the `estimated` intrinsics of every camera, and the place of every camera but the first, whose frame all
    of them share. Free are also the board's pose in every view, and with `warp` the board's two sagittas in metres
    (`Board.warped`; None for a flat board). A pose moves by a twist (ω, τ) in the frame it leads to,
    p → p + ω × p + τ, in radians and metres.

    `detections` (views, corners, 2) in pixels are NaN where no corner was seen. Corners `set_aside` (views, corners)
    have residuals, but are not fitted (have no say). Nor is a view of fewer than four corners, or of corners on one
    line. `priors` are what is assumed of a camera's lens beforehand. With `independent_corners` it is known that the
    noise of corners is all that they are off by, and that it is each corner's own: so it is of a virtual camera. With
    `certain_board` the board is known to be as flat, or as bent, as the problem has it.
    """

    board: Board
    cameras: Mapping[str, Camera]
    detections: Mapping[str, Array] = field(repr=False)
    first_from_board: RigidTransform = field(repr=False)
    estimated: Mapping[str, tuple[str, ...]]
    set_aside: Mapping[str, Mask] = field(default_factory=dict, repr=False)
    warp: Array | None = None
    priors: Mapping[str, DenominatorPrior] = field(default_factory=dict)
    independent_corners: bool = False
    certain_board: bool = False

    def __post_init__(self) -> None:
        for name in self.cameras:
            shape, expected = self.detections[name].shape, (len(self.first_from_board), len(self.board.corners), 2)
            if shape != expected:
                raise ValueError(f"detections of {name} must have shape {expected} (views, corners, 2), got {shape}")

    @classmethod
    def of(cls, calibration: Calibration, *names: str) -> Self:
        """The problem that a calibration is a solution of, for one camera of it, or for several as a rig (or all).

        Where the file does not say which intrinsics were estimated, those were that are not zero. A view's pose is that
        by the camera which sees most of the board. Raises ValueError where the calibration holds no board, no corners
        or no poses of the named cameras.
        """
        names = names or tuple(calibration.cameras)
        board = _present(calibration, names)
        first_from_world = calibration.cameras[names[0]].cam_from_world
        cameras = {}
        for name in names:
            camera = calibration.cameras[name]
            cameras[name] = camera.at(first_from_world * camera.world_from_cam)
        detections = {name: np.asarray(calibration.detections[name], dtype=float) for name in names}
        return cls(
            board,
            cameras,
            detections,
            _first_from_board(cameras, detections, calibration.cam_from_board),
            {name: tuple(calibration.estimated.get(name) or assumed_estimated(cameras[name])) for name in names},
            {name: calibration.set_aside[name] for name in names if name in calibration.set_aside},
            calibration.board_warp,
            {name: calibration.priors[name] for name in names if name in calibration.priors},
        )

    # The measurements

    @property
    def views(self) -> int:
        """How many views there are, also without a say."""
        return len(self.first_from_board)

    @cached_property
    def corners(self) -> Array:
        """The board's corners (corners, 3) in its own frame, bent by the warp."""
        return self.board.corners if self.warp is None else self.board.warped(self.warp)

    @cached_property
    def points_first(self) -> Array:
        """The corners of every view, (views, corners, 3), in the first camera's frame."""
        return moved(self.first_from_board, self.corners)

    @cached_property
    def residuals(self) -> dict[str, Array]:
        """Detected less projected, in pixels (views, corners, 2) by camera; NaN where a corner was not seen."""
        return {name: self.detections[name] - self.projected(name) for name in self.cameras}

    def projected(self, name: str) -> Array:
        """Where camera `name` should see the corners, pixels (views, corners, 2)."""
        return self.cameras[name].project(self.points_first)

    @cached_property
    def used(self) -> dict[str, Mask]:
        """Which corners (views, corners) have a say, by camera."""
        seen = {
            name: np.isfinite(residuals).all(axis=-1) & ~self.set_aside.get(name, np.zeros(residuals.shape[:2], bool))
            for name, residuals in self.residuals.items()
        }
        posed = np.any([_fix_a_pose(self.board, mask) for mask in seen.values()], axis=0)
        return {name: mask & posed[:, None] for name, mask in seen.items()}

    @cached_property
    def posed(self) -> Mask:
        """Which views (views,) have a say."""
        return np.any([mask.any(axis=1) for mask in self.used.values()], axis=0)

    @property
    def measurements(self) -> int:
        """N, two for every corner that has a say."""
        return 2 * sum(int(mask.sum()) for mask in self.used.values())

    @cached_property
    def sum_of_squares(self) -> float:
        """‖x‖², over the corners that have a say."""
        return self.sum_of_squares_over(self.used)

    def sum_of_squares_over(self, used: Mapping[str, Mask]) -> float:
        """‖x‖² over the corners (views, corners) that are `used`, by camera."""
        return sum(float(np.sum(self.residuals[name][mask] ** 2)) for name, mask in used.items())

    @property
    def rms(self) -> float:
        """Of the distances between observed and projected corners, in pixels, as OpenCV has it: √(2 ‖x‖²/N)."""
        return float(np.sqrt(2 * self.sum_of_squares / max(self.measurements, 1)))

    def view_rms(self, name: str) -> Array:
        """The same of each view of camera `name`, in pixels (views,): over its corners that have a say, or over all of
        them where none has; NaN where it shows none."""
        squares, used = np.sum(self.residuals[name] ** 2, axis=-1), self.used[name]
        return rms_by_view(np.where(used.any(axis=1, keepdims=True) & ~used, np.nan, squares))

    @property
    def at_work(self) -> dict[str, DenominatorPrior]:
        """The priors by camera, of those whose denominator is free."""
        return {
            name: prior
            for name, prior in self.priors.items()
            if set(self.estimated[name]) & set(self.cameras[name].lens.denominator_terms)
        }

    @cached_property
    def cost_of_priors(self) -> float:
        """What the priors add to ‖x‖², in px²; infinite where they rule the cameras out."""
        return sum(prior.cost(self.cameras[name].lens) for name, prior in self.at_work.items())

    # The parameters

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """The names of what all views share: "left.fx" …, "right.rotation_x" …, "board.warp_x", "board.warp_y"."""
        names = [f"{camera}.{parameter}" for camera in self.cameras for parameter in self.estimated[camera]]
        names += [f"{camera}.{coordinate}" for camera in list(self.cameras)[1:] for coordinate in POSE]
        return (*names, *(() if self.warp is None else ("board.warp_x", "board.warp_y")))

    @property
    def unknowns(self) -> int:
        """k, how many parameters there are with those of the poses."""
        return len(self.parameters) + len(POSE) * int(self.posed.sum())

    def intrinsics(self, name: str) -> Array:
        """The values (n,) of camera `name`'s `estimated` intrinsics."""
        return np.array([parameter(self.cameras[name], key) for key in self.estimated[name]])

    def intrinsics_of(self, name: str) -> slice:
        """Where among `parameters` the intrinsics of camera `name` are."""
        start = 0
        for camera in self.cameras:
            end = start + len(self.estimated[camera])
            if camera == name:
                return slice(start, end)
            start = end
        raise ValueError(f"camera must be one of {', '.join(self.cameras)}, got {name}")

    def place_of(self, name: str) -> slice | None:
        """Where among `parameters` the twist of camera `name` against the first is; None for the first."""
        place = list(self.cameras).index(name) - 1
        start = sum(len(names) for names in self.estimated.values()) + len(POSE) * place
        return slice(start, start + len(POSE)) if place >= 0 else None

    @property
    def warp_place(self) -> slice | None:
        """Where among `parameters` the warp is; None for a flat board."""
        return None if self.warp is None else slice(len(self.parameters) - 2, len(self.parameters))

    # Parts of it

    def only(self, views: ArrayLike) -> Self:
        """The same problem in some of its views, given by their numbers (n,) or as a mask (views,)."""
        chosen = np.arange(self.views)[np.asarray(views)]
        return replace(
            self,
            detections={name: seen[chosen] for name, seen in self.detections.items()},
            first_from_board=self.first_from_board[chosen],
            set_aside={name: mask[chosen] for name, mask in self.set_aside.items()},
        )

    def using(self, used: Mapping[str, Mask]) -> Self:
        """The same problem in which only these corners (views, corners), by camera, have a say."""
        return replace(self, set_aside={name: ~(used[name] & self.used[name]) for name in self.cameras})


def rms_by_view(squares: Array) -> Array:
    """The root of the mean over each view's numbers, (views,) of squares (views, n); NaN for a view without any.

    >>> rms_by_view(np.array([[9.0, 16.0, np.nan], [np.nan, np.nan, np.nan]])).round(3)
    array([3.536,   nan])
    """
    count = np.isfinite(squares).sum(axis=1)
    return np.sqrt(np.nansum(squares, axis=1) / np.where(count, count, np.nan))


def moved(poses: RigidTransform, points: Array) -> Array:
    """Points (n, 3) by each of v poses, (v, n, 3)."""
    matrices = poses.as_matrix()
    return points @ np.swapaxes(matrices[:, :3, :3], 1, 2) + matrices[:, None, :3, 3]


def assumed_estimated(camera: Camera) -> tuple[str, ...]:
    """The intrinsics that a calibration has probably estimated: those that are not 0."""
    others = [name for name in ("skew", *camera.lens.parameters()) if parameter(camera, name)]
    return ("fx", "fy", "cx", "cy", *others)


def _present(calibration: Calibration, names: tuple[str, ...]) -> Board:
    """The board of a calibration that holds what an adjustment takes; ValueError where it does not."""
    for name in names:
        if name not in calibration.cameras:
            raise ValueError(f"camera must be one of {', '.join(calibration.cameras)}, got {name}")
        if name not in calibration.detections or name not in calibration.cam_from_board:
            raise ValueError(f"the calibration must hold corners and board poses of the camera {name}; it does not")
    if calibration.board is None:
        raise ValueError("the calibration must hold the board that was seen; it does not")
    return calibration.board


def _first_from_board(
    cameras: Mapping[str, Camera], detections: Mapping[str, Array], cam_from_board: Mapping[str, RigidTransform]
) -> RigidTransform:
    """Every view's pose in the first camera's frame, by the camera that saw most corners of it."""
    counts = [np.isfinite(detections[name]).all(axis=-1).sum(axis=1) for name in cameras]
    poses = [camera.world_from_cam * cam_from_board[name] for name, camera in cameras.items()]
    best = np.argmax(counts, axis=0)
    return RigidTransform.concatenate([poses[camera][view] for view, camera in enumerate(best)])


def _fix_a_pose(board: Board, seen: Mask) -> Mask:
    """Which views (views,) show enough of the board for its pose: four corners that are not all on one line."""
    count = seen.sum(axis=1)
    points = board.corners / board.square_size
    centred = np.where(seen[..., None], points - (seen @ points / np.maximum(count, 1)[:, None])[:, None], 0)
    spread = np.linalg.eigvalsh(np.swapaxes(centred, 1, 2) @ centred)[:, 1]  # across their longest direction
    return (count >= LEAST_CORNERS) & (spread > 1e-6)
