"""Pictures of one board by one camera: the state behind the calibration visualizer, and what is estimated from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, Intrinsics, transform
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array, as_points
from camviz.poses import RigidTransform, Rotation
from camviz.views.base import View, choice, slider, switch
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.jacobian import parameter
from camviz_clinic.calibration.types import Board
from camviz_school.views.zhang import board_pose, camera_matrix, focal_lengths, homography

BOARD = Board(9, 6, 0.025)
TRUTH = Camera(Intrinsics(640, 480, 545.0, 543.0, 331.0, 233.0), BrownConrady(k1=-0.24, k2=0.01, p1=0.0004, p2=-0.0003))
FREE = {
    "f, c, k1": ("fx", "fy", "cx", "cy", "k1"),
    "all": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"),
    "f, c": ("fx", "fy", "cx", "cy"),
    "f only": ("fx", "fy"),
}
INTRINSICS = FREE["all"]
MOST, FRESH = 12, 6  # boards to calibrate with, and to judge by
_ENOUGH = 12  # corners of a board: more than lie on one line of it
_STEEPEST = np.cos(np.radians(75))  # of a board that is turned by hand

Placed = tuple[int, tuple[float, ...], tuple[float, ...]]  # which board, its t in metres and its rotation vector


@dataclass(frozen=True)
class BoardPictures(View):
    """Boards in front of a camera whose truth is known, their corners with noise, and the calibration that follows.

    Board i is tilted by `tilt` away from parallel to the image, about an axis of its own, and stands about `distance`
    metres away, wherever in the picture there is room; `placed` are boards put elsewhere by hand. Corners are found
    with an error of `noise` pixels in u and in v; another `draw` is another throw of the dice. `seen` and `photographs`
    replace all that by the corners (views, n, 2) of real pictures, whose truth nobody knows.
    """

    boards: int = slider(8, 1, MOST, 1, help="how many pictures of the board are taken")
    tilt: float = slider(30.0, 0.0, 45.0, 0.5, unit="°", help="of every board away from parallel to the image")
    distance: float = slider(
        0.45, 0.25, 1.2, 0.01, unit="m", help="of the boards from the camera, give or take a third"
    )
    noise: float = slider(0.2, 0.0, 2.0, 0.05, unit="px", help="standard deviation of a corner's u and v")
    free: str = choice(*FREE, label="solve for", help="the intrinsics that are estimated; the others are held")
    draw: int = slider(1, 1, 50, 1, label="new noise", help="each number is another throw of the same dice")
    picked: int = slider(1, 1, MOST, 1, label="board", help="which board is picked out, in orange")
    leave_out: bool = switch(False, label="leave it out", help="calibrate without the board that is picked out")
    placed: tuple[Placed, ...] = ()
    board: Board = BOARD
    truth: Camera | None = field(default=TRUTH, compare=False)
    seen: Array | None = field(default=None, compare=False, repr=False)
    photographs: Sequence[NDArray[np.uint8]] = field(default=(), compare=False, repr=False)
    width: int = 640
    height: int = 480
    coarse: bool = False  # refine to a fraction of σ only, for dragging

    @classmethod
    def of(
        cls,
        corners: ArrayLike,
        board: Board,
        width: int,
        height: int,
        photographs: Sequence[NDArray[np.uint8]] = (),
        **state: Any,
    ) -> Self:
        """The view of a real camera's corners (views, board.columns * board.rows, 2), NaN where one was not seen.

        Raises ValueError for corners of another shape, and when the photographs are not one for each view.
        """
        corners = as_points(corners, 2, "corners")
        wanted = board.columns * board.rows
        if corners.ndim != 3 or corners.shape[1] != wanted or not len(corners):
            raise ValueError(f"corners must have shape (views, {wanted}, 2), got {corners.shape}")
        if photographs and len(photographs) != len(corners):
            raise ValueError(f"photographs must be as many as the {len(corners)} views, got {len(photographs)}")
        given: dict[str, Any] = {"board": board, "width": width, "height": height, "photographs": photographs}
        return cls(boards=len(corners), truth=None, seen=corners, **given, **state)

    # What the camera saw ---------------------------------------------------------------------------------------------

    @property
    def index(self) -> int:
        """Which board is picked out, counted from 0."""
        return min(max(round(self.picked), 1), self.count) - 1

    @property
    def count(self) -> int:
        """How many boards there are."""
        return round(self.boards) if self.seen is None else len(self.seen)

    @cached_property
    def cam_from_board(self) -> RigidTransform:
        """Where the virtual boards really are: one pose for each."""
        held = _held(float(self.tilt), float(self.distance), self.board, self._true_camera)[: self.count]
        own = {number: (t, turn) for number, t, turn in self.placed if number < self.count}
        if not own:
            return held
        t, turn = held.translation.copy(), held.rotation.as_rotvec()
        for number in own:
            t[number], turn[number] = own[number]
        return RigidTransform.from_components(t, Rotation.from_rotvec(turn))

    @cached_property
    def corners(self) -> Array:
        """The corners as they were found, (views, n, 2); NaN where one was not seen."""
        if self.seen is not None:
            return self.seen
        uv = self._true_camera.project(transform_each(self.cam_from_board, self.board.corners))
        uv = uv + self.noise * _dice(round(self.draw), len(self.board.corners))[: self.count]
        uv = np.where(self._true_camera.intrinsics.contains(uv)[..., None], uv, np.nan)
        enough = np.isfinite(uv[..., 0]).sum(axis=1) >= _ENOUGH
        return np.where(enough[:, None, None], uv, np.nan)

    @property
    def _true_camera(self) -> Camera:
        return self.truth or TRUTH

    # What follows from it --------------------------------------------------------------------------------------------

    @cached_property
    def used(self) -> np.ndarray:
        """Which boards (views,) the calibration has: those that were found and are not left out."""
        found = np.isfinite(self.corners[..., 0]).any(axis=1)
        return found & ~((np.arange(self.count) == self.index) & self.leave_out)

    @cached_property
    def homographies(self) -> list[Array]:
        """One (3, 3) from the board to the pixels for each board that is used."""
        return [homography(self.board.corners[:, :2], uv) for uv in self.corners[self.used]]

    @cached_property
    def closed_form(self) -> Array | None:
        """K (3, 3) by Zhang's closed form, which knows no distortion; None where it finds none."""
        centre = ((self.width - 1) / 2, (self.height - 1) / 2)
        try:
            if self.free == "f only":
                fx, fy = focal_lengths(self.homographies, centre)
                return np.array([[fx, 0, centre[0]], [0, fy, centre[1]], [0, 0, 1]])
            return camera_matrix(self.homographies)
        except ValueError:
            return None

    @cached_property
    def start(self) -> Adjustment | None:
        """Where the refinement starts: at the closed form or, where that makes no sense, at a usual field of view."""
        if not self.used.any():
            return None
        f, middle = float(self.width), ((self.width - 1) / 2, (self.height - 1) / 2)
        usual = np.array([[f, 0, middle[0]], [0, f, middle[1]], [0, 0, 1]])
        K = usual if self.closed_form is None or not self._sensible(self.closed_form) else self.closed_form
        poses = RigidTransform.concatenate([board_pose(H, K) for H in self.homographies])
        camera = Camera(Intrinsics.from_matrix(K, self.width, self.height), BrownConrady())
        corners = {"camera": self.corners[self.used]}
        virtual = self.seen is None
        estimated = {"camera": FREE[self.free]}
        problem = Adjustment(self.board, {"camera": camera}, corners, poses, estimated)
        return replace(problem, independent_corners=virtual, certain_board=True)

    def _sensible(self, K: Array) -> bool:
        (fx, _, cx), (_, fy, cy) = K[:2]
        inside = 0 < cx < self.width and 0 < cy < self.height
        return bool(inside and all(0.2 * self.width < f < 5 * self.width for f in (fx, fy)))

    @cached_property
    def adjustment(self) -> Adjustment | None:
        """The calibration; None without a board."""
        settled, most_steps = (1e-4, 15) if self.coarse else (1e-12, 60)
        return self.start and self.start.refined(settled=settled, most_steps=most_steps)

    @property
    def camera(self) -> Camera | None:
        """The camera that was estimated."""
        return self.adjustment.cameras["camera"] if self.adjustment else None

    @cached_property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of every intrinsic by name; those that are held have no deviation.

        That of a virtual camera is by the noise of its corners, which is all that they are off by. That of a real one
        is by the scatter of its views.
        """
        if self.adjustment is None or self.camera is None:
            return {}
        sigmas = dict(zip(FREE[self.free], np.sqrt(np.diag(self.adjustment.covariance)).tolist(), strict=True))
        return {name: (parameter(self.camera, name), sigmas.get(name, 0.0)) for name in INTRINSICS}

    @cached_property
    def true(self) -> dict[str, float]:
        """The true value of every intrinsic by name; empty for a real camera."""
        return {name: parameter(self.truth, name) for name in INTRINSICS} if self.truth else {}

    @cached_property
    def estimated_poses(self) -> RigidTransform:
        """cam_from_board of every board by the estimated camera; that of one left out is fitted to it alone."""
        assert self.adjustment
        assert self.camera
        if self.used.all():
            return self.adjustment.first_from_board
        poses = _posed(self.camera, self.board, self.corners)
        t, turn = poses.translation.copy(), poses.rotation.as_rotvec()
        t[self.used] = self.adjustment.first_from_board.translation
        turn[self.used] = self.adjustment.first_from_board.rotation.as_rotvec()
        return RigidTransform.from_components(t, Rotation.from_rotvec(turn))

    @cached_property
    def residuals(self) -> Array:
        """Detected less projected corners, (views, n, 2) in pixels; NaN where a corner was not seen."""
        assert self.camera
        return self.corners - self.camera.project(transform_each(self.estimated_poses, self.board.corners))

    @cached_property
    def per_board(self) -> Array:
        """The RMS (views,) of each board in pixels; NaN for one that was not found."""
        squared = np.sum(self.residuals**2, axis=-1)
        found = np.isfinite(squared)
        return np.sqrt(np.where(found, squared, 0).sum(axis=1) / np.where(found.any(axis=1), found.sum(axis=1), np.nan))

    @cached_property
    def correlation(self) -> float:
        """Between the estimates of fx and of the picked board's distance along the axis; NaN where it is left out."""
        assert self.adjustment
        if not self.used[self.index]:
            return float("nan")
        a, i = self.adjustment, int(self.used[: self.index].sum())
        variance_f, variance_z = a.covariance[0, 0], a.pose_covariance[i, 5, 5]
        return float(a.cross_covariance[i, 5, 0] / np.sqrt(variance_f * variance_z))

    @cached_property
    def held_out(self) -> float:
        """RMS in pixels on boards that the calibration has not seen; NaN where there are none.

        Each board's pose is fitted to its left half and judged by its right half: a pose fitted to all of a board
        would hide what is wrong with the camera.
        """
        if self.camera is None:
            return float("nan")
        left = self.board.corners[:, 0] < middle_of(self.board)[0] + 1e-9
        poses = _posed(self.camera, self.board, np.where(left[:, None], self.unseen, np.nan))
        errors = self.camera.project(transform_each(poses, self.board.corners[~left])) - self.unseen[:, ~left]
        squared = np.sum(errors**2, axis=-1)
        known = np.isfinite(squared)
        return float(np.sqrt(squared[known].mean())) if known.any() else float("nan")

    @cached_property
    def unseen(self) -> Array:
        """The corners (views, n, 2) of boards that the calibration has not seen: fresh ones, or that left out."""
        if self.seen is not None:
            return self.corners[[self.index]] if self.leave_out else self.corners[:0]
        poses = _held(30.0, 0.45, self.board, self._true_camera, MOST + FRESH)[MOST:]
        uv = self._true_camera.project(transform_each(poses, self.board.corners))
        return uv + self.noise * _dice(round(self.draw) + 1000, len(self.board.corners))[:FRESH]

    # Boards moved by hand --------------------------------------------------------------------------------------------

    def moved(self, i: int, shift: ArrayLike = (0, 0, 0), turn: ArrayLike = (0, 0, 0)) -> Self:
        """Board i shifted by (3,) metres and turned about its middle by the rotation vector `turn` (3,), both in the
        camera's frame. A board is never put out of the picture altogether, nor turned on edge."""
        pose, middle = self.cam_from_board[i], middle_of(self.board)
        rotation = Rotation.from_rotvec(turn) * pose.rotation
        centre = transform(pose, middle) + np.asarray(shift, dtype=float)
        towards = centre / np.linalg.norm(centre)
        here = self._true_camera.intrinsics.contains(self._true_camera.project(centre))
        if centre[2] < 0.12 or centre[2] > 3 or not here or rotation.as_matrix()[:, 2] @ towards < _STEEPEST:
            return self
        t = centre - rotation.apply(middle)
        kept = tuple(one for one in self.placed if one[0] != i)
        return self.but(placed=(*kept, (i, tuple(t.tolist()), tuple(rotation.as_rotvec().tolist()))))


