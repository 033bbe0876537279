"""The depth-of-field visualizer shows what the lens does, and its controls do what they are named for."""

import re
from itertools import combinations

import cv2
import numpy as np
import pytest

from camviz import optics
from camviz.scenes import to_display
from camviz_school.views import aperture, lens_diagram
from camviz_school.views.depth_of_field import DepthOfFieldView
from camviz_school.views.garland import GLOBE_M, garden_at_dusk, garden_with_lamps
from camviz_school.views.lens_elements import LensElementsView

ENDS = [
    (name, value)
    for name, control in DepthOfFieldView.controls().items()
    for value in (control.choices or ((control.low, control.high) if control.low is not None else (True, False)))
]


@pytest.mark.parametrize(("name", "value"), ENDS)
def test_every_end_of_every_control_draws_and_changes_what_is_seen(name, value):
    view = DepthOfFieldView(f_number=2.5, focus_m=3.0)
    if name == "hold":  # changes nothing by itself: it says what a change of focal length does
        view, value, name = view.but(hold=value), 90.0, "focal_mm"
    if getattr(view, name) == value:
        return
    first, other = view.figure(draft=True), view.but(**{name: value}).figure(draft=True)
    assert other.body != first.body or other.photographs != first.photographs
    assert "nan" not in other.body.lower().replace("nance", "")


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


def test_the_airy_disc_spreads_on_its_way_to_the_sensor():
    """2.44 λ v / D: at f = 100 mm, f/4 it is 5.4 µm for distant subjects, a quarter more with the sensor at 125 mm."""
    near = DepthOfFieldView(focal_mm=100, f_number=4, focus_m=0.5)
    assert near.lens.image_mm == pytest.approx(125)
    assert near.airy_mm == pytest.approx(2.44 * 550e-6 * 125 / 25)
    assert near.numbers()["Airy disc"] == "6.7 µm across"
    far = DepthOfFieldView(focal_mm=100, f_number=4, focus_m=1e6)
    assert far.airy_mm == pytest.approx(2.44 * 550e-6 * 4, rel=1e-3)


def by_a_reader(f, N, s, u):
    return f**2 / (N * (s - f)) * np.abs(u - s) / u


def reader_s_limits(f, N, s, c):
    H = f**2 / (N * c) + f
    return s * (H - f) / (H + s - 2 * f), np.where(s < H, s * (H - f) / np.abs(H - s), np.inf)


def test_a_reader_s_blur_and_limits_are_drawn_over_the_right_ones():
    view = DepthOfFieldView(f_number=5.6, focus_m=3.0, diffraction=False, panels="photograph blur", yours=by_a_reader)
    body = view.but(your_limits=reader_s_limits).figure(draft=True).body
    curves = [re.findall(rf'<path d="([^"]*)" class="{colour}"', body)[0] for colour in ("blue thick", "orange dashed")]
    assert curves[0] == curves[1]
    near, far = view.limits_m
    lines = [float(x) for x in re.findall(r'<path d="M([\d.]+),[^"]*" class="orange"', body)[:2]]
    assert lines == pytest.approx([view._plot.place((np.log10(end), 0))[0] for end in (near, far)], abs=0.06)
    wrong = view.but(yours=lambda f, N, s, u: f * N + 0 * u).figure(draft=True).body
    assert re.findall(r'<path d="([^"]*)" class="orange dashed"', wrong)[0] != curves[0]


def test_a_reader_s_function_that_stops_is_told_of_and_draws_nothing():
    view = DepthOfFieldView(panels="photograph blur", yours=lambda *_: None, your_limits=lambda *_: 1 / 0)
    body = view.figure(draft=True).body
    assert "returns nothing" in body
    assert "ZeroDivisionError" in body
    assert "nan" not in body.lower().replace("nance", "")
    assert re.findall(r'<path d="([^"]*)" class="orange', body)[2:] == []  # two samples of lines in the legend
    assert view.image(16).shape == (240, 320, 3)


