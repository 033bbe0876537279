"""The clinic's views draw what is the case: residuals where they are, maps whose contours tell the truth."""

import re
from dataclasses import replace
from math import radians
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from calibrations import BOARD, RIGHT_FROM_LEFT, TRUE, bare, pair, poses, seen, sick, single, solved
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.cameras import Camera, Intrinsics, transform
from camviz.draw.panel import Panel
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.uncertainty import projection_uncertainty
from camviz_clinic.views.board_residuals import BoardResidualsView
from camviz_clinic.views.catalogue import VIEWS, Case
from camviz_clinic.views.correlation import CorrelationView
from camviz_clinic.views.coverage import CoverageView
from camviz_clinic.views.cross_validation import CrossValidationView
from camviz_clinic.views.depth import DepthErrorView
from camviz_clinic.views.difference import DifferenceView
from camviz_clinic.views.fold_map import FoldView
from camviz_clinic.views.guidance import GuidanceView
from camviz_clinic.views.histogram import HistogramView
from camviz_clinic.views.missing import MissingView
from camviz_clinic.views.numbers import NumbersView
from camviz_clinic.views.observations import Missing, Observations, short_names
from camviz_clinic.views.outliers import OutliersView
from camviz_clinic.views.pairs import EpipolarPairsView, SharedViews
from camviz_clinic.views.radius import RadiusView
from camviz_clinic.views.rectified import RectifiedView
from camviz_clinic.views.residuals import ResidualsView
from camviz_clinic.views.rig import RigView
from camviz_clinic.views.uncertainty import UncertaintyRangeView, UncertaintyView
from camviz_clinic.views.undistorted import UndistortedView


def observed(calibration) -> Observations:
    return Observations.of(calibration)


def perfect(corners=BOARD.corners, noise: float = 0.0, views: int = 12) -> Observations:
    """The true camera at the true poses, so that every residual is the noise and what is wrong with the corners."""
    held = poses(views, 2)
    return Observations(TRUE, BOARD, seen(TRUE, held, corners, noise), held)


def drawn(marks, class_: str) -> np.ndarray:
    """The straight segments (n, 4) of all marks of exactly this class."""
    return np.concatenate([mark.ends.reshape(-1, 4) for mark in marks.of(class_) if mark.class_ == class_])


# Residuals -----------------------------------------------------------------------------------------------------------


def test_the_error_of_every_view_is_opencvs():
    calibration = single()
    np.testing.assert_allclose(observed(calibration).rms, calibration.per_view_errors["camera"], rtol=1e-4)


def test_every_bar_is_as_high_as_its_views_error():
    view = ResidualsView.of(single())
    panel = view._bars
    tops = heights(panel, view.bars_panel(panel), "fill-blue|fill-orange")
    rms = view.observations.rms
    np.testing.assert_allclose(tops, rms, atol=0.06 / panel.scale[1] * -1)  # of 0.1 picture units
    assert len(tops) == 10


def test_the_number_at_a_bar_is_its_height_with_and_without_the_corners_set_aside():
    healthy = single()
    detections, aside = healthy.detections["camera"].copy(), np.zeros((10, 54), bool)
    detections[6, :5] += 1.0
    aside[6, :5] = True
    view = ResidualsView.of(replace(healthy, detections={"camera": detections}, set_aside={"camera": aside}))
    panel, seen = view._bars, view.observations
    drawn = view.bars_panel(panel)
    solid = heights(panel, drawn, "fill-blue|fill-orange")
    pale = heights(panel, drawn, "wash fill-red")
    assert seen.rms_seen[6] > 2 * seen.rms[6]
    assert pale[6] == pytest.approx(seen.rms_seen[6], rel=0.01)
    assert solid[6] == pytest.approx(seen.rms[6], rel=0.01)
    written = [text for text in drawn.of("tick middle") if re.fullmatch(r"\d\.\d\d", text.words)]
    at = [(round(panel.data((text.x, 0))[0]) - 1, float(text.words)) for text in written]
    ends = [(i, value) for tops in (solid, pale) for i, value in enumerate(tops) if np.isfinite(value)]
    assert sorted(at) == [(i, pytest.approx(value, abs=0.006)) for i, value in sorted(ends)]
    words = [text.words for text in drawn.texts()]
    assert "RMS [px]" in words
    assert any("blue: corners used, pale red: with those set aside" in one for one in words)


