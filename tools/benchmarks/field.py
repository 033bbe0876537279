"""How well cameras are calibrated from other people's pictures, beside OpenCV and mrcal, and what the clinic says.

    CAMVIZ_FIELD=~/field python tools/benchmarks/field.py             runs every set and prints a Markdown table
    CAMVIZ_FIELD=~/field python tools/benchmarks/field.py NAME …      runs these sets
    CAMVIZ_FIELD=~/field python tools/benchmarks/field.py --page      and writes the tables into docs/clinic.md
    CAMVIZ_FIELD=~/field python tools/benchmarks/field.py --hashes    prints the hash of every set

CAMVIZ_FIELD has a folder for each repository, named owner+name, at the commit that field.toml says. A set that is not
there, or has other files, is named and left out. The corners are found once, by camviz, kept in CAMVIZ_FIELD/found and
given to all three programs.

Every fifth view is held out, the others give the camera: five times, until each view was held out once. A held-out
view is posed by one half of its board, and the other half is predicted: left, right, top and bottom in turn. The
held-out error is the RMS distance of all these predictions from the corners, in pixels, the board flat for everyone.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from kernel import table

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration import calibrate, detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.cross_validation import board_halves
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, seen
from camviz_clinic.calibration.models import poses_from_rays
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.files import load
from camviz_clinic.files.corners import load_corners

MANIFEST = Path(__file__).with_name("field.toml")
PAGE = Path(__file__).parents[2] / "docs" / "clinic.md"
TABLE = "<!-- The tables below are printed by: python tools/benchmarks/field.py -->"
FOLDS = 5  # every so many views one is held out
MRCAL = {"standard": "LENSMODEL_OPENCV5", "rational": "LENSMODEL_OPENCV8"}
FLAGS = {"standard": 0, "rational": cv2.CALIB_RATIONAL_MODEL}
BEHIND = 1.02
LIMIT_S = 300


@dataclass(frozen=True)
class Set:
    """One camera's pictures, or its corners, as field.toml names them."""

    name: str
    repository: str
    commit: str
    path: str  # patterns inside the repository, with spaces between them
    licence: str
    board: str  # inner corners, 9x6
    square_mm: float  # what the repository says, else 25: it does not change the pixels
    models: list[str]
    sha256: str
    size: str = ""  # WxH of the pictures to use, where the folder has several
    corners: bool = False  # the files hold corners

    @property
    def files(self) -> list[Path]:
        """The files of the set, in order."""
        root = Path(os.environ["CAMVIZ_FIELD"], self.repository.replace("/", "+"))
        found = {path for pattern in self.path.split() for path in root.glob(pattern)}
        return sorted(found, key=lambda path: path.name)

    @property
    def hash(self) -> str:
        """SHA-256 of the lines "SHA-256 of a file, two spaces, its name", in order."""
        lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in self.files]
        return hashlib.sha256("".join(lines).encode()).hexdigest()

    def found(self) -> tuple[Detections, Board]:
        """The corners, from the files or from the pictures, and the board that they are of."""
        if self.corners:
            loaded = load_corners(self.files)
            return loaded.detections, loaded.board
        columns, rows = map(int, self.board.split("x"))
        board = Board(columns, rows, self.square_mm / 1000)
        kept = Path(os.environ["CAMVIZ_FIELD"], "found", f"{self.name}-{self.hash[:12]}-{self.board}.npz")
        if not kept.exists():
            paths = [path for path in self.files if not self.size or _size(path) == self.size]
            one = detect(paths, board, workers=1)
            kept.parent.mkdir(exist_ok=True)
            np.savez(kept, pictures=one.pictures, corners=one.corners, size=(one.width, one.height))
        with np.load(kept) as one:
            width, height = map(int, one["size"])
            return Detections(tuple(map(str, one["pictures"])), one["corners"], width, height), board


def _size(path: Path) -> str:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    return "" if image is None else f"{image.shape[1]}x{image.shape[0]}"


# The three programs: from corners to a camera -------------------------------------------------------------------------


def by_camviz(detections: Detections, board: Board, model: str) -> Camera:
    """`camviz calibrate` as it comes."""
    return calibrate(detections, board, model, board_warp="auto").cameras["camera"]


