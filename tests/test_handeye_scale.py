"""A board whose lengths are not known: the robot's motions tell by what to multiply them, and when they do not."""

from dataclasses import replace

import numpy as np
import pytest

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.handeye import hand_eye_from_corners
from camviz_clinic.handeye.diagnosis import PosedPictures
from camviz_clinic.handeye.pose_table import RobotPoses
from camviz_clinic.handeye.telling import result_tree, solution
from camviz_clinic.handeye.virtual import BOARD, CAMERA, FAULTS, Cell, cell

BOTH = pytest.mark.parametrize("eye_to_hand", [False, True], ids=["eye in hand", "eye to hand"])


def told(true, times):
    """A board of squares that are so many times as long as they are."""
    return replace(true.board, square_size=times * true.board.square_size)


def solved(true, times=1.0, any_scale=True):
    return hand_eye_from_corners(
        true.base_from_hand,
        true.pixels,
        true.camera,
        told(true, times),
        eye_to_hand=true.eye_to_hand,
        any_scale=any_scale,
    )


def case(true, times=1.0):
    poses = RobotPoses(true.base_from_hand, times=true.times)
    return PosedPictures(poses, true.pixels, true.camera, told(true, times), true.eye_to_hand, any_scale=True)


@BOTH
def test_squares_of_any_length_give_the_same_x_and_their_own_scale(eye_to_hand):
    """X and Z are in the robot's metres, whether squares are told as 25, 3.5 or 500 mm."""
    true = cell(np.random.default_rng(21), 15, eye_to_hand)
    metric = solved(true)
    for times in (0.14, 20.0):
        found = solved(true, times)
        assert found.scale * times == pytest.approx(metric.scale, rel=1e-5)
        assert found.scale_sigma * times == pytest.approx(metric.scale_sigma, rel=1e-3)
        for one, other in (
            (found.mount_from_cam, metric.mount_from_cam),
            (found.other_from_board, metric.other_from_board),
        ):
            assert one.as_matrix() == pytest.approx(other.as_matrix(), abs=2e-5)
    assert (np.abs(metric.mount_from_cam.translation - true.X.translation) < 4 * metric.translation_sigma).all()


def test_the_scale_of_metric_sets_is_one_within_three_sigma(thorough):
    z = []
    for seed in range(40 if thorough else 8):
        found = solved(cell(np.random.default_rng([29, seed]), (12, 15, 20)[seed % 3], bool(seed % 2)))
        assert found.scale == pytest.approx(1, abs=0.005)
        z.append((found.scale - 1) / found.scale_sigma)
    assert np.mean(np.abs(z) < 3) >= (0.95 if thorough else 0.85)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_a_scale_that_was_not_asked_for_is_one_for_certain():
    found = solved(cell(np.random.default_rng(23), 8), any_scale=False)
    assert (found.scale, found.scale_sigma, found.scale_known) == (1, 0, True)


def test_where_the_scale_is_solved_for_neither_unit_nor_squares_are_judged_and_it_is_said():
    true = cell(np.random.default_rng(24), 12)
    found = case(true, 1.05)
    assert found.findings == ()
    assert dict(found.skipped) == {
        "wrong-unit": "the scale was solved for",
        "scale-differs": "the scale was solved for",
        "time-offset": "the poses have no column `time`",
    }
    (line,) = [each for each in solution(found) if each.startswith("scale: ")]
    result = found.result
    assert line.startswith(f"scale: {result.scale:.4f} ± {result.scale_sigma:.4f}. In the robot's unit")
    square = 26.25 * result.scale
    assert f"{square:.3f} ± {26.25 * result.scale_sigma:.3f} mm in place of 26.250 mm" in line
    assert square == pytest.approx(25, abs=0.02)
    assert "scale-differs" in [each.id for each in replace(found, any_scale=False).findings]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("id", [each for each in FAULTS if each not in ("wrong-unit", "scale-differs")])
def test_other_faults_are_named_though_the_scale_is_not_known(id):
    given = FAULTS[id](np.random.default_rng([777, 1]))
    board = replace(given.board, square_size=3 * given.board.square_size)
    assert [each.id for each in replace(given, board=board, any_scale=True).findings] == [id]


def test_a_stray_pose_is_off_by_millimetres_of_the_robot():
    true = cell(np.random.default_rng(25), 15)
    poses = list(true.base_from_hand)
    poses[4] = poses[4] * RigidTransform.from_translation([0.03, 0, 0])
    (finding,) = case(true.told(RigidTransform.concatenate(poses)), 10).findings
    assert finding.id == "stray-pose"
    assert float(finding.sentence.split("is off by ")[1].split(" mm")[0]) == pytest.approx(30, abs=2)


def test_a_robot_disagrees_by_millimetres_of_its_own():
    true = cell(np.random.default_rng(13), 15, robot_mm=15, robot_deg=1.5)
    metric, larger = (
        next(each for each in case(true, times).findings if each.id == "robot-disagrees") for times in (1, 10)
    )
    assert larger.value == pytest.approx(metric.value, rel=0.02)
    assert larger.sentence == metric.sentence


def test_a_hand_that_turns_about_one_point_does_not_tell_the_scale():
    """Its translations are all alike: nothing has a length but the board."""
    rng = np.random.default_rng(26)
    turns = Rotation.from_rotvec(rng.uniform(-0.2, 0.2, (14, 3)))
    hand = RigidTransform.from_components(np.tile([0.5, 0.1, 0.6], (14, 1)), turns)
    X = RigidTransform.from_components([0.03, -0.02, 0.05], Rotation.from_rotvec([0.05, -0.02, 0.1]))
    Z = RigidTransform.from_translation([0.43, 0.02, 1.5])
    seen = X.inv() * hand.inv() * Z
    pixels = np.stack([CAMERA.project(pose.apply(BOARD.corners)) for pose in seen])
    assert CAMERA.intrinsics.contains(pixels).all()
    found = case(Cell(X, Z, False, hand, pixels + rng.normal(0, 0.2, pixels.shape)))
    assert not found.result.scale_known
    assert "scale: not known. The hand must move to other places, and not only turn about one." in solution(found)
    assert result_tree(found)["scale"] is None