def transform_each(to_from: RigidTransform, points: Array) -> Array:
    """The same points (n, 3) by each of several transforms: (views, n, 3)."""
    return points @ np.swapaxes(to_from.rotation.as_matrix(), 1, 2) + to_from.translation[:, None]


def middle_of(board: Board) -> Array:
    """The middle (3,) of the board in its own frame."""
    return board.corners.mean(axis=0)


def _posed(camera: Camera, board: Board, corners: Array) -> RigidTransform:
    """cam_from_board of every board by its corners (views, n, 2) for a known camera; NaN for one with too few."""
    assert isinstance(camera.lens, BrownConrady)
    coefficients = np.array(astuple(camera.lens))
    t, turn = np.full((len(corners), 3), np.nan), np.zeros((len(corners), 3))
    for i, uv in enumerate(corners):
        seen = np.isfinite(uv).all(axis=1)
        if seen.sum() >= _ENOUGH:
            _, rvec, tvec = cv2.solvePnP(board.corners[seen], uv[seen], camera.intrinsics.K, coefficients)
            t[i], turn[i] = tvec.ravel(), rvec.ravel()
    return RigidTransform.from_components(t, Rotation.from_rotvec(turn))


@lru_cache(maxsize=4)
def _dice(draw: int, corners: int) -> Array:
    """Errors of standard deviation 1, (MOST, corners, 2): the first boards' stay the same when there are more."""
    return np.random.default_rng([6, draw]).normal(size=(MOST, corners, 2))


