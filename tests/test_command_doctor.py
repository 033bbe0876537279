"""The doctor sees what this machine has, and what is missing."""

import json
import os
import subprocess
import sys
import types
from pathlib import Path

import pytest
from commandline import run
from packaging.requirements import Requirement

from camviz_clinic.commands import entry
from camviz_clinic.commands.command import main
from camviz_school.commands import machine as doctor


def test_a_package_is_held_against_its_range():
    assert doctor.package(Requirement("numpy>=1")).status == "ok"
    old = doctor.package(Requirement("numpy>=999"))
    assert old.status == "missing"
    assert old.remedy == "pip install 'numpy>=999'"
    absent = doctor.package(Requirement("no-such-package-here>=1"), "lab")
    assert (absent.status, absent.detail) == ("warn", "not installed")


def test_the_requirements_are_those_of_the_project():
    listed = {(extra, requirement.name.casefold()) for extra, requirement in doctor.requirements()}
    assert {("", "numpy"), ("", "pyyaml"), ("lab", "jupyterlab")} <= listed
    assert "pytest" not in {name for _, name in listed}


@pytest.mark.parametrize(("asked", "status"), [("wire", "ok"), ("solid", "ok"), ("", "ok"), ("wired", "warn")])
def test_an_unknown_renderer_is_noticed(monkeypatch, asked, status):
    monkeypatch.setenv("CAMVIZ_RENDERER", asked)
    assert doctor.renderer().status == status


def test_widgets_that_jupyterlab_does_not_find_are_noticed(tmp_path):
    (tmp_path / "anywidget").mkdir()
    assert doctor._widget("anywidget", "anywidget", [str(tmp_path)], False).status == "warn"
    (tmp_path / "anywidget" / "package.json").write_text("{}")
    assert doctor._widget("anywidget", "anywidget", [str(tmp_path)], False).status == "ok"
    assert "enable" in doctor._widget("anywidget", "anywidget", [str(tmp_path)], True).remedy


def test_missing_samples_are_a_warning_not_a_fault(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMVIZ_SAMPLES", str(tmp_path))
    monkeypatch.setattr("camviz_school.samples._pooch", lambda: types.SimpleNamespace(path=tmp_path))
    monkeypatch.setattr("camviz_school.samples.BASE_URL", "http://127.0.0.1:9/")
    finding = doctor.samples()
    assert (finding.status, finding.detail[:7]) == ("warn", "0 of 30")


def test_the_report_is_the_same_for_people_and_programs(monkeypatch, capsys):
    findings = [doctor.python(), doctor.ReportLine("rope", "missing", "none", "buy one")]
    monkeypatch.setattr(doctor, "examine", lambda: findings)
    assert main(["doctor"]) == 3
    assert "→ buy one" in capsys.readouterr().out
    assert main(["doctor", "--json"]) == 3
    report = json.loads(capsys.readouterr().out)
    assert (report["ok"], report["findings"][1]["remedy"]) == (False, "buy one")


def test_the_doctor_examines_this_machine():
    """All of it, as a person runs it; nothing that these tests run on is missing."""
    result = run("doctor", "--json")
    report = json.loads(result.stdout)
    assert (result.returncode, report["ok"], result.stderr) == (0, True, "")
    names = {finding["name"] for finding in report["findings"]}
    assert {"Python", "numpy", "OpenGL", "memory", "sample data", "widgets: anywidget"} <= names
    assert all(finding["remedy"] or finding["status"] == "ok" for finding in report["findings"])


def test_another_projects_camviz_in_place_of_this_one_is_one_sentence(tmp_path):
    """As TRI's: a package of the name that comes first on the path, and has nothing that this one needs."""
    (tmp_path / "camviz").mkdir()
    (tmp_path / "camviz/__init__.py").write_text("def objects(): ...\n")
    here = str(Path(entry.__file__).parents[2])
    program = "import sys; from camviz_clinic.commands.entry import main; sys.exit(main())"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), here])}
    done = subprocess.run(
        [sys.executable, "-c", program, "doctor"],
        capture_output=True,
        text=True,
        env=environment,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 3
    expected = (
        f"camviz: another project's package of the same name is imported, {tmp_path / 'camviz'}: {entry.REMEDY}.\n"
    )
    assert (done.stdout, done.stderr) == ("", expected)


def test_the_doctor_knows_a_package_of_the_same_name(monkeypatch):
    assert (doctor.namesake().status, entry.other_package()) == ("ok", "")
    monkeypatch.setattr(entry, "packages_distributions", lambda: {"camviz": ["camviz", "tri-camviz"], "numpy": ["x"]})
    assert (doctor.namesake().status, doctor.namesake().detail) == ("warn", "tri-camviz has a package of the same name")
    assert "python -m venv" in doctor.namesake().remedy
    monkeypatch.setattr(entry, "OURS", Path("/elsewhere/camviz"))
    assert doctor.namesake().status == "missing"


def test_the_command_begins_where_the_package_is_looked_for():
    text = (Path(entry.__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    assert 'camviz = "camviz_clinic.commands.entry:main"' in text
