"""The light field visualizer shows true numbers and true pictures."""

import cv2
import numpy as np
import pytest
from scipy import ndimage

from camviz.lightfields import LightField
from camviz.scenes import to_display, to_linear
from camviz_school.course.exercises import exercises
from camviz_school.views import garden_field
from camviz_school.views.light_field import LightFieldView
from camviz_school.views.microlens_diagram import _FILM, _LENS_X, _PITCH, _PLACE, drawn

GLOBE, BALL, PICTURE = (118, 48), (78, 98), (84, 33)  # columns and rows of the middle view


def small(rows=3, columns=3, **known):
    views = np.random.default_rng(0).integers(0, 255, (rows, columns, 24, 32, 3), dtype=np.uint8)
    return LightField(views, **known)


def test_the_gardens_slopes_are_true_for_most_pixels():
    """To 0.05 px a view at the marks. Seven in ten within 0.1 px; the others are rims and sky."""
    apart = np.abs(LightFieldView().slopes - garden_field.true_slopes())
    assert np.median(apart) < 0.03
    assert (apart < 0.1).mean() > 0.65
    for place in (GLOBE, BALL, PICTURE):
        true = garden_field.true_slopes()[place[1], place[0]]
        assert LightFieldView(column=place[0], row=place[1]).slope_here == pytest.approx(true, abs=0.05)


@pytest.mark.parametrize("place", [GLOBE, BALL, PICTURE])
def test_a_click_brings_what_is_there_into_focus(place):
    """The slope becomes that of the place, and the picture there as sharp as the middle view's, within a quarter."""
    view = LightFieldView()
    panel = view._image_panel
    x, y = panel.place(place) + (panel.x, panel.y)
    clicked = view.dragged("focus", x, y, 0, 0)
    assert (clicked.column, clicked.row) == place
    assert clicked.slope == pytest.approx(garden_field.true_slopes()[place[1], place[0]], abs=0.06)
    assert _sharpness(clicked.image(), place) > 0.5 * _sharpness(view.light_field.views[4, 4], place)
    away = clicked.but(slope=clicked.slope - 2 if clicked.slope > 0 else clicked.slope + 2)
    assert _sharpness(clicked.image(), place) > 2 * _sharpness(away.image(), place)


def _sharpness(picture, place):
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(float)
    u, v = place
    return np.hypot(cv2.Sobel(grey, -1, 1, 0), cv2.Sobel(grey, -1, 0, 1))[v - 7 : v + 8, u - 7 : u + 8].mean()


def test_the_picture_is_what_scipy_shifts_and_numpy_sums():
    view = LightFieldView(slope=0.7, aperture="half")
    views = to_linear(garden_field.garden_field().views)
    total = [
        ndimage.shift(np.float64(views[v, u]), (0.7 * (v - 4), 0.7 * (u - 4), 0), order=1, mode="nearest")
        for v, u in np.ndindex(9, 5)
    ]
    np.testing.assert_allclose(view.image().astype(int), to_display(np.mean(total, axis=0)).astype(int), atol=1)


def test_the_band_of_exact_refocusing_is_drawn_where_it_ends():
    """|d| ≤ 1 px with openings that fill the lens, 2 px with openings half as wide; pinholes have no end."""
    view = LightFieldView()
    for opening, end in ((1.0, 1.0), (0.5, 2.0)):
        marks = view.but(opening=opening).figure(draft=True).marks.panels()["depth"].marks
        (band,) = marks.of("wash fill-green")
        ends = [view._plot.data((x, 0))[0] for x in (band.x, band.x + band.width)]
        assert ends == pytest.approx([-end, end])
    for opening in (0.0, 0.25):
        assert view.but(opening=opening).figure(draft=True).marks.panels()["depth"].marks.of("wash fill-green") == []


def test_a_fence_out_of_focus_vanishes():
    """Behind it the summed picture is 6 dB nearer to that without a fence than a single view is."""
    fenced, clear = LightFieldView(fence=True, slope=1.0), LightFieldView(slope=1.0)
    one = [view.but(aperture="pinhole").image() for view in (fenced, clear)]
    assert cv2.PSNR(fenced.image(), clear.image()) > cv2.PSNR(*one) + 6


def test_one_view_is_the_view_chosen():
    view = LightFieldView(slope=0.0, aperture="pinhole", u=1, v=7)
    np.testing.assert_array_equal(view.image(), garden_field.garden_field().views[7, 1])


