"""Films of a board by a virtual camera whose truth is known: held still, moved, blurred, read row by row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RotationSpline, Slerp

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.snapshots import snapshot
from camviz_clinic.checks.virtual import spread_boards

TILT_DEG = (5, 35)
ROUNDS = 6  # until a corner's row and its time agree: each lessens the error by the rows it moves in a row's time
STILL = 1e-3  # of the board's length, moved while one frame is taken: no picture shows less


@dataclass(frozen=True, eq=False)
class Take:
    """How a board is carried before a camera, and how the camera films it.

    Args:
        camera, board: What films, and what is filmed.
        stops: Poses cam_from_board between which the board is carried.
        leave_s, reach_s: (stops,), when each stop is left and reached, in seconds.
        rate: Frames a second.
        exposure_s: How long a row is exposed.
        readout_s: From the first row to the last one; 0 for a global shutter.
    """

    camera: Camera
    board: Board
    stops: RigidTransform
    reach_s: Array
    leave_s: Array
    rate: float = 30.0
    exposure_s: float = 0.012
    readout_s: float = 0.0

    @property
    def frames(self) -> int:
        """How many frames there are until the last stop is left."""
        return int(self.leave_s[-1] * self.rate)

    def at(self, time_s: Array) -> RigidTransform:
        """cam_from_board at times (n,): at rest at a stop, and smoothly on the way to the next."""
        stop = np.clip(np.searchsorted(self.reach_s, time_s, side="right") - 1, 0, len(self.stops) - 2)
        way = (time_s - self.leave_s[stop]) / (self.reach_s[stop + 1] - self.leave_s[stop])
        way = np.clip(way, 0, 1)
        place = stop + way**2 * (3 - 2 * way)
        turn = Slerp(np.arange(len(self.stops)), self.stops.rotation)(place)
        middle = self.board.corners.mean(axis=0)
        ends = self.stops.apply(middle)
        where = ends[stop] + (place - stop)[:, None] * (ends[stop + 1] - ends[stop])
        return RigidTransform.from_components(where - turn.apply(middle), turn)

    def by(self, camera: Camera) -> Take:
        """What another camera, in place before this one's frame, films of it."""
        return replace(self, camera=camera.at(RigidTransform.identity()), stops=camera.cam_from_world * self.stops)

    def corners(self, times: Array) -> Array:
        """Where the corners are seen, pixels (frames, corners, 2), in frames whose middle rows are read at `times`.

        Each corner is seen where it is when its own row is read. It is NaN outside of the picture.
        """
        grid, points = self.camera.intrinsics, self.board.corners
        row_s = self.readout_s / grid.height
        late = np.zeros((len(times), len(points)))
        for _ in range(ROUNDS):
            poses = self.at((times[:, None] + late).ravel())
            seen = self.camera.project(poses.apply(np.tile(points, (len(times), 1)))).reshape(*late.shape, 2)
            late = row_s * (np.nan_to_num(seen[..., 1]) - (grid.height - 1) / 2)
        inside = np.all((seen >= 0) & (seen <= [grid.width - 1, grid.height - 1]), axis=-1, keepdims=True)
        return np.where(inside, seen, np.nan)

    def pictures(self, rng: np.random.Generator, noise: float = 2.0, moments: int = 4) -> Iterator[NDArray[np.uint8]]:
        """The frames, uint8 grey (height, width), each of so many moments between its first row and its last."""
        for frame in range(self.frames):
            yield self._picture(frame / self.rate, rng, noise, moments)

    def _picture(self, time_s: float, rng: np.random.Generator, noise: float, moments: int) -> NDArray[np.uint8]:
        times = time_s + np.linspace(0, self.exposure_s + self.readout_s, moments)
        poses = self.at(times)
        apart = np.ptp(np.array([pose.apply(self.board.corners[[0, -1]]) for pose in poses]), axis=0).max()
        if apart < STILL * self.board.length:
            return snapshot(self.camera, self.board, poses[0], rng, noise)
        seen = np.array([snapshot(self.camera, self.board, pose, rng, 0) for pose in poses], np.float32)
        start = time_s + self.readout_s * np.arange(seen.shape[1]) / seen.shape[1]  # of each row's exposure
        step = (times[-1] - times[0]) / (moments - 1)
        share = np.clip((times[:, None] + step / 2 - start) / step, 0, 1)
        share -= np.clip((times[:, None] + step / 2 - start - self.exposure_s) / step, 0, 1)
        share /= share.sum(axis=0)
        mean = np.einsum("mvu,mv->vu", seen, share.astype(np.float32))
        return np.clip(np.rint(mean + rng.normal(0, noise, mean.shape)), 0, 255).astype(np.uint8)


