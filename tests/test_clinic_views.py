"""The clinic's views draw what is the case: residuals where they are, maps whose contours tell the truth."""

import re
from dataclasses import replace
from math import radians

import cv2
import numpy as np
import pytest
from calibrations import BOARD, RIGHT_FROM_LEFT, TRUE, bare, pair, poses, seen, sick, single, solved
from every_view import written
from scipy.spatial.transform import RigidTransform

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.draw.marks import Image
from camviz.draw.panel import Panel
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.uncertainty import projection_uncertainty
from camviz_clinic.views.board_residuals import BoardResidualsView
from camviz_clinic.views.catalogue import VIEWS, Case
from camviz_clinic.views.correlation import CorrelationView
from camviz_clinic.views.coverage import CoverageView
from camviz_clinic.views.difference import DifferenceView
from camviz_clinic.views.fold_map import FoldView
from camviz_clinic.views.histogram import HistogramView
from camviz_clinic.views.missing import MissingView
from camviz_clinic.views.observations import Missing, Observations, short_names
from camviz_clinic.views.outliers import OutliersView
from camviz_clinic.views.pairs import SharedViews
from camviz_clinic.views.radius import RadiusView
from camviz_clinic.views.rectified import RectifiedView
from camviz_clinic.views.residuals import ResidualsView
from camviz_clinic.views.rig import RigView
from camviz_clinic.views.uncertainty import UncertaintyRangeView, UncertaintyView


def perfect(corners=BOARD.corners, noise: float = 0.0, views: int = 12) -> Observations:
    """The true camera at the true poses, so that every residual is the noise and what is wrong with the corners."""
    held = poses(views, 2)
    return Observations(TRUE, BOARD, seen(TRUE, held, corners, noise), held)


def drawn(marks, class_: str) -> np.ndarray:
    """The straight segments (n, 4) of all marks of exactly this class."""
    return np.concatenate([mark.ends.reshape(-1, 4) for mark in marks.of(class_) if mark.class_ == class_])


def heights(panel, marks, *classes):
    """The upper ends (10,) of the bars of some classes, in the panel's own unit; NaN where there is no bar."""
    tops = np.full(10, np.nan)
    bars = [mark for class_ in classes for mark in marks.of(class_) if mark.class_ == class_]
    for corners in (line for bar in bars for line in bar.lines):
        places = panel.data(corners)
        tops[round(places[:, 0].mean()) - 1] = places[:, 1].max()
    return tops


def spoiled(view: int, corners, shift):
    """The healthy calibration with some corners of a view moved and rejected."""
    healthy = single()
    detections, aside = healthy.detections["camera"].copy(), np.zeros((10, 54), bool)
    detections[view, corners] += shift
    aside[view, corners] = True
    return ResidualsView.of(replace(healthy, detections={"camera": detections}, set_aside={"camera": aside}))


# Residuals -----------------------------------------------------------------------------------------------------------


def test_bars_are_as_high_as_the_errors_of_their_views():
    """Of the corners used, as OpenCV has them, and pale with those rejected; each with its number."""
    calibration = single()
    np.testing.assert_allclose(Observations.of(calibration).rms, calibration.per_view_errors["camera"], rtol=1e-4)
    view = spoiled(6, slice(5), 1.0)
    panel, seen = view._bars, view.observations
    bars = view.bars_panel(panel)
    solid, pale = heights(panel, bars, "fill-blue", "fill-orange"), heights(panel, bars, "wash fill-red")
    assert seen.rms_seen[6] > 2 * seen.rms[6]
    np.testing.assert_allclose(solid, seen.rms, rtol=1e-6)
    assert pale[6] == pytest.approx(seen.rms_seen[6], rel=1e-6)
    numbers = [text for text in bars.of("tick middle") if text.words.replace(".", "").isdigit() and text.y > 0]
    at = [(round(panel.data((text.x, 0))[0]) - 1, float(text.words)) for text in numbers if "." in text.words]
    ends = [(i, value) for tops in (solid, pale) for i, value in enumerate(tops) if np.isfinite(value)]
    assert sorted(at) == [(i, pytest.approx(value, abs=0.006)) for i, value in sorted(ends)]


