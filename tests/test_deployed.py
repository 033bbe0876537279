"""A deployed calibration is judged by new views: what is certain is said, and what is not known is not."""

import json
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration.difference import difference
from camviz_clinic.calibration.jacobian import with_parameters
from camviz_clinic.checks import check
from camviz_clinic.checks.gaps import gaps
from camviz_clinic.checks.judgement import rated
from camviz_clinic.checks.refit import Refit, bounds, reach
from camviz_clinic.checks.virtual import SetUp, detections, pair, single, spread_boards

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def deployment():
    """A camera, its calibration from 20 views, and 25 other views of it with little noise."""
    before, after = (replace(single(np.random.default_rng(9), views=views), noise=0.08) for views in (20, 25))
    return before, before.solved(before.observed(np.random.default_rng(1))), after


def seen(set_up, camera=None, seed=2):
    """The corners that a camera sees, as if they had been found."""
    camera = camera or set_up.camera
    corners = replace(set_up, cameras=(camera,)).observed(np.random.default_rng(seed))[0]
    return detections(camera, corners)


def off_by(one, other):
    """RMS px over the image, a turn taken out, by the difference map that --compare shows."""
    return np.sqrt(np.nanmean(difference(one, other, within=inf).length ** 2))


def changed(camera, **values):
    return replace(camera, intrinsics=replace(camera.intrinsics, **values))


# The statistics ------------------------------------------------------------------------------------------------------


def test_the_bounds_are_the_extremes_over_the_ellipsoid():
    rng = np.random.default_rng(0)
    columns, root, delta = rng.normal(size=(30, 3)), rng.normal(size=(3, 3)) / 3, np.array([4.0, -3, 2])
    least, most = bounds(columns, columns @ delta, root @ root.T)
    z = rng.normal(size=(200_000, 3))
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    lengths = np.linalg.norm((delta + 2.3263 * z @ root.T) @ columns.T, axis=1)
    assert lengths.max() == pytest.approx(most, rel=1e-3)
    assert 0 < least < lengths.min()  # which is over a larger ellipsoid


@pytest.mark.thorough
def test_the_truth_lies_within_the_bounds_as_often_as_they_promise():
    """Of draws as unlike as can be: one direction that is hardly known, and a truth at 0, near by, and far off."""
    rng = np.random.default_rng(1)
    columns, deviations = rng.normal(size=(40, 5)) / 6, np.array([3, 1, 0.3, 0.3, 0.1])
    margin = 0.1 * reach(columns, np.diag(deviations**2))  # of 0 the least is a hair too large more often
    for size in (0.0, 1.0, 10.0):
        truth = size * rng.normal(size=5)
        true, below, above, count = np.linalg.norm(columns @ truth), 0, 0, 1500
        for _ in range(count):
            found = columns @ (truth + deviations * rng.normal(size=5))
            least, most = bounds(columns, found, np.diag(deviations**2))
            below, above = below + (most < true), above + (least > true + margin)
        assert below <= 0.02 * count
        assert above <= 0.02 * count


def test_chance_reaches_as_far_as_it_is_said_to():
    rng = np.random.default_rng(3)
    columns, root = rng.normal(size=(40, 5)), rng.normal(size=(5, 5))
    lengths = np.linalg.norm(rng.normal(size=(20_000, 5)) @ root.T @ columns.T, axis=1)
    assert 0.99 <= np.mean(lengths <= reach(columns, root @ root.T)) <= 0.9999


@pytest.mark.sampled(1)
@pytest.mark.parametrize("change", [{"fx": 4.0, "fy": 4.0}, {"cx": 6.0, "cy": -4.0}, {"k1": 0.006}])
def test_the_change_is_that_of_the_difference_map(deployment, change):
    """Without noise the refit finds the change; its size agrees with the map, which is made in another way."""
    _, _, after = deployment
    true = after.camera
    held = with_parameters(true, {name: getattr(true.intrinsics, name, None) or true.lens.k1 for name in change})
    values = {name: getattr(true.intrinsics if name != "k1" else true.lens, name) + by for name, by in change.items()}
    refit = Refit.of("camera", with_parameters(held, values), after.board, after.corners[0])
    assert refit.change == pytest.approx(off_by(refit.camera, true), rel=0.03)
    for name, (was, now, _) in refit.values().items():
        assert now - was == pytest.approx(-change.get(name, 0), abs=1e-4 * max(abs(was), 1))


