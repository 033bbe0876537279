"""How often a ± holds: 95 % intervals of intrinsics against other views of the same camera, and against the truth.

    python tools/benchmarks/intervals.py               all sets that are there, as two Markdown tables
    python tools/benchmarks/intervals.py NAME …        these sets of field.toml
    python tools/benchmarks/intervals.py --page        and writes the tables into docs/clinic.md
    python tools/benchmarks/intervals.py --virtual     the virtual sets alone
    … --few                                            fewer halves and sets, for a look

CAMVIZ_FIELD names the folder of the pictures. They are the sets of field.toml with 20 views or more, and OpenCV's
left and right ones of 13. Their views are halved by lot, and each program calibrates both halves by itself, from the
same corners. The two halves share no view, and the variance of their difference is the sum of both variances. So
(difference) / √(σ₁² + σ₂²) is 1 in the RMS, within 1 in 68 % and within 1.96 in 95 % of all halves and parameters, if
a σ is right. Halves do not show what is wrong in the same way in all views, such as a bend of the board. Virtual sets
have a truth, and show it: they are held against it, and halved as well. "Board flat" is camviz with --board-warp off.
"Nothing named" are the sets of which `camviz inspect` says nothing worse than a note.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from field import FAILURES, LIMIT_S, MRCAL, PAGE, Set, sets, solved_by_mrcal
from kernel import table

from camviz_clinic import inspect
from camviz_clinic.calibration import calibrate
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.detection import Detections, seen
from camviz_clinic.calibration.jacobian import parameter
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.view_by_view import ViewByView
from camviz_clinic.checks.virtual import SetUp, detections, single

HEAD = "<!-- The tables below are printed by: python tools/benchmarks/intervals.py -->"
TAIL = "<!-- The tables above are printed by: python tools/benchmarks/intervals.py -->"
HALVES, FEWER = 20, 6
OF_MRCAL = 8  # of the halves; it takes seconds to start
VIRTUAL, SOME = 100, 12
ENOUGH = 20
SMALL = ("opencv-left", "opencv-right")
STANDARD = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
SEED = 50_000

Told = tuple[np.ndarray, np.ndarray]  # the values of the intrinsics, and their σ
Rng = np.random.Generator


# Every program: from corners to values and their σ -----------------------------------------------------------------


def by_camviz(views: Detections, board: Board, model: str) -> dict[str, Told]:
    """`camviz calibrate` as it comes, with its σ; with that of the corners alone; and with that times Birge's ratio."""
    return told_by(Adjustment.of(calibrate(views, board, model, board_warp="auto")))


def told_by(solved: Adjustment) -> dict[str, Told]:
    """The values of a solution, with the three σ."""
    values, place = solved.intrinsics("camera"), solved.intrinsics_of("camera")  # without the board's bend
    clustered, corners = (np.sqrt(np.diag(each))[place] for each in (solved.covariance, solved.corner_covariance))
    scattered = corners * np.sqrt(ViewByView.of(solved).scatter)
    return {"camviz": (values, clustered), "corners alone": (values, corners), "× scatter": (values, scattered)}


def by_opencv_extended(views: Detections, board: Board, model: str) -> dict[str, Told]:
    """cv2.calibrateCameraExtended, and its stdDeviationsIntrinsics; OpenCV has none for a fisheye."""
    if model == "fisheye":
        return {}
    there = seen(views.corners)
    points = [board.corners[mask].astype(np.float32) for mask in there]
    pixels = [corners[mask].astype(np.float32) for corners, mask in zip(views.corners, there, strict=True)]
    size = (views.width, views.height)
    _, K, D, _, _, deviations, *_ = cv2.calibrateCameraExtended(points, pixels, size, None, None)
    return {"OpenCV": (np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *np.ravel(D)[:5]]), np.ravel(deviations)[:9])}