def test_a_rejected_board_leaves_the_axis_to_the_other_bars():
    view = spoiled(8, slice(None), np.random.default_rng(3).normal(0, 30, (54, 2)))
    panel = view._bars
    bars = view.bars_panel(panel)
    assert np.nanmax(heights(panel, bars, "fill-blue", "fill-orange")) > 0.8 * panel.top
    assert f"{view.observations.rms_seen[8]:.2f}" in [text.words for text in bars.texts()]
    assert len(bars.of("paper-line cut")) == 1


def test_errors_without_corners_are_bars_alone():
    errors = np.array([0.2, 1.2, 0.3])
    view = VIEWS["residual-vectors"].view(Case(replace(bare(), per_view_errors={"camera": errors})))
    bars = view.figure().marks.panels()["bars"]
    (blue,) = bars.marks.of("fill-blue")
    tops = bars.height - np.array([line[:, 1].min() for line in blue.lines])
    np.testing.assert_allclose(tops / tops[1], errors / errors[1], atol=1e-6)
    assert "view 2 has the largest error, 1.2 px" in view.description()


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_an_arrow_leads_from_projected_to_detected(scale):
    view = ResidualsView.of(single()).but(view=2, scale=scale)
    panel, seen = view._image_panel, view.observations
    body, _ = view.picture_panel(panel)
    rvec, t, lens = seen.cam_from_board[1].rotation.as_rotvec(), seen.cam_from_board[1].translation, seen.camera.lens
    D = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    projected = cv2.projectPoints(BOARD.corners, rvec, t, seen.camera.intrinsics.K, D)[0].reshape(-1, 2)
    ends = projected + scale * (seen.detections[1] - projected)
    shafts = np.hstack([panel.place(projected), panel.place(ends)])
    np.testing.assert_allclose(drawn(body, "orange")[:54], shafts, atol=1e-6)
    assert f"residuals × {scale:g}" in " ".join(text.words for text in body.texts())


def test_a_corner_detected_1_px_to_the_right_has_residual_plus_1():
    """In the numbers, and in every drawing an arrow to the right that ends on the detected corner."""
    exact = perfect()
    right = replace(exact, detections=exact.detections + (1.0, 0.0))
    known = right.used[0]
    np.testing.assert_allclose(right.residuals[0][known], np.tile([1.0, 0.0], (known.sum(), 1)), atol=1e-9)
    picture, worst = ResidualsView(right, scale=20.0), OutliersView(right, patch=24.0)
    arrow = drawn(picture.picture_panel(picture._image_panel)[0], "orange")[: known.sum()]
    along = np.broadcast_to((20 * picture._image_panel.scale[0], 0), (known.sum(), 2))
    np.testing.assert_allclose(arrow[:, 2:] - arrow[:, :2], along, atol=1e-6)
    view, corner = worst.worst[0]
    detail, _ = worst._detail(0, view, corner, None, 0.0, 0.0)
    middle = np.round(right.detections[view, corner])
    ends = np.array([exact.detections[view, corner], right.detections[view, corner]]) - middle + 12
    np.testing.assert_allclose(drawn(detail, "orange thick")[0], (138 / 24 * ends).ravel(), atol=1e-6)
    means = RadiusView(right).cells[1]
    means = means[np.isfinite(means[:, 0])]
    np.testing.assert_allclose(means, np.broadcast_to((1.0, 0.0), means.shape), atol=1e-9)


def test_a_corner_1_mm_to_the_right_on_the_board_is_1_mm_off():
    off = perfect(BOARD.corners + [0.001, 0, 0])
    shift = off.on_board - BOARD.corners[:, :2]
    known = np.isfinite(shift[..., 0])
    np.testing.assert_allclose(shift[known], np.broadcast_to([0.001, 0], shift[known].shape), atol=1e-9)
    arrow = drawn(ResidualsView(off).board_panel(Panel("board", 0, 0, 450, 180, 0, 1, 0, 1)), "orange")[:54]
    assert (arrow[:, 2] - arrow[:, 0] > 1).all()
    np.testing.assert_allclose(arrow[:, 3], arrow[:, 1], atol=1e-6)


