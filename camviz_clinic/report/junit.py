"""Inspections as JUnit XML, which GitHub's actions, GitLab and Jenkins show as tests.

There is no standard. What is written is what all three read (junit-10.xsd of Jenkins' xunit plugin): a testsuite for
each file and in it a testcase for each check and limit. Jenkins keeps one failure of a testcase, so all findings of a
check are in one. GitLab tells tests apart by classname and name, so the file is in classname.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree

from camviz_clinic.checks import words
from camviz_clinic.checks.gate import Audit, Measured, Outcome
from camviz_clinic.checks.judgement import Judgement
from camviz_clinic.checks.registry import Finding

NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 has no place for, not even escaped (section 2.2, Char)."""

Case = tuple[str, str, str, str]  # name; failure, error, skipped, system-out or ""; its message; its text


def junit(outcomes: Mapping[str, Outcome | Audit | str]) -> str:
    """The XML of what a gate says of files, by their names; in place of an Outcome, why a file cannot be read."""
    root = ElementTree.Element("testsuites", name="camviz")
    for file, outcome in outcomes.items():
        suite = ElementTree.SubElement(root, "testsuite", name=_clean(file))
        cases = list(_all_cases(outcome))
        for case in cases:
            _add(suite, file, case)
        if isinstance(outcome, Outcome):
            ElementTree.SubElement(suite, "system-out").text = _clean(outcome.inspection.verdict)
        _count(suite, [kind for _, kind, _, _ in cases])
    for key in ("tests", "failures", "errors"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in root)))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _all_cases(outcome: Outcome | Audit | str) -> Iterator[Case]:
    if isinstance(outcome, str):
        yield "read", "error", outcome, ""
    elif isinstance(outcome, Audit):
        yield from (_judged(each, outcome) for each in outcome.check.judgements)
    else:
        yield from _cases(outcome)


def _judged(judgement: Judgement, audit: Audit) -> Case:
    """A camera or a pair that new pictures judge: failed where that decides, an error where they cannot tell."""
    told = "\n".join([f"{judgement.verdict}: {judgement.reason}", judgement.settle, *judgement.facts])
    kind = "failure" if judgement in audit.failing else "error" if judgement.verdict == "inconclusive" else "system-out"
    return f"check {judgement.of}", kind, judgement.reason * (kind != "system-out"), told


def _cases(outcome: Outcome) -> Iterator[Case]:
    """A case for each check that ran, each limit, and each check that could not be made."""
    inspection = outcome.inspection
    for id in inspection.checked:
        yield _case(id, outcome)
    for each in outcome.measured:
        yield _limit(each)
    for id, why in inspection.skipped:
        yield id, "skipped", f"not checked, {why}", ""


def _case(id: str, outcome: Outcome) -> Case:
    """Failed by the findings that decide; skipped where its findings are ignored; else passed, with what was found."""
    failing = [each for each in outcome.failing if each.id == id]
    found = [each for each in outcome.inspection.findings if each.id == id]
    ignored = [each for each in outcome.inspection.ignored if each.id == id]
    if failing:
        return id, "failure", " ".join(each.sentence for each in failing), "\n\n".join(map(_told, found))
    if ignored:
        return id, "skipped", f"ignored: {' '.join(each.sentence for each in ignored)}", ""
    return id, "system-out" if found else "", "", "\n\n".join(map(_told, found))


def _told(finding: Finding) -> str:
    """A finding with its advice, in lines."""
    lines = [f"{finding.severity}: {finding.sentence}"]
    lines += [f"follows from {finding.consequence_of}"] if finding.consequence_of else []
    lines += [f"{label}: {said}" for label, said in words.advice(finding).items()]
    return "\n".join(lines)


def _limit(measured: Measured) -> Case:
    name = f"{measured.limit} {measured.camera}".strip()
    kind = "failure" if measured.exceeded else "skipped" if measured.value is None else "system-out"
    return (name, kind, "", measured.sentence) if kind == "system-out" else (name, kind, measured.sentence, "")


def _add(suite: ElementTree.Element, file: str, case: Case) -> None:
    name, kind, message, text = case
    element = ElementTree.SubElement(suite, "testcase", name=_clean(name), classname=_clean(file))
    if kind:
        inner = ElementTree.SubElement(element, kind)
        if message:
            inner.set("message", _clean(message))
        if kind in ("failure", "error"):
            inner.set("type", kind)
        inner.text = _clean(text) or None


def _count(suite: ElementTree.Element, kinds: list[str]) -> None:
    suite.set("tests", str(len(kinds)))
    for key, kind in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(key, str(kinds.count(kind)))


def _clean(text: str) -> str:
    """The text without control characters and halves of surrogate pairs."""
    return NOT_XML.sub("", text)
