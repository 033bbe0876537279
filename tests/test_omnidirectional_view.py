"""The omnidirectional visualizer shows true numbers and true pictures."""

import cv2
import numpy as np
import pytest
from every_view import words

from camviz.lenses import UnifiedSphere
from camviz.panoramas.reprojection import reproject
from camviz.scenes import snapshot, textured_scene
from camviz.views.yours import YOURS_HERE
from camviz_school.course.exercises import exercises
from camviz_school.views.omnidirectional import BLIND_DEG, OmnidirectionalView


def test_the_window_shows_what_a_camera_in_its_place_would_have_seen():
    """Through the mirror and out again: the garden as a perspective camera takes it, only softer."""
    view = OmnidirectionalView()
    picture = view.doughnut(1400)
    cut = reproject(picture, view.camera(1400), view.window(160))
    taken = snapshot(textured_scene(), view.window(160))
    soft = [cv2.GaussianBlur(one, (0, 0), 2) for one in (cut, taken)]
    assert cv2.PSNR(*soft) > 27
    assert cv2.PSNR(soft[0], np.roll(soft[1], 8, axis=1)) < 22
    assert cv2.PSNR(soft[0], soft[1][:, ::-1].copy()) < 18  # a mirror's left and right have been put right


def test_a_single_viewpoint_s_picture_is_the_one_traced_by_way_of_the_mirror():
    """The doughnut is photographed through the unified sphere; a camera a micrometre off its focus is traced."""
    view = OmnidirectionalView(xi=0.9)
    model, traced = view.doughnut(200), view.but(shift_mm=0.001).doughnut(200)
    assert not view.but(shift_mm=0.001).central
    y, x = np.mgrid[:200, :200] - 99.5
    seen = (np.hypot(x, y) < 97) & (np.hypot(x, y) > 12)
    off = np.abs(model.astype(int) - traced)[seen]
    assert off.mean() < 1.5


def test_the_numbers_of_a_paraboloid_are_those_of_the_stereographic_projection():
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


def test_a_sphere_and_a_moved_camera_have_no_single_viewpoint_and_say_by_how_much():
    for view in (OmnidirectionalView(mirror="spherical"), OmnidirectionalView(shift_mm=20)):
        numbers = view.numbers()
        assert "f/(1 + ξ)" not in numbers
        assert float(numbers["rays miss one point by"].split()[0]) > 1
        near, far = (float(numbers[f"wrong at {z} m by"][:-1]) for z in ("0.3", "3"))
        assert near == pytest.approx(np.degrees(view.missed_mm / 300), abs=0.006)
        assert near == pytest.approx(10 * far, abs=0.012)
    assert OmnidirectionalView(mirror="parabolic", shift_mm=40).central  # an orthographic camera stands anywhere


def test_the_middle_hides_the_camera_and_beyond_the_rim_there_is_nothing():
    picture = OmnidirectionalView().doughnut(160, draft=True)
    assert np.ptp(picture[76:84, 76:84], axis=(0, 1)).max() == 0
    assert np.ptp(picture[:8, :8], axis=(0, 1)).max() == 0
    view = OmnidirectionalView(pitch_deg=-70, hfov_deg=90)
    at = view.camera(400).project([np.sin(np.radians(BLIND_DEG)), np.cos(np.radians(BLIND_DEG)), 0])
    assert np.hypot(*(at - 199.5)) == pytest.approx(200 * view._share(BLIND_DEG), rel=1e-9)


