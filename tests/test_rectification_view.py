"""The rectification view turns what must be turned and nothing else, measures truly, and keeps what does not change."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Perspective
from camviz.scenes import snapshot, textured_scene
from camviz_school.views import stereo_pair
from camviz_school.views.rectification import RectificationView

VIEW = RectificationView()


def rig(lens=None):
    """A pair of equal cameras, toed in and tilted."""
    camera = Camera(Intrinsics.from_fov(320, 240, 62), lens or Perspective())
    turn = Rotation.from_euler("YXZ", [-4, 1, 3], degrees=True)
    return camera, camera.at(RigidTransform.from_components([0.2, 0.01, 0.02], turn))


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


@pytest.mark.parametrize(("way", "least"), [(0.0, 10), (0.5, 3), (1.0, 0)])
def test_the_marks_are_partners_by_opencvs_epipolar_lines(way, least):
    """At every moment of the way; and the green line in the right picture is that of the mark in the left."""
    view = VIEW.but(rectify=way)
    F = twoview.fundamental(view.stage.left, view.stage.right)
    line = cv2.computeCorrespondEpilines(view.uv_left.reshape(1, 1, 2), 1, F).ravel()
    assert abs(line @ [*view.uv_right, 1]) < 1e-3  # OpenCV's lines are float32
    assert view.rows_apart() > least if least else view.rows_apart() < 1e-9
    panel = view._image_panel("right")
    drawn = view.figure(draft=True).marks.panels()["right"].marks.points("green")
    assert len(drawn) >= 2
    assert max(abs(line @ [*panel.data(place), 1]) for place in drawn) < 0.01


def test_the_marks_meet_at_the_depth_that_the_formula_gives():
    """Triangulated in the pictures as taken, which know nothing of rectification."""
    view = VIEW.but(rectify=0.0)
    point = twoview.triangulate([view.stage.left, view.stage.right], np.stack([view.uv_left, view.uv_right]))
    axis = view.stage.pair.left.world_from_cam.rotation.as_matrix()[:, 2]
    assert (point.ravel() - view.stage.left.centre) @ axis == pytest.approx(view.depth(), rel=1e-9)


# The pictures --------------------------------------------------------------------------------------------------------


def test_the_rectified_picture_is_a_turned_cameras():
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
def test_on_the_way_a_bending_lens_shows_points_at_its_own(way):
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


def test_matching_along_rows_needs_rectification():
    assert VIEW.but(rectify=0.0).score().bad > 0.9
    assert VIEW.score().bad < 0.3
    assert VIEW.score().bad - VIEW.score().missing < 0.12


def test_the_formula_needs_the_principal_points_difference():
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


# Hands and words -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [0.0, 0.5, 1.0])
def test_dragging_moves_the_marks_with_the_pictures(way):
    view = VIEW.but(rectify=way)
    target = view.but(column=300.0, row=120.0)
    moved = view.dragged("left", *centre_of(view._image_panel("left"), target.uv_left), 1, 1)
    assert (moved.column, moved.row) == pytest.approx((300, 120), abs=1e-6)
    target = view.but(disparity=33.0)
    moved = view.dragged("right", *centre_of(view._image_panel("right"), target.uv_right), 1, 1)
    assert (moved.disparity, moved.column, moved.row) == pytest.approx((33.0, view.column, view.row), abs=1e-6)


def test_a_pair_that_does_not_fit_is_refused_in_words():
    left, right = rig()
    small = (np.zeros((9, 9, 3), np.uint8),) * 2
    for given, words in (
        ((left, right, small), r"left photograph must have .*\(240, 320\)"),
        ((left, right, None, np.ones((9, 9))), "depth must have"),
        ((left, Camera(Intrinsics(640, 480, 500, 500, 320, 240))), "of one size"),
        ((left, left.at(RigidTransform.from_translation([-0.2, 0, 0]))), "to the right"),
    ):
        with pytest.raises(ValueError, match=words):
            RectificationView.of(*given)


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
