"""The fault lab and the ward: what is shown of a fault is true, and a diagnosis is answered by what is the case."""

import re

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.draw.panel import image_in
from camviz_clinic.calibration.difference import difference
from camviz_clinic.checks import faults
from camviz_school.course.material import module
from camviz_school.views.fault_lab import FaultLabView, grouped
from camviz_school.views.laboratory import BOARD, VIEWS, experiment, lab_faults
from camviz_school.views.ward import COMPLAINTS, HEALTHY, Ward

lesson16 = module("16")


def names(made):
    return {finding.id for finding in made.inspection.findings}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("fault", lab_faults())
def test_every_fault_at_full_strength_is_named_by_the_inspection(fault):
    for seed in (1, 2):
        assert faults()[fault].finding in names(experiment(fault, 1.0, 0.15, seed))


def test_a_blurred_view_is_not_blamed_on_the_tilts_of_the_boards():
    """Its boards are tilted up to 75° apart; the one bad view makes the focal length uncertain."""
    made = experiment("blurred view", 1.0, 0.15, 5)
    normals = made.solved.first_from_board.rotation.as_matrix()[..., 2]
    assert np.degrees(np.arccos((normals @ normals.T).min())) > 60
    assert made.estimates["fx"][1] > 0.01 * made.truth.intrinsics.fx
    assert "parallel-boards" not in {finding.id for finding in made.inspection.findings}


@pytest.mark.parametrize("seed", [1, 5, 9])
def test_a_healthy_camera_has_no_finding_and_is_as_far_off_as_it_believes(seed):
    made = experiment("outlier corner", 0.0, 0.15, seed)
    assert not made.inspection.findings
    ratio = np.nanmedian(made.off.length) / np.nanmedian(made.believed)
    assert 0.1 < ratio < 3


def test_the_camera_is_the_one_that_opencv_solves_for():
    """Least squares of the same corners, from the truth here and from nothing there: the same to 0.01 px."""
    made = experiment("column off", 0.3, 0.15, 3)
    board, corners = made.solved.board.corners.astype(np.float32), made.solved.detections["camera"].astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-14)
    rms, K, *_ = cv2.calibrateCamera(
        [board] * VIEWS, list(corners), (640, 480), None, None, flags=cv2.CALIB_FIX_K3, criteria=criteria
    )
    assert made.solved.rms == pytest.approx(rms, abs=1e-4)
    np.testing.assert_allclose(made.camera.intrinsics.K, K, atol=0.01)


def test_strength_moves_the_fault_alone():
    """Corners that the fault does not touch are the same to the last digit whatever its strength."""
    weak, strong = (experiment("column off", strength, 0.15, 3).solved.detections["camera"] for strength in (0, 1))
    moved = np.linalg.norm(weak - strong, axis=-1) > 0
    assert sorted(moved.sum(axis=1))[-2:] == [0, 6]
    grid = moved[moved.any(axis=1)][0].reshape(6, 9)
    assert grid.all(axis=0).sum() == 1


def test_a_moved_principal_point_is_absorbed_by_turning_every_board():
    """Δcx = 51.2 px turns the boards by atan(Δcx/f) or, off the axis, less; the fit stays below a pixel."""
    well, ill = (experiment("moved centre", strength, 0.15, 5) for strength in (0, 1))
    turns = (ill.solved.first_from_board * well.solved.first_from_board.inv()).rotation.magnitude()
    expected = np.arctan(0.08 * 640 / well.camera.intrinsics.fx)
    np.testing.assert_allclose(turns, expected, rtol=0.25)
    assert ill.solved.rms < 1


@pytest.mark.parametrize("name", FaultLabView.controls())
def test_every_control_changes_the_picture(name):
    control = FaultLabView.controls()[name]
    base = FaultLabView(fault="warped board", strength=0.5)
    ends = control.choices or ((control.low, control.high) if control.low is not None else (True, False))
    assert len({base.but(**{name: end}).figure(draft=True).svg() for end in ends}) == len(ends)


def test_a_draft_measures_and_the_fine_picture_names_the_finding():
    view = FaultLabView(fault="warped board", strength=1.0)
    assert "measuring" in view.figure(draft=True).body
    fine = view.figure()
    assert "measuring" not in fine.body
    assert "board-warp" in fine.body
    assert "board-warp" in fine.description


def test_hidden_findings_are_nowhere_in_the_picture():
    picture = FaultLabView(fault="warped board", strength=1.0, told=False).figure()
    for words in ("board-warp", "bent", "warped"):
        assert words not in picture.svg()