@lru_cache(maxsize=16)
def _held(tilt: float, distance: float, board: Board, camera: Camera, count: int = MOST) -> RigidTransform:
    """Poses of `count` boards, each tilted about an axis of its own, where in the picture there is room for it."""
    i = np.arange(count)
    azimuth, nothing = np.radians(40 + 137.5 * i), np.zeros(count)
    lean = Rotation.from_rotvec(np.radians(tilt) * np.stack([np.cos(azimuth), np.sin(azimuth), nothing], axis=-1))
    rotation = lean * Rotation.from_rotvec(np.stack([nothing, nothing, 0.35 * np.sin(2.4 * i)], axis=-1))
    z = distance * (1 + 0.33 * np.cos(1.9 * i + 0.6))
    matrices, middle = rotation.as_matrix(), middle_of(board)
    corners = (board.corners - middle) @ np.swapaxes(matrices, 1, 2) + z[:, None, None] * (0, 0, 1)
    pixels = camera.intrinsics
    seen = camera.project(corners) - (pixels.cx, pixels.cy)
    room = np.array([pixels.width, pixels.height]) / 2 - 12
    low, high = np.minimum(-room - seen.min(axis=1), 0), np.maximum(room - seen.max(axis=1), 0)
    share = np.array([[_radical_inverse(k + 1, 2), _radical_inverse(k + 1, 3)] for k in range(count)])
    rays = camera.lens.unproject((low + share * (high - low)) / (pixels.fx, pixels.fy))
    return RigidTransform.from_components((z / rays[:, 2])[:, None] * rays - matrices @ middle, rotation)


def _radical_inverse(i: int, base: int) -> float:
    """The i-th of a sequence that fills 0 … 1 evenly (Halton 1960): i's digits mirrored at the point."""
    value, place = 0.0, 1 / base
    while i:
        i, digit = divmod(i, base)
        value, place = value + digit * place, place / base
    return value
