"""A finding in words, without markup: what the text, the JSON, the report and the notebook have in common."""

from __future__ import annotations

from collections import Counter
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


def verdict(findings: Sequence[Finding], checked: Sequence[str], skipped: Sequence[tuple[str, str]]) -> str:
    """One line: the worst finding with its likely cause, or that nothing wrong was found and by how many checks."""
    counts = counted(findings)
    worst = worst_of(findings)
    if worst is None:
        below = f", {counts} below" if findings else ""
        return f"Nothing wrong was found{below}; {len(checked)} checks ran{_lacking(skipped)}."
    cause = f" Likely: {worst.causes[0]}." if worst.causes else ""
    claim = worst.sentence.split(". ")[0].removesuffix(".")
    return f"{counts}: {'the worst, ' * (len(findings) > 1)}{claim}.{cause}"


def worst_of(findings: Sequence[Finding]) -> Finding | None:
    """The worst finding, None where nothing is worse than a note."""
    return next((finding for finding in findings if finding.severity != "note"), None)


def _lacking(skipped: Sequence[tuple[str, str]]) -> str:
    """How many checks could not be made, and the two reasons that most of them have."""
    if not skipped:
        return ""
    (first, _), *others = Counter(why for _, why in skipped).most_common()
    told = f", {len(skipped)} could not because {first}"
    if others:
        told += f", and because {others[0][0]}"
    more = len(others) - 1
    return told + (f" ({more} more reason{'s' * (more > 1)} below)" if more > 0 else "")


def counted(findings: Sequence[Finding]) -> str:
    """How many findings there are of each severity, such as "1 fault, 2 notes"."""
    rated = [finding.severity for finding in findings]
    counts = {severity: rated.count(severity) for severity in SEVERITIES}
    told = ", ".join(f"{count} {severity}{'s' * (count != 1)}" for severity, count in counts.items() if count)
    return told


def made(checked: Sequence[str], skipped: Iterable[tuple[str, str]]) -> Iterator[str]:
    """A sentence about the checks that were made, and one for each reason why others were not."""
    yield f"Checked: {', '.join(checked) or 'nothing'}."
    reasons: dict[str, list[str]] = {}
    for id, why in skipped:
        reasons.setdefault(why, []).append(id)
    for why, ids in reasons.items():
        yield f"Not checked, {why}: {', '.join(ids)}."


def text(
    findings: Sequence[Finding],
    checked: Sequence[str],
    skipped: Sequence[tuple[str, str]],
    then: str = "",
    glance: Sequence[str] = (),
) -> str:
    """The findings, each with its advice below it, a `glance` at the calibration in lines, and what was checked.

    Where nothing is wrong the verdict comes first, with what to do `then`.
    """
    lines = []
    if worst_of(findings) is None:
        lines += [verdict(findings, checked, skipped), *([f"Next: {then}"] if then else []), ""]
    for finding in findings:
        lines.append(f"{heading(finding)} {finding.id}: {finding.sentence}")
        lines += [*(f"    {label}: {said}" for label, said in advice(finding).items()), ""]
    return "\n".join([*lines, *glance, *([""] if glance else []), *made(checked, skipped)])


def tree(finding: Finding) -> dict[str, Any]:
    """The same for programs."""
    values = asdict(finding) | {"causes": list(finding.causes)}
    return {key: values[key] for key in JSON_KEYS}