def test_a_rejected_board_leaves_the_axis_to_the_other_bars():
    healthy = single()
    detections, aside = healthy.detections["camera"].copy(), np.zeros((10, 54), bool)
    detections[8] += np.random.default_rng(3).normal(0, 30, (54, 2))
    aside[8] = True
    view = ResidualsView.of(replace(healthy, detections={"camera": detections}, set_aside={"camera": aside}))
    panel = view._bars
    drawn = view.bars_panel(panel)
    tops = heights(panel, drawn, "fill-blue|fill-orange")
    assert np.nanmax(tops) > 0.8 * panel.top
    words = [text.words for text in drawn.texts()]
    assert f"{view.observations.rms_seen[8]:.2f}" in words
    assert len(drawn.of("paper-line cut")) == 1
    assert any("broken: cut" in one for one in words)


def heights(panel, marks, classes):
    """The upper ends (10,) of the bars of some classes, in the panel's own unit; NaN where there is no bar."""
    tops = np.full(10, np.nan)
    bars = [mark for class_ in classes.split("|") for mark in marks.of(class_) if mark.class_ == class_]
    for corners in (line for bar in bars for line in bar.lines):
        places = panel.data(corners)
        tops[round(places[:, 0].mean()) - 1] = places[:, 1].max()
    return tops


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_an_arrow_leads_from_projected_to_detected_at_its_scale(scale):
    view = ResidualsView.of(single()).but(view=2, scale=scale)
    panel = view._image_panel
    body, _ = view.picture_panel(panel)
    shafts = drawn(body, "orange")[:54]
    detected = view.observations.detections[1]
    rvec, t = view.observations.cam_from_board[1].rotation.as_rotvec(), view.observations.cam_from_board[1].translation
    lens = view.observations.camera.lens
    D = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    projected = cv2.projectPoints(BOARD.corners, rvec, t, view.observations.camera.intrinsics.K, D)[0].reshape(-1, 2)
    ends = projected + scale * (detected - projected)
    np.testing.assert_allclose(shafts, np.hstack([panel.place(projected), panel.place(ends)]), atol=0.06)
    assert any(f"residuals × {scale:g}" in text.words for text in body.texts())


def test_a_corner_detected_1_px_to_the_right_has_residual_plus_1():
    """In the numbers, and in every drawing an arrow to the right that ends on the detected corner."""
    exact = perfect()
    right = replace(exact, detections=exact.detections + (1.0, 0.0))
    known = right.used[0]
    np.testing.assert_allclose(right.residuals[0][known], np.tile([1.0, 0.0], (known.sum(), 1)), atol=1e-9)
    picture, worst = ResidualsView(right, scale=20.0), OutliersView(right, patch=24.0)
    arrow = drawn(picture.picture_panel(picture._image_panel)[0], "orange")[: known.sum()]
    along = np.broadcast_to((20 * picture._image_panel.scale[0], 0), (known.sum(), 2))
    np.testing.assert_allclose(arrow[:, 2:] - arrow[:, :2], along, atol=0.11)
    view, corner = worst.worst[0]
    detail, _ = worst._detail(0, view, corner, None, 0.0, 0.0)
    middle = np.round(right.detections[view, corner])
    ends = np.array([exact.detections[view, corner], right.detections[view, corner]]) - middle + 12
    np.testing.assert_allclose(drawn(detail, "orange thick")[0], (138 / 24 * ends).ravel(), atol=0.06)
    means = RadiusView(right).cells[1]
    means = means[np.isfinite(means[:, 0])]
    np.testing.assert_allclose(means, np.broadcast_to((1.0, 0.0), means.shape), atol=1e-9)


