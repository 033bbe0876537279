"""A change of the camera between its views is told from views that scatter: views, not corners, are the units."""

from dataclasses import replace

import numpy as np
import pytest
from boards import BOARD, CAMERA, board_poses, noisy, truth
from scipy.stats import kstest

from camviz.lenses.base import Array
from camviz_clinic.checks.between_views import BY_SCATTER, Drift, Partings
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import kinds
from camviz_clinic.checks.observed import Observed
from camviz_clinic.checks.view_by_view import ViewByView
from camviz_clinic.checks.virtual import single

SIGMA = 0.2
VIEWS = 12
EARLIER = np.arange(VIEWS) < VIEWS // 2


def healthy(seed):
    """Twelve views with independent noise, solved."""
    rng = np.random.default_rng(seed)
    return noisy(truth(board_poses(rng, VIEWS)), rng, SIGMA).refined()


def paper(seed, px=3.0):
    """The corners of a sheet that is bent differently in every view, by so many pixels, and each view's bend."""
    rng = np.random.default_rng(seed)
    problem = truth(board_poses(rng, VIEWS))
    across = (np.arange(54) % 9 - 4) / 4
    bend: Array = rng.normal(0, px, VIEWS)[:, None, None] * np.stack([across**2, across], axis=-1)
    corners = problem.detections["camera"] + bend + rng.normal(0, SIGMA, problem.detections["camera"].shape)
    return replace(problem, detections={"camera": corners}).refined()


def zoomed(by, seed=20_003):
    """The only camera of a set whose views have these focal lengths, as the clinic sees it."""
    rng = np.random.default_rng(seed)
    set_up = single(rng, views=VIEWS)
    set_up = replace(set_up, zoom=by)
    return Evidence(set_up.solved(set_up.observed(rng)))


def named(evidence):
    return list(kinds()["split-disagreement"].check(evidence))


def test_what_two_cameras_take_off_the_squares_is_what_two_solutions_do():
    """The reckoning is linear; the two halves solved by themselves are not."""
    for seed in range(4):
        solved = healthy(seed)
        parts = sum(solved.only(part).refined().sum_of_squares for part in (EARLIER, ~EARLIER))
        fallen = ViewByView.of(solved)._between(EARLIER[None])[0]
        assert fallen == pytest.approx(solved.sum_of_squares - parts, rel=0.03)


@pytest.mark.thorough
def test_the_chance_is_uniform_where_nothing_but_noise_is_at_work():
    found = [ViewByView.of(healthy(seed)).chance(EARLIER) for seed in range(40)]
    assert kstest(found, "uniform").pvalue > 1e-3


@pytest.mark.thorough
def test_a_board_that_bends_as_it_is_held_is_no_change_of_the_camera():
    """Noise does not explain how the halves differ. The scatter of the views does."""
    for seed in (100, 101, 102):
        observed = Observed("camera", paper(seed))
        partings = Partings.of(observed)
        assert partings.beyond_noise
        assert not Drift(observed).certain
        assert partings.certain == []


@pytest.mark.thorough
def test_the_rank_among_partings_by_lot_is_uniform_where_the_f_test_is_not():
    """The bend weighs on some parameters more than on others, so the scatter is not that of more noise."""
    views = [ViewByView.of(paper(seed)) for seed in range(100, 130)]
    assert kstest([each.larger(EARLIER) for each in views], "uniform").pvalue > 1e-3
    assert kstest([each.chance(EARLIER) for each in views], "uniform").pvalue < 1e-3


@pytest.mark.parametrize(
    ("by", "said"),
    [
        (1 + 0.04 * np.linspace(-0.5, 0.5, VIEWS), "the focal length grows by 3.9"),
        (np.where(EARLIER, 1, 1.03), "the earlier and from the later"),
        (np.where(np.arange(VIEWS) % 2, 1, 1.03), "solved from every other view"),
    ],
)
def test_focus_that_drifts_or_changes_midway_or_by_turns_is_named(by, said):
    (finding,) = named(zoomed(by))
    assert said in finding.sentence


def test_the_deviation_of_a_drift_is_that_of_a_regression_on_the_views():
    """Focal lengths that hunt by 1 % from view to view: σ = 1 % / √Σt² for t from -1/2 to 1/2, where noise is small."""
    time = np.linspace(-0.5, 0.5, VIEWS)
    foretold, pulls = 0.01 / np.sqrt(np.sum(time**2)), []
    for seed in range(5):
        evidence = zoomed(1 + 0.01 * np.random.default_rng(seed).normal(size=VIEWS))
        drift = Drift(evidence.observed["camera"])
        pulls.append(drift.sigma / foretold)
        assert drift.scatter > BY_SCATTER
    assert 0.4 < np.median(pulls) < 1.6


def test_views_that_agree_in_no_way_are_named_though_no_order_is_seen():
    """Focal lengths and centres at random: whichever way the views are parted, the halves are pixels apart."""
    rng = np.random.default_rng(2)
    problem = truth(board_poses(rng, VIEWS))
    corners = []
    for pose in problem.first_from_board:
        grid = CAMERA.intrinsics
        other = replace(grid, fx=grid.fx * rng.normal(1, 0.1), fy=grid.fy * rng.normal(1, 0.1))
        corners.append(replace(CAMERA, intrinsics=other).project(pose.apply(BOARD.corners)))
    observed = Observed("camera", replace(problem, detections={"camera": np.array(corners)}).refined())
    partings = Partings.of(observed)
    assert partings.certain == []
    assert partings.at_odds
