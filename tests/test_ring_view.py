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


def test_what_is_at_the_stitching_distance_is_whole_and_one_viewpoint_always_is():
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


def test_the_distance_at_the_seam_is_the_garden_s():
    assert RingView(turn_deg=-18).distance_m == pytest.approx(3.1, abs=0.1)  # the crate
    assert "3.1 m away" in RingView(turn_deg=-18).description()


@pytest.mark.parametrize("name", RingView.controls())
def test_every_control_changes_the_picture_at_both_ends(name):
    control = RingView.controls()[name]
    base = RingView()
    ends = (control.low, control.high) if control.low is not None else (True, False)
    pictures = [base.but(**{name: end}).figure(draft=True) for end in ends]
    assert pictures[0].svg() != pictures[1].svg()
    assert pictures[0].photographs != pictures[1].photographs


def test_dragging_turns_the_ring_as_far_as_the_pointer():
    view = RingView(turn_deg=0)
    assert view.dragged("seams", 0, 0, 92, 5).turn_deg == 36
    assert view.dragged("seams", 0, 0, 900, 5).turn_deg == 45
    assert view.pressed("seams", "ArrowLeft").turn_deg < 0


@pytest.mark.parametrize(
    ("bad", "name"), [({"cameras": 1}, "cameras"), ({"radius_m": -1}, "radius"), ({"stitched_m": 0.2}, "stitched_m")]
)
def test_a_state_that_makes_no_sense_is_refused_by_name(bad, name):
    with pytest.raises(ValueError, match=name):
        RingView(**bad)


def test_the_seam_alone_is_larger_and_the_others_come_and_go():
    """Each panel that is opened has a tile of its own, which covers no other."""
    view = RingView(panels="seam")
    assert [tile.name for tile in view.figure(draft=True).tiles] == ["seam"]
    assert "panorama" not in view.figure(draft=True).photographs
    alone = view.loupe().shape[1]
    for name in RingView.openable:
        view = view.with_panels({name: True})
    assert view.loupe().shape[1] < alone
    cells = [tile.cell for tile in view.figure(draft=True).tiles]
    assert len(cells) == 4
    for i, (x, y, width, height) in enumerate(cells):
        assert x + width <= 960
        for a, b, across, down in cells[:i]:
            assert x >= a + across or a >= x + width or y >= b + down or b >= y + height
    for panels in ("panorama", "seam dome"):
        with pytest.raises(ValueError, match="panels must be seam and any of panorama"):
            RingView(panels=panels)
