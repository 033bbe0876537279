"""The rectification view turns what must be turned and nothing else, measures truly, and keeps what does not change."""

import re

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.draw.shades import heat_map
from camviz.lenses import BrownConrady, Equidistant, Perspective
from camviz.scenes import snapshot, textured_scene
from camviz_school.views import stereo_pair
from camviz_school.views.rectification import RectificationView

VIEW = RectificationView()
CONTROLS = RectificationView.controls()


def rig(lens=None):
    """A pair of equal cameras, toed in and tilted."""
    camera = Camera(Intrinsics.from_fov(320, 240, 62), lens or Perspective())
    turn = Rotation.from_euler("YXZ", [-4, 1, 3], degrees=True)
    return camera, camera.at(RigidTransform.from_components([0.2, 0.01, 0.02], turn))


def decoded(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def centre_of(panel, uv):
    """Where a pixel lies in the picture."""
    return panel.place(uv) + (panel.x, panel.y)


# The cameras ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [0.0, 0.3, 0.7, 1.0])
def test_the_cameras_turn_in_step_and_stay_where_they_are(way):
    now = VIEW.but(rectify=way).stage
    for start, here, end in (
        (now.left_original, now.left, now.pair.left),
        (now.right_original, now.right, now.pair.right),
    ):
        np.testing.assert_allclose(here.centre, start.centre, atol=1e-12)
        whole = (start.world_from_cam.rotation.inv() * end.world_from_cam.rotation).magnitude()
        gone = (start.world_from_cam.rotation.inv() * here.world_from_cam.rotation).magnitude()
        assert gone == pytest.approx(way * whole, abs=1e-9)
        assert here.intrinsics.cx == pytest.approx((1 - way) * start.intrinsics.cx + way * end.intrinsics.cx, abs=1e-9)


@pytest.mark.parametrize("way", [0.0, 0.4, 1.0])
def test_the_marks_are_partners_by_opencv_s_epipolar_lines_at_every_moment(way):
    view = VIEW.but(rectify=way)
    F = twoview.fundamental(view.stage.left, view.stage.right)
    line = cv2.computeCorrespondEpilines(view.uv_left.reshape(1, 1, 2), 1, F).ravel()
    assert abs(line @ [*view.uv_right, 1]) < 1e-3  # OpenCV's lines are float32


def test_the_marks_meet_at_the_depth_that_the_formula_gives():
    """Triangulated in the pictures as taken, which know nothing of rectification."""
    view = VIEW.but(rectify=0.0)
    point = twoview.triangulate([view.stage.left, view.stage.right], np.stack([view.uv_left, view.uv_right]))
    axis = view.stage.pair.left.world_from_cam.rotation.as_matrix()[:, 2]
    assert (point.ravel() - view.stage.left.centre) @ axis == pytest.approx(view.depth(), rel=1e-9)


def test_rows_differ_before_and_not_after():
    assert VIEW.but(rectify=0.0).rows_apart() > 10
    assert VIEW.but(rectify=0.5).rows_apart() > 3
    assert VIEW.rows_apart() < 1e-9


@pytest.mark.parametrize(("nearly", "end"), [(0.001, 0.0), (0.999, 1.0)])
def test_nothing_jumps_at_either_end_of_the_way(nearly, end):
    left, right = rig(BrownConrady(k1=-0.25, k2=0.06))
    view = RectificationView.of(left, right)
    points = left.centre + left.unproject([(30, 20), (290, 30), (160, 120), (40, 220)])
    seen = [view.but(rectify=way).stage.left.project(points) for way in (nearly, end)]
    np.testing.assert_allclose(*seen, atol=0.1)


# The pictures --------------------------------------------------------------------------------------------------------


def test_the_rectified_picture_is_what_a_turned_camera_would_have_taken():
    seen = stereo_pair.pictures(VIEW.source, 0.25, 1.0, 480)
    for picture, camera in ((seen.left, VIEW.stage.pair.left), (seen.right, VIEW.stage.pair.right)):
        taken = snapshot(textured_scene(), camera)
        inner = np.s_[60:300, 60:400]  # where the original saw something
        assert cv2.PSNR(picture[inner], taken[inner]) > 28


def test_a_lens_is_straightened_as_opencv_does_it():
    left, right = rig(BrownConrady(k1=-0.25, k2=0.06, p1=0.002))
    photographs = tuple(snapshot(textured_scene(), camera) for camera in (left, right))
    view = RectificationView.of(left, right, photographs)
    seen = stereo_pair.pictures(view.source, view.baseline, 1.0, 320)
    new = view.stage.pair.left
    turn = (new.world_from_cam.rotation.inv() * left.world_from_cam.rotation).as_matrix()
    coefficients = np.array([-0.25, 0.06, 0.002, 0, 0])
    maps = cv2.initUndistortRectifyMap(
        left.intrinsics.K, coefficients, turn, new.intrinsics.K, (320, 240), cv2.CV_32FC1
    )
    theirs = cv2.remap(photographs[0], *maps, cv2.INTER_LINEAR, borderValue=(38, 44, 54))
    assert cv2.PSNR(seen.left, theirs) > 40


@pytest.mark.parametrize("way", [0.25, 0.75])
def test_on_the_way_a_bending_lens_shows_points_where_its_own_projection_puts_them(way):
    """A dot painted into the photograph is found again where the camera of that moment sees its ray."""
    left, right = rig(BrownConrady(k1=-0.25, k2=0.06))
    dotted = np.zeros((240, 320, 3), np.uint8)
    uv = np.array([70.0, 60.0])
    cv2.circle(dotted, (70, 60), 3, (255, 255, 255), -1)
    view = RectificationView.of(left, right, (dotted, dotted), rectify=way)
    picture = stereo_pair.pictures(view.source, view.baseline, way, 320).left[..., 0].astype(float)
    v, u = np.mgrid[:240, :320]
    dot = picture > 100
    found = [np.average(axis[dot], weights=picture[dot]) for axis in (u, v)]
    there = view.stage.left.project(left.centre + left.unproject(uv))
    np.testing.assert_allclose(found, there, atol=0.3)


def test_a_fisheye_can_be_rectified_too():
    left, right = rig(Equidistant())
    photographs = tuple(snapshot(textured_scene(), camera) for camera in (left, right))
    view = RectificationView.of(left, right, photographs)
    inner = np.s_[60:180, 80:240]
    taken = snapshot(textured_scene(), view.stage.pair.left)
    picture = stereo_pair.pictures(view.source, view.baseline, 1.0, 320).left
    assert cv2.PSNR(picture[inner], taken[inner]) > 24


# Disparity and depth -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("draft", "most"), [(True, 0.1), (False, 0.05)])
def test_the_truth_is_what_rays_of_the_rectified_camera_meet(draft, most):
    camera = VIEW.stage.pair.left
    truth = VIEW.true_disparity_map(draft=draft)
    small = camera.intrinsics.within(truth.shape[1])
    rays = camera.unproject((small.grid() + 0.5) * (camera.intrinsics.width / small.width) - 0.5)
    _, distance = textured_scene().trace(camera.centre, rays)
    Z = distance * (rays @ camera.world_from_cam.rotation.as_matrix()[:, 2])
    off = np.abs(truth - VIEW.stage.pair.focal_length * 0.25 / Z)
    assert np.nanmedian(off) < most
    assert np.nanpercentile(off, 90) < 1


def test_what_lies_to_the_left_of_the_right_picture_has_no_true_disparity():
    view = VIEW.but(baseline=0.6)
    truth, distances = view.true_disparity_map(), stereo_pair.pictures(view.source, 0.6, 1.0, 480).distances
    lost = np.isnan(truth) & np.isfinite(distances)
    assert lost.any()
    assert np.nanmin(np.arange(480) - truth) >= -0.5
    points = view.stage.left.centre + distances[lost, None] * view.stage.left.rays()[lost]
    assert (view.stage.right.project(points)[:, 0] < -0.4).all()


def test_matching_along_rows_fails_as_taken_and_succeeds_rectified():
    assert VIEW.but(rectify=0.0).score().bad > 0.9
    assert VIEW.score().bad < 0.3
    assert VIEW.score().bad - VIEW.score().missing < 0.12


def test_the_formula_is_right_where_principal_points_differ_only_with_their_difference():
    """A pair in rows whose right picture was cropped: true before rectification as well as after."""
    f, doffs, B = 300.0, 14.0, 0.2
    left = Camera(Intrinsics(320, 240, f, f, 159.5, 119.5))
    right = Camera(
        Intrinsics(320, 240, f, f, 159.5 + doffs, 119.5), world_from_cam=RigidTransform.from_translation([B, 0, 0])
    )
    depth = np.full((240, 320), 2.5)
    photographs = tuple(snapshot(textured_scene(), camera) for camera in (left, right))
    for way, d in ((0.0, f * B / 2.5 - doffs), (1.0, f * B / 2.5)):
        view = RectificationView.of(left, right, photographs, depth, rectify=way)
        truth = view.true_disparity_map()
        assert np.nanmedian(truth) == pytest.approx(d, abs=1e-3)
        np.testing.assert_allclose(view.stage.depth(truth)[np.isfinite(truth)], 2.5, rtol=1e-3)


def test_half_a_pixel_is_worth_6_mm_at_1_m_and_63_cm_at_10_m():
    camera = Camera(Intrinsics(640, 480, 800, 800, 319.5, 239.5))
    view = RectificationView.of(camera, camera.at(RigidTransform.from_translation([0.1, 0, 0])))
    for disparity, depth, error in ((80.0, 1.0, 0.00625), (8.0, 10.0, 0.625)):
        state = view.but(disparity=disparity)
        near, far = state.depth_interval()
        assert state.depth() == pytest.approx(depth)
        assert (far - near) / 2 == pytest.approx(error, rel=0.005)
    assert view.but(disparity=0.5).depth_interval()[1] == np.inf
    assert "∞" in view.but(disparity=0.5).description()


def test_what_is_measured_at_the_mark_is_told_beside_the_truth():
    numbers = VIEW.but(column=255.0, row=152.0).numbers()
    measured, true = (float(numbers[name].split(" px")[0]) for name in ("measured at the mark", "true at the mark"))
    assert measured == pytest.approx(true, abs=0.5)
    assert true == pytest.approx(399.4 * 0.25 / 6.14, abs=0.1)  # the wall's picture


def test_moving_the_marks_matches_nothing_anew():
    VIEW.figure()
    before = stereo_pair.disparities.cache_info().misses
    VIEW.but(row=40.0, column=60.0, disparity=30.0, plus_minus=1.0).figure()
    assert stereo_pair.disparities.cache_info().misses == before
    VIEW.but(block_size=11).figure(draft=True)
    assert stereo_pair.disparities.cache_info().misses == before + 1


def test_a_map_shows_numbers_in_colours_and_nothing_where_there_is_none():
    picture = decoded(heat_map(np.array([[0.0, 5.0, 10.0, 99.0, np.nan]]), 0, 10, "depth"))[0]
    viridis = cv2.applyColorMap(np.array([[0, 127, 255, 255]], np.uint8), cv2.COLORMAP_VIRIDIS)[0]
    np.testing.assert_array_equal(picture[:4, :3], viridis)
    np.testing.assert_array_equal(picture[:, 3], [255, 255, 255, 255, 0])


# Hands and words -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [0.0, 0.5, 1.0])
def test_dragging_moves_the_marks_along_with_the_turning_pictures(way):
    view = VIEW.but(rectify=way)
    target = view.but(column=300.0, row=120.0)
    moved = view.dragged("left", *centre_of(view._image_panel("left"), target.uv_left), 1, 1)
    assert (moved.column, moved.row) == pytest.approx((300, 120), abs=1e-6)
    target = view.but(disparity=33.0)
    moved = view.dragged("right", *centre_of(view._image_panel("right"), target.uv_right), 1, 1)
    assert (moved.disparity, moved.column, moved.row) == pytest.approx((33.0, view.column, view.row), abs=1e-6)


def test_arrow_keys_move_the_mark_and_the_disparity():
    assert VIEW.pressed("left", "ArrowRight").column > VIEW.column
    assert VIEW.pressed("left", "ArrowDown").row > VIEW.row
    assert VIEW.pressed("right", "ArrowLeft").disparity > VIEW.disparity
    assert VIEW.pressed("right", "ArrowDown").row == VIEW.row


def test_the_marks_cannot_be_dragged_out_of_the_picture():
    moved = VIEW.dragged("left", -500, 5000, 0, 0)
    assert (moved.column, moved.row) == (0, 359)
    assert VIEW.dragged("right", 5000, 0, 0, 0).disparity > 0


def test_the_description_states_the_state():
    words = VIEW.but(rectify=0.0).description()
    assert "The pair as taken" in words
    assert "Z = 399 · 0.250 / 16.00 = 6.241 m" in words
    assert "±0.5 px: 6.052 m … 6.442 m" in words
    assert "Matched by SGM, blocks of 7 px, 64 disparities" in words


@pytest.mark.parametrize("name", CONTROLS)
def test_every_control_changes_the_picture_at_both_ends_and_draws_no_stray_nan(name):
    control = CONTROLS[name]
    ends = control.choices or ((False, True) if control.low is None else (control.low, control.high))
    drawn = [VIEW.but(**{name: end}).figure(draft=True) for end in ends]
    assert len({picture.body + str(picture.photographs) for picture in drawn}) == len(drawn)
    for picture in drawn:
        assert not re.search(r"\b(nan|inf)\b", picture.body)
        assert set(re.findall(r'attached:([^"]+)', picture.body)) == set(picture.photographs)


def test_photographs_without_a_truth_are_shown_without_a_score():
    left, right = rig()
    grey = np.full((240, 320, 3), 128, np.uint8)
    view = RectificationView.of(left, right, (grey, grey), show="error")
    picture = view.figure(draft=True)
    assert "truth unknown" in picture.body
    assert "off by more than" not in picture.description


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"photographs": (np.zeros((9, 9, 3), np.uint8),) * 2}, r"left photograph must have .*\(240, 320\)"),
        ({"depth": np.ones((9, 9))}, "depth must have"),
        ({"right": Camera(Intrinsics(640, 480, 500, 500, 320, 240))}, "of one size"),
        ({"right": rig()[0].at(RigidTransform.from_translation([-0.2, 0, 0]))}, "to the right"),
    ],
)
def test_a_pair_that_does_not_fit_is_refused_in_words(change, words):
    given = {"left": rig()[0], "right": rig()[1], **change}
    with pytest.raises(ValueError, match=words):
        RectificationView.of(**given)


