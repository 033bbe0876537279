"""Findings are told by their causes: what follows from one stands under it, with its remedy."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks import Inspection, faults, inspect, inspect_file, kinds
from camviz_clinic.checks.causes import by_causes
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.fields import smooth_field
from camviz_clinic.checks.findings.model import richer
from camviz_clinic.checks.observed import explained
from camviz_clinic.checks.registry import SEVERITIES
from camviz_clinic.checks.virtual import single as set_up_of
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.report.findings import findings_html
from camviz_clinic.report.inspection import report

DATA = Path(__file__).parent / "data"


def wrong_model(seed=3, spoil=None):
    """A fisheye that a Brown–Conrady polynomial with k1 and k2 was fitted to, with all its corners."""
    rng = np.random.default_rng(seed)
    set_up = set_up_of(rng)
    grid = replace(set_up.camera.intrinsics, fx=0.45 * set_up.camera.intrinsics.width)
    camera = replace(set_up.camera, lens=KannalaBrandt(0.05, -0.02, 0.0, 0.0), intrinsics=replace(grid, fy=grid.fx))
    poses = spread_boards(rng, (camera,), set_up.board, 15, (15, 40))
    set_up = replace(set_up, cameras=(camera,), cam_from_board=poses, noise=0.1)
    (corners,) = set_up.observed(rng)
    if spoil:
        spoil(corners)
    solved = set_up.solved((corners,), fixed=("k2", "k3", "p1", "p2"), robust=spoil is None)
    return Inspection.of(Evidence(solved))


def test_a_wrong_model_comes_first_and_owns_its_folds():
    inspection = wrong_model()
    cause, *others = inspection.findings
    assert cause.id == "model-too-simple"
    follow = [each for each in others if each.consequence_of == "model-too-simple"]
    assert {"fold", "split-disagreement"} <= {each.id for each in follow} <= set(kinds()["model-too-simple"].explains)
    assert others[: len(follow)] == follow
    assert {each.remedy for each in follow} == {cause.remedy}
    assert cause.severity == min((each.severity for each in inspection.findings), key=SEVERITIES.index)
    assert inspection.verdict.startswith("Most likely a lens model with too few terms: solve again with")


def test_text_json_page_and_notebook_tell_the_same_consequences():
    inspection = wrong_model()
    ids = [each.id for each in inspection.findings if each.consequence_of]
    told = [line.split()[3].rstrip(":") for line in inspection.as_text().splitlines() if line.startswith("    → ")]
    assert told == ids
    tree = json.loads(inspection.as_json())["findings"]
    assert [each["id"] for each in tree if each["consequence_of"]] == ids
    for html in (report(inspection), findings_html(inspection)):
        below = html.split('<ol class="consequences"')[1].split("</ol>")[0]
        assert [part.split("<")[0] for part in below.split("<code>")[1:]] == ids


def test_a_view_that_no_wrong_model_explains_stands_for_itself():
    """A view that scatters by 60 px is off by far more than the smooth field of the same set."""

    def spoil(corners):
        corners[4] += np.random.default_rng(0).normal(0, 60, corners[4].shape)

    found = wrong_model(spoil=spoil).findings
    (line,) = [each for each in found if each.pictures == (4,) and not each.consequence_of]
    (view,) = [each for each in found if each.pictures == (4,) and each.consequence_of]
    assert (line.id, view.id, view.consequence_of) == ("outlier-line", "outlier-view", "outlier-line")
    assert found[0].id == "model-too-simple"


def test_of_two_that_explain_each_other_the_larger_is_the_cause():
    explains = {"fold": ("near-pole",), "near-pole": ("fold",)}
    mutual = {id: replace(kinds()[id], explains=explains[id]) for id in explains}
    small, large = mutual["fold"].found("a: b.", 1, "px"), mutual["near-pole"].found("a: b.", 2, "px")
    for found in ([small, large], [large, small]):
        assert [each.consequence_of for each in by_causes(found, mutual)] == [None, "near-pole"]


def test_other_cameras_and_other_pictures_are_not_explained():
    line, view = kinds()["outlier-line"].found, kinds()["outlier-view"].found
    found = [
        line("a: b.", 9, "px", "left", pictures=(1,)),
        view("a: b.", 8, "px", "left", pictures=(1,)),
        view("a: b.", 8, "px", "left", pictures=(2,)),
        view("a: b.", 8, "px", "right", pictures=(1,)),
    ]
    told = by_causes(found, kinds())
    assert [each.consequence_of for each in told] == [None, "outlier-line", None, None]


def test_what_is_the_same_in_many_frames_is_said_once(tmp_path):
    """Every frame's matrix of a transforms.json scaled by 1.1."""
    tree = json.loads((DATA / "transforms.json").read_text())
    frame = tree["frames"][0]
    matrix = np.array(frame["transform_matrix"])
    matrix[:3, :3] *= 1.1
    tree["frames"] = [frame | {"transform_matrix": matrix.tolist(), "file_path": f"{i}.png"} for i in range(298)]
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(tree))
    (finding,) = [each for each in inspect_file(path).findings if each.id == "not-a-rotation"]
    assert finding.count == 298
    assert finding.value == pytest.approx(0.21)
    assert "297 times more" in finding.sentence


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["swapped cameras", "inverted transform", "zeroed distortion", "column off"])
def test_the_fault_that_was_put_in_is_named_first(name):
    fault = faults()[name]
    inspection = Inspection.of(fault.inject(np.random.default_rng(20_003), fault.promised))
    assert inspection.findings[0].id == fault.finding


