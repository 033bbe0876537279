"""A ± that counts that the other board may be the right one: against likelihoods, solutions of both, and the truth."""

from dataclasses import replace

import numpy as np
import pytest
from boards import ESTIMATED, board_poses, noisy, truth
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import multivariate_normal

from camviz_clinic.calibration.board_warp import probability_by_views
from camviz_clinic.calibration.model_choice import weight_of_more

SIGMA = 0.2
NORMAL_95 = 1.96


@pytest.mark.parametrize("shift", [0.0, 0.5, 1.0])
def test_the_weight_is_that_of_akaikes_criterion_for_normal_samples(shift):
    """Likelihoods by SciPy of fifteen pairs of numbers, with the mean of both free and at zero."""
    samples = np.random.default_rng(1).normal(shift, 1, (15, 2)) @ [[1, 0.5], [0, 2]]
    mean = samples.mean(axis=0)
    T2 = 15 * mean @ np.linalg.solve(np.cov(samples.T), mean)

    def akaike(about, parameters):
        normal = multivariate_normal(about, (samples - about).T @ (samples - about) / 15)
        return 2 * parameters - 2 * normal.logpdf(samples).sum()

    free, zero = akaike(mean, 5), akaike(np.zeros(2), 3)
    expected = np.exp(-free / 2) / (np.exp(-free / 2) + np.exp(-zero / 2))
    assert weight_of_more(T2, 15, 2) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("chosen", ["flat", "bent"])
def test_it_has_the_scatter_of_both_solutions_and_what_lies_between_them(chosen):
    """Both are solved anew, where the covariance takes one step from the one that is chosen."""
    rng = np.random.default_rng(5)
    start = noisy(truth(board_poses(rng, 12), warp=np.array([8e-5, 0.0])), rng, SIGMA)
    flat, bent = replace(start, warp=None).refined(), start.refined()
    weight = weight_of_more(bent.bend_statistic, 12, 2)
    assert 0.2 < weight < 0.9
    off = flat.intrinsics("camera") - bent.intrinsics("camera")
    place = flat.intrinsics_of("camera")
    C, D = (one.clustered_covariance[place, place] for one in (flat, bent))
    one, other, weight = (flat, D, weight) if chosen == "flat" else (bent, C, 1 - weight)
    own = one.clustered_covariance[place, place]
    expected = (1 - weight) * own + weight * (other + np.outer(off, off))
    np.testing.assert_allclose(np.diag(one.covariance[place, place]), np.diag(expected), rtol=0.03)


def test_a_bend_that_may_be_none_has_its_whole_size_in_its_deviation():
    rng = np.random.default_rng(5)
    bent = noisy(truth(board_poses(rng, 12), warp=np.array([8e-5, 0.0])), rng, SIGMA).refined()
    flat = 1 - weight_of_more(bent.bend_statistic, 12, 2)
    expected = (1 - flat) * bent.clustered_covariance[-2:, -2:] + flat * np.outer(bent.warp, bent.warp)
    np.testing.assert_allclose(bent.covariance[-2:, -2:], expected, rtol=1e-9)


def test_fewer_than_six_views_have_no_say_about_the_board():
    rng = np.random.default_rng(6)
    poses = board_poses(rng, 6)
    six = noisy(truth(poses, estimated=("fx", "fy", "cx", "cy")), rng, SIGMA).refined()
    five = six.only(range(5)).refined()
    np.testing.assert_array_equal(five.covariance, five.clustered_covariance)
    assert np.abs(np.diag(six.covariance) / np.diag(six.clustered_covariance) - 1).max() > 1e-3


def test_without_measurements_to_spare_a_bend_has_no_chance_and_no_deviation():
    """Six views of four corners each, 48 numbers, for 36 of poses, ten of the lens and two of the board."""
    rng = np.random.default_rng(6)
    exact = truth(board_poses(rng, 6), estimated=(*ESTIMATED, "k3", "k4"), warp=np.zeros(2))
    few = np.isin(np.arange(54), [0, 8, 45, 53])
    seen = {"camera": np.where(few[:, None], exact.detections["camera"], np.nan)}
    problem = noisy(replace(exact, detections=seen), rng, SIGMA)
    assert np.isnan(problem.sigma)
    assert probability_by_views(problem) == 1
    assert np.isnan(problem.covariance).all()


def test_intervals_hold_where_chance_decides_whether_the_bend_is_solved_for(thorough):
    """A bend that eight views find in two of five sets: nine in ten intervals hold, and 79 % by the views alone."""
    rng = np.random.default_rng(7)
    exact = truth(board_poses(rng, 8), estimated=("fx", "fy", "cx", "cy", "k1"), warp=np.array([6e-4, 0.0]))
    solutions = []
    for _ in range(400 if thorough else 60):
        flat = replace(noisy(exact, rng, 3 * SIGMA), warp=None).refined()
        found = probability_by_views(flat) < 0.01
        solutions.append(replace(flat, warp=np.zeros(2)).refined() if found else flat)
    assert 0.2 < np.mean([one.warp is not None for one in solutions]) < 0.8
    assert 0.9 < held(solutions, exact, lambda one: one.covariance) < 0.99
    assert held(solutions, exact, lambda one: one.clustered_covariance) < 0.88


def held(solutions, exact, covariance):
    """The share of 95 % intervals, of all intrinsics of all solutions, that hold what is true."""
    true, place = exact.intrinsics("camera"), solutions[0].intrinsics_of("camera")
    z = [(one.intrinsics("camera") - true) / np.sqrt(np.diag(covariance(one))[place]) for one in solutions]
    return float(np.mean(np.abs(z) < NORMAL_95))


def test_views_that_do_not_tell_a_bend_to_a_hundredth_of_the_boards_length_have_no_say_about_it():
    """Eight boards nearly parallel to the picture, with more and more noise: the bend is told less and less."""
    rng = np.random.default_rng(3)
    middles = rng.uniform([-0.15, -0.1, 0.4], [0.05, 0.02, 0.6], (8, 3))
    poses = RigidTransform.from_components(middles, Rotation.from_rotvec(rng.normal(0, 0.01, (8, 3))))
    told, counted = [], []
    for noise in np.arange(0.3, 1.0, 0.1):
        start = noisy(truth(poses, estimated=("fx", "fy", "k1")), np.random.default_rng(4), noise)
        flat = start.refined()
        bend = replace(flat, warp=np.zeros(2)).clustered_covariance[-2:, -2:]
        told.append(np.sqrt(np.diag(bend).max()) < 0.01 * flat.board.length)
        counted.append(not np.array_equal(flat.covariance, flat.clustered_covariance))
    assert counted == told
    assert told[0]
    assert not told[-1]
