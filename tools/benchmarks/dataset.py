"""How often the poses of `camviz dataset` and `camviz poses` are within their ±, and how exact the files are.

python tools/benchmarks/dataset.py                     every board, 20 seeds of ten photographs
python tools/benchmarks/dataset.py ChArUco 5           some of the boards, so many seeds

Photographs are rendered in sRGB with known truth. A pose has six numbers: the camera's place along the board's axes,
and its turn about its own. Their pull is how far each is off, in its own ±. The mapping of undistorted pictures is held
against OpenCV's and pycolmap's, and what is read back of the files against the poses that were written.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Perspective
from camviz.poses import RigidTransform
from camviz_clinic.calibration import Board, Calibration, Detections, calibrate, find_corners
from camviz_clinic.checks.snapshots import SHARP, together
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.datasets.folder import MODEL, TRANSFORMS, write_poses
from camviz_clinic.datasets.poses import CameraPoses, find_poses
from camviz_clinic.datasets.undistortion import Undistortion
from camviz_clinic.files import load

try:
    import pycolmap
except ImportError:
    pycolmap = None

CAMERA = Camera(Intrinsics(640, 480, 530, 531, 322, 238), BrownConrady(-0.2, 0.05))
BOARDS = {
    "chessboard": Board(9, 6, 0.025),
    "ChArUco": Board(9, 6, 0.025, 0.019, "DICT_5X5_100"),
    "AprilGrid": Board.aprilgrid(4, 3, 0.04, 0.3),
    "markers": Board.marker_grid(4, 3, 0.04, "DICT_4X4_50"),
}
TEXELS = {"AprilGrid": (20 / 39, 39)}  # the margin, and texels along a tag and its gap, which are 13 cells
FINDERS = {"chessboard, sectors": "sectors"}  # the others are found as `camviz dataset` does
BOARDS["chessboard, sectors"] = BOARDS["chessboard"]
SEED, VIEWS, TILT_DEG, NOISE = 95_000, 10, (15, 40), 3.0
HALF = 0.5  # of a pixel: where COLMAP's first pixel has its centre
BEHIND_M = 0.01  # the points that are read back lie behind the board


def main(kinds: list[str], seeds: int) -> None:
    print("| board | camera | photographs | within 3 ± | RMS pull | OpenCV px | pycolmap px | read px | by pycolmap |")
    print("|---|---|---|---|---|---|---|---|---|")
    for kind in kinds:
        known, solved, exact = [], [], []
        for seed in range(seeds):
            found, truth = photographed(kind, np.random.default_rng([SEED, seed]))
            calibration = calibrate(found, BOARDS[kind], board_warp="auto")
            known.append(pulls(find_poses(CAMERA, BOARDS[kind], found), truth))
            posed = find_poses(calibration.cameras["camera"], BOARDS[kind], found, *uncertain(calibration))
            solved.append(pulls(posed, truth))
            exact.append(exactness(posed))
        rest = " | ".join(f"{each:.1g}" for each in np.max(exact, axis=0))
        for name, each in (("known", known), ("solved", solved)):
            off, count = np.concatenate(each), seeds * VIEWS
            share = f"{(np.abs(off) < 3).mean():.1%} | {np.sqrt(np.mean(off**2)):.2f}"
            print(f"| {kind} | {name} | {len(off)} of {count} | {share} | {rest} |", flush=True)


def photographed(kind: str, rng: np.random.Generator) -> tuple[Detections, RigidTransform]:
    """What is found in photographs of a board, and its true poses in all of them."""
    board, grid = BOARDS[kind], CAMERA.intrinsics
    truth, drawn = spread_boards(rng, (CAMERA,), board, VIEWS, TILT_DEG), TEXELS.get(kind, (SHARP,))
    pictures = [together(CAMERA, [board], RigidTransform.concatenate([pose]), rng, NOISE, *drawn) for pose in truth]
    corners = [find_corners(picture, board, FINDERS.get(kind, "saddles")) for picture in pictures]
    places = [view for view, seen in enumerate(corners) if seen is not None]
    names = tuple(f"{view}.png" for view in places)
    shown = np.array([_from_the_true_end(corners[view], truth[view], board) for view in places])
    return Detections(names, shown, grid.width, grid.height, places=tuple(places)), truth


def _from_the_true_end(corners: np.ndarray, pose: RigidTransform, board: Board) -> np.ndarray:
    """A chessboard looks the same from its other end; the truth begins at one of the two."""
    true = CAMERA.project(pose.apply(board.corners))
    ends = (corners, corners[::-1]) if board.kind == "chessboard" else (corners,)
    return min(ends, key=lambda each: np.nanmedian(np.linalg.norm(each - true, axis=1)))


def uncertain(calibration: Calibration) -> tuple[tuple[str, ...], np.ndarray]:
    """Which of the camera's numbers were solved for, and their covariance."""
    return calibration.estimated["camera"], calibration.intrinsics_covariance["camera"]


