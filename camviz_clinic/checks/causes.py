"""What explains what: every finding under the one that brought it about, and many alike as one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from camviz_clinic.checks.registry import SEVERITIES, Finding, Kind

MOST_ALIKE = 3  # findings of one kind that are told one by one
MOST_NAMED = 8


def by_causes(findings: Iterable[Finding], kinds: Mapping[str, Kind]) -> tuple[Finding, ...]:
    """The causes, the worst first, each followed by its consequences, which name it and have its remedy.

    A cause is as severe as the worst of its consequences. `Kind.explains` says what may follow from what; a note
    explains nothing. Of two that explain each other, the larger is the cause.
    """
    found = sorted(together(findings), key=_rank)
    owners = {id(each): _owner(each, found, kinds, set()) for each in found}
    told: list[list[Finding]] = []
    for cause in found:
        if owners[id(cause)] is not None:
            continue
        owned = [each for each in found if owners[id(each)] is cause]
        severity = min((each.severity for each in (cause, *owned)), key=SEVERITIES.index)
        follow = [replace(each, causes=cause.causes, remedy=cause.remedy, consequence_of=cause.id) for each in owned]
        told.append([replace(cause, severity=severity), *follow])
    told.sort(key=lambda group: (_rank(group[0]), -len(group)))
    return tuple(each for group in told for each in group)


def _rank(finding: Finding) -> int:
    return SEVERITIES.index(finding.severity)


def _owner(finding: Finding, found: list[Finding], kinds: Mapping[str, Kind], seen: set[int]) -> Finding | None:
    """The last cause that explains a finding, by way of others; None where nothing does."""
    for cause in found:
        if id(cause) not in seen and _explains(cause, finding, kinds):
            last = _owner(cause, found, kinds, seen | {id(finding), id(cause)}) or cause
            if not _beyond(last, finding):
                return last
    return None


def _explains(cause: Finding, finding: Finding, kinds: Mapping[str, Kind]) -> bool:
    if cause.severity == "note" or finding.id not in kinds[cause.id].explains:
        return False
    if None not in (cause.camera, finding.camera) and cause.camera != finding.camera:
        return False
    if cause.pictures and finding.pictures and not set(cause.pictures) & set(finding.pictures):
        return False
    return cause.id not in kinds[finding.id].explains or (cause.value or 0) > (finding.value or 0)


def _beyond(cause: Finding, finding: Finding) -> bool:
    """Whether a finding is farther off than its cause reaches."""
    return cause.reach is not None and finding.unit == "px" and (finding.value or 0) > cause.reach


def together(findings: Iterable[Finding]) -> list[Finding]:
    """Where more than three findings of one kind and severity say the same of several cameras, frames or pictures, the
    worst of them speaks for all.
    """
    alike: dict[tuple[str, str], list[Finding]] = {}
    for each in findings:
        alike.setdefault((each.id, each.severity), []).append(each)
    return [each for group in alike.values() for each in (group if len(group) <= MOST_ALIKE else [_as_one(group)])]


def _as_one(group: list[Finding]) -> Finding:
    worst = max(group, key=lambda each: abs(each.value or 0))
    others = [each.sentence.split(": ")[0] for each in group if each is not worst]
    named = ", ".join(others[:MOST_NAMED]) + ", …" * (len(others) > MOST_NAMED)
    cameras = {each.camera for each in group}
    pictures = tuple(sorted({view for each in group for view in each.pictures})) if len(cameras) == 1 else ()
    sentence = f"{worst.sentence} The same is found {len(others)} times more: {named}."
    camera = worst.camera if len(cameras) == 1 else None
    return replace(worst, sentence=sentence, camera=camera, pictures=pictures, count=len(group))
