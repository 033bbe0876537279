"""A gate: which findings and limits decide whether a calibration passes, and which findings are set aside."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from camviz_clinic.checks.findings import kinds
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.checks.judgement import Check, Judgement
from camviz_clinic.checks.registry import SEVERITIES, Finding

DEFAULT = ("warning",)  # a severity and all worse ones


@dataclass(frozen=True)
class Limit:
    """A number that may not be larger; `what` names it and `lacking` says why a file may not tell it."""

    what: str
    unit: str
    lacking: str


CHANGE = "change-px"  # new pictures tell it, and not a file
LIMITS = {
    "rms-px": Limit("RMS error", "px", "the file does not hold its errors"),
    "expected-error-px": Limit("largest expected error (Max ERE)", "px", "the file holds no corners that determine it"),
    CHANGE: Limit("change since the calibration", "px", "`camviz check` measures it, in new pictures"),
}
"""What can be limited, by the name that files and options have for it."""


@dataclass(frozen=True)
class Gate:
    """What makes a calibration fail, and what does not count.

    Args:
        fail_on: Ids of findings, and severities, which mean themselves and what is worse; "warning" unless given.
        ignore: Ids of findings that are set aside.
        limits: The largest numbers allowed, by the names of LIMITS.
        source: Where it was asked for.

    Raises: UnknownName for what is no finding, severity or limit.

    >>> Gate(("fold",), ignore=("fodl",))
    Traceback (most recent call last):
    camviz_clinic.checks.gate.UnknownName: ignore: expected the id of a finding, got 'fodl'
    """

    fail_on: tuple[str, ...] = DEFAULT
    ignore: tuple[str, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        ids = tuple(kinds())
        refuse_unknown("fail-on", self.fail_on, (*SEVERITIES, *ids), "the id of a finding or a severity")
        refuse_unknown("ignore", self.ignore, ids, "the id of a finding")
        refuse_unknown("limits", self.limits, tuple(LIMITS), "the name of a limit")

    @property
    def asked(self) -> bool:
        """Whether anybody asked for it; the gate that nobody asked for does what an inspection does by itself."""
        return self != Gate()

    def told(self, failed_by: tuple[str, ...]) -> str:
        """The line that says by what the gate is failed, or that it is passed.

        Args:
            failed_by: What decided, a name each.

        Returns: One sentence.
        """
        source = f" ({self.source})" if self.source else ""
        by = ", ".join(failed_by)
        return f"Gate{source}: {f'failed by {by}' if by else 'passed'}."

    def decides(self, finding: Finding) -> bool:
        """Whether a calibration with this finding fails.

        Args:
            finding: What was found.

        Returns: True where `fail_on` has its id, its severity or a milder one.
        """
        return finding.id in self.fail_on or self._decided_by(finding.severity)

    def _decided_by(self, severity: str) -> bool:
        severe = (SEVERITIES.index(name) for name in self.fail_on if name in SEVERITIES)
        return SEVERITIES.index(severity) <= max(severe, default=-1)

    def judge(self, inspection: Inspection) -> Outcome:
        """The inspection without what is ignored, and what decides about it.

        Args:
            inspection: What was found.

        Returns: Whether it passed, and by what it failed.
        """
        seen = inspection.ignoring(self.ignore)
        return Outcome(
            self, seen, tuple(each for each in seen.findings if self.decides(each)), tuple(self._measured(seen))
        )

    def audit(self, check: Check) -> Audit:
        """What decides about a check of a calibration in use: "fail" is as a fault, "warn" as a warning.

        Ids of findings do not concern it.

        Args:
            check: What new pictures say of the calibration.

        Returns: Whether it passed, and by what it failed.
        """
        severity = {"fail": "fault", "warn": "warning"}
        decided = (each for each in check.judgements if each.verdict in severity)
        return Audit(self, check, tuple(each for each in decided if self._decided_by(severity[each.verdict])))

    def _measured(self, inspection: Inspection) -> Iterator[Measured]:
        summary = inspection.summary
        of = {"rms-px": summary.rms, "expected-error-px": summary.largest_error} if summary else {}
        for name, most in self.limits.items():
            if summary is None:
                yield Measured(name, "", most, None)
                continue
            for camera in summary.evidence.cameras:
                value = None if name == CHANGE else of[name](camera)
                yield Measured(name, camera, most, value)


@dataclass(frozen=True)
class Measured:
    """A limit and what a camera has of it; the value is None where the file does not tell it."""

    limit: str
    camera: str
    most: float
    value: float | None

    @property
    def exceeded(self) -> bool:
        """Whether the value is known and not within the limit; NaN is not."""
        return self.value is not None and not self.value <= self.most

    @property
    def sentence(self) -> str:
        """What was measured against the limit."""
        known, of = LIMITS[self.limit], f"{self.camera}: " * bool(self.camera)
        if self.value is None:
            return f"{of}{self.limit} is not checked: {known.lacking}."
        held = "above" if self.exceeded else "within"
        return f"{of}the {known.what} is {self.value:.3g} {known.unit}, {held} the limit of {self.most:g} {known.unit}."


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a gate says of an inspection, which is without what the gate ignores."""

    gate: Gate
    inspection: Inspection
    failing: tuple[Finding, ...]
    measured: tuple[Measured, ...]

    @property
    def passed(self) -> bool:
        """Whether neither a finding nor a limit decides against it."""
        return not self.failed_by

    @property
    def failed_by(self) -> tuple[str, ...]:
        """The ids of the findings, and the names of the limits, that decide against it; each once."""
        names = [each.id for each in self.failing] + [each.limit for each in self.measured if each.exceeded]
        return tuple(dict.fromkeys(names))

    def lines(self) -> Iterator[str]:
        """What the gate says, in lines; nothing where nobody asked for a gate."""
        if not self.gate.asked:
            return
        yield from (each.sentence for each in self.measured)
        yield self.gate.told(self.failed_by)

    def as_tree(self) -> dict[str, Any]:
        """The inspection for programs, and under "gate" what decided."""
        limits = [
            {"name": each.limit, "camera": each.camera or None, "most": each.most, "value": each.value}
            for each in self.measured
        ]
        return self.inspection.as_tree() | {
            "gate": {
                "passed": self.passed,
                "fail_on": list(self.gate.fail_on),
                "ignore": list(self.gate.ignore),
                "failed_by": list(self.failed_by),
                "limits": limits,
            }
        }