def test_a_corner_seen_to_the_right_on_the_board_has_an_arrow_right():
    view = ResidualsView(perfect(BOARD.corners + [0.001, 0, 0]))
    arrow = drawn(view.board_panel(Panel("board", 0, 0, 450, 180, 0, 1, 0, 1)), "orange")[:54]
    assert (arrow[:, 2] - arrow[:, 0] > 1).all()
    np.testing.assert_allclose(arrow[:, 3], arrow[:, 1], atol=0.11)


def test_a_corner_below_its_epipolar_line_has_an_offset_downwards():
    calibration = pair(noise=0.0)
    lower = calibration.detections | {"right": calibration.detections["right"] + (0.0, 1.0)}
    left, right = SharedViews.of(replace(calibration, detections=lower)).offsets
    assert np.nanmin(right[..., 1]) > 0.5
    assert np.nanmax(left[..., 1]) < -0.5


def test_corners_set_aside_have_crosses_and_no_say():
    view = ResidualsView.of(sick())
    assert view.view == 4  # the worst
    body, _ = view.picture_panel(view._image_panel)
    assert len(drawn(body, "red")) == 2 * 3
    chosen = view.observations.lengths[3][view.observations.used[3]]
    assert view.observations.rms[3] == pytest.approx(np.sqrt(np.mean(chosen**2)))
    assert view.observations.rms_seen[3] > view.observations.rms[3]
    assert view.numbers()["set aside"].startswith("3; with them")


def test_a_click_on_a_bar_chooses_its_view_and_arrow_keys_go_on_from_there():
    view, panel = ResidualsView.of(single()), ResidualsView.of(single())._bars
    for wanted in (1, 7, 10):
        x = panel.x + panel.place((wanted, 0))[0]
        assert view.dragged("bars", x, 100.0, 0, 0).view == wanted
    assert view.but(view=7).pressed("bars", "ArrowRight").view == 8
    assert view.but(view=10).pressed("bars", "ArrowRight").view == 10
    assert view.pressed("eye", "ArrowLeft").eye != view.eye


def test_the_slider_reaches_every_view():
    assert ResidualsView.of(single()).offered()["view"].high == 10
    assert EpipolarPairsView.of(pair()).offered()["view"].high == 8


def test_on_the_board_a_corner_that_is_seen_a_millimetre_aside_is_a_millimetre_off():
    off = perfect(BOARD.corners + [0.001, 0, 0])
    shift = off.on_board - BOARD.corners[:, :2]
    known = np.isfinite(shift[..., 0])
    np.testing.assert_allclose(shift[known], np.broadcast_to([0.001, 0], shift[known].shape), atol=1e-9)


def test_residuals_of_the_wrong_shape_are_refused_in_words():
    with pytest.raises(ValueError, match=r"shape \(views, 54, 2\), the board having 9 × 6 corners, got \(3, 50, 2\)"):
        Observations(TRUE, BOARD, np.zeros((3, 50, 2)), poses(3))
    with pytest.raises(ValueError, match="one pose for each of 4 views, got 3"):
        Observations(TRUE, BOARD, np.zeros((4, 54, 2)), poses(3))


# What the residuals say ----------------------------------------------------------------------------------------------


def test_outliers_do_not_widen_the_histograms_gaussian():
    clean = perfect(noise=0.2)
    spoiled = clean.detections.copy()
    spoiled[:, ::18] += 5.0  # three corners of each view
    view = HistogramView(replace(clean, detections=spoiled))
    assert view.sigma == pytest.approx(0.2, rel=0.12)
    assert HistogramView(clean).sigma == pytest.approx(0.2, rel=0.06)
    beyond = int(view.numbers()["beyond 3σ"].split()[0])
    assert beyond >= 2 * 3 * len(clean) * 0.95


def test_a_residual_that_points_outward_is_found_outward_and_not_around():
    clean = perfect(noise=0.02)
    away = clean.projected - (TRUE.intrinsics.cx, TRUE.intrinsics.cy)
    stretched = RadiusView(replace(clean, detections=clean.detections + 0.002 * away))
    middle, mean = stretched.rings[:, 0], stretched.rings[:, 1]
    known = np.isfinite(mean)
    np.testing.assert_allclose(mean[known], 0.002 * middle[known], atol=0.04)
    assert stretched.numbers()["outward_errors"] > 20 > 5 > stretched.numbers()["around_errors"]
    assert RadiusView(clean).numbers()["outward_errors"] < 5


