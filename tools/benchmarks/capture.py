"""Guided against unguided calibration of a webcam: `python tools/benchmarks/capture.py [--guided] [--drawn]`.

Each novice holds a board before a virtual webcam whose truth is known; the frames are rendered, and go through
`camviz_clinic.live.Session` as a notebook's do. The same novices without a ghost hold it as hands do: in the middle,
tilted a little. Their views count up to the same goal. Held-out errors are over boards all over the picture, whose
poses are fitted and whose corners are exact.

With --drawn no picture is rendered: corners are the exact ones and noise of 0.06 px, of boards that are whole and
tilted by less than 58 degrees. That takes seconds for a novice in place of minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Board, CannotCalibrate, Detections, calibrate, find_corners
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.guidance import shows_whole, tilt_deg
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.calibration.uncertainty import largest_expected_error
from camviz_clinic.checks.snapshots import snapshot
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.live import Session, session
from camviz_clinic.live.tracking import Gray, Tracked

BOARD = Board(9, 6, 0.025)
WIDTH, HEIGHT = 640, 480
HELD_OUT = 30
TRIES = 80  # poses, after which a novice gives up
POSE_S, FRAME_S = 3.0, 0.1  # from one pose to the next, and between two frames
NOISE, STEEPEST_DEG = 0.06, 58.0  # of corners that are drawn
GOAL, MOST, FEWEST = 1.0, 40, 6


@dataclass(frozen=True)
class Novice:
    """How a novice holds the board: errors beside the ghost, and how often it is followed at all."""

    shift: float  # of the distance, sigma
    turn_deg: float  # sigma about each axis
    follows: float

    def held(self, rng: np.random.Generator, ghost: RigidTransform, camera: Camera) -> RigidTransform:
        if rng.uniform() >= self.follows:
            return by_hand(rng, camera)
        middle = BOARD.corners.mean(axis=0)
        at = ghost.apply(middle) + self.shift * np.linalg.norm(ghost.apply(middle)) * rng.normal(0, 1, 3)
        turn = Rotation.from_rotvec(np.radians(self.turn_deg) * rng.normal(0, 1, 3)) * ghost.rotation
        return RigidTransform.from_components(at - turn.apply(middle), turn)


NOVICES = (Novice(0.03, 4, 1), Novice(0.06, 8, 1), Novice(0.06, 8, 0.7), Novice(0.1, 12, 0.5), Novice(0.06, 8, 0.2))


def by_hand(rng: np.random.Generator, camera: Camera) -> RigidTransform:
    """The board whole in the picture, mostly in its middle, tilted by up to 30 degrees."""
    while True:
        side, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0, 30))
        turn = Rotation.from_rotvec(tilt * np.array([np.cos(side), np.sin(side), 0]))
        turn *= Rotation.from_rotvec([0, 0, np.radians(rng.normal(0, 8))])
        pixel = (rng.normal(0.5, 0.15, 2)) * (WIDTH, HEIGHT)
        k = camera.intrinsics
        ray = np.array([(pixel[0] - k.cx) / k.fx, (pixel[1] - k.cy) / k.fy, 1.0])
        distance = k.fx * 10 * BOARD.square_size / (rng.uniform(0.3, 0.65) * WIDTH)
        pose = RigidTransform.from_components(distance * ray - turn.apply(BOARD.corners.mean(axis=0)), turn)
        if shows_whole(camera, BOARD, RigidTransform.concatenate([pose]))[0]:
            return pose


def webcam(rng: np.random.Generator) -> Camera:
    grid = Intrinsics.from_fov(WIDTH, HEIGHT, rng.uniform(50, 78))
    centre = rng.uniform(-12, 12, 2)
    k = Intrinsics(WIDTH, HEIGHT, grid.fx, grid.fx * rng.normal(1, 0.002), grid.cx + centre[0], grid.cy + centre[1])
    return Camera(k, BrownConrady(rng.uniform(-0.2, 0.05), rng.uniform(0, 0.06)))


def guided(rng: np.random.Generator, novice: Novice, camera: Camera) -> tuple[Session, int]:
    live = Session(BOARD, goal=GOAL, most=MOST)
    live.look(np.full((HEIGHT, WIDTH), 127, np.uint8), 0.0)
    for tried in range(1, TRIES + 1):
        assert live.guide is not None
        frame = snapshot(camera, BOARD, novice.held(rng, live.guide.ghost, camera), rng)
        frames = ((frame, tried * POSE_S + number * FRAME_S) for number in range(3))
        if live.run(frames).done:
            break
    return live, tried


def unguided(rng: np.random.Generator, camera: Camera) -> Iterator[Calibration]:
    """The calibrations of a hand's own views, from the sixth on."""
    corners: list[np.ndarray] = []
    while len(corners) < MOST:
        seen = find_corners(snapshot(camera, BOARD, by_hand(rng, camera), rng), BOARD)
        corners += [seen] if seen is not None else []
        if len(corners) >= FEWEST and seen is not None:
            names = tuple(f"{number}.png" for number in range(len(corners)))
            try:
                yield calibrate(Detections(names, np.array(corners), WIDTH, HEIGHT), BOARD)
            except CannotCalibrate:
                continue


