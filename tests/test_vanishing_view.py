"""The vanishing-point and the height visualizer: what they draw is what the house and its camera are."""

import math
from itertools import combinations

import numpy as np
import pytest

from camviz_school.views.house import camera, edges, house_scene
from camviz_school.views.staff import StaffView
from camviz_school.views.vanishing import PAPER, VanishingView


def test_the_lines_run_along_the_edges_of_what_is_traced():
    """A ray a little inside a wall meets it; one a little above its upper edge meets the sky."""
    seen = camera()
    for name in "xz":
        upper, lower = edges()[name]
        for end in (0.3, 0.7):
            top, foot = upper[0] + end * (upper[1] - upper[0]), lower[0] + end * (lower[1] - lower[0])
            above, below, inside = (
                seen.project(p) for p in (top + [0, -0.03, 0], top + [0, 0.03, 0], foot - [0, 0.03, 0])
            )
            _, far = house_scene().trace(seen.centre, seen.unproject(np.array([above, below, inside])))
            assert np.isnan(far[0])
            np.testing.assert_allclose(far[1:], np.linalg.norm([top, foot], axis=1), rtol=0.02)


@pytest.mark.parametrize(("handle", "moves"), [("end0", "x"), ("end3", "x"), ("end4", "z"), ("end7", "z")])
def test_a_dragged_end_moves_its_own_line_and_no_other(handle, moves):
    first = VanishingView()
    moved = first.dragged(handle, 0, 0, *(PAPER.scale * (3, -2)))
    for name in "xz":
        off = moved.lines[name].reshape(4, 2) - first.lines[name].reshape(4, 2)
        expected = np.zeros((4, 2))
        if name == moves:
            expected[int(handle[3:]) % 4] = 3, -2
        np.testing.assert_allclose(off, expected, atol=1e-9)
    by_key = np.subtract(moved.pressed(handle, "ArrowLeft").moved, moved.moved)
    np.testing.assert_allclose(by_key[int(handle[3:])], (-1, 0), atol=0.01)


@pytest.mark.parametrize("aside", [-3.0, 0.0, 2.0])
@pytest.mark.parametrize("turn_deg", [-25.0, 0.0, 30.0])
def test_a_hand_can_take_each_of_the_lines_ends(turn_deg, aside):
    marks = VanishingView(turn_deg=turn_deg, aside=aside).figure(draft=True).marks
    hands = [group.marks.points("card").mean(axis=0) for group in marks.groups("end")]
    assert len(hands) in (4, 8)
    between = [math.dist(a, b) for a, b in combinations(hands, 2)]
    assert min(between) > 8  # of 13 that each reaches


def test_a_dragged_end_changes_the_focal_length():
    moved = VanishingView().dragged("end1", 0, 0, *(PAPER.scale * (0, 4)))
    assert np.linalg.norm(moved.pixels["x"] - VanishingView().pixels["x"]) > 10
    assert abs(moved.focal / moved.camera.intrinsics.fx - 1) > 0.01


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        ({"aside": -3.0, "turn_deg": 42.0}, "a point is at infinity"),
        ({"turn_deg": 42.0}, "a wall is not seen"),
        ({"moved": ((0.0, 0.0), (900.0, 0.0)) * 2 + ((0.0, 0.0),) * 4}, "no right angle fits"),
    ],
)
def test_where_there_is_no_focal_length_the_numbers_say_why(state, reason):
    view = VanishingView(**state)
    assert np.isnan(view.focal)
    assert view.numbers()["focal length"] == f"none: {reason}"


def test_the_horizon_is_there_while_a_point_is_at_infinity():
    squarely = VanishingView(aside=-3.0, turn_deg=42.0)
    assert np.isnan(squarely.pixels["x"]).all()
    assert squarely.horizon == pytest.approx((239.5, 0.0), abs=1e-6)
    assert squarely.numbers()["blue lines meet"] == "at infinity"
    unseen = VanishingView(turn_deg=42.0)
    assert np.isnan(unseen.horizon).all()
    assert unseen.numbers()["blue lines meet"] == "not in the picture"


@pytest.mark.parametrize("distance", [5.0, 12.0, 40.0])
def test_what_is_as_high_as_the_camera_stands_on_the_horizon(distance):
    view = StaffView(distance_m=distance)
    assert view.staff[1, 1] == pytest.approx(view.horizon_row, abs=1e-9)