def test_views_scatter_by_their_noise_alone_or_more(deployment):
    _, _, after = deployment
    alike = Refit.of("camera", after.camera, after.board, seen(after).corners)
    hunting = replace(after, zoom=1 + 0.01 * np.random.default_rng(4).normal(size=len(after.cam_from_board)))
    apart = Refit.of("camera", after.camera, after.board, seen(hunting).corners)
    assert 1 <= alike.scatter < 1.6
    assert apart.scatter > 5
    assert apart.noise > 2 * alike.noise


def test_a_change_of_another_kind_leaves_a_pattern(deployment):
    """k2 is not solved for; k1 makes up for the rest of it."""
    _, _, after = deployment
    lens = after.camera.lens
    other = with_parameters(after.camera, {"k1": lens.k1 - 0.06, "k2": lens.k2 + 0.3})
    patterns = [
        Refit.of("camera", after.camera, after.board, seen(after, camera).corners).pattern
        for camera in (after.camera, other)
    ]
    assert patterns[0] < 0.03 < 0.15 < patterns[1]


def test_a_verdict_is_what_is_sure():
    assert [rated(*between, 1.0) for between in ((1.1, 2), (0.6, 2), (0.4, 2), (0.4, 0.9), (0.6, 0.9))] == [
        *("fail", "warn", "inconclusive", "pass", "warn"),
    ]


def test_the_parts_of_the_image_without_corners_are_named(deployment):
    camera = deployment[0].camera
    width, height = camera.intrinsics.width, camera.intrinsics.height
    u, v = np.meshgrid(np.linspace(0, width - 1, 40), np.linspace(0, height - 1, 40))
    everywhere = np.stack([u.ravel(), v.ravel()], axis=-1)
    assert gaps(camera, everywhere) == ()
    assert gaps(camera, everywhere[everywhere[:, 0] < 0.6 * width]) == (
        *("the upper right", "the right", "the lower right", "the strip along the right border"),
    )
    middle = (np.abs(everywhere / [width, height] - 0.5) < 0.3).all(axis=1)
    assert gaps(camera, everywhere[middle]) == tuple(
        f"the strip along the {side} border" for side in ("left", "right", "upper", "lower")
    )


def test_what_a_lens_cannot_see_is_not_missed():
    """A fisheye's round picture leaves the corners of the image black."""
    grid = replace(single(np.random.default_rng(0)).camera.intrinsics, width=800, height=800, cx=399.5, cy=399.5)
    fisheye = replace(single(np.random.default_rng(0)).camera, intrinsics=replace(grid, fx=130, fy=130))
    fisheye = replace(fisheye, lens=KannalaBrandt(0, 0, 0, 0))
    angle, radius = np.meshgrid(np.linspace(0, 6.28, 60), np.linspace(20, 385, 30))
    assert gaps(fisheye, 399.5 + radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)) == ()


# The verdicts --------------------------------------------------------------------------------------------------------


def test_an_untouched_camera_passes_and_a_changed_one_fails(deployment):
    _, calibration, after = deployment
    healthy = check(calibration, seen(after))
    assert healthy.verdict == "pass"
    assert healthy.worst.reason.startswith("camera: the calibration holds: ")
    grid = after.camera.intrinsics
    for camera in (changed(after.camera, fx=1.01 * grid.fx, fy=1.01 * grid.fy), changed(after.camera, cx=grid.cx + 25)):
        found = check(calibration, seen(after, camera))
        truth = off_by(calibration.cameras["camera"], camera)
        assert found.verdict == "fail"
        assert found.worst.numbers["least_px"] < truth < found.worst.numbers["most_px"]
        assert found.worst.numbers["F_chance"] < 1e-6


def test_the_limit_decides(deployment):
    _, calibration, after = deployment
    longer = changed(after.camera, fx=1.004 * after.camera.intrinsics.fx, fy=1.004 * after.camera.intrinsics.fy)
    verdicts = [check(calibration, seen(after, longer), limit=limit).verdict for limit in (0.5, 2.0, 10.0)]
    assert verdicts == ["fail", "warn", "pass"]


def test_a_tilted_sensor_is_seen_though_it_is_not_solved_for(deployment):
    _, calibration, after = deployment
    tilted = replace(after.camera, lens=replace(after.camera.lens, tau_x=0.03, tau_y=-0.02))
    assert off_by(after.camera, tilted) > 1.5
    assert check(calibration, seen(after, tilted)).verdict == "fail"


def test_a_bent_board_does_not_condemn_the_camera(deployment):
    """The bend of a half percent of its length moves corners by many times their noise."""
    _, calibration, after = deployment
    side = (after.board.columns - 1) * after.board.square_size
    assert check(calibration, seen(replace(after, warp=(0.005 * side, 0.0)))).verdict == "pass"