LIVE = """
import json, sys, mrcal, numpy as np
model = mrcal.cameramodel(sys.argv[1])
inputs = model.optimization_inputs()
_, residuals, J, factorization = mrcal.optimizer_callback(**inputs)
scale = np.ones(J.shape[1])
mrcal.unpack_state(scale, **inputs)
start = mrcal.state_index_intrinsics(0, **inputs)
rows = np.eye(9, len(scale), start) * scale
by_corner = J[: mrcal.num_measurements_boards(**inputs)] @ factorization.solve_xt_JtJ_bt(rows).T
sigma = np.std(mrcal.residuals_chessboard(inputs, residuals=residuals))
print(json.dumps([model.intrinsics()[1].tolist(), (sigma * np.linalg.norm(by_corner, axis=0)).tolist()]))
"""


@cache
def mrcal_python() -> str | None:
    """A Python that has mrcal, where there is one beside mrcal's own command."""
    python = shutil.which("python3", path="/usr/bin")
    if python is None or not shutil.which("mrcal-calibrate-cameras"):
        return None
    return None if subprocess.run([python, "-c", "import mrcal"], check=False).returncode else python


def by_mrcal(views: Detections, board: Board, model: str) -> dict[str, Told]:
    """mrcal-calibrate-cameras as it comes, with the σ of its own J and noise; it has no Kannala–Brandt lens."""
    python = mrcal_python()
    if model not in MRCAL or python is None:
        return {}
    with solved_by_mrcal(views, board, model) as path:
        live = [python, "-c", LIVE, str(path)]
        done = subprocess.run(live, capture_output=True, check=True, text=True, timeout=LIMIT_S)
    values, deviations = np.array(json.loads(done.stdout))
    return {"mrcal": (values, deviations)}


PROGRAMS: tuple[Callable[[Detections, Board, str], dict[str, Told]], ...] = (by_camviz, by_opencv_extended, by_mrcal)
COLUMNS = ("camviz", "corners alone", "× scatter", "OpenCV", "mrcal")


# Sets of pictures -----------------------------------------------------------------------------------------------------


def halved(views: Detections, board: Board, model: str, count: int) -> dict[str, list[np.ndarray]]:
    """By column, (difference) / √(σ₁² + σ₂²) of every pair of halves that a program could solve."""
    rng, ratios = np.random.default_rng(0), {name: list[np.ndarray]() for name in COLUMNS}
    for number in range(count):
        first = rng.permutation(len(views.corners)) < len(views.corners) // 2
        for solve in PROGRAMS[: None if number < OF_MRCAL else -1]:
            try:
                one, other = (solve(_only(views, mask), board, model) for mask in (first, ~first))
            except FAILURES as failure:
                print(f"  {solve.__name__}: {str(failure)[:120]}", file=sys.stderr)
                continue
            for name, (values, sigma) in one.items():
                ratios[name].append((values - other[name][0]) / np.hypot(sigma, other[name][1]))
    return ratios


def _only(views: Detections, mask: np.ndarray) -> Detections:
    names = tuple(name for name, use in zip(views.pictures, mask, strict=True) if use)
    return replace(views, pictures=names, corners=views.corners[mask], skipped=(), places=())


def cell(ratios: list[np.ndarray]) -> str:
    """ "1.02: 68, 95 %" of the ratios: RMS of those that are numbers, and how many of all are within 1 and 1.96."""
    if not ratios:
        return "–"
    z = np.concatenate(ratios)
    within = [f"{100 * np.mean(np.abs(z) < limit):.0f}" for limit in (1, 1.96)]
    return f"{np.sqrt(np.nanmean(z**2)):.2f}: {', '.join(within)} %"


def pictures(names: set[str], count: int) -> Iterator[list[str]]:
    """The lines of the sets of pictures."""
    for one in sets():
        if (names and one.name not in names) or not one.files or not _whole(one):
            continue
        views, board = one.found()
        if len(views.corners) < ENOUGH and one.name not in SMALL:
            continue
        model = "fisheye" if "fisheye" in one.models else one.models[0]
        ratios = halved(views, board, model, count)
        lines = [one.name, str(len(views.corners)), model, *(cell(ratios[name]) for name in COLUMNS)]
        print(" | ".join(lines), file=sys.stderr, flush=True)
        yield lines


def _whole(one: Set) -> bool:
    same = one.hash == one.sha256
    if not same:
        print(f"{one.name}: left out, its files are not those of field.toml", file=sys.stderr)
    return same


# Virtual sets --------------------------------------------------------------------------------------------------------