def test_arrows_lead_from_projected_to_detected_corners():
    view = FaultLabView(fault="outlier corner", strength=0.0, view=3, panels="residuals")
    body = view._image_panel()
    data = re.findall(r'<path d="([^"]*)" class="orange"', body)[0]
    shafts = np.array([list(map(float, one)) for one in re.findall(r"M([-\d.]+),([-\d.]+)L([-\d.]+),([-\d.]+)", data)])
    made, k = view.experiment, view.experiment.camera.intrinsics
    pose, lens, detected = made.solved.first_from_board[2], made.camera.lens, made.solved.detections["camera"][2]
    distortion = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    projected, _ = cv2.projectPoints(BOARD.corners, pose.rotation.as_rotvec(), pose.translation, k.K, distortion)
    panel = image_in(view._layout["residuals"], "picture", k.width, k.height)
    ends = projected[:, 0] + view.arrow_scale * (detected - projected[:, 0])
    np.testing.assert_allclose(shafts[:54], np.hstack([panel.place(projected[:, 0]), panel.place(ends)]), atol=0.06)


def test_clicking_a_bar_chooses_its_view():
    view = FaultLabView()
    panel = view._bars
    for wanted in (1, 7, VIEWS):
        x = panel.x + panel.place((wanted, 0))[0]
        assert view.dragged("bars", x, panel.y + 5, 0, 0).view == wanted
    assert view.pressed("bars", "ArrowLeft").view == 1
    assert view.but(view=3).pressed("bars", "ArrowRight").view == 4


def test_findings_of_one_kind_are_counted():
    made = FaultLabView(fault="blurred view", strength=1.0).experiment
    listed = grouped(made.inspection.findings)
    assert sum(count for _, count in listed) == len(made.inspection.findings)
    assert len({finding.id for finding, _ in listed}) == len(listed)


def test_an_unknown_fault_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match="warped board"):
        experiment("flat tyre", 0.5, 0.15, 1)


@pytest.fixture(scope="module")
def ward():
    return Ward(16)


@pytest.mark.thorough
def test_a_ward_has_one_healthy_patient_and_each_fault_once(ward):
    findings = [ward[i].finding for i in range(1, len(ward) + 1)]
    assert findings.count(HEALTHY) == 1
    assert len(set(findings)) == len(ward) == 8


@pytest.mark.thorough
def test_the_clinic_finds_what_every_patient_has(ward):
    for patient in (ward[i] for i in range(1, len(ward) + 1)):
        found = {finding.id for finding in patient.inspected().findings}
        assert patient.finding in found or (patient.finding == HEALTHY and not found)


def test_another_ward_has_its_patients_in_another_order_and_the_same_one_is_the_same(ward):
    orders = {tuple(each or HEALTHY for each in Ward(number)._complaints) for number in range(12)}
    assert len(orders) == 12
    again = Ward(16)
    assert [again[i].finding for i in (1, 2)] == [ward[i].finding for i in (1, 2)]


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


def test_a_consequence_is_told_from_a_cause():
    ward = Ward(16)
    patient = next(i for i in range(1, 9) if ward[i].finding == "outlier-line")
    verdict = ward.diagnose(patient, "outlier-view")
    assert verdict.status == "wrong"
    assert "follows from something else" in verdict.message


@pytest.mark.parametrize("bad", [0, 9, "1"])
def test_a_patient_who_is_not_there_is_named(ward, bad):
    with pytest.raises(ValueError, match="patient must be a number from 1 to 8"):
        ward[bad]


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


def test_a_reader_s_functions_are_shown_beside_the_right_ones_whatever_they_do():
    lab = FaultLabView(fault="column off", strength=0.2, seed=5, panels="residuals bars numbers")
    right = lab.but(yours=lesson16.view_rms, verdict=lesson16.triage).figure().svg()
    assert "2, a row or a column is off" in right
    assert "fill-orange" in right
    wrong = lab.but(yours=lambda residuals: None, verdict=lambda residuals: 7).figure().svg()
    assert "yours appears here" in wrong
    assert "7, which is none of 0 to 3" in wrong
    broken = lab.but(yours=lambda residuals: residuals, verdict=lambda residuals: 1 / 0).figure().svg()
    assert "answers in shape" in broken
    assert "ZeroDivisionError" in broken


def test_the_lab_opens_with_the_fit_alone():
    few = FaultLabView(fault="warped board", panels="residuals bars")
    for later in ("is off by", "What the clinic finds", "less the truth"):
        assert later not in few.figure().svg()
        assert later not in few.description()
    assert "is off by" in few.but(panels="numbers").description()
    for wrong in ("bars picture", ""):
        with pytest.raises(ValueError, match="panels must be one or more of residuals, bars"):
            few.but(panels=wrong)


@pytest.mark.parametrize("panels", ["bars", "estimates findings", "residuals bars numbers estimates findings"])
def test_panels_stand_where_nothing_else_does(panels):
    tiles = FaultLabView(fault="blurred view", strength=1.0, panels=panels).figure().tiles
    assert min(tile.cell[0] for tile in tiles) == min(tile.cell[1] for tile in tiles) == 0
    for i, (x, y, wide, tall) in enumerate(tile.cell for tile in tiles):
        for left, top, other_wide, other_tall in (tile.cell for tile in tiles[:i]):
            apart = x >= left + other_wide or left >= x + wide or y >= top + other_tall or top >= y + tall
            assert apart
