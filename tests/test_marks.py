"""Marks on photographs lie where they say, and no part of a line lies outside its panel."""

import cv2
import numpy as np

from camviz.cameras import Intrinsics
from camviz.draw.marks import NOTHING
from camviz.draw.panel import Panel, image_panel
from camviz.views.marks import border_arrow, clipped, crop, on_photograph

PANEL = Panel("test", 0, 0, 200, 100, 0, 200, 0, 100)


def test_a_line_is_clipped_as_opencv_clips_it():
    rng = np.random.default_rng(3)
    for start, end in rng.integers(-150, 350, (300, 2, 2)):
        seen, a, b = cv2.clipLine((0, 0, 200001, 100001), (1000 * start).tolist(), (1000 * end).tolist())
        parts = clipped(PANEL, [start, end])
        if seen and np.linalg.norm(np.subtract(a, b)) > 100:  # of OpenCV's whole thousandths
            np.testing.assert_allclose(parts, [np.array([a, b]) / 1000], atol=0.1)
        else:
            assert np.linalg.norm(np.diff(parts, axis=1)) < 0.2


def test_segments_and_longer_lines_are_drawn_in_the_same_places_and_none_at_all_as_nothing():
    corner = np.array([[10.0, 20], [30, 20], [30, 60]])
    edge, line = on_photograph([corner], "green")
    assert [one.tolist() for one in (*edge.lines, *line.lines)] == [corner.tolist()] * 2
    _, segments = on_photograph(np.stack([corner[:-1], corner[1:]], axis=1), "green")
    assert segments.ends.tolist() == [corner[:2].tolist(), corner[1:].tolist()]
    assert on_photograph([], "green") == NOTHING


def test_a_line_inside_stays_whole_and_one_without_an_end_is_left_out():
    inside = np.array([(10.0, 20.0), (30.0, 40.0)])
    np.testing.assert_array_equal(clipped(PANEL, inside)[0], inside)
    assert len(clipped(PANEL, [(10.0, 20.0), (np.nan, 40.0)])) == 0


def test_a_detail_shows_what_is_around_its_pixel_also_in_a_picture_of_another_size():
    """A ramp in u and v: the middle of the detail has the value of the pixel asked for."""
    intrinsics = Intrinsics(200, 160, 150, 150, 99.5, 79.5)
    for scale in (1, 2):
        u, v = np.meshgrid(*(np.arange(scale * side) for side in (200, 160)))
        ramp = (((np.stack([u, v, v], axis=-1) + 0.5) / scale) - 0.5).round().astype(np.uint8)
        detail = crop(ramp, intrinsics, (90, 60), 48).astype(float)
        assert np.abs(detail[68:70, 68:70].mean(axis=(0, 1)) - (90, 60, 60)).max() <= 1
        assert abs(np.ptp(detail[69, :, 0]) - 48) <= 2


def test_an_arrow_to_what_lies_outside_is_inside_however_flat_the_picture():
    for width, height in ((640, 480), (4096, 2), (1, 4096)):
        panel = image_panel("left", 0, 0, 455, width, height, tallest=342)
        for toward in np.array([(1, 0), (0, -1), (0.6, 0.8)]):
            (arrow, words) = border_arrow(panel, toward, "there")
            assert np.isfinite(arrow.lines[0]).all()
            assert np.isfinite([words.x, words.y]).all()
