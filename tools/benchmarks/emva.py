"""Whether every figure that `camviz noise` tells is true: cameras of all kinds, simulated photon by photon.

    python tools/benchmarks/emva.py [SEEDS [CAMERAS [SEED]]]

First eleven cameras that obey the model of EMVA 1288 and thirteen that break it, each of SEEDS (10) random draws; then
CAMERAS (0) random ones. Prints how often figures were told, how many were further off than promised (3 %, DSNU and PRNU
5 %, 0.26 dB, linearity 0.1 % of the signal), and how many bounds exclude the truth; exit status 1 where any was.
"""

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests"))

from odd_cameras import ODD, ORDINARY, against, asked, faults
from plain_cameras import error, measured, random_camera, random_shooting, truth

SIZES = ((64, 64), (64, 64), (120, 160), (120, 160), (240, 320), (480, 640))


def main(seeds: int, cameras: int, seed: int) -> int:
    wrong = kinds(seeds)
    return int(bool(wrong) | bool(cameras and random_ones(cameras, seed)))


def kinds(seeds: int) -> int:
    """The table of the cameras of `odd_cameras`; how many faults there were."""
    print("| camera | figures told | withheld with bounds | wrong, or told amiss |\n|---|---|---|---|")
    all_wrong = 0
    for name, kind in (ORDINARY | ODD).items():
        told = bounded = wrong = 0
        for seed in range(seeds):
            camera, how, found = asked(kind, kind.size, seed)
            said = faults(kind, camera, how, found) + (against(found) if name in ORDINARY else [])
            for one in said:
                print(name, seed, one, file=sys.stderr)
            told += sum(np.isfinite(figure.value) for figure in found.judged.values())
            bounded += sum(figure.bounded and not np.isfinite(figure.value) for figure in found.judged.values())
            wrong += len(said)
        print(f"| {name} | {told} | {bounded} | {wrong} |", flush=True)
        all_wrong += wrong
    return all_wrong


def random_ones(cameras: int, seed: int) -> bool:
    told: dict[str, list[float]] = defaultdict(list)
    withheld: dict[str, int] = defaultdict(int)
    unbounded: dict[str, int] = defaultdict(int)
    refused = 0
    for number in range(cameras):
        rng = np.random.default_rng([seed, number])
        size = SIZES[number % len(SIZES)]
        camera = random_camera(rng, size)
        shooting = random_shooting(rng, camera, int(rng.integers(10, 51)))
        try:
            found = measured(camera, shooting, rng)
        except ValueError as reason:
            refused += 1
            print(f"camera {number} is refused: {reason}", file=sys.stderr)
            continue
        for name, true in truth(camera, shooting, found).items():
            figure = found.judged[name]
            withheld[name] += not np.isfinite(figure.value)
            if np.isfinite(figure.value):
                told[name].append(error(name, figure.value, true))
            outside = figure.bounded and not figure.low - 1e-9 <= true <= figure.high + 1e-9
            unbounded[name] += outside
            if outside or (told[name] and np.isfinite(figure.value) and told[name][-1] > 1):
                said = f"{figure.value:.5g} [{figure.low:.5g}, {figure.high:.5g}], true {true:.5g}"
                print(number, name, said, file=sys.stderr)
                print("   ", size, camera, len(shooting.photons), shooting.frames, file=sys.stderr)
    print(f"{cameras} cameras, {refused} refused\n")
    print("| figure | told | withheld | worst error, of the promise | further off | truth outside the bounds |")
    print("|---|---|---|---|---|---|")
    for name in withheld:
        worst = f"{max(told[name]):.2f}" if told[name] else "–"
        far = sum(one > 1 for one in told[name])
        print(f"| {name} | {len(told[name])} | {withheld[name]} | {worst} | {far} | {unbounded[name]} |")
    return any(one > 1 for errors in told.values() for one in errors)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in (sys.argv[1:] + ["10", "0", "1"][len(sys.argv) - 1 :]))))
