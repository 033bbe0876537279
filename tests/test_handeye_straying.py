"""A pose is called stray where chance does not put it as far: how probable each is told to be, and what follows."""

import numpy as np
import pytest
from scipy.stats import f as fisher

from camviz.poses import RigidTransform
from camviz_clinic.calibration.motions import Motions
from camviz_clinic.checks.rig import lone_poses
from camviz_clinic.handeye import hand_eye, hand_eye_from_corners
from camviz_clinic.handeye.adjusting import Pixels, far_off
from camviz_clinic.handeye.diagnosis import PosedPictures
from camviz_clinic.handeye.pose_table import RobotPoses
from camviz_clinic.handeye.solving import _over, _started
from camviz_clinic.handeye.straying import CHANCE, Offsets, surely
from camviz_clinic.handeye.virtual import cell, healthy, healthy_case, strayed


def motions_of(true):
    return Motions.of(true.base_from_hand, lone_poses(true.camera, true.board, true.pixels), true.eye_to_hand)


def left_out(true, which, from_corners=True):
    """The solution without one pose, the motions of all, and what the corners of all are, if they are used."""
    motions = motions_of(true)
    stray = np.arange(len(motions)) == which
    pixels = Pixels(true.camera, true.board.corners, true.pixels) if from_corners else None
    return _over(_started(motions), ~stray, true.eye_to_hand, pixels), motions, pixels, stray


def strayed_by(true, which, mm):
    """A cell one of whose robot poses is off by so much along x."""
    poses = list(true.base_from_hand)
    poses[which] = poses[which] * RigidTransform.from_translation([mm / 1000, 0, 0])
    return true.told(RigidTransform.concatenate(poses))


def test_with_one_size_for_all_errors_it_is_fishers_f_with_the_numbers_less_the_unknowns():
    """20 poses of six numbers each, less the 12 of X and Z; the prior counts as half a number."""
    rng = np.random.default_rng(1)
    spread = rng.normal(0, 1, (21, 6, 6))
    covariance = spread @ spread.swapaxes(1, 2)
    jacobian = rng.normal(0, 1, (21, 6, 12))
    W = np.linalg.inv(covariance[:20])
    known = np.linalg.inv(np.einsum("pia,pij,pjb->ab", jacobian[:20], W, jacobian[:20]))
    foretold = covariance[20] + jacobian[20] @ known @ jacobian[20].T
    off = rng.normal(0, 1, 6)
    twists = np.zeros((21, 6))
    twists[20] = np.linalg.cholesky(foretold) @ (np.sqrt(30) * off / np.linalg.norm(off))
    (chance,) = Offsets(twists, jacobian, covariance[None]).chances(np.arange(21) == 20)
    assert chance == pytest.approx(fisher.sf(30 / 6, 6, 20 * 6 - 12 + 0.5), rel=1e-5, abs=0)


def test_the_information_on_several_sizes_is_that_of_the_whole_covariance():
    """The sum over poses is 2 tr(P Cₖ P Cₗ) of the matrices of all poses together."""
    rng = np.random.default_rng(2)
    spread = rng.normal(0, 1, (3, 8, 6, 6))
    parts = spread @ spread.swapaxes(2, 3)
    J = rng.normal(0, 1, (8, 6, 12))
    _, covariance = Offsets(np.zeros((8, 6)), J, parts)._learnt(np.ones(8, bool))
    whole = np.zeros((3, 48, 48))
    for pose in range(8):
        whole[:, 6 * pose : 6 * pose + 6, 6 * pose : 6 * pose + 6] = parts[:, pose]
    W, rows = np.linalg.inv(whole.sum(axis=0)), J.reshape(48, 12)
    P = W - W @ rows @ np.linalg.inv(rows.T @ W @ rows) @ rows.T @ W
    information = [[2 * np.trace(P @ one @ P @ other) for other in whole] for one in whole]
    assert np.linalg.inv(covariance) == pytest.approx(np.array(information) + np.eye(3))


