"""A finding in one place: its name, its words, the check that makes it, and the faults that must lead to it.

A module of `camviz.clinic.checks` declares a kind of finding by decorating its check. What is declared there is all
that an inspection, its words, the report, docs/clinic.md, the fault lab and the statistics need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from inspect import cleandoc
from typing import Any

import numpy as np

from camviz.calibration.adjustment import Adjustment
from camviz.clinic.evidence import Evidence
from camviz.clinic.virtual import SetUp
from camviz.lenses.base import Array

SEVERITIES = ("fault", "warning", "note")  # the worst first

Rng = np.random.Generator
Inject = Callable[[Rng, float], Evidence]


@dataclass(frozen=True)
class Finding:
    """What is wrong, in one plain sentence, with the number that shows it.

    `camera` is the camera's name, None where the finding concerns all of them. `pictures` are the indices of the views
    that it concerns. `view` names the view that shows it.
    """

    id: str
    severity: str
    sentence: str
    value: float | None = None
    unit: str = ""
    camera: str | None = None
    view: str = "numbers"
    causes: tuple[str, ...] = ()
    remedy: str = ""
    pictures: tuple[int, ...] = ()


@dataclass(frozen=True)
class LabFault:
    """How the fault lab makes a fault: it grows from `none` to `gross`, and `words` name it, with the amount as {0}.

    The other fields say what is changed on the way from the boards to the solution; only what is given is changed.
    """

    gross: float
    words: str
    none: float = 0.0
    spread: Callable[[float], Mapping[str, Any]] | None = None  # from a strength to options of `spread_boards`
    set_up: Callable[[int, SetUp, float], SetUp] | None = None  # from a seed, the set-up and an amount
    corners: Callable[[Rng, Array, tuple[int, int], float], None] | None = None  # in place, by (rows, columns)
    solution: Callable[[Adjustment, float], Adjustment] | None = None
    estimated: tuple[str, ...] = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")

    def amount(self, strength: float) -> float:
        """What a strength of 0 … 1 means, in the unit of the words."""
        return self.none * (1 - strength) + self.gross * strength


@dataclass(frozen=True)
class Fault:
    """A fault that can be put into a virtual calibration, and the id of the finding that must name it.

    `strengths` run from slight to gross in `unit`. From `promised` on, an inspection names the fault. Where the ward
    and the fault lab have it, `beyond_doubt` is the range of strengths of the one, and `lab` tells of the other.
    """

    name: str
    finding: str
    sentence: str
    unit: str
    strengths: tuple[float, ...]
    promised: float
    inject: Inject
    beyond_doubt: tuple[float, float] | None = None
    lab: LabFault | None = None


@dataclass(frozen=True)
class Kind:
    """What all findings of one id have in common, and the check that makes them.

    `symptom`, `evidence`, `threshold` and `remedy` are sentences, `causes` are phrases. The check takes Evidence and
    gives findings; it raises NotChecked where the evidence is missing.
    """

    id: str
    severity: str
    view: str
    symptom: str
    causes: tuple[str, ...]
    remedy: str
    evidence: str
    threshold: str
    check: Callable[[Evidence], Iterable[Finding]]

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            raise ValueError(f"severity must be one of {', '.join(SEVERITIES)}, got {self.severity!r}")

    def found(
        self,
        sentence: str,
        value: float | None = None,
        unit: str = "",
        camera: str | None = None,
        *,
        severity: str | None = None,
        pictures: tuple[int, ...] = (),
    ) -> Finding:
        """A finding of this kind; `severity` where this one is milder or worse than most."""
        number = None if value is None else float(value)
        rated = severity or self.severity
        return Finding(self.id, rated, sentence, number, unit, camera, self.view, self.causes, self.remedy, pictures)

    def fault(self, name: str, unit: str, strengths: tuple[float, ...], **more: Any) -> Callable[[Inject], Fault]:
        """Declare the decorated function as a Fault of this kind, whose sentence is the first line of its docstring.

        `more` are the other fields of Fault.
        """
        return lambda inject: Fault(
            name, self.id, cleandoc(inject.__doc__ or "").split("\n")[0], unit, strengths, inject=inject, **more
        )


def finding(id: str, **words: Any) -> Callable[[Callable[[Evidence], Iterable[Finding]]], Kind]:
    """Declare the decorated check as a Kind of finding; its docstring tells the evidence, `words` are the other fields.

    >>> @finding(
    ...     "portrait",
    ...     severity="note",
    ...     view="numbers",
    ...     symptom="The image is higher than wide.",
    ...     causes=("a camera on its side",),
    ...     remedy="Turn the camera.",
    ...     threshold="The height is more than the width.",
    ... )
    ... def portrait(evidence):
    ...     "The check reads the image size."
    ...     for name, camera in evidence.cameras.items():
    ...         if camera.intrinsics.height > camera.intrinsics.width:
    ...             yield portrait.found(f"{name}: the image is higher than wide.", camera=name)
    >>> portrait.evidence
    'The check reads the image size.'
    """
    return lambda check: Kind(id, check=check, evidence=" ".join((check.__doc__ or "").split()), **words)