def test_rejected_corners_have_crosses_and_the_worst_is_first():
    view = ResidualsView.of(sick())
    assert view.view == 4  # the worst
    assert len(drawn(view.picture_panel(view._image_panel)[0], "red")) == 2 * 3
    used = view.observations.lengths[3][view.observations.used[3]]
    assert view.observations.rms[3] == pytest.approx(np.sqrt(np.mean(used**2)))
    assert view.observations.rms_seen[3] > view.observations.rms[3]
    detections = perfect().detections.copy()
    detections[5, 17] += (3, -2)
    worst = OutliersView(replace(perfect(), detections=detections))
    assert worst.worst[0] == (5, 17)
    assert f"{np.hypot(3, 2):.2f} px" in worst.description()


def test_observations_of_the_wrong_shape_are_refused():
    with pytest.raises(ValueError, match=r"shape \(views, 54, 2\), the board having 9 × 6 corners, got \(3, 50, 2\)"):
        Observations(TRUE, BOARD, np.zeros((3, 50, 2)), poses(3))
    with pytest.raises(ValueError, match="one pose for each of 4 views, got 3"):
        Observations(TRUE, BOARD, np.zeros((4, 54, 2)), poses(3))


def test_a_corner_below_its_epipolar_line_is_offset_downwards():
    calibration = pair(noise=0.0)
    lower = calibration.detections | {"right": calibration.detections["right"] + (0.0, 1.0)}
    left, right = SharedViews.of(replace(calibration, detections=lower)).offsets
    assert np.nanmin(right[..., 1]) > 0.5
    assert np.nanmax(left[..., 1]) < -0.5


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


def test_residuals_outward_and_around_are_told_apart():
    clean = perfect(noise=0.02)
    away = clean.projected - (TRUE.intrinsics.cx, TRUE.intrinsics.cy)
    stretched = RadiusView(replace(clean, detections=clean.detections + 0.002 * away))
    middle, mean = stretched.rings[:, 0], stretched.rings[:, 1]
    known = np.isfinite(mean)
    np.testing.assert_allclose(mean[known], 0.002 * middle[known], atol=0.04)
    assert stretched.numbers()["outward_errors"] > 20 > 5 > stretched.numbers()["around_errors"]
    assert RadiusView(clean).numbers()["outward_errors"] < 5
    turned = np.stack([-away[..., 1], away[..., 0]], axis=-1)  # x right, y down: clockwise as seen
    numbers = RadiusView(replace(clean, detections=clean.detections + 0.002 * turned)).numbers()
    assert numbers["around_px"] > 0.1
    assert numbers["around_errors"] > 20


@pytest.mark.parametrize("cells", ["16 × 12", "8 × 6", "32 × 24"])
def test_coverage_counts_every_corner_once_and_every_view_once(cells):
    view = CoverageView(Observations.of(single()), cells)
    inside = TRUE.intrinsics.contains(view.observations.detections[view.observations.used]).sum()
    assert view.counts.sum() == inside
    by_view = view.but(count="views").counts
    assert by_view.max() <= len(view.observations)
    assert ((by_view > 0) == (view.counts > 0)).all()
    uv = np.full((2, 54, 2), 100.0) + np.arange(54)[:, None] * 0.1  # two boards that stay in one cell
    counts = CoverageView(Observations(TRUE, BOARD, uv, poses(2)), "8 × 6").counts
    assert ((counts > 0).sum(), counts[1, 1]) == (1, 108)


def test_views_are_called_by_the_numbers_of_their_pictures():
    """left10 is missing, so that left11 is the tenth."""
    files = [f"left{i:02}.jpg" for i in (1, 2, 9, 11)]
    assert short_names(files, 4) == ("1", "2", "9", "11")
    for unusable in (files[:3], [*files[:3], "a/left2.jpg"], [*files[:3], "dark.png"], [*files[:3], "1403636579.png"]):
        assert short_names(unusable, 4) == ("1", "2", "3", "4")
    seen = replace(perfect(views=4), pictures=tuple(files))
    assert "11" in [text.words for text in ResidualsView(seen, view=4).figure().marks.of("label orange")]
    shown = {text.words for text in CoverageView(seen).figure().marks.of("tick halo")}  # those that stand free
    assert len(shown) > 1
    assert shown <= {"1", "2", "9", "11"}