def by_opencv(detections: Detections, board: Board, model: str) -> Camera:
    """cv2.calibrateCamera or cv2.fisheye.calibrate as it comes, with the flags of its tutorial."""
    there, size = seen(detections.corners), (detections.width, detections.height)
    views = list(zip(detections.corners, there, strict=True))
    if model == "fisheye":
        points = [board.corners[mask].reshape(1, -1, 3) for _, mask in views]
        pixels = [corners[mask].reshape(1, -1, 2) for corners, mask in views]
        flags = sum(fisheye_flag(name) for name in ("RECOMPUTE_EXTRINSIC", "FIX_SKEW"))
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-9)
        _, K, D, *_ = cv2.fisheye.calibrate(
            points, pixels, size, np.eye(3), np.zeros(4), flags=flags, criteria=criteria
        )
        return Camera(Intrinsics.from_matrix(K, *size), KannalaBrandt(*np.ravel(D).tolist()))
    points = [board.corners[mask].astype(np.float32) for _, mask in views]
    pixels = [corners[mask].astype(np.float32) for corners, mask in views]
    _, K, D, *_ = cv2.calibrateCamera(points, pixels, size, None, None, flags=FLAGS[model])
    return Camera(Intrinsics.from_matrix(K, *size), BrownConrady.from_coefficients(np.ravel(D)))


def fisheye_flag(name: str) -> int:
    """A flag of the fisheye module, which OpenCV 5 keeps among the others."""
    return int(getattr(cv2.fisheye, f"CALIB_{name}", getattr(cv2, f"CALIB_{name}", 0)))


@contextmanager
def solved_by_mrcal(detections: Detections, board: Board, model: str) -> Iterator[Path]:
    """The file of mrcal-calibrate-cameras as it comes, from OpenCV's focal length; gone when the block is left."""
    focal = by_opencv(detections, board, "standard").intrinsics.fx
    rows = ["# filename x y level"]
    for view, corners in enumerate(detections.corners):
        rows += [f"view{view:04d}.png " + (f"{u} {v} 0" if np.isfinite(u) else "0 0 -") for u, v in corners]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "corners.vnl").write_text("\n".join(rows) + "\n", encoding="utf-8")
        command = f"mrcal-calibrate-cameras --corners-cache corners.vnl --lensmodel {MRCAL[model]} --focal {focal} "
        command += f"--object-spacing {board.square_size} --object-width-n {board.columns} "
        command += f"--object-height-n {board.rows} --imagersize {detections.width} {detections.height} view*.png"
        subprocess.run(command.split(), cwd=folder, capture_output=True, check=True, timeout=LIMIT_S)
        yield Path(folder, "camera-0.cameramodel")


def by_mrcal(detections: Detections, board: Board, model: str) -> Camera:
    """It has no Kannala–Brandt lens."""
    if model not in MRCAL or not shutil.which("mrcal-calibrate-cameras"):
        raise NotImplementedError
    with solved_by_mrcal(detections, board, model) as path:
        return next(iter(load(path).cameras.values()))


PROGRAMS: dict[str, Callable[[Detections, Board, str], Camera]] = {
    "camviz": by_camviz,
    "OpenCV": by_opencv,
    "mrcal": by_mrcal,
}
FAILURES = (CannotCalibrate, ValueError, cv2.error, subprocess.SubprocessError, np.linalg.LinAlgError)


# The held-out error ---------------------------------------------------------------------------------------------------


def split(detections: Detections, first: int) -> tuple[Detections, Detections]:
    """The views to solve from, and those that are held out: the `first`, counted from 0, and every fifth after it."""
    out = np.arange(len(detections.corners)) % FOLDS == first
    return _only(detections, ~out), _only(detections, out)


def _only(detections: Detections, views: np.ndarray) -> Detections:
    names = tuple(name for name, use in zip(detections.pictures, views, strict=True) if use)
    return replace(detections, pictures=names, corners=detections.corners[views], skipped=(), places=())


def held_out_squares(camera: Camera, detections: Detections, board: Board) -> np.ndarray:
    """The squared errors (n,) in px² of corners that a pose was not fitted to; infinite where one has no image."""
    there, alone = seen(detections.corners), Camera(camera.intrinsics, camera.lens)
    squares = []
    for corners, mask in zip(detections.corners, there, strict=True):
        for half in board_halves(board):
            fit, asked = mask & half, mask & ~half
            if fit.sum() < 6 or not asked.any() or _in_line(board.corners[fit]):
                continue
            pose = poses_from_rays(alone, [board.corners[fit]], [corners[fit]])
            aside = {"camera": (mask & ~fit)[None]}
            problem = Adjustment(board, {"camera": alone}, {"camera": corners[None]}, pose, {"camera": ()}, aside)
            off = problem.refined(only_poses=True).residuals["camera"][0][asked]
            squares.append(np.sum(np.nan_to_num(off, nan=np.inf) ** 2, axis=-1))
    return np.concatenate(squares)


