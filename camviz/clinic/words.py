"""A finding in words, without markup: what the text, the JSON, the report and the notebook have in common."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from camviz.clinic.registry import SEVERITIES, Finding

JSON_KEYS = ("id", "severity", "sentence", "value", "unit", "camera", "view", "causes", "remedy")
MARKS = {"fault": "✗", "warning": "!", "note": "·"}


def heading(finding: Finding) -> str:
    """The mark and the word of its severity."""
    return f"{MARKS[finding.severity]} {finding.severity}"


def number(finding: Finding) -> str:
    """The number that shows it, with its unit; empty where there is none."""
    return "" if finding.value is None else f"{finding.value:.4g} {finding.unit}".strip()


def advice(finding: Finding) -> dict[str, str]:
    """What it comes from and what to do, each under its label."""
    causes = f"{'; '.join(finding.causes)}." if finding.causes else ""
    return {label: said for label, said in (("likely", causes), ("remedy", finding.remedy)) if said}


def verdict(findings: Sequence[Finding]) -> str:
    """How many findings there are of each severity, such as "1 fault, 2 notes"."""
    rated = [finding.severity for finding in findings]
    counts = {severity: rated.count(severity) for severity in SEVERITIES}
    told = ", ".join(f"{count} {severity}{'s' * (count != 1)}" for severity, count in counts.items() if count)
    return told or "Nothing found"


def made(checked: Sequence[str], skipped: Iterable[tuple[str, str]]) -> Iterator[str]:
    """A sentence about the checks that were made, and one for each reason why others were not."""
    yield f"Checked: {', '.join(checked) or 'nothing'}."
    reasons: dict[str, list[str]] = {}
    for id, why in skipped:
        reasons.setdefault(why, []).append(id)
    for why, ids in reasons.items():
        yield f"Not checked, {why}: {', '.join(ids)}."


def text(findings: Sequence[Finding], checked: Sequence[str], skipped: Iterable[tuple[str, str]]) -> str:
    """The findings, each with its advice below it, and what was checked."""
    lines = []
    for finding in findings:
        lines.append(f"{heading(finding)} {finding.id}: {finding.sentence}")
        lines += [*(f"    {label}: {said}" for label, said in advice(finding).items()), ""]
    return "\n".join([*(lines or [f"{verdict(findings)}.", ""]), *made(checked, skipped)])


def tree(finding: Finding) -> dict[str, Any]:
    """The same for programs."""
    values = asdict(finding) | {"causes": list(finding.causes)}
    return {key: values[key] for key in JSON_KEYS}
