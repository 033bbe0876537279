"""Facts about what the clinic asks: of unseen views, bent boards, the next board, depth and residuals."""

from dataclasses import replace

import numpy as np
import pytest
from boards import BOARD, CAMERA, RIGHT, board_poses, noisy, truth
from scipy.spatial.transform import RigidTransform
from scipy.stats import kstest

from camviz.cameras import transform
from camviz.twoview import triangulate
from camviz_clinic.calibration.board_warp import warp_test
from camviz_clinic.calibration.cross_validation import halves, held_out
from camviz_clinic.calibration.difference import difference
from camviz_clinic.calibration.guidance import candidate_poses, next_board_poses, outline, tilt_deg
from camviz_clinic.calibration.jacobian import with_parameters
from camviz_clinic.calibration.stereo_depth import depth_uncertainty

SIGMA = 0.2


def shifted(camera, **changes):
    """A camera with some of its intrinsics changed by so much."""
    return with_parameters(camera, {name: getattr(camera.intrinsics, name) + step for name, step in changes.items()})


# Views it has not seen ------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_halves_of_a_healthy_set_differ_by_noise_alone() -> None:
    """25 sets: the probabilities are uniform (Kolmogorov-Smirnov, one in a thousand), and the ratio is about 1."""
    rng = np.random.default_rng(1)
    found = [halves(noisy(truth(board_poses(rng, 12)), rng, SIGMA).refined(), grid=(12, 9)) for _ in range(25)]
    assert kstest([one.probability for one in found], "uniform").pvalue > 1e-3
    assert 0.4 < np.median([one.ratio for one in found]) < 1.2


def test_halves_disagree_after_the_focus_has_moved() -> None:
    """The last six of twelve views with a focal length 3 % longer."""
    rng = np.random.default_rng(2)
    poses = board_poses(rng, 12)
    before, after = truth(poses), truth(poses, {"camera": shifted(CAMERA, fx=16, fy=16)})
    joined = np.where((np.arange(12) < 6)[:, None, None], before.detections["camera"], after.detections["camera"])
    found = halves(noisy(replace(before, detections={"camera": joined}), rng, SIGMA).refined())
    assert found.probability < 1e-6
    assert found.ratio > 3


def test_halves_need_three_views_each() -> None:
    problem = noisy(truth(board_poses(np.random.default_rng(0), 5)), np.random.default_rng(0), SIGMA)
    with pytest.raises(ValueError, match="at least 3 views, got 2 and 3"):
        halves(problem)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("folds", [None, 5])
def test_corners_held_out_of_a_healthy_set_are_off_as_foretold(folds) -> None:
    """Ten sets of twelve views: the errors are those that noise, pose and camera should give, within 5 %."""
    rng = np.random.default_rng(3)
    problems = [noisy(truth(board_poses(rng, 12)), rng, SIGMA).refined() for _ in range(10)]
    found = [held_out(problem, folds=folds) for problem in problems]
    assert np.mean([one.ratio for one in found]) == pytest.approx(1, abs=0.05)
    assert np.mean([one.rms / one.expected_rms for one in found]) == pytest.approx(1, abs=0.07)


@pytest.mark.thorough
def test_what_a_camera_of_few_views_foretells_is_as_uncertain_as_was_said() -> None:
    """Cameras of four views asked of the fifth, 8 sets: most of the error is the camera's, and it is as foretold."""
    rng = np.random.default_rng(15)
    problems = [noisy(truth(board_poses(rng, 5)), rng, SIGMA).refined() for _ in range(8)]
    assert np.mean([held_out(problem, folds=5).ratio for problem in problems]) == pytest.approx(1, abs=0.08)


def test_corners_held_out_show_what_poses_have_made_up_for() -> None:
    """cx wrong by 50 px: fitted again, the poses hide most of it; corners that they were not fitted to do not."""
    rng = np.random.default_rng(4)
    healthy = noisy(truth(board_poses(rng, 12)), rng, SIGMA).refined()
    wrong = replace(healthy, cameras={"camera": shifted(healthy.cameras["camera"], cx=50)}).refined(only_poses=True)
    assert held_out(healthy).ratio < 1.1
    assert held_out(wrong).ratio > 2.5
    assert held_out(wrong).rms / held_out(healthy).rms > 1.2 * wrong.rms / healthy.rms
    assert held_out(wrong).per_view.shape == (12,)


# A bent board ---------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_flat_boards_are_called_bent_no_oftener_than_was_said() -> None:
    """60 flat boards: the probabilities are uniform; at a rate of 5 % there are at most 9 false alarms (99.9 %)."""
    rng = np.random.default_rng(5)
    tests = [warp_test(noisy(truth(board_poses(rng, 6)), rng, SIGMA)) for _ in range(60)]
    assert kstest([one.probability for one in tests], "uniform").pvalue > 1e-3
    assert sum(one.bowed(0.05) for one in tests) <= 9
    assert sum(one.bowed() for one in tests) <= 2


def test_a_bent_board_is_found_and_measured() -> None:
    """Sagittas of 0.4 and -0.2 mm, within four of the deviations that are given with them."""
    rng = np.random.default_rng(6)
    bent = truth(board_poses(rng, 10), warp=np.array([4e-4, -2e-4]))
    found = warp_test(noisy(replace(bent, warp=None), rng, SIGMA))
    assert found.bowed(1e-6)
    assert np.all(np.abs(found.warp_mm - [0.4, -0.2]) < 4 * found.deviation_mm)
    assert np.all(found.deviation_mm < 0.05)
    assert 0.4 < found.bend_mm < 0.7
    assert found.bent.rms < found.flat.rms


# The next board -------------------------------------------------------------------------------------------------------


