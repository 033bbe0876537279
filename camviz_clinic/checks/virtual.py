"""A healthy virtual set-up: a camera or a pair, a board held before it at many places, and corners with noise."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Detections, calibrate, calibrate_pair
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.files import load

SIZES = ((640, 480), (1280, 720), (1280, 960), (1920, 1080))
BOARDS = (Board(9, 6, 0.025), Board(8, 5, 0.03), Board(11, 8, 0.02))
VIEWS_DEG = (50, 70)
MARGIN = 4.0  # pixels between a corner and the border
TRIES = 60


@dataclass(frozen=True, eq=False)
class SetUp:
    """What is true: cameras in place (the left one first), a board, its poses in the left camera's frame, and noise.

    `noise` is the standard deviation in pixels of a detected corner's coordinates, `warp` the board's sagittas in
    metres, `zoom` what each view (views,) multiplies the focal lengths by. `motion` (views, 6) is how far the board
    turns [rad] and shifts [m] while a rolling shutter reads the image from the first row to the last.
    """

    cameras: tuple[Camera, ...]
    board: Board
    cam_from_board: RigidTransform
    noise: float
    warp: tuple[float, float] = (0.0, 0.0)
    zoom: Array | None = field(default=None, repr=False)
    motion: Array | None = field(default=None, repr=False)

    @property
    def camera(self) -> Camera:
        return self.cameras[0]

    @cached_property
    def corners(self) -> tuple[Array, ...]:
        """Where each camera sees the corners, (views, corners, 2), without noise."""
        points = self.board.warped(self.warp)
        in_left = np.stack([pose.apply(points) for pose in self.cam_from_board])
        return tuple(self._seen(camera, in_left) for camera in self.cameras)

    def _seen(self, camera: Camera, points: Array) -> Array:
        if self.motion is not None:
            return self._read_by_rows(camera, points)
        if self.zoom is None:
            return camera.project(points)
        return np.stack([_zoomed(camera, by).project(view) for by, view in zip(self.zoom, points, strict=True)])

    def _read_by_rows(self, camera: Camera, points: Array) -> Array:
        """Each corner is seen when its row is read, up to half a frame early or late."""
        assert self.motion is not None
        corners: Array = camera.project(points)
        for view, (pose, motion) in enumerate(zip(self.cam_from_board, self.motion, strict=True)):
            for _ in range(3):
                late = corners[view, :, 1, None] / camera.intrinsics.height - 0.5
                turned = Rotation.from_rotvec(late * motion[:3]).apply(points[view] - pose.translation)
                corners[view] = camera.project(turned + pose.translation + late * motion[3:])
        return corners

    def observed(self, rng: np.random.Generator) -> tuple[Array, ...]:
        """The corners of each camera with noise."""
        return tuple(seen + rng.normal(0, self.noise, seen.shape) for seen in self.corners)

    def solved(
        self,
        observed: tuple[Array, ...],
        model: str = "standard",
        *,
        fixed: tuple[str, ...] = (),
        square: float = 1.0,
        robust: bool = True,
    ) -> Calibration:
        """The calibration of these corners; `square` multiplies what the side of a square is taken for."""
        board = replace(self.board, square_size=self.board.square_size * square)
        found = [detections(camera, corners) for camera, corners in zip(self.cameras, observed, strict=True)]
        if len(found) == 1:
            return calibrate(found[0], board, model, fixed=fixed, robust=robust)
        return calibrate_pair(found[0], found[1], board, model, fixed=fixed, robust=robust)


def detections(camera: Camera, corners: Array) -> Detections:
    """Corners (views, corners, 2) as if they had been found in pictures of this camera."""
    names = tuple(f"view{view + 1:02}.png" for view in range(len(corners)))
    return Detections(names, corners, camera.intrinsics.width, camera.intrinsics.height)


def single(rng: np.random.Generator, *, views: int | None = None, tilt_deg: tuple[float, float] = (15, 40)) -> SetUp:
    """A random camera of ordinary numbers, and 10 to 20 boards well spread over its image, tilted to all sides."""
    camera, board = _camera(rng), BOARDS[rng.integers(len(BOARDS))]
    poses = spread_boards(rng, (camera,), board, views or int(rng.integers(10, 21)), tilt_deg)
    return SetUp((camera,), board, poses, float(rng.uniform(0.05, 0.3)))


def single_in_the_middle(rng: np.random.Generator, window: float) -> SetUp:
    """Such a camera, whose 15 boards stay inside this part of the image's sides."""
    set_up = single(rng)
    return replace(set_up, cam_from_board=spread_boards(rng, set_up.cameras, set_up.board, 15, (15, 40), window))


def pair(rng: np.random.Generator, *, views: int | None = None) -> SetUp:
    """Two such cameras side by side, 5 to 12 cm apart, that both see every board."""
    view = rng.uniform(*VIEWS_DEG)
    left, board = _camera(rng, None, view), BOARDS[rng.integers(len(BOARDS))]
    grid = left.intrinsics
    right = _camera(rng, (grid.width, grid.height), view)
    turn = Rotation.from_rotvec(rng.normal(0, radians(1.5), 3))
    left_from_right = RigidTransform.from_components([rng.uniform(0.05, 0.12), *rng.normal(0, 0.001, 2)], turn)
    cameras = (left, right.at(left_from_right))
    poses = spread_boards(rng, cameras, board, views or int(rng.integers(10, 21)), (15, 40))
    return SetUp(cameras, board, poses, float(rng.uniform(0.05, 0.3)))


