"""The omnidirectional visualizer shows true numbers and true pictures."""

import cv2
import numpy as np
import pytest

from camviz.lenses import UnifiedSphere
from camviz.panoramas.reprojection import reproject
from camviz.scenes import snapshot, textured_scene
from camviz_school.course.exercises import exercises
from camviz_school.views.omnidirectional import BLIND_DEG, OmnidirectionalView


def test_the_window_is_what_a_camera_there_would_have_taken():
    """Through the mirror and out again: the garden as a perspective camera takes it, only softer."""
    view = OmnidirectionalView()
    picture = view.doughnut(1400)
    cut = reproject(picture, view.camera(1400), view.window(160))
    taken = snapshot(textured_scene(), view.window(160))
    soft = [cv2.GaussianBlur(one, (0, 0), 2) for one in (cut, taken)]
    assert cv2.PSNR(*soft) > 27
    assert cv2.PSNR(soft[0], np.roll(soft[1], 8, axis=1)) < 22
    assert cv2.PSNR(soft[0], soft[1][:, ::-1].copy()) < 18  # a mirror's left and right have been put right


def test_a_single_viewpoints_picture_is_the_one_traced():
    """The doughnut is photographed through the unified sphere; a camera a micrometre off its focus is traced."""
    view = OmnidirectionalView(xi=0.9)
    model, traced = view.doughnut(200), view.but(shift_mm=0.001).doughnut(200)
    assert not view.but(shift_mm=0.001).central
    y, x = np.mgrid[:200, :200] - 99.5
    seen = (np.hypot(x, y) < 97) & (np.hypot(x, y) > 12)
    off = np.abs(model.astype(int) - traced)[seen]
    assert off.mean() < 1.5


def test_a_paraboloids_numbers_are_the_stereographic_ones():
    """r = 2 f tan(θ/2) at half the focal length: 200 px from the axis at 112°; ξ = 1, and f/(1 + ξ) is half of f."""
    view = OmnidirectionalView(mirror="parabolic")
    f = 200 / np.tan(np.radians(56))
    numbers = view.numbers()
    assert numbers["f"] == f"{f:.1f} px"
    assert numbers["f/(1 + ξ)"] == f"{f / 2:.1f} px"
    assert numbers["viewpoint"] == "single"


def test_one_lens_goes_from_a_pinhole_to_a_paraboloid():
    rays = np.array([[0.3, -0.2, 1.0], [1.0, 0.5, 0.3]])
    flat = OmnidirectionalView(xi=0.0).camera(400)
    pinhole = flat.intrinsics.fx * rays[:, :2] / rays[:, 2:] + 199.5
    np.testing.assert_allclose(flat.intrinsics.to_pixels(flat.lens.project(rays)), pinhole, atol=1.5)  # ξ = 0.001
    assert OmnidirectionalView(xi=1.0).camera(400).lens == UnifiedSphere(1.0)
    assert OmnidirectionalView(xi=1.0).camera(400) == OmnidirectionalView(mirror="parabolic").camera(400)


def test_a_sphere_and_a_moved_camera_miss_one_viewpoint():
    for view in (OmnidirectionalView(mirror="spherical"), OmnidirectionalView(shift_mm=20)):
        numbers = view.numbers()
        assert "f/(1 + ξ)" not in numbers
        assert float(numbers["rays miss one point by"].split()[0]) > 1
        near, far = (float(numbers[f"wrong at {z} m by"][:-1]) for z in ("0.3", "3"))
        assert near == pytest.approx(np.degrees(view.missed_mm / 300), abs=0.006)
        assert near == pytest.approx(10 * far, abs=0.012)
    assert OmnidirectionalView(mirror="parabolic", shift_mm=40).central  # an orthographic camera stands anywhere


def test_the_camera_hides_the_middle_of_the_doughnut():
    picture = OmnidirectionalView().doughnut(160, draft=True)
    assert np.ptp(picture[76:84, 76:84], axis=(0, 1)).max() == 0
    assert np.ptp(picture[:8, :8], axis=(0, 1)).max() == 0
    view = OmnidirectionalView(pitch_deg=-70, hfov_deg=90)
    at = view.camera(400).project([np.sin(np.radians(BLIND_DEG)), np.cos(np.radians(BLIND_DEG)), 0])
    assert np.hypot(*(at - 199.5)) == pytest.approx(200 * view._share(BLIND_DEG), rel=1e-9)


def test_dragging_the_window_turns_it_and_the_doughnut_points_it():
    view = OmnidirectionalView()
    turned = view.dragged("window", 700, 100, 41, 0)
    assert turned.yaw_deg == pytest.approx(view.yaw_deg - 6.4)
    box = view._doughnut_box
    target = np.array([1.0, 0.1, 1.0]) / np.linalg.norm([1.0, 0.1, 1.0])
    x, y = box.place(view.camera(640).project(target)) + (box.x, box.y)
    pointed = view.dragged("doughnut", x, y, 1, 1)
    assert pointed.yaw_deg == pytest.approx(45, abs=0.2)
    assert pointed.pitch_deg == pytest.approx(-np.degrees(np.arctan(0.1 / np.sqrt(2))), abs=0.2)


WITH_YOURS = "doughnut window yours"


def shown(view, name, draft):
    return cv2.imdecode(np.frombuffer(view.figure(draft=draft).photographs[name], np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize("draft", [True, False])
@pytest.mark.parametrize("xi", [0.3, 0.8, 1.0])
def test_a_right_function_cuts_the_same_window(draft, xi):
    right = exercises("10")["10.project"].reference
    view = OmnidirectionalView(panels=WITH_YOURS, yours=right, xi=xi, pitch_deg=-20)
    apart = np.abs(shown(view, "window", draft).astype(int) - shown(view, "yours", draft)).max(axis=-1)
    assert np.mean(apart > 30) < 0.02  # but for the rims of the mirror and of the camera's own hole


def test_a_wrong_function_cuts_another_window():
    alike = {  # where the mirror shows something, and beside the one cone on which it divides by 0
        *("mirror_images_kept", "zero_for_no_image", "divided_by_the_size", "infinity_at_zero"),
        "eye_in_front",  # which sees nothing
    }
    for known in exercises("10")["10.project"].misconceptions:
        view = OmnidirectionalView(panels=WITH_YOURS, yours=known.function, xi=0.8, pitch_deg=0)
        if known.function.__name__ == "eye_in_front":
            texts = " ".join(text.words for text in view.figure(draft=True).marks.texts())
            assert "answers NaN everywhere" in texts
        if known.function.__name__ not in alike:
            apart = np.abs(shown(view, "window", True).astype(int) - shown(view, "yours", True)).max(axis=-1)
            assert np.mean(apart > 30) > 0.02, known.explanation
