"""How long calibrating and judging a calibration take, beside mrcal where it is installed, and how both grow.

    python tools/benchmarks/calibration.py

The 13 left*.jpg of OpenCV's samples come from CAMVIZ_SAMPLES. mrcal gets the corners that camviz found: its own finder,
mrgingham, looks for other boards. Prints the tables of docs/performance.md. Absolute times belong to one machine; the
ratios within one run travel.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from kernel import median_ms, table
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import calibrate, detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.types import Board
from camviz_clinic.calibration.uncertainty import projection_uncertainty

BOARD = Board(9, 6, 0.025)
GRID = (60, 40)
VIEWS = (125, 250, 500)
PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
MRCAL = """
import sys, time, mrcal, numpy as np
model = mrcal.cameramodel(sys.argv[1])
rays = mrcal.unproject(mrcal.sample_imager(60, 40, 640, 480), *model.intrinsics(), normalize=True)
work = lambda: mrcal.projection_uncertainty(rays, model, atinfinity=True, what="worstdirection-stdev")
work()
start = time.perf_counter()
work()
print((time.perf_counter() - start) * 1000)
"""


def photographs() -> list[list[str]]:
    """Detecting, calibrating and the uncertainty map for 13 photographs, in milliseconds."""
    paths = sorted(Path(os.environ["CAMVIZ_SAMPLES"], "opencv-samples").glob("left??.jpg"))
    detections = detect(paths, BOARD)
    calibration = calibrate(detections, BOARD)
    adjustment = Adjustment.of(calibration).refined()
    uv = pixel_grid(adjustment.cameras["camera"].intrinsics, GRID)
    mrcal_solve, mrcal_map = mrcal_ms(detections.corners)
    steps = {
        "find the corners": (lambda: detect(paths, BOARD), "–"),
        "calibrate": (lambda: calibrate(detections, BOARD), mrcal_solve),
        "least squares anew, and σ and covariance": (lambda: Adjustment.of(calibration).refined().covariance, "–"),
        "uncertainty, 60 × 40 pixels": (lambda: projection_uncertainty(Adjustment.of(calibration), uv), mrcal_map),
    }
    return [[name, f"{median_ms(work, 5):.1f}", other] for name, (work, other) in steps.items()]


def mrcal_ms(corners: np.ndarray) -> tuple[str, str]:
    """mrcal's time for the same corners: its calibration command as a whole, and its uncertainty map by itself."""
    python = shutil.which("python3", path="/usr/bin")
    if not shutil.which("mrcal-calibrate-cameras") or not python:
        return "not installed", "not installed"
    with tempfile.TemporaryDirectory() as folder:
        rows = [f"left{view:02d}.jpg {u} {v} 0" for view, uv in enumerate(corners) for u, v in uv]
        Path(folder, "corners.vnl").write_text("\n".join(["# filename x y level", *rows]) + "\n", encoding="utf-8")
        command = "mrcal-calibrate-cameras --corners-cache corners.vnl --lensmodel LENSMODEL_OPENCV5 --focal 530 "
        command += "--object-spacing 0.025 --object-width-n 9 --object-height-n 6 --imagersize 640 480 left??.jpg"
        run = lambda: subprocess.run(command.split(), cwd=folder, capture_output=True, check=True)  # noqa: E731
        solve = median_ms(run, 3)
        arguments = [python, "-c", MRCAL, str(Path(folder, "camera-0.cameramodel"))]
        done = subprocess.run(arguments, capture_output=True, check=True, text=True)
    return f"{solve:.1f} (the whole command)", f"{float(done.stdout):.1f}"


def synthetic(views: int) -> Adjustment:
    """A camera before `views` boards of 54 corners, with noise of 0.2 px, at the truth: the start of a solution."""
    rng = np.random.default_rng(0)
    camera = Camera(Intrinsics(640, 480, 530, 532, 325, 236), BrownConrady(-0.28, 0.1, 1e-3, -5e-4, 0.02))
    turns = Rotation.from_rotvec(rng.uniform(-1, 1, (views, 3)) * [0.6, 0.6, 0.3])
    middles = camera.unproject(rng.uniform([150, 120], [490, 360], (views, 2))) * rng.uniform(0.3, 0.5, (views, 1))
    poses = RigidTransform.from_components(middles - turns.apply(BOARD.corners.mean(axis=0)), turns)
    uv = camera.project(moved(poses, BOARD.corners))
    uv += rng.normal(0, 0.2, uv.shape)
    return Adjustment(BOARD, {"camera": camera}, {"camera": uv}, poses, {"camera": PARAMETERS})


def grown(views: int) -> list[str]:
    """Seconds to solve `views` views from the truth, and for its uncertainty map; called in a process of its own."""
    problem = synthetic(views)
    uv = pixel_grid(problem.cameras["camera"].intrinsics, GRID)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    start = time.perf_counter()
    solved = problem.refined()
    middle = time.perf_counter()
    projection_uncertainty(solved, uv)
    end = time.perf_counter()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    corners = problem.measurements // 2
    return [
        f"{views}",
        f"{corners}",
        f"{middle - start:.2f}",
        f"{end - middle:.2f}",
        f"{peak:.0f}",
        f"{peak - before:.0f}",
    ]


def main() -> None:
    print(table(["13 photographs", "camviz, ms", "mrcal, ms"], photographs()), flush=True)
    rows = []
    for views in VIEWS:
        done = subprocess.run([sys.executable, __file__, str(views)], capture_output=True, check=True, text=True)
        rows.append(done.stdout.strip().split("\t"))
    print(table(["views", "corners", "solve, s", "uncertainty, s", "peak, MB", "of it for this, MB"], rows))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(*grown(int(sys.argv[1])), sep="\t")
    else:
        main()
