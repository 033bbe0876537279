"""The depth-of-field visualizer shows what the lens does, and its controls do what they are named for."""

import cv2
import numpy as np
import pytest

from camviz import optics
from camviz.scenes import to_display
from camviz_school.views import aperture, lens_diagram
from camviz_school.views.depth_of_field import DepthOfFieldView
from camviz_school.views.garland import GLOBE_M, garden_with_lamps
from camviz_school.views.lens_elements import LensElementsView


def test_its_numbers_are_those_of_the_optics():
    view = DepthOfFieldView(focal_mm=50, f_number=8, focus_m=5.23333)
    numbers = view.numbers()
    assert view.circle_mm == pytest.approx(0.03)
    assert view.limits_m == pytest.approx((3.49448, 10.41667), abs=2e-5)
    assert numbers["depth of field"].startswith("3.49 m to 10.42 m")
    assert numbers["hyperfocal distance"] == "10.47 m"
    assert numbers["Airy disc"] == "10.8 µm across"  # 10.7 at infinity
    assert DepthOfFieldView(focal_mm=50, focus_m=1.0).numbers()["sensor at v"].startswith("52.63 mm")
    assert DepthOfFieldView(focal_mm=20, f_number=22, focus_m=10).numbers()["depth of field"].count("infinity") == 1
    near = DepthOfFieldView(focal_mm=100, f_number=4, focus_m=0.5)  # the disc spreads on its way to the sensor
    assert near.lens.image_mm == pytest.approx(125)
    assert near.airy_mm == pytest.approx(2.44 * 550e-6 * 125 / 25)
    assert near.numbers()["Airy disc"] == "6.7 µm across"
    quiet = DepthOfFieldView(diffraction=False, bounds=False).description()  # for readers who are to predict them
    assert "Airy" not in quiet
    assert "depth of field" not in quiet


def by_a_reader(f, N, s, u):
    return f**2 / (N * (s - f)) * np.abs(u - s) / u


def reader_s_limits(f, N, s, c):
    H = f**2 / (N * c) + f
    return s * (H - f) / (H + s - 2 * f), np.where(s < H, s * (H - f) / np.abs(H - s), np.inf)


def test_a_readers_blur_and_limits_lie_over_the_right_ones():
    view = DepthOfFieldView(f_number=5.6, focus_m=3.0, diffraction=False, panels="photograph blur", yours=by_a_reader)
    marks = view.but(your_limits=reader_s_limits).figure(draft=True).marks.panels()["blur"].marks
    right, (own, *_) = (marks.of(class_)[0].lines for class_ in ("blue thick", "orange dashed"))
    np.testing.assert_allclose(own, right[0], atol=1e-6)
    ends = [mark.lines[0][0, 0] for mark in marks.of("orange") if mark.class_ == "orange"][:2]
    np.testing.assert_allclose(ends, [view._plot.place((np.log10(end), 0))[0] for end in view.limits_m], atol=0.06)
    wrong = view.but(yours=lambda f, N, s, u: 2 * by_a_reader(f, N, s, u)).figure(draft=True).marks
    off = wrong.of("orange dashed")[0].lines[0] - right[0]
    np.testing.assert_allclose(off, np.broadcast_to((0, np.log10(2) * view._plot.scale[1]), off.shape), atol=1e-6)


def test_the_globe_keeps_its_size_while_the_framing_is_held():
    view = DepthOfFieldView(focal_mm=50, distance_m=2.3, hold="framing")
    near, far = view.but(focal_mm=35), view.but(focal_mm=100)

    def tall(one):
        ends = [(0.68, 0.36 + side * GLOBE_M / 2, 3.3) for side in (-1, 1)]
        return np.ptp(one.lens.camera.project(ends)[:, 1])

    assert tall(near) == pytest.approx(tall(view), rel=5e-3)
    assert tall(far) == pytest.approx(tall(view), rel=5e-3)
    assert near.distance_m < view.distance_m < far.distance_m
    assert far.focus_m == pytest.approx(far.distance_m)  # the focus went along
    lamp = [[2.05, -0.7, 9.2]]
    offsets = [
        abs((one.lens.camera.project(lamp) - one.lens.camera.project([[0.68, 0.36, 3.3]]))[0, 0]) for one in (near, far)
    ]
    assert offsets[1] > 1.5 * offsets[0]  # what is behind it grew: the camera moved, and perspective with it
    smaller = view.but(sensor="APS-C")
    assert tall(smaller) == pytest.approx(tall(view), rel=5e-3)


def test_holding_the_diameter_changes_the_f_number():
    view = DepthOfFieldView(focal_mm=50, f_number=2.0)
    assert view.but(focal_mm=100).f_number == 2.0
    held = view.but(hold="diameter").but(focal_mm=100)
    assert held.f_number == pytest.approx(4.0)
    assert held.lens.aperture_mm == pytest.approx(25.0)


