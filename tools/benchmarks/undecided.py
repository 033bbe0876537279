"""How often `unidentifiable` names what the corners of a set cannot decide, and how often it does so in healthy sets.

    python tools/benchmarks/undecided.py [COUNT [WORDS …]]     a table (default: 50 of each), of kinds with such words

"Named" counts the sets with the finding, a note being one too. "± of the picture" is one standard deviation of the
worst combination in per cent of the picture's longer side, decided or not: median, and least and most; 1 is the limit.
"A corner moves by" is the farthest that any corner moves where the parameters change by 1 % of the picture: median.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from kernel import table

from camviz_clinic.calibration import identifiability
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import faults, kinds
from camviz_clinic.checks.registry import Rng
from camviz_clinic.checks.virtual import healthy, healthy_pair, single

SEED = 40_000
COUNT = 50
EVERY = 1e-9  # of the longer side: combinations that are decided are asked for, too


def few(views: int, rng: Rng) -> Evidence:
    """A healthy camera from so many views."""
    set_up = single(rng, views=views)
    return Evidence(set_up.solved(set_up.observed(rng)))


def sets() -> dict[str, Callable[[Rng], Evidence]]:
    """Healthy sets, then every fault that leads to the finding, by its strengths."""
    made: dict[str, Callable[[Rng], Evidence]] = {
        "healthy cameras": lambda rng: Evidence(healthy(rng)),
        "healthy pairs": lambda rng: Evidence(healthy_pair(rng)),
        **{f"healthy cameras, {views} views": partial(few, views) for views in (5, 3)},
    }
    for fault in faults().values():
        if fault.finding == "unidentifiable" or fault.name == "parallel boards":
            for strength in fault.strengths:
                said = f"{fault.name}, {strength:g} {fault.unit}"
                made[said] = lambda rng, fault=fault, strength=strength: fault.inject(rng, strength)
    return made


def worst(evidence: Evidence) -> tuple[float, float]:
    """One standard deviation of the worst combination, in the limit's unit, and how far a corner moves in pixels."""
    kept, identifiability.UNDECIDED = identifiability.UNDECIDED, EVERY
    try:
        asked = replace(evidence)
        first = [each[0] for name in asked.observed if (each := asked.undecided(name))]
    finally:
        identifiability.UNDECIDED = kept
    most = max(first, key=lambda each: each.deviation)
    return most.deviation * EVERY / kept, most.most * kept / EVERY


def line(name: str, make: Callable[[Rng], Evidence], count: int) -> list[str]:
    """One kind of set in the table."""
    named, severities, deviations, moved = 0, dict.fromkeys(("warning", "note"), 0), [], []
    for number in range(count):
        evidence = make(np.random.default_rng(SEED + number))
        found = list(kinds()["unidentifiable"].check(evidence))
        named += bool(found)
        for each in {each.severity for each in found}:
            severities[each] += 1
        deviation, most = worst(evidence)
        deviations.append(deviation)
        moved.append(most)
    spread = f"{np.median(deviations):.2g} ({min(deviations):.2g} … {max(deviations):.2g})"
    told = [name, f"{named} of {count}", f"{severities['warning']}", spread, f"{np.median(moved):.2g} px"]
    print(" | ".join(told), file=sys.stderr, flush=True)
    return told


def main(arguments: list[str]) -> None:
    """Run what is asked for."""
    cv2.setNumThreads(1)
    count = int(arguments[0]) if arguments else COUNT
    chosen = {name: make for name, make in sets().items() if not arguments[1:] or any(w in name for w in arguments[1:])}
    head = ["virtual sets", "named", "as a warning", "± of the picture, %", "a corner moves by"]
    print(table(head, [line(name, make, count) for name, make in chosen.items()]))


if __name__ == "__main__":
    main(sys.argv[1:])