def _in_line(points: np.ndarray) -> bool:
    """Whether points (n, 3) lie on one line, which gives no pose."""
    return bool(np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-9) < 2)


def scored(solve: Callable[..., Camera], detections: Detections, board: Board, model: str) -> tuple[str, float]:
    """The held-out error over all folds and the seconds of a solution, as a cell, and the error as a number."""
    squares, took = [], 0.0
    try:
        for first in range(FOLDS):
            seen_by_all, asked = split(detections, first)
            start = time.perf_counter()
            camera = solve(seen_by_all, board, model)
            took += (time.perf_counter() - start) / FOLDS
            squares.append(held_out_squares(camera, asked, board))
    except NotImplementedError:
        return "–", np.inf
    except FAILURES as failure:
        print(f"  {solve.__name__} {model}: {str(failure)[:200]}", file=sys.stderr)
        return "fails", np.inf
    error = float(np.sqrt(np.mean(np.concatenate(squares))))
    return f"{error:.3f} ({took:.1f} s)", error


def said(detections: Detections, board: Board, model: str) -> str:
    """What the clinic finds in camviz's calibration from all views: the ids, worst first, and notes by their number."""
    try:
        findings = Inspection.of(Evidence(calibrate(detections, board, model))).findings
    except FAILURES as failure:
        return f"no calibration: {str(failure).split(':')[0]}"
    worse = Counter(f"`{each.id}` ({each.severity})" for each in findings if each.severity != "note")
    for each in findings:
        print(f"  {each.severity} {each.id}: {each.sentence}", file=sys.stderr)
    notes = sum(each.severity == "note" for each in findings)
    told = [f"{id} × {count}" if count > 1 else id for id, count in worse.items()]
    return ", ".join([*told, *([f"notes: {notes}"] if notes else [])]) or "none"


def rows(one: Set) -> list[list[str]]:
    """The lines of a set in the table, one for each model."""
    try:
        detections, board = one.found()
    except FAILURES as failure:
        print(f"{one.name}: {failure}", file=sys.stderr, flush=True)
        return [[one.name, "none found", "", *[""] * len(PROGRAMS), "", str(failure)]]
    lines = []
    for model in one.models:
        cells, errors = zip(*(scored(solve, detections, board, model) for solve in PROGRAMS.values()), strict=True)
        best = min(errors[1:])
        ratio = errors[0] / best if np.isfinite(best) else 0.0
        verdict = f"{100 * (ratio - 1):+.1f} %" if ratio and np.isfinite(ratio) else "–"
        mark = f"**{verdict}**" if ratio > BEHIND else verdict
        views = f"{len(detections.corners)}, {detections.width} × {detections.height}"
        lines.append([one.name, views, model, *cells, mark, said(detections, board, model)])
        print(f"{' | '.join(lines[-1])}", file=sys.stderr, flush=True)
    return lines


def sets() -> list[Set]:
    """All sets of the manifest."""
    return [Set(**each) for each in tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["set"]]


def main(arguments: list[str]) -> None:
    """Run what is there."""
    cv2.setNumThreads(1)
    names = {each for each in arguments if not each.startswith("-")}
    chosen = [one for one in sets() if not names or one.name in names]
    lines = []
    for one in chosen:
        if not one.files:
            print(f"{one.name}: not there", file=sys.stderr)
        elif "--hashes" in arguments:
            print(one.name, len(one.files), one.hash)
        elif one.hash != one.sha256:
            print(f"{one.name}: left out, its files have the hash {one.hash}, not {one.sha256}", file=sys.stderr)
        else:
            lines += rows(one)
    if lines:
        head = ["set", "views, pixels", "model", *PROGRAMS, "against the better one", "what the clinic finds"]
        sources = [[one.name, f"{one.repository}, `{one.path}`", one.licence] for one in chosen]
        text = f"{table(head, lines)}\n\n{table(['set', 'from', 'licence'], sources)}\n"
        print(text)
        if "--page" in arguments:
            before = PAGE.read_text(encoding="utf-8").split(TABLE)[0]
            PAGE.write_text(f"{before}{TABLE}\n\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