def test_a_fixed_exposure_dims_with_the_square_of_the_f_number():
    fixed = DepthOfFieldView(match_exposure=False, focus_m=10.0)
    assert fixed.but(f_number=4).brightness == pytest.approx(1, abs=0.02)
    assert fixed.but(f_number=8).brightness / fixed.but(f_number=4).brightness == pytest.approx(0.25)
    assert fixed.but(f_number=8, match_exposure=True).brightness == 1


def test_the_photograph_is_the_one_that_traces_every_ray():
    """And no eye tells it from one of many more rays; half a lens makes it darker everywhere and crops nothing."""
    view = DepthOfFieldView(f_number=1.4, focus_m=1.5)
    exact = to_display(aperture.photograph(garden_with_lamps(), view.lens, 64))
    assert cv2.PSNR(view.image(64), exact) > 34
    far = DepthOfFieldView(focal_mm=100.0, f_number=1.4, focus_m=1.2)
    assert cv2.PSNR(far.image(), far.image(1024)) > 45
    whole, half = (DepthOfFieldView(f_number=4, covered=c).image(128).astype(float) for c in ("nothing", "upper half"))
    assert half.mean() < 0.8 * whole.mean()
    corners = np.s_[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert (half[corners] > 0.5 * whole[corners]).all()  # sRGB bytes: half the light is 0.73 of the byte


def test_lines_stay_straight_where_the_drawing_runs_to_infinity():
    """From a point 2 m away through a point 0.5 m away to the lens, in the drawing as in space."""
    z = np.array([2000.0, 500.0, 0.0])
    drawn = lens_diagram.before_lens(z, 300 + 0.1 * (2000 - z))
    (a, b, c) = np.column_stack([drawn, np.ones(3)])
    assert abs(np.linalg.det([a, b, c])) < 1e-6
    np.testing.assert_allclose(lens_diagram.before_lens(np.inf, 7.0), [-lens_diagram.HORIZON_MM, 0])


def test_a_cone_is_as_wide_at_the_sensor_as_the_blur():
    view = DepthOfFieldView(focal_mm=85, f_number=2, focus_m=1.5, distance_m=3.0)
    half = lens_diagram.cone_height(view.lens, 3000, view.lens.image_mm)
    assert 2 * abs(half) == pytest.approx(float(view.blur_mm(3.0)))


@pytest.mark.parametrize("bad", [{"f_number": -2}, {"focus_m": 0.04}, {"sensor": "large"}, {"match_exposure": 1}])
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        DepthOfFieldView(**bad)


def test_dragging_moves_object_sensor_and_focus():
    view = DepthOfFieldView()
    assert view.dragged("object", 0, 0, 5, 0).distance_m < view.distance_m
    assert view.dragged("sensor", 0, 0, 5, 0).focus_m < view.focus_m  # farther from the lens: focused nearer
    assert view.dragged("focus", 0, 0, 30, 0).focus_m > view.focus_m
    assert view.dragged("sensor", 0, 0, -999, 0).focus_m == 10
    assert view.pressed("object", "ArrowRight").distance_m < view.distance_m
    assert view.pressed("sensor", "ArrowRight").focus_m < view.focus_m
    assert view.pressed("focus", "ArrowRight").focus_m > view.focus_m
    v = view.lens.image_mm + 10 / view._loupe.scale[0]
    assert view.dragged("sensor", 0, 0, 10, 0).lens.image_mm == pytest.approx(v)
    assert optics.image_distance_mm(50, 1000 * view.dragged("sensor", 0, 0, 10, 0).focus_m) == pytest.approx(v)


@pytest.mark.parametrize("lens", ["triplet", "telephoto"])
def test_a_lens_cut_open_bends_rays_as_a_thin_one(lens):
    view = LensElementsView(lens=lens, image_mm=8.0)
    end = view.prescription.length_mm + view.prescription.back_focal_mm
    z, y = view.prescription.trace(view.heights_mm, 8.0 / view.prescription.focal_mm)
    np.testing.assert_allclose(y[-1], 8.0)
    assert z[-1] == pytest.approx(end)
    for ray in np.stack([np.broadcast_to(z[:, None], y.shape), y], axis=-1).swapaxes(0, 1):
        at_first = ray[0, 1] + 8.0 / view.prescription.focal_mm * view.prescription.front_principal_mm
        assert view._bent(ray) == pytest.approx(at_first)


def test_a_sheet_of_four_pixels_is_a_picture_too():
    """OpenCV takes four numbers in a column for a colour; at this focal length a lamp's sheet has just so many."""
    view = DepthOfFieldView(f_number=1.4, focus_m=1.3, focal_mm=60.0, panels="photograph blur")
    assert view.figure().photographs["lens"]