def test_a_swirl_is_found_around_clockwise():
    clean = perfect(noise=0.02)
    away = clean.projected - (TRUE.intrinsics.cx, TRUE.intrinsics.cy)
    turned = np.stack([-away[..., 1], away[..., 0]], axis=-1)  # x right, y down: clockwise as seen
    numbers = RadiusView(replace(clean, detections=clean.detections + 0.002 * turned)).numbers()
    assert numbers["around_px"] > 0.1
    assert numbers["around_errors"] > 20


@pytest.mark.parametrize("cells", ["16 × 12", "8 × 6", "32 × 24"])
def test_coverage_counts_every_corner_once_and_every_view_once(cells):
    view = CoverageView(observed(single()), cells)
    inside = TRUE.intrinsics.contains(view.observations.detections[view.observations.used]).sum()
    assert view.counts.sum() == inside
    by_view = view.but(count="views").counts
    assert by_view.max() <= len(view.observations)
    assert ((by_view > 0) == (view.counts > 0)).all()


def test_coverage_of_a_board_that_stays_in_one_cell_is_one_cell():
    uv = np.full((2, 54, 2), 100.0) + np.arange(54)[:, None] * 0.1
    counts = CoverageView(Observations(TRUE, BOARD, uv, poses(2)), "8 × 6").counts
    assert (counts > 0).sum() == 1
    assert counts[1, 1] == 108


def test_views_are_called_by_the_numbers_of_their_pictures():
    """left10 is missing, so that left11 is the tenth."""
    files = [f"left{i:02}.jpg" for i in (1, 2, 9, 11)]
    assert short_names(files, 4) == ("1", "2", "9", "11")
    for unusable in (files[:3], [*files[:3], "a/left2.jpg"], [*files[:3], "dark.png"], [*files[:3], "1403636579.png"]):
        assert short_names(unusable, 4) == ("1", "2", "3", "4")
    seen = replace(perfect(views=4), pictures=tuple(files))
    residuals, coverage = (view(seen).figure().body for view in (ResidualsView, CoverageView))
    assert re.findall(r"label orange[^>]*>(\d+)<", ResidualsView(seen, view=4).figure().body) == ["11"]
    shown = set(re.findall(r'class="tick halo">(\d+)<', coverage))  # but those that would stand over others
    assert len(shown) > 1
    assert shown <= {"1", "2", "9", "11"}
    assert ">10<" not in residuals


def test_the_worst_corner_is_shown_first():
    spoiled = perfect().detections.copy()
    spoiled[5, 17] += (3, -2)
    view = OutliersView(replace(perfect(), detections=spoiled))
    assert view.worst[0] == (5, 17)
    assert "3.61 px" in view.description()


def test_the_bend_of_a_board_is_seen_in_what_all_views_agree_on():
    warped = BOARD.warped([0.001, 0.0])
    bent = BoardResidualsView.about(perfect(warped, noise=0.02, views=20))
    flat = BoardResidualsView.about(perfect(noise=0.02, views=20))
    assert bent.numbers()["depth_mm"] == pytest.approx(1.0, abs=0.3)
    assert flat.numbers()["depth_mm"] < 0.25
    grid = bent.heights.reshape(6, 9)
    assert grid[:, 4].mean() > grid[:, [0, 8]].mean() + 0.0007  # the middle lies farther along z than the edges


def test_a_solved_bend_is_told_in_millimetres():
    view = BoardResidualsView.about(replace(perfect(), board_warp=np.array([0.0012, -0.0005])))
    assert "+1.20 mm along its rows and -0.50 mm along its columns" in view.description()


