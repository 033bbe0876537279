"""A virtual rig: cameras on an arc around a room, a board shown to them in turn, and corners with noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians

import numpy as np

from camviz.cameras import Camera, Intrinsics, look_at
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.types import Board, Mask

BOARD = Board(9, 6, 0.05)
SIZE = (1280, 960)
MARGIN = 4.0  # pixels between a corner and the border
FACING_DEG = 65.0  # from the board's normal: a board that is turned further away is not found
FEWEST_SHARED = 3  # frames that neighbours see together, however small the share
TRIES = 400


@dataclass(frozen=True, eq=False)
class VirtualRig:
    """What is true: cameras in place, a board, its poses in the world, who sees it when, and noise.

    Args:
        cameras: By name; the first one's frame is the world.
        board: What is shown to them.
        world_from_board: One pose for each frame, in metres.
        seen: (frames,) of bool by camera, True where the camera has the board in its picture.
        noise: Standard deviation in pixels of a detected corner's coordinates.
        late: By camera, how many frames its pictures lag behind those of the others.
        knocked: By camera, the first frame after it was moved, and its pose in the world from there on.

    >>> truth = rig(np.random.default_rng(1), 3)
    >>> list(truth.cameras), truth.seen["cam0"].shape == (len(truth.world_from_board),)
    (['cam0', 'cam1', 'cam2'], True)
    """

    cameras: dict[str, Camera]
    board: Board
    world_from_board: RigidTransform
    seen: dict[str, Mask]
    noise: float = 0.2
    late: dict[str, float] | None = None
    knocked: dict[str, tuple[int, RigidTransform]] | None = None

    def corners(self, name: str) -> Array:
        """Where a camera sees the corners of every frame, without noise.

        Args:
            name: The camera.

        Returns: (frames, corners, 2), pixels; NaN in a frame in which it does not see all of them.
        """
        camera, poses = self.cameras[name], self.world_from_board
        if self.late and name in self.late:
            poses = delayed(poses, self.late[name])
        points = moved(poses, self.board.corners)
        pixels = camera.project(points)
        if self.knocked and name in self.knocked:
            first, pose = self.knocked[name]
            pixels[first:] = camera.at(pose).project(points[first:])
        out = ~inside(camera, pixels).all(axis=1) | ~self.seen[name]
        pixels[out] = np.nan
        return np.asarray(pixels)

    def observed(self, rng: np.random.Generator) -> dict[str, Detections]:
        """The corners that each camera finds, with noise.

        Args:
            rng: Random numbers.

        Returns: By camera; their places are the frames.
        """
        found = {}
        for name, camera in self.cameras.items():
            corners = self.corners(name)
            frames = np.flatnonzero(np.isfinite(corners).all(axis=(1, 2)))
            noisy = corners[frames] + rng.normal(0, self.noise, corners[frames].shape)
            pictures = tuple(f"{name}/{frame:04}.png" for frame in frames)
            grid = camera.intrinsics
            found[name] = Detections(pictures, noisy, grid.width, grid.height, places=tuple(map(int, frames)))
        return found


def rig(
    rng: np.random.Generator,
    cameras: int = 4,
    *,
    frames: int = 20,
    shared: float = 0.5,
    fisheye: tuple[int, ...] = (),
    step_deg: float = 25.0,
    size: tuple[int, int] = SIZE,
) -> VirtualRig:
    """Cameras 1.2 m around the middle of a room that look inwards, and boards held up to each of them.

    Args:
        rng: Random numbers.
        cameras: How many.
        frames: How many are meant for each camera.
        shared: Share of a camera's frames that all who can see the board do see; of the others it has them alone.
        fisheye: Which of the cameras, by number, have a fisheye (Kannala-Brandt) in place of a lens of 60°.
        step_deg: Angle between neighbours, seen from the middle of the room.
        size: Width and height of the pictures, in pixels.

    Returns: VirtualRig with cameras "cam0", "cam1" …; neighbours share three frames at least.
    """
    placed = _around(rng, cameras, step_deg, fisheye, size)
    together = min(max(FEWEST_SHARED, round(shared * frames)), frames)
    poses: list[RigidTransform] = []
    masks: list[list[bool]] = []
    for number, camera in enumerate(placed):
        neighbour = placed[number + 1 if number + 1 < cameras else number - 1]
        for frame in range(frames):
            if frame < together:
                pose = _pose(rng, [camera, neighbour] if cameras > 1 else [camera], 0.5)
                sees = [_sees(each, pose) for each in placed]
            else:
                pose = _pose(rng, [camera], 1.0)
                sees = [each is camera for each in placed]
            poses.append(pose)
            masks.append(sees)
    first = placed[0].cam_from_world
    by_name = {f"cam{number}": camera.at(first * camera.world_from_cam) for number, camera in enumerate(placed)}
    seen = {name: np.array(masks)[:, number] for number, name in enumerate(by_name)}
    return VirtualRig(by_name, BOARD, first * RigidTransform.concatenate(poses), seen)


def placed_around(
    rng: np.random.Generator, cameras: int, step_deg: float, fisheye: tuple[int, ...] = ()
) -> tuple[dict[str, Camera], RigidTransform]:
    """Cameras 1.2 m around the middle of a room that look inwards.

    Args:
        rng: Random numbers.
        cameras: How many.
        step_deg: Angle between neighbours, seen from the middle.
        fisheye: Which of the cameras have a fisheye.

    Returns: By name, in the first one's frame; and the pose of the room in that frame.
    """
    placed = _around(rng, cameras, step_deg, fisheye, SIZE)
    first = placed[0].cam_from_world
    return {f"cam{number}": camera.at(first * camera.world_from_cam) for number, camera in enumerate(placed)}, first


def film(rng: np.random.Generator, cameras: int = 3, *, frames: int = 60, fisheye: tuple[int, ...] = ()) -> VirtualRig:
    """Such a rig that films a board which somebody carries around the room; it moves by centimetres between frames.

    Args:
        rng: Random numbers.
        cameras: How many.
        frames: How many pictures each camera takes.
        fisheye: Which of the cameras have a fisheye.

    Returns: VirtualRig whose frames follow each other in time.
    """
    by_name, first = placed_around(rng, cameras, 25, fisheye)
    towards = first.inv() * by_name[f"cam{cameras // 2}"].world_from_cam
    time = np.linspace(0, 1, frames)

    def wander(size: float, turns: float) -> Array:
        phases = rng.uniform(0, 2 * np.pi, 3)
        waves = [np.sin(2 * np.pi * (turns + i) * time[:, None] + phases) / (1 + i) for i in range(2)]
        return size * np.sum(waves, axis=0)

    middle = RigidTransform.from_translation(-BOARD.corners.mean(axis=0))
    turns = Rotation.from_rotvec(wander(0.3, 3))
    swings = RigidTransform.from_components(wander(0.22, 2), towards.rotation * turns)
    poses = first * (swings * middle)
    points = moved(poses, BOARD.corners)
    seen = {name: np.all(inside(camera, camera.project(points)), axis=1) for name, camera in by_name.items()}
    return VirtualRig(by_name, BOARD, poses, seen)


def shown(truth: VirtualRig, world_from_board: RigidTransform) -> VirtualRig:
    """The same cameras before a board at other poses; each sees it where it is inside its image.

    Args:
        truth: The rig.
        world_from_board: One pose for each frame.

    Returns: VirtualRig.
    """
    points = moved(world_from_board, truth.board.corners)
    seen = {
        name: np.asarray(inside(camera, camera.project(points)).all(axis=1)) for name, camera in truth.cameras.items()
    }
    return replace(truth, world_from_board=world_from_board, seen=seen)


def delayed(poses: RigidTransform, frames: float) -> RigidTransform:
    """Where a board was so many frames ago, in between on a straight way; the ends stay where they are."""
    last = len(poses) - 1
    at = np.clip(np.arange(len(poses)) - frames, 0, last)
    before = np.minimum(np.floor(at).astype(int), max(last - 1, 0))
    share = (at - before)[:, None]
    one, other = poses[before], poses[np.minimum(before + 1, last)]
    turn = (other.rotation * one.rotation.inv()).as_rotvec()
    shift = other.translation - one.translation
    return RigidTransform.from_components(
        one.translation + share * shift, Rotation.from_rotvec(share * turn) * one.rotation
    )


def inside(camera: Camera, pixels: Array) -> Mask:
    """Whether pixels (..., 2) lie on the image, off its border."""
    grid = camera.intrinsics
    high = np.array([grid.width, grid.height]) - 1 - MARGIN
    return np.asarray(np.all((pixels > MARGIN) & (pixels < high), axis=-1))


def _around(
    rng: np.random.Generator, cameras: int, step_deg: float, fisheye: tuple[int, ...], size: tuple[int, int]
) -> list[Camera]:
    return [_camera(rng, number in fisheye, radians(step_deg) * number, size) for number in range(cameras)]


def _camera(rng: np.random.Generator, fisheye: bool, angle: float, size: tuple[int, int] = SIZE) -> Camera:
    """One of ordinary numbers, everything off by a little, that looks at the middle from an angle."""
    place = 1.2 * np.array([np.sin(angle), 0.0, -np.cos(angle)]) + rng.normal(0, 0.03, 3)
    pose = look_at(place, rng.normal(0, 0.03, 3))
    k1, k2 = rng.uniform(-0.2, 0.02), rng.uniform(0.01, 0.04)
    lens = KannalaBrandt(*rng.normal(0, (0.02, 0.004, 0.001, 0.0))) if fisheye else BrownConrady(k1, k2, 3e-4, -2e-4)
    grid = Intrinsics.from_fov(*size, rng.uniform(58, 64))
    f = grid.fx if not fisheye else 0.38 * size[0]
    off = rng.uniform(-0.01, 0.01, 2) * size[0]
    grid = replace(grid, fx=f, fy=f * rng.normal(1, 0.001), cx=grid.cx + off[0], cy=grid.cy + off[1])
    return Camera(grid, lens, pose)


def _pose(rng: np.random.Generator, cameras: list[Camera], spread: float) -> RigidTransform:
    """A board that all these cameras see whole, over the part `spread` of the first one's image, tilted."""
    camera, grid = cameras[0], cameras[0].intrinsics
    facing = Rotation.concatenate([each.world_from_cam.rotation for each in cameras]).mean()
    middle = BOARD.corners.mean(axis=0)
    for attempt in range(TRIES):
        aim = spread * 0.995**attempt * rng.uniform(-0.95, 0.95, 2)
        side, tilt = rng.uniform(0, 2 * np.pi), radians(rng.uniform(5, 40))
        spin = Rotation.from_rotvec([0, 0, rng.uniform(-0.5, 0.5) + np.pi / 2 * rng.integers(4)])
        turn = facing * Rotation.from_rotvec(tilt * np.array([np.cos(side), np.sin(side), 0])) * spin
        pixel = (aim + 1) / 2 * [grid.width, grid.height] - 0.5
        ray = camera.lens.unproject(grid.from_pixels(pixel))
        if not np.isfinite(ray).all():  # beyond what a fisheye sees
            continue
        away = rng.uniform(0.5, 1.0) if len(cameras) == 1 else rng.uniform(0.9, 1.4)
        away *= 0.5 if isinstance(camera.lens, KannalaBrandt) and len(cameras) == 1 else 1.0
        where = camera.world_from_cam.apply(away * ray / np.linalg.norm(ray))
        pose = RigidTransform.from_components(where - turn.apply(middle), turn)
        if all(_sees(each, pose) for each in cameras):
            return pose
    raise ValueError("cameras must have a place in common in which all see the board; they have none")


def _sees(camera: Camera, pose: RigidTransform) -> bool:
    points = pose.apply(BOARD.corners)
    normal, ray = pose.rotation.as_matrix()[:, 2], points.mean(axis=0) - camera.centre
    facing = normal @ ray / np.linalg.norm(ray) > np.cos(radians(FACING_DEG))
    return bool(facing and inside(camera, camera.project(points)).all())
