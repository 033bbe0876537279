"""The frustum visualizer: where the camera stands is what its numbers say."""

import cv2
import numpy as np
import pytest
from every_view import written

from camviz.cameras import Camera, Intrinsics
from camviz.draw.marks import Discs
from camviz.lenses import BrownConrady
from camviz.scenes import board_corners
from camviz.views.frustum import SUBJECT, FrustumView


@pytest.fixture(autouse=True)
def _wire(monkeypatch):
    monkeypatch.setenv("CAMVIZ_RENDERER", "wire")


def test_each_mode_keeps_what_it_is_named_for():
    """C = -Rᵀ t: with t fixed, a turn by 90° about y takes C = (0, 0, -2) to (-2, 0, 0)."""
    by_t = FrustumView(mode="edit t", x=0.0, y=0.0, z=2.0, yaw_deg=0.0, pitch_deg=0.0)
    np.testing.assert_allclose(by_t.camera.centre, (0, 0, -2), atol=1e-12)
    np.testing.assert_allclose(by_t.but(yaw_deg=90.0).camera.centre, (-2, 0, 0), atol=1e-12)
    np.testing.assert_allclose(by_t.but(yaw_deg=33.0).numbers()["t"], (0, 0, 2), atol=1e-12)
    by_c = FrustumView(mode="edit C", x=0.5, y=-0.2, z=-1.0)
    np.testing.assert_allclose(by_c.but(yaw_deg=70.0, roll_deg=20.0).camera.centre, (0.5, -0.2, -1), atol=1e-12)
    orbit = FrustumView(mode="orbit", x=0.0, y=0.0, z=3.0)
    for yaw, pitch in ((0.0, 0.0), (80.0, -30.0), (-150.0, 60.0)):
        camera = orbit.but(yaw_deg=yaw, pitch_deg=pitch).camera
        np.testing.assert_allclose(camera.project(SUBJECT), (319.5, 239.5), atol=1e-9)
        assert np.linalg.norm(camera.centre - SUBJECT) == pytest.approx(3)


@pytest.mark.parametrize("before", ["edit C", "edit t", "orbit"])
@pytest.mark.parametrize("after", ["edit C", "edit t", "orbit"])
def test_changing_the_mode_moves_nothing(before, after):
    view = FrustumView(mode=before, x=0.4, y=-0.3, z=0.8, yaw_deg=25.0, pitch_deg=-10.0, roll_deg=5.0)
    poses = [one.camera.world_from_cam.as_matrix() for one in (view, view.but(mode=after))]
    np.testing.assert_allclose(poses[1], poses[0], atol=1e-8)


def test_the_board_is_drawn_where_opencv_projects_it():
    view = FrustumView(mode="edit t", x=0.3, y=0.1, z=0.7, yaw_deg=-12.0, pitch_deg=5.0, roll_deg=8.0, hfov_deg=70.0)
    n = view.numbers()
    np.testing.assert_allclose(n["C"], -n["R"].T @ n["t"], atol=1e-12)
    uv, _ = cv2.projectPoints(board_corners(), cv2.Rodrigues(n["R"])[0], n["t"], n["K"], None)
    panel = view.figure(draft=True).marks.panels()["picture"]
    places = (uv.reshape(-1, 2) + 0.5) * (panel.width / 640, panel.height / 480)
    np.testing.assert_allclose(panel.marks.points("red"), places, atol=1e-6)


def test_yaw_looks_right_pitch_up_and_roll_is_clockwise():
    level = FrustumView(yaw_deg=0.0, pitch_deg=0.0, roll_deg=0.0)
    for angle, towards in (("yaw_deg", (1, 0, 0)), ("pitch_deg", (0, -1, 0)), ("roll_deg", (0, 0, 0))):
        forward = level.but(**{angle: 10.0}).numbers()["R"][2]
        np.testing.assert_allclose(forward, np.array(towards) * np.sin(np.radians(10)) + (0, 0, forward[2]), atol=1e-12)
    assert level.but(roll_deg=10.0).numbers()["R"][0][1] > 0  # its right side sinks
    down = FrustumView(pitch_deg=-90.0, yaw_deg=45.0, roll_deg=-30.0)
    np.testing.assert_allclose(down.numbers()["R"][2], (0, 1, 0), atol=1e-12)
    down.figure(draft=True)


def test_the_field_of_view_is_the_pinholes():
    view = FrustumView(hfov_deg=90.0)
    left, right = view.camera.unproject([(-0.5, 239.5), (639.5, 239.5)])
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(90)
    for degrees in (-5.0, 0.0, 180.0, 500.0, 1000.0):  # tan 250° is positive: 500° would be drawn as if it were 140°
        with pytest.raises(ValueError, match="field of view, must lie between 0 and 180"):
            FrustumView(hfov_deg=degrees)


def test_a_given_camera_keeps_its_lens_and_its_pixels_shape():
    given = Camera(Intrinsics(1280, 720, 900, 600, 610, 350, 2.0), BrownConrady(k1=-0.2))
    view = FrustumView.of(given)
    assert (view.camera.intrinsics, view.camera.lens) == (given.intrinsics, given.lens)
    k = view.but(hfov_deg=30.0).camera.intrinsics
    assert k.fx / k.fy == pytest.approx(1.5)
    assert 2 * np.degrees(np.arctan(640 / k.fx)) == pytest.approx(30)


