"""Facts about the covariance by the scatter of views: against leaving views out, a sandwich's formula, many sets."""

from dataclasses import replace

import numpy as np
import pytest
from boards import CAMERA, ESTIMATED, RIGHT, board_poses, noisy, truth

from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.clustered import ByView
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.linearisation import Linearisation

SIGMA = 0.2
NORMAL_95 = 1.96


@pytest.fixture(scope="module")
def linear():
    """Ten groups of measurements y (groups, 12) of three shared parameters, and of two that are each group's own.

    X (groups, 12, 3), Z (groups, 12, 2), and y with errors of which half is common to a group.
    """
    rng = np.random.default_rng(4)
    X, Z = rng.normal(size=(10, 12, 3)) * [1, 30, 0.01], rng.normal(size=(10, 12, 2))
    y = X @ [2, -1, 300] + rng.normal(size=(10, 12)) + rng.normal(size=(10, 1)) * X[..., 0]
    return X, Z, y


def dense(X, Z, views):
    """The columns of the shared parameters and of the groups' own, (groups * 12, 3 + 2 * groups), of some groups."""
    rows = [np.hstack([X[view], *[Z[view] if view == other else 0 * Z[view] for other in views]]) for view in views]
    return np.vstack(rows)


def by_view(X, Z, y):
    """The same groups, with what is each one's own taken out."""
    Q = np.linalg.qr(Z)[0]
    X = X - Q @ (np.swapaxes(Q, 1, 2) @ X)
    gradient = np.einsum("vns,vn->vs", X, y)
    s = X.shape[-1]
    return ByView(np.swapaxes(X, 1, 2) @ X, gradient, np.zeros((s, s)), np.zeros(s))


def test_information_that_rounding_puts_below_zero_decides_nothing():
    """As of the bend of one marker's four corners, which the poses follow wholly."""
    rounded = np.array([np.diag([4.0, -1e-20])] * 3)
    assert np.diag(inverse(rounded[0])).tolist() == [0.25, pytest.approx(1 / (2 * np.finfo(float).eps))]
    views = ByView(rounded, np.array([[1.0, 0], [-1, 0], [0, 0]]), np.zeros((2, 2)), np.zeros(2))
    first, other = np.diag(views.covariance(1.0))
    assert first == pytest.approx(2 / 3 * 2 / 8**2)  # (n - 1)/n Σ δ², where two views are left with 8
    assert other > 1e10


def test_it_is_the_jackknife_of_a_linear_problem(linear) -> None:
    """(n - 1)/n Σ (θ₍ᵢ₎ - θ)(θ₍ᵢ₎ - θ)ᵀ with θ₍ᵢ₎ of all groups but one, by np.linalg.lstsq with all columns."""
    X, Z, y = linear
    groups = list(range(10))

    def solution(kept):
        return np.linalg.lstsq(dense(X, Z, kept), y[kept].ravel(), rcond=None)[0][:3]

    off = np.array([solution([view for view in groups if view != left]) - solution(groups) for left in groups])
    expected = 0.9 * off.T @ off
    found = by_view(X, Z, y).covariance(1.0)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_it_is_cr3_of_the_sandwich_estimators(linear) -> None:
    """(n - 1)/n (DᵀD)⁻¹ [Σ Dᵢᵀ (1 - Pᵢᵢ)⁺ eᵢ eᵢᵀ (1 - Pᵢᵢ)⁺ Dᵢ] (DᵀD)⁻¹ with D of all columns and P = D (DᵀD)⁻¹ Dᵀ."""
    X, Z, y = linear
    D = dense(X, Z, range(10))
    bread = np.linalg.inv(D.T @ D)
    e = y.ravel() - D @ bread @ D.T @ y.ravel()
    meat = np.zeros_like(bread)
    for view in range(10):
        rows = slice(12 * view, 12 * view + 12)
        score = D[rows].T @ np.linalg.pinv(np.eye(12) - D[rows] @ bread @ D[rows].T, rcond=1e-9) @ e[rows]
        meat += np.outer(score, score)
    expected = 0.9 * (bread @ meat @ bread)[:3, :3]
    np.testing.assert_allclose(by_view(X, Z, y).covariance(1.0), expected, rtol=1e-7)


