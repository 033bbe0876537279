"""The intrinsics visualizer shows true numbers, true pictures, and what no K can reveal."""

import re

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.scenes import Scene, render, textured_scene, to_display
from camviz_school.views.balloon import BALLOON, balloon_rim, balloon_scene, towards_balloon
from camviz_school.views.camera_matrix import GLOBE, GLOBE_RADIUS
from camviz_school.views.intrinsics import IntrinsicsView

OPERATIONS = ("as taken", "cropped", "resized", "binned")


def opencv_pixels(view: IntrinsicsView, points_world: np.ndarray) -> np.ndarray:
    t = -view.camera.centre  # R = I
    return cv2.projectPoints(points_world, np.zeros(3), t, view.intrinsics.K, None)[0].reshape(-1, 2)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_point_of_the_garden_lands_where_opencv_says(operation):
    view = IntrinsicsView(fx=600, fy=540, cx=300, cy=260, distance=5, operation=operation)
    points = np.array([GLOBE, BALLOON, [-1.0, 0.5, 4.0]])
    np.testing.assert_allclose(view.camera.project(points), opencv_pixels(view, points), atol=1e-9)


def test_field_of_view_and_focal_length_agree_with_opencv_for_a_centred_camera():
    """cv2.calibrationMatrixValues takes the sensor's size in mm; its field is 2 atan(width / 2f) when centred."""
    view = IntrinsicsView(fx=700, fy=560, cx=320, cy=240, pitch_um=5.0)
    sensor_mm = 640 * 0.005, 480 * 0.005 / view.aspect
    across, down, focal_mm, _, aspect = cv2.calibrationMatrixValues(view.taken.K, (640, 480), *sensor_mm)
    at_minus_half = IntrinsicsView(fx=700, fy=560, cx=319.5, cy=239.5)  # the same camera, centres at integers
    np.testing.assert_allclose(at_minus_half.field_of_view_deg(), (across, down), atol=1e-9)
    assert view.focal_mm == pytest.approx(focal_mm, abs=1e-12)
    assert view.aspect == pytest.approx(aspect, abs=1e-12)


def test_field_of_view_of_an_off_centre_camera_is_the_sum_of_its_two_sides():
    """By hand: with cx = -0.5 the field is atan(640 / 640) = 45°, not 2 atan(320 / 640) = 53.1°."""
    assert IntrinsicsView(fx=640, cx=-0.5).field_of_view_deg()[0] == pytest.approx(45, abs=1e-9)
    assert IntrinsicsView(fx=320, cx=319.5).field_of_view_deg()[0] == pytest.approx(90, abs=1e-9)


def test_binning_by_four_leaves_the_same_matrix_as_resizing_to_a_quarter():
    binned, resized = (
        IntrinsicsView(cx=301, operation="binned"),
        IntrinsicsView(cx=301, operation="resized", scale=0.25),
    )
    np.testing.assert_allclose(binned.intrinsics.K, resized.intrinsics.K, atol=1e-12)
    assert binned.intrinsics.cx == pytest.approx(301 / 4 - 0.375)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_an_operation_renumbers_pixels_and_keeps_rays_and_millimetres(operation):
    view = IntrinsicsView(cx=330, skew=20)
    after = view.but(operation=operation)
    corner = after.camera.unproject((-0.5, -0.5))
    if operation == "cropped":
        np.testing.assert_allclose(corner, view.camera.unproject((255.5, 95.5)), atol=1e-12)
    else:
        np.testing.assert_allclose(corner, view.camera.unproject((-0.5, -0.5)), atol=1e-12)
    assert after.focal_mm == view.focal_mm


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


def test_without_the_lock_focal_length_moves_no_camera():
    assert IntrinsicsView().but(fx=900.0).distance == IntrinsicsView().distance


@pytest.mark.parametrize(
    "change",
    [{"fx": 1900.0}, {"fy": 160.0}, {"cx": 700.0}, {"cy": -50.0}, {"skew": 150.0}, {"focal_mm": 1.0}, {"aspect": 2.0}]
    + [{"operation": operation} for operation in OPERATIONS],
)
def test_no_intrinsics_reveal_the_balloon_behind_the_wall(change):
    assert IntrinsicsView().but(**change).in_sight() == 0