def test_a_view_with_fewer_panels_says_only_what_they_show():
    rays, blur = (DepthOfFieldView(panels=panels) for panels in ("rays photograph", "photograph blur"))
    assert "depth of field" not in rays.description()
    assert "Blur against distance" not in rays.figure(draft=True).body
    assert "depth of field" in blur.description()
    quiet = blur.but(bounds=False)
    assert "depth of field" not in quiet.description()
    assert "allowed" not in quiet.figure(draft=True).body
    assert "At the sensor" not in blur.figure(draft=True).body
    with pytest.raises(ValueError, match="panels"):
        DepthOfFieldView(panels="rays")
    with pytest.raises(ValueError, match="panels"):
        DepthOfFieldView(panels="photograph, blur")


PANELS = ("rays", "sensor", "blur", "numbers")


@pytest.mark.parametrize("opened", [few for count in range(5) for few in combinations(PANELS, count)], ids=" ".join)
def test_whatever_panels_are_opened_stand_beside_the_photograph_and_apart(opened):
    view = DepthOfFieldView(panels="photograph").with_panels(dict.fromkeys(opened, True))
    assert set(view.opened) == set(opened)
    tiles = view.figure(draft=True).tiles
    assert len(tiles) == 1 + len(opened)
    for (x, y, width, height), (u, v, across, high) in combinations([tile.cell for tile in tiles], 2):
        assert x + width <= u or u + across <= x or y + height <= v or v + high <= y
    assert all(tile.cell[0] + tile.cell[2] <= 960 for tile in tiles)


def test_a_function_that_is_not_written_yet_keeps_its_place_grey():
    def blur(f, N, s, u):
        """Not yet."""

    view = DepthOfFieldView(panels="photograph blur", yours=blur)
    body = view.figure(draft=True).body
    assert "awaited" in body
    assert "yours appears here" in body
    assert "awaited" not in view.but(yours=by_a_reader).figure(draft=True).body


def test_at_dusk_each_lamp_in_focus_is_as_large_in_the_picture():
    camera = DepthOfFieldView.at_dusk(focus_m=4.5).lens.camera
    squares = [one for one in garden_at_dusk().surfaces if one.name == "garland"]
    sides = np.array([np.ptp(camera.project(one.corners)[:, 0]) for one in squares]).reshape(-1, 2)
    np.testing.assert_allclose(sides / [1, 2**0.5], sides[0, 0], rtol=1e-3)  # every other one stands on its corner
    assert 4 < sides[0, 0] < 8


def test_at_dusk_the_picture_is_dark_but_for_its_lamps():
    day, dusk = (DepthOfFieldView.at_dusk(focus_m=7.4, dusk=dusk).image(32).astype(float) for dusk in (False, True))
    assert np.median(dusk) < 0.6 * np.median(day)
    assert (dusk.max(axis=-1) == 255).sum() > 300


def test_a_reader_who_is_to_predict_diffraction_is_shown_none():
    quiet = DepthOfFieldView(diffraction=False)
    assert "Airy" not in quiet.description()
    assert "Airy" not in quiet.figure(draft=True).body
    assert "Airy" in DepthOfFieldView().figure(draft=True).body


def test_the_description_states_the_state():
    words = DepthOfFieldView(focal_mm=85, f_number=2.8, focus_m=1.5, covered="left half").description()
    for part in ("85 mm", "f/2.8", "focused at 1.50 m", "full frame", "covered: left half", "50 % of a correct"):
        assert part in words