def test_candidates_show_the_whole_board() -> None:
    poses = candidate_poses(CAMERA, BOARD)
    assert len(poses) > 100
    uv = np.array([CAMERA.project(transform(pose, outline(BOARD))) for pose in poses])
    assert np.all((uv > -0.5) & (uv < [639.5, 479.5]))


@pytest.fixture(scope="module")
def parallel():
    """Five views of boards that all face the camera, as beginners hold them."""
    rng = np.random.default_rng(7)
    return noisy(truth(board_poses(rng, 5, tilt=0.03)), rng, SIGMA).refined()


def test_after_parallel_boards_a_tilted_one_is_asked_for(parallel) -> None:
    best, *_, worst = next_board_poses(parallel, uv=[[320, 240], [200, 150]], distance=0.5)
    assert best.tilt_deg > 20
    assert best.after < best.before
    assert worst.after <= worst.before
    both = RigidTransform.concatenate([best.cam_from_board, worst.cam_from_board])
    assert np.allclose([best.tilt_deg, worst.tilt_deg], tilt_deg(both, BOARD))


@pytest.mark.thorough
def test_what_is_foretold_of_a_board_is_what_its_picture_brings(parallel) -> None:
    """With the corners of the best and of the worst candidate added and solved anew 15 times, the camera's difference
    from the truth is as much smaller as was said: the best is better than the worst, and by how much to 40 %."""
    rng = np.random.default_rng(8)
    ranked = next_board_poses(parallel)
    errors = {}
    for name, candidate in (("best", ranked[0]), ("worst", ranked[-1])):
        poses = RigidTransform.concatenate([parallel.first_from_board, candidate.cam_from_board])
        exact = replace(truth(poses), estimated=parallel.estimated)
        solutions = [noisy(exact, rng, SIGMA).refined() for _ in range(15)]
        maps = [difference(CAMERA, one.cameras["camera"], grid=(12, 9), within=400).length for one in solutions]
        errors[name] = np.sqrt(np.nanmean(np.square(maps)))
    assert errors["best"] < 0.8 * errors["worst"]
    assert errors["best"] / errors["worst"] == pytest.approx(ranked[0].after / ranked[-1].after, rel=0.4)


def test_a_candidate_that_is_not_whole_in_the_picture_is_refused(parallel) -> None:
    aside = RigidTransform.from_translation([[1.0, 0, 0.3]])
    with pytest.raises(ValueError, match=r"numbers \[0\]"):
        next_board_poses(parallel, aside)


# Depth ----------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair():
    return truth(board_poses(np.random.default_rng(9), 8), {"left": CAMERA, "right": RIGHT})


def test_matching_noise_grows_with_the_square_of_the_distance(pair) -> None:
    """σ_Z = Z² σ_d/(f B): for this pair, which is all but rectified, within 5 %."""
    found = depth_uncertainty(pair, [0.5, 1, 2, 4], 0.5)
    expected = 0.5 * found.depth**2 / (530 * np.linalg.norm(RIGHT.centre))
    assert np.allclose(found.from_matching, expected, rtol=0.05)


@pytest.fixture(scope="module")
def solutions(pair):
    """80 calibrations of the pair, each from noise of its own."""
    rng = np.random.default_rng(10)
    return [noisy(pair, rng, SIGMA).refined() for _ in range(80)]


@pytest.mark.thorough
@pytest.mark.parametrize("uv", [None, (150.0, 340.0)])
def test_depth_scatters_as_foretold(solutions, uv) -> None:
    """80 noisy calibrations, noise in the match, the point found by camviz's triangulation: σ_Z within 30 %."""
    rng = np.random.default_rng(11)
    depths = np.array([0.5, 1.5])
    pixel = np.array([319.5, 239.5] if uv is None else uv)
    ray = CAMERA.unproject(pixel)
    points = depths[:, None] * ray / ray[2]
    matched = RIGHT.project(points)
    calibrated, both = [], []
    for one in solutions:
        left, right = one.cameras["left"], one.cameras["right"]
        for found, match in ((calibrated, 0.0), (both, 0.3)):
            noise = match * rng.normal(size=(2, 1)) * [1, 0]
            uvs = np.stack([np.tile(pixel, (2, 1)), matched + noise])
            found.append(triangulate([left, right], uvs)[:, 2])
    expected = depth_uncertainty(one.by_corners, depths, 0.3, uv=uv)
    scale = SIGMA / one.sigma
    assert np.allclose(np.std(calibrated, axis=0), scale * expected.from_calibration, rtol=0.3)
    assert np.allclose(np.std(both, axis=0), expected.total, rtol=0.3)


# Residuals ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved():
    rng = np.random.default_rng(12)
    return noisy(truth(board_poses(rng, 10)), rng, SIGMA).refined()


def test_rms_of_views_and_of_everything_agree(solved) -> None:
    rms, seen = solved.view_rms("camera"), solved.used["camera"].sum(axis=1)
    assert np.sqrt(np.sum(rms**2 * seen) / seen.sum()) == pytest.approx(solved.rms)


def test_rms_of_a_view_is_by_the_corners_with_a_say_or_by_all_that_it_shows(solved) -> None:
    """One corner is set aside in view 0 and all of them in view 1; view 2 shows no board."""
    uv, aside = solved.detections["camera"].copy(), np.zeros((10, 54), dtype=bool)
    uv[2], aside[0, 5], aside[1] = np.nan, True, True
    found = replace(solved, detections={"camera": uv}, set_aside={"camera": aside})
    squares = np.sum(solved.residuals["camera"] ** 2, axis=-1)
    expected = [np.sqrt(np.mean(np.delete(squares[0], 5))), np.sqrt(np.mean(squares[1])), np.nan]
    assert found.view_rms("camera")[:3] == pytest.approx(expected, nan_ok=True)