def pulls(found: CameraPoses, truth: RigidTransform) -> np.ndarray:
    """The errors of six numbers of each pose in their own standard deviations, (photographs, 6)."""
    true = truth[list(found.places)]
    turn = (found.cam_from_board.rotation * true.rotation.inv()).as_rotvec()
    place = found.board_from_cam.translation - true.inv().translation
    return np.concatenate([place / found.place_sigma, turn / found.turn_sigma], axis=1)


def exactness(posed: CameraPoses) -> tuple[float, float, float, float]:
    """How far at most, in pixels: the mapping from OpenCV's and pycolmap's, and what camviz and pycolmap read back."""
    flat = Undistortion.of(posed.camera)
    uv = flat.target.grid()[::9, ::9]
    ours = np.stack([each[::9, ::9] for each in flat.maps], axis=-1)
    rays = Perspective().unproject(flat.target.from_pixels(uv)).reshape(-1, 3)
    with tempfile.TemporaryDirectory() as room:
        write_poses(Path(room), flat.pinhole, posed, list(posed.names), "images", None)
        mapped = opencvs(flat)[::9, ::9], pycolmaps(posed.camera, rays).reshape(uv.shape)
        read = ours_read(Path(room), flat.pinhole, posed), pycolmap_read(Path(room) / MODEL, flat.pinhole, posed)
    return (*(float(np.abs(each - ours).max()) for each in mapped), *read)


def opencvs(flat: Undistortion) -> np.ndarray:
    """Where OpenCV's map leads, (height, width, 2)."""
    grid = flat.target
    d = coefficients(flat.camera)[:5]
    maps = cv2.initUndistortRectifyMap(
        flat.camera.intrinsics.K, d, None, grid.K, (grid.width, grid.height), cv2.CV_32FC1
    )
    return np.stack(maps, axis=-1)


def coefficients(camera: Camera) -> np.ndarray:
    """k1, k2, p1, p2, k3, k4, k5, k6 of a lens of OpenCV's."""
    lens = camera.lens
    return np.array([getattr(lens, key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")])


def pycolmaps(camera: Camera, rays: np.ndarray) -> np.ndarray:
    """Where pycolmap's camera sees rays (n, 3); NaN without pycolmap."""
    if pycolmap is None:
        return np.full((len(rays), 2), np.nan)
    grid = camera.intrinsics
    d = coefficients(camera)
    params = [grid.fx, grid.fy, grid.cx + HALF, grid.cy + HALF, *d]
    theirs = pycolmap.Camera(model="FULL_OPENCV", width=grid.width, height=grid.height, params=params)
    return np.asarray(theirs.img_from_cam(rays)) - HALF


def ours_read(folder: Path, pinhole: Camera, posed: CameraPoses) -> float:
    """How far what camviz reads of transforms.json and of the COLMAP model is from what was written."""
    points = posed.board.corners + [0, 0, BEHIND_M]
    transforms, model = load(folder / TRANSFORMS).cameras, load(folder / MODEL).cameras
    off = 0.0
    for name, pose in zip(posed.names, posed.board_from_cam, strict=True):
        uv = pinhole.at(pose).project(points)
        for camera in (transforms[f"images/{name}"], model[name]):
            off = max(off, float(np.abs(camera.project(points) - uv).max()))
    return off


def pycolmap_read(model: Path, pinhole: Camera, posed: CameraPoses) -> float:
    """The same of what pycolmap reads of the model; NaN without pycolmap."""
    if pycolmap is None:
        return float("nan")
    points = posed.board.corners + [0, 0, BEHIND_M]
    images = {each.name: each for each in pycolmap.Reconstruction(model).images.values()}
    off = [
        images[name].camera.img_from_cam(images[name].cam_from_world() * points)
        - HALF
        - pinhole.at(pose).project(points)
        for name, pose in zip(posed.names, posed.board_from_cam, strict=True)
    ]
    return float(np.abs(off).max())


if __name__ == "__main__":
    words = sys.argv[1:]
    main(
        [word for word in words if word in BOARDS] or [*BOARDS],
        next((int(word) for word in words if word.isdigit()), 20),
    )
