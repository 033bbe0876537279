"""What corners cannot decide: against poses that are solved for anew, many solutions, other units, and in words."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.identifiability import UNDECIDED, undecided
from camviz_clinic.calibration.jacobian import parameter, with_parameters
from camviz_clinic.checks import check, faults, inspect
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import kinds
from camviz_clinic.checks.summary import Summary
from camviz_clinic.checks.virtual import detections, healthy, healthy_pair, single
from camviz_clinic.commands.telling import report
from camviz_clinic.live.session import Session, TakenView
from camviz_clinic.report.findings import glance_html
from camviz_clinic.views.correlation import CorrelationView

NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
NOISE = 0.2


def exact(tilt_deg, seed=3, names=NAMES):
    """The problem of a virtual camera at its truth, with corners that have no noise."""
    set_up = single(np.random.default_rng(seed), tilt_deg=(0, tilt_deg))
    seen = {"camera": set_up.corners[0]}
    return Adjustment(set_up.board, {"camera": set_up.camera}, seen, set_up.cam_from_board, {"camera": names})


def injected(name, strength, seed=20_003):
    return faults()[name].inject(np.random.default_rng(seed), strength)


@pytest.mark.parametrize("tilt_deg", [0.5, 2])
def test_where_the_poses_follow_the_change_no_corner_moves_by_more_than_is_said(tilt_deg):
    """The change itself, and not its derivative: poses solved for anew leave what is foretold."""
    problem = exact(tilt_deg)
    one = undecided(problem, "camera", NOISE)[0]
    assert set(one.changes) == {"fx", "fy"}
    camera = problem.cameras["camera"]
    values = {key: parameter(camera, key) + by for key, by in zip(one.names, one.direction, strict=True)}
    changed = replace(problem, cameras={"camera": with_parameters(camera, values)})
    moved = np.linalg.norm(changed.residuals["camera"], axis=-1)
    left = np.linalg.norm(changed.refined(only_poses=True).residuals["camera"], axis=-1)
    longer = max(camera.intrinsics.width, camera.intrinsics.height)
    assert moved.max() > UNDECIDED * longer / 3  # held boards show it plainly
    assert left.max() < one.most + 0.02
    assert left.max() < 0.005 * moved.max()


def test_how_far_the_farthest_corner_moves_is_so_to_first_order():
    """A twentieth of the change, where what is quadratic in it has gone: the poses solved for anew, and the longest."""
    problem, step = exact(4), 0.05
    one = undecided(problem, "camera", NOISE)[0]
    camera = problem.cameras["camera"]
    values = {key: parameter(camera, key) + step * by for key, by in zip(one.names, one.direction, strict=True)}
    changed = replace(problem, cameras={"camera": with_parameters(camera, values)}).refined(only_poses=True)
    left = np.linalg.norm(changed.residuals["camera"], axis=-1).max()
    assert left / step == pytest.approx(one.most, rel=0.15)


@pytest.mark.thorough
def test_the_standard_deviation_is_the_scatter_of_many_solutions():
    """Boards tilted by up to 4°, so that a solution does not run away: fx of 24 sets of noise."""
    problem, rng = exact(4), np.random.default_rng(5)
    one = undecided(problem, "camera", NOISE)[0]
    place = NAMES.index("fx")
    found = []
    for _ in range(24):
        seen = problem.detections["camera"]
        noisy = replace(problem, detections={"camera": seen + rng.normal(0, NOISE, seen.shape)}).refined()
        found.append(noisy.intrinsics("camera")[place])
    expected = one.deviation * abs(one.direction[place])
    assert np.std(found) == pytest.approx(expected, rel=0.35)


def test_the_unit_of_the_board_does_not_matter():
    """In millimetres the same parameters change by the same amounts."""
    problem = exact(1)
    large = replace(
        problem,
        board=replace(problem.board, square_size=1000 * problem.board.square_size),
        first_from_board=type(problem.first_from_board).from_components(
            1000 * problem.first_from_board.translation, problem.first_from_board.rotation
        ),
    )
    for one, other in zip(undecided(problem, "camera", NOISE), undecided(large, "camera", NOISE), strict=True):
        assert one.changes == pytest.approx(other.changes, rel=1e-3)
        assert one.deviation == pytest.approx(other.deviation, rel=1e-3)


def test_a_parameter_that_is_held_is_not_undecided():
    """With fx and fy known, parallel boards leave fewer combinations open, and none with a focal length."""
    free = exact(0.5)
    held = replace(free, estimated={"camera": NAMES[2:]})
    assert len(undecided(held, "camera", NOISE)) < len(undecided(free, "camera", NOISE))
    assert not any({"fx", "fy"} & set(each.changes) for each in undecided(held, "camera", NOISE))


def test_bad_corners_do_not_pass_for_missing_views():
    """The noise of ordinary corners is the most that counts."""
    problem = exact(40)
    assert undecided(problem, "camera", 100.0) == ()


def test_what_a_solver_assumes_does_not_decide():
    """The strict prior gives k4, k5 and k6 a ± of its own; the corners do not tell them from k1, k2 and k3."""
    evidence = injected("rational model of a mild lens", 6)
    place = evidence.calibration.estimated["camera"].index("k4")
    assert np.sqrt(evidence.calibration.intrinsics_covariance["camera"][place, place]) < 0.05
    named = {key for each in evidence.undecided("camera") for key in each.changes}
    assert {"k1", "k4"} <= named
    assert not {"fx", "fy", "cx", "cy"} & named


def test_what_the_other_camera_sees_can_only_help():
    """The information of both is that of one and more."""
    evidence = Evidence(healthy_pair(np.random.default_rng(2)))
    together = evidence.adjustment("left", "right")
    for name in ("left", "right"):
        assert evidence.undecided(name) == ()
        follow = np.linalg.inv(together.normal_equations.information)[together.intrinsics_of(name)]
        joint = np.linalg.inv(follow[:, together.intrinsics_of(name)])
        single_one = evidence.adjustment(name).normal_equations.information
        scale = np.sqrt(np.diag(single_one))
        assert np.linalg.eigvalsh((joint - single_one) / np.outer(scale, scale)).min() > -1e-6


# In words ------------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "strength", "cause", "severity", "said"),
    [
        ("boards parallel to the sensor", 0.5, "parallel-boards", "warning", "do not decide fx and fy together"),
        ("terms without corners", 0.15, "low-coverage", "warning", "do not decide k1, k2 and k3 together"),
        ("rational model of a mild lens", 6, None, "note", "the camera sees the same either way"),
        ("thin prism and tilt", 6, None, "note", "tau_x"),
        ("few views", 1, "low-coverage", "warning", "fx"),
    ],
)
def test_it_stands_below_what_explains_it_and_is_a_note_where_the_camera_sees_the_same(
    name, strength, cause, severity, said
):
    (finding,) = [
        each for each in inspect(injected(name, strength).calibration).findings if each.id == "unidentifiable"
    ]
    assert finding.consequence_of == cause
    assert finding.severity == severity
    assert said.lower() in finding.sentence.lower()
    assert finding.value < NOISE


def test_a_healthy_camera_leaves_nothing_open():
    evidence = Evidence(healthy(np.random.default_rng(7)))
    assert evidence.undecided("camera") == ()
    assert list(kinds()["unidentifiable"].check(evidence)) == []
    assert "undecided" not in json.loads(inspect(evidence.calibration).as_json())["cameras"][0]


def test_a_deviation_that_the_corners_do_not_decide_is_withheld_everywhere():
    calibration = injected("boards parallel to the sensor", 0.5).calibration
    summary = Summary.of(calibration)
    rows = summary.table()["camera"]
    assert rows["fx"].endswith(" ± not known")
    assert "± not known" not in rows["k1"] or "k1" in summary.undecided("camera")
    (why,) = summary.withheld
    assert why in "\n".join(summary.lines())
    assert why in glance_html(summary)
    told = report(calibration)
    assert any("fx = " in line and "± not known" in line for line in told)
    assert why in told
    tree = json.loads(inspect(calibration).as_json())
    assert {"fx", "fy"} <= set(tree["cameras"][0]["undecided"])


def test_no_number_of_the_glance_is_larger_than_the_picture_or_a_right_angle():
    lines = "\n".join(Summary.of(injected("boards parallel to the sensor", 0.5).calibration).lines())
    assert not re.search(r"±[\d.]+e\+0[3-9]", lines)
    assert "not known" in lines


def test_check_withholds_the_deviation_of_what_new_views_do_not_decide():
    """A good calibration, checked with boards that are all parallel to the sensor."""
    rng = np.random.default_rng(11)
    set_up = single(rng)
    calibration = set_up.solved(set_up.observed(rng))
    flat = single(np.random.default_rng(11), tilt_deg=(0, 0.2))
    assert (flat.camera.intrinsics, flat.camera.lens) == (set_up.camera.intrinsics, set_up.camera.lens)
    (judgement,) = check(calibration, {"camera": detections(flat.camera, flat.observed(rng)[0])}).judgements
    assert judgement.verdict == "inconclusive"
    assert any("(± not known)" in fact for fact in judgement.facts)
    assert any("do not decide fx" in fact for fact in judgement.facts)
    assert judgement.numbers["parameters"]["fx"]["sigma"] is None


def test_the_correlations_show_no_deviation_of_what_the_corners_do_not_decide():
    shown = CorrelationView.of(injected("parallel boards", 3.0).calibration)
    assert shown.deviations()["fx"] == shown.deviations()["fy"] == "not known"
    assert shown.deviations()["cx"].startswith("±")
    assert "fx not known; fy not known; cx ±" in shown.description()
    assert "not known" in [text.words for text in shown.figure().marks.texts()]
    sound = CorrelationView.of(healthy(np.random.default_rng(18)))
    assert "not known" not in sound.deviations().values()


@pytest.mark.parametrize(("tilt_deg", "known"), [(1, False), (40, True)])
def test_a_live_session_gives_fx_a_deviation_only_where_the_corners_decide_it(tilt_deg, known, monkeypatch):
    set_up = single(np.random.default_rng(5), tilt_deg=(0, tilt_deg))
    seen = set_up.observed(np.random.default_rng(6))[0]
    session = Session(set_up.board)
    gray = np.zeros((set_up.camera.intrinsics.height, set_up.camera.intrinsics.width), np.uint8)
    session.views = tuple(TakenView(gray, corners) for corners in seen[:-1])
    monkeypatch.setattr("camviz_clinic.live.session.find_corners", lambda gray, board: seen[-1])
    assert np.isfinite(session._solved(gray).known.sigma) == known