def healthy(rng: np.random.Generator) -> Calibration:
    """The calibration of such a camera."""
    set_up = single(rng)
    return set_up.solved(set_up.observed(rng))


def healthy_pair(rng: np.random.Generator) -> Calibration:
    """The calibration of such a pair."""
    set_up = pair(rng)
    return set_up.solved(set_up.observed(rng))


def alone(calibration: Calibration, camera: Camera | None = None) -> Calibration:
    """The numbers of one camera, the calibration's own unless given, and nothing else, as most files have them."""
    name, own = next(iter(calibration.cameras.items()))
    return Calibration({name: camera or own}, Path("virtual"), calibration.format)


def changed(calibration: Calibration, **values: Any) -> Calibration:
    """A calibration with other numbers in the camera matrix of its first camera."""
    name, camera = next(iter(calibration.cameras.items()))
    other = replace(camera, intrinsics=replace(camera.intrinsics, **values))
    return replace(calibration, cameras={**calibration.cameras, name: other})


def as_file(text: str) -> Evidence:
    """What a YAML file of this text holds, read as `camviz inspect` reads it, in spite of its faults."""
    with tempfile.TemporaryDirectory() as room:
        path = Path(room) / "camera.yaml"
        path.write_text(text, encoding="utf-8")
        return Evidence(load(path, mend=True))


def _camera(rng: np.random.Generator, size: tuple[int, int] | None = None, view_deg: float | None = None) -> Camera:
    """50° to 70° wide, barrel or slightly pincushion distortion that does not fold, everything off by a little."""
    width, height = size or SIZES[rng.integers(len(SIZES))]
    grid = Intrinsics.from_fov(width, height, (view_deg or rng.uniform(*VIEWS_DEG)) + rng.normal(0, 0.2))
    fy = grid.fx * rng.normal(1, 0.001)
    cx, cy = np.array([grid.cx, grid.cy]) + rng.uniform(-0.015, 0.015, 2) * width
    k1 = rng.uniform(-0.22, 0.05)
    k2 = 0.4 * k1**2 + rng.uniform(0, 0.03)
    p1, p2 = rng.normal(0, 3e-4, 2)
    return Camera(replace(grid, fy=fy, cx=cx, cy=cy), BrownConrady(k1, k2, p1, p2))


def spread_boards(
    rng: np.random.Generator,
    cameras: tuple[Camera, ...],
    board: Board,
    views: int,
    tilt_deg: tuple[float, float],
    window: float = 1.0,
) -> RigidTransform:
    """cam_from_board of so many views, all corners inside all images, over the middle `window` of the first image.

    Tilts run from the one angle to the other, to sides that go around; places go over the image row by row in no order.
    """
    cells = rng.permutation(np.stack(np.meshgrid(np.arange(4), np.arange(3)), axis=-1).reshape(-1, 2))
    poses = []
    for view in range(views):
        aim = (cells[view % len(cells)] + rng.uniform(0, 1, 2)) / (4, 3) * 2 - 1
        side, tilt = 2.4 * view + rng.uniform(0, 1), radians(rng.uniform(*tilt_deg))
        turn = Rotation.from_rotvec([0, 0, rng.uniform(-0.5, 0.5) + np.pi / 2 * rng.integers(4)])
        turn = Rotation.from_rotvec(tilt * np.array([np.cos(side), np.sin(side), 0])) * turn
        poses.append(_placed(cameras, board, turn, window * aim, rng.uniform(0.35, 0.6) * window**0.5))
    return RigidTransform.concatenate(poses)


def _placed(cameras: tuple[Camera, ...], board: Board, turn: Rotation, aim: Array, size: float) -> RigidTransform:
    """The board turned, as large as that part of the image's width, and as close to `aim` (-1 … 1) as it has room."""
    first = cameras[0].intrinsics
    middle = board.corners.mean(axis=0)
    for attempt in range(TRIES):
        shrunk = size * (0.95**attempt)
        depth = first.fx * np.ptp(board.corners[:, 0]) / (shrunk * first.width)
        where = aim * 0.9**attempt
        pixel = (where + 1) / 2 * [first.width, first.height] - 0.5
        ray = cameras[0].lens.unproject(first.from_pixels(pixel))
        pose = RigidTransform.from_components(ray / ray[2] * depth - turn.apply(middle), turn)
        if all(_inside(camera, pose.apply(board.corners)) for camera in cameras):
            return pose
    raise ValueError("board must find a place before the cameras in which all its corners are seen; it does not")


def _inside(camera: Camera, points: Array) -> bool:
    pixels, grid = camera.project(points), camera.intrinsics
    low, high = MARGIN, np.array([grid.width, grid.height]) - 1 - MARGIN
    return bool(np.all((pixels > low) & (pixels < high)))


def _zoomed(camera: Camera, by: float) -> Camera:
    grid = camera.intrinsics
    return replace(camera, intrinsics=replace(grid, fx=grid.fx * by, fy=grid.fy * by))