def test_nothing_wrong_has_no_cause():
    assert inspect(faults()["strong lens"].inject(np.random.default_rng(1), 0.35).calibration).verdict.startswith(
        "No problem found, 1 note below. "
    )


def test_a_fold_beyond_the_last_corner_is_a_note_and_its_remedy_names_a_term_of_the_lens():
    """With k2 = -0.26 the border folds at 39.4°; boards in the middle of the image do not reach it."""
    camera = Camera(Intrinsics.from_fov(640, 480, 62), BrownConrady(-0.2, -0.26))
    (alone,) = [each for each in inspect(Calibration({"c": camera}, Path("a"), "")).findings if each.id == "fold"]
    assert (alone.severity, alone.remedy.split(",")[0]) == ("fault", "Fix k2 to 0")
    middle = {"c": np.full((1, 4, 2), 320.0) + [[[0, 0], [9, 0], [0, 9], [9, 9]]]}
    seen = Calibration({"c": camera}, Path("a"), "", detections=middle)
    assert {each.severity for each in inspect(seen).findings if each.id == "fold"} == {"note"}


def test_a_fisheye_is_undistorted_by_the_function_for_fisheyes():
    camera = Camera(Intrinsics.from_fov(1280, 960, 120), KannalaBrandt(0.6, 0.4, 0.0, 0.0))
    found = inspect(Calibration({"c": camera}, Path("a"), "")).findings
    (finding,) = [each for each in found if each.id == "inverse-not-converged"]
    assert "c: cv2.fisheye.undistortPoints without criteria" in finding.sentence
    assert "cv2.fisheye.undistortPoints" in finding.remedy


def test_a_pattern_below_a_tenth_of_a_pixel_is_no_wrong_model():
    """A lens whose r⁵ term is left out, seen without noise to speak of: certain, and too small to matter."""
    rng = np.random.default_rng(20_003)
    set_up = replace(richer(rng, set_up_of(rng), 1.0, widest=1.0, views=15), noise=0.01)
    solved = set_up.solved(set_up.observed(rng), fixed=("k2", "p1", "p2", "k3"))
    best = Evidence(solved).observed["camera"].best
    field = explained(best, "camera", smooth_field(best, "camera"))
    assert field.part > 0.5
    assert field.chance < 1e-6
    assert field.pixels < 0.1
    assert "model-too-simple" not in {each.id for each in inspect(solved).findings}
