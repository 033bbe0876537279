"""Pictures from one camera to another: held against pictures known in closed form, OpenCV and py360convert."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import py360convert
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import (
    BrownConrady,
    Cylindrical,
    DoubleSphere,
    Equidistant,
    Equisolid,
    ExtendedUnified,
    KannalaBrandt,
    Orthographic,
    Perspective,
    Stereographic,
    UnifiedSphere,
)
from camviz.panoramas.cubemap import FACES, Cubemap, Layout, cubemap_camera, face_camera, joined, split
from camviz.panoramas.reprojection import (
    TOLERANCE,
    covered,
    equirectangular_camera,
    places,
    reproject,
    samples_a_side,
    source_pixels,
    turned,
    window,
)

AROUND = equirectangular_camera(512, 256)
TUM_VI = KannalaBrandt(0.00693023, -0.0013828, -0.000272596, -0.000452646)


def centred(width: int, height: int, f: float) -> Intrinsics:
    return Intrinsics(width, height, f, f, (width - 1) / 2, (height - 1) / 2)


CAMERAS = {
    "equirectangular": AROUND,
    "cylinder": Camera(centred(512, 200, 512 / (2 * np.pi)), Cylindrical()),
    "cross": cubemap_camera(128),
    "strip": cubemap_camera(100, Layout.STRIP),
    "equidistant": Camera(centred(300, 260, 90), Equidistant()),
    "equisolid": Camera(centred(301, 300, 75), Equisolid()),
    "orthographic": Camera(centred(300, 300, 150), Orthographic()),
    "stereographic": Camera(centred(300, 300, 60), Stereographic()),
    "Kannala-Brandt": Camera(Intrinsics(512, 512, 250, 251, 254, 256), TUM_VI),
    "perspective": Camera(centred(320, 240, 200), Perspective()),
    "Brown-Conrady": Camera(centred(320, 240, 250), BrownConrady(k1=-0.28, k2=0.07)),
    "unified": Camera(centred(320, 320, 180), UnifiedSphere(1.2)),
    "extended unified": Camera(centred(320, 320, 100), ExtendedUnified(0.6, 1.1)),
    "double sphere": Camera(centred(320, 320, 120), DoubleSphere(-0.2, 0.55)),
}


def colours(rays: np.ndarray) -> np.ndarray:
    """A picture of the sky known for every direction (..., 3): three smooth waves, float32."""
    waves = np.array([(2.1, -0.7, 1.3), (-1.2, 2.3, 0.4), (0.5, 1.1, -2.4)])
    return (0.5 + 0.4 * np.sin(rays @ waves.T)).astype(np.float32)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((a.astype(float) - b.astype(float)) ** 2)))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(9)


@pytest.fixture(scope="module")
def earth() -> np.ndarray:
    wheel = find_spec("pyvista").submodule_search_locations[0]
    return cv2.imread(str(Path(wheel) / "examples" / "2k_earth_daymap.jpg"))


# Against a sky in closed form ----------------------------------------------------------------------------------------


def pairs(sources):
    """Every source with every camera; without --all with a few, so that every camera is a target."""
    names = list(CAMERAS)
    for i, source in enumerate(sources):
        for j, target in enumerate(names):
            often = (j - 2 * i) % len(names) < 2 * len(names) / len(sources)
            yield pytest.param(source, target, marks=[] if often else [pytest.mark.thorough])


@pytest.mark.sampled(10)
@pytest.mark.parametrize(
    ("source", "target"),
    list(pairs(["equirectangular", "cylinder", "cross", "strip", "equidistant", "Kannala-Brandt"])),
)
def test_every_camera_sees_the_same_sky_through_every_other(source, target):
    """Seams, poles and cube edges included. Bilinear interpolation errs by h² u''/8, below 0.002 for these waves; at
    the outer edge of a picture that ends, where there is no neighbour, by half a pixel's change.
    """
    taking, seeing = CAMERAS[source], CAMERAS[target].at(turned(130, 35, -20))
    sky = np.nan_to_num(colours(taking.rays()))
    seen = reproject(sky, taking, seeing, nothing=-1.0, antialias=False)
    truth = colours(seeing.rays())
    shown = ~(seen == -1).all(axis=-1)
    visible = taking.sees(taking.centre + np.nan_to_num(seeing.rays())) & np.isfinite(truth[..., 0])
    assert (shown != visible).mean() < 1e-3
    assert not shown.any() or np.abs(seen - truth)[shown & visible].max() < 0.008


@pytest.mark.parametrize(("source", "target"), list(pairs(CAMERAS)))
def test_interpolated_maps_are_as_exact_as_promised(source, target):
    taking, seeing = CAMERAS[source], CAMERAS[target].at(turned(-100, 70, 15))
    exact = source_pixels(taking, seeing, seeing.intrinsics.grid()) + 1
    if isinstance(taking.lens, Cubemap):  # each face has a border of its own
        exact += 2 * np.floor((exact - 0.5) / (2 * taking.intrinsics.fx))
    found = places(taking, seeing)
    assert ((found[..., 0] < 0) != np.isnan(exact[..., 0])).mean() < 1e-3  # slivers
    seen = np.isfinite(exact[..., 0]) & (found[..., 0] >= 0)
    assert not seen.any() or np.abs(found - exact)[seen].max() <= TOLERANCE


@pytest.mark.parametrize("name", CAMERAS)
def test_a_camera_seen_through_itself_is_unchanged(name, rng):
    camera = CAMERAS[name]
    picture = rng.integers(0, 256, (camera.intrinsics.height, camera.intrinsics.width, 3), dtype=np.uint8)
    alpha = reproject(picture, camera, camera, nothing=None)[..., 3]
    same = reproject(picture, camera, camera)
    assert (alpha[np.isfinite(camera.rays()).all(axis=-1)] == 255).all()
    np.testing.assert_array_equal(same[alpha == 255], picture[alpha == 255])


# Seams, poles and half pixels ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", [1, 100, 255, 511])
def test_turning_a_panorama_by_whole_pixels_rolls_it(columns, rng):
    picture = rng.integers(0, 256, (256, 512, 3), dtype=np.uint8)
    turned_right = AROUND.at(turned(360 * columns / 512, 0, 0))
    np.testing.assert_array_equal(reproject(picture, AROUND, turned_right), np.roll(picture, -columns, axis=1))


def test_turning_a_panorama_by_half_a_pixel_averages_neighbours_also_across_the_seam(rng):
    picture = rng.random((256, 512)).astype(np.float32)
    half = reproject(picture, AROUND, AROUND.at(turned(180 / 512, 0, 0)))
    np.testing.assert_allclose(half, (picture + np.roll(picture, -1, axis=1)) / 2, atol=1e-4)


def test_a_panorama_turned_over_the_pole_is_the_panorama_turned_upside_down_and_round(rng):
    picture = rng.integers(0, 256, (256, 512), dtype=np.uint8)
    over = reproject(picture, AROUND, AROUND.at(turned(0, 180, 0)))
    np.testing.assert_array_equal(over, np.roll(picture[::-1, ::-1], 256, axis=1))


def test_straight_up_lies_between_the_first_row_and_the_first_row_half_way_round(rng):
    picture = rng.random((256, 512)).astype(np.float32)
    up = window(1, 1, 1, pitch_deg=90, yaw_deg=180 * 3 / 512)
    u = source_pixels(AROUND, up, np.zeros(2))[0]
    across = np.interp([u, (u + 256) % 512], np.arange(512), picture[0])
    np.testing.assert_allclose(reproject(picture, AROUND, up, antialias=False), [[across.mean()]], atol=0.02)


def test_a_panorama_with_its_middle_elsewhere_is_joined_where_it_ends():
    shifted = Camera(replace(AROUND.intrinsics, cx=100.0), AROUND.lens)
    u = (np.arange(512) - 100.0) * 2 * np.pi / 512
    sky = np.broadcast_to(np.cos(u), (256, 512)).astype(np.float32)
    seen = reproject(sky, shifted, AROUND, nothing=None)
    assert (seen[..., 1] == 1).all()
    np.testing.assert_allclose(
        seen[..., 0], np.broadcast_to(np.cos((np.arange(512) - 255.5) * np.pi / 256), (256, 512)), atol=1e-3
    )


# Averaging -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [2, 3, 5])
def test_shrinking_averages_the_pixels_a_new_one_covers(factor, rng):
    pixels = centred(240, 180, 400)
    picture = rng.random((180, 240)).astype(np.float32)
    source = Camera(pixels)
    small = Camera(pixels.resized(240 // factor, 180 // factor))
    assert samples_a_side(source, small) == factor
    blocks = picture.reshape(180 // factor, factor, 240 // factor, factor).mean(axis=(1, 3))
    np.testing.assert_allclose(reproject(picture, source, small), blocks, atol=1e-3)


def test_without_averaging_fine_stripes_turn_into_false_ones():
    stripes = np.tile(np.array([0, 255], np.uint8), (128, 256))
    source = Camera(centred(512, 128, 500))
    small = Camera(source.intrinsics.resized(100, 25))
    assert reproject(stripes, source, small, antialias=False).std() > 30
    assert reproject(stripes, source, small).std() < 15


def test_the_poles_of_a_panorama_are_not_blurred_for_their_many_columns():
    up = window(128, 128, 30, pitch_deg=90)
    assert covered(AROUND, up).max() < 1.5


# Against other programs ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [256, 512])
@pytest.mark.parametrize(("face", "letter"), list(zip(FACES, "FRBLUD", strict=True)))
def test_cube_faces_are_those_of_py360convert(earth, face, letter, side):
    """It puts the *centres* of a face's outermost pixels on the cube's edges: f = (side - 1)/2 where ours is side/2."""
    theirs = py360convert.e2c(earth, side, cube_format="dict")[letter]
    pixels = centred(side, side, (side - 1) / 2)
    ours = reproject(earth, equirectangular_camera(2048, 1024), replace(face_camera(face, side), intrinsics=pixels))
    assert psnr(ours, theirs) > 55 if side == 512 else psnr(ours, theirs) > 30  # it averages nothing


def test_a_cube_rolled_out_is_that_of_py360convert(earth):
    """It looks half a pixel too far to the right and down in every face, and puts the first and the last column of the
    panorama both at 180°: its seam is doubled. A camera can be told so.
    """
    cube = cubemap_camera(512)
    picture = reproject(earth, equirectangular_camera(2048, 1024), cube)
    faces = {letter: split(picture)[face] for face, letter in zip(FACES, "FRBLUD", strict=True)}
    theirs = py360convert.c2e(faces, 512, 1024, cube_format="dict")
    half_off = Camera(replace(cube.intrinsics, cx=cube.intrinsics.cx + 0.5, cy=cube.intrinsics.cy + 0.5), cube.lens)
    doubled = Camera(Intrinsics(1024, 512, 1023 / (2 * np.pi), 511 / np.pi, 511.5, 255.5), AROUND.lens)
    ours = reproject(picture, half_off, doubled, antialias=False, nothing=None)
    shown = ours[..., 3] == 255
    assert shown.mean() > 0.99
    assert psnr(ours[..., :3][shown], theirs[shown]) > 45


def test_there_and_back_through_a_cube_loses_only_what_interpolation_loses(earth):
    around, cube = equirectangular_camera(2048, 1024), cubemap_camera(1024)
    small = cv2.GaussianBlur(earth, (0, 0), 3)
    assert psnr(reproject(reproject(small, around, cube), cube, around), small) > 45


def test_a_fisheye_straightened_is_opencvs(rng):
    lens, k = KannalaBrandt(0.02, -0.01, 0.003, -0.001), Intrinsics(320, 240, 150, 152, 161, 117)
    picture = cv2.GaussianBlur(rng.integers(0, 256, (240, 320, 3), dtype=np.uint8), (0, 0), 2)
    straight = Intrinsics(300, 200, 140, 140, 149.5, 99.5)
    theirs = cv2.fisheye.undistortImage(
        picture, k.K, np.array([lens.k1, lens.k2, lens.k3, lens.k4]), None, straight.K, (300, 200)
    )
    ours = reproject(picture, Camera(k, lens), Camera(straight), nothing=0.0, antialias=False)
    assert np.abs(ours.astype(int) - theirs)[2:-2, 2:-2].max() <= 2


def test_a_turned_perspective_camera_is_opencvs_homography(rng):
    picture = cv2.GaussianBlur(rng.integers(0, 256, (240, 320), dtype=np.uint8), (0, 0), 2)
    source, target = Camera(centred(320, 240, 260)), window(300, 220, 50, yaw_deg=8, pitch_deg=-5, roll_deg=20)
    H = source.intrinsics.K @ target.extrinsics[0].T @ np.linalg.inv(target.intrinsics.K)
    theirs = cv2.warpPerspective(picture, H, (300, 220), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    seen = reproject(picture, source, target, nothing=None, antialias=False)[..., 1] == 255
    ours = reproject(picture, source, target, antialias=False)
    inside = cv2.erode(seen.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    assert np.abs(ours.astype(int) - theirs)[inside].max() <= 2


# What is not there, and what cannot be -------------------------------------------------------------------------------


def test_a_pixel_without_a_ray_is_the_colour_asked_for_or_transparent():
    picture = np.full((256, 512, 3), 200, np.uint8)
    ball = Camera(centred(200, 200, 80), Orthographic())
    outside = np.isnan(ball.rays()).any(axis=-1)
    assert 0.4 < outside.mean() < 0.6
    coloured = reproject(picture, AROUND, ball, nothing=(1.0, 0.0, 0.2))
    np.testing.assert_array_equal(coloured[outside], np.broadcast_to([255, 0, 51], (outside.sum(), 3)))
    np.testing.assert_array_equal(reproject(picture, AROUND, ball, nothing=None)[..., 3], np.where(outside, 0, 255))


@pytest.mark.parametrize("kind", ["uint8", "uint16", "int16", "float32", "float64"])
@pytest.mark.parametrize("channels", [(), (1,), (3,), (4,)])
def test_the_kind_and_shape_of_a_picture_stay(kind, channels):
    picture = np.full((256, 512, *channels), 100, kind)
    seen = reproject(picture, AROUND, window(40, 30, 60))
    assert seen.dtype == kind
    np.testing.assert_array_equal(seen, np.full((30, 40, *channels), 100))


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        (np.zeros((10, 10)), r"shape \(256, 512\).*got \(10, 10\)"),
        (np.zeros((256, 512, 5)), "1 to 4 channels, got 5"),
        (np.zeros((256, 512), complex), "got complex128"),
    ],
)
def test_what_cannot_be_reprojected_is_named(picture, words):
    with pytest.raises(ValueError, match=words):
        reproject(picture, AROUND, AROUND)


# The cube ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("face", "towards", "upper_edge"),
    [
        ("front", (0, 0, 1), (0, -1, 1)),
        ("right", (1, 0, 0), (1, -1, 0)),
        ("back", (0, 0, -1), (0, -1, -1)),
        ("left", (-1, 0, 0), (-1, -1, 0)),
        ("up", (0, -1, 0), (0, -1, -1)),
        ("down", (0, 1, 0), (0, 1, 1)),
    ],
)
def test_faces_look_where_their_names_say(face, towards, upper_edge):
    camera = face_camera(face, 64)
    ray = camera.unproject([31.5, 31.5])
    np.testing.assert_allclose(ray, towards, atol=1e-12)
    np.testing.assert_allclose(camera.unproject([31.5, -0.5]), np.array(upper_edge) / np.sqrt(2), atol=1e-12)


@pytest.mark.parametrize("layout", Layout)
def test_a_cube_map_is_its_faces(layout, rng):
    cube = cubemap_camera(32, layout)
    rays = split(cube.rays(), layout)
    for face in FACES:
        np.testing.assert_allclose(rays[face], face_camera(face, 32).rays(), atol=1e-12)
    directions = rng.normal(size=(1000, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    np.testing.assert_allclose(cube.unproject(cube.project(directions)), directions, atol=1e-12)


@pytest.mark.parametrize("layout", Layout)
def test_the_border_of_a_face_shows_the_neighbouring_face(layout):
    cube = cubemap_camera(64, layout)
    bordered = split(joined(np.nan_to_num(colours(cube.rays())), layout), layout)
    for face in FACES:
        wider = replace(face_camera(face, 64), intrinsics=centred(66, 66, 32))
        np.testing.assert_allclose(bordered[face], colours(wider.rays()), atol=0.01)


def test_a_picture_that_is_no_cube_is_named():
    with pytest.raises(ValueError, match="4 faces wide and 3 high, got 400 × 200 pixels"):
        split(np.zeros((200, 400)))
    with pytest.raises(ValueError, match="one of front, right, back, left, up, down, got 'top'"):
        face_camera("top", 64)


@pytest.mark.parametrize(
    ("angles", "ray"), [((90, 0, 0), (1, 0, 0)), ((0, 90, 0), (0, -1, 0)), ((0, 0, 90), (0, 0, 1))]
)
def test_a_window_turns_right_and_up(angles, ray):
    yaw, pitch, roll = angles
    camera = window(65, 65, 60, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    np.testing.assert_allclose(camera.unproject([32, 32]), ray, atol=1e-12)


def test_a_window_rolled_clockwise_has_its_upper_edge_on_the_right():
    edge = window(65, 65, 90, roll_deg=90).unproject([32, -0.5])
    np.testing.assert_allclose(edge, np.array([1, 0, 1]) / np.sqrt(2), atol=1e-12)
