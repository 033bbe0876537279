"""Light and what lies on surfaces: textures, shading, and the way to a screen."""

from dataclasses import replace

import numpy as np
import pytest
from plain_scenes import AHEAD, GREEN, RED, facing

from camviz.cameras import Camera, Intrinsics, look_at
from camviz.lenses.base import unit
from camviz.scenes import (
    Ground,
    Scene,
    Sphere,
    Texture,
    render,
    snapshot,
    textured_scene,
    to_display,
    to_encoded,
    to_linear,
)
from camviz.scenes.bake import painted
from camviz.scenes.standard import baked


def test_srgb_agrees_with_the_published_standard():
    """IEC 61966-2-1: 0.5 linear is 0.735357 encoded; 0.04045 and 0.0031308 are the knee; 0.18 grey is 118."""
    assert to_encoded(0.5) == pytest.approx(0.735357, abs=1e-6)
    assert to_linear(0.735357) == pytest.approx(0.5, abs=1e-6)
    assert to_linear(0.5) == pytest.approx(0.214041, abs=1e-6)
    assert to_encoded(0.0031308) == pytest.approx(0.04045, abs=1e-5)
    assert to_display(np.array([0, 0.18, 0.5, 1.0])).tolist() == [0, 118, 188, 255]


def test_srgb_bytes_survive_the_way_to_light_and_back():
    levels = np.arange(256, dtype=np.uint8)
    assert np.array_equal(to_display(to_linear(levels)), levels)
    assert np.array_equal(to_display(to_linear(levels / 255)), levels)


def test_the_screen_shows_too_much_light_as_white_and_no_light_as_black():
    assert to_display([-1.0, 2.0, np.inf, np.nan]).tolist() == [0, 255, 255, 0]


def test_a_white_texture_of_mean_light_stays_so_at_any_distance():
    """Averaging a checkerboard loses contrast, never light: the mean over a far patch is the texture's mean."""
    squares = np.kron(np.indices((8, 8)).sum(axis=0) % 2, np.ones((8, 8)))[..., None].repeat(3, axis=2)
    ground = Ground(1.0, Texture(squares, repeat=True), haze=(0, 0, 0), sight=1e9)
    camera = Camera(Intrinsics.from_fov(64, 48, 40), world_from_cam=look_at((0, -60, 0), (0.01, 1, 0), down=(0, 0, -1)))
    light = render(Scene([ground]), camera)
    assert light.mean() == pytest.approx(0.5, abs=0.01)
    assert light.std() < 0.05


def test_no_surface_sends_out_more_light_than_it_gets():
    camera = Camera(Intrinsics.from_fov(160, 120, 80))
    light = render(textured_scene(), camera)
    assert light.dtype == np.float32
    assert light.min() >= 0
    assert light.max() <= 1
    assert 0.1 < light.mean() < 0.6


def test_a_shaded_surface_sends_out_its_share():
    light, _ = Scene([facing(2, Texture(np.full((4, 4, 3), 0.8)), shade=0.25)]).trace(np.zeros(3), AHEAD)
    np.testing.assert_allclose(light, 0.2, atol=1e-4)