class SmoothTake(Take):
    """The same board carried without rest and without a jerk through all stops, as a hand on the move carries it."""

    def at(self, time_s: Array) -> RigidTransform:
        """cam_from_board at times (n,): splines through the stops, each passed in the middle of its rest."""
        middle, passed = self.board.corners.mean(axis=0), (self.reach_s + self.leave_s) / 2
        turn = RotationSpline(passed, self.stops.rotation)(time_s)
        where = CubicSpline(passed, self.stops.apply(middle))(time_s)
        return RigidTransform.from_components(where - turn.apply(middle), turn)

    def _picture(self, time_s: float, rng: np.random.Generator, noise: float, moments: int) -> NDArray[np.uint8]:
        """Sharp, each row at the pose of its own time; the middle row is read at `time_s`."""
        height = self.camera.intrinsics.height
        late = self.readout_s / height * (np.arange(height, dtype=np.float64) - (height - 1) / 2)
        return snapshot(self.camera, self.board, self.at(np.asarray(time_s + late)), rng, noise)


def take(
    rng: np.random.Generator,
    camera: Camera,
    board: Board,
    stops: int = 16,
    *,
    others: tuple[Camera, ...] = (),
    window: float = 1.0,
    rest_s: float = 0.4,
    way_s: float = 0.6,
    **how: float,
) -> Take:
    """The board carried between poses all over the middle `window` of the picture.

    All poses lie in the pictures of the `others` as well, which stand in the first camera's frame. The board rests at
    each for `rest_s` on average, at some long and at some hardly, and takes `way_s` to the next.
    """
    poses = spread_boards(rng, (camera, *others), board, stops, TILT_DEG, window)
    upright = [_upright(pose, board) for pose in poses]
    rests = rng.exponential(rest_s, stops) if rest_s else np.zeros(stops)
    ways = way_s * rng.uniform(0.6, 1.6, stops)
    leave = np.cumsum(rests) + np.concatenate([[0], np.cumsum(ways[1:])])
    return Take(camera, board, RigidTransform.concatenate(upright), leave - rests, leave, **how)


def _upright(pose: RigidTransform, board: Board) -> RigidTransform:
    """The pose turned about the board's normal by quarters until its rows run to the right, as a hand would hold it."""
    middle = board.corners.mean(axis=0)
    turns = [pose.rotation * Rotation.from_rotvec([0, 0, quarter * np.pi / 2]) for quarter in range(4)]
    turn = max(turns, key=lambda each: each.as_matrix()[0, 0])
    return RigidTransform.from_components(pose.apply(middle) - turn.apply(middle), turn)


def write_film(path: Path, take: Take, rng: np.random.Generator, code: str = "MJPG", noise: float = 2.0) -> None:
    """The film as a file, in the codec of these four letters that OpenCV writes."""
    grid = take.camera.intrinsics
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), take.rate, (grid.width, grid.height))
    if not writer.isOpened():
        raise ValueError(f"code must be a codec that OpenCV writes into {path.suffix}, got {code!r}")
    for picture in take.pictures(rng, noise):
        writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()


def example(path: str) -> None:
    """A film of eighteen frames, for examples."""
    rng = np.random.default_rng(1)
    camera, board = Camera(Intrinsics.from_fov(160, 120, 60)), Board(4, 3, 0.05)
    write_film(Path(path), replace(take(rng, camera, board, 2, way_s=0.2), rate=10), rng)
