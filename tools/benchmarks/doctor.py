"""How often the board doctor is right: faults of a board's description in rendered pictures, and healthy sets.

python tools/benchmarks/doctor.py          50 cases of each fault and 48 healthy sets, as the table in docs/clinic.md
python tools/benchmarks/doctor.py 5        fewer
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import (
    Board,
    CannotCalibrate,
    Detections,
    calibrate,
    calibrate_pair,
    detect,
    find_corners,
)
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.doctor import Shown, diagnose
from camviz_clinic.checks.findings.described import smooth
from camviz_clinic.checks.snapshots import Pictured, pictured, snapshot
from camviz_clinic.checks.virtual import pair, spread_boards

Rng = np.random.Generator
DICTIONARIES = {"DICT_4X4_100": 100, "DICT_5X5_100": 100, "DICT_6X6_250": 250, "DICT_APRILTAG_36h11": 587}
CASES, HEALTHY, SEED = 50, 48, 60_000
SECONDS = 0.5
NOISE = (1, 8)  # grey levels
SIDES = (480, 640, 720)


def charuco(rng: Rng, **printed: object) -> Board:
    """A ChArUco board of 4×3 to 7×6 inner corners, the sides unlike."""
    columns, rows = int(rng.integers(4, 8)), int(rng.integers(3, 7))
    rows += columns == rows
    name = str(rng.choice(list(DICTIONARIES)))
    size = rng.uniform(0.65, 0.8)
    board = Board(columns=columns, rows=rows, square_size=0.03, marker_size=0.03 * size, dictionary=name)
    return replace(board, **printed)  # type: ignore[arg-type]


def shot(rng: Rng, board: Board, views: int = 4, lens: BrownConrady | None = None) -> Pictured:
    """Pictures of varied size, noise and lens."""
    if lens is None and rng.random() < 0.3:
        k1 = -rng.uniform(0.22, 0.35)
        lens = BrownConrady(k1, k1 * k1 / 3)
    return pictured(rng, board, views, lens, rng.uniform(*NOISE), int(rng.choice(SIDES)))


def described(rng: Rng, printed: Board, **otherwise: object) -> Counter[str]:
    """What is named where a board is described otherwise than it was printed."""
    seen = shot(rng, printed)
    board = replace(printed, **otherwise)  # type: ignore[arg-type]
    return named(Shown(board, seen.pictures, _solved(seen, board)))


def named(shown: Shown) -> Counter[str]:
    return Counter(each.trouble for each in diagnose(shown))


def _solved(seen: Pictured, board: Board, corners: np.ndarray | None = None) -> Calibration | None:
    """The calibration of the corners that are found; None where there is none."""
    names = list(seen.pictures)
    if corners is None:
        found = {name: find_corners(picture, board) for name, picture in seen.pictures.items()}
        names = [name for name in names if found[name] is not None]
        corners = np.array([found[name] for name in names])
    grid = seen.camera.intrinsics
    try:
        return calibrate(Detections(tuple(names), corners, grid.width, grid.height), board, fixed=("k3",))
    except (CannotCalibrate, ValueError):
        return None


def legacy(rng: Rng) -> Counter[str]:
    board = charuco(rng, rows=int(rng.choice([3, 5])))
    return described(
        rng, replace(board, columns=board.columns + (board.columns == board.rows), legacy=True), legacy=False
    )


def swapped(rng: Rng) -> Counter[str]:
    board = charuco(rng)
    return described(rng, board, columns=board.rows, rows=board.columns)


def border(rng: Rng) -> Counter[str]:
    return described(rng, charuco(rng, border_bits=2), border_bits=1)


def first(rng: Rng) -> Counter[str]:
    return described(rng, charuco(rng, first_id=int(rng.integers(1, 60))), first_id=0)


def unit(rng: Rng) -> Counter[str]:
    """Metres for millimetres or the reverse."""
    board = Board(columns=8, rows=5, square_size=float(rng.uniform(0.01, 0.05)))
    seen = shot(rng, board, 5)
    wrong = replace(board, square_size=board.square_size * float(rng.choice([1000, 1 / 1000])))
    return named(Shown(wrong, seen.pictures, _solved(seen, wrong)))


def baseline(rng: Rng) -> Counter[str]:
    """Centimetres or inches for millimetres, beside a measured baseline."""
    board = Board(columns=9, rows=6, square_size=0.025)
    wrong = replace(board, square_size=board.square_size / float(rng.choice([10, 25.4])))
    seen, solved, length, _ = _pair(rng, board, wrong)
    return named(Shown(wrong, seen, solved, length * float(rng.normal(1, 0.003))))


def symmetric(rng: Rng) -> Counter[str]:
    """The board is rolled by about 90° in two views, so that a finder may begin at either end in either camera."""
    sides = [(9, 7), (8, 6), (7, 5), (10, 6)]
    columns, rows = sides[rng.integers(len(sides))]
    board = Board(columns=columns, rows=rows, square_size=0.02)
    seen, solved, _, both = _pair(rng, board, board, turned=True)
    return named(Shown(board, seen, solved, both=both if solved is None else None))


def _pair(
    rng: Rng, board: Board, said: Board, turned: bool = False
) -> tuple[dict[str, np.ndarray], Calibration | None, float, tuple[Detections, Detections]]:
    """Pictures of a board by a pair, its calibration with the board as it is said to be, the true baseline, corners.

    Where it is `turned`, the corners of the right camera run backwards in two views, as those of a camera that hangs
    upside down do.
    """
    drawn = pair(rng, views=1).cameras
    cameras = tuple(replace(each, intrinsics=each.intrinsics.within(480)) for each in drawn)
    poses = spread_boards(rng, cameras, board, 7, (15, 35))
    pictures, found = {}, []
    backwards = set(rng.permutation(7)[:2].tolist()) if turned else set()
    for side, camera in zip(("left", "right"), cameras, strict=True):
        alone = Camera(camera.intrinsics, camera.lens)
        corners = []
        for view, pose in enumerate(poses):
            picture = snapshot(alone, board, camera.cam_from_world * pose, rng, rng.uniform(*NOISE))
            pictures[f"{side}{view}.png"] = picture
            upside = side == "right" and view in backwards
            seen = find_corners(np.ascontiguousarray(picture[::-1, ::-1]) if upside else picture, said)
            if seen is not None and upside:
                seen = np.array(picture.shape[::-1]) - 1 - seen
            corners.append(np.full((len(board.corners), 2), np.nan) if seen is None else seen)
        kept = [view for view in range(7) if np.isfinite(corners[view]).all()]
        grid = camera.intrinsics
        names = tuple(f"{side}{view}.png" for view in kept)
        found.append(Detections(names, np.array([corners[v] for v in kept]), grid.width, grid.height, (), tuple(kept)))
    try:
        solved = calibrate_pair(found[0], found[1], said, fixed=("k3",))
    except CannotCalibrate:
        solved = None
    return pictures, solved, float(np.linalg.norm(cameras[1].centre)), (found[0], found[1])


def interpolated(rng: Rng) -> Counter[str]:
    """A homography in place of a finder, with a lens of strong barrel distortion."""
    k1 = -rng.uniform(0.2, 0.4)
    board = charuco(rng)
    board = replace(board, columns=board.columns + 2, rows=board.rows + 1)
    seen = shot(rng, board, 4, BrownConrady(k1, k1 * k1 / 3))
    corners = np.array([smooth(board, each) for each in seen.corners])
    solved = _solved(seen, board, corners)
    return named(Shown(board, seen.pictures, solved))


def endless(rng: Rng) -> Counter[str]:
    """A large picture full of squares, in which the search takes longer than it may."""
    noise = rng.integers(0, 2, (500, 700), dtype=np.uint8) * 255
    with tempfile.TemporaryDirectory() as room:
        path = Path(room) / "squares.png"
        cv2.imwrite(str(path), cv2.resize(noise, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST))
        try:
            detect([path], Board(columns=9, rows=6, square_size=0.02), seconds=SECONDS)
        except CannotCalibrate as error:
            return Counter(["endless search"] if "did not end within" in str(error) else [])
    return Counter()


FAULTS: dict[str, tuple[Callable[[Rng], Counter[str]], str]] = {
    "legacy ChArUco pattern": (legacy, "legacy pattern"),
    "columns and rows swapped": (swapped, "sides swapped"),
    "border of two cells": (border, "tag border"),
    "first id other than 0": (first, "first number"),
    "square in another unit, 1000 times": (unit, "wrong unit"),
    "square in cm or inches, baseline known": (baseline, "wrong unit"),
    "symmetric board, views turned in a pair": (symmetric, "symmetric board"),
    "corners by a homography": (interpolated, "interpolated corners"),
    "a search that does not end": (endless, "endless search"),
}


def healthy(rng: Rng, number: int) -> Counter[str]:
    """A board described as it was printed: of every kind, whole or in part, alone or before a pair."""
    boards = [
        charuco(rng),
        charuco(rng, legacy=True),
        charuco(rng, border_bits=2),
        charuco(rng, first_id=int(rng.integers(1, 60))),
        Board(columns=9, rows=7, square_size=0.025),
        Board(columns=9, rows=6, square_size=0.025),
        Board.aprilgrid(4, 3, 0.04, 0.3),
        Board(columns=7, rows=5, square_size=0.03, kind="circles"),
    ]
    board = boards[number % len(boards)]
    if board.kind == "chessboard" and number % 2:
        seen, solved, length, _ = _pair(rng, board, board)
        return named(Shown(board, seen, solved, length * float(rng.normal(1, 0.003))))
    pictures = shot(rng, board, 5)
    if board.kind == "charuco" and number % 3 == 0:  # a part of it is covered
        for picture in pictures.pictures.values():
            picture[:, : picture.shape[1] * 2 // 5] = 120
    return named(Shown(board, pictures.pictures, _solved(pictures, board)))


def main() -> None:
    """Write the table."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else CASES
    print("| board | named | what else was named |\n|---|---|---|", flush=True)
    for title, (make, trouble) in FAULTS.items():
        results = [make(np.random.default_rng(SEED + number)) for number in range(cases)]
        others = sum((Counter(set(each) - {trouble}) for each in results), Counter[str]())
        told = ", ".join(f"{name} {count}" for name, count in others.most_common())
        print(f"| {title} | {sum(trouble in each for each in results)} of {cases} | {told} |", flush=True)
    sets = HEALTHY if cases == CASES else cases
    alarms = [healthy(np.random.default_rng(SEED + 1000 + number), number) for number in range(sets)]
    told = ", ".join(f"{name} {count}" for name, count in sum(alarms, Counter[str]()).most_common())
    print(f"| healthy, of all kinds | {sum(map(bool, alarms))} of {sets} | {told} |", flush=True)


if __name__ == "__main__":
    main()
