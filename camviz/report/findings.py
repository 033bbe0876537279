"""The findings as HTML, for the report and for a notebook: it needs no style sheet."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

from camviz.clinic import words
from camviz.clinic.inspection import Inspection
from camviz.clinic.registry import Finding
from camviz.views.clinic.catalogue import title_of

_COLOURS = {"fault": "#c2185b", "warning": "#c05300", "note": "#5b6577"}


def findings_html(inspection: Inspection, see: Callable[[Finding], str] | None = None) -> str:
    """The findings and, folded away, what was checked; `see` says as HTML where a finding is shown."""
    items = "".join(_item(finding, see(finding) if see else _view(finding)) for finding in inspection.findings)
    listed = f'<ol class="findings" style="list-style:none;padding:0">{items}</ol>' if items else ""
    checks = "".join(f"<li>{escape(said)}</li>" for said in words.made(inspection.checked, inspection.skipped))
    counted = f"{len(inspection.checked)} checks made, {len(inspection.skipped)} not"
    return f"{listed}<details><summary>{counted}</summary><ul>{checks}</ul></details>"


def _item(finding: Finding, where: str) -> str:
    number = words.number(finding)
    shown = f' (<data value="{finding.value!r}">{escape(number)}</data>)' if number else ""
    camera = f" <b>{escape(finding.camera)}</b>" if finding.camera else ""
    advice = "".join(f"<br><i>{label}</i>: {escape(said)}" for label, said in words.advice(finding).items())
    colour = _COLOURS[finding.severity]
    return (
        f'<li class="{finding.severity}" style="border-left:5px solid {colour};padding-left:.9em;margin:0 0 1em">'
        f"<strong>{words.heading(finding)}</strong> <code>{escape(finding.id)}</code>{camera}: "
        f"{escape(finding.sentence)}{shown} {where}{advice}</li>"
    )


def _view(finding: Finding) -> str:
    return f"→ {escape(title_of(finding.view))}"
