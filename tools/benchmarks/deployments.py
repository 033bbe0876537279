"""How often `camviz check` is right: 198 virtual deployments of which the truth is known.

    python tools/benchmarks/deployments.py [SHARE]        SHARE of them, such as 0.1 (default: 1, about fifteen minutes)

A camera is calibrated from 15 to 25 views. Then it is left as it was (healthy), knocked (its principal point moves, its
sensor tilts), focused anew (the focal length and k1 change), or its pictures are resized. 15 to 40 new views of the
board are judged, or too few of them (thin). The noise of corners is 0.05 to 0.3 px, pictures have 0.3 to 2 megapixels.

"By N px" is the RMS displacement of far points over the image that no turn of the whole camera makes up for. It is
measured by `camviz_clinic.calibration.difference`, which the check does not use. Prints the table of docs/clinic.md.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.difference import difference
from camviz_clinic.checks import Check, check
from camviz_clinic.checks.virtual import SetUp, detections, pair, single, spread_boards

Rng = np.random.Generator
VERDICTS = ("pass", "warn", "inconclusive", "fail")
SEED = 31_000


@dataclass(frozen=True)
class Deployment:
    """What was done, by how many pixels the calibration is off in truth, and what the check says."""

    kind: str
    strength: float
    off: float
    check: Check


def off_by(one: Camera, other: Camera) -> float:
    """RMS px over the image, a turn taken out."""
    return float(np.sqrt(np.nanmean(difference(one, other, within=inf).length ** 2)))


def knocked(rng: Rng, camera: Camera) -> Callable[[float], Camera]:
    """The principal point moves to some side, or the sensor tilts to some side, by any amount."""
    angle, tilts = rng.uniform(0, 2 * np.pi), bool(rng.integers(2))
    across, down = np.cos(angle), np.sin(angle)
    grid, lens = camera.intrinsics, camera.lens

    def by(amount: float) -> Camera:
        if tilts:
            return replace(camera, lens=replace(lens, tau_x=0.01 * amount * across, tau_y=0.01 * amount * down))
        shifted = replace(grid, cx=grid.cx + 5 * amount * across, cy=grid.cy + 5 * amount * down)
        return replace(camera, intrinsics=shifted)

    return by


def refocused(rng: Rng, camera: Camera) -> Callable[[float], Camera]:
    """The focal length grows or shrinks, and k1 a little with it."""
    grid, lens, sign = camera.intrinsics, camera.lens, rng.choice([-1, 1])

    def by(amount: float) -> Camera:
        zoom = 1 + 0.002 * sign * amount
        return replace(
            camera,
            intrinsics=replace(grid, fx=zoom * grid.fx, fy=zoom * grid.fy),
            lens=replace(lens, k1=lens.k1 * zoom**2),
        )

    return by


def changed_by(change: Callable[[float], Camera], pixels: float) -> Camera:
    """The camera that is changed by so many pixels."""
    low, high = 0.0, 1.0
    original = change(0.0)
    while off_by(original, change(high)) < pixels:
        high *= 2
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if off_by(original, change(middle)) < pixels else (low, middle)
    return change(high)


def seen_by(rng: Rng, before: SetUp, camera: Camera, views: int, window: float = 1.0) -> Detections:
    """New views of the board by a camera."""
    poses = spread_boards(rng, (camera,), before.board, views, (15, 40), window)
    after = replace(before, cameras=(camera,), cam_from_board=poses)
    return detections(camera, after.observed(rng)[0])


def deployment(kind: str, strength: float, number: int) -> Deployment:
    """One deployment of a kind, by its number."""
    rng = np.random.default_rng([SEED, number])
    before = single(rng, views=int(rng.integers(15, 26)))
    calibration = before.solved(before.observed(rng))
    camera, views, window = before.camera, int(rng.integers(15, 41)), 1.0
    if kind == "knocked":
        camera = changed_by(knocked(rng, camera), strength)
    elif kind == "refocused":
        camera = changed_by(refocused(rng, camera), strength)
    elif kind == "resized":
        grid = camera.intrinsics
        camera = replace(camera, intrinsics=grid.resized(round(grid.width * strength), round(grid.height * strength)))
    elif kind == "thin":  # two views, four views, boards in the middle alone
        views, window = ((2, 1.0), (4, 1.0), (20, 0.5))[int(strength)]
    truth = off_by(calibration.cameras["camera"], camera) if kind != "resized" else float("nan")
    found = seen_by(rng, before, camera, views, window)
    return Deployment(kind, strength, truth, check(calibration, found, before.board))


PLAN = (
    *(("healthy", 0.0) for _ in range(60)),
    *(("knocked", px) for px in (0.2, 0.5, 1.0, 1.5, 2.0) for _ in range(10)),
    *(("refocused", px) for px in (0.2, 0.5, 1.0, 1.5, 2.0) for _ in range(8)),
    *(("resized", times) for times in (0.5, 2.0) for _ in range(10)),
    *(("thin", way) for way in (0, 1, 2) for _ in range(10)),
)


def deployments(share: float = 1.0) -> Iterator[Deployment]:
    """All 198, or an even share of them."""
    step = max(1, round(1 / share))
    for number in range(0, len(PLAN), step):
        yield deployment(*PLAN[number], number)


def pair_deployment(number: int, turn_px: float) -> tuple[str, float]:
    """The verdict on a pair whose right camera was turned in its mount by so many pixels, and its rows' error."""
    rng = np.random.default_rng([SEED, 1, number])
    before = pair(rng, views=20)
    calibration = before.solved(before.observed(rng))
    left, right = before.cameras
    angle = turn_px / right.intrinsics.fx
    turned = right.at(right.world_from_cam * RigidTransform.from_rotation(Rotation.from_rotvec([angle, 0, 0])))
    poses = spread_boards(rng, (left, turned), before.board, 20, (15, 40))
    after = replace(before, cameras=(left, turned), cam_from_board=poses)
    found = {name: detections(left, seen) for name, seen in zip(("left", "right"), after.observed(rng), strict=True)}
    judged = check(calibration, found, before.board).judgements[-1]
    return judged.verdict, float(judged.numbers["rows_px"]["change"])


def main() -> None:
    """Print the tables."""
    share = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    counts: dict[tuple[str, float], Counter[str]] = {}
    for each in deployments(share):
        counts.setdefault((each.kind, each.strength), Counter())[each.check.verdict] += 1
        numbers = each.check.worst.numbers
        bounds = " ".join(f"{numbers[key]:.2f}" for key in ("least_px", "change_px", "most_px") if key in numbers)
        print(f"{each.kind} {each.strength:g}: off {each.off:.2f}, {bounds} {each.check.worst.reason}", flush=True)
    print("\n| deployment | by | pass | warn | inconclusive | fail |\n|---|---|---|---|---|---|")
    for (kind, strength), said in counts.items():
        print(f"| {kind} | {strength:g} | " + " | ".join(str(said[verdict]) for verdict in VERDICTS) + " |")
    for turn in (0.0, 0.3, 1.0, 2.0):
        pairs = [pair_deployment(number, turn) for number in range(max(1, round(10 * share)))]
        rows = ", ".join(f"{row:.2f}" for _, row in pairs)
        print(f"pair turned by {turn:g} px: {dict(Counter(verdict for verdict, _ in pairs))}, rows {rows}")


if __name__ == "__main__":
    main()
