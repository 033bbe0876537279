"""The light field visualizer shows true numbers and true pictures."""

import re

import cv2
import numpy as np
import pytest
from scipy import ndimage

from camviz.draw.marks import Lines
from camviz.lightfields import LightField
from camviz.scenes import to_display, to_linear
from camviz_school.course.exercises import exercises
from camviz_school.views import garden_field
from camviz_school.views.light_field import LightFieldView
from camviz_school.views.microlens_diagram import _FILM, _LENS_X, _PITCH, _PLACE, drawn

GLOBE, BALL, PICTURE = (118, 48), (78, 98), (84, 33)  # columns and rows of the middle view


def at(place, **state):
    return LightFieldView(column=place[0], row=place[1], **state)


def small(rows=3, columns=3, **known):
    views = np.random.default_rng(0).integers(0, 255, (rows, columns, 24, 32, 3), dtype=np.uint8)
    return LightField(views, **known)


@pytest.mark.parametrize("place", [GLOBE, BALL, PICTURE])
def test_the_slope_measured_at_the_mark_is_the_one_traced(place):
    """To 0.05 px a view."""
    view = at(place)
    assert view.slope_here == pytest.approx(garden_field.true_slopes()[place[1], place[0]], abs=0.05)


def test_the_garden_s_slopes_are_true_for_most_pixels():
    """Seven in ten within 0.1 px; the others are rims, where half of the views see what is behind, and plain sky."""
    apart = np.abs(LightFieldView().slopes - garden_field.true_slopes())
    assert np.median(apart) < 0.03
    assert (apart < 0.1).mean() > 0.65


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


@pytest.mark.thorough
def test_openings_blur_a_view_by_its_slope_and_leave_what_is_in_focus():
    pinholes, wide = (
        LightFieldView(column=BALL[0], row=BALL[1]),
        LightFieldView(column=BALL[0], row=BALL[1], opening=1.0),
    )
    assert pinholes.numbers()["a view blurs"] == "0.00 px at the mark"
    assert wide.numbers()["a view blurs"] == f"{abs(wide.slope_here):.2f} px at the mark"
    assert wide.but(opening=0.5).numbers()["a view blurs"] == f"{abs(wide.slope_here) / 2:.2f} px at the mark"
    assert wide.slope_here == pinholes.slope_here
    fence = LightFieldView(fence=True, slope=3.25)
    soft = fence.but(opening=1.0)
    sharp, blurred = (cv2.Sobel(one.image()[..., 1].astype(float), -1, 1, 0)[20:40, 40:120] for one in (fence, soft))
    assert np.abs(sharp).mean() > 1.15 * np.abs(blurred).mean()


@pytest.mark.thorough
def test_the_band_of_exact_refocusing_is_drawn_where_it_ends():
    """|d| ≤ 1 px with openings that fill the lens, 2 px with openings half as wide; pinholes have no end."""
    assert "exact" not in LightFieldView().figure(draft=True).body
    view = LightFieldView(opening=1.0)
    assert "exact: |d| ≤ 1 px" in view.figure(draft=True).body
    for width, ends in ((1.0, 1.0), (0.5, 2.0)):
        left, right = (view._plot.place((end, 5.0))[0] for end in (-ends, ends))
        band = view.but(opening=width)._exact_range()
        x, wide = (float(re.search(rf' {name}="([\d.]+)"', band)[1]) for name in ("x", "width"))
        assert (x, wide) == pytest.approx((left, right - left), abs=0.01)
    assert LightFieldView(opening=0.25)._exact_range() == ""


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


def test_rays_in_the_diagram_meet_at_the_film_of_their_own_slope():
    """Through the place j they arrive d j microlenses from the axis: there the line ends where 1 − d p/b says."""
    slope = 0.7
    lens, hit = 4 * _PLACE, 4 * slope * _PITCH
    meets = _LENS_X + _FILM * lens / (lens - hit)
    marks = drawn(0, 0, slope, slope, np.ones(9), 4).walk()
    lines = [line for mark in marks if isinstance(mark, Lines) for line in mark.lines]
    assert any(line[0] == pytest.approx((meets, 0.0), abs=0.05) for line in lines), "the film"
    assert any(line[-1] == pytest.approx((_LENS_X + _FILM, 82.5 + hit), abs=0.05) for line in lines), "a ray"


