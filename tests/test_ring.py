"""A ring of cameras has no single viewpoint: what stitching does about it, and what it cannot do."""

import numpy as np
import pytest

from camviz.cameras import Camera, look_at
from camviz.lenses import Equirectangular
from camviz.panoramas.ring import Ring, all_round
from camviz.scenes import Scene, Texture, render, textured_scene
from camviz.scenes.surfaces import Column

BLACK = Texture.plain((0.0, 0.0, 0.0))
WHITE = Texture.plain((1.0, 1.0, 1.0))


def test_the_cameras_stand_evenly_on_the_circle_and_look_outwards():
    ring = Ring(6, 0.1)
    np.testing.assert_allclose(np.linalg.norm(ring.centres, axis=1), 0.1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(ring.centres, axis=0), axis=1), ring.baseline)
    assert ring.baseline == pytest.approx(0.1)  # a hexagon's side is its radius
    np.testing.assert_allclose(np.rad2deg(ring.seams), [-150, -90, -30, 30, 90, 150])
    assert ring.nearest(np.deg2rad([0, 29, 31, -31, 180])).tolist() == [0, 0, 1, 5, 3]
    turned = Ring(6, 0.1, turn=np.deg2rad(20))
    np.testing.assert_allclose(np.rad2deg(turned.seams), [-130, -70, -10, 50, 110, 170])
    np.testing.assert_allclose(turned.centres[0], 0.1 * np.array([np.sin(np.pi / 9), 0, np.cos(np.pi / 9)]))
    assert turned.nearest(np.deg2rad([0, 49, 51, -11])).tolist() == [0, 0, 1, 5]


def test_the_parallax_is_the_one_of_two_lines_drawn_with_a_ruler():
    """Each camera's ray to the point, met with the circle for which the panorama is stitched."""
    ring, stitched = Ring(5, 0.2), 3.0
    seam = np.array([np.sin(ring.half_angle), 0, np.cos(ring.half_angle)])
    for distance in (0.7, 1.5, 3.0, 20.0):
        shown = []
        for centre in ring.centres[:2]:
            ray = distance * seam - centre
            a, b, c = ray @ ray, 2 * centre @ ray, centre @ centre - stitched**2
            end = centre + (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a) * ray
            shown.append(np.arctan2(end[0], end[2]))
        assert ring.parallax(distance, stitched) == pytest.approx(shown[0] - shown[1], abs=1e-12)


def test_the_parallax_vanishes_at_the_stitching_distance_and_far_away_is_the_baseline_over_the_distance():
    ring = Ring(8, 0.1)
    assert ring.parallax(2.0, 2.0) == pytest.approx(0, abs=1e-15)
    assert ring.parallax(1e4, np.inf) == pytest.approx(ring.baseline / 1e4, rel=1e-4)
    assert ring.parallax(4.0, 2.0) < 0 < ring.parallax(1.0, 2.0)
    assert np.isnan(ring.parallax(0.05, 2.0))
    assert ring.parallax(np.inf, 2.0) == pytest.approx(-2 * np.arcsin(ring.baseline / 2 / 2.0))  # parallel rays
    assert ring.parallax(np.inf, np.inf) == 0


@pytest.mark.parametrize(("distance", "stitched"), [(0.8, 2.0), (2.0, 2.0), (5.0, 2.0), (1.0, np.inf)])
def test_a_post_at_a_seam_is_rendered_as_far_apart_as_the_closed_form_says(distance, stitched):
    """A white post on black, seen by the two cameras of a seam, 8000 pixels around."""
    ring, width = Ring(4, 0.15, overlap=1.0), 8000
    seam = np.array([np.sin(ring.half_angle), 0, np.cos(ring.half_angle)])
    post = Column(distance * seam + [0, 1, 0], 2.0, 0.01 * distance, WHITE, "post")
    pixels = all_round(width).cropped(0, width // 8, width, 1)
    directions = Equirectangular().unproject(pixels.from_pixels(pixels.grid()))
    seen = []
    for camera in (0, 1):
        light = Scene([post], BLACK).trace(*ring.rays(directions, stitched, camera))[0][0, :, 0]
        seen.append(np.average(np.arange(width), weights=light))
    assert seen[0] - seen[1] == pytest.approx(ring.parallax(distance, stitched) * pixels.fx, abs=0.7)


def test_a_seam_cuts_a_post_only_where_it_is_not_at_the_stitching_distance():
    """Columns of the panorama that show a post: whole at its own distance, nowhere or twice at others."""
    ring, distance = Ring(4, 0.2), 1.5
    seam = np.array([np.sin(ring.half_angle), 0, np.cos(ring.half_angle)])
    scene = Scene([Column(distance * seam + [0, 1, 0], 2.0, 0.05, WHITE, "post")], BLACK)
    pixels = all_round(3600, 5)
    widths = {s: int((ring.panorama(scene, pixels, s)[50, :, 0] > 0.5).sum()) for s in (1.5, 30.0, 0.8)}
    one = 2 * np.degrees(np.arcsin(0.05 / 1.5)) * 10  # 0.1° a pixel
    assert widths[1.5] == pytest.approx(one, abs=3)
    assert ring.parallax(distance, 30.0) * pixels.fx > 2 * one  # so far apart that neither camera's part shows it
    assert widths[30.0] == 0
    assert -ring.parallax(distance, 0.8) * pixels.fx > 2 * one
    assert widths[0.8] == pytest.approx(2 * one, abs=12)  # twice, side by side


def test_without_a_radius_the_panorama_is_what_one_camera_that_sees_all_round_takes():
    scene, pixels = textured_scene(), all_round(128, 40)
    alone = render(scene, Camera(pixels, Equirectangular()))
    for stitched in (2.0, np.inf):
        np.testing.assert_allclose(Ring(5, 0.0, 0.5).panorama(scene, pixels, stitched), alone, atol=0.05)


def test_where_pictures_overlap_their_shares_make_a_whole_and_meet_at_half():
    ring = Ring(6, 0.1, overlap=0.6)
    left, right = (ring.second(ring.half_angle + step)[1] for step in (-1e-9, 1e-9))
    assert left == pytest.approx(0.5, abs=1e-6)
    assert right == pytest.approx(0.5, abs=1e-6)
    assert ring.second(0.0)[1] == 0
    assert ring.second(0.39 * ring.half_angle)[1] == 0
    assert ring.second(0.41 * ring.half_angle)[1] > 0


def test_a_ring_looks_at_the_same_point_from_a_camera_as_that_camera_itself():
    ring = Ring(3, 0.3)
    starts, rays = ring.rays(np.array([[0.0, 0, 1]]), 2.0)
    camera = Camera(all_round(64), Equirectangular(), look_at(ring.centres[0], [0, 0, 2.0]))
    np.testing.assert_allclose(starts[0], camera.centre)
    np.testing.assert_allclose(rays[0], camera.extrinsics[0][2], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: Ring(1, 0.1), "cameras"),
        (lambda: Ring(4, -1), "radius"),
        (lambda: Ring(4, 0.1, 2), "overlap"),
        (lambda: Ring(4, 0.1).parallax(1.0, 0.05), "stitched"),
        (lambda: all_round(100, 0), "up_deg"),
    ],
)
def test_what_makes_no_ring_is_refused_by_name(make, name):
    with pytest.raises(ValueError, match=name):
        make()