@pytest.mark.parametrize(("distance", "low", "high"), [(3, 0, 0), (6, 0.5, 0.7), (8, 0.7, 0.99), (12, 1, 1)])
def test_moving_back_reveals_the_balloon_as_counted_in_pixels(distance, low, high):
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


def test_the_line_of_sight_ends_on_the_front_of_the_wall():
    assert towards_balloon(np.array([0, 0, 0.3]))[2] == pytest.approx(6.5, abs=1e-5)
    assert np.isnan(towards_balloon(np.array([0, 0, -8.0]))).all()


def test_aspect_and_focal_length_in_millimetres_are_read_from_fx_fy_and_pitch_and_set_them():
    view = IntrinsicsView().but(aspect=1.5)
    assert (view.fx, view.fy) == (450, 675)
    assert view.but(focal_mm=5.4).fx == pytest.approx(900)
    assert view.but(focal_mm=5.4).fy == pytest.approx(1350)
    wider = view.but(pitch_um=12.0)
    assert (wider.fx, wider.focal_mm) == (450, 5.4)


def entries(view):
    """The numbers of the matrices that are drawn, one after the other."""
    drawn = view.figure(draft=True).svg()
    numbers = re.findall(r'<text[^>]*class="number end[^"]*"[^>]*>([^<]*)</text>', drawn)
    return np.array([float(number.replace("−", "-")) for number in numbers])


@pytest.mark.parametrize("panels", ["picture rays K pixels numbers", "picture K"])
def test_the_matrix_in_the_picture_is_k_and_beside_it_what_an_operation_makes_of_it(panels):
    """By hand, for a picture resized by one half: f and skew halved, c' = c/2 - 1/4."""
    view = IntrinsicsView(fx=450, fy=400, skew=40, cx=319.5, cy=241.0, panels=panels)
    K = [450, 40, 319.5, 0, 400, 241, 0, 0, 1]
    np.testing.assert_allclose(entries(view), K, atol=0.005)
    half = [225, 20, 159.5, 0, 200, 120.25, 0, 0, 1]
    np.testing.assert_allclose(entries(view.but(operation="resized")), [*K, *half], atol=0.005)


def test_a_focal_length_in_pixels_changes_fx_and_fy_together():
    view = IntrinsicsView(fx=500, fy=400).but(focal_px=1000.0)
    assert (view.fx, view.fy) == (1000, 800)
    assert IntrinsicsView(dolly_zoom=True).but(focal_px=900.0).distance == pytest.approx(6)


def test_without_millimetres_no_reading_knows_them():
    view = IntrinsicsView(millimetres=False)
    assert not re.search(r"[mµ]m\b", view.description())
    assert not re.search(r"[mµ]m\b", view.figure(draft=True).svg())
    assert re.search(r"\bmm\b", IntrinsicsView().description())


def test_the_axes_lean_by_the_arctangent_of_skew_over_fx():
    assert IntrinsicsView(fx=500, fy=400, skew=50).axes_angle_deg() == pytest.approx(
        90 + np.degrees(np.arctan(50 / 500)), abs=1e-9
    )
    assert IntrinsicsView(fx=500, fy=400).axes_angle_deg() == pytest.approx(90, abs=1e-12)


