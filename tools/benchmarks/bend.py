"""When the board's bend is solved for, how near it comes to the truth, and what it is worth, beside mrcal.

    python tools/benchmarks/bend.py [COUNT]         virtual boards, flat and bent: a table (default: 50 of each)
    python tools/benchmarks/bend.py --sets NAME …   sets of field.toml, from the pictures in CAMVIZ_FIELD

Virtual: the bend of a board has a random direction (along its rows, its columns, or between) and the length given, in
per cent of the board's longer side. "Solved for" counts what `board_warp="auto"` does. The intervals are those of both
sagittas where the bend is always solved for.

Sets: every fifth view is held out, five times, and posed by one half of its board, as field.py has it; but each program
foretells the other half with the board that it has found, flat or bent.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from field import FOLDS, Set, held_out_squares, sets, solved_by_mrcal, split
from intervals import as_they_are, bent_anew
from kernel import table

from camviz.cameras import Camera
from camviz_clinic.calibration import calibrate
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.virtual import SetUp, detections, single
from camviz_clinic.files import load

SEED = 70_000
COUNT = 50
EACH_WAY = 0.3  # per cent of the board: σ of the sagittas of a board that bends another way in every view
ASK_MRCAL = "import mrcal, sys; print(*mrcal.cameramodel(sys.argv[1]).optimization_inputs()['calobject_warp'])"

Rng = np.random.Generator


def held(corners: np.ndarray, set_up: SetUp, rng: Rng) -> np.ndarray:
    """Every view with a bend of its own, about none."""
    warps = EACH_WAY / 100 * set_up.board.length * rng.normal(size=(len(corners), 2))
    exact = set_up.corners[0]
    bent = [replace(set_up, warp=tuple(warp)).corners[0][view] for view, warp in enumerate(warps)]
    return corners + np.array(bent) - exact


KINDS: dict[str, tuple[float, Callable[[np.ndarray, SetUp, Rng], np.ndarray]]] = {
    "flat": (0.0, as_they_are),
    "flat, corners of a view go together": (0.0, bent_anew),
    f"flat, but bent by {EACH_WAY:g} % another way in every view": (0.0, held),
    "bent by 0.1 %": (0.1, as_they_are),
    "bent by 0.25 %": (0.25, as_they_are),
    "bent by 0.5 %": (0.5, as_they_are),
    "bent by 1 %": (1.0, as_they_are),
    "bent by 2 %": (2.0, as_they_are),
    "bent by 1 %, corners of a view go together": (1.0, bent_anew),
}


def virtual(kind: str, number: int) -> tuple[bool, np.ndarray, np.ndarray]:
    """Whether the bend is solved for; the errors of both sagittas in σ; and those of fx in %, flat, auto, always."""
    strength, change = KINDS[kind]
    rng = np.random.default_rng(SEED + number)
    set_up, angle = single(rng), rng.uniform(0, 2 * np.pi)
    warp = strength / 100 * set_up.board.length * np.array([np.cos(angle), np.sin(angle)])
    set_up = replace(set_up, warp=tuple(warp))
    (corners,) = set_up.observed(rng)
    views = detections(set_up.camera, change(corners, set_up, rng))
    flat, auto, bent = (calibrate(views, set_up.board, board_warp=word) for word in ("off", "auto", "on"))
    assert bent.board_warp is not None
    assert bent.board_warp_covariance is not None
    ratios = (bent.board_warp - warp) / np.sqrt(np.diag(bent.board_warp_covariance))
    focal = np.array([one.cameras["camera"].intrinsics.fx for one in (flat, auto, bent)])
    return auto.board_warp is not None, ratios, 100 * (focal / set_up.camera.intrinsics.fx - 1)


def line(kind: str, count: int) -> list[str]:
    """One kind of board in the table."""
    accepted, ratios, focal = (np.array(each) for each in zip(*(virtual(kind, n) for n in range(count)), strict=True))
    within = [f"{int((np.abs(ratios) < limit).sum())}" for limit in (1, 1.96)]
    off = [f"{np.sqrt(np.mean(each**2)):.3f}" for each in focal.T]
    told = [kind, f"{accepted.sum()} of {count}", f"{' / '.join(within)} of {ratios.size}", " / ".join(off)]
    print(" | ".join(told), file=sys.stderr, flush=True)
    return told


# Sets of pictures -----------------------------------------------------------------------------------------------------


class Bent(Board):
    """A board whose corners are bent by what was found."""

    def __init__(self, board: Board, warp: np.ndarray | None) -> None:
        super().__init__(board.columns, board.rows, board.square_size)
        object.__setattr__(self, "bend", np.zeros(2) if warp is None else warp)

    @property
    def corners(self) -> np.ndarray:
        return Board(self.columns, self.rows, self.square_size).warped(self.bend)  # type: ignore[attr-defined]


def by_camviz(word: str, views: Detections, board: Board, model: str) -> tuple[Camera, np.ndarray | None, str]:
    """The camera, the bend, and the bend in words."""
    solved: Calibration = calibrate(views, board, model, board_warp=word)
    if solved.board_warp is None or solved.board_warp_covariance is None:
        return solved.cameras["camera"], None, "flat"
    pairs = zip(1000 * solved.board_warp, 1000 * np.sqrt(np.diag(solved.board_warp_covariance)), strict=True)
    return solved.cameras["camera"], solved.board_warp, ", ".join(f"{w:.3f} ± {sigma:.3f}" for w, sigma in pairs)


def by_mrcal(views: Detections, board: Board, model: str) -> tuple[Camera, np.ndarray, str]:
    """The same of mrcal-calibrate-cameras, whose Python package tells the bend."""
    with solved_by_mrcal(views, board, model) as path:
        asked = ["/usr/bin/python3", "-c", ASK_MRCAL, str(path)]
        warp = np.array(subprocess.run(asked, capture_output=True, check=True, text=True).stdout.split(), dtype=float)
        return next(iter(load(path).cameras.values())), warp, ", ".join(f"{1000 * each:.3f}" for each in warp)


PROGRAMS: dict[str, Callable[[Detections, Board, str], tuple[Camera, np.ndarray | None, str]]] = {
    "camviz, flat": lambda *given: by_camviz("off", *given),
    "camviz, auto": lambda *given: by_camviz("auto", *given),
    "mrcal": by_mrcal,
}


def field_line(one: Set, model: str) -> list[str]:
    """A set: for each program the bend from all views in mm, and the held-out error in px, board as found and flat."""
    views, board = one.found()
    told = [one.name, str(len(views.corners)), model]
    for solve in PROGRAMS.values():
        *_, bend = solve(views, board, model)
        bent, flat = [], []
        for first in range(FOLDS):
            given, asked = split(views, first)
            camera, warp, _ = solve(given, board, model)
            bent.append(held_out_squares(camera, asked, Bent(board, warp)))
            flat.append(held_out_squares(camera, asked, board))
        told.append(f"{bend}: {_rms(bent):.3f} ({_rms(flat):.3f})")
    print(" | ".join(told), file=sys.stderr, flush=True)
    return told


def _rms(squares: list[np.ndarray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def main(arguments: list[str]) -> None:
    """Run what is asked for."""
    cv2.setNumThreads(1)
    if "--sets" in arguments:
        chosen = [one for one in sets() if one.name in arguments and one.files]
        head = ["set", "views", "model", *PROGRAMS]
        print(table(head, [field_line(one, model) for one in chosen for model in one.models]))
        return
    count = int(arguments[0]) if arguments else COUNT
    head = ["virtual boards", "solved for", "sagittas within 1 / 1.96 ±", "error of fx in %, RMS: flat / auto / always"]
    print(table(head, [line(kind, count) for kind in KINDS]))


if __name__ == "__main__":
    main(sys.argv[1:])