def test_without_worth_nothing_is_said_about_the_error_of_a_depth():
    """So that the lesson can ask about it first."""
    silent = VIEW.but(worth=False).figure(draft=True)
    for words in (VIEW.interval(), "tooth", "What a disparity is worth"):
        assert words in VIEW.figure(draft=True).body
        assert words not in silent.body
    assert VIEW.equation() in silent.body
    assert VIEW.interval() not in silent.description


# The reader's own depth ----------------------------------------------------------------------------------------------


def test_the_readers_depth_colours_the_second_map():
    view = RectificationView(rectify=0.5, yours=lambda d, f, B, doffs: f * B / (d + doffs))
    found = view.disparity_map(draft=True)
    depth, problem = view.your_depth(draft=True)
    assert problem == ""
    known = np.isfinite(found) & (found + view.stage.doffs > 0)
    np.testing.assert_allclose(depth[known], view.stage.depth(found)[known])
    pictures = view.figure(draft=True).photographs
    wrong = view.but(yours=lambda d, f, B, doffs: f * B / (d + 10)).figure(draft=True).photographs
    assert wrong["second"] != pictures["second"]
    assert wrong["disparity"] == pictures["disparity"]


def test_the_right_depths_stand_greyed_where_a_reader_s_own_will_be():
    view = RectificationView(panels="disparity second", yours=lambda d, f, B, doffs: None)
    picture = view.figure(draft=True)
    assert "yours appears here" in picture.body
    assert 'class="awaited"' in picture.body
    assert picture.photographs["second"] == picture.photographs["disparity"]