@pytest.mark.parametrize("name", IntrinsicsView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = IntrinsicsView.controls()[name]
    operation = {"x0": "cropped", "y0": "cropped", "scale": "resized"}.get(name, "as taken")
    base = IntrinsicsView(operation=operation)
    if name == "dolly_zoom":
        pictures = [base.but(dolly_zoom=on).but(fx=1000.0).figure(draft=True).svg() for on in (False, True)]
        assert len(set(pictures)) == 2
        return
    ends = control.choices or (control.low, control.high)
    pictures = [base.but(**{name: end}).figure(draft=True).svg() for end in ends]
    assert len(set(pictures)) == len(ends)


def test_dragging_moves_the_principal_point_the_crop_and_the_onlooker_each_by_its_handle():
    view = IntrinsicsView(operation="cropped")
    unit = 440 / 640  # picture units per pixel
    moved = view.dragged("principal", 0, 0, 10 * unit, -20 * unit)
    assert (moved.cx, moved.cy) == pytest.approx((329.5, 219.5))
    window = view.dragged("window", 0, 0, -16 * unit, 10 * unit)
    assert (window.x0, window.y0) == pytest.approx((240, 106))
    assert window.intrinsics.cx == pytest.approx(319.5 - 240)
    far = view.dragged("window", 0, 0, 5000, 5000)
    assert (far.x0, far.y0) == (320, 240)
    turned = view.dragged("orbit", 0, 0, 30, 5)
    assert turned.eye != view.eye
    assert turned.but(eye=view.eye) == view


def test_arrow_keys_do_what_dragging_does():
    view = IntrinsicsView(operation="cropped")
    assert view.pressed("principal", "ArrowRight").cx == pytest.approx(view.cx + 8)
    assert view.pressed("window", "ArrowUp").y0 == pytest.approx(view.y0 - 8)
    assert view.pressed("orbit", "ArrowLeft").eye != view.eye


def test_the_description_states_the_state():
    words = IntrinsicsView(operation="binned").description()
    assert "cx = 79.50" in words
    assert "160 × 120" in words
    assert "0 % in sight" in words


def test_a_loaded_camera_keeps_its_numbers():
    """OpenCV's samples/data/left_intrinsics.yml."""
    K = Intrinsics(640, 480, 535.91573396163199, 535.91573396163199, 342.28315473308373, 235.57082909788173)
    assert IntrinsicsView.of(Camera(K)).taken == K
    large = IntrinsicsView.of(Camera(Intrinsics(1920, 1200, 1400, 1400, 960, 600)), operation="cropped")
    assert large.figure(draft=True).svg().count("attached:camera") == 1


@pytest.mark.parametrize(
    "bad", [{"fx": np.nan}, {"fy": "much"}, {"operation": "stretched"}, {"dolly_zoom": 1}, {"aspect": "wide"}]
)
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        IntrinsicsView().but(**bad)


def by_a_reader(uv, K):
    towards = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1) @ np.linalg.inv(K).T
    return towards / np.linalg.norm(towards, axis=-1, keepdims=True)


def orange_lines(body):
    return re.findall(r'<path d="([^"]*)" class="orange', body)


def test_a_reader_s_rays_run_to_the_frame_of_the_right_ones():
    view = IntrinsicsView(cx=200.0, skew=40.0, yours=by_a_reader)
    body = view.figure(draft=True).body
    (right, *spokes, yours), _, _ = view._your_rays()
    np.testing.assert_allclose(yours.points, right.points, atol=1e-9)
    corners = [spoke.points[1] for spoke in spokes]
    np.testing.assert_allclose(view.camera.project(corners), view.intrinsics.border(1), atol=1e-6)
    wrong = view.but(yours=lambda uv, K: by_a_reader(uv, K.T)).figure(draft=True).body
    assert orange_lines(wrong) != orange_lines(body)


def test_a_reader_s_function_that_stops_draws_no_rays_and_is_told_of():
    none = orange_lines(IntrinsicsView().figure(draft=True).body)
    body = IntrinsicsView(yours=lambda uv, K: uv @ K).figure(draft=True).body
    assert "ValueError" in body
    assert len(orange_lines(body)) <= len(none)


# One panel first, and what the reader opens ---------------------------------------------------------------------------


def tiles(view):
    return [tile.name for tile in view.figure(draft=True).tiles]


def test_a_picture_stands_alone_until_rays_k_pixels_or_numbers_are_opened():
    alone = IntrinsicsView.alone()
    assert tiles(alone) == ["picture"]
    assert tiles(alone.with_panels({"K": True})) == ["picture", "K"]
    assert tiles(alone.with_panels({"numbers": True, "rays": True})) == ["picture", "rays", "numbers"]
    assert tiles(IntrinsicsView()) == ["picture", "rays", "K", "what becomes of it", "pixels", "numbers"]
    assert IntrinsicsView().opened == ("rays", "K", "pixels", "numbers")


