"""A finding that a stranger adds is one file, and everything that tells of findings tells of it."""

import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

from camviz_clinic.checks import Inspection, faults, findings, inspect, kinds, statistics
from camviz_clinic.checks.virtual import healthy
from camviz_clinic.commands.command import main
from camviz_clinic.report.inspection import report
from camviz_clinic.report.notebook import inspect as inspect_in_a_notebook
from camviz_school.views.ward import Patient, reply

DATA = Path(__file__).parent / "data"
CLINIC = run_path(str(Path(__file__).parents[1] / "tools/docs/clinic.py"))
TOY = '''
"""A toy: cameras that see in portrait format."""

from dataclasses import replace

from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.registry import finding
from camviz_clinic.checks.virtual import alone, healthy


@finding(
    "portrait",
    severity="warning",
    view="numbers",
    symptom="The image is higher than wide.",
    causes=("a camera that was turned on its side",),
    remedy="Turn the camera back.",
    threshold="The height is more than the width.",
)
def portrait(evidence):
    """The check reads the image size."""
    for name, camera in evidence.cameras.items():
        grid = camera.intrinsics
        if grid.height > grid.width:
            sentence = f"{name}: the image is {grid.width}×{grid.height}."
            yield portrait.found(sentence, grid.height / grid.width, "times", name)


@portrait.fault("camera on its side", "quarters", (1,), promised=1)
def on_its_side(rng, strength):
    """The image is turned by so many quarters."""
    solved = healthy(rng)
    camera = solved.cameras["camera"]
    grid = camera.intrinsics
    turned = replace(grid, width=grid.height, height=grid.width, fx=grid.fy, fy=grid.fx, cx=grid.cy, cy=grid.cx)
    return Evidence(alone(solved, replace(camera, intrinsics=turned)))
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of one's own, with the one file in it."""
    (tmp_path / "turned.py").write_text(TOY, encoding="utf-8")
    monkeypatch.setattr(findings, "__path__", [*findings.__path__, str(tmp_path)])
    yield tmp_path
    sys.modules.pop("camviz_clinic.checks.findings.turned", None)


@pytest.fixture
def sick(folder):
    """A calibration that has what the toy finds."""
    return faults()["camera on its side"].inject(np.random.default_rng(1), 1).calibration


def test_without_the_file_nobody_knows_of_it():
    assert "portrait" not in kinds()
    assert "camera on its side" not in faults()


def test_one_file_makes_a_finding_that_comes_after_all_others(folder):
    assert [path.name for path in folder.iterdir() if path.is_file()] == ["turned.py"]
    assert list(kinds())[-1] == "portrait"
    assert list(faults())[-1] == "camera on its side"
    assert len(kinds()) == 49


def test_text_and_json_tell_of_it(sick):
    inspection = inspect(sick)
    assert [finding.id for finding in inspection.findings] == ["portrait"]
    text = inspection.as_text()
    assert text.startswith("Most likely a camera that was turned on its side: turn the camera back.\n")
    assert "\n! warning portrait: camera: the image is " in text
    assert "    likely: a camera that was turned on its side.\n    remedy: Turn the camera back.\n" in text
    (told,) = json.loads(inspection.as_json())["findings"]
    assert (told["id"], told["severity"], told["remedy"]) == ("portrait", "warning", "Turn the camera back.")
    assert told["value"] == sick.cameras["camera"].intrinsics.height / sick.cameras["camera"].intrinsics.width


def test_the_command_checks_for_it(folder, capsys):
    assert main(["inspect", str(DATA / "ros_file.yaml")]) == 0
    assert "corner-order" in (said := capsys.readouterr().out)
    assert ", portrait." in said.split("Checked: ")[1].split("\n")[0]


def test_the_report_and_the_notebook_show_it(sick, monkeypatch):
    shown = []
    monkeypatch.setattr("camviz_clinic.report.notebook.display", lambda what, **_: shown.append(what))
    inspect_in_a_notebook(sick)._ipython_display_()
    for html in (report(inspect(sick)), shown[0]["text/html"]):
        assert "<code>portrait</code>" in html
        assert "Turn the camera back." in html


def test_the_page_and_the_statistics_have_a_row_for_it(folder):
    page = CLINIC["page"]("")
    assert '<a id="portrait"></a>' in page
    assert "- Named when: The height is more than the width.\n" in page
    assert "| `portrait` | 3 of 120 | 0 of 120 |" in CLINIC["_healthy_table"](Counter(portrait=3), Counter())
    toy = faults()["camera on its side"]
    counted = statistics.hits(toy, 1, count=2)
    assert counted.hits == 2
    row = CLINIC["_row"](toy, [counted])
    assert row.startswith("| camera on its side [quarters]: The image is turned by so many quarters. | `portrait` |")
    assert "**1: 2/2**" in row
    assert statistics.false_alarms(healthy, count=2)["portrait"] == 0


def test_the_ward_knows_its_name(folder):
    patient = Patient("Patient 1", "", Inspection, "fold")
    assert "portrait" in reply(patient, "flu", 1).message


def test_a_declaration_that_cannot_be_is_refused_in_words():
    kind = kinds()["fold"]
    with pytest.raises(ValueError, match="severity must be one of fault, warning, note, got 'alarm'"):
        replace(kind, severity="alarm")
    with pytest.raises(ValueError, match="stage must be one of '', 'set-up', 'corners', 'solution', got 'scene'"):
        kind.fault("toy", "px", (1,), promised=1, stage="scene")(lambda rng, strength: None)


def test_every_check_and_every_fault_needs_nothing_that_draws():
    """The modules that declare are found when they are asked for, not when the clinic is imported."""
    code = "import sys; from camviz_clinic.checks import faults, kinds, statistics, words; kinds(), faults(); "
    code += "print(*{'matplotlib', 'ipywidgets', 'pyvista', 'vtkmodules', 'IPython', 'camviz.views'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