# What the calibration knows ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distance", ["infinity", "0.5 m"])
def test_the_contour_named_1_px_lies_where_the_uncertainty_is_1_px(distance):
    adjustment = Adjustment.of(single(noise=0.3))
    view = UncertaintyView(adjustment, distance=distance)
    body = view.figure().body
    lines = re.findall(r'<path d="([^"]*)" class="ink thick"', body)
    assert lines
    panel = re.search(r'width="([\d.]+)" height="([\d.]+)" viewBox="[^"]*" data-panel="uncertainty"', body)
    places = np.array([list(map(float, p)) for line in lines for p in re.findall(r"([-\d.]+),([-\d.]+)", line)])
    uv = places / (float(panel[1]), float(panel[2])) * (640, 480) - 0.5
    inside = np.abs(uv - (319.5, 239.5)).max(axis=1) < 1000
    there = projection_uncertainty(adjustment, uv[inside], np.inf if distance == "infinity" else 0.5)
    np.testing.assert_allclose(there, 1.0, rtol=0.02)


def test_the_map_says_that_it_leaves_out_model_error():
    for view in (UncertaintyView.of(single()), UncertaintyRangeView.of(single())):
        words = re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", view.figure().body))
        assert (
            "leaves out what is wrong alike in all views: a bent board, or a lens that the model cannot describe"
            in words
        )


def test_the_calibration_is_best_where_the_boards_were():
    view = UncertaintyRangeView.of(single())
    distances, values = view.curves()
    best = distances[values[0].argmin()]
    assert view.boards.min() / 1.5 < best < view.boards.max() * 1.5


def test_a_calibration_with_too_few_measurements_has_no_uncertainty_and_says_so():
    few = single(views=10)
    one = replace(
        few,
        detections={"camera": few.detections["camera"][:1, :]},
        cam_from_board={"camera": few.cam_from_board["camera"][:1]},
    )
    sparse = one.detections["camera"].copy()
    sparse[0, 6:] = np.nan
    with pytest.raises(Missing, match="too few to tell how far they scatter"):
        UncertaintyView.of(replace(one, detections={"camera": sparse}))


def test_a_shifted_principal_point_is_a_turn_and_a_large_one_is_warned_of():
    """Looking ahead, moving cx by d pixels is the same as turning the camera by atan(d/f), to first order."""
    k = Intrinsics(640, 480, 530, 530, 319.5, 239.5)
    for shift, warned in ((1.0, False), (12.0, True)):
        view = DifferenceView.about(Camera(k), Camera(replace(k, cx=k.cx + shift)))
        assert np.radians(view.numbers()["turn_deg"]) == pytest.approx(shift / 530, rel=0.02)
        assert bool(view.warning) == warned
        assert view.numbers()["median"] < 0.2 * shift


def test_cameras_that_differ_in_where_they_stand_do_not_differ():
    turned = TRUE.at(RigidTransform.from_rotation(Rotation.from_rotvec([0, 0.3, 0])))
    assert DifferenceView.about(TRUE, turned).numbers()["worst"] < 1e-6


def test_pictures_of_two_sizes_cannot_be_compared_and_the_words_say_so():
    with pytest.raises(Missing, match="pictures of one size"):
        DifferenceView.about(TRUE, Camera(TRUE.intrinsics.resized(320, 240), TRUE.lens))


