"""The pinhole visualizer shows what the optics say, and its controls do what they are named for."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz import optics
from camviz.scenes import to_linear
from camviz.views.yours import YOURS_HERE
from camviz_school.views.box_in_space import TOWER, TOWER_M, WALL_MM
from camviz_school.views.pinhole import LAMP_PX, PIXELS, PinholeView


def test_the_box_is_a_camera_as_opencv_has_it():
    """And by similar triangles: the tower's image is f / Z times its height."""
    view = PinholeView(depth_mm=35, object_m=2.2)
    points = TOWER + np.array([(0.2, -0.3, 0.1), (-0.4, 0.1, 2.0), (0, 0, 0)])
    K = view.camera().intrinsics.K
    expected = cv2.projectPoints(points - TOWER + (0, 0, 2.2), np.zeros(3), np.zeros(3), K, None)[0].reshape(-1, 2)
    np.testing.assert_allclose(view.camera().project(points), expected, atol=1e-9)
    top, bottom = view.camera().project(TOWER + np.array([(0, -TOWER_M / 2, 0), (0, TOWER_M / 2, 0)]))
    tall_mm = (bottom - top)[1] * WALL_MM[0] / PIXELS
    assert tall_mm == pytest.approx(35 * 1.16 / 2.2)
    assert f"= {tall_mm:.1f} mm" in view.equation()


def test_the_numbers_are_those_of_the_optics():
    view = PinholeView(hole_mm=0.4, depth_mm=60, object_m=1.5, exposure_s=2)
    numbers = view.numbers()
    blur = optics.pinhole_blur_mm(0.4, 60, 1500)
    assert numbers["blur on the wall"] == f"{1000 * blur:.0f} µm = {blur / 0.075:.1f} px"
    assert numbers["f-number"] == "f/150"
    assert numbers["field of view"].startswith("33.4°")
    assert numbers["brightness"] == f"{optics.sunny_exposure(0.4, 60, 2):.1f} × correct"
    panel = view.figure(draft=True).marks.panels()["blur"].marks
    shadow, airy, total = (panel.points(name) for name in ("orange dashed", "green dashed", "blue thick"))
    lines = [np.interp(panel.points("red")[0, 0], *line.T) for line in (shadow, airy, total)]
    assert lines[2] == pytest.approx(panel.points("red")[0, 1], abs=0.1)
    assert lines[2] < min(lines[:2])  # both together blur more, and less is below
    quiet = PinholeView(panels="box picture numbers")  # who is to predict the blur is shown none
    assert not {"blur", "Airy"} & set(f"{quiet.description()} {written(quiet.figure(draft=True))}".split())


def by_a_reader(points, f, cx, cy):
    return f * points[..., :2] / points[..., 2:] + (cx, cy)


def outlines(view, colour):
    """The garden's outlines as they are drawn, as one array (n, 2), gaps left out."""
    points = view.figure(draft=True).marks.points(colour)
    return points[np.isfinite(points).all(axis=1)]


def test_a_reader_s_projection_draws_the_garden_where_camviz_does():
    view = PinholeView(depth_mm=40, object_m=2.5, panels="picture yours", yours=by_a_reader)
    right = outlines(view, "yellow")
    np.testing.assert_allclose(outlines(view, "orange"), right, atol=1e-9)
    assert len(right) > 500
    corner = TOWER + (0.31 * np.cos(0.5) - 0.31 * np.sin(0.5), 0.58, -0.31 * np.sin(0.5) - 0.31 * np.cos(0.5))
    foot = (view.camera().project(corner) + 0.5) * 440 / PIXELS  # of the crate, which is turned by half a radian
    assert np.linalg.norm(right - foot, axis=1).min() < 0.1
    wrong = view.but(yours=lambda points, f, cx, cy: f * points[..., :2] + (cx, cy))
    assert len(outlines(wrong, "orange")) > 0
    waiting = view.but(yours=lambda *_: None)
    assert YOURS_HERE in written(waiting.figure(draft=True))
    (awaited,) = waiting.figure(draft=True).marks.of("awaited")
    np.testing.assert_allclose(awaited.marks.points("yellow"), view.figure(draft=True).marks.points("yellow"))
    for function, words in ((None, "No function"), (lambda x: x, "no answer")):
        picture = view.but(yours=function).figure(draft=True)
        assert words in written(picture)
        assert not picture.marks.of("orange")


