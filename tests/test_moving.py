"""A rolling shutter is named where rows tell it clearly better than columns and diagonals, and nowhere else."""

import os
from pathlib import Path

import numpy as np
import pytest
from test_files import sample

from camviz_clinic.calibration import calibrate, detect
from camviz_clinic.checks import Inspection, faults
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import moving
from camviz_clinic.checks.findings.moving import motion, rolled
from camviz_clinic.checks.virtual import single
from camviz_clinic.files import Board


def of(set_up, rng):
    """What velocities explain in the solution of a set-up."""
    return motion(Evidence(set_up.solved(set_up.observed(rng))).observed["camera"])


@pytest.mark.thorough
def test_a_shutter_that_moves_corners_by_a_pixel_is_named(thorough):
    """30 px between the first and the last row move corners by a pixel more than poses can follow."""
    named = []
    sets = 8 if thorough else 5
    for seed in range(sets):
        rng = np.random.default_rng(50_000 + seed)
        found = of(rolled.make(rng, single(rng), 30.0), rng)
        if found.pixels >= 1:
            named.append(found.by_rows)
    assert len(named) >= sets / 3
    assert np.mean(named) >= 0.95


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["bending board", "warped board", "lens too rich", "autofocus drift"])
def test_no_other_fault_is_taken_for_a_shutter(name, thorough):
    for seed in range(3 if thorough else 1):
        evidence = faults()[name].inject(np.random.default_rng(300 + seed), faults()[name].promised)
        assert not motion(evidence.observed["camera"]).by_rows


def test_what_is_read_by_columns_is_no_shutter_of_rows(monkeypatch):
    """The same pictures on their side: rows are columns, and the rule finds no rows in them."""
    rng = np.random.default_rng(50_005)
    set_up = rolled.make(rng, single(rng), 30.0)
    solved = set_up.solved(set_up.observed(rng))
    observed = Evidence(solved).observed["camera"]
    assert motion(observed).by_rows
    rows, columns, *diagonals = moving.DIRECTIONS
    monkeypatch.setattr(moving, "DIRECTIONS", (columns, rows, *diagonals))
    turned = motion(observed)
    assert turned.is_there
    assert not turned.by_rows


@pytest.mark.sampled(1)
@pytest.mark.skipif("CAMVIZ_SAMPLES" not in os.environ, reason="needs OpenCV's photographs in CAMVIZ_SAMPLES")
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("finder", ["auto", pytest.param("classic", marks=pytest.mark.thorough)])
def test_photographs_of_a_global_shutter_have_no_rolling_one(side, finder):
    """An F-test calls the same velocities certain (1 in 10^40); columns and diagonals explain as much."""
    pictures = sorted(Path(sample("left01.jpg")).parent.glob(f"{side}*.jpg"))
    corners = detect(pictures, Board(9, 6, 0.025), finder=finder)
    for model in ("standard", "fisheye"):
        found = motion(Evidence(calibrate(corners, Board(9, 6, 0.025), model)).observed["camera"])
        assert found.chance < 1e-6
        assert not found.is_there
        assert found.clearly < 0.02


@pytest.mark.thorough
def test_views_that_differ_are_told_with_their_size_and_no_shutter():
    inspection = Inspection.of(faults()["bending board"].inject(np.random.default_rng(300), 3))
    (finding,) = [each for each in inspection.findings if each.id == "views-differ"]
    assert 0.5 < finding.value < 3
    assert "rolling-shutter" not in {each.id for each in inspection.findings}
