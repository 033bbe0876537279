"""How often a rig's cameras stand where they are told to, within their ±, beside OpenCV; and what many frames cost.

    python tools/benchmarks/rigs.py            20 rigs of every kind, as Markdown tables
    python tools/benchmarks/rigs.py N WORD     N rigs of the kinds with that word in their name
    python tools/benchmarks/rigs.py --large    8 cameras and 200 frames: seconds and megabytes
    python tools/benchmarks/rigs.py --faults N what is named in N rigs with each fault, and in N healthy ones; with a
                                               WORD behind it, of the faults and healthy ones whose names have it

"within 3 ±" and "95 % intervals" (1.96 ±) count the six numbers of every two cameras' relative pose; behind the stroke
are the intervals by the noise of corners alone. A board that bends does so otherwise in every frame, by 0.5 px in each
of four ways. OpenCV's `calibrateMultiview` (from 5.0 on) has the same corners in the same run; it says no ±. "worst" is
the largest error of a relative position, in millimetres, and "nearer" counts the rigs whose camviz RMS error is less.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from functools import partial

import cv2
import numpy as np
from kernel import table

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Board, CannotCalibrate, Detections
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.calibration.detection import seen
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings import rig as checks
from camviz_clinic.checks.registry import Fault, Finding, Kind
from camviz_clinic.rigs import calibrate_rig, relative_pose, rig_of, virtual
from camviz_clinic.rigs.adjustment import RigAdjustment
from camviz_clinic.rigs.virtual import VirtualRig

SEED = 50_000
BEND = 0.5  # pixels
NORMAL_95 = 1.96
BENT = "4 cameras, a board that bends"
KINDS: dict[str, tuple[int, int, float, tuple[int, ...]]] = {  # cameras, frames for each, share seen together, fisheyes
    "2 cameras, 5 % shared": (2, 20, 0.05, ()),
    "2 cameras, all shared": (2, 20, 1.0, ()),
    "3 cameras, one fisheye": (3, 15, 0.4, (1,)),
    "4 cameras, half shared": (4, 15, 0.5, ()),
    "4 fisheyes": (4, 15, 0.5, (0, 1, 2, 3)),
    BENT: (4, 15, 0.5, ()),
    "8 cameras, 20 % shared": (8, 12, 0.2, ()),
    "8 cameras, two fisheyes": (8, 12, 0.5, (2, 5)),
}
RIG_KINDS = [each for each in vars(checks).values() if isinstance(each, Kind)]
Placed = dict[str, RigidTransform]  # first_from_cam


def drawn(kind: str, seed: int) -> tuple[VirtualRig, dict[str, Detections], dict[str, str]]:
    """The truth, what the cameras saw, and which model each has."""
    cameras, frames, shared, fisheye = KINDS[kind]
    rng = np.random.default_rng(SEED + seed)
    truth = virtual.rig(rng, cameras, frames=frames, shared=shared, fisheye=fisheye)
    found = truth.observed(rng)
    if kind == BENT:
        x, y = (2 * truth.board.corners[:, :2] / truth.board.corners[:, :2].max(axis=0) - 1).T
        bends = rng.normal(0, BEND, (len(truth.world_from_board), 4, 2))
        off = np.einsum("bc,fbi->fci", np.stack([x * x, x * y, y * y, x**3]), bends)
        found = {name: replace(each, corners=each.corners + off[list(each.places)]) for name, each in found.items()}
    return truth, found, {f"cam{i}": "fisheye" if i in fisheye else "standard" for i in range(cameras)}


def pairs(names: list[str]) -> Iterator[tuple[str, str]]:
    return ((a, b) for i, a in enumerate(names) for b in names[i + 1 :])


def ratios(truth: VirtualRig, rig: RigAdjustment) -> Array:
    """(pairs, 6), errors of the relative poses in their ±."""
    rows = []
    for a, b in pairs(list(truth.cameras)):
        beside, true = relative_pose(rig, b, a), truth.cameras[a].cam_from_world * truth.cameras[b].world_from_cam
        turn = (beside.pose.rotation * true.rotation.inv()).as_rotvec()
        shift = beside.pose.translation - true.translation
        rows.append(np.concatenate([turn, shift]) / beside.deviations)
    return np.array(rows)


def position_errors(truth: VirtualRig, placed: Placed) -> Array:
    """(pairs,), how far one camera is off in the other's frame, in millimetres."""
    found = []
    for a, b in pairs(list(truth.cameras)):
        true = truth.cameras[a].cam_from_world * truth.cameras[b].world_from_cam
        found.append(np.linalg.norm((placed[a].inv() * placed[b]).translation - true.translation))
    return 1000 * np.array(found)


