"""Several boards before one camera or many: their places, the cameras' places, and the ± of both."""

import re
from dataclasses import replace

import numpy as np
import pytest

from camviz_clinic.calibration import CannotCalibrate
from camviz_clinic.calibration.adjustment import twisted
from camviz_clinic.calibration.arrowhead import Arrowhead
from camviz_clinic.checks import inspect
from camviz_clinic.commands.board_notes import board_sentences, size_sentence
from camviz_clinic.commands.several import BoardsFile, told_of
from camviz_clinic.files import load
from camviz_clinic.files.writing import write
from camviz_clinic.rigs import calibrate_boards, relative_pose, virtual_boards

SCENES = {
    "two-sided": (virtual_boards.two_sided, ()),
    "back-to-back": (virtual_boards.back_to_back, ()),
    "markers": (virtual_boards.markers, ()),
    "parting": (virtual_boards.parting, (("one",),)),
}


def solved(scene, seed, **how):
    make, apart = SCENES[scene]
    rng = np.random.default_rng(seed)
    truth = make(rng)
    return truth, calibrate_boards(truth.observed(rng), truth.boards, apart=apart, **how)


def beside(truth, found):
    """Each relative pose of two cameras and of two boards, and the true one."""
    first, *others = truth.cameras
    for name in others:
        true = truth.cameras[first].cam_from_world * truth.cameras[name].world_from_cam
        yield relative_pose(found.adjustment, name, first), true
    for group in found.groups:
        for name in group[1:]:
            yield found.place(name), truth.places[group[0]].inv() * truth.places[name]


def errors(of, true):
    """In σ: the turns about three axes, and the three coordinates."""
    turn = (of.pose.rotation * true.rotation.inv()).as_rotvec()
    return np.concatenate([turn, of.pose.translation - true.translation]) / of.deviations


@pytest.mark.sampled(1)
@pytest.mark.parametrize("scene", SCENES)
def test_cameras_and_boards_are_where_they_are_within_three_deviations(scene, thorough):
    off, noted = [], []
    for seed in range(20 if thorough else 1):
        truth, found = solved(scene, seed, fixed=("k3",))  # boards in the middle of the picture do not decide k3
        off += [errors(*each) for each in beside(truth, found)]
        noted += [found.calibration.notes] * bool(found.calibration.notes)
        assert abs(found.adjustment.sigma - truth.noise) < 0.01
        assert board_sentences(found) == ()
        assert not any(found.undecided.values())
        said = told_of(found, BoardsFile(truth.boards, {}, found.groups, {}))
        assert not [sentence for sentence in said if "not known" in sentence]
    assert len(noted) <= (6 if thorough else 0)  # a corner is set aside by chance in one set of ten
    assert not re.search(r"[02-9] of \d+ corners|views", str(noted))
    off = np.concatenate(off)
    assert (np.abs(off) < 3).mean() >= 0.99
    assert np.sqrt(np.mean(off**2)) < 1.3


@pytest.mark.thorough
def test_opposite_cameras_never_see_one_side_of_a_plate_together_and_yet_are_placed():
    truth, found = solved("two-sided", 1)
    for board in truth.boards:
        seen = {name: found.through(board).used(name).any(axis=1) for name in ("cam0", "cam2")}
        assert not (seen["cam0"] & seen["cam2"]).any()
    place = relative_pose(found.adjustment, "cam2", "cam0")
    assert place.distance == pytest.approx(np.linalg.norm(truth.cameras["cam2"].centre), abs=0.001)


def test_cameras_without_any_common_view_are_tied_by_how_their_boards_turn():
    truth, found = solved("back-to-back", 0)
    assert not found.through("ahead").used("cam1").any()
    assert not found.through("behind").used("cam0").any()
    assert np.linalg.norm(found.adjustment.cameras["cam1"].centre - truth.cameras["cam1"].centre) < 0.02