def test_too_little_evidence_is_inconclusive_and_says_what_is_lacking(deployment):
    _, calibration, after = deployment
    few = replace(after, cam_from_board=after.cam_from_board[:2])
    assert check(calibration, seen(few)).verdict == "inconclusive"
    assert "at least 3 views and 60 corners" in check(calibration, seen(few)).worst.settle
    rng = np.random.default_rng(5)
    middle = replace(after, cam_from_board=spread_boards(rng, (after.camera,), after.board, 25, (15, 40), 0.4))
    found = check(calibration, seen(middle)).worst
    assert (found.verdict, "views with corners in" in found.settle) == ("inconclusive", True), found
    noisy = check(calibration, seen(replace(after, noise=0.3))).worst
    assert noisy.verdict == "inconclusive"
    assert "cannot be ruled out" in noisy.reason
    assert "views like these 25" in noisy.settle


def test_a_board_seen_square_on_alone_does_not_tell_the_focal_length(deployment):
    _, calibration, after = deployment
    rng = np.random.default_rng(6)
    flat = replace(after, cam_from_board=spread_boards(rng, (after.camera,), after.board, 25, (0, 1)))
    assert check(calibration, seen(flat)).verdict == "inconclusive"


def test_resized_pictures_are_named_and_the_formula_is_shown(deployment):
    _, calibration, after = deployment
    grid = after.camera.intrinsics
    half = replace(after.camera, intrinsics=grid.resized(grid.width // 2, grid.height // 2))
    found = check(calibration, seen(after, half)).worst
    assert found.verdict == "warn"
    assert f"{grid.width // 2}×{grid.height // 2} pixels" in found.reason
    assert "c' = s c + (s - 1)/2, with s = 0.5, the calibration holds" in found.reason
    cropped = replace(seen(after), height=grid.height - 100)
    found = check(calibration, cropped).worst
    assert (found.verdict, "c' = c - (x0, y0)" in found.settle) == ("fail", True)
    assert "which fits a crop to" in found.reason


def test_a_calibration_that_was_never_better_is_told_from_a_camera_that_changed(deployment):
    before, _, after = deployment
    rng = np.random.default_rng(8)
    poor = replace(before, noise=1.0, cam_from_board=before.cam_from_board[:5])
    calibration = poor.solved(poor.observed(rng), fixed=("k3",))
    assert off_by(calibration.cameras["camera"], after.camera) > 1.5
    found = check(calibration, seen(after)).worst
    assert (found.verdict, "its own uncertainty explains" in found.reason) == ("warn", True)
    bare = replace(calibration, intrinsics_covariance={}, estimated={})
    assert check(bare, seen(after)).verdict == "fail"


@pytest.mark.thorough
def test_corners_without_an_image_and_corners_that_are_noise(deployment):
    _, calibration, after = deployment
    folding = replace(calibration.cameras["camera"], lens=BrownConrady(k1=-2.5))
    found = check(replace(calibration, cameras={"camera": folding}), seen(after)).worst
    assert (found.verdict, "no image" in found.reason) == ("fail", True)
    wrong = seen(after)
    swapped = wrong.corners.copy()
    swapped[::2, ::3] += np.random.default_rng(0).normal(0, 60, swapped[::2, ::3].shape)
    swapped[1::2, ::2] += np.random.default_rng(0).normal(0, 60, swapped[1::2, ::2].shape)
    found = check(calibration, replace(wrong, corners=swapped)).worst
    assert (found.verdict, "contradict" in found.reason) == ("inconclusive", True)


def test_a_few_wrong_corners_are_set_aside(deployment):
    _, calibration, after = deployment
    found = seen(after)
    found.corners[3, :6] += 25.0
    judged = check(calibration, found).worst
    assert judged.verdict == "pass"
    assert (
        6 <= round(judged.numbers["set_aside"] * found.corners[..., 0].size) <= after.board.columns * after.board.rows
    )


def test_what_cannot_be_asked_is_refused(deployment):
    _, calibration, after = deployment
    found = seen(after)
    for what, words in (
        ((replace(calibration, board=None), found), "board must be given"),
        ((calibration, {"other": found}), "detections must be of camera, got other"),
        ((calibration, replace(found, corners=found.corners[:, :-1])), "corners of the board"),
        ((calibration, found, None, 0.0), "limit must be a positive number"),
    ):
        with pytest.raises(ValueError, match=words):
            check(*what)


def test_the_json_is_strict_and_has_what_the_documentation_says(deployment):
    _, calibration, after = deployment

    def refuse(word):
        raise AssertionError(word)

    tree = json.loads(check(calibration, seen(after)).as_json(), parse_constant=refuse)
    assert list(tree) == ["verdict", "limit_px", "judgements", "contradictions", "holds", "notes"]
    assert list(tree["judgements"][0]) == ["of", "verdict", "reason", "settle", "facts", "numbers"]
    page = (ROOT / "docs" / "clinic.md").read_text(encoding="utf-8")
    assert [key for key in tree["judgements"][0]["numbers"] if f"`{key}`" not in page] == []


def test_another_square_is_noted(deployment):
    _, calibration, after = deployment
    board = replace(after.board, square_size=1.1 * after.board.square_size)
    assert "squares of" in check(calibration, seen(after), board).notes[-1]


# A pair --------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stereo():
    before, after = (replace(pair(np.random.default_rng(3), views=views), noise=0.08) for views in (20, 25))
    return before.solved(before.observed(np.random.default_rng(1))), after


def judged_pair(calibration, after: SetUp, right=None):
    """The judgement on the pair, whose right camera may have moved."""
    cameras = (after.camera, right or after.cameras[1])
    corners = replace(after, cameras=cameras).observed(np.random.default_rng(2))
    found = {name: detections(camera, uv) for name, camera, uv in zip(("left", "right"), cameras, corners, strict=True)}
    return check(calibration, found, after.board).judgements[-1]


def test_a_pair_that_was_not_touched_holds(stereo):
    calibration, after = stereo
    judged = judged_pair(calibration, after)
    assert judged.verdict == "pass"
    assert judged.numbers["rectified_rows_px"]["rms"] == pytest.approx(np.sqrt(2) * after.noise, rel=0.2)
    assert abs(judged.numbers["scale"]) < 0.003


def test_a_nodding_right_camera_loses_its_rows(stereo):
    """Turned about its x axis by an angle, every row is off by f times that."""
    calibration, after = stereo
    right, angle = after.cameras[1], 2 / after.cameras[1].intrinsics.fy
    nodded = right.at(right.world_from_cam * RigidTransform.from_rotation(Rotation.from_rotvec([angle, 0, 0])))
    judged = judged_pair(calibration, after, nodded)
    assert (judged.verdict, "rows are off" in judged.reason) == ("fail", True)
    assert judged.numbers["rows_px"]["change"] == pytest.approx(2, rel=0.15)
    assert judged.numbers["rectified_rows_px"]["rms"] == pytest.approx(2, rel=0.15)


def test_a_right_camera_that_turns_inwards_loses_its_depths(stereo):
    """A yaw moves every disparity by f times its angle; ΔZ = Z² Δd/(f B)."""
    calibration, after = stereo
    right = after.cameras[1]
    f, baseline, angle = right.intrinsics.fx, np.linalg.norm(right.centre), 3 / right.intrinsics.fx
    turned = right.at(right.world_from_cam * RigidTransform.from_rotation(Rotation.from_rotvec([0, angle, 0])))
    judged = judged_pair(calibration, after, turned)
    assert (judged.verdict, "depths are off" in judged.reason) == ("fail", True)
    assert judged.numbers["disparity_px"]["change"] == pytest.approx(3, rel=0.3)
    by_formula = judged.numbers["distance_m"] * judged.numbers["disparity_px"]["change"] / (f * baseline)
    assert judged.numbers["depth_error"] == pytest.approx(by_formula, rel=0.25)


def test_a_longer_baseline_is_measured_by_the_board(stereo):
    calibration, after = stereo
    right = after.cameras[1]
    apart = right.at(RigidTransform.from_components(1.03 * right.centre, right.world_from_cam.rotation))
    judged = judged_pair(calibration, after, apart)
    assert judged.verdict == "fail"
    assert judged.numbers["scale"] == pytest.approx(0.03, abs=0.004)


def test_lengths_that_are_not_metres_have_no_scale(stereo):
    """A COLMAP model whose unit is a seventh of a metre."""
    calibration, after = stereo
    right = calibration.cameras["right"]
    scaled = right.at(RigidTransform.from_components(7 * right.centre, right.world_from_cam.rotation))
    model = replace(calibration, format="COLMAP", cameras={**calibration.cameras, "right": scaled})
    judged = judged_pair(model, after)
    assert judged.verdict == "pass"
    assert (judged.numbers["scale"], judged.numbers["depth_error"]) == (None, None)
    assert "withheld" in " ".join(judged.facts)


def test_two_shared_views_do_not_judge_a_pair(stereo):
    calibration, after = stereo
    few = replace(after, cam_from_board=after.cam_from_board[:2])
    assert judged_pair(calibration, few).verdict == "inconclusive"
