"""How well a rolling shutter is found from films: `python tools/benchmarks/rolling_shutter.py [SEEDS] [--films]`.

Corners with 0.15 px of noise are simulated for films of a board of 9×6 corners, 30 frames a second, carried
smoothly at several speeds before a camera with several read-out times. Told are the median and the largest error of fx
and of the line delay, how often the truth lies within 1.96 σ, how often the film is offered a rolling shutter, and the
median error of fx of the solution that takes all rows for one moment. With --films the frames are rendered, each row at
the pose of its own time, written as a film, and their corners detected.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz_clinic.calibration import Board, CannotCalibrate, Detections, calibrate, detect
from camviz_clinic.calibration.detection import seen
from camviz_clinic.calibration.rolling_solving import Filmed, refuse_unless_by_rows, solved_film
from camviz_clinic.films.bursts import bursts
from camviz_clinic.films.virtual import SmoothTake, take, write_film
from camviz_clinic.rigs.start import MOST_ALONE, varied

BOARD = Board(9, 6, 0.03)
CAMERA = Camera(Intrinsics(640, 480, 544, 546, 325, 233), BrownConrady(-0.12, 0.06, 3e-4, -2e-4))
RATE, NOISE = 30.0, 0.15
CASES = ((0.02, 0.4, 4), (0.02, 0.7, 4), (0.02, 1.4, 4), (0.005, 0.7, 4), (0.0, 0.7, 4))  # seconds: read-out, way, film
FILMS = ((0.02, 0.7, 4), (0.005, 0.7, 4), (0.005, 1.4, 4), (0.005, 1.4, 16), (0.0, 0.7, 4))


@dataclass(frozen=True)
class Outcome:
    """Errors and σ as shares of the truth, but of a delay of 0 in µs."""

    shear: float
    globally: float
    focal: float
    focal_sigma: float
    delay: float
    delay_sigma: float
    offered: bool


def carried(seed: int, readout_s: float, way_s: float, film_s: float) -> SmoothTake:
    """A board carried as long as the film; at its stops all of it is in the picture."""
    rng = np.random.default_rng(seed)
    stops = int(film_s / (0.6 * way_s)) + 2
    return SmoothTake(**vars(take(rng, CAMERA, BOARD, stops, rest_s=0, way_s=way_s, rate=RATE, readout_s=readout_s)))


def simulated(path: SmoothTake, seed: int, frames: int) -> tuple[Detections, Array]:
    """The frames that show at least a dozen corners, with noise."""
    times = np.arange(frames) / RATE
    corners = path.corners(times)
    corners += np.random.default_rng(1000 + seed).normal(0, NOISE, corners.shape)
    shown = np.flatnonzero(seen(corners).sum(axis=1) >= 12)
    return Detections(tuple(f"{frame:06}" for frame in shown), corners[shown], 640, 480), times[shown]


def rendered(path: SmoothTake, seed: int, frames: int) -> tuple[Detections, Array]:
    """The film itself, written and read back."""
    with tempfile.TemporaryDirectory() as room:
        film = Path(room) / "film.avi"
        write_film(film, replace(path, leave_s=path.leave_s, stops=path.stops), np.random.default_rng(1000 + seed))
        taken = bursts(film, Path(room), frames)
        found = detect(taken.pictures, BOARD, finder="saddles")  # as `camviz calibrate` does
    times = dict(zip((each.name for each in taken.pictures), taken.times_s, strict=True))
    return found, np.array([times[picture] for picture in found.pictures])


def outcome(seed: int, readout_s: float, way_s: float, film_s: float, film: bool) -> Outcome | None:
    """None where the film cannot be solved."""
    path = carried(seed, readout_s, way_s, film_s)
    found, times = (rendered if film else simulated)(path, seed, round(film_s * RATE))
    few = varied(found.corners, MOST_ALONE)
    some = replace(found, pictures=tuple(found.pictures[i] for i in few), corners=found.corners[few], places=())
    moved = path.corners(times + readout_s / 2) - path.corners(times - readout_s / 2)
    try:
        start = calibrate(some, BOARD, fixed=("k3",), robust=False)
        solved, _ = solved_film(start, Filmed(found, times, BOARD))
    except CannotCalibrate:
        return None
    try:
        refuse_unless_by_rows(solved)
        offered = True
    except CannotCalibrate:
        offered = False
    fx, scale = CAMERA.intrinsics.fx, readout_s / 480 or 1e-6
    return Outcome(
        float(np.sqrt(np.nanmean(np.sum(moved**2, axis=-1)))),
        start.cameras["camera"].intrinsics.fx / fx - 1,
        solved.camera.intrinsics.fx / fx - 1,
        solved.deviation("fx") / fx,
        (solved.line_delay - readout_s / 480) / scale,
        solved.deviation("line_delay") / scale,
        offered,
    )


def row(readout_s: float, way_s: float, film_s: float, seeds: int, film: bool) -> str:
    """A line of the table."""
    all_of_them = [outcome(seed, readout_s, way_s, film_s, film) for seed in range(seeds)]
    good = [each for each in all_of_them if each is not None]
    of = {name: np.abs([getattr(each, name) for each in good]) for name in Outcome.__annotations__}
    unit, scale = ("%", 100) if readout_s else ("µs", 1)
    within = [np.mean(of[name] < 1.96 * of[f"{name}_sigma"]) for name in ("focal", "delay")]
    cells = [
        f"{1e6 * readout_s / 480:.1f}",
        f"{seeds} of {film_s} s",
        f"{np.median(of['shear']):.1f} px",
        f"{100 * np.median(of['globally']):.2f} %",
        f"{100 * np.median(of['focal']):.3f} % ({100 * of['focal'].max():.2f} %)",
        f"{scale * np.median(of['delay']):.2f} {unit} ({scale * of['delay'].max():.2f} {unit})",
        f"{within[0]:.0%}, {within[1]:.0%}",
        f"{int(of['offered'].sum())} of {seeds}",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("seeds", nargs="?", type=int, default=20)
    words.add_argument("--films", action="store_true")
    given = words.parse_args()
    names = "µs from row to row", "films", "shear", "fx, all rows at once", "fx (worst)", "delay (worst)"
    print(f"| {' | '.join(names)} | within 1.96 σ: fx, delay | offered |")
    print("|---|---|---|---|---|---|---|---|")
    for case in FILMS if given.films else CASES:
        print(row(*case, given.seeds, given.films), flush=True)


if __name__ == "__main__":
    main()
