"""`hand_eye_from_corners` on industrial_calibration's two sets of real poses, by the measures that project reports.

python tools/benchmarks/handeye_sets.py FOLDER    a checkout's examples/data

The 3D reprojection error is how far each corner, carried from its picture to the board's plane, lies from where it is.
It is told in the pictures that X and Z were solved from, and in each picture while it is left out. "Reprojection alone"
takes the robot to be perfect, as industrial_calibration does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import yaml

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Board
from camviz_clinic.handeye import RobotPoses, hand_eye_from_corners
from camviz_clinic.handeye.adjusting import Adjusted
from camviz_clinic.handeye.diagnosis import PosedPictures


@dataclass(frozen=True)
class Posed:
    """Pictures of a board with the robot's pose in each."""

    poses: RigidTransform
    pixels: Array
    camera: Camera
    board: Board
    eye_to_hand: bool

    def only(self, kept: Array) -> Posed:
        return replace(self, poses=self.poses[kept], pixels=self.pixels[kept])

    @property
    def other_from_mount(self) -> RigidTransform:
        return self.poses.inv() if self.eye_to_hand else self.poses


def circles(picture: Array) -> Array:
    """The centres (100, 2) of 10 × 10 dots, from the large one in a corner on."""
    wanted = cv2.SimpleBlobDetector_Params()
    wanted.minThreshold, wanted.maxThreshold, wanted.minRepeatability = 20, 220, 3
    wanted.minArea, wanted.maxArea, wanted.filterByInertia = 25, 5000, False
    wanted.minConvexity, wanted.minDistBetweenBlobs = 0.8, 4
    detector = cv2.SimpleBlobDetector_create(wanted)
    flags = cv2.CALIB_CB_SYMMETRIC_GRID | cv2.CALIB_CB_CLUSTERING
    found, centres = cv2.findCirclesGrid(picture, (10, 10), flags=flags, blobDetector=detector)
    if not found:
        return np.full((100, 2), np.nan)
    grid, blobs = centres.reshape(10, 10, 2), detector.detect(picture)
    if np.linalg.det([grid[0, 9] - grid[0, 0], grid[9, 0] - grid[0, 0]]) < 0:
        grid = grid.transpose(1, 0, 2)
    places = np.array([blob.pt for blob in blobs])
    sizes = [
        blobs[np.argmin(np.linalg.norm(places - grid[at], axis=1))].size for at in ((0, 0), (0, 9), (9, 9), (9, 0))
    ]
    return np.rot90(grid, int(np.argmax(sizes))).reshape(100, 2)


def charuco(picture: Array) -> Array:
    """The inner corners (24, 2) of 5 × 7 squares."""
    board = cv2.aruco.CharucoBoard(
        (5, 7), 0.036195, 0.018256, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_6X6_250)
    )
    corners, ids, *_ = cv2.aruco.CharucoDetector(board).detectBoard(picture)
    placed = np.full((24, 2), np.nan)
    if ids is not None:
        placed[ids.ravel()] = corners.reshape(-1, 2)
    return placed


def read(folder: Path, find: Callable[[Array], Array], board: Board) -> Posed:
    told = yaml.safe_load((folder / "cal_data.yaml").read_text())
    numbers = [yaml.safe_load((folder / each["pose"]).read_text()) for each in told["data"]]
    pictures = [cv2.imread(str(folder / each["image"]), cv2.IMREAD_GRAYSCALE) for each in told["data"]]
    places = [[each[axis] for axis in "xyz"] for each in numbers]
    turns = Rotation.from_quat([[each[f"q{axis}"] for axis in "xyzw"] for each in numbers])
    height, width = pictures[0].shape
    camera = Camera(Intrinsics(width, height, *(told["intrinsics"][name] for name in ("fx", "fy", "cx", "cy"))))
    pixels = np.stack([find(each) for each in pictures])
    seen = np.isfinite(pixels).all(axis=-1).sum(axis=1) >= 4
    return Posed(RigidTransform.from_components(places, turns), pixels, camera, board, told["static_camera"]).only(seen)


def on_the_board(posed: Posed, solved: Adjusted) -> Array:
    """The 3D reprojection errors of all corners, in millimetres."""
    poses = (solved.X.inv() * posed.other_from_mount.inv() * solved.Z).as_matrix()
    k = posed.camera.intrinsics
    x, y = (posed.pixels[..., 0] - k.cx) / k.fx, (posed.pixels[..., 1] - k.cy) / k.fy
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    normals, origins = poses[:, :3, 2], poses[:, :3, 3]
    distances = np.sum(normals * origins, axis=1)[:, None] / np.einsum("pc,pnc->pn", normals, rays)
    places = (rays * distances[..., None] - origins[:, None]) @ poses[:, :3, :3]
    errors = 1000 * np.linalg.norm(places - posed.board.corners, axis=-1)
    return errors[np.isfinite(errors)]


def solutions(posed: Posed) -> tuple[Adjusted, Adjusted]:
    """camviz's, and from there by reprojection alone over the same poses."""
    solved = hand_eye_from_corners(posed.poses, posed.pixels, posed.camera, posed.board, eye_to_hand=posed.eye_to_hand)
    return solved.adjusted, replace(solved.adjusted, noise=None).refined()


def rows(name: str, posed: Posed) -> list[str]:
    count = len(posed.poses)
    left_out: tuple[list[Array], list[Array]] = ([], [])
    for each in range(count):
        one = np.arange(count) == each
        for errors, solved in zip(left_out, solutions(posed.only(~one)), strict=True):
            errors.append(on_the_board(posed.only(one), solved))
    told = []
    for how, solved, left in zip(("camviz", "reprojection alone"), solutions(posed), left_out, strict=True):
        used = np.isin(posed.other_from_mount.translation[:, 0], solved.motions.other_from_mount.translation[:, 0])
        inside = on_the_board(posed.only(used), solved).mean()
        pnp = 1000 * solved.errors[0].mean()
        told.append(
            f"| {name} | {how} | {used.sum()} of {count} | {inside:.2f} mm | {np.concatenate(left).mean():.2f} mm | "
            f"{pnp:.1f} mm |"
        )
    return told


def main(folder: Path) -> None:
    print("| set | solution | poses | 3D reprojection error, mean | in pictures left out | off the board's own pose |")
    print("|---|---|---|---|---|---|")
    sets = {
        "test_set_10x10": read(folder / "test_set_10x10", circles, Board(10, 10, 0.0254)),
        "test_set_charuco": read(folder / "test_set_charuco", charuco, Board(4, 6, 0.036195)),
    }
    for name, posed in sets.items():
        print(*rows(name, posed), sep="\n", flush=True)
    for name, posed in sets.items():
        case = PosedPictures(RobotPoses(posed.poses), posed.pixels, posed.camera, posed.board, posed.eye_to_hand)
        print(f"\n{name}:", *(each.sentence for each in case.findings), sep="\n- ")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