def by_opencv(truth: VirtualRig, found: dict[str, Detections], models: dict[str, str]) -> Placed | None:
    """Where cv2.calibrateMultiview places the cameras; None where it raises or gives no numbers."""
    rig = calibrated_by_opencv(found, truth.board, models)
    return None if rig is None else {name: camera.world_from_cam for name, camera in rig.items()}


def calibrated_by_opencv(
    found: dict[str, Detections], board: Board, models: dict[str, str], held: dict[str, Camera] | None = None
) -> dict[str, Camera] | None:
    """The cameras of cv2.calibrateMultiview from the same corners; None where it raises or gives no numbers.

    Of a frame it has the corners that all its cameras see, some twice in the place of the others. Corners that were not
    seen may be given as (-1, -1) by its documentation, but OpenCV 5.0.0 takes them for corners. `held` are cameras
    whose intrinsics and lens it takes as they are.
    """
    frames = sorted({place for each in found.values() for place in each.places})
    views = {name: dict(zip(each.places, each.corners, strict=True)) for name, each in found.items()}
    points, images, mask = [], [[] for _ in found], np.zeros((len(found), len(frames)), np.uint8)
    for column, frame in enumerate(frames):
        views_of_it = [each[frame] for each in views.values() if frame in each]
        common = np.flatnonzero(seen(np.stack(views_of_it)).all(axis=0))
        enough = len(common) >= FEWEST and np.linalg.matrix_rank(np.diff(board.corners[common], axis=0)) > 1
        which = np.resize(common if enough else np.arange(len(board.corners)), len(board.corners))
        points.append(board.corners[which].astype(np.float32))
        for row, each in enumerate(views.values()):
            mask[row, column] = enough and frame in each
            image = each[frame][which] if mask[row, column] else np.zeros((len(which), 2))
            images[row].append(image.astype(np.float32)[None])
    sizes = [(each.width, each.height) for each in found.values()]
    kinds = np.array([int(models[name] == "fisheye") for name in found], np.uint8)
    flags = np.where(kinds, cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW, 0).astype(np.int32)
    nobody = [None] * len(found)  # it begins by itself
    known = [held[name] for name in found] if held else []
    K, D = [each.intrinsics.K for each in known] or nobody, [np.array(astuple(each.lens)) for each in known] or nobody
    guess = cv2.CALIB_USE_INTRINSIC_GUESS if held else 0
    try:
        _, matrices, lenses, turns, shifts = cv2.calibrateMultiview(
            points, images, sizes, mask, kinds, K, D, nobody, nobody, flags, guess
        )
    except cv2.error:
        return None
    if not all(np.isfinite(np.concatenate([np.ravel(part) for part in parts])).all()
               for parts in zip(matrices, lenses, turns, shifts, strict=True)):  # fmt: skip
        return None
    rig = {}
    for name, size, K, D, R, t in zip(found, sizes, matrices, lenses, turns, shifts, strict=True):
        R, D = np.asarray(R), np.ravel(D)
        rotation = Rotation.from_matrix(R) if R.size == 9 else Rotation.from_rotvec(R.ravel())
        lens = KannalaBrandt(*D.tolist()) if models[name] == "fisheye" else BrownConrady.from_coefficients(D)
        pose = RigidTransform.from_components(np.ravel(t), rotation)
        rig[name] = Camera(Intrinsics.from_matrix(np.asarray(K), *size), lens).at(pose.inv())
    return rig


