"""A virtual robot whose camera sees a board, healthy or with one fault: tests and benchmarks know its truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RotationSpline

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.motions import Turning
from camviz_clinic.calibration.types import Board
from camviz_clinic.handeye.diagnosis import PosedPictures
from camviz_clinic.handeye.pose_table import RobotPoses
from camviz_clinic.handeye.turn_forms import other_readings, rotations

Rng = np.random.Generator
CAMERA = Camera(Intrinsics(1280, 960, 1150, 1151, 642, 477), BrownConrady(-0.18, 0.05))
BOARD = Board(9, 6, 0.025)
TRIES = 200
WELL_TURNED_DEG = 12.0


@dataclass(frozen=True, eq=False)
class Cell:
    """A robot's cell: what is true, and what robot and camera say of it.

    Attributes:
        X, Z: mount_from_cam and other_from_board, the truth.
        base_from_hand: The robot's own poses (poses,), with its errors.
        pixels: (poses, corners, 2), the board's corners with noise.
        times: (poses,), seconds; None for a robot that stops for each picture.
    """

    X: RigidTransform
    Z: RigidTransform
    eye_to_hand: bool
    base_from_hand: RigidTransform
    pixels: Array
    times: Array | None = None
    camera: Camera = CAMERA
    board: Board = BOARD

    def told(self, base_from_hand: RigidTransform) -> Cell:
        """The same where the robot says something else."""
        return replace(self, base_from_hand=base_from_hand)


def cell(
    rng: Rng,
    poses: int = 15,
    eye_to_hand: bool = False,
    *,
    turns: Rotation | None = None,
    robot_mm: float = 0.2,
    robot_deg: float = 0.03,
    noise_px: float = 0.2,
) -> Cell:
    """A cell whose robot shows the board from all sides, or with these `turns` of the camera."""
    X, Z = _mounted(rng, eye_to_hand)
    if turns is None:
        turns = Rotation.from_rotvec(rng.uniform(-0.55, 0.55, (poses, 3)) * [1, 1, 1.5])
    return _robot(rng, X, Z, eye_to_hand, _seen(rng, turns), (robot_mm, robot_deg, noise_px))


def moving(rng: Rng, poses: int = 40, delay_s: float = 0.0, eye_to_hand: bool = False, hertz: float = 5.0) -> Cell:
    """A cell whose robot does not stop: each pose of the robot is that of `delay_s` after its picture."""
    X, Z = _mounted(rng, eye_to_hand)
    span = poses / hertz
    count = max(4, int(span / 1.2) + 1)
    knots = _seen(rng, Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (count, 3))))
    when, times = np.linspace(-1, span + 1, count), np.arange(poses) / hertz
    cell = _robot(rng, X, Z, eye_to_hand, along(when, knots, times), (0.2, 0.03, 0.2))
    later = _robot(rng, X, Z, eye_to_hand, along(when, knots, times + delay_s), (0.2, 0.03, 0.2))
    return replace(later, pixels=cell.pixels, times=times)


def along(when: Array, poses: RigidTransform, times: Array) -> RigidTransform:
    """A smooth path through poses at times `when`, at other times."""
    turns = RotationSpline(when, poses.rotation)(times)
    return RigidTransform.from_components(CubicSpline(when, poses.translation)(times), turns)


def about_one_axis(rng: Rng, poses: int, wobble_deg: float = 0.0) -> Rotation:
    """Turns about one axis of the camera, up to 45° to either side, and about the others by RMS `wobble_deg`."""
    axis = rng.normal(0, 0.4, 3) + [0, 0, 1]
    main = Rotation.from_rotvec(np.outer(rng.uniform(-0.8, 0.8, poses), axis / np.linalg.norm(axis)))
    return Rotation.from_rotvec(rng.normal(0, max(wobble_deg, 1e-9), (poses, 3)), degrees=True) * main


def _mounted(rng: Rng, eye_to_hand: bool) -> tuple[RigidTransform, RigidTransform]:
    """X and Z: a hand's own parts within 15 cm, those on the base about a metre away."""

    def near() -> RigidTransform:
        turn = Rotation.from_rotvec(rng.normal(0, 1.0, 3))
        return RigidTransform.from_components(rng.uniform(-0.15, 0.15, 3), turn)

    def far() -> RigidTransform:
        turn = Rotation.from_rotvec(rng.normal(0, 1.0, 3))
        return RigidTransform.from_components(rng.uniform(0.4, 0.9, 3) * rng.choice([-1, 1], 3), turn)

    return (far(), near()) if eye_to_hand else (near(), far())


