"""What is wrong with a robot's poses: every fault is named, healthy cells are left alone, and thresholds hold."""

from dataclasses import replace

import numpy as np
import pytest

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.motions import Turning
from camviz_clinic.handeye import PoseError, RobotPoses
from camviz_clinic.handeye.diagnosis import (
    DISAGREE,
    KINDS,
    LITTLE_DEG,
    MIN_BOARD_MOTION,
    SAME_POSE_DEG,
    SAME_POSE_MM,
    STILL_BOARD_DEG,
    UNKNOWN_DEG,
    PosedPictures,
    _first_alike,
    turning_finding,
)
from camviz_clinic.handeye.mends import FEWEST_TRIED, MIN_SHIFT_GAIN, row_shifts
from camviz_clinic.handeye.virtual import (
    FAULTS,
    about_one_axis,
    cell,
    healthy_case,
    lost_pictures,
    moving,
    scaled,
    strayed,
)


def case(true, poses=None, **more):
    told = poses or RobotPoses(true.base_from_hand)
    return PosedPictures(told, true.pixels, true.camera, true.board, true.eye_to_hand, **more)


def of(found, id):
    """The one finding, which is of this id."""
    (finding,) = found.findings
    assert finding.id == id
    return finding


@pytest.mark.thorough
@pytest.mark.parametrize("id", list(FAULTS))
def test_a_fault_is_named(id):
    """At many seeds; the tests below have one case of each."""
    for seed in range(20):
        found = FAULTS[id](np.random.default_rng([31, seed]))
        assert id in [each.id for each in found.findings]


def test_there_is_a_case_for_every_kind_but_the_one_that_has_no_mend():
    assert set(KINDS) - set(FAULTS) == {"robot-disagrees"}


def test_nothing_is_found_where_nothing_is_wrong(thorough):
    for seed in range(40 if thorough else 1):
        assert healthy_case(np.random.default_rng([32, seed])).findings == ()


@pytest.mark.thorough
def test_a_unit_is_named_with_what_asks_for_it():
    true = cell(np.random.default_rng(1), 10)
    millimetres = case(scaled(true, 1000))
    assert of(millimetres, "wrong-unit").remedy == "Read the lengths as millimetres: --unit mm."
    assert not millimetres.usable
    assert of(case(scaled(true, 0.001)), "wrong-unit").remedy == "Read the lengths as metres: --unit m."
    inches = of(case(scaled(true, 1000 / 25.4)), "wrong-unit")
    assert "by 25.4" in inches.remedy


@pytest.mark.thorough
def test_two_mistakes_at_once_are_named_together():
    true = cell(np.random.default_rng(2), 10)
    both = scaled(true, 1000).base_from_hand.inv()
    finding = of(case(true.told(both)), "poses-inverted")
    assert "--invert" in finding.remedy
    assert "--unit mm" in finding.remedy


@pytest.mark.thorough
@pytest.mark.parametrize("to_hand", [False, True])
def test_inverted_poses_and_the_other_arrangement_are_one_equation_and_both_are_named(to_hand):
    true = cell(np.random.default_rng(3), 10, to_hand)
    said = of(case(replace(true, eye_to_hand=not to_hand)), "poses-inverted").remedy
    assert "--invert" in said
    assert ("--eye-to-hand left out" in said) == (not to_hand)


@pytest.mark.thorough
def test_a_shift_is_named_with_its_direction():
    true = cell(np.random.default_rng(4), 12)
    late = replace(true, base_from_hand=true.base_from_hand[:-2], pixels=true.pixels[2:])
    assert "the pose 2 rows further down" in of(case(late), "poses-shifted").sentence
    early = replace(true, base_from_hand=true.base_from_hand[1:], pixels=true.pixels[:-1])
    assert "the pose 1 row further up" in of(case(early), "poses-shifted").sentence


@pytest.mark.thorough
def test_an_order_is_named():
    true = cell(np.random.default_rng(5), 12)
    assert "reversed" in of(case(true.told(true.base_from_hand[::-1])), "poses-reordered").sentence
    as_words = sorted(range(12), key=lambda number: str(number + 1))
    assert "as words (1, 10, 11, 2)" in of(case(true.told(true.base_from_hand[as_words])), "poses-reordered").sentence
    swapped = np.arange(12)
    swapped[[3, 7]] = 7, 3
    said = of(case(true.told(true.base_from_hand[swapped])), "poses-reordered").sentence
    assert "picture of pose 4 belongs to pose 8" in said
    assert "picture of pose 8 belongs to pose 4" in said


