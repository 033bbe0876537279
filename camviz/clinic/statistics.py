"""How often the clinic is right: false alarms over healthy calibrations, and hits over faults of several strengths.

python -m camviz.clinic.statistics          counts anew and writes docs/clinic.md (half an hour)
python -m camviz.clinic.statistics --page   writes docs/clinic.md with the tables that it has
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camviz.calibration.types import Calibration
from camviz.clinic.checks import faults, kinds
from camviz.clinic.evidence import Evidence
from camviz.clinic.inspection import Inspection
from camviz.clinic.registry import Fault, Finding, Kind
from camviz.clinic.virtual import healthy, healthy_pair

PAGE = Path(__file__).parents[2] / "docs" / "clinic.md"
TABLES = "<!-- The tables below are counted by: python -m camviz.clinic.statistics -->"
HEALTHY, REPEATS = 120, 12
SEED = 20_000
RATED = ("fault", "warning")  # a note is a fact about a lens, not an alarm


@dataclass(frozen=True)
class Hits:
    """In how many of `count` set-ups a fault of this strength was named, and in how many something else was, too."""

    strength: float
    hits: int
    count: int
    others: Counter[str]


def false_alarms(
    make: Callable[[np.random.Generator], Calibration], count: int = HEALTHY, seed: int = SEED
) -> Counter[str]:
    """In how many of `count` healthy calibrations each id was found, notes left out."""
    found: Counter[str] = Counter()
    for number in range(count):
        evidence = Evidence(make(np.random.default_rng(seed + number)))
        found.update({finding.id for finding in alarms(evidence)})
    return found


def alarms(evidence: Evidence) -> list[Finding]:
    """The findings that are worse than notes."""
    return [finding for finding in Inspection.of(evidence).findings if finding.severity in RATED]


def hits(fault: Fault, strength: float, count: int = REPEATS, seed: int = SEED) -> Hits:
    """How often a fault is named."""
    named, others = 0, Counter[str]()
    for number in range(count):
        evidence = fault.inject(np.random.default_rng(seed + number), strength)
        ids = {finding.id for finding in Inspection.of(evidence).findings}
        named += fault.finding in ids
        others.update(ids - {fault.finding})
    return Hits(strength, named, count, others)


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
    return f"{HEAD}\n{entries}\n\n{MIDDLE}\n{TABLES}\n\n{tables}"


def _entry(kind: Kind) -> str:
    return (
        f'<a id="{kind.id}"></a>\n### `{kind.id}`\n\n'
        f"**{kind.severity.capitalize()}.** {kind.symptom} View: `{kind.view}`.\n\n"
        f"- Likely: {'; '.join(kind.causes)}.\n"
        f"- Evidence: {kind.evidence}\n"
        f"- Named when: {kind.threshold}\n"
        f"- Remedy: {kind.remedy}"
    )


HEAD = """\
# The clinic

<!-- Made from camviz/clinic/checks by: python -m camviz.clinic.statistics --page -->

`camviz inspect FILE` and `camviz.inspect(camviz.load(path))` say what is wrong with a calibration. Every finding has a
stable id, one sentence, the number that shows it, the view that shows it, its likely causes and a remedy.

The clinic does not guess. A check whose evidence the file does not hold is listed as not made, with the reason. The
command `camviz calibrate` writes files that hold all of it: corners, poses of the board, what was estimated and how
well. With `--images` and `--board` the corners are looked for in pictures. `--compare` holds a second calibration of
the same cameras beside the first.

A *fault* makes the calibration wrong. A *warning* makes it doubtful. A *note* is something to know when it is used.
The exit status of `camviz inspect` is 0 when nothing is worse than a note, 1 when something is, and 2 when a file
cannot be read.

With `--json` the output is `{"cameras": [{name, model, width, height, fx, fy, cx, cy, distortion, rms}], "findings":
[{id, severity, sentence, value, unit, camera, view, causes, remedy}], "checked": [id, …], "skipped": [{id, why}]}`.
Of several files it is a list of these, each with its `file`.

## The report in ten seconds

`camviz inspect FILE --report page.html`, `camviz calibrate … --report page.html` and a notebook's
`camviz.inspect(calibration)` begin alike. The terminal has the same words.

- **The verdict.** The worst finding and its likely cause; or "Nothing wrong was found", how many checks ran, how many
  could not and why. That is an answer, not a want of data.
- **Next.** The worst finding's remedy. Where nothing is wrong, how to hold the board for the picture that would help
  most, or that nothing needs doing: every corner of the image is then known to 1 px.
- **The file.** Its date is that of the file on this disk. Pictures used of those given: one that was skipped, or whose
  corners were all set aside, was not used.
- **The numbers, each ± one standard deviation.** From the covariance in the file, or else from its corners. The RMS is
  over the corners used. The uncertainty is that of the pixel at which a far point is seen, at the centre of the image
  and in its worst corner. It is the corners' noise alone: a lens that the model cannot describe is off by more.
- **Notes.** How many corners were set aside, and in which pictures.

Each bar of "Residuals, view by view" is as high as the RMS written on it: blue over the corners used, pale red with
those that were set aside. A bar of more than ten times the median is cut, with a break and its number.

A bare `calibration` as the last line of a notebook's cell shows the same table and a still picture. Views show
photographs where their folder is named: `--images FOLDER`, or `camviz.inspect(calibration).explore(images=FOLDER)`.

## Findings
"""
MIDDLE = """\
## How often it is right

Where the theory of least squares gives the chance of a false alarm, the threshold is that chance. It is one in a
million for every F- and χ²-test: `model-too-simple`, `board-warp`, `split-disagreement`, and the rolling shutter of
`pose-absorbs-error`. It is one in ten thousand for a whole set of views with few corners (`outlier-view`).

The chance holds for independent Gaussian noise, and real corners are neither. In a large set, every small error of a
real lens is also beyond chance. So each threshold has a least effect beside it, which decides in practice. Rules about
the numbers of a file have no chance in them.

No alarm in 120 means a rate below 2.5 % with 95 % confidence (1 - 0.05^(1/120)).
"""


def main() -> None:
    """Write docs/clinic.md."""
    if "--page" in sys.argv:
        tables = PAGE.read_text(encoding="utf-8").split(TABLES)[1].lstrip()
    else:
        tables = count_all(lambda line: print(line, flush=True))
    PAGE.write_text(page(tables), encoding="utf-8")


if __name__ == "__main__":
    main()
