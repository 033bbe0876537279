"""The frustum visualizer: where the camera stands is what its numbers say."""

import re

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.scenes import board_corners
from camviz.views.frustum import SUBJECT, FrustumView


@pytest.fixture(autouse=True)
def _wire(monkeypatch):
    monkeypatch.setenv("CAMVIZ_RENDERER", "wire")


def test_with_t_held_turning_the_camera_moves_it():
    """C = -Rᵀ t: a turn by 90° about y takes C = (0, 0, -2) to (-2, 0, 0)."""
    view = FrustumView(mode="edit t", x=0.0, y=0.0, z=2.0, yaw_deg=0.0, pitch_deg=0.0)
    np.testing.assert_allclose(view.camera.centre, (0, 0, -2), atol=1e-12)
    np.testing.assert_allclose(view.but(yaw_deg=90.0).camera.centre, (-2, 0, 0), atol=1e-12)
    np.testing.assert_allclose(view.but(yaw_deg=33.0).numbers()["t"], (0, 0, 2), atol=1e-12)


def test_with_c_held_turning_the_camera_leaves_it_where_it_is():
    view = FrustumView(mode="edit C", x=0.5, y=-0.2, z=-1.0)
    np.testing.assert_allclose(view.but(yaw_deg=70.0, roll_deg=20.0).camera.centre, (0.5, -0.2, -1), atol=1e-12)


def test_in_orbit_the_subject_stays_where_it_is_in_the_picture():
    view = FrustumView(mode="orbit", x=0.0, y=0.0, z=3.0)
    for yaw, pitch in ((0.0, 0.0), (80.0, -30.0), (-150.0, 60.0)):
        camera = view.but(yaw_deg=yaw, pitch_deg=pitch).camera
        np.testing.assert_allclose(camera.project(SUBJECT), (319.5, 239.5), atol=1e-9)
        assert np.linalg.norm(camera.centre - SUBJECT) == pytest.approx(3)


def test_the_numbers_are_the_extrinsics_that_opencv_projects_with():
    view = FrustumView(mode="edit t", x=0.3, y=0.1, z=0.7, yaw_deg=-12.0, pitch_deg=5.0, roll_deg=8.0, hfov_deg=70.0)
    n = view.numbers()
    uv, _ = cv2.projectPoints(board_corners(), cv2.Rodrigues(n["R"])[0], n["t"], n["K"], None)
    np.testing.assert_allclose(view.camera.project(board_corners()), uv.reshape(-1, 2), atol=1e-9)
    np.testing.assert_allclose(n["C"], -n["R"].T @ n["t"], atol=1e-12)


@pytest.mark.parametrize(
    ("angle", "towards"), [("yaw_deg", (1, 0, 0)), ("pitch_deg", (0, -1, 0)), ("roll_deg", (0, 0, 0))]
)
def test_yaw_looks_right_and_pitch_looks_up(angle, towards):
    level = FrustumView(yaw_deg=0.0, pitch_deg=0.0, roll_deg=0.0)
    forward = level.but(**{angle: 10.0}).numbers()["R"][2]
    np.testing.assert_allclose(forward, np.array(towards) * np.sin(np.radians(10)) + (0, 0, forward[2]), atol=1e-12)


def test_roll_turns_the_camera_clockwise():
    right = FrustumView(yaw_deg=0.0, pitch_deg=0.0, roll_deg=10.0).numbers()["R"][0]
    assert right[1] > 0  # its right side sinks


@pytest.mark.parametrize("before", ["edit C", "edit t", "orbit"])
@pytest.mark.parametrize("after", ["edit C", "edit t", "orbit"])
def test_changing_the_mode_moves_nothing(before, after):
    view = FrustumView(mode=before, x=0.4, y=-0.3, z=0.8, yaw_deg=25.0, pitch_deg=-10.0, roll_deg=5.0)
    changed = view.but(mode=after)
    assert changed.mode == after
    np.testing.assert_allclose(
        changed.camera.world_from_cam.as_matrix(), view.camera.world_from_cam.as_matrix(), atol=1e-8
    )


def test_the_field_of_view_is_the_pinholes():
    view = FrustumView(hfov_deg=90.0)
    left, right = view.camera.unproject([(-0.5, 239.5), (639.5, 239.5)])
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(90)


def test_a_given_camera_is_shown_with_its_own_intrinsics_and_lens():
    given = Camera(Intrinsics(1280, 720, 900, 880, 610, 350, 2.0), BrownConrady(k1=-0.2))
    camera = FrustumView.of(given).camera
    assert camera.intrinsics == given.intrinsics
    assert camera.lens == given.lens


