"""The intrinsics visualizer shows true numbers, true pictures, and what no K can reveal."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz.cameras import Camera, Intrinsics
from camviz.scenes import Scene, render, textured_scene, to_display
from camviz_school.views.balloon import BALLOON, balloon_rim, balloon_scene, towards_balloon
from camviz_school.views.camera_matrix import GLOBE, GLOBE_RADIUS
from camviz_school.views.intrinsics import IntrinsicsView

OPERATIONS = ("as taken", "cropped", "resized", "binned")


def test_field_of_view_and_focal_length_are_opencvs():
    """cv2.calibrationMatrixValues takes the sensor's size in mm; its field is 2 atan(width / 2f) when centred."""
    view = IntrinsicsView(fx=700, fy=560, cx=320, cy=240, pitch_um=5.0)
    sensor_mm = 640 * 0.005, 480 * 0.005 / view.aspect
    across, down, focal_mm, _, aspect = cv2.calibrationMatrixValues(view.taken.K, (640, 480), *sensor_mm)
    at_minus_half = IntrinsicsView(fx=700, fy=560, cx=319.5, cy=239.5)  # the same camera, centres at integers
    np.testing.assert_allclose(at_minus_half.field_of_view_deg(), (across, down), atol=1e-9)
    assert view.focal_mm == pytest.approx(focal_mm, abs=1e-12)
    assert view.aspect == pytest.approx(aspect, abs=1e-12)
    # Off the centre the field is the sum of both sides: atan(640 / 640) = 45°, not 2 atan(320 / 640) = 53.1°.
    assert IntrinsicsView(fx=640, cx=-0.5).field_of_view_deg()[0] == pytest.approx(45, abs=1e-9)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_the_globe_and_centre_are_drawn_where_opencv_says(operation):
    """In the picture as taken, whatever becomes of it: an operation keeps each ray."""
    view = IntrinsicsView(fx=600, fy=540, cx=300, cy=260, distance=5, operation=operation)
    panel = view.figure(draft=True).marks.panels()["picture"]
    (bar,) = panel.marks.of("green thick")
    ends = GLOBE + np.array([(-GLOBE_RADIUS, -GLOBE_RADIUS - 0.08, 0), (GLOBE_RADIUS, -GLOBE_RADIUS - 0.08, 0)])
    uv = cv2.projectPoints(ends, np.zeros(3), -view.camera.centre, view.taken.K, None)[0].reshape(-1, 2)
    scale = np.array([panel.width / 640, panel.height / 480])
    np.testing.assert_allclose(bar.ends[0], (uv + 0.5) * scale, atol=1e-6)
    (centre,) = panel.marks.groups("principal")
    np.testing.assert_allclose(centre.marks.points("orange").mean(axis=0), (300.5, 260.5) * scale, atol=1e-6)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_an_operation_keeps_rays_and_millimetres(operation):
    view = IntrinsicsView(cx=330, skew=20)
    after = view.but(operation=operation)
    corner = after.camera.unproject((-0.5, -0.5))
    if operation == "cropped":
        np.testing.assert_allclose(corner, view.camera.unproject((255.5, 95.5)), atol=1e-12)
    else:
        np.testing.assert_allclose(corner, view.camera.unproject((-0.5, -0.5)), atol=1e-12)
    assert after.focal_mm == view.focal_mm
    binned = IntrinsicsView(cx=301, operation="binned").intrinsics
    np.testing.assert_allclose(
        IntrinsicsView(cx=301, operation="resized", scale=0.25).intrinsics.K, binned.K, atol=1e-12
    )
    assert binned.cx == pytest.approx(301 / 4 - 0.375)


def test_the_resized_picture_is_what_opencv_makes_of_the_whole_one():
    """cv2.resize follows the half-pixel rule; a picture rendered with scaled cx alone is shifted against it."""
    view = IntrinsicsView(operation="resized", scale=0.25)
    camera = Camera(view.taken, world_from_cam=view.camera.world_from_cam)
    small = to_display(cv2.resize(render(textured_scene(), camera, 2), (160, 120), interpolation=cv2.INTER_AREA))
    ours = to_display(render(textured_scene(), view.camera, 8))
    K = view.intrinsics
    shifted = Intrinsics(160, 120, K.fx, K.fy, view.cx / 4, view.cy / 4)
    wrong = to_display(render(textured_scene(), Camera(shifted, world_from_cam=camera.world_from_cam), 8))
    assert cv2.PSNR(ours, small) > 35
    assert cv2.PSNR(wrong, small) < 25


