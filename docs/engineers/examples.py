"""The how-to pages' files, by virtual cameras: `python docs/engineers/examples.py FOLDER` writes them to FOLDER."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scipy.special import ndtr

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.panoramas.reprojection import equirectangular_camera
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import snapshot as photograph
from camviz.scenes import textured_scene, to_encoded
from camviz.sensors import Sensor
from camviz_clinic.calibration import calibrate, calibrate_pair, detect
from camviz_clinic.calibration.paper import as_printed
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.rig import lone_poses
from camviz_clinic.checks.snapshots import snapshot, together
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.files.writing import write as write_calibration
from camviz_clinic.films.virtual import SmoothTake, take, write_film
from camviz_clinic.handeye.virtual import cell
from camviz_clinic.rigs import virtual

BOARD = Board(9, 6, 0.025)
SHEET = as_printed(Board(10, 7, 0.018, 0.0135, "DICT_5X5_100"), 94.1)  # made for A4 and fitted to Letter
LEFT = Camera(Intrinsics(640, 480, 530, 531, 322, 238), BrownConrady(-0.2, 0.05))
RIGHT = Camera(Intrinsics(640, 480, 528, 528, 317, 241), BrownConrady(-0.21, 0.05)).at(
    RigidTransform.from_components([0.1, 0.001, 0], Rotation.from_rotvec([0.002, -0.01, 0.003]))
)
FILMING = Camera(Intrinsics(320, 240, 265, 266, 161, 119), BrownConrady(-0.1, 0.02))
KNOCKED = replace(LEFT, intrinsics=replace(LEFT.intrinsics, fx=538, fy=539))
MARKERS = ("door", "shelf", "lamp", "desk")  # on a wall, where:
PLACES = RigidTransform.from_components(
    [[0, 0, 0], [0.42, 0.02, 0.05], [0.02, 0.4, -0.04], [0.41, 0.42, 0.02]],
    Rotation.from_rotvec([[0, 0, 0], [0.1, 0.3, 0.05], [-0.2, 0.1, 0.1], [0.2, -0.2, 0]]),
)
BEFORE_WALL = {
    "cam0": LEFT,
    "cam1": RIGHT.at(RigidTransform.from_components([0.25, 0.01, 0.02], Rotation.from_rotvec([0.02, -0.15, 0.01]))),
}
VIEWS = 14
NOISE = 10.0  # grey levels

GIVEN = """\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 534.80326845, 0, 335.68643204, 0, 534.80326845, 240.66183054, 0, 0, 1 ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0.29589439552724328, -1.0354662043042675, 0, 0, 0 ]
"""  # the left camera of samples/data/intrinsics.yml in OpenCV 4.6 (Apache-2.0)
WIDE = """\
cam0:
  camera_model: ds
  intrinsics: [-0.2, 0.59, 300.0, 300.0, 319.5, 239.5]
  distortion_model: none
  distortion_coeffs: []
  resolution: [640, 480]