def test_hands_turn_the_camera_or_the_viewpoint():
    view = FrustumView()
    before, after = (one.camera.project(board_corners()[20]) for one in (view, view.dragged("picture", 0, 0, 15, -10)))
    assert after[0] > before[0] + 5
    assert after[1] < before[1] - 5
    assert view.pressed("picture", "ArrowRight").yaw_deg > view.yaw_deg
    assert view.pressed("picture", "ArrowUp").pitch_deg > view.pitch_deg
    assert view.pressed("picture", "+").hfov_deg < view.hfov_deg
    assert view.pressed("picture", "q") == view
    walked = view.dragged("eye", 0, 0, 30, 10)
    assert walked.eye == view.eye.orbited(30, 10)
    np.testing.assert_array_equal(walked.numbers()["R"], view.numbers()["R"])


def test_the_camera_view_stands_still_while_the_camera_moves():
    """Seen from the camera's frame its own triad is drawn at the same place, wherever it goes."""

    def centre(view):
        (text,) = [text for text in view.figure(draft=True).marks.texts() if text.words == "C"]
        return round(text.x, 6), round(text.y, 6)

    for seen_from, still in (("camera view", True), ("world view", False)):
        views = [FrustumView(x=x, yaw_deg=yaw, seen_from=seen_from) for x, yaw in ((0.0, 0.0), (2.0, 40.0))]
        assert (centre(views[0]) == centre(views[1])) == still
    for there in ({"x": 6.0}, {"x": -6.0}, {"y": 6.0}, {}):  # an arrow leads to a camera that is out of sight
        view = FrustumView(panels="world", **there)
        assert ("the camera is this way" in written(view.figure(draft=True))) == bool(there)
        assert "the camera is this way" not in written(view.but(seen_from="camera view").figure(draft=True))


def test_the_corners_in_view_are_counted():
    assert "sees 54 of the board's 54" in FrustumView().description()
    away = FrustumView(yaw_deg=180.0)
    assert "sees 0 of the board's 54" in away.description()
    assert len(away.figure(draft=True).marks.panels()["picture"].marks.points("red")) == 0


# The reader's own centre ---------------------------------------------------------------------------------------------


def test_the_readers_camera_stands_where_their_function_says():
    view = FrustumView(mode="edit t", x=0.2, y=0.0, z=1.0, yaw_deg=30.0, pitch_deg=0.0, yours=lambda R, t: -R.T @ t)
    np.testing.assert_allclose(view._your_camera.centre, view.camera.centre, atol=1e-12)
    panel = FrustumView(yours=lambda R, t: -R.T @ t).figure(draft=True).marks.panels()["picture"].marks
    (dots,) = [mark for mark in panel.of("orange") if isinstance(mark, Discs)]
    np.testing.assert_allclose(dots.points, panel.points("red"), atol=1e-9)
    wrong = view.but(yours=lambda R, t: -t)
    np.testing.assert_allclose(wrong._your_camera.centre, (-0.2, 0, -1))
    away = np.linalg.norm(wrong.camera.centre - (-0.2, 0, -1))
    assert f"{away:.2f} m from the camera" in written(wrong.figure(draft=True))
    with pytest.raises(ValueError, match="must have the world"):
        FrustumView(panels="picture", yours=lambda R, t: t)


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda R, t: np.eye(3), "answers in shape"),
        (lambda R, t: t / 0, "not all finite"),
        (lambda R, t: undefined, "NameError"),  # noqa: F821
    ],
)
def test_a_function_without_a_centre_puts_no_camera_there(function, sentence):
    with np.errstate(divide="ignore", invalid="ignore"):
        picture = FrustumView(yours=function).figure(draft=True)
    assert sentence in written(picture)
    assert "yours" not in [text.words for text in picture.marks.texts()]
    assert "nan" not in written(picture).replace("your centre are not all finite", "")


def test_an_unwritten_centre_is_awaited_at_the_right_one():
    waiting = FrustumView(yours=lambda R, t: None)
    (awaited,) = waiting.figure(draft=True).marks.of("awaited")
    assert awaited.marks.of("orange")
    assert not awaited.marks.texts()  # what waits is too pale to be read
    np.testing.assert_allclose(waiting._your_camera.centre, waiting.camera.centre)
    assert not waiting.but(yours=lambda R, t: -t).figure(draft=True).marks.of("awaited")


# One panel first -----------------------------------------------------------------------------------------------------


def test_the_panels_named_are_drawn_and_no_others():
    names = {"numbers": ["rotation", "position"], "K": ["intrinsics"], "point": ["one point"]}
    for panels in ("world", "picture", "picture numbers", "world K point", "world picture numbers K point"):
        wanted = [tile for panel in panels.split() for tile in names.get(panel, [panel])]
        assert [tile.name for tile in FrustumView(panels=panels).figure(draft=True).tiles] == wanted
    for panels in ("nonsense", "numbers", "", "world nonsense"):
        with pytest.raises(ValueError, match=f"got {panels!r}"):
            FrustumView(panels=panels)
    (tile,) = FrustumView.held(panels="world").figure(draft=True).tiles
    assert 1.5 * tile.cell[3] <= 495  # CSS pixels of a screen: a tile grows to half as much again


@pytest.mark.parametrize("yaw", [-60.0, 0.0, 60.0])
def test_the_axes_are_named_inside_the_picture(yaw):
    """An axis that runs straight from the eye has no name."""
    panel = FrustumView.held(panels="picture", marks="axes", yaw_deg=yaw).figure(draft=True).marks.panels()["picture"]
    names = {text.words: (text.x, text.y) for text in panel.marks.texts()}
    assert ("Z" in names) == (yaw != 0)
    assert all(0 < x < panel.width and 0 < y < panel.height for x, y in names.values())
    assert not panel.marks.of("red")
    with pytest.raises(ValueError, match="marks must be"):
        FrustumView(marks="globe")