@pytest.mark.parametrize("change", [{"fx": 1700.0}, {"distance": 9.0}, {"focal_mm": 8.0}, {"fy": 900.0}, {"fx": 90.0}])
def test_the_lock_keeps_the_globe_where_and_as_large_as_it_was(change):
    view = IntrinsicsView(dolly_zoom=True, fy=400)
    moved = view.but(**change)
    assert moved.camera.centre[2] != view.camera.centre[2]
    sides = GLOBE + GLOBE_RADIUS * np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]])
    np.testing.assert_allclose(moved.camera.project(sides), view.camera.project(sides), atol=1e-9)
    assert moved.aspect == pytest.approx(view.aspect)
    assert IntrinsicsView().but(fx=900.0).distance == IntrinsicsView().distance  # without the lock


@pytest.mark.parametrize(
    "change",
    [{"fx": 1900.0}, {"fy": 160.0}, {"cx": 700.0}, {"cy": -50.0}, {"skew": 150.0}, {"focal_mm": 1.0}, {"aspect": 2.0}]
    + [{"operation": operation} for operation in OPERATIONS],
)
def test_no_intrinsics_reveal_the_balloon_behind_the_wall(change):
    assert IntrinsicsView().but(**change).in_sight() == 0


@pytest.mark.parametrize(("distance", "low", "high"), [(3, 0, 0), (6, 0.5, 0.7), (8, 0.7, 0.99), (12, 1, 1)])
def test_moving_back_reveals_the_balloon_by_its_share(distance, low, high):
    """Through a long lens aimed at it: the balloon's pixels nearer than the garden's, of all it has."""
    balloon = Scene([surface for surface in balloon_scene().surfaces if surface.name == "balloon"][:1])
    view = IntrinsicsView(distance=distance)
    x, y, _ = (BALLOON - view.camera.centre) / (BALLOON - view.camera.centre)[2]
    aimed = Intrinsics(160, 160, 4000, 4000, 79.5 - 4000 * x, 79.5 - 4000 * y)
    rays = Camera(aimed).rays()
    alone = balloon.trace(view.camera.centre, rays)[1]
    hidden = textured_scene().trace(view.camera.centre, rays)[1] < alone
    share = 1 - hidden.sum() / np.isfinite(alone).sum()
    assert low <= share <= high
    assert view.in_sight() == pytest.approx(share, abs=0.03)


def test_the_balloons_outline_is_where_rays_just_touch_it():
    balloon = Scene([surface for surface in balloon_scene().surfaces if surface.name == "balloon"][:1])
    eye = np.array([0.5, 0.2, -3.0])
    for size, meets in ((0.99, True), (1.01, False)):
        rays = balloon_rim(eye, size) - eye
        depth = balloon.trace(eye, rays / np.linalg.norm(rays, axis=-1, keepdims=True))[1]
        assert np.isfinite(depth).all() == meets
    assert towards_balloon(np.array([0, 0, 0.3]))[2] == pytest.approx(6.5, abs=1e-5)  # the front of the wall
    assert np.isnan(towards_balloon(np.array([0, 0, -8.0]))).all()


@pytest.mark.parametrize("panels", ["picture rays K pixels numbers", "picture K"])
def test_the_matrix_is_k_and_what_an_operation_makes_of_it(panels):
    """By hand, for a picture resized by one half: f and skew halved, c' = c/2 - 1/4."""
    view = IntrinsicsView(fx=450, fy=400, skew=40, cx=319.5, cy=241.0, panels=panels)
    K, half = [450, 40, 319.5, 0, 400, 241, 0, 0, 1], [225, 20, 159.5, 0, 200, 120.25, 0, 0, 1]
    for shown, entries in ((view, K), (view.but(operation="resized"), K + half)):
        drawn = [text.words.replace("−", "-") for text in shown.figure(draft=True).marks.of("number end")]
        np.testing.assert_allclose([float(number) for number in drawn], entries, atol=0.005)


def by_a_reader(uv, K):
    towards = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ np.linalg.inv(K).T
    return towards / np.linalg.norm(towards, axis=-1, keepdims=True)