def test_it_does_not_matter_from_where_a_linear_problem_is_looked_at(linear) -> None:
    """With y less what other parameters would give, the gradient is not 0, and the covariance is the same."""
    X, Z, y = linear
    np.testing.assert_allclose(
        by_view(X, Z, y - X @ [5, 5, 5]).covariance(1.0), by_view(X, Z, y).covariance(1.0), rtol=1e-9
    )


def test_what_no_view_measures_or_one_alone_is_beyond_all_digits(linear) -> None:
    """A fourth parameter in no group, then in the third group alone: its variance is > 10⁹, the others' stay."""
    X, Z, y = linear
    expected = by_view(X, Z, y).covariance(1.0)
    for measured in ([], [2]):
        fourth = np.zeros((10, 12, 1))
        fourth[measured] = np.random.default_rng(0).normal(size=(12, 1))
        found = by_view(np.concatenate([X, fourth], axis=-1), Z, y).covariance(1.0)
        assert np.isfinite(found).all()
        assert found[3, 3] > 1e9
    # What the third group measures of the others is less where it has a parameter of its own.
    np.testing.assert_allclose(
        by_view(np.concatenate([X, 0 * fourth], axis=-1), Z, y).covariance(1.0)[:3, :3], expected, rtol=1e-9
    )


def test_what_one_view_alone_measures_may_have_the_noise_of_its_corners(linear) -> None:
    """Two parameters of the third group alone: their covariance, by σ = 0.5 of its corners, is that of least squares.

    By np.linalg.inv of all columns' normal equations, and in every direction, as a view is left out of none.
    """
    X, Z, y = linear
    own = np.zeros((10, 12, 2))
    own[2] = np.random.default_rng(0).normal(size=(12, 2))
    X = np.concatenate([X, own], axis=-1)[..., [3, 4]]
    D = dense(X, Z, range(10))
    expected = 0.5**2 * np.linalg.inv(D.T @ D)[:2, :2]
    found = replace(by_view(X, Z, y), alone=1).covariance(0.5)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    beyond = by_view(X, Z, y).covariance(0.5)
    assert np.linalg.eigvalsh(beyond / np.sqrt(np.outer(np.diag(beyond), np.diag(beyond))))[0] > 1e-3


def test_what_is_assumed_scatters_as_it_was_assumed_to(linear) -> None:
    """Under a prior that holds the first parameter a million times better than the data its σ is the prior's."""
    X, Z, y = linear
    free = by_view(X, Z, y)
    held = replace(free, assumed=np.diag([1e12, 0, 0]))
    assert held.covariance(0.5)[0, 0] == pytest.approx(0.5**2 / 1e12, rel=1e-6)


@pytest.mark.parametrize("cameras", [{"camera": CAMERA}, {"left": CAMERA, "right": RIGHT}], ids=["one", "pair"])
def test_it_is_what_solving_without_each_view_gives(cameras) -> None:
    """Every view left out in turn and all solved anew: each σ is that of the jackknife to 3 %."""
    rng = np.random.default_rng(1)
    solved = noisy(truth(board_poses(rng, 12), cameras), rng, SIGMA).refined()
    views = np.arange(12)

    def values(one):
        return np.concatenate([one.intrinsics(name) for name in one.cameras])

    off = np.array([values(solved.only(views != left).refined()) - values(solved) for left in views])
    count = off.shape[1]
    expected = np.sqrt(11 / 12 * np.sum(off**2, axis=0))
    np.testing.assert_allclose(np.sqrt(np.diag(solved.clustered_covariance))[:count], expected, rtol=0.03)


