"""A finding in words, without markup: what the text, the JSON, the report and the notebook have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from camviz_clinic.checks.accuracy import UNREAD, Accuracy
from camviz_clinic.checks.registry import SEVERITIES, Finding

JSON_KEYS = (
    *("id", "severity", "sentence", "value", "unit", "camera", "view", "causes", "remedy", "consequence_of", "count"),
)
MARKS = {"fault": "✗", "warning": "!", "note": "·"}


def heading(finding: Finding) -> str:
    """The mark and the word of its severity."""
    return f"{MARKS[finding.severity]} {finding.severity}"


def number(finding: Finding) -> str:
    """The number that shows it, with its unit; empty where there is none."""
    return "" if finding.value is None else f"{finding.value:.4g} {finding.unit}".strip()


def advice(finding: Finding) -> dict[str, str]:
    """What it comes from and what to do, each under its label; of a consequence nothing, for its cause has said it."""
    if finding.consequence_of:
        return {}
    causes = f"{'; '.join(finding.causes)}." if finding.causes else ""
    return {label: said for label, said in (("likely", causes), ("remedy", finding.remedy)) if said}


def groups(findings: Sequence[Finding]) -> Iterator[tuple[Finding, list[Finding]]]:
    """Every cause with its consequences, which come after it."""
    told: list[tuple[Finding, list[Finding]]] = []
    for finding in findings:
        if finding.consequence_of and told:
            told[-1][1].append(finding)
        else:
            told.append((finding, []))
    return iter(told)


def verdict(
    findings: Sequence[Finding],
    checked: Sequence[str],
    skipped: Sequence[tuple[str, str]],
    ignored: Sequence[Finding] = (),
    accuracy: Accuracy = UNREAD,
) -> str:
    """The most likely cause and what to do now; or what the calibration is good for, and by how many checks.

    It says that no problem was found only where the accuracy is sufficient, or where the file does not tell it.
    """
    worst = worst_of(findings)
    if worst is None:
        below = f", {counted(findings)} below" if findings else ""
        ran = f"{len(checked)} checks ran{_lacking(skipped)}."
        if accuracy.sufficient is False:
            return f"{accuracy.sentence} {f'{counted(findings)} below; ' * bool(findings)}{ran}"
        found = f"No problem found{' beside what is ignored' * bool(ignored)}{below}"
        if accuracy.sufficient:
            return f"{accuracy.sentence} {found}; {ran}"
        return f"{found}. {accuracy.sentence} {ran}" if accuracy.sentence else f"{found}; {ran}"
    do = worst.remedy.split(". ")[0].removesuffix(".")
    return f"Most likely {worst.causes[0]}: {do[0].lower()}{do[1:]}."


def claim(findings: Sequence[Finding]) -> str:
    """How many findings there are, and what the worst says; empty where nothing is worse than a note."""
    worst = worst_of(findings)
    if worst is None:
        return ""
    said = worst.sentence.split(". ")[0].removesuffix(".")
    return f"{counted(findings)}: {'the worst, ' * (len(findings) > 1)}{said}."


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
    """How many causes there are of each severity, and their consequences: "1 fault, 2 notes; 3 consequences"."""
    rated = [finding.severity for finding in findings if not finding.consequence_of]
    counts = {severity: rated.count(severity) for severity in SEVERITIES}
    told = ", ".join(f"{count} {severity}{'s' * (count != 1)}" for severity, count in counts.items() if count)
    follow = len(findings) - len(rated)
    return told + (f" and {follow} consequence{'s' * (follow != 1)}" if follow else "")


def count_of_each(findings: Iterable[Finding]) -> dict[str, int]:
    """How many findings of each id there are."""
    counts: Counter[str] = Counter()
    for each in findings:
        counts[each.id] += each.count
    return dict(counts)


def made(checked: Sequence[str], skipped: Iterable[tuple[str, str]], ignored: Iterable[Finding] = ()) -> Iterator[str]:
    """A sentence about what was found and is ignored, one about the checks that were made, and one for each reason why
    others were not.
    """
    if counts := count_of_each(ignored):
        yield f"Ignored: {', '.join(f'{count} {id}' for id, count in counts.items())}."
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
    ignored: Sequence[Finding] = (),
    accuracy: Accuracy = UNREAD,
) -> str:
    """The verdict, the findings with their advice and consequences below them, a `glance` at the calibration in lines,
    and what was checked. Where nothing is wrong the verdict is followed by what to do `then`.
    """
    lines = [verdict(findings, checked, skipped, ignored, accuracy), *([f"Next: {then}"] if then else []), ""]
    for cause, consequences in groups(findings):
        lines.append(f"{heading(cause)} {cause.id}: {cause.sentence}")
        lines += [f"    {label}: {said}" for label, said in advice(cause).items()]
        lines += [f"    → {heading(each)} {each.id}: {each.sentence}" for each in consequences]
        lines.append("")
    return "\n".join([*lines, *glance, *([""] if glance else []), *made(checked, skipped, ignored)])


def tree(finding: Finding) -> dict[str, Any]:
    """The same for programs."""
    values = asdict(finding) | {"causes": list(finding.causes)}
    return {key: values[key] for key in JSON_KEYS}