def test_a_pose_that_is_like_the_others_is_as_improbable_as_is_told(thorough):
    """Of poses left out at random a tenth have a chance below a tenth, in cells of all kinds."""
    chances = []
    for seed in range(60 if thorough else 12):
        rng = np.random.default_rng([123, seed])
        true = healthy(rng)
        for which in rng.choice(len(true.pixels), 3, replace=False):
            solution, motions, pixels, stray = left_out(true, which)
            chances += Offsets.of(solution, motions, pixels).chances(stray).tolist()
    assert np.mean(chances) == pytest.approx(0.5, abs=0.05 if thorough else 0.12)
    assert np.mean(np.array(chances) < 0.1) == pytest.approx(0.1, abs=0.05 if thorough else 0.1)
    assert min(chances) > CHANCE / 20


def test_a_pose_whose_corners_tell_it_badly_is_not_called_stray():
    """Of this healthy robot's pictures one shows the board tilted and in a corner: its pose is off by 5.2 medians."""
    case = healthy_case(np.random.default_rng([70_000, 10, 3]))
    assert far_off(case.readings[0].adjusted.displacements) == [9]
    assert case.findings == ()
    assert case.result.used.all()


@pytest.mark.parametrize("eye_to_hand", [False, True], ids=["eye in hand", "eye to hand"])
@pytest.mark.parametrize("from_corners", [False, True], ids=["from poses", "from corners"])
def test_a_pose_that_is_off_by_30_of_the_robots_errors_is_sure_and_one_by_a_single_one_is_not(
    eye_to_hand, from_corners
):
    true = cell(np.random.default_rng(4), 12, eye_to_hand)
    for mm, sure in ((6.0, True), (0.2, False)):
        solution, motions, pixels, stray = left_out(strayed_by(true, 5, mm), 5, from_corners)
        assert surely(solution, motions, pixels, stray).tolist() == (stray & sure).tolist()


@pytest.mark.thorough
def test_the_chance_is_that_of_all_poses_together():
    """Of 12 poses one is sure whose own chance is a twelfth of that of the whole set, and not one 0.1 mm nearer."""
    true = cell(np.random.default_rng(5), 12)
    tried = [left_out(strayed_by(true, 3, mm), 3) for mm in np.arange(0.2, 5, 0.1)]
    sure = [bool(surely(*each).any()) for each in tried]
    first = sure.index(True)
    near, at = (Offsets.of(*each[:3]).chances(each[3])[0] for each in tried[first - 1 : first + 1])
    assert 12 * at <= CHANCE < 12 * near
    assert near < CHANCE


def test_more_than_a_fifth_of_stray_poses_are_named_and_none_is_set_aside():
    rng = np.random.default_rng(6)
    true = cell(rng, 12)
    for which, mm in ((1, 30.0), (4, -25.0), (9, 40.0)):
        true = strayed_by(true, which, mm)
    case = PosedPictures(RobotPoses(true.base_from_hand), true.pixels, true.camera, true.board)
    (finding,) = [each for each in case.findings if each.id == "stray-pose"]
    assert finding.severity == "fault"
    assert sorted(finding.pictures) == [1, 4, 9]
    assert case.result.used.all()
    assert np.flatnonzero(case.result.stray).tolist() == [1, 4, 9]


def test_a_stray_pose_of_boards_without_corners_is_set_aside():
    rng = np.random.default_rng(7)
    true, which = strayed(rng, cell(rng, 15), 10, 1)
    boards = lone_poses(true.camera, true.board, true.pixels)
    assert np.flatnonzero(hand_eye(true.base_from_hand, boards).stray).tolist() == [which]


def test_a_stray_pose_keeps_its_row_where_a_picture_does_not_show_the_board():
    rng = np.random.default_rng(8)
    true = strayed_by(cell(rng, 12), 7, 30)
    pixels = true.pixels.copy()
    pixels[2] = np.nan
    found = hand_eye_from_corners(true.base_from_hand, pixels, true.camera, true.board)
    assert np.flatnonzero(found.stray).tolist() == [7]
    assert np.flatnonzero(~found.used).tolist() == [2, 7]