def _seen(rng: Rng, turns: Rotation) -> RigidTransform:
    """cam_from_board for boards turned so from facing the camera, each with all corners inside the picture."""
    return RigidTransform.concatenate([_placed(rng, turn) for turn in turns])


def _placed(rng: Rng, turn: Rotation) -> RigidTransform:
    middle = turn.apply(BOARD.corners.mean(axis=0))
    for attempt in range(TRIES):
        depth = rng.uniform(0.35, 0.6)
        aim = rng.uniform(-0.35, 0.35, 2) * 0.98**attempt
        pose = RigidTransform.from_components(depth * np.array([*aim, 1]) - middle, turn)
        if CAMERA.sees(pose.apply(BOARD.corners)).all():
            return pose
    raise ValueError("turns must leave all of the board inside the picture; one does not")


def _robot(
    rng: Rng,
    X: RigidTransform,
    Z: RigidTransform,
    eye_to_hand: bool,
    cam_from_board: RigidTransform,
    errors: tuple[float, float, float],
) -> Cell:
    mm, deg, px = errors
    A = Z * cam_from_board.inv() * X.inv()
    hand = A.inv() if eye_to_hand else A
    count = len(cam_from_board)
    off = RigidTransform.from_components(
        rng.normal(0, mm / 1000, (count, 3)), Rotation.from_rotvec(rng.normal(0, deg, (count, 3)), degrees=True)
    )
    pixels = np.stack([CAMERA.project(pose.apply(BOARD.corners)) for pose in cam_from_board])
    pixels = pixels + rng.normal(0, px, pixels.shape)
    pixels[~CAMERA.intrinsics.contains(pixels)] = np.nan
    return Cell(X, Z, eye_to_hand, hand * off, pixels)


def strayed(rng: Rng, healthy: Cell, mm: float, deg: float) -> tuple[Cell, int]:
    """A cell one of whose robot poses is off by so much, and which one."""
    which = int(rng.integers(len(healthy.base_from_hand)))
    turn, shift = (vector / np.linalg.norm(vector) for vector in rng.normal(0, 1, (2, 3)))
    off = RigidTransform.from_components(shift * mm / 1000, Rotation.from_rotvec(turn * deg, degrees=True))
    poses: list[Any] = list(healthy.base_from_hand)
    poses[which] = poses[which] * off
    return healthy.told(RigidTransform.concatenate(poses)), which


def scaled(healthy: Cell, factor: float) -> Cell:
    """A cell whose robot's lengths are read in another unit."""
    poses = healthy.base_from_hand
    return healthy.told(RigidTransform.from_components(factor * poses.translation, poses.rotation))


def healthy(rng: Rng) -> Cell:
    """A cell of either arrangement with 8 to 40 poses, whose robot is good to 0.05 to 1 mm; some do not stop.

    The hand turned by 12° (RMS) or more about a second axis.
    """
    while Turning.of((true := _some(rng)).base_from_hand.rotation).deg[1] < WELL_TURNED_DEG:
        pass
    return true


def _some(rng: Rng) -> Cell:
    to_hand = bool(rng.integers(2))
    if rng.random() < 0.2:
        return moving(rng, int(rng.integers(25, 40)), 0.0, to_hand)
    size = 10 ** rng.uniform(-1.3, 0)
    poses = int(rng.integers(8, 26))
    return cell(rng, poses, to_hand, robot_mm=size, robot_deg=0.1 * size, noise_px=rng.uniform(0.1, 0.4))


def _stopping(rng: Rng) -> Cell:
    """A healthy cell of 12 to 20 poses, good to 0.2 mm."""
    return cell(rng, int(rng.integers(12, 21)), bool(rng.integers(2)))


def _case(healthy: Cell, poses: RobotPoses | None = None, board: Board | None = None) -> PosedPictures:
    told = poses or RobotPoses(healthy.base_from_hand, times=healthy.times)
    return PosedPictures(told, healthy.pixels, healthy.camera, board or healthy.board, healthy.eye_to_hand)


def _reordered(rng: Rng) -> PosedPictures:
    """Reversed, sorted as words, in no order, or two poses exchanged."""
    well = _stopping(rng)
    count = len(well.base_from_hand)
    exchanged = np.arange(count)
    i, j = rng.choice(count, 2, replace=False)
    exchanged[[i, j]] = j, i
    words = np.array(sorted(range(count), key=lambda each: str(each + 1)))
    orders = (np.arange(count)[::-1], words, rng.permutation(count), exchanged)
    return _case(well.told(well.base_from_hand[orders[rng.integers(4)]]))


