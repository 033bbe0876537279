"""The fisheye visualizer shows true numbers and a window that is truly cut out of its picture."""

import cv2
import numpy as np
import pytest

from camviz.scenes import snapshot, textured_scene
from camviz_school.course.exercises import exercises
from camviz_school.views.fisheye import FisheyeView


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
    degrees = [view.numbers()[f"pixels a degree, {at}°"] for at in (0, 80)]
    assert (degrees[0] == degrees[1] == f"{150 * np.pi / 180:.2f}") is (projection == "equidistant")


@pytest.mark.parametrize(("projection", "across"), [("equidistant", "183°"), ("stereographic", "155°")])
def test_the_field_is_that_of_the_picture_s_edges(projection, across):
    """240 px from the middle at f = 150 px: 2 · 1.6 rad, and 4 atan 0.8."""
    assert FisheyeView(projection=projection, f=150.0).numbers()["across the picture"] == across


@pytest.mark.parametrize("draft", [True, False])
def test_the_window_is_what_a_perspective_camera_would_take(draft):
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
    at_the_rim = FisheyeView(projection="orthographic", f=150.0, yaw_deg=60.0, pitch_deg=0.0)
    assert at_the_rim.dragged("window", 0, 0, 300, 0) == at_the_rim  # not out of the picture


WITH_YOURS = "picture window curves yours"


def shown(view, name, draft):
    return cv2.imdecode(np.frombuffer(view.figure(draft=draft).photographs[name], np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize("draft", [True, False])
@pytest.mark.parametrize("yaw", [35.0, 100.0])
def test_a_right_function_cuts_the_same_window(draft, yaw):
    right = exercises("09")["09.equidistant"].reference
    view = FisheyeView(panels=WITH_YOURS, yours=right, yaw_deg=yaw)
    apart = np.abs(shown(view, "window", draft).astype(int) - shown(view, "yours", draft)).max(axis=-1)
    assert np.mean(apart > 30) < 0.02  # but for the rim of the round picture
    curves = view.but(panels="picture curves").figure(draft=True).marks.panels()["curves"].marks
    theirs, yours = (curves.of(style)[0].lines[0] for style in ("blue thick", "orange dashed thick"))
    np.testing.assert_allclose(yours, theirs[1:-1], atol=1e-6)  # the reader's curve lies on the right one


def test_a_wrong_function_cuts_another_window():
    exercise = exercises("09")["09.equidistant"]
    for known in exercise.misconceptions:
        if known.function.__name__ in ("principal_point_swapped", "arc_cosine_of_z_itself"):
            continue  # the picture's middle has cx = cy, and a window's rays have length 1
        view = FisheyeView(panels=WITH_YOURS, yours=known.function, yaw_deg=75.0)
        apart = np.abs(shown(view, "window", True).astype(int) - shown(view, "yours", True)).max(axis=-1)
        assert np.mean(apart > 30) > 0.02, known.explanation


@pytest.mark.parametrize("f", [75.0, 140.0, 160.0])
def test_the_circle_at_90_degrees_has_the_radius_of_its_lens(f):
    """Its radius is f π/2 for an equidistant lens, and f for an orthographic one; a perspective one has none."""
    radii = {"equidistant": f * np.pi / 2, "orthographic": f, "stereographic": 2 * f, "perspective": np.inf}
    for name, radius in radii.items():
        view = FisheyeView(f=f, panels="picture", projection=name)
        ring = view.figure(draft=True).marks.panels()["fisheye"].marks.points("yellow dashed")
        assert (len(ring) > 0) == (radius < 239.5)
        for place in ring:
            assert np.linalg.norm(np.subtract(view._panel.data(place), 239.5)) == pytest.approx(radius)