@pytest.mark.parametrize("name", LightFieldView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = LightFieldView.controls()[name]
    base = LightFieldView(slope=0.5)
    ends = control.choices or ((control.low, control.high) if control.low is not None else (True, False))
    pictures = [base.but(**{name: end}).figure(draft=True) for end in (*ends, getattr(base, name))]
    looks = {(one.body, tuple(one.photographs.values())) for one in pictures}
    assert len(looks) == len({*ends, getattr(base, name)})


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
    assert "attached:picture" in view.figure(draft=True).body


@pytest.mark.parametrize(
    "bad", [{"slope": np.nan}, {"aperture": "star"}, {"u": 9}, {"row": -1}, {"column": 3.5}, {"fence": 1}]
)
def test_a_state_that_makes_no_sense_is_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        LightFieldView(**bad)


def test_the_description_states_the_state():
    words = LightFieldView(slope=1.04, fence=True).figure(draft=True).description
    assert "slope +1.04 px" in words
    assert "behind a fence" in words
    assert "3.03" in words


def test_the_sky_is_infinitely_far_away_and_not_as_far_as_its_slope_is_rounded():
    assert LightFieldView(column=159).numbers()["in truth"].endswith(" px, ∞")


WITH_YOURS = "picture yours slice depth"


def test_a_right_function_of_the_reader_s_makes_the_same_picture():
    right = exercises("11")["11.disparity"].reference
    for slope in (-3.0, 0.0, 1.04, 3.4):
        attached = LightFieldView(panels=WITH_YOURS, yours=right, slope=slope).figure().photographs
        assert attached["yours"] == attached["picture"]


def test_a_wrong_one_makes_another_and_none_leaves_a_sentence():
    for known in exercises("11")["11.disparity"].misconceptions:
        picture = LightFieldView(panels=WITH_YOURS, yours=known.function, slope=-1.24).figure(draft=True)
        assert picture.photographs.get("yours") != picture.photographs["picture"], known.explanation
    picture = LightFieldView(panels=WITH_YOURS, yours=lambda z, b, f, z_f: None).figure(draft=True)
    assert "yours appears here" in picture.body
    assert "awaited" in picture.body  # the right picture, greyed
    assert "yours" not in picture.photographs
    picture = LightFieldView(panels=WITH_YOURS, yours=lambda z, b, f, z_f: 1 / 0).figure(draft=True)
    assert "ZeroDivisionError" in picture.body


def test_few_panels_tell_only_their_own_figures():
    one, views, slice_ = (
        LightFieldView(panels=panels).figure(draft=True) for panels in ("picture", "picture views", "picture slice")
    )
    assert "slope at" not in one.description + views.description
    assert "sensor" not in one.description + slice_.description
    assert "sensor" in views.description
    assert "in truth" in slice_.description
    assert {*one.photographs} == {"picture"}
    assert "slice" not in views.photographs


def test_the_picture_says_how_far_away_it_is_sharp():
    assert "Focused at 2.001 m" in LightFieldView(slope=3.25, panels="picture").figure(draft=True).body
    unknown = LightFieldView.of(small(1, 3)).but(panels="picture").figure(draft=True).body
    assert "Focused at" not in unknown


@pytest.mark.parametrize("name", LightFieldView.openable)
def test_buttons_open_each_panel_beside_the_picture(name):
    opened = LightFieldView(panels="picture").with_panels({name: True})
    assert opened.opened == (name,)
    assert [tile.name for tile in opened.figure(draft=True).tiles] == ["picture", name]


@pytest.mark.parametrize("bad", ["", "views", "picture fence"])
def test_panels_that_there_are_not_are_refused(bad):
    with pytest.raises(ValueError, match="panels must be picture and any of yours, views, slice"):
        LightFieldView(panels=bad)