def test_cameras_that_hardly_turn_are_not_tied():
    rng = np.random.default_rng(0)
    truth = virtual_boards.back_to_back(rng, turn=0.02)
    with pytest.raises(CannotCalibrate, match="cam0 never sees the board in one frame with cam1"):
        calibrate_boards(truth.observed(rng), truth.boards)


@pytest.mark.thorough
@pytest.mark.parametrize("factor", [0.984, 1.01])
def test_a_board_that_was_printed_in_another_size_is_measured(factor):
    rng = np.random.default_rng(3)
    truth = virtual_boards.misprinted(virtual_boards.two_sided(rng), "back", factor)
    found = calibrate_boards(truth.observed(rng), truth.boards)
    size, sigma = found.sizes["back"]
    assert abs(size - factor) < 3 * sigma
    assert size_sentence("back", size, sigma)


def seen_once(one):
    return replace(one, pictures=one.pictures[:1], corners=one.corners[:1], places=one.places[:1])


def blurred(one):
    return replace(one, corners=one.corners + np.random.default_rng(1).normal(0, 1.0, one.corners.shape))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("spoilt", "said"),
    [(seen_once, "marker1: 1 frame shows it, and its place"), (blurred, "marker1: its corners scatter")],
)
def test_a_board_that_was_seen_once_or_fits_worse_is_named_and_no_other(spoilt, said):
    rng = np.random.default_rng(2)
    truth = virtual_boards.markers(rng, count=4, frames=16)
    seen = truth.observed(rng)
    seen["cam0"]["marker1"] = spoilt(seen["cam0"]["marker1"])
    (sentence,) = board_sentences(calibrate_boards(seen, truth.boards, fixed=("k2", "k3", "p1", "p2")))
    assert sentence.startswith(said)


@pytest.mark.thorough
def test_a_known_place_is_kept_and_makes_the_cameras_better():
    truth, found = solved("two-sided", 2)
    _, held = solved("two-sided", 2, known={"back": truth.places["back"]})
    assert np.allclose(held.boards["back"].as_matrix(), truth.places["back"].as_matrix())
    assert not held.place("back").covariance.any()
    either = [relative_pose(each.adjustment, "cam2", "cam0").distance_deviation for each in (found, held)]
    assert either[1] < either[0]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["marker0", "marker1"])
def test_a_marker_that_is_taken_for_another_is_set_aside_and_the_rest_stays(name):
    rng = np.random.default_rng(5)
    truth = virtual_boards.markers(rng)
    seen = truth.observed(rng)
    one, other = seen["cam0"][name], seen["cam0"]["marker2"]
    common = sorted(set(one.places) & set(other.places))[0]
    corners = one.corners.copy()
    corners[one.places.index(common)] = other.corners[other.places.index(common)]
    seen["cam0"][name] = replace(one, corners=corners)
    found = calibrate_boards(seen, truth.boards)
    off = np.concatenate([errors(*each) for each in beside(truth, found)])
    assert np.abs(off).max() < 4.5
    assert sum(found.through(each).set_aside["cam0"].sum() for each in truth.boards) == 4
    assert found.through(name).set_aside["cam0"].sum() == 4


@pytest.fixture(scope="module")
def parallel():
    """Six frames of four markers that are all parallel to the sensor."""
    rng = np.random.default_rng(1)
    truth = virtual_boards.markers(rng, count=4, frames=6, askew=0, turn=0)
    return truth, calibrate_boards(truth.observed(rng), truth.boards, fixed=("k2", "k3", "p1", "p2"))


@pytest.mark.thorough
def test_boards_parallel_to_the_sensor_leave_the_focal_length_without_deviation(parallel):
    truth, found = parallel
    said = told_of(found, BoardsFile(truth.boards, {}, (), {}))
    assert " ± not known, fy = " in next(sentence for sentence in said if sentence.startswith("cam0: fx = "))
    assert any("cam0: the ± of fx" in sentence and "the corners do not decide" in sentence for sentence in said)
    inspection = inspect(found.through(found.largest))
    (finding,) = [each for each in inspection.findings if each.id == "unidentifiable"]
    assert "fx" in finding.sentence
    assert "fx" in inspection.as_tree()["cameras"][0]["undecided"]
    assert "± not known" in inspection.as_text()