def test_the_numbers_are_those_of_the_thin_lens():
    """1/z = 1/4 + d / (b f); α = image distance over that of the sensor, by 1/f = 1/z + 1/v."""
    numbers = LightFieldView(slope=2.0).numbers()
    bf = 0.056 * 80 / np.tan(np.radians(19))
    depth = 1 / (1 / 4 + 2 / bf)
    assert numbers["focused at"] == f"{depth:.3f} m"
    sensor = 80 / np.tan(np.radians(19)) * 0.002
    f = 1 / (1 / 4 + 1 / sensor)
    assert numbers["α"] == f"{1 / (1 / f - 1 / depth) / sensor:.3f}"
    assert numbers["sensor"] == "1440 × 1080 px"
    assert numbers["each picture"] == "160 × 120 px"
    assert LightFieldView(aperture="half").numbers()["views summed"] == "45 of 81"
    assert LightFieldView(column=159).numbers()["in truth"].endswith(" px, ∞")  # the sky
    ball = LightFieldView(column=BALL[0], row=BALL[1], opening=0.5)
    assert ball.numbers()["a view blurs"] == f"{abs(ball.slope_here) / 2:.2f} px at the mark"


def test_rays_in_the_diagram_meet_at_the_film_of_their_own_slope():
    """Through the place j they arrive d j microlenses from the axis: there the line ends where 1 − d p/b says."""
    slope = 0.7
    lens, hit = 4 * _PLACE, 4 * slope * _PITCH
    meets = _LENS_X + _FILM * lens / (lens - hit)
    marks = drawn(0, 0, slope, slope, np.ones(9), 8)
    *_, onward = marks.points("purple thick dotted")
    middle = onward[1]
    ray = marks.points("purple thick")[-4:-1]
    np.testing.assert_allclose(onward, (meets, middle))
    np.testing.assert_allclose(marks.points("red dashed")[:, 0], meets)  # the film
    np.testing.assert_allclose(ray[1:], [(_LENS_X, middle + lens), (_LENS_X + _FILM, middle + hit)])


def test_the_row_and_the_view_follow_the_pointer_and_the_keys():
    view = LightFieldView()
    panel = view._image_panel
    moved = view.dragged("row", panel.x + 5, panel.y + panel.place((0, 100))[1], 0, 0)
    assert (moved.row, moved.column, moved.slope) == (100, view.column, view.slope)
    assert view.pressed("row", "ArrowDown").row > view.row
    assert view.pressed("focus", "ArrowLeft").column < view.column
    views = view._mosaic_panel
    assert (view.dragged("viewpoint", views.x + 2, views.y + views.height - 2, 0, 0).u) == 0
    assert (view.dragged("viewpoint", views.x + 2, views.y + views.height - 2, 0, 0).v) == 8
    assert view.pressed("viewpoint", "ArrowRight").u == 5
    assert view.dragged("slope", 0, 0, 1e6, 0).slope == LightFieldView.controls()["slope"].high
    assert view.pressed("slope", "-").slope < view.slope


def test_a_field_of_one_s_own_is_shown_with_its_own_ranges():
    view = LightFieldView.of(small(1, 2))
    assert view.offered()["u"].high == 1
    assert view.offered()["row"].high == 23
    assert not {"fence", "opening"} & view.offered().keys()
    assert view.numbers()["focused at"] == "none"  # nothing is known of its cameras


WITH_YOURS = "picture yours slice depth"


def test_a_right_function_makes_the_same_picture_and_curve():
    right = exercises("11")["11.disparity"].reference
    for slope in (-3.0, 0.0, 1.04, 3.4):
        attached = LightFieldView(panels="picture yours", yours=right, slope=slope).figure().photographs
        assert attached["yours"] == attached["picture"]
    view = LightFieldView(panels="picture depth", yours=right)
    own = view.figure(draft=True).marks.panels()["depth"].marks.of("orange thick dashed")[0].lines[0]
    slope, depth = np.array([view._plot.data(place) for place in own]).T
    np.testing.assert_allclose(view.light_field.depth(slope), depth, rtol=1e-6)


def test_a_wrong_function_makes_another_picture():
    for known in exercises("11")["11.disparity"].misconceptions:
        picture = LightFieldView(panels="picture yours", yours=known.function, slope=-1.24).figure(draft=True)
        assert picture.photographs.get("yours") != picture.photographs["picture"], known.explanation