@dataclass(frozen=True, eq=False)
class Audit:
    """What a gate says of a check by new pictures: `failing` are the judgements that decide against it."""

    gate: Gate
    check: Check
    failing: tuple[Judgement, ...]

    @property
    def verdict(self) -> str:
        """The check's own, and "pass" where a warning or a failure does not decide."""
        undecided = [each for each in self.check.judgements if each.verdict == "inconclusive"]
        if self.failing:
            return self.check.verdict
        return "inconclusive" if undecided else "pass"

    def lines(self) -> Iterator[str]:
        """What the gate says, in lines; nothing where nobody asked for a gate."""
        if self.gate.asked:
            yield from (f"{name} is not checked: `camviz inspect` does." for name in self.gate.limits if name != CHANGE)
            yield self.gate.told(tuple(f"{each.of} ({each.verdict})" for each in self.failing))

    def as_tree(self) -> dict[str, Any]:
        """The check for programs, and under "gate" what decided."""
        failed_by = list(dict.fromkeys(each.verdict for each in self.failing))
        gate = {"passed": not self.failing, "fail_on": list(self.gate.fail_on), "failed_by": failed_by}
        return self.check.as_tree() | {"gate": gate}


class UnknownName(ValueError):  # noqa: N818 - it is what was said, not what went wrong
    """A name that means nothing; `field` says where it stands, `expected` what would, `known` has those there are."""

    def __init__(self, field: str, name: str, expected: str, known: tuple[str, ...]) -> None:
        super().__init__(f"{field}: expected {expected}, got {name!r}")
        self.field, self.name, self.known = field, name, known


def refuse_unknown(field: str, names: Iterable[str], known: tuple[str, ...], expected: str) -> None:
    """Raises UnknownName for the first name that is not known."""
    for name in names:
        if name not in known:
            raise UnknownName(field, name, expected, known)
