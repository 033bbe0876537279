"""The joint adjustment of a calibration: cameras, board poses and the board's own bend, by least squares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.calibration.arrowhead import Arrowhead
from camviz.calibration.slopes import lens_parameters, parameter, pixel_slopes, with_parameters
from camviz.calibration.types import Board, Calibration
from camviz.cameras import Camera, transform
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation

Mask = NDArray[np.bool_]

LEAST_CORNERS = 4  # that a view must show for its pose to be known
POSE = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
MOST_STEPS = 100
SETTLED = 1e-12  # of the sum of squares, what a step must still promise to take off


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The least-squares problem of a calibration, at one place: here, not elsewhere, are its residuals and slopes.

    Free are the `estimated` intrinsics of every camera, the place of every camera but the first, which is where the
    frame of all of them is, the board's pose in every view, and with `warp` the board's two sagittas in metres
    (`Board.warped`; None for a flat board). A pose moves by a twist (ω, τ) in the frame it leads to,
    p → p + ω × p + τ, in radians and metres; the covariances are those of the twists.

    `detections` (views, corners, 2) in pixels are NaN where no corner was seen; those `set_aside` (views, corners) have
    residuals like all, and no say. Nor has a view of fewer than four corners, or of corners on one line.
    """

    board: Board
    cameras: Mapping[str, Camera]
    detections: Mapping[str, Array] = field(repr=False)
    first_from_board: RigidTransform = field(repr=False)
    estimated: Mapping[str, tuple[str, ...]]
    set_aside: Mapping[str, Mask] = field(default_factory=dict, repr=False)
    warp: Array | None = None

    def __post_init__(self) -> None:
        corners = self.board.columns * self.board.rows
        for name in self.cameras:
            shape, expected = self.detections[name].shape, (len(self.first_from_board), corners, 2)
            if shape != expected:
                raise ValueError(f"detections of {name} must have shape {expected} (views, corners, 2), got {shape}")

    @classmethod
    def of(cls, calibration: Calibration, *names: str) -> Adjustment:
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
        )

    # The measurements ------------------------------------------------------------------------------------------------

    @property
    def views(self) -> int:
        """How many views there are, also without a say."""
        return len(self.first_from_board)

    @cached_property
    def corners(self) -> Array:
        """The board's corners (corners, 3) in its own frame, bent by the warp."""
        return self.board.corners if self.warp is None else self.board.warped(self.warp)

    @cached_property
    def residuals(self) -> dict[str, Array]:
        """Observed less projected, in pixels (views, corners, 2) by camera; NaN where a corner was not seen."""
        return {name: self.detections[name] - self.projected(name) for name in self.cameras}

    def projected(self, name: str) -> Array:
        """Where camera `name` should see the corners, pixels (views, corners, 2)."""
        return self.cameras[name].project(self._points_first)

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
        return self._squares(self.used)

    def _squares(self, used: Mapping[str, Mask]) -> float:
        return sum(float(np.sum(self.residuals[name][mask] ** 2)) for name, mask in used.items())

    @property
    def rms(self) -> float:
        """Of the distances between observed and projected corners, in pixels, as OpenCV has it: √(2 ‖x‖²/N)."""
        return float(np.sqrt(2 * self.sum_of_squares / max(self.measurements, 1)))

    @property
    def sigma(self) -> float:
        """The standard deviation in pixels of one coordinate of a detected corner: σ² = ‖x‖²/(N - k).

        NaN where there are no more measurements than parameters.
        """
        left = self.measurements - self.unknowns
        return float(np.sqrt(self.sum_of_squares / left)) if left > 0 else np.nan

    # The parameters --------------------------------------------------------------------------------------------------

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

    # Its slopes ------------------------------------------------------------------------------------------------------

    @cached_property
    def _points_first(self) -> Array:
        """The corners of every view, (views, corners, 3), in the first camera's frame."""
        return moved(self.first_from_board, self.corners)

    @cached_property
    def normal_equations(self) -> Arrowhead:
        """JᵀJ and Jᵀr over the views that have a say, J being the derivative of the *projected* corners."""
        parts = [Arrowhead.of(*self._measured(name)) for name in self.cameras]
        return sum(parts[1:], start=parts[0])

    def _measured(self, name: str) -> tuple[Array, Array, Array]:
        """Camera `name`'s J by the shared parameters and by the poses, and its r; zero where a corner has no say."""
        by_shared, by_pose = self.slopes(name)
        views, unused = self.posed, ~self.used[name][self.posed]
        residuals = self.residuals[name][views].copy()
        for values in (by_shared, by_pose, residuals):
            values[unused] = 0
        rows = (int(views.sum()), 2 * unused.shape[1])
        return by_shared.reshape(*rows, by_shared.shape[-1]), by_pose.reshape(*rows, len(POSE)), residuals.reshape(rows)

    def slopes(self, name: str) -> tuple[Array, Array]:
        """How camera `name`'s pixels follow the parameters, over the views that have a say.

        By the shared ones, (views, corners, 2, s), and by the view's own twist, (views, corners, 2, 6).
        """
        camera, points_first = self.cameras[name], self._points_first[self.posed]
        points_cam = transform(camera.cam_from_world, points_first)
        _, by_point, by_intrinsics = pixel_slopes(camera, points_cam, self.estimated[name])
        by_first = by_point @ camera.cam_from_world.rotation.as_matrix()
        by_shared = np.zeros((*points_cam.shape[:-1], 2, len(self.parameters)))
        by_shared[..., self.intrinsics_of(name)] = by_intrinsics
        if place := self.place_of(name):
            by_shared[..., place] = by_point @ twist_slopes(points_cam)
        if self.warp_place:
            normals = self.first_from_board[self.posed].rotation.as_matrix()[:, None, :, 2:]
            by_shared[..., self.warp_place] = (by_first @ normals) * sagittas(self.board)[:, None, :]
        return by_shared, by_first @ twist_slopes(points_first)

    # What it says ----------------------------------------------------------------------------------------------------

    @cached_property
    def covariance(self) -> Array:
        """σ² (JᵀJ)⁻¹ of the shared `parameters`, (s, s), the poses being free to follow."""
        return self.sigma**2 * self.normal_equations.covariance

    def intrinsics_covariance(self, name: str) -> Array:
        """Of the `estimated` intrinsics of camera `name`, (n, n)."""
        place = self.intrinsics_of(name)
        return self.covariance[place, place]

    @cached_property
    def pose_covariance(self) -> Array:
        """Of every view's twist, (views, 6, 6), radians and metres; NaN for a view without a say."""
        normal = self.normal_equations
        covariance = np.full((self.views, len(POSE), len(POSE)), np.nan)
        follows = normal.levers @ normal.covariance @ np.swapaxes(normal.levers, 1, 2)
        covariance[self.posed] = self.sigma**2 * (normal.block_inverses + follows)
        return covariance

    @cached_property
    def cross_covariance(self) -> Array:
        """Between every view's twist and the shared parameters, (views, 6, s); NaN for a view without a say."""
        normal = self.normal_equations
        covariance = np.full((self.views, len(POSE), len(self.parameters)), np.nan)
        covariance[self.posed] = -(self.sigma**2) * normal.levers @ normal.covariance
        return covariance

    @cached_property
    def mean_twist_covariance(self) -> Array:
        """Of the shared parameters and the mean of all views' twists together, (s + 6, s + 6)."""
        return self.joined_with_mean_twist(self.normal_equations.covariance)

    def joined_with_mean_twist(self, shared: Array) -> Array:
        """`mean_twist_covariance` if the shared parameters had the covariance `shared` (s, s) for σ = 1.

        With Wᵢ and Cᵢ of `Arrowhead`, a twist is -Wᵢ δ and noise of covariance Cᵢ⁻¹ that is its own. The mean of n:
        -W̄ δ, and noise of covariance Σ Cᵢ⁻¹/n².
        """
        normal = self.normal_equations
        follow = np.concatenate([np.eye(len(self.parameters)), -normal.levers.mean(axis=0)])
        covariance = follow @ shared @ follow.T
        covariance[-len(POSE) :, -len(POSE) :] += normal.block_inverses.mean(axis=0) / len(normal.block_inverses)
        return self.sigma**2 * covariance

    # Parts of it, and where it leads ---------------------------------------------------------------------------------

    def only(self, views: ArrayLike) -> Adjustment:
        """The same problem in some of its views, given by their numbers (n,) or as a mask (views,)."""
        chosen = np.arange(self.views)[np.asarray(views)]
        return replace(
            self,
            detections={name: seen[chosen] for name, seen in self.detections.items()},
            first_from_board=self.first_from_board[chosen],
            set_aside={name: mask[chosen] for name, mask in self.set_aside.items()},
        )

    def using(self, used: Mapping[str, Mask]) -> Adjustment:
        """The same problem with a say for no other corners (views, corners) than those, by camera."""
        return replace(self, set_aside={name: ~(used[name] & self.used[name]) for name in self.cameras})

    def refined(
        self, *, only_poses: bool = False, settled: float = SETTLED, most_steps: int = MOST_STEPS
    ) -> Adjustment:
        """At the least sum of squares near by, by Levenberg's and Marquardt's method; of the poses alone if so asked.

        It ends after `most_steps`, or when a step promises to take off less than `settled` of the sum. A corner that
        has an image at the start keeps one: a step that would carry it beyond a fold is shortened.
        """
        here, damping = replace(self, estimated=dict.fromkeys(self.cameras, ())) if only_poses else self, 1e-3
        for _ in range(most_steps):
            normal = here.normal_equations
            shared, views = normal.damped(damping).solution(only_views=only_poses)
            promised = shared @ normal.shared_gradient + np.sum(views * normal.gradients)
            if not promised > settled * here.sum_of_squares:
                break
            there = here._moved(shared, views)
            if there is not None and there._squares(here.used) <= here.sum_of_squares:
                here, damping = there, damping / 10
            elif damping < 1e12:
                damping *= 2  # less up than down: it comes along a curved valley faster (Transtrum & Sethna 2012)
            else:
                break
        return replace(here, estimated=self.estimated) if only_poses else here

    def _moved(self, shared: Array, twists: Array) -> Adjustment | None:
        """With its parameters changed; None where a lens does not take them or a corner in use loses its image."""
        try:
            cameras = {name: self._moved_camera(name, shared) for name in self.cameras}
        except ValueError:
            return None
        all_twists = np.zeros((self.views, len(POSE)))
        all_twists[self.posed] = twists
        there = replace(
            self,
            cameras=cameras,
            first_from_board=twisted(self.first_from_board, all_twists),
            warp=None if self.warp is None else self.warp + shared[self.warp_place],
        )
        kept = all(there.used[name][mask].all() for name, mask in self.used.items())
        return there if kept else None

    def _moved_camera(self, name: str, shared: Array) -> Camera:
        camera, changes = self.cameras[name], shared[self.intrinsics_of(name)]
        values = {
            key: parameter(camera, key) + change for key, change in zip(self.estimated[name], changes, strict=True)
        }
        place = self.place_of(name)
        if place is not None:
            camera = camera.at(twisted(camera.cam_from_world, shared[place]).inv())
        return with_parameters(camera, values)


