"""How often `camviz handeye` names what is wrong with a robot's poses, and how true its σ is: simulated cells.

python tools/benchmarks/handeye.py        50 cases of each fault, 50 healthy ones, and the table of intervals
python tools/benchmarks/handeye.py 10     fewer
python tools/benchmarks/handeye.py 50 one-axis nothing 15    these faults, healthy cases, intervals of 15 poses
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

from camviz_clinic.calibration.motions_solving import park
from camviz_clinic.handeye import hand_eye_from_corners
from camviz_clinic.handeye.virtual import FAULTS, cell, healthy_case

CASES, SEED, POSES, NOTHING = 50, 70_000, (8, 15, 25), "nothing"
EVERYTHING = (*FAULTS, NOTHING)


def main(cases: int, asked: list[str]) -> None:
    print(f"| fault | named, of {cases} | named otherwise |\n|---|---|---|")
    for place, id in enumerate(EVERYTHING):
        if not asked or id in asked:
            print(row(id, place, cases), flush=True)
    for poses in POSES if not asked else [n for n in POSES if str(n) in asked]:
        print(intervals(poses, cases), flush=True)


def row(id: str, place: int, cases: int) -> str:
    """A row of the table: how often a fault is named; of healthy cases how often nothing is."""
    named: Counter[str] = Counter()
    for seed in range(cases):
        rng = np.random.default_rng([SEED, place, seed])
        found = [each.id for each in (FAULTS[id](rng) if id in FAULTS else healthy_case(rng)).findings]
        named[id if id in found else found[0] if found else NOTHING] += 1
    others = ", ".join(f"{count} {name}" for name, count in named.items() if name != id) or "none"
    return f"| {id} | {named[id]} | {others} |"


def intervals(poses: int, cases: int) -> str:
    """A line: how often 95 % intervals of X hold, how large z is, and how far X is off beside the closed form."""
    inside, z, ours, closed = [], [], [], []
    for seed in range(cases):
        true = cell(np.random.default_rng([SEED, poses, seed]), poses, bool(seed % 2))
        found = hand_eye_from_corners(
            true.base_from_hand, true.pixels, true.camera, true.board, eye_to_hand=true.eye_to_hand
        )
        shift = found.mount_from_cam.translation - true.X.translation
        turn = (found.mount_from_cam.rotation * true.X.rotation.inv()).as_rotvec()
        sigma = np.concatenate([found.rotation_sigma, found.translation_sigma])
        z.append(np.concatenate([turn, shift]) / sigma)
        inside.append(np.abs(z[-1]) < found.times_sigma)
        X, _ = park(found.motions, np.stack(np.triu_indices(len(found.motions), 1), axis=-1))
        ours.append(np.linalg.norm(shift))
        closed.append(np.linalg.norm(X[:3, 3] - true.X.translation))
    return (
        f"{poses} poses: 95 % intervals hold {np.mean(inside):.1%}, RMS z {np.sqrt(np.mean(np.square(z))):.2f}; X off "
        f"by {1000 * np.median(ours):.2f} mm (median), by Park's closed form {1000 * np.median(closed):.2f} mm"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else CASES, sys.argv[2:])