def test_a_prior_on_the_lens_counts_as_it_does_for_independent_corners() -> None:
    """One that holds the denominator to a millionth: the σ of k4, k5 and k6 are those of the corners' covariance."""
    rng = np.random.default_rng(2)
    names = (*ESTIMATED, "k3", "k4", "k5", "k6")
    start = noisy(truth(board_poses(rng, 10), estimated=names), rng, SIGMA)
    solved = replace(start, priors={"camera": DenominatorPrior(0.7, 1e-6, SIGMA)}).refined()
    ratio = np.sqrt(np.diag(solved.covariance) / np.diag(solved.corner_covariance))
    np.testing.assert_allclose(ratio[-3:], 1, rtol=1e-3)
    assert solved.held_by_priors["camera"] == pytest.approx(3, abs=1e-3)


def test_fewer_than_three_views_tell_no_scatter() -> None:
    """Of two views the covariance is that of the corners' noise; of three it is not."""
    rng = np.random.default_rng(3)
    solved = noisy(truth(board_poses(rng, 3), estimated=("fx", "fy", "cx", "cy")), rng, SIGMA).refined()
    two = solved.only([0, 1]).refined()
    np.testing.assert_array_equal(two.covariance, two.corner_covariance)
    assert np.abs(np.diag(solved.covariance) / np.diag(solved.corner_covariance) - 1).max() > 0.1


def held(solutions, exact, covariance):
    """The share of 95 % intervals, of all intrinsics of all solutions, that hold what is true."""
    true = exact.intrinsics("camera")
    z = [(one.intrinsics("camera") - true) / np.sqrt(np.diag(covariance(one))) for one in solutions]
    return float(np.mean(np.abs(z) < NORMAL_95))


def test_intervals_hold_where_the_corners_of_a_view_are_not_independent(thorough) -> None:
    """Every board bends as it is held, by 0.5 px in each of four ways: of the 95 % intervals 90 to 99 % hold.

    Of those by the noise of corners half do. 30 sets of 12 views and 8 intrinsics.
    """
    rng = np.random.default_rng(7)
    exact = truth(board_poses(rng, 12))
    x, y = (2 * exact.board.corners[:, :2] / exact.board.corners[:, :2].max(axis=0) - 1).T
    ways = np.stack([x * x, x * y, y * y, x**3])
    solutions = []
    for _ in range(200 if thorough else 30):
        bends = np.einsum("bc,vbi->vci", ways, rng.normal(0, 0.5, (12, 4, 2)))
        bent = replace(exact, detections={"camera": exact.detections["camera"] + bends})
        solutions.append(noisy(bent, rng, SIGMA).refined())
    assert 0.9 < held(solutions, exact, lambda one: one.covariance) < 0.99
    assert held(solutions, exact, lambda one: one.corner_covariance) < 0.6


def test_intervals_hold_where_corners_are_independent(thorough) -> None:
    """Of the 95 % intervals of healthy sets 90 to 99 % hold; so many views cost little: 30 sets of 12 views."""
    rng = np.random.default_rng(8)
    exact = truth(board_poses(rng, 12))
    solutions = [noisy(exact, rng, SIGMA).refined() for _ in range(200 if thorough else 30)]
    assert 0.9 < held(solutions, exact, lambda one: one.covariance) < 0.99
    more = [np.sqrt(np.diag(one.covariance) / np.diag(one.corner_covariance)) for one in solutions]
    assert 1 < np.median(more) < 1.2


def test_a_share_of_a_view_is_that_of_the_view_alone() -> None:
    """Information and gradient of every view are those of a problem that has no other view."""
    rng = np.random.default_rng(5)
    start = noisy(truth(board_poses(rng, 5), {"left": CAMERA, "right": RIGHT}), rng, SIGMA)
    shares = start.by_view
    for view in range(5):
        normal = Linearisation.only(start, [view]).normal_equations
        gradient = normal.shared_gradient - normal.pose_response[0].T @ normal.gradients[0]
        scale = np.sqrt(np.diag(normal.information))
        assert np.abs((shares.information[view] - normal.information) / np.outer(scale, scale)).max() < 1e-9
        np.testing.assert_allclose(
            shares.gradient[view] / scale, gradient / scale, atol=1e-9 * np.abs(gradient / scale).max()
        )