@pytest.mark.parametrize("opened", range(16))
def test_no_two_panels_share_a_place_and_each_row_is_full_whatever_is_open(opened):
    names = [name for bit, name in enumerate(IntrinsicsView.openable) if opened >> bit & 1]
    cells = IntrinsicsView.alone().with_panels(dict.fromkeys(names, True))._layout.values()
    for top in {y for _, y, _, _ in cells}:
        row = sorted((x, width) for x, y, width, _ in cells if y == top)
        ends = np.cumsum([width for _, width in row])
        np.testing.assert_allclose([x for x, _ in row], [0, *ends[:-1]])
        assert ends[-1] == pytest.approx(960 if names else 528)  # alone, a picture's tile is as wide as the picture
    two_tiles = "K" in names and len(names) > 2  # where K and what becomes of it stand beside each other
    assert len(cells) == len(names) + 1 + two_tiles


@pytest.mark.parametrize("bad", [{"panels": "rays"}, {"panels": "picture attic"}, {"marks": "balloon attic"}])
def test_unknown_panels_and_marks_are_refused(bad):
    with pytest.raises(ValueError, match=f"{next(iter(bad))} must be"):
        IntrinsicsView(**bad)


def test_what_lies_beyond_the_picture_has_no_name_in_it_and_the_principal_point_an_arrow():
    view = IntrinsicsView.alone(marks="balloon globe centre")
    assert named(view) == {"a balloon, behind the wall", "81 px", "(cx, cy)"}
    assert named(view.but(fx=150.0, cx=-100.0)) == {"← (cx, cy)"}
    assert named(view.but(fx=2000.0, cx=740.0)) == {"(cx, cy) →"}


def named(view: IntrinsicsView) -> set[str]:
    """What stands in the picture."""
    return set(re.findall(r'<text[^>]* class="label[^>]*>([^<]+)<', view.figure(draft=True).body))


def test_only_what_is_marked_is_named_in_the_picture_and_the_numbers():
    names = {"balloon": "a balloon, behind the wall", "globe": "81 px", "centre": "(cx, cy)", "corners": "(639, 359)"}
    for mark in ("", *names):
        body = IntrinsicsView.alone(marks=mark).figure(draft=True).body
        assert [name for name, words in names.items() if words in body] == mark.split()
    assert "red balloon" in IntrinsicsView(marks="balloon").numbers()
    assert "red balloon" not in IntrinsicsView(marks="globe").numbers()
    assert "camera to globe" in IntrinsicsView(marks="globe").numbers()
    assert "camera to globe" not in IntrinsicsView(marks="centre corners").numbers()


def test_without_its_mark_the_garden_has_no_balloon():
    """From 12 m it is in sight at one place of the picture: red with it, and the sky without it."""
    with_it = IntrinsicsView(distance=12.0)
    u, v = with_it.taken.resized(440, 330).to_pixels((BALLOON - with_it.camera.centre)[:2] / (BALLOON[2] + 8.7))
    red, _, blue = with_it.image(draft=False)[round(v), round(u)].astype(int)
    assert red > blue + 50
    red, _, blue = with_it.but(marks="globe").image(draft=False)[round(v), round(u)].astype(int)
    assert blue >= red


def test_the_shape_of_a_pixel_is_a_number_only_beside_what_shows_it():
    alone = IntrinsicsView.alone(panels="picture numbers")
    assert "pixel width / height" not in alone.figure(draft=True).body
    assert "pixel width / height" in alone.with_panels({"pixels": True}).figure(draft=True).body
    assert "pixel width / height" in alone.but(millimetres=True).figure(draft=True).body


def test_an_unwritten_function_leaves_the_right_rays_greyed_and_a_faulty_one_its_error():
    def unwritten(uv, K): ...

    def faulty(uv, K):
        return uv[7, 7, 7]

    view = IntrinsicsView(panels="picture rays", yours=unwritten)
    body = view.figure(draft=True).body
    assert 'class="awaited"' in body
    assert "yours appears here" in body
    (right, *_, waiting), _, _ = view._your_rays()
    np.testing.assert_allclose(waiting.points, right.points)
    body = view.but(yours=faulty).figure(draft=True).body
    assert "awaited" not in body
    assert "IndexError" in body
