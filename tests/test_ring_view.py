"""The ring visualizer shows true numbers and true pictures."""

import cv2
import numpy as np
import pytest

from camviz_school.views.ring import RingView


def test_the_numbers_are_those_of_two_lines_of_sight():
    """Four cameras, 0.3 m: each is 0.212 m beside the seam and 0.212 m nearer; infinity is 30 m to within a pixel."""
    view = RingView(cameras=4, radius_m=0.3, stitched_m=1e9)
    side = 0.3 * np.sqrt(0.5)
    for distance in (1.0, 3.0, 10.0):
        expected = 2 * np.arctan(side / (distance - side)) * 4000 / (2 * np.pi)
        assert view.numbers()[f"parallax at {distance:g} m"] == f"+{expected:.1f} px"
    assert view.numbers()["neighbours apart"] == "42.4 cm"
    assert RingView(turn_deg=-18).distance_m == pytest.approx(3.1, abs=0.1)  # the garden's crate
    for bad, name in (({"cameras": 1}, "cameras"), ({"radius_m": -1}, "radius"), ({"stitched_m": 0.2}, "stitched_m")):
        with pytest.raises(ValueError, match=name):
            RingView(**bad)
    marks = view.figure(draft=True).marks.panels()["parallax"].marks
    red, curve = (marks.points(style) for style in ("red", "blue thick"))
    assert red[0, 1] == pytest.approx(np.interp(red[0, 0], *curve.T), abs=0.1)  # the globe's distance on the curve


def test_what_is_at_the_stitching_distance_is_whole():
    """The globe across a seam, against the globe from one viewpoint: torn when stitched for far away."""
    whole = RingView(one_viewpoint=True)
    seam = np.s_[85:150, 120:185]  # the globe, in the enlarged part
    near = RingView(stitched_m=whole.distance_m).loupe()[seam]
    far = RingView(stitched_m=30.0).loupe()[seam]
    truth = whole.loupe()[seam]
    edges = [cv2.Canny(one, 60, 160).sum() for one in (near, truth)]
    assert edges[0] == pytest.approx(edges[1], rel=0.35)
    assert cv2.PSNR(near, truth) > cv2.PSNR(far, truth) + 2
    assert whole.numbers()["parallax at 1 m"] == "+0.0 px"


def test_dragging_turns_the_ring_as_far_as_the_pointer():
    view = RingView(turn_deg=0)
    assert view.dragged("seams", 0, 0, 92, 5).turn_deg == 36
    assert view.dragged("seams", 0, 0, 900, 5).turn_deg == 45
    assert view.pressed("seams", "ArrowLeft").turn_deg < 0
