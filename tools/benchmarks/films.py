"""How much more the frames say that `camviz calibrate film.mp4` chooses than as many that are equally spaced.

python tools/benchmarks/films.py               films of every kind, rendered with known truth: 15 and 30 frames
python tools/benchmarks/films.py rests 15      some of the kinds, so many frames
python tools/benchmarks/films.py real          real ones, in CAMVIZ_FIELD: of mprib/caliscope (BSD-2-Clause, commit
                                               ddda95b4) tests/sessions/prerecorded_calibration

Equally spaced are frames among those that show the board, from three beginnings; their mean is told. σ is of a far
point's pixel, on average over the picture: by the scatter of the views, as it is printed, and by corners' noise alone.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import Board, Detections, calibrate, detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.uncertainty import projection_uncertainty
from camviz_clinic.films import Film, chosen_frames
from camviz_clinic.films.virtual import take, write_film

BOARD = Board(9, 6, 0.025)
CAMERA = Camera(Intrinsics(400, 300, 331, 332, 201, 149), BrownConrady(-0.2, 0.05, 3e-4, -2e-4))
KINDS = {
    "rests": {},
    "never rests": {"rest_s": 0.0, "way_s": 1.0},
    "mostly in the middle": {"window": 0.5},
    "rolling shutter": {"readout_s": 0.02},
    "long exposure": {"exposure_s": 0.04},
    "few places": {"stops": 8, "rest_s": 1.0},
}
REAL = "mprib+caliscope/tests/sessions/prerecorded_calibration/calibration/intrinsic"
CHARUCO = Board(3, 4, 0.054, marker_size=0.75 * 0.054, dictionary="DICT_4X4_1000")
FINDER = {"finder": "classic", "workers": 1}
SEED, OFFSETS = 90_000, (0.0, 0.33, 0.66)


def main(kinds: list[str], counts: list[int]) -> None:
    print("| film | frames | σ chosen / equal, printed | by corners | of any parameter, at most | off chosen / equal |")
    print("|---|---|---|---|---|---|")
    for place, kind in enumerate(KINDS):
        if kind in kinds:
            rng = np.random.default_rng([SEED, place])
            with tempfile.TemporaryDirectory() as room:
                path = Path(room) / "film.avi"
                write_film(path, take(rng, CAMERA, BOARD, **{"stops": 16, "rate": 10.0, **KINDS[kind]}), rng)
                rows(kind, path, BOARD, counts)
    if "real" in kinds:
        for path in sorted(Path(os.environ["CAMVIZ_FIELD"], REAL).glob("cam_*.mp4")):
            rows(f"real, {path.stem}", path, CHARUCO, counts)


def rows(kind: str, path: Path, board: Board, counts: list[int]) -> None:
    """A row for each number of frames."""
    with Film(path) as film:
        every = [find_corners(frame.gray, board, FINDER["finder"]) for frame in film.frames()]
        shape = next(film.frames()).gray.shape
    shown = np.array([corners for corners in every if corners is not None])
    for count in counts:
        print(row(kind, path, board, Detections((), shown, *shape[::-1]), count), flush=True)


def row(kind: str, path: Path, board: Board, shown: Detections, count: int) -> str:
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as room:
        chosen = chosen_frames([{"camera": path}], room, board, count, search=FINDER)
        taken = time.perf_counter() - started
        ours = measured(detect(chosen.pictures["camera"], board, **FINDER), board)
    every = len(shown.corners)
    spaced = [(np.arange(count) + offset) * every / count for offset in OFFSETS]
    equal = [measured(only(shown, places.astype(int)), board) for places in spaced]
    printed, corners, off = (ours[i] / np.mean([each[i] for each in equal]) for i in range(3))
    most = (ours[3] / np.mean([each[3] for each in equal], axis=0)).max()
    wrong = "not known" if board is CHARUCO else f"{off:.2f}"
    return f"| {kind} | {count} of {every}, {taken:.0f} s | {printed:.2f} | {corners:.2f} | {most:.2f} | {wrong} |"


def only(shown: Detections, places: np.ndarray) -> Detections:
    return replace(shown, pictures=tuple(f"{place}.png" for place in places), corners=shown.corners[places])


def measured(found: Detections, board: Board) -> tuple[float, float, float, np.ndarray]:
    """σ of a pixel as printed and by corners alone, how far it is off after the best turn, σ of each parameter."""
    problem = Adjustment.of(calibrate(replace(found, skipped=()), board), "camera")
    camera = problem.cameras["camera"]
    uv = pixel_grid(camera.intrinsics, (12, 9)).reshape(-1, 2)
    printed, corners = (float(np.nanmean(projection_uncertainty(each, uv))) for each in (problem, problem.by_corners))
    return printed, corners, off(camera, uv), np.sqrt(np.diag(problem.corner_covariance))


def off(camera: Camera, uv: np.ndarray) -> float:
    """How far pixels are off, RMS: the camera turned so that its rays agree with the true ones best."""
    from scipy.spatial.transform import Rotation

    true, found = (each.lens.unproject(each.intrinsics.from_pixels(uv)) for each in (CAMERA, camera))
    rays = np.isfinite(true).all(axis=1) & np.isfinite(found).all(axis=1)  # a bad solution has none at the border
    turn, _ = Rotation.align_vectors(found[rays], true[rays])
    again = camera.intrinsics.to_pixels(camera.lens.project(turn.apply(true)))
    return float(np.sqrt(np.nanmean(np.sum((again - uv) ** 2, axis=-1))))


if __name__ == "__main__":
    words = sys.argv[1:]
    main(
        [word for word in words if word in (*KINDS, "real")] or [*KINDS],
        [int(word) for word in words if word.isdigit()] or [15, 30],
    )