def held_out(found: Calibration, truth: Camera) -> float:
    """The largest error in pixels over boards that neither has seen."""
    poses = spread_boards(np.random.default_rng(99), (truth,), BOARD, HELD_OUT, (0, 45))
    exact = np.array([truth.project(pose.apply(BOARD.corners)) for pose in poses])
    fitted = Adjustment(BOARD, dict(found.cameras), {"camera": exact}, poses, {"camera": ()}).refined(only_poses=True)
    return float(np.linalg.norm(fitted.residuals["camera"], axis=-1).max())


class Drawn:
    """In place of pictures: a frame is grey, and its corners are those of the pose that it was asked for."""

    corners: Array | None = None

    def snapshot(self, camera: Camera, board: Board, pose: RigidTransform, rng: np.random.Generator) -> Gray:
        exact, poses = camera.project(pose.apply(board.corners)), RigidTransform.concatenate([pose])
        seen = shows_whole(camera, board, poses)[0] and tilt_deg(poses, board)[0] < STEEPEST_DEG
        self.corners = exact + NOISE * rng.normal(size=exact.shape) if seen else None
        return np.full((HEIGHT, WIDTH), 127, np.uint8)

    def track(self, _gray: Gray, _board: Board, time_s: float) -> Tracked | None:
        return None if self.corners is None else Tracked(self.corners, time_s, 1.0)

    def find_corners(self, _gray: Gray, _board: Board) -> Array | None:
        return self.corners

    def in_place(self) -> None:
        """Until the program ends."""
        here = sys.modules[__name__]
        for module, name in ((here, "snapshot"), (here, "find_corners"), (session, "track"), (session, "find_corners")):
            setattr(module, name, getattr(self, name))


def off(found: Calibration, truth: Camera) -> float:
    """By how many per cent f is off."""
    return 100 * (found.cameras["camera"].intrinsics.fx / truth.intrinsics.fx - 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--novices", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--guided", action="store_true", help="without the same novices unguided")
    parser.add_argument("--drawn", action="store_true", help="corners in place of pictures")
    options = parser.parse_args()
    if options.drawn:
        Drawn().in_place()
    print("novice follows | guided: views poses f% worst px | unguided, as many views: f% worst px; views to goal")
    for number in range(options.first, options.first + options.novices):
        rng, novice = np.random.default_rng(1000 + number), NOVICES[number % len(NOVICES)]
        camera = webcam(rng)
        live, tried = guided(rng, novice, camera)
        by_ghost, views = live.calibration, len(live.views)
        said = f"{number:3} {novice.follows:.1f} | {views:2} {'' if live.done else 'gave up'} {tried:2} "
        said += f"{off(by_ghost, camera):+.2f} {held_out(by_ghost, camera):.2f}"
        if options.guided:
            print(said, flush=True)
            continue
        alone, to_goal = None, 0
        for count, found in enumerate(unguided(rng, camera), FEWEST):
            alone = found if count <= max(views, FEWEST) else alone
            if not to_goal and largest_expected_error(Adjustment.of(found)) <= GOAL:
                to_goal = count
            if to_goal and count >= views:
                break
        assert alone is not None
        print(f"{said} | {off(alone, camera):+.2f} {held_out(alone, camera):.2f}; {to_goal or f'> {MOST}'}", flush=True)


if __name__ == "__main__":
    main()
