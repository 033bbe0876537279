"""How often the clinic is right: false alarms over healthy calibrations, and hits over faults of several strengths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.checks.registry import Fault, Finding

HEALTHY, REPEATS = 120, 12
SEED = 20_000
RATED = ("fault", "warning")  # a note is a fact about a lens, not an alarm


@dataclass(frozen=True)
class Hits:
    """In how many of `count` set-ups a fault of this strength was named, and in how many something else was, too."""

    strength: float
    hits: int
    count: int
    others: Counter[str]


def false_alarms(
    make: Callable[[np.random.Generator], Calibration], count: int = HEALTHY, seed: int = SEED
) -> Counter[str]:
    """In how many of `count` healthy calibrations each id was found, notes left out."""
    found: Counter[str] = Counter()
    for number in range(count):
        evidence = Evidence(make(np.random.default_rng(seed + number)))
        found.update({finding.id for finding in alarms(evidence)})
    return found


def alarms(evidence: Evidence) -> list[Finding]:
    """The findings that are worse than notes."""
    return [finding for finding in Inspection.of(evidence).findings if finding.severity in RATED]


def hits(fault: Fault, strength: float, count: int = REPEATS, seed: int = SEED) -> Hits:
    """How often a fault is named."""
    named, others = 0, Counter[str]()
    for number in range(count):
        evidence = fault.inject(np.random.default_rng(seed + number), strength)
        ids = {finding.id for finding in Inspection.of(evidence).findings}
        named += fault.finding in ids
        others.update(ids - {fault.finding})
    return Hits(strength, named, count, others)
