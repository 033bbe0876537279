"""An inspection names every fault of the symptom table at the strength it promises, and nothing in healthy ones."""

import re
from functools import cache
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from camviz_clinic.checks import Inspection, faults, inspect, kinds
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.registry import SEVERITIES
from camviz_clinic.checks.statistics import alarms
from camviz_clinic.checks.virtual import MARGIN, healthy, healthy_pair, pair, single
from camviz_school.course.reading import LONGEST_SENTENCE, paragraphs, sentences

CLINIC = run_path(str(Path(__file__).parents[1] / "tools/docs/clinic.py"))
PAGE, TABLES, page = (CLINIC[name] for name in ("PAGE", "TABLES", "page"))
FAULTS = faults()
SEED = 20_003


@cache
def found(name: str, strength: float):
    """The findings that a fault must lead to."""
    inspection = Inspection.of(FAULTS[name].inject(np.random.default_rng(SEED), strength))
    return [finding for finding in inspection.findings if finding.id == FAULTS[name].finding]


SLOW = (  # a rig's; tests/test_rig_findings.py names four kinds in smaller ones
    "camera a frame late",
    "two folders exchanged",
    "board on a turntable",
    "camera knocked",
    "one frame in common",
    "cameras in two groups",
)


EACH = [pytest.param(name, marks=[pytest.mark.thorough] if name in SLOW else []) for name in FAULTS]


@pytest.mark.parametrize("name", EACH)
def test_a_fault_is_named_at_the_strength_that_is_promised(name):
    fault = FAULTS[name]
    assert found(name, fault.promised)
    assert fault.promised in fault.strengths


def test_every_finding_has_a_fault_that_leads_to_it():
    assert {fault.finding for fault in FAULTS.values()} == set(kinds())


@pytest.mark.parametrize(
    "seed", [*range(20_100, 20_103), *(pytest.param(n, marks=pytest.mark.thorough) for n in range(20_103, 20_106))]
)
def test_nothing_is_found_in_a_healthy_camera(seed):
    assert alarms(Evidence(healthy(np.random.default_rng(seed)))) == []


@pytest.mark.parametrize("seed", [20_100, 20_101])
def test_nothing_is_found_in_a_healthy_pair(seed):
    assert alarms(Evidence(healthy_pair(np.random.default_rng(seed)))) == []


def test_a_set_up_is_the_same_whatever_the_strength():
    """Two injections with one seed differ by the fault alone: the parallel boards are at the same places."""
    inject = FAULTS["parallel boards"].inject
    first, second = (inject(np.random.default_rng(3), strength).calibration for strength in (2.0, 2.5))
    middles = [each.board.corners.mean(axis=0) for each in (first, second)]
    places = [
        np.stack([pose.apply(middle) for pose in each.cam_from_board["camera"]])
        for each, middle in zip((first, second), middles, strict=True)
    ]
    directions = [place / np.linalg.norm(place, axis=1, keepdims=True) for place in places]
    assert np.abs(directions[0] - directions[1]).max() < 0.02


@pytest.mark.parametrize(("seed", "views"), [(20_007, 1), (20_010, 2), (20_006, 3)])
def test_views_counted_backwards_do_not_wreck_the_pair(seed, views):
    """With these seeds they once did: lenses that folded, and ten findings beside the one that matters."""
    truth = pair(np.random.default_rng(seed)).cameras
    solved = FAULTS["order flipped"].inject(np.random.default_rng(seed), views).calibration
    for camera, true in zip(solved.cameras.values(), truth, strict=True):
        assert camera.intrinsics.fx == pytest.approx(true.intrinsics.fx, rel=0.01)
    assert [mask.all(axis=1).sum() for mask in solved.set_aside.values()] == [0, views]


@pytest.mark.parametrize("make", [single, pair])
def test_all_boards_of_a_set_up_are_seen_whole(make):
    set_up = make(np.random.default_rng(11))
    for camera, corners in zip(set_up.cameras, set_up.corners, strict=True):
        edge = [camera.intrinsics.width - 1 - MARGIN, camera.intrinsics.height - 1 - MARGIN]
        assert (corners > MARGIN).all()
        assert (corners < edge).all()


