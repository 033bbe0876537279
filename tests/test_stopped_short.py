"""A solution that had to stop where its lens folds says so; one that came to its least error does not."""

from dataclasses import replace

import numpy as np
import pytest

from camviz.lenses import KannalaBrandt
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.solving import SHORT, STOPPED_SHORT
from camviz_clinic.checks import kinds
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.assumed import assumed_reading
from camviz_clinic.checks.findings.model import STUCK
from camviz_clinic.checks.virtual import single, spread_boards


def fisheye(seed):
    """The corners that a fisheye of 140° saw, and a set-up to solve them with."""
    rng = np.random.default_rng(seed)
    set_up = single(rng, views=10)
    grid = replace(set_up.camera.intrinsics, fx=0.3 * set_up.camera.intrinsics.width)
    camera = replace(set_up.camera, lens=KannalaBrandt(), intrinsics=replace(grid, fy=grid.fx))
    poses = spread_boards(rng, (camera,), set_up.board, 10, (15, 40))
    set_up = replace(set_up, cameras=(camera,), cam_from_board=poses, noise=0.1)
    return set_up, set_up.observed(rng)


@pytest.fixture(scope="module")
def stuck():
    """A polynomial with k1 alone for that fisheye: it folds where the corners are."""
    set_up, corners = fisheye(4)
    return set_up.solved(corners, fixed=("k2", "k3", "p1", "p2"), robust=False)


def test_a_wrong_model_that_stopped_at_its_fold_says_so(stuck):
    """The least error of the polynomial lies beyond the fold; half a per cent less RMS is in sight and not reached."""
    assert STOPPED_SHORT in stuck.notes
    adjustment = Adjustment.of(stuck)
    assert adjustment.promised > SHORT
    assert adjustment.refined().rms > 0.99 * adjustment.rms


def test_the_finding_about_the_model_says_it_too_and_no_reader_is_blamed(stuck):
    evidence = Evidence(stuck)
    (finding,) = kinds()["model-too-simple"].check(evidence)
    assert finding.sentence.endswith(STUCK)
    assert list(assumed_reading.check(evidence)) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_healthy_solution_is_at_its_least_error(seed):
    rng = np.random.default_rng(seed)
    set_up = single(rng)
    solved = set_up.solved(set_up.observed(rng))
    assert STOPPED_SHORT not in solved.notes
    assert Adjustment.of(solved).promised < 1e-9


def test_a_full_step_promises_what_it_takes_off_where_residuals_are_nearly_linear():
    rng = np.random.default_rng(1)
    set_up = single(rng)
    least = Adjustment.of(set_up.solved(set_up.observed(rng)))
    camera = least.cameras["camera"]
    moved = replace(camera, intrinsics=replace(camera.intrinsics, cx=camera.intrinsics.cx + 0.5))
    off = replace(least, cameras={"camera": moved})
    assert off.promised == pytest.approx(1 - least.sum_of_squares / off.sum_of_squares, rel=1e-3)