def test_a_function_that_stops_leaves_the_map_empty_and_says_why():
    picture = RectificationView(panels="second", yours=lambda d, f, B, doffs: 1 / 0).figure(draft=True)
    assert "ZeroDivisionError" in picture.body
    assert "yours appears here" not in picture.body
    image = cv2.imdecode(np.frombuffer(picture.photographs["second"], np.uint8), cv2.IMREAD_UNCHANGED)
    assert (image[..., 3] == 0).all()


def test_the_first_view_is_one_map_of_depths_and_says_nothing_more():
    picture = RectificationView(rectify=0.0, panels="second").figure(draft=True)
    assert list(picture.photographs) == ["second", "second key"]
    assert [tile.name for tile in picture.tiles] == ["second map"]
    for later in ("Z =", "px", "isparity", "drag"):
        assert later not in re.sub(r'data-[a-z]+="[^"]*"', "", picture.body)
    assert picture.description == "The pair as taken. Matched by SGM, blocks of 7 px, 64 disparities."


def test_a_view_of_the_pictures_alone_matches_nothing():
    before = stereo_pair.disparities.cache_info()
    RectificationView(rectify=0.123, panels="left right").figure(draft=True)
    assert stereo_pair.disparities.cache_info() == before


@pytest.mark.parametrize("panels", ["", "nonsense", "left middle"])
def test_panels_that_there_are_not_are_refused(panels):
    with pytest.raises(ValueError, match="panels must be some of left, right, numbers"):
        RectificationView(panels=panels)


@pytest.mark.parametrize("name", RectificationView.openable)
def test_each_panel_opens_beside_the_first_and_closes_again(name):
    first = RectificationView(panels="right" if name == "left" else "left")
    opened = first.with_panels({name: True})
    assert len(opened.figure(draft=True).tiles) == 2
    assert opened.with_panels({name: False}) == first


def test_tiles_stand_in_rows_without_overlap_however_many_are_open():
    panels = ""
    for name in RectificationView.openable:
        panels += f" {name}"
        cells = list(RectificationView(panels=panels)._layout.values())
        assert all(x + width <= 960.5 for x, _, width, _ in cells)
        for one, (left, top, width, height) in enumerate(cells):
            for other, (x, y, *_) in enumerate(cells):
                assert one == other or not (left <= x < left + width and top <= y < top + height)
