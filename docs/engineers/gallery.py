"""The reports of gallery.md: `python docs/engineers/gallery.py FOLDER` writes each as HTML, its picture, and an index.

The calibrations are virtual, their faults those of camviz_clinic/checks/findings, as strong as the clinic is sure to
name.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from camviz.draw.page import document
from camviz_clinic.checks import faults
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.checks.virtual import healthy, healthy_pair
from camviz_clinic.report.inspection import write_report
from camviz_clinic.views.catalogue import ALIASES, VIEWS, Case

SITE = "https://camviz.github.io/camviz/engineers/reports/"
PAGE = Path(__file__).with_suffix(".md")
HEAD = """\
# A gallery of reports

<!-- Made by: python docs/engineers/gallery.py -->

These are pages as `camviz inspect FILE --report report.html` writes them: first healthy calibrations, then sick ones
with one fault each, whose truth is known. The links lead to the site. To have them on your own machine:

```
python docs/engineers/gallery.py reports
```

| report | finding | what to see |
|---|---|---|
"""


@dataclass(frozen=True)
class Patient:
    """One report: the file's name, what to see in it, and the fault of the clinic's, at `strength`; none is healthy."""

    name: str
    title: str
    see: str
    fault: str | None = None
    strength: float | None = None
    make: Callable[[np.random.Generator], object] = healthy
    seed: int = 18

    @property
    def finding(self) -> str | None:
        return faults()[self.fault].finding if self.fault else None

    def inspection(self) -> Inspection:
        rng = np.random.default_rng(self.seed)
        if self.fault is None:
            return Inspection.of(Evidence(self.make(rng)))
        fault = faults()[self.fault]
        return Inspection.of(fault.inject(rng, self.strength or fault.promised))


HEALTHY_VIEW = "residual-vectors"
NARROW = 700  # picture units: wider panels have words that are too small in a table


def picture(patient: Patient, inspection: Inspection) -> str:
    """A panel of the view that shows the finding, as an SVG document: one that can be read when it is small."""
    found = [finding for finding in inspection.findings if finding.id == patient.finding]
    name, camera = (found[0].view, found[0].camera or "") if found else (HEALTHY_VIEW, "")
    calibration = inspection.calibration
    assert calibration is not None  # all patients can be read
    shown = VIEWS[ALIASES.get(name, name)].view(Case(calibration), camera).figure()
    boards = [tile for tile in shown.tiles if tile.name == "the board"]
    narrow = [tile for tile in shown.tiles if tile.cell[2] <= NARROW]
    tile = (boards + narrow + list(shown.tiles))[0]
    return shown.document(tile).replace("--shown:100vw", "--shown:calc(1px * var(--w))")  # its words shrink with it


PATIENTS = (
    Patient("healthy", "A healthy camera", "Residuals point every way, and corners reach every part of the image."),
    Patient("pair", "A healthy pair", "The error of a depth grows with the square of its distance.", make=healthy_pair),
    Patient("fold", "A polynomial that folds", "Beyond the drawn line two rays share a pixel.", "folding polynomial"),
    Patient(
        "pole", "A rational model near a pole", "The ring where the denominator is near 0.", "near-pole rational model"
    ),
    Patient("blurred", "A blurred view", "One bar stands far above the others.", "blurred view"),
    Patient(
        "column",
        "A column of corners off",
        "In one view the arrows of one column point the same way.",
        "column off",
        0.5,
    ),
    Patient("middle", "Boards in the middle only", "The border is empty, and uncertain.", "boards in the middle"),
    Patient(
        "parallel", "Parallel boards", "The focal length goes with the distance of the boards.", "parallel boards", 3.0
    ),
    Patient(
        "moved-centre", "A low RMS and a wrong centre", "Held-out corners tell what the fit hides.", "moved centre"
    ),
    Patient(
        "simple", "A lens with too few terms", "The residuals turn with the distance from the middle.", "lens too rich"
    ),
    Patient("warped", "A board that is not flat", "The residuals are bowed across the board.", "warped board", 2.0),
    Patient("focus", "Autofocus", "Two halves of the views give two cameras.", "autofocus drift", 3.0),
    Patient("shutter", "A rolling shutter", "Each view is sheared along its motion.", "rolling shutter"),
    Patient("millimetres", "Millimetres for metres", "A baseline of tens of metres.", "square in millimetres"),
    Patient("order", "Corners in the other order", "One camera's corners run the other way.", "order flipped"),
)


def page() -> str:
    """gallery.md."""
    rows = (f"| [{each.title}]({SITE}{each.name}.html) | {_link(each.finding)} | {each.see} |\n" for each in PATIENTS)
    return HEAD + "".join(rows)


def _link(finding: str | None) -> str:
    return f"[`{finding}`](../clinic.md#{finding})" if finding else "no finding"


def write(folder: Path) -> None:
    """The reports and index.html."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in PATIENTS:
        inspection = each.inspection()
        write_report(inspection, folder / f"{each.name}.html")
        (folder / f"{each.name}.svg").write_text(picture(each, inspection), encoding="utf-8")
    items = (f'<li><a href="{each.name}.html">{escape(each.title)}</a>: {escape(each.see)}</li>' for each in PATIENTS)
    (folder / "index.html").write_text(document("A gallery of reports", f"<ul>{''.join(items)}</ul>"), encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:]:
        write(Path(sys.argv[1]))
    else:
        PAGE.write_text(page(), encoding="utf-8")