def test_zooming_a_given_camera_keeps_its_pixels_shape():
    given = Camera(Intrinsics(1280, 720, 900, 600, 610, 350))
    k = FrustumView.of(given).but(hfov_deg=30.0).camera.intrinsics
    assert k.fx / k.fy == pytest.approx(1.5)
    assert 2 * np.degrees(np.arctan(640 / k.fx)) == pytest.approx(30)


def test_dragging_the_picture_takes_the_scene_along():
    view = FrustumView()
    before = view.camera.project(board_corners()[20])
    after = view.dragged("picture", 0, 0, 15, -10).camera.project(board_corners()[20])
    assert after[0] > before[0] + 5
    assert after[1] < before[1] - 5


def test_dragging_space_turns_the_onlooker_and_not_the_camera():
    view = FrustumView().dragged("eye", 0, 0, 30, 10)
    assert view.eye == FrustumView().eye.orbited(30, 10)
    np.testing.assert_array_equal(view.numbers()["R"], FrustumView().numbers()["R"])
    assert FrustumView().pressed("eye", "+").eye.distance < FrustumView().eye.distance


def test_arrow_keys_on_the_picture_look_that_way():
    view = FrustumView()
    assert view.pressed("picture", "ArrowRight").yaw_deg > view.yaw_deg
    assert view.pressed("picture", "ArrowUp").pitch_deg > view.pitch_deg
    assert view.pressed("picture", "+").hfov_deg < view.hfov_deg
    assert view.pressed("picture", "q") == view


def test_the_camera_view_stands_still_while_the_camera_moves():
    """Seen from the camera's frame its own triad is drawn at the same place, wherever it goes."""

    def centre(view):
        return view.figure(draft=True).svg().split(">C</text>")[0].rsplit("<text ", 1)[1].split(" class")[0]

    moving = [FrustumView(x=x, yaw_deg=yaw, seen_from="camera view") for x, yaw in ((0.0, 0.0), (2.0, 40.0))]
    assert centre(moving[0]) == centre(moving[1])
    moving = [view.but(seen_from="world view") for view in moving]
    assert centre(moving[0]) != centre(moving[1])


def test_the_description_counts_the_corners_in_view():
    assert "sees 54 of the board's 54" in FrustumView().description()
    away = FrustumView(yaw_deg=180.0)
    assert "sees 0 of the board's 54" in away.description()
    assert "has no image" in away.figure(draft=True).svg()


@pytest.mark.parametrize(
    ("there", "pointed"), [({}, False), ({"x": 6.0}, True), ({"x": -6.0}, True), ({"y": 6.0}, True)]
)
def test_an_arrow_leads_to_a_camera_that_is_out_of_the_onlookers_sight(there, pointed):
    assert ("the camera is this way" in FrustumView(**there).figure().body) is pointed
    assert "the camera is this way" not in FrustumView(seen_from="camera view", **there).figure().body


def test_a_camera_tipped_straight_down_is_still_drawn():
    down = FrustumView(pitch_deg=-90.0, yaw_deg=45.0, roll_deg=-30.0)
    np.testing.assert_allclose(down.numbers()["R"][2], (0, 1, 0), atol=1e-12)
    assert Rotation.from_matrix(down.numbers()["R"]).magnitude() > 0
    down.figure(draft=True)


@pytest.mark.parametrize("name", FrustumView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = FrustumView.controls()[name]
    ends = control.choices or ((control.low, control.high) if control.low is not None else (True, False))
    pictures = [FrustumView().but(**{name: end}).figure(draft=True) for end in ends]
    assert len({(picture.svg(), *picture.photographs.values()) for picture in pictures}) == len(ends)


@pytest.mark.parametrize("degrees", [-5.0, 0.0, 180.0, 500.0, 1000.0])
def test_a_field_of_view_that_no_pinhole_has_is_answered_by_its_name(degrees):
    """tan 250° is positive, so 500° would be drawn as if it were 140°."""
    with pytest.raises(ValueError, match="field of view, must lie between 0 and 180"):
        FrustumView(hfov_deg=degrees)


# The reader's own centre ---------------------------------------------------------------------------------------------


def test_the_readers_camera_stands_where_their_function_says():
    view = FrustumView(mode="edit t", x=0.2, y=0.0, z=1.0, yaw_deg=30.0, pitch_deg=0.0, yours=lambda R, t: -R.T @ t)
    np.testing.assert_allclose(view._your_camera.centre, view.camera.centre, atol=1e-12)
    assert "0.00 m from the camera" in view.figure(draft=True).body
    wrong = view.but(yours=lambda R, t: -t)
    np.testing.assert_allclose(wrong._your_camera.centre, (-0.2, 0, -1))
    assert "0.00 m from the camera" not in wrong.figure(draft=True).body
    assert wrong._world_panel(np.zeros((3, 4, 3), np.uint8), True) != view._world_panel(
        np.zeros((3, 4, 3), np.uint8), True
    )


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda R, t: np.eye(3), "answers in shape"),
        (lambda R, t: t / 0, "not all finite"),
        (lambda R, t: undefined, "NameError"),  # noqa: F821
    ],
)
def test_a_function_without_a_centre_puts_no_camera_there_and_says_why(function, words):
    with np.errstate(divide="ignore", invalid="ignore"):
        body = FrustumView(yours=function).figure(draft=True).body
    assert words in body
    assert "nan" not in body.replace("your centre are not all finite", "")
    assert ">yours</text>" not in body


