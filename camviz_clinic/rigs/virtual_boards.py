"""Virtual cameras before several boards: a plate with two sides, walls of a room, loose markers, boards that part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.types import Board
from camviz_clinic.rigs.target import scaled
from camviz_clinic.rigs.virtual import FACING_DEG, SIZE, inside, placed_around

FRONT, BACK = Board(9, 6, 0.05), Board(5, 4, 0.06)
OUT_OF_HALF_TURN = Rotation.from_rotvec([0, np.pi, 0])


@dataclass(frozen=True, eq=False)
class VirtualBoards:
    """What is true: cameras in place, boards, where they are in each frame, and noise.

    Args:
        cameras: By name; the first one's frame is the world.
        boards: By name.
        places: reference_from_board by board.
        world_from_reference: By board, one pose of its reference for each frame.
        noise: Standard deviation in pixels of a detected corner's coordinates.
        printed: By board, how many times larger it is than it is said to be.
    """

    cameras: dict[str, Camera]
    boards: dict[str, Board]
    places: dict[str, RigidTransform]
    world_from_reference: dict[str, RigidTransform]
    noise: float = 0.2
    printed: Mapping[str, float] = field(default_factory=dict)

    def observed(self, rng: np.random.Generator) -> dict[str, dict[str, Detections]]:
        """What each camera finds of each board, seen whole and from its front.

        Args:
            rng: Random numbers.

        Returns: By camera and board; their places are the frames.
        """
        return {name: {board: self._seen(rng, name, board) for board in self.boards} for name in self.cameras}

    def _seen(self, rng: np.random.Generator, name: str, board: str) -> Detections:
        camera, poses = self.cameras[name], self.world_from_reference[board] * self.places[board]
        points = moved(poses, scaled(self.boards[board], self.printed.get(board, 1.0)).corners)
        pixels, rays = camera.project(points), points.mean(axis=1) - camera.centre
        towards = np.sum(poses.rotation.as_matrix()[:, :, 2] * rays, axis=1) / np.linalg.norm(rays, axis=1)
        frames = np.flatnonzero(inside(camera, pixels).all(axis=1) & (towards > np.cos(np.radians(FACING_DEG))))
        noisy = pixels[frames] + rng.normal(0, self.noise, pixels[frames].shape)
        pictures = tuple(f"{name}/{frame:04}.png" for frame in frames)
        grid = camera.intrinsics
        return Detections(pictures, noisy, grid.width, grid.height, places=tuple(map(int, frames)))


def two_sided(rng: np.random.Generator, cameras: int = 4, *, frames: int = 30) -> VirtualBoards:
    """A plate with a board on either side turns amid cameras all around: those opposite never see one side together.

    Args:
        rng: Random numbers.
        cameras: How many.
        frames: How many.

    Returns: VirtualBoards of "front" and "back".
    """
    by_name, first = placed_around(rng, cameras, 360 / cameras)
    turn = OUT_OF_HALF_TURN * Rotation.from_rotvec([0, 0, 0.02])
    places = {
        "front": RigidTransform.identity(),
        "back": RigidTransform.from_components([0.36, 0.01, 0.004], turn),
    }
    upright = np.column_stack(
        [rng.normal(0, 0.3, frames), rng.uniform(-np.pi, np.pi, frames), rng.normal(0, 0.3, frames)]
    )
    poses = _carried(rng, first, FRONT, Rotation.from_rotvec(upright), 0.1)
    return VirtualBoards(by_name, {"front": FRONT, "back": BACK}, places, {"front": poses, "back": poses})


def back_to_back(rng: np.random.Generator, *, frames: int = 25, turn: float = 0.15) -> VirtualBoards:
    """Two cameras that look away from each other, carried about a room with a board on either of two walls.

    Args:
        rng: Random numbers.
        frames: How many.
        turn: Standard deviation of the rig's turns about each axis, in radians.

    Returns: VirtualBoards of "ahead" and "behind".
    """
    camera = Camera(Intrinsics.from_fov(*SIZE, 60), BrownConrady(-0.1, 0.02, 3e-4, -2e-4))
    away = Rotation.from_rotvec([0.05, np.pi - 0.1, 0.02])
    cameras = {"cam0": camera, "cam1": camera.at(RigidTransform.from_components([0.05, 0.1, -0.2], away))}
    ahead = RigidTransform.from_translation([-0.2, -0.12, 1.0])
    behind = RigidTransform.from_components([0.25, -0.12, -1.2], OUT_OF_HALF_TURN)
    turns = Rotation.from_rotvec(rng.normal(0, turn, (frames, 3)))
    poses = RigidTransform.from_components(rng.normal(0, 0.06, (frames, 3)), turns).inv() * ahead
    places = {"ahead": RigidTransform.identity(), "behind": ahead.inv() * behind}
    boards = {"ahead": FRONT, "behind": Board(9, 7, 0.05)}
    return VirtualBoards(cameras, boards, places, {"ahead": poses, "behind": poses})


def markers(
    rng: np.random.Generator, *, count: int = 12, frames: int = 40, askew: float = 0.25, turn: float = 0.35
) -> VirtualBoards:
    """One camera before loose markers, each stuck somewhere on a wall and a little askew.

    Args:
        rng: Random numbers.
        count: Of the markers.
        frames: How many pictures.
        askew, turn: Standard deviation of the markers' and of the camera's turns about each axis, in radians.

    Returns: VirtualBoards of "marker0", "marker1" …
    """
    camera = Camera(Intrinsics.from_fov(*SIZE, 60), BrownConrady(-0.1, 0.02, 3e-4, -2e-4))
    names = [f"marker{number}" for number in range(count)]
    boards = {name: Board.marker_grid(1, 1, 0.08, "DICT_4X4_50", first_id=i) for i, name in enumerate(names)}
    at = [0.25 * np.array([i % 4, i // 4, 0]) + rng.normal(0, [0.02, 0.02, 0.1]) for i in range(count)]
    wall = RigidTransform.from_components(at, Rotation.from_rotvec(rng.normal(0, askew, (count, 3))))
    steps = np.column_stack([rng.normal(0, 0.15, (frames, 2)), rng.uniform(0.8, 1.6, frames)])
    turns = Rotation.from_rotvec(rng.normal(0, turn, (frames, 3)))
    middle = RigidTransform.from_translation(-np.mean(at, axis=0))
    poses = RigidTransform.from_components(steps, turns) * middle * wall[0]
    places = {name: wall[0].inv() * wall[i] for i, name in enumerate(names)}
    return VirtualBoards({"cam0": camera}, boards, places, dict.fromkeys(names, poses))


def parting(rng: np.random.Generator, cameras: int = 3, *, frames: int = 20) -> VirtualBoards:
    """Two boards that two people carry about before the same cameras, each as he likes.

    Args:
        rng: Random numbers.
        cameras: How many.
        frames: How many.

    Returns: VirtualBoards of "one" and "other".
    """
    by_name, first = placed_around(rng, cameras, 25)
    poses = {}
    for name, board in (("one", FRONT), ("other", BACK)):
        towards = Rotation.from_rotvec([0, -np.radians(25) * (cameras - 1) / 2, 0])
        turns = towards * Rotation.from_rotvec(rng.normal(0, 0.3, (frames, 3)))
        poses[name] = _carried(rng, first, board, turns, 0.15)
    return VirtualBoards(by_name, {"one": FRONT, "other": BACK}, dict.fromkeys(poses, RigidTransform.identity()), poses)


def _carried(
    rng: np.random.Generator, first: RigidTransform, board: Board, turns: Rotation, spread: float
) -> RigidTransform:
    """A board's poses turned about its middle, which strays by `spread` metres about the middle of the room `first`."""
    middle = RigidTransform.from_translation(-board.corners.mean(axis=0))
    return first * (RigidTransform.from_components(rng.normal(0, spread, (len(turns), 3)), turns) * middle)


def misprinted(truth: VirtualBoards, board: str, factor: float) -> VirtualBoards:
    """The same with one board printed in another size than it is said to have.

    Args:
        truth: Any.
        board: Which.
        factor: How many times larger it is.

    Returns: VirtualBoards.
    """
    return replace(truth, printed={**truth.printed, board: factor})
