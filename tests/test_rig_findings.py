"""What only several cameras show is named in simulated rigs, with its number, and nothing in healthy ones."""

from dataclasses import replace

import numpy as np
import pytest

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings import rig as checks
from camviz_clinic.checks.inspection import inspect
from camviz_clinic.checks.virtual import healthy
from camviz_clinic.rigs import calibrate_rig, virtual
from camviz_clinic.rigs.series import by_themselves, delays, frame_numbers, jumps

KINDS = (
    checks.rig_islands,
    checks.rig_one_frame,
    checks.rig_one_axis,
    checks.rig_late,
    checks.rig_moved,
    checks.rig_exchanged,
)


def found(evidence):
    """The findings of a rig's own kinds, by their ids; a check that lacks something finds nothing."""
    all_of_them = []
    for kind in KINDS:
        try:
            all_of_them += list(kind.check(evidence))
        except NotChecked:
            assert kind is checks.rig_exchanged  # without another calibration
    return {each.id: each for each in all_of_them}


def film(seed, cameras=3, frames=24, **faults):
    rng = np.random.default_rng(seed)
    truth = virtual.film(rng, cameras, frames=frames)
    return truth, replace(truth, **faults), rng


def alone(truth, rng):
    """Each camera by itself with its true lens, as a solution from many views would have it, and the frames."""
    seen, rows = truth.observed(rng), len(truth.world_from_board)
    corners = {}
    for name, each in seen.items():
        corners[name] = np.full((rows, truth.board.columns * truth.board.rows, 2), np.nan)
        corners[name][list(each.places)] = each.corners
    solved = calibrate_rig(virtual.film(np.random.default_rng(1), 2, frames=6).observed(rng), truth.board)
    calibration = replace(solved, cameras=truth.cameras, detections=corners, estimated={}, set_aside={})
    return by_themselves(calibration), np.arange(rows)


@pytest.mark.thorough
@pytest.mark.parametrize("frames", [pytest.param(1, marks=pytest.mark.thorough), -2, 0.5])
def test_a_delay_is_measured_to_a_quarter_of_a_frame_and_its_camera_named(frames):
    truth, late, rng = film(3, frames=72, late={"cam1": frames})  # between two frames the board goes nearly straight on
    measured = delays(*alone(late, rng))
    assert list(measured) == ["cam1"]
    assert measured["cam1"].frames == pytest.approx(frames, abs=0.26)
    assert delays(*alone(truth, rng)) == {}


def test_a_delay_between_two_cameras_is_told_of_the_second():
    _, late, rng = film(4, cameras=2, late={"cam0": 1})
    measured = delays(*alone(late, rng))
    assert list(measured) == ["cam1"]
    assert measured["cam1"].frames == pytest.approx(-1, abs=0.26)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["cam0", "cam2"])
def test_a_camera_that_was_moved_is_named_with_the_first_frame_after_it(name):
    truth, _, rng = film(5)
    knock = RigidTransform.from_components([0.01, 0, 0], Rotation.from_rotvec([0, 0.02, 0]))
    moved = replace(truth, knocked={name: (15, truth.cameras[name].world_from_cam * knock)})
    shown = jumps(alone(moved, rng)[0])
    assert list(shown) == [name]
    assert shown[name].row == 15
    assert shown[name].across == pytest.approx(0.02 * 1100, rel=0.5)  # by a turn of 0.02 rad at f = 1100 px
    assert jumps(alone(truth, rng)[0]) == {}


def test_frames_are_numbered_by_their_pictures_where_these_tell():
    pictures = {"a": ("a/07.png", "frame 2 without a board"), "b": ("b/07.png", "b/09.png")}
    there = {"a": np.array([True, False]), "b": np.array([True, True])}
    assert frame_numbers(pictures, there, 2).tolist() == [7, 9]
    assert frame_numbers({"a": ("x.png", "y.png")}, {"a": np.array([True, True])}, 2).tolist() == [0, 1]


@pytest.mark.parametrize("fault", [checks.two_groups, checks.one_frame, checks.turntable, checks.exchanged])
def test_a_rigs_fault_is_named_and_no_other(fault, thorough):
    """Two cameras that are nearly alike need not be told apart: `exchanged` is named in 49 of 50."""
    count = 10 if thorough else 1
    named = [set(found(fault.inject(np.random.default_rng(70 + seed), fault.promised))) for seed in range(count)]
    assert named.count({fault.finding}) >= count - (fault is checks.exchanged and thorough)
    assert set().union(*named) == {fault.finding}


def test_nothing_is_found_in_healthy_rigs(thorough):
    for seed in range(10 if thorough else 1):
        rng = np.random.default_rng(80 + seed)
        truth = virtual.rig(rng, 3, frames=8, shared=0.5)
        assert found(Evidence(calibrate_rig(truth.observed(rng), truth.board))) == {}


def test_one_frame_in_common_is_named_and_two_are_not():
    for count, named in ((1, {"rig-one-frame"}), (2, set())):
        assert set(found(checks.one_frame.inject(np.random.default_rng(75), count))) == named


def test_a_board_that_wobbles_on_its_turntable_as_a_hand_does_is_turned_about_more_than_one_axis():
    for degrees, named in ((1, {"rig-one-axis"}), (3, set())):
        assert set(found(checks.turntable.inject(np.random.default_rng(70), degrees))) == named


def test_a_single_camera_is_not_checked_as_a_rig():
    evidence = Evidence(healthy(np.random.default_rng(1)))
    for kind in KINDS:
        with pytest.raises(NotChecked, match="the file holds one camera, not a rig"):
            list(kind.check(evidence))


def mentioned(calibration, **more):
    """Which of a rig's kinds an inspection says anything of."""
    inspection = inspect(calibration, **more)
    said = {*inspection.checked, *(id for id, _ in inspection.skipped)}
    assert ("rig-" in inspection.as_text()) == bool({kind.id for kind in KINDS} & said)
    return {kind.id for kind in KINDS} & said


@pytest.mark.thorough
def test_a_report_says_nothing_of_rigs_but_of_what_may_be_one():
    """Not of one camera, nor of a pair without frames; of a pair with frames and of any rig. What compares them is
    mentioned where they are compared.
    """
    of_frames = {kind.id for kind in KINDS} - {"rig-exchanged"}
    rng = np.random.default_rng(76)
    truth = virtual.rig(rng, 3, frames=6, shared=0.5)
    solved = calibrate_rig({name: each for name, each in truth.observed(rng).items() if name != "cam2"}, truth.board)
    bare = replace(solved, detections={}, cam_from_board={})
    assert mentioned(healthy(rng)) == set()
    assert mentioned(bare) == set()
    assert mentioned(bare, compare=solved) == {"rig-exchanged"}
    assert mentioned(solved) == of_frames
    assert mentioned(solved, compare=bare) == of_frames | {"rig-exchanged"}
    assert mentioned(replace(bare, cameras=truth.cameras)) == of_frames