@pytest.mark.thorough
def test_a_file_without_corners_tells_by_its_covariance_what_was_not_decided(parallel, tmp_path):
    _, found = parallel
    write(found.calibration, tmp_path / "camera.yaml", "opencv")
    inspection = inspect(load(tmp_path / "camera.yaml"))
    (finding,) = [each for each in inspection.findings if each.id == "unidentifiable"]
    assert finding.value is None
    assert "no corner moves" not in finding.sentence
    (rows,) = inspection.summary.table().values()
    assert rows["fx"].endswith("± not known")


def test_the_derivatives_of_the_pixels_are_those_of_the_equations():
    _, found = solved("two-sided", 4)
    adjustment = replace(found.adjustment, sized=(0,))
    parts = [Arrowhead.of(*adjustment._measured(name)) for name in adjustment.cameras]
    whole = sum(parts[1:], start=parts[0])
    assert np.allclose(whole.information, adjustment.normal_equations.information, rtol=1e-6, atol=1e-3)


def test_the_equations_are_those_of_finite_differences():
    _, found = solved("two-sided", 4)
    adjustment = replace(found.adjustment, sized=(0,))
    normal = adjustment.normal_equations
    for part, place in ((1, adjustment.place_of_part(1)), (0, adjustment.place_of_size(0))):
        for i in range(place.start, place.stop):
            step = np.zeros(len(adjustment.parameters))
            step[i] = 1e-6
            ends = [adjustment._moved(way * step, np.zeros((int(adjustment.posed.sum()), 6))) for way in (1, -1)]
            slope = (ends[0].sum_of_squares - ends[1].sum_of_squares) / 2e-6
            assert slope == pytest.approx(-2 * normal.shared_gradient[i], rel=1e-4, abs=0.05), (part, i)


@pytest.mark.thorough
def test_the_deviation_of_a_place_is_that_of_its_first_corner():
    _, found = solved("two-sided", 1)
    place, pose = found.adjustment.place_of_part(1), found.boards["back"]
    steps = 1e-6 * np.eye(6)
    slope = np.array([twisted(pose, step).translation - pose.translation for step in steps]).T / 1e-6
    expected = slope @ found.adjustment.covariance[place, place] @ slope.T
    assert np.allclose(found.place("back").covariance[3:, 3:], expected, rtol=1e-3, atol=1e-16)


def test_what_cannot_be_solved_is_refused_in_one_sentence():
    rng = np.random.default_rng(1)
    truth = virtual_boards.markers(rng, count=3, frames=12)
    seen = truth.observed(rng)
    with pytest.raises(ValueError, match="boards must be some of marker0, marker1, marker2, got door"):
        calibrate_boards(seen, truth.boards, apart=[["door"]])
    with pytest.raises(ValueError, match="detections must be of at least one camera, got none"):
        calibrate_boards({}, truth.boards)
    with pytest.raises(ValueError, match="detections of marker0 by cam0 must have the 54 corners of the board"):
        calibrate_boards(seen, {**truth.boards, "marker0": virtual_boards.FRONT})
    apart = {
        name: each.only([i for i, place in enumerate(each.places) if (place < 6) == (name == "marker0")])
        for name, each in seen["cam0"].items()
    }
    with pytest.raises(CannotCalibrate, match="nothing ties marker1 and marker2 to marker0"):
        calibrate_boards({"cam0": apart}, truth.boards)


def test_a_board_that_nobody_saw_is_left_out():
    rng = np.random.default_rng(1)
    truth = virtual_boards.parting(rng)
    found = calibrate_boards(truth.observed(rng), {**truth.boards, "door": virtual_boards.FRONT}, apart=[["one"]])
    assert list(found.boards) == ["one", "other"]
    with pytest.raises(ValueError, match="board must be one of no other, got one"):
        found.place("one")