def _repeated(rng: Rng) -> PosedPictures:
    """From some row on, or in blocks of two or three, one pose is written again and again."""
    well = _stopping(rng)
    rows = np.arange(len(well.base_from_hand))
    block = int(rng.integers(2, 4))
    stale = rows - rows % block if rng.integers(2) else np.minimum(rows, rng.integers(0, 7))
    return _case(well.told(well.base_from_hand[stale]))


def lost_pictures(well: Cell, first: int, count: int, *, rows: bool = False) -> Cell:
    """A cell that lacks some pictures, or rows, from `first` on, so that all after them belong to other rows."""
    kept = np.delete(np.arange(len(well.base_from_hand)), np.arange(first, first + count))
    ends = slice(None, len(kept))
    if rows:
        return replace(well, base_from_hand=well.base_from_hand[kept], pixels=well.pixels[ends])
    return replace(well, base_from_hand=well.base_from_hand[ends], pixels=well.pixels[kept])


def _shifted(rng: Rng) -> PosedPictures:
    """One to three poses, or pictures, are missing: the first, or some later."""
    well, shift = _stopping(rng), int(rng.integers(1, 4))
    if rng.integers(2):
        return _case(lost_pictures(well, int(rng.integers(2, 7)), shift, rows=bool(rng.integers(2))))
    if rng.integers(2):
        return _case(replace(well, base_from_hand=well.base_from_hand[shift:], pixels=well.pixels[:-shift]))
    return _case(replace(well, base_from_hand=well.base_from_hand[:-shift], pixels=well.pixels[shift:]))


def _misread(rng: Rng) -> PosedPictures:
    """Quaternions in the other order, or Euler angles about other axes."""
    well = _stopping(rng)
    form, read = (("wxyz", "xyzw"), ("euler-ZYX", "euler-xyz"), ("rotvec", "euler-xyz"))[rng.integers(3)]
    turns, place = well.base_from_hand.rotation, well.base_from_hand.translation
    if form == "wxyz":
        numbers = turns.as_quat()[:, [3, 0, 1, 2]]
    else:
        numbers = turns.as_rotvec() if form == "rotvec" else turns.as_euler("ZYX")

    def posed(rotation: Rotation) -> RigidTransform:
        return RigidTransform.from_components(place, rotation)

    others = {asked: posed(other) for asked, other in other_readings(read, numbers, degrees=False)}
    return _case(well, RobotPoses(posed(rotations(read, numbers, degrees=False)), others=others))


def _inverted(rng: Rng) -> PosedPictures:
    """hand_from_base in place of base_from_hand."""
    well = _stopping(rng)
    return _case(well.told(well.base_from_hand.inv()))


def _one_axis(rng: Rng) -> PosedPictures:
    """The hand turned about one axis, and by 0.2° about the others."""
    return _case(cell(rng, eye_to_hand=bool(rng.integers(2)), turns=about_one_axis(rng, 15, 0.2)))


def _little_turning(rng: Rng) -> PosedPictures:
    """The hand turned by 2° to 6° (RMS) about every axis."""
    turns = Rotation.from_rotvec(rng.normal(0, rng.uniform(2, 6), (15, 3)), degrees=True)
    return _case(cell(rng, eye_to_hand=bool(rng.integers(2)), turns=turns))


def _squares(rng: Rng) -> PosedPictures:
    """The board's squares are 2 to 5 % longer or shorter than told."""
    well = _stopping(rng)
    factor = 1 + rng.uniform(0.02, 0.05) * rng.choice([-1, 1])
    return _case(well, board=replace(well.board, square_size=factor * well.board.square_size))


FAULTS: Mapping[str, Callable[[Rng], PosedPictures]] = {
    "wrong-unit": lambda rng: _case(scaled(_stopping(rng), float(rng.choice([0.001, 1000])))),
    "poses-repeated": _repeated,
    "poses-inverted": _inverted,
    "poses-shifted": _shifted,
    "poses-reordered": _reordered,
    "poses-misread": _misread,
    "time-offset": lambda rng: _case(moving(rng, 40, rng.uniform(0.04, 0.16) * rng.choice([-1, 1]))),
    "one-axis": _one_axis,
    "little-turning": _little_turning,
    "stray-pose": lambda rng: _case(strayed(rng, _stopping(rng), rng.uniform(10, 40), rng.uniform(1, 5))[0]),
    "scale-differs": _squares,
}
"""By finding, a random case that must lead to it."""


def healthy_case(rng: Rng) -> PosedPictures:
    """A random case in which nothing is wrong."""
    return _case(healthy(rng))