@pytest.mark.parametrize("name", OmnidirectionalView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = OmnidirectionalView.controls()[name]
    base = OmnidirectionalView()
    ends = control.choices or (control.low, control.high)
    views = [base.but(**{name: end}) for end in ends] + [base]
    assert len({(view.figure(draft=True).svg(), *view.figure(draft=True).photographs.values()) for view in views}) >= 2
    drawn = [view.figure(draft=True) for view in views[:2]]
    assert drawn[0].svg() != drawn[1].svg() or drawn[0].photographs != drawn[1].photographs


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
    assert view.pressed("window", "ArrowRight").yaw_deg == 24
    assert view.pressed("window", "+").hfov_deg == 60
    assert view.pressed("orbit", "ArrowLeft").eye != view.eye
    assert view.but(yaw_deg=179).pressed("doughnut", "ArrowRight").yaw_deg == -177


def test_the_description_states_the_state():
    words = OmnidirectionalView(mirror="spherical").description()
    assert "spherical mirror" in words
    assert "rays miss one point by 3.2 mm" in words


@pytest.mark.parametrize("bad", [{"xi": np.nan}, {"mirror": "flat"}, {"unroll": 3}])
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        OmnidirectionalView(**bad)


WITH_YOURS = "doughnut window yours"


def shown(view, name, draft):
    return cv2.imdecode(np.frombuffer(view.figure(draft=draft).photographs[name], np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize("draft", [True, False])
@pytest.mark.parametrize("xi", [0.3, 0.8, 1.0])
def test_a_right_function_of_the_reader_s_cuts_the_same_window(draft, xi):
    right = exercises("10")["10.project"].reference
    view = OmnidirectionalView(panels=WITH_YOURS, yours=right, xi=xi, pitch_deg=-20)
    apart = np.abs(shown(view, "window", draft).astype(int) - shown(view, "yours", draft)).max(axis=-1)
    assert np.mean(apart > 30) < 0.02  # but for the rims of the mirror and of the camera's own hole


def test_a_wrong_one_cuts_another_and_none_leaves_a_sentence():
    alike = {  # where the mirror shows something, and beside the one cone on which it divides by 0
        *("mirror_images_kept", "zero_for_no_image", "divided_by_the_size", "infinity_at_zero"),
    }
    for known in exercises("10")["10.project"].misconceptions:
        if known.function.__name__ in alike:
            continue
        view = OmnidirectionalView(panels=WITH_YOURS, yours=known.function, xi=0.8, pitch_deg=0)
        if known.function.__name__ == "eye_in_front":  # a mirror whose eye sees nothing
            assert "answers NaN everywhere" in words(view.figure(draft=True).body)
            continue
        apart = np.abs(shown(view, "window", True).astype(int) - shown(view, "yours", True)).max(axis=-1)
        assert np.mean(apart > 30) > 0.02, known.explanation
    picture = OmnidirectionalView(panels=WITH_YOURS, yours=lambda points, xi: None).figure(draft=True)
    assert YOURS_HERE in picture.body
    assert "yours" not in picture.photographs
    broken = OmnidirectionalView(panels=WITH_YOURS, yours=lambda points, xi: points / "f").figure(draft=True)
    assert YOURS_HERE not in broken.body
    assert "gives no answer" in broken.body


def test_before_the_first_question_nothing_names_the_mirror():
    picture = OmnidirectionalView(panels="doughnut window").figure(draft=True)
    assert "hyperbolic" not in picture.body + picture.description
    assert "viewpoint" not in picture.body + picture.description
    assert [tile.name for tile in picture.tiles] == ["doughnut", "window"]
    for panels in ("window", "doughnut dome"):
        with pytest.raises(ValueError, match="panels must be doughnut and any of window"):
            OmnidirectionalView(panels=panels)


def test_every_panel_that_a_reader_opens_has_its_place_and_covers_no_other():
    for begun in ("doughnut section", "doughnut window", WITH_YOURS):
        view = OmnidirectionalView(panels=begun)
        for name in OmnidirectionalView.openable:
            view = view.with_panels({name: True})
            cells = [tile.cell for tile in view.figure(draft=True).tiles]
            assert len(cells) == len(view.panels.split())
            for i, (x, y, width, height) in enumerate(cells):
                assert x + width <= 960
                for a, b, across, down in cells[:i]:
                    assert x >= a + across or a >= x + width or y >= b + down or b >= y + height


def test_few_panels_tell_only_their_own_figures():
    cut, both = (OmnidirectionalView(panels=p).description() for p in ("doughnut section", "doughnut section window"))
    assert "window looks" not in cut
    assert "e = 1.513" in cut
    assert "window looks" in both
