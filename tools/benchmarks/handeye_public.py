"""`hand_eye` beside KinHEC's solvers and OpenCV 4's `calibrateHandEye`, on KinHEC's sequences, whose truth is exact.

python tools/benchmarks/handeye_public.py OTHER FOLDER           KinHEC's smoke tier: 46 sequences
python tools/benchmarks/handeye_public.py OTHER FOLDER 1 2 3     and again with these seeds

OTHER is the Python of an environment with `pip install kinhec "opencv-python-headless<5"`. FOLDER keeps what it made: 3
to 6 minutes a seed. All solvers are given the keyframes of KinHEC's own protocol, and the true clock offset.

camviz is behind in a design where the solver of least mean logarithmic error has less than it by more than the noise:
Student's 95 % of the paired differences over the seeds. Sequences of `mixed` are drawn anew with each seed; they count
as one design for each of KinHEC's noise models.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.handeye import hand_eye

OWN_SEED = 20260909
ASK = """
import sys, json, re, pathlib, subprocess
import cv2, numpy as np, kinhec
from kinhec import load_manifest, load_sequence, se3
from kinhec.benchmark import SOLVERS, _keyframe_data
folder, seed = pathlib.Path(sys.argv[1]), sys.argv[2]
tier = (pathlib.Path(kinhec.__file__).parent / "configs" / "smoke.yaml").read_text()
(folder / f"{seed}.yaml").write_text(re.sub(r"global_seed: \\d+", f"global_seed: {seed}", tier))
root = folder / f"tier-{seed}"
words = [sys.executable, "-m", "kinhec", "generate", "--tier", str(folder / f"{seed}.yaml"), "--out", str(root)]
subprocess.run(words, check=True, stdout=sys.stderr)
manifest, kept, told = load_manifest(root), {}, []

def keep(name, solve):
    try:
        kept[name] = np.vstack([solve()[:3], [0, 0, 0, 1]])
    except (cv2.error, ValueError, np.linalg.LinAlgError):
        kept[name] = np.full((4, 4), np.nan)

for place, id in enumerate(manifest.sequence_id):
    sequence = load_sequence(root, id, manifest)
    data = _keyframe_data(sequence, None if sequence.synchronous else sequence.time_offset)
    A, B = data[:2]
    kept |= {f"{id}/A": A, f"{id}/B": B, f"{id}/X": sequence.X}
    rng, boards = np.random.default_rng(place), se3.inverse(B)
    for name, solve in SOLVERS.items():
        keep(f"{id}/est/kinhec {name}", lambda: solve(data, rng)["X"])
    for name in ("TSAI", "PARK", "HORAUD", "ANDREFF", "DANIILIDIS"):
        poses = [list(each) for each in (A[:, :3, :3], A[:, :3, 3], boards[:, :3, :3], boards[:, :3, 3])]
        method = getattr(cv2, "CALIB_HAND_EYE_" + name)
        keep(f"{id}/est/cv {name.lower()}", lambda: np.hstack(cv2.calibrateHandEye(*poses, method=method)))
    m = sequence.manifest
    told.append(dict(id=id, track=m["track"], conf=m["configuration"], cam=m["camera_noise_model"],
                     outl=float(m["outlier_fraction"]), scale=float(m["scale"]), n=len(A)))
