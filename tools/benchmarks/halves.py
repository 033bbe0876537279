"""How often `split-disagreement` names a camera that changed between the views, and what views as units change.

    python tools/benchmarks/halves.py          20 set-ups of every change, as a Markdown table
    python tools/benchmarks/halves.py N        N set-ups

"noise alone" counts what would be named if corners were the independent units: the focal length changes by 0.3 %, or
two halves differ by a pixel, and noise would show it in one set of a million. "named" is what the clinic names.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from kernel import table

from camviz.cameras import Camera
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.between_views import Drift, Partings
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import kinds
from camviz_clinic.checks.virtual import SetUp, single

SEED = 30_000
Rng = np.random.Generator


def zoomed(by: Callable[[int, Rng], np.ndarray], percent: float, rng: Rng) -> Calibration:
    """A focal length that is longer by so many percent times what `by` says for each view."""
    set_up = single(rng)
    zoom = 1 + percent / 100 * by(len(set_up.cam_from_board), rng)
    set_up = replace(set_up, zoom=zoom)
    return set_up.solved(set_up.observed(rng))


def two_cameras(of: Callable[[int, Rng], np.ndarray], percent: float, rng: Rng) -> Calibration:
    """The views that `of` says are of another camera: focal length and principal point differ by so many percent."""
    set_up = single(rng)
    others = of(len(set_up.cam_from_board), rng) > 0
    corners = np.where(others[:, None, None], _other(set_up, percent, rng).corners[0], set_up.corners[0])
    return set_up.solved((corners + rng.normal(0, set_up.noise, corners.shape),))


def _other(set_up: SetUp, percent: float, rng: Rng) -> SetUp:
    grid, share = set_up.camera.intrinsics, percent / 100
    cx, cy = np.array([grid.cx, grid.cy]) + share * grid.width * rng.choice([-1, 1], 2) * (1, 0.5)
    fx, fy = grid.fx * (1 + share), grid.fy * (1 + share)
    return replace(set_up, cameras=(Camera(replace(grid, fx=fx, fy=fy, cx=cx, cy=cy), set_up.camera.lens),))


def drift(views: int, _: Rng) -> np.ndarray:
    """Evenly from the first view to the last."""
    return np.linspace(-0.5, 0.5, views)


def midway(views: int, _: Rng) -> np.ndarray:
    """From the middle on."""
    return (np.arange(views) >= views // 2).astype(float)


def by_turns(views: int, _: Rng) -> np.ndarray:
    """Every other view."""
    return np.arange(views) % 2.0


def at_random(views: int, rng: Rng) -> np.ndarray:
    """Half of the views, by lot."""
    return (rng.permutation(views) < views // 2).astype(float)


def never(views: int, _: Rng) -> np.ndarray:
    """Nothing changes."""
    return np.zeros(views)


CHANGES: dict[str, tuple[Callable[[float, Rng], Calibration], tuple[float, ...]]] = {
    "healthy": (partial(zoomed, never), (0,)),
    "focus drifts [%]": (partial(zoomed, drift), (0.2, 1, 3, 10)),
    "focus changes midway [%]": (partial(zoomed, midway), (0.5, 1, 3)),
    "focus changes by turns [%]": (partial(zoomed, by_turns), (1, 3)),
    "another camera from midway on [%]": (partial(two_cameras, midway), (0.5, 1, 3)),
    "another camera by turns [%]": (partial(two_cameras, by_turns), (1, 3)),
    "another camera at random [%]": (partial(two_cameras, at_random), (1, 3, 10)),
}


def by_noise_alone(calibration: Calibration) -> bool:
    """Whether it would be named with corners as the units."""
    (observed,) = Evidence(calibration).observed.values()
    return Drift(observed).beyond_noise or bool(Partings.of(observed).beyond_noise)


def named(calibration: Calibration) -> bool:
    """Whether the clinic names it."""
    return bool(list(kinds()["split-disagreement"].check(Evidence(calibration))))


def main(count: int) -> None:
    """Count, and print the table."""
    lines = []
    for change, (make, strengths) in CHANGES.items():
        for strength in strengths:
            made = [make(strength, np.random.default_rng(SEED + number)) for number in range(count)]
            before, after = (sum(map(judge, made)) for judge in (by_noise_alone, named))
            lines.append([f"{change}", f"{strength:g}", f"{before} of {count}", f"{after} of {count}"])
            print(" | ".join(lines[-1]), file=sys.stderr, flush=True)
    print(table(["change", "strength", "noise alone", "named"], lines))


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 20)
