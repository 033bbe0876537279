"""The fisheye visualizer shows true numbers and a window that is truly cut out of its picture."""

import re

import cv2
import numpy as np
import pytest

from camviz.scenes import snapshot, textured_scene
from camviz.views.yours import YOURS_HERE
from camviz_school.course.exercises import exercises
from camviz_school.views.fisheye import EQUATIONS, LENSES, FisheyeView


@pytest.mark.parametrize(
    ("projection", "radii"),
    [
        ("stereographic", (0.535898, 1.154701, 2.0)),
        ("equidistant", (0.523599, 1.047198, 1.570796)),
        ("equisolid", (0.517638, 1.0, 1.414214)),
        ("orthographic", (0.5, 0.866025, 1.0)),
        ("perspective", (0.577350, 1.732051, np.nan)),
    ],
)
def test_radii_at_30_60_and_90_degrees_are_the_textbook_s(projection, radii):
    view = FisheyeView(projection=projection)
    np.testing.assert_allclose(view.radius(np.radians([30.0, 60.0, 90.0])), radii, atol=1e-6)
    at_90 = view.numbers()["a ray at 90° lands at"]
    assert at_90 == (f"r = {150 * radii[-1]:.0f} px" if np.isfinite(radii[-1]) else "nowhere: tan 90° = ∞")
    assert at_90 in view.figure(draft=True).body


def test_only_the_perspective_lens_loses_a_ray_at_90_degrees():
    lost = [name for name in LENSES if "nowhere" in FisheyeView(projection=name).numbers()["a ray at 90° lands at"]]
    assert lost == ["perspective"]


@pytest.mark.parametrize(("projection", "across"), [("equidistant", "183°"), ("stereographic", "155°")])
def test_the_field_is_that_of_the_picture_s_edges(projection, across):
    """240 px from the middle at f = 150 px: 2 · 1.6 rad, and 4 atan 0.8."""
    assert FisheyeView(projection=projection, f=150.0).numbers()["across the picture"] == across


def test_an_equidistant_lens_gives_every_degree_as_many_pixels():
    numbers = FisheyeView(f=150.0).numbers()
    assert numbers["pixels a degree, 0°"] == numbers["pixels a degree, 80°"] == f"{150 * np.pi / 180:.2f}"


@pytest.mark.parametrize("draft", [True, False])
def test_the_window_shows_what_a_perspective_camera_there_would_photograph(draft):
    view = FisheyeView(yaw_deg=20.0, pitch_deg=-5.0, hfov_deg=70.0)
    data = np.frombuffer(view.figure(draft=draft).photographs["window"], np.uint8)
    cut = cv2.resize(cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1], (320, 240))
    truth = snapshot(textured_scene(), view.window)
    soft = [cv2.GaussianBlur(picture, (0, 0), 4).astype(float).ravel() for picture in (cut, truth)]
    assert np.corrcoef(*soft)[0, 1] > 0.98


@pytest.mark.parametrize("projection", ["equidistant", "stereographic", "equisolid"])
def test_a_dragged_window_follows_the_pointer(projection):
    view = FisheyeView(projection=projection, yaw_deg=10.0, pitch_deg=-10.0)
    middle = np.array([159.5, 119.5])
    before = view.camera.project(view.window.unproject(middle))
    moved = view.dragged("window", 0, 0, 30, -20)
    after = moved.camera.project(moved.window.unproject(middle))
    np.testing.assert_allclose(after - before, np.array([30, -20]) / view._panel.scale, atol=0.05)


def test_a_window_is_not_dragged_out_of_the_picture():
    view = FisheyeView(projection="orthographic", f=150.0, yaw_deg=60.0, pitch_deg=0.0)
    assert view.dragged("window", 0, 0, 300, 0) == view


def test_keys_move_the_window_zoom_it_and_walk_around_the_dome():
    view = FisheyeView(yaw_deg=0.0, pitch_deg=0.0)
    assert view.pressed("window", "ArrowRight").yaw_deg > 0
    assert view.pressed("window", "ArrowUp").pitch_deg > 0
    assert view.pressed("window", "+").hfov_deg == 75
    assert view.pressed("window", "-").hfov_deg == 85
    assert view.but(hfov_deg=20.0).pressed("window", "+").hfov_deg == 20
    assert view.pressed("eye", "ArrowLeft").eye != view.eye
    assert view.dragged("eye", 0, 0, 9, 9).yaw_deg == 0