np.savez(folder / f"{seed}.npz", meta=json.dumps(told), **kept)
print("kinhec", kinhec.__version__, "OpenCV", cv2.__version__)
"""


@dataclass(frozen=True)
class Result:
    """The errors of X in degrees and millimetres, by solver, in one sequence."""

    told: Mapping[str, Any]
    errors: Mapping[str, tuple[float, float]]

    @property
    def design(self) -> str:
        """What is the same under every seed."""
        if self.told["track"] != "mixed":
            return str(self.told["id"])
        return (
            f"mixed, {self.told['cam']}{', scaled' * (self.told['scale'] != 1)}{', outliers' * (self.told['outl'] > 0)}"
        )


def results(path: Path) -> Iterator[Result]:
    kept = np.load(path)
    for told in json.loads(str(kept["meta"])):
        A, B, X = (kept[f"{told['id']}/{name}"] for name in "ABX")
        start = f"{told['id']}/est/"
        others = {name.removeprefix(start): error(kept[name], X) for name in kept.files if name.startswith(start)}
        yield Result(told, {"camviz": error(ours(told, A, B), X), **others})


def ours(told: Mapping[str, Any], A: Array, B: Array) -> Array:
    """X as KinHEC has it: of the camera on the hand, or else of the board on the hand."""
    to_hand = told["conf"] != "eye_in_hand"
    boards = RigidTransform.from_matrix(B if to_hand else np.linalg.inv(B))
    any_scale = told["scale"] != 1  # which sequences are of a camera without a board is told to every user
    found = hand_eye(RigidTransform.from_matrix(A), boards, eye_to_hand=to_hand, any_scale=any_scale)
    return np.asarray((found.other_from_board if to_hand else found.mount_from_cam).as_matrix())


def error(found: Array, true: Array) -> tuple[float, float]:
    """Degrees and millimetres; those of a solver that gave up, or whose rotation is a reflection, are infinite."""
    if not np.isfinite(found).all() or np.linalg.det(found[:3, :3]) < 0:
        return np.inf, np.inf
    turn = RigidTransform.from_matrix(found).rotation.inv() * RigidTransform.from_matrix(true).rotation
    return float(np.degrees(turn.magnitude())), float(1000 * np.linalg.norm(found[:3, 3] - true[:3, 3]))


def head_to_head(found: Sequence[Result]) -> Iterator[str]:
    """A row for each solver: its median errors, and in what share of the sequences camviz is nearer."""
    yield "| solver | rotation, median | translation, median | camviz is nearer in rotation | in translation |"
    yield "|---|---|---|---|---|"
    errors = {name: np.array([each.errors[name] for each in found]) for name in found[0].errors}
    for name in sorted(errors, key=lambda each: float(np.median(errors[each][:, 1]))):
        turn, shift = np.median(errors[name], axis=0)
        nearer = (errors["camviz"] < errors[name]).mean(axis=0)
        shares = "| | |" if name == "camviz" else f"| {nearer[0]:.0%} | {nearer[1]:.0%} |"
        yield f"| {name} | {turn:.3f}° | {shift:.2f} mm {shares}"


def by_design(found: Sequence[Result]) -> Iterator[str]:
    """Where another solver is nearer to the truth by more than the noise."""
    designs: dict[str, list[Result]] = defaultdict(list)
    for each in found:
        designs[each.design].append(each)
    behind, count = [], 0
    for design, repeated in designs.items():
        lines = [line for part in (0, 1) if (line := nearer(repeated, part))]
        behind += [f"| {design} | {len(repeated)} | {line} |" for line in lines]
        count += bool(lines) * len(repeated)
    yield f"Behind in {count} of {len(found)} sequences ({count / len(found):.0%}), by designs:\n"
    yield "| design | sequences | nearer than camviz |\n|---|---|---|"
    yield from behind


def nearer(repeated: Sequence[Result], part: int) -> str:
    """The solver that is best in one design, if that is surely not camviz; else nothing."""
    names = list(repeated[0].errors)
    logarithms = np.log([[max(each.errors[name][part], 1e-9) for name in names] for each in repeated])
    best = int(np.argmin(logarithms.mean(axis=0)))
    apart = logarithms[:, names.index("camviz")] - logarithms[:, best]
    n, unit = len(repeated), ("°", " mm")[part]
    if names[best] == "camviz" or n < 3:
        return ""
    noise = student.ppf(0.975, n - 1) * apart.std(ddof=1) / np.sqrt(n)
    if apart.mean() <= noise:
        return ""
    theirs, own = (np.median([each.errors[name][part] for each in repeated]) for name in (names[best], "camviz"))
    return f"{names[best]}: {theirs:.3g}{unit} (median), camviz {own:.3g}{unit}"


def main(other: str, folder: Path, seeds: Sequence[int]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    found: list[Result] = []
    for seed in (OWN_SEED, *seeds):
        if not (folder / f"{seed}.npz").exists():
            subprocess.run([other, "-c", ASK, str(folder), str(seed)], check=True)
        found += results(folder / f"{seed}.npz")
        if seed == OWN_SEED:
            print(*head_to_head(found), "", sep="\n", flush=True)
    for track in sorted({each.told["track"] for each in found}):
        print(track, *head_to_head([each for each in found if each.told["track"] == track]), "", sep="\n")
    print(f"All {len(found)} sequences", *head_to_head(found), "", *by_design(found), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), [int(seed) for seed in sys.argv[3:]])
