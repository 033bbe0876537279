"""The fault lab and the ward: what is shown of a fault is true, and a diagnosis is answered by what is the case."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz.cameras import Camera, Intrinsics
from camviz_clinic.calibration.difference import difference
from camviz_clinic.checks import faults
from camviz_school.course.material import module
from camviz_school.views.fault_lab import FaultLabView, grouped
from camviz_school.views.laboratory import BOARD, VIEWS, experiment, lab_faults
from camviz_school.views.ward import COMPLAINTS, HEALTHY, Ward

lesson16 = module("16")


@pytest.mark.sampled(2)
@pytest.mark.parametrize("fault", lab_faults())
def test_every_fault_at_full_strength_is_named_by_the_inspection(fault):
    for seed in (1, 2):
        found = experiment(fault, 1.0, 0.15, seed).inspection.findings
        assert faults()[fault].finding in {one.id for one in found}
        listed = grouped(found)
        assert sum(count for _, count in listed) == len(found)
        assert len({one.id for one, _ in listed}) == len(listed)


def test_a_blurred_view_is_not_blamed_on_the_tilts_of_the_boards():
    """Its boards are tilted up to 75° apart; the one bad view makes the focal length uncertain."""
    made = experiment("blurred view", 1.0, 0.15, 5)
    normals = made.solved.first_from_board.rotation.as_matrix()[..., 2]
    assert np.degrees(np.arccos((normals @ normals.T).min())) > 60
    assert made.estimates["fx"][1] > 0.01 * made.truth.intrinsics.fx
    assert "parallel-boards" not in {finding.id for finding in made.inspection.findings}


@pytest.mark.parametrize("seed", [1, 5, 9])
def test_a_healthy_camera_has_no_finding(seed):
    made = experiment("outlier corner", 0.0, 0.15, seed)
    assert not made.inspection.findings
    ratio = np.nanmedian(made.off.length) / np.nanmedian(made.believed)
    assert 0.1 < ratio < 3


def test_strength_moves_the_fault_alone():
    """Corners that the fault does not touch are the same to the last digit, and OpenCV solves for the same camera."""
    weak, strong = (experiment("column off", strength, 0.15, 3).solved.detections["camera"] for strength in (0, 1))
    moved = np.linalg.norm(weak - strong, axis=-1) > 0
    assert sorted(moved.sum(axis=1))[-2:] == [0, 6]
    assert moved[moved.any(axis=1)][0].reshape(6, 9).all(axis=0).sum() == 1
    made = experiment("column off", 0.3, 0.15, 3)
    board, corners = made.solved.board.corners.astype(np.float32), made.solved.detections["camera"].astype(np.float32)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-14)
    size, free = (640, 480), cv2.CALIB_FIX_K3
    rms, K, *_ = cv2.calibrateCamera([board] * VIEWS, list(corners), size, None, None, flags=free, criteria=stop)
    assert made.solved.rms == pytest.approx(rms, abs=1e-4)
    np.testing.assert_allclose(made.camera.intrinsics.K, K, atol=0.01)


def test_a_moved_centre_is_absorbed_by_turning_every_board():
    """Δcx = 51.2 px turns the boards by atan(Δcx/f) or, off the axis, less; the fit stays below a pixel."""
    well, ill = (experiment("moved centre", strength, 0.15, 5) for strength in (0, 1))
    turns = (ill.solved.first_from_board * well.solved.first_from_board.inv()).rotation.magnitude()
    expected = np.arctan(0.08 * 640 / well.camera.intrinsics.fx)
    np.testing.assert_allclose(turns, expected, rtol=0.25)
    assert ill.solved.rms < 1
    with pytest.raises(ValueError, match="warped board"):
        experiment("flat tyre", 0.5, 0.15, 1)


def test_arrows_lead_from_projected_to_detected_corners():
    view = FaultLabView(fault="outlier corner", strength=0.0, view=3, panels="residuals")
    made, k = view.experiment, view.experiment.camera.intrinsics
    pose, lens, detected = made.solved.first_from_board[2], made.camera.lens, made.solved.detections["camera"][2]
    distortion = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    projected, _ = cv2.projectPoints(BOARD.corners, pose.rotation.as_rotvec(), pose.translation, k.K, distortion)
    ends = projected[:, 0] + view.arrow_scale * (detected - projected[:, 0])
    panel = view.figure().marks.panels()["picture"]
    places = (np.stack([projected[:, 0], ends], axis=1) + 0.5) * (panel.width / k.width, panel.height / k.height)
    np.testing.assert_allclose(panel.marks.of("orange")[0].ends[:54], places, atol=0.01)


def test_findings_are_named_unless_they_are_hidden():
    view = FaultLabView(fault="warped board", strength=1.0)
    assert "board-warp" in written(view.figure())
    assert "board-warp" not in written(view.figure(draft=True))  # a draft does not measure
    hidden = view.but(told=False).figure()
    for words in ("board-warp", "bent", "warped"):
        assert words not in f"{written(hidden)} {hidden.description}"
    assert "is off by" not in view.but(panels="residuals bars").description()  # the lab opens with the fit alone


def test_a_readers_rms_and_verdict_stand_beside_the_right_ones():
    lab = FaultLabView(fault="column off", strength=0.2, seed=5, panels="residuals bars numbers")
    right = lab.but(yours=lesson16.view_rms, verdict=lesson16.triage).figure()
    assert "2, a row or a column is off" in written(right)
    bars = right.marks.panels()["bars"].marks
    tops = [np.concatenate([line[:, 1].min(keepdims=True) for mark in bars.of(one) for line in mark.lines])
            for one in ("fill-blue", "fill-orange")]  # fmt: skip
    np.testing.assert_allclose(np.delete(tops[1], lab.index), tops[0], atol=1e-9)
    broken = lab.but(yours=lambda residuals: residuals, verdict=lambda residuals: 7).figure()
    assert "answers in shape" in written(broken)
    assert "7, which is none of 0 to 3" in written(broken)


@pytest.fixture(scope="module")
def ward():
    return Ward(16)


@pytest.mark.thorough
def test_a_ward_has_each_fault_once_and_the_clinic_finds_it(ward):
    patients = [ward[i] for i in range(1, len(ward) + 1)]
    assert [one.finding for one in patients].count(HEALTHY) == 1
    assert len({one.finding for one in patients}) == len(ward) == 8
    for patient in patients:
        found = {finding.id for finding in patient.inspected().findings}
        assert patient.finding in found or (patient.finding == HEALTHY and not found)


def test_each_ward_has_an_order_of_its_own(ward):
    orders = {tuple(each or HEALTHY for each in Ward(number)._complaints) for number in range(12)}
    assert len(orders) == 12
    again = Ward(16)
    assert [again[i].finding for i in (1, 2)] == [ward[i].finding for i in (1, 2)]
    for bad in (0, 9, "1"):
        with pytest.raises(ValueError, match="patient must be a number from 1 to 8"):
            ward[bad]


def test_the_story_does_not_give_the_fault_away():
    """Over many wards every story comes with several faults."""
    told = {}
    for number in range(40):
        ward = Ward(number)
        for story, complaint in zip(ward._stories, ward._complaints, strict=False):
            told.setdefault(story, set()).add(complaint or HEALTHY)
    assert min(map(len, told.values())) >= len(COMPLAINTS) / 2


def test_a_diagnosis_is_answered_by_what_is_the_case():
    ward = Ward(16)
    ill = next(i for i in range(1, 9) if ward[i].finding == "wrong-size")
    well = next(i for i in range(1, 9) if ward[i].finding == HEALTHY)
    assert ward.diagnose(ill).status == "unsolved"
    assert ward.diagnose(ill, "wrong-size").correct
    assert "`numbers`" in ward.diagnose(ill, "fold").hint
    assert "clean factor" in ward.diagnose(ill, HEALTHY).hint  # the second hint says what is seen
    assert "no finding" in ward.diagnose(ill, "flu").message
    assert ward.diagnose(well, HEALTHY).correct
    assert ward.diagnose(well, "board-warp").status == "wrong"
    patient = next(i for i in range(1, 9) if ward[i].finding == "outlier-line")
    verdict = ward.diagnose(patient, "outlier-view")  # a consequence
    assert verdict.status == "wrong"
    assert "follows from something else" in verdict.message


# The exercises -------------------------------------------------------------------------------------------------------


def test_the_robust_sigma_is_that_of_a_rayleigh_distribution():
    residuals = np.random.default_rng(0).normal(0, 0.3, (200_000, 2))
    assert lesson16.robust_sigma(residuals) == pytest.approx(0.3, rel=0.01)


def test_the_implied_rotation_is_that_of_the_difference_map():
    """Two cameras whose cx is 12 px apart: the turn is that which camviz takes out, near enough atan(12/f)."""
    grid = Intrinsics(640, 480, 600, 600, 319.5, 239.5)
    cameras = [Camera(Intrinsics(640, 480, 600, 600, cx, 239.5)) for cx in (319.5, 331.5)]
    map_ = difference(*cameras, within=1000)
    rays = [camera.unproject(map_.uv).reshape(-1, 3) for camera in cameras]
    R = lesson16.implied_rotation(*rays)
    np.testing.assert_allclose(R, map_.second_from_first.rotation.as_matrix(), atol=1e-3)
    assert np.degrees(np.arccos((np.trace(R) - 1) / 2)) == pytest.approx(np.degrees(np.arctan(12 / grid.fx)), rel=0.15)
