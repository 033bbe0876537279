"""The verdict: what a calibration is good for, and no praise above an error that is useless."""

import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from calibrations import single
from matplotlib.path import Path as Outline
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.checks import accuracy as rules
from camviz_clinic.checks import inspect, words
from camviz_clinic.checks.accuracy import CameraAccuracy
from camviz_clinic.checks.between_views import CORNER_SIGMAS, Partings
from camviz_clinic.checks.findings.boards import coverage
from camviz_clinic.checks.observed import Observed
from camviz_clinic.checks.summary import Summary
from camviz_clinic.checks.task import DEPTHS, MATCHING_PX, TaskError
from camviz_clinic.checks.virtual import healthy, single_in_the_middle
from camviz_clinic.checks.virtual import single as set_up
from camviz_clinic.commands.command import main
from camviz_clinic.handeye import telling
from camviz_clinic.report.findings import verdict_html

PRAISE = "No problem found"
SHOTS = Path(os.environ.get("CAMVIZ_SAMPLES", ""), "opencv-samples")
needs_shots = pytest.mark.skipif(
    "CAMVIZ_SAMPLES" not in os.environ, reason="CAMVIZ_SAMPLES does not name a folder with OpenCV's photographs"
)


def camera(covered_px=0.5, corner_px=1.0, halves_px=0.0):
    return CameraAccuracy("camera", 0.6, covered_px / 10, covered_px, corner_px / 10, corner_px, halves_px)


def said(*cameras, monkeypatch):
    """The verdict without findings on cameras of these accuracies."""
    given = {each.camera: each for each in cameras}
    monkeypatch.setattr(rules, "camera_accuracy", lambda _, name: given[name])
    evidence = SimpleNamespace(calibration=SimpleNamespace(detections=given), cameras=given)
    return words.verdict((), ("fold",), (), accuracy=rules.accuracy(evidence))


@pytest.mark.parametrize(
    ("good", "bad", "tells"),
    [
        ({"corner_px": 4.99}, {"corner_px": 5.01}, "In the worst corner ±0.5° (±5 px): add images with the board in"),
        ({"covered_px": 4.99}, {"covered_px": 5.01}, "Not good for measuring: ±0.5° (±5 px) in the 60 % of the image"),
        ({"halves_px": 9.98}, {"halves_px": 10.02}, ", and halves of the images differ by 10 px: add images with"),
        ({}, {"halves_px": np.inf}, ", and half of the images give a lens without a ray there: add images with"),
        ({"corner_px": np.nan}, {"corner_px": np.inf}, "In the worst corner the lens has no ray: add images with"),
        ({"corner_px": np.nan}, {"corner_px": np.nan, "halves_px": 11.0}, "In the worst corner halves of the images"),
    ],
)
def test_praise_ends_where_an_error_is_useless(good, bad, tells, monkeypatch):
    assert PRAISE in said(camera(**good), monkeypatch=monkeypatch)
    verdict = said(camera(**bad), monkeypatch=monkeypatch)
    assert PRAISE not in verdict
    assert tells in verdict


def test_one_bad_camera_of_many_decides(monkeypatch):
    """The sixth, of which no table tells."""
    rig = [replace(camera(), camera=f"cam{i}") for i in range(6)]
    assert PRAISE in said(*rig, monkeypatch=monkeypatch)
    rig[5] = replace(rig[5], corner_px=30.0)
    verdict = said(*rig, monkeypatch=monkeypatch)
    assert verdict.startswith("The least accurate camera, cam5: good to ±0.05° in the 60 % of the image")
    assert PRAISE not in verdict


def test_a_camera_of_unknown_accuracy_is_named(monkeypatch):
    monkeypatch.setattr(rules, "camera_accuracy", lambda _, name: camera() if name == "left" else None)
    names = ("left", "right")
    found = rules.accuracy(SimpleNamespace(calibration=SimpleNamespace(detections=names), cameras=names))
    assert found.sentence.endswith(" Accuracy is not known of right: the corners do not determine it.")
    assert found.sufficient is False


@pytest.mark.parametrize(("px", "is_good"), [(0.99, True), (1.01, False)])
def test_depth_is_useless_beyond_a_pixel_of_disparity(px, is_good):
    """Of a pair of f B = 80 px m, a disparity's σ of d px is Z² d/(f B) of depth."""
    values = {}
    for z in DEPTHS:
        own, matching = (1000 * z**2 * error / 80 for error in (px, MATCHING_PX))
        values |= {f"depth_{z:g}m_mm": np.hypot(own, matching), f"calibration_{z:g}m_mm": own}
    found = rules._pair_accuracy(TaskError(("left", "right"), "", values))
    assert found.sufficient is is_good
    assert (
        f"Depth at the centre is good to ±{100 * np.hypot(px, 0.25) / 80:.2g} % at 1 m" in found.sentence
    ) is is_good