def as_they_are(corners: np.ndarray, _: SetUp, __: Rng) -> np.ndarray:
    """Independent noise alone."""
    return corners


def bent_anew(corners: np.ndarray, set_up: SetUp, rng: Rng) -> np.ndarray:
    """A smooth shift of every view's own, of three times the noise: a board that bends as it is held, blur, light."""
    x, y = (2 * set_up.board.corners[:, :2] / set_up.board.corners[:, :2].max(axis=0) - 1).T
    ways = np.stack([x * x, x * y, y * y, x**3])
    return corners + np.einsum("bc,vbi->vci", ways, rng.normal(0, 3 * set_up.noise, (len(corners), 4, 2)))


def virtual(change: str, number: int) -> dict[str, np.ndarray]:
    """By column, (found less true) / σ of the intrinsics of one virtual set; of halves, (difference) / √(σ₁² + σ₂²)."""
    rng = np.random.default_rng(SEED + number)
    set_up = single(rng)
    if change == BENT:
        set_up = replace(set_up, warp=(4e-4, 0.0))
    (corners,) = set_up.observed(rng)
    if change == TOGETHER:
        corners = bent_anew(corners, set_up, rng)
    views, board = detections(set_up.camera, corners), set_up.board
    fixed = ("k2", "k3") if change == TOO_SIMPLE else ()
    names = [name for name in STANDARD if name not in fixed]
    true = np.array([parameter(set_up.camera, name) for name in names])

    def solved(mask: np.ndarray, board_warp: str = "auto") -> Calibration:
        return calibrate(_only(views, mask), board, "standard", fixed=fixed, board_warp=board_warp)

    every, half = np.full(len(corners), True), rng.permutation(len(corners)) < len(corners) // 2
    whole = solved(every)
    told = told_by(Adjustment.of(whole))
    told["board flat"] = told_by(Adjustment.of(solved(every, "off")))["camviz"]
    if not fixed:
        told |= by_opencv_extended(views, board, "standard")
    ratios = {name: (values - true) / sigma for name, (values, sigma) in told.items()}
    if all(finding.severity == "note" for finding in inspect(whole).findings):
        ratios["nothing named"] = ratios["camviz"]
    (one, its_sigma), (other, that_sigma) = (told_by(Adjustment.of(solved(mask)))["camviz"] for mask in (half, ~half))
    return ratios | {"halves": (one - other) / np.hypot(its_sigma, that_sigma)}


BENT = "a board bent by 0.4 mm, always the same"
TOGETHER = "corners of a view that go together"
TOO_SIMPLE = "a model too simple, without k2 and k3"
CHANGES = ("healthy", TOGETHER, BENT, TOO_SIMPLE)
VIRTUAL_COLUMNS = ("camviz", "halves", "nothing named", "board flat", "corners alone", "× scatter", "OpenCV")


def made(count: int) -> Iterator[list[str]]:
    """The lines of the virtual sets."""
    for change in CHANGES:
        each = [virtual(change, number) for number in range(count)]
        ratios = {name: [one[name] for one in each if name in one] for name in VIRTUAL_COLUMNS}
        cells = {name: cell(ratios[name]) for name in VIRTUAL_COLUMNS}
        cells["nothing named"] += f" of {len(ratios['nothing named'])}"
        print(" | ".join([change, *cells.values()]), file=sys.stderr, flush=True)
        yield [change, *cells.values()]


def main(arguments: list[str]) -> None:
    """Run what is asked for."""
    cv2.setNumThreads(1)
    names = {each for each in arguments if not each.startswith("-")}
    few = "--few" in arguments
    parts = []
    if "--virtual" not in arguments:
        lines = list(pictures(names, FEWER if few else HALVES))
        parts.append(table(["set", "views", "model", *COLUMNS], lines))
    if not names:
        lines = list(made(SOME if few else VIRTUAL))
        parts.append(table(["virtual sets", *VIRTUAL_COLUMNS], lines))
    text = "\n\n".join(parts)
    print(text)
    if "--page" in arguments:
        before, rest = PAGE.read_text(encoding="utf-8").split(HEAD)
        PAGE.write_text(f"{before}{HEAD}\n\n{text}\n\n{TAIL}{rest.split(TAIL)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