def test_the_correlations_are_those_of_many_solutions():
    """Against the spread of 40 solutions by OpenCV, of the same boards with fresh noise."""
    view = CorrelationView.of(single())
    held = poses(10)
    solutions = []
    for seed in range(40):
        camera, _, _ = solved(seen(TRUE, held, BOARD.corners, 0.1, 100 + seed))
        lens, k = camera.lens, camera.intrinsics
        solutions.append([k.fx, k.fy, k.cx, k.cy, lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    spread = np.corrcoef(np.array(solutions).T)
    assert np.abs(view.correlations - spread).max() < 0.55
    strong = np.abs(view.correlations) > 0.9
    np.testing.assert_allclose(view.correlations[strong], spread[strong], atol=0.12)
    assert {view.strongest()[0][0], view.strongest()[0][1]} <= {"fx", "fy", "k1", "k2", "k3"}


def test_two_halves_of_a_healthy_set_agree_and_a_changed_focus_does_not():
    healthy = CrossValidationView.of(single(views=16))
    assert healthy.numbers()["ratio"] < 2
    held = poses(16, 3)
    drifted = replace(TRUE, intrinsics=replace(TRUE.intrinsics, fx=540, fy=542))
    uv = seen(TRUE, held, BOARD.corners, 0.1)
    uv[::2] = seen(drifted, held, BOARD.corners, 0.1)[::2]
    camera, found, _ = solved(uv)
    calibration = replace(
        single(views=16), cameras={"camera": camera}, detections={"camera": uv}, cam_from_board={"camera": found}
    )
    view = CrossValidationView.of(calibration)
    assert view.numbers()["ratio"] > 2.5
    assert "something besides noise" in view.description()
    assert too_wide(view.figure()) == []


def test_the_board_to_imitate_is_whole_in_the_picture_and_takes_uncertainty_off():
    view = GuidanceView.of(single())
    camera = view.adjustment.cameras["camera"].at(RigidTransform.identity())
    for candidate in view.candidates:
        assert camera.sees(transform(candidate.cam_from_board, BOARD.corners)).all()
        assert candidate.after < candidate.before
    afters = [candidate.after for candidate in view.candidates]
    assert afters == sorted(afters)
    assert view.but(choice=2).figure().body != view.figure().body


# Lenses --------------------------------------------------------------------------------------------------------------


def test_a_pinhole_gives_a_degree_f_times_a_degree_in_the_middle_and_more_outside():
    """Pixels for a degree, over all directions: f/cos^1.5 θ per radian, for a pixel's solid angle is cos³θ/f²."""
    view = FoldView(Camera(Intrinsics(641, 481, 500, 500, 320, 240)))
    uv, values = view.resolution(81, 61)
    cosine = 1 / np.sqrt(1 + ((uv - (320, 240)) ** 2).sum(-1) / 500**2)
    np.testing.assert_allclose(values[1:-1, 1:-1], (radians(1) * 500 / cosine**1.5)[1:-1, 1:-1], rtol=2e-3)


def test_pixels_beyond_the_fold_have_no_ray_and_their_share_is_told():
    camera = Camera(Intrinsics(640, 480, 300, 300, 319.5, 239.5), BrownConrady(-0.3))
    view = FoldView(camera)
    rim = 300 * (np.sqrt(1 / 0.9) * (1 - 0.3 / 0.9))  # r (1 + k1 r²) where its slope 1 + 3 k1 r² is zero
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    beyond = np.hypot(u - 319.5, v - 239.5) > rim
    assert view.numbers()["without_ray"] == pytest.approx(beyond.mean(), abs=0.01)
    assert "no ray" in view.description()
    assert "wash fill-red" in view.figure().body


def test_a_weak_denominator_is_called_a_near_pole():
    lens = BrownConrady(k1=-3.0, k2=3.0, k4=-2.9, k5=2.2)
    view = FoldView(Camera(Intrinsics(640, 480, 400, 400, 319.5, 239.5), lens))
    s = np.linspace(0, view.numbers()["ideal_radius"] ** 2, 10001)
    assert view.numbers()["weakest"] == pytest.approx((1 - 2.9 * s + 2.2 * s**2).min(), abs=1e-4)
    assert "near-pole" in view.description()


def test_what_is_straight_in_the_undistorted_picture_is_where_opencv_bends_it_from():
    view = UndistortedView(TRUE, alpha=0.0)
    target, roi = view.target()
    D = np.array([-0.25, 0.06, 0, 0, 0])
    K, expected = cv2.getOptimalNewCameraMatrix(TRUE.intrinsics.K, D, (640, 480), 0.0)
    np.testing.assert_allclose([target.fx, target.fy], [K[0, 0], K[1, 1]], rtol=0.01)
    assert np.abs(np.array(roi) - expected).max() <= 4


# Pairs ---------------------------------------------------------------------------------------------------------------


def test_the_distance_from_epipolar_lines_is_opencvs():
    shared = SharedViews.of(pair())
    K = [camera.intrinsics.K for camera in (shared.left, shared.right)]
    points = []
    for camera, uv, matrix in zip((shared.left, shared.right), shared.detections, K, strict=True):
        lens = camera.lens
        D = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
        criteria = (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
        points.append(cv2.undistortPoints(uv[2][:, None], matrix, D, None, None, matrix, criteria).reshape(-1, 2))
    F = twoview.fundamental(*shared.ideal)
    lines = cv2.computeCorrespondEpilines(points[0][:, None], 1, F).reshape(-1, 3)
    expected = np.abs(np.sum(lines * twoview.to_homogeneous(points[1]), axis=1))
    np.testing.assert_allclose(shared.distances[1][2], expected, atol=1e-4)


def test_corners_of_an_exact_pair_share_their_rows_and_their_epipolar_lines():
    held = poses(6, 9)
    cameras = (TRUE, TRUE.at(RIGHT_FROM_LEFT.inv()))
    uv = (seen(TRUE, held, BOARD.corners, 0), seen(TRUE, RIGHT_FROM_LEFT * held, BOARD.corners, 0))
    shared = SharedViews(*cameras, uv, 9)
    assert shared.total_rms < 1e-6
    assert np.nanmax(np.abs(RectifiedView(*cameras, shared).row_differences)) < 1e-6


def test_a_swapped_pair_cannot_be_rectified_and_the_picture_says_so():
    calibration = pair()
    view = RectifiedView(calibration.cameras["right"], calibration.cameras["left"])
    assert "must stand to the right" in view.description()
    assert "as taken" in view.figure().body


def test_the_part_of_matching_in_the_depth_error_is_that_of_a_rectified_pair():
    view = DepthErrorView.of(pair()).but(matching=0.5)
    depths = np.array([1.0, 3.0])
    rectified = twoview.rectify(*pair().cameras.values())
    expected = twoview.depth_error(depths, rectified.focal_length, rectified.baseline, 0.5)
    np.testing.assert_allclose(view.uncertainty(depths).from_matching, expected, rtol=0.03)
    assert (view.uncertainty(depths).total > view.uncertainty(depths).from_matching).all()


def test_read_the_other_way_round_the_right_camera_stands_on_the_left():
    view = RigView.of(pair())
    right = {name: cameras["right"].centre for name, cameras in view.but(reading="both").readings.items()}
    assert right["as written"][0] > 0.09
    np.testing.assert_allclose(right["inverted"], RIGHT_FROM_LEFT.inv().inv().translation, atol=1e-12)
    assert "to its right" in view.description()


def test_the_numbers_tell_how_far_the_axis_is_from_the_middle():
    far = NumbersView(replace(TRUE, intrinsics=replace(TRUE.intrinsics, cx=900.0)))
    assert dict(far.rows())["from the middle"].startswith("+580.5, -1.5 px")
    assert "principal point" in far.figure().body


# All of them ---------------------------------------------------------------------------------------------------------

FISHEYE = replace(
    bare(), cameras={"camera": Camera(Intrinsics(640, 480, 230, 230, 319.5, 239.5), KannalaBrandt(0.02, -0.01))}
)
CASES = {"healthy": single, "sick": sick, "pair": pair, "bare": bare, "fisheye": lambda: FISHEYE}


def too_wide(picture) -> list[str]:
    """Words that begin inside the picture and end beyond its edge, 6 units a letter and 6.8 in labels."""
    words = [one for one in ElementTree.fromstring(picture.standalone()) if one.tag.endswith("}text")]
    begun = [one for one in words if one.text and not {"end", "middle"} & set(one.get("class").split())]
    letter = {one: 6.8 if one.get("class") == "label" else 6.0 for one in begun}
    return [one.text for one in begun if float(one.get("x")) + letter[one] * len(one.text) > picture.width]


@pytest.mark.parametrize("name", VIEWS)
@pytest.mark.parametrize("case", CASES)
def test_every_view_draws_every_calibration_or_says_what_is_missing(name, case):
    view = VIEWS[name].view(Case(CASES[case]()))
    for draft in (True, False):
        picture = view.figure(draft=draft)
        assert too_wide(picture) == []
        assert not re.search(
            r"\bnan\b|\binf\b", re.sub(r"<(title|desc)>.*?</\1>|aria-label=\"[^\"]*\"", "", picture.body)
        )
        assert set(re.findall(r'attached:([^"]+)', picture.body)) == set(picture.photographs)
        assert len(picture.description) > 30
    if isinstance(view, MissingView):
        assert view.sentence.endswith(".")
        assert case != "pair" or name == "difference"


def test_errors_without_corners_are_bars_alone():
    errors = np.array([0.2, 1.2, 0.3])
    known = replace(bare(), per_view_errors={"camera": errors})
    view = VIEWS["residual-vectors"].view(Case(known))
    body = view.figure().body
    height = float(re.search(r'height="([\d.]+)" viewBox="[^"]*" data-panel="bars"', body)[1])
    outlines = re.search(r'<path d="([^"]*)" class="fill-blue"', body)[1].strip("MZ").split("ZM")
    tops = [min(float(point.split(",")[1]) for point in outline.split()) for outline in outlines]
    np.testing.assert_allclose((height - np.array(tops)) / height * 1.2 * 1.2, errors, atol=0.002)
    assert "view 2 has the largest error, 1.2 px" in view.description()
    assert "does not hold the corners" in view.description()


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", VIEWS)
def test_a_view_that_only_the_other_camera_saw_is_drawn_by_none(name):
    """Its pose in this camera's list means nothing: here it is the identity, the board in the camera's own place."""
    both = pair()
    uv = both.detections["left"].copy()
    uv[2] = np.nan
    placed = both.cam_from_board["left"].as_matrix().copy()
    placed[2] = np.eye(4)
    calibration = replace(
        both,
        detections={**both.detections, "left": uv},
        cam_from_board={**both.cam_from_board, "left": RigidTransform.from_matrix(placed)},
    )
    view = VIEWS[name].view(Case(calibration))
    assert not isinstance(view, MissingView) or name == "difference"
    for chosen in (1, 3):
        picture = (view.but(view=chosen) if "view" in view.offered() else view).figure()
        assert not re.search(r"\bnan\b", re.sub(r"aria-label=\"[^\"]*\"", "", picture.body))
    seen = Observations.of(calibration)
    assert np.isnan(seen.distances[2])
    assert np.isfinite(np.delete(seen.distances, 2)).all()


@pytest.mark.parametrize("name", VIEWS)
def test_both_ends_of_every_control_draw_different_pictures(name):
    view = VIEWS[name].view(Case(pair(), single()))
    if name == "distortion":
        return  # has tests of its own
    for control, how in view.offered().items():
        ends = (
            how.choices[:: len(how.choices) - 1]
            if how.choices
            else (how.low, how.high)
            if how.low is not None
            else (False, True)
        )
        first, last = (view.but(**{control: end}).figure(draft=True) for end in ends)
        assert (first.body, first.photographs) != (last.body, last.photographs), control


def test_a_file_cannot_have_a_picture_read_that_lies_outside_its_folder(tmp_path):
    (tmp_path / "in").mkdir()
    grey = np.full((480, 640), 90, np.uint8)
    cv2.imwrite(str(tmp_path / "secret.png"), grey)
    cv2.imwrite(str(tmp_path / "in" / "board.png"), grey)
    names = ("../secret.png", str(tmp_path / "secret.png"), "board.png", "missing.png")
    healthy = single()
    calibration = replace(
        healthy, source=tmp_path / "in" / "camera.yml", pictures={"camera": names + healthy.pictures["camera"][4:]}
    )
    taken = Case(calibration).photographs("camera")
    assert [taken(i) is not None for i in range(5)] == [False, False, True, False, False]


def test_photographs_of_another_size_are_not_drawn_on(tmp_path):
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((240, 320), np.uint8))
    calibration = replace(single(), source=tmp_path / "camera.yml", pictures={"camera": ("small.png",)})
    assert Case(calibration).photographs("camera")(0) is None
