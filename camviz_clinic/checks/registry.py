"""A finding in one place: its name, its words, the check that makes it, and the faults that must lead to it.

A module of `camviz_clinic.checks.findings` declares a kind of finding by decorating its check. What is declared there
is all that an inspection, its words, the report, docs/clinic.md, the fault lab and the statistics need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from inspect import cleandoc
from typing import Any, cast

import numpy as np

from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.virtual import SetUp, single

SEVERITIES = ("fault", "warning", "note")  # the worst first
VIEW_BY_VIEW = ("views-differ", "views-disagree", "outlier-view", "outlier-line", "corners-set-aside")
"""Findings that whatever makes views disagree may lead to: its `explains` begins with them."""

WRONG_NUMBERS = (
    *VIEW_BY_VIEW,
    *("models-differ", "pose-absorbs-error", "model-too-simple", "split-disagreement"),
    *("fold", "near-pole", "inverse-not-converged"),
)
"""What may follow where a file's numbers are not those of its camera."""

Rng = np.random.Generator
STAGES = ("", "set-up", "corners", "solution")


@dataclass(frozen=True)
class Finding:
    """What is wrong, in one plain sentence, with the number that shows it.

    Attributes:
        id: Its kind, one of `camviz_clinic.checks.kinds()`.
        severity: "fault", "warning" or "note".
        sentence: What is wrong.
        value: The number that shows it.
        unit: Of the value.
        camera: The camera's name; None where the finding concerns all of them.
        view: The name of the view that shows it.
        causes: The most likely first.
        remedy: What to do.
        pictures: Indices of the views that it concerns.
        consequence_of: The id of the finding that explains it.
        count: How many findings alike it stands for.
        reach: Pixels: what a cause explains is no more than that off.

    >>> from camviz_clinic.checks import kinds
    >>> finding = kinds()["fold"].found("camera: it folds.", 1.05, "focal lengths", "camera")
    >>> finding.severity, finding.value
    ('fault', 1.05)
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
    consequence_of: str | None = None
    count: int = 1
    reach: float | None = None


@dataclass(frozen=True)
class LabFault:
    """How the fault lab shows a fault: it grows from `none` to `gross`, and `words` name it, with the amount as {0}.

    `spread` gives the options of `spread_boards` for a strength, `set_up` a set-up for a seed, a set-up and an amount.
    """

    gross: float
    words: str
    none: float = 0.0
    spread: Callable[[float], Mapping[str, Any]] | None = None
    set_up: Callable[[int, SetUp, float], SetUp] | None = None
    estimated: tuple[str, ...] = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")

    def amount(self, strength: float) -> float:
        """What a strength of 0 … 1 means, in the unit of the words."""
        return self.none * (1 - strength) + self.gross * strength


@dataclass(frozen=True)
class Fault:
    """A fault that can be put into a virtual calibration, and the id of the finding that must name it.

    `strengths` run from slight to gross in `unit`. From `promised` on, an inspection names the fault. Where the ward
    and the fault lab have it, `beyond_doubt` is the range of strengths of the one, and `lab` tells of the other.

    `make` is what the fault does. It takes random numbers and a strength and gives Evidence, unless a `stage` is
    named:

    - "set-up": it takes random numbers, a set-up and a strength, and gives another set-up.
    - "corners": it takes random numbers, corners, their (rows, columns) and a strength, and changes them in place.
      The solution then sets none of them aside, as most programs set none aside.
    - "solution": it takes an Adjustment and a strength, and gives another Adjustment.
    """

    name: str
    finding: str
    unit: str
    strengths: tuple[float, ...]
    promised: float
    make: Callable[..., Any]
    stage: str = ""
    beyond_doubt: tuple[float, float] | None = None
    lab: LabFault | None = None

    def __post_init__(self) -> None:
        if self.stage not in STAGES:
            raise ValueError(f"stage must be one of {', '.join(map(repr, STAGES))}, got {self.stage!r}")

    @property
    def sentence(self) -> str:
        """What the fault is: the first line of its function's docstring."""
        return cleandoc(self.make.__doc__ or "").split("\n")[0]

    def inject(self, rng: Rng, strength: float) -> Evidence:
        """A random camera or pair with this fault, solved."""
        if not self.stage:
            return cast(Evidence, self.make(rng, strength))
        set_up = single(rng)
        if self.stage == "set-up":
            set_up = self.make(rng, set_up, strength)
        (corners,) = set_up.observed(rng)
        if self.stage == "corners":
            self.make(rng, corners, (set_up.board.rows, set_up.board.columns), strength)
        solved = set_up.solved((corners,), robust=self.stage != "corners")
        if self.stage == "solution":
            best = self.make(Adjustment.of(solved), strength)
            solved = replace(solved, cameras=best.cameras, cam_from_board={"camera": best.first_from_board})
        return Evidence(solved)


@dataclass(frozen=True)
class Kind:
    """What all findings of one id have in common, and the check that makes them.

    `symptom`, `evidence`, `threshold` and `remedy` are sentences, `causes` are phrases, the most likely first. What it
    `explains` are the ids of findings that follow from it in the same camera. The check takes Evidence and gives
    findings; it raises NotChecked where the evidence is missing. Where `asked_of` the evidence gives False, the
    question does not arise, and nobody is told that it was not checked.
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
    explains: tuple[str, ...] = ()
    asked_of: Callable[[Evidence], bool] | None = None

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            raise ValueError(f"severity must be one of {', '.join(SEVERITIES)}, got {self.severity!r}")

    def found(
        self, sentence: str, value: float | None = None, unit: str = "", camera: str | None = None, **more: Any
    ) -> Finding:
        """A finding of this kind; `more` are other fields of Finding, such as a severity milder than most."""
        number = None if value is None else float(value)
        common = {name: getattr(self, name) for name in ("severity", "view", "causes", "remedy")}
        return Finding(self.id, sentence=sentence, value=number, unit=unit, camera=camera, **common | more)

    def of_file(self, error: CalibrationError, unit: str = "") -> Finding:
        """The finding that the reader of a file has noted as an error, with the remedy that the reader knows."""
        own = {"remedy": error.remedy} if error.remedy else {}
        return self.found(f"{error}.", error.value, unit, **own)

    def fault(
        self, name: str, unit: str, strengths: tuple[float, ...], **more: Any
    ) -> Callable[[Callable[..., Any]], Fault]:
        """Declare the decorated function as a Fault of this kind; `more` are the other fields of Fault."""
        return lambda make: Fault(name, self.id, unit, strengths, make=make, **more)


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