@pytest.mark.parametrize(
    ("mm", "deg", "is_good"), [(9.9, 0.1, True), (10.1, 0.1, False), (1, 0.57, True), (1, 0.58, False)]
)
def test_a_hand_eye_place_is_useless_beyond_a_hundredth_of_the_distance(mm, deg, is_good):
    """A board 1 m away; a hundredth of a radian is 0.573°."""
    result = SimpleNamespace(translation_sigma=np.array([0, mm / 1000, 0]), rotation_sigma=np.radians([deg, 0, 0]))
    board = SimpleNamespace(translation=np.array([[0, 0, 1.0]] * 3))
    found = telling._accuracy(SimpleNamespace(findings=(), result=result, cam_from_board=board))
    assert found.sufficient is is_good
    assert (PRAISE in words.verdict((), (), (), accuracy=found)) is is_good


def test_healthy_cameras_have_no_problem_and_boards_in_the_middle_do():
    """The third lens turns back before all four corners, where no board was."""
    for seed in range(5):
        calibration = healthy(np.random.default_rng(seed))
        assert PRAISE in inspect(calibration).verdict
        rng = np.random.default_rng(seed)
        middle = single_in_the_middle(rng, 0.3)
        found = Summary.of(middle.solved(middle.observed(rng))).accuracy
        assert found.sufficient is False


def test_halves_that_noise_parts_are_not_held_against_a_camera():
    """Of healthy views every half agrees in the corners; a focal length that jumps between the halves does not."""
    rng = np.random.default_rng(0)
    true = set_up(rng, views=16)
    steady = Partings.of(Observed("camera", Adjustment.of(true.solved(true.observed(rng)))))
    assert (steady.in_time.corner, steady.by_turns.corner) == (0, 0)
    jump = replace(true, zoom=np.repeat([1.0, 1.05], 8))
    moved = Partings.of(Observed("camera", Adjustment.of(jump.solved(jump.observed(rng), robust=False))))
    assert moved.in_time.corner > 5
    assert CORNER_SIGMAS > 3.7


@pytest.mark.parametrize("seed", [0, 3])
def test_coverage_is_the_area_of_the_boards_pixel_by_pixel(seed):
    calibration = healthy(np.random.default_rng(seed))
    k = calibration.cameras["camera"].intrinsics
    pixels = np.stack(np.meshgrid(np.arange(k.width), np.arange(k.height)), axis=-1).reshape(-1, 2)
    covered = np.zeros(len(pixels), bool)
    for view in calibration.detections["camera"]:
        covered |= Outline(view[ConvexHull(view).vertices]).contains_points(pixels)
    found = coverage(calibration.detections["camera"], calibration.cameras["camera"])
    assert found == pytest.approx(covered.mean(), abs=0.005)
    verdict = Summary.of(calibration).accuracy.sentence
    assert f"in the {100 * found:.0f} % of the image that the boards covered" in verdict


def test_the_plus_minus_is_the_scatter_of_solutions_anew():
    """Sets of corners of one camera: where a far point in a corner of the image is, relative to all boards."""
    rng = np.random.default_rng(2)
    true = set_up(rng, views=16)
    k = true.camera.intrinsics
    corners = np.array([(0.0, 0.0), (k.width - 1, 0), (0, k.height - 1), (k.width - 1, k.height - 1)])
    off, told = [], []
    for _ in range(24):
        solved = true.solved(true.observed(rng), robust=False)
        told.append(Summary.of(solved).accuracy.values[0]["corner_deg"])
        turned = solved.cam_from_board["camera"].rotation * true.cam_from_board.rotation.inv()
        rays, found = (
            each.lens.unproject(each.intrinsics.from_pixels(corners))
            for each in (true.camera, solved.cameras["camera"])
        )
        off.append(found - Rotation.mean(turned).apply(rays))
    spread = [np.sqrt(np.linalg.eigvalsh(each.T @ each / len(each))[-1]) for each in np.swapaxes(off, 0, 1)]
    assert np.degrees(max(spread)) == pytest.approx(np.sqrt(np.mean(np.square(told))), rel=0.3)


@needs_shots
def test_opencvs_left_photographs_are_not_praised(tmp_path, monkeypatch, capsys):
    """Their boards cover 42 % of the image; in a corner the direction is known to ±35 px."""
    monkeypatch.chdir(tmp_path)
    shots = sorted(str(path) for path in SHOTS.glob("left[0-9]*.jpg"))
    board = ["--board", "9x6", "--square-mm", "25"]
    assert main(["calibrate", *shots, *board, "-o", "left.yml", "--report", "left.html", "--junit", "left.xml"]) == 0
    printed = capsys.readouterr().out
    verdict = "Good to ±0.048° in the 42 % of the image that the boards covered. In the worst corner ±2° (±35 px)"
    junit = ElementTree.parse(tmp_path / "left.xml").findtext(".//testsuite/system-out")
    page = (tmp_path / "left.html").read_text(encoding="utf-8")
    for text in (printed, page, junit):
        assert verdict in text
        assert PRAISE not in text
        assert "Nothing" not in text.split("Next")[0]


def test_a_verdict_without_praise_is_not_green():
    assert "#00785a" in verdict_html(inspect(single(30, 0.01)))
    assert "#00785a" not in verdict_html(inspect(single()))