def row(kind: str, count: int) -> list[str]:
    off, by_corners, ours, theirs, times = [], [], [], [], [0.0, 0.0]
    refused, nearer = [0, 0], 0
    for seed in range(count):
        truth, found, models = drawn(kind, seed)
        start = time.perf_counter()
        try:
            solved = calibrate_rig(found, truth.board, models)
        except CannotCalibrate:
            refused[0] += 1
            continue
        times[0] += time.perf_counter() - start
        rig = rig_of(solved)
        off.append(ratios(truth, rig))
        by_corners.append(ratios(truth, rig.by_corners))
        ours.append(position_errors(truth, {name: each.world_from_cam for name, each in solved.cameras.items()}))
        if hasattr(cv2, "calibrateMultiview"):
            start = time.perf_counter()
            placed = by_opencv(truth, found, models)
            times[1] += time.perf_counter() - start
            if placed is None:
                refused[1] += 1
            else:
                theirs.append(position_errors(truth, placed))
                nearer += np.linalg.norm(ours[-1]) <= np.linalg.norm(theirs[-1])
    errors = [f"{np.median(np.concatenate(each)):.2f} / {np.concatenate(each).max():.2f}" if each else "–"
              for each in (ours, theirs)]  # fmt: skip
    all_off, all_by_corners = (np.concatenate([each.ravel() for each in those]) for those in (off, by_corners))
    return [
        kind,
        f"{np.mean(np.abs(all_off) < 3):.1%} of {all_off.size}",
        f"{np.mean(np.abs(all_off) < NORMAL_95):.1%} / {np.mean(np.abs(all_by_corners) < NORMAL_95):.1%}",
        f"{np.sqrt(np.mean(all_off**2)):.2f}",
        errors[0],
        errors[1],
        f"{nearer} of {len(theirs)}",
        f"{refused[0]} / {refused[1]} of {count}",
        f"{times[0] / count:.1f} / {times[1] / count:.1f}",
    ]


def large() -> None:
    rng = np.random.default_rng(SEED)
    truth = virtual.rig(rng, 8, frames=25, shared=0.8)
    found = truth.observed(rng)
    start = time.perf_counter()
    solved = calibrate_rig(found, truth.board)
    rig_of(solved)
    seconds, peak = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    views = sum(len(each.places) for each in found.values())
    print(f"8 cameras, {len(truth.world_from_board)} frames, {views} views: {seconds:.1f} s, {peak:.0f} MB")


def faults(count: int, word: str = "") -> None:
    """How often each fault is named, and alone, and how often anything is in healthy rigs."""
    every = [each for each in vars(checks).values() if isinstance(each, Fault)]
    print(table(["rigs", "named", "others named", "refused"], []), end="")
    kinds = [(each.name, each.finding, partial(each.inject, strength=each.promised)) for each in every]
    for kind in (*kinds, ("healthy rigs", "", healthy), ("healthy films", "", healthy_film)):
        if word in kind[0]:
            print(f"| {' | '.join(fault_row(*kind, count))} |", flush=True)


def healthy(rng: np.random.Generator) -> Evidence:
    truth = virtual.rig(rng, 3, frames=10, shared=0.5)
    return Evidence(calibrate_rig(truth.observed(rng), truth.board))


def healthy_film(rng: np.random.Generator) -> Evidence:
    truth = virtual.film(rng, 3, frames=24)
    return Evidence(calibrate_rig(truth.observed(rng), truth.board))


def fault_row(name: str, meant: str, make: Callable[[np.random.Generator], Evidence], count: int) -> list[str]:
    named, others, refused = 0, 0, 0
    for seed in range(count):
        try:
            evidence = make(np.random.default_rng(SEED + seed))
            ids = {each.id for kind in RIG_KINDS for each in found_by(kind, evidence)}
        except CannotCalibrate:
            refused += 1
            continue
        named += meant in ids
        others += bool(ids - {meant})
    return [name, f"{named} of {count}", str(others), str(refused)]


def found_by(kind: Kind, evidence: Evidence) -> list[Finding]:
    try:
        return list(kind.check(evidence))
    except NotChecked:
        return []


def main() -> None:
    words = sys.argv[1:]
    if "--faults" in words:
        faults(int(words[1]) if words[1:] else 50, "".join(words[2:3]))
        return
    if "--large" in words:
        large()
        return
    count, word = int(words[0]) if words else 20, words[1] if words[1:] else ""
    head = ["rigs", "within 3 ±", "95 % intervals / corners alone", "RMS in ±", "camviz: median / worst, mm",
            "OpenCV", "nearer", "refused, camviz / OpenCV", "seconds, camviz / OpenCV"]  # fmt: skip
    print(table(head, []), end="")
    for kind in KINDS:
        if word in kind:
            print(f"| {' | '.join(row(kind, count))} |", flush=True)


if __name__ == "__main__":
    main()