def test_the_warp_of_a_board_is_seen_in_all_views():
    warped = BOARD.warped([0.001, 0.0])
    bent = BoardResidualsView.about(perfect(warped, noise=0.02, views=20))
    flat = BoardResidualsView.about(perfect(noise=0.02, views=20))
    assert bent.numbers()["depth_mm"] == pytest.approx(1.0, abs=0.3)
    assert flat.numbers()["depth_mm"] < 0.25
    grid = bent.heights.reshape(6, 9)
    assert grid[:, 4].mean() > grid[:, [0, 8]].mean() + 0.0007  # the middle lies farther along z than the edges


# What the calibration knows ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distance", ["infinity", "0.5 m"])
def test_the_contour_of_1_px_lies_where_the_uncertainty_is_1_px(distance):
    adjustment = Adjustment.of(single(noise=0.3))
    panel = UncertaintyView(adjustment, distance=distance).figure().marks.panels()["uncertainty"]
    uv = panel.marks.points("ink thick") / (panel.width, panel.height) * (640, 480) - 0.5
    assert len(uv)
    there = projection_uncertainty(adjustment, uv, np.inf if distance == "infinity" else 0.5)
    np.testing.assert_allclose(there, 1.0, rtol=0.02)
    ranges = UncertaintyRangeView.of(single())
    distances, values = ranges.curves()  # best where the boards were
    assert ranges.boards.min() / 1.5 < distances[values[0].argmin()] < ranges.boards.max() * 1.5
    few = single(views=10)
    sparse = few.detections["camera"][:1].copy()
    sparse[0, 6:] = np.nan
    one = replace(few, detections={"camera": sparse}, cam_from_board={"camera": few.cam_from_board["camera"][:1]})
    with pytest.raises(Missing, match="too few to tell how far they scatter"):
        UncertaintyView.of(one)


def test_a_large_shift_of_the_principal_point_is_warned_of():
    """Looking ahead, moving cx by d pixels is the same as turning the camera by atan(d/f), to first order."""
    k = Intrinsics(640, 480, 530, 530, 319.5, 239.5)
    for shift, warned in ((1.0, False), (12.0, True)):
        view = DifferenceView.about(Camera(k), Camera(replace(k, cx=k.cx + shift)))
        assert np.radians(view.numbers()["turn_deg"]) == pytest.approx(shift / 530, rel=0.02)
        assert bool(view.warning) == warned


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


# Lenses --------------------------------------------------------------------------------------------------------------


def test_a_pinhole_gives_a_degree_more_pixels_outside():
    """Pixels for a degree, over all directions: f/cos^1.5 θ per radian, for a pixel's solid angle is cos³θ/f²."""
    view = FoldView(Camera(Intrinsics(641, 481, 500, 500, 320, 240)))
    uv, values = view.resolution(81, 61)
    cosine = 1 / np.sqrt(1 + ((uv - (320, 240)) ** 2).sum(-1) / 500**2)
    np.testing.assert_allclose(values[1:-1, 1:-1], (radians(1) * 500 / cosine**1.5)[1:-1, 1:-1], rtol=2e-3)


def test_pixels_beyond_the_fold_have_no_ray():
    camera = Camera(Intrinsics(640, 480, 300, 300, 319.5, 239.5), BrownConrady(-0.3))
    view = FoldView(camera)
    rim = 300 * (np.sqrt(1 / 0.9) * (1 - 0.3 / 0.9))  # r (1 + k1 r²) where its slope 1 + 3 k1 r² is zero
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    beyond = np.hypot(u - 319.5, v - 239.5) > rim
    assert view.numbers()["without_ray"] == pytest.approx(beyond.mean(), abs=0.01)
    assert view.figure().marks.of("wash fill-red")