def test_covering_half_the_lens_dims_the_picture_and_crops_nothing():
    whole, half = (DepthOfFieldView(f_number=4, covered=c).image(128) for c in ("nothing", "upper half"))
    linear = [aperture_light.astype(float) for aperture_light in (whole, half)]
    assert half.mean() < 0.8 * whole.mean()
    corners = np.s_[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert (linear[1][corners] > 0.5 * linear[0][corners]).all()  # sRGB bytes: half the light is 0.73 of the byte


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


def test_with_the_camera_still_a_longer_lens_only_enlarges():
    short, long = DepthOfFieldView(focal_mm=30), DepthOfFieldView(focal_mm=90)
    points = np.array([[0.68, 0.36, 3.3], [1.42, 0.67, 4.7], [-0.07, -0.18, 6.47]])
    middle = np.array([159.5, 119.5])
    ratio = (long.lens.camera.project(points) - middle) / (short.lens.camera.project(points) - middle)
    np.testing.assert_allclose(ratio, long.lens.image_mm / short.lens.image_mm, rtol=1e-9)


def test_holding_the_diameter_changes_the_f_number_and_the_other_way_round():
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
    view = DepthOfFieldView(f_number=1.4, focus_m=1.5)
    exact = to_display(aperture.photograph(garden_with_lamps(), view.lens, 64))
    assert cv2.PSNR(view.image(64), exact) > 34


@pytest.mark.thorough
@pytest.mark.parametrize(
    "state",
    [
        pytest.param({}, marks=pytest.mark.thorough),
        pytest.param({"f_number": 16.0}, marks=pytest.mark.thorough),
        {"focal_mm": 100.0, "f_number": 1.4, "focus_m": 1.2},
        pytest.param({"focus_m": 0.8}, marks=pytest.mark.thorough),
        {"aperture": "heart", "covered": "upper half"},
    ],
    ids=repr,
)
def test_the_photograph_takes_as_many_points_of_the_lens_as_its_blur_needs(state):
    view = DepthOfFieldView(**state)
    many = view.image(1024)
    assert cv2.PSNR(view.image(), many) > 45  # with at most a quarter of the points: no eye tells the two apart
    assert cv2.PSNR(view.image(rough=True), view.image(64, rough=True)) > 34


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


@pytest.mark.parametrize(("bad", "word"), [
    ({"focal_mm": 0}, "focal_mm"), ({"f_number": -2}, "f_number"), ({"focus_m": 0.04}, "beyond the focal length"),
    ({"sensor": "large"}, "sensor"), ({"aperture": "star"}, "aperture"), ({"match_exposure": 1}, "match_exposure"),
])  # fmt: skip
def test_a_state_that_makes_no_sense_is_refused_by_name(bad, word):
    with pytest.raises(ValueError, match=word):
        DepthOfFieldView(**bad)


@pytest.mark.parametrize("lens", ["triplet", "telephoto"])
def test_a_lens_cut_open_sends_its_rays_where_a_thin_lens_between_its_planes_would(lens):
    view = LensElementsView(lens=lens, image_mm=8.0)
    end = view.prescription.length_mm + view.prescription.back_focal_mm
    z, y = view.prescription.trace(view.heights_mm, 8.0 / view.prescription.focal_mm)
    np.testing.assert_allclose(y[-1], 8.0)
    assert z[-1] == pytest.approx(end)
    for ray in np.stack([np.broadcast_to(z[:, None], y.shape), y], axis=-1).swapaxes(0, 1):
        at_first = ray[0, 1] + 8.0 / view.prescription.focal_mm * view.prescription.front_principal_mm
        assert view._bent(ray) == pytest.approx(at_first)


@pytest.mark.parametrize("lens", ["triplet", "telephoto"])
def test_the_highest_image_is_inside_the_section(lens):
    height = LensElementsView.controls()["image_mm"].high
    view = LensElementsView(lens=lens, image_mm=height)
    panel = view._panel
    x, y = panel.place((view.prescription.length_mm + view.prescription.back_focal_mm, height))
    assert 0 < x < panel.width
    assert 0 < y < panel.height


@pytest.mark.parametrize(("name", "value"), [("lens", "telephoto"), ("opening", 0.1), ("image_mm", 15.0)])
def test_every_control_of_the_lens_cut_open_changes_it(name, value):
    assert LensElementsView(**{name: value}).figure().body != LensElementsView().figure().body
    assert "50.0 mm" in LensElementsView().description()
    with pytest.raises(ValueError, match="opening"):
        LensElementsView(opening=0)


def test_a_sheet_of_four_pixels_is_a_picture_too():
    """OpenCV takes four numbers in a column for a colour; at this focal length a lamp's sheet has just so many."""
    view = DepthOfFieldView(f_number=1.4, focus_m=1.3, focal_mm=60.0, panels="photograph blur")
    assert view.figure().photographs["lens"]