# The number that a finding carries is the fault's own ----------------------------------------------------------------


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("name", "strength", "value", "tolerance"),
    [
        ("blurred view", 10, 10 * np.sqrt(2), 2),
        ("half pixel", 0.5, 0.5, 0.05),
        ("half pixel between two", 1, 1, 1e-9),
        ("autofocus drift", 3, 3, 0.5),
        ("resized K", 1.5, 1.5, 1e-9),
        ("resized K", 0.5, 0.5, 1e-9),
        ("resized pictures", 1.25, 1.25, 1e-3),
        ("uneven resize", 1.33, 1.33, 0.01),
        ("near-pole rational model", 0.05, 0.05, 0.04),
        ("square in millimetres", 1000, 25, 6),
        ("wrong square", 20, 1.2, 0.01),
        ("edited rotation", 0.3, 0.3, 0.3),
        ("transposed K", 2, 2, 1e-12),
        ("mislabelled coefficients", 8, 8, 0),
        ("order flipped", 1, 180, 15),
        ("zeroed distortion", 1, -0.2, 0.05),
    ],
)
def test_the_number_that_shows_a_fault_is_its_strength(name, strength, value, tolerance):
    finding, *_ = found(name, strength)
    assert finding.value == pytest.approx(value, abs=tolerance)


def test_the_bend_of_a_board_is_found_within_a_tenth():
    """2 % of the longer side, along the rows."""
    case = FAULTS["warped board"].inject(np.random.default_rng(SEED), 2)
    board = case.calibration.board
    (finding,) = [each for each in Inspection.of(case).findings if each.id == "board-warp"]
    side = (max(board.columns, board.rows) - 1) * board.square_size
    assert finding.value == pytest.approx(0.02 * side * 1000, rel=0.1)


def test_a_turn_of_the_whole_world_changes_nothing():
    """Findings are about cameras, not about where the file puts its origin."""
    calibration = healthy(np.random.default_rng(SEED))
    camera = calibration.cameras["camera"]
    moved = RigidTransform.from_components([1, 2, 3], camera.world_from_cam.rotation)
    turned = type(calibration)(
        {"camera": camera.at(moved)},
        Path("virtual"),
        calibration.format,
        calibration.board,
        calibration.detections,
        calibration.cam_from_board,
        estimated=calibration.estimated,
    )
    assert inspect(turned).findings == inspect(calibration).findings


# Words ---------------------------------------------------------------------------------------------------------------

VIEWS = {  # those that the report has
    *("residual-vectors", "per-view-errors", "residual-histogram", "residual-radius", "coverage", "uncertainty"),
    *("uncertainty-range", "difference", "distortion", "fold-map", "undistorted", "boards", "epipolar-pairs"),
    *("rectified", "depth-error", "cross-validation", "correlation", "board-residuals", "numbers"),
}


def test_no_sentence_about_a_finding_is_longer_than_a_reader_keeps_in_mind():
    """The declarations, and the whole of docs/clinic.md; sentences begin with a capital and end with a full stop."""
    for kind in kinds().values():
        for said in (kind.symptom, kind.remedy, kind.evidence, kind.threshold):
            assert said.endswith(".")
            assert not said[0].islower() or said.startswith(("cx", "fx", "t.x"))
        assert not any(cause.endswith(".") for cause in kind.causes)
    assert all(fault.sentence.endswith(".") for fault in FAULTS.values())
    words = {
        sentence: len(sentence.split())
        for paragraph in paragraphs(PAGE.read_text(encoding="utf-8"))
        for sentence in sentences(paragraph)
    }
    assert {sentence for sentence, count in words.items() if count > LONGEST_SENTENCE} == set()


@pytest.mark.parametrize("name", EACH)
def test_what_an_inspection_says_is_short_and_begins_with_the_claim(name):
    for finding in found(name, FAULTS[name].promised):
        assert all(len(sentence.split()) <= LONGEST_SENTENCE for sentence in sentences(finding.sentence))
        assert finding.sentence.endswith((".", "?"))


def test_every_finding_has_a_view_of_the_report_a_cause_and_a_remedy():
    for kind in kinds().values():
        assert kind.view in VIEWS
        assert kind.severity in SEVERITIES
        assert kind.causes
        assert kind.remedy.endswith(".")


def test_the_page_says_what_the_table_of_findings_says():
    """docs/clinic.md, but for the counted tables. To renew it: python tools/docs/clinic.py --page"""
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(text.split(TABLES)[1].lstrip())


def test_the_scoreboard_counts_its_own_alarms():
    """The sentences below the table of other people's pictures, counted again in its last column."""
    _, board = PAGE.read_text(encoding="utf-8").split("## Scoreboard")
    found: dict[str, str] = {}
    for line in board.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 8 and cells[0] not in ("set", "---"):
            found[cells[0]] = found.get(cells[0], "") + cells[-1]
    quiet = sum("(" not in said for said in found.values())
    assert f"{quiet} of {len(found)} have nothing worse than a note" in board
    for id in ("low-coverage", "parallel-boards", "split-disagreement"):
        number = sum(f"`{id}`" in said for said in found.values())
        assert re.search(rf"`{id}` (is named on {number} sets|\({number}( sets)?\))", board), (id, number)
