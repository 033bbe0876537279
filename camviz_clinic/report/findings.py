"""The verdict, the findings and the numbers as HTML, for the report and for a notebook: it needs no style sheet."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

from camviz_clinic.checks import words
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.checks.registry import Finding
from camviz_clinic.checks.summary import LEGEND, Summary
from camviz_clinic.views.catalogue import title_of

_COLOURS = {"fault": "#c2185b", "warning": "#c05300", "note": "#5b6577"}
_HEALTHY = "#00785a"


def verdict_html(inspection: Inspection) -> str:
    """The likely cause and what to do in one line, what shows it in another, and the calibration at a glance."""
    return said_html(inspection) + (glance_html(inspection.summary, inspection.healthy) if inspection.summary else "")


def said_html(inspection: Inspection) -> str:
    """The likely cause and what to do in one line, and what shows it in another."""
    worst = words.worst_of(inspection.findings)
    colour = _COLOURS[worst.severity] if worst else _HEALTHY if inspection.sufficient else _COLOURS["warning"]
    said = f'<p class="verdict" style="border-left:5px solid {colour};padding-left:.9em">'
    said += f"<strong>{escape(inspection.verdict)}</strong>"
    said += f"<br>{escape(words.claim(inspection.findings))}" if worst else ""
    said += f"<br><b>Next:</b> {escape(inspection.next_step)}" if inspection.next_step else ""
    compared = "".join(f"<p>{escape(each)}</p>" for each in inspection.compared)
    return f"{compared}{said}</p>"


def glance_html(summary: Summary, below_verdict: bool = False) -> str:
    """Where a calibration comes from, its numbers with their ± σ in a table, and the file's notes.

    `below_verdict` leaves out what a verdict without findings has said.
    """
    table = summary.table()
    rows = list(dict.fromkeys(row for column in table.values() for row in column))
    cell = 'style="text-align:left;padding:.1em 1.2em .1em 0"'
    head = "".join(f"<th {cell}>{escape(name)}</th>" for name in table)
    body = "".join(
        f"<tr><th {cell}>{row}</th>"
        + "".join(f"<td {cell}>{escape(column.get(row, ''))}</td>" for column in table.values())
        + "</tr>"
        for row in rows
    )
    more = len(summary.evidence.cameras) - len(table)
    few = f"<p>The first {len(table)} of {len(table) + more} cameras.</p>" if more else ""
    sentences = summary.worth if below_verdict else (each.sentence for each in summary.task)
    task = "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)
    holds = "".join(f"<p>{escape(sentence)}</p>" for sentence in summary.holds)
    said = (*summary.withheld, *summary.calibration.notes)
    notes = "".join(f'<p class="note">{escape(note)}</p>' for note in said)
    return (
        f'<p class="origin">{escape(" · ".join(summary.origin))}</p>{holds}<div class="scroll" style="overflow-x:auto">'
        f'<table class="glance"><tr><td></td>{head}</tr>{body}</table></div>{few}<p>{LEGEND}</p>{task}{notes}'
    )


def findings_html(inspection: Inspection, see: Callable[[Finding], str] | None = None) -> str:
    """The findings and, folded away, what was checked; `see` says as HTML where a finding is shown."""
    where = see or _view
    items = "".join(
        _item(cause, where, "".join(_item(each, where) for each in consequences))
        for cause, consequences in words.groups(inspection.findings)
    )
    listed = f'<ol class="findings" style="list-style:none;padding:0">{items}</ol>' if items else ""
    told = words.made(inspection.checked, inspection.skipped, inspection.ignored)
    checks = "".join(f"<li>{escape(said)}</li>" for said in told)
    counted = f"{len(inspection.checked)} checks made, {len(inspection.skipped)} not"
    counted += f", {ignored} findings ignored" if (ignored := sum(each.count for each in inspection.ignored)) else ""
    return f"{listed}<details><summary>{counted}</summary><ul>{checks}</ul></details>"


def _item(finding: Finding, where: Callable[[Finding], str], consequences: str = "") -> str:
    number = words.number(finding)
    shown = f' (<data value="{finding.value!r}">{escape(number)}</data>)' if number else ""
    advice = "".join(f"<br><i>{label}</i>: {escape(said)}" for label, said in words.advice(finding).items())
    below = f'<ol class="consequences" style="list-style:none;margin-top:.5em">{consequences}</ol>'
    colour = _COLOURS[finding.severity]
    return (
        f'<li class="{finding.severity}" style="border-left:5px solid {colour};padding-left:.9em;margin:0 0 1em">'
        f"<strong>{words.heading(finding)}</strong> <code>{escape(finding.id)}</code>: "
        f"{escape(finding.sentence)}{shown} {where(finding)}{advice}"
        f"{'<br><i>it explains</i>:' + below if consequences else ''}</li>"
    )


def _view(finding: Finding) -> str:
    return f"→ {escape(title_of(finding.view))}"