@pytest.mark.parametrize("draft", [True, False])
def test_every_control_changes_the_picture_at_both_ends(draft):
    base = FisheyeView()
    shown = {(picture.body, picture.photographs["window"]) for picture in [base.figure(draft=draft)]}
    states = []
    for name, control in FisheyeView.controls().items():
        states += [base.but(**{name: value}) for value in control.choices[1:] or (control.low, control.high)]
    for state in states:
        picture = state.figure(draft=draft)
        shown.add((picture.body, picture.photographs["window"]))
        assert EQUATIONS[state.projection] in picture.description
        assert "nan" not in picture.body
    assert len(shown) == len(states) + 1


def drawn_points(body, style):
    """The places that the paths of a style run through, as they are written."""
    return set(
        re.findall(r"[-\d.]+,[-\d.]+", " ".join(re.findall(rf'<path[^>]*d="([^"]*)"[^>]*class="{style}"', body)))
    )


WITH_YOURS = "picture window curves yours"


def shown(view, name, draft):
    return cv2.imdecode(np.frombuffer(view.figure(draft=draft).photographs[name], np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize("draft", [True, False])
@pytest.mark.parametrize("yaw", [35.0, 100.0])
def test_a_right_function_of_the_reader_s_cuts_the_same_window(draft, yaw):
    right = exercises("09")["09.equidistant"].reference
    view = FisheyeView(panels=WITH_YOURS, yours=right, yaw_deg=yaw)
    apart = np.abs(shown(view, "window", draft).astype(int) - shown(view, "yours", draft)).max(axis=-1)
    assert np.mean(apart > 30) < 0.02  # but for the rim of the round picture
    curves = view.but(panels="picture curves").figure(draft=True).body
    theirs, yours = (drawn_points(curves, style) for style in ("blue thick", "orange dashed thick"))
    assert len(yours) > 170
    assert yours <= theirs  # the reader's curve lies on the right one


def test_a_wrong_one_cuts_another_and_none_leaves_a_sentence():
    exercise = exercises("09")["09.equidistant"]
    for known in exercise.misconceptions:
        if known.function.__name__ in ("principal_point_swapped", "arc_cosine_of_z_itself"):
            continue  # the picture's middle has cx = cy, and a window's rays have length 1
        view = FisheyeView(panels=WITH_YOURS, yours=known.function, yaw_deg=75.0)
        apart = np.abs(shown(view, "window", True).astype(int) - shown(view, "yours", True)).max(axis=-1)
        assert np.mean(apart > 30) > 0.02, known.explanation
    picture = FisheyeView(panels=WITH_YOURS, yours=lambda points, f, cx, cy: None).figure(draft=True)
    assert YOURS_HERE in picture.body
    assert "yours" not in picture.photographs
    broken = FisheyeView(panels=WITH_YOURS, yours=lambda points, f, cx, cy: points / "f").figure(draft=True)
    assert YOURS_HERE not in broken.body
    assert "gives no answer" in broken.body


def test_few_panels_tell_only_their_own_figures():
    alone, curves, window = (
        FisheyeView(panels=panels).figure(draft=True) for panels in ("picture", "picture curves", "picture window")
    )
    assert [tile.name for tile in alone.tiles] == ["picture"]
    assert "window" not in curves.photographs
    assert "window looks" not in curves.description
    assert "a ray at 90° lands at" in curves.description
    for picture in (alone, window):
        assert "a ray at 90°" not in picture.description
    for picture in (alone, curves, window):
        assert "pixels a degree" not in picture.description
    for panels in ("window", "picture dome"):
        with pytest.raises(ValueError, match="panels must be picture and any of window"):
            FisheyeView(panels=panels)


def test_every_panel_that_a_reader_opens_has_its_place_and_covers_no_other():
    view = FisheyeView(panels="picture")
    for name in FisheyeView.openable:
        view = view.with_panels({name: True})
        cells = [tile.cell for tile in view.figure(draft=True).tiles]
        assert len(cells) == len(view.panels.split())
        for i, (x, y, width, height) in enumerate(cells):
            assert x + width <= 960
            for a, b, across, down in cells[:i]:
                assert x >= a + across or a >= x + width or y >= b + down or b >= y + height


@pytest.mark.parametrize("f", [75.0, 140.0, 160.0])
def test_the_circle_at_90_degrees_is_drawn_where_the_picture_has_it(f):
    """Its radius is f π/2 for an equidistant lens, and f for an orthographic one; a perspective one has none."""
    views = {name: FisheyeView(f=f, panels="picture", projection=name) for name in LENSES}
    drawn = {name: "90°" in view.figure(draft=True).body for name, view in views.items()}
    assert drawn["equidistant"] == (f * np.pi / 2 < 239.5)
    assert drawn["orthographic"]
    assert drawn["stereographic"] == (2 * f < 239.5)
    assert not drawn["perspective"]