def test_quaternions_in_the_other_order_are_found_though_their_angles_agree():
    """The angle between two quaternions is that of their four numbers in any order."""
    true = cell(np.random.default_rng(6), 12)
    place, q = true.base_from_hand.translation, true.base_from_hand.rotation.as_quat()
    shuffled = Rotation.from_quat(q[:, [3, 0, 1, 2]])
    wrong = RobotPoses(RigidTransform.from_components(place, shuffled), others={"--rotation wxyz": true.base_from_hand})
    assert np.degrees(np.abs((shuffled[0].inv() * shuffled[1]).magnitude())) == pytest.approx(
        np.degrees((true.base_from_hand.rotation[0].inv() * true.base_from_hand.rotation[1]).magnitude())
    )
    assert of(case(true, wrong), "poses-misread").remedy == "Read them with --rotation wxyz."


def test_one_axis_is_named_with_the_direction_that_is_not_known():
    rng = np.random.default_rng(7)
    true = cell(rng, turns=about_one_axis(rng, 15), robot_deg=0.01)
    found = case(true)
    finding = of(found, "one-axis")
    axis = found.result.motions.turning.axes[0]
    turns = true.base_from_hand.rotation
    moved = (turns[0].inv() * turns[1]).as_rotvec()
    assert abs(axis @ moved / np.linalg.norm(moved)) > 0.9999
    assert f"({', '.join(f'{x:.2f}' for x in axis)}) in the hand's frame" in finding.sentence
    assert found.usable


@pytest.mark.parametrize(("second", "found"), [(LITTLE_DEG - 0.01, "little-turning"), (LITTLE_DEG, None)])
def test_ten_degrees_about_a_second_axis_are_enough(second, found):
    finding = turning_finding(
        Turning(np.array([25.0, second, 5.0]), np.eye(3)), case(cell(np.random.default_rng(8), 8)).result
    )
    assert (finding and finding.id) == found


@pytest.mark.thorough
def test_a_robot_that_did_not_turn_leaves_the_whole_place_unknown():
    true = cell(np.random.default_rng(9), turns=Rotation.from_rotvec(np.zeros((10, 3)) + [0.1, 0.2, 0]))
    found = case(true)
    assert of(found, "little-turning").severity == "fault"
    assert not found.usable


def test_a_stray_pose_is_named_with_its_picture_and_how_far_it_is_off():
    rng = np.random.default_rng(10)
    true, which = strayed(rng, cell(rng, 15), 30, 0.001)
    found = case(true, pictures=tuple(f"{i:02}.png" for i in range(15)))
    finding = of(found, "stray-pose")
    assert finding.pictures == (which,)
    assert finding.sentence.startswith(f"pose {which + 1} ({which:02}.png) is off by ")
    assert 0.02 < float(finding.sentence.split("is off by ")[1].split(" mm")[0]) / 1000 < 0.04
    assert finding.severity == "warning"
    assert found.usable


def test_a_delay_is_measured():
    true = moving(np.random.default_rng(11), 35, 0.083)  # between two of the delays that are tried first
    finding = of(case(true, RobotPoses(true.base_from_hand, times=true.times)), "time-offset")
    assert finding.value == pytest.approx(-83, abs=2)  # the robot's poses are those of 83 ms after each picture


def test_squares_of_another_length_are_told_with_the_length_that_fits():
    true = cell(np.random.default_rng(12), 15)
    told = PosedPictures(
        RobotPoses(true.base_from_hand), true.pixels, true.camera, replace(true.board, square_size=0.026)
    )
    finding = of(told, "scale-differs")
    assert finding.value == pytest.approx(1.04, abs=0.004)
    fits = float(finding.remedy.split("with ")[1].split(" mm")[0])
    assert fits == pytest.approx(25, abs=0.1)


def test_a_robot_that_disagrees_in_no_way_that_can_be_mended_is_told_from_one_per_cent_on():
    assert DISAGREE == 0.01
    true = cell(np.random.default_rng(13), 15, robot_mm=15, robot_deg=1.5)
    found = case(true)
    assert found.readings[0].error > DISAGREE * found.readings[0].adjusted.motions.lever
    assert "robot-disagrees" in [each.id for each in found.findings]


def test_with_five_poses_other_readings_are_not_tried_and_it_is_said():
    true = cell(np.random.default_rng(14), FEWEST_TRIED)
    assert of(case(scaled(true, 1000)), "wrong-unit")
    few = case(replace(true, base_from_hand=true.base_from_hand[:5], pixels=true.pixels[:5]))
    assert dict(few.skipped)["wrong-unit"] == "it takes 6 poses or more"
    assert "wrong-unit" not in few.checked