def test_controls_in_other_units_set_the_focal_lengths():
    view = IntrinsicsView().but(aspect=1.5)
    assert (view.fx, view.fy) == (450, 675)
    assert (view.but(focal_mm=5.4).fx, view.but(focal_mm=5.4).fy) == pytest.approx((900, 1350))
    assert (view.but(pitch_um=12.0).fx, view.but(pitch_um=12.0).focal_mm) == (450, 5.4)
    scaled = IntrinsicsView(fx=500, fy=400).but(focal_px=1000.0)
    assert (scaled.fx, scaled.fy) == (1000, 800)
    lean = IntrinsicsView(fx=500, fy=400, skew=50).axes_angle_deg()
    assert lean == pytest.approx(90 + np.degrees(np.arctan(50 / 500)), abs=1e-9)
    unit = IntrinsicsView(millimetres=False)
    assert not {"mm", "µm"} & set(f"{unit.description()} {written(unit.figure(draft=True))}".split())
    for bad in ({"fx": np.nan}, {"fy": "much"}, {"operation": "stretched"}, {"dolly_zoom": 1}, {"aspect": "wide"}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            IntrinsicsView().but(**bad)
    for bad in ({"panels": "rays"}, {"panels": "picture attic"}, {"marks": "balloon attic"}):
        with pytest.raises(ValueError, match=f"{next(iter(bad))} must be"):
            IntrinsicsView(**bad)


def test_hands_move_the_principal_point_and_the_crop():
    view = IntrinsicsView(operation="cropped")
    unit = 440 / 640  # picture units per pixel
    moved = view.dragged("principal", 0, 0, 10 * unit, -20 * unit)
    assert (moved.cx, moved.cy) == pytest.approx((329.5, 219.5))
    window = view.dragged("window", 0, 0, -16 * unit, 10 * unit)
    assert (window.x0, window.y0) == pytest.approx((240, 106))
    assert window.intrinsics.cx == pytest.approx(319.5 - 240)
    far = view.dragged("window", 0, 0, 5000, 5000)
    assert (far.x0, far.y0) == (320, 240)
    assert view.pressed("principal", "ArrowRight").cx == pytest.approx(view.cx + 8)
    assert view.pressed("window", "ArrowUp").y0 == pytest.approx(view.y0 - 8)


def test_only_what_is_marked_and_inside_is_named_in_the_picture():
    names = {"balloon": "a balloon, behind the wall", "globe": "81 px", "centre": "(cx, cy)", "corners": "(639, 359)"}
    for mark in ("", *names):
        words = written(IntrinsicsView.alone(marks=mark).figure(draft=True))
        assert [name for name, name_drawn in names.items() if name_drawn in words] == mark.split()
    view = IntrinsicsView.alone(marks="balloon globe centre")
    for change, drawn in (({"fx": 150.0, "cx": -100.0}, "← (cx, cy)"), ({"fx": 2000.0, "cx": 740.0}, "(cx, cy) →")):
        panel = view.but(**change).figure(draft=True).marks.panels()["picture"]
        assert [text.words for text in panel.marks.texts()] == [drawn]


def test_without_its_mark_the_garden_has_no_balloon():
    """From 12 m it is in sight at one place of the picture: red with it, and the sky without it."""
    with_it = IntrinsicsView(distance=12.0)
    u, v = with_it.taken.resized(440, 330).to_pixels((BALLOON - with_it.camera.centre)[:2] / (BALLOON[2] + 8.7))
    for view, red_over_blue in ((with_it, True), (with_it.but(marks="globe"), False)):
        red, _, blue = view.image(draft=False)[round(v), round(u)].astype(int)
        assert (red > blue + 50) == red_over_blue


def test_a_reader_s_rays_run_to_the_frame_of_the_right_ones():
    view = IntrinsicsView(cx=200.0, skew=40.0, yours=by_a_reader)
    (right, *spokes, yours), _, _ = view._your_rays()
    np.testing.assert_allclose(yours.points, right.points, atol=1e-9)
    np.testing.assert_allclose(
        view.camera.project([one.points[1] for one in spokes]), view.intrinsics.border(1), atol=1e-6
    )

    def rays(function):
        panel = (
            IntrinsicsView(marks="", yours=function, panels="picture rays").figure(draft=True).marks.panels()["space"]
        )
        return panel.marks.points("orange")

    assert len(rays(lambda uv, K: uv @ K)) == 0 < len(rays(by_a_reader))
    assert not np.allclose(rays(lambda uv, K: by_a_reader(uv, K.T))[:4], rays(by_a_reader)[:4])
    waiting = IntrinsicsView(panels="picture rays", yours=lambda uv, K: None).figure(draft=True).marks
    assert waiting.of("awaited")