def twist_slopes(points: Array) -> Array:
    """∂(p + ω × p + τ)/∂(ω, τ) = [-[p]ₓ | 1], (..., 3, 6) of points (..., 3)."""
    slopes = np.zeros((*points.shape, 6))
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    slopes[..., 0, 1], slopes[..., 0, 2] = z, -y
    slopes[..., 1, 0], slopes[..., 1, 2] = -z, x
    slopes[..., 2, 0], slopes[..., 2, 1] = y, -x
    slopes[..., 3:] = np.eye(3)
    return slopes


def twisted(poses: RigidTransform, twists: Array) -> RigidTransform:
    """Poses moved by twists (..., 6) in the frame they lead to: p → exp(ω) p + τ."""
    return RigidTransform.from_components(twists[..., 3:], Rotation.from_rotvec(twists[..., :3])) * poses


def moved(poses: RigidTransform, points: Array) -> Array:
    """Points (n, 3) by each of v poses, (v, n, 3)."""
    return points @ np.swapaxes(poses.rotation.as_matrix(), 1, 2) + poses.translation[:, None, :]


def sagittas(board: Board) -> Array:
    """How far a corner rises by a sagitta of one along x and along y, (corners, 2)."""
    return np.stack([board.warped((1, 0))[:, 2], board.warped((0, 1))[:, 2]], axis=-1)


def assumed_estimated(camera: Camera) -> tuple[str, ...]:
    """The intrinsics that a calibration has estimated as far as its numbers tell: what was not is still 0."""
    others = [name for name in ("skew", *lens_parameters(camera.lens)) if parameter(camera, name)]
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
    xy = board.corners[:, :2] / board.square_size
    centred = np.where(seen[..., None], xy - (seen @ xy / np.maximum(count, 1)[:, None])[:, None], 0)
    spread = np.linalg.eigvalsh(np.swapaxes(centred, 1, 2) @ centred)[:, 0]
    return (count >= LEAST_CORNERS) & (spread > 1e-6)