def test_a_weak_denominator_is_called_a_near_pole():
    lens = BrownConrady(k1=-3.0, k2=3.0, k4=-2.9, k5=2.2)
    view = FoldView(Camera(Intrinsics(640, 480, 400, 400, 319.5, 239.5), lens))
    s = np.linspace(0, view.numbers()["ideal_radius"] ** 2, 10001)
    assert view.numbers()["weakest"] == pytest.approx((1 - 2.9 * s + 2.2 * s**2).min(), abs=1e-4)
    assert "near-pole" in view.description()


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


def test_corners_of_an_exact_pair_share_rows_and_lines():
    held = poses(6, 9)
    cameras = (TRUE, TRUE.at(RIGHT_FROM_LEFT.inv()))
    uv = (seen(TRUE, held, BOARD.corners, 0), seen(TRUE, RIGHT_FROM_LEFT * held, BOARD.corners, 0))
    shared = SharedViews(*cameras, uv, 9)
    assert shared.total_rms < 1e-6
    assert np.nanmax(np.abs(RectifiedView(*cameras, shared).row_differences)) < 1e-6
    swapped = RectifiedView(*reversed(cameras))
    assert "must stand to the right" in swapped.description()
    assert "as taken" in written(swapped.figure())


def test_an_inverted_rig_has_the_right_camera_on_the_left():
    view = RigView.of(pair())
    right = {name: cameras["right"].centre for name, cameras in view.but(reading="both").readings.items()}
    assert right["as written"][0] > 0.09
    np.testing.assert_allclose(right["inverted"], RIGHT_FROM_LEFT.inv().inv().translation, atol=1e-12)


# All of them ---------------------------------------------------------------------------------------------------------

FISHEYE = replace(
    bare(), cameras={"camera": Camera(Intrinsics(640, 480, 230, 230, 319.5, 239.5), KannalaBrandt(0.02, -0.01))}
)
CASES = {"healthy": single, "sick": sick, "pair": pair, "bare": bare, "fisheye": lambda: FISHEYE}


def attached(picture):
    return {name for mark in picture.marks.walk() if isinstance(mark, Image) for name in (mark.name, mark.mask) if name}


@pytest.mark.parametrize("name", VIEWS)
@pytest.mark.parametrize("case", CASES)
def test_every_view_draws_every_calibration_or_says_what_it_lacks(name, case):
    view = VIEWS[name].view(Case(CASES[case]()))
    for draft in (True, False):
        picture = view.figure(draft=draft)
        assert not re.search(r"\b(nan|inf)\b", written(picture))
        assert attached(picture) == set(picture.photographs)
        assert len(picture.description) > 30
    if isinstance(view, MissingView):
        assert view.sentence.endswith(".")
        assert case != "pair" or name == "difference"


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", VIEWS)
def test_a_view_that_only_the_other_camera_saw_is_not_drawn(name):
    """Its pose in this camera's list means nothing: here it is the identity, the board in the camera's own place."""
    both = pair()
    uv, placed = both.detections["left"].copy(), both.cam_from_board["left"].as_matrix().copy()
    uv[2], placed[2] = np.nan, np.eye(4)
    calibration = replace(
        both,
        detections={**both.detections, "left": uv},
        cam_from_board={**both.cam_from_board, "left": RigidTransform.from_matrix(placed)},
    )
    view = VIEWS[name].view(Case(calibration))
    assert not isinstance(view, MissingView) or name == "difference"
    for chosen in (1, 3):
        picture = (view.but(view=chosen) if "view" in view.offered() else view).figure()
        assert not re.search(r"\bnan\b", written(picture))
    seen = Observations.of(calibration)
    assert np.isnan(seen.distances[2])
    assert np.isfinite(np.delete(seen.distances, 2)).all()


def test_no_picture_outside_a_files_folder_is_read(tmp_path):
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
    cv2.imwrite(str(tmp_path / "in" / "board.png"), grey[::2, ::2])  # of another size
    assert Case(calibration).photographs("camera")(2) is None