"""


def write(folder: Path) -> None:
    """All of it."""
    write_of_one_and_two(folder)
    shoot_rig(folder / "rig")
    shoot_wall(folder / "wall")
    own = np.random.default_rng(20)
    shoot(folder / "phone", LEFT, spread_boards(own, (LEFT,), SHEET, 10, (15, 40)), own, SHEET)
    robot(folder)
    film(folder / "film.avi")
    rolling_film(folder / "rolling.avi")


def write_of_one_and_two(folder: Path) -> None:
    """left/, right/, later/ and knocked/ show a board, two files are solved from them, and what needs no board."""
    rng = np.random.default_rng(18)
    together, later = (spread_boards(rng, seen_by, BOARD, VIEWS, (15, 40)) for seen_by in ((LEFT, RIGHT), (KNOCKED,)))
    shoot(folder / "left", LEFT, together, rng)
    shoot(folder / "right", RIGHT, RIGHT.cam_from_world * together, rng)
    shoot(folder / "later", LEFT, later, rng)
    shoot(folder / "knocked", KNOCKED, later, rng)
    left, right = (detect(sorted((folder / side).iterdir()), BOARD) for side in ("left", "right"))
    write_calibration(calibrate(left, BOARD), folder / "camera.yaml", "opencv")
    write_calibration(calibrate_pair(left, right, BOARD), folder / "stereo.yaml", "opencv")
    (folder / "given.yml").write_text(GIVEN)
    (folder / "wide.yaml").write_text(WIDE)
    cv2.imwrite(str(folder / "edge.png"), edge())
    around = photograph(textured_scene(), equirectangular_camera(256, 128))
    cv2.imwrite(str(folder / "around.png"), around[..., ::-1])
    expose(folder / "frames", rng)


def shoot(
    folder: Path, camera: Camera, cam_from_board: RigidTransform, rng: np.random.Generator, board: Board = BOARD
) -> None:
    """Pictures of the board at these poses, 01.png and so on."""
    folder.mkdir(parents=True)
    alone = camera.at(RigidTransform.identity())
    for number, pose in enumerate(cam_from_board, 1):
        cv2.imwrite(str(folder / f"{number:02}.png"), snapshot(alone, board, pose, rng, NOISE))


def shoot_rig(folder: Path) -> None:
    """Three cameras around a room, the last one a fisheye; each has the pictures of the frames that it sees."""
    rng = np.random.default_rng(19)
    truth = virtual.rig(rng, 3, frames=4, shared=0.75, fisheye=(2,), size=(640, 480))
    for name, camera in truth.cameras.items():
        (folder / name).mkdir(parents=True)
        for frame in np.flatnonzero(truth.seen[name]):
            image = snapshot(
                camera, truth.board, camera.cam_from_world * truth.world_from_board[int(frame)], rng, NOISE
            )
            cv2.imwrite(str(folder / name / f"{frame:02}.png"), image)


def shoot_wall(folder: Path) -> None:
    """Two cameras before four loose markers on a wall, and the file that names the markers beside the folder."""
    rng, middle = np.random.default_rng(4), RigidTransform.from_translation([-0.26, -0.26, 0])
    markers = [Board.marker_grid(1, 1, 0.12, "DICT_4X4_50", first_id=number) for number in range(len(MARKERS))]
    for name in BEFORE_WALL:
        (folder / name).mkdir(parents=True)
    for frame in range(10):
        turn = Rotation.from_rotvec([*rng.normal(0, 0.35, 2), rng.normal(0, 0.2)])
        away = [*rng.normal(0, 0.06, 2) + [0.1, 0], rng.uniform(1.1, 1.5)]
        wall = RigidTransform.from_components(away, turn) * middle
        for name, camera in BEFORE_WALL.items():
            image = together(camera, markers, camera.cam_from_world * wall * PLACES, rng)
            cv2.imwrite(str(folder / name / f"{frame:02}.png"), image)
    words = "--markers 4X4_50 --board 1x1 --square-mm 120 --first-id"
    lines = [f'{name} = "{words} {number}"\n' for number, name in enumerate(MARKERS)]
    (folder.parent / "wall.toml").write_text("".join(lines), encoding="utf-8")


def robot(folder: Path) -> None:
    """hand.yaml, hand/ and poses.csv: a robot, good to 0.2 mm and 0.03°, whose hand shows its camera a board."""
    rng = np.random.default_rng(5)
    true = cell(rng, 10, noise_px=0)
    (folder / "hand").mkdir()
    for number, pose in enumerate(lone_poses(true.camera, true.board, true.pixels), 1):
        cv2.imwrite(str(folder / f"hand/{number:02}.png"), snapshot(true.camera, true.board, pose, rng, NOISE))
    write_calibration(Calibration({"camera": true.camera}, folder, "virtual"), folder / "hand.yaml", "opencv")
    hand = true.base_from_hand
    rows = np.column_stack([1000 * hand.translation, hand.rotation.as_euler("ZYX", degrees=True)])
    lines = [f"{number:02}.png," + ",".join(f"{x:.4f}" for x in row) for number, row in enumerate(rows, 1)]
    (folder / "poses.csv").write_text("\n".join(["picture,X,Y,Z,A,B,C", *lines]) + "\n")


def film(path: Path) -> None:
    """Nine seconds of a board that is carried before a camera, and rests at times."""
    rng = np.random.default_rng(20)
    filmed = take(rng, FILMING, BOARD, 14, rest_s=0.2, way_s=0.4, rate=8.0)
    write_film(path, filmed, rng, noise=3.0)


def rolling_film(path: Path) -> None:
    """A second and a half of a board that never rests before a camera that reads its 240 rows in 25 ms."""
    rng = np.random.default_rng(3)
    stops = take(rng, FILMING, Board(5, 4, 0.045), 5, rest_s=0, way_s=0.45, window=0.7, readout_s=0.025)
    write_film(path, SmoothTake(**vars(stops)), rng)


def edge() -> np.ndarray:
    """An edge that leans by 5°, blurred by a Gaussian of 0.8 pixels, sRGB of 8 bits (200, 120)."""
    v, u = np.indices((200, 120))
    distance = (u - 60) * np.cos(np.radians(5)) - (v - 100) * np.sin(np.radians(5))
    return np.rint(255 * to_encoded(0.1 + 0.8 * ndtr(distance / 0.8))).astype(np.uint8)


def expose(folder: Path, rng: np.random.Generator) -> None:
    """Two bright and two dark frames at each of nine exposures, 60 photons a millisecond."""
    folder.mkdir()
    sensor = Sensor(
        quantum_efficiency=0.5, full_well_e=9000, read_noise_e=8.0, gain_dn_per_e=0.4, offset_dn=80,
        dark_current_e_per_s=300, dsnu_e=6, prnu=0.02,
    )  # fmt: skip
    for ms in (20, 60, 100, 140, 180, 220, 260, 300, 340):
        for number in range(2):
            for kind, photons in (("bright", 60.0 * ms), ("dark", 0.0)):
                light = np.full((240, 320), photons, np.float32)
                frame = sensor.expose(light, ms / 1000, 20.0, rng).dn
                cv2.imwrite(str(folder / f"{kind}_{ms}_{number}.png"), frame)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
