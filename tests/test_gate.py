"""The gate of a project's CI: which findings and limits make a command fail, its options and file, and JUnit's XML."""

import json
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from calibrations import bare, pair
from commandline import refused

from camviz_clinic.checks import Finding, Gate, inspect, kinds
from camviz_clinic.checks.gate import LIMITS, Outcome, UnknownName
from camviz_clinic.checks.virtual import healthy
from camviz_clinic.commands.command import main
from camviz_clinic.commands.gate import given_gate, project_settings
from camviz_clinic.files import load
from camviz_clinic.files.writing import write
from camviz_clinic.report.findings import findings_html
from camviz_clinic.report.junit import junit


def wrong(**pinhole):
    """A healthy camera without corners, with other numbers: fx makes the warning `aspect`, cx `principal-point`."""
    camera = bare().cameras["camera"]
    return replace(bare(), cameras={"camera": replace(camera, intrinsics=replace(camera.intrinsics, **pinhole))})


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A repository with a calibration whose only finding is the warning `aspect`; the command runs in it."""
    (tmp_path / ".git").mkdir()
    write(wrong(fx=1060.0), tmp_path / "camera.yaml", "opencv")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def status(*words):
    return main(["inspect", "camera.yaml", *words])


def ids(inspection):
    return {finding.id for finding in inspection.findings}


# The policy ----------------------------------------------------------------------------------------------------------


def test_without_being_asked_a_gate_passes_what_is_healthy():
    for calibration in (bare(), wrong(fx=1060.0), wrong(cx=500.0)):
        outcome = Gate().judge(inspect(calibration))
        assert outcome.passed == outcome.inspection.healthy
        assert list(outcome.lines()) == []


@pytest.mark.parametrize(
    ("fail_on", "severities"),
    [
        (("fault",), {"fault"}),
        (("warning",), {"fault", "warning"}),
        (("note",), {"fault", "warning", "note"}),
        (("aspect",), set()),
        ((), set()),
    ],
)
def test_a_severity_means_itself_and_what_is_worse(fail_on, severities):
    gate = Gate(fail_on)
    decide = {each for each in ("fault", "warning", "note") if gate.decides(Finding("fold", each, "It folds."))}
    assert decide == severities
    assert gate.decides(Finding("aspect", "note", "Wide.")) == (gate.fail_on in [("note",), ("aspect",)])


def test_what_is_ignored_does_not_explain_and_what_it_explained_stands_alone():
    """A wrong size explains a fold and is as severe; without it the fold is what it was, by itself."""
    size = kinds()["wrong-size"].found("camera: half.", 0.5, "", "camera", severity="warning")
    fold = kinds()["fold"].found("camera: it folds.", 0.7, "", "camera")
    found = replace(inspect(bare()), made=(fold, size)).ignoring(())
    assert [(each.id, each.severity, each.consequence_of) for each in found.findings] == [
        ("wrong-size", "fault", None),
        ("fold", "fault", "wrong-size"),
    ]
    assert found.ignoring({"wrong-size"}).findings == (fold,)
    assert found.ignoring({"wrong-size"}).ignored == (size,)
    assert found.ignoring({"fold"}).findings == (size,)  # no longer as severe as the fold
    assert found.ignoring({"fold"}).ignoring(()).findings == found.findings  # nothing is lost


def test_all_ignored_is_healthy_and_one_line_counts_it():
    found = inspect(wrong(fx=1060.0))
    left = found.ignoring({"aspect"})
    assert (found.healthy, left.healthy) == (False, True)
    assert left.verdict.startswith("No problem found beside what is ignored. ")
    assert "\nIgnored: 1 aspect.\n" in left.as_text()
    assert "Ignored: 1 aspect." in findings_html(left)
    assert "gnored" not in found.as_text() + findings_html(found)
    assert json.loads(left.as_json())["ignored"] == [{"id": "aspect", "count": 1}]


def test_limits_are_held_against_every_camera_and_unknown_numbers_do_not_fail():
    inspection = inspect(pair())
    low, high = sorted(inspection.summary.rms(name) for name in ("left", "right"))
    outcome = Gate((), limits={"rms-px": (low + high) / 2}).judge(inspection)
    assert [each.exceeded for each in outcome.measured].count(True) == 1
    assert (outcome.passed, outcome.failed_by) == (False, ("rms-px",))
    assert Gate((), limits={"rms-px": high}).judge(inspection).passed
    expected = max(inspection.summary.largest_errors.values())
    assert not Gate((), limits={"expected-error-px": 0.99 * expected}).judge(inspection).passed
    unknown = Gate(limits=dict.fromkeys(LIMITS, 0.001)).judge(inspect(bare()))
    assert [each.value for each in unknown.measured] == [None] * len(LIMITS)
    assert unknown.passed
    assert sum("is not checked: the file" in line for line in unknown.lines()) == 2


@pytest.mark.parametrize("wrong", [{"fail_on": ("fodl",)}, {"ignore": ("warning",)}, {"limits": {"rms": 1.0}}])
def test_a_gate_refuses_names_that_mean_nothing(wrong):
    with pytest.raises(UnknownName, match="expected the "):
        Gate(**wrong)


# The options and the file --------------------------------------------------------------------------------------------


def test_the_options_decide_the_status(project, capsys):
    assert status() == 1
    assert status("--fail-on", "fault") == 0
    assert status("--fail-on", "fault,aspect") == 1
    assert status("--ignore", "aspect", "--ignore", "fold") == 0
    capsys.readouterr()
    assert status("--fail-on", "note", "--json") == 1
    gate = json.loads(capsys.readouterr().out)["gate"]
    assert gate == {"passed": False, "fail_on": ["note"], "ignore": [], "failed_by": ["aspect"], "limits": []}


def test_the_nearest_file_holds_and_the_command_line_wins(project, monkeypatch, capsys):
    (project / "pyproject.toml").write_text('[tool.camviz]\nfail-on = ["fault"]\n[tool.camviz.limits]\nrms-px = 2\n')
    assert status() == 0
    assert "Gate (pyproject.toml): passed." in capsys.readouterr().out
    assert status("--fail-on", "warning") == 1
    assert "Gate (pyproject.toml, options): failed by aspect." in capsys.readouterr().out
    (project / "deep" / "er").mkdir(parents=True)
    monkeypatch.chdir(project / "deep" / "er")
    assert main(["inspect", "../../camera.yaml"]) == 0
    (project / "deep" / "camviz.toml").write_text('ignore = ["aspect"]')
    assert main(["inspect", "../../camera.yaml"]) == 0
    options = SimpleNamespace(fail_on=None, ignore=None, limit=[("rms-px", 3.0)])
    assert given_gate(options) == Gate(ignore=("aspect",), limits={"rms-px": 3.0}, source="camviz.toml, options")


def test_beyond_the_repositorys_root_and_outside_of_one_nothing_is_read(project):
    (project / "camviz.toml").write_text("broken")
    inner = project / "module"
    (inner / ".git").mkdir(parents=True)
    (inner / "pyproject.toml").write_text("[tool.other]\ncamviz = 1\n")
    assert project_settings(inner) == (None, {})
    (project / ".git").rmdir()
    (project / "folder").mkdir()
    assert project_settings(project / "folder") == (None, {})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--fail-on", "fodl"],
            "--fail-on: expected the id of a finding or a severity, got 'fodl'; did you mean fold?",
        ),
        (["--ignore", "warning"], "--ignore: expected the id of a finding, got 'warning'"),
        (["--limit", "rms=1"], "--limit: expected the name of a limit, got 'rms'; did you mean rms-px?"),
        (["--limit", "rms-px=-1"], "expected NAME=NUMBER, such as rms-px=0.5"),
        (["--fail-on", ","], "expected names with commas between"),
        (["--junit", "-"], "--junit: expected the name of a file"),
        (["--junit", "camera.yaml"], "would overwrite camera.yaml"),
    ],
)
def test_a_wrong_option_is_refused_in_one_sentence(project, capsys, words, said):
    assert said in refused(capsys, project, "inspect", "camera.yaml", *words)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('fial-on = ["fault"]', "expected the keys fail-on, ignore, limits, got 'fial-on'; did you mean fail-on?"),
        ('ignore = ["fodl"]', "ignore: expected the id of a finding, got 'fodl'; did you mean fold?"),
        ('fail-on = "fault"', "fail-on: expected a list of names"),
        ("[limits]\nrms-px = true", "limits.rms-px: expected a number above 0"),
        ("[limits]\nrms = 1", "limits: expected the name of a limit, got 'rms'; did you mean rms-px?"),
        ("limits = 3", "limits: expected a table of numbers, got 3."),
        ("fail-on", "not valid TOML"),
        ("\xff", "expected text in UTF-8, byte 0 is not."),
    ],
)
def test_a_wrong_file_is_refused_and_named(project, capsys, text, said):
    path = project / "camviz.toml"
    path.write_bytes(text.encode("latin-1"))
    assert (sentence := refused(capsys, project, "inspect", "camera.yaml")).startswith(f"camviz: {path}: ")
    assert said in sentence


@pytest.fixture(scope="module")
def solution():
    """A virtual camera, solved: what `camviz calibrate` has once the corners are found."""
    return healthy(np.random.default_rng(5))


@pytest.mark.parametrize(
    ("words", "expected", "said"),
    [
        ([], 0, ""),
        (["--fail-on", "warning"], 0, "Gate (options): passed."),
        (["--limit", "rms-px=0.001", "--junit", "out.xml"], 1, "Gate (options): failed by rms-px."),
    ],
)
def test_calibrate_writes_first_and_then_the_gate_decides(
    project, monkeypatch, capsys, solution, words, expected, said
):
    monkeypatch.setattr("camviz_clinic.commands.calibrate._single", lambda *_: solution)
    (project / "a.png").touch()
    assert main(["calibrate", "a.png", "--board", "9x6", "--square-mm", "25", "-o", "out.yaml", *words]) == expected
    assert len(load(project / "out.yaml").cameras) == 1
    out = capsys.readouterr().out
    assert said in out
    assert ("Gate" in out) == ("options" in said)
    if "--junit" in words:
        _, cases = parsed((project / "out.xml").read_text(encoding="utf-8"))
        assert ("out.yaml", "fold") in cases


# JUnit ---------------------------------------------------------------------------------------------------------------


def parsed(text):
    root = ElementTree.fromstring(text.encode())
    return root, {(case.get("classname"), case.get("name")): case for case in root.iter("testcase")}


def test_every_check_is_a_testcase_that_passed_failed_or_was_skipped(project):
    assert status("--junit", "out.xml", "--ignore", "principal-point", "--limit", "rms-px=1") == 1
    root, cases = parsed((project / "out.xml").read_text(encoding="utf-8"))
    assert [name for _, name in cases] != []
    asked = {id for id, kind in kinds().items() if not kind.asked_of}  # of one camera, nothing of a rig
    assert {name for _, name in cases} == {*asked, "rms-px camera"}
    (found,) = inspect(wrong(fx=1060.0)).findings
    failure = cases["camera.yaml", "aspect"].find("failure")
    assert failure.get("message") == found.sentence
    assert found.remedy in failure.text
    skipped = cases["camera.yaml", "corner-order"].find("skipped")
    assert skipped.get("message") == "not checked, the file holds one camera, not a pair"
    assert list(cases["camera.yaml", "fold"]) == []
    (suite,) = root
    for element in (root, suite):
        assert element.get("tests") == str(len(cases))
        assert element.get("failures") == str(len(root.findall(".//failure"))) == "1"
    assert suite.get("skipped") == str(len(root.findall(".//skipped")))


def test_what_does_not_decide_is_told_and_what_is_ignored_is_skipped():
    inspection = inspect(wrong(fx=1060.0))
    _, cases = parsed(junit({"a": Gate(("fault",)).judge(inspection), "b": Gate(ignore=("aspect",)).judge(inspection)}))
    assert "fx/fy" in cases["a", "aspect"].find("system-out").text
    assert cases["a", "aspect"].find("failure") is None
    assert cases["b", "aspect"].find("skipped").get("message").startswith("ignored: camera: fx/fy")


def test_any_text_is_valid_xml():
    """Control characters, halves of surrogate pairs and markup, in names, reasons and sentences."""
    evil = "".join(map(chr, range(0x20))) + "\x7f\ud800\udfff\ufffe\uffff<&>\"']]>é😀"
    inspection = inspect(bare())
    finding = Finding("fold", "fault", f"{evil}.", causes=(evil,), remedy=evil)
    held = replace(inspection, findings=(finding,), skipped=(("half-pixel", evil),))
    text = junit({evil: Outcome(Gate(), held, (finding,), ()), "other": evil})
    root, cases = parsed(text)
    shown = "\t\n\r\x7f<&>\"']]>é😀"
    assert root[0].get("name") == shown
    assert cases[shown, "fold"].find("failure").get("message") == f"{shown}."
    assert cases["other", "read"].find("error").get("message") == shown


def test_a_file_that_cannot_be_read_is_an_error_beside_the_others(project, capsys):
    assert main(["inspect", "camera.yaml", "nothing.yaml", "--fail-on", "fault", "--junit", "out.xml"]) == 2
    root, cases = parsed((project / "out.xml").read_text(encoding="utf-8"))
    assert "there is no such file" in cases["nothing.yaml", "read"].find("error").get("message")
    assert [suite.get("name") for suite in root] == ["camera.yaml", "nothing.yaml"]
    assert main(["inspect", "nothing.yaml", "--junit", "alone.xml"]) == 2
    assert parsed((project / "alone.xml").read_text())[0].get("errors") == "1"
    capsys.readouterr()