@pytest.mark.parametrize("turned", [True, False])
def test_a_lamp_anywhere_on_its_ray_has_one_place(turned):
    """In the box its dot and its ray lead on; on the wall its mark stays where OpenCV projects the lamp."""

    def mark(view):
        return view.figure(draft=True).marks.points("yellow ringed")[0]

    near, far = (
        PinholeView(object_m=4.0, lamp_m=lamp_m, panels="picture box", turn_picture=turned) for lamp_m in (0.5, 3.9)
    )
    np.testing.assert_allclose(mark(near), mark(far))
    K, (lamp,) = near.camera().intrinsics.K, far._ray_starts().values()
    pixel = cv2.projectPoints(lamp.reshape(1, 1, 3), np.zeros(3), np.zeros(3), K, None)[0].ravel()
    np.testing.assert_allclose(pixel - K[:2, 2], LAMP_PX)
    assert np.linalg.norm(lamp) == pytest.approx(3.9)
    shown = pixel if turned else (PIXELS - 1, PIXELS * 0.75 - 1) - pixel
    np.testing.assert_allclose(mark(near), (shown + 0.5) * 380 / PIXELS, atol=1e-6)
    with pytest.raises(ValueError, match="lamp_m must not be below zero, got -1"):
        PinholeView(lamp_m=-1.0)


def test_the_picture_on_the_wall_is_turned_by_180_degrees():
    def shown(view):
        data = np.frombuffer(view.figure(draft=True).photographs["wall"], np.uint8)
        return cv2.imdecode(data, cv2.IMREAD_COLOR).astype(float)

    wall, upright = shown(PinholeView()), shown(PinholeView(turn_picture=True))
    assert np.abs(wall[::-1, ::-1] - upright).mean() < 4  # JPEG
    assert np.abs(wall - upright).mean() > 30


def test_light_grows_with_the_hole_squared():
    quiet = PinholeView(noise=False, exposure_s=0.1)
    assert quiet.but(hole_mm=0.6).brightness == pytest.approx(4 * quiet.brightness)
    assert quiet.but(hole_mm=0.6).image(160).mean() > 1.4 * quiet.image(160).mean()
    wide, narrow = (PinholeView(hole_mm=d, match_exposure=True) for d in (1.0, 0.1))
    assert (wide.brightness, narrow.brightness) == pytest.approx((1, 1))
    assert narrow.exposed_s == pytest.approx(100 * wide.exposed_s)
    assert PinholeView(hole_mm=2.0, exposure_s=10).image(160).min() > 250  # over-exposed


def test_both_too_wide_and_too_narrow_a_hole_blur_the_picture():
    def detail(hole):
        grey = cv2.cvtColor(PinholeView(hole_mm=hole, match_exposure=True, noise=False).image(), cv2.COLOR_RGB2GRAY)
        return cv2.Laplacian(grey.astype(float), cv2.CV_64F).std()

    best = detail(0.28)
    assert best > 2 * detail(0.08)
    assert best > 2 * detail(1.0)


def test_the_grain_of_a_picture_is_that_of_counted_photons():
    """Poisson: relative noise 1/sqrt(n). An eighth of the light is sqrt(8) times as grainy."""

    def grain(exposure_s):
        view = PinholeView(exposure_s=exposure_s)
        noisy, clean = (v.image().astype(float) for v in (view, view.but(noise=False)))
        flat = (slice(300, 330), slice(60, 420))
        linear = [to_linear(picture[flat] / 255) for picture in (noisy, clean)]
        return np.std(linear[0] - linear[1]) / np.mean(linear[1])

    assert grain(0.1) / grain(0.8) == pytest.approx(np.sqrt(8), rel=0.15)


def test_dragging_the_curve_changes_the_hole():
    view = PinholeView()
    assert view.dragged("hole", 300, 450, 40, 0).hole_mm > view.hole_mm > view.pressed("hole", "ArrowLeft").hole_mm
    assert view.dragged("hole", 0, 0, -9999, 0).hole_mm == pytest.approx(0.05)
    assert view.dragged("orbit", 0, 0, 30, 10).but(eye=view.eye) == view
    for name in ("hole_mm", "depth_mm", "object_m", "exposure_s"):
        for value in (0, -1.0):
            with pytest.raises(ValueError, match=name):
                PinholeView(**{name: value})