def test_without_times_no_offset_is_looked_for_and_it_is_said():
    true = cell(np.random.default_rng(15), 8)
    assert dict(case(true).skipped) == {"time-offset": "the poses have no column `time`"}
    falling = RobotPoses(true.base_from_hand, times=-np.arange(8.0))
    assert dict(case(true, falling).skipped) == {"time-offset": "the times do not rise from row to row, or are too few"}


def test_as_many_poses_as_pictures_are_needed():
    true = cell(np.random.default_rng(16), 8)
    with pytest.raises(PoseError, match="as many poses as pictures, got 7 and 8"):
        case(true, RobotPoses(true.base_from_hand[:7]))


MIS_SHIFTED = (  # x, y, z in metres and a rotation vector: a robot's table whose pictures 11 and 12 failed
    (0.922646, 0.153601, 0.503828, 2.107910, 2.141915, -0.525420),
    (0.698739, 0.046844, 0.508926, 2.042134, 2.284772, 0.047071),
    (0.569810, 0.091924, 0.491688, 1.573297, 2.195162, 0.219519),
    (0.892337, -0.159522, 0.554729, -2.251576, -1.755469, -0.043655),
    (0.632211, 0.137728, 0.538629, 1.555787, 2.248244, -0.013195),
    (0.978110, -0.133022, 0.566396, -1.667316, -2.217825, -0.077168),
    (0.847468, 0.105437, 0.661169, -1.650840, -2.637651, 0.141452),
    (0.577353, -0.034918, 0.536041, 1.615549, 2.370075, 0.389941),
    (0.636026, -0.147912, 0.662020, -2.515115, -1.711500, -0.333867),
    (0.763189, 0.098885, 0.491728, 2.041506, 2.200023, -0.086078),
    (0.686737, -0.218073, 0.599507, -2.313599, -1.710437, -0.410722),
    (0.867601, -0.021374, 0.471250, -1.729376, -2.299110, 0.107735),
    (0.582866, 0.126184, 0.463402, 1.955084, 1.906215, 0.167844),
    (0.695184, -0.174634, 0.462214, -1.564253, -2.573603, -0.810527),
    (0.842880, 0.241823, 0.580725, 1.749055, 2.425662, -0.460088),
)