def test_supersampling_is_the_mean_of_the_finer_picture():
    camera = Camera(Intrinsics.from_fov(32, 24, 60))
    scene = Scene([facing(2, RED, half=0.6)], sky=GREEN)
    fine = render(scene, replace(camera, intrinsics=camera.intrinsics.resized(96, 72)))
    expected = fine.reshape(24, 3, 32, 3, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(render(scene, camera, supersample=3), expected, atol=1e-5)


def test_a_snapshot_is_the_rendered_light_on_a_screen():
    """301 × 211 pixels do not fill the last strip of rays."""
    camera = Camera(Intrinsics.from_fov(301, 211, 70))
    assert np.array_equal(snapshot(textured_scene(), camera), to_display(render(textured_scene(), camera)))


@pytest.mark.parametrize("supersample", [0, -1, 1.5])
def test_supersampling_takes_whole_numbers(supersample):
    with pytest.raises(ValueError, match="supersample must be a whole number"):
        render(Scene([]), Camera(Intrinsics.from_fov(8, 8, 60)), supersample)


# Textures


def test_a_texture_is_looked_up_between_texel_centres():
    """Texel centres at (i + 0.5) / n; halfway between two of them is their mean; beyond the border it goes on."""
    texture = Texture(np.array([[0.0, 0.4, 1.0, 0.2]])[..., None].repeat(3, axis=2))
    s = np.array([0.125, 0.25, 0.375, 0.625, 0.0, 1.0], dtype=np.float32)
    light = texture.sample(s, np.full(6, 0.5, dtype=np.float32))
    np.testing.assert_allclose(light[:, 0], [0, 0.2, 0.4, 1.0, 0, 0.2], atol=2e-3)


def test_a_repeating_texture_joins_its_last_column_to_its_first():
    texture = Texture(np.array([[0.0, 0.4, 1.0, 0.2]])[..., None].repeat(3, axis=2), repeat=True)
    s = np.array([0.0, 1.0, -2.0, 1.125, -0.125], dtype=np.float32)
    light = texture.sample(s, np.full(5, 0.5, dtype=np.float32))
    np.testing.assert_allclose(light[:, 0], [0.1, 0.1, 0.1, 0.0, 0.2], atol=2e-3)


def test_from_far_enough_a_texture_is_its_mean_colour():
    picture = np.random.default_rng(5).uniform(size=(64, 32, 3))
    texture = Texture(picture)
    far = texture.sample(
        np.array([0.1, 0.9], np.float32), np.array([0.2, 0.8], np.float32), np.full(2, 1e4, np.float32)
    )
    np.testing.assert_allclose(far[:, :3], np.tile(picture.mean(axis=(0, 1)), (2, 1)), atol=1e-3)


def test_a_photograph_on_a_rectangle_is_seen_the_right_way_round():
    corners = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], dtype=float)
    rays = unit(np.array([[-0.9, -0.9, 2], [0.9, -0.9, 2], [-0.9, 0.9, 2], [0.9, 0.9, 2]]))
    light, _ = Scene([facing(2, Texture(corners))]).trace(np.zeros(3), rays)
    np.testing.assert_allclose(light, corners.reshape(4, 3), atol=1e-3)


def test_the_sphere_shows_the_middle_of_its_map_to_a_camera_at_the_origin():
    """West is on the left and north on top, as on a map."""
    world = np.zeros((2, 4, 3))
    world[:, :2, 0], world[:, 2:, 1], world[0, :, 2] = 1, 1, 1
    rays = unit(np.array([[-0.5, -0.5, 4], [0.5, -0.5, 4], [-0.5, 0.5, 4], [0.5, 0.5, 4]]))
    light, _ = Scene([Sphere(np.array([0.0, 0, 4]), 1.0, Texture(world))]).trace(np.zeros(3), rays)
    assert (light > 0.5).tolist() == [
        [True, False, True],
        [False, True, True],
        [True, False, False],
        [False, True, False],
    ]


def test_the_sky_is_a_map_whose_middle_lies_ahead():
    sky = np.zeros((2, 4, 3))
    sky[0, :, 2], sky[:, 2:, 0] = 1, 1
    rays = unit(np.array([[0.9, -0.6, 0.1], [-0.9, -0.6, 0.1], [0.9, 0.6, 0.1]]))
    light, _ = Scene([], Texture(sky)).trace(np.zeros(3), rays)
    assert (light > 0.5).tolist() == [[True, False, True], [False, False, True], [True, False, False]]


def test_the_garden_is_baked_from_what_paints_it():
    """JPEG at quality 93 is a level or two off; another planet or a moved shadow is more (mend: bake, see its head)."""
    for name, picture in painted():
        kept = baked(name).photograph
        assert kept.shape == picture.shape, name
        assert np.abs(kept.astype(int) - picture).mean() < 4, name


def test_a_sky_that_ends_below_the_horizon_goes_on_with_its_last_row():
    """Two rows of a sky eight texels wide are 45° high each and end at the horizon."""
    sky = np.zeros((2, 8, 3))
    sky[1] = 1
    elevations = np.deg2rad([67.5, 22.5, -45, -89])
    rays = np.stack([0 * elevations, -np.sin(elevations), np.cos(elevations)], axis=-1)
    light, _ = Scene([], Texture(sky, repeat=True)).trace(np.zeros(3), rays)
    np.testing.assert_allclose(light[:, 0], [0, 1, 1, 1], atol=1e-3)