def test_in_the_place_of_a_function_that_is_not_written_stands_the_right_camera_greyed():
    waiting = FrustumView(yours=lambda R, t: None)
    body = waiting.figure(draft=True).body
    assert "yours appears here" in body
    awaited = body.split('class="awaited"')[1].split("yours appears here")[0]
    assert awaited.count("<text") == 1  # the sentence itself: what waits is too pale to be read
    np.testing.assert_allclose(waiting._your_camera.centre, waiting.camera.centre)
    assert "from the camera" not in body
    assert "yours appears here" not in waiting.but(yours=lambda R, t: -t).figure(draft=True).body


def test_no_function_is_drawn_without_the_world_it_stands_in():
    with pytest.raises(ValueError, match="must have the world"):
        FrustumView(panels="picture", yours=lambda R, t: t)


# One panel first -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "panels", ["world", "picture", "world picture", "picture numbers", "world K point", "world picture numbers K point"]
)
def test_the_panels_named_are_drawn_and_no_others(panels):
    names = {"numbers": ["rotation", "position"], "K": ["intrinsics"], "point": ["one point"]}
    wanted = [tile for panel in panels.split() for tile in names.get(panel, [panel])]
    assert [tile.name for tile in FrustumView(panels=panels).figure(draft=True).tiles] == wanted


def test_a_first_view_of_one_panel_opens_the_others_and_fits_a_screen():
    """At most 495 CSS pixels high, for a tile grows to half as much again."""
    for panel in ("world", "picture"):
        view = FrustumView.held(panels=panel)
        (tile,) = view.figure(draft=True).tiles
        assert 1.5 * tile.cell[3] <= 495
        assert [name for name in view.openable if name not in view.opened] == [n for n in view.openable if n != panel]
        opened = view.with_panels({"numbers": True, "K": True, "point": True, "world": True, "picture": True})
        assert len(opened.figure(draft=True).tiles) == 6


def test_the_first_view_leaves_out_K_the_chain_and_the_formula():
    body = FrustumView(panels="world picture numbers").figure(draft=True).body
    assert "−Rᵀt" not in body
    assert "intrinsics" not in body
    assert "R X + t" not in body
    assert "−Rᵀt" in FrustumView().figure(draft=True).body


@pytest.mark.parametrize("panels", ["nonsense", "numbers", "", "world nonsense"])
def test_panels_that_cannot_be_drawn_are_refused(panels):
    with pytest.raises(ValueError, match=f"got {panels!r}"):
        FrustumView(panels=panels)


def test_marks_are_the_corners_the_axes_or_neither():
    bodies = {
        marks: FrustumView.held(panels="picture", marks=marks).figure(draft=True).body
        for marks in ("corners axes", "axes", "")
    }
    assert len(set(bodies.values())) == 3
    assert ">X</text>" in bodies["axes"]
    assert "red" not in bodies["axes"]
    assert ">X</text>" not in bodies[""]
    with pytest.raises(ValueError, match="marks must be"):
        FrustumView(marks="globe")


@pytest.mark.parametrize("yaw", [-60.0, 0.0, 60.0])
def test_the_names_of_the_axes_stand_in_the_picture(yaw):
    """An axis that runs straight from the eye has none."""
    body = FrustumView.held(panels="picture", marks="axes", yaw_deg=yaw).figure(draft=True).body
    assert (">Z</text>" in body) == (yaw != 0)
    for x, y in re.findall(r'<text x="([-.\d]+)" y="([-.\d]+)" class="label halo', body):
        assert 0 < float(x) < 370
        assert 0 < float(y) < 286