@pytest.mark.parametrize("rows", [[0] * 17, [*range(9), *[9] * 8], [i // 3 * 3 for i in range(17)]])
def test_stale_poses_are_named_before_anything_is_solved(monkeypatch, rows):
    """One pose in every row, from some row on, or in blocks of three."""
    true = cell(np.random.default_rng(1), 17)
    monkeypatch.setattr("camviz_clinic.handeye.mends.likely", lambda *given: pytest.fail("solved"))
    found = case(true, RobotPoses(true.base_from_hand[rows]))
    finding = of(found, "poses-repeated")
    assert finding.severity == "fault"
    assert not found.usable
    assert ("All 17 robot poses are the same" in finding.sentence) == (set(rows) == {0})
    assert ("pose 10 to pose 17" in finding.sentence) == (rows[-1] == 9)
    assert dict(found.skipped)["poses-misread"] == "the poses must be recorded anew"


def test_one_stale_row_is_a_warning_and_a_pause_is_none():
    true = cell(np.random.default_rng(1), 17)
    stale = case(true, RobotPoses(true.base_from_hand[[0, 1, 2, 3, 4, 5, 6, 6, *range(8, 17)]]))
    assert [(each.id, each.severity) for each in stale.findings] == [
        ("poses-repeated", "warning"),
        ("stray-pose", "warning"),
    ]
    assert "pose 7 and pose 8" in stale.findings[0].sentence
    twice = [*range(17), 5]
    same = replace(true, base_from_hand=true.base_from_hand[twice], pixels=true.pixels[twice])
    assert case(same).findings == ()


@pytest.mark.parametrize(("factor", "same"), [(0.99, True), (1.01, False)])
def test_poses_within_a_robots_scatter_are_the_same(factor, same):
    apart = RigidTransform.from_components(
        [[0, 0, 0], [factor * SAME_POSE_MM / 1000, 0, 0]], Rotation.from_rotvec([[0, 0, 0], [0, 0, 0]])
    )
    turned = RigidTransform.from_rotation(
        Rotation.from_rotvec([[0, 0, 0], [factor * SAME_POSE_DEG, 0, 0]], degrees=True)
    )
    assert [_first_alike(poses)[1] == 0 for poses in (apart, turned)] == [same, same]


def test_a_rotation_that_is_never_read_is_named():
    true = cell(np.random.default_rng(1), 12)
    poses = RigidTransform.from_components(true.base_from_hand.translation, true.base_from_hand.rotation[[0] * 12])
    assert "rotation is the same in all 12 rows" in of(case(true, RobotPoses(poses)), "poses-repeated").sentence


@pytest.mark.parametrize("to_hand", [False, True])
@pytest.mark.parametrize(
    ("lost", "rows", "says"),
    [
        ((10, 2), False, "from pose 11 on each picture belongs to the pose 2 rows further down"),
        ((7, 1), False, "from pose 8 on each picture belongs to the pose 1 row further down"),
        ((6, 1), True, "from pose 7 on each picture belongs to the pose 1 row further up"),
    ],
)
def test_a_shift_is_named_with_the_row_it_begins_at(to_hand, lost, rows, says):
    true = lost_pictures(cell(np.random.default_rng(1), 17, to_hand), *lost, rows=rows)
    finding = of(case(true), "poses-shifted")
    assert says in finding.sentence
    assert f"Look for a missing {'row' if rows else 'picture'} or surplus" in finding.remedy


def test_a_shift_after_failed_pictures_is_found_by_angles():
    """Row 11 is of picture 11, which failed, as 12 did: pictures 13 to 15 belong to the poses two rows down."""
    numbers = np.array(MIS_SHIFTED)
    A = RigidTransform.from_components(numbers[:, :3], Rotation.from_rotvec(numbers[:, 3:]))
    rng = np.random.default_rng(3)
    X, Z = (RigidTransform.from_components(rng.normal(0, 1, 3), Rotation.random(random_state=s)) for s in (1, 2))
    noise = Rotation.from_rotvec(rng.normal(0, 0.2, (15, 3)), degrees=True)
    later = RigidTransform.from_components(rng.normal(0, 1, (2, 3)), Rotation.random(2, random_state=4))
    boards = X.inv() * RigidTransform.concatenate([A, later]).inv() * Z
    boards = boards[[*range(10), *range(12, 17)]] * RigidTransform.from_rotation(noise)
    assert row_shifts(A, np.arange(15), boards).tolist() == [0] * 10 + [2] * 5
    healthy = (X.inv() * A.inv() * Z) * RigidTransform.from_rotation(noise)
    assert row_shifts(A, np.arange(15), healthy) is None


@pytest.mark.parametrize(("moved", "found"), [(1, False), (MIN_SHIFT_GAIN, True)])
def test_two_pictures_more_must_agree_for_a_shift(moved, found):
    true = cell(np.random.default_rng(5), 14, robot_deg=0.001)
    boards = true.X.inv() * true.base_from_hand.inv() * true.Z
    kept = np.delete(np.arange(14), [14 - moved - 1])  # one picture is lost before the last `moved` ones
    assert (row_shifts(true.base_from_hand, np.arange(13), boards[kept]) is not None) == found


def test_large_errors_are_not_called_little_turning():
    true = cell(np.random.default_rng(8), 8)
    result = case(true).result
    noisy = replace(result, adjusted=replace(result.adjusted, noise=replace(result.noise, turn=np.radians(20))))
    finding = turning_finding(Turning(np.array([25.0, 20, 15]), np.eye(3)), noisy)
    assert (finding.id, finding.severity) == ("robot-disagrees", "fault")


@pytest.mark.parametrize(("factor", "ids"), [(0.99, []), (1.01, ["poses-repeated"])])
def test_a_board_has_moved_from_a_twentieth_of_its_distance(factor, ids):
    true = cell(np.random.default_rng(1), 6)
    found = case(true, RobotPoses(true.base_from_hand[[0, 0, 2, 3, 4, 5]]))
    turns = Rotation.from_rotvec(np.zeros((6, 3)))
    boards = RigidTransform.from_components([[0, 0, 1], [factor * MIN_BOARD_MOTION, 0, 1], *[[0, 0, 1]] * 4], turns)
    found.__dict__["cam_from_board"] = boards
    assert [each.id for each in found._repeated()] == ids


@pytest.mark.parametrize(
    ("robot", "boards", "still"),
    [(0.99, 0.99, True), (1.01, 0.99, False), (0.99, 1.01, False)],
)
def test_hand_and_boards_are_still_below_their_limits(robot, boards, still):
    found = case(cell(np.random.default_rng(1), 6))
    found.__dict__["_turned_deg"] = (robot * UNKNOWN_DEG, boards * STILL_BOARD_DEG)
    assert found._still == still
