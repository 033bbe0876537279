"""docs/clinic.md: clinic.template.md, what every finding says of itself, and counted tables.

python tools/docs/clinic.py          counts anew and writes the page (half an hour)
python tools/docs/clinic.py --page   writes the page with the tables that it has
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from camviz_clinic.checks.findings import faults, kinds
from camviz_clinic.checks.registry import Fault, Kind
from camviz_clinic.checks.statistics import HEALTHY, REPEATS, Hits, false_alarms, hits
from camviz_clinic.checks.virtual import healthy, healthy_pair

PAGE = Path(__file__).parents[2] / "docs" / "clinic.md"
TEMPLATE = Path(__file__).with_name("clinic.template.md")
TABLES = "<!-- The tables below are counted by: python tools/docs/clinic.py -->"
BELOW = "\n## Standard deviations\n"  # below the tables; by hand


def count_all(progress: Callable[[str], object] = print) -> str:
    """Both tables as Markdown."""
    single, stereo = (false_alarms(make) for make in (healthy, healthy_pair))
    progress(f"healthy: {dict(single)}, {dict(stereo)}")
    rows = []
    for fault in faults().values():
        results = [hits(fault, strength) for strength in fault.strengths]
        progress(f"{fault.name}: {[(each.strength, each.hits, dict(each.others)) for each in results]}")
        rows.append(_row(fault, results))
    return "\n".join([*_healthy_table(single, stereo), "", *_faults_table(rows)]) + "\n"


def _healthy_table(single: Counter[str], stereo: Counter[str]) -> Iterator[str]:
    yield f"### {2 * HEALTHY} healthy calibrations"
    yield ""
    yield (
        f"These are {HEALTHY} cameras and {HEALTHY} pairs at random, of 0.3 to 2 megapixels. "
        "Their lenses are 50° to 70° wide, with barrel to slightly pincushion distortion. The noise is 0.05 to 0.3 px. "
        "There are three boards, and 10 to 20 views. All are solved with the standard model. "
        "Findings worse than a note are counted."
    )
    yield ""
    yield "| finding | false alarms, one camera | false alarms, pair |"
    yield "|---|---|---|"
    for id in kinds():
        yield f"| `{id}` | {single[id]} of {HEALTHY} | {stereo[id]} of {HEALTHY} |"


def _faults_table(rows: list[str]) -> Iterator[str]:
    yield "### Faults"
    yield ""
    yield (
        f"Each fault and strength is put into {REPEATS} set-ups. **Bold** is the strength at which the tests hold that "
        "the fault is named. *Also found* counts, at that strength, what else an inspection names."
    )
    yield ""
    yield "| fault | must be named | strength: named | also found |"
    yield "|---|---|---|---|"
    yield from rows


def _row(fault: Fault, results: list[Hits]) -> str:
    shown = []
    for result in results:
        said = f"{result.strength:g}: {result.hits}/{result.count}"
        shown.append(f"**{said}**" if result.strength == fault.promised else said)
    promised = next(result for result in results if result.strength == fault.promised)
    others = ", ".join(f"`{id}` {count}" for id, count in promised.others.most_common())
    unit = f" [{fault.unit}]" if fault.unit else ""
    return f"| {fault.name}{unit}: {fault.sentence} | `{fault.finding}` | {', '.join(shown)} | {others} |"


def page(tables: str) -> str:
    """docs/clinic.md: what every finding means, then the tables."""
    entries = "\n\n".join(_entry(kind) for kind in kinds().values())
    template = TEMPLATE.read_text(encoding="utf-8")
    return template.replace("{{entries}}", entries).replace("{{tables}}", tables)


def scoreboard(tables: str) -> str:
    """What stands below the counted tables, which counting anew leaves as it is."""
    _, heading, below = tables.partition(BELOW)
    return heading + below


def _entry(kind: Kind) -> str:
    explains = ", ".join(f"`{id}`" for id in kind.explains)
    return (
        f'<a id="{kind.id}"></a>\n### `{kind.id}`\n\n'
        f"**{kind.severity.capitalize()}.** {kind.symptom} View: `{kind.view}`.\n\n"
        f"- Likely: {'; '.join(kind.causes)}.\n"
        f"- Evidence: {kind.evidence}\n"
        f"- Named when: {kind.threshold}\n"
        f"- Remedy: {kind.remedy}" + (f"\n- Explains: {explains}." if explains else "")
    )


def main() -> None:
    """Write docs/clinic.md."""
    tables = PAGE.read_text(encoding="utf-8").split(TABLES)[1].lstrip()
    if "--page" not in sys.argv:
        tables = count_all(lambda line: print(line, flush=True)) + scoreboard(tables)
    PAGE.write_text(page(tables), encoding="utf-8")


if __name__ == "__main__":
    main()
