"""How much more the frames say that `camviz calibrate film.mp4` chooses than as many that are equally spaced.

python tools/benchmarks/films.py               films of every kind, rendered with known truth: 15 and 30 frames
python tools/benchmarks/films.py rests 15      some of the kinds, so many frames
python tools/benchmarks/films.py real 8 15 30  real ones, in CAMVIZ_FIELD: of mprib/caliscope (BSD-2-Clause, commit
                                               ddda95b4) the folders of REAL in tests/sessions

Equally spaced are frames among those that show the board, from six beginnings; their mean is told, and behind a stroke
how far the six are from each other: the least and the largest of them. σ is of a far point's pixel, on average where
the film shows the board: by the scatter of the views, as it is printed, and by corners' noise alone. Of real films the
error is told in place of the truth: every third view that shows the board is held out, three times, and the frames are
chosen among the others (`field.held_out_squares`); the last number is that of all of these.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from field import FAILURES, held_out_squares

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import Board, Detections, calibrate, detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.uncertainty import projection_uncertainty
from camviz_clinic.films import Film, chosen_frames
from camviz_clinic.films.choosing import most_telling
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
SESSIONS = "mprib+caliscope/tests/sessions"
REAL = (
    "prerecorded_calibration/calibration/intrinsic",
    "charuco_calibration/calibration/extrinsic",
    "post_optimization/calibration/extrinsic",
)
CHARUCO = Board(3, 4, 0.054, marker_size=0.75 * 0.054, dictionary="DICT_4X4_1000")
GRID = (40, 24)  # pixels over a picture in which σ is asked for
FINDER = {"finder": "classic", "workers": 1}
SEED, OFFSETS = 90_000, np.arange(6) / 6
FOLDS = 3  # every so many views one is held out


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
        for folder in REAL:
            for path in sorted(Path(os.environ["CAMVIZ_FIELD"], SESSIONS, folder).glob("cam_*.mp4")):
                rows(f"{folder.split('/')[0]}, {path.stem}", path, CHARUCO, counts)


def rows(kind: str, path: Path, board: Board, counts: list[int]) -> None:
    """A row for each number of frames."""
    with Film(path) as film:
        every = [find_corners(frame.gray, board, FINDER["finder"]) for frame in film.frames()]
    corners = np.array([each for each in every if each is not None]).reshape(-1, len(board.corners), 2)
    if len(corners) <= min(counts):
        print(f"| {kind} | {len(corners)} of {len(every)} show the board |", flush=True)
        return
    names = tuple(f"{place}.png" for place in range(len(corners)))
    shown = Detections(names, corners, film.width, film.height)
    for count in counts:
        if count < len(corners):
            print(row(kind, path, board, shown, count), flush=True)


def row(kind: str, path: Path, board: Board, shown: Detections, count: int) -> str:
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as room:
        chosen = chosen_frames([{"camera": path}], room, board, count, search=FINDER)
        taken = time.perf_counter() - started
        ours = solved(detect(chosen.pictures["camera"], board, **FINDER), board)
    equal = [solved(each, board) for each in spaced(shown, count)]
    uv = pixels(shown)
    printed, by_corners = (
        np.array([projection_uncertainty(of(each), uv) for each in (ours, *equal)])
        for of in (lambda each: each, lambda each: each.by_corners)
    )
    known = np.isfinite(printed).all(axis=0)  # a bad solution has no rays at the border
    cells = [ratio(each[:, known].mean(axis=1)) for each in (printed, by_corners)]
    each_parameter = np.array([np.sqrt(np.diag(each.corner_covariance)) for each in (ours, *equal)])
    most = (each_parameter[0] / each_parameter[1:].mean(axis=0)).max()
    if board is CHARUCO:
        last = held_out(shown, board, count)
    else:
        last = ratio(np.array([off(each.cameras["camera"], uv) for each in (ours, *equal)]))
    return (
        f"| {kind} | {count} of {len(shown.corners)}, {taken:.0f} s | {cells[0]} | {cells[1]} | {most:.2f} | {last} |"
    )


def spaced(shown: Detections, count: int) -> list[Detections]:
    """So many views at equal distances, from several beginnings."""
    step = len(shown.corners) / count
    return [shown.only(((np.arange(count) + offset) * step).astype(int)) for offset in OFFSETS]


def ratio(values: np.ndarray) -> str:
    """The first of the values over the mean of the others, and the least and the largest of these over it."""
    mean = values[1:].mean()
    return f"{values[0] / mean:.2f} / {values[1:].min() / mean:.2f}–{values[1:].max() / mean:.2f}"


def held_out(shown: Detections, board: Board, count: int) -> str:
    """The error in pixels of views that were held out: by the chosen ones, by equally spaced ones, by all."""
    views = np.arange(len(shown.corners))

    def error(chosen: Callable[[Detections], Detections]) -> float:
        squares = []
        for fold in range(FOLDS):
            kept, out = shown.only(views[views % FOLDS != fold]), shown.only(views[views % FOLDS == fold])
            camera = solved(chosen(replace(kept, places=())), board).cameras["camera"]
            squares.append(held_out_squares(camera, out, board))
        return float(np.sqrt(np.mean(np.concatenate(squares))))

    if count >= min((views % FOLDS != fold).sum() for fold in range(FOLDS)):
        return "–"
    try:
        ours = error(lambda kept: kept.only(most_telling({"camera": kept}, board, "standard", count)))
        equal = [error(lambda kept, at=at: spaced(kept, count)[at]) for at in range(len(OFFSETS))]
        return f"{ours:.3f} / {np.mean(equal):.3f} ({min(equal):.3f}–{max(equal):.3f}) / {error(lambda kept: kept):.3f}"
    except FAILURES as failure:
        return f"fails: {failure}"


def solved(found: Detections, board: Board) -> Adjustment:
    return Adjustment.of(calibrate(replace(found, skipped=()), board), "camera")


def pixels(shown: Detections) -> np.ndarray:
    """Pixels (n, 2) of a grid over the picture, those between corners that any frame of the film shows."""
    corners = shown.corners[np.isfinite(shown.corners).all(axis=-1)].astype(np.float32)
    hull = cv2.convexHull(corners)
    uv = pixel_grid(Intrinsics.from_fov(shown.width, shown.height, 60), GRID).reshape(-1, 2)
    return uv[[cv2.pointPolygonTest(hull, tuple(map(float, pixel)), False) >= 0 for pixel in uv]]


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
