"""The board's bend is solved for where views agree on it and it foretells others better, and its ± holds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from boards import BOARD, CAMERA, RIGHT, board_poses, noisy, truth
from commandline import main, refused
from scipy.stats import f as fisher

import camviz_clinic
from camviz_clinic.calibration import board_warp, calibrate, calibrate_pair
from camviz_clinic.calibration.board_warp import earns_its_place, probability_by_views, warp_test, with_board_warp
from camviz_clinic.calibration.cross_validation import held_out, held_out_rms
from camviz_clinic.checks.inspection import inspect
from camviz_clinic.checks.virtual import detections
from camviz_clinic.files.writing import write
from camviz_clinic.rigs import calibrate_rig

SIGMA = 0.2
BENT = np.array([4e-4, -2e-4])
FIXED = ("k3",)


def drawn(seed, views=12, warp=(0.0, 0.0), each_way=0.0):
    """Noisy views of a board that has this bend, and is bent another way in every view by `each_way` metres besides."""
    rng = np.random.default_rng(seed)
    poses = board_poses(rng, views)
    bends = np.asarray(warp) + rng.normal(0, each_way, (views, 2))
    seen = [truth(poses[i : i + 1], warp=bend).detections["camera"] for i, bend in enumerate(bends)]
    return noisy(replace(truth(poses), detections={"camera": np.concatenate(seen)}), rng, SIGMA)


def problem(*args, **how):
    """The same, solved with a flat board."""
    return drawn(*args, **how).refined()


def seen(adjustment, name="camera"):
    return detections(adjustment.cameras[name], adjustment.detections[name])


# What is told is true -------------------------------------------------------------------------------------------------


def test_a_bend_is_recovered_within_its_deviations_and_the_focal_length_with_it():
    """Sagittas of 0.4 and -0.2 mm of a board of 200 mm: flat, the focal length is off by 0.3 % and more."""
    views = seen(drawn(1, warp=BENT))
    flat, auto, on = (calibrate(views, BOARD, fixed=FIXED, board_warp=word) for word in ("off", "auto", "on"))
    assert flat.board_warp is None
    np.testing.assert_allclose(auto.board_warp, on.board_warp, rtol=0, atol=1e-9)
    assert (np.abs(auto.board_warp - BENT) < 3 * np.sqrt(np.diag(auto.board_warp_covariance))).all()
    assert np.sqrt(np.diag(auto.board_warp_covariance)).max() < 1e-4
    off = [abs(each.cameras["camera"].intrinsics.fx / CAMERA.intrinsics.fx - 1) for each in (flat, auto)]
    assert off[0] > 0.003 > 0.0015 > off[1]


def test_the_intervals_of_the_bend_hold(thorough):
    """68 % of sagittas are within their ±, and of eight views 91 % within 1.96 (Student's t with 7 degrees of freedom).

    Whether each view has another bend besides or not; 0.85 is three standard errors below.
    """
    count = 100 if thorough else 5
    for each_way in (0, 3e-4):
        ratios = []
        for seed in range(count):
            bent = replace(drawn(100 + seed, 8, BENT, each_way), warp=np.zeros(2)).refined()
            ratios.append((bent.warp - BENT) / np.sqrt(np.diag(bent.warp_covariance)))
        assert np.mean(np.abs(ratios) < 1) > (0.55 if thorough else 0.4)
        assert np.mean(np.abs(ratios) < 1.96) > (0.85 if thorough else 0.7)
        assert np.sqrt(np.mean(np.square(ratios))) > 0.6


def test_opencvs_boards_are_bent_as_mrcal_has_it(opencv_views):
    """mrcal-calibrate-cameras (Debian's mrcal 2.2), from these corners of left01-14.jpg with LENSMODEL_OPENCV5, has
    calobject_warp -0.02667 and -0.18049 mm."""
    found = calibrate(opencv_views, BOARD, board_warp="auto")
    assert 1000 * found.board_warp == pytest.approx([-0.02667, -0.18049], abs=0.005)
    assert (np.sqrt(np.diag(found.board_warp_covariance)) > 0.02e-3).all()  # the noise of the corners says 0.016


@pytest.fixture(scope="module")
def opencv_views():
    from camviz_clinic.calibration import detect
    from camviz_school.samples import SampleUnavailable, sample

    try:
        paths = [sample(f"left{number:02}.jpg") for number in range(1, 15) if number != 10]
    except SampleUnavailable as error:
        pytest.skip(str(error))
    return detect(paths, BOARD, workers=1)


# Whether it earns its place -------------------------------------------------------------------------------------------


def test_the_probability_is_hotellings_of_solutions_without_each_view():
    """Solved anew without each view in turn, the scatter of the bends is its covariance to a few per cent."""
    flat = problem(2, 9, BENT / 3)
    bent = replace(flat, warp=np.zeros(2)).refined()
    others = [bent.only(np.arange(9) != view).refined().warp for view in range(9)]
    covariance = 8 / 9 * sum(np.outer(each - bent.warp, each - bent.warp) for each in others)
    T2 = bent.warp @ np.linalg.solve(covariance, bent.warp)
    expected = fisher.sf(T2 * 7 / (2 * 8), 2, 7)
    assert 1e-5 < expected < 0.5
    assert np.log(probability_by_views(bent)) == pytest.approx(np.log(expected), abs=0.3)
    assert probability_by_views(flat) == pytest.approx(probability_by_views(bent), rel=0.05)  # one step is enough


def test_boards_that_bend_another_way_in_every_view_stay_flat(thorough):
    """The F-test over corners calls boards bent that are so in single views; over views at most 5 % are."""
    count = 100 if thorough else 4
    flat = [problem(300 + seed, 10, each_way=5e-4) for seed in range(count)]
    by_corners = sum(warp_test(each).bowed(board_warp.FALSE_ALARMS) for each in flat)
    earned = sum(earns_its_place(each) for each in flat)
    assert by_corners >= 0.75 * count
    assert earned <= 0.05 * count


def test_the_test_over_views_is_tried_at_its_threshold(monkeypatch):
    flat = problem(1, warp=BENT)
    chance = probability_by_views(flat)
    bent = probability_by_views(replace(flat, warp=np.zeros(2)).refined())
    for limit, earned in ((max(chance, bent) * 1.001, True), (min(chance, bent) * 0.999, False)):
        for name in ("FALSE_ALARMS", "CERTAIN"):
            monkeypatch.setattr(board_warp, name, limit)
        assert earns_its_place(flat) is earned


def test_five_views_are_too_few_and_six_are_not():
    bent = problem(4, 6, 3 * BENT)
    assert probability_by_views(bent) < board_warp.FALSE_ALARMS
    assert probability_by_views(bent.only(range(5)).refined()) == 1


def test_where_the_views_are_certain_held_out_views_are_not_asked(monkeypatch):
    """A bend of which one flat board in a thousand would have the like is taken in, whatever the folds say."""
    flat = problem(1, warp=BENT)
    assert probability_by_views(flat) < board_warp.CERTAIN
    monkeypatch.setattr(board_warp, "held_out_rms", lambda one, folds: float(one.warp is not None))
    assert earns_its_place(flat)
    monkeypatch.setattr(board_warp, "CERTAIN", 0.0)
    assert not earns_its_place(flat)


@pytest.mark.thorough
def test_a_bend_that_foretells_held_out_views_worse_is_left_out(monkeypatch):
    """With the test over views passed by all, the errors of held-out views alone decide, one way and the other."""
    monkeypatch.setattr(board_warp, "FALSE_ALARMS", 1.0)
    monkeypatch.setattr(board_warp, "CERTAIN", 0.0)
    decided = []
    for seed in (500, 501):
        flat = problem(seed, 6)
        bent = replace(flat, warp=np.zeros(2)).refined()
        errors = [held_out_rms(each, board_warp.FOLDS) for each in (bent, flat)]
        assert earns_its_place(flat) is (errors[0] < errors[1])
        decided.append(errors[0] < errors[1])
    assert set(decided) == {True, False}


def test_the_error_of_held_out_views_is_that_of_held_out():
    flat = problem(3, 10)
    assert held_out_rms(flat, 5) == pytest.approx(held_out(flat, folds=5).rms, rel=1e-4)


def test_it_is_solved_for_always_or_never_where_that_is_asked():
    flat = problem(6)
    assert with_board_warp(flat, "off", lambda each: each.refined()) is flat
    assert with_board_warp(flat, "auto", lambda each: each.refined()) is flat
    assert with_board_warp(flat, "on", lambda each: each.refined()).warp is not None


# Pairs, rigs, views that are set aside --------------------------------------------------------------------------------


def test_a_pair_and_a_rig_have_one_board_and_one_bend():
    rng = np.random.default_rng(7)
    both = noisy(truth(board_poses(rng, 10), {"left": CAMERA, "right": RIGHT}, warp=BENT), rng, SIGMA)
    views = {name: seen(both, name) for name in both.cameras}
    pair = calibrate_pair(*views.values(), BOARD, fixed=FIXED, board_warp="auto")
    rig = calibrate_rig(views, BOARD, fixed=FIXED, board_warp="on")
    for found in (pair, rig):
        assert (np.abs(found.board_warp - BENT) < 4 * np.sqrt(np.diag(found.board_warp_covariance))).all()
        assert found.rms("left") < 1.5 * SIGMA * np.sqrt(2)


def test_a_view_that_is_set_aside_is_posed_with_the_bend_of_the_others():
    """Its own corners, which are wrong, must not bend the board."""
    solved = drawn(8, warp=BENT)
    corners = solved.detections["camera"].copy()
    corners[3] += np.random.default_rng(0).normal(0, 15, corners[3].shape)
    found = calibrate(detections(CAMERA, corners), BOARD, fixed=FIXED, board_warp="on")
    assert found.set_aside["camera"][3].sum() > 40
    assert (np.abs(found.board_warp - BENT) < 4 * np.sqrt(np.diag(found.board_warp_covariance))).all()


# The command and the file ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def corners(tmp_path_factory):
    """A file of corners of a bent board."""
    path = tmp_path_factory.mktemp("corners") / "corners.vnl"
    rows = ["# filename x y level"]
    for number, view in enumerate(drawn(1, warp=BENT).detections["camera"]):
        rows += [f"view{number:02}.png {f'{u:.6f} {v:.6f} 0' if np.isfinite(u) else '- - -'}" for u, v in view]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return ("--corners", str(path), "--board", "9x6", "--square-mm", "25", "--size", "640x480", "--fix", "k3")


def test_the_command_tells_and_keeps_the_bend_and_inspect_tells_it_again(corners, room, capsys):
    assert main(("calibrate", *corners, "-o", "bent.yaml")) == 0
    assert "The board's bend was solved for: 0." in capsys.readouterr().out
    kept = camviz_clinic.load(room / "bent.yaml")
    assert (np.abs(kept.board_warp - BENT) < 3 * np.sqrt(np.diag(kept.board_warp_covariance))).all()
    main(("inspect", "bent.yaml", "--json"))
    told = json.loads(capsys.readouterr().out)["board_warp"]
    assert told["mm"] == pytest.approx(1000 * kept.board_warp)
    assert told["sigma_mm"] == pytest.approx(1000 * np.sqrt(np.diag(kept.board_warp_covariance)))
    assert "The board's bend was solved for" in inspect(kept).as_text()


def test_the_bend_can_be_forbidden(corners, room, capsys):
    assert main(("calibrate", *corners, "-o", "flat.yaml", "--board-warp", "off")) == 0
    assert "bend" not in capsys.readouterr().out
    assert camviz_clinic.load(room / "flat.yaml").board_warp is None
    assert "board_warp" not in inspect(camviz_clinic.load(room / "flat.yaml")).as_tree()


def test_a_wrong_word_is_refused_in_a_sentence(corners, room, capsys):
    said = refused(capsys, room, "calibrate", *corners, "--board-warp", "flat")
    assert "--board-warp" in said
    assert "auto" in said
    views = seen(drawn(1))
    for solve in (
        lambda: calibrate(views, BOARD, board_warp="flat"),
        lambda: calibrate_pair(views, views, BOARD, board_warp="flat"),
        lambda: calibrate_rig({"a": views, "b": views}, BOARD, board_warp="flat"),
    ):
        with pytest.raises(ValueError, match="board_warp must be one of off, auto, on, got 'flat'"):
            solve()


def test_a_file_with_a_bend_of_another_program_has_no_deviation_to_tell(room):
    solved = calibrate(seen(drawn(1)), BOARD, fixed=FIXED)
    write(replace(solved, board_warp=BENT), room / "other.yaml", "opencv")
    text = inspect(camviz_clinic.load(room / "other.yaml")).as_text()
    assert "0.4 mm along its rows, −0.2 mm along its columns" in text
