"""The page that counts other people's calibrations says what its script has counted, and the script counts right."""

import json
from runpy import run_path

import pytest
import test_gyroflow
from house import ROOT

SCRIPT = run_path(str(ROOT / "tools/benchmarks/profiles.py"))
row, figures, page = SCRIPT["row"], SCRIPT["figures"], SCRIPT["page"]
FOLDS = [-0.5, 0.0, 0.0, 0.0]  # 1 - 1.5 θ² is 0 at 46.8°, and the corner is farther out


@pytest.fixture
def rows(tmp_path):
    """The rows of profiles with changes, in order."""

    def made(*profiles):
        paths = [tmp_path / f"{number}.json" for number in range(len(profiles))]
        for path, changes in zip(paths, profiles, strict=True):
            path.write_text(changes if isinstance(changes, str) else json.dumps(test_gyroflow.profile(**changes)))
        return [row(path) for path in paths]

    return made


def test_the_page_says_what_was_counted():
    """To renew it: python tools/benchmarks/profiles.py FOLDER --commit COMMIT --page"""
    held = json.loads(SCRIPT["FIGURES"].read_text(encoding="utf-8"))
    assert SCRIPT["PAGE"].read_text(encoding="utf-8") == page(held)
    assert held["tracebacks"] == 0
    assert held["files"] == held["read"] + held["refused"]
    assert sum(held["reasons"].values()) == held["refused"]
    assert sum(held["rms"]["histogram"]) == held["rms"]["count"]


def test_a_figure_that_was_not_counted_cannot_be_told():
    held = json.loads(SCRIPT["FIGURES"].read_text(encoding="utf-8"))
    del held["fold"]["limits"]
    with pytest.raises(KeyError, match="limits"):
        page(held)


def test_read_refused_and_broken_files_are_told_apart(rows):
    held = figures(
        rows({}, {"digital_lens": "gopro_superview"}, "[", {"camera_matrix": [[-5, 0, 1], [0, 5, 1], [0, 0, 1]]})
    )
    assert (held["files"], held["read"], held["refused"], held["tracebacks"]) == (4, 1, 3, 0)
    assert held["reasons"]["fisheye_params.camera_matrix: fx must be a positive focal length in pixels, got …"] == 1


def test_what_is_no_sentence_is_counted_as_a_traceback(rows, monkeypatch):
    def broken(path):
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setitem(row.__globals__, "load", broken)
    (only,) = rows({})
    assert only.traceback == "0.json: ZeroDivisionError: float division by zero"


@pytest.mark.parametrize(("limit", "known"), [(None, 0), (0.0, 0), (1.0, 1), (1.06, 1), (1.07, 0), (9.0, 0)])
def test_a_limit_before_the_fold_is_one_that_its_makers_knew(rows, limit, known):
    """θ_d' = 1 - 1.5 θ² is 0 at θ = 0.8165, tan θ = 1.0643."""
    wide = {"camera_matrix": [[1200.0, 0, 1920], [0, 1200.0, 1080], [0, 0, 1]], "distortion_coeffs": FOLDS}
    held = figures(rows({**wide, "radial_distortion_limit": limit}, {"distortion_coeffs": [0.03, 0.0, 0.0, 0.0]}))[
        "fold"
    ]
    assert (held["any"], held["share"], held["faults"], held["limits"]) == (1, "50 %", 1, known)
    assert held["lost_10"] == 1


def test_times_signs_and_rms_are_the_files_own(rows):
    held = figures(
        rows(
            {"frame_readout_time": 16.0, "RMS_error": 0.25},
            {"frame_readout_time": -20.0, "RMS_error": 0.75, "asymmetrical": False},
            {"frame_readout_time": 0.0, "RMS_error": 1.25},
            {"frame_readout_time": None, "RMS_error": 999.0},
        )
    )
    times = held["readout"]
    assert (times["count"], times["not_said"], times["from_the_end"], times["longer_than_a_frame"]) == (2, 2, 1, 1)
    assert (times["p50"], held["rms"]["p50"], held["rms"]["count"]) == (18.0, 0.75, 3)
    assert (held["rms"]["below_half"], held["rms"]["above_one"]) == ("33 %", "33 %")
    assert held["centre"]["asymmetrical"] == 3


def test_no_folder_of_profiles_is_said(tmp_path, capsys):
    with pytest.raises(SystemExit):
        SCRIPT["main"]([str(tmp_path)])
    assert "expected lens profiles (*.json), found none" in capsys.readouterr().err
